/* Elastic tetrahedra: the elements of tet_elastic.
 *
 * corotational: one rotation R per element, the polar factor of F at its centre, f = -R K_e (R'x - X), tangent R K_e R'
 * (the derivative of R is dropped). In tet10 the Gauss points rotate against the centre, so that this force is not the
 * gradient of the energy and has a net torque of second order; the term from the change of R is added, except where R
 * is nearly undefined (a crushed element). linear: f = -K u. neo_hookean: stable form (elastic_law.h) at each Gauss
 * point, tangent projected to positive semi-definite.
 *
 * Recovery from inversion (corotational and neo_hookean): recovery/recovery.h, by det F at the Gauss points and the
 * centre. R is the nearest proper rotation, whatever F.
 *
 * An element with less than 1e-6 h^3 of volume at rest is left out. Memory: the component's arena. Thread: [load] to
 * make, then [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_TET_H
#define PAL_SIM_ELEMENTS_ELASTIC_TET_H
#include "server/sim/core/force_cache.h"
#include "server/sim/elements/elastic_law.h"
#include "server/sim/recovery/recovery.h"

typedef struct pal_elastic_tets_options {
    pal_elastic_law law;
    bool recover;
    int n_corner; /* 4, or 10 with mid-edge nodes as in num/shape_functions.h */
    int n_tet;
    const int32_t *tet; /* borrowed [n_tet][n_corner]              */
    const float *fill;  /* share of material, borrowed; NULL: 1 [n_tet] */
} pal_elastic_tets_options;

/* PAL_TET_CENTRE: index of the centre among the Gauss points. PAL_TET_MODES: numbers of a neo-Hookean tangent at a
 * Gauss point: u 9, D v 9, stretch 6, same 3, cross 3 (elastic_tet_modes.c) */
enum { PAL_TET_CENTRE = 4, PAL_TET_MODES = 30 };

typedef struct pal_elastic_tets {
    pal_elastic_tets_options options;
    int n_point; /* Gauss points: 1 or 4 */
    /* gradients of the shape functions in local coordinates at the Gauss points and at the centre */
    double shape[5][10][3];
    int n_node;
    int n_block; /* blocks of 8 elements; strips first, then loose ones */
    pal_node_order *node_order;
    pal_simd_blocks simd_blocks;
    int32_t *corner; /* nodes of each element in the order of the kernels [n_tet][n_corner] */
    int32_t *place;  /* lane of each element, 8 block + lane               [n_tet]           */
    int32_t *owner;  /* element of each lane, -1: none                     [n_block][8]      */
    pal_elastic_regions parts;
    const double *x_rest; /* borrowed [n_node][3]                     */
    double *inverse;      /* local from rest coordinates, dl/dX       [n_block][9][8]  */
    double *volume_m3;    /* fill times volume at rest, 0: left out   [n_block][8]     */
    double *stiff;        /* volume times mu and lambda               [n_block][2][8]  */
    double *rotation;     /* rotations as quaternions, warm start     [n_block][4][8]  */
    double *tangent;      /* tangent at the last linearise, by law    [n_block][..][8] */
    double *bound;        /* Gershgorin row sums at rest, N/m, independent of rotation [n_node] */
    int32_t *entry;       /* blocks of the pattern last assembled into, corner pairs a >= b [n_tet][10 or 55] */
    const int32_t *entry_row;
    const pal_block_matrix *entry_of;
    double edge_m;
    int n_inverted;           /* elements with a bad ratio of volume at the last force, energy or linearise */
    pal_recovery *recovery;   /* NULL: none                                        */
    double *whole;            /* with recovery: stiff of all; 0 in regions there        [n_block][2][8]  */
    pal_force_cache *counted; /* n_inverted is of its positions; NULL: not known      */
} pal_elastic_tets;

/* number k of `width` of the element in lane `place` */
static inline double *pal_lane(double *array, int width, int place, int k)
{
    return &array[((size_t)(place / PAL_LANES) * (size_t)width + (size_t)k) * PAL_LANES + (size_t)(place % PAL_LANES)];
}
/* mu and lambda of an element, times its volume at rest */
static inline void pal_tet_stiffness(const pal_elastic_tets *t, int e, double *mu, double *lambda)
{
    *mu = *pal_lane(t->stiff, 2, t->place[e], 0), *lambda = *pal_lane(t->stiff, 2, t->place[e], 1);
}

/* the same where nothing is inverted */
static inline void pal_tet_whole_stiffness(const pal_elastic_tets *t, int e, double *mu, double *lambda)
{
    double *of = t->whole ? t->whole : t->stiff;
    *mu = *pal_lane(of, 2, t->place[e], 0), *lambda = *pal_lane(of, 2, t->place[e], 1);
}

/* At rest. With 4 corners it uses body->node_order, which is made when NULL; regions and material from build->def */
pal_err pal_elastic_tets_make(const pal_elastic_tets_options *options, pal_build *build, pal_elastic_tets *out);
void pal_elastic_tets_material(pal_elastic_tets *t, const pal_material *material);
void pal_elastic_tets_reset(pal_elastic_tets *t);                     /* rotations become the identity */
pal_err pal_tet_recovery_make(pal_elastic_tets *t, pal_build *build); /* MEMORY. [load] */
void pal_elastic_tets_count(pal_elastic_tets *t, const double *d);    /* n_inverted and rotations at d */
/* f += forces at positions d, both [n_node][3]; updates the rotations */
void pal_elastic_tets_force(pal_elastic_tets *t, const double *d, double *f);
/* energy, J; updates the rotations. f += forces; NULL: none */
double pal_elastic_tets_energy(pal_elastic_tets *t, const double *d, double *f);
/* bound_N_m [n_node] += Gershgorin row sums of the stiffness at d */
void pal_elastic_tets_bound(pal_elastic_tets *t, const double *d, double *bound_N_m);
/* evaluates tangent and rotations at d */
void pal_elastic_tets_linearise(pal_elastic_tets *t, const double *d);
/* at the last linearise: out += k K p; to += k K; rotation [n_node][9] += mu V R at each corner */
void pal_elastic_tets_multiply(const pal_elastic_tets *t, double k, const double *p, double *out);
void pal_elastic_tets_assemble(pal_elastic_tets *t, double k, pal_block_matrix *to);
void pal_elastic_tets_rotate(const pal_elastic_tets *t, double *rotation);
/* one element: its rotation; F at d at Gauss point `point` or PAL_TET_CENTRE */
void pal_elastic_tets_rotation(const pal_elastic_tets *t, int e, double r[9]);
void pal_elastic_tets_gradient(const pal_elastic_tets *t, int e, int point, const double *d, double f[9]);
/* effect.h measure, stress; von Mises of the Cauchy stress (corotational, linear: of the rotated small-strain stress)
 */
void pal_elastic_tets_measure(pal_elastic_tets *t, const double *d, pal_field field, double *sum, double *volume_m3);
void pal_elastic_tets_stress(pal_elastic_tets *t, const double *d, pal_stress_take *take, void *user);
#endif
