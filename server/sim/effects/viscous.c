/* Component viscous: f = -k_damp v with k_damp = rate m, the drag of paper B section 4.1. Key: rate_1_s (the
 * material's damping_1_s, given or derived).
 *
 * Departure: the paper applies it explicitly; a solver that knows the hook `drag` divides by 1 + dt rate instead,
 * which is stable for every rate. */
#include "server/sim/core/effect_list.h"

typedef struct viscous {
    double rate_1_s;
    bool given;
} viscous;

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    viscous *row = PAL_NEW(build->arena, viscous, 1);
    if (!row) return PAL_ERR_MEMORY;
    *row = (viscous){.rate_1_s = pal_material_damping_1_s(&build->def->material, build->body->lowest_1_s),
                     .given = pal_entry_has(item, "rate_1_s")};
    *self = row;
    PAL_TRY(pal_entry_read_number(item, "rate_1_s", 0, 1e9, &row->rate_1_s, build->diag));
    return pal_entry_check_unused(item, build->diag);
}

static pal_err run(void *self, pal_step *step)
{
    const viscous *row = self;
    const pal_body *body = step->body;
    const int32_t *active = body->active;
    const int n = pal_body_nodes(body);
    for (int k = 0; k < n; k++) {
        int i = active ? active[k] : k;
        for (int c = 0; c < 3; c++) body->f[3 * i + c] -= row->rate_1_s * body->node_mass_kg[i] * body->dv[3 * i + c];
    }
    return PAL_ERR_OK;
}

static double drag(void *self)
{
    return ((const viscous *)self)->rate_1_s;
}

static void damping(void *self, const pal_body *body, double *bound_Ns_m)
{
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        bound_Ns_m[i] += drag(self) * body->mass_kg[i];
    }
}

/* the same at every node */
static void measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    for (int k = 0; k < pal_body_nodes(body) && field == PAL_FIELD_DAMPING_1_S; k++) {
        const int i = body->active ? body->active[k] : k;
        sum[i] += drag(self), volume_m3[i] += 1;
    }
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    viscous *row = self;
    (void)diag;
    if (!row->given) row->rate_1_s = pal_material_damping_1_s(to, body->lowest_1_s);
    return PAL_ERR_OK;
}

const pal_effect pal_effect_viscous = {.name = "viscous",
                                       .stage = PAL_STAGE_FORCE,
                                       .make = make,
                                       .run = run,
                                       .bounds.damping = damping,
                                       .drag = drag,
                                       .material = material,
                                       .inspect = {.measure = measure, .fields = 1u << PAL_FIELD_DAMPING_1_S}};
