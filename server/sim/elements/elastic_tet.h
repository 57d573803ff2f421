/* Elastic tetrahedra: the elements of tet_elastic, and of hex_elastic while it runs on its five-tetrahedra split.
 *
 * corotational: one rotation R per element, the polar factor of F at its centre, f = -R K_e (R'x - X), tangent R K_e R'
 * (the derivative of R is dropped). In tet10 the Gauss points rotate against the centre, so that this force is not the
 * gradient of the energy and has a net torque of second order; the term from the change of R is added, except where R
 * is nearly undefined (a crushed element). linear: f = -K u. neo_hookean: stable form (elastic_law.h) at each Gauss
 * point, tangent projected to positive semi-definite.
 *
 * Averaged rotation (corotational): an element with det F <= 0 at its centre or a Gauss point takes the polar part of
 * the sum, over its corners, of the rotations averaged over the elements around each that are not inverted; its own
 * where there are none. While an element is inverted, small forces on all nodes balance the net torque of the averaged
 * rotations, so that a free body does not turn itself.
 *
 * Single rotation (corotational, elastic_tet_single_rotation.c): a body that pal_elastic_tets_check_rest finds in a
 * fold takes one rotation for all elements, that of the supports (of all nodes without supports): the energy is then
 * quadratic with no other minimum than the shape at rest. Moduli are lowered so that the energy does not jump.
 *
 * An element with less than 1e-6 h^3 of volume at rest is left out. Memory: the component's arena. Thread: [load] to
 * make, then [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_TET_H
#define PAL_SIM_ELEMENTS_ELASTIC_TET_H
#include "server/sim/elements/elastic_law.h"

typedef struct pal_elastic_tets_options {
    pal_elastic_law law;
    bool recover;
    int n_corner; /* 4, or 10 with mid-edge nodes as in num/shape_functions.h */
    int n_tet;
    const int32_t *tet; /* borrowed [n_tet][n_corner]              */
    const float *fill;  /* share of material, borrowed; NULL: 1 [n_tet] */
    double max_poisson; /* larger Poisson ratios are taken as this one; 0: no limit */
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
    const uint8_t *fixed; /* borrowed [n_node]                        */
    double *inverse;      /* local from rest coordinates, dl/dX       [n_block][9][8]  */
    double *volume_m3;    /* fill times volume at rest, 0: left out   [n_block][8]     */
    double *stiff;        /* volume times mu and lambda               [n_block][2][8]  */
    double *rotation;     /* rotations as quaternions, warm start     [n_block][4][8]  */
    double *tangent;      /* tangent at the last linearise, by law    [n_block][..][8] */
    double *bound;        /* Gershgorin row sums at rest, N/m, independent of rotation [n_node] */
    double *around;       /* sums of rotations around nodes while an element is inverted [n_node][9] */
    int32_t *inverted;    /* elements with det F <= 0 at the last force or linearise [n_inverted] */
    int32_t *entry;       /* blocks of the pattern last assembled into, corner pairs a >= b [n_tet][10 or 55] */
    const int32_t *entry_row;
    const pal_block_matrix *entry_of;
    uint8_t *flag;        /* zero between calls [n_tet] */
    bool single_rotation; /* all elements have one rotation ...                                         */
    double soft;          /* ... and this part of their moduli                                          */
    double *x_before;     /* positions n_still updates ago; options.recover                [n_node][3]  */
    int n_still;
    int n_single_rotation; /* times with a single rotation since the body was last free of inversion for long */
    int n_whole;           /* updates without inversion                                                  */
    int n_inverted;
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

/* At rest. With 4 corners it uses body->node_order, which is made when NULL; regions and material from build->def */
pal_err pal_elastic_tets_make(const pal_elastic_tets_options *options, pal_build *build, pal_elastic_tets *out);
void pal_elastic_tets_material(pal_elastic_tets *t, const pal_material *material);
void pal_elastic_tets_reset(pal_elastic_tets *t); /* rotations become the identity */
/* Before a linearise of a body under an implicit solver. Gives all elements a single rotation when the body is
 * inverted, has not moved by 0.001 S in 64 calls and bears no load above a hundredth of load_cap_N; true: from now on.
 * A body that is inverted again soon after two such times rests so under its loads and is left alone */
bool pal_elastic_tets_check_rest(pal_elastic_tets *t, const pal_body *body, bool has_inversion);
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
