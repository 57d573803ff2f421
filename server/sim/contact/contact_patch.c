/* Haptic contact patches: matching, tangent stiffness, zero-force planes. */
#include "server/sim/contact/contact_patch.h"

#include "server/base/vec3.h"

#include <string.h>

/* what a sample weighs when the next one comes: 0.9 would lag a millimetre behind where tissue stiffens */
#define KEEP 0.8
/* m. While a tool moves by less in a step, what is published is low-passed over one frame */
#define REST_MOVE_M 0.2e-3
#define LOW_PASS    0.63212055882855767 /* 1 - 1/e */
/* a patch is the same one while its normal turns by less than 45 degrees from step to step */
#define SAME_COSINE 0.70710678118654752
/* the tangent stays within these multiples of the secant F/d, so that a reversal does not look like a soft wall */
#define LEAST_SECANT 0.5
#define MOST_SECANT  6.0

static void add_sample(pal_stiffness_fit *fit, double depth_m, double force_N, double prior_m, double k_start_N_m)
{
    pal_stiffness_fit_add(fit, (const double[]){depth_m, 0, 0}, (const double[]){force_N, 0, 0}, KEEP, prior_m,
                          k_start_N_m);
}

void pal_contact_patches_reset(pal_contact_patches *patches, int id_base)
{
    memset(patches, 0, sizeof *patches);
    patches->id_base = (int16_t)id_base;
}

/* the free or matching track of a blob */
static pal_contact_patch_track *find_track(pal_contact_patches *patches, const bool *taken,
                                           const pal_contact_group *contact_group)
{
    int best = -1;
    double best_cosine = SAME_COSINE;
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX; i++) {
        if (taken[i] || !patches->track[i].used) continue;
        double cosine = pal_dot3(patches->track[i].normal, contact_group->normal);
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

/* depth goes on from the step before by the tool's move; a gap is known exactly */
static void follow(pal_contact_patch_track *track, const pal_contact_patch_options *rules,
                   const pal_contact_group *contact_group, const double move[3], bool moved)
{
    double prior = 0.01 * rules->radius_m;
    bool touches = contact_group->force_N > 0;
    if (!touches) {
        track->depth_m = -contact_group->gap_m;
        if (contact_group->k_N_m > 0)
            track->slope.k_N_m = fmin(fmax(contact_group->k_N_m, rules->k_min_N_m), rules->k_max_N_m);
        if (track->contact || contact_group->k_N_m > 0) track->k_prior_N_m = track->slope.k_N_m;
    } else if (!track->contact) {
        /* first touch: the way since the gap was measured, or what the start stiffness makes of the force */
        double depth = moved && track->depth_m < 0 ? track->depth_m - pal_dot3(move, contact_group->normal) : 0;
        if (!(depth > 0)) depth = contact_group->force_N / track->k_prior_N_m;
        pal_stiffness_fit_start(&track->slope, track->k_prior_N_m);
        add_sample(&track->slope, 0, 0, prior, track->k_prior_N_m);
        track->depth_m = depth;
    } else {
        track->depth_m -= pal_dot3(move, contact_group->normal);
    }
    if (touches) {
        add_sample(&track->slope, track->depth_m, contact_group->force_N, prior, track->k_prior_N_m);
        double k = track->slope.k_N_m;
        if (track->depth_m > 0.05 * rules->radius_m) {
            double secant = contact_group->force_N / track->depth_m;
            k = fmin(fmax(k, LEAST_SECANT * secant), MOST_SECANT * secant);
        }
        if (contact_group->k_N_m > 0) k = contact_group->k_N_m;
        track->slope.k_N_m = fmin(fmax(k, rules->k_min_N_m), rules->k_max_N_m);
    }
    track->contact = touches;
    pal_copy3(track->normal, contact_group->normal);
}

/* the plane of zero force; low-passed while the tool rests */
static void show(pal_contact_patch_track *track, const pal_contact_patch_options *rules,
                 const pal_contact_group *contact_group, const pal_tool *tool, bool fresh, bool rests)
{
    double k = track->slope.k_N_m, share = rests && !fresh ? LOW_PASS : 1, normal[3], point[3];
    double height = contact_group->force_N > 0 ? contact_group->force_N / k : -contact_group->gap_m;
    for (int c = 0; c < 3; c++) {
        point[c] = tool->here_m[c] + height * contact_group->normal[c];
        normal[c] = fresh ? contact_group->normal[c] : track->shown.normal[c];
        normal[c] += share * (contact_group->normal[c] - normal[c]);
        track->shown.point_m[c] =
            fresh ? point[c] : track->shown.point_m[c] + share * (point[c] - track->shown.point_m[c]);
    }
    if (!pal_unit3(track->shown.normal, normal, 1e-6)) pal_copy3(track->shown.normal, contact_group->normal);
    track->shown.k1_N_m = fresh ? k : track->shown.k1_N_m + share * (k - track->shown.k1_N_m);
    track->shown.k2_N_m2 = 0;
    track->shown.id = track->shown.group = track->id;
    track->shown.b_Ns_m = rules->b_s * track->shown.k1_N_m;
    /* a flat punch moved sideways: k_t/k = 2(1-nu)/(2-nu), 0.71 at nu 0.45 */
    track->shown.kt_N_m = rules->friction > 0 ? 0.71 * track->shown.k1_N_m : 0;
    track->shown.mu_static = track->shown.mu_dynamic = rules->friction;
    track->shown.radius_m = rules->radius_m;
    pal_set3(track->shown.velocity_m_s, 0, 0, 0);
}

void pal_contact_patches_update(pal_contact_patches *patches, const pal_contact_patch_options *rules,
                                const pal_contact_group *contact_group, int n, pal_tool *tool)
{
    bool taken[PAL_CONTACT_PATCH_MAX] = {false};
    double move[3] = {0};
    if (patches->known) pal_sub3(move, tool->here_m, patches->last_m);
    bool rests = patches->known && pal_norm3(move) < REST_MOVE_M;
    for (int i = 0; i < n; i++) {
        pal_contact_patch_track *track = find_track(patches, taken, &contact_group[i]);
        if (!track) break;
        bool fresh = !track->used;
        if (fresh) {
            memset(track, 0, sizeof *track);
            patches->next_id = (int16_t)(patches->next_id % 1023 + 1);
            track->id = (int16_t)(patches->id_base + patches->next_id);
            track->used = true;
            track->k_prior_N_m = rules->k_start_N_m;
            pal_stiffness_fit_start(&track->slope, rules->k_start_N_m);
        }
        taken[track - patches->track] = true;
        follow(track, rules, &contact_group[i], move, patches->known);
        show(track, rules, &contact_group[i], tool, fresh, rests);
        if (tool->n_patch < PAL_CONTACT_PATCH_MAX) tool->patch[tool->n_patch++] = track->shown;
    }
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX; i++)
        if (!taken[i]) patches->track[i].used = false;
    pal_copy3(patches->last_m, tool->here_m);
    patches->known = true;
}
