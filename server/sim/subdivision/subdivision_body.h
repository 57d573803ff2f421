/* A body on a subdivision solid: the model's side of pal_dofs (dofs.h). Thread: [load], [sim] between steps. */
#ifndef PAL_SIM_SUBDIVISION_SUBDIVISION_BODY_H
#define PAL_SIM_SUBDIVISION_SUBDIVISION_BODY_H
#include "server/sim/core/body.h"
#include "server/sim/subdivision/subdivision_solid.h"

/* Fills body->dofs. body->model.solid, mass_operator, node_inverse_mass_1_kg and the arrays of
 * pal_body_allocate_interpolated are there. update_mass sets mass_kg, node_mass_kg, the values of mass_operator and, at
 * shown nodes, node_inverse_mass_1_kg; set_material takes the samples again with another material of the body, with the
 * same regions and strokes, and then updates the masses */
void pal_subdivision_body_dofs(pal_body *body);
#endif
