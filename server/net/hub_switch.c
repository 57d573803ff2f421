/* Orders for another setting at the hub (protocol/README.md, "Settings"): a point of the study, or a knob turned.
 * Made and put in place by hub_jobs.c. */
#include "server/net/hub_jobs.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct verb {
    const char *name, *args;
} verbs[] = {{"study_point", "index"}, {"configure", "| size step_ms tolerance"}, {NULL, NULL}};

static const struct verb *find_verb(const char *name)
{
    const struct verb *v = verbs;
    while (v->name && strcmp(v->name, name)) v++;
    return v->name ? v : NULL;
}

/* the body named; "": that of the study, or the first. -1: complained */
static int find_body(pal_hub *hub, pal_client *c, const pal_wire_command *order)
{
    const pal_scene *scene = pal_session_scene(c->room->session);
    if (!order->target[0]) return c->room->setting ? c->room->setting_body : 0;
    for (int b = 0; b < scene->n_body; b++)
        if (!strcmp(scene->body[b].name, order->target)) return b;
    pal_hub_send_error(hub, c, "target", "there is no body %s", order->target);
    return -1;
}

/* a point of the room's study; -1: complained */
static int read_point(pal_hub *hub, pal_client *c, int body, const pal_wire_command *order)
{
    const pal_hub_room *room = c->room;
    double index = pal_hub_arg(order, "index")->value;
    if (!room->setting || body != room->setting_body) {
        pal_hub_send_error(hub, c, "refused", "study_point: there is no study of %s here",
                           pal_session_scene(room->session)->body[body].name);
        return -1;
    }
    if (!(index >= 0 && index < room->n_configuration && index == floor(index))) {
        pal_hub_send_error(hub, c, "args", "study_point: index %g, wanted 0 to %d", index, room->n_configuration - 1);
        return -1;
    }
    return (int)index;
}

/* the present setting with other numbers; false: complained */
static bool read_knob(pal_hub *hub, pal_client *c, int body, const pal_wire_command *order, pal_configuration *to)
{
    const pal_wire_arg *size = pal_hub_arg(order, "size"), *step = pal_hub_arg(order, "step_ms"),
                       *tolerance = pal_hub_arg(order, "tolerance");
    pal_configuration_of(pal_session_scene(c->room->session), body, to);
    if (size && !(size->value >= -1 && size->value <= 10000 && size->value == floor(size->value))) {
        pal_hub_send_error(hub, c, "args", "configure: size %g is no number of voxels or levels", size->value);
        return false;
    }
    bool other = size && size->value != 0 && (int)size->value != to->size;
    if (other && to->k_distance_J > 0) {
        pal_hub_send_error(
            hub, c, "refused",
            "configure: the springs are calibrated for %d voxels, and their constants hold for no other size",
            to->size);
        return false;
    }
    if (other) to->size = (int)size->value;
    if (step && step->value != 0) to->step_s = 1e-3 * step->value;
    if (tolerance && tolerance->value != 0) to->tolerance = tolerance->value;
    return true;
}

bool pal_hub_switch_read(pal_hub *hub, pal_client *c, const pal_wire_command *order, pal_job *to, int *body)
{
    const pal_scene *scene = pal_session_scene(c->room->session);
    bool by_point = !strcmp(order->verb, "study_point");
    *body = to->body = find_body(hub, c, order);
    if (*body < 0) return false;
    int point = by_point ? read_point(hub, c, *body, order) : -1;
    if (by_point ? point < 0 : !read_knob(hub, c, *body, order, &to->setting)) return false;
    if (by_point) to->setting = c->room->setting[point].setting;
    pal_hub_shown_errors(c->room, *body, point, &to->setting, &to->now_m, &to->then_m);
    to->was = hub->jobs->place[c->room - hub->room][*body].base;
    if (to->was) return true;
    /* its first switch: what it can come back to is what it is now */
    to->base = malloc(sizeof *to->base);
    if (to->base) *to->base = scene->body[*body];
    to->was = to->base;
    if (!to->base) pal_hub_send_error(hub, c, "refused", "%s: %s", order->verb, pal_err_text(PAL_ERR_MEMORY));
    return to->base != NULL;
}

/* what jumped, against what was promised */
static void put_jump(const pal_hub *hub, const pal_job *work, double change, pal_wire_answer *a)
{
    const pal_configuration_switch_report *r = &work->report;
    double bound_m = work->now_m + work->then_m, frame_mm = 1e3 * r->frame_move_m, most_mm = 1e3 * r->max_move_m;
    bool far = r->max_move_m > bound_m + hub->error_m;
    size_t n = strlen(a->text), room = sizeof a->text - n;
    if (isnan(bound_m))
        snprintf(a->text + n, room, "moves %.3g mm, %.3g mm a frame (no bound: no error is shown of both settings)",
                 most_mm, frame_mm);
    else
        snprintf(a->text + n, room, "moves %.3g mm, %s the bound of %.3g mm, %.3g mm a frame", most_mm,
                 far ? "beyond" : "within", 1e3 * bound_m, frame_mm);
    pal_hub_answer_arg(a, "energy_before_J", r->energy_before_J);
    pal_hub_answer_arg(a, "energy_after_J", r->energy_after_J);
    pal_hub_answer_arg(a, "energy_percent", change);
    pal_hub_answer_arg(a, "max_move_m", r->max_move_m);
    pal_hub_answer_arg(a, "max_body_move_m", r->body_move_m);
    pal_hub_answer_arg(a, "max_frame_move_m", r->frame_move_m);
    if (isnan(bound_m)) return;
    pal_hub_answer_arg(a, "error_before_m", work->now_m);
    pal_hub_answer_arg(a, "error_after_m", work->then_m);
    pal_hub_answer_arg(a, "bound_m", bound_m);
}

void pal_hub_switch_answer(pal_hub *hub, pal_client *c, const pal_job *work)
{
    const char *verb = hub->jobs->now.order.verb;
    const pal_configuration_switch_report *r = &work->report;
    char text[PAL_CONFIGURATION_TEXT];
    pal_configuration now;
    /* a body at rest has no energy but rounding */
    bool any = r->energy_before_J > 1e-15;
    double change = any ? 100 * (r->energy_after_J / r->energy_before_J - 1) : 0;
    int n_rehearsed;
    double made_ms = 1e-6 * (double)(work->made_ns - work->asked_ns),
           stood_ms = 1e3 * pal_session_pause_s(c->room->session, &n_rehearsed);
    pal_configuration_of(pal_session_scene(c->room->session), work->body, &now);
    pal_wire_answer *a = pal_hub_answer_begin(hub, verb);
    snprintf(a->text, sizeof a->text, "%s: %s; made in %.0f ms, stood still for %.0f ms; energy %+.2f %%%s, ", verb,
             pal_configuration_text(&now, text), made_ms, stood_ms, change, fabs(change) > 2 ? ", beyond 2 %" : "");
    put_jump(hub, work, change, a);
    if (hub->jobs->n_brush_over > 0) {
        size_t n = strlen(a->text);
        snprintf(a->text + n, sizeof a->text - n, "; brushes that ended: %d", hub->jobs->n_brush_over);
    }
    pal_hub_answer_arg(a, "brushes_ended", hub->jobs->n_brush_over);
    pal_hub_answer_arg(a, "prepare_ms", made_ms);
    pal_hub_answer_arg(a, "pause_ms", stood_ms);
    pal_hub_send(hub, c, hub->control);
}

bool pal_hub_switch_command(pal_hub *hub, pal_client *c, const pal_wire_command *order)
{
    const struct verb *v = find_verb(order->verb);
    if (!v) return false;
    if (!pal_hub_jobs_check_rights(hub, c, v->name, "changes settings") || !pal_hub_check_args(hub, c, v->args, order))
        return true;
    if (order->n_arg == 0)
        pal_hub_send_error(hub, c, "args", "%s takes %s", v->name, v->args + 2);
    else if (!pal_hub_jobs_create(hub))
        pal_hub_send_error(hub, c, "refused", "%s: %s", v->name, pal_err_text(PAL_ERR_MEMORY));
    else
        pal_hub_jobs_enqueue(hub, c, PAL_JOB_SWITCH, order);
    return true;
}
