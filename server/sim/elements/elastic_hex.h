/* Elastic voxel hexahedra: the elements of hex_elastic. All are cubes of one edge h with their own E, nu and share of
 * material; 8 of them go through a kernel side by side, in strips of the lattice's slots where they can.
 *
 * corotational: one rotation per cube, the polar factor of F at its centre, f = -R K (R'x - X), tangent R K R' (the
 * derivative of R is dropped). linear: R = I. neo_hookean: elastic_hex_neo.c. K is integrated in full or with the mean
 * dilatation (B-bar, Hughes 1980).
 *
 * twist: factor on the stiffness of the two kinds of modes that neither a constant strain nor bending needs, 1 unless
 * it is given. Voxels are too stiff; what they gain by softer twists does not depend on how many lie across a part, as
 * it does where bending is softened (Belytschko, Ong, Liu, Kennedy 1984, on stiffness against hourglass modes).
 *
 * Cut voxels with `moment_fitting`: the Gauss points have weights v_q that integrate over the inside (pal_hexes), as in
 * the finite cell method (Parvizian, Duester, Rank 2007), (1 - a) v_q + a / 8 so that what is outside has a share a of
 * the stiffness (PAL_VOID_STIFFNESS). hex8_bbar: the mean strain and the fluctuations about it have these weights
 * (elastic_hex_modes.h), so that the dilatation is that of the inside. Blocks of whole voxels have a kernel of their
 * own. Without it they are whole ones with their fill as a factor.
 *
 * Recovery from inversion (corotational and neo_hookean): recovery/recovery.h, by the determinants of the edges at all
 * corners.
 *
 * Memory: the component's arena. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_HEX_H
#define PAL_SIM_ELEMENTS_ELASTIC_HEX_H
#include "server/sim/core/force_cache.h"
#include "server/sim/elements/elastic_law.h"
#include "server/sim/recovery/recovery.h"

typedef enum pal_hex_element { PAL_HEX_BBAR, PAL_HEX_FULL } pal_hex_element;

typedef struct pal_elastic_hexes {
    pal_elastic_law law;
    pal_hex_element element;
    bool fill, moment_fitting, recover;
    double twist;
    bool implicit; /* the solver linearises */
    const pal_hexes *hexes;
    int n_hex, n_block;
    double edge_m;
    double beta[2]; /* beta = beta[0] mu + beta[1] lambda (elastic_hex_simd.h) */
    pal_simd_blocks simd_blocks;
    pal_block_rounds rounds;
    double *part_energy_J; /* of a pass over the blocks [number of parts] */
    pal_elastic_regions parts;
    double (*reference)[2][9]; /* 3x3 blocks of K for mu = 1 and for lambda = 1, corner pairs c <= d, h / 16 [36] */

    int32_t *hex;        /* element of each lane, -1: none                   [n_block][8]    */
    double *share;       /* sum of the points' weights over that of a whole voxel, 0: a lane without element
                          * [n_block][8] */
    int32_t *cut;        /* index in `weight` of blocks with a cut element, else -1; NULL: there are none [n_block] */
    double *weight;      /* of the Gauss points over their sum               [blocks that are cut][8][8] */
    double (*row)[8][2]; /* of cut elements: sums over the rows of the corners of |K| for mu = 1 and lambda = 1, times
                          * 16 / h [blocks that are cut * 8] */
    double *mu, *lambda; /* times share and h / 16, N/m                      [n_block][8]    */
    uint32_t n_edit;     /* changes of the material since load, the first material among them */
    uint32_t *edited;    /* the last of them that changed mu or lambda       [n_hex] */
    double *bound;       /* largest eigenvalue of a whole voxel's K times share, N/m [n_block][8] */
    double *q;           /* rotations as quaternions, warm start             [n_block][4][8] */
    double *rotation;    /* rotations at the last linearise                  [n_block][9][8] */
    double *tangent;     /* neo_hookean: K in modes at the last linearise    [n_block][231][8]; NULL: not kept */

    pal_force_cache force_cache; /* implicit: of the cubes, not of regions */
    bool turned;                 /* q is that of the positions of force_cache; corotational */

    const pal_ground *ground; /* that the elements stick to, borrowed; NULL: none */

    pal_recovery *recovery; /* NULL: recover is false or the law is linear                      */
    double *whole[2];       /* with recovery: mu and lambda of all; mu, lambda are 0 in regions */
} pal_elastic_hexes;

typedef struct pal_hex_options {
    pal_elastic_law law;
    pal_hex_element element;
    bool fill;           /* cut voxels have their inside alone ...                  */
    bool moment_fitting; /* ... by weights of their own; false: spread evenly over the voxel */
    bool recover;
    double twist; /* above 0, at most 1; below 1: hex8_bbar, linear or corotational */
} pal_hex_options;

/* REFUSED: the body has no cubes, or its tetrahedra are not their split. Makes body->node_order when there is none */
pal_err pal_hex_make(const pal_hex_options *options, pal_build *build, const char *path, pal_elastic_hexes *out);
void pal_hex_material(pal_elastic_hexes *cubes, const pal_material *material);
void pal_hex_reset(pal_elastic_hexes *cubes);
pal_err pal_hex_recovery_make(pal_elastic_hexes *cubes, pal_build *build);       /* MEMORY */
double pal_hex_min_corner(const pal_elastic_hexes *cubes, const pal_body *body); /* smallest corner determinant, h^3 */
static inline bool pal_hex_is_cut(const pal_elastic_hexes *cubes, int block)
{
    return cubes->cut && cubes->cut[block] >= 0;
}
/* block pairs of corners: index of c <= d in `reference` */
static inline int pal_hex_pair(int c, int d)
{
    return c * (17 - c) / 2 + d - c;
}

/* effect.h assemble, rotate, measure, stress; team: NULL, or threads that share the work */
void pal_hex_assemble(pal_elastic_hexes *cubes, double k, pal_block_matrix *to);
/* the block of nodes i and j in a pattern that couples them; *transposed: it is that of j and i */
double *pal_hex_block(const pal_block_matrix *to, int i, int j, bool *transposed);
void pal_hex_rotate(const pal_elastic_hexes *cubes, pal_team *team, double *rotation);
void pal_hex_measure(pal_elastic_hexes *cubes, const pal_body *body, pal_field field, double *sum, double *volume_m3);
void pal_hex_stress(pal_elastic_hexes *cubes, const pal_body *body, pal_stress_take *take, void *user);

/* elastic_hex_ground.c: what the ground adds. u [n_node][3] displacements, or positions less those at rest in `rest`;
 * moved: the ground has moved by ground->move_m. pal_hex_ground_block adds to one element's K in corners and axes */
void pal_hex_ground_add(const pal_elastic_hexes *cubes, double k, bool moved, const double *u, const double *rest,
                        double *out);
double pal_hex_ground_energy(const pal_elastic_hexes *cubes, const pal_body *body);
void pal_hex_ground_bound(const pal_elastic_hexes *cubes, double *bound_N_m);
void pal_hex_ground_assemble(const pal_elastic_hexes *cubes, double k, pal_block_matrix *to);
void pal_hex_ground_block(const pal_elastic_hexes *cubes, int e, double k, double to[24][24]);

/* the laws: node_order->x holds positions (or p), forces (or products) are added to node_order->f */
double pal_hex_corot_run(pal_elastic_hexes *cubes, pal_node_order *node_order, pal_element_run what);
/* cubes->reference: K for mu = 1 and for lambda = 1 */
void pal_hex_fill_reference(pal_elastic_hexes *cubes);
/* K of the element of a lane for its mu and lambda times h / 16, in pairs of corners [36] */
void pal_hex_matrix(const pal_elastic_hexes *cubes, int lane, double mu, double lambda, double to[36][9]);
/* weights of the Gauss points of a lane, sum 1 */
void pal_hex_weights(const pal_elastic_hexes *cubes, int lane, double weight[8]);
/* adds to each node bounds of its row of K, N/m */
void pal_hex_corot_bound(const pal_elastic_hexes *cubes, double *bound_N_m);
/* cubes->row: what the explicit bound of a cut element's corners needs, which its rotation leaves */
void pal_hex_corot_find_rows(pal_elastic_hexes *cubes);
/* order NULL: the positions are those of q */
void pal_hex_corot_linearise(pal_elastic_hexes *cubes, pal_node_order *order, pal_team *team);
void pal_hex_corot_multiply(pal_elastic_hexes *cubes, pal_node_order *node_order, double k);
/* the tangent's blocks of 8 elements, k K: to [36][9][8] */
void pal_hex_corot_blocks(const pal_elastic_hexes *cubes, int block, double k, double *to);

double pal_hex_neo_run(pal_elastic_hexes *cubes, pal_node_order *node_order, pal_element_run what);
void pal_hex_neo_linearise(pal_elastic_hexes *cubes, pal_node_order *node_order);
void pal_hex_neo_multiply(const pal_elastic_hexes *cubes, pal_node_order *node_order, double k);
void pal_hex_neo_blocks(const pal_elastic_hexes *cubes, int block, double k, double *to);
void pal_hex_neo_bound(pal_elastic_hexes *cubes, const pal_body *body, double *bound_N_m);
#endif
