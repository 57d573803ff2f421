/* Output of `palpate calibrate`: a short table for people, one object for scripts. */
#include "server/calibrate/calibrate_run.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MANY_SUBSTEPS = 200 };

static const char *truth_of(const pal_calibrate_run *run, int index)
{
    const char *name = run->set.list[index].truth_name;
    return name ? name : "finite elements";
}

/* ---- constants ---- */

/* minimum, median and maximum of a kind on the grid */
typedef struct spread {
    double min, middle, max;
} spread;

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static spread spread_of(const pal_calibrate_run *run, int k)
{
    int n = run->info.n_used;
    const double *theta = run->theta + (size_t)k * (size_t)n;
    double *sorted = malloc((size_t)n * sizeof *sorted);
    if (!sorted) return (spread){NAN, NAN, NAN};
    memcpy(sorted, theta, (size_t)n * sizeof *sorted);
    qsort(sorted, (size_t)n, sizeof *sorted, ascending);
    double middle = 0.5 * (sorted[n / 2] + sorted[(n - 1) / 2]);
    spread out = {exp(sorted[0]), exp(middle), exp(sorted[n - 1])};
    free(sorted);
    return out;
}

static double ratio_of(const pal_calibrate_run *run, int k)
{
    return exp(run->theta[k * run->info.n_used] - run->info.start[k * run->info.n_used]);
}

/* Number of constants of kind k at a bound: displacements alone do not determine them. */
static int count_bound(const pal_calibrate_run *run, int k)
{
    const pal_calibration_info *i = &run->info;
    int n = 0;
    for (int p = k * i->n_used; p < (k + 1) * i->n_used; p++)
        n += run->theta[p] <= i->low[p] + 1e-6 || run->theta[p] >= i->high[p] - 1e-6;
    return n;
}

/* ---- text ---- */

/* "12.34 %", or "no rest" */
static const char *percent(char out[32], double value)
{
    if (isnan(value))
        snprintf(out, 32, "-");
    else if (value < DBL_MAX)
        snprintf(out, 32, value < 0.0995 ? "%.2g %%" : value < 9.95 ? "%.2f %%" : "%.1f %%", value);
    else
        snprintf(out, 32, "no rest");
    return out;
}

static void print_row(const pal_calibrate_run *run, const char *id, const char *role, const char *truth, double start,
                      double hand, double found, double live)
{
    char a[32], b[32], c[32], d[32];
    printf("  %-16s %-10s %-18s %10s %10s %10s", id, role, truth, percent(a, start), percent(b, hand),
           percent(c, found));
    if (run->settled) printf(" %12s", percent(d, live));
    printf("\n");
}

static void print_cases(const pal_calibrate_run *run)
{
    printf("\n  %-16s %-10s %-18s %10s %10s %10s%s\n", "load case", "", "truth", "start", "by hand", "calibrated",
           run->settled ? "  live differs" : "");
    int n_fit = 0;
    for (int k = 0; k < run->set.n; k++) {
        bool fit = run->set.list[k].fit;
        n_fit += fit;
        print_row(run, run->set.id[k], fit ? "fitted" : "not fitted", truth_of(run, k), run->start.case_percent[k],
                  run->hand.case_percent[k], run->last.case_percent[k], run->live.load[k].difference_percent);
    }
    if (n_fit > 1)
        print_row(run, "mean", "fitted", "", pal_calibrate_mean(run, &run->start, true),
                  pal_calibrate_mean(run, &run->hand, true), pal_calibrate_mean(run, &run->last, true), NAN);
    printf("\n");
}

static void print_constants(const pal_calibrate_run *run)
{
    for (int k = 0; k < run->info.n_kind; k++) {
        if (!run->info.grid) {
            printf("%s %.6g J, %.3g times the start%s\n", pal_calibrate_key(run, k, true), exp(run->theta[k]),
                   ratio_of(run, k), count_bound(run, k) ? ", as far as --decades lets it go" : "");
            continue;
        }
        spread s = spread_of(run, k);
        printf("%s %.3g to %.3g J, median %.3g", pal_calibrate_key(run, k, true), s.min, s.max, s.middle);
        if (count_bound(run, k)) printf(", %d as far as --decades lets them go", count_bound(run, k));
        printf("\n");
    }
}

static void print_live(const pal_calibrate_run *run)
{
    double damping = run->damping_1_s;
    bool linear = false;
    for (int k = 0; k < run->set.n; k++) linear |= run->set.list[k].linear;
    if (!run->settled)
        printf("live: stopped before its damping was looked for\n");
    else if (run->live.steady)
        printf(
            "live: steady after %.2f s with damping %g 1/s, as far from the rest that Newton finds as the table says\n",
            run->live.seconds, damping);
    else
        printf("live: no steady state within %.3g s of simulated time; damping %g 1/s\n", run->live.load[0].seconds,
               damping);
    if (run->settled && linear) printf("live: springs bend as they do, where a linear case is linearised\n");
    if (run->n_substep > MANY_SUBSTEPS)
        printf("live: stiff and light: a step of 1/60 s takes %d sub-steps (palpate plan says how long that is here)\n",
               run->n_substep);
}

void pal_calibrate_print(const pal_calibrate_run *run)
{
    const pal_calibration_info *i = &run->info;
    const pal_fit_result *r = &run->result;
    printf("%s: %d nodes (%d free), %d tetrahedra, voxels of %.4g m, %d springs\n", run->set.problem->name, i->n_node,
           i->n_free, i->n_tet, i->edge_m, i->n_spring);
    if (i->clamped) printf("a Poisson ratio above 0.4999 was taken as 0.4999\n");
    if (i->grid)
        printf("grid %d x %d x %d, %d of its nodes touch the body: %d constants\n", i->grid->n[0], i->grid->n[1],
               i->grid->n[2], i->n_used, i->n_parameter);
    printf("%s: %s after %lld evaluations", pal_calibrate_method(run), r->ended, (long long)r->n_evaluation);
    if (r->n_rejected > 0) printf(" (%lld without a rest)", (long long)r->n_rejected);
    printf(" and %.2f s\n", r->seconds);
    print_cases(run);
    print_constants(run);
    print_live(run);
    printf("seconds: prepare %.2f, truth %.2f, search %.2f, live %.2f, total %.2f\n", i->prepare_s, i->truth_s,
           r->seconds, run->settle_s, run->total_s);
    for (int k = 0; k < run->n_file; k++) printf("wrote %s\n", run->file[k]);
}

/* ---- json ---- */

/* DBL_MAX (no equilibrium) and NaN (unknown) become null */
static void add_number(cJSON *object, const char *key, double number)
{
    if (isfinite(number) && number < DBL_MAX)
        cJSON_AddNumberToObject(object, key, number);
    else
        cJSON_AddNullToObject(object, key);
}

static void add_cases(const pal_calibrate_run *run, cJSON *o)
{
    cJSON *list = cJSON_AddArrayToObject(o, "cases");
    for (int k = 0; k < run->set.n; k++) {
        cJSON *c = cJSON_CreateObject();
        cJSON_AddItemToArray(list, c);
        cJSON_AddStringToObject(c, "id", run->set.id[k]);
        cJSON_AddBoolToObject(c, "fitted", run->set.list[k].fit);
        cJSON_AddStringToObject(c, "truth", truth_of(run, k));
        cJSON_AddStringToObject(c, "kinematics", run->set.list[k].linear ? "linear" : "finite");
        add_number(c, "start_percent", run->start.case_percent[k]);
        add_number(c, "hand_percent", run->hand.case_percent[k]);
        add_number(c, "percent", run->last.case_percent[k]);
        add_number(c, "most_m", run->info.max_m[k]);
        add_number(c, "points", run->info.n_point[k]);
        add_number(c, "live_s", run->settled && run->live.load[k].steady ? run->live.load[k].seconds : NAN);
        add_number(c, "live_difference_percent", run->settled ? run->live.load[k].difference_percent : NAN);
    }
}

static void add_constants(const pal_calibrate_run *run, cJSON *o)
{
    const pal_calibration_info *i = &run->info;
    cJSON *constants = NULL, *ratio = NULL, *grid = NULL;
    if (i->grid) {
        grid = cJSON_AddObjectToObject(o, "grid");
        cJSON_AddItemToObject(grid, "n", cJSON_CreateIntArray(i->grid->n, 3));
        cJSON_AddNumberToObject(grid, "used", i->n_used);
    } else {
        constants = cJSON_AddObjectToObject(o, "constants");
        ratio = cJSON_AddObjectToObject(o, "ratio_to_start");
    }
    for (int k = 0; k < i->n_kind; k++) {
        const char *key = pal_calibrate_key(run, k, false);
        if (!i->grid) {
            add_number(constants, key, exp(run->theta[k]));
            add_number(ratio, key, ratio_of(run, k));
            continue;
        }
        spread s = spread_of(run, k);
        cJSON *kind = cJSON_AddObjectToObject(grid, key);
        add_number(kind, "min", s.min);
        add_number(kind, "median", s.middle);
        add_number(kind, "max", s.max);
    }
}

static void add_live(const pal_calibrate_run *run, cJSON *o)
{
    bool steady = run->settled && run->live.steady;
    add_number(o, "damping_1_s", run->damping_1_s);
    add_number(o, "steady_s", steady ? run->live.seconds : NAN);
    if (!run->settled) {
        cJSON_AddNullToObject(o, "live");
        return;
    }
    cJSON *live = cJSON_AddObjectToObject(o, "live"), *ladder;
    cJSON_AddBoolToObject(live, "steady", steady);
    cJSON_AddNumberToObject(live, "substeps", run->n_substep);
    double max = 0;
    for (int k = 0; k < run->set.n; k++) {
        double d = run->live.load[k].difference_percent;
        max = d <= max ? max : d; /* keeps NaN */
    }
    add_number(live, "difference_percent", max);
    ladder = cJSON_AddArrayToObject(live, "ladder");
    for (int k = 0; k < PAL_SETTLE_STEPS; k++) {
        cJSON *step = cJSON_CreateObject();
        cJSON_AddItemToArray(ladder, step);
        add_number(step, "damping_1_s", pal_settle_rates_1_s[k]);
        add_number(step, "steady_s", run->live.rate_seconds[k]);
    }
}

cJSON *pal_calibrate_json(const pal_calibrate_run *run)
{
    const pal_calibration_info *i = &run->info;
    const pal_fit_result *r = &run->result;
    cJSON *o = cJSON_CreateObject();
    cJSON_AddBoolToObject(o, "ok", true);
    cJSON_AddStringToObject(o, "problem", run->set.problem->name);
    add_cases(run, o);
    add_number(o, "error_percent", pal_calibrate_mean(run, &run->last, true));
    add_number(o, "start_percent", pal_calibrate_mean(run, &run->start, true));
    add_number(o, "hand_percent", pal_calibrate_mean(run, &run->hand, true));
    add_number(o, "verify_percent", pal_calibrate_mean(run, &run->last, false));
    cJSON_AddStringToObject(o, "method", pal_calibrate_method(run));
    add_number(o, "evaluations", (double)r->n_evaluation);
    add_number(o, "rejected", (double)r->n_rejected);
    add_number(o, "spent", (double)(r->n_spent > 0 ? r->n_spent : r->n_evaluation));
    cJSON_AddStringToObject(o, "ended", r->ended);
    add_constants(run, o);
    int n_bound = 0;
    for (int k = 0; k < i->n_kind; k++) n_bound += count_bound(run, k);
    add_number(o, "at_bound", n_bound);
    add_number(o, "nodes", i->n_node);
    add_number(o, "free_nodes", i->n_free);
    add_number(o, "tets", i->n_tet);
    add_number(o, "springs", i->n_spring);
    add_number(o, "voxel_m", i->edge_m);
    cJSON_AddStringToObject(o, "weights", run->options.equal ? "equal" : "volume");
    cJSON_AddBoolToObject(o, "area_springs", !run->options.without_area);
    cJSON_AddBoolToObject(o, "poisson_clamped", i->clamped);
    add_live(run, o);
    cJSON *files = cJSON_AddArrayToObject(o, "files");
    for (int k = 0; k < run->n_file; k++) cJSON_AddItemToArray(files, cJSON_CreateString(run->file[k]));
    cJSON *seconds = cJSON_AddObjectToObject(o, "seconds");
    add_number(seconds, "prepare", i->prepare_s);
    add_number(seconds, "truth", i->truth_s);
    add_number(seconds, "fit", r->seconds);
    add_number(seconds, "live", run->settle_s);
    add_number(seconds, "total", run->total_s);
    return o;
}
