#include "clients/scripted_client/script.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static void script_add(pal_script *script, double t_s, double x, double y, double z, uint32_t buttons)
{
    script->key[script->n_key++] = (pal_script_key){t_s, {x, y, z}, buttons};
}

/* a key point: along e1 in depths, along up in depths and m above the radius */
typedef struct script_point {
    double t_s, x_depth, up_depth, up_m;
    uint32_t buttons;
} script_point;

/* down to the depth below the rest surface, hold, up again */
static const script_point press[] = {
    {0, 0, 0, 0.01, 0}, {0.8, 0, -1, 0, 0}, {1.2, 0, -1, 0, 0}, {1.8, 0, 0, 0.01, 0}, {2, 0, 0, 0.01, 0}};
/* touch, grab, lift, hold, let go */
static const script_point pull[] = {{0, 0, 0, 0.01, 0}, {0.4, 0, -0.2, 0, 0}, {0.5, 0, -0.2, 0, 1}, {1.4, 0, 2, 0, 1},
                                    {2, 0.5, 2, 0, 1},  {2.1, 0.5, 2, 0, 0},  {3, 0, 0, 0.01, 0}};

static void script_points(pal_script *script, const script_point *p, size_t n, double radius, double depth)
{
    for (; n-- > 0; p++)
        script_add(script, p->t_s, p->x_depth * depth, 0, radius + p->up_depth * depth + p->up_m, p->buttons);
}

static void script_circle(pal_script *script, double radius, double depth)
{
    enum { STEPS = 48 };
    for (int i = 0; i <= STEPS; i++) {
        const double turn = 2 * 3.14159265358979 * i / STEPS;
        script_add(script, 3.0 * i / STEPS, 1.5 * depth * (cos(turn) - 1), 1.5 * depth * sin(turn), radius - depth / 2,
                   0);
    }
}

static pal_err script_file(pal_script *script, const char *path, pal_diagnostic *diag)
{
    FILE *file = fopen(path, "r");
    if (!file) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", path, strerror(errno));
    char line[256];
    pal_err err = PAL_ERR_OK;
    for (int number = 1; !err && fgets(line, sizeof line, file); number++) {
        pal_script_key key;
        unsigned buttons;
        char rest;
        line[strcspn(line, "#\r\n")] = 0;
        if (line[strspn(line, " \t")] == 0) continue;
        const double *o = key.offset_m;
        const double before = script->n_key ? script->key[script->n_key - 1].t_s : -1;
        if (sscanf(line, "%lf %lf %lf %lf %u %c", &key.t_s, &key.offset_m[0], &key.offset_m[1], &key.offset_m[2],
                   &buttons, &rest) != 5 ||
            !(key.t_s >= 0) || !isfinite(key.t_s) || !isfinite(o[0] + o[1] + o[2]))
            err = PAL_REFUSE(diag, "%s:%d: wants `t_s x_m y_m z_m buttons`", path, number);
        else if (key.t_s <= before)
            err = PAL_REFUSE(diag, "%s:%d: time %g s does not grow", path, number, key.t_s);
        else if (script->n_key == PAL_SCRIPT_KEYS)
            err = PAL_REFUSE(diag, "%s:%d: more than %d lines", path, number, PAL_SCRIPT_KEYS);
        key.buttons = buttons;
        if (!err) script->key[script->n_key++] = key;
    }
    fclose(file);
    if (!err && script->n_key < 1) err = PAL_REFUSE(diag, "%s: has no line", path);
    return err;
}

pal_err pal_script_load(pal_script *script, const char *name, double radius_m, double depth_m, pal_diagnostic *diag)
{
    *script = (pal_script){0};
    script->idle = !strcmp(name, "idle");
    if (script->idle)
        script_add(script, 0, 0, 0, radius_m + 0.05, 0);
    else if (!strcmp(name, "press"))
        script_points(script, press, sizeof press / sizeof *press, radius_m, depth_m);
    else if (!strcmp(name, "pull"))
        script_points(script, pull, sizeof pull / sizeof *pull, radius_m, depth_m);
    else if (!strcmp(name, "circle"))
        script_circle(script, radius_m, depth_m);
    else
        return script_file(script, name, diag);
    return PAL_ERR_OK;
}

void pal_script_at(const pal_script *script, double t_s, double offset_m[3], uint32_t *buttons)
{
    const double period = script->key[script->n_key - 1].t_s;
    if (period > 0) t_s = fmod(t_s, period);
    int i = 0;
    while (i + 1 < script->n_key && script->key[i + 1].t_s <= t_s) i++;
    const pal_script_key *a = &script->key[i], *b = i + 1 < script->n_key ? a + 1 : a;
    const double s = b->t_s > a->t_s ? fmin(fmax((t_s - a->t_s) / (b->t_s - a->t_s), 0), 1) : 0;
    for (int k = 0; k < 3; k++) offset_m[k] = a->offset_m[k] + s * (b->offset_m[k] - a->offset_m[k]);
    *buttons = a->buttons;
}
