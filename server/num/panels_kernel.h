/* Triangular solves with the panels of panels.h in one precision. Included by panels_double.c and panels_single.c,
 * which choose REAL and NAME; alone it is the double precision version. */
#include "server/num/panels.h"

#include <string.h>

#ifndef REAL
#define REAL    double
#define NAME(f) f##_double
#endif

typedef REAL vec __attribute__((vector_size(32)));                          /* four doubles or eight floats */
typedef REAL loose __attribute__((vector_size(32), aligned(sizeof(REAL)))); /* the same anywhere */

enum { LANES = 32 / sizeof(REAL), MAX_COLUMNS = 12 };

static inline int chunks_of(int n)
{
    return (n + LANES - 1) / LANES;
}
static inline vec splat(REAL a)
{
    return a - (vec){0};
}

/* t[0..k) <- T^-1 t, then t[k..k + r) -= L t; l: the panel. k is a constant wherever this is called */
static inline __attribute__((always_inline)) void forward(int k, int r, const vec *restrict l, REAL *restrict t)
{
    int c = chunks_of(k), n = chunks_of(r);
    vec y[MAX_COLUMNS * sizeof(REAL) / 32 + 1] = {{0}}, b[MAX_COLUMNS];
    for (int j = 0; j < k; j++, l += c)
        for (int i = 0; i < c; i++) y[i] += l[i] * t[j];
    l += k * c; /* the rows of the triangle */
    REAL head[MAX_COLUMNS + LANES];
    memcpy(head, y, sizeof(vec) * (size_t)c);
    for (int j = 0; j < k; j++) t[j] = head[j], b[j] = splat(head[j]);
    t += k;
    for (int i = 0; i < n; i++, t += LANES, l += k) {
        vec a = *(loose *)t;
        for (int j = 0; j < k; j++) a -= l[j] * b[j];
        *(loose *)t = a;
    }
}

/* t[0..k) <- T^-T (t - L' t[k..k + r)) */
static inline __attribute__((always_inline)) void backward(int k, int r, const vec *restrict l, REAL *restrict t)
{
    int c = chunks_of(k), n = chunks_of(r);
    vec y[MAX_COLUMNS * sizeof(REAL) / 32 + 1] = {{0}}, b[MAX_COLUMNS];
    const vec *rows = l + k * c, *below = rows + k * c;
    for (int j = 0; j < k; j++) b[j] = (vec){0};
    for (int i = 0; i < n; i++, below += k) {
        vec a = *(const loose *)(t + k + LANES * i);
        for (int j = 0; j < k; j++) b[j] += below[j] * a;
    }
    for (int j = 0; j < k; j++, rows += c) {
        REAL sum = t[j];
        for (int i = 0; i < LANES; i++) sum -= b[j][i];
        for (int i = 0; i < c; i++) y[i] += rows[i] * sum;
    }
    memcpy(t, y, sizeof(REAL) * (size_t)k);
}

/* a pass with its number of columns as a constant */
#define WITH_CONSTANT(pass, k, r, l, t)                                                                                \
    ((k) == 3 ? pass(3, r, l, t) : (k) == 6 ? pass(6, r, l, t) : (k) == 9 ? pass(9, r, l, t) : pass(12, r, l, t))

static void forward_panel(int k, int r, const vec *l, REAL *t)
{
    WITH_CONSTANT(forward, k, r, l, t);
}

static void backward_panel(int k, int r, const vec *l, REAL *t)
{
    WITH_CONSTANT(backward, k, r, l, t);
}

static bool all_zero(const REAL *y, int n)
{
    for (int i = 0; i < n; i++)
        if (y[i] != 0) return false;
    return true;
}

/* the rows of a supernode */
static void gather(const int32_t *row, int n_col, int n_row, const REAL *own, const REAL *y, REAL *work)
{
    memcpy(work, own, sizeof(REAL) * 3 * (size_t)n_col);
    for (int i = n_col; i < n_row; i++)
        for (int k = 0; k < 3; k++) work[3 * i + k] = y[3 * (size_t)row[i] + k];
}

/* y = L^-T L^-1 y */
static void solve_all(const pal_panels *p, const REAL *value, REAL *y, REAL *work)
{
    const vec *l = (const vec *)value;
    const uint8_t *width = p->width;
    for (int s = 0; s < p->n_super; s++) {
        const int32_t *row = p->row + p->start[s];
        int n_col = p->first[s + 1] - p->first[s], n_row = (int)(p->start[s + 1] - p->start[s]);
        REAL *own = y + 3 * (size_t)p->first[s];
        if (all_zero(own, 3 * n_col)) { /* a load on few points leaves most of the tree alone */
            for (int c = 0; c < n_col; c += *width++)
                l += pal_panel_vectors(3 * *width, 3 * (n_row - c - *width), LANES);
            continue;
        }
        gather(row, n_col, n_row, own, y, work);
        for (int c = 0, m; c < n_col; c += m) {
            m = *width++;
            forward_panel(3 * m, 3 * (n_row - c - m), l, work + 3 * c);
            l += pal_panel_vectors(3 * m, 3 * (n_row - c - m), LANES);
        }
        memcpy(own, work, sizeof(REAL) * 3 * (size_t)n_col);
        for (int i = n_col; i < n_row; i++)
            for (int k = 0; k < 3; k++) y[3 * (size_t)row[i] + k] = work[3 * i + k];
    }
    for (int s = p->n_super - 1; s >= 0; s--) {
        const int32_t *row = p->row + p->start[s];
        int n_col = p->first[s + 1] - p->first[s], n_row = (int)(p->start[s + 1] - p->start[s]);
        REAL *own = y + 3 * (size_t)p->first[s];
        gather(row, n_col, n_row, own, y, work);
        for (int c = n_col, m; c > 0; c -= m) {
            m = *--width;
            l -= pal_panel_vectors(3 * m, 3 * (n_row - c), LANES);
            backward_panel(3 * m, 3 * (n_row - c), l, work + 3 * (c - m));
        }
        memcpy(own, work, sizeof(REAL) * 3 * (size_t)n_col);
    }
}

void NAME(pal_panels_solve)(const pal_panels *p, const REAL *value, int n, const int32_t *place, double s,
                            const double *b, double t, double *x, REAL *y, REAL *work)
{
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 3 && place[i] >= 0; k++) y[3 * place[i] + k] = (REAL)(s * b[3 * i + k]);
    solve_all(p, value, y, work);
    for (int i = 0; i < n; i++)
        for (int k = 0; k < 3; k++) x[3 * i + k] = place[i] < 0 ? 0 : t * (double)y[3 * place[i] + k];
}

/* inverse of the lower triangle at x (columns ld apart), row-major k x k */
static void invert(int k, const double *x, int64_t ld, double *inverse)
{
    memset(inverse, 0, sizeof *inverse * (size_t)(k * k));
    for (int c = 0; c < k; c++)
        for (int i = c; i < k; i++) {
            double sum = i == c;
            for (int j = c; j < i; j++) sum -= x[j * ld + i] * inverse[j * k + c];
            inverse[i * k + c] = sum / x[i * ld + i];
        }
}

static REAL *fill_panel(int k, int r, const double *x, int64_t ld, REAL *to)
{
    double inverse[MAX_COLUMNS * MAX_COLUMNS];
    int up = LANES * chunks_of(k), n = chunks_of(r);
    invert(k, x, ld, inverse);
    for (int j = 0; j < k; j++)
        for (int i = 0; i < up; i++) *to++ = i < k ? (REAL)inverse[i * k + j] : 0;
    for (int j = 0; j < k; j++)
        for (int i = 0; i < up; i++) *to++ = i < k ? (REAL)inverse[j * k + i] : 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < k; j++)
            for (int a = 0; a < LANES; a++) *to++ = LANES * i + a < r ? (REAL)x[j * ld + k + LANES * i + a] : 0;
    return to;
}

void NAME(pal_panels_fill)(const pal_panels *p, const int *px, const double *x, REAL *value)
{
    const uint8_t *width = p->width;
    for (int s = 0; s < p->n_super; s++) {
        int n_col = p->first[s + 1] - p->first[s], n_row = (int)(p->start[s + 1] - p->start[s]);
        int64_t ld = 3 * (int64_t)n_row;
        for (int c = 0, m; c < n_col; c += m) {
            m = *width++;
            value = fill_panel(3 * m, 3 * (n_row - c - m), x + px[s] + 3 * c * ld + 3 * c, ld, value);
        }
    }
}
