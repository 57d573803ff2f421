/* Component cell_elastic: elements of a subdivision solid in their own moving frames (paper A section 3.2-3.4;
 * cell_kernel.h).
 *
 * Key: operator ("polar", the default: displacements from the rest shape rotated by the element's polar rotation |
 * "edges": changes of edge lengths and angles as in the paper, corrected; its forces have no energy, and `energy`
 * gives 1/2 d^' K d^).
 *
 * Acts on nodes. Moduli are those of solid->samples; when these change, the constants are recomputed before their next
 * use. Inverted elements recover (recovery/recovery.h). Because nodes are not dofs there is no bound
 * of stiffness (solvers find it by differences of forces), and the tangent is given by products only. */
#include "server/sim/core/effect_list.h"
#include "server/sim/core/tuning.h"
#include "server/sim/elements/elastic_law.h"
#include "server/sim/subdivision/cell_kernel.h"

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    const pal_subdivision_solid *solid = build->body->model.solid;
    static const char *const names[] = {[PAL_CELL_POLAR] = "polar", [PAL_CELL_EDGES] = "edges"};
    int operator_kind = PAL_CELL_POLAR;
    if (!solid)
        return PAL_REFUSE(build->diag, "%s: \"%s\" needs a body of model subdivision_fem", item->path, item->name);
    PAL_TRY(pal_entry_read_choice(item, "operator", names, 2, &operator_kind, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    pal_cells_elastic *cells = PAL_NEW(build->arena, pal_cells_elastic, 1);
    if (!cells) return PAL_ERR_MEMORY;
    *self = cells;
    PAL_TRY(pal_cells_elastic_make(solid, (pal_cell_operator)operator_kind, build->arena, cells, build->diag));
    if (build->scene->threads > 1 && cells->n_cell >= PAL_SHARED_CELLS)
        PAL_TRY(pal_cells_elastic_share(cells, build->body, build->arena));
    const bool cached = operator_kind == PAL_CELL_POLAR && build->body->implicit;
    return cached ? pal_force_cache_make(build->body->n_node, build->arena, &cells->force_cache) : PAL_ERR_OK;
}

static pal_err run(void *self, pal_step *step)
{
    pal_cells_elastic *cells = self;
    pal_body *body = step->body;
    pal_cells_elastic_refresh(cells);
    pal_recovery_select(cells->recovery, body);
    if (pal_force_cache_matches(&cells->force_cache, body->d))
        pal_force_cache_add(&cells->force_cache, body->f);
    else
        pal_cells_elastic_force(cells, body->d, body->f);
    pal_recovery_add_forces(cells->recovery, body);
    return PAL_ERR_OK;
}

static double elements_energy(pal_cells_elastic *cells, const pal_body *body)
{
    if (pal_force_cache_matches(&cells->force_cache, body->d)) return cells->force_cache.energy_J;
    return pal_force_cache_commit(
        &cells->force_cache,
        pal_cells_elastic_energy(cells, body->d, pal_force_cache_begin(&cells->force_cache, body->d)));
}

static double energy(void *self, const pal_body *body)
{
    pal_cells_elastic *cells = self;
    pal_cells_elastic_refresh(cells);
    pal_recovery_select(cells->recovery, body);
    return elements_energy(cells, body) + pal_recovery_energy(cells->recovery, body->d, NULL);
}

static void reset(void *self, const pal_body *body)
{
    (void)body;
    pal_cells_elastic_reset(self);
}

/* no pattern over nodes: elements overlap far beyond the neighbours of their control points. Volumes of control cells
 * couple control points beyond the elements' own */
static bool couple(void *self, pal_cliques *out)
{
    const pal_cells_elastic *cells = self;
    if (cells->volume.n > 0) *out = cells->volume.couple;
    return cells->volume.n > 0;
}

static unsigned recover(void *self, pal_step *step)
{
    pal_cells_elastic *cells = self;
    pal_cells_elastic_refresh(cells);
    return pal_recovery_update(cells->recovery, step);
}

static pal_recovery *recovery(void *self)
{
    return ((pal_cells_elastic *)self)->recovery;
}

static void linearise(void *self, const pal_body *body)
{
    pal_cells_elastic *cells = self;
    pal_cells_elastic_refresh(cells);
    pal_recovery_select(cells->recovery, body);
    pal_cells_elastic_linearise(cells, body->d);
}

static void multiply(void *self, const pal_body *body, double k, const double *p, double *out)
{
    (void)body;
    const pal_cells_elastic *cells = self;
    pal_cells_elastic_multiply(cells, k, p, out);
    pal_recovery_multiply(cells->recovery, k, p, out);
}

static void rotate(void *self, const pal_body *body, double *rotation)
{
    (void)body;
    const pal_cells_elastic *cells = self;
    pal_cells_elastic_rotate(cells, rotation);
    pal_recovery_rotate(cells->recovery, rotation);
}

static double von_mises(const pal_cell_points *points, int p)
{
    return points->von_mises_Pa[p];
}
static double energy_density(const pal_cell_points *points, int p)
{
    return points->energy_J_m3[p];
}

static double strain(const pal_cell_points *points, int p)
{
    return points->stretch[p];
}
static double distortion(const pal_cell_points *points, int p)
{
    return points->det_f[p] - 1;
}

static double young(const pal_cell_points *points, int p)
{
    return points->young_Pa[p];
}

static double mass_density(const pal_cell_points *points, int p)
{
    return points->density_kg_m3[p];
}

static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    static pal_cell_value *const value[PAL_FIELD_COUNT] = {
        [PAL_FIELD_VON_MISES_PA] = von_mises, [PAL_FIELD_ENERGY_J_M3] = energy_density,
        [PAL_FIELD_STRAIN] = strain,          [PAL_FIELD_DISTORTION] = distortion,
        [PAL_FIELD_YOUNG_PA] = young,         [PAL_FIELD_DENSITY_KG_M3] = mass_density};
    if (value[field]) pal_cells_elastic_measure(self, body->d, value[field], sum, volume_m3);
}

static const pal_tangent tangent = {.couple = couple, .linearise = linearise, .multiply = multiply, .rotate = rotate};

const pal_effect pal_effect_cell_elastic = {PAL_EFFECT("cell_elastic", FORCE),
                                            .internal = true,
                                            .energy = energy,
                                            .reset = reset,
                                            .recovery = {.recover = recover, .state = recovery},
                                            .tangent = &tangent,
                                            .inspect = {.measure = measure, .fields = PAL_ELASTIC_FIELDS}};
