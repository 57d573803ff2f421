/* The rig that insults run on: rest, watched steps, coming back, verdicts. */
#include "server/robustness/torture.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/num/random.h"
#include "server/robustness/torture_parts.h"
#include "server/sim/elements/elastic_hex.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double back_S = 1e-3, slack = 0.01, central_slack = 0.3, verlet_slack = 0.05;
static const double still_S_s = 1e-5; /* speed, RMS, that is rest */
static const double least_s = 60,
                    typical_s = 500; /* --seconds by itself: at least, and simulated time it has to reach for */
/* energy that is nothing to be judged: of what a body weighs (or its node cap) over S */
static const double nothing_share = 1e-9;

#define ENERGY_RULE "+ 1 % (verlet 5 %, central_cg 30 %)"
#define PATIENCE    "10 s or ten of its slowest periods (at most 120 s)"
static const char rule_back[] =
    "finite, not stopped, energy no more than put in " ENERGY_RULE ", rest within 0.1 % S in " PATIENCE;
static const char rule_shape[] =
    "finite, energy never above the insult's " ENERGY_RULE ", rest within 0.1 % S in " PATIENCE "; "
    "springs: bounded, that rest after a reset";
static const char rule_blown[] =
    "the same in 25 s, or stopped by finite_guard beyond its reach and at rest after a reset";
static const char rule_long[] = "finite, not stopped, energy no more than put in " ENERGY_RULE
                                ", rest within 0.1 % S; explicit: or refused beyond the budget, nothing moved";
static const char rule_refused[] = "refused, not a bit of the state changed";

static const pal_insult insults[] = {
    {"teleport", "a tool jumps by S through the body in one step and back", rule_back, pal_insult_teleport},
    {"inside", "a tool appears in the middle of the body", rule_back, pal_insult_inside},
    {"pressed", "two tools press the body against each other", rule_back, pal_insult_pressed},
    {"meganewton", "1e6 N on one vertex for 1 s, then gone", rule_back, pal_insult_meganewton},
    {"flat", "all free nodes in one plane", rule_shape, pal_insult_flat},
    {"point", "all free nodes on one point", rule_shape, pal_insult_point},
    {"mirrored", "all free nodes mirrored", rule_shape, pal_insult_mirrored},
    {"shuffled", "all free nodes anywhere in the box", rule_shape, pal_insult_shuffled},
    {"blown_up", "all free nodes a hundred times as far apart", rule_blown, pal_insult_blown_up},
    {"stretched", "all free nodes eight times as far apart", rule_shape, pal_insult_stretched},
    {"dt_x10", "steps ten times as long after a blow", rule_long, pal_insult_long_step},
    {"dt_x100", "steps a hundred times as long after a blow", rule_long, pal_insult_longer_step},
    {"numbers", "poses, loads, materials and steps of NaN, Inf and 1e300", rule_refused, pal_insult_numbers},
    {"poisoned", "a NaN in the state of one body", "that body alone stops, says which node, and is reset alone",
     pal_insult_poisoned},
    {"supports", "what is held is let go and held elsewhere while deformed, then back",
     "energy rises by at most 1 % at a switch, stands still within " PATIENCE, pal_insult_supports},
    {"stiffer", "stiffness times a thousand while loaded, then back", "finite, not stopped, rest within 0.1 % S",
     pal_insult_stiffer},
    {"random", "300 steps of random poses, grabs, loads, materials and brushes, good and bad",
     "finite, not stopped, rest within 0.1 % S", pal_insult_random},
    {"hour", "an hour at rest under load",
     "all 3,600 s watched, drift below 1e-6 S, kinetic energy below 1e-9 of what is stored", pal_insult_hour},
};
enum { N_INSULT = sizeof insults / sizeof insults[0] };

int pal_insults(void)
{
    return N_INSULT;
}

const char *pal_insult_name(int insult)
{
    return insults[insult].name;
}

const char *pal_insult_what(int insult)
{
    return insults[insult].what;
}

const char *pal_verdict_name(pal_verdict verdict)
{
    static const char *const name[] = {"passed", "FAILED", "undecided", "does not apply", "collapsed"};
    return name[verdict];
}

void pal_torture_default(pal_torture_options *options)
{
    *options = (pal_torture_options){.seed = 1};
}

/* ---- what insults say ---- */

void pal_rig_say(pal_rig *rig, const char *format, ...)
{
    char *text = rig->out->diag;
    size_t used = strlen(text), room = sizeof rig->out->diag;
    va_list list;
    va_start(list, format);
    if (used > 0 && used + 2 < room) used += (size_t)snprintf(text + used, room - used, "; ");
    if (used < room) vsnprintf(text + used, room - used, format, list);
    va_end(list);
}

void pal_rig_skip(pal_rig *rig, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    vsnprintf(rig->out->diag, sizeof rig->out->diag, format, list);
    va_end(list);
    rig->out->verdict = PAL_VERDICT_SKIPPED;
}

void pal_rig_fail(pal_rig *rig, const char *format, ...)
{
    char text[200];
    va_list list;
    va_start(list, format);
    vsnprintf(text, sizeof text, format, list);
    va_end(list);
    pal_rig_say(rig, "%s", text);
    rig->out->verdict = PAL_VERDICT_FAILED;
}

void pal_rig_undecided(pal_rig *rig, const char *format, ...)
{
    char text[200];
    va_list list;
    va_start(list, format);
    vsnprintf(text, sizeof text, format, list);
    va_end(list);
    pal_rig_say(rig, "%s", text);
    if (rig->out->verdict == PAL_VERDICT_PASSED) rig->out->verdict = PAL_VERDICT_UNDECIDED;
}

double pal_rig_random(pal_rig *rig)
{
    return pal_random_unit(rig->options->seed, rig->count++);
}

/* ---- measures ---- */

/* points that are there in every state of a body: of one that adapts those of its coarsest level */
static int common_points(const pal_body *body)
{
    return body->active ? body->dofs.levels->n_vertex[0] : body->n_dof;
}

static bool is_free(const pal_body *body)
{
    for (int i = 0; i < body->n_dof; i++)
        if (body->fixed[i]) return false;
    return true;
}

static double held_rms(const pal_body *body, const double *rest)
{
    int n = common_points(body);
    double sum = 0;
    for (int i = 0; i < 3 * n; i++) sum += (body->x[i] - rest[i]) * (body->x[i] - rest[i]);
    return sqrt(sum / n);
}

/* after the best rigid motion */
static double free_rms(const pal_body *body, const double *rest)
{
    int n = common_points(body);
    double c[3] = {0, 0, 0}, o[3] = {0, 0, 0}, f[9] = {0}, q[4] = {1, 0, 0, 0}, r[9], sum = 0;
    for (int i = 0; i < n; i++) {
        pal_axpy3(c, 1.0 / n, body->x + 3 * (size_t)i);
        pal_axpy3(o, 1.0 / n, rest + 3 * (size_t)i);
    }
    for (int i = 0; i < n; i++)
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                f[3 * a + b] += (body->x[3 * (size_t)i + (size_t)a] - c[a]) * (rest[3 * (size_t)i + (size_t)b] - o[b]);
    pal_polar_rotation(f, q, 100);
    pal_quat_matrix(q, r);
    for (int i = 0; i < n; i++) {
        double from[3], to[3];
        pal_sub3(from, rest + 3 * (size_t)i, o);
        pal_mul33(to, r, from);
        pal_add3(to, to, c);
        sum += pow(pal_dist3(to, body->x + 3 * (size_t)i), 2);
    }
    return sqrt(sum / n);
}

/* springs whose shape was taken away, and what its guard has stopped where it may, need not come back by themselves */
static bool excused(const pal_rig *rig, int b)
{
    return rig->may_stay[b] || (rig->may_stop[b] && rig->stopped[b]);
}

static double body_left(const pal_rig *rig, int b)
{
    const pal_body *body = pal_world_body(rig->world, b);
    return (is_free(body) ? free_rms(body, rig->rest[b]) : held_rms(body, rig->rest[b])) / body->length_scale_m;
}

double pal_rig_left(const pal_rig *rig)
{
    double most = 0;
    for (int b = 0; b < rig->scene->n_body; b++) {
        double left = body_left(rig, b);
        if (!(left <= most)) most = left;
    }
    return most;
}

/* of the bodies that have to come back */
static double asked_left(const pal_rig *rig)
{
    double most = 0;
    for (int b = 0; b < rig->scene->n_body; b++) {
        double left = excused(rig, b) ? 0 : body_left(rig, b);
        if (!(left <= most)) most = left;
    }
    return most;
}

/* of lasting loads since rest, as they act: shortened to the cap */
static double work_J(const pal_body *body)
{
    double sum = 0;
    for (int k = 0; k < pal_body_nodes(body) && body->external_force; k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        double size = pal_norm3(body->external_force + i), way[3];
        if (!(size > 0)) continue;
        pal_sub3(way, body->d + i, body->node_rest + i);
        sum += fmin(1, pal_body_node_load_cap_N(body, (int)(i / 3)) / size) * pal_dot3(body->external_force + i, way);
    }
    return sum;
}

double pal_rig_energy(const pal_rig *rig)
{
    double sum = pal_world_energy_J(rig->world);
    for (int b = 0; b < rig->scene->n_body; b++) sum -= work_J(pal_world_body(rig->world, b));
    return sum;
}

/* cubes and their split store other energies in the same shape: the larger one */
static double shape_energy(const pal_rig *rig)
{
    double now = pal_rig_energy(rig);
    for (int i = 0; i < pal_world_component_count(rig->world); i++) {
        const pal_component *row = pal_world_component(rig->world, i);
        pal_elastic_hexes *hex = strcmp(row->effect->name, "hex_elastic") ? NULL : row->self;
        if (!hex || !hex->split) continue;
        hex->has_inversion = !hex->has_inversion;
        now = fmax(now, pal_rig_energy(rig));
        hex->has_inversion = !hex->has_inversion;
    }
    return now;
}

static uint64_t count_splits(const pal_rig *rig)
{
    uint64_t n = 0;
    for (int b = 0; b < rig->scene->n_body; b++) {
        const pal_body *body = pal_world_body(rig->world, b);
        /* patches of springs begin and end with no more than there was */
        if (!body->recovery) n += body->safeguards.n_split;
    }
    return n;
}

void pal_rig_rebase(pal_rig *rig)
{
    rig->base_J = shape_energy(rig);
    rig->n_split = count_splits(rig); /* of a world that was made or reset it begins anew */
    rig->allowed_J = 0;
    rig->scale_J = fmax(rig->scale_J, fabs(pal_world_energy_J(rig->world) - rig->rest_J));
}

void pal_rig_moved(pal_rig *rig)
{
    for (int b = 0; b < rig->scene->n_body; b++) pal_world_invalidate_limits(rig->world, b);
    pal_rig_rebase(rig);
}

void pal_rig_forgive(pal_rig *rig, double energy_J)
{
    if (!(energy_J > rig->base_J)) return;
    rig->forgiven_J += energy_J - rig->base_J;
    rig->base_J = energy_J;
}

bool pal_rig_springs(const pal_rig *rig, int b)
{
    return !strcmp(rig->scene->body[b].model.name, "tet_springs");
}

double pal_rig_cap_N(const pal_rig *rig, int b)
{
    const pal_body *body = pal_world_body(rig->world, b);
    double mass = 0;
    for (int i = 0; i < body->n_node; i++) mass += body->node_mass_kg[i];
    return fmin(body->load_cap_N, 9.81 * mass);
}

int pal_rig_far_node(const pal_rig *rig, int b)
{
    const pal_body *body = pal_world_body(rig->world, b);
    double from[3] = {0, 0, 0}, most = -1;
    int n = 0, far = pal_body_point(body, 0);
    for (int i = 0; i < body->n_dof; i++)
        if (body->fixed[i]) pal_add3(from, from, body->x_rest + 3 * (size_t)i), n++;
    for (int k = 0; k < pal_body_nodes(body) && n == 0; k++)
        pal_axpy3(from, 1.0 / pal_body_nodes(body), body->node_rest + 3 * (size_t)pal_body_point(body, k));
    if (n > 0) pal_scale3(from, 1.0 / n, from);
    for (int k = 0; k < pal_body_nodes(body); k++) {
        int i = pal_body_point(body, k);
        double way = pal_dist3(body->node_rest + 3 * (size_t)i, from);
        if (way > most) most = way, far = i;
    }
    return far;
}

void pal_rig_box(const pal_rig *rig, int b, double low_m[3], double high_m[3])
{
    const pal_body *body = pal_world_body(rig->world, b);
    for (int c = 0; c < 3; c++) low_m[c] = INFINITY, high_m[c] = -INFINITY;
    for (int k = 0; k < pal_body_nodes(body); k++)
        for (int c = 0; c < 3; c++) {
            double at = body->d[3 * (size_t)pal_body_point(body, k) + (size_t)c] + body->offset_m[c];
            low_m[c] = fmin(low_m[c], at), high_m[c] = fmax(high_m[c], at);
        }
}

/* ---- watched steps ---- */

/* every n-th step; when the room is full every second sample goes */
static void sample(pal_rig *rig)
{
    pal_torture_result *out = rig->out;
    if (++rig->since < rig->n_skip) return;
    rig->since = 0;
    if (out->n_sample == PAL_TORTURE_SAMPLES) {
        for (int i = 0; i < PAL_TORTURE_SAMPLES / 2; i++)
            out->time_s[i] = out->time_s[2 * i], out->energy_J[i] = out->energy_J[2 * i];
        out->n_sample /= 2;
        rig->n_skip *= 2;
    }
    out->time_s[out->n_sample] = out->simulated_s;
    out->energy_J[out->n_sample++] = pal_world_energy_J(rig->world) - rig->rest_J;
}

static void look(pal_rig *rig)
{
    pal_torture_result *out = rig->out;
    for (int b = 0; b < rig->scene->n_body; b++) {
        const pal_body *body = pal_world_body(rig->world, b);
        out->finite &= pal_body_finite(body);
        if (body->frozen && !out->frozen) pal_rig_say(rig, "%s stopped: %s", body->name, body->reason);
        out->frozen |= body->frozen, rig->stopped[b] |= body->frozen;
    }
    double energy = pal_world_energy_J(rig->world);
    rig->scale_J = fmax(rig->scale_J, fabs(energy - rig->rest_J));
    /* cubes and their split store other energies in one shape */
    uint64_t n_split = count_splits(rig);
    if (n_split != rig->n_split) pal_rig_forgive(rig, pal_rig_energy(rig));
    rig->n_split = n_split;
    rig->excess_J = fmax(rig->excess_J, pal_rig_energy(rig) - rig->base_J - rig->allowed_J);
    sample(rig);
}

/* a body stopped that may not, or all of them: no use in going on */
static bool halted(const pal_rig *rig)
{
    int n = 0;
    for (int b = 0; b < rig->scene->n_body; b++) {
        if (rig->stopped[b] && !rig->may_stop[b]) return true;
        n += rig->stopped[b];
    }
    return n == rig->scene->n_body;
}

bool pal_rig_step(pal_rig *rig, double dt_s)
{
    pal_err err = pal_world_step(rig->world, dt_s);
    pal_world_remove_idle(rig->world);
    rig->err = err;
    if (err == PAL_ERR_BUDGET || err == PAL_ERR_REFUSED) return false;
    rig->out->simulated_s += dt_s;
    if (!pal_rig_step_twin(rig, dt_s)) rig->rests = false;
    look(rig);
    rig->late = 1e-9 * (double)pal_clock_thread_ns() > rig->deadline_s;
    return rig->out->finite && !halted(rig) && !rig->late;
}

bool pal_rig_run(pal_rig *rig, double seconds)
{
    int n = (int)ceil(seconds / rig->scene->step_s);
    for (int i = 0; i < n; i++)
        if (!pal_rig_step(rig, rig->scene->step_s)) return false;
    return true;
}

void pal_rig_relax(pal_rig *rig, double seconds)
{
    pal_torture_result *out = rig->out;
    double begin = out->simulated_s, hold_s = 0.25, rest_time_s = 0;
    int n = (int)ceil((seconds < 10 ? seconds : fmax(seconds, rig->patience_s)) / rig->scene->step_s);
    out->back_s = INFINITY;
    rig->needs_rest = true, rig->asked_back = false;
    for (int i = 0; i < n && out->finite && !halted(rig) && !rig->late; i++) {
        if (!pal_rig_step(rig, rig->scene->step_s)) break;
        double left = pal_rig_left(rig), now = out->simulated_s - begin;
        if (!(left <= back_S))
            out->back_s = INFINITY;
        else if (isinf(out->back_s))
            out->back_s = now;
        if (now - out->back_s >= hold_s) break;
        /* what does not move any more will not come back either */
        rest_time_s = pal_rig_speed_S_s(rig) <= still_S_s ? rest_time_s + rig->scene->step_s : 0;
        if (rest_time_s > 2 * hold_s) break;
    }
    out->left_S = pal_rig_left(rig);
    rig->asked_back = out->back_s < INFINITY || asked_left(rig) <= back_S;
}

/* ---- verdicts ---- */

static void sum_rescues(pal_rig *rig)
{
    pal_safeguards *to = &rig->out->safeguards;
    for (int b = 0; b < rig->scene->n_body; b++) {
        const pal_safeguards *from = &pal_world_body(rig->world, b)->safeguards;
        to->n_capped += from->n_capped, to->n_clamped += from->n_clamped, to->n_mass_scaled += from->n_mass_scaled;
        to->n_inversion += from->n_inversion, to->n_split += from->n_split, to->n_search += from->n_search;
        to->n_tool_reset += from->n_tool_reset, to->n_stopped += from->n_stopped, to->ns += from->ns;
    }
}

static double energy_limit(const pal_rig *rig)
{
    double limit = slack;
    for (int i = 0; i < pal_world_component_count(rig->world); i++) {
        const char *name = pal_world_component(rig->world, i)->effect->name;
        if (!strcmp(name, "verlet")) limit = fmax(limit, verlet_slack);
        if (!strcmp(name, "central_cg")) limit = central_slack;
    }
    return limit;
}

/* what was put in less than this is rounding, and a share of it says nothing */
static double nothing_J(const pal_rig *rig, int b)
{
    return nothing_share * pal_rig_cap_N(rig, b) * pal_world_body(rig->world, b)->length_scale_m;
}

static void judge(pal_rig *rig)
{
    pal_torture_result *out = rig->out;
    bool judged = !isnan(out->energy) && rig->scale_J > 0 && !rig->twin; /* who leads it does work all the time */
    for (int b = 0; b < rig->scene->n_body; b++) rig->scale_J = fmax(rig->scale_J, nothing_J(rig, b));
    out->limit = energy_limit(rig);
    out->energy = judged ? rig->excess_J / rig->scale_J : (double)NAN;
    out->forgiven = judged ? rig->forgiven_J / rig->scale_J : (double)NAN;
    if (out->verdict == PAL_VERDICT_SKIPPED) return;
    if (!out->finite) pal_rig_fail(rig, "a number was none");
    for (int b = 0; b < rig->scene->n_body; b++)
        if (rig->stopped[b] && !rig->may_stop[b]) pal_rig_fail(rig, "%s was stopped", rig->scene->body[b].name);
    if (out->finite && !out->frozen && judged && !(out->energy <= out->limit))
        pal_rig_fail(rig, "energy rose by %.2g of what was put in, allowed %.2g", out->energy, out->limit);
    if (out->verdict == PAL_VERDICT_FAILED || out->verdict == PAL_VERDICT_UNDECIDED) return;
    bool all_excused = true;
    for (int b = 0; b < rig->scene->n_body; b++) all_excused = all_excused && excused(rig, b);
    if (rig->late && !all_excused && !(rig->needs_rest && rig->asked_back))
        pal_rig_undecided(rig, "not judged, the time was over after %.1f simulated s: give more --seconds",
                          out->simulated_s);
    else if (rig->needs_rest && !rig->rests && !rig->twin)
        pal_rig_undecided(rig, "not judged, the scene does not come to rest by itself");
    else if (rig->needs_rest && !rig->asked_back)
        pal_rig_fail(rig, "%.2g %% S from rest at the end", 100 * asked_left(rig));
}

/* what was stopped, or stayed where it was, has to come to rest after a reset; the figures of the insult are kept */
static void check_reset(pal_rig *rig, double seconds)
{
    const double most_s = 10;
    pal_torture_result *out = rig->out, was = *out;
    const double now = 1e-9 * (double)pal_clock_thread_ns();
    pal_world_reset(rig->world);
    if (rig->twin) pal_world_reset(rig->twin);
    out->frozen = false, out->n_sample = 0, rig->late = false;
    memset(rig->stopped, 0, sizeof rig->stopped);
    memset(rig->may_stay, 0, sizeof rig->may_stay);
    rig->deadline_s = fmax(rig->deadline_s, now + 0.5 * seconds);
    pal_rig_relax(rig, most_s);
    const double left = out->left_S;
    const bool stopped = out->frozen || !out->finite, back = rig->asked_back;
    memcpy(was.diag, out->diag, sizeof was.diag);
    *out = was;
    if (stopped)
        pal_rig_fail(rig, "a reset did not bring it back");
    else if (rig->rests && !back && rig->late)
        pal_rig_undecided(rig, "not judged after its reset: give more --seconds");
    else if (rig->rests && !back)
        pal_rig_fail(rig, "%.2g %% S from rest %.0f s after a reset", 100 * left, most_s);
}

/* a solid of control cells that was folded has other rests, as elements of one rotation each do: what helps */
static bool is_folded(const pal_rig *rig)
{
    bool away = rig->out->verdict == PAL_VERDICT_FAILED && rig->needs_rest && !rig->asked_back && !rig->late;
    for (int b = 0; b < rig->scene->n_body && away; b++)
        if (pal_world_body(rig->world, b)->interpolation && !(body_left(rig, b) <= back_S)) return true;
    return false;
}

static void advise(pal_rig *rig)
{
    bool central = energy_limit(rig) == central_slack;
    pal_rig_say(rig, "a reset brings it back%s", central ? ", solver implicit_euler comes back from more" : "");
}

/* springs whose shape was taken away and that did not find it again by themselves */
static bool has_collapsed(const pal_rig *rig)
{
    for (int b = 0; b < rig->scene->n_body; b++)
        if (rig->may_stay[b] && (rig->stopped[b] || !(body_left(rig, b) <= back_S))) return true;
    return false;
}

static void run_one(pal_rig *rig, const pal_insult *insult, double seconds)
{
    pal_torture_result *out = rig->out;
    double begin = 1e-9 * (double)pal_clock_thread_ns();
    *out = (pal_torture_result){.name = insult->name,
                                .what = insult->what,
                                .criterion = insult->criterion,
                                .finite = true,
                                .left_S = NAN,
                                .back_s = NAN};
    rig->deadline_s = begin + seconds;
    rig->base_J = rig->scale_J = rig->excess_J = rig->allowed_J = rig->forgiven_J = 0;
    rig->n_skip = 1, rig->since = 0, rig->count = 0;
    rig->late = rig->needs_rest = rig->asked_back = false;
    memset(rig->stopped, 0, sizeof rig->stopped);
    memset(rig->may_stop, 0, sizeof rig->may_stop);
    memset(rig->may_stay, 0, sizeof rig->may_stay);
    if (!pal_rig_back_to_rest(rig)) {
        pal_rig_undecided(rig, "not judged, the scene did not come to rest before it");
        return;
    }
    pal_rig_rebase(rig);
    sample(rig);
    insult->run(rig);
    sum_rescues(rig);
    judge(rig);
    const bool folded = is_folded(rig), collapsed = has_collapsed(rig);
    bool reset = out->frozen || folded;
    for (int b = 0; b < rig->scene->n_body; b++) reset = reset || (rig->may_stay[b] && !(out->back_s < INFINITY));
    if (out->verdict != PAL_VERDICT_SKIPPED && reset) check_reset(rig, seconds);
    if (folded && rig->asked_back) advise(rig);
    if (collapsed && out->verdict == PAL_VERDICT_PASSED) {
        out->verdict = PAL_VERDICT_COLLAPSED;
        pal_rig_say(rig, "a reset brings it back");
    }
    out->took_s = 1e-9 * (double)pal_clock_thread_ns() - begin;
}

/* ---- all of them ---- */

static void look_at_rows(pal_rig *rig)
{
    bool first = true;
    for (int i = 0; i < pal_world_component_count(rig->world); i++) {
        const char *name = pal_world_component(rig->world, i)->effect->name;
        rig->anew |= !strcmp(name, "moving_support") || !strcmp(name, "inflate");
        if (strcmp(name, "tool_push")) continue;
        pal_component_info info;
        pal_world_component_info(rig->world, i, &info);
        for (int b = 0; b < rig->scene->n_body && first; b++)
            if (info.body == pal_world_body(rig->world, b)->name) rig->body = b, first = false;
        rig->touches = true;
    }
    for (int b = 0; b < rig->scene->n_body; b++) rig->anew |= pal_world_body(rig->world, b)->active != NULL;
}

static pal_err open_rig(pal_rig *rig, const pal_scene *scene)
{
    rig->scene = malloc(sizeof *rig->scene);
    if (!rig->scene) return PAL_ERR_MEMORY;
    *rig->scene = *scene;
    if (scene->n_tool < 2) {
        pal_tool_def own = scene->tool[0];
        pal_tools_default(rig->scene, 2);
        if (scene->n_tool == 1) rig->scene->tool[0] = own;
    }
    PAL_TRY(pal_world_create(rig->scene, rig->diag, &rig->world));
    for (int b = 0; b < scene->n_body; b++) {
        size_t n3 = 3 * (size_t)pal_world_body(rig->world, b)->n_dof;
        rig->rest[b] = calloc(n3 + 1, sizeof(double));
        rig->start[b] = calloc(n3 + 1, sizeof(double));
        if (!rig->rest[b] || !rig->start[b]) return PAL_ERR_MEMORY;
    }
    look_at_rows(rig);
    return PAL_ERR_OK;
}

static void close_rig(pal_rig *rig)
{
    pal_world_destroy(rig->world);
    pal_world_destroy(rig->twin);
    for (int b = 0; b < PAL_BODY_MAX; b++) free(rig->rest[b]), free(rig->start[b]);
    free(rig->scene);
}

static void count(pal_torture_report *out)
{
    for (int i = 0; i < out->n; i++) {
        pal_verdict verdict = out->result[i].verdict;
        out->n_passed += verdict == PAL_VERDICT_PASSED, out->n_failed += verdict == PAL_VERDICT_FAILED;
        out->n_collapsed += verdict == PAL_VERDICT_COLLAPSED;
        out->n_undecided += verdict == PAL_VERDICT_UNDECIDED, out->n_skipped += verdict == PAL_VERDICT_SKIPPED;
    }
}

/* processor time for everything: by what a step costs from the pose that was found */
static double enough_s(pal_rig *rig)
{
    enum { PROBE = 10 };
    double before = 1e-9 * (double)pal_clock_thread_ns();
    for (int i = 0; i < PROBE; i++) {
        for (int b = 0; b < rig->scene->n_body; b++) (void)pal_world_invalidate_limits(rig->world, b);
        (void)pal_world_step(rig->world, rig->scene->step_s);
    }
    double step_s = (1e-9 * (double)pal_clock_thread_ns() - before) / PROBE;
    return fmin(1800, fmax(least_s, typical_s / rig->scene->step_s * step_s));
}

static pal_err run_all(pal_rig *rig, pal_torture_report *out)
{
    const pal_torture_options *o = rig->options;
    double begin = 1e-9 * (double)pal_clock_thread_ns();
    rig->deadline_s = begin + (o->most_s > 0 ? 0.5 * o->most_s : least_s);
    if (o->progress && !o->progress("rest", 0, o->user)) return PAL_ERR_STATE;
    out->rests = rig->rests = pal_rig_settle(rig, &out->settle_s);
    if (!rig->rests && !rig->late) out->led = pal_rig_lead(rig);
    pal_rig_keep(rig, rig->rest);
    rig->patience_s = pal_rig_patience(rig);
    const double most_s = o->most_s > 0 ? o->most_s : enough_s(rig);
    for (int k = 0; k < N_INSULT; k++) {
        if (o->only && strcmp(o->only, insults[k].name)) continue;
        if (o->progress && !o->progress(insults[k].name, (double)k / N_INSULT, o->user))
            return pal_diagnostic_set(rig->diag, PAL_ERR_STATE, "stopped before the insult %s", insults[k].name);
        double left = begin + most_s - 1e-9 * (double)pal_clock_thread_ns();
        /* what is short leaves its time to the others; none takes more than a third of what is left */
        int n_left = o->only ? 1 : N_INSULT - k;
        rig->out = &out->result[out->n++];
        run_one(rig, &insults[k], fmax(0.2, n_left > 3 ? fmin(left / 3, 3 * left / n_left) : left / n_left));
    }
    count(out);
    out->took_s = 1e-9 * (double)pal_clock_thread_ns() - begin;
    return PAL_ERR_OK;
}

pal_err pal_torture(const pal_scene *scene, const pal_torture_options *options, pal_torture_report *out,
                    pal_diagnostic *diag)
{
    bool known = !options->only;
    for (int k = 0; k < N_INSULT && !known; k++) known = !strcmp(options->only, insults[k].name);
    if (!known) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "there is no insult \"%.60s\"", options->only);
    pal_rig rig = {.options = options, .diag = diag};
    pal_torture_report *report = calloc(1, sizeof *report);
    pal_err err = report ? open_rig(&rig, scene) : PAL_ERR_MEMORY;
    if (!err) err = run_all(&rig, report);
    if (!err) *out = *report;
    close_rig(&rig);
    free(report);
    return err;
}
