/* Gives an order on the bus, three times as senders do, and prints what the session reports: "done TEXT" or "refused
 * CODE TEXT", or after `pause` "paused by ROLE" from the status. With TRIANGLES N it waits for a table of N triangles
 * or more instead, and prints their number. Ends with 1 when nothing comes within S seconds. usage: [CHANNEL=PREFIX]
 * order_lcm S BUS SESSION KEY_FILE|- VERB|TRIANGLES [KEY=VALUE|N]... */
#include "clients/link/lcm_link.h"
#include "palpate_answer_t.h"
#include "palpate_order_t.h"
#include "palpate_session_status_t.h"
#include "palpate_triangles_t.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static pal_link_loop *loop;
static pal_lcm_link *lcm;
static palpate_order_t order;
static const char *session;
static int n_heard, n_wanted;

static void heard(void *user, const char *channel, const void *bytes, size_t n_byte, uint64_t source)
{
    (void)user, (void)source;
    palpate_answer_t answer;
    palpate_triangles_t triangles;
    if (n_wanted && strstr(channel, "/TRIANGLES/")) {
        if (palpate_triangles_t_decode(bytes, 0, (int)n_byte, &triangles) < 0) return;
        const int n = triangles.n_corner / 3;
        palpate_triangles_t_decode_cleanup(&triangles);
        if (n < n_wanted) return;
        printf("%d\n", n);
        n_heard++;
    } else if (!n_wanted && strstr(channel, "/ANSWER")) {
        if (palpate_answer_t_decode(bytes, 0, (int)n_byte, &answer) < 0) return;
        if (answer.seq != order.seq) return;
        printf(answer.done ? "done%s %s\n" : "refused %s %s\n", answer.code, answer.text);
        palpate_answer_t_decode_cleanup(&answer);
        n_heard++;
    } else if (!n_wanted && strstr(channel, "/STATUS") && !strcmp(order.verb, "pause")) {
        palpate_session_status_t status;
        if (palpate_session_status_t_decode(bytes, 0, (int)n_byte, &status) < 0) return;
        n_heard = status.state == 2;
        if (n_heard) printf("paused by %d\n", status.role);
        palpate_session_status_t_decode_cleanup(&status);
        if (!n_heard) return;
    } else {
        return;
    }
    fflush(stdout);
    pal_link_stop(loop);
}

static bool wants(void *user, const char *channel)
{
    char own[PAL_LCM_CHANNEL_MAX + 1];
    (void)user;
    pal_lcm_channel(own, pal_lcm_link_prefix(lcm), session, "", -1);
    return !strncmp(channel, own, strlen(own));
}

static void give(void *user)
{
    static int n_given;
    (void)user;
    if (n_given++ < 3) (void)pal_lcm_link_publish(lcm, session, "ORDER", -1, palpate_order_t_get_type_info(), &order);
}

int main(int argc, char **argv)
{
    static const pal_lcm_events events = {wants, heard, NULL};
    static char *key[16], none[] = "";
    static double value[16];
    pal_diagnostic diag = {""};
    if (argc < 6) return 2;
    session = argv[3];
    order = (palpate_order_t){
        .seq = 1, .version = PAL_LCM_VERSION, .verb = argv[5], .target = none, .key = key, .value = value};
    if (!strcmp(argv[5], "TRIANGLES")) n_wanted = argc > 6 ? atoi(argv[6]) : 1;
    for (int i = 6; i < argc && !n_wanted; i++) {
        char *equal = strchr(argv[i], '=');
        if (!equal) return 2;
        *equal = 0, key[order.n_arg] = argv[i], value[order.n_arg++] = atof(equal + 1);
    }
    pal_err err = pal_link_loop_create(&loop);
    const pal_lcm_options bus = {argv[2], getenv("CHANNEL"), strcmp(argv[4], "-") ? argv[4] : NULL};
    if (!err) err = pal_lcm_link_open(loop, &bus, &events, NULL, &diag, &lcm);
    if (!err) err = pal_lcm_link_subscribe(lcm, ".*/ANSWER", palpate_answer_t_get_type_info());
    if (!err) err = pal_lcm_link_subscribe(lcm, ".*/STATUS", palpate_session_status_t_get_type_info());
    if (!err) err = pal_lcm_link_subscribe(lcm, ".*/TRIANGLES/.*", palpate_triangles_t_get_type_info());
    if (!err && !n_wanted && !pal_link_add_timer(loop, 200000, give, NULL)) err = PAL_ERR_MEMORY;
    if (err) fprintf(stderr, "order_lcm: %s\n", diag.text);
    if (!err) pal_link_run_for(loop, atof(argv[1]));
    pal_link_loop_destroy(loop);
    pal_lcm_link_close(lcm);
    return err || n_heard == 0;
}
