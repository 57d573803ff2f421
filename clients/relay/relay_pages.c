#include "clients/relay/relay_pages.h"

#include "server/base/json_members.h"
#include "server/net/transport/relay_list.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void reply_text(pal_reply *reply, int status, const char *type, const char *text)
{
    reply->status = status;
    reply->type = type;
    reply->caching = "no-store";
    reply->body = pal_packet_create(text, strlen(text), true);
}

static void reply_plain(pal_reply *reply, int status, const char *text)
{
    reply_text(reply, status, "text/plain; charset=utf-8", text);
}

/* as images say by their first bytes, which is all that a browser needs */
static const char *type_of(const pal_packet *asset)
{
    const uint8_t *b = asset->bytes;
    if (asset->n_byte > 3 && !memcmp(b, "\x89PNG", 4)) return "image/png";
    if (asset->n_byte > 2 && !memcmp(b, "\xff\xd8\xff", 3)) return "image/jpeg";
    return "application/octet-stream";
}

static bool get_asset(pal_relay_kept *kept, const char *path, pal_reply *reply)
{
    pal_packet *asset = pal_relay_find_asset(kept, path);
    if (!asset) return false;
    reply->status = 200;
    reply->type = type_of(asset);
    reply->caching = "public, max-age=31536000, immutable";
    snprintf(reply->etag, sizeof reply->etag, "\"%.40s\"", strrchr(path, '/') + 1);
    reply->body = asset;
    return true;
}

static void get_sessions(pal_relay_kept *kept, const char *others, const pal_relay_counts *count, pal_reply *reply)
{
    cJSON *sessions = cJSON_CreateArray(), *root = PAL_JSON({"sessions", sessions});
    pthread_mutex_lock(&kept->lock);
    if (kept->text[PAL_RELAY_HELLO].packet)
        cJSON_AddItemToArray(sessions,
                             PAL_JSON({"name", JSON_TEXT(kept->session)}, {"title", JSON_TEXT(kept->title)},
                                      {"viewers", JSON_NUMBER(count->n_viewer)}, {"state", JSON_TEXT("running")}));
    pthread_mutex_unlock(&kept->lock);
    cJSON *relays = pal_relay_list_json(others);
    if (relays) cJSON_AddItemToObject(root, "relays", relays);
    char *text = cJSON_PrintUnformatted(root);
    cJSON_Delete(root);
    reply_text(reply, 200, "application/json", text ? text : "{}");
    free(text);
}

static void get_metrics(const pal_relay_counts *n, bool up, pal_reply *reply)
{
    const struct {
        const char *name, *about, *type;
        double value;
    } row[] = {{"relay_upstream_up", "Does upstream answer?", "gauge", up},
               {"clients", "Viewers.", "gauge", n->n_viewer},
               {"frames_sent_total", "Frames sent to viewers.", "counter", (double)n->n_frame},
               {"frames_skipped_total", "Cycles not sent to viewers.", "counter", (double)n->n_skipped},
               {"send_bytes_total", "Bytes of messages sent to viewers.", "counter", (double)n->n_byte},
               {"packet_bytes", "Bytes of messages and files held.", "gauge", (double)pal_packet_total()},
               {"handshakes_joined_total", "Viewers that joined.", "counter", (double)n->n_joined},
               {"handshakes_refused_total", "Viewers that were turned away.", "counter", (double)n->n_refused}};
    char text[2048];
    size_t at = 0;
    for (size_t i = 0; i < sizeof row / sizeof *row && at < sizeof text; i++)
        at += (size_t)snprintf(text + at, sizeof text - at,
                               "# HELP palpate_%s %s\n# TYPE palpate_%s %s\npalpate_%s %.15g\n", row[i].name,
                               row[i].about, row[i].name, row[i].type, row[i].name, row[i].value);
    reply_text(reply, 200, "text/plain; version=0.0.4", text);
}

void pal_relay_get(pal_relay_kept *kept, const pal_relay_options *options, const pal_relay_counts *count,
                   const pal_request *request, pal_reply *reply)
{
    const char *path = request->path;
    const bool operators = request->health || options->health_on_main;
    pthread_mutex_lock(&kept->lock);
    const bool up = kept->up && kept->text[PAL_RELAY_HELLO].packet;
    pthread_mutex_unlock(&kept->lock);
    memset(reply, 0, sizeof *reply);
    if (request->body)
        reply_plain(reply, 405, "a relay opens and ends no sessions\n");
    else if (operators && !strcmp(path, "/healthz"))
        reply_plain(reply, 200, "ok\n");
    else if (operators && !strcmp(path, "/readyz"))
        reply_plain(reply, up ? 200 : 503, up ? "ready\n" : "upstream does not answer\n");
    else if (operators && !strcmp(path, "/metrics"))
        get_metrics(count, up, reply);
    else if (!request->health && !strcmp(path, "/sessions"))
        get_sessions(kept, options->relays, count, reply);
    else if (request->health ||
             (!get_asset(kept, path, reply) && !(options->site && pal_site_get(options->site, path, reply))))
        reply_plain(reply, 404, "not found\n");
}
