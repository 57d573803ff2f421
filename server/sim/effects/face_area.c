/* Row face_area: every triangle of the mesh, inner ones too, keeps its area. C = (A - A0)/A0, E = k/2 C^2,
 * f_a = -(k C + c C') n x (x_c - x_b)/(2 A0) and cyclic, n the unit normal (paper B 4.1, F_A).
 *
 * Departures: errata B2, B3, B5 (true gradients: the paper's sign pushes away from A0 and its equal magnitudes create
 * momentum). A triangle smaller than 1e-12 S^2 has no normal and is left out. */
#include "server/base/vec3.h"
#include "server/sim/effect_list.h"
#include "server/sim/spring_law.h"

#include <stdlib.h>

enum { CHUNK = PAL_SPRING_CHUNK };

typedef struct face_area {
    pal_spring spring;
    int n_face;
    size_t n_padded;
    int32_t *corner[3]; /* index of their x coordinate        [n_padded] */
    double *inv_2A0;    /* 1 / (2 A0), 1/m^2; 0 on padding    [n_padded] */
    double least_m2;    /* of 2 A                                        */
} face_area;

/* e1, e2 from corner a, their cross product and its length 2A */
typedef struct shape {
    double e1[3], e2[3], n[3], size;
} shape;

static inline void measure(shape *s, const double *x, int a, int b, int c)
{
    for (int k = 0; k < 3; k++) s->e1[k] = x[b + k] - x[a + k], s->e2[k] = x[c + k] - x[a + k];
    s->n[0] = s->e1[1] * s->e2[2] - s->e1[2] * s->e2[1];
    s->n[1] = s->e1[2] * s->e2[0] - s->e1[0] * s->e2[2];
    s->n[2] = s->e1[0] * s->e2[1] - s->e1[1] * s->e2[0];
    s->size = sqrt(s->n[0] * s->n[0] + s->n[1] * s->n[1] + s->n[2] * s->n[2]);
}

static pal_err fill(face_area *row, const pal_build *build, const int32_t *face, int n_face)
{
    const pal_body *body = build->body;
    row->n_padded = pal_spring_padded(n_face);
    for (int k = 0; k < 3; k++) {
        row->corner[k] = PAL_NEW(build->arena, int32_t, row->n_padded);
        if (!row->corner[k]) return PAL_ERR_MEMORY;
    }
    row->inv_2A0 = PAL_NEW(build->arena, double, row->n_padded);
    if (!row->inv_2A0) return PAL_ERR_MEMORY;
    row->least_m2 = 2e-12 * body->size_m * body->size_m;
    for (int f = 0; f < n_face; f++) {
        shape s;
        const int32_t *node = face + 3 * f;
        measure(&s, body->x_rest, 3 * node[0], 3 * node[1], 3 * node[2]);
        if (!(s.size > row->least_m2)) continue;
        for (int k = 0; k < 3; k++) row->corner[k][row->n_face] = 3 * node[k];
        row->inv_2A0[row->n_face++] = 1 / s.size;
    }
    return PAL_ERR_OK;
}

static pal_err make(pal_item *item, pal_build *build, void **self)
{
    face_area *row = PAL_NEW(build->arena, face_area, 1);
    if (!row) return PAL_ERR_MEMORY;
    PAL_TRY(pal_spring_read(PAL_SPRING_AREA, item, build, &row->spring));
    int32_t *face;
    int n_face;
    PAL_TRY(pal_tets_faces(build->body->tets, &face, &n_face));
    pal_err err = fill(row, build, face, n_face);
    free(face);
    *self = row;
    return err;
}

/* a chunk's forces on corners b (0..2) and c (3..5); that on a is minus their sum */
static inline void compute(const face_area *row, const pal_body *body, size_t first, bool damped, double f[6][CHUNK])
{
    const int32_t *a = row->corner[0] + first, *b = row->corner[1] + first, *c = row->corner[2] + first;
    const double *inv = row->inv_2A0 + first, *x = body->d, *v = body->dv;
    double k = row->spring.k_J, damp = row->spring.c_Js, least = row->least_m2;
    for (int l = 0; l < CHUNK; l++) {
        shape s;
        measure(&s, x, a[l], b[l], c[l]);
        bool flat = !(s.size > least);
        double w = inv[l], inv_size = 1 / (flat ? 1.0 : s.size), p = k * (s.size * w - 1);
        double gb[3] = {s.e2[1] * s.n[2] - s.e2[2] * s.n[1], s.e2[2] * s.n[0] - s.e2[0] * s.n[2],
                        s.e2[0] * s.n[1] - s.e2[1] * s.n[0]};
        double gc[3] = {s.n[1] * s.e1[2] - s.n[2] * s.e1[1], s.n[2] * s.e1[0] - s.n[0] * s.e1[2],
                        s.n[0] * s.e1[1] - s.n[1] * s.e1[0]};
        if (damped) {
            double rate = 0;
            for (int q = 0; q < 3; q++)
                rate += gb[q] * (v[b[l] + q] - v[a[l] + q]) + gc[q] * (v[c[l] + q] - v[a[l] + q]);
            p += damp * w * inv_size * rate;
        }
        double t = flat ? 0.0 : -p * w * inv_size;
        for (int q = 0; q < 3; q++) f[q][l] = t * gb[q], f[3 + q][l] = t * gc[q];
    }
}

static pal_err run(void *self, pal_step *step)
{
    const face_area *row = self;
    const pal_body *body = step->body;
    double *force = body->f, f[6][CHUNK];
    for (size_t first = 0; first < row->n_padded; first += CHUNK) {
        if (row->spring.c_Js > 0)
            compute(row, body, first, true, f);
        else
            compute(row, body, first, false, f);
        for (size_t l = 0; l < CHUNK; l++) {
            double *fa = force + row->corner[0][first + l], *fb = force + row->corner[1][first + l],
                   *fc = force + row->corner[2][first + l];
            for (int q = 0; q < 3; q++) {
                fa[q] -= f[q][l] + f[3 + q][l];
                fb[q] += f[q][l];
                fc[q] += f[3 + q][l];
            }
        }
    }
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    const face_area *row = self;
    double sum = 0;
    for (int f = 0; f < row->n_face; f++) {
        shape s;
        measure(&s, body->d, row->corner[0][f], row->corner[1][f], row->corner[2][f]);
        double c = s.size * row->inv_2A0[f] - 1;
        sum += 0.5 * row->spring.k_J * c * c;
    }
    return sum;
}

/* |g_a| = opposite edge / (2 A0); the bending of A adds k C (g g/|n| + 2)/(2 A0) where it stiffens, C > 0 */
static void add_bound(const face_area *row, const pal_body *body, double k, bool bend, double *bound)
{
    for (int f = 0; f < row->n_face; f++) {
        shape s;
        double e3[3], w = row->inv_2A0[f];
        measure(&s, body->d, row->corner[0][f], row->corner[1][f], row->corner[2][f]);
        pal_sub3(e3, s.e2, s.e1);
        double edge[3] = {pal_norm3(e3), pal_norm3(s.e2), pal_norm3(s.e1)}, sum = edge[0] + edge[1] + edge[2];
        double c = s.size * w - 1, along = k * w * w * sum, flat = 0;
        if (bend && c > 0) along += k * c * w * sum / s.size, flat = 2 * k * c * w;
        for (int q = 0; q < 3; q++) bound[row->corner[q][f] / 3] += along * edge[q] + flat;
    }
}

static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    const face_area *row = self;
    add_bound(row, body, row->spring.k_J, true, bound_N_m);
}

static void damping(void *self, const pal_body *body, double *bound_Ns_m)
{
    const face_area *row = self;
    if (row->spring.c_Js > 0) add_bound(row, body, row->spring.c_Js, false, bound_Ns_m);
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_note *note)
{
    (void)note;
    pal_spring_material(&((face_area *)self)->spring, body, to);
    return PAL_ERR_OK;
}

const pal_effect pal_effect_face_area = {.name = "face_area",
                                         .stage = PAL_STAGE_FORCE,
                                         .internal = true,
                                         .make = make,
                                         .run = run,
                                         .energy = energy,
                                         .stiffness = stiffness,
                                         .damping = damping,
                                         .material = material};
