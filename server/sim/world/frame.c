/* Memory of frames. */
#include "server/sim/world/frame.h"

#include "server/sim/world/world_core.h"

#include <stdlib.h>

/* arrays of a part; no table of triangles copied yet */
static bool make_part(pal_frame_part *part, const pal_body *body, int n_vertex)
{
    const pal_levels *levels = body->dofs.levels;
    const bool adapts = body->active && n_vertex > 0;
    part->n_vertex = n_vertex;
    part->position_m = calloc(3 * (size_t)n_vertex + 1, sizeof(float));
    if (adapts) {
        part->n_slot = body->dofs.n_slot;
        part->slot = calloc(3 * (size_t)part->n_slot + 1, sizeof *part->slot);
        part->slot_log = UINT64_MAX;
        part->n_finest = levels->n_vertex[levels->n_level - 1];
        part->n_finest_spring = pal_levels_n_edge(levels, levels->n_level - 1);
    }
    if (body->interpolation) {
        part->n_point = body->n_dof;
        part->point_m = calloc(3 * (size_t)part->n_point + 1, sizeof *part->point_m);
    }
    return part->position_m && (!adapts || part->slot) && (!body->interpolation || part->point_m);
}

pal_frame *pal_frame_create(const pal_world *world)
{
    pal_frame *frame = calloc(1, sizeof *frame);
    if (!frame) return NULL;
    frame->slowdown = 1;
    for (int i = 0; i < world->plan.n_body; i++) {
        frame->part[i].n_node = world->part[i].n_node;
        if (!make_part(&frame->part[frame->n_part++], &world->plan.body[i], world->part[i].n_vertex)) {
            pal_frame_destroy(frame);
            return NULL;
        }
    }
    return frame;
}

void pal_frame_destroy(pal_frame *frame)
{
    if (!frame) return;
    for (int i = 0; i < frame->n_part; i++) {
        free(frame->part[i].position_m);
        free(frame->part[i].slot);
        free(frame->part[i].point_m);
        for (int k = 0; k < PAL_FIELD_COUNT; k++) {
            free(frame->part[i].field[k].value);
            free(frame->part[i].field[k].node);
        }
    }
    free(frame);
}

pal_err pal_frame_fit(pal_frame *frame, const pal_world *world)
{
    pal_err err = PAL_ERR_OK;
    for (int i = 0; i < frame->n_part; i++) {
        const pal_body *body = &world->plan.body[i];
        pal_frame_part *part = &frame->part[i];
        for (int k = 0; k < PAL_FIELD_COUNT; k++) {
            pal_frame_field *field = &part->field[k];
            if ((body->display.field[k] != NULL) == (field->value != NULL)) continue;
            free(field->value);
            free(field->node);
            *field = (pal_frame_field){0};
            if (!body->display.field[k]) continue;
            field->value = calloc((size_t)part->n_vertex + 1, sizeof(float));
            if (part->n_node > 0) field->node = calloc(4 * (size_t)part->n_node, sizeof(float));
            if (!field->value || (part->n_node > 0 && !field->node)) err = PAL_ERR_MEMORY;
        }
    }
    return err;
}
