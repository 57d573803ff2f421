/* Verbs that switch the configuration of a body (protocol/README.md, "Configurations") to a point of its study or to
 * other parameters. hub_jobs.c prepares and commits. */
#include "server/net/hub_switch.h"

#include "server/net/hub_verb.h"

#include "server/net/hub_accuracy.h"
#include "server/net/hub_jobs.h"
#include "server/net/hub_peers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* no verb of a client: the configuration stands in the job */
#define OWN_VERB "switch"

/* finds a point of the room's study; false: an error was sent */
static bool read_point(pal_client *c, int body, const pal_wire_command *command, int *point, pal_configuration *to)
{
    const pal_hub_room *room = c->room;
    double index = pal_hub_arg(command, "index", -1);
    if (!room->study.configuration || body != room->study.body)
        return pal_hub_refuse(c, "refused", "study_point: there is no study of %s here",
                              pal_session_scene(room->session)->body[body].name);
    if (!(index >= 0 && index < room->study.n && index == floor(index)))
        return pal_hub_refuse(c, "args", "study_point: index %g, wanted 0 to %d", index, room->study.n - 1);
    *point = (int)index;
    *to = room->study.configuration[*point].configuration;
    return true;
}

/* the current configuration with the given parameters changed; false: an error was sent */
static bool read_parameters(pal_client *c, int body, const pal_wire_command *command, pal_configuration *to)
{
    double size = pal_hub_arg(command, "size", 0), step_ms = pal_hub_arg(command, "step_ms", 0),
           tolerance = pal_hub_arg(command, "tolerance", 0);
    pal_configuration_of(pal_session_scene(c->room->session), body, to);
    if (!(size >= -1 && size <= 10000 && size == floor(size)))
        return pal_hub_refuse(c, "args", "configure: size %g is no number of voxels or levels", size);
    bool other = size != 0 && (int)size != to->size;
    if (other && to->k_distance_J > 0)
        return pal_hub_refuse(
            c, "refused",
            "configure: the springs are calibrated for %d voxels, and their constants hold for no other size",
            to->size);
    if (other) to->size = (int)size;
    if (step_ms != 0) to->step_s = 1e-3 * step_ms;
    if (tolerance != 0) to->tolerance = tolerance;
    return true;
}

/* first switch: keeps the body as it is, so that the switch can be reverted */
static bool keep_base(pal_client *c, const pal_wire_command *command, pal_job *job)
{
    job->was = c->room->edits[job->body].base;
    if (job->was) return true;
    job->was = job->base = malloc(sizeof *job->base);
    if (job->base) *job->base = pal_session_scene(c->room->session)->body[job->body];
    return job->base || pal_hub_refuse(c, "refused", "%s: %s", command->verb, pal_err_text(PAL_ERR_MEMORY));
}

static bool read_switch(pal_client *c, const pal_wire_command *command, pal_job *job)
{
    int point = -1;
    job->body = pal_hub_find_body(c, command->target, c->room->study.configuration ? c->room->study.body : 0);
    if (job->body < 0) return false;
    pal_configuration_of(pal_session_scene(c->room->session), job->body, &job->before);
    if (!strcmp(command->verb, OWN_VERB)) return keep_base(c, command, job);
    if (!isnan(pal_hub_arg(command, "index", NAN)) ? !read_point(c, job->body, command, &point, &job->configuration)
                                                   : !read_parameters(c, job->body, command, &job->configuration))
        return false;
    pal_hub_shown_errors(c->room, job->body, point, &job->configuration, &job->error_now_m, &job->error_then_m);
    return keep_base(c, command, job);
}

static pal_err prepare_switch(pal_job *job, const pal_scene **scene)
{
    PAL_TRY(pal_configuration_switch_prepare(job->scene, job->was, job->body, &job->configuration, &job->diag,
                                             &job->made.change));
    *scene = &job->made.change->set->scene;
    return PAL_ERR_OK;
}

static void transfer_switch(pal_job *job)
{
    pal_material material[PAL_BODY_MAX];
    for (int b = 0; b < job->scene->n_body; b++) material[b] = job->scene->body[b].material;
    const pal_session_change change = {.body = job->body, .configuration = &job->configuration, .material = material};
    pal_session_rehearse(job->made.session, job->session, &change, pal_configuration_switch_snapshot,
                         pal_configuration_switch_rehearse, job->made.change);
    pal_session_transfer_begin(job->made.session, job->session, &change, pal_configuration_switch_transfer,
                               job->made.change);
    job->report = job->made.change->report;
}

static void commit_switch(pal_hub_body_edits *at, pal_job *job, pal_job_products *retired)
{
    retired->change = at->change;
    at->change = job->made.change;
    at->base = job->base ? job->base : at->base;
    job->made.change = NULL, job->base = NULL;
}

/* adds the displacement caused by the switch, and its bound from the displayed errors */
static void put_jump(const pal_hub *hub, const pal_job *job, double change, pal_wire_answer *a)
{
    const pal_transfer_report *r = &job->report;
    double bound_m = job->error_now_m + job->error_then_m, frame_mm = 1e3 * r->frame_move_m,
           max_mm = 1e3 * r->max_move_m;
    bool far = r->max_move_m > bound_m + hub->error_m;
    size_t n = strlen(a->text), room = sizeof a->text - n;
    if (isnan(bound_m))
        snprintf(a->text + n, room,
                 "moves %.3g mm, %.3g mm a frame (no bound: no error is shown of both configurations)", max_mm,
                 frame_mm);
    else
        snprintf(a->text + n, room, "moves %.3g mm, %s the bound of %.3g mm, %.3g mm a frame", max_mm,
                 far ? "beyond" : "within", 1e3 * bound_m, frame_mm);
    pal_hub_answer_arg(a, "energy_before_J", r->energy_before_J);
    pal_hub_answer_arg(a, "energy_after_J", r->energy_after_J);
    pal_hub_answer_arg(a, "energy_percent", change);
    pal_hub_answer_arg(a, "max_move_m", r->max_move_m);
    pal_hub_answer_arg(a, "max_body_move_m", r->body_move_m);
    pal_hub_answer_arg(a, "max_frame_move_m", r->frame_move_m);
    if (isnan(bound_m)) return;
    pal_hub_answer_arg(a, "error_before_m", job->error_now_m);
    pal_hub_answer_arg(a, "error_after_m", job->error_then_m);
    pal_hub_answer_arg(a, "bound_m", bound_m);
}

static void answer_switch(pal_client *c, const pal_job *job)
{
    const pal_transfer_report *r = &job->report;
    char text[PAL_CONFIGURATION_TEXT];
    pal_configuration now;
    /* below this the energy of a body at rest is rounding, J */
    bool any = r->energy_before_J > 1e-15;
    double change = any ? 100 * (r->energy_after_J / r->energy_before_J - 1) : 0;
    int n_rehearsed;
    double prepare_ms = 1e-6 * (double)(job->made_ns - job->asked_ns),
           pause_ms = 1e3 * pal_session_pause_s(c->room->session, &n_rehearsed);
    pal_configuration_of(pal_session_scene(c->room->session), job->body, &now);
    pal_wire_answer *a = pal_hub_answer_begin(c, job->verb);
    snprintf(a->text, sizeof a->text, "%s: %s; prepared in %.0f ms, paused for %.0f ms; energy %+.2f %%%s, ", job->verb,
             pal_configuration_text(&now, text), prepare_ms, pause_ms, change, fabs(change) > 2 ? ", beyond 2 %" : "");
    put_jump(c->hub, job, change, a);
    if (job->n_brush_ended > 0) {
        size_t n = strlen(a->text);
        snprintf(a->text + n, sizeof a->text - n, "; brushes that ended: %d", job->n_brush_ended);
    }
    pal_hub_answer_arg(a, "brushes_ended", job->n_brush_ended);
    pal_hub_answer_arg(a, "prepare_ms", prepare_ms);
    pal_hub_answer_arg(a, "pause_ms", pause_ms);
    pal_hub_send(c);
}

static const pal_job_type switch_job = {.read = read_switch,
                                        .prepare = prepare_switch,
                                        .transfer = transfer_switch,
                                        .commit = commit_switch,
                                        .answer = answer_switch,
                                        .keeps_brushes = true,
                                        .switches = true};

bool pal_hub_switch_to(pal_hub_room *room, int body, const pal_configuration *to, int quality)
{
    pal_wire_command command = {.verb = OWN_VERB};
    snprintf(command.target, sizeof command.target, "%s", pal_session_scene(room->session)->body[body].name);
    return pal_hub_jobs_enqueue_own(room, &switch_job, &command, to, quality);
}

bool pal_hub_run_switch(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    if (command->n_arg == 0) return pal_hub_refuse(c, "args", "%s takes %s", verb->name, verb->args + strlen("| "));
    return pal_hub_jobs_enqueue(c, &switch_job, command);
}
