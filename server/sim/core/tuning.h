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
#define PAL_DENSITY_MAX_KG_M3 (1 / PAL_DENSITY_MIN_KG_M3)
/* distance of Poisson's ratio from -1, where the shear modulus is infinite, and from 0.5, where the bulk modulus is. A
 * bulk modulus of 5,000 times the shear modulus is as far as double precision and conjugate gradients go together;
 * larger ratios up to MAX are taken as CLAMP and reported (tests/stability/test_fem_numbers.c) */
#define PAL_POISSON_MARGIN 1e-4
#define PAL_POISSON_MIN    (-1 + PAL_POISSON_MARGIN)
#define PAL_POISSON_CLAMP  (0.5 - PAL_POISSON_MARGIN)
#define PAL_POISSON_MAX    (0.5 - 0.01 * PAL_POISSON_MARGIN)
/* 1/s, c/m: faster decay than the shortest sub-step resolves */
#define PAL_DAMPING_MAX_1_S 1e9
/* 1/s: the largest rate that is derived from the lowest frequency. Soft tissue comes to rest within a second with it;
 * bodies with w1 above 2 1/s have it (tests/sim/plan/test_damping.c) */
#define PAL_DAMPING_1_S 4.0
/* largest damping ratio of mode 1: the cap holds long before (tests/scene/test_material_limits.c) */
#define PAL_DAMPING_RATIO_MAX 1e3

/* ---- sizes ---- */

/* m: positions, radii; a body of this size in mm as a file's unit is still one (tests/scene/test_scene_file.c) */
#define PAL_LENGTH_MAX_M 1e9
/* factors of a paint stroke (tests/scene/test_subdivision_scene.c) */
#define PAL_STROKE_FACTOR_MIN 1e-6
#define PAL_STROKE_FACTOR_MAX (1 / PAL_STROKE_FACTOR_MIN)
/* nodes of a grid of spring constants */
#define PAL_SPRING_GRID_NODES_MAX (1 << 20)
/* largest load on a node is this times E h^2: a strain of the order of 10 in one element, far above any linear answer
 * (tests/sim/world/test_world.c) */
#define PAL_LOAD_CAP_FACTOR 10

/* ---- elements ---- */

/* elements with larger Poisson ratios lock in volume: those of subdivision solids share their changes of volume, a
 * split of inverted elements takes this ratio at most (of 720 shuffled bodies all recover with it, one in a hundred
 * does not with 0.45; tests/sim/elements/test_hex_recovery.c, tests/sim/subdivision/test_cell_volume.c) */
#define PAL_LOCK_FREE_POISSON 0.3
/* least part of the material of a border voxel, and of the moduli of a region of inverted elements, so that no node is
 * left nearly without stiffness and mass (tests/sim/solvers/test_fem_dynamic.c,
 * tests/sim/springs/test_spring_recovery.c) */
#define PAL_FILL_MIN 0.02
/* cut voxels with less inside are dropped, unless more than MAX_MISSING of the volume would go; then those below
 * PAL_FILL_MIN (tests/sim/core/test_configuration.c) */
#define PAL_VOXEL_DROP_FILL   0.25
#define PAL_VOXEL_MAX_MISSING (PAL_VOXEL_DROP_FILL / 10)
#endif
