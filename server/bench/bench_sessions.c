/* `palpate bench sessions`: how many sessions one core holds at 60 steps a second. Sessions of the computed organ, each
 * with its simulation thread, all on one core with the thread that plays their members: some are touched, a member
 * pulls the organ by its top to and fro; the others have nobody inside and sleep. Of the touched ones: the 99th
 * percentile of the processor time of a step, frames that the member has taken a second, and the slowdown of the
 * slowest session, real over simulated time. Memory is what the process has grown by, over the number of sessions. */
#include "server/base/machine.h"
#include "server/bench/bench.h"
#include "server/num/median.h"
#include "server/scene/scene_file.h"
#include "server/session/session.h"

#include <malloc.h>
#include <math.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* processor time of a step of a body that sleeps, at most */
enum { ASLEEP_NS = 100000 };
enum { SESSIONS_MAX = 256, AT_ONCE = 8, SECONDS = 6, WARM_S = 2, SAMPLES = 64 * 64 * SECONDS };

typedef struct bench_case {
    bool fem;
    int n_touched, n_asleep;
} bench_case;

typedef struct member {
    pal_session *session;
    double low_m[3], high_m[3]; /* box of the organ at rest */
    double slowdown;
    int n_frame;
} member;

/* the first of the cores that this process may use; false: they are not known */
static bool keep_to_one_core(cpu_set_t *before)
{
    cpu_set_t one;
    int first = 0;
    if (sched_getaffinity(0, sizeof *before, before)) return false;
    while (!CPU_ISSET(first, before)) first++;
    CPU_ZERO(&one);
    CPU_SET(first, &one);
    return !sched_setaffinity(0, sizeof one, &one);
}

/* a mouse with a tool at the top of the organ that holds it from the start and goes to and fro by a tenth of its length
 */
static void pull(member *m, int turn, double time_s)
{
    const double *low = m->low_m, *high = m->high_m, reach = 0.1 * (high[0] - low[0]);
    pal_pose pose = {.quat = {1, 0, 0, 0},
                     .seq = (uint32_t)turn + 1,
                     .buttons = PAL_POSE_NO_HAPTICS | (turn > 3 ? PAL_POSE_GRASP : 0)};
    for (int c = 0; c < 2; c++) pose.position_m[c] = 0.5 * (low[c] + high[c]);
    pose.position_m[0] += turn > 3 ? reach * sin(3 * time_s) : 0;
    pose.position_m[2] = high[2];
    (void)pal_session_request_pose(m->session, 0, &pose);
}

/* sleeps until a session that nobody touches costs next to nothing, or until a minute has passed */
static void wait_asleep(const member *m, int n)
{
    const uint64_t end = pal_clock_ns() + 60000000000u;
    for (int k = 0; k < n && pal_clock_ns() < end;) {
        const pal_frame *frame = pal_session_take_frame(m[k].session);
        if (frame && frame->step_ns < ASLEEP_NS)
            k++;
        else
            pal_clock_sleep_until_ns(pal_clock_ns() + 20000000);
    }
}

/* one of the member's glances, 60 a second: its pose, and the frame that is there. ms: steps after the warm-up */
static void play(member *m, int turn, double time_s, double *ms, int *n)
{
    pull(m, turn, time_s);
    const pal_frame *frame = pal_session_take_frame(m->session);
    if (!frame || time_s < WARM_S) return;
    m->n_frame++;
    m->slowdown = frame->slowdown;
    if (*n < SAMPLES) ms[(*n)++] = 1e-6 * (double)frame->step_ns;
}

static void report(const bench_case *c, const member *m, double *ms, int n, int n_node, double bytes, pal_table *r)
{
    double slowdown = 0, rate = INFINITY;
    for (int k = 0; k < c->n_touched; k++) {
        slowdown = fmax(slowdown, m[k].slowdown);
        rate = fmin(rate, (double)m[k].n_frame / (SECONDS - WARM_S));
    }
    const double p50_ms = pal_median(ms, n), p99_ms = n > 0 ? ms[n * 99 / 100] : NAN;
    TABLE_ROW(r, TEXT("model", "model", -8, c->fem ? "fem" : "springs"), NUMBER("nodes", "nodes", 6, 0, n_node),
              NUMBER("touched", "touched", 7, 0, c->n_touched), NUMBER("asleep", "asleep", 6, 0, c->n_asleep),
              NUMBER("p50_ms", "step ms p50", 11, 3, p50_ms), NUMBER("p99_ms", "p99", 7, 3, p99_ms),
              NUMBER("frames_per_s", "frames/s", 8, 1, rate), NUMBER("slowdown", "slowdown", 8, 2, slowdown),
              NUMBER("mb_per_session", "MB a session", 12, 1, 1e-6 * bytes / (c->n_touched + c->n_asleep)));
}

static pal_err run_case(const bench_case *c, const pal_loaded_scene *loaded, double *ms, pal_table *r,
                        pal_diagnostic *diag)
{
    static member m[SESSIONS_MAX];
    const int n = c->n_touched + c->n_asleep;
    malloc_trim(0);
    const double before = pal_machine_resident_bytes(getpid());
    const pal_session_options options = {.lease_s = 5, .only_observed = true};
    const pal_prepared *mesh = loaded->scene.body[0].mesh;
    pal_err err = PAL_ERR_OK;
    int n_ms = 0;
    memset(m, 0, sizeof m);
    /* a few at a time, each after the ones before sleep: as members come and go */
    for (int k = n - 1; k >= 0 && !err; k--) {
        err = pal_session_open(&loaded->scene, &options, diag, &m[k].session);
        pal_surface_box(&mesh->surface, m[k].low_m, m[k].high_m);
        if (!err && k % AT_ONCE == 0) wait_asleep(m + k, n - k < AT_ONCE ? n - k : AT_ONCE);
    }
    for (int k = 0; k < c->n_touched && !err; k++) pal_session_observe(m[k].session, true);
    const uint64_t start = pal_clock_ns();
    for (int turn = 0; turn < 60 * SECONDS && !err; turn++) {
        const double time_s = turn / 60.0;
        pal_clock_sleep_until_ns(start + (uint64_t)(1e9 * time_s));
        for (int k = 0; k < c->n_touched; k++) play(&m[k], turn, time_s, ms, &n_ms);
    }
    const double bytes = pal_machine_resident_bytes(getpid()) - before;
    for (int k = 0; k < n; k++) pal_session_close(m[k].session);
    if (!err) report(c, m, ms, n_ms, mesh->tets.n_node, bytes, r);
    return err;
}

pal_err bench_sessions(pal_table *r, pal_diagnostic *diag)
{
    static const bench_case list[] = {{true, 1, 0},  {true, 4, 0},  {true, 8, 0},   {true, 8, 200},
                                      {false, 1, 0}, {false, 8, 0}, {false, 16, 0}, {false, 16, 200}};
    double *ms = malloc(sizeof *ms * SAMPLES);
    cpu_set_t all;
    if (!ms) return PAL_ERR_MEMORY;
    const bool one = keep_to_one_core(&all);
    pal_table_note(r, one ? "on one core, at 60 steps a second" : "at 60 steps a second, on all cores");
    pal_table_list(r, "cases");
    pal_err err = PAL_ERR_OK;
    for (size_t k = 0; k < sizeof list / sizeof *list && !err; k++) {
        const pal_surface_scene organ = {.label = -1, .fem = list[k].fem};
        pal_loaded_scene *loaded = NULL;
        err = pal_scene_procedural(&organ, &loaded, NULL, diag);
        if (!err) err = run_case(&list[k], loaded, ms, r, diag);
        pal_scene_free(loaded);
    }
    if (one) (void)sched_setaffinity(0, sizeof all, &all);
    free(ms);
    return err;
}
