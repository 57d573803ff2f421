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
#include "server/bench/bench_report.h"

#include "server/base/clock.h"
#include "server/cli/median.h"
#include "server/mesh/cells/cell_models.h"
#include "server/sim/subdivision/subdivision_solid.h"
#include "server/sim/world/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N_STEP = 401, N_FRAME = 41, OPERATORS = 2 };
static const double frame_s = 1.0 / 60;
static const char *const operator_name[OPERATORS] = {"polar", "edges"};

/* ms an iteration of Table 1 (MSPI) */
static const struct {
    const char *name;
    double ms;
} paper[] = {{"soccer", 135}, {"monster", 47}, {"block3", 310}, {"chair", 90},
             {"block4", 84},  {"head", 110},   {"bridge", 213}, {"nozzle", 75}};
static const double min_ratio = 100;

typedef struct result {
    const pal_cell_model *model;
    int n_cell, n_point, n_element;
    double percent[PAL_CELL_KINDS];
    double paper_ms;                  /* 0: not in the table */
    double step_ms[OPERATORS], ratio; /* ratio: of the default operator; 0 without the paper's */
    double mean_cg, max_cg;           /* of the default preconditioner, a factor of M~ */
    double diagonal_cg;               /* with the paper's */
    int n_sub;                        /* sub-steps of central_cg a frame, at most */
    double explicit_ms, implicit_ms;  /* of a frame; median */
    double implicit_cg, make_ms;      /* make: world with implicit_euler, its factor */
} result;

/* a solid with its scene and, once started, its world */
typedef struct body {
    pal_cells cells;
    pal_prepared mesh;
    pal_scene *scene;
    pal_world *world;
} body;

static pal_err make_body(const pal_cell_model *model, body *b, pal_diagnostic *diag)
{
    memset(b, 0, sizeof *b);
    b->scene = calloc(1, sizeof *b->scene);
    return b->scene ? bench_solid(model, &b->cells, &b->mesh, diag) : PAL_ERR_MEMORY;
}

static void free_body(body *b)
{
    pal_world_destroy(b->world);
    pal_prepared_free(&b->mesh);
    pal_cells_free(&b->cells);
    free(b->scene);
}

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

static int iterations(const body *b)
{
    pal_solve_report report = {0};
    (void)pal_world_solve_report(b->world, 0, &report);
    return report.n_cg;
}

/* n explicit steps of one sub-step each, after a tenth as many that are not timed */
static pal_err run_steps(body *b, int n, double *ms, double *mean_cg, double *max_cg, pal_diagnostic *diag)
{
    double sum = 0, max = 0;
    for (int i = -n / 10; i < n; i++) {
        /* 0.9: drag and motion change the limit a little */
        uint64_t began = pal_clock_thread_ns();
        if (pal_world_step(b->world, 0.9 * pal_world_limit_s(b->world)))
            return pal_diagnostic_set(diag, PAL_ERR_FROZEN, "an explicit step failed");
        if (i < 0) continue;
        ms[i] = 1e-6 * (double)(pal_clock_thread_ns() - began) / pal_world_substeps(b->world);
        sum += iterations(b), max = fmax(max, iterations(b));
    }
    if (mean_cg) *mean_cg = sum / n;
    if (max_cg) *max_cg = max;
    return PAL_ERR_OK;
}

/* frames; ms of each */
static pal_err run_frames(body *b, int n, double *ms, int *n_sub, double *mean_cg, pal_diagnostic *diag)
{
    double sum = 0;
    for (int i = -2; i < n; i++) {
        uint64_t began = pal_clock_thread_ns();
        if (pal_world_step(b->world, frame_s)) return pal_diagnostic_set(diag, PAL_ERR_FROZEN, "a frame failed");
        if (i < 0) continue;
        ms[i] = 1e-6 * (double)(pal_clock_thread_ns() - began);
        sum += iterations(b);
        if (n_sub && pal_world_substeps(b->world) > *n_sub) *n_sub = pal_world_substeps(b->world);
    }
    if (mean_cg) *mean_cg = sum / n;
    return PAL_ERR_OK;
}

static void describe(const pal_cell_model *model, const body *b, result *out)
{
    const pal_body *of = pal_world_body(b->world, 0);
    out->model = model;
    out->n_cell = b->cells.n_cell, out->n_point = of->n_dof;
    out->n_element = pal_cell_elements_count(&of->model.solid->elements);
    for (pal_cell_kind k = 0; k < PAL_CELL_KINDS; k++)
        out->percent[k] = pal_cell_elements_percent(&of->model.solid->elements, k);
    for (size_t k = 0; k < sizeof paper / sizeof paper[0]; k++)
        if (!strcmp(paper[k].name, model->name)) out->paper_ms = paper[k].ms;
}

static pal_err measure(const pal_cell_model *model, result *out, pal_diagnostic *diag)
{
    static double ms[N_STEP];
    body b;
    *out = (result){0};
    pal_err err = make_body(model, &b, diag);
    for (int op = 0; op < OPERATORS && !err; op++) {
        err = start(model, operator_name[op], "central_cg", NULL, &b, diag);
        if (!err && op == 0) describe(model, &b, out);
        if (!err) err = run_steps(&b, N_STEP, ms, op ? NULL : &out->mean_cg, op ? NULL : &out->max_cg, diag);
        if (!err) out->step_ms[op] = pal_median(ms, N_STEP);
    }
    if (!err) err = start(model, operator_name[0], "central_cg", "diagonal", &b, diag);
    if (!err) err = run_steps(&b, N_STEP / 8, ms, &out->diagonal_cg, NULL, diag);
    if (!err) err = start(model, operator_name[0], "central_cg", NULL, &b, diag);
    if (!err) err = run_frames(&b, N_FRAME / 4, ms, &out->n_sub, NULL, diag);
    if (!err) out->explicit_ms = pal_median(ms, N_FRAME / 4);
    uint64_t began = pal_clock_thread_ns();
    if (!err) err = start(model, operator_name[0], "implicit_euler", NULL, &b, diag);
    out->make_ms = 1e-6 * (double)(pal_clock_thread_ns() - began);
    if (!err) err = run_frames(&b, N_FRAME, ms, NULL, &out->implicit_cg, diag);
    if (!err) out->implicit_ms = pal_median(ms, N_FRAME);
    if (!err && out->paper_ms > 0) out->ratio = out->paper_ms / out->step_ms[0];
    free_body(&b);
    return err;
}

static void add_case(bench_report *r, const result *c)
{
    const pal_cell_model *m = c->model;
    bool paper_has = c->paper_ms > 0;
    bench_record(r);
    bench_text(r, "name", "solid", -8, m->name);
    bench_number(r, "levels", "levels", 6, 0, m->n_level);
    bench_number(r, "cells", "#CC", 4, 0, c->n_cell);
    bench_number(r, "control_points", NULL, 0, 0, c->n_point);
    bench_number(r, "elements", "#FE", 5, 0, c->n_element);
    bench_number(r, "paper_elements", "paper", 5, 0, m->n_element);
    bench_number(r, "cubic_percent", "%cubic", 6, 0, c->percent[0]);
    bench_number(r, "linear_percent", "%linear", 7, 0, c->percent[1]);
    bench_number(r, "pyramid_percent", "%pyramid", 8, 0, c->percent[2]);
    bench_number(r, "paper_ms", "paper ms", 8, 0, paper_has ? c->paper_ms : NAN);
    bench_number(r, "polar_ms", "polar ms", 8, 3, c->step_ms[0]);
    bench_number(r, "edges_ms", "edges ms", 8, 3, c->step_ms[1]);
    bench_number(r, "ratio", "ratio", 6, 0, paper_has ? c->ratio : NAN);
    bench_number(r, "cg_mean", "CG mean", 7, 2, c->mean_cg);
    bench_number(r, "cg_max", "max", 4, 0, c->max_cg);
    bench_number(r, "cg_diagonal", "diagonal", 8, 1, c->diagonal_cg);
    bench_number(r, "substeps", "sub-steps", 9, 0, c->n_sub);
    bench_number(r, "explicit_frame_ms", "explicit ms", 11, 2, c->explicit_ms);
    bench_number(r, NULL, "speed", 6, 2, 1e3 * frame_s / c->explicit_ms);
    bench_number(r, "implicit_frame_ms", "implicit ms", 11, 3, c->implicit_ms);
    bench_number(r, NULL, "speed", 6, 1, 1e3 * frame_s / c->implicit_ms);
    bench_number(r, "implicit_cg", "CG", 5, 1, c->implicit_cg);
    bench_number(r, "implicit_make_ms", "make ms", 7, 0, c->make_ms);
}

int bench_solids(bool json)
{
    static result all[PAL_CELL_MODELS];
    pal_diagnostic diag = {""};
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < PAL_CELL_MODELS && !err; k++) err = measure(&pal_cell_model_list[k], &all[k], &diag);
    bench_report r;
    bench_begin(&r, "solids", json);
    bench_number(&r, "steps", NULL, 0, 0, N_STEP);
    bench_number(&r, "frames", NULL, 0, 0, N_FRAME);
    bench_number(&r, "frame_s", NULL, 0, 0, frame_s);
    bench_note(&r,
               "paper A, Table 1, one core; medians of %d iterations, of %d frames; CG: conjugate gradients in one "
               "iteration, with a factor and (as in the paper) with the diagonal",
               N_STEP, N_FRAME);
    bench_list(&r, "cases");
    for (int k = 0; k < PAL_CELL_MODELS && !err; k++) add_case(&r, &all[k]);
    for (int k = 0; k < PAL_CELL_MODELS && !err; k++)
        if (all[k].paper_ms > 0 && all[k].ratio < min_ratio)
            bench_note(&r, "%s: %.0f times the speed of the paper, wanted %.0f", all[k].model->name, all[k].ratio,
                       min_ratio);
    return bench_end(&r, err, &diag);
}
