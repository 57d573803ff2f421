/* The watch of a return on histories that are known: exponentials are recognised and their return is extrapolated, what
 * stands off rest, sleeps there, is inverted or never ends is not taken for a return. */
#include "server/robustness/return_watch.h"
#include "server/robustness/tuning.h"
#include "tests/check.h"

static const double step_s = 1.0 / 60;

/* left = base + a exp(-t / tau_a) + b exp(-t / tau_b), swinging with `swing_1_s` */
typedef struct history {
    double base, a, tau_a, b, tau_b, swing_1_s;
    bool inverted;
    double asleep_s; /* from then on; 0: never */
} history;

static double left_S(const history *h, double t)
{
    double decay = h->a * exp(-t / h->tau_a) + (h->b > 0 ? h->b * exp(-t / h->tau_b) : 0);
    return h->base + decay * fabs(cos(h->swing_1_s * t));
}

static pal_return_state watch(const history *h, double tau_s, double limit_s, pal_return_watch *w, double *ended_s)
{
    pal_return_state state = PAL_RETURN_OPEN;
    pal_return_watch_begin(w, tau_s, limit_s);
    double t = 0;
    while (state == PAL_RETURN_OPEN && t < 1e5) {
        t += step_s;
        const bool asleep = h->asleep_s > 0 && t >= h->asleep_s;
        const pal_return_look look = {t, left_S(h, t), asleep ? 0 : fabs(left_S(h, t) - left_S(h, t - step_s)) / step_s,
                                      h->inverted, asleep};
        state = pal_return_watch_look(w, &look);
    }
    *ended_s = t;
    return state;
}

/* known: the time constant itself, another one, none */
static void a_clean_exponential_is_slow_with_the_right_time(void)
{
    static const double tau[] = {12, 40, 282}, known[] = {1, 0.2, 4, 0};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 4; k++) {
            const history h = {.a = 0.05, .tau_a = tau[i]};
            const double back_s = tau[i] * log(50);
            pal_return_watch w;
            double ended_s;
            CHECK_INT(watch(&h, known[k] * tau[i], 20 * tau[i], &w, &ended_s), PAL_RETURN_SLOW);
            CHECK_NEAR(w.return_s, back_s, 0.05 * back_s);
            CHECK_LE(ended_s, back_s / PAL_TREND_SAVES);
            printf("  tau %3.0f s, %.1f of it known: returns in %.4g s, seen after %.3g s\n", tau[i], known[k],
                   w.return_s, ended_s);
        }
}

static void a_faster_mode_before_it_is_waited_for(void)
{
    const history h = {.a = 0.01, .tau_a = 120, .b = 0.05, .tau_b = 6};
    pal_return_watch w;
    double ended_s;
    CHECK_INT(watch(&h, 120, 1000, &w, &ended_s), PAL_RETURN_SLOW);
    CHECK_NEAR(w.return_s, 120 * log(10), 0.05 * 120 * log(10));
}

static void what_returns_soon_is_measured(void)
{
    const history fast = {.a = 0.05, .tau_a = 1}, swinging = {.a = 0.05, .tau_a = 2, .swing_1_s = 5};
    pal_return_watch w;
    double ended_s;
    CHECK_INT(watch(&fast, 1, 10, &w, &ended_s), PAL_RETURN_BACK);
    CHECK_NEAR(w.return_s, log(50), 2 * step_s);
    CHECK_INT(watch(&swinging, 2, 30, &w, &ended_s), PAL_RETURN_BACK);
    CHECK_LE(w.return_s, 2 * log(50) + step_s);
}

static void what_stands_off_rest_is_stuck(void)
{
    const history still = {.base = 0.02}, fast = {.base = 0.005, .a = 0.02, .tau_a = 5},
                  slow = {.base = 0.005, .a = 0.02, .tau_a = 40};
    pal_return_watch w;
    double ended_s;
    CHECK_INT(watch(&still, 1, 10, &w, &ended_s), PAL_RETURN_STUCK);
    CHECK_LE(ended_s, 1);
    CHECK_INT(watch(&fast, 5, 60, &w, &ended_s), PAL_RETURN_STUCK);
    const pal_return_state state = watch(&slow, 40, 400, &w, &ended_s);
    CHECK(state == PAL_RETURN_STUCK || state == PAL_RETURN_MOVES);
    CHECK(isinf(w.return_s));
}

static void inverted_at_rest_is_no_return(void)
{
    const history near = {.base = 2e-4, .inverted = true}, far = {.a = 0.05, .tau_a = 40, .inverted = true};
    pal_return_watch w;
    double ended_s;
    CHECK_INT(watch(&near, 1, 10, &w, &ended_s), PAL_RETURN_INVERTED);
    CHECK_INT(watch(&far, 40, 100, &w, &ended_s), PAL_RETURN_INVERTED);
    CHECK_NEAR(ended_s, 100, 2 * step_s);
}

static void asleep_off_rest_is_no_return(void)
{
    const history off = {.a = 0.05, .tau_a = 40, .asleep_s = 2}, at = {.a = 0.05, .tau_a = 0.3, .asleep_s = 1.2};
    pal_return_watch w;
    double ended_s;
    CHECK_INT(watch(&off, 40, 300, &w, &ended_s), PAL_RETURN_ASLEEP);
    CHECK_NEAR(ended_s, 2, 2 * step_s);
    CHECK_INT(watch(&at, 0.3, 10, &w, &ended_s), PAL_RETURN_BACK);
}

static void what_never_ends_is_given_up_when_its_time_is_over(void)
{
    const history swinging = {.a = 0.02, .tau_a = 1e9, .swing_1_s = 1};
    pal_return_watch w;
    double ended_s;
    CHECK_INT(watch(&swinging, 5, 50, &w, &ended_s), PAL_RETURN_MOVES);
    CHECK_NEAR(ended_s, 50, 2 * step_s);
    CHECK(isinf(w.return_s));
}

static void time_allowed_follows_from_frequency_and_time_constant(void)
{
    CHECK_NEAR(pal_return_limit_s(0, 0, 0.1, 10), 10, 0);
    CHECK_NEAR(pal_return_limit_s(7, 0.5, 0.1, 10), 10, 0);
    CHECK_NEAR(pal_return_limit_s(0.119, 282, 0.1, 10), 7 / 0.119 + 1.5 * 282 * log(100), 1e-9);
    CHECK_NEAR(pal_return_limit_s(0.5, 15, 1e-4, 10), 14, 1e-12);
}

int main(void)
{
    RUN(a_clean_exponential_is_slow_with_the_right_time);
    RUN(a_faster_mode_before_it_is_waited_for);
    RUN(what_returns_soon_is_measured);
    RUN(what_stands_off_rest_is_stuck);
    RUN(inverted_at_rest_is_no_return);
    RUN(asleep_off_rest_is_no_return);
    RUN(what_never_ends_is_given_up_when_its_time_is_over);
    RUN(time_allowed_follows_from_frequency_and_time_constant);
    return check_report();
}
