/* Why a row is in a plan, and what is not there: for `palpate plan`. */
#ifndef PAL_COMMANDS_PLAN_REASONS_H
#define PAL_COMMANDS_PLAN_REASONS_H
#include "server/sim/world/world.h"

/* the words in a scene that call for an effect: "an entry \"gravity\" in effects"; returns text */
const char *pal_effect_words(const char *name, char text[128]);
/* is there a row of the effect in the world, of whichever body? */
bool pal_plan_has(const pal_world *world, const char *name);
#endif
