/* Springs of bodies with regions of other materials: constants and masses are of each tetrahedron's own material, an
 * edit of the body's material leaves what a region gives, what is given stands for all. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/springs/spring_law.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/boxes.h"
#include "tests/fixtures/random.h"

static pal_diagnostic diag;
static uint64_t seed;

static double uniform(void) /* in [-1, 1) */
{
    return random_signed(&seed);
}

/* 4 x 3 x 2 voxels of 1 cm, without supports, with area springs unless without */
typedef struct bench {
    pal_prepared box;
    pal_scene *scene;
    pal_body_def *def;
    pal_world *world;
    pal_body *body;
} bench;

static void bench_make(bench *b)
{
    seed = 5;
    memset(b, 0, sizeof *b);
    if (box_make(4, 3, 2, 0.01, &b->box)) abort();
    b->scene = box_scene(&b->box, false, false);
    b->def = &b->scene->body[0];
    b->def->material = (pal_material){.young_Pa = 4000, .poisson = 0.4, .density_kg_m3 = 1000};
}

/* the part of the box up to x_m */
static void put_region(bench *b, double x_m, double young_Pa, double poisson, double density)
{
    pal_region *r = &b->def->region[b->def->n_region++];
    *r = (pal_region){.kind = PAL_REGION_BOX,
                      .young_Pa = young_Pa,
                      .poisson = poisson,
                      .density_kg_m3 = density,
                      .low_m = {-1, -1, -1},
                      .high_m = {x_m, 1, 1}};
}

static void bench_open(bench *b)
{
    if (pal_world_create(b->scene, &diag, &b->world)) printf("  %s\n", diag.text), abort();
    b->body = pal_world_body(b->world, 0);
}

static void bench_close(bench *b)
{
    pal_world_destroy(b->world);
    free(b->scene);
    box_free(&b->box);
}

/* the same places and speeds for all bodies */
static void shake(const bench *b)
{
    seed = 9;
    for (int i = 0; i < 3 * b->body->n_dof; i++) {
        b->body->x[i] = b->body->x_rest[i] + 0.1 * b->body->edge_m * uniform();
        b->body->v[i] = uniform();
    }
    pal_world_invalidate_limits(b->world, 0);
}

static void forces(const bench *b, double *f)
{
    pal_step step = {.body = b->body};
    memset(b->body->f, 0, 3 * sizeof(double) * (size_t)b->body->n_node);
    for (int r = 0; r < pal_world_component_count(b->world); r++) {
        const pal_component *row = pal_world_component(b->world, r);
        if (row->effect->internal) CHECK_INT(row->effect->run(row->self, &step), 0);
    }
    memcpy(f, b->body->f, 3 * sizeof(double) * (size_t)b->body->n_node);
}

static double energy(const bench *b, const char *name)
{
    for (int r = 0; r < pal_world_component_count(b->world); r++) {
        const pal_component *row = pal_world_component(b->world, r);
        if (!strcmp(row->effect->name, name)) return row->effect->energy(row->self, b->body);
    }
    return NAN;
}

static void check_same(const bench *a, const bench *b)
{
    double f[2][3 * 128], max = 0;
    REQUIRE(a->body->n_node == b->body->n_node && a->body->n_node <= 128);
    shake(a), shake(b);
    forces(a, f[0]), forces(b, f[1]);
    for (int i = 0; i < 3 * a->body->n_node; i++) max = fmax(max, fabs(f[0][i]));
    CHECK(max > 1e-3);
    for (int i = 0; i < 3 * a->body->n_node; i++) CHECK_NEAR(f[0][i], f[1][i], 1e-11 * max);
    for (int i = 0; i < a->body->n_dof; i++)
        CHECK_NEAR(a->body->mass_kg[i], b->body->mass_kg[i], 1e-12 * b->body->mass_kg[i]);
    CHECK_NEAR(pal_world_limit_s(a->world) / pal_world_limit_s(b->world), 1, 1e-9);
}

static const char *const weights[] = {NULL, "volume", "equal"};

static void a_region_all_over_is_the_body_of_its_material(void)
{
    for (int k = 0; k < 6; k++) {
        bench a, b;
        bench_make(&a), bench_make(&b);
        if (weights[k % 3]) {
            pal_entry_put_text(&a.def->model, "weights", weights[k % 3], NULL);
            pal_entry_put_text(&b.def->model, "weights", weights[k % 3], NULL);
        }
        if (k > 2) pal_entry_put_number(&a.def->model, "k_area_J", 0, NULL);
        if (k > 2) pal_entry_put_number(&b.def->model, "k_area_J", 0, NULL);
        put_region(&a, 1, 36000, 0.47, 1500);
        b.def->material.young_Pa = 36000, b.def->material.poisson = 0.47, b.def->material.density_kg_m3 = 1500;
        bench_open(&a), bench_open(&b);
        check_same(&a, &b);
        /* the body's own material is nowhere: an edit of it changes nothing but masses, which go with its density */
        pal_material edit = a.def->material;
        edit.young_Pa *= 7, edit.poisson = 0.3;
        REQUIRE(!pal_world_material(a.world, 0, &edit, &diag));
        check_same(&a, &b);
        bench_close(&a), bench_close(&b);
    }
}

/* what a region does not give is the body's, also after an edit */
static void what_a_region_does_not_give_is_of_the_body(void)
{
    for (int k = 0; k < 2; k++) {
        bench a, b;
        bench_make(&a), bench_make(&b);
        put_region(&a, 1, k ? (double)NAN : 500, k ? 0.3 : (double)NAN, NAN);
        if (k)
            b.def->material.poisson = 0.3;
        else
            b.def->material.young_Pa = 500;
        bench_open(&a), bench_open(&b);
        check_same(&a, &b);
        pal_material edit = a.def->material, same = edit;
        edit.young_Pa = 9000, edit.poisson = 0.48;
        same.young_Pa = k ? 9000 : 500, same.poisson = k ? 0.3 : 0.48;
        REQUIRE(!pal_world_material(a.world, 0, &edit, &diag));
        REQUIRE(!pal_world_material(b.world, 0, &same, &diag));
        check_same(&a, &b);
        bench_close(&a), bench_close(&b);
    }
}

/* soft beside stiff and stiff beside soft have together what all soft and all stiff have, in every row, however the
 * body is deformed; a soft part beside a stiff one bears a tenth of it */
static void energies_of_parts_add_up(void)
{
    static const char *const row[] = {"edge_distance", "face_area", "tet_volume"};
    static const double young_Pa[2] = {1000, 10000}, poisson[2] = {0.3, 0.45};
    double sum[2][3] = {{0}};
    for (int left = 0; left < 2; left++)
        for (int right = 0; right < 2; right++) {
            bench b;
            bench_make(&b);
            b.def->material.young_Pa = young_Pa[right], b.def->material.poisson = poisson[right];
            put_region(&b, 0.02, young_Pa[left], poisson[left], NAN);
            bench_open(&b);
            shake(&b);
            for (int k = 0; k < 3; k++) sum[left == right][k] += energy(&b, row[k]);
            bench_close(&b);
        }
    for (int k = 0; k < 3; k++) CHECK_NEAR(sum[0][k], sum[1][k], 1e-12 * sum[1][k]);
    CHECK(sum[0][0] > 0 && sum[0][1] > 0 && sum[0][2] > 0);
}

/* a bar of a stiff and a soft half stretches in series: seen in where its middle comes to rest */
static void a_bar_of_two_parts_stretches_in_series(void)
{
    const double ratio = 4;
    bench b;
    bench_make(&b);
    b.def->material.poisson = 0.26, b.def->material.damping_1_s = 30;
    put_region(&b, 0.02, ratio * b.def->material.young_Pa, NAN, NAN);
    b.def->n_support = 2;
    b.def->support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {1e-6, 1, 1}};
    b.def->support[1] = (pal_support_def){.low_m = {0.04 - 1e-6, -1, -1}, .high_m = {1, 1, 1}};
    bench_open(&b);
    const double pull = 0.0008;
    for (int i = 0; i < b.body->n_dof; i++)
        if (b.body->x_rest[3 * i] > 0.039) b.body->x[3 * i] += pull;
    pal_world_invalidate_limits(b.world, 0);
    for (int i = 0; i < 400; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 120));
    double moved = 0;
    int n = 0;
    for (int i = 0; i < b.body->n_dof; i++) {
        if (fabs(b.body->x_rest[3 * i] - 0.02) > 1e-9) continue;
        moved += b.body->x[3 * i] - b.body->x_rest[3 * i];
        n++;
    }
    /* stretches as 1 to 4; the ends do not contract, which stiffens both halves alike */
    CHECK_INT(n, 12);
    CHECK_NEAR(moved / n / pull, 1 / (1 + ratio), 0.02);
    CHECK(pal_body_kinetic_J(b.body) < 1e-12);
    bench_close(&b);
}

static void masses_are_of_each_part(void)
{
    bench b;
    bench_make(&b);
    put_region(&b, 0.02, NAN, NAN, 3000);
    bench_open(&b);
    double sum = 0, moment = 0;
    for (int i = 0; i < b.body->n_dof; i++)
        sum += b.body->mass_kg[i], moment += b.body->mass_kg[i] * b.body->x_rest[3 * i];
    CHECK_NEAR(sum, 12e-6 * 4000, 1e-12);
    CHECK_NEAR(moment, 12e-6 * (3000 * 0.01 + 1000 * 0.03), 1e-14);
    bench_close(&b);
}

static void what_is_given_stands_for_all(void)
{
    bench a, b;
    bench_make(&a), bench_make(&b);
    const char *const key[] = {"k_distance_J", "k_area_J", "k_volume_J"};
    for (int k = 0; k < 3; k++) {
        pal_entry_put_number(&a.def->model, key[k], 1e-3 * (k + 1), NULL);
        pal_entry_put_number(&b.def->model, key[k], 1e-3 * (k + 1), NULL);
    }
    put_region(&a, 0.02, 1e6, 0.3, NAN);
    bench_open(&a), bench_open(&b);
    check_same(&a, &b);
    bench_close(&a), bench_close(&b);
}

/* a part a thousand times as stiff has sub-steps short enough for it and keeps the momentum */
static void a_stiff_part_is_stable(void)
{
    bench b;
    bench_make(&b);
    put_region(&b, 0.02, 4e6, 0.45, NAN);
    bench_open(&b);
    shake(&b);
    for (int i = 0; i < 3 * b.body->n_dof; i++) b.body->v[i] = 0.01 * b.body->v[i];
    double p[2][3] = {{0}}, before = pal_world_energy_J(b.world);
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < b.body->n_dof; i++) pal_axpy3(p[k], b.body->mass_kg[i], b.body->v + 3 * i);
        for (int i = 0; i < 60 && k == 0; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 240));
    }
    CHECK(!b.body->frozen && pal_world_energy_J(b.world) < 1.01 * before);
    for (int c = 0; c < 3; c++) CHECK_NEAR(p[0][c], p[1][c], 1e-12);
    bench_close(&b);
}

static void nodes_show_the_constant_of_their_part(void)
{
    bench b;
    bench_make(&b);
    put_region(&b, 0.02, 5 * b.def->material.young_Pa, NAN, NAN);
    bench_open(&b);
    double factor[3], sum[128] = {0}, n[128] = {0};
    pal_spring_factors(b.def->material.poisson, false, factor);
    const double own = factor[0] * b.def->material.young_Pa * 1e-6;
    for (int r = 0; r < pal_world_component_count(b.world); r++) {
        const pal_component *row = pal_world_component(b.world, r);
        if (row->effect->inspect.measure && !strcmp(row->effect->name, "edge_distance"))
            row->effect->inspect.measure(row->self, b.body, PAL_FIELD_STIFFNESS_J, sum, n);
    }
    for (int i = 0; i < b.body->n_dof; i++) {
        double x = b.body->x_rest[3 * i], k_J = sum[i] / n[i];
        if (x < 0.011) CHECK_NEAR(k_J, 5 * own, 1e-12 * own);
        if (x > 0.029) CHECK_NEAR(k_J, own, 1e-12 * own);
        if (fabs(x - 0.02) < 1e-6) CHECK(k_J > 1.5 * own && k_J < 4.5 * own);
    }
    bench_close(&b);
}

int main(void)
{
    RUN(a_region_all_over_is_the_body_of_its_material);
    RUN(what_a_region_does_not_give_is_of_the_body);
    RUN(energies_of_parts_add_up);
    RUN(a_bar_of_two_parts_stretches_in_series);
    RUN(masses_are_of_each_part);
    RUN(what_is_given_stands_for_all);
    RUN(a_stiff_part_is_stable);
    RUN(nodes_show_the_constant_of_their_part);
    return check_report();
}
