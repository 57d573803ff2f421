/* A body in a configuration: its world, its nodal loads, its points. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/solve/load_case.h"
#include "server/study/study_job.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* pieces of a triangle's side where the box of a load may cut it */
enum { CUTS = 12 };

void pal_study_close(pal_study_world *w)
{
    pal_locate_destroy(w->locate);
    pal_world_destroy(w->world);
    pal_configured_scene_free(w->set);
    *w = (pal_study_world){.set = NULL};
}

/* Removes what statics do not need; few Newton iterations per step, so that progress can be observed. */
static pal_err prepare_statics(pal_body_def *body, pal_diagnostic *diag)
{
    int kept = 0;
    for (int k = 0; k < body->n_effect; k++) {
        const pal_effect *effect = pal_effect_find(body->effect[k].name);
        bool tool = effect && effect->sleep.reach_m;
        if (!tool && !pal_study_is(body->effect[k].name, "finite_guard")) body->effect[kept++] = body->effect[k];
    }
    body->n_effect = kept;
    body->material.damping_1_s = 0;
    if (!pal_study_is(body->solver.name, "static_newton")) return PAL_ERR_OK;
    return pal_entry_put_number(&body->solver, "newton", 4, diag);
}

static pal_err find_points(const pal_study_job *job, pal_study_world *w)
{
    const pal_body *b = w->body;
    if (b->tets && !b->interpolation) return pal_locate_create(b->tets, b->n_corner == 8 ? b->hexes : NULL, &w->locate);
    w->surface = job->adaptive ? &job->scene->body[0].mesh->surface : b->display.surface;
    w->node = job->adaptive ? NULL : b->display.shown_node;
    return w->surface ? PAL_ERR_OK : PAL_ERR_INTERNAL;
}

pal_err pal_study_open(const pal_study_job *job, const pal_configuration *configuration, bool statics,
                       pal_study_world *out, pal_diagnostic *diag)
{
    *out = (pal_study_world){.set = NULL};
    double start = pal_clock_s();
    pal_err err = pal_configuration_make(job->scene, 0, configuration, diag, &out->set);
    if (!err && statics) err = prepare_statics(&out->set->scene.body[0], diag);
    if (!err) err = pal_world_create(&out->set->scene, diag, &out->world);
    if (!err) {
        out->prepare_s = pal_clock_s() - start;
        out->body = pal_world_body(out->world, 0);
        out->body->load_cap_N = INFINITY;
        err = find_points(job, out);
        if (err) pal_diagnostic_set(diag, err, "no memory to find points in the mesh");
    }
    if (err) pal_study_close(out);
    return err;
}

static int32_t node_of(const pal_study_world *w, int vertex)
{
    return w->node ? w->node[vertex] : vertex;
}

static void corners(const pal_surface *s, int tri, const double *x[3])
{
    for (int c = 0; c < 3; c++) x[c] = s->x + 3 * (size_t)s->tri[3 * tri + c];
}

/* Shares of the corners in the part of a triangle inside a box, by the midpoints of equal small triangles, m^2. */
static void triangle_shares(const double *x[3], const double low[3], const double high[3], double share[3])
{
    double e[2][3], n[3];
    pal_sub3(e[0], x[1], x[0]);
    pal_sub3(e[1], x[2], x[0]);
    pal_cross3(n, e[0], e[1]);
    double piece = pal_norm3(n) / 2 / (CUTS * CUTS);
    pal_set3(share, 0, 0, 0);
    for (int i = 0; i < CUTS; i++)
        for (int j = 0; j < CUTS - i; j++)
            for (int up = 0; up < 2 && i + j + up < CUTS; up++) {
                double u = (i + (up ? 2.0 : 1.0) / 3) / CUTS, v = (j + (up ? 2.0 : 1.0) / 3) / CUTS, at[3];
                bool in = true;
                for (int c = 0; c < 3; c++) {
                    at[c] = x[0][c] + u * e[0][c] + v * e[1][c];
                    in = in && at[c] >= low[c] && at[c] <= high[c];
                }
                if (in) share[0] += piece * (1 - u - v), share[1] += piece * u, share[2] += piece * v;
            }
}

/* Distributes a traction over the vertices of a surface. A total force is divided by the area found. */
static pal_err surface_traction(const pal_study_world *w, const pal_problem_load *load, const char *name, double *f,
                                pal_diagnostic *diag)
{
    const pal_surface *s = w->surface;
    double low[3], high[3], area = 0, *share = calloc((size_t)s->n_vertex, sizeof *share);
    if (!share) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for loads");
    pal_sub3(low, load->region.low_m, s->origin_m);
    pal_sub3(high, load->region.high_m, s->origin_m);
    for (int t = 0; t < s->n_tri; t++) {
        const double *x[3];
        double part[3];
        bool meets = true;
        corners(s, t, x);
        for (int c = 0; c < 3; c++) {
            meets = meets && !(fmin(x[0][c], fmin(x[1][c], x[2][c])) > high[c]);
            meets = meets && !(fmax(x[0][c], fmax(x[1][c], x[2][c])) < low[c]);
        }
        if (!meets) continue;
        triangle_shares(x, low, high, part);
        for (int c = 0; c < 3; c++) share[s->tri[3 * t + c]] += part[c], area += part[c];
    }
    for (int i = 0; i < s->n_vertex && area > 0; i++)
        for (int c = 0; c < 3; c++)
            f[3 * node_of(w, i) + c] +=
                share[i] * (load->has_traction ? load->traction_Pa[c] : load->total_N[c] / area);
    free(share);
    return area > 0 ? PAL_ERR_OK : PAL_REFUSE(diag, "load \"%s\" meets no surface", name);
}

static pal_err surface_forces(const pal_study_world *w, const pal_problem_case *load, double *f, pal_diagnostic *diag)
{
    for (int k = 0; k < load->n_load; k++) {
        const pal_problem_load *l = &load->load[k];
        if (l->kind == PAL_LOAD_TRACTION) PAL_TRY(surface_traction(w, l, load->id, f, diag));
        if (l->kind == PAL_LOAD_POINT) return PAL_REFUSE(diag, "load \"%s\": stands on a point", load->id);
        for (int i = 0; i < w->body->n_node && l->kind == PAL_LOAD_GRAVITY; i++)
            pal_axpy3(f + 3 * i, w->body->node_mass_kg[i], l->gravity_m_s2);
    }
    return PAL_ERR_OK;
}

pal_err pal_study_forces(const pal_study_job *job, const pal_study_world *w, const pal_problem_case *load,
                         double *force_N, pal_diagnostic *diag)
{
    memset(force_N, 0, 3 * sizeof *force_N * (size_t)w->body->n_node);
    if (!w->locate) return surface_forces(w, load, force_N, diag);
    return pal_case_forces(job->problem, load, -1, w->body, w->locate, &w->set->scene.body[0].mesh->surface, force_N,
                           NULL, diag);
}

pal_err pal_study_apply_load(const pal_study_job *job, const pal_study_world *w, const pal_problem_case *load,
                             double share, pal_diagnostic *diag)
{
    size_t n = (size_t)w->body->n_node;
    double *f = calloc(3 * n, sizeof *f);
    if (!f) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for loads");
    pal_err err = pal_study_forces(job, w, load, f, diag);
    for (size_t i = 0; i < n && !err; i++) {
        pal_scale3(f + 3 * i, share, f + 3 * i);
        if (pal_norm3(f + 3 * i) > 0) err = pal_world_load(w->world, 0, (int)i, f + 3 * i);
    }
    free(f);
    return err;
}

static void node_displacement_m(const pal_body *b, int node, double share, double u[3])
{
    pal_axpy3(u, share, b->d + 3 * (size_t)node);
    pal_axpy3(u, -share, b->node_rest + 3 * (size_t)node);
}

/* Projects a point onto the plane of a triangle and clamps it to the triangle. share: weights of the corners.
 * Returns the distance. */
static double foot(const double *x[3], const double at[3], double share[3])
{
    double a[3], b[3], p[3], near[3];
    pal_sub3(a, x[1], x[0]);
    pal_sub3(b, x[2], x[0]);
    pal_sub3(p, at, x[0]);
    double aa = pal_dot3(a, a), ab = pal_dot3(a, b), bb = pal_dot3(b, b), pa = pal_dot3(p, a), pb = pal_dot3(p, b);
    double d = aa * bb - ab * ab, u = d > 0 ? (bb * pa - ab * pb) / d : 0, v = d > 0 ? (aa * pb - ab * pa) / d : 0;
    u = fmin(fmax(u, 0), 1), v = fmin(fmax(v, 0), 1);
    if (u + v > 1) u /= u + v, v = 1 - u;
    pal_set3(share, 1 - u - v, u, v);
    for (int c = 0; c < 3; c++) near[c] = x[0][c] + u * a[c] + v * b[c];
    return pal_dist3(near, at);
}

static void surface_point(const pal_study_world *w, const double at[3], double u[3])
{
    const pal_surface *s = w->surface;
    int nearest = 0, found = -1;
    double min = INFINITY, share[3], best[3] = {1, 0, 0};
    for (int i = 0; i < s->n_vertex; i++) {
        double d = pal_dist3(s->x + 3 * (size_t)i, at);
        if (d < min) min = d, nearest = i;
    }
    min = INFINITY;
    for (int t = 0; t < s->n_tri; t++) {
        const double *x[3];
        const int32_t *tri = s->tri + 3 * (size_t)t;
        if (tri[0] != nearest && tri[1] != nearest && tri[2] != nearest) continue;
        corners(s, t, x);
        double d = foot(x, at, share);
        if (d >= min) continue;
        min = d, found = t;
        pal_copy3(best, share);
    }
    pal_set3(u, 0, 0, 0);
    for (int c = 0; c < 3 && found >= 0; c++)
        node_displacement_m(w->body, node_of(w, s->tri[3 * found + c]), best[c], u);
    if (found < 0) node_displacement_m(w->body, node_of(w, nearest), 1, u);
}

pal_err pal_study_displacement(const pal_study_world *w, const double *x, int n, double *u, pal_diagnostic *diag)
{
    if (!pal_body_finite(w->body)) return pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "numbers that are not finite");
    pal_body_update_nodes(w->body);
    for (int i = 0; i < n; i++) {
        double local[4], shape[10], *to = u + 3 * (size_t)i;
        const int32_t *node;
        if (!w->locate) {
            surface_point(w, x + 3 * (size_t)i, to);
            continue;
        }
        int element = pal_locate_point(w->locate, x + 3 * (size_t)i, local, NULL);
        int n_corner = pal_case_shape_functions(w->body, element, local, shape, &node);
        pal_set3(to, 0, 0, 0);
        for (int k = 0; k < n_corner; k++) node_displacement_m(w->body, node[k], shape[k], to);
    }
    return PAL_ERR_OK;
}
