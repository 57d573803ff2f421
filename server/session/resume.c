/* Two replays of the changes alone, at rest: the first takes the last state of the record and steps the input after it;
 * the second takes the state that the first ends with, as a replay of the record that begins there will. */
#include "server/session/resume.h"

#include "server/mesh/files/file_bytes.h"
#include "server/session/log_check.h"
#include "server/session/replay.h"
#include "server/session/replay_changes.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

struct pal_resume {
    const pal_scene *scene; /* as it was served first */
    char name[PATH_MAX];
    uint8_t *bytes;
    size_t n_byte; /* up to the last good record */
    double time_s;
    pal_replayed now; /* its world is the session's */
};

static bool is_change(pal_input_kind kind)
{
    return kind == PAL_INPUT_SCULPT || kind == PAL_INPUT_PREPARE || kind == PAL_INPUT_SWITCH ||
           kind == PAL_INPUT_MATERIAL || kind == PAL_INPUT_COMPONENT;
}

static pal_err apply(pal_replayed *r, const pal_input_record *record, pal_diagnostic *diag)
{
    if (record->kind == PAL_INPUT_RESTORE || record->kind == PAL_INPUT_STATE)
        return pal_replayed_restore(r, record, diag);
    if (record->kind > PAL_INPUT_COMPONENT) return pal_replayed_change(r, record, diag);
    pal_err err = pal_input_apply(r->world, r->scene, record, diag);
    if (!err && record->kind == PAL_INPUT_COMPONENT) pal_replayed_component(r, record);
    return err;
}

/* the changes in the first n bytes */
static pal_err change_all(const pal_resume *resume, size_t n, pal_replayed *r, pal_diagnostic *diag)
{
    pal_input_record record;
    for (size_t at = PAL_INPUT_HEADER; at < n;) {
        PAL_TRY(pal_input_get_record(resume->name, resume->bytes, resume->n_byte, &at, &record, diag));
        if (is_change(record.kind)) PAL_TRY(apply(r, &record, diag));
    }
    return PAL_ERR_OK;
}

/* where the last states of all bodies begin; 0: there are none */
static size_t find_state(const pal_resume *resume)
{
    pal_input_record record;
    size_t found = 0, begin = 0;
    int n = 0;
    for (size_t at = PAL_INPUT_HEADER, before = at; at < resume->n_byte; before = at) {
        if (pal_input_get_record(resume->name, resume->bytes, resume->n_byte, &at, &record, NULL)) break;
        const bool state = record.kind == PAL_INPUT_STATE || record.kind == PAL_INPUT_RESTORE;
        if (state && record.index == 0) begin = before, n = 0;
        if (state && record.index == n && ++n == resume->scene->n_body) found = begin;
    }
    return found;
}

/* the world at the end of the record: stepped from the last state on, or from rest. A frozen body stays frozen */
static pal_err step_on(pal_resume *resume, pal_replayed *r, pal_diagnostic *diag)
{
    pal_input_record record;
    size_t at = find_state(resume);
    uint64_t step = 0;
    bool first = at > 0;
    if (at > 0) PAL_TRY(change_all(resume, at, r, diag));
    if (at == 0) at = PAL_INPUT_HEADER;
    while (at < resume->n_byte) {
        PAL_TRY(pal_input_get_record(resume->name, resume->bytes, resume->n_byte, &at, &record, diag));
        if (first) step = record.step, first = false;
        for (; step < record.step; step++) {
            pal_err err = pal_world_step(r->world, r->scene->step_s);
            pal_world_remove_idle(r->world);
            resume->time_s = pal_world_time_s(r->world);
            if (err && err != PAL_ERR_FROZEN)
                return pal_diagnostic_set(diag, err, "%s: %s", resume->name, pal_err_text(err));
        }
        if (record.kind != PAL_INPUT_HASH && record.kind != PAL_INPUT_END) PAL_TRY(apply(r, &record, diag));
    }
    return PAL_ERR_OK;
}

static pal_err open_at_end(pal_resume *resume, pal_diagnostic *diag)
{
    pal_replayed *end = calloc(1, sizeof *end);
    pal_err err = end ? pal_replayed_begin(end, resume->scene, diag) : PAL_ERR_MEMORY;
    if (!err) err = step_on(resume, end, diag);
    if (!err) err = pal_replayed_begin(&resume->now, resume->scene, diag);
    if (!err) err = change_all(resume, resume->n_byte, &resume->now, diag);
    for (int b = 0; !err && b < resume->scene->n_body; b++) {
        const pal_body *body = pal_world_body(end->world, b);
        err = pal_replayed_restore(
            &resume->now,
            &(pal_input_record){
                .kind = PAL_INPUT_RESTORE, .index = b, .n_point = body->n_dof, .x = body->x, .v = body->v},
            diag);
    }
    if (end) pal_replayed_end(end);
    free(end);
    return err;
}

pal_err pal_resume_open(const char *path, const pal_scene *scene, pal_diagnostic *diag, pal_resume **out)
{
    pal_log_check log;
    pal_resume *resume = calloc(1, sizeof *resume);
    *out = NULL;
    if (!resume) return PAL_ERR_MEMORY;
    resume->scene = scene;
    if (!pal_input_log_newest(path, resume->name, sizeof resume->name)) return free(resume), PAL_ERR_OK;
    pal_err err = pal_file_read(resume->name, PAL_REPLAY_BYTES_MAX, &resume->bytes, &resume->n_byte, diag);
    if (!err) err = pal_log_check_run(resume->name, resume->bytes, resume->n_byte, scene, &log, diag);
    if (!err) resume->n_byte = log.n_good;
    if (!err) err = open_at_end(resume, diag);
    if (err) return pal_resume_free(resume), err;
    *out = resume;
    return PAL_ERR_OK;
}

void pal_resume_free(pal_resume *resume)
{
    if (!resume) return;
    pal_replayed_end(&resume->now);
    free(resume->bytes);
    free(resume);
}

const pal_scene *pal_resume_scene(const pal_resume *resume)
{
    return resume->now.scene;
}

const char *pal_resume_name(const pal_resume *resume)
{
    return resume->name;
}

double pal_resume_time_s(const pal_resume *resume)
{
    return resume->time_s;
}

void pal_resume_take_edits(pal_resume *resume, int body, pal_sculptor **sculptor, pal_sculpt_edit **edit,
                           pal_configuration_switch **change, pal_body_def **base)
{
    *sculptor = resume->now.body[body].sculptor, *edit = resume->now.body[body].edit;
    *change = resume->now.body[body].change, *base = resume->now.body[body].base;
    memset(&resume->now.body[body], 0, sizeof resume->now.body[body]);
}

pal_world *pal_resume_take_world(pal_resume *resume)
{
    pal_world *world = resume->now.world;
    resume->now.world = NULL;
    return world;
}

const pal_scene *pal_resume_recorded_scene(const pal_resume *resume)
{
    return resume->scene;
}

void pal_resume_record(const pal_resume *resume, pal_input_log *log)
{
    pal_input_record record;
    for (size_t at = PAL_INPUT_HEADER; at < resume->n_byte;) {
        if (pal_input_get_record(resume->name, resume->bytes, resume->n_byte, &at, &record, NULL)) return;
        record.step = 0;
        if (is_change(record.kind)) pal_input_log_put(log, &record);
    }
}
