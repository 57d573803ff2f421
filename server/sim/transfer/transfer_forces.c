/* Forces of a transfer (transfer.h): from the nodes of the old body to those of the new one. */
#include "server/sim/transfer/transfer_core.h"

#include "server/base/vec3.h"
#include "server/sim/implicit/system.h"

#include <stdlib.h>
#include <string.h>

/* entries of t->A_new by old nodes: new nodes that depend on old node i and by how much, who[first[i]..first[i+1]-1] */
typedef struct dependents {
    int32_t *first, *who;
    double *weight;
} dependents;

static bool find_dependents(const pal_interpolation *in, int n_from, dependents *out)
{
    int32_t n = in->start[in->n_row];
    out->first = calloc((size_t)n_from + 2, sizeof *out->first);
    out->who = malloc(sizeof *out->who * (size_t)(n + 1));
    out->weight = malloc(sizeof *out->weight * (size_t)(n + 1));
    if (!out->first || !out->who || !out->weight) return false;
    /* first[i + 1] is where the next entry of i goes, until all are there */
    for (int32_t k = 0; k < n; k++) out->first[in->point[k] + 2]++;
    for (int i = 0; i < n_from; i++) out->first[i + 2] += out->first[i + 1];
    for (int32_t j = 0; j < in->n_row; j++)
        for (int32_t k = in->start[j]; k < in->start[j + 1]; k++) {
            int32_t at = out->first[in->point[k] + 1]++;
            out->who[at] = j, out->weight[at] = in->weight[k];
        }
    return true;
}

/* old node i's force goes to the new nodes that depend on it, over their masses as they do; the remainder (of nodes
 * that hardly any new one depends on) by interpolation */
static void add_spread(const pal_transfer *t, const pal_body *from, const pal_body *to, const dependents *l, int i,
                       pal_interpolation_builder *rows)
{
    double sum = 0, min = from->node_mass_kg[i] / PAL_CHANGE_MAX;
    for (int32_t k = l->first[i]; k < l->first[i + 1]; k++) sum += l->weight[k] * to->node_mass_kg[l->who[k]];
    double part = sum >= min ? 1 : sum > 0 ? sum / min : 0;
    for (int32_t k = l->first[i]; k < l->first[i + 1] && part > 0; k++)
        pal_interpolation_builder_add(rows, l->who[k], part / sum * l->weight[k] * to->node_mass_kg[l->who[k]]);
    for (int32_t k = t->A_old.start[i]; k < t->A_old.start[i + 1] && part < 1; k++)
        pal_interpolation_builder_add(rows, t->A_old.point[k], (1 - part) * t->A_old.weight[k]);
    pal_interpolation_builder_end_row(rows);
}

/* old node i's force to the new nodes around it, by their masses as well: light ones, at the rim of cut elements, would
 * be thrown by what their heavy neighbours bear with ease */
static void add_by_mass(const pal_transfer *t, const pal_body *to, int i, pal_interpolation_builder *rows)
{
    const pal_interpolation *back = &t->A_old;
    double sum = 0;
    for (int32_t k = back->start[i]; k < back->start[i + 1]; k++)
        sum += fmax(0, back->weight[k]) * to->node_mass_kg[back->point[k]];
    for (int32_t k = back->start[i]; k < back->start[i + 1]; k++) {
        double share = fmax(0, back->weight[k]) * to->node_mass_kg[back->point[k]];
        pal_interpolation_builder_add(rows, back->point[k], sum > 0 ? share / sum : back->weight[k]);
    }
    pal_interpolation_builder_end_row(rows);
}

/* where control points carry the nodes or the new mesh is the finer one, a force is distributed over all new nodes that
 * depend on the old one, so that it does not concentrate in few */
void pal_transfer_make_force_map(pal_transfer *t, const pal_body *from, const pal_body *to)
{
    bool lumped = !from->interpolation && from->n_node >= to->n_node;
    dependents l = {0};
    pal_interpolation_builder rows;
    if (t->adaptive || t->A_force.n_row > 0) return;
    if (lumped || find_dependents(&t->A_new, from->n_node, &l)) {
        pal_interpolation_builder_begin(&rows, from->n_node, to->n_node, INT32_MAX);
        for (int i = 0; i < from->n_node && !rows.err; i++) {
            if (lumped)
                add_by_mass(t, to, i, &rows);
            else
                add_spread(t, from, to, &l, i, &rows);
        }
        (void)pal_interpolation_builder_finish(&rows, &t->A_force);
    }
    free(l.first), free(l.who), free(l.weight);
}

const pal_interpolation *pal_transfer_force_map(const pal_transfer *t)
{
    return t->A_force.n_row > 0 ? &t->A_force : &t->A_old;
}

/* What accelerates old nodes goes over as (twice the) acceleration where the new ones weigh less than half (springs
 * count voxels at the rim whole, finite elements by their share of material): as a force it would throw them. What
 * holds a load goes whole. Old bodies of an explicit solver only: of others loads are not known as they were at the end
 * of the step */
static void limit_acceleration(pal_transfer *t, const pal_body *from, const pal_body *to)
{
    const pal_interpolation *A = pal_transfer_force_map(t);
    double *mass = t->bound, *unbalanced = t->node_v;
    if (from->interpolation || from->implicit || t->adaptive) return;
    memset(mass, 0, sizeof *mass * (size_t)to->n_node);
    memset(unbalanced, 0, 3 * sizeof *unbalanced * (size_t)to->n_node);
    pal_system_clear_supported(from, t->unbalanced);
    pal_interpolation_apply_transpose(A, t->unbalanced, unbalanced);
    for (int i = 0; i < from->n_node; i++)
        for (int32_t k = A->start[i]; k < A->start[i + 1]; k++)
            mass[A->point[k]] += A->weight[k] * from->node_mass_kg[i];
    for (int j = 0; j < to->n_node; j++) {
        double part = PAL_CHANGE_MAX * to->node_mass_kg[j] / mass[j];
        if (part < 1) pal_axpy3(t->force + 3 * (size_t)j, part - 1, unbalanced + 3 * (size_t)j);
    }
}

void pal_transfer_forces(pal_transfer *t, const pal_body *from, const pal_body *to)
{
    size_t n = 3 * (size_t)from->n_node;
    memset(t->force, 0, 3 * sizeof(double) * (size_t)to->n_node);
    if (from->interpolation) {
        double *a = from->g;
        for (int i = 0; i < from->n_dof; i++)
            pal_scale3(a + 3 * i, from->support[i] ? 0 : 1 / from->mass_kg[i], a + 3 * i);
        pal_interpolation_apply(from->interpolation, a, t->old);
        for (int i = 0; i < from->n_node; i++) pal_scale3(t->old + 3 * i, from->node_mass_kg[i], t->old + 3 * i);
    } else {
        memcpy(t->old, from->f, n * sizeof *t->old);
        pal_system_clear_supported(from, t->old);
    }
    pal_interpolation_apply_transpose(pal_transfer_force_map(t), t->old, t->force);
    limit_acceleration(t, from, to);
}
