/* Predicts the cost of a step of a running body's method on other meshes, from a short probe on two meshes: the body's
 * own, and its voxels merged by eights. Private to estimate_*.c. Allocates heap memory; takes some tens of ms.
 *
 * Fewer nodes: time is proportional to nodes^growth, with the growth observed between the two meshes. More nodes: all
 * time is proportional to the nodes except the factor's, which is the number of solves times the entries, each read
 * twice, at this machine's read rate for arrays of that length. The entries, and the iterations of every part, grow as
 * observed. Node counts are those of pal_configuration_estimate_nodes. Thread: one at a time. */
#ifndef PAL_ESTIMATE_ESTIMATE_COST_MODEL_H
#define PAL_ESTIMATE_ESTIMATE_COST_MODEL_H
#include "server/estimate/estimate_predict.h"
#include "server/sim/world/world.h"

/* Fills nodes, substeps and work of `out`, whose configuration and implicit must be set. work is NaN if the probe
 * failed. scene: the body alone; live: a world of it; small: a world of the same method on the coarse mesh. Both worlds
 * bear the same loads; their final state is unspecified. */
void pal_estimate_cost_model(const pal_scene *scene, pal_world *live, pal_world *small, pal_prediction *out);
#endif
