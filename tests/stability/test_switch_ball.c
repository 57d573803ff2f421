/* Live switches between unlike meshes of one organ (server/sim/transfer/transfer.h): springs on whole voxels of the
 * border and finite elements on cut ones differ in mass, in how they are held and in where their nodes are. A ball
 * under its weight that a tool presses, at the first touch, while it moves and at rest: every pair of configurations.
 * --table prints what every pair does. */
#include "tests/session/session_scene.h"
#include "tests/stability/hard_case.h"
#include "tests/stability/switch_beam.h"

static const pal_configuration list[] = {
    {.model = "tet_springs", .size = 8, .k_area_J = -1}, {.model = "tet_springs", .size = 6, .k_area_J = -1},
    {.model = "fem", .element = "hex8_bbar", .size = 6}, {.model = "fem", .element = "hex8_bbar", .size = 9},
    {.model = "fem", .element = "tet4", .size = 7},
};
enum { N = sizeof list / sizeof *list, MOMENTS = 4 };
/* steps before the touch and with it */
static const int moment[MOMENTS][2] = {{10, 1}, {0, 20}, {0, 25}, {0, 100}};

static void make(pal_scene *scene, pal_prepared *mesh, pal_configured_scene *set[N])
{
    pal_diagnostic diag = {""};
    REQUIRE(small_scene(scene, mesh, 8));
    scene->body[0].material.damping_1_s = 10;
    scene->body[0].material.young_Pa = 5e4;
    scene->body[0].support[0].fraction = 0.2;
    for (int i = 0; i < N; i++)
        if (pal_configuration_make(scene, 0, &list[i], &diag, &set[i])) CHECK_FAIL("%s", diag.text);
}

static void bring(pal_world *w, double step_s, const int steps[2])
{
    const pal_pose p = at(0, 0, 0.055, 0);
    step(w, step_s, steps[0]);
    pal_world_pose(w, 0, &p);
    step(w, step_s, steps[1]);
}

static void check_pair(pal_configured_scene *const set[N], int i, int j, int m, pal_world *before)
{
    pal_transfer *x = NULL;
    pal_transfer_report r;
    pal_diagnostic diag = {""};
    if (pal_transfer_make(&set[i]->scene, &set[j]->scene, 0, &diag, &x)) CHECK_FAIL("%s", diag.text);
    pal_world *next = open_world(&set[j]->scene);
    pal_transfer_apply(x, next, before, &r);
    double off = 100 * (r.energy_after_J / r.energy_before_J - 1), max = 0;
    const pal_body *b = pal_world_body(before, 0);
    for (int k = 0; k < b->n_node; k++) max = fmax(max, pal_dist3(b->d + 3 * k, b->node_rest + 3 * k));
    if (table)
        printf("  %d: %d -> %d energy %+6.1f %% by interpolation, %+6.3f %%; %2d rounds, scale %.4f; moved %.3f of "
               "%.3f mm\n",
               m, i, j, 100 * (r.interpolated_J / r.energy_before_J - 1), off, r.n_smooth, r.scale, 1e3 * r.max_move_m,
               1e3 * max);
    CHECK(r.energy_before_J > 1e-6);
    HARD_CASE("switch", list[j].model, "to it from unlike meshes of a pressed ball: energy jumps by", fabs(off), 2,
              "%");
    step(next, set[j]->scene.step_s, 4);
    CHECK(pal_body_finite(pal_world_body(next, 0)) && !pal_world_body(next, 0)->frozen);
    pal_world_destroy(next);
    pal_transfer_free(x);
}

static void every_pair_of_a_pressed_ball(void)
{
    static pal_scene scene;
    pal_prepared mesh;
    pal_configured_scene *set[N] = {NULL};
    make(&scene, &mesh, set);
    for (int i = 0; i < N; i++)
        for (int m = 0; m < MOMENTS; m++) {
            pal_world *w = open_world(&set[i]->scene);
            bring(w, scene.step_s, moment[m]);
            for (int j = 0; j < N; j++)
                if (i != j && CHECK_REPEATS(true, (i + j + m) % 3 == 1)) check_pair(set, i, j, m, w);
            pal_world_destroy(w);
        }
    for (int i = 0; i < N; i++) pal_configured_scene_free(set[i]);
    pal_prepared_free(&mesh);
}

int main(int argc, char **argv)
{
    table = argc > 1 && !strcmp(argv[1], "--table");
    RUN(every_pair_of_a_pressed_ball);
    return check_report();
}
