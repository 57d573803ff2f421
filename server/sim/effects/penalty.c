/* Component penalty: springs pull nodes to their rest positions (paper A section 3.3: "constraints via the penalty
 * method"); supports remove the dofs instead.
 *
 *     f_i = -k w_i (x_i - X_i),  w_i the node's share of the total mass, so that refinement changes nothing
 *
 * k is the stiffness against a translation of all nodes: under a force f they move by f / k. Explicit solvers derive
 * their step from it: a stiffer component needs more sub-steps.
 *
 * Keys: those of pal_support_read (definition.h), k_N_m (100 E S, S the box diagonal: a body's weight moves it by less
 * than 0.1 % of its size). A k that is not given follows a live material edit. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"

typedef struct penalty {
    int n_node;
    int32_t *node; /* [n_node] */
    double *share; /* sum 1 [n_node] */
    double k_N_m, per_young;
} penalty;

static pal_err make(pal_config_entry *entry, pal_build *build, void **self)
{
    const pal_body *body = build->body;
    double mass = 0;
    pal_support_def support;
    uint8_t *held;
    penalty *p = PAL_NEW(build->arena, penalty, 1);
    if (!p) return PAL_ERR_MEMORY;
    PAL_TRY(pal_support_read(entry, &support, build->diag));
    if (!(held = PAL_NEW(build->arena, uint8_t, body->n_node))) return PAL_ERR_MEMORY;
    pal_support_mark_fixed(&support, build->scene->up, body->node_rest, body->n_node, held);
    p->per_young = pal_entry_has(entry, "k_N_m") ? 0 : 100 * body->length_scale_m;
    p->k_N_m = p->per_young * build->def->material.young_Pa;
    PAL_TRY(pal_entry_read_number(entry, "k_N_m", 1e-12, 1e60, &p->k_N_m, build->diag));
    PAL_TRY(pal_entry_check_unused(entry, build->diag));
    if (body->active)
        return PAL_REFUSE(build->diag, "%s: penalty holds no body that adapts: give it supports", entry->path);
    p->node = PAL_NEW(build->arena, int32_t, body->n_node);
    p->share = PAL_NEW(build->arena, double, body->n_node);
    if (!p->node || !p->share) return PAL_ERR_MEMORY;
    for (int i = 0; i < body->n_node; i++) {
        /* virtual nodes have no mass */
        if (!(body->node_mass_kg[i] > 0) || !held[i]) continue;
        p->node[p->n_node] = i;
        p->share[p->n_node++] = body->node_mass_kg[i];
        mass += body->node_mass_kg[i];
    }
    if (p->n_node == 0)
        return PAL_REFUSE(build->diag, "%s: penalty holds none of the body's %d nodes", entry->path, body->n_node);
    for (int n = 0; n < p->n_node; n++) p->share[n] /= mass;
    *self = p;
    return PAL_ERR_OK;
}

static void add(const penalty *p, double k, const double *u, const double *from, double *out)
{
    for (int n = 0; n < p->n_node; n++) {
        size_t i = 3 * (size_t)p->node[n];
        for (size_t c = 0; c < 3; c++) out[i + c] += k * p->share[n] * (u[i + c] - (from ? from[i + c] : 0));
    }
}

static pal_err run(void *self, pal_step *step)
{
    const penalty *p = self;
    add(p, -p->k_N_m, step->body->d, step->body->node_rest, step->body->f);
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    const penalty *p = self;
    double sum = 0;
    for (int n = 0; n < p->n_node; n++) {
        double off = pal_dist3(body->d + 3 * (size_t)p->node[n], body->node_rest + 3 * (size_t)p->node[n]);
        sum += p->share[n] * off * off;
    }
    return 0.5 * p->k_N_m * sum;
}

/* bounds only where nodes are dofs; solvers of interpolated nodes take differences of forces */
static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    const penalty *p = self;
    for (int n = 0; n < p->n_node && !body->interpolation; n++) bound_N_m[p->node[n]] += p->k_N_m * p->share[n];
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    penalty *p = self;
    (void)body, (void)diag;
    if (p->per_young > 0) p->k_N_m = p->per_young * to->young_Pa;
    return PAL_ERR_OK;
}

static void multiply(void *self, const pal_body *body, double k, const double *u, double *out)
{
    const penalty *p = self;
    (void)body;
    add(p, k * p->k_N_m, u, NULL, out);
}

static const pal_tangent tangent = {.multiply = multiply};

const pal_effect pal_effect_penalty = {PAL_EFFECT("penalty", FORCE), .energy = energy, .bounds.stiffness = stiffness,
                                       .material = material, .tangent = &tangent};
