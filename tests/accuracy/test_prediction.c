/* What the live estimate says of a body's error, and foresees of half and twice the size
 * (server/estimate/estimate_predict.h), against what such meshes leave: the same body, made in those sizes as a switch
 * makes it, at rest under the same load, against a mesh that is finer still. That one is off as well, by the share that
 * order 1.5 gives it, which is added. Both are asked for within a factor of 2, of organs too, whose voxels are cut
 * (server/estimate/estimate_hierarchy.h). With PALPATE_LONG=1 in more and finer sizes (about a minute). */
#include "server/base/vec3.h"
#include "server/estimate/estimation.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/problem_file.h"
#include "server/scene/scene_file.h"
#include "server/solve/load_case.h"
#include "server/study/study.h"
#include "tests/check.h"

enum { PROBES = 800 };
static const double order = 1.5;

typedef struct body {
    pal_configured_scene *set;
    pal_scene *scene; /* own */
    pal_world *world;
    pal_locate *locate;
} body;

static void body_free(body *b)
{
    pal_locate_destroy(b->locate);
    pal_world_destroy(b->world);
    free(b->scene);
    pal_configured_scene_free(b->set);
}

/* aside, in proportion to the nodes' masses, of E S^2 */
static bool put_load(pal_world *world, const pal_scene *scene, double pull)
{
    pal_body *b = pal_world_body(world, 0);
    const double aside[3] = {scene->up[1], scene->up[2], scene->up[0]};
    double sum_kg = 0, total = pull * scene->body[0].material.young_Pa * b->length_scale_m * b->length_scale_m, f[3];
    b->load_cap_N = INFINITY;
    for (int i = 0; i < b->n_node; i++) sum_kg += b->node_mass_kg[i];
    for (int i = 0; i < b->n_node; i++) {
        pal_scale3(f, total * b->node_mass_kg[i] / sum_kg, aside);
        if (pal_world_load(world, 0, i, f)) return false;
    }
    return true;
}

static pal_scene *alone(const pal_scene *scene)
{
    pal_scene *out = malloc(sizeof *out);
    if (!out) abort();
    *out = *scene;
    out->n_tool = 0, out->body[0].n_effect = 0, out->body[0].output.name[0] = 0;
    return out;
}

/* made of so many voxels, at rest under the load */
static bool rest(const pal_scene *from, int size, double pull, body *to)
{
    pal_configuration s;
    pal_diagnostic diag = {""};
    pal_solve_report report = {.converged = false};
    memset(to, 0, sizeof *to);
    pal_configuration_of(from, 0, &s);
    s.size = size;
    if (pal_configuration_make(from, 0, &s, &diag, &to->set)) CHECK_FAIL("%s", diag.text);
    if (!to->set) return false;
    to->scene = alone(&to->set->scene);
    pal_body_def *def = &to->scene->body[0];
    pal_entry_init(&def->solver, "solver", "static_newton");
    if (pal_world_create(to->scene, &diag, &to->world)) CHECK_FAIL("%s", diag.text);
    if (!to->world || !put_load(to->world, to->scene, pull)) return false;
    for (int k = 0; k < 20 && !report.converged; k++) {
        if (pal_world_step(to->world, 0.01)) return false;
        pal_world_solve_report(to->world, 0, &report);
    }
    const pal_body *b = pal_world_view_body(to->world, 0);
    return report.converged && !pal_locate_create(b->tets, b->n_corner == 8 ? b->hexes : NULL, &to->locate);
}

static void moved(const body *of, const double x[3], double u[3])
{
    const pal_body *b = pal_world_view_body(of->world, 0);
    double local[4], shape[10];
    const int32_t *node;
    int e = pal_locate_point(of->locate, x, local, NULL), n = pal_case_shape_functions(b, e, local, shape, &node);
    pal_set3(u, 0, 0, 0);
    for (int k = 0; k < n; k++) {
        pal_axpy3(u, shape[k], b->d + 3 * (size_t)node[k]);
        pal_axpy3(u, -shape[k], b->node_rest + 3 * (size_t)node[k]);
    }
}

/* the largest distance at vertices of the surface */
static double off(const body *a, const body *truth, const pal_surface *s)
{
    double max = 0;
    for (int i = 0; i < s->n_vertex; i += 1 + s->n_vertex / PROBES) {
        double u[3], v[3];
        moved(a, s->x + 3 * (size_t)i, u);
        moved(truth, s->x + 3 * (size_t)i, v);
        max = fmax(max, pal_dist3(u, v));
    }
    return max;
}

/* of the body where it rests */
static bool estimate(const body *at, double pull, pal_estimate *out)
{
    pal_estimation *work = NULL;
    pal_world *world = NULL;
    pal_scene *live = alone(&at->set->scene);
    bool good = !pal_world_create(live, NULL, &world) && put_load(world, live, pull) &&
                !pal_estimation_open(live, 0, NULL, NULL, &work);
    if (good) {
        pal_estimate_state *s = pal_estimation_state(work);
        good = pal_estimate_copy(s, world, 0);
        memcpy(s->x, pal_world_view_body(at->world, 0)->x, 3 * sizeof *s->x * (size_t)s->n_dof);
        s->n_substep = 1, s->n_cost = 1, s->cost[0].ms = 1;
        good = good && pal_estimation_run(work, out);
    }
    pal_estimation_close(work);
    pal_world_destroy(world);
    free(live);
    return good;
}

/* the part of discretisation of the neighbour in size; NaN: none is offered */
static double predicted(const pal_estimate *e, int size)
{
    for (int i = 0; i < e->n_neighbour; i++)
        if (e->neighbour[i].configuration.size == size)
            return e->neighbour[i].error_m - e->error_m + e->discretisation_m;
    return NAN;
}

/* within a factor of 2 of what is left */
static void compare(const char *name, int size, int at, double left, double reported)
{
    printf("  | %s, %d voxels | %d | %.3f | %.3f | %.2f |\n", name, size, at, 1e3 * left, 1e3 * reported,
           reported / left);
    CHECK(reported >= left / 2 && reported <= 2 * left);
}

/* cut: many voxels are, and the display says so */
static void check_size(const char *name, const pal_scene *scene, int size, int finest, double pull, bool cut)
{
    const int at[4] = {size, size / 2, 2 * size, finest};
    const pal_surface *surface = &scene->body[0].mesh->surface;
    body b[4] = {{NULL}};
    pal_estimate e = {.n_neighbour = 0};
    pal_configured_scene *other = NULL;
    pal_configuration twice;
    /* of its own size a scene keeps its mesh: from another one it is made as all the others are */
    pal_configuration_of(scene, 0, &twice);
    twice.size = 2 * size;
    bool good = !pal_configuration_make(scene, 0, &twice, NULL, &other);
    for (int k = 0; k < 4 && good; k++) good = rest(&other->scene, at[k], pull, &b[k]);
    good = good && estimate(&b[0], pull, &e);
    CHECK(good);
    double rest_m = good ? off(&b[2], &b[3], surface) / (pow(finest / (2.0 * size), order) - 1) : 0;
    for (int k = 0; k < 3 && good; k++)
        compare(name, size, at[k], off(&b[k], &b[3], surface) + rest_m,
                k == 0 ? e.discretisation_m : predicted(&e, at[k]));
    CHECK((strstr(e.diag, "voxels are cut: good to a factor of 2") != NULL) == cut);
    for (int k = 0; k < 4; k++) body_free(&b[k]);
    pal_configured_scene_free(other);
}

static void a_bar_in_every_element(void)
{
    static const char *const element[] = {"hex8_bbar", "hex8", "tet4"};
    pal_problem *p = NULL;
    pal_surface surface = {0};
    pal_surface_report report;
    pal_diagnostic diag = {""};
    const pal_mesh_file_options options = {.unit_m = 1, .weld = PAL_MESH_WELD};
    pal_err err = pal_problem_read("deploy/problems/bar.json", &p, &diag);
    if (!err) err = pal_mesh_file_read(p->surface, &options, &surface, &report, NULL, NULL, &diag);
    for (int k = 0; k < 3 && !err; k++) {
        pal_configured_scene *set = NULL;
        err = pal_study_problem_scene(p, &surface, &diag, &set);
        if (err) break;
        if (pal_entry_put_text(&set->scene.body[0].model, "element", element[k], NULL)) CHECK_FAIL("%s", element[k]);
        char name[32];
        snprintf(name, sizeof name, "bar, %s", element[k]);
        check_size(name, &set->scene, 16, 48, 3e-5, false);
        pal_configured_scene_free(set);
    }
    if (err) CHECK_FAIL("%s", diag.text);
    pal_surface_free(&surface);
    free(p);
}

typedef struct organ {
    const char *file, *element; /* file: of ../shared/data; NULL: our own organ */
    double up[3], hold, pull;
    int size, finest;
} organ;

static void check_organ(const organ *o)
{
    const char *path = o->file ? check_shared(o->file) : NULL;
    pal_loaded_scene *loaded = NULL;
    pal_diagnostic diag = {""};
    const pal_surface_scene made = {.label = -1,
                                    .hold = o->hold,
                                    .fem = true,
                                    .resolution = o->size,
                                    .element = o->element,
                                    .up = {o->up[0], o->up[1], o->up[2]}};
    char name[64];
    if (o->file && !path) return;
    pal_err err = path ? pal_scene_from_surface(path, &made, &loaded, NULL, &diag)
                       : pal_scene_procedural(&made, &loaded, NULL, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    snprintf(name, sizeof name, "%s, %s", o->file ? strrchr(o->file, '/') + 1 : "our own organ", o->element);
    if (!err) check_size(name, &loaded->scene, o->size, o->finest, o->pull, true);
    pal_scene_free(loaded);
}

#define KIDNEY  "data/kidney_ct_6k.ply", "hex8_bbar", {0, -1, 0}, 0.15, 1e-4
#define LIVER   "data/liver_ct_20k.ply", "hex8_bbar", {0, -1, 0}, 0.12, 1e-4
#define STOMACH "data/stomach_human_11k.obj", "hex8_bbar", {0, 0, 1}, 0.15, 1e-4
#define OURS    {0, 0, 1}, 0.3, 1e-3

static void organs_of_cut_voxels(void)
{
    static const organ organs[] = {{NULL, "hex8_bbar", OURS, 10, 28},
                                   {NULL, "tet4", OURS, 8, 24},
                                   {KIDNEY, 10, 28},
                                   {LIVER, 8, 24},
                                   {STOMACH, 9, 24}};
    for (size_t i = 0; i < sizeof organs / sizeof *organs; i++) check_organ(&organs[i]);
}

/* our own organ in 20 voxels is not among them: what 40 leave there is told 0.38 to 0.6 of what meshes of 64 and of 72
 * voxels make of it, which do not agree themselves */
static void organs_in_more_sizes(void)
{
    static const organ organs[] = {{NULL, "hex8_bbar", OURS, 14, 48},
                                   {NULL, "tet4", OURS, 14, 40},
                                   {NULL, "hex8", OURS, 10, 28},
                                   {KIDNEY, 14, 40},
                                   {KIDNEY, 20, 56},
                                   {LIVER, 10, 32},
                                   {LIVER, 14, 40},
                                   {LIVER, 16, 48},
                                   {LIVER, 20, 56},
                                   {STOMACH, 12, 36},
                                   {STOMACH, 14, 40}};
    for (size_t i = 0; i < sizeof organs / sizeof *organs; i++) check_organ(&organs[i]);
}

int main(void)
{
    printf("  | case | in voxels | true mm | told mm | ratio |\n");
    RUN(a_bar_in_every_element);
    RUN_LONG(organs_of_cut_voxels);
    if (getenv("PALPATE_LONG")) RUN_LONG(organs_in_more_sizes);
    return check_report();
}
