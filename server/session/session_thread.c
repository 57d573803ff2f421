/* The simulation thread: takes commands and the newest poses, steps the world, publishes a frame, and sleeps until the
 * next absolute time. It waits for no other thread: poses and frames use triple buffers, commands a queue. The only
 * lock guards the last diagnostic and the materials; an ordinary step does not take it.
 *
 * Slowdown is real time over simulated time since a mark that is 1 to 1 + 1/16 s old. */
#include "server/session/session_core.h"

#include "server/base/clock.h"
#include "server/base/log.h"

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double reach_sizes = 100;   /* maximum distance of a pose from the origin, in body sizes */
static const double late_part = 0.1;     /* a step is late when it begins this fraction of a step after its due time */
static const double young_max_Pa = 1e12; /* above any solid */

/* ---- the thread ---- */

static void log_diagnostic(pal_session *s, const pal_diagnostic *diag)
{
    pthread_mutex_lock(&s->note_lock);
    s->diag = *diag;
    pthread_mutex_unlock(&s->note_lock);
}

static void forget_pace(pal_session *s)
{
    s->first = s->n_marks = 0;
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
    s->marks[(s->first + s->n_marks++) % size] = (mark){now, s->step};
}

/* the estimate needs at least 0.1 s and one step */
static double slowdown(const pal_session *s)
{
    if (s->n_marks == 0) return 1;
    const mark *oldest = &s->marks[s->first];
    uint64_t real = s->end_ns - oldest->ns, n = s->step - oldest->step;
    if (s->end_ns <= oldest->ns || real < SECOND_NS / 10 || n == 0) return 1;
    return (double)real / ((double)n * (double)s->step_ns);
}

static void publish(pal_session *s)
{
    pal_frame *frame = pal_triple_buffer_slot(&s->frames);
    (void)pal_frame_fit(frame, s->world); /* out of memory: this frame omits the field */
    pal_world_frame(s->world, frame);
    frame->end_ns = s->end_ns;
    frame->step_ns = s->work_ns;
    frame->paused = s->paused;
    frame->slowdown = s->paused ? 1 : slowdown(s);
    frame->n_late = s->n_late;
    frame->n_refused = atomic_load_explicit(&s->n_refused, memory_order_relaxed);
    for (int t = 0; t < frame->n_tool; t++) {
        tool_place *place = &s->tool[t];
        frame->tool[t].pose_ns = place->arrived_ns;
        /* while paused, tools are displayed at their poses but exert no force */
        if (s->paused && place->present) {
            frame->tool[t].present = true;
            frame->tool[t].pose = place->pose;
        }
    }
    pal_triple_buffer_publish(&s->frames);
    if (s->options.wake) s->options.wake(s->options.user);
}

/* copies the newest pose of every tool to the world and releases tools whose lease has expired; true: one changed */
static bool take_poses(pal_session *s, uint64_t now)
{
    bool changed = false;
    for (int t = 0; t < s->scene->n_tool; t++) {
        tool_place *place = &s->tool[t];
        const pose_slot *slot = pal_triple_buffer_take(&place->triple_buffer);
        bool gone = place->present && now > place->arrived_ns && now - place->arrived_ns > s->lease_ns;
        pal_input_record record = {.index = t, .step = s->step};
        if (slot && slot->present && (now < slot->arrived_ns || now - slot->arrived_ns <= s->lease_ns)) {
            if (pal_world_pose(s->world, t, &slot->pose)) {
                atomic_fetch_add_explicit(&s->n_refused, 1, memory_order_relaxed);
                continue;
            }
            place->pose = slot->pose;
            place->arrived_ns = slot->arrived_ns;
            place->present = true;
            record.kind = PAL_INPUT_POSE;
            record.pose = slot->pose;
        } else if ((place->present && (slot || gone)) || (place->brushes && slot && !slot->present)) {
            pal_world_pose(s->world, t, NULL);
            place->present = place->brushes = false;
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
static void look(pal_session *s, const pal_command *command)
{
    uint32_t *n = &s->n_look[command->body][command->field];
    pal_diagnostic diag = {""};
    if (!command->wanted && *n == 0) return;
    *n = command->wanted ? *n + 1 : *n - 1;
    if (!command->wanted && *n > 0) return;
    if (pal_world_field(s->world, command->body, command->field, command->wanted, &diag)) {
        atomic_fetch_add_explicit(&s->n_refused, 1, memory_order_relaxed);
        log_diagnostic(s, &diag);
    }
}

static void brush(pal_session *s, const pal_command *command)
{
    pal_diagnostic diag = {""};
    if (pal_world_brush(s->world, command->body, command->slot, &command->brush, &diag)) {
        atomic_fetch_add_explicit(&s->n_refused, 1, memory_order_relaxed);
    } else {
        s->tool[command->slot].brushes |= command->brush.kind != PAL_BRUSH_NONE;
        pal_input_log_put(s->log, &(pal_input_record){.kind = PAL_INPUT_BRUSH,
                                                      .index = command->body,
                                                      .step = s->step,
                                                      .slot = command->slot,
                                                      .brush = command->brush});
        diag.text[0] = 0;
    }
    log_diagnostic(s, &diag);
}

static void switch_row(pal_session *s, const pal_command *command)
{
    pal_diagnostic diag = {""};
    if (pal_world_switch_component(s->world, s->scene, command->body, command->row, command->wanted, &diag)) {
        atomic_fetch_add_explicit(&s->n_refused, 1, memory_order_relaxed);
    } else {
        pal_input_record record = {
            .kind = PAL_INPUT_COMPONENT, .index = command->body, .step = s->step, .wanted = command->wanted};
        memcpy(record.row, command->row, sizeof record.row);
        pal_input_log_put(s->log, &record);
        diag.text[0] = 0;
    }
    log_diagnostic(s, &diag);
}

/* updates the observed state; true: observation began, so display data must be computed */
static bool look_around(pal_session *s)
{
    bool watched = !s->options.only_observed || atomic_load_explicit(&s->n_observer, memory_order_relaxed) > 0;
    if (watched == s->watched) return false;
    s->watched = watched;
    pal_world_watch(s->world, watched);
    return watched;
}

static void execute(pal_session *s, const pal_command *command)
{
    pal_diagnostic diag = {""};
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
    case PAL_COMMAND_RESET:
        pal_world_reset(s->world);
        log_diagnostic(s, &diag);
        for (int t = 0; t < s->scene->n_tool; t++) s->tool[t].present = s->tool[t].brushes = false;
        pal_input_log_put(s->log, &(pal_input_record){.kind = PAL_INPUT_RESET, .step = s->step});
        break;
    case PAL_COMMAND_RESET_BODY:
        (void)pal_world_reset_body(s->world, command->body);
        log_diagnostic(s, &diag);
        pal_input_log_put(s->log,
                          &(pal_input_record){.kind = PAL_INPUT_RESET_BODY, .index = command->body, .step = s->step});
        break;
    case PAL_COMMAND_MATERIAL:
        if (pal_world_material(s->world, command->body, &command->material, &diag)) {
            atomic_fetch_add_explicit(&s->n_refused, 1, memory_order_relaxed);
        } else {
            pal_input_log_put(s->log, &(pal_input_record){.kind = PAL_INPUT_MATERIAL,
                                                          .index = command->body,
                                                          .step = s->step,
                                                          .material = command->material});
            diag.text[0] = 0;
            pthread_mutex_lock(&s->note_lock);
            s->material[command->body] = command->material;
            pthread_mutex_unlock(&s->note_lock);
        }
        log_diagnostic(s, &diag);
        break;
    case PAL_COMMAND_FIELD:
        look(s, command);
        break;
    case PAL_COMMAND_BRUSH:
        brush(s, command);
        break;
    case PAL_COMMAND_ESTIMATE:
        pal_estimator_set_request(&s->watch, command->body, command->wanted);
        break;
    case PAL_COMMAND_COMPONENT:
        switch_row(s, command);
        break;
    case PAL_COMMAND_COUNT:
        break;
    }
}

static bool take_commands(pal_session *s)
{
    pal_command command;
    bool any = false, was_paused = s->paused;
    /* bounded, so that a flood of commands cannot delay the step */
    for (int k = 0; k < N_COMMAND && pal_command_queue_get(s->command, &command); k++, any = true) execute(s, &command);
    if (was_paused != s->paused) forget_pace(s);
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
    log_diagnostic(s, &diag);
}

static void step(pal_session *s)
{
    if (s->n_marks == 0) mark_pace(s, pal_clock_ns());
    uint64_t before = pal_clock_thread_ns();
    pal_err err = pal_world_step(s->world, s->scene->step_s);
    pal_world_remove_idle(s->world);
    s->work_ns = pal_clock_thread_ns() - before;
    s->end_ns = pal_clock_ns();
    s->step++;
    mark_pace(s, s->end_ns);
    if (s->log && s->step % PAL_INPUT_HASH_STEPS == 0)
        pal_input_log_put(
            s->log, &(pal_input_record){.kind = PAL_INPUT_HASH, .step = s->step, .hash = pal_world_hash(s->world)});
    if (err) report_error(s, err);
}

static void estimate(pal_session *s, bool stepped)
{
    pal_diagnostic diag = {""};
    double step_ms = stepped ? 1e-6 * (double)s->work_ns : (double)NAN;
    if (pal_estimator_set_step(&s->watch, s->world, step_ms, &diag)) log_diagnostic(s, &diag);
}

/* waits for the due time; a step at least one whole step late is due now, and the missed ones are dropped */
static void pace(pal_session *s, uint64_t *due)
{
    *due += s->step_ns;
    uint64_t now = pal_clock_ns();
    if (s->options.unpaced && !s->paused) {
        *due = now;
        return;
    }
    if (now < *due) {
        pal_clock_sleep_until_ns(*due);
        now = pal_clock_ns();
    }
    if (!s->paused && now > *due + (uint64_t)(late_part * (double)s->step_ns)) s->n_late++;
    if (now > *due + s->step_ns) *due = now;
}

static void *simulate(void *user)
{
    pal_session *s = user;
    uint64_t due = pal_clock_ns();
    s->end_ns = due;
    look_around(s);
    publish(s);
    while (!atomic_load_explicit(&s->stop, memory_order_acquire)) {
        pace(s, &due);
        bool changed = take_commands(s);
        uint64_t now = pal_clock_ns();
        atomic_store_explicit(&s->beat_ns, now, memory_order_relaxed);
        changed = take_poses(s, now) || changed;
        changed = look_around(s) || changed;
        bool moves = !s->paused || s->single > 0;
        if (moves) {
            step(s);
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
    s->n_row = pal_world_component_count(s->world);
    s->row = calloc((size_t)s->n_row + 1, sizeof *s->row);
    if (!s->row) return PAL_ERR_MEMORY;
    for (int k = 0; k < s->n_row; k++) {
        pal_world_component_info(s->world, k, &s->row[k]);
        s->row[k].spent_ns = s->row[k].n_run = 0;
    }
    s->n_part = pal_world_part_count(s->world);
    for (int k = 0; k < s->n_part; k++) pal_world_shown(s->world, k, &s->part[k]);
    for (int b = 0; b < pal_world_body_count(s->world); b++)
        for (int k = 0; k < PAL_FIELD_COUNT; k++) s->gives[b][k] = pal_world_has_field(s->world, b, (pal_field)k);
    for (int b = 0; b < pal_world_body_count(s->world); b++)
        s->reach_m = fmax(s->reach_m, reach_sizes * pal_world_body(s->world, b)->length_scale_m);
    return PAL_ERR_OK;
}

static pal_err prepare(pal_session *s, pal_diagnostic *diag)
{
    PAL_TRY(pal_world_create(s->scene, diag, &s->world));
    pal_err err = copy_plan(s);
    s->command = pal_command_queue_create(N_COMMAND, sizeof(pal_command));
    bool whole = !err && s->command;
    for (int k = 0; k < 3; k++) whole = (s->frame[k] = pal_frame_create(s->world)) && whole;
    if (!whole) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for the session's frames");
    pal_triple_buffer_init(&s->frames, s->frame[0], s->frame[1], s->frame[2]);
    for (int t = 0; t < PAL_TOOL_MAX; t++)
        pal_triple_buffer_init(&s->tool[t].triple_buffer, &s->tool[t].slot[0], &s->tool[t].slot[1],
                               &s->tool[t].slot[2]);
    if (s->options.record_path) return pal_input_log_open(s->options.record_path, s->scene, 0, diag, &s->log);
    return PAL_ERR_OK;
}

pal_err pal_session_start(pal_session *s, pal_diagnostic *diag)
{
    /* signals go to the thread that waits for them */
    sigset_t all, old;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &old);
    s->running = !pthread_create(&s->thread, NULL, simulate, s);
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    return s->running ? PAL_ERR_OK
                      : pal_diagnostic_set(diag, PAL_ERR_INTERNAL, "the simulation thread cannot be started");
}

void pal_session_stop(pal_session *s)
{
    atomic_store_explicit(&s->stop, true, memory_order_release);
    if (s->running) pthread_join(s->thread, NULL);
    s->running = false;
}

static void release(pal_session *s)
{
    for (int k = 0; k < 3; k++) pal_frame_destroy(s->frame[k]);
    pal_command_queue_destroy(s->command);
    pal_world_destroy(s->world);
    pal_estimator_set_close(&s->watch);
    pthread_mutex_destroy(&s->note_lock);
    free((void *)(uintptr_t)s->options.record_path);
    free(s->row);
    free(s);
}

pal_err pal_session_open(const pal_scene *scene, const pal_session_options *options, pal_diagnostic *diag,
                         pal_session **out)
{
    pal_session *s = calloc(1, sizeof *s);
    if (!s) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a session");
    pthread_mutex_init(&s->note_lock, NULL);
    pal_estimator_set_init(&s->watch, scene);
    s->scene = scene;
    if (options) s->options = *options;
    if (s->options.record_path) s->options.record_path = strdup(s->options.record_path);
    for (int b = 0; b < scene->n_body && b < PAL_BODY_MAX; b++) s->material[b] = scene->body[b].material;
    s->step_ns = (uint64_t)(scene->step_s * SECOND_NS + 0.5);
    s->lease_ns = (uint64_t)((s->options.lease_s > 0 ? s->options.lease_s : 0.25) * SECOND_NS);
    s->paused = s->options.start_paused;
    s->watched = true;
    atomic_init(&s->beat_ns, pal_clock_ns());
    pal_err err = prepare(s, diag);
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
    options.record_path = NULL;
    return pal_session_open(scene, &options, diag, out);
}

void pal_session_close(pal_session *s)
{
    if (!s) return;
    pal_session_stop(s);
    if (s->log) {
        uint64_t n_dropped = pal_input_log_dropped(s->log);
        if (pal_input_log_close(s->log, s->step, pal_world_hash(s->world)))
            pal_log(PAL_LOG_ERROR, "record", "%s: the input log could not be written", s->options.record_path);
        else if (n_dropped)
            pal_log(PAL_LOG_WARN, "record", "%s: %llu records did not fit and are missing: the log cannot be replayed",
                    s->options.record_path, (unsigned long long)n_dropped);
    }
    release(s);
}

/* ---- functions for any thread ---- */

const pal_scene *pal_session_scene(const pal_session *s)
{
    return s->scene;
}

int pal_session_component_count(const pal_session *s)
{
    return s->n_row;
}

void pal_session_component_info(const pal_session *s, int row, pal_component_info *out)
{
    *out = row >= 0 && row < s->n_row ? s->row[row]
                                      : (pal_component_info){.name = "", .body = "", .stage = "", .reason = ""};
}

int pal_session_part_count(const pal_session *s)
{
    return s->n_part;
}

void pal_session_shown(const pal_session *s, int part, pal_shown *out)
{
    *out = part >= 0 && part < s->n_part ? s->part[part] : (pal_shown){.name = ""};
}

bool pal_session_has_field(const pal_session *s, int body, pal_field field)
{
    bool there = body >= 0 && body < PAL_BODY_MAX && (int)field >= 0 && field < PAL_FIELD_COUNT;
    return there && s->gives[body][field];
}

static pal_err refuse(pal_session *s)
{
    atomic_fetch_add_explicit(&s->n_refused, 1, memory_order_relaxed);
    return PAL_ERR_REFUSED;
}

pal_err pal_session_put_pose(pal_session *s, int tool, const pal_pose *pose)
{
    if (tool < 0 || tool >= s->scene->n_tool || (pose && !pal_pose_ok(pose, s->reach_m))) return refuse(s);
    pose_slot *slot = pal_triple_buffer_slot(&s->tool[tool].triple_buffer);
    slot->present = pose != NULL;
    if (pose) slot->pose = *pose;
    slot->arrived_ns = pal_clock_ns();
    pal_triple_buffer_publish(&s->tool[tool].triple_buffer);
    return PAL_ERR_OK;
}

static bool material_ok(const pal_material *m)
{
    return m->young_Pa > 0 && m->young_Pa <= young_max_Pa && m->poisson > -1 && m->poisson < 0.5 &&
           m->density_kg_m3 > 0 && isfinite(m->density_kg_m3) && m->damping_1_s >= 0 && isfinite(m->damping_1_s);
}

pal_err pal_session_command(pal_session *s, const pal_command *command)
{
    if ((int)command->kind < 0 || command->kind >= PAL_COMMAND_COUNT) return refuse(s);
    if (command->kind == PAL_COMMAND_MATERIAL &&
        (command->body < 0 || command->body >= s->scene->n_body || !material_ok(&command->material)))
        return refuse(s);
    if (command->kind == PAL_COMMAND_RESET_BODY && (command->body < 0 || command->body >= s->scene->n_body))
        return refuse(s);
    if (command->kind == PAL_COMMAND_FIELD && !pal_session_has_field(s, command->body, command->field))
        return refuse(s);
    if (command->kind == PAL_COMMAND_BRUSH &&
        (command->body < 0 || command->body >= s->scene->n_body || command->slot < 0 ||
         command->slot >= s->scene->n_tool ||
         (command->brush.kind != PAL_BRUSH_NONE && pal_brush_check(&command->brush, NULL))))
        return refuse(s);
    if (command->kind == PAL_COMMAND_ESTIMATE && (command->body < 0 || command->body >= s->scene->n_body))
        return refuse(s);
    if (command->kind == PAL_COMMAND_COMPONENT &&
        (command->body < 0 || command->body >= s->scene->n_body || !memchr(command->row, 0, sizeof command->row)))
        return refuse(s);
    return pal_command_queue_put(s->command, command);
}

bool pal_session_estimate(pal_session *s, int body, pal_estimate *out)
{
    return pal_estimator_set_read(&s->watch, body, out);
}

const pal_frame *pal_session_take_frame(pal_session *s)
{
    return pal_triple_buffer_take(&s->frames);
}

void pal_session_observe(pal_session *s, bool looks)
{
    atomic_fetch_add_explicit(&s->n_observer, looks ? 1 : -1, memory_order_relaxed);
}

bool pal_session_is_alive(const pal_session *s)
{
    uint64_t beat = atomic_load_explicit(&s->beat_ns, memory_order_relaxed), now = pal_clock_ns();
    return now < beat || now - beat < SECOND_NS || atomic_load_explicit(&s->replaced, memory_order_relaxed);
}

void pal_session_material(pal_session *s, int body, pal_material *out)
{
    pthread_mutex_lock(&s->note_lock);
    *out = s->material[body];
    pthread_mutex_unlock(&s->note_lock);
}

void pal_session_last_diagnostic(pal_session *s, pal_diagnostic *out)
{
    pthread_mutex_lock(&s->note_lock);
    *out = s->diag;
    pthread_mutex_unlock(&s->note_lock);
}
