/* Responses to requests other than the viewer's files: assets, health, readiness, sessions, metrics. Label values of
 * metrics stay few: never names of sessions or members. */
#include "server/net/http_pages.h"

#include "server/base/json_members.h"
#include "server/base/log.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_rights.h"
#include "server/net/hub_sessions.h"
#include "server/net/hub_watch.h"
#include "server/net/transport/plain_text.h"
#include "server/net/transport/relay_list.h"
#include "server/net/tuning.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static void reply_text(pal_reply *reply, int status, const char *type, const char *text, size_t n)
{
    reply->status = status;
    reply->type = type;
    reply->caching = "no-store";
    reply->body = pal_packet_create(text, n, true);
}

static void reply_plain(pal_reply *reply, int status, const char *text)
{
    reply_text(reply, status, "text/plain; charset=utf-8", text, strlen(text));
}

static void get_health(pal_hub *hub, const pal_request *request, pal_reply *reply)
{
    (void)request;
    const bool alive = pal_hub_is_alive(hub);
    reply_plain(reply, alive ? 200 : 503, alive ? "ok\n" : "a simulation has stalled\n");
}

/* sessions that were to be recorded and are not any longer; *error: errno of the first */
static int count_record_errors(const pal_hub *hub, int *error)
{
    int n = 0;
    for (int r = hub->n_room - 1; r >= 0; r--) {
        const int now = pal_session_record_error(hub->room[r]->session);
        if (now) n++, *error = now;
    }
    return n;
}

/* assets are built before the first request; a session that is much slower than real time should get nobody more */
static void get_ready(pal_hub *hub, const pal_request *request, pal_reply *reply)
{
    (void)request;
    int error = 0;
    double slowdown = 0;
    char text[160] = "ready\n";
    const int n_error = count_record_errors(hub, &error);
    for (int r = 0; r < hub->n_room; r++) {
        const pal_frame *f = hub->room[r]->stream->frame;
        if (f && !f->paused) slowdown = fmax(slowdown, f->slowdown);
    }
    const bool bad = hub->leaving || n_error || slowdown > PAL_SLOW_MAX;
    if (slowdown > PAL_SLOW_MAX)
        snprintf(text, sizeof text, "a session runs %.1f times slower than real time\n", slowdown);
    if (n_error) snprintf(text, sizeof text, "a recording has ended: %s\n", strerror(error));
    reply_plain(reply, bad ? 503 : 200, hub->leaving ? "ending\n" : text);
}

/* may the bearer of the request's ticket know who is there, and open sessions? */
static bool knows(const pal_hub *hub, const pal_request *request, const char *session, pal_wire_role role)
{
    pal_grant grant;
    return !pal_admission_check(hub->admission, request->ticket, session, request->address, (uint64_t)time(NULL),
                                pal_loop_now_ns(hub->loop), &grant) &&
           (hub->open || grant.has_ticket) && grant.role >= role;
}

/* members, then viewers, as many as `members` of the protocol names */
static void add_people(cJSON *session, const pal_hub_room *room)
{
    cJSON *people = cJSON_AddArrayToObject(session, "people");
    int n = 0;
    for (int viewers = 0; viewers < 2; viewers++)
        for (pal_client *c = NULL; n < PAL_WIRE_MEMBER_MAX && (c = pal_hub_next_member(room, c));) {
            if (pal_hub_only_watches(c) != viewers) continue;
            cJSON_AddItemToArray(people,
                                 PAL_JSON({"name", JSON_TEXT(c->member->name)},
                                          {"role", JSON_TEXT(pal_wire_role_name((pal_wire_role)c->member->role))}));
            n++;
        }
}

static cJSON *session_json(const pal_hub_room *room)
{
    const pal_scene *scene = pal_session_scene(room->session);
    const pal_frame *f = room->stream->frame;
    char title[512], accuracy[512];
    int n_free = 0;
    for (int t = 0; t < room->members.n_tool; t++) n_free += room->members.holder[t] == 0;
    pal_plain_text(title, sizeof title, scene->title);
    pal_plain_text(accuracy, sizeof accuracy, scene->accuracy);
    cJSON *assets = cJSON_CreateArray();
    for (int p = 0; p < room->stream->n_part; p++)
        cJSON_AddItemToArray(assets, JSON_TEXT(room->stream->part[p].info.asset));
    return PAL_JSON({"name", JSON_TEXT(scene->name)}, {"title", JSON_TEXT(title)}, {"accuracy", JSON_TEXT(accuracy)},
                    {"members", JSON_NUMBER(room->members.n_member)}, {"viewers", JSON_NUMBER(room->n_viewer)},
                    {"tools", JSON_NUMBER(room->members.n_tool)}, {"free_tools", JSON_NUMBER(n_free)},
                    {"parts", JSON_NUMBER(room->stream->n_part)},
                    {"state", JSON_TEXT(pal_hub_playing(room, NULL) ? "recording"
                                        : f && f->paused            ? "paused"
                                                                    : "running")},
                    {"slowdown", JSON_NUMBER(f && isfinite(f->slowdown) ? f->slowdown : 1)}, {"assets", assets});
}

typedef struct openings {
    cJSON *sessions;
    bool with_reason;
} openings;

static void add_opening(void *user, const char *name, const char *scene, const char *why_not)
{
    const openings *o = user;
    cJSON_AddItemToArray(o->sessions, PAL_JSON({"name", JSON_TEXT(name)}, {"title", JSON_TEXT(scene)},
                                               {"state", JSON_TEXT(why_not ? "failed" : "opening")},
                                               {"text", why_not && o->with_reason ? JSON_TEXT(why_not) : NULL}));
}

static void reply_json(pal_reply *reply, int status, cJSON *root)
{
    char *text = cJSON_PrintUnformatted(root);
    cJSON_Delete(root);
    size_t n = text ? strlen(text) : 0;
    if (text) text[n++] = '\n'; /* the length ends it */
    reply_text(reply, status, "application/json", text, n);
    free(text);
}

static void get_sessions(pal_hub *hub, const pal_request *request, pal_reply *reply)
{
    cJSON *sessions = cJSON_CreateArray(), *root = PAL_JSON({"sessions", sessions});
    for (int r = 0; r < hub->n_room; r++) {
        cJSON *session = session_json(hub->room[r]);
        const char *name = pal_session_scene(hub->room[r]->session)->name;
        if (knows(hub, request, name, PAL_WIRE_ROLE_VIEWER)) add_people(session, hub->room[r]);
        cJSON_AddItemToArray(sessions, session);
    }
    cJSON *relays = pal_relay_list_json(hub->relays);
    if (relays) cJSON_AddItemToObject(root, "relays", relays);
    const bool instructs = hub->sessions && knows(hub, request, "", PAL_WIRE_ROLE_INSTRUCTOR);
    pal_hub_sessions_openings(hub->sessions, add_opening, &(openings){sessions, instructs});
    if (instructs && hub->source) {
        char(*name)[PAL_NAME] = calloc(PAL_SCENES_MAX, sizeof *name);
        cJSON *scenes = cJSON_AddArrayToObject(root, "scenes");
        const int n = name ? pal_hub_sessions_scenes(hub->sessions, name, PAL_SCENES_MAX) : 0;
        for (int k = 0; k < n; k++) cJSON_AddItemToArray(scenes, JSON_TEXT(name[k]));
        free(name);
    }
    reply_json(reply, 200, root);
}

static void post(pal_hub *hub, const pal_request *request, pal_reply *reply)
{
    char text[400] = "not found", plain[400];
    int status = 404;
    if (!strcmp(request->path, "/sessions") && hub->source)
        status = pal_hub_sessions_post(hub->sessions, request, text, sizeof text);
    else if (!strcmp(request->path, "/sessions"))
        status = (snprintf(text, sizeof text, "this server opens and ends no sessions: it has no --scenes"), 405);
    pal_plain_text(plain, sizeof plain, text);
    if (status >= 400)
        pal_log(PAL_LOG_INFO, "refused", "a request from %s: %s",
                request->address[0] ? request->address : "this process", plain);
    reply_json(reply, status, PAL_JSON({status < 300 ? "session" : "error", JSON_TEXT(plain)}));
}

typedef struct metric {
    const char *name;  /* without the prefix palpate_; a counter's ends in _total. NULL: as the line before */
    const char *about; /* help */
    const char *label; /* NULL: none; a value with a label is a whole number */
    double value;
} metric;

static void print_metrics(const metric *row, const metric *end, char *text, size_t cap)
{
    size_t n = 0;
    for (const char *name = NULL; row < end && n < cap; row++) {
        if (row->name) name = row->name;
        const char *type = strstr(name, "_total") ? "counter" : "gauge";
        if (row->name)
            n += (size_t)snprintf(text + n, cap - n, "# HELP palpate_%s %s\n# TYPE palpate_%s %s\n", name, row->about,
                                  name, type);
        if (n < cap)
            n += (size_t)snprintf(text + n, cap - n, row->label ? "palpate_%s{%s} %.0f\n" : "palpate_%s%s %.9g\n", name,
                                  row->label ? row->label : "", row->value);
    }
}

/* time of steps by session, whose label is its number; returns the bytes written */
static size_t print_histograms(const pal_hub *hub, char *text, size_t cap)
{
    size_t n = (size_t)snprintf(
        text, cap,
        "# HELP palpate_sim_step_seconds_by_session Processor time of a step; at rest of one in a tenth of a second.\n"
        "# TYPE palpate_sim_step_seconds_by_session histogram\n");
    for (int r = 0; r < hub->n_room && n < cap; r++) {
        const pal_stream *s = hub->room[r]->stream;
        const int label = hub->room[r]->number;
        uint64_t sum = 0;
        char bound[16] = "+Inf";
        for (int k = 0; k <= PAL_STEP_BOUNDS && n < cap; k++) {
            sum += s->n_step[k];
            if (k < PAL_STEP_BOUNDS) snprintf(bound, sizeof bound, "%g", pal_step_bound_s[k]);
            n += (size_t)snprintf(text + n, cap - n,
                                  "palpate_sim_step_seconds_by_session_bucket{session=\"%d\",le=\"%s\"} %llu\n", label,
                                  k < PAL_STEP_BOUNDS ? bound : "+Inf", (unsigned long long)sum);
        }
        if (n < cap)
            n += (size_t)snprintf(text + n, cap - n,
                                  "palpate_sim_step_seconds_by_session_sum{session=\"%d\"} %.9g\n"
                                  "palpate_sim_step_seconds_by_session_count{session=\"%d\"} %llu\n",
                                  label, s->step_sum_s, label, (unsigned long long)sum);
    }
    return n < cap ? n : cap;
}

static void get_metrics(pal_hub *hub, const pal_request *request, pal_reply *reply)
{
    (void)request;
    /* a line of a histogram is below 120 bytes, all other lines below 16 kB; [net] only */
    static char text[PAL_SESSIONS_MAX * (PAL_STEP_BOUNDS + 3) * 120 + 16384];
    const pal_hub_count *n = &hub->count;
    double step_s = 0, late = 0, encode_s = 0, n_encode = 0, frame_byte = 0, delta_byte = 0;
    int role[PAL_WIRE_ROLE_COUNT] = {0};
    int record_error = 0;
    const int n_record_error = count_record_errors(hub, &record_error);
    for (int r = 0; r < hub->n_room; r++) {
        const pal_hub_room *room = hub->room[r];
        const pal_stream *s = room->stream;
        for (int i = 0; i < PAL_MEMBER_LIST_MAX; i++)
            if (room->members.member[i].id) role[room->members.member[i].role]++;
        role[PAL_MEMBER_VIEWER] += room->n_viewer;
        if (s->step_ms * 1e-3 > step_s) step_s = s->step_ms * 1e-3;
        late += s->frame ? (double)s->frame->n_late : 0;
        encode_s += (double)s->count.encode_ns * 1e-9;
        n_encode += (double)s->count.n_encode;
        frame_byte += (double)s->count.n_frame_byte;
        for (int i = 0; i < s->n_part; i++) delta_byte += s->part[i].slots ? (double)s->part[i].slots->n_byte : 0;
    }
    const metric rows[] = {
        {"build_info", "Version of this program.", "version=\"" PAL_VERSION "\"", 1},
        {"sessions", "Sessions of this process.", NULL, hub->n_room},
        {"recordings_failed", "Sessions whose recording has ended by a failed write.", NULL, n_record_error},
        {"clients", "Members and viewers by role.", "role=\"viewer\",transport=\"ws\"", role[PAL_MEMBER_VIEWER]},
        {.label = "role=\"trainee\",transport=\"ws\"", .value = role[PAL_MEMBER_TRAINEE]},
        {.label = "role=\"instructor\",transport=\"ws\"", .value = role[PAL_MEMBER_INSTRUCTOR]},
        {"sim_step_seconds", "Smoothed time of a step, slowest session.", NULL, step_s},
        {"sim_overruns_total", "Steps that began late.", NULL, late},
        {"encode_seconds_total", "Time spent on encoding frames.", NULL, encode_s},
        {"encodes_total", "Frames encoded.", NULL, n_encode},
        {"frame_bytes_total", "Bytes of frames that differed from the one before.", NULL, frame_byte},
        {"topology_delta_bytes_total", "Bytes of topology deltas, each counted once.", NULL, delta_byte},
        {"frames_sent_total", "Frames sent to clients.", NULL, (double)n->n_frame},
        {"fields_sent_total", "Fields sent to clients.", NULL, (double)n->n_field},
        {"topology_deltas_sent_total", "Topology deltas sent to clients.", NULL, (double)n->n_delta},
        {"frames_skipped_total", "Cycles not sent to clients.", "reason=\"credit\"", (double)n->n_skipped},
        {"send_bytes_total", "Bytes of messages sent to clients.", NULL, (double)n->n_byte},
        {"packet_bytes", "Bytes of messages and files held.", NULL, (double)pal_packet_total()},
        {"inputs_total", "Messages of clients.", "kind=\"pose\"", (double)n->n_pose},
        {.label = "kind=\"ack\"", .value = (double)n->n_ack},
        {.label = "kind=\"control\"", .value = (double)n->n_control},
        {"inputs_rejected_total", "Messages of clients that were rejected.", "reason=\"not_holder\"",
         (double)n->n_pose_ignored},
        {.label = "reason=\"out_of_reach\"", .value = (double)n->n_pose_refused},
        {.label = "reason=\"malformed\"", .value = (double)n->n_malformed},
        {.label = "reason=\"rate\"", .value = (double)n->n_flood},
        {.label = "reason=\"stalled\"", .value = (double)n->n_stalled},
        {.label = "reason=\"overflow\"", .value = (double)n->n_overflow},
        {"handshakes_total", "Clients that joined or were turned away.", "result=\"joined\"", (double)n->n_joined},
        {.label = "result=\"refused\"", .value = (double)n->n_refused_join}};
    const size_t n_histogram = print_histograms(hub, text, sizeof text - 16384);
    print_metrics(rows, rows + sizeof rows / sizeof *rows, text + n_histogram, sizeof text - n_histogram);
    reply_text(reply, 200, "text/plain; version=0.0.4", text, strlen(text));
}

static pal_packet *find_asset(const pal_hub_room *room, const char *path)
{
    for (int p = 0; p < room->stream->n_part; p++) {
        const pal_stream_part *part = &room->stream->part[p];
        if (!strcmp(part->info.asset, path)) return part->asset;
        if (!strcmp(part->info.interior, path)) return part->interior_asset;
        for (uint32_t k = 0; k < part->info.n_image; k++)
            if (!strcmp(part->info.image[k], path)) return part->image[k];
        if (part->control_cells && !strcmp(part->info.control_cells, path)) return part->control_cells;
    }
    for (int i = 0; i < PAL_HUB_OLD_ASSETS; i++)
        if (room->past[i].asset && !strcmp(room->past[i].path, path)) return room->past[i].asset;
    return NULL;
}

static bool get_asset(pal_hub *hub, const char *path, pal_reply *reply)
{
    pal_packet *asset = NULL;
    for (int r = 0; r < hub->n_room && !asset; r++) asset = find_asset(hub->room[r], path);
    if (!asset) return false;
    reply->status = 200;
    const char *type = pal_image_type(asset->bytes, asset->n_byte);
    reply->type = type ? type : "application/octet-stream";
    reply->caching = "public, max-age=31536000, immutable";
    snprintf(reply->etag, sizeof reply->etag, "\"%.40s\"", strrchr(path, '/') + 1);
    reply->body = pal_packet_hold(asset);
    return true;
}

void pal_hub_get(void *user, const pal_request *request, pal_reply *reply)
{
    static const struct {
        const char *path;
        void (*get)(pal_hub *hub, const pal_request *request, pal_reply *reply);
        bool of_operators;
    } pages[] = {{"/healthz", get_health, true},
                 {"/readyz", get_ready, true},
                 {"/metrics", get_metrics, true},
                 {"/sessions", get_sessions, false}};
    pal_hub *hub = user;
    const char *path = request->path;
    const bool health = request->health;
    memset(reply, 0, sizeof *reply);
    if (request->body && !health) {
        post(hub, request, reply);
        return;
    }
    for (size_t i = 0; i < sizeof pages / sizeof *pages; i++)
        if (!strcmp(path, pages[i].path) && (pages[i].of_operators ? health || hub->health_on_main : !health)) {
            pages[i].get(hub, request, reply);
            return;
        }
    if (health || (!get_asset(hub, path, reply) && !(hub->site && pal_site_get(hub->site, path, reply))))
        reply_plain(reply, 404, "not found\n");
}
