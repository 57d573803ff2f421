/* Largest tissue stiffness that each device and hand press and hold stably over each network: every stiffness up to the
 * device's limit with a hand, up to half of it with the hand off (a constant push of 0.5 N, and 0.25 N above the
 * friction of 0.6 N of falcon). Beside it the baseline, the tissue's force sent and held. A part of the grid by
 * default; --table runs and prints all of it. */
#include "tests/check.h"
#include "tests/clients/tissue_server.h"

static const char *const devices[] = {"touch", "premium", "omega3", "inverse3", "falcon"};
static const char *const hands[] = {"average", "light", "firm", "off"};
static const double stiffness[] = {25, 50, 100, 200, 300, 400, 500, 800, 1000, 1500, 2000, 3000};
static const double round_trip[] = {0, 0.02, 0.05, 0.1, 0.2};
static const double losses[] = {0, 0.05, 0.2};
enum { N_STIFFNESS = sizeof stiffness / sizeof *stiffness };

/* Pressed by 4 mm of the hand and held: at rest, the speed over half a second is that of encoder steps and friction. An
 * unstable one rings with tens of mm/s to m/s, or is lost */
#define REST_RMS_M_S 0.003

static bool holds_stably(const char *device, const char *hand, double k, double rtt, double loss, bool raw,
                         double *limit)
{
    const tissue_options o = {.k1 = k, .rtt_s = rtt, .loss = loss, .raw = raw};
    const bool off = !strcmp(hand, "off");
    const pal_servo_options servo = {.hand_off = off};
    char id[128];
    tissue_rig r;
    snprintf(id, sizeof id, "%s,hand=%s,script=press-hold,depth=4,height=3,wait=%g,clock=virtual", device, hand,
             raw ? 0.3 : 1.6);
    if (!tissue_open(&r, id, &o, &servo)) return false;
    *limit = r.info.stiffness_max_N_m;
    const double none[3] = {0, 0, 0}, push[3] = {0, 0, !strcmp(device, "falcon") ? -0.85 : -0.5};
    if (off) pal_virtual_push(r.device, none);
    tissue_run(&r, raw ? 0.3 : 1.6);
    if (off) pal_virtual_push(r.device, push);
    tissue_run(&r, 2);
    double squares = 0, force = 0;
    for (int i = 0; i < 500; i++) {
        double v[3], given[3];
        tissue_tick(&r);
        pal_virtual_truth(r.device, NULL, v, given);
        squares += pal_dot3(v, v) / 500;
        force += given[2] / 500;
    }
    const bool limits = !raw && r.view.n_fault > 0;
    tissue_close(&r);
    return sqrt(squares) < REST_RMS_M_S && force > 0.02 && !limits;
}

/* largest stiffness of the grid up to which every one is held; wanted: the one that must be */
static double largest_held(int d, int h, double rtt, double loss, bool raw, const bool *use, double *wanted)
{
    double held = 0, limit = 0;
    bool all = true;
    *wanted = 0;
    for (int k = 0; k < N_STIFFNESS; k++) {
        if (!use[k]) continue;
        if (all) all = holds_stably(devices[d], hands[h], stiffness[k], rtt, loss, raw, &limit);
        if (all) held = stiffness[k];
        if (stiffness[k] <= limit * (h == 3 ? 0.5 : 1)) *wanted = stiffness[k];
    }
    return held;
}

static void every_device_holds_every_stiffness_up_to_its_limit(void)
{
    const bool use[N_STIFFNESS] = {[2] = true, [5] = true, [11] = true};
    static const int network[4][2] = {{0, 0}, {2, 1}, {4, 0}, {4, 2}};
    for (int d = 0; d < 5; d++)
        for (int h = 0; h < 4; h++)
            for (int n = 0; n < CHECK_REPEATS(4, 1); n++) {
                const double rtt = round_trip[network[n][0]], loss = losses[network[n][1]];
                double wanted;
                const double held = largest_held(d, h, rtt, loss, false, use, &wanted);
                CHECK(wanted > 0);
                CHECK_LE(wanted, held);
                if (held < wanted)
                    printf("  %s, hand %s, round trip %.0f ms, loss %.0f %%: %.0f N/m\n", devices[d], hands[h],
                           1e3 * rtt, 100 * loss, held);
            }
}

static void raw_forces_lose_stability_where_models_keep_it(void)
{
    const bool use[N_STIFFNESS] = {[2] = true, [5] = true};
    double wanted;
    CHECK_LE(largest_held(0, 1, 0.2, 0, true, use, &wanted), 100);
    CHECK_NEAR(largest_held(0, 1, 0.2, 0, false, use, &wanted), 400, 0);
}

static int print_table(void)
{
    bool use[N_STIFFNESS];
    int failed = 0;
    for (int k = 0; k < N_STIFFNESS; k++) use[k] = true;
    printf("largest stiffness held, N/m, of 25 to 3000; round trip 0/20/50/100/200 ms; (raw forces)\n");
    for (int d = 0; d < 5; d++)
        for (int h = 0; h < 4; h++)
            for (int l = 0; l < 3; l++) {
                printf("%-9s %-8s loss %2.0f %%: ", devices[d], hands[h], 100 * losses[l]);
                for (int t = 0; t < 5; t++) {
                    double wanted, ignored;
                    const double held = largest_held(d, h, round_trip[t], losses[l], false, use, &wanted);
                    const double raw = largest_held(d, h, round_trip[t], losses[l], true, use, &ignored);
                    failed += held < wanted;
                    printf(" %4.0f%s (%4.0f)", held, held < wanted ? "!" : " ", raw);
                    fflush(stdout);
                }
                printf("\n");
            }
    printf("%d of 300 hold less than the device's limit\n", failed);
    return failed > 0;
}

int main(int argc, char **argv)
{
    if (argc > 1 && !strcmp(argv[1], "--table")) return print_table();
    RUN(every_device_holds_every_stiffness_up_to_its_limit);
    RUN(raw_forces_lose_stability_where_models_keep_it);
    return check_report();
}
