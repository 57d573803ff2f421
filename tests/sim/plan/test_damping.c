/* The damping that a body has: given, or derived from its lowest frequency; after edits of its material too. */
#include "tests/fixtures/model_scenes.h"

static pal_diagnostic diag;

static void open_with(model_scene *m, int kind, double young_Pa, double damping_1_s, double ratio)
{
    model_scene_make(m, (model_kind)kind);
    m->def->material.young_Pa = young_Pa;
    m->def->material.damping_1_s = damping_1_s, m->def->material.damping_ratio = ratio;
    if (!model_scene_open(m)) abort();
}

/* the default of a body, of every model */
static void it_is_critical_for_the_slowest_mode(void)
{
    for (int k = 0; k < MODEL_KINDS; k++)
        for (int i = 0; i < 4; i++) {
            static const double ratio[] = {1, 0.5, 2, 0};
            model_scene m;
            open_with(&m, k, k == SHELL ? 0.5 : 5, PAL_DAMPING_DERIVED, ratio[i]);
            printf("  %s: w1 %.4g 1/s, ratio %g, drag %.4g 1/s\n", model_kind_name[k], m.body->lowest_1_s, ratio[i],
                   m.body->damping_1_s);
            CHECK(m.body->lowest_1_s > 0.1 && m.body->lowest_1_s < 1.9);
            CHECK_NEAR(m.body->damping_1_s, fmin(4, 2 * ratio[i] * m.body->lowest_1_s), 1e-12);
            model_scene_close(&m);
        }
    pal_body_def def;
    pal_body_default(&def, "thing", NULL);
    CHECK_NEAR(def.material.damping_1_s, PAL_DAMPING_DERIVED, 0);
    CHECK_NEAR(def.material.damping_ratio, 1, 0);
}

/* the cap: bodies with w1 above 2 1/s have 4 1/s, to the bit what a scene that gives 4 has */
static void it_is_never_above_four(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        model_scene derived, given;
        open_with(&derived, k, 1e4, PAL_DAMPING_DERIVED, 1);
        open_with(&given, k, 1e4, 4, 0);
        CHECK(derived.body->lowest_1_s > 2);
        CHECK_NEAR(derived.body->damping_1_s, PAL_DAMPING_1_S, 0);
        CHECK_NEAR(given.body->damping_1_s, PAL_DAMPING_1_S, 0);
        CHECK(model_scene_touch(&derived, 0, 20) && model_scene_touch(&given, 0, 20));
        CHECK(pal_world_hash(derived.world) == pal_world_hash(given.world));
        model_scene_close(&derived), model_scene_close(&given);
    }
}

static void a_given_damping_wins(void)
{
    for (int k = 0; k < MODEL_KINDS; k++)
        for (int i = 0; i < 3; i++) {
            static const double rate[] = {0, 0.7, 30};
            model_scene m;
            open_with(&m, k, 5, rate[i], 1);
            CHECK_NEAR(m.body->damping_1_s, rate[i], 0);
            CHECK(model_scene_row(&m, "viscous") >= 0 ? rate[i] > 0 : rate[i] == 0);
            model_scene_close(&m);
        }
}

/* without supports there is no slowest mode to be critical for */
static void a_free_body_has_four(void)
{
    model_scene m;
    model_scene_make(&m, FEM);
    m.def->n_support = 0;
    m.def->material.young_Pa = 5;
    m.def->material.damping_1_s = PAL_DAMPING_DERIVED, m.def->material.damping_ratio = 1;
    REQUIRE(model_scene_open(&m));
    CHECK_NEAR(m.body->lowest_1_s, 0, 0);
    CHECK_NEAR(m.body->damping_1_s, PAL_DAMPING_1_S, 0);
    model_scene_close(&m);
}

/* in momentum: what is derived is what acts */
static void the_derived_rate_is_the_one_that_acts(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        model_scene derived, given;
        open_with(&derived, k, 5, PAL_DAMPING_DERIVED, 1);
        open_with(&given, k, 5, derived.body->damping_1_s, 0);
        for (int i = 0; i < 2; i++) {
            model_scene *m = i ? &given : &derived;
            for (int p = 0; p < m->body->n_dof; p++)
                if (!m->body->support[p] && m->body->mass_kg[p] > 0) m->body->v[3 * p] = 0.01;
            CHECK(model_scene_steps(m, 60));
        }
        /* the implicit solver's first factor is made with the same rate, so there is no difference at all */
        CHECK(pal_world_hash(derived.world) == pal_world_hash(given.world));
        model_scene_close(&derived), model_scene_close(&given);
    }
}

static void an_edit_of_the_material_derives_it_again(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        model_scene m, fresh;
        pal_material to;
        open_with(&m, k, k == SHELL ? 0.5 : 5, PAL_DAMPING_DERIVED, 1);
        const double w_1_s = m.body->lowest_1_s;
        pal_world_current_material(m.world, 0, &to);
        to.young_Pa *= 0.25;
        REQUIRE(!pal_world_material(m.world, 0, &to, &diag));
        CHECK_NEAR(m.body->lowest_1_s / w_1_s, 0.5, 1e-9);
        CHECK_NEAR(m.body->damping_1_s, fmin(4, w_1_s), 1e-9);
        open_with(&fresh, k, to.young_Pa, PAL_DAMPING_DERIVED, 1);
        CHECK_NEAR(fresh.body->lowest_1_s / m.body->lowest_1_s, 1, 0.02);
        model_scene_close(&fresh);
        /* there and back is where it was, to the bit */
        pal_material back = to;
        back.young_Pa *= 4, back.density_kg_m3 *= 3;
        REQUIRE(!pal_world_material(m.world, 0, &back, &diag));
        back.density_kg_m3 = to.density_kg_m3;
        REQUIRE(!pal_world_material(m.world, 0, &back, &diag));
        CHECK_NEAR(m.body->lowest_1_s, w_1_s, 0);
        /* given while it runs, it stays */
        to.damping_1_s = 0.3, to.young_Pa *= 16;
        REQUIRE(!pal_world_material(m.world, 0, &to, &diag));
        CHECK_NEAR(m.body->damping_1_s, 0.3, 0);
        /* a refused material changes nothing */
        to.young_Pa = -1;
        CHECK(pal_world_material(m.world, 0, &to, &diag) != 0);
        CHECK_NEAR(m.body->damping_1_s, 0.3, 0);
        CHECK_NEAR(m.body->lowest_1_s / w_1_s, 2, 1e-9);
        model_scene_close(&m);
    }
}

/* a component switched off takes its drag and its stiffness along */
static void a_switched_component_counts(void)
{
    model_scene m;
    open_with(&m, SPRINGS, 5, PAL_DAMPING_DERIVED, 1);
    const double rate_1_s = m.body->damping_1_s, w_1_s = m.body->lowest_1_s;
    REQUIRE(!pal_world_switch_component(m.world, m.scene, 0, "viscous", false, &diag));
    CHECK_NEAR(m.body->damping_1_s, 0, 0);
    CHECK_NEAR(m.body->lowest_1_s, w_1_s, 0);
    REQUIRE(!pal_world_switch_component(m.world, m.scene, 0, "viscous", true, &diag));
    CHECK_NEAR(m.body->damping_1_s, rate_1_s, 0);
    REQUIRE(!pal_world_switch_component(m.world, m.scene, 0, "tet_volume", false, &diag));
    printf("  without volumes %.5g of %.5g 1/s\n", m.body->lowest_1_s, w_1_s);
    CHECK(m.body->lowest_1_s < 0.99 * w_1_s);
    REQUIRE(!pal_world_switch_component(m.world, m.scene, 0, "tet_volume", true, &diag));
    CHECK_NEAR(m.body->lowest_1_s / w_1_s, 1, 1e-6);
    model_scene_close(&m);
}

/* Damping in proportion to stiffness: amplitudes of a mode w fall with the rate c / 2 + beta w^2 / 2. implicit_euler
 * has beta = dt by itself, for w dt far below 1, to which stiffness_damping_s adds; sdirk2 and explicit solvers have
 * none */
static void stiff_modes_are_damped_by_the_square_of_their_frequency(void)
{
    static const struct {
        model_kind kind;
        const char *solver; /* NULL: the model's own */
        double step_s, key_s, w_1_s, beta_s;
    } row[] = {{FEM, NULL, 1.0 / 60, 0, 6, 1.0 / 60},
               {FEM, NULL, 1.0 / 240, 0, 6, 1.0 / 240},
               {FEM, "implicit_euler", 1.0 / 240, 0.01, 6, 1.0 / 240 + 0.01},
               {SPRINGS, NULL, 1.0 / 60, 0, 6, 0},
               {FEM, "sdirk2", 1.0 / 240, 0, 6, 0},
               {FEM, "sdirk2", 1.0 / 240, 0.02, 6, 0.02},
               {FEM, "sdirk2", 1.0 / 240, 0.02, 12, 0.02},
               {SOLID, "sdirk2", 1.0 / 240, 0.02, 6, 0.02}};
    for (size_t k = 0; k < sizeof row / sizeof row[0]; k++) {
        model_scene m;
        model_scene_make(&m, row[k].kind);
        m.scene->step_s = row[k].step_s;
        m.def->material.damping_1_s = 0;
        if (row[k].solver) pal_entry_init(&m.def->solver, "solver", row[k].solver);
        if (row[k].key_s > 0) pal_entry_put_number(&m.def->solver, "stiffness_damping_s", row[k].key_s, NULL);
        REQUIRE(model_scene_open(&m));
        REQUIRE(!pal_world_find_lowest(m.world, 0, NULL));
        m.def->material.young_Pa *= pow(row[k].w_1_s / m.body->lowest_1_s, 2);
        pal_world_destroy(m.world);
        REQUIRE(model_scene_open(&m));
        double *mode = calloc(3 * (size_t)m.body->n_dof, sizeof *mode), largest = 0;
        REQUIRE(mode && !pal_world_find_lowest(m.world, 0, mode));
        const double w = m.body->lowest_1_s;
        CHECK_NEAR(w, row[k].w_1_s, 0.02 * row[k].w_1_s);
        for (int i = 0; i < 3 * m.body->n_dof; i++) largest = fmax(largest, fabs(mode[i]));
        for (int i = 0; i < 3 * m.body->n_dof; i++) m.body->x[i] += 1e-3 * m.body->length_scale_m / largest * mode[i];
        pal_world_invalidate_limits(m.world, 0);
        const double before_J = pal_world_energy_J(m.world), seconds = 4 * M_PI / w; /* two periods */
        CHECK(model_scene_steps(&m, (int)lround(seconds / m.scene->step_s)));
        /* energy falls with twice the rate of the amplitude */
        const double rate_1_s = 0.5 * log(before_J / pal_world_energy_J(m.world)) / seconds;
        const double wanted_1_s = 0.5 * row[k].beta_s * w * w;
        printf("  %s, %s, step %.3g ms, w %.3g: %.4g 1/s of %.4g\n", model_kind_name[m.kind],
               row[k].solver ? row[k].solver : "own solver", 1e3 * m.scene->step_s, w, rate_1_s, wanted_1_s);
        CHECK_NEAR(rate_1_s, wanted_1_s, 0.02 * wanted_1_s + 0.001);
        free(mode);
        model_scene_close(&m);
    }
}

int main(void)
{
    RUN(it_is_critical_for_the_slowest_mode);
    RUN(it_is_never_above_four);
    RUN(a_given_damping_wins);
    RUN(a_free_body_has_four);
    RUN(the_derived_rate_is_the_one_that_acts);
    RUN(an_edit_of_the_material_derives_it_again);
    RUN(a_switched_component_counts);
    RUN(stiff_modes_are_damped_by_the_square_of_their_frequency);
    return check_report();
}
