/* Bodies whose nodes are carried by control points, with springs between the corners of every cell for a material:
 * linear ones (forces along the direction at rest) or true ones. For tests of implicit solvers. */
#ifndef TESTS_SIM_EMBEDDED_THING_H
#define TESTS_SIM_EMBEDDED_THING_H
#include "server/base/arena.h"
#include "server/base/vec3.h"
#include "server/mesh/cell_shapes.h"
#include "server/sim/effect_list.h"
#include "server/sim/implicit.h"
#include "server/sim/solid_mass.h"
#include "tests/check.h"

/* ---- springs between corners of cells ---- */

enum { SPRING_MOST = 20000 };
typedef struct springs {
    bool linear; /* forces along the direction at rest */
    int n;
    int32_t pair[SPRING_MOST][2];
    double k_N_m, line[SPRING_MOST][3], rest_m[SPRING_MOST]; /* at rest, unit                 */
    double way[SPRING_MOST][3], across[SPRING_MOST];         /* of the last linearise         */
} springs;

/* between the ends: unit direction and how much longer than at rest */
static inline double stretch(const springs *s, const pal_body *body, int i, double way[3])
{
    const double *a = body->d + 3 * s->pair[i][0], *b = body->d + 3 * s->pair[i][1], l0 = s->rest_m[i];
    pal_sub3(way, b, a);
    if (s->linear) {
        double longer = pal_dot3(way, s->line[i]) - l0;
        pal_copy3(way, s->line[i]);
        return longer;
    }
    double l = pal_norm3(way);
    pal_scale3(way, 1 / l, way);
    return l - l0;
}

static inline pal_err springs_run(void *self, pal_step *step)
{
    const springs *s = self;
    for (int i = 0; i < s->n; i++) {
        double way[3], longer = stretch(s, step->body, i, way);
        pal_axpy3(step->body->f + 3 * s->pair[i][0], s->k_N_m * longer, way);
        pal_axpy3(step->body->f + 3 * s->pair[i][1], -s->k_N_m * longer, way);
    }
    return PAL_ERR_OK;
}

static inline double springs_energy(void *self, const pal_body *body)
{
    const springs *s = self;
    double sum = 0, way[3];
    for (int i = 0; i < s->n; i++) {
        double longer = stretch(s, body, i, way);
        sum += 0.5 * s->k_N_m * longer * longer;
    }
    return sum;
}

static inline bool springs_couple(void *self, pal_cliques *out)
{
    springs *s = self;
    *out = (pal_cliques){.n_item = s->n, .n_corner = 2, .node = s->pair[0]};
    return true;
}

static inline void springs_linearise(void *self, const pal_body *body)
{
    springs *s = self;
    for (int i = 0; i < s->n; i++) {
        double longer = stretch(s, body, i, s->way[i]);
        s->across[i] = s->linear ? 0 : fmax(0, longer / (longer + s->rest_m[i]));
    }
}

static inline void springs_multiply(void *self, const pal_body *body, double k, double c, const double *p, double *out)
{
    const springs *s = self;
    (void)body, (void)c;
    for (int i = 0; i < s->n; i++) {
        double u[3], f[3];
        pal_sub3(u, p + 3 * s->pair[i][1], p + 3 * s->pair[i][0]);
        pal_scale3(f, (1 - s->across[i]) * pal_dot3(s->way[i], u), s->way[i]);
        pal_axpy3(f, s->across[i], u);
        pal_axpy3(out + 3 * s->pair[i][0], -k * s->k_N_m, f);
        pal_axpy3(out + 3 * s->pair[i][1], k * s->k_N_m, f);
    }
}

static const pal_tangent open_tangent = {
    .couple = springs_couple, .linearise = springs_linearise, .multiply = springs_multiply};
static const pal_tangent silent_tangent = {.linearise = springs_linearise, .multiply = springs_multiply};
static const pal_effect open_springs = {.name = "open_springs",
                                        .stage = PAL_STAGE_FORCE,
                                        .internal = true,
                                        .run = springs_run,
                                        .energy = springs_energy,
                                        .tangent = &open_tangent};
static const pal_effect silent_springs = {.name = "silent_springs",
                                          .stage = PAL_STAGE_FORCE,
                                          .internal = true,
                                          .run = springs_run,
                                          .energy = springs_energy,
                                          .tangent = &silent_tangent};

/* ---- a body ---- */

typedef struct thing {
    pal_arena *arena;
    pal_cells cells;
    pal_scene *scene;
    pal_body_def *def;
    pal_body body;
    pal_solid_mass mass;
    springs *springs;
    pal_row row[2];
    int n_row;
    pal_build build;
    pal_item item;
    pal_row solve;
    double dt_s;
} thing;

static pal_note note;

static inline void add_springs(thing *t)
{
    static const int corner_of_cubic[8] = {21, 37, 25, 41, 22, 38, 26, 42};
    springs *s = t->springs;
    const pal_solid *solid = t->body.solid;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_PYRAMID; kind++)
        for (int e = 0; e < solid->elements.n[kind]; e++)
            for (int a = 0; a < 8; a++)
                for (int b = 0; b < a; b++) {
                    const int32_t *node = pal_solid_nodes(solid, kind, e);
                    int32_t from = node[kind ? a : corner_of_cubic[a]], to = node[kind ? b : corner_of_cubic[b]];
                    if (s->n == SPRING_MOST) return;
                    s->pair[s->n][0] = from, s->pair[s->n][1] = to;
                    pal_sub3(s->line[s->n], t->body.d + 3 * to, t->body.d + 3 * from);
                    s->rest_m[s->n] = pal_norm3(s->line[s->n]);
                    pal_scale3(s->line[s->n], 1 / s->rest_m[s->n], s->line[s->n]);
                    s->n++;
                }
}

/* block of n cells of 5 cm, subdivided once; no solver yet */
static inline bool make_thing(thing *t, int nx, int ny, int nz, bool linear, bool between)
{
    const int32_t n[3] = {nx, ny, nz};
    const double size[3] = {0.05 * nx, 0.05 * ny, 0.05 * nz};
    memset(t, 0, sizeof *t);
    t->arena = pal_arena_create(1 << 20, true);
    t->scene = calloc(1, sizeof *t->scene);
    t->springs = calloc(1, sizeof *t->springs);
    if (!t->arena || !t->scene || !t->springs || pal_cells_block(n, size, &t->cells, &note)) return false;
    pal_scene_default(t->scene);
    t->def = &t->scene->body[0];
    t->def->cells = &t->cells;
    t->def->material = (pal_material){.young_Pa = 1e4, .poisson = 0.3, .density_kg_m3 = 1000};
    const pal_subdivision_options options = {.n_level = 1};
    pal_body *body = &t->body;
    body->name = "body";
    if (pal_solid_make(t->def, &options, &body->solid, &note)) return false;
    if (pal_body_allocate_embedded(body, t->arena, &body->solid->rows)) return false;
    memcpy(body->x_rest, t->cells.x, 3 * sizeof(double) * (size_t)body->n_dof);
    memcpy(body->x, t->cells.x, 3 * sizeof(double) * (size_t)body->n_dof);
    memcpy(body->node_rest, body->solid->node_rest, 3 * sizeof(double) * (size_t)body->n_node);
    pal_body_place(body);
    body->size_m = pal_norm3(size), body->h_m = 0.025, body->load_cap_N = INFINITY;
    pal_solid_mass_lump(body->solid, body->mass_kg, body->node_mass_kg);
    if (pal_solid_mass_make(body->solid, t->arena, &t->mass)) return false;
    if (between) body->solid_mass = &t->mass;
    t->springs->linear = linear;
    t->springs->k_N_m = 20;
    add_springs(t);
    t->row[0] = (pal_row){.effect = &open_springs, .self = t->springs};
    t->n_row = 1;
    t->dt_s = t->scene->step_s = 1.0 / 60;
    t->build = (pal_build){.scene = t->scene, .def = t->def, .body = body, .arena = t->arena, .note = &note};
    pal_item_init(&t->item, "solver", "");
    return true;
}

static inline bool add_drag(thing *t, double rate_1_s)
{
    pal_item item;
    pal_item_init(&item, "effects[0]", "viscous");
    pal_item_put_number(&item, "rate_1_s", rate_1_s, NULL);
    t->row[1].effect = &pal_effect_viscous;
    t->n_row = 2;
    return !pal_effect_viscous.make(&item, &t->build, &t->row[1].self);
}

static inline bool add_solver(thing *t, const pal_effect *effect, const char *key, double number)
{
    t->build.made = t->row, t->build.n_made = t->n_row;
    if (key) pal_item_put_number(&t->item, key, number, NULL);
    t->solve.effect = effect;
    pal_err err = effect->make(&t->item, &t->build, &t->solve.self);
    if (err) printf("  %s\n", note.text);
    return !err;
}

static inline void free_thing(thing *t)
{
    if (t->solve.self && t->solve.effect->destroy) t->solve.effect->destroy(t->solve.self);
    pal_solid_free(t->body.solid);
    pal_cells_free(&t->cells);
    pal_arena_destroy(t->arena);
    free(t->scene), free(t->springs);
}

/* one sub-step; loads on nodes stay as they are */
static inline bool go(thing *t)
{
    pal_step step = {.body = &t->body, .force = t->row, .n_force = t->n_row, .dt_s = t->dt_s, .n_sub = 1};
    return !t->solve.effect->run(t->solve.self, &step) && !t->body.frozen;
}

static inline pal_solve_report report_of(const thing *t)
{
    pal_solve_report out = {0};
    t->solve.effect->report(t->solve.self, &out);
    return out;
}

/* a number in [-1, 1] that is the same everywhere */
static inline double noise(unsigned *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (double)(*state >> 8) / (1 << 23) - 1;
}

static inline void shake(thing *t, double x_m, double v_m_s)
{
    unsigned state = 7;
    for (int i = 0; i < 3 * t->body.n_dof; i++) {
        double dx = x_m * noise(&state), v = v_m_s * noise(&state);
        if (t->body.held[i / 3]) continue;
        t->body.x[i] += dx, t->body.v[i] = v;
    }
    pal_body_place(&t->body);
}

/* holds the points of the lowest layer */
static inline int hold_floor(thing *t)
{
    double low = INFINITY;
    int n = 0;
    for (int i = 0; i < t->body.n_dof; i++) low = fmin(low, t->body.x_rest[3 * i + 2]);
    for (int i = 0; i < t->body.n_dof; i++)
        if (t->body.x_rest[3 * i + 2] < low + 1e-9) t->body.held[i] = 1, n++;
    return n;
}

/* a load across on the nodes of the upper half */
static inline void load_top(thing *t, double force_N)
{
    int n = 0;
    for (int i = 0; i < t->body.n_node; i++) n += t->body.node_rest[3 * i + 2] > 0;
    for (int i = 0; i < t->body.n_node; i++)
        if (t->body.node_rest[3 * i + 2] > 0) pal_set3(t->body.load + 3 * i, force_N / n, 0.3 * force_N / n, 0);
}

/* M of points as the body has it: out = M p */
static inline void multiply_mass(const thing *t, const double *p, double *out)
{
    if (t->body.solid_mass) {
        pal_solid_mass_multiply(&t->mass, p, out);
        return;
    }
    for (int i = 0; i < 3 * t->body.n_dof; i++) out[i] = t->body.mass_kg[i / 3] * p[i];
}

static inline double energy_J(thing *t)
{
    double *q = malloc(3 * sizeof(double) * (size_t)t->body.n_dof), sum = 0;
    multiply_mass(t, t->body.v, q);
    for (int i = 0; i < 3 * t->body.n_dof; i++) sum += 0.5 * q[i] * t->body.v[i];
    free(q);
    return sum + springs_energy(t->springs, &t->body);
}

static inline double work_J(const thing *t)
{
    double sum = 0;
    for (int i = 0; i < 3 * t->body.n_node; i++) sum += t->body.load[i] * (t->body.d[i] - t->body.node_rest[i]);
    return sum;
}
#endif
