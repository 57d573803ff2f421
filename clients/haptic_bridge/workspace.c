#include "clients/haptic_bridge/workspace.h"
#include "clients/haptic_bridge/tuning.h"
#include "server/base/vec3.h"

#include <string.h>

#define TURN (2 * 3.14159265358979)

void pal_workspace_rotation(const double up[3], double rotation[9])
{
    double ex[3], ey[3];
    const double other[3] = {fabs(up[0]) < 0.9, fabs(up[0]) >= 0.9, 0};
    pal_cross3(ey, up, other);
    pal_unit3(ey, ey, 1e-9);
    pal_cross3(ex, ey, up);
    for (int k = 0; k < 3; k++) rotation[3 * k] = ex[k], rotation[3 * k + 1] = ey[k], rotation[3 * k + 2] = up[k];
}

static void quat_multiply(double r[4], const double a[4], const double b[4])
{
    const double w = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
    const double x = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
    const double y = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
    const double z = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
    r[0] = w, r[1] = x, r[2] = y, r[3] = z;
}

static bool quat_unit(double q[4])
{
    const double size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!isfinite(size) || size < 1e-6) return false;
    for (int k = 0; k < 4; k++) q[k] /= size;
    return true;
}

void pal_workspace_quat(const double rotation[9], double q[4])
{
    const double *m = rotation;
    const double square[4] = {1 + m[0] + m[4] + m[8], 1 + m[0] - m[4] - m[8], 1 - m[0] + m[4] - m[8],
                              1 - m[0] - m[4] + m[8]};
    int big = 0;
    for (int k = 1; k < 4; k++)
        if (square[k] > square[big]) big = k;
    const double yz = m[7] - m[5], zx = m[2] - m[6], xy = m[3] - m[1];
    const double ab = m[1] + m[3], bc = m[5] + m[7], ca = m[2] + m[6];
    const double row[4][4] = {
        {square[0], yz, zx, xy}, {yz, square[1], ab, ca}, {zx, ab, square[2], bc}, {xy, ca, bc, square[3]}};
    memcpy(q, row[big], sizeof row[big]);
    quat_unit(q);
}

void pal_workspace_restart(pal_workspace *w)
{
    pal_workspace_quat(w->frame.rotation, w->frame_quat);
    w->known = false;
}

void pal_workspace_to_device(const pal_workspace *w, const double world[3], double device[3])
{
    pal_tmul33(device, w->frame.rotation, world);
}

void pal_workspace_to_world(const pal_workspace *w, const double device[3], double world[3])
{
    pal_mul33(world, w->frame.rotation, device);
}

void pal_workspace_move(pal_workspace *w, const pal_dev_state *state, bool hold, double dt_s)
{
    const double share = 1 - exp(-TURN * VELOCITY_CUT_HZ * dt_s), scale = w->frame.scale;
    double q[4], back[4], turn[4], away[3];
    memcpy(q, state->quat, sizeof q);
    if (!quat_unit(q)) memcpy(q, w->known ? w->quat_d : (double[4]){1, 0, 0, 0}, sizeof q);
    if (!w->known) {
        pal_copy3(w->x_d, state->position_m);
        memcpy(w->quat_d, q, sizeof q);
        memcpy(w->handle_quat, (double[4]){1, 0, 0, 0}, sizeof q);
        pal_set3(w->v_d, 0, 0, 0);
        pal_set3(w->omega_d, 0, 0, 0);
    }
    pal_sub3(w->step_d, state->position_m, w->x_d);
    for (int k = 0; k < 4; k++) back[k] = k ? -w->quat_d[k] : w->quat_d[k];
    quat_multiply(turn, q, back);
    for (int k = 0; k < 3; k++) {
        w->turn_d[k] = copysign(2, turn[0]) * turn[k + 1];
        w->v_d[k] += share * (w->step_d[k] / dt_s - w->v_d[k]);
        w->omega_d[k] += share * (w->turn_d[k] / dt_s - w->omega_d[k]);
    }
    pal_copy3(w->x_d, state->position_m);
    memcpy(w->quat_d, q, sizeof q);
    pal_sub3(away, w->x_d, w->centre_m);
    pal_workspace_to_world(w, away, away);
    pal_workspace_to_world(w, w->v_d, w->v_w);
    pal_workspace_to_world(w, w->omega_d, w->omega_w);
    quat_multiply(turn, w->frame_quat, q);
    if (hold && w->known) {
        /* the world pose is constant: centre and turn of the handle follow */
        pal_sub3(away, w->x_w, w->frame.origin_m);
        pal_workspace_to_device(w, away, away);
        for (int k = 0; k < 3; k++) w->centre_m[k] = w->x_d[k] - away[k] / scale;
        pal_set3(w->v_w, 0, 0, 0);
        pal_set3(w->omega_w, 0, 0, 0);
        for (int k = 1; k < 4; k++) turn[k] = -turn[k];
        quat_multiply(w->handle_quat, turn, w->quat_w);
    } else {
        for (int k = 0; k < 3; k++) w->x_w[k] = w->frame.origin_m[k] + scale * away[k];
        pal_scale3(w->v_w, scale, w->v_w);
        quat_multiply(w->quat_w, turn, w->handle_quat);
    }
    w->clutched = hold;
    w->known = true;
}

bool pal_workspace_walls(const pal_workspace *w, const pal_dev_info *info, double damping_floor_s, double force_N[3],
                         double *energy_J)
{
    const double k_wall = fmin(WALL_STIFFNESS_N_M, info->stiffness_max_N_m);
    const double b = fmin(info->damping_max_Ns_m, damping_floor_s * k_wall);
    bool at_wall = false;
    *energy_J = 0;
    for (int k = 0; k < 3; k++) {
        const double middle = (info->low_m[k] + info->high_m[k]) / 2;
        const double half = WALL_FRACTION * (info->high_m[k] - info->low_m[k]) / 2;
        const double off = w->x_d[k] - middle, in = fabs(off) - half;
        force_N[k] = 0;
        if (!(in > 0)) continue;
        /* a wall pushes and never pulls */
        force_N[k] = -copysign(fmax(0, k_wall * in + b * copysign(1, off) * w->v_d[k]), off);
        *energy_J += k_wall * in * in / 2;
        at_wall = true;
    }
    return at_wall;
}
