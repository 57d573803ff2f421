/* Worlds of one beam whose elements recover from inversion, for every kind of element. */
#ifndef TESTS_SIM_RECOVERY_WORLD_H
#define TESTS_SIM_RECOVERY_WORLD_H
#include "server/base/vec3.h"
#include "server/sim/core/effect.h"
#include "server/sim/recovery/recovery.h"
#include "tests/fixtures/fem_beam.h"
#include "tests/fixtures/random.h"

typedef struct recovery_kind {
    const char *element, *law;
    bool implicit; /* energy falls in every step */
} recovery_kind;
static const recovery_kind recovery_kinds[] = {{"hex8_bbar", "corotational", true},
                                               {"hex8", "neo_hookean", true},
                                               {"tet4", "corotational", true},
                                               {"tet4", "neo_hookean", true},
                                               {"tet10", "corotational", true}};
enum { RECOVERY_KINDS = sizeof recovery_kinds / sizeof *recovery_kinds };

static inline void recovery_open(fem_beam *b, const recovery_kind *kind, int nx, int ny, int nz)
{
    pal_diagnostic diag = {{0}};
    beam_make(b, nx, ny, nz, 0.01, true);
    beam_element(b, kind->element, kind->law);
    b->def->material = (pal_material){.young_Pa = 1e4, .poisson = 0.45, .density_kg_m3 = 1000, .damping_1_s = 4};
    REQUIRE(!beam_open(b, &diag));
}

static inline pal_recovery *recovery_state(const fem_beam *b)
{
    for (int i = 0; i < pal_world_component_count(b->world); i++) {
        const pal_component *row = pal_world_component(b->world, i);
        if (row->effect->recovery.state) return row->effect->recovery.state(row->self);
    }
    return NULL;
}

/* what never rises without loads, while there are regions */
static inline double recovery_book_J(const pal_recovery *r)
{
    return r->counted_J + r->tank_J - r->debt_J;
}

/* 0: mirrored, 1: shuffled, 2: in one point */
static inline void recovery_distort(fem_beam *b, int shape, uint64_t seed)
{
    pal_body *body = b->body;
    for (int i = 0; i < 3 * body->n_node; i++) {
        if (body->support[i / 3]) continue;
        const double size = i % 3 ? b->width_m : b->length_m;
        body->x[i] = shape == 0 ? size - body->x_rest[i] : shape == 1 ? size * random_unit(&seed) : 0.5 * size;
    }
}

static inline double recovery_rms(const pal_body *body)
{
    double sum = 0;
    for (int i = 0; i < 3 * body->n_node; i++) sum += pow(body->x[i] - body->x_rest[i], 2);
    return sqrt(sum / body->n_node);
}
#endif
