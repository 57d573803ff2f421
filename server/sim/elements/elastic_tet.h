/* Elastic tetrahedra: the machinery of row tet_elastic, and of hex_elastic while it untangles on its five-tet split.
 *
 * corotational: one rotation per element (polar part of F at its centre, warm started and iterated until it stands),
 * f = -R K_e (R'x - X), tangent R K_e R' (the rotation's derivative is dropped). For tet10, whose Gauss points turn
 * apart from the centre, that is not the gradient of the energy and has a net torque of second order; what the
 * rotation's own change adds is added, but where the rotation is hardly known (crushed to next to nothing). linear: f =
 * -K u. neo_hookean: stable form (elastic_law.h) at each Gauss point, tangent projected to positive semi-definite.
 *
 * Untangling rule (numerics.md part 3; corotational): an element with det F <= 0 at its centre or a Gauss point takes
 * the polar part of the sum, over its corners, of the rotations averaged over the not inverted elements around each;
 * its own where there are none. It costs nothing while no element is inverted; while one is, the net torque of the
 * borrowed rotations is taken back by small forces on all nodes, so that a free body does not turn itself.
 *
 * Straightening (corotational, elastic_tet_single_rotation.c): one rotation an element has rests that are none of the
 * body, in which a folded one would stay for good, or which it leaves by rounding alone. A body that `look` finds at
 * such a rest takes one rotation for all of its elements, that of what is held (of all its nodes where nothing is): the
 * energy is then quadratic with no other minimum than the shape at rest. Moduli are lowered so that energy does not
 * jump.
 *
 * An element with less than 1e-6 h^3 of volume at rest is left out. Memory: the world's arena. Thread: [load] to make,
 * then [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_TET_H
#define PAL_SIM_ELEMENTS_ELASTIC_TET_H
#include "server/sim/elements/elastic_law.h"

typedef struct pal_elastic_tets_options {
    pal_elastic_law law;
    bool recover;
    int n_corner; /* 4, or 10 with the middle nodes of num/shape_functions.h halfway */
    int n_tet;
    const int32_t *tet; /* borrowed [n_tet][n_corner]              */
    const float *fill;  /* share of material, borrowed; NULL: 1 [n_tet] */
    double max_poisson; /* larger ratios are taken as this one; 0: none is */
} pal_elastic_tets_options;

/* PAL_TET_MODES: numbers of a Gauss point's neo-Hookean tangent: u 9, D v 9, stretch 6, same 3, cross 3 (pal_neo_modes)
 */
enum { PAL_TET_CENTRE = 4, PAL_TET_MODES = 30 };

typedef struct pal_elastic_tets {
    pal_elastic_tets_options wish;
    int n_point; /* Gauss points: 1 or 4 */
    /* gradients of the shape functions in local coordinates at the Gauss points and at the centre */
    double shape[5][10][3];
    int n_node;
    int n_block; /* 8 elements side by side; strips first, then loose ones */
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
    double *turn;         /* rotations as quaternions, warm start     [n_block][4][8]  */
    double *tangent;      /* what linearise keeps, by law             [n_block][..][8] */
    double *bound;        /* Gershgorin row sums at rest, N/m; they do not depend on rotation [n_node] */
    double *around;       /* sums of rotations around nodes while untangling [n_node][9] */
    int32_t *inverted;    /* elements with det F <= 0 somewhere at the last force or linearise [n_inverted] */
    int32_t *entry;       /* blocks of the pattern last assembled into, corner pairs a >= b [n_tet][10 or 55] */
    const int32_t *entry_row;
    const pal_block_matrix *entry_of;
    uint8_t *flag; /* zero between calls [n_tet] */
    bool straight; /* all elements turn as one ...                                 */
    double soft;   /* ... and their moduli are this share of what they are          */
    double *seen;  /* where the nodes were `n_look` looks ago; untangle     [n_node][3] */
    int n_look;
    int n_single_rotation, n_whole; /* times straightened since it was whole for long; looks since it is */
    int n_inverted;
    int n_slow; /* rotations that vectors could not settle at the last force or linearise */
} pal_elastic_tets;

/* at rest; body->slots is used when n_corner is 4 (made here when NULL); regions and material from build->def */
pal_err pal_elastic_tets_make(const pal_elastic_tets_options *wish, pal_build *build, pal_elastic_tets *out);
void pal_elastic_tets_material(pal_elastic_tets *t, const pal_material *material);
/* turns to identity */
void pal_elastic_tets_reset(pal_elastic_tets *t);
/* a body under an implicit solver is about to linearise, tangled on t or not: straightens it when it is tangled, has
 * not moved for long and nothing presses it; true: from now on. What is tangled again soon after two times rests so
 * under its loads and is left alone */
bool pal_elastic_tets_check_rest(pal_elastic_tets *t, const pal_body *body, bool has_inversion);
/* f += force at positions d, both [n_node][3]; takes the rotations */
void pal_elastic_tets_force(pal_elastic_tets *t, const double *d, double *f);
/* J; takes the rotations. f: forces are added as by ..force; NULL: none */
double pal_elastic_tets_energy(pal_elastic_tets *t, const double *d, double *f);
/* += Gershgorin row sums of the stiffness at d */
void pal_elastic_tets_bound(pal_elastic_tets *t, const double *d, double *bound_N_m);
/* takes the tangent (and the rotations) at d */
void pal_elastic_tets_linearise(pal_elastic_tets *t, const double *d);
/* at the last linearise: out += k K p; to += k K; turn [n_node][9] += mu times volume times rotation at each
 * corner */
void pal_elastic_tets_multiply(const pal_elastic_tets *t, double k, const double *p, double *out);
void pal_elastic_tets_assemble(pal_elastic_tets *t, double k, pal_block_matrix *to);
void pal_elastic_tets_rotate(const pal_elastic_tets *t, double *turn);
/* one element: the rotation it holds; F at d, at Gauss point `point` or PAL_TET_CENTRE */
void pal_elastic_tets_rotation(const pal_elastic_tets *t, int e, double r[9]);
void pal_elastic_tets_gradient(const pal_elastic_tets *t, int e, int point, const double *d, double f[9]);
/* effect.h measure: von Mises of the Cauchy stress (corotational, linear: of the rotated small-strain one), energy */
void pal_elastic_tets_measure(pal_elastic_tets *t, const double *d, pal_field field, double *sum, double *volume_m3);
/* effect.h stress */
void pal_elastic_tets_stress(pal_elastic_tets *t, const double *d, pal_stress_take *take, void *user);
#endif
