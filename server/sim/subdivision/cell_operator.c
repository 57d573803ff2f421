/* The operator R of paper A section 3.2.2: relative displacements of an element's nodes from changes of edge lengths
 * and of angles between edges, with the errata of the room's README:
 *   - lengths change along the current edge (A8): e = (l - l0) s / l, s from the edge's first node to its second;
 *   - at the corner of edges s1, s2 with the angle theta, delta = theta - theta0, s1 turned by +delta/2 and s2 by
 *     -delta/2 about s1 x s2 are the unsheared a', b'; what counts is a - a' and b - b' (A7). Half a turn of delta
 *     needs no arc: cos and sin of delta follow from those of both angles, which are exact up to 180 degrees;
 *   - each edge has the mean of its corners in each of its two planes, and the sum is shared between its ends (A5): for
 *     a hexahedron that is the paper's sum with the factor 1/2, but for moves of a whole edge where the angles at its
 *     ends differ;
 *   - on the 4 x 4 x 4 lattice the edges' vectors are summed along lattice lines, from each line's middle (A6).
 * A pyramid is a hexahedron of which corners 4 to 7 are one: corners there have no angles, and the apex takes the mean
 * of the four. An apex drawn out counts for two thirds of that.
 * s1 x s2 below 1e-8 |s1| |s2| (an angle of 0 or 180 degrees) gives no axis: that of rest is taken, turned by the
 * element's last rotation Q. The sum is brought into the axes Q, and forces f = Q K Q' R d back; they have no net
 * force, but a net torque, and no energy. */
#include "server/sim/subdivision/cell_simd.h"

/* relative vectors of the lattice's edges, at their first node [direction][node][component] */
typedef struct edge_vectors {
    pal_wide at[3][PAL_CELL_MAX_NODES][3];
} edge_vectors;

/* the lattice: nodes a side, steps between neighbours along u, v, w, whether corners above w = 0 are one */
typedef struct lattice {
    int n, step[3];
    bool apex;
} lattice;

PAL_INLINE void from_to(pal_wide (*x)[PAL_CELL_MAX_NODES], int a, int b, pal_wide s[3])
{
    for (int i = 0; i < 3; i++) s[i] = x[i][b] - x[i][a];
}
PAL_INLINE void cross(const pal_wide a[3], const pal_wide b[3], pal_wide c[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1], c[1] = a[2] * b[0] - a[0] * b[2], c[2] = a[0] * b[1] - a[1] * b[0];
}
PAL_INLINE pal_wide dot(const pal_wide a[3], const pal_wide b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
/* a - a' and b - b' at node `at` of ends a and b; x now, y at rest */
PAL_INLINE void corner(pal_wide (*x)[PAL_CELL_MAX_NODES], pal_wide (*y)[PAL_CELL_MAX_NODES], const pal_wide r[9],
                       int at, int a, int b, pal_wide va[3], pal_wide vb[3])
{
    const pal_wide zero = {0}, tiny2 = zero + 1e-16;
    pal_wide s1[3], s2[3], r1[3], r2[3], axis[3], rest[3];
    from_to(x, at, a, s1), from_to(x, at, b, s2), from_to(y, at, a, r1), from_to(y, at, b, r2);
    cross(s1, s2, axis), cross(r1, r2, rest);
    pal_wide sn2 = dot(axis, axis), cs = dot(s1, s2), h2 = sn2 + cs * cs;
    pal_wide rest2 = dot(rest, rest), cs0 = dot(r1, r2), h02 = rest2 + cs0 * cs0, both = h2 * h02;
    pal_wide sn = pal_wide_sqrt(sn2), sn0 = pal_wide_sqrt(rest2);
    pal_wide_mask there = (both > 0) & (rest2 > tiny2 * h02), seen = sn2 > tiny2 * h2;
    pal_wide over = pal_wide_select(there, 1 + zero, zero) / pal_wide_select(there, pal_wide_sqrt(both), 1 + zero);
    pal_wide cosine = (cs * cs0 + sn * sn0) * over, sine = (sn * cs0 - cs * sn0) * over;
    /* half of delta, which stays short of half a turn by the smaller of both angles at rest: sh = sin, less = 1 - cos,
     * by = sin / |s1 x s2| with one division for all */
    pal_wide half2 = 0.5 + 0.5 * cosine;
    pal_wide ch = pal_wide_sqrt(pal_wide_select(half2 > 1e-16, half2, zero + 1e-16)),
             length = pal_wide_select(seen, sn, 1 + zero);
    pal_wide inverse = 1 / (ch * length * (1 + ch)), by = 0.5 * sine * (1 + ch) * inverse;
    pal_wide sh = by * length, less = sh * sh * ch * length * inverse;
    if (pal_wide_all(seen)) {
        for (int i = 0; i < 3; i++) axis[i] *= by;
    } else {
        pal_wide instead = pal_wide_select(there & ~seen, sh, zero) / pal_wide_select(there, sn0, 1 + zero);
        by = pal_wide_select(seen, by, zero);
        for (int i = 0; i < 3; i++)
            axis[i] = axis[i] * by + (r[3 * i] * rest[0] + r[3 * i + 1] * rest[1] + r[3 * i + 2] * rest[2]) * instead;
    }
    cross(axis, s1, r1), cross(axis, s2, r2);
    for (int i = 0; i < 3; i++) va[i] = less * s1[i] - r1[i], vb[i] = less * s2[i] + r2[i];
}

/* the four corners of the square at node `at` in the plane of directions a, b; share of each in the edges' vectors */
PAL_INLINE void square(const lattice *g, pal_wide (*x)[PAL_CELL_MAX_NODES], pal_wide (*y)[PAL_CELL_MAX_NODES],
                       const pal_wide r[9], int at, int a, int b, const double share[2][2], edge_vectors *e)
{
    for (int q = 0; q < 4; q++) {
        int high_a = q & 1, high_b = q >> 1;
        int here = at + high_a * g->step[a] + high_b * g->step[b];
        int along_a = at + !high_a * g->step[a] + high_b * g->step[b];
        int along_b = at + high_a * g->step[a] + !high_b * g->step[b];
        pal_wide va[3], vb[3];
        if (g->apex && here >= 4) continue;
        corner(x, y, r, here, along_a, along_b, va, vb);
        double wa = high_a ? -share[0][high_b] : share[0][high_b];
        double wb = high_b ? -share[1][high_a] : share[1][high_a];
        pal_wide *ea = e->at[a][at + high_b * g->step[b]], *eb = e->at[b][at + high_a * g->step[a]];
        for (int i = 0; i < 3; i++) ea[i] += wa * va[i], eb[i] += wb * vb[i];
    }
}

PAL_INLINE void stretches(const lattice *g, pal_wide (*x)[PAL_CELL_MAX_NODES], pal_wide (*y)[PAL_CELL_MAX_NODES],
                          edge_vectors *e)
{
    const pal_wide zero = {0};
    for (int a = 0; a < 3; a++)
        for (int m = 0; m < g->n * g->n * g->n; m++) {
            pal_wide s[3], t[3];
            if (m / g->step[a] % g->n == g->n - 1) continue;
            from_to(x, m, m + g->step[a], s), from_to(y, m, m + g->step[a], t);
            pal_wide l = pal_wide_sqrt(dot(s, s)), l0 = pal_wide_sqrt(dot(t, t));
            pal_wide_mask there = l > 0;
            pal_wide by = pal_wide_select(there, l - l0, zero) / pal_wide_select(there, l, 1 + zero);
            for (int i = 0; i < 3; i++) e->at[a][m][i] = by * s[i];
        }
}

PAL_INLINE void shears(const lattice *g, pal_wide (*x)[PAL_CELL_MAX_NODES], pal_wide (*y)[PAL_CELL_MAX_NODES],
                       const pal_wide r[9], edge_vectors *e)
{
    const int last = g->n - 1;
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3;
        for (int m = 0; m < g->n * g->n * g->n; m++) {
            int i = m / g->step[a] % g->n, j = m / g->step[b] % g->n;
            if (i == last || j == last) continue;
            /* an edge inside the plane has two squares; one to the apex has one corner there */
            const double of_a = g->apex && a == 2 ? 1 : 0.5, of_b = g->apex && b == 2 ? 1 : 0.5;
            const double share[2][2] = {{j > 0 ? 0.5 * of_a : of_a, j + 1 < last ? 0.5 * of_a : of_a},
                                        {i > 0 ? 0.5 * of_b : of_b, i + 1 < last ? 0.5 * of_b : of_b}};
            square(g, x, y, r, m, a, b, share, e);
        }
    }
}

/* d [3][n^3] = edges' vectors summed along lines, from the middle of each */
PAL_INLINE void sum_lines(const lattice *g, const edge_vectors *e, pal_wide (*d)[PAL_CELL_MAX_NODES])
{
    const pal_wide zero = {0};
    for (int m = 0; m < g->n * g->n * g->n; m++) d[0][m] = d[1][m] = d[2][m] = zero;
    for (int a = 0; a < 3; a++)
        for (int m = 0; m < g->n * g->n * g->n; m++) {
            if (m / g->step[a] % g->n != 0) continue;
            for (int i = 0; i < 3; i++) {
                pal_wide sum = zero, mean = zero;
                for (int k = 1; k < g->n; k++) {
                    sum += e->at[a][m + (k - 1) * g->step[a]][i];
                    mean += sum;
                }
                mean *= 1.0 / g->n;
                sum = -mean;
                for (int k = 0; k < g->n; k++) {
                    d[i][m + k * g->step[a]] += sum;
                    if (k + 1 < g->n) sum += e->at[a][m + k * g->step[a]][i];
                }
            }
        }
}

/* u = Q' R d of half a block: y nodes now, from one of them, spoilt; u of node 0 is 0 where K has no row for it */
PAL_INLINE void displaced(const double *rest, int n_node, const pal_wide r[9], pal_wide (*y)[PAL_CELL_MAX_NODES],
                          pal_wide (*u)[PAL_CELL_MAX_NODES])
{
    static const int corner_node[8] = {0, 1, 3, 2, 4, 4, 4, 4};
    const bool cubic = n_node == PAL_CUBIC_NODES;
    const lattice g = {.n = cubic ? 4 : 2,
                       .step = {cubic ? 16 : 1, cubic ? 4 : 2, cubic ? 1 : 4},
                       .apex = n_node == PAL_PYRAMID_NODES};
    edge_vectors e;
    pal_wide x0[3][PAL_CELL_MAX_NODES], (*x)[PAL_CELL_MAX_NODES] = y, x1[3][PAL_CELL_MAX_NODES];
    for (int m = 0; m < g.n * g.n * g.n; m++)
        for (int i = 0; i < 3; i++) {
            int node = g.apex ? corner_node[m] : m;
            x0[i][m] = pal_wide_load(rest + (3 * node + i) * PAL_LANES);
            if (g.apex) x1[i][m] = y[i][node];
        }
    if (g.apex) x = x1;
    stretches(&g, x, x0, &e);
    shears(&g, x, x0, r, &e);
    sum_lines(&g, &e, u);
    for (int i = 0; i < 3 && g.apex; i++) {
        pal_wide top = 0.25 * (u[i][4] + u[i][5] + u[i][6] + u[i][7]), swap = u[i][2];
        u[i][2] = u[i][3], u[i][3] = swap, u[i][4] = top;
    }
    cell_rotate(r, true, n_node, u, u);
    for (int i = 0; i < 3 && !cubic; i++) {
        pal_wide from = u[i][0];
        for (int m = 0; m < n_node; m++) u[i][m] -= from;
    }
}

void pal_cell_edges_displaced(const double *rest, int n_node, const pal_wide r[9], pal_wide (*y)[PAL_CELL_MAX_NODES],
                              pal_wide (*u)[PAL_CELL_MAX_NODES])
{
    if (n_node == PAL_CUBIC_NODES)
        displaced(rest, PAL_CUBIC_NODES, r, y, u);
    else if (n_node == PAL_PYRAMID_NODES)
        displaced(rest, PAL_PYRAMID_NODES, r, y, u);
    else
        displaced(rest, 8, r, y, u);
}
