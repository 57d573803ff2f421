/* Ground that voxel hexahedra stick to (pal_ground): the consistent penalty of a support on a surface through them,
 *     f_c = -sum_d k_cd (u_d - move),   k_cd = k int N_c N_d dS,
 * not lumped, since nodes off an inclined surface would then be held as if they lay on it (Zhu, Wang, Dai, Cai, Yu
 * 2000; Ruess, Schillinger, Bazilevs, Varduhn, Rank 2013, weakly enforced supports of the finite cell method). */
#include "server/sim/elements/elastic_hex.h"

/* of item i: corners c, d */
static double stiffness_of(const pal_ground *ground, int i, int c, int d)
{
    return ground->item[i].k_N_m[c <= d ? pal_hex_pair(c, d) : pal_hex_pair(d, c)];
}

void pal_hex_ground_add(const pal_elastic_hexes *cubes, double k, bool moved, const double *u, const double *rest,
                        double *out)
{
    const pal_ground *ground = cubes->ground;
    for (int i = 0; ground && i < ground->n; i++) {
        const int32_t *node = cubes->hexes->node + 8 * (size_t)ground->item[i].element;
        for (int d = 0; d < 8; d++)
            for (int j = 0; j < 3; j++) {
                const size_t at = 3 * (size_t)node[d] + (size_t)j;
                const double off = u[at] - (rest ? rest[at] : 0) - (moved ? ground->item[i].move_m[j] : 0);
                for (int c = 0; c < 8; c++)
                    out[3 * (size_t)node[c] + (size_t)j] += k * stiffness_of(ground, i, c, d) * off;
            }
    }
}

double pal_hex_ground_energy(const pal_elastic_hexes *cubes, const pal_body *body)
{
    const pal_ground *ground = cubes->ground;
    double sum = 0;
    for (int i = 0; ground && i < ground->n; i++) {
        const int32_t *node = cubes->hexes->node + 8 * (size_t)ground->item[i].element;
        double u[8][3];
        for (int c = 0; c < 24; c++) {
            const size_t at = 3 * (size_t)node[c / 3] + (size_t)(c % 3);
            u[c / 3][c % 3] = body->d[at] - body->node_rest[at] - ground->item[i].move_m[c % 3];
        }
        for (int c = 0; c < 8; c++)
            for (int d = 0; d < 8; d++)
                sum += stiffness_of(ground, i, c, d) * (u[c][0] * u[d][0] + u[c][1] * u[d][1] + u[c][2] * u[d][2]);
    }
    return 0.5 * sum;
}

void pal_hex_ground_bound(const pal_elastic_hexes *cubes, double *bound_N_m)
{
    const pal_ground *ground = cubes->ground;
    for (int i = 0; ground && i < ground->n; i++)
        for (int c = 0; c < 8; c++)
            for (int d = 0; d < 8; d++)
                bound_N_m[cubes->hexes->node[8 * ground->item[i].element + c]] += stiffness_of(ground, i, c, d);
}

void pal_hex_ground_assemble(const pal_elastic_hexes *cubes, double k, pal_block_matrix *to)
{
    const pal_ground *ground = cubes->ground;
    for (int i = 0; ground && i < ground->n; i++)
        for (int c = 0; c < 8; c++)
            for (int d = c; d < 8; d++) {
                const int32_t *node = cubes->hexes->node + 8 * (size_t)ground->item[i].element;
                bool transposed;
                double *value = pal_hex_block(to, node[c], node[d], &transposed);
                for (int j = 0; j < 9; j += 4) value[j] += k * ground->item[i].k_N_m[pal_hex_pair(c, d)];
            }
}

void pal_hex_ground_block(const pal_elastic_hexes *cubes, int e, double k, double to[24][24])
{
    const pal_ground *ground = cubes->ground;
    int low = 0, high = ground ? ground->n : 0;
    while (low < high) {
        const int middle = (low + high) / 2;
        if (ground->item[middle].element < e)
            low = middle + 1;
        else
            high = middle;
    }
    for (int i = low; ground && i < ground->n && ground->item[i].element == e; i++)
        for (int c = 0; c < 8; c++)
            for (int d = 0; d < 8; d++)
                for (int j = 0; j < 3; j++) to[3 * c + j][3 * d + j] += k * stiffness_of(ground, i, c, d);
}
