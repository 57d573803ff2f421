#include "server/session/replay_changes.h"

#include "server/sim/transfer/transfer_world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

pal_err pal_replayed_begin(pal_replayed *r, const pal_scene *scene, bool changes_alone, pal_diagnostic *diag)
{
    memset(r, 0, sizeof *r);
    r->scene = scene;
    r->changes_alone = changes_alone;
    return changes_alone ? PAL_ERR_OK : pal_world_create(scene, diag, &r->world);
}

static void drop_next(pal_replayed *r)
{
    pal_world_destroy(r->next_world);
    pal_configuration_switch_free(r->next);
    free(r->next_base);
    r->next_world = NULL, r->next = NULL, r->next_base = NULL;
}

void pal_replayed_end(pal_replayed *r)
{
    drop_next(r);
    pal_world_destroy(r->world);
    for (int b = 0; b < PAL_BODY_MAX; b++) {
        pal_sculptor_destroy(r->body[b].sculptor);
        pal_sculpt_edit_free(r->body[b].edit);
        pal_configuration_switch_free(r->body[b].change);
        free(r->body[b].base);
    }
    memset(r, 0, sizeof *r);
}

/* notes the state of a component, for worlds that replace this one */
static void note_component(pal_replayed *r, const pal_input_record *record)
{
    const char *body = r->scene->body[record->index].name;
    int k = 0;
    while (k < r->n_disabled &&
           (strcmp(r->disabled[k].body, body) || strcmp(r->disabled[k].component, record->component)))
        k++;
    if (record->wanted && k < r->n_disabled) {
        memmove(&r->disabled[k], &r->disabled[k + 1], sizeof *r->disabled * (size_t)(--r->n_disabled - k));
    } else if (!record->wanted && k == r->n_disabled && k < PAL_REPLAY_DISABLED) {
        snprintf(r->disabled[k].body, PAL_NAME, "%s", body);
        snprintf(r->disabled[k].component, PAL_NAME, "%s", record->component);
        r->n_disabled++;
    }
}

/* a copy of the scene with the materials of a record; NULL: out of memory */
static pal_scene *scene_of(const pal_replayed *r, const pal_input_record *record)
{
    pal_scene *scene = malloc(sizeof *scene);
    if (!scene) return NULL;
    *scene = *r->scene;
    for (int b = 0; b < scene->n_body; b++) scene->body[b].material = record->materials[b];
    return scene;
}

static void disable_components(const pal_replayed *r, pal_world *world, const pal_scene *scene)
{
    for (int k = 0; k < r->n_disabled; k++) {
        const int b = pal_scene_find_body(scene, r->disabled[k].body);
        if (b >= 0) (void)pal_world_switch_component(world, scene, b, r->disabled[k].component, false, NULL);
    }
}

pal_err pal_replayed_need_world(pal_replayed *r, pal_diagnostic *diag)
{
    if (!r->world) PAL_TRY(pal_world_create(r->scene, diag, &r->world));
    if (r->changes_alone) disable_components(r, r->world, r->scene);
    return PAL_ERR_OK;
}

/* the world of the next scene takes the place of the present one; NULL: it is made when it is needed */
static void take_place(pal_replayed *r, pal_world *next, const pal_scene *scene, pal_session_transfer_fn *transfer,
                       void *user)
{
    if (next) {
        disable_components(r, next, scene);
        transfer(user, next, r->world);
    }
    pal_world_destroy(r->world);
    r->world = next, r->scene = scene;
}

static bool in_cells(const pal_cells *c, const pal_cells_command *k)
{
    return k->cell >= -1 && k->cell < c->n_cell && k->face >= -1 && k->face < c->n_face && k->other_face >= -1 &&
           k->other_face < c->n_face && k->edge >= -1 && k->edge < c->n_edge && k->vertex >= -1 &&
           k->vertex < c->n_vertex;
}

static pal_err sculpt(pal_replayed *r, const pal_input_record *record, pal_diagnostic *diag)
{
    const int b = record->index;
    pal_sculpt command = record->sculpt;
    pal_sculpt_edit *edit = NULL;
    pal_world *next = NULL;
    if (!r->body[b].sculptor) PAL_TRY(pal_sculptor_create(r->scene, b, diag, &r->body[b].sculptor));
    const pal_cells *cells = pal_sculptor_cells(r->body[b].sculptor);
    if (command.kind == PAL_SCULPT_CELLS && !in_cells(cells, &command.cells))
        return PAL_REFUSE(diag, "step %llu: an edit of cells that are not there", (unsigned long long)record->step);
    const size_t n_point = 3 * sizeof(double) * (size_t)command.n_point;
    pal_scene *scene = scene_of(r, record);
    double *point = malloc(n_point + 1);
    pal_err err = scene && point ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err && n_point) memcpy(point, command.point_m, n_point);
    command.point_m = n_point ? point : NULL;
    if (!err) err = pal_sculptor_prepare(r->body[b].sculptor, scene, &command, diag, &edit);
    if (!err && !r->changes_alone) err = pal_world_create(pal_sculpt_edit_scene(edit), diag, &next);
    free(scene);
    free(point);
    if (err) return pal_sculpt_edit_free(edit), err;
    take_place(r, next, pal_sculpt_edit_scene(edit), pal_sculpt_transfer, edit);
    pal_sculptor_commit(r->body[b].sculptor, edit);
    pal_sculpt_edit_free(r->body[b].edit);
    pal_configuration_switch_free(r->body[b].change);
    free(r->body[b].base);
    r->body[b].edit = edit, r->body[b].change = NULL, r->body[b].base = NULL;
    return PAL_ERR_OK;
}

static pal_err prepare(pal_replayed *r, const pal_input_record *record, pal_diagnostic *diag)
{
    const int b = record->index;
    drop_next(r); /* one that was prepared and refused */
    pal_scene *scene = scene_of(r, record);
    const pal_body_def *base = r->body[b].base;
    if (!base) base = r->next_base = malloc(sizeof *base);
    pal_err err = scene && base ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err && r->next_base) *r->next_base = r->scene->body[b];
    if (!err) err = pal_configuration_switch_prepare(scene, base, b, &record->configuration, diag, &r->next);
    if (!err && !r->changes_alone) err = pal_world_create(&r->next->set->scene, diag, &r->next_world);
    free(scene);
    r->next_body = b;
    if (err) drop_next(r);
    return err;
}

static void finish_switch(pal_replayed *r)
{
    const int b = r->next_body;
    take_place(r, r->next_world, &r->next->set->scene, pal_configuration_switch_transfer, r->next);
    pal_configuration_switch_free(r->body[b].change);
    r->body[b].change = r->next;
    if (r->next_base) r->body[b].base = r->next_base;
    r->next_world = NULL, r->next = NULL, r->next_base = NULL;
}

pal_err pal_replayed_restore(pal_replayed *r, const pal_input_record *record, pal_diagnostic *diag)
{
    PAL_TRY(pal_replayed_need_world(r, diag));
    pal_body *body = pal_world_body(r->world, record->index);
    const size_t n = 3 * sizeof(double) * (size_t)record->n_point;
    if (record->n_point != body->n_dof)
        return PAL_REFUSE(diag, "step %llu: a state of %d points for %s, which has %d",
                          (unsigned long long)record->step, record->n_point, body->name, body->n_dof);
    /* in the log they are not aligned */
    double *x = malloc(2 * n + 1), *v = x + 3 * (size_t)record->n_point;
    if (!x) return PAL_ERR_MEMORY;
    memcpy(x, record->x, n);
    memcpy(v, record->v, n);
    bool finite = true;
    for (int i = 0; i < 6 * record->n_point; i++) finite = finite && isfinite(x[i]);
    if (finite) pal_transfer_set_state(body, x, v);
    free(x);
    return finite ? PAL_ERR_OK
                  : PAL_REFUSE(diag, "step %llu: a state that is not finite", (unsigned long long)record->step);
}

static pal_err change(pal_replayed *r, const pal_input_record *record, pal_diagnostic *diag)
{
    if (record->kind == PAL_INPUT_SCULPT) return sculpt(r, record, diag);
    if (record->kind == PAL_INPUT_PREPARE) return prepare(r, record, diag);
    if (!r->next || r->next_body != record->index)
        return PAL_REFUSE(diag, "step %llu: a switch that was not prepared", (unsigned long long)record->step);
    if (record->kind == PAL_INPUT_SWITCH)
        finish_switch(r);
    else if (!r->changes_alone && pal_configuration_switch_snapshot(r->next, r->world))
        pal_configuration_switch_rehearse(r->next, r->next_world);
    return PAL_ERR_OK;
}

pal_err pal_replayed_apply(pal_replayed *r, const pal_input_record *record, pal_diagnostic *diag)
{
    if (record->kind == PAL_INPUT_RESTORE || record->kind == PAL_INPUT_STATE)
        return pal_replayed_restore(r, record, diag);
    if (record->kind > PAL_INPUT_COMPONENT) return change(r, record, diag);
    PAL_TRY(pal_replayed_need_world(r, diag));
    PAL_TRY(pal_input_apply(r->world, r->scene, record, diag));
    if (record->kind == PAL_INPUT_COMPONENT) note_component(r, record);
    return PAL_ERR_OK;
}
