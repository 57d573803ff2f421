/* Cases with tools, invalid numbers, supports, and random commands that combine them. */
#include "server/base/vec3.h"
#include "server/robustness/trial.h"
#include "server/sim/transfer/transfer_world.h"

#include <stdlib.h>
#include <string.h>

/* ---- tools ---- */

static bool has_tools(pal_trial *trial)
{
    if (!trial->touches)
        pal_trial_report(trial, PAL_CAUSE_NOT_APPLICABLE, "no body has the component tool_push: tools touch nothing");
    return trial->touches;
}

static void move(pal_trial *trial, int tool, const double at_m[3])
{
    pal_pose pose = {.quat = {1, 0, 0, 0}};
    pal_copy3(pose.position_m, at_m);
    (void)pal_world_pose(trial->world, tool, &pose);
}

/* One step. Each of n tools may add its force cap times the contact's correction limit and times its path. A jump
 * has no path, only the correction of one step. The added energy may not grow afterwards. */
static bool tool_step(pal_trial *trial, int n, double path_m)
{
    double size = pal_world_body(trial->world, trial->body)->length_scale_m, before = pal_trial_energy(trial), cap = 0;
    for (int t = 0; t < n; t++) cap += trial->scene->tool[t].force_cap_N;
    trial->allowed_J = cap * (PAL_TOOL_CORRECTION_S * size + path_m);
    bool good = pal_trial_step(trial, trial->scene->step_s);
    double rise = fmin(pal_trial_energy(trial) - before, trial->allowed_J);
    if (rise > 0) trial->base_J += rise;
    trial->allowed_J = 0;
    return good;
}

/* Centre of the body that tools touch, or where its box is empty there the node nearest to that, and half extents;
 * returns a horizontal axis through it. */
static int find_centre(const pal_trial *trial, double centre[3], double half[3])
{
    const pal_body *body = pal_world_body(trial->world, trial->body);
    double low[3], high[3], middle[3], nearest_m = INFINITY;
    int axis = 0;
    pal_trial_box(trial, trial->body, low, high);
    for (int c = 0; c < 3; c++) {
        middle[c] = 0.5 * (low[c] + high[c]), half[c] = 0.5 * (high[c] - low[c]);
        if (fabs(trial->scene->up[c]) < fabs(trial->scene->up[axis]) - 1e-9) axis = c;
    }
    for (int k = 0; k < pal_body_nodes(body); k++) {
        double at[3];
        pal_add3(at, body->d + 3 * (size_t)pal_body_point(body, k), body->offset_m);
        if (pal_dist3(at, middle) >= nearest_m) continue;
        nearest_m = pal_dist3(at, middle);
        pal_copy3(centre, at);
    }
    if (nearest_m <= body->edge_m) pal_copy3(centre, middle);
    return axis;
}

static void release(pal_trial *trial, bool good)
{
    for (int t = 0; t < trial->scene->n_tool; t++) (void)pal_world_pose(trial->world, t, NULL);
    for (int i = 0; i < 12 && good; i++) good = tool_step(trial, 2, 0);
    /* the energy of the last contact steps is the start of the return */
    pal_trial_exclude_rise(trial, pal_trial_energy(trial));
    trial->base_J = pal_trial_energy(trial);
    if (good) pal_trial_return(trial, PAL_RETURN_TIME_S);
}

/* One tool. With the parameter it is beside the body and jumps by S into it and beyond, and back; else it is in its
 * middle. */
void pal_robustness_one_tool(pal_trial *trial)
{
    double centre[3], half[3];
    if (!has_tools(trial)) return;
    const bool jumps = trial->parameter;
    int axis = find_centre(trial, centre, half);
    const double size = pal_world_body(trial->world, trial->body)->length_scale_m,
                 beside = half[axis] + 2 * pal_world_tools(trial->world)->tool[0].radius_m;
    bool good = true;
    for (int i = 0; i < (jumps ? 48 : 60) && good; i++) {
        double at[3];
        pal_copy3(at, centre);
        if (jumps) at[axis] += i < 12 || i >= 30 ? beside : beside - size;
        move(trial, 0, at);
        good = tool_step(trial, 1, 0);
    }
    release(trial, good);
}

void pal_robustness_pressed(pal_trial *trial)
{
    enum { IN = 30, HOLD = 30 };
    double centre[3], half[3];
    if (!has_tools(trial)) return;
    int axis = find_centre(trial, centre, half);
    bool good = true;
    const double path_m = (0.7 * half[axis] + 2 * pal_world_tools(trial->world)->tool[0].radius_m) / IN;
    for (int i = 0; i < IN + HOLD && good; i++) {
        double part = i < IN ? (double)i / IN : 1;
        for (int t = 0; t < 2; t++) {
            double at[3], radius = pal_world_tools(trial->world)->tool[t].radius_m;
            double far = half[axis] + 2 * radius, near = 0.3 * half[axis];
            pal_copy3(at, centre);
            at[axis] += (t ? -1 : 1) * (far + part * (near - far));
            move(trial, t, at);
        }
        good = tool_step(trial, 2, path_m);
    }
    release(trial, good);
}

/* ---- numbers that are none ---- */

static int bad_pose(pal_trial *trial, double number)
{
    int n_accepted = 0;
    for (int at = 0; at < 3; at++) {
        pal_pose pose = {.quat = {1, 0, 0, 0}};
        double *to[3] = {&pose.position_m[1], &pose.quat[2], &pose.velocity_m_s[0]};
        *to[at] = number;
        n_accepted += !pal_world_pose(trial->world, 0, &pose);
    }
    return n_accepted;
}

static int bad_material(pal_trial *trial, double number)
{
    int n_accepted = 0;
    for (int at = 0; at < 4; at++) {
        pal_material to = trial->scene->body[0].material;
        double *number_of[4] = {&to.young_Pa, &to.poisson, &to.density_kg_m3, &to.damping_1_s};
        *number_of[at] = number;
        /* a huge value may be accepted if it only makes the body heavy or damped: restores it */
        if (pal_world_material(trial->world, 0, &to, NULL)) continue;
        n_accepted += !isfinite(number);
        (void)pal_world_material(trial->world, 0, &trial->scene->body[0].material, NULL);
    }
    return n_accepted;
}

void pal_robustness_numbers(pal_trial *trial)
{
    static const double bad[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300};
    int n_accepted = 0, node = pal_trial_far_node(trial, 0);
    trial->out->energy = NAN;
    uint64_t hash = pal_world_hash(trial->world);
    for (int k = 0; k < 5; k++) {
        const double force[3] = {0, bad[k], 0};
        n_accepted += bad_pose(trial, bad[k]) + bad_material(trial, bad[k]);
        if (!isfinite(bad[k])) n_accepted += !pal_world_load(trial->world, 0, node, force);
        if (bad[k] != 1e300) n_accepted += !pal_world_step(trial->world, bad[k]);
    }
    n_accepted +=
        !pal_world_pose(trial->world, PAL_TOOL_MAX, NULL) + !pal_world_load(trial->world, 0, -1, (double[3]){0, 0, 0});
    n_accepted += !pal_world_step(trial->world, 0) + !pal_world_reset_body(trial->world, PAL_BODY_MAX);
    if (n_accepted > 0) pal_trial_report(trial, PAL_CAUSE_INPUT, "%d of them were accepted", n_accepted);
    if (hash != pal_world_hash(trial->world)) pal_trial_report(trial, PAL_CAUSE_INPUT, "the state changed");
    if (n_accepted == 0) pal_trial_report(trial, PAL_CAUSE_NONE, "all refused");
    /* 1e300 N is a valid number: it is clamped */
    if (!pal_world_load(trial->world, 0, node, (const double[3]){0, 1e300, 0})) {
        bool good = true;
        for (int i = 0; i < 6 && good; i++) good = pal_trial_step(trial, trial->scene->step_s);
        (void)pal_world_load(trial->world, 0, node, (const double[3]){0, 0, 0});
        if (good) pal_trial_return(trial, PAL_RETURN_TIME_S);
        if (good) pal_trial_report(trial, PAL_CAUSE_NONE, "1e300 N on a node is shortened");
    }
}

/* ---- supports ---- */

/* fixes the upper fifth of each body instead of the original supports */
static void support_top(const pal_trial *trial, pal_scene *scene)
{
    for (int b = 0; b < scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->world, b);
        double min = INFINITY, max = -INFINITY;
        for (int i = 0; i < body->n_dof; i++) {
            double at = pal_dot3(scene->up, body->x_rest + 3 * (size_t)i);
            min = fmin(min, at), max = fmax(max, at);
        }
        pal_support_def s = {.lowest = false};
        pal_box3_empty(s.low_m, s.high_m);
        for (int i = 0; i < body->n_dof; i++) {
            const double *x = body->x_rest + 3 * (size_t)i;
            if (pal_dot3(scene->up, x) < min + 0.8 * (max - min)) continue;
            pal_box3_add(s.low_m, s.high_m, x);
        }
        for (int c = 0; c < 3; c++)
            s.low_m[c] -= 1e-9 * body->length_scale_m, s.high_m[c] += 1e-9 * body->length_scale_m;
        scene->body[b].n_support = 1;
        scene->body[b].support[0] = s;
    }
}

/* a world made from another scene continues from the present state */
static bool switch_scene(pal_trial *trial, const pal_scene *scene, double *jump)
{
    pal_world *next = NULL;
    pal_diagnostic reason = {""};
    if (pal_world_create(scene, &reason, &next)) {
        pal_trial_report(trial, PAL_CAUSE_NOT_APPLICABLE, "the scene with other supports is refused: %.150s",
                         reason.text);
        return false;
    }
    double before = pal_world_energy_J(trial->world);
    pal_world_transfer(next, trial->world, -1, NULL, NULL);
    *jump = fmax(*jump, pal_world_energy_J(next) - before);
    pal_world_destroy(trial->world);
    trial->world = next;
    pal_trial_rebase(trial);
    return true;
}

void pal_robustness_supports(pal_trial *trial)
{
    if (trial->twin) {
        pal_trial_report(trial, PAL_CAUSE_NOT_APPLICABLE, "a moving support drives it: the case needs rest");
        return;
    }
    for (int b = 0; b < trial->scene->n_body; b++)
        if (pal_world_body(trial->world, b)->active) {
            pal_trial_report(trial, PAL_CAUSE_NOT_APPLICABLE,
                             "a surface that adapts begins at rest when its scene changes");
            return;
        }
    pal_scene *other = malloc(sizeof *other);
    if (!other) {
        pal_trial_report(trial, PAL_CAUSE_SECONDS, "not judged, there is no memory for the scene with other supports");
        return;
    }
    *other = *trial->scene;
    support_top(trial, other);
    double jump = 0;
    pal_trial_load(trial, PAL_BEND_SHARE, (const double[3]){1, 1, 0});
    pal_trial_rebase(trial);
    bool good = pal_trial_run(trial, 0.3) && switch_scene(trial, other, &jump) && pal_trial_run(trial, 0.5);
    good = good && switch_scene(trial, trial->scene, &jump) && pal_trial_run(trial, 0.1);
    free(other);
    if (trial->causes & 1u << PAL_CAUSE_NOT_APPLICABLE) return;
    /* its supports have moved: it must come to rest, not return */
    const double begin = trial->out->simulated_s,
                 max_s = pal_return_limit_s(trial->lowest_1_s, trial->tau_s, pal_trial_deviation_S(trial, false),
                                            PAL_RETURN_TIME_S);
    double since_s = 0;
    while (good && since_s < PAL_REST_HOLD_S && trial->out->simulated_s - begin < max_s) {
        good = pal_trial_step(trial, trial->scene->step_s);
        since_s = pal_trial_speed_S_s(trial) <= PAL_SWITCHED_SPEED_S_S ? since_s + trial->scene->step_s : 0;
    }
    const double left = pal_trial_speed_S_s(trial);
    double share = trial->scale_J > 0 ? jump / trial->scale_J : 0;
    pal_trial_report(trial, PAL_CAUSE_NONE, "energy rises by %.2g of what is stored at a switch, at rest after %.2g s",
                     share, trial->out->simulated_s - begin);
    if (!(share <= 0.01)) pal_trial_report(trial, PAL_CAUSE_ENERGY, "more than 1 %%");
    if (good && since_s < PAL_REST_HOLD_S)
        pal_trial_report(trial, PAL_CAUSE_MOVES, "it still moves at the end, by %.2g S a second", left);
}

/* ---- all of it at random ---- */

static double draw(pal_trial *trial, double low, double high)
{
    return low + (high - low) * pal_trial_random(trial);
}

static void random_pose(pal_trial *trial, const double centre[3], double size)
{
    static const double bad[] = {NAN, INFINITY, 1e300, -1e300};
    int tool = (int)draw(trial, 0, trial->scene->n_tool);
    pal_pose pose = {.quat = {1, 0, 0, 0}, .buttons = pal_trial_random(trial) < 0.4};
    for (int c = 0; c < 3; c++) pose.position_m[c] = centre[c] + draw(trial, -size, size);
    if (pal_trial_random(trial) < 0.1) pose.position_m[0] = bad[(int)draw(trial, 0, 4)];
    if (pal_trial_random(trial) < 0.1) pose.velocity_m_s[1] = bad[(int)draw(trial, 0, 4)];
    (void)pal_world_pose(trial->world, tool, pal_trial_random(trial) < 0.1 ? NULL : &pose);
}

static void random_brush(pal_trial *trial, int b)
{
    const pal_body *body = pal_world_body(trial->world, b);
    int node = pal_body_point(body, (int)draw(trial, 0, pal_body_nodes(body)));
    pal_brush brush = {.kind = pal_trial_random(trial) < 0.5 ? PAL_BRUSH_INFLATE : PAL_BRUSH_NONE,
                       .radius_m = draw(trial, 0, 0.2) * body->length_scale_m,
                       .softness = draw(trial, -0.1, 1.1),
                       .pressure_Pa = draw(trial, -1, 1) * trial->scene->body[b].material.young_Pa};
    pal_copy3(brush.at_m, body->node_rest + 3 * (size_t)node);
    (void)pal_world_brush(trial->world, b, (int)draw(trial, 0, trial->scene->n_tool), &brush, NULL);
}

static void random_command(pal_trial *trial, const double centre[3], double size)
{
    int b = (int)draw(trial, 0, trial->scene->n_body);
    const pal_body *body = pal_world_body(trial->world, b);
    double kind = pal_trial_random(trial);
    if (kind < 0.6) {
        random_pose(trial, centre, size);
    } else if (kind < 0.8) {
        int node = pal_body_point(body, (int)draw(trial, 0, pal_body_nodes(body)));
        double force[3], max = pal_trial_load_cap_N(trial, b, node);
        for (int c = 0; c < 3; c++) force[c] = draw(trial, -max, max);
        if (pal_trial_random(trial) < 0.1) force[2] = 1e9;
        (void)pal_world_load(trial->world, b, node, force);
    } else if (kind < 0.9) {
        pal_material to = trial->scene->body[b].material;
        to.young_Pa *= exp(draw(trial, -1.5, 1.5));
        to.density_kg_m3 *= exp(draw(trial, -0.5, 0.5));
        to.damping_1_s = draw(trial, -1, 10);
        (void)pal_world_material(trial->world, b, &to, NULL);
    } else {
        random_brush(trial, b);
    }
}

/* Restores the scene: releases tools, resets loads, brushes and materials. */
static void restore_scene_loads(pal_trial *trial)
{
    for (int t = 0; t < trial->scene->n_tool; t++) (void)pal_world_pose(trial->world, t, NULL);
    for (int b = 0; b < trial->scene->n_body; b++) {
        for (int t = 0; t < PAL_TOOL_MAX; t++) (void)pal_world_brush(trial->world, b, t, NULL, NULL);
        (void)pal_world_material(trial->world, b, &trial->scene->body[b].material, NULL);
    }
    pal_trial_remove_loads(trial);
}

void pal_robustness_random(pal_trial *trial)
{
    enum { STEPS = 300 };
    double centre[3], half[3];
    (void)find_centre(trial, centre, half);
    double size = pal_world_body(trial->world, trial->body)->length_scale_m;
    bool good = true;
    trial->out->energy = NAN; /* commands do work */
    for (int i = 0; i < STEPS && good; i++) {
        if (pal_trial_random(trial) < 0.5) random_command(trial, centre, size);
        good = pal_trial_step(trial, trial->scene->step_s);
    }
    restore_scene_loads(trial);
    if (good) good = pal_trial_run(trial, 0.3);
    if (good) pal_trial_return(trial, PAL_RETURN_TIME_S);
}
