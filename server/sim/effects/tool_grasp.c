/* A tool holds tissue: a damped spring between the tool and the patch of tissue it closed on.
 *
 * When the grab button goes down, the shown vertices within `reach` of the tool are taken with weights (1 - d^2/R^2)^2,
 * or the nearest one alone when it lies within 1.5 reach; through the skin that gives node weights W_i, sum 1, and the
 * patch's place y = sum W_i x_i. With o = y - tool at that moment (turned with the tool's quaternion afterwards),
 *     F = k (tool + o - y) - c v_rel,   node i gets W_i F, the tool gets -F,
 * so nothing jumps when the grab begins, and force and torque balance about y. k and c are kept below the explicit
 * limits alpha m_i / dt^2 and beta m_i / dt of every free node, m_i being shared by the tools that hold it; where
 * points carry the nodes (pal_body.embed), alpha and beta times what the patch weighs at least. F is shortened to what
 * the tool's cap and the nodes' load_cap_N leave. The patch is let go when the button goes up or the tool's ramp has
 * fallen to 0.
 *
 * With an implicit solver (pal_body.implicit) nothing limits k, c is 0 (the step itself damps), the solver takes the
 * spring implicitly and the forces are those of the end of the sub-step. The spring stretches by at most 0.02 S more
 * than at the end of the last sub-step (numerics.md part 3: a tool that jumps) and by no more than brings the force to
 * 98 % of the caps once the tissue has followed, as far as its compliance is known, so tissue follows a faster tool
 * late. Where caps leave less than the spring's force, it becomes a constant force and the solver solves once more
 * (pal_tangent.settle).
 *
 * Another body in this one's place (hand): where it shows the same surface the grip holds the very vertices that it
 * took, by its own skin; of another surface those about the place at rest that it closed on. o changes by what the
 * patch's place at rest does, so that it stays the hold of that tissue, however often; the force goes over without a
 * jump (grasp_transfer.h).
 *
 * On a body that adapts (sim/adaptive_surface.h) weights go with the masses of the nodes as well, so that fine and
 * coarse parts of the patch come along alike, and a grip goes on when nodes come and go (adaptive_grasp.h).
 *
 * For a haptic bridge the tool's bilateral part is published as f0 - K (x - x0) - b v, K = k_s 1: k_s starts as this
 * spring in series with the tissue under the patch, 2 E R / (1 - nu^2), and follows least squares on the tool's moves
 * (haptics.md 2.3 steps 3 and 6). Where the solver has a compliance, K = (C + 1/k)^-1 with the 3 x 3 compliance C of
 * the patch, one column of it found anew in each step in which the tool moved; columns not found yet are taken
 * isotropic.
 *
 * Keys: stiffness_N_m (0: 16 E reach), damping_s (0.01: c over k), reach_m (0: 2 tool radii). */
#include "server/base/vec3.h"
#include "server/sim/contact/grasp.h"
#include "server/sim/contact/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static pal_err material(void *self, const pal_body *body, const pal_material *mat, pal_diagnostic *diag)
{
    pal_grasps *grasp = self;
    (void)body, (void)diag;
    grasp->young_Pa = mat->young_Pa;
    grasp->poisson = fmin(mat->poisson, PAL_POISSON_CLAMP);
    return PAL_ERR_OK;
}

static void let_go(pal_grasps *grasp, pal_grasp *g)
{
    for (int i = 0; i < g->n_node; i++) grasp->sum_weight[g->node[i]] -= g->weight[i];
    g->n_node = 0;
    g->closed = false;
    if (g->implicit) g->implicit->pulls = false;
}

static void destroy(void *self)
{
    pal_grasps *grasp = self;
    for (int t = 0; t < grasp->n_tool && grasp->grasp; t++)
        pal_adaptive_grasp_free(grasp->grasp[t].adaptive), free(grasp->grasp[t].transfer);
}

static void reset(void *self, const pal_body *body)
{
    pal_grasps *grasp = self;
    for (int t = 0; t < grasp->n_tool; t++) {
        grasp->grasp[t].closed = grasp->grasp[t].button = false;
        grasp->grasp[t].n_node = 0;
    }
    memset(grasp->sum_weight, 0, sizeof(double) * (size_t)body->n_node);
}

static pal_err make_grip(pal_grasp *g, const pal_body *body, pal_arena *arena)
{
    size_t n_node = (size_t)body->n_node;
    g->node = PAL_NEW(arena, int32_t, n_node);
    g->weight = PAL_NEW(arena, double, n_node);
    if (!g->node || !g->weight) return PAL_ERR_MEMORY;
    if (body->implicit && !(g->implicit = PAL_NEW(arena, pal_grasp_implicit, 1))) return PAL_ERR_MEMORY;
    if (body->active && !(g->adaptive = PAL_NEW(arena, pal_adaptive_grasp, 1))) return PAL_ERR_MEMORY;
    g->share = PAL_NEW(arena, uint16_t, (size_t)body->n_shown);
    return g->share ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    pal_grasps *grasp = PAL_NEW(build->arena, pal_grasps, 1);
    if (!grasp) return PAL_ERR_MEMORY;
    grasp->damping_s = 0.01;
    PAL_TRY(pal_entry_read_number(item, "stiffness_N_m", 0, 1e9, &grasp->asked_N_m, build->diag));
    PAL_TRY(pal_entry_read_number(item, "damping_s", 0, 10, &grasp->damping_s, build->diag));
    PAL_TRY(pal_entry_read_number(item, "reach_m", 0, 10, &grasp->asked_reach_m, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    if (build->body->n_shown == 0)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: tool_grasp needs a body that shows something",
                                  item->path);
    size_t n_node = (size_t)build->body->n_node, scratch = 6 * sizeof(double) * n_node + 256;
    if (build->body->implicit) {
        build->body->wants_compliance = true;
        if (build->scratch_byte < scratch) build->scratch_byte = scratch;
    }
    grasp->act = build->body->implicit ? pal_grasp_act_implicit : pal_grasp_act_explicit;
    grasp->n_tool = build->scene->n_tool;
    grasp->sum_weight = PAL_NEW(build->arena, double, n_node);
    grasp->gather = PAL_NEW(build->arena, double, n_node);
    grasp->grasp = PAL_NEW(build->arena, pal_grasp, grasp->n_tool);
    if (!grasp->sum_weight || !grasp->gather || !grasp->grasp) return PAL_ERR_MEMORY;
    for (int t = 0; t < grasp->n_tool; t++) PAL_TRY(make_grip(&grasp->grasp[t], build->body, build->arena));
    material(grasp, build->body, &build->def->material, NULL);
    *self = grasp;
    return PAL_ERR_OK;
}

static void add_vertex(pal_grasps *grasp, const pal_body *body, int vertex, double share)
{
    int32_t node[PAL_SKIN_NEIGHBOURS];
    double weight[PAL_SKIN_NEIGHBOURS];
    int n = pal_contact_points_nodes(body, vertex, node, weight);
    for (int k = 0; k < n; k++) grasp->gather[node[k]] += share * weight[k];
}

static void take_vertex(pal_grasps *grasp, pal_grasp *g, const pal_body *body, int vertex, double share)
{
    g->share[vertex] = (uint16_t)fmax(1, PAL_GRASP_WHOLE * share + 0.5);
    if (!g->adaptive) add_vertex(grasp, body, vertex, share);
}

/* node weights of shown vertices (at shown, m) that lie within reach of p, left in gather, of bodies that adapt in
 * share alone; false: nothing there */
static bool close_on(pal_grasps *grasp, pal_grasp *g, const pal_body *body, const float *shown, const double p[3],
                     double reach)
{
    double nearest2 = 2.25 * reach * reach, sum = 0;
    int nearest = -1;
    int n_shown = body->active ? body->n_active : body->n_shown;
    g->by_vertex = true;
    memset(g->share, 0, sizeof *g->share * (size_t)body->n_shown);
    for (int k = 0; k < n_shown; k++) {
        int i = body->active ? body->active[k] : k;
        const float *s = shown + 3 * (size_t)i;
        double x = (double)s[0] - p[0], y = (double)s[1] - p[1], z = (double)s[2] - p[2];
        double d2 = x * x + y * y + z * z, fall = 1 - d2 / (reach * reach);
        if (d2 <= nearest2) nearest2 = d2, nearest = i;
        if (!(fall > 0)) continue;
        take_vertex(grasp, g, body, i, fall * fall);
        sum += fall * fall;
    }
    if (nearest < 0) return false;
    if (sum == 0) take_vertex(grasp, g, body, nearest, 1);
    return true;
}

static void rest_place(const pal_grasp *g, const pal_body *body, double y[3])
{
    pal_grasp_mean(g, body->node_rest, y);
}

/* the grip's nodes and weights from those in gather, which is then 0 again */
static void take_gathered(pal_grasps *grasp, pal_grasp *g, const pal_body *body)
{
    double sum = 0;
    g->n_node = 0;
    for (int k = 0; k < pal_body_nodes(body); k++) {
        int i = pal_body_point(body, k);
        if (grasp->gather[i] == 0) continue;
        g->node[g->n_node] = i;
        sum += g->weight[g->n_node++] = grasp->gather[i] * (g->adaptive ? body->mass_kg[i] : 1);
        grasp->gather[i] = 0;
    }
    for (int i = 0; i < g->n_node; i++) {
        g->weight[i] /= sum;
        grasp->sum_weight[g->node[i]] += g->weight[i];
    }
}

static void take_hold(pal_grasps *grasp, pal_grasp *g, const pal_tool *tool, const pal_body *body)
{
    double last[3], y[3], reach = pal_grasp_reach_m(grasp, tool);
    pal_sub3(last, tool->last.position_m, body->offset_m);
    if (!close_on(grasp, g, body, body->shown, last, reach)) return;
    if (g->adaptive) {
        pal_adaptive_grasp_begin(g->adaptive, body, tool->last.quat, g->share);
        pal_adaptive_grasp_weights(body, g->share, grasp->gather);
    }
    take_gathered(grasp, g, body);
    if (g->transfer) *g->transfer = (pal_grasp_transfer){.due = false};
    pal_grasp_mean(g, body->d, y);
    double back[4] = {tool->last.quat[0], -tool->last.quat[1], -tool->last.quat[2], -tool->last.quat[3]};
    pal_sub3(g->offset, y, last);
    pal_quat_rotate(g->offset, back, g->offset);
    memcpy(g->quat, tool->last.quat, sizeof g->quat);
    rest_place(g, body, g->at_m);
    pal_sub3(g->at_m, g->at_m, y), pal_add3(g->at_m, g->at_m, tool->last.position_m);
    g->reach_m = reach;
    g->closed = true;
    double k = pal_grasp_stiffness_N_m(grasp, reach),
           tissue = 2 * grasp->young_Pa * reach / (1 - grasp->poisson * grasp->poisson);
    pal_stiffness_fit_start(&g->fit, fmax(MIN_STIFFNESS_N_M, k * tissue / (k + tissue)));
    pal_stiffness_fit_add(&g->fit, tool->last.position_m, (double[3]){0}, FIT_PRIOR_RADII * tool->radius_m);
    if (g->implicit) {
        g->implicit->stretch_m = 0;
        g->implicit->compliance = (pal_grasp_compliance){.n_known = 0};
    }
}

/* once a step: the same grips on the points that are in use now */
static void follow(pal_grasps *grasp, const pal_body *body)
{
    if (!body->active || grasp->revision == body->revision) return;
    grasp->revision = body->revision;
    for (int t = 0; t < grasp->n_tool; t++) {
        pal_grasp *g = &grasp->grasp[t];
        double was[3], is[3];
        if (!g->closed) continue;
        rest_place(g, body, was);
        for (int i = 0; i < g->n_node; i++) grasp->sum_weight[g->node[i]] -= g->weight[i];
        pal_adaptive_grasp_weights(body, g->share, grasp->gather);
        take_gathered(grasp, g, body);
        rest_place(g, body, is);
        pal_adaptive_grasp_renew(g->adaptive, was, is, g->offset);
    }
}

/* once a step: the button's edges */
static void begin_tool(pal_grasps *grasp, pal_grasp *g, const pal_tool *tool, const pal_body *body)
{
    bool pressed = tool->grasp && !g->button;
    g->button = tool->grasp;
    /* a tool that is gone holds on while its ramp falls, so that its force fades */
    if (g->closed && ((tool->present && !tool->grasp) || tool->ramp <= 0)) let_go(grasp, g);
    if (pressed && !g->closed) take_hold(grasp, g, tool, body);
}

/* what the grip b of another body holds, by this body's nodes */
static void hand_nodes(pal_grasps *grasp, pal_grasp *g, const pal_body *body, const pal_grasp *b,
                       const pal_component_transfer *by)
{
    const pal_interpolation *place = by->place;
    bool same = b->by_vertex && by->same_shown, found = same && place;
    if (g->adaptive) {
        pal_adaptive_grasp_transfer(g->adaptive, body, g->share, b->adaptive, by->from, b->share);
        pal_adaptive_grasp_weights(body, g->share, grasp->gather);
        take_gathered(grasp, g, body);
        return;
    }
    for (int i = 0; i < body->n_shown && same; i++) g->share[i] = b->share[i];
    for (int i = 0; i < body->n_shown && found; i++)
        if (g->share[i] > 0) add_vertex(grasp, body, i, g->share[i] / PAL_GRASP_WHOLE);
    if (!same && place) found = close_on(grasp, g, body, by->rest_m, b->at_m, b->reach_m);
    g->by_vertex = same || found;
    for (int i = 0; i < b->n_node && !found; i++) {
        if (!place) grasp->gather[b->node[i]] += b->weight[i];
        for (int32_t k = place ? place->start[b->node[i]] : 0; place && k < place->start[b->node[i] + 1]; k++)
            grasp->gather[place->point[k]] += b->weight[i] * fmax(0, place->weight[k]);
    }
    take_gathered(grasp, g, body);
}

/* what the grip of before pulled on nodes less what this one does: to left_N */
static void leave(const pal_grasp *g, const pal_grasp *b, const double force_N[3], const pal_component_transfer *by)
{
    const pal_interpolation *place = by->place;
    if (!by->left_N || !place || !pal_finite3(force_N)) return;
    for (int i = 0; i < b->n_node; i++) {
        if (!by->from->interpolation && by->from->support[b->node[i]]) continue;
        for (int32_t k = place->start[b->node[i]]; k < place->start[b->node[i] + 1]; k++)
            pal_axpy3(by->left_N + 3 * (size_t)place->point[k], b->weight[i] * place->weight[k], force_N);
    }
    for (int i = 0; i < g->n_node; i++) pal_axpy3(by->left_N + 3 * (size_t)g->node[i], -g->weight[i], force_N);
}

/* o by what the patch's place at rest differs */
static void move_hold(pal_grasp *g, const pal_body *body, const pal_grasp *b, const pal_body *from)
{
    double was[3], moved[3], back[4] = {b->quat[0], -b->quat[1], -b->quat[2], -b->quat[3]};
    rest_place(g, body, moved), rest_place(b, from, was);
    pal_sub3(moved, moved, was);
    if (g->adaptive)
        pal_mul33(moved, g->adaptive->axes, moved);
    else
        pal_quat_rotate(moved, back, moved);
    pal_add3(g->offset, b->offset, moved);
    memcpy(g->quat, b->quat, sizeof g->quat);
    pal_copy3(g->at_m, b->at_m);
    g->reach_m = b->reach_m;
}

static void transfer(void *self, const pal_body *body, const void *before, const pal_component_transfer *by)
{
    pal_grasps *grasp = self;
    const pal_grasps *old = before;
    grasp->revision = body->revision;
    for (int t = 0; t < grasp->n_tool && t < old->n_tool; t++) {
        const pal_grasp *b = &old->grasp[t];
        pal_grasp *g = &grasp->grasp[t];
        if (!g->transfer && !(g->transfer = calloc(1, sizeof *g->transfer))) continue;
        pal_grasp_transfer *h = g->transfer;
        let_go(grasp, g);
        g->button = b->button;
        if (!b->closed) continue;
        hand_nodes(grasp, g, body, b, by);
        move_hold(g, body, b, by->from);
        g->fit = b->fit;
        *h = b->transfer ? *b->transfer : (pal_grasp_transfer){.due = false};
        if (!h->due) {
            pal_grasp_mean(b, by->from->d, h->y);
            pal_scale3(h->force_N, -1, b->force);
            pal_copy3(h->hold, b->offset);
            h->k_N_m = b->implicit ? b->implicit->k_N_m : 0;
        }
        leave(g, b, h->force_N, by);
        g->closed = h->due = g->n_node > 0;
    }
}

static pal_err run(void *self, pal_step *step)
{
    pal_grasps *grasp = self;
    pal_tools *tools = step->tools;
    int n_tool = tools->n_tool < grasp->n_tool ? tools->n_tool : grasp->n_tool;
    if (step->sub == 0) follow(grasp, step->body);
    for (int t = 0; t < n_tool; t++) {
        pal_grasp *g = &grasp->grasp[t];
        if (step->sub == 0) begin_tool(grasp, g, &tools->tool[t], step->body);
        if (g->implicit) g->implicit->pulls = false;
        if (g->closed && !step->body->frozen) grasp->act(grasp, g, &tools->tool[t], step);
    }
    return PAL_ERR_OK;
}

/* the nearest vertex is taken within one and a half of the reach (close_on); what is held is, from however far */
static double how_far_m(const void *self, const pal_tool *tool)
{
    const pal_grasps *grasp = self;
    for (int t = 0; t < grasp->n_tool; t++)
        if (grasp->grasp[t].closed) return INFINITY;
    return 1.5 * pal_grasp_reach_m(grasp, tool);
}

static const pal_tangent tangent = {.multiply = pal_grasp_multiply, .settle = pal_grasp_settle};

const pal_effect pal_effect_tool_grasp = {.name = "tool_grasp",
                                          .stage = PAL_STAGE_CONTACT,
                                          .make = make,
                                          .run = run,
                                          .material = material,
                                          .reset = reset,
                                          .transfer = transfer,
                                          .destroy = destroy,
                                          .reach_m = how_far_m,
                                          .tangent = &tangent};
