/* Bodies that several benches measure. Thread: [load]. */
#ifndef PAL_BENCH_BODY_H
#define PAL_BENCH_BODY_H
#include "server/mesh/cells/cell_models.h"
#include "server/mesh/volume/prepared.h"
#include "server/sim/world/world.h"

/* a box of n[0] x n[1] x n[2] voxels of edge_m: tetrahedra, and hexahedra; no surface. MEMORY */
pal_err bench_box(const int n[3], double edge_m, pal_prepared *out, pal_diagnostic *diag);
/* control cells of a named solid and their boundary; free both, also after an error */
pal_err bench_solid(const pal_cell_model *model, pal_cells *cells, pal_prepared *mesh, pal_diagnostic *diag);
/* one step; *ms: its processor time; FROZEN */
pal_err bench_step(pal_world *world, double step_s, double *ms);
/* milliseconds of the last step that went into components of the stage, or of the name; NULL: any */
double bench_component_ms(const pal_world *world, const char *stage, const char *name);
#endif
