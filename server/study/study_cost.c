/* Predicts the cost of a configuration from the measured cost of the other configurations of its model and from
 * counts known before it runs.
 *
 * A step takes a + sub-steps (elements (e + t) + c q) r.
 *   a  constant part of a step, whatever is solved (mainly the skin)
 *   e  share of an element
 *   t  addition where the law has an exact tangent (neo_hookean: every step rebuilds all element matrices)
 *   q  time to read the solver's factor on this machine (slower for data that exceeds the caches)
 *   r  time of an element in a sub-step; its logarithm is a sum of the effects of each parameter and of growth with
 *      the nodes
 * Bodies without elements (springs) count nodes. a, c, t and the sum are fitted to the other configurations by least
 * squares of logarithms; the residual of those close in parameters and nodes is then subtracted. */
#include "server/study/study_job.h"
#include "server/study/tuning.h"

#include <math.h>
#include <string.h>

enum { MIN = 3, FEATURES = 18, GRID = 24, GOLDEN = 40, RATES = 16, ROUNDS = 4, ROUGH = 6 };

typedef struct seen {
    const pal_configuration *configuration;
    double n_node, n_element, n_substep, ms; /* of one of its steps */
    double read_ms;
    double f[FEATURES];
} seen;

enum { TANGENT = 11 }; /* index of the feature whose weight is ln t */
typedef struct cost_law {
    double a, c, w[FEATURES], misfit; /* c: elements per ms of reading */
} cost_law;

static void features(const pal_configuration *s, double n_node, double f[FEATURES])
{
    static const char *const word[] = {"hex8",        "tet4",   "tet10",      "refined",       "linear",
                                       "neo_hookean", "sdirk2", "central_cg", "implicit_euler"};
    double n = log(n_node / 1e3), step = log(fmax(s->step_s, 1e-4) * 60);
    double tolerance = s->tolerance > 0 ? log(s->tolerance / 1e-2) : 0;
    memset(f, 0, FEATURES * sizeof *f);
    f[0] = 1, f[1] = n, f[2] = 0.3 * n * n, f[3] = step, f[4] = tolerance, f[5] = s->k_distance_J > 0;
    for (int k = 0; k < 9; k++)
        f[6 + k] =
            pal_study_is(s->element, word[k]) || pal_study_is(s->law, word[k]) || pal_study_is(s->solver, word[k]);
    f[15] = 0.3 * step * n, f[16] = 0.3 * tolerance * n;
    /* the second stage grows with the nodes at another rate */
    f[17] = 0.5 * f[12] * n;
}

/* With few configurations the parameters are poorly determined, and elements times sub-steps predict best. */
static double hold_of(int n)
{
    return PAL_COST_RIDGE * fmax(1, pow(PAL_COST_ENOUGH / n, 2));
}

/* Features that scale the element work but not the read time of a factor, whose entries are counted: element types,
 * and a law without rotation. */
static bool is_of_elements(int feature)
{
    return feature == 6 || feature == 7 || feature == 8 || feature == 10;
}

/* time of all sub-steps of a step; slope (may be NULL): derivative of its logarithm by each weight */
static double work_ms(const cost_law *law, const seen *p, double slope[FEATURES])
{
    double sum = 0, own = 0;
    for (int r = 0; r < FEATURES; r++)
        if (r != TANGENT) *(is_of_elements(r) ? &own : &sum) += law->w[r] * p->f[r];
    double through = p->n_element * exp(own), tangent = p->f[TANGENT] * p->n_element * exp(law->w[TANGENT]),
           all = through + tangent + law->c * p->read_ms;
    for (int r = 0; r < FEATURES && slope; r++)
        slope[r] = p->f[r] * (r == TANGENT ? tangent / all : is_of_elements(r) ? through / all : 1);
    return p->n_substep * all * exp(sum);
}

/* best sum for given a (below all costs) and c */
static cost_law fit(const seen *p, int n, double a, double c)
{
    cost_law law = {.a = a, .c = c};
    bool sums = c > 0;
    for (int i = 0; i < n; i++) sums |= p[i].f[TANGENT] > 0;
    /* a single product is linear in the logarithm; sums need a few Gauss-Newton iterations */
    for (int round = 0; round < (sums ? ROUNDS : 1); round++) {
        double A[FEATURES][FEATURES + 1] = {{0}};
        for (int i = 0; i < n; i++) {
            double slope[FEATURES], y = log((p[i].ms - a) / work_ms(&law, &p[i], slope));
            for (int r = 0; r < FEATURES; r++) y += slope[r] * law.w[r];
            for (int r = 0; r < FEATURES; r++) {
                for (int k = 0; k < FEATURES; k++) A[r][k] += slope[r] * slope[k];
                A[r][FEATURES] += slope[r] * y;
            }
        }
        pal_study_ridge(A[0], FEATURES, hold_of(n), law.w);
    }
    for (int i = 0; i < n; i++) {
        double off = log((a + work_ms(&law, &p[i], NULL)) / p[i].ms);
        law.misfit += off * off;
    }
    for (int r = 1; r < FEATURES; r++) law.misfit += hold_of(n) * law.w[r] * law.w[r];
    return law;
}

static double cheapest(const seen *p, int n)
{
    double min = INFINITY;
    for (int i = 0; i < n; i++) min = fmin(min, p[i].ms);
    return 0.999 * min;
}

/* a between zero and the cheapest step: best of a grid */
static cost_law on_grid(const seen *p, int n, double c, int grid)
{
    double max = cheapest(p, n);
    cost_law best = fit(p, n, 0, c);
    for (int k = 1; k <= grid; k++) {
        cost_law next = fit(p, n, max * k / grid, c);
        if (next.misfit < best.misfit) best = next;
    }
    return best;
}

/* c: zero, or up to where reading dominates all else in the body that reads slowest; then a by golden section */
static cost_law best_fit(const seen *p, int n)
{
    const double g = 0.6180339887498949;
    double slowest = 0, max = cheapest(p, n);
    for (int i = 0; i < n; i++) slowest = fmax(slowest, p[i].read_ms / p[i].n_node);
    cost_law best = on_grid(p, n, 0, GRID);
    for (int k = 0; k < RATES && slowest > 0; k++) {
        cost_law next = on_grid(p, n, exp2(k - RATES / 2) / slowest, ROUGH);
        if (next.misfit < best.misfit) best = next;
    }
    if (best.c > 0) best = on_grid(p, n, best.c, GRID);
    double low = fmax(best.a - max / GRID, 0), high = fmin(best.a + max / GRID, max);
    for (int k = 0; k < GOLDEN; k++) {
        double p_at = high - g * (high - low), q_at = low + g * (high - low);
        cost_law at = fit(p, n, p_at, best.c), other = fit(p, n, q_at, best.c);
        if (at.misfit < other.misfit)
            high = q_at;
        else
            low = p_at;
        if (at.misfit < best.misfit) best = at;
        if (other.misfit < best.misfit) best = other;
    }
    return best;
}

static bool is_adaptive(const pal_configuration *s)
{
    return pal_study_is(s->model, "adaptive_springs") && !pal_study_is(s->element, "refined") && s->size > 1;
}

static bool counts(const pal_study *study, int i, int leave_out, const pal_configuration *s)
{
    const pal_study_point *p = &study->point[i];
    return i != leave_out && !p->err && p->measured.ms > 0 && isfinite(p->measured.ms) && p->n_node > 0 &&
           p->n_substep > 0 && p->measured.configuration.step_s > 0 &&
           pal_study_is(p->measured.configuration.model, s->model);
}

/* Nodes of a fully refined adaptive body: as counted for that configuration, otherwise four times as many per
 * level. */
static double refined_nodes(const pal_study *study, int leave_out, const pal_configuration *s, double coarse)
{
    for (int i = 0; i < study->n_point; i++) {
        const pal_configuration *q = &study->point[i].measured.configuration;
        if (counts(study, i, leave_out, s) && pal_study_is(q->element, "refined") && q->size == s->size)
            return study->point[i].n_node;
    }
    return coarse * exp2(2 * (s->size - 1));
}

/* Sub-steps on the finest level, which a single refined face requires: as counted where fully refined, otherwise
 * twice as many per level. */
static double finest_substeps(const pal_study *study, int leave_out, const pal_configuration *s)
{
    double coarse = NAN;
    for (int i = 0; i < study->n_point; i++) {
        const pal_study_point *p = &study->point[i];
        const pal_configuration *q = &p->measured.configuration;
        if (!counts(study, i, leave_out, s)) continue;
        /* sub-steps of its own step */
        double n = p->n_substep * s->step_s / q->step_s;
        if (pal_study_is(q->element, "refined") && q->size == s->size) return n;
        if (q->size == 1) coarse = n * exp2(s->size - 1);
    }
    return coarse;
}

/* Predicted active nodes: the share of the possible refinement observed at other levels. NaN: no other levels. */
static double nodes_in_use(const pal_study *study, int leave_out, const pal_configuration *s)
{
    double coarse = NAN, share = 0;
    int n = 0;
    for (int i = 0; i < study->n_point; i++)
        if (counts(study, i, leave_out, s) && study->point[i].measured.configuration.size == 1)
            coarse = study->point[i].n_node;
    for (int i = 0; i < study->n_point; i++) {
        const pal_study_point *p = &study->point[i];
        if (!counts(study, i, leave_out, s) || !is_adaptive(&p->measured.configuration)) continue;
        double full = refined_nodes(study, leave_out, &p->measured.configuration, coarse);
        share += (p->n_node - coarse) / (full - coarse);
        n++;
    }
    return n > 0 ? coarse + share / n * (refined_nodes(study, leave_out, s, coarse) - coarse) : (double)NAN;
}

static bool has_words(const seen *p, int n, const pal_configuration *s)
{
    bool element = false, law = false, solver = false;
    for (int i = 0; i < n; i++) {
        element |= pal_study_is(p[i].configuration->element, s->element),
            law |= pal_study_is(p[i].configuration->law, s->law);
        solver |= pal_study_is(p[i].configuration->solver, s->solver);
    }
    return element && law && solver;
}

bool pal_study_predict_cost(const pal_study *study, const pal_configuration *s, int n_node, double n_element,
                            int n_substep, double read_ms, int leave_out, double *ms)
{
    seen p[PAL_STUDY_POINTS];
    int n = 0;
    double nodes = is_adaptive(s) ? nodes_in_use(study, leave_out, s) : n_node, off = 0, weight = PAL_COST_NEIGHBOUR;
    double substeps = is_adaptive(s) ? finest_substeps(study, leave_out, s) : n_substep;
    /* where elements are not known of all points, nodes replace them: springs, studies stored before elements were */
    bool by_element = n_element > 0;
    for (int i = 0; i < study->n_point; i++)
        if (counts(study, i, leave_out, s)) by_element = by_element && study->point[i].n_element > 0;
    if (!(nodes > 0) || !(substeps >= 1) || !(s->step_s > 0) || !(study->step_s > 0)) return false;
    for (int i = 0; i < study->n_point; i++) {
        const pal_study_point *q = &study->point[i];
        if (!counts(study, i, leave_out, s)) continue;
        p[n] = (seen){.configuration = &q->measured.configuration,
                      .n_node = q->n_node,
                      .n_element = by_element ? q->n_element : q->n_node,
                      .n_substep = q->n_substep,
                      .read_ms = q->read_ms};
        p[n].ms = q->measured.ms * q->measured.configuration.step_s / study->step_s;
        features(p[n].configuration, p[n].n_node, p[n].f);
        n++;
    }
    if (n < MIN || !has_words(p, n, s)) return false;
    cost_law law = best_fit(p, n);
    for (int i = 0; i < n; i++) {
        double distance =
            pal_study_differences(p[i].configuration, s) + PAL_COST_PER_E * fabs(log(p[i].n_node / nodes));
        double near = exp2(-2 * distance);
        off += near * log((p[i].ms - law.a) / work_ms(&law, &p[i], NULL));
        weight += near;
    }
    seen own = {.configuration = s,
                .n_node = nodes,
                .n_element = by_element ? n_element : nodes,
                .n_substep = substeps,
                .read_ms = read_ms};
    features(s, nodes, own.f);
    *ms = (law.a + work_ms(&law, &own, NULL) * exp(off / weight)) * study->step_s / s->step_s;
    return true;
}
