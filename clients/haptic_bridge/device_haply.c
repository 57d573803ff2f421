#include "clients/haptic_bridge/device_haply.h"
#include "clients/haptic_bridge/device_common.h"
#include "clients/haptic_bridge/device_haply_scan.h"
#include "clients/haptic_bridge/device_tuning.h"
#include "server/base/vec3.h"

#include <libwebsockets.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

enum {
    HAPLY_NO_SERVICE = PAL_DEVICE_OWN,
    HAPLY_CLOSED = PAL_DEVICE_OWN - 1,
    HAPLY_MALFORMED = PAL_DEVICE_OWN - 2,
    HAPLY_NOT_CALIBRATED = PAL_DEVICE_OWN - 3,
    HAPLY_NO_POWER = PAL_DEVICE_OWN - 4,
    HAPLY_PORT = 10001,
    HAPLY_IN_BYTES = 65536, /* the first message, with the configuration of all devices, has some thousand */
    HAPLY_OUT_BYTES = 512,
    HAPLY_DEVICES = 8,
    HAPLY_LOOK_US = 100000
};

typedef struct haply_device {
    char wanted[24], host[64]; /* wanted: "" the first */
    int port, index;
    struct lws_context *context;
    struct lws *wsi;
    bool open, has_state; /* the websocket is open, the first message has come */
    char in[HAPLY_IN_BYTES];
    size_t n_in;
    unsigned char out[LWS_PRE + HAPLY_OUT_BYTES];
    lws_sorted_usec_list_t look;
    unsigned n_message, n_message_looked;
    int n_silent_look;
    /* of the tick */
    int (*tick)(void *);
    void *user;
    bool ending, ended; /* the last force, which is none, is to be sent; has been sent */
    int error;
    pal_haply_state state;
    double middle_m[3], force_N[3];
    pal_device_guard guard;
    atomic_bool stopped, enabled;
    char what[160], text[PAL_DEVICE_TEXT];
} haply_device;

/* device x, y -> y right, -x to the user; and back */
static void haply_to_ours(double ours[3], const double theirs[3])
{
    pal_set3(ours, -theirs[1], theirs[0], theirs[2]);
}
static void haply_from_ours(double theirs[3], const double ours[3])
{
    pal_set3(theirs, ours[1], -ours[0], ours[2]);
}

/* appends text, and a number of at most 100 to six places; without stdio, as it is in the tick */
static size_t haply_text(char *to, size_t n, const char *text)
{
    const size_t n_text = strlen(text);
    if (n + n_text > HAPLY_OUT_BYTES) return n;
    memcpy(to + n, text, n_text);
    return n + n_text;
}
static size_t haply_number(char *to, size_t n, double value)
{
    char digits[16];
    size_t at = sizeof digits - 1;
    long rest = lround(1e6 * fmin(fmax(fabs(value), 0), 100));
    digits[at] = 0;
    for (int i = 0; i < 7 || rest > 0; i++, rest /= 10) {
        if (i == 6) digits[--at] = '.';
        digits[--at] = (char)('0' + rest % 10);
    }
    if (value < 0) digits[--at] = '-';
    return haply_text(to, n, digits + at);
}

/* a message with the force; the first of a run names our session */
static int haply_send(haply_device *h)
{
    char *to = (char *)h->out + LWS_PRE;
    const bool off = h->ending || h->error || atomic_load(&h->stopped) || !atomic_load(&h->enabled);
    double theirs[3];
    haply_from_ours(theirs, h->force_N);
    size_t n = haply_text(to, 0, "{");
    if (h->n_message == 0)
        n = haply_text(to, n, "\"session\":{\"configure\":{\"profile\":{\"name\":\"org.palpate:bridge\"}}},");
    n = haply_text(to, n, "\"inverse3\":[{\"device_id\":\"");
    n = haply_text(to, n, h->state.device);
    n = haply_text(to, n, "\",\"commands\":{\"set_cursor_force\":{\"values\":{\"x\":");
    for (int k = 0; k < 3; k++) {
        if (k > 0) n = haply_text(to, n, k == 1 ? ",\"y\":" : ",\"z\":");
        n = haply_number(to, n, off ? 0 : theirs[k]);
    }
    n = haply_text(to, n, "}}}}]");
    const char *const grip = h->state.wireless[0] ? h->state.wireless : h->state.wired;
    if (grip[0]) {
        n = haply_text(to, n, h->state.wireless[0] ? ",\"wireless_verse_grip\"" : ",\"verse_grip\"");
        n = haply_text(to, n, ":[{\"device_id\":\"");
        n = haply_text(to, n, grip);
        n = haply_text(to, n, "\",\"commands\":{\"probe_orientation\":{}}}]");
    }
    n = haply_text(to, n, "}");
    h->ended = h->ending;
    return lws_write(h->wsi, h->out + LWS_PRE, n, LWS_WRITE_TEXT) < 0 ? -1 : 0;
}

/* the first message has all devices of the service: which is ours? */
static void haply_first(haply_device *h)
{
    for (h->index = 0; h->index < HAPLY_DEVICES; h->index++) {
        h->state = (pal_haply_state){.wireless_quat = {1}, .wired_quat = {1}};
        if (!pal_haply_scan(h->in, h->n_in, h->index, &h->state)) {
            h->error = HAPLY_MALFORMED;
            return;
        }
        if (!h->state.device[0]) break;
        if (!h->wanted[0] || !strcmp(h->wanted, h->state.device)) {
            h->has_state = true;
            haply_to_ours(h->middle_m, h->state.position_m);
            h->error = h->state.no_power ? HAPLY_NO_POWER : h->state.not_calibrated ? HAPLY_NOT_CALIBRATED : 0;
            return;
        }
    }
    h->error = PAL_DEVICE_ERROR_NONE;
}

/* a message is whole: [servo] in a run */
static void haply_take(haply_device *h)
{
    h->n_message++;
    if (!h->has_state) {
        haply_first(h);
        h->n_message = 0;
        return;
    }
    if (!h->tick) return;
    if (!pal_haply_scan(h->in, h->n_in, h->index, &h->state)) h->error = HAPLY_MALFORMED;
    if (h->state.no_power) h->error = HAPLY_NO_POWER;
    h->ending = h->tick(h->user) != 0 || h->error != 0;
    lws_callback_on_writable(h->wsi);
}

static int haply_callback(struct lws *wsi, enum lws_callback_reasons reason, void *user, void *in, size_t n)
{
    (void)user;
    haply_device *h = wsi ? lws_get_opaque_user_data(wsi) : NULL;
    if (!h) return 0;
    const int yes = 1;
    switch (reason) {
    case LWS_CALLBACK_CLIENT_ESTABLISHED:
        h->open = true;
        (void)setsockopt(lws_get_socket_fd(wsi), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
        break;
    case LWS_CALLBACK_CLIENT_RECEIVE:
        if (lws_is_first_fragment(wsi)) h->n_in = 0;
        if (h->n_in + n > sizeof h->in) return h->error = HAPLY_MALFORMED, -1;
        memcpy(h->in + h->n_in, in, n);
        h->n_in += n;
        if (lws_is_final_fragment(wsi) && lws_remaining_packet_payload(wsi) == 0) haply_take(h);
        break;
    case LWS_CALLBACK_CLIENT_WRITEABLE:
        return haply_send(h);
    case LWS_CALLBACK_CLIENT_CONNECTION_ERROR:
    case LWS_CALLBACK_CLIENT_CLOSED:
        if (!h->error) h->error = h->open ? HAPLY_CLOSED : HAPLY_NO_SERVICE;
        h->open = false;
        h->wsi = NULL;
        break;
    default:
        break;
    }
    return 0;
}

/* ten times a second: a service that says nothing for 2 s has hung */
static void haply_look(lws_sorted_usec_list_t *sul)
{
    haply_device *h = lws_container_of(sul, haply_device, look);
    h->n_silent_look = h->n_message == h->n_message_looked ? h->n_silent_look + 1 : 0;
    h->n_message_looked = h->n_message;
    if (h->n_silent_look * (HAPLY_LOOK_US * 1e-6) >= PAL_DEVICE_RETRY_S && !h->error)
        h->error = h->open ? PAL_DEVICE_ERROR_SILENT : HAPLY_NO_SERVICE;
    lws_sul_schedule(h->context, 0, &h->look, haply_look, HAPLY_LOOK_US);
}

static int haply_connect(haply_device *h)
{
    static const struct lws_protocols protocols[] = {{"haply", haply_callback, 0, HAPLY_IN_BYTES, 0, NULL, 0},
                                                     {NULL, NULL, 0, 0, 0, NULL, 0}};
    struct lws_context_creation_info info = {.port = CONTEXT_PORT_NO_LISTEN,
                                             .protocols = protocols,
                                             .pt_serv_buf_size = HAPLY_IN_BYTES,
                                             .timeout_secs = 2,
                                             .gid = (gid_t)-1,
                                             .uid = (uid_t)-1};
    h->open = h->has_state = h->ending = h->ended = false;
    h->error = h->n_silent_look = 0;
    h->n_message = h->n_message_looked = 0;
    h->tick = NULL;
    h->guard = (pal_device_guard){.since_s = pal_device_time_s()};
    h->context = lws_create_context(&info);
    if (!h->context) return h->error = PAL_DEVICE_ERROR_MEMORY;
    struct lws_client_connect_info to = {.context = h->context,
                                         .address = h->host,
                                         .host = h->host,
                                         .port = h->port,
                                         .path = "/",
                                         .local_protocol_name = "haply",
                                         .ietf_version_or_minus_one = -1,
                                         .opaque_user_data = h,
                                         .pwsi = &h->wsi};
    lws_client_connect_via_info(&to);
    lws_sul_schedule(h->context, 0, &h->look, haply_look, HAPLY_LOOK_US);
    while (!h->has_state && !h->error && lws_service(h->context, 0) >= 0) {
    }
    return h->error;
}

static void haply_disconnect(haply_device *h)
{
    if (!h->context) return;
    lws_sul_schedule(h->context, 0, &h->look, haply_look, LWS_SET_TIMER_USEC_CANCEL);
    if (h->wsi) lws_set_opaque_user_data(h->wsi, NULL);
    lws_context_destroy(h->context);
    h->context = NULL;
    h->wsi = NULL;
}

/* "[DEVICE][@HOST:PORT]" */
static bool haply_parse(haply_device *h, const char *id)
{
    const char *at = strchr(id, '@'), *colon = at ? strrchr(at, ':') : NULL;
    const size_t n_wanted = at ? (size_t)(at - id) : strlen(id);
    const size_t n_host = colon ? (size_t)(colon - at - 1) : at ? strlen(at + 1) : 0;
    if (n_wanted >= sizeof h->wanted || n_host >= sizeof h->host) return false;
    memcpy(h->wanted, id, n_wanted);
    if (n_host)
        memcpy(h->host, at + 1, n_host);
    else
        strcpy(h->host, "localhost");
    h->port = colon ? atoi(colon + 1) : HAPLY_PORT;
    snprintf(h->what, sizeof h->what, "%s %.23s of Haply's service at ws://%.63s:%d", "device",
             h->wanted[0] ? h->wanted : "0", h->host, h->port);
    return h->port > 0 && h->port < 65536;
}

static int haply_open(void **handle, const char *id, pal_dev_info *out)
{
    haply_device *h = calloc(1, sizeof *h);
    *handle = h;
    if (!h) return PAL_DEVICE_ERROR_MEMORY;
    lws_set_log_level(0, NULL);
    if (!haply_parse(h, id)) return PAL_DEVICE_ERROR_NONE;
    if (haply_connect(h)) return h->error;
    *out = (pal_dev_info){.size = sizeof *out,
                          .peak_N = 10,
                          .continuous_N = 10,
                          .stiffness_max_N_m = 1000,
                          .damping_max_Ns_m = 6,
                          .dof_in = h->state.wireless[0] || h->state.wired[0] ? 6 : 3,
                          .dof_out = 3,
                          .thread_model = PAL_DEVICE_REQUEST_REPLY};
    for (int k = 0; k < 3; k++) out->low_m[k] = -0.15, out->high_m[k] = 0.15;
    snprintf(out->name, sizeof out->name, "Inverse3 %s", h->state.device);
    return 0;
}

static int haply_probe(char *reason, size_t n)
{
    void *handle;
    pal_dev_info info;
    const int error = haply_open(&handle, "", &info);
    haply_device *h = handle;
    snprintf(reason, n, "%s", error ? pal_device_haply()->strerror(h, error) : info.name);
    pal_device_haply()->close(h);
    return error ? -1 : 1;
}

static int haply_reopen(void *handle)
{
    haply_device *h = handle;
    haply_disconnect(h);
    return haply_connect(h);
}

static int haply_run(void *handle, int (*tick)(void *), void *user)
{
    haply_device *h = handle;
    h->tick = tick, h->user = user;
    h->n_silent_look = 0;
    h->ending = h->ended = false;
    if (h->wsi && !h->error) lws_callback_on_writable(h->wsi);
    while (!h->ended && h->open && h->error != PAL_DEVICE_ERROR_SILENT && lws_service(h->context, 0) >= 0) {
    }
    h->tick = NULL;
    if (!h->open && !h->error) h->error = HAPLY_CLOSED;
    return h->error;
}

static int haply_read(void *handle, pal_dev_state *s)
{
    haply_device *h = handle;
    if (h->error) return h->error;
    const pal_haply_state *now = &h->state;
    *s = (pal_dev_state){
        .size = sizeof *s, .has_force = now->has_force, .stamp_us = (uint64_t)(1e6 * pal_device_time_s())};
    haply_to_ours(s->position_m, now->position_m);
    pal_sub3(s->position_m, s->position_m, h->middle_m);
    haply_to_ours(s->force_N, now->force_N);
    const double *q = now->wireless[0] ? now->wireless_quat : now->wired_quat;
    s->quat[0] = q[0];
    haply_to_ours(s->quat + 1, q + 1);
    bool any = !now->wireless[0] && !now->wired[0]; /* a device without a handle that has buttons arms by its rest */
    for (int i = 0; i < PAL_HAPLY_BUTTONS; i++) any |= now->button[i];
    if (now->button[0]) s->buttons |= PAL_DEVICE_BUTTON_GRASP;
    if (now->button[1]) s->buttons |= PAL_DEVICE_BUTTON_CLUTCH;
    if (any) s->buttons |= PAL_DEVICE_BUTTON_DEADMAN;
    return pal_device_guard_pose(&h->guard, s, h->force_N);
}

static int haply_write(void *handle, const double force_N[3], const double torque_N_m[3], double grip)
{
    (void)torque_N_m, (void)grip;
    pal_copy3(((haply_device *)handle)->force_N, force_N);
    return 0;
}

static int haply_force_enable(void *handle, int on)
{
    haply_device *h = handle;
    atomic_store(&h->enabled, on != 0);
    if (on) atomic_store(&h->stopped, false);
    return 0;
}

/* the next message has no force: the service offers no other way in */
static int haply_stop(void *handle)
{
    atomic_store(&((haply_device *)handle)->stopped, true);
    return 0;
}

static void haply_close(void *handle)
{
    haply_device *h = handle;
    if (h) haply_disconnect(h);
    free(h);
}

static const char *haply_strerror(void *handle, int error)
{
    haply_device *h = handle;
    if (!h) return "no memory for a device of Haply's service";
    static const char *const own[] = {
        "no answer: is the service installed and running?", "the service has closed the connection",
        "the service sent what is no message of state: another version?",
        "it is not calibrated: follow the service's own page", "it has no power: plug its supply in"};
    if (error > PAL_DEVICE_OWN || PAL_DEVICE_OWN - error >= (int)(sizeof own / sizeof *own))
        return pal_device_error_text(error, h->what, h->text);
    snprintf(h->text, sizeof h->text, "%s: %s", h->what, own[PAL_DEVICE_OWN - error]);
    return h->text;
}

static int haply_check(void *handle, int step, char *text, size_t n)
{
    haply_device *h = handle;
    if (!h || step > 1) return 0;
    const bool has_grip = h->state.wireless[0] || h->state.wired[0];
    if (step == 0) {
        snprintf(text, n, "handle: %s", has_grip ? "with buttons" : "without buttons: it arms by resting for 0.5 s");
        return 1;
    }
    snprintf(text, n, "force read back: %s", h->state.has_force ? "yes" : "no: the service is older than 3.1");
    return h->state.has_force ? 1 : -1;
}

const pal_haptic_v1 *pal_device_haply(void)
{
    static const pal_haptic_v1 table = {.abi = PAL_HAPTIC_ABI,
                                        .size = sizeof table,
                                        .name = "haply",
                                        .probe = haply_probe,
                                        .open = haply_open,
                                        .read = haply_read,
                                        .write = haply_write,
                                        .run = haply_run,
                                        .force_enable = haply_force_enable,
                                        .stop = haply_stop,
                                        .close = haply_close,
                                        .strerror = haply_strerror,
                                        .reopen = haply_reopen,
                                        .check = haply_check};
    return &table;
}
