/* Samples that come and go with a step, for touch.c (touch_sample.c also makes the fixed ones). Thread: [sim]. */
#ifndef PAL_SIM_TOUCH_SAMPLE_H
#define PAL_SIM_TOUCH_SAMPLE_H
#include "server/sim/contact/touch.h"

/* passing samples for triangles at the listed vertices that were short at rest and are long now */
void pal_touch_stretched(pal_touch *touch, const pal_body *body, const int32_t *list, int n);
#endif
