/* Springs whose constants vary over the body (paper B section 3.5): what a grid means, that it keeps what springs
 * promise, what is refused. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/plan/plan.h"
#include "server/sim/springs/spring_law.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/boxes.h"
#include "tests/fixtures/largest_frequency.h"
#include "tests/fixtures/random.h"

enum { NODES = 5 * 4 * 3 };
static pal_diagnostic diag;
static uint64_t seed;

static double uniform(void) /* in [-1, 1) */
{
    return random_signed(&seed);
}

/* a free block of 4 x 3 x 2 voxels of 1 cm whose springs stand on a grid of 5 x 4 x 3 nodes */
typedef struct bench {
    pal_prepared box;
    pal_scene *scene;
    pal_body_def *def;
    double k_J[3][NODES];
    pal_arena *arena;
    pal_plan plan;
    pal_body *body;
} bench;

static bool bench_make(bench *b)
{
    seed = 11;
    memset(b, 0, sizeof *b);
    if (box_make(4, 3, 2, 0.01, &b->box)) return false;
    b->scene = box_scene(&b->box, false, false);
    b->def = &b->scene->body[0];
    b->def->material.damping_1_s = 0;
    return true;
}

static void put_grid(bench *b)
{
    pal_spring_grid *g = &b->def->spring_grid;
    *g = (pal_spring_grid){{5, 4, 3}, {0, 0, 0}, {0.04, 0.03, 0.02}, {b->k_J[0], b->k_J[1], b->k_J[2]}};
}

static bool bench_plan(bench *b)
{
    b->arena = pal_arena_create(1 << 20, true);
    if (pal_plan_build(b->scene, b->arena, &diag, &b->plan)) {
        printf("  %s\n", diag.text);
        return false;
    }
    b->body = &b->plan.body[0];
    return true;
}

/* every node its own constant, two orders of magnitude apart */
static bool bench_varied(bench *b, const char *weights)
{
    if (!bench_make(b)) return false;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < NODES; i++) b->k_J[k][i] = 1e-3 * pow(10, uniform());
    put_grid(b);
    if (weights) pal_entry_put_text(&b->def->model, "weights", weights, NULL);
    return bench_plan(b);
}

static void bench_close(bench *b)
{
    pal_plan_free(&b->plan);
    pal_arena_destroy(b->arena);
    free(b->scene);
    box_free(&b->box);
}

static const pal_component *row_named(const bench *b, const char *name)
{
    for (int r = 0; r < b->plan.n_component; r++)
        if (!strcmp(b->plan.component[r].effect->name, name)) return &b->plan.component[r];
    return NULL;
}

static void run_row(const bench *b, const pal_component *row)
{
    pal_step step = {.body = b->body};
    memset(b->body->f, 0, 3 * sizeof(double) * (size_t)b->body->n_node);
    CHECK_INT(row->effect->run(row->self, &step), 0);
}

static void shake(bench *b, double amount)
{
    for (int i = 0; i < 3 * b->body->n_dof; i++) {
        b->body->x[i] = b->body->x_rest[i] + amount * b->body->edge_m * uniform();
        b->body->v[i] = uniform();
    }
}

#define EACH_SPRING_ROW(b, row)                                                                                        \
    for (const pal_component *row = (b).plan.component; row < (b).plan.component + (b).plan.n_component; row++)        \
        if (row->effect->energy && row->effect->internal)

static const char *const k_key[3] = {"k_distance_J", "k_area_J", "k_volume_J"}, *const c_key[3] = {"c_distance_Js",
                                                                                                   "c_area_Js",
                                                                                                   "c_volume_Js"};

/* damping too: c_Js is that of a spring with the mean constant */
static void a_grid_of_equal_values_is_the_homogeneous_body(void)
{
    static const double k_J[3] = {2.1e-3, 0.7e-3, 1.3e-3}, c_Js[3] = {1e-6, 2e-6, 3e-6};
    for (int by_volume = 0; by_volume < 2; by_volume++) {
        bench a, b;
        REQUIRE(bench_make(&a) && bench_make(&b));
        for (int k = 0; k < 3; k++) {
            pal_entry_put_number(&a.def->model, k_key[k], k_J[k], NULL);
            pal_entry_put_number(&a.def->model, c_key[k], c_Js[k], NULL);
            pal_entry_put_number(&b.def->model, c_key[k], c_Js[k], NULL);
            for (int i = 0; i < NODES; i++) b.k_J[k][i] = k_J[k];
        }
        put_grid(&b);
        for (int i = 0; i < 2 && by_volume; i++)
            pal_entry_put_text(&(i ? &b : &a)->def->model, "weights", "volume", NULL);
        REQUIRE(bench_plan(&a) && bench_plan(&b));
        CHECK_INT(a.plan.n_component, b.plan.n_component);
        shake(&a, 0.3);
        memcpy(b.body->x, a.body->x, 3 * sizeof(double) * (size_t)a.body->n_dof);
        memcpy(b.body->v, a.body->v, 3 * sizeof(double) * (size_t)a.body->n_dof);
        for (int r = 0; r < a.plan.n_component; r++) {
            const pal_component *row = &a.plan.component[r], *other = &b.plan.component[r];
            if (!row->effect->internal || row->effect->stage != PAL_STAGE_FORCE) continue;
            double max = 0, apart = 0, bound[2][128] = {{0}};
            run_row(&a, row), run_row(&b, other);
            for (int i = 0; i < 3 * a.body->n_dof; i++) {
                max = fmax(max, fabs(a.body->f[i]));
                apart = fmax(apart, fabs(a.body->f[i] - b.body->f[i]));
            }
            CHECK(max > 1e-6);
            CHECK_LE(apart, 1e-12 * max);
            REQUIRE(a.body->n_dof <= 128);
            row->effect->bounds.damping(row->self, a.body, bound[0]);
            other->effect->bounds.damping(other->self, b.body, bound[1]);
            for (int i = 0; i < a.body->n_dof; i++) CHECK_NEAR(bound[1][i], bound[0][i], 1e-12 * bound[0][i]);
        }
        bench_close(&a), bench_close(&b);
    }
}

static double slope_at(const double x[3], int kind)
{
    return 1e-3 * (2 + kind + 30 * x[0] - 20 * x[1] + 40 * x[2]);
}

/* sum over the sides of the tetrahedra with n_corner corners of the field at their middle: `by_volume` V l^2/h^5, else
 * once each (nodes below mark which sides are there) */
static double sum_of_sides(const bench *b, int n_corner, bool by_volume)
{
    const pal_tets *tets = &b->box.tets;
    int32_t *list = NULL;
    int n_item = tets->n_tet;
    double sum = 0;
    if (!by_volume) {
        if (n_corner == 2) CHECK_INT(pal_tets_edges(tets, &list, &n_item), 0);
        if (n_corner == 3) CHECK_INT(pal_tets_faces(tets, &list, &n_item), 0);
        const int32_t *node = list ? list : tets->tet;
        for (int i = 0; i < n_item; i++)
            for (int c = 0; c < n_corner; c++)
                sum += slope_at(tets->x + 3 * node[n_corner * i + c], n_corner - 2) / n_corner;
        free(list);
        return sum;
    }
    for (int t = 0; t < tets->n_tet; t++) {
        double e[3][3], n[3];
        for (int c = 0; c < 3; c++)
            pal_sub3(e[c], tets->x + 3 * tets->tet[4 * t + c + 1], tets->x + 3 * tets->tet[4 * t]);
        pal_cross3(n, e[1], e[2]);
        double volume = pal_dot3(e[0], n) / 6;
        for (unsigned set = 1; set < 16; set++) {
            if (__builtin_popcount(set) != n_corner) continue;
            double l2 = 0, k = 0, pairs = 0;
            for (int a = 0; a < 4; a++) {
                if (!(set >> a & 1)) continue;
                const double *x = tets->x + 3 * tets->tet[4 * t + a];
                k += slope_at(x, n_corner - 2) / n_corner;
                for (int c = 0; c < a; c++) {
                    if (!(set >> c & 1)) continue;
                    double l = pal_dist3(x, tets->x + 3 * tets->tet[4 * t + c]);
                    l2 += l * l, pairs++;
                }
            }
            sum += volume * k * (n_corner == 4 ? 1e-4 : l2 / pairs) / 1e-10;
        }
    }
    return sum;
}

/* a body scaled by s has C = s - 1, s^2 - 1, s^3 - 1 in every spring: its energy is the sum of all constants */
static void a_spring_has_its_weight_times_the_mean_of_its_corners(void)
{
    const double s = 1.2;
    for (int by_volume = 0; by_volume < 2; by_volume++) {
        bench b;
        REQUIRE(bench_make(&b));
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < NODES; i++)
                b.k_J[k][i] = slope_at((const double[]){0.01 * (i % 5), 0.01 * (i / 5 % 4), 0.01 * (i / 20)}, k);
        put_grid(&b);
        pal_entry_put_text(&b.def->model, "weights", by_volume ? "volume" : "equal", NULL);
        REQUIRE(bench_plan(&b));
        for (int i = 0; i < 3 * b.body->n_dof; i++) b.body->x[i] *= s;
        for (int kind = 0; kind < 3; kind++) {
            static const char *const name[3] = {"edge_distance", "face_area", "tet_volume"};
            const pal_component *row = row_named(&b, name[kind]);
            REQUIRE(row);
            double c = pow(s, kind + 1) - 1, wanted = 0.5 * c * c * sum_of_sides(&b, kind + 2, by_volume);
            CHECK_NEAR(row->effect->energy(row->self, b.body), wanted, 1e-12 * wanted);
        }
        bench_close(&b);
    }
}

/* constants that are given and weighted by volume are the derived ones where they have their size */
static void given_constants_may_have_the_weights_of_derived_ones(void)
{
    bench a, b;
    double factor[3];
    REQUIRE(bench_make(&a) && bench_make(&b));
    pal_spring_factors(a.def->material.poisson, false, factor);
    for (int k = 0; k < 3; k++)
        pal_entry_put_number(&b.def->model, k_key[k], factor[k] * a.def->material.young_Pa * 0.01 * 0.01 * 0.01, NULL);
    pal_entry_put_text(&b.def->model, "weights", "volume", NULL);
    REQUIRE(bench_plan(&a) && bench_plan(&b));
    shake(&a, 0.3);
    memcpy(b.body->x, a.body->x, 3 * sizeof(double) * (size_t)a.body->n_dof);
    for (int r = 0; r < a.plan.n_component; r++) {
        if (!a.plan.component[r].effect->energy) continue;
        run_row(&a, &a.plan.component[r]), run_row(&b, &b.plan.component[r]);
        CHECK(memcmp(a.body->f, b.body->f, 3 * sizeof(double) * (size_t)a.body->n_dof) == 0);
    }
    bench_close(&a), bench_close(&b);
}

static void varied_springs_rest_at_rest_and_create_no_momentum(void)
{
    bench b;
    REQUIRE(bench_varied(&b, "volume"));
    EACH_SPRING_ROW(b, row)
    {
        run_row(&b, row);
        for (int i = 0; i < 3 * b.body->n_dof; i++) CHECK_LE(fabs(b.body->f[i]), 1e-13);
    }
    for (int turn = 0; turn < 3; turn++) {
        shake(&b, turn == 0 ? 0.1 : turn == 1 ? 0.5 : 3);
        EACH_SPRING_ROW(b, row)
        {
            double force[3] = {0}, torque[3] = {0}, sum = 0, arms = 0, t[3];
            run_row(&b, row);
            for (int i = 0; i < b.body->n_dof; i++) {
                const double *f = b.body->f + 3 * i;
                pal_cross3(t, b.body->x + 3 * i, f);
                pal_add3(force, force, f), pal_add3(torque, torque, t);
                sum += pal_norm3(f), arms += pal_norm3(t);
            }
            CHECK(sum > 0);
            CHECK_LE(pal_norm3(force), 1e-13 * sum);
            CHECK_LE(pal_norm3(torque), 1e-13 * arms);
        }
    }
    bench_close(&b);
}

static void forces_of_varied_springs_are_the_gradient_of_their_energy(void)
{
    bench b;
    REQUIRE(bench_varied(&b, NULL));
    for (int turn = 0; turn < 2; turn++) {
        shake(&b, turn == 0 ? 0.05 : 0.5);
        EACH_SPRING_ROW(b, row)
        {
            double max = 0, worst = 0, step = 1e-6 * b.body->edge_m;
            run_row(&b, row);
            for (int i = 0; i < 3 * b.body->n_dof; i++) {
                double x = b.body->x[i];
                b.body->x[i] = x + step;
                double up = row->effect->energy(row->self, b.body);
                b.body->x[i] = x - step;
                double down = row->effect->energy(row->self, b.body);
                b.body->x[i] = x;
                max = fmax(max, fabs(b.body->f[i]));
                worst = fmax(worst, fabs(b.body->f[i] + (up - down) / (2 * step)));
            }
            CHECK(max > 0);
            CHECK_LE(worst, 3e-6 * max);
        }
    }
    bench_close(&b);
}

static void the_substep_is_half_the_stable_one_of_varied_springs_or_less(void)
{
    for (int by_volume = 0; by_volume < 2; by_volume++) {
        bench b;
        REQUIRE(bench_varied(&b, by_volume ? "volume" : "equal"));
        const pal_component *solve = &b.plan.component[b.plan.first[PAL_STAGE_SOLVE][0]];
        for (int turn = 0; turn < 3; turn++) {
            if (turn == 1) shake(&b, 0.2);
            for (int i = 0; i < 3 * b.body->n_dof && turn == 2; i++) b.body->x[i] = 1.8 * b.body->x_rest[i];
            memset(b.body->v, 0, 3 * sizeof(double) * (size_t)b.body->n_dof);
            pal_step step = {.body = b.body,
                             .force = b.plan.component + b.plan.first[PAL_STAGE_FORCE][0],
                             .n_force = b.plan.n_of[PAL_STAGE_FORCE][0]};
            solve->effect->reset(solve->self, b.body);
            double chosen = solve->effect->bounds.limit(solve->self, &step),
                   stable = 2 / sqrt(largest_w2(&b.plan, &seed));
            printf("  chosen %.3g ms, stable %.3g ms, ratio %.2f\n", 1e3 * chosen, 1e3 * stable, chosen / stable);
            CHECK_LE(chosen, 0.5 * stable * 1.001);
            CHECK_LE(0.15 * stable, chosen);
        }
        bench_close(&b);
    }
}

static void a_varied_body_keeps_its_momentum_and_comes_back(void)
{
    bench b;
    pal_world *world;
    REQUIRE(bench_make(&b));
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < NODES; i++) b.k_J[k][i] = 1e-3 * pow(10, uniform());
    put_grid(&b);
    REQUIRE(!pal_world_create(b.scene, &diag, &world));
    pal_body *body = pal_world_body(world, 0);
    double before[3], after[3], scale = 0;
    for (int i = 0; i < 3 * body->n_dof; i++) body->v[i] = 0.05 * uniform() + (i % 3 == 0 ? 0.1 : 0);
    for (int i = 0; i < body->n_dof; i++) scale += body->mass_kg[i] * pal_norm3(body->v + 3 * i);
    body_momentum(body, before);
    for (int i = 0; i < 120; i++) REQUIRE(!pal_world_step(world, b.scene->step_s));
    body_momentum(body, after);
    CHECK_LE(pal_dist3(before, after), 1e-11 * scale);
    CHECK(!body->frozen);
    pal_world_destroy(world);
    bench_close(&b);
}

static double energy_of(const bench *b, const char *name)
{
    const pal_component *row = row_named(b, name);
    return row ? row->effect->energy(row->self, b->body) : NAN;
}

static void a_material_edit_leaves_what_is_given(void)
{
    bench b;
    REQUIRE(bench_make(&b));
    for (int i = 0; i < NODES; i++) b.k_J[0][i] = 1e-3;
    put_grid(&b);
    b.def->spring_grid.k_J[PAL_SPRING_AREA] = b.def->spring_grid.k_J[PAL_SPRING_VOLUME] = NULL;
    REQUIRE(bench_plan(&b));
    /* no area springs beside a grid that gives none; the volume springs are derived */
    CHECK(row_named(&b, "face_area") == NULL);
    double before[2], factor[3];
    for (int i = 0; i < 3 * b.body->n_dof; i++) b.body->x[i] *= 1.1;
    before[0] = energy_of(&b, "edge_distance"), before[1] = energy_of(&b, "tet_volume");
    pal_spring_factors(b.def->material.poisson, true, factor);
    double c = 1.1 * 1.1 * 1.1 - 1,
           wanted = 0.5 * c * c * factor[2] * b.def->material.young_Pa * 24e-6; /* sum of V/h^3 h^3 */
    CHECK_NEAR(before[1], wanted, 1e-12 * wanted);
    pal_material stiffer = b.def->material;
    stiffer.young_Pa *= 3;
    for (int r = 0; r < b.plan.n_component; r++)
        if (b.plan.component[r].effect->material)
            CHECK_INT(b.plan.component[r].effect->material(b.plan.component[r].self, b.body, &stiffer, &diag), 0);
    CHECK_NEAR(energy_of(&b, "edge_distance"), before[0], 0);
    CHECK_NEAR(energy_of(&b, "tet_volume"), 3 * before[1], 1e-12 * before[1]);
    bench_close(&b);

    /* a key may give what the grid does not */
    REQUIRE(bench_make(&b));
    for (int i = 0; i < NODES; i++) b.k_J[0][i] = b.k_J[2][i] = 1e-3;
    put_grid(&b);
    b.def->spring_grid.k_J[PAL_SPRING_AREA] = NULL;
    pal_entry_put_number(&b.def->model, "k_area_J", 5e-4, NULL);
    REQUIRE(bench_plan(&b));
    CHECK(row_named(&b, "face_area") != NULL);
    bench_close(&b);
}

static void nodes_show_their_constant_in_colour(void)
{
    bench b;
    REQUIRE(bench_varied(&b, "volume"));
    const pal_component *row = row_named(&b, "edge_distance");
    REQUIRE(row && row->effect->inspect.measure);
    double sum[128] = {0}, volume[128] = {0};
    REQUIRE(b.body->n_dof == NODES);
    row->effect->inspect.measure(row->self, b.body, PAL_FIELD_VON_MISES_PA, sum, volume);
    for (int i = 0; i < NODES; i++) CHECK_NEAR(volume[i] + sum[i], 0, 0);
    row->effect->inspect.measure(row->self, b.body, PAL_FIELD_STIFFNESS_J, sum, volume);
    /* the grid's nodes are the body's */
    for (int i = 0; i < NODES; i++) CHECK_NEAR(sum[i] / volume[i], b.k_J[0][i], 1e-15);
    bench_close(&b);

    /* derived constants are the same everywhere, and follow an edit */
    pal_world *world;
    REQUIRE(bench_make(&b) && !pal_world_create(b.scene, &diag, &world));
    CHECK(pal_world_has_field(world, 0, PAL_FIELD_STIFFNESS_J) &&
          !pal_world_has_field(world, 0, PAL_FIELD_VON_MISES_PA));
    REQUIRE(!pal_world_field(world, 0, PAL_FIELD_STIFFNESS_J, true, &diag));
    pal_body *body = pal_world_body(world, 0);
    const float *value = body->display.field[PAL_FIELD_STIFFNESS_J]->value;
    double factor[3];
    pal_spring_factors(b.def->material.poisson, false, factor);
    for (int turn = 0; turn < 2; turn++) {
        double wanted = (turn ? 3 : 1) * factor[0] * b.def->material.young_Pa * 1e-6;
        for (int i = 0; i < body->display.n_shown; i++) CHECK_NEAR((double)value[i], wanted, 1e-6 * wanted);
        pal_material edit = b.def->material;
        edit.young_Pa *= 3;
        REQUIRE(!pal_world_material(world, 0, &edit, &diag));
        for (int i = 0; i < 12; i++) REQUIRE(!pal_world_step(world, b.scene->step_s));
    }
    pal_world_destroy(world);
    bench_close(&b);
}

static void expect(bench *b, const char *sentence)
{
    pal_world *world = NULL;
    diag.text[0] = 0;
    CHECK_INT(pal_world_create(b->scene, &diag, &world), PAL_ERR_REFUSED);
    pal_world_destroy(world);
    if (!strstr(diag.text, sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, sentence);
    if (strchr(diag.text, '\n')) CHECK_FAIL("\"%s\" has a line end", diag.text);
}

static void refuses_a_grid_that_is_none_in_one_sentence(void)
{
    static const struct {
        int n[3];
        double low, high, value;
        const char *sentence;
    } bad[] = {
        {{0, 4, 3}, 0, 0.04, 1, "model.grid.n[0]: 0 nodes"},
        {{5, -4, 3}, 0, 0.04, 1, "model.grid.n[1]: -4 nodes"},
        {{5, 4, 1 << 20}, 0, 0.04, 1, "model.grid.n: 2.09715e+07 nodes, at most 1048576"},
        {{INT32_MAX, INT32_MAX, INT32_MAX}, 0, 0.04, 1, "nodes, at most 1048576"},
        {{5, 4, 3}, 0.04, 0.04, 1, "low_m[0] 0.04 is not below high_m[0] 0.04"},
        {{5, 4, 3}, NAN, 0.04, 1, "low_m[0] nan is not below"},
        {{5, 4, 3}, 0, INFINITY, 1, "is not below high_m[0] inf"},
        {{5, 4, 3}, 0, 0.04, 0, "model.grid.k_volume_J[7]: 0 is outside"},
        {{5, 4, 3}, 0, 0.04, -1, "model.grid.k_volume_J[7]: -1 is outside"},
        {{5, 4, 3}, 0, 0.04, NAN, "model.grid.k_volume_J[7]: nan is outside"},
        {{5, 4, 3}, 0, 0.04, INFINITY, "model.grid.k_volume_J[7]: inf is outside"},
    };
    bench b;
    REQUIRE(bench_make(&b));
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        for (int k = 0; k < 3 * NODES; k++) b.k_J[k / NODES][k % NODES] = 1;
        b.k_J[2][7] = bad[i].value;
        put_grid(&b);
        memcpy(b.def->spring_grid.n, bad[i].n, sizeof bad[i].n);
        b.def->spring_grid.low_m[0] = bad[i].low, b.def->spring_grid.high_m[0] = bad[i].high;
        expect(&b, bad[i].sentence);
    }
    b.k_J[2][7] = 1;
    put_grid(&b);
    memset(b.def->spring_grid.k_J, 0, sizeof b.def->spring_grid.k_J);
    expect(&b, "model.grid: gives neither k_distance_J, k_area_J nor k_volume_J");
    for (int k = 0; k < 3; k++) {
        char sentence[96];
        put_grid(&b);
        pal_entry_init(&b.def->model, "model", "tet_springs");
        pal_entry_put_number(&b.def->model, k_key[k], 1e-3, NULL);
        snprintf(sentence, sizeof sentence, "model.%s: stands beside a grid that gives the same", k_key[k]);
        expect(&b, sentence);
    }
    pal_entry_init(&b.def->model, "model", "tet_springs");
    pal_entry_put_text(&b.def->model, "weights", "square", NULL);
    expect(&b, "model.weights: \"square\", wanted \"equal\" or \"volume\"");
    pal_entry_init(&b.def->model, "model", "fem");
    expect(&b, "model.grid: model \"fem\" has no springs");
    /* an entry in place of the model's row */
    pal_entry_init(&b.def->model, "model", "tet_springs");
    pal_config_entry *entry = &b.def->effect[b.def->n_effect++];
    pal_entry_init(entry, "effects[1]", "edge_distance");
    pal_entry_put_number(entry, "k_J", 1, NULL);
    expect(&b, "effects[1].k_J: stands beside a grid that gives the same");
    bench_close(&b);
}

int main(void)
{
    RUN(a_grid_of_equal_values_is_the_homogeneous_body);
    RUN(a_spring_has_its_weight_times_the_mean_of_its_corners);
    RUN(given_constants_may_have_the_weights_of_derived_ones);
    RUN(varied_springs_rest_at_rest_and_create_no_momentum);
    RUN(forces_of_varied_springs_are_the_gradient_of_their_energy);
    RUN(the_substep_is_half_the_stable_one_of_varied_springs_or_less);
    RUN(a_varied_body_keeps_its_momentum_and_comes_back);
    RUN(a_material_edit_leaves_what_is_given);
    RUN(nodes_show_their_constant_in_colour);
    RUN(refuses_a_grid_that_is_none_in_one_sentence);
    return check_report();
}
