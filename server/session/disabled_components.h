/* Disabled components of the plan, stored by name. They stay disabled across any number of successive sessions,
 * including sessions whose method has no such component. Thread: the one that opens, transfers and closes sessions. */
#ifndef PAL_SESSION_DISABLED_COMPONENTS_H
#define PAL_SESSION_DISABLED_COMPONENTS_H
#include "server/sim/world/world.h"

enum { PAL_DISABLED_COMPONENTS_MAX = 64 };

typedef struct pal_disabled_components {
    int n;
    struct {
        char body[PAL_NAME], component[PAL_NAME];
    } at[PAL_DISABLED_COMPONENTS_MAX]; /* any beyond these are enabled again by a switch */
} pal_disabled_components;

/* Disables in `next`, a new world of scene, every component that is disabled in `before`, and stores the list in *to.
 * A component counts as disabled when it was in the plan at open (component [n_component]) and no longer is, or when
 * *from lists it. */
void pal_disabled_components_transfer(pal_disabled_components *to, const pal_disabled_components *from,
                                      const pal_component_info *component, int n_component, const pal_world *before,
                                      pal_world *next, const pal_scene *scene);
#endif
