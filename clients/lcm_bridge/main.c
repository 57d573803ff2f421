/* palpate-lcm: a session on an LCM bus. A process of its own, because two forged datagrams can end any process that
 * subscribes with LCM 1.3.1; `palpate serve --lcm URL` starts it and starts it again. */
#include "clients/lcm_bridge/lcm_bridge.h"
#include "clients/link/client_flags.h"
#include "server/base/log.h"

#include <stdio.h>

int main(int argc, char **argv)
{
    const char *server = "ws://127.0.0.1:8090/ws", *lcm = "udpm://239.255.76.67:7667?ttl=0", *session = NULL;
    bool json = false, quiet = false;
    double seconds = 0;
    const pal_client_flag flag[] = {
        {"--server", "URL", &server, 0, 0, NULL, "palpate server (ws://127.0.0.1:8090/ws)"},
        {"--lcm", "URL", &lcm, 0, 0, NULL, "LCM bus (udpm://239.255.76.67:7667?ttl=0)"},
        {"--session", "NAME", &session, 0, 0, NULL, "name in the channels (the server's)"},
        {"--seconds", "S", &seconds, 0.1, 1e6, NULL, "end after this time (never)"},
        {"--json", NULL, &json, 0, 0, NULL, "counts as one JSON object at the end"},
        {"--quiet", NULL, &quiet, 0, 0, NULL, "say nothing but warnings"},
    };
    const pal_client_table table = {
        .program = "palpate-lcm",
        .usage = "[flags]",
        .about =
            "Takes a session to an LCM bus: body frames, status and haptic models out, tool states in, on channels\n"
            "PALPATE1/<session>/...; the types are in lcmtypes/.",
        .flag = flag,
        .n_flag = sizeof flag / sizeof flag[0]};
    const int code = pal_client_flags_parse(&table, argc, argv, NULL);
    if (code >= 0) return code;
    pal_log_set_level(quiet || json ? PAL_LOG_WARN : PAL_LOG_INFO);
    pal_diagnostic diag = {""};
    pal_link_loop *loop = NULL;
    pal_lcm_bridge *bridge = NULL;
    pal_err err = pal_link_loop_create(&loop);
    if (!err) err = pal_lcm_bridge_open(loop, &(pal_lcm_bridge_options){server, lcm, session}, &diag, &bridge);
    if (!err) err = pal_link_stop_on_signals(loop);
    if (err)
        fprintf(stderr, "palpate-lcm: %s\n", diag.text[0] ? diag.text : pal_err_text(err));
    else
        pal_link_run_for(loop, seconds);
    if (!err && json) {
        const pal_lcm_bridge_counts c = pal_lcm_bridge_count(bridge);
        printf("{\"frames\":%llu,\"frames_dropped\":%llu,\"states\":%llu,\"states_refused\":%llu,\"models\":%llu,"
               "\"statuses\":%llu}\n",
               (unsigned long long)c.n_frame, (unsigned long long)c.n_frame_dropped, (unsigned long long)c.n_state,
               (unsigned long long)c.n_state_refused, (unsigned long long)c.n_model, (unsigned long long)c.n_status);
    }
    const bool refused = !err && pal_lcm_bridge_count(bridge).refused;
    pal_link_loop_destroy(loop);
    pal_lcm_bridge_close(bridge);
    return err || refused ? 1 : 0;
}
