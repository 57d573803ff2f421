#include "tests/fakes/fake_haply.h"
#include "server/base/vec3.h"

#include <libwebsockets.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static struct lws_context *context;
static pthread_t thread;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t changed = PTHREAD_COND_INITIALIZER;
static int n_wanted;           /* messages that the test lets through */
static bool waiting, has_peer; /* a message is here and waits; a client is connected */
static atomic_bool stopping;
static double written_N[3];
static bool greeted;
static const char *instead;

/* x, y, z from the message, strictly: the member that Haply's service obeys */
static bool parse_force(const char *text, double force[3])
{
    const char *at =
        strstr(text, "\"inverse3\":[{\"device_id\":\"049D\",\"commands\":{\"set_cursor_force\":{\"values\":{");
    if (!at || text[strlen(text) - 1] != '}') return false;
    const char *name[] = {"\"x\":", "\"y\":", "\"z\":"};
    for (int k = 0; k < 3; k++) {
        at = strstr(at, name[k]);
        if (!at) return false;
        char *end;
        force[k] = strtod(at + 4, &end);
        if (end == at + 4 || *end != (k < 2 ? ',' : '}')) return false;
        at = end;
    }
    return true;
}

static size_t compose(char *to, size_t n)
{
    double at[3];
    fake_read(at);
    if (instead) return (size_t)snprintf(to, n, "%s", instead);
    if (fake_value(FAKE_UNPLUGGED) == 2) return (size_t)snprintf(to, n, "{\"session_id\":7,\"inverse3\":[]}");
    const int bits = (int)fake_value(FAKE_BUTTONS);
    char position[128];
    /* their y is left of the user's view, their x right of it; the plate is 160 mm below */
    snprintf(position, sizeof position, "{\"x\":%.9f,\"y\":%.9f,\"z\":%.9f}", at[1] + 0.02, -at[0], at[2] + 0.16);
    if (fake_due(FAKE_NAN_AT)) strcpy(position, "{\"x\":1e999,\"y\":0,\"z\":0}");
    return (size_t)snprintf(
        to, n,
        "{\"session_id\":7,\"inverse3\":[{\"device_id\":\"049C\",\"state\":{\"cursor_position\":{\"x\":9,\"y\":9,\"z\":"
        "9}}},"
        "{\"device_id\":\"049D\",%s\"state\":{\"cursor_position\":%s,\"cursor_velocity\":{\"x\":0,\"y\":0,\"z\":0},"
        "\"body_orientation\":{\"w\":1,\"x\":0,\"y\":0,\"z\":0},\"current_cursor_force\":{\"x\":%.6f,\"y\":%.6f,\"z\":"
        "%.6f},\"control_mode\":\"idle\"},\"status\":{\"calibrated\":%s,\"power_supply\":%s,\"ready\":true}}],"
        "\"wireless_verse_grip\":[{\"device_id\":\"1\"},{\"device_id\":\"61548\",\"state\":{\"orientation\":{\"w\":0.8,"
        "\"x\":0.6,\"y\":0,\"z\":0},\"buttons\":{\"a\":%s,\"b\":%s,\"c\":false}}}]}",
        greeted ? "" : "\"config\":{\"handedness\":\"right\",\"filters\":{\"force_gate\":{\"gain\":0.3}}},", position,
        written_N[0], written_N[1], written_N[2], fake_value(FAKE_INIT) ? "false" : "true",
        fake_due(FAKE_ERROR_AT) ? "false" : "true", bits & 1 ? "true" : "false", bits & 2 ? "true" : "false");
}

static void leave(void)
{
    pthread_mutex_lock(&lock);
    waiting = true;
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
}
static void enter(void) {}

/* until the test lets this message through; false: not any more */
static bool wait_for_frame(void)
{
    fake_wait(leave, enter);
    pthread_mutex_lock(&lock);
    waiting = true;
    pthread_cond_broadcast(&changed);
    while (n_wanted == 0 && !atomic_load(&stopping) && !fake_value(FAKE_WALL) && !fake_value(FAKE_UNPLUGGED))
        pthread_cond_wait(&changed, &lock);
    waiting = false;
    if (n_wanted > 0) n_wanted--;
    pthread_mutex_unlock(&lock);
    return !fake_value(FAKE_UNPLUGGED) && !atomic_load(&stopping);
}

static void peer(bool is_there)
{
    pthread_mutex_lock(&lock);
    has_peer = is_there;
    waiting = false;
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
}

static int on_event(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t n)
{
    static char text[2048];
    static unsigned char out[LWS_PRE + 4096];
    (void)user;
    switch (reason) {
    case LWS_CALLBACK_FILTER_PROTOCOL_CONNECTION:
        fake_begin();
        return fake_value(FAKE_UNPLUGGED) == 1 ? -1 : 0;
    case LWS_CALLBACK_ESTABLISHED:
        greeted = false;
        pal_set3(written_N, 0, 0, 0);
        lws_callback_on_writable(wsi);
        peer(true);
        break;
    case LWS_CALLBACK_RECEIVE:
        n = n < sizeof text - 1 ? n : sizeof text - 1;
        memcpy(text, in, n);
        text[n] = 0;
        double force[3];
        if (!parse_force(text, force) || !wait_for_frame()) return -1;
        pal_copy3(written_N, force);
        const double ours[3] = {-force[1], force[0], force[2]};
        fake_step(1e-3, ours, force);
        lws_callback_on_writable(wsi);
        break;
    case LWS_CALLBACK_SERVER_WRITEABLE:
        n = compose((char *)out + LWS_PRE, sizeof out - LWS_PRE);
        greeted = true;
        return lws_write(wsi, out + LWS_PRE, n, LWS_WRITE_TEXT) < 0 ? -1 : 0;
    case LWS_CALLBACK_CLOSED:
        peer(false);
        break;
    default:
        break;
    }
    return 0;
}

static void *serve(void *user)
{
    (void)user;
    while (!atomic_load(&stopping) && lws_service(context, 0) >= 0) {
    }
    return NULL;
}

int fake_haply_start(void)
{
    static const struct lws_protocols protocols[] = {{"haply", on_event, 0, 4096, 0, NULL, 0},
                                                     {NULL, NULL, 0, 0, 0, NULL, 0}};
    struct lws_context_creation_info info = {.port = 0,
                                             .iface = "127.0.0.1",
                                             .protocols = protocols,
                                             .gid = (gid_t)-1,
                                             .uid = (uid_t)-1,
                                             .vhost_name = "haply"};
    lws_set_log_level(0, NULL);
    if (!context) {
        context = lws_create_context(&info);
        if (!context || pthread_create(&thread, NULL, serve, NULL)) return 0;
    }
    /* the last client has gone, and its messages with it */
    pthread_mutex_lock(&lock);
    while (has_peer) pthread_cond_wait(&changed, &lock);
    pthread_mutex_unlock(&lock);
    return lws_get_vhost_listen_port(lws_get_vhost_by_name(context, "haply"));
}

static void wake(void)
{
    pthread_mutex_lock(&lock);
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
}

void fake_haply_stop(void)
{
    atomic_store(&stopping, true);
    wake();
    lws_cancel_service(context);
    pthread_join(thread, NULL);
    lws_context_destroy(context);
}

void fake_haply_send(const char *text)
{
    instead = text;
}

/* waits for a message, lets n through and waits until the next has come, or nobody is there to send it */
static void frames(int n)
{
    pthread_mutex_lock(&lock);
    while (!waiting) pthread_cond_wait(&changed, &lock);
    for (int i = 0; i < n && has_peer; i++) {
        n_wanted = 1;
        waiting = false;
        pthread_cond_broadcast(&changed);
        while (has_peer && !waiting) pthread_cond_wait(&changed, &lock);
    }
    n_wanted = 0;
    pthread_cond_broadcast(&changed);
    pthread_mutex_unlock(&lock);
}

const fake_control *fake_entry(void)
{
    static const fake_control *control;
    if (!control) control = fake_common(frames, wake);
    return control;
}
