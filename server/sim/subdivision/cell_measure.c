/* Strain, stress, energy and volume at the Gauss points of subdivided solids' elements, one element at a time: only for
 * what is looked at. */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/sim/elements/elastic_law.h"
#include "server/sim/subdivision/cell_kernel.h"

#include <math.h>
#include <string.h>

/* d(x, y, z)/d(u, v, w) at the points from values at the nodes, by sums along w, then v, then u */
static void cubic_gradients(const double x[PAL_CELL_MAX_NODES][3], double J[PAL_CELL_GAUSS_POINTS][9])
{
    double b[4][4], s[4][4], one[16][4][2][3], two[4][16][3][3];
    for (int p = 0; p < 4; p++) pal_spline(pal_gauss4_at[p], b[p], s[p]);
    memset(one, 0, sizeof one), memset(two, 0, sizeof two), memset(J, 0, PAL_CELL_GAUSS_POINTS * sizeof *J);
    for (int m = 0; m < 64; m++)
        for (int p = 0; p < 4; p++)
            for (int i = 0; i < 3; i++) {
                one[m / 4][p][0][i] += b[p][m % 4] * x[m][i];
                one[m / 4][p][1][i] += s[p][m % 4] * x[m][i];
            }
    for (int jk = 0; jk < 16; jk++)
        for (int p = 0; p < 16; p++)
            for (int i = 0; i < 3; i++) {
                const double value = one[jk][p % 4][0][i], slope = one[jk][p % 4][1][i];
                two[jk / 4][p][0][i] += b[p / 4][jk % 4] * value;
                two[jk / 4][p][1][i] += s[p / 4][jk % 4] * value;
                two[jk / 4][p][2][i] += b[p / 4][jk % 4] * slope;
            }
    for (int j = 0; j < 4; j++)
        for (int p = 0; p < 64; p++)
            for (int i = 0; i < 3; i++) {
                J[p][3 * i] += s[p / 16][j] * two[j][p % 16][0][i];
                J[p][3 * i + 1] += b[p / 16][j] * two[j][p % 16][1][i];
                J[p][3 * i + 2] += b[p / 16][j] * two[j][p % 16][2][i];
            }
}

static void gradients(int n_node, const double *at, const int32_t *node, double J[PAL_CELL_GAUSS_POINTS][9])
{
    double x[PAL_CELL_MAX_NODES][3], g[PAL_CELL_MAX_NODES][3];
    if (n_node == PAL_CUBIC_NODES) {
        for (int m = 0; m < n_node; m++) memcpy(x[m], at + 3 * (size_t)node[m], sizeof x[m]);
        cubic_gradients((const double(*)[3])x, J);
        return;
    }
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        double u[3];
        pal_cell_gauss_point(p, u);
        pal_cell_shape(n_node, u, NULL, g);
        pal_subdivision_solid_jacobian(at, node, n_node, g, J[p]);
    }
}

/* f = now rest^-1; returns det of rest */
static double deformation(const double now[9], const double rest[9], double f[9])
{
    double cofactor[9], det = pal_det3(rest);
    pal_cofactor3(rest, cofactor);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) f[3 * i + j] = pal_dot3(now + 3 * i, cofactor + 3 * j) / det;
    return det;
}

/* Q of F in the middle, from the rotation that the last force left; which is not moved */
static void middle_turn(const pal_cell_group *group, const double *d, const int32_t *node, int element,
                        double rotation[9])
{
    const size_t block = (size_t)(element / PAL_LANES), lane = (size_t)(element % PAL_LANES);
    double J[9], f[9], q[4];
    pal_subdivision_solid_jacobian(d, node, group->n_node, group->middle, J);
    for (int i = 0; i < 9; i++) {
        f[i] = 0;
        for (size_t k = 0; k < 3; k++)
            f[i] += J[3 * (i / 3) + (int)k] * group->frame[(block * 9 + 3 * k + (size_t)(i % 3)) * PAL_LANES + lane];
    }
    for (size_t i = 0; i < 4; i++) q[i] = group->q[(block * 4 + i) * PAL_LANES + lane];
    pal_polar_rotation(f, q, 200);
    pal_quat_matrix(q, rotation);
}

void pal_cells_elastic_points(const pal_cells_elastic *c, const double *d, pal_cell_kind kind, int element,
                              pal_cell_points *out)
{
    const int32_t *node = pal_subdivision_solid_nodes(c->solid, kind, element);
    const pal_cell_group *group = &c->group[kind];
    double now[PAL_CELL_GAUSS_POINTS][9], rest[PAL_CELL_GAUSS_POINTS][9];
    middle_turn(group, d, node, element, out->rotation);
    gradients(group->n_node, d, node, now);
    gradients(group->n_node, c->solid->node_rest, node, rest);
    for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
        double f[9], h[9], stress[9], at[3], mu, lambda, *e = out->strain[p];
        out->volume_m3[p] = pal_cell_gauss_point(p, at) * deformation(now[p], rest[p], f);
        out->det_f[p] = pal_det3(f);
        out->stretch[p] = pal_largest_strain(f);
        out->young_Pa[p] = (double)c->solid->samples[kind].young_Pa[PAL_CELL_GAUSS_POINTS * element + p];
        out->density_kg_m3[p] = (double)c->solid->samples[kind].density_kg_m3[PAL_CELL_GAUSS_POINTS * element + p];
        pal_elastic_mul(h, out->rotation, true, f);
        for (int i = 0; i < 9; i += 4) h[i] -= 1;
        e[0] = h[0], e[1] = h[4], e[2] = h[8];
        e[3] = 0.5 * (h[5] + h[7]), e[4] = 0.5 * (h[2] + h[6]), e[5] = 0.5 * (h[1] + h[3]);
        pal_cell_lame(c->solid, kind, element, p, &mu, &lambda);
        pal_linear_stress(mu, lambda, h, stress);
        out->von_mises_Pa[p] = pal_von_mises(stress);
        double trace = e[0] + e[1] + e[2], square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
        square += 2 * (e[3] * e[3] + e[4] * e[4] + e[5] * e[5]);
        out->energy_J_m3[p] = mu * square + 0.5 * lambda * trace * trace;
    }
}

void pal_cells_elastic_measure(const pal_cells_elastic *c, const double *d, pal_cell_value *value, double *sum,
                               double *volume_m3)
{
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        const int n_node = c->group[kind].n_node;
        pal_cell_shapes shapes;
        pal_cell_shapes_fill(kind, &shapes);
        for (int e = 0; e < c->group[kind].n; e++) {
            const int32_t *node = pal_subdivision_solid_nodes(c->solid, kind, e);
            pal_cell_points points;
            double share[PAL_CELL_MAX_NODES] = {0}, part[PAL_CELL_MAX_NODES] = {0};
            pal_cells_elastic_points(c, d, kind, e, &points);
            for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
                const double volume = points.volume_m3[p], of = value(&points, p) * volume;
                for (int m = 0; m < n_node; m++) share[m] += shapes.n[p][m] * volume, part[m] += shapes.n[p][m] * of;
            }
            for (int m = 0; m < n_node; m++) sum[node[m]] += part[m], volume_m3[node[m]] += share[m];
        }
    }
}
