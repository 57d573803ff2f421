/* `palpate bench solids`: subdivision solids as finite elements against paper A, Table 1, on one core.
 *
 * Our own versions of its eight solids, with as many control cells and the same levels of subdivision (the paper does
 * not print their cells; the two blocks are the same), and a kidney. One iteration is one explicit step of central_cg
 * (paper A section 3.3): elastic forces of all elements, gravity, drag, and the mass matrix by conjugate gradients to
 * 1e-4, for both operators of cell_elastic; median over steps of the motion from rest. The paper used a Pentium 4
 * of 2.8 GHz. A frame is 1/60 s of the default tissue (E 5 kPa, nu 0.45): so many sub-steps of central_cg, or one step
 * of implicit_euler, which bends under gravity while it is measured. Speed: simulated seconds in one of processor time.
 */
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"

#include "server/base/clock.h"
#include "server/num/median.h"
#include "server/sim/subdivision/subdivision_solid.h"

#include <math.h>
#include <string.h>

enum { N_STEP = 401, N_FRAME = 41 };
static const double frame_s = 1.0 / 60;

/* ms an iteration of Table 1 (MSPI) */
static const struct {
    const char *name;
    double ms;
} paper[] = {{"soccer", 135}, {"monster", 47}, {"block3", 310}, {"chair", 90},
             {"block4", 84},  {"head", 110},   {"bridge", 213}, {"nozzle", 75}};
static const double min_ratio = 100;

/* a solid with its scene and, once started, its world */
typedef struct body {
    pal_cells cells;
    pal_prepared mesh;
    pal_scene *scene;
    int threads;
    pal_world *world;
} body;

/* a world of the solid under gravity, its lowest part fixed */
static pal_err start(const pal_cell_model *model, const char *operator, const char * solver, const char *preconditioner,
                     body *b, pal_diagnostic *diag)
{
    pal_world_destroy(b->world);
    b->world = NULL;
    pal_scene_default(b->scene);
    b->scene->n_body = 1;
    b->scene->step_s = frame_s;
    b->scene->max_substep = 1000000;
    b->scene->threads = b->threads;
    pal_body_def *def = &b->scene->body[0];
    pal_body_default_cells(def, "solid", &b->mesh, &b->cells);
    def->n_effect = 1;
    pal_entry_init(&def->effect[0], "effects[0]", "gravity");
    PAL_TRY(pal_entry_put_number(&def->model, "levels", model->n_level, diag));
    PAL_TRY(pal_entry_put_text(&def->model, "operator", operator, diag));
    pal_entry_init(&def->solver, "solver", solver);
    if (preconditioner) PAL_TRY(pal_entry_put_text(&def->solver, "preconditioner", preconditioner, diag));
    return pal_world_create(b->scene, diag, &b->world);
}

typedef struct run {
    double median_ms, mean_cg, max_cg;
    int n_sub; /* at most */
} run;

/* n steps, after n_warm that are not timed: frames, or explicit steps of one sub-step each */
static pal_err run_steps(body *b, int n, int n_warm, bool frames, run *out, pal_diagnostic *diag)
{
    static double ms[N_STEP];
    *out = (run){0};
    for (int i = -n_warm; i < n; i++) {
        pal_solve_report report = {0};
        double took_ms;
        /* 0.9: drag and motion change the limit a little */
        if (bench_step(b->world, frames ? frame_s : 0.9 * pal_world_limit_s(b->world), &took_ms))
            return pal_diagnostic_set(diag, PAL_ERR_FROZEN, frames ? "a frame failed" : "an explicit step failed");
        if (i < 0) continue;
        const int n_sub = pal_world_substeps(b->world);
        (void)pal_world_solve_report(b->world, 0, &report);
        ms[i] = frames ? took_ms : took_ms / n_sub;
        out->mean_cg += (double)report.n_cg / n, out->max_cg = fmax(out->max_cg, report.n_cg);
        out->n_sub = n_sub > out->n_sub ? n_sub : out->n_sub;
    }
    out->median_ms = pal_median(ms, n);
    return PAL_ERR_OK;
}

typedef struct result {
    double paper_ms; /* NaN: not in the table */
    run step[2];     /* explicit, of operators polar and edges, with the default preconditioner, a factor of M~ */
    run diagonal;    /* with the paper's */
    run explicit_frame, implicit_frame;
    run two_threads[2]; /* the same with two threads */
    double make_ms;     /* world with implicit_euler, its factor */
} result;

static void add_case(pal_table *r, const pal_cell_model *m, const body *b, const result *c)
{
    const pal_body *of = pal_world_body(b->world, 0);
    const pal_cell_elements *e = &of->model.solid->elements;
    TABLE_ROW(r, TEXT("name", "solid", -8, m->name), NUMBER("levels", "levels", 6, 0, m->n_level),
              NUMBER("cells", "#CC", 4, 0, b->cells.n_cell), VALUE("control_points", of->n_dof),
              NUMBER("elements", "#FE", 5, 0, pal_cell_elements_count(e)),
              NUMBER("paper_elements", "paper", 5, 0, m->n_element),
              NUMBER("cubic_percent", "%cubic", 6, 0, pal_cell_elements_percent(e, PAL_CELL_CUBIC)),
              NUMBER("linear_percent", "%linear", 7, 0, pal_cell_elements_percent(e, PAL_CELL_HEX)),
              NUMBER("pyramid_percent", "%pyramid", 8, 0, pal_cell_elements_percent(e, PAL_CELL_PYRAMID)),
              NUMBER("paper_ms", "paper ms", 8, 0, c->paper_ms),
              NUMBER("polar_ms", "polar ms", 8, 3, c->step[0].median_ms),
              NUMBER("edges_ms", "edges ms", 8, 3, c->step[1].median_ms),
              NUMBER("ratio", "ratio", 6, 0, c->paper_ms / c->step[0].median_ms),
              NUMBER("cg_mean", "CG mean", 7, 2, c->step[0].mean_cg), NUMBER("cg_max", "max", 4, 0, c->step[0].max_cg),
              NUMBER("cg_diagonal", "diagonal", 8, 1, c->diagonal.mean_cg),
              NUMBER("substeps", "sub-steps", 9, 0, c->explicit_frame.n_sub),
              NUMBER("explicit_frame_ms", "explicit ms", 11, 2, c->explicit_frame.median_ms),
              NUMBER(NULL, "speed", 6, 2, 1e3 * frame_s / c->explicit_frame.median_ms),
              NUMBER("implicit_frame_ms", "implicit ms", 11, 3, c->implicit_frame.median_ms),
              NUMBER(NULL, "speed", 6, 1, 1e3 * frame_s / c->implicit_frame.median_ms),
              NUMBER("implicit_cg", "CG", 5, 1, c->implicit_frame.mean_cg),
              NUMBER("explicit_two_threads", "x on 2", 6, 2, c->explicit_frame.median_ms / c->two_threads[0].median_ms),
              NUMBER("implicit_two_threads", "implicit x on 2", 15, 2,
                     c->implicit_frame.median_ms / c->two_threads[1].median_ms),
              NUMBER("implicit_make_ms", "make ms", 7, 0, c->make_ms));
    if (c->paper_ms / c->step[0].median_ms < min_ratio)
        pal_table_note(r, "%s: %.0f times the speed of the paper, wanted %.0f", m->name,
                       c->paper_ms / c->step[0].median_ms, min_ratio);
}

static pal_err measure(const pal_cell_model *model, pal_table *r, pal_diagnostic *diag)
{
    static pal_scene scene;
    body b = {.scene = &scene};
    result c = {.paper_ms = NAN};
    const struct {
        const char *operator, * solver, *preconditioner;
        int n, n_warm;
        bool frames;
        run *out;
        int threads;
    } job[] = {{"polar", "central_cg", NULL, N_STEP, N_STEP / 10, false, &c.step[0], 1},
               {"edges", "central_cg", NULL, N_STEP, N_STEP / 10, false, &c.step[1], 1},
               {"polar", "central_cg", "diagonal", N_STEP / 8, N_STEP / 80, false, &c.diagonal, 1},
               {"polar", "central_cg", NULL, N_FRAME / 4, 2, true, &c.explicit_frame, 1},
               {"polar", "central_cg", NULL, N_FRAME / 4, 2, true, &c.two_threads[0], 2},
               {"polar", "implicit_euler", NULL, N_FRAME, 2, true, &c.two_threads[1], 2},
               {"polar", "implicit_euler", NULL, N_FRAME, 2, true, &c.implicit_frame, 1}};
    for (size_t k = 0; k < sizeof paper / sizeof paper[0]; k++)
        if (!strcmp(paper[k].name, model->name)) c.paper_ms = paper[k].ms;
    pal_err err = bench_solid(model, &b.cells, &b.mesh, diag);
    for (size_t k = 0; k < sizeof job / sizeof job[0] && !err; k++) {
        uint64_t began = pal_clock_thread_ns();
        b.threads = job[k].threads;
        err = start(model, job[k].operator, job[k].solver, job[k].preconditioner, &b, diag);
        c.make_ms = 1e-6 * (double)(pal_clock_thread_ns() - began);
        if (!err) err = run_steps(&b, job[k].n, job[k].n_warm, job[k].frames, job[k].out, diag);
    }
    if (!err) add_case(r, model, &b, &c);
    pal_world_destroy(b.world);
    pal_prepared_free(&b.mesh);
    pal_cells_free(&b.cells);
    return err;
}

pal_err bench_solids(pal_table *r, pal_diagnostic *diag)
{
    TABLE_ROW(r, VALUE("steps", N_STEP), VALUE("frames", N_FRAME), VALUE("frame_s", frame_s));
    pal_table_note(r,
                   "paper A, Table 1, one core; medians of %d iterations, of %d frames; CG: conjugate gradients in one "
                   "iteration, with a factor and (as in the paper) with the diagonal",
                   N_STEP, N_FRAME);
    pal_table_list(r, "cases");
    for (int k = 0; k < PAL_CELL_MODELS; k++) PAL_TRY(measure(&pal_cell_model_list[k], r, diag));
    return PAL_ERR_OK;
}
