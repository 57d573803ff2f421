/* `palpate bench latency`: from a pose put into a session of the procedural organ to the frame that has used it,
 * without a network: the cost of pacing, of one step and of the transfer between threads. The waiting thread sleeps
 * until the wake callback. Poses are put at times that drift through the step, so that the wait for the next step is
 * sampled evenly. */
#include "server/bench/bench.h"
#include "server/num/median.h"
#include "server/scene/scene_file.h"
#include "server/session/session.h"

#include <semaphore.h>

enum { POSES = 300, WARM = 20 };

static void ring(void *user)
{
    sem_post(user);
}

/* milliseconds from the request of a pose to having the frame that used it */
static double one(pal_session *session, sem_t *rung, const pal_pose *pose)
{
    uint64_t start = pal_clock_ns();
    pal_session_request_pose(session, 0, pose);
    for (;;) {
        const pal_frame *frame = pal_session_take_frame(session);
        if (frame && frame->tool[0].present && frame->tool[0].pose.seq == pose->seq)
            return 1e-6 * (double)(pal_clock_ns() - start);
        sem_wait(rung);
    }
}

pal_err bench_latency(pal_table *r, pal_diagnostic *diag)
{
    static double ms[POSES];
    const pal_surface_scene plain = {.label = -1};
    sem_t rung;
    pal_loaded_scene *loaded = NULL;
    pal_session *session = NULL;
    pal_session_options options = {.lease_s = 5, .wake = ring, .user = &rung};
    sem_init(&rung, 0, 0);
    pal_err err = pal_scene_procedural(&plain, &loaded, NULL, diag);
    if (!err) err = pal_session_open(&loaded->scene, &options, diag, &session);
    double step_ms = err ? 0 : 1e3 * loaded->scene.step_s;
    for (int k = -WARM; k < POSES && !err; k++) {
        pal_pose pose = {.position_m = {0.15, 0, 0.0001 * k}, .quat = {1, 0, 0, 0}, .seq = (uint32_t)(k + WARM + 1)};
        pal_clock_sleep_until_ns(pal_clock_ns() + (uint64_t)(1e6 * step_ms * (0.05 + 0.9 * (k & 31) / 32)));
        double taken = one(session, &rung, &pose);
        if (k >= 0) ms[k] = taken;
    }
    pal_session_close(session);
    sem_destroy(&rung);
    pal_scene_free(loaded);
    double median_ms = pal_median(ms, POSES);
    pal_table_note(r, "pose to frame inside the server; at most one step and 5 ms are wanted");
    pal_table_list(r, "cases");
    TABLE_ROW(r, NUMBER("poses", "poses", 6, 0, POSES), NUMBER("step_ms", "step ms", 8, 2, step_ms),
              NUMBER("median_ms", "median ms", 10, 2, median_ms),
              NUMBER("p99_ms", "p99 ms", 8, 2, ms[POSES * 99 / 100]), NUMBER("max_ms", "max ms", 8, 2, ms[POSES - 1]));
    return err;
}
