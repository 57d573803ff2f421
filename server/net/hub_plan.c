/* Messages about the plan: its components, their bodies, which are disabled; and about bodies: frozen with the reason,
 * or asleep. Commands disable components and reset single bodies (protocol/README.md, "Components and bodies"). */
#include "server/net/hub_plan.h"

#include "server/net/hub_news.h"
#include "server/net/hub_peers.h"
#include "server/net/transport/plain_text.h"
#include "server/net/tuning.h"

#include <stdio.h>
#include <string.h>

void pal_hub_put_plan(const pal_hub_room *room, pal_wire_plan *out)
{
    const pal_session_outline *outline = pal_session_view_outline(room->session);
    for (int r = 0; r < outline->n_component && r < PAL_WIRE_COMPONENT_MAX; r++) {
        const pal_component_info *component = &outline->component[r];
        pal_plain_text(out->component[r], PAL_WIRE_NAME_BYTES, component->name);
        pal_plain_text(out->reason[r], PAL_WIRE_REASON_BYTES, component->reason);
        out->part[r] = pal_scene_find_body(pal_session_scene(room->session), component->body);
        out->required[r] = component->fixed || out->part[r] < 0;
        out->n_component = out->n_part = out->n_reason = out->n_required = (uint32_t)r + 1;
    }
}

/* Components of the opened plan that the running plan lacks are disabled; the running plan may have others (fields,
 * brushes). Both lists have the order of the plan. */
static void report_components(const pal_hub_room *room, const pal_frame *f, pal_wire_status *w)
{
    const pal_session_outline *outline = pal_session_view_outline(room->session);
    int n = outline->n_component, n_found = 0;
    bool same = n == f->n_row && !room->own;
    for (int r = 0, at = 0; r < n; r++) {
        const pal_component_info *component = &outline->component[r];
        int i = at, body = pal_scene_find_body(pal_session_scene(room->session), component->body);
        while (i < f->n_row && (strcmp(f->component_name[i], component->name) || f->component_body[i] != body)) i++;
        if (i < f->n_row) {
            at = i + 1, n_found++;
        } else if (w->n_disabled < PAL_WIRE_COMPONENT_MAX) {
            pal_plain_text(w->disabled[w->n_disabled].component, PAL_WIRE_NAME_BYTES, component->name);
            w->disabled[w->n_disabled++].part = body < 0 ? 0 : (uint32_t)body;
        }
    }
    /* current list, when it differs from the plan in hello, or when hello described a session since replaced */
    if (same && n_found == n) return;
    for (int r = 0; r < f->n_row; r++) {
        pal_plain_text(w->component[w->n_component_name++], PAL_WIRE_NAME_BYTES, f->component_name[r]);
        w->component_part[w->n_component_part++] = f->component_body[r];
    }
}

void pal_hub_status_plan(const pal_hub_room *room, const pal_frame *f, pal_wire_status *w)
{
    report_components(room, f, w);
    for (int p = 0; p < f->n_part && p < PAL_WIRE_PART_MAX; p++) {
        const pal_frame_part *part = &f->part[p];
        pal_wire_part_state *to = &w->state[w->n_state];
        *to = (pal_wire_part_state){.part = (uint32_t)p,
                                    .frozen = part->frozen,
                                    .asleep = part->asleep,
                                    .n_safeguard = pal_safeguards_sum(&part->safeguards),
                                    .safeguard_ms = (double)part->safeguards.ns * 1e-6};
        if (part->frozen) pal_plain_text(to->reason, sizeof to->reason, part->reason);
        w->frozen |= part->frozen;
        w->n_state += part->frozen || part->asleep || pal_safeguards_sum(&part->safeguards) > 0;
    }
    w->n_unobserved = room->n_unobserved;
}

/* counts the steps since the last call without output, if there was no observer since */
void pal_hub_count_unobserved(pal_hub_room *room)
{
    const pal_frame *f = room->stream->frame;
    uint64_t n_output = 0;
    if (!f) return;
    for (int p = 0; p < f->n_part; p++)
        if (f->part[p].n_output > n_output) n_output = f->part[p].n_output;
    uint64_t n_step = f->tick > room->seen_tick ? f->tick - room->seen_tick : 0;
    uint64_t n_shown = n_output > room->seen_output ? n_output - room->seen_output : 0;
    if (room->was_unobserved && n_step > n_shown) room->n_unobserved += n_step - n_shown;
    room->seen_tick = f->tick, room->seen_output = n_output;
    room->was_unobserved = room->members.n_member + room->n_viewer == 0;
}

void pal_hub_await_answer(pal_client *c, const char *verb)
{
    const pal_frame *f = c->room->stream->frame;
    /* the world answers between two steps, with a count of refusals and the last diagnostic */
    c->answer_until_ns = pal_loop_now_ns(c->hub->loop) + PAL_ANSWER_NS;
    c->answer_refused = f ? f->n_refused : 0;
    snprintf(c->answer_verb, sizeof c->answer_verb, "%s", verb);
}

void pal_hub_world_answer(pal_client *c)
{
    const pal_frame *f = c->room->stream->frame;
    pal_diagnostic diag = {""};
    if (!c->answer_until_ns || !f) return;
    bool refused = f->n_refused > c->answer_refused;
    if (refused) pal_session_last_diagnostic(c->room->session, &diag);
    if (diag.text[0]) pal_hub_refuse(c, "refused", "%s: %s", c->answer_verb, diag.text);
    if (refused || pal_loop_now_ns(c->hub->loop) > c->answer_until_ns) c->answer_until_ns = 0;
}

bool pal_hub_run_component(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    double part = pal_hub_arg(command, "part", -1);
    pal_command order = {.kind = PAL_COMMAND_COMPONENT,
                         .wanted = pal_hub_arg(command, "enabled", 0) != 0,
                         .in_time = !pal_hub_is_instructor(c)};
    if (!(part >= 0 && part < c->room->stream->n_part))
        return pal_hub_refuse(c, "args", "component: part %g, wanted 0 to %d", part, c->room->stream->n_part - 1);
    if (strlen(command->target) >= sizeof order.component)
        return pal_hub_refuse(c, "target", "there is no component %s", command->target);
    order.body = (int)part;
    strcpy(order.component, command->target);
    if (!pal_hub_session_command(c, verb->name, &order)) return false;
    pal_hub_await_answer(c, verb->name);
    order.wanted = !order.wanted, order.in_time = false;
    pal_hub_undo_by_command(c, verb->name, &order);
    return true;
}
