#include "clients/haptic_bridge/hand_brush.h"
#include "clients/haptic_bridge/tuning.h"
#include "server/base/vec3.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const struct {
    const char *name;
    double strength, max;
} brushes[] = {[PAL_HAND_GRASP] = {"grasp", 0, 0},
               [PAL_HAND_INFLATE] = {"inflate", 2000, 1e6},
               [PAL_HAND_CURVE] = {"curve", 200, 1e5},
               [PAL_HAND_PAINT] = {"paint", 2, 100},
               [PAL_HAND_EXTRUDE] = {"extrude", 1, 1}};
enum { N_BRUSH = sizeof brushes / sizeof *brushes };

pal_err pal_hand_brush_parse(const char *text, pal_hand_brush *out, pal_diagnostic *diag)
{
    pal_hand_brush brush = {.radius_m = 0.02};
    const size_t n = strcspn(text, ",");
    for (int k = PAL_HAND_INFLATE; k < N_BRUSH; k++)
        if (n == strlen(brushes[k].name) && !strncmp(text, brushes[k].name, n)) brush.kind = (pal_hand_brush_kind)k;
    if (brush.kind == PAL_HAND_GRASP)
        return PAL_REFUSE(diag, "no brush \"%.*s\": inflate, curve, paint or extrude", (int)n, text);
    brush.strength = brushes[brush.kind].strength;
    for (const char *at = text + n; *at;) {
        char key[16] = "", *end;
        const char *word = at + 1, *equals = strchr(word, '=');
        if (equals && equals - word < (int)sizeof key) memcpy(key, word, (size_t)(equals - word));
        const double number = equals ? strtod(equals + 1, &end) : 0;
        const bool radius = !strcmp(key, "radius"), strength = !strcmp(key, "strength");
        if ((!radius && !strength) || end == equals + 1 || (*end && *end != ','))
            return PAL_REFUSE(diag, "\"%s\" is not radius=MM or strength=NUMBER", word);
        if (!(number > 0) || number > (radius ? 1000 : brushes[brush.kind].max))
            return PAL_REFUSE(diag, "%s %g of %s is not above 0 and at most %g", key, number, brushes[brush.kind].name,
                              radius ? 1000 : brushes[brush.kind].max);
        if (radius) brush.radius_m = 1e-3 * number;
        if (strength) brush.strength = number;
        at = end;
    }
    *out = brush;
    return PAL_ERR_OK;
}

/* ---- commands ---- */

static void add(pal_wire_command *c, const char *key, double value)
{
    pal_wire_arg *arg = &c->arg[c->n_arg++];
    snprintf(arg->key, sizeof arg->key, "%s", key);
    arg->value = value;
}

static pal_wire_command command(const char *verb, const double *at_m)
{
    pal_wire_command c = {.n_arg = 0};
    snprintf(c.verb, sizeof c.verb, "%s", verb);
    static const char *const key[] = {"x_m", "y_m", "z_m"};
    for (int k = 0; k < 3 && at_m; k++) add(&c, key[k], at_m[k]);
    return c;
}

/* a force that waits is replaced; edits wait in turn */
static void queue(pal_hand_brush *b, const pal_wire_command *c)
{
    const bool is_force = b->kind == PAL_HAND_INFLATE || b->kind == PAL_HAND_CURVE;
    if (is_force) b->n_queued = 0;
    if (b->n_queued == PAL_HAND_QUEUE)
        b->n_dropped++;
    else
        b->queue[b->n_queued++] = *c;
}

static double outward_m(const pal_hand_brush *b, const double x_m[3])
{
    double move[3];
    pal_sub3(move, x_m, b->at_m);
    return pal_dot3(move, b->outward);
}

static void inflate(pal_hand_brush *b, const double x_m[3])
{
    pal_wire_command c = command("inflate", b->at_m);
    add(&c, "radius_m", b->radius_m);
    add(&c, "pressure_Pa", b->strength * outward_m(b, x_m) / b->radius_m);
    queue(b, &c);
    b->acts = true;
}

static void curve(pal_hand_brush *b, const double x_m[3])
{
    static const char *const end[] = {"x2_m", "y2_m", "z2_m"}, *const lift[] = {"dx_m", "dy_m", "dz_m"};
    pal_wire_command c = command("curve", b->at_m);
    for (int k = 0; k < 3; k++) add(&c, end[k], b->end_m[k]);
    for (int k = 0; k < 3; k++) add(&c, lift[k], x_m[k] - b->pulled_from_m[k]);
    add(&c, "radius_m", b->radius_m);
    add(&c, "stiffness_N_m", b->strength);
    queue(b, &c);
    b->acts = true;
}

static void paint(pal_hand_brush *b, const double x_m[3])
{
    pal_wire_command c = command("paint", x_m);
    add(&c, "radius_m", b->radius_m);
    add(&c, "young_factor", b->strength);
    add(&c, "density_factor", 1);
    queue(b, &c);
}

static void extrude(pal_hand_brush *b, const double x_m[3])
{
    const double distance_m = outward_m(b, x_m);
    if (distance_m < BRUSH_EXTRUDE_MIN_M) return;
    pal_wire_command c = command("extrude", b->at_m);
    add(&c, "distance_m", distance_m);
    add(&c, "scale", 1);
    queue(b, &c);
}

/* ---- strokes ---- */

static void begin(pal_hand_brush *b, const double x_m[3], const double force_N[3])
{
    const bool pulls = b->kind == PAL_HAND_CURVE && b->drawn;
    b->held = true;
    pal_copy3(b->last_m, x_m);
    pal_copy3(b->pulled_from_m, x_m);
    if (!pulls) pal_copy3(b->at_m, x_m), pal_unit3(b->outward, force_N, 0);
    if (b->kind == PAL_HAND_PAINT) paint(b, x_m);
}

static void move(pal_hand_brush *b, const double x_m[3], bool touches)
{
    const double share = b->kind == PAL_HAND_PAINT ? BRUSH_DAB : BRUSH_STEP;
    if (b->kind == PAL_HAND_EXTRUDE || (b->kind == PAL_HAND_CURVE && !b->drawn)) return;
    if (b->kind == PAL_HAND_PAINT && !touches) return;
    if (pal_dist3(x_m, b->last_m) < share * b->radius_m) return;
    pal_copy3(b->last_m, x_m);
    if (b->kind == PAL_HAND_INFLATE) inflate(b, x_m);
    if (b->kind == PAL_HAND_CURVE) curve(b, x_m);
    if (b->kind == PAL_HAND_PAINT) paint(b, x_m);
}

static void end(pal_hand_brush *b, const double x_m[3])
{
    b->held = false;
    if (b->kind == PAL_HAND_EXTRUDE) extrude(b, x_m);
    if (b->acts) {
        const pal_wire_command c = command("release", NULL);
        queue(b, &c);
    }
    /* a handle shorter than its reach has no middle */
    if (b->kind == PAL_HAND_CURVE) b->drawn = !b->drawn && pal_dist3(x_m, b->at_m) >= b->radius_m;
    if (b->drawn) pal_copy3(b->end_m, x_m);
    b->acts = false;
}

void pal_hand_brush_move(pal_hand_brush *brush, bool button, const double x_m[3], const double *force_N)
{
    if (brush->kind == PAL_HAND_GRASP) return;
    if (!brush->held && button && force_N && pal_norm3(force_N) > NO_FORCE_N) begin(brush, x_m, force_N);
    if (!brush->held) return;
    if (button)
        move(brush, x_m, force_N != NULL);
    else
        end(brush, x_m);
}

bool pal_hand_brush_take(pal_hand_brush *brush, pal_wire_command *out)
{
    if (brush->under_way || brush->n_queued == 0) return false;
    *out = brush->queue[0];
    memmove(brush->queue, brush->queue + 1, sizeof *brush->queue * (size_t)--brush->n_queued);
    return brush->under_way = true;
}

void pal_hand_brush_answered(pal_hand_brush *brush)
{
    brush->under_way = false;
}

void pal_hand_brush_reset(pal_hand_brush *brush)
{
    brush->held = brush->drawn = brush->acts = brush->under_way = false;
    brush->n_queued = 0;
}
