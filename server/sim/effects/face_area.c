/* Component face_area: every triangle of the mesh, inner ones too, keeps its area. C = (A - A0)/A0, E = k/2 C^2,
 * f_a = -(k C + c C') n x (x_c - x_b)/(2 A0) and cyclic, n the unit normal (paper B section 4.1, F_A).
 *
 * Departures: errata B2, B3, B5 (true gradients: the paper's sign pushes away from A0 and its equal magnitudes create
 * momentum). Below 1e-9 of its rest area a triangle has no normal and its force fades to nothing. */
#include "server/sim/effects/spring_effect.h"

#include <stdlib.h>

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    pal_spring_set *set = PAL_NEW(build->arena, pal_spring_set, 1);
    int32_t *face;
    int n_face;
    PAL_TRY(pal_spring_set_check(item, build));
    if (!set) return PAL_ERR_MEMORY;
    PAL_TRY(pal_tets_faces(build->body->tets, &face, &n_face));
    double size = build->body->length_scale_m;
    pal_err err = pal_spring_set_make(PAL_SPRING_AREA, item, build, face, n_face, 2e-12 * size * size, set);
    free(face);
    *self = set;
    return err ? err : pal_spring_lattice_join(set, build);
}

/* with r = A/A0 = sqrt(q): C n/|n| = (r - 1)/r n w, and the gradients are crosses of n with the edges */
PAL_INLINE void kernel(const double *p[][3], pal_wide w, pal_wide kq, pal_wide f[][3], pal_wide *min)
{
    (void)min;
    const pal_wide floor = PAL_ROUNDING * PAL_ROUNDING - (pal_wide){0};
    pal_wide x = pal_wide_load(p[0][0]), y = pal_wide_load(p[0][1]), z = pal_wide_load(p[0][2]), w2 = w * w;
    pal_wide ax = pal_wide_load(p[1][0]) - x, ay = pal_wide_load(p[1][1]) - y, az = pal_wide_load(p[1][2]) - z;
    pal_wide bx = pal_wide_load(p[2][0]) - x, by = pal_wide_load(p[2][1]) - y, bz = pal_wide_load(p[2][2]) - z;
    pal_wide nx = ay * bz - az * by, ny = az * bx - ax * bz, nz = ax * by - ay * bx;
    pal_wide q = (nx * nx + ny * ny + nz * nz) * w2;
    pal_wide r = pal_wide_sqrt(pal_wide_select(q < floor, floor, q)), t = kq * w2 * ((1 - r) / r);
    nx *= t, ny *= t, nz *= t;
    f[0][0] = by * nz - bz * ny, f[0][1] = bz * nx - bx * nz, f[0][2] = bx * ny - by * nx;
    f[1][0] = ny * az - nz * ay, f[1][1] = nz * ax - nx * az, f[1][2] = nx * ay - ny * ax;
}

/* |g_a| = e_a w with e_a the edge opposite the corner, w = 1/(2 A0). The second derivative of A stiffens where C > 0:
 * row sums C w (e_a sum e_b/|n| + 2) at most */
PAL_INLINE void bound_kernel(const double *p[][3], pal_wide w, pal_wide kq, bool bend, pal_wide bound[])
{
    pal_wide e[3][3], length[3], along = kq * w * w, flat = w - w;
    for (int c = 0; c < 3; c++) {
        for (int d = 0; d < 3; d++) e[c][d] = pal_wide_load(p[(c + 2) % 3][d]) - pal_wide_load(p[(c + 1) % 3][d]);
        length[c] = pal_wide_length(e[c]);
    }
    if (bend) {
        pal_wide size = pal_wide_cross_length(e[0], e[1]), c = size * w - 1;
        pal_wide cw = kq * w * pal_wide_select(c > 0, c, flat);
        along += cw / pal_wide_select(c > 0, size, flat + 1);
        flat = 2 * cw;
    }
    pal_wide sum = length[0] + length[1] + length[2];
    for (int c = 0; c < 3; c++) bound[c] = along * length[c] * sum + flat;
}

PAL_SPRING_MEMBERS(PAL_SPRING_AREA, 3)

/* without volumes: those of edge_distance count */
static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    (void)volume_m3;
    if (field == PAL_FIELD_ENERGY_J_M3) pal_spring_measure_energy(self, body, PAL_SPRING_AREA, sum);
}

const pal_effect pal_effect_face_area = {.name = "face_area",
                                         .stage = PAL_STAGE_FORCE,
                                         .make = make,
                                         .run = spring_run,
                                         .destroy = spring_destroy,
                                         .internal = true,
                                         .energy = spring_energy,
                                         .bounds = {.stiffness = spring_stiffness, .damping = spring_damping},
                                         .material = pal_spring_set_material,
                                         .inspect = {.measure = measure}};
