/* Volumetric locking of subdivision solids: mean change of volume of a control cell.
 *
 * A subdivision solid has few control points for its many elements (125 for 512 in a cube of 4 cells a side). They
 * cannot conserve the volume of each element, and the solid locks: by 8 % for a bent beam of two cells across at nu
 * 0.45. Above PAL_LOCK_FREE_POISSON a part of the bulk modulus therefore acts on the mean over all elements of a
 * control cell, as the mean dilatation of one element does on its points (Hughes 1980), each element's strain in its
 * own frame:
 *
 *     E_c = 1/2 (sum_e b_e.d^_e)^2 / int kappa dV,   b_e = int kappa grad N dV,   kappa = lambda - min(lambda, mu),
 *
 * and elements keep K of min(lambda, mu), as at nu = 0.25. With all of it in the cell (kappa = lambda + 2/3 mu), one
 * side of a cell could swell without energy while the other one shrinks: a beam of one cell across would bend twice as
 * far as it should; with mu kept it bends 5 to 9 % farther, and beams of two or three cells are 2 to 3 and 1 to 1.6 %
 * too stiff at any nu. E remains a function of the d^, and so do forces, momentum and tangent (cell_kernel.h). It takes
 * a second pass over the elements. */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/sim/elements/elastic_law.h"
#include "server/sim/subdivision/cell_kernel.h"

#include <math.h>
#include <string.h>

void pal_cell_lame(const pal_subdivision_solid *solid, pal_cell_kind kind, int element, int point, double *mu_Pa,
                   double *lambda_Pa)
{
    const pal_material_samples *s = &solid->samples[kind];
    const size_t at = (size_t)element * PAL_CELL_GAUSS_POINTS + (size_t)point;
    pal_lame((double)s->young_Pa[at], fmin((double)s->poisson[at], PAL_POISSON_CLAMP), mu_Pa, lambda_Pa);
}

static bool asked(const pal_cells_elastic *c)
{
    float max = 0;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        for (size_t i = 0; i < (size_t)c->solid->elements.n[kind] * PAL_CELL_GAUSS_POINTS; i++)
            max = fmaxf(max, c->solid->samples[kind].poisson[i]);
    return c->op == PAL_CELL_POLAR && max > (float)PAL_LOCK_FREE_POISSON;
}

static int32_t home_of(const pal_subdivision_solid *solid, pal_cell_kind kind, int element)
{
    return solid->subdivision.cell_origin[solid->elements.cell[kind][element]];
}

/* all nodes of each control cell's elements: what the shared energy couples */
static pal_err couple(pal_cells_elastic *c, pal_arena *arena)
{
    const pal_subdivision_solid *solid = c->solid;
    const int n = c->volume.n;
    int32_t *count = PAL_NEW(arena, int32_t, n), *node = NULL;
    size_t max = 1;
    if (!count) return PAL_ERR_MEMORY;
    /* once to count, once to fill */
    for (int pass = 0; pass < 2; pass++) {
        memset(count, 0, sizeof *count * (size_t)n);
        for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
            for (int e = 0; e < solid->elements.n[kind]; e++) {
                const int32_t home = home_of(solid, kind, e);
                const int n_node = pal_cell_kind_nodes(kind);
                if (pass)
                    memcpy(node + (size_t)home * max + count[home], pal_subdivision_solid_nodes(solid, kind, e),
                           sizeof *node * (size_t)n_node);
                count[home] += n_node;
                if ((size_t)count[home] > max) max = (size_t)count[home];
            }
        if (pass == 0 && !(node = PAL_NEW(arena, int32_t, (size_t)n * max))) return PAL_ERR_MEMORY;
    }
    for (int i = 0; i < n; i++)
        for (size_t k = (size_t)count[i]; k < max; k++) node[(size_t)i * max + k] = node[(size_t)i * max];
    c->volume.couple = (pal_cliques){.n_item = n, .n_corner = (int)max, .node = node};
    return PAL_ERR_OK;
}

pal_err pal_cell_volume_make(pal_cells_elastic *c, pal_arena *arena)
{
    const pal_subdivision_solid *solid = c->solid;
    c->volume = (pal_cell_volume){.n = 0};
    if (!asked(c)) return PAL_ERR_OK;
    int n = 0;
    for (int i = 0; i < solid->subdivision.cells.n_cell; i++)
        n = solid->subdivision.cell_origin[i] >= n ? solid->subdivision.cell_origin[i] + 1 : n;
    c->volume.sum = PAL_NEW(arena, double, n);
    c->volume.share = PAL_NEW(arena, double, n);
    c->volume.push = PAL_NEW(arena, double, n);
    if (!c->volume.sum || !c->volume.share || !c->volume.push) return PAL_ERR_MEMORY;
    c->volume.n = n;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        pal_cell_group *g = &c->group[kind];
        const size_t n_lane = (size_t)g->n_block * PAL_LANES;
        if (n_lane == 0) continue;
        g->home = PAL_NEW(arena, int32_t, n_lane);
        g->swell = PAL_NEW(arena, double, n_lane *(size_t)g->n_node * 3);
        if (!g->home || !g->swell) return PAL_ERR_MEMORY;
        for (int i = 0; i < (int)n_lane; i++) g->home[i] = home_of(solid, kind, i < g->n ? i : g->n - 1);
    }
    return couple(c, arena);
}

/* b of one element; returns int kappa dV */
static double swell_of(const pal_subdivision_solid *solid, pal_cell_kind kind, int element, pal_cell_shapes *shapes,
                       double b[PAL_CELL_MAX_NODES][3])
{
    const int32_t *node = pal_subdivision_solid_nodes(solid, kind, element);
    const int n_node = pal_cell_kind_nodes(kind);
    const double *volume_m3 = solid->samples[kind].volume_m3 + (size_t)element * PAL_CELL_GAUSS_POINTS;
    double all = 0;
    memset(b, 0, sizeof *b * PAL_CELL_MAX_NODES);
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        double J[9], cofactor[9], mu, lambda;
        const double det = pal_subdivision_solid_jacobian(solid->node_rest, node, n_node, shapes->g[p], J);
        pal_cofactor3(J, cofactor);
        pal_cell_lame(solid, kind, element, p, &mu, &lambda);
        const double kappa_J = (lambda - pal_cell_own_lambda(mu, lambda)) * volume_m3[p];
        all += kappa_J;
        /* J^-T = cofactor / det */
        for (int m = 0; m < n_node; m++)
            for (int i = 0; i < 3; i++) b[m][i] += kappa_J / det * pal_dot3(cofactor + 3 * i, shapes->g[p][m]);
    }
    return all;
}

void pal_cell_volume_refresh(pal_cells_elastic *c)
{
    if (c->volume.n == 0) return;
    memset(c->volume.share, 0, sizeof(double) * (size_t)c->volume.n);
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        const pal_cell_group *g = &c->group[kind];
        pal_cell_shapes shapes;
        double b[PAL_CELL_MAX_NODES][3];
        pal_cell_shapes_fill(kind, &shapes);
        for (int i = 0; i < g->n_block * PAL_LANES; i++) {
            const double all = swell_of(c->solid, kind, i < g->n ? i : g->n - 1, &shapes, b);
            double *to = g->swell + (size_t)(i / PAL_LANES) * (size_t)g->n_node * 3 * PAL_LANES + i % PAL_LANES;
            for (int k = 0; k < 3 * g->n_node; k++) to[(size_t)k * PAL_LANES] = b[k / 3][k % 3];
            if (i < g->n) c->volume.share[g->home[i]] += all;
        }
    }
    for (int i = 0; i < c->volume.n; i++) c->volume.share[i] = c->volume.share[i] > 0 ? 1 / c->volume.share[i] : 0;
}
