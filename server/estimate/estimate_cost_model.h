/* What a step of a running body's method would take on other meshes, from a short probe of it on two: the body's own
 * and its voxels merged by eights. Private to estimate_*.c. Heap memory, some tens of ms. Thread: one at a time.
 *
 * Fewer nodes: time goes with nodes^growth, growth as between the two. More: all but the factor's share goes with the
 * nodes; that share is solves times entries, each read twice, at the rate at which this machine reads arrays of its
 * length, which falls where they no longer fit into caches, and its entries grow as between the two, as
 * do the iterations of all. Nodes are those
 * that pal_configuration_estimate_nodes thinks of. */
#ifndef PAL_ESTIMATE_ESTIMATE_COST_MODEL_H
#define PAL_ESTIMATE_ESTIMATE_COST_MODEL_H
#include "server/estimate/estimate_predict.h"
#include "server/sim/world/world.h"

/* fills nodes, substeps and work of out, whose setting and implicit are set; work NaN: they went wrong. scene: of the
 * body alone, live: a world of it, small: of the same method on the coarse mesh; both bear the same loads and end as
 * they may */
void pal_estimate_cost_model(const pal_scene *scene, pal_world *live, pal_world *small, pal_prediction *out);
#endif
