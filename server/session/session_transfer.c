/* Transfer of one session to another that replaces it (session.h). */
#include "server/session/session_core.h"

#include <stdio.h>
#include <string.h>

static uint64_t later(uint64_t ns, uint64_t by_ns, uint64_t max_ns)
{
    return ns + by_ns < max_ns ? ns + by_ns : max_ns;
}

/* transfers tool poses, including poses not yet taken; the away_ns during which no thread ran count for no lease */
static void transfer_tools(pal_session *to, pal_session *from, uint64_t now_ns)
{
    uint64_t away_ns = now_ns - to->transferred_ns;
    for (int t = 0; t < to->scene->n_tool && t < from->scene->n_tool; t++) {
        session_tool *a = &to->tool[t], *b = &from->tool[t];
        a->requested = b->requested, a->taken = b->taken;
        for (int k = 0; k < PAL_EDGE_SLOTS; k++)
            a->requested.pose[k].arrived_ns = later(b->requested.pose[k].arrived_ns, away_ns, now_ns);
        *(requested_poses *)pal_triple_buffer_slot(&a->triple_buffer) = a->requested;
        pal_triple_buffer_publish(&a->triple_buffer);
        b->arrived_ns = later(b->arrived_ns, away_ns, now_ns);
        a->pose = b->pose, a->arrived_ns = b->arrived_ns, a->present = b->present;
    }
}

/* lists a component of `from`, unless it is enabled there or listed already */
static void list_disabled(pal_session *to, const pal_session *from, const char *body, const char *component)
{
    disabled_components *off = &to->off;
    int b = pal_scene_find_body(from->scene, body);
    if (b >= 0 && pal_world_find_component(from->world, b, component) >= 0) return;
    for (int i = 0; i < off->n; i++)
        if (!strcmp(off->at[i].body, body) && !strcmp(off->at[i].component, component)) return;
    if (off->n == DISABLED_MAX) return;
    snprintf(off->at[off->n].body, PAL_NAME, "%s", body);
    snprintf(off->at[off->n++].component, PAL_NAME, "%s", component);
}

/* disables what is disabled in `from`: listed there, or in its plan at open and no longer in its world */
static void transfer_disabled(pal_session *to, const pal_session *from)
{
    for (int i = 0; i < from->off.n; i++) list_disabled(to, from, from->off.at[i].body, from->off.at[i].component);
    /* components of services belong to no body and cannot be disabled */
    for (int k = 0; k < from->outline.n_component; k++)
        if (pal_scene_find_body(to->scene, from->outline.component[k].body) >= 0)
            list_disabled(to, from, from->outline.component[k].body, from->outline.component[k].name);
    for (int i = 0; i < to->off.n; i++) {
        int b = pal_scene_find_body(to->scene, to->off.at[i].body);
        if (b >= 0) (void)pal_world_switch_component(to->world, to->scene, b, to->off.at[i].component, false, NULL);
    }
}

/* transfers the state of the simulation thread, before the world's state */
static void transfer_state(pal_session *to, pal_session *from)
{
    to->paused = from->paused, to->single = from->single;
    to->n_late = from->n_late, to->work_ns = from->work_ns, to->speed = from->speed;
    memcpy(to->n_subscriber, from->n_subscriber, sizeof to->n_subscriber);
    if (!to->options.resume) {
        to->step = from->step;
        transfer_disabled(to, from);
        memcpy(to->material, from->material, sizeof to->material); /* neither thread runs */
    }
    for (int b = 0; b < to->scene->n_body; b++)
        for (int k = 0; k < PAL_FIELD_COUNT; k++)
            if (to->n_subscriber[b][k] > 0) (void)pal_world_field(to->world, b, (pal_field)k, true, NULL);
}

/* transfers what other threads may have changed, and pending commands */
static void transfer_commands(pal_session *to, pal_session *from)
{
    atomic_store(&to->n_refused, atomic_load(&from->n_refused));
    atomic_store(&to->n_observer, atomic_load(&from->n_observer));
    pal_estimator_set_transfer(&to->estimators, &from->estimators);
    pal_command command;
    for (int k = 0; k < N_COMMAND && pal_command_queue_get(from->command, &command); k++)
        (void)pal_command_queue_put(to->command, &command);
}

static void measure_pause(pal_session *next, uint64_t since_ns)
{
    uint64_t ns = session_now_ns(next) - since_ns;
    if (ns > next->pause_ns) next->pause_ns = ns;
}

/* puts a change on the record of a session that stands still */
static void record_change(pal_session *next, const pal_session *before, pal_input_kind kind,
                          const pal_session_change *c)
{
    if (!before->log || !c) return;
    pal_input_record record = {.kind = kind, .index = c->body, .step = before->step};
    if (kind == PAL_INPUT_SCULPT) record.sculpt = *c->edit;
    if (kind == PAL_INPUT_PREPARE) record.configuration = *c->configuration, next->prepared = true;
    if (kind == PAL_INPUT_SCULPT || kind == PAL_INPUT_PREPARE)
        memcpy(record.materials, c->material, sizeof *record.materials * (size_t)before->scene->n_body);
    pal_input_log_put(before->log, &record);
}

void pal_session_rehearse(pal_session *next, pal_session *before, const pal_session_change *change,
                          pal_session_snapshot_fn *snapshot, pal_session_rehearse_fn *rehearse, void *user)
{
    for (int k = 0; k < PAL_SESSION_REHEARSALS_MAX; k++) {
        pal_session_stop(before);
        uint64_t stopped_ns = session_now_ns(next);
        bool wanted = snapshot(user, before->world);
        if (k == 0) record_change(next, before, PAL_INPUT_PREPARE, change);
        if (wanted) record_change(next, before, PAL_INPUT_REHEARSE, change);
        atomic_store_explicit(&before->stop, false, memory_order_release);
        pal_err err = pal_session_start(before, NULL);
        measure_pause(next, stopped_ns);
        /* if the thread did not start, the session stays stopped until the transfer, which reports it */
        if (err || !wanted) return;
        rehearse(user, next->world);
        next->n_rehearsed++;
    }
}

void pal_session_transfer_begin(pal_session *next, pal_session *before, const pal_session_change *change,
                                pal_session_transfer_fn *transfer, void *user)
{
    next->transferred_ns = session_now_ns(next);
    atomic_store_explicit(&before->replaced, true, memory_order_relaxed);
    pal_session_stop(before);
    next->stopped_ns = session_now_ns(next);
    next->recorded = change != NULL;
    if (change && change->configuration && !next->prepared) record_change(next, before, PAL_INPUT_PREPARE, change);
    record_change(next, before, change && change->edit ? PAL_INPUT_SCULPT : PAL_INPUT_SWITCH, change);
    transfer_state(next, before);
    if (transfer) transfer(user, next->world, before->world);
}

pal_err pal_session_transfer_end(pal_session *next, pal_session *before, pal_diagnostic *diag)
{
    transfer_commands(next, before);
    if (!next->options.resume) transfer_tools(next, before, session_now_ns(next));
    if (next->recorded) next->log = before->log, before->log = NULL;
    pal_err err = pal_session_start(next, diag);
    measure_pause(next, next->stopped_ns);
    if (!err) return PAL_ERR_OK;
    if (next->recorded) before->log = next->log, next->log = NULL;
    atomic_store_explicit(&before->stop, false, memory_order_release);
    atomic_store_explicit(&before->replaced, false, memory_order_relaxed);
    (void)pal_session_start(before, NULL);
    return err;
}

double pal_session_pause_s(const pal_session *session, int *n_rehearsed)
{
    *n_rehearsed = session->n_rehearsed;
    return (double)session->pause_ns / SECOND_NS;
}
