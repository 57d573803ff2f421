/* The organ, liver-like: two smoothly joined ellipsoids (a large right and a thin left lobe), with a fissure between
 * them and a hollow below, as the zero set of a blend of distance-like functions, contoured and decimated.
 *
 * Hollow bodies: rings of vertices joined to a tube with closed ends, projected onto the zero set of a distance-like
 * function, distributed evenly along it and flipped to a Delaunay triangulation. Counts are those of the rings. */
#include "server/mesh/geometry/procedural.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/contour.h"
#include "server/mesh/geometry/decimate.h"
#include "server/mesh/geometry/smooth.h"
#include "server/mesh/geometry/tuning.h"

#define WIDE_COS 0.766 /* cosine of 40 degrees: larger angles are not changed */

/* about the signed distance to an ellipsoid, positive inside: exact at the surface to first order */
static double ellipsoid(const double p[3], const double middle[3], const double axis[3])
{
    double u[3], v[3];
    for (int a = 0; a < 3; a++) {
        u[a] = (p[a] - middle[a]) / axis[a];
        v[a] = u[a] / axis[a];
    }
    double k0 = pal_norm3(u), k1 = pal_norm3(v);
    return k1 > 1e-9 ? k0 * (1 - k0) / k1 : fmin(axis[0], fmin(axis[1], axis[2]));
}

/* the larger (sign 1) or smaller (sign -1) of two distances, rounded where they are within r of each other */
static double blend(double a, double b, double r, double sign)
{
    double t = fmax(r - fabs(a - b), 0) / r, side = sign > 0 ? fmax(a, b) : fmin(a, b);
    return side + sign * t * t * r / 4;
}

static double liver(const void *self, const double p[3])
{
    (void)self;
    /* x to the body's left, y up, z to the front, in metres */
    double right = ellipsoid(p, (const double[3]){-0.035, 0, 0}, (const double[3]){0.070, 0.065, 0.058});
    double left = ellipsoid(p, (const double[3]){0.045, 0.018, 0.012}, (const double[3]){0.062, 0.036, 0.034});
    double body = blend(right, left, 0.035, 1);
    double hollow = ellipsoid(p, (const double[3]){0.015, -0.085, -0.012}, (const double[3]){0.075, 0.060, 0.062});
    double fissure = ellipsoid(p, (const double[3]){0.022, -0.030, 0.058}, (const double[3]){0.012, 0.045, 0.030});
    return blend(blend(body, -hollow, 0.030, -1), -fissure, 0.020, -1);
}

pal_err pal_organ_make(int n_tri_about, pal_surface *out)
{
    int n = n_tri_about < 500 ? 500 : n_tri_about > 500000 ? 500000 : n_tri_about;
    /* about 0.065 m^2 of surface */
    pal_contour_box box = {{-0.13, -0.09, -0.08}, {0.13, 0.09, 0.08}, 0};
    box.spacing_m = fmin(sqrt(CONTOUR_TRI_PER_SPACING2 * 0.065 / (CONTOUR_SURPLUS * n)), 0.006);
    pal_surface organ;
    PAL_TRY(pal_contour(liver, NULL, &box, &organ, NULL));
    pal_err err = pal_surface_smooth(&organ, 5, NULL);
    if (!err) err = pal_surface_decimate(&organ, n);
    if (err) {
        pal_surface_free(&organ);
        return err;
    }
    pal_surface_recentre(&organ);
    *out = organ;
    return PAL_ERR_OK;
}

/* distance-like: positive inside, zero at the surface */
typedef double (*shape)(const double p[3]);

typedef struct ring {
    int n;        /* vertices, 1: a pole on the spine */
    double along; /* place on the spine, in nodes */
    bool fixed;   /* stays as it is made */
} ring;

typedef struct node {
    double x[3], r; /* m */
} node;

typedef struct hollow {
    pal_surface *s;
    shape inside;
    int32_t *owner;   /* face that runs from a to b, or -1          [n_vertex][n_vertex] */
    uint8_t *valence; /* [n_vertex] */
    uint8_t *fixed;   /* [n_vertex] */
    double *move;     /* [n_vertex][4] */
    double reach;     /* maximum displacement in a step, m */
} hollow;

static void spine_at(const node *spine, int n, double along, node *out, double axis[3])
{
    int i = along < n - 2 ? (int)along : n - 2;
    double t = along - i;
    *out = spine[i];
    pal_sub3(axis, spine[i + 1].x, spine[i].x);
    pal_axpy3(out->x, t, axis);
    out->r += t * (spine[i + 1].r - spine[i].r);
    pal_unit3(axis, axis, 0);
}

/* vertex i of a ring, at angle 2 pi i / n around the axis, from the side that looks along `up` */
static void ring_vertices(const ring *r, const node *at, const double axis[3], double *x)
{
    double up[3] = {0, 0, 1}, side[3];
    pal_axpy3(up, -pal_dot3(up, axis), axis);
    if (!pal_unit3(up, up, 1e-6)) pal_set3(up, 1, 0, 0);
    pal_cross3(side, axis, up);
    for (int i = 0; i < r->n; i++) {
        double angle = 2 * M_PI * i / r->n, radius = r->n == 1 ? 0 : at->r;
        pal_copy3(x + 3 * i, at->x);
        pal_axpy3(x + 3 * i, radius * cos(angle), up);
        pal_axpy3(x + 3 * i, radius * sin(angle), side);
    }
}

/* faces between two rings that begin at vertices a and b, b's further along the axis, in the order of their angles;
 * returns their number */
static int zip(int n_a, int32_t a, int n_b, int32_t b, int32_t *tri)
{
    int i = 0, j = 0, n = 0, end_a = n_a > 1 ? n_a : 0, end_b = n_b > 1 ? n_b : 0;
    while (i < end_a || j < end_b) {
        /* the side whose middle comes first */
        bool on_a = j == end_b || (i < end_a && (2 * i + 1) * n_b <= (2 * j + 1) * n_a);
        int32_t p = a + i % n_a, q = b + j % n_b;
        int32_t face[3] = {p, on_a ? a + (i + 1) % n_a : b + (j + 1) % n_b, q};
        memcpy(tri + 3 * n++, face, sizeof face);
        i += on_a, j += !on_a;
    }
    return n;
}

/* all rings along the spine as one closed surface */
static pal_err make_tube(const ring *rings, int n_ring, const node *spine, int n_node, hollow *body)
{
    int n_vertex = 0, first = 0;
    for (int k = 0; k < n_ring; k++) n_vertex += rings[k].n;
    pal_surface *s = body->s;
    *s = (pal_surface){.n_vertex = n_vertex};
    s->x = malloc((size_t)n_vertex * 3 * sizeof *s->x);
    s->tri = malloc((size_t)n_vertex * 6 * sizeof *s->tri);
    if (!s->x || !s->tri) return PAL_ERR_MEMORY;
    for (int k = 0; k < n_ring; k++) {
        node at;
        double axis[3];
        spine_at(spine, n_node, rings[k].along, &at, axis);
        ring_vertices(&rings[k], &at, axis, s->x + 3 * first);
        memset(body->fixed + first, rings[k].fixed, (size_t)rings[k].n);
        if (k > 0) s->n_tri += zip(rings[k - 1].n, first - rings[k - 1].n, rings[k].n, first, s->tri + 3 * s->n_tri);
        first += rings[k].n;
    }
    return PAL_ERR_OK;
}

static void gradient(shape inside, const double p[3], double g[3])
{
    const double h = 1e-6;
    for (int a = 0; a < 3; a++) {
        double q[3];
        pal_copy3(q, p);
        q[a] += h;
        g[a] = inside(q);
        q[a] -= 2 * h;
        g[a] = (g[a] - inside(q)) / (2 * h);
    }
}

static void count_around(hollow *body)
{
    const pal_surface *s = body->s;
    int32_t n = s->n_vertex;
    memset(body->owner, -1, (size_t)(n * n) * sizeof *body->owner);
    memset(body->valence, 0, (size_t)n);
    for (int c = 0; c < 3 * s->n_tri; c++) {
        int32_t a = s->tri[c], b = s->tri[c % 3 == 2 ? c - 2 : c + 1];
        body->owner[a * n + b] = c / 3;
        body->valence[a]++;
    }
}

/* cotangent of the angle at c between a and b */
static double cotangent(const double *c, const double *a, const double *b)
{
    double u[3], v[3], w[3];
    pal_sub3(u, a, c);
    pal_sub3(v, b, c);
    pal_cross3(w, u, v);
    return pal_dot3(u, v) / fmax(pal_norm3(w), 1e-30);
}

static int32_t third(const int32_t *tri, int32_t a, int32_t b)
{
    return tri[0] != a && tri[0] != b ? tri[0] : tri[1] != a && tri[1] != b ? tri[1] : tri[2];
}

/* do c d b and d c a have the orientation of a b c and b a d? */
static bool stays_flat(const double *a, const double *b, const double *c, const double *d)
{
    double n[3], m[3], left[3], right[3];
    pal_normal3(n, a, b, c);
    pal_normal3(m, b, a, d);
    pal_add3(n, n, m);
    pal_normal3(left, c, d, b);
    pal_normal3(right, d, c, a);
    return pal_dot3(n, left) > 0 && pal_dot3(n, right) > 0;
}

/* flips the edge a b of two faces to c d when its opposite angles sum to more than 180 degrees */
static void flip_edge(hollow *body, int32_t a, int32_t b)
{
    const pal_surface *s = body->s;
    int32_t n = s->n_vertex, *owner = body->owner, left = owner[a * n + b], right = owner[b * n + a];
    int32_t *tl = s->tri + 3 * left, *tr = s->tri + 3 * right, c = third(tl, a, b), d = third(tr, a, b);
    const double *xa = s->x + 3 * a, *xb = s->x + 3 * b, *xc = s->x + 3 * c, *xd = s->x + 3 * d;
    if (body->fixed[a] && body->fixed[b]) return;
    if (body->valence[a] < 5 || body->valence[b] < 5 || body->valence[c] > 6 || body->valence[d] > 6) return;
    if (owner[c * n + d] >= 0 || owner[d * n + c] >= 0) return;
    if (cotangent(xc, xa, xb) + cotangent(xd, xa, xb) > -1e-3 || !stays_flat(xa, xb, xc, xd)) return;
    int32_t one[3] = {c, d, b}, two[3] = {d, c, a};
    memcpy(tl, one, sizeof one);
    memcpy(tr, two, sizeof two);
    owner[a * n + b] = owner[b * n + a] = -1;
    owner[c * n + d] = owner[d * n + b] = owner[b * n + c] = left;
    owner[d * n + c] = owner[c * n + a] = owner[a * n + d] = right;
    body->valence[a]--, body->valence[b]--, body->valence[c]++, body->valence[d]++;
}

static void to_surface(const hollow *body, double x[3])
{
    for (int k = 0; k < 3; k++) {
        double g[3], depth = body->inside(x);
        if (fabs(depth) < 1e-6 * body->reach) return;
        gradient(body->inside, x, g);
        double gg = fmax(pal_dot3(g, g), 1e-6), max = body->reach / sqrt(gg);
        pal_axpy3(x, fmax(fmin(-depth / gg, max), -max), g);
    }
}

/* moves vertices along the surface by a fraction of the distance to the centre of the faces around, and onto the zero
 * set; the centre is weighted by area, or the vertices would slip off together */
static void smooth_tangentially(hollow *body, double share)
{
    pal_surface *s = body->s;
    memset(body->move, 0, 4 * (size_t)s->n_vertex * sizeof *body->move);
    for (int t = 0; t < s->n_tri; t++) {
        const int32_t *c = s->tri + 3 * t;
        double n[3];
        pal_normal3(n, s->x + 3 * c[0], s->x + 3 * c[1], s->x + 3 * c[2]);
        double area = pal_norm3(n);
        for (int k = 0; k < 9; k++) pal_axpy3(body->move + 4 * c[k / 3], area / 3, s->x + 3 * c[k % 3]);
        for (int k = 0; k < 3; k++) body->move[4 * c[k] + 3] += area;
    }
    for (int v = 0; v < s->n_vertex; v++) {
        if (body->fixed[v]) continue;
        double *x = s->x + 3 * v, *to = body->move + 4 * v, g[3];
        pal_scale3(to, 1 / to[3], to);
        pal_sub3(to, to, x);
        gradient(body->inside, x, g);
        double gg = fmax(pal_dot3(g, g), 1e-6);
        pal_axpy3(to, -pal_dot3(to, g) / gg, g);
        pal_axpy3(x, share, to);
        to_surface(body, x);
    }
}

/* cosine of the least angle of the faces of a vertex at x and the n sides across from it */
static double min_cosine(const double *all, const double x[3], int32_t side[][2], int n)
{
    double worst = -1;
    for (int i = 0; i < n; i++) {
        const double *p[5] = {x, all + 3 * side[i][0], all + 3 * side[i][1], x, all + 3 * side[i][0]};
        for (int k = 0; k < 3; k++) {
            double u[3], v[3];
            pal_sub3(u, p[k + 1], p[k]);
            pal_sub3(v, p[k + 2], p[k]);
            worst = fmax(worst, pal_dot3(u, v) / sqrt(pal_dot3(u, u) * pal_dot3(v, v)));
        }
    }
    return worst;
}

/* small steps along the surface that increase the smallest angle around a vertex */
static void widen(hollow *body, int32_t v, double step)
{
    enum { WAYS = 8 };
    pal_surface *s = body->s;
    double *x = s->x + 3 * v, g[3], up[3] = {0, 0, 1}, side[3];
    int32_t around[16][2];
    int n = 0;
    for (int c = 0; c < 3 * s->n_tri && n < 16; c++) {
        const int32_t *t = s->tri + 3 * (c / 3);
        if (s->tri[c] == v) around[n][0] = t[(c + 1) % 3], around[n++][1] = t[(c + 2) % 3];
    }
    gradient(body->inside, x, g);
    if (!pal_unit3(g, g, 0)) return;
    if (fabs(g[2]) > 0.7) pal_set3(up, 1, 0, 0);
    pal_cross3(side, g, up);
    pal_unit3(side, side, 0);
    pal_cross3(up, side, g);
    double best = min_cosine(s->x, x, around, n), from[3];
    pal_copy3(from, x);
    for (int k = 0; k < WAYS && best > WIDE_COS; k++) {
        double to[3];
        pal_copy3(to, from);
        pal_axpy3(to, step * cos(2 * M_PI * k / WAYS), side);
        pal_axpy3(to, step * sin(2 * M_PI * k / WAYS), up);
        to_surface(body, to);
        double now = min_cosine(s->x, to, around, n);
        if (now < best) best = now, pal_copy3(x, to);
    }
}

/* the rings, projected and distributed evenly; on failure nothing is left */
static pal_err make_hollow_body(const ring *rings, int n_ring, const node *spine, int n_node, shape inside,
                                double reach, pal_surface *out)
{
    enum { MAX_VERTEX = 256, STEPS = 500, WIDENINGS = 40 };
    uint8_t valence[MAX_VERTEX], fixed[MAX_VERTEX];
    pal_surface s = {0};
    pal_err err = PAL_ERR_OK;
    hollow body = {.s = &s, .inside = inside, .valence = valence, .fixed = fixed, .reach = reach};
    PAL_ARRAY(&err, body.owner, MAX_VERTEX * MAX_VERTEX);
    PAL_ARRAY(&err, body.move, 4 * MAX_VERTEX);
    if (!err) err = make_tube(rings, n_ring, spine, n_node, &body);
    for (int step = 0; !err && step < STEPS; step++) {
        count_around(&body);
        for (int32_t a = 0; a < s.n_vertex; a++)
            for (int32_t b = 0; b < a; b++)
                if (body.owner[a * s.n_vertex + b] >= 0) flip_edge(&body, a, b);
        smooth_tangentially(&body, step < STEPS / 4 ? 0.05 : 0.5);
    }
    for (int step = 0; !err && step < WIDENINGS; step++)
        for (int32_t v = 0; v < s.n_vertex; v++)
            if (!body.fixed[v]) widen(&body, v, reach / (2 + step));
    PAL_FREE(body.owner, body.move);
    if (err)
        pal_surface_free(&s);
    else
        *out = s;
    return err;
}

static double unit_ball(const double p[3])
{
    return 1 - pal_norm3(p);
}

pal_err pal_sphere_make(double radius_m, pal_surface *out)
{
    static const ring rings[] = {{1, 0, false},    {6, 0.35, false}, {12, 0.7, false},  {18, 1.05, false},
                                 {20, 1.4, false}, {20, 1.6, false}, {18, 1.95, false}, {12, 2.3, false},
                                 {6, 2.65, false}, {1, 3, false}};
    static const node spine[] = {{{0, 0, -1}, 0.02}, {{0, 0, -0.5}, 0.8}, {{0, 0, 0.5}, 0.8}, {{0, 0, 1}, 0.02}};
    if (!(radius_m > 0) || !isfinite(radius_m)) return PAL_ERR_REFUSED;
    PAL_TRY(make_hollow_body(rings, sizeof rings / sizeof *rings, spine, 4, unit_ball, 0.1, out));
    for (int i = 0; i < out->n_vertex; i++) {
        pal_unit3(out->x + 3 * i, out->x + 3 * i, 0);
        pal_scale3(out->x + 3 * i, radius_m, out->x + 3 * i);
    }
    return PAL_ERR_OK;
}

/* oesophagus, cardia, body, antrum, pylorus, duodenum */
static const node gut[] = {{{-0.014, 0.155, 0}, 0.0155},      {{0.004, 0.100, 0}, 0.0155},
                           {{0.050, 0.078, 0}, 0.042},        {{0.050, 0.015, 0}, 0.041},
                           {{0.022, -0.040, 0.004}, 0.036},   {{-0.030, -0.055, 0.008}, 0.026},
                           {{-0.066, -0.036, 0.004}, 0.0155}, {{-0.095, -0.012, -0.004}, 0.0155}};
enum { N_GUT = sizeof gut / sizeof *gut };

/* about the distance to the surface of the cone between two balls */
static double cone(const double p[3], const node *a, const node *b)
{
    double u[3], v[3];
    pal_sub3(u, b->x, a->x);
    pal_sub3(v, p, a->x);
    double t = fmin(fmax(pal_dot3(u, v) / pal_dot3(u, u), 0), 1);
    pal_axpy3(v, -t, u);
    return a->r + t * (b->r - a->r) - pal_norm3(v);
}

static double stomach(const double p[3])
{
    static const node fundus = {{0.060, 0.088, 0}, 0.042};
    double inside = fundus.r - pal_dist3(p, fundus.x);
    for (int k = 0; k + 1 < N_GUT; k++) inside = blend(inside, cone(p, &gut[k], &gut[k + 1]), 0.02, 1);
    return inside;
}

pal_err pal_stomach_make(pal_stomach *out)
{
    static const ring rings[] = {{1, 0, true},     {6, 0, true},     {6, 0.3, false},  {8, 0.6, false},
                                 {12, 0.9, false}, {17, 1.3, false}, {20, 1.7, false}, {22, 2.2, false},
                                 {22, 2.6, false}, {20, 3.1, false}, {18, 3.6, false}, {14, 4.3, false},
                                 {9, 5.1, false},  {6, 5.8, false},  {6, 7.0, true},   {1, 7.0, true}};
    pal_stomach made = {.oesophagus_cap = 0, .duodenum_cap = PAL_STOMACH_VERTEX - 1};
    PAL_TRY(make_hollow_body(rings, sizeof rings / sizeof *rings, gut, N_GUT, stomach, 0.003, &made.surface));
    for (int k = 0; k < PAL_STOMACH_RING; k++) {
        made.oesophagus[k] = 1 + k;
        made.duodenum[k] = PAL_STOMACH_VERTEX - 1 - PAL_STOMACH_RING + k;
    }
    *out = made;
    return PAL_ERR_OK;
}

pal_err pal_sheet_make(int n, int m, double width_m, double height_m, pal_surface *out, pal_diagnostic *diag)
{
    if (n < 2 || m < 2 || n > 20000 || m > 20000 || (double)n * m > 1e7)
        return PAL_REFUSE(diag, "sheet: %d x %d vertices, 2 to 20000 along a side and 10 million together are made", n,
                          m);
    if (!(width_m > 0 && width_m <= 1e6 && height_m > 0 && height_m <= 1e6))
        return PAL_REFUSE(diag, "sheet: a size of %g x %g m", width_m, height_m);
    pal_surface s = {.n_vertex = n * m, .n_tri = 2 * (n - 1) * (m - 1)};
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, s.x, 3 * (size_t)s.n_vertex);
    PAL_ARRAY(&err, s.tri, 3 * (size_t)s.n_tri);
    if (err) {
        pal_surface_free(&s);
        return err;
    }
    int32_t *to = s.tri;
    for (int j = 0; j < m; j++)
        for (int i = 0; i < n; i++) {
            int32_t a = j * n + i;
            pal_set3(s.x + 3 * (size_t)a, width_m * (i / (n - 1.0) - 0.5), height_m * (j / (m - 1.0) - 0.5), 0);
            if (i == n - 1 || j == m - 1) continue;
            int32_t two[6] = {a, a + 1, a + n + 1, a, a + n + 1, a + n};
            memcpy(to, two, sizeof two);
            to += 6;
        }
    *out = s;
    return PAL_ERR_OK;
}
