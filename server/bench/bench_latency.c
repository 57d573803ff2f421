/* `palpate bench latency`: a pose put into a session of the procedural organ -> the frame that has used it, on this
 * machine and without a network: what pacing, one step and the hand-over cost. The waiting thread sleeps until the wake
 * callback. Poses are put at times that drift through the step, so that the wait for the next step is sampled evenly.
 */
#include "server/base/clock.h"
#include "server/bench/bench.h"
#include "server/cli/report.h"
#include "server/scene/scene_file.h"
#include "server/session/session.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

enum { POSES = 300, WARM = 20 };

typedef struct bell {
    pthread_mutex_t lock;
    pthread_cond_t rung;
    uint64_t count;
} bell;

static void ring(void *user)
{
    bell *b = user;
    pthread_mutex_lock(&b->lock);
    b->count++;
    pthread_cond_signal(&b->rung);
    pthread_mutex_unlock(&b->lock);
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* milliseconds from put_pose to having the frame that used it */
static double one(pal_session *session, bell *b, const pal_pose *pose)
{
    uint64_t start = pal_clock_ns(), seen = 0;
    pal_session_put_pose(session, 0, pose);
    for (;;) {
        const pal_frame *frame = pal_session_take_frame(session);
        if (frame && frame->tool[0].present && frame->tool[0].pose.seq == pose->seq)
            return 1e-6 * (double)(pal_clock_ns() - start);
        pthread_mutex_lock(&b->lock);
        while (b->count == seen) pthread_cond_wait(&b->rung, &b->lock);
        seen = b->count;
        pthread_mutex_unlock(&b->lock);
    }
}

static int say(bool json, double step_ms, double *ms)
{
    qsort(ms, POSES, sizeof *ms, by_size);
    double p50 = ms[POSES / 2], p99 = ms[POSES * 99 / 100], most = ms[POSES - 1];
    const pal_flag_common common = {.json = json, .command = "bench"};
    if (!json) {
        printf(
            "pose to frame inside the server, %d poses, a step of %.2f ms:\n  median %.2f ms, p99 %.2f ms, most %.2f "
            "ms (one step + 5 ms is %.2f ms)\n",
            POSES, step_ms, p50, p99, most, step_ms + 5);
        return 0;
    }
    cJSON *o = cJSON_CreateObject();
    cJSON_AddBoolToObject(o, "ok", true);
    cJSON_AddNumberToObject(o, "poses", POSES);
    cJSON_AddNumberToObject(o, "step_ms", step_ms);
    cJSON_AddNumberToObject(o, "median_ms", p50);
    cJSON_AddNumberToObject(o, "p99_ms", p99);
    cJSON_AddNumberToObject(o, "most_ms", most);
    return pal_report_json(&common, o);
}

int bench_latency(bool json)
{
    static double ms[POSES];
    const pal_flag_common common = {.json = json, .command = "bench"};
    const pal_surface_scene plain = {.label = -1};
    bell b = {.lock = PTHREAD_MUTEX_INITIALIZER, .rung = PTHREAD_COND_INITIALIZER};
    pal_loaded_scene *loaded = NULL;
    pal_session *session = NULL;
    pal_diagnostic diag = {""};
    pal_session_options options = {.lease_s = 5, .wake = ring, .user = &b};
    pal_err err = pal_scene_procedural(&plain, &loaded, NULL, &diag);
    if (!err) err = pal_session_open(&loaded->scene, &options, &diag, &session);
    if (err) {
        pal_scene_free(loaded);
        return pal_report_refusal(&common, err, &diag);
    }
    double step_ms = 1e3 * loaded->scene.step_s;
    for (int k = -WARM; k < POSES; k++) {
        pal_pose pose = {.position_m = {0.15, 0, 0.0001 * k}, .quat = {1, 0, 0, 0}, .seq = (uint32_t)(k + WARM + 1)};
        pal_clock_sleep_until_ns(pal_clock_ns() + (uint64_t)(1e6 * step_ms * (0.05 + 0.9 * (k & 31) / 32)));
        double taken = one(session, &b, &pose);
        if (k >= 0) ms[k] = taken;
    }
    pal_session_close(session);
    pal_scene_free(loaded);
    return say(json, step_ms, ms);
}
