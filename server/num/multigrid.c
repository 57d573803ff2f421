/* Levels of cells as a preconditioner. */
#include "server/num/multigrid.h"

#include "server/num/cholesky.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const pal_chebyshev *pal_cycle_smoother(pal_cycle cycle)
{
    static const pal_chebyshev before_and_after = {3, {1.00842544782028f, 1.08867839208730f, 1.33753125909618f}},
                               after = {5,
                                        {1.00212930146164f, 1.02173711549260f, 1.07872433192603f, 1.19810065292663f,
                                         1.41322542791682f}};
    return cycle == PAL_CYCLE_V ? &before_and_after : &after;
}

/* rows of a piece of work of a thread: some five microseconds */
enum { ROWS = 96 };
/* relative shift of the coarsest diagonal: interpolation may lose rank at supports
 * (tests/sim/implicit/test_preconditioner.c) */
#define COARSEST_SHIFT 1e-5

typedef float vec4 __attribute__((vector_size(16)));

/* x y z 0 of a node; the columns of a block */
typedef struct matrix {
    int n;
    int32_t *start, *column; /* full rows, columns ascending [n + 1] [start[n]] */
    vec4 (*value)[3];        /* blocks, column by column [start[n]] */
    float *inverse;          /* 1 / D, 0 at fixed nodes [n] */
    uint8_t *stale;          /* rows to be summed again [n] */
    float lambda;            /* no eigenvalue of D^-1 A is larger */
    vec4 *x, *b, *r, *d, *e; /* answer, right side, residual, direction and the next one [n] */
} matrix;

struct pal_multigrid {
    const pal_grid_hierarchy *grid;
    int n_level;
    matrix level[PAL_GRID_LEVELS_MAX];
    pal_arena *arena;
    pal_block_matrix coarsest;
    pal_cholesky *factor;
    double *vector; /* of the coarsest level [n][3] */
    int32_t *place; /* blocks of a row by their columns, -1: none */
};

/* ---- patterns ---- */

/* cells around each node: list [start[n]], heap */
static int32_t *cells_of_nodes(const pal_grid_level *grid, int32_t **list)
{
    int32_t *start = calloc((size_t)grid->n_node + 2, sizeof *start);
    *list = malloc(sizeof **list * (8 * (size_t)grid->n_cell + 1));
    if (!start || !*list) {
        free(start), free(*list);
        return NULL;
    }
    for (int k = 0; k < 8 * grid->n_cell; k++) start[grid->node[k] + 2]++;
    for (int i = 0; i < grid->n_node; i++) start[i + 2] += start[i + 1];
    for (int k = 0; k < 8 * grid->n_cell; k++) (*list)[start[grid->node[k] + 1]++] = k / 8;
    return start;
}

static int compare_numbers(const void *a, const void *b)
{
    const int32_t i = *(const int32_t *)a, j = *(const int32_t *)b;
    return (i > j) - (i < j);
}

/* neighbours of node i in ascending order; returns their number */
static int neighbours(const pal_grid_level *grid, const int32_t *start, const int32_t *list, int i, int32_t *mark,
                      int32_t *to)
{
    int n = 0;
    for (int32_t k = start[i]; k < start[i + 1]; k++)
        for (int c = 0; c < 8; c++) {
            int32_t j = grid->node[8 * (size_t)list[k] + (size_t)c];
            if (mark[j] == i) continue;
            mark[j] = i;
            to[n++] = j;
        }
    qsort(to, (size_t)n, sizeof *to, compare_numbers);
    return n;
}

static pal_err make_pattern(const pal_grid_level *grid, pal_arena *arena, matrix *out)
{
    int32_t *list, *start = cells_of_nodes(grid, &list);
    if (!start) return PAL_ERR_MEMORY;
    int n = out->n = grid->n_node;
    int32_t *mark = malloc(sizeof *mark * ((size_t)n + 1)), *near = malloc(sizeof *near * ((size_t)n + 1));
    out->start = PAL_NEW(arena, int32_t, n + 1);
    bool made = mark && near && out->start;
    for (int i = 0; i < n && made; i++) mark[i] = -1;
    for (int i = 0; i < n && made; i++)
        out->start[i + 1] = out->start[i] + neighbours(grid, start, list, i, mark, near);
    if (made) out->column = PAL_NEW(arena, int32_t, out->start[n]);
    made = made && out->column;
    for (int i = 0; i < n && made; i++) mark[i] = -1;
    for (int i = 0; i < n && made; i++) neighbours(grid, start, list, i, mark, out->column + out->start[i]);
    free(start), free(list), free(mark), free(near);
    return made ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err make_level(const pal_grid_level *grid, pal_arena *arena, matrix *out)
{
    PAL_TRY(make_pattern(grid, arena, out));
    size_t n = (size_t)out->n;
    out->value = pal_arena_array(arena, (size_t)out->start[n], sizeof *out->value);
    out->inverse = PAL_NEW(arena, float, n), out->stale = PAL_NEW(arena, uint8_t, n);
    out->x = PAL_NEW(arena, vec4, n), out->b = PAL_NEW(arena, vec4, n);
    out->r = PAL_NEW(arena, vec4, n), out->d = PAL_NEW(arena, vec4, n), out->e = PAL_NEW(arena, vec4, n);
    return out->value && out->inverse && out->stale && out->x && out->b && out->r && out->d && out->e ? PAL_ERR_OK
                                                                                                      : PAL_ERR_MEMORY;
}

static pal_err make(pal_multigrid *mg)
{
    const pal_grid_hierarchy *grid = mg->grid;
    const pal_grid_level *last = &grid->level[grid->n_level - 1];
    mg->arena = pal_arena_create(1 << 16, true);
    if (!mg->arena) return PAL_ERR_MEMORY;
    mg->n_level = grid->n_level;
    int n_row = 1;
    for (int k = 0; k < mg->n_level; k++) {
        PAL_TRY(make_level(&grid->level[k], mg->arena, &mg->level[k]));
        if (k > 0 && mg->level[k].n > n_row) n_row = mg->level[k].n;
    }
    mg->place = PAL_NEW(mg->arena, int32_t, n_row);
    mg->vector = PAL_NEW(mg->arena, double, 3 * (size_t)last->n_node);
    if (!mg->place || !mg->vector) return PAL_ERR_MEMORY;
    for (int i = 0; i < n_row; i++) mg->place[i] = -1;
    const pal_cliques cells = {.n_item = last->n_cell, .n_corner = 8, .node = last->node};
    PAL_TRY(pal_block_matrix_make(last->n_node, &cells, 1, mg->arena, &mg->coarsest));
    return pal_cholesky_create(&mg->coarsest, last->fixed, &mg->factor);
}

pal_err pal_multigrid_create(const pal_grid_hierarchy *grid, pal_multigrid **out)
{
    pal_multigrid *mg = *out = calloc(1, sizeof *mg);
    if (!mg) return PAL_ERR_MEMORY;
    mg->grid = grid;
    pal_err err = make(mg);
    if (err) {
        pal_multigrid_destroy(mg);
        *out = NULL;
    }
    return err;
}

void pal_multigrid_destroy(pal_multigrid *mg)
{
    if (!mg) return;
    pal_cholesky_destroy(mg->factor);
    pal_arena_destroy(mg->arena);
    free(mg);
}

/* ---- values ---- */

static int find(const matrix *a, int i, int32_t j)
{
    int low = a->start[i], high = a->start[i + 1] - 1;
    while (low < high) {
        int middle = (low + high) / 2;
        if (a->column[middle] < j)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

static void zero_row(matrix *a, int i)
{
    memset(a->value + a->start[i], 0, sizeof *a->value * (size_t)(a->start[i + 1] - a->start[i]));
}

/* the rows of a coarser level that have a part of a finer one's */
static void mark_coarser(pal_multigrid *mg, int level)
{
    const pal_grid_level *grid = &mg->grid->level[level];
    const uint8_t *finer = mg->level[level - 1].stale;
    matrix *to = &mg->level[level];
    for (int i = 0; i < to->n; i++) {
        to->stale[i] = 0;
        for (int32_t f = grid->begin[i]; f < grid->begin[i + 1] && !to->stale[i]; f++)
            to->stale[i] = finer[grid->finer[f]];
    }
}

void pal_multigrid_begin(pal_multigrid *mg, const uint8_t *changed)
{
    const pal_grid_level *grid = &mg->grid->level[0];
    matrix *to = &mg->level[0];
    memset(to->stale, 0, (size_t)to->n);
    for (int k = 0; k < 8 * grid->n_cell; k++)
        if (changed[k / 8]) to->stale[grid->node[k]] = 1;
    for (int i = 0; i < to->n; i++)
        if (to->stale[i]) zero_row(to, i);
    for (int k = 1; k < mg->n_level; k++) mark_coarser(mg, k);
}

bool pal_multigrid_wants(const pal_multigrid *mg, int cell)
{
    const int32_t *node = mg->grid->level[0].node + 8 * (size_t)cell;
    bool wanted = false;
    for (int c = 0; c < 8; c++) wanted = wanted || mg->level[0].stale[node[c]];
    return wanted;
}

void pal_multigrid_add_cell(pal_multigrid *mg, int cell, double k[24][24])
{
    matrix *to = &mg->level[0];
    const int32_t *node = mg->grid->level[0].node + 8 * (size_t)cell;
    for (int c = 0; c < 8; c++)
        for (int d = 0; d < 8 && to->stale[node[c]]; d++) {
            vec4 *block = to->value[find(to, node[c], node[d])];
            for (int j = 0; j < 3; j++)
                for (int i = 0; i < 3; i++) block[j][i] += (float)k[3 * c + i][3 * d + j];
        }
}

void pal_multigrid_add_mass(pal_multigrid *mg, int finest_node, double mass)
{
    matrix *to = &mg->level[0];
    const pal_grid_level *grid = &mg->grid->level[0];
    const int32_t *from = grid->from + grid->start[finest_node];
    const int n = grid->start[finest_node + 1] - grid->start[finest_node];
    for (int c = 0; c < n; c++)
        for (int d = 0; d < n && to->stale[from[c]]; d++) {
            vec4 *block = to->value[find(to, from[c], from[d])];
            for (int i = 0; i < 3; i++) block[i][i] += (float)(mass / (n * n));
        }
}

static float weight(const pal_grid_level *grid, int32_t finer)
{
    return 1 / (float)(grid->start[finer + 1] - grid->start[finer]);
}

/* coarse = P' finer P, row by row, where a finer row is new */
static void coarsen(pal_multigrid *mg, int level)
{
    const matrix *from = &mg->level[level - 1];
    const pal_grid_level *grid = &mg->grid->level[level];
    matrix *to = &mg->level[level];
    for (int i = 0; i < to->n; i++) {
        if (!to->stale[i]) continue;
        zero_row(to, i);
        for (int32_t k = to->start[i]; k < to->start[i + 1]; k++) mg->place[to->column[k]] = k;
        for (int32_t f = grid->begin[i]; f < grid->begin[i + 1]; f++) {
            const int32_t finer = grid->finer[f];
            for (int32_t k = from->start[finer]; k < from->start[finer + 1]; k++) {
                const int32_t j = from->column[k];
                const float w = grid->start[j] < grid->start[j + 1] ? weight(grid, finer) * weight(grid, j) : 0;
                for (int32_t m = grid->start[j]; m < grid->start[j + 1]; m++)
                    for (int c = 0; c < 3; c++) to->value[mg->place[grid->from[m]]][c] += w * from->value[k][c];
            }
        }
        for (int32_t k = to->start[i]; k < to->start[i + 1]; k++) mg->place[to->column[k]] = -1;
    }
}

static pal_err factor_coarsest(pal_multigrid *mg)
{
    const matrix *from = &mg->level[mg->n_level - 1];
    pal_block_matrix *to = &mg->coarsest;
    for (int j = 0; j < to->n; j++)
        for (int32_t k = to->start[j]; k < to->start[j + 1]; k++) {
            const vec4 *block = from->value[find(from, to->row[k], j)];
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 3; c++)
                    to->value[9 * (size_t)k + (size_t)(3 * r + c)] =
                        (double)block[c][r] * (to->row[k] == j && r == c ? 1 + COARSEST_SHIFT : 1);
        }
    return pal_cholesky_factor(mg->factor, to, true);
}

/* ---- smoothing ---- */

/* row i of A x */
static inline vec4 multiply_row(const matrix *a, int i, const vec4 *x)
{
    vec4 sum = {0}, other = {0};
    for (int32_t k = a->start[i]; k < a->start[i + 1]; k++) {
        const vec4 *block = a->value[k], at = x[a->column[k]];
        sum += block[0] * at[0] + block[1] * at[1];
        other += block[2] * at[2];
    }
    return sum + other;
}

/* one step of the smoother, or what else is done row by row. Rows read x or d of their neighbours, so that x is not
 * written while it is read: the step after FROM_X adds that direction, with its weight `late`, too */
typedef struct pass {
    matrix *a;
    enum { FROM_ZERO, FROM_X, STEP, RESIDUAL, RESTRICT, PROLONG } what;
    bool zero; /* x is 0, whatever it holds: residual, prolong */
    float keep, take, weight, late;
    const pal_grid_level *grid; /* of the coarser of two levels, restrict and prolong */
    const vec4 *other;          /* what the other level has */
} pass;

/* b = P' other of a coarse node; x += P other of a finer one, or x = P other */
static void transfer_row(const pass *p, int i)
{
    const pal_grid_level *grid = p->grid;
    const bool down = p->what == RESTRICT;
    const int32_t *start = down ? grid->begin : grid->start, *list = down ? grid->finer : grid->from;
    vec4 sum = {0};
    for (int32_t k = start[i]; k < start[i + 1]; k++) sum += p->other[list[k]];
    if (!down && p->zero) p->a->x[i] = (vec4){0};
    if (down)
        p->a->b[i] = sum;
    else if (start[i] < start[i + 1])
        p->a->x[i] += sum / (float)(start[i + 1] - start[i]);
}

static void smooth_row(const pass *p, int i)
{
    matrix *a = p->a;
    const vec4 b = p->what == STEP ? a->r[i] : a->b[i];
    a->r[i] = p->what == FROM_ZERO || p->zero ? b : b - multiply_row(a, i, p->what == STEP ? a->d : a->x);
    if (p->what == RESIDUAL) return;
    a->e[i] = p->take * a->inverse[i] * a->r[i];
    if (p->what == STEP) a->e[i] += p->keep * a->d[i];
    if (p->what == FROM_ZERO) a->x[i] = p->weight * a->e[i];
    if (p->what == STEP) a->x[i] = p->weight * a->e[i] + (p->late > 0 ? p->late * a->d[i] + a->x[i] : a->x[i]);
}

static void pass_rows(void *user, int worker, int index)
{
    const pass *p = user;
    const int first = index * ROWS, end = first + ROWS < p->a->n ? first + ROWS : p->a->n;
    (void)worker;
    for (int i = first; i < end; i++) {
        if (p->what == RESTRICT || p->what == PROLONG)
            transfer_row(p, i);
        else
            smooth_row(p, i);
        /* what goes to a coarser level: the residual's parts, at nodes that take part */
        if (p->what == RESIDUAL && p->grid->start[i] < p->grid->start[i + 1]) p->a->r[i] *= weight(p->grid, i);
    }
}

static void run_pass(pass *p, pal_team *team)
{
    matrix *a = p->a;
    pal_team_run(team, (a->n + ROWS - 1) / ROWS, pass_rows, p);
    if (p->what > STEP) return;
    vec4 *before = a->d;
    a->d = a->e, a->e = before;
}

/* x = the smoother's answer, from 0 or from x */
static void smooth(matrix *a, pal_team *team, const pal_chebyshev *smoother, bool from_zero)
{
    run_pass(
        &(pass){
            .a = a, .what = from_zero ? FROM_ZERO : FROM_X, .take = 4 / (3 * a->lambda), .weight = smoother->weight[0]},
        team);
    for (int k = 1; k < smoother->degree; k++)
        run_pass(&(pass){.a = a,
                         .what = STEP,
                         .keep = pal_chebyshev_keep(k),
                         .take = pal_chebyshev_take(k) / a->lambda,
                         .weight = smoother->weight[k],
                         .late = k == 1 && !from_zero ? smoother->weight[0] : 0},
                 team);
}

float pal_chebyshev_lambda(double (*size_of)(void *user), void (*apply)(void *user, float scale), void *user)
{
    double lambda = 1, size = size_of(user);
    for (int k = 0; k < PAL_POWER_ITERATIONS && size > 0 && isfinite(size); k++) {
        apply(user, (float)(1 / size));
        lambda = size = size_of(user);
    }
    return (float)(PAL_CHEBYSHEV_SAFE * lambda);
}

/* the norm sqrt(d' D d), in which D^-1 A is symmetric */
static double size_of_direction(void *self)
{
    const matrix *a = self;
    double sum = 0;
    for (int i = 0; i < a->n; i++)
        for (int c = 0; c < 3 && a->inverse[i] > 0; c++) sum += (double)(a->d[i][c] * a->d[i][c] / a->inverse[i]);
    return sqrt(sum);
}

/* d = scale D^-1 A d */
static void apply(void *self, float scale)
{
    matrix *a = self;
    for (int i = 0; i < a->n; i++) a->r[i] = scale * a->inverse[i] * multiply_row(a, i, a->d);
    memcpy(a->d, a->r, sizeof *a->d * (size_t)a->n);
}

/* diagonal and largest eigenvalue */
static void measure(matrix *a, const uint8_t *fixed)
{
    for (int i = 0; i < a->n; i++) {
        if (a->stale[i]) {
            const vec4 *block = a->value[find(a, i, i)];
            const float d = (block[0][0] + block[1][1] + block[2][2]) / 3;
            a->inverse[i] = !fixed[i] && d > 0 ? 1 / d : 0;
        }
        for (int c = 0; c < 3; c++) a->d[i][c] = a->inverse[i] > 0 ? pal_chebyshev_start(i, c) : 0;
    }
    a->lambda = pal_chebyshev_lambda(size_of_direction, apply, a);
}

pal_err pal_multigrid_finish(pal_multigrid *mg)
{
    for (int k = 1; k < mg->n_level; k++) coarsen(mg, k);
    for (int k = 0; k < mg->n_level - 1; k++) measure(&mg->level[k], mg->grid->level[k].fixed);
    return factor_coarsest(mg);
}

/* ---- cycle ---- */

static void solve_coarsest(pal_multigrid *mg, matrix *a)
{
    double *v = mg->vector;
    for (int i = 0; i < a->n; i++)
        for (int c = 0; c < 3; c++) v[3 * i + c] = (double)a->b[i][c];
    if (pal_cholesky_solve(mg->factor, v, v)) memset(v, 0, 3 * sizeof *v * (size_t)a->n);
    for (int i = 0; i < a->n; i++) a->x[i] = (vec4){(float)v[3 * i], (float)v[3 * i + 1], (float)v[3 * i + 2], 0};
}

static void solve_level(pal_multigrid *mg, pal_cycle cycle, pal_team *team, int k)
{
    matrix *a = &mg->level[k];
    const pal_chebyshev *smoother = pal_cycle_smoother(cycle);
    const bool zero = cycle == PAL_CYCLE_SAWTOOTH;
    if (k == mg->n_level - 1) {
        solve_coarsest(mg, a);
        return;
    }
    const pal_grid_level *grid = &mg->grid->level[k + 1];
    matrix *coarse = &mg->level[k + 1];
    if (!zero) smooth(a, team, smoother, true);
    run_pass(&(pass){.a = a, .what = RESIDUAL, .zero = zero, .grid = grid}, team);
    run_pass(&(pass){.a = coarse, .what = RESTRICT, .grid = grid, .other = a->r}, team);
    solve_level(mg, cycle, team, k + 1);
    run_pass(&(pass){.a = a, .what = PROLONG, .zero = zero, .grid = grid, .other = coarse->x}, team);
    smooth(a, team, smoother, false);
}

const float *pal_multigrid_solve(pal_multigrid *mg, pal_cycle cycle, const float *residual, pal_team *team)
{
    run_pass(&(pass){.a = &mg->level[0],
                     .what = RESTRICT,
                     .grid = &mg->grid->level[0],
                     .other = (const vec4 *)(const void *)residual},
             team);
    solve_level(mg, cycle, team, 0);
    return (const float *)mg->level[0].x;
}

/* ---- cells ---- */

/* weight of corner d of a cell at corner c of its part at `octant`; a power of 2, so that a product with it is exact */
static double corner_weight(int octant, int c, int d)
{
    double w = 1;
    for (int axis = 0; axis < 3; axis++) {
        const double at = 0.5 * ((octant >> axis & 1) + (c >> axis & 1));
        w *= d >> axis & 1 ? at : 1 - at;
    }
    return w;
}

/* P' (K P), with rows of 24 numbers side by side: K is symmetric, so that its rows are summed to those of (K P)' */
void pal_multigrid_coarsen_cell(double k[24][24], int octant, unsigned fixed, double to[24][24])
{
    double w[8][8], part[24][24], across[24][24] = {{0}};
    for (int c = 0; c < 64; c++) w[c / 8][c % 8] = corner_weight(octant, c / 8, c % 8);
    for (int d = 0; d < 8; d++)
        for (int e = 0; e < 8; e++) {
            if (w[d][e] == 0 || fixed >> d & 1) continue;
            for (int j = 0; j < 3; j++)
                for (int i = 0; i < 24; i++) across[3 * e + j][i] += k[3 * d + j][i] * w[d][e];
        }
    for (int i = 0; i < 24; i++)
        for (int j = 0; j < 24; j++) part[i][j] = across[j][i];
    for (int c = 0; c < 8; c++)
        for (int d = 0; d < 8; d++) {
            if (w[c][d] == 0 || fixed >> c & 1) continue;
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 24; j++) to[3 * d + i][j] += w[c][d] * part[3 * c + i][j];
        }
}
