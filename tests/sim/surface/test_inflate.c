/* Filling of hollow bodies: pressure, gas, fluid (component inflate). */
#include "tests/fixtures/adaptive_components.h"
#include "tests/fixtures/adaptive_worlds.h"

static const char *const kinds[] = {"pressure", "gas", "fluid"};

/* a sphere of radius 0.05 m or the stomach; all of the pressure at once */
static bool open_row(shell_row *r, bool stomach, int n_level, const char *kind, double pressure_Pa)
{
    pal_surface surface;
    if (stomach ? !shell_row_stomach(&surface) : pal_sphere_make(0.05, &surface) != 0) return false;
    if (!shell_row_open(r, &surface, n_level, 0, "inflate")) return false;
    shell_row_text(r, "kind", kind);
    shell_row_number(r, "pressure_Pa", pressure_Pa);
    shell_row_number(r, "ramp_s", 0);
    return !shell_row_make(r);
}

/* of what is drawn: 1/6 sum of a . b x c, and its gradient 1/6 sum of b x c at a node, both about zero */
static double drawn_volume(const shell_row *r, const double *x, double *gradient)
{
    double sum = 0;
    if (gradient) memset(gradient, 0, 3 * sizeof(double) * (size_t)r->body.n_node);
    for (int t = 0; t < r->adaptive->n_tri; t++)
        for (int c = 0; c < 3; c++) {
            const int32_t *tri = r->adaptive->tri + 3 * t;
            double n[3];
            pal_cross3(n, x + 3 * tri[(c + 1) % 3], x + 3 * tri[(c + 2) % 3]);
            sum += pal_dot3(x + 3 * tri[c], n) / 18;
            if (gradient) pal_axpy3(gradient + 3 * tri[c], 1.0 / 6, n);
        }
    return sum;
}

/* all active nodes at s times their rest place */
static void blow(shell_row *r, double s)
{
    for (int k = 0; k < 3 * r->body.n_active; k++) {
        int i = 3 * r->body.active[k / 3] + k % 3;
        r->body.x[i] = s * r->body.x_rest[i];
    }
}

/* p in f = p dV/dx, from the drawn triangles; NaN when the forces are not along the gradient */
static double pressure_of(shell_row *r)
{
    double *g = malloc(3 * sizeof *g * (size_t)r->body.n_node), fg = 0, gg = 0, worst = 0;
    if (!g) abort();
    shell_row_run(r, 10);
    (void)drawn_volume(r, r->body.x, g);
    for (int i = 0; i < 3 * r->body.n_node; i++) fg += r->body.f[i] * g[i], gg += g[i] * g[i];
    for (int i = 0; i < 3 * r->body.n_node; i++) worst = fmax(worst, fabs(r->body.f[i] - fg / gg * g[i]));
    free(g);
    return worst <= 1e-12 * (shell_row_largest(r) + 1e-300) ? fg / gg : NAN;
}

static void is_silent_at_rest_without_pressure(void)
{
    for (int kind = 0; kind < 3; kind++) {
        shell_row r;
        REQUIRE(open_row(&r, true, 3, kinds[kind], 0));
        for (int turn = 0; turn < 3; turn++) {
            shell_row_run(&r, 10);
            CHECK_LE(shell_row_largest(&r), 1e-9);
            CHECK_LE(fabs(shell_row_energy(&r)), 1e-20);
            shell_row_mix(&r, 20);
        }
        shell_row_close(&r);
    }
}

static void forces_are_the_gradient_of_their_energy(void)
{
    for (int kind = 0; kind < 3; kind++)
        for (int stomach = 0; stomach < 2; stomach++) {
            shell_row r;
            REQUIRE(open_row(&r, stomach, 2, kinds[kind], 300));
            shell_row_mix(&r, 5);
            for (int turn = 0; turn < 2; turn++) {
                shell_row_shake(&r, turn == 0 ? 1e-3 : 0.01, 0);
                CHECK_LE(shell_row_gradient_error(&r, 10, 2e-7), 1e-6);
            }
            shell_row_close(&r);
        }
}

static void has_no_net_force_or_torque(void)
{
    for (int kind = 0; kind < 3; kind++) {
        shell_row r;
        REQUIRE(open_row(&r, true, 3, kinds[kind], 300));
        shell_row_mix(&r, 40);
        for (int turn = 0; turn < 3; turn++) {
            shell_row_shake(&r, turn == 0 ? 1e-3 : turn == 1 ? 0.02 : 0.5, 0);
            shell_row_run(&r, 10);
            shell_row_check_balance(&r, 1e-12);
        }
        shell_row_close(&r);
    }
}

/* Boyle: absolute pressure times volume stays */
static void gas_keeps_pressure_times_volume(void)
{
    shell_row r;
    REQUIRE(open_row(&r, false, 2, "gas", 0));
    pal_adaptive_set_level(r.adaptive, &r.body, 1);
    pal_adaptive_update(r.adaptive, &r.body);
    double rest_m3 = drawn_volume(&r, r.body.x_rest, NULL);
    CHECK_NEAR(rest_m3, 4.0 / 3 * M_PI * pow(0.05, 3), 0.02 * rest_m3);
    for (double s = 0.5; s < 2; s *= 1.1) {
        blow(&r, s);
        double p = 101325 + pressure_of(&r), volume = drawn_volume(&r, r.body.x, NULL);
        CHECK_NEAR(p * volume / (101325 * rest_m3), 1, 1e-9);
    }
    shell_row_close(&r);
}

static void fluid_is_as_stiff_as_its_bulk(void)
{
    for (double bulk = 1e3; bulk < 2e9; bulk *= 1e3) {
        pal_surface sphere;
        shell_row r;
        REQUIRE(!pal_sphere_make(0.05, &sphere) && shell_row_open(&r, &sphere, 1, 0, "inflate"));
        shell_row_text(&r, "kind", "fluid");
        shell_row_number(&r, "bulk_Pa", bulk);
        REQUIRE(!shell_row_make(&r));
        blow(&r, 0.99);
        CHECK_NEAR(pressure_of(&r) / bulk, 1 - pow(0.99, 3), 1e-9);
        blow(&r, 1.02);
        CHECK_NEAR(pressure_of(&r) / bulk, 1 - pow(1.02, 3), 1e-9);
        shell_row_close(&r);
    }
}

/* the same shape, coarse, mixed and fine: the same energy although their volumes differ */
static void a_change_of_level_changes_no_energy(void)
{
    for (int kind = 0; kind < 3; kind++) {
        shell_row r;
        double first = 0;
        REQUIRE(open_row(&r, false, 3, kinds[kind], 300));
        double coarse_m3 = drawn_volume(&r, r.body.x_rest, NULL);
        for (int turn = 0; turn < 4; turn++) {
            if (turn == 1 || turn == 2) shell_row_mix(&r, 30);
            if (turn == 3) pal_adaptive_set_level(r.adaptive, &r.body, 2), pal_adaptive_update(r.adaptive, &r.body);
            blow(&r, 1.1);
            shell_row_run(&r, 10);
            double energy = shell_row_energy(&r);
            if (turn == 0) first = energy;
            CHECK(fabs(first) > 0.01);
            CHECK_NEAR(energy, first, 1e-12 * fabs(first));
        }
        CHECK_LE(1.02 * coarse_m3, drawn_volume(&r, r.body.x_rest, NULL));
        /* and on the finest level the pressure is the one that was given */
        blow(&r, 1);
        CHECK_NEAR(pressure_of(&r), 300, 1e-9 * 300);
        shell_row_close(&r);
    }
}

static void pressure_comes_in_within_its_ramp_and_again_after_a_reset(void)
{
    pal_surface sphere;
    shell_row r;
    REQUIRE(!pal_sphere_make(0.05, &sphere) && shell_row_open(&r, &sphere, 1, 0, "inflate"));
    shell_row_number(&r, "pressure_Pa", 200);
    REQUIRE(!shell_row_make(&r));
    double size[6], times[6] = {0, 0.125, 0.25, 0.375, 0.5, 3};
    for (int turn = 0; turn < 2; turn++) {
        for (int i = 0; i < 6; i++) {
            shell_row_run(&r, times[i]);
            size[i] = shell_row_largest(&r);
        }
        for (int i = 0; i < 5; i++) CHECK_NEAR(size[i] / size[5], times[i] / 0.5, 1e-12);
        blow(&r, 1.1);
        CHECK(shell_row_energy(&r) < 0);
        r.effect->reset(r.self, &r.body);
        CHECK_NEAR(shell_row_energy(&r), 0, 1e-20);
        blow(&r, 1);
    }
    shell_row_close(&r);
}

/* squeezed to nothing and turned inside out: bounded, and the volume is driven up */
static void stays_finite_when_flat_or_inside_out(void)
{
    static const double scale[][3] = {{1, 1, 0.04}, {1, 1, 0},  {1, 0, 0},   {0, 0, 0},
                                      {1, 1, -1},   {-2, 1, 1}, {60, 60, 60}};
    for (int kind = 1; kind < 3; kind++) {
        const double stiff_Pa = kind == 1 ? 101325 : 20000;
        shell_row r;
        REQUIRE(open_row(&r, true, 2, kinds[kind], 0));
        shell_row_mix(&r, 20);
        double *g = malloc(3 * sizeof *g * (size_t)r.body.n_node);
        REQUIRE(g);
        for (int turn = 0; turn < (int)(sizeof scale / sizeof *scale); turn++) {
            double power = 0, max = 0;
            for (int k = 0; k < 3 * r.body.n_active; k++) {
                int i = 3 * r.body.active[k / 3] + k % 3;
                r.body.x[i] = scale[turn][k % 3] * r.body.x_rest[i];
            }
            shell_row_run(&r, 10);
            CHECK(shell_row_finite(&r) && isfinite(shell_row_energy(&r)) && isfinite(shell_row_bound(&r)));
            (void)drawn_volume(&r, r.body.x, g);
            for (int k = 0; k < 3 * r.body.n_active; k++) {
                int i = 3 * r.body.active[k / 3] + k % 3;
                power += r.body.f[i] * g[i];
            }
            for (int i = 0; i < r.body.n_node; i++) max = fmax(max, pal_norm3(g + 3 * (size_t)i));
            CHECK_LE(shell_row_largest(&r), 10.6 * stiff_Pa * max);
            /* up from where it is too small, down from where it is too large */
            if (turn <= 1 || turn == 4 || turn == 5) CHECK(power > 0);
            if (turn == 6) CHECK(power < 0);
        }
        free(g);
        shell_row_close(&r);
    }
}

/* a gas below 1/11 of its volume pushes with ten times its rest pressure, no more; energy is smooth there */
static void gas_pressure_is_capped_smoothly(void)
{
    shell_row r;
    REQUIRE(open_row(&r, false, 1, "gas", 0));
    double rest_m3 = drawn_volume(&r, r.body.x_rest, NULL);
    double at[] = {0.3, 0.05, 1e-3};
    for (int i = 0; i < 3; i++) {
        blow(&r, at[i]);
        CHECK_NEAR(pressure_of(&r) / 1013250, 1, 1e-9);
    }
    blow(&r, cbrt(1.0 / 11) * 1.0001);
    CHECK_NEAR(pressure_of(&r) / 1013250, 1, 1e-3);
    double s[3] = {1.0 / 11 - 1e-5, 1.0 / 11, 1.0 / 11 + 1e-5}, energy[3];
    for (int i = 0; i < 3; i++) {
        blow(&r, cbrt(s[i]));
        energy[i] = shell_row_energy(&r);
    }
    CHECK_NEAR((energy[0] - energy[1]) / (1e-5 * rest_m3), 1013250, 1);
    CHECK_NEAR((energy[1] - energy[2]) / (1e-5 * rest_m3), 1013250, 100);
    shell_row_close(&r);
}

static void its_stiffness_bound_holds_and_is_near(void)
{
    for (int kind = 1; kind < 3; kind++)
        for (int turn = 0; turn < 3; turn++) {
            shell_row r;
            REQUIRE(open_row(&r, false, 2, kinds[kind], 0));
            shell_row_mix(&r, 10);
            blow(&r, turn == 0 ? 1 : turn == 1 ? 0.9 : 1.05);
            double bound = shell_row_bound(&r), found = shell_row_stiffest(&r, 10, 1e-7, 30);
            printf("  %s: bound %.4g, largest %.4g\n", kinds[kind], bound, found);
            CHECK_LE(fabs(found), 1.0001 * bound);
            CHECK_LE(bound, 5 * fabs(found));
            /* at rest the volume alone is stiff, and the bound is the answer */
            if (turn == 0) CHECK_LE(bound, 1.001 * found);
            shell_row_close(&r);
        }
}

static void a_surface_that_looks_inwards_is_blown_up_as_well(void)
{
    pal_surface sphere;
    shell_row r;
    REQUIRE(!pal_sphere_make(0.05, &sphere));
    for (int t = 0; t < sphere.n_tri; t++) {
        int32_t c = sphere.tri[3 * t];
        sphere.tri[3 * t] = sphere.tri[3 * t + 1], sphere.tri[3 * t + 1] = c;
    }
    REQUIRE(shell_row_open(&r, &sphere, 1, 0, "inflate"));
    shell_row_number(&r, "pressure_Pa", 100);
    REQUIRE(!shell_row_make(&r));
    shell_row_run(&r, 10);
    for (int i = 0; i < r.body.n_node; i++) CHECK(pal_dot3(r.body.f + 3 * (size_t)i, r.body.x + 3 * (size_t)i) > 0);
    blow(&r, 1.1);
    CHECK_LE(shell_row_gradient_error(&r, 10, 2e-7), 1e-6);
    shell_row_close(&r);
}

/* a free sphere of radius 0.05 m on 450 nodes with this filling, no gravity, damped */
static pal_config_entry *world_sphere(shell_scene *s, bool anchors)
{
    pal_surface sphere;
    if (pal_sphere_make(0.05, &sphere)) abort();
    shell_scene_take(s, &sphere);
    shell_scene_number(s, "levels", 2);
    shell_scene_number(s, "start_level", 1);
    if (pal_entry_put_bool(shell_scene_model(s), "refine", false, NULL)) abort();
    if (!anchors) shell_scene_number(s, "k_shape_N_m", 0);
    s->scene->body[0].material.damping_1_s = 30;
    return shell_scene_effect(s, "inflate");
}
static double world_volume(const shell_scene *s, const double *x)
{
    const pal_adaptive_surface *adaptive = s->body->model.adaptive;
    double sum = 0, n[3];
    for (int t = 0; t < adaptive->n_tri; t++) {
        const int32_t *tri = adaptive->tri + 3 * t;
        pal_cross3(n, x + 3 * tri[1], x + 3 * tri[2]);
        sum += pal_dot3(x + 3 * tri[0], n) / 6;
    }
    return sum;
}

/* a thin shell of 2-D modulus Y = E t and Poisson ratio 1/3: dR/R = p R (1 - nu)/(2 Y) */
static void a_sphere_grows_as_a_thin_shell_does(void)
{
    shell_scene s;
    const double pressure_Pa = 2, young_Pa = 5000, thickness_m = 0.003;
    pal_config_entry *item = world_sphere(&s, false);
    pal_entry_put_number(item, "pressure_Pa", pressure_Pa, NULL);
    pal_entry_put_number(item, "ramp_s", 0.1, NULL);
    REQUIRE(shell_scene_start(&s));
    CHECK_INT(s.body->n_active, 450);
    for (int i = 0; i < 60; i++) REQUIRE(!pal_world_step(s.world, 1.0 / 60));
    double grown = cbrt(world_volume(&s, s.body->x) / world_volume(&s, s.body->x_rest)) - 1;
    double law = pressure_Pa * 0.05 * (1 - 1.0 / 3) / (2 * young_Pa * thickness_m);
    printf("  grown by %.5f, thin shell %.5f, ratio %.4f\n", grown, law, grown / law);
    CHECK_NEAR(grown / law, 1, 0.05);
    shell_scene_close(&s);
}

/* springs alone know no outside: what is squeezed flat is blown up by its gas, with and without anchors */
static void a_flattened_body_is_blown_up_by_its_gas(void)
{
    for (int anchors = 0; anchors < 2; anchors++) {
        shell_scene s;
        double min = 1;
        pal_config_entry *item = world_sphere(&s, anchors);
        pal_entry_put_text(item, "kind", "gas", NULL);
        pal_entry_put_number(item, "absolute_Pa", 2000, NULL);
        REQUIRE(shell_scene_start(&s));
        for (int i = 2; i < 3 * s.body->n_dof; i += 3) s.body->x[i] *= 0.01;
        pal_world_invalidate_limits(s.world, 0);
        double rest_m3 = world_volume(&s, s.body->x_rest), energy_J = pal_world_energy_J(s.world);
        for (int i = 0; i < 120; i++) {
            REQUIRE(!pal_world_step(s.world, 1.0 / 60));
            CHECK(pal_body_finite(s.body));
            CHECK_LE(pal_world_energy_J(s.world), 1.01 * energy_J);
            min = fmin(min, world_volume(&s, s.body->x) / rest_m3);
        }
        printf("  volume %.6f of rest, least %.3f, %.2e of the size from rest\n", world_volume(&s, s.body->x) / rest_m3,
               min, shell_scene_rms(&s) / s.body->length_scale_m);
        CHECK_NEAR(world_volume(&s, s.body->x), rest_m3, 0.01 * rest_m3);
        if (anchors) CHECK_LE(shell_scene_rms(&s), 1e-3 * s.body->length_scale_m);
        shell_scene_close(&s);
    }
}

static void check_refused(const char *key, double number, const char *text, const char *kind, const char *wanted)
{
    pal_surface sphere;
    shell_row r;
    REQUIRE(!pal_sphere_make(0.05, &sphere) && shell_row_open(&r, &sphere, 1, 0, "inflate"));
    if (kind) shell_row_text(&r, "kind", kind);
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
    check_refused("pressure_Pa", NAN, NULL, NULL, "pressure_Pa");
    check_refused("ramp_s", -1, NULL, NULL, "ramp_s");
    check_refused("absolute_Pa", -1, NULL, "gas", "absolute_Pa");
    check_refused("bulk_Pa", -20000, NULL, "fluid", "bulk_Pa");
    check_refused("bulk_Pa", NAN, NULL, "fluid", "bulk_Pa");
    check_refused("bulk_Pa", 20000, NULL, "gas", "bulk_Pa");
    check_refused("kind", 0, "steam", NULL, "\"steam\"");
    pal_body solid = {0};
    pal_diagnostic diag;
    pal_build build = {.body = &solid, .diag = &diag};
    pal_config_entry item;
    void *self;
    pal_entry_init(&item, "effects[0]", "inflate");
    CHECK_INT(pal_effect_inflate.make(&item, &build, &self), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "adaptive_springs"));
}

static void refuses_an_open_surface_with_the_number_of_its_open_edges(void)
{
    pal_surface sheet;
    shell_row r;
    REQUIRE(!pal_sheet_make(5, 4, 0.1, 0.1, &sheet, NULL));
    REQUIRE(shell_row_open(&r, &sheet, 2, 0, "inflate"));
    CHECK_INT(shell_row_make(&r), PAL_ERR_REFUSED);
    printf("  %s\n", r.diag.text);
    CHECK(strstr(r.diag.text, "14 open edges"));
    shell_row_close(&r);
}

int main(void)
{
    RUN(is_silent_at_rest_without_pressure);
    RUN(forces_are_the_gradient_of_their_energy);
    RUN(has_no_net_force_or_torque);
    RUN(gas_keeps_pressure_times_volume);
    RUN(fluid_is_as_stiff_as_its_bulk);
    RUN(a_change_of_level_changes_no_energy);
    RUN(pressure_comes_in_within_its_ramp_and_again_after_a_reset);
    RUN(stays_finite_when_flat_or_inside_out);
    RUN(gas_pressure_is_capped_smoothly);
    RUN(its_stiffness_bound_holds_and_is_near);
    RUN(a_surface_that_looks_inwards_is_blown_up_as_well);
    RUN(a_sphere_grows_as_a_thin_shell_does);
    RUN(a_flattened_body_is_blown_up_by_its_gas);
    RUN(refuses_what_makes_no_sense);
    RUN(refuses_an_open_surface_with_the_number_of_its_open_edges);
    return check_report();
}
