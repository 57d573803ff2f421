/* Component tool_grasp: each tool grasps tissue by a damped spring (grasp.h).
 *
 * When the grasp button goes down the shown vertices within `reach` of the tool are grasped with weights (1 -
 * d^2/R^2)^2, or only the nearest one if it lies within 1.5 reach; the skin turns these into node weights. Farther from
 * the surface, within the volume, the nodes within reach are grasped in the same way (paper A section 3.3). On an
 * adaptive body weights are also proportional to node mass, so that fine and coarse parts move alike, and a grasp
 * persists when nodes are added or removed (adaptive_grasp.h). Tissue is released when the button goes up or the
 * tool's ramp is 0.
 *
 * Transfer to another body: if it shows the same surface, the grasp keeps its vertices with the new skin; otherwise
 * it takes the vertices around the rest position at which it closed. The offset changes with the rest position of
 * the grasped tissue, so that repeated transfers cause no drift; the force does not jump (grasp.h).
 *
 * Keys: stiffness_N_m (0: 16 E reach), damping_s (0.01: c over k), reach_m (0: 2 tool radii). */
#include "server/base/vec3.h"
#include "server/mesh/geometry/box_tree.h"
#include "server/sim/contact/grasp.h"
#include "server/sim/contact/tuning.h"

#include <stdlib.h>
#include <string.h>

static pal_err material(void *self, const pal_body *body, const pal_material *mat, pal_diagnostic *diag)
{
    pal_grasps *grasps = self;
    (void)body, (void)diag;
    grasps->young_Pa = mat->young_Pa;
    grasps->poisson = fmin(mat->poisson, PAL_POISSON_CLAMP);
    return PAL_ERR_OK;
}

static void release(pal_grasps *grasps, pal_grasp *g)
{
    for (int i = 0; i < g->n_node; i++) grasps->sum_weight[g->node[i]] -= g->weight[i];
    g->n_node = 0;
    g->closed = false;
    if (g->implicit) g->implicit->pulls = false;
}

static void destroy(void *self)
{
    pal_grasps *grasps = self;
    for (int t = 0; t < grasps->n_tool && grasps->grasp; t++)
        pal_adaptive_grasp_free(grasps->grasp[t].adaptive), free(grasps->grasp[t].transfer);
}

static void reset(void *self, const pal_body *body)
{
    pal_grasps *grasps = self;
    for (int t = 0; t < grasps->n_tool; t++)
        grasps->grasp[t].closed = grasps->grasp[t].button = false, grasps->grasp[t].n_node = 0;
    memset(grasps->sum_weight, 0, sizeof(double) * (size_t)body->n_node);
}

static pal_err make_grasp(pal_grasp *g, const pal_body *body, pal_arena *arena)
{
    g->node = PAL_NEW(arena, int32_t, body->n_node);
    g->weight = PAL_NEW(arena, double, body->n_node);
    if (body->implicit) g->implicit = PAL_NEW(arena, pal_grasp_implicit, 1);
    if (body->active) g->adaptive = PAL_NEW(arena, pal_adaptive_grasp, 1);
    g->share = PAL_NEW(arena, uint16_t, body->display.n_shown);
    const bool all =
        g->node && g->weight && g->share && (g->implicit || !body->implicit) && (g->adaptive || !body->active);
    return all ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err make(pal_config_entry *entry, pal_build *build, void **self)
{
    pal_grasps *grasps = PAL_NEW(build->arena, pal_grasps, 1);
    if (!grasps) return PAL_ERR_MEMORY;
    grasps->damping_s = 0.01;
    PAL_TRY(pal_entry_read_number(entry, "stiffness_N_m", 0, 1e9, &grasps->asked_N_m, build->diag));
    PAL_TRY(pal_entry_read_number(entry, "damping_s", 0, 10, &grasps->damping_s, build->diag));
    PAL_TRY(pal_entry_read_number(entry, "reach_m", 0, 10, &grasps->asked_reach_m, build->diag));
    PAL_TRY(pal_entry_check_unused(entry, build->diag));
    if (build->body->display.n_shown == 0)
        return PAL_REFUSE(build->diag, "%s: tool_grasp needs a body with a shown surface", entry->path);
    size_t n_node = (size_t)build->body->n_node, scratch = 6 * sizeof(double) * n_node + 256;
    if (build->scratch_byte < scratch) build->scratch_byte = scratch;
    build->body->wants_compliance = true;
    grasps->act = build->body->implicit ? pal_grasp_act_implicit : pal_grasp_act_explicit;
    grasps->settle = build->body->implicit ? pal_grasp_settle_implicit : pal_grasp_settle_explicit;
    grasps->n_tool = build->scene->n_tool;
    grasps->grasp = PAL_NEW(build->arena, pal_grasp, grasps->n_tool);
    if (!PAL_NEW_DOUBLES(build->arena, n_node, &grasps->sum_weight, &grasps->gather) || !grasps->grasp)
        return PAL_ERR_MEMORY;
    for (int t = 0; t < grasps->n_tool; t++) PAL_TRY(make_grasp(&grasps->grasp[t], build->body, build->arena));
    material(grasps, build->body, &build->def->material, NULL);
    *self = grasps;
    return PAL_ERR_OK;
}

static void add_vertex(pal_grasps *grasps, const pal_body *body, int vertex, double share)
{
    int32_t node[PAL_SKIN_NEIGHBOURS];
    double weight[PAL_SKIN_NEIGHBOURS];
    int n = pal_contact_points_nodes(body, vertex, node, weight);
    for (int k = 0; k < n; k++) grasps->gather[node[k]] += share * weight[k];
}

static void take_vertex(pal_grasps *grasps, pal_grasp *g, const pal_body *body, int vertex, double share)
{
    g->share[vertex] = (uint16_t)fmax(1, UINT16_MAX * share + 0.5);
    if (!g->adaptive) add_vertex(grasps, body, vertex, share);
}

/* weights of shown vertices (at shown, m) within reach of p, in gather; of adaptive bodies in share. false: none */
static bool find_vertices(pal_grasps *grasps, pal_grasp *g, const pal_body *body, const float *shown, const double p[3],
                          double reach)
{
    double nearest2 = 2.25 * reach * reach, sum = 0;
    int nearest = -1, n_shown = body->active ? body->n_active : body->display.n_shown;
    g->by_vertex = true;
    memset(g->share, 0, sizeof *g->share * (size_t)body->display.n_shown);
    for (int k = 0; k < n_shown; k++) {
        int i = pal_body_point(body, k);
        const float *s = shown + 3 * (size_t)i;
        double x = (double)s[0] - p[0], y = (double)s[1] - p[1], z = (double)s[2] - p[2];
        double d2 = x * x + y * y + z * z, fall = 1 - d2 / (reach * reach);
        if (d2 <= nearest2) nearest2 = d2, nearest = i;
        if (!(fall > 0)) continue;
        take_vertex(grasps, g, body, i, fall * fall);
        sum += fall * fall;
    }
    if (nearest >= 0 && sum == 0) take_vertex(grasps, g, body, nearest, 1);
    return nearest >= 0;
}

/* does the shown surface surround p? Its solid angle there is then 4 pi */
static bool is_inside(const pal_body *body, const double p[3])
{
    const pal_surface *s = body->display.surface;
    double sum = 0;
    for (int t = 0; t < s->n_tri; t++) {
        double x[3][3];
        for (int k = 0; k < 9; k++)
            x[k / 3][k % 3] = (double)body->display.shown[3 * (size_t)s->tri[3 * t + k / 3] + k % 3];
        sum += pal_solid_angle((const double *[]){x[0], x[1], x[2]}, p);
    }
    return fabs(sum) > 2 * M_PI;
}

/* weights of the nodes around a tool that is within the volume, farther from the surface */
static bool find_nodes(pal_grasps *grasps, const pal_body *body, const double p[3], double reach)
{
    bool any = false;
    if (!is_inside(body, p)) return false;
    for (int i = 0; i < body->n_node; i++) {
        const double d = pal_dist3(body->d + 3 * (size_t)i, p) / reach, fall = 1 - d * d;
        if (!(fall > 0)) continue;
        grasps->gather[i] = fall * fall;
        any = true;
    }
    return any;
}

/* takes nodes and weights from gather and sets it to 0 */
static void take_gathered(pal_grasps *grasps, pal_grasp *g, const pal_body *body)
{
    double sum = 0;
    g->n_node = 0;
    g->revision = ++grasps->n_taken;
    for (int k = 0; k < pal_body_nodes(body); k++) {
        int i = pal_body_point(body, k);
        if (grasps->gather[i] == 0) continue;
        g->node[g->n_node] = i;
        sum += g->weight[g->n_node++] = grasps->gather[i] * (g->adaptive ? body->mass_kg[i] : 1);
        grasps->gather[i] = 0;
    }
    for (int i = 0; i < g->n_node; i++) {
        g->weight[i] /= sum;
        grasps->sum_weight[g->node[i]] += g->weight[i];
    }
}

static void close_grasp(pal_grasps *grasps, pal_grasp *g, const pal_tool *tool, const pal_body *body)
{
    double last[3], y[3], reach = pal_grasp_reach_m(grasps, tool);
    pal_sub3(last, tool->last.position_m, body->offset_m);
    if (!find_vertices(grasps, g, body, body->display.shown, last, reach)) {
        g->by_vertex = false;
        if (g->adaptive || !find_nodes(grasps, body, last, reach)) return;
    }
    if (g->adaptive) {
        pal_adaptive_grasp_begin(g->adaptive, body, tool->last.quat, g->share);
        pal_adaptive_grasp_weights(body, g->share, grasps->gather);
    }
    take_gathered(grasps, g, body);
    if (g->transfer) *g->transfer = (pal_grasp_transfer){.due = false};
    pal_grasp_mean(g, body->d, y);
    double back[4] = {tool->last.quat[0], -tool->last.quat[1], -tool->last.quat[2], -tool->last.quat[3]};
    pal_sub3(g->offset, y, last);
    pal_quat_rotate(g->offset, back, g->offset);
    memcpy(g->quat, tool->last.quat, sizeof g->quat);
    pal_grasp_mean(g, body->node_rest, g->at_m);
    pal_sub3(g->at_m, g->at_m, y), pal_add3(g->at_m, g->at_m, tool->last.position_m);
    g->reach_m = reach;
    g->closed = true;
    double k = pal_grasp_stiffness_N_m(grasps, reach),
           tissue = 2 * grasps->young_Pa * reach / (1 - grasps->poisson * grasps->poisson);
    pal_stiffness_fit_start(&g->fit, fmax(STIFFNESS_N_M.low, k * tissue / (k + tissue)));
    pal_stiffness_fit_add(&g->fit, tool->last.position_m, (double[3]){0}, tool->radius_m);
    g->compliance = (pal_grasp_compliance){.n_known = 0};
    if (g->implicit) *g->implicit = (pal_grasp_implicit){.pulls = false};
}

/* once per step: rebuilds the grasps on the active nodes */
static void update_nodes(pal_grasps *grasps, const pal_body *body)
{
    if (!body->active || grasps->revision == body->display.revision) return;
    grasps->revision = body->display.revision;
    for (int t = 0; t < grasps->n_tool; t++) {
        pal_grasp *g = &grasps->grasp[t];
        double was[3], is[3];
        if (!g->closed) continue;
        pal_grasp_mean(g, body->node_rest, was);
        for (int i = 0; i < g->n_node; i++) grasps->sum_weight[g->node[i]] -= g->weight[i];
        pal_adaptive_grasp_weights(body, g->share, grasps->gather);
        take_gathered(grasps, g, body);
        pal_grasp_mean(g, body->node_rest, is);
        pal_adaptive_grasp_renew(g->adaptive, was, is, g->offset);
    }
}

/* once per step: handles the button's edges */
static void begin_tool(pal_grasps *grasps, pal_grasp *g, const pal_tool *tool, const pal_body *body)
{
    bool pressed = tool->grasp && !g->button;
    g->button = tool->grasp;
    /* an absent tool keeps its grasp while its ramp falls, so that its force fades */
    if (g->closed && ((tool->present && !tool->grasp) || tool->ramp <= 0)) release(grasps, g);
    if (pressed && !g->closed) close_grasp(grasps, g, tool, body);
}

/* the grasp b of another body, by this body's nodes */
static void transfer_nodes(pal_grasps *grasps, pal_grasp *g, const pal_body *body, const pal_grasp *b,
                           const pal_component_transfer *by)
{
    const pal_interpolation *place = by->place;
    bool same = b->by_vertex && by->same_shown, found = same && place;
    if (g->adaptive) {
        pal_adaptive_grasp_transfer(g->adaptive, body, g->share, b->adaptive, by->from, b->share);
        pal_adaptive_grasp_weights(body, g->share, grasps->gather);
        take_gathered(grasps, g, body);
        return;
    }
    for (int i = 0; i < body->display.n_shown && same; i++) g->share[i] = b->share[i];
    for (int i = 0; i < body->display.n_shown && found; i++)
        if (g->share[i] > 0) add_vertex(grasps, body, i, g->share[i] / (double)UINT16_MAX);
    if (!same && place) found = find_vertices(grasps, g, body, by->rest_m, b->at_m, b->reach_m);
    g->by_vertex = same || found;
    for (int i = 0; i < b->n_node && !found; i++) {
        if (!place) grasps->gather[b->node[i]] += b->weight[i];
        for (int32_t k = place ? place->start[b->node[i]] : 0; place && k < place->start[b->node[i] + 1]; k++)
            grasps->gather[place->point[k]] += b->weight[i] * fmax(0, place->weight[k]);
    }
    take_gathered(grasps, g, body);
}

/* left_N += nodal forces of the grasp before, less those of this one */
static void add_left(const pal_grasp *g, const pal_grasp *b, const double force_N[3], const pal_component_transfer *by)
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

/* changes the offset by the difference in the rest position of the grasped tissue */
static void move_offset(pal_grasp *g, const pal_body *body, const pal_grasp *b, const pal_body *from)
{
    double was[3], moved[3], back[4] = {b->quat[0], -b->quat[1], -b->quat[2], -b->quat[3]};
    pal_grasp_mean(g, body->node_rest, moved), pal_grasp_mean(b, from->node_rest, was);
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
    pal_grasps *grasps = self;
    const pal_grasps *old = before;
    grasps->revision = body->display.revision;
    for (int t = 0; t < grasps->n_tool && t < old->n_tool; t++) {
        const pal_grasp *b = &old->grasp[t];
        pal_grasp *g = &grasps->grasp[t];
        if (!g->transfer && !(g->transfer = calloc(1, sizeof *g->transfer))) continue;
        pal_grasp_transfer *h = g->transfer;
        release(grasps, g);
        g->button = b->button;
        if (!b->closed) continue;
        transfer_nodes(grasps, g, body, b, by);
        move_offset(g, body, b, by->from);
        g->fit = b->fit;
        *h = b->transfer ? *b->transfer : (pal_grasp_transfer){.due = false};
        if (!h->due) {
            pal_grasp_mean(b, by->from->d, h->y);
            pal_scale3(h->force_N, -1, b->force);
            pal_copy3(h->hold, b->offset);
            h->k_N_m = b->implicit ? b->implicit->k_N_m : 0;
        }
        add_left(g, b, h->force_N, by);
        g->closed = h->due = g->n_node > 0;
    }
}

static pal_err run(void *self, pal_step *step)
{
    pal_grasps *grasps = self;
    pal_tools *tools = step->tools;
    int n_tool = tools->n_tool < grasps->n_tool ? tools->n_tool : grasps->n_tool;
    if (step->sub == 0) update_nodes(grasps, step->body);
    const pal_compliance *compliance = step->body->compliance;
    if (compliance && compliance->begin && step->sub == step->n_sub - 1) compliance->begin(compliance->self, step);
    for (int t = 0; t < n_tool; t++) {
        pal_grasp *g = &grasps->grasp[t];
        pal_set3(g->torque_Nm, 0, 0, 0);
        if (step->sub == 0) begin_tool(grasps, g, &tools->tool[t], step->body);
        if (g->implicit) g->implicit->pulls = false;
        if (g->closed && !step->body->frozen) grasps->act(grasps, g, &tools->tool[t], step);
    }
    return PAL_ERR_OK;
}

/* the nearest vertex is grasped within 1.5 reach (find_vertices); an active grasp acts at any distance */
static double reach_m(const void *self, const pal_tool *tool)
{
    const pal_grasps *grasps = self;
    for (int t = 0; t < grasps->n_tool; t++)
        if (grasps->grasp[t].closed) return INFINITY;
    return 1.5 * pal_grasp_reach_m(grasps, tool);
}

static bool settle(void *self, pal_step *step, const double *moved, bool last)
{
    pal_grasps *grasps = self;
    return grasps->settle(grasps, step, moved, last);
}

static const pal_tangent tangent = {
    .multiply = pal_grasp_multiply, .settle = settle, .mean_springs = pal_grasp_mean_springs};

const pal_effect pal_effect_tool_grasp = {
    PAL_EFFECT("tool_grasp", CONTACT), .material = material, .reset = reset, .transfer = transfer, .destroy = destroy,
    .sleep.reach_m = reach_m,          .tangent = &tangent};
