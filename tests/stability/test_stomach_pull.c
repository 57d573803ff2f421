/* The demo stomach pulled at random places in random directions and let go, as `palpate prepare --shape stomach` makes
 * it: nothing of it is left, and the mesh is the coarse one again before the body sleeps. Tools pull with 15 N at most
 * and go on where tissue does not follow. */
#include "server/num/random.h"
#include "tests/fixtures/adaptive_worlds.h"

enum { PULLS = 16 };
/* pulls after which all stands still before the last faces may be joined */
static const uint64_t early[] = {51, 72};
static const double step_s = 1.0 / 120;

static bool stomach_open(shell_scene *s)
{
    pal_stomach stomach;
    if (pal_stomach_make(&stomach)) return false;
    shell_scene_take(s, &stomach.surface);
    for (int ring = 0; ring < 2; ring++) {
        const int32_t *v = ring ? stomach.duodenum : stomach.oesophagus;
        double low[3] = {1, 1, 1}, high[3] = {-1, -1, -1};
        for (int k = 0; k < PAL_STOMACH_RING; k++)
            for (int a = 0; a < 3; a++) {
                double at = s->mesh.surface.x[3 * v[k] + a];
                low[a] = fmin(low[a], at - 2e-3), high[a] = fmax(high[a], at + 2e-3);
            }
        shell_scene_hold(s, low, high);
    }
    shell_scene_number(s, "levels", 2);
    s->scene->step_s = step_s;
    s->scene->body[0].material =
        (pal_material){.young_Pa = 5e4, .poisson = 0.45, .density_kg_m3 = 1000, .damping_1_s = 4};
    pal_tools_default(s->scene, 1);
    s->scene->tool[0].radius_m = 0.0083, s->scene->tool[0].force_cap_N = 15;
    shell_scene_effect(s, "tool_push");
    shell_scene_effect(s, "tool_grasp");
    shell_scene_effect(s, "finite_guard");
    shell_scene_effect(s, "sleep");
    return shell_scene_start(s);
}

static double farthest_m(const shell_scene *s)
{
    double max = 0;
    for (int k = 0; k < s->body->n_active; k++) {
        size_t i = 3 * (size_t)pal_body_point(s->body, k);
        max = fmax(max, pal_dist3(s->body->x + i, s->body->x_rest + i));
    }
    return max;
}

static bool run(shell_scene *s, double time_s)
{
    for (int i = 0; i < (int)(time_s / step_s); i++)
        if (pal_world_step(s->world, step_s)) return false;
    return true;
}

/* taken where a free vertex is, moved by 50 to 140 mm in half a second, kept there for 0.8 s, let go; returns how far
 */
static double pull(shell_scene *s, uint64_t seed, double *way_m)
{
    uint64_t count = 0;
    double dir[3], max = 0;
    int v = 0, n = s->body->model.adaptive->levels.n_vertex[0];
    do v = (int)(pal_random_unit(seed, count++) * n);
    while (s->body->support[v]);
    do
        for (int c = 0; c < 3; c++) dir[c] = 2 * pal_random_unit(seed, count++) - 1;
    while (pal_norm3(dir) > 1 || !pal_unit3(dir, dir, 0.1));
    *way_m = 0.05 + 0.09 * pal_random_unit(seed, count++);
    for (int i = 0; i < 156; i++) {
        pal_pose pose = {.quat = {1, 0, 0, 0}, .buttons = i > 4};
        pal_copy3(pose.position_m, s->body->x_rest + 3 * (size_t)v);
        pal_axpy3(pose.position_m, *way_m * fmin(1, i * step_s / 0.5), dir);
        if (pal_world_pose(s->world, 0, &pose) || pal_world_step(s->world, step_s)) return NAN;
        max = fmax(max, farthest_m(s));
    }
    return pal_world_pose(s->world, 0, NULL) ? NAN : max;
}

static void no_pull_leaves_a_dent_or_a_fine_mesh(void)
{
    shell_scene s;
    int n_dent = 0, n_fine = 0;
    double min = INFINITY, left = 0;
    REQUIRE(stomach_open(&s));
    const int n_coarse = s.body->n_active;
    for (uint64_t k = 0; k < CHECK_REPEATS(PULLS, 3); k++) {
        double way_m, max = pull(&s, k < 2 ? early[k] : k - 2, &way_m);
        CHECK(max > 0.01 && !s.body->frozen);
        min = fmin(min, max);
        CHECK(run(&s, 5));
        double now = farthest_m(&s);
        left = fmax(left, now), n_dent += !(now <= 1e-3), n_fine += s.body->n_active != n_coarse;
        CHECK(s.body->asleep);
        pal_world_reset(s.world);
    }
    printf("  moved by %.0f mm at least, %.2g mm left at most after 5 s\n", 1e3 * min, 1e3 * left);
    CHECK_INT(n_dent, 0);
    CHECK_INT(n_fine, 0);
    shell_scene_close(&s);
}

int main(void)
{
    RUN(no_pull_leaves_a_dent_or_a_fine_mesh);
    return check_report();
}
