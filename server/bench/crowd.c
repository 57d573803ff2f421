#include "server/bench/crowd.h"

#include "protocol/asset.h"
#include "protocol/control.h"
#include "protocol/frame_codec.h"
#include "server/base/clock.h"
#include "server/base/hash.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

/* START: bytes of a payload that every viewer looks at. AT_ONCE: by a gate, below the connections of one address that
 * it lets wait before they join */
enum { START = 48, AT_ONCE = 12, EVENTS = 256, RECENT = 1024, MESSAGE_MAX = 1 << 22 };
enum { OP_TEXT = 1, OP_BINARY = 2, OP_CLOSE = 8, OP_PING = 9, OP_PONG = 10 };

typedef enum viewer_state { AWAY, UPGRADES, ENTERS, JOINED } viewer_state;

/* what only a viewer has that checks everything */
typedef struct whole {
    size_t n;
    uint32_t seq[PAL_WIRE_PART_MAX];
    uint8_t bytes[MESSAGE_MAX];
} whole;

typedef struct viewer {
    int fd, gate;
    viewer_state state;
    bool in_payload;
    uint8_t op, n_start, start[START]; /* of the header, then of the payload */
    uint64_t left;                     /* bytes of the payload */
    whole *whole;                      /* NULL: it reads heads alone */
} viewer;

typedef struct hall {
    bench_crowd *crowd;
    viewer *viewer;
    int n_entering, epoll;
    bool measures;
    uint64_t cpu_ns;
    uint32_t n_part;
    pal_frame_decoder *decoder[PAL_WIRE_PART_MAX]; /* NULL: no asset yet */
    float *position_m[PAL_WIRE_PART_MAX];
    struct {
        uint32_t seq;
        uint64_t hash;
    } seen[PAL_WIRE_PART_MAX][RECENT]; /* bytes of frames by their number */
} hall;

static uint64_t own_cpu_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

/* ---- sending: a client masks what it sends, here with zeros ---- */

static void send_frame(const viewer *v, uint8_t op, const void *payload, size_t n)
{
    uint8_t bytes[6 + 125] = {(uint8_t)(0x80 | op), (uint8_t)(0x80 | n)};
    if (n > 125) return;
    memcpy(bytes + 6, payload, n);
    (void)send(v->fd, bytes, 6 + n, MSG_NOSIGNAL | MSG_DONTWAIT);
}

static int connect_to(int port)
{
    const struct sockaddr_in to = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const int one = 1, fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return -1;
    if (connect(fd, (const struct sockaddr *)&to, sizeof to)) return close(fd), -1;
    (void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    return fd;
}

/* ---- checking in full ---- */

/* the body of GET; NULL: none. Blocks */
static uint8_t *get(int port, const char *path, size_t *n_byte)
{
    size_t n = 0, cap = 1 << 20;
    char request[256];
    uint8_t *bytes = malloc(cap), *body = NULL;
    const int fd = connect_to(port);
    snprintf(request, sizeof request, "GET %s HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nConnection: close\r\n\r\n", path, port);
    if (fd >= 0 && bytes) (void)send(fd, request, strlen(request), MSG_NOSIGNAL);
    for (ssize_t k = 1; fd >= 0 && bytes && k > 0;) {
        if (n == cap && !(bytes = realloc(bytes, cap *= 2))) return close(fd), NULL;
        k = recv(fd, bytes + n, cap - n, 0);
        if (k > 0) n += (size_t)k;
        const uint8_t *end = memmem(bytes, n, "\r\n\r\n", 4), *length = memmem(bytes, n, "content-length: ", 16);
        if (!end || !length || length > end) continue;
        *n_byte = strtoull((const char *)length + 16, NULL, 10);
        if (n < (size_t)(end + 4 - bytes) + *n_byte) continue;
        body = malloc(*n_byte + 1);
        if (body) memcpy(body, end + 4, *n_byte);
        break;
    }
    if (fd >= 0) close(fd);
    free(bytes);
    return body;
}

static bool fetch_part(hall *h, int port, const pal_wire_part_info *part, uint32_t p)
{
    size_t n = 0;
    char hash[PAL_ASSET_HASH_CHARS] = "";
    pal_asset *asset = NULL;
    uint8_t *bytes = get(port, part->asset, &n);
    if (bytes) pal_asset_hash(bytes, n, hash);
    const bool good = bytes && !strcmp(strrchr(part->asset, '/') + 1, hash) && !pal_asset_decode(bytes, n, &asset) &&
                      !pal_frame_decoder_create(asset, &h->decoder[p]) && asset->order->n_vertex == part->n_vertex;
    h->position_m[p] = malloc(sizeof(float) * 3 * (part->n_vertex + 1));
    pal_asset_destroy(asset);
    free(bytes);
    return good && h->position_m[p];
}

static bool check_text(hall *h, const viewer *v)
{
    static pal_control c;
    if (pal_control_get((const char *)v->whole->bytes, v->whole->n, true, &c)) return false;
    if (c.type != PAL_CONTROL_HELLO || h->n_part) return true;
    bool good = true;
    for (uint32_t p = 0; p < c.hello.n_part; p++)
        good = fetch_part(h, h->crowd->port[v->gate], &c.hello.part[p], p) && good;
    h->n_part = c.hello.n_part;
    return good;
}

/* Numbers grow, and whoever gets the frame of a number gets the same bytes, which are decoded when they come first */
static bool check_frame(hall *h, const viewer *v)
{
    const whole *w = v->whole;
    pal_frame_head head;
    if (pal_frame_get_head(w->bytes, w->n, &head) || head.part >= h->n_part) return false;
    const uint32_t p = head.part, at = head.seq % RECENT;
    const uint64_t hash = pal_hash_bytes(PAL_HASH_START, w->bytes, w->n);
    const bool grows = head.seq > v->whole->seq[p];
    v->whole->seq[p] = head.seq;
    if (h->seen[p][at].seq == head.seq) return grows && h->seen[p][at].hash == hash;
    h->seen[p][at].seq = head.seq, h->seen[p][at].hash = hash;
    return grows && !pal_frame_get(h->decoder[p], w->bytes, w->n, &head, h->position_m[p]);
}

static void check(hall *h, const viewer *v)
{
    pal_wire_head head;
    pal_wire_tools tools;
    bool good = true;
    if (v->op == OP_TEXT)
        good = check_text(h, v);
    else if (pal_wire_get_head(v->whole->bytes, v->whole->n, &head))
        good = false;
    else if (head.kind == PAL_WIRE_FRAME)
        good = check_frame(h, v);
    else if (head.kind == PAL_WIRE_TOOLS)
        good = !pal_wire_get_tools(v->whole->bytes, v->whole->n, &tools);
    h->crowd->n_checked += h->measures;
    h->crowd->n_bad += !good;
}

/* ---- what comes ---- */

static uint64_t little(const uint8_t *b, int n)
{
    uint64_t value = 0;
    while (n-- > 0) value = value << 8 | b[n];
    return value;
}

static void note_age(bench_crowd *c, uint64_t sim_us)
{
    const uint64_t tick = (uint64_t)llround(1e-6 * (double)sim_us / c->step_s);
    const uint64_t then = atomic_load_explicit(&c->published_ns[tick % CROWD_TICKS], memory_order_relaxed);
    const uint64_t now = pal_clock_ns(), age = now > then ? (now - then) / CROWD_AGE_NS : 0;
    c->n_frame++;
    c->n_age[age < CROWD_AGES ? age : CROWD_AGES - 1]++;
}

static void leave(hall *h, viewer *v)
{
    if (v->state == UPGRADES || v->state == ENTERS) h->n_entering--;
    if (v->state == JOINED) atomic_fetch_sub(&h->crowd->n_joined, 1), h->crowd->n_lost++;
    close(v->fd);
    v->state = AWAY, v->in_payload = false, v->n_start = 0;
    if (v->whole) memset(v->whole->seq, 0, sizeof v->whole->seq); /* it begins with a frame that it may have had */
}

/* a whole message; false: the connection ends */
static bool message(hall *h, viewer *v)
{
    bench_crowd *c = h->crowd;
    if (v->op == OP_CLOSE) return false;
    if (v->op == OP_PING) send_frame(v, OP_PONG, v->start, v->n_start);
    if (v->op == OP_TEXT && v->state == ENTERS) {
        v->state = JOINED;
        h->n_entering--;
        atomic_fetch_add(&c->n_joined, 1);
    }
    if (v->whole && (v->op == OP_TEXT || v->op == OP_BINARY)) check(h, v);
    if (v->op != OP_BINARY || v->n_start < 24) return true;
    if (v->start[4] == PAL_WIRE_FRAME && h->measures) note_age(c, little(v->start + 16, 8));
    if (v->start[4] == PAL_WIRE_TOOLS) {
        uint8_t ack[PAL_WIRE_ACK_BYTES];
        (void)pal_wire_put_ack(ack, sizeof ack, &(pal_wire_ack){.cycle = (uint32_t)little(v->start + 8, 4)});
        send_frame(v, OP_BINARY, ack, sizeof ack);
        c->n_cycle += h->measures;
    }
    return true;
}

/* one more byte of a header, which is whole then or not */
static void take_header(viewer *v, uint8_t byte)
{
    v->start[v->n_start++] = byte;
    if (v->n_start < 2) return;
    const int n_length = v->start[1] == 126 ? 2 : v->start[1] == 127 ? 8 : 0;
    if (v->n_start < 2 + n_length) return;
    v->left = v->start[1];
    if (n_length) v->left = 0;
    for (int i = 0; i < n_length; i++) v->left = v->left << 8 | v->start[2 + i];
    v->op = v->start[0] & 15;
    v->in_payload = true, v->n_start = 0;
    if (v->whole) v->whole->n = 0;
}

static bool feed(hall *h, viewer *v, const uint8_t *bytes, size_t n)
{
    while (n > 0 || (v->in_payload && v->left == 0)) {
        if (!v->in_payload) {
            take_header(v, *bytes++), n--;
            continue;
        }
        const size_t taken = n < v->left ? n : v->left, rest = (size_t)(START - v->n_start);
        const size_t kept = taken < rest ? taken : rest;
        memcpy(v->start + v->n_start, bytes, kept);
        v->n_start = (uint8_t)(v->n_start + kept);
        if (v->whole && taken <= MESSAGE_MAX - v->whole->n) {
            memcpy(v->whole->bytes + v->whole->n, bytes, taken);
            v->whole->n += taken;
        }
        bytes += taken, n -= taken, v->left -= taken;
        if (v->left) continue;
        if (!message(h, v)) return false;
        v->in_payload = false, v->n_start = 0;
    }
    return true;
}

/* the answer to the upgrade is read to its end and no further. false: the connection ends */
static bool take_upgrade(viewer *v)
{
    static const char join[] = "{\"type\":\"join\",\"name\":\"viewer\",\"role\":\"viewer\",\"tool\":null}";
    char answer[2048];
    const ssize_t n = recv(v->fd, answer, sizeof answer, MSG_PEEK | MSG_DONTWAIT);
    if (n < 0 && errno == EAGAIN) return true;
    if (n <= 0) return false;
    const char *end = memmem(answer, (size_t)n, "\r\n\r\n", 4);
    if (!end) return n < (ssize_t)sizeof answer;
    if (recv(v->fd, answer, (size_t)(end + 4 - answer), 0) <= 0 || strncmp(answer, "HTTP/1.1 101", 12)) return false;
    send_frame(v, OP_TEXT, join, sizeof join - 1);
    v->state = ENTERS;
    return true;
}

static bool take(hall *h, viewer *v)
{
    static uint8_t bytes[1 << 18];
    if (v->state == UPGRADES && (!take_upgrade(v) || v->state == UPGRADES)) return v->state == UPGRADES;
    const ssize_t n = recv(v->fd, bytes, sizeof bytes, MSG_DONTWAIT);
    if (n < 0 && errno == EAGAIN) return true;
    if (n <= 0) return false;
    if (h->measures) h->crowd->n_byte += (uint64_t)n;
    return feed(h, v, bytes, (size_t)n);
}

/* ---- coming ---- */

static void enter(hall *h, viewer *v)
{
    char request[256];
    const int port = h->crowd->port[v->gate];
    struct epoll_event event = {.events = EPOLLIN, .data.ptr = v};
    v->fd = connect_to(port);
    if (v->fd < 0) return;
    snprintf(request, sizeof request,
             "GET /ws HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
             "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
             "Sec-WebSocket-Protocol: %s\r\n\r\n",
             port, PAL_PROTOCOL_NAME);
    (void)send(v->fd, request, strlen(request), MSG_NOSIGNAL);
    if (epoll_ctl(h->epoll, EPOLL_CTL_ADD, v->fd, &event)) {
        close(v->fd);
        return;
    }
    v->state = UPGRADES;
    h->n_entering++;
}

static void follow(hall *h)
{
    bench_crowd *c = h->crowd;
    struct epoll_event event[EVENTS];
    int next = 0;
    for (int phase; (phase = atomic_load(&c->phase)) != CROWD_LEAVES;) {
        if (phase == CROWD_MEASURES && !h->measures) h->measures = true, h->cpu_ns = own_cpu_ns();
        for (int i = 0; phase == CROWD_JOINS && i < c->n_viewer && h->n_entering < AT_ONCE * c->n_gate; i++) {
            next = (next + 1) % c->n_viewer;
            if (h->viewer[next].state == AWAY) enter(h, &h->viewer[next]);
        }
        const int n = epoll_wait(h->epoll, event, EVENTS, phase == CROWD_WAITS ? 10 : 2);
        for (int i = 0; i < n; i++)
            if (!take(h, event[i].data.ptr)) leave(h, event[i].data.ptr);
    }
    c->cpu_ns = own_cpu_ns() - h->cpu_ns;
}

static void crowd_main(bench_crowd *c)
{
    static hall h;
    const struct rlimit files = {(rlim_t)c->n_viewer + 64, (rlim_t)c->n_viewer + 64};
    h = (hall){.crowd = c, .epoll = epoll_create1(0), .viewer = calloc((size_t)c->n_viewer, sizeof *h.viewer)};
    (void)setrlimit(RLIMIT_NOFILE, &files);
    if (!h.viewer || h.epoll < 0) return;
    while (atomic_load(&c->phase) == CROWD_WAITS) pal_clock_sleep_until_ns(pal_clock_ns() + 10000000);
    for (int i = 0; i < c->n_viewer; i++) {
        h.viewer[i].gate = i % c->n_gate;
        if (i / c->n_gate % CROWD_CHECKED == 0) h.viewer[i].whole = calloc(1, sizeof(whole));
    }
    follow(&h);
}

bench_crowd *bench_crowd_create(void)
{
    bench_crowd *c = mmap(NULL, sizeof *c, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    return c == MAP_FAILED ? NULL : memset(c, 0, sizeof *c);
}

void bench_crowd_destroy(bench_crowd *crowd)
{
    if (crowd) munmap(crowd, sizeof *crowd);
}

pid_t bench_crowd_start(bench_crowd *crowd)
{
    const pid_t id = fork();
    if (id) return id;
    crowd_main(crowd);
    _exit(0);
}

double bench_crowd_age_ms(const bench_crowd *crowd, double share)
{
    uint64_t n = 0;
    for (int i = 0; i < CROWD_AGES && crowd->n_frame; i++)
        if ((double)(n += crowd->n_age[i]) >= share * (double)crowd->n_frame) return 1e-6 * CROWD_AGE_NS * (i + 1);
    return NAN;
}
