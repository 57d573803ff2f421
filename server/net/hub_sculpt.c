/* Commands of sculpting at the hub (protocol/README.md, "Sculpting"): who may, what is meant, one after the other to
 * the workshop, and what comes out of it in the place of the session that runs.
 *
 * An order waits as it came and is read when its turn comes, so that it means the shape that its forerunners left. */
#include "server/net/hub_parts.h"

#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/base/vec3.h"
#include "server/net/plain_text.h"
#include "server/net/workshop.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_WAITING = 16 };

typedef struct waiting {
    pal_hub_room *room;
    int member;
    uint64_t asked_ns;
    pal_wire_order order;
} waiting;

/* one body of a room that has been sculpted */
typedef struct place {
    pal_sculptor *sculptor;
    pal_sculpt_turn *turn; /* whose scene the body's arrays are in; NULL: still the scene of the start */
} place;

/* the brush that a tool's holder asked for last */
typedef struct hand {
    int member, body;
    double asked_m[6]; /* places as they came */
    pal_brush brush;   /* kind NONE: none     */
} hand;

struct pal_hub_sculpt {
    pal_workshop *workshop;
    waiting list[MOST_WAITING]; /* oldest first; that under way is no longer in it */
    int n;
    waiting now;                  /* under way */
    int body;                     /* of now    */
    place (*place)[PAL_BODY_MAX]; /* [n_room] */
    hand (*hand)[PAL_TOOL_MAX];   /* [n_room] */
};

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
             {"sharpen", "x_m y_m z_m sharp what", PAL_CELLS_SHARPEN_VERTEX},
             {"paint", "x_m y_m z_m radius_m | soft young_factor density_factor", -1},
             {"keep", "", -1},
             {"cut", "nx ny nz offset_m", -1},
             {"uncut", "", -1},
             {"undo", "", -1},
             {"redo", "", -1},
             {"probe", "x_m y_m z_m", -1},
             {"inflate", "x_m y_m z_m radius_m pressure_Pa | soft", -1},
             {"curve", "x_m y_m z_m x2_m y2_m z2_m radius_m stiffness_N_m dx_m dy_m dz_m | soft", -1},
             {"release", "", -1},
             {NULL, NULL, -1}};

static const struct verb *find_verb(const char *name)
{
    const struct verb *v = verbs;
    while (v->name && strcmp(v->name, name)) v++;
    return v->name ? v : NULL;
}

static const pal_wire_arg *find_arg(const pal_wire_order *order, const char *key)
{
    for (uint32_t i = 0; i < order->n_arg; i++)
        if (!strcmp(order->arg[i].key, key)) return &order->arg[i];
    return NULL;
}

static double arg(const pal_wire_order *order, const char *key, double otherwise)
{
    const pal_wire_arg *a = find_arg(order, key);
    return a ? a->value : otherwise;
}

/* is every number there, and none that the verb does not take? false: complained */
static bool good_args(pal_hub *hub, pal_client *c, const struct verb *v, const pal_wire_order *order)
{
    bool needed = true;
    uint32_t n_known = 0;
    for (const char *at = v->args; *at;) {
        char key[32];
        size_t n = strcspn(at, " ");
        snprintf(key, sizeof key, "%.*s", (int)n, at);
        at += n + (at[n] == ' ');
        if (!strcmp(key, "|")) {
            needed = false;
            continue;
        }
        bool there = find_arg(order, key) != NULL;
        n_known += there;
        if (there || !needed) continue;
        pal_hub_complain(hub, c, "args", "%s: %s is missing", v->name, key);
        return false;
    }
    if (n_known == order->n_arg) return true;
    pal_hub_complain(hub, c, "args", "%s takes %s", v->name, v->args[0] ? v->args : "no numbers");
    return false;
}

/* the body named, or the first that sculpts; -1: complained */
static int find_body(pal_hub *hub, pal_client *c, const pal_wire_order *order)
{
    const pal_stream *s = c->room->stream;
    for (int b = 0; b < s->n_part; b++) {
        bool named = !order->target[0] ? s->part[b].info.sculpts : !strcmp(s->part[b].info.name, order->target);
        if (named && s->part[b].info.sculpts) return b;
        if (named) break;
    }
    if (order->target[0])
        pal_hub_complain(hub, c, "target", "%s cannot be sculpted", order->target);
    else
        pal_hub_complain(hub, c, "target", "nothing here can be sculpted");
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

static bool pick_first(pal_hub *hub, pal_client *c, int body, const pal_wire_order *order, bool second, pick *out)
{
    const double at[3] = {arg(order, second ? "x2_m" : "x_m", 0), arg(order, second ? "y2_m" : "y_m", 0),
                          arg(order, second ? "z2_m" : "z_m", 0)};
    if (point_at(c->room, body, at, out)) return true;
    pal_hub_complain(hub, c, "refused", "%s: nothing of %s is at %g %g %g m", order->verb,
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
static bool read_edit(pal_hub *hub, pal_client *c, int body, const struct verb *v, const pal_wire_order *order,
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
                                .edge = pal_sculptor_near_edge(sculptor, a.face, a.rest_m),
                                .vertex = pal_sculptor_near_vertex(sculptor, a.face, a.rest_m),
                                .distance_m = arg(order, "distance_m", 0),
                                .scale = arg(order, "scale", 1),
                                .sharp = (float)arg(order, "sharp", 0)};
    if (v->kind != PAL_CELLS_SHARPEN_VERTEX) return true;
    double what = arg(order, "what", 0);
    edit->kind = what == 0 ? PAL_CELLS_SHARPEN_VERTEX : what == 1 ? PAL_CELLS_SHARPEN_EDGE : PAL_CELLS_SHARPEN_FACE;
    if (what == 0 || what == 1 || what == 2) return true;
    pal_hub_complain(hub, c, "args", "sharpen: what is %g, wanted 0 (vertex), 1 (edge) or 2 (face)", what);
    return false;
}

/* fills the command; *point_m is the caller's. false: complained */
static bool read_order(pal_hub *hub, pal_client *c, int body, const pal_wire_order *order, const pal_sculptor *sculptor,
                       pal_sculpt *to, double **point_m)
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
    if (!strcmp(v->name, "keep")) {
        to->kind = PAL_SCULPT_KEEP;
        *point_m = points_now(c->room, body, &to->n_point);
        to->point_m = *point_m;
    }
    if (!strcmp(v->name, "paint")) {
        to->kind = PAL_SCULPT_PAINT;
        to->stroke = (pal_stroke){.radius_m = arg(order, "radius_m", 0),
                                  .soft = arg(order, "soft", 0.5),
                                  .young_factor = arg(order, "young_factor", 1),
                                  .density_factor = arg(order, "density_factor", 1)};
        if (!pick_first(hub, c, body, order, false, &a)) return false;
        pal_copy3(to->stroke.at_m, a.rest_m);
    }
    return true;
}

/* ---- answers ---- */

static pal_client *find_client(pal_hub *hub, const waiting *w)
{
    for (int i = 0; i < hub->most_clients; i++) {
        pal_client *c = &hub->client[i];
        if (c->peer && c->room == w->room && c->id == w->member && !c->peer->drop_code) return c;
    }
    return NULL;
}

static void add_arg(pal_wire_answer *a, const char *key, double value)
{
    pal_wire_arg *to = &a->arg[a->n_arg++];
    snprintf(to->key, sizeof to->key, "%s", key);
    to->value = value;
}

static pal_wire_answer *begin_answer(pal_hub *hub, const char *verb)
{
    memset(hub->control, 0, sizeof *hub->control);
    hub->control->type = PAL_CONTROL_ANSWER;
    pal_plain_text(hub->control->answer.verb, sizeof hub->control->answer.verb, verb);
    return &hub->control->answer;
}

static void answer_done(pal_hub *hub, const waiting *w, const pal_sculptor *sculptor, const pal_work *work)
{
    pal_client *c = find_client(hub, w);
    if (!c) return;
    pal_wire_answer *a = begin_answer(hub, w->order.verb);
    int n_cell = pal_sculptor_cells(sculptor)->n_cell;
    snprintf(a->text, sizeof a->text, "%s: %d control cells, made in %.0f ms", w->order.verb, n_cell,
             1e-6 * (double)(work->made_ns - work->asked_ns));
    add_arg(a, "cells", n_cell);
    add_arg(a, "can_undo", pal_sculptor_past(sculptor));
    add_arg(a, "can_redo", pal_sculptor_future(sculptor));
    add_arg(a, "made_ms", 1e-6 * (double)(work->made_ns - work->asked_ns));
    pal_hub_say(hub, c, hub->control);
}

/* the material where the surface is touched */
static void probe(pal_hub *hub, pal_client *c, int body, const pal_wire_order *order)
{
    const pal_scene *scene = pal_session_scene(c->room->session);
    pal_body_def *def = malloc(sizeof *def);
    pal_material m;
    pick a;
    if (def && pick_first(hub, c, body, order, false, &a)) {
        *def = scene->body[body];
        pal_session_material(c->room->session, body, &def->material);
        pal_material_painted(def, a.rest_m, &m);
        pal_wire_answer *to = begin_answer(hub, order->verb);
        snprintf(to->text, sizeof to->text, "probe: E %.4g Pa, density %.4g kg/m3", m.young_Pa, m.density_kg_m3);
        add_arg(to, "young_Pa", m.young_Pa);
        add_arg(to, "poisson", m.poisson);
        add_arg(to, "density_kg_m3", m.density_kg_m3);
        add_arg(to, "face", a.face);
        pal_hub_say(hub, c, hub->control);
    }
    free(def);
}

/* ---- brushes: at once, no edit of the solid ---- */

/* places of a brush at rest. One whose places are those of the brush that the hand holds stays where that is, however
 * far the surface has moved since; false: complained */
static bool place_brush(pal_hub *hub, pal_client *c, int body, const pal_wire_order *order, hand *h, pal_brush *to)
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

static void give_brush(pal_hub *hub, pal_client *c, int body, int tool, const pal_wire_order *order)
{
    hand *h = &hub->sculpt->hand[c->room - hub->room][tool], next = *h;
    pal_note note = {""};
    pal_command command = {.kind = PAL_COMMAND_BRUSH, .body = body, .slot = tool};
    pal_brush *b = &command.brush;
    const char *verb = order->verb;
    b->kind = verb[0] == 'i' ? PAL_BRUSH_INFLATE : verb[0] == 'c' ? PAL_BRUSH_CURVE : PAL_BRUSH_NONE;
    b->radius_m = arg(order, "radius_m", 0), b->soft = arg(order, "soft", 0.5);
    b->pressure_Pa = arg(order, "pressure_Pa", 0), b->stiffness_N_m = arg(order, "stiffness_N_m", 0);
    pal_set3(b->lift_m, arg(order, "dx_m", 0), arg(order, "dy_m", 0), arg(order, "dz_m", 0));
    if (b->kind != PAL_BRUSH_NONE && !place_brush(hub, c, body, order, &next, b)) return;
    /* one hand is on one body */
    pal_command before = {.kind = PAL_COMMAND_BRUSH, .body = h->body, .slot = tool};
    if (h->brush.kind != PAL_BRUSH_NONE && h->body != body) (void)pal_session_command(c->room->session, &before);
    pal_err err = b->kind == PAL_BRUSH_NONE ? PAL_ERR_OK : pal_brush_check(b, &note);
    if (!err) err = pal_session_command(c->room->session, &command);
    if (err) {
        pal_hub_complain(hub, c, "refused", "%s: %s", verb, note.text[0] ? note.text : pal_err_text(err));
        return;
    }
    *h = next;
    h->brush = *b;
    pal_wire_answer *a = begin_answer(hub, verb);
    snprintf(a->text, sizeof a->text, b->kind == PAL_BRUSH_NONE ? "%s: tool %d" : "%s: with tool %d", verb, tool);
    pal_hub_say(hub, c, hub->control);
}

/* ---- one after the other ---- */

/* assets that go are kept for a while: a client may be on its way to fetch one */
static void keep_assets(pal_hub_room *room, const pal_stream *before)
{
    for (int p = 0; p < before->n_part; p++) {
        const pal_stream_part *part = &before->part[p];
        if (p < room->stream->n_part && !strcmp(part->info.asset, room->stream->part[p].info.asset)) continue;
        pal_hub_past *past = &room->past[room->n_past];
        snprintf(past->path, sizeof past->path, "%s", part->info.asset);
        pal_packet_replace(&past->asset, pal_packet_hold(part->asset));
        room->n_past = (room->n_past + 1) % PAL_HUB_PAST;
    }
}

/* what came out takes the place of what runs; false: it goes on as it was, note says why */
static bool take_over(pal_hub *hub, pal_hub_sculpt *s, pal_work *work)
{
    pal_hub_room *room = s->now.room;
    place *at = &s->place[room - hub->room][s->body];
    pal_stream *old_stream = room->stream;
    pal_session *old = room->session;
    work->err = pal_session_follow(work->next, old, pal_sculpt_carry, work->turn, &work->note);
    if (work->err) return false;
    pal_stream_follow(work->stream, old_stream);
    pal_sculptor_accept(at->sculptor, work->turn);
    room->stream = work->stream, room->session = work->next;
    memset(s->hand[room - hub->room], 0, sizeof *s->hand); /* brushes are over */
    keep_assets(room, old_stream);
    hub->session[room - hub->room] = NULL;
    room->own = true;
    pal_workshop_clear(s->workshop, old_stream, old, at->turn);
    at->turn = work->turn;
    work->turn = NULL, work->next = NULL, work->stream = NULL;
    return true;
}

static void tell_topology(pal_hub *hub, pal_hub_room *room)
{
    for (int i = 0; i < hub->most_clients; i++) {
        pal_client *c = &hub->client[i];
        if (!c->peer || c->room != room || !c->id || c->peer->drop_code) continue;
        memset(hub->control, 0, sizeof *hub->control);
        hub->control->type = PAL_CONTROL_TOPOLOGY;
        hub->control->topology.n_part = (uint32_t)room->stream->n_part;
        for (int p = 0; p < room->stream->n_part; p++) hub->control->topology.part[p] = room->stream->part[p].info;
        pal_hub_topology_rows(room, &hub->control->topology);
        memset(c->sent_change, 0, sizeof c->sent_change);
        memset(c->sent_field, 0, sizeof c->sent_field);
        pal_hub_say(hub, c, hub->control);
    }
}

static void finish(pal_hub *hub, pal_hub_sculpt *s, pal_work *work)
{
    pal_hub_room *room = s->now.room;
    const pal_sculptor *sculptor = s->place[room - hub->room][s->body].sculptor;
    if (!work->err && take_over(hub, s, work)) {
        tell_topology(hub, room);
        answer_done(hub, &s->now, sculptor, work);
    } else {
        pal_client *c = find_client(hub, &s->now);
        const char *verb = s->now.order.verb, *why = work->note.text[0] ? work->note.text : pal_err_text(work->err);
        bool named = !strncmp(why, verb, strlen(verb)); /* edits of cells say it themselves */
        if (c) pal_hub_complain(hub, c, "refused", named ? "%s%s" : "%s: %s", named ? "" : verb, why);
    }
    pal_work_free(work);
}

/* the scene that runs now, with the materials of now; NULL: out of memory */
static pal_scene *scene_now(const pal_hub_room *room)
{
    pal_scene *scene = malloc(sizeof *scene);
    if (!scene) return NULL;
    *scene = *pal_session_scene(room->session);
    for (int b = 0; b < scene->n_body; b++) pal_session_material(room->session, b, &scene->body[b].material);
    return scene;
}

/* gives the next order to the workshop; one that cannot be read is answered and gone */
static void begin_next(pal_hub *hub, pal_hub_sculpt *s)
{
    /* what is pointed at, and kept, is what is shown: a session that has just begun comes with its first frame */
    while (s->n > 0 && s->list[0].room->stream->frame) {
        pal_work work = {.err = PAL_ERR_OK};
        s->now = s->list[0];
        memmove(s->list, s->list + 1, sizeof *s->list * (size_t)--s->n);
        pal_client *c = find_client(hub, &s->now);
        pal_hub_room *room = s->now.room;
        int body = c ? find_body(hub, c, &s->now.order) : -1; /* who has gone wants nothing any more */
        if (body < 0) continue;
        place *at = &s->place[room - hub->room][body];
        pal_note note = {""};
        if (!at->sculptor && pal_sculptor_create(pal_session_scene(room->session), body, &note, &at->sculptor)) {
            pal_hub_complain(hub, c, "refused", "%s: %s", s->now.order.verb, note.text);
            continue;
        }
        if (!read_order(hub, c, body, &s->now.order, at->sculptor, &work.command, &work.point_m)) continue;
        work.scene = scene_now(room);
        if (!work.scene) {
            pal_work_free(&work);
            pal_hub_complain(hub, c, "refused", "%s: %s", s->now.order.verb, pal_err_text(PAL_ERR_MEMORY));
            continue;
        }
        s->body = body;
        work.sculptor = at->sculptor, work.session = room->session;
        work.error_m = hub->error_m;
        work.asked_ns = s->now.asked_ns;
        pal_workshop_give(s->workshop, &work);
        return;
    }
}

void pal_hub_sculpt_turn(pal_hub *hub)
{
    pal_hub_sculpt *s = hub->sculpt;
    pal_work work;
    if (!s) return;
    if (pal_workshop_take(s->workshop, &work)) finish(hub, s, &work);
    if (!pal_workshop_busy(s->workshop)) begin_next(hub, s);
}

/* ---- coming in and ending ---- */

static void wake_loop(void *user)
{
    pal_loop_wake(user);
}

/* the workshop comes with the first order; false: out of memory */
static bool make_sculpt(pal_hub *hub)
{
    if (hub->sculpt) return true;
    pal_hub_sculpt *s = calloc(1, sizeof *s);
    if (s) s->place = calloc((size_t)hub->n_room, sizeof *s->place);
    if (s) s->hand = calloc((size_t)hub->n_room, sizeof *s->hand);
    if (!s || !s->place || !s->hand || pal_workshop_open(wake_loop, hub->loop, &s->workshop)) {
        if (s) free(s->place), free(s->hand);
        free(s);
        return false;
    }
    hub->sculpt = s;
    return true;
}

bool pal_hub_sculpt_order(pal_hub *hub, pal_client *c, const pal_wire_order *order)
{
    const struct verb *v = find_verb(order->verb);
    if (!v) return false;
    const pal_member_entry *m = pal_members_find(&c->room->members, c->id);
    if (m->role != PAL_MEMBER_INSTRUCTOR && m->tool < 0 && strcmp(v->name, "probe") != 0) {
        pal_hub_complain(hub, c, "role", "%s: only an instructor or who holds a tool sculpts", v->name);
        return true;
    }
    int body = find_body(hub, c, order);
    if (body < 0 || !good_args(hub, c, v, order)) return true;
    if (!strcmp(v->name, "probe")) {
        probe(hub, c, body, order);
        return true;
    }
    if (!make_sculpt(hub)) {
        pal_hub_complain(hub, c, "refused", "%s: %s", v->name, pal_err_text(PAL_ERR_MEMORY));
        return true;
    }
    bool brush = !strcmp(v->name, "inflate") || !strcmp(v->name, "curve") || !strcmp(v->name, "release");
    if (brush && m->tool < 0)
        pal_hub_complain(hub, c, "tool", "%s: take a tool first, its hand does it", v->name);
    else if (brush)
        give_brush(hub, c, body, m->tool, order);
    if (brush) return true;
    pal_hub_sculpt *s = hub->sculpt;
    if (s->n == MOST_WAITING) {
        pal_hub_complain(hub, c, "busy", "%s: %d commands wait already", v->name, MOST_WAITING);
        return true;
    }
    s->list[s->n++] = (waiting){c->room, c->id, pal_clock_ns(), *order};
    if (!pal_workshop_busy(s->workshop)) begin_next(hub, s);
    return true;
}

void pal_hub_sculpt_end(pal_hub *hub)
{
    pal_hub_sculpt *s = hub->sculpt;
    if (!s) return;
    pal_workshop_close(s->workshop);
    for (int r = 0; r < hub->n_room; r++) {
        pal_hub_room *room = &hub->room[r];
        if (room->own) {
            pal_stream_close(room->stream);
            pal_session_close(room->session);
            room->stream = NULL, room->session = NULL;
        }
        for (int b = 0; b < PAL_BODY_MAX; b++) {
            pal_sculptor_destroy(s->place[r][b].sculptor);
            pal_sculpt_free(s->place[r][b].turn);
        }
    }
    free(s->place);
    free(s->hand);
    free(s);
    hub->sculpt = NULL;
}
