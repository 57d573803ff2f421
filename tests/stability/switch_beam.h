/* A beam in many configurations, for the tests of live switches (server/sim/transfer/transfer.h). */
#ifndef TESTS_STABILITY_SWITCH_BEAM_H
#define TESTS_STABILITY_SWITCH_BEAM_H
#include "server/base/vec3.h"
#include "server/mesh/cells/cell_shapes.h"
#include "server/sim/core/configuration.h"
#include "server/sim/transfer/transfer.h"
#include "tests/check.h"
#include "tests/fixtures/boxes.h"

#include <math.h>

#define LENGTH 0.2
#define WIDTH  0.05
enum { MAX_LEVELS = 8 };

static bool table;

static const pal_configuration full[] = {
    {.model = "fem", .element = "hex8_bbar", .size = 8},
    {.model = "fem", .element = "hex8_bbar", .size = 12},
    {.model = "fem", .element = "hex8", .law = "neo_hookean", .size = 8},
    {.model = "fem", .element = "tet4", .size = 12, .step_s = 1.0 / 120},
    {.model = "fem", .element = "tet10", .solver = "sdirk2", .size = 8},
    {.model = "tet_springs", .size = 8, .k_area_J = -1},
    {.model = "tet_springs", .size = 12, .k_area_J = -1},
};

/* a beam, its configurations and where each of them rests under its weight */
typedef struct beam {
    pal_prepared mesh;
    pal_cells cells;
    pal_scene *scene;
    int n;
    pal_configured_scene *set[MAX_LEVELS];
    double rest_m[MAX_LEVELS]; /* of the tip, upward */
    double right_m;            /* the same by a finer mesh */
} beam;

static inline pal_world *open_world(const pal_scene *scene)
{
    pal_diagnostic diag = {""};
    pal_world *w = NULL;
    if (pal_world_create(scene, &diag, &w)) CHECK_FAIL("%s", diag.text);
    return w;
}

static inline void make_cells(beam *b)
{
    const int32_t count[3] = {6, 2, 2};
    const double size[3] = {LENGTH, WIDTH, WIDTH};
    pal_surface surface = {0};
    REQUIRE(!pal_cells_block(count, size, &b->cells, NULL));
    for (int i = 0; i < 3 * b->cells.n_vertex; i++) b->cells.x[i] += 0.5 * size[i % 3];
    REQUIRE(!pal_cells_boundary(&b->cells, &surface, NULL, NULL));
    REQUIRE(!pal_prepared_surface(&surface, &b->mesh));
    pal_surface_free(&surface);
}

static inline void add_effects(pal_body_def *def, bool fixed)
{
    def->n_effect = 0;
    if (fixed) pal_entry_init(&def->effect[def->n_effect++], "effects[0]", "gravity");
    pal_entry_init(&def->effect[def->n_effect++], "effects[1]", "tool_push");
    pal_entry_init(&def->effect[def->n_effect++], "effects[2]", "tool_grasp");
    pal_entry_init(&def->effect[def->n_effect++], "effects[3]", "finite_guard");
}

/* clamped at x = 0 and under its weight, or free in space */
static inline void begin(beam *b, bool cells, bool fixed, double damping_1_s)
{
    memset(b, 0, sizeof *b);
    if (cells)
        make_cells(b);
    else if (box_make(16, 4, 4, WIDTH / 4, &b->mesh))
        abort();
    b->scene = box_scene(&b->mesh, fixed, false);
    if (cells) pal_body_default_cells(&b->scene->body[0], "beam", &b->mesh, &b->cells);
    pal_body_def *def = &b->scene->body[0];
    def->material = (pal_material){.young_Pa = 4e5, .poisson = 0.4, .density_kg_m3 = 1000, .damping_1_s = damping_1_s};
    def->n_support = fixed;
    def->support[0] = (pal_support_def){.low_m = {-1, -1e9, -1e9}, .high_m = {1e-3, 1e9, 1e9}};
    add_effects(def, fixed);
    b->scene->step_s = 1.0 / 60;
    b->scene->max_substep = 20000;
    pal_tools_default(b->scene, 2);
    for (int k = 0; k < 2; k++) b->scene->tool[k].radius_m = 0.015;
}

static inline void add_configuration(beam *b, const pal_configuration *s)
{
    pal_diagnostic diag = {""};
    if (pal_configuration_make(b->scene, 0, s, &diag, &b->set[b->n])) CHECK_FAIL("%s", diag.text);
    b->n++;
}

static inline void end(beam *b)
{
    for (int i = 0; i < b->n; i++) pal_configured_scene_free(b->set[i]);
    pal_cells_free(&b->cells);
    free(b->scene);
    box_free(&b->mesh);
}

/* mean displacement of nodes near the end face */
static inline void tip_of(pal_world *w, double move[3], double speed[3])
{
    const pal_body *b = pal_world_body(w, 0);
    double last = 0;
    int n = 0;
    pal_set3(move, 0, 0, 0);
    pal_set3(speed, 0, 0, 0);
    for (int i = 0; i < b->n_node; i++) last = fmax(last, b->node_rest[3 * i]);
    for (int i = 0; i < b->n_node; i++) {
        if (b->node_rest[3 * i] < last - 0.001) continue;
        for (int c = 0; c < 3; c++) move[c] += b->d[3 * i + c] - b->node_rest[3 * i + c];
        pal_add3(speed, speed, b->dv + 3 * i);
        n++;
    }
    pal_scale3(move, 1.0 / n, move);
    pal_scale3(speed, 1.0 / n, speed);
}

static inline double tip_z(pal_world *w)
{
    double move[3], speed[3];
    tip_of(w, move, speed);
    return move[2];
}

static inline void step(pal_world *w, double step_s, int n)
{
    for (int k = 0; k < n; k++) {
        CHECK(!pal_world_step(w, step_s));
        pal_world_remove_idle(w);
    }
}

static inline pal_pose at(double x, double y, double z, uint32_t buttons)
{
    return (pal_pose){.position_m = {x, y, z}, .quat = {1, 0, 0, 0}, .buttons = buttons};
}

/* where the tip rests: damped until it is still */
static inline double find_rest(const pal_scene *from)
{
    pal_scene *scene = malloc(sizeof *scene);
    if (!scene) abort();
    *scene = *from;
    scene->body[0].material.damping_1_s = 25;
    scene->step_s = 1.0 / 30;
    pal_world *w = open_world(scene);
    step(w, scene->step_s, 20);
    double z = tip_z(w);
    pal_world_destroy(w);
    free(scene);
    return z;
}

/* it falls into its weight, is pressed from above near the end, and swings meanwhile */
static inline bool disturb(pal_world *w, double step_s)
{
    bool touched = false;
    for (double t = 0; t < 0.25; t += step_s) {
        pal_pose p = at(0.15, 0.025, 0.07 - 0.093 * t, 0);
        pal_world_pose(w, 0, &p);
        step(w, step_s, 1);
        touched |= pal_world_tools(w)->tool[0].touching;
    }
    return touched;
}

#endif
