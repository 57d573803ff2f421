/* The local contact model against its formulas (clients/haptic_bridge/README.md, "One tick"): normal force, friction,
 * grasp, torque, stored energy. */
#include "server/base/vec3.h"
#include "server/rendering/local_contact.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

static const pal_local_limits limits = {.stiffness_max_N_m = 1000, .damping_max_Ns_m = 4, .force_max_N = INFINITY};
static const double still[3] = {0, 0, 0};

/* a plane z = height, normal up */
static pal_wire_haptic plane(float height, float k1, float k2)
{
    pal_wire_haptic m = {.n_patch = 1, .origin_m = {0.1, -0.2, 0.3}};
    m.patch[0] = (pal_wire_contact_patch){
        .id = 1, .group = 1, .p_m = {0, 0, height}, .n = {0, 0, 1}, .k1_N_m = k1, .k2_N_m2 = k2};
    return m;
}

/* the whole model at once */
static pal_local_model model_of(const pal_wire_haptic *m, double age_s, const pal_local_limits *l)
{
    pal_local_blend blend = {0};
    pal_local_model model = {0};
    CHECK(pal_local_blend_start(&blend, 0, 0, m, l));
    pal_local_blend_mix(&blend, 1, age_s, &model);
    return model;
}

static pal_local_contact_result at(const pal_wire_haptic *m, double x, double y, double z, const double *v,
                                   const pal_local_limits *l, pal_local_contact_state *memory)
{
    pal_local_contact_state fresh = {0};
    pal_local_contact_result result;
    const pal_local_model model = model_of(m, 0, l);
    const double place[3] = {m->origin_m[0] + x, m->origin_m[1] + y, m->origin_m[2] + z};
    pal_local_contact_force(&model, place, v, 1e-3, l, memory ? memory : &fresh, &result);
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
    const pal_local_limits soft = {.stiffness_max_N_m = 400, .damping_max_Ns_m = 4, .force_max_N = INFINITY};
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
    pal_local_limits floor = limits;
    floor.damping_floor_s = 2.5e-3;
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
    pal_local_model model = model_of(&m, 0.02, &limits);
    pal_local_contact_force(&model, place, moving, 1e-3, &limits, &memory, &r);
    CHECK_NEAR(r.force_N[2], 100 * 0.002, 1e-8);
    model = model_of(&m, 1.0, &limits);
    pal_local_contact_force(&model, place, moving, 1e-3, &limits, &memory, &r);
    CHECK_NEAR(r.force_N[2], 100 * 0.005, 1e-8);
}

static void softening_tissue_never_pulls(void)
{
    const pal_wire_haptic m = plane(0, 100, -5000); /* its force is largest, 0.5 N, at 10 mm */
    CHECK_NEAR(at(&m, 0, 0, -0.008, still, &limits, NULL).force_N[2], 0.8 - 0.32, 1e-9);
    CHECK_NEAR(at(&m, 0, 0, -0.03, still, &limits, NULL).force_N[2], 0.5, 1e-9);
}

static void proxy_lies_on_the_plane(void)
{
    const pal_wire_haptic m = plane(0, 100, 0);
    const pal_local_contact_result r = at(&m, 0.001, 0.002, -0.003, still, &limits, NULL);
    CHECK_INT(r.n_contact, 1);
    CHECK_NEAR(r.proxy_m[0][0], 0.101, 1e-9);
    CHECK_NEAR(r.proxy_m[0][2], 0.3, 1e-9);
}

/* at a depth of 5 mm, N = 0.5 N; stick up to mu_s N = 0.25 N, slide with mu_d N = 0.2 N against the motion, stick again
 * at rest */
static void friction_sticks_then_slides_then_sticks_again(void)
{
    pal_wire_haptic m = plane(0, 100, 0);
    m.patch[0].kt_N_m = 200, m.patch[0].mu_s = 0.5f, m.patch[0].mu_d = 0.4f;
    pal_local_contact_state memory = {0};
    const double moving[3] = {0.05, 0, 0};
    CHECK_NEAR(at(&m, 0, 0, -0.005, still, &limits, &memory).force_N[0], 0, 1e-12);
    pal_local_contact_result r = at(&m, 0.001, 0, -0.005, moving, &limits, &memory);
    CHECK_NEAR(r.force_N[0], -0.2, 1e-9);
    CHECK_NEAR(r.force_N[2], 0.5, 1e-9);
    r = at(&m, 0.00124, 0, -0.005, moving, &limits, &memory);
    CHECK_NEAR(r.force_N[0], -0.248, 1e-9);
    for (int i = 0; i < 100; i++) {
        r = at(&m, 0.0013 + 5e-5 * i, 0, -0.005, moving, &limits, &memory);
        CHECK_NEAR(r.force_N[0], -0.2, 1e-6);
    }
    const double end = 0.0013 + 5e-5 * 99;
    /* at rest it sticks: the stretch grows beyond mu_d N again */
    r = at(&m, end + 0.0001, 0, -0.005, still, &limits, &memory);
    CHECK_NEAR(r.force_N[0], -0.22, 1e-6);
    /* back: the anchor stays, and the force turns */
    r = at(&m, end - 0.0018, 0, -0.005, still, &limits, &memory);
    CHECK_NEAR(r.force_N[0], 200 * 0.0018 - 0.2, 1e-6);
    /* lifted off, it is forgotten */
    r = at(&m, end, 0, 0.001, still, &limits, &memory);
    CHECK_INT(memory.n_group, 0);
    CHECK_NEAR(at(&m, 0.002, 0, -0.005, still, &limits, &memory).force_N[0], 0, 1e-12);
}

static void friction_is_carried_by_a_moving_surface_and_damped_while_it_sticks(void)
{
    pal_wire_haptic m = plane(0, 100, 0);
    m.patch[0].kt_N_m = 200, m.patch[0].mu_s = m.patch[0].mu_d = 0.5f, m.patch[0].v_m_s[0] = 0.1f;
    pal_local_contact_state memory = {0};
    const double with[3] = {0.1, 0, 0};
    at(&m, 0, 0, -0.005, with, &limits, &memory);
    /* in a millisecond the surface takes the anchor 0.1 mm along */
    CHECK_NEAR(at(&m, 0, 0, -0.005, with, &limits, &memory).force_N[0], 0.02, 1e-8);
    pal_local_limits floor = limits;
    floor.damping_floor_s = 2.5e-3;
    m.patch[0].v_m_s[0] = 0;
    pal_local_contact_state other = {0};
    const double v[3] = {0.05, 0, 0};
    /* b = 2.5 ms * 200 N/m */
    CHECK_NEAR(at(&m, 0, 0, -0.005, v, &floor, &other).force_N[0], -0.5 * 0.05, 1e-9);
}

/* arm -r n from the centre to the contact: the normal force turns nothing, friction turns by r |F_t| */
static void friction_turns_a_sphere_and_turning_it_stretches_the_contact(void)
{
    pal_wire_haptic m = plane(0, 100, 0);
    m.patch[0].kt_N_m = 200, m.patch[0].mu_s = m.patch[0].mu_d = 0.5f, m.patch[0].radius_m = 0.01f;
    pal_local_contact_state memory = {0};
    at(&m, 0, 0, -0.005, still, &limits, &memory);
    pal_local_contact_result r = at(&m, 0.001, 0, -0.005, still, &limits, &memory);
    /* (0 0 -r) x (-0.2 0 0.5) = (0, 0.2 r, 0) */
    CHECK_NEAR(r.torque_N_m[1], 0.002, 1e-9);
    CHECK_NEAR(r.torque_N_m[0], 0, 1e-12);
    /* a turn about y by 0.1 moves the contact by (0 0.1 0) x (0 0 -r) = -1 mm along x: back to its anchor */
    const double turn[3] = {0, 0.1, 0};
    pal_local_contact_turn(&memory, turn);
    r = at(&m, 0.001, 0, -0.005, still, &limits, &memory);
    CHECK_NEAR(r.force_N[0], 0, 1e-8);
    CHECK_NEAR(r.torque_N_m[1], 0, 1e-9);
}

static pal_wire_haptic grasp(double f0, const float K[6])
{
    pal_wire_haptic m = {.has_grasp = 1, .origin_m = {0.1, -0.2, 0.3}, .grasp_f0_N = {0, 0, (float)f0}};
    memcpy(m.grasp_k_N_m, K, sizeof m.grasp_k_N_m);
    return m;
}

static void grasp_pulls_and_pushes_with_its_matrix(void)
{
    const float K[6] = {100, 20, 0, 80, 10, 50};
    const pal_wire_haptic m = grasp(-1, K);
    const double v[3] = {0, 0, 0.1};
    pal_local_limits floor = limits;
    const pal_local_contact_result r = at(&m, 0.001, 0.002, 0.003, still, &limits, NULL);
    CHECK_NEAR(r.force_N[0], -(100 * 0.001 + 20 * 0.002), 1e-5);
    CHECK_NEAR(r.force_N[1], -(20 * 0.001 + 80 * 0.002 + 10 * 0.003), 1e-5);
    CHECK_NEAR(r.force_N[2], -1 - (10 * 0.002 + 50 * 0.003), 1e-5);
    /* damping floor by the stiffest axis, of eigenvalue 113.0 */
    floor.damping_floor_s = 2.5e-3;
    CHECK_NEAR(at(&m, 0, 0, 0, v, &floor, NULL).force_N[2], -1 - 2.5e-3 * 113.0 * 0.1, 2e-4);
}

/* arm x f with what damping gives; half way from a grasp to another one, half way in arm and force */
static void grasp_turns_the_tool_by_its_arm(void)
{
    const float K[6] = {100, 0, 0, 100, 0, 100};
    const double v[3] = {0, 0.1, 0}, x[3] = {0.1, -0.2, 0.301};
    pal_wire_haptic m = grasp(-1, K);
    m.grasp_b_N_s_m = 2;
    m.grasp_arm_m[0] = 0.02f, m.grasp_arm_m[1] = 0.01f;
    /* (0.02 0.01 0) x (0 -0.2 -1.1) = (-0.011 0.022 -0.004) */
    pal_local_contact_result r = at(&m, 0, 0, 0.001, v, &limits, NULL);
    const double whole[3] = {-0.011, 0.022, -0.004};
    CHECK_LE(pal_dist3(r.torque_N_m, whole), 1e-8);
    pal_local_blend blend = {0};
    pal_local_model mix;
    CHECK(pal_local_blend_start(&blend, 0, 0, &m, &limits));
    m.grasp_arm_m[0] = -0.02f, m.grasp_f0_N[2] = 1;
    CHECK(pal_local_blend_start(&blend, 1, 0, &m, &limits));
    pal_local_blend_mix(&blend, 0.5, 0, &mix);
    pal_local_contact_force(&mix, x, still, 1e-3, &limits, NULL, &r);
    /* (0 0.01 0) x (0 0 -0.1) */
    const double half[3] = {-0.001, 0, 0};
    CHECK_LE(pal_dist3(r.torque_N_m, half), 1e-8);
    m.grasp_arm_m[1] = NAN;
    CHECK(!pal_local_blend_start(&blend, 1, 0, &m, &limits));
}

/* eigenvalues: 1500 above the limit of 1000, -50 below 0, 200. The axis without stiffness renders no force */
static void stiffness_of_a_grasp_is_clamped_along_its_axes(void)
{
    const float c = 0.70710678f, s = c;
    const float K[6] = {c * c * 1500 + s * s * -50, c * s * (1500 + 50), 0, s * s * 1500 + c * c * -50, 0, 200};
    pal_wire_haptic m = grasp(-1, K);
    const double d = 0.001 / sqrt(2);
    pal_local_contact_result r = at(&m, d, d, 0, still, &limits, NULL);
    CHECK_NEAR(r.force_N[0] * sqrt(2), -1.0, 1e-3);
    CHECK_NEAR(r.force_N[2], -1, 1e-6);
    r = at(&m, d, -d, 0, still, &limits, NULL);
    CHECK_NEAR(r.force_N[0], 0, 1e-5);
    m.grasp_f0_N[0] = 1, m.grasp_f0_N[1] = -1;
    CHECK_NEAR(at(&m, 0, 0, 0, still, &limits, NULL).force_N[0], 0, 1e-5);
}

/* the work of the force along a path is the loss of stored energy: contact with clamp and end of force, friction that
 * sticks, grasp with its own end of force */
static void stored_energy_is_the_integral_of_the_force(void)
{
    const pal_local_limits l = {.stiffness_max_N_m = 400, .damping_max_Ns_m = 4, .force_max_N = 1.5};
    pal_wire_haptic m = plane(0, 200, 20000);
    m.patch[0].kt_N_m = 200, m.patch[0].mu_s = m.patch[0].mu_d = 100;
    m.has_grasp = 1;
    m.grasp_f0_N[2] = -0.4f;
    for (int k = 0; k < 3; k++) m.grasp_k_N_m[(int[]){0, 3, 5}[k]] = 90;
    const pal_local_model model = model_of(&m, 0, &l);
    pal_local_contact_state memory = {0};
    double x[3] = {0.1, -0.2, 0.3 - 1e-9}, work = 0;
    pal_local_contact_result r;
    pal_local_contact_force(&model, x, still, 0, &l, &memory, &r);
    const double begin = pal_local_contact_energy(&model, x, &l, &memory);
    double last[3];
    pal_copy3(last, r.force_N);
    double lowest = INFINITY;
    for (int i = 1; i <= 19000; i++) {
        double to[3] = {0.1 + 0.003 * sin(3e-4 * i), -0.2 + 0.002 * sin(5e-4 * i), 0.3 - 1e-6 * i}, step[3], mean[3];
        if (i > 10000) to[2] = 0.3 - 1e-6 * (20001 - i);
        pal_sub3(step, to, x);
        pal_copy3(x, to);
        pal_local_contact_force(&model, x, still, 0, &l, &memory, &r);
        pal_add3(mean, last, r.force_N);
        work += pal_dot3(mean, step) / 2;
        pal_copy3(last, r.force_N);
        lowest = fmin(lowest, pal_local_contact_energy(&model, x, &l, &memory));
        if (i % 1000 == 0) CHECK_NEAR(pal_local_contact_energy(&model, x, &l, &memory) - begin, -work, 1e-6);
    }
    CHECK(r.clamped || r.saturated || lowest >= 0);
    CHECK(lowest >= 0);
}

static void numbers_that_are_not_finite_are_refused(void)
{
    pal_local_blend blend = {0};
    pal_wire_haptic m = plane(0, 100, 0);
    CHECK(pal_local_blend_start(&blend, 0, 0, &m, &limits));
    m.patch[0].k1_N_m = NAN;
    CHECK(!pal_local_blend_start(&blend, 0, 0, &m, &limits));
    m = plane(0, 100, 0);
    m.grasp_f0_N[1] = INFINITY;
    CHECK(!pal_local_blend_start(&blend, 0, 0, &m, &limits));
    CHECK_INT(blend.to.n_patch, 1);
    CHECK_NEAR(blend.to.patch[0].k1_N_m, 100, 0);
}

/* whatever the server sends: a blend begins at the force and the energy of the model in use, stays between and ends at
 * the new one's */
static void blend_begins_where_it_is_and_ends_at_the_new_model(void)
{
    uint64_t seed = 7;
    pal_local_blend blend = {0};
    double lambda = 0, age = 0;
    for (int i = 0; i < 300; i++) {
        pal_wire_haptic m = {.origin_m = {0.1, -0.2, 0.3}};
        m.n_patch = (uint32_t)random_below(&seed, 5);
        for (uint32_t p = 0; p < m.n_patch; p++) {
            double n[3] = {random_signed(&seed), random_signed(&seed), 1.5};
            pal_unit3(n, n, 1e-9);
            m.patch[p] = (pal_wire_contact_patch){.id = (uint16_t)(p + 5 * random_below(&seed, 2)),
                                                  .group = (uint16_t)random_below(&seed, 3),
                                                  .p_m = {0, 0, (float)(0.004 * random_unit(&seed))},
                                                  .n = {(float)n[0], (float)n[1], (float)n[2]},
                                                  .v_m_s = {0, 0, (float)(0.02 * random_signed(&seed))},
                                                  .k1_N_m = (float)(10 + 500 * random_unit(&seed))};
        }
        m.has_grasp = random_below(&seed, 2) == 1;
        for (int k = 0; k < 3; k++)
            m.grasp_k_N_m[(int[]){0, 3, 5}[k]] = 80, m.grasp_f0_N[k] = (float)random_signed(&seed);
        const double x[3] = {0.1005, -0.2003, 0.2995};
        pal_local_model before, after;
        pal_local_contact_state memory = {0};
        pal_local_contact_result a, b;
        pal_local_blend_mix(&blend, lambda, age, &before);
        pal_local_contact_force(&before, x, still, 1e-3, &limits, NULL, &a);
        const double energy = pal_local_contact_energy(&before, x, &limits, &memory);
        CHECK(pal_local_blend_start(&blend, lambda, age, &m, &limits));
        pal_local_blend_mix(&blend, 0, 0, &after);
        pal_local_contact_force(&after, x, still, 1e-3, &limits, NULL, &b);
        /* what has gone out but for 0.5 N/m is dropped */
        CHECK_LE(pal_dist3(a.force_N, b.force_N), 0.05);
        CHECK_NEAR(pal_local_contact_energy(&after, x, &limits, &memory), energy, 1e-4);
        pal_local_blend_mix(&blend, 1, 0, &after);
        pal_local_contact_force(&after, x, still, 1e-3, &limits, NULL, &b);
        const pal_local_contact_result wanted = at(&m, 0.0005, -0.0003, -0.0005, still, &limits, NULL);
        CHECK_LE(pal_dist3(wanted.force_N, b.force_N), 1e-6);
        lambda = random_unit(&seed), age = 0.02 * random_unit(&seed);
        CHECK_LE(blend.to.n_patch, PAL_LOCAL_PATCH_MAX);
    }
}

/* a stiff plane just above the tool and a soft one far above it press alike: so does every blend of the two */
static void blend_of_equal_forces_has_that_force(void)
{
    pal_local_blend blend = {0};
    pal_wire_haptic stiff = plane(0.001f, 300, 0), soft = plane(0.03f, 10, 0);
    CHECK(pal_local_blend_start(&blend, 0, 0, &stiff, &limits));
    CHECK(pal_local_blend_start(&blend, 1, 0, &soft, &limits));
    const double x[3] = {0.1, -0.2, 0.3};
    for (int i = 0; i <= 10; i++) {
        pal_local_model mix;
        pal_local_contact_result r;
        pal_local_blend_mix(&blend, 0.1 * i, 0, &mix);
        pal_local_contact_force(&mix, x, still, 1e-3, &limits, NULL, &r);
        CHECK_NEAR(r.force_N[2], 0.3, 1e-6);
    }
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
    RUN(softening_tissue_never_pulls);
    RUN(proxy_lies_on_the_plane);
    RUN(friction_sticks_then_slides_then_sticks_again);
    RUN(friction_is_carried_by_a_moving_surface_and_damped_while_it_sticks);
    RUN(friction_turns_a_sphere_and_turning_it_stretches_the_contact);
    RUN(grasp_pulls_and_pushes_with_its_matrix);
    RUN(grasp_turns_the_tool_by_its_arm);
    RUN(stiffness_of_a_grasp_is_clamped_along_its_axes);
    RUN(stored_energy_is_the_integral_of_the_force);
    RUN(numbers_that_are_not_finite_are_refused);
    RUN(blend_of_equal_forces_has_that_force);
    RUN(blend_begins_where_it_is_and_ends_at_the_new_model);
    return check_report();
}
