/* Motion of a scripted client's tool: key points in time around the touched point, interpolated linearly, repeated.
 * Offsets are in metres along (e1, e2, up), with up pointing out of the organ; the origin is the touched vertex at
 * rest. Thread: any. */
#ifndef PAL_SCRIPTED_CLIENT_SCRIPT_H
#define PAL_SCRIPTED_CLIENT_SCRIPT_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

enum { PAL_SCRIPT_KEYS = 256 };

typedef struct pal_script_key {
    double t_s, offset_m[3];
    uint32_t buttons;
} pal_script_key;
typedef struct pal_script {
    int n_key;
    bool idle; /* sends no poses */
    pal_script_key key[PAL_SCRIPT_KEYS];
} pal_script;

/* name: idle, press, pull, circle, or a file of lines `t_s x_m y_m z_m buttons` (# begins a comment; times increase).
 * The built-in scripts scale with tool radius and press depth. REFUSED: names file and line; IO */
pal_err pal_script_load(pal_script *script, const char *name, double radius_m, double depth_m, pal_diagnostic *diag);
/* offset and buttons at a time since the start; the time of the last key is the period */
void pal_script_at(const pal_script *script, double t_s, double offset_m[3], uint32_t *buttons);
#endif
