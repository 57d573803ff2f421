/* The default liver, as `palpate serve` makes it, grasped and pulled by 30 mm in two seconds: what a bridge is told
 * against the server's own force. */
#include "server/base/vec3.h"
#include "server/scene/scene_import.h"
#include "server/sim/world/world.h"
#include "tests/check.h"

/* f0 - K (x - x0) of a model at another pose */
static void force_of(const pal_tool *tool, const double x[3], double force[3])
{
    static const int place[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    for (int i = 0; i < 3; i++) {
        force[i] = tool->grasp_f0_N[i];
        for (int c = 0; c < 3; c++) force[i] -= tool->grasp_k_N_m[place[i][c]] * (x[c] - tool->grasp_x0_m[c]);
    }
}

static void foretells_the_force_of_a_pull(void)
{
    enum { PULL = 120, HOLD = 60, LATE = 6, FROM = 30 };
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    const pal_surface_scene options = {.label = -1};
    pal_world *world = NULL;
    REQUIRE(!pal_scene_procedural(&options, &loaded, NULL, &diag));
    REQUIRE(!pal_world_create(&loaded->scene, &diag, &world));
    const pal_body *body = pal_world_body(world, 0);
    const double step_s = loaded->scene.step_s, radius_m = pal_world_tools(world)->tool[0].radius_m;
    int top = 0;
    for (int i = 0; i < body->display.n_shown; i++)
        if (body->display.shown[3 * i + 2] > body->display.shown[3 * top + 2]) top = i;
    pal_pose pose = {.quat = {1, 0, 0, 0}};
    for (int c = 0; c < 3; c++) pose.position_m[c] = (double)body->display.shown[3 * top + c] + body->offset_m[c];
    pose.position_m[2] += radius_m;
    for (int i = 0; i < 30; i++) {
        pose.buttons = i >= 20;
        REQUIRE(!pal_world_pose(world, 0, &pose) && !pal_world_step(world, step_s));
    }
    pal_tool late[LATE];
    double now_worst = 0, late_worst = 0, force[3], jump = 0;
    const pal_tool *tool = &pal_world_tools(world)->tool[0];
    for (int i = 0; i < PULL + HOLD; i++) {
        if (i < PULL) pose.position_m[2] += 0.03 / PULL;
        REQUIRE(!pal_world_pose(world, 0, &pose) && !pal_world_step(world, step_s));
        REQUIRE(tool->has_grasp);
        const double size_N = pal_norm3(tool->force_N);
        if (i >= FROM) {
            force_of(tool, pose.position_m, force);
            now_worst = fmax(now_worst, pal_dist3(force, tool->force_N) / size_N);
            force_of(&late[i % LATE], pose.position_m, force);
            late_worst = fmax(late_worst, pal_dist3(force, tool->force_N) / size_N);
            for (int k = 0; k < 6; k++)
                jump = fmax(jump, fabs(tool->grasp_k_N_m[k] - late[(i + LATE - 1) % LATE].grasp_k_N_m[k]) /
                                      tool->grasp_k_N_m[5]);
        }
        late[i % LATE] = *tool;
    }
    printf("  %.3g N, K %.3g %.3g %.3g / %.3g %.3g / %.3g; model of now off by %.2g %%, of 0.1 s ago %.2g %%, K from "
           "model to model %.2g %%\n",
           pal_norm3(tool->force_N), tool->grasp_k_N_m[0], tool->grasp_k_N_m[1], tool->grasp_k_N_m[2],
           tool->grasp_k_N_m[3], tool->grasp_k_N_m[4], tool->grasp_k_N_m[5], 100 * now_worst, 100 * late_worst,
           100 * jump);
    CHECK(pal_norm3(tool->force_N) > 1);
    CHECK_LE(now_worst, 0.02);
    CHECK_LE(late_worst, 0.05);
    CHECK_LE(jump, 0.05);
    pal_world_destroy(world);
    pal_scene_free(loaded);
}

int main(void)
{
    RUN(foretells_the_force_of_a_pull);
    return check_report();
}
