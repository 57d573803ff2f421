/* The point of a shown surface nearest to a given position, for commands that point at a body. Thread: [any]; no
 * heap. */
#ifndef PAL_SIM_WORLD_PICK_H
#define PAL_SIM_WORLD_PICK_H
#include "server/sim/world/shown_surface.h"

typedef struct pal_pick {
    int triangle;
    int32_t face;     /* control face of the triangle, -1: the surface has none */
    double weight[3]; /* of the triangle's corners, >= 0, sum 1                 */
    double rest_m[3]; /* the same point of the surface at rest, scene frame     */
    double distance_m;
} pal_pick;

/* position_m: present positions of the shown vertices [n_vertex][3]; NULL: at rest. On a surface with control faces
 * only triangles of a control face count. Empty triangle slots (0 0 0) never count. false: there is no such
 * triangle. */
bool pal_pick_nearest(const pal_shown *shown, const float *position_m, const double at_m[3], pal_pick *out);
#endif
