/* Samples that come and go with a step, for contact_points.c (contact_samples.c also makes the fixed ones). Thread:
 * [sim]. */
#ifndef PAL_SIM_CONTACT_CONTACT_SAMPLES_H
#define PAL_SIM_CONTACT_CONTACT_SAMPLES_H
#include "server/sim/contact/contact_points.h"

/* passing samples for triangles at the listed vertices that were short at rest and are long now */
void pal_contact_points_sample_stretched(pal_contact_points *touch, const pal_body *body, const int32_t *list, int n);
#endif
