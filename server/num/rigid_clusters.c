/* Rigid clusters as a coarse space. */
#include "server/num/rigid_clusters.h"

#include "server/base/vec3.h"

#include <string.h>

enum { BOXES_MAX = 1 << 24 };
/* of a diagonal entry: clusters of one point, or of points on a line, have rotations without stiffness */
#define SHIFT 1e-9

static pal_err find_clusters(pal_rigid_clusters *p, const double *x, const uint8_t *fixed, double cluster_m,
                             pal_arena *arena)
{
    double low[3], high[3], n_box = 1;
    int count[3];
    pal_box3_empty(low, high);
    for (int i = 0; i < p->n; i++) pal_box3_add(low, high, x + 3 * (size_t)i);
    for (int c = 0; c < 3; c++) {
        const double along = floor((high[c] - low[c]) / cluster_m) + 1;
        if (!((n_box *= along) <= BOXES_MAX)) return PAL_ERR_BUDGET;
        count[c] = (int)along;
    }
    int32_t *box = PAL_NEW(arena, int32_t, n_box), *n_in = PAL_NEW(arena, int32_t, p->n);
    double *middle = PAL_NEW(arena, double, 3 * (size_t)p->n);
    p->cluster = PAL_NEW(arena, int32_t, p->n), p->arm = PAL_NEW(arena, double, 3 * (size_t)p->n);
    if (!box || !n_in || !middle || !p->cluster || !p->arm) return PAL_ERR_MEMORY;
    for (int i = 0; i < p->n; i++) {
        int at[3];
        p->cluster[i] = -1;
        if (fixed[i]) continue;
        for (int c = 0; c < 3; c++) at[c] = (int)((x[3 * i + c] - low[c]) / cluster_m);
        int32_t *of = &box[(at[2] * count[1] + at[1]) * count[0] + at[0]];
        if (*of == 0) *of = ++p->n_cluster;
        p->cluster[i] = *of - 1;
        n_in[p->cluster[i]]++;
        pal_add3(middle + 3 * (size_t)p->cluster[i], middle + 3 * (size_t)p->cluster[i], x + 3 * (size_t)i);
    }
    for (int i = 0; i < p->n; i++)
        for (int c = 0; c < 3 && p->cluster[i] >= 0; c++)
            p->arm[3 * i + c] = (x[3 * i + c] - middle[3 * p->cluster[i] + c] / n_in[p->cluster[i]]) / cluster_m;
    return PAL_ERR_OK;
}

/* columns of a point: 0 to 2 a translation, 3 to 5 a rotation, w x arm; column [3] of row [3] */
static void columns_of(const double arm[3], double b[3][6])
{
    const double all[3][6] = {
        {1, 0, 0, 0, arm[2], -arm[1]}, {0, 1, 0, -arm[2], 0, arm[0]}, {0, 0, 1, arm[1], -arm[0], 0}};
    memcpy(b, all, sizeof all);
}

/* to += block in the rows of cluster p and the columns of cluster q, [6][6], of the lower triangle */
static void add_block(pal_block_matrix *to, int p, int q, double block[6][6])
{
    for (int a = 0; a < 2; a++)
        for (int b = 0; b < 2; b++) {
            const int row = 2 * p + a, column = 2 * q + b;
            if (row < column) continue;
            double *at = to->value + 9 * (size_t)pal_block_matrix_find(to, row, column);
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 3; c++) at[3 * r + c] += block[3 * a + r][3 * b + c];
        }
}

/* P' A P */
static void assemble(const pal_rigid_clusters *p, const pal_block_matrix *a, pal_block_matrix *to)
{
    for (int j = 0; j < p->n; j++)
        for (int32_t k = a->start[j]; k < a->start[j + 1]; k++) {
            const int i = a->row[k];
            if (p->cluster[i] < 0 || p->cluster[j] < 0) continue;
            double bi[3][6], bj[3][6], half[3][6] = {{0}}, block[6][6] = {{0}}, turned[6][6];
            columns_of(p->arm + 3 * (size_t)i, bi), columns_of(p->arm + 3 * (size_t)j, bj);
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 6; c++)
                    for (int m = 0; m < 3; m++) half[r][c] += a->value[9 * (size_t)k + (size_t)(3 * r + m)] * bj[m][c];
            for (int r = 0; r < 6; r++)
                for (int c = 0; c < 6; c++)
                    for (int m = 0; m < 3; m++) block[r][c] += bi[m][r] * half[m][c];
            for (int r = 0; r < 6; r++)
                for (int c = 0; c < 6; c++) turned[r][c] = block[c][r];
            if (p->cluster[i] >= p->cluster[j]) add_block(to, p->cluster[i], p->cluster[j], block);
            if (p->cluster[i] < p->cluster[j] || (p->cluster[i] == p->cluster[j] && i != j))
                add_block(to, p->cluster[j], p->cluster[i], turned);
        }
    double largest = 0;
    for (int i = 0; i < to->n; i++)
        for (size_t c = 0; c < 3; c++) largest = fmax(largest, to->value[9 * (size_t)to->start[i] + 4 * c]);
    for (int i = 0; i < to->n; i++)
        for (size_t c = 0; c < 3; c++) to->value[9 * (size_t)to->start[i] + 4 * c] += SHIFT * largest;
}

pal_err pal_rigid_clusters_make(const pal_block_matrix *a, const double *x, const uint8_t *fixed, double cluster_m,
                                pal_arena *arena, pal_rigid_clusters *out)
{
    *out = (pal_rigid_clusters){.n = a->n};
    PAL_TRY(find_clusters(out, x, fixed, cluster_m, arena));
    int32_t *node = PAL_NEW(arena, int32_t, 4 * (size_t)a->start[a->n]);
    if (!node || !PAL_NEW_DOUBLES(arena, 6 * (size_t)out->n_cluster, &out->r, &out->z)) return PAL_ERR_MEMORY;
    pal_cliques pairs = {.n_corner = 4, .node = node};
    for (int j = 0; j < a->n; j++)
        for (int32_t k = a->start[j]; k < a->start[j + 1]; k++) {
            const int32_t p = out->cluster[a->row[k]], q = out->cluster[j],
                          of[4] = {2 * p, 2 * p + 1, 2 * q, 2 * q + 1};
            if (p < 0 || q < 0) continue;
            memcpy(node + 4 * (size_t)pairs.n_item++, of, sizeof of);
        }
    pal_block_matrix coarse;
    PAL_TRY(pal_block_matrix_make(2 * out->n_cluster, &pairs, 1, arena, &coarse));
    assemble(out, a, &coarse);
    PAL_TRY(pal_cholesky_create(&coarse, NULL, &out->factor));
    return pal_cholesky_factor(out->factor, &coarse, false);
}

void pal_rigid_clusters_add(const pal_rigid_clusters *p, const double *r, double *out)
{
    memset(p->r, 0, 6 * sizeof(double) * (size_t)p->n_cluster);
    for (int i = 0; i < p->n; i++) {
        double moment[3], *to = p->cluster[i] < 0 ? NULL : p->r + 6 * (size_t)p->cluster[i];
        if (!to) continue;
        pal_cross3(moment, p->arm + 3 * (size_t)i, r + 3 * (size_t)i);
        pal_add3(to, to, r + 3 * (size_t)i), pal_add3(to + 3, to + 3, moment);
    }
    if (pal_cholesky_solve(p->factor, p->r, p->z)) return;
    for (int i = 0; i < p->n; i++) {
        double move[3];
        if (p->cluster[i] < 0) continue;
        const double *z = p->z + 6 * (size_t)p->cluster[i];
        pal_cross3(move, z + 3, p->arm + 3 * (size_t)i);
        pal_add3(out + 3 * (size_t)i, out + 3 * (size_t)i, z), pal_add3(out + 3 * (size_t)i, out + 3 * (size_t)i, move);
    }
}

void pal_rigid_clusters_destroy(pal_rigid_clusters *p)
{
    pal_cholesky_destroy(p->factor);
    p->factor = NULL;
}
