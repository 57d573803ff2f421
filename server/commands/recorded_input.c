/* Replays a recording and takes the loads from it. */
#include "server/commands/recorded_input.h"

#include "server/base/log.h"
#include "server/cli/report.h"

typedef struct watch {
    pal_load_recorder *recorder[PAL_BODY_MAX];
    int n_body;
    pal_flag_common *common;
} watch;

static bool step(void *user, const pal_world *world, double fraction)
{
    watch *w = user;
    for (int b = 0; b < w->n_body; b++) pal_load_recorder_step(w->recorder[b], world);
    return pal_report_continue("replay", fraction, w->common);
}

static pal_err replay(watch *w, const char *log, pal_recorded_input *out, pal_diagnostic *diag)
{
    const pal_scene *scene = out->scene.studied.scene;
    for (; w->n_body < scene->n_body; w->n_body++)
        if (pal_load_recorder_create(scene, w->n_body, &w->recorder[w->n_body]))
            return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for the loads of a recording");
    pal_replay_report whole;
    PAL_TRY(pal_replay_run(log, NULL, NULL, &whole, diag));
    if (whole.n_change > 0)
        return PAL_REFUSE(diag, "%s: the scene was edited or switched %llu times in it: loads are taken from one scene",
                          log, (unsigned long long)whole.n_change);
    PAL_TRY(pal_replay_run(log, scene, &(pal_replay_watch){.step = step, .user = w}, &out->replay, diag));
    if (out->replay.cut[0]) pal_log(PAL_LOG_WARN, "record", "%s; used up to there", out->replay.cut);
    int largest = 0;
    for (int b = 0; b < w->n_body; b++) pal_load_recorder_stop(w->recorder[b]);
    for (int b = 1; b < w->n_body; b++)
        if (pal_load_recorder_max_N(w->recorder[b]) > pal_load_recorder_max_N(w->recorder[largest])) largest = b;
    return pal_diagnostic_prefix(diag, pal_load_recorder_end(w->recorder[largest], &out->loads, diag), log);
}

pal_err pal_recorded_input_open(const char *scene, const char *log, pal_flag_common *common, pal_recorded_input *out,
                                pal_diagnostic *diag)
{
    watch w = {.common = common};
    PAL_TRY(pal_scene_input_open(scene, &out->scene, diag));
    pal_err err = replay(&w, log, out, diag);
    for (int b = 0; b < w.n_body; b++) pal_load_recorder_destroy(w.recorder[b]);
    return err;
}

void pal_recorded_input_close(pal_recorded_input *input)
{
    pal_recorded_loads_free(&input->loads);
    pal_scene_input_close(&input->scene);
}
