/* Accuracy and cost as clients see them (protocol/README.md): the points of the study once, then the estimate of a
 * body at every tick of the hub, to its subscribers. Subscribers are counted as for fields; without one, the session
 * has no estimator. */
#include "server/net/hub_accuracy.h"

#include "server/base/log.h"
#include "server/net/hub_peers.h"
#include "server/net/transport/plain_text.h"
#include "server/net/tuning.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* points of one method form one curve: "fem hex8_bbar", "tet_springs calibrated" */
static void method_text(const pal_configuration *s, char out[PAL_WIRE_METHOD_BYTES])
{
    char text[3 * PAL_NAME];
    snprintf(text, sizeof text, "%s%s%s%s", s->model, s->element[0] ? " " : "", s->element,
             s->k_distance_J > 0 ? " calibrated" : "");
    pal_plain_text(out, PAL_WIRE_METHOD_BYTES, text);
}

static void send_study(pal_client *c, int body)
{
    const pal_hub_room *room = c->room;
    pal_wire_study *study = &pal_hub_message(c->hub, PAL_CONTROL_STUDY)->study;
    int n = room->study.body == body ? room->study.n : 0, n_front = 0;
    pal_plain_text(study->body, sizeof study->body, room->stream->part[body].info.name);
    study->step_ms = 1e3 * room->step_s;
    study->reference_m = n > 0 ? room->study.reference_m : NAN;
    for (int i = 0; i < n; i++) n_front += room->study.configuration[i].front;
    /* as many as fit, Pareto-optimal points first */
    int room_left = PAL_WIRE_POINT_MAX - (n_front < PAL_WIRE_POINT_MAX ? n_front : PAL_WIRE_POINT_MAX);
    for (int i = 0; i < n && study->n_point < PAL_WIRE_POINT_MAX; i++) {
        const pal_measured_configuration *p = &room->study.configuration[i];
        char text[PAL_CONFIGURATION_TEXT];
        if (!isfinite(p->ms) || !isfinite(p->error_m) || (!p->front && room_left == 0)) continue;
        room_left -= !p->front;
        pal_wire_study_point *to = &study->point[study->n_point++];
        *to = (pal_wire_study_point){.index = (uint32_t)i,
                                     .cost_ms = p->ms,
                                     .error_m = p->error_m,
                                     .pareto_optimal = p->front,
                                     .force_percent = p->force_percent > 0 ? p->force_percent : NAN};
        method_text(&p->configuration, to->method);
        pal_plain_text(to->label, sizeof to->label, pal_configuration_text(&p->configuration, text));
    }
    pal_hub_send(c);
}

/* Similarity of a study configuration to the current one: the number of values that it specifies, -1 if one differs.
 * An unspecified word or number matches anything. */
static int likeness(const pal_configuration *of, const pal_configuration *now)
{
    const char *const word[][2] = {
        {of->model, now->model}, {of->element, now->element}, {of->law, now->law}, {of->solver, now->solver}};
    const double value[][2] = {{of->size, now->size},
                               {of->step_s, now->step_s},
                               {of->tolerance, now->tolerance},
                               {of->k_distance_J, now->k_distance_J}};
    int n_same = 0;
    for (int i = 0; i < 4; i++) {
        bool same = !strcmp(word[i][0], word[i][1]);
        if (!same && (i == 0 || (word[i][0][0] && word[i][1][0]))) return -1;
        n_same += same;
    }
    for (int i = 0; i < 4; i++) {
        double a = value[i][0], b = value[i][1];
        bool same = fabs(a - b) <= 1e-6 * fabs(a), open = i < 3 && (a == 0 || b == 0);
        if (!same && !open) return -1;
        n_same += same;
    }
    return n_same;
}

/* index in the study of the current configuration; NaN: none matches */
static double point_of(const pal_hub_room *room, int body, const pal_configuration *now)
{
    int best = -1, best_same = -1;
    for (int i = 0; i < room->study.n && room->study.body == body; i++) {
        int n_same = likeness(&room->study.configuration[i].configuration, now);
        if (n_same > best_same) best = i, best_same = n_same;
    }
    return best < 0 ? NAN : (double)best;
}

double pal_hub_study_ms(const pal_hub_room *room, int body, const pal_configuration *of)
{
    const double point = point_of(room, body, of);
    return isnan(point) ? NAN : room->study.configuration[(int)point].ms;
}

static double error_of(const pal_hub_room *room, double point)
{
    return isnan(point) ? NAN : room->study.configuration[(int)point].error_m;
}

static bool near(double a, double b)
{
    return fabs(a - b) <= 1e-6 * fabs(a);
}

/* a neighbour is the current configuration with one parameter changed, so every value is specified */
static bool is_neighbour(const pal_configuration *of, const pal_configuration *to)
{
    return likeness(of, to) >= 0 && of->size == to->size && near(of->step_s, to->step_s) &&
           near(of->tolerance, to->tolerance);
}

/* outdated: the body has taken steps for a second since, or has woken */
static bool is_old(const pal_estimate *e)
{
    return e->age_s > PAL_HUB_ESTIMATE_OLD_S || (e->age_s > 0 && e->asleep);
}

void pal_hub_shown_errors(const pal_hub_room *room, int body, int point, const pal_configuration *to, double *now_m,
                          double *then_m)
{
    pal_estimate e;
    pal_configuration now;
    bool looked = pal_session_estimate(room->session, body, &e);
    pal_configuration_of(pal_session_scene(room->session), body, &now);
    *now_m = *then_m = NAN;
    if (looked && is_old(&e)) return;
    *now_m = looked && isfinite(e.error_m) ? e.error_m : error_of(room, point_of(room, body, &now));
    for (int i = 0; looked && point < 0 && i < e.n_neighbour; i++)
        if (is_neighbour(&e.neighbour[i].configuration, to)) *then_m = e.neighbour[i].error_m;
    if (!isfinite(*then_m)) *then_m = error_of(room, point < 0 ? point_of(room, body, to) : (double)point);
}

static double known(double value)
{
    return isfinite(value) ? value : NAN;
}

/* cost of the steps that replace one step of the opened scene: comparable across step lengths */
static double step_cost_ms(const pal_hub_room *room, double ms, double step_s)
{
    return isfinite(ms) && step_s > 0 ? ms * room->step_s / step_s : NAN;
}

/* a neighbour's ms is per current step; for half the step length it already contains two steps */
static void put_neighbour(const pal_hub_room *room, const pal_measured_configuration *from,
                          const pal_configuration *now, pal_wire_neighbour *to)
{
    const pal_configuration *s = &from->configuration;
    char text[PAL_CONFIGURATION_TEXT];
    bool step = s->step_s > 0 && fabs(s->step_s - now->step_s) > 1e-9;
    bool tolerance = s->tolerance > 0 && s->tolerance != now->tolerance;
    bool method = strcmp(s->model, now->model) || strcmp(s->element, now->element) || strcmp(s->law, now->law);
    *to = (pal_wire_neighbour){.cost_ms = step_cost_ms(room, from->ms, now->step_s), .error_m = known(from->error_m)};
    if (s->size > 0 && s->size != now->size) to->size = (uint32_t)s->size;
    if (step) to->step_ms = 1e3 * s->step_s;
    if (tolerance) to->tolerance = s->tolerance;
    snprintf(to->parameter, sizeof to->parameter, "%s",
             method      ? "method"
             : to->size  ? "resolution"
             : step      ? "step"
             : tolerance ? "tolerance"
                         : "solver");
    pal_plain_text(to->label, sizeof to->label, pal_configuration_text(s, text));
}

static void put_estimate(const pal_hub_room *room, const pal_estimate *from, const pal_configuration *now,
                         pal_wire_estimate *to)
{
    to->tick = from->tick, to->age_s = from->age_s;
    to->time_s = isfinite(from->time_s) ? from->time_s : 0;
    to->estimate_ms = isfinite(from->estimate_ms) ? from->estimate_ms : 0;
    if (isfinite(from->ms) && from->ms > 0) to->cost_ms = step_cost_ms(room, from->ms, now->step_s);
    to->max_displacement_m = known(from->max_m), to->error_m = known(from->error_m);
    to->discretisation_m = known(from->discretisation_m), to->algebraic_m = known(from->algebraic_m);
    to->time_m = known(from->time_m), to->model_m = known(from->model_m),
    to->energy_error_percent = known(from->energy_error_percent);
    to->force_percent = known(from->force_percent);
    to->locking = from->locking;
    pal_plain_text(to->diag, sizeof to->diag, from->diag);
    for (int i = 0; i < from->n_neighbour && i < PAL_WIRE_NEIGHBOUR_MAX; i++)
        put_neighbour(room, &from->neighbour[i], now, &to->neighbour[to->n_neighbour++]);
}

/* the study covers the scene's own loads; a larger displacement can exceed the tolerance, which is reported once */
static void report_far(pal_hub_room *room, const pal_wire_estimate *e)
{
    double asked = pal_session_scene(room->session)->max_error_m;
    if (room->reported_far || !(asked > 0) || !(e->error_m > asked)) return;
    room->reported_far = true;
    pal_log(PAL_LOG_WARN, "accuracy",
            "%s: the estimate is %.3g mm at %.3g mm moved, beyond the %.3g mm that the scene asks for", e->body,
            1e3 * e->error_m, 1e3 * e->max_displacement_m, 1e3 * asked);
}

/* first body whose estimate is due; -1: none */
static int due_body(const pal_client *c)
{
    for (int b = 0; b < c->room->stream->n_part; b++)
        if (c->estimate_due[b]) return b;
    return -1;
}

bool pal_hub_wants_estimate(const pal_client *c)
{
    return due_body(c) >= 0;
}

pal_packet *pal_hub_next_estimate(pal_client *c)
{
    pal_estimate estimate;
    pal_configuration now;
    char text[PAL_CONFIGURATION_TEXT];
    int b = due_body(c);
    if (b < 0) return NULL;
    pal_wire_estimate *out = &pal_hub_message(c->hub, PAL_CONTROL_ESTIMATE)->estimate;
    c->estimate_due[b] = false;
    pal_plain_text(out->body, sizeof out->body, c->room->stream->part[b].info.name);
    pal_configuration_of(pal_session_scene(c->room->session), b, &now);
    pal_plain_text(out->configuration, sizeof out->configuration, pal_configuration_text(&now, text));
    out->study_point = point_of(c->room, b, &now);
    /* defaults without an estimate; the step time of a sleeping body gives no cost of its configuration */
    const pal_frame *f = c->room->stream->frame;
    bool awake = !f || b >= f->n_part || !f->part[b].asleep;
    bool known_ms = awake && c->room->stream->step_ms > 0;
    out->cost_ms = known_ms ? step_cost_ms(c->room, c->room->stream->step_ms, now.step_s) : NAN;
    out->age_s = out->max_displacement_m = out->error_m = out->discretisation_m = out->algebraic_m = out->time_m =
        out->model_m = out->force_percent = out->energy_error_percent = NAN;
    if (pal_session_estimate(c->room->session, b, &estimate)) put_estimate(c->room, &estimate, &now, out);
    report_far(c->room, out);
    return pal_hub_encode(c->hub);
}

void pal_hub_estimates_due(pal_client *c)
{
    for (int b = 0; b < c->room->stream->n_part; b++) c->estimate_due[b] = c->estimate[b];
}

bool pal_hub_run_estimate(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    (void)verb;
    int body = pal_hub_find_body(c, command->target, 0);
    if (body < 0) return false;
    bool wanted = pal_hub_arg(command, "enabled", 0) != 0, before = c->estimate[body];
    pal_hub_set_estimate(c, body, wanted);
    pal_hub_update_subscriptions(c->room);
    if (wanted && !before) send_study(c, body);
    c->estimate_due[body] = wanted;
    c->peer->ops->ready(c->peer);
    return true;
}
