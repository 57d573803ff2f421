/* A grip on another body (grasp_transfer.h). */
#include "server/sim/contact/grasp_transfer.h"

#include "server/base/vec3.h"
#include "server/sim/core/blend.h"

void pal_grasp_transfer_begin(pal_grasp_transfer *h, const pal_grasp_spring *s)
{
    double shift[3];
    h->due = false;
    h->left_s = PAL_BLEND_GRASP_S;
    if (s->firm && h->k_N_m > 0) {
        /* what caps and haste held back still is, where that is no jump */
        pal_sub3(shift, s->old_hold_m, s->hold);
        pal_add3(shift, shift, h->shift);
        pal_sub3(shift, shift, h->y);
        pal_axpy3(shift, -1 / h->k_N_m, h->force_N);
    } else {
        for (int c = 0; c < 3; c++) shift[c] = -s->at_m[c] - s->hold[c];
        pal_axpy3(shift, -1 / s->k_N_m, s->damper_N);
    }
    pal_add3(shift, shift, s->y);
    pal_axpy3(shift, 1 / s->k_N_m, h->force_N);
    if (pal_finite3(shift))
        pal_copy3(h->shift, shift);
    else
        pal_set3(h->shift, 0, 0, 0);
}

void pal_grasp_transfer_add(pal_grasp_transfer *h, double dt_s, double goal[3])
{
    pal_add3(goal, goal, h->shift);
    pal_scale3(h->shift, pal_blend_release(&h->left_s, dt_s), h->shift);
}
