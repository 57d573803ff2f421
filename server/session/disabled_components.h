/* Rows of the plan that were switched off, by name, so that they stay off through any number of sessions that follow
 * one another, those whose methods have no such row as well. Thread: of who opens, follows and closes sessions. */
#ifndef PAL_SESSION_DISABLED_COMPONENTS_H
#define PAL_SESSION_DISABLED_COMPONENTS_H
#include "server/sim/world/world.h"

enum { PAL_DISABLED_COMPONENTS_MAX = 64 };

typedef struct pal_disabled_components {
    int n;
    struct {
        char body[PAL_NAME], row[PAL_NAME];
    } at[PAL_DISABLED_COMPONENTS_MAX]; /* more are on again after a switch */
} pal_disabled_components;

/* What is off in `before` (not in its plan though it was at open, row [n_row], or known to be off since an earlier
 * session, *from) is switched off in `next`, a new world of scene, where that has it, and kept in *to */
void pal_disabled_components_transfer(pal_disabled_components *to, const pal_disabled_components *from,
                                      const pal_component_info *row, int n_row, const pal_world *before,
                                      pal_world *next, const pal_scene *scene);
#endif
