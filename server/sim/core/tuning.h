/* Limits and constants of policy of the room core and of scenes. Each has its unit, its reason and the test that bounds
 * it. */
#ifndef PAL_SIM_CORE_TUNING_H
#define PAL_SIM_CORE_TUNING_H

/* ---- material: one range for scene keys, regions, problem files, flags and live edits
 * (tests/scene/test_material_limits.c) ---- */

/* Pa, kg/m^3: what bodies of 1e-6 to 1e6 m need to scale to the same answer
 * (tests/stability/test_subdivision_numbers.c) */
#define PAL_YOUNG_MIN_PA      1e-6
#define PAL_YOUNG_MAX_PA      1e15
#define PAL_DENSITY_MIN_KG_M3 1e-24
#define PAL_DENSITY_MAX_KG_M3 1e24
/* the shear modulus is infinite at -1, the bulk modulus at 0.5 */
#define PAL_POISSON_MIN (-0.9999)
#define PAL_POISSON_MAX 0.499999
/* larger ratios are taken as this one and reported: a bulk modulus of 5,000 times the shear modulus is as far as double
 * precision and conjugate gradients go together (tests/stability/test_fem_numbers.c) */
#define PAL_POISSON_CLAMP 0.4999
/* 1/s, c/m: faster decay than the shortest sub-step resolves */
#define PAL_DAMPING_MAX_1_S 1e9

/* ---- sizes ---- */

/* m: positions, radii; a body of this size in mm as a file's unit is still one (tests/scene/test_scene_file.c) */
#define PAL_LENGTH_MAX_M 1e9
/* factors of a paint stroke (tests/scene/test_subdivision_scene.c) */
#define PAL_STROKE_FACTOR_MIN 1e-6
#define PAL_STROKE_FACTOR_MAX 1e6
/* nodes of a grid of spring constants */
#define PAL_SPRING_GRID_NODES_MAX (1 << 20)
/* largest load on a node is this times E h^2: a strain of the order of 10 in one element, far above any linear answer
 * (tests/sim/world/test_world.c) */
#define PAL_LOAD_CAP_FACTOR 10

/* ---- recovery from inversion: volume ratios at which each mechanism enters (LOW, HIGH) and leaves (LEAVE_*) ---- */

/* voxel cubes, corner determinant over h^3. Above 30 the neo-Hookean energy, which grows with its square, lets nothing
 * else count (tests/sim/elements/test_hex_recovery.c) */
#define PAL_HEX_INVERTED_LOW  0.05
#define PAL_HEX_INVERTED_HIGH 30.0
#define PAL_HEX_LEAVE_LOW     0.3
#define PAL_HEX_LEAVE_HIGH    20.0
/* a return that failed within so many updates (one a Newton iteration) raises the limit for the next by a step, up to
 * the highest */
#define PAL_HEX_RETRY_UPDATES 600
#define PAL_HEX_RETRY_STEP    0.05
#define PAL_HEX_RETRY_MAX     0.9
/* Poisson's ratio of the split at most: inverted voxels have no volume to conserve, and five tetrahedra a voxel lock
 * well below 0.5; of 720 shuffled bodies all recover with it, one in a hundred does not with 0.45 */
#define PAL_HEX_SPLIT_POISSON_MAX 0.3
/* subdivision solids, volume at 8 points of an element (tests/sim/subdivision/test_cell_recovery.c) */
#define PAL_CELL_INVERTED_LOW  0.05
#define PAL_CELL_INVERTED_HIGH 30.0
#define PAL_CELL_LEAVE_LOW     0.3
#define PAL_CELL_LEAVE_HIGH    20.0
/* springs, volume of a tetrahedron. Springs compress further than elements before they fold
 * (tests/sim/springs/test_spring_recovery.c) */
#define PAL_SPRING_INVERTED_LOW  0.01
#define PAL_SPRING_INVERTED_HIGH 30.0
#define PAL_SPRING_LEAVE_LOW     0.2
#define PAL_SPRING_LEAVE_HIGH    20.0
/* smallest factor s of a region: it never becomes too soft to move */
#define PAL_REGION_SCALE_MIN 0.02
/* a body is at rest when its kinetic energy is at most this part of what its regions store */
#define PAL_REGION_REST_SHARE 1e-3
/* least part of material of a border voxel, so that no node is left nearly without stiffness and mass */
#define PAL_HEX_SHARE_MIN 0.02
#endif
