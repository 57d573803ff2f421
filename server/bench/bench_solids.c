/* palpate bench solids: subdivided solids as finite elements against Table 1 of paper A, on one core.
 *
 * Our own stand-ins for its eight solids, with as many control cells and its levels of subdivision (A does not print
 * their cells; the two blocks are the same), and a kidney. One iteration is one explicit step of central_cg as A 3.3
 * has it: elastic forces of all elements, gravity, drag, and the mass matrix by conjugate gradients to 1e-4, for both
 * operators of the row cell_elastic; median over steps of the motion from rest. Those of the paper ran on a Pentium 4
 * of 2.8 GHz. A frame is 1/60 s of the default tissue (E 5 kPa, nu 0.45): so many sub-steps of central_cg, or one step
 * of implicit_euler, which bends under gravity while it is measured. Speed: seconds simulated in one of processor time.
 */
#include "server/bench/bench.h"

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
static const double least_ratio = 100;

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

static pal_err take(const pal_cell_model *model, body *b, pal_diagnostic *diag)
{
    pal_surface surface = {0};
    memset(b, 0, sizeof *b);
    b->scene = calloc(1, sizeof *b->scene);
    if (!b->scene) return PAL_ERR_MEMORY;
    PAL_TRY(pal_cell_model_make(model, &b->cells, diag));
    pal_err err = pal_cells_boundary(&b->cells, &surface, NULL, NULL);
    if (!err) err = pal_prepared_surface(&surface, &b->mesh);
    pal_surface_free(&surface);
    return err;
}

static void leave(body *b)
{
    pal_world_destroy(b->world);
    pal_prepared_free(&b->mesh);
    pal_cells_free(&b->cells);
    free(b->scene);
}

/* a world of the solid under gravity, the lowest part held */
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

/* n explicit steps of one sub-step each, after as many as it takes to begin; ms of each, iterations */
static pal_err run_steps(body *b, int n, double *ms, double *mean_cg, double *max_cg, pal_diagnostic *diag)
{
    double sum = 0, most = 0;
    for (int i = -n / 10; i < n; i++) {
        /* drag and motion change the limit by little */
        uint64_t began = pal_clock_thread_ns();
        if (pal_world_step(b->world, 0.9 * pal_world_limit_s(b->world)))
            return pal_diagnostic_set(diag, PAL_ERR_FROZEN, "an explicit step failed");
        if (i < 0) continue;
        ms[i] = 1e-6 * (double)(pal_clock_thread_ns() - began) / pal_world_substeps(b->world);
        sum += iterations(b), most = fmax(most, iterations(b));
    }
    if (mean_cg) *mean_cg = sum / n;
    if (max_cg) *max_cg = most;
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
    pal_err err = take(model, &b, diag);
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
    leave(&b);
    return err;
}

/* ---- out ---- */

static void print_paper(double ms)
{
    if (ms > 0)
        printf("%8.0f ", ms);
    else
        printf("%8s ", "");
}

static void print_table(const result *r)
{
    printf("Table 1 of paper A, one core; medians of %d iterations, of %d frames; CG: iterations an iteration, with a "
           "factor and (the paper's way) without\n",
           N_STEP, N_FRAME);
    printf("solid    levels  #CC  #FE here paper  %%cubic  %%linear  %%pyramid  paper ms  ms here  ms edges   ratio  "
           "CG mean  most  diagonal  frame: sub-steps        ms    speed  implicit ms   speed    CG  made ms\n");
    for (int k = 0; k < PAL_CELL_MODELS; k++) {
        const pal_cell_model *m = r[k].model;
        printf("%-8s %6d %4d %9d %5d %7.0f %8.0f %9.0f  ", m->name, m->n_level, r[k].n_cell, r[k].n_element,
               m->n_element, r[k].percent[0], r[k].percent[1], r[k].percent[2]);
        print_paper(r[k].paper_ms);
        printf("%8.3f %9.3f ", r[k].step_ms[0], r[k].step_ms[1]);
        print_paper(r[k].ratio);
        printf("%7.2f %5.0f %9.1f %17d %9.2f %8.2f %12.3f %7.1f %5.1f %8.0f\n", r[k].mean_cg, r[k].max_cg,
               r[k].diagonal_cg, r[k].n_sub, r[k].explicit_ms, 1e3 * frame_s / r[k].explicit_ms, r[k].implicit_ms,
               1e3 * frame_s / r[k].implicit_ms, r[k].implicit_cg, r[k].make_ms);
    }
    for (int k = 0; k < PAL_CELL_MODELS; k++)
        if (r[k].paper_ms > 0 && r[k].ratio < least_ratio)
            printf("%s: %.0f times the paper's speed, wanted %.0f\n", r[k].model->name, r[k].ratio, least_ratio);
}

static void print_json(const result *r)
{
    printf("{\"bench\":\"solids\",\"steps\":%d,\"frames\":%d,\"frame_s\":%.9f,\"cases\":[", N_STEP, N_FRAME, frame_s);
    for (int k = 0; k < PAL_CELL_MODELS; k++) {
        const pal_cell_model *m = r[k].model;
        printf("%s{\"name\":\"%s\",\"levels\":%d,\"cells\":%d,\"points\":%d,\"elements\":%d,\"paper_elements\":%d,"
               "\"cubic_percent\":%.1f,\"linear_percent\":%.1f,\"pyramid_percent\":%.1f,\"paper_ms\":%.0f,"
               "\"polar_ms\":%.4f,\"edges_ms\":%.4f,\"ratio\":%.1f,\"cg_mean\":%.2f,\"cg_most\":%.0f,"
               "\"cg_diagonal\":%.2f,\"substeps\":%d,\"explicit_frame_ms\":%.3f,\"implicit_frame_ms\":%.4f,"
               "\"implicit_cg\":%.2f,\"implicit_make_ms\":%.1f}",
               k ? "," : "", m->name, m->n_level, r[k].n_cell, r[k].n_point, r[k].n_element, m->n_element,
               r[k].percent[0], r[k].percent[1], r[k].percent[2], r[k].paper_ms, r[k].step_ms[0], r[k].step_ms[1],
               r[k].ratio, r[k].mean_cg, r[k].max_cg, r[k].diagonal_cg, r[k].n_sub, r[k].explicit_ms, r[k].implicit_ms,
               r[k].implicit_cg, r[k].make_ms);
    }
    printf("]}\n");
}

int bench_solids(bool json)
{
    result r[PAL_CELL_MODELS];
    pal_diagnostic diag = {{0}};
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < PAL_CELL_MODELS && !err; k++) err = measure(&pal_cell_model_list[k], &r[k], &diag);
    if (err) {
        fprintf(stderr, "palpate bench: solids: %s\n", diag.text[0] ? diag.text : pal_err_text(err));
        return err == PAL_ERR_MEMORY ? 3 : 1;
    }
    if (json)
        print_json(r);
    else
        print_table(r);
    return 0;
}
