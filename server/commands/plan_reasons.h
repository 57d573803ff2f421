/* What in a scene calls for an effect, for `palpate plan`. Thread: [load]. */
#ifndef PAL_COMMANDS_PLAN_REASONS_H
#define PAL_COMMANDS_PLAN_REASONS_H
#include "server/sim/world/world.h"

/* "an entry \"gravity\" in effects"; returns text */
const char *pal_effect_words(const char *name, char text[128]);
/* has any body of the world a component of the effect? */
bool pal_plan_has(const pal_world *world, const char *name);
#endif
