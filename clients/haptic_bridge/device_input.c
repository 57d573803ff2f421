#include "clients/haptic_bridge/device_input.h"
#include "clients/haptic_bridge/device_common.h"
#include "clients/haptic_bridge/device_tuning.h"
#include "server/base/vec3.h"

#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <linux/input.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

enum { INPUT_AXES = 6, INPUT_READS_MAX = 4, INPUT_DENIED = PAL_DEVICE_OWN, INPUT_SPNAV = PAL_DEVICE_OWN - 1 };

/* USB ids of SpaceMice. straight: their y is up and z away from the user; else y is to the user and z down */
static const struct {
    unsigned short vendor, product;
    bool straight;
} space_mouse[] = {{0x046d, 0xc603, true},  {0x046d, 0xc605, true},  {0x046d, 0xc606, true},  {0x046d, 0xc621, true},
                   {0x046d, 0xc623, false}, {0x046d, 0xc625, false}, {0x046d, 0xc626, false}, {0x046d, 0xc627, false},
                   {0x046d, 0xc628, false}, {0x046d, 0xc629, false}, {0x046d, 0xc62b, false}, {0x256f, 0xc62e, false},
                   {0x256f, 0xc62f, false}, {0x256f, 0xc631, false}, {0x256f, 0xc632, false}, {0x256f, 0xc633, false},
                   {0x256f, 0xc635, false}, {0x256f, 0xc636, false}, {0x256f, 0xc638, false}, {0x256f, 0xc63a, false}};

/* what libspnav gives, as its reference has it */
typedef union spnav_event {
    int type; /* 1: motion, 2: button */
    struct {
        int type, axis[INPUT_AXES];
        unsigned period;
        int *data;
    } motion;
    struct {
        int type, press, number;
    } button;
    int room[32];
} spnav_event;
static struct {
    int (*spnav_open)(void);
    int (*spnav_close)(void);
    int (*spnav_poll_event)(spnav_event *);
} spnav;

typedef struct input_device {
    char path[256]; /* "": the first SpaceMouse */
    bool is_spnav, straight;
    int file;
    pal_input_axes axes;
    double x[3], quat[4]; /* of the tool */
    double last_s, event_s;
    char text[PAL_DEVICE_TEXT], library_text[PAL_DEVICE_TEXT];
} input_device;

static void input_take(pal_input_axes *a, const struct input_event *e)
{
    if (e->type == EV_SYN && e->code == SYN_DROPPED) {
        memset(a->value, 0, sizeof a->value);
        a->buttons = 0;
        a->lost_some = true;
    }
    if ((e->type == EV_ABS || e->type == EV_REL) && e->code < INPUT_AXES) {
        a->value[e->code] = e->value;
        a->relative = e->type == EV_REL;
        a->lost_some = false;
    }
    if (e->type == EV_KEY && e->code >= BTN_MISC && e->value <= 1) {
        const unsigned bit = 1u << (e->code & 15);
        a->buttons = e->value == 1 ? a->buttons | bit : a->buttons & ~bit;
    }
}

bool pal_input_feed(pal_input_axes *a, const unsigned char *bytes, size_t n)
{
    bool any = false;
    while (n > 0) {
        const size_t room = sizeof(struct input_event) - a->n_part, take = n < room ? n : room;
        memcpy(a->part + a->n_part, bytes, take);
        a->n_part += take, bytes += take, n -= take;
        if (a->n_part < sizeof(struct input_event)) break;
        struct input_event event;
        memcpy(&event, a->part, sizeof event);
        a->n_part = 0;
        input_take(a, &event);
        any = true;
    }
    return any;
}

double pal_input_deflection(const pal_input_axes *a, int axis)
{
    const double low = a->low[axis], high = a->high[axis];
    if (!(high > low)) return 0;
    const double d = 2 * (a->value[axis] - 0.5 * (low + high)) / (high - low);
    const double over = fabs(fmin(fmax(d, -1), 1)) - PAL_DEVICE_INPUT_DEAD;
    return over > 0 ? copysign(over / (1 - PAL_DEVICE_INPUT_DEAD), d) : 0;
}

/* which row of space_mouse; -1: another device */
static int input_model(int file)
{
    struct input_id id;
    if (ioctl(file, EVIOCGID, &id) < 0) return -1;
    for (int i = 0; i < (int)(sizeof space_mouse / sizeof *space_mouse); i++)
        if (space_mouse[i].vendor == id.vendor && space_mouse[i].product == id.product) return i;
    return -1;
}

/* path of the first SpaceMouse among the event files; their number, and of those that may not be read */
static bool input_find(char *path, size_t n, int *n_file, int *n_denied)
{
    glob_t found = {0};
    bool is_there = false;
    *n_file = *n_denied = 0;
    (void)glob("/dev/input/event*", 0, NULL, &found);
    for (size_t i = 0; i < found.gl_pathc && !is_there; i++) {
        const int file = open(found.gl_pathv[i], O_RDONLY | O_NONBLOCK | O_CLOEXEC);
        (*n_file)++;
        if (file < 0) *n_denied += errno == EACCES;
        if (file < 0) continue;
        is_there = input_model(file) >= 0;
        if (is_there) snprintf(path, n, "%s", found.gl_pathv[i]);
        close(file);
    }
    globfree(&found);
    return is_there;
}

static int input_probe(char *reason, size_t n)
{
    char path[256];
    int n_file, n_denied;
    if (input_find(path, sizeof path, &n_file, &n_denied)) {
        snprintf(reason, n, "SpaceMouse at %s", path);
        return 1;
    }
    if (n_file == 0)
        snprintf(reason, n, "looked for /dev/input/event*: not there");
    else if (n_denied > 0)
        snprintf(reason, n, "%d of %d files /dev/input/event* may not be read: add your user to the group input",
                 n_denied, n_file);
    else
        snprintf(reason, n, "none of %d files /dev/input/event* is a SpaceMouse: --device input:FILE takes any",
                 n_file);
    return -1;
}

static int input_connect_spnav(input_device *h)
{
    static const char *const file[] = {"libspnav.so.0", "libspnav.so", NULL};
    const pal_device_function function[] = {{"spnav_open", &spnav.spnav_open, true},
                                            {"spnav_close", &spnav.spnav_close, true},
                                            {"spnav_poll_event", &spnav.spnav_poll_event, true}};
    if (!pal_device_library_load(file, false, function, 3, h->library_text, sizeof h->library_text))
        return PAL_DEVICE_ERROR_LIBRARY;
    h->straight = true;
    for (int i = 0; i < INPUT_AXES; i++)
        h->axes.low[i] = -PAL_DEVICE_SPNAV_RANGE, h->axes.high[i] = PAL_DEVICE_SPNAV_RANGE;
    return spnav.spnav_open() < 0 ? INPUT_SPNAV : 0;
}

static int input_connect_file(input_device *h)
{
    char path[256];
    int n_file, n_denied;
    if (h->path[0])
        memcpy(path, h->path, sizeof path);
    else if (!input_find(path, sizeof path, &n_file, &n_denied))
        return n_denied ? INPUT_DENIED : PAL_DEVICE_ERROR_NONE;
    h->file = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (h->file < 0) return errno == EACCES ? INPUT_DENIED : PAL_DEVICE_ERROR_NONE;
    const int model = input_model(h->file);
    h->straight = model >= 0 && space_mouse[model].straight;
    for (unsigned i = 0; i < INPUT_AXES; i++) {
        struct input_absinfo range;
        const bool known = ioctl(h->file, EVIOCGABS(i), &range) >= 0 && range.minimum < range.maximum;
        h->axes.low[i] = known ? range.minimum : -PAL_DEVICE_INPUT_RANGE;
        h->axes.high[i] = known ? range.maximum : PAL_DEVICE_INPUT_RANGE;
        h->axes.value[i] = known ? range.value : 0;
    }
    /* both are allowed to fail: the desktop then moves as well, or the light stays off */
    const struct input_event light = {.type = EV_LED, .code = LED_MISC, .value = 1};
    (void)ioctl(h->file, EVIOCGRAB, 1);
    const int out = model >= 0 ? open(path, O_WRONLY | O_NONBLOCK | O_CLOEXEC) : -1;
    if (out >= 0 && write(out, &light, sizeof light) < 0) errno = 0;
    if (out >= 0) close(out);
    return 0;
}

static int input_connect(input_device *h)
{
    h->axes = (pal_input_axes){0};
    h->last_s = h->event_s = pal_device_time_s();
    return h->is_spnav ? input_connect_spnav(h) : input_connect_file(h);
}

static void input_disconnect(input_device *h)
{
    if (h->is_spnav && spnav.spnav_close) spnav.spnav_close();
    if (h->file >= 0) close(h->file);
    h->file = -1;
}

static int input_open(void **handle, const char *id, pal_dev_info *out)
{
    input_device *h = calloc(1, sizeof *h);
    *handle = h;
    if (!h) return PAL_DEVICE_ERROR_MEMORY;
    h->file = -1;
    h->quat[0] = 1;
    h->is_spnav = !strcmp(id, "spnav");
    if (!h->is_spnav) snprintf(h->path, sizeof h->path, "%s", id);
    *out = (pal_dev_info){.size = sizeof *out, .dof_in = 6, .pose_only = 1};
    for (int k = 0; k < 3; k++) out->high_m[k] = PAL_DEVICE_INPUT_REACH_M, out->low_m[k] = -out->high_m[k];
    snprintf(out->name, sizeof out->name, "%.50s", h->is_spnav ? "spacenavd" : id[0] ? id : "SpaceMouse");
    return input_connect(h);
}

static int input_reopen(void *handle)
{
    input_device *h = handle;
    input_disconnect(h);
    return input_connect(h);
}

/* takes what has come; < 0: the device is gone */
static int input_events(input_device *h)
{
    bool any = false;
    if (h->is_spnav) {
        spnav_event e;
        for (int n = 0; n < 64 && spnav.spnav_poll_event(&e); n++) {
            if (e.type == 1) memcpy(h->axes.value, e.motion.axis, sizeof h->axes.value);
            if (e.type == 2 && e.button.number >= 0 && e.button.number < 16) {
                const unsigned bit = 1u << e.button.number;
                h->axes.buttons = e.button.press ? h->axes.buttons | bit : h->axes.buttons & ~bit;
            }
            any = true;
        }
    }
    unsigned char bytes[16 * sizeof(struct input_event)];
    for (int i = 0; i < INPUT_READS_MAX && !h->is_spnav; i++) {
        const ssize_t n = read(h->file, bytes, sizeof bytes);
        if (n < 0 && (errno == EAGAIN || errno == EINTR)) break;
        if (n <= 0) return PAL_DEVICE_ERROR_SILENT;
        any |= pal_input_feed(&h->axes, bytes, (size_t)n);
    }
    const double now = pal_device_time_s();
    if (any) h->event_s = now;
    /* the kernel passes no relative motion of 0: what is held repeats itself, what has been let go is silent */
    if (h->axes.relative && now - h->event_s > PAL_DEVICE_INPUT_SILENT_S)
        memset(h->axes.value, 0, sizeof h->axes.value);
    return 0;
}

/* three of the axes in ours: right, up and to the user */
static void input_vector(const input_device *h, int first, double v[3])
{
    double a[3];
    for (int k = 0; k < 3; k++) {
        const double d = pal_input_deflection(&h->axes, first + k);
        a[k] = d * fabs(d);
    }
    pal_set3(v, h->straight ? -a[2] : a[1], a[0], h->straight ? a[1] : -a[2]);
}

static int input_read(void *handle, pal_dev_state *s)
{
    input_device *h = handle;
    const int gone = input_events(h);
    if (gone) return gone;
    const double now = pal_device_time_s(), dt = fmin(now - h->last_s, PAL_DEVICE_INPUT_SILENT_S);
    h->last_s = now;
    double v[3], w[3];
    input_vector(h, 0, v);
    input_vector(h, 3, w);
    for (int k = 0; k < 3; k++) {
        h->x[k] += PAL_DEVICE_INPUT_SPEED_M_S * dt * v[k];
        h->x[k] = fmin(fmax(h->x[k], -PAL_DEVICE_INPUT_REACH_M), PAL_DEVICE_INPUT_REACH_M);
    }
    /* q' = w q / 2 */
    double q[4] = {h->quat[0], h->quat[1], h->quat[2], h->quat[3]}, turn[3];
    pal_cross3(turn, w, q + 1);
    const double half = 0.5 * PAL_DEVICE_INPUT_TURN_RAD_S * dt;
    h->quat[0] -= half * pal_dot3(w, q + 1);
    for (int k = 0; k < 3; k++) h->quat[1 + k] += half * (q[0] * w[k] + turn[k]);
    const double length = sqrt(h->quat[0] * h->quat[0] + pal_dot3(h->quat + 1, h->quat + 1));
    for (int k = 0; k < 4; k++) h->quat[k] /= length;
    *s = (pal_dev_state){.size = sizeof *s, .stamp_us = (uint64_t)(1e6 * now)};
    pal_copy3(s->position_m, h->x);
    memcpy(s->quat, h->quat, sizeof s->quat);
    if (h->axes.buttons & 1) s->buttons |= PAL_DEVICE_BUTTON_GRASP;
    if (h->axes.buttons & 2) s->buttons |= PAL_DEVICE_BUTTON_CLUTCH;
    if (h->axes.buttons) s->buttons |= PAL_DEVICE_BUTTON_DEADMAN;
    return 0;
}

static int input_write(void *handle, const double force_N[3], const double torque_N_m[3], double grip)
{
    (void)handle, (void)force_N, (void)torque_N_m, (void)grip;
    return 0;
}
static int input_force_enable(void *handle, int on)
{
    (void)handle, (void)on;
    return 0;
}
static int input_stop(void *handle)
{
    (void)handle;
    return 0;
}

static void input_close(void *handle)
{
    input_device *h = handle;
    if (h) input_disconnect(h);
    free(h);
}

static const char *input_strerror(void *handle, int error)
{
    input_device *h = handle;
    if (!h) return "no memory for an input device";
    if (error == PAL_DEVICE_ERROR_LIBRARY) return h->library_text;
    if (error == INPUT_SPNAV) return "libspnav: spacenavd does not answer: is the daemon running?";
    const char *what = h->is_spnav ? "spacenavd" : h->path[0] ? h->path : "/dev/input/event*, any SpaceMouse";
    if (error == INPUT_DENIED)
        snprintf(h->text, sizeof h->text, "%.180s: may not be read: add your user to the group input", what);
    else
        (void)pal_device_error_text(error, what, h->text);
    return h->text;
}

static int input_check(void *handle, int step, char *text, size_t n)
{
    char path[256] = "";
    int n_file, n_denied;
    if (handle || step > 0) return 0;
    const bool is_there = input_find(path, sizeof path, &n_file, &n_denied);
    if (n_denied)
        snprintf(text, n,
                 "permissions: %d of %d files /dev/input/event* may not be read: add your user to the group input",
                 n_denied, n_file);
    else
        snprintf(text, n, "SpaceMouse: %s of %d files /dev/input/event*", is_there ? path : "none", n_file);
    return n_denied ? -1 : 1;
}

const pal_haptic_v1 *pal_device_input(void)
{
    static const pal_haptic_v1 table = {.abi = PAL_HAPTIC_ABI,
                                        .size = sizeof table,
                                        .name = "input",
                                        .probe = input_probe,
                                        .open = input_open,
                                        .read = input_read,
                                        .write = input_write,
                                        .force_enable = input_force_enable,
                                        .stop = input_stop,
                                        .close = input_close,
                                        .strerror = input_strerror,
                                        .reopen = input_reopen,
                                        .check = input_check};
    return &table;
}
