/* Replays an input log. A first pass checks the whole log without a world. The second steps the world to the step of
 * each record and applies the record, exactly as the recorded session did. */
#include "server/session/replay.h"

#include "server/mesh/files/file_bytes.h"
#include "server/session/log_check.h"
#include "server/session/replay_changes.h"

#include <stdlib.h>
#include <string.h>

/* applies one record to the world, which has taken record->step steps */
static pal_err apply(pal_replayed *r, const pal_input_record *record, pal_replay_report *report, pal_diagnostic *diag)
{
    if (record->kind == PAL_INPUT_HASH || record->kind == PAL_INPUT_END) {
        report->n_hash++;
        report->last_hash = pal_world_hash(r->world);
        if (report->last_hash == record->hash)
            report->n_hash_equal++;
        else if (report->first_difference == UINT64_MAX)
            report->first_difference = record->step;
        return PAL_ERR_OK;
    }
    if (record->kind == PAL_INPUT_STATE) return PAL_ERR_OK;
    const bool pose = record->kind == PAL_INPUT_POSE, restore = record->kind == PAL_INPUT_RESTORE;
    report->n_pose += pose;
    report->n_command += !pose && !restore && record->kind != PAL_INPUT_RELEASE;
    pal_err err = pal_replayed_apply(r, record, diag);
    if (err && pose)
        return PAL_REFUSE(diag, "step %llu: the world refuses a pose that the log says it took",
                          (unsigned long long)record->step);
    return err;
}

static pal_err run(const char *name, const uint8_t *bytes, size_t n_byte, pal_replayed *r,
                   const pal_replay_watch *watch, pal_replay_report *report, pal_diagnostic *diag)
{
    pal_input_header header;
    pal_input_record record;
    size_t at = 0;
    PAL_TRY(pal_input_get_header(name, bytes, n_byte, &header, &at, diag));
    while (at < n_byte) {
        PAL_TRY(pal_input_get_record(name, bytes, n_byte, &at, &record, diag));
        for (; report->n_tick < record.step; report->n_tick++) {
            pal_err err = pal_world_step(r->world, r->scene->step_s);
            pal_world_remove_idle(r->world);
            if (err && err != PAL_ERR_FROZEN)
                return pal_diagnostic_set(diag, err, "%s: step %llu: %s", name, (unsigned long long)report->n_tick,
                                          pal_err_text(err));
            if (watch && !watch->step(watch->user, r->world, (double)at / (double)n_byte))
                return pal_diagnostic_set(diag, PAL_ERR_STATE, "%s: stopped at step %llu", name,
                                          (unsigned long long)report->n_tick);
        }
        PAL_TRY(apply(r, &record, report, diag));
    }
    return PAL_ERR_OK;
}

pal_err pal_replay_parse(const char *name, const uint8_t *bytes, size_t n_byte, const pal_scene *scene,
                         const pal_replay_watch *watch, pal_replay_report *out, pal_diagnostic *diag)
{
    pal_log_check log;
    pal_replay_report report = {.first_difference = UINT64_MAX};
    PAL_TRY(pal_log_check_run(name, bytes, n_byte, scene, &log, diag));
    n_byte = log.n_good;
    report.n_change = log.n_change;
    memcpy(report.cut, log.cut, sizeof report.cut);
    if (scene) {
        pal_replayed *replayed = calloc(1, sizeof *replayed); /* too large for the stack */
        pal_err err = replayed ? pal_replayed_begin(replayed, scene, false, diag) : PAL_ERR_MEMORY;
        if (!err) err = run(name, bytes, n_byte, replayed, watch, &report, diag);
        if (!err && watch && watch->end) watch->end(watch->user, replayed->world);
        if (replayed) pal_replayed_end(replayed);
        free(replayed);
        PAL_TRY(err);
    }
    *out = report;
    return PAL_ERR_OK;
}

pal_err pal_replay_run(const char *path, const pal_scene *scene, const pal_replay_watch *watch, pal_replay_report *out,
                       pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    PAL_TRY(pal_file_read(path, PAL_REPLAY_BYTES_MAX, &bytes, &n_byte, diag));
    pal_err err = pal_replay_parse(path, bytes, n_byte, scene, watch, out, diag);
    free(bytes);
    return err;
}
