/* Quadric edge collapse in passes: every pass sorts all edges by the error of their collapse and takes the cheapest
 * whose two ends have not been part of a collapse in this pass.
 *
 * A collapse u -> v locks u and v only. The triangles around an unlocked vertex are then those of the start of the
 * pass, without the ones that shrank to an edge, with corners renamed by `remap`; so its ring is known without updating
 * the adjacency. A collapse is allowed when it keeps the topology (link condition), rotates no triangle by more than
 * about 75 degrees and adds at most one thin one. Before each pass badly shaped pairs of triangles flip their common
 * edge. */
#include "server/mesh/geometry/decimate.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"

enum { MAX_RING = 24, MAX_DEGREE = 12 };

/* x'Ax + 2b'x + c with A symmetric (xx xy xz yy yz zz), and the area it stands for */
typedef struct quadric {
    double a[6], b[3], c, area;
} quadric;

typedef struct pass {
    pal_surface *s;
    quadric *q;            /* [n_vertex]                                            */
    int32_t *start, *item; /* fans at the pass's start                            */
    int32_t *remap;        /* vertex that each vertex was collapsed into [n_vertex] */
    uint8_t *locked;       /* part of a collapse in this pass            [n_vertex] */
    int32_t *edge;         /* ends of each candidate                     [n_edge][2] */
    float *cost;           /* [n_edge]                                              */
    uint32_t *order;       /* candidates, cheapest first                 [n_edge]   */
    int n_edge, n_left;    /* n_left: triangles that remain                         */
} pass;

static void quadric_add(quadric *q, const quadric *r)
{
    for (int k = 0; k < 6; k++) q->a[k] += r->a[k];
    for (int k = 0; k < 3; k++) q->b[k] += r->b[k];
    q->c += r->c;
    q->area += r->area;
}

static double quadric_at(const quadric *q, const double x[3])
{
    const double *a = q->a;
    double ax = a[0] * x[0] + a[1] * x[1] + a[2] * x[2], ay = a[1] * x[0] + a[3] * x[1] + a[4] * x[2],
           az = a[2] * x[0] + a[4] * x[1] + a[5] * x[2];
    return ax * x[0] + ay * x[1] + az * x[2] + 2 * pal_dot3(q->b, x) + q->c;
}

/* minimum of the quadric; false when it is not well defined */
static bool quadric_minimum(const quadric *q, double x[3])
{
    const double *a = q->a;
    double c0 = a[3] * a[5] - a[4] * a[4], c1 = a[2] * a[4] - a[1] * a[5], c2 = a[1] * a[4] - a[2] * a[3];
    double det = a[0] * c0 + a[1] * c1 + a[2] * c2, size = a[0] + a[3] + a[5];
    if (!(fabs(det) > 1e-12 * size * size * size)) return false;
    double c3 = a[0] * a[5] - a[2] * a[2], c4 = a[1] * a[2] - a[0] * a[4], c5 = a[0] * a[3] - a[1] * a[1];
    const double *b = q->b;
    x[0] = -(c0 * b[0] + c1 * b[1] + c2 * b[2]) / det;
    x[1] = -(c1 * b[0] + c3 * b[1] + c4 * b[2]) / det;
    x[2] = -(c2 * b[0] + c4 * b[1] + c5 * b[2]) / det;
    return true;
}

/* squared distance to the plane of every triangle, weighted by area, summed at its corners */
static void find_quadrics(const pal_surface *s, quadric *all)
{
    memset(all, 0, (size_t)s->n_vertex * sizeof *all);
    for (size_t t = 0; t < (size_t)s->n_tri; t++) {
        const int32_t *c = s->tri + 3 * t;
        const double *p = s->x + 3 * (size_t)c[0];
        double n[3];
        pal_normal3(n, p, s->x + 3 * (size_t)c[1], s->x + 3 * (size_t)c[2]);
        double area = pal_norm3(n) / 2;
        if (!pal_unit3(n, n, 0)) continue;
        double d = -pal_dot3(n, p);
        quadric q = {.c = d * d * area, .area = area};
        for (int k = 0; k < 3; k++) q.b[k] = d * n[k] * area;
        for (int k = 0; k < 6; k++) q.a[k] = n[k < 3 ? 0 : k < 5 ? 1 : 2] * n[k < 3 ? k : k < 5 ? k - 2 : 2] * area;
        for (int k = 0; k < 3; k++) quadric_add(&all[c[k]], &q);
    }
}

/* best position for the collapse of an edge and its error */
static double collapse_place(const pass *p, int32_t u, int32_t v, double x[3])
{
    const double *xu = p->s->x + 3 * (size_t)u, *xv = p->s->x + 3 * (size_t)v;
    double middle[3];
    for (int k = 0; k < 3; k++) middle[k] = (xu[k] + xv[k]) / 2;
    quadric q = p->q[u];
    quadric_add(&q, &p->q[v]);
    double w = MIDPOINT_WEIGHT * q.area;
    q.a[0] += w, q.a[3] += w, q.a[5] += w;
    for (int k = 0; k < 3; k++) q.b[k] -= w * middle[k];
    q.c += w * pal_dot3(middle, middle);
    if (!quadric_minimum(&q, x) || pal_dist3(x, middle) > pal_dist3(xu, xv)) pal_copy3(x, middle);
    return quadric_at(&q, x);
}

/* the ring around an unlocked vertex now: the corners after u of each live triangle. -1: not one closed fan, or large
 */
static int ring_of(const pass *p, int32_t u, int32_t ring[MAX_RING][2])
{
    int n = 0;
    for (int k = p->start[u]; k < p->start[u + 1]; k++) {
        const int32_t *c = p->s->tri + 3 * (size_t)p->item[k];
        int i = c[0] == u ? 0 : c[1] == u ? 1 : 2;
        int32_t a = p->remap[c[(i + 1) % 3]], b = p->remap[c[(i + 2) % 3]];
        if (a == b) continue;
        if (n == MAX_RING) return -1;
        ring[n][0] = a;
        ring[n++][1] = b;
    }
    return n;
}

/* is the ring one closed cycle? sorts it into the cycle's order */
static bool ring_closed(int32_t ring[MAX_RING][2], int n)
{
    for (int k = 0; k + 1 < n; k++) {
        int next = k + 1;
        while (next < n && ring[next][0] != ring[k][1]) next++;
        if (next == n) return false;
        int32_t a = ring[next][0], b = ring[next][1];
        ring[next][0] = ring[k + 1][0], ring[next][1] = ring[k + 1][1];
        ring[k + 1][0] = a, ring[k + 1][1] = b;
    }
    if (n < 3 || ring[n - 1][1] != ring[0][0]) return false;
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++)
            if (ring[i][0] == ring[j][0]) return false;
    return true;
}

/* link condition: the two rings meet in the two apexes only, and these are not joined in both rings */
static bool link_condition(int32_t ru[MAX_RING][2], int nu, int32_t rv[MAX_RING][2], int nv)
{
    int n_common = 0, n_joined = 0;
    for (int i = 0; i < nu; i++)
        for (int j = 0; j < nv; j++) {
            n_common += ru[i][0] == rv[j][0];
            n_joined += ru[i][0] == rv[j][1] && ru[i][1] == rv[j][0];
        }
    return n_common == 2 && n_joined == 0 && nu + nv >= 7;
}

/* four area / (sum of squared sides): 0 flat, 0.577 equilateral; normal out */
static double thinness(const double a[3], const double b[3], const double c[3], double n[3])
{
    double u[3], v[3], w[3];
    pal_sub3(u, b, a);
    pal_sub3(v, c, a);
    pal_sub3(w, c, b);
    pal_cross3(n, u, v);
    double sum = pal_dot3(u, u) + pal_dot3(v, v) + pal_dot3(w, w);
    return sum > 0 ? 2 * pal_norm3(n) / sum : 0;
}

/* sum of the shape deficits of the thin triangles around both ends of an edge, before and after its collapse */
typedef struct thin_sum {
    double before, after;
} thin_sum;

/* Do the triangles of one end keep their orientation when it moves to x? other: the end that vanishes with it. The
 * normal of a thin or tiny triangle is not defined well, so such a triangle is compared with the whole ring. */
static bool keeps_orientation(const pass *p, int32_t u, int32_t other, int32_t ring[MAX_RING][2], int n,
                              const double x[3], thin_sum *sum)
{
    double largest = 0, shape[MAX_RING], normal[MAX_RING][3], mean[3] = {0, 0, 0};
    const double *xs = p->s->x, *xu = xs + 3 * (size_t)u;
    for (int k = 0; k < n; k++) {
        shape[k] = thinness(xu, xs + 3 * (size_t)ring[k][0], xs + 3 * (size_t)ring[k][1], normal[k]);
        sum->before += ring[k][0] == other ? 0 : fmax(0, THIN_SHAPE - shape[k]);
        largest = fmax(largest, pal_norm3(normal[k]));
        pal_add3(mean, mean, normal[k]);
    }
    for (int k = 0; k < n; k++) {
        if (ring[k][0] == other || ring[k][1] == other) continue;
        bool vague = shape[k] < THIN_SHAPE || pal_norm3(normal[k]) < largest / 20;
        double after[3], *before = vague ? mean : normal[k];
        sum->after +=
            fmax(0, THIN_SHAPE - thinness(x, xs + 3 * (size_t)ring[k][0], xs + 3 * (size_t)ring[k][1], after));
        if (!(pal_dot3(before, after) > 0.25 * pal_norm3(before) * pal_norm3(after))) return false;
    }
    return true;
}

static bool collapse(pass *p, int32_t u, int32_t v)
{
    int32_t ru[MAX_RING][2], rv[MAX_RING][2];
    int nu = ring_of(p, u, ru), nv = ring_of(p, v, rv);
    if (nu < 3 || nv < 3 || nu + nv - 4 > MAX_DEGREE) return false;
    if (!ring_closed(ru, nu) || !ring_closed(rv, nv) || !link_condition(ru, nu, rv, nv)) return false;
    double x[3];
    collapse_place(p, u, v, x);
    thin_sum sum = {0, 0};
    if (!keeps_orientation(p, u, v, ru, nu, x, &sum) || !keeps_orientation(p, v, u, rv, nv, x, &sum)) return false;
    if (sum.after > sum.before + THIN_INCREASE) return false;
    pal_copy3(p->s->x + 3 * (size_t)v, x);
    quadric_add(&p->q[v], &p->q[u]);
    p->remap[u] = v;
    p->locked[u] = p->locked[v] = 1;
    p->n_left -= 2;
    return true;
}

/* candidates of this pass: every edge once, from its smaller end (closed oriented surfaces run through it both ways) */
static void find_edges(pass *p)
{
    p->n_edge = 0;
    for (size_t t = 0; t < (size_t)p->s->n_tri; t++)
        for (int k = 0; k < 3; k++) {
            int32_t a = p->s->tri[3 * t + (size_t)k], b = p->s->tri[3 * t + (size_t)(k + 1) % 3];
            if (a >= b) continue;
            double x[3];
            p->edge[2 * (size_t)p->n_edge] = a;
            p->edge[2 * (size_t)p->n_edge + 1] = b;
            p->cost[p->n_edge++] = (float)fmax(collapse_place(p, a, b, x), 0);
        }
}

/* radix sort by the bits of the costs, which rise with their value; ties stay in the order of the edges */
static void sort_edges(pass *p, uint32_t *spare)
{
    size_t n = (size_t)p->n_edge;
    uint32_t *from = p->order, *to = spare;
    for (size_t i = 0; i < n; i++) from[i] = (uint32_t)i;
    for (int shift = 0; shift < 32; shift += 11) {
        size_t count[2049] = {0};
        uint32_t bits;
        for (size_t i = 0; i < n; i++) {
            memcpy(&bits, &p->cost[i], sizeof bits);
            count[(bits >> shift & 2047) + 1]++;
        }
        for (int k = 1; k <= 2048; k++) count[k] += count[k - 1];
        for (size_t i = 0; i < n; i++) {
            memcpy(&bits, &p->cost[from[i]], sizeof bits);
            to[count[bits >> shift & 2047]++] = from[i];
        }
        uint32_t *swap = from;
        from = to;
        to = swap;
    }
    if (from != p->order) memcpy(p->order, from, n * sizeof *from);
}

/* the triangle that runs through the edge from a to b; count: triangles at this edge in either direction */
static int32_t triangle_at(const pass *p, int32_t a, int32_t b, int *count)
{
    int32_t found = -1;
    *count = 0;
    for (int k = p->start[a]; k < p->start[a + 1]; k++) {
        const int32_t *c = p->s->tri + 3 * (size_t)p->item[k];
        int i = c[0] == a ? 0 : c[1] == a ? 1 : 2;
        if (c[(i + 1) % 3] == b) found = p->item[k];
        *count += c[(i + 1) % 3] == b || c[(i + 2) % 3] == b;
    }
    return found;
}

/* would the two triangles beside the edge a-b, with apexes o (left) and d (right), be better shaped beside o-d? */
static bool flip_improves(const double *a, const double *b, const double *o, const double *d)
{
    double n[4][3], sum[3];
    double before = fmin(thinness(a, b, o, n[0]), thinness(b, a, d, n[1]));
    double after = fmin(thinness(o, a, d, n[2]), thinness(d, b, o, n[3]));
    pal_add3(sum, n[0], n[1]);
    if (!(after > 1.2 * before)) return false;
    for (int k = 2; k < 4; k++)
        if (!(pal_dot3(n[k], sum) > 0.9 * pal_norm3(n[k]) * pal_norm3(sum))) return false;
    return true;
}

/* flips the longest edge of a badly shaped triangle if that improves it; collapses alone cannot repair caps, which have
 * no short edge. Every vertex takes part in one flip at most, so that the fans stay valid enough */
static bool flip(pass *p, int32_t t)
{
    int32_t *c = p->s->tri + 3 * (size_t)t;
    double n[3];
    const double *xs = p->s->x;
    if (thinness(xs + 3 * (size_t)c[0], xs + 3 * (size_t)c[1], xs + 3 * (size_t)c[2], n) > FLIP_SHAPE) return false;
    int k = 0, n_edge, n_across;
    double length[3];
    for (int i = 0; i < 3; i++) {
        length[i] = pal_dist3(xs + 3 * (size_t)c[i], xs + 3 * (size_t)c[(i + 1) % 3]);
        if (length[i] > length[k]) k = i;
    }
    int32_t a = c[k], b = c[(k + 1) % 3], o = c[(k + 2) % 3], other = triangle_at(p, b, a, &n_edge);
    if (other < 0 || n_edge != 2) return false;
    int32_t *e = p->s->tri + 3 * (size_t)other;
    int32_t d = (int32_t)((int64_t)e[0] + e[1] + e[2] - a - b);
    triangle_at(p, o, d, &n_across);
    bool few = p->start[a + 1] - p->start[a] < 4 || p->start[b + 1] - p->start[b] < 4;
    if (few || n_across > 0 || o == d || p->locked[a] || p->locked[b] || p->locked[o] || p->locked[d]) return false;
    if (!flip_improves(xs + 3 * (size_t)a, xs + 3 * (size_t)b, xs + 3 * (size_t)o, xs + 3 * (size_t)d)) return false;
    p->locked[a] = p->locked[b] = p->locked[o] = p->locked[d] = 1;
    c[0] = o, c[1] = a, c[2] = d;
    e[0] = d, e[1] = b, e[2] = o;
    return true;
}

/* renames corners and drops triangles that shrank to an edge */
static void apply_remap(pass *p)
{
    size_t n = 0;
    for (size_t t = 0; t < (size_t)p->s->n_tri; t++) {
        const int32_t *c = p->s->tri + 3 * t;
        int32_t r[3] = {p->remap[c[0]], p->remap[c[1]], p->remap[c[2]]};
        if (r[0] == r[1] || r[1] == r[2] || r[2] == r[0]) continue;
        memcpy(p->s->tri + 3 * n++, r, sizeof r);
    }
    p->s->n_tri = (int)n;
}

/* one pass; limited: only collapses about as cheap as the ones needed. Number of collapses, -1: no memory */
static int run_pass(pass *p, int n_tri, bool limited, uint32_t *spare)
{
    if (pal_surface_fans(p->s, &p->start, &p->item)) return -1;
    memset(p->locked, 0, (size_t)p->s->n_vertex);
    for (int32_t t = 0; t < p->s->n_tri; t++) flip(p, t);
    PAL_FREE(p->start, p->item);
    if (pal_surface_fans(p->s, &p->start, &p->item)) return -1;
    for (int i = 0; i < p->s->n_vertex; i++) p->remap[i] = i;
    memset(p->locked, 0, (size_t)p->s->n_vertex);
    p->n_left = p->s->n_tri;
    find_edges(p);
    sort_edges(p, spare);
    int goal = (p->n_left - n_tri + 1) / 2, n = 0;
    float limit = limited && goal < p->n_edge ? 1.5f * p->cost[p->order[goal]] : HUGE_VALF;
    for (int k = 0; k < p->n_edge && n < goal; k++) {
        const int32_t *e = p->edge + 2 * (size_t)p->order[k];
        if (p->cost[p->order[k]] > limit) break;
        if (!p->locked[e[0]] && !p->locked[e[1]]) n += collapse(p, e[0], e[1]);
    }
    apply_remap(p);
    PAL_FREE(p->start, p->item);
    return n;
}

pal_err pal_surface_decimate(pal_surface *surface, int n_tri)
{
    size_t n_vertex = (size_t)surface->n_vertex, n_edge = 3 * (size_t)surface->n_tri;
    pal_surface work = {0};
    pass p = {.s = &work};
    pal_err err = pal_surface_copy(surface, &work);
    PAL_ARRAY(&err, p.q, n_vertex);
    PAL_ARRAY(&err, p.remap, n_vertex);
    PAL_ARRAY(&err, p.locked, n_vertex);
    PAL_ARRAY(&err, p.edge, 2 * n_edge);
    PAL_ARRAY(&err, p.cost, n_edge);
    PAL_ARRAY(&err, p.order, 2 * n_edge);
    if (!err) find_quadrics(&work, p.q);
    bool limited = true;
    while (!err && work.n_tri > n_tri) {
        int n = run_pass(&p, n_tri, limited, p.order + n_edge);
        if (n < 0) err = PAL_ERR_MEMORY;
        if (n == 0 && !limited) break;
        limited = n > work.n_tri / 1000;
    }
    if (!err) {
        pal_surface_drop_unused(&work, p.remap);
        pal_surface_free(surface);
        *surface = work;
    } else {
        pal_surface_free(&work);
    }
    return PAL_FREED(err, p.q, p.remap, p.locked, p.edge, p.cost, p.order);
}
