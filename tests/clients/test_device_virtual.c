/* The virtual plant against analytic answers, and its determinism. */
#include "clients/haptic_bridge/device_virtual.h"
#include "tests/check.h"

static void *opened(const char *id, pal_dev_info *info)
{
    void *device = NULL;
    if (pal_device_virtual()->open(&device, id, info)) return NULL;
    pal_device_virtual()->force_enable(device, 1);
    return device;
}

/* a constant push on mass and viscous friction: v = F/b (1 - exp(-b t / m)) */
static void push_against_viscous_friction_follows_the_exponential(void)
{
    pal_dev_info info;
    void *d = opened("premium,hand=off,clock=virtual", &info);
    REQUIRE(d);
    const double mass = 0.075; /* clients/haptic_bridge/README.md, "Devices" */
    double v[3];
    const double push[3] = {0.2, 0, 0};
    pal_virtual_set_friction(d, 1.5, 0);
    pal_virtual_push(d, push);
    for (int i = 1; i <= 200; i++) {
        pal_virtual_advance(d, 1e-3);
        pal_virtual_truth(d, NULL, v, NULL);
        CHECK_NEAR(v[0], 0.2 / 1.5 * (1 - exp(-1.5 * i * 1e-3 / mass)), 2e-3 * 0.2 / 1.5);
    }
    pal_device_virtual()->close(d);
}

/* a hand that is far heavier and held fast leaves a mass on a spring: with the average hand's k1, b1 the damped
 * frequency is sqrt(k/m - (b/2m)^2); measured here on a device spring made of forces with the plant's own lag removed
 */
static void hand_spring_rings_with_the_frequency_of_mass_and_spring(void)
{
    pal_dev_info info;
    void *d = opened("omega3,hand=off,clock=virtual,lag=0.0001", &info);
    REQUIRE(d);
    pal_virtual_set_friction(d, 0.4, 0);
    const double none[3] = {0, 0, 0}, start[3] = {0.005, 0, 0}, torque[3] = {0, 0, 0};
    pal_virtual_push(d, none);
    pal_virtual_place(d, start);
    /* spring of 50 N/m by force, applied each 50 us sub-step one sub-step late */
    const double k = 50, m = 0.25, b = 0.4 - k * 50e-6, w = sqrt(k / m - b * b / (4 * m * m));
    double x[3], v[3], worst = 0;
    for (int i = 1; i <= 20000; i++) {
        pal_virtual_truth(d, x, v, NULL);
        const double force[3] = {-k * x[0], 0, 0};
        pal_device_virtual()->write(d, force, torque, 0);
        pal_virtual_advance(d, 50e-6);
        pal_virtual_truth(d, x, NULL, NULL);
        const double t = i * 50e-6;
        const double wanted = 0.005 * exp(-b / (2 * m) * t) * (cos(w * t) + b / (2 * m * w) * sin(w * t));
        worst = fmax(worst, fabs(x[0] - wanted));
    }
    CHECK_LE(worst, 0.01 * 0.005);
    pal_device_virtual()->close(d);
}

static void coulomb_friction_holds_below_its_force_and_gives_way_above(void)
{
    pal_dev_info info;
    void *d = opened("touch,hand=off,clock=virtual", &info);
    REQUIRE(d);
    const double mass = 0.045, coulomb = 0.26; /* clients/haptic_bridge/README.md, "Devices" */
    double x[3], v[3];
    const double home[3] = {0, 0, 0}, weak[3] = {0.9 * coulomb, 0, 0}, strong[3] = {1.5 * coulomb, 0, 0};
    pal_virtual_place(d, home);
    pal_virtual_push(d, weak);
    pal_virtual_advance(d, 0.1);
    pal_virtual_truth(d, x, v, NULL);
    CHECK_NEAR(x[0], 0, 0);
    CHECK_NEAR(v[0], 0, 0);
    pal_virtual_push(d, strong);
    pal_virtual_advance(d, 0.01);
    pal_virtual_truth(d, x, v, NULL);
    CHECK_NEAR(v[0], 0.5 * coulomb / mass * 0.01, 0.02 * 0.5 * coulomb / mass * 0.01);
    pal_device_virtual()->close(d);
}

static void command_waits_one_tick_and_follows_its_time_constant(void)
{
    pal_dev_info info;
    void *d = opened("touch,hand=off,clock=virtual", &info);
    REQUIRE(d);
    const double force[3] = {1, 0, 0}, torque[3] = {0, 0, 0};
    double given[3];
    pal_device_virtual()->write(d, force, torque, 0);
    pal_virtual_advance(d, 1e-3);
    pal_virtual_truth(d, NULL, NULL, given);
    CHECK_NEAR(given[0], 0, 0);
    pal_virtual_advance(d, 1e-3);
    pal_virtual_truth(d, NULL, NULL, given);
    CHECK_NEAR(given[0], 1 - exp(-1), 1e-9);
    pal_device_virtual()->close(d);
}

static void encoder_shows_whole_steps_and_force_is_cut_at_the_peak(void)
{
    pal_dev_info info;
    void *d = opened("touch,hand=off,clock=virtual", &info);
    REQUIRE(d);
    const double place[3] = {0.01234567, -0.0012, 0.003}, torque[3] = {0, 0, 0}, much[3] = {30, 40, 0};
    pal_virtual_place(d, place);
    pal_dev_state state;
    CHECK_INT(pal_device_virtual()->read(d, &state), 0);
    for (int k = 0; k < 3; k++) {
        const double steps = state.position_m[k] / 0.055e-3;
        CHECK_NEAR(steps, round(steps), 1e-9);
        CHECK(place[k] - state.position_m[k] >= 0 && place[k] - state.position_m[k] < 0.055e-3);
    }
    CHECK_INT(pal_device_virtual()->write(d, much, torque, 0), 1);
    pal_virtual_advance(d, 1e-3);
    pal_virtual_advance(d, 0.05);
    double given[3];
    pal_virtual_truth(d, NULL, NULL, given);
    CHECK_NEAR(given[0], 3.3 * 0.6, 1e-6);
    CHECK_NEAR(given[1], 3.3 * 0.8, 1e-6);
    pal_device_virtual()->close(d);
}

static void stop_takes_the_force_away_at_once(void)
{
    pal_dev_info info;
    void *d = opened("touch,hand=off,clock=virtual", &info);
    REQUIRE(d);
    const double force[3] = {1, 0, 0}, torque[3] = {0, 0, 0};
    double given[3];
    pal_device_virtual()->write(d, force, torque, 0);
    pal_virtual_advance(d, 1e-3);
    pal_virtual_advance(d, 0.02);
    pal_device_virtual()->stop(d);
    pal_virtual_advance(d, 0.01);
    pal_virtual_truth(d, NULL, NULL, given);
    CHECK_LE(fabs(given[0]), 1e-4);
    pal_device_virtual()->close(d);
}

static void same_calls_give_the_same_numbers(void)
{
    double end[2][3];
    for (int turn = 0; turn < 2; turn++) {
        pal_dev_info info;
        void *d = opened("falcon,script=cycle,clock=virtual", &info);
        REQUIRE(d);
        const double torque[3] = {0, 0, 0};
        for (int i = 0; i < 3000; i++) {
            pal_dev_state state;
            pal_device_virtual()->read(d, &state);
            const double force[3] = {0, 0, state.position_m[2] < 0 ? -300 * state.position_m[2] : 0};
            pal_device_virtual()->write(d, force, torque, 0);
            pal_virtual_advance(d, 1e-3);
        }
        pal_virtual_truth(d, end[turn], NULL, NULL);
        pal_device_virtual()->close(d);
    }
    CHECK(memcmp(end[0], end[1], sizeof end[0]) == 0);
    CHECK(end[0][2] < 0.02);
}

/* a servo without fresh models damps by 3 N s/m: at the hand's approach more than what counts as felt, and yet the hand
 * goes on to the surface at z = 0 (300 N/m) and presses there by its depth */
static void damping_on_the_way_is_no_touch(void)
{
    pal_dev_info info;
    void *d = opened("premium,script=press-hold,depth=8,clock=virtual", &info);
    REQUIRE(d);
    const double torque[3] = {0, 0, 0};
    double x[3], v[3], max_above = 0, deepest = 1;
    for (int i = 0; i < 6000; i++) {
        pal_virtual_truth(d, x, v, NULL);
        double force[3] = {-3 * v[0], -3 * v[1], -3 * v[2]};
        if (x[2] > 0) max_above = fmax(max_above, fabs(force[2]));
        if (x[2] < 0) force[2] -= 300 * x[2];
        pal_device_virtual()->write(d, force, torque, 0);
        pal_virtual_advance(d, 1e-3);
        deepest = fmin(deepest, x[2]);
    }
    CHECK(max_above > 0.1);
    /* the hand's two springs in series share the depth with the surface: 8 mm * 134 / (134 + 300), and the touch itself
     */
    CHECK(deepest < -0.002);
    CHECK(deepest > -0.008);
    pal_device_virtual()->close(d);
}

/* closed from half a second after the touch until the hand is back; 2 s up, 2 s held, 2 s back, away */
static void grasp_script_closes_pulls_holds_and_lets_go(void)
{
    pal_dev_info info;
    void *d = opened("inverse3,script=grasp,clock=virtual", &info);
    REQUIRE(d);
    const double torque[3] = {0, 0, 0};
    int ticks[PAL_VIRTUAL_DONE + 1] = {0};
    double x[3], highest = -1, touch = 0;
    for (int i = 0; i < 12000 && pal_virtual_script_phase(d) != PAL_VIRTUAL_DONE; i++) {
        pal_dev_state state;
        pal_device_virtual()->read(d, &state);
        pal_virtual_truth(d, x, NULL, NULL);
        const double force[3] = {0, 0, x[2] < 0 ? -300 * x[2] : 0};
        pal_device_virtual()->write(d, force, torque, 0);
        const int phase = pal_virtual_script_phase(d);
        CHECK_INT((state.buttons & PAL_DEVICE_BUTTON_GRASP) != 0,
                  phase >= PAL_VIRTUAL_CLOSED && phase < PAL_VIRTUAL_OPEN);
        if (phase == PAL_VIRTUAL_CLOSED) touch = x[2];
        if (phase == PAL_VIRTUAL_HOLD) highest = x[2];
        ticks[phase]++;
        pal_virtual_advance(d, 1e-3);
    }
    CHECK_NEAR(ticks[PAL_VIRTUAL_CLOSED], 500, 1);
    CHECK_NEAR(ticks[PAL_VIRTUAL_PULL], 2000, 1);
    CHECK_NEAR(ticks[PAL_VIRTUAL_SETTLE] + ticks[PAL_VIRTUAL_HOLD], 2000, 1);
    CHECK_NEAR(ticks[PAL_VIRTUAL_BACK], 2000, 1);
    CHECK_INT(pal_virtual_script_phase(d), PAL_VIRTUAL_DONE);
    /* nothing pulls back: friction, 0.2 N, and the force of the touch take 5 mm of the hand's 30 at most */
    CHECK_NEAR(highest - touch, 0.03, 0.005);
    pal_device_virtual()->close(d);
}

static void refuses_unknown_devices_hands_and_keys(void)
{
    pal_dev_info info;
    void *d;
    CHECK(pal_device_virtual()->open(&d, "phantom", &info) < 0);
    CHECK(pal_device_virtual()->open(&d, "touch,hand=iron", &info) < 0);
    CHECK(pal_device_virtual()->open(&d, "touch,force=9", &info) < 0);
    CHECK(pal_device_virtual()->open(&d, "touch,depth=x", &info) < 0);
    CHECK(pal_device_find("virtual", 7) == pal_device_virtual());
    CHECK(pal_device_find("nothing", 7) == NULL);
}

int main(void)
{
    RUN(push_against_viscous_friction_follows_the_exponential);
    RUN(hand_spring_rings_with_the_frequency_of_mass_and_spring);
    RUN(coulomb_friction_holds_below_its_force_and_gives_way_above);
    RUN(command_waits_one_tick_and_follows_its_time_constant);
    RUN(encoder_shows_whole_steps_and_force_is_cut_at_the_peak);
    RUN(stop_takes_the_force_away_at_once);
    RUN(same_calls_give_the_same_numbers);
    RUN(damping_on_the_way_is_no_touch);
    RUN(grasp_script_closes_pulls_holds_and_lets_go);
    RUN(refuses_unknown_devices_hands_and_keys);
    return check_report();
}
