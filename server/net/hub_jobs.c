/* The queue of commands, the background thread that sleeps until there is a job to run or an object to free, and the
 * commit of its results. */
#include "server/net/hub_jobs.h"

#include "server/base/thread.h"
#include "server/net/hub_news.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_plan.h"
#include "server/net/tuning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RETIRED_MAX = 8 };

typedef struct pending_job {
    pal_hub_room *room;
    int member;
    uint64_t asked_ns;
    const pal_job_type *type;
    pal_wire_command command;
    bool own; /* the server's: in the name of a member, who gets no answer */
    pal_configuration to;
    int quality;
} pending_job;

typedef struct pal_hub_jobs pal_hub_jobs;
struct pal_hub_jobs {
    pal_loop *loop;                            /* woken when a job is done */
    pending_job pending[PAL_JOBS_PENDING + 1]; /* the server's own, then the others, oldest first */
    int n_pending;
    pending_job current; /* in progress, no longer pending */
    bool busy;           /* a job is in progress or done */
    pthread_t thread;
    pthread_mutex_t lock; /* guards what follows */
    pthread_cond_t changed;
    pal_job job; /* the thread's own while it is SUBMITTED */
    enum { IDLE, SUBMITTED, DONE } state;
    pal_job_products retired[RETIRED_MAX];
    int n_retired;
    bool leaving;
};

static pal_err check_cost(pal_job *job, const pal_scene *scene)
{
    const double load = pal_session_predicted_load(job->made.session), step_ms = 1e3 * scene->step_s;
    if (!(load > job->max_load)) return PAL_ERR_OK;
    return pal_diagnostic_set(&job->diag, PAL_ERR_BUDGET,
                              "a step would take about %.3g ms of its %.3g ms; an instructor may order it",
                              load * step_ms, step_ms);
}

static void make(pal_job *job)
{
    const pal_scene *scene = NULL;
    const uint64_t before = pal_clock_thread_ns();
    job->err = job->type->prepare(job, &scene);
    if (!job->err && job->made.resume)
        job->err =
            pal_session_open_at(job->session, job->made.resume, !job->goes_live,
                                job->goes_live ? job->recording->record_path : NULL, &job->diag, &job->made.session);
    else if (!job->err)
        job->err = pal_session_open_after(job->session, scene, &job->diag, &job->made.session);
    if (!job->err) job->err = check_cost(job, scene);
    if (!job->err) job->err = pal_stream_open(job->made.session, job->error_m, &job->diag, &job->made.stream);
    if (!job->err) job->type->transfer(job);
    job->made_ns = pal_clock_now_ns(pal_session_clock(job->session));
    job->work_ns = pal_clock_thread_ns() - before;
}

void pal_hub_take_edits(pal_hub_body_edits edits[PAL_BODY_MAX], pal_resume *resume)
{
    for (int b = 0; b < PAL_BODY_MAX; b++)
        pal_resume_take_edits(resume, b, &edits[b].sculptor, &edits[b].edit, &edits[b].change, &edits[b].base);
}

void pal_hub_free_edits(pal_hub_body_edits edits[PAL_BODY_MAX])
{
    for (int b = 0; b < PAL_BODY_MAX; b++) {
        pal_sculptor_destroy(edits[b].sculptor);
        pal_sculpt_edit_free(edits[b].edit);
        pal_configuration_switch_free(edits[b].change);
        free(edits[b].base);
    }
}

static void free_products(const pal_job_products *p)
{
    pal_stream_close(p->stream);
    pal_session_close(p->session);
    pal_sculpt_edit_free(p->edit);
    pal_configuration_switch_free(p->change);
    pal_resume_free(p->resume);
    if (p->edits) pal_hub_free_edits(p->edits);
    free(p->edits);
}

static void free_job(pal_job *job)
{
    free_products(&job->made);
    free(job->scene);
    free(job->base);
    free(job->point_m);
    *job = (pal_job){.err = PAL_ERR_OK};
}

static void *run(void *user)
{
    pal_hub_jobs *s = user;
    pthread_mutex_lock(&s->lock);
    while (!s->leaving || s->n_retired > 0) {
        if (s->n_retired > 0) {
            pal_job_products retired = s->retired[--s->n_retired];
            pthread_mutex_unlock(&s->lock);
            free_products(&retired);
            pthread_mutex_lock(&s->lock);
        } else if (s->state == SUBMITTED) {
            pthread_mutex_unlock(&s->lock);
            make(&s->job);
            pthread_mutex_lock(&s->lock);
            s->state = DONE;
            pthread_cond_signal(&s->changed);
            pal_loop_wake(s->loop);
        } else {
            pthread_cond_wait(&s->changed, &s->lock);
        }
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

/* gives the job with its owned parts to the thread */
static void submit(pal_hub_jobs *s, const pal_job *job)
{
    s->busy = true;
    pthread_mutex_lock(&s->lock);
    s->job = *job;
    s->state = SUBMITTED;
    pthread_cond_signal(&s->changed);
    pthread_mutex_unlock(&s->lock);
}

/* takes the finished job back; false: none yet */
static bool collect(pal_hub_jobs *s, pal_job *out)
{
    pthread_mutex_lock(&s->lock);
    bool done = s->state == DONE;
    if (done) {
        *out = s->job;
        s->job = (pal_job){.err = PAL_ERR_OK};
        s->state = IDLE;
        s->busy = false;
    }
    pthread_mutex_unlock(&s->lock);
    return done;
}

/* closes and frees on the thread, before the next job */
static void retire(pal_hub_jobs *s, const pal_job_products *retired)
{
    pthread_mutex_lock(&s->lock);
    bool room = s->n_retired < RETIRED_MAX;
    if (room) s->retired[s->n_retired++] = *retired;
    pthread_cond_signal(&s->changed);
    pthread_mutex_unlock(&s->lock);
    if (!room) free_products(retired);
}

/* at the first command; NULL: out of memory */
static pal_hub_jobs *begin_jobs(pal_loop *loop)
{
    pal_hub_jobs *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    s->loop = loop;
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->changed, NULL);
    if (!pal_thread_start(&s->thread, run, s)) return s;
    free(s);
    return NULL;
}

void pal_hub_jobs_end(pal_hub_room *room)
{
    pal_hub_jobs *s = room->jobs;
    if (!s) return;
    pthread_mutex_lock(&s->lock);
    s->leaving = true;
    pthread_cond_signal(&s->changed);
    pthread_mutex_unlock(&s->lock);
    pthread_join(s->thread, NULL);
    free_job(&s->job);
    pthread_mutex_destroy(&s->lock);
    pthread_cond_destroy(&s->changed);
    free(s);
    room->jobs = NULL;
}

/* NULL: has left */
static pal_client *requester(const pending_job *w)
{
    pal_client *c = NULL;
    while ((c = pal_hub_next_member(w->room, c)) && c->id != w->member) continue;
    return c;
}

/* keeps replaced assets for a while, because clients may be about to fetch them */
static void keep_assets(pal_hub_room *room, const pal_stream *before)
{
    for (int p = 0; p < before->n_part; p++) {
        const pal_stream_part *part = &before->part[p];
        if (p < room->stream->n_part && !strcmp(part->info.asset, room->stream->part[p].info.asset)) continue;
        pal_hub_old_asset *past = &room->past[room->oldest_asset];
        snprintf(past->path, sizeof past->path, "%s", part->info.asset);
        pal_packet_replace(&past->asset, pal_packet_hold(part->asset));
        room->oldest_asset = (room->oldest_asset + 1) % PAL_HUB_OLD_ASSETS;
    }
}

/* Repeats the brushes of the replaced session in the new one, where the job type keeps them. Returns the number
 * ended. */
static int begin_brushes(pal_hub_room *room, const pal_job_type *type)
{
    int n_ended = 0;
    for (int t = 0; t < PAL_TOOL_MAX; t++) {
        pal_hub_tool_brush *h = &room->brush[t];
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
static bool commit(pal_hub_room *room, pal_job *job)
{
    pal_job_products retired = {.stream = room->stream, .session = room->session};
    job->err = pal_session_transfer_end(job->made.session, room->session, &job->diag);
    if (job->err) return false;
    pal_stream_transfer(job->made.stream, room->stream);
    room->stream = job->made.stream, room->session = job->made.session;
    job->made.session = NULL, job->made.stream = NULL;
    job->type->commit(&room->edits[job->body], job, &retired);
    job->n_brush_ended = begin_brushes(room, job->type);
    keep_assets(room, retired.stream);
    if (room->given) *room->given = NULL;
    room->given = NULL;
    room->own = true;
    retire(room->jobs, &retired);
    return true;
}

static void send_topology(pal_hub_room *room)
{
    pal_packet_replace(&room->status, NULL); /* of the session before */
    for (pal_client *c = NULL; (c = pal_hub_next_member(room, c));) {
        pal_wire_topology *topology = &pal_hub_message(room->hub, PAL_CONTROL_TOPOLOGY)->topology;
        topology->n_part = (uint32_t)room->stream->n_part;
        for (int p = 0; p < room->stream->n_part; p++) topology->part[p] = room->stream->part[p].info;
        pal_hub_put_plan(room, &topology->plan);
        memset(c->sent_change, 0, sizeof c->sent_change);
        memset(c->sent_values, 0, sizeof c->sent_values);
        pal_hub_send(c);
    }
}

/* what a member's job has changed can be taken back; what the server's has, is counted */
static void account(pal_hub_room *room, pal_client *c, const pal_job *job)
{
    room->quality.n_lowered += job->quality;
    if (isinf(job->max_load)) pal_hub_accept_load(room);
    if (job->type->seeks) {
        room->n_undo = 0;
        room->quality = (pal_hub_quality){.n_lowered = 0};
        room->passed_step = UINT64_MAX;
        room->left_step = job->step;
        return;
    }
    if (!c) return;
    pal_hub_undo *undo = pal_hub_undo_begin(c, job->verb);
    undo->kind = job->type->switches ? PAL_UNDO_SWITCH : PAL_UNDO_EDIT;
    undo->body = job->body;
    undo->configuration = job->before;
    room->quality = (pal_hub_quality){.n_lowered = 0}; /* somebody has chosen */
}

/* the time that a member's jobs may not take for some while */
static void charge(pal_client *c, const pal_job *job)
{
    const uint64_t now = pal_loop_now_ns(c->hub->loop);
    if (c->jobs_until_ns < now) c->jobs_until_ns = now;
    c->jobs_until_ns += 2 * job->work_ns;
}

static void finish(pal_hub_jobs *s, pal_job *job)
{
    pal_hub_room *room = s->current.room;
    pal_client *c = s->current.own ? NULL : requester(&s->current);
    if (c) charge(c, job);
    if (!job->err && commit(room, job)) {
        send_topology(room);
        account(room, c, job);
        if (c) job->type->answer(c, job);
    } else if (!c && s->current.own) {
        room->quality.refused |= job->quality != 0;
        pal_hub_notice(room, "refused", "%s: %s", job->verb,
                       job->diag.text[0] ? job->diag.text : pal_err_text(job->err));
    } else if (c) {
        const char *reason = job->diag.text[0] ? job->diag.text : pal_err_text(job->err);
        bool named = !strncmp(reason, job->verb, strlen(job->verb)); /* cell edits name the verb */
        pal_hub_refuse(c, "refused", named ? "%s%s" : "%s: %s", named ? "" : job->verb, reason);
    }
    free_job(job);
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
static void begin_next(pal_hub_jobs *s)
{
    /* picking and undo need the displayed state, so a new session must have its first frame */
    while (!s->busy && s->n_pending > 0 && s->pending[0].room->stream->frame) {
        s->current = s->pending[0];
        memmove(s->pending, s->pending + 1, sizeof *s->pending * (size_t)--s->n_pending);
        pal_client *c = requester(&s->current);
        if (!c) continue; /* the requester has left */
        pal_job job = {.type = s->current.type,
                       .session = c->room->session,
                       .error_m = c->hub->error_m,
                       .asked_ns = s->current.asked_ns,
                       .max_load = s->current.own || pal_hub_is_instructor(c) ? INFINITY : c->room->max_load,
                       .quality = s->current.quality,
                       .configuration = s->current.to};
        memcpy(job.verb, s->current.command.verb, sizeof job.verb);
        bool good = job.type->read(c, &s->current.command, &job);
        if (good && !(job.scene = scene_now(c->room)))
            good = pal_hub_refuse(c, "refused", "%s: %s", job.verb, pal_err_text(PAL_ERR_MEMORY));
        if (good)
            submit(s, &job);
        else
            free_job(&job);
    }
}

/* NULL: out of memory */
static pal_hub_jobs *jobs_of(pal_hub_room *room)
{
    if (!room->jobs) room->jobs = begin_jobs(room->hub->loop);
    return room->jobs;
}

bool pal_hub_jobs_enqueue(pal_client *c, const pal_job_type *type, const pal_wire_command *command)
{
    pal_hub_jobs *s = jobs_of(c->room);
    const uint64_t now = pal_loop_now_ns(c->hub->loop);
    int n_own = 0;
    if (!s) return pal_hub_refuse(c, "refused", "%s: %s", command->verb, pal_err_text(PAL_ERR_MEMORY));
    for (int k = 0; k < s->n_pending; k++) n_own += s->pending[k].member == c->id;
    if (n_own >= PAL_JOBS_OF_MEMBER || s->n_pending >= PAL_JOBS_PENDING)
        return pal_hub_refuse(c, "busy", "%s: %d commands wait already", command->verb, n_own ? n_own : s->n_pending);
    if (c->jobs_until_ns > now + PAL_JOBS_TIME_NS && !pal_hub_is_instructor(c))
        return pal_hub_refuse(c, "busy", "%s: your commands have taken much time: wait %.0f s", command->verb,
                              1e-9 * (double)(c->jobs_until_ns - now - PAL_JOBS_TIME_NS) + 1);
    s->pending[s->n_pending++] =
        (pending_job){.room = c->room, .member = c->id, .asked_ns = now, .type = type, .command = *command};
    begin_next(s);
    return true;
}

bool pal_hub_jobs_enqueue_own(pal_hub_room *room, const pal_job_type *type, const pal_wire_command *command,
                              const pal_configuration *to, int quality)
{
    pal_hub_jobs *s = jobs_of(room);
    const pal_client *any = pal_hub_next_member(room, NULL);
    if (!s || !any || pal_hub_jobs_own(room)) return false;
    pending_job *job = s->pending;
    memmove(job + 1, job, sizeof *job * (size_t)s->n_pending++);
    *job = (pending_job){.room = room,
                         .member = any->id,
                         .asked_ns = pal_loop_now_ns(room->hub->loop),
                         .type = type,
                         .command = *command,
                         .own = true,
                         .quality = quality};
    if (to) job->to = *to;
    begin_next(s);
    return true;
}

void pal_hub_accept_load(pal_hub_room *room)
{
    room->max_load = fmax(1, PAL_DEARER * pal_session_predicted_load(room->session));
}

bool pal_hub_jobs_busy(const pal_hub_room *room)
{
    return room->jobs && (room->jobs->busy || room->jobs->n_pending > 0);
}

bool pal_hub_jobs_own(const pal_hub_room *room)
{
    const pal_hub_jobs *s = room->jobs;
    return s && ((s->busy && s->current.own) || (s->n_pending > 0 && s->pending[0].own));
}

void pal_hub_jobs_update(pal_hub_room *room)
{
    pal_hub_jobs *s = room->jobs;
    pal_job job;
    if (!s) return;
    if (collect(s, &job)) finish(s, &job);
    begin_next(s);
}

void pal_hub_jobs_complete(pal_hub_room *room)
{
    pal_hub_jobs *s = room->jobs;
    pal_job job;
    if (!s) return;
    pthread_mutex_lock(&s->lock);
    while (s->state == SUBMITTED) pthread_cond_wait(&s->changed, &s->lock);
    pthread_mutex_unlock(&s->lock);
    if (collect(s, &job)) finish(s, &job);
    pal_hub_jobs_end(room);
}
