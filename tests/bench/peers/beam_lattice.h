/* The reference cantilever 0.2 x 0.05 x 0.05 m as a lattice of n x n/4 x n/4 cubes, for programs other than ours:
 * nodes, five tetrahedra a cube, consistent tip loads, and the error over sample points. Plain C and C++. */
#ifndef PAL_PEERS_BEAM_LATTICE_H
#define PAL_PEERS_BEAM_LATTICE_H
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define BEAM_LONG 0.2
#define BEAM_WIDE 0.05

typedef struct beam {
    int n[3], n_node, n_cube, n_tet;
    double h;
    double *x;    /* rest position               [n_node][3] */
    double *load; /* share of the tip force, sum 1 [n_node]  */
    int *cube;    /* corners x = 1, y = 2, z = 4  [n_cube][8] */
    int *tet;     /* positive volume              [n_tet][4]  */
} beam;

static int beam_node(const beam *b, int i, int j, int k)
{
    return (k * (b->n[1] + 1) + j) * (b->n[0] + 1) + i;
}

static void beam_make(beam *b, int n_long)
{
    static const int five[2][5][4] = {
        {{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 4, 7, 1}, {6, 7, 4, 2}, {1, 2, 4, 7}},
        {{1, 3, 0, 5}, {2, 0, 3, 6}, {4, 0, 6, 5}, {7, 3, 5, 6}, {0, 3, 6, 5}},
    };
    b->n[0] = n_long, b->n[1] = b->n[2] = n_long / 4;
    b->h = BEAM_LONG / n_long;
    b->n_node = (b->n[0] + 1) * (b->n[1] + 1) * (b->n[2] + 1);
    b->n_cube = b->n[0] * b->n[1] * b->n[2];
    b->n_tet = 5 * b->n_cube;
    b->x = (double *)calloc((size_t)b->n_node * 3, sizeof(double));
    b->load = (double *)calloc((size_t)b->n_node, sizeof(double));
    b->cube = (int *)calloc((size_t)b->n_cube * 8, sizeof(int));
    b->tet = (int *)calloc((size_t)b->n_tet * 4, sizeof(int));
    for (int k = 0; k <= b->n[2]; k++)
        for (int j = 0; j <= b->n[1]; j++)
            for (int i = 0; i <= b->n[0]; i++) {
                double *x = b->x + 3 * beam_node(b, i, j, k);
                x[0] = i * b->h, x[1] = j * b->h - BEAM_WIDE / 2, x[2] = k * b->h - BEAM_WIDE / 2;
            }
    int c = 0;
    for (int k = 0; k < b->n[2]; k++)
        for (int j = 0; j < b->n[1]; j++)
            for (int i = 0; i < b->n[0]; i++, c++) {
                int *corner = b->cube + 8 * c;
                for (int m = 0; m < 8; m++) corner[m] = beam_node(b, i + (m & 1), j + (m >> 1 & 1), k + (m >> 2));
                for (int t = 0; t < 20; t++) b->tet[20 * c + t] = corner[five[(i + j + k) & 1][t / 4][t % 4]];
                for (int m = 1; m < 8 && i == b->n[0] - 1; m += 2) b->load[corner[m]] += 0.25 / (b->n[1] * b->n[2]);
            }
}

/* error against CSV rows x,y,z,ux,uy,uz, by trilinear interpolation of u [n_node][3]; per cent of the largest
 * displacement; negative: no such file */
static double beam_error(const beam *b, const double *u, const char *csv)
{
    FILE *from = fopen(csv, "r");
    char line[512];
    double sum = 0, max = 0, r[6];
    int n_row = 0;
    if (!from) return -1;
    while (fgets(line, sizeof line, from)) {
        if (sscanf(line, "%lf,%lf,%lf,%lf,%lf,%lf", r, r + 1, r + 2, r + 3, r + 4, r + 5) != 6) continue;
        double at[3] = {r[0], r[1] + BEAM_WIDE / 2, r[2] + BEAM_WIDE / 2}, got[3] = {0, 0, 0}, w[3];
        int cell[3];
        for (int d = 0; d < 3; d++) {
            cell[d] = (int)floor(at[d] / b->h);
            if (cell[d] < 0) cell[d] = 0;
            if (cell[d] >= b->n[d]) cell[d] = b->n[d] - 1;
            w[d] = at[d] / b->h - cell[d];
        }
        for (int m = 0; m < 8; m++) {
            int node = beam_node(b, cell[0] + (m & 1), cell[1] + (m >> 1 & 1), cell[2] + (m >> 2));
            double s = (m & 1 ? w[0] : 1 - w[0]) * (m & 2 ? w[1] : 1 - w[1]) * (m & 4 ? w[2] : 1 - w[2]);
            for (int d = 0; d < 3; d++) got[d] += s * u[3 * node + d];
        }
        double away = 0, size = 0;
        for (int d = 0; d < 3; d++) away += (got[d] - r[3 + d]) * (got[d] - r[3 + d]), size += r[3 + d] * r[3 + d];
        sum += away;
        max = size > max ? size : max;
        n_row++;
    }
    fclose(from);
    return n_row ? 100 * sqrt(sum / n_row) / sqrt(max) : -1;
}
#endif
