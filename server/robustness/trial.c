/* Runs a robustness case: rest, monitored steps, return to rest, verdict. */

#include "server/robustness/trial.h"
#include "server/base/vec3.h"
#include "server/num/random.h"
#include "server/sim/core/best_rotation.h"
#include "server/sim/elements/elastic_hex.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ENERGY_RULE "+ 1 % (verlet 5 %, central_cg 30 %)"
#define REST_LIMIT  "10 s or ten of its slowest periods (at most 120 s)"
static const char rule_back[] =
    "finite, not stopped, energy no more than put in " ENERGY_RULE ", rest within 0.1 % S in " REST_LIMIT;
static const char rule_shape[] =
    "finite, energy never above the case's " ENERGY_RULE ", rest within 0.1 % S in " REST_LIMIT "; "
    "springs: bounded, that rest after a reset";
static const char rule_blown[] =
    "the same in 25 s, or stopped by finite_guard beyond its reach and at rest after a reset";
static const char rule_long[] = "finite, not stopped, energy no more than put in " ENERGY_RULE
                                ", rest within 0.1 % S; explicit: or refused beyond the budget, nothing moved";
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
     "energy rises by at most 1 % at a switch, at rest within " REST_LIMIT, pal_robustness_supports, 0},
    {"stiffer", "stiffness times a thousand while loaded, then back", "finite, not stopped, rest within 0.1 % S",
     pal_robustness_stiffer, 0},
    {"random", "300 steps of random poses, grasps, loads, materials and brushes, good and bad",
     "finite, not stopped, rest within 0.1 % S", pal_robustness_random, 0},
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
    static const char *const name[] = {"passed", "FAILED", "undecided", "does not apply", "collapsed"};
    return name[verdict];
}

void pal_robustness_default(pal_robustness_options *options)
{
    *options = (pal_robustness_options){.seed = 1};
}

/* ---- report ---- */

void pal_trial_report(pal_trial *trial, pal_verdict verdict, const char *format, ...)
{
    char *text = trial->out->diag;
    pal_verdict *now = &trial->out->verdict;
    size_t used = strlen(text), room = sizeof trial->out->diag;
    va_list list;
    va_start(list, format);
    if (used > 0 && used + 2 < room) used += (size_t)snprintf(text + used, room - used, "; ");
    if (used < room) vsnprintf(text + used, room - used, format, list);
    va_end(list);
    if (verdict == PAL_VERDICT_FAILED || verdict == PAL_VERDICT_SKIPPED || *now == PAL_VERDICT_PASSED) *now = verdict;
}

double pal_trial_random(pal_trial *trial)
{
    return pal_random_unit(trial->options->seed, trial->count++);
}

/* ---- measures ---- */

/* RMS distance from rest over S, of a body without supports after the best rigid motion */
static double body_deviation_S(const pal_trial *trial, int body_index)
{
    const pal_body *body = pal_world_body(trial->world, body_index);
    const double *rest = trial->rest[body_index];
    /* points present in every state of the body: of an adaptive one those of its coarsest level */
    const int n = body->active ? body->dofs.levels->n_vertex[0] : body->n_dof;
    double c[3] = {0, 0, 0}, o[3] = {0, 0, 0}, pairs[9], r[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    double sum = 0;
    bool free = true;
    for (int i = 0; i < body->n_dof; i++) free = free && !body->support[i];
    for (int i = 0; i < n && free; i++) {
        pal_axpy3(c, 1.0 / n, body->x + 3 * (size_t)i);
        pal_axpy3(o, 1.0 / n, rest + 3 * (size_t)i);
    }
    if (free) {
        pal_sum_pairs(n, NULL, body->x, rest, pairs);
        pal_best_rotation(pairs, r);
    }
    for (int i = 0; i < n; i++) {
        double from[3], to[3];
        pal_sub3(from, rest + 3 * (size_t)i, o);
        pal_mul33(to, r, from);
        pal_add3(to, to, c);
        sum += pow(pal_dist3(to, body->x + 3 * (size_t)i), 2);
    }
    return sqrt(sum / n) / body->length_scale_m;
}

/* Springs whose shape was destroyed, and bodies stopped by their safeguards where the case allows it, need not
 * return by themselves. */
static bool excused(const pal_trial *trial, int b)
{
    return trial->may_stay[b] || (trial->may_stop[b] && trial->stopped[b]);
}

double pal_trial_deviation_S(const pal_trial *trial, bool required)
{
    double max = 0;
    for (int b = 0; b < trial->scene->n_body; b++) {
        double left = required && excused(trial, b) ? 0 : body_deviation_S(trial, b);
        if (!(left <= max)) max = left;
    }
    return max;
}

/* work of sustained loads since rest, as applied: clamped to the cap */
static double work_J(const pal_body *body)
{
    double sum = 0;
    for (int k = 0; k < pal_body_nodes(body) && body->external_force; k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        double size = pal_norm3(body->external_force + i), move[3];
        if (!(size > 0)) continue;
        pal_sub3(move, body->d + i, body->node_rest + i);
        sum += fmin(1, pal_body_node_load_cap_N(body, (int)(i / 3)) / size) * pal_dot3(body->external_force + i, move);
    }
    return sum;
}

double pal_trial_energy(const pal_trial *trial)
{
    double sum = pal_world_energy_J(trial->world);
    for (int b = 0; b < trial->scene->n_body; b++) sum -= work_J(pal_world_body(trial->world, b));
    return sum;
}

/* Hexahedra and their split store different energies at the same shape: takes the larger one. */
static double shape_energy(const pal_trial *trial)
{
    double now = pal_trial_energy(trial);
    for (int i = 0; i < pal_world_component_count(trial->world); i++) {
        const pal_component *component = pal_world_component(trial->world, i);
        pal_elastic_hexes *hex = strcmp(component->effect->name, "hex_elastic") ? NULL : component->self;
        if (!hex || !hex->split) continue;
        hex->has_inversion = !hex->has_inversion;
        now = fmax(now, pal_trial_energy(trial));
        hex->has_inversion = !hex->has_inversion;
    }
    return now;
}

static uint64_t count_splits(const pal_trial *trial)
{
    uint64_t n = 0;
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->world, b);
        /* inverted regions of springs begin and end without added energy */
        if (!body->recovery) n += body->safeguards.n_split;
    }
    return n;
}

void pal_trial_rebase(pal_trial *trial)
{
    trial->base_J = shape_energy(trial);
    trial->n_split = count_splits(trial); /* the counter restarts when a world is made or reset */
    trial->allowed_J = 0;
    trial->scale_J = fmax(trial->scale_J, fabs(pal_world_energy_J(trial->world) - trial->rest_J));
}

void pal_trial_exclude_rise(pal_trial *trial, double energy_J)
{
    if (!(energy_J > trial->base_J)) return;
    trial->excluded_rise_J += energy_J - trial->base_J;
    trial->base_J = energy_J;
}

void pal_trial_remove_loads(pal_trial *trial)
{
    for (int b = 0; b < trial->scene->n_body; b++) {
        pal_body *body = pal_world_body(trial->world, b);
        /* all nodes, because the loaded one of an adaptive body may no longer be in use */
        if (body->external_force) memset(body->external_force, 0, 3 * sizeof(double) * (size_t)body->n_node);
    }
    pal_world_wake(trial->world);
}

double pal_trial_load_cap_N(const pal_trial *trial, int b)
{
    const pal_body *body = pal_world_body(trial->world, b);
    double mass = 0;
    for (int i = 0; i < body->n_node; i++) mass += body->node_mass_kg[i];
    return fmin(body->load_cap_N, 9.81 * mass);
}

int pal_trial_far_node(const pal_trial *trial, int b)
{
    const pal_body *body = pal_world_body(trial->world, b);
    double from[3] = {0, 0, 0}, max = -1;
    int n = 0, far = pal_body_point(body, 0);
    for (int i = 0; i < body->n_dof; i++)
        if (body->support[i]) pal_add3(from, from, body->x_rest + 3 * (size_t)i), n++;
    for (int k = 0; k < pal_body_nodes(body) && n == 0; k++)
        pal_axpy3(from, 1.0 / pal_body_nodes(body), body->node_rest + 3 * (size_t)pal_body_point(body, k));
    if (n > 0) pal_scale3(from, 1.0 / n, from);
    for (int k = 0; k < pal_body_nodes(body); k++) {
        int i = pal_body_point(body, k);
        double move = pal_dist3(body->node_rest + 3 * (size_t)i, from);
        if (move > max) max = move, far = i;
    }
    return far;
}

void pal_trial_box(const pal_trial *trial, int b, double low_m[3], double high_m[3])
{
    const pal_body *body = pal_world_body(trial->world, b);
    pal_box3_empty(low_m, high_m);
    for (int k = 0; k < pal_body_nodes(body); k++) {
        double x[3];
        pal_add3(x, body->d + 3 * (size_t)pal_body_point(body, k), body->offset_m);
        pal_box3_add(low_m, high_m, x);
    }
}

/* ---- monitored steps ---- */

/* records every n-th step; when the buffer is full, drops every second sample */
static void sample(pal_trial *trial)
{
    pal_robustness_result *out = trial->out;
    if (++trial->since < trial->n_skip) return;
    trial->since = 0;
    if (out->n_sample == PAL_ROBUSTNESS_SAMPLES) {
        for (int i = 0; i < PAL_ROBUSTNESS_SAMPLES / 2; i++)
            out->time_s[i] = out->time_s[2 * i], out->energy_J[i] = out->energy_J[2 * i];
        out->n_sample /= 2;
        trial->n_skip *= 2;
    }
    out->time_s[out->n_sample] = out->simulated_s;
    out->energy_J[out->n_sample++] = pal_world_energy_J(trial->world) - trial->rest_J;
}

static void monitor(pal_trial *trial)
{
    pal_robustness_result *out = trial->out;
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->world, b);
        out->finite &= pal_body_finite(body);
        if (body->frozen && !out->frozen)
            pal_trial_report(trial, PAL_VERDICT_PASSED, "%s stopped: %s", body->name, body->reason);
        out->frozen |= body->frozen, trial->stopped[b] |= body->frozen;
    }
    double energy = pal_world_energy_J(trial->world);
    trial->scale_J = fmax(trial->scale_J, fabs(energy - trial->rest_J));
    /* hexahedra and their split store different energies at the same shape */
    uint64_t n_split = count_splits(trial);
    if (n_split != trial->n_split) pal_trial_exclude_rise(trial, pal_trial_energy(trial));
    trial->n_split = n_split;
    trial->excess_J = fmax(trial->excess_J, pal_trial_energy(trial) - trial->base_J - trial->allowed_J);
    sample(trial);
}

/* Did a body stop that may not, or have all stopped? */
static bool halted(const pal_trial *trial)
{
    int n = 0;
    for (int b = 0; b < trial->scene->n_body; b++) {
        if (trial->stopped[b] && !trial->may_stop[b]) return true;
        n += trial->stopped[b];
    }
    return n == trial->scene->n_body;
}

bool pal_trial_step(pal_trial *trial, double dt_s)
{
    pal_err err = pal_world_step(trial->world, dt_s);
    pal_world_remove_idle(trial->world);
    trial->err = err;
    if (err == PAL_ERR_BUDGET || err == PAL_ERR_REFUSED) return false;
    trial->out->simulated_s += dt_s;
    if (!pal_trial_step_twin(trial, dt_s)) trial->rests = false;
    monitor(trial);
    trial->late = pal_trial_cpu_s() > trial->deadline_s;
    return trial->out->finite && !halted(trial) && !trial->late;
}

bool pal_trial_run(pal_trial *trial, double seconds)
{
    int n = (int)ceil(seconds / trial->scene->step_s);
    for (int i = 0; i < n; i++)
        if (!pal_trial_step(trial, trial->scene->step_s)) return false;
    return true;
}

/* sets deviation_S and return_s */
static void relax(pal_trial *trial, double seconds)
{
    pal_robustness_result *out = trial->out;
    double begin = out->simulated_s, rest_time_s = 0;
    int n =
        (int)ceil((seconds < PAL_RETURN_TIME_S ? seconds : fmax(seconds, trial->return_time_s)) / trial->scene->step_s);
    out->return_s = INFINITY;
    trial->needs_rest = true, trial->has_returned = false;
    for (int i = 0; i < n && out->finite && !halted(trial) && !trial->late; i++) {
        if (!pal_trial_step(trial, trial->scene->step_s)) break;
        double left = pal_trial_deviation_S(trial, false), now = out->simulated_s - begin;
        if (!(left <= PAL_RETURN_S))
            out->return_s = INFINITY;
        else if (isinf(out->return_s))
            out->return_s = now;
        if (now - out->return_s >= PAL_REST_HOLD_S) break;
        /* what no longer moves will not return either */
        rest_time_s = pal_trial_speed_S_s(trial) <= PAL_REST_SPEED_S_S ? rest_time_s + trial->scene->step_s : 0;
        if (rest_time_s > 2 * PAL_REST_HOLD_S) break;
    }
    out->deviation_S = pal_trial_deviation_S(trial, false);
    trial->has_returned = out->return_s < INFINITY || pal_trial_deviation_S(trial, true) <= PAL_RETURN_S;
}

void pal_trial_return(pal_trial *trial, double seconds)
{
    relax(trial, seconds);
    if (trial->out->return_s < INFINITY)
        pal_trial_report(trial, PAL_VERDICT_PASSED, "back after %.2g s", trial->out->return_s);
}

/* ---- verdicts ---- */

static void sum_safeguards(pal_trial *trial)
{
    pal_safeguards *to = &trial->out->safeguards;
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_safeguards *from = &pal_world_body(trial->world, b)->safeguards;
        to->n_capped += from->n_capped, to->n_clamped += from->n_clamped, to->n_mass_scaled += from->n_mass_scaled;
        to->n_inversion += from->n_inversion, to->n_split += from->n_split, to->n_search += from->n_search;
        to->n_tool_reset += from->n_tool_reset, to->n_stopped += from->n_stopped, to->ns += from->ns;
    }
}

static double energy_limit(const pal_trial *trial)
{
    return pal_world_find_component(trial->world, -1, "central_cg") >= 0 ? PAL_ENERGY_SLACK_CENTRAL
           : pal_world_find_component(trial->world, -1, "verlet") >= 0   ? PAL_ENERGY_SLACK_VERLET
                                                                         : PAL_ENERGY_SLACK;
}

static void judge(pal_trial *trial)
{
    pal_robustness_result *out = trial->out;
    /* a driving support does work continuously */
    bool judged = !isnan(out->energy) && trial->scale_J > 0 && !trial->twin;
    /* a smaller energy input is rounding, and a share of it is meaningless */
    for (int b = 0; b < trial->scene->n_body; b++)
        trial->scale_J = fmax(trial->scale_J, PAL_NO_ENERGY * pal_trial_load_cap_N(trial, b) *
                                                  pal_world_body(trial->world, b)->length_scale_m);
    out->limit = energy_limit(trial);
    out->energy = judged ? trial->excess_J / trial->scale_J : (double)NAN;
    out->excluded_rise = judged ? trial->excluded_rise_J / trial->scale_J : (double)NAN;
    if (out->verdict == PAL_VERDICT_SKIPPED) return;
    if (!out->finite) pal_trial_report(trial, PAL_VERDICT_FAILED, "a number is not finite");
    for (int b = 0; b < trial->scene->n_body; b++)
        if (trial->stopped[b] && !trial->may_stop[b])
            pal_trial_report(trial, PAL_VERDICT_FAILED, "%s was stopped", trial->scene->body[b].name);
    if (out->finite && !out->frozen && judged && !(out->energy <= out->limit))
        pal_trial_report(trial, PAL_VERDICT_FAILED, "energy rose by %.2g of what was put in, allowed %.2g", out->energy,
                         out->limit);
    if (out->verdict == PAL_VERDICT_FAILED || out->verdict == PAL_VERDICT_UNDECIDED) return;
    bool all_excused = true;
    for (int b = 0; b < trial->scene->n_body; b++) all_excused = all_excused && excused(trial, b);
    if (trial->late && !all_excused && !(trial->needs_rest && trial->has_returned))
        pal_trial_report(trial, PAL_VERDICT_UNDECIDED,
                         "not judged, the time was over after %.1f simulated s: give more --seconds", out->simulated_s);
    else if (trial->needs_rest && !trial->rests && !trial->twin)
        pal_trial_report(trial, PAL_VERDICT_UNDECIDED, "not judged, the scene does not come to rest by itself");
    else if (trial->needs_rest && !trial->has_returned)
        pal_trial_report(trial, PAL_VERDICT_FAILED, "%.2g %% S from rest at the end",
                         100 * pal_trial_deviation_S(trial, true));
}

/* A body that was stopped or stayed away must be at rest after a reset. Keeps the figures of the case. */
static void check_reset(pal_trial *trial, double seconds)
{
    pal_robustness_result *out = trial->out, was = *out;
    pal_world_reset(trial->world);
    if (trial->twin) pal_world_reset(trial->twin);
    out->frozen = false, out->n_sample = 0, trial->late = false;
    memset(trial->stopped, 0, sizeof trial->stopped);
    memset(trial->may_stay, 0, sizeof trial->may_stay);
    trial->deadline_s = fmax(trial->deadline_s, pal_trial_cpu_s() + 0.5 * seconds);
    relax(trial, PAL_RETURN_TIME_S);
    const double left = out->deviation_S;
    const bool stopped = out->frozen || !out->finite, back = trial->has_returned;
    memcpy(was.diag, out->diag, sizeof was.diag);
    *out = was;
    if (stopped)
        pal_trial_report(trial, PAL_VERDICT_FAILED, "a reset did not bring it back");
    else if (trial->rests && !back && trial->late)
        pal_trial_report(trial, PAL_VERDICT_UNDECIDED, "not judged after its reset: give more --seconds");
    else if (trial->rests && !back)
        pal_trial_report(trial, PAL_VERDICT_FAILED, "%.2g %% S from rest %.0f s after a reset", 100 * left,
                         PAL_RETURN_TIME_S);
}

static void run_one(pal_trial *trial, const pal_robustness_case *which, double seconds)
{
    pal_robustness_result *out = trial->out;
    double begin = pal_trial_cpu_s();
    *out = (pal_robustness_result){.name = which->name,
                                   .what = which->what,
                                   .criterion = which->criterion,
                                   .finite = true,
                                   .deviation_S = NAN,
                                   .return_s = NAN};
    trial->deadline_s = begin + seconds;
    trial->base_J = trial->scale_J = trial->excess_J = trial->allowed_J = trial->excluded_rise_J = 0;
    trial->n_skip = 1, trial->since = 0, trial->count = 0;
    trial->late = trial->needs_rest = trial->has_returned = false;
    memset(trial->stopped, 0, sizeof trial->stopped);
    memset(trial->may_stop, 0, sizeof trial->may_stop);
    memset(trial->may_stay, 0, sizeof trial->may_stay);
    if (!pal_trial_back_to_rest(trial)) {
        pal_trial_report(trial, PAL_VERDICT_UNDECIDED, "not judged, the scene did not come to rest before it");
        return;
    }
    pal_trial_rebase(trial);
    sample(trial);
    trial->parameter = which->parameter;
    which->run(trial);
    sum_safeguards(trial);
    judge(trial);
    /* a folded subdivision solid has other rest states, as elements with one rotation each do; springs whose shape was
     * destroyed may not recover it by themselves */
    const bool failed = out->verdict == PAL_VERDICT_FAILED && trial->needs_rest && !trial->has_returned && !trial->late;
    bool folded = false, collapsed = false, reset = out->frozen;
    for (int b = 0; b < trial->scene->n_body; b++) {
        const bool away = !(body_deviation_S(trial, b) <= PAL_RETURN_S);
        folded |= failed && away && pal_world_body(trial->world, b)->interpolation;
        collapsed |= trial->may_stay[b] && (trial->stopped[b] || away);
        reset |= trial->may_stay[b] && !(out->return_s < INFINITY);
    }
    reset |= folded;
    if (out->verdict != PAL_VERDICT_SKIPPED && reset) check_reset(trial, seconds);
    if (folded && trial->has_returned)
        pal_trial_report(
            trial, PAL_VERDICT_PASSED, "a reset brings it back%s",
            energy_limit(trial) == PAL_ENERGY_SLACK_CENTRAL ? ", solver implicit_euler comes back from more" : "");
    if (collapsed && out->verdict == PAL_VERDICT_PASSED) {
        out->verdict = PAL_VERDICT_COLLAPSED;
        pal_trial_report(trial, PAL_VERDICT_PASSED, "a reset brings it back");
    }
    out->took_s = pal_trial_cpu_s() - begin;
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
    out->rests = trial->rests = pal_trial_settle(trial, &out->settle_s);
    /* a scene that did not come to rest because a support drives it is compared with an undisturbed run */
    if (!trial->rests && !trial->late && pal_world_find_component(trial->world, -1, "moving_support") >= 0)
        out->led = !pal_world_create(trial->scene, NULL, &trial->twin);
    pal_trial_save(trial, trial->rest);
    trial->rest_J = pal_world_energy_J(trial->world);
    trial->return_time_s = pal_trial_return_time_s(trial);
    const double max_cpu_s = o->max_cpu_s > 0 ? o->max_cpu_s : enough_s(trial);
    for (int k = 0; k < N_CASE; k++) {
        if (o->only && strcmp(o->only, cases[k].name)) continue;
        if (o->progress && !o->progress(cases[k].name, (double)k / N_CASE, o->user))
            return pal_diagnostic_set(trial->diag, PAL_ERR_STATE, "stopped before the case %s", cases[k].name);
        double left = begin + max_cpu_s - pal_trial_cpu_s();
        /* short cases leave their time to the others; none takes more than a third of the remainder */
        int n_left = o->only ? 1 : N_CASE - k;
        trial->out = &out->result[out->n++];
        run_one(trial, &cases[k], fmax(0.2, n_left > 3 ? fmin(left / 3, 3 * left / n_left) : left / n_left));
    }
    int *const n[] = {&out->n_passed, &out->n_failed, &out->n_undecided, &out->n_skipped, &out->n_collapsed};
    for (int i = 0; i < out->n; i++) ++*n[out->result[i].verdict];
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
