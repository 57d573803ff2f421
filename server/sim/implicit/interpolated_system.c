/* The matrix of an interpolated body in numbers. */
#include "server/sim/implicit/interpolated_system.h"

#include "server/sim/implicit/tuning.h"

#include <stdlib.h>
#include <string.h>

/* ---- pattern ---- */

/* cliques of points that stand for cliques of nodes; heap */
typedef struct clique_list {
    pal_cliques *list;
    int n;
} clique_list;

static void free_cliques(clique_list *l)
{
    for (int i = 0; i < l->n; i++) free((void *)(uintptr_t)l->list[i].node);
    free(l->list);
    *l = (clique_list){0};
}

/* points that carry n nodes, each once; to may be NULL; mark [n_dof] is below stamp everywhere */
static int find_points(const pal_interpolation *A, const int32_t *node, int n, int32_t *mark, int32_t stamp,
                       int32_t *to)
{
    int found = 0;
    for (int c = 0; c < n; c++)
        for (int32_t k = A->start[node[c]]; k < A->start[node[c] + 1]; k++) {
            if (mark[A->point[k]] == stamp) continue;
            mark[A->point[k]] = stamp;
            if (to) to[found] = A->point[k];
            found++;
        }
    return found;
}

/* the cliques `from` of nodes as cliques of points: all as long as the longest, filled up with their first point */
static pal_err add_cliques(clique_list *l, const pal_interpolation *A, const pal_cliques *from)
{
    size_t n_item = (size_t)from->n_item, wide = (size_t)from->n_corner;
    int32_t *mark = calloc((size_t)A->n_point + 1, sizeof *mark), stamp = 0, *point = NULL;
    int max = 1;
    for (size_t i = 0; i < n_item && mark; i++) {
        int n = find_points(A, from->node + wide * i, from->n_corner, mark, ++stamp, NULL);
        max = n > max ? n : max;
    }
    if (mark) point = malloc(sizeof *point * (n_item * (size_t)max + 1));
    for (size_t i = 0; i < n_item && point; i++) {
        int32_t *to = point + i * (size_t)max;
        int n = find_points(A, from->node + wide * i, from->n_corner, mark, ++stamp, to);
        for (; n < max; n++) to[n] = n > 0 ? to[0] : 0;
    }
    free(mark);
    if (!point) return PAL_ERR_MEMORY;
    l->list[l->n++] = (pal_cliques){.n_item = (int)n_item, .n_corner = max, .node = point};
    return PAL_ERR_OK;
}

static pal_err list_cliques(const pal_body *body, const pal_component *force, int n_force, clique_list *l)
{
    bool silent = false;
    l->list = calloc((size_t)n_force + PAL_DOFS_CLIQUES + 1, sizeof *l->list);
    if (!l->list) return PAL_ERR_MEMORY;
    for (int i = 0; i < n_force; i++) {
        const pal_tangent *tangent = force[i].effect->tangent;
        pal_cliques nodes;
        if (!tangent) continue;
        if (tangent->couple && tangent->couple(force[i].self, &nodes))
            PAL_TRY(add_cliques(l, body->interpolation, &nodes));
        else
            silent = true;
    }
    for (int k = 0; k < body->dofs.n_clique && silent; k++)
        if (body->dofs.clique[k].n_item > 0) PAL_TRY(add_cliques(l, body->interpolation, &body->dofs.clique[k]));
    if (!silent || body->dofs.n_clique) return PAL_ERR_OK;
    /* all points are coupled */
    int32_t *point = malloc(sizeof *point * (size_t)body->n_dof);
    if (!point) return PAL_ERR_MEMORY;
    for (int32_t i = 0; i < body->n_dof; i++) point[i] = i;
    l->list[l->n++] = (pal_cliques){.n_item = 1, .n_corner = body->n_dof, .node = point};
    return PAL_ERR_OK;
}

/* ---- groups ---- */

/* both triangles of a pattern; heap */
typedef struct near_list {
    int32_t *start, *point;
} near_list;

static pal_err find_near(const pal_block_matrix *a, near_list *out)
{
    int32_t *start = calloc((size_t)a->n + 2, sizeof *start);
    int32_t *point = malloc(sizeof *point * (2 * (size_t)a->start[a->n] + 1));
    *out = (near_list){start, point};
    if (!start || !point) return PAL_ERR_MEMORY;
    for (int pass = 0; pass < 2; pass++) {
        for (int32_t j = 0; j < a->n; j++)
            for (int32_t k = a->start[j]; k < a->start[j + 1]; k++) {
                int32_t i = a->row[k];
                if (pass == 0) {
                    start[i + 2]++;
                    start[j + 2] += i != j;
                } else {
                    point[start[i + 1]++] = j;
                    if (i != j) point[start[j + 1]++] = i;
                }
            }
        for (int i = 0; i < a->n && pass == 0; i++) start[i + 2] += start[i + 1];
    }
    return PAL_ERR_OK;
}

/* group of each free point, -1 for held ones: the first that has no point with a common neighbour; how many there are
 */
static int choose_groups(const pal_body *body, const near_list *near, int32_t *group, int32_t *mark)
{
    int n_group = 0;
    for (int i = 0; i < body->n_dof; i++) group[i] = -1;
    for (int i = 0; i <= body->n_dof; i++) mark[i] = -1;
    for (int32_t j = 0; j < body->n_dof; j++) {
        if (body->support[j]) continue;
        for (int32_t a = near->start[j]; a < near->start[j + 1]; a++) {
            int32_t i = near->point[a];
            for (int32_t b = near->start[i]; b < near->start[i + 1]; b++)
                if (group[near->point[b]] >= 0) mark[group[near->point[b]]] = j;
        }
        while (mark[++group[j]] == j) continue;
        if (group[j] >= n_group) n_group = group[j] + 1;
    }
    return n_group;
}

pal_err pal_interpolated_system_group(pal_interpolated_system *e, const pal_body *body, pal_arena *arena)
{
    int n = body->n_dof;
    near_list near = {0};
    int32_t *group = malloc(sizeof *group * (size_t)n), *mark = malloc(sizeof *mark * ((size_t)n + 1));
    pal_err err = group && mark ? find_near(&e->rest, &near) : PAL_ERR_MEMORY;
    if (!err) {
        e->n_group = choose_groups(body, &near, group, mark);
        e->start = PAL_NEW(arena, int32_t, e->n_group + 2);
        e->point = PAL_NEW(arena, int32_t, n);
        err = e->start && e->point ? PAL_ERR_OK : PAL_ERR_MEMORY;
    }
    for (int i = 0; i < n && !err; i++)
        if (group[i] >= 0) e->start[group[i] + 2]++;
    for (int g = 0; g < e->n_group && !err; g++) e->start[g + 2] += e->start[g + 1];
    for (int32_t i = 0; i < n && !err; i++)
        if (group[i] >= 0) e->point[e->start[group[i] + 1]++] = i;
    free(group), free(mark), free(near.start), free(near.point);
    return err;
}

/* ---- making ---- */

static pal_err make_arrays(pal_interpolated_system *e, const pal_body *body, pal_arena *arena)
{
    size_t node3 = 3 * (size_t)body->n_node, dof3 = 3 * (size_t)body->n_dof;
    bool made = PAL_NEW_DOUBLES(arena, node3, &e->p, &e->q) && PAL_NEW_DOUBLES(arena, 3 * node3, &e->rotation) &&
                PAL_NEW_DOUBLES(arena, dof3, &e->unit, &e->product);
    return made ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

/* at least `n_group` groups are needed: points with a common neighbour, which those of a clique are, go alone */
static pal_err check_work(const pal_body *body, int n_group, pal_diagnostic *diag)
{
    double moves = 3.0 * n_group;
    if (moves * body->n_node <= PAL_PROBE_WORK_MAX) return PAL_ERR_OK;
    return pal_diagnostic_set(
        diag, PAL_ERR_BUDGET,
        "body \"%s\": an implicit solver finds the matrix of its %d control points by %.0f or more "
        "products on %d nodes, which is too much: take central_cg, fewer levels or fewer control cells",
        body->name, body->n_dof, moves, body->n_node);
}

pal_err pal_interpolated_system_make(const pal_body *body, const pal_component *force, int n_force, pal_arena *arena,
                                     pal_diagnostic *diag, pal_interpolated_system **out)
{
    pal_interpolated_system *e = PAL_NEW(arena, pal_interpolated_system, 1);
    if (!e) return PAL_ERR_MEMORY;
    int clique = 0;
    clique_list cliques = {0};
    pal_err err = list_cliques(body, force, n_force, &cliques);
    for (int i = 0; i < cliques.n; i++) clique = cliques.list[i].n_corner > clique ? cliques.list[i].n_corner : clique;
    if (!err) err = check_work(body, clique, diag);
    if (!err) err = pal_block_matrix_make(body->n_dof, cliques.list, cliques.n, arena, &e->rest);
    free_cliques(&cliques);
    PAL_TRY(err);
    PAL_TRY(make_arrays(e, body, arena));
    PAL_TRY(pal_interpolated_system_group(e, body, arena));
    PAL_TRY(check_work(body, e->n_group, diag));
    e->n_move = 3 * e->n_group;
    *out = e;
    return PAL_ERR_OK;
}

void pal_interpolated_system_restrict9(const pal_interpolation *A, const double *from, double *to)
{
    for (int32_t i = 0; i < A->n_row; i++)
        for (int32_t k = A->start[i]; k < A->start[i + 1]; k++) {
            double *at = to + 9 * (size_t)A->point[k], w = A->weight[k];
            for (size_t c = 0; c < 9; c++) at[c] += w * from[9 * (size_t)i + c];
        }
}
