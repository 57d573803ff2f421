/* What a hand would feel of a study's models: the rendering of the haptic bridge (server/rendering) for a device that
 * follows every command. Thread: [load]. */
#ifndef PAL_COMMANDS_RENDERED_FORCE_H
#define PAL_COMMANDS_RENDERED_FORCE_H
#include "server/study/study.h"

extern const pal_study_renderer pal_rendered_force;
#endif
