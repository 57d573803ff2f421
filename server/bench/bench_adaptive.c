/* `palpate bench adaptive`: surfaces whose level of detail follows the deformation (model adaptive_springs), on one
 * core, in processor time unless stated; medians of several rounds, ratios within a round.
 *
 * (a) Paper C, Table I: a sphere of 114 and a stomach of 188 vertices, our own and, where they exist, those of
 * ../shared (PAL_SHARED names another folder), coarse, fully refined (450, 746) and adaptive, pressed at one place for
 * 2 s and then free for 0.3 s: the 2.3 s of paper C, Fig. 11. The paper does not give its constants; ours: E 5 kPa, a
 * wall of 3 mm with the mass of what it encloses, 1000 kg/m^3, anchors fixed in space. Every body is pressed for 0.1 ms
 * before the run, so that the adaptive one starts refined. `off` is the largest distance of the pressed vertex from its
 * trajectory in the fully refined body over the largest displacement there (paper C, Fig. 12). --picture draws these
 * trajectories of our two surfaces (paper C, Figs. 10 and 12).
 * (b) A hollow ball of 0.2 m with four levels, the finest of 28,674 vertices, on which a palm of 7 cm rests: refined
 * under the palm alone, against refined everywhere.
 * (c) The same with a finest level of 114,690 vertices, at most 2,000 of them active, in steps of 1 ms.
 * (d) There, the cost of one switch: a face split or joined, and the additional time of the step after it.
 * (e) How many times as fast a step of 1/120 s is with two threads as with one, by the clock, in worlds that step in
 * turn: the sphere and our stomach, fully refined, pressed.
 *
 * The press is distributed over the nodes of a patch by mass and a smooth bump: the same pressure on every level. */
#include "server/bench/bench.h"
#include "server/bench/bench_body.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/figure/plot.h"
#include "server/num/median.h"
#include "server/scene/scene_file.h"
#include "server/sim/surface/adaptive_surface.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { THREADS_STEPS = 41, N_SIZE = 6 };
enum { TABLE_STEPS = 138, ROUNDS = 21, PALM_ROUNDS = 3, KINDS = 3, SWITCHES = 61, MAX_NODE = 2000, COMPONENTS = 12 };
enum { COARSE, REFINED, ADAPTIVE };
static const char *const kind_name[KINDS] = {"coarse", "refined", "adaptive"};
static const char *const shape_name[2] = {"sphere", "stomach"};
static const double frame_s = 1.0 / 60, press_s = 2, free_s = 0.3, adapt_s = 1e-4;

/* a body with its scene, and the pressed patch */
typedef struct pressed {
    const char *name;
    char source[40]; /* the surface's file, or "procedural" */
    pal_loaded_scene *loaded;
    int axis;                 /* the vertex that is farthest along it is pressed against it */
    double radius_m, force_N; /* of the patch around that                                   */
    double mass_kg;           /* 0: of the wall alone                                       */
    int threads;
    double at[3];
} pressed;

typedef struct run {
    int n_node[2], n_spring[2];         /* least and most active */
    int n_sub;                          /* sub-steps             */
    double moved_m;                     /* of the vertex pressed, at the end of the press */
    double displacement_m[TABLE_STEPS]; /* the same after every step              */
    int n_sample;
} run;

/* ---- bodies ---- */

/* a file of ../shared; its path, or NULL when it is not there */
static const char *shared_path(const char *file)
{
    static char path[1024];
    const char *root = getenv("PAL_SHARED");
    snprintf(path, sizeof path, "%s/data/%s", root ? root : "../shared", file);
    return access(path, R_OK) ? NULL : path;
}

/* a surface from a file, or with path NULL the shape; pressed where it is farthest along the axis */
static pal_err take(const char *name, const char *path, int axis, pressed *out, pal_diagnostic *diag)
{
    const pal_surface_scene options = {
        .label = -1, .adaptive = true, .shape = name, .material = {5000, 0.45, 1000, 4, 1}};
    *out = (pressed){.name = name, .axis = axis, .source = "procedural", .threads = 1};
    if (path) {
        snprintf(out->source, sizeof out->source, "%s", strrchr(path, '/') + 1);
        PAL_TRY(pal_scene_from_surface(path, &options, &out->loaded, NULL, diag));
    } else {
        PAL_TRY(pal_scene_procedural(&options, &out->loaded, NULL, diag));
    }
    const pal_surface *surface = &out->loaded->mesh[0].surface;
    int front = 0;
    for (int i = 1; i < surface->n_vertex; i++)
        if (surface->x[3 * i + axis] > surface->x[3 * front + axis]) front = i;
    pal_copy3(out->at, surface->x + 3 * front);
    return PAL_ERR_OK;
}

/* a world of the body alone, as `kind` */
static pal_err start(const pressed *p, int kind, int n_level, int max_node, double step_s, pal_world **out,
                     pal_diagnostic *diag)
{
    pal_scene *scene = malloc(sizeof *scene);
    if (!scene) return PAL_ERR_MEMORY;
    *scene = p->loaded->scene;
    pal_body_def *def = &scene->body[0];
    scene->n_tool = 0;
    scene->step_s = step_s;
    scene->threads = p->threads;
    def->n_effect = 0;
    pal_config_entry *model = &def->model;
    pal_entry_init(model, "model", "adaptive_springs");
    pal_err err = pal_entry_put_number(model, "levels", n_level, diag);
    if (!err) err = pal_entry_put_text(model, "frame", "world", diag);
    if (!err && p->mass_kg > 0) err = pal_entry_put_number(model, "mass_kg", p->mass_kg, diag);
    if (!err && kind == REFINED) err = pal_entry_put_number(model, "start_level", n_level - 1, diag);
    if (!err && kind != ADAPTIVE) err = pal_entry_put_bool(model, "refine", false, diag);
    if (!err && max_node > 0) {
        pal_config_entry *refine = &def->effect[def->n_effect++];
        pal_entry_init(refine, "effects[0]", "refine");
        err = pal_entry_put_number(refine, "most_node", max_node, diag);
    }
    if (!err) err = pal_world_create(scene, diag, out);
    free(scene);
    return err;
}

/* ---- the load ---- */

/* share 1: the press, 0: none; on the nodes that are active now */
static void load(pal_world *world, const pressed *p, double share)
{
    const pal_body *body = pal_world_body(world, 0);
    double sum = 0, f[3] = {0, 0, 0};
    for (int turn = 0; turn < 2; turn++)
        for (int k = 0; k < body->n_active; k++) {
            int i = pal_body_point(body, k);
            double r = pal_dist3(body->x_rest + 3 * i, p->at) / p->radius_m;
            double weight = (1 - r * r) * (1 - r * r) * body->mass_kg[i];
            if (body->support[i] || r >= 1) continue;
            f[p->axis] = turn ? -share * p->force_N * weight / sum : 0;
            if (turn)
                (void)pal_world_load(world, 0, i, f);
            else
                sum += weight;
        }
}

static double moved(const pal_body *body, const pressed *p)
{
    int best = 0;
    for (int i = 1; i < body->model.adaptive->levels.n_vertex[0]; i++)
        if (pal_dist3(body->x_rest + 3 * i, p->at) < pal_dist3(body->x_rest + 3 * best, p->at)) best = i;
    return pal_dist3(body->x + 3 * best, body->x_rest + 3 * best);
}

static void widen(int range[2], int n)
{
    if (n < range[0] || !range[0]) range[0] = n;
    if (n > range[1]) range[1] = n;
}

/* runs steps, the load follows the active nodes; the result is the processor time of the steps, s; < 0: frozen. out
 * may be NULL */
static double run_steps(pal_world *world, const pressed *p, double share, double seconds, double step_s, run *out)
{
    const pal_body *body = pal_world_body(world, 0);
    double spent_ms = 0, ms;
    uint64_t seen = body->display.revision - 1;
    for (long step = lround(seconds / step_s); step > 0; step--) {
        if (body->display.revision != seen) load(world, p, share);
        seen = body->display.revision;
        pal_world_wake(world);
        if (bench_step(world, step_s, &ms)) return -1;
        spent_ms += ms;
        if (!out) continue;
        out->n_sub += pal_world_substeps(world);
        if (out->n_sample < TABLE_STEPS) out->displacement_m[out->n_sample++] = moved(body, p);
        widen(out->n_node, body->n_active);
        widen(out->n_spring, body->model.adaptive->n_spring);
    }
    return 1e-3 * spent_ms;
}

/* ---- (a) ---- */

static const char *range_text(const int n[2], char text[32])
{
    snprintf(text, 32, n[0] == n[1] ? "%d" : "%d-%d", n[0], n[1]);
    return text;
}

static void report_table(pal_table *r, const pressed *p, const run all[KINDS], const double run_s[KINDS],
                         const double paper_s[KINDS])
{
    const run *refined = &all[REFINED];
    double max = 0;
    for (int i = 0; i < refined->n_sample; i++) max = fmax(max, refined->displacement_m[i]);
    for (int kind = 0; kind < KINDS; kind++) {
        const run *a = &all[kind];
        char nodes[32], springs[32];
        double off = 0;
        for (int i = 0; i < a->n_sample; i++)
            off = fmax(off, fabs(a->displacement_m[i] - refined->displacement_m[i]) / max);
        TABLE_ROW(r, TEXT("body", "body", -8, p->name), TEXT("run", "run", -9, kind_name[kind]),
                  TEXT("surface", "surface", -17, p->source), TEXT("nodes", "nodes", 9, range_text(a->n_node, nodes)),
                  TEXT("springs", "springs", 11, range_text(a->n_spring, springs)),
                  NUMBER("moved_m", "moved m", 9, 5, a->moved_m), NUMBER("off", "off", 7, 4, off),
                  NUMBER("substeps", "sub-steps", 10, 0, a->n_sub), NUMBER("run_s", "run s", 9, 4, run_s[kind]),
                  NUMBER("paper_s", "paper s", 9, 3, paper_s[kind]),
                  NUMBER("ratio", "of refined", 10, 2, run_s[kind] / run_s[REFINED]),
                  NUMBER(NULL, "of paper", 8, 2, paper_s[kind] / paper_s[REFINED]),
                  NUMBER(NULL, "times as fast", 13, 0, paper_s[kind] / run_s[kind]));
    }
}

static pal_err run_table(const pressed *p, const double paper_s[KINDS], run out[KINDS], pal_table *r,
                         pal_diagnostic *diag)
{
    pal_world *world[KINDS] = {NULL};
    double run_s[KINDS][ROUNDS], median_s[KINDS];
    pal_err err = PAL_ERR_OK;
    memset(out, 0, KINDS * sizeof *out);
    for (int kind = 0; kind < KINDS && !err; kind++) err = start(p, kind, 2, 0, frame_s, &world[kind], diag);
    for (int round = 0; round < ROUNDS && !err; round++)
        for (int kind = 0; kind < KINDS && !err; kind++) {
            pal_world_reset(world[kind]);
            out[kind].n_sub = out[kind].n_sample = 0;
            double adapting = run_steps(world[kind], p, 1, adapt_s, adapt_s, NULL);
            double pressing = run_steps(world[kind], p, 1, press_s, frame_s, &out[kind]);
            out[kind].moved_m = moved(pal_world_body(world[kind], 0), p);
            double after = run_steps(world[kind], p, 0, free_s, frame_s, &out[kind]);
            run_s[kind][round] = adapting + pressing + after;
            if (adapting < 0 || pressing < 0 || after < 0)
                err = pal_diagnostic_set(diag, PAL_ERR_FROZEN, "%s: it diverged", p->name);
        }
    for (int kind = 0; kind < KINDS; kind++) {
        if (!err) median_s[kind] = pal_median(run_s[kind], ROUNDS);
        pal_world_destroy(world[kind]);
    }
    if (!err) report_table(r, p, out, median_s, paper_s);
    return err;
}

/* our own surface of each shape into drawn, then the shared one where it exists. The sphere is pressed at its equator,
 * where every vertex is regular */
static pal_err run_tables(run drawn[2][KINDS], pal_table *r, pal_diagnostic *diag)
{
    static const double paper_s[2][KINDS] = {{2.334, 10.078, 3.136}, {3.328, 14.422, 6.906}};
    static const char *const file[2] = {"sphere_114.obj", "stomach_188.obj"};
    static const int axis[2] = {0, 2};
    static const double force_N[2] = {0.025, 0.075};
    static run shared[KINDS];
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < 4 && !err; k++) {
        const char *path = k & 1 ? shared_path(file[k / 2]) : NULL;
        if (k & 1 && !path) continue;
        pressed body;
        err = take(shape_name[k / 2], path, axis[k / 2], &body, diag);
        if (!err) {
            /* the mass of what it encloses; pressed on a patch of a twelfth of its size */
            const pal_surface *surface = &body.loaded->mesh[0].surface;
            double low[3], high[3];
            pal_surface_box(surface, low, high);
            body.mass_kg = 1000 * fabs(pal_surface_volume(surface));
            body.radius_m = pal_dist3(low, high) / 12, body.force_N = force_N[k / 2];
        }
        if (!err) err = run_table(&body, paper_s[k / 2], k & 1 ? shared : drawn[k / 2], r, diag);
        pal_scene_free(body.loaded);
    }
    return err;
}

/* the trajectory of the pressed vertex of our own surfaces */
static pal_err draw_trajectories(run drawn[2][KINDS], const char *path, pal_diagnostic *diag)
{
    static char name[2 * KINDS][24];
    static double time_s[TABLE_STEPS], displacement_mm[2 * KINDS][TABLE_STEPS];
    pal_plot plot = {.title = "The vertex that is pressed for 2 s and then released",
                     .x_label = "time, s",
                     .y_label = "displacement, mm"};
    for (int i = 0; i < TABLE_STEPS; i++) time_s[i] = (i + 1) * frame_s;
    for (int c = 0; c < 2 * KINDS; c++) {
        const run *from = &drawn[c / KINDS][c % KINDS];
        snprintf(name[c], sizeof name[c], "%s, %s", shape_name[c / KINDS], kind_name[c % KINDS]);
        for (int i = 0; i < from->n_sample; i++) displacement_mm[c][i] = 1e3 * from->displacement_m[i];
        plot.curve[plot.n_curve++] = (pal_curve){.name = name[c],
                                                 .n = from->n_sample,
                                                 .x = time_s,
                                                 .y = displacement_mm[c],
                                                 .bare = true,
                                                 .dashed = c % KINDS == ADAPTIVE};
    }
    return pal_plot_write(&plot, path, diag);
}

/* ---- (b) ---- */

static const double settle_s = 0.4, palm_s = 0.1, ball_m = 0.1;
enum { PALM_LEVELS = 4 };

/* the sphere split some times, as the coarsest level of a body that has finer ones still */
static pal_err make_ball(int n_split, double radius_m, double force_N, pressed *out, pal_diagnostic *diag)
{
    pal_levels levels = {0};
    const pal_levels_options options = {.n_level = n_split + 1};
    PAL_TRY(take("sphere", NULL, 2, out, diag));
    pal_surface *surface = &out->loaded->mesh[0].surface;
    pal_err err = pal_levels_make(surface, &options, &levels, diag);
    if (!err) {
        pal_surface_free(surface);
        err = pal_levels_surface(&levels, n_split, surface);
    }
    pal_levels_free(&levels);
    if (err) return err;
    for (int i = 0; i < surface->n_vertex; i++) {
        double *x = surface->x + 3 * (size_t)i;
        pal_scale3(x, ball_m / pal_norm3(x), x);
    }
    out->name = "ball", out->radius_m = radius_m, out->force_N = force_N;
    pal_set3(out->at, 0, 0, ball_m);
    return PAL_ERR_OK;
}

static pal_err run_palm(const pressed *p, pal_table *r, pal_diagnostic *diag)
{
    pal_world *world[2] = {NULL};
    double run_s[2][PALM_ROUNDS], ratio[PALM_ROUNDS];
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < 2 && !err; k++)
        err = start(p, k ? ADAPTIVE : REFINED, PALM_LEVELS, 0, frame_s, &world[k], diag);
    /* only what adapts has to come to its state */
    if (!err && run_steps(world[1], p, 1, settle_s, frame_s, NULL) < 0) err = PAL_ERR_FROZEN;
    for (int round = 0; round < PALM_ROUNDS && !err; round++) {
        for (int k = 0; k < 2; k++) {
            run_s[k][round] = run_steps(world[k], p, 1, palm_s, frame_s, NULL) / palm_s;
            if (run_s[k][round] < 0) err = PAL_ERR_FROZEN;
        }
        ratio[round] = run_s[1][round] / run_s[0][round];
    }
    if (err == PAL_ERR_FROZEN) pal_diagnostic_set(diag, err, "four levels: it diverged");
    for (int k = 0; k < 2; k++) {
        const pal_adaptive_surface *adaptive = err ? NULL : pal_world_body(world[k], 0)->model.adaptive;
        if (!err)
            TABLE_ROW(r, TEXT("run", "run", -9, kind_name[REFINED + k]),
                      NUMBER("nodes", "nodes", 7, 0, adaptive->n_node),
                      NUMBER("springs", "springs", 7, 0, adaptive->n_spring),
                      NUMBER("second_s", "s", 8, 3, pal_median(run_s[k], PALM_ROUNDS)),
                      NUMBER("ratio", "of refined", 10, 3, k ? pal_median(ratio, PALM_ROUNDS) : 1));
        pal_world_destroy(world[k]);
    }
    return err;
}

/* ---- (c), (d) ---- */

static const double live_s = 1e-3;
enum { BALL_LEVELS = 4, LIVE_STEPS = 301 };

/* a leaf that splits alone and can be joined again; -1: none */
static int32_t find_leaf(pal_adaptive_surface *adaptive, pal_body *body)
{
    for (int k = 0; k < adaptive->n_leaf; k++) {
        int32_t face = adaptive->leaf[k];
        if (adaptive->levels.face_level[face] + 1 >= adaptive->levels.n_level) continue;
        int n = pal_adaptive_split(adaptive, body, face, 0);
        bool back = n > 0 && pal_adaptive_join(adaptive, body, face);
        pal_adaptive_update(adaptive, body);
        if (n == 1 && back) return face;
    }
    return -1;
}

/* us: a split, a join, what the step after one takes longer. One face is split and joined again and again, with a step
 * after each and steps without any between */
static pal_err run_switches(pal_world *world, double us[3], pal_diagnostic *diag)
{
    pal_body *body = pal_world_body(world, 0);
    pal_adaptive_surface *adaptive = body->model.adaptive;
    double sample[3][SWITCHES];
    int32_t face = find_leaf(adaptive, body);
    if (face < 0) return pal_diagnostic_set(diag, PAL_ERR_INTERNAL, "no face can be split alone");
    for (int turn = 0; turn < SWITCHES; turn++) {
        double with = 0, without = 0;
        for (int join = 0; join < 2; join++) {
            double ms[2] = {NAN, NAN};
            uint64_t began = pal_clock_thread_ns();
            if (join)
                pal_adaptive_join(adaptive, body, face);
            else
                pal_adaptive_split(adaptive, body, face, 0);
            pal_adaptive_update(adaptive, body);
            sample[join][turn] = 1e-3 * (double)(pal_clock_thread_ns() - began);
            for (int k = 0; k < 2; k++) {
                pal_world_wake(world);
                PAL_TRY(bench_step(world, live_s, &ms[k]));
            }
            with += ms[0], without += ms[1];
        }
        sample[2][turn] = 1e3 * (with - without) / 2;
    }
    for (int k = 0; k < 3; k++) us[k] = pal_median(sample[k], SWITCHES);
    return PAL_ERR_OK;
}

static pal_err measure_live(pal_world *world, const pressed *p, pal_table *r, pal_diagnostic *diag)
{
    static double step_ms[LIVE_STEPS], component_ms[COMPONENTS][LIVE_STEPS];
    const pal_body *body = pal_world_body(world, 0);
    int n_component = pal_world_component_count(world);
    pal_component_info info;
    double us[3];
    if (n_component > COMPONENTS) n_component = COMPONENTS;
    if (run_steps(world, p, 1, 0.7, live_s, NULL) < 0)
        return pal_diagnostic_set(diag, PAL_ERR_FROZEN, "ball: it diverged");
    for (int step = 0; step < LIVE_STEPS; step++) {
        pal_world_wake(world);
        PAL_TRY(bench_step(world, live_s, &step_ms[step]));
        for (int k = 0; k < n_component; k++) {
            pal_world_component_info(world, k, &info);
            component_ms[k][step] = 1e-6 * (double)info.spent_ns;
        }
    }
    int n_node = body->n_active, n_spring = body->model.adaptive->n_spring, n_sub = pal_world_substeps(world);
    double p50_ms = pal_median(step_ms, LIVE_STEPS), p95_ms = step_ms[LIVE_STEPS * 95 / 100];
    PAL_TRY(run_switches(world, us, diag));
    pal_table_note(r, "\nfinest level of %d nodes, steps of 1 ms; wanted: less than 1 ms", body->n_node);
    pal_table_list(r, "live");
    TABLE_ROW(r, VALUE("finest_nodes", body->n_node), NUMBER("nodes", "nodes", 7, 0, n_node),
              NUMBER("springs", "springs", 7, 0, n_spring), NUMBER("substeps", "sub-steps", 9, 0, n_sub),
              NUMBER("p50_ms", "ms p50", 7, 3, p50_ms), NUMBER("p95_ms", "ms p95", 7, 3, p95_ms),
              NUMBER("split_us", "split us", 9, 1, us[0]), NUMBER("join_us", "join us", 9, 1, us[1]),
              NUMBER("after_us", "next step us", 12, 1, us[2]));
    pal_table_list(r, "components");
    for (int k = 0; k < n_component; k++) {
        pal_world_component_info(world, k, &info);
        TABLE_ROW(r, TEXT("name", "component", -16, info.name),
                  NUMBER("ms", "ms", 7, 4, pal_median(component_ms[k], LIVE_STEPS)));
    }
    return PAL_ERR_OK;
}

/* ---- (e) ---- */

static pal_err compare_threads(pal_world *const world[2], double ms[2], double *faster)
{
    double sample[3][THREADS_STEPS];
    for (int step = -3; step < THREADS_STEPS; step++) {
        double now_ms[2];
        for (int k = 0; k < 2; k++) {
            pal_world_wake(world[k]);
            const uint64_t began = pal_clock_ns();
            PAL_TRY(pal_world_step(world[k], 1.0 / 120));
            now_ms[k] = 1e-6 * (double)(pal_clock_ns() - began);
        }
        for (int k = 0; k < 2 && step >= 0; k++) sample[k][step] = now_ms[k];
        if (step >= 0) sample[2][step] = now_ms[0] / now_ms[1];
    }
    for (int k = 0; k < 2; k++) ms[k] = pal_median(sample[k], THREADS_STEPS);
    *faster = pal_median(sample[2], THREADS_STEPS);
    return PAL_ERR_OK;
}

static pal_err run_threads(pal_table *r, pal_diagnostic *diag)
{
    static const struct {
        const char *shape;
        int n_level;
    } size[N_SIZE] = {{"stomach", 2}, {"sphere", 3}, {"stomach", 3}, {"sphere", 4}, {"stomach", 4}, {"sphere", 5}};
    pal_table_note(r, "\nfully refined, steps of 1/120 s, one thread and two in turn");
    pal_table_list(r, "threads");
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < N_SIZE && !err; k++) {
        pressed body;
        pal_world *world[2] = {NULL, NULL};
        double ms[2], faster;
        err = take(size[k].shape, NULL, 2, &body, diag);
        body.radius_m = 0.03, body.force_N = 0.05;
        for (int w = 0; w < 2 && !err; w++) {
            body.threads = w + 1;
            err = start(&body, REFINED, size[k].n_level, 0, 1.0 / 120, &world[w], diag);
            if (!err) load(world[w], &body, 1);
        }
        if (!err) err = compare_threads(world, ms, &faster);
        if (!err)
            TABLE_ROW(r, TEXT("body", "body", -8, body.name),
                      NUMBER("nodes", "nodes", 7, 0, pal_world_body(world[0], 0)->n_active),
                      NUMBER("substeps", "sub-steps", 9, 0, pal_world_substeps(world[0])),
                      NUMBER("one_ms", "ms on one", 9, 3, ms[0]), NUMBER("two_ms", "on two", 8, 3, ms[1]),
                      NUMBER("faster", "times as fast", 13, 2, faster));
        for (int w = 0; w < 2; w++) pal_world_destroy(world[w]);
        pal_scene_free(body.loaded);
    }
    return err;
}

pal_err bench_adaptive(pal_table *r, pal_diagnostic *diag)
{
    static run drawn[2][KINDS];
    pressed ball[2] = {{.name = NULL}};
    pal_world *world = NULL;
    TABLE_ROW(r, VALUE("rounds", ROUNDS), VALUE("simulated_s", press_s + free_s));
    pal_table_note(r,
                   "paper C, Table I, %.1f simulated seconds: pressed for %.0f s, then free; medians of %d, one core\n"
                   "wanted: adaptive at most 0.30 of refined; stomach 500 times as fast refined, 1000 times adaptive",
                   press_s + free_s, press_s, ROUNDS);
    pal_table_list(r, "table");
    PAL_TRY(run_tables(drawn, r, diag));
    if (r->argument) PAL_TRY(draw_trajectories(drawn, r->argument, diag));
    pal_table_note(
        r, "\nfour levels, a palm refined, processor seconds of a simulated second; wanted: at most 0.08 of refined");
    pal_table_list(r, "palm");
    pal_err err = make_ball(1, 0.035, 0.12, &ball[0], diag);
    if (!err) err = run_palm(&ball[0], r, diag);
    if (!err) err = make_ball(2, 0.016, 0.3, &ball[1], diag);
    if (!err) err = start(&ball[1], ADAPTIVE, BALL_LEVELS, MAX_NODE, live_s, &world, diag);
    if (!err) err = measure_live(world, &ball[1], r, diag);
    pal_world_destroy(world);
    for (int k = 0; k < 2; k++) pal_scene_free(ball[k].loaded);
    return err ? err : run_threads(r, diag);
}
