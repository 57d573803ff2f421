/* Linear and corotational voxel hexahedra: forces, energy, rotations, products with the tangent R K R'. The rest cube
 * is known (modes x, y, z of 4 h along their own axes), so that no rest positions are read.
 *
 * R is the polar part of F at the centre, which does not make the energy E = 1/2 (R'x - X) K (R'x - X) stationary when
 * the cube bends: -R K (R'x - X) alone is not its gradient and has a net torque of second order in the bending. What
 * is missing is added (rotation_force): with dE = t.w for a rotation w of R, t = -sum x_m cross g_m over the bending
 * modes (all modes where the weights of a cut voxel couple them), and (tr S I - S) w = axial(R' dF - dF' R), S =
 * sym(R'F), it is a skew pair of forces on the modes x, y, z. The forces are the gradient of E then and no body turns
 * itself. The tangent leaves it out. */
#include "server/sim/elements/elastic_hex_simd.h"

/* coefficients of 8 lanes from l on */
PAL_INLINE void load_stiff(const pal_elastic_hexes *cubes, int block, int l, double k, pal_wide stiff[3])
{
    stiff[0] = k * pal_wide_load(cubes->mu + PAL_LANES * block + l);
    stiff[1] = k * pal_wide_load(cubes->lambda + PAL_LANES * block + l);
    stiff[2] = cubes->beta[0] * stiff[0] + cubes->beta[1] * stiff[1];
}

/* g += the forces of the rotation's own change; x: coordinates in the frame of the cube, all but translation */
PAL_INLINE void rotation_force(bool cut, pal_wide x[3][8], pal_wide g[3][8])
{
    /* modes that are not in F at the centre, and those that are: without weights their forces commute with S */
    static const int modes[7] = {3, 5, 6, 7, 1, 2, 4};
    const pal_wide zero = {0};
    pal_wide t[3] = {zero, zero, zero}, f[9], c[6], trace, w[3];
    for (int n = 0; n < (cut ? 7 : 4); n++)
        for (int i = 0; i < 3; i++) {
            const int m = modes[n], j = (i + 1) % 3, k = (i + 2) % 3;
            t[i] += g[j][m] * x[k][m] - g[k][m] * x[j][m];
        }
    for (int i = 0; i < 9; i++) f[i] = x[i / 3][1 << i % 3];
    pal_wide det = pal_wide_spin_cofactors(f, c, &trace);
    /* omitted where the rotation is nearly undefined: collapsed and inverted cubes */
    pal_wide_mask good = (det > 1e-9 * (trace * trace * trace)) & (trace > 0);
    pal_wide_spin_solve(c, pal_wide_select(good, 1 + zero, zero) / pal_wide_select(good, det, 1 + zero), t, w);
    g[2][2] += w[0], g[1][4] -= w[0];
    g[0][4] += w[1], g[2][1] -= w[1];
    g[1][1] += w[2], g[0][2] -= w[2];
}

/* u becomes K u in modes */
PAL_INLINE void stress_block(const pal_elastic_hexes *cubes, int b, int l, bool cut, const pal_wide stiff[3],
                             pal_wide u[3][8])
{
    pal_wide weight[8];
    if (!cut) {
        hex_stress(stiff[0], stiff[1], stiff[2], cubes->twist, u);
        return;
    }
    pal_wide_load_n(cubes->weight + 8 * PAL_LANES * cubes->cut[b] + l, 8, weight);
    hex_cut_stress(stiff[0], stiff[1], stiff[2], cubes->twist, weight, u);
}

/* what is done with the blocks */
typedef struct pass {
    pal_elastic_hexes *cubes;
    pal_node_order *node_order;
    pal_element_run what;
    double k;
} pass;

/* of one block: forces are added, twice the energy of each lane is returned, with the sign of forces */
PAL_INLINE pal_wide run_block(const pass *p, int b, bool turned, bool cut, pal_element_run what)
{
    pal_elastic_hexes *cubes = p->cubes;
    pal_wide sum = {0};
    pal_block_view v;
    pal_block_open(&cubes->simd_blocks, p->node_order, b, 8, &v);
    for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
        pal_wide u[3][8], x[3][8], r[9], stiff[3], e = {0};
        hex_modes(&v, l, u);
        if (turned) {
            hex_turn_block(cubes, b, l, u, r);
            pal_wide_rotate(r, true, 1, 8, 8, u[0], u[0]);
        }
        memcpy(x, u, sizeof x);
        for (int i = 0; i < 3; i++) u[i][1 << i] -= 4 * cubes->edge_m;
        load_stiff(cubes, b, l, -1, stiff);
        stress_block(cubes, b, l, cut, stiff, u);
        for (int i = 0; i < 3 && (what & PAL_RUN_ENERGY); i++) {
            for (int m = 1; m < 8; m++) e += m == 1 << i ? (x[i][m] - 4 * cubes->edge_m) * u[i][m] : x[i][m] * u[i][m];
        }
        /* lanes without an element may read numbers that are not finite */
        if (what & PAL_RUN_ENERGY) sum += pal_wide_select(stiff[0] < 0, e, pal_wide_of(0));
        if (!(what & PAL_RUN_FORCE)) continue;
        if (turned) {
            rotation_force(cut, x, u);
            pal_wide_rotate(r, false, 1, 8, 8, u[0], u[0]);
        }
        hex_add(&v, l, u);
    }
    if (what & PAL_RUN_FORCE) pal_block_close(&cubes->simd_blocks, p->node_order, b, 8, &v);
    return sum;
}

PAL_INLINE void run_blocks(const pass *p, int part, bool turned, pal_element_run what)
{
    const pal_block_rounds *rounds = &p->cubes->rounds;
    pal_wide sum = {0};
    double all = 0;
    for (int i = rounds->first[part]; i < rounds->first[part + 1]; i++) {
        const int b = rounds->order[i];
        if (pal_hex_is_cut(p->cubes, b))
            sum += run_block(p, b, turned, true, what);
        else
            sum += run_block(p, b, turned, false, what);
    }
    for (int l = 0; l < PAL_WIDE; l++) all += sum[l];
    p->cubes->part_energy_J[part] = -0.5 * all;
}

PAL_INLINE void run_law(const pass *p, int part, bool turned)
{
    if (p->what == PAL_RUN_FORCE)
        run_blocks(p, part, turned, PAL_RUN_FORCE);
    else if (p->what == PAL_RUN_ENERGY)
        run_blocks(p, part, turned, PAL_RUN_ENERGY);
    else
        run_blocks(p, part, turned, PAL_RUN_BOTH);
}

static void run_part(void *user, int part)
{
    const pass *p = user;
    if (p->cubes->law != PAL_LAW_LINEAR)
        run_law(p, part, true);
    else
        run_law(p, part, false);
}

double pal_hex_corot_run(pal_elastic_hexes *cubes, pal_node_order *node_order, pal_element_run what)
{
    pass p = {.cubes = cubes, .node_order = node_order, .what = what};
    double sum_J = 0;
    cubes->turned = false;
    pal_block_rounds_run(&cubes->rounds, node_order->team, run_part, &p);
    for (int k = 0; k < cubes->rounds.part[cubes->rounds.n_round]; k++) sum_J += cubes->part_energy_J[k];
    return sum_J;
}

static void linearise_part(void *user, int part)
{
    const pass *p = user;
    pal_elastic_hexes *cubes = p->cubes;
    for (int i = cubes->rounds.first[part]; i < cubes->rounds.first[part + 1]; i++) {
        const int b = cubes->rounds.order[i];
        pal_block_view v;
        if (p->node_order) pal_block_open(&cubes->simd_blocks, p->node_order, b, 8, &v);
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            pal_wide u[3][8], r[9], q[4];
            if (p->node_order) {
                hex_modes(&v, l, u);
                hex_turn_block(cubes, b, l, u, r);
            } else {
                pal_wide_load_n(cubes->q + 4 * b * PAL_LANES + l, 4, q);
                pal_wide_rotation(q, r);
            }
            pal_wide_store_n(cubes->rotation + 9 * b * PAL_LANES + l, 9, r);
        }
    }
}

void pal_hex_corot_linearise(pal_elastic_hexes *cubes, pal_node_order *order, pal_team *team)
{
    pass p = {.cubes = cubes, .node_order = order};
    cubes->turned = cubes->turned && !order;
    if (cubes->law != PAL_LAW_LINEAR) pal_block_rounds_run(&cubes->rounds, team, linearise_part, &p);
}

PAL_INLINE void multiply_block(const pass *p, int b, bool turned, bool cut)
{
    const pal_elastic_hexes *cubes = p->cubes;
    pal_block_view v;
    pal_block_open(&cubes->simd_blocks, p->node_order, b, 8, &v);
    for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
        pal_wide u[3][8], r[9], stiff[3];
        hex_modes(&v, l, u);
        if (turned) pal_wide_load_n(cubes->rotation + 9 * b * PAL_LANES + l, 9, r);
        if (turned) pal_wide_rotate(r, true, 1, 8, 8, u[0], u[0]);
        load_stiff(cubes, b, l, p->k, stiff);
        stress_block(cubes, b, l, cut, stiff, u);
        if (turned) pal_wide_rotate(r, false, 1, 8, 8, u[0], u[0]);
        hex_add(&v, l, u);
    }
    pal_block_close(&cubes->simd_blocks, p->node_order, b, 8, &v);
}

PAL_INLINE void multiply_blocks(const pass *p, int part, bool turned)
{
    const pal_block_rounds *rounds = &p->cubes->rounds;
    for (int i = rounds->first[part]; i < rounds->first[part + 1]; i++)
        if (pal_hex_is_cut(p->cubes, rounds->order[i]))
            multiply_block(p, rounds->order[i], turned, true);
        else
            multiply_block(p, rounds->order[i], turned, false);
}

static void multiply_part(void *user, int part)
{
    const pass *p = user;
    if (p->cubes->law == PAL_LAW_LINEAR)
        multiply_blocks(p, part, false);
    else
        multiply_blocks(p, part, true);
}

void pal_hex_corot_multiply(pal_elastic_hexes *cubes, pal_node_order *node_order, double k)
{
    pass p = {.cubes = cubes, .node_order = node_order, .k = k};
    pal_block_rounds_run(&cubes->rounds, node_order->team, multiply_part, &p);
}

void pal_hex_corot_bound(const pal_elastic_hexes *cubes, double *bound_N_m)
{
    const double *stiff[2] = {cubes->recovery ? cubes->whole[0] : cubes->mu,
                              cubes->recovery ? cubes->whole[1] : cubes->lambda};
    for (int lane = 0; lane < PAL_LANES * cubes->n_block; lane++) {
        const int e = cubes->hex[lane], block = lane / PAL_LANES;
        if (e < 0) continue;
        double(*row)[2] =
            pal_hex_is_cut(cubes, block) ? cubes->row[PAL_LANES * cubes->cut[block] + lane % PAL_LANES] : NULL;
        for (int c = 0; c < 8; c++)
            bound_N_m[cubes->hexes->node[8 * e + c]] +=
                row ? stiff[0][lane] * row[c][0] + stiff[1][lane] * row[c][1] : cubes->bound[lane];
    }
}

/* K of the lanes in pairs of corners: column j of corner d after the other */
static void cut_pairs(const pal_elastic_hexes *cubes, int block, int l, const pal_wide stiff[3], pal_wide to[36][9])
{
    for (int d = 0; d < 8; d++)
        for (int j = 0; j < 3; j++) {
            pal_wide u[3][8] = {{{0}}};
            u[j][d] = pal_wide_of(1);
            for (int i = 0; i < 3; i++) walsh(u[i]);
            stress_block(cubes, block, l, true, stiff, u);
            for (int i = 0; i < 3; i++) unwalsh(u[i]);
            for (int c = 0; c <= d; c++)
                for (int i = 0; i < 3; i++) to[pal_hex_pair(c, d)][3 * i + j] = u[i][c];
        }
}

void pal_hex_corot_find_rows(pal_elastic_hexes *cubes)
{
    for (int block = 0; block < cubes->n_block; block++)
        for (int l = 0; l < PAL_LANES && pal_hex_is_cut(cubes, block); l += PAL_WIDE)
            for (int part = 0; part < 2; part++) {
                const pal_wide stiff[3] = {pal_wide_of(part == 0), pal_wide_of(part == 1),
                                           pal_wide_of(cubes->beta[part])};
                pal_wide k[36][9], size[36];
                cut_pairs(cubes, block, l, stiff, k);
                for (int p = 0; p < 36; p++) {
                    size[p] = pal_wide_of(0);
                    for (int i = 0; i < 9; i++) size[p] += k[p][i] * k[p][i];
                }
                for (int m = 0; m < PAL_WIDE; m++) {
                    double(*row)[2] = cubes->row[PAL_LANES * cubes->cut[block] + l + m];
                    for (int c = 0; c < 8; c++) {
                        row[c][part] = 0;
                        for (int d = 0; d < 8; d++)
                            row[c][part] += sqrt(size[c <= d ? pal_hex_pair(c, d) : pal_hex_pair(d, c)][m]);
                    }
                }
            }
}

void pal_hex_matrix(const pal_elastic_hexes *cubes, int lane, double mu, double lambda, double to[36][9])
{
    const int block = lane / PAL_LANES, l = lane % PAL_LANES / PAL_WIDE * PAL_WIDE;
    const double part[3] = {mu, lambda, cubes->beta[0] * mu + cubes->beta[1] * lambda};
    if (pal_hex_is_cut(cubes, block)) {
        pal_wide stiff[3], all[36][9];
        for (int i = 0; i < 3; i++) stiff[i] = pal_wide_of(part[i]);
        cut_pairs(cubes, block, l, stiff, all);
        for (int i = 0; i < 36 * 9; i++) to[i / 9][i % 9] = all[i / 9][i % 9][lane % PAL_LANES - l];
        return;
    }
    for (int p = 0; p < 36; p++)
        for (int i = 0; i < 9; i++) to[p][i] = mu * cubes->reference[p][0][i] + lambda * cubes->reference[p][1][i];
}

void pal_hex_corot_blocks(const pal_elastic_hexes *cubes, int block, double k, double *to)
{
    for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
        pal_wide stiff[3], r[9], pairs[36][9];
        const bool cut = pal_hex_is_cut(cubes, block);
        load_stiff(cubes, block, l, k, stiff);
        pal_wide_load_n(cubes->rotation + 9 * block * PAL_LANES + l, 9, r);
        if (cut) cut_pairs(cubes, block, l, stiff, pairs);
        for (int p = 0; p < 36; p++) {
            pal_wide a[9], t[9];
            for (int i = 0; i < 9; i++)
                a[i] = cut ? pairs[p][i] : stiff[0] * cubes->reference[p][0][i] + stiff[1] * cubes->reference[p][1][i];
            pal_wide_mul(t, r, a);
            pal_wide_mult(a, t, r);
            pal_wide_store_n(to + 9 * p * PAL_LANES + l, 9, a);
        }
    }
}

/* K for mu = 1 and for lambda = 1, times 16 / h, in pairs of corners */
void pal_hex_fill_reference(pal_elastic_hexes *cubes)
{
    for (int part = 0; part < 2; part++)
        for (int d = 0; d < 8; d++)
            for (int j = 0; j < 3; j++) {
                pal_wide u[3][8] = {{{0}}};
                u[j][d] = pal_wide_of(1);
                for (int i = 0; i < 3; i++) walsh(u[i]);
                hex_stress(pal_wide_of(part == 0), pal_wide_of(part == 1), pal_wide_of(cubes->beta[part]), cubes->twist,
                           u);
                for (int i = 0; i < 3; i++) unwalsh(u[i]);
                for (int c = 0; c <= d; c++)
                    for (int i = 0; i < 3; i++) cubes->reference[pal_hex_pair(c, d)][part][3 * i + j] = u[i][c][0];
            }
}
