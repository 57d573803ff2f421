/* Component tet_elastic: elastic tetrahedra of four or ten nodes (elastic_tet.h).
 *
 * Keys: element ("tet4" or "tet10"; default by the body's elements), law ("corotational", "linear", "neo_hookean"),
 * fill (true: stiffness by the fraction of material in each element where the body has it), recover (true).
 *
 * Inversion recovery extends the rule of elastic_tet.h, which alone left bodies with ten-node elements or the
 * neo-Hookean law inverted permanently. Under an implicit solver the whole body uses its split while any piece is
 * inverted: tetrahedra of four nodes (eight in one of ten), corotational, with the rule and Poisson ratios of at most
 * PAL_SPLIT_POISSON_MAX. Pieces are checked when the tangent is taken, against det F <= 0 (corotational tet4) or the
 * ratios PAL_INVERTED_LOW and, for neo_hookean, _HIGH; the body has recovered when every piece is within
 * PAL_TET_RECOVERED_LOW and, for neo_hookean, _HIGH. A body that rests folded on the split is straightened.
 *
 * `internal` is true for corotational and neo_hookean. The linear law has no net force, but a torque under rotation,
 * and ten-node corotational elements have a torque while an element is almost completely crushed (elastic_tet.h). */
#include "server/base/clock.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/core/force_cache.h"
#include "server/sim/elements/elastic_tet.h"

#include <math.h>

typedef struct tet_elastic {
    pal_elastic_tets whole;         /* first member: tests read it */
    pal_elastic_tets *split;        /* NULL: no inversion recovery by the split */
    double *rest_m3;                /* volume of each piece at rest [n_piece] */
    double min_volume_m3;           /* of the pieces that are checked */
    bool has_inversion, cheap;      /* cheap: whole.n_inverted shows that the body is inverted */
    uint64_t n_inversion, n_switch; /* since run, which has the body */
    pal_force_cache force_cache;    /* under an implicit solver: of `whole` while nothing is inverted */
} tet_elastic;

/* the split: eight tetrahedra of four nodes in one of ten */
static pal_err cut(const tet_elastic *tets, pal_arena *arena, pal_elastic_tets_options *to)
{
    static const int piece[8][4] = {{0, 4, 6, 7}, {4, 1, 5, 8}, {6, 5, 2, 9}, {7, 8, 9, 3},
                                    {6, 8, 4, 5}, {6, 8, 5, 9}, {6, 8, 9, 7}, {6, 8, 7, 4}};
    const pal_elastic_tets_options *from = &tets->whole.options;
    *to = *from;
    to->law = PAL_LAW_COROTATIONAL, to->recover = true, to->max_poisson = PAL_LOCK_FREE_POISSON;
    if (from->n_corner == 4) return PAL_ERR_OK;
    to->n_corner = 4, to->n_tet = 8 * from->n_tet;
    int32_t *tet = PAL_NEW(arena, int32_t, 4 * (size_t)to->n_tet);
    float *fill = PAL_NEW(arena, float, from->fill ? to->n_tet : 0);
    if (!tet || !fill) return PAL_ERR_MEMORY;
    for (int i = 0; i < to->n_tet; i++) {
        for (int c = 0; c < 4; c++) tet[4 * i + c] = from->tet[10 * (i / 8) + piece[i % 8][c]];
        if (from->fill) fill[i] = from->fill[i / 8];
    }
    to->tet = tet, to->fill = from->fill ? fill : NULL;
    return PAL_ERR_OK;
}

static pal_err make_split(tet_elastic *tets, pal_build *build)
{
    const pal_elastic_tets_options *whole = &tets->whole.options;
    const double h = build->body->edge_m;
    pal_elastic_tets_options options;
    PAL_TRY(cut(tets, build->arena, &options));
    tets->split = PAL_NEW(build->arena, pal_elastic_tets, 1);
    if (!tets->split) return PAL_ERR_MEMORY;
    PAL_TRY(pal_elastic_tets_make(&options, build, tets->split));
    tets->cheap = whole->n_corner == 4 && whole->law == PAL_LAW_COROTATIONAL;
    /* skip slivers: they invert at any contact and say nothing about the body */
    tets->min_volume_m3 = 1e-3 / 6 * h * h * h;
    tets->rest_m3 = PAL_NEW(build->arena, double, options.n_tet);
    if (!tets->rest_m3) return PAL_ERR_MEMORY;
    for (int i = 0; i < options.n_tet; i++) tets->rest_m3[i] = pal_tet_volume(build->body->x_rest, options.tet + 4 * i);
    return PAL_ERR_OK;
}

static bool is_inverted(const tet_elastic *tets, const double *x)
{
    if (tets->cheap && !tets->has_inversion) return tets->whole.n_inverted > 0;
    const double low = tets->has_inversion ? PAL_TET_RECOVERED_LOW : PAL_INVERTED_LOW,
                 high = tets->has_inversion ? PAL_TET_RECOVERED_HIGH : PAL_INVERTED_HIGH;
    bool neo = tets->whole.options.law == PAL_LAW_NEO_HOOKEAN;
    const pal_elastic_tets_options *pieces = &tets->split->options;
    for (int i = 0; i < pieces->n_tet; i++) {
        if (fabs(tets->rest_m3[i]) < tets->min_volume_m3) continue;
        double det = pal_tet_volume(x, pieces->tet + 4 * i) / tets->rest_m3[i];
        if (det < low || (neo && det > high)) return true;
    }
    return false;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    const pal_body *body = build->body;
    pal_elastic_tets_options options = {.recover = true};
    static const char *const elements[] = {"tet4", "tet10"};
    int quadratic = body->n_corner == 10;
    bool fill = true;
    PAL_TRY(pal_elastic_law_read(item, &options.law, build->diag));
    PAL_TRY(pal_entry_read_choice(item, "element", elements, 2, &quadratic, build->diag));
    options.n_corner = quadratic ? 10 : 4;
    PAL_TRY(pal_entry_read_bool(item, "fill", &fill, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "recover", &options.recover, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    bool own = body->element && body->n_corner == options.n_corner;
    if (!own && (options.n_corner == 10 || !body->tets))
        return PAL_REFUSE(build->diag, "%s: body \"%s\" has no elements of %d nodes", item->path, body->name,
                          options.n_corner);
    options.tet = own ? body->element : body->tets->tet;
    options.n_tet = own ? body->n_element : body->tets->n_tet;
    options.fill = own && fill ? body->fill : NULL;
    tet_elastic *tets = PAL_NEW(build->arena, tet_elastic, 1);
    if (!tets) return PAL_ERR_MEMORY;
    *self = tets;
    PAL_TRY(pal_elastic_tets_make(&options, build, &tets->whole));
    if (body->implicit) PAL_TRY(pal_force_cache_make(body->n_node, build->arena, &tets->force_cache));
    return options.recover && body->implicit && options.law != PAL_LAW_LINEAR ? make_split(tets, build) : PAL_ERR_OK;
}

/* elements that forces come from now */
static pal_elastic_tets *acting(void *self)
{
    tet_elastic *tets = self;
    return tets->has_inversion ? tets->split : &tets->whole;
}

static pal_err run(void *self, pal_step *step)
{
    tet_elastic *tets = self;
    step->body->safeguards.n_inversion += tets->n_inversion, step->body->safeguards.n_split += tets->n_switch;
    tets->n_inversion = tets->n_switch = 0;
    const uint64_t before = tets->has_inversion ? pal_clock_ns() : 0;
    if (!tets->has_inversion && pal_force_cache_matches(&tets->force_cache, step->body->d))
        pal_force_cache_add(&tets->force_cache, step->body->f);
    else
        pal_elastic_tets_force(acting(self), step->body->d, step->body->f);
    if (tets->has_inversion) step->body->safeguards.ns += pal_clock_ns() - before;
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    tet_elastic *tets = self;
    if (tets->has_inversion) return pal_elastic_tets_energy(tets->split, body->d, NULL);
    if (pal_force_cache_matches(&tets->force_cache, body->d)) return tets->force_cache.energy_J;
    double sum = pal_elastic_tets_energy(&tets->whole, body->d, pal_force_cache_begin(&tets->force_cache, body->d));
    /* the fallback of inverted elements may differ at the next evaluation */
    return tets->whole.n_inverted > 0 ? sum : pal_force_cache_commit(&tets->force_cache, sum);
}

static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    pal_elastic_tets_bound(acting(self), body->d, bound_N_m);
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    tet_elastic *tets = self;
    (void)body, (void)diag;
    pal_elastic_tets_material(&tets->whole, to);
    if (tets->split) pal_elastic_tets_material(tets->split, to);
    pal_force_cache_invalidate(&tets->force_cache);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    tet_elastic *tets = self;
    (void)body;
    pal_elastic_tets_reset(&tets->whole);
    if (tets->split) pal_elastic_tets_reset(tets->split), tets->split->n_single_rotation = 0;
    tets->has_inversion = false;
    pal_force_cache_invalidate(&tets->force_cache);
    tets->n_inversion = tets->n_switch = 0;
}

static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    pal_elastic_tets_measure(acting(self), body->d, field, sum, volume_m3);
}

static void stress(void *self, const pal_body *body, pal_stress_take *take, void *user)
{
    pal_elastic_tets_stress(acting(self), body->d, take, user);
}

static bool couple(void *self, pal_cliques *out)
{
    const pal_elastic_tets_options *of = &((tet_elastic *)self)->whole.options;
    *out = (pal_cliques){.n_item = of->n_tet, .n_corner = of->n_corner, .node = of->tet};
    return true;
}

static void linearise(void *self, const pal_body *body)
{
    tet_elastic *tets = self;
    bool before = tets->has_inversion, known = tets->split && (before || !tets->cheap);
    bool reported = known && is_inverted(tets, body->d);
    if (!reported) pal_elastic_tets_linearise(&tets->whole, body->d);
    tets->has_inversion = known ? reported : tets->split && is_inverted(tets, body->d);
    tets->n_inversion += tets->has_inversion;
    tets->n_switch += tets->has_inversion != before;
    if (tets->has_inversion && !before) pal_elastic_tets_reset(tets->split);
    if (tets->split) tets->n_switch += pal_elastic_tets_check_rest(tets->split, body, tets->has_inversion);
    if (tets->has_inversion) pal_elastic_tets_linearise(tets->split, body->d);
}

static void multiply(void *self, const pal_body *body, double k, const double *p, double *out)
{
    (void)body;
    pal_elastic_tets_multiply(acting(self), k, p, out);
}

static void assemble(void *self, double k, pal_block_matrix *to)
{
    pal_elastic_tets_assemble(acting(self), k, to);
}

static void rotate(void *self, double *rotation)
{
    pal_elastic_tets_rotate(acting(self), rotation);
}

static const pal_tangent tangent = {
    .couple = couple, .linearise = linearise, .multiply = multiply, .assemble = assemble, .rotate = rotate};

const pal_effect pal_effect_tet_elastic = {
    PAL_EFFECT("tet_elastic", FORCE),
    .internal = true,
    .energy = energy,
    .bounds.stiffness = stiffness,
    .material = material,
    .reset = reset,
    .tangent = &tangent,
    .inspect = {.measure = measure, .fields = PAL_ELASTIC_FIELDS, .stress = stress}};
