/* The bridge's servo and the stream of contact models: stale, late, in bursts, bad, and of another session. */
#include "tests/fixtures/random.h"
#include "tests/fixtures/servo_trial.h"

static void stale_model_fades_out_in_100_and_500_ms_and_comes_back_slowly(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    const double before = rig_force(&r);
    CHECK(before > 0.1);
    r.serving = false;
    const uint64_t last = r.next_model_ns - FRAME_NS;
    double worst_step = 0, at = before;
    while (r.now_ns < last + 99000000) rig_tick(&r);
    CHECK_NEAR(rig_force(&r), before, 0.02);
    CHECK_INT(r.view.flags & PAL_WIRE_POSE_STALE, 0);
    while (r.now_ns < last + 602000000) {
        rig_tick(&r);
        worst_step = fmax(worst_step, fabs(rig_force(&r) - at));
        at = rig_force(&r);
    }
    CHECK_LE(worst_step, 0.1);
    CHECK(r.view.flags & PAL_WIRE_POSE_STALE);
    CHECK_NEAR(r.view.fade, 0, 0);
    CHECK(rig_event(&r, PAL_EVENT_STALE));
    /* what is left is damping of 0.5 N s/m */
    rig_run(&r, 2);
    CHECK_LE(rig_force(&r), 0.005);
    CHECK_INT(r.view.state, PAL_SERVO_FREE);
    r.serving = true;
    at = rig_force(&r);
    worst_step = 0;
    for (int i = 0; i < 1000; i++) {
        rig_tick(&r);
        worst_step = fmax(worst_step, rig_force(&r) - at);
        at = rig_force(&r);
    }
    CHECK_LE(worst_step, 0.05);
    CHECK(at > 0.1);
    CHECK(rig_event(&r, PAL_EVENT_RECOVERED));
    rig_close(&r);
}

/* the network thread is another one: its stamp may lie after the time with which the tick began */
static void model_that_comes_during_the_tick_is_fresh(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    r.model.seq = ++r.seq;
    r.model.stamp_us = r.now_ns / 1000 + 5;
    pal_servo_put_model(r.servo, &r.model, r.generation, r.now_ns + 5000);
    rig_tick(&r);
    CHECK_INT(r.view.model_seq, r.seq);
    CHECK_INT(r.view.model_age_us, 0);
    CHECK_INT(r.view.n_stale, 0);
    CHECK_NEAR(r.view.fade, 1, 0);
    rig_close(&r);
}

/* a stream stands still; then its oldest models arrive, one each tick, of a surface that is now 4 mm higher, now lower
 */
static void models_of_a_stall_that_arrive_in_a_burst_are_stale(void)
{
    for (int t = 0; t < 2; t++) {
        trial r;
        REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
        rig_run(&r, 4);
        CHECK(rig_force(&r) > 0.1);
        const uint64_t began = r.next_model_ns;
        const int n_late = t ? 80 : 9; /* the newest of them 150 ms old or more */
        double fade = 1, step = 0, at[3];
        r.serving = false;
        rig_run(&r, t ? 1.5 : 0.3);
        fade = r.view.fade;
        CHECK_NEAR(fade, t ? 0 : 0.6, 0.05);
        pal_copy3(at, r.view.force_N);
        for (int i = 0; i < n_late; i++) {
            const uint64_t made = began + (uint64_t)i * FRAME_NS;
            r.model.patch[0].p_m[2] = i % 2 ? 0.004f : -0.004f;
            rig_model(&r, made);
            rig_tick(&r);
            CHECK(r.view.flags & PAL_WIRE_POSE_STALE);
            /* a hundredth of the stall is forgotten */
            CHECK_NEAR(r.view.model_age_us, (double)(r.now_ns - TICK_NS - made) * 1e-3, t ? 16e3 : 4e3);
            CHECK_NEAR(r.view.fade, fmax(0, fade - 2e-3 * (i + 1)), 1e-9);
            step = fmax(step, pal_dist3(at, r.view.force_N));
            pal_copy3(at, r.view.force_N);
        }
        CHECK_INT(r.view.n_stale, 1);
        /* models in time again */
        r.model.patch[0].p_m[2] = 0;
        r.next_model_ns = r.now_ns;
        r.serving = true;
        for (int i = 0; i < 2000; i++) {
            rig_tick(&r);
            step = fmax(step, pal_dist3(at, r.view.force_N));
            pal_copy3(at, r.view.force_N);
        }
        printf("  stall of %g s: largest step %.3f N, at the end %.2f N\n", t ? 1.5 : 0.3, step, rig_force(&r));
        CHECK_LE(step, 0.1);
        CHECK_INT(r.view.n_stale, 1);
        CHECK(rig_force(&r) > 0.1);
        rig_close(&r);
    }
}

/* one way of a round trip of 150 ms with jitter of 50 ms, in order; then the way is longer by 200 ms for good */
static void jitter_makes_nothing_stale_and_a_longer_way_becomes_the_usual_one(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=cycle,clock=virtual", 300));
    uint64_t seed = 7, made = r.now_ns, arrives = 0, oldest_us = 0, stale_ticks = 0;
    double peak = 0;
    r.serving = false;
    for (int i = 0; i < 50000; i++) {
        const double way = 0.075 + 0.025 * random_signed(&seed) + (i < 30000 ? 0 : 0.2);
        if (arrives == 0) arrives = made + (uint64_t)(way * 1e9);
        if (arrives <= r.now_ns) {
            rig_model(&r, made);
            made += FRAME_NS;
            arrives = 0;
        }
        rig_tick(&r);
        if (i < 30000) {
            CHECK_INT(r.view.n_stale, 0);
            oldest_us = r.view.model_age_us > oldest_us ? r.view.model_age_us : oldest_us;
        }
        if (i >= 45000) peak = fmax(peak, rig_force(&r));
        if (i >= 31000) stale_ticks += (r.view.flags & PAL_WIRE_POSE_STALE) != 0;
    }
    printf("  jitter: oldest model %.1f ms; longer way: stale for %.1f s, then %.2f N\n", (double)oldest_us * 1e-3,
           1 + (double)stale_ticks * 1e-3, peak);
    /* the jitter and the distance of two models */
    CHECK_LE(oldest_us, 70000);
    CHECK(oldest_us > 50000);
    CHECK(stale_ticks > 5000 && stale_ticks < 14000);
    CHECK(peak > 0.5);
    rig_close(&r);
}

/* every 30 ms a model of a rising surface; from the second half on all are 10 ms late */
static void surface_of_a_late_model_moves_on_from_when_it_was_made(void)
{
    trial r;
    REQUIRE(rig_open(&r, "inverse3,script=press-hold,clock=virtual", 300));
    rig_run(&r, 5);
    r.serving = false;
    r.model.patch[0].v_m_s[2] = 0.002f;
    for (int i = 0; i < 600; i++) {
        if (i % 30 == 0) rig_model(&r, r.now_ns - (i < 300 ? 0 : 10000000));
        rig_tick(&r);
        if (i % 300 == 299) CHECK_NEAR(r.view.proxy_m[0][2], 0.002 * (i < 300 ? 0.029 : 0.039), 0.002 * 0.003);
    }
    rig_close(&r);
}

static void old_models_are_dropped_and_a_new_session_starts_afresh(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    const uint32_t seq = r.view.model_seq;
    pal_wire_haptic old = r.model;
    old.seq = seq - 3;
    r.serving = false;
    pal_servo_put_model(r.servo, &old, r.generation, r.now_ns);
    rig_tick(&r);
    CHECK_INT(r.view.model_seq, seq);
    CHECK_INT(r.view.n_model_old, 1);
    pal_servo_put_generation(r.servo, ++r.generation);
    rig_tick(&r);
    CHECK_INT(r.view.model_seq, 0);
    CHECK_LE(rig_force(&r), 0.05);
    /* a server that starts again counts from 1, and is believed */
    r.seq = 0;
    r.serving = true;
    r.next_model_ns = r.now_ns;
    rig_run(&r, 0.002);
    CHECK_INT(r.view.model_seq, 1);
    CHECK_LE(r.view.fade, 0.02);
    rig_run(&r, 1);
    CHECK(rig_force(&r) > 0.1);
    rig_close(&r);
}

static void numbers_that_are_not_finite_in_a_model_give_a_fault_not_a_force(void)
{
    trial r;
    REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    r.model.patch[0].k1_N_m = NAN;
    for (int i = 0; i < 100; i++) {
        rig_tick(&r);
        CHECK(isfinite(rig_force(&r)));
    }
    CHECK_NEAR(rig_force(&r), 0, 0);
    CHECK(r.view.n_not_finite > 0);
    CHECK(rig_event(&r, PAL_EVENT_FAULT));
    rig_close(&r);
}

/* nothing arrives any more, or only repeats of an old number: without force after the stale time and its fade */
static void silence_and_repeats_of_an_old_model_end_the_force(void)
{
    for (int repeats = 0; repeats < 2; repeats++) {
        trial r;
        REQUIRE(rig_open(&r, "premium,script=press-hold,clock=virtual", 300));
        rig_run(&r, 4);
        CHECK(rig_force(&r) > 0.1);
        r.serving = false;
        for (int i = 0; i < 620; i++) {
            if (repeats && i % 16 == 0) pal_servo_put_model(r.servo, &r.model, r.generation, r.now_ns);
            rig_tick(&r);
        }
        CHECK_NEAR(r.view.fade, 0, 0);
        rig_run(&r, 0.3);
        CHECK_LE(rig_force(&r), 0.02); /* damping of the free handle */
        CHECK_INT(repeats ? r.view.n_model_old > 30 : r.view.n_model_old == 0, 1);
        rig_close(&r);
    }
}

/* a server that comes back as another session finds an empty tank: pressed deep, nothing kicks */
static void new_session_begins_with_an_empty_tank(void)
{
    trial r;
    REQUIRE(rig_open(&r, "inverse3,script=press-hold,clock=virtual", 300));
    rig_run(&r, 4);
    CHECK(r.view.tank_mJ > 0.5);
    const double generated = r.view.generated_mJ;
    pal_servo_put_generation(r.servo, ++r.generation);
    r.serving = false;
    rig_run(&r, 0.002);
    CHECK_LE(r.view.tank_mJ, 0);
    CHECK_NEAR(r.view.fade, 0, 0);
    r.seq = 0;
    r.serving = true;
    r.next_model_ns = r.now_ns;
    double before = 0, step = 0;
    for (int i = 0; i < 3000; i++) {
        rig_tick(&r);
        step = fmax(step, rig_force(&r) - before);
        before = rig_force(&r);
    }
    CHECK_LE(step, 0.1);
    CHECK_LE(r.view.generated_mJ, fmax(generated, 0) + fmax(0, -r.view.tank_mJ) + 1e-9);
    rig_close(&r);
}

int main(void)
{
    RUN(stale_model_fades_out_in_100_and_500_ms_and_comes_back_slowly);
    RUN(model_that_comes_during_the_tick_is_fresh);
    RUN(models_of_a_stall_that_arrive_in_a_burst_are_stale);
    RUN(jitter_makes_nothing_stale_and_a_longer_way_becomes_the_usual_one);
    RUN(surface_of_a_late_model_moves_on_from_when_it_was_made);
    RUN(old_models_are_dropped_and_a_new_session_starts_afresh);
    RUN(numbers_that_are_not_finite_in_a_model_give_a_fault_not_a_force);
    RUN(silence_and_repeats_of_an_old_model_end_the_force);
    RUN(new_session_begins_with_an_empty_tank);
    return check_report();
}
