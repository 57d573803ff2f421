#include "server/net/hub_watch.h"

#include "server/net/hub_accuracy.h"
#include "server/net/hub_jobs.h"
#include "server/net/hub_switch.h"
#include "server/net/hub_undo.h"
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

/* ---- the last order ---- */

static void take_back(pal_hub_room *room, double slowdown)
{
    const pal_hub_undo undo = room->undo;
    bool done = false;
    room->undo.kind = PAL_UNDO_NONE;
    if (undo.kind == PAL_UNDO_COMMAND) done = pal_session_command(room->session, &undo.command) == PAL_ERR_OK;
    if (undo.kind == PAL_UNDO_SWITCH) done = pal_hub_switch_to(room, undo.body, &undo.configuration, 0);
    if (undo.kind == PAL_UNDO_EDIT) done = pal_hub_undo_edit(room, undo.body);
    pal_hub_notice(room, "undone", "%s by %s %s: the simulation ran %.1f times slower than real time", undo.verb,
                   undo.name, done ? "was taken back" : "could not be taken back", slowdown);
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
        if (!(point->ms > best_ms) || !(point->ms <= PAL_CHEAPER * now_ms)) continue;
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
    const double step_ms = room->stream->step_ms, spare_ms = 1e3 * PAL_SPARE * pal_session_scene(room->session)->step_s;
    const double before = q->n_lowered > 0 ? q->cost[q->n_lowered - 1] : INFINITY;
    char text[PAL_CONFIGURATION_TEXT];
    pal_configuration to;
    double ratio;
    const bool slow = f->slowdown > PAL_SLOW_MIN, busy = pal_hub_jobs_busy(room);
    const bool spare = !slow && q->n_lowered > 0 && step_ms > 0 && step_ms * before < spare_ms;
    if (held_for(slow && !busy, &q->slow_ns, now) > PAL_QUALITY_SLOW_NS && q->n_lowered < PAL_QUALITY_LEVELS) {
        q->slow_ns = 0;
        if (!find_cheaper(room, body, &to, &ratio)) return;
        pal_configuration_of(pal_session_scene(room->session), body, &q->was[q->n_lowered]);
        q->cost[q->n_lowered] = ratio;
        if (pal_hub_switch_to(room, body, &to, 1))
            pal_hub_notice(room, "quality", "%.1f times slower than real time: going on with %s", f->slowdown,
                           pal_configuration_text(&to, text));
    }
    if (held_for(spare && !busy, &q->spare_ns, now) > PAL_QUALITY_SPARE_NS) {
        q->spare_ns = 0;
        to = q->was[q->n_lowered - 1];
        if (pal_hub_switch_to(room, body, &to, -1))
            pal_hub_notice(room, "quality", "there is time to spare: back to %s", pal_configuration_text(&to, text));
    }
}

void pal_hub_watch_pace(pal_hub_room *room)
{
    const pal_frame *f = room->stream->frame;
    const uint64_t now = pal_loop_now_ns(room->hub->loop);
    const pal_hub_undo *undo = &room->undo;
    if (!f || f->paused) {
        room->slow_ns = room->quality.slow_ns = room->quality.spare_ns = 0;
        return;
    }
    const uint64_t slow_ns = held_for(f->slowdown > PAL_SLOW_MAX, &room->slow_ns, now);
    const bool by_order = undo->kind != PAL_UNDO_NONE && undo->at_ns < room->slow_ns + PAL_BLAME_NS &&
                          room->slow_ns < undo->at_ns + PAL_BLAME_NS;
    if (slow_ns > PAL_SLOW_NS && by_order) take_back(room, f->slowdown);
    if (pal_session_scene(room->session)->keep_real_time) keep_real_time(room, f, now);
}
