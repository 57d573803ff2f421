/* Masses of a body on a subdivision solid, and the mobility of its nodes. */
#include "server/sim/subdivision/subdivision_body.h"

#include "server/sim/subdivision/subdivision_mass.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* beyond so many free points mobility is bounded, not computed: its dense factor takes their number squared */
enum { FACTOR_MAX = 1000 };

typedef struct mobility {
    int n_free;
    int32_t *place; /* index among the free points, -1: not free [n_dof]                        */
    double *factor; /* U of M~ = U'U, rows of the upper half    [n_free][n_free]; NULL: bounded */
    double *y;      /* [n_free]                                                                 */
} mobility;

/* false: no memory, too many points or not positive definite */
static bool factorise(const pal_mass_operator *mass, mobility *m)
{
    const size_t n = (size_t)m->n_free;
    double *u = n <= FACTOR_MAX ? calloc(n * n + 1, sizeof *u) : NULL;
    if (!u) return false;
    m->factor = u;
    for (int i = 0; i < mass->n_point; i++)
        for (int32_t k = mass->start[i]; k < mass->start[i + 1] && m->place[i] >= 0; k++) {
            int32_t j = m->place[mass->point[k]];
            if (j >= m->place[i]) u[(size_t)m->place[i] * n + (size_t)j] = mass->mass_kg[k];
        }
    for (size_t k = 0; k < n; k++) {
        double *row = u + k * n;
        if (!(row[k] > 0)) return false;
        const double scale = 1 / sqrt(row[k]);
        for (size_t j = k; j < n; j++) row[j] *= scale;
        for (size_t i = k + 1; i < n; i++) {
            double *to = u + i * n;
            const double c = row[i];
            for (size_t j = i; j < n && c != 0; j++) to[j] -= c * row[j];
        }
    }
    return true;
}

/* a' M~^-1 a of a node's row over the free points: |y|^2 with U'y = a */
static double inverse_mass_of(const mobility *m, const pal_interpolation *rows, int node)
{
    const size_t n = (size_t)m->n_free;
    double *y = m->y, sum = 0;
    size_t first = n;
    memset(y, 0, sizeof *y * n);
    for (int32_t k = rows->start[node]; k < rows->start[node + 1]; k++) {
        if (m->place[rows->point[k]] < 0) continue;
        size_t at = (size_t)m->place[rows->point[k]];
        y[at] = rows->weight[k];
        if (at < first) first = at;
    }
    for (size_t k = first; k < n; k++) {
        const double *row = m->factor + k * n, c = y[k] / row[k];
        sum += c * c;
        for (size_t j = k + 1; j < n && c != 0; j++) y[j] -= c * row[j];
    }
    return sum;
}

/* An upper bound of it, by the diagonal D of M~: D^-1 M~ has no eigenvalue below the cube of 1/2 (trilinear) or 0.1126
 * (cubic B-spline) */
static double bound_of(const mobility *m, const pal_body *body, int node)
{
    const pal_interpolation *rows = body->interpolation;
    const pal_mass_operator *mass = body->mass_operator;
    double sum = 0, max = body->model.solid->subdivision.n_level > 0 ? 701 : 8;
    for (int32_t k = rows->start[node]; k < rows->start[node + 1]; k++) {
        int32_t i = rows->point[k], at = mass->start[i];
        if (m->place && m->place[i] < 0) continue;
        while (at + 1 < mass->start[i + 1] && mass->point[at] != i) at++;
        sum += rows->weight[k] * rows->weight[k] / mass->mass_kg[at];
    }
    return max * sum;
}

static void find_mobility(pal_body *body)
{
    mobility m = {.place = malloc(sizeof *m.place * (size_t)body->n_dof + 1)};
    for (int i = 0; i < body->n_dof && m.place; i++) m.place[i] = body->support[i] ? -1 : m.n_free++;
    m.y = malloc(sizeof *m.y * (size_t)m.n_free + 1);
    bool found = m.place && m.y && factorise(body->mass_operator, &m);
    for (int i = 0; i < body->display.surface->n_vertex; i++) {
        int node = body->display.shown_node[i];
        body->node_inverse_mass_1_kg[node] =
            found ? inverse_mass_of(&m, body->interpolation, node) : bound_of(&m, body, node);
    }
    free(m.place), free(m.factor), free(m.y);
}

static void update_mass(pal_body *body)
{
    pal_subdivision_mass_fill(body->model.solid, body->mass_operator);
    pal_subdivision_mass_lump(body->model.solid, body->mass_kg, body->node_mass_kg);
    find_mobility(body);
}

static void set_material(pal_body *body, const pal_material *material)
{
    body->model.solid->def.material = *material;
    pal_subdivision_solid_sample(body->model.solid, &body->model.solid->def);
    update_mass(body);
}

static void destroy(pal_body *body)
{
    pal_subdivision_solid_free(body->model.solid);
    body->model.solid = NULL;
    body->dofs.destroy = NULL;
}

void pal_subdivision_body_dofs(pal_body *body)
{
    const pal_subdivision_solid *solid = body->model.solid;
    pal_dofs *dofs = &body->dofs;
    *dofs = (pal_dofs){.n_clique = PAL_CELL_KINDS,
                       .material_revision = &solid->sampled,
                       .n_byte = solid->n_byte,
                       .update_mass = update_mass,
                       .set_material = set_material,
                       .destroy = destroy};
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        dofs->clique[kind] = (pal_cliques){.n_item = solid->elements.n[kind],
                                           .n_corner = pal_cell_kind_nodes(kind),
                                           .node = pal_subdivision_solid_nodes(solid, kind, 0)};
}
