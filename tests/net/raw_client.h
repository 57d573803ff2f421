/* A TCP client of a few lines for tests: it sends exactly the bytes given, well-formed or not, and reads websocket
 * frames one by one. Reading waits until there is something or the connection ends. */
#ifndef TESTS_NET_RAW_CLIENT_H
#define TESTS_NET_RAW_CLIENT_H
#include "tests/check.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/tcp.h>
#include <stdint.h>
#include <sys/socket.h>

typedef struct raw_frame {
    int opcode; /* 1 text, 2 binary, 8 close, 9 ping, 10 pong; -1: connection ended */
    size_t n;
    uint8_t bytes[1 << 20];
} raw_frame;

static inline int raw_connect(int port)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    int on = 1;
    inet_pton(AF_INET, "127.0.0.1", &to.sin_addr);
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    if (connect(fd, (struct sockaddr *)&to, sizeof to)) {
        close(fd);
        return -1;
    }
    return fd;
}

/* false: the connection has ended */
static inline bool raw_put(int fd, const void *bytes, size_t n)
{
    const char *at = bytes;
    while (n > 0) {
        ssize_t m = send(fd, at, n, MSG_NOSIGNAL);
        if (m <= 0) return false;
        at += m;
        n -= (size_t)m;
    }
    return true;
}

static inline void raw_send_text(int fd, const char *text)
{
    raw_put(fd, text, strlen(text));
}

/* up to n bytes; fewer at the end of the connection */
static inline size_t raw_get(int fd, void *bytes, size_t n)
{
    size_t at = 0;
    while (at < n) {
        ssize_t m = recv(fd, (char *)bytes + at, n - at, 0);
        if (m <= 0) break;
        at += (size_t)m;
    }
    return at;
}

/* reads what is left; true: the other side has ended the connection */
static inline bool raw_ended(int fd)
{
    char sink[4096];
    for (;;) {
        ssize_t m = recv(fd, sink, sizeof sink, 0);
        if (m == 0 || (m < 0 && errno == ECONNRESET)) return true;
        if (m < 0) return false;
    }
}

/* head of an HTTP answer, ended by the empty line; the status is the result, 0: none */
static inline int raw_head(int fd, char *head, size_t cap)
{
    size_t n = 0;
    int status = 0;
    while (n + 1 < cap && raw_get(fd, head + n, 1) == 1) {
        head[++n] = 0;
        if (n >= 4 && !memcmp(head + n - 4, "\r\n\r\n", 4)) break;
    }
    head[n] = 0;
    return sscanf(head, "HTTP/1.%*d %d", &status) == 1 ? status : 0;
}

/* one request on a connection of its own; body may be NULL */
static inline int raw_request(int port, const char *request, char *head, size_t cap, char *body, size_t body_cap,
                              size_t *n_body)
{
    int fd = raw_connect(port);
    raw_send_text(fd, request);
    int status = raw_head(fd, head, cap);
    size_t n = 0;
    char *length = strstr(head, "content-length:");
    if (body && length) {
        size_t want = (size_t)strtoull(length + 15, NULL, 10);
        n = raw_get(fd, body, want < body_cap ? want : body_cap);
    }
    if (n_body) *n_body = n;
    close(fd);
    return status;
}

static inline int raw_upgrade(int port, const char *path, const char *extra, char *head, size_t cap, int *status)
{
    char request[2048];
    int fd = raw_connect(port);
    snprintf(request, sizeof request,
             "GET %s HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
             "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n%s\r\n",
             path, port, extra);
    raw_send_text(fd, request);
    *status = raw_head(fd, head, cap);
    return fd;
}

/* a websocket frame with a payload shorter than 64 KiB; masked as a client must, or not */
static inline bool raw_send(int fd, int first_byte, const void *bytes, size_t n, bool masked)
{
    static const uint8_t mask[4] = {0x12, 0x34, 0x56, 0x78};
    uint8_t *out = malloc(n + 16);
    size_t at = 0;
    out[at++] = (uint8_t)first_byte;
    if (n < 126)
        out[at++] = (uint8_t)((masked ? 0x80 : 0) | n);
    else {
        out[at++] = masked ? 0xFE : 0x7E;
        out[at++] = (uint8_t)(n >> 8);
        out[at++] = (uint8_t)n;
    }
    if (masked) memcpy(out + at, mask, 4), at += 4;
    for (size_t i = 0; i < n; i++) out[at++] = ((const uint8_t *)bytes)[i] ^ (masked ? mask[i & 3] : 0);
    bool sent = raw_put(fd, out, at);
    free(out);
    return sent;
}

static inline bool raw_text(int fd, const char *text)
{
    return raw_send(fd, 0x81, text, strlen(text), true);
}

static inline raw_frame *raw_receive(int fd)
{
    static raw_frame f;
    uint8_t head[10];
    f.opcode = -1;
    f.n = 0;
    if (raw_get(fd, head, 2) != 2) return &f;
    size_t n = head[1] & 0x7F;
    size_t more = n == 126 ? 2 : n == 127 ? 8 : 0;
    if (raw_get(fd, head + 2, more) != more) return &f;
    if (more) n = 0;
    for (size_t i = 0; i < more; i++) n = n << 8 | head[2 + i];
    if (n > sizeof f.bytes || raw_get(fd, f.bytes, n) != n) return &f;
    f.n = n;
    f.opcode = head[0] & 0x0F;
    return &f;
}

/* reads until a frame of this opcode, at most 1000 frames; the close code for 8 */
static inline raw_frame *raw_until(int fd, int opcode)
{
    raw_frame *f = raw_receive(fd);
    for (int i = 0; i < 1000 && f->opcode != opcode && f->opcode >= 0; i++) f = raw_receive(fd);
    return f;
}

static inline int raw_close_code(int fd)
{
    raw_frame *f = raw_until(fd, 8);
    return f->opcode == 8 && f->n >= 2 ? f->bytes[0] << 8 | f->bytes[1] : 0;
}
#endif
