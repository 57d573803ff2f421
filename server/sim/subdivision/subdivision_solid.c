/* Subdivision solids as finite elements. */
#include "server/sim/subdivision/subdivision_solid.h"

#include "server/base/vec3.h"

#include <stdlib.h>

double pal_subdivision_solid_jacobian(const double *x, const int32_t *node, int n_node, double (*g)[3], double J[9])
{
    /* sums of its own: J might be anywhere */
    double a[9] = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    for (int m = 0; m < n_node; m++) {
        const double *at = x + 3 * (size_t)node[m], u = g[m][0], v = g[m][1], w = g[m][2];
        a[0] += at[0] * u, a[1] += at[0] * v, a[2] += at[0] * w;
        a[3] += at[1] * u, a[4] += at[1] * v, a[5] += at[1] * w;
        a[6] += at[2] * u, a[7] += at[2] * v, a[8] += at[2] * w;
    }
    for (int i = 0; i < 9; i++) J[i] = a[i];
    return a[0] * (a[4] * a[8] - a[5] * a[7]) - a[1] * (a[3] * a[8] - a[5] * a[6]) + a[2] * (a[3] * a[7] - a[4] * a[6]);
}

void pal_cell_shapes_fill(pal_cell_kind kind, pal_cell_shapes *out)
{
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        double at[3];
        out->weight[p] = pal_cell_gauss_point(p, at);
        pal_cell_shape(pal_cell_kind_nodes(kind), at, out->n[p], out->g[p]);
    }
}

/* ---- samples ---- */

static void put_sample(pal_material_samples *to, size_t i, const pal_material *m)
{
    to->young_Pa[i] = (float)m->young_Pa;
    to->poisson[i] = (float)m->poisson;
    to->density_kg_m3[i] = (float)m->density_kg_m3;
    to->damping_1_s[i] = (float)pal_material_damping_1_s(m, 0);
}

/* constant material, or by the position of every point */
static void sample_kind(pal_subdivision_solid *s, pal_cell_kind kind, const pal_body_def *def)
{
    const int n_node = pal_cell_kind_nodes(kind);
    const bool varies = def->n_region > 0 || def->n_stroke > 0;
    size_t i = 0;
    pal_cell_shapes f;
    pal_cell_shapes_fill(kind, &f);
    for (int e = 0; e < s->elements.n[kind]; e++) {
        const int32_t *node = pal_subdivision_solid_nodes(s, kind, e);
        for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++, i++) {
            double x[3] = {0, 0, 0};
            pal_material m;
            for (int k = 0; k < n_node && varies; k++) pal_axpy3(x, f.n[p][k], s->node_rest + 3 * (size_t)node[k]);
            pal_material_painted(def, x, &m);
            put_sample(&s->samples[kind], i, &m);
        }
    }
}

void pal_subdivision_solid_sample(pal_subdivision_solid *solid, const pal_body_def *def)
{
    if (def != &solid->def) solid->def = *def;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) sample_kind(solid, kind, def);
    solid->sampled++;
}

/* ---- measures ---- */

/* volumes of all points; the cell of the first element that is folded over, -1: none. A pyramid has no volume in its
 * apex, but at every point */
static int32_t find_volumes(pal_subdivision_solid *s, double *folded_m3)
{
    pal_cell_shapes f;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        double *volume = s->samples[kind].volume_m3;
        pal_cell_shapes_fill(kind, &f);
        for (int e = 0; e < s->elements.n[kind]; e++) {
            const int32_t *node = pal_subdivision_solid_nodes(s, kind, e);
            for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++, volume++) {
                double J[9];
                *volume = f.weight[p] *
                          pal_subdivision_solid_jacobian(s->node_rest, node, pal_cell_kind_nodes(kind), f.g[p], J);
                if (*volume > 0) continue;
                *folded_m3 = *volume;
                return s->elements.cell[kind][e];
            }
        }
    }
    return -1;
}

double pal_subdivision_solid_volume_m3(const pal_subdivision_solid *solid)
{
    double sum = 0;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (size_t i = 0; i < (size_t)solid->elements.n[kind] * PAL_CELL_GAUSS_POINTS; i++)
            sum += solid->samples[kind].volume_m3[i];
    return sum;
}

/* ---- making ---- */

static pal_err allocate(pal_subdivision_solid *s)
{
    s->n_byte = sizeof *s + s->subdivision.n_byte + pal_interpolation_bytes(&s->rows);
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        size_t n = (size_t)s->elements.n[kind] * PAL_CELL_GAUSS_POINTS;
        float **to[4] = {&s->samples[kind].young_Pa, &s->samples[kind].poisson, &s->samples[kind].density_kg_m3,
                         &s->samples[kind].damping_1_s};
        for (int i = 0; i < 4; i++)
            if (!(*to[i] = calloc(n ? n : 1, sizeof(float)))) return PAL_ERR_MEMORY;
        if (!(s->samples[kind].volume_m3 = calloc(n ? n : 1, sizeof(double)))) return PAL_ERR_MEMORY;
        s->n_byte += n * (4 * sizeof(float) + sizeof(double));
    }
    s->node_rest = malloc(3 * sizeof(double) * (size_t)s->rows.n_row);
    s->n_byte += 3 * sizeof(double) * (size_t)s->rows.n_row;
    return s->node_rest ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err make(const pal_body_def *def, const pal_subdivision_options *options, pal_subdivision_solid *s,
                    pal_diagnostic *diag)
{
    PAL_TRY(pal_subdivision_make(def->cells, options, &s->subdivision, diag));
    PAL_TRY(pal_cell_elements_make(&s->subdivision.cells, &s->elements, diag));
    PAL_TRY(pal_cell_elements_interpolation(&s->elements, &s->subdivision.rows, &s->rows));
    PAL_TRY(allocate(s));
    pal_interpolation_apply(&s->rows, def->cells->x, s->node_rest);
    double folded_m3 = 0;
    int32_t folded = find_volumes(s, &folded_m3);
    if (folded >= 0)
        return PAL_REFUSE(diag,
                          "control cell %d: its part %d is folded over after %d levels (a point of it has volume %g "
                          "m^3)",
                          s->subdivision.cell_origin[folded], folded, options->n_level, folded_m3);
    pal_subdivision_solid_sample(s, def);
    return PAL_ERR_OK;
}

pal_err pal_subdivision_solid_make(const pal_body_def *def, const pal_subdivision_options *options,
                                   pal_subdivision_solid **out, pal_diagnostic *diag)
{
    pal_subdivision_solid *s = calloc(1, sizeof *s);
    pal_err err = s ? make(def, options, s, diag) : PAL_ERR_MEMORY;
    if (err)
        pal_subdivision_solid_free(s);
    else
        *out = s;
    return err;
}

void pal_subdivision_solid_free(pal_subdivision_solid *solid)
{
    if (!solid) return;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        pal_material_samples *s = &solid->samples[kind];
        free(s->young_Pa), free(s->poisson), free(s->density_kg_m3), free(s->damping_1_s), free(s->volume_m3);
    }
    pal_subdivision_free(&solid->subdivision);
    pal_cell_elements_free(&solid->elements);
    pal_interpolation_free(&solid->rows);
    free(solid->node_rest);
    free(solid);
}
