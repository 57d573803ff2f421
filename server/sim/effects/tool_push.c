/* A sphere presses tissue: penalty contact between each tool and the shown surface, in every sub-step.
 *
 * The surface that is touched is the one that is seen (skinned), not the staircase of voxels below it
 * (sim/contact_points.h). A proxy of the tool stays on the side it came from (sim/proxy.h). A contact point within the
 * proxy's sphere, at depth d, is pushed straight away from the proxy's centre with f = k (d - dt/2 v_away),   k =
 * stiffness_Pa_m * area, v_away being the tissue's own speed away from the proxy. The largest eigenvalue of contact
 * stiffness over mass is kept below alpha / dt^2, alpha 1.2, by a common factor on k (contact_points.h). With a and b
 * the ratios of stiffness and damping to m / dt^2 and m / dt, symplectic steps are stable for a + 2 b < 4; the solver's
 * own limit leaves a <= 1 to the tissue, contact adds a <= 1.2 and b <= 0.6. The sum of all forces is shortened to the
 * tool's cap, and in its first and last 10 steps by its ramp. The opposite force acts on the tool.
 *
 * With an implicit solver (pal_body.implicit) a sub-step is the whole step and nothing limits k but the number of its
 * iterations: k is 15 times as stiff as the tissue behind half a radius, spread over that area, with E of the tissue at
 * each point; the solver takes it implicitly, there is no damping term, and the forces are those of the end of the
 * sub-step (sim/contact_implicit.h, which also says how caps are kept). Patches are then published after the solve,
 * their k1 from the solver's compliance where it has one, at most two of them a step.
 *
 * A body that adapts (sim/adaptive_surface.h) has a solver that holds loads over a sub-step (rk4), so that they lag by
 * dt/2. With f = k (d - dt v_away), the nodes' own velocity and alpha 0.5, b = a is beyond a/2, which makes up for the
 * lag, and a + b <= 1: tissue that comes in is stopped and not thrown back. When other triangles are drawn, contact
 * changes at once, as a finer surface bulges where the coarse one was flat: `ease` then falls so far that the force
 * does not rise in that moment, and grows again in EASE_S.
 *
 * Where points carry the nodes (pal_body.embed) k is that of implicit solvers below, and central_cg is told in time
 * what the points near a tool want (pal_effect.wanted), so that its sub-steps allow it. Beyond that alpha is 0.3; the
 * bound is the sum of the points' own, which is above their eigenvalue.
 *
 * A tool that holds tissue (tool_grasp) does not push it as well: its ball would work against its own grip.
 * A tool that appears inside tissue starts at the nearest place outside. A proxy that stays farther than slip_S box
 * diagonals behind its tool for slip_s gives up and starts anew where the tool is.
 *
 * Keys: stiffness_Pa_m (0: 200 E / radius, or as above), friction (Coulomb, 0), clamp_S (0.02: correction a step, in
 * box diagonals), near_m (0: the larger of a radius and 10 mm; a patch is published within), slip_S (0.25), slip_s
 * (0.5). */
#include "server/base/vec3.h"
#include "server/sim/contact/tool_contact.h"
#include "server/sim/contact/tuning.h"

#include <math.h>
#include <string.h>

#define ALPHA         1.2
#define GAMMA         0.5
#define ALPHA_HELD    0.5
#define GAMMA_HELD    1.0
#define ALPHA_CARRIED 0.3
#define EASE_S        (1.0 / 6)
#define SAFETY        1.3
#define SHARE_RISE    1.01
#define DEEPEST_RADII 0.5
/* implicit: contact over tissue stiffness; a point that is nearly as near as the nearest belongs to a near patch */
#define STIFFER     15.0
#define NEAR_RADII  0.125
#define STILL_RADII 0.01
/* points so far from the sphere can come to points in a sub-step, with an implicit and an explicit solver */
#define COMING_RADII 1.0
#define COMING_NEAR  0.25
/* and it grows by STIFFEN a step while the proxy is kept from its tool, down again by SOFTEN while contact is shallow
 */
#define STIFFEN       1.3
#define SOFTEN        0.95
#define STIFFEST      8.0
#define SHALLOW_RADII 0.05
#define BELOW_CAP     0.98
#define LEAST_EASE    0.01
enum { CONTACT_MAX = 2048, SAMPLE_MAX = 200000, EASE_STEPS = 10, FELT_A_STEP = 2, NEAR_MAX = 256 };

typedef pal_tool_contact_implicit firm;
typedef pal_tool_contact holder;

typedef struct tool_push {
    pal_contact_points points;
    int n_tool, body_index;
    holder holder[PAL_TOOL_MAX];
    double asked_Pa_m, friction, clamp_S, asked_near_m, slip_S, slip_s;
    double young_Pa, poisson, damping_1_s, density_kg_m3;
    pal_contact_springs *springs; /* implicit solvers only */
    float *point_Pa;              /* E at each shown vertex where a region gives it, else 0 [n_vertex]; NULL: nowhere */
    int n_felt, n_step;           /* stiffnesses found in this step; steps                             */
} tool_push;

static void take_material(tool_push *push, const pal_material *material)
{
    push->young_Pa = material->young_Pa;
    push->poisson = fmin(material->poisson, PAL_POISSON_CLAMP);
    push->damping_1_s = material->damping_1_s;
    push->density_kg_m3 = material->density_kg_m3;
}

static double stiffness_Pa_m(const tool_push *push, double radius_m)
{
    return push->asked_Pa_m > 0 ? push->asked_Pa_m : 200 * push->young_Pa / radius_m;
}

/* of the tissue at a contact point */
static double young_at(const tool_push *push, int point)
{
    const pal_contact_points *points = &push->points;
    if (!push->point_Pa) return push->young_Pa;
    if (point >= points->sample.n_vertex) point = points->sample.corner[3 * (size_t)(point - points->sample.n_vertex)];
    return push->point_Pa[point] > 0 ? (double)push->point_Pa[point] : push->young_Pa;
}

/* implicit: STIFFER times 2 E b / (1 - nu^2) over the area of a contact half a radius wide, b its half-width or that of
 * an element */
static double implicit_Pa_m(const tool_push *push, int point, double radius_m, double edge_m)
{
    if (push->asked_Pa_m > 0) return push->asked_Pa_m;
    double a = 0.5 * radius_m, b = fmax(a, 0.5 * edge_m);
    return STIFFER * 2 * young_at(push, point) * b / ((1 - push->poisson * push->poisson) * M_PI * a * a);
}

static double near_m(const tool_push *push, double radius_m)
{
    return push->asked_near_m > 0 ? push->asked_near_m : fmax(radius_m, 0.010);
}

static pal_err material(void *self, const pal_body *body, const pal_material *mat, pal_diagnostic *diag)
{
    (void)body, (void)diag;
    take_material(self, mat);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    tool_push *push = self;
    (void)body;
    pal_contact_points_reset(&push->points);
    push->n_step = 0;
    for (int t = 0; t < push->n_tool; t++) {
        push->holder[t].active = false;
        push->holder[t].share = 1;
        pal_tool_contact_end_blend(&push->holder[t]);
        firm *f = push->holder[t].firm;
        if (f) pal_contact_implicit_reset(&f->press);
        if (f) f->haptic_stiffness = (pal_haptic_stiffness){0};
        pal_contact_patches_reset(&push->holder[t].patches, push->body_index * 1024);
    }
}

static pal_err read_keys(tool_push *push, pal_config_entry *item, pal_diagnostic *diag)
{
    push->clamp_S = 0.02, push->slip_S = 0.25, push->slip_s = 0.5;
    PAL_TRY(pal_entry_read_number(item, "stiffness_Pa_m", 0, 1e15, &push->asked_Pa_m, diag));
    PAL_TRY(pal_entry_read_number(item, "friction", 0, 2, &push->friction, diag));
    PAL_TRY(pal_entry_read_number(item, "clamp_S", 1e-4, 0.1, &push->clamp_S, diag));
    PAL_TRY(pal_entry_read_number(item, "near_m", 0, 1, &push->asked_near_m, diag));
    PAL_TRY(pal_entry_read_number(item, "slip_S", 0.05, 100, &push->slip_S, diag));
    PAL_TRY(pal_entry_read_number(item, "slip_s", 0, 1e9, &push->slip_s, diag));
    return pal_entry_check_unused(item, diag);
}

/* what an implicit solver's contact needs beside */
static pal_err make_implicit(tool_push *push, pal_build *build)
{
    pal_body *body = build->body;
    push->springs = PAL_NEW(build->arena, pal_contact_springs, 1);
    if (!push->springs) return PAL_ERR_MEMORY;
    PAL_TRY(pal_contact_springs_make(body, push->n_tool * (PAL_CONTACT_IMPLICIT_MAX + 2), build->arena, push->springs));
    for (int t = 0; t < push->n_tool; t++) {
        push->holder[t].firm = PAL_NEW(build->arena, firm, 1);
        if (!push->holder[t].firm) return PAL_ERR_MEMORY;
        PAL_TRY(pal_contact_implicit_make(build->arena, &push->holder[t].firm->press));
    }
    body->wants_compliance = true;
    size_t scratch = pal_haptic_stiffness_scratch(body) + (size_t)push->points.sample.max_point * 4 * sizeof(double) +
                     CONTACT_MAX + 256;
    if (build->scratch_byte < scratch) build->scratch_byte = scratch;
    return PAL_ERR_OK;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    const pal_scene *scene = build->scene;
    tool_push *push = PAL_NEW(build->arena, tool_push, 1);
    if (!push) return PAL_ERR_MEMORY;
    PAL_TRY(read_keys(push, item, build->diag));
    if (build->body->n_shown == 0)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: tool_push needs a body that shows something",
                                  item->path);
    take_material(push, &build->def->material);
    push->n_tool = scene->n_tool;
    push->body_index = (int)(build->def - scene->body);
    double low[3], high[3], min_m = INFINITY;
    pal_surface_box(&scene->body[0].mesh->surface, low, high);
    for (int t = 0; t < scene->n_tool; t++) {
        double radius = scene->tool[t].radius_m;
        min_m = fmin(min_m, radius > 0 ? radius : 0.04 * pal_dist3(low, high));
    }
    if (!(min_m > 0 && isfinite(min_m))) min_m = 0.04 * build->body->length_scale_m;
    /* the proxy keeps half a radius away from every point: points half a radius apart leave no hole for it */
    PAL_TRY(pal_contact_points_make(build->body, DEEPEST_RADII * min_m, SAMPLE_MAX, build->arena, &push->points));
    size_t n_point = (size_t)push->points.sample.max_point;
    for (int t = 0; t < push->n_tool; t++) {
        push->holder[t].list = PAL_NEW(build->arena, int32_t, n_point);
        push->holder[t].contact = PAL_NEW(build->arena, pal_contact, CONTACT_MAX);
        if (!push->holder[t].list || !push->holder[t].contact) return PAL_ERR_MEMORY;
    }
    /* positions and allowed distances of one tool's points */
    size_t scratch = n_point * 4 * sizeof(double) + 256;
    if (build->scratch_byte < scratch) build->scratch_byte = scratch;
    if (build->body->implicit || build->body->interpolation)
        PAL_TRY(pal_contact_points_young(&push->points, build->body, build->def, build->arena, &push->point_Pa));
    if (build->body->implicit) PAL_TRY(make_implicit(push, build));
    reset(push, build->body);
    *self = push;
    return PAL_ERR_OK;
}

/* the proxy's first place: the tool's own, or the nearest place outside when that is inside tissue */
static void workspace(tool_push *push, holder *h, const pal_body *body, const double at[3], double radius_m)
{
    double p[3], out[3], normal[3];
    memset(&h->proxy, 0, sizeof h->proxy);
    pal_copy3(h->proxy.x, at);
    h->active = true, h->time_behind_s = 0;
    if (h->firm) h->firm->back_m = 0, pal_copy3(h->firm->last_m, at);
    if (!pal_contact_points_nearest(&push->points, body, at, p, normal)) return;
    pal_sub3(out, at, p);
    if (pal_dot3(out, normal) > 0) {
        if (pal_norm3(out) >= DEEPEST_RADII * radius_m) return;
        pal_unit3(normal, out, 0);
    }
    pal_copy3(h->proxy.normal, normal);
    for (int c = 0; c < 3; c++) h->proxy.x[c] = p[c] + radius_m * normal[c];
}

/* once a step: is the proxy there, and which points can it meet */
static void begin_tool(tool_push *push, holder *h, const pal_tool *tool, pal_step *step)
{
    pal_body *body = step->body;
    double next[3], step_s = step->dt_s * step->n_sub;
    h->n_list = 0;
    h->nearest_m = INFINITY;
    if ((!tool->present && tool->ramp <= 0) || tool->grasped_before) {
        h->active = false;
        pal_tool_contact_end_blend(h);
        pal_contact_patches_reset(&h->patches, push->body_index * 1024);
        return;
    }
    pal_sub3(next, tool->next.position_m, body->offset_m);
    double behind = h->active ? pal_dist3(h->proxy.x, next) : 0;
    h->time_behind_s = behind > push->slip_S * body->length_scale_m ? h->time_behind_s + step_s : 0;
    if (!h->active) {
        double last[3];
        pal_sub3(last, tool->last.position_m, body->offset_m);
        workspace(push, h, body, last, tool->radius_m);
        h->ease = 1;
        /* it has neither touched nor slipped before */
        h->retriangulated = false;
        pal_set3(h->slip, 0, 0, 0);
    } else if (h->time_behind_s > push->slip_s) {
        workspace(push, h, body, next, tool->radius_m);
        pal_tool_contact_end_blend(h);
        h->ease = 0, body->safeguards.n_tool_reset++;
    }
    if (!body->active) h->ease = fmin(1, h->ease + 1.0 / EASE_STEPS);
    double reach = tool->radius_m + near_m(push, tool->radius_m);
    pal_copy3(h->limits.a, h->proxy.x), pal_copy3(h->limits.b, next);
    h->limits.radius_m = tool->radius_m;
    h->limits.max_depth_m = DEEPEST_RADII * tool->radius_m;
    h->limits.slack_m = 0.5 * (reach - tool->radius_m);
    h->n_list = pal_contact_points_collect(&push->points, body, h->proxy.x, next, reach, h->list, &h->nearest_m);
}

/* contacts of the proxy where it now is, and with an implicit solver points that may come to points in this sub-step; x
 * [n_list][3] are the points */
static void find_contacts(const tool_push *push, holder *h, const pal_body *body, const double *x)
{
    double radius = h->limits.radius_m, k_area = stiffness_Pa_m(push, radius);
    double reach = body->implicit ? (1 + COMING_RADII) * radius : radius;
    h->n_contact = 0;
    for (int i = 0; i < h->n_list && h->n_contact < CONTACT_MAX; i++) {
        double w[3];
        pal_sub3(w, x + 3 * i, h->proxy.x);
        double d2 = pal_dot3(w, w);
        if (!(d2 < reach * reach) || push->points.sample.area_m2[h->list[i]] <= 0) continue;
        pal_contact *c = &h->contact[h->n_contact++];
        double distance = sqrt(d2);
        c->point = h->list[i];
        pal_copy3(c->x, x + 3 * i);
        if (!pal_unit3(c->away, w, 1e-9 * radius)) pal_scale3(c->away, -1, h->proxy.normal);
        c->depth_m = fmin(radius - distance, h->limits.max_depth_m);
        if (body->implicit || body->interpolation) k_area = implicit_Pa_m(push, c->point, radius, body->edge_m);
        c->k_N_m = k_area * push->points.sample.area_m2[c->point];
    }
}

/* where the proxy shall go: to the tool, or as far out from it as caps ask for; it stays when the tool goes deeper and
 * is caught up with when the tool comes out */
static void hold_back(holder *h, double here[3])
{
    double move[3];
    pal_sub3(move, here, h->firm->last_m);
    pal_copy3(h->firm->last_m, here);
    if (!(h->firm->back_m > 0)) return;
    h->firm->back_m = fmax(0, h->firm->back_m - pal_dot3(move, h->proxy.normal));
    pal_axpy3(here, h->firm->back_m, h->proxy.normal);
}

/* after the solve: back so far that contact itself gives BELOW_CAP of what caps allow. Constant forces alone, shared
 * out anew in each step, would let a tool at its cap wander */
static void find_back(const tool_push *push, holder *h, const pal_tool *tool)
{
    const pal_contact_implicit *press = &h->firm->press;
    double k = 2 * push->young_Pa * tool->radius_m / (1 - push->poisson * push->poisson);
    k = pal_haptic_stiffness_max(&h->firm->haptic_stiffness, k);
    h->firm->back_m = h->firm->old_back_m;
    if (press->capped || h->firm->back_m > 0)
        h->firm->back_m = fmax(0, h->firm->back_m + 0.5 * (press->uncapped_N - BELOW_CAP * press->allowed_N) / k);
}

/* proxy and contacts of one tool in this sub-step */
static void approach(tool_push *push, holder *h, pal_tool *tool, pal_step *step)
{
    h->n_contact = 0;
    pal_set3(h->total, 0, 0, 0);
    if (!h->active) return;
    double here[3];
    pal_sub3(here, tool->here_m, step->body->offset_m);
    pal_tool_contact_blend(h, step, tool, here);
    pal_copy3(h->total, h->hold.now_N);
    h->limits.max_rise_m = push->clamp_S * step->body->length_scale_m / step->n_sub;
    h->limits.tool_move_length_m = pal_norm3(tool->velocity_m_s) * step->dt_s;
    if (step->body->implicit) hold_back(h, here);
    size_t used = pal_arena_used(step->scratch);
    double *x = PAL_NEW(step->scratch, double, 3 * (size_t)h->n_list),
           *core = PAL_NEW(step->scratch, double, h->n_list);
    if (x && core) {
        for (int i = 0; i < h->n_list; i++) pal_contact_points_position(&push->points, h->list[i], x + 3 * i);
        pal_proxy_move(&h->proxy, here, x, h->n_list, &h->limits, step->dt_s, core);
        find_contacts(push, h, step->body, x);
    }
    pal_arena_rewind(step->scratch, used);
}

/* force on one contact point: penalty with damping over a time */
static void contact_force(const tool_push *push, pal_contact *c, double k, double damping_s)
{
    double v[3];
    pal_contact_points_velocity(&push->points, c->point, v);
    double f = k * (c->depth_m - damping_s * pal_dot3(v, c->away));
    pal_scale3(c->force, f > 0 ? f : 0, c->away);
}

/* Coulomb friction: the tool's way sideways over the tissue it presses stretches a spring as stiff as the contact,
 * which slips at friction times the normal force; shared out like the normal force */
static void add_friction(tool_push *push, holder *h, const double sum[3], double stiffness, double dt_s)
{
    double size = pal_norm3(sum), drift[3], along[3], total = 0;
    if (push->friction <= 0 || !pal_unit3(along, sum, 0)) return;
    pal_copy3(drift, h->proxy.v);
    for (int i = 0; i < h->n_contact; i++) total += pal_norm3(h->contact[i].force);
    for (int i = 0; i < h->n_contact; i++) {
        double v[3];
        pal_contact_points_velocity(&push->points, h->contact[i].point, v);
        pal_axpy3(drift, -pal_norm3(h->contact[i].force) / total, v);
    }
    if (!pal_tool_contact_friction(h, along, stiffness, h->slip)) pal_axpy3(h->slip, dt_s, drift);
    pal_axpy3(h->slip, -pal_dot3(h->slip, along), along);
    double most = push->friction * size / stiffness, slip = pal_norm3(h->slip);
    if (slip > most) pal_scale3(h->slip, most / slip, h->slip);
    for (int i = 0; i < h->n_contact; i++)
        pal_axpy3(h->contact[i].force, pal_norm3(h->contact[i].force) / total * stiffness, h->slip);
}

/* how much of the asked stiffness a tool may have in this sub-step */
static void find_share(tool_push *push, int tool, int n_tool, pal_step *step)
{
    holder *h = &push->holder[tool];
    if (h->n_contact == 0) return;
    int n_share = 1;
    for (int t = 0; t < n_tool; t++) {
        const holder *other = &push->holder[t];
        if (t == tool || other->n_contact == 0 ||
            pal_dist3(other->proxy.x, h->proxy.x) > 0.5 * step->body->length_scale_m)
            continue;
        n_share += pal_contact_points_overlap(&push->points, step->body, h->contact, h->n_contact, other->contact,
                                              other->n_contact);
    }
    double rate =
        SAFETY * n_share * pal_contact_points_max_eigenvalue(&push->points, step->body, h->contact, h->n_contact);
    double alpha = step->body->active ? ALPHA_HELD : step->body->interpolation ? ALPHA_CARRIED : ALPHA;
    double most = fmax(alpha / (step->dt_s * step->dt_s), SAFETY * n_share * h->told),
           share = rate > most ? most / rate : 1;
    h->share = share < h->share ? share : fmin(share, h->share * SHARE_RISE);
}

/* of points near a proxy as they were in the last sub-step; damping over dt/2 takes as much of a step's stability */
static void wanted(void *self, const pal_body *body, double *bound_N_m)
{
    tool_push *push = self;
    for (int t = 0; t < push->n_tool; t++) {
        holder *h = &push->holder[t];
        double radius = h->limits.radius_m, reach = (1 + COMING_NEAR) * radius, x[3];
        h->told = 0;
        for (int i = 0; i < h->n_list && h->active && !body->implicit; i++) {
            int point = h->list[i];
            pal_contact_points_position(&push->points, point, x);
            if (!(pal_dist3(x, h->proxy.x) < reach)) continue;
            double k = implicit_Pa_m(push, point, radius, body->edge_m) * push->points.sample.area_m2[point];
            h->told += 0.5 * pal_contact_points_bound(&push->points, body, point, 2 * k, bound_N_m);
        }
    }
}

/* the side the tool is on, slowly */
static void follow_side(holder *h, const double before[3])
{
    double side[3];
    if (!pal_unit3(side, h->total, 0)) return;
    pal_axpy3(side, 4, before);
    pal_unit3(h->proxy.normal, side, 1e-9);
}

/* other triangles since the step before: the force does not rise in that moment; returns what it was shortened to */
static double keep_force(holder *h, double sum[3])
{
    double size = pal_norm3(sum), part = 1;
    if (h->retriangulated && size > h->uncapped_N) {
        part = fmax(h->uncapped_N / size, LEAST_EASE);
        h->ease *= part;
        pal_scale3(sum, part, sum);
        for (int i = 0; i < h->n_contact; i++) pal_scale3(h->contact[i].force, part, h->contact[i].force);
    }
    h->retriangulated = false;
    h->uncapped_N = part * size;
    return part;
}

/* forces of one tool to the nodes and back */
static void press(tool_push *push, holder *h, pal_tool *tool, pal_step *step)
{
    pal_body *body = step->body;
    if (body->active) h->ease = fmin(1, h->ease + step->dt_s / EASE_S);
    double soft = tool->ramp * h->ease * h->share * (1 - h->hold.share), sum[3] = {0}, stiffness = 0;
    double damping_s = step->dt_s * (body->active ? GAMMA_HELD : GAMMA);
    if (h->n_contact == 0 || soft <= 0) {
        pal_set3(h->slip, 0, 0, 0);
        h->uncapped_N = 0;
        return;
    }
    for (int i = 0; i < h->n_contact; i++) {
        contact_force(push, &h->contact[i], soft * h->contact[i].k_N_m, damping_s);
        pal_add3(sum, sum, h->contact[i].force);
        stiffness += soft * h->contact[i].k_N_m;
    }
    if (body->active) stiffness *= keep_force(h, sum);
    if (!pal_finite3(sum) || pal_dot3(sum, sum) == 0) return;
    add_friction(push, h, sum, stiffness, step->dt_s);
    pal_set3(sum, 0, 0, 0);
    pal_contact_points_force_begin(&push->points);
    for (int i = 0; i < h->n_contact; i++) {
        pal_contact_points_add_force(&push->points, body, h->contact[i].point, h->contact[i].force);
        pal_add3(sum, sum, h->contact[i].force);
    }
    pal_scale3(h->total, -1, sum);
    double room = fmin(pal_tool_force_share(tool, h->total), pal_contact_points_assemble(&push->points, body));
    pal_contact_points_apply(&push->points, body, room);
    pal_scale3(h->total, room, h->total);
    for (int i = 0; i < h->n_contact; i++) pal_scale3(h->contact[i].force, room, h->contact[i].force);
    pal_add3(tool->force_N, tool->force_N, h->total);
    pal_add3(h->total, h->total, h->hold.now_N);
    tool->touching = true;
    follow_side(h, h->proxy.normal);
}

/* A proxy that cannot go deeper is placed anew by tissue in each step, which is contact by steps again and trembles at
 * 60 steps a second; contact that is stiff enough lets it reach its tool. h->share is how much stiffer than asked. */
static void find_stiffening(holder *h, const pal_tool *tool, const pal_body *body)
{
    double here[3], deepest = 0, radius = tool->radius_m;
    pal_sub3(here, tool->here_m, body->offset_m);
    for (int i = 0; i < h->n_contact; i++) deepest = fmax(deepest, h->contact[i].depth_m);
    if (deepest > 0.9 * h->limits.max_depth_m && pal_dist3(here, h->proxy.x) > 0.01 * radius)
        h->share = fmin(STIFFEST, h->share * STIFFEN);
    else if (deepest < SHALLOW_RADII * radius)
        h->share = fmax(1, h->share * SOFTEN);
}

/* the same with an implicit solver: ties and the loads they begin with */
static void tie(tool_push *push, holder *h, const pal_tool *tool, pal_step *step)
{
    find_stiffening(h, tool, step->body);
    double soft = tool->ramp * h->ease * h->share * (1 - h->hold.share), move[3], stiffness = 0;
    pal_copy3(h->firm->old_side, h->proxy.normal);
    h->firm->old_back_m = h->firm->back_m;
    h->firm->published = false;
    if (step->sub == step->n_sub - 1) h->firm->old_patches = h->patches;
    h->n_contact = soft > 0 ? pal_contact_implicit_thin(h->contact, h->n_contact) : 0;
    for (int i = 0; i < h->n_contact; i++) {
        h->contact[i].k_N_m *= soft;
        if (h->contact[i].depth_m > 0) stiffness += h->contact[i].k_N_m;
    }
    (void)pal_tool_contact_friction(h, h->proxy.normal, stiffness, h->firm->press.next_slip_m);
    pal_scale3(move, step->dt_s, h->proxy.v);
    pal_contact_implicit_begin(&h->firm->press, push->springs, &push->points, step->body, h->contact, h->n_contact,
                               push->friction, move);
    h->n_contact = h->firm->press.n_contact;
}

/* k1 of a blob from the solver's compliance: as it is known, found again when it has changed and the step's budget
 * allows; x [n_list][3] are the points */
static void feel(tool_push *push, holder *h, const pal_tool *tool, pal_step *step, const double *x,
                 pal_contact_group *group)
{
    double here[3], radius = tool->radius_m, least = INFINITY, sum = 0;
    pal_sub3(here, tool->here_m, step->body->offset_m);
    h->firm->haptic_stiffness.step = push->n_step;
    if (!pal_haptic_stiffness_find(&h->firm->haptic_stiffness, group, here, STILL_RADII * radius) ||
        push->n_felt >= FELT_A_STEP)
        return;
    if (group->force_N > 0 && h->firm->press.constant) return;
    push->n_felt++;
    if (group->force_N > 0) {
        pal_haptic_stiffness_contact(&h->firm->haptic_stiffness, group, here, push->springs, h->firm->press.first,
                                     &push->points, step->body, h->contact, h->n_contact, radius, step->scratch);
        return;
    }
    /* what the sphere would lie on, were it an eighth of a radius nearer */
    int32_t point[NEAR_MAX];
    double weight[NEAR_MAX], k = 0;
    int n = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < h->n_list && n < NEAR_MAX; i++) {
            double out[3], area = push->points.sample.area_m2[h->list[i]];
            pal_sub3(out, h->proxy.x, x + 3 * i);
            double along = pal_dot3(out, group->normal), distance = pal_norm3(out);
            if (along < 0.5 * distance || area <= 0) continue;
            if (pass == 0) least = fmin(least, distance);
            if (pass == 0 || distance > least + NEAR_RADII * radius) continue;
            point[n] = h->list[i];
            k += area * implicit_Pa_m(push, point[n], radius, step->body->edge_m);
            sum += weight[n++] = area;
        }
    for (int i = 0; i < n; i++) weight[i] /= sum;
    pal_haptic_stiffness_near(&h->firm->haptic_stiffness, group, here, &push->points, step->body, point, weight, n, k,
                              step->scratch);
}

/* what a haptic bridge needs to know, in the last sub-step */
static void publish(tool_push *push, holder *h, pal_tool *tool, pal_step *step)
{
    if (!h->active) return;
    pal_contact_group group[PAL_CONTACT_PATCH_MAX];
    int n = 0;
    size_t used = pal_arena_used(step->scratch);
    double *x = PAL_NEW(step->scratch, double, 3 * (size_t)h->n_list);
    uint8_t *grouped = PAL_NEW(step->scratch, uint8_t, h->n_contact);
    if (x && grouped) {
        while (n < PAL_CONTACT_PATCH_MAX && pal_contact_group_next(h->contact, h->n_contact, grouped, &group[n])) n++;
        /* while the force of before is let go it is all of one patch */
        if (h->hold.share > 0 && pal_unit3(group[0].normal, h->total, 0)) {
            group[0].force_N = pal_norm3(h->total), group[0].gap_m = 0;
            n = 1;
        }
        for (int i = 0; i < h->n_list; i++) pal_contact_points_position(&push->points, h->list[i], x + 3 * i);
        double near = near_m(push, tool->radius_m);
        while (n < PAL_CONTACT_PATCH_MAX &&
               pal_contact_group_near(h->proxy.x, tool->radius_m, near, x, h->n_list, group, n, &group[n]))
            n++;
        for (int b = 0; b < n && step->body->compliance && h->hold.share == 0; b++)
            feel(push, h, tool, step, x, &group[b]);
    }
    pal_arena_rewind(step->scratch, used);
    double radius = tool->radius_m;
    pal_contact_patch_options rules = {
        .radius_m = radius, .k_min_N_m = MIN_STIFFNESS_N_M, .k_max_N_m = MAX_STIFFNESS_N_M, .friction = push->friction};
    rules.k_start_N_m = 2 * push->young_Pa * radius / (1 - push->poisson * push->poisson);
    rules.k_start_N_m = fmin(fmax(rules.k_start_N_m, rules.k_min_N_m), rules.k_max_N_m);
    /* drag of the tissue that moves along, about 4 radii cubed */
    rules.b_s = push->damping_1_s * 4 * push->density_kg_m3 * radius * radius * radius / rules.k_start_N_m;
    pal_contact_patches_update(&h->patches, &rules, group, n, tool);
}

static pal_err run(void *self, pal_step *step)
{
    tool_push *push = self;
    pal_tools *tools = step->tools;
    int n_tool = tools->n_tool < push->n_tool ? tools->n_tool : push->n_tool;
    if (step->body->frozen) return PAL_ERR_OK;
    if (step->sub == 0) {
        bool retriangulated = pal_contact_samples_update_topology(&push->points.sample, step->body);
        for (int t = 0; t < n_tool; t++) push->holder[t].retriangulated = retriangulated;
        pal_contact_points_begin(&push->points);
        for (int t = 0; t < n_tool; t++) begin_tool(push, &push->holder[t], &tools->tool[t], step);
    }
    pal_contact_points_update(&push->points, step->body, step->dt_s);
    for (int t = 0; t < n_tool; t++) approach(push, &push->holder[t], &tools->tool[t], step);
    if (step->body->implicit) {
        push->n_step += step->sub == 0, push->n_felt = 0;
        pal_contact_springs_begin(push->springs);
        for (int t = 0; t < n_tool; t++) tie(push, &push->holder[t], &tools->tool[t], step);
        return PAL_ERR_OK;
    }

    for (int t = 0; t < n_tool; t++) find_share(push, t, n_tool, step);
    for (int t = 0; t < n_tool; t++) press(push, &push->holder[t], &tools->tool[t], step);
    if (step->sub == step->n_sub - 1)
        for (int t = 0; t < n_tool; t++) publish(push, &push->holder[t], &tools->tool[t], step);
    return PAL_ERR_OK;
}

/* ---- implicit solvers ---- */

/* the ties of a sub-step are made by run, so there is nothing to linearise */
static void multiply(void *self, const pal_body *body, double k, double c, const double *p, double *out)
{
    (void)body, (void)c;
    pal_contact_springs_multiply(((tool_push *)self)->springs, k, p, out);
}

static bool settle(void *self, pal_step *step, const double *moved, bool last)
{
    tool_push *push = self;
    pal_tools *tools = step->tools;
    int n_tool = tools->n_tool < push->n_tool ? tools->n_tool : push->n_tool;
    bool again = false;
    pal_contact_springs_motion(push->springs, moved);
    for (int t = 0; t < n_tool; t++) {
        holder *h = &push->holder[t];
        pal_tool *tool = &tools->tool[t];
        if (!h->active) continue;
        if (!last) {
            again |= pal_press_within(&h->firm->press, push->springs, step->body, tool, h->contact);
            continue;
        }
        again |=
            pal_contact_implicit_settle(&h->firm->press, push->springs, step->body, tool, h->contact, push->friction);
        pal_add3(h->total, h->firm->press.total_N, h->hold.now_N);
        follow_side(h, h->firm->old_side);
        find_back(push, h, tool);
    }
    /* each tool in turn is the first to have its patches' stiffness found */
    for (int i = 0; i < n_tool && last && step->sub == step->n_sub - 1; i++) {
        int t = (i + push->n_step) % n_tool;
        holder *h = &push->holder[t];
        pal_tool *tool = &tools->tool[t];
        if (h->firm->published) {
            h->patches = h->firm->old_patches;
            tool->n_patch = h->firm->n_old_patch;
        }
        h->firm->n_old_patch = tool->n_patch;
        publish(push, h, tool, step);
        h->firm->published = true;
    }
    return again;
}

static void transfer(void *self, const pal_body *body, const void *before, const pal_component_transfer *by)
{
    tool_push *push = self, *old = (tool_push *)(uintptr_t)before; /* its points gathers forces, which is work room */
    for (int t = 0; t < push->n_tool && t < old->n_tool; t++) {
        double k_N_m = push->young_Pa * old->holder[t].limits.radius_m / (1 - push->poisson * push->poisson);
        pal_tool_contact_transfer(&push->holder[t], body, &old->holder[t], by->from, &old->points, by->place, k_N_m);
    }
}

static void destroy(void *self)
{
    tool_push *push = self;
    for (int t = 0; t < push->n_tool; t++) pal_tool_contact_free(&push->holder[t]);
}

/* what is pressed stays so, however far the tool goes beyond */
static double how_far_m(const void *self, const pal_tool *tool)
{
    const tool_push *push = self;
    for (int t = 0; t < push->n_tool; t++)
        if (push->holder[t].active && push->holder[t].n_contact > 0) return INFINITY;
    return tool->radius_m + near_m(push, tool->radius_m);
}

static const pal_tangent tangent = {.multiply = multiply, .settle = settle};

const pal_effect pal_effect_tool_push = {.name = "tool_push",
                                         .stage = PAL_STAGE_CONTACT,
                                         .make = make,
                                         .run = run,
                                         .material = material,
                                         .reset = reset,
                                         .transfer = transfer,
                                         .destroy = destroy,
                                         .wanted = wanted,
                                         .reach_m = how_far_m,
                                         .tangent = &tangent};
