/* Grasps on adaptive surfaces (adaptive_grasp.h). */
#include "server/sim/surface/adaptive_grasp.h"

#include "server/base/vec3.h"
#include "server/sim/core/blend.h"
#include "server/sim/surface/adaptive_surface.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const int32_t *ends_of(const pal_adaptive_surface *s, int32_t vertex)
{
    return s->levels.edge[pal_levels_vertex_parent(&s->levels, vertex)].vertex;
}

static uint16_t mean_of(const pal_adaptive_surface *s, const uint16_t *share, int32_t vertex)
{
    const int32_t *end = ends_of(s, vertex);
    return (uint16_t)((share[end[0]] + share[end[1]] + 1) / 2);
}

void pal_adaptive_grasp_begin(pal_adaptive_grasp *l, const pal_body *body, const double quat[4], uint16_t *share)
{
    const pal_adaptive_surface *s = body->model.adaptive;
    const double back[4] = {quat[0], -quat[1], -quat[2], -quat[3]};
    pal_rigid_fit frame = {.quat = {1, 0, 0, 0}};
    for (int32_t i = 0; i < body->n_node; i++)
        if (!pal_adaptive_has(s, i)) share[i] = mean_of(s, share, i);
    pal_adaptive_fit_rigid(s, body, &frame);
    for (int a = 0; a < 3; a++) {
        double axis[3] = {frame.R[a], frame.R[3 + a], frame.R[6 + a]};
        pal_quat_rotate(axis, back, axis);
        for (int c = 0; c < 3; c++) l->axes[3 * c + a] = axis[c];
    }
    l->n_known = 0;
    l->k_N_m = 0;
    pal_set3(l->shift, 0, 0, 0);
    l->retriangulated = false;
}

/* adds the share of a vertex: to itself when it is a node, else in halves to the ends of its edge */
static void give_up(const pal_adaptive_surface *s, int32_t vertex, double share, double *weight)
{
    if (pal_adaptive_has(s, vertex)) {
        weight[vertex] += share;
        return;
    }
    for (int k = 0; k < 2; k++) give_up(s, ends_of(s, vertex)[k], 0.5 * share, weight);
}

void pal_adaptive_grasp_weights(const pal_body *body, const uint16_t *share, double *weight)
{
    bool any = false;
    for (int k = 0; k < body->n_active; k++) {
        int32_t i = body->active[k];
        weight[i] += share[i];
        any |= share[i] > 0;
    }
    for (int32_t i = 0; i < body->n_node && !any; i++)
        if (share[i] > 0) give_up(body->model.adaptive, i, share[i], weight);
}

/* the same of a vertex of a finer surface to those of one of n_node */
static void share_up(const pal_adaptive_surface *s, int32_t vertex, uint16_t own, int n_node, uint16_t *share)
{
    if (vertex < n_node) {
        if (share[vertex] < own) share[vertex] = own;
        return;
    }
    for (int k = 0; k < 2; k++) share_up(s, ends_of(s, vertex)[k], (uint16_t)((own + 1) / 2), n_node, share);
}

void pal_adaptive_grasp_transfer(pal_adaptive_grasp *l, const pal_body *body, uint16_t *share,
                                 const pal_adaptive_grasp *before, const pal_body *from, const uint16_t *share_before)
{
    const uint16_t *all = before->n_known > 0 ? before->known : share_before;
    int n_finest = before->n_known > 0 ? before->n_known : from->n_node;
    bool any = false;
    pal_adaptive_grasp_free(l);
    *l = (pal_adaptive_grasp){.retriangulated = false};
    memcpy(l->axes, before->axes, sizeof l->axes);
    for (int32_t i = 0; i < body->n_node; i++) {
        share[i] = i < n_finest ? all[i] : mean_of(body->model.adaptive, share, i);
        any |= share[i] > 0;
    }
    if (n_finest > body->n_node && (l->known = malloc(sizeof *l->known * (size_t)n_finest))) {
        memcpy(l->known, all, sizeof *l->known * (size_t)n_finest);
        l->n_known = n_finest;
    }
    /* all held tissue is finer */
    for (int32_t i = 0; i < from->n_node && !any; i++)
        if (share_before[i] > 0) share_up(from->model.adaptive, i, share_before[i], body->n_node, share);
}

void pal_adaptive_grasp_renew(pal_adaptive_grasp *l, const double was[3], const double is[3], double offset[3])
{
    double way[3];
    pal_sub3(way, is, was);
    pal_mul33(way, l->axes, way);
    pal_add3(offset, offset, way);
    if (!l->retriangulated) pal_set3(l->moved, 0, 0, 0);
    pal_add3(l->moved, l->moved, way);
    l->retriangulated = true;
}

void pal_adaptive_grasp_goal(pal_adaptive_grasp *l, const double quat[4], const double y[3], const double v[3],
                             double k_N_m, double dt_s, double goal[3])
{
    pal_scale3(l->shift, pal_blend_release(&l->left_s, dt_s), l->shift);
    if (k_N_m > 0 && l->k_N_m > 0 && (l->retriangulated || k_N_m != l->k_N_m)) {
        /* extension of the previous spring now */
        double was[3], moved[3];
        pal_add3(was, goal, l->shift), pal_sub3(was, was, y);
        if (l->retriangulated) {
            pal_quat_rotate(moved, quat, l->moved);
            pal_sub3(was, was, moved), pal_add3(was, was, y);
            pal_sub3(was, was, l->y), pal_axpy3(was, -l->dt_s, v);
        }
        for (int c = 0; c < 3; c++) l->shift[c] = l->k_N_m / k_N_m * was[c] - (goal[c] - y[c]);
        l->left_s = PAL_BLEND_S;
    }
    if (!pal_finite3(l->shift)) pal_set3(l->shift, 0, 0, 0);
    pal_add3(goal, goal, l->shift);
    pal_copy3(l->y, y);
    l->k_N_m = k_N_m;
    l->dt_s = dt_s;
    l->retriangulated = false;
}

void pal_adaptive_grasp_free(pal_adaptive_grasp *l)
{
    if (!l) return;
    free(l->known);
    l->known = NULL;
    l->n_known = 0;
}
