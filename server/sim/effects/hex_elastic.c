/* Component hex_elastic: elastic voxel hexahedra, one per voxel of the body (elastic_hex.h).
 *
 * Keys: element ("hex8_bbar": mean dilatation, the default | "hex8": full integration), law ("corotational" |
 * "linear" | "neo_hookean"), fill (true: voxels that the surface cuts count by what is inside, at least
 * PAL_FILL_MIN), moment_fitting (false: the inside is spread evenly over the voxel; true: Gauss weights integrate over
 * it), twist (1: factor on the stiffness of twisting modes, elastic_hex.h), recover (true: recovery from inversion,
 * recovery/recovery.h; not for linear). */
#include "server/sim/core/effect_list.h"
#include "server/sim/elements/elastic_hex.h"

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    pal_hex_options options = {
        .law = PAL_LAW_COROTATIONAL, .element = PAL_HEX_BBAR, .fill = true, .recover = true, .twist = 1};
    static const char *const elements[] = {"hex8_bbar", "hex8"};
    int element = 0;
    PAL_TRY(pal_entry_read_choice(item, "element", elements, 2, &element, build->diag));
    if (element) options.element = PAL_HEX_FULL;
    PAL_TRY(pal_elastic_law_read(item, &options.law, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "fill", &options.fill, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "moment_fitting", &options.moment_fitting, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "recover", &options.recover, build->diag));
    PAL_TRY(pal_entry_read_number(item, "twist", 0.01, 1, &options.twist, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    if (options.twist < 1 && (element || options.law == PAL_LAW_NEO_HOOKEAN))
        return PAL_REFUSE(build->diag, "%s.twist: %g is for element hex8_bbar of linear or corotational law",
                          item->path, options.twist);
    pal_elastic_hexes *hexes = PAL_NEW(build->arena, pal_elastic_hexes, 1);
    if (!hexes) return PAL_ERR_MEMORY;
    *self = hexes;
    return pal_hex_make(&options, build, item->path, hexes);
}

static pal_err run(void *self, pal_step *step)
{
    pal_elastic_hexes *hexes = self;
    pal_body *body = step->body;
    pal_recovery_select(hexes->recovery, body);
    if (pal_force_cache_matches(&hexes->force_cache, body->d)) {
        pal_force_cache_add(&hexes->force_cache, body->f);
    } else {
        pal_node_order_load(body->node_order, body->d);
        (hexes->law == PAL_LAW_NEO_HOOKEAN ? pal_hex_neo_run : pal_hex_corot_run)(hexes, body->node_order,
                                                                                  PAL_RUN_FORCE);
        pal_node_order_add(body->node_order, body->f);
    }
    pal_hex_ground_add(hexes, -1, true, body->d, body->node_rest, body->f);
    pal_recovery_add_forces(hexes->recovery, body);
    return PAL_ERR_OK;
}

static double elements_energy(pal_elastic_hexes *hexes, const pal_body *body)
{
    if (pal_force_cache_matches(&hexes->force_cache, body->d)) return hexes->force_cache.energy_J;
    pal_node_order_load(body->node_order, body->d);
    double *forces = pal_force_cache_begin(&hexes->force_cache, body->d);
    const pal_element_run what = forces ? PAL_RUN_BOTH : PAL_RUN_ENERGY;
    double sum = hexes->law == PAL_LAW_NEO_HOOKEAN ? pal_hex_neo_run(hexes, body->node_order, what)
                                                   : pal_hex_corot_run(hexes, body->node_order, what);
    if (forces) pal_node_order_add(body->node_order, forces);
    hexes->turned = forces && hexes->law == PAL_LAW_COROTATIONAL;
    return pal_force_cache_commit(&hexes->force_cache, sum);
}

static double energy(void *self, const pal_body *body)
{
    pal_elastic_hexes *hexes = self;
    pal_recovery_select(hexes->recovery, body);
    return elements_energy(hexes, body) + pal_hex_ground_energy(hexes, body) +
           pal_recovery_energy(hexes->recovery, body->d, NULL);
}

static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    pal_elastic_hexes *hexes = self;
    pal_recovery_select(hexes->recovery, body);
    if (hexes->law == PAL_LAW_NEO_HOOKEAN)
        pal_hex_neo_bound(hexes, body, bound_N_m);
    else
        pal_hex_corot_bound(hexes, bound_N_m);
    pal_hex_ground_bound(hexes, bound_N_m);
    pal_recovery_bound(hexes->recovery, bound_N_m);
}

static unsigned recover(void *self, pal_step *step)
{
    return pal_recovery_update(((pal_elastic_hexes *)self)->recovery, step);
}

static pal_recovery *recovery(void *self)
{
    return ((pal_elastic_hexes *)self)->recovery;
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    (void)body, (void)diag;
    pal_hex_material(self, to);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    (void)body;
    pal_hex_reset(self);
}

static bool couple(void *self, pal_cliques *out)
{
    const pal_elastic_hexes *hexes = self;
    *out = (pal_cliques){.n_item = hexes->n_hex, .n_corner = 8, .node = hexes->hexes->node};
    return true;
}

static void linearise(void *self, const pal_body *body)
{
    pal_elastic_hexes *hexes = self;
    pal_node_order *order = body->node_order;
    pal_recovery_select(hexes->recovery, body);
    if (hexes->turned && pal_force_cache_matches(&hexes->force_cache, body->d)) order = NULL;
    if (order) pal_node_order_load(order, body->d);
    if (hexes->law == PAL_LAW_NEO_HOOKEAN)
        pal_hex_neo_linearise(hexes, order);
    else
        pal_hex_corot_linearise(hexes, order, body->team);
}

static void multiply(void *self, const pal_body *body, double k, const double *p, double *out)
{
    pal_elastic_hexes *hexes = self;
    pal_node_order_load(body->node_order, p);
    if (hexes->law == PAL_LAW_NEO_HOOKEAN)
        pal_hex_neo_multiply(hexes, body->node_order, k);
    else
        pal_hex_corot_multiply(hexes, body->node_order, k);
    pal_node_order_add(body->node_order, out);
    pal_hex_ground_add(hexes, k, false, p, NULL, out);
    pal_recovery_multiply(hexes->recovery, k, p, out);
}

static void assemble(void *self, double k, pal_block_matrix *to)
{
    pal_elastic_hexes *hexes = self;
    pal_hex_assemble(hexes, k, to);
    pal_recovery_assemble(hexes->recovery, k, to);
}

static void rotate(void *self, const pal_body *body, double *rotation)
{
    const pal_elastic_hexes *hexes = self;
    pal_hex_rotate(hexes, body->team, rotation);
    pal_recovery_rotate(hexes->recovery, rotation);
}

static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    if (field == PAL_FIELD_DENSITY_KG_M3)
        pal_body_measure_density(body, sum, volume_m3);
    else
        pal_hex_measure(self, body, field, sum, volume_m3);
}

static void stress(void *self, const pal_body *body, pal_stress_take *take, void *user)
{
    pal_hex_stress(self, body, take, user);
}

static const pal_elastic_hexes *cubes(const void *self)
{
    return self;
}

static const pal_tangent tangent = {.couple = couple,
                                    .linearise = linearise,
                                    .multiply = multiply,
                                    .assemble = assemble,
                                    .rotate = rotate,
                                    .cubes = cubes};

const pal_effect pal_effect_hex_elastic = {
    PAL_EFFECT("hex_elastic", FORCE),
    .internal = true,
    .energy = energy,
    .bounds.stiffness = stiffness,
    .recovery = {.recover = recover, .state = recovery},
    .material = material,
    .reset = reset,
    .tangent = &tangent,
    .inspect = {.measure = measure, .fields = PAL_ELASTIC_FIELDS, .stress = stress}};
