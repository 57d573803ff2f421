/* palpate-rig: a bad network between programs of this host (README.md): TCP and LCM through network paths, in real
 * time. */
#include "server/base/clock.h"
#include "server/base/flags.h"
#include "server/base/json_members.h"
#include "tests/rig/lcm_proxy.h"
#include "tests/rig/tcp_proxy.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>

typedef struct rig {
    network_path up, down; /* to and from the server */
    rig_lateness lateness;
    tcp_proxy *tcp;
    lcm_proxy *lcm;
    uint64_t start_ns;
} rig;

static volatile sig_atomic_t main_ended;

static void main_on_signal(int number)
{
    (void)number;
    main_ended = 1;
}

static int main_list(void)
{
    printf("%-8s %8s %8s %6s %8s  %s\n", "profile", "RTT ms", "+- ms", "loss %", "reorder %", "outage");
    for (const network_profile *p = network_profiles; p->name; p++) {
        printf("%-8s %8g %8g %6g %8g   ", p->name, p->round_trip_s * 1e3, p->jitter_s * 1e3, p->loss * 1e2,
               p->reorder * 1e2);
        if (p->outage_s > 0)
            printf("%g s every %g s, the first after %g s\n", p->outage_s, p->outage_every_s, p->outage_at_s);
        else
            printf("none\n");
    }
    return 0;
}

static cJSON *main_counts(const network_counts *c)
{
    return PAL_JSON({"packets", JSON_NUMBER(c->packets)}, {"bytes", JSON_NUMBER(c->bytes)},
                    {"lost", JSON_NUMBER(c->lost)}, {"in_outage", JSON_NUMBER(c->in_outage)},
                    {"queue_dropped", JSON_NUMBER(c->queue_dropped)}, {"reordered", JSON_NUMBER(c->reordered)},
                    {"retransmissions", JSON_NUMBER(c->retransmissions)}, {"given_up", JSON_NUMBER(c->given_up)});
}

static void main_report(const rig *r, const pal_flag_common *common, double seconds)
{
    const char *profile = r->up.profile.name;
    const rig_lateness *late = &r->lateness;
    const double late_us = late->n ? (double)late->sum_ns * 1e-3 / (double)late->n : 0;
    if (common->json) {
        cJSON *report = PAL_JSON({"profile", JSON_TEXT(profile)}, {"seconds", JSON_NUMBER(seconds)},
                                 {"connections", r->tcp ? JSON_NUMBER(tcp_proxy_accepted(r->tcp)) : NULL},
                                 {"refused", r->tcp ? JSON_NUMBER(tcp_proxy_refused(r->tcp)) : NULL},
                                 {"senders", r->lcm ? JSON_NUMBER(lcm_proxy_senders(r->lcm)) : NULL},
                                 {"failed", r->lcm ? JSON_NUMBER(lcm_proxy_failed(r->lcm)) : NULL},
                                 {"up", main_counts(&r->up.count)}, {"down", main_counts(&r->down.count)},
                                 {"lateness_us", PAL_JSON({"mean", JSON_NUMBER(late_us)},
                                                          {"max", JSON_NUMBER((double)late->max_ns * 1e-3)})});
        (void)pal_json_write(stdout, report);
        return;
    }
    if (common->quiet) return;
    const network_path *path[] = {&r->up, &r->down};
    for (int d = 0; d < 2; d++) {
        const network_counts *c = &path[d]->count;
        printf(
            "%-11s %llu packets, %llu bytes; lost %llu, in an outage %llu, queue full %llu, reordered %llu, sent again "
            "%llu\n",
            d ? "from server:" : "to server:", (unsigned long long)c->packets, (unsigned long long)c->bytes,
            (unsigned long long)c->lost, (unsigned long long)c->in_outage, (unsigned long long)c->queue_dropped,
            (unsigned long long)c->reordered, (unsigned long long)c->retransmissions);
    }
    printf("%.1f s; packets went on late by %.0f us in the mean, %.0f us at most\n", seconds, late_us,
           (double)late->max_ns * 1e-3);
}

/* until then nothing happens; a descriptor or a signal may come before */
static void main_wait(const rig *r, uint64_t now_ns, uint64_t end_ns)
{
    struct pollfd fd[TCP_PROXY_FDS + LCM_PROXY_FDS];
    int n = 0;
    uint64_t next = end_ns;
    if (r->tcp) {
        n += tcp_proxy_watch(r->tcp, now_ns, fd);
        next = tcp_proxy_next_ns(r->tcp, now_ns) < next ? tcp_proxy_next_ns(r->tcp, now_ns) : next;
    }
    if (r->lcm) {
        n += lcm_proxy_watch(r->lcm, fd + n);
        next = lcm_proxy_next_ns(r->lcm) < next ? lcm_proxy_next_ns(r->lcm) : next;
    }
    const uint64_t wait = next > now_ns ? next - now_ns : 0;
    const struct timespec time = {.tv_sec = (time_t)(wait / 1000000000u), .tv_nsec = (long)(wait % 1000000000u)};
    /* a signal between the look at main_ended and this call must end it: SIGINT and SIGTERM are blocked elsewhere */
    sigset_t none;
    sigemptyset(&none);
    (void)ppoll(fd, (nfds_t)n, next == NETWORK_LOST ? NULL : &time, &none);
}

static void main_signals(void)
{
    const struct sigaction end = {.sa_handler = main_on_signal};
    sigset_t blocked;
    sigemptyset(&blocked);
    sigaddset(&blocked, SIGINT);
    sigaddset(&blocked, SIGTERM);
    sigprocmask(SIG_BLOCK, &blocked, NULL);
    sigaction(SIGINT, &end, NULL);
    sigaction(SIGTERM, &end, NULL);
}

static pal_err main_open(rig *r, const char *tcp, const char *lcm, pal_diagnostic *diag)
{
    if (tcp) PAL_TRY(tcp_proxy_open(tcp, &r->up, &r->down, &r->lateness, diag, &r->tcp));
    if (lcm) PAL_TRY(lcm_proxy_open(lcm, &r->up, &r->down, &r->lateness, diag, &r->lcm));
    return PAL_ERR_OK;
}

static int main_run(rig *r, const pal_flag_common *common, double seconds, const char *tcp, const char *lcm)
{
    pal_diagnostic diag = {""};
    const pal_err err = main_open(r, tcp, lcm, &diag);
    if (err) {
        fprintf(stderr, "palpate-rig: %s\n", diag.text[0] ? diag.text : pal_err_text(err));
    } else {
        const int port = r->tcp ? tcp_proxy_port(r->tcp) : 0;
        if (common->json)
            (void)pal_json_write(stdout, PAL_JSON({"port", JSON_NUMBER(port)}, {"pid", JSON_NUMBER(getpid())}));
        else if (!common->quiet && r->tcp)
            printf("listening on 127.0.0.1:%d\n", port);
        fflush(stdout);
        const uint64_t end_ns = seconds > 0 ? (uint64_t)(seconds * 1e9) : NETWORK_LOST;
        uint64_t now_ns = 0;
        while (!main_ended && now_ns < end_ns) {
            main_wait(r, now_ns, end_ns);
            now_ns = pal_clock_ns() - r->start_ns;
            if (r->tcp) tcp_proxy_run(r->tcp, now_ns);
            if (r->lcm) lcm_proxy_run(r->lcm, now_ns);
        }
        main_report(r, common, (double)now_ns * 1e-9);
    }
    tcp_proxy_close(r->tcp);
    lcm_proxy_close(r->lcm);
    return err ? 1 : 0;
}

int main(int argc, char **argv)
{
    const char *name = "lan", *tcp = NULL, *lcm = NULL;
    double seconds = 0, ms[3] = {NAN, NAN, NAN}, percent[2] = {NAN, NAN}, kbit_s = NAN, outage[3] = {NAN, NAN, NAN};
    int seed = 1;
    bool list = false;
    pal_flag_common common;
    const pal_flag flag[] = {
        {"--tcp", "PORT:ADDRESS:PORT", PAL_FLAG_TEXT, &tcp, 0, 0, "own port on 127.0.0.1 (0: any) and the server"},
        {"--lcm", "GROUP:PORT,GROUP:PORT", PAL_FLAG_TEXT, &lcm, 0, 0, "multicast group of the servers, of the clients"},
        {"--profile", "NAME", PAL_FLAG_TEXT, &name, 0, 0, "one of --list (lan); the flags below change it"},
        {"--list", NULL, PAL_FLAG_SWITCH, &list, 0, 0, "the profiles"},
        {"--seed", "N", PAL_FLAG_COUNT, &seed, 0, 1e9, "of what happens by chance (1)"},
        {"--rtt-ms", "MS", PAL_FLAG_NUMBER, &ms[0], 0, 10000, "round trip"},
        {"--jitter-ms", "MS", PAL_FLAG_NUMBER, &ms[1], 0, 10000, "round trip is longer or shorter by up to this"},
        {"--queue-ms", "MS", PAL_FLAG_NUMBER, &ms[2], 1, 10000, "what a line of limited bandwidth queues (200)"},
        {"--loss", "PERCENT", PAL_FLAG_NUMBER, &percent[0], 0, 100, "of the packets in each direction"},
        {"--reorder", "PERCENT", PAL_FLAG_NUMBER, &percent[1], 0, 100, "of the datagrams go a path twice as long"},
        {"--kbit-s", "N", PAL_FLAG_NUMBER, &kbit_s, 0, 1e8, "bandwidth of each direction; 0: without limit (0)"},
        {"--outage", "S", PAL_FLAG_NUMBER, &outage[0], 0, 1e6, "nothing arrives for this time"},
        {"--outage-at", "S", PAL_FLAG_NUMBER, &outage[1], 0, 1e6, "from the start to the first outage"},
        {"--outage-every", "S", PAL_FLAG_NUMBER, &outage[2], 0, 1e6, "from one outage to the next; 0: one only"},
        {"--seconds", "S", PAL_FLAG_NUMBER, &seconds, 0.1, 86400, "end after this time (never)"},
    };
    const pal_flag_table table = {
        .program = "palpate-rig",
        .usage = "--tcp PORT:ADDRESS:PORT | --lcm GROUP:PORT,GROUP:PORT [flags]",
        .about =
            "Passes TCP connections and LCM datagrams on as a bad network does: late, unevenly, in part, in another\n"
            "order, slowly, or not for a while. What happens by chance follows from the seed.\n",
        .example = "palpate-rig --list\n"
                   "palpate-rig --tcp 9090:127.0.0.1:8090 --profile 80 --seconds 2\n"
                   "palpate-rig --tcp 9090:127.0.0.1:8090 --kbit-s 1000 --rtt-ms 50 --seed 7 --seconds 2 --json\n"
                   "palpate-rig --lcm 239.255.76.67:7667,239.255.76.67:7668 --profile 150 --seconds 2\n",
        PAL_FLAGS(flag),
        .note = "Programs then use ws://127.0.0.1:9090/ws in place of ws://127.0.0.1:8090/ws, and the bus\n"
                "udpm://239.255.76.67:7668?ttl=0 in place of udpm://239.255.76.67:7667?ttl=0.\n"};
    const int code = pal_flags_parse(&table, argc, argv, &common, NULL, NULL);
    if (code >= 0) return code;
    if (list) return main_list();
    const network_profile *known = network_find_profile(name);
    if (!known) return pal_flags_wrong(&common, "no profile \"%.40s\" (--list)", name);
    if (!tcp && !lcm) return pal_flags_wrong(&common, "--tcp or --lcm is missing");
    network_profile p = *known;
    double *const value[] = {&p.round_trip_s, &p.jitter_s, &p.queue_s,     &p.loss,          &p.reorder,
                             &p.bits_s,       &p.outage_s, &p.outage_at_s, &p.outage_every_s};
    const double given[] = {ms[0] * 1e-3, ms[1] * 1e-3, ms[2] * 1e-3, percent[0] * 1e-2, percent[1] * 1e-2,
                            kbit_s * 1e3, outage[0],    outage[1],    outage[2]};
    for (size_t i = 0; i < sizeof value / sizeof *value; i++)
        if (!isnan(given[i])) *value[i] = given[i];
    pal_diagnostic diag = {""};
    if (network_check_profile(&p, &diag)) return pal_flags_wrong(&common, "%s", diag.text);
    main_signals();
    rig r = {.start_ns = pal_clock_ns()};
    /* seeds of the directions: 2 n and 2 n + 1 */
    r.up = network_path_make(&p, 2 * (uint64_t)seed);
    r.down = network_path_make(&p, 2 * (uint64_t)seed + 1);
    return main_run(&r, &common, seconds, tcp, lcm);
}
