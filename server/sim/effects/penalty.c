/* Component penalty: nodes held where they rest by strong springs instead of being no unknowns (A 3.3: "constraints via
 * the penalty method", the other way being supports, whose points are dropped).
 *
 *     f_i = -k w_i (x_i - X_i),  w_i the node's share of the row's mass, so that refinement changes nothing
 *
 * k is the stiffness of the whole row against being moved as one. What it holds gives way by f / k. Nodes are those of
 * the body in a box or the lowest part at rest. Explicit solvers find their step by it: a stiffer row asks for more
 * sub-steps.
 *
 * Keys: low_m and high_m (a box, body frame) or lowest (0.05: share of the body's height along `up`), k_N_m (100 E S, S
 * the body's size). What is not given follows a live material edit. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"

typedef struct penalty {
    int n_node;
    int32_t *node; /* [n_node] */
    double *share; /* sum 1 [n_node] */
    double k_N_m, per_young;
} penalty;

static const double sizes = 100;

static bool chosen(const double x[3], bool box, const double low[3], const double high[3], const double up[3],
                   double top)
{
    if (!box) return pal_dot3(x, up) <= top;
    for (int c = 0; c < 3; c++)
        if (!(x[c] >= low[c] && x[c] <= high[c])) return false;
    return true;
}

static pal_err read_keys(penalty *row, pal_config_entry *item, const pal_build *build, bool *box, double low[3],
                         double high[3], double *lowest)
{
    *box = pal_entry_has(item, "low_m") || pal_entry_has(item, "high_m");
    if (*box && pal_entry_has(item, "lowest"))
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: either low_m and high_m or lowest", item->path);
    if (*box && !(pal_entry_has(item, "low_m") && pal_entry_has(item, "high_m")))
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: low_m and high_m belong together", item->path);
    PAL_TRY(pal_entry_read_numbers(item, "low_m", 3, low, build->diag));
    PAL_TRY(pal_entry_read_numbers(item, "high_m", 3, high, build->diag));
    PAL_TRY(pal_entry_read_number(item, "lowest", 0, 1, lowest, build->diag));
    row->per_young = pal_entry_has(item, "k_N_m") ? 0 : sizes * build->body->length_scale_m;
    row->k_N_m = row->per_young * build->def->material.young_Pa;
    PAL_TRY(pal_entry_read_number(item, "k_N_m", 1e-12, 1e60, &row->k_N_m, build->diag));
    return pal_entry_check_unused(item, build->diag);
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    const pal_body *body = build->body;
    double low[3] = {0}, high[3] = {0}, lowest = 0.05, least = INFINITY, most = -INFINITY, mass = 0;
    bool box;
    penalty *row = PAL_NEW(build->arena, penalty, 1);
    if (!row) return PAL_ERR_MEMORY;
    PAL_TRY(read_keys(row, item, build, &box, low, high, &lowest));
    if (body->active)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED,
                                  "%s: penalty holds no body that adapts: give it supports", item->path);
    row->node = PAL_NEW(build->arena, int32_t, body->n_node);
    row->share = PAL_NEW(build->arena, double, body->n_node);
    if (!row->node || !row->share) return PAL_ERR_MEMORY;
    for (int i = 0; i < body->n_node; i++) {
        double z = pal_dot3(body->node_rest + 3 * (size_t)i, build->scene->up);
        least = fmin(least, z), most = fmax(most, z);
    }
    /* a hair above, so that rounding does not part nodes of one height */
    double top = least + (lowest + 1e-9) * (most - least);
    for (int i = 0; i < body->n_node; i++) {
        if (!(body->node_mass_kg[i] > 0)) continue; /* virtual nodes */
        if (!chosen(body->node_rest + 3 * (size_t)i, box, low, high, build->scene->up, top)) continue;
        row->node[row->n_node] = i;
        row->share[row->n_node++] = body->node_mass_kg[i];
        mass += body->node_mass_kg[i];
    }
    if (row->n_node == 0)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: penalty holds none of the body's %d nodes",
                                  item->path, body->n_node);
    for (int n = 0; n < row->n_node; n++) row->share[n] /= mass;
    *self = row;
    return PAL_ERR_OK;
}

static void add(const penalty *row, double k, const double *p, const double *from, double *out)
{
    for (int n = 0; n < row->n_node; n++) {
        size_t i = 3 * (size_t)row->node[n];
        for (size_t c = 0; c < 3; c++) out[i + c] += k * row->share[n] * (p[i + c] - (from ? from[i + c] : 0));
    }
}

static pal_err run(void *self, pal_step *step)
{
    const penalty *row = self;
    add(row, -row->k_N_m, step->body->d, step->body->node_rest, step->body->f);
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    const penalty *row = self;
    double sum = 0;
    for (int n = 0; n < row->n_node; n++) {
        double off = pal_dist3(body->d + 3 * (size_t)row->node[n], body->node_rest + 3 * (size_t)row->node[n]);
        sum += row->share[n] * off * off;
    }
    return 0.5 * row->k_N_m * sum;
}

/* of nodes that are points themselves; solvers of carried nodes look at the forces */
static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    const penalty *row = self;
    for (int n = 0; n < row->n_node && !body->interpolation; n++) bound_N_m[row->node[n]] += row->k_N_m * row->share[n];
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    penalty *row = self;
    (void)body, (void)diag;
    if (row->per_young > 0) row->k_N_m = row->per_young * to->young_Pa;
    return PAL_ERR_OK;
}

static void linearise(void *self, const pal_body *body)
{
    (void)self, (void)body;
}

static void multiply(void *self, const pal_body *body, double k, double c, const double *p, double *out)
{
    const penalty *row = self;
    (void)body, (void)c;
    add(row, k * row->k_N_m, p, NULL, out);
}

static const pal_tangent tangent = {.linearise = linearise, .multiply = multiply};

const pal_effect pal_effect_penalty = {.name = "penalty",
                                       .stage = PAL_STAGE_FORCE,
                                       .make = make,
                                       .run = run,
                                       .energy = energy,
                                       .stiffness = stiffness,
                                       .material = material,
                                       .tangent = &tangent};
