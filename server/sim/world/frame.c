/* Memory of frames. */
#include "server/sim/world/frame.h"

#include "server/sim/world/world_core.h"

#include <stdlib.h>

/* allocates the triangles of an adaptive part; no table copied yet */
static bool make_slots(pal_frame_part *part, const pal_dofs *dofs)
{
    const pal_levels *levels = dofs->levels;
    part->n_slot = dofs->n_slot;
    part->slot = calloc(3 * (size_t)part->n_slot + 1, sizeof *part->slot);
    part->slot_log = UINT64_MAX;
    part->n_finest = levels->n_vertex[levels->n_level - 1];
    part->n_finest_spring = pal_levels_n_edge(levels, levels->n_level - 1);
    return part->slot != NULL;
}

static bool make_points(pal_frame_part *part, const pal_body *body)
{
    part->n_point = body->n_dof;
    part->point_m = calloc(3 * (size_t)part->n_point + 1, sizeof *part->point_m);
    return part->point_m != NULL;
}

pal_frame *pal_frame_create(const pal_world *world)
{
    pal_frame *frame = calloc(1, sizeof *frame);
    if (!frame) return NULL;
    frame->slowdown = 1;
    for (int i = 0; i < world->plan.n_body; i++) {
        const pal_body *body = &world->plan.body[i];
        pal_frame_part *part = &frame->part[frame->n_part++];
        part->n_vertex = world->part[i].n_vertex;
        part->position_m = calloc(3 * (size_t)part->n_vertex + 1, sizeof(float));
        bool adapts = body->active && part->n_vertex > 0;
        bool made = part->position_m && (!adapts || make_slots(part, &body->dofs)) &&
                    (!body->interpolation || make_points(part, body));
        if (!made) {
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
        for (int k = 0; k < PAL_FIELD_COUNT; k++) free(frame->part[i].field[k].value);
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
            if ((body->field[k] != NULL) == (field->value != NULL)) continue;
            free(field->value);
            *field = (pal_frame_field){0};
            if (body->field[k]) field->value = calloc((size_t)part->n_vertex + 1, sizeof(float));
            if (body->field[k] && !field->value) err = PAL_ERR_MEMORY;
        }
    }
    return err;
}
