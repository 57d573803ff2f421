/* Rotations of dofs. */
#include "server/sim/implicit/warp.h"

#include "server/base/team.h"
#include "server/base/vec3.h"
#include "server/sim/core/simd_wide.h"

#include <float.h>
#include <string.h>

/* dofs of a piece of work of a thread, a multiple of PAL_WIDE: some ten microseconds */
enum { DOFS = 512 };

void pal_warp_rest(float *quat, int n_dof)
{
    for (int i = 0; i < 4 * n_dof; i++) quat[i] = i % 4 == 0;
}

void pal_warp_keep(const pal_node_rotations *rotations, float *quat)
{
    for (int i = 0; i < 4 * rotations->n_dof; i++) quat[i] = (float)rotations->quat[i];
}

pal_err pal_node_rotations_make(const pal_system *system, double *work, pal_arena *arena, pal_node_rotations *out)
{
    int n = system->body->n_dof;
    *out = (pal_node_rotations){.n_dof = n, .any = system->has_rotation};
    out->quat = PAL_NEW(arena, double, 4 * (size_t)n);
    out->sum = work ? work : PAL_NEW(arena, double, system->has_rotation ? 9 * (size_t)n : 0);
    if (!out->quat || !out->sum) return PAL_ERR_MEMORY;
    pal_node_rotations_reset(out);
    return PAL_ERR_OK;
}

void pal_node_rotations_reset(pal_node_rotations *rotations)
{
    for (int i = 0; i < 4 * rotations->n_dof; i++) rotations->quat[i] = i % 4 == 0;
}

/* a piece of the dofs */
static void rotate_dofs(void *user, int worker, int index)
{
    const pal_node_rotations *rotations = user;
    const int begin = index * DOFS, end = begin + DOFS < rotations->n_dof ? begin + DOFS : rotations->n_dof;
    (void)worker;
    for (int first = begin; first < end; first += PAL_WIDE) {
        pal_wide f[9], q[4], r[9], m[9];
        pal_wide_mask live;
        for (int l = 0; l < PAL_WIDE; l++) {
            const int i = first + l < end ? first + l : first;
            double size = 0;
            for (int k = 0; k < 9; k++) f[k][l] = rotations->sum[9 * i + k], size += fabs(f[k][l]);
            for (int k = 0; k < 4; k++) q[k][l] = rotations->quat[4 * i + k];
            live[l] = size > DBL_MIN && size < DBL_MAX ? -1 : 0; /* nodes that no element turns stay */
        }
        pal_wide_polar(f, live, q, r, m);
        for (int l = 0; l < PAL_WIDE && first + l < end; l++)
            for (int k = 0; k < 4 && live[l]; k++) rotations->quat[4 * (first + l) + k] = q[k][l];
    }
}

void pal_node_rotations_update(pal_node_rotations *rotations, const pal_system *system)
{
    if (!rotations->any) return;
    pal_system_rotate(system, rotations->sum);
    pal_team_run(system->body->team, (rotations->n_dof + DOFS - 1) / DOFS, rotate_dofs, rotations);
}

pal_err pal_warp_make(const pal_node_rotations *rotations, pal_arena *arena, pal_warp *out)
{
    size_t n = (size_t)rotations->n_dof;
    *out = (pal_warp){.n_dof = rotations->n_dof};
    out->w = PAL_NEW(arena, float, 9 * n), out->base = PAL_NEW(arena, float, 4 * n);
    if (!out->w || !out->base) return PAL_ERR_MEMORY;
    pal_warp_rest(out->base, out->n_dof);
    return PAL_ERR_OK;
}

typedef struct warp_pass {
    pal_warp *warp;
    const pal_node_rotations *rotations;
} warp_pass;

static void warp_dofs(void *user, int worker, int index)
{
    const warp_pass *pass = user;
    pal_warp *warp = pass->warp;
    const int first = index * DOFS, end = first + DOFS < warp->n_dof ? first + DOFS : warp->n_dof;
    (void)worker;
    for (int i = first; i < end; i++) {
        /* quat times the conjugate of base */
        const double *a = pass->rotations->quat + 4 * i;
        double b[4];
        for (int k = 0; k < 4; k++) b[k] = (double)warp->base[4 * i + k];
        const double q[4] = {a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3],
                             -a[0] * b[1] + a[1] * b[0] - a[2] * b[3] + a[3] * b[2],
                             -a[0] * b[2] + a[1] * b[3] + a[2] * b[0] - a[3] * b[1],
                             -a[0] * b[3] - a[1] * b[2] + a[2] * b[1] + a[3] * b[0]};
        double w[9];
        pal_quat_matrix(q, w);
        for (int k = 0; k < 9; k++) warp->w[9 * i + k] = (float)w[k];
    }
}

void pal_warp_rotate(pal_warp *warp, const pal_node_rotations *rotations, pal_team *team)
{
    warp->rotated = rotations->any;
    if (rotations->any) pal_team_run(team, (warp->n_dof + DOFS - 1) / DOFS, warp_dofs, &(warp_pass){warp, rotations});
}

/* to = W v, or W' v; to may be v */
static void turn(const float w[9], const double v[3], bool back, double to[3])
{
    double r[9];
    for (int k = 0; k < 9; k++) r[k] = (double)(back ? w[k % 3 * 3 + k / 3] : w[k]);
    const double x = v[0], y = v[1], z = v[2];
    for (int c = 0; c < 3; c++) to[c] = r[3 * c] * x + r[3 * c + 1] * y + r[3 * c + 2] * z;
}

void pal_warp_back(const pal_warp *warp, const double *r, double *out)
{
    for (int i = 0; i < warp->n_dof; i++) turn(warp->w + 9 * i, r + 3 * i, true, out + 3 * i);
}

void pal_warp_forth(const pal_warp *warp, double *z)
{
    for (int i = 0; i < warp->n_dof; i++) turn(warp->w + 9 * i, z + 3 * i, false, z + 3 * i);
}
