/* What a body of cut voxels, or of two across, leaves in other sizes, measured: its own mesh, half and twice as many
 * voxels and a finer mesh yet (four times as many, or up to 16,000 nodes), made as a switch makes them
 * (pal_configuration_make), at rest by the linear law under the same loads.
 *
 * No power of h says it. Voxels that the surface cuts count by the share that lies inside: as stiff along the surface
 * as they shall be, and 1 / share^2 too stiff to bend, so that thin parts of few voxels hardly move and the error is as
 * large as the solution; and from the size on from which those less than a quarter full can be dropped
 * (configuration.h) the error falls to a third at once. Merged voxels do not see that: the error that was left was 0.2
 * to 6 times what they told, of four organs in 5 to 40 voxels. Here the error in size s is the largest distance at
 * vertices of the shown surface from the finest one, of size r, over sqrt((1 - q) sqrt(1 + q^2)), q = (s / r)^2:
 * between errors of the same sign and such that have nothing to do with each other. That of twice as many voxels, where
 * these are too near to the finest to be told from it, goes on from half and this size, not faster than h^2.
 *
 * What is random in the finest mesh stays in it: the gear in 30 voxels was told 0.44, 1.5 and 2 times its error by
 * finest meshes of 42, 46 and none.
 *
 * Of two voxels across, merged ones are one, which B-bar leaves next to nothing to bend with: a beam's error was told 8
 * times too large.
 *
 * Private to estimate_*.c. Heap memory, up to 80 MB while it lasts, as meshes of many nodes are solved without a factor
 * (rest_solution.h); slow: half a second of an organ of 20 voxels, three of a nearly incompressible one. Thread: one at
 * a time. */
#ifndef PAL_ESTIMATE_ESTIMATE_HIERARCHY_H
#define PAL_ESTIMATE_ESTIMATE_HIERARCHY_H
#include "server/estimate/rest_solution.h"

typedef struct pal_estimate_hierarchy {
    bool known;
    double times;       /* error left over the change from merged voxels to this mesh                                 */
    double half, twice; /* error of half and of twice as many voxels over this mesh's; NaN: none so coarse */
    int finest;         /* voxels of the finest mesh */
    /* `times` is good to this factor: 2 as it was observed with twice as many voxels in the finest mesh, more where
     * that has fewer, by what the two ways in which errors may add up differ by then; INFINITY: it is beyond what is
     * told */
    double uncertainty_factor;
    /* what it was measured under: loads [n_node][3] of length 1, and the material; the clock from which on it may be
     * measured again; how often it was, and how many meshes were solved for that */
    double *loads, next_s;
    pal_material material;
    int n_measured, n_mesh;
} pal_estimate_hierarchy;

/* Measures it, the first time; again where loads or Poisson's ratio are others (of bodies with regions: E, too), as
 * soon as it has waited 20 times as long as that took. True: it is of what the state says; false: of what was before,
 * or not known. scene: of one body of model fem, without tools; body: the running one, as made from it; setting: as it
 * is; state: what it bears; shown: `times` is of changes at vertices of the shown surface, else at nodes; fits: voxels
 * fit the body, so that only whole multiples of their number do; out: begins zeroed. Stays unknown where this body has
 * no such meshes (no surface, finer ones too large, no rest) or it was stopped */
bool pal_estimate_hierarchy_refresh(const pal_scene *scene, const pal_body *body, const pal_configuration *setting,
                                    const pal_estimate_state *state, bool shown, bool fits, const _Atomic bool *stop,
                                    pal_estimate_hierarchy *out);
/* one clause on what the error of many cut voxels is good to: 3 was observed without a family. fresh: as refresh said
 */
void pal_estimate_hierarchy_describe(const pal_estimate_hierarchy *family, bool fresh, char *text, size_t n_byte);
void pal_estimate_hierarchy_free(pal_estimate_hierarchy *family); /* a zeroed one is fine */
#endif
