/* The REST port of the Agones sidecar as `sdk-server --local` answers (release 1.30): its codes, 64-bit integers as
 * strings, spaces at random places of its JSON, answers of a known length or in chunks. It also does what a real one
 * may: begin to listen late, forget, and drop a connection. A thread serves one connection after the other; whoever
 * waits for a request is woken by it. */
#ifndef TESTS_AGONES_FAKE_SIDECAR_H
#define TESTS_AGONES_FAKE_SIDECAR_H
#include <arpa/inet.h>
#include <errno.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <unistd.h>

enum { FAKE_REQUESTS = 4096 };

typedef struct fake_sidecar {
    int fd, port;
    pthread_t thread;
    bool listens;
    pthread_mutex_t lock; /* of all that follows */
    pthread_cond_t changed;
    char state[32], sessions[32], clients[32], counter[32]; /* as Kubernetes would have them; "": unset */
    bool has_counters;
    int n_drop; /* so many connections are dropped in the midst of an answer */
    uint32_t random;
    int n;
    char request[FAKE_REQUESTS][160]; /* "POST /health {}" [n] */
    void (*heard)(const char *request);
} fake_sidecar;

static inline bool fake_chance(fake_sidecar *f)
{
    f->random = f->random * 1664525u + 1013904223u;
    return f->random >> 31;
}

/* JSON as protojson writes it: a space behind a comma or a colon, or none */
static inline void fake_space(fake_sidecar *f, const char *text, char *out)
{
    for (bool quoted = false; *text; text++) {
        quoted ^= *text == '"';
        *out++ = *text;
        if (!quoted && (*text == ',' || *text == ':') && fake_chance(f)) *out++ = ' ';
    }
    *out = 0;
}

static inline void fake_write(int fd, const char *text, size_t n)
{
    while (n > 0) {
        const ssize_t sent = send(fd, text, n, MSG_NOSIGNAL);
        if (sent <= 0) return;
        text += sent, n -= (size_t)sent;
    }
}

/* these return the status */
static inline int fake_answer(fake_sidecar *f, int fd, int status, const char *json)
{
    char body[2048], text[6144];
    size_t n = 0;
    fake_space(f, json, body);
    const char *word = status == 200   ? "OK"
                       : status == 400 ? "Bad Request"
                       : status == 404 ? "Not Found"
                                       : "Not Implemented";
    n += (size_t)snprintf(text, sizeof text, "HTTP/1.1 %d %s\r\nContent-Type: application/json\r\n", status, word);
    if (fake_chance(f)) {
        n += (size_t)snprintf(text + n, sizeof text - n, "Transfer-Encoding: chunked\r\n\r\n");
        for (const char *at = body; *at;) {
            const size_t size = strlen(at) < 7 ? strlen(at) : 7;
            n += (size_t)snprintf(text + n, sizeof text - n, "%zx\r\n%.*s\r\n", size, (int)size, at);
            at += size;
        }
        n += (size_t)snprintf(text + n, sizeof text - n, "0\r\n\r\n");
    } else {
        n += (size_t)snprintf(text + n, sizeof text - n, "Content-Length: %zu\r\n\r\n%s", strlen(body), body);
    }
    if (f->n_drop > 0) f->n_drop--, n -= 5; /* the end is missing */
    fake_write(fd, text, n);
    return status;
}

static inline int fake_error(fake_sidecar *f, int fd, int status, int code, const char *message)
{
    char json[256];
    snprintf(json, sizeof json, "{\"code\":%d,\"message\":\"%s\",\"details\":[]}", code, message);
    return fake_answer(f, fd, status, json);
}

static inline int fake_gameserver(fake_sidecar *f, int fd)
{
    char json[1024];
    snprintf(
        json, sizeof json,
        "{\"object_meta\":{\"name\":\"local\",\"namespace\":\"default\",\"uid\":\"1234\",\"resource_version\":\"\","
        "\"generation\":\"1\",\"creation_timestamp\":\"1700000000\",\"annotations\":{},\"labels\":{}},"
        "\"spec\":{\"health\":{\"disabled\":false,\"period_seconds\":3,\"failure_threshold\":5,"
        "\"initial_delay_seconds\":10}},\"status\":{\"state\":\"%s\",\"address\":\"127.0.0.1\","
        "\"ports\":[{\"name\":\"default\",\"port\":7777}],\"players\":null}}",
        f->state);
    return fake_answer(f, fd, 200, json);
}

/* {"key":"sessions","value":"2"}: both are texts, else 400 */
static inline int fake_label(fake_sidecar *f, int fd, const char *body)
{
    char key[32], value[32];
    if (sscanf(body, "{\"key\":\"%31[^\"]\",\"value\":\"%31[^\"]\"}", key, value) != 2)
        return fake_error(f, fd, 400, 3, "proto: syntax error");
    snprintf(!strcmp(key, "sessions") ? f->sessions : f->clients, sizeof f->sessions, "%s", value);
    return fake_answer(f, fd, 200, "{}");
}

static inline int fake_post(fake_sidecar *f, int fd, const char *path, const char *body)
{
    const char *state = !strcmp(path, "/ready")      ? "Ready"
                        : !strcmp(path, "/allocate") ? "Allocated"
                        : !strcmp(path, "/shutdown") ? "Shutdown"
                                                     : NULL;
    if (!state && strcmp(path, "/health") != 0) return fake_error(f, fd, 404, 5, "Not Found");
    if (body[0] ? body[0] != '{' : !strcmp(path, "/health")) return fake_error(f, fd, 400, 3, "EOF");
    if (state) snprintf(f->state, sizeof f->state, "%s", state);
    return fake_answer(f, fd, 200, "{}");
}

static inline int fake_serve(fake_sidecar *f, int fd, const char *method, const char *path, const char *body)
{
    const bool post = !strcmp(method, "POST");
    if (!strcmp(path, "/gameserver") && !strcmp(method, "GET")) return fake_gameserver(f, fd);
    if (!strcmp(path, "/metadata/label") && !strcmp(method, "PUT")) return fake_label(f, fd, body);
    if (!strcmp(path, "/v1beta1/counters/sessions") && f->has_counters && !strcmp(method, "PATCH")) {
        if (sscanf(body, "{\"count\":\"%31[0-9]\"}", f->counter) != 1) return fake_error(f, fd, 400, 3, "proto");
        return fake_answer(f, fd, 200, "{\"name\":\"sessions\",\"count\":\"1\",\"capacity\":\"8\"}");
    }
    if (post) return fake_post(f, fd, path, body);
    if (!strcmp(path, "/health") || !strcmp(path, "/ready")) return fake_error(f, fd, 501, 12, "Method Not Allowed");
    return fake_error(f, fd, 404, 5, "Not Found");
}

static inline void fake_connection(fake_sidecar *f, int fd)
{
    char text[2048] = "", method[16] = "", path[128] = "";
    size_t n = 0, n_body = 0;
    char *end = NULL;
    while (n < sizeof text - 1 && (!end || n < (size_t)(end + 4 - text) + n_body)) {
        const ssize_t got = recv(fd, text + n, sizeof text - 1 - n, 0);
        if (got <= 0) return;
        text[n += (size_t)got] = 0;
        end = strstr(text, "\r\n\r\n");
        const char *length = end ? strcasestr(text, "content-length:") : NULL;
        if (length) n_body = strtoul(length + 15, NULL, 10);
    }
    if (!end || sscanf(text, "%15s %127s", method, path) != 2) return;
    pthread_mutex_lock(&f->lock);
    if (f->n < FAKE_REQUESTS) snprintf(f->request[f->n++], sizeof *f->request, "%s %s %.40s", method, path, end + 4);
    if (f->heard) f->heard(f->request[f->n - 1]);
    (void)fake_serve(f, fd, method, path, end + 4);
    pthread_cond_broadcast(&f->changed);
    pthread_mutex_unlock(&f->lock);
}

static inline void *fake_run(void *user)
{
    fake_sidecar *f = user;
    for (int fd; (fd = accept(f->fd, NULL, NULL)) >= 0; close(fd)) fake_connection(f, fd);
    return NULL;
}

/* the port is known from now on, and refuses. port 0: any */
static inline bool fake_init(fake_sidecar *f, int port)
{
    struct sockaddr_in at = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t n = sizeof at;
    const int on = 1;
    memset(f, 0, sizeof *f);
    f->random = 1;
    snprintf(f->state, sizeof f->state, "Scheduled");
    pthread_mutex_init(&f->lock, NULL);
    pthread_cond_init(&f->changed, NULL);
    f->fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    setsockopt(f->fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (bind(f->fd, (struct sockaddr *)&at, n) || getsockname(f->fd, (struct sockaddr *)&at, &n)) return false;
    f->port = ntohs(at.sin_port);
    return true;
}

static inline bool fake_listen(fake_sidecar *f)
{
    f->listens = !listen(f->fd, 16) && !pthread_create(&f->thread, NULL, fake_run, f);
    return f->listens;
}

static inline void fake_close(fake_sidecar *f)
{
    shutdown(f->fd, SHUT_RDWR);
    if (f->listens) pthread_join(f->thread, NULL);
    close(f->fd);
}

static inline int fake_count(const fake_sidecar *f, const char *request, int from)
{
    int n = 0;
    for (int k = from; k < f->n; k++) n += !strcmp(f->request[k], request);
    return n;
}
#endif
