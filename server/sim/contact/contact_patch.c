/* Haptic contact patches: matching, tangent stiffness, zero-force planes. */
#include "server/sim/contact/contact_patch.h"

#include "server/base/vec3.h"

#include <string.h>

/* haptics.md 2.3: samples 0.05 mm apart, low-pass of one frame while the tool moves less than 0.2 mm */
#define FORGET       0.8
#define LEAST_MOVE_M 0.05e-3
#define REST_MOVE_M  0.2e-3
#define LOW_PASS     0.63212055882855767 /* 1 - 1/e */
/* a patch is the same one while its normal turns by less than 45 degrees from step to step */
#define SAME_COSINE 0.70710678118654752
/* the tangent stays within these multiples of the secant F/d, so that a reversal does not look like a soft wall */
#define LEAST_SECANT 0.5
#define MOST_SECANT  6.0

void pal_slope_fit_start(pal_slope_fit *slope, double k_N_m)
{
    *slope = (pal_slope_fit){.last_depth_m = INFINITY, .k_N_m = k_N_m};
}

void pal_slope_fit_add(pal_slope_fit *slope, double d_m, double f_N, double prior_m, double k_start_N_m)
{
    if (fabs(d_m - slope->last_depth_m) < LEAST_MOVE_M) return;
    slope->last_depth_m = d_m;
    slope->n = FORGET * slope->n + 1;
    slope->d = FORGET * slope->d + d_m;
    slope->f = FORGET * slope->f + f_N;
    slope->dd = FORGET * slope->dd + d_m * d_m;
    slope->df = FORGET * slope->df + d_m * f_N;
    double vary = slope->dd - slope->d * slope->d / slope->n, with = slope->df - slope->d * slope->f / slope->n;
    slope->k_N_m = (with + k_start_N_m * prior_m * prior_m) / (vary + prior_m * prior_m);
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
        pal_slope_fit_start(&track->slope, track->k_prior_N_m);
        pal_slope_fit_add(&track->slope, 0, 0, prior, track->k_prior_N_m);
        track->depth_m = depth;
    } else {
        track->depth_m -= pal_dot3(move, contact_group->normal);
    }
    if (touches) {
        pal_slope_fit_add(&track->slope, track->depth_m, contact_group->force_N, prior, track->k_prior_N_m);
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
            pal_slope_fit_start(&track->slope, rules->k_start_N_m);
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

bool pal_contact_patch_series(double give[3][3], int n_give, double k_N_m, double K[6])
{
    double c[3][3], minor[3][3];
    if (n_give == 0 || !(k_N_m > 0)) return false;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            c[i][j] = i < n_give && j < n_give ? 0.5 * (give[i][j] + give[j][i]) : 0;
            if (i == j) c[i][j] = (i < n_give ? c[i][i] : give[0][0]) + 1 / k_N_m;
        }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int a = (i + 1) % 3, b = (i + 2) % 3, p = (j + 1) % 3, q = (j + 2) % 3;
            minor[i][j] = c[a][p] * c[b][q] - c[a][q] * c[b][p];
        }
    double det = pal_dot3(c[0], minor[0]);
    if (!(det > 0) || !(c[0][0] > 0) || !(minor[2][2] > 0)) return false;
    const int place[6][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}};
    for (int i = 0; i < 6; i++) K[i] = minor[place[i][0]][place[i][1]] / det;
    return isfinite(det);
}

double pal_contact_patch_along(double give[3][3], int n_give, double k_N_m, double k_guess_N_m, const double way[3])
{
    double give_m_N = 0;
    if (n_give < 3) return k_guess_N_m;
    for (int c = 0; c < 3; c++) give_m_N += way[c] * pal_dot3(give[c], way) / pal_dot3(way, way);
    return k_N_m / (1 + k_N_m * fmax(0, give_m_N));
}
