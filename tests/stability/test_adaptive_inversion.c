/* Hard cases (catalogue.txt) for adaptive surface springs that last: rigid turns up to ten thousand of them, an
 * hour at rest under a load, supports put on and taken off while the body is bent. */
#include "tests/fixtures/adaptive_worlds.h"
#include "tests/stability/hard_case.h"

enum { STEPS_A_SECOND = 60 };
static const double step_s = 1.0 / STEPS_A_SECOND, radius_m = 0.05;

/* eight faces: as few as a body that turns may have */
static bool take_octahedron(shell_scene *s)
{
    static const int32_t tri[24] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    pal_surface surface = {.n_vertex = 6, .n_tri = 8, .x = calloc(18, sizeof(double)), .tri = malloc(sizeof tri)};
    if (!surface.x || !surface.tri) return false;
    for (int i = 0; i < 6; i++) surface.x[3 * i + i / 2] = i % 2 ? -radius_m : radius_m;
    memcpy(surface.tri, tri, sizeof tri);
    shell_scene_take(s, &surface);
    shell_scene_number(s, "levels", 2);
    return true;
}

static bool take_sphere(shell_scene *s)
{
    pal_surface surface;
    if (pal_sphere_make(radius_m, &surface)) return false;
    shell_scene_take(s, &surface);
    shell_scene_number(s, "levels", 3);
    return true;
}

/* ---- turns ---- */

static void turn_quat(const double axis[3], double angle, double quat[4])
{
    double unit[3] = {0, 0, 0};
    pal_unit3(unit, axis, 0);
    quat[0] = cos(0.5 * angle);
    pal_scale3(quat + 1, sin(0.5 * angle), unit);
}

/* every active node at its place at rest, turned and stretched about the origin, and there at rest */
static void put_turned(shell_scene *s, const double quat[4], double stretch)
{
    for (int k = 0; k < s->body->n_active; k++) {
        double *x = s->body->x + 3 * pal_body_point(s->body, k), way[3];
        pal_scale3(way, stretch, s->body->x_rest + 3 * pal_body_point(s->body, k));
        pal_quat_rotate(x, quat, way);
        pal_set3(s->body->v + 3 * pal_body_point(s->body, k), 0, 0, 0);
    }
}

/* the farthest that a node stands from its place in the shape at rest, turned to fit, over the size */
static double not_rigid(const shell_scene *s)
{
    pal_rigid_fit frame = {.quat = {1, 0, 0, 0}};
    double max = 0, at[3];
    pal_adaptive_fit_rigid(s->body->model.adaptive, s->body, &frame);
    for (int k = 0; k < s->body->n_active; k++) {
        const int i = pal_body_point(s->body, k);
        pal_sub3(at, s->body->x_rest + 3 * i, frame.rest_centre_m);
        pal_mul33(at, frame.R, at);
        pal_add3(at, at, frame.centre_m);
        max = fmax(max, pal_dist3(at, s->body->x + 3 * i));
    }
    return max / s->body->length_scale_m;
}

/* energy of the body stretched by one hundredth every way */
static double strained_J(shell_scene *s)
{
    const double none[4] = {1, 0, 0, 0};
    put_turned(s, none, 1.01);
    double energy = pal_world_energy_J(s->world);
    put_turned(s, none, 1);
    return energy;
}

static void quarter_and_half_turns_strain_nothing(void)
{
    static const double axes[4][3] = {{1, 0, 0}, {0, 0, 1}, {1, 1, 0}, {1, -2, 3}};
    for (int start = 0; start < 2; start++)
        for (int run = 0; run < 8; run++) {
            shell_scene s;
            double quat[4];
            REQUIRE(take_sphere(&s));
            shell_scene_number(&s, "start_level", start);
            shell_scene_text(&s, "frame", "body");
            REQUIRE(shell_scene_start(&s));
            double strained = strained_J(&s);
            CHECK(strained > 1e-6);
            turn_quat(axes[run % 4], run < 4 ? M_PI / 2 : M_PI, quat);
            put_turned(&s, quat, 1);
            pal_world_invalidate_limits(s.world, 0);
            CHECK_LE(pal_world_energy_J(s.world), 1e-6 * strained);
            /* it stays as it stands: left alone, nothing turns it back */
            for (int i = 0; i < STEPS_A_SECOND / 2; i++) REQUIRE(!pal_world_step(s.world, step_s));
            HARD_CASE("turns", "adaptive_springs", "energy over that of 1 % strain",
                      pal_world_energy_J(s.world) / strained, 1e-6, "");
            CHECK_LE(not_rigid(&s), 1e-5);
            double worst = 0, at[3];
            for (int k = 0; k < s.body->n_active; k++) {
                const int i = pal_body_point(s.body, k);
                pal_quat_rotate(at, quat, s.body->x_rest + 3 * i);
                worst = fmax(worst, pal_dist3(at, s.body->x + 3 * i));
            }
            CHECK_LE(worst, 1e-5 * s.body->length_scale_m);
            shell_scene_close(&s);
        }
}

/* in strides of 0.3 turns about an axis that wanders: the fit follows its last one all the way */
static void ten_thousand_turns_strain_nothing(void)
{
    shell_scene s;
    double quat[4] = {1, 0, 0, 0};
    const double stride = 0.3;
    const int n = (int)(CHECK_REPEATS(10000, 500) / stride);
    REQUIRE(take_octahedron(&s));
    shell_scene_number(&s, "start_level", 1);
    shell_scene_text(&s, "frame", "body");
    REQUIRE(shell_scene_start(&s));
    const double strained = strained_J(&s);
    double max = 0;
    for (int i = 1; i <= n; i++) {
        const double axis[3] = {0.3 * sin(1e-3 * i), 0.3 * cos(1e-3 * i), 1};
        turn_quat(axis, 2 * M_PI * fmod(stride * i, 1), quat);
        put_turned(&s, quat, 1);
        REQUIRE(!pal_world_step(s.world, step_s));
        max = fmax(max, pal_world_energy_J(s.world));
    }
    printf("  %.0f turns: at most %.2g of the energy of 1 %% strain, rigid to %.2g of its size\n", n * stride,
           max / strained, not_rigid(&s));
    HARD_CASE("many_turns", "adaptive_springs", "energy over that of 1 % strain", max / strained, 1e-6, "");
    CHECK_LE(not_rigid(&s), 1e-5);
    for (int i = 0; i < STEPS_A_SECOND; i++) REQUIRE(!pal_world_step(s.world, step_s));
    CHECK_LE(pal_world_energy_J(s.world), 1e-6 * strained);
    CHECK_LE(not_rigid(&s), 1e-5);
    shell_scene_close(&s);
}

static void angular_momentum(const pal_body *body, double sum[3])
{
    double arm[3], turn[3];
    pal_set3(sum, 0, 0, 0);
    for (int k = 0; k < body->n_active; k++) {
        const int i = pal_body_point(body, k);
        pal_copy3(arm, body->x + 3 * i);
        pal_cross3(turn, arm, body->v + 3 * i);
        pal_axpy3(sum, body->mass_kg[i], turn);
    }
}

/* a body that spins about itself does so on and on, joined or not: frame "body" neither brakes nor winds up */
static void a_spinning_shell_keeps_its_angular_momentum(void)
{
    for (int refines = 0; refines < 2; refines++) {
        shell_scene s;
        const double spin[3] = {0, 0, 2 * M_PI};
        double before[3], after[3];
        REQUIRE(take_octahedron(&s));
        shell_scene_number(&s, "start_level", 1);
        shell_scene_text(&s, "frame", "body");
        if (!refines) pal_entry_put_bool(shell_scene_model(&s), "refine", false, NULL);
        REQUIRE(shell_scene_start(&s));
        for (int k = 0; k < s.body->n_active; k++) {
            const int i = pal_body_point(s.body, k);
            pal_cross3(s.body->v + 3 * i, spin, s.body->x + 3 * i);
        }
        pal_world_invalidate_limits(s.world, 0);
        angular_momentum(s.body, before);
        const double start = pal_world_energy_J(s.world);
        const int turns = CHECK_REPEATS(100, 10);
        double max = 0;
        for (int i = 0; i < turns * STEPS_A_SECOND; i++) {
            REQUIRE(!pal_world_step(s.world, step_s));
            max = fmax(max, pal_world_energy_J(s.world));
        }
        angular_momentum(s.body, after);
        printf("  %d s: angular momentum changed by %.2g, energy %.4f of what it was, %d nodes\n", turns,
               pal_dist3(before, after) / pal_norm3(before), pal_world_energy_J(s.world) / start, s.body->n_active);
        CHECK_LE(max, 1.01 * start);
        /* rk4 keeps it to its order: 1e-4 in 10,000 steps is what may be gained, ten times that lost */
        CHECK_LE(pal_dist3(before, after), 1e-3 * pal_norm3(before));
        CHECK_LE(pal_norm3(after), (1 + 1e-4) * pal_norm3(before));
        CHECK_LE(not_rigid(&s), 0.01);
        shell_scene_close(&s);
    }
}

/* ---- an hour ---- */

static void an_hour_at_rest_under_load_moves_nothing(void)
{
    shell_scene s;
    const double top[3] = {0, 0, radius_m};
    REQUIRE(take_octahedron(&s));
    /* so soft that a step is one sub-step */
    s.scene->body[0].material.young_Pa = 50;
    s.scene->body[0].material.damping_1_s = 4;
    shell_scene_hold(&s, (const double[3]){-1, -1, -1}, (const double[3]){1, 1, -0.9 * radius_m});
    REQUIRE(shell_scene_start(&s));
    const int settled = 120 * STEPS_A_SECOND, hour = CHECK_REPEATS(3600, 300) * STEPS_A_SECOND;
    double at[3 * 32], drift = 0, max_J = 0, strained = 0;
    uint64_t revision = 0;
    REQUIRE(s.body->n_node <= 32);
    for (int i = 0; i < settled; i++) {
        if (i < 10 * STEPS_A_SECOND) shell_scene_press(&s, top, 0.06, (const double[3]){0, 0, -0.001});
        REQUIRE(!pal_world_step(s.world, step_s));
    }
    CHECK_INT(pal_world_substeps(s.world), 1);
    memcpy(at, s.body->x, 3 * (size_t)s.body->n_node * sizeof *at);
    revision = s.body->display.revision, strained = pal_world_energy_J(s.world);
    CHECK(shell_scene_rms(&s) > 1e-3 * s.body->length_scale_m);
    for (int i = 0; i < hour; i++) {
        REQUIRE(!pal_world_step(s.world, step_s));
        max_J = fmax(max_J, pal_body_kinetic_J(s.body));
    }
    for (int i = 0; i < s.body->n_node; i++) drift = fmax(drift, pal_dist3(at + 3 * i, s.body->x + 3 * i));
    printf("  %d s: drift %.2g of its size, kinetic energy %.2g of the elastic one\n", hour / STEPS_A_SECOND,
           drift / s.body->length_scale_m, max_J / strained);
    HARD_CASE("hour", "adaptive_springs", "drift in an hour", drift / s.body->length_scale_m, 1e-6, "S");
    HARD_CASE("hour", "adaptive_springs", "kinetic energy over what is stored", max_J / strained, 1e-9, "");
    CHECK_INT(s.body->display.revision, revision);
    shell_scene_close(&s);
}

/* ---- supports ---- */

/* holds or lets go every vertex of every level within a box of places at rest, as a scene's support does */
static int switch_support(shell_scene *s, const double low[3], const double high[3], bool on)
{
    int n = 0;
    for (int i = 0; i < s->body->n_node; i++) {
        const double *x = s->body->x_rest + 3 * i;
        bool in = true;
        for (int c = 0; c < 3; c++) in = in && x[c] >= low[c] && x[c] <= high[c];
        if (!in) continue;
        s->body->support[i] = on;
        if (on) pal_set3(s->body->v + 3 * i, 0, 0, 0);
        n += pal_adaptive_has(s->body->model.adaptive, i);
    }
    pal_world_invalidate_limits(s->world, 0);
    return n;
}

/* energy after every step is at most that of the start and 1 %; tells how far it is from rest at the end over its size
 */
static double run_bounded(shell_scene *s, double seconds)
{
    double start = pal_world_energy_J(s->world), max = 0;
    for (int i = 0; i < (int)(seconds * STEPS_A_SECOND); i++) {
        if (pal_world_step(s->world, step_s) || !pal_body_finite(s->body) || s->body->frozen) return NAN;
        max = fmax(max, pal_world_energy_J(s->world));
    }
    printf("  most %.4f of the energy at the switch, %d nodes\n", max / start, s->body->n_active);
    HARD_CASE("supports", "adaptive_springs", "rise of energy after a switch", 100 * fmax(0, max / start - 1), 1, "%");
    return shell_scene_rms(s) / s->body->length_scale_m;
}

static void supports_switched_while_it_is_bent_add_no_energy(void)
{
    static const double bottom[2][3] = {{-1, -1, -1}, {1, 1, -0.045}}, side[2][3] = {{0.025, -1, -1}, {1, 1, 1}};
    const double top[3] = {0, 0, radius_m}, rim[3] = {0.02, 0, 0.045};
    for (int run = 0; run < 3; run++) { /* coarse, refined, adaptive */
        shell_scene s;
        REQUIRE(take_sphere(&s));
        if (run == 1) shell_scene_number(&s, "start_level", 1);
        if (run < 2) pal_entry_put_bool(shell_scene_model(&s), "refine", false, NULL);
        s.scene->body[0].material.damping_1_s = 4;
        shell_scene_hold(&s, bottom[0], bottom[1]);
        REQUIRE(shell_scene_start(&s));
        for (int i = 0; i < STEPS_A_SECOND / 4; i++) {
            shell_scene_press(&s, top, 0.02, (const double[3]){0.2, 0, -0.4});
            REQUIRE(!pal_world_step(s.world, step_s));
        }
        shell_scene_press(&s, top, 0.02, (const double[3]){0, 0, 0});
        CHECK(shell_scene_rms(&s) > 5e-3 * s.body->length_scale_m);
        /* a third of it where it is now, bent and on its way */
        CHECK(switch_support(&s, side[0], side[1], true) > 10);
        CHECK(run_bounded(&s, 0.6) > 1e-4);
        /* the one it began with off: only the bent place holds it */
        CHECK(switch_support(&s, bottom[0], bottom[1], false) > 3);
        CHECK(run_bounded(&s, 0.3) > 1e-4);
        /* pressed at its rim, where new nodes are held as far from rest as those beside them */
        for (int i = 0; i < STEPS_A_SECOND / 4; i++) {
            shell_scene_press(&s, rim, 0.02, (const double[3]){0, 0.2, -0.2});
            REQUIRE(!pal_world_step(s.world, step_s));
        }
        shell_scene_press(&s, rim, 0.02, (const double[3]){0, 0, 0});
        run_bounded(&s, 0.6);
        /* on and off again, step by step */
        for (int i = 0; i < 6; i++) {
            CHECK(switch_support(&s, bottom[0], bottom[1], i % 2 == 0) > 3);
            run_bounded(&s, 2.01 * step_s);
        }
        /* all off: anchors in the world bring it back */
        CHECK(switch_support(&s, side[0], side[1], false) > 10);
        double left = run_bounded(&s, 1.5);
        printf("  %.2g of its size left\n", left);
        HARD_CASE("supports", "adaptive_springs", "off rest 1.5 s after the last", 100 * left, 0.1, "% S");
        shell_scene_close(&s);
    }
}

int main(void)
{
    RUN(quarter_and_half_turns_strain_nothing);
    RUN(ten_thousand_turns_strain_nothing);
    RUN(a_spinning_shell_keeps_its_angular_momentum);
    RUN(an_hour_at_rest_under_load_moves_nothing);
    RUN(supports_switched_while_it_is_bent_add_no_energy);
    return check_report();
}
