/* The configurations of a study: one parameter at a time varied from a base, at several sizes, so that the effect
 * of each parameter is measured at each size. The base has the scene's step. */
#include "server/study/study_job.h"
#include "server/study/tuning.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { BASE_LEVELS = 3 };

typedef struct list {
    const pal_study_job *job;
    pal_study_entry *out;
    int n;
} list;

static void put(char to[PAL_NAME], const char *word)
{
    snprintf(to, PAL_NAME, "%s", word);
}

static void add(list *l, const pal_configuration *configuration, bool calibrate)
{
    if (l->n < PAL_STUDY_POINTS) l->out[l->n++] = (pal_study_entry){*configuration, calibrate};
}

static bool wants(const list *l, const char *model)
{
    const pal_study_options *o = l->job->options;
    bool named = o->n_method == 0;
    for (int i = 0; i < o->n_method; i++) named |= pal_study_is(o->method[i], model);
    return named && !pal_configuration_check_model(&l->job->scene->body[0], model, NULL);
}

int pal_study_fit_size(const pal_study_job *job, double wanted)
{
    double longest = fmax(job->box_m[0], fmax(job->box_m[1], job->box_m[2])), min = INFINITY;
    int best = (int)lround(wanted);
    for (int n = (int)ceil(wanted / 1.35); n <= wanted * 1.35 && longest > 0; n++) {
        double off = fabs(log(n / wanted));
        for (int c = 0; c < 3; c++) {
            double voxels = job->box_m[c] * n / longest;
            off += 4 * fmax(ceil(voxels - 1e-6) - voxels, 0);
        }
        if (off < min) min = off, best = n;
    }
    return best;
}

int pal_study_size(const pal_study_job *job, int compact)
{
    return pal_study_fit_size(job, compact * job->slender);
}

/* the sizes of the sweep, ascending; returns the count */
static int sweep_sizes(const pal_study_job *job, int out[16])
{
    static const int whole[] = {8, 11, 16, 22, 30, 40}, quick[] = {6, 8, 12};
    const int *size = job->options->quick ? quick : whole;
    int n = 0, n_size = job->options->quick ? 3 : 6;
    for (int i = 0; i < n_size; i++) {
        int fitted = pal_study_size(job, size[i]);
        if (fitted * PAL_REFERENCE_FINER <= job->reference && (n == 0 || fitted > out[n - 1])) out[n++] = fitted;
    }
    return n;
}

/* A quarter and a half of the scene's step, the step of a haptic device if different, and twice the scene's step up
 * to a frame's. Returns the count. */
static int other_steps(double own_s, double out[4])
{
    int n = 0;
    out[n++] = own_s / 4, out[n++] = own_s / 2;
    if (own_s / 4 > 1.5 * PAL_STUDY_HAPTIC_S) out[n++] = PAL_STUDY_HAPTIC_S;
    if (2 * own_s <= PAL_STUDY_FRAME_S * (1 + 1e-9)) out[n++] = 2 * own_s;
    return n;
}

/* varies solver, step and tolerance at one size; the rest is the base's */
static void add_times(list *l, const pal_configuration *base, bool whole)
{
    static const double tolerance[] = {1e-1, 1e-4};
    double step_s[4];
    int n_step = other_steps(base->step_s, step_s);
    pal_configuration s = *base;
    put(s.solver, "sdirk2");
    add(l, &s, false);
    for (int k = 0; k < (whole ? n_step : 1); k++) {
        s = *base, s.step_s = step_s[k];
        add(l, &s, false);
    }
    for (int k = 0; k < 2 && whole; k++) {
        s = *base, s.tolerance = tolerance[k];
        add(l, &s, false);
    }
}

static void add_fem(list *l)
{
    static const char *const element[] = {"tet4", "hex8", "tet10"};
    static const char *const law[] = {"corotational", "neo_hookean", "linear"};
    int size[16], n = sweep_sizes(l->job, size);
    for (int i = 0; i < n; i++) {
        bool quick = l->job->options->quick, star = quick ? i == n - 2 || n == 1 : i < 4;
        pal_configuration s, base = {.model = "fem",
                                     .element = "hex8_bbar",
                                     .solver = "implicit_euler",
                                     .size = size[i],
                                     .step_s = l->job->scene->step_s,
                                     .tolerance = PAL_STUDY_TOLERANCE};
        put(base.law, l->job->law);
        add(l, &base, false);
        if (star || !quick) add_times(l, &base, star && !quick);
        for (int k = 0; k < (star ? (quick ? 1 : 3) : quick ? 0 : 1); k++) {
            s = base, put(s.element, element[k]);
            add(l, &s, false);
        }
        for (int k = 0; k < 3 && star && !quick; k++) {
            if (pal_study_is(law[k], l->job->law)) continue;
            s = base, put(s.law, law[k]);
            add(l, &s, false);
        }
    }
}

static void add_springs(list *l)
{
    int size[16], n = sweep_sizes(l->job, size);
    bool quick = l->job->options->quick;
    for (int i = quick && n > 1 ? n - 2 : 0; i < n && i < (quick ? (n > 1 ? n - 1 : 1) : 4); i++)
        for (int calibrate = 0; calibrate < 2; calibrate++) {
            pal_configuration s = {
                .model = "tet_springs", .solver = "verlet", .size = size[i], .step_s = l->job->scene->step_s};
            add(l, &s, calibrate);
            s.step_s /= 4;
            if (!quick) add(l, &s, calibrate);
        }
}

static void add_shells(list *l)
{
    int finest = l->job->options->quick ? BASE_LEVELS - 1 : BASE_LEVELS;
    for (int levels = 1; levels <= finest && levels < l->job->reference; levels++)
        for (int refined = 0; refined < (levels > 1 ? 2 : 1); refined++) {
            pal_configuration s = {
                .model = "adaptive_springs", .solver = "rk4", .size = levels, .step_s = l->job->scene->step_s};
            if (refined) put(s.element, "refined");
            add(l, &s, false);
        }
}

static void add_solids(list *l)
{
    static const int levels[] = {-1, 1, 2};
    static const char *const solver[] = {"central_cg", "implicit_euler"};
    for (int i = 0; i < (l->job->options->quick ? 2 : 3); i++)
        for (int k = 0; k < 2; k++) {
            pal_configuration s = {.model = "subdivision_fem", .size = levels[i], .step_s = l->job->scene->step_s};
            put(s.solver, solver[k]);
            if (k == 1) s.tolerance = PAL_STUDY_TOLERANCE;
            add(l, &s, false);
        }
}

int pal_study_list(const pal_study_job *job, pal_study_entry out[PAL_STUDY_POINTS])
{
    list l = {job, out, 0};
    if (wants(&l, "fem")) add_fem(&l);
    if (wants(&l, "tet_springs")) add_springs(&l);
    if (wants(&l, "subdivision_fem")) add_solids(&l);
    if (wants(&l, "adaptive_springs")) add_shells(&l);
    return l.n;
}
