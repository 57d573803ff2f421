/* The tables of effects and models. */
#include "server/sim/core/effect_list.h"

#include <string.h>

#define X(name) &pal_effect_##name,
const pal_effect *const pal_effects[PAL_EFFECT_COUNT] = {PAL_EFFECT_LIST(X)};
#undef X
#define X(name) &pal_model_##name,
const pal_model *const pal_models[PAL_MODEL_COUNT] = {PAL_MODEL_LIST(X)};
#undef X

const pal_effect *pal_effect_find(const char *name)
{
    for (int i = 0; i < PAL_EFFECT_COUNT; i++)
        if (!strcmp(pal_effects[i]->name, name)) return pal_effects[i];
    return NULL;
}

const pal_model *pal_model_find(const char *name)
{
    for (int i = 0; i < PAL_MODEL_COUNT; i++)
        if (!strcmp(pal_models[i]->name, name)) return pal_models[i];
    return NULL;
}
