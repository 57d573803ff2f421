/* A body on a solid (subdivision_solid.h): what follows from the solid's samples. body->solid, solid_mass and the
 * arrays of pal_body_allocate_embedded are there. Thread: [load], [sim] between steps. */
#ifndef PAL_SIM_SUBDIVISION_SUBDIVISION_BODY_H
#define PAL_SIM_SUBDIVISION_SUBDIVISION_BODY_H
#include "server/sim/core/body.h"
#include "server/sim/subdivision/subdivision_solid.h"

/* mass_kg, node_mass_kg, the values of solid_mass and node_inverse_mass_1_kg anew: once what is held is known, and
 * after every change of the samples. Ease is looked at only at shown nodes. */
void pal_subdivision_solid_update_mass(pal_body *body);
/* the samples anew with another material of the body, regions and strokes as they are, then
 * pal_subdivision_solid_update_mass */
void pal_subdivision_solid_set_material(pal_body *body, const pal_material *material);
#endif
