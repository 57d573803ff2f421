/* Statics of springs.
 *
 * Newton's direction uses the true Hessian where that is positive definite. Compressed springs have a negative
 * transverse stiffness; where the Hessian is indefinite, the possibly negative parts are omitted. This keeps g g'
 * of every spring and the transverse stiffness of stretched edges, which is positive semi-definite. If the result
 * is still singular, a growing multiple of its diagonal is added. The line search requires a lower energy. Near
 * convergence, where the energy change is lost in rounding, it requires a smaller residual. */
#include "server/calibrate/equilibrium.h"

#include "server/calibrate/tuning.h"
#include "server/num/cholesky.h"
#include "server/sim/springs/spring_constraint.h"
#include "server/sim/springs/spring_set.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_NEWTON = 60, MAX_HALVING = 30, MAX_SHIFT = 8 };

struct pal_equilibrium_workspace {
    const pal_lattice *lattice;
    pal_block_matrix matrix; /* pattern borrowed, values owned */
    pal_cholesky *factor;
    double *f, *p, *r, *trial; /* [n_node][3] */
};

/* ---- lattice ---- */

static pal_err copy_springs(const pal_spring_set *from, pal_lattice *to)
{
    pal_springs *s = &to->kind[from->spring.kind];
    const int n = from->n_item, n_corner = from->n_corner;
    *s = (pal_springs){.n_item = n,
                       .n_corner = n_corner,
                       .item = PAL_NEW(to->arena, int32_t, (size_t)n * (size_t)n_corner),
                       .w = PAL_NEW(to->arena, double, n),
                       .q = PAL_NEW(to->arena, double, n),
                       .block = PAL_NEW(to->arena, int32_t, n * n_corner * (n_corner + 1) / 2)};
    if (!s->item || !s->w || !s->q || !s->block) return PAL_ERR_MEMORY;
    memcpy(s->item, from->item, sizeof *s->item * (size_t)n * (size_t)n_corner);
    for (int i = 0; i < n; i++) {
        s->w[i] = from->w[from->simd_blocks.place[i]];
        s->q[i] = from->q[from->simd_blocks.place[i]];
    }
    return PAL_ERR_OK;
}

static pal_err make_pattern(pal_lattice *l)
{
    pal_cliques list[PAL_SPRING_KINDS];
    int n_list = 0;
    for (int k = 0; k < PAL_SPRING_KINDS; k++)
        if (l->kind[k].n_item > 0)
            list[n_list++] = (pal_cliques){l->kind[k].n_item, l->kind[k].n_corner, l->kind[k].item};
    PAL_TRY(pal_block_matrix_make(l->n_node, list, n_list, l->arena, &l->pattern));
    for (int k = 0; k < PAL_SPRING_KINDS; k++) {
        pal_springs *s = &l->kind[k];
        int32_t *block = s->block;
        for (int i = 0; i < s->n_item; i++) {
            const int32_t *node = s->item + s->n_corner * i;
            for (int a = 0; a < s->n_corner; a++)
                for (int b = 0; b <= a; b++) {
                    bool low = node[a] >= node[b];
                    int at = pal_block_matrix_find(&l->pattern, low ? node[a] : node[b], low ? node[b] : node[a]);
                    *block++ = low ? at : ~at;
                }
        }
    }
    return PAL_ERR_OK;
}

static pal_err take(const pal_world *world, const pal_body *body, pal_lattice *out)
{
    static const char *const name[PAL_SPRING_KINDS] = {"edge_distance", "face_area", "tet_volume"};
    size_t n = (size_t)body->n_node;
    out->n_node = body->n_node;
    out->edge_m = body->edge_m;
    out->x_rest = PAL_NEW(out->arena, double, 3 * n);
    out->fixed = PAL_NEW(out->arena, uint8_t, n);
    if (!out->x_rest || !out->fixed) return PAL_ERR_MEMORY;
    memcpy(out->x_rest, body->x_rest, 3 * n * sizeof(double));
    for (size_t i = 0; i < n; i++) {
        out->fixed[i] = body->support[i] != PAL_FREE;
        out->n_free += !out->fixed[i];
    }
    for (int r = 0; r < pal_world_component_count(world); r++) {
        pal_component_info info;
        pal_world_component_info(world, r, &info);
        for (int k = 0; k < PAL_SPRING_KINDS; k++)
            if (!strcmp(info.name, name[k]) && !strcmp(info.body, body->name))
                PAL_TRY(copy_springs(pal_world_component(world, r)->self, out));
    }
    return out->kind[PAL_SPRING_DISTANCE].n_item > 0 ? make_pattern(out) : PAL_ERR_OK;
}

pal_err pal_lattice_make(const pal_world *world, int body, pal_lattice *out, pal_diagnostic *diag)
{
    /* the body is only read here */
    const pal_body *b = pal_world_body((pal_world *)(uintptr_t)world, body);
    *out = (pal_lattice){.arena = pal_arena_create(1 << 20, true)};
    pal_err err = out->arena ? take(world, b, out) : PAL_ERR_MEMORY;
    if (err)
        pal_diagnostic_set(diag, err, "body \"%s\": no memory for %d nodes", b->name, b->n_node);
    else if (out->kind[PAL_SPRING_DISTANCE].n_item == 0)
        err = PAL_REFUSE(diag, "body \"%s\": has no edge springs", b->name);
    else if (out->n_free == out->n_node)
        err = PAL_REFUSE(diag, "body \"%s\": nothing holds it against its loads", b->name);
    else if (out->n_free == 0)
        err = PAL_REFUSE(diag, "body \"%s\": all of its %d nodes are held", b->name, b->n_node);
    if (err) pal_lattice_free(out);
    return err;
}

void pal_lattice_free(pal_lattice *lattice)
{
    pal_arena_destroy(lattice->arena);
    *lattice = (pal_lattice){0};
}

/* ---- workspace ---- */

pal_err pal_equilibrium_workspace_create(const pal_lattice *lattice, pal_equilibrium_workspace **out)
{
    size_t n = 3 * (size_t)lattice->n_node, n_block = (size_t)lattice->pattern.start[lattice->n_node];
    pal_equilibrium_workspace *s = calloc(1, sizeof *s);
    if (!s) return PAL_ERR_MEMORY;
    s->lattice = lattice;
    s->matrix = lattice->pattern;
    s->matrix.value = calloc(9 * n_block, sizeof(double));
    s->f = calloc(4 * n, sizeof(double));
    pal_err err =
        s->matrix.value && s->f ? pal_cholesky_create(&lattice->pattern, lattice->fixed, &s->factor) : PAL_ERR_MEMORY;
    if (err) {
        pal_equilibrium_workspace_destroy(s);
        return err;
    }
    s->p = s->f + n, s->r = s->p + n, s->trial = s->r + n;
    *out = s;
    return PAL_ERR_OK;
}

void pal_equilibrium_workspace_destroy(pal_equilibrium_workspace *workspace)
{
    if (!workspace) return;
    pal_cholesky_destroy(workspace->factor);
    free(workspace->matrix.value);
    free(workspace->f);
    free(workspace);
}

/* ---- energy, force, Hessian ---- */

static void corners_of(const pal_springs *s, const double *x, int i, const double *to[PAL_CORNERS])
{
    for (int c = 0; c < PAL_CORNERS; c++) to[c] = x + 3 * s->item[s->n_corner * i + (c < s->n_corner ? c : 0)];
}

PAL_INLINE double force_of(const pal_springs *s, pal_spring_kind kind, const double *k_J, const double *x, double *f)
{
    double sum = 0;
    const int n_corner = pal_spring_corner_count(kind);
    for (int i = 0; i < s->n_item; i++) {
        const double *at[PAL_CORNERS];
        pal_constraint shape;
        corners_of(s, x, i, at);
        pal_spring_constraint(kind, at, s->w[i], &shape);
        double k = s->q[i] * k_J[i];
        sum += 0.5 * k * shape.c * shape.c;
        for (int c = 0; c < n_corner && f; c++) pal_axpy3(f + 3 * s->item[n_corner * i + c], -k * shape.c, shape.g[c]);
    }
    return sum;
}

double pal_lattice_force(const pal_lattice *l, const double *const k_J[PAL_SPRING_KINDS], const double *x,
                         double *force_N)
{
    if (force_N) memset(force_N, 0, 3 * sizeof(double) * (size_t)l->n_node);
    double sum = 0;
    for (int k = 0; k < PAL_SPRING_KINDS; k++) sum += force_of(&l->kind[k], (pal_spring_kind)k, k_J[k], x, force_N);
    return sum;
}

typedef enum hessian { TRUE_HESSIAN, SAFE_HESSIAN, REST_STIFFNESS } hessian;

PAL_INLINE void add_block(pal_block_matrix *a, int32_t block, const double m[9])
{
    double *to = a->value + 9 * (size_t)(block < 0 ? ~block : block);
    if (block >= 0)
        for (int i = 0; i < 9; i++) to[i] += m[i];
    else
        for (int i = 0; i < 9; i++) to[i] += m[3 * (i % 3) + i / 3];
}

PAL_INLINE void stiffness_of(const pal_springs *s, pal_spring_kind kind, const double *k_J, const double *x,
                             hessian which, pal_block_matrix *a)
{
    const int n_corner = pal_spring_corner_count(kind);
    const int32_t *block = s->block;
    for (int i = 0; i < s->n_item; i++) {
        const double *at[PAL_CORNERS];
        pal_constraint shape;
        double h[4][4][9], m[9];
        corners_of(s, x, i, at);
        pal_spring_constraint(kind, at, s->w[i], &shape);
        double k = s->q[i] * k_J[i], bend = k * shape.c;
        bool bends = which == TRUE_HESSIAN || (which == SAFE_HESSIAN && kind == PAL_SPRING_DISTANCE && shape.c > 0);
        if (bends) pal_spring_constraint_hessian(kind, at, s->w[i], h);
        for (int p = 0; p < n_corner; p++)
            for (int q = 0; q <= p; q++) {
                for (int r = 0; r < 9; r++)
                    m[r] = k * shape.g[p][r / 3] * shape.g[q][r % 3] + (bends ? bend * h[p][q][r] : 0);
                add_block(a, *block++, m);
            }
    }
}

static void assemble(pal_equilibrium_workspace *workspace, const double *const k_J[PAL_SPRING_KINDS], const double *x,
                     hessian which)
{
    const pal_lattice *l = workspace->lattice;
    pal_block_matrix_zero(&workspace->matrix);
    for (int k = 0; k < PAL_SPRING_KINDS; k++)
        stiffness_of(&l->kind[k], (pal_spring_kind)k, k_J[k], x, which, &workspace->matrix);
}

/* ---- Newton ---- */

typedef struct search {
    pal_equilibrium_workspace *workspace;
    const double *const *k_J;
    const double *force_N;
    const pal_equilibrium_options *o;
    pal_equilibrium_report *report;
    pal_diagnostic *diag;
} search;

static double dot(const pal_lattice *l, const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < l->n_node; i++)
        if (!l->fixed[i]) sum += pal_dot3(a + 3 * i, b + 3 * i);
    return sum;
}

static double norm(const pal_lattice *l, const double *v)
{
    return sqrt(dot(l, v, v));
}

/* r = f - grad W at the free nodes, 0 at fixed ones; returns W - f.(x - rest) */
static double residual(const search *s, const double *x, double *r)
{
    const pal_lattice *l = s->workspace->lattice;
    double energy = pal_lattice_force(l, s->k_J, x, r);
    for (int i = 0; i < l->n_node; i++) {
        if (l->fixed[i]) {
            pal_set3(r + 3 * i, 0, 0, 0);
            continue;
        }
        double u[3];
        pal_sub3(u, x + 3 * i, l->x_rest + 3 * i);
        energy -= pal_dot3(s->force_N + 3 * i, u);
        pal_add3(r + 3 * i, r + 3 * i, s->force_N + 3 * i);
    }
    return energy;
}

static pal_err factor_at(const search *s, const double *x)
{
    pal_equilibrium_workspace *workspace = s->workspace;
    assemble(workspace, s->k_J, x, s->o->linear ? REST_STIFFNESS : TRUE_HESSIAN);
    pal_err err = pal_cholesky_factor(workspace->factor, &workspace->matrix, false);
    if (err != PAL_ERR_NUMERIC || s->o->linear) return err;
    s->report->n_shift++;
    double share = 0;
    for (int k = 0; k < MAX_SHIFT && err == PAL_ERR_NUMERIC; k++) {
        pal_block_matrix *a = &workspace->matrix;
        assemble(workspace, s->k_J, x, SAFE_HESSIAN);
        /* adds a share of the diagonal to it */
        for (int j = 0; j < a->n && share > 0; j++)
            for (int c = 0; c < 3; c++) a->value[9 * (size_t)a->start[j] + 4 * (size_t)c] *= 1 + share;
        share = share > 0 ? 10 * share : 1e-8;
        err = pal_cholesky_factor(workspace->factor, &workspace->matrix, false);
    }
    return err;
}

/* longest edge over its length at rest */
static double stretch_of(const pal_lattice *l, const double *x)
{
    const pal_springs *s = &l->kind[PAL_SPRING_DISTANCE];
    double max = 0;
    for (int i = 0; i < s->n_item; i++)
        max = fmax(max, s->w[i] * pal_dist3(x + 3 * s->item[2 * i], x + 3 * s->item[2 * i + 1]));
    return max;
}

/* x += step p with the largest of 1, 1/2, 1/4 ... that lowers the energy, or the residual where energies are equal.
 * Updates energy and r. False: none does. */
static bool advance(const search *s, double *x, double *energy, double *size)
{
    pal_equilibrium_workspace *workspace = s->workspace;
    const pal_lattice *l = workspace->lattice;
    size_t n = 3 * (size_t)l->n_node;
    double slope = -dot(l, workspace->r, workspace->p), scale = fabs(*energy) + s->report->energy_J, step = 1;
    if (!(slope < 0)) return false;
    for (int k = 0; k < MAX_HALVING; k++, step *= 0.5) {
        for (size_t i = 0; i < n; i++) workspace->trial[i] = x[i] + step * workspace->p[i];
        double e = residual(s, workspace->trial, workspace->f), there = norm(l, workspace->f);
        bool alike = fabs(step * slope) < 1e-11 * scale;
        bool lower = alike ? there < *size : e <= *energy + 1e-4 * step * slope;
        if (!isfinite(e) || !isfinite(there) || !lower) continue;
        memcpy(x, workspace->trial, n * sizeof(double));
        memcpy(workspace->r, workspace->f, n * sizeof(double));
        *energy = e;
        *size = there;
        return true;
    }
    return false;
}

/* rounding error of the spring forces at rest, N: the target for a body without loads */
static double rounding(const search *s)
{
    const pal_springs *edge = &s->workspace->lattice->kind[PAL_SPRING_DISTANCE];
    double max = 0;
    for (int i = 0; i < edge->n_item; i++)
        max = fmax(max, edge->q[i] * edge->w[i] * fabs(s->k_J[PAL_SPRING_DISTANCE][i]));
    return 1e-14 * sqrt(s->workspace->lattice->n_free) * max;
}

static pal_err newton(const search *s, double *x)
{
    pal_equilibrium_workspace *workspace = s->workspace;
    const pal_lattice *l = workspace->lattice;
    double load = norm(l, s->force_N),
           target = load > 0 ? (s->o->tolerance > 0 ? s->o->tolerance : PAL_EQUILIBRIUM_TOLERANCE) * load : rounding(s);
    double energy = residual(s, x, workspace->r), size = norm(l, workspace->r);
    bool stable = false;
    for (int k = 0;; k++) {
        s->report->residual = load > 0 ? size / load : size;
        if (!isfinite(size))
            return pal_diagnostic_set(s->diag, PAL_ERR_NUMERIC, "no rest: not finite at iteration %d", k);
        if (size <= target && stable) return PAL_ERR_OK;
        if (k == MAX_NEWTON)
            return pal_diagnostic_set(s->diag, PAL_ERR_NUMERIC, "no rest within %d iterations: residual %.2g", k,
                                      s->report->residual);
        int shifted = s->report->n_shift;
        pal_err err = factor_at(s, x);
        if (err) return pal_diagnostic_set(s->diag, err, "no rest: iteration %d, no factor (%s)", k, pal_err_text(err));
        stable = s->report->n_shift == shifted;
        if (size <= target)
            return stable ? PAL_ERR_OK
                          : pal_diagnostic_set(s->diag, PAL_ERR_NUMERIC, "the rest found is not stable (a saddle)");
        PAL_TRY(pal_cholesky_solve(workspace->factor, workspace->r, workspace->p));
        s->report->n_newton++;
        if (!advance(s, x, &energy, &size)) {
            if (size <= 1e3 * target && stable) return PAL_ERR_OK; /* limited by rounding */
            return pal_diagnostic_set(s->diag, PAL_ERR_NUMERIC,
                                      "no rest: no step lowers the energy at a residual of %.2g", s->report->residual);
        }
        if (stretch_of(l, x) > PAL_MAX_STRETCH)
            return pal_diagnostic_set(s->diag, PAL_ERR_NUMERIC, "no rest: an edge is stretched more than %g times",
                                      PAL_MAX_STRETCH);
    }
}

static pal_err linear(const search *s, double *x)
{
    pal_equilibrium_workspace *workspace = s->workspace;
    const pal_lattice *l = workspace->lattice;
    pal_err err = factor_at(s, l->x_rest);
    if (!err) err = pal_cholesky_solve(workspace->factor, s->force_N, workspace->p);
    if (err) return pal_diagnostic_set(s->diag, err, "no rest: no factor at rest (%s)", pal_err_text(err));
    if (!isfinite(norm(l, workspace->p))) return pal_diagnostic_set(s->diag, PAL_ERR_NUMERIC, "no rest: not finite");
    /* the factor is inaccurate for constants of very different magnitude */
    double load = norm(l, s->force_N);
    memcpy(workspace->r, s->force_N, 3 * sizeof(double) * (size_t)l->n_node);
    pal_block_matrix_multiply(&workspace->matrix, -1, workspace->p, workspace->r);
    s->report->residual = load > 0 ? norm(l, workspace->r) / load : 0;
    if (!(s->report->residual < PAL_LINEAR_RESIDUAL))
        return pal_diagnostic_set(s->diag, PAL_ERR_NUMERIC, "no rest: the linear system keeps a residual of %.2g",
                                  s->report->residual);
    for (int i = 0; i < 3 * l->n_node; i++) x[i] = l->x_rest[i] + (l->fixed[i / 3] ? 0 : workspace->p[i]);
    s->report->energy_J = 0.5 * dot(l, s->force_N, workspace->p);
    return PAL_ERR_OK;
}

pal_err pal_equilibrium(pal_equilibrium_workspace *workspace, const double *const k_J[PAL_SPRING_KINDS],
                        const double *force_N, const pal_equilibrium_options *options, double *x,
                        pal_equilibrium_report *report, pal_diagnostic *diag)
{
    pal_equilibrium_report own;
    if (!report) report = &own;
    *report = (pal_equilibrium_report){0};
    const pal_lattice *l = workspace->lattice;
    size_t n = 3 * (size_t)l->n_node;
    search s = {workspace, k_J, force_N, options, report, diag};
    for (size_t i = 0; i < n; i++)
        if (!isfinite(force_N[i]) || (!options->linear && !isfinite(x[i])))
            return pal_diagnostic_set(diag, PAL_ERR_NUMERIC, "node %zu: its load or position is not finite", i / 3);
    if (options->linear) return linear(&s, x);
    double *at = malloc(n * sizeof(double));
    if (!at) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for %d nodes", l->n_node);
    memcpy(at, x, n * sizeof(double));
    for (int i = 0; i < l->n_node; i++)
        if (l->fixed[i]) pal_copy3(at + 3 * i, l->x_rest + 3 * i);
    pal_err err = newton(&s, at);
    if (!err) {
        memcpy(x, at, n * sizeof(double));
        report->energy_J = pal_lattice_force(l, k_J, x, NULL);
    }
    free(at);
    return err;
}

/* ---- adjoint ---- */

PAL_INLINE void slopes_of(const pal_springs *s, pal_spring_kind kind, const double *x, const double *x_rest,
                          const double *lambda, bool linear, double *slope)
{
    const int n_corner = pal_spring_corner_count(kind);
    for (int i = 0; i < s->n_item; i++) {
        const double *at[PAL_CORNERS];
        pal_constraint shape;
        double along = 0, c = 0;
        corners_of(s, linear ? x_rest : x, i, at);
        pal_spring_constraint(kind, at, s->w[i], &shape);
        for (int p = 0; p < n_corner; p++) {
            int node = s->item[n_corner * i + p];
            double u[3];
            along += pal_dot3(shape.g[p], lambda + 3 * node);
            pal_sub3(u, x + 3 * node, x_rest + 3 * node);
            c += pal_dot3(shape.g[p], u);
        }
        slope[i] = -s->q[i] * (linear ? c : shape.c) * along;
    }
}

pal_err pal_equilibrium_adjoint(pal_equilibrium_workspace *workspace, const double *const k_J[PAL_SPRING_KINDS],
                                const double *x, const pal_equilibrium_options *options, const double *dJ_du,
                                double *const slope[PAL_SPRING_KINDS], pal_diagnostic *diag)
{
    const pal_lattice *l = workspace->lattice;
    pal_err err = PAL_ERR_OK;
    if (!options->linear) { /* the present factor is that of the previous iteration */
        assemble(workspace, k_J, x, TRUE_HESSIAN);
        err = pal_cholesky_factor(workspace->factor, &workspace->matrix, false);
    }
    if (!err) err = pal_cholesky_solve(workspace->factor, dJ_du, workspace->p);
    if (err) return pal_diagnostic_set(diag, err, "no gradient: no factor at the rest found (%s)", pal_err_text(err));
    for (int k = 0; k < PAL_SPRING_KINDS; k++)
        slopes_of(&l->kind[k], (pal_spring_kind)k, x, l->x_rest, workspace->p, options->linear, slope[k]);
    return PAL_ERR_OK;
}
