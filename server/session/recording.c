#include "server/session/recording.h"

#include "server/mesh/files/file_bytes.h"
#include "server/session/log_check.h"
#include "server/session/replay.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* steps of one length, which a switch may change */
typedef struct span {
    uint64_t step;
    double time_s, step_s;
} span;

struct pal_recording {
    const pal_scene *scene;
    char name[PATH_MAX], cut[160];
    uint8_t *bytes;
    size_t n_byte; /* up to the last good record */
    uint64_t n_step;
    span *span; /* [n_span] */
    int n_span;
    pal_recording_mark *mark; /* [n_mark] */
    int n_mark;
    uint64_t *state; /* steps of states and of changes, as they follow, changes with CHANGE [n_state] */
    int n_state;
};

#define CHANGE (1ull << 63)

static bool grow(void **list, int n, size_t size)
{
    if (n & (n - 1)) return true; /* full at powers of two */
    void *more = realloc(*list, (size_t)(n ? 2 * n : 1) * size);
    if (more) *list = more;
    return more;
}

static bool add_span(pal_recording *r, uint64_t step, double time_s, double step_s)
{
    if (!grow((void **)&r->span, r->n_span, sizeof *r->span)) return false;
    r->span[r->n_span++] = (span){step, time_s, step_s};
    return true;
}

static bool add_mark(pal_recording *r, uint64_t step, const char *text)
{
    const double time_s = pal_recording_time_s(r, step);
    if (r->n_mark > 0 && r->mark[r->n_mark - 1].time_s == time_s && !strcmp(r->mark[r->n_mark - 1].text, text))
        return true;
    if (!grow((void **)&r->mark, r->n_mark, sizeof *r->mark)) return false;
    r->mark[r->n_mark] = (pal_recording_mark){.time_s = time_s};
    snprintf(r->mark[r->n_mark++].text, sizeof r->mark->text, "%s", text);
    return true;
}

static bool add_state(pal_recording *r, uint64_t step)
{
    if (!grow((void **)&r->state, r->n_state, sizeof *r->state)) return false;
    r->state[r->n_state++] = step;
    return true;
}

/* what people read about a record; NULL: nothing */
static const char *text_of(const pal_input_record *record)
{
    static const char *const edit[PAL_SCULPT_KINDS] = {
        [PAL_SCULPT_CELLS] = "edit",    [PAL_SCULPT_PAINT] = "paint", [PAL_SCULPT_SET_REST] = "new rest shape",
        [PAL_SCULPT_CUT] = "cut plane", [PAL_SCULPT_UNDO] = "undo",   [PAL_SCULPT_REDO] = "redo"};
    switch (record->kind) {
    case PAL_INPUT_SCULPT:
        return record->sculpt.kind < PAL_SCULPT_KINDS ? edit[record->sculpt.kind] : NULL;
    case PAL_INPUT_SWITCH:
        return "configuration";
    case PAL_INPUT_MATERIAL:
        return "material";
    case PAL_INPUT_COMPONENT:
        return record->wanted ? "component on" : "component off";
    case PAL_INPUT_RESET:
    case PAL_INPUT_RESET_BODY:
        return "reset";
    case PAL_INPUT_BRUSH:
        return record->brush.kind != PAL_BRUSH_NONE ? "brush" : NULL;
    default:
        return NULL;
    }
}

static pal_err index_all(pal_recording *r, pal_diagnostic *diag)
{
    pal_input_record record;
    double next_step_s = 0;
    if (!add_span(r, 0, 0, r->scene->step_s)) return PAL_ERR_MEMORY;
    for (size_t at = PAL_INPUT_HEADER; at < r->n_byte;) {
        const size_t begin = at;
        PAL_TRY(pal_input_get_record(r->name, r->bytes, r->n_byte, &at, &record, diag));
        const char *text = text_of(&record);
        const bool change = record.kind == PAL_INPUT_SCULPT || record.kind == PAL_INPUT_SWITCH,
                   state = record.kind == PAL_INPUT_STATE && record.index == r->scene->n_body - 1;
        bool good = !text || add_mark(r, record.step, text);
        if (record.kind == PAL_INPUT_PREPARE) {
            next_step_s = record.configuration.step_s; /* 0: as it is */
            if (next_step_s != 0 && !(next_step_s >= PAL_STEP_MIN_S && next_step_s <= PAL_STEP_MAX_S))
                return PAL_REFUSE(diag, "%s: byte %zu: a step of %g s is outside %g .. %g", r->name, begin, next_step_s,
                                  PAL_STEP_MIN_S, PAL_STEP_MAX_S);
        }
        if (record.kind == PAL_INPUT_SWITCH && next_step_s > 0)
            good = good && add_span(r, record.step, pal_recording_time_s(r, record.step), next_step_s);
        if (change || state) good = good && add_state(r, record.step | (change ? CHANGE : 0));
        if (!good) return PAL_ERR_MEMORY;
        r->n_step = record.step;
    }
    return PAL_ERR_OK;
}

pal_err pal_recording_open(const char *path, const pal_scene *scene, pal_diagnostic *diag, pal_recording **out)
{
    pal_log_check log;
    pal_recording *r = calloc(1, sizeof *r);
    *out = NULL;
    if (!r) return PAL_ERR_MEMORY;
    r->scene = scene;
    snprintf(r->name, sizeof r->name, "%s", path);
    pal_err err = pal_file_read(path, PAL_REPLAY_BYTES_MAX, &r->bytes, &r->n_byte, diag);
    if (!err) err = pal_log_check_run(path, r->bytes, r->n_byte, scene, &log, diag);
    if (!err) {
        r->n_byte = log.n_good;
        memcpy(r->cut, log.cut, sizeof r->cut);
        err = index_all(r, diag);
    }
    if (err) return pal_recording_close(r), err;
    *out = r;
    return PAL_ERR_OK;
}

void pal_recording_close(pal_recording *r)
{
    if (!r) return;
    free(r->bytes);
    free(r->span);
    free(r->mark);
    free(r->state);
    free(r);
}

const char *pal_recording_name(const pal_recording *r)
{
    return r->name;
}

const char *pal_recording_cut(const pal_recording *r)
{
    return r->cut;
}

double pal_recording_time_s(const pal_recording *r, uint64_t step)
{
    const span *s = r->span + r->n_span - 1;
    while (s > r->span && s->step > step) s--;
    return s->time_s + (double)(step - s->step) * s->step_s;
}

double pal_recording_length_s(const pal_recording *r)
{
    return pal_recording_time_s(r, r->n_step);
}

uint64_t pal_recording_step(const pal_recording *r, double time_s)
{
    const span *s = r->span + r->n_span - 1;
    while (s > r->span && s->time_s > time_s) s--;
    const double step = (double)s->step + floor((time_s - s->time_s) / s->step_s + 0.5);
    return step <= 0 ? 0 : step >= (double)r->n_step ? r->n_step : (uint64_t)step;
}

uint64_t pal_recording_behind(const pal_recording *r, uint64_t step)
{
    int k = r->n_state - 1;
    while (k >= 0 && r->state[k] != (step | CHANGE)) k--;
    /* the first one after an edit is of the next step: no other change lies between */
    return k >= 0 && k + 1 < r->n_state && !(r->state[k + 1] & CHANGE) ? r->state[k + 1] : step;
}

int pal_recording_states(const pal_recording *r)
{
    int n = 0;
    for (int k = 0; k < r->n_state; k++) n += !(r->state[k] & CHANGE);
    return n;
}

const pal_recording_mark *pal_recording_marks(const pal_recording *r, int *n)
{
    *n = r->n_mark;
    return r->mark;
}

pal_err pal_recording_seek(const pal_recording *r, uint64_t step, bool records, pal_diagnostic *diag, pal_resume **out)
{
    PAL_TRY(pal_resume_at(r->name, r->bytes, r->n_byte, r->scene, step, records, diag, out));
    /* a record begins at 0 s, and so does its replay */
    if (!records) pal_resume_set_time_s(*out, pal_recording_time_s(r, step));
    return PAL_ERR_OK;
}
