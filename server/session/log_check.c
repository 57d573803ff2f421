#include "server/session/log_check.h"

#include <stdio.h>

pal_err pal_log_check_run(const char *name, const uint8_t *bytes, size_t n_byte, const pal_scene *scene,
                          pal_log_check *out, pal_diagnostic *diag)
{
    pal_input_header *header = &out->header;
    *out = (pal_log_check){.n_change = 0};
    size_t at = 0;
    uint64_t step = 0, hash_step = 0;
    PAL_TRY(pal_input_get_header(name, bytes, n_byte, header, &at, diag));
    if (scene && (header->fingerprint != pal_scene_fingerprint(scene) || (int)header->n_tool != scene->n_tool ||
                  (int)header->n_body != scene->n_body))
        return PAL_REFUSE(
            diag, "%s: recorded from another scene or another state of it (mesh, material or entries differ)", name);
    for (;;) {
        pal_input_record record;
        pal_diagnostic bad = {""};
        const size_t begin = out->n_good = at;
        if (pal_input_get_record(name, bytes, n_byte, &at, &record, &bad)) {
            snprintf(out->cut, sizeof out->cut, "%s", bad.text);
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
        out->n_change += record.kind == PAL_INPUT_SCULPT || record.kind == PAL_INPUT_SWITCH;
        if (record.kind != PAL_INPUT_END) continue;
        if (at != n_byte)
            return PAL_REFUSE(diag, "%s: byte %zu: %zu bytes after the end record", name, at, n_byte - at);
        out->n_good = at;
        return PAL_ERR_OK;
    }
}
