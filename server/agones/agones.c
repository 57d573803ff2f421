#include "server/agones/agones.h"

#include "server/agones/sidecar.h"
#include "server/base/clock.h"
#include "server/base/log.h"
#include "server/base/thread.h"

#include <cjson/cJSON.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

struct pal_agones {
    pal_agones_options o;
    pthread_t thread;
    int stop_fd; /* eventfd: readable when the thread is to end */
    /* the thread's own */
    char state[32];                /* of the GameServer: Scheduled, Ready, Allocated, Shutdown ... */
    int period_ms;                 /* of health */
    bool reached, called_ready;    /* the sidecar answers; it has been told of this server */
    bool has_counter, called_over; /* the fleet has a counter, or that is not known yet; shutdown was asked for */
    int put_sessions, put_clients, put_counter; /* what it knows; -1: nothing */
    uint64_t busy_ns;                           /* when the server was last in use, or not allocated */
    pal_sidecar_answer answer;
};

/* false: no answer, or one of failure */
static bool call(pal_agones *a, const char *method, const char *path, const char *body)
{
    const bool got = !pal_sidecar_call(a->o.port, a->stop_fd, method, path, body, &a->answer);
    if (got && a->answer.status != 200)
        pal_log(PAL_LOG_DEBUG, "agones", "%s %s: %d %.200s", method, path, a->answer.status, a->answer.body);
    return got && a->answer.status == 200;
}

static int count_of(const cJSON *in, const char *key, int otherwise)
{
    const cJSON *item = cJSON_GetObjectItem(in, key);
    return cJSON_IsNumber(item) && item->valuedouble >= 1 && item->valuedouble <= 86400 ? item->valueint : otherwise;
}

/* false: not reached */
static bool read_gameserver(pal_agones *a)
{
    cJSON *root = call(a, "GET", "/gameserver", NULL) ? cJSON_ParseWithLength(a->answer.body, a->answer.n_body) : NULL;
    const cJSON *health = cJSON_GetObjectItem(cJSON_GetObjectItem(root, "spec"), "health");
    const char *state = cJSON_GetStringValue(cJSON_GetObjectItem(cJSON_GetObjectItem(root, "status"), "state"));
    const bool reached = state != NULL;
    if (reached && strcmp(state, a->state)) pal_log(PAL_LOG_INFO, "agones", "this game server is %.31s", state);
    if (reached) snprintf(a->state, sizeof a->state, "%s", state);
    if (reached) a->period_ms = 1000 * count_of(health, "period_seconds", PAL_AGONES_PERIOD_S);
    if (reached != a->reached)
        pal_log(reached ? PAL_LOG_INFO : PAL_LOG_WARN, "agones", "the sidecar on port %d %s", a->o.port,
                reached ? "answers" : "does not answer");
    a->reached = reached;
    cJSON_Delete(root);
    return reached;
}

static bool is(const pal_agones *a, const char *state)
{
    return !strcmp(a->state, state);
}

/* a server that was started again keeps what Agones has made of it: who is allocated must not be given away twice */
static void call_ready(pal_agones *a)
{
    const bool later = is(a, "Allocated") || is(a, "Reserved") || is(a, "Shutdown") || is(a, "Unhealthy");
    if (is(a, "Scheduled") || (!a->called_ready && !later)) a->called_ready = call(a, "POST", "/ready", "{}");
}

static void put_label(pal_agones *a, const char *key, int value, int *put)
{
    char body[128];
    if (value == *put) return;
    snprintf(body, sizeof body, "{\"key\":\"%s\",\"value\":\"%d\"}", key, value);
    if (call(a, "PUT", "/metadata/label", body)) *put = value;
}

/* counters exist since Agones 1.37, in fleets that name them: 404 else */
static void put_counter(pal_agones *a, int n_session)
{
    char body[64];
    if (!a->has_counter || n_session == a->put_counter) return;
    snprintf(body, sizeof body, "{\"count\":\"%d\"}", n_session);
    if (call(a, "PATCH", "/v1beta1/counters/sessions", body)) a->put_counter = n_session;
    if (a->answer.status == 404) a->has_counter = false;
}

static void turn(pal_agones *a)
{
    pal_agones_server server = {.alive = false};
    if (!read_gameserver(a)) return;
    a->o.look(a->o.user, &server);
    call_ready(a);
    if (server.alive) (void)call(a, "POST", "/health", "{}");
    if (is(a, "Ready") && server.n_client > 0) (void)call(a, "POST", "/allocate", "{}");
    put_label(a, "sessions", server.n_session, &a->put_sessions);
    put_label(a, "clients", server.n_client, &a->put_clients);
    put_counter(a, server.n_session);
    const uint64_t now_ns = pal_clock_ns();
    if (server.n_client > 0 || !is(a, "Allocated")) a->busy_ns = now_ns;
    if (!a->called_over && (double)(now_ns - a->busy_ns) >= 1e9 * a->o.empty_s && is(a, "Allocated")) {
        pal_log(PAL_LOG_INFO, "agones", "nobody is here: this game server gives itself back");
        a->called_over = call(a, "POST", "/shutdown", "{}");
    }
}

static void *run(void *user)
{
    pal_agones *a = user;
    struct pollfd stop = {.fd = a->stop_fd, .events = POLLIN};
    do turn(a);
    while (!poll(&stop, 1, a->o.turn_ms ? a->o.turn_ms : a->period_ms / 3));
    return NULL;
}

pal_err pal_agones_port(pal_diagnostic *diag, int *port)
{
    const char *text = getenv("AGONES_SDK_HTTP_PORT");
    char *end = NULL;
    const long value = text && text[0] ? strtol(text, &end, 10) : 0;
    *port = 0;
    if (end && (*end || value < 1 || value > 65535))
        return PAL_REFUSE(diag, "AGONES_SDK_HTTP_PORT=%.40s: wanted a port", text);
    *port = (int)value;
    return PAL_ERR_OK;
}

pal_err pal_agones_start(const pal_agones_options *options, pal_agones **out)
{
    pal_agones *a = calloc(1, sizeof *a);
    if (!a) return PAL_ERR_MEMORY;
    a->o = *options;
    if (!(a->o.empty_s > 0)) a->o.empty_s = PAL_AGONES_EMPTY_S;
    a->period_ms = 1000 * PAL_AGONES_PERIOD_S;
    a->reached = a->has_counter = true;
    a->put_sessions = a->put_clients = a->put_counter = -1;
    a->busy_ns = pal_clock_ns();
    a->stop_fd = eventfd(0, EFD_CLOEXEC);
    if (a->stop_fd < 0 || pal_thread_start(&a->thread, run, a)) {
        if (a->stop_fd >= 0) close(a->stop_fd);
        free(a);
        return PAL_ERR_IO;
    }
    *out = a;
    return PAL_ERR_OK;
}

void pal_agones_stop(pal_agones *a)
{
    if (!a) return;
    eventfd_write(a->stop_fd, 1);
    pthread_join(a->thread, NULL);
    close(a->stop_fd);
    free(a);
}
