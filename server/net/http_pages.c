/* Responses to GET other than the viewer's files: assets, health, readiness, sessions, metrics. Label values of
 * metrics stay few: never names of sessions or members. */
#include "server/net/http_pages.h"

#include "server/net/transport/plain_text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { PAGE = 16384 };

typedef struct page {
    char text[PAGE];
    size_t n;
} page;

static void add(page *p, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void add(page *p, const char *format, ...)
{
    va_list args;
    if (p->n >= PAGE - 1) return;
    va_start(args, format);
    int n = vsnprintf(p->text + p->n, PAGE - p->n, format, args);
    va_end(args);
    if (n > 0) p->n = p->n + (size_t)n < PAGE ? p->n + (size_t)n : PAGE - 1;
}

static void reply_text(pal_reply *reply, int status, const char *type, const char *text, size_t n)
{
    reply->status = status;
    reply->type = type;
    reply->caching = "no-store";
    reply->body = pal_packet_create(text, n, true);
}

static bool all_alive(const pal_hub *hub)
{
    for (int r = 0; r < hub->n_room; r++)
        if (!pal_session_is_alive(hub->room[r].session)) return false;
    return true;
}

static void get_health(pal_hub *hub, pal_reply *reply)
{
    if (all_alive(hub))
        reply_text(reply, 200, "text/plain; charset=utf-8", "ok\n", 3);
    else
        reply_text(reply, 503, "text/plain; charset=utf-8", "a simulation has stalled\n", 25);
}

/* assets are built before the first request */
static void get_ready(pal_hub *hub, pal_reply *reply)
{
    if (!hub->leaving)
        reply_text(reply, 200, "text/plain; charset=utf-8", "ready\n", 6);
    else
        reply_text(reply, 503, "text/plain; charset=utf-8", "ending\n", 7);
}

static void get_sessions(pal_hub *hub, pal_reply *reply)
{
    static page p; /* [net] only */
    p.n = 0;
    add(&p, "{\"sessions\":[");
    for (int r = 0; r < hub->n_room; r++) {
        const pal_hub_room *room = &hub->room[r];
        const pal_scene *scene = pal_session_scene(room->session);
        char title[512], accuracy[512];
        int n_free = 0;
        for (int t = 0; t < room->members.n_tool; t++) n_free += room->members.holder[t] == 0;
        pal_plain_json(title, sizeof title, scene->title);
        pal_plain_json(accuracy, sizeof accuracy, scene->accuracy);
        add(&p,
            "%s{\"name\":\"%s\",\"title\":\"%s\",\"accuracy\":\"%s\",\"members\":%d,\"tools\":%d,\"free_tools\":%d,"
            "\"parts\":%d}",
            r ? "," : "", scene->name, title, accuracy, room->members.n_member, room->members.n_tool, n_free,
            room->stream->n_part);
    }
    add(&p, "]}\n");
    reply_text(reply, 200, "application/json", p.text, p.n);
}

static void help(page *p, const char *name, const char *type, const char *about)
{
    add(p, "# HELP %s %s\n# TYPE %s %s\n", name, about, name, type);
}

static void one(page *p, const char *name, const char *type, const char *about, double value)
{
    help(p, name, type, about);
    add(p, "%s %.9g\n", name, value);
}

static void add_sessions(page *p, const pal_hub *hub)
{
    double step_s = 0, late = 0, encode_s = 0, n_encode = 0, frame_byte = 0, delta_byte = 0;
    int role[3] = {0, 0, 0};
    for (int r = 0; r < hub->n_room; r++) {
        const pal_hub_room *room = &hub->room[r];
        const pal_stream *s = room->stream;
        for (int i = 0; i < PAL_MEMBER_LIST_MAX; i++)
            if (room->members.member[i].id) role[room->members.member[i].role]++;
        if (s->step_ms * 1e-3 > step_s) step_s = s->step_ms * 1e-3;
        late += s->frame ? (double)s->frame->n_late : 0;
        encode_s += (double)s->count.encode_ns * 1e-9;
        n_encode += (double)s->count.n_encode;
        frame_byte += (double)s->count.n_frame_byte;
        for (int i = 0; i < s->n_part; i++) delta_byte += s->part[i].slots ? (double)s->part[i].slots->n_byte : 0;
    }
    one(p, "palpate_sessions", "gauge", "Sessions of this process.", hub->n_room);
    help(p, "palpate_clients", "gauge", "Members by role.");
    for (int i = 0; i < 3; i++)
        add(p, "palpate_clients{role=\"%s\",transport=\"ws\"} %d\n", pal_wire_role_name((pal_wire_role)i), role[i]);
    one(p, "palpate_sim_step_seconds", "gauge", "Smoothed time of a step, slowest session.", step_s);
    one(p, "palpate_sim_overruns_total", "counter", "Steps that began late.", late);
    one(p, "palpate_encode_seconds_total", "counter", "Time spent on encoding frames.", encode_s);
    one(p, "palpate_encodes_total", "counter", "Frames encoded.", n_encode);
    one(p, "palpate_frame_bytes_total", "counter", "Bytes of frames that differed from the one before.", frame_byte);
    one(p, "palpate_topology_delta_bytes_total", "counter", "Bytes of topology deltas, each counted once.", delta_byte);
}

static void get_metrics(pal_hub *hub, pal_reply *reply)
{
    static page p; /* [net] only */
    const pal_hub_count *n = &hub->count;
    p.n = 0;
    help(&p, "palpate_build_info", "gauge", "Version of this program.");
    add(&p, "palpate_build_info{version=\"%s\"} 1\n", PAL_VERSION);
    add_sessions(&p, hub);
    one(&p, "palpate_frames_sent_total", "counter", "Frames sent to clients.", (double)n->n_frame);
    one(&p, "palpate_fields_sent_total", "counter", "Fields sent to clients.", (double)n->n_field);
    one(&p, "palpate_topology_deltas_sent_total", "counter", "Topology deltas sent to clients.", (double)n->n_delta);
    help(&p, "palpate_frames_skipped_total", "counter", "Cycles not sent to clients.");
    add(&p, "palpate_frames_skipped_total{reason=\"credit\"} %llu\n", (unsigned long long)n->n_skipped);
    one(&p, "palpate_send_bytes_total", "counter", "Bytes of messages sent to clients.", (double)n->n_byte);
    one(&p, "palpate_packet_bytes", "gauge", "Bytes of messages and files held.", (double)pal_packet_total());
    help(&p, "palpate_inputs_total", "counter", "Messages of clients.");
    add(&p, "palpate_inputs_total{kind=\"pose\"} %llu\n", (unsigned long long)n->n_pose);
    add(&p, "palpate_inputs_total{kind=\"ack\"} %llu\n", (unsigned long long)n->n_ack);
    add(&p, "palpate_inputs_total{kind=\"control\"} %llu\n", (unsigned long long)n->n_control);
    help(&p, "palpate_inputs_rejected_total", "counter", "Messages of clients that were rejected.");
    const struct {
        const char *reason;
        uint64_t n;
    } rejected[] = {{"not_holder", n->n_pose_ignored}, {"out_of_reach", n->n_pose_refused},
                    {"malformed", n->n_malformed},     {"rate", n->n_flood},
                    {"stalled", n->n_stalled},         {"overflow", n->n_overflow}};
    for (size_t i = 0; i < sizeof rejected / sizeof *rejected; i++)
        add(&p, "palpate_inputs_rejected_total{reason=\"%s\"} %llu\n", rejected[i].reason,
            (unsigned long long)rejected[i].n);
    help(&p, "palpate_handshakes_total", "counter", "Clients that joined or were turned away.");
    add(&p, "palpate_handshakes_total{result=\"joined\"} %llu\n", (unsigned long long)n->n_joined);
    add(&p, "palpate_handshakes_total{result=\"refused\"} %llu\n", (unsigned long long)n->n_refused_join);
    reply_text(reply, 200, "text/plain; version=0.0.4", p.text, p.n);
}

static pal_packet *find_asset(const pal_hub_room *room, const char *path)
{
    for (int p = 0; p < room->stream->n_part; p++)
        if (!strcmp(room->stream->part[p].info.asset, path)) return room->stream->part[p].asset;
    for (int i = 0; i < PAL_HUB_OLD_ASSETS; i++)
        if (room->past[i].asset && !strcmp(room->past[i].path, path)) return room->past[i].asset;
    return NULL;
}

static bool get_asset(pal_hub *hub, const char *path, pal_reply *reply)
{
    pal_packet *asset = NULL;
    for (int r = 0; r < hub->n_room && !asset; r++) asset = find_asset(&hub->room[r], path);
    if (!asset) return false;
    reply->status = 200;
    reply->type = "application/octet-stream";
    reply->caching = "public, max-age=31536000, immutable";
    snprintf(reply->etag, sizeof reply->etag, "\"%.40s\"", strrchr(path, '/') + 1);
    reply->body = pal_packet_hold(asset);
    return true;
}

void pal_hub_get(void *user, const char *path, pal_reply *reply)
{
    static const struct {
        const char *path;
        void (*get)(pal_hub *hub, pal_reply *reply);
    } pages[] = {
        {"/healthz", get_health}, {"/readyz", get_ready}, {"/sessions", get_sessions}, {"/metrics", get_metrics}};
    pal_hub *hub = user;
    pal_site_file file;
    memset(reply, 0, sizeof *reply);
    for (size_t i = 0; i < sizeof pages / sizeof *pages; i++)
        if (!strcmp(path, pages[i].path)) {
            pages[i].get(hub, reply);
            return;
        }
    if (get_asset(hub, path, reply)) return;
    if (hub->site && pal_site_get(hub->site, path, &file)) {
        reply->status = 200;
        reply->type = file.type;
        reply->caching = "no-cache";
        snprintf(reply->etag, sizeof reply->etag, "%s", file.etag);
        reply->body = pal_packet_hold(file.bytes);
        return;
    }
    reply_text(reply, 404, "text/plain; charset=utf-8", "not found\n", 10);
}
