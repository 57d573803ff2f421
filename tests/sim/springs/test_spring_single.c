/* Springs in single precision, which verlet takes for bodies with supports, against the same in double precision. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/plan/plan.h"
#include "server/sim/springs/spring_single.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/boxes.h"
#include "tests/fixtures/random.h"

#include <float.h>
#include <math.h>

enum { NODES_MAX = 10 * 6 * 5 };
static const int n[3] = {9, 5, 4};
static const double edge_m = 0.01;

/* a box of edges, faces and volumes with its lowest nodes fixed */
typedef struct bench {
    pal_prepared box;
    pal_scene *scene;
    pal_arena *arena;
    pal_diagnostic diag;
    pal_plan plan;
    pal_body *body;
} bench;

static bool bench_open(bench *b)
{
    memset(b, 0, sizeof *b);
    if (box_make(n[0], n[1], n[2], edge_m, &b->box)) return false;
    b->scene = box_scene(&b->box, true, true);
    b->arena = pal_arena_create(1 << 20, true);
    if (!b->arena || pal_plan_build(b->scene, b->arena, &b->diag, &b->plan)) return false;
    b->body = &b->plan.body[0];
    return true;
}

static void bench_close(bench *b)
{
    pal_plan_free(&b->plan);
    pal_arena_destroy(b->arena);
    free(b->scene);
    box_free(&b->box);
}

/* out [n_node][3]: forces of edges and volumes, and of faces, N */
static void forces(bench *b, bool single, bool faces, double *out)
{
    pal_body *body = b->body;
    pal_step step = {.body = body, .single = single};
    memset(body->f, 0, 3 * sizeof(double) * (size_t)body->n_node);
    pal_node_order_begin(body->node_order, single, body->d);
    for (int i = 0; i < b->plan.n_component; i++) {
        const pal_component *component = &b->plan.component[i];
        const char *name = component->effect->name;
        if (!strcmp(name, "edge_distance") || (faces && !strcmp(name, "face_area")) || !strcmp(name, "tet_volume"))
            REQUIRE(!component->effect->run(component->self, &step));
    }
    pal_node_order_end(body->node_order, body->f);
    memcpy(out, body->f, 3 * sizeof(double) * (size_t)body->n_node);
}

/* largest difference of forces in double and in single precision, and the largest force, N */
static double compare(bench *b, double *largest_N)
{
    static double f[2][3 * NODES_MAX];
    double apart = 0;
    *largest_N = 0;
    for (int k = 0; k < 2; k++) forces(b, k == 1, true, f[k]);
    for (int i = 0; i < 3 * b->body->n_node; i++) {
        apart = fmax(apart, fabs(f[1][i] - f[0][i]));
        *largest_N = fmax(*largest_N, fabs(f[0][i]));
    }
    return apart;
}

/* Strains of 5 % and, with them, positions of five voxels rounded to FLT_EPSILON / 2 of them: an edge of one voxel has
 * a strain error of 5 FLT_EPSILON at most, a force of 100 of it; bounded by a few of them */
static void forces_are_as_exact_as_positions(void)
{
    bench b;
    REQUIRE(bench_open(&b));
    for (int shift = 0; shift < 2; shift++) {
        uint64_t seed = 5;
        double largest_N = 0;
        for (int i = 0; i < 3 * b.body->n_node; i++)
            b.body->x[i] = b.body->x_rest[i] + 0.05 * edge_m * random_signed(&seed) + 50 * shift;
        const double apart = compare(&b, &largest_N), error = apart / largest_N;
        printf("  off by %.2g of the largest force, %.2g N, %d m away\n", error, largest_N, 50 * shift);
        CHECK(largest_N > 0 && error > 0); /* not the same code */
        CHECK_LE(error, 5 * FLT_EPSILON / 0.05);
    }
    bench_close(&b);
}

/* lattices have positions of whole numbers: to the bit no force of edges and volumes. Faces within voxels have areas
 * that are no such numbers */
static void a_lattice_at_rest_has_no_force(void)
{
    bench b;
    static double f[3 * NODES_MAX];
    REQUIRE(bench_open(&b));
    forces(&b, true, false, f);
    int n_force = 0;
    for (int i = 0; i < 3 * b.body->n_node; i++) n_force += f[i] != 0;
    CHECK(n_force == 0);
    bench_close(&b);
}

/* a body that is pressed to a plane has edges without length, which push as if along their direction at rest: the
 * same in both precisions */
static void a_collapsed_body_opens(void)
{
    bench b;
    double largest_N = 0;
    REQUIRE(bench_open(&b));
    for (int i = 0; i < b.body->n_node; i++) b.body->x[3 * i + 2] = 0.02;
    CHECK_LE(compare(&b, &largest_N), 20 * FLT_EPSILON * largest_N);
    CHECK(largest_N > 0);
    bench_close(&b);
}

/* Crushed by half, inverted and stretched threefold: volumes and areas of up to 9 times, their roundings with them */
static void extreme_shapes_have_the_same_forces(void)
{
    bench b;
    const double scale[3] = {0.5, -1, 3};
    REQUIRE(bench_open(&b));
    for (int k = 0; k < 3; k++) {
        uint64_t seed = 9;
        double largest_N = 0;
        for (int i = 0; i < 3 * b.body->n_node; i++)
            b.body->x[i] = scale[k] * b.body->x_rest[i] + 0.05 * edge_m * random_signed(&seed);
        const double apart = compare(&b, &largest_N);
        printf("  %g times: off by %.2g of the largest force\n", scale[k], apart / largest_N);
        CHECK_LE(apart, 5 * 9 * FLT_EPSILON * largest_N);
    }
    bench_close(&b);
}

/* springs of no stiffness, which a scene may ask for, exert no force in either precision */
static void springs_without_stiffness_exert_no_force(void)
{
    box_bench b;
    const int size[3] = {3, 2, 2};
    static const char *const keys[3] = {"k_distance_J", "k_area_J", "k_volume_J"};
    REQUIRE(box_bench_make(&b, size, edge_m, true, true));
    pal_body_def *def = &b.scene->body[0];
    for (int k = 0; k < 3; k++) pal_entry_put_number(&def->model, keys[k], 0, NULL);
    pal_entry_init(&def->effect[def->n_effect], "effects[1]", "edge_distance");
    pal_entry_put_number(&def->effect[def->n_effect++], "k_J", 0, NULL);
    def->material.damping_1_s = 0;
    REQUIRE(box_bench_start(&b));
    for (int i = 0; i < 3; i++) REQUIRE(!pal_world_step(b.world, b.scene->step_s));
    CHECK_NEAR(b.body->v[3 * b.body->n_dof - 1], -9.81 * 3 * b.scene->step_s, 1e-9);
    box_bench_close(&b);
}

/* Elastic tetrahedra with springs beside them have no positions in single precision: the same forces to the bit, also
 * of an edge that would have no direction there */
static void springs_of_another_model_keep_double_precision(void)
{
    bench b;
    static double f[2][3 * NODES_MAX];
    memset(&b, 0, sizeof b);
    REQUIRE(!box_make(n[0], n[1], n[2], edge_m, &b.box));
    b.scene = box_scene(&b.box, true, false);
    b.arena = pal_arena_create(1 << 20, true);
    pal_body_def *def = &b.scene->body[0];
    pal_entry_init(&def->model, "model", "fem");
    pal_entry_init(&def->solver, "solver", "verlet");
    pal_entry_init(&def->effect[def->n_effect++], "effects[1]", "edge_distance");
    REQUIRE(b.arena && !pal_plan_build(b.scene, b.arena, &b.diag, &b.plan));
    b.body = &b.plan.body[0];
    b.body->x[3] = b.body->x[0] + 0.1 * PAL_SPRING_SINGLE_SHORT * edge_m;
    for (int k = 0; k < 2; k++) forces(&b, k == 1, false, f[k]);
    CHECK(f[0][0] != 0 && !memcmp(f[0], f[1], 3 * sizeof(double) * (size_t)b.body->n_node));
    bench_close(&b);
}

/* Half of a body that came apart is still held while the other half is 2,500 voxels away: roundings of positions do
 * not keep it moving */
static void a_body_that_came_apart_comes_to_rest(void)
{
    box_bench b;
    const int size[3] = {9, 5, 4};
    const double gap_m[2] = {0.04, 0.05};
    double fastest = 0;
    REQUIRE(box_bench_make(&b, size, edge_m, true, false));
    pal_tets *tets = &b.box.tets;
    const int n_whole = tets->n_tet;
    tets->n_tet = 0;
    for (int t = 0; t < n_whole; t++) {
        double middle_m = 0;
        for (int c = 0; c < 4; c++) middle_m += 0.25 * tets->x[3 * tets->tet[4 * t + c]];
        if (middle_m < gap_m[0] || middle_m > gap_m[1])
            memmove(tets->tet + 4 * tets->n_tet++, tets->tet + 4 * t, 4 * sizeof *tets->tet);
    }
    pal_body_def *def = &b.scene->body[0];
    def->support[0] = (pal_support_def){.low_m = {0.085, -1, -1}, .high_m = {1, 1, 1}};
    REQUIRE(box_bench_start(&b));
    for (int i = 0; i < b.body->n_dof; i++)
        if (b.body->x_rest[3 * i] < 0.5 * (gap_m[0] + gap_m[1]))
            b.body->x[3 * i + 2] -= 25, b.body->v[3 * i + 2] = -0.5;
    pal_world_invalidate_limits(b.world, 0);
    for (int i = 0; i < 300; i++) REQUIRE(!pal_world_step(b.world, b.scene->step_s));
    for (int i = 0; i < b.body->n_dof; i++) fastest = fmax(fastest, pal_norm3(b.body->v + 3 * i));
    printf("  fastest node: %.2g m/s\n", fastest);
    CHECK_LE(fastest, 1e-6);
    box_bench_close(&b);
}

/* Mean energy of the last fifth of n_step steps is that of the first fifth, within a part `off` of it: a held body
 * without drag that was plucked, a part of it `contrast` times as stiff */
static void keeps_energy(double poisson, double contrast, double speed_m_s, int n_step, double off)
{
    box_bench b;
    const int size[3] = {4, 3, 3};
    double mean[2] = {0};
    uint64_t seed = 3;
    REQUIRE(box_bench_make(&b, size, edge_m, true, false));
    pal_body_def *def = &b.scene->body[0];
    def->material.damping_1_s = 0, def->material.poisson = poisson;
    b.scene->max_substep = 5000;
    if (contrast > 1)
        def->region[def->n_region++] = (pal_region){.kind = PAL_REGION_BOX,
                                                    .young_Pa = contrast * def->material.young_Pa,
                                                    .poisson = poisson,
                                                    .density_kg_m3 = NAN,
                                                    .low_m = {-1, -1, -1},
                                                    .high_m = {0.02, 1, 1}};
    REQUIRE(box_bench_start(&b));
    for (int i = 0; i < 3 * b.body->n_node; i++)
        if (!b.body->support[i / 3]) b.body->v[i] = speed_m_s * random_signed(&seed);
    for (int i = 0; i < n_step; i++) {
        REQUIRE(!pal_world_step(b.world, b.scene->step_s));
        if (i < n_step / 5 || i >= n_step - n_step / 5) mean[i >= n_step / 2] += pal_world_energy_J(b.world);
    }
    printf("  nu %g, contrast %g: %d steps of %d sub-steps, energy %.6f of the first\n", poisson, contrast, n_step,
           pal_world_substeps(b.world), mean[1] / mean[0]);
    CHECK_NEAR(mean[1] / mean[0], 1, off);
    box_bench_close(&b);
}

/* Roundings neither feed nor drain a body. Energies of steps differ by the method's own periodic error, which means
 * over a fifth leave a hundredth of */
static void energy_stays_without_drag(void)
{
    keeps_energy(0.3, 1, 0.05, 1000, 0.01);
    keeps_energy(0.49, 1, 0.05, 500, 0.01);
    keeps_energy(0.45, 1e4, 0.2, 50, 0.02);
}

int main(void)
{
    RUN(forces_are_as_exact_as_positions);
    RUN(a_lattice_at_rest_has_no_force);
    RUN(a_collapsed_body_opens);
    RUN(extreme_shapes_have_the_same_forces);
    RUN(springs_without_stiffness_exert_no_force);
    RUN(springs_of_another_model_keep_double_precision);
    RUN(a_body_that_came_apart_comes_to_rest);
    RUN(energy_stays_without_drag);
    return check_report();
}
