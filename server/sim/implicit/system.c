/* Rows as a system of equations. */
#include "server/sim/implicit/system.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/num/conjugate_gradient.h"
#include "server/num/union_find.h"
#include "server/sim/implicit/tuning.h"
#include "server/sim/subdivision/subdivision_mass.h"

#include <stdlib.h>
#include <string.h>

void pal_system_restrict(const pal_body *body, const double *f, double *out)
{
    if (!body->interpolation) {
        memcpy(out, f, pal_body_bytes3(body));
        return;
    }
    memset(out, 0, pal_body_bytes3(body));
    pal_interpolation_apply_transpose(body->interpolation, f, out);
}

void pal_system_clear_supported(const pal_body *body, double *r)
{
    for (int i = 0; i < body->n_dof; i++)
        if (body->support[i]) pal_set3(r + 3 * i, 0, 0, 0);
}

pal_err pal_system_make(const pal_build *build, pal_system *out)
{
    pal_body *body = build->body;
    *out = (pal_system){.body = body, .has_energy = true, .mass = 1};
    out->force = PAL_NEW(build->arena, pal_component, build->n_made);
    if (!out->force) return PAL_ERR_MEMORY;
    for (int i = 0; i < build->n_made; i++) {
        const pal_component *component = &build->made[i];
        if (component->effect->stage != PAL_STAGE_FORCE) continue;
        out->force[out->n_force++] = (pal_component){.effect = component->effect, .self = component->self};
        if (!component->effect->drag && !component->effect->energy) out->has_energy = false;
        if (component->effect->tangent && component->effect->tangent->rotate) out->has_rotation = true;
    }
    for (int i = 0; i < body->n_dof; i++) out->n_free += !body->support[i];
    if (!body->interpolation) return PAL_ERR_OK;
    return pal_interpolated_system_make(body, out->force, out->n_force, build->arena, build->diag,
                                        &out->interpolated_system);
}

/* the cliques of all rows, heap [system->n_force] */
static pal_cliques *list_cliques(const pal_system *system, int *n_list)
{
    pal_cliques *list = calloc((size_t)system->n_force + 1, sizeof *list);
    *n_list = 0;
    for (int i = 0; i < system->n_force && list; i++) {
        const pal_component *component = &system->force[i];
        if (component->effect->tangent && component->effect->tangent->couple &&
            component->effect->tangent->couple(component->self, &list[*n_list]))
            ++*n_list;
    }
    return list;
}

pal_err pal_system_pattern(const pal_system *system, pal_arena *arena, pal_block_matrix *out)
{
    int n_list;
    if (system->interpolated_system) {
        *out = system->interpolated_system->rest;
        out->value = PAL_NEW(arena, double, 9 * (size_t)out->start[out->n]);
        return out->value ? PAL_ERR_OK : PAL_ERR_MEMORY;
    }
    pal_cliques *list = list_cliques(system, &n_list);
    if (!list) return PAL_ERR_MEMORY;
    pal_err err = pal_block_matrix_make(system->body->n_node, list, n_list, arena, out);
    free(list);
    return err;
}

void pal_system_linearise(const pal_system *system)
{
    for (int i = 0; i < system->n_force; i++) {
        const pal_component *component = &system->force[i];
        const pal_tangent *tangent = component->effect->tangent;
        if (tangent && tangent->linearise) tangent->linearise(component->self, system->body);
    }
}

void pal_system_linearise_contact(pal_system *system, const pal_step *step)
{
    system->contact = step->contact;
    system->n_contact = step->n_contact;
    system->has_contact = false;
    for (int i = 0; i < step->n_contact; i++) {
        const pal_component *component = &step->contact[i];
        if (!component->effect->tangent) continue;
        if (component->effect->tangent->linearise) component->effect->tangent->linearise(component->self, system->body);
        system->has_contact |= component->effect->tangent->multiply != NULL;
    }
}

void pal_system_linearise_rest(const pal_system *system)
{
    pal_body *body = system->body;
    double *x = body->x, *d = body->d;
    body->x = body->x_rest, body->d = body->node_rest;
    pal_system_linearise(system);
    body->x = x, body->d = d;
}

/* one group along one axis; into e->rest go the columns of its points, from the diagonal down */
static void probe(pal_interpolated_system *e, const pal_system *system, int move)
{
    const int axis = move % 3, group = move / 3;
    const int32_t *point = e->point + e->start[group], n = e->start[group + 1] - e->start[group];
    memset(e->unit, 0, 3 * sizeof(double) * (size_t)e->rest.n);
    memset(e->product, 0, 3 * sizeof(double) * (size_t)e->rest.n);
    for (int32_t i = 0; i < n; i++) e->unit[3 * point[i] + axis] = 1;
    pal_system_multiply_stiffness(system, 1, e->unit, e->product);
    for (int32_t i = 0; i < n; i++)
        for (int32_t k = e->rest.start[point[i]]; k < e->rest.start[point[i] + 1]; k++)
            for (int c = 0; c < 3; c++)
                e->rest.value[9 * (size_t)k + (size_t)(3 * c + axis)] = e->product[3 * e->rest.row[k] + c];
}

bool pal_system_probe(pal_system *system, int max)
{
    pal_interpolated_system *e = system->interpolated_system;
    if (!e || e->next == e->n_move) return true;
    double before = pal_clock_s();
    pal_system_linearise_rest(system);
    for (; max > 0 && e->next < e->n_move; max--) probe(e, system, e->next++);
    system->assemble_s += pal_clock_s() - before;
    return e->next == e->n_move;
}

void pal_system_interpolate(const pal_system *system)
{
    if (system->interpolated_system)
        pal_interpolation_apply(system->body->interpolation, system->body->x, system->body->d);
}

void pal_system_rotate(const pal_system *system, double *rotation)
{
    const pal_body *body = system->body;
    double *to = system->interpolated_system ? system->interpolated_system->rotation : rotation;
    memset(to, 0, 9 * sizeof(double) * (size_t)body->n_node);
    for (int i = 0; i < system->n_force; i++) {
        const pal_component *component = &system->force[i];
        if (component->effect->tangent && component->effect->tangent->rotate)
            component->effect->tangent->rotate(component->self, body, to);
    }
    if (!system->interpolated_system) return;
    memset(rotation, 0, 9 * sizeof(double) * (size_t)body->n_dof);
    pal_interpolated_system_restrict9(body->interpolation, to, rotation);
}

/* ---- products ---- */

static void multiply_rows(const pal_system *system, const pal_component *component, int n_row, double k,
                          const double *p, double *out)
{
    const pal_body *body = system->body;
    pal_interpolated_system *e = system->interpolated_system;
    if (e) {
        pal_interpolation_apply(body->interpolation, p, e->p);
        memset(e->q, 0, 3 * sizeof(double) * (size_t)body->n_node);
    }
    for (int i = 0; i < n_row; i++) {
        const pal_tangent *tangent = component[i].effect->tangent;
        if (tangent && tangent->multiply) tangent->multiply(component[i].self, body, k, e ? e->p : p, e ? e->q : out);
    }
    if (e) pal_interpolation_apply_transpose(body->interpolation, e->q, out);
}

void pal_system_multiply_stiffness(const pal_system *system, double k, const double *p, double *out)
{
    multiply_rows(system, system->force, system->n_force, k, p, out);
}

void pal_system_multiply_contact(const pal_system *system, double k, const double *p, double *out)
{
    if (system->has_contact) multiply_rows(system, system->contact, system->n_contact, k, p, out);
}

void pal_system_find_contact(pal_system *system, double *p, double *q)
{
    const int n = 3 * system->body->n_dof;
    for (int i = 0; i < n; i += 3) p[i] = 1, p[i + 1] = M_SQRT2, p[i + 2] = M_PI;
    system->has_contact = system->chooses = false;
    for (int k = 0; k < system->n_contact; k++) {
        const pal_tangent *tangent = system->contact[k].effect->tangent;
        bool acts = false;
        if (!tangent || !tangent->multiply) continue;
        memset(q, 0, pal_body_bytes3(system->body));
        multiply_rows(system, &system->contact[k], 1, 1, p, q);
        for (int i = 0; i < n && !acts; i++) acts = q[i] != 0;
        system->has_contact |= acts;
        system->chooses |= acts && !tangent->mean_springs;
    }
}

void pal_system_multiply_inertia(const pal_system *system, double mass, double damp, const double *p, double *out)
{
    const pal_body *body = system->body;
    if (body->mass_operator) {
        pal_mass_operator_multiply(body->mass_operator, mass, damp, NULL, p, out);
        return;
    }
    for (int i = 0; i < body->n_dof; i++) {
        double m = mass * body->mass_kg[i];
        for (int c = 0; c < 3; c++) out[3 * i + c] = m * p[3 * i + c];
    }
}

double pal_system_inertia_norm2(const pal_system *system, double mass, double damp, const double *p)
{
    double *product = system->interpolated_system->product;
    pal_system_multiply_inertia(system, mass, damp, p, product);
    return pal_dot_product(3 * system->body->n_dof, p, product);
}

void pal_system_multiply(const pal_system *system, const double *p, double *out)
{
    pal_system_multiply_inertia(system, system->mass, system->damp, p, out);
    pal_system_multiply_stiffness(system, system->stiff + system->viscous, p, out);
    pal_system_multiply_contact(system, system->stiff, p, out);
    pal_system_clear_supported(system->body, out);
}

double pal_system_work(const pal_system *system, const double *p)
{
    const pal_body *body = system->body;
    pal_interpolated_system *e = system->interpolated_system;
    if (e) pal_interpolation_apply(body->interpolation, p, e->p);
    return pal_dot_product(3 * body->n_node, body->load, e ? e->p : p);
}

/* forces of the internal rows at body->x, in body->f and g */
static void find_inner_forces(const pal_system *system)
{
    pal_body *body = system->body;
    pal_step step = {.body = body, .force = system->force, .n_force = system->n_force};
    pal_system_interpolate(system);
    memset(body->f, 0, 3 * sizeof(double) * (size_t)body->n_node);
    (void)pal_run_forces(&step, PAL_FORCES_INTERNAL);
    if (body->interpolation) pal_system_restrict(body, body->f, body->g);
}

void pal_system_true_stiffness(const pal_system *system, const double *x, double *low, const double *p, double *out)
{
    pal_body *body = system->body;
    const int n = 3 * body->n_dof;
    double longest = 0;
    for (int i = 0; i < n; i++) longest = fmax(longest, fabs(p[i]));
    double part = longest > 0 ? PAL_DIFFERENCE_H * body->edge_m / longest : 0;
    for (int side = -1; side <= 1; side += 2) {
        for (int i = 0; i < n; i++) body->x[i] = x[i] + side * part * p[i];
        find_inner_forces(system);
        if (side < 0) memcpy(low, body->g, sizeof(double) * (size_t)n);
    }
    for (int i = 0; i < n; i++) {
        body->x[i] = x[i];
        out[i] = body->support[i / 3] || part == 0 ? 0 : (low[i] - body->g[i]) / (2 * part);
    }
    pal_system_interpolate(system);
}

/* the matrix of an interpolated body at rest, and its masses */
static void assemble_interpolated(const pal_system *system, pal_block_matrix *to)
{
    const pal_body *body = system->body;
    const pal_interpolated_system *e = system->interpolated_system;
    const double stiff = system->stiff + system->viscous;
    for (size_t i = 0; i < 9 * (size_t)to->start[to->n]; i++) to->value[i] = stiff * e->rest.value[i];
    const pal_mass_operator *m = body->mass_operator;
    for (int i = 0; i < body->n_dof; i++) {
        for (int32_t k = m ? m->start[i] : 0; m && k < m->start[i + 1]; k++) {
            int at = m->point[k] >= i ? pal_block_matrix_find(to, m->point[k], i) : -1;
            double w = system->mass * m->mass_kg[k] + (m->damping_kg_s ? system->damp * m->damping_kg_s[k] : 0);
            for (int c = 0; c < 3 && at >= 0; c++) to->value[9 * (size_t)at + 4 * (size_t)c] += w;
        }
        for (int c = 0; c < 3 && !m; c++)
            to->value[9 * (size_t)to->start[i] + 4 * (size_t)c] += system->mass * body->mass_kg[i];
        /* points may move so that no node does, as corners of one smooth cube by turns: there is no mass against it */
        for (int c = 0; c < 3 && system->mass > 0; c++) to->value[9 * (size_t)to->start[i] + 4 * (size_t)c] *= 1 + 1e-9;
    }
}

static void assemble_nodes(const pal_system *system, pal_block_matrix *to)
{
    const pal_body *body = system->body;
    pal_block_matrix_zero(to);
    for (int i = 0; i < body->n_node; i++)
        for (int c = 0; c < 3; c++)
            to->value[9 * (size_t)to->start[i] + 4 * (size_t)c] = system->mass * body->mass_kg[i];
    for (int i = 0; i < system->n_force; i++) {
        const pal_component *component = &system->force[i];
        if (component->effect->tangent && component->effect->tangent->assemble)
            component->effect->tangent->assemble(component->self, system->stiff + system->viscous, to);
    }
}

void pal_system_assemble(pal_system *system, pal_block_matrix *to)
{
    double before = pal_clock_s();
    if (system->interpolated_system)
        assemble_interpolated(system, to);
    else
        assemble_nodes(system, to);
    system->assemble_s += pal_clock_s() - before;
}

bool pal_system_settle_contact(const pal_system *system, pal_step *step, const double *x0, double *moved,
                               double *node_moved, bool last)
{
    const pal_body *body = system->body;
    bool again = false;
    for (int i = 0; i < 3 * body->n_dof; i++) moved[i] = body->x[i] - x0[i];
    if (body->interpolation) pal_interpolation_apply(body->interpolation, moved, node_moved);
    for (int i = 0; i < step->n_contact; i++) {
        const pal_component *component = &step->contact[i];
        if (component->effect->tangent && component->effect->tangent->settle)
            again |= component->effect->tangent->settle(component->self, step, node_moved, last);
    }
    return again;
}

double pal_system_energy(const pal_system *system)
{
    return pal_components_energy_J(system->force, system->n_force, system->body);
}

/* ---- supports ---- */

/* the fixed nodes of one part, and those of elements that stick to ground, span a plane: three of them off a line.
 * first, far: -1 as long as there is none */
typedef struct span {
    int32_t first, far;
    double far_m, off_m; /* from first; from the line through first and far */
} span;

static void count_parts(const pal_body *body, const uint8_t *held, int32_t *parent, span *s, pal_support_report *out)
{
    int n = body->n_dof;
    *out = (pal_support_report){.unsupported_node = -1};
    for (int i = 0; i < n; i++) s[i] = (span){.first = -1, .far = -1};
    for (int i = 0; i < n; i++)
        if (held[i]) {
            span *t = &s[pal_union_find_root(parent, i)];
            if (t->first < 0) t->first = i;
            double distance = pal_dist3(body->x_rest + 3 * t->first, body->x_rest + 3 * i);
            if (distance > t->far_m) t->far_m = distance, t->far = i;
        }
    for (int i = 0; i < n; i++) {
        span *t = &s[pal_union_find_root(parent, i)];
        double area2[3]; /* of the triangle first, far, i */
        if (!held[i] || t->far < 0) continue;
        pal_normal3(area2, body->x_rest + 3 * t->first, body->x_rest + 3 * t->far, body->x_rest + 3 * i);
        t->off_m = fmax(t->off_m, pal_norm3(area2) / t->far_m);
    }
    for (int i = 0; i < n; i++) {
        if (parent[i] != i) continue;
        out->n_part++;
        /* a part of one node is held as soon as that node is */
        if (s[i].off_m > 1e-9 * body->length_scale_m || (held[i] && s[i].far < 0)) continue;
        out->n_unsupported++;
        if (out->unsupported_node < 0) out->unsupported_node = i;
    }
}

static void mark_held(const pal_body *body, uint8_t *held)
{
    memcpy(held, body->support, (size_t)body->n_dof);
    for (int k = 0; body->ground && k < body->ground->n; k++)
        for (int c = 0; c < 8; c++) held[body->hexes->node[8 * body->ground->item[k].element + c]] = 1;
}

pal_err pal_system_find_supports(const pal_system *system, pal_support_report *out)
{
    int n_list = 0, n = system->body->n_dof;
    pal_cliques *list = list_cliques(system, &n_list);
    const pal_block_matrix *a = system->interpolated_system ? &system->interpolated_system->rest : NULL;
    int32_t *parent = malloc(sizeof *parent * (size_t)n);
    span *s = malloc(sizeof *s * (size_t)n);
    uint8_t *held = malloc((size_t)n);
    bool all = list && parent && s && held;
    if (all) {
        mark_held(system->body, held);
        for (int32_t i = 0; i < n; i++) parent[i] = i;
        for (int l = 0; l < n_list && !a; l++)
            for (int e = 0; e < list[l].n_item; e++) {
                const int32_t *node = list[l].node + (size_t)list[l].n_corner * (size_t)e;
                for (int c = 1; c < list[l].n_corner; c++) pal_union_find_join(parent, node[0], node[c]);
            }
        for (int32_t j = 0; a && j < n; j++)
            for (int32_t k = a->start[j]; k < a->start[j + 1]; k++)
                parent[pal_union_find_root(parent, a->row[k])] = pal_union_find_root(parent, j);
        count_parts(system->body, held, parent, s, out);
    }
    free(list), free(parent), free(s), free(held);
    return all ? PAL_ERR_OK : PAL_ERR_MEMORY;
}
