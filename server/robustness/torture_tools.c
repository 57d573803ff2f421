/* Insults by tools, by numbers that are none, by supports, and by all of it at random. */
#include "server/base/vec3.h"
#include "server/robustness/torture_parts.h"
#include "server/sim/elements/elastic_hex.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double back_s = 10, clamp_S = 0.02;
/* RMS speed that counts as standing still after supports were switched */
static const double still_S_s = 1e-3;
/* of a node's cap (or the weight): bends a body, and crushes no element as a tenth of the cap, E h^2, does (in a liver
 * of 6 voxels; a beam and one of 8 bear a fifth) */
static const double bend_share = 0.05;

/* ---- tools ---- */

static bool has_tools(pal_rig *rig)
{
    if (!rig->touches) pal_rig_skip(rig, "no body has the row tool_push: tools touch nothing");
    return rig->touches;
}

static void move(pal_rig *rig, int tool, const double at_m[3], bool grasp)
{
    pal_pose pose = {.quat = {1, 0, 0, 0}, .buttons = grasp};
    pal_copy3(pose.position_m, at_m);
    (void)pal_world_pose(rig->world, tool, &pose);
}

/* A step in which each of n tools may put in its cap times the clamp of the contact's correction and times its way; a
 * jump is no way: there is only the correction of one step. What was put in may not grow afterwards */
static bool tool_step(pal_rig *rig, int n, double way_m)
{
    double size = pal_world_body(rig->world, rig->body)->length_scale_m, before = pal_rig_energy(rig), cap = 0;
    for (int t = 0; t < n; t++) cap += rig->scene->tool[t].force_cap_N;
    rig->allowed_J = cap * (clamp_S * size + way_m);
    bool good = pal_rig_step(rig, rig->scene->step_s);
    double rise = fmin(pal_rig_energy(rig) - before, rig->allowed_J);
    if (rise > 0) rig->base_J += rise;
    rig->allowed_J = 0;
    return good;
}

static void let_go(pal_rig *rig)
{
    for (int t = 0; t < rig->scene->n_tool; t++) (void)pal_world_pose(rig->world, t, NULL);
}

/* a horizontal axis through the middle of the body that tools touch, its middle and half extents */
static int middle(const pal_rig *rig, double centre[3], double half[3])
{
    double low[3], high[3];
    int axis = 0;
    pal_rig_box(rig, rig->body, low, high);
    for (int c = 0; c < 3; c++) {
        centre[c] = 0.5 * (low[c] + high[c]), half[c] = 0.5 * (high[c] - low[c]);
        if (fabs(rig->scene->up[c]) < fabs(rig->scene->up[axis]) - 1e-9) axis = c;
    }
    return axis;
}

static void release(pal_rig *rig, bool good)
{
    let_go(rig);
    for (int i = 0; i < 12 && good; i++) good = tool_step(rig, 2, 0);
    /* what the contacts' last steps gave, or took, is the begin of coming back */
    pal_rig_forgive(rig, pal_rig_energy(rig));
    rig->base_J = pal_rig_energy(rig);
    if (good) pal_rig_relax(rig, back_s);
    if (rig->out->back_s < INFINITY) pal_rig_say(rig, "back after %.2g s", rig->out->back_s);
}

static void say_force(pal_rig *rig, double most_N)
{
    double cap = rig->scene->tool[0].force_cap_N;
    pal_rig_say(rig, "force up to %.3g N", most_N);
    if (most_N > cap * (1 + 1e-9)) pal_rig_fail(rig, "beyond the cap of %.3g N", cap);
}

static double force_N(const pal_rig *rig, int tool)
{
    return pal_norm3(pal_world_tools(rig->world)->tool[tool].mean_force_N);
}

void pal_insult_teleport(pal_rig *rig)
{
    double centre[3], half[3], at[3], most = 0;
    if (!has_tools(rig)) return;
    int axis = middle(rig, centre, half);
    const pal_body *body = pal_world_body(rig->world, rig->body);
    double radius = pal_world_tools(rig->world)->tool[0].radius_m;
    bool good = true;
    for (int i = 0; i < 48 && good; i++) {
        double side = i < 12 || i >= 30 ? 1 : 0;
        pal_copy3(at, centre);
        /* beside, then by S into and beyond, then back */
        at[axis] += side > 0 ? half[axis] + 2 * radius : half[axis] + 2 * radius - body->length_scale_m;
        move(rig, 0, at, false);
        good = tool_step(rig, 1, 0);
        most = fmax(most, force_N(rig, 0));
    }
    say_force(rig, most);
    release(rig, good);
}

void pal_insult_inside(pal_rig *rig)
{
    double centre[3], half[3], most = 0;
    if (!has_tools(rig)) return;
    (void)middle(rig, centre, half);
    bool good = true;
    for (int i = 0; i < 60 && good; i++) {
        move(rig, 0, centre, false);
        good = tool_step(rig, 1, 0);
        most = fmax(most, force_N(rig, 0));
    }
    say_force(rig, most);
    release(rig, good);
}

void pal_insult_pressed(pal_rig *rig)
{
    enum { IN = 30, HOLD = 30 };
    double centre[3], half[3], most = 0;
    if (!has_tools(rig)) return;
    int axis = middle(rig, centre, half);
    bool good = true;
    const double way_m = (0.7 * half[axis] + 2 * pal_world_tools(rig->world)->tool[0].radius_m) / IN;
    for (int i = 0; i < IN + HOLD && good; i++) {
        double way = i < IN ? (double)i / IN : 1;
        for (int t = 0; t < 2; t++) {
            double at[3], radius = pal_world_tools(rig->world)->tool[t].radius_m;
            double far = half[axis] + 2 * radius, near = 0.3 * half[axis];
            pal_copy3(at, centre);
            at[axis] += (t ? -1 : 1) * (far + way * (near - far));
            move(rig, t, at, false);
        }
        good = tool_step(rig, 2, way_m);
        most = fmax(most, fmax(force_N(rig, 0), force_N(rig, 1)));
    }
    say_force(rig, most);
    release(rig, good);
}

/* ---- numbers that are none ---- */

static int bad_pose(pal_rig *rig, double number)
{
    int n_taken = 0;
    for (int at = 0; at < 3; at++) {
        pal_pose pose = {.quat = {1, 0, 0, 0}};
        double *to[3] = {&pose.position_m[1], &pose.quat[2], &pose.velocity_m_s[0]};
        *to[at] = number;
        n_taken += !pal_world_pose(rig->world, 0, &pose);
    }
    return n_taken;
}

static int bad_material(pal_rig *rig, double number)
{
    int n_taken = 0;
    for (int at = 0; at < 4; at++) {
        pal_material to = rig->scene->body[0].material;
        double *number_of[4] = {&to.young_Pa, &to.poisson, &to.density_kg_m3, &to.damping_1_s};
        *number_of[at] = number;
        /* what is huge may be taken where it is no more than heavy or damped: it is put back */
        if (pal_world_material(rig->world, 0, &to, NULL)) continue;
        n_taken += !isfinite(number);
        (void)pal_world_material(rig->world, 0, &rig->scene->body[0].material, NULL);
    }
    return n_taken;
}

void pal_insult_numbers(pal_rig *rig)
{
    static const double bad[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300};
    int n_taken = 0, node = pal_rig_far_node(rig, 0);
    rig->out->energy = NAN;
    uint64_t hash = pal_world_hash(rig->world);
    for (int k = 0; k < 5; k++) {
        const double force[3] = {0, bad[k], 0};
        n_taken += bad_pose(rig, bad[k]) + bad_material(rig, bad[k]);
        if (!isfinite(bad[k])) n_taken += !pal_world_load(rig->world, 0, node, force);
        if (bad[k] != 1e300) n_taken += !pal_world_step(rig->world, bad[k]);
    }
    n_taken +=
        !pal_world_pose(rig->world, PAL_TOOL_MAX, NULL) + !pal_world_load(rig->world, 0, -1, (double[3]){0, 0, 0});
    n_taken += !pal_world_step(rig->world, 0) + !pal_world_reset_body(rig->world, PAL_BODY_MAX);
    if (n_taken > 0) pal_rig_fail(rig, "%d of them were taken", n_taken);
    if (hash != pal_world_hash(rig->world)) pal_rig_fail(rig, "the state changed");
    if (n_taken == 0) pal_rig_say(rig, "all refused");
    /* 1e300 N is a number: it is shortened */
    if (!pal_world_load(rig->world, 0, node, (const double[3]){0, 1e300, 0})) {
        bool good = true;
        for (int i = 0; i < 6 && good; i++) good = pal_rig_step(rig, rig->scene->step_s);
        (void)pal_world_load(rig->world, 0, node, (const double[3]){0, 0, 0});
        if (good) pal_rig_relax(rig, back_s);
        if (good) pal_rig_say(rig, "1e300 N on a node is shortened");
    }
}

/* ---- supports ---- */

/* everything in the upper fifth of each body is held instead of what was */
static void support_top(const pal_rig *rig, pal_scene *scene)
{
    for (int b = 0; b < scene->n_body; b++) {
        const pal_body *body = pal_world_body(rig->world, b);
        double least = INFINITY, most = -INFINITY;
        for (int i = 0; i < body->n_dof; i++) {
            double at = pal_dot3(scene->up, body->x_rest + 3 * (size_t)i);
            least = fmin(least, at), most = fmax(most, at);
        }
        pal_support_def s = {.low_m = {INFINITY, INFINITY, INFINITY}, .high_m = {-INFINITY, -INFINITY, -INFINITY}};
        for (int i = 0; i < body->n_dof; i++) {
            const double *x = body->x_rest + 3 * (size_t)i;
            if (pal_dot3(scene->up, x) < least + 0.8 * (most - least)) continue;
            for (int c = 0; c < 3; c++) {
                s.low_m[c] = fmin(s.low_m[c], x[c] - 1e-9 * body->length_scale_m);
                s.high_m[c] = fmax(s.high_m[c], x[c] + 1e-9 * body->length_scale_m);
            }
        }
        scene->body[b].n_support = 1;
        scene->body[b].support[0] = s;
    }
}

/* Energy of a world that has just followed another. Cubes and their split store other energies in one shape: those that
 * ran on their split are looked at on it here too, though only the next step will decide that */
static double followed_J(pal_world *next, const pal_world *before)
{
    double energy = 0;
    for (int turn = 0; turn < 2; turn++) {
        for (int i = 0; i < pal_world_component_count(next) && i < pal_world_component_count(before); i++) {
            const pal_component *row = pal_world_component(next, i), *was = pal_world_component(before, i);
            if (row->effect != was->effect || strcmp(row->effect->name, "hex_elastic")) continue;
            pal_elastic_hexes *to = row->self;
            const pal_elastic_hexes *from = was->self;
            to->has_inversion = turn == 0 && from->has_inversion && to->split;
        }
        if (turn == 0) energy = pal_world_energy_J(next);
    }
    return energy;
}

/* a world made from another scene goes on where this one is */
static bool go_over(pal_rig *rig, const pal_scene *scene, double *jump)
{
    pal_world *next = NULL;
    pal_diagnostic reason = {""};
    if (pal_world_create(scene, &reason, &next)) {
        pal_rig_skip(rig, "the scene with other supports is refused: %.150s", reason.text);
        return false;
    }
    double before = pal_world_energy_J(rig->world);
    pal_world_transfer(next, rig->world, -1, NULL, NULL);
    *jump = fmax(*jump, followed_J(next, rig->world) - before);
    pal_world_destroy(rig->world);
    rig->world = next;
    pal_rig_rebase(rig);
    return true;
}

static double speed_S_s(const pal_rig *rig)
{
    double most = 0;
    for (int b = 0; b < rig->scene->n_body; b++) {
        const pal_body *body = pal_world_body(rig->world, b);
        double mass = 0;
        for (int i = 0; i < body->n_dof; i++) mass += body->mass_kg[i];
        most = fmax(most, sqrt(2 * pal_body_kinetic_J(body) / mass) / body->length_scale_m);
    }
    return most;
}

void pal_insult_supports(pal_rig *rig)
{
    if (rig->twin) {
        pal_rig_skip(rig, "a moving support leads it: the insult asks for rest elsewhere");
        return;
    }
    for (int b = 0; b < rig->scene->n_body; b++)
        if (pal_world_body(rig->world, b)->active) {
            pal_rig_skip(rig, "a surface that adapts begins at rest when its scene changes");
            return;
        }
    pal_scene *other = malloc(sizeof *other);
    if (!other) {
        pal_rig_undecided(rig, "not judged, there is no memory for the scene with other supports");
        return;
    }
    *other = *rig->scene;
    support_top(rig, other);
    double jump = 0;
    for (int b = 0; b < rig->scene->n_body; b++) {
        double size = bend_share * pal_rig_cap_N(rig, b);
        (void)pal_world_load(rig->world, b, pal_rig_far_node(rig, b), (const double[3]){size, size, 0});
    }
    pal_rig_rebase(rig);
    bool good = pal_rig_run(rig, 0.3) && go_over(rig, other, &jump) && pal_rig_run(rig, 0.5);
    good = good && go_over(rig, rig->scene, &jump) && pal_rig_run(rig, 0.1);
    free(other);
    if (rig->out->verdict == PAL_VERDICT_SKIPPED) return;
    /* where it is held is another place now: it has to come to rest, not to come back */
    const double begin = rig->out->simulated_s, hold_s = 0.25;
    double since_s = 0;
    while (good && since_s < hold_s && rig->out->simulated_s - begin < rig->patience_s) {
        good = pal_rig_step(rig, rig->scene->step_s);
        since_s = speed_S_s(rig) <= still_S_s ? since_s + rig->scene->step_s : 0;
    }
    const double left = speed_S_s(rig);
    double share = rig->scale_J > 0 ? jump / rig->scale_J : 0;
    pal_rig_say(rig, "energy rises by %.2g of what is stored at a switch, still after %.2g s", share,
                rig->out->simulated_s - begin);
    if (!(share <= 0.01)) pal_rig_fail(rig, "more than 1 %%");
    if (good && since_s < hold_s) pal_rig_fail(rig, "it still moves, at the end by %.2g S a second", left);
}

/* ---- all of it at random ---- */

static double draw(pal_rig *rig, double low, double high)
{
    return low + (high - low) * pal_rig_random(rig);
}

static void random_pose(pal_rig *rig, const double centre[3], double size)
{
    static const double bad[] = {NAN, INFINITY, 1e300, -1e300};
    int tool = (int)draw(rig, 0, rig->scene->n_tool);
    pal_pose pose = {.quat = {1, 0, 0, 0}, .buttons = pal_rig_random(rig) < 0.4};
    for (int c = 0; c < 3; c++) pose.position_m[c] = centre[c] + draw(rig, -size, size);
    if (pal_rig_random(rig) < 0.1) pose.position_m[0] = bad[(int)draw(rig, 0, 4)];
    if (pal_rig_random(rig) < 0.1) pose.velocity_m_s[1] = bad[(int)draw(rig, 0, 4)];
    (void)pal_world_pose(rig->world, tool, pal_rig_random(rig) < 0.1 ? NULL : &pose);
}

static void random_brush(pal_rig *rig, int b)
{
    const pal_body *body = pal_world_body(rig->world, b);
    int node = pal_body_point(body, (int)draw(rig, 0, pal_body_nodes(body)));
    pal_brush brush = {.kind = pal_rig_random(rig) < 0.5 ? PAL_BRUSH_INFLATE : PAL_BRUSH_NONE,
                       .radius_m = draw(rig, 0, 0.2) * body->length_scale_m,
                       .soft = draw(rig, -0.1, 1.1),
                       .pressure_Pa = draw(rig, -1, 1) * rig->scene->body[b].material.young_Pa};
    pal_copy3(brush.at_m, body->node_rest + 3 * (size_t)node);
    (void)pal_world_brush(rig->world, b, (int)draw(rig, 0, rig->scene->n_tool), &brush, NULL);
}

static void random_order(pal_rig *rig, const double centre[3], double size)
{
    int b = (int)draw(rig, 0, rig->scene->n_body);
    const pal_body *body = pal_world_body(rig->world, b);
    double kind = pal_rig_random(rig);
    if (kind < 0.6) {
        random_pose(rig, centre, size);
    } else if (kind < 0.8) {
        int node = pal_body_point(body, (int)draw(rig, 0, pal_body_nodes(body)));
        double force[3], most = pal_rig_cap_N(rig, b);
        for (int c = 0; c < 3; c++) force[c] = draw(rig, -most, most);
        if (pal_rig_random(rig) < 0.1) force[2] = 1e9;
        (void)pal_world_load(rig->world, b, node, force);
    } else if (kind < 0.9) {
        pal_material to = rig->scene->body[b].material;
        to.young_Pa *= exp(draw(rig, -1.5, 1.5));
        to.density_kg_m3 *= exp(draw(rig, -0.5, 0.5));
        to.damping_1_s = draw(rig, -1, 10);
        (void)pal_world_material(rig->world, b, &to, NULL);
    } else {
        random_brush(rig, b);
    }
}

/* as it was: nobody holds anything, loads, brushes and materials are those of the scene */
static void calm(pal_rig *rig)
{
    let_go(rig);
    for (int b = 0; b < rig->scene->n_body; b++) {
        pal_body *body = pal_world_body(rig->world, b);
        for (int t = 0; t < PAL_TOOL_MAX; t++) (void)pal_world_brush(rig->world, b, t, NULL, NULL);
        (void)pal_world_material(rig->world, b, &rig->scene->body[b].material, NULL);
        if (body->external_force) memset(body->external_force, 0, 3 * sizeof(double) * (size_t)body->n_node);
    }
}

void pal_insult_random(pal_rig *rig)
{
    enum { STEPS = 300 };
    double centre[3], half[3];
    (void)middle(rig, centre, half);
    double size = pal_world_body(rig->world, rig->body)->length_scale_m;
    bool good = true;
    rig->out->energy = NAN; /* orders are work */
    for (int i = 0; i < STEPS && good; i++) {
        if (pal_rig_random(rig) < 0.5) random_order(rig, centre, size);
        good = pal_rig_step(rig, rig->scene->step_s);
    }
    calm(rig);
    if (good) good = pal_rig_run(rig, 0.3);
    if (good) pal_rig_relax(rig, back_s);
    if (rig->out->back_s < INFINITY) pal_rig_say(rig, "back after %.2g s", rig->out->back_s);
}
