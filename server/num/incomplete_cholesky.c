/* Incomplete factors, column by column: updates from the columns to the right are kept only where the pattern has an
 * entry. */
#include "server/num/incomplete_cholesky.h"

#include "server/num/tuning.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

pal_err pal_incomplete_cholesky_make(const pal_block_matrix *pattern, const uint8_t *fixed, pal_arena *arena,
                                     pal_incomplete_cholesky *out)
{
    *out = (pal_incomplete_cholesky){.pattern = pattern, .fixed = fixed};
    out->lower = PAL_NEW(arena, float, 9 * (size_t)pattern->start[pattern->n]);
    out->inverse = PAL_NEW(arena, double, 9 * (size_t)pattern->n);
    return out->lower && out->inverse ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

static bool is_fixed(const pal_incomplete_cholesky *f, int i)
{
    return f->fixed && f->fixed[i];
}

/* of a symmetric block by cofactors; false: it is not positive definite, or its pivots have lost all but PIVOT_MIN
 * of the diagonal */
static bool invert(const double *m, const double *diagonal, double *out)
{
    const double d0 = m[0], d1 = m[4] - m[3] * m[3] / d0;
    const double c00 = m[4] * m[8] - m[7] * m[7], c10 = m[6] * m[7] - m[3] * m[8], c20 = m[3] * m[7] - m[4] * m[6];
    const double det = m[0] * c00 + m[3] * c10 + m[6] * c20, d2 = det / (d0 * d1), by = 1 / det;
    if (!(d0 > PIVOT_MIN * diagonal[0] && d1 > PIVOT_MIN * diagonal[4] && d2 > PIVOT_MIN * diagonal[8])) return false;
    out[0] = by * c00, out[1] = out[3] = by * c10, out[2] = out[6] = by * c20;
    out[4] = by * (m[0] * m[8] - m[6] * m[6]), out[5] = out[7] = by * (m[6] * m[3] - m[0] * m[7]);
    out[8] = by * (m[0] * m[4] - m[3] * m[3]);
    return isfinite(by);
}

/* scaled values without fixed points; false: one is not finite */
static bool take(pal_incomplete_cholesky *f, const pal_block_matrix *a)
{
    double max = 0, sum = 0;
    for (int j = 0; j < a->n; j++)
        for (int c = 0; c < 9 && !is_fixed(f, j); c += 4) max = fmax(max, a->value[9 * (size_t)a->start[j] + c]);
    f->scale = pal_block_matrix_scale(max);
    for (int j = 0; j < a->n; j++)
        for (int k = a->start[j]; k < a->start[j + 1]; k++) {
            const bool off = is_fixed(f, j) || is_fixed(f, a->row[k]);
            for (size_t c = 9 * (size_t)k; c < 9 * (size_t)k + 9; c++) {
                f->lower[c] = off ? 0 : (float)(f->scale * a->value[c]);
                sum += 0 * a->value[c];
            }
        }
    return sum == 0;
}

/* to -= p q', the blocks p and q of a column, p by the inverse of its pivot already */
static void take_product(float *to, const double *p, const double *q)
{
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            to[3 * r + c] -= (float)(p[3 * r] * q[3 * c] + p[3 * r + 1] * q[3 * c + 1] + p[3 * r + 2] * q[3 * c + 2]);
}

/* updates of column j from the columns to its right: -= A_ij D^-1 A_kj' at (i, k), i >= k, where the pattern has an
 * entry; its own blocks become those of L */
static void eliminate(pal_incomplete_cholesky *f, int j)
{
    const int32_t *start = f->pattern->start, *row = f->pattern->row;
    const double *d = f->inverse + 9 * (size_t)j;
    for (int p = start[j] + 1; p < start[j + 1]; p++) {
        const int k = row[p];
        double q[9];
        for (int c = 0; c < 9; c++) q[c] = (double)f->lower[9 * (size_t)p + c];
        /* L of (k, j) takes the place of A; later rows still stand as A */
        double l[9];
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++)
                l[3 * r + c] = q[3 * r] * d[c] + q[3 * r + 1] * d[3 + c] + q[3 * r + 2] * d[6 + c];
        for (int i = p, at = start[k]; i < start[j + 1] && at < start[k + 1];) {
            if (row[i] == row[at]) {
                double a[9];
                for (int c = 0; c < 9; c++) a[c] = i == p ? q[c] : (double)f->lower[9 * (size_t)i + c];
                take_product(f->lower + 9 * (size_t)at, a, l);
                i++, at++;
            } else if (row[i] < row[at])
                i++;
            else
                at++;
        }
        for (int c = 0; c < 9; c++) f->lower[9 * (size_t)p + c] = (float)l[c];
    }
}

/* with the shift; false: a pivot is not good */
static bool factor(pal_incomplete_cholesky *f, const pal_block_matrix *a, double shift)
{
    for (int j = 0; j < a->n; j++) {
        double m[9], diagonal[9];
        if (is_fixed(f, j)) continue;
        for (int c = 0; c < 9; c++) {
            diagonal[c] = f->scale * a->value[9 * (size_t)a->start[j] + c];
            m[c] = (double)f->lower[9 * (size_t)a->start[j] + c] + (c % 4 == 0 ? shift * diagonal[c] : 0);
        }
        m[1] = m[3], m[2] = m[6], m[5] = m[7];
        if (!invert(m, diagonal, f->inverse + 9 * (size_t)j)) return false;
        eliminate(f, j);
    }
    f->shift = shift;
    return true;
}

pal_err pal_incomplete_cholesky_factor(pal_incomplete_cholesky *f, const pal_block_matrix *a)
{
    memset(f->inverse, 0, 9 * sizeof *f->inverse * (size_t)a->n);
    for (double shift = 0; shift < SHIFT_MAX; shift = fmax(SHIFT_GROWS * shift, SHIFT_FIRST)) {
        if (!take(f, a)) return PAL_ERR_NUMERIC;
        if (factor(f, a, shift)) return PAL_ERR_OK;
    }
    return PAL_ERR_NUMERIC;
}

void pal_incomplete_cholesky_solve(const pal_incomplete_cholesky *f, const double *b, double *x)
{
    const int n = f->pattern->n;
    const int32_t *start = f->pattern->start, *row = f->pattern->row;
    for (int i = 0; i < 3 * n; i++) x[i] = is_fixed(f, i / 3) ? 0 : f->scale * b[i];
    for (int j = 0; j < n; j++) {
        const double *y = x + 3 * (size_t)j;
        for (int p = start[j] + 1; p < start[j + 1]; p++) {
            const float *l = f->lower + 9 * (size_t)p;
            double *to = x + 3 * (size_t)row[p];
            for (int r = 0; r < 3; r++)
                to[r] -= (double)l[3 * r] * y[0] + (double)l[3 * r + 1] * y[1] + (double)l[3 * r + 2] * y[2];
        }
    }
    for (int j = n - 1; j >= 0; j--) {
        const double *d = f->inverse + 9 * (size_t)j;
        double *y = x + 3 * (size_t)j, z[3];
        for (int r = 0; r < 3; r++) z[r] = d[3 * r] * y[0] + d[3 * r + 1] * y[1] + d[3 * r + 2] * y[2];
        for (int p = start[j] + 1; p < start[j + 1]; p++) {
            const float *l = f->lower + 9 * (size_t)p;
            const double *from = x + 3 * (size_t)row[p];
            for (int c = 0; c < 3; c++)
                z[c] -= (double)l[c] * from[0] + (double)l[3 + c] * from[1] + (double)l[6 + c] * from[2];
        }
        memcpy(y, z, sizeof z);
    }
}
