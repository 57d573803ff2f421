/* Keeps components disabled across successive sessions. */
#include "server/session/disabled_components.h"

#include <stdio.h>
#include <string.h>

static bool has_component(const pal_world *w, const char *body, const char *component)
{
    for (int i = 0; i < pal_world_component_count(w); i++) {
        pal_component_info now;
        pal_world_component_info(w, i, &now);
        if (!strcmp(now.name, component) && !strcmp(now.body, body)) return true;
    }
    return false;
}

static bool has_body(const pal_scene *scene, const char *body)
{
    for (int b = 0; b < scene->n_body; b++)
        if (!strcmp(scene->body[b].name, body)) return true;
    return false;
}

static void put(pal_disabled_components *off, const char *body, const char *component)
{
    for (int i = 0; i < off->n; i++)
        if (!strcmp(off->at[i].body, body) && !strcmp(off->at[i].component, component)) return;
    if (off->n == PAL_DISABLED_COMPONENTS_MAX) return;
    snprintf(off->at[off->n].body, PAL_NAME, "%s", body);
    snprintf(off->at[off->n++].component, PAL_NAME, "%s", component);
}

void pal_disabled_components_transfer(pal_disabled_components *to, const pal_disabled_components *from,
                                      const pal_component_info *component, int n_component, const pal_world *before,
                                      pal_world *next, const pal_scene *scene)
{
    to->n = 0;
    for (int i = 0; i < from->n; i++)
        if (!has_component(before, from->at[i].body, from->at[i].component))
            put(to, from->at[i].body, from->at[i].component);
    /* components of services belong to no body and cannot be disabled */
    for (int k = 0; k < n_component; k++)
        if (has_body(scene, component[k].body) && !has_component(before, component[k].body, component[k].name))
            put(to, component[k].body, component[k].name);
    for (int i = 0; i < to->n; i++)
        for (int b = 0; b < scene->n_body; b++)
            if (!strcmp(scene->body[b].name, to->at[i].body))
                (void)pal_world_switch_component(next, scene, b, to->at[i].component, false, NULL);
}
