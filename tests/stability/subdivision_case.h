/* What the hard cases (catalogue.txt) for model subdivision_fem share: the solvers and operators they run with,
 * cases to the control points, and runs that watch energy and finiteness after every step. */
#ifndef TESTS_STABILITY_SOLID_HARD_H
#define TESTS_STABILITY_SOLID_HARD_H
#include "server/sim/subdivision/subdivision_mass.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/subdivision_scene.h"

typedef struct solid_kind {
    const char *solver, *operator, * shown;
    bool explicit, energy; /* energy: forces are a gradient */
} solid_kind;

static const solid_kind solid_kinds[] = {{"implicit_euler", "polar", "implicit polar", false, true},
                                         {"central_cg", "polar", "explicit polar", true, true},
                                         {"implicit_euler", "edges", "implicit edges", false, false},
                                         {"central_cg", "edges", "explicit edges", true, false}};
enum { SOLID_IMPLICIT, SOLID_EXPLICIT, SOLID_POLAR, SOLID_KINDS = 4 };

static const double solid_step_s = 1.0 / 60;

/* a block of n cells of 2 cm, one level, smooth; its lowest points held unless free; not yet open */
static inline void solid_make(solid_scene *s, const solid_kind *kind, int nx, int ny, int nz, bool fixed)
{
    const double size[3] = {0.02 * nx, 0.02 * ny, 0.02 * nz};
    solid_scene_take(s, solid_scene_box((const int32_t[3]){nx, ny, nz}, size, false), 1, kind->solver, kind->operator);
    if (fixed) solid_scene_hold(s, 2, 1e-6);
}

/* velocities of any direction for what is not held */
static inline void solid_kick(solid_scene *s, double speed_m_s, uint64_t seed)
{
    for (int i = 0; i < 3 * s->body->n_dof; i++)
        if (!s->body->support[i / 3]) s->body->v[i] = speed_m_s * (2 * random_unit(&seed) - 1);
}

/* elements that are turned over or flat in their middle */
static inline int solid_inverted(const solid_scene *s)
{
    const pal_subdivision_solid *solid = s->body->model.solid;
    const double middle[3] = {0.5, 0.5, 0.5};
    int n = 0;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        double g[64][3], jacobian[9];
        pal_cell_shape(pal_cell_kind_nodes(kind), middle, NULL, g);
        for (int e = 0; e < solid->elements.n[kind]; e++)
            n += !(pal_subdivision_solid_jacobian(s->body->d, pal_subdivision_solid_nodes(solid, kind, e),
                                                  pal_cell_kind_nodes(kind), g, jacobian) > 0);
    }
    return n;
}

static inline double solid_rms(const pal_body *body)
{
    double sum = 0;
    for (int i = 0; i < 3 * body->n_dof; i++) sum += pow(body->x[i] - body->x_rest[i], 2);
    return sqrt(sum / body->n_dof);
}

/* work of the lasting loads since rest */
static inline double solid_work_J(const pal_body *body)
{
    double sum = 0;
    for (int i = 0; i < 3 * body->n_node && body->external_force; i++)
        sum += body->external_force[i] * (body->d[i] - body->node_rest[i]);
    return sum;
}

/* momentum and angular momentum about the middle of mass, of masses between points */
static inline void solid_momentum(const pal_body *body, double linear[3], double angular[3])
{
    double *q = calloc(3 * (size_t)body->n_dof, sizeof *q), c[3], middle[3] = {0, 0, 0}, mass = 0;
    if (!q) abort();
    pal_set3(linear, 0, 0, 0), pal_set3(angular, 0, 0, 0);
    pal_mass_operator_multiply(body->mass_operator, 1, 0, NULL, body->v, q);
    for (int i = 0; i < body->n_dof; i++) {
        pal_add3(linear, linear, q + 3 * i);
        pal_cross3(c, body->x + 3 * i, q + 3 * i);
        pal_add3(angular, angular, c);
        pal_axpy3(middle, body->mass_kg[i], body->x + 3 * i);
        mass += body->mass_kg[i];
    }
    pal_scale3(middle, 1 / mass, middle);
    pal_cross3(c, middle, linear);
    pal_sub3(angular, angular, c);
    free(q);
}

enum { SOLID_PLANE, SOLID_POINT, SOLID_MIRROR, SOLID_BLOWN, SOLID_SHUFFLE, SOLID_SWAP, SOLID_CASES };
static const char *const subdivision_case_names[] = {"plane", "point", "mirror", "x 100", "shuffle", "swap"};

static inline void solid_case(solid_scene *s, int trial_case, uint64_t seed)
{
    pal_body *body = s->body;
    double low[3], high[3];
    for (int c = 0; c < 3; c++) low[c] = INFINITY, high[c] = -INFINITY;
    for (int i = 0; i < 3 * body->n_dof; i++)
        low[i % 3] = fmin(low[i % 3], body->x_rest[i]), high[i % 3] = fmax(high[i % 3], body->x_rest[i]);
    seed = 1000 + 7919 * seed;
    for (int i = 0; i < 10; i++) random_unit(&seed);
    for (int i = body->n_dof - 1; i >= 0; i--) {
        double *x = body->x + 3 * i;
        if (body->support[i]) continue;
        if (trial_case == SOLID_PLANE) x[2] = 0.3 * high[2];
        if (trial_case == SOLID_POINT) pal_set3(x, 0.3 * high[0], 0.3 * high[1], 0.3 * high[2]);
        if (trial_case == SOLID_MIRROR) x[0] = high[0] - x[0];
        if (trial_case == SOLID_BLOWN) pal_scale3(x, 100, x);
        if (trial_case == SOLID_SHUFFLE)
            for (int c = 0; c < 3; c++) x[c] = low[c] + random_unit(&seed) * (high[c] - low[c]);
        if (trial_case == SOLID_SWAP) {
            int j = (int)(random_unit(&seed) * (i + 1));
            double keep[3];
            if (body->support[j]) continue;
            pal_copy3(keep, x);
            pal_copy3(x, body->x + 3 * j);
            pal_copy3(body->x + 3 * j, keep);
        }
    }
    pal_body_update_nodes(body);
    pal_world_invalidate_limits(s->world, 0);
}

/* what a run of steps saw */
typedef struct solid_run {
    bool finite;
    double max;      /* energy less the work of lasting loads, over that at the begin */
    double rise;     /* largest rise of it in one step, over that at the begin */
    double return_s; /* when it was within 0.1 % S of rest for good with no element inverted; INFINITY: was not */
} solid_run;

static inline void solid_steps(solid_scene *s, double seconds, double dt_s, solid_run *out)
{
    double first = pal_world_energy_J(s->world) - solid_work_J(s->body), before = first;
    int n = (int)lround(seconds / dt_s);
    const double size = fabs(first) > 0 ? fabs(first) : 1;
    *out = (solid_run){.finite = true, .max = 0, .return_s = INFINITY};
    for (int i = 0; i < n; i++) {
        pal_err err = pal_world_step(s->world, dt_s);
        out->finite = out->finite && !err && pal_body_finite(s->body) && !s->body->frozen;
        if (!out->finite) return;
        double now = pal_world_energy_J(s->world) - solid_work_J(s->body);
        out->max = fmax(out->max, now / size), out->rise = fmax(out->rise, (now - before) / size);
        before = now;
        if (solid_rms(s->body) > 1e-3 * s->body->length_scale_m || solid_inverted(s) > 0)
            out->return_s = INFINITY;
        else if (isinf(out->return_s))
            out->return_s = (i + 1) * dt_s;
        /* all that is left is too little to take it away again */
        if (out->return_s < (i + 1) * dt_s - 0.3 && pal_world_energy_J(s->world) < 1e-4 * size) return;
    }
}
#endif
