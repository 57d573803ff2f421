/* Forces that elastic components keep from where a step looked at its energy to the next one that begins there: they
 * are those that a fresh pass gives, a move, an edit or a reset makes them anew, looking at the energy changes no bit.
 */
#include "server/sim/elements/elastic_hex.h"
#include "tests/fixtures/fem_beam.h"
#include "tests/fixtures/subdivision_scene.h"

static pal_diagnostic diag;

static pal_component *elastic(pal_world *world)
{
    for (int i = 0; i < pal_world_component_count(world); i++) {
        const pal_component *row = pal_world_component(world, i);
        if (strstr(row->effect->name, "_elastic")) return (pal_component *)row;
    }
    abort();
}

/* of the row alone at the body's x */
static void force(pal_component *row, pal_body *body, double *f)
{
    pal_step step = {.body = body};
    memset(body->f, 0, 3 * sizeof(double) * (size_t)body->n_node);
    if (row->effect->run(row->self, &step)) abort();
    memcpy(f, body->f, 3 * sizeof(double) * (size_t)body->n_node);
}

static double apart(int n, const double *a, const double *b, double times)
{
    double max = 0, size = 0;
    for (int i = 0; i < n; i++) max = fmax(max, fabs(a[i] - times * b[i])), size = fmax(size, fabs(a[i]));
    return size > 0 ? max / size : INFINITY;
}

/* what is kept against what is found without it, where the body is, after a move and after an edit */
static void compare(pal_world *world, pal_material stiffer)
{
    pal_body *body = pal_world_body(world, 0);
    pal_component *row = elastic(world);
    const int n = 3 * body->n_node;
    double *kept = malloc(sizeof(double) * (size_t)n), *fresh = malloc(sizeof(double) * (size_t)n);
    if (!kept || !fresh) abort();
    double with = row->effect->energy(row->self, body);
    CHECK(row->effect->energy(row->self, body) == with);
    force(row, body, kept);
    row->effect->reset(row->self, body);
    force(row, body, fresh);
    CHECK(apart(n, kept, fresh, 1) < 1e-9);
    CHECK(with > 0);
    CHECK_NEAR(row->effect->energy(row->self, body) / with, 1, 1e-10);
    /* a move of one point */
    int i = 3 * (body->n_dof - 1);
    body->x[i] += 1e-3 * body->length_scale_m;
    pal_body_update_nodes(body);
    double there = row->effect->energy(row->self, body);
    CHECK(fabs(there / with - 1) > 1e-6);
    force(row, body, kept);
    CHECK(apart(n, kept, fresh, 1) > 1e-6);
    row->effect->reset(row->self, body);
    force(row, body, fresh);
    CHECK(apart(n, kept, fresh, 1) < 1e-9);
    /* stiffer: the material's two moduli are proportional to E */
    CHECK(!pal_world_material(world, 0, &stiffer, &diag));
    CHECK_NEAR(row->effect->energy(row->self, body) / there, 2, 1e-6);
    CHECK(!pal_world_material(world, 0, &stiffer, &diag));
    force(row, body, kept);
    CHECK(apart(n, kept, fresh, 2) < 1e-6);
    free(kept);
    free(fresh);
}

static void swing(fem_beam *b, const char *element, const char *law, double kick_m_s)
{
    beam_make(b, 6, 2, 2, 0.01, true);
    beam_element(b, element, law);
    if (beam_open(b, &diag)) abort();
    for (int i = 0; i < b->body->n_dof; i++)
        if (!b->body->support[i]) b->body->v[3 * i + 2] = kick_m_s * b->body->x[3 * i] / b->length_m;
}

static void cached_forces_equal_those_of_a_new_pass(void)
{
    static const char *const kind[][2] = {
        {"hex8_bbar", "corotational"}, {"hex8", "linear"}, {"hex8_bbar", "neo_hookean"}, {"tet4", "corotational"},
        {"tet4", "neo_hookean"},       {"tet4", "linear"}, {"tet10", "corotational"},    {"tet10", "neo_hookean"}};
    for (size_t k = 0; k < sizeof kind / sizeof kind[0]; k++) {
        fem_beam b;
        swing(&b, kind[k][0], kind[k][1], 0.3);
        for (int i = 0; i < 5; i++) CHECK(!pal_world_step(b.world, b.scene->step_s));
        pal_material stiffer = b.def->material;
        stiffer.young_Pa *= 2;
        printf("  %s %s\n", kind[k][0], kind[k][1]);
        compare(b.world, stiffer);
        beam_free(&b);
    }
}

static void a_subdivision_solid_has_the_cache_too(void)
{
    solid_scene s;
    const int32_t n[3] = {3, 2, 2};
    const double size[3] = {0.06, 0.04, 0.04};
    solid_scene_take(&s, solid_scene_box(n, size, true), 1, "implicit_euler", "polar");
    REQUIRE(!pal_world_create(s.scene, &diag, &s.world));
    pal_body *body = pal_world_body(s.world, 0);
    for (int i = 0; i < body->n_dof; i++) body->v[3 * i] = 5 * (body->x[3 * i + 1] - 0.02);
    for (int i = 0; i < 5; i++) CHECK(!pal_world_step(s.world, s.scene->step_s));
    pal_material stiffer = s.def->material;
    stiffer.young_Pa *= 2;
    compare(s.world, stiffer);
    pal_world_destroy(s.world);
    free(s.scene);
    pal_prepared_free(&s.mesh);
    pal_cells_free(&s.cells);
}

/* one pass over the elements a step is saved; the energies are the same as without the watch, and so are places */
static void a_step_without_energy_rise_saves_one_pass(void)
{
    enum { STEPS = 40 };
    fem_beam b, plain;
    swing(&b, "hex8_bbar", "corotational", 0.05);
    beam_make(&plain, 6, 2, 2, 0.01, true);
    pal_entry_put_bool(&plain.def->solver, "watch", false, &diag);
    REQUIRE(!beam_open(&plain, &diag));
    memcpy(plain.body->v, b.body->v, 3 * sizeof(double) * (size_t)b.body->n_dof);
    const pal_elastic_hexes *with = elastic(b.world)->self, *without = elastic(plain.world)->self;
    double max = 0;
    for (int i = 0; i < STEPS; i++) {
        CHECK(!pal_world_step(b.world, b.scene->step_s) && !pal_world_step(plain.world, b.scene->step_s));
        for (int c = 0; c < 3 * b.body->n_dof; c++) max = fmax(max, fabs(b.body->x[c] - plain.body->x[c]));
    }
    printf("  %llu passes saved in %d steps, %g m apart\n", (unsigned long long)with->force_cache.n_add, STEPS, max);
    CHECK(with->force_cache.n_add == STEPS && without->force_cache.n_add == 0);
    CHECK(b.body->safeguards.n_search == 0 && max < 1e-9);
    beam_free(&b);
    beam_free(&plain);
}

static void evaluating_the_energy_changes_no_bit(void)
{
    fem_beam a, b;
    swing(&a, "hex8_bbar", "corotational", 1);
    swing(&b, "hex8_bbar", "corotational", 1);
    for (int i = 0; i < 30; i++) {
        CHECK(!pal_world_step(a.world, a.scene->step_s) && !pal_world_step(b.world, b.scene->step_s));
        CHECK(pal_world_energy_J(b.world) > 0 && pal_world_energy_J(b.world) > 0);
    }
    CHECK(pal_world_hash(a.world) == pal_world_hash(b.world));
    beam_free(&a);
    beam_free(&b);
}

int main(void)
{
    RUN(cached_forces_equal_those_of_a_new_pass);
    RUN(a_subdivision_solid_has_the_cache_too);
    RUN(a_step_without_energy_rise_saves_one_pass);
    RUN(evaluating_the_energy_changes_no_bit);
    return check_report();
}
