#include "server/net/hub_watch.h"

#include "server/net/hub_accuracy.h"
#include "server/net/hub_jobs.h"
#include "server/net/hub_news.h"
#include "server/net/hub_rights.h"
#include "server/net/hub_switch.h"
#include "server/net/tuning.h"

#include <math.h>
#include <string.h>

/* the time since a condition holds: *since_ns is 0 while it does not */
static uint64_t held_for(bool holds, uint64_t *since_ns, uint64_t now_ns)
{
    if (!holds) *since_ns = 0;
    if (holds && !*since_ns) *since_ns = now_ns;
    return holds ? now_ns - *since_ns : 0;
}

/* ---- the last orders ---- */

/* is everything as it was before the order? */
static bool is_undone(const pal_hub_room *room, const pal_hub_undo *undo)
{
    const pal_command *to = &undo->command;
    const pal_frame *f = room->stream->frame;
    pal_material m;
    bool enabled = false;
    if (undo->kind != PAL_UNDO_COMMAND) return false;
    pal_session_material(room->session, to->body, &m);
    if (to->kind == PAL_COMMAND_MATERIAL) return !memcmp(&m, &to->material, sizeof m);
    for (int r = 0; f && r < f->n_row; r++)
        enabled |= f->component_body[r] == to->body && !strcmp(f->component_name[r], to->component);
    return enabled == to->wanted;
}

/* Takes back the newest order that was given from since_ns to until_ns, passing over those that have changed nothing,
 * as the session refused them. false: there is none */
static bool take_back(pal_hub_room *room, uint64_t since_ns, uint64_t until_ns, double load)
{
    const double step_ms = 1e3 * pal_session_scene(room->session)->step_s;
    int k = room->n_undo - 1;
    while (k >= 0 && (is_undone(room, &room->undo[k]) || room->undo[k].at_ns >= until_ns)) k--;
    if (k < 0 || room->undo[k].at_ns < since_ns) return false;
    const pal_hub_undo undo = room->undo[k];
    memmove(room->undo + k, room->undo + k + 1, sizeof undo * (size_t)(--room->n_undo - k));
    bool done = false;
    if (undo.kind == PAL_UNDO_COMMAND) done = pal_session_command(room->session, &undo.command) == PAL_ERR_OK;
    if (undo.kind == PAL_UNDO_SWITCH) done = pal_hub_switch_to(room, undo.body, &undo.configuration, 0);
    if (undo.kind == PAL_UNDO_EDIT) done = pal_hub_undo_edit(room, undo.body, !strcmp(undo.verb, "undo"));
    pal_hub_notice(room, "undone", "%s by %s %s: a step took %.3g ms of its %.3g ms", undo.verb, undo.name,
                   done ? "was taken back" : "could not be taken back", load * step_ms, step_ms);
    return true;
}

/* ---- quality ---- */

/* the next cheaper configuration of a body, and the cost of the present one over its; false: there is none */
static bool find_cheaper(const pal_hub_room *room, int body, pal_configuration *to, double *ratio)
{
    pal_configuration now;
    pal_configuration_of(pal_session_scene(room->session), body, &now);
    const double now_ms = pal_hub_study_ms(room, body, &now);
    double best_ms = 0;
    for (int i = 0; i < room->study.n && isfinite(now_ms); i++) {
        const pal_measured_configuration *point = &room->study.configuration[i];
        if (!point->front || !(point->ms > best_ms) || !(point->ms <= PAL_CHEAPER * now_ms)) continue;
        best_ms = point->ms;
        *to = point->configuration;
    }
    *ratio = now_ms / best_ms;
    if (best_ms > 0) return true;
    /* without a study: coarser elements, of which the cost is their number by that of sub-steps */
    *to = now;
    to->size = (int)(PAL_CHEAPER * now.size);
    *ratio = pow((double)now.size / (to->size > 0 ? to->size : 1), 4);
    return to->size >= 1 && to->size < now.size && now.k_distance_J <= 0;
}

static void keep_real_time(pal_hub_room *room, const pal_frame *f, uint64_t now)
{
    pal_hub_quality *q = &room->quality;
    const int body = room->study.configuration ? room->study.body : 0;
    /* under load, also while the body sleeps */
    const double load = fmax(1e-3 * room->stream->step_ms / pal_session_scene(room->session)->step_s,
                             pal_session_predicted_load(room->session));
    const double before = q->n_lowered > 0 ? q->cost[q->n_lowered - 1] : INFINITY;
    /* each fall makes the next rise later, so that quality does not oscillate where others keep the machine busy */
    const uint64_t wait_ns = PAL_QUALITY_SPARE_NS << (q->n_fall < PAL_QUALITY_FALLS ? q->n_fall : PAL_QUALITY_FALLS);
    char text[PAL_CONFIGURATION_TEXT];
    pal_configuration to;
    double ratio;
    const bool slow = f->slowdown > PAL_SLOW_MIN, busy = pal_hub_jobs_busy(room) || q->refused;
    const bool spare = !slow && q->n_lowered > 0 && load * before < PAL_SPARE;
    if (held_for(slow && !busy, &q->slow_ns, now) > PAL_QUALITY_SLOW_NS && q->n_lowered < PAL_QUALITY_LEVELS) {
        q->slow_ns = 0;
        if (!find_cheaper(room, body, &to, &ratio)) return;
        pal_configuration_of(pal_session_scene(room->session), body, &q->was[q->n_lowered]);
        q->cost[q->n_lowered] = ratio;
        if (pal_hub_switch_to(room, body, &to, 1))
            pal_hub_notice(room, "quality", "%.1f times slower than real time: going on with %s", f->slowdown,
                           pal_configuration_text(&to, text));
    }
    if (held_for(spare && !busy, &q->spare_ns, now) > wait_ns) {
        q->spare_ns = 0;
        q->n_fall++;
        to = q->was[q->n_lowered - 1];
        if (pal_hub_switch_to(room, body, &to, -1))
            pal_hub_notice(room, "quality", "there is time to spare: back to %s", pal_configuration_text(&to, text));
    }
}

void pal_hub_watch_pace(pal_hub_room *room)
{
    const pal_frame *f = room->stream->frame;
    const uint64_t now = pal_loop_now_ns(room->hub->loop);
    if (!f || f->paused || pal_hub_playing(room, NULL)) {
        room->slow_ns = room->quality.slow_ns = room->quality.spare_ns = 0;
        return;
    }
    /* One order after the other, each with the time to show that it was the one. By processor time as well: what else
     * runs on a machine slows the session too, and no order is to blame for it */
    const uint64_t slow_ns = held_for(fmin(f->slowdown, f->load) > PAL_SLOW_MAX, &room->slow_ns, now);
    const uint64_t since_ns = room->slow_ns > PAL_BLAME_NS ? room->slow_ns - PAL_BLAME_NS : 0;
    if (slow_ns > PAL_SLOW_NS && now > room->undone_ns + PAL_SLOW_NS && !pal_hub_jobs_own(room) &&
        take_back(room, since_ns, room->slow_ns + PAL_BLAME_NS, f->load))
        room->undone_ns = now;
    if (pal_session_scene(room->session)->keep_real_time) keep_real_time(room, f, now);
}

bool pal_hub_is_alive(const pal_hub *hub)
{
    for (int r = 0; r < hub->n_room; r++)
        if (!pal_session_is_alive(hub->room[r]->session)) return false;
    return true;
}
