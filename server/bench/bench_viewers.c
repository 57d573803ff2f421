/* `palpate bench viewers [SCENE]`: many viewers of one session at 30 frames a second, of a scene file or of the
 * computed organ, which a tool pulls to and fro all the time. Frames are encoded once. The viewers are a crowd of
 * sockets in another process on the same machine (crowd.h), which come to the server itself or to relays, processes of
 * their own too. Steps are measured alone, with the crowd, and alone again: processor time of the simulation thread
 * from one frame to the next. All processes share the cores, so what a viewer costs is processor time of the server's
 * network thread or of the relays, over the cycles that came; the age of a frame is real time from the end of its step
 * until the viewer has it, and grows when cores are short. Memory is what the process that sends has grown by. */
#include "server/base/log.h"
#include "server/base/machine.h"
#include "server/base/thread.h"
#include "server/bench/bench.h"
#include "server/bench/crowd.h"
#include "server/net/server.h"
#include "server/num/median.h"
#include "server/scene/scene_file.h"

#include <libgen.h>
#include <limits.h>
#include <malloc.h>
#include <math.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

/* viewers: one more place than they are, and some for those that come while others go */
enum { RATE_HZ = 30, ALONE_S = 10, STEPS = 8192, SPARE = 64, JOIN_S = 120 };

typedef struct viewers_case {
    int n_viewer, n_relay, seconds;
} viewers_case;

typedef struct relay_process {
    pid_t id;
    int port;
    FILE *output;
} relay_process;

/* [sim] writes n_published and what follows it */
typedef struct rig {
    const viewers_case *c;
    bench_crowd *crowd;
    pid_t crowd_id;
    pal_server_gate gate;
    pal_session *session;
    pal_server *server;
    pthread_t net;
    bool runs;
    relay_process relay[CROWD_GATES];
    double top_m[3], length_m;
    uint32_t n_pose;
    _Atomic uint64_t n_published;
    uint64_t cpu_ns;
    uint64_t n_made;             /* frames that were published while the crowd measured */
    double *ms[2];               /* steps alone and with the crowd [STEPS] */
    _Atomic int n_ms[2], counts; /* counts: into which; -1: neither */
} rig;

extern char **environ;

static double seconds_of(clockid_t clock)
{
    struct timespec t = {0};
    (void)clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double process_s(pid_t id)
{
    clockid_t clock;
    return clock_getcpuclockid(id, &clock) ? NAN : seconds_of(clock);
}

static double thread_s(pthread_t thread)
{
    clockid_t clock;
    return pthread_getcpuclockid(thread, &clock) ? NAN : seconds_of(clock);
}

/* ---- the session ---- */

/* a frame was published: [sim] */
static void published(void *user)
{
    rig *r = user;
    atomic_store_explicit(&r->crowd->published_ns[r->n_published++ % CROWD_TICKS], pal_clock_ns(),
                          memory_order_relaxed);
    const uint64_t now = pal_clock_thread_ns();
    const int which = atomic_load(&r->counts);
    if (which >= 0 && r->n_ms[which] < STEPS) r->ms[which][r->n_ms[which]++] = 1e-6 * (double)(now - r->cpu_ns);
    r->cpu_ns = now;
    pal_server_gate_wake(&r->gate);
}

static void *net_main(void *server)
{
    (void)pal_server_run(server);
    return NULL;
}

/* where the first body is highest, and how long it is */
static void find_top(rig *r, const pal_scene *scene)
{
    const pal_surface *surface = &scene->body[0].mesh->surface;
    double low[3], high[3], best = -INFINITY;
    pal_surface_box(surface, low, high);
    for (int i = 0; i < surface->n_vertex; i++) {
        const double *x = surface->x + 3 * (size_t)i;
        const double up = x[0] * scene->up[0] + x[1] * scene->up[1] + x[2] * scene->up[2];
        if (up > best) best = up, memcpy(r->top_m, x, sizeof r->top_m);
    }
    r->length_m = hypot(hypot(high[0] - low[0], high[1] - low[1]), high[2] - low[2]);
}

/* a tool holds the top and goes to and fro by a twentieth of the length, as 60 times a second as a hand sends it */
static void pull_for(rig *r, double seconds)
{
    const uint64_t start = pal_clock_ns();
    for (double t = 0; t < seconds; t = 1e-9 * (double)(pal_clock_ns() - start)) {
        pal_pose pose = {.quat = {1, 0, 0, 0}, .seq = ++r->n_pose, .buttons = r->n_pose > 4};
        memcpy(pose.position_m, r->top_m, sizeof pose.position_m);
        if (r->n_pose > 4) pose.position_m[0] += 0.05 * r->length_m * sin(r->n_pose / 20.0);
        (void)pal_session_request_pose(r->session, 0, &pose);
        pal_clock_sleep_until_ns(pal_clock_ns() + 1000000000u / 60);
    }
}

static void measure_steps(rig *r, int which, double seconds)
{
    pull_for(r, 2);
    atomic_store(&r->counts, which);
    pull_for(r, seconds);
    atomic_store(&r->counts, -1);
}

/* ---- relays ---- */

static pal_err start_relay(rig *r, relay_process *relay, pal_diagnostic *diag)
{
    char own[PATH_MAX] = "", program[PATH_MAX + 16], upstream[64], places[16], line[512] = "";
    int ends[2];
    posix_spawn_file_actions_t files;
    if (readlink("/proc/self/exe", own, sizeof own - 1) < 0 || pipe(ends)) return PAL_ERR_IO;
    snprintf(program, sizeof program, "%s/palpate-relay", dirname(own));
    snprintf(upstream, sizeof upstream, "ws://127.0.0.1:%d/ws", pal_server_port(r->server));
    snprintf(places, sizeof places, "%d", r->c->n_viewer / r->c->n_relay + SPARE);
    char *const argument[] = {program, upstream, "--port", "0", "--json", "--max-viewers", places, NULL};
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, ends[1], 1);
    posix_spawn_file_actions_addclose(&files, ends[0]);
    const int error = posix_spawn(&relay->id, program, &files, NULL, argument, environ);
    posix_spawn_file_actions_destroy(&files);
    close(ends[1]);
    relay->output = fdopen(ends[0], "r");
    if (error) relay->id = 0;
    if (error || !relay->output) return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: %s", program, strerror(error));
    while (!relay->port && fgets(line, sizeof line, relay->output)) {
        const char *port = strstr(line, "\"port\":");
        if (port) relay->port = atoi(port + 7);
    }
    return relay->port ? PAL_ERR_OK : pal_diagnostic_set(diag, PAL_ERR_IO, "%s does not start", program);
}

static void stop_relay(relay_process *relay)
{
    if (relay->id > 0) kill(relay->id, SIGTERM), waitpid(relay->id, NULL, 0);
    if (relay->output) fclose(relay->output);
}

/* ---- a case ---- */

/* until all have joined */
static pal_err wait_joined(rig *r, pal_diagnostic *diag)
{
    const uint64_t end = pal_clock_ns() + JOIN_S * 1000000000ull;
    while (atomic_load(&r->crowd->n_joined) < r->c->n_viewer) {
        if (pal_clock_ns() > end)
            return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "%d of %d viewers have joined within %d s",
                                      atomic_load(&r->crowd->n_joined), r->c->n_viewer, JOIN_S);
        pull_for(r, 0.1);
    }
    return PAL_ERR_OK;
}

/* what sends to the viewers: processor time and memory */
static void look(const rig *r, double *cpu_s, double *bytes)
{
    *cpu_s = r->c->n_relay ? 0 : thread_s(r->net);
    *bytes = r->c->n_relay ? 0 : pal_machine_resident_bytes(getpid());
    for (int i = 0; i < r->c->n_relay; i++) {
        *cpu_s += process_s(r->relay[i].id);
        *bytes += pal_machine_resident_bytes(r->relay[i].id);
    }
}

static void report(rig *r, const double cpu_s[2], const double bytes[2], double server_s, pal_table *table)
{
    const bench_crowd *c = r->crowd;
    const double cycles = (double)c->n_cycle, n = r->c->n_viewer;
    double p99[2];
    for (int w = 0; w < 2; w++) {
        (void)pal_median(r->ms[w], r->n_ms[w]);
        p99[w] = r->n_ms[w] ? r->ms[w][r->n_ms[w] * 99 / 100] : NAN;
    }
    TABLE_ROW(table, NUMBER("viewers", "viewers", 7, 0, n), NUMBER("relays", "relays", 6, 0, r->c->n_relay),
              NUMBER("frames_per_s", "frames/s", 8, 1, (double)r->n_made / r->c->seconds),
              NUMBER("cycles_per_s", "cycles/s", 8, 1, cycles / n / r->c->seconds),
              NUMBER("age_p50_ms", "age ms p50", 10, 1, bench_crowd_age_ms(c, 0.5)),
              NUMBER("age_p99_ms", "p99", 6, 1, bench_crowd_age_ms(c, 0.99)),
              NUMBER("step_p99_alone_ms", "step ms p99 alone", 17, 2, p99[0]),
              NUMBER("step_p99_ms", "with", 6, 2, p99[1]),
              NUMBER("us_per_cycle", "us a cycle", 10, 1, 1e6 * (cpu_s[1] - cpu_s[0]) / cycles),
              NUMBER("bytes_per_cycle", "bytes", 6, 0, (double)c->n_byte / cycles),
              NUMBER("kib_per_viewer", "KiB a viewer", 12, 1, (bytes[1] - bytes[0]) / n / 1024),
              NUMBER("server_cores", "server cores", 12, 2, server_s / r->c->seconds),
              NUMBER("crowd_us_per_cycle", "crowd us", 8, 1, 1e-3 * (double)c->cpu_ns / cycles),
              NUMBER("checked", "checked", 8, 0, (double)c->n_checked), NUMBER("bad", "bad", 4, 0, (double)c->n_bad),
              NUMBER("lost", "lost", 4, 0, (double)c->n_lost));
}

static pal_err measure(rig *r, pal_table *table, pal_diagnostic *diag)
{
    double cpu_s[2], bytes[2], server_s;
    bench_crowd *c = r->crowd;
    c->n_gate = r->c->n_relay ? r->c->n_relay : 1;
    c->port[0] = pal_server_port(r->server);
    for (int i = 0; i < r->c->n_relay; i++) {
        PAL_TRY(start_relay(r, &r->relay[i], diag));
        c->port[i] = r->relay[i].port;
    }
    measure_steps(r, 0, ALONE_S);
    malloc_trim(0);
    look(r, &cpu_s[0], &bytes[0]);
    atomic_store(&c->phase, CROWD_JOINS);
    PAL_TRY(wait_joined(r, diag));
    pull_for(r, 3); /* credit finds its size */
    look(r, &cpu_s[0], &(double){0});
    server_s = thread_s(r->net);
    atomic_store(&c->phase, CROWD_MEASURES);
    r->n_made = r->n_published;
    atomic_store(&r->counts, 1);
    pull_for(r, r->c->seconds);
    atomic_store(&r->counts, -1);
    r->n_made = r->n_published - r->n_made;
    look(r, &cpu_s[1], &bytes[1]);
    server_s = thread_s(r->net) - server_s;
    atomic_store(&c->phase, CROWD_LEAVES);
    waitpid(r->crowd_id, NULL, 0);
    r->crowd_id = 0;
    measure_steps(r, 0, ALONE_S);
    report(r, cpu_s, bytes, server_s, table);
    return PAL_ERR_OK;
}

static void end_case(rig *r)
{
    if (r->crowd) atomic_store(&r->crowd->phase, CROWD_LEAVES);
    if (r->crowd_id > 0) waitpid(r->crowd_id, NULL, 0);
    for (int i = 0; i < r->c->n_relay; i++) stop_relay(&r->relay[i]);
    if (r->server) pal_server_stop(r->server);
    if (r->runs) pthread_join(r->net, NULL);
    pal_server_close(r->server);
    pal_session_close(r->session);
    bench_crowd_destroy(r->crowd);
    free(r->ms[0]);
    free(r->ms[1]);
}

static pal_err run_case(const viewers_case *c, const pal_loaded_scene *loaded, pal_table *table, pal_diagnostic *diag)
{
    static rig r;
    const pal_session_options options = {.lease_s = 5, .wake = published, .user = &r};
    const pal_server_options net = {.listen = "127.0.0.1", .max_viewers = c->n_viewer + SPARE};
    r = (rig){.c = c, .crowd = bench_crowd_create(), .counts = -1};
    for (int w = 0; w < 2; w++) r.ms[w] = calloc(STEPS, sizeof(double));
    pal_err err = r.crowd && r.ms[0] && r.ms[1] ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err) {
        r.crowd->step_s = loaded->scene.step_s, r.crowd->n_viewer = c->n_viewer;
        r.crowd_id = bench_crowd_start(r.crowd);
        find_top(&r, &loaded->scene);
        err = r.crowd_id < 0 ? PAL_ERR_IO : pal_session_open(&loaded->scene, &options, diag, &r.session);
    }
    if (!err) err = pal_server_open(&net, &r.session, 1, diag, &r.server);
    if (!err) pal_server_connect(r.server, &r.gate);
    if (!err) r.runs = !pal_thread_start(&r.net, net_main, r.server);
    if (!err) err = r.runs ? measure(&r, table, diag) : PAL_ERR_INTERNAL;
    end_case(&r);
    return err;
}

pal_err bench_viewers(pal_table *table, pal_diagnostic *diag)
{
    static const viewers_case list[] = {{100, 0, 20}, {1000, 0, 20}, {1000, 2, 20}, {5000, 2, 60}};
    const pal_surface_scene organ = {.label = -1};
    pal_loaded_scene *loaded = NULL;
    pal_err err = table->argument ? pal_scene_load(table->argument, &loaded, diag)
                                  : pal_scene_procedural(&organ, &loaded, NULL, diag);
    if (err) return err;
    pal_log_set_level(PAL_LOG_WARN);
    loaded->scene.step_s = 1.0 / RATE_HZ;
    pal_table_note(table, "%d frames a second; a cycle is a frame and the tools; the crowd shares the cores", RATE_HZ);
    pal_table_list(table, "cases");
    for (size_t k = 0; k < sizeof list / sizeof *list && !err; k++) err = run_case(&list[k], loaded, table, diag);
    pal_scene_free(loaded);
    return err;
}
