/* Policy constants of the mesh room: unit, reason, and the test of tests/mesh that bounds each. Tolerances of rounding
 * stand beside the code that needs them. */
#ifndef PAL_MESH_GEOMETRY_TUNING_H
#define PAL_MESH_GEOMETRY_TUNING_H

/* ---- sizes ---- */

/* m. Positions of surfaces with levels and of control cells; a body of this size in mm as a file's unit is still one
 * (geometry/test_levels, cells/test_cells) */
#define MAX_COORDINATE_M 1e9
/* file units. A larger coordinate cannot be cubed and summed, and counts as infinite (geometry/test_surface) */
#define COORDINATE_LIMIT 1e30
/* voxels on the longest axis; grid positions at 1/65536 of a voxel stay below 2^27 (voxel/test_voxels) */
#define MAX_RESOLUTION 1024
/* voxels kept when the caller sets no limit: 250 million tetrahedra, some 6 GB (voxel/test_voxels) */
#define MAX_VOXEL 50000000
/* bytes. Default budget of surface levels and of subdivided cells (geometry/test_levels, cells/test_maccracken_joy) */
#define HIERARCHY_BUDGET_BYTE ((size_t)512 << 20)
/* lattice points of an iso-surface (geometry/test_contour) */
#define CONTOUR_MAX_POINT 2e8

/* ---- surfaces ---- */

/* of the square or cube of its size: a triangle or face has no area, a cell no volume or folds below it; what rounding
 * leaves of flat ones is 1e-15 (geometry/test_surface, cells/test_cells, cells/test_cell_edits) */
#define MIN_SHAPE 1e-12
/* triangles at a vertex; flat ones at a vertex of more are dropped, not repaired, so that the time stays linear
 * (geometry/test_surface, flat_triangles_at_a_crowded_vertex_are_dropped) */
#define MAX_FAN 64
/* radii beyond which a box of the tree counts as a dipole; the winding number then errs by at most 0.03
 * (geometry/test_box_tree) */
#define FAR_RADII 2.3
/* minimum height of a face, of its longest edge, and minimum edge, of the diagonal of the surface (test_levels) */
#define LEVEL_FLAT 1e-9
/* cos 75 degrees: a boundary that turns by more has a corner there (geometry/test_butterfly) */
#define CORNER_COS 0.25881904510252074
/* shape of triangles is 4 area / (sum of squared sides): 0 flat, 0.577 equilateral. Below the first a triangle is thin,
 * below the second a candidate for a flip; a collapse may lower the sum of thin shapes by the third, since flips repair
 * one thin triangle but not a cluster of them (geometry/test_contour) */
#define THIN_SHAPE    0.12
#define FLIP_SHAPE    0.3
#define THIN_INCREASE 0.1
/* fractions of the way to the neighbours' mean in a step there and back (Taubin 1995): the pass band ends at 1/0.5 -
 * 1/0.53 = 0.11, so that shapes longer than about ten edges keep their size (geometry/test_contour) */
#define SMOOTH_STEP 0.5
#define SMOOTH_BACK (-0.53)
/* weight of the edge's midpoint, of the quadric's area: spreads vertices evenly where the surface is flat
 * (geometry/test_contour, decimation_spreads_the_vertices_of_a_flat_sheet) */
#define MIDPOINT_WEIGHT 1e-3

/* ---- voxels (voxel/test_voxels) ---- */

/* crossings per row and per triangle: a body crosses a row a few times, noise whose triangles span the box would do so
 * without bound */
#define CROSSINGS_PER_ROW 64
#define CROSSINGS_PER_TRI 16
/* of the decided voxels: up to this many disputed ones are decided by the majority of the axes */
#define FEW_DISPUTED 0.05
/* of its inside voxels, and of those that two axes claim, an open surface encloses at least this fraction beyond doubt:
 * by two axes or by this winding number */
#define SURE_FRACTION 0.5
#define SURE_WINDING  0.75
/* |sum of area normals| over the area, 0 closed and 1 flat: a more one-sided open surface is a sheet */
#define MAX_ONE_SIDED 0.8

/* ---- volume ---- */

/* of the largest component: smaller ones without support are dropped. A voxel at the default resolutions is 0.04 % of
 * the body or less, a visible lobe is more than a hundredth (volume/test_loose_components) */
#define LOOSE_FRACTION 0.01
/* of the volume: coarser voxels are dropped only while less than this is lost (volume/test_voxel_coarsening) */
#define COARSE_MAX_LOSS 0.025
/* |sum of normals| over the root of the sum of squares below which a node has no normal and carries no frame of the
 * skin, and fraction of its rest length below which an axis of a frame shrinks (volume/test_skin) */
#define SKIN_MIN_NORMAL 0.5
#define SKIN_COLLAPSED  0.5

/* ---- cells ---- */

/* vertices, cells, loops or corners: sums of a few counts stay within an int32 (cells/test_cells) */
#define CELL_MAX_ITEM (INT32_MAX / 4)
/* bytes of a file of cells (cells/test_cell_file) */
#define CELL_MAX_BYTE ((size_t)256 << 20)
/* of the distance to the corners: a vertex this near to the middle was put there by a division
 * (cells/test_cell_edit_runs) */
#define CELL_NEAR_MIDDLE 1e-9

/* ---- scans (scan/test_label_volume) ---- */

/* triangles of the lattice for each squared spacing, and of the contour for each that is asked for
 * (also geometry/test_contour) */
#define CONTOUR_TRI_PER_SPACING2 9.0
#define CONTOUR_SURPLUS          3.0
/* rounds of smoothing within the reach, and without one after it */
#define SMOOTH_ROUNDS      60
#define SMOOTH_LAST_ROUNDS 5
/* the margin of the blur may not cost more than 16 times the label's box and this many voxels */
#define BLUR_SPARE_VOXEL ((size_t)1 << 24)

/* of a voxel: displacement of a vertex along its normal by smoothing. Half a voxel is the uncertainty of the scan, the
 * rest the displacement by the blur */
#define SMOOTH_MAX_VOXEL 0.75
#endif
