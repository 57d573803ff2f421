/* `palpate serve`: every input becomes a session, the network thread serves them, this thread waits for signals.
 * SIGINT, SIGTERM and SIGHUP shut down in order; SIGCHLD reports a palpate-lcm that has died and is restarted. LCM has
 * a process of its own because two forged datagrams can crash any LCM subscriber.
 *
 * Signals have handlers instead of a blocked mask and sigwait: OpenBLAS starts threads before main, and a signal that
 * one thread does not block is delivered to that thread. Without a handler it is then discarded where it is ignored
 * (SIGINT of a background process of a shell), else it kills the process. */
#include "server/agones/agones.h"
#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/base/thread.h"
#include "server/cli/config.h"
#include "server/cli/report.h"
#include "server/commands/commands.h"
#include "server/commands/served_scene.h"
#include "server/commands/tuning.h"
#include "server/mesh/files/mesh_file.h"
#include "server/net/hub_verb.h"
#include "server/net/server.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <math.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

enum { MAX_SESSIONS = 8, MAX_URL = 400 };

typedef struct lcm_child {
    char server[MAX_URL];
    pid_t pid; /* 0: not running */
    uint64_t start_ns;
} lcm_child;

typedef struct serve_run {
    pal_flag_common common;
    pal_config config;
    pal_served_options options;
    int n;
    pal_served_scene served[MAX_SESSIONS];
    pal_session *session[MAX_SESSIONS]; /* NULL: the server has closed it, or will */
    pal_resume *resume[MAX_SESSIONS];   /* borrowed by the server, as what follows */
    pal_session_study study[MAX_SESSIONS];
    pal_session_recording recording[MAX_SESSIONS];
    pal_failed_scene failed[MAX_SESSIONS]; /* [n_failed] */
    int n_failed;
    const char *scenes; /* folder of scenes that are opened while it runs; NULL: none */
    pal_scene_folder folder;
    pal_session_source source;
    pal_server_gate gate;
    pal_server *server;
    lcm_child lcm[MAX_SESSIONS];
    char lcm_program[PATH_MAX];
    pal_agones *agones; /* NULL: none */
    pthread_t net_thread;
    pal_err net_err;
    double seconds; /* serve for so long; 0: until a signal */
} serve_run;

/* ---- paths ---- */

/* folder of this program; false: unknown */
static bool program_folder(char *folder, size_t cap)
{
    char path[PATH_MAX];
    ssize_t n = readlink("/proc/self/exe", path, sizeof path - 1);
    if (n <= 0) return false;
    path[n] = 0;
    return (size_t)snprintf(folder, cap, "%s", dirname(path)) < cap;
}

/* the page's files: as configured, else beside the program (installed or in the build tree); NULL: none */
static const char *viewer_folder(const pal_config *config, char *folder, size_t cap)
{
    char own[PATH_MAX], index[PATH_MAX + 64];
    if (config->viewer[0]) return config->viewer;
    if (!program_folder(own, sizeof own) || (size_t)snprintf(folder, cap, "%s/../share/palpate/viewer", own) >= cap)
        return NULL;
    size_t n = (size_t)snprintf(index, sizeof index, "%s/index.html", folder);
    return n < sizeof index && !access(index, R_OK) ? folder : NULL;
}

/* ---- scenes and sessions ---- */

/* the second scene of one name becomes name-2 */
static void make_unique(serve_run *run, pal_served_scene *served)
{
    char *name = served->scene->scene.name, base[PAL_NAME];
    memcpy(base, name, PAL_NAME);
    for (int number = 2, i = 0; i < run->n; i++)
        if (!strcmp(run->served[i].scene->scene.name, name)) {
            snprintf(name, PAL_NAME, "%.*s-%d", PAL_NAME - 8, base, number++ % 10000);
            i = -1;
        }
}

static pal_err open_input(serve_run *run, const char *path, pal_diagnostic *diag)
{
    pal_served_scene *served = &run->served[run->n];
    pal_surface_scene_report report;
    bool is_surface;
    PAL_TRY(pal_served_scene_load(&run->options, path, served, &is_surface, &report, diag));
    if (is_surface && !run->common.quiet && !run->common.json)
        printf("palpate: %s: %lld triangles, resolution %d, unit %s (%g m)%s\n", path,
               (long long)report.surface.n_tri_read, report.resolution, report.unit_name, report.unit_m,
               report.unit_guessed ? ", guessed from its size (--units overrides)" : "");
    make_unique(run, served);
    PAL_TRY(pal_served_scene_open(&run->options, served, diag));
    const int i = run->n++;
    run->session[i] = served->opened.session;
    run->resume[i] = served->opened.resume;
    run->study[i] = served->opened.study;
    run->recording[i] = served->opened.recording;
    return PAL_ERR_OK;
}

static void note_failed(serve_run *run, const char *input, const pal_diagnostic *diag)
{
    pal_failed_scene *failed = &run->failed[run->n_failed++];
    const char *slash = strrchr(input, '/');
    snprintf(failed->scene, sizeof failed->scene, "%s", slash && slash[1] ? slash + 1 : input);
    failed->diag = *diag;
    pal_log(PAL_LOG_ERROR, "session", "%s is not served: %s", input, diag->text);
}

/* One bad scene stops no other, but a server without a session is none. Without an input: the folder of scenes alone,
 * else the computed organ */
static pal_err open_inputs(serve_run *run, const char *const *input, int n_input, pal_diagnostic *diag)
{
    run->options.record = run->config.record;
    run->options.threads = run->config.threads;
    run->options.record_by_name = n_input > 1 || run->scenes;
    run->options.wake = pal_server_gate_wake, run->options.user = &run->gate;
    for (int i = 0; i < (n_input || run->scenes ? n_input : 1); i++) {
        pal_diagnostic bad = {""};
        pal_err err = open_input(run, n_input ? input[i] : NULL, &bad);
        if (!err) continue;
        pal_served_scene_close(&run->served[run->n]);
        if (!bad.text[0]) pal_diagnostic_set(&bad, err, "%s", pal_err_text(err));
        *diag = bad;
        if (n_input < 2 || (i == n_input - 1 && run->n == 0)) return err;
        note_failed(run, input[i], &bad);
    }
    pal_report_progress(NULL, 0, &run->common);
    /* what is opened later shows no progress at this terminal, and the recording is not of it */
    run->options.surface.progress = NULL;
    run->options.replay = NULL;
    return PAL_ERR_OK;
}

static pal_err open_server(serve_run *run, pal_diagnostic *diag)
{
    char folder[PATH_MAX + 32];
    pal_server_options options = {.listen = run->config.listen,
                                  .port = run->config.port,
                                  .allow_remote = run->config.allow_remote,
                                  .hosts = run->config.hosts,
                                  .tls_certificate = run->config.tls_cert[0] ? run->config.tls_cert : NULL,
                                  .tls_key = run->config.tls_key[0] ? run->config.tls_key : NULL,
                                  .health = run->config.health,
                                  .open = run->config.open,
                                  .key_file = run->config.keys,
                                  .viewer_folder = viewer_folder(&run->config, folder, sizeof folder),
                                  .drain_to = run->config.drain_to,
                                  .error_m = run->config.error_m,
                                  .max_clients = run->config.max_clients,
                                  .max_viewers = run->config.max_viewers,
                                  .relays = run->config.relays,
                                  .resume = run->resume,
                                  .study = run->study,
                                  .recording = run->recording,
                                  .source = run->scenes ? &run->source : NULL,
                                  .failed = run->failed,
                                  .n_failed = run->n_failed};
    PAL_TRY(pal_server_open(&options, run->session, run->n, diag, &run->server));
    if (!options.viewer_folder)
        pal_log(PAL_LOG_WARN, "viewer", "no viewer to serve: neither beside the program nor given with --viewer");
    pal_server_connect(run->server, &run->gate);
    /* last: a refusal prints nothing else */
    for (int i = 0; i < run->n; i++) pal_preflight_log(&run->served[i].preflight, run->served[i].studied.scene->name);
    return PAL_ERR_OK;
}

/* address to open in a browser on this machine */
static void make_address(const serve_run *run, char *out, size_t cap)
{
    const char *listen = run->config.listen;
    if (!strcmp(listen, "0.0.0.0") || !strcmp(listen, "localhost")) listen = "127.0.0.1";
    if (!strcmp(listen, "::")) listen = "::1";
    snprintf(out, cap, strchr(listen, ':') ? "[%s]:%d" : "%s:%d", listen, pal_server_port(run->server));
}

static int announce(const serve_run *run)
{
    char address[MAX_URL], url[MAX_URL + 16], ticket[PAL_WIRE_ROLE_COUNT][PAL_TICKET_TEXT], own[MAX_URL + 128];
    make_address(run, address, sizeof address);
    snprintf(url, sizeof url, "http%s://%s/", run->config.tls_cert[0] ? "s" : "", address);
    for (int r = 0; r < PAL_WIRE_ROLE_COUNT; r++) pal_server_start_ticket(run->server, (pal_wire_role)r, ticket[r]);
    if (run->common.json) {
        cJSON *sessions = cJSON_CreateArray(), *tickets = cJSON_CreateObject();
        for (int i = 0; i < run->n; i++) cJSON_AddItemToArray(sessions, JSON_TEXT(run->served[i].scene->scene.name));
        for (int r = 0; r < PAL_WIRE_ROLE_COUNT; r++)
            cJSON_AddItemToObject(tickets, pal_wire_role_name((pal_wire_role)r), JSON_TEXT(ticket[r]));
        snprintf(own, sizeof own, "%s%s%s", url, run->config.open ? "" : "#",
                 run->config.open ? "" : ticket[PAL_WIRE_ROLE_INSTRUCTOR]);
        return pal_report_json(&run->common, PAL_JSON({"ok", JSON_BOOL(true)}, {"open", JSON_TEXT(own)},
                                                      {"tickets", tickets}, {"address", JSON_TEXT(run->config.listen)},
                                                      {"port", JSON_NUMBER(pal_server_port(run->server))},
                                                      {"pid", JSON_NUMBER(getpid())}, {"sessions", sessions}));
    }
    if (run->common.quiet) return 0;
    if (run->config.open) {
        printf("palpate: open %s\n", url);
        printf("palpate: whoever opens it may be instructor or trainee, take tools, edit and pause\n");
    } else {
        for (int r = PAL_WIRE_ROLE_COUNT - 1; r >= 0; r--)
            printf(r == PAL_WIRE_ROLE_INSTRUCTOR ? "palpate: open %s#%s as %s\n" : "palpate: or   %s#%s as %s\n", url,
                   ticket[r], pal_wire_role_name((pal_wire_role)r));
        printf("palpate: whoever opens %s without the part behind # may only watch\n", url);
    }
    for (int i = 1; i < run->n; i++)
        printf("palpate: with ?session=%s before the # for the session %s\n", run->served[i].scene->scene.name,
               run->served[i].scene->scene.name);
    fflush(stdout);
    return 0;
}

/* ---- signals ---- */

static const int handled_signal[] = {SIGINT, SIGTERM, SIGHUP, SIGCHLD};
enum { N_HANDLED = sizeof handled_signal / sizeof *handled_signal };
static int woken; /* eventfd: written by each handled signal and by the end of the network thread */
static atomic_bool stop_asked;

static void on_signal(int number)
{
    const int kept = errno;
    if (number != SIGCHLD) stop_asked = true;
    eventfd_write(woken, 1);
    errno = kept;
}

/* poll instead of a semaphore: ThreadSanitizer holds a signal back until the thread calls something that it intercepts,
 * and sem_clockwait is not among these */
static void wait_until(uint64_t when_ns)
{
    struct pollfd fd = {.fd = woken, .events = POLLIN};
    const uint64_t now_ns = pal_clock_ns(), left_ns = when_ns > now_ns ? when_ns - now_ns : 0;
    const struct timespec left = {(time_t)(left_ns / 1000000000u), (long)(left_ns % 1000000000u)};
    eventfd_t n;
    if (ppoll(&fd, 1, &left, NULL) > 0) eventfd_read(woken, &n);
}

/* ---- palpate-lcm ---- */

/* one process for each session, with tools and channels of its own */
static pal_err find_lcm(serve_run *run, pal_diagnostic *diag)
{
    char folder[PATH_MAX - 16], address[MAX_URL / 2], ticket[PAL_TICKET_TEXT];
    if (!run->config.lcm[0]) return PAL_ERR_OK;
    if (!program_folder(folder, sizeof folder))
        return pal_diagnostic_set(diag, PAL_ERR_IO, "/proc/self/exe cannot be read, so palpate-lcm is not found");
    snprintf(run->lcm_program, sizeof run->lcm_program, "%s/palpate-lcm", folder);
    if (access(run->lcm_program, X_OK)) return PAL_REFUSE(diag, "--lcm needs %s, which is not there", run->lcm_program);
    make_address(run, address, sizeof address);
    /* the bus is trusted to move tools (clients/lcm_bridge) */
    pal_server_start_ticket(run->server, PAL_WIRE_ROLE_TRAINEE, ticket);
    if (setenv("PALPATE_TICKET", ticket, true)) return PAL_ERR_MEMORY;
    for (int i = 0; i < run->n; i++)
        snprintf(run->lcm[i].server, MAX_URL, "ws%s://%s/ws?session=%s", run->config.tls_cert[0] ? "s" : "", address,
                 run->served[i].scene->scene.name);
    return PAL_ERR_OK;
}

/* runs in the child between fork and exec, with signals blocked: only async-signal-safe calls */
static void become_lcm(const serve_run *run, const lcm_child *child)
{
    sigset_t none;
    const char *argv[11] = {"palpate-lcm", "--server", child->server, "--lcm", run->config.lcm};
    int n = 5;
    if (run->config.lcm_channel[0]) argv[n++] = "--channel", argv[n++] = run->config.lcm_channel;
    if (run->config.lcm_key[0]) argv[n++] = "--lcm-key", argv[n++] = run->config.lcm_key;
    if (run->common.quiet) argv[n++] = "--quiet";
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    for (int k = 0; k < N_HANDLED; k++) signal(handled_signal[k], SIG_DFL);
    signal(SIGPIPE, SIG_DFL);
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    /* stdout belongs to the parent's announcement, sockets to the parent */
    dup2(STDERR_FILENO, STDOUT_FILENO);
    close_range(3, ~0u, 0);
    execv(run->lcm_program, (char *const *)argv);
    _exit(127);
}

static void start_lcm(serve_run *run, lcm_child *child)
{
    sigset_t all, old;
    child->start_ns = pal_clock_ns();
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &old);
    pid_t pid = fork();
    if (pid == 0) become_lcm(run, child);
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    if (pid > 0) child->pid = pid;
    if (pid < 0)
        pal_log(PAL_LOG_WARN, "lcm", "palpate-lcm cannot be started: %s", strerror(errno));
    else
        pal_log(PAL_LOG_INFO, "lcm", "palpate-lcm runs as %d", (int)pid);
}

static void reap_lcm(serve_run *run, pal_log_level level)
{
    int status;
    for (int i = 0; i < run->n; i++) {
        lcm_child *child = &run->lcm[i];
        if (!child->pid || waitpid(child->pid, &status, WNOHANG) != child->pid) continue;
        if (WIFSIGNALED(status))
            pal_log(level, "lcm", "palpate-lcm (%d) died of signal %d", (int)child->pid, WTERMSIG(status));
        else
            pal_log(level, "lcm", "palpate-lcm (%d) ended with %d", (int)child->pid, WEXITSTATUS(status));
        child->pid = 0;
    }
}

/* starts every palpate-lcm that does not run; the result is the time when the next start is due */
static uint64_t restart_lcm(serve_run *run)
{
    uint64_t next_ns = UINT64_MAX;
    for (int i = 0; i < run->n; i++) {
        lcm_child *child = &run->lcm[i];
        uint64_t due_ns = child->start_ns ? child->start_ns + PAL_LCM_RESTART_NS : 0;
        if (!child->server[0] || child->pid || pal_server_has_ended(run->server, i)) continue;
        if (due_ns <= pal_clock_ns())
            start_lcm(run, child);
        else if (due_ns < next_ns)
            next_ns = due_ns;
    }
    return next_ns;
}

static bool any_lcm(const serve_run *run)
{
    for (int i = 0; i < run->n; i++)
        if (run->lcm[i].pid) return true;
    return false;
}

static void end_lcm(serve_run *run)
{
    uint64_t end_ns = pal_clock_ns() + PAL_LCM_LEAVE_NS;
    for (int i = 0; i < run->n; i++)
        if (run->lcm[i].pid) kill(run->lcm[i].pid, SIGTERM);
    while (any_lcm(run) && pal_clock_ns() < end_ns) {
        wait_until(end_ns);
        reap_lcm(run, PAL_LOG_DEBUG);
    }
    for (int i = 0; i < run->n; i++)
        if (run->lcm[i].pid) {
            kill(run->lcm[i].pid, SIGKILL);
            waitpid(run->lcm[i].pid, NULL, 0);
        }
}

/* ---- Agones ---- */

static void look(void *user, pal_agones_server *server)
{
    const serve_run *run = user;
    const pal_hub_pulse pulse = pal_server_pulse(run->server);
    *server = (pal_agones_server){.alive = pulse.alive, .n_session = pulse.n_session, .n_client = pulse.n_client};
}

static pal_err start_agones(serve_run *run, pal_diagnostic *diag)
{
    int port = run->config.agones;
    if (!port) PAL_TRY(pal_agones_port(diag, &port));
    if (!port) return PAL_ERR_OK;
    return pal_agones_start(&(pal_agones_options){.port = port, .look = look, .user = run}, &run->agones);
}

/* ---- running ---- */

static void *net_main(void *user)
{
    serve_run *run = user;
    run->net_err = pal_server_run(run->server);
    /* wakes the waiting thread, also when the loop failed by itself */
    stop_asked = true;
    eventfd_write(woken, 1);
    return NULL;
}

static pal_err run_all(serve_run *run, const char *const *input, int n_input, pal_diagnostic *diag)
{
    struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESTART};
    woken = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (woken < 0)
        return pal_diagnostic_set(diag, PAL_ERR_IO, "a descriptor for signals cannot be opened: %s", strerror(errno));
    for (int k = 0; k < N_HANDLED; k++) sigaction(handled_signal[k], &action, NULL);
    signal(SIGPIPE, SIG_IGN);
    PAL_TRY(open_inputs(run, input, n_input, diag));
    PAL_TRY(open_server(run, diag));
    PAL_TRY(find_lcm(run, diag));
    PAL_TRY(start_agones(run, diag));
    if (pal_thread_start(&run->net_thread, net_main, run)) return PAL_ERR_INTERNAL;
    if (announce(run)) run->net_err = PAL_ERR_IO;
    uint64_t end_ns = run->seconds > 0 ? pal_clock_ns() + (uint64_t)(1e9 * run->seconds) : UINT64_MAX;
    while (!stop_asked && pal_clock_ns() < end_ns) {
        reap_lcm(run, PAL_LOG_WARN);
        uint64_t next_ns = restart_lcm(run);
        wait_until(next_ns < end_ns ? next_ns : end_ns);
    }
    end_lcm(run);
    pal_server_stop(run->server);
    pthread_join(run->net_thread, NULL);
    return run->net_err;
}

static const char about[] =
    "Serves every scene (.json), surface (.obj .stl .ply .off), label volume (.nii .nii.gz .nrrd .mha .inr .inr.gz) or "
    "solid\n"
    "of control cells (.palcells) as a session that browsers, haptic bridges and scripted clients share; without\n"
    "an input or --scenes a computed organ. Prints the address to open. Ends on SIGINT, SIGTERM or SIGHUP, or after\n"
    "--seconds.\n";

int command_serve(int argc, char **argv)
{
    static serve_run run; /* too large for the stack */
    const char *input[MAX_SESSIONS], *unit = NULL;
    int n_input = 0, resolution = 0, label = -1;
    bool largest_only = false, help_protocol = false;
    pal_diagnostic diag = {""};
    const pal_flag flag[] = {
        {"--units", "UNIT", PAL_FLAG_TEXT, &unit, 0, 0, "unit of surfaces: m, cm, mm, um, in (guessed from the size)"},
        {"--label", "N", PAL_FLAG_COUNT, &label, 0, INT_MAX, "label of a label volume (the most frequent)"},
        {"--resolution", "N", PAL_FLAG_COUNT, &resolution, 1, 1024,
         "voxels along the longest axis of a surface (about 13,000 tetrahedra)"},
        {"--largest", NULL, PAL_FLAG_SWITCH, &largest_only, 0, 0,
         "keep the largest of several components of a surface or of cells only (see palpate prepare --help)"},
        {"--seconds", "S", PAL_FLAG_NUMBER, &run.seconds, 0.1, 1e9, "end after so long (a signal ends it)"},
        {"--resume", NULL, PAL_FLAG_SWITCH, &run.options.resumes, 0, 0,
         "go on where the newest recording of --record ends, after a crash too"},
        {"--replay", "LOG", PAL_FLAG_TEXT, &run.options.replay, 0, 0,
         "play a recording of the scene: pause, seek, speed, and go on live from any moment (recorded with --record)"},
        {"--scenes", "FOLDER", PAL_FLAG_TEXT, &run.scenes, 0, 0,
         "instructors open its scenes as sessions, and end sessions, while the server runs"},
        {"--help-protocol", NULL, PAL_FLAG_SWITCH, &help_protocol, 0, 0,
         "print the commands that clients may give: name, who, numbers, what it does"},
    };
    const pal_flag_table table = {.usage = "serve [SCENE.json | SURFACE | LABEL VOLUME | CELLS]... [flags]",
                                  .about = about,
                                  .example = "palpate serve --port 0 --seconds 2\n"
                                             "palpate prepare --shape stomach -o stomach\n"
                                             "palpate serve stomach/scene.json deploy/problems/gear.obj --port 0 "
                                             "--seconds 2\n"
                                             "palpate cells chair -o chair.palcells\n"
                                             "palpate serve chair.palcells --port 0 --seconds 2\n",
                                  PAL_FLAGS(flag),
                                  .operands = {0, MAX_SESSIONS}};
    int code = pal_config_parse_flags(&table, &run.config, argc, argv, &run.common, input, &n_input);
    if (code >= 0) return code;
    if (help_protocol) {
        static char text[8192];
        if (pal_verb_describe(pal_verb_table, pal_verb_count, text, sizeof text) >= (int)sizeof text) return 1;
        fputs(text, stdout);
        return 0;
    }
    pal_log_set_level(run.common.quiet ? PAL_LOG_ERROR : pal_config_log_level(&run.config));
    run.options.surface = (pal_surface_scene){.resolution = resolution,
                                              .label = label,
                                              .largest_only = largest_only,
                                              .unit_m = unit ? pal_mesh_unit_named(unit) : 0,
                                              .progress = pal_report_progress,
                                              .user = &run.common};
    pal_err err = PAL_ERR_OK;
    if (run.options.resumes && !run.config.record[0])
        err = PAL_REFUSE(&diag, "--resume needs --record FILE, with which it goes on");
    if (!err && run.options.replay && (run.options.resumes || n_input > 1))
        err = PAL_REFUSE(&diag,
                         run.options.resumes ? "--replay and --resume: a recording either plays or goes on"
                                             : "--replay: a recording is of one scene, and %d are given",
                         n_input);
    if (!err && unit && run.options.surface.unit_m == 0)
        err = PAL_REFUSE(&diag, "--units: \"%.20s\" is not a unit", unit);
    if (!err && run.scenes) {
        err = pal_scene_folder_check(run.scenes, &diag);
        snprintf(run.folder.path, sizeof run.folder.path, "%s", run.scenes);
        run.folder.options = &run.options;
        run.source = pal_scene_folder_source(&run.folder);
    }
    if (!err) err = run_all(&run, input, n_input, &diag);
    const int record_error = run.server && !err ? pal_server_record_error(run.server) : 0;
    if (record_error)
        err = pal_diagnostic_set(&diag, PAL_ERR_IO, "a recording ended before its session: %s", strerror(record_error));
    pal_agones_stop(run.agones);
    pal_server_close(run.server);
    for (int i = 0; i < run.n; i++) pal_session_close(run.session[i]);
    for (int i = 0; i < run.n; i++) pal_served_scene_close(&run.served[i]);
    return err ? pal_report_refusal(&run.common, err, &diag) : 0;
}
