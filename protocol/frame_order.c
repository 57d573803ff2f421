/* Coarse-to-fine order: peel independent sets of low-degree vertices, collapse each into its nearest neighbour, rebuild
 * the graph, until few vertices are left.
 *
 * A peeled vertex x is predicted from four of its neighbours at that level, X = their rest positions: the four (of at
 * most seven nearest) and the weights w minimise |X w - x|^2 + lambda s^2 |w|^2 with sum w = 1, s^2 the mean squared
 * distance. With the differences d_j = X_j - x and M = d d' + lambda s^2 I that is w = M^-1 1 / (1' M^-1 1), and the
 * minimum is 1 / (1' M^-1 1), so the best four are those with the largest 1' M^-1 1. The graph is rebuilt from scratch
 * at each level (two buffers) instead of being edited, so a hub with a million neighbours costs no more than other
 * edges; a level that peels less than 4 % ends the peeling, which bounds the work by a multiple of the edges for any
 * input. What is left, and loose vertices, are predicted from earlier ones in the order. */
#include "protocol/frame_order.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { N_CANDIDATE = 7, BASE_SIZE = 25, DEGREE_LIMIT = 9, BASE_WINDOW = 32, DEGREE_BUCKETS = 64 };
#define LAMBDA 0.05
#define GONE   UINT32_MAX

typedef struct graph { /* undirected, both directions stored */
    uint32_t *begin;   /* [n_vertex + 1] */
    uint32_t *to;      /* [begin[n_vertex]] */
} graph;

typedef struct builder {
    uint32_t n;
    const float *rest;   /* [n][3] */
    uint32_t *neighbour; /* predictors by vertex, of vertices; GONE: none [n][4] */
    int16_t *weight;     /* [n][4] */
    graph now, next;
    uint32_t *active, n_active; /* vertices not yet peeled      [n] */
    uint32_t *target;           /* where a peeled vertex went, itself while active [n] */
    uint32_t *mark;             /* scratch [n] */
    uint32_t *sorted;           /* scratch [n] */
    uint32_t *peeled, n_peeled; /* in peeling order, fine first [n] */
    uint32_t *level_of_peeled;  /* first place in peeled of each level [n + 1] */
    uint32_t n_level;
    uint64_t *key;        /* sort keys [n] */
    double low[3], scale; /* box, for the space-filling order */
} builder;

static double distance2(const builder *b, uint32_t i, uint32_t j)
{
    double sum = 0;
    for (int c = 0; c < 3; c++) {
        double d = (double)b->rest[3 * (size_t)i + c] - (double)b->rest[3 * (size_t)j + c];
        sum += d * d;
    }
    return sum;
}

/* y = M^-1 1 for M[pick][pick] + ridge I by Cholesky; returns 1' y, or 0 when M is not positive */
static double solve_ones(double m[N_CANDIDATE][N_CANDIDATE], const int *pick, int n, double ridge, double *y)
{
    double l[4][4], sum = 0;
    for (int i = 0; i < n; i++) {
        double rhs = 1;
        for (int j = 0; j <= i; j++) {
            double v = m[pick[i]][pick[j]] + (i == j ? ridge : 0);
            for (int k = 0; k < j; k++) v -= l[i][k] * l[j][k];
            if (i == j) {
                if (!(v > 0)) return 0;
                l[i][i] = 1 / sqrt(v);
            } else {
                l[i][j] = v * l[j][j];
            }
        }
        for (int k = 0; k < i; k++) rhs -= l[i][k] * y[k];
        y[i] = rhs * l[i][i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++) y[i] -= l[k][i] * y[k];
        y[i] *= l[i][i];
        sum += y[i];
    }
    return sum;
}

/* the best four candidates; n_pick = min(4, n) */
static void pick_best(double m[N_CANDIDATE][N_CANDIDATE], int n, double ridge, int *pick)
{
    double best = 0, y[4];
    if (n <= 4) return;
    for (int code = 15; code < 1 << n; code++) {
        int trial[4], k = 0;
        if (__builtin_popcount((unsigned)code) != 4) continue;
        for (int j = 0; j < n; j++)
            if (code >> j & 1) trial[k++] = j;
        double sum = solve_ones(m, trial, 4, ridge, y);
        if (sum > best) {
            best = sum;
            memcpy(pick, trial, sizeof trial);
        }
    }
}

/* weights to Q12 with an exact sum; false when their absolute sum is too large */
static bool quantise(const double *y, double sum, int n, int16_t *weight)
{
    long total = 0, absolute = 0, q[4] = {0};
    int largest = 0;
    for (int j = 0; j < n; j++) {
        double w = y[j] / sum;
        if (!(fabs(w) < 4)) return false;
        q[j] = lrint(w * PAL_ORDER_ONE);
        total += q[j];
        if (labs(q[j]) > labs(q[largest])) largest = j;
    }
    q[largest] += PAL_ORDER_ONE - total;
    for (int j = 0; j < n; j++) absolute += labs(q[j]);
    if (absolute > PAL_ORDER_ABS_MAX) return false;
    for (int j = 0; j < n; j++) weight[j] = (int16_t)q[j];
    return true;
}

/* predictor of vertex v from candidates [n]: four vertices and weights */
static void predict(const builder *b, uint32_t v, const uint32_t *candidate, int n)
{
    uint32_t *neighbour = b->neighbour + 4 * (size_t)v;
    int16_t *weight = b->weight + 4 * (size_t)v;
    double d[N_CANDIDATE][3], m[N_CANDIDATE][N_CANDIDATE], y[4], s2 = 0;
    int pick[4] = {0, 1, 2, 3}, n_pick = n < 4 ? n : 4;
    for (int j = 0; j < 4; j++) neighbour[j] = GONE, weight[j] = 0;
    if (n == 0) return;
    for (int j = 0; j < n; j++)
        for (int c = 0; c < 3; c++)
            d[j][c] = (double)b->rest[3 * (size_t)candidate[j] + c] - (double)b->rest[3 * (size_t)v + c];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) m[i][j] = d[i][0] * d[j][0] + d[i][1] * d[j][1] + d[i][2] * d[j][2];
    for (int j = 0; j < n; j++) s2 += m[j][j] / n;
    if (!(s2 > 1e-30)) s2 = 1e-30;

    pick_best(m, n, LAMBDA * s2, pick);
    /* more regularisation until the weights are small enough; equal weights are the limit */
    bool good = false;
    for (double lambda = LAMBDA; lambda < 1e9 && !good; lambda *= 4) {
        double sum = solve_ones(m, pick, n_pick, lambda * s2, y);
        good = sum > 0 && quantise(y, sum, n_pick, weight);
    }
    if (!good) quantise((const double[]){1, 1, 1, 1}, n_pick, n_pick, weight);
    for (int j = 0; j < n_pick; j++)
        if (weight[j]) neighbour[j] = candidate[pick[j]];
}

/* keeps the N_CANDIDATE nearest of those offered, nearest first */
static void offer(uint32_t *candidate, double *far, int *n, uint32_t vertex, double d2)
{
    int place = *n;
    if (*n == N_CANDIDATE && d2 >= far[N_CANDIDATE - 1]) return;
    if (*n < N_CANDIDATE)
        ++*n;
    else
        place--;
    while (place > 0 && far[place - 1] > d2) {
        far[place] = far[place - 1];
        candidate[place] = candidate[place - 1];
        place--;
    }
    far[place] = d2;
    candidate[place] = vertex;
}

static int compare_keys(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

/* sorts vertices along a Morton curve, so that neighbours in space share groups of the wire order */
static void sort_in_space(builder *b, uint32_t *vertex, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        uint64_t code = 0;
        for (int c = 0; c < 3; c++) {
            double u = ((double)b->rest[3 * (size_t)vertex[i] + c] - b->low[c]) * b->scale;
            uint32_t cell = u > 0 ? u < 1023 ? (uint32_t)u : 1023 : 0;
            for (int bit = 0; bit < 10; bit++) code |= (uint64_t)(cell >> bit & 1) << (3 * bit + c);
        }
        b->key[i] = code << 32 | vertex[i];
    }
    qsort(b->key, n, sizeof *b->key, compare_keys);
    for (uint32_t i = 0; i < n; i++) vertex[i] = (uint32_t)b->key[i];
}

/* graph of `next` from edges of `now` with both ends sent through target, without loops and doubles */
static void rebuild(builder *b)
{
    uint32_t n = b->n, at = 0;
    /* members of each collapsed vertex: heads in begin of next, links in sorted */
    for (uint32_t v = 0; v < n; v++) b->next.begin[v] = GONE;
    for (uint32_t v = 0; v < n; v++) {
        uint32_t t = b->target[v];
        if (b->now.begin[v] == b->now.begin[v + 1]) continue;
        b->sorted[v] = b->next.begin[t];
        b->next.begin[t] = v;
    }
    for (uint32_t v = 0; v < n; v++) b->mark[v] = GONE;
    for (uint32_t v = 0; v < n; v++) {
        uint32_t member = b->next.begin[v];
        b->next.begin[v] = at;
        for (; member != GONE; member = b->sorted[member])
            for (uint32_t e = b->now.begin[member]; e < b->now.begin[member + 1]; e++) {
                uint32_t u = b->target[b->now.to[e]];
                if (u == v || b->mark[u] == v) continue;
                b->mark[u] = v;
                b->next.to[at++] = u;
            }
    }
    b->next.begin[n] = at;
    graph swap = b->now;
    b->now = b->next;
    b->next = swap;
}

/* active vertices by degree, fewest first; returns the smallest degree above 0, 0 when no edge is left */
static uint32_t sort_by_degree(builder *b)
{
    uint32_t count[DEGREE_BUCKETS + 1] = {0}, min = 0;
    for (uint32_t i = 0; i < b->n_active; i++) {
        uint32_t v = b->active[i], degree = b->now.begin[v + 1] - b->now.begin[v];
        if (degree && (!min || degree < min)) min = degree;
        count[(degree < DEGREE_BUCKETS ? degree : DEGREE_BUCKETS - 1) + 1]++;
    }
    for (int d = 0; d < DEGREE_BUCKETS; d++) count[d + 1] += count[d];
    for (uint32_t i = 0; i < b->n_active; i++) {
        uint32_t v = b->active[i], degree = b->now.begin[v + 1] - b->now.begin[v];
        b->sorted[count[degree < DEGREE_BUCKETS ? degree : DEGREE_BUCKETS - 1]++] = v;
    }
    return min;
}

/* peels one level; false when nothing worth a level is left */
static bool peel(builder *b)
{
    uint32_t first = b->n_peeled, min = sort_by_degree(b);
    uint32_t limit = min > DEGREE_LIMIT ? min : DEGREE_LIMIT;
    if (!min || b->n_active <= BASE_SIZE) return false;
    memset(b->mark, 0, b->n * sizeof *b->mark);
    for (uint32_t i = 0; i < b->n_active; i++) {
        uint32_t v = b->sorted[i], begin = b->now.begin[v], end = b->now.begin[v + 1];
        if (b->mark[v] || begin == end || end - begin > limit) continue;
        b->mark[v] = 2;
        for (uint32_t e = begin; e < end; e++) b->mark[b->now.to[e]] = 1;
        b->peeled[b->n_peeled++] = v;
    }
    if (b->n_peeled - first < b->n_active / 25) {
        b->n_peeled = first;
        return false;
    }
    for (uint32_t i = first; i < b->n_peeled; i++) {
        uint32_t v = b->peeled[i], candidate[N_CANDIDATE];
        double far[N_CANDIDATE];
        int n = 0;
        for (uint32_t e = b->now.begin[v]; e < b->now.begin[v + 1]; e++)
            offer(candidate, far, &n, b->now.to[e], distance2(b, v, b->now.to[e]));
        predict(b, v, candidate, n);
        b->target[v] = candidate[0];
    }
    uint32_t n_kept = 0;
    for (uint32_t i = 0; i < b->n_active; i++)
        if (b->mark[b->active[i]] != 2) b->active[n_kept++] = b->active[i];
    b->n_active = n_kept;
    sort_in_space(b, b->peeled + first, b->n_peeled - first);
    b->level_of_peeled[b->n_level++] = first;
    rebuild(b);
    /* peeled vertices have no edges any more, so their target is never asked again */
    return true;
}

/* the rest of the active vertices, each predicted from the nearest of those just before it */
static void finish_base(builder *b)
{
    sort_in_space(b, b->active, b->n_active);
    for (uint32_t i = 0; i < b->n_active; i++) {
        uint32_t candidate[N_CANDIDATE], v = b->active[i];
        double far[N_CANDIDATE];
        int n = 0;
        for (uint32_t k = i < BASE_WINDOW ? 0 : i - BASE_WINDOW; k < i; k++)
            offer(candidate, far, &n, b->active[k], distance2(b, v, b->active[k]));
        predict(b, v, candidate, n);
    }
}

/* wire order: the base, then the levels from coarse to fine; predictors from vertices to wire indices */
static int write_order(const builder *b, pal_frame_order **out)
{
    pal_frame_order *o = pal_frame_order_allocate(b->n, b->n_level + 1);
    uint32_t *rank = b->mark, at = 0;
    if (!o) return PAL_REFUSAL_MEMORY;
    o->n_level = 0;
    if (b->n_active) o->level_begin[o->n_level++] = 0;
    memcpy(o->vertex_of, b->active, b->n_active * sizeof *o->vertex_of);
    at = b->n_active;
    b->level_of_peeled[b->n_level] = b->n_peeled;
    for (uint32_t level = b->n_level; level-- > 0;) {
        uint32_t first = b->level_of_peeled[level], n = b->level_of_peeled[level + 1] - first;
        o->level_begin[o->n_level++] = at;
        memcpy(o->vertex_of + at, b->peeled + first, n * sizeof *o->vertex_of);
        at += n;
    }
    o->level_begin[o->n_level] = at;
    for (uint32_t i = 0; i < b->n; i++) rank[o->vertex_of[i]] = i;
    for (uint32_t i = 0; i < b->n; i++) {
        size_t v = o->vertex_of[i];
        for (size_t j = 0; j < 4; j++) {
            uint32_t from = b->neighbour[4 * v + j];
            o->neighbour[4 * (size_t)i + j] = from == GONE ? 0 : rank[from];
            o->weight[4 * (size_t)i + j] = b->weight[4 * v + j];
        }
    }
    *out = o;
    return 0;
}

/* box of the rest pose; NAN when a position is not finite */
static int measure(builder *b)
{
    double high[3] = {-INFINITY, -INFINITY, -INFINITY}, size = 0;
    for (int c = 0; c < 3; c++) b->low[c] = INFINITY;
    for (size_t i = 0; i < 3 * (size_t)b->n; i++) {
        double x = (double)b->rest[i];
        if (!isfinite(x)) return PAL_REFUSAL_NAN;
        if (x < b->low[i % 3]) b->low[i % 3] = x;
        if (x > high[i % 3]) high[i % 3] = x;
    }
    for (int c = 0; c < 3; c++)
        if (high[c] - b->low[c] > size) size = high[c] - b->low[c];
    b->scale = size > 0 ? 1024 / size : 0;
    return 0;
}

/* edges of the triangles, both directions, doubles removed by a first rebuild */
static void first_graph(builder *b, const uint32_t *triangle, uint32_t n_triangle)
{
    uint32_t *begin = b->now.begin;
    memset(begin, 0, ((size_t)b->n + 1) * sizeof *begin);
    for (size_t e = 0; e < 3 * (size_t)n_triangle; e++) begin[triangle[e] + 1] += 2;
    for (uint32_t v = 0; v < b->n; v++) begin[v + 1] += begin[v], b->mark[v] = begin[v];
    for (size_t t = 0; t < n_triangle; t++)
        for (int c = 0; c < 3; c++)
            for (int d = 1; d < 3; d++) b->now.to[b->mark[triangle[3 * t + c]]++] = triangle[3 * t + (c + d) % 3];
    for (uint32_t v = 0; v < b->n; v++) b->target[v] = v, b->active[v] = v;
    b->n_active = b->n;
    rebuild(b);
}

static bool allocate(builder *b, size_t n, size_t n_edge)
{
    bool good = true;
#define TAKE(pointer, count) good &= (pointer = malloc(((count) + 1) * sizeof *(pointer))) != NULL
    TAKE(b->neighbour, 4 * n);
    TAKE(b->weight, 4 * n);
    TAKE(b->now.begin, n);
    TAKE(b->next.begin, n);
    TAKE(b->now.to, n_edge);
    TAKE(b->next.to, n_edge);
    TAKE(b->active, n);
    TAKE(b->target, n);
    TAKE(b->mark, n);
    TAKE(b->sorted, n);
    TAKE(b->peeled, n);
    TAKE(b->level_of_peeled, n);
    TAKE(b->key, n);
#undef TAKE
    return good;
}

static void release(builder *b)
{
    void *const block[] = {b->now.begin, b->next.begin, b->now.to, b->next.to, b->active,
                           b->target,    b->mark,       b->sorted, b->peeled,  b->level_of_peeled,
                           b->key,       b->neighbour,  b->weight};
    for (size_t i = 0; i < sizeof block / sizeof *block; i++) free(block[i]);
}

int pal_frame_order_create(const float *rest_m, uint32_t n_vertex, const uint32_t *triangle, uint32_t n_triangle,
                           pal_frame_order **out)
{
    builder b = {.n = n_vertex, .rest = rest_m};
    int refusal = n_vertex == 0 || n_vertex > PAL_ORDER_VERTEX_MAX || n_triangle > PAL_ORDER_TRIANGLE_MAX
                      ? PAL_REFUSAL_COUNT
                      : measure(&b);
    for (size_t e = 0; !refusal && e < 3 * (size_t)n_triangle; e++)
        if (triangle[e] >= n_vertex) refusal = PAL_REFUSAL_RANGE;
    if (refusal) return refusal;
    if (allocate(&b, n_vertex, 6 * (size_t)n_triangle)) {
        first_graph(&b, triangle, n_triangle);
        while (peel(&b)) continue;
        finish_base(&b);
        refusal = write_order(&b, out);
    } else {
        refusal = PAL_REFUSAL_MEMORY;
    }
    release(&b);
    return refusal;
}

/* a midpoint's wire index is its number; a parent's too, unless it is coarse. A level ends where a parent lies in it.
 * begin NULL: only counts */
static uint32_t midpoint_levels(const pal_frame_order *coarse, const uint32_t *parent, const uint32_t *rank, uint32_t n,
                                uint32_t *begin)
{
    uint32_t n_level = coarse->n_level, n_coarse = coarse->n_vertex, first = 0;
    for (uint32_t i = n_coarse; i < n; i++) {
        const uint32_t *p = parent + 2 * (size_t)(i - n_coarse);
        bool inside = i == n_coarse;
        for (int k = 0; k < 2; k++) inside |= (p[k] < n_coarse ? rank[p[k]] : p[k]) >= first;
        if (!inside) continue;
        first = i;
        if (begin) begin[n_level] = i;
        n_level++;
    }
    return n_level;
}

static int extend(const pal_frame_order *coarse, const uint32_t *parent, uint32_t n, pal_frame_order **out)
{
    const int16_t half[4] = {PAL_ORDER_ONE / 2, PAL_ORDER_ONE / 2, 0, 0};
    uint32_t n_coarse = coarse->n_vertex, *rank = malloc(n_coarse * sizeof *rank);
    if (!rank) return PAL_REFUSAL_MEMORY;
    for (uint32_t i = 0; i < n_coarse; i++) rank[coarse->vertex_of[i]] = i;
    pal_frame_order *o = pal_frame_order_allocate(n, midpoint_levels(coarse, parent, rank, n, NULL));
    if (!o) return free(rank), PAL_REFUSAL_MEMORY;
    memcpy(o->level_begin, coarse->level_begin, coarse->n_level * sizeof *o->level_begin);
    memcpy(o->vertex_of, coarse->vertex_of, n_coarse * sizeof *o->vertex_of);
    memcpy(o->neighbour, coarse->neighbour, 4 * (size_t)n_coarse * sizeof *o->neighbour);
    memcpy(o->weight, coarse->weight, 4 * (size_t)n_coarse * sizeof *o->weight);
    midpoint_levels(coarse, parent, rank, n, o->level_begin);
    o->level_begin[o->n_level] = n;
    for (uint32_t i = n_coarse; i < n; i++) {
        const uint32_t *p = parent + 2 * (size_t)(i - n_coarse);
        uint32_t *neighbour = o->neighbour + 4 * (size_t)i;
        o->vertex_of[i] = i;
        for (int k = 0; k < 2; k++) neighbour[k] = p[k] < n_coarse ? rank[p[k]] : p[k];
        memcpy(o->weight + 4 * (size_t)i, half, sizeof half);
    }
    free(rank);
    *out = o;
    return 0;
}

int pal_frame_order_hierarchy(const float *rest_m, uint32_t n_vertex, uint32_t n_coarse, const uint32_t *parent,
                              const uint32_t *coarse_triangle, uint32_t n_coarse_triangle, pal_frame_order **out)
{
    pal_frame_order *coarse = NULL;
    if (n_coarse == 0 || n_coarse > n_vertex || n_vertex > PAL_ORDER_VERTEX_MAX) return PAL_REFUSAL_COUNT;
    for (uint32_t i = n_coarse; i < n_vertex; i++)
        for (int k = 0; k < 2; k++)
            if (parent[2 * (size_t)(i - n_coarse) + (size_t)k] >= i) return PAL_REFUSAL_RANGE;
    for (size_t i = 3 * (size_t)n_coarse; i < 3 * (size_t)n_vertex; i++)
        if (!isfinite(rest_m[i])) return PAL_REFUSAL_NAN;
    int refusal = pal_frame_order_create(rest_m, n_coarse, coarse_triangle, n_coarse_triangle, &coarse);
    if (!refusal) refusal = extend(coarse, parent, n_vertex, out);
    pal_frame_order_destroy(coarse);
    return refusal;
}

pal_frame_order *pal_frame_order_allocate(uint32_t n_vertex, uint32_t n_level)
{
    const size_t n = n_vertex;
    pal_frame_order *o = calloc(1, sizeof *o);
    if (!o) return NULL;
    o->n_vertex = n_vertex;
    o->n_level = n_level;
    o->level_begin = malloc(((size_t)n_level + 1) * sizeof *o->level_begin);
    o->vertex_of = malloc(n * sizeof *o->vertex_of);
    o->neighbour = calloc(4 * n, sizeof *o->neighbour);
    o->weight = calloc(4 * n, sizeof *o->weight);
    if (o->level_begin && o->vertex_of && o->neighbour && o->weight) return o;
    pal_frame_order_destroy(o);
    return NULL;
}

void pal_frame_order_destroy(pal_frame_order *order)
{
    if (!order) return;
    free(order->level_begin);
    free(order->vertex_of);
    free(order->neighbour);
    free(order->weight);
    free(order);
}

int pal_frame_order_check(const pal_frame_order *order)
{
    uint32_t n = order->n_vertex;
    if (n == 0 || n > PAL_ORDER_VERTEX_MAX) return PAL_REFUSAL_COUNT;
    uint8_t *seen = calloc(n, 1);
    int refusal = seen ? PAL_REFUSAL_NONE : PAL_REFUSAL_MEMORY;
    for (uint32_t i = 0; i < n && !refusal; i++) {
        const uint32_t *neighbour = order->neighbour + 4 * (size_t)i;
        const int16_t *weight = order->weight + 4 * (size_t)i;
        int sum = 0, absolute = 0;
        for (int j = 0; j < 4; j++) {
            sum += weight[j];
            absolute += abs(weight[j]);
            if (weight[j] ? neighbour[j] >= i : neighbour[j] > 0) refusal = PAL_REFUSAL_ORDER;
        }
        if ((sum != PAL_ORDER_ONE && absolute) || absolute > PAL_ORDER_ABS_MAX) refusal = PAL_REFUSAL_ORDER;
        if (order->vertex_of[i] >= n || seen[order->vertex_of[i]]++) refusal = PAL_REFUSAL_ORDER;
    }
    free(seen);
    return refusal;
}
