#include "server/num/conjugate_gradient.h"

#include <math.h>
#include <string.h>

/* numbers of a chunk: some five microseconds of a thread; and chunks that are summed side by side, which bounds the
 * memory of their sums */
enum { CHUNK = 16384, CHUNKS = 256 };

static double chunk_product(int n, const double *a, const double *b)
{
    double lane[8] = {0}, sum = 0;
    int i = 0;
    for (; i + 8 <= n; i += 8)
        for (int l = 0; l < 8; l++) lane[l] += a[i + l] * b[i + l];
    for (; i < n; i++) sum += a[i] * b[i];
    return sum + ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

/* what is done with each chunk of the vectors */
typedef struct pass {
    enum { PRODUCT, DIRECTION, ADVANCE } what;
    int n;
    const double *a, *b;
    pal_conjugate_gradient *cg;
    double *x, beta, alpha;
    int begin;          /* first chunk of those that are side by side */
    double sum[CHUNKS]; /* of each of them */
} pass;

static void pass_chunk(void *user, int worker, int index)
{
    pass *p = user;
    const int first = (p->begin + index) * CHUNK, n = p->n - first < CHUNK ? p->n - first : CHUNK;
    (void)worker;
    if (p->what == PRODUCT) {
        p->sum[index] = chunk_product(n, p->a + first, p->b + first);
        return;
    }
    const double *q = p->cg->q + first, *z = p->cg->z + first;
    double *r = p->cg->r + first, *d = p->cg->p + first;
    for (int i = 0; i < n && p->what == DIRECTION; i++) d[i] = z[i] + p->beta * d[i];
    if (p->what == DIRECTION) return;
    for (int i = 0; i < n; i++) {
        p->x[first + i] += p->alpha * d[i];
        r[i] -= p->alpha * q[i];
    }
    p->sum[index] = chunk_product(n, r, r);
}

/* returns the sum over all chunks */
static double run_pass(pass *p, pal_team *team)
{
    const int n_chunk = (p->n + CHUNK - 1) / CHUNK;
    double sum = 0;
    for (p->begin = 0; p->begin < n_chunk; p->begin += CHUNKS) {
        const int n = n_chunk - p->begin < CHUNKS ? n_chunk - p->begin : CHUNKS;
        pal_team_run(team, n, pass_chunk, p);
        for (int k = 0; k < n && p->what != DIRECTION; k++) sum += p->sum[k];
    }
    return sum;
}

static double product(pal_team *team, int n, const double *a, const double *b)
{
    pass p = {.what = PRODUCT, .n = n, .a = a, .b = b};
    return run_pass(&p, team);
}

double pal_dot_product(int n, const double *a, const double *b)
{
    return product(NULL, n, a, b);
}

/* z ~ A^-1 r; returns z'r */
static double precondition(pal_conjugate_gradient *cg)
{
    double rz = 0;
    for (int k = 0; k < 2 && !(rz > 0); k++) {
        cg->careful = k > 0;
        cg->precondition(cg->user, cg->r, cg->z);
        rz = product(cg->team, cg->n, cg->r, cg->z);
    }
    return rz;
}

int pal_conjugate_gradient_run(pal_conjugate_gradient *cg, double *x, double target, int min, int max)
{
    const int n = cg->n;
    double rr = product(cg->team, n, cg->r, cg->r), rz_old = 0;
    pass p = {.n = n, .cg = cg, .x = x};
    cg->n_done = 0;
    while (cg->n_done < max && rr > 0 && (cg->n_done < min || rr > target * target)) {
        const double rz = precondition(cg);
        if (!(rz > 0) || !isfinite(rz) || (cg->n_done >= min && rz <= cg->gain * cg->energy)) break;
        /* z'(r - r of before) / (z'r of before), and r of before is r + alpha q */
        p.beta = cg->n_done > 0 ? -p.alpha * product(cg->team, n, cg->z, cg->q) / rz_old : 0;
        p.what = DIRECTION;
        if (cg->n_done == 0)
            memcpy(cg->p, cg->z, sizeof(double) * (size_t)n);
        else
            (void)run_pass(&p, cg->team);
        cg->multiply(cg->user, cg->p, cg->q);
        double pq = product(cg->team, n, cg->p, cg->q);
        if (!(pq > 0) || !isfinite(pq)) break;
        p.alpha = rz / pq;
        rz_old = rz;
        cg->energy += p.alpha * rz;
        p.what = ADVANCE;
        rr = run_pass(&p, cg->team);
        cg->n_done++;
    }
    cg->residual = sqrt(rr);
    return cg->n_done;
}
