/* Elements of subdivided solids in their own frames: forces, energy, and products with the tangent Q K Q'. */
#include "server/sim/cell_lanes.h"

enum { FORCE = 1, ENERGY = 2, LINEARISE = 4 };

/* g (world axes, forces with Q held) += what the turning of Q adds */
PAL_INLINE void add_turn(const pal_cell_group *group, int block, int lane, int n_node, const pal_wide r[9],
                         const pal_wide s[9], pal_wide (*y)[PAL_CELL_NODES_MOST], pal_wide (*g)[PAL_CELL_NODES_MOST])
{
    const pal_wide zero = {0};
    pal_wide world[3] = {zero, zero, zero}, t[3], frame[9], w[9];
    for (int m = 0; m < n_node; m++) {
        world[0] += g[1][m] * y[2][m] - g[2][m] * y[1][m];
        world[1] += g[2][m] * y[0][m] - g[0][m] * y[2][m];
        world[2] += g[0][m] * y[1][m] - g[1][m] * y[0][m];
    }
    for (int i = 0; i < 3; i++) t[i] = r[i] * world[0] + r[3 + i] * world[1] + r[6 + i] * world[2];
    cell_load(group->frame + (size_t)block * 9 * PAL_LANES + lane, 9, frame);
    cell_turn_stress(r, s, t, frame, w);
    for (int m = 0; m < n_node; m++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) g[i][m] += w[3 * i + j] * group->middle[m][j];
}

/* one half of a block */
PAL_INLINE double half_block(pal_cells_elastic *c, pal_cell_group *group, int n_node, int what, int block, int lane,
                             const double *d, double *f)
{
    const int n_live = cell_live(group, block, lane);
    const int32_t *node = group->node + (size_t)block * (size_t)n_node * PAL_LANES + lane;
    pal_wide y[3][PAL_CELL_NODES_MOST], u[3][PAL_CELL_NODES_MOST], r[9], s[9], energy = {0};
    if (n_live == 0) return 0;
    cell_gather(node, n_node, d, y);
    cell_rotation(group, block, lane, y, n_node, r, s);
    if (what & LINEARISE)
        for (int i = 0; i < 9; i++) pal_wide_store(group->turn + ((size_t)block * 9 + i) * PAL_LANES + lane, r[i]);
    if (!(what & (FORCE | ENERGY))) return 0;
    cell_unturn(r, n_node, y, u);
    cell_minus_rest(group->rest + (size_t)block * (size_t)n_node * 3 * PAL_LANES + lane, n_node, u);
    cell_stiffness(&c->line, group, block, lane, n_node, u, what & ENERGY ? &energy : NULL);
    double sum = what & ENERGY ? cell_sum(energy, n_live) : 0;
    if (!(what & FORCE)) return sum;
    pal_wide minus[9];
    for (int i = 0; i < 9; i++) minus[i] = -r[i];
    cell_turn(minus, n_node, u, u);
    add_turn(group, block, lane, n_node, r, s, y, u);
    cell_scatter(node, n_node, n_live, u, f);
    return sum;
}

PAL_INLINE double all_blocks(pal_cells_elastic *c, pal_cell_kind kind, int n_node, int what, const double *d, double *f)
{
    pal_cell_group *group = &c->group[kind];
    double sum = 0;
    group->n_slow = 0;
    for (int b = 0; b < group->n_block; b++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) sum += half_block(c, group, n_node, what, b, l, d, f);
    return sum;
}

void pal_cells_elastic_force(pal_cells_elastic *c, const double *d, double *f)
{
    if (c->op == PAL_CELL_EDGES) {
        pal_cells_edges_force(c, d, f);
        return;
    }
    all_blocks(c, PAL_CELL_CUBIC, 64, FORCE, d, f);
    all_blocks(c, PAL_CELL_HEX, 8, FORCE, d, f);
    all_blocks(c, PAL_CELL_PYRAMID, 5, FORCE, d, f);
}

PAL_INLINE double all_kinds(pal_cells_elastic *c, int what, const double *d, double *f)
{
    return all_blocks(c, PAL_CELL_CUBIC, 64, what, d, f) + all_blocks(c, PAL_CELL_HEX, 8, what, d, f) +
           all_blocks(c, PAL_CELL_PYRAMID, 5, what, d, f);
}

double pal_cells_elastic_energy(pal_cells_elastic *c, const double *d, double *f)
{
    if (c->op == PAL_CELL_EDGES) return pal_cells_edges_energy(c, d);
    return f ? all_kinds(c, FORCE | ENERGY, d, f) : all_kinds(c, ENERGY, d, NULL);
}

void pal_cells_elastic_linearise(pal_cells_elastic *c, const double *d)
{
    all_blocks(c, PAL_CELL_CUBIC, 64, LINEARISE, d, NULL);
    all_blocks(c, PAL_CELL_HEX, 8, LINEARISE, d, NULL);
    all_blocks(c, PAL_CELL_PYRAMID, 5, LINEARISE, d, NULL);
}

PAL_INLINE void multiply_all(const pal_cells_elastic *c, pal_cell_kind kind, int n_node, double k, const double *p,
                             double *out)
{
    const pal_cell_group *group = &c->group[kind];
    for (int b = 0; b < group->n_block; b++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            const int n_live = cell_live(group, b, l);
            const int32_t *node = group->node + (size_t)b * (size_t)n_node * PAL_LANES + l;
            pal_wide u[3][PAL_CELL_NODES_MOST], r[9];
            if (n_live == 0) continue;
            cell_gather(node, n_node, p, u);
            cell_load(group->turn + (size_t)b * 9 * PAL_LANES + l, 9, r);
            cell_unturn(r, n_node, u, u);
            cell_stiffness(&c->line, group, b, l, n_node, u, NULL);
            for (int i = 0; i < 9; i++) r[i] *= k;
            cell_turn(r, n_node, u, u);
            cell_scatter(node, n_node, n_live, u, out);
        }
}

void pal_cells_elastic_multiply(const pal_cells_elastic *c, double k, const double *p, double *out)
{
    multiply_all(c, PAL_CELL_CUBIC, 64, k, p, out);
    multiply_all(c, PAL_CELL_HEX, 8, k, p, out);
    multiply_all(c, PAL_CELL_PYRAMID, 5, k, p, out);
}

void pal_cells_elastic_rotate(const pal_cells_elastic *c, double *turn)
{
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        const pal_cell_group *group = &c->group[kind];
        double n[PAL_CELL_NODES_MOST], middle[3] = {0.5, 0.5, 0.5}, r[9];
        pal_cell_shape(group->n_node, middle, n, NULL);
        for (int e = 0; e < group->n; e++) {
            const int b = e / PAL_LANES, l = e % PAL_LANES;
            const int32_t *node = group->node + (size_t)b * (size_t)group->n_node * PAL_LANES + l;
            for (int i = 0; i < 9; i++) r[i] = group->turn[((size_t)b * 9 + i) * PAL_LANES + l];
            for (int m = 0; m < group->n_node; m++) {
                double share = n[m] * group->volume[b * PAL_LANES + l];
                for (int i = 0; i < 9; i++) turn[9 * (size_t)node[m * PAL_LANES] + i] += share * r[i];
            }
        }
    }
}
