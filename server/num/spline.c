#include "server/num/spline.h"

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

const double pal_gauss4_at[4] = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629};
const double pal_gauss4_weight[4] = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307,
                                     0.17392742256872693};

void pal_spline(double u, double b[4], double slope[4])
{
    double t = 1 - u;
    if (b) {
        b[0] = t * t * t / 6;
        b[1] = (3 * u * u * u - 6 * u * u + 4) / 6;
        b[2] = (3 * t * t * t - 6 * t * t + 4) / 6;
        b[3] = u * u * u / 6;
    }
    if (slope) {
        slope[0] = -t * t / 2;
        slope[1] = (3 * u * u - 4 * u) / 2;
        slope[2] = (4 * t - 3 * t * t) / 2;
        slope[3] = u * u / 2;
    }
}

static void tricubic(const double x[3], double *n, double (*g)[3])
{
    double b[3][4], s[3][4];
    for (int c = 0; c < 3; c++) pal_spline(x[c], b[c], s[c]);
    for (int m = 0; m < 64; m++) {
        int j = m >> 4, k = m >> 2 & 3, l = m & 3;
        if (n) n[m] = b[0][j] * b[1][k] * b[2][l];
        if (!g) continue;
        g[m][0] = s[0][j] * b[1][k] * b[2][l];
        g[m][1] = b[0][j] * s[1][k] * b[2][l];
        g[m][2] = b[0][j] * b[1][k] * s[2][l];
    }
}

static void trilinear(const double x[3], double n[8], double g[8][3])
{
    for (int c = 0; c < 8; c++) {
        double f[3], s[3];
        for (int a = 0; a < 3; a++) {
            bool high = c >> a & 1;
            f[a] = high ? x[a] : 1 - x[a], s[a] = high ? 1 : -1;
        }
        n[c] = f[0] * f[1] * f[2];
        g[c][0] = s[0] * f[1] * f[2], g[c][1] = f[0] * s[1] * f[2], g[c][2] = f[0] * f[1] * s[2];
    }
}

void pal_cell_shape(int n_node, const double x[3], double *n, double (*g)[3])
{
    /* node of a pyramid at each corner of the hexahedron */
    static const int node_of[8] = {0, 1, 3, 2, 4, 4, 4, 4};
    double value[8], slope[8][3];
    if (n_node == 64) {
        tricubic(x, n, g);
        return;
    }
    trilinear(x, value, slope);
    if (n) memset(n, 0, (size_t)n_node * sizeof *n);
    if (g) memset(g, 0, (size_t)n_node * sizeof *g);
    for (int c = 0; c < 8; c++) {
        int to = n_node == 8 ? c : node_of[c];
        if (n) n[to] += value[c];
        for (int a = 0; a < 3 && g; a++) g[to][a] += slope[c][a];
    }
}

double pal_cell_gauss_point(int p, double x[3])
{
    int at[3] = {p >> 4, p >> 2 & 3, p & 3};
    double weight = 1;
    for (int a = 0; a < 3; a++) {
        x[a] = pal_gauss4_at[at[a]];
        weight *= pal_gauss4_weight[at[a]];
    }
    return weight;
}
