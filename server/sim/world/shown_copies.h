/* Copies of shown vertices where triangles beside each other look differently (shown_surface.h). Thread: make [load],
 * the others [sim]. */
#ifndef PAL_SIM_WORLD_SHOWN_COPIES_H
#define PAL_SIM_WORLD_SHOWN_COPIES_H
#include "server/base/arena.h"
#include "server/base/err.h"
#include "server/mesh/geometry/levels.h"
#include "server/sim/world/shown_surface.h"

/* Sets look, uv, the copies, and with them n_vertex and tri, of a part that is complete without. corner: u, v and
 * pal_look of the corners of the n_tri triangles tri at load [n_tri][3][3]. levels: of a part that adapts, whose level
 * 0 these are; uv of its midpoints is the mean of those of the ends on the same triangle. MEMORY */
pal_err pal_shown_copies_make(pal_shown *shown, int n_tri, const int32_t *tri, const float *corner,
                              const pal_levels *levels, pal_arena *arena);
/* corners of slot `slot` as it is drawn; to may be from */
void pal_shown_copies_slot(const pal_shown *shown, int slot, const int32_t from[3], int32_t to[3]);
#endif
