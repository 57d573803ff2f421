/* The world: what a scene becomes, how a step runs, what is refused, and that a step neither depends on its
 * surroundings nor touches the heap. */
#include "server/sim/plan.h"
#include "server/sim/world.h"
#include "tests/check.h"
#include "tests/sim/boxes.h"

static pal_note note;

static bool has_row(const pal_world *world, const char *name)
{
    for (int i = 0; i < pal_world_rows(world); i++) {
        pal_row_info info;
        pal_world_row(world, i, &info);
        if (!strcmp(info.name, name)) return true;
    }
    return false;
}

static void sags_and_comes_to_rest_under_its_weight(void)
{
    pal_prepared box;
    REQUIRE(!box_make(6, 4, 4, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, true);
    pal_world *world;
    REQUIRE(!pal_world_create(scene, &note, &world));
    for (int i = 0; i < 240; i++) CHECK_INT(pal_world_step(world, scene->step_s), 0);
    pal_body *body = pal_world_body(world, 0);
    double low = 0;
    for (int i = 0; i < body->n_dof; i++) low = fmin(low, body->x[3 * i + 2] - body->x_rest[3 * i + 2]);
    printf("  sag %.3g mm, %d sub-steps of at most %.3g ms\n", -1e3 * low, pal_world_substeps(world),
           1e3 * pal_world_limit_s(world));
    CHECK(low < 0 && low > -0.01);
    CHECK_LE(pal_body_kinetic_J(body), 1e-9);
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

static void has_rows_only_for_what_the_scene_calls_for(void)
{
    pal_prepared box;
    REQUIRE(!box_make(2, 2, 2, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, false);
    pal_item_put_number(&scene->body[0].model, "k_area_J", 0, NULL);
    scene->body[0].material.damping_1_s = 0;
    pal_world *world;
    REQUIRE(!pal_world_create(scene, &note, &world));
    CHECK(has_row(world, "edge_distance"));
    CHECK(has_row(world, "tet_volume"));
    CHECK(has_row(world, "verlet"));
    CHECK(!has_row(world, "face_area"));
    CHECK(!has_row(world, "viscous"));
    CHECK(!has_row(world, "gravity"));
    pal_world_destroy(world);
    free(scene);
    box_free(&box);
}

int main(void)
{
    RUN(sags_and_comes_to_rest_under_its_weight);
    RUN(has_rows_only_for_what_the_scene_calls_for);
    return check_report();
}
