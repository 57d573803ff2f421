#include "server/net/hub_sessions.h"

#include "server/base/json_members.h"
#include "server/base/log.h"
#include "server/base/thread.h"
#include "server/net/hub_jobs.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_rights.h"
#include "server/net/transport/plain_text.h"
#include "server/net/tuning.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* ---- a room ---- */

pal_err pal_hub_room_open(pal_hub *hub, const pal_opened_session *opened, pal_diagnostic *diag, pal_hub_room **out)
{
    const pal_scene *scene = pal_session_scene(opened->session);
    pal_hub_room *room = calloc(1, sizeof *room);
    *out = NULL;
    if (!room) return PAL_ERR_MEMORY;
    room->hub = hub;
    room->session = opened->session;
    room->step_s = scene->step_s;
    room->passed_step = UINT64_MAX;
    pal_hub_accept_load(room);
    pal_members_init(&room->members, scene->n_tool);
    if (hub->open) room->members.rights = pal_rights_named("") & ~(1u << PAL_RIGHT_COMPONENT);
    if (opened->study.n > 0) room->study = opened->study;
    room->recording = opened->recording;
    pal_err err = pal_stream_open(room->session, hub->error_m, diag, &room->stream);
    if (err) return free(room), err;
    if (opened->resume) pal_hub_take_edits(room->edits, opened->resume);
    room->keep = opened->keep;
    *out = room;
    return PAL_ERR_OK;
}

void pal_hub_room_close(pal_hub_room *room)
{
    if (!room) return;
    pal_hub_jobs_end(room);
    pal_stream_close(room->stream);
    if (room->own) pal_session_close(room->session);
    pal_packet_drop(room->members_message);
    pal_packet_drop(room->status);
    for (int k = 0; k < PAL_HUB_OLD_ASSETS; k++) pal_packet_drop(room->past[k].asset);
    pal_hub_free_edits(room->edits);
    if (room->keep) room->hub->source->close(room->hub->source->user, room->keep);
    free(room);
}

/* ---- opening and closing ---- */

typedef struct opening {
    char name[PAL_NAME], scene[PAL_NAME];
    enum { NONE, WAITS, UNDER_WAY, FAILED } state;
    char why_not[sizeof((pal_diagnostic *)0)->text];
    uint64_t until_ns; /* that it has failed is listed */
} opening;

struct pal_hub_sessions {
    pal_hub *hub;
    opening opening[PAL_OPENINGS_MAX];
    bool runs; /* the thread exists */
    pthread_t thread;
    pthread_mutex_t lock; /* guards what follows */
    pthread_cond_t changed;
    opening job; /* under way, or done */
    pal_hub_room *made;
    pal_diagnostic diag;
    enum { IDLE, SUBMITTED, DONE } state;
    pal_hub_room *closing; /* a list */
    bool leaving;
};

static pal_err open_room(pal_hub *hub, const opening *job, pal_diagnostic *diag, pal_hub_room **out)
{
    pal_opened_session opened = {.session = NULL};
    PAL_TRY(hub->source->open(hub->source->user, job->scene, job->name, diag, &opened));
    pal_err err = pal_hub_room_open(hub, &opened, diag, out);
    if (err) {
        pal_session_close(opened.session);
        hub->source->close(hub->source->user, opened.keep);
        return err;
    }
    (*out)->own = true;
    return PAL_ERR_OK;
}

static void *run(void *user)
{
    pal_hub_sessions *s = user;
    pthread_mutex_lock(&s->lock);
    while (!s->leaving || s->closing) {
        pal_hub_room *closing = s->closing;
        if (closing) {
            s->closing = closing->next_closing;
            pthread_mutex_unlock(&s->lock);
            pal_hub_room_close(closing);
            pthread_mutex_lock(&s->lock);
        } else if (s->state == SUBMITTED) {
            pal_hub_room *made = NULL;
            pal_diagnostic diag = {""};
            pthread_mutex_unlock(&s->lock);
            pal_err err = open_room(s->hub, &s->job, &diag, &made);
            if (err && !diag.text[0]) pal_diagnostic_set(&diag, err, "%s", pal_err_text(err));
            pthread_mutex_lock(&s->lock);
            s->made = made, s->diag = diag;
            s->state = DONE;
            pal_loop_wake(s->hub->loop);
        } else {
            pthread_cond_wait(&s->changed, &s->lock);
        }
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

pal_err pal_hub_sessions_create(pal_hub *hub, pal_hub_sessions **out)
{
    pal_hub_sessions *s = calloc(1, sizeof *s);
    *out = s;
    if (!s) return PAL_ERR_MEMORY;
    s->hub = hub;
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->changed, NULL);
    return PAL_ERR_OK;
}

static bool need_thread(pal_hub_sessions *s)
{
    if (!s->runs) s->runs = !pal_thread_start(&s->thread, run, s);
    return s->runs;
}

void pal_hub_sessions_destroy(pal_hub_sessions *s)
{
    if (!s) return;
    pthread_mutex_lock(&s->lock);
    s->leaving = true;
    pthread_cond_signal(&s->changed);
    pthread_mutex_unlock(&s->lock);
    if (s->runs) pthread_join(s->thread, NULL);
    pal_hub_room_close(s->made);
    pthread_mutex_destroy(&s->lock);
    pthread_cond_destroy(&s->changed);
    free(s);
}

/* gives the next opening to the thread */
static void submit(pal_hub_sessions *s)
{
    opening *next = NULL;
    for (opening *o = s->opening; o < s->opening + PAL_OPENINGS_MAX; o++) {
        if (o->state == UNDER_WAY) return;
        if (o->state == WAITS && !next) next = o;
    }
    if (!next) return;
    next->state = UNDER_WAY;
    pthread_mutex_lock(&s->lock);
    s->job = *next;
    s->state = SUBMITTED;
    pthread_cond_signal(&s->changed);
    pthread_mutex_unlock(&s->lock);
}

static void finish(pal_hub_sessions *s, opening *o, pal_hub_room *made, const char *why_not)
{
    pal_hub *hub = s->hub;
    if (made) {
        made->number = hub->n_numbered++;
        hub->room[hub->n_room++] = made; /* there is room: openings were counted */
        pal_log(PAL_LOG_INFO, "session", "%s was opened", o->name);
        *o = (opening){.state = NONE};
        return;
    }
    o->state = FAILED;
    o->until_ns = pal_loop_now_ns(hub->loop) + PAL_FAILED_NS;
    pal_plain_text(o->why_not, sizeof o->why_not, why_not);
    pal_log(PAL_LOG_WARN, "session", "%s cannot be opened: %s", o->name, o->why_not);
}

void pal_hub_sessions_update(pal_hub_sessions *s)
{
    if (!s) return;
    const uint64_t now = pal_loop_now_ns(s->hub->loop);
    pthread_mutex_lock(&s->lock);
    const bool done = s->state == DONE;
    pal_hub_room *made = s->made;
    const pal_diagnostic diag = s->diag;
    if (done) s->state = IDLE, s->made = NULL;
    pthread_mutex_unlock(&s->lock);
    for (opening *o = s->opening; o < s->opening + PAL_OPENINGS_MAX; o++) {
        if (done && o->state == UNDER_WAY) finish(s, o, made, diag.text);
        if (o->state == FAILED && now > o->until_ns) *o = (opening){.state = NONE};
    }
    submit(s);
}

/* ---- what instructors ask for ---- */

static pal_hub_room *find_room(const pal_hub *hub, const char *name)
{
    for (int r = 0; r < hub->n_room; r++)
        if (!strcmp(pal_session_scene(hub->room[r]->session)->name, name)) return hub->room[r];
    return NULL;
}

static bool is_taken(const pal_hub_sessions *s, const char *name)
{
    for (int k = 0; k < PAL_OPENINGS_MAX; k++)
        if (s->opening[k].state != NONE && !strcmp(s->opening[k].name, name)) return true;
    return find_room(s->hub, name) != NULL;
}

/* "liver.json" becomes "liver", then "liver-2" */
static void choose_name(const pal_hub_sessions *s, const char *scene, char name[PAL_NAME])
{
    const int n_base = (int)strcspn(scene, ".") < PAL_NAME - 8 ? (int)strcspn(scene, ".") : PAL_NAME - 8;
    snprintf(name, PAL_NAME, "%.*s", n_base, scene);
    for (int k = 2; is_taken(s, name); k++) snprintf(name, PAL_NAME, "%.*s-%d", n_base, scene, k % 100000);
}

void pal_hub_sessions_fail(pal_hub_sessions *s, const pal_failed_scene *failed)
{
    opening *o = s->opening;
    char name[PAL_NAME];
    while (o < s->opening + PAL_OPENINGS_MAX && o->state != NONE) o++;
    if (o == s->opening + PAL_OPENINGS_MAX) return;
    choose_name(s, failed->scene, name);
    *o = (opening){.state = FAILED, .until_ns = UINT64_MAX};
    snprintf(o->name, sizeof o->name, "%s", name);
    pal_plain_text(o->scene, sizeof o->scene, failed->scene);
    pal_plain_text(o->why_not, sizeof o->why_not, failed->diag.text);
}

static bool is_scene(const pal_hub_sessions *s, const char *scene)
{
    char(*name)[PAL_NAME] = calloc(PAL_SCENES_MAX, sizeof *name);
    const int n = name ? pal_hub_sessions_scenes(s, name, PAL_SCENES_MAX) : 0;
    bool found = false;
    for (int k = 0; k < n && !found; k++) found = !strcmp(name[k], scene);
    free(name);
    return found;
}

/* letters, digits, "_" and "-": it stands in addresses, and in the names of recordings */
static bool is_name(const char *name)
{
    return name[0] && strlen(name) < PAL_NAME &&
           !name[strspn(name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-")];
}

/* wanted: the session's name; NULL: one of the scene's */
static int open_scene(pal_hub_sessions *s, const char *scene, const char *wanted, const char *address, char *text,
                      size_t cap)
{
    opening *free_one = NULL;
    char name[PAL_NAME];
    int n_busy = 0;
    for (opening *o = s->opening; o < s->opening + PAL_OPENINGS_MAX; o++) {
        if (o->state == FAILED && !strcmp(o->scene, scene)) *o = (opening){.state = NONE}; /* it is tried again */
        n_busy += o->state == WAITS || o->state == UNDER_WAY;
        if (o->state == NONE || (o->state == FAILED && (!free_one || free_one->state == FAILED))) free_one = o;
    }
    if (!is_scene(s, scene)) return snprintf(text, cap, "there is no scene %.60s", scene), 404;
    if (s->hub->n_room + n_busy >= PAL_SESSIONS_MAX)
        return snprintf(text, cap, "there are %d sessions, and no room for more: end one", s->hub->n_room + n_busy),
               409;
    if (!free_one || !need_thread(s)) return snprintf(text, cap, "%d scenes are being opened: wait", n_busy), 429;
    if (wanted && is_taken(s, wanted)) return snprintf(text, cap, "there is a session %.60s", wanted), 409;
    if (wanted)
        snprintf(name, sizeof name, "%s", wanted);
    else
        choose_name(s, scene, name);
    *free_one = (opening){.state = WAITS};
    snprintf(free_one->name, sizeof free_one->name, "%s", name);
    snprintf(free_one->scene, sizeof free_one->scene, "%s", scene);
    pal_log(PAL_LOG_INFO, "session", "%s is being opened for an instructor from %s", name, address);
    submit(s);
    return snprintf(text, cap, "%s", name), 202;
}

static int end_session(pal_hub_sessions *s, const char *name, const char *address, char *text, size_t cap)
{
    pal_hub *hub = s->hub;
    pal_hub_room *room = find_room(hub, name);
    int r = 0;
    if (!room) return snprintf(text, cap, "there is no session %.60s", name), 404;
    if (!need_thread(s)) return snprintf(text, cap, "out of memory"), 503;
    for (pal_client *c = hub->client; c < hub->client + hub->max_clients; c++) {
        if (!c->peer || c->room != room) continue;
        pal_hub_drop(c, PAL_WIRE_CLOSE_NO_SESSION, "the session was ended by an instructor");
        c->room = NULL;
    }
    if (room->number < PAL_SESSIONS_MAX) hub->ended |= UINT64_C(1) << room->number;
    while (hub->room[r] != room) r++;
    memmove(&hub->room[r], &hub->room[r + 1], sizeof *hub->room * (size_t)(--hub->n_room - r));
    if (room->given) *room->given = NULL, room->own = true;
    room->given = NULL;
    pal_log(PAL_LOG_INFO, "session", "%s was ended by an instructor from %s", name, address);
    pthread_mutex_lock(&s->lock);
    room->next_closing = s->closing;
    s->closing = room;
    pthread_cond_signal(&s->changed);
    pthread_mutex_unlock(&s->lock);
    return snprintf(text, cap, "%s", name), 200;
}

/* may the bearer of the ticket open and end sessions, this one at least? */
static int check_right(const pal_hub *hub, const pal_request *request, const char *session, char *text, size_t cap)
{
    pal_grant grant;
    const char *why = pal_admission_check(hub->admission, request->ticket, session, request->address,
                                          (uint64_t)time(NULL), pal_loop_now_ns(hub->loop), &grant);
    if (why) return snprintf(text, cap, "%s", why), 401;
    if (grant.role == PAL_WIRE_ROLE_INSTRUCTOR) return 200;
    snprintf(text, cap, "only instructors open and end sessions");
    return request->ticket[0] ? 403 : 401;
}

int pal_hub_sessions_post(pal_hub_sessions *s, const pal_request *request, char *text, size_t cap)
{
    cJSON *json = cJSON_ParseWithLength(request->body, request->n_body);
    const cJSON *one = cJSON_IsObject(json) ? json->child : NULL, *name = one ? one->next : NULL;
    const char *from = request->address[0] ? request->address : "this process";
    const bool opens = one && !strcmp(one->string, "open"), ends = one && !strcmp(one->string, "end");
    int status;
    const bool named = name && opens && !name->next && !strcmp(name->string, "name") && cJSON_IsString(name);
    if (!(opens || ends) || (name && !named) || !cJSON_IsString(one) || !one->valuestring[0] ||
        strlen(one->valuestring) >= PAL_NAME)
        status = (snprintf(text, cap, "wanted {\"open\": SCENE} or {\"end\": SESSION}"), 422);
    else if (named && !is_name(name->valuestring))
        status = (snprintf(text, cap, "name: wanted up to %d letters, digits, \"_\" and \"-\"", PAL_NAME - 1), 422);
    else if ((status = check_right(s->hub, request, opens ? "" : one->valuestring, text, cap)) == 200)
        status = s->hub->leaving ? (snprintf(text, cap, "the server ends"), 503)
                 : opens         ? open_scene(s, one->valuestring, named ? name->valuestring : NULL, from, text, cap)
                                 : end_session(s, one->valuestring, from, text, cap);
    cJSON_Delete(json);
    return status;
}

void pal_hub_sessions_openings(const pal_hub_sessions *s,
                               void (*each)(void *user, const char *name, const char *scene, const char *why_not),
                               void *user)
{
    for (int k = 0; s && k < PAL_OPENINGS_MAX; k++) {
        const opening *o = &s->opening[k];
        if (o->state != NONE) each(user, o->name, o->scene, o->state == FAILED ? o->why_not : NULL);
    }
}

int pal_hub_sessions_scenes(const pal_hub_sessions *s, char (*name)[PAL_NAME], int max)
{
    const pal_session_source *source = s ? s->hub->source : NULL;
    return source && source->list ? source->list(source->user, name, max) : 0;
}
