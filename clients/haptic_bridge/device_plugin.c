#include "clients/haptic_bridge/device_plugin.h"
#include "clients/haptic_bridge/device_common.h"
#include "server/base/vec3.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PLUGIN_REFUSED = PAL_DEVICE_OWN }; /* its table is not one of ours */

typedef struct plugin_device {
    pal_haptic_v1 table; /* a copy; functions that the plug-in does not have are NULL */
    void *handle;        /* its own */
    double force_N[3];
    pal_device_guard guard;
    char file[256], text[PAL_DEVICE_TEXT];
} plugin_device;

static int plugin_probe(char *reason, size_t n)
{
    snprintf(reason, n, "a shared object with pal_haptic_entry: --device plugin:FILE,ID");
    return 0;
}

static int plugin_take_table(plugin_device *h, const pal_haptic_v1 *table)
{
    if (!table || table->abi != PAL_HAPTIC_ABI || table->size < offsetof(pal_haptic_v1, reopen)) {
        snprintf(h->text, sizeof h->text, "%.160s: its table is of ABI %u with %u bytes, wanted %d with %zu or more",
                 h->file, table ? table->abi : 0, table ? table->size : 0, PAL_HAPTIC_ABI,
                 offsetof(pal_haptic_v1, reopen));
        return PLUGIN_REFUSED;
    }
    memcpy(&h->table, table, table->size < sizeof *table ? table->size : sizeof *table);
    const pal_haptic_v1 *t = &h->table;
    if (t->open && t->read && t->write && t->force_enable && t->stop && t->close && t->strerror) return 0;
    snprintf(h->text, sizeof h->text,
             "%.160s: its table lacks open, read, write, force_enable, stop, close or strerror", h->file);
    return PLUGIN_REFUSED;
}

static int plugin_open(void **handle, const char *id, pal_dev_info *out)
{
    plugin_device *h = calloc(1, sizeof *h);
    *handle = h;
    if (!h) return PAL_DEVICE_ERROR_MEMORY;
    const size_t n_file = strcspn(id, ",");
    snprintf(h->file, sizeof h->file, "%.*s", (int)n_file, id);
    const pal_haptic_v1 *(*entry)(void) = NULL;
    const pal_device_function function[] = {{"pal_haptic_entry", &entry, true}};
    if (!pal_device_library_load((const char *const[]){h->file, NULL}, false, function, 1, h->text, sizeof h->text))
        return PAL_DEVICE_ERROR_LIBRARY;
    const int refused = plugin_take_table(h, entry());
    if (refused) return refused;
    *out = (pal_dev_info){.size = sizeof *out};
    const int error = h->table.open(&h->handle, id[n_file] ? id + n_file + 1 : "", out);
    if (error >= 0 && out->thread_model != PAL_DEVICE_POLLED && !h->table.run) {
        snprintf(h->text, sizeof h->text, "%.160s: its device is not polled, and its table has no run", h->file);
        return PLUGIN_REFUSED;
    }
    return error;
}

static int plugin_read(void *handle, pal_dev_state *state)
{
    plugin_device *h = handle;
    *state = (pal_dev_state){.size = sizeof *state};
    const int result = h->table.read(h->handle, state);
    if (result < 0) return result;
    const int refused = pal_device_guard_pose(&h->guard, state, h->force_N);
    return refused ? refused : result;
}

static int plugin_write(void *handle, const double force_N[3], const double torque_N_m[3], double grip)
{
    plugin_device *h = handle;
    pal_copy3(h->force_N, force_N);
    return h->table.write(h->handle, force_N, torque_N_m, grip);
}

static int plugin_run(void *handle, int (*tick)(void *), void *user)
{
    plugin_device *h = handle;
    return h->table.run(h->handle, tick, user);
}

static int plugin_force_enable(void *handle, int on)
{
    plugin_device *h = handle;
    return h->table.force_enable(h->handle, on);
}

static int plugin_stop(void *handle)
{
    plugin_device *h = handle;
    return h->table.stop(h->handle);
}

static void plugin_close(void *handle)
{
    plugin_device *h = handle;
    if (h && h->handle) h->table.close(h->handle);
    free(h);
}

static const char *plugin_strerror(void *handle, int error)
{
    plugin_device *h = handle;
    if (!h) return "no memory for a plug-in";
    if (error == PAL_DEVICE_ERROR_POSE || error == PAL_DEVICE_ERROR_FROZEN)
        return pal_device_error_text(error, h->file, h->text);
    if (h->text[0] && (error == PAL_DEVICE_ERROR_LIBRARY || error == PLUGIN_REFUSED)) return h->text;
    const char *own = h->table.strerror ? h->table.strerror(h->handle, error) : "no table";
    snprintf(h->text, sizeof h->text, "%.120s: %.120s (%d)", h->file, own, error);
    return h->text;
}

static int plugin_reopen(void *handle)
{
    plugin_device *h = handle;
    h->guard = (pal_device_guard){.since_s = pal_device_time_s()};
    return h->table.reopen ? h->table.reopen(h->handle) : PAL_DEVICE_ERROR_SILENT;
}

static int plugin_check(void *handle, int step, char *text, size_t n)
{
    plugin_device *h = handle;
    return h && h->table.check ? h->table.check(h->handle, step, text, n) : 0;
}

const pal_haptic_v1 *pal_device_plugin(void)
{
    static const pal_haptic_v1 table = {.abi = PAL_HAPTIC_ABI,
                                        .size = sizeof table,
                                        .name = "plugin",
                                        .probe = plugin_probe,
                                        .open = plugin_open,
                                        .read = plugin_read,
                                        .write = plugin_write,
                                        .run = plugin_run,
                                        .force_enable = plugin_force_enable,
                                        .stop = plugin_stop,
                                        .close = plugin_close,
                                        .strerror = plugin_strerror,
                                        .reopen = plugin_reopen,
                                        .check = plugin_check};
    return &table;
}
