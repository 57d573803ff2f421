/* Orders that lead to another scene: the queue before the workshop, and its results in the place of what runs. */
#include "server/net/hub_jobs.h"

#include "server/base/clock.h"
#include "server/net/plain_text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- orders and answers ---- */

const pal_wire_arg *pal_hub_arg(const pal_wire_command *order, const char *key)
{
    for (uint32_t i = 0; i < order->n_arg; i++)
        if (!strcmp(order->arg[i].key, key)) return &order->arg[i];
    return NULL;
}

bool pal_hub_check_args(pal_hub *hub, pal_client *c, const char *args, const pal_wire_command *order)
{
    bool needed = true;
    uint32_t n_known = 0;
    for (const char *at = args; *at;) {
        char key[32];
        size_t n = strcspn(at, " ");
        snprintf(key, sizeof key, "%.*s", (int)n, at);
        at += n + (at[n] == ' ');
        if (!strcmp(key, "|")) {
            needed = false;
            continue;
        }
        bool there = pal_hub_arg(order, key) != NULL;
        n_known += there;
        if (there || !needed) continue;
        pal_hub_send_error(hub, c, "args", "%s: %s is missing", order->verb, key);
        return false;
    }
    if (n_known == order->n_arg) return true;
    pal_hub_send_error(hub, c, "args", "%s takes %s", order->verb, args[0] ? args : "no numbers");
    return false;
}

bool pal_hub_jobs_check_rights(pal_hub *hub, pal_client *c, const char *verb, const char *does)
{
    const pal_member_entry *m = pal_members_find(&c->room->members, c->id);
    if (m->role == PAL_MEMBER_INSTRUCTOR || m->tool >= 0) return true;
    pal_hub_send_error(hub, c, "role", "%s: only an instructor or who holds a tool %s", verb, does);
    return false;
}

pal_client *pal_hub_requester(pal_hub *hub, const pal_hub_pending_job *w)
{
    for (int i = 0; i < hub->max_clients; i++) {
        pal_client *c = &hub->client[i];
        if (c->peer && c->room == w->room && c->id == w->member && !c->peer->drop_code) return c;
    }
    return NULL;
}

void pal_hub_answer_arg(pal_wire_answer *a, const char *key, double value)
{
    pal_wire_arg *to = &a->arg[a->n_arg++];
    snprintf(to->key, sizeof to->key, "%s", key);
    to->value = value;
}

pal_wire_answer *pal_hub_answer_begin(pal_hub *hub, const char *verb)
{
    memset(hub->control, 0, sizeof *hub->control);
    hub->control->type = PAL_CONTROL_ANSWER;
    pal_plain_text(hub->control->answer.verb, sizeof hub->control->answer.verb, verb);
    return &hub->control->answer;
}

/* ---- one after the other ---- */

/* assets that go are kept for a while: a client may be on its way to fetch one */
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

/* what came out stays as long as a scene is made from it; what it replaces goes with the session of before */
static void keep_works(pal_hub_body_edits *at, pal_job *work, pal_retired *retired)
{
    if (work->kind == PAL_JOB_SWITCH) {
        retired->change = at->change;
        at->change = work->change;
        at->base = work->base ? work->base : at->base;
        work->change = NULL, work->base = NULL;
        return;
    }
    pal_sculptor_commit(at->sculptor, work->turn);
    retired->turn = at->turn, retired->change = at->change;
    at->turn = work->turn, at->change = NULL;
    free(at->base);
    at->base = NULL;
    work->turn = NULL;
}

/* Rows of brushes went with the session of before, or go on in another setting of a solid (sim/transfer.h), where they
 * are asked for again as they are; those on cells that were edited are over. How many */
static int begin_brushes(pal_hub_tool_brush *hand, pal_hub_room *room, pal_job_kind kind)
{
    int n_over = 0;
    for (int t = 0; t < PAL_TOOL_MAX; t++) {
        pal_hub_tool_brush *h = &hand[t];
        const pal_member_entry *m =
            h->brush.kind == PAL_BRUSH_NONE ? NULL : pal_members_find(&room->members, h->member);
        pal_command command = {.kind = PAL_COMMAND_BRUSH, .body = h->body, .slot = t, .brush = h->brush};
        bool acts = m && m->tool == t,
             stays = acts && kind == PAL_JOB_SWITCH && room->stream->part[h->body].info.is_sculptable;
        if (stays && pal_session_command(room->session, &command) == PAL_ERR_OK) continue;
        n_over += acts;
        command.brush.kind = PAL_BRUSH_NONE;
        if (h->brush.kind != PAL_BRUSH_NONE) (void)pal_session_command(room->session, &command);
        *h = (pal_hub_tool_brush){.member = 0};
    }
    return n_over;
}

/* what came out takes the place of what stands; false: that goes on as it was, note says why */
static bool take_over(pal_hub *hub, pal_hub_jobs *s, pal_job *work)
{
    pal_hub_room *room = s->now.room;
    pal_retired retired = {.stream = room->stream, .session = room->session};
    work->err = pal_session_transfer_end(work->next, room->session, &work->diag);
    if (work->err) return false;
    pal_stream_transfer(work->stream, room->stream);
    room->stream = work->stream, room->session = work->next;
    work->next = NULL, work->stream = NULL;
    keep_works(&s->place[room - hub->room][s->body], work, &retired);
    s->n_brush_over = begin_brushes(s->hand[room - hub->room], room, work->kind);
    keep_assets(room, retired.stream);
    hub->session[room - hub->room] = NULL;
    room->own = true;
    pal_job_worker_retire(s->job_worker, &retired);
    return true;
}

static void tell_topology(pal_hub *hub, pal_hub_room *room)
{
    for (int i = 0; i < hub->max_clients; i++) {
        pal_client *c = &hub->client[i];
        if (!c->peer || c->room != room || !c->id || c->peer->drop_code) continue;
        memset(hub->control, 0, sizeof *hub->control);
        hub->control->type = PAL_CONTROL_TOPOLOGY;
        hub->control->topology.n_part = (uint32_t)room->stream->n_part;
        for (int p = 0; p < room->stream->n_part; p++) hub->control->topology.part[p] = room->stream->part[p].info;
        pal_hub_topology_components(room, &hub->control->topology);
        memset(c->sent_change, 0, sizeof c->sent_change);
        memset(c->sent_field, 0, sizeof c->sent_field);
        pal_hub_send(hub, c, hub->control);
    }
}

static void finish(pal_hub *hub, pal_hub_jobs *s, pal_job *work)
{
    pal_hub_room *room = s->now.room;
    pal_client *c = pal_hub_requester(hub, &s->now);
    if (!work->err && take_over(hub, s, work)) {
        tell_topology(hub, room);
        if (c && work->kind == PAL_JOB_SWITCH) pal_hub_switch_answer(hub, c, work);
        if (c && work->kind == PAL_JOB_SCULPT) pal_hub_sculpt_answer(hub, c, work);
    } else {
        const char *verb = s->now.order.verb, *reason = work->diag.text[0] ? work->diag.text : pal_err_text(work->err);
        bool named = !strncmp(reason, verb, strlen(verb)); /* edits of cells say it themselves */
        if (c) pal_hub_send_error(hub, c, "refused", named ? "%s%s" : "%s: %s", named ? "" : verb, reason);
    }
    pal_job_free(work);
}

/* the scene that runs now, with the materials of now; NULL: out of memory */
static pal_scene *scene_now(const pal_hub_room *room)
{
    pal_scene *scene = malloc(sizeof *scene);
    if (!scene) return NULL;
    *scene = *pal_session_scene(room->session);
    for (int b = 0; b < scene->n_body; b++) pal_session_material(room->session, b, &scene->body[b].material);
    return scene;
}

/* gives the next order to the workshop; one that cannot be read is answered and gone */
static void begin_next(pal_hub *hub, pal_hub_jobs *s)
{
    /* what is pointed at, and kept, is what is shown: a session that has just begun comes with its first frame */
    while (s->n > 0 && s->list[0].room->stream->frame) {
        s->now = s->list[0];
        memmove(s->list, s->list + 1, sizeof *s->list * (size_t)--s->n);
        pal_client *c = pal_hub_requester(hub, &s->now);
        pal_hub_room *room = s->now.room;
        pal_job work = {.kind = s->now.kind, .session = room->session, .error_m = hub->error_m};
        if (!c) continue; /* who has gone wants nothing any more */
        bool good = work.kind == PAL_JOB_SWITCH ? pal_hub_switch_read(hub, c, &s->now.order, &work, &s->body)
                                                : pal_hub_sculpt_read(hub, c, &s->now.order, &work, &s->body);
        if (good && !(work.scene = scene_now(room))) {
            pal_hub_send_error(hub, c, "refused", "%s: %s", s->now.order.verb, pal_err_text(PAL_ERR_MEMORY));
            good = false;
        }
        if (!good) {
            pal_job_free(&work);
            continue;
        }
        work.asked_ns = s->now.asked_ns;
        pal_job_worker_submit(s->job_worker, &work);
        return;
    }
}

void pal_hub_jobs_enqueue(pal_hub *hub, pal_client *c, pal_job_kind kind, const pal_wire_command *order)
{
    pal_hub_jobs *s = hub->jobs;
    if (s->n == PAL_HUB_JOBS_PENDING) {
        pal_hub_send_error(hub, c, "busy", "%s: %d commands wait already", order->verb, PAL_HUB_JOBS_PENDING);
        return;
    }
    s->list[s->n++] = (pal_hub_pending_job){c->room, c->id, pal_clock_ns(), kind, *order};
    if (!pal_job_worker_busy(s->job_worker)) begin_next(hub, s);
}

void pal_hub_jobs_update(pal_hub *hub)
{
    pal_hub_jobs *s = hub->jobs;
    pal_job work;
    if (!s) return;
    if (pal_job_worker_collect(s->job_worker, &work)) finish(hub, s, &work);
    if (!pal_job_worker_busy(s->job_worker)) begin_next(hub, s);
}

/* ---- coming in and ending ---- */

static void wake_loop(void *user)
{
    pal_loop_wake(user);
}

bool pal_hub_jobs_create(pal_hub *hub)
{
    if (hub->jobs) return true;
    pal_hub_jobs *s = calloc(1, sizeof *s);
    if (s) s->place = calloc((size_t)hub->n_room, sizeof *s->place);
    if (s) s->hand = calloc((size_t)hub->n_room, sizeof *s->hand);
    if (!s || !s->place || !s->hand || pal_job_worker_open(wake_loop, hub->loop, &s->job_worker)) {
        if (s) free(s->place), free(s->hand);
        free(s);
        return false;
    }
    hub->jobs = s;
    return true;
}

void pal_hub_jobs_end(pal_hub *hub)
{
    pal_hub_jobs *s = hub->jobs;
    if (!s) return;
    pal_job_worker_close(s->job_worker);
    for (int r = 0; r < hub->n_room; r++) {
        pal_hub_room *room = &hub->room[r];
        if (room->own) {
            pal_stream_close(room->stream);
            pal_session_close(room->session);
            room->stream = NULL, room->session = NULL;
        }
        for (int b = 0; b < PAL_BODY_MAX; b++) {
            pal_sculptor_destroy(s->place[r][b].sculptor);
            pal_sculpt_edit_free(s->place[r][b].turn);
            pal_configuration_switch_free(s->place[r][b].change);
            free(s->place[r][b].base);
        }
    }
    free(s->place);
    free(s->hand);
    free(s);
    hub->jobs = NULL;
}
