/* Policy of scenes that are made from a bare surface, scan or solid. Thread: [any]. */
#ifndef PAL_SCENE_TUNING_H
#define PAL_SCENE_TUNING_H

/* kept voxels (13,000 tetrahedra) and, for model fem, nodes that run live on one core; elements of a solid;
 * tests/scene/test_surface_scene.c */
enum { PAL_WANTED_VOXELS = 2600, PAL_WANTED_NODES = 2500, PAL_WANTED_ELEMENTS = 2000 };
/* triangles of a scan's surface; of the coarsest level of an adaptive surface, which becomes so coarse when it has more
 * than PAL_MANY_TRI: it would hardly keep real time; tests/scene/test_adaptive_scene.c */
enum { PAL_WANTED_TRI = 50000, PAL_COARSE_TRI = 1500, PAL_MANY_TRI = 3000 };
/* border voxels per A/h^2, from spheres: only where the search for a resolution begins */
#define PAL_BORDER_FACTOR 1.1
/* model fem leaves out border voxels with less material: they add unknowns and next to no stiffness */
#define PAL_FEM_MIN_FILL 0.1
/* s: a pose waits at most a step on its way into the picture; an implicit step costs more, so it is as long as it is
 * shown */
#define PAL_LIVE_STEP_S (1.0 / 120)
#define PAL_FEM_STEP_S  (1.0 / 60)
/* of the box diagonal: radius of a tool */
#define PAL_TOOL_RADIUS_S 0.025
/* adaptive surfaces: levels; m: thickness of the wall, of organs about 3 mm */
enum { PAL_ADAPTIVE_LEVELS = 2 };
#define PAL_WALL_M 0.003
/* m: around an opening's vertices, so that the midpoints between them are held */
#define PAL_OPENING_M 0.003
/* voxels of a region's label volume: one byte each */
#define PAL_REGION_VOXELS 512e6
/* J: constants of springs on a grid, any that a double can square */
#define PAL_GRID_K_MIN_J 1e-60
#define PAL_GRID_K_MAX_J 1e60
/* m, of any coordinate of a trocar: no instrument is as long */
#define PAL_TROCAR_MAX_M 10.0
/* m, of any coordinate of a problem: a body's frame is single precision on the wire */
#define PAL_LENGTH_MAX_M 1e9
#endif
