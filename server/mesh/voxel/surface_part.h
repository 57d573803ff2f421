/* Private to the voxel files: the edge-connected parts of a surface in grid units, whether each is closed, its
 * orientation, and which of them bound a cavity. Thread: [load]. */
#ifndef PAL_MESH_VOXEL_SURFACE_PART_H
#define PAL_MESH_VOXEL_SURFACE_PART_H
#include "server/mesh/voxel/voxel_scanline.h"

typedef enum pal_part_kind {
    PAL_PART_CLOSED, /* a closed chain: inside where the winding number is not 0              */
    PAL_PART_EVEN,   /* every edge an even number of triangles, no common orientation: parity */
    PAL_PART_OPEN    /* some edge has an odd number of triangles                              */
} pal_part_kind;

typedef struct pal_part {
    int n_tri;
    pal_part_kind kind;
    bool coherent; /* every edge of two triangles is run through in both directions */
    bool inward;   /* oriented inward in the file; here all parts are oriented outward */
    bool cavity;   /* lies inside another part of opposite orientation in the file */
    double volume; /* enclosed, in cubic grid units, never negative; holes count as closed by fans from their middle */
} pal_part;

typedef struct pal_parts {
    int n;
    pal_part *part;
} pal_parts;

/* Drops copies of triangles (pal_scan_drop_copies), finds the parts by position (unwelded corners join), numbers the
 * parts of the triangles in scan->part, makes the orientation of each part consistent where possible, and outward;
 * cavity stays false; MEMORY */
pal_err pal_parts_find(pal_scan_surface *scan, pal_parts *out);
void pal_parts_free(pal_parts *parts);

/* Sets cavity from the rows along one axis: a part most of whose crossings lie inside another one of opposite
 * orientation in the file. A nearly coincident copy lies inside nothing. MEMORY */
pal_err pal_parts_nest(pal_parts *parts, const pal_crossings *rows);

/* Inside voxels of one row: those whose smallest surrounding part is no cavity. Calls run(from, to) for each run of
 * inside voxels. Returns false when an open part leaves the row undecided outside those runs. work is from
 * pal_parts_work_create. */
typedef struct pal_parts_work pal_parts_work;
pal_parts_work *pal_parts_work_create(const pal_parts *parts); /* NULL: out of memory */
void pal_parts_work_destroy(pal_parts_work *work);
bool pal_parts_row(const pal_parts *parts, pal_parts_work *work, const pal_crossing *item, int64_t n,
                   void (*run)(void *self, int from, int to), void *self);
#endif
