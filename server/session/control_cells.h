/* The control cells of a sculptable part as a JSON file, from which a client knows what a click would pick
 * (protocol/README.md, "Control cells"). Thread: [any]. */
#ifndef PAL_SESSION_CONTROL_CELLS_H
#define PAL_SESSION_CONTROL_CELLS_H
#include "server/mesh/cells/cells.h"
#include "server/sim/world/shown_surface.h"

/* origin_m: of the body's frame in the scene's frame. The caller frees the text with free(). NULL: out of memory */
char *pal_control_cells_text(const pal_cells *cells, const double origin_m[3], const pal_shown *shown);
#endif
