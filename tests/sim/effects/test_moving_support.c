/* moving_support: nodes led along a path, with explicit and implicit solvers. */
#include "tests/fixtures/fem_tools.h"

enum { NX = 8, NY = 3, NZ = 3 };
static const double edge_m = 0.01;

/* a bar along x whose ends are held: the left one by the scene, the right one led */
static bool open_bar(fem_scene *f, bool implicit, const char *solver, double shift_x, double shift_z, double rise_s,
                     double period_s, double turn_deg)
{
    memset(f, 0, sizeof *f);
    if (!slab_scene(&f->s, NX, NY, NZ, edge_m, 0, 0.01, 15)) return false;
    f->own_hexes = false;
    if (implicit && !fem_ready(f, true)) return false;
    pal_body_def *def = &f->s.scene->body[0];
    if (implicit) pal_entry_init(&def->solver, "solver", solver);
    def->support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {1e-4, 1, 1}};
    pal_config_entry *item = &def->effect[def->n_effect++];
    const double low[3] = {NX * edge_m - 1e-4, -1, -1}, high[3] = {1, 1, 1}, shift[3] = {shift_x, 0, shift_z};
    const double axis[3] = {1, 0, 0};
    pal_entry_init(item, "effects[9]", "moving_support");
    bool put =
        !pal_entry_put_numbers(item, "low_m", low, 3, NULL) && !pal_entry_put_numbers(item, "high_m", high, 3, NULL);
    put = put && !pal_entry_put_numbers(item, "shift_m", shift, 3, NULL);
    put = put && !pal_entry_put_number(item, "rise_s", rise_s, NULL) &&
          !pal_entry_put_number(item, "period_s", period_s, NULL);
    put = put && !pal_entry_put_numbers(item, "turn_axis", axis, 3, NULL);
    put = put && !pal_entry_put_number(item, "turn_deg", turn_deg, NULL);
    return put && tool_scene_open(&f->s);
}

static double smooth(double t)
{
    return t >= 1 ? 1 : 0.5 * (1 - cos(M_PI * t));
}

/* largest distance of the led nodes from where they should be, at s */
static double off_path(const pal_body *body, double shift_x, double shift_z, double angle, double s)
{
    double worst = 0, y0 = 0.5 * NY * edge_m, z0 = 0.5 * NZ * edge_m, c = cos(s * angle), t = sin(s * angle);
    for (int i = 0; i < body->n_node; i++) {
        const double *X = body->x_rest + 3 * (size_t)i, *x = body->x + 3 * (size_t)i;
        if (X[0] < NX * edge_m - 1e-4) continue;
        double y = X[1] - y0, z = X[2] - z0;
        double wanted[3] = {X[0] + s * shift_x, y0 + c * y - t * z, z0 + t * y + c * z + s * shift_z};
        worst = fmax(worst, pal_dist3(x, wanted));
    }
    return worst;
}

static void follows_its_path_exactly(void)
{
    for (int way = 0; way < 3; way++) {
        fem_scene f;
        REQUIRE(open_bar(&f, way > 0, way == 2 ? "sdirk2" : "implicit_euler", 0.004, 0.01, 0.2, 0, 40));
        double worst = 0;
        for (int i = 1; i <= 30; i++) {
            REQUIRE(step_world(&f.s, 1));
            worst = fmax(worst, off_path(f.s.body, 0.004, 0.01, 40 * M_PI / 180, smooth(i / 60.0 / 0.2)));
        }
        double left = 0;
        for (int i = 0; i < f.s.body->n_node; i++)
            if (f.s.body->x_rest[3 * i] < 1e-4)
                left = fmax(left, pal_dist3(f.s.body->x + 3 * (size_t)i, f.s.body->x_rest + 3 * (size_t)i));
        printf("  %s: off by %.2g m at max\n", way == 0 ? "verlet" : way == 1 ? "implicit_euler" : "sdirk2", worst);
        CHECK_LE(worst, 1e-12);
        CHECK(left == 0);
        /* it stays there, and all comes to rest */
        REQUIRE(step_world(&f.s, 600));
        CHECK_LE(off_path(f.s.body, 0.004, 0.01, 40 * M_PI / 180, 1), 1e-12);
        CHECK_LE(pal_body_kinetic_J(f.s.body), 1e-6 * elastic_J(&f.s));
        fem_close(&f);
    }
}

static void a_stretched_bar_is_stretched_evenly(void)
{
    /* nu 0, so that the held ends do not matter: u = x / L shift */
    fem_scene f;
    memset(&f, 0, sizeof f);
    REQUIRE(open_bar(&f, true, "implicit_euler", 0.0008, 0, 0, 0, 0));
    pal_material material = f.s.scene->body[0].material;
    material.poisson = 0;
    pal_diagnostic diag = {""};
    CHECK_INT(pal_world_material(f.s.world, 0, &material, &diag), 0);
    REQUIRE(step_world(&f.s, 300));
    double worst = 0;
    for (int i = 0; i < f.s.body->n_node; i++) {
        double u = f.s.body->x_rest[3 * i] / (NX * edge_m) * 0.0008;
        worst = fmax(worst, fabs(f.s.body->x[3 * i] - f.s.body->x_rest[3 * i] - u));
    }
    double volume = NX * NY * NZ * pow(edge_m, 3), energy = 0.5 * material.young_Pa * 1e-4 * volume;
    printf("  off by %.2g of the shift, energy %.6g J, wanted %.6g\n", worst / 0.0008, elastic_J(&f.s), energy);
    CHECK_LE(worst, 1e-3 * 0.0008);
    CHECK_NEAR(elastic_J(&f.s), energy, 1e-3 * energy);
    fem_close(&f);
}

static void breathes_there_and_back(void)
{
    for (int implicit = 0; implicit < 2; implicit++) {
        fem_scene f;
        REQUIRE(open_bar(&f, implicit, "implicit_euler", 0, 0.006, 0, 1, 0));
        double worst = 0, max = 0;
        for (int i = 1; i <= 180; i++) {
            REQUIRE(step_world(&f.s, 1));
            double s = 0.5 * (1 - cos(2 * M_PI * i / 60.0)) * smooth(i);
            worst = fmax(worst, off_path(f.s.body, 0, 0.006, 0, s));
            max = fmax(max, pal_world_energy_J(f.s.world));
        }
        /* bending it at once takes 0.006 m of k = 12 E I / L^3 at most, shear makes it softer */
        double I = NY * NZ * NZ * NZ * pow(edge_m, 4) / 12, L = NX * edge_m;
        double bound = 0.5 * 12 * 5000 * I / (L * L * L) * 0.006 * 0.006;
        printf("  %s: off by %.2g m, energy up to %.3g of the beam's\n", implicit ? "implicit" : "verlet", worst,
               max / bound);
        CHECK_LE(worst, 1e-12);
        if (implicit) CHECK_LE(max, 2 * bound);
        CHECK(max > 0.1 * bound);
        /* three periods on it is where it began; a reset begins anew */
        CHECK_LE(off_path(f.s.body, 0, 0, 0, 0), 1e-9);
        REQUIRE(step_world(&f.s, 30));
        pal_world_reset(f.s.world);
        CHECK(rms_displacement(f.s.body) == 0);
        REQUIRE(step_world(&f.s, 1));
        CHECK_LE(off_path(f.s.body, 0, 0.006, 0, 0.5 * (1 - cos(2 * M_PI / 60.0))), 1e-12);
        fem_close(&f);
    }
}

/* what the support gives and takes is all the energy there is: back at its start the bar comes to rest as it was */
static void goes_at_once_and_keeps_its_head(void)
{
    for (int implicit = 0; implicit < 2; implicit++) {
        fem_scene f;
        REQUIRE(open_bar(&f, implicit, "implicit_euler", 0, 0.02, 0, 0, 0));
        REQUIRE(step_world(&f.s, 1));
        CHECK_LE(off_path(f.s.body, 0, 0.02, 0, 1), 1e-12);
        double first = pal_world_energy_J(f.s.world), max = 0;
        for (int i = 0; i < 120; i++) {
            REQUIRE(step_world(&f.s, 1));
            max = fmax(max, pal_world_energy_J(f.s.world));
        }
        printf("  %s: %.3g J after the jump, never more than %.3g of that afterwards\n",
               implicit ? "implicit" : "verlet", first, max / first);
        CHECK(!f.s.body->frozen);
        CHECK_LE(max, 1.01 * first);
        fem_close(&f);
    }
}

static void refuses_what_makes_no_sense(void)
{
    fem_scene f;
    const double low[3] = {5, 5, 5}, high[3] = {6, 6, 6}, zero[3] = {0, 0, 0};
    for (int k = 0; k < 5; k++) {
        memset(&f, 0, sizeof f);
        REQUIRE(slab_scene(&f.s, 2, 2, 2, edge_m, 0, 0.01, 15));
        pal_body_def *def = &f.s.scene->body[0];
        pal_config_entry *item = &def->effect[def->n_effect++];
        pal_entry_init(item, "effects[9]", "moving_support");
        if (k < 3) pal_entry_put_numbers(item, "low_m", low, 3, NULL);
        if (k < 2) pal_entry_put_numbers(item, "high_m", high, 3, NULL);
        if (k == 1) pal_entry_put_number(item, "lowest", 0.1, NULL);
        if (k == 3) pal_entry_put_numbers(item, "turn_axis", zero, 3, NULL);
        if (k == 4) pal_entry_put_number(item, "rise_s", -1, NULL);
        pal_diagnostic diag = {""};
        static const char *const word[] = {"none of the body's 27 nodes", "or lowest", "together", "turn_axis",
                                           "rise_s"};
        CHECK_INT(pal_world_create(f.s.scene, &diag, &f.s.world), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, word[k]) && strstr(diag.text, "effects[9]"));
        if (!strstr(diag.text, word[k])) printf("  %s\n", diag.text);
        f.s.world = NULL;
        fem_close(&f);
    }
}

int main(void)
{
    RUN(follows_its_path_exactly);
    RUN(a_stretched_bar_is_stretched_evenly);
    RUN(breathes_there_and_back);
    RUN(goes_at_once_and_keeps_its_head);
    RUN(refuses_what_makes_no_sense);
    return check_report();
}
