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
#include "server/sim/contact/grasp_transfer.h"
#include "server/sim/contact/haptic_stiffness.h"
#include "server/sim/contact/stiffness_fit.h"
#include "server/sim/contact/tuning.h"
#include "server/sim/core/effect.h"
#include "server/sim/surface/adaptive_grasp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ALPHA     0.25
#define BETA      0.25
#define RISE_S    0.02
#define BELOW_CAP 0.98
#define WHOLE     65535.0

/* what a grip needs beside with an implicit solver */
typedef struct firm_grip {
    bool constant, settled; /* the load stays as it is; force is part of the tool's */
    bool found;             /* compliance was looked for in this sub-step           */
    double k_N_m, pull[3];  /* at the sub-step's begin: stiffness, force of the spring on tissue            */
    double load[3];         /* force on tissue in body->load                                                */
    double stretch_m;       /* at the end of the last sub-step                                              */
    pal_grasp_compliance compliance;
} firm_grip;

typedef struct grip {
    bool fixed, button; /* has tissue; button in the last step                              */
    bool by_vertex;     /* share is that of the patch                                       */
    int n_node;
    int32_t *node;                 /* [n_node]                                                         */
    double *weight;                /* sum 1 [n_node]                                                   */
    uint16_t *share;               /* of each shown vertex, WHOLE: 1                       [n_shown]   */
    double quat[4], at_m[3];       /* of the tool when it closed, and where of the tissue at rest      */
    double reach_m;                /* then                                                             */
    double offset[3];              /* patch minus tool in the tool's axes at quaternion 1              */
    double k_max_N_m, c_most_Ns_m; /* explicit limits in this sub-step                    */
    double force[3];               /* on the tool, this sub-step                                       */
    pal_adaptive_grasp *live;      /* bodies that adapt only, else NULL */
    pal_stiffness_fit fit;
    bool pulls;      /* implicit solvers only: in this sub-step */
    firm_grip *firm; /* implicit solvers only, else NULL */
} grip;

typedef struct tool_grasp {
    int n_tool;
    grip *grip;         /* [n_tool] */
    double *sum_weight; /* of all tools that hold a node [n_node] */
    double *gather;     /* weights of a new grab [n_node], 0 between grabs */
    double asked_N_m, damping_s, asked_reach_m;
    double young_Pa, poisson;
    uint64_t revision;                  /* bodies that adapt: of the nodes that grips are on */
    pal_grasp_transfer *grasp_transfer; /* heap, after hand; else NULL [n_tool] */
} tool_grasp;

static double reach_m(const tool_grasp *grasp, const pal_tool *tool)
{
    return grasp->asked_reach_m > 0 ? grasp->asked_reach_m : 2 * tool->radius_m;
}

static double stiffness_N_m(const tool_grasp *grasp, double reach)
{
    return grasp->asked_N_m > 0 ? grasp->asked_N_m : 16 * grasp->young_Pa * reach;
}

static pal_err material(void *self, const pal_body *body, const pal_material *mat, pal_diagnostic *diag)
{
    tool_grasp *grasp = self;
    (void)body, (void)diag;
    grasp->young_Pa = mat->young_Pa;
    grasp->poisson = fmin(mat->poisson, PAL_POISSON_CLAMP);
    return PAL_ERR_OK;
}

static void let_go(tool_grasp *grasp, grip *g)
{
    for (int i = 0; i < g->n_node; i++) grasp->sum_weight[g->node[i]] -= g->weight[i];
    g->n_node = 0;
    g->fixed = g->pulls = false;
}

static void destroy(void *self)
{
    tool_grasp *grasp = self;
    for (int t = 0; t < grasp->n_tool && grasp->grip; t++) pal_adaptive_grasp_free(grasp->grip[t].live);
    free(grasp->grasp_transfer);
}

static void reset(void *self, const pal_body *body)
{
    tool_grasp *grasp = self;
    for (int t = 0; t < grasp->n_tool; t++) {
        grasp->grip[t].fixed = grasp->grip[t].button = grasp->grip[t].pulls = false;
        grasp->grip[t].n_node = 0;
    }
    memset(grasp->sum_weight, 0, sizeof(double) * (size_t)body->n_node);
}

static pal_err make_grip(grip *g, const pal_body *body, pal_arena *arena)
{
    size_t n_node = (size_t)body->n_node;
    g->node = PAL_NEW(arena, int32_t, n_node);
    g->weight = PAL_NEW(arena, double, n_node);
    if (!g->node || !g->weight) return PAL_ERR_MEMORY;
    if (body->implicit && !(g->firm = PAL_NEW(arena, firm_grip, 1))) return PAL_ERR_MEMORY;
    if (body->active && !(g->live = PAL_NEW(arena, pal_adaptive_grasp, 1))) return PAL_ERR_MEMORY;
    g->share = PAL_NEW(arena, uint16_t, (size_t)body->n_shown);
    return g->share ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    tool_grasp *grasp = PAL_NEW(build->arena, tool_grasp, 1);
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
    grasp->n_tool = build->scene->n_tool;
    grasp->sum_weight = PAL_NEW(build->arena, double, n_node);
    grasp->gather = PAL_NEW(build->arena, double, n_node);
    grasp->grip = PAL_NEW(build->arena, grip, grasp->n_tool);
    if (!grasp->sum_weight || !grasp->gather || !grasp->grip) return PAL_ERR_MEMORY;
    for (int t = 0; t < grasp->n_tool; t++) PAL_TRY(make_grip(&grasp->grip[t], build->body, build->arena));
    material(grasp, build->body, &build->def->material, NULL);
    *self = grasp;
    return PAL_ERR_OK;
}

static void add_vertex(tool_grasp *grasp, const pal_body *body, int vertex, double share)
{
    int32_t node[PAL_SKIN_NEIGHBOURS];
    double weight[PAL_SKIN_NEIGHBOURS];
    int n = pal_contact_points_nodes(body, vertex, node, weight);
    for (int k = 0; k < n; k++) grasp->gather[node[k]] += share * weight[k];
}

static void take_vertex(tool_grasp *grasp, grip *g, const pal_body *body, int vertex, double share)
{
    g->share[vertex] = (uint16_t)fmax(1, WHOLE * share + 0.5);
    if (!g->live) add_vertex(grasp, body, vertex, share);
}

/* node weights of shown vertices (at shown, m) that lie within reach of p, left in gather, of bodies that adapt in
 * share alone; false: nothing there */
static bool close_on(tool_grasp *grasp, grip *g, const pal_body *body, const float *shown, const double p[3],
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

/* y and its velocity */
static void patch_place(const grip *g, const pal_body *body, double y[3], double v[3])
{
    pal_set3(y, 0, 0, 0), pal_set3(v, 0, 0, 0);
    for (int i = 0; i < g->n_node; i++) {
        pal_axpy3(y, g->weight[i], body->d + 3 * (size_t)g->node[i]);
        pal_axpy3(v, g->weight[i], body->dv + 3 * (size_t)g->node[i]);
    }
}

static void rest_place(const grip *g, const pal_body *body, double y[3])
{
    pal_set3(y, 0, 0, 0);
    for (int i = 0; i < g->n_node; i++) pal_axpy3(y, g->weight[i], body->node_rest + 3 * (size_t)g->node[i]);
}

/* the grip's nodes and weights from those in gather, which is then 0 again */
static void take_gathered(tool_grasp *grasp, grip *g, const pal_body *body)
{
    double sum = 0;
    g->n_node = 0;
    for (int k = 0; k < pal_body_nodes(body); k++) {
        int i = pal_body_point(body, k);
        if (grasp->gather[i] == 0) continue;
        g->node[g->n_node] = i;
        sum += g->weight[g->n_node++] = grasp->gather[i] * (g->live ? body->mass_kg[i] : 1);
        grasp->gather[i] = 0;
    }
    for (int i = 0; i < g->n_node; i++) {
        g->weight[i] /= sum;
        grasp->sum_weight[g->node[i]] += g->weight[i];
    }
}

static void take_hold(tool_grasp *grasp, grip *g, const pal_tool *tool, const pal_body *body)
{
    double last[3], y[3], v[3], reach = reach_m(grasp, tool);
    pal_sub3(last, tool->last.position_m, body->offset_m);
    if (!close_on(grasp, g, body, body->shown, last, reach)) return;
    if (g->live) {
        pal_adaptive_grasp_begin(g->live, body, tool->last.quat, g->share);
        pal_adaptive_grasp_weights(body, g->share, grasp->gather);
    }
    take_gathered(grasp, g, body);
    if (grasp->grasp_transfer) grasp->grasp_transfer[g - grasp->grip] = (pal_grasp_transfer){.due = false};
    patch_place(g, body, y, v);
    double back[4] = {tool->last.quat[0], -tool->last.quat[1], -tool->last.quat[2], -tool->last.quat[3]};
    pal_sub3(g->offset, y, last);
    pal_quat_rotate(g->offset, back, g->offset);
    memcpy(g->quat, tool->last.quat, sizeof g->quat);
    rest_place(g, body, g->at_m);
    pal_sub3(g->at_m, g->at_m, y), pal_add3(g->at_m, g->at_m, tool->last.position_m);
    g->reach_m = reach;
    g->fixed = true;
    double k = stiffness_N_m(grasp, reach),
           tissue = 2 * grasp->young_Pa * reach / (1 - grasp->poisson * grasp->poisson);
    pal_stiffness_fit_start(&g->fit, fmax(MIN_STIFFNESS_N_M, k * tissue / (k + tissue)));
    pal_stiffness_fit_add(&g->fit, tool->last.position_m, (double[3]){0}, FIT_PRIOR_RADII * tool->radius_m);
    if (g->firm) {
        g->firm->stretch_m = 0;
        g->firm->compliance = (pal_grasp_compliance){.n_known = 0};
    }
}

/* once a step: the same grips on the points that are in use now */
static void follow(tool_grasp *grasp, const pal_body *body)
{
    if (!body->active || grasp->revision == body->revision) return;
    grasp->revision = body->revision;
    for (int t = 0; t < grasp->n_tool; t++) {
        grip *g = &grasp->grip[t];
        double was[3], is[3];
        if (!g->fixed) continue;
        rest_place(g, body, was);
        for (int i = 0; i < g->n_node; i++) grasp->sum_weight[g->node[i]] -= g->weight[i];
        pal_adaptive_grasp_weights(body, g->share, grasp->gather);
        take_gathered(grasp, g, body);
        rest_place(g, body, is);
        pal_adaptive_grasp_renew(g->live, was, is, g->offset);
    }
}

/* once a step: the button's edges */
static void begin_tool(tool_grasp *grasp, grip *g, const pal_tool *tool, const pal_body *body)
{
    bool pressed = tool->grasp && !g->button;
    g->button = tool->grasp;
    /* a tool that is gone holds on while its ramp falls, so that its force fades */
    if (g->fixed && ((tool->present && !tool->grasp) || tool->ramp <= 0)) let_go(grasp, g);
    if (pressed && !g->fixed) take_hold(grasp, g, tool, body);
}

/* what the grip b of another body holds, by this body's nodes */
static void hand_nodes(tool_grasp *grasp, grip *g, const pal_body *body, const grip *b,
                       const pal_component_transfer *by)
{
    const pal_interpolation *place = by->place;
    bool same = b->by_vertex && by->same_shown, found = same && place;
    if (g->live) {
        pal_adaptive_grasp_transfer(g->live, body, g->share, b->live, by->from, b->share);
        pal_adaptive_grasp_weights(body, g->share, grasp->gather);
        take_gathered(grasp, g, body);
        return;
    }
    for (int i = 0; i < body->n_shown && same; i++) g->share[i] = b->share[i];
    for (int i = 0; i < body->n_shown && found; i++)
        if (g->share[i] > 0) add_vertex(grasp, body, i, g->share[i] / WHOLE);
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
static void leave(const grip *g, const grip *b, const double force_N[3], const pal_component_transfer *by)
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
static void move_hold(grip *g, const pal_body *body, const grip *b, const pal_body *from)
{
    double was[3], moved[3], back[4] = {b->quat[0], -b->quat[1], -b->quat[2], -b->quat[3]};
    rest_place(g, body, moved), rest_place(b, from, was);
    pal_sub3(moved, moved, was);
    if (g->live)
        pal_mul33(moved, g->live->axes, moved);
    else
        pal_quat_rotate(moved, back, moved);
    pal_add3(g->offset, b->offset, moved);
    memcpy(g->quat, b->quat, sizeof g->quat);
    pal_copy3(g->at_m, b->at_m);
    g->reach_m = b->reach_m;
}

static void transfer(void *self, const pal_body *body, const void *before, const pal_component_transfer *by)
{
    tool_grasp *grasp = self;
    const tool_grasp *old = before;
    if (!grasp->grasp_transfer) grasp->grasp_transfer = calloc((size_t)grasp->n_tool, sizeof *grasp->grasp_transfer);
    grasp->revision = body->revision;
    for (int t = 0; t < grasp->n_tool && t < old->n_tool && grasp->grasp_transfer; t++) {
        const grip *b = &old->grip[t];
        grip *g = &grasp->grip[t];
        pal_grasp_transfer *h = &grasp->grasp_transfer[t];
        let_go(grasp, g);
        g->button = b->button;
        if (!b->fixed) continue;
        hand_nodes(grasp, g, body, b, by);
        move_hold(g, body, b, by->from);
        g->fit = b->fit;
        *h = old->grasp_transfer ? old->grasp_transfer[t] : (pal_grasp_transfer){.due = false};
        if (!h->due) {
            double v[3];
            patch_place(b, by->from, h->y, v);
            pal_scale3(h->force_N, -1, b->force);
            pal_copy3(h->hold, b->offset);
            h->k_N_m = b->firm ? b->firm->k_N_m : 0;
        }
        h->evenly = g->live != NULL;
        leave(g, b, h->force_N, by);
        g->fixed = h->due = g->n_node > 0;
    }
}

/* a grip that was handed over begins with the force that it had; damper_N: what of it the damper gives */
static void hold_on(const tool_grasp *grasp, grip *g, const pal_tool *tool, const pal_body *body, double k_N_m,
                    const double damper_N[3])
{
    pal_grasp_transfer *h = grasp->grasp_transfer ? &grasp->grasp_transfer[g - grasp->grip] : NULL;
    pal_grasp_spring s = {.k_N_m = k_N_m, .firm = g->firm != NULL};
    double v[3];
    if (!h || !h->due || !(k_N_m > 0)) return;
    patch_place(g, body, s.y, v);
    pal_copy3(s.damper_N, damper_N);
    pal_sub3(s.at_m, tool->last.position_m, body->offset_m);
    pal_quat_rotate(s.hold, tool->last.quat, g->offset);
    pal_quat_rotate(s.old_hold_m, tool->last.quat, h->hold);
    pal_grasp_transfer_begin(h, &s);
    if (g->firm) g->firm->stretch_m = pal_norm3(h->force_N) / k_N_m;
}

/* where the spring would have the patch, body frame */
static void find_goal(const tool_grasp *grasp, const grip *g, const pal_tool *tool, const pal_step *step,
                      double goal[3])
{
    pal_quat_rotate(goal, tool->next.quat, g->offset);
    pal_add3(goal, goal, tool->here_m), pal_sub3(goal, goal, step->body->offset_m);
    if (grasp->grasp_transfer) pal_grasp_transfer_add(&grasp->grasp_transfer[g - grasp->grip], step->dt_s, goal);
}

/* what the patch weighs at least, where points carry its nodes: W' C W <= sum W_i C_ii; shared by tools that hold it */
static double patch_mass(const tool_grasp *grasp, const grip *g, const pal_body *body)
{
    double ease_1_kg = 0;
    for (int i = 0; i < g->n_node; i++)
        ease_1_kg += grasp->sum_weight[g->node[i]] * pal_body_inverse_mass_1_kg(body, g->node[i]);
    return ease_1_kg > 0 ? 1 / ease_1_kg : INFINITY;
}

static void find_limits(const tool_grasp *grasp, grip *g, const pal_body *body, double dt_s)
{
    double least = INFINITY;
    if (body->interpolation) least = patch_mass(grasp, g, body);
    for (int i = 0; i < g->n_node && !body->interpolation; i++)
        if (!body->support[g->node[i]]) least = fmin(least, body->mass_kg[g->node[i]] / grasp->sum_weight[g->node[i]]);
    g->k_max_N_m = ALPHA * least / (dt_s * dt_s);
    g->c_most_Ns_m = BETA * least / dt_s;
}

static double spring_N_m(const tool_grasp *grasp, const grip *g, const pal_tool *tool)
{
    return fmin(stiffness_N_m(grasp, reach_m(grasp, tool)), g->k_max_N_m);
}

static void pull(const tool_grasp *grasp, grip *g, pal_tool *tool, pal_step *step)
{
    pal_body *body = step->body;
    double y[3], v[3], goal[3], force[3];
    find_limits(grasp, g, body, step->dt_s);
    patch_place(g, body, y, v);
    double k = spring_N_m(grasp, g, tool), c = fmin(k * grasp->damping_s, g->c_most_Ns_m), drag[3];
    for (int d = 0; d < 3; d++) drag[d] = tool->ramp * (c * (tool->velocity_m_s[d] - v[d]));
    hold_on(grasp, g, tool, body, tool->ramp * k, drag);
    find_goal(grasp, g, tool, step, goal);
    if (g->live) pal_adaptive_grasp_goal(g->live, tool->next.quat, y, v, k, step->dt_s, goal);
    for (int d = 0; d < 3; d++) force[d] = tool->ramp * (k * (goal[d] - y[d]) + c * (tool->velocity_m_s[d] - v[d]));
    pal_set3(g->force, 0, 0, 0);
    if (!pal_finite3(force)) return;
    double most = 0;
    for (int i = 0; i < g->n_node; i++) most = fmax(most, g->weight[i]);
    double size = most * pal_norm3(force), room = 1;
    if (body->load_cap_N > 0 && size > body->load_cap_N) room = body->load_cap_N / size;
    pal_scale3(g->force, -1, force);
    room = fmin(room, pal_tool_force_share(tool, g->force));
    pal_scale3(g->force, room, g->force);
    for (int i = 0; i < g->n_node; i++) pal_axpy3(body->load + 3 * (size_t)g->node[i], -g->weight[i], g->force);
    pal_add3(tool->force_N, tool->force_N, g->force);
    tool->holding = true;
}

/* adds a force on the patch to `to` [n_node][3] */
static void to_nodes(const grip *g, const double force[3], double *to)
{
    for (int i = 0; i < g->n_node; i++) pal_axpy3(to + 3 * (size_t)g->node[i], g->weight[i], force);
}

/* the same with an implicit solver: the spring's force at the begin */
static void tie(const tool_grasp *grasp, grip *g, const pal_tool *tool, pal_step *step)
{
    pal_body *body = step->body;
    double y[3], v[3], goal[3], rise = RISE_S * body->length_scale_m / step->n_sub;
    patch_place(g, body, y, v);
    g->firm->k_N_m = tool->ramp * stiffness_N_m(grasp, reach_m(grasp, tool));
    hold_on(grasp, g, tool, body, g->firm->k_N_m, (double[3]){0});
    find_goal(grasp, g, tool, step, goal);
    pal_sub3(goal, goal, y);
    double cap = tool->force_cap_N * tool->ramp, way = pal_norm3(goal), k = g->firm->k_N_m, weight = 0;
    for (int i = 0; i < g->n_node; i++) weight = fmax(weight, g->weight[i]);
    if (body->load_cap_N > 0) cap = fmin(cap, body->load_cap_N / weight);
    double kept = fmin(g->firm->stretch_m, BELOW_CAP * cap / k);
    double lead = pal_grasp_compliance_along(&g->firm->compliance, k, fmin(k, g->fit.k_N_m), goal);
    double most = kept + fmin(rise, (BELOW_CAP * cap - k * kept) / lead);
    if (way > most) pal_scale3(goal, most / way, goal);
    g->pulls = pal_finite3(goal);
    g->firm->constant = g->firm->settled = g->firm->found = false;
    pal_set3(g->force, 0, 0, 0);
    if (!g->pulls) return;
    pal_scale3(g->firm->pull, g->firm->k_N_m, goal);
    pal_copy3(g->firm->load, g->firm->pull);
    to_nodes(g, g->firm->load, body->load);
}

/* the bilateral part for a haptic bridge, in the last sub-step */
static void publish(const tool_grasp *grasp, grip *g, pal_tool *tool, bool implicit)
{
    double on_tissue[3], k = implicit ? g->firm->k_N_m : spring_N_m(grasp, g, tool), *K = tool->grasp_k_N_m;
    pal_scale3(on_tissue, -1, g->force);
    pal_stiffness_fit_add(&g->fit, tool->here_m, on_tissue, FIT_PRIOR_RADII * tool->radius_m);
    g->fit.k_N_m = fmin(fmax(g->fit.k_N_m, MIN_STIFFNESS_N_M), fmax(k, MIN_STIFFNESS_N_M));
    tool->has_grasp = true;
    pal_copy3(tool->grasp_x0_m, tool->here_m);
    pal_copy3(tool->grasp_f0_N, g->force);
    K[1] = K[2] = K[4] = 0;
    K[0] = K[3] = K[5] = g->fit.k_N_m;
    double damping = k * grasp->damping_s;
    if (implicit && pal_grasp_compliance_series(&g->firm->compliance, k, K))
        g->fit.k_N_m = fmax(MIN_STIFFNESS_N_M, (K[0] + K[3] + K[5]) / 3);
    else if (!implicit)
        damping = fmin(damping, g->c_most_Ns_m);
    tool->grasp_b_Ns_m = damping * g->fit.k_N_m / fmax(k, MIN_STIFFNESS_N_M);
}

static pal_err run(void *self, pal_step *step)
{
    tool_grasp *grasp = self;
    pal_tools *tools = step->tools;
    int n_tool = tools->n_tool < grasp->n_tool ? tools->n_tool : grasp->n_tool;
    for (int t = 0; t < n_tool; t++) {
        grip *g = &grasp->grip[t];
        if (step->sub == 0 && t == 0) follow(grasp, step->body);
        if (step->sub == 0) begin_tool(grasp, g, &tools->tool[t], step->body);
        g->pulls = false;
        if (!g->fixed || step->body->frozen) continue;
        if (step->body->implicit) {
            tie(grasp, g, &tools->tool[t], step);
            continue;
        }
        pull(grasp, g, &tools->tool[t], step);
        if (step->sub == step->n_sub - 1) publish(grasp, g, &tools->tool[t], false);
    }
    return PAL_ERR_OK;
}

/* ---- implicit solvers ---- */

static void linearise(void *self, const pal_body *body)
{
    (void)self, (void)body;
}

static void mean_of(const grip *g, const double *p, double mean[3])
{
    pal_set3(mean, 0, 0, 0);
    for (int i = 0; i < g->n_node; i++) pal_axpy3(mean, g->weight[i], p + 3 * (size_t)g->node[i]);
}

static void multiply(void *self, const pal_body *body, double k, double c, const double *p, double *out)
{
    tool_grasp *grasp = self;
    (void)body, (void)c;
    for (int t = 0; t < grasp->n_tool; t++) {
        const grip *g = &grasp->grip[t];
        if (!g->fixed || !g->pulls || g->firm->constant) continue;
        double mean[3];
        mean_of(g, p, mean);
        pal_scale3(mean, k * g->firm->k_N_m, mean);
        to_nodes(g, mean, out);
    }
}

/* the load after a stage; true: beyond a cap, it is a constant one from now on */
static bool keep_caps(grip *g, pal_tool *tool, pal_body *body, const double *moved)
{
    double mean[3], change[3], most = 0, room = 1;
    if (g->firm->constant) return false;
    mean_of(g, moved, mean);
    for (int c = 0; c < 3; c++) g->firm->load[c] = g->firm->pull[c] - g->firm->k_N_m * mean[c];
    if (!pal_finite3(g->firm->load)) pal_set3(g->firm->load, 0, 0, 0);
    pal_scale3(g->force, -1, g->firm->load);
    for (int i = 0; i < g->n_node; i++) most = fmax(most, g->weight[i]);
    double size = most * pal_norm3(g->force);
    if (body->load_cap_N > 0 && size > body->load_cap_N) room = body->load_cap_N / size;
    room = fmin(room, pal_tool_force_share(tool, g->force));
    if (room >= 1) return false;
    pal_scale3(g->firm->load, room, g->firm->load);
    pal_sub3(change, g->firm->load, g->firm->pull);
    to_nodes(g, change, body->load);
    g->firm->constant = true;
    return true;
}

/* force of one tool after a stage; true: beyond a cap */
static bool settle_tool(grip *g, pal_tool *tool, pal_body *body, const double *moved)
{
    if (g->firm->settled) pal_sub3(tool->force_N, tool->force_N, g->force);
    bool capped = keep_caps(g, tool, body, moved);
    pal_scale3(g->force, -1, g->firm->load);
    /* the stretch that this force would keep */
    g->firm->stretch_m = g->firm->k_N_m > 0 ? pal_norm3(g->firm->load) / g->firm->k_N_m : 0;
    pal_add3(tool->force_N, tool->force_N, g->force);
    g->firm->settled = true;
    tool->holding = true;
    return capped;
}

static bool settle(void *self, pal_step *step, const double *moved, bool last)
{
    tool_grasp *grasp = self;
    pal_tools *tools = step->tools;
    int n_tool = tools->n_tool < grasp->n_tool ? tools->n_tool : grasp->n_tool;
    bool again = false;
    for (int t = 0; t < n_tool; t++) {
        grip *g = &grasp->grip[t];
        if (!g->fixed || !g->pulls) continue;
        again |= settle_tool(g, &tools->tool[t], step->body, moved);
        if (!last || step->sub != step->n_sub - 1) continue;
        /* a grip that was handed over leads as the one before from its second step on */
        const bool may_continue = grasp->grasp_transfer && grasp->grasp_transfer[t].left_s > 0;
        int n_find = g->firm->found ? 0 : may_continue && g->firm->compliance.n_known < 3 ? 3 : 1;
        g->firm->found = true;
        for (int k = 0; k < n_find; k++)
            pal_grasp_compliance_update(&g->firm->compliance, step->body, g->node, g->weight, g->n_node,
                                        tools->tool[t].here_m, step->scratch);
        publish(grasp, g, &tools->tool[t], true);
    }
    return again;
}

/* the nearest vertex is taken within one and a half of the reach (close_on); what is held is, from however far */
static double how_far_m(const void *self, const pal_tool *tool)
{
    const tool_grasp *grasp = self;
    for (int t = 0; t < grasp->n_tool; t++)
        if (grasp->grip[t].fixed) return INFINITY;
    return 1.5 * reach_m(grasp, tool);
}

static const pal_tangent tangent = {.linearise = linearise, .multiply = multiply, .settle = settle};

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
