/* Read access to a world: frames, hash, components, surfaces. */
#include "server/sim/world/world.h"

#include "server/base/vec3.h"
#include "server/sim/world/world_core.h"

#include <stdio.h>
#include <string.h>

static void copy_fields(const pal_body *body, pal_frame_part *to)
{
    for (int k = 0; k < PAL_FIELD_COUNT; k++) {
        const pal_shown_field *from = body->field[k];
        pal_frame_field *field = &to->field[k];
        if (!from || !field->value || field->revision == from->revision) continue;
        memcpy(field->value, from->value, sizeof(float) * (size_t)to->n_vertex);
        field->revision = from->revision;
        field->time_s = from->time_s;
    }
}

/* copies the changes of the triangle table since this frame was last filled, or all of it */
static void copy_slots(const pal_body *body, pal_frame_part *to)
{
    const pal_dofs *dofs = &body->dofs;
    size_t one = 3 * sizeof *to->slot;
    if (to->slot_log > dofs->n_log || dofs->n_log - to->slot_log > (uint64_t)dofs->n_log_room) {
        memcpy(to->slot, dofs->slot, one * (size_t)dofs->n_slot);
    } else {
        for (uint64_t i = to->slot_log; i < dofs->n_log; i++) {
            size_t place = 3 * (size_t)dofs->log[i % (uint64_t)dofs->n_log_room];
            memcpy(to->slot + place, dofs->slot + place, one);
        }
    }
    to->slot_log = dofs->n_log;
    to->n_active = body->n_active;
    to->n_spring = dofs->n_spring;
}

static void copy_part(const pal_body *body, pal_frame_part *to)
{
    copy_fields(body, to);
    const double *o = body->offset_m;
    to->revision = body->revision;
    to->frozen = body->frozen;
    memcpy(to->reason, body->reason, sizeof to->reason);
    to->safeguards = body->safeguards;
    to->n_safeguard = pal_safeguards_sum(&body->safeguards);
    to->safeguard_ns = body->safeguards.ns;
    to->asleep = body->asleep;
    bool same = to->n_output == body->n_output; /* the frame has these positions already */
    to->n_output = body->n_output;
    if (to->n_point > 0) memcpy(to->point_m, body->x, 3 * sizeof(double) * (size_t)to->n_point);
    if (to->n_slot > 0) {
        copy_slots(body, to);
        for (int k = 0; k < body->n_active && !same; k++) {
            size_t i = 3 * (size_t)body->active[k];
            for (size_t c = 0; c < 3; c++) to->position_m[i + c] = (float)((double)body->shown[i + c] + o[c]);
        }
        return;
    }
    if (same) return;
    if (o[0] == 0 && o[1] == 0 && o[2] == 0) {
        if (to->n_vertex > 0) memcpy(to->position_m, body->shown, 3 * sizeof(float) * (size_t)to->n_vertex);
        return;
    }
    for (int i = 0; i < to->n_vertex; i++)
        for (int c = 0; c < 3; c++) to->position_m[3 * i + c] = (float)(body->shown[3 * i + c] + o[c]);
}

static void copy_tool(const pal_world *w, int t, pal_frame_tool *to)
{
    const pal_tool *tool = &w->tools.tool[t];
    to->present = tool->present, to->touching = tool->touching, to->holding = tool->holding;
    to->pose = tool->last;
    to->pose_ns = w->pose_ns[t];
    pal_copy3(to->force_N, tool->mean_force_N);
    to->radius_m = tool->radius_m;
    to->n_patch = tool->n_patch;
    memcpy(to->patch, tool->patch, sizeof to->patch);
    to->has_grasp = tool->has_grasp;
    pal_copy3(to->grasp_x0_m, tool->grasp_x0_m);
    pal_copy3(to->grasp_f0_N, tool->grasp_f0_N);
    memcpy(to->grasp_k_N_m, tool->grasp_k_N_m, sizeof to->grasp_k_N_m);
    to->grasp_b_Ns_m = tool->grasp_b_Ns_m;
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
    for (int b = 0; b < out->n_part; b++) copy_part(&w->plan.body[b], &out->part[b]);
    out->n_tool = w->tools.n_tool;
    for (int t = 0; t < w->tools.n_tool; t++) copy_tool(w, t, &out->tool[t]);
    out->n_row = w->plan.n_row < PAL_FRAME_COMPONENT_MAX ? w->plan.n_row : PAL_FRAME_COMPONENT_MAX;
    for (int i = 0; i < out->n_row; i++) {
        uint64_t ns = w->plan.row[i].spent_ns;
        out->component_name[i] = w->plan.row[i].effect->name;
        out->component_body[i] = w->plan.component_body[i];
        out->component_ns[i] = ns < UINT32_MAX ? (uint32_t)ns : UINT32_MAX;
    }
}

static uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t n_byte)
{
    const unsigned char *p = bytes;
    for (size_t i = 0; i < n_byte; i++) hash = (hash ^ p[i]) * 0x100000001b3u;
    return hash;
}

uint64_t pal_world_hash(const pal_world *world)
{
    uint64_t hash = hash_bytes(0xcbf29ce484222325u, &world->tick, sizeof world->tick);
    for (int b = 0; b < world->plan.n_body; b++) {
        const pal_body *body = &world->plan.body[b];
        hash = hash_bytes(hash, body->x, 3 * sizeof(double) * (size_t)body->n_dof);
        hash = hash_bytes(hash, body->v, 3 * sizeof(double) * (size_t)body->n_dof);
        const pal_levels *levels = body->dofs.levels;
        if (levels) hash = hash_bytes(hash, body->dofs.face_state, (size_t)levels->first_face[levels->n_level]);
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

const pal_body *pal_world_view_body(const pal_world *world, int body)
{
    return &world->plan.body[body];
}

void pal_world_current_material(const pal_world *world, int body, pal_material *out)
{
    *out = world->material[body];
}

void pal_world_describe_limit(const pal_world *world, char *text, size_t n_byte)
{
    const pal_world *w = world;
    double max = 0;
    text[0] = 0;
    for (int b = 0; b < w->plan.n_body; b++) {
        const pal_body *body = &w->plan.body[b];
        const size_t room = sizeof(double) * (size_t)body->n_dof;
        if (body->interpolation || body->implicit) continue;
        memset(body->g, 0, room);
        for (int i = 0; i < w->plan.n_of[PAL_STAGE_FORCE][b]; i++) {
            const pal_component *row = &w->plan.row[w->plan.first[PAL_STAGE_FORCE][b] + i];
            if (row->effect->stiffness) row->effect->stiffness(row->self, body, body->g);
        }
        for (int k = 0; k < body->n_active; k++) {
            int i = pal_body_point(body, k);
            const double *x = body->x_rest + 3 * (size_t)i, *o = body->offset_m;
            if (body->support[i] || !(body->g[i] > max * body->mass_kg[i])) continue;
            max = body->g[i] / body->mass_kg[i];
            snprintf(text, n_byte, ", node %d at (%.4g, %.4g, %.4g) mm sets it", i, 1e3 * (x[0] + o[0]),
                     1e3 * (x[1] + o[1]), 1e3 * (x[2] + o[2]));
        }
        memset(body->g, 0, room);
    }
}

int pal_world_component_count(const pal_world *world)
{
    return world->plan.n_row;
}

const pal_component *pal_world_component(const pal_world *world, int row)
{
    return &world->plan.row[row];
}

void pal_world_component_info(const pal_world *world, int row, pal_component_info *out)
{
    const pal_component *r = &world->plan.row[row];
    *out = (pal_component_info){.name = r->effect->name,
                                .body = world->plan.body[world->plan.component_body[row]].name,
                                .stage = pal_stage_name(r->effect->stage),
                                .n_byte = r->n_byte,
                                .spent_ns = r->spent_ns,
                                .n_run = r->n_run,
                                .reason = r->reason ? r->reason : "",
                                .fixed = pal_plan_requires(&world->plan, row)};
}

int pal_world_part_count(const pal_world *world)
{
    return world->plan.n_body;
}

void pal_world_shown(const pal_world *world, int index, pal_shown *out)
{
    const pal_world_part *p = &world->part[index];
    const pal_body *body = &world->plan.body[index];
    *out = (pal_shown){.name = body->name,
                       .n_vertex = p->n_vertex,
                       .n_tri = p->n_tri,
                       .rest_m = p->rest_m,
                       .tri = p->tri,
                       .face = body->shown_face,
                       .revision = body->revision};
    if (!body->active || p->n_vertex == 0) return;
    const pal_levels *levels = body->dofs.levels;
    out->is_adaptive = true;
    out->n_coarse = levels->n_vertex[0];
    out->parent = p->parent;
    out->n_coarse_tri = levels->first_face[1];
    out->coarse_tri = levels->face;
}
