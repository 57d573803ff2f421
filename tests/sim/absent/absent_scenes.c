/* Runs a dozen small scenes and says of each, in one line: its rows, the world's hash, how often rows were run, bytes
 * and heap calls; or why it was refused. The same program is linked once with every effect and once for each effect
 * without it (CMakeLists.txt beside), and test_absent.sh compares the lines: what a scene does not call for might as
 * well not exist. With `--time N` it says instead what a step of each takes, the least of N medians of 40 steps, in
 * microseconds of processor time (tests/bench/absent.sh compares those). */
#include "server/base/clock.h"
#include "server/mesh/volume/prepared.h"
#include "server/sim/core/effect_list.h"
#include "tests/fixtures/model_scenes.h"
#include "tests/heap_calls.h"

/* of the table that this program is linked with (absent_probe.c): is the effect's own code there? */
const char *absent_effect(bool *linked);

enum { STEPS = 6, TIMED = 40 };

static void solver(model_scene *m, const char *name)
{
    pal_entry_init(&m->def->solver, "bodies[0].solver", name);
}

static void bare(model_scene *m)
{
    m->def->material.damping_1_s = 0;
    m->scene->n_tool = 0;
    if (m->kind == SPRINGS) pal_entry_put_number(&m->def->model, "k_area_J", 0, NULL);
    if (m->kind == SHELL) pal_entry_put_number(&m->def->model, "k_shape_N_m", 0, NULL);
    if (m->kind == SHELL) pal_entry_put_bool(&m->def->model, "refine", false, NULL);
}

/* a box moved by a row that leads part of its lowest nodes */
static void led(model_scene *m)
{
    const double shift_m[3] = {0, 0, 1e-3};
    m->def->n_support = 0;
    pal_entry_put_numbers(model_scene_effect(m, "moving_support"), "shift_m", shift_m, 3, NULL);
    pal_entry_put_number(&m->def->effect[m->def->n_effect - 1], "rise_s", 0.05, NULL);
}

static void held_by_springs(model_scene *m)
{
    m->def->n_support = 0;
    /* a fresh factor would be made beside, with heap calls of its thread */
    solver(m, "implicit_euler");
    pal_entry_put_bool(&m->def->solver, "refresh", false, NULL);
    model_scene_effect(m, "penalty");
    model_scene_effect(m, "gravity");
}

static void tets(model_scene *m)
{
    bare(m);
    pal_entry_put_text(&m->def->model, "element", "tet4", NULL);
    solver(m, "sdirk2");
    model_scene_effect(m, "gravity");
}

static void still(model_scene *m)
{
    bare(m);
    solver(m, "static_newton");
    model_scene_effect(m, "gravity");
}

static void blown_up(model_scene *m)
{
    bare(m);
    pal_entry_put_number(model_scene_effect(m, "inflate"), "pressure_Pa", 50, NULL);
}

static void coloured(model_scene *m)
{
    bare(m);
    pal_entry_put_text(model_scene_effect(m, "field_output"), "field", "displacement", NULL);
}

static void sleepy(model_scene *m)
{
    bare(m);
    model_scene_effect(m, "sleep");
}

static void skinned(model_scene *m)
{
    pal_surface ball;
    const pal_voxel_options options = {.resolution = 4, .border = true};
    pal_prepare_report report;
    box_free(&m->mesh);
    bool made = small_ball(&ball, 0.05, 8) && !pal_prepared_make(&ball, &options, &m->mesh, &report, &m->diag);
    pal_surface_free(&ball);
    if (!made) abort();
    bare(m);
    pal_entry_init(&m->def->output, "bodies[0].output", "skin_output");
}

static const struct {
    const char *name;
    model_kind kind;
    void (*dress)(model_scene *m);
} list[] = {{"springs", SPRINGS, model_scene_defaults},
            {"springs_bare", SPRINGS, bare},
            {"springs_sleep", SPRINGS, sleepy},
            {"springs_skin", SPRINGS, skinned},
            {"springs_field", SPRINGS, coloured},
            {"springs_led", SPRINGS, led},
            {"cubes", FEM, model_scene_defaults},
            {"cubes_bare", FEM, bare},
            {"cubes_penalty", FEM, held_by_springs},
            {"cubes_static", FEM, still},
            {"tets", FEM, tets},
            {"shell", SHELL, model_scene_defaults},
            {"shell_bare", SHELL, bare},
            {"shell_inflate", SHELL, blown_up},
            {"solid", SOLID, model_scene_defaults},
            {"solid_bare", SOLID, bare}};

static bool run(model_scene *m, long *n_create, long *n_step)
{
    n_heap_call = 0;
    counting = true;
    pal_err err = pal_world_create(m->scene, &m->diag, &m->world);
    *n_create = n_heap_call;
    n_heap_call = 0;
    if (!err) m->body = pal_world_body(m->world, 0);
    bool good = !err && (m->scene->n_tool > 0 ? model_scene_touch(m, 3, STEPS) : model_scene_steps(m, STEPS));
    counting = false;
    *n_step = n_heap_call;
    return good;
}

static int rising(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* microseconds of a step of a world that runs; awake, as asleep no row is run at all */
static double time_step(pal_world *world, double step_s, int n)
{
    double us[TIMED], min = INFINITY;
    for (int k = 0; k < n; k++) {
        for (int i = 0; i < TIMED; i++) {
            pal_world_wake(world);
            uint64_t before = pal_clock_thread_ns();
            if (pal_world_step(world, step_s)) return NAN;
            us[i] = 1e-3 * (double)(pal_clock_thread_ns() - before);
        }
        qsort(us, TIMED, sizeof *us, rising);
        min = fmin(min, us[TIMED / 2]);
    }
    return min;
}

static void time_all(int n)
{
    for (size_t i = 0; i < sizeof list / sizeof list[0]; i++) {
        model_scene m;
        long n_create, n_step;
        model_scene_make(&m, list[i].kind);
        list[i].dress(&m);
        bool good = run(&m, &n_create, &n_step);
        if (good) printf("%s %.3f\n", list[i].name, time_step(m.world, m.scene->step_s, n));
        bool skin = m.mesh.skin.n_vertex > 0;
        if (skin) {
            pal_world_destroy(m.world);
            m.world = NULL;
            pal_prepared_free(&m.mesh);
        }
        model_scene_close(&m);
    }
}

int main(int argc, char **argv)
{
    (void)check_count; /* lines are compared, nothing is checked here */
    if (argc == 3 && !strcmp(argv[1], "--time")) {
        time_all(atoi(argv[2]));
        return 0;
    }
    for (size_t i = 0; i < sizeof list / sizeof list[0]; i++) {
        model_scene m;
        long n_create, n_step;
        uint64_t n_run = 0;
        model_scene_make(&m, list[i].kind);
        list[i].dress(&m);
        printf("%s:", list[i].name);
        if (!run(&m, &n_create, &n_step)) {
            printf(" refused: %s\n", m.diag.text);
        } else {
            for (int r = 0; r < pal_world_component_count(m.world); r++) {
                pal_component_info row;
                pal_world_component_info(m.world, r, &row);
                printf(" %s", row.name);
                n_run += row.n_run;
            }
            printf(" | %016llx, %llu row calls, %zu bytes, %ld and %ld heap calls\n",
                   (unsigned long long)pal_world_hash(m.world), (unsigned long long)n_run, pal_world_bytes(m.world),
                   n_create, n_step);
        }
        bool skin = m.mesh.skin.n_vertex > 0;
        if (skin) {
            pal_world_destroy(m.world);
            m.world = NULL;
            pal_prepared_free(&m.mesh);
        }
        model_scene_close(&m);
    }
    bool linked;
    const char *effect = absent_effect(&linked);
    printf("code of %s: %s\n", effect, linked ? "there" : "not there");
    return 0;
}
