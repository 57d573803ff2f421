/* Neo-Hookean voxel hexahedra at 2x2x2 Gauss points, in the stable form of Smith, de Goes, Kim 2018 (elastic_law.h).
 *
 * hex8: W(F) with k1 = lambda + mu at each point. hex8_bbar: the volume part works on the mean dilatation,
 *     V (<mu/2 (F:F - 3) - mu (J - 1) + (mu/3)/2 (J - 1)^2> + kappa/2 (Jm - 1)^2),  Jm = <J>,  kappa = lambda + 2 mu/3,
 * Jm the cube's volume now over that at rest (2x2x2 points integrate it exactly); its linearisation is the B-bar
 * element of linear elasticity. The tangent is the sum of the points' Hessians, each projected to positive
 * semi-definite with the mean's pressure kappa (Jm - 1) in it, and of the mean's own rank one kappa V grad Jm grad Jm'.
 *
 * Everything is in modes (elastic_hex_simd.h): F_ij at xi = sum over modes m with j of a_im xi^(m without
 * j), a = U / (4 h), so that sums over the points are Walsh transforms over their signs, and K of a cube is made from
 * the transform of the points' Hessians: K_(i,m)(k,n) = V sum_{j in m, l in n} H_ij,kl^ (m without j XOR n without l)
 * g^(|m| + |n| - 2) with g = 1/sqrt 3, where an axis in both exponents gives 1. 21 unknowns (translations are left
 * out), 231 numbers. The points of cut voxels have weights (elastic_hex.h) in the means and in the sums. */
#include "server/base/vec3.h"
#include "server/sim/elements/elastic_hex_simd.h"

/* mu, k1 and kappa of the mean dilatation, times share and h / 16 */
PAL_INLINE void load_neo(const pal_elastic_hexes *cubes, int block, int l, pal_wide *mu, pal_wide *k1, pal_wide *kappa)
{
    pal_wide lambda = pal_wide_load(cubes->lambda + PAL_LANES * block + l);
    *mu = pal_wide_load(cubes->mu + PAL_LANES * block + l);
    if (cubes->element == PAL_HEX_BBAR)
        *k1 = *mu * (1.0 / 3), *kappa = lambda + *mu * (2.0 / 3);
    else
        *k1 = lambda + *mu, *kappa = pal_wide_of(0);
}

/* 8 times the weights of the points of a block with cut voxels */
PAL_INLINE void load_weights(const pal_elastic_hexes *cubes, int block, int l, pal_wide weight[8])
{
    pal_wide_load_n(cubes->weight + 8 * PAL_LANES * cubes->cut[block] + l, 8, weight);
    for (int p = 0; p < 8; p++) weight[p] *= 8;
}

/* volume now over that at rest, - 1; weight: times 8, NULL: 1 */
PAL_INLINE pal_wide mean_dilatation(const pal_wide *weight, pal_wide f[8][9])
{
    pal_wide sum = pal_wide_of(-8), c[9];
    for (int p = 0; p < 8; p++) sum += weight ? weight[p] * pal_wide_cofactors(f[p], c) : pal_wide_cofactors(f[p], c);
    return 0.125 * sum;
}

/* of one block: forces are added, the energy of each lane is returned over 16 h^2 */
PAL_INLINE pal_wide run_block(const pal_elastic_hexes *cubes, pal_node_order *node_order, int b, bool cut,
                              pal_element_run what)
{
    pal_wide sum = {0};
    pal_block_view v;
    pal_block_open(&cubes->simd_blocks, node_order, b, 8, &v);
    for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
        pal_wide u[3][8], f[8][9], c[9], mu, k1, kappa, weight[8], e = {0};
        load_neo(cubes, b, l, &mu, &k1, &kappa);
        if (cut) load_weights(cubes, b, l, weight);
        hex_modes(&v, l, u);
        hex_gradients(1 / (4 * cubes->edge_m), u, f);
        pal_wide mean = mean_dilatation(cut ? weight : NULL, f), pressure = kappa * mean - mu - k1;
        for (int p = 0; p < 8; p++) {
            pal_wide det = pal_wide_cofactors(f[p], c), j1 = det - 1, square = pal_wide_of(-3), t = det * k1 + pressure,
                     scale = mu, energy;
            for (int i = 0; i < 9 && (what & PAL_RUN_ENERGY); i++) square += f[p][i] * f[p][i];
            if (what & PAL_RUN_ENERGY) {
                energy = 0.5 * mu * square - mu * j1 + 0.5 * k1 * j1 * j1;
                e += cut ? weight[p] * energy : energy;
            }
            if (cut) scale *= weight[p], t *= weight[p];
            for (int i = 0; i < 9 && (what & PAL_RUN_FORCE); i++) f[p][i] = scale * f[p][i] + t * c[i];
        }
        e = 0.125 * e + 0.5 * kappa * mean * mean;
        if (what & PAL_RUN_ENERGY) sum += pal_wide_select(mu > 0, e, pal_wide_of(0));
        if (!(what & PAL_RUN_FORCE)) continue;
        hex_sums(-0.5 * cubes->edge_m, f, u);
        hex_add(&v, l, u);
    }
    if (what & PAL_RUN_FORCE) pal_block_close(&cubes->simd_blocks, node_order, b, 8, &v);
    return sum;
}

/* forces are added, the energy is returned */
PAL_INLINE double all_blocks(const pal_elastic_hexes *cubes, pal_node_order *node_order, pal_element_run what)
{
    pal_wide sum = {0};
    for (int b = 0; b < cubes->n_block; b++)
        sum += pal_hex_is_cut(cubes, b) ? run_block(cubes, node_order, b, true, what)
                                        : run_block(cubes, node_order, b, false, what);
    double all = 0;
    for (int l = 0; l < PAL_WIDE; l++) all += sum[l];
    return 16 * cubes->edge_m * cubes->edge_m * all;
}

double pal_hex_neo_run(pal_elastic_hexes *cubes, pal_node_order *node_order, pal_element_run what)
{
    return what == PAL_RUN_FORCE    ? all_blocks(cubes, node_order, PAL_RUN_FORCE)
           : what == PAL_RUN_ENERGY ? all_blocks(cubes, node_order, PAL_RUN_ENERGY)
                                    : all_blocks(cubes, node_order, PAL_RUN_BOTH);
}

/* place of (r, s), r >= s, in the packed K; unknown 7 axis + mode - 1 */
PAL_INLINE int packed(int r, int s)
{
    return r * (r + 1) / 2 + s;
}

/* K in modes from the transforms of the points' Hessians h [45][8] (packed over entries of F) and the mean's gradient
 */
PAL_INLINE void store_tangent(double *to, pal_wide h[45][8], pal_wide kappa, pal_wide mean[3][8])
{
    const double gauss = sqrt(1.0 / 3);
    const double power[5] = {0.125, 0.125 * gauss, 0.125 / 3, 0.125 / 3 * gauss, 0.125 / 9};
    /* the axes of each mode */
    static const int size_of[8] = {0, 1, 1, 2, 1, 2, 2, 3};
    static const int axis_of[8][3] = {{0}, {0}, {1}, {0, 1}, {2}, {0, 2}, {1, 2}, {0, 1, 2}};
    for (int r = 0; r < 21; r++) {
        const int i = r / 7, m = r % 7 + 1;
        const pal_wide own = kappa * mean[i][m];
        for (int s = 0; s <= r; s++) {
            const int k = s / 7, n = s % 7 + 1;
            pal_wide sum = pal_wide_of(0);
            for (int a = 0; a < size_of[m]; a++)
                for (int b = 0; b < size_of[n]; b++) {
                    const int j = axis_of[m][a], q = axis_of[n][b], x = 3 * i + j, y = 3 * k + q;
                    sum += h[x >= y ? packed(x, y) : packed(y, x)][m ^ 1 << j ^ n ^ 1 << q];
                }
            pal_wide_store(to + packed(r, s) * PAL_LANES, power[size_of[m] + size_of[n] - 2] * sum + own * mean[k][n]);
        }
    }
}

/* h += weight e e', packed */
PAL_INLINE void add_mode(pal_wide h[45], pal_wide weight, const pal_wide e[9])
{
    for (int i = 0; i < 9; i++) {
        pal_wide t = weight * e[i];
        for (int j = 0; j <= i; j++) h[packed(i, j)] += t * e[j];
    }
}

/* mu I + c d2J/dF2 + k1 g g', packed; g = dJ/dF. d2J/dF_ij dF_kl = +- F_mn for the rows i k m and the columns j l n in
 * cyclic order or not */
PAL_INLINE void plain_hessian(pal_wide mu, pal_wide c, pal_wide k1, const pal_wide f[9], const pal_wide g[9],
                              pal_wide h[45])
{
    for (int x = 0; x < 9; x++) {
        pal_wide t = k1 * g[x];
        for (int y = 0; y <= x; y++) h[packed(x, y)] = t * g[y];
        h[packed(x, x)] += mu;
    }
    for (int m = 0; m < 3; m++)
        for (int n = 0; n < 3; n++) {
            const int i = m == 2 ? 1 : 2, k = m == 0 ? 1 : 0, j = (n + 1) % 3, l = (n + 2) % 3;
            /* rows i > k: i k m is cyclic for m = 1 only */
            pal_wide t = c * f[3 * m + n];
            if (m != 1) t = -t;
            h[packed(3 * i + j, 3 * k + l)] += t;
            h[packed(3 * i + l, 3 * k + j)] -= t;
        }
}

/* the matrix that raises negative eigenvalues of the 3x3 matrix on the stretches to 0; s: singular values */
static void raise_stretches(pal_wide mu, pal_wide c, pal_wide k1, const pal_wide s[3], const pal_wide u[9],
                            const pal_wide v[9], pal_wide h[45])
{
    pal_wide g[3] = {s[1] * s[2], s[0] * s[2], s[0] * s[1]}, a[6], n[9], e[9];
    for (int i = 0; i < 3; i++) {
        a[i] = mu + k1 * g[i] * g[i];
        a[3 + i] = c * s[i] + k1 * g[(i + 1) % 3] * g[(i + 2) % 3];
    }
    pal_wide min = 1e-13 * (a[0] + a[1] + a[2]), x = a[0] + min, y = a[1] + min, z = a[2] + min;
    pal_wide minor = x * y - a[5] * a[5];
    pal_wide det = z * minor - x * a[3] * a[3] - y * a[4] * a[4] + 2 * a[3] * a[4] * a[5];
    if (!pal_wide_any(~((minor > 0) & (det > 0)))) return;
    pal_wide_jacobi(a, n);
    for (int k = 0; k < 3; k++) {
        if (!pal_wide_any(a[k] < 0)) continue;
        for (int i = 0; i < 9; i++) {
            e[i] = pal_wide_of(0);
            for (int m = 0; m < 3; m++) e[i] += n[3 * m + k] * u[3 * (i / 3) + m] * v[3 * (i % 3) + m];
        }
        add_mode(h, pal_wide_select(a[k] < 0, -a[k], pal_wide_of(0)), e);
    }
}

/* the Hessian of one point, projected to positive semi-definite: F = R S, S = v
 * diag(s) v', u = R v; the eigenvalues are those of the stretches and mu + c s_k (twist), mu - c s_k (flip) of the
 * pairs. r: in, a rotation that makes R'F symmetric */
PAL_INLINE void point_hessian(pal_wide mu, pal_wide c, pal_wide k1, const pal_wide f[9], const pal_wide g[9],
                              const pal_wide r[9], pal_wide h[45])
{
    static const int row_of[6] = {0, 1, 2, 1, 0, 0}, column_of[6] = {0, 1, 2, 2, 2, 1};
    pal_wide a[6], v[9], u[9], e[9];
    plain_hessian(mu, c, k1, f, g, h);
    for (int n = 0; n < 6; n++) {
        const int i = row_of[n], j = column_of[n];
        a[n] = r[i] * f[j] + r[3 + i] * f[3 + j] + r[6 + i] * f[6 + j];
    }
    pal_wide_jacobi(a, v);
    pal_wide_mul(u, r, v);
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        pal_wide twist = mu + c * a[k], flip = mu - c * a[k];
        for (int sign = -1; sign <= 1; sign += 2) {
            pal_wide value = sign < 0 ? twist : flip;
            if (!pal_wide_any(value < 0)) continue;
            for (int n = 0; n < 9; n++)
                e[n] = u[n / 3 * 3 + i] * v[n % 3 * 3 + j] + sign * u[n / 3 * 3 + j] * v[n % 3 * 3 + i];
            add_mode(h, pal_wide_select(value < 0, -0.5 * value, pal_wide_of(0)), e);
        }
    }
    raise_stretches(mu, c, k1, a, u, v, h);
}

/* projected Hessians of all points into h [45][point], the mean's gradient into mean */
static void all_hessians(const pal_elastic_hexes *cubes, int block, int l, const pal_wide q0[4], pal_wide f[8][9],
                         pal_wide h[45][8], pal_wide mean[3][8])
{
    const bool cut = pal_hex_is_cut(cubes, block);
    pal_wide mu, k1, kappa, g[8][9], q[4], r[9], m[9], one[45], weight[8];
    load_neo(cubes, block, l, &mu, &k1, &kappa);
    if (cut) load_weights(cubes, block, l, weight);
    pal_wide pressure = kappa * mean_dilatation(cut ? weight : NULL, f) - mu - k1;
    for (int p = 0; p < 8; p++) {
        pal_wide c = pal_wide_cofactors(f[p], g[p]) * k1 + pressure;
        memcpy(q, q0, sizeof q);
        pal_wide_polar(f[p], mu > 0, q, r, m);
        point_hessian(mu, c, k1, f[p], g[p], r, one);
        for (int i = 0; i < 45; i++) h[i][p] = cut ? weight[p] * one[i] : one[i];
        for (int i = 0; i < 9 && cut; i++) g[p][i] *= weight[p];
    }
    hex_sums(0.125, g, mean);
}

void pal_hex_neo_linearise(pal_elastic_hexes *cubes, pal_node_order *node_order)
{
    for (int b = 0; b < cubes->n_block && cubes->tangent; b++) {
        pal_block_view v;
        pal_block_open(&cubes->simd_blocks, node_order, b, 8, &v);
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            pal_wide u[3][8], f[8][9], r[9], q[4], mu, k1, kappa, h[45][8];
            hex_modes(&v, l, u);
            hex_turn_block(cubes, b, l, u, r);
            pal_wide_store_n(cubes->rotation + 9 * b * PAL_LANES + l, 9, r);
            pal_wide_load_n(cubes->q + 4 * b * PAL_LANES + l, 4, q);
            hex_gradients(1 / (4 * cubes->edge_m), u, f);
            load_neo(cubes, b, l, &mu, &k1, &kappa);
            /* lanes without an element may read anything */
            for (int i = 0; i < 72; i++)
                f[i / 9][i % 9] = pal_wide_select(mu > 0, f[i / 9][i % 9], pal_wide_of(i % 9 % 4 == 0));
            all_hessians(cubes, b, l, q, f, h, u);
            for (int i = 0; i < 45; i++) walsh(h[i]);
            store_tangent(cubes->tangent + 231 * PAL_LANES * b + l, h, kappa, u);
        }
    }
}

void pal_hex_neo_multiply(const pal_elastic_hexes *cubes, pal_node_order *node_order, double k)
{
    for (int b = 0; b < cubes->n_block && cubes->tangent; b++) {
        pal_block_view v;
        pal_block_open(&cubes->simd_blocks, node_order, b, 8, &v);
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            const double *a = cubes->tangent + 231 * PAL_LANES * b + l;
            pal_wide u[3][8], x[21], y[21];
            hex_modes(&v, l, u);
            for (int r = 0; r < 21; r++) x[r] = k * u[r / 7][r % 7 + 1];
            for (int r = 0; r < 21; r++) {
                pal_wide sum = pal_wide_load(a + packed(r, r) * PAL_LANES) * x[r];
                for (int s = 0; s < r; s++) {
                    pal_wide k_rs = pal_wide_load(a + packed(r, s) * PAL_LANES);
                    sum += k_rs * x[s];
                    y[s] += k_rs * x[r];
                }
                y[r] = sum;
            }
            for (int r = 0; r < 21; r++) u[r / 7][r % 7 + 1] = y[r];
            hex_add(&v, l, u);
        }
        pal_block_close(&cubes->simd_blocks, node_order, b, 8, &v);
    }
}

void pal_hex_neo_blocks(const pal_elastic_hexes *cubes, int block, double k, double *to)
{
    for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
        const double *a = cubes->tangent + 231 * PAL_LANES * block + l;
        for (int i = 0; i < 3; i++)
            for (int j = 0; j <= i; j++) {
                pal_wide t[8][8], column[8];
                for (int m = 1; m < 8; m++) {
                    for (int n = 1; n < 8; n++) {
                        int r = 7 * i + m - 1, s = 7 * j + n - 1;
                        t[m][n] = k * pal_wide_load(a + (r >= s ? packed(r, s) : packed(s, r)) * PAL_LANES);
                    }
                    unwalsh(t[m]);
                }
                for (int d = 0; d < 8; d++) {
                    for (int m = 1; m < 8; m++) column[m] = t[m][d];
                    unwalsh(column);
                    for (int c = 0; c < 8; c++) {
                        /* K_cd(i, j) here, and K_dc(j, i) is the same number */
                        int pair = c <= d ? pal_hex_pair(c, d) : pal_hex_pair(d, c);
                        if (c <= d) pal_wide_store(to + (9 * pair + 3 * i + j) * PAL_LANES + l, column[c]);
                        if (c >= d) pal_wide_store(to + (9 * pair + 3 * j + i) * PAL_LANES + l, column[c]);
                    }
                }
            }
    }
}

/* The largest eigenvalue of a cube's K is at most that of V/8 sum B'B, h / 2, times the largest |H| of its points, and
 * what the mean's rank one adds, kappa V |grad Jm|^2. |H| <= mu + 2/sqrt 3 |c| |F| + k1 |dJ/dF|^2, c the factor of
 * d2J/dF2. The corners of a cut cube differ too much for one number: the sum of |K| over a corner's row is at most
 * V sum p_q |H_q| |grad N_c| sum_d |grad N_d|, and kappa V |grad_c Jm| sum_d |grad_d Jm| */
typedef struct bounds {
    const double (*grad)[8][3]; /* of the shape functions at the points, times h / 2 */
    double weight[8];           /* of the points, sum 1 */
    double hessian[8];          /* |H| of the points    */
    double mean[24], kappa;     /* grad Jm times h / 2  */
} bounds;

static void find_bounds(const pal_elastic_hexes *cubes, int lane, double f[8][9], bounds *b)
{
    const double mu = cubes->mu[lane], lambda = cubes->lambda[lane];
    const bool bbar = cubes->element == PAL_HEX_BBAR;
    const double k1 = bbar ? mu / 3 : lambda + mu;
    double cof[8][9], dilatation = -1;
    b->kappa = bbar ? lambda + 2 * mu / 3 : 0;
    pal_hex_weights(cubes, lane, b->weight);
    memset(b->mean, 0, sizeof b->mean);
    for (int p = 0; p < 8; p++) {
        pal_cofactor3(f[p], cof[p]);
        dilatation += b->weight[p] * pal_det3(f[p]);
        for (int i = 0; i < 72; i++)
            b->mean[i / 3] += b->weight[p] * cof[p][i / 3 % 3 * 3 + i % 3] * b->grad[p][i / 9][i % 3];
    }
    for (int p = 0; p < 8; p++) {
        double f2 = 0, c2 = 0, c = -mu + k1 * (pal_det3(f[p]) - 1) + b->kappa * dilatation;
        for (int i = 0; i < 9; i++) f2 += f[p][i] * f[p][i], c2 += cof[p][i] * cof[p][i];
        b->hessian[p] = mu + 2 / sqrt(3) * fabs(c) * sqrt(f2) + k1 * c2;
    }
}

/* the constants have h / 16, gradients here lack 2 / h */
static double largest_eigenvalue(const bounds *b)
{
    double max = 0, square = 0;
    for (int i = 0; i < 24; i++) square += b->mean[i] * b->mean[i];
    for (int p = 0; p < 8; p++) max = fmax(max, b->hessian[p]);
    return 8 * max + 64 * b->kappa * square;
}

static double row_of(const bounds *b, int corner)
{
    double sum = 0, all = 0;
    for (int p = 0; p < 8; p++) {
        double rest = 0;
        for (int c = 0; c < 8; c++) rest += pal_norm3(b->grad[p][c]);
        sum += b->weight[p] * b->hessian[p] * pal_norm3(b->grad[p][corner]) * rest;
    }
    for (int c = 0; c < 8; c++) all += pal_norm3(b->mean + 3 * c);
    return 64 * (sum + b->kappa * pal_norm3(b->mean + 3 * corner) * all);
}

void pal_hex_neo_bound(pal_elastic_hexes *cubes, const pal_body *body, double *bound_N_m)
{
    double grad[8][8][3];
    bounds b = {.grad = (const double(*)[8][3])grad};
    for (int p = 0; p < 8; p++) pal_hex_shape(pal_hex_gauss[p], NULL, grad[p]);
    for (int e = 0; e < cubes->n_hex; e++) {
        const int32_t *node = cubes->hexes->node + 8 * e;
        const int lane = cubes->simd_blocks.place[e];
        double f[8][9] = {{0}};
        for (int p = 0; p < 8; p++)
            for (int c = 0; c < 8; c++)
                for (int i = 0; i < 9; i++)
                    f[p][i] += 2 / cubes->edge_m * body->d[3 * node[c] + i / 3] * grad[p][c][i % 3];
        find_bounds(cubes, lane, f, &b);
        const double max = largest_eigenvalue(&b);
        const bool cut = pal_hex_is_cut(cubes, lane / PAL_LANES);
        for (int c = 0; c < 8; c++) bound_N_m[node[c]] += cut ? row_of(&b, c) : max;
    }
}
