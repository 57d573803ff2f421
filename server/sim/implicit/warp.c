/* Factors that turn with the body. */
#include "server/sim/implicit/warp.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/sim/implicit/tuning.h"

#include <string.h>

enum { ROTATION_ITERATIONS = 4 };

/* no rotation at any dof */
static void set_rest(double *quat, int n_dof)
{
    for (int i = 0; i < 4 * n_dof; i++) quat[i] = i % 4 == 0;
}

pal_err pal_node_rotations_make(const pal_system *system, pal_arena *arena, pal_node_rotations *out)
{
    int n = system->body->n_dof;
    *out = (pal_node_rotations){.n_dof = n, .any = system->has_rotation};
    out->quat = PAL_NEW(arena, double, 4 * (size_t)n);
    out->sum = PAL_NEW(arena, double, system->has_rotation ? 9 * (size_t)n : 0);
    if (!out->quat || !out->sum) return PAL_ERR_MEMORY;
    pal_node_rotations_reset(out);
    return PAL_ERR_OK;
}

void pal_node_rotations_reset(pal_node_rotations *rotations)
{
    set_rest(rotations->quat, rotations->n_dof);
}

void pal_node_rotations_update(pal_node_rotations *rotations, const pal_system *system)
{
    if (!rotations->any) return;
    pal_system_rotate(system, rotations->sum);
    for (int i = 0; i < rotations->n_dof; i++)
        pal_polar_rotation(rotations->sum + 9 * i, rotations->quat + 4 * i, ROTATION_ITERATIONS);
}

pal_err pal_warp_make(const pal_block_matrix *pattern, const pal_body *body, const pal_node_rotations *rotations,
                      bool single, pal_arena *arena, pal_warp *out)
{
    size_t n = (size_t)body->n_dof;
    *out = (pal_warp){.n_dof = body->n_dof, .single = single, .quat = rotations->quat};
    if (!PAL_NEW_DOUBLES(arena, 4 * n, &out->base, &out->next) || !PAL_NEW_DOUBLES(arena, 9 * n, &out->w) ||
        !PAL_NEW_DOUBLES(arena, 3 * n, &out->work))
        return PAL_ERR_MEMORY;
    double before = pal_clock_s();
    pal_err err = pal_cholesky_create(pattern, body->support, &out->factor);
    out->analyse_s = pal_clock_s() - before;
    return err;
}

void pal_warp_destroy(pal_warp *warp)
{
    pal_cholesky_destroy(warp->factor);
    warp->factor = NULL;
}

pal_err pal_warp_factor(pal_warp *warp, const pal_block_matrix *a)
{
    (void)pal_cholesky_adopt(warp->factor);
    warp->pending = false, warp->left_s = 0;
    double before = pal_clock_s();
    pal_err err = pal_cholesky_factor(warp->factor, a, warp->single);
    warp->factor_s += pal_clock_s() - before;
    if (err) return err;
    warp->n_factor++;
    warp->rotated = false;
    memcpy(warp->base, warp->quat, 4 * sizeof(double) * (size_t)warp->n_dof);
    warp->refreshed = false;
    return PAL_ERR_OK;
}

void pal_warp_set_rest(pal_warp *warp)
{
    set_rest(warp->base, warp->n_dof);
}

bool pal_warp_refresh(pal_warp *warp, const pal_block_matrix *a, bool at_rest)
{
    if (!pal_warp_ready(warp) || pal_cholesky_refresh(warp->factor, a)) return false;
    memcpy(warp->next, warp->quat, 4 * sizeof(double) * (size_t)warp->n_dof);
    if (at_rest) set_rest(warp->next, warp->n_dof);
    warp->pending = true;
    warp->left_s = pal_cholesky_flops(warp->factor) / PAL_REFRESH_FLOPS;
    return true;
}

void pal_warp_step(pal_warp *warp, double dt_s)
{
    warp->left_s -= dt_s;
    if (!warp->pending || warp->left_s > 0) return;
    warp->pending = false, warp->left_s = PAL_PAUSE_S;
    if (pal_cholesky_adopt(warp->factor)) return;
    memcpy(warp->base, warp->next, 4 * sizeof(double) * (size_t)warp->n_dof);
    warp->n_factor++;
    warp->refreshed = true;
}

void pal_warp_rotate(pal_warp *warp, const pal_node_rotations *rotations)
{
    warp->rotated = rotations->any;
    for (int i = 0; i < warp->n_dof && rotations->any; i++) {
        /* quat times the conjugate of base */
        const double *a = rotations->quat + 4 * i, *b = warp->base + 4 * i;
        const double q[4] = {a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3],
                             -a[0] * b[1] + a[1] * b[0] - a[2] * b[3] + a[3] * b[2],
                             -a[0] * b[2] + a[1] * b[3] + a[2] * b[0] - a[3] * b[1],
                             -a[0] * b[3] - a[1] * b[2] + a[2] * b[1] + a[3] * b[0]};
        pal_quat_matrix(q, warp->w + 9 * i);
    }
}

void pal_warp_solve(pal_warp *warp, const double *r, double *z)
{
    if (!warp->rotated) {
        (void)pal_cholesky_solve(warp->factor, r, z);
        return;
    }
    for (int i = 0; i < warp->n_dof; i++) pal_tmul33(warp->work + 3 * i, warp->w + 9 * i, r + 3 * i);
    (void)pal_cholesky_solve(warp->factor, warp->work, warp->work);
    for (int i = 0; i < warp->n_dof; i++) pal_mul33(z + 3 * i, warp->w + 9 * i, warp->work + 3 * i);
}
