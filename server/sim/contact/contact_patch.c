/* Haptic contact patches: matching, tangent stiffness, zero-force planes. */
#include "server/sim/contact/contact_patch.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"

#include <string.h>

void pal_contact_patches_reset(pal_contact_patches *patches, int id_base)
{
    memset(patches, 0, sizeof *patches);
    patches->id_base = (int16_t)id_base;
}

/* the matching or a free track of a group */
static pal_contact_patch_track *find_track(pal_contact_patches *patches, const bool *taken,
                                           const pal_contact_group *group)
{
    int best = -1;
    double best_cosine = PAL_SAME_COSINE;
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX; i++) {
        if (taken[i] || !patches->track[i].used) continue;
        double cosine = pal_dot3(patches->track[i].normal, group->normal);
        if (cosine > best_cosine) best_cosine = cosine, best = i;
    }
    if (best >= 0) return &patches->track[best];
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX; i++)
        if (!taken[i] && (best < 0 || (patches->track[best].used && !patches->track[i].used))) best = i;
    if (best >= 0) patches->track[best].used = false;
    return best < 0 ? NULL : &patches->track[best];
}

/* depth changes by the tool's move; a gap is known exactly */
static void follow(pal_contact_patch_track *track, const pal_contact_patch_options *options,
                   const pal_contact_group *group, const double move[3], bool moved)
{
    double k = group->k_N_m;
    bool touches = group->force_N > 0;
    if (!touches) {
        track->depth_m = -group->gap_m;
        if (k > 0) track->fit.k_N_m = pal_haptic_stiffness_clamp(k);
        if (track->contact || k > 0) track->fit.k_start_N_m = track->fit.k_N_m;
    } else if (!track->contact) {
        /* first touch: the displacement since the gap was measured, or the force over the start stiffness */
        double depth = moved && track->depth_m < 0 ? track->depth_m - pal_dot3(move, group->normal) : 0;
        if (!(depth > 0)) depth = group->force_N / track->fit.k_start_N_m;
        pal_stiffness_fit_start(&track->fit, track->fit.k_start_N_m);
        pal_stiffness_fit_add(&track->fit, (double[3]){0}, (double[3]){0}, options->radius_m);
        track->depth_m = depth;
    } else {
        track->depth_m -= pal_dot3(move, group->normal);
    }
    if (touches) {
        pal_stiffness_fit_add(&track->fit, (double[3]){track->depth_m}, (double[3]){group->force_N}, options->radius_m);
        track->fit.k_N_m = pal_haptic_stiffness_clamp(k > 0 ? k : track->fit.k_N_m);
    }
    /* an estimate found again moves the plane by the depth times its change: a tool at rest follows it slowly, one that
     * moves at once */
    const double part = exp(-options->step_s / FOLLOW_S - pal_norm3(move) / (SHALLOW_RADII * options->radius_m));
    if (touches != track->contact || !(track->k_N_m > 0)) track->k_N_m = track->fit.k_N_m;
    track->k_N_m = pal_haptic_stiffness_clamp(part * track->k_N_m + (1 - part) * track->fit.k_N_m);
    track->contact = touches;
    pal_copy3(track->normal, group->normal);
}

/* the plane of zero force */
static pal_contact_patch patch_of(const pal_contact_patch_track *track, const pal_contact_patch_options *options,
                                  const pal_contact_group *group, const pal_tool *tool)
{
    double k = track->k_N_m, height = group->force_N > 0 ? group->force_N / k : -group->gap_m;
    const double sideways = group->sideways > 0 ? group->sideways : options->sideways;
    pal_contact_patch patch = {.k1_N_m = k,
                               .id = track->id,
                               .group = track->id,
                               .b_Ns_m = options->b_s * k,
                               .kt_N_m = options->friction > 0 ? sideways * k : 0,
                               .mu_static = options->friction,
                               .mu_dynamic = options->friction,
                               .radius_m = options->radius_m};
    pal_copy3(patch.point_m, tool->here_m);
    pal_axpy3(patch.point_m, height, group->normal);
    pal_copy3(patch.normal, group->normal);
    return patch;
}

void pal_contact_patches_update(pal_contact_patches *patches, const pal_contact_patch_options *options,
                                const pal_contact_group *group, int n, pal_tool *tool)
{
    bool taken[PAL_CONTACT_PATCH_MAX] = {false};
    double move[3] = {0};
    if (patches->known) pal_sub3(move, tool->here_m, patches->last_m);
    for (int i = 0; i < n; i++) {
        pal_contact_patch_track *track = find_track(patches, taken, &group[i]);
        if (!track) break;
        if (!track->used) {
            memset(track, 0, sizeof *track);
            patches->next_id = (int16_t)(patches->next_id % 1023 + 1);
            track->id = (int16_t)(patches->id_base + patches->next_id);
            track->used = true;
            pal_stiffness_fit_start(&track->fit, options->k_start_N_m);
        }
        taken[track - patches->track] = true;
        follow(track, options, &group[i], move, patches->known);
        if (tool->n_patch < PAL_CONTACT_PATCH_MAX)
            tool->patch[tool->n_patch++] = patch_of(track, options, &group[i], tool);
    }
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX; i++)
        if (!taken[i]) patches->track[i].used = false;
    pal_copy3(patches->last_m, tool->here_m);
    patches->known = true;
}
