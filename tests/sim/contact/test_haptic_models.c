/* What a haptic bridge is published, against the server's own force, for every model: springs and adaptive surfaces and
 * subdivision solids by explicit solvers, finite elements by an implicit one. Finite differences are over poses that
 * the tissue was left to settle at. */
#include "server/base/vec3.h"
#include "tests/fixtures/model_scenes.h"

static const double depth_m = 0.002, speed_m_s = 0.02, friction = 0.4;
enum { SETTLE = 150 }; /* 60ths of a second: 2.5 s, after which forces differ by less than 1e-4 */

static const pal_tool *tool_of(const model_scene *m)
{
    return &pal_world_tools(m->world)->tool[0];
}

static bool hold(model_scene *m, const double at[3], bool grasp)
{
    pal_pose pose = {.quat = {1, 0, 0, 0}, .buttons = grasp};
    pal_copy3(pose.position_m, at);
    return !pal_world_pose(m->world, 0, &pose) && model_scene_steps(m, 1);
}

/* from `at` to `to` in a straight line, then `settle` 60ths of a second; at = to */
static bool go(model_scene *m, double at[3], const double to[3], int settle, bool grasp)
{
    const int n = (int)ceil(pal_dist3(at, to) / (speed_m_s * m->scene->step_s));
    double from[3];
    pal_copy3(from, at);
    for (int i = 1; i <= n; i++) {
        for (int c = 0; c < 3; c++) at[c] = from[c] + (to[c] - from[c]) * i / n;
        if (!hold(m, at, grasp)) return false;
    }
    return model_scene_steps(m, (int)lround(settle / (60 * m->scene->step_s)));
}

/* a tool of 12 mm that just touches the top of a body of some 8 cm */
static bool begin_in_steps(model_scene *m, model_kind kind, double mu, double step_s, double at[3])
{
    const bool box = kind == SPRINGS || kind == FEM;
    model_scene_make(m, kind);
    if (step_s > 0) m->scene->step_s = step_s;
    if (box) {
        if (kind == FEM) pal_hexes_free(&m->mesh.hexes);
        box_free(&m->mesh);
        if (box_make(8, 8, 4, 0.01, &m->mesh)) return false;
        if (kind == FEM && pal_hexes_find(&m->mesh.tets, &m->mesh.hexes, &m->diag)) return false;
    }
    pal_tools_default(m->scene, 1);
    m->scene->tool[0].radius_m = 0.012;
    m->scene->tool[0].force_cap_N = 15;
    if (mu > 0)
        pal_entry_put_number(model_scene_effect(m, "tool_push"), "friction", mu, NULL);
    else
        model_scene_effect(m, "tool_push");
    model_scene_effect(m, "tool_grasp");
    if (!model_scene_open(m)) return false;
    const double start[3] = {box ? 0.037 : 0.004, box ? 0.042 : 0.003, 0.055};
    pal_copy3(at, start);
    while (!tool_of(m)->touching) {
        at[2] -= 0.0001;
        if (at[2] < 0 || !hold(m, at, false)) return false;
    }
    return true;
}

static bool begin(model_scene *m, model_kind kind, double mu, double at[3])
{
    return begin_in_steps(m, kind, mu, 0, at);
}

/* what changes from model to model in n steps about `at`, the hand trembling by tremor_m: parts of k1, m of the plane
 * along its normal, and the part by which F is not k1 d at the pose */
typedef struct jitter {
    double k, plane_m, force;
} jitter;
static jitter watch(model_scene *m, const double at[3], double tremor_m, int n)
{
    pal_contact_patch last = {0};
    jitter worst = {0};
    for (int i = 0; i < n; i++) {
        double x[3], move[3], t = i * m->scene->step_s;
        pal_copy3(x, at);
        x[0] += tremor_m * sin(2 * M_PI * 7 * t), x[2] += tremor_m * sin(2 * M_PI * 8 * t);
        if (!hold(m, x, false) || tool_of(m)->n_patch == 0) return (jitter){INFINITY, INFINITY, INFINITY};
        const pal_contact_patch *now = &tool_of(m)->patch[0];
        pal_sub3(move, now->point_m, tool_of(m)->here_m);
        worst.force =
            fmax(worst.force, fabs(now->k1_N_m * pal_dot3(move, now->normal) / pal_norm3(tool_of(m)->force_N) - 1));
        pal_sub3(move, now->point_m, last.point_m);
        if (i > 0) worst.k = fmax(worst.k, fabs(now->k1_N_m / last.k1_N_m - 1));
        if (i > 0) worst.plane_m = fmax(worst.plane_m, fabs(pal_dot3(move, now->normal)));
        last = *now;
    }
    return worst;
}

/* settled force on the tool at at + move */
static bool force_at(model_scene *m, double at[3], double x, double y, double z, bool grasp, double force[3])
{
    const double base[3] = {at[0], at[1], at[2]}, to[3] = {at[0] + x, at[1] + y, at[2] + z};
    if (!go(m, at, to, SETTLE, grasp)) return false;
    pal_copy3(force, tool_of(m)->mean_force_N);
    return go(m, at, base, SETTLE, grasp);
}

/* k1 against the slope of the normal force between half a millimetre less and more, at three depths. Adaptive surfaces
 * have other nodes half a millimetre on, so that their slope is not quite that of one surface */
static void a_resting_hand_has_a_steady_model_of_the_right_stiffness(void)
{
    for (model_kind kind = 0; kind < MODEL_KINDS; kind++) {
        model_scene m;
        double at[3];
        REQUIRE(begin(&m, kind, 0, at));
        for (int k = 1; k <= 3; k++) {
            const double to[3] = {at[0], at[1], at[2] - depth_m}, half_m = 0.0005;
            double less[3], more[3];
            REQUIRE(go(&m, at, to, SETTLE, false));
            const jitter still = watch(&m, at, 0, 60), trembling = watch(&m, at, 5e-5, 120);
            REQUIRE(go(&m, at, to, SETTLE, false));
            const pal_contact_patch patch = tool_of(&m)->patch[0];
            REQUIRE(force_at(&m, at, 0, 0, half_m, false, less) && force_at(&m, at, 0, 0, -half_m, false, more));
            /* along z the plane is as far away as 1 / n_z, and its force has n_z of itself */
            const double slope = (more[2] - less[2]) / (2 * half_m),
                         published = patch.k1_N_m * patch.normal[2] * patch.normal[2];
            printf("  %-16s %d mm: k1 %.4g, slope %.4g N/m (%+.1f %%); still %.2g %%, %.2g mm; trembling %.2g %%, "
                   "%.2g mm; F/k1d - 1 %.2g\n",
                   model_kind_name[kind], 2 * k, published, slope, 100 * (published / slope - 1), 100 * still.k,
                   1e3 * still.plane_m, 100 * trembling.k, 1e3 * trembling.plane_m, still.force);
            CHECK_LE(still.k, 0.05);
            CHECK_LE(still.plane_m, 1e-4);
            CHECK_LE(trembling.k, 0.05);
            CHECK_LE(trembling.plane_m, 1e-4);
            CHECK_LE(still.force, 1e-6);
            CHECK_NEAR(published, slope, (kind == SHELL ? 0.12 : 0.06) * slope);
        }
        model_scene_close(&m);
    }
}

/* steps of 1/240 s have products for half an iteration, those of 1 ms for an eighth: a longer way, the same stiffness
 */
static void short_steps_find_the_same_stiffness(void)
{
    static const double step_s[] = {1.0 / 240, 1e-3};
    for (int k = 0; k < 2; k++) {
        model_scene m;
        double at[3], less[3], more[3];
        const double half_m = 0.0005;
        REQUIRE(begin_in_steps(&m, SPRINGS, 0, step_s[k], at));
        /* in one step, so that forces along the way tell nothing */
        at[2] -= depth_m;
        REQUIRE(hold(&m, at, false) && go(&m, at, (double[]){at[0], at[1], at[2]}, SETTLE, false));
        const pal_contact_patch patch = tool_of(&m)->patch[0];
        REQUIRE(force_at(&m, at, 0, 0, half_m, false, less) && force_at(&m, at, 0, 0, -half_m, false, more));
        const double slope = (more[2] - less[2]) / (2 * half_m),
                     published = patch.k1_N_m * patch.normal[2] * patch.normal[2];
        printf("  steps of %.2g ms: k1 %.4g, slope %.4g N/m (%+.1f %%)\n", 1e3 * step_s[k], published, slope,
               100 * (published / slope - 1));
        CHECK_NEAR(published, slope, 0.06 * slope);
        model_scene_close(&m);
    }
}

/* all of K against forces a tenth of a millimetre to each side; and the force that it foretells a millimetre away */
static void a_grasp_has_the_tangent_stiffness_of_tissue(void)
{
    for (model_kind kind = 0; kind < MODEL_KINDS; kind++) {
        static const int place[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
        model_scene m;
        double at[3], worst = 0, far = 0, side_m = 0.0001;
        REQUIRE(begin(&m, kind, 0, at));
        double to[3] = {at[0], at[1], at[2] + 0.001};
        REQUIRE(go(&m, at, to, 30, false) && hold(&m, at, true));
        to[2] += 0.004, to[0] += 0.002;
        REQUIRE(go(&m, at, to, SETTLE, true));
        const pal_tool *tool = tool_of(&m);
        double K[6], f0[3];
        pal_copy3(f0, tool->grasp_f0_N);
        REQUIRE(tool->has_grasp);
        memcpy(K, tool->grasp_k_N_m, sizeof K);
        CHECK_LE(pal_dist3(tool->grasp_x0_m, at), 1e-12);
        CHECK_LE(pal_dist3(tool->grasp_f0_N, tool->mean_force_N), 1e-3 * pal_norm3(tool->mean_force_N));
        const double largest = fmax(K[0], fmax(K[3], K[5]));
        for (int c = 0; c < 3; c++) {
            double less[3], more[3];
            REQUIRE(force_at(&m, at, -side_m * (c == 0), -side_m * (c == 1), -side_m * (c == 2), true, less));
            REQUIRE(force_at(&m, at, side_m * (c == 0), side_m * (c == 1), side_m * (c == 2), true, more));
            for (int i = 0; i < 3; i++) worst = fmax(worst, fabs(K[place[i][c]] + (more[i] - less[i]) / (2 * side_m)));
            for (int s = -1; s <= 1; s += 2) {
                double to_m[3] = {0}, off[3];
                to_m[c] = 0.001 * s;
                REQUIRE(force_at(&m, at, to_m[0], to_m[1], to_m[2], true, off));
                for (int i = 0; i < 3; i++) off[i] -= f0[i] - K[place[i][c]] * to_m[c];
                far = fmax(far, pal_norm3(off) / pal_norm3(f0));
            }
        }
        const double minor = K[0] * K[3] - K[1] * K[1], det = K[0] * (K[3] * K[5] - K[4] * K[4]) -
                                                              K[1] * (K[1] * K[5] - K[4] * K[2]) +
                                                              K[2] * (K[1] * K[4] - K[3] * K[2]);
        printf("  %-16s %.3g N, K %.4g %.4g %.4g / %.4g %.4g / %.4g, %.2g %% of the largest off; a millimetre away "
               "%.2g %% of the force\n",
               model_kind_name[kind], pal_norm3(f0), K[0], K[1], K[2], K[3], K[4], K[5], 100 * worst / largest,
               100 * far);
        CHECK(K[0] > 0 && minor > 0 && det > 0);
        CHECK_LE(worst, 0.02 * largest);
        CHECK_LE(far, 0.03);
        CHECK(tool->grasp_b_Ns_m >= 0);
        model_scene_close(&m);
    }
}

/* parts of the tool's force along and across the normal of its first patch */
static void split(const model_scene *m, double *normal_N, double across[3])
{
    const pal_contact_patch *patch = &tool_of(m)->patch[0];
    *normal_N = pal_dot3(tool_of(m)->mean_force_N, patch->normal);
    pal_copy3(across, tool_of(m)->mean_force_N);
    pal_axpy3(across, -*normal_N, patch->normal);
}

/* settled stiffness along an axis by a fifth of the way to slipping, to the side that sticks: friction that is near its
 * limit at rest slips on the other, which is softer */
static bool stick(model_scene *m, double at[3], int axis, double side_m, double *k_N_m)
{
    double less[3], more[3], mid[3];
    if (!force_at(m, at, -side_m * (axis == 0), -side_m * (axis == 1), 0, false, less)) return false;
    pal_copy3(mid, tool_of(m)->mean_force_N);
    if (!force_at(m, at, side_m * (axis == 0), side_m * (axis == 1), 0, false, more)) return false;
    *k_N_m = fmax(less[axis] - mid[axis], mid[axis] - more[axis]) / side_m;
    return true;
}

/* a stroke of 10 mm at 20 mm/s after a press of 3 mm */
static void friction_is_what_the_patch_says(void)
{
    for (model_kind kind = 0; kind < MODEL_KINDS; kind++) {
        model_scene m;
        double at[3], k[2], worst = 0, mean = 0, normal, across[3];
        REQUIRE(begin(&m, kind, friction, at));
        double to[3] = {at[0], at[1], at[2] - 0.003};
        REQUIRE(go(&m, at, to, SETTLE, false));
        const pal_contact_patch patch = tool_of(&m)->patch[0];
        split(&m, &normal, across);
        const double side_m = 0.2 * friction * normal / patch.kt_N_m;
        REQUIRE(stick(&m, at, 0, side_m, &k[0]) && stick(&m, at, 1, side_m, &k[1]));
        const double slope = 2 / (1 / k[0] + 1 / k[1]);
        int n = 0;
        for (int i = 1; i <= 30; i++) {
            to[0] = at[0] + speed_m_s * m.scene->step_s;
            REQUIRE(go(&m, at, to, 0, false));
            split(&m, &normal, across);
            if (i <= 20) continue;
            worst = fmax(worst, fabs(pal_norm3(across) / (friction * normal) - 1));
            mean += (pal_norm3(across) / (friction * normal) - 1), n++;
        }
        printf(
            "  %-16s kt %.4g, slopes %.4g and %.4g N/m (%+.1f %%); sliding %+.2g %% of mu N, worst %.2g %%, %.3g N\n",
            model_kind_name[kind], patch.kt_N_m, k[0], k[1], 100 * (patch.kt_N_m / slope - 1), 100 * mean / n,
            100 * worst, normal);
        CHECK(patch.mu_static == friction && patch.mu_dynamic == friction);
        CHECK_LE(fabs(mean / n), 0.025);
        CHECK_NEAR(patch.kt_N_m, slope, 0.1 * slope);
        model_scene_close(&m);
    }
}

/* torque about the tool's centre of the loads on tissue, as nodes were when they were given */
static void torque_of_loads(const model_scene *m, double torque[3])
{
    const pal_body *body = m->body;
    const double dt_s = m->scene->step_s / pal_world_substeps(m->world);
    pal_set3(torque, 0, 0, 0);
    for (size_t i = 0; i < (size_t)body->n_node; i++) {
        double arm[3], part[3];
        pal_sub3(arm, body->d + 3 * i, tool_of(m)->here_m);
        pal_axpy3(arm, -dt_s, body->dv + 3 * i);
        pal_cross3(part, arm, body->load + 3 * i);
        pal_add3(torque, torque, part);
    }
}

/* what a tool feels is the opposite of what tissue receives. Friction acts on a cap 3 mm high, so its arm along the
 * normal is between the radius and 3 mm less */
static void torque_is_that_of_friction_and_of_the_grasp(void)
{
    for (model_kind kind = 0; kind < MODEL_KINDS; kind++) {
        model_scene m;
        double at[3], normal, across[3], on_tissue[3], sum[3];
        REQUIRE(begin(&m, kind, friction, at));
        double to[3] = {at[0], at[1], at[2] - 0.003};
        REQUIRE(go(&m, at, to, SETTLE, false));
        to[0] += 0.01;
        REQUIRE(go(&m, at, to, 0, false));
        split(&m, &normal, across);
        const double slid = pal_norm3(tool_of(&m)->torque_Nm) / (pal_norm3(across) * 0.012);
        REQUIRE(go(&m, at, to, SETTLE, false));
        torque_of_loads(&m, on_tissue);
        pal_add3(sum, on_tissue, tool_of(&m)->torque_Nm);
        const double pushed = pal_norm3(sum) / pal_norm3(on_tissue);
        to[2] += 0.004;
        REQUIRE(go(&m, at, to, SETTLE, false) && hold(&m, at, true));
        to[0] += 0.004, to[2] += 0.004;
        REQUIRE(go(&m, at, to, SETTLE, true));
        torque_of_loads(&m, on_tissue);
        pal_add3(sum, on_tissue, tool_of(&m)->torque_Nm);
        const double held = pal_norm3(sum) / pal_norm3(on_tissue);
        double arm[3];
        pal_cross3(arm, tool_of(&m)->grasp_arm_m, tool_of(&m)->grasp_f0_N);
        printf("  %-16s sliding %.4g of T R; off the tissue's by %.2g pressing, %.2g holding %.3g Nm\n",
               model_kind_name[kind], slid, pushed, held, pal_norm3(on_tissue));
        CHECK(slid <= 1 && slid >= 1 - 0.003 / 0.012);
        CHECK_LE(pushed, 0.05);
        CHECK_LE(held, 0.01);
        CHECK_LE(pal_dist3(arm, tool_of(&m)->torque_Nm), 1e-6 * pal_norm3(arm));
        model_scene_close(&m);
    }
}

/* a tool that turns on the spot, slowly, drags the tissue it presses, and not without friction */
static void a_turning_tool_drags_by_its_surface(void)
{
    for (int k = 0; k < 2; k++)
        for (model_kind kind = 0; kind < MODEL_KINDS; kind++) {
            model_scene m;
            double at[3], normal, before[3], across[3];
            REQUIRE(begin(&m, kind, k ? friction : 0, at));
            double to[3] = {at[0], at[1], at[2] - 0.003};
            REQUIRE(go(&m, at, to, SETTLE, false));
            split(&m, &normal, before);
            for (int i = 1; i <= 60; i++) {
                const double half = 0.5 * i / 60;
                pal_pose pose = {.position_m = {at[0], at[1], at[2]}, .quat = {cos(half), 0, sin(half), 0}};
                REQUIRE(!pal_world_pose(m.world, 0, &pose) && model_scene_steps(&m, 1));
            }
            /* about y, so that the lowest point goes to -x, tissue with it, and the tool is drawn to +x */
            CHECK_NEAR(tool_of(&m)->omega_rad_s[1], 1, 1e-9);
            split(&m, &normal, across);
            printf("  %-16s mu %.1f: %.3g of N along x, %.3g before\n", model_kind_name[kind], k ? friction : 0,
                   across[0] / normal, before[0] / normal);
            if (k) CHECK_NEAR(across[0] / normal, friction, 0.05 * friction);
            if (!k) CHECK_LE(fabs(across[0] - before[0]), 0.01 * normal);
            model_scene_close(&m);
        }
}

int main(void)
{
    RUN_LONG(a_resting_hand_has_a_steady_model_of_the_right_stiffness);
    RUN_LONG(short_steps_find_the_same_stiffness);
    RUN_LONG(a_grasp_has_the_tangent_stiffness_of_tissue);
    RUN_LONG(friction_is_what_the_patch_says);
    RUN_LONG(torque_is_that_of_friction_and_of_the_grasp);
    RUN_LONG(a_turning_tool_drags_by_its_surface);
    return check_report();
}
