/* The best-fit rigid motion of an adaptive surface (shape matching: Mueller et al. 2005), for anchors that let the body
 * move (erratum C7) and for speeds measured against it.
 *
 * A = sum m (x - c)(x0 - c0)', R its rotation; L = sum m (x - c) x (v - V) = I Omega. One pass over the nodes, about
 * the first of them: as sum m (x0 - c0) = 0, A needs no centre of x. The nodes are summed in CHUNKS chunks, and these
 * in their order, so that threads share the pass and the bits do not depend on their number. */
#include "server/sim/surface/adaptive_surface.h"

#include "server/base/team.h"
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/sim/core/rigid_motion.h"
#include "server/sim/surface/active_nodes.h"

#include <math.h>

enum { CHUNKS = 16 };

typedef struct sums {
    double mass, x[3], v[3]; /* x about the first node     */
    double a[9];             /* sum m x (x0 - c0)'         */
    double square[6];        /* sum m x x': xx yy zz xy xz yz */
    double angular[3];       /* sum m x cross v            */
} sums;

/* one node: mass, place, place at rest, velocity */
PAL_INLINE void add_node(sums *t, const double from[3], const double c[3], double m, const double *p, const double *r,
                         const double *v)
{
    const double x = p[0] - from[0], y = p[1] - from[1], z = p[2] - from[2];
    const double mx = m * x, my = m * y, mz = m * z, r0 = r[0] - c[0], r1 = r[1] - c[1], r2 = r[2] - c[2];
    t->mass += m;
    t->x[0] += mx, t->x[1] += my, t->x[2] += mz;
    t->v[0] += m * v[0], t->v[1] += m * v[1], t->v[2] += m * v[2];
    t->a[0] += mx * r0, t->a[1] += mx * r1, t->a[2] += mx * r2;
    t->a[3] += my * r0, t->a[4] += my * r1, t->a[5] += my * r2;
    t->a[6] += mz * r0, t->a[7] += mz * r1, t->a[8] += mz * r2;
    t->square[0] += mx * x, t->square[1] += my * y, t->square[2] += mz * z;
    t->square[3] += mx * y, t->square[4] += mx * z, t->square[5] += my * z;
    t->angular[0] += my * v[2] - mz * v[1], t->angular[1] += mz * v[0] - mx * v[2],
        t->angular[2] += mx * v[1] - my * v[0];
}

static void fit(const pal_adaptive_surface *s, const double from[3], sums t, pal_rigid_fit *frame)
{
    double *q = frame->quat, length = 0, c[3], moment[3], arm[3], size = 0;
    for (int k = 0; k < 4; k++) length += q[k] * q[k];
    if (!(length > 0.5 && length < 2)) q[0] = 1, q[1] = q[2] = q[3] = 0;
    /* a body in a point has neither rotation nor spin */
    for (int k = 0; k < 9; k++) size += t.a[k] * t.a[k];
    if (size > PAL_ROUNDING * PAL_ROUNDING * s->rest_kg_m2 * s->rest_kg_m2) pal_polar_rotation(t.a, q, 40);
    pal_quat_matrix(q, frame->R);
    pal_scale3(c, 1 / t.mass, t.x);
    pal_scale3(frame->V_m_s, 1 / t.mass, t.v);
    pal_add3(frame->centre_m, from, c);
    pal_copy3(frame->rest_centre_m, s->rest_centre_m);
    pal_cross3(arm, c, t.v);
    pal_sub3(moment, t.angular, arm);
    double xx = t.square[0] - c[0] * t.x[0], yy = t.square[1] - c[1] * t.x[1], zz = t.square[2] - c[2] * t.x[2];
    double xy = t.square[3] - c[0] * t.x[1], xz = t.square[4] - c[0] * t.x[2], yz = t.square[5] - c[1] * t.x[2];
    const double inertia[9] = {yy + zz, -xy, -xz, -xy, xx + zz, -yz, -xz, -yz, xx + yy};
    pal_rigid_spin(inertia, moment, PAL_ROUNDING * PAL_ROUNDING * s->rest_kg_m2, frame->Omega_1_s);
}

static void add_sums(sums *to, const sums *from)
{
    double *sum = (double *)to;
    const double *add = (const double *)from;
    for (size_t k = 0; k < sizeof *to / sizeof *sum; k++) sum[k] += add[k];
}

void pal_adaptive_fit_rigid(const pal_adaptive_surface *s, const pal_body *body, pal_rigid_fit *frame)
{
    const double *from = body->x + 3 * (size_t)s->node[0];
    sums t = {0};
    for (int chunk = 0; chunk < CHUNKS; chunk++) {
        const int end = pal_part_first(s->n_node, CHUNKS, chunk + 1);
        sums part = {0};
        for (int k = pal_part_first(s->n_node, CHUNKS, chunk); k < end; k++) {
            const size_t i = (size_t)s->node[k];
            add_node(&part, from, s->rest_centre_m, body->mass_kg[i], body->x + 3 * i, body->x_rest + 3 * i,
                     body->v + 3 * i);
        }
        add_sums(&t, &part);
    }
    fit(s, from, t, frame);
}

typedef struct fit_pass {
    const pal_adaptive_surface *s;
    const pal_active_nodes *pack;
    int n_part;
    sums chunk[CHUNKS];
} fit_pass;

static void sum_part(void *user, int worker, int part)
{
    fit_pass *p = user;
    const double *from = (const double *)p->pack->xv;
    (void)worker;
    for (int c = pal_part_first(CHUNKS, p->n_part, part); c < pal_part_first(CHUNKS, p->n_part, part + 1); c++) {
        const int end = pal_part_first(p->s->n_node, CHUNKS, c + 1);
        sums t = {0};
        for (int k = pal_part_first(p->s->n_node, CHUNKS, c); k < end; k++) {
            const double *x = (const double *)&p->pack->xv[k], *rest = (const double *)&p->pack->rest[k];
            add_node(&t, from, p->s->rest_centre_m, rest[3], x, rest, x + 4);
        }
        p->chunk[c] = t;
    }
}

void pal_adaptive_fit_rigid_active(const pal_adaptive_surface *s, const pal_body *body, pal_rigid_fit *frame)
{
    fit_pass p = {.s = s, .pack = body->active_nodes, .n_part = pal_active_parts(body)};
    sums t = {0};
    pal_team_run(body->team, p.n_part, sum_part, &p);
    for (int c = 0; c < CHUNKS; c++) add_sums(&t, &p.chunk[c]);
    fit(s, (const double *)p.pack->xv, t, frame);
}
