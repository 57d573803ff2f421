/* Read access to a world: frames, hash, components, surfaces. */

#include "server/base/hash.h"
#include "server/base/vec3.h"
#include "server/sim/world/shown_copies.h"
#include "server/sim/world/world.h"
#include "server/sim/world/world_core.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void copy_nodes(const pal_shown_field *from, int n_node, float *to)
{
    for (int i = 0; i < n_node; i++, to += 4) {
        for (int c = 0; c < 3; c++) to[c] = from->moved[3 * i + c];
        to[3] = (float)from->node[i];
        for (int c = 0; c < 4; c++) to[c] = isfinite(to[c]) ? to[c] : 0;
    }
}

/* values of the copies of vertices, of n bytes each */
static void fill_copies(const pal_shown *shown, void *values, size_t n)
{
    char *at = values;
    for (int i = shown->n_own; i < shown->n_vertex; i++)
        memcpy(at + n * (size_t)i, at + n * (size_t)shown->copy_of[i - shown->n_own], n);
}

static void copy_fields(const pal_shown *shown, const pal_body *body, pal_frame_part *to)
{
    for (int k = 0; k < PAL_FIELD_COUNT; k++) {
        const pal_shown_field *from = body->display.field[k];
        pal_frame_field *field = &to->field[k];
        if (!from || !field->value || field->revision == from->revision) continue;
        memcpy(field->value, from->value, sizeof(float) * (size_t)shown->n_own);
        fill_copies(shown, field->value, sizeof(float));
        if (field->node) copy_nodes(from, to->n_node, field->node);
        field->revision = from->revision;
        field->time_s = from->time_s;
        if (k == PAL_FIELD_ENERGY_J_M3) to->kinetic_J = from->kinetic_J, to->elastic_J = from->elastic_J;
    }
}

/* copies the changes of the triangle table since this frame was last filled, or all of it */
static void copy_slots(const pal_shown *shown, const pal_body *body, pal_frame_part *to)
{
    const pal_dofs *dofs = &body->dofs;
    size_t one = 3 * sizeof *to->slot;
    if (to->slot_log > dofs->n_log || dofs->n_log - to->slot_log > (uint64_t)dofs->n_log_room) {
        memcpy(to->slot, dofs->slot, one * (size_t)dofs->n_slot);
        for (int i = 0; i < dofs->n_slot && shown->copy_start; i++)
            pal_shown_copies_slot(shown, i, to->slot + 3 * (size_t)i, to->slot + 3 * (size_t)i);
    } else {
        for (uint64_t i = to->slot_log; i < dofs->n_log; i++) {
            const int32_t slot = dofs->log[i % (uint64_t)dofs->n_log_room];
            const size_t at = 3 * (size_t)slot;
            memcpy(to->slot + at, dofs->slot + at, one);
            if (shown->copy_start) pal_shown_copies_slot(shown, slot, to->slot + at, to->slot + at);
        }
    }
    to->slot_log = dofs->n_log;
    to->n_active = body->n_active;
    to->n_spring = dofs->n_spring;
}

static void copy_positions(const pal_body *body, int n, float *to)
{
    const double *o = body->offset_m;
    if (o[0] == 0 && o[1] == 0 && o[2] == 0) {
        if (n > 0) memcpy(to, body->display.shown, 3 * sizeof *to * (size_t)n);
        return;
    }
    for (int i = 0; i < n; i++)
        for (int c = 0; c < 3; c++) to[3 * i + c] = (float)(body->display.shown[3 * i + c] + o[c]);
}

static void copy_part(const pal_shown *shown, const pal_body *body, pal_frame_part *to)
{
    copy_fields(shown, body, to);
    const double *o = body->offset_m;
    to->revision = body->display.revision;
    to->frozen = body->frozen;
    memcpy(to->reason, body->reason, sizeof to->reason);
    to->safeguards = body->safeguards;
    to->asleep = body->asleep;
    bool same = to->n_output == body->display.n_output; /* the frame has these positions already */
    to->n_output = body->display.n_output;
    if (to->n_point > 0) memcpy(to->point_m, body->x, 3 * sizeof(double) * (size_t)to->n_point);
    if (to->n_slot > 0) {
        copy_slots(shown, body, to);
        for (int k = 0; k < body->n_active && !same; k++) {
            size_t i = 3 * (size_t)body->active[k];
            for (size_t c = 0; c < 3; c++) to->position_m[i + c] = (float)((double)body->display.shown[i + c] + o[c]);
        }
    } else if (!same) {
        copy_positions(body, shown->n_own, to->position_m);
    }
    if (!same) fill_copies(shown, to->position_m, 3 * sizeof(float));
}

static void copy_tool(const pal_world *w, int t, pal_frame_tool *to)
{
    const pal_tool *tool = &w->tools.tool[t];
    to->present = tool->present, to->touching = tool->touching, to->holding = tool->holding;
    to->pose = tool->last;
    to->pose_ns = w->pose_ns[t];
    pal_copy3(to->force_N, tool->mean_force_N);
    pal_copy3(to->end_force_N, tool->force_N);
    pal_copy3(to->torque_Nm, tool->torque_Nm);
    to->radius_m = tool->radius_m;
    to->n_patch = tool->n_patch;
    memcpy(to->patch, tool->patch, sizeof to->patch);
    to->has_grasp = tool->has_grasp;
    pal_copy3(to->grasp_x0_m, tool->grasp_x0_m);
    pal_copy3(to->grasp_f0_N, tool->grasp_f0_N);
    memcpy(to->grasp_k_N_m, tool->grasp_k_N_m, sizeof to->grasp_k_N_m);
    to->grasp_b_Ns_m = tool->grasp_b_Ns_m;
    pal_copy3(to->grasp_arm_m, tool->grasp_arm_m);
}

void pal_world_frame(const pal_world *world, pal_frame *out)
{
    const pal_world *w = world;
    out->tick = w->tick;
    out->time_s = w->time_s;
    out->end_ns = w->end_ns;
    out->step_ns = w->step_ns;
    out->n_substep = w->n_substep;
    out->watched = !w->unobserved;
    for (int b = 0; b < out->n_part; b++) copy_part(&w->part[b], &w->plan.body[b], &out->part[b]);
    out->n_tool = w->tools.n_tool;
    for (int t = 0; t < w->tools.n_tool; t++) copy_tool(w, t, &out->tool[t]);
    out->n_row = w->plan.n_component < PAL_FRAME_COMPONENT_MAX ? w->plan.n_component : PAL_FRAME_COMPONENT_MAX;
    for (int i = 0; i < out->n_row; i++) {
        uint64_t ns = w->plan.component[i].spent_ns;
        out->component_name[i] = w->plan.component[i].effect->name;
        out->component_body[i] = w->plan.component_body[i];
        out->component_ns[i] = ns < UINT32_MAX ? (uint32_t)ns : UINT32_MAX;
    }
}

uint64_t pal_world_hash(const pal_world *world)
{
    uint64_t hash = pal_hash_bytes(PAL_HASH_START, &world->tick, sizeof world->tick);
    for (int b = 0; b < world->plan.n_body; b++) {
        const pal_body *body = &world->plan.body[b];
        hash = pal_hash_bytes(hash, body->x, 3 * sizeof(double) * (size_t)body->n_dof);
        hash = pal_hash_bytes(hash, body->v, 3 * sizeof(double) * (size_t)body->n_dof);
        const pal_levels *levels = body->dofs.levels;
        if (levels) hash = pal_hash_bytes(hash, body->dofs.face_state, (size_t)levels->first_face[levels->n_level]);
    }
    return hash;
}

uint64_t pal_world_tick(const pal_world *world)
{
    return world->tick;
}

double pal_world_time_s(const pal_world *world)
{
    return world->time_s;
}

void pal_world_set_time_s(pal_world *world, double time_s)
{
    world->time_s = time_s;
}

const pal_body *pal_world_view_body(const pal_world *world, int body)
{
    return &world->plan.body[body];
}

void pal_world_current_material(const pal_world *world, int body, pal_material *out)
{
    *out = world->material[body];
}

int pal_world_limit_node(const pal_world *world, int b, double *omega2)
{
    const pal_plan *plan = &world->plan;
    pal_body *body = &plan->body[b];
    const size_t n_byte = sizeof(double) * (size_t)body->n_dof;
    int node = -1;
    *omega2 = 0;
    memset(body->g, 0, n_byte);
    for (int i = 0; i < plan->n_of[PAL_STAGE_FORCE][b] && !body->interpolation; i++) {
        const pal_component *component = &plan->component[plan->first[PAL_STAGE_FORCE][b] + i];
        if (component->effect->bounds.stiffness) component->effect->bounds.stiffness(component->self, body, body->g);
    }
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        if (!body->support[i] && body->g[i] > *omega2 * body->mass_kg[i])
            *omega2 = body->g[i] / body->mass_kg[i], node = i;
    }
    memset(body->g, 0, n_byte);
    return node;
}

void pal_world_describe_limit(const pal_world *world, char *text, size_t n_byte)
{
    double max = 0, omega2, x[3];
    text[0] = 0;
    for (int b = 0; b < world->plan.n_body; b++) {
        const pal_body *body = &world->plan.body[b];
        int i = body->implicit ? -1 : pal_world_limit_node(world, b, &omega2);
        if (i < 0 || !(omega2 > max)) continue;
        max = omega2;
        pal_add3(x, body->x_rest + 3 * (size_t)i, body->offset_m);
        snprintf(text, n_byte, ", node %d at (%.4g, %.4g, %.4g) mm sets it", i, 1e3 * x[0], 1e3 * x[1], 1e3 * x[2]);
    }
}

int pal_world_component_count(const pal_world *world)
{
    return world->plan.n_component;
}

const pal_component *pal_world_component(const pal_world *world, int index)
{
    return &world->plan.component[index];
}

void pal_world_component_info(const pal_world *world, int index, pal_component_info *out)
{
    const pal_component *r = &world->plan.component[index];
    *out = (pal_component_info){.name = r->effect->name,
                                .body = world->plan.body[world->plan.component_body[index]].name,
                                .stage = pal_stage_name(r->effect->stage),
                                .n_byte = r->n_byte,
                                .spent_ns = r->spent_ns,
                                .n_run = r->n_run,
                                .reason = r->reason ? r->reason : "",
                                .fixed = pal_plan_requires(&world->plan, index)};
}

int pal_world_find_component(const pal_world *world, int body, const char *name)
{
    const pal_plan *plan = &world->plan;
    for (int i = 0; i < plan->n_component; i++)
        if ((body < 0 || plan->component_body[i] == body) && !strcmp(plan->component[i].effect->name, name)) return i;
    return -1;
}

void pal_world_shown(const pal_world *world, int index, pal_shown *out)
{
    const pal_display *display = &world->plan.body[index].display;
    *out = world->part[index];
    out->face = display->shown_face;
    out->revision = display->revision;
}
