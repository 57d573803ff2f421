/* What the hard cases (catalogue.txt) for model fem share: the elements and laws they run with, cases to a
 * body's shape, and runs that watch energy and finiteness after every step. */
#ifndef TESTS_STABILITY_FEM_HARD_H
#define TESTS_STABILITY_FEM_HARD_H
#include "server/base/vec3.h"
#include "server/sim/elements/elastic_hex.h"
#include "tests/fixtures/fem_beam.h"
#include "tests/fixtures/random.h"

typedef struct hard_kind {
    const char *element, *law, *shown;
} hard_kind;

static const hard_kind hard_kinds[] = {
    {"hex8_bbar", "corotational", "hex corot"}, {"tet4", "corotational", "tet4 corot"},
    {"hex8_bbar", "neo_hookean", "hex nh"},     {"tet4", "neo_hookean", "tet4 nh"},
    {"tet10", "corotational", "tet10 corot"},   {"tet10", "neo_hookean", "tet10 nh"}};
enum { HARD_HEX, HARD_TET, HARD_NEO_HEX, HARD_NEO_TET, HARD_TET10 };

/* sanitizers make everything slow: fewer steps and seeds then, and no elements of ten nodes */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { HARD_SLOW = 4, HARD_KINDS = 4 };
#else
enum { HARD_SLOW = 1, HARD_KINDS = 6 };
#endif

/* a box of nx x ny x nz voxels of 1 cm, soft and slightly damped, held at x = 0 unless free; not yet open */
static inline void hard_make(fem_beam *b, const hard_kind *kind, int nx, int ny, int nz, bool fixed)
{
    beam_make(b, nx, ny, nz, 0.01, fixed);
    beam_element(b, kind->element, kind->law);
    b->def->material = (pal_material){.young_Pa = 1e4, .poisson = 0.45, .density_kg_m3 = 1000, .damping_1_s = 4};
}

static inline pal_elastic_hexes *hard_hex_row(const fem_beam *b)
{
    for (int i = 0; i < pal_world_component_count(b->world); i++) {
        const pal_component *row = pal_world_component(b->world, i);
        if (!strcmp(row->effect->name, "hex_elastic")) return row->self;
    }
    return NULL;
}

/* tetrahedra of the body's mesh that are inverted or flat; hexahedra: corners too */
static inline int hard_inverted(const fem_beam *b)
{
    const pal_body *body = b->body;
    int n = 0;
    for (int t = 0; t < body->tets->n_tet; t++) {
        const int32_t *c = body->tets->tet + 4 * t;
        double e[3][3], g[3];
        for (int k = 0; k < 3; k++) pal_sub3(e[k], body->x + 3 * c[k + 1], body->x + 3 * c[0]);
        pal_cross3(g, e[1], e[2]);
        n += !(pal_dot3(e[0], g) > 0);
    }
    const pal_elastic_hexes *hex = hard_hex_row(b);
    return n + (hex && !(pal_hex_min_corner(hex, body) > 0.05));
}

static inline double hard_rms(const pal_body *body)
{
    double sum = 0;
    for (int i = 0; i < 3 * body->n_dof; i++) sum += pow(body->x[i] - body->x_rest[i], 2);
    return sqrt(sum / body->n_dof);
}

/* work of the lasting loads since rest */
static inline double hard_work_J(const pal_body *body)
{
    double sum = 0;
    for (int i = 0; i < 3 * body->n_node && body->external_force; i++)
        sum += body->external_force[i] * (body->x[i] - body->x_rest[i]);
    return sum;
}

/* kinetic and elastic energy */
static inline double hard_energy_J(const fem_beam *b)
{
    return pal_world_energy_J(b->world);
}

/* elements that recovery has replaced by the edges of a region */
static inline bool hard_recovers(const fem_beam *b)
{
    return pal_recovery_acts(hard_hex_row(b)->recovery);
}

/* how many elements those are */
static inline int hard_in_regions(const fem_beam *b)
{
    const pal_recovery *r = hard_hex_row(b)->recovery;
    int n = 0;
    for (int e = 0; e < r->model.n_element; e++) n += r->region[e] >= 0;
    return n;
}

enum { HARD_PLANE, HARD_POINT, HARD_MIRROR, HARD_BLOWN, HARD_SHUFFLE, HARD_SWAP, HARD_CASES };

static inline void hard_case(fem_beam *b, int trial_case, uint64_t seed)
{
    pal_body *body = b->body;
    double low[3], high[3];
    for (int c = 0; c < 3; c++) low[c] = INFINITY, high[c] = -INFINITY;
    for (int i = 0; i < 3 * body->n_node; i++)
        low[i % 3] = fmin(low[i % 3], body->x_rest[i]), high[i % 3] = fmax(high[i % 3], body->x_rest[i]);
    seed = 1000 + 7919 * seed;
    for (int i = 0; i < 10; i++) random_unit(&seed);
    for (int i = body->n_node - 1; i >= 0; i--) {
        double *x = body->x + 3 * i;
        if (body->support[i]) continue;
        if (trial_case == HARD_PLANE) x[2] = 0.3 * high[2];
        if (trial_case == HARD_POINT) pal_set3(x, 0.3 * high[0], 0.3 * high[1], 0.3 * high[2]);
        if (trial_case == HARD_MIRROR) x[0] = high[0] - x[0];
        if (trial_case == HARD_BLOWN) pal_scale3(x, 100, x);
        if (trial_case == HARD_SHUFFLE)
            for (int c = 0; c < 3; c++) x[c] = low[c] + random_unit(&seed) * (high[c] - low[c]);
        if (trial_case == HARD_SWAP) {
            int j = (int)(random_unit(&seed) * (i + 1));
            if (body->support[j]) continue;
            double keep[3];
            pal_copy3(keep, x);
            pal_copy3(x, body->x + 3 * j);
            pal_copy3(body->x + 3 * j, keep);
        }
    }
    pal_world_invalidate_limits(b->world, 0);
}

/* what a run of steps saw */
typedef struct hard_run {
    bool finite;
    double max;  /* energy less the work of lasting loads, over that at the begin */
    double rise; /* largest rise of it in one step in which no region began or ended, over that at the begin: those the
                    tank pays */
    double return_s; /* when it was within 0.1 % S of rest for good with no element inverted; INFINITY: was not */
} hard_run;

static inline void hard_steps(fem_beam *b, double seconds, double dt_s, hard_run *out)
{
    double first = hard_energy_J(b) - hard_work_J(b->body), before = pal_world_energy_J(b->world);
    before -= hard_work_J(b->body);
    int n = (int)lround(seconds / dt_s);
    const double size = fabs(first) > 0 ? fabs(first) : 1;
    *out = (hard_run){.finite = true, .max = 0, .return_s = INFINITY};
    for (int i = 0; i < n; i++) {
        uint64_t n_change = b->body->safeguards.n_change;
        pal_err err = pal_world_step(b->world, dt_s);
        out->finite = out->finite && !err && pal_body_finite(b->body) && !b->body->frozen;
        if (!out->finite) return;
        double now = pal_world_energy_J(b->world) - hard_work_J(b->body);
        out->max = fmax(out->max, now / size);
        if (b->body->safeguards.n_change == n_change) out->rise = fmax(out->rise, (now - before) / size);
        before = now;
        if (hard_rms(b->body) > 1e-3 * b->body->length_scale_m || hard_inverted(b) > 0)
            out->return_s = INFINITY;
        else if (isinf(out->return_s))
            out->return_s = (i + 1) * dt_s;
        /* all that is left is too little to take it away again */
        if (out->return_s < (i + 1) * dt_s - 0.5 && pal_world_energy_J(b->world) < 1e-4 * size) return;
    }
}
#endif
