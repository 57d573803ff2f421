/* Runs a robustness case: rest, monitored steps, return to rest, verdict. */
#include "server/robustness/trial.h"
#include "server/base/vec3.h"
#include "server/num/random.h"
#include "server/sim/core/best_rotation.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* ---- report ---- */

void pal_trial_report(pal_trial *trial, pal_cause cause, const char *format, ...)
{
    char *text = trial->out->diag;
    size_t used = strlen(text), room = sizeof trial->out->diag;
    va_list list;
    va_start(list, format);
    if (used > 0 && used + 2 < room) used += (size_t)snprintf(text + used, room - used, "; ");
    if (used < room) vsnprintf(text + used, room - used, format, list);
    va_end(list);
    trial->causes |= 1u << cause;
    if (cause < trial->out->cause) trial->out->cause = cause;
}

/* was one of the causes from first to last reported? */
static bool has_cause(const pal_trial *trial, pal_cause first, pal_cause last)
{
    return (trial->causes & ((2u << last) - (1u << first))) != 0;
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
static bool may_remain(const pal_trial *trial, int b)
{
    return trial->may_stay[b] || (trial->may_stop[b] && trial->stopped[b]);
}

double pal_trial_deviation_S(const pal_trial *trial, bool required)
{
    double max = 0;
    for (int b = 0; b < trial->scene->n_body; b++) {
        double left = required && may_remain(trial, b) ? 0 : body_deviation_S(trial, b);
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

void pal_trial_rebase(pal_trial *trial)
{
    trial->base_J = pal_trial_energy(trial);
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

double pal_trial_load_cap_N(const pal_trial *trial, int b, int node)
{
    const pal_body *body = pal_world_body(trial->world, b);
    double mass = 0;
    for (int i = 0; i < body->n_node; i++) mass += body->node_mass_kg[i];
    return fmin(pal_body_node_load_cap_N(body, node), 9.81 * mass);
}

void pal_trial_load(pal_trial *trial, double share, const double direction[3])
{
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->world, b);
        const int far = pal_trial_far_node(trial, b);
        double sum = 0, all_N = share * pal_trial_load_cap_N(trial, b, far);
        for (int pass = 0; pass < 2; pass++)
            for (int k = 0; k < pal_body_nodes(body); k++) {
                const int i = pal_body_point(body, k);
                const double bears_N = pal_body_node_load_cap_N(body, i);
                double force[3];
                if (pal_dist3(body->node_rest + 3 * (size_t)i, body->node_rest + 3 * (size_t)far) > 1.01 * body->edge_m)
                    continue;
                if (pass == 0) sum += bears_N;
                if (pass == 0) continue;
                pal_scale3(force, all_N * bears_N / sum, direction);
                trial->err = pal_world_load(trial->world, b, i, force);
            }
    }
}

double pal_trial_extent_S(const pal_trial *trial)
{
    double max = 0;
    for (int b = 0; b < trial->scene->n_body; b++) {
        double low[3], high[3];
        pal_trial_box(trial, b, low, high);
        max = fmax(max, pal_dist3(low, high) / pal_world_body(trial->world, b)->length_scale_m);
    }
    return max;
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
            pal_trial_report(trial, PAL_CAUSE_NONE, "%s stopped: %s", body->name, body->reason);
        out->frozen |= body->frozen, trial->stopped[b] |= body->frozen;
    }
    const pal_tools *tools = pal_world_tools(trial->world);
    for (int t = 0; t < tools->n_tool; t++) {
        const pal_tool *tool = &tools->tool[t];
        const double force_N = fmax(pal_norm3(tool->force_N), pal_norm3(tool->mean_force_N));
        if (out->contact_cap_N > 0 && force_N * out->contact_cap_N <= out->peak_contact_N * tool->force_cap_N) continue;
        out->peak_contact_N = force_N, out->contact_cap_N = tool->force_cap_N;
    }
    double energy = pal_world_energy_J(trial->world);
    trial->scale_J = fmax(trial->scale_J, fabs(energy - trial->rest_J));
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

int pal_trial_count_inverted(const pal_trial *trial, uint64_t *n_recovery)
{
    int n = 0;
    uint64_t before = *n_recovery;
    *n_recovery = 0;
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_body *body = pal_world_body(trial->world, b);
        if (may_remain(trial, b)) continue;
        if (body->interpolation) *n_recovery += body->safeguards.n_inversion;
        for (int t = 0; body->tets && !body->interpolation && t < body->tets->n_tet; t++) {
            const int32_t *tet = body->tets->tet + 4 * (size_t)t;
            n += pal_tet_volume(body->x, tet) * pal_tet_volume(body->x_rest, tet) < 0;
        }
    }
    return n > 0 ? n : *n_recovery > before;
}

static bool all_asleep(const pal_trial *trial)
{
    bool all = true;
    for (int b = 0; b < trial->scene->n_body; b++) all = all && pal_world_body(trial->world, b)->asleep;
    return all;
}

/* sets deviation_S, return_s and needs_s; OPEN: it was cut short */
static pal_return_state watch_return(pal_trial *trial, double seconds, int *n_inverted)
{
    enum { EACH = 6 }; /* steps */
    pal_robustness_result *out = trial->out;
    pal_return_watch watch;
    pal_return_look look = {.left_S = pal_trial_deviation_S(trial, false)};
    pal_return_state state = PAL_RETURN_OPEN;
    const double begin = out->simulated_s, begin_cpu = pal_trial_cpu_s(),
                 limit = seconds < PAL_RETURN_TIME_S
                             ? seconds
                             : pal_return_limit_s(trial->lowest_1_s, trial->tau_s, look.left_S, seconds);
    uint64_t n_recovery = 0;
    *n_inverted = pal_trial_count_inverted(trial, &n_recovery);
    pal_return_watch_begin(&watch, trial->tau_s, limit);
    for (int i = 1; state == PAL_RETURN_OPEN && out->finite && !halted(trial) && !trial->late; i++) {
        if (!pal_trial_step(trial, trial->scene->step_s)) break;
        if (i % EACH == 0) *n_inverted = pal_trial_count_inverted(trial, &n_recovery);
        look = (pal_return_look){.time_s = out->simulated_s - begin,
                                 .left_S = pal_trial_deviation_S(trial, false),
                                 .speed_S_s = pal_trial_speed_S_s(trial),
                                 .inverted = *n_inverted > 0,
                                 .asleep = all_asleep(trial)};
        state = pal_return_watch_look(&watch, &look);
    }
    out->deviation_S = pal_trial_deviation_S(trial, false);
    out->return_s = watch.return_s;
    if (trial->late && look.time_s > 0) out->needs_s = (pal_trial_cpu_s() - begin_cpu) * limit / look.time_s;
    return state;
}

void pal_trial_return(pal_trial *trial, double seconds)
{
    static const pal_cause cause[] = {[PAL_RETURN_INVERTED] = PAL_CAUSE_INVERTED,
                                      [PAL_RETURN_ASLEEP] = PAL_CAUSE_ASLEEP,
                                      [PAL_RETURN_STUCK] = PAL_CAUSE_STUCK,
                                      [PAL_RETURN_MOVES] = PAL_CAUSE_MOVES};
    static const char *const how[] = {[PAL_RETURN_INVERTED] = "",
                                      [PAL_RETURN_ASLEEP] = "asleep ",
                                      [PAL_RETURN_STUCK] = "stands still ",
                                      [PAL_RETURN_MOVES] = "still moves "};
    pal_robustness_result *out = trial->out;
    int n_inverted;
    const double before = pal_trial_extent_S(trial);
    const pal_return_state state = watch_return(trial, seconds, &n_inverted);
    const double after = pal_trial_extent_S(trial), left = 100 * out->deviation_S;
    /* on its way back it may be larger for a while: a return that is cut short is not judged */
    if (state != PAL_RETURN_OPEN && out->finite && !out->frozen && !(after <= 1.5 * fmax(before, 1)))
        pal_trial_report(trial, PAL_CAUSE_BOUNDS, "grew to %.2g S", after);
    trial->slow = state == PAL_RETURN_SLOW;
    if (state != PAL_RETURN_OPEN) trial->late = false; /* it was judged in the last step of its time */
    if (state == PAL_RETURN_BACK)
        pal_trial_report(trial, PAL_CAUSE_NONE, "back after %.2g s", out->return_s);
    else if (state == PAL_RETURN_SLOW)
        pal_trial_report(trial, PAL_CAUSE_NONE, "%.2g %% S away after %.1f s, returns in %.3g s", left,
                         out->simulated_s, out->return_s);
    else if (pal_trial_deviation_S(trial, true) <= PAL_RETURN_S && n_inverted == 0)
        pal_trial_report(trial, PAL_CAUSE_NONE, "%.2g %% S away after %.1f s", left, out->simulated_s);
    else if (!trial->rests && !trial->twin)
        pal_trial_report(trial, trial->rest_late ? PAL_CAUSE_SECONDS : PAL_CAUSE_NO_REST,
                         "not judged, the scene does not come to rest by itself%s",
                         trial->rest_late       ? " in the time"
                         : trial->rest_inverted ? " without inverted elements"
                                                : "");
    else if (state != PAL_RETURN_OPEN)
        pal_trial_report(trial, cause[state], "%s%.2g %% S from rest after %.1f s, %d elements inverted", how[state],
                         left, out->simulated_s, n_inverted);
    else if (!trial->late && out->finite && !halted(trial))
        pal_trial_report(trial, PAL_CAUSE_MOVES, "a step of the return was refused");
}

/* ---- verdicts ---- */

static void sum_safeguards(pal_trial *trial)
{
    pal_safeguards *to = &trial->out->safeguards;
    for (int b = 0; b < trial->scene->n_body; b++) {
        const pal_safeguards *from = &pal_world_body(trial->world, b)->safeguards;
        to->n_capped += from->n_capped, to->n_clamped += from->n_clamped, to->n_mass_scaled += from->n_mass_scaled;
        to->n_inversion += from->n_inversion, to->n_change += from->n_change, to->n_search += from->n_search;
        to->n_tool_reset += from->n_tool_reset, to->n_stopped += from->n_stopped, to->ns += from->ns;
    }
}

static double energy_limit(const pal_trial *trial)
{
    return pal_world_find_component(trial->world, -1, "central_cg") >= 0 ? PAL_ENERGY_SLACK_CENTRAL
           : pal_world_find_component(trial->world, -1, "verlet") >= 0   ? PAL_ENERGY_SLACK_VERLET
                                                                         : PAL_ENERGY_SLACK;
}

/* what was seen in any step */
static void judge_steps(pal_trial *trial)
{
    pal_robustness_result *out = trial->out;
    /* a driving support does work continuously */
    bool judged = !isnan(out->energy) && trial->scale_J > 0 && !trial->twin;
    /* a smaller energy input is rounding, and a share of it is meaningless */
    for (int b = 0; b < trial->scene->n_body; b++) {
        const double bears_N = pal_trial_load_cap_N(trial, b, pal_trial_far_node(trial, b));
        trial->scale_J =
            fmax(trial->scale_J, PAL_NO_ENERGY * bears_N * pal_world_body(trial->world, b)->length_scale_m);
    }
    /* a surface that refines holds its weight with other levels after a switch, and other energy by the difference of
     * two meshes, which is a share of that */
    for (int b = 0; b < trial->scene->n_body; b++)
        if (pal_world_body(trial->world, b)->active) trial->scale_J = fmax(trial->scale_J, fabs(trial->rest_J));
    out->limit = energy_limit(trial);
    out->energy = judged ? trial->excess_J / trial->scale_J : (double)NAN;
    out->excluded_rise = judged ? trial->excluded_rise_J / trial->scale_J : (double)NAN;
    if (!out->finite) pal_trial_report(trial, PAL_CAUSE_NUMBER, "a number is not finite");
    for (int b = 0; b < trial->scene->n_body; b++)
        if (trial->stopped[b] && !trial->may_stop[b])
            pal_trial_report(trial, PAL_CAUSE_STOPPED, "%s was stopped", trial->scene->body[b].name);
    if (out->peak_contact_N > 0) pal_trial_report(trial, PAL_CAUSE_NONE, "force up to %.3g N", out->peak_contact_N);
    if (out->peak_contact_N > out->contact_cap_N * (1 + 1e-9))
        pal_trial_report(trial, PAL_CAUSE_CONTACT, "beyond the cap of %.3g N", out->contact_cap_N);
    if (out->finite && !out->frozen && judged && !(out->energy <= out->limit))
        pal_trial_report(trial, PAL_CAUSE_ENERGY, "energy rose by %.2g of what was put in, allowed %.2g", out->energy,
                         out->limit);
}

/* A body that was stopped or stayed away must be at rest after a reset. Keeps the figures of the case. */
static void check_reset(pal_trial *trial, double seconds)
{
    pal_robustness_result *out = trial->out, was = *out;
    int n_inverted;
    pal_world_reset(trial->world);
    if (trial->twin) pal_world_reset(trial->twin);
    out->frozen = false, out->n_sample = 0, trial->late = false;
    memset(trial->stopped, 0, sizeof trial->stopped);
    memset(trial->may_stay, 0, sizeof trial->may_stay);
    trial->deadline_s = fmax(trial->deadline_s, pal_trial_cpu_s() + 0.5 * seconds);
    const pal_return_state state = watch_return(trial, PAL_RETURN_TIME_S, &n_inverted);
    const bool stopped = out->frozen || !out->finite;
    const double left = out->deviation_S;
    *out = was;
    if (stopped)
        pal_trial_report(trial, PAL_CAUSE_INPUT, "a reset did not bring it back");
    else if (trial->rests && trial->late)
        pal_trial_report(trial, PAL_CAUSE_SECONDS, "not judged after its reset");
    else if (trial->rests && state != PAL_RETURN_BACK)
        pal_trial_report(trial, PAL_CAUSE_INPUT, "%.2g %% S from rest %.0f s after a reset", 100 * left,
                         PAL_RETURN_TIME_S);
    else
        pal_trial_report(trial, PAL_CAUSE_NONE, "a reset brings it back");
}

/* the answers and the verdict from what was reported */
static void answer(pal_trial *trial)
{
    pal_robustness_result *out = trial->out;
    const bool unsafe = has_cause(trial, PAL_CAUSE_NUMBER, PAL_CAUSE_INPUT),
               away = has_cause(trial, PAL_CAUSE_INVERTED, PAL_CAUSE_MOVES),
               collapsed = has_cause(trial, PAL_CAUSE_COLLAPSED, PAL_CAUSE_COLLAPSED),
               skipped = has_cause(trial, PAL_CAUSE_NOT_APPLICABLE, PAL_CAUSE_NOT_APPLICABLE),
               open = skipped || has_cause(trial, PAL_CAUSE_SECONDS, PAL_CAUSE_NO_REST);
    out->safe = unsafe ? PAL_NO : open ? PAL_UNKNOWN : PAL_YES;
    out->recovered = away || collapsed ? PAL_NO : open ? PAL_UNKNOWN : PAL_YES;
    out->verdict = skipped          ? PAL_VERDICT_SKIPPED
                   : unsafe || away ? PAL_VERDICT_FAILED
                   : open           ? PAL_VERDICT_UNDECIDED
                   : collapsed      ? PAL_VERDICT_COLLAPSED
                   : trial->slow    ? PAL_VERDICT_SLOW
                                    : PAL_VERDICT_PASSED;
    if (out->verdict != PAL_VERDICT_UNDECIDED || !has_cause(trial, PAL_CAUSE_SECONDS, PAL_CAUSE_SECONDS)) return;
    out->needs_s = fmax(out->needs_s, 2 * out->took_s);
    pal_trial_report(trial, PAL_CAUSE_NONE, "needs about %.0f s of processor time", out->needs_s);
}

void pal_trial_run_case(pal_trial *trial, const pal_robustness_case *which, double seconds)
{
    pal_robustness_result *out = trial->out;
    double begin = pal_trial_cpu_s();
    *out = (pal_robustness_result){.name = which->name,
                                   .what = which->what,
                                   .criterion = which->criterion,
                                   .cause = PAL_CAUSE_NONE,
                                   .finite = true,
                                   .deviation_S = NAN,
                                   .return_s = NAN};
    trial->deadline_s = begin + seconds;
    trial->base_J = trial->scale_J = trial->excess_J = trial->allowed_J = trial->excluded_rise_J = 0;
    trial->n_skip = 1, trial->since = 0, trial->count = 0, trial->causes = 0;
    trial->late = trial->slow = false;
    memset(trial->stopped, 0, sizeof trial->stopped);
    memset(trial->may_stop, 0, sizeof trial->may_stop);
    memset(trial->may_stay, 0, sizeof trial->may_stay);
    bool collapsed = false;
    if (!pal_trial_back_to_rest(trial)) {
        pal_trial_report(trial, PAL_CAUSE_SECONDS, "not judged, the scene did not come to rest before it");
    } else {
        pal_trial_rebase(trial);
        sample(trial);
        trial->parameter = which->parameter;
        which->run(trial);
        sum_safeguards(trial);
        judge_steps(trial);
        bool none_must_return = true;
        for (int b = 0; b < trial->scene->n_body; b++) {
            none_must_return = none_must_return && may_remain(trial, b);
            collapsed |= trial->may_stay[b] && (trial->stopped[b] || !(body_deviation_S(trial, b) <= PAL_RETURN_S));
        }
        if (trial->late && !none_must_return)
            pal_trial_report(trial, PAL_CAUSE_SECONDS, "the time was over after %.1f simulated s", out->simulated_s);
        if (out->frozen || collapsed) check_reset(trial, seconds);
        if (collapsed) pal_trial_report(trial, PAL_CAUSE_COLLAPSED, "springs that may not recover");
    }
    out->took_s = pal_trial_cpu_s() - begin;
    answer(trial);
}
