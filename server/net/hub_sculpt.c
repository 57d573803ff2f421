/* Commands of sculpting at the hub (protocol/README.md, "Sculpting"): who may, what is meant and how it is answered;
 * brushes and probes at once, edits through hub_jobs.c. */
#include "server/net/hub_jobs.h"

#include "server/base/vec3.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- what is meant ---- */

/* verbs and the numbers they take; those behind the bar may be left out */
static const struct verb {
    const char *name;
    const char *args;
    int kind; /* pal_cells_command_kind; -1: none */
} verbs[] = {{"delete", "x_m y_m z_m", PAL_CELLS_DELETE},
             {"divide", "x_m y_m z_m", PAL_CELLS_DIVIDE},
             {"extrude", "x_m y_m z_m distance_m | scale", PAL_CELLS_EXTRUDE},
             {"merge", "x_m y_m z_m x2_m y2_m z2_m", PAL_CELLS_MERGE},
             {"bridge", "x_m y_m z_m x2_m y2_m z2_m", PAL_CELLS_BRIDGE},
             {"sharpen", "x_m y_m z_m sharpness entity", PAL_CELLS_SHARPEN_VERTEX},
             {"paint", "x_m y_m z_m radius_m | softness young_factor density_factor", -1},
             {"set_rest_shape", "", -1},
             {"cut", "nx ny nz offset_m", -1},
             {"uncut", "", -1},
             {"undo", "", -1},
             {"redo", "", -1},
             {"probe", "x_m y_m z_m", -1},
             {"inflate", "x_m y_m z_m radius_m pressure_Pa | softness", -1},
             {"curve", "x_m y_m z_m x2_m y2_m z2_m radius_m stiffness_N_m dx_m dy_m dz_m | softness", -1},
             {"release", "", -1},
             {NULL, NULL, -1}};

static const struct verb *find_verb(const char *name)
{
    const struct verb *v = verbs;
    while (v->name && strcmp(v->name, name)) v++;
    return v->name ? v : NULL;
}

static double arg(const pal_wire_command *order, const char *key, double otherwise)
{
    const pal_wire_arg *a = pal_hub_arg(order, key);
    return a ? a->value : otherwise;
}

/* the body named, or the first that sculpts; -1: complained */
static int find_body(pal_hub *hub, pal_client *c, const pal_wire_command *order)
{
    const pal_stream *s = c->room->stream;
    for (int b = 0; b < s->n_part; b++) {
        bool named = !order->target[0] ? s->part[b].info.is_sculptable : !strcmp(s->part[b].info.name, order->target);
        if (named && s->part[b].info.is_sculptable) return b;
        if (named) break;
    }
    if (order->target[0])
        pal_hub_send_error(hub, c, "target", "%s cannot be sculpted", order->target);
    else
        pal_hub_send_error(hub, c, "target", "nothing here can be sculpted");
    return -1;
}

/* ---- what was pointed at ---- */

typedef struct pick {
    int32_t face;     /* control face */
    double rest_m[3]; /* body frame   */
} pick;

/* the point of a triangle nearest to p as weights of its corners (Ericson 2005, 5.1.5); returns the distance squared */
static double nearest_on(const double a[3], const double b[3], const double c[3], const double p[3], double w[3])
{
    double ab[3], ac[3], ap[3], best = INFINITY;
    pal_sub3(ab, b, a), pal_sub3(ac, c, a), pal_sub3(ap, p, a);
    double d00 = pal_dot3(ab, ab), d01 = pal_dot3(ab, ac), d11 = pal_dot3(ac, ac);
    double d20 = pal_dot3(ap, ab), d21 = pal_dot3(ap, ac), det = d00 * d11 - d01 * d01;
    double v = det > 0 ? (d11 * d20 - d01 * d21) / det : -1, u = det > 0 ? (d00 * d21 - d01 * d20) / det : -1;
    const double *corner[3] = {a, b, c};
    double off[3];
    if (v >= 0 && u >= 0 && v + u <= 1) {
        w[0] = 1 - v - u, w[1] = v, w[2] = u;
        for (int k = 0; k < 3; k++) off[k] = ap[k] - v * ab[k] - u * ac[k];
        return pal_dot3(off, off);
    }
    for (int e = 0; e < 3; e++) {
        const double *from = corner[e], *to = corner[(e + 1) % 3];
        double along[3], at[3];
        pal_sub3(along, to, from), pal_sub3(at, p, from);
        double length2 = pal_dot3(along, along), t = length2 > 0 ? pal_dot3(at, along) / length2 : 0;
        t = t < 0 ? 0 : t > 1 ? 1 : t;
        for (int k = 0; k < 3; k++) off[k] = at[k] - t * along[k];
        double d2 = pal_dot3(off, off);
        if (!(d2 < best)) continue;
        best = d2;
        w[e] = 1 - t, w[(e + 1) % 3] = t, w[(e + 2) % 3] = 0;
    }
    return best;
}

static void corner_at(const float *x, int32_t vertex, double out[3])
{
    for (int c = 0; c < 3; c++) out[c] = (double)x[3 * (size_t)vertex + (size_t)c];
}

/* of a body's frame in the scene's */
static void body_origin(const pal_scene *scene, int body, double out[3])
{
    pal_sub3(out, scene->body[body].mesh->surface.origin_m, scene->body[0].mesh->surface.origin_m);
}

/* how far a body's origin lies along a direction of any length but 0, m */
static double frame_offset(const pal_hub_room *room, int body, const double direction[3])
{
    double origin[3], length = pal_norm3(direction);
    body_origin(pal_session_scene(room->session), body, origin);
    return length > 0 ? pal_dot3(origin, direction) / length : 0;
}

/* the surface as it is shown nearest to a place, if that is within a tenth of the scene's box; false: nothing there */
static bool point_at(const pal_hub_room *room, int body, const double at[3], pick *out)
{
    const pal_stream *s = room->stream;
    pal_shown shown;
    double best = INFINITY, side = pal_dist3(s->box_min_m, s->box_max_m), w[3], rest[3] = {0, 0, 0};
    pal_session_shown(room->session, body, &shown);
    const float *x =
        s->frame && s->frame->part[body].n_vertex == shown.n_vertex ? s->frame->part[body].position_m : shown.rest_m;
    int32_t found = -1;
    for (int t = 0; t < shown.n_tri; t++) {
        double p[3][3], weight[3];
        if (!shown.face || shown.face[t] < 0) continue;
        for (int k = 0; k < 3; k++) corner_at(x, shown.tri[3 * t + k], p[k]);
        double d2 = nearest_on(p[0], p[1], p[2], at, weight);
        if (d2 < best) best = d2, found = t, memcpy(w, weight, sizeof w);
    }
    if (found < 0 || !(sqrt(best) <= 0.1 * side)) return false;
    const pal_scene *scene = pal_session_scene(room->session);
    double r[3];
    for (int k = 0; k < 3; k++) {
        corner_at(shown.rest_m, shown.tri[3 * found + k], r);
        pal_axpy3(rest, w[k], r);
    }
    body_origin(scene, body, r);
    pal_axpy3(rest, -1, r);
    out->face = shown.face[found];
    pal_copy3(out->rest_m, rest);
    return true;
}

static bool pick_first(pal_hub *hub, pal_client *c, int body, const pal_wire_command *order, bool second, pick *out)
{
    const double at[3] = {arg(order, second ? "x2_m" : "x_m", 0), arg(order, second ? "y2_m" : "y_m", 0),
                          arg(order, second ? "z2_m" : "z_m", 0)};
    if (point_at(c->room, body, at, out)) return true;
    pal_hub_send_error(hub, c, "refused", "%s: nothing of %s is at %g %g %g m", order->verb,
                       c->room->stream->part[body].info.name, at[0], at[1], at[2]);
    return false;
}

/* control points as they are now, for `keep`; NULL: out of memory or no frame yet */
static double *points_now(const pal_hub_room *room, int body, int *n)
{
    const pal_frame *frame = room->stream->frame;
    *n = frame ? frame->part[body].n_point : 0;
    double *out = *n > 0 ? malloc(3 * sizeof *out * (size_t)*n) : NULL;
    if (out) memcpy(out, frame->part[body].point_m, 3 * sizeof *out * (size_t)*n);
    return out;
}

/* an edit of cells from what was pointed at; false: complained */
static bool read_edit(pal_hub *hub, pal_client *c, int body, const struct verb *v, const pal_wire_command *order,
                      const pal_sculptor *sculptor, pal_sculpt *to)
{
    pick a, b = {.face = -1};
    pal_cells_command *edit = &to->cells;
    if (!pick_first(hub, c, body, order, false, &a)) return false;
    bool two = v->kind == PAL_CELLS_MERGE || v->kind == PAL_CELLS_BRIDGE;
    if (two && !pick_first(hub, c, body, order, true, &b)) return false;
    to->kind = PAL_SCULPT_CELLS;
    *edit = (pal_cells_command){.kind = (pal_cells_command_kind)v->kind,
                                .cell = pal_sculptor_cell(sculptor, a.face),
                                .face = a.face,
                                .other_face = b.face,
                                .edge = pal_sculptor_nearest_edge(sculptor, a.face, a.rest_m),
                                .vertex = pal_sculptor_nearest_vertex(sculptor, a.face, a.rest_m),
                                .distance_m = arg(order, "distance_m", 0),
                                .scale = arg(order, "scale", 1),
                                .sharp = (float)arg(order, "sharpness", 0)};
    if (v->kind != PAL_CELLS_SHARPEN_VERTEX) return true;
    double what = arg(order, "entity", 0);
    edit->kind = what == 0 ? PAL_CELLS_SHARPEN_VERTEX : what == 1 ? PAL_CELLS_SHARPEN_EDGE : PAL_CELLS_SHARPEN_FACE;
    if (what == 0 || what == 1 || what == 2) return true;
    pal_hub_send_error(hub, c, "args", "sharpen: what is %g, wanted 0 (vertex), 1 (edge) or 2 (face)", what);
    return false;
}

/* fills the command; *point_m is the caller's. false: complained */
static bool read_order(pal_hub *hub, pal_client *c, int body, const pal_wire_command *order,
                       const pal_sculptor *sculptor, pal_sculpt *to, double **point_m)
{
    const struct verb *v = find_verb(order->verb);
    pick a;
    *to = (pal_sculpt){.kind = PAL_SCULPT_UNDO};
    if (v->kind >= 0) return read_edit(hub, c, body, v, order, sculptor, to);
    if (!strcmp(v->name, "redo")) to->kind = PAL_SCULPT_REDO;
    if (!strcmp(v->name, "cut") || !strcmp(v->name, "uncut")) {
        to->kind = PAL_SCULPT_CUT;
        to->cut = v->name[0] == 'c';
        pal_set3(to->cut_normal, arg(order, "nx", 0), arg(order, "ny", 0), arg(order, "nz", 0));
        to->cut_m = arg(order, "offset_m", 0) - frame_offset(c->room, body, to->cut_normal);
    }
    if (!strcmp(v->name, "set_rest_shape")) {
        to->kind = PAL_SCULPT_SET_REST;
        *point_m = points_now(c->room, body, &to->n_point);
        to->point_m = *point_m;
    }
    if (!strcmp(v->name, "paint")) {
        to->kind = PAL_SCULPT_PAINT;
        to->stroke = (pal_stroke){.radius_m = arg(order, "radius_m", 0),
                                  .soft = arg(order, "softness", 0.5),
                                  .young_factor = arg(order, "young_factor", 1),
                                  .density_factor = arg(order, "density_factor", 1)};
        if (!pick_first(hub, c, body, order, false, &a)) return false;
        pal_copy3(to->stroke.at_m, a.rest_m);
    }
    return true;
}

/* ---- answers ---- */

void pal_hub_sculpt_answer(pal_hub *hub, pal_client *c, const pal_job *work)
{
    const pal_hub_jobs *s = hub->jobs;
    const char *verb = s->now.order.verb;
    const pal_sculptor *sculptor = s->place[c->room - hub->room][s->body].sculptor;
    pal_wire_answer *a = pal_hub_answer_begin(hub, verb);
    int n_cell = pal_sculptor_cells(sculptor)->n_cell;
    snprintf(a->text, sizeof a->text, "%s: %d control cells, made in %.0f ms", verb, n_cell,
             1e-6 * (double)(work->made_ns - work->asked_ns));
    pal_hub_answer_arg(a, "cells", n_cell);
    pal_hub_answer_arg(a, "can_undo", pal_sculptor_undo_count(sculptor));
    pal_hub_answer_arg(a, "can_redo", pal_sculptor_redo_count(sculptor));
    pal_hub_answer_arg(a, "prepare_ms", 1e-6 * (double)(work->made_ns - work->asked_ns));
    pal_hub_send(hub, c, hub->control);
}

/* the material where the surface is touched */
static void probe(pal_hub *hub, pal_client *c, int body, const pal_wire_command *order)
{
    const pal_scene *scene = pal_session_scene(c->room->session);
    pal_body_def *def = malloc(sizeof *def);
    pal_material m;
    pick a;
    if (def && pick_first(hub, c, body, order, false, &a)) {
        *def = scene->body[body];
        pal_session_material(c->room->session, body, &def->material);
        pal_material_painted(def, a.rest_m, &m);
        pal_wire_answer *to = pal_hub_answer_begin(hub, order->verb);
        snprintf(to->text, sizeof to->text, "probe: E %.4g Pa, density %.4g kg/m3", m.young_Pa, m.density_kg_m3);
        pal_hub_answer_arg(to, "young_Pa", m.young_Pa);
        pal_hub_answer_arg(to, "poisson", m.poisson);
        pal_hub_answer_arg(to, "density_kg_m3", m.density_kg_m3);
        pal_hub_answer_arg(to, "face", a.face);
        pal_hub_send(hub, c, hub->control);
    }
    free(def);
}

/* ---- brushes: at once, no edit of the solid ---- */

/* places of a brush at rest. One whose places are those of the brush that the hand holds stays where that is, however
 * far the surface has moved since; false: complained */
static bool place_brush(pal_hub *hub, pal_client *c, int body, const pal_wire_command *order, pal_hub_tool_brush *h,
                        pal_brush *to)
{
    static const char *const key[6] = {"x_m", "y_m", "z_m", "x2_m", "y2_m", "z2_m"};
    bool same = h->brush.kind == to->kind && h->member == c->id && h->body == body;
    double asked_m[6];
    pick a, b = {.face = -1};
    for (int k = 0; k < 6; k++) {
        asked_m[k] = arg(order, key[k], 0);
        same = same && asked_m[k] == h->asked_m[k];
    }
    if (same) {
        pal_copy3(to->at_m, h->brush.at_m), pal_copy3(to->to_m, h->brush.to_m);
    } else {
        if (!pick_first(hub, c, body, order, false, &a)) return false;
        if (to->kind == PAL_BRUSH_CURVE && !pick_first(hub, c, body, order, true, &b)) return false;
        pal_copy3(to->at_m, a.rest_m);
        if (b.face >= 0) pal_copy3(to->to_m, b.rest_m);
    }
    h->member = c->id, h->body = body;
    memcpy(h->asked_m, asked_m, sizeof asked_m);
    return true;
}

static void give_brush(pal_hub *hub, pal_client *c, int body, int tool, const pal_wire_command *order)
{
    pal_hub_tool_brush *h = &hub->jobs->hand[c->room - hub->room][tool], next = *h;
    pal_diagnostic diag = {""};
    pal_command command = {.kind = PAL_COMMAND_BRUSH, .body = body, .slot = tool};
    pal_brush *b = &command.brush;
    const char *verb = order->verb;
    b->kind = verb[0] == 'i' ? PAL_BRUSH_INFLATE : verb[0] == 'c' ? PAL_BRUSH_CURVE : PAL_BRUSH_NONE;
    b->radius_m = arg(order, "radius_m", 0), b->soft = arg(order, "softness", 0.5);
    b->pressure_Pa = arg(order, "pressure_Pa", 0), b->stiffness_N_m = arg(order, "stiffness_N_m", 0);
    pal_set3(b->lift_m, arg(order, "dx_m", 0), arg(order, "dy_m", 0), arg(order, "dz_m", 0));
    if (b->kind != PAL_BRUSH_NONE && !place_brush(hub, c, body, order, &next, b)) return;
    /* one hand is on one body */
    pal_command before = {.kind = PAL_COMMAND_BRUSH, .body = h->body, .slot = tool};
    if (h->brush.kind != PAL_BRUSH_NONE && h->body != body) (void)pal_session_command(c->room->session, &before);
    pal_err err = b->kind == PAL_BRUSH_NONE ? PAL_ERR_OK : pal_brush_check(b, &diag);
    if (!err) err = pal_session_command(c->room->session, &command);
    if (err) {
        pal_hub_send_error(hub, c, "refused", "%s: %s", verb, diag.text[0] ? diag.text : pal_err_text(err));
        return;
    }
    *h = next;
    h->brush = *b;
    pal_wire_answer *a = pal_hub_answer_begin(hub, verb);
    snprintf(a->text, sizeof a->text, b->kind == PAL_BRUSH_NONE ? "%s: tool %d" : "%s: with tool %d", verb, tool);
    pal_hub_send(hub, c, hub->control);
}

bool pal_hub_sculpt_read(pal_hub *hub, pal_client *c, const pal_wire_command *order, pal_job *to, int *body)
{
    pal_diagnostic diag = {""};
    *body = find_body(hub, c, order);
    if (*body < 0) return false;
    pal_hub_body_edits *at = &hub->jobs->place[c->room - hub->room][*body];
    if (!at->sculptor && pal_sculptor_create(pal_session_scene(c->room->session), *body, &diag, &at->sculptor)) {
        pal_hub_send_error(hub, c, "refused", "%s: %s", order->verb, diag.text);
        return false;
    }
    to->sculptor = at->sculptor;
    return read_order(hub, c, *body, order, at->sculptor, &to->command, &to->point_m);
}

bool pal_hub_sculpt_command(pal_hub *hub, pal_client *c, const pal_wire_command *order)
{
    const struct verb *v = find_verb(order->verb);
    if (!v) return false;
    bool probes = !strcmp(v->name, "probe");
    if (!probes && !pal_hub_jobs_check_rights(hub, c, v->name, "sculpts")) return true;
    int body = find_body(hub, c, order);
    if (body < 0 || !pal_hub_check_args(hub, c, v->args, order)) return true;
    if (probes) {
        probe(hub, c, body, order);
        return true;
    }
    if (!pal_hub_jobs_create(hub)) {
        pal_hub_send_error(hub, c, "refused", "%s: %s", v->name, pal_err_text(PAL_ERR_MEMORY));
        return true;
    }
    bool brush = !strcmp(v->name, "inflate") || !strcmp(v->name, "curve") || !strcmp(v->name, "release");
    int tool = pal_members_find(&c->room->members, c->id)->tool;
    if (brush && tool < 0)
        pal_hub_send_error(hub, c, "tool", "%s: take a tool first, its hand does it", v->name);
    else if (brush)
        give_brush(hub, c, body, tool, order);
    else
        pal_hub_jobs_enqueue(hub, c, PAL_JOB_SCULPT, order);
    return true;
}
