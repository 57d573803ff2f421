/* palpate bench adaptive: surfaces whose level of detail follows what happens (model adaptive_springs), on one core, in
 * processor time; medians of several rounds, ratios within a round.
 *
 * (a) Table I of paper C: a sphere of 114 and a stomach of 188 vertices, our own and, when they are there, those of
 *     ../shared (PAL_SHARED names another folder), coarse, wholly refined (450, 746) and
 *     adaptive, pressed at one place for 2 s and then free for 0.3 s: the 2.3 s after which the paper shows its bodies
 *     (Fig. 11). The paper does not give its constants; ours: E 5 kPa, a wall of 3 mm that bears the mass of what it
 *     encloses, 1000 kg/m^3, anchors fixed in space, thresholds from size and stiffness. Every body has a look at the
 *     press for 0.1 ms before the run, so that what adapts is there when it begins. `off` is how far the pressed vertex
 *     strays from its way in the wholly refined body, at most, in parts of that way (Fig. 12). A picture shows those
 * ways over time, of our own two surfaces (Figs. 10 and 12). (b) a hollow ball of 0.2 m with four levels, the finest of
 * 28,674 vertices, on which a palm of 7 cm rests: once its place is refined, against all of it refined. (c) the same
 * with a finest level of 114,690 vertices, at most 2,000 of them active, in steps of 1 ms. (d) there, what one switch
 * costs: a face split or joined, and what the rows have to do anew in the step after it.
 *
 * The press is spread over the nodes of a patch by their masses and a smooth bump: the same pressure on every level. */
#include "server/bench/bench.h"

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
    MOST_NODE = 2000,
    ROWS = 12
};
enum { COARSE, REFINED, ADAPTIVE };
static const char *const kind_name[KINDS] = {"coarse", "refined", "adaptive"};
static const double frame_s = 1.0 / 60, press_s = 2, free_s = 0.3, look_s = 1e-4;

/* a body with its scene, and the patch that is pressed */
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
    int n_node[KINDS][2], n_spring[KINDS][2]; /* least and most active */
    int n_sub[KINDS];                         /* sub-steps of a run    */
    double run_s[KINDS], moved_m[KINDS];      /* moved_m: the vertex pressed, at the end of the press */
    double way_m[KINDS][TABLE_STEPS];         /* the same after every step                            */
    int n_trajectory;
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
    int n_row;
    char row[ROWS][24];
    double row_ms[ROWS];
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

/* ---- the press ---- */

/* the press, or with share 0 none, on the nodes that are there now */
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

/* steps on, the press following the nodes; returns seconds of processor time of the steps alone, < 0: it froze */
static double go(pal_world *world, const pressed *p, double share, int n_step, double step_s, table_row *told, int kind)
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
        if (!told) continue;
        told->n_sub[kind] += pal_world_substeps(world);
        if (told->n_trajectory < TABLE_STEPS) told->way_m[kind][told->n_trajectory++] = moved(body, p);
        int *node = told->n_node[kind], *spring = told->n_spring[kind];
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
            out->n_sub[kind] = out->n_trajectory = 0;
            double looking = go(world[kind], p, 1, 1, look_s, NULL, 0);
            double pressing = go(world[kind], p, 1, (int)lround(press_s / frame_s), frame_s, out, kind);
            out->moved_m[kind] = moved(pal_world_body(world[kind], 0), p);
            double after = go(world[kind], p, 0, (int)lround(free_s / frame_s), frame_s, out, kind);
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
    double most = 0;
    for (int i = 0; i < out->n_trajectory; i++) most = fmax(most, out->way_m[REFINED][i]);
    for (int kind = 0; kind < KINDS; kind++)
        for (int i = 0; i < out->n_trajectory; i++)
            out->off[kind] = fmax(out->off[kind], fabs(out->way_m[kind][i] - out->way_m[REFINED][i]) / most);
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
    if (!err && go(world[1], p, 1, (int)lround(settle_s / frame_s), frame_s, NULL, 0) < 0) err = PAL_ERR_FROZEN;
    for (int round = 0; round < PALM_ROUNDS && !err; round++) {
        for (int k = 0; k < 2; k++) {
            run_s[k][round] = go(world[k], p, 1, (int)lround(palm_s / frame_s), frame_s, NULL, 0) / palm_s;
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

/* milliseconds of the rows that took the most, under their names */
static void tell_rows(pal_world *world, double *ms, int n_step, live_row *out)
{
    out->n_row = pal_world_component_count(world) < ROWS ? pal_world_component_count(world) : ROWS;
    for (int r = 0; r < out->n_row; r++) {
        pal_component_info info;
        pal_world_component_info(world, r, &info);
        snprintf(out->row[r], sizeof out->row[r], "%s", info.name);
        out->row_ms[r] = pal_median(ms + (size_t)r * LIVE_STEPS, n_step);
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
    static double step_ms[LIVE_STEPS], row_ms[ROWS][LIVE_STEPS];
    pal_world *world = NULL;
    PAL_TRY(start(p, ADAPTIVE, BALL_LEVELS, MOST_NODE, live_s, &world, diag));
    const pal_body *body = pal_world_body(world, 0);
    pal_err err = PAL_ERR_OK;
    if (go(world, p, 1, 700, live_s, NULL, 0) < 0) err = pal_diagnostic_set(diag, PAL_ERR_FROZEN, "ball: it diverged");
    for (int step = 0; step < LIVE_STEPS && !err; step++) {
        step_ms[step] = timed_step(world);
        for (int r = 0; r < pal_world_component_count(world) && r < ROWS; r++) {
            pal_component_info info;
            pal_world_component_info(world, r, &info);
            row_ms[r][step] = 1e-6 * (double)info.spent_ns;
        }
    }
    if (!err) {
        *out = (live_row){.n_finest = body->n_node,
                          .n_node = body->n_active,
                          .n_spring = body->model.adaptive->n_spring,
                          .n_sub = pal_world_substeps(world)};
        out->p50_ms = pal_median(step_ms, LIVE_STEPS), out->p95_ms = step_ms[LIVE_STEPS * 95 / 100];
        tell_rows(world, row_ms[0], LIVE_STEPS, out);
        err = run_switches(world, out, diag);
    }
    pal_world_destroy(world);
    return err;
}

/* ---- saying ---- */

static void print_table(const results *r)
{
    printf("Table I of paper C, %.1f simulated seconds: pressed for %.0f s, then free; medians of %d, one core\n",
           press_s + free_s, press_s, ROUNDS);
    printf("%-8s %-9s %-17s %9s %11s %10s %7s %10s %9s %9s %8s\n", "body", "run", "surface", "nodes", "springs",
           "moved mm", "off %", "sub-steps", "run s", "paper s", "faster");
    for (int t = 0; t < r->n_table; t++) {
        const table_row *a = &r->table[t];
        for (int k = 0; k < KINDS; k++) {
            char node[32], spring[32];
            bool one = a->n_node[k][0] == a->n_node[k][1];
            snprintf(node, sizeof node, one ? "%d" : "%d-%d", a->n_node[k][0], a->n_node[k][1]);
            snprintf(spring, sizeof spring, one ? "%d" : "%d-%d", a->n_spring[k][0], a->n_spring[k][1]);
            printf("%-8s %-9s %-17s %9s %11s %10.2f %7.2f %10d %9.4f %9.3f %7.0fx\n", a->name, kind_name[k], a->source,
                   node, spring, 1e3 * a->moved_m[k], 100 * a->off[k], a->n_sub[k], a->run_s[k], a->paper_s[k],
                   a->paper_s[k] / a->run_s[k]);
        }
        printf(
            "%-8s adaptive / refined %.2f (at most 0.30 is asked for; the paper's %.2f); against the paper's refined "
            "run %.0fx and %.0fx (at least 500x refined and 1000x adaptive are asked of the stomach)\n",
            a->name, a->ratio, a->paper_s[ADAPTIVE] / a->paper_s[REFINED], a->paper_s[REFINED] / a->run_s[REFINED],
            a->paper_s[REFINED] / a->run_s[ADAPTIVE]);
    }
    const palm_row *p = &r->palm;
    printf("\nfour levels, a palm refined: %d of %d nodes, %d of %d springs, %.3f s of %.3f s for a simulated second: "
           "%.3f (at most 0.08 is asked for)\n",
           p->n_node[1], p->n_node[0], p->n_spring[1], p->n_spring[0], p->second_s[1], p->second_s[0], p->ratio);
    const live_row *l = &r->live;
    printf("\nfinest level of %d nodes, %d active (%d springs), steps of 1 ms in %d sub-steps: %.3f ms, 95 %% below "
           "%.3f (less than 1 is asked for)\n",
           l->n_finest, l->n_node, l->n_spring, l->n_sub, l->p50_ms, l->p95_ms);
    for (int k = 0; k < l->n_row; k++) printf("  %-16s %.4f ms\n", l->row[k], l->row_ms[k]);
    printf("there, one switch of a face: split %.1f us, joined %.1f us, and %.1f us in the step after it\n",
           l->split_us, l->join_us, l->after_us);
}

static void print_json(const results *r)
{
    printf("{\"bench\":\"adaptive\",\"rounds\":%d,\"simulated_s\":%.2f,\"table\":[", ROUNDS, press_s + free_s);
    for (int t = 0; t < r->n_table; t++) {
        const table_row *a = &r->table[t];
        printf("%s{\"body\":\"%s\",\"surface\":\"%s\",\"ratio\":%.4f,\"runs\":[", t ? "," : "", a->name, a->source,
               a->ratio);
        for (int k = 0; k < KINDS; k++)
            printf("%s{\"run\":\"%s\",\"nodes\":[%d,%d],\"springs\":[%d,%d],\"moved_m\":%.6f,\"off\":%.5f,\"substeps\":"
                   "%d,\"run_s\":"
                   "%.6f,"
                   "\"paper_s\":%.3f}",
                   k ? "," : "", kind_name[k], a->n_node[k][0], a->n_node[k][1], a->n_spring[k][0], a->n_spring[k][1],
                   a->moved_m[k], a->off[k], a->n_sub[k], a->run_s[k], a->paper_s[k]);
        printf("]}");
    }
    const palm_row *p = &r->palm;
    const live_row *l = &r->live;
    printf("],\"palm\":{\"nodes\":[%d,%d],\"springs\":[%d,%d],\"second_s\":[%.6f,%.6f],\"ratio\":%.4f},", p->n_node[0],
           p->n_node[1], p->n_spring[0], p->n_spring[1], p->second_s[0], p->second_s[1], p->ratio);
    printf("\"live\":{\"finest_nodes\":%d,\"nodes\":%d,\"springs\":%d,\"substeps\":%d,\"step_ms\":1,\"p50_ms\":%.4f,"
           "\"p95_ms\":%.4f,\"rows_ms\":{",
           l->n_finest, l->n_node, l->n_spring, l->n_sub, l->p50_ms, l->p95_ms);
    for (int k = 0; k < l->n_row; k++) printf("%s\"%s\":%.5f", k ? "," : "", l->row[k], l->row_ms[k]);
    printf("}},\"switch\":{\"split_us\":%.2f,\"join_us\":%.2f,\"after_us\":%.2f}}\n", l->split_us, l->join_us,
           l->after_us);
}

/* as heavy as what it encloses, pressed on a patch of a twelfth of its size */
static void fill(pressed *body, double force_N)
{
    const pal_surface *surface = &body->loaded->mesh[0].surface;
    double low[3], high[3];
    pal_surface_box(surface, low, high);
    body->mass_kg = 1000 * fabs(pal_surface_volume(surface));
    body->radius_m = pal_dist3(low, high) / 12, body->force_N = force_N;
}

/* the sphere is pressed at its equator, which has no pole of many faces */
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

/* the way of the pressed vertex over time, of what was made here */
static pal_err draw_ways(const results *r, const char *path, pal_diagnostic *diag)
{
    static const char *const name[2][KINDS] = {{"sphere, coarse", "sphere, refined", "sphere, adaptive"},
                                               {"stomach, coarse", "stomach, refined", "stomach, adaptive"}};
    static double time_s[TABLE_STEPS], way_mm[2 * KINDS][TABLE_STEPS];
    pal_plot plot = {.title = "The vertex that is pressed for 2 s and then let go",
                     .x_label = "time, s",
                     .y_label = "displacement, mm"};
    for (int i = 0; i < TABLE_STEPS; i++) time_s[i] = (i + 1) * frame_s;
    for (int t = 0, body = 0; t < r->n_table && body < 2; t++) {
        const table_row *row = &r->table[t];
        if (strcmp(row->source, "procedural") != 0) continue;
        for (int k = 0; k < KINDS; k++) {
            double *y = way_mm[plot.n_curve];
            for (int i = 0; i < row->n_trajectory; i++) y[i] = 1e3 * row->way_m[k][i];
            plot.curve[plot.n_curve++] = (pal_curve){.name = name[body][k],
                                                     .n = row->n_trajectory,
                                                     .x = time_s,
                                                     .y = y,
                                                     .bare = true,
                                                     .dashed = k == ADAPTIVE};
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
    if (!err && picture) err = draw_ways(&r, picture, &diag);
    if (!err) err = make_ball(1, 0.035, 0.12, &ball[0], &diag);
    if (!err) err = run_palm(&ball[0], &r.palm, &diag);
    if (!err) err = make_ball(2, 0.016, 0.3, &ball[1], &diag);
    if (!err) err = run_live(&ball[1], &r.live, &diag);
    for (int k = 0; k < 2; k++) pal_scene_free(ball[k].loaded);
    if (err) {
        fprintf(stderr, "palpate bench: adaptive: %s\n", diag.text[0] ? diag.text : pal_err_text(err));
        return err == PAL_ERR_MEMORY ? 3 : 1;
    }
    if (json)
        print_json(&r);
    else
        print_table(&r);
    return 0;
}
