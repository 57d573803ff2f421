#include "server/agones/sidecar.h"

#include "server/base/clock.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/socket.h>
#include <unistd.h>

/* false: nothing until the end, or stopped */
static bool await(int fd, int stop_fd, short events, uint64_t end_ns)
{
    struct pollfd wait[2] = {{.fd = fd, .events = events}, {.fd = stop_fd, .events = POLLIN}};
    const uint64_t now_ns = pal_clock_ns();
    const int left_ms = end_ns > now_ns ? (int)((end_ns - now_ns) / 1000000u) + 1 : 0;
    return poll(wait, 2, left_ms) > 0 && !wait[1].revents;
}

static bool send_all(int fd, int stop_fd, const char *bytes, size_t n, uint64_t end_ns)
{
    while (n > 0) {
        if (!await(fd, stop_fd, POLLOUT, end_ns)) return false;
        const ssize_t sent = send(fd, bytes, n, MSG_NOSIGNAL);
        if (sent < 0 && errno != EAGAIN && errno != EINTR) return false;
        if (sent > 0) bytes += sent, n -= (size_t)sent;
    }
    return true;
}

/* until the other side ends the connection, which the request asks for */
static pal_err receive_all(int fd, int stop_fd, pal_sidecar_answer *out, size_t *n, uint64_t end_ns)
{
    for (*n = 0;;) {
        if (*n == PAL_SIDECAR_BYTES) return PAL_ERR_FULL;
        if (!await(fd, stop_fd, POLLIN, end_ns)) return PAL_ERR_IO;
        const ssize_t got = recv(fd, out->bytes + *n, PAL_SIDECAR_BYTES - *n, 0);
        if (got < 0 && errno != EAGAIN && errno != EINTR) return PAL_ERR_IO;
        if (got == 0) break;
        if (got > 0) *n += (size_t)got;
    }
    out->bytes[*n] = 0;
    return PAL_ERR_OK;
}

/* moves the bytes of all chunks together; false: the last one is missing */
static bool join_chunks(char *body, size_t n, size_t *n_joined)
{
    size_t at = 0;
    for (*n_joined = 0;;) {
        char *end;
        const unsigned long size = strtoul(body + at, &end, 16);
        const char *line = strstr(end, "\r\n");
        if (end == body + at || !line) return false;
        at = (size_t)(line - body) + 2;
        if (size == 0) return true;
        if (at > n || size > n - at) return false;
        memmove(body + *n_joined, body + at, size);
        *n_joined += size, at += size;
        if (n - at < 2 || memcmp(body + at, "\r\n", 2) != 0) return false;
        at += 2;
    }
}

/* value of a field of the head, which ends before `end`; NULL: none */
static const char *field(const char *head, const char *end, const char *name)
{
    for (const char *line = strstr(head, "\r\n"); line && line < end; line = strstr(line, "\r\n")) {
        line += 2;
        if (!strncasecmp(line, name, strlen(name))) return line + strlen(name);
    }
    return NULL;
}

static pal_err read_answer(pal_sidecar_answer *out, size_t n)
{
    char *end = strstr(out->bytes, "\r\n\r\n");
    if (!end || sscanf(out->bytes, "HTTP/1.%*1[01] %3d", &out->status) != 1) return PAL_ERR_IO;
    const char *length = field(out->bytes, end, "content-length:");
    const char *coding = field(out->bytes, end, "transfer-encoding:");
    char *body = end + 4;
    out->n_body = n - (size_t)(body - out->bytes);
    if (coding && !join_chunks(body, out->n_body, &out->n_body)) return PAL_ERR_IO;
    if (!coding && length && strtoul(length, NULL, 10) != out->n_body) return PAL_ERR_IO;
    body[out->n_body] = 0;
    out->body = body;
    return PAL_ERR_OK;
}

pal_err pal_sidecar_call(int port, int stop_fd, const char *method, const char *path, const char *body,
                         pal_sidecar_answer *out)
{
    const struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const uint64_t end_ns = pal_clock_ns() + PAL_SIDECAR_ANSWER_MS * 1000000ull;
    char request[1024];
    size_t n = 0;
    out->status = 0, out->body = "", out->n_body = 0;
    const int n_request =
        snprintf(request, sizeof request,
                 "%s %s HTTP/1.1\r\nHost: localhost:%d\r\nConnection: close\r\nContent-Type: application/json\r\n"
                 "Content-Length: %zu\r\n\r\n%s",
                 method, path, port, body ? strlen(body) : 0, body ? body : "");
    if (n_request >= (int)sizeof request) return PAL_ERR_FULL;
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) return PAL_ERR_IO;
    pal_err err =
        connect(fd, (const struct sockaddr *)&to, sizeof to) && errno != EINPROGRESS ? PAL_ERR_IO : PAL_ERR_OK;
    if (!err && !send_all(fd, stop_fd, request, (size_t)n_request, end_ns)) err = PAL_ERR_IO;
    if (!err) err = receive_all(fd, stop_fd, out, &n, end_ns);
    close(fd);
    return err ? err : read_answer(out, n);
}
