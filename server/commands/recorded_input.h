/* The loads that a hand made in a recorded session: replays the log on its scene and takes them from the body that was
 * touched with the largest force. Thread: [load]. */
#ifndef PAL_COMMANDS_RECORDED_INPUT_H
#define PAL_COMMANDS_RECORDED_INPUT_H
#include "server/base/flags.h"
#include "server/calibrate/recorded_loads.h"
#include "server/commands/scene_input.h"
#include "server/session/replay.h"

typedef struct pal_recorded_input {
    pal_scene_input scene;
    pal_replay_report replay;
    pal_recorded_loads loads;
} pal_recorded_input;

/* scene: as of pal_scene_input_open; out: zeroed. Shows its progress. Errors: those of pal_scene_input_open,
 * pal_replay_run and pal_load_recorder_end; STATE: a stop was asked for. Close it also after an error. */
pal_err pal_recorded_input_open(const char *scene, const char *log, pal_flag_common *common, pal_recorded_input *out,
                                pal_diagnostic *diag);
void pal_recorded_input_close(pal_recorded_input *input); /* accepts a zeroed struct */
#endif
