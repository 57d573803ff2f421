/* Replays an input log. A first pass checks the whole log without a world. The second steps the world to the step of
 * each record and applies the record, exactly as the recorded session did. */
#include "server/session/replay.h"

#include "server/mesh/files/file_bytes.h"
#include "server/session/replay_changes.h"

#include <stdio.h>
#include <stdlib.h>

/* is the log ordered, and within the scene's tools and bodies? *n_good: bytes up to its end or its first bad record,
 * of which the report tells */
static pal_err check(const char *name, const uint8_t *bytes, size_t n_byte, pal_input_header *header, size_t *n_good,
                     pal_replay_report *report, pal_diagnostic *diag)
{
    size_t at = 0;
    uint64_t step = 0, hash_step = 0;
    PAL_TRY(pal_input_get_header(name, bytes, n_byte, header, &at, diag));
    for (;;) {
        pal_input_record record;
        pal_diagnostic bad = {""};
        const size_t begin = *n_good = at;
        if (pal_input_get_record(name, bytes, n_byte, &at, &record, &bad)) {
            snprintf(report->cut, sizeof report->cut, "%s", bad.text);
            return PAL_ERR_OK;
        }
        /* END first: a log with dropped records may have gaps, and the drop is the better diagnostic */
        if (record.kind == PAL_INPUT_END && record.n_dropped)
            return PAL_REFUSE(diag, "%s: %llu records were lost while the log was written", name,
                              (unsigned long long)record.n_dropped);
        if (record.step < step || record.step > hash_step + header->hash_steps)
            return PAL_REFUSE(diag, "%s: byte %zu: step %llu does not follow step %llu", name, begin,
                              (unsigned long long)record.step, (unsigned long long)step);
        step = record.step;
        if (record.kind == PAL_INPUT_HASH) hash_step = step;
        bool tool = record.kind == PAL_INPUT_POSE || record.kind == PAL_INPUT_RELEASE;
        if ((tool && record.index >= (int)header->n_tool) ||
            ((record.kind == PAL_INPUT_MATERIAL || record.kind == PAL_INPUT_BRUSH ||
              record.kind == PAL_INPUT_RESET_BODY || record.kind >= PAL_INPUT_COMPONENT) &&
             record.index >= (int)header->n_body))
            return PAL_REFUSE(diag, "%s: byte %zu: the scene has no %s %d", name, begin, tool ? "tool" : "body",
                              record.index);
        report->n_change += record.kind == PAL_INPUT_SCULPT || record.kind == PAL_INPUT_SWITCH;
        if (record.kind != PAL_INPUT_END) continue;
        if (at != n_byte)
            return PAL_REFUSE(diag, "%s: byte %zu: %zu bytes after the end record", name, at, n_byte - at);
        *n_good = at;
        return PAL_ERR_OK;
    }
}

/* applies one record to the world, which has taken record->step steps */
static pal_err apply(pal_replayed *r, const pal_input_record *record, pal_replay_report *report, pal_diagnostic *diag)
{
    pal_world *world = r->world;
    if (record->kind == PAL_INPUT_HASH || record->kind == PAL_INPUT_END) {
        report->n_hash++;
        report->last_hash = pal_world_hash(world);
        if (report->last_hash == record->hash)
            report->n_hash_equal++;
        else if (report->first_difference == UINT64_MAX)
            report->first_difference = record->step;
        return PAL_ERR_OK;
    }
    bool pose = record->kind == PAL_INPUT_POSE;
    report->n_pose += pose;
    report->n_command += !pose && record->kind != PAL_INPUT_RELEASE;
    if (record->kind > PAL_INPUT_COMPONENT) {
        return pal_replayed_change(r, record, diag);
    }
    pal_err err = pal_input_apply(world, r->scene, record, diag);
    if (!err && record->kind == PAL_INPUT_COMPONENT) pal_replayed_component(r, record);
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
    pal_input_header header;
    pal_replay_report report = {.first_difference = UINT64_MAX};
    PAL_TRY(check(name, bytes, n_byte, &header, &n_byte, &report, diag));
    if (scene) {
        if (header.fingerprint != pal_scene_fingerprint(scene) || (int)header.n_tool != scene->n_tool ||
            (int)header.n_body != scene->n_body)
            return PAL_REFUSE(diag,
                              "%s: recorded from another scene or another state of it (mesh, material or entries "
                              "differ)",
                              name);
        pal_replayed *replayed = calloc(1, sizeof *replayed); /* too large for the stack */
        pal_err err = replayed ? pal_replayed_begin(replayed, scene, diag) : PAL_ERR_MEMORY;
        if (!err) err = run(name, bytes, n_byte, replayed, watch, &report, diag);
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
