/* `palpate bench adaptive`: surfaces whose level of detail follows the deformation (model adaptive_springs), on one
 * core, in processor time; medians of several rounds, ratios within a round.
 *
 * (a) Paper C, Table I: a sphere of 114 and a stomach of 188 vertices, our own and, where they exist, those of
 * ../shared (PAL_SHARED names another folder), coarse, fully refined (450, 746) and adaptive, pressed at one place for
 * 2 s and then free for 0.3 s: the 2.3 s of paper C, Fig. 11. The paper does not give its constants; ours: E 5 kPa, a
 * wall of 3 mm with the mass of what it encloses, 1000 kg/m^3, anchors fixed in space, thresholds from size and
 * stiffness. Every body is pressed for 0.1 ms before the run, so that the adaptive one starts refined. `off` is the
 * largest distance of the pressed vertex from its trajectory in the fully refined body, as a share of the largest
 *     displacement there (paper C, Fig. 12). --picture draws these trajectories of our two surfaces (paper C, Figs. 10
 *     and 12).
 * (b) A hollow ball of 0.2 m with four levels, the finest of 28,674 vertices, on which a palm of 7 cm rests: its place
 *     refined, against all of it refined.
 * (c) The same with a finest level of 114,690 vertices, at most 2,000 of them active, in steps of 1 ms.
 * (d) There, the cost of one switch: a face split or joined, and the additional time of the step after it.
 *
 * The press is distributed over the nodes of a patch by mass and a smooth bump: the same pressure on every level. */
#include "server/bench/bench.h"
#include "server/bench/bench_report.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/cli/median.h"
#include "server/figure/plot.h"
#include "server/mesh/geometry/stomach.h"
#include "server/scene/scene_file.h"
#include "server/sim/surface/adaptive_surface.h"
#include "server/sim/world/world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    TABLE_STEPS = 138,
    ROUNDS = 21,
    PALM_ROUNDS = 3,
    TABLES = 4,
    KINDS = 3,
    SWITCHES = 61,
    MAX_NODE = 2000,
    COMPONENTS = 12
};
enum { COARSE, REFINED, ADAPTIVE };
static const char *const kind_name[KINDS] = {"coarse", "refined", "adaptive"};
static const double frame_s = 1.0 / 60, press_s = 2, free_s = 0.3, look_s = 1e-4;

/* a body with its scene, and the pressed patch */
typedef struct pressed {
    const char *name;
    char source[40]; /* the surface's file, or "procedural" */
    pal_loaded_scene *loaded;
    int axis;                 /* the vertex that is farthest along it is pressed against it */
    double radius_m, force_N; /* of the patch around that                                   */
    double mass_kg;           /* 0: of the wall alone                                       */
    double at[3];
} pressed;

typedef struct table_row {
    const char *name;
    char source[40];
    double paper_s[KINDS];
    int n_node[KINDS][2], n_spring[KINDS][2];  /* least and most active */
    int n_sub[KINDS];                          /* sub-steps of a run    */
    double run_s[KINDS], moved_m[KINDS];       /* moved_m: the vertex pressed, at the end of the press */
    double displacement_m[KINDS][TABLE_STEPS]; /* the same after every step                            */
    int n_sample;
    double off[KINDS]; /* from the refined one's, in parts of its largest       */
    double ratio;      /* adaptive over refined: of the paper 0.31 and 0.48 */
} table_row;

typedef struct palm_row {
    int n_node[2], n_spring[2]; /* refined, adaptive */
    double second_s[2], ratio;  /* for a simulated second */
} palm_row;

typedef struct live_row {
    int n_finest, n_node, n_spring, n_sub;
    double p50_ms, p95_ms;
    int n_component;
    char component[COMPONENTS][24];
    double component_ms[COMPONENTS];
    double split_us, join_us, after_us; /* of one switch; after: what the next step takes longer */
} live_row;

typedef struct results {
    int n_table;
    table_row table[TABLES];
    palm_row palm;
    live_row live;
} results;

/* ---- bodies ---- */

static pal_surface_scene options_of(const char *shape)
{
    return (pal_surface_scene){.label = -1, .adaptive = true, .shape = shape, .material = {5000, 0.45, 1000, 4}};
}

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
    const pal_surface_scene options = options_of(name);
    *out = (pressed){.name = name, .axis = axis, .source = "procedural"};
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

/* runs steps, the load follows the active nodes; the result is the processor time of the steps, s; < 0: frozen */
static double run_steps(pal_world *world, const pressed *p, double share, int n_step, double step_s, table_row *out,
                        int kind)
{
    const pal_body *body = pal_world_body(world, 0);
    uint64_t spent = 0, seen = body->revision - 1;
    for (int step = 0; step < n_step; step++) {
        if (body->revision != seen) load(world, p, share);
        seen = body->revision;
        pal_world_wake(world);
        uint64_t began = pal_clock_thread_ns();
        if (pal_world_step(world, step_s)) return -1;
        spent += pal_clock_thread_ns() - began;
        if (!out) continue;
        out->n_sub[kind] += pal_world_substeps(world);
        if (out->n_sample < TABLE_STEPS) out->displacement_m[kind][out->n_sample++] = moved(body, p);
        int *node = out->n_node[kind], *spring = out->n_spring[kind];
        node[0] = body->n_active < node[0] || !node[0] ? body->n_active : node[0];
        node[1] = body->n_active > node[1] ? body->n_active : node[1];
        spring[0] =
            body->model.adaptive->n_spring < spring[0] || !spring[0] ? body->model.adaptive->n_spring : spring[0];
        spring[1] = body->model.adaptive->n_spring > spring[1] ? body->model.adaptive->n_spring : spring[1];
    }
    return 1e-9 * (double)spent;
}

/* ---- (a) ---- */

static pal_err run_table(const pressed *p, const double paper_s[KINDS], table_row *out, pal_diagnostic *diag)
{
    pal_world *world[KINDS] = {NULL};
    double run_s[KINDS][ROUNDS], ratio[ROUNDS];
    pal_err err = PAL_ERR_OK;
    *out = (table_row){.name = p->name};
    memcpy(out->source, p->source, sizeof out->source);
    memcpy(out->paper_s, paper_s, sizeof out->paper_s);
    for (int kind = 0; kind < KINDS && !err; kind++) err = start(p, kind, 2, 0, frame_s, &world[kind], diag);
    for (int round = 0; round < ROUNDS && !err; round++) {
        for (int kind = 0; kind < KINDS && !err; kind++) {
            pal_world_reset(world[kind]);
            out->n_sub[kind] = out->n_sample = 0;
            double looking = run_steps(world[kind], p, 1, 1, look_s, NULL, 0);
            double pressing = run_steps(world[kind], p, 1, (int)lround(press_s / frame_s), frame_s, out, kind);
            out->moved_m[kind] = moved(pal_world_body(world[kind], 0), p);
            double after = run_steps(world[kind], p, 0, (int)lround(free_s / frame_s), frame_s, out, kind);
            run_s[kind][round] = looking + pressing + after;
            if (looking < 0 || pressing < 0 || after < 0)
                err = pal_diagnostic_set(diag, PAL_ERR_FROZEN, "%s: it diverged", p->name);
        }
        ratio[round] = err ? 0 : run_s[ADAPTIVE][round] / run_s[REFINED][round];
    }
    for (int kind = 0; kind < KINDS; kind++) {
        if (!err) out->run_s[kind] = pal_median(run_s[kind], ROUNDS);
        pal_world_destroy(world[kind]);
    }
    if (!err) out->ratio = pal_median(ratio, ROUNDS);
    double max = 0;
    for (int i = 0; i < out->n_sample; i++) max = fmax(max, out->displacement_m[REFINED][i]);
    for (int kind = 0; kind < KINDS; kind++)
        for (int i = 0; i < out->n_sample; i++)
            out->off[kind] =
                fmax(out->off[kind], fabs(out->displacement_m[kind][i] - out->displacement_m[REFINED][i]) / max);
    return err;
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

static pal_err run_palm(const pressed *p, palm_row *out, pal_diagnostic *diag)
{
    pal_world *world[2] = {NULL};
    double run_s[2][PALM_ROUNDS], ratio[PALM_ROUNDS];
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < 2 && !err; k++)
        err = start(p, k ? ADAPTIVE : REFINED, PALM_LEVELS, 0, frame_s, &world[k], diag);
    /* only what adapts has to come to its state */
    if (!err && run_steps(world[1], p, 1, (int)lround(settle_s / frame_s), frame_s, NULL, 0) < 0) err = PAL_ERR_FROZEN;
    for (int round = 0; round < PALM_ROUNDS && !err; round++) {
        for (int k = 0; k < 2; k++) {
            run_s[k][round] = run_steps(world[k], p, 1, (int)lround(palm_s / frame_s), frame_s, NULL, 0) / palm_s;
            if (run_s[k][round] < 0) err = PAL_ERR_FROZEN;
        }
        ratio[round] = run_s[1][round] / run_s[0][round];
    }
    if (err == PAL_ERR_FROZEN) pal_diagnostic_set(diag, err, "four levels: it diverged");
    for (int k = 0; k < 2; k++) {
        if (!err) {
            const pal_adaptive_surface *adaptive = pal_world_body(world[k], 0)->model.adaptive;
            out->n_node[k] = adaptive->n_node, out->n_spring[k] = adaptive->n_spring;
            out->second_s[k] = pal_median(run_s[k], PALM_ROUNDS);
        }
        pal_world_destroy(world[k]);
    }
    if (!err) out->ratio = pal_median(ratio, PALM_ROUNDS);
    return err;
}

/* ---- (c), (d) ---- */

static const double live_s = 1e-3;
enum { BALL_LEVELS = 4, LIVE_STEPS = 301 };

/* median milliseconds of the components, with their names */
static void store_component_times(pal_world *world, double *ms, int n_step, live_row *out)
{
    out->n_component = pal_world_component_count(world) < COMPONENTS ? pal_world_component_count(world) : COMPONENTS;
    for (int r = 0; r < out->n_component; r++) {
        pal_component_info info;
        pal_world_component_info(world, r, &info);
        snprintf(out->component[r], sizeof out->component[r], "%s", info.name);
        out->component_ms[r] = pal_median(ms + (size_t)r * LIVE_STEPS, n_step);
    }
}

static double timed_step(pal_world *world)
{
    pal_world_wake(world);
    uint64_t began = pal_clock_thread_ns();
    if (pal_world_step(world, live_s)) return NAN;
    return 1e-6 * (double)(pal_clock_thread_ns() - began);
}

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

/* splits and joins one face again and again, with a step after each and steps without any between */
static pal_err run_switches(pal_world *world, live_row *out, pal_diagnostic *diag)
{
    pal_body *body = pal_world_body(world, 0);
    pal_adaptive_surface *adaptive = body->model.adaptive;
    double us[2][SWITCHES], more[SWITCHES];
    int32_t face = find_leaf(adaptive, body);
    if (face < 0) return pal_diagnostic_set(diag, PAL_ERR_INTERNAL, "no face can be split alone");
    for (int turn = 0; turn < SWITCHES; turn++) {
        double with = 0, without = 0;
        for (int join = 0; join < 2; join++) {
            uint64_t began = pal_clock_thread_ns();
            if (join)
                pal_adaptive_join(adaptive, body, face);
            else
                pal_adaptive_split(adaptive, body, face, 0);
            pal_adaptive_update(adaptive, body);
            us[join][turn] = 1e-3 * (double)(pal_clock_thread_ns() - began);
            with += timed_step(world), without += timed_step(world);
        }
        more[turn] = 1e3 * (with - without) / 2;
    }
    out->split_us = pal_median(us[0], SWITCHES), out->join_us = pal_median(us[1], SWITCHES);
    out->after_us = pal_median(more, SWITCHES);
    return PAL_ERR_OK;
}

static pal_err run_live(const pressed *p, live_row *out, pal_diagnostic *diag)
{
    static double step_ms[LIVE_STEPS], component_ms[COMPONENTS][LIVE_STEPS];
    pal_world *world = NULL;
    PAL_TRY(start(p, ADAPTIVE, BALL_LEVELS, MAX_NODE, live_s, &world, diag));
    const pal_body *body = pal_world_body(world, 0);
    pal_err err = PAL_ERR_OK;
    if (run_steps(world, p, 1, 700, live_s, NULL, 0) < 0)
        err = pal_diagnostic_set(diag, PAL_ERR_FROZEN, "ball: it diverged");
    for (int step = 0; step < LIVE_STEPS && !err; step++) {
        step_ms[step] = timed_step(world);
        for (int r = 0; r < pal_world_component_count(world) && r < COMPONENTS; r++) {
            pal_component_info info;
            pal_world_component_info(world, r, &info);
            component_ms[r][step] = 1e-6 * (double)info.spent_ns;
        }
    }
    if (!err) {
        *out = (live_row){.n_finest = body->n_node,
                          .n_node = body->n_active,
                          .n_spring = body->model.adaptive->n_spring,
                          .n_sub = pal_world_substeps(world)};
        out->p50_ms = pal_median(step_ms, LIVE_STEPS), out->p95_ms = step_ms[LIVE_STEPS * 95 / 100];
        store_component_times(world, component_ms[0], LIVE_STEPS, out);
        err = run_switches(world, out, diag);
    }
    pal_world_destroy(world);
    return err;
}

/* ---- report ---- */

static void range_text(const int n[2], char text[32])
{
    snprintf(text, 32, n[0] == n[1] ? "%d" : "%d-%d", n[0], n[1]);
}

static void add_run(bench_report *r, const table_row *a, int k)
{
    char nodes[32], springs[32];
    range_text(a->n_node[k], nodes);
    range_text(a->n_spring[k], springs);
    bench_record(r);
    bench_text(r, "body", "body", -8, a->name);
    bench_text(r, "run", "run", -9, kind_name[k]);
    bench_text(r, "surface", "surface", -17, a->source);
    bench_text(r, "nodes", "nodes", 9, nodes);
    bench_text(r, "springs", "springs", 11, springs);
    bench_number(r, "moved_m", "moved m", 9, 5, a->moved_m[k]);
    bench_number(r, "off", "off", 7, 4, a->off[k]);
    bench_number(r, "substeps", "sub-steps", 10, 0, a->n_sub[k]);
    bench_number(r, "run_s", "run s", 9, 4, a->run_s[k]);
    bench_number(r, "paper_s", "paper s", 9, 3, a->paper_s[k]);
    bench_number(r, "ratio", "of refined", 10, 2, a->run_s[k] / a->run_s[REFINED]);
    bench_number(r, NULL, "of paper", 8, 2, a->paper_s[k] / a->paper_s[REFINED]);
    bench_number(r, NULL, "times as fast", 13, 0, a->paper_s[k] / a->run_s[k]);
}

static int print(const results *all, bool json, pal_err err, const pal_diagnostic *diag)
{
    bench_report r;
    const palm_row *p = &all->palm;
    const live_row *l = &all->live;
    bench_begin(&r, "adaptive", json);
    bench_number(&r, "rounds", NULL, 0, 0, ROUNDS);
    bench_number(&r, "simulated_s", NULL, 0, 0, press_s + free_s);
    bench_note(&r,
               "paper C, Table I, %.1f simulated seconds: pressed for %.0f s, then free; medians of %d, one core\n"
               "wanted: adaptive at most 0.30 of refined; stomach 500 times as fast refined, 1000 times adaptive",
               press_s + free_s, press_s, ROUNDS);
    bench_list(&r, "table");
    for (int t = 0; t < all->n_table && !err; t++)
        for (int k = 0; k < KINDS; k++) add_run(&r, &all->table[t], k);
    bench_note(
        &r, "\nfour levels, a palm refined, processor seconds of a simulated second; wanted: at most 0.08 of refined");
    bench_list(&r, "palm");
    for (int k = 0; k < 2 && !err; k++) {
        bench_record(&r);
        bench_text(&r, "run", "run", -9, kind_name[REFINED + k]);
        bench_number(&r, "nodes", "nodes", 7, 0, p->n_node[k]);
        bench_number(&r, "springs", "springs", 7, 0, p->n_spring[k]);
        bench_number(&r, "second_s", "s", 8, 3, p->second_s[k]);
        bench_number(&r, "ratio", "of refined", 10, 3, k ? p->ratio : 1);
    }
    bench_note(&r, "\nfinest level of %d nodes, steps of 1 ms; wanted: less than 1 ms", l->n_finest);
    bench_list(&r, "live");
    bench_record(&r);
    bench_number(&r, "finest_nodes", NULL, 0, 0, l->n_finest);
    bench_number(&r, "nodes", "nodes", 7, 0, l->n_node);
    bench_number(&r, "springs", "springs", 7, 0, l->n_spring);
    bench_number(&r, "substeps", "sub-steps", 9, 0, l->n_sub);
    bench_number(&r, "p50_ms", "ms p50", 7, 3, l->p50_ms);
    bench_number(&r, "p95_ms", "ms p95", 7, 3, l->p95_ms);
    bench_number(&r, "split_us", "split us", 9, 1, l->split_us);
    bench_number(&r, "join_us", "join us", 9, 1, l->join_us);
    bench_number(&r, "after_us", "next step us", 12, 1, l->after_us);
    bench_list(&r, "components");
    for (int k = 0; k < l->n_component && !err; k++) {
        bench_record(&r);
        bench_text(&r, "name", "component", -16, l->component[k]);
        bench_number(&r, "ms", "ms", 7, 4, l->component_ms[k]);
    }
    return bench_end(&r, err, diag);
}

/* the mass of what it encloses; pressed on a patch of a twelfth of its size */
static void fill(pressed *body, double force_N)
{
    const pal_surface *surface = &body->loaded->mesh[0].surface;
    double low[3], high[3];
    pal_surface_box(surface, low, high);
    body->mass_kg = 1000 * fabs(pal_surface_volume(surface));
    body->radius_m = pal_dist3(low, high) / 12, body->force_N = force_N;
}

/* the sphere is pressed at its equator, where every vertex is regular */
static pal_err run_tables(results *out, pal_diagnostic *diag)
{
    static const double paper_s[2][KINDS] = {{2.334, 10.078, 3.136}, {3.328, 14.422, 6.906}};
    static const char *const name[2] = {"sphere", "stomach"}, *const file[2] = {"sphere_114.obj", "stomach_188.obj"};
    static const int axis[2] = {0, 2};
    static const double force_N[2] = {0.025, 0.075};
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < TABLES && !err; k++) {
        const char *path = k & 1 ? shared_path(file[k / 2]) : NULL;
        if (k & 1 && !path) continue;
        pressed body;
        err = take(name[k / 2], path, axis[k / 2], &body, diag);
        if (!err) fill(&body, force_N[k / 2]);
        if (!err) err = run_table(&body, paper_s[k / 2], &out->table[out->n_table++], diag);
        pal_scene_free(body.loaded);
    }
    return err;
}

/* the trajectory of the pressed vertex of our own surfaces */
static pal_err draw_trajectories(const results *r, const char *path, pal_diagnostic *diag)
{
    static const char *const name[2][KINDS] = {{"sphere, coarse", "sphere, refined", "sphere, adaptive"},
                                               {"stomach, coarse", "stomach, refined", "stomach, adaptive"}};
    static double time_s[TABLE_STEPS], displacement_mm[2 * KINDS][TABLE_STEPS];
    pal_plot plot = {.title = "The vertex that is pressed for 2 s and then released",
                     .x_label = "time, s",
                     .y_label = "displacement, mm"};
    for (int i = 0; i < TABLE_STEPS; i++) time_s[i] = (i + 1) * frame_s;
    for (int t = 0, body = 0; t < r->n_table && body < 2; t++) {
        const table_row *row = &r->table[t];
        if (strcmp(row->source, "procedural") != 0) continue;
        for (int k = 0; k < KINDS; k++) {
            double *y = displacement_mm[plot.n_curve];
            for (int i = 0; i < row->n_sample; i++) y[i] = 1e3 * row->displacement_m[k][i];
            plot.curve[plot.n_curve++] = (pal_curve){
                .name = name[body][k], .n = row->n_sample, .x = time_s, .y = y, .bare = true, .dashed = k == ADAPTIVE};
        }
        body++;
    }
    return pal_plot_write(&plot, path, diag);
}

int bench_adaptive(bool json, const char *picture)
{
    static results r;
    pressed ball[2] = {{.name = NULL}};
    pal_diagnostic diag = {""};
    pal_err err = run_tables(&r, &diag);
    if (!err && picture) err = draw_trajectories(&r, picture, &diag);
    if (!err) err = make_ball(1, 0.035, 0.12, &ball[0], &diag);
    if (!err) err = run_palm(&ball[0], &r.palm, &diag);
    if (!err) err = make_ball(2, 0.016, 0.3, &ball[1], &diag);
    if (!err) err = run_live(&ball[1], &r.live, &diag);
    for (int k = 0; k < 2; k++) pal_scene_free(ball[k].loaded);
    return print(&r, json, err, &diag);
}
