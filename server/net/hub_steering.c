/* Verbs that control a session, and playback. */
#include "server/net/hub_steering.h"

#include "server/net/hub_jobs.h"
#include "server/net/hub_news.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_plan.h"
#include "server/net/hub_verb.h"
#include "server/net/transport/plain_text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* no verb of a client: past the edit or switch where the session waits */
#define OWN_VERB "go on"

bool pal_hub_run_steering(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    (void)command;
    return pal_hub_session_command(c, verb->name, &(pal_command){.kind = (pal_command_kind)verb->detail});
}

/* a body is frozen for everybody, so everybody may reset it */
bool pal_hub_run_reset(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    const pal_frame *f = c->room->stream->frame;
    bool whole = !command->target[0];
    int body = pal_hub_find_body(c, command->target, 0);
    if (body < 0) return false;
    if (!pal_hub_may(c, PAL_RIGHT_STEER) && (whole || !f || body >= f->n_part || !f->part[body].frozen))
        return pal_hub_refuse(c, "role", "reset: only for %s, but for a frozen body", pal_right_text[PAL_RIGHT_STEER]);
    if (!pal_hub_session_command(
            c, verb->name,
            &(pal_command){.kind = whole ? PAL_COMMAND_RESET : PAL_COMMAND_RESET_BODY, .body = whole ? 0 : body}))
        return false;
    pal_hub_note_order(c, command);
    return true;
}

bool pal_hub_run_material(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    int body = pal_hub_find_body(c, command->target, 0);
    if (body < 0) return false;
    pal_material before, m;
    pal_session_material(c->room->session, body, &before);
    m = before;
    m.young_Pa = pal_hub_arg(command, "young_Pa", m.young_Pa);
    m.poisson = pal_hub_arg(command, "poisson", m.poisson);
    m.density_kg_m3 = pal_hub_arg(command, "density_kg_m3", m.density_kg_m3);
    m.damping_1_s = pal_hub_arg(command, "damping_1_s", m.damping_1_s);
    pal_command order = {
        .kind = PAL_COMMAND_MATERIAL, .body = body, .material = m, .in_time = !pal_hub_is_instructor(c)};
    if (!pal_hub_session_command(c, verb->name, &order)) return false;
    pal_hub_await_answer(c, verb->name);
    order.material = before, order.in_time = false;
    pal_hub_undo_by_command(c, verb->name, &order);
    return true;
}

/* ---- playback ---- */

static bool read_seek(pal_client *c, const pal_wire_command *command, pal_job *job)
{
    const pal_recording *recording = c->room->recording.recording;
    pal_playing playing;
    const bool plays = pal_hub_playing(c->room, &playing);
    job->recording = &c->room->recording;
    job->goes_live = !strcmp(command->verb, "branch");
    job->step = playing.step;
    if (job->goes_live && !plays) return pal_hub_refuse(c, "refused", "branch: the session is live already");
    if (!strcmp(command->verb, OWN_VERB)) job->step = pal_recording_behind(recording, playing.step);
    if (!strcmp(command->verb, "seek")) job->step = pal_recording_step(recording, pal_hub_arg(command, "time_s", 0));
    return true;
}

static pal_err prepare_seek(pal_job *job, const pal_scene **scene)
{
    job->made.edits = calloc(PAL_BODY_MAX, sizeof *job->made.edits);
    if (!job->made.edits) return PAL_ERR_MEMORY;
    PAL_TRY(pal_recording_seek(job->recording->recording, job->step, job->goes_live && job->recording->record_path,
                               &job->diag, &job->made.resume));
    *scene = pal_resume_scene(job->made.resume);
    return PAL_ERR_OK;
}

static void transfer_seek(pal_job *job)
{
    pal_session_transfer_begin(job->made.session, job->session, NULL, NULL, NULL);
}

static void commit_seek(pal_hub_body_edits *edits, pal_job *job, pal_job_products *retired)
{
    memcpy(job->made.edits, edits, sizeof *edits * PAL_BODY_MAX);
    pal_hub_take_edits(edits, job->made.resume);
    retired->edits = job->made.edits, retired->resume = job->made.resume;
    job->made.edits = NULL, job->made.resume = NULL;
}

static void answer_seek(pal_client *c, const pal_job *job)
{
    const pal_recording *recording = c->room->recording.recording;
    const double time_s = pal_recording_time_s(recording, job->step),
                 prepare_ms = 1e-6 * (double)(job->made_ns - job->asked_ns);
    pal_wire_answer *a = pal_hub_answer_begin(c, job->verb);
    snprintf(a->text, sizeof a->text, "%s: %s at %.1f s of %.1f s, prepared in %.0f ms", job->verb,
             job->goes_live ? "live" : "the recording", time_s, pal_recording_length_s(recording), prepare_ms);
    pal_hub_answer_arg(a, "time_s", time_s);
    pal_hub_answer_arg(a, "prepare_ms", prepare_ms);
    pal_hub_send(c);
}

static const pal_job_type seek_job = {.read = read_seek,
                                      .prepare = prepare_seek,
                                      .transfer = transfer_seek,
                                      .commit = commit_seek,
                                      .answer = answer_seek,
                                      .seeks = true};

static bool has_recording(pal_client *c, const pal_verb *verb)
{
    return c->room->recording.recording ||
           pal_hub_refuse(c, "refused", "%s: the session has no recording (palpate serve SCENE --replay LOG)",
                          verb->name);
}

bool pal_hub_run_seek(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    return has_recording(c, verb) && pal_hub_jobs_enqueue(c, &seek_job, command);
}

bool pal_hub_run_branch(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    return has_recording(c, verb) && pal_hub_jobs_enqueue(c, &seek_job, command);
}

bool pal_hub_run_speed(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    const double speed = pal_hub_arg(command, "factor", 1);
    if (!has_recording(c, verb)) return false;
    if (!(speed >= PAL_SPEED_MIN && speed <= PAL_SPEED_MAX))
        return pal_hub_refuse(c, "args", "speed: factor %g, wanted %g to %g", speed, PAL_SPEED_MIN, PAL_SPEED_MAX);
    return pal_hub_session_command(c, verb->name, &(pal_command){.kind = PAL_COMMAND_SPEED, .speed = speed});
}

void pal_hub_play_on(pal_hub_room *room)
{
    pal_playing playing;
    if (!pal_hub_playing(room, &playing) || playing.state != PAL_PLAYS_CHANGE || playing.step == room->passed_step ||
        pal_hub_jobs_busy(room))
        return;
    if (pal_hub_jobs_enqueue_own(room, &seek_job, &(pal_wire_command){.verb = OWN_VERB}, NULL, 0))
        room->passed_step = playing.step;
}

void pal_hub_playback_status(const pal_hub_room *room, pal_wire_status *status)
{
    const pal_recording *recording = room->recording.recording;
    pal_playing playing;
    if (!recording) return;
    const bool plays = pal_hub_playing(room, &playing);
    status->playback[status->n_playback++] =
        (pal_wire_playback){.plays = plays,
                            .time_s = pal_recording_time_s(recording, plays ? playing.step : room->left_step),
                            .length_s = pal_recording_length_s(recording),
                            .speed = plays ? playing.speed : 1,
                            .ended = playing.state == PAL_PLAYS_END};
}

void pal_hub_playback_marks(const pal_hub_room *room, pal_wire_hello *hello)
{
    int n;
    if (!room->recording.recording) return;
    const pal_recording_mark *mark = pal_recording_marks(room->recording.recording, &n);
    hello->n_mark = (uint32_t)(n < PAL_WIRE_MARK_MAX ? n : PAL_WIRE_MARK_MAX);
    for (uint32_t k = 0; k < hello->n_mark; k++) {
        const pal_recording_mark *from = &mark[(size_t)k * (size_t)n / hello->n_mark];
        hello->mark[k].time_s = from->time_s;
        pal_plain_text(hello->mark[k].text, sizeof hello->mark[k].text, from->text);
    }
}
