/* Verbs for sculpting (protocol/README.md, "Sculpting"): edits go through hub_jobs.c, brushes and probes act at
 * once. */
#include "server/net/hub_switch.h"
#include "server/net/hub_verb.h"

#include "server/base/vec3.h"
#include "server/net/hub_jobs.h"
#include "server/net/hub_peers.h"
#include "server/net/tuning.h"
#include "server/sim/world/pick.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* the named body, or the first that can be sculpted; -1: an error was sent */
static int find_body(pal_client *c, const pal_wire_command *command)
{
    const pal_stream *s = c->room->stream;
    for (int b = 0; b < s->n_part; b++) {
        bool named =
            !command->target[0] ? s->part[b].info.is_sculptable : !strcmp(s->part[b].info.name, command->target);
        if (named && s->part[b].info.is_sculptable) return b;
        if (named) break;
    }
    if (command->target[0])
        pal_hub_refuse(c, "target", "%s cannot be sculpted", command->target);
    else
        pal_hub_refuse(c, "target", "nothing here can be sculpted");
    return -1;
}

/* origin of a body's frame in the scene's frame */
static void body_origin(const pal_scene *scene, int body, double out[3])
{
    pal_sub3(out, scene->body[body].mesh->surface.origin_m, scene->body[0].mesh->surface.origin_m);
}

/* offset of a body's origin along a nonzero direction, m */
static double frame_offset(const pal_hub_room *room, int body, const double direction[3])
{
    double origin[3], length = pal_norm3(direction);
    body_origin(pal_session_scene(room->session), body, origin);
    return length > 0 ? pal_dot3(origin, direction) / length : 0;
}

/* picks the nearest point of the displayed surface, as a control face and a rest position in the body's frame; false:
 * the surface is too far away, an error was sent */
static bool pick(pal_client *c, int body, const pal_wire_command *command, bool second, pal_pick *out)
{
    const double at[3] = {pal_hub_arg(command, second ? "x2_m" : "x_m", 0),
                          pal_hub_arg(command, second ? "y2_m" : "y_m", 0),
                          pal_hub_arg(command, second ? "z2_m" : "z_m", 0)};
    const pal_stream *s = c->room->stream;
    const pal_shown *shown = &pal_session_view_outline(c->room->session)->part[body];
    double origin[3], reach_m = PAL_PICK_REACH * pal_dist3(s->box_min_m, s->box_max_m);
    bool moved = s->frame && s->frame->part[body].n_vertex == shown->n_vertex;
    bool found = shown->face && pal_pick_nearest(shown, moved ? s->frame->part[body].position_m : NULL, at, out) &&
                 out->distance_m <= reach_m;
    if (!found)
        return pal_hub_refuse(c, "refused", "%s: nothing of %s is at %g %g %g m", command->verb,
                              s->part[body].info.name, at[0], at[1], at[2]);
    body_origin(pal_session_scene(c->room->session), body, origin);
    pal_axpy3(out->rest_m, -1, origin);
    return true;
}

/* current control points, for `set_rest_shape`; NULL: out of memory or no frame yet */
static double *points_now(const pal_hub_room *room, int body, int *n)
{
    const pal_frame *frame = room->stream->frame;
    *n = frame ? frame->part[body].n_point : 0;
    double *out = *n > 0 ? malloc(3 * sizeof *out * (size_t)*n) : NULL;
    if (out) memcpy(out, frame->part[body].point_m, 3 * sizeof *out * (size_t)*n);
    return out;
}

/* builds a cell edit from the picked points; false: an error was sent */
static bool read_cells(pal_client *c, int kind, const pal_wire_command *command, pal_job *job)
{
    pal_pick a, b = {.face = -1};
    if (!pick(c, job->body, command, false, &a)) return false;
    bool two = kind == PAL_CELLS_MERGE || kind == PAL_CELLS_BRIDGE;
    if (two && !pick(c, job->body, command, true, &b)) return false;
    double entity = pal_hub_arg(command, "entity", 0);
    if (entity != 0 && entity != 1 && entity != 2)
        return pal_hub_refuse(c, "args", "sharpen: entity is %g, wanted 0 (vertex), 1 (edge) or 2 (face)", entity);
    if (entity == 1) kind = PAL_CELLS_SHARPEN_EDGE;
    if (entity == 2) kind = PAL_CELLS_SHARPEN_FACE;
    job->command.kind = PAL_SCULPT_CELLS;
    job->command.cells = (pal_cells_command){.kind = (pal_cells_command_kind)kind,
                                             .other_face = b.face,
                                             .distance_m = pal_hub_arg(command, "distance_m", 0),
                                             .scale = pal_hub_arg(command, "scale", 1),
                                             .sharp = (float)pal_hub_arg(command, "sharpness", 0)};
    pal_sculpt_find(pal_sculptor_cells(job->sculptor), a.face, a.rest_m, &job->command.cells);
    return true;
}

static bool read_paint(pal_client *c, const pal_wire_command *command, pal_job *job)
{
    pal_pick at;
    if (!pick(c, job->body, command, false, &at)) return false;
    job->command.kind = PAL_SCULPT_PAINT;
    job->command.stroke = (pal_stroke){.radius_m = pal_hub_arg(command, "radius_m", 0),
                                       .softness = pal_hub_arg(command, "softness", PAL_BRUSH_SOFTNESS),
                                       .young_factor = pal_hub_arg(command, "young_factor", 1),
                                       .density_factor = pal_hub_arg(command, "density_factor", 1)};
    pal_copy3(job->command.stroke.at_m, at.rest_m);
    return true;
}

static bool read_edit(pal_client *c, const pal_wire_command *command, pal_job *job)
{
    const pal_verb *verb = c->hub->verb;
    pal_sculpt *to = &job->command;
    while (strcmp(verb->name, command->verb)) verb++;
    job->body = find_body(c, command);
    if (job->body < 0) return false;
    pal_hub_body_edits *at = &c->room->edits[job->body];
    if (!at->sculptor && pal_sculptor_create(pal_session_scene(c->room->session), job->body, &job->diag, &at->sculptor))
        return pal_hub_refuse(c, "refused", "%s: %s", command->verb, job->diag.text);
    job->sculptor = at->sculptor;
    switch (verb->detail) {
    case PAL_EDIT_UNDO:
        to->kind = PAL_SCULPT_UNDO;
        return true;
    case PAL_EDIT_REDO:
        to->kind = PAL_SCULPT_REDO;
        return true;
    case PAL_EDIT_CUT:
    case PAL_EDIT_UNCUT:
        to->kind = PAL_SCULPT_CUT;
        to->cut = verb->detail == PAL_EDIT_CUT;
        pal_set3(to->cut_normal, pal_hub_arg(command, "nx", 0), pal_hub_arg(command, "ny", 0),
                 pal_hub_arg(command, "nz", 0));
        to->cut_m = pal_hub_arg(command, "offset_m", 0) - frame_offset(c->room, job->body, to->cut_normal);
        return true;
    case PAL_EDIT_SET_REST:
        to->kind = PAL_SCULPT_SET_REST;
        to->point_m = job->point_m = points_now(c->room, job->body, &to->n_point);
        return true;
    case PAL_EDIT_PAINT:
        return read_paint(c, command, job);
    default:
        return read_cells(c, verb->detail, command, job);
    }
}

static pal_err prepare_edit(pal_job *job, const pal_scene **scene)
{
    PAL_TRY(pal_sculptor_prepare(job->sculptor, job->scene, &job->command, &job->diag, &job->made.edit));
    *scene = pal_sculpt_edit_scene(job->made.edit);
    return PAL_ERR_OK;
}

static void transfer_edit(pal_job *job)
{
    pal_material material[PAL_BODY_MAX];
    for (int b = 0; b < job->scene->n_body; b++) material[b] = job->scene->body[b].material;
    const pal_session_change change = {.body = job->body, .edit = &job->command, .material = material};
    pal_session_transfer_begin(job->made.session, job->session, &change, pal_sculpt_transfer, job->made.edit);
}

static void commit_edit(pal_hub_body_edits *at, pal_job *job, pal_job_products *retired)
{
    pal_sculptor_commit(at->sculptor, job->made.edit);
    retired->edit = at->edit, retired->change = at->change;
    at->edit = job->made.edit, at->change = NULL;
    free(at->base);
    at->base = NULL;
    job->made.edit = NULL;
}

/* the control face, its cell, and its edge and vertex that were picked */
static void answer_picked(pal_wire_answer *a, const pal_cells_command *at)
{
    pal_hub_answer_arg(a, "face", at->face);
    pal_hub_answer_arg(a, "cell", at->cell);
    pal_hub_answer_arg(a, "edge", at->edge);
    pal_hub_answer_arg(a, "vertex", at->vertex);
}

static void answer_edit(pal_client *c, const pal_job *job)
{
    pal_wire_answer *a = pal_hub_answer_begin(c, job->verb);
    double prepare_ms = 1e-6 * (double)(job->made_ns - job->asked_ns);
    int n_cell = pal_sculptor_cells(job->sculptor)->n_cell;
    snprintf(a->text, sizeof a->text, "%s: %d control cells, prepared in %.0f ms", job->verb, n_cell, prepare_ms);
    pal_hub_answer_arg(a, "cells", n_cell);
    pal_hub_answer_arg(a, "can_undo", pal_sculptor_undo_count(job->sculptor));
    pal_hub_answer_arg(a, "can_redo", pal_sculptor_redo_count(job->sculptor));
    pal_hub_answer_arg(a, "prepare_ms", prepare_ms);
    if (job->command.kind == PAL_SCULPT_CELLS) answer_picked(a, &job->command.cells);
    pal_hub_send(c);
}

static const pal_job_type edit_job = {.read = read_edit,
                                      .prepare = prepare_edit,
                                      .transfer = transfer_edit,
                                      .commit = commit_edit,
                                      .answer = answer_edit};

bool pal_hub_undo_edit(pal_hub_room *room, int body, bool redo)
{
    pal_wire_command command = {.n_arg = 0};
    strcpy(command.verb, redo ? "redo" : "undo");
    snprintf(command.target, sizeof command.target, "%s", pal_session_scene(room->session)->body[body].name);
    return pal_hub_jobs_enqueue_own(room, &edit_job, &command, NULL, 0);
}

bool pal_hub_run_edit(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    (void)verb;
    return find_body(c, command) >= 0 && pal_hub_jobs_enqueue(c, &edit_job, command);
}

bool pal_hub_run_probe(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    int body = find_body(c, command);
    pal_cells_command picked;
    pal_material m;
    pal_pick at;
    if (body < 0 || !pick(c, body, command, false, &at)) return false;
    pal_body_def *def = malloc(sizeof *def);
    if (!def) return pal_hub_refuse(c, "refused", "%s: %s", verb->name, pal_err_text(PAL_ERR_MEMORY));
    *def = pal_session_scene(c->room->session)->body[body];
    pal_session_material(c->room->session, body, &def->material);
    pal_material_painted(def, at.rest_m, &m);
    pal_sculpt_find(def->cells, at.face, at.rest_m, &picked);
    free(def);
    pal_wire_answer *to = pal_hub_answer_begin(c, verb->name);
    snprintf(to->text, sizeof to->text, "probe: E %.4g Pa, density %.4g kg/m3", m.young_Pa, m.density_kg_m3);
    pal_hub_answer_arg(to, "young_Pa", m.young_Pa);
    pal_hub_answer_arg(to, "poisson", m.poisson);
    pal_hub_answer_arg(to, "density_kg_m3", m.density_kg_m3);
    answer_picked(to, &picked);
    pal_hub_send(c);
    return true;
}

/* Sets the rest positions of a brush. A repeat of the tool's last request keeps its positions, however far the surface
 * has moved since. false: an error was sent */
static bool place_brush(pal_client *c, int body, const pal_wire_command *command, pal_hub_tool_brush *h, pal_brush *to)
{
    static const char *const key[6] = {"x_m", "y_m", "z_m", "x2_m", "y2_m", "z2_m"};
    bool same = h->brush.kind == to->kind && h->member == c->id && h->body == body;
    double asked_m[6];
    pal_pick a, b = {.face = -1};
    for (int k = 0; k < 6; k++) {
        asked_m[k] = pal_hub_arg(command, key[k], 0);
        same = same && asked_m[k] == h->asked_m[k];
    }
    if (same) {
        pal_copy3(to->at_m, h->brush.at_m), pal_copy3(to->to_m, h->brush.to_m);
    } else {
        if (!pick(c, body, command, false, &a)) return false;
        if (to->kind == PAL_BRUSH_CURVE && !pick(c, body, command, true, &b)) return false;
        pal_copy3(to->at_m, a.rest_m);
        if (b.face >= 0) pal_copy3(to->to_m, b.rest_m);
    }
    h->member = c->id, h->body = body;
    memcpy(h->asked_m, asked_m, sizeof asked_m);
    return true;
}

bool pal_hub_run_brush(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    int body = find_body(c, command), tool = c->member->tool;
    if (body < 0) return false;
    if (tool < 0) return pal_hub_refuse(c, "tool", "%s: take a tool first", verb->name);
    pal_hub_tool_brush *h = &c->room->brush[tool], next = *h;
    pal_diagnostic diag = {""};
    pal_command order = {.kind = PAL_COMMAND_BRUSH, .body = body, .slot = tool};
    pal_brush *b = &order.brush;
    b->kind = (pal_brush_kind)verb->detail;
    b->radius_m = pal_hub_arg(command, "radius_m", 0);
    b->softness = pal_hub_arg(command, "softness", PAL_BRUSH_SOFTNESS);
    b->pressure_Pa = pal_hub_arg(command, "pressure_Pa", 0);
    b->stiffness_N_m = pal_hub_arg(command, "stiffness_N_m", 0);
    pal_set3(b->lift_m, pal_hub_arg(command, "dx_m", 0), pal_hub_arg(command, "dy_m", 0),
             pal_hub_arg(command, "dz_m", 0));
    if (b->kind != PAL_BRUSH_NONE && !place_brush(c, body, command, &next, b)) return false;
    /* a tool has one brush, on one body */
    pal_command before = {.kind = PAL_COMMAND_BRUSH, .body = h->body, .slot = tool};
    if (h->brush.kind != PAL_BRUSH_NONE && h->body != body) (void)pal_session_command(c->room->session, &before);
    pal_err err = b->kind == PAL_BRUSH_NONE ? PAL_ERR_OK : pal_brush_check(b, &diag);
    if (!err) err = pal_session_command(c->room->session, &order);
    if (err) return pal_hub_refuse(c, "refused", "%s: %s", verb->name, diag.text[0] ? diag.text : pal_err_text(err));
    *h = next;
    h->brush = *b;
    pal_wire_answer *a = pal_hub_answer_begin(c, verb->name);
    snprintf(a->text, sizeof a->text, "%s: tool %d", verb->name, tool);
    pal_hub_send(c);
    return true;
}
