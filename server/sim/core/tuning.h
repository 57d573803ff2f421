/* Limits and constants of policy of the room core and of scenes. Each has its unit, its reason and the test that bounds
 * it. */
#ifndef PAL_SIM_CORE_TUNING_H
#define PAL_SIM_CORE_TUNING_H

#include <math.h>

/* ---- material: one range for scene keys, regions, problem files, flags and live edits
 * (tests/scene/test_material_limits.c) ---- */

/* Pa, kg/m^3: what bodies of 1e-6 to 1e6 m need to scale to the same answer
 * (tests/stability/test_subdivision_numbers.c) */
#define PAL_YOUNG_MIN_PA      1e-6
#define PAL_YOUNG_MAX_PA      1e15
#define PAL_DENSITY_MIN_KG_M3 1e-24
#define PAL_DENSITY_MAX_KG_M3 (1 / PAL_DENSITY_MIN_KG_M3)
/* Poisson's ratio: as near to 0.5, where the bulk modulus is infinite, as a bulk modulus of 5,000 times the shear
 * modulus, which is as far as double precision and conjugate gradients go together; larger ratios up to MAX are taken
 * as CLAMP and reported. MIN is as near to -1, where the shear modulus is infinite (tests/stability/test_fem_numbers.c)
 */
#define PAL_POISSON_CLAMP 0.4999
#define PAL_POISSON_MIN   (-0.5 - PAL_POISSON_CLAMP)
#define PAL_POISSON_MAX   0.499999
/* m, 1/s: positions and radii, of which a body of this size in mm as a file's unit is still one
 * (tests/scene/test_scene_file.c); drag c/m, whose decay no sub-step resolves (tests/scene/test_material_limits.c) */
#define PAL_NUMBER_MAX 1e9
/* 1/s: the largest rate that is derived from the lowest frequency. Soft tissue comes to rest within a second with it;
 * bodies with w1 above 2 1/s have it (tests/sim/plan/test_damping.c) */
#define PAL_DAMPING_1_S 4.0
/* factors of a paint stroke, up or down, and the damping ratio of mode 1, whose rate has its cap long before
 * (tests/scene/test_subdivision_scene.c, test_material_limits.c) */
#define PAL_FACTOR_MAX 1e6
/* nodes of a grid of spring constants */
enum { PAL_SPRING_GRID_NODES_MAX = 1 << 20 };

/* ---- sums and loads ---- */

/* relative: a smaller difference of masses, inertias, lengths or areas is rounding of their sums. Springs that are
 * shorter than so much of their length have no direction, a body smaller than so much of its size is a point
 * (tests/sim/surface/test_edge_spring.c, test_adaptive_geometry.c) */
#define PAL_ROUNDING 1e-9
/* largest factor, up or down, on velocities that restores the energy of a body after a change of its level, and of the
 * mass of old nodes over that of the new ones which take over their force: beyond it nodes would be thrown
 * (tests/sim/surface/test_refine.c, tests/stability/test_switch_pairs.c) */
#define PAL_CHANGE_MAX 2.0
/* cosine of the largest angle, 45 degrees, between two directions or loads that count as the same one
 * (tests/sim/contact/test_contact_implicit.c, tests/sim/solvers/test_fem_static.c) */
#define PAL_SAME_COSINE M_SQRT1_2
/* largest load on a node is this times E h^2: a strain of the order of 10 in one element, far above any linear answer
 * (tests/sim/world/test_world.c) */
#define PAL_LOAD_CAP_FACTOR 10

/* ---- elements ---- */

/* elements of subdivision solids with larger Poisson ratios lock in volume: they share their changes of volume
 * (tests/sim/subdivision/test_cell_volume.c) */
#define PAL_LOCK_FREE_POISSON 0.3
/* least part of the material of a border voxel, and of the moduli of a region of inverted elements, so that no node is
 * left nearly without stiffness and mass (tests/sim/solvers/test_fem_dynamic.c,
 * tests/sim/subdivision/test_cell_recovery.c) */
#define PAL_FILL_MIN 0.02
/* cut voxels with less inside are dropped, unless more than MAX_MISSING of the volume would go; then those below
 * PAL_FILL_MIN (tests/sim/core/test_configuration.c, at 0.02 tests/stability/test_switch_ball.c) */
#define PAL_VOXEL_DROP_FILL   0.25
#define PAL_VOXEL_MAX_MISSING (PAL_VOXEL_DROP_FILL / 10)
/* of a tetrahedron of springs at a voxel's corner: the mass of the node that it has for itself. With 0.4 both kinds of
 * nodes have the same limit of the sub-step where Poisson's ratio is 0.45; 0.25, as elsewhere, takes 1.25 times as many
 * sub-steps (tests/sim/springs/test_springs.c) */
#define PAL_OWN_CORNER_MASS 0.4
/* ---- threads ---- */

/* part of all blocks that the largest part of a divided order may have to evaluate: with more, threads repeat each
 * other's blocks instead of sharing them, as on a mesh whose nodes are in no order (tests/sim/core/test_simd_blocks.c)
 */
#define PAL_PART_MAX 0.8
/* nodes of a body of springs for each of its threads: with fewer, waiting for each other costs what they save
 * (`palpate bench springs`: two threads take 0.9 of the time of one from 1,700 nodes on, 1.1 at 800;
 * tests/replay/test_golden.c has a body with more) */
enum { PAL_PART_NODES = 750 };
/* active nodes of an adaptive surface for each of its threads: with fewer, waiting for each other costs what they save
 * (`palpate bench adaptive`: two threads take the time of one at 746 nodes, at 1,794 0.75 of it in
 * half of the runs and 1.3 times in the others, where both cores seem to be one; from 3,000 on no run is slower;
 * tests/replay/test_golden.c has a surface with more) */
enum { PAL_PART_ACTIVE = 500 };
/* elements of a subdivision solid that threads share: with fewer, their waits cost what they save (`palpate bench
 * solids`: two threads take 1.07 of the time of one for 312 elements, 0.67 for 512; tests/replay/test_golden.c has 512)
 */
enum { PAL_SHARED_CELLS = 400 };
#endif
