/* `palpate bench guards`: the cost of the guards while nothing goes wrong, as a share of a step, for every model. Two
 * worlds of one scene step alternately under the same load; one has the component finite_guard and an implicit solver
 * that checks its energy, the other neither. The worlds are created several times in alternating order, because the
 * place in memory alone makes two worlds of one scene differ by several percent. Every round repeats the same steps, so
 * the least processor time of a step counts, which a busy machine disturbs least; the result is its mean over the
 * steps. The checks that every solver makes (are all numbers finite?) and the component are timed alone. Wanted: 3 % of
 * a step for all together. Then the time of the steps in which a tenth of the body turns back from inversion, over one
 * with nothing inverted; wanted: 2. */
#include "server/base/clock.h"
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"
#include "server/mesh/geometry/procedural.h"
#include "server/num/median.h"

#include <math.h>

enum { N_CASE = 4, N_STEP = 40, N_WARM = 8 };

typedef struct guards {
    const char *model;
    int n_point, n_sub;
    bool checks_energy;   /* an implicit solver           */
    uint64_t n_safeguard; /* not 0: something went wrong  */
    double with_ms, without_ms, component_ms, finite_ms, energy_ms;
} guards;

typedef struct bodies {
    pal_prepared voxels, adaptive, boundary;
    pal_cells cells;
} bodies;

static pal_err make_bodies(bodies *b, pal_diagnostic *diag)
{
    pal_surface organ = {0};
    pal_voxel_options options = {.resolution = 18, .border = true, .fill = true};
    pal_prepare_report report;
    pal_err err = pal_organ_make(2000, &organ);
    if (!err) err = pal_prepared_make(&organ, &options, &b->voxels, &report, diag);
    if (!err) err = pal_prepared_surface(&organ, &b->adaptive);
    if (!err) err = bench_solid(pal_cell_model_find("chair"), &b->cells, &b->boundary, diag);
    pal_surface_free(&organ);
    return err;
}

static const char *const model_name[N_CASE] = {"tet_springs", "fem", "adaptive_springs", "subdivision_fem"};
/* pairs of worlds: more where a step is short */
static const int n_round[N_CASE] = {10, 40, 40, 4};

static pal_err make_scene(pal_scene *scene, const bodies *b, int which, bool guard, pal_diagnostic *diag)
{
    pal_scene_default(scene);
    scene->n_body = 1;
    pal_body_def *def = &scene->body[0];
    if (which == 3)
        pal_body_default_cells(def, "body", &b->boundary, &b->cells);
    else
        pal_body_default(def, "body", which == 2 ? &b->adaptive : &b->voxels);
    pal_entry_init(&def->model, "model", model_name[which]);
    def->support[0].fraction = 0.15;
    /* low: under its full weight this body falls over its foot and safeguards act in every step */
    scene->gravity_m_s2 = 0.5;
    if (which == 1) {
        pal_entry_init(&def->solver, "solver", "implicit_euler");
        if (pal_entry_put_bool(&def->solver, "watch", guard, diag)) return PAL_ERR_REFUSED;
    }
    def->n_effect = 0;
    pal_entry_init(&def->effect[def->n_effect++], "effects[0]", "gravity");
    if (guard) pal_entry_init(&def->effect[def->n_effect++], "effects[1]", "finite_guard");
    return PAL_ERR_OK;
}

/* the check of a solver at both ends of a step */
static double finite_ms(const pal_body *body)
{
    double ms[N_STEP], sum = 0;
    for (int k = 0; k < N_STEP; k++) {
        uint64_t before = pal_clock_thread_ns();
        sum += pal_body_finite(body) + pal_body_finite(body);
        ms[k] = 1e-6 * (double)(pal_clock_thread_ns() - before);
    }
    return sum > 0 ? pal_median(ms, N_STEP) : 0;
}

/* a sideways load that alternates, so that no body comes to rest */
static pal_err alternate_load(pal_world *world, int step)
{
    const pal_body *body = pal_world_body(world, 0);
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < pal_body_nodes(body) && step % 16 == 0 && !err; k++) {
        int i = pal_body_point(body, k);
        double side = step / 16 % 2 ? 0.1 : -0.1;
        err = pal_world_load(world, 0, i, (const double[3]){side * body->node_mass_kg[i], 0, 0});
    }
    return err;
}

/* of each step, the least time of all rounds; ms[1]: with guards */
typedef struct times {
    double ms[2][N_STEP], component_ms[N_STEP];
} times;

/* makes both worlds, steps them alternately and frees them; counts come from the guarded one */
static pal_err one_round(const bodies *b, int which, int round, times *t, guards *out, pal_diagnostic *diag)
{
    static pal_scene scene[2];
    pal_world *world[2] = {NULL, NULL};
    pal_err err = PAL_ERR_OK;
    for (int turn = 0; turn < 2 && !err; turn++) {
        int g = (round + turn) & 1;
        err = make_scene(&scene[g], b, which, g == 1, diag);
        if (!err) err = pal_world_create(&scene[g], diag, &world[g]);
    }
    for (int k = -N_WARM; k < N_STEP && !err; k++) {
        for (int turn = 0; turn < 2 && !err; turn++) {
            /* the order alternates from step to step */
            int g = (k + turn) & 1;
            double took = 0;
            err = alternate_load(world[g], k + N_WARM);
            if (!err) err = bench_step(world[g], scene[g].step_s, &took);
            if (k < 0) continue;
            t->ms[g][k] = fmin(t->ms[g][k], took);
            if (g == 1)
                t->component_ms[k] = fmin(t->component_ms[k], bench_component_ms(world[1], NULL, "finite_guard"));
        }
    }
    if (!err) {
        const pal_body *body = pal_world_body(world[1], 0);
        out->n_point = body->n_active, out->n_sub = pal_world_substeps(world[1]);
        out->n_safeguard += pal_safeguards_sum(&body->safeguards);
        out->finite_ms = finite_ms(body), out->checks_energy = body->implicit;
    }
    for (int g = 0; g < 2; g++) pal_world_destroy(world[g]);
    return err;
}

static pal_err measure(const bodies *b, int which, guards *out, pal_diagnostic *diag)
{
    static times t;
    pal_err err = PAL_ERR_OK;
    *out = (guards){.model = model_name[which]};
    for (int k = 0; k < N_STEP; k++) t.ms[0][k] = t.ms[1][k] = t.component_ms[k] = INFINITY;
    for (int round = 0; round < n_round[which] && !err; round++) err = one_round(b, which, round, &t, out, diag);
    for (int k = 0; k < N_STEP; k++) {
        out->with_ms += t.ms[1][k] / N_STEP;
        out->without_ms += t.ms[0][k] / N_STEP;
        out->component_ms += t.component_ms[k] / N_STEP;
    }
    if (out->checks_energy) out->energy_ms = out->with_ms - out->without_ms - out->component_ms;
    return err;
}

static const double max_share = 0.03;
static const char not_timed[] = "search for inverted elements, caps of loads and displacements, choice of sub-steps, "
                                "refusal of bad numbers, corrections of contacts";

static void add_case(pal_table *r, const guards *c)
{
    /* a negative difference is noise */
    double checks_ms = c->finite_ms + fmax(0, c->energy_ms), share = (c->component_ms + checks_ms) / c->with_ms;
    const char *verdict = c->n_safeguard ? "something went wrong" : share <= max_share ? "ok" : "too much";
    TABLE_ROW(r, TEXT("model", "model", -18, c->model), NUMBER("dofs", "dofs", 8, 0, c->n_point),
              NUMBER(NULL, "sub-steps", 10, 0, c->n_sub), VALUE("safeguards", c->n_safeguard),
              NUMBER("with_ms", "ms with", 12, 4, c->with_ms), NUMBER("without_ms", "ms without", 12, 4, c->without_ms),
              NUMBER("component_share", "component", 9, 4, c->component_ms / c->with_ms),
              NUMBER("checks_share", "checks", 8, 4, checks_ms / c->with_ms), NUMBER("sum_share", "sum", 8, 4, share),
              TEXT("verdict", "", 0, verdict));
}

/* ---- a tenth of the body inverted ---- */

/* turns the tenth of the points that is farthest along x inside out, each about the middle of them all */
static void invert_tenth(pal_body *body)
{
    double low = INFINITY, high = -INFINITY, from, middle = 0;
    int n = 0;
    for (int i = 0; i < body->n_dof; i++) low = fmin(low, body->x_rest[3 * i]), high = fmax(high, body->x_rest[3 * i]);
    for (from = high; n < body->n_dof / 10 && high > low; from -= 0.01 * (high - low)) {
        n = 0, middle = 0;
        for (int i = 0; i < body->n_dof; i++)
            if (body->x_rest[3 * i] >= from) n++, middle += body->x_rest[3 * i];
    }
    for (int i = 0; i < 3 * body->n_dof; i++) {
        const bool far = i % 3 == 0 && n > 0 && body->x_rest[i] > from && !body->support[i / 3];
        body->x[i] = far ? 2 * middle / n - body->x_rest[i] : body->x_rest[i];
        body->v[i] = 0;
    }
    pal_body_update_nodes(body);
}

/* of a step: from a state stretched by 1 %, at the begin with a tenth inverted, the mean of those until it has turned
 * back; the part of the first that recovery takes itself, and the iterations of its linear solves */
typedef struct inverted {
    double whole_ms, first_ms, mean_ms, own_ms;
    int n_cg;
} inverted;

enum { N_TURN = 12 };

static pal_err run_inverted(pal_world *world, double step_s, inverted *out)
{
    pal_body *body = pal_world_body(world, 0);
    double took = 0, sum = 0;
    pal_world_reset(world);
    for (int i = 0; i < 3 * body->n_dof; i++)
        if (!body->support[i / 3]) body->x[i] = 1.01 * body->x_rest[i];
    pal_body_update_nodes(body);
    pal_world_invalidate_limits(world, 0);
    PAL_TRY(bench_step(world, step_s, &took));
    out->whole_ms = fmin(out->whole_ms, took);
    pal_world_reset(world);
    invert_tenth(body);
    pal_world_invalidate_limits(world, 0);
    for (int k = 0; k < N_TURN; k++) {
        PAL_TRY(bench_step(world, step_s, &took));
        sum += took / N_TURN;
        if (k > 0) continue;
        out->first_ms = fmin(out->first_ms, took);
        out->own_ms = fmin(out->own_ms, 1e-6 * (double)body->safeguards.ns);
        pal_solve_report report = {0};
        if (pal_world_solve_report(world, 0, &report)) out->n_cg = report.n_cg;
    }
    out->mean_ms = fmin(out->mean_ms, sum);
    return PAL_ERR_OK;
}

static pal_err measure_inverted(const bodies *b, int which, inverted *out, pal_diagnostic *diag)
{
    static pal_scene scene;
    pal_world *world = NULL;
    *out = (inverted){INFINITY, INFINITY, INFINITY, INFINITY, 0};
    pal_err err = make_scene(&scene, b, which, false, diag);
    scene.body[0].n_effect = 0;
    if (!err) err = pal_world_create(&scene, diag, &world);
    for (int k = 0; k < n_round[which] && !err; k++) err = run_inverted(world, scene.step_s, out);
    pal_world_destroy(world);
    return err;
}

static void add_inverted(pal_table *r, int which, const inverted *t)
{
    TABLE_ROW(r, TEXT("model", "model", -18, model_name[which]), NUMBER("whole_ms", "ms whole", 12, 4, t->whole_ms),
              NUMBER("first_ms", "ms first", 12, 4, t->first_ms), NUMBER("mean_ms", "ms mean", 12, 4, t->mean_ms),
              NUMBER("own_ms", "ms recovery", 12, 4, t->own_ms), VALUE("iterations", t->n_cg),
              NUMBER("ratio", "mean/whole", 12, 2, t->mean_ms / t->whole_ms),
              TEXT("verdict", "", 0, t->mean_ms <= 2 * t->whole_ms ? "ok" : "too much"));
}

pal_err bench_guards(pal_table *r, pal_diagnostic *diag)
{
    bodies b = {0};
    guards one;
    TABLE_ROW(r, VALUE("max_share", max_share), TEXT("not_timed", NULL, 0, not_timed));
    pal_table_note(r, "shares of a step, wanted at most %g together. Not timed: %s", max_share, not_timed);
    pal_table_list(r, "cases");
    pal_err err = make_bodies(&b, diag);
    for (int k = 0; k < N_CASE && !err; k++) {
        err = measure(&b, k, &one, diag);
        if (!err) add_case(r, &one);
    }
    pal_table_note(r, "steps from a tenth of the body inverted: the first, mean of %d, wanted at most two whole steps",
                   N_TURN);
    pal_table_list(r, "inverted");
    for (int k = 0; k < N_CASE && !err; k++) {
        inverted t;
        if (k == 2) continue; /* a surface has no volume */
        err = measure_inverted(&b, k, &t, diag);
        if (!err) add_inverted(r, k, &t);
    }
    pal_prepared_free(&b.voxels);
    pal_prepared_free(&b.adaptive);
    pal_prepared_free(&b.boundary);
    pal_cells_free(&b.cells);
    return err;
}
