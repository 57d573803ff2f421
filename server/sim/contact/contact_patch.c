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

/* the free or matching track of a blob */
static pal_contact_patch_track *find_track(pal_contact_patches *patches, const bool *taken,
                                           const pal_contact_group *group)
{
    int best = -1;
    double best_cosine = SAME_COSINE;
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX; i++) {
        if (taken[i] || !patches->track[i].used) continue;
        double cosine = pal_dot3(patches->track[i].normal, group->normal);
        if (cosine > best_cosine) best_cosine = cosine, best = i;
    }
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX && best < 0; i++)
        if (!taken[i] && !patches->track[i].used) best = i;
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX && best < 0; i++)
        if (!taken[i]) {
            patches->track[i].used = false;
            best = i;
        }
    return best < 0 ? NULL : &patches->track[best];
}

static void add_sample(pal_contact_patch_track *track, double depth_m, double force_N, double prior_m)
{
    pal_stiffness_fit_add(&track->fit, (double[3]){depth_m}, (double[3]){force_N}, prior_m);
}

/* depth goes on from the step before by the tool's move; a gap is known exactly */
static void follow(pal_contact_patch_track *track, const pal_contact_patch_options *options,
                   const pal_contact_group *group, const double move[3], bool moved)
{
    double prior = FIT_PRIOR_RADII * options->radius_m, k = group->k_N_m;
    bool touches = group->force_N > 0;
    if (!touches) {
        track->depth_m = -group->gap_m;
        if (k > 0) track->fit.k_N_m = fmin(fmax(k, MIN_STIFFNESS_N_M), MAX_STIFFNESS_N_M);
        if (track->contact || k > 0) track->fit.k_start_N_m = track->fit.k_N_m;
    } else if (!track->contact) {
        /* first touch: the way since the gap was measured, or what the start stiffness makes of the force */
        double depth = moved && track->depth_m < 0 ? track->depth_m - pal_dot3(move, group->normal) : 0;
        if (!(depth > 0)) depth = group->force_N / track->fit.k_start_N_m;
        pal_stiffness_fit_start(&track->fit, track->fit.k_start_N_m);
        add_sample(track, 0, 0, prior);
        track->depth_m = depth;
    } else {
        track->depth_m -= pal_dot3(move, group->normal);
    }
    if (touches) {
        add_sample(track, track->depth_m, group->force_N, prior);
        double secant = group->force_N / track->depth_m;
        if (!(k > 0)) k = track->fit.k_N_m;
        if (!(group->k_N_m > 0) && track->depth_m > SECANT_RADII * options->radius_m)
            k = fmin(fmax(k, MIN_SECANT * secant), MAX_SECANT * secant);
        track->fit.k_N_m = fmin(fmax(k, MIN_STIFFNESS_N_M), MAX_STIFFNESS_N_M);
    }
    track->contact = touches;
    pal_copy3(track->normal, group->normal);
}

/* the plane of zero force; low-passed while the tool rests */
static void show(pal_contact_patch_track *track, const pal_contact_patch_options *options,
                 const pal_contact_group *group, const pal_tool *tool, bool fresh, bool rests)
{
    double k = track->fit.k_N_m, share = rests && !fresh ? REST_LOW_PASS : 1, normal[3], point[3];
    double height = group->force_N > 0 ? group->force_N / k : -group->gap_m;
    for (int c = 0; c < 3; c++) {
        point[c] = tool->here_m[c] + height * group->normal[c];
        normal[c] = fresh ? group->normal[c] : track->shown.normal[c];
        normal[c] += share * (group->normal[c] - normal[c]);
        track->shown.point_m[c] =
            fresh ? point[c] : track->shown.point_m[c] + share * (point[c] - track->shown.point_m[c]);
    }
    if (!pal_unit3(track->shown.normal, normal, 1e-6)) pal_copy3(track->shown.normal, group->normal);
    track->shown.k1_N_m = fresh ? k : track->shown.k1_N_m + share * (k - track->shown.k1_N_m);
    track->shown.k2_N_m2 = 0;
    track->shown.id = track->shown.group = track->id;
    track->shown.b_Ns_m = options->b_s * track->shown.k1_N_m;
    track->shown.kt_N_m = options->friction > 0 ? SIDEWAYS_STIFFNESS * track->shown.k1_N_m : 0;
    track->shown.mu_static = track->shown.mu_dynamic = options->friction;
    track->shown.radius_m = options->radius_m;
    pal_set3(track->shown.velocity_m_s, 0, 0, 0);
}

void pal_contact_patches_update(pal_contact_patches *patches, const pal_contact_patch_options *options,
                                const pal_contact_group *group, int n, pal_tool *tool)
{
    bool taken[PAL_CONTACT_PATCH_MAX] = {false};
    double move[3] = {0};
    if (patches->known) pal_sub3(move, tool->here_m, patches->last_m);
    bool rests = patches->known && pal_norm3(move) < REST_MOVE_M;
    for (int i = 0; i < n; i++) {
        pal_contact_patch_track *track = find_track(patches, taken, &group[i]);
        if (!track) break;
        bool fresh = !track->used;
        if (fresh) {
            memset(track, 0, sizeof *track);
            patches->next_id = (int16_t)(patches->next_id % 1023 + 1);
            track->id = (int16_t)(patches->id_base + patches->next_id);
            track->used = true;
            pal_stiffness_fit_start(&track->fit, options->k_start_N_m);
        }
        taken[track - patches->track] = true;
        follow(track, options, &group[i], move, patches->known);
        show(track, options, &group[i], tool, fresh, rests);
        if (tool->n_patch < PAL_CONTACT_PATCH_MAX) tool->patch[tool->n_patch++] = track->shown;
    }
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX; i++)
        if (!taken[i]) patches->track[i].used = false;
    pal_copy3(patches->last_m, tool->here_m);
    patches->known = true;
}
