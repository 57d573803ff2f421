/* Component tet_elastic: elastic tetrahedra of four or ten nodes (elastic_tet.h).
 *
 * Keys: element ("tet4" or "tet10"; default by the body's elements), law ("corotational", "linear", "neo_hookean"),
 * fill (true: stiffness by the fraction of material in each element where the body has it), recover (true: recovery
 * from inversion, recovery/recovery.h; not for linear).
 *
 * `internal` is true for corotational and neo_hookean. The linear law has no net force, but a torque under rotation,
 * and ten-node corotational elements have a torque while an element is almost completely crushed (elastic_tet.h). */
#include "server/sim/core/effect_list.h"
#include "server/sim/core/force_cache.h"
#include "server/sim/elements/elastic_tet.h"

typedef struct tet_elastic {
    pal_elastic_tets whole;      /* first member: tests read it                     */
    pal_force_cache force_cache; /* under an implicit solver: of the elements alone */
} tet_elastic;

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
    if (!body->implicit) return PAL_ERR_OK;
    tets->whole.counted = &tets->force_cache;
    return pal_force_cache_make(body->n_node, build->arena, &tets->force_cache);
}

static pal_err run(void *self, pal_step *step)
{
    tet_elastic *tets = self;
    pal_body *body = step->body;
    pal_recovery_select(tets->whole.recovery, body);
    if (pal_force_cache_matches(&tets->force_cache, body->d))
        pal_force_cache_add(&tets->force_cache, body->f);
    else
        pal_elastic_tets_force(&tets->whole, body->d, body->f);
    pal_recovery_add_forces(tets->whole.recovery, body);
    return PAL_ERR_OK;
}

static double elements_energy(tet_elastic *tets, const double *d)
{
    if (pal_force_cache_matches(&tets->force_cache, d)) return tets->force_cache.energy_J;
    double sum = pal_elastic_tets_energy(&tets->whole, d, pal_force_cache_begin(&tets->force_cache, d));
    return pal_force_cache_commit(&tets->force_cache, sum);
}

static double energy(void *self, const pal_body *body)
{
    tet_elastic *tets = self;
    pal_recovery_select(tets->whole.recovery, body);
    return elements_energy(tets, body->d) + pal_recovery_energy(tets->whole.recovery, body->d, NULL);
}

static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    tet_elastic *tets = self;
    pal_recovery_select(tets->whole.recovery, body);
    pal_elastic_tets_bound(&tets->whole, body->d, bound_N_m);
    pal_recovery_bound(tets->whole.recovery, bound_N_m);
}

static unsigned recover(void *self, pal_step *step)
{
    return pal_recovery_update(((tet_elastic *)self)->whole.recovery, step);
}

static pal_recovery *recovery(void *self)
{
    return ((tet_elastic *)self)->whole.recovery;
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    tet_elastic *tets = self;
    (void)body, (void)diag;
    pal_elastic_tets_material(&tets->whole, to);
    pal_force_cache_invalidate(&tets->force_cache);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    tet_elastic *tets = self;
    (void)body;
    pal_elastic_tets_reset(&tets->whole);
    pal_force_cache_invalidate(&tets->force_cache);
}

static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    if (field == PAL_FIELD_DENSITY_KG_M3)
        pal_body_measure_density(body, sum, volume_m3);
    else
        pal_elastic_tets_measure(self, body->d, field, sum, volume_m3);
}

static void stress(void *self, const pal_body *body, pal_stress_take *take, void *user)
{
    pal_elastic_tets_stress(self, body->d, take, user);
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
    pal_recovery_select(tets->whole.recovery, body);
    pal_elastic_tets_linearise(&tets->whole, body->d);
}

static void multiply(void *self, const pal_body *body, double k, const double *p, double *out)
{
    (void)body;
    tet_elastic *tets = self;
    pal_elastic_tets_multiply(&tets->whole, k, p, out);
    pal_recovery_multiply(tets->whole.recovery, k, p, out);
}

static void assemble(void *self, double k, pal_block_matrix *to)
{
    tet_elastic *tets = self;
    pal_elastic_tets_assemble(&tets->whole, k, to);
    pal_recovery_assemble(tets->whole.recovery, k, to);
}

static void rotate(void *self, const pal_body *body, double *rotation)
{
    (void)body;
    pal_elastic_tets_rotate(self, rotation);
    pal_recovery_rotate(((tet_elastic *)self)->whole.recovery, rotation);
}

static const pal_tangent tangent = {
    .couple = couple, .linearise = linearise, .multiply = multiply, .assemble = assemble, .rotate = rotate};

const pal_effect pal_effect_tet_elastic = {
    PAL_EFFECT("tet_elastic", FORCE),
    .internal = true,
    .energy = energy,
    .bounds.stiffness = stiffness,
    .recovery = {.recover = recover, .state = recovery},
    .material = material,
    .reset = reset,
    .tangent = &tangent,
    .inspect = {.measure = measure, .fields = PAL_ELASTIC_FIELDS, .stress = stress}};
