/* Drawings of `palpate calibrate`: the search, the body, and the mesh for other tools. Pictures show the problem's
 * own surface, skinned to the nodes as in a live scene. */
#include "server/calibrate/calibrate_run.h"

#include "server/base/vec3.h"
#include "server/figure/body_picture.h"
#include "server/figure/plot.h"
#include "server/mesh/files/vtk_file.h"
#include "server/mesh/geometry/kd_tree.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TITLE = 120, TITLE_SHOWN = 48, MAX_DRAWN = 4000 };

/* Thins out a long search. Each drawn evaluation is the worst (error) or the best of those it represents. */
static int thin_out(const pal_calibrate_run *run, double *x, double *error, double *best)
{
    int step = (run->n_trail + MAX_DRAWN - 1) / MAX_DRAWN, n = 0;
    for (int from = 0; from < run->n_trail; from += step, n++) {
        int to = from + step < run->n_trail ? from + step : run->n_trail;
        x[n] = to;
        error[n] = NAN;
        for (int i = from; i < to; i++)
            if (run->trail[i][0] < DBL_MAX) error[n] = fmax(error[n], run->trail[i][0]);
        best[n] = run->trail[to - 1][1] < DBL_MAX ? run->trail[to - 1][1] : NAN;
    }
    return n;
}

pal_err pal_calibrate_draw_trajectory(const pal_calibrate_run *run, const char *path, pal_diagnostic *diag)
{
    char title[TITLE], label[80] = "evaluations";
    double *x = malloc(3 * ((size_t)MAX_DRAWN + 1) * sizeof *x), *error = x + MAX_DRAWN + 1,
           *best = error + MAX_DRAWN + 1;
    if (!x) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory", path);
    int n = thin_out(run, x, error, best);
    const char *name = run->set.problem->name;
    int room = TITLE_SHOWN;
    /* not inside a multi-byte character */
    while (strlen(name) > TITLE_SHOWN && room > 0 && ((unsigned char)name[room] & 0xc0) == 0x80) room--;
    snprintf(title, sizeof title, "%.*s%s: %s", room, name, strlen(name) > TITLE_SHOWN ? "..." : "",
             pal_calibrate_method(run));
    if (run->result.n_rejected > 0)
        snprintf(label, sizeof label, "evaluations (%lld without a rest are left out)",
                 (long long)run->result.n_rejected);
    const double hand = pal_calibrate_mean(run, &run->hand, true), edge[2] = {n > 0 ? x[0] : 0, n > 0 ? x[n - 1] : 1},
                 level[2] = {hand, hand};
    pal_plot plot = {.title = title,
                     .x_label = label,
                     .y_label = "RMS error, % of the largest displacement",
                     .log_y = true,
                     .n_curve = hand < DBL_MAX ? 3 : 2,
                     .curve = {{.name = "every evaluation", .n = n, .x = x, .y = error, .bare = true, .thin = true},
                               {.name = "best so far", .n = n, .x = x, .y = best, .bare = true},
                               {.name = "set by hand", .n = 2, .x = edge, .y = level, .bare = true, .dashed = true}}};
    pal_err err = pal_plot_write(&plot, path, diag);
    free(x);
    return err;
}

/* Truth at the nodes [n_node][3]. For samples: the mean of the four nearest, weighted by inverse squared distance,
 * which suffices for a picture. */
static pal_err truth_at_nodes(const pal_calibrate_run *run, int index, double *u, pal_diagnostic *diag)
{
    const pal_samples *s = &run->set.samples[index];
    const pal_tets *t = &run->info.mesh->tets;
    pal_kd_tree *tree;
    if (pal_calibration_truth(run->calibration, index, u)) return PAL_ERR_OK;
    if (pal_kd_tree_create(s->x, s->n, &tree))
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a picture");
    for (int i = 0; i < t->n_node; i++) {
        int32_t near[4];
        double x[3], distance2[4], sum = 0;
        pal_add3(x, t->x + 3 * i, t->origin_m);
        int n = pal_kd_tree_nearest(tree, x, 4, near, distance2);
        for (int c = 0; c < 3; c++) u[3 * i + c] = 0;
        for (int k = 0; k < n; k++) {
            double w = 1 / (distance2[k] + 1e-12 * t->edge_m * t->edge_m);
            pal_axpy3(u + 3 * i, w, s->u + 3 * near[k]);
            sum += w;
        }
        pal_scale3(u + 3 * i, 1 / sum, u + 3 * i);
    }
    pal_kd_tree_destroy(tree);
    return PAL_ERR_OK;
}

/* equilibrium of the springs with theta; zero and false: none found */
static bool springs_at_nodes(const pal_calibrate_run *run, const double *theta, int index, double *u)
{
    enum { ALL = PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY };
    pal_calibration_value value;
    bool good = !pal_calibration_evaluate(run->calibration, run->workspace, theta, ALL, &value, NULL, NULL) &&
                pal_calibration_displacement(run->calibration, run->workspace, index, u);
    if (!good) memset(u, 0, 3 * sizeof *u * (size_t)run->info.n_node);
    return good;
}

enum { REST, TRUTH, START, FOUND, N_SHAPE };

typedef struct drawing {
    const pal_calibrate_run *run;
    const pal_prepared *mesh;
    int n_vertex, n_node, index; /* index: of the case */
    pal_arena *arena;
    double *node_u[N_SHAPE], *node_x, *value; /* at the nodes */
    double *x[N_SHAPE], *distance[N_SHAPE];   /* of the surface [n_vertex][3]; to the truth [n_vertex] */
    double *k_d, *young;
    uint8_t *fixed;
    double *load_at, *load_N;
    int n_load;
    void *frames;
    float *shown;
} drawing;

static pal_err take_memory(drawing *d, pal_diagnostic *diag)
{
    pal_arena *arena = d->arena = pal_arena_create(1 << 20, true);
    if (!arena) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a picture");
    const int n = d->n_node, m = d->n_vertex;
    bool made = true;
    for (int k = 0; k < N_SHAPE; k++) {
        d->node_u[k] = PAL_NEW(arena, double, 3 * n);
        d->x[k] = PAL_NEW(arena, double, 3 * m);
        d->distance[k] = PAL_NEW(arena, double, m);
        made = made && d->node_u[k] && d->x[k] && d->distance[k];
    }
    double **const more[] = {&d->node_x, &d->value, &d->k_d, &d->young, &d->load_at, &d->load_N};
    const int size[] = {3 * n, n, m, m, 3 * n, 3 * n};
    for (int k = 0; k < 6; k++) made = (*more[k] = PAL_NEW(arena, double, size[k])) && made;
    d->fixed = PAL_NEW(arena, uint8_t, m);
    d->frames = pal_arena_alloc(arena, pal_skin_frames_bytes(&d->mesh->skin) + 64);
    d->shown = PAL_NEW(arena, float, 3 * m);
    made = made && d->fixed && d->frames && d->shown;
    return made ? PAL_ERR_OK : pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a picture");
}

/* nodal values to values at displayed vertices, by the skin weights */
static void skin_value(const drawing *d, const double *value, double *out)
{
    const pal_skin *s = &d->mesh->skin;
    for (int v = 0; v < d->n_vertex; v++) {
        out[v] = 0;
        for (int k = 0; k < PAL_SKIN_NEIGHBOURS; k++) {
            int at = PAL_SKIN_NEIGHBOURS * v + k;
            out[v] += (double)s->coef[4 * at + 3] * value[s->frame[s->near[at]]];
        }
    }
}

static void skin_shape(drawing *d, int which)
{
    const pal_tets *t = &d->mesh->tets;
    for (int i = 0; i < 3 * d->n_node; i++) d->node_x[i] = t->x[i] + d->node_u[which][i];
    pal_skin_frames(&d->mesh->skin, d->node_x, NULL, d->frames);
    pal_skin_evaluate(&d->mesh->skin, d->frames, NULL, d->shown);
    for (int i = 0; i < 3 * d->n_vertex; i++) d->x[which][i] = (double)d->shown[i];
    for (int i = 0; i < d->n_node; i++) d->value[i] = pal_dist3(d->node_u[which] + 3 * i, d->node_u[TRUTH] + 3 * i);
    skin_value(d, d->value, d->distance[which]);
}

static void take_loads(drawing *d)
{
    const double *f = d->run->info.force_N[d->index];
    for (int i = 0; i < d->n_node; i++) {
        if (!(pal_dot3(f + 3 * i, f + 3 * i) > 0)) continue;
        pal_copy3(d->load_at + 3 * d->n_load, d->mesh->tets.x + 3 * i);
        pal_copy3(d->load_N + 3 * d->n_load++, f + 3 * i);
    }
}

static void take_vertices(drawing *d)
{
    const pal_problem *p = d->run->set.problem;
    const pal_tets *t = &d->mesh->tets;
    const pal_support_def *support = d->run->info.support;
    for (int v = 0; v < d->n_vertex; v++) {
        const double *at = d->mesh->surface.x + 3 * v;
        double x[3];
        pal_add3(x, at, t->origin_m);
        const pal_problem_material *m = pal_case_material_at(p, x);
        d->young[v] = m ? m->young_Pa : p->material[0].young_Pa;
        for (int k = 0; k < d->run->info.n_support; k++) {
            bool in = true;
            for (int c = 0; c < 3; c++) in = in && at[c] >= support[k].low_m[c] && at[c] <= support[k].high_m[c];
            d->fixed[v] |= in;
        }
    }
    if (!d->run->info.grid) return;
    pal_calibration_constants(d->run->calibration, d->run->theta, 0, d->value);
    skin_value(d, d->value, d->k_d);
}

/* the body at rest with its loads, its truth, start and result */
static void add_shapes(drawing *d, pal_body_picture *to, char title[][TITLE])
{
    const pal_calibrate_run *run = d->run;
    const double percent[N_SHAPE] = {0, 0, run->start.case_percent[d->index], run->last.case_percent[d->index]};
    const char *truth = run->set.list[d->index].truth_name;
    double max = 0;
    for (int v = 0; v < d->n_vertex; v++) max = fmax(max, fmax(d->distance[START][v], d->distance[FOUND][v]));
    /* a unit that suits the distances */
    const char *unit = max >= 0.5 ? "m" : max >= 5e-4 ? "mm" : "um";
    double scale = max >= 0.5 ? 1 : max >= 5e-4 ? 1e3 : 1e6;
    snprintf(title[REST], TITLE, "at rest, load %.40s", run->set.id[d->index]);
    snprintf(title[TRUTH], TITLE, "truth: %.40s", truth ? truth : "finite elements");
    to[REST].n_load = d->n_load, to[REST].load_at = d->load_at, to[REST].load_N = d->load_N;
    for (int k = TRUTH; k < N_SHAPE; k++) to[k].x = d->x[k], to[k].rest = d->x[REST];
    for (int k = START; k < N_SHAPE; k++) {
        const char *what = k == START ? "springs, default start" : "springs, calibrated";
        if (percent[k] < DBL_MAX)
            snprintf(title[k], TITLE, "%s: %.2g %% RMS", what, percent[k]);
        else
            snprintf(title[k], TITLE, "%s: no rest", what);
        for (int v = 0; v < d->n_vertex; v++) d->distance[k][v] *= scale;
        to[k].value = d->distance[k], to[k].value_title = "distance to the truth", to[k].unit = unit;
    }
}

/* the map of constants beside the material it should resemble */
static void add_maps(const drawing *d, pal_body_picture *to, char title[][TITLE])
{
    const int *n = d->run->info.grid->n;
    snprintf(title[0], TITLE, "found on a grid of %d x %d x %d", n[0], n[1], n[2]);
    snprintf(title[1], TITLE, "stiffness of the material");
    to[0].value = d->k_d, to[0].value_title = "k_d of edges", to[0].unit = "J";
    to[1].value = d->young, to[1].value_title = "E", to[1].unit = "Pa";
    to[0].log = to[1].log = true;
}

static pal_err draw(drawing *d, const char *path, pal_diagnostic *diag)
{
    const pal_calibrate_run *run = d->run;
    const pal_surface *s = &d->mesh->surface;
    char title[N_SHAPE + 2][TITLE];
    pal_body_picture picture[N_SHAPE + 2];
    const int n = run->info.grid ? N_SHAPE + 2 : N_SHAPE;
    PAL_TRY(take_memory(d, diag));
    PAL_TRY(truth_at_nodes(run, d->index, d->node_u[TRUTH], diag));
    springs_at_nodes(run, run->info.start, d->index, d->node_u[START]);
    springs_at_nodes(run, run->theta, d->index, d->node_u[FOUND]);
    for (int k = 0; k < N_SHAPE; k++) skin_shape(d, k);
    take_loads(d);
    take_vertices(d);
    for (int k = 0; k < n; k++)
        picture[k] = (pal_body_picture){.title = title[k],
                                        .n_vertex = d->n_vertex,
                                        .n_tri = s->n_tri,
                                        .x = d->x[REST],
                                        .tri = s->tri,
                                        .fixed = d->fixed};
    add_shapes(d, picture, title);
    if (run->info.grid) add_maps(d, picture + N_SHAPE, title + N_SHAPE);
    return pal_body_picture_write(picture, n, path, diag);
}

pal_err pal_calibrate_draw_body(const pal_calibrate_run *run, const char *path, pal_diagnostic *diag)
{
    drawing d = {
        .run = run, .mesh = run->info.mesh, .n_vertex = run->info.mesh->skin.n_vertex, .n_node = run->info.n_node};
    while (!run->set.list[d.index].fit) d.index++;
    pal_err err = draw(&d, path, diag);
    pal_arena_destroy(d.arena);
    return err;
}

pal_err pal_calibrate_write_vtk(const pal_calibrate_run *run, const char *path, pal_diagnostic *diag)
{
    enum { MAX_FIELDS = PAL_SPRING_KINDS + 2 * PAL_CALIBRATE_CASES };
    pal_vtk_field field[MAX_FIELDS];
    char name[MAX_FIELDS][PAL_NAME + 16];
    const pal_tets *t = &run->info.mesh->tets;
    size_t n = (size_t)t->n_node;
    int n_field = 0;
    double *memory = calloc(n * (PAL_SPRING_KINDS + 6 * (size_t)run->set.n), sizeof *memory), *at = memory;
    if (!memory) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory", path);
    for (int k = 0; k < run->info.n_kind; k++, at += n) {
        snprintf(name[n_field], sizeof name[0], "%s", pal_calibrate_key(run, k, false));
        pal_calibration_constants(run->calibration, run->theta, k, at);
        field[n_field] = (pal_vtk_field){.name = name[n_field], .n_component = 1, .value = at};
        n_field++;
    }
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < 2 * run->set.n && !err; k++) {
        bool springs = k % 2;
        if (springs && !springs_at_nodes(run, run->theta, k / 2, at)) continue;
        if (!springs) err = truth_at_nodes(run, k / 2, at, diag);
        snprintf(name[n_field], sizeof name[0], springs ? "springs_%s_m" : "truth_%s_m", run->set.id[k / 2]);
        field[n_field] = (pal_vtk_field){.name = name[n_field], .n_component = 3, .value = at};
        n_field++, at += 3 * n;
    }
    const pal_vtk_grid grid = {.title = run->set.problem->name,
                               .n_node = t->n_node,
                               .n_element = t->n_tet,
                               .n_corner = 4,
                               .x = t->x,
                               .origin_m = t->origin_m,
                               .node = t->tet,
                               .n_point = n_field,
                               .point = field};
    if (!err) err = pal_mesh_write_vtk(path, &grid, diag);
    free(memory);
    return err;
}
