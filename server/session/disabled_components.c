/* Keeps components disabled across successive sessions. */
#include "server/session/disabled_components.h"

#include <stdio.h>
#include <string.h>

static bool has_row(const pal_world *w, const char *body, const char *row)
{
    for (int i = 0; i < pal_world_component_count(w); i++) {
        pal_component_info now;
        pal_world_component_info(w, i, &now);
        if (!strcmp(now.name, row) && !strcmp(now.body, body)) return true;
    }
    return false;
}

static bool has_body(const pal_scene *scene, const char *body)
{
    for (int b = 0; b < scene->n_body; b++)
        if (!strcmp(scene->body[b].name, body)) return true;
    return false;
}

static void put(pal_disabled_components *off, const char *body, const char *row)
{
    for (int i = 0; i < off->n; i++)
        if (!strcmp(off->at[i].body, body) && !strcmp(off->at[i].row, row)) return;
    if (off->n == PAL_DISABLED_COMPONENTS_MAX) return;
    snprintf(off->at[off->n].body, PAL_NAME, "%s", body);
    snprintf(off->at[off->n++].row, PAL_NAME, "%s", row);
}

void pal_disabled_components_transfer(pal_disabled_components *to, const pal_disabled_components *from,
                                      const pal_component_info *row, int n_row, const pal_world *before,
                                      pal_world *next, const pal_scene *scene)
{
    to->n = 0;
    for (int i = 0; i < from->n; i++)
        if (!has_row(before, from->at[i].body, from->at[i].row)) put(to, from->at[i].body, from->at[i].row);
    /* components of services belong to no body and cannot be disabled */
    for (int k = 0; k < n_row; k++)
        if (has_body(scene, row[k].body) && !has_row(before, row[k].body, row[k].name))
            put(to, row[k].body, row[k].name);
    for (int i = 0; i < to->n; i++)
        for (int b = 0; b < scene->n_body; b++)
            if (!strcmp(scene->body[b].name, to->at[i].body))
                (void)pal_world_switch_component(next, scene, b, to->at[i].row, false, NULL);
}
