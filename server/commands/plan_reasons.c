/* The effects that a model adds stand in the table; of the others the stage tells which entry adds them, so that a new
 * effect needs no line here. */
#include "server/commands/plan_reasons.h"

#include "server/sim/core/effect_list.h"

#include <stdio.h>
#include <string.h>

static const struct {
    const char *name, *words;
} of_model[] = {{"edge_distance", "model \"tet_springs\""},
                {"face_area", "model \"tet_springs\" with k_area_J not 0"},
                {"tet_volume", "model \"tet_springs\""},
                {"tet_elastic", "model \"fem\" with element \"tet4\" or \"tet10\""},
                {"hex_elastic", "model \"fem\" with element \"hex8_bbar\" or \"hex8\""},
                {"cell_elastic", "model \"subdivision_fem\""},
                {"edge_spring", "model \"adaptive_springs\""},
                {"shape_spring", "model \"adaptive_springs\" with k_shape_N_m not 0"},
                {"refine", "model \"adaptive_springs\" with more than one level"},
                {"viscous", "material.damping_1_s above 0"}};

const char *pal_effect_words(const char *name, char text[128])
{
    const pal_effect *effect = pal_effect_find(name);
    for (size_t i = 0; i < sizeof of_model / sizeof of_model[0]; i++)
        if (!strcmp(of_model[i].name, name)) {
            snprintf(text, 128, "%s", of_model[i].words);
            return text;
        }
    if (effect && effect->stage == PAL_STAGE_SOLVE)
        snprintf(text, 128, "solver \"%s\"", name);
    else if (effect && effect->stage == PAL_STAGE_OUTPUT && strcmp(name, "field_output") != 0)
        snprintf(text, 128, "output \"%s\"", name);
    else
        snprintf(text, 128, "an entry \"%s\" in effects", name);
    return text;
}

bool pal_plan_has(const pal_world *world, const char *name)
{
    pal_component_info component;
    for (int r = 0; r < pal_world_component_count(world); r++) {
        pal_world_component_info(world, r, &component);
        if (!strcmp(component.name, name)) return true;
    }
    return false;
}
