/* The cases, and a run of all of them on a scene. */
#include "server/robustness/robustness.h"
#include "server/robustness/trial.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SAFE                                                                                                           \
    "finite, not stopped, energy no more than put in + 1 % (verlet 5 %, central_cg 30 %), contact within its cap"
static const char rule_back[] = SAFE "; rest within 0.1 % S, or on the way there, nothing inverted";
static const char rule_shape[] = SAFE "; the same rest; springs that may not recover: bounded, rest after a reset";
static const char rule_blown[] =
    SAFE "; the same rest, or stopped by finite_guard beyond its reach and rest after a reset";
static const char rule_long[] = SAFE "; the same rest; explicit: or refused beyond the budget, nothing moved";
static const char rule_refused[] = "refused, not a bit of the state changed";

static const pal_robustness_case cases[] = {
    {"teleport", "a tool jumps by S through the body in one step and back", rule_back, pal_robustness_one_tool, 1},
    {"inside", "a tool appears in the middle of the body", rule_back, pal_robustness_one_tool, 0},
    {"pressed", "two tools press the body against each other", rule_back, pal_robustness_pressed, 0},
    {"meganewton", "1e6 N on one vertex for 1 s, then gone", rule_back, pal_robustness_meganewton, 0},
    {"flat", "all free nodes in one plane", rule_shape, pal_robustness_shape, PAL_FLAT},
    {"point", "all free nodes on one point", rule_shape, pal_robustness_shape, PAL_POINT},
    {"mirrored", "all free nodes mirrored", rule_shape, pal_robustness_shape, PAL_MIRRORED},
    {"shuffled", "all free nodes anywhere in the box", rule_shape, pal_robustness_shape, PAL_SHUFFLED},
    {"blown_up", "all free nodes a hundred times as far apart", rule_blown, pal_robustness_shape, PAL_BLOWN_UP},
    {"stretched", "all free nodes eight times as far apart", rule_shape, pal_robustness_shape, PAL_STRETCHED},
    {"dt_x10", "steps ten times as long after a blow", rule_long, pal_robustness_long_step, 10},
    {"dt_x100", "steps a hundred times as long after a blow", rule_long, pal_robustness_long_step, 100},
    {"numbers", "poses, loads, materials and steps of NaN, Inf and 1e300", rule_refused, pal_robustness_numbers, 0},
    {"poisoned", "a NaN in the state of one body", "only that body stops, reports the node, and is reset alone",
     pal_robustness_poisoned, 0},
    {"supports", "supports are released and placed elsewhere while deformed, then restored",
     "energy rises by at most 1 % at a switch, comes to rest", pal_robustness_supports, 0},
    {"stiffer", "stiffness times a thousand while loaded, then back", rule_back, pal_robustness_stiffer, 0},
    {"random", "300 steps of random poses, grasps, loads, materials and brushes, good and bad", rule_back,
     pal_robustness_random, 0},
    {"hour", "an hour at rest under load",
     "all 3,600 s monitored, drift below 1e-6 S, kinetic energy below 1e-9 of what is stored", pal_robustness_hour, 0},
};
enum { N_CASE = sizeof cases / sizeof cases[0] };

const char *pal_robustness_case_name(int index, const char **about)
{
    if (index >= N_CASE) return NULL;
    if (about) *about = cases[index].what;
    return cases[index].name;
}

const char *pal_verdict_name(pal_verdict verdict)
{
    static const char *const name[] = {"passed", "failed", "undecided", "skipped", "collapsed", "slow"};
    return name[verdict];
}

const char *pal_cause_name(pal_cause cause)
{
    static const char *const name[] = {"not finite", "stopped",  "energy",  "contact cap",    "grew",
                                       "input",      "inverted", "asleep",  "stuck",          "moves",
                                       "collapsed",  "seconds",  "no rest", "does not apply", ""};
    return name[cause];
}

void pal_robustness_default(pal_robustness_options *options)
{
    *options = (pal_robustness_options){.seed = 1};
}

/* ---- all cases ---- */

static void find_components(pal_trial *trial)
{
    trial->settles_each = pal_world_find_component(trial->world, -1, "moving_support") >= 0 ||
                          pal_world_find_component(trial->world, -1, "inflate") >= 0;
    for (int b = trial->scene->n_body - 1; b >= 0; b--) {
        trial->settles_each |= pal_world_body(trial->world, b)->active != NULL;
        if (pal_world_find_component(trial->world, b, "tool_push") < 0) continue;
        trial->touches = true;
        trial->body = b;
    }
}

static pal_err open_trial(pal_trial *trial, const pal_scene *scene)
{
    trial->scene = malloc(sizeof *trial->scene);
    if (!trial->scene) return PAL_ERR_MEMORY;
    *trial->scene = *scene;
    if (scene->n_tool < 2) {
        pal_tool_def own = scene->tool[0];
        pal_tools_default(trial->scene, 2);
        if (scene->n_tool == 1) trial->scene->tool[0] = own;
    }
    PAL_TRY(pal_world_create(trial->scene, trial->diag, &trial->world));
    for (int b = 0; b < scene->n_body; b++) {
        size_t n3 = 3 * (size_t)pal_world_body(trial->world, b)->n_dof;
        trial->rest[b] = calloc(n3 + 1, sizeof(double));
        trial->start[b] = calloc(n3 + 1, sizeof(double));
        if (!trial->rest[b] || !trial->start[b]) return PAL_ERR_MEMORY;
    }
    find_components(trial);
    return PAL_ERR_OK;
}

static void close_trial(pal_trial *trial)
{
    pal_world_destroy(trial->world);
    pal_world_destroy(trial->twin);
    for (int b = 0; b < PAL_BODY_MAX; b++) free(trial->rest[b]), free(trial->start[b]);
    free(trial->scene);
}

/* processor time of all cases, from the cost of a step in the rest state */
static double enough_s(pal_trial *trial)
{
    enum { PROBE = 10 };
    double before = pal_trial_cpu_s();
    for (int i = 0; i < PROBE; i++) {
        for (int b = 0; b < trial->scene->n_body; b++) (void)pal_world_invalidate_limits(trial->world, b);
        (void)pal_world_step(trial->world, trial->scene->step_s);
    }
    double step_s = (pal_trial_cpu_s() - before) / PROBE;
    return fmin(1800, fmax(PAL_ROBUSTNESS_CPU_S, PAL_ROBUSTNESS_SIMULATED_S / trial->scene->step_s * step_s));
}

static pal_err run_all(pal_trial *trial, pal_robustness_report *out)
{
    const pal_robustness_options *o = trial->options;
    double begin = pal_trial_cpu_s();
    trial->deadline_s = begin + (o->max_cpu_s > 0 ? 0.5 * o->max_cpu_s : PAL_ROBUSTNESS_CPU_S);
    if (o->progress && !o->progress("rest", 0, o->user)) return PAL_ERR_STATE;
    pal_trial_find_times(trial);
    out->lowest_1_s = trial->lowest_1_s, out->tau_s = trial->tau_s;
    uint64_t none = UINT64_MAX;
    trial->rests = pal_trial_settle(trial, &out->settle_s);
    out->rest_inverted = trial->rest_inverted = pal_trial_count_inverted(trial, &none);
    out->rests = trial->rests = trial->rests && trial->rest_inverted == 0;
    out->late = trial->rest_late = trial->late;
    /* a scene that did not come to rest because a support drives it is compared with an undisturbed run */
    if (!trial->rests && !trial->late && pal_world_find_component(trial->world, -1, "moving_support") >= 0)
        out->driven = !pal_world_create(trial->scene, NULL, &trial->twin);
    pal_trial_save(trial, trial->rest);
    trial->rest_J = pal_world_energy_J(trial->world);
    const double max_cpu_s = o->max_cpu_s > 0 ? o->max_cpu_s : enough_s(trial);
    for (int k = 0; k < N_CASE; k++) {
        if (o->only && strcmp(o->only, cases[k].name)) continue;
        if (o->progress && !o->progress(cases[k].name, (double)k / N_CASE, o->user))
            return pal_diagnostic_set(trial->diag, PAL_ERR_STATE, "stopped before the case %s", cases[k].name);
        double left = begin + max_cpu_s - pal_trial_cpu_s();
        /* short cases leave their time to the others; none takes more than a third of the remainder */
        int n_left = o->only ? 1 : N_CASE - k;
        trial->out = &out->result[out->n++];
        pal_trial_run_case(trial, &cases[k], fmax(0.2, n_left > 3 ? fmin(left / 3, 3 * left / n_left) : left / n_left));
    }
    for (int i = 0; i < out->n; i++) out->count[out->result[i].verdict]++;
    out->took_s = pal_trial_cpu_s() - begin;
    return PAL_ERR_OK;
}

pal_err pal_robustness_run(const pal_scene *scene, const pal_robustness_options *options, pal_robustness_report *out,
                           pal_diagnostic *diag)
{
    bool known = !options->only;
    for (int k = 0; k < N_CASE && !known; k++) known = !strcmp(options->only, cases[k].name);
    if (!known) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "there is no case \"%.60s\"", options->only);
    pal_trial trial = {.options = options, .diag = diag};
    pal_robustness_report *report = calloc(1, sizeof *report);
    pal_err err = report ? open_trial(&trial, scene) : PAL_ERR_MEMORY;
    if (!err) err = run_all(&trial, report);
    if (!err) *out = *report;
    close_trial(&trial);
    free(report);
    return err;
}
