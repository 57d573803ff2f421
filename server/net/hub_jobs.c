/* The queue of commands before the job worker, and the commit of its results. */
#include "server/net/hub_jobs.h"

#include "server/net/hub_peers.h"
#include "server/net/hub_plan.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* NULL: has left */
static pal_client *requester(pal_hub *hub, const pal_hub_pending_job *w)
{
    for (int i = 0; i < hub->max_clients; i++) {
        pal_client *c = &hub->client[i];
        if (c->peer && c->room == w->room && c->id == w->member && !c->peer->drop_code) return c;
    }
    return NULL;
}

/* keeps replaced assets for a while, because clients may be about to fetch them */
static void keep_assets(pal_hub_room *room, const pal_stream *before)
{
    for (int p = 0; p < before->n_part; p++) {
        const pal_stream_part *part = &before->part[p];
        if (p < room->stream->n_part && !strcmp(part->info.asset, room->stream->part[p].info.asset)) continue;
        pal_hub_old_asset *past = &room->past[room->n_old_asset];
        snprintf(past->path, sizeof past->path, "%s", part->info.asset);
        pal_packet_replace(&past->asset, pal_packet_hold(part->asset));
        room->n_old_asset = (room->n_old_asset + 1) % PAL_HUB_OLD_ASSETS;
    }
}

/* Repeats the brushes of the replaced session in the new one, where the job type keeps them. Returns the number
 * ended. */
static int begin_brushes(pal_hub_tool_brush *brush, pal_hub_room *room, const pal_job_type *type)
{
    int n_ended = 0;
    for (int t = 0; t < PAL_TOOL_MAX; t++) {
        pal_hub_tool_brush *h = &brush[t];
        if (h->brush.kind == PAL_BRUSH_NONE) continue;
        const pal_member_entry *m = pal_members_find(&room->members, h->member);
        pal_command command = {.kind = PAL_COMMAND_BRUSH, .body = h->body, .slot = t, .brush = h->brush};
        bool acts = m && m->tool == t,
             stays = acts && type->keeps_brushes && room->stream->part[h->body].info.is_sculptable;
        if (stays && pal_session_command(room->session, &command) == PAL_ERR_OK) continue;
        n_ended += acts;
        command.brush.kind = PAL_BRUSH_NONE;
        (void)pal_session_command(room->session, &command);
        *h = (pal_hub_tool_brush){.member = 0};
    }
    return n_ended;
}

/* replaces the running session by the result; false: it continues unchanged, diag gives the reason */
static bool commit(pal_hub *hub, pal_hub_jobs *s, pal_job *job)
{
    pal_hub_room *room = s->current.room;
    pal_retired retired = {.stream = room->stream, .session = room->session};
    job->err = pal_session_transfer_end(job->next, room->session, &job->diag);
    if (job->err) return false;
    pal_stream_transfer(job->stream, room->stream);
    room->stream = job->stream, room->session = job->next;
    job->next = NULL, job->stream = NULL;
    job->type->commit(pal_hub_edits(hub, room, job->body), job, &retired);
    job->n_brush_ended = begin_brushes(s->brush[room - hub->room], room, job->type);
    keep_assets(room, retired.stream);
    hub->session[room - hub->room] = NULL;
    room->own = true;
    pal_job_worker_retire(s->worker, &retired);
    return true;
}

static void send_topology(pal_hub *hub, pal_hub_room *room)
{
    for (int i = 0; i < hub->max_clients; i++) {
        pal_client *c = &hub->client[i];
        if (!c->peer || c->room != room || !c->id || c->peer->drop_code) continue;
        pal_wire_topology *topology = &pal_hub_message(hub, PAL_CONTROL_TOPOLOGY)->topology;
        topology->n_part = (uint32_t)room->stream->n_part;
        for (int p = 0; p < room->stream->n_part; p++) topology->part[p] = room->stream->part[p].info;
        pal_hub_put_plan(room, &topology->plan);
        memset(c->sent_change, 0, sizeof c->sent_change);
        memset(c->sent_field, 0, sizeof c->sent_field);
        pal_hub_send(hub, c, hub->control);
    }
}

static void finish(pal_hub *hub, pal_hub_jobs *s, pal_job *job)
{
    pal_hub_room *room = s->current.room;
    pal_client *c = requester(hub, &s->current);
    if (!job->err && commit(hub, s, job)) {
        send_topology(hub, room);
        if (c) job->type->answer(hub, c, job);
    } else if (c) {
        const char *reason = job->diag.text[0] ? job->diag.text : pal_err_text(job->err);
        bool named = !strncmp(reason, job->verb, strlen(job->verb)); /* cell edits name the verb */
        pal_hub_send_error(hub, c, "refused", named ? "%s%s" : "%s: %s", named ? "" : job->verb, reason);
    }
    pal_job_free(job);
}

/* copy of the running scene with the current materials; NULL: out of memory */
static pal_scene *scene_now(const pal_hub_room *room)
{
    pal_scene *scene = malloc(sizeof *scene);
    if (!scene) return NULL;
    *scene = *pal_session_scene(room->session);
    for (int b = 0; b < scene->n_body; b++) pal_session_material(room->session, b, &scene->body[b].material);
    return scene;
}

/* submits the next command; one that cannot be parsed was answered and is dropped */
static void begin_next(pal_hub *hub, pal_hub_jobs *s)
{
    /* picking and undo need the displayed state, so a new session must have its first frame */
    while (s->n_pending > 0 && s->pending[0].room->stream->frame) {
        s->current = s->pending[0];
        memmove(s->pending, s->pending + 1, sizeof *s->pending * (size_t)--s->n_pending);
        pal_client *c = requester(hub, &s->current);
        pal_hub_room *room = s->current.room;
        pal_job job = {.type = s->current.type,
                       .session = room->session,
                       .error_m = hub->error_m,
                       .asked_ns = s->current.asked_ns};
        if (!c) continue; /* the requester has left */
        memcpy(job.verb, s->current.command.verb, sizeof job.verb);
        bool good = job.type->read(hub, c, &s->current.command, &job);
        if (good && !(job.scene = scene_now(room))) {
            pal_hub_send_error(hub, c, "refused", "%s: %s", job.verb, pal_err_text(PAL_ERR_MEMORY));
            good = false;
        }
        if (good) {
            pal_job_worker_submit(s->worker, &job);
            return;
        }
        pal_job_free(&job);
    }
}

pal_hub_body_edits *pal_hub_edits(pal_hub *hub, const pal_hub_room *room, int body)
{
    return &hub->jobs->edits[room - hub->room][body];
}

void pal_hub_jobs_enqueue(pal_hub *hub, pal_client *c, const pal_job_type *type, const pal_wire_command *command)
{
    if (!pal_hub_jobs_create(hub, c, command->verb)) return;
    pal_hub_jobs *s = hub->jobs;
    if (s->n_pending == PAL_HUB_JOBS_PENDING) {
        pal_hub_send_error(hub, c, "busy", "%s: %d commands wait already", command->verb, PAL_HUB_JOBS_PENDING);
        return;
    }
    s->pending[s->n_pending++] = (pal_hub_pending_job){c->room, c->id, pal_loop_now_ns(hub->loop), type, *command};
    if (!pal_job_worker_busy(s->worker)) begin_next(hub, s);
}

void pal_hub_jobs_update(pal_hub *hub)
{
    pal_hub_jobs *s = hub->jobs;
    pal_job job;
    if (!s) return;
    if (pal_job_worker_collect(s->worker, &job)) finish(hub, s, &job);
    if (!pal_job_worker_busy(s->worker)) begin_next(hub, s);
}

static void wake_loop(void *user)
{
    pal_loop_wake(user);
}

static void free_jobs(pal_hub_jobs *s)
{
    free(s->edits);
    free(s->brush);
    free(s);
}

bool pal_hub_jobs_create(pal_hub *hub, pal_client *c, const char *verb)
{
    if (hub->jobs) return true;
    pal_hub_jobs *s = calloc(1, sizeof *s);
    if (s) s->edits = calloc((size_t)hub->n_room, sizeof *s->edits);
    if (s) s->brush = calloc((size_t)hub->n_room, sizeof *s->brush);
    if (s && s->edits && s->brush && !pal_job_worker_open(wake_loop, hub->loop, &s->worker)) {
        hub->jobs = s;
        return true;
    }
    if (s) free_jobs(s);
    pal_hub_send_error(hub, c, "refused", "%s: %s", verb, pal_err_text(PAL_ERR_MEMORY));
    return false;
}

void pal_hub_jobs_end(pal_hub *hub)
{
    pal_hub_jobs *s = hub->jobs;
    if (!s) return;
    pal_job_worker_close(s->worker);
    for (int r = 0; r < hub->n_room; r++) {
        pal_hub_room *room = &hub->room[r];
        if (room->own) {
            pal_stream_close(room->stream);
            pal_session_close(room->session);
            room->stream = NULL, room->session = NULL;
        }
        for (int b = 0; b < PAL_BODY_MAX; b++) {
            pal_hub_body_edits *at = &s->edits[r][b];
            pal_sculptor_destroy(at->sculptor);
            pal_sculpt_edit_free(at->edit);
            pal_configuration_switch_free(at->change);
            free(at->base);
        }
    }
    free_jobs(s);
    hub->jobs = NULL;
}
