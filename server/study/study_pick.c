/* The Pareto front of a study, picking from it, and predictions.
 *
 * Predicts along the sizes of configurations that are equal otherwise, where these follow a power law closely: ms =
 * a + b n^c, error = d n^-p, with n the size (edges of adaptive levels and of subdivided cells double with each).
 * Elsewhere the logarithm over all points of the model is a sum of the effects of each parameter, less the residual
 * of the nearest configurations of the same size, because the number of nodes is not a smooth function of the size. */
#include "server/base/vec3.h"
#include "server/study/study_job.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ALONG = 3, FEATURES = 24, GOLDEN = 44 };
/* ridge weight of "no effect" for each parameter, so that one that was never varied has none */
static const double ridge = 1e-4, min_m = 1e-12;
/* residual up to which a power law fits closely */
static const double close_off = 0.05;

static bool measured(const pal_study_point *p)
{
    return p->err == PAL_ERR_OK && p->measured.ms > 0 && p->measured.error_m >= 0 && isfinite(p->measured.ms) &&
           isfinite(p->measured.error_m);
}

/* False: fitted to the one load that judges it, which tells nothing about other loads. */
static bool judged(const pal_study_point *p)
{
    return measured(p) && !p->reason[0];
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

int pal_study_pick(const pal_study *study, double max_error_m, double budget_ms)
{
    int best = -1;
    if (!pal_study_trusted(study)) return -1;
    double own = study->reference_m > 0 ? study->reference_m : 0;
    for (int i = 0; i < study->n_point; i++) {
        const pal_measured_configuration *p = &study->point[i].measured;
        if (!judged(&study->point[i])) continue;
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

/* ---- along the sizes ---- */

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

/* sum of squared logarithmic residuals of ms = a + b n^c with the best b for a and c; *b: its logarithm */
static double misfit(const double *x, const double *y, int n, double a, double c, double *b)
{
    double sum = 0, mean = 0;
    for (int i = 0; i < n; i++) {
        double left = exp(y[i]) - a;
        if (!(left > 0)) return INFINITY;
        mean += (log(left) - c * x[i]) / n;
    }
    for (int k = 0; k < 4; k++) { /* Newton's method for ln b, which is nonlinear once a is present */
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

/* best c for a, by golden section within the plausible growth */
static double best_power(const double *x, const double *y, int n, double a, double *c, double *b)
{
    const double g = 0.6180339887498949;
    double low = 0, high = 8;
    for (int k = 0; k < GOLDEN; k++) {
        double p = high - g * (high - low), q = low + g * (high - low);
        if (misfit(x, y, n, a, p, b) < misfit(x, y, n, a, q, b))
            high = q;
        else
            low = p;
    }
    *c = (low + high) / 2;
    return misfit(x, y, n, a, *c, b);
}

/* y = ln (a + exp (b + c x)) */
typedef struct cost_law {
    double a, b, c;
} cost_law;

static double cost_at(const cost_law *law, double x)
{
    return law->a + exp(law->b + law->c * x);
}

/* ms = a + b n^c with a between 0 and the cheapest cost; a straight line if there are only three points */
static cost_law fit_cost(const double *x, const double *y, int n)
{
    double intercept, slope, b, c, min = INFINITY, straight = 0;
    for (int i = 0; i < n; i++) min = fmin(min, y[i]);
    line(x, y, n, &intercept, &slope);
    for (int i = 0; i < n; i++) straight += (intercept + slope * x[i] - y[i]) * (intercept + slope * x[i] - y[i]);
    const cost_law power = {0, intercept, slope};
    if (n < 4 || straight < 1e-18 || slope <= 0) return power;
    const double g = 0.6180339887498949;
    double low = 0, high = exp(min) * 0.999999;
    for (int k = 0; k < GOLDEN; k++) {
        double p = high - g * (high - low), q = low + g * (high - low);
        if (best_power(x, y, n, p, &c, &b) < best_power(x, y, n, q, &c, &b))
            high = q;
        else
            low = p;
    }
    cost_law out = {.a = (low + high) / 2};
    return best_power(x, y, n, out.a, &out.c, &out.b) < straight ? out : power;
}

/* a law along the sizes: its value at `at`, its RMS logarithmic residual */
typedef struct along {
    int n_size;
    double value, off;
} along;

static along law_along(const double *x, const double *y, int n, double at, bool cost)
{
    along out = {.n_size = 0};
    for (int i = 0; i < n; i++) {
        bool fresh = true;
        for (int k = 0; k < i; k++) fresh = fresh && fabs(x[k] - x[i]) > 1e-9;
        out.n_size += fresh;
    }
    if (out.n_size < ALONG) return out;
    double a, slope;
    line(x, y, n, &a, &slope);
    const cost_law law = cost ? fit_cost(x, y, n) : (cost_law){0, a, slope};
    out.value = cost_at(&law, at);
    for (int i = 0; i < n; i++) {
        double r = log(cost_at(&law, x[i])) - y[i];
        out.off += r * r / n;
    }
    out.off = sqrt(out.off);
    return out;
}

static void look_along(const pal_study *study, const pal_configuration *s, int leave_out, along out[2])
{
    double x[PAL_STUDY_POINTS], y[2][PAL_STUDY_POINTS], at = log(edges(s));
    int n = 0;
    for (int i = 0; i < study->n_point; i++) {
        const pal_study_point *p = &study->point[i];
        if (i == leave_out || !measured(p) || !same_but_size(&p->measured.setting, s)) continue;
        x[n] = log(edges(&p->measured.setting));
        y[0][n] = log(p->measured.ms);
        y[1][n++] = log(fmax(p->measured.error_m, min_m));
    }
    for (int v = 0; v < 2; v++) out[v] = law_along(x, y[v], n, at, v == 0);
}

/* ---- all parameters of a model ---- */

static void add(double *f, const char *const *words, int n, int from, const char *word)
{
    for (int i = 0; i < n; i++) f[from + i] = pal_study_is(words[i], word);
}

static void features(const pal_configuration *s, double f[FEATURES])
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
    /* quadratic elements and the second stage grow with the size at another rate */
    f[19] = f[8] * n, f[20] = f[12] * n, f[21] = f[5] * n, f[22] = f[7] * n;
}

/* Solves (F'F + ridge) w = F'y by elimination; the constant term is not regularised. */
static void solve_parameters(double A[FEATURES][FEATURES + 2], double w[2][FEATURES])
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

/* Parameters without data in the other points: a word that none of them has, a step or tolerance far from all of
 * them. */
static bool is_strange(const pal_study *study, const pal_configuration *s, int leave_out)
{
    bool element = false, law = false, solver = false, fitted = false, step = false, tolerance = false;
    for (int i = 0; i < study->n_point; i++) {
        const pal_configuration *q = &study->point[i].measured.setting;
        if (i == leave_out || !measured(&study->point[i]) || !pal_study_is(q->model, s->model)) continue;
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

/* number of different parameters */
static int differences(const pal_configuration *a, const pal_configuration *b)
{
    return !pal_study_is(a->element, b->element) + !pal_study_is(a->law, b->law) + !pal_study_is(a->solver, b->solver) +
           (a->step_s != b->step_s) + (a->tolerance != b->tolerance) + ((a->k_distance_J > 0) != (b->k_distance_J > 0));
}

static bool is_mate(const pal_study *study, int i, const pal_configuration *s, int leave_out)
{
    const pal_study_point *p = &study->point[i];
    return i != leave_out && measured(p) && pal_study_is(p->measured.setting.model, s->model);
}

/* Predicted logarithms of ms and error; *mates: number of other configurations of the same size. */
static bool look_at_parameters(const pal_study *study, const pal_configuration *s, int leave_out, double out[2],
                               int *mates)
{
    double A[FEATURES][FEATURES + 2] = {{0}}, w[2][FEATURES], f[FEATURES], g[FEATURES], off[2] = {0, 0}, weight = 0;
    int n = 0;
    *mates = 0;
    if (is_strange(study, s, leave_out)) return false;
    for (int i = 0; i < study->n_point; i++) {
        const pal_measured_configuration *p = &study->point[i].measured;
        if (!is_mate(study, i, s, leave_out)) continue;
        features(&p->setting, f);
        double y[2] = {log(p->ms), log(fmax(p->error_m, min_m))};
        for (int r = 0; r < FEATURES; r++) {
            for (int c = 0; c < FEATURES; c++) A[r][c] += f[r] * f[c];
            for (int v = 0; v < 2; v++) A[r][FEATURES + v] += f[r] * y[v];
        }
        n++;
    }
    if (n < ALONG) return false;
    solve_parameters(A, w);
    features(s, f);
    for (int i = 0; i < study->n_point; i++) {
        const pal_measured_configuration *p = &study->point[i].measured;
        if (!is_mate(study, i, s, leave_out) || p->setting.size != s->size) continue;
        double near = exp2(-2 * differences(&p->setting, s));
        features(&p->setting, g);
        off[0] += near * (log(p->ms) - sum_of(w[0], g));
        off[1] += near * (log(fmax(p->error_m, min_m)) - sum_of(w[1], g));
        weight += near;
        (*mates)++;
    }
    for (int v = 0; v < 2; v++) out[v] = sum_of(w[v], f) + (weight > 0 ? off[v] / weight : 0);
    return true;
}

bool pal_study_predict_configuration(const pal_study *study, const pal_configuration *setting, int leave_out,
                                     double *ms, double *error_m)
{
    along line_of[2];
    double parameters[2], *out[2] = {ms, error_m};
    int mates = 0;
    look_along(study, setting, leave_out, line_of);
    bool known = look_at_parameters(study, setting, leave_out, parameters, &mates);
    if (!known && line_of[0].n_size < ALONG) return false;
    for (int v = 0; v < 2; v++) {
        bool closely = line_of[v].n_size > ALONG && line_of[v].off < close_off;
        bool by_line = line_of[v].n_size >= ALONG && (closely || !known || mates == 0);
        *out[v] = by_line ? line_of[v].value : exp(parameters[v]);
    }
    return true;
}

void pal_study_predict(pal_study *study)
{
    for (int i = 0; i < study->n_point; i++) {
        pal_study_point *p = &study->point[i];
        p->predicted_ms = p->predicted_m = NAN;
        if (!measured(p)) continue;
        pal_study_predict_configuration(study, &p->measured.setting, i, &p->predicted_ms, &p->predicted_m);
        pal_study_predict_cost(study, &p->measured.setting, p->n_node, p->n_element, p->n_substep, p->read_ms, i,
                               &p->predicted_ms);
    }
}
