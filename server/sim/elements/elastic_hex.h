/* Elastic voxel hexahedra: the machinery of row hex_elastic. All elements are cubes of one edge with their own E, nu
 * and share of material; 8 of them side by side go through each kernel, in strips of a lattice's slots where they can.
 *
 * corotational: one rotation per cube, the polar part of F at its centre, f = -R K (R'x - X), tangent R K R' (the
 * rotation's derivative is dropped). linear: the same with R = I. neo_hookean: elastic_hex_neo.c.
 * K is integrated in full or with the mean dilatation (B-bar, Hughes 1980).
 *
 * Untangling (numerics.md part 3; corotational and neo_hookean): one rotation per cube has rest states that are no rest
 * states of the body (mirrored, shuffled corners), and so has the neo-Hookean energy. While any corner's determinant is
 * below 0.05 h^3 or above 30 h^3 (blown up: the neo-Hookean energy grows with the square of it)
 * the whole body takes its forces from the five-tetrahedra split of the same nodes, corotational with the rule of
 * elastic_tet.h. Poisson ratios above 0.3 are taken as 0.3 there: what is turned over has no volume to keep, and with
 * 0.45 one shuffled body in a hundred stayed tangled, with 0.3 none of 720. It goes back when all corners are between
 * 0.3 and 20 h^3. Cubes that a lasting load turns over where the split is whole would take turns with it for ever, each
 * some millimetres from the other: where they were tried in vain they are tried again only when they are less crushed.
 *
 * Memory: the world's arena. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_HEX_H
#define PAL_SIM_ELEMENTS_ELASTIC_HEX_H
#include "server/sim/core/force_cache.h"
#include "server/sim/elements/elastic_tet.h"

typedef enum pal_hex_element { PAL_HEX_BBAR, PAL_HEX_FULL } pal_hex_element;

typedef struct pal_elastic_hexes {
    pal_elastic_law law;
    pal_hex_element element;
    bool fill, recover;
    bool implicit; /* the solver linearises: tangles are looked for there, else whenever forces are taken */
    const pal_hexes *hexes;
    int n_hex, n_block;
    double edge_m;
    double beta[2]; /* beta = beta[0] mu + beta[1] lambda (elastic_hex_simd.h) */
    pal_simd_blocks simd_blocks;
    pal_elastic_regions parts;
    double (*reference)[2][9]; /* 3x3 blocks of K for mu = 1 and for lambda = 1, corner pairs c <= d, h / 16 [36] */

    int32_t *hex;        /* element of each lane, -1: none                   [n_block][8]    */
    double *share;       /* of material, 0: a lane without element           [n_block][8]    */
    double *mu, *lambda; /* times share and h / 16, N/m                      [n_block][8]    */
    double *bound;       /* largest eigenvalue of the cube's K, N/m          [n_block][8]    */
    double *q;           /* rotations as quaternions, warm start             [n_block][4][8] */
    double *turn;        /* rotations at the last linearise                  [n_block][9][8] */
    double *tangent;     /* neo_hookean: K in modes at the last linearise    [n_block][231][8]; NULL: not kept */
    int n_slow;          /* rotations that vectors could not settle, last force or linearise */
    int32_t *entry;      /* implicit: blocks of the pattern last assembled into [n_hex][36], ~ where transposed */
    const int32_t *entry_row;
    const pal_block_matrix *entry_of;

    pal_force_cache kept; /* implicit: of the cubes, not of the split */

    bool has_inversion;
    int n_whole;          /* looks since it went back to cubes, up to SOON                                */
    double tried, needed; /* least corner when it did; that it takes to go back                           */
    uint64_t n_inversion,
        n_switch;            /* looks that found the body tangled; changes of cubes, split, straight; since run */
    pal_elastic_tets *split; /* NULL: untangle is false or the law is linear */
    float *split_fill;       /* [n_tet]                                       */
} pal_elastic_hexes;

/* what pal_elastic_hex_make shall make */
typedef struct pal_hex_options {
    pal_elastic_law law;
    pal_hex_element element;
    bool fill, recover;
} pal_hex_options;

/* REFUSED: the body has no cubes, or its tetrahedra are not their split; makes body->slots when there are none */
pal_err pal_hex_make(const pal_hex_options *wish, pal_build *build, const char *path, pal_elastic_hexes *out);
void pal_hex_material(pal_elastic_hexes *row, const pal_material *material);
void pal_hex_reset(pal_elastic_hexes *row);
/* no inversion, nothing tried yet */
void pal_hex_recovery_reset(pal_elastic_hexes *row);
/* looks at all corners and chooses between cubes and split; true: it changed */
bool pal_hex_recover(pal_elastic_hexes *row, const pal_body *body);
double pal_hex_min_corner(const pal_elastic_hexes *row, const pal_body *body); /* least corner determinant, h^3 */
/* block pairs of corners: index of c <= d in `reference` and `entry` */
static inline int pal_hex_pair(int c, int d)
{
    return c * (17 - c) / 2 + d - c;
}

/* effect.h assemble, rotate, measure, stress */
void pal_hex_assemble(pal_elastic_hexes *row, double k, pal_block_matrix *to);
void pal_hex_rotate(const pal_elastic_hexes *row, double *turn);
void pal_hex_measure(pal_elastic_hexes *row, const pal_body *body, pal_field field, double *sum, double *volume_m3);
void pal_hex_stress(pal_elastic_hexes *row, const pal_body *body, pal_stress_take *take, void *user);

/* the laws: body->slots->x holds positions (or p), forces (or products) are added to body->slots->f */
void pal_hex_corot_force(pal_elastic_hexes *row, pal_node_order *node_order);
/* row->reference: K for mu = 1 and for lambda = 1 */
void pal_hex_fill_reference(pal_elastic_hexes *row);
/* with forces: added as by ..force too */
double pal_hex_corot_energy(pal_elastic_hexes *row, pal_node_order *node_order, bool forces);
void pal_hex_corot_linearise(pal_elastic_hexes *row, pal_node_order *node_order);
void pal_hex_corot_multiply(const pal_elastic_hexes *row, pal_node_order *node_order, double k);
/* the tangent's blocks of 8 elements, k K: to [36][9][8] */
void pal_hex_corot_blocks(const pal_elastic_hexes *row, int block, double k, double *to);

void pal_hex_neo_force(pal_elastic_hexes *row, pal_node_order *node_order);
double pal_hex_neo_energy(pal_elastic_hexes *row, pal_node_order *node_order, bool forces);
void pal_hex_neo_linearise(pal_elastic_hexes *row, pal_node_order *node_order);
void pal_hex_neo_multiply(const pal_elastic_hexes *row, pal_node_order *node_order, double k);
void pal_hex_neo_blocks(const pal_elastic_hexes *row, int block, double k, double *to);
void pal_hex_neo_bound(pal_elastic_hexes *row, const pal_body *body, double *bound_N_m);
#endif
