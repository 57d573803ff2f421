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
    /* what of it lies in each octant, 0..1/8, octants numbered like corners; they sum to fill (pal_octant_sum). NULL:
     * the inside of every voxel is spread evenly over it [n_hex][8] */
    float *octant;
} pal_hexes;

/* the fill that octants sum to, in this order */
static inline float pal_octant_sum(const float octant[8])
{
    return ((octant[0] + octant[1]) + (octant[2] + octant[3])) + ((octant[4] + octant[5]) + (octant[6] + octant[7]));
}

void pal_hexes_free(pal_hexes *hexes);
/* Octants of voxel e, raised by the same in each so that they sum to at least min_fill. Returns their sum. [any] */
double pal_hexes_octants(const pal_hexes *hexes, int e, double min_fill, double octant[8]);
/* Finds the cubes of edge tets->edge_m that the tetrahedra of a voxel split fill (five each, consecutive, in any order
 * within the five); fill 1, no octants; REFUSED when the mesh is no such split; MEMORY */
pal_err pal_hexes_find(const pal_tets *tets, pal_hexes *out, pal_diagnostic *diag);
/* Octants and fill of every voxel, as pal_voxels_fraction measures them. REFUSED: nothing is inside, or not the surface
 * of this mesh; BUDGET, MEMORY */
pal_err pal_hexes_fill(pal_hexes *hexes, const pal_tets *tets, const pal_surface *surface, pal_diagnostic *diag);
#endif
