/* The corotational tangent R K R' of voxel hexahedra in single precision, for preconditioners: half the memory and
 * twice the numbers in a register. Vectors are by slot (pal_node_order), [3][n_slot]. In products, elements of a region
 * of recovery from inversion have E of theirs times the region's s, and nu 0: the edges that act there, nearly (a
 * pulled body with such regions takes 1.2 iterations for 1.4, let go 2.8 for 5.3). Memory: the caller's arena. Thread:
 * [load] to make, then [sim]. */
#ifndef PAL_SIM_ELEMENTS_ELASTIC_HEX_SINGLE_H
#define PAL_SIM_ELEMENTS_ELASTIC_HEX_SINGLE_H
#include "server/base/team.h"
#include "server/sim/elements/elastic_hex.h"

typedef struct pal_elastic_hexes_single {
    const pal_elastic_hexes *cubes;
    int n_slot;
    double (*whole)[24][24]; /* K of a whole voxel at rest, for mu = 1 and for lambda = 1, h / 16 [2] */
    const int32_t *slot;     /* of the body's nodes [n_node] */
    float *stiff;            /* mu, lambda times h / 16, N/m                   [n_block][2][8] */
    float *acting;           /* the same of products; `stiff` without recovery */
    bool softened;           /* they are not the same */
    float *weight;   /* as in cubes: of blocks with a cut element [blocks that are cut][8][8]; NULL: there are none */
    float *rotation; /* [n_block][9][8]; NULL: the law is linear */
    double *turned;  /* sums of squares of a change of rotations by piece of the blocks */
} pal_elastic_hexes_single;

/* MEMORY. [load] */
pal_err pal_hex_single_make(const pal_elastic_hexes *cubes, const pal_body *body, pal_arena *arena,
                            pal_elastic_hexes_single *out);
/* takes the present material */
void pal_hex_single_stiffen(pal_elastic_hexes_single *single);
/* takes the rotations of the last linearise and the regions of recovery; returns by how many radians elements have
 * turned, as RMS. team: NULL, or threads that share the work */
double pal_hex_single_rotate(pal_elastic_hexes_single *single, pal_team *team);
/* no element has turned: pal_hex_single_element gives the matrices of rest */
bool pal_hex_single_rests(const pal_elastic_hexes_single *single);
/* out += k K p; empty slots of p are 0. team: NULL, or threads that share the work; the same bits with any number */
void pal_hex_single_multiply(const pal_elastic_hexes_single *single, pal_team *team, float k, const float *p,
                             float *out);
/* k K [24][24] of element e in corners and axes, turned by the rotation that `rotation` has for it, laid out as in
 * `single`; NULL: at rest */
void pal_hex_single_element(const pal_elastic_hexes_single *single, const float *rotation, int e, double k,
                            double to[24][24]);
#endif
