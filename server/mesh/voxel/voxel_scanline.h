/* Private to voxels.c and its helpers: rows of voxels as bits, and exact crossings of a surface with the rows of one
 * axis. Thread: [load]. */
#ifndef PAL_MESH_VOXEL_VOXEL_SCANLINE_H
#define PAL_MESH_VOXEL_VOXEL_SCANLINE_H
#include "server/mesh/geometry/surface.h"
#include "server/mesh/voxel/voxels.h"

/* voxels as bits, x fastest; a row begins at a word and unused bits are 0 */
typedef struct pal_bits {
    int n[3];
    int n_word;     /* words per row                                  */
    uint64_t *word; /* row (y, z) begins at n_word (z n[1] + y)       */
} pal_bits;

pal_err pal_bits_create(const int n[3], pal_bits *out); /* zeroed; MEMORY */
void pal_bits_free(pal_bits *bits);
static inline uint64_t *pal_bits_row(const pal_bits *bits, int y, int z)
{
    return bits->word + (size_t)bits->n_word * ((size_t)z * (size_t)bits->n[1] + (size_t)y);
}
void pal_bits_set_run(uint64_t *row, int from, int to); /* bits from..to-1 */
static inline bool pal_bits_get(const pal_bits *bits, int x, int y, int z)
{
    return pal_bits_row(bits, y, z)[x >> 6] >> (x & 63) & 1;
}
int64_t pal_bits_count(const pal_bits *bits);
/* face-connected components; with largest_only the smaller ones are cleared; MEMORY */
pal_err pal_bits_components(pal_bits *bits, bool largest_only, int *n_component);

/* corners of the five tetrahedra of a voxel, by the parity of its place; corner bits x = 1, y = 2, z = 4 */
extern const uint8_t pal_voxel_tets[2][5][4];

/* heap, in large pages where the kernel gives them: first touch is most of the cost of writing large arrays */
void *pal_voxels_array(size_t n_byte);

/* a voxel is PAL_SCAN_ONE units wide, so that grid positions are integers and every test below is exact */
enum { PAL_SCAN_ONE = 65536, PAL_SCAN_HALF = PAL_SCAN_ONE / 2 };

/* a surface in grid units; triangles with a non-finite corner are left out */
typedef struct pal_scan_surface {
    int n_tri;
    int32_t *point; /* [n_vertex][3]                                         */
    int32_t *tri;   /* [n_tri][3]                                            */
    int32_t *part;  /* part of each triangle [n_tri], or NULL: all part 0    */
    bool closed;    /* as a chain: every edge runs equally often both ways   */
    bool even;      /* every edge has an even number of triangles            */
} pal_scan_surface;

pal_err pal_scan_snap(const pal_surface *surface, const double low[3], double h, pal_scan_surface *out); /* MEMORY */
void pal_scan_surface_free(pal_scan_surface *scan);
/* keeps one of each set of triangles with the same three places, whichever way they face, unless the surface is even
 * with them and not without (two copies that close a fin); sets closed and even anew; MEMORY */
pal_err pal_scan_drop_copies(pal_scan_surface *scan, int n_vertex);

/* hash of the edge between two points; *sign is +1 or -1 by its direction; collapsed edges give 0 */
uint64_t pal_scan_edge(const int32_t a[3], const int32_t b[3], int *sign);

typedef struct pal_crossing {
    int32_t
        place; /* first voxel of the row whose centre lies behind the crossing, 0 .. n: a surface may reach beyond */
    int32_t depth; /* of the crossing, grid units                                  */
    int32_t part;
    int32_t sign; /* +1: the row goes in, -1: it comes out                        */
} pal_crossing;

/* crossings of every row along axis, sorted by place, depth: rows are numbered q n[p] + p, p < q the other axes */
typedef struct pal_crossings {
    int n_row;
    int64_t *start; /* [n_row+1] */
    pal_crossing *item;
} pal_crossings;

/* Which triangles a row of voxel centres crosses, as if the centre (x, y, z) were (x + e, y + e^2, z + e^3): a row that
 * meets an edge or a vertex crosses exactly one of the triangles there, and the three axes agree about every voxel of
 * a closed surface. BUDGET when there are more than 64 crossings a row and 16 a triangle, MEMORY */
pal_err pal_scan_axis(const pal_scan_surface *scan, const int n[3], int axis, pal_crossings *out);
void pal_crossings_free(pal_crossings *crossings);

/* inside by rows along x when every row goes in and out in turn (or, inside-out, out and in): true and inside set;
 * false and inside unusable otherwise */
bool pal_scan_plain(const pal_crossings *crossings, pal_bits *inside);

/* sets the inside bits of a grid (n, edge_m, low_m of grid) by the method asked for or chosen, and the report's method,
 * n_disagree, surface_volume_m3 and tree_s; REFUSED when nothing is inside, MEMORY */
pal_err pal_voxels_classify(const pal_surface *surface, const pal_voxel_options *options, const pal_voxels *grid,
                            pal_bits *inside, pal_voxel_report *report, pal_diagnostic *diag);
#endif
