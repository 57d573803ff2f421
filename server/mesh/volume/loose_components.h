/* Components of a body that nothing holds.
 *
 * A component is connected through faces. One without a fixed point has six rigid motions that no force restores, so
 * any load moves it without bound. With the fraction of a component being its volume over that of the largest one:
 *
 *   - with `largest_only` the largest component stays and the others are dropped;
 *   - a component with a fixed point stays;
 *   - one without is dropped when its fraction is below 1 %: voxels of a thin tip whose neighbours are not in the grid;
 *   - a larger one without is refused when another one is fixed: it may be meant to be held, or to be left out;
 *   - with no fixed point at all the body is free: components of at least 1 % stay.
 *
 * The rule applies where scenes are prepared; a world simulates every component of its mesh. Components of an adaptive
 * surface have anchors, which leave no rigid motion: they all stay. Thread: [load]. */
#ifndef PAL_MESH_VOLUME_LOOSE_COMPONENTS_H
#define PAL_MESH_VOLUME_LOOSE_COMPONENTS_H
#include "server/mesh/cells/cells.h"
#include "server/mesh/volume/prepared.h"

/* components found and dropped */
typedef struct pal_loose_components {
    int n_component, n_dropped;        /* components before, and of them dropped     */
    double volume_m3;                  /* of all components                          */
    double dropped_m3, max_dropped_m3; /* of those dropped, and of the largest of them */
    bool largest_only;                 /* dropped because only the largest was wanted */
} pal_loose_components;

/* Drops components of a mesh of tetrahedra with its hexahedra; the skin is bound again, the surface stays. fixed
 * [n_node]: not 0 where a node is fixed. name appears in the message. REFUSED, with the number of components at fault
 * and volume, fraction and position of the largest of them, or MEMORY; the mesh is unchanged then */
pal_err pal_loose_components_drop(const char *name, const uint8_t *fixed, bool largest_only, pal_prepared *mesh,
                                  pal_loose_components *out, pal_diagnostic *diag);
/* the same with control cells; fixed [n_vertex] */
pal_err pal_loose_cells_drop(const char *name, const uint8_t *fixed, bool largest_only, pal_cells *cells,
                             pal_loose_components *out, pal_diagnostic *diag);
/* "body "x": 2 of 3 components dropped, ..." or an empty text when none is */
void pal_loose_components_describe(const pal_loose_components *parts, const char *name, pal_diagnostic *out);
#endif
