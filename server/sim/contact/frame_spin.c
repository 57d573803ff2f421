/* Frames of a skin: axes and lengths that their turning depends on. */
#include "server/sim/contact/frame_spin.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"

void pal_frame_spin_find(const pal_body *body, int slot, pal_frame_spin *t)
{
    const pal_skin *skin = body->skin;
    const double *o = body->d + 3 * (size_t)skin->frame[slot];
    double N[3] = {0}, sum = 0;
    t->turns = false;
    for (size_t i = (size_t)skin->fan_start[slot]; i < (size_t)skin->fan_start[slot + 1]; i++) {
        double a[3], b[3];
        pal_sub3(a, body->d + 3 * (size_t)skin->fan[2 * i], o);
        pal_sub3(b, body->d + 3 * (size_t)skin->fan[2 * i + 1], o);
        pal_cross3(a, a, b);
        pal_add3(N, N, a);
        sum += pal_norm3(a);
    }
    double length = pal_norm3(N);
    t->part = fmin(1, (length / sum - FAN_FOLDED) / (FAN_OPEN - FAN_FOLDED));
    if (!(t->part > 0) || !pal_unit3(t->X, N, 0)) return;
    t->per_normal = 1 / length;
    for (int k = 0; k < 2 && !t->turns; k++) {
        double edge[3], tangent[3];
        t->end = skin->frame_edge[2 * (size_t)slot + (size_t)k];
        if (t->end < 0) break;
        pal_sub3(edge, body->d + 3 * (size_t)t->end, o);
        double up = pal_dot3(edge, t->X);
        pal_copy3(tangent, edge);
        pal_axpy3(tangent, -up, t->X);
        double reach = pal_norm3(tangent);
        if (!(reach > MIN_TANGENT * pal_norm3(edge))) continue;
        pal_cross3(t->Z, t->X, tangent);
        pal_scale3(t->Z, 1 / reach, t->Z);
        t->per_reach = 1 / reach;
        t->rise = up / reach;
        t->turns = true;
    }
}
