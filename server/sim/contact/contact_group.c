/* Contacts grouped by direction (contact_group.h). */
#include "server/sim/contact/contact_group.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"

void pal_contact_group_across(const double n[3], double t[2][3])
{
    int axis = fabs(n[0]) < fabs(n[1]) ? 0 : 1;
    if (fabs(n[2]) < fabs(n[axis])) axis = 2;
    double e[3] = {axis == 0, axis == 1, axis == 2};
    pal_cross3(t[0], n, e);
    pal_unit3(t[0], t[0], 0);
    pal_cross3(t[1], n, t[0]);
}

bool pal_contact_group_has(const double axis[3], const double direction[3])
{
    return pal_dot3(direction, axis) >= GROUP_COSINE;
}

bool pal_contact_group_next(const pal_contact *contact, int n, uint8_t *grouped, pal_contact_group *group)
{
    double axis[3], sum[3];
    int seed = -1;
    double max = 0;
    for (int i = 0; i < n; i++) {
        if (!grouped[i] && contact[i].normal_N > max) max = contact[i].normal_N, seed = i;
    }
    if (seed < 0) return false;
    pal_copy3(axis, contact[seed].away);
    for (int pass = 0; pass < 2; pass++) {
        pal_set3(sum, 0, 0, 0);
        for (int i = 0; i < n; i++)
            if (!grouped[i] && pal_contact_group_has(axis, contact[i].away))
                pal_axpy3(sum, contact[i].normal_N, contact[i].away);
        if (pass == 0 && !pal_unit3(axis, sum, 0)) break;
    }
    for (int i = 0; i < n; i++)
        if (pal_contact_group_has(axis, contact[i].away)) grouped[i] = 1;
    grouped[seed] = 1;
    group->force_N = pal_norm3(sum);
    group->gap_m = group->k_N_m = group->sideways = 0;
    pal_scale3(sum, -1, sum);
    return pal_unit3(group->normal, sum, 0);
}

bool pal_contact_group_near(const double centre[3], double radius_m, double near_m, const double *x, int n_point,
                            const pal_contact_group *earlier, int n_earlier, pal_contact_group *group)
{
    double nearest_m = INFINITY, sum[3] = {0};
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < n_point; i++) {
            double out[3];
            pal_sub3(out, centre, x + 3 * i);
            double distance = pal_norm3(out);
            if (distance > radius_m + near_m || (pass == 1 && distance > nearest_m + NEAREST_RADII * radius_m))
                continue;
            if (!pal_unit3(out, out, 1e-9 * radius_m)) continue;
            bool seen = false;
            for (int b = 0; b < n_earlier && !seen; b++)
                seen = pal_dot3(out, earlier[b].normal) >= (earlier[b].force_N > 0 ? 0 : GROUP_COSINE);
            if (!seen && pass == 0) nearest_m = fmin(nearest_m, distance);
            if (!seen && pass == 1) pal_axpy3(sum, nearest_m + NEAREST_RADII * radius_m - distance, out);
        }
    if (!(nearest_m < INFINITY)) return false;
    *group = (pal_contact_group){.gap_m = fmax(0, nearest_m - radius_m)};
    return pal_unit3(group->normal, sum, 0);
}
