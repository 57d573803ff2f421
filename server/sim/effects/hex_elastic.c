/* Component hex_elastic: elastic voxel hexahedra, one per voxel of the body (elastic_hex.h).
 *
 * Keys: element ("hex8_bbar": mean dilatation, the default | "hex8": full integration), law ("corotational" |
 * "linear" | "neo_hookean"), fill (true: the stiffness of a voxel is scaled by its fraction inside the surface, at
 * least PAL_FILL_MIN), recover (true: while a corner is inverted the body uses its five-tetrahedra split, and a
 * persistent inversion is straightened, elastic_tet.h; not for linear).
 *
 * The decision on inversion recovery is taken at linearise; without an implicit solver at every evaluation of forces.
 */
#include "server/base/clock.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/elements/elastic_hex.h"

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    pal_hex_options options = {.law = PAL_LAW_COROTATIONAL, .element = PAL_HEX_BBAR, .fill = true, .recover = true};
    static const char *const elements[] = {"hex8_bbar", "hex8"};
    int element = 0;
    PAL_TRY(pal_entry_read_choice(item, "element", elements, 2, &element, build->diag));
    if (element) options.element = PAL_HEX_FULL;
    PAL_TRY(pal_elastic_law_read(item, &options.law, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "fill", &options.fill, build->diag));
    PAL_TRY(pal_entry_read_bool(item, "recover", &options.recover, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    pal_elastic_hexes *row = PAL_NEW(build->arena, pal_elastic_hexes, 1);
    if (!row) return PAL_ERR_MEMORY;
    *self = row;
    return pal_hex_make(&options, build, item->path, row);
}

static pal_err run(void *self, pal_step *step)
{
    pal_elastic_hexes *row = self;
    pal_body *body = step->body;
    if (!row->implicit) pal_hex_recover(row, body);
    body->safeguards.n_inversion += row->n_inversion, body->safeguards.n_split += row->n_switch;
    row->n_inversion = row->n_switch = 0;
    if (row->has_inversion) {
        uint64_t before = pal_clock_ns();
        pal_elastic_tets_force(row->split, body->d, body->f);
        body->safeguards.ns += pal_clock_ns() - before;
    } else if (pal_force_cache_matches(&row->force_cache, body->d)) {
        pal_force_cache_add(&row->force_cache, body->f);
    } else {
        pal_node_order_load(body->node_order, body->d);
        (row->law == PAL_LAW_NEO_HOOKEAN ? pal_hex_neo_run : pal_hex_corot_run)(row, body->node_order, PAL_RUN_FORCE);
        pal_node_order_add(body->node_order, body->f);
    }
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    pal_elastic_hexes *row = self;
    if (row->has_inversion) return pal_elastic_tets_energy(row->split, body->d, NULL);
    if (pal_force_cache_matches(&row->force_cache, body->d)) return row->force_cache.energy_J;
    pal_node_order_load(body->node_order, body->d);
    double *forces = pal_force_cache_begin(&row->force_cache, body->d);
    const pal_element_run what = forces ? PAL_RUN_BOTH : PAL_RUN_ENERGY;
    double sum = row->law == PAL_LAW_NEO_HOOKEAN ? pal_hex_neo_run(row, body->node_order, what)
                                                 : pal_hex_corot_run(row, body->node_order, what);
    if (forces) pal_node_order_add(body->node_order, forces);
    return pal_force_cache_commit(&row->force_cache, sum);
}

static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    pal_elastic_hexes *row = self;
    if (row->has_inversion)
        pal_elastic_tets_bound(row->split, body->d, bound_N_m);
    else if (row->law == PAL_LAW_NEO_HOOKEAN)
        pal_hex_neo_bound(row, body, bound_N_m);
    else
        for (int i = 0; i < 8 * row->n_hex; i++)
            bound_N_m[row->hexes->node[i]] += row->bound[row->simd_blocks.place[i / 8]];
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
    const pal_elastic_hexes *row = self;
    *out = (pal_cliques){.n_item = row->n_hex, .n_corner = 8, .node = row->hexes->node};
    return true;
}

static void linearise(void *self, const pal_body *body)
{
    pal_elastic_hexes *row = self;
    pal_hex_recover(row, body);
    if (row->implicit && row->split) row->n_switch += pal_elastic_tets_check_rest(row->split, body, row->has_inversion);
    if (row->has_inversion) {
        pal_elastic_tets_linearise(row->split, body->d);
        return;
    }
    pal_node_order_load(body->node_order, body->d);
    (row->law == PAL_LAW_NEO_HOOKEAN ? pal_hex_neo_linearise : pal_hex_corot_linearise)(row, body->node_order);
}

static void multiply(void *self, const pal_body *body, double k, const double *p, double *out)
{
    const pal_elastic_hexes *row = self;
    if (row->has_inversion) {
        pal_elastic_tets_multiply(row->split, k, p, out);
        return;
    }
    pal_node_order_load(body->node_order, p);
    (row->law == PAL_LAW_NEO_HOOKEAN ? pal_hex_neo_multiply : pal_hex_corot_multiply)(row, body->node_order, k);
    pal_node_order_add(body->node_order, out);
}

static void assemble(void *self, double k, pal_block_matrix *to)
{
    pal_elastic_hexes *row = self;
    if (row->has_inversion)
        pal_elastic_tets_assemble(row->split, k, to);
    else
        pal_hex_assemble(row, k, to);
}

static void rotate(void *self, double *rotation)
{
    const pal_elastic_hexes *row = self;
    if (row->has_inversion)
        pal_elastic_tets_rotate(row->split, rotation);
    else
        pal_hex_rotate(row, rotation);
}

static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    pal_elastic_hexes *row = self;
    if (row->has_inversion)
        pal_elastic_tets_measure(row->split, body->d, field, sum, volume_m3);
    else
        pal_hex_measure(row, body, field, sum, volume_m3);
}

static void stress(void *self, const pal_body *body, pal_stress_take *take, void *user)
{
    pal_elastic_hexes *row = self;
    if (row->has_inversion)
        pal_elastic_tets_stress(row->split, body->d, take, user);
    else
        pal_hex_stress(row, body, take, user);
}

static const pal_tangent tangent = {
    .couple = couple, .linearise = linearise, .multiply = multiply, .assemble = assemble, .rotate = rotate};

const pal_effect pal_effect_hex_elastic = {
    PAL_EFFECT("hex_elastic", FORCE),
    .internal = true,
    .energy = energy,
    .bounds.stiffness = stiffness,
    .material = material,
    .reset = reset,
    .tangent = &tangent,
    .inspect = {.measure = measure, .fields = PAL_ELASTIC_FIELDS, .stress = stress}};
