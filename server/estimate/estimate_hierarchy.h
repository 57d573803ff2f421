/* Measures the error that remains at other resolutions, for a body with many cut voxels or two voxels across: the
 * body's own mesh, half and twice as many voxels, and a still finer one (four times as many, or up to 16,000 nodes) are
 * made as a configuration switch makes them and solved at rest by the linear law under the same loads.
 *
 * No power of h describes this error. The stiffness of a cut voxel is scaled by the share that lies inside: right along
 * the surface, 1 / share^2 too large in bending, so that thin parts of few voxels hardly move. Merged voxels do not
 * show it (for four organs of 5 to 40 voxels the error was 0.2 to 6 times their estimate; a beam of two voxels merges
 * to one, which has almost no bending stiffness: 8 times). The error at size s is the largest distance, at vertices of
 * the displayed surface, from the finest mesh of size r, over sqrt((1 - q) sqrt(1 + q^2)), q = (s / r)^2, between
 * errors of equal sign and independent ones. If twice as many voxels are too close to the finest mesh, their error is
 * extrapolated from half and the present size, no faster than h^2. Random errors of the finest mesh remain: for the
 * gear in 30 voxels the estimate was 0.44, 1.5 and 2 times the error with finest meshes of 42, 46 and none.
 *
 * Private to this room. Allocates heap memory, up to 80 MB while it runs. Slow: half a second for an organ of 20
 * voxels, three seconds if nearly incompressible. Thread: one at a time. */
#ifndef PAL_ESTIMATE_ESTIMATE_HIERARCHY_H
#define PAL_ESTIMATE_ESTIMATE_HIERARCHY_H
#include "server/estimate/rest_solution.h"

typedef struct pal_estimate_hierarchy {
    bool known;
    double times;       /* remaining error over the change from merged voxels to this mesh */
    double half, twice; /* error with half and with twice as many voxels over that of this mesh; NaN: no such mesh */
    int finest;         /* voxels of the finest mesh */
    /* `times` is accurate within this factor: 2 with twice as many voxels in the finest mesh, more with fewer;
     * INFINITY: beyond the estimate */
    double uncertainty_factor;
    /* Conditions of the measurement: loads [n_node][3] scaled to length 1, and the material. next_s: earliest clock
     * time of the next measurement. Then the number of measurements, and of meshes solved for them. */
    double *loads, next_s;
    pal_material material;
    int n_measured, n_mesh;
} pal_estimate_hierarchy;

/* Measures on the first call, and again if the loads or Poisson's ratio change (for bodies with regions: also E),
 * after a wait of 20 times the duration of the last measurement. Returns true if the result matches the state,
 * false if it is older or unknown.
 * scene: one body of model fem, without tools; body: the running one, made from it; configuration: its present
 * configuration; state: its loads; shown: `times` applies to changes at vertices of the displayed surface, else at
 * nodes; fits: the voxels fit the body, so only integer multiples of their number are used; out: zeroed before the
 * first call. The result stays unknown if no such meshes exist (no surface, finer ones too large, no equilibrium)
 * or the run was stopped. */
bool pal_estimate_hierarchy_refresh(const pal_scene *scene, const pal_body *body,
                                    const pal_configuration *configuration, const pal_estimate_state *state, bool shown,
                                    bool fits, const _Atomic bool *stop, pal_estimate_hierarchy *out);
/* Writes one clause on the accuracy of the error for many cut voxels: within a factor of 3, as observed, without a
 * hierarchy. fresh: the return value of refresh. */
void pal_estimate_hierarchy_describe(const pal_estimate_hierarchy *family, bool fresh, char *text, size_t n_byte);
void pal_estimate_hierarchy_free(pal_estimate_hierarchy *family); /* accepts a zeroed struct */
#endif
