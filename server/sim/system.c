/* Rows as a system of equations. */
#include "server/sim/system.h"

#include "server/base/vec3.h"

#include <stdlib.h>
#include <string.h>

pal_err pal_system_make(const pal_build *build, pal_system *out)
{
    pal_body *body = build->body;
    *out = (pal_system){.body = body, .has_energy = true, .mass = 1};
    out->force = PAL_NEW(build->arena, pal_row, build->n_made);
    if (!out->force) return PAL_ERR_MEMORY;
    for (int i = 0; i < build->n_made; i++) {
        const pal_row *row = &build->made[i];
        if (row->effect->stage != PAL_STAGE_FORCE) continue;
        out->force[out->n_force++] = (pal_row){.effect = row->effect, .self = row->self};
        if (!row->effect->drag && !row->effect->energy) out->has_energy = false;
        if (row->effect->tangent && row->effect->tangent->rotate) out->has_turn = true;
    }
    for (int i = 0; i < body->n_node; i++) out->n_free += !body->held[i];
    return PAL_ERR_OK;
}

/* the cliques of all rows, heap [system->n_force] */
static pal_cliques *list_cliques(const pal_system *system, int *n_list)
{
    pal_cliques *list = calloc((size_t)system->n_force + 1, sizeof *list);
    *n_list = 0;
    for (int i = 0; i < system->n_force && list; i++) {
        const pal_row *row = &system->force[i];
        if (row->effect->tangent && row->effect->tangent->couple &&
            row->effect->tangent->couple(row->self, &list[*n_list]))
            ++*n_list;
    }
    return list;
}

pal_err pal_system_pattern(const pal_system *system, pal_arena *arena, pal_blocks *out)
{
    int n_list;
    pal_cliques *list = list_cliques(system, &n_list);
    if (!list) return PAL_ERR_MEMORY;
    pal_err err = pal_blocks_make(system->body->n_node, list, n_list, arena, out);
    free(list);
    return err;
}

void pal_system_linearise(const pal_system *system)
{
    for (int i = 0; i < system->n_force; i++) {
        const pal_row *row = &system->force[i];
        if (row->effect->tangent) row->effect->tangent->linearise(row->self, system->body);
    }
}

void pal_system_touch(pal_system *system, const pal_step *step)
{
    system->contact = step->contact;
    system->n_contact = step->n_contact;
    system->has_contact = false;
    for (int i = 0; i < step->n_contact; i++) {
        const pal_row *row = &step->contact[i];
        if (!row->effect->tangent) continue;
        if (row->effect->tangent->linearise) row->effect->tangent->linearise(row->self, system->body);
        system->has_contact |= row->effect->tangent->multiply != NULL;
    }
}

void pal_system_rotate(const pal_system *system, double *turn)
{
    memset(turn, 0, 9 * sizeof(double) * (size_t)system->body->n_node);
    for (int i = 0; i < system->n_force; i++) {
        const pal_row *row = &system->force[i];
        if (row->effect->tangent && row->effect->tangent->rotate)
            row->effect->tangent->rotate(row->self, system->body, turn);
    }
}

void pal_system_contact(const pal_system *system, double k, double c, const double *p, double *out)
{
    for (int i = 0; i < system->n_contact; i++) {
        const pal_row *row = &system->contact[i];
        if (row->effect->tangent && row->effect->tangent->multiply)
            row->effect->tangent->multiply(row->self, system->body, k, c, p, out);
    }
}

void pal_system_multiply(const pal_system *system, const double *p, double *out)
{
    const pal_body *body = system->body;
    for (int i = 0; i < body->n_node; i++) {
        double m = system->mass * body->mass_kg[i];
        for (int c = 0; c < 3; c++) out[3 * i + c] = m * p[3 * i + c];
    }
    for (int i = 0; i < system->n_force; i++) {
        const pal_row *row = &system->force[i];
        if (row->effect->tangent) row->effect->tangent->multiply(row->self, body, system->stiff, system->damp, p, out);
    }
    if (system->has_contact) pal_system_contact(system, system->stiff, system->damp, p, out);
    for (int i = 0; i < body->n_node; i++)
        if (body->held[i]) pal_set3(out + 3 * i, 0, 0, 0);
}

/* forces of the internal rows at body->x, in body->f */
static void find_inner_forces(const pal_system *system)
{
    pal_body *body = system->body;
    pal_step step = {.body = body, .force = system->force, .n_force = system->n_force};
    memset(body->f, 0, 3 * sizeof(double) * (size_t)body->n_node);
    for (int i = 0; i < system->n_force; i++)
        if (system->force[i].effect->internal) (void)system->force[i].effect->run(system->force[i].self, &step);
}

void pal_system_curve(const pal_system *system, const double *x, double *low, const double *p, double *out)
{
    pal_body *body = system->body;
    const int n = 3 * body->n_node;
    double longest = 0;
    for (int i = 0; i < n; i++) longest = fmax(longest, fabs(p[i]));
    double part = longest > 0 ? 1e-5 * body->h_m / longest : 0;
    for (int side = -1; side <= 1; side += 2) {
        for (int i = 0; i < n; i++) body->x[i] = x[i] + side * part * p[i];
        find_inner_forces(system);
        if (side < 0) memcpy(low, body->f, sizeof(double) * (size_t)n);
    }
    for (int i = 0; i < n; i++) {
        body->x[i] = x[i];
        out[i] = body->held[i / 3] || part == 0 ? 0 : (low[i] - body->f[i]) / (2 * part);
    }
}

void pal_system_assemble(const pal_system *system, pal_blocks *to)
{
    const pal_body *body = system->body;
    pal_blocks_zero(to);
    for (int i = 0; i < body->n_node; i++)
        for (int c = 0; c < 3; c++)
            to->value[9 * (size_t)to->start[i] + 4 * (size_t)c] = system->mass * body->mass_kg[i];
    for (int i = 0; i < system->n_force; i++) {
        const pal_row *row = &system->force[i];
        if (row->effect->tangent && row->effect->tangent->assemble)
            row->effect->tangent->assemble(row->self, body, system->stiff, system->damp, to);
    }
}

double pal_system_energy(const pal_system *system)
{
    double sum = 0;
    for (int i = 0; i < system->n_force; i++) {
        const pal_row *row = &system->force[i];
        if (row->effect->energy) sum += row->effect->energy(row->self, system->body);
    }
    return sum;
}

double pal_system_drag(const pal_system *system)
{
    double rate = 0;
    for (int i = 0; i < system->n_force; i++)
        if (system->force[i].effect->drag) rate += system->force[i].effect->drag(system->force[i].self);
    return rate;
}

/* ---- supports ---- */

static int32_t root_of(int32_t *parent, int32_t i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static void join_parts(const pal_cliques *list, int n_list, int32_t *parent)
{
    for (int l = 0; l < n_list; l++)
        for (int e = 0; e < list[l].n_item; e++) {
            const int32_t *node = list[l].node + (size_t)list[l].n_corner * (size_t)e;
            int32_t root = root_of(parent, node[0]);
            for (int c = 1; c < list[l].n_corner; c++) parent[root_of(parent, node[c])] = root;
        }
}

/* the held nodes of one part span a plane: three of them off a line. first, far: -1 as long as there is none */
typedef struct span {
    int32_t first, far;
    double far_m, off_m; /* from first; from the line through first and far */
} span;

static void take_far(const pal_body *body, span *s, int32_t node)
{
    if (s->first < 0) s->first = node;
    double way = pal_dist3(body->x_rest + 3 * s->first, body->x_rest + 3 * node);
    if (way > s->far_m) s->far_m = way, s->far = node;
}

static void take_off(const pal_body *body, span *s, int32_t node)
{
    double line[3], to[3], across[3];
    if (s->far < 0) return;
    pal_sub3(line, body->x_rest + 3 * s->far, body->x_rest + 3 * s->first);
    pal_sub3(to, body->x_rest + 3 * node, body->x_rest + 3 * s->first);
    pal_cross3(across, line, to);
    s->off_m = fmax(s->off_m, pal_norm3(across) / s->far_m);
}

static void count_parts(const pal_body *body, int32_t *parent, span *s, pal_supports *out)
{
    int n = body->n_node;
    *out = (pal_supports){.loose_node = -1};
    for (int i = 0; i < n; i++) s[i] = (span){.first = -1, .far = -1};
    for (int i = 0; i < n; i++)
        if (body->held[i]) take_far(body, &s[root_of(parent, i)], i);
    for (int i = 0; i < n; i++)
        if (body->held[i]) take_off(body, &s[root_of(parent, i)], i);
    for (int i = 0; i < n; i++) {
        if (parent[i] != i) continue;
        out->n_part++;
        /* a part of one node is held as soon as that node is */
        if (s[i].off_m > 1e-9 * body->size_m || (body->held[i] && s[i].far < 0)) continue;
        out->n_loose++;
        if (out->loose_node < 0) out->loose_node = i;
    }
}

pal_err pal_system_supports(const pal_system *system, pal_supports *out)
{
    int n_list, n = system->body->n_node;
    pal_cliques *list = list_cliques(system, &n_list);
    int32_t *parent = malloc(sizeof *parent * (size_t)n);
    span *s = malloc(sizeof *s * (size_t)n);
    bool all = list && parent && s;
    if (all) {
        for (int32_t i = 0; i < n; i++) parent[i] = i;
        join_parts(list, n_list, parent);
        count_parts(system->body, parent, s, out);
    }
    free(list), free(parent), free(s);
    return all ? PAL_ERR_OK : PAL_ERR_MEMORY;
}
