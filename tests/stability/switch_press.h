/* A ball under its weight that a tool presses at its top, in several configurations, for the tests of live switches
 * under a press (server/sim/transfer/transfer.h). */
#ifndef TESTS_STABILITY_SWITCH_PRESS_H
#define TESTS_STABILITY_SWITCH_PRESS_H
#include "tests/session/session_scene.h"
#include "tests/stability/switch_beam.h"

static const pal_configuration list[] = {
    {.model = "tet_springs", .size = 8, .k_area_J = -1},
    {.model = "fem", .element = "hex8_bbar", .size = 6},
    {.model = "fem", .element = "tet4", .size = 7},
    {.model = "fem", .element = "hex8_bbar", .size = 9},
};
enum { N = sizeof list / sizeof *list, REST = 90, AFTER = 24, LATER = 50 };
static const pal_configuration right = {.model = "fem", .element = "hex8_bbar", .size = 10};
static pal_scene scene;
static pal_prepared mesh;
static pal_configured_scene *set[N + 1];

static inline void make(double friction)
{
    pal_diagnostic diag = {""};
    REQUIRE(small_scene(&scene, &mesh, 8));
    scene.body[0].material.damping_1_s = 10;
    scene.body[0].material.young_Pa = 5e4;
    scene.body[0].support[0].fraction = 0.2;
    scene.tool[0].radius_m = 0.008;
    for (int k = 0; k < scene.body[0].n_effect; k++)
        if (friction > 0 && !strcmp(scene.body[0].effect[k].name, "tool_push"))
            pal_entry_put_number(&scene.body[0].effect[k], "friction", friction, NULL);
    for (int i = 0; i <= N; i++)
        if (pal_configuration_make(&scene, 0, i < N ? &list[i] : &right, &diag, &set[i])) CHECK_FAIL("%s", diag.text);
}

static inline void unmake(void)
{
    for (int i = 0; i <= N; i++) pal_configured_scene_free(set[i]);
    pal_prepared_free(&mesh);
}

/* led onto the top from above, then sideways by `side`, and left there */
static inline void press(pal_world *w, double side)
{
    for (int k = 0; k < REST; k++) {
        double part = (double)k / REST, down = fmin(1, part / 0.3), by = fmin(1, fmax(0, (part - 0.4) / 0.3));
        const pal_pose p = at(side * by, 0, 0.062 - 0.007 * down, 0);
        pal_world_pose(w, 0, &p);
        step(w, scene.step_s, 1);
    }
}

static inline pal_transfer *carry(int i, int j, pal_world *before, pal_world *next, pal_transfer_report *r)
{
    pal_transfer *x = NULL;
    pal_diagnostic diag = {""};
    if (pal_transfer_make(&set[i]->scene, &set[j]->scene, 0, &diag, &x)) CHECK_FAIL("%s", diag.text);
    pal_transfer_apply(x, next, before, r);
    return x;
}

#endif
