/* The simulation thread: takes commands and poses, steps the world, publishes a frame, and sleeps until the
 * next absolute time. It waits for no other thread: poses and frames use triple buffers, commands a queue. The only
 * lock guards the last diagnostic, the materials and the place in a recording, and a rest; an ordinary step does not
 * take it. While nothing moves and nobody looks, the thread rests for several steps, which it takes together
 * afterwards.
 *
 * Slowdown is real time over simulated time since a mark that is 1 to 1 + 1/16 s old, load the processor time of the
 * steps over it. */
#include "server/session/session_core.h"

#include "server/base/log.h"
#include "server/base/thread.h"
#include "server/base/vec3.h"
#include "server/session/resume.h"
#include "server/session/tuning.h"
#include "server/solve/preflight.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- the thread ---- */

void pal_session_put_diagnostic(pal_session *s, const pal_diagnostic *diag)
{
    pthread_mutex_lock(&s->lock);
    s->diag = *diag;
    pthread_mutex_unlock(&s->lock);
}

static void count_refusal(pal_session *s)
{
    atomic_fetch_add_explicit(&s->n_refused, 1, memory_order_relaxed);
}

/* sets a mark every 1/16 s; of the marks older than 1 s, keeps only the newest */
static void mark_pace(pal_session *s, uint64_t now)
{
    const int size = N_MARK + 2;
    if (s->n_marks > 0) {
        const mark *last = &s->marks[(s->first + s->n_marks - 1) % size];
        if (now - last->ns < SECOND_NS / N_MARK) return;
    }
    while (s->n_marks > 1 && now - s->marks[(s->first + 1) % size].ns >= SECOND_NS) {
        s->first = (s->first + 1) % size;
        s->n_marks--;
    }
    if (s->n_marks == size) s->first = (s->first + 1) % size, s->n_marks--;
    s->marks[(s->first + s->n_marks++) % size] = (mark){now, s->step, s->all_work_ns};
}

/* real time and processor time over simulated time; they need at least 0.1 s and one step */
static void measure_pace(const pal_session *s, pal_frame *frame)
{
    const mark *oldest = &s->marks[s->first];
    frame->slowdown = 1, frame->load = 0;
    if (s->paused || s->n_marks == 0 || s->end_ns < oldest->ns + SECOND_NS / 10 || s->step == oldest->step) return;
    const double simulated_ns = (double)(s->step - oldest->step) * (double)s->step_ns;
    frame->slowdown = s->speed * (double)(s->end_ns - oldest->ns) / simulated_ns;
    frame->load = (double)(s->all_work_ns - oldest->work_ns) / simulated_ns;
}

static void publish(pal_session *s)
{
    pal_frame *frame = pal_triple_buffer_slot(&s->frames);
    (void)pal_frame_fit(frame, s->world); /* out of memory: this frame omits the field */
    pal_world_frame(s->world, frame);
    frame->end_ns = s->end_ns;
    frame->step_ns = s->work_ns;
    frame->paused = s->paused;
    frame->plays = s->play != NULL;
    measure_pace(s, frame);
    frame->n_late = s->n_late;
    frame->n_refused = atomic_load_explicit(&s->n_refused, memory_order_relaxed);
    for (int t = 0; t < frame->n_tool; t++) {
        session_tool *tool = &s->tool[t];
        frame->tool[t].pose_ns = tool->arrived_ns;
        /* while paused, tools are displayed at their poses but exert no force */
        if (s->paused && tool->present) {
            frame->tool[t].present = true;
            frame->tool[t].pose = tool->pose;
        }
    }
    pal_triple_buffer_publish(&s->frames);
    if (s->options.wake) s->options.wake(s->options.user);
}

/* Has the tool jumped lately, by more than a hand moves? It counts as lifted then, and is put down where it comes to
 * rest: a tool that tears tissue to and fro costs everybody's time */
static bool is_lifted(const pal_session *s, session_tool *tool, const requested_pose *to)
{
    const double speed_m_s = fmax(PAL_HAND_M_S, s->reach_m / PAL_POSE_REACH / PAL_HAND_SIZE_S),
                 passed_s = 1e-9 * (double)(to->arrived_ns - tool->seen_ns);
    if (tool->seen_ns && pal_dist3(to->pose.position_m, tool->seen_m) > speed_m_s * fmax(passed_s, PAL_HAND_SLACK_S))
        tool->jumped_ns = to->arrived_ns;
    pal_copy3(tool->seen_m, to->pose.position_m);
    tool->seen_ns = to->arrived_ns;
    return tool->jumped_ns && to->arrived_ns - tool->jumped_ns < PAL_LIFT_NS;
}

const requested_pose *pal_session_next_pose(const session_tool *tool)
{
    const int slot = pal_signal_edges_next(&tool->offered->edges, tool->taken);
    return slot < 0 ? NULL : &tool->offered->pose[slot];
}

/* The pose of a tool for this step: the next edge of its grasp, else the newest one. NULL: there is no new one. silent:
 * its lease has expired, whatever edges were before */
static const requested_pose *take_pose(const pal_session *s, session_tool *tool, uint64_t now, bool *silent)
{
    const requested_poses *newer = pal_triple_buffer_take(&tool->triple_buffer);
    if (newer) tool->offered = newer;
    const requested_pose *newest = &tool->offered->pose[PAL_EDGE_NEWEST], *next = pal_session_next_pose(tool);
    const uint64_t heard_ns = next ? newest->arrived_ns : tool->arrived_ns;
    *silent = now > heard_ns && now - heard_ns > s->lease_ns;
    if (next && *silent) next = newest;
    if (next) tool->taken = tool->offered->edges.number[next - tool->offered->pose];
    return next;
}

/* gives every tool's pose to the world and releases tools whose lease has expired; true: one changed */
static bool take_poses(pal_session *s, uint64_t now)
{
    bool changed = false;
    for (int t = 0; t < s->scene->n_tool; t++) {
        session_tool *tool = &s->tool[t];
        bool silent;
        const requested_pose *slot = take_pose(s, tool, now, &silent);
        const bool gone = tool->present && silent;
        pal_input_record record = {.index = t, .step = s->step};
        const bool fresh = slot && slot->present && !silent, lifted = fresh && is_lifted(s, tool, slot);
        if (!fresh && (slot || gone)) tool->seen_ns = 0;
        if (fresh && !lifted) {
            if (pal_world_pose(s->world, t, &slot->pose)) {
                count_refusal(s);
                continue;
            }
            tool->pose = slot->pose;
            tool->arrived_ns = slot->arrived_ns;
            tool->present = true;
            record.kind = PAL_INPUT_POSE;
            record.pose = slot->pose;
        } else if ((tool->present && (slot || gone)) || (tool->brushes && slot && !slot->present)) {
            pal_world_pose(s->world, t, NULL);
            tool->present = tool->brushes = false;
            record.kind = PAL_INPUT_RELEASE;
        } else {
            continue;
        }
        changed = true;
        pal_input_log_put(s->log, &record);
    }
    return changed;
}

/* the first subscriber creates the component, the last removes it; creation that failed is retried by the next
 * subscriber */
static void subscribe(pal_session *s, const pal_command *command)
{
    uint32_t *n = &s->n_subscriber[command->body][command->field];
    pal_diagnostic diag = {""};
    if (!command->wanted && *n == 0) return;
    *n = command->wanted ? *n + 1 : *n - 1;
    if (!command->wanted && *n > 0) return;
    if (!pal_world_field(s->world, command->body, command->field, command->wanted, &diag)) return;
    count_refusal(s);
    pal_session_put_diagnostic(s, &diag);
}

/* true: observation began, so display data must be computed */
static bool update_observed(pal_session *s)
{
    bool observed = !s->options.only_observed || atomic_load_explicit(&s->n_observer, memory_order_relaxed) > 0;
    if (observed == s->observed) return false;
    s->observed = observed;
    pal_world_watch(s->world, observed);
    return observed;
}

/* commands that are input, with their records; 0: others */
static const pal_input_kind record_of[PAL_COMMAND_COUNT] = {[PAL_COMMAND_RESET] = PAL_INPUT_RESET,
                                                            [PAL_COMMAND_RESET_BODY] = PAL_INPUT_RESET_BODY,
                                                            [PAL_COMMAND_MATERIAL] = PAL_INPUT_MATERIAL,
                                                            [PAL_COMMAND_BRUSH] = PAL_INPUT_BRUSH,
                                                            [PAL_COMMAND_COMPONENT] = PAL_INPUT_COMPONENT};

/* Has a material or component made the step longer than the command allows? Then the former one comes back, which is
 * recorded as the input that it is, so that a replay makes the same steps */
static pal_err check_cost(pal_session *s, const pal_command *command, int n_before, pal_input_record *record,
                          pal_diagnostic *diag)
{
    const int n_sub = pal_world_rest_substeps(s->world);
    const double ms = 1e-6 * s->substep_ns * n_sub, step_ms = 1e3 * s->scene->step_s;
    if (!command->in_time || n_sub <= n_before || ms <= step_ms) return PAL_ERR_OK;
    pal_input_log_put(s->log, record);
    record->material = s->material[command->body];
    record->wanted = !record->wanted;
    PAL_TRY(pal_input_apply(s->world, s->scene, record, diag));
    pal_input_log_put(s->log, record);
    return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "a step would take %.3g ms of its %.3g ms, with %d sub-steps", ms,
                              step_ms, n_sub);
}

/* records an accepted input, counts a refused one */
static void apply(pal_session *s, const pal_command *command)
{
    pal_diagnostic diag = {""};
    pal_input_record record = {.kind = record_of[command->kind],
                               .index = command->kind == PAL_COMMAND_RESET ? 0 : command->body,
                               .step = s->step,
                               .material = command->material,
                               .slot = command->slot,
                               .brush = command->brush,
                               .wanted = command->wanted};
    memcpy(record.component, command->component, sizeof record.component);
    const int n_sub = pal_world_rest_substeps(s->world);
    pal_err err = pal_input_apply(s->world, s->scene, &record, &diag);
    if (!err) err = check_cost(s, command, n_sub, &record, &diag);
    if (err)
        count_refusal(s);
    else
        diag.text[0] = 0, pal_input_log_put(s->log, &record);
    for (int t = 0; t < s->scene->n_tool && command->kind == PAL_COMMAND_RESET; t++)
        s->tool[t].present = s->tool[t].brushes = false;
    if (!err && command->kind == PAL_COMMAND_BRUSH)
        s->tool[command->slot].brushes |= command->brush.kind != PAL_BRUSH_NONE;
    pthread_mutex_lock(&s->lock);
    s->diag = diag;
    if (!err && command->kind == PAL_COMMAND_MATERIAL) s->material[command->body] = command->material;
    pthread_mutex_unlock(&s->lock);
}

static void execute(pal_session *s, const pal_command *command)
{
    switch (command->kind) {
    case PAL_COMMAND_PAUSE:
        s->paused = true;
        break;
    case PAL_COMMAND_RESUME:
        s->paused = false, s->single = 0;
        break;
    case PAL_COMMAND_STEP:
        if (s->paused) s->single++;
        break;
    case PAL_COMMAND_SPEED:
        s->speed = command->speed;
        s->first = s->n_marks = 0;
        break;
    case PAL_COMMAND_FIELD:
        subscribe(s, command);
        break;
    case PAL_COMMAND_ESTIMATE:
        pal_estimator_set_request(&s->estimators, command->body, command->wanted);
        break;
    default:
        apply(s, command);
        break;
    }
}

static bool take_commands(pal_session *s)
{
    pal_command command;
    bool any = false, was_paused = s->paused;
    /* bounded, so that a flood of commands cannot delay the step */
    for (int k = 0; k < N_COMMAND && pal_command_queue_get(s->command, &command); k++, any = true) execute(s, &command);
    if (was_paused != s->paused) s->first = s->n_marks = 0; /* the pace is measured again */
    return any;
}

/* reports the bodies that a step froze, with their reasons */
static void report_error(pal_session *s, pal_err err)
{
    pal_diagnostic diag;
    pal_diagnostic_set(&diag, err, "step %llu: %s", (unsigned long long)s->step, pal_err_text(err));
    for (int b = 0; b < pal_world_body_count(s->world); b++) {
        const pal_body *body = pal_world_body(s->world, b);
        size_t used = strlen(diag.text);
        if (body->frozen)
            (void)snprintf(diag.text + used, sizeof diag.text - used, "; %s: %s", body->name, body->reason);
    }
    pal_session_put_diagnostic(s, &diag);
}

static void time_substep(pal_session *s)
{
    for (int b = 0; b < pal_world_body_count(s->world); b++)
        if (pal_world_body(s->world, b)->asleep || pal_world_body(s->world, b)->frozen) return;
    const double ns = (double)s->work_ns / pal_world_substeps(s->world);
    s->substep_ns += s->substep_ns > 0 ? PAL_SUBSTEP_SHARE * (ns - s->substep_ns) : ns;
}

/* positions and velocities, for who goes on after a crash */
static void record_state(pal_session *s, pal_input_kind kind)
{
    s->state_step = s->step + (uint64_t)ceil(PAL_STATE_S / s->scene->step_s);
    s->state_work_ns = 0;
    for (int b = 0; b < pal_world_body_count(s->world); b++) {
        const pal_body *body = pal_world_body(s->world, b);
        pal_input_log_put(
            s->log, &(pal_input_record){
                        .kind = kind, .index = b, .step = s->step, .n_point = body->n_dof, .x = body->x, .v = body->v});
    }
}

/* bytes of the log's ring buffer: room for two states, because one that does not fit would be dropped */
static size_t ring_bytes(const pal_session *s)
{
    size_t n = 0;
    for (int b = 0; b < pal_world_body_count(s->world); b++)
        n += 2 * 6 * sizeof(double) * (size_t)pal_world_body(s->world, b)->n_dof;
    return n > PAL_LOG_RING_BYTES ? n : PAL_LOG_RING_BYTES;
}

static void step(pal_session *s)
{
    if (s->n_marks == 0) mark_pace(s, session_now_ns(s));
    pal_err err = pal_world_step(s->world, s->scene->step_s);
    pal_world_remove_idle(s->world);
    s->work_ns = pal_world_step_ns(s->world);
    s->all_work_ns += s->work_ns;
    time_substep(s);
    s->end_ns = session_now_ns(s);
    s->step++;
    if (s->log && s->step % PAL_INPUT_HASH_STEPS == 0)
        pal_input_log_put(
            s->log, &(pal_input_record){.kind = PAL_INPUT_HASH, .step = s->step, .hash = pal_world_hash(s->world)});
    s->state_work_ns += s->work_ns;
    if (s->log && (s->step >= s->state_step || s->state_work_ns >= PAL_STATE_WORK_NS)) record_state(s, PAL_INPUT_STATE);
    if (err) report_error(s, err);
}

static void estimate(pal_session *s, bool stepped)
{
    pal_diagnostic diag = {""};
    double step_ms = stepped ? 1e-6 * (double)s->work_ns : (double)NAN;
    if (pal_estimator_set_step(&s->estimators, s->world, step_ms, &diag)) pal_session_put_diagnostic(s, &diag);
}

static void *simulate(void *user)
{
    pal_session *s = user;
    uint64_t due = session_now_ns(s);
    s->end_ns = due;
    update_observed(s);
    publish(s);
    for (int n; (n = pal_session_pace(s, &due)) > 0;) {
        /* those of a rest, in which nothing came */
        for (int k = 1; k < n && pal_session_moves(s); k++) step(s);
        atomic_store(&s->called, false);
        bool changed = take_commands(s);
        uint64_t now = session_now_ns(s);
        atomic_store_explicit(&s->beat_ns, now, memory_order_relaxed);
        changed = (s->play ? pal_session_play(s) : take_poses(s, now)) || changed;
        changed = update_observed(s) || changed;
        const bool moves = pal_session_moves(s);
        if (moves) {
            step(s);
            mark_pace(s, s->end_ns);
            s->play_step++;
            if (s->single > 0) s->single--;
            changed = true;
        }
        estimate(s, moves);
        if (changed) publish(s);
    }
    return NULL;
}

/* ---- open and close ---- */

static pal_err copy_plan(pal_session *s)
{
    pal_session_outline *o = &s->outline;
    o->n_component = pal_world_component_count(s->world);
    o->component = calloc((size_t)o->n_component + 1, sizeof *o->component);
    if (!o->component) return PAL_ERR_MEMORY;
    for (int k = 0; k < o->n_component; k++) {
        pal_world_component_info(s->world, k, &o->component[k]);
        o->component[k].spent_ns = o->component[k].n_run = 0;
    }
    o->n_part = pal_world_body_count(s->world);
    for (int b = 0; b < o->n_part; b++) {
        pal_world_shown(s->world, b, &o->part[b]);
        for (int k = 0; k < PAL_FIELD_COUNT; k++) s->gives[b][k] = pal_world_has_field(s->world, b, (pal_field)k);
        s->reach_m = fmax(s->reach_m, PAL_POSE_REACH * pal_world_body(s->world, b)->length_scale_m);
    }
    return PAL_ERR_OK;
}

/* the plan of the scene, of which some components are off: those can be switched on again */
static pal_err copy_whole_plan(pal_session *s)
{
    const int n = s->options.resume ? s->off.n : 0;
    int body[DISABLED_MAX];
    for (int k = 0; k < n; k++) {
        body[k] = pal_scene_find_body(s->scene, s->off.at[k].body);
        if (body[k] >= 0)
            (void)pal_world_switch_component(s->world, s->scene, body[k], s->off.at[k].component, true, NULL);
    }
    PAL_TRY(copy_plan(s));
    for (int k = 0; k < n; k++)
        if (body[k] >= 0)
            (void)pal_world_switch_component(s->world, s->scene, body[k], s->off.at[k].component, false, NULL);
    return PAL_ERR_OK;
}

static void take_resumed(pal_session *s, pal_resume *resume)
{
    const char *body, *component;
    s->world = pal_resume_take_world(resume);
    for (int k = 0; k < pal_resume_disabled(resume, k, &body, &component) && k < DISABLED_MAX; k++) {
        snprintf(s->off.at[k].body, PAL_NAME, "%s", body);
        snprintf(s->off.at[k].component, PAL_NAME, "%s", component);
        s->off.n = k + 1;
    }
    if (!s->options.plays) return;
    s->play = pal_resume_rest(resume, &s->n_play, &s->play_step);
    s->playing = (pal_playing){.state = PAL_PLAYS, .step = s->play_step, .speed = 1};
}

static pal_err prepare(pal_session *s, pal_diagnostic *diag)
{
    if (s->options.resume)
        take_resumed(s, s->options.resume);
    else
        PAL_TRY(pal_world_create(s->scene, diag, &s->world));
    if (!s->options.resume) s->predicted_ms = pal_step_cost_ms(s->scene, s->world);
    if (s->predicted_ms > 0) s->substep_ns = 1e6 * s->predicted_ms / pal_world_rest_substeps(s->world);
    pal_err err = copy_whole_plan(s);
    s->command = pal_command_queue_create(N_COMMAND, sizeof(pal_command));
    bool whole = !err && s->command;
    for (int k = 0; k < 3; k++) whole = (s->frame[k] = pal_frame_create(s->world)) && whole;
    if (!whole) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for the session's frames");
    pal_triple_buffer_init(&s->frames, s->frame[0], s->frame[1], s->frame[2]);
    for (int t = 0; t < PAL_TOOL_MAX; t++) {
        session_tool *tool = &s->tool[t];
        pal_triple_buffer_init(&tool->triple_buffer, &tool->slot[0], &tool->slot[1], &tool->slot[2]);
        tool->offered = &tool->slot[2];
    }
    if (!s->options.record_path) return PAL_ERR_OK;
    const pal_scene *recorded = s->options.resume ? pal_resume_recorded_scene(s->options.resume) : s->scene;
    PAL_TRY(pal_input_log_open(s->options.record_path, recorded, ring_bytes(s), diag, &s->log));
    if (s->options.resume) {
        pal_resume_record(s->options.resume, s->log);
        record_state(s, PAL_INPUT_RESTORE);
    }
    pal_log(PAL_LOG_INFO, "record", "%s: records %s", pal_input_log_path(s->log), s->scene->name);
    return PAL_ERR_OK;
}

pal_err pal_session_start(pal_session *s, pal_diagnostic *diag)
{
    s->running = !pal_thread_start(&s->thread, simulate, s);
    return s->running ? PAL_ERR_OK
                      : pal_diagnostic_set(diag, PAL_ERR_INTERNAL, "the simulation thread cannot be started");
}

void pal_session_stop(pal_session *s)
{
    atomic_store_explicit(&s->stop, true, memory_order_release);
    pal_session_call(s);
    pal_clock_wake(s->options.clock);
    if (s->running) pthread_join(s->thread, NULL);
    s->running = false;
}

static void release(pal_session *s)
{
    for (int k = 0; k < 3; k++) pal_frame_destroy(s->frame[k]);
    pal_command_queue_destroy(s->command);
    pal_world_destroy(s->world);
    pal_estimator_set_close(&s->estimators);
    pthread_mutex_destroy(&s->lock);
    pthread_cond_destroy(&s->call);
    free((void *)(uintptr_t)s->options.record_path);
    free(s->outline.component);
    free(s);
}

pal_err pal_session_open(const pal_scene *scene, const pal_session_options *options, pal_diagnostic *diag,
                         pal_session **out)
{
    pal_session *s = calloc(1, sizeof *s);
    if (!s) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a session");
    pthread_condattr_t monotonic;
    pthread_mutex_init(&s->lock, NULL);
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&s->call, &monotonic);
    pthread_condattr_destroy(&monotonic);
    s->scene = scene;
    s->predicted_ms = NAN;
    if (options) s->options = *options;
    if (!s->options.clock) s->options.clock = &pal_clock_monotonic;
    pal_estimator_set_init(&s->estimators, scene, s->options.clock);
    if (s->options.record_path) s->options.record_path = strdup(s->options.record_path);
    for (int b = 0; b < scene->n_body && b < PAL_BODY_MAX; b++) s->material[b] = scene->body[b].material;
    s->step_ns = (uint64_t)(scene->step_s * SECOND_NS + 0.5);
    s->lease_ns = s->options.lease_s > 0 ? (uint64_t)(s->options.lease_s * SECOND_NS) : PAL_LEASE_NS;
    s->paused = s->options.start_paused;
    s->speed = 1;
    s->observed = true;
    atomic_init(&s->beat_ns, session_now_ns(s));
    pal_err err = prepare(s, diag);
    for (int b = 0; !err && s->options.resume && b < scene->n_body; b++)
        pal_world_current_material(s->world, b, &s->material[b]);
    if (!err && !s->options.hold) err = pal_session_start(s, diag);
    if (err) {
        if (s->log) pal_input_log_close(s->log, 0, 0);
        release(s);
        return err;
    }
    *out = s;
    return PAL_ERR_OK;
}

pal_err pal_session_open_after(const pal_session *before, const pal_scene *scene, pal_diagnostic *diag,
                               pal_session **out)
{
    pal_session_options options = before->options;
    options.hold = true;
    options.resume = NULL;
    options.record_path = NULL;
    return pal_session_open(scene, &options, diag, out);
}

pal_err pal_session_open_at(const pal_session *before, pal_resume *resume, bool plays, const char *record_path,
                            pal_diagnostic *diag, pal_session **out)
{
    pal_session_options options = before->options;
    options.hold = true;
    options.resume = resume;
    options.plays = plays;
    options.record_path = record_path;
    return pal_session_open(pal_resume_scene(resume), &options, diag, out);
}

void pal_session_finish(pal_session *s)
{
    pal_session_stop(s);
    if (!s->log) return;
    pal_input_log_flush(s->log);
    const bool is_new = s->state_work_ns > 0 || s->step >= s->state_step;
    if (is_new && !atomic_load(&s->replaced)) record_state(s, PAL_INPUT_STATE); /* the next session has the state */
    if (pal_input_log_dropped(s->log))
        pal_log(PAL_LOG_WARN, "record", "%s: %llu records did not fit and are missing: the log cannot be replayed",
                pal_input_log_path(s->log), (unsigned long long)pal_input_log_dropped(s->log));
    s->record_error = pal_input_log_error(s->log);
    if (pal_input_log_close(s->log, s->step, pal_world_hash(s->world)) && !s->record_error) s->record_error = EIO;
    s->log = NULL;
}

void pal_session_close(pal_session *s)
{
    if (!s) return;
    pal_session_finish(s);
    release(s);
}

/* ---- functions for any thread ---- */

const pal_scene *pal_session_scene(const pal_session *s)
{
    return s->scene;
}

int pal_session_record_error(const pal_session *s)
{
    return s->log ? pal_input_log_error(s->log) : s->record_error;
}

double pal_session_predicted_load(const pal_session *s)
{
    return 1e-3 * s->predicted_ms / s->scene->step_s;
}

const pal_clock *pal_session_clock(const pal_session *s)
{
    return s->options.clock;
}

const pal_session_outline *pal_session_view_outline(const pal_session *s)
{
    return &s->outline;
}

bool pal_session_has_field(const pal_session *s, int body, pal_field field)
{
    bool there = body >= 0 && body < PAL_BODY_MAX && (int)field >= 0 && field < PAL_FIELD_COUNT;
    return there && s->gives[body][field];
}

static pal_err refuse(pal_session *s)
{
    count_refusal(s);
    return PAL_ERR_REFUSED;
}

static bool grasps(const requested_pose *pose)
{
    return pose->present && (pose->pose.buttons & PAL_POSE_GRASP);
}

pal_err pal_session_request_pose(pal_session *s, int tool, const pal_pose *pose)
{
    if (s->play) return PAL_ERR_OK;
    if (tool < 0 || tool >= s->scene->n_tool || (pose && !pal_pose_ok(pose, s->reach_m))) return refuse(s);
    session_tool *to = &s->tool[tool];
    requested_pose *newest = &to->requested.pose[PAL_EDGE_NEWEST], next = {.arrived_ns = session_now_ns(s)};
    next.present = pose != NULL;
    if (pose) next.pose = *pose;
    const bool leaves = newest->present && !next.present;
    const int edge = pal_signal_edges_put(&to->requested.edges, leaves || grasps(&next) != grasps(newest));
    *newest = next;
    if (edge >= 0) to->requested.pose[edge] = next;
    *(requested_poses *)pal_triple_buffer_slot(&to->triple_buffer) = to->requested;
    pal_triple_buffer_publish(&to->triple_buffer);
    pal_session_call(s);
    return PAL_ERR_OK;
}

static bool is_valid(const pal_session *s, const pal_command *command)
{
    bool has_body = command->body >= 0 && command->body < s->scene->n_body;
    pal_material material = command->material; /* the check may clamp it */
    if ((int)command->kind < 0 || command->kind >= PAL_COMMAND_COUNT) return false;
    if (command->kind == PAL_COMMAND_SPEED) return command->speed >= PAL_SPEED_MIN && command->speed <= PAL_SPEED_MAX;
    if (command->kind > PAL_COMMAND_RESET && !has_body) return false;
    if (s->play && record_of[command->kind]) return false;
    switch (command->kind) {
    case PAL_COMMAND_MATERIAL:
        return !pal_material_check(&material, NULL);
    case PAL_COMMAND_FIELD:
        return pal_session_has_field(s, command->body, command->field);
    case PAL_COMMAND_BRUSH:
        return command->slot >= 0 && command->slot < s->scene->n_tool &&
               (command->brush.kind == PAL_BRUSH_NONE || !pal_brush_check(&command->brush, NULL));
    case PAL_COMMAND_COMPONENT:
        return memchr(command->component, 0, sizeof command->component);
    default:
        return true;
    }
}

pal_err pal_session_command(pal_session *s, const pal_command *command)
{
    if (!is_valid(s, command)) return refuse(s);
    const pal_err err = pal_command_queue_put(s->command, command);
    pal_session_call(s);
    return err;
}

bool pal_session_estimate(pal_session *s, int body, pal_estimate *out)
{
    return pal_estimator_set_read(&s->estimators, body, out);
}

const pal_frame *pal_session_take_frame(pal_session *s)
{
    return pal_triple_buffer_take(&s->frames);
}

bool pal_session_observe(pal_session *s, bool observes)
{
    const int before = atomic_fetch_add(&s->n_observer, observes ? 1 : -1);
    pal_session_call(s);
    return observes && before == 0 && s->options.only_observed;
}

bool pal_session_is_alive(const pal_session *s)
{
    uint64_t beat = atomic_load_explicit(&s->beat_ns, memory_order_relaxed), now = session_now_ns(s);
    return now < beat || now - beat < SECOND_NS || atomic_load_explicit(&s->replaced, memory_order_relaxed);
}

void pal_session_material(pal_session *s, int body, pal_material *out)
{
    pthread_mutex_lock(&s->lock);
    *out = s->material[body];
    pthread_mutex_unlock(&s->lock);
}

void pal_session_last_diagnostic(pal_session *s, pal_diagnostic *out)
{
    pthread_mutex_lock(&s->lock);
    *out = s->diag;
    pthread_mutex_unlock(&s->lock);
}
