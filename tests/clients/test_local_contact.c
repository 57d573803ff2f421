/* The local contact model against its formulas (clients/haptic_bridge/README.md, "One tick"). */
#include "clients/haptic_bridge/local_contact.h"
#include "tests/check.h"

static const pal_local_contact_limits limits = {.stiffness_max_N_m = 1000, .damping_max_Ns_m = 4, .damping_floor_s = 0};
static const double still[3] = {0, 0, 0};

/* a plane z = height, normal up */
static pal_wire_haptic plane(float height, float k1, float k2)
{
    pal_wire_haptic m = {.n_patch = 1, .origin_m = {0.1, -0.2, 0.3}};
    m.patch[0] = (pal_wire_contact_patch){
        .id = 1, .group = 1, .p_m = {0, 0, height}, .n = {0, 0, 1}, .k1_N_m = k1, .k2_N_m2 = k2};
    return m;
}

static pal_local_contact_result at(const pal_wire_haptic *m, double x, double y, double z, const double *v,
                                   const pal_local_contact_limits *l, pal_local_contact_state *memory)
{
    pal_local_contact_state fresh = {0};
    pal_local_contact_result result;
    const double place[3] = {m->origin_m[0] + x, m->origin_m[1] + y, m->origin_m[2] + z};
    pal_local_contact_force(m, 0, place, v, l, memory ? memory : &fresh, &result);
    return result;
}

static void force_is_k_times_depth(void)
{
    const pal_wire_haptic m = plane(0.001f, 300, 0);
    for (int i = 0; i < 20; i++) {
        const double depth = 0.0005 * i, height = (double)0.001f;
        const pal_local_contact_result r = at(&m, 0.01, 0.02, height - depth, still, &limits, NULL);
        CHECK_NEAR(r.force_N[2], 300 * depth, 1e-12);
        CHECK_NEAR(fabs(r.force_N[0]) + fabs(r.force_N[1]), 0, 0);
    }
    CHECK_NEAR(at(&m, 0, 0, 0.002, still, &limits, NULL).force_N[2], 0, 0);
}

static void second_coefficient_adds_its_square(void)
{
    const pal_wire_haptic m = plane(0, 200, 20000);
    CHECK_NEAR(at(&m, 0, 0, -0.004, still, &limits, NULL).force_N[2], 200 * 0.004 + 20000 * 1.6e-5, 1e-12);
}

static void stiffness_stops_at_the_devices_clamp_without_a_step(void)
{
    const pal_local_contact_limits soft = {.stiffness_max_N_m = 400, .damping_max_Ns_m = 4};
    const pal_wire_haptic stiff = plane(0, 2000, 0), curved = plane(0, 200, 20000);
    pal_local_contact_result r = at(&stiff, 0, 0, -0.002, still, &soft, NULL);
    CHECK_NEAR(r.force_N[2], 400 * 0.002, 1e-12);
    CHECK(r.clamped);
    /* the tangent 200 + 40000 d reaches 400 at 5 mm, from there on the slope stays 400 */
    const double here = at(&curved, 0, 0, -0.005, still, &soft, NULL).force_N[2];
    CHECK_NEAR(here, 200 * 0.005 + 20000 * 25e-6, 1e-12);
    CHECK_NEAR(at(&curved, 0, 0, -0.007, still, &soft, NULL).force_N[2], here + 400 * 0.002, 1e-12);
}

static void damping_acts_on_approach_and_never_pulls(void)
{
    pal_wire_haptic m = plane(0, 100, 0);
    m.patch[0].b_N_s_m = 2;
    const double in[3] = {0, 0, -0.1}, out[3] = {0, 0, 0.1};
    CHECK_NEAR(at(&m, 0, 0, -0.001, in, &limits, NULL).force_N[2], 0.1 + 0.2, 1e-12);
    CHECK_NEAR(at(&m, 0, 0, -0.001, out, &limits, NULL).force_N[2], 0, 0);
    m.patch[0].v_m_s[2] = 0.1f;
    CHECK_NEAR(at(&m, 0, 0, -0.001, out, &limits, NULL).force_N[2], 0.1, 1e-8);
}

static void damping_floor_follows_stiffness_up_to_the_device(void)
{
    const pal_wire_haptic m = plane(0, 800, 0);
    const double in[3] = {0, 0, -0.1};
    pal_local_contact_limits floor = {.stiffness_max_N_m = 1000, .damping_max_Ns_m = 4, .damping_floor_s = 2.5e-3};
    CHECK_NEAR(at(&m, 0, 0, -0.001, in, &floor, NULL).force_N[2], 0.8 + 0.2, 1e-12);
    floor.damping_max_Ns_m = 0.5;
    CHECK_NEAR(at(&m, 0, 0, -0.001, in, &floor, NULL).force_N[2], 0.8 + 0.05, 1e-12);
}

/* two planes of one group make an edge: outside of either there is no contact, inside the nearer one acts */
static void convex_group_acts_with_its_nearest_plane(void)
{
    pal_wire_haptic m = plane(0, 100, 0);
    m.n_patch = 2;
    m.patch[1] = m.patch[0];
    m.patch[1].id = 2;
    m.patch[1].n[0] = 1, m.patch[1].n[2] = 0;
    CHECK_NEAR(at(&m, 0.001, 0, -0.005, still, &limits, NULL).n_contact, 0, 0);
    pal_local_contact_result r = at(&m, -0.003, 0, -0.005, still, &limits, NULL);
    CHECK_INT(r.n_contact, 1);
    CHECK_NEAR(r.force_N[0], 0.3, 1e-9);
    CHECK_NEAR(r.force_N[2], 0, 0);
    r = at(&m, -0.005, 0, -0.002, still, &limits, NULL);
    CHECK_NEAR(r.force_N[2], 0.2, 1e-9);
    /* other group: both act */
    m.patch[1].group = 2;
    r = at(&m, -0.003, 0, -0.005, still, &limits, NULL);
    CHECK_INT(r.n_contact, 2);
    CHECK_NEAR(r.force_N[0], 0.3, 1e-9);
    CHECK_NEAR(r.force_N[2], 0.5, 1e-9);
}

static void hysteresis_keeps_the_acting_plane_within_a_tenth_of_a_millimetre(void)
{
    pal_wire_haptic m = plane(0, 100, 0);
    m.n_patch = 2;
    m.patch[1] = m.patch[0];
    m.patch[1].id = 2;
    m.patch[1].n[0] = 1, m.patch[1].n[2] = 0;
    pal_local_contact_state memory = {0};
    CHECK_NEAR(at(&m, -0.002, 0, -0.001, still, &limits, &memory).force_N[2], 0.1, 1e-9);
    CHECK(at(&m, -0.00096, 0, -0.001, still, &limits, &memory).force_N[2] > 0);
    CHECK_NEAR(at(&m, -0.0008, 0, -0.001, still, &limits, &memory).force_N[2], 0, 0);
}

static void force_falls_smoothly_beyond_the_patchs_radius(void)
{
    pal_wire_haptic m = plane(0, 100, 0);
    m.patch[0].radius_m = 0.01f;
    CHECK_NEAR(at(&m, 0.0099, 0, -0.001, still, &limits, NULL).force_N[2], 0.1, 1e-9);
    CHECK_NEAR(at(&m, 0.0125, 0, -0.001, still, &limits, NULL).force_N[2], 0.05, 1e-6);
    CHECK_NEAR(at(&m, 0.016, 0, -0.001, still, &limits, NULL).force_N[2], 0, 0);
}

static void surface_moves_on_for_at_most_fifty_milliseconds(void)
{
    pal_wire_haptic m = plane(0, 100, 0);
    m.patch[0].v_m_s[2] = 0.1f;
    const double place[3] = {0.1, -0.2, 0.3}, moving[3] = {0, 0, (double)0.1f};
    pal_local_contact_state memory = {0};
    pal_local_contact_result r;
    pal_local_contact_force(&m, 0.02, place, moving, &limits, &memory, &r);
    CHECK_NEAR(r.force_N[2], 100 * 0.002, 1e-8);
    pal_local_contact_force(&m, 1.0, place, moving, &limits, &memory, &r);
    CHECK_NEAR(r.force_N[2], 100 * 0.005, 1e-8);
}

static void numbers_that_are_not_finite_give_no_force_and_say_so(void)
{
    pal_wire_haptic m = plane(0, 100, 0);
    const double nan_x[3] = {0, 0, NAN};
    pal_local_contact_state memory = {0};
    pal_local_contact_result r;
    pal_local_contact_force(&m, 0, nan_x, still, &limits, &memory, &r);
    CHECK(!r.finite && r.force_N[2] == 0);
    m.patch[0].k1_N_m = NAN;
    r = at(&m, 0, 0, -0.001, still, &limits, NULL);
    CHECK(!r.finite && r.force_N[2] == 0);
}

int main(void)
{
    RUN(force_is_k_times_depth);
    RUN(second_coefficient_adds_its_square);
    RUN(stiffness_stops_at_the_devices_clamp_without_a_step);
    RUN(damping_acts_on_approach_and_never_pulls);
    RUN(damping_floor_follows_stiffness_up_to_the_device);
    RUN(convex_group_acts_with_its_nearest_plane);
    RUN(hysteresis_keeps_the_acting_plane_within_a_tenth_of_a_millimetre);
    RUN(force_falls_smoothly_beyond_the_patchs_radius);
    RUN(surface_moves_on_for_at_most_fifty_milliseconds);
    RUN(numbers_that_are_not_finite_give_no_force_and_say_so);
    return check_report();
}
