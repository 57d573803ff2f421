/* Cross-fades: linear, over a time, whatever the steps are. */
#include "server/sim/core/blend.h"
#include "tests/check.h"

/* a share rises and falls at 1 / duration, ends on its goal exactly and does not pass it */
static void a_share_reaches_its_goal_in_its_time(void)
{
    static const int per_s[] = {60, 120, 240, 1000};
    for (int k = 0; k < 4; k++) {
        const double dt = 1.0 / per_s[k];
        double share = 0;
        int n = 0;
        for (; share < 1; n++) {
            CHECK_NEAR(share, n * dt / 0.5, 1e-12);
            share = pal_blend_toward(share, 1, dt, 0.5);
        }
        CHECK_INT(n, per_s[k] / 2);
        CHECK_NEAR(pal_blend_toward(1, 0, dt, 0.5), 1 - dt / 0.5, 1e-12);
        CHECK_NEAR(pal_blend_toward(0.25 * dt, 0, dt, 0.5), 0, 0);
    }
    CHECK_NEAR(pal_blend_toward(0.3, 1, 1e-3, 0), 1, 0);
}

/* a difference is released linearly: what is left after each step is the share of the time that is left */
static void a_difference_is_released_linearly(void)
{
    double left_s = 0.4, difference = 3;
    for (int n = 1; n <= 24; n++) {
        difference *= pal_blend_release(&left_s, 1.0 / 60);
        CHECK_NEAR(difference, 3 * (1 - n / 24.0), 1e-12);
    }
    CHECK_NEAR(difference, 0, 0);
    CHECK_NEAR(pal_blend_release(&left_s, 1.0 / 60), 0, 0);
}

int main(void)
{
    RUN(a_share_reaches_its_goal_in_its_time);
    RUN(a_difference_is_released_linearly);
    return check_report();
}
