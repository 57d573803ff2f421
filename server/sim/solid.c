/* Subdivided solids as finite elements. */
#include "server/sim/solid.h"

#include "server/base/vec3.h"

#include <stdlib.h>

double pal_solid_jacobian(const double *x, const int32_t *node, int n_node, double (*g)[3], double J[9])
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

/* calls back at every Gauss point of every element: place and volume of the point at rest */
typedef bool on_point(void *user, pal_cell_kind kind, int element, int p, const double x[3], double volume);

static bool each_point(const pal_solid *s, on_point *on, void *user)
{
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        const int n_node = pal_cell_kind_nodes(kind);
        double n[PAL_CELL_POINTS][PAL_CELL_NODES_MOST], g[PAL_CELL_POINTS][PAL_CELL_NODES_MOST][3];
        double weight[PAL_CELL_POINTS];
        for (int p = 0; p < PAL_CELL_POINTS; p++) {
            double at[3];
            weight[p] = pal_cell_point(p, at);
            pal_cell_shape(n_node, at, n[p], g[p]);
        }
        for (int e = 0; e < s->elements.n[kind]; e++) {
            const int32_t *node = pal_solid_nodes(s, kind, e);
            for (int p = 0; p < PAL_CELL_POINTS; p++) {
                double J[9], x[3] = {0, 0, 0};
                double volume = weight[p] * pal_solid_jacobian(s->node_rest, node, n_node, g[p], J);
                for (int m = 0; m < n_node; m++) pal_axpy3(x, n[p][m], s->node_rest + 3 * (size_t)node[m]);
                if (!on(user, kind, e, p, x, volume)) return false;
            }
        }
    }
    return true;
}

/* ---- samples ---- */

typedef struct sampler {
    pal_solid *solid;
    const pal_body_def *def;
} sampler;

static bool take_sample(void *user, pal_cell_kind kind, int element, int p, const double x[3], double volume)
{
    const sampler *s = user;
    pal_solid_samples *to = &s->solid->samples[kind];
    size_t i = (size_t)element * PAL_CELL_POINTS + (size_t)p;
    pal_material m;
    (void)volume;
    pal_material_painted(s->def, x, &m);
    to->young_Pa[i] = (float)m.young_Pa;
    to->poisson[i] = (float)m.poisson;
    to->density_kg_m3[i] = (float)m.density_kg_m3;
    to->damping_1_s[i] = (float)m.damping_1_s;
    return true;
}

void pal_solid_sample(pal_solid *solid, const pal_body_def *def)
{
    sampler s = {solid, def};
    if (def != &solid->def) solid->def = *def;
    each_point(solid, take_sample, &s);
    solid->sampled++;
}

/* ---- measures ---- */

typedef struct measure {
    const pal_solid *solid;
    double volume, mass;
    int32_t folded; /* cell of an element that is folded over, -1: none */
    double det;
} measure;

static bool take_measure(void *user, pal_cell_kind kind, int element, int p, const double x[3], double volume)
{
    measure *m = user;
    (void)x;
    m->volume += volume;
    m->mass += volume * (double)m->solid->samples[kind].density_kg_m3[(size_t)element * PAL_CELL_POINTS + (size_t)p];
    return true;
}

/* a pyramid has no volume in its apex, but at every Gauss point */
static bool find_fold(void *user, pal_cell_kind kind, int element, int p, const double x[3], double volume)
{
    measure *m = user;
    (void)p, (void)x;
    if (volume > 0) return true;
    m->folded = m->solid->elements.cell[kind][element], m->det = volume;
    return false;
}

double pal_solid_volume_m3(const pal_solid *solid)
{
    measure m = {.solid = solid};
    each_point(solid, take_measure, &m);
    return m.volume;
}

double pal_solid_mass_kg(const pal_solid *solid)
{
    measure m = {.solid = solid};
    each_point(solid, take_measure, &m);
    return m.mass;
}

/* ---- making ---- */

static pal_err allocate(pal_solid *s)
{
    s->n_byte = sizeof *s + s->subdivision.n_byte + pal_point_rows_bytes(&s->rows);
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        size_t n = (size_t)s->elements.n[kind] * PAL_CELL_POINTS;
        float **to[4] = {&s->samples[kind].young_Pa, &s->samples[kind].poisson, &s->samples[kind].density_kg_m3,
                         &s->samples[kind].damping_1_s};
        for (int i = 0; i < 4; i++)
            if (!(*to[i] = calloc(n ? n : 1, sizeof(float)))) return PAL_ERR_MEMORY;
        s->n_byte += 4 * n * sizeof(float);
    }
    s->node_rest = malloc(3 * sizeof(double) * (size_t)s->rows.n_row);
    s->n_byte += 3 * sizeof(double) * (size_t)s->rows.n_row;
    return s->node_rest ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static pal_err make(const pal_body_def *def, const pal_subdivision_options *options, pal_solid *s, pal_note *note)
{
    PAL_TRY(pal_subdivision_make(def->cells, options, &s->subdivision, note));
    PAL_TRY(pal_cell_elements_make(&s->subdivision.cells, &s->elements, note));
    PAL_TRY(pal_cell_elements_rows(&s->elements, &s->subdivision.rows, &s->rows));
    PAL_TRY(allocate(s));
    pal_point_rows_place(&s->rows, def->cells->x, s->node_rest);
    measure m = {.solid = s, .folded = -1};
    each_point(s, find_fold, &m);
    if (m.folded >= 0)
        return pal_note_set(note, PAL_ERR_REFUSED,
                            "body \"%s\": control cell %d: its part %d is folded over after %d levels (a point of it "
                            "has volume %g m^3)",
                            def->name, s->subdivision.cell_origin[m.folded], m.folded, options->n_level, m.det);
    pal_solid_sample(s, def);
    return PAL_ERR_OK;
}

pal_err pal_solid_make(const pal_body_def *def, const pal_subdivision_options *options, pal_solid **out, pal_note *note)
{
    pal_solid *s = calloc(1, sizeof *s);
    pal_err err = s ? make(def, options, s, note) : PAL_ERR_MEMORY;
    if (err)
        pal_solid_free(s);
    else
        *out = s;
    return err;
}

void pal_solid_free(pal_solid *solid)
{
    if (!solid) return;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        pal_solid_samples *s = &solid->samples[kind];
        free(s->young_Pa), free(s->poisson), free(s->density_kg_m3), free(s->damping_1_s);
    }
    pal_subdivision_free(&solid->subdivision);
    pal_cell_elements_free(&solid->elements);
    pal_point_rows_free(&solid->rows);
    free(solid->node_rest);
    free(solid);
}
