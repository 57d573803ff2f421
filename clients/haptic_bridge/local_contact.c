#include "clients/haptic_bridge/local_contact.h"
#include "server/base/vec3.h"

#define EXTRAPOLATE_MAX_S 0.05
#define HYSTERESIS_M      1e-4

/* depth of x under a patch's plane, and the tangential distance from its point */
static double patch_depth(const pal_wire_haptic *model, const pal_wire_contact_patch *patch, double age_s,
                          const double x[3], double *across)
{
    double away[3], depth = 0, square = 0;
    for (int k = 0; k < 3; k++) {
        away[k] = model->origin_m[k] + (double)patch->p_m[k] + (double)patch->v_m_s[k] * age_s - x[k];
        depth += (double)patch->n[k] * away[k];
    }
    for (int k = 0; k < 3; k++) {
        const double side = away[k] - depth * (double)patch->n[k];
        square += side * side;
    }
    *across = sqrt(square);
    return depth;
}

static bool patch_was_active(const pal_local_contact_state *memory, const pal_wire_contact_patch *patch)
{
    for (int i = 0; i < memory->n_active; i++)
        if (memory->active[i].group == patch->group && memory->active[i].id == patch->id) return true;
    return false;
}

/* the acting patch of the group that patch `first` opens: least depth, with hysteresis; NULL when one is not reached */
static const pal_wire_contact_patch *patch_of_group(const pal_wire_haptic *model, uint32_t first, double age_s,
                                                    const double x[3], const pal_local_contact_state *memory)
{
    const pal_wire_contact_patch *best = NULL;
    double min = INFINITY, across;
    for (uint32_t i = first; i < model->n_patch; i++) {
        const pal_wire_contact_patch *patch = &model->patch[i];
        if (patch->group != model->patch[first].group) continue;
        const double depth = patch_depth(model, patch, age_s, x, &across);
        if (!(depth > 0)) return NULL;
        const double ranked = depth - (patch_was_active(memory, patch) ? HYSTERESIS_M : 0);
        if (ranked < min) min = ranked, best = patch;
    }
    return best;
}

/* elastic force at depth d with the tangent kept at or below k_max; *slope is the tangent there */
static double patch_elastic(double k1, double k2, double d, double k_max, double *slope, bool *clamped)
{
    *slope = k1 + 2 * k2 * d;
    if (!isfinite(*slope)) return NAN;
    if (*slope <= k_max) return k1 * d + k2 * d * d;
    *clamped = true;
    *slope = k_max;
    if (k1 >= k_max || k2 <= 0) return k_max * d;
    const double d0 = (k_max - k1) / (2 * k2);
    return k1 * d0 + k2 * d0 * d0 + k_max * (d - d0);
}

static double smooth_fall(double low, double high, double at)
{
    if (!(high > low) || at <= low) return 1;
    const double t = (at - low) / (high - low);
    return t >= 1 ? 0 : 1 - t * t * (3 - 2 * t);
}

void pal_local_contact_force(const pal_wire_haptic *model, double age_s, const double x_m[3], const double v_m_s[3],
                             const pal_local_contact_limits *limits, pal_local_contact_state *memory,
                             pal_local_contact_result *out)
{
    const double age = fmin(fmax(age_s, 0), EXTRAPOLATE_MAX_S);
    pal_local_contact_state now = {0};
    *out = (pal_local_contact_result){.finite = pal_finite3(x_m) && pal_finite3(v_m_s)};
    for (uint32_t i = 0; i < model->n_patch; i++) {
        bool seen = false;
        for (uint32_t j = 0; j < i; j++) seen = seen || model->patch[j].group == model->patch[i].group;
        const pal_wire_contact_patch *patch = seen ? NULL : patch_of_group(model, i, age, x_m, memory);
        if (!patch) continue;
        double across, slope, approach = 0;
        const double depth = patch_depth(model, patch, age, x_m, &across), r = (double)patch->radius_m;
        const double elastic = patch_elastic((double)patch->k1_N_m, (double)patch->k2_N_m2, depth,
                                             limits->stiffness_max_N_m, &slope, &out->clamped);
        const double floor_b = fmin(limits->damping_max_Ns_m, limits->damping_floor_s * slope);
        const double damping = fmin(fmax((double)patch->b_N_s_m, floor_b), limits->damping_max_Ns_m);
        for (int k = 0; k < 3; k++) approach += (double)patch->n[k] * (v_m_s[k] - (double)patch->v_m_s[k]);
        double force = elastic - damping * approach;
        if (!isfinite(force)) out->finite = false;
        force = fmax(0, force);
        if (r > 0) force *= smooth_fall(r, 1.5 * r, across);
        for (int k = 0; k < 3; k++) out->force_N[k] += force * (double)patch->n[k];
        now.active[now.n_active].group = patch->group;
        now.active[now.n_active++].id = patch->id;
        out->n_contact++;
        if (depth > out->depth_m) out->depth_m = depth;
    }
    *memory = now;
    out->finite = out->finite && pal_finite3(out->force_N);
    if (!out->finite) pal_set3(out->force_N, 0, 0, 0);
}
