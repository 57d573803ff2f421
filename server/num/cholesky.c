/* Sparse Cholesky factors: CHOLMOD (Chen, Davis, Hager, Rajamanickam 2008) orders, analyses and factors with
 * supernodes; the factor is then copied into the panels of panels.h, where solves need neither BLAS nor threads.
 *
 * The ordering is found for points, whose three unknowns stay together: a ninth of the entries to order. Matrices are
 * scaled by a power of two near 1 / (largest diagonal), right sides likewise, so that single precision neither
 * overflows nor underflows whatever the units are. A pivot that lost fourteen digits of its diagonal entry counts as
 * not positive. While solving, subnormal numbers count as zero (subnormals.h).
 *
 * BLAS runs on the calling thread only: OpenBLAS and OpenMP are told so where they are loaded, since their idle threads
 * spin on the processors that simulation threads need. */
#include "server/num/cholesky.h"

#include "server/base/heap.h"
#include "server/base/spare_thread.h"
#include "server/base/subnormals.h"
#include "server/num/panels.h"

#include <cholmod.h>
#include <dlfcn.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

/* METIS, which CHOLMOD orders large matrices by, takes SIGTERM and SIGABRT from the whole program while it works, by
 * this function of the C library, and gives back a handler that is called once: the second SIGTERM ended a server at
 * once, and one that came meanwhile jumped into METIS from any thread. Shared libraries find this definition first
 * (tests/num/test_cholesky.c) */
__attribute__((visibility("default"))) __sighandler_t __sysv_signal(int number, __sighandler_t handler)
{
    (void)number, (void)handler;
    return SIG_DFL;
}
#include <unistd.h>

/* what one thread needs to factor */
typedef struct work_area {
    cholmod_common common;
    cholmod_factor *pattern; /* the analysis, without values                      */
    double *value;           /* lower triangle of the scaled matrix               */
    double scale;            /* value = scale * a                                 */
    bool started, finite;
} work_area;

/* a factor in use or in the making */
typedef struct factor {
    void *value; /* double or float [panels.n_value[single]] */
    double scale;
    bool single, good;
} factor;

struct pal_cholesky {
    int n, n_free;    /* points, free points */
    int32_t *place;   /* position of each point in the factor, -1: fixed  [n] */
    int64_t n_entry;  /* of the lower triangle, numbers              */
    int *start, *row; /* its columns, by free points in order */
    pal_panels panels;
    double nonzeros, flops;
    void *y, *vector; /* working vectors of a solve */
    work_area own, spare;
    factor now, next;
    bool refreshing; /* the spare thread was given values that are not adopted yet: outcome, spare and next are its */
    pal_err outcome;
    pal_spare_thread spare_thread;
};

/* calls a function of a library, where that is loaded */
static void call_loaded(const char *name, int value)
{
    void (*set)(int);
    void *at = dlsym(RTLD_DEFAULT, name);
    if (!at) return;
    memcpy(&set, &at, sizeof set);
    set(value);
}

/* BLAS libraries with threads of their own are limited to the calling thread; once per process */
static void limit_blas_threads(void)
{
    call_loaded("openblas_set_num_threads", 1);
}

static pal_err error_of(const cholmod_common *common)
{
    switch (common->status) {
    case CHOLMOD_OK:
        return PAL_ERR_OK;
    case CHOLMOD_NOT_POSDEF:
    case CHOLMOD_DSMALL:
        return PAL_ERR_NUMERIC;
    case CHOLMOD_OUT_OF_MEMORY:
    case CHOLMOD_TOO_LARGE:
        return PAL_ERR_MEMORY;
    default:
        return PAL_ERR_INTERNAL;
    }
}

static void begin_work_area(work_area *b)
{
    cholmod_start(&b->common);
    b->common.print = 0;
    b->common.error_handler = NULL;
    b->common.try_catch = 1;
    b->common.quick_return_if_not_posdef = 1;
    b->common.useGPU = 0;
    b->common.final_ll = 1;
    b->started = true;
}

static void end_work_area(work_area *b)
{
    if (!b->started) return;
    cholmod_free_factor(&b->pattern, &b->common);
    cholmod_finish(&b->common);
    free(b->value);
}

/* the lower triangle's columns, a point each (expand 1) or its three unknowns (expand 3) */
static int64_t lay_columns(const pal_block_matrix *a, const int32_t *number, int expand, int *start, int *row)
{
    int64_t n = 0;
    int column = 0;
    for (int j = 0; j < a->n; j++) {
        if (number[j] < 0) continue;
        for (int c = 0; c < expand; c++) {
            if (start) start[column++] = (int)n;
            for (int k = a->start[j]; k < a->start[j + 1]; k++) {
                int i = number[a->row[k]];
                if (i < 0) continue;
                for (int r = k == a->start[j] ? c : 0; r < expand; r++, n++)
                    if (row) row[n] = expand * i + r;
            }
        }
    }
    if (start) start[column] = (int)n;
    return n;
}

static cholmod_sparse sparse_of(int n, int64_t n_entry, int *start, int *row, double *value)
{
    cholmod_sparse a = {.nrow = (size_t)n, .ncol = (size_t)n, .nzmax = (size_t)n_entry, .sorted = 1, .packed = 1};
    a.p = start, a.i = row, a.x = value, a.stype = -1;
    a.itype = CHOLMOD_INT, a.dtype = CHOLMOD_DOUBLE, a.xtype = value ? CHOLMOD_REAL : CHOLMOD_PATTERN;
    return a;
}

/* the order of points with the fewest entries of the factor, as an order of unknowns [3 n_free] */
static pal_err find_order(const pal_block_matrix *a, const int32_t *number, int n_free, int *order)
{
    cholmod_common common;
    cholmod_factor *found = NULL;
    int64_t n_entry = lay_columns(a, number, 1, NULL, NULL);
    pal_err err = PAL_ERR_OK;
    int *start, *row;
    PAL_ARRAY(&err, start, n_free + 1);
    PAL_ARRAY(&err, row, n_entry);
    if (!err) {
        lay_columns(a, number, 1, start, row);
        cholmod_sparse points = sparse_of(n_free, n_entry, start, row, NULL);
        cholmod_start(&common);
        common.print = 0;
        common.try_catch = 1;
        common.supernodal = CHOLMOD_SIMPLICIAL;
        common.nmethods = 2;
        common.method[0].ordering = CHOLMOD_AMD;
        common.method[1].ordering = CHOLMOD_METIS;
        found = cholmod_analyze(&points, &common);
        if (found) {
            const int *at = found->Perm;
            for (int i = 0; i < 3 * n_free; i++) order[i] = 3 * at[i / 3] + i % 3;
        } else {
            err = error_of(&common);
        }
        cholmod_free_factor(&found, &common);
        cholmod_finish(&common);
    }
    PAL_FREE(start, row);
    return err;
}

/* a supernodal factor's pattern for the order found, and where each point went */
static pal_err analyse(pal_cholesky *c, const pal_block_matrix *a, int32_t *number)
{
    cholmod_common *common = &c->own.common;
    int *order = malloc(sizeof *order * 3 * (size_t)c->n_free);
    if (!order) return PAL_ERR_MEMORY;
    pal_err err = find_order(a, number, c->n_free, order);
    if (!err) {
        cholmod_sparse matrix = sparse_of(3 * c->n_free, c->n_entry, c->start, c->row, NULL);
        common->supernodal = CHOLMOD_SUPERNODAL;
        common->nmethods = 1;
        common->method[0].ordering = CHOLMOD_GIVEN;
        c->own.pattern = cholmod_analyze_p(&matrix, order, NULL, 0, common);
        err = c->own.pattern ? PAL_ERR_OK : error_of(common);
    }
    free(order);
    if (err) return err;
    const cholmod_factor *l = c->own.pattern;
    if (!l->is_super) return PAL_ERR_INTERNAL;
    c->nonzeros = common->lnz;
    c->flops = common->fl;
    const int *permuted = l->Perm;
    int *home = malloc(sizeof *home * (size_t)c->n_free);
    if (!home) return PAL_ERR_MEMORY;
    for (int i = 0; i < c->n_free; i++) home[permuted[3 * i] / 3] = i;
    for (int i = 0; i < c->n; i++) c->place[i] = number[i] < 0 ? -1 : home[number[i]];
    free(home);
    return pal_panels_make((int)l->nsuper, l->super, l->pi, l->s, &c->panels);
}

static pal_err make(pal_cholesky *c, const pal_block_matrix *a, const uint8_t *fixed)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    static pthread_mutex_t one_at_a_time = PTHREAD_MUTEX_INITIALIZER;
    pthread_once(&once, limit_blas_threads);
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, c->place, c->n);
    if (err) return err;
    int32_t *number = c->place;
    for (int i = 0; i < c->n; i++) number[i] = fixed && fixed[i] ? -1 : c->n_free++;
    if (c->n_free == 0) return PAL_ERR_OK;
    c->n_entry = lay_columns(a, number, 3, NULL, NULL);
    if (c->n_entry > INT32_MAX || c->n_free > INT32_MAX / 3) return PAL_ERR_MEMORY;
    PAL_ARRAY(&err, c->start, 3 * (size_t)c->n_free + 1);
    PAL_ARRAY(&err, c->row, c->n_entry);
    if (err) return err;
    lay_columns(a, number, 3, c->start, c->row);
    /* the graph partitioner below CHOLMOD keeps one random number generator for the process */
    pthread_mutex_lock(&one_at_a_time);
    err = analyse(c, a, number);
    pthread_mutex_unlock(&one_at_a_time);
    if (err) return err;
    c->y = calloc(3 * (size_t)c->n_free, sizeof(double));
    c->vector = calloc((size_t)c->panels.max_row + PAL_PANEL_PADDING, sizeof(double));
    return c->y && c->vector ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_cholesky_create(const pal_block_matrix *a, const uint8_t *fixed, pal_cholesky **out)
{
    pal_cholesky *c = calloc(1, sizeof *c);
    if (!c) return PAL_ERR_MEMORY;
    c->n = a->n;
    pal_spare_thread_init(&c->spare_thread);
    begin_work_area(&c->own);
    pal_err err = make(c, a, fixed);
    if (err)
        pal_cholesky_destroy(c);
    else
        *out = c;
    return err;
}

void pal_cholesky_destroy(pal_cholesky *c)
{
    if (!c) return;
    pal_spare_thread_destroy(&c->spare_thread);
    end_work_area(&c->own);
    end_work_area(&c->spare);
    pal_panels_free(&c->panels);
    PAL_FREE(c->place, c->start, c->row, c->y, c->vector, c->now.value, c->next.value, c);
}

/* copies the scaled values of the lower triangle of a without fixed points; reports whether they are finite */
static pal_err take_values(const pal_cholesky *c, const pal_block_matrix *a, work_area *b)
{
    if (!b->value) b->value = malloc(sizeof *b->value * (size_t)c->n_entry);
    if (!b->value) return PAL_ERR_MEMORY;
    double max = 0, sum = 0;
    for (int j = 0; j < a->n; j++) {
        const double *v = a->value + 9 * (size_t)a->start[j];
        if (c->place[j] >= 0) max = fmax(max, fmax(v[0], fmax(v[4], v[8])));
    }
    b->scale = pal_block_matrix_scale(max);
    double *to = b->value;
    for (int j = 0; j < a->n; j++) {
        if (c->place[j] < 0) continue;
        for (int k = 0; k < 3; k++)
            for (int p = a->start[j]; p < a->start[j + 1]; p++) {
                if (c->place[a->row[p]] < 0) continue;
                const double *v = a->value + 9 * (size_t)p;
                for (int r = p == a->start[j] ? k : 0; r < 3; r++) {
                    *to = b->scale * v[3 * r + k];
                    sum += 0 * *to++;
                }
            }
    }
    b->finite = sum == 0;
    return PAL_ERR_OK;
}

/* all pivots positive, finite and above rounding */
static bool pivots_good(const pal_cholesky *c, const work_area *b, const cholmod_factor *l)
{
    const int *super = l->super, *pi = l->pi, *px = l->px, *perm = l->Perm;
    const double *x = l->x;
    for (size_t s = 0; s < l->nsuper; s++)
        for (int j = super[s]; j < super[s + 1]; j++) {
            double d = x[px[s] + (int64_t)(j - super[s]) * (pi[s + 1] - pi[s] + 1)];
            if (!(d > 0 && d * d > 1e-14 * b->value[c->start[perm[j]]]) || !isfinite(d)) return false;
        }
    return true;
}

/* do the factor and its copy fit into this machine? Asked first, since overcommitted memory ends in the kernel killing
 * the process */
static bool fits(const pal_cholesky *c, const work_area *b, bool single)
{
    double have = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    double need = (double)b->pattern->xsize * sizeof(double) +
                  (double)c->panels.n_value[single] * (single ? sizeof(float) : sizeof(double));
    return !(have > 0) || need < 0.8 * have;
}

/* factors b's values into f, which keeps its old values unless all goes well */
static pal_err factor_values(const pal_cholesky *c, work_area *b, bool single, factor *f)
{
    if (!b->finite) return PAL_ERR_NUMERIC;
    if (!fits(c, b, single)) return PAL_ERR_MEMORY;
    call_loaded("omp_set_max_active_levels", 0); /* OpenMP regions inside CHOLMOD run on this thread alone */
    cholmod_sparse matrix = sparse_of(3 * c->n_free, c->n_entry, c->start, c->row, b->value);
    cholmod_factor *l = cholmod_copy_factor(b->pattern, &b->common);
    if (!l) return error_of(&b->common);
    cholmod_factorize(&matrix, l, &b->common);
    pal_err err = error_of(&b->common);
    if (!err && (l->minor < l->n || l->xtype != CHOLMOD_REAL || !l->is_super || !pivots_good(c, b, l)))
        err = PAL_ERR_NUMERIC;
    if (!err && (!f->value || f->single != single)) {
        size_t n_byte = (size_t)c->panels.n_value[single] * (single ? sizeof(float) : sizeof(double));
        void *value = aligned_alloc(64, (n_byte + 63) / 64 * 64);
        if (value) {
            free(f->value);
            *f = (factor){.value = value, .single = single};
        } else {
            err = PAL_ERR_MEMORY;
        }
    }
    if (!err) {
        if (single)
            pal_panels_fill_single(&c->panels, l->px, l->x, f->value);
        else
            pal_panels_fill_double(&c->panels, l->px, l->x, f->value);
        f->scale = b->scale;
        f->good = true;
    }
    cholmod_free_factor(&l, &b->common);
    return err;
}

pal_err pal_cholesky_factor(pal_cholesky *c, const pal_block_matrix *a, bool single)
{
    if (c->refreshing) return PAL_ERR_STATE;
    if (c->n_free == 0) {
        c->now.good = true;
        return PAL_ERR_OK;
    }
    PAL_TRY(take_values(c, a, &c->own));
    return factor_values(c, &c->own, single, &c->now);
}

pal_err pal_cholesky_solve(pal_cholesky *c, const double *b, double *x)
{
    if (!c->now.good) return PAL_ERR_STATE;
    double max = 0, sum = 0;
    for (int i = 0; i < c->n; i++)
        for (int k = 0; k < 3 && c->place[i] >= 0; k++) {
            max = fmax(max, fabs(b[3 * i + k]));
            sum += 0 * b[3 * i + k];
        }
    if (sum != 0) return PAL_ERR_NUMERIC;
    if (max == 0) {
        for (int i = 0; i < 3 * c->n; i++) x[i] = 0;
        return PAL_ERR_OK;
    }
    double s = pal_block_matrix_scale(max), t = c->now.scale / s;
    const unsigned mode = pal_subnormals_flush();
    if (c->now.single)
        pal_panels_solve_single(&c->panels, c->now.value, c->n, c->place, s, b, t, x, c->y, c->vector);
    else
        pal_panels_solve_double(&c->panels, c->now.value, c->n, c->place, s, b, t, x, c->y, c->vector);
    pal_subnormals_restore(mode);
    return PAL_ERR_OK;
}

static void factor_spare(void *self)
{
    pal_cholesky *c = self;
    c->outcome = factor_values(c, &c->spare, c->next.single, &c->next);
}

/* the spare work area, made by the first refresh */
static pal_err start_spare(pal_cholesky *c)
{
    if (!c->spare.started) begin_work_area(&c->spare);
    if (!c->spare.pattern) c->spare.pattern = cholmod_copy_factor(c->own.pattern, &c->spare.common);
    return c->spare.pattern ? PAL_ERR_OK : error_of(&c->spare.common);
}

pal_err pal_cholesky_refresh(pal_cholesky *c, const pal_block_matrix *a)
{
    if (c->refreshing || !c->now.good) return PAL_ERR_STATE;
    if (c->n_free > 0) {
        PAL_TRY(start_spare(c));
        PAL_TRY(take_values(c, a, &c->spare));
        if (c->next.single != c->now.single) {
            free(c->next.value);
            c->next = (factor){.single = c->now.single};
        }
        PAL_TRY(pal_spare_thread_run(&c->spare_thread, factor_spare, c));
    }
    c->refreshing = true;
    return PAL_ERR_OK;
}

pal_err pal_cholesky_adopt(pal_cholesky *c)
{
    if (!c->refreshing) return PAL_ERR_STATE;
    c->refreshing = false;
    pal_spare_thread_wait(&c->spare_thread);
    pal_err err = c->outcome;
    if (err || c->n_free == 0) return err;
    factor old = c->now;
    c->now = c->next;
    c->next = old;
    return PAL_ERR_OK;
}

int64_t pal_cholesky_nonzeros(const pal_cholesky *c)
{
    return (int64_t)c->nonzeros;
}

double pal_cholesky_flops(const pal_cholesky *c)
{
    return c->flops;
}
