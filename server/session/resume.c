/* The world takes the last state before the moment and steps the input after it. A session with a record of its own
 * gets a second world, at rest but for the changes, which takes the positions and velocities of the first, as a replay
 * of that record will. */
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
    const char *name;
    const uint8_t *bytes;
    size_t n_byte; /* up to the last good record */
    char own_name[PATH_MAX];
    uint8_t *own_bytes; /* NULL: borrowed */
    size_t at;          /* behind the last record that has taken effect */
    uint64_t step;
    double time_s;
    pal_replayed now; /* its world is the session's */
};

static bool is_change(pal_input_kind kind)
{
    return kind == PAL_INPUT_SCULPT || kind == PAL_INPUT_PREPARE || kind == PAL_INPUT_SWITCH ||
           kind == PAL_INPUT_MATERIAL || kind == PAL_INPUT_COMPONENT;
}

static pal_err get(const pal_resume *resume, size_t *at, pal_input_record *out, pal_diagnostic *diag)
{
    return pal_input_get_record(resume->name, resume->bytes, resume->n_byte, at, out, diag);
}

/* the changes in the first n bytes */
static pal_err change_all(const pal_resume *resume, size_t n, pal_replayed *r, pal_diagnostic *diag)
{
    pal_input_record record;
    for (size_t at = PAL_INPUT_HEADER; at < n;) {
        PAL_TRY(get(resume, &at, &record, diag));
        if (is_change(record.kind)) PAL_TRY(pal_replayed_apply(r, &record, diag));
    }
    return PAL_ERR_OK;
}

/* where the last states of all bodies begin, until after `last` steps; 0: there are none */
static size_t find_state(const pal_resume *resume, uint64_t last)
{
    pal_input_record record;
    size_t found = 0, begin = 0;
    int n = 0;
    for (size_t at = PAL_INPUT_HEADER, before = at; at < resume->n_byte; before = at) {
        if (get(resume, &at, &record, NULL) || record.step > last) break;
        const bool state = record.kind == PAL_INPUT_STATE || record.kind == PAL_INPUT_RESTORE;
        if (state && record.index == 0) begin = before, n = 0;
        if (state && record.index == n && ++n == resume->scene->n_body) found = begin;
    }
    return found;
}

static pal_err step_until(pal_resume *resume, pal_replayed *r, uint64_t step, pal_diagnostic *diag)
{
    for (; resume->step < step; resume->step++) {
        pal_err err = pal_world_step(r->world, r->scene->step_s);
        pal_world_remove_idle(r->world);
        if (err && err != PAL_ERR_FROZEN) /* a frozen body stays frozen */
            return pal_diagnostic_set(diag, err, "%s: %s", resume->name, pal_err_text(err));
    }
    return PAL_ERR_OK;
}

/* Steps after which each tool closed on the tissue that it holds in a state, in order, and how many: a component that
 * is reset or made again closes anew. n: bytes before the state */
static int find_grasps(const pal_resume *resume, size_t n, uint64_t closed[PAL_TOOL_MAX])
{
    pal_input_record record;
    bool held[PAL_TOOL_MAX] = {false};
    uint64_t since[PAL_TOOL_MAX] = {0};
    for (size_t at = PAL_INPUT_HEADER; at < n;) {
        if (get(resume, &at, &record, NULL)) break;
        const bool pose = record.kind == PAL_INPUT_POSE, grasp = pose && (record.pose.buttons & PAL_POSE_GRASP);
        if (pose || record.kind == PAL_INPUT_RELEASE) {
            if (grasp && !held[record.index]) since[record.index] = record.step;
            held[record.index] = grasp;
        }
        for (int t = 0; t < PAL_TOOL_MAX; t++) {
            held[t] = held[t] && record.kind != PAL_INPUT_RESET;
            if (record.kind == PAL_INPUT_RESET_BODY || record.kind == PAL_INPUT_COMPONENT) since[t] = record.step;
        }
    }
    int n_closed = 0;
    for (int t = 0; t < PAL_TOOL_MAX; t++) {
        int k = n_closed;
        if (!held[t]) continue;
        for (; k > 0 && closed[k - 1] > since[t]; k--) closed[k] = closed[k - 1];
        closed[k] = since[t];
        n_closed++;
    }
    return n_closed;
}

static bool takes_effect(const pal_input_record *record)
{
    return record->kind != PAL_INPUT_HASH && record->kind != PAL_INPUT_END;
}

/* to the state that begins at `to`: what was input before it takes effect, without steps */
static pal_err jump(pal_resume *resume, pal_replayed *r, size_t to, pal_diagnostic *diag)
{
    pal_input_record record;
    if (to <= resume->at) return PAL_ERR_OK;
    if (!r->world) {
        PAL_TRY(change_all(resume, resume->at = to, r, diag));
        PAL_TRY(pal_replayed_need_world(r, diag));
        r->changes_alone = false;
    }
    for (size_t at = resume->at; at < to; resume->at = at) {
        PAL_TRY(get(resume, &at, &record, diag));
        if (takes_effect(&record) && record.kind != PAL_INPUT_STATE) PAL_TRY(pal_replayed_apply(r, &record, diag));
    }
    pal_world_place_tools(r->world);
    PAL_TRY(get(resume, &to, &record, diag));
    resume->step = record.step;
    return PAL_ERR_OK;
}

/* before the first record, unless the world is further already */
static pal_err begin_at_rest(pal_resume *resume, pal_replayed *r, pal_diagnostic *diag)
{
    if (resume->at > 0) return PAL_ERR_OK;
    resume->at = PAL_INPUT_HEADER;
    PAL_TRY(pal_replayed_need_world(r, diag));
    r->changes_alone = false;
    return PAL_ERR_OK;
}

static pal_err take_records(pal_resume *resume, pal_replayed *r, uint64_t last, pal_diagnostic *diag)
{
    pal_input_record record;
    for (size_t at = resume->at; at < resume->n_byte; resume->at = at) {
        PAL_TRY(get(resume, &at, &record, diag));
        if (record.step > last) break;
        PAL_TRY(step_until(resume, r, record.step, diag));
        if (takes_effect(&record)) PAL_TRY(pal_replayed_apply(r, &record, diag));
    }
    return last == UINT64_MAX ? PAL_ERR_OK : step_until(resume, r, last, diag);
}

/* The world after `last` steps, or at the end of the record: stepped from the last state on, or from rest. A state has
 * positions and velocities only. What tools hold in it they hold as they closed: each closing is stepped from the
 * state before it, and the time between is left out */
static pal_err step_on(pal_resume *resume, pal_replayed *r, uint64_t last, pal_diagnostic *diag)
{
    uint64_t closed[PAL_TOOL_MAX];
    const size_t state = find_state(resume, last);
    const int n_closed = find_grasps(resume, state, closed);
    resume->at = 0;
    for (int k = 0; k < n_closed; k++) {
        PAL_TRY(jump(resume, r, closed[k] ? find_state(resume, closed[k] - 1) : 0, diag));
        PAL_TRY(begin_at_rest(resume, r, diag));
        PAL_TRY(take_records(resume, r, closed[k] + 1, diag));
    }
    PAL_TRY(jump(resume, r, state, diag));
    PAL_TRY(begin_at_rest(resume, r, diag));
    PAL_TRY(take_records(resume, r, last, diag));
    resume->time_s = pal_world_time_s(r->world);
    return PAL_ERR_OK;
}

/* the world as a replay of the changes and of a state makes it */
static pal_err restore_from(pal_resume *resume, const pal_replayed *end, pal_diagnostic *diag)
{
    PAL_TRY(pal_replayed_begin(&resume->now, resume->scene, false, diag));
    PAL_TRY(change_all(resume, resume->at, &resume->now, diag));
    for (int b = 0; b < resume->scene->n_body; b++) {
        const pal_body *body = pal_world_body(end->world, b);
        PAL_TRY(pal_replayed_restore(
            &resume->now,
            &(pal_input_record){
                .kind = PAL_INPUT_RESTORE, .index = b, .n_point = body->n_dof, .x = body->x, .v = body->v},
            diag));
    }
    return PAL_ERR_OK;
}

static pal_err open_at(pal_resume *resume, uint64_t last, bool records, pal_diagnostic *diag)
{
    pal_replayed *end = records ? calloc(1, sizeof *end) : &resume->now;
    pal_err err = end ? pal_replayed_begin(end, resume->scene, true, diag) : PAL_ERR_MEMORY;
    if (!err) err = step_on(resume, end, last, diag);
    if (!records) return err;
    if (!err) err = restore_from(resume, end, diag);
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
    if (!pal_input_log_newest(path, resume->own_name, sizeof resume->own_name)) return free(resume), PAL_ERR_OK;
    resume->name = resume->own_name;
    pal_err err = pal_file_read(resume->name, PAL_REPLAY_BYTES_MAX, &resume->own_bytes, &resume->n_byte, diag);
    resume->bytes = resume->own_bytes;
    if (!err) err = pal_log_check_run(resume->name, resume->bytes, resume->n_byte, scene, &log, diag);
    if (!err) resume->n_byte = log.n_good;
    if (!err) err = open_at(resume, UINT64_MAX, true, diag);
    if (err) return pal_resume_free(resume), err;
    *out = resume;
    return PAL_ERR_OK;
}

pal_err pal_resume_at(const char *name, const uint8_t *bytes, size_t n_byte, const pal_scene *scene, uint64_t step,
                      bool records, pal_diagnostic *diag, pal_resume **out)
{
    pal_resume *resume = calloc(1, sizeof *resume);
    *out = NULL;
    if (!resume) return PAL_ERR_MEMORY;
    resume->name = name, resume->bytes = bytes, resume->n_byte = n_byte, resume->scene = scene;
    pal_err err = open_at(resume, step, records, diag);
    if (err) return pal_resume_free(resume), err;
    *out = resume;
    return PAL_ERR_OK;
}

void pal_resume_free(pal_resume *resume)
{
    if (!resume) return;
    pal_replayed_end(&resume->now);
    free(resume->own_bytes);
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

void pal_resume_set_time_s(pal_resume *resume, double time_s)
{
    pal_world_set_time_s(resume->now.world, resume->time_s = time_s);
}

void pal_resume_take_edits(pal_resume *resume, int body, pal_sculptor **sculptor, pal_sculpt_edit **edit,
                           pal_configuration_switch **change, pal_body_def **base)
{
    *sculptor = resume->now.body[body].sculptor, *edit = resume->now.body[body].edit;
    *change = resume->now.body[body].change, *base = resume->now.body[body].base;
    memset(&resume->now.body[body], 0, sizeof resume->now.body[body]);
}

int pal_resume_disabled(const pal_resume *resume, int k, const char **body, const char **component)
{
    if (k < resume->now.n_disabled) {
        *body = resume->now.disabled[k].body;
        *component = resume->now.disabled[k].component;
    }
    return resume->now.n_disabled;
}

const uint8_t *pal_resume_rest(const pal_resume *resume, size_t *n_byte, uint64_t *step)
{
    *n_byte = resume->n_byte - resume->at, *step = resume->step;
    return resume->bytes + resume->at;
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
    for (size_t at = PAL_INPUT_HEADER; at < resume->at;) {
        if (get(resume, &at, &record, NULL)) return;
        record.step = 0;
        if (is_change(record.kind)) pal_input_log_put(log, &record);
    }
}
