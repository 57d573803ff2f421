/* Component tet_volume: every tetrahedron keeps its signed volume, so that an inverted one recovers. C = (V -
 * V0)/V0, E = k/2 C^2, f_a = -(k C + c C') dV/dx_a / V0 (paper B section 4.1, F_V).
 *
 * Departures: errata B3, B4 (true gradients, area/3 each, not unit directions; 1/V0^2; V0 is the rest volume, signed
 * by the order of the corners). A tetrahedron with V0 below 1e-6 h^3 is omitted, and so is a sliver with less than
 * 0.01 of the volume of a regular one with its edges: its negligible volume would set the sub-step of the whole
 * body, and it would invert at any contact. The edges of omitted tetrahedra stay; a preflight check counts and names
 * them. The component runs the body's recovery from inversion: forces and energy of regions belong to it
 * (spring_lattice.h). */

#include "server/sim/effects/spring_effect.h"

#include <stdlib.h>

#include <string.h>

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    PAL_TRY(pal_spring_set_check(item, build));
    const pal_tets *tets = build->body->tets;
    pal_spring_set *set = PAL_NEW(build->arena, pal_spring_set, 1);
    int32_t *tet = malloc(4 * sizeof *tet * ((size_t)tets->n_tet + 1));
    int n = 0;
    for (int t = 0; t < tets->n_tet && set && tet; t++) {
        const double *x[PAL_CORNERS];
        for (int c = 0; c < 4; c++) x[c] = build->body->x_rest + 3 * (size_t)tets->tet[4 * t + c];
        if (pal_spring_tet_quality(x) < PAL_SPRING_SLIVER) continue;
        memcpy(tet + 4 * (size_t)n++, tets->tet + 4 * (size_t)t, 4 * sizeof *tet);
    }
    double h = build->body->edge_m;
    pal_err err = set && tet ? pal_spring_set_make(PAL_SPRING_VOLUME, item, build, tet, n, 6e-6 * h * h * h, set)
                             : PAL_ERR_MEMORY;
    free(tet);
    *self = set;
    return err ? err : pal_spring_lattice_join(set, build);
}

PAL_INLINE void kernel(const double *p[][3], pal_wide w, pal_wide kq, pal_wide f[][3], pal_wide *min)
{
    (void)min;
    pal_wide x = pal_wide_load(p[0][0]), y = pal_wide_load(p[0][1]), z = pal_wide_load(p[0][2]);
    pal_wide ax = pal_wide_load(p[1][0]) - x, ay = pal_wide_load(p[1][1]) - y, az = pal_wide_load(p[1][2]) - z;
    pal_wide bx = pal_wide_load(p[2][0]) - x, by = pal_wide_load(p[2][1]) - y, bz = pal_wide_load(p[2][2]) - z;
    pal_wide cx = pal_wide_load(p[3][0]) - x, cy = pal_wide_load(p[3][1]) - y, cz = pal_wide_load(p[3][2]) - z;
    pal_wide gx = by * cz - bz * cy, gy = bz * cx - bx * cz, gz = bx * cy - by * cx;
    pal_wide t = kq * w * (1 - (ax * gx + ay * gy + az * gz) * w);
    f[0][0] = t * gx, f[0][1] = t * gy, f[0][2] = t * gz;
    f[1][0] = t * (cy * az - cz * ay), f[1][1] = t * (cz * ax - cx * az), f[1][2] = t * (cx * ay - cy * ax);
    f[2][0] = t * (ay * bz - az * by), f[2][1] = t * (az * bx - ax * bz), f[2][2] = t * (ax * by - ay * bx);
}

/* |g_a| = 2 |w| (area opposite); the second derivative of V has row sums |C w| (perimeter of the face opposite) */
PAL_INLINE void bound_kernel(const double *p[][3], pal_wide w, pal_wide kq, bool bend, pal_wide bound[])
{
    pal_wide e[3][3], f[2][3], zero = w - w, size[4], length[6];
    for (int c = 0; c < 3; c++)
        for (int d = 0; d < 3; d++) e[c][d] = pal_wide_load(p[c + 1][d]) - pal_wide_load(p[0][d]);
    for (int c = 0; c < 2; c++)
        for (int d = 0; d < 3; d++) f[c][d] = e[c + 1][d] - e[0][d];
    size[0] = pal_wide_cross_length(f[0], f[1]);
    for (int c = 0; c < 3; c++) size[c + 1] = pal_wide_cross_length(e[(c + 1) % 3], e[(c + 2) % 3]);
    pal_wide sum = kq * w * w * (size[0] + size[1] + size[2] + size[3]);
    for (int c = 0; c < 4; c++) bound[c] = sum * size[c];
    if (!bend) return;
    pal_wide g[3] = {e[1][1] * e[2][2] - e[1][2] * e[2][1], e[1][2] * e[2][0] - e[1][0] * e[2][2],
                     e[1][0] * e[2][1] - e[1][1] * e[2][0]};
    pal_wide c = ((e[0][0] * g[0] + e[0][1] * g[1] + e[0][2] * g[2]) * w - 1) * w, third[3];
    c = kq * pal_wide_select(c < 0, zero - c, c);
    /* edges 01 02 03 12 13 23 */
    for (int k = 0; k < 3; k++) length[k] = pal_wide_length(e[k]), third[k] = e[2][k] - e[1][k];
    length[3] = pal_wide_length(f[0]), length[4] = pal_wide_length(f[1]), length[5] = pal_wide_length(third);
    bound[0] += c * (length[3] + length[4] + length[5]);
    bound[1] += c * (length[1] + length[2] + length[5]);
    bound[2] += c * (length[0] + length[2] + length[4]);
    bound[3] += c * (length[0] + length[1] + length[3]);
}

PAL_SPRING_MEMBERS(PAL_SPRING_VOLUME, 4)

static pal_recovery *recovery(void *self)
{
    return ((pal_spring_set *)self)->recovery;
}

static pal_err run(void *self, pal_step *step)
{
    PAL_TRY(spring_run(self, step));
    pal_recovery_add_forces(recovery(self), step->body);
    pal_recovery_damp(recovery(self), step->body);
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    return spring_energy(self, body) + pal_recovery_energy(recovery(self), body->d, NULL);
}

static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    spring_stiffness(self, body, bound_N_m);
    pal_recovery_bound(recovery(self), bound_N_m);
}

static void damping(void *self, const pal_body *body, double *bound_Ns_m)
{
    spring_damping(self, body, bound_Ns_m);
    pal_recovery_damping_bound(recovery(self), body, bound_Ns_m);
}

/* Without edges there is nothing that a region could have in the place of springs. These have derivatives however flat
 * a tetrahedron is, so while there are regions what else is inverted waits for the next step */
static unsigned recover(void *self, pal_step *step)
{
    const pal_spring_lattice *l = ((const pal_spring_set *)self)->lattice;
    if (!l || !l->of[PAL_SPRING_DISTANCE]) return 0;
    if (step->sub > 0 && pal_recovery_acts(l->recovery)) return PAL_INVERTED;
    return pal_recovery_update(l->recovery, step);
}

/* a body under recovery does not sleep, however slow it is */
static double settled_s(const void *self)
{
    return pal_recovery_acts(((const pal_spring_set *)self)->recovery) ? INFINITY : 0;
}

static void reset(void *self, const pal_body *body)
{
    (void)body;
    if (recovery(self)) pal_recovery_reset(recovery(self));
}

/* without volumes: those of edge_distance count */
static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    (void)volume_m3;
    if (field == PAL_FIELD_ENERGY_J_M3) pal_spring_measure_energy(self, body, PAL_SPRING_VOLUME, sum);
}

const pal_effect pal_effect_tet_volume = {PAL_EFFECT("tet_volume", FORCE),
                                          .destroy = spring_destroy,
                                          .reset = reset,
                                          .internal = true,
                                          .energy = energy,
                                          .sleep.settled_s = settled_s,
                                          .bounds = {.stiffness = stiffness, .damping = damping},
                                          .recovery = {.recover = recover, .state = recovery},
                                          .material = pal_spring_set_material,
                                          .inspect = {.measure = measure}};
