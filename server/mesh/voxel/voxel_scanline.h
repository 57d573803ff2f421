/* Private to the voxel files: exact crossings of a surface with the rows of one axis. Thread: [load]. */
#ifndef PAL_MESH_VOXEL_VOXEL_SCANLINE_H
#define PAL_MESH_VOXEL_VOXEL_SCANLINE_H
#include "server/mesh/geometry/surface.h"
#include "server/mesh/voxel/voxel_bits.h"

/* a voxel is PAL_SCAN_ONE units wide, so that grid positions are integers and every test below is exact */
enum { PAL_SCAN_ONE = 65536, PAL_SCAN_HALF = PAL_SCAN_ONE / 2 };

/* a surface in grid units; triangles with a non-finite corner are left out */
typedef struct pal_scan_surface {
    int n_vertex, n_tri;
    int32_t *point; /* [n_vertex][3]                                         */
    int32_t *tri;   /* [n_tri][3]                                            */
    int32_t *part;  /* part of each triangle [n_tri], or NULL: all part 0    */
    uint64_t *hash; /* of each vertex by its position [n_vertex]             */
    int32_t *near;  /* the triangles that rows may cross [n_near], or NULL: all (pal_scan_find_near) */
    int n_near;
    bool closed; /* as a chain: every edge runs equally often both ways   */
    bool even;   /* every edge has an even number of triangles            */
} pal_scan_surface;

pal_err pal_scan_snap(const pal_surface *surface, const double low[3], double h, pal_scan_surface *out); /* MEMORY */
void pal_scan_surface_free(pal_scan_surface *scan);
/* Keeps one of each set of triangles with the same three corner positions, in either orientation, unless the surface is
 * even with them and not without (two copies that close a fin); updates closed and even; MEMORY */
pal_err pal_scan_drop_copies(pal_scan_surface *scan);

/* lists the triangles whose box holds voxel centres along two axes: the others cross no row, so that where triangles
 * are small beside voxels a scan of each axis looks at few; MEMORY */
pal_err pal_scan_find_near(pal_scan_surface *scan);

/* corner k of a triangle; corner 3 is corner 0 again */
static inline const int32_t *pal_scan_corner(const pal_scan_surface *scan, size_t tri, int k)
{
    return scan->point + 3 * (size_t)scan->tri[3 * tri + (size_t)(k % 3)];
}

typedef struct pal_crossing {
    int32_t place; /* first voxel of the row whose centre lies behind the crossing */
    int32_t depth; /* of the crossing, grid units                                  */
    int32_t part;
    int32_t sign; /* +1: the row enters, -1: it leaves */
} pal_crossing;

/* crossings of every row along axis, sorted by place, depth: rows are numbered q n[p] + p, p < q the other axes */
typedef struct pal_crossings {
    int n_row;
    int64_t *start; /* [n_row+1] */
    pal_crossing *item;
} pal_crossings;

/* Finds the triangles that each row of voxel centres crosses, as if the centre (x, y, z) were (x + e, y + e^2, z +
 * e^3): a row that meets an edge or a vertex crosses exactly one of the triangles there, and the three axes agree about
 * every voxel of a closed surface. BUDGET: more than 64 crossings a row and 16 a triangle; MEMORY */
pal_err pal_scan_axis(const pal_scan_surface *scan, const int n[3], int axis, pal_crossings *out);
void pal_crossings_free(pal_crossings *crossings);
#endif
