/* The energy gate against its invariant: what was given to the hand is at most the tank at the start, leak and debt. */
#include "clients/haptic_bridge/tuning.h"
#include "server/rendering/energy_gate.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

/* a spring k of which the rest length changes from 0 by share d */
typedef struct spring {
    double k, x, rest, to;
} spring;
static double spring_energy(double k, double x)
{
    return k * x * x / 2;
}
static double spring_stored(const void *user, double share)
{
    const spring *s = user;
    return spring_energy(s->k, s->x - s->rest - share * (s->to - s->rest));
}

static void change_is_made_as_far_as_the_tank_pays(void)
{
    pal_energy_gate gate = {.max_J = TANK_MAX_J, .tank_J = 1e-3};
    spring s = {.k = 200, .x = 0, .to = 0.01}; /* all of it would cost 10 mJ */
    const double share = pal_energy_gate_pay(&gate, 1e-3, spring_stored, &s);
    CHECK_NEAR(spring_stored(&s, share), 1e-3, 1e-5);
    CHECK_LE(spring_stored(&s, share), 1e-3);
    CHECK(gate.tank_J >= 0);
    CHECK_LE(gate.tank_J, 1e-5);
    /* and back: it is credited */
    s.rest = s.to = 0;
    CHECK_NEAR(pal_energy_gate_pay(&gate, 1e-3, spring_stored, &s), 1, 0);
    CHECK_NEAR(gate.tank_J, 1e-3, 1e-15);
}

static void leak_pays_a_little_and_the_empty_strict_tank_nothing(void)
{
    spring s = {.k = 200, .x = 0, .to = 0.01};
    pal_energy_gate strict = {.max_J = TANK_MAX_J}, leaky = {.max_J = TANK_MAX_J, .leak_W = 1e-3};
    CHECK_NEAR(pal_energy_gate_pay(&strict, 1e-3, spring_stored, &s), 0, 0);
    const double share = pal_energy_gate_pay(&leaky, 1e-3, spring_stored, &s);
    CHECK_LE(spring_stored(&s, share), 1e-6);
    CHECK_NEAR(spring_stored(&s, share), 1e-6, 1e-7);
    CHECK_NEAR(leaky.tank_J, 0, 0);
}

static void fade_out_is_not_credited_and_the_tank_has_an_end(void)
{
    pal_energy_gate gate = {.max_J = TANK_MAX_J, .tank_J = 1e-3, .stored_J = 4e-3};
    pal_energy_gate_drop(&gate, 0);
    CHECK_NEAR(gate.tank_J, 1e-3, 0);
    pal_energy_gate_work(&gate, 0.02, 0.001); /* the hand works 20 mJ, 1 mJ of it is stored */
    pal_energy_gate_settle(&gate, 0.001);
    CHECK_NEAR(gate.tank_J, TANK_MAX_J, 0);
    CHECK_NEAR(gate.given_J, -0.02, 0);
    CHECK_NEAR(gate.given_max_J, 0, 0);
}

static void damping_pays_a_debt_within_a_tick_and_refills_a_low_tank(void)
{
    pal_energy_gate gate = {.max_J = TANK_MAX_J, .tank_J = -1e-6};
    /* b v^2 dt = debt */
    CHECK_NEAR(pal_energy_gate_damping(&gate, 0.005, 1e-3), 40, 1e-9);
    CHECK_NEAR(pal_energy_gate_damping(&gate, 0.0005, 1e-3), 0, 0);
    gate.tank_J = TANK_START_J / 2;
    CHECK_NEAR(pal_energy_gate_damping(&gate, 0.05, 1e-3), REFILL_DAMPING_NS_M / 2, 1e-12);
    gate.tank_J = TANK_START_J;
    CHECK_NEAR(pal_energy_gate_damping(&gate, 0.05, 1e-3), 0, 0);
}

/* any motion, any changes, any lies of the model: -sum W <= tank0 + leak t + debt */
static void hand_never_gets_more_than_the_bound(void)
{
    uint64_t seed = 3;
    for (int run = 0; run < 50; run++) {
        const double leak = run % 2 ? 1e-3 : 0;
        pal_energy_gate gate = {.max_J = TANK_MAX_J, .leak_W = leak, .tank_J = TANK_START_J};
        spring s = {.k = 300};
        double force = 0, given = 0;
        for (int i = 0; i < 2000; i++) {
            const double before = s.x;
            s.x = 0.01 * sin(0.01 * i + run) + 1e-4 * random_signed(&seed);
            const double work = -force * (s.x - before);
            given -= work;
            pal_energy_gate_work(&gate, work, spring_stored(&s, 0));
            s.to = 0.02 * random_signed(&seed);
            const double share = pal_energy_gate_pay(&gate, 1e-3, spring_stored, &s);
            s.rest += share * (s.to - s.rest);
            s.to = s.rest;
            pal_energy_gate_settle(&gate, spring_stored(&s, 0));
            /* a force with an error of its own */
            force = -s.k * (s.x - s.rest) * (1 + 0.1 * random_signed(&seed));
            CHECK_LE(given, TANK_START_J + leak * 1e-3 * (i + 1) + fmax(0, -gate.tank_J) + 1e-12);
        }
        CHECK_NEAR(given, gate.given_J, 1e-12);
    }
}

int main(void)
{
    RUN(change_is_made_as_far_as_the_tank_pays);
    RUN(leak_pays_a_little_and_the_empty_strict_tank_nothing);
    RUN(fade_out_is_not_credited_and_the_tank_has_an_end);
    RUN(damping_pays_a_debt_within_a_tick_and_refills_a_low_tank);
    RUN(hand_never_gets_more_than_the_bound);
    return check_report();
}
