/* Rotation of frames of a skin (frame_spin.h). */
#include "server/sim/contact/frame_spin.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"

/* tilt = part/|N| ([X]x - rise X Z'), twist = part/reach X (X x X X' and Z.X are 0) */
static void set_rotation(pal_frame_spin *t, const double X[3], double part, double length, double rise, double reach)
{
    const double cross[9] = {0, -X[2], X[1], X[2], 0, -X[0], -X[1], X[0], 0};
    double s = part * (1 / length);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) t->tilt[3 * r + c] = s * (cross[3 * r + c] - rise * X[r] * t->Z[c]);
    pal_scale3(t->twist, part * (1 / reach), X);
    t->turns = true;
}

/* forces of a torque q on nodes of the fan: to_b x h and h x to_a, h = tilt' q; on the frame's node minus their sum,
 * which is small where the fan is closed */
static void set_bounds(pal_frame_spin *t)
{
    double tilt2 = 0, rest[3] = {0};
    for (int i = 0; i < 9; i++) tilt2 += t->tilt[i] * t->tilt[i];
    t->ring = sqrt(tilt2), t->edge = pal_norm3(t->twist), t->all = 0;
    for (const pal_frame_face *face = t->face; face < t->face + t->n_face; face++) {
        t->all += t->ring * (pal_norm3(face->to_a) + pal_norm3(face->to_b));
        pal_add3(rest, rest, face->to_b);
        pal_sub3(rest, rest, face->to_a);
    }
    t->own = t->ring * pal_norm3(rest) + t->edge;
    t->all += t->own + t->edge;
}

void pal_frame_spin_find(const pal_body *body, int slot, pal_frame_face *face, pal_frame_spin *t)
{
    const pal_skin *skin = body->display.skin;
    const int first = skin->fan_start[slot];
    double X[3], N[3] = {0}, n[3], sum = 0;
    *t = (pal_frame_spin){.node = skin->frame[slot], .n_face = skin->fan_start[slot + 1] - first, .face = face};
    const double *o = body->d + 3 * (size_t)t->node;
    for (int i = 0; i < t->n_face; i++) {
        face[i].a = skin->fan[2 * (first + i)], face[i].b = skin->fan[2 * (first + i) + 1];
        pal_sub3(face[i].to_a, body->d + 3 * (size_t)face[i].a, o);
        pal_sub3(face[i].to_b, body->d + 3 * (size_t)face[i].b, o);
        pal_cross3(n, face[i].to_a, face[i].to_b);
        pal_add3(N, N, n);
        sum += pal_norm3(n);
    }
    double length = pal_norm3(N), part = fmin(1, length / sum / FAN_FOLDED - 1);
    if (!(part > 0) || !pal_unit3(X, N, 0)) return;
    for (int k = 0; k < 2 && !t->turns; k++) {
        double edge[3], tangent[3];
        t->end = skin->frame_edge[2 * (size_t)slot + (size_t)k];
        if (t->end < 0) break;
        pal_sub3(edge, body->d + 3 * (size_t)t->end, o);
        double up = pal_dot3(edge, X);
        for (int c = 0; c < 3; c++) tangent[c] = edge[c] - up * X[c];
        double reach = pal_norm3(tangent);
        if (!(reach > FAN_FOLDED * pal_norm3(edge))) continue;
        pal_cross3(t->Z, X, tangent);
        pal_scale3(t->Z, 1 / reach, t->Z);
        set_rotation(t, X, part, length, up / reach, reach);
        set_bounds(t);
    }
}

void pal_frame_spin_of(const pal_frame_spin *t, const double *u, double spin[3])
{
    const double *v = u + 3 * (size_t)t->node;
    double normal[3] = {0}, va[3], vb[3], e[3];
    pal_set3(spin, 0, 0, 0);
    if (!t->turns) return;
    for (const pal_frame_face *face = t->face; face < t->face + t->n_face; face++) {
        pal_sub3(va, u + 3 * (size_t)face->a, v);
        pal_sub3(vb, u + 3 * (size_t)face->b, v);
        pal_cross3(va, va, face->to_b);
        pal_cross3(vb, face->to_a, vb);
        pal_add3(normal, normal, va);
        pal_add3(normal, normal, vb);
    }
    pal_mul33(spin, t->tilt, normal);
    pal_sub3(e, u + 3 * (size_t)t->end, v);
    pal_axpy3(spin, pal_dot3(t->Z, e), t->twist);
}

void pal_frame_spin_add_torque(const pal_frame_spin *t, const double torque[3], double own[3], double *out)
{
    double h[3], g[3], twist = pal_dot3(t->twist, torque);
    if (!t->turns) return;
    pal_axpy3(out + 3 * (size_t)t->end, twist, t->Z);
    pal_axpy3(own, -twist, t->Z);
    pal_tmul33(h, t->tilt, torque);
    for (const pal_frame_face *face = t->face; face < t->face + t->n_face; face++) {
        pal_cross3(g, face->to_b, h);
        pal_add3(out + 3 * (size_t)face->a, out + 3 * (size_t)face->a, g);
        pal_sub3(own, own, g);
        pal_cross3(g, h, face->to_a);
        pal_add3(out + 3 * (size_t)face->b, out + 3 * (size_t)face->b, g);
        pal_sub3(own, own, g);
    }
}

void pal_frame_spin_add_bound(const pal_frame_spin *t, double torque_Nm, double *out)
{
    if (!t->turns) return;
    out[t->node] += torque_Nm * t->own;
    out[t->end] += torque_Nm * t->edge;
    for (const pal_frame_face *face = t->face; face < t->face + t->n_face; face++) {
        out[face->a] += torque_Nm * t->ring * pal_norm3(face->to_b);
        out[face->b] += torque_Nm * t->ring * pal_norm3(face->to_a);
    }
}
