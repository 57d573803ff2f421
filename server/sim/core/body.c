/* Body arrays and sums over them. */
#include "server/sim/core/body.h"

#include "server/base/vec3.h"
#include "server/num/mass_operator.h"
#include "server/num/shape_functions.h"
#include "server/sim/core/sums.h"
#include "server/sim/core/tuning.h"

#include <math.h>
#include <string.h>

static const char *const field_name[PAL_FIELD_COUNT] = {"none",   "displacement", "von_mises", "energy",  "stiffness",
                                                        "strain", "distortion",   "young",     "density", "damping"};

const char *pal_field_name(pal_field field)
{
    return field_name[(unsigned)field < PAL_FIELD_COUNT ? field : PAL_FIELD_NONE];
}

pal_field pal_field_find(const char *name)
{
    int found = PAL_FIELD_COUNT - 1;
    while (found > PAL_FIELD_NONE && strcmp(field_name[found], name)) found--;
    return (pal_field)found;
}

const char *pal_field_title(pal_field field)
{
    static const char *const title[PAL_FIELD_COUNT] = {
        "no field",       "displacement",   "von Mises stress",  "strain energy density",
        "edge stiffness", "largest strain", "volume distortion", "Young's modulus",
        "density",        "damping"};
    return title[(unsigned)field < PAL_FIELD_COUNT ? field : PAL_FIELD_NONE];
}

pal_err pal_body_allocate(pal_body *body, pal_arena *arena, int n_node)
{
    const size_t n3 = 3 * (size_t)n_node;
    body->mass_kg = PAL_NEW(arena, double, n_node);
    body->support = PAL_NEW(arena, uint8_t, n_node);
    if (!PAL_NEW_DOUBLES(arena, n3, &body->x, &body->v, &body->f, &body->load, &body->x_rest) || !body->mass_kg ||
        !body->support)
        return PAL_ERR_MEMORY;
    body->n_dof = body->n_node = body->n_active = n_node;
    body->d = body->x;
    body->dv = body->v;
    body->g = body->f;
    body->node_mass_kg = body->mass_kg;
    body->node_rest = body->x_rest;
    return PAL_ERR_OK;
}

pal_err pal_body_allocate_interpolated(pal_body *body, pal_arena *arena, const pal_interpolation *rows)
{
    const size_t n3 = 3 * (size_t)rows->n_row;
    PAL_TRY(pal_body_allocate(body, arena, rows->n_point));
    body->node_mass_kg = PAL_NEW(arena, double, rows->n_row);
    if (!PAL_NEW_DOUBLES(arena, n3, &body->d, &body->dv, &body->f, &body->load, &body->node_rest) ||
        !body->node_mass_kg)
        return PAL_ERR_MEMORY;
    body->n_node = rows->n_row;
    body->interpolation = rows;
    return PAL_ERR_OK;
}

void pal_body_update_nodes(pal_body *body)
{
    if (!body->interpolation) return;
    pal_interpolation_apply(body->interpolation, body->x, body->d);
    pal_interpolation_apply(body->interpolation, body->v, body->dv);
}

double pal_body_kinetic_J(const pal_body *body)
{
    double sum = 0;
    if (body->mass_operator) return pal_mass_operator_kinetic_J(body->mass_operator, body->v);
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        const double *v = body->v + 3 * i;
        sum += 0.5 * body->mass_kg[i] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    }
    return sum;
}

double pal_body_element_volume_m3(const pal_body *body, const int32_t *corner)
{
    const double *x = body->x_rest, *o = x + 3 * corner[0];
    double e[3], n[3];
    if (body->n_corner != 8) return pal_tet_volume(x, corner);
    pal_sub3(e, x + 3 * corner[1], o);
    pal_normal3(n, o, x + 3 * corner[2], x + 3 * corner[4]);
    return pal_dot3(e, n);
}

void pal_body_corner_shares(const pal_body *body, int e, double *share)
{
    /* shape function of a corner at the Gauss points, by how many axes lead from it to the point */
    const double near = (1 + sqrt(1.0 / 3)) / 2, far = 1 - near;
    const double shape[4] = {near * near * near, near * near * far, near * far * far, far * far * far};
    const int n_corner = body->element ? body->n_corner : 4;
    const double fill = body->fill ? (double)body->fill[e] : 1;
    if (body->moment_fitting && fill < 1) {
        double weight[8];
        pal_hexes_weights(body->hexes, e, PAL_FILL_MIN, weight);
        for (int c = 0; c < 8; c++) {
            share[c] = 0;
            for (int q = 0; q < 8; q++)
                share[c] += weight[q] * shape[((c ^ q) & 1) + ((c ^ q) >> 1 & 1) + ((c ^ q) >> 2)];
        }
        return;
    }
    for (int c = 0; c < n_corner; c++)
        share[c] =
            fill * (body->own_corner ? pal_body_tet_share(body->own_corner[e], c) : pal_body_corner_share(n_corner, c));
}

void pal_body_measure_density(const pal_body *body, double *mass_kg, double *volume_m3)
{
    const bool own = body->element != NULL;
    const int n = own ? body->n_element : body->tets->n_tet, n_corner = own ? body->n_corner : 4;
    for (int e = 0; e < n; e++) {
        const int32_t *corner = (own ? body->element : body->tets->tet) + (size_t)n_corner * (size_t)e;
        const double volume = pal_body_element_volume_m3(body, corner);
        double share[PAL_MAX_CORNERS];
        pal_body_corner_shares(body, e, share);
        for (int c = 0; c < n_corner; c++) volume_m3[corner[c]] += volume * share[c];
    }
    for (int i = 0; i < body->n_node; i++) mass_kg[i] += body->node_mass_kg[i];
}

bool pal_body_finite(const pal_body *body)
{
    const int n = 3 * body->n_dof;
    double sum = 0;
    if (!body->active) return pal_copy_finite(n, body->x, NULL) && pal_copy_finite(n, body->v, NULL);
    /* 0 * x is 0 for finite x and NaN otherwise */
    for (int k = 0; k < body->n_active; k++) {
        size_t i = 3 * (size_t)body->active[k];
        for (size_t c = 0; c < 3; c++) sum += 0 * body->x[i + c] + 0 * body->v[i + c];
    }
    return sum == 0;
}

void pal_body_add_display_offset(pal_body *body)
{
    float part = (float)body->display.offset_part;
    /* of a body that adapts, the OUTPUT component writes the active dofs each time, the others stay */
    int n = !body->display.offset_m ? 0 : body->active ? body->n_active : body->display.n_shown;
    for (int k = 0; k < n; k++) {
        size_t i = 3 * (size_t)(body->active ? body->active[k] : k);
        for (size_t c = i; c < i + 3; c++) body->display.shown[c] += part * body->display.offset_m[c];
    }
}
