/* Component tool_push: penalty contact between the sphere of each tool and the shown surface, in every sub-step.
 *
 * A proxy of the tool stays on the side it came from (proxy.h). A contact point at depth d within the proxy's sphere is
 * pushed away from the proxy's centre with f = k d, k = stiffness_Pa_m * area, and the opposite force acts on the tool.
 * The contact regime sets k and how a solver treats it (push.h). The sum is limited to the caps (pal_tool_force_share)
 * and scaled by the tool's ramp.
 *
 * A tool that grasps tissue (tool_grasp) does not push it, because its sphere would act against its own grasp. A
 * tool that appears inside tissue starts at the nearest position outside, and again when tissue passes it while its
 * force rises. A proxy that stays farther than slip_S box diagonals behind its tool for slip_s is reset to the tool's
 * position.
 *
 * Keys: stiffness_Pa_m (0: the regime's), friction (Coulomb, 0), clamp_S (0.02: correction of penetration in 1/60 s,
 * in box diagonals), near_m (0: the larger of a radius and 10 mm; a contact patch is published within it), slip_S
 * (0.25), slip_s (0.5). */
#include "server/base/vec3.h"
#include "server/sim/contact/push.h"
#include "server/sim/contact/tuning.h"
#include "server/sim/core/blend.h"

#include <string.h>

static pal_err material(void *self, const pal_body *body, const pal_material *mat, pal_diagnostic *diag)
{
    pal_push *push = self;
    (void)body, (void)diag;
    push->material = *mat;
    push->material.poisson = fmin(mat->poisson, PAL_POISSON_CLAMP);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    pal_push *push = self;
    push->points.sub_step += 2; /* the body jumped: velocities start again */
    push->n_step = 0;
    if (body->compliance && body->compliance->reset) body->compliance->reset(body->compliance->self);
    for (int t = 0; t < push->n_tool; t++) {
        push->tool[t].active = false;
        push->tool[t].stiffness = (pal_haptic_stiffness){.next = 0};
        push->tool[t].share = 1;
        pal_tool_contact_end_blend(&push->tool[t]);
        if (push->tool[t].implicit) *push->tool[t].implicit = (pal_tool_contact_implicit){.solve.across = -1};
        pal_contact_patches_reset(&push->tool[t].patches, push->body_index * 1024);
    }
}

static pal_err read_keys(pal_push *push, pal_config_entry *entry, pal_diagnostic *diag)
{
    push->clamp_S = 0.02, push->slip_S = 0.25, push->slip_s = 0.5;
    PAL_TRY(pal_entry_read_number(entry, "stiffness_Pa_m", 0, 1e15, &push->asked_Pa_m, diag));
    PAL_TRY(pal_entry_read_number(entry, "friction", 0, 2, &push->friction, diag));
    PAL_TRY(pal_entry_read_number(entry, "clamp_S", 1e-4, 0.1, &push->clamp_S, diag));
    PAL_TRY(pal_entry_read_number(entry, "near_m", 0, 1, &push->asked_near_m, diag));
    PAL_TRY(pal_entry_read_number(entry, "slip_S", 0.05, 100, &push->slip_S, diag));
    PAL_TRY(pal_entry_read_number(entry, "slip_s", 0, 1e9, &push->slip_s, diag));
    return pal_entry_check_unused(entry, diag);
}

static pal_err make(pal_config_entry *entry, pal_build *build, void **self)
{
    const pal_scene *scene = build->scene;
    pal_push *push = PAL_NEW(build->arena, pal_push, 1);
    if (!push) return PAL_ERR_MEMORY;
    PAL_TRY(read_keys(push, entry, build->diag));
    if (build->body->display.n_shown == 0)
        return PAL_REFUSE(build->diag, "%s: tool_push needs a body with a shown surface", entry->path);
    PAL_TRY(material(push, build->body, &build->def->material, NULL));
    push->n_tool = scene->n_tool;
    push->body_index = (int)(build->def - scene->body);
    double low[3], high[3], min_m = INFINITY;
    pal_surface_box(&scene->body[0].mesh->surface, low, high);
    for (int t = 0; t < scene->n_tool; t++) {
        double radius = scene->tool[t].radius_m;
        min_m = fmin(min_m, radius > 0 ? radius : 0.04 * pal_dist3(low, high));
    }
    if (!(min_m > 0 && isfinite(min_m))) min_m = 0.04 * build->body->length_scale_m;
    /* the proxy keeps half a radius away from every point: points half a radius apart leave no gap for it */
    PAL_TRY(pal_contact_points_make(build->body, MAX_DEPTH_RADII * min_m, SAMPLE_MAX, build->arena, &push->points));
    size_t n_point = (size_t)push->points.sample.max_point;
    for (int t = 0; t < push->n_tool; t++) {
        push->tool[t].list = PAL_NEW(build->arena, int32_t, n_point);
        push->tool[t].contact = PAL_NEW(build->arena, pal_contact, CONTACT_MAX);
        if (!push->tool[t].list || !push->tool[t].contact) return PAL_ERR_MEMORY;
    }
    /* positions and allowed distances of one tool's points */
    size_t scratch = n_point * 4 * sizeof(double) + 256;
    if (build->scratch_byte < scratch) build->scratch_byte = scratch;
    if (build->body->implicit || build->body->interpolation)
        PAL_TRY(pal_contact_points_young(&push->points, build->body, build->def, build->arena, &push->point_Pa));
    push->regime = build->body->implicit        ? &pal_push_implicit
                   : build->body->active        ? &pal_push_held_load
                   : build->body->interpolation ? &pal_push_interpolated
                                                : &pal_push_explicit;
    PAL_TRY(build->body->implicit ? pal_push_make_implicit(push, build) : pal_push_make_explicit(push, build));
    reset(push, build->body);
    *self = push;
    return PAL_ERR_OK;
}

/* the contact point p [3] nearest to x and the way out there; true: x is inside tissue */
static bool is_inside(const pal_push *push, const pal_body *body, const double x[3], double p[3], double normal[3])
{
    double out[3];
    if (!pal_contact_points_nearest(&push->points, body, x, p, normal)) return false;
    pal_sub3(out, x, p);
    return pal_dot3(out, normal) <= 0;
}

/* initial position of the proxy: the tool's own, or the nearest one outside if that is inside tissue */
static void place_proxy(pal_push *push, pal_tool_contact *h, const pal_body *body, const double at[3], double radius_m)
{
    double p[3], out[3], normal[3] = {0};
    memset(&h->proxy, 0, sizeof h->proxy);
    pal_copy3(h->proxy.x, at);
    h->active = true, h->time_behind_s = 0;
    if (h->implicit) h->implicit->back_m = 0, pal_copy3(h->implicit->last_m, at);
    if (!is_inside(push, body, at, p, normal)) {
        if (pal_dot3(normal, normal) == 0) return;
        pal_sub3(out, at, p);
        if (pal_norm3(out) >= MAX_DEPTH_RADII * radius_m) return;
        pal_unit3(normal, out, 0);
    }
    pal_copy3(h->proxy.normal, normal);
    for (int c = 0; c < 3; c++) h->proxy.x[c] = p[c] + radius_m * normal[c];
}

/* Has tissue passed the proxy? It can while the tool's force rises: tissue that returns from an earlier press is not
 * held by a weak one, and the tool would stay inside it without effect */
static bool is_passed(const pal_push *push, const pal_tool_contact *h, const pal_body *body, const pal_tool *tool)
{
    double p[3], normal[3];
    return tool->present && tool->ramp < 1 && is_inside(push, body, h->proxy.x, p, normal);
}

/* once per step: places the proxy and finds the points that it can reach */
static void begin_tool(pal_push *push, pal_tool_contact *h, const pal_tool *tool, pal_step *step)
{
    pal_body *body = step->body;
    double next[3], step_s = step->dt_s * step->n_sub;
    h->n_list = 0;
    if ((!tool->present && tool->ramp <= 0) || tool->grasped_before) {
        h->active = false;
        pal_tool_contact_end_blend(h);
        pal_contact_patches_reset(&h->patches, push->body_index * 1024);
        return;
    }
    pal_sub3(next, tool->requested.position_m, body->offset_m);
    double behind = h->active ? pal_dist3(h->proxy.x, next) : 0;
    h->time_behind_s = behind > push->slip_S * body->length_scale_m ? h->time_behind_s + step_s : 0;
    if (!h->active || is_passed(push, h, body, tool)) {
        double last[3];
        pal_sub3(last, tool->last.position_m, body->offset_m);
        place_proxy(push, h, body, last, tool->radius_m);
        h->ramp = 1;
        /* no contact and no slip so far */
        h->retriangulated = false;
        pal_set3(h->slip, 0, 0, 0);
    } else if (h->time_behind_s > push->slip_s) {
        place_proxy(push, h, body, next, tool->radius_m);
        pal_tool_contact_end_blend(h);
        h->ramp = 0, body->safeguards.n_tool_reset++;
    }
    double reach = tool->radius_m + pal_push_near_m(push, tool->radius_m);
    pal_copy3(h->limits.a, h->proxy.x), pal_copy3(h->limits.b, next);
    h->limits.radius_m = tool->radius_m;
    h->limits.max_depth_m = MAX_DEPTH_RADII * tool->radius_m;
    h->limits.slack_m = 0.5 * (reach - tool->radius_m);
    h->n_list = pal_contact_points_collect(&push->points, body, h->proxy.x, next, reach, h->list);
}

/* contacts of the proxy at its present position; x [n_list][3] are the points */
static void find_contacts(const pal_push *push, pal_tool_contact *h, const pal_body *body, const double *x)
{
    /* what an implicit solver may bring into contact in this sub-step is known to it */
    double radius = h->limits.radius_m, reach = h->implicit ? 2 * radius : radius;
    h->n_contact = 0;
    for (int i = 0; i < h->n_list && h->n_contact < CONTACT_MAX; i++) {
        double w[3], area = push->points.sample.area_m2[h->list[i]];
        pal_sub3(w, x + 3 * i, h->proxy.x);
        double d2 = pal_dot3(w, w);
        if (!(d2 < reach * reach) || area <= 0) continue;
        pal_contact *c = &h->contact[h->n_contact++];
        c->point = h->list[i];
        if (!pal_unit3(c->away, w, 1e-9 * radius)) pal_scale3(c->away, -1, h->proxy.normal);
        c->depth_m = fmin(radius - sqrt(d2), h->limits.max_depth_m);
        c->k_N_m = push->regime->pressure_Pa_m(push, body, c->point, radius) * area;
    }
}

/* proxy and contacts of one tool in this sub-step */
static void approach(pal_push *push, pal_tool_contact *h, pal_tool *tool, pal_step *step)
{
    h->n_contact = 0;
    pal_set3(h->total, 0, 0, 0);
    pal_set3(h->torque_Nm, 0, 0, 0);
    if (!h->active) return;
    double here[3];
    pal_sub3(here, tool->here_m, step->body->offset_m);
    pal_tool_contact_blend(h, step, tool, here);
    pal_copy3(h->total, h->hold.now_N);
    h->ramp = pal_blend_toward(h->ramp, 1, step->dt_s, PAL_BLEND_S);
    h->limits.max_rise_m = push->clamp_S * step->body->length_scale_m * (step->dt_s / FRAME_S);
    h->limits.tool_move_length_m = pal_norm3(tool->velocity_m_s) * step->dt_s;
    if (push->regime->hold_back) push->regime->hold_back(h, here);
    size_t used = pal_arena_used(step->scratch);
    double *x = PAL_NEW(step->scratch, double, 3 * (size_t)h->n_list),
           *core = PAL_NEW(step->scratch, double, h->n_list);
    if (x && core) {
        for (int i = 0; i < h->n_list; i++) pal_contact_points_at(&push->points, h->list[i], push->points.x, x + 3 * i);
        pal_proxy_move(&h->proxy, here, x, h->n_list, &h->limits, step->dt_s, core);
        find_contacts(push, h, step->body, x);
    }
    pal_arena_rewind(step->scratch, used);
}

static pal_err run(void *self, pal_step *step)
{
    pal_push *push = self;
    pal_tools *tools = step->tools;
    int n_tool = tools->n_tool < push->n_tool ? tools->n_tool : push->n_tool;
    if (step->body->frozen) return PAL_ERR_OK;
    if (step->sub == 0) {
        bool retriangulated = pal_contact_samples_update_topology(&push->points.sample, step->body);
        for (int t = 0; t < n_tool; t++) push->tool[t].retriangulated = retriangulated;
        pal_contact_points_begin(&push->points);
        for (int t = 0; t < n_tool; t++) begin_tool(push, &push->tool[t], &tools->tool[t], step);
    }
    pal_contact_points_update(&push->points, step->body, step->dt_s);
    for (int t = 0; t < n_tool; t++) approach(push, &push->tool[t], &tools->tool[t], step);
    push->regime->act(push, n_tool, step);
    return PAL_ERR_OK;
}

static void wanted(void *self, const pal_body *body, double *bound_N_m)
{
    pal_push *push = self;
    if (push->regime == &pal_push_interpolated) pal_push_want(push, body, bound_N_m);
}

static void multiply(void *self, const pal_body *body, double k, const double *p, double *out)
{
    (void)body;
    pal_contact_springs_multiply(((pal_push *)self)->springs, k, p, out);
}

static void transfer(void *self, const pal_body *body, const void *before, const pal_component_transfer *by)
{
    pal_push *push = self, *old = (pal_push *)(uintptr_t)before; /* its points use the scratch memory of forces */
    for (int t = 0; t < push->n_tool && t < old->n_tool; t++) {
        double k_N_m = 0.5 * pal_push_punch_N_m(push, old->tool[t].limits.radius_m);
        pal_tool_contact_transfer(&push->tool[t], body, &old->tool[t], by->from, &old->points, by->place, k_N_m);
    }
}

static void destroy(void *self)
{
    pal_push *push = self;
    for (int t = 0; t < push->n_tool; t++) pal_tool_contact_free(&push->tool[t]);
}

/* a tool in contact acts at any distance */
static double reach_m(const void *self, const pal_tool *tool)
{
    const pal_push *push = self;
    for (int t = 0; t < push->n_tool; t++)
        if (push->tool[t].active && push->tool[t].n_contact > 0) return INFINITY;
    return tool->radius_m + pal_push_near_m(push, tool->radius_m);
}

static bool settle(void *self, pal_step *step, const double *moved, bool last)
{
    pal_push *push = self;
    return push->regime->settle && push->regime->settle(push, step, moved, last);
}

static const pal_tangent tangent = {.multiply = multiply, .settle = settle};

const pal_effect pal_effect_tool_push = {PAL_EFFECT("tool_push", CONTACT),
                                         .material = material,
                                         .reset = reset,
                                         .transfer = transfer,
                                         .destroy = destroy,
                                         .bounds.wanted = wanted,
                                         .sleep.reach_m = reach_m,
                                         .tangent = &tangent};
