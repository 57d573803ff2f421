/* palpate-lcm: a session on an LCM bus. A process of its own, because two forged datagrams can end any process that
 * subscribes with LCM 1.3.1; `palpate serve --lcm URL` starts it and starts it again. */
#include "clients/lcm_bridge/lcm_bridge.h"
#include "server/base/flags.h"
#include "server/base/json_members.h"
#include "server/base/log.h"

#include <stdio.h>

int main(int argc, char **argv)
{
    const char *server = "ws://127.0.0.1:8090/ws", *lcm = "udpm://239.255.76.67:7667?ttl=0", *session = NULL,
               *key_file = NULL, *channel = NULL;
    pal_flag_common common;
    double seconds = 0;
    const pal_flag flag[] = {
        {"--server", "URL", PAL_FLAG_TEXT, &server, 0, 0, "palpate server (ws://127.0.0.1:8090/ws)"},
        {"--lcm", "URL", PAL_FLAG_TEXT, &lcm, 0, 0, "LCM bus (udpm://239.255.76.67:7667?ttl=0)"},
        {"--session", "NAME", PAL_FLAG_TEXT, &session, 0, 0, "name in the channels (the server's)"},
        {"--channel", "PREFIX", PAL_FLAG_TEXT, &channel, 0, 0, "of the channels; one a rig (PALPATE1)"},
        {"--lcm-key", "FILE", PAL_FLAG_TEXT, &key_file, 0, 0,
         "key file: sign what goes to the bus, and take only what was signed with a key in it (PALPATE_LCM_KEY, or "
         "none)"},
        {"--seconds", "S", PAL_FLAG_NUMBER, &seconds, 0.1, 1e6, "end after this time (never)"},
    };
    const pal_flag_table table = {
        .program = "palpate-lcm",
        .usage = "[flags]",
        .about =
            "Takes a session to an LCM bus: body frames, status and haptic models out, tool states and orders in, on "
            "channels\n"
            "PREFIX/<session>/...; the types are in lcmtypes/. Its members have the role and tool of the ticket in\n"
            "PALPATE_TICKET, or behind the # of the server's URL.\n",
        PAL_FLAGS(flag)};
    const int code = pal_flags_parse(&table, argc, argv, &common, NULL, NULL);
    if (code >= 0) return code;
    pal_log_set_level(common.quiet || common.json ? PAL_LOG_WARN : PAL_LOG_INFO);
    pal_diagnostic diag = {""};
    pal_link_loop *loop = NULL;
    pal_lcm_bridge *bridge = NULL;
    pal_err err = pal_link_loop_create(&loop);
    if (!err)
        err = pal_lcm_bridge_open(loop, &(pal_lcm_bridge_options){server, session, {lcm, channel, key_file}}, &diag,
                                  &bridge);
    if (!err) err = pal_link_stop_on_signals(loop);
    if (err)
        fprintf(stderr, "palpate-lcm: %s\n", diag.text[0] ? diag.text : pal_err_text(err));
    else
        pal_link_run_for(loop, seconds);
    if (!err && common.json) {
        const pal_lcm_bridge_counts c = pal_lcm_bridge_count(bridge);
        cJSON *report = PAL_JSON({"frames", JSON_NUMBER(c.n_frame)}, {"frames_dropped", JSON_NUMBER(c.n_frame_dropped)},
                                 {"states", JSON_NUMBER(c.n_state)}, {"states_refused", JSON_NUMBER(c.n_state_refused)},
                                 {"models", JSON_NUMBER(c.n_model)}, {"triangles", JSON_NUMBER(c.n_triangles)},
                                 {"orders", JSON_NUMBER(c.n_order)}, {"orders_refused", JSON_NUMBER(c.n_order_refused)},
                                 {"statuses", JSON_NUMBER(c.n_status)});
        (void)pal_json_write(stdout, report);
    }
    const bool refused = !err && pal_lcm_bridge_count(bridge).refused;
    pal_link_loop_destroy(loop);
    pal_lcm_bridge_close(bridge);
    return err || refused ? 1 : 0;
}
