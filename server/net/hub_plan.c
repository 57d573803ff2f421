/* What clients are told of a plan: its rows, whose they are, which of them are switched off; and of its bodies: who
 * stands still and why, who sleeps. Rows are switched and single bodies reset by orders (protocol/README.md, "Rows,
 * rescues, sleep"). */
#include "server/net/hub_parts.h"

#include "server/net/plain_text.h"

#include <string.h>

static int body_of(const pal_session *session, const char *name)
{
    const pal_scene *scene = pal_session_scene(session);
    for (int b = 0; b < scene->n_body; b++)
        if (!strcmp(scene->body[b].name, name)) return b;
    return -1;
}

/* rows of the plan as the session was opened, as hello and topology name them */
static uint32_t plan_rows(const pal_session *session, char (*name)[PAL_WIRE_NAME_BYTES], double *part)
{
    int n = pal_session_rows(session);
    uint32_t n_row = 0;
    for (int r = 0; r < n && r < PAL_WIRE_ROW_MAX; r++, n_row++) {
        pal_row_info row;
        pal_session_row(session, r, &row);
        pal_plain_text(name[r], PAL_WIRE_NAME_BYTES, row.name);
        part[r] = body_of(session, row.body);
    }
    return n_row;
}

void pal_hub_hello_rows(const pal_hub_room *room, pal_wire_hello *out)
{
    out->n_row = out->n_row_part = plan_rows(room->session, out->row, out->row_part);
}

void pal_hub_topology_rows(const pal_hub_room *room, pal_wire_topology *out)
{
    out->n_row = out->n_row_part = plan_rows(room->session, out->row, out->row_part);
}

/* rows of the opened plan that are not in the running one have been switched off; others (fields, brushes) have come.
 * Both lists keep the plan's order */
static void tell_rows(const pal_hub_room *room, const pal_frame *f, pal_wire_status *w)
{
    int n = pal_session_rows(room->session), n_found = 0;
    bool same = n == f->n_row && !room->own;
    for (int r = 0, at = 0; r < n; r++) {
        pal_row_info row;
        int i = at;
        pal_session_row(room->session, r, &row);
        int body = body_of(room->session, row.body);
        while (i < f->n_row && (strcmp(f->row_name[i], row.name) || f->row_body[i] != body)) i++;
        if (i < f->n_row) {
            at = i + 1, n_found++;
        } else if (w->n_off < PAL_WIRE_ROW_MAX) {
            pal_plain_text(w->off[w->n_off].row, PAL_WIRE_NAME_BYTES, row.name);
            w->off[w->n_off++].part = body < 0 ? 0 : (uint32_t)body;
        }
    }
    /* as they are now, when that is not the plan of hello, or when hello spoke of a session that has been replaced */
    if (same && n_found == n) return;
    for (int r = 0; r < f->n_row; r++) {
        pal_plain_text(w->row[w->n_row_name++], PAL_WIRE_NAME_BYTES, f->row_name[r]);
        w->row_part[w->n_row_part++] = f->row_body[r];
    }
}

void pal_hub_status_plan(const pal_hub_room *room, const pal_frame *f, pal_wire_status *w)
{
    tell_rows(room, f, w);
    for (int p = 0; p < f->n_part && p < PAL_WIRE_PART_MAX; p++) {
        const pal_frame_part *part = &f->part[p];
        pal_wire_part_state *to = &w->state[w->n_state];
        *to = (pal_wire_part_state){.part = (uint32_t)p,
                                    .frozen = part->frozen,
                                    .n_rescue = part->n_rescue,
                                    .rescue_ms = (double)part->rescue_ns * 1e-6};
        if (part->frozen) pal_plain_text(to->why, sizeof to->why, part->why);
        w->frozen |= part->frozen;
        w->n_state += part->frozen || part->n_rescue > 0;
    }
}

/* the order's body; -1: complained */
static int body_named(pal_hub *hub, pal_client *c, const char *name)
{
    int body = body_of(c->room->session, name);
    if (body < 0) pal_hub_complain(hub, c, "target", "there is no body %s", name);
    return body;
}

static void give(pal_hub *hub, pal_client *c, const char *verb, const pal_command *command)
{
    pal_err err = pal_session_command(c->room->session, command);
    if (err) pal_hub_complain(hub, c, err == PAL_ERR_FULL ? "busy" : "refused", "%s: %s", verb, pal_err_text(err));
}

/* a body that stands still does so for everybody, so whoever sees it may bring it back */
static void reset_body(pal_hub *hub, pal_client *c, const pal_wire_order *order)
{
    int body = body_named(hub, c, order->target);
    const pal_frame *f = c->room->stream->frame;
    if (body < 0) return;
    if (!pal_members_may_command(&c->room->members, c->id) && !(f && body < f->n_part && f->part[body].frozen))
        pal_hub_complain(hub, c, "role", "a viewer resets nothing but a body that was stopped");
    else
        give(hub, c, "reset", &(pal_command){.kind = PAL_COMMAND_RESET_BODY, .body = body});
}

bool pal_hub_plan_order(pal_hub *hub, pal_client *c, const pal_wire_order *order)
{
    if (!strcmp(order->verb, "reset") && order->target[0]) {
        reset_body(hub, c, order);
        return true;
    }
    return false;
}
