/* Anchors of adaptive surfaces (paper C, eq. 10; errata C6, C7): they hold the shape and nothing else, whatever is
 * refined. */
#include "tests/fixtures/adaptive_components.h"
#include "tests/fixtures/adaptive_worlds.h"
#include "tests/fixtures/body_sums.h"

static const double k_N_m = 2.5, c_Ns_m = 0.03, no_move[3] = {0};

static bool open_sphere(shell_row *r, int n_level, const char *frame, double damping_Ns_m)
{
    pal_surface sphere;
    if (pal_sphere_make(0.05, &sphere) || !shell_row_open(r, &sphere, n_level, 0, "shape_spring")) return false;
    shell_row_number(r, "k_N_m", k_N_m);
    shell_row_number(r, "c_Ns_m", damping_Ns_m);
    shell_row_text(r, "frame", frame);
    return !shell_row_make(r);
}

static bool open_stomach(shell_row *r, int n_level, double damping_Ns_m)
{
    pal_surface stomach;
    if (!shell_row_stomach(&stomach) || !shell_row_open(r, &stomach, n_level, 0, "shape_spring")) return false;
    shell_row_number(r, "k_N_m", k_N_m);
    shell_row_number(r, "c_Ns_m", damping_Ns_m);
    return !shell_row_make(r);
}

static void is_silent_at_rest_on_every_mixture_of_levels(void)
{
    for (int world = 0; world < 2; world++) {
        shell_row r;
        REQUIRE(open_sphere(&r, 3, world ? "world" : "body", c_Ns_m));
        for (int turn = 0; turn < 4; turn++) {
            shell_row_run(&r, 1);
            CHECK_LE(shell_row_largest(&r), 1e-14 * k_N_m * r.body.length_scale_m);
            CHECK_LE(shell_row_energy(&r), 1e-26 * k_N_m);
            if (turn < 2) shell_row_mix(&r, 25);
            if (turn == 2) pal_adaptive_set_level(r.adaptive, &r.body, 2), pal_adaptive_update(r.adaptive, &r.body);
        }
        shell_row_close(&r);
    }
}

static void do_nothing_to_a_rigid_motion(void)
{
    static const double degrees[] = {0, 1, 30, 90, 170, 179.9, 180, 270};
    const double shift[3] = {0.3, -0.2, 0.1}, V[3] = {1, -2, 0.5}, Omega[3] = {20, -5, 9};
    shell_row r;
    REQUIRE(open_stomach(&r, 2, c_Ns_m));
    shell_row_mix(&r, 40);
    for (int d = 0; d < (int)(sizeof degrees / sizeof *degrees); d++) {
        shell_row_turn(&r, degrees[d], shift, V, Omega);
        /* once with the frame of the turn before, once from rest */
        for (int again = 0; again < 2; again++) {
            shell_row_run(&r, 1);
            /* rounding of what it would be without a frame: k' 0.5 m + c' 10 m/s */
            CHECK_LE(shell_row_largest(&r), 1e-13 * (0.5 * k_N_m + 10 * c_Ns_m));
            CHECK_LE(shell_row_energy(&r), 1e-20);
            r.effect->reset(r.self, &r.body);
        }
    }
    shell_row_close(&r);
}

static void has_no_net_force_or_torque_in_the_body_frame(void)
{
    shell_row r;
    REQUIRE(open_stomach(&r, 3, c_Ns_m));
    shell_row_mix(&r, 40);
    for (int turn = 0; turn < 4; turn++) {
        /* the last turns are a heap of points */
        shell_row_shake(&r, turn == 0 ? 1e-3 : turn == 1 ? 0.01 : turn == 2 ? 0.1 : 1, 1);
        shell_row_run(&r, 1);
        shell_row_check_balance(&r, 1e-13);
    }
    shell_row_close(&r);
}

static void forces_are_the_gradient_although_the_frame_follows(void)
{
    for (int world = 0; world < 2; world++) {
        shell_row r;
        REQUIRE(open_sphere(&r, 2, world ? "world" : "body", 0));
        shell_row_mix(&r, 6);
        for (int turn = 0; turn < 3; turn++) {
            if (turn < 2) shell_row_shake(&r, turn == 0 ? 1e-3 : 0.02, 0);
            /* far from where the frame was, and squeezed to a third */
            if (turn == 2) {
                shell_row_turn(&r, 130, (double[3]){0.01, 0.02, 0.03}, no_move, no_move);
                for (int k = 0; k < r.body.n_active; k++) r.body.x[3 * r.body.active[k] + 2] *= 0.3;
            }
            CHECK_LE(shell_row_gradient_error(&r, 1, 1e-6), 1e-6);
        }
        shell_row_close(&r);
    }
}

static void damping_takes_power_and_leaves_rigid_motion(void)
{
    shell_row r;
    double power = 0, rigid[3] = {0};
    REQUIRE(open_sphere(&r, 2, "body", c_Ns_m));
    shell_row_mix(&r, 20);
    /* at rest in shape, so that only damping acts */
    shell_row_shake(&r, 0, 1);
    shell_row_run(&r, 1);
    for (int k = 0; k < r.body.n_active; k++) {
        size_t i = 3 * (size_t)r.body.active[k];
        power += pal_dot3(r.body.f + i, r.body.v + i);
        pal_add3(rigid, rigid, r.body.f + i);
    }
    CHECK(power < 0);
    CHECK_LE(pal_norm3(rigid), 1e-14 * shell_row_largest(&r) * r.body.n_active);
    shell_row_check_balance(&r, 1e-13);
    /* radial breathing v = b r moves no frame: f = -c'/m_0 m v exactly */
    double rate = c_Ns_m / r.adaptive->level_mass_kg[0], worst = 0;
    pal_rigid_fit frame = {.quat = {1}};
    pal_adaptive_fit_rigid(r.adaptive, &r.body, &frame);
    for (int k = 0; k < r.body.n_active; k++) {
        size_t i = 3 * (size_t)r.body.active[k];
        pal_sub3(r.body.v + i, r.body.x + i, frame.centre_m);
    }
    shell_row_run(&r, 1);
    for (int k = 0; k < r.body.n_active; k++) {
        size_t i = 3 * (size_t)r.body.active[k];
        for (int c = 0; c < 3; c++)
            worst = fmax(worst, fabs(r.body.f[i + c] + rate * r.body.mass_kg[i / 3] * r.body.v[i + c]));
    }
    CHECK_LE(worst, 1e-12 * shell_row_largest(&r));
    shell_row_close(&r);
}

/* every node feels -w^2 m u, w^2 = k'/m_0, so a translation swings with w on any mixture; and the sum of k'_i stays */
static void refinement_changes_neither_sum_nor_frequency_of_anchors(void)
{
    shell_row r;
    REQUIRE(open_sphere(&r, 3, "world", 0));
    const double u[3] = {1e-3, -2e-3, 3e-3}, w2 = k_N_m / r.adaptive->level_mass_kg[0];
    const double total = w2 * r.adaptive->options.mass_kg;
    CHECK_NEAR(total, k_N_m * PAL_SPHERE_VERTEX, 1e-12 * total);
    for (int turn = 0; turn < 4; turn++) {
        double force[3] = {0}, bound = 0, worst = 0;
        shell_row_turn(&r, 0, u, no_move, no_move);
        shell_row_run(&r, 1);
        for (int k = 0; k < r.body.n_active; k++) {
            size_t i = 3 * (size_t)r.body.active[k];
            const double *f = r.body.f + i, m = r.body.mass_kg[i / 3];
            pal_add3(force, force, f);
            for (int c = 0; c < 3; c++) worst = fmax(worst, fabs(f[c] / (m * u[c]) + w2));
        }
        CHECK_LE(worst, 1e-12 * w2);
        for (int c = 0; c < 3; c++) CHECK_NEAR(force[c], -total * u[c], 1e-12 * total * fabs(u[c]));
        double *sum = calloc((size_t)r.body.n_dof, sizeof *sum);
        REQUIRE(sum);
        r.effect->bounds.stiffness(r.self, &r.body, sum);
        for (int i = 0; i < r.body.n_dof; i++) bound += sum[i];
        free(sum);
        CHECK_NEAR(bound, total, 1e-12 * total);
        if (turn < 2) shell_row_mix(&r, 30);
        if (turn == 2) pal_adaptive_set_level(r.adaptive, &r.body, 2), pal_adaptive_update(r.adaptive, &r.body);
    }
    CHECK_INT(r.body.n_active, 1794);
    shell_row_close(&r);
}

static void its_stiffness_is_what_it_says(void)
{
    for (int world = 0; world < 2; world++) {
        shell_row r;
        REQUIRE(open_sphere(&r, 2, world ? "world" : "body", c_Ns_m));
        shell_row_mix(&r, 20);
        double bound = shell_row_bound(&r), found = shell_row_stiffest(&r, 1, 1e-7, 40);
        CHECK_LE(found, (1 + 1e-6) * bound);
        CHECK_LE(0.999 * bound, found);
        r.adaptive->shape_ramp = 0.25;
        CHECK_NEAR(shell_row_bound(&r), 0.25 * bound, 1e-12 * bound);
        CHECK_NEAR(shell_row_stiffest(&r, 1, 1e-7, 40), 0.25 * found, 1e-3 * bound);
        shell_row_close(&r);
    }
}

static void a_change_of_level_is_ramped_alike_in_force_and_energy(void)
{
    shell_row r;
    REQUIRE(open_sphere(&r, 2, "body", 0));
    shell_row_shake(&r, 0.01, 0);
    shell_row_run(&r, 1);
    double force = shell_row_largest(&r), before = shell_row_energy(&r);
    r.adaptive->shape_ramp = 0.5;
    shell_row_run(&r, 1);
    CHECK_NEAR(shell_row_largest(&r), 0.5 * force, 1e-12 * force);
    CHECK_NEAR(shell_row_energy(&r), 0.5 * before, 1e-12 * before);
    shell_row_close(&r);
}

/* flat, a line, a point, mirrored, blown up: forces pull every node towards its place, and stay finite */
static void collapsed_bodies_are_pulled_open(void)
{
    for (int kind = 0; kind < 5; kind++) {
        static const double scale[5][3] = {{1, 1, 0}, {1, 0, 0}, {0, 0, 0}, {1, 1, -1}, {100, 100, 100}};
        shell_row r;
        double open = 0;
        REQUIRE(open_stomach(&r, 2, c_Ns_m));
        shell_row_mix(&r, 20);
        for (int k = 0; k < 3 * r.body.n_active; k++) {
            int i = 3 * r.body.active[k / 3] + k % 3;
            r.body.x[i] = scale[kind][k % 3] * r.body.x_rest[i];
        }
        shell_row_run(&r, 1);
        CHECK(shell_row_finite(&r));
        CHECK(isfinite(shell_row_energy(&r)));
        shell_row_check_balance(&r, 1e-12);
        /* the way it pulls is downhill: work over the way to rest in the component's own frame is 2 E */
        pal_rigid_fit frame = {.quat = {1}};
        pal_adaptive_fit_rigid(r.adaptive, &r.body, &frame);
        for (int k = 0; k < r.body.n_active; k++) {
            size_t i = 3 * (size_t)r.body.active[k];
            double at[3];
            pal_sub3(at, r.body.x_rest + i, frame.rest_centre_m);
            pal_mul33(at, frame.R, at);
            pal_add3(at, at, frame.centre_m);
            pal_sub3(at, at, r.body.x + i);
            open += pal_dot3(at, r.body.f + i);
        }
        CHECK(open > 0);
        CHECK_NEAR(open, 2 * shell_row_energy(&r), 1e-9 * open);
        shell_row_close(&r);
    }
}

static void a_flat_sheet_keeps_its_frame_when_it_spins(void)
{
    pal_surface sheet;
    shell_row r;
    const double Omega[3] = {3, 2, -7};
    REQUIRE(!pal_sheet_make(9, 9, 0.1, 0.1, &sheet, NULL));
    REQUIRE(shell_row_open(&r, &sheet, 2, 0, "shape_spring"));
    shell_row_number(&r, "k_N_m", k_N_m);
    REQUIRE(!shell_row_make(&r));
    shell_row_mix(&r, 20);
    for (int turn = 0; turn < 12; turn++) {
        shell_row_turn(&r, 15.0 * turn, Omega, no_move, Omega);
        shell_row_run(&r, 1);
        CHECK_LE(shell_row_largest(&r), 1e-13 * k_N_m);
        CHECK_LE(shell_row_energy(&r), 1e-20);
    }
    shell_row_close(&r);
}

/* the first run after a reset, with what came before it, and the run after that, with a look at the energy between */
static void the_same_state_gives_the_same_bits_after_a_reset(void)
{
    shell_row r;
    REQUIRE(open_sphere(&r, 2, "body", c_Ns_m));
    size_t n_byte = 3 * sizeof(double) * (size_t)r.body.n_node;
    double *first[2] = {malloc(n_byte), malloc(n_byte)};
    REQUIRE(first[0] && first[1]);
    for (int turn = 0; turn < 3; turn++) {
        for (int again = 0; again < 2; again++) {
            r.seed = 7;
            shell_row_shake(&r, 0.01, 1);
            shell_row_run(&r, 1);
            if (turn == 0) memcpy(first[again], r.body.f, n_byte);
            CHECK(!memcmp(first[again], r.body.f, n_byte));
            shell_row_turn(&r, 100, no_move, no_move, no_move);
            if (turn > 0 && again == 0) CHECK_LE(shell_row_energy(&r), 1e-20);
        }
        shell_row_run(&r, 1);
        r.effect->reset(r.self, &r.body);
    }
    free(first[0]), free(first[1]);
    shell_row_close(&r);
}

/* a free sphere whose levels stay, without damping */
static bool open_world(shell_scene *s, const char *frame, int start_level)
{
    pal_surface sphere;
    if (pal_sphere_make(0.05, &sphere)) return false;
    shell_scene_take(s, &sphere);
    shell_scene_number(s, "start_level", start_level);
    shell_scene_number(s, "c_spring_Ns_m", 0);
    shell_scene_number(s, "k_shape_N_m", k_N_m);
    shell_scene_number(s, "c_shape_Ns_m", 0);
    shell_scene_text(s, "frame", frame);
    if (pal_entry_put_bool(shell_scene_model(s), "refine", false, NULL)) return false;
    return shell_scene_start(s);
}

/* coarse, fine and mixed: after a quarter, half, whole period of w^2 = k'/m_0 */
static void a_shifted_body_swings_with_its_analytic_period(void)
{
    for (int kind = 0; kind < 3; kind++) {
        const double u = 1e-3, expect[4] = {0, -u, 0, u};
        shell_scene s;
        REQUIRE(open_world(&s, "world", kind == 1));
        pal_body *body = s.body;
        for (int32_t face = 0; face < 40 && kind == 2; face++) pal_adaptive_split(body->model.adaptive, body, face, 0);
        pal_adaptive_update(body->model.adaptive, body);
        CHECK(kind == 0 ? body->n_active == 114 : kind == 1 ? body->n_active == 450 : body->n_active > 150);
        double period = 2 * M_PI * sqrt(body->model.adaptive->level_mass_kg[0] / k_N_m);
        for (int k = 0; k < body->n_active; k++) body->x[3 * body->active[k]] += u;
        pal_world_invalidate_limits(s.world, 0);
        for (int quarter = 0; quarter < 4; quarter++) {
            double worst = 0;
            for (int i = 0; i < 25; i++) REQUIRE(!pal_world_step(s.world, period / 100));
            for (int k = 0; k < body->n_active; k++) {
                int i = 3 * body->active[k];
                worst = fmax(worst, fabs(body->x[i] - body->x_rest[i] - expect[quarter]));
            }
            CHECK_LE(worst, 1e-5 * u);
        }
        shell_scene_close(&s);
    }
}

/* anchors in the body frame let it spin and fly; those of the paper stop it */
static void a_body_flies_and_spins_freely_on_its_own_frame(void)
{
    for (int world = 0; world < 2; world++) {
        const double V[3] = {0.1, 0.2, -0.1}, Omega[3] = {3, -6, 4};
        double first[3] = {0}, last[3] = {0}, momentum[3], way[3], arm[3];
        shell_scene s;
        REQUIRE(open_world(&s, world ? "world" : "body", 0));
        pal_body *body = s.body;
        pal_rigid_fit frame = {.quat = {1}};
        pal_adaptive_fit_rigid(body->model.adaptive, body, &frame);
        for (int k = 0; k < body->n_active; k++) {
            size_t i = 3 * (size_t)body->active[k];
            pal_sub3(arm, body->x + i, frame.centre_m);
            pal_cross3(body->v + i, Omega, arm);
            pal_axpy3(first, body->mass_kg[i / 3], body->v + i);
            pal_add3(body->v + i, body->v + i, V);
        }
        CHECK_LE(pal_norm3(first), 1e-12);
        pal_copy3(way, frame.centre_m);
        for (int turn = 0; turn < 2; turn++) {
            double *spin = turn == 0 ? first : last;
            for (int i = 0; i < 60 && turn == 1; i++) REQUIRE(!pal_world_step(s.world, 1.0 / 60));
            pal_adaptive_fit_rigid(body->model.adaptive, body, &frame);
            for (int k = 0; k < body->n_active; k++) {
                size_t i = 3 * (size_t)body->active[k];
                double part[3];
                pal_sub3(arm, body->x + i, frame.centre_m);
                pal_cross3(part, arm, body->v + i);
                pal_axpy3(spin, body->mass_kg[i / 3], part);
            }
        }
        body_momentum(body, momentum);
        pal_sub3(way, frame.centre_m, way);
        pal_axpy3(momentum, -body->model.adaptive->options.mass_kg, V);
        pal_sub3(way, way, V); /* of one second */
        pal_sub3(last, last, first);
        double lost = pal_norm3(last) / pal_norm3(first);
        printf("  %s: angular momentum off by %.1e\n", world ? "world" : "body", lost);
        if (world) {
            CHECK(lost > 0.1);
        } else {
            CHECK_LE(lost, 1e-6);
            CHECK_LE(pal_norm3(momentum), 1e-12);
            CHECK_LE(pal_norm3(way), 1e-12);
        }
        shell_scene_close(&s);
    }
}

static double stiffness_after(pal_material *material, double k_given_N_m, double k_spring_N_m)
{
    pal_surface sphere;
    shell_row r;
    if (pal_sphere_make(0.05, &sphere) || !shell_row_open(&r, &sphere, 1, 0, "shape_spring")) return NAN;
    if (k_given_N_m > 0) shell_row_number(&r, "k_N_m", k_given_N_m);
    pal_config_entry *model = &r.scene->body[0].model;
    if (k_spring_N_m > 0) pal_entry_put_number(model, "k_spring_N_m", k_spring_N_m, NULL);
    pal_entry_put_number(model, "thickness_m", 0.004, NULL);
    r.scene->body[0].material.young_Pa = 8000;
    if (shell_row_make(&r)) return NAN;
    if (material) r.effect->material(r.self, &r.body, material, NULL);
    double k = shell_row_bound(&r) * r.adaptive->level_mass_kg[0];
    shell_row_close(&r);
    return k;
}

static void what_is_not_given_follows_the_material(void)
{
    pal_material hard = {.young_Pa = 8e6, .poisson = 0.45, .density_kg_m3 = 1000};
    const double derived = 0.3 * sqrt(3) / 2 * 8000 * 0.004;
    CHECK_NEAR(stiffness_after(NULL, 0, 0), derived, 1e-12 * derived);
    CHECK_NEAR(stiffness_after(&hard, 0, 0), 1000 * derived, 1e-9 * derived);
    CHECK_NEAR(stiffness_after(&hard, 3, 0), 3, 1e-12);
    CHECK_NEAR(stiffness_after(&hard, 0, 20), 6, 1e-12);
}

/* c' absent: a translation has damping ratio 0.3, c'/m_0 = 2 * 0.3 w */
static void damping_is_a_ratio_of_three_tenths(void)
{
    pal_surface sphere;
    shell_row r;
    double sum[450] = {0};
    REQUIRE(!pal_sphere_make(0.05, &sphere) && shell_row_open(&r, &sphere, 2, 0, "shape_spring"));
    shell_row_number(&r, "k_N_m", k_N_m);
    REQUIRE(!shell_row_make(&r));
    double w = sqrt(k_N_m / r.adaptive->level_mass_kg[0]);
    shell_row_mix(&r, 10);
    r.effect->bounds.damping(r.self, &r.body, sum);
    for (int k = 0; k < r.body.n_active; k++) {
        int i = r.body.active[k];
        CHECK_NEAR(sum[i] / r.body.mass_kg[i], 0.6 * w, 1e-12 * w);
    }
    shell_row_close(&r);
}

static void check_refused(const char *key, double number, const char *text, const char *wanted)
{
    pal_surface sphere;
    shell_row r;
    REQUIRE(!pal_sphere_make(0.05, &sphere) && shell_row_open(&r, &sphere, 1, 0, "shape_spring"));
    if (text)
        shell_row_text(&r, key, text);
    else
        shell_row_number(&r, key, number);
    CHECK_INT(shell_row_make(&r), PAL_ERR_REFUSED);
    printf("  %s\n", r.diag.text);
    CHECK(strstr(r.diag.text, wanted));
    shell_row_close(&r);
}

static void refuses_what_makes_no_sense(void)
{
    check_refused("k_N_m", -1, NULL, "k_N_m");
    check_refused("k_N_m", NAN, NULL, "k_N_m");
    check_refused("c_Ns_m", -0.5, NULL, "c_Ns_m");
    check_refused("c_Ns_m", INFINITY, NULL, "c_Ns_m");
    check_refused("frame", 0, "moon", "\"moon\"");
    check_refused("stiff", 1, NULL, "stiff");
    pal_body solid = {0};
    pal_diagnostic diag;
    pal_build build = {.body = &solid, .diag = &diag};
    pal_config_entry item;
    void *self;
    pal_entry_init(&item, "effects[0]", "shape_spring");
    CHECK_INT(pal_effect_shape_spring.make(&item, &build, &self), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "adaptive_springs"));
}

int main(void)
{
    RUN(is_silent_at_rest_on_every_mixture_of_levels);
    RUN(do_nothing_to_a_rigid_motion);
    RUN(has_no_net_force_or_torque_in_the_body_frame);
    RUN(forces_are_the_gradient_although_the_frame_follows);
    RUN(damping_takes_power_and_leaves_rigid_motion);
    RUN(refinement_changes_neither_sum_nor_frequency_of_anchors);
    RUN(its_stiffness_is_what_it_says);
    RUN(a_change_of_level_is_ramped_alike_in_force_and_energy);
    RUN(collapsed_bodies_are_pulled_open);
    RUN(a_flat_sheet_keeps_its_frame_when_it_spins);
    RUN(the_same_state_gives_the_same_bits_after_a_reset);
    RUN(a_shifted_body_swings_with_its_analytic_period);
    RUN(a_body_flies_and_spins_freely_on_its_own_frame);
    RUN(what_is_not_given_follows_the_material);
    RUN(damping_is_a_ratio_of_three_tenths);
    RUN(refuses_what_makes_no_sense);
    return check_report();
}
