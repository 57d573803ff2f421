/* Voxel hexahedra on the nodes of a tetrahedral mesh: the same body with one cube per voxel instead of five tetrahedra.
 * Hexahedron e is the voxel of tetrahedra 5 e .. 5 e + 4. A pal_hexes owns its arrays (heap). Thread: [load]. */
#ifndef PAL_MESH_VOLUME_HEXES_H
#define PAL_MESH_VOLUME_HEXES_H
#include "server/mesh/voxel/voxels.h"

typedef struct pal_hexes {
    int n_hex;
    bool measured; /* fill was measured; false: it is 1 everywhere            */
    int32_t *node; /* corners x = 1, y = 2, z = 4, nodes of the tets [n_hex][8] */
    float *fill;   /* fraction of the voxel inside the surface, 0..1    [n_hex] */
    /* Weights of the 2 x 2 x 2 Gauss points, numbered like corners, that integrate trilinear functions over the inside
     * (moment fitting), the nearest to these within 0..1/8; they sum to fill (pal_weight_sum). NULL: the inside of
     * every voxel is spread evenly over it [n_hex][8] */
    float *weight;
} pal_hexes;

/* the fill that weights sum to, in this order */
static inline float pal_weight_sum(const float w[8])
{
    return ((w[0] + w[1]) + (w[2] + w[3])) + ((w[4] + w[5]) + (w[6] + w[7]));
}

void pal_hexes_free(pal_hexes *hexes);
/* Weights of voxel e, raised by the same in each so that they sum to at least min_fill. Returns their sum. [any] */
double pal_hexes_weights(const pal_hexes *hexes, int e, double min_fill, double weight[8]);
/* the nearest weights within 0..1/8 of the same sum, and fill [load] */
void pal_hexes_set_weights(pal_hexes *hexes, int e, const double weight[8]);
/* Finds the cubes of edge tets->edge_m that the tetrahedra of a voxel split fill (five each, consecutive, in any order
 * within the five); fill 1, no weights; REFUSED when the mesh is no such split; MEMORY */
pal_err pal_hexes_find(const pal_tets *tets, pal_hexes *out, pal_diagnostic *diag);
/* Weights and fill of every voxel, as pal_voxels_fraction measures them. REFUSED: nothing is inside, or not the surface
 * of this mesh; BUDGET, MEMORY */
pal_err pal_hexes_fill(pal_hexes *hexes, const pal_tets *tets, const pal_surface *surface, pal_diagnostic *diag);
#endif
