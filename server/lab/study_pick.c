/* The front of a study, what it answers, and what it foresees.
 *
 * Foreseen is first along the sizes of settings that are the same but for them: ms = a + b n^c, error = d n^-p, n the
 * size (edges of adaptive levels and of subdivided cells double with each). Where fewer than three of them are
 * measured, all points of the model are taken together: the logarithms are sums of what each knob adds. */
#include "server/base/vec3.h"
#include "server/lab/study_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ALONG = 3, FEATURES = 24 };
/* weight of "no effect" for each knob, so that one that was never turned has none */
static const double ridge = 1e-4;

static bool measured(const pal_study_point *p)
{
    return p->err == PAL_ERR_OK && p->priced.ms > 0 && p->priced.error_m >= 0 && isfinite(p->priced.ms) &&
           isfinite(p->priced.error_m);
}

void pal_study_front(pal_study *study)
{
    for (int i = 0; i < study->n_point; i++) {
        pal_priced_setting *p = &study->point[i].priced;
        p->front = measured(&study->point[i]);
        for (int k = 0; k < study->n_point && p->front; k++) {
            const pal_priced_setting *q = &study->point[k].priced;
            if (!measured(&study->point[k]) || k == i) continue;
            bool no_worse = q->ms <= p->ms && q->error_m <= p->error_m;
            bool better = q->ms < p->ms || q->error_m < p->error_m;
            p->front = !(no_worse && (better || k < i));
        }
    }
}

int pal_study_pick(const pal_study *study, double within_m, double budget_ms)
{
    int best = -1;
    double own = study->reference_m > 0 ? study->reference_m : 0;
    for (int i = 0; i < study->n_point; i++) {
        const pal_priced_setting *p = &study->point[i].priced;
        if (!measured(&study->point[i])) continue;
        if (!isnan(within_m) && !(p->error_m + own <= within_m)) continue;
        if (!isnan(budget_ms) && !(p->ms <= budget_ms)) continue;
        if (best >= 0) {
            const pal_priced_setting *b = &study->point[best].priced;
            bool cheaper = p->ms < b->ms || (p->ms == b->ms && p->error_m < b->error_m);
            bool nearer = p->error_m < b->error_m || (p->error_m == b->error_m && p->ms < b->ms);
            if (!(isnan(within_m) ? nearer : cheaper)) continue;
        }
        best = i;
    }
    return best;
}

/* ---- along the sizes ---- */

static double edges(const pal_setting *s)
{
    if (pal_study_is(s->model, "subdivision_fem")) return exp2(s->size > 0 ? s->size : 0);
    if (pal_study_is(s->model, "adaptive_springs")) return exp2(s->size);
    return s->size;
}

static bool same_but_size(const pal_setting *a, const pal_setting *b)
{
    pal_setting p = *a, q = *b;
    if ((p.k_distance_J > 0) != (q.k_distance_J > 0)) return false;
    p.size = q.size = 1;
    p.k_distance_J = p.k_area_J = p.k_volume_J = q.k_distance_J = q.k_area_J = q.k_volume_J = 0;
    return pal_setting_same(&p, &q);
}

/* y = a + slope x by least squares */
static void line(const double *x, const double *y, int n, double *a, double *slope)
{
    double mx = 0, my = 0, xx = 0, xy = 0;
    for (int i = 0; i < n; i++) mx += x[i] / n, my += y[i] / n;
    for (int i = 0; i < n; i++) xx += (x[i] - mx) * (x[i] - mx), xy += (x[i] - mx) * (y[i] - my);
    *slope = xx > 0 ? xy / xx : 0;
    *a = my - *slope * mx;
}

/* squares of logarithms for ms = a + b n^c, the best b for a and c; *b its logarithm */
static double misfit(const double *x, const double *y, int n, double a, double c, double *b)
{
    double sum = 0, mean = 0;
    for (int i = 0; i < n; i++) {
        double left = exp(y[i]) - a;
        if (!(left > 0)) return INFINITY;
        mean += (log(left) - c * x[i]) / n;
    }
    for (int k = 0; k < 8; k++) { /* Newton for b, whose logarithm is not linear in y once a is there */
        double g = 0, h = 0;
        for (int i = 0; i < n; i++) {
            double part = exp(mean + c * x[i]), r = log(a + part) - y[i], d = part / (a + part);
            g += r * d, h += d * d;
        }
        mean -= h > 0 ? g / h : 0;
    }
    for (int i = 0; i < n; i++) {
        double r = log(a + exp(mean + c * x[i])) - y[i];
        sum += r * r;
    }
    *b = mean;
    return sum;
}

/* the best c for a, by golden section within what costs can grow by */
static double best_power(const double *x, const double *y, int n, double a, double *c, double *b)
{
    const double g = 0.6180339887498949;
    double low = 0, high = 8;
    for (int k = 0; k < 60; k++) {
        double p = high - g * (high - low), q = low + g * (high - low);
        if (misfit(x, y, n, a, p, b) < misfit(x, y, n, a, q, b))
            high = q;
        else
            low = p;
    }
    *c = (low + high) / 2;
    return misfit(x, y, n, a, *c, b);
}

/* ms = a + b n^c at `at`, a between 0 and what the cheapest costs; a straight line where there are but three points */
static double cost_at(const double *x, const double *y, int n, double at)
{
    double a, slope, b, c, least = INFINITY, straight = 0;
    for (int i = 0; i < n; i++) least = fmin(least, y[i]);
    line(x, y, n, &a, &slope);
    for (int i = 0; i < n; i++) straight += (a + slope * x[i] - y[i]) * (a + slope * x[i] - y[i]);
    if (n < 4 || straight < 1e-18 || slope <= 0) return exp(a + slope * at);
    const double g = 0.6180339887498949;
    double low = 0, high = exp(least) * 0.999999;
    for (int k = 0; k < 60; k++) {
        double p = high - g * (high - low), q = low + g * (high - low);
        if (best_power(x, y, n, p, &c, &b) < best_power(x, y, n, q, &c, &b))
            high = q;
        else
            low = p;
    }
    double from = (low + high) / 2;
    if (!(best_power(x, y, n, from, &c, &b) < straight)) return exp(a + slope * at);
    return from + exp(b + c * at);
}

static bool foresee_along(const pal_study *study, const pal_setting *s, int leave_out, double *ms, double *error_m)
{
    double x[PAL_STUDY_POINTS], y[PAL_STUDY_POINTS], z[PAL_STUDY_POINTS], a, slope, at = log(edges(s));
    int n = 0, n_size = 0;
    for (int i = 0; i < study->n_point; i++) {
        const pal_study_point *p = &study->point[i];
        if (i == leave_out || !measured(p) || !same_but_size(&p->priced.setting, s)) continue;
        x[n] = log(edges(&p->priced.setting));
        bool fresh = true;
        for (int k = 0; k < n; k++) fresh = fresh && fabs(x[k] - x[n]) > 1e-9;
        n_size += fresh;
        y[n] = log(p->priced.ms);
        z[n++] = log(fmax(p->priced.error_m, 1e-12));
    }
    if (n_size < ALONG) return false;
    *ms = cost_at(x, y, n, at);
    line(x, z, n, &a, &slope);
    *error_m = exp(a + slope * at);
    return true;
}

/* ---- all knobs of a model ---- */

static void add(double *f, const char *const *words, int n, int from, const char *word)
{
    for (int i = 0; i < n; i++) f[from + i] = pal_study_is(words[i], word);
}

static void features(const pal_setting *s, double f[FEATURES])
{
    static const char *const element[] = {"hex8", "tet4", "tet10", "refined"};
    static const char *const law[] = {"linear", "neo_hookean"};
    static const char *const solver[] = {"sdirk2", "verlet", "rk4", "central_cg", "implicit_euler"};
    memset(f, 0, FEATURES * sizeof *f);
    double n = log(edges(s) / 12), step = log(fmax(s->step_s, 1e-4) * 60);
    double tolerance = s->tolerance > 0 ? log(s->tolerance / 1e-2) : 0;
    f[0] = 1, f[1] = n, f[2] = n * n, f[3] = step, f[4] = tolerance, f[5] = s->k_distance_J > 0;
    add(f, element, 4, 6, s->element);
    add(f, law, 2, 10, s->law);
    add(f, solver, 5, 12, s->solver);
    f[17] = step * n, f[18] = tolerance * n;
    /* quadratic elements and the second stage grow otherwise with the size */
    f[19] = f[8] * n, f[20] = f[12] * n, f[21] = f[5] * n, f[22] = f[7] * n;
}

/* (F'F + ridge) w = F'y by elimination; the constant is not held back */
static void solve_knobs(double A[FEATURES][FEATURES + 2], double w[2][FEATURES])
{
    for (int i = 0; i < FEATURES; i++) A[i][i] += i == 0 ? 1e-12 : ridge;
    for (int i = 0; i < FEATURES; i++)
        for (int r = i + 1; r < FEATURES; r++) {
            double share = A[r][i] / A[i][i];
            for (int c = i; c < FEATURES + 2 && share != 0; c++) A[r][c] -= share * A[i][c];
        }
    for (int v = 0; v < 2; v++)
        for (int i = FEATURES - 1; i >= 0; i--) {
            double sum = A[i][FEATURES + v];
            for (int c = i + 1; c < FEATURES; c++) sum -= A[i][c] * w[v][c];
            w[v][i] = sum / A[i][i];
        }
}

/* knobs of which the others say nothing: a word that none of them has, a step or tolerance that none of them is near */
static bool is_strange(const pal_study *study, const pal_setting *s, int leave_out)
{
    bool element = false, law = false, solver = false, fitted = false, step = false, tolerance = false;
    for (int i = 0; i < study->n_point; i++) {
        const pal_setting *q = &study->point[i].priced.setting;
        if (i == leave_out || !measured(&study->point[i]) || !pal_study_is(q->model, s->model)) continue;
        element |= pal_study_is(q->element, s->element), law |= pal_study_is(q->law, s->law);
        solver |= pal_study_is(q->solver, s->solver), fitted |= (q->k_distance_J > 0) == (s->k_distance_J > 0);
        step |= q->step_s >= 0.5 * s->step_s && q->step_s <= 2 * s->step_s;
        tolerance |= q->tolerance >= 0.1 * s->tolerance && q->tolerance <= 10 * s->tolerance;
    }
    return !(element && law && solver && fitted && step && tolerance);
}

static bool foresee_knobs(const pal_study *study, const pal_setting *s, int leave_out, double *ms, double *error_m)
{
    double A[FEATURES][FEATURES + 2] = {{0}}, w[2][FEATURES], f[FEATURES];
    int n = 0;
    if (is_strange(study, s, leave_out)) return false;
    for (int i = 0; i < study->n_point; i++) {
        const pal_study_point *p = &study->point[i];
        if (i == leave_out || !measured(p) || !pal_study_is(p->priced.setting.model, s->model)) continue;
        features(&p->priced.setting, f);
        double y[2] = {log(p->priced.ms), log(fmax(p->priced.error_m, 1e-12))};
        for (int r = 0; r < FEATURES; r++) {
            for (int c = 0; c < FEATURES; c++) A[r][c] += f[r] * f[c];
            for (int v = 0; v < 2; v++) A[r][FEATURES + v] += f[r] * y[v];
        }
        n++;
    }
    if (n < ALONG) return false;
    solve_knobs(A, w);
    features(s, f);
    double sum[2] = {0, 0};
    for (int v = 0; v < 2; v++)
        for (int r = 0; r < FEATURES; r++) sum[v] += f[r] * w[v][r];
    *ms = exp(sum[0]), *error_m = exp(sum[1]);
    return true;
}

bool pal_study_foresee(const pal_study *study, const pal_setting *setting, int leave_out, double *ms, double *error_m)
{
    return foresee_along(study, setting, leave_out, ms, error_m) ||
           foresee_knobs(study, setting, leave_out, ms, error_m);
}

void pal_study_predict(pal_study *study)
{
    for (int i = 0; i < study->n_point; i++) {
        pal_study_point *p = &study->point[i];
        p->predicted_ms = p->predicted_m = NAN;
        if (measured(p)) pal_study_foresee(study, &p->priced.setting, i, &p->predicted_ms, &p->predicted_m);
    }
}
