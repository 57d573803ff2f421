/* The Pareto front of a study, picking from it, and the prediction of errors.
 *
 * Predicts along the sizes of configurations that are equal otherwise, where these follow a power law closely: error =
 * d n^-p, with n the size (edges of adaptive levels and of subdivided cells double with each). Elsewhere the logarithm
 * over all points of the model is a sum of the effects of each parameter, less the residual of the nearest
 * configurations of the same size. */
#include "server/study/study_job.h"
#include "server/study/tuning.h"

#include <math.h>
#include <string.h>

enum { ALONG = 3, FEATURES = 24 };

/* False: fitted to the one load that judges it, which tells nothing about other loads. */
static bool judged(const pal_study_point *p)
{
    return pal_study_measured(p) && !p->reason[0];
}

bool pal_study_trusted(const pal_study *study)
{
    return !(study->max_m > 0 && study->reference_m > PAL_STUDY_TRUST * study->max_m);
}

/* error, at least that of the reference: smaller differences are not significant */
static double far_of(const pal_study *study, const pal_measured_configuration *p)
{
    return study->reference_m > p->error_m ? study->reference_m : p->error_m;
}

void pal_study_mark_front(pal_study *study)
{
    for (int i = 0; i < study->n_point; i++) {
        pal_measured_configuration *p = &study->point[i].measured;
        p->front = pal_study_trusted(study) && judged(&study->point[i]);
        for (int k = 0; k < study->n_point && p->front; k++) {
            const pal_measured_configuration *q = &study->point[k].measured;
            if (!judged(&study->point[k]) || k == i) continue;
            double far = far_of(study, p), other = far_of(study, q);
            bool no_worse = q->ms <= p->ms && other <= far, better = q->ms < p->ms || other < far;
            p->front = !(no_worse && (better || k < i));
        }
    }
}

int pal_study_pick(const pal_study *study, const char *methods, double max_error_m, double budget_ms)
{
    int best = -1;
    if (!pal_study_trusted(study)) return -1;
    double own = study->reference_m > 0 ? study->reference_m : 0;
    for (int i = 0; i < study->n_point; i++) {
        const pal_measured_configuration *p = &study->point[i].measured;
        if (!judged(&study->point[i]) || !pal_study_method_in(methods, p->configuration.model)) continue;
        if (!isnan(max_error_m) && !(p->error_m + own <= max_error_m)) continue;
        if (!isnan(budget_ms) && !(p->ms <= budget_ms)) continue;
        if (best >= 0) {
            const pal_measured_configuration *b = &study->point[best].measured;
            double far = far_of(study, p), min = far_of(study, b);
            bool cheaper = p->ms < b->ms || (p->ms == b->ms && p->error_m < b->error_m);
            bool nearer = far < min || (far == min && p->ms < b->ms);
            if (!(isnan(max_error_m) ? nearer : cheaper)) continue;
        }
        best = i;
    }
    return best;
}

static double edges(const pal_configuration *s)
{
    if (pal_study_is(s->model, "subdivision_fem")) return exp2(s->size > 0 ? s->size : 0);
    if (pal_study_is(s->model, "adaptive_springs")) return exp2(s->size);
    return s->size;
}

static bool same_but_size(const pal_configuration *a, const pal_configuration *b)
{
    pal_configuration p = *a, q = *b;
    if ((p.k_distance_J > 0) != (q.k_distance_J > 0)) return false;
    p.size = q.size = 1;
    p.k_distance_J = p.k_area_J = p.k_volume_J = q.k_distance_J = q.k_area_J = q.k_volume_J = 0;
    return pal_configuration_equal(&p, &q);
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

/* a power law along the sizes: number of sizes, value at those of `s`, RMS logarithmic residual */
typedef struct along {
    int n_size;
    double value, off;
} along;

static along find_law(const pal_study *study, const pal_configuration *s, int leave_out)
{
    double x[PAL_STUDY_POINTS], y[PAL_STUDY_POINTS], a, slope;
    int n = 0;
    along out = {.n_size = 0};
    for (int i = 0; i < study->n_point; i++) {
        const pal_study_point *p = &study->point[i];
        if (i == leave_out || !pal_study_measured(p) || !same_but_size(&p->measured.configuration, s)) continue;
        x[n] = log(edges(&p->measured.configuration));
        y[n] = log(fmax(p->measured.error_m, PAL_MIN_ERROR_M));
        bool fresh = true;
        for (int k = 0; k < n; k++) fresh = fresh && fabs(x[k] - x[n]) > 1e-9;
        out.n_size += fresh;
        n++;
    }
    if (out.n_size < ALONG) return out;
    line(x, y, n, &a, &slope);
    out.value = exp(a + slope * log(edges(s)));
    for (int i = 0; i < n; i++) out.off += pow(a + slope * x[i] - y[i], 2) / n;
    out.off = sqrt(out.off);
    return out;
}

static void features(const pal_configuration *s, double f[FEATURES])
{
    static const char *const word[] = {"hex8",   "tet4",   "tet10", "refined",    "linear",        "neo_hookean",
                                       "sdirk2", "verlet", "rk4",   "central_cg", "implicit_euler"};
    memset(f, 0, FEATURES * sizeof *f);
    double n = log(edges(s) / 12), step = log(fmax(s->step_s, 1e-4) * 60);
    double tolerance = s->tolerance > 0 ? log(s->tolerance / 1e-2) : 0;
    f[0] = 1, f[1] = n, f[2] = n * n, f[3] = step, f[4] = tolerance, f[5] = s->k_distance_J > 0;
    for (int k = 0; k < 11; k++)
        f[6 + k] =
            pal_study_is(s->element, word[k]) || pal_study_is(s->law, word[k]) || pal_study_is(s->solver, word[k]);
    f[17] = step * n, f[18] = tolerance * n;
    /* quadratic elements and the second stage grow with the size at another rate */
    f[19] = f[8] * n, f[20] = f[12] * n, f[21] = f[5] * n, f[22] = f[7] * n;
}

void pal_study_ridge(double *A, int n, double hold, double *w)
{
    const int wide = n + 1;
    for (int i = 0; i < n; i++) A[i * wide + i] += i == 0 ? 1e-12 : hold;
    for (int i = 0; i < n; i++)
        for (int r = i + 1; r < n; r++) {
            double share = A[r * wide + i] / A[i * wide + i];
            for (int c = i; c < wide && share != 0; c++) A[r * wide + c] -= share * A[i * wide + c];
        }
    for (int i = n - 1; i >= 0; i--) {
        double sum = A[i * wide + n];
        for (int c = i + 1; c < n; c++) sum -= A[i * wide + c] * w[c];
        w[i] = sum / A[i * wide + i];
    }
}

static bool is_mate(const pal_study *study, int i, const pal_configuration *s, int leave_out)
{
    const pal_study_point *p = &study->point[i];
    return i != leave_out && pal_study_measured(p) && pal_study_is(p->measured.configuration.model, s->model);
}

/* Parameters without data in the other points: a word that none of them has, a step or tolerance far from all of
 * them. */
static bool is_strange(const pal_study *study, const pal_configuration *s, int leave_out)
{
    bool element = false, law = false, solver = false, fitted = false, step = false, tolerance = false;
    for (int i = 0; i < study->n_point; i++) {
        const pal_configuration *q = &study->point[i].measured.configuration;
        if (!is_mate(study, i, s, leave_out)) continue;
        element |= pal_study_is(q->element, s->element), law |= pal_study_is(q->law, s->law);
        solver |= pal_study_is(q->solver, s->solver), fitted |= (q->k_distance_J > 0) == (s->k_distance_J > 0);
        step |= q->step_s >= 0.5 * s->step_s && q->step_s <= 2 * s->step_s;
        tolerance |= q->tolerance >= 0.1 * s->tolerance && q->tolerance <= 10 * s->tolerance;
    }
    return !(element && law && solver && fitted && step && tolerance);
}

static double sum_of(const double w[FEATURES], const double f[FEATURES])
{
    double sum = 0;
    for (int r = 0; r < FEATURES; r++) sum += w[r] * f[r];
    return sum;
}

int pal_study_differences(const pal_configuration *a, const pal_configuration *b)
{
    return !pal_study_is(a->element, b->element) + !pal_study_is(a->law, b->law) + !pal_study_is(a->solver, b->solver) +
           (a->step_s != b->step_s) + (a->tolerance != b->tolerance) + ((a->k_distance_J > 0) != (b->k_distance_J > 0));
}

/* *logarithm: predicted ln error_m; *mates: number of other configurations of the same size */
static bool fit_parameters(const pal_study *study, const pal_configuration *s, int leave_out, double *logarithm,
                           int *mates)
{
    double A[FEATURES][FEATURES + 1] = {{0}}, w[FEATURES], f[FEATURES], off = 0, weight = 0;
    int n = 0;
    *mates = 0;
    if (is_strange(study, s, leave_out)) return false;
    for (int i = 0; i < study->n_point; i++) {
        const pal_measured_configuration *p = &study->point[i].measured;
        if (!is_mate(study, i, s, leave_out)) continue;
        features(&p->configuration, f);
        for (int r = 0; r < FEATURES; r++) {
            for (int c = 0; c < FEATURES; c++) A[r][c] += f[r] * f[c];
            A[r][FEATURES] += f[r] * log(fmax(p->error_m, PAL_MIN_ERROR_M));
        }
        n++;
    }
    if (n < ALONG) return false;
    pal_study_ridge(A[0], FEATURES, PAL_ERROR_RIDGE, w);
    for (int i = 0; i < study->n_point; i++) {
        const pal_measured_configuration *p = &study->point[i].measured;
        if (!is_mate(study, i, s, leave_out) || p->configuration.size != s->size) continue;
        double near = exp2(-2 * pal_study_differences(&p->configuration, s));
        features(&p->configuration, f);
        off += near * (log(fmax(p->error_m, PAL_MIN_ERROR_M)) - sum_of(w, f));
        weight += near;
        (*mates)++;
    }
    features(s, f);
    *logarithm = sum_of(w, f) + (weight > 0 ? off / weight : 0);
    return true;
}

bool pal_study_predict_error(const pal_study *study, const pal_configuration *configuration, int leave_out,
                             double *error_m)
{
    double logarithm = 0;
    int mates = 0;
    along law = find_law(study, configuration, leave_out);
    bool known = fit_parameters(study, configuration, leave_out, &logarithm, &mates);
    if (!known && law.n_size < ALONG) return false;
    bool closely = law.n_size > ALONG && law.off < PAL_LAW_RMS;
    bool by_law = law.n_size >= ALONG && (closely || !known || mates == 0);
    *error_m = by_law ? law.value : exp(logarithm);
    return true;
}

void pal_study_predict(pal_study *study)
{
    for (int i = 0; i < study->n_point; i++) {
        pal_study_point *p = &study->point[i];
        p->predicted_ms = p->predicted_m = NAN;
        if (!pal_study_measured(p)) continue;
        pal_study_predict_error(study, &p->measured.configuration, i, &p->predicted_m);
        pal_study_predict_cost(study, &p->measured.configuration, p->n_node, p->n_element, p->n_substep, p->read_ms, i,
                               &p->predicted_ms);
    }
}
