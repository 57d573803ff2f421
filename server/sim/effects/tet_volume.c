/* Row tet_volume: every tetrahedron keeps its signed volume, so that an inverted one turns back. C = (V - V0)/V0,
 * E = k/2 C^2, f_a = -(k C + c C') dV/dx_a / V0 (paper B 4.1, F_V).
 *
 * Departures: errata B3, B4 (true gradients, area/3 each, not unit directions; 1/V0^2; V0 is the rest volume). A
 * tetrahedron with V0 below 1e-6 h^3 is left out: it would set the sub-step of the whole body. */
#include "server/base/vec3.h"
#include "server/sim/effect_list.h"
#include "server/sim/spring_law.h"

enum { CHUNK = PAL_SPRING_CHUNK };

typedef struct tet_volume {
    pal_spring spring;
    int n_tet;
    size_t n_padded;
    int32_t *corner[4]; /* index of their x coordinate      [n_padded] */
    double *inv_6V0;    /* 1 / (6 V0), 1/m^3; 0 on padding  [n_padded] */
} tet_volume;

/* 6 V and its gradients at corners 1, 2, 3; that at corner 0 is minus their sum */
typedef struct shape {
    double g[3][3], volume6;
} shape;

static inline void cross(double r[3], const double a[3], const double b[3])
{
    r[0] = a[1] * b[2] - a[2] * b[1], r[1] = a[2] * b[0] - a[0] * b[2], r[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void measure(shape *s, const double *x, int a, int b, int c, int d)
{
    double e1[3], e2[3], e3[3];
    for (int k = 0; k < 3; k++) e1[k] = x[b + k] - x[a + k], e2[k] = x[c + k] - x[a + k], e3[k] = x[d + k] - x[a + k];
    cross(s->g[0], e2, e3);
    cross(s->g[1], e3, e1);
    cross(s->g[2], e1, e2);
    s->volume6 = e1[0] * s->g[0][0] + e1[1] * s->g[0][1] + e1[2] * s->g[0][2];
}

static pal_err fill(tet_volume *row, const pal_build *build)
{
    const pal_body *body = build->body;
    const pal_tets *tets = body->tets;
    row->n_padded = pal_spring_padded(tets->n_tet);
    for (int k = 0; k < 4; k++) {
        row->corner[k] = PAL_NEW(build->arena, int32_t, row->n_padded);
        if (!row->corner[k]) return PAL_ERR_MEMORY;
    }
    row->inv_6V0 = PAL_NEW(build->arena, double, row->n_padded);
    if (!row->inv_6V0) return PAL_ERR_MEMORY;
    for (int t = 0; t < tets->n_tet; t++) {
        shape s;
        const int32_t *node = tets->tet + 4 * t;
        measure(&s, body->x_rest, 3 * node[0], 3 * node[1], 3 * node[2], 3 * node[3]);
        if (!(s.volume6 > 6e-6 * body->h_m * body->h_m * body->h_m)) continue;
        for (int k = 0; k < 4; k++) row->corner[k][row->n_tet] = 3 * node[k];
        row->inv_6V0[row->n_tet++] = 1 / s.volume6;
    }
    return PAL_ERR_OK;
}

static pal_err make(pal_item *item, pal_build *build, void **self)
{
    tet_volume *row = PAL_NEW(build->arena, tet_volume, 1);
    if (!row) return PAL_ERR_MEMORY;
    PAL_TRY(pal_spring_read(PAL_SPRING_VOLUME, item, build, &row->spring));
    *self = row;
    return fill(row, build);
}

/* a chunk's forces on corners 1, 2, 3 */
static inline void compute(const tet_volume *row, const pal_body *body, size_t first, bool damped, double f[9][CHUNK])
{
    const int32_t *a = row->corner[0] + first, *b = row->corner[1] + first, *c = row->corner[2] + first,
                  *d = row->corner[3] + first;
    const double *inv = row->inv_6V0 + first, *x = body->d, *v = body->dv;
    double k = row->spring.k_J, damp = row->spring.c_Js;
    for (int l = 0; l < CHUNK; l++) {
        shape s;
        measure(&s, x, a[l], b[l], c[l], d[l]);
        double w = inv[l], p = k * (s.volume6 * w - 1);
        if (damped) {
            double rate = 0;
            for (int q = 0; q < 3; q++)
                rate += s.g[0][q] * (v[b[l] + q] - v[a[l] + q]) + s.g[1][q] * (v[c[l] + q] - v[a[l] + q]) +
                        s.g[2][q] * (v[d[l] + q] - v[a[l] + q]);
            p += damp * w * rate;
        }
        double t = -p * w;
        for (int q = 0; q < 3; q++) f[q][l] = t * s.g[0][q], f[3 + q][l] = t * s.g[1][q], f[6 + q][l] = t * s.g[2][q];
    }
}

static pal_err run(void *self, pal_step *step)
{
    const tet_volume *row = self;
    const pal_body *body = step->body;
    double *force = body->f, f[9][CHUNK];
    for (size_t first = 0; first < row->n_padded; first += CHUNK) {
        if (row->spring.c_Js > 0)
            compute(row, body, first, true, f);
        else
            compute(row, body, first, false, f);
        for (size_t l = 0; l < CHUNK; l++) {
            double *fa = force + row->corner[0][first + l], *fb = force + row->corner[1][first + l],
                   *fc = force + row->corner[2][first + l], *fd = force + row->corner[3][first + l];
            for (int q = 0; q < 3; q++) {
                fa[q] -= f[q][l] + f[3 + q][l] + f[6 + q][l];
                fb[q] += f[q][l];
                fc[q] += f[3 + q][l];
                fd[q] += f[6 + q][l];
            }
        }
    }
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    const tet_volume *row = self;
    double sum = 0;
    for (int t = 0; t < row->n_tet; t++) {
        shape s;
        measure(&s, body->d, row->corner[0][t], row->corner[1][t], row->corner[2][t], row->corner[3][t]);
        double c = s.volume6 * row->inv_6V0[t] - 1;
        sum += 0.5 * row->spring.k_J * c * c;
    }
    return sum;
}

/* |g_a| = opposite area / (3 V0); the bending of V adds k |C| (perimeter of the opposite face)/(6 V0) */
static void add_bound(const tet_volume *row, const pal_body *body, double k, bool bend, double *bound)
{
    for (int t = 0; t < row->n_tet; t++) {
        shape s;
        double g0[3], w = row->inv_6V0[t], size[4], sum = 0;
        int corner[4];
        for (int q = 0; q < 4; q++) corner[q] = row->corner[q][t];
        measure(&s, body->d, corner[0], corner[1], corner[2], corner[3]);
        for (int q = 0; q < 3; q++) g0[q] = s.g[0][q] + s.g[1][q] + s.g[2][q];
        size[0] = pal_norm3(g0);
        for (int q = 0; q < 3; q++) size[q + 1] = pal_norm3(s.g[q]);
        for (int q = 0; q < 4; q++) sum += size[q];
        double bending = bend ? k * fabs(s.volume6 * w - 1) * w : 0;
        for (int q = 0; q < 4; q++) {
            const double *p = body->d + corner[(q + 1) & 3], *o = body->d + corner[(q + 2) & 3],
                         *r = body->d + corner[(q + 3) & 3];
            double round = pal_dist3(p, o) + pal_dist3(o, r) + pal_dist3(r, p);
            bound[corner[q] / 3] += k * w * w * size[q] * sum + bending * round;
        }
    }
}

static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    const tet_volume *row = self;
    add_bound(row, body, row->spring.k_J, true, bound_N_m);
}

static void damping(void *self, const pal_body *body, double *bound_Ns_m)
{
    const tet_volume *row = self;
    if (row->spring.c_Js > 0) add_bound(row, body, row->spring.c_Js, false, bound_Ns_m);
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_note *note)
{
    (void)note;
    pal_spring_material(&((tet_volume *)self)->spring, body, to);
    return PAL_ERR_OK;
}

const pal_effect pal_effect_tet_volume = {.name = "tet_volume",
                                          .stage = PAL_STAGE_FORCE,
                                          .internal = true,
                                          .make = make,
                                          .run = run,
                                          .energy = energy,
                                          .stiffness = stiffness,
                                          .damping = damping,
                                          .material = material};
