/* Factors that turn with the body. */
#include "server/sim/implicit/warp.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/num/polar.h"

#include <string.h>

enum { TURNS_MAX = 4, PAUSE_STEPS = 20 };
static const double slow_flops = 1e9; /* operations a second that every machine does on its spare thread */

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

void pal_node_rotations_reset(pal_node_rotations *turns)
{
    memset(turns->quat, 0, 4 * sizeof(double) * (size_t)turns->n_dof);
    for (int i = 0; i < turns->n_dof; i++) turns->quat[4 * i] = 1;
}

void pal_node_rotations_update(pal_node_rotations *turns, const pal_system *system)
{
    if (!turns->any) return;
    pal_system_rotate(system, turns->sum);
    for (int i = 0; i < turns->n_dof; i++) pal_polar_rotation(turns->sum + 9 * i, turns->quat + 4 * i, TURNS_MAX);
}

pal_err pal_warp_make(const pal_block_matrix *pattern, const pal_body *body, const pal_node_rotations *turns,
                      bool single, pal_arena *arena, pal_warp *out)
{
    size_t n = (size_t)body->n_dof;
    *out = (pal_warp){.n_dof = body->n_dof, .single = single, .quat = turns->quat};
    out->base = PAL_NEW(arena, double, 4 * n);
    out->next = PAL_NEW(arena, double, 4 * n);
    out->w = PAL_NEW(arena, double, 9 * n);
    out->work = PAL_NEW(arena, double, 3 * n);
    if (!out->base || !out->next || !out->w || !out->work) return PAL_ERR_MEMORY;
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

static void copy_turns(const pal_warp *warp, double *to)
{
    memcpy(to, warp->quat, 4 * sizeof(double) * (size_t)warp->n_dof);
}

pal_err pal_warp_factor(pal_warp *warp, const pal_block_matrix *a)
{
    if (pal_cholesky_refreshing(warp->factor)) (void)pal_cholesky_adopt(warp->factor, true);
    warp->wait = warp->pause = 0;
    double before = pal_clock_s();
    pal_err err = pal_cholesky_factor(warp->factor, a, warp->single);
    warp->factor_s += pal_clock_s() - before;
    if (err) return err;
    warp->n_factor++;
    warp->turned = false;
    copy_turns(warp, warp->base);
    warp->refreshed = false;
    return PAL_ERR_OK;
}

static void set_rest(double *quat, int n_dof)
{
    for (int i = 0; i < 4 * n_dof; i++) quat[i] = i % 4 == 0;
}

void pal_warp_set_rest(pal_warp *warp)
{
    set_rest(warp->base, warp->n_dof);
}

bool pal_warp_refresh(pal_warp *warp, const pal_block_matrix *a, bool at_rest, double step_s)
{
    if (warp->wait > 0 || warp->pause > 0 || pal_cholesky_refresh(warp->factor, a)) return false;
    copy_turns(warp, warp->next);
    if (at_rest) set_rest(warp->next, warp->n_dof);
    double steps = ceil(pal_cholesky_flops(warp->factor) / (slow_flops * step_s));
    warp->wait = steps < 1 ? 1 : steps > 1000 ? 1000 : (int)steps;
    return true;
}

void pal_warp_step(pal_warp *warp)
{
    if (warp->pause > 0) warp->pause--;
    if (warp->wait == 0 || --warp->wait > 0) return;
    warp->pause = PAUSE_STEPS;
    if (pal_cholesky_adopt(warp->factor, true)) return;
    memcpy(warp->base, warp->next, 4 * sizeof(double) * (size_t)warp->n_dof);
    warp->n_factor++;
    warp->refreshed = true;
}

void pal_warp_rotate(pal_warp *warp, const pal_node_rotations *turns)
{
    warp->turned = turns->any;
    for (int i = 0; i < warp->n_dof && turns->any; i++) {
        /* quat times the conjugate of base */
        const double *a = turns->quat + 4 * i, *b = warp->base + 4 * i;
        const double q[4] = {a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3],
                             -a[0] * b[1] + a[1] * b[0] - a[2] * b[3] + a[3] * b[2],
                             -a[0] * b[2] + a[1] * b[3] + a[2] * b[0] - a[3] * b[1],
                             -a[0] * b[3] - a[1] * b[2] + a[2] * b[1] + a[3] * b[0]};
        pal_quat_matrix(q, warp->w + 9 * i);
    }
}

void pal_warp_solve(pal_warp *warp, const double *r, double *z)
{
    if (!warp->turned) {
        (void)pal_cholesky_solve(warp->factor, r, z);
        return;
    }
    for (int i = 0; i < warp->n_dof; i++) pal_tmul33(warp->work + 3 * i, warp->w + 9 * i, r + 3 * i);
    (void)pal_cholesky_solve(warp->factor, warp->work, warp->work);
    for (int i = 0; i < warp->n_dof; i++) pal_mul33(z + 3 * i, warp->w + 9 * i, warp->work + 3 * i);
}
