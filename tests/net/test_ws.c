/* The websocket transport over real sockets: who may upgrade, what HTTP serves, and hostile, slow and silent peers. */
#include "protocol/asset.h"
#include "protocol/control.h"
#include "protocol/frame_codec.h"
#include "server/net/server.h"
#include "tests/net/hub_scene.h"
#include "tests/net/raw_client.h"

#include <pthread.h>

#define JOIN    "{\"type\":\"join\",\"name\":\"Ada\",\"role\":\"trainee\",\"tool\":-1}"
#define WATCH   "{\"type\":\"join\",\"name\":\"Vera\",\"role\":\"viewer\",\"tool\":null}"
#define PALPATE "Sec-WebSocket-Protocol: palpate.v2\r\n"

static small_scene organ;
static pal_session *session;
static pal_server *server;
static pal_server_gate gate;
static pthread_t net;
static int port;
static char folder[] = "/tmp/palpate_ws_XXXXXX";
static char head[8192];
enum { LARGE = 400001 };

static void *net_main(void *user)
{
    pal_err *err = user;
    *err = pal_server_run(server);
    return NULL;
}

static pal_err net_err;

static void begin(pal_server_options net_options)
{
    pal_diagnostic diag = {""};
    pal_session_options options = {.lease_s = 60, .wake = pal_server_gate_wake, .user = &gate};
    net_options.viewer_folder = folder;
    net_options.open = true;
    if (pal_session_open(&organ.scene, &options, &diag, &session)) CHECK_FAIL("no session: %s", diag.text);
    if (pal_server_open(&net_options, &session, 1, &diag, &server)) {
        CHECK_FAIL("no server: %s", diag.text);
        exit(1);
    }
    pal_server_connect(server, &gate);
    port = pal_server_port(server);
    pthread_create(&net, NULL, net_main, &net_err);
}

static void end(void)
{
    pal_server_stop(server);
    pthread_join(net, NULL);
    CHECK_INT(net_err, PAL_ERR_OK);
    pal_server_close(server);
    pal_session_close(session);
}

static int get(const char *path, const char *extra, char *body, size_t cap, size_t *n)
{
    char request[1024];
    snprintf(request, sizeof request, "GET %s HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n%s\r\n", path, port, extra);
    return raw_request(port, request, head, sizeof head, body, cap, n);
}

static int joined(const char *join)
{
    int status, fd = raw_upgrade(port, "/ws", PALPATE, head, sizeof head, &status);
    CHECK_INT(status, 101);
    raw_text(fd, join);
    return fd;
}

/* what took a socket out of the time limits of libwebsockets: an upgrade to HTTP/2, also as a second request, and a
 * tunnel */
#define H2C                                                                                                            \
    "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade, HTTP2-Settings\r\nUpgrade: h2c\r\n"                     \
    "HTTP2-Settings: AAMAAABkAAQCAAAAAAIAAAAA\r\n\r\n"
static const char *const held_by[] = {H2C, "GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" H2C,
                                      "CONNECT /metrics HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"};
enum { HELD = sizeof held_by / sizeof *held_by };

static bool still_serves(void)
{
    return get("/healthz", "", NULL, 0, NULL) == 200;
}

static void upgrade_needs_the_subprotocol_the_path_and_the_own_origin(void)
{
    char own[128];
    snprintf(own, sizeof own, PALPATE "Origin: http://127.0.0.1:%d\r\n", port);
    const struct {
        const char *path, *extra;
        int status; /* 0: closed without an answer, which is how the library refuses an unknown name */
    } kind[] = {{"/ws", PALPATE, 101},
                {"/ws?session=small", PALPATE, 101},
                {"/ws", own, 101},
                {"/ws", "Sec-WebSocket-Protocol: chat, palpate.v2\r\n", 101},
                {"/ws", "", 403},
                {"/ws", "Sec-WebSocket-Protocol: palpate.v1\r\n", 0},
                {"/ws", "Sec-WebSocket-Protocol: http\r\n", 403},
                {"/ws", "Sec-WebSocket-Protocol: palpate-listen\r\n", 403},
                {"/", PALPATE, 403},
                {"/wss", PALPATE, 403},
                {"/ws", PALPATE "Origin: http://evil.example\r\n", 403},
                {"/ws", PALPATE "Origin: null\r\n", 403},
                {"/ws", PALPATE "Origin: http://127.0.0.1\r\n", 403}};
    for (size_t i = 0; i < sizeof kind / sizeof *kind; i++) {
        int status, fd = raw_upgrade(port, kind[i].path, kind[i].extra, head, sizeof head, &status);
        check_count++;
        if (status != kind[i].status)
            CHECK_FAIL("%s with \"%.60s\": status %d, wanted %d", kind[i].path, kind[i].extra, status, kind[i].status);
        if (status == 101) CHECK(strstr(head, "palpate.v2") && !strstr(head, "permessage-deflate"));
        if (status != 101) CHECK(raw_ended(fd));
        close(fd);
    }
    /* a foreign name that resolves to this machine */
    int fd = raw_connect(port);
    raw_send_text(
        fd, "GET /ws HTTP/1.1\r\nHost: evil.example\r\nOrigin: http://evil.example\r\nConnection: Upgrade\r\n"
            "Upgrade: websocket\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n" PALPATE
            "\r\n");
    CHECK_INT(raw_head(fd, head, sizeof head), 403);
    close(fd);
    CHECK(still_serves());
}

static void session_is_named_in_the_address(void)
{
    int status, fd = raw_upgrade(port, "/ws?session=small", PALPATE, head, sizeof head, &status);
    raw_text(fd, WATCH);
    raw_frame *f = raw_receive(fd);
    CHECK(f->opcode == 1 && strstr((char *)f->bytes, "\"session\":\"small\""));
    close(fd);
    fd = raw_upgrade(port, "/ws?session=nobody", PALPATE, head, sizeof head, &status);
    CHECK_INT(raw_close_code(fd), PAL_WIRE_CLOSE_NO_SESSION);
    close(fd);
}

static void deflate_is_never_agreed_on(void)
{
    int status, fd = raw_upgrade(port, "/ws", PALPATE "Sec-WebSocket-Extensions: permessage-deflate\r\n", head,
                                 sizeof head, &status);
    CHECK_INT(status, 101);
    CHECK(strcasestr(head, "extensions") == NULL);
    close(fd);
}

static void other_upgrades_leave_the_server_well(void)
{
    static const char *const wanted[] = {"h2c", "H2C", "TLS/1.0", "websocket, h2c", "", "nonsense"};
    /* 403: the library's own, for what it does not know; an empty one is no upgrade */
    static const int status[] = {400, 400, 403, 403, 200, 403};
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++) {
        char request[512];
        snprintf(request, sizeof request,
                 "GET / HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nConnection: Upgrade, HTTP2-Settings\r\nUpgrade: %s\r\n"
                 "HTTP2-Settings: AAMAAABkAAQCAAAAAAIAAAAA\r\n\r\n",
                 port, wanted[i]);
        int fd = raw_connect(port);
        raw_send_text(fd, request);
        CHECK_INT(raw_head(fd, head, sizeof head), status[i]);
        if (status[i] != 200) CHECK(raw_ended(fd));
        raw_send_text(fd, "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n");
        CHECK(still_serves());
        close(fd);
    }
    /* as a second request, and a tunnel */
    char body[8];
    int fd = raw_connect(port);
    raw_send_text(fd, held_by[1]);
    CHECK_INT(raw_head(fd, head, sizeof head), 200);
    CHECK_INT(raw_get(fd, body, 3), 3);
    CHECK_INT(raw_head(fd, head, sizeof head), 400);
    CHECK(raw_ended(fd));
    close(fd);
    fd = raw_connect(port);
    raw_send_text(fd, held_by[2]);
    CHECK_INT(raw_head(fd, head, sizeof head), 400);
    CHECK(raw_ended(fd));
    close(fd);
}

static void files_have_type_tag_and_policy(void)
{
    char body[4096], tag[64] = "", extra[128];
    size_t n = 0;
    CHECK_INT(get("/", "", body, sizeof body, &n), 200);
    CHECK(n == 9 && !memcmp(body, "<p>hello\n", 9));
    CHECK(strstr(head, "content-type: text/html; charset=utf-8\r\n"));
    CHECK(strstr(head, "x-content-type-options: nosniff\r\n") && strstr(head, "referrer-policy: no-referrer\r\n"));
    CHECK(strstr(head, "content-security-policy: default-src 'self'; connect-src 'self' ws://127.0.0.1:"));
    CHECK(!strstr(head, "unsafe-inline") && strstr(head, "worker-src 'self'") && strstr(head, "img-src 'self' data:"));
    char *at = strstr(head, "etag: ");
    REQUIRE(at);
    sscanf(at, "etag: %63s", tag);
    snprintf(extra, sizeof extra, "If-None-Match: %s\r\n", tag);
    CHECK_INT(get("/index.html", extra, body, sizeof body, &n), 304);
    CHECK(strstr(head, tag));
    CHECK_INT(get("/code.mjs", "If-None-Match: \"other\"\r\n", body, sizeof body, &n), 200);
    CHECK(strstr(head, "content-type: text/javascript; charset=utf-8\r\n"));
    CHECK_INT(get("/module.wasm", "", NULL, 0, NULL), 200);
    CHECK(strstr(head, "content-type: application/wasm\r\n"));
    CHECK_INT(get("/no-such.js", "", NULL, 0, NULL), 404);
    CHECK_INT(get("/../../../../etc/passwd", "", NULL, 0, NULL), 404);
    CHECK_INT(get("/%2e%2e/%2e%2e/etc/passwd", "", NULL, 0, NULL), 404);
    CHECK_INT(get("/.secret.html", "", NULL, 0, NULL), 404);
    CHECK_INT(raw_request(port, "GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n", head, sizeof head, NULL, 0, NULL), 403);
    CHECK_INT(
        raw_request(port, "GET / HTTP/1.1\r\nHost: 127.0.0.1\"><script>\r\n\r\n", head, sizeof head, NULL, 0, NULL),
        403);
    CHECK_INT(raw_request(port, "DELETE / HTTP/1.1\r\nHost: localhost\r\n\r\n", head, sizeof head, NULL, 0, NULL), 405);
    CHECK_INT(raw_request(port, "HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\n", head, sizeof head, NULL, 0, NULL), 200);
    CHECK(strstr(head, "content-length: 9\r\n"));
}

static void one_connection_serves_many_requests(void)
{
    char request[256], body[16];
    int fd = raw_connect(port);
    snprintf(request, sizeof request, "GET / HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n\r\n", port);
    for (int i = 0; i < 20; i++) {
        raw_send_text(fd, request);
        CHECK_INT(raw_head(fd, head, sizeof head), 200);
        CHECK_INT(raw_get(fd, body, 9), 9);
    }
    close(fd);
}

static void large_file_arrives_whole_at_a_slow_reader(void)
{
    char request[256];
    static uint8_t piece[8192];
    int fd = raw_connect(port), small = 16384;
    size_t at = 0, wrong = 0;
    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    snprintf(request, sizeof request, "GET /large.bin HTTP/1.1\r\nHost: localhost:%d\r\n\r\n", port);
    raw_send_text(fd, request);
    CHECK_INT(raw_head(fd, head, sizeof head), 200);
    while (at < LARGE) {
        size_t n = raw_get(fd, piece, at + sizeof piece < LARGE ? sizeof piece : LARGE - at);
        if (n == 0) break;
        for (size_t i = 0; i < n; i++) wrong += piece[i] != (uint8_t)((at + i) * 2654435761u >> 13);
        at += n;
    }
    CHECK_INT(at, LARGE);
    CHECK_INT(wrong, 0);
    /* and the connection goes on */
    raw_send_text(fd, "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    CHECK_INT(raw_head(fd, head, sizeof head), 200);
    close(fd);
}

static void pages_tell_health_sessions_and_figures(void)
{
    static char body[32768];
    size_t n = 0;
    CHECK_INT(get("/healthz", "", body, sizeof body, &n), 200);
    /* paused, it is no slower than real time on any machine */
    CHECK_INT(pal_session_command(session, &(pal_command){.kind = PAL_COMMAND_PAUSE}), PAL_ERR_OK);
    do {
        CHECK_INT(get("/sessions", "", body, sizeof body - 1, &n), 200);
        body[n] = 0;
    } while (!strstr(body, "\"state\":\"paused\""));
    CHECK_INT(get("/readyz", "", NULL, 0, NULL), 200);
    CHECK_INT(pal_session_command(session, &(pal_command){.kind = PAL_COMMAND_RESUME}), PAL_ERR_OK);
    CHECK(strstr(body, "\"name\":\"small\",\"title\":\"Small \\\"organ\\\"\",\"accuracy\":\"2 % of \\\"truth\\\"\""));
    CHECK_INT(get("/metrics", "", body, sizeof body - 1, &n), 200);
    body[n] = 0;
    CHECK(strstr(body, "\npalpate_sessions 1\n") && strstr(body, "# TYPE palpate_inputs_total counter\n"));
    CHECK(n > 0 && body[n - 1] == '\n');
}

static int list(void *user, char (*name)[PAL_NAME], int max)
{
    (void)user;
    snprintf(name[0], PAL_NAME, "other.json");
    return max > 0;
}
static pal_err cannot_open(void *user, const char *scene, const char *name, pal_diagnostic *diag,
                           pal_opened_session *out)
{
    (void)user, (void)name, (void)out;
    return PAL_REFUSE(diag, "%s: not there", scene);
}
static void keeps_nothing(void *user, void *keep)
{
    (void)user, (void)keep;
}
static const pal_session_source source = {NULL, list, cannot_open, keeps_nothing};

#define JSON "Content-Type: application/json\r\n"

/* A POST to /sessions with these headers and this body, in two packets when it is split; its status. Every refusal
 * says why in JSON */
static int post(const char *extra, const char *body, size_t split)
{
    char request[4096];
    size_t at = (size_t)snprintf(request, sizeof request, "POST /sessions HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n%s\r\n",
                                 port, extra);
    int fd = raw_connect(port);
    memcpy(request + at, body, strlen(body));
    const size_t n = at + strlen(body);
    raw_put(fd, request, split ? split : n);
    if (split) raw_put(fd, request + split, n - split);
    const int status = raw_head(fd, head, sizeof head);
    const char *length = strstr(head, "content-length: ");
    char answer[400] = "";
    (void)raw_get(fd, answer, length && atoi(length + 16) < 400 ? (size_t)atoi(length + 16) : 0);
    CHECK(strstr(head, "content-type: application/json") && strstr(answer, status < 300 ? "session" : "{\"error\":\""));
    close(fd);
    return status;
}

static void sessions_are_opened_by_json_of_the_own_site(void)
{
    static const char body[] = "{\"open\":\"other.json\"}", bad[] = "{\"open\":\"nothing\"}";
    static char much[2000];
    char extra[400];
    memset(much, ' ', sizeof much - 1);
    snprintf(extra, sizeof extra, JSON "Content-Length: %zu\r\n", sizeof body - 1);
    CHECK_INT(post(extra, body, 0), 202);
    CHECK(strstr(head, "content-security-policy"));
    snprintf(extra, sizeof extra, JSON "Content-Length: %zu\r\n", sizeof bad - 1);
    CHECK_INT(post(extra, bad, 0), 404);
    /* in two packets, cut anywhere */
    for (size_t split = 1; split < 120; split += 13) CHECK_INT(post(extra, bad, split), 404);
    /* a page of another site: its own Origin, a body that it may send unasked, or both names */
    snprintf(extra, sizeof extra, JSON "Origin: http://evil.example\r\nContent-Length: %zu\r\n", sizeof bad - 1);
    CHECK_INT(post(extra, bad, 0), 403);
    snprintf(extra, sizeof extra, JSON "Origin: http://127.0.0.1:%d\r\nContent-Length: %zu\r\n", port, sizeof bad - 1);
    CHECK_INT(post(extra, bad, 0), 404);
    snprintf(extra, sizeof extra, "Content-Type: text/plain\r\nContent-Length: %zu\r\n", sizeof bad - 1);
    CHECK_INT(post(extra, bad, 0), 415);
    snprintf(extra, sizeof extra, "Content-Length: %zu\r\n", sizeof bad - 1);
    CHECK_INT(post(extra, bad, 0), 415);
    CHECK_INT(post(JSON, bad, 0), 411);
    CHECK_INT(post(JSON "Content-Length: 1999\r\n", much, 0), 413);
    CHECK_INT(post(JSON "Content-Length: 99999999999999999999\r\n", bad, 0), 413);
    CHECK_INT(post(JSON "Content-Length: -1\r\n", bad, 0), 413);
    CHECK_INT(post(JSON "Content-Length: 5\r\nAuthorization: Basic YTpi\r\n", "{}   ", 0), 401);
    CHECK_INT(post(JSON "Content-Length: 5\r\nAuthorization: Bearer AAAA\r\n", "{}   ", 0), 422);
    /* announced, and never sent: it is closed, and others are served meanwhile */
    int fd = raw_connect(port);
    snprintf(extra, sizeof extra,
             "POST /sessions HTTP/1.1\r\nHost: 127.0.0.1:%d\r\n" JSON "Content-Length: 500\r\n\r\n{", port);
    raw_send_text(fd, extra);
    CHECK(still_serves());
    close(fd);
}

/* a histogram's last bucket is its count, and no bucket is smaller than the one before */
static void steps_are_counted_by_their_time(void)
{
    static char body[40000];
    size_t n = 0;
    unsigned long long before = 0, bucket = 0, count = 0;
    int n_bucket = 0;
    CHECK_INT(get("/metrics", "", body, sizeof body - 1, &n), 200);
    body[n] = 0;
    for (char *at = body; (at = strstr(at, "by_session_bucket{session=\"0\",le=")); at++, n_bucket++) {
        CHECK_INT(sscanf(strchr(at, '}'), "} %llu", &bucket), 1);
        CHECK(bucket >= before);
        before = bucket;
    }
    CHECK_INT(n_bucket, PAL_STEP_BOUNDS + 1);
    char *at = strstr(body, "by_session_count{session=\"0\"} ");
    REQUIRE(at);
    CHECK_INT(sscanf(strchr(at, '}'), "} %llu", &count), 1);
    CHECK(count > 0 && count == bucket);
}

static void a_client_sees_the_asset_and_frames_of_it(void)
{
    static pal_control hello;
    static char body[1 << 22];
    pal_asset *asset = NULL;
    pal_frame_decoder *decoder = NULL;
    pal_frame_head frame;
    pal_wire_tools tools;
    size_t n = 0;
    char hash[PAL_ASSET_HASH_CHARS], path[80];
    int fd = joined(JOIN), n_cycle = 0;
    raw_frame *f = raw_receive(fd);
    REQUIRE(f->opcode == 1 && pal_control_get((char *)f->bytes, f->n, true, &hello) == 0);
    REQUIRE(hello.type == PAL_CONTROL_HELLO);
    CHECK_INT(get(hello.hello.part[0].asset, "", body, sizeof body, &n), 200);
    CHECK(strstr(head, "cache-control: public, max-age=31536000, immutable\r\n"));
    pal_asset_hash((uint8_t *)body, n, hash);
    snprintf(path, sizeof path, "/asset/%s", hash);
    CHECK_TEXT(hello.hello.part[0].asset, path);
    REQUIRE(pal_asset_decode((uint8_t *)body, n, &asset) == 0);
    REQUIRE(pal_frame_decoder_create(asset, &decoder) == 0);
    while (n_cycle < 20) {
        pal_wire_head h;
        f = raw_receive(fd);
        REQUIRE(f->opcode == 1 || f->opcode == 2);
        if (f->opcode == 1) continue;
        REQUIRE(pal_wire_get_head(f->bytes, f->n, &h) == 0);
        if (h.kind == PAL_WIRE_FRAME) CHECK_INT(pal_frame_get(decoder, f->bytes, f->n, &frame, NULL), 0);
        if (h.kind != PAL_WIRE_TOOLS) continue;
        REQUIRE(pal_wire_get_tools(f->bytes, f->n, &tools) == 0);
        uint8_t ack[PAL_WIRE_ACK_BYTES];
        pal_wire_put_ack(ack, sizeof ack, &(pal_wire_ack){.cycle = tools.cycle});
        raw_send(fd, 0x82, ack, sizeof ack, true);
        n_cycle++;
    }
    /* a pose comes back as an echo */
    pal_wire_pose pose = {.tool = (uint16_t)hello.hello.you_tool, .seq = 5, .stamp_us = 77, .quaternion = {1, 0, 0, 0}};
    uint8_t bytes[PAL_WIRE_POSE_BYTES];
    pose.position_m[2] = 0.4;
    pal_wire_put_pose(bytes, sizeof bytes, &pose);
    raw_send(fd, 0x82, bytes, sizeof bytes, true);
    bool echoed = false;
    for (int i = 0; i < 400 && !echoed; i++) {
        f = raw_until(fd, 2);
        if (pal_wire_get_tools(f->bytes, f->n, &tools)) continue;
        uint8_t ack[PAL_WIRE_ACK_BYTES];
        pal_wire_put_ack(ack, sizeof ack, &(pal_wire_ack){.cycle = tools.cycle});
        raw_send(fd, 0x82, ack, sizeof ack, true);
        echoed = tools.tool[pose.tool].echo_stamp_us == 77;
    }
    CHECK(echoed);
    close(fd);
    pal_frame_decoder_destroy(decoder);
    pal_asset_destroy(asset);
}

static void bad_messages_are_closed_with_a_code(void)
{
    static char long_one[5000];
    uint8_t noise[300];
    int fd = joined(JOIN);
    memset(long_one, ' ', sizeof long_one);
    raw_send(fd, 0x81, long_one, sizeof long_one, true);
    CHECK_INT(raw_close_code(fd), PAL_WIRE_CLOSE_TOO_BIG);
    close(fd);
    /* the same in fragments, each of them short */
    fd = joined(WATCH);
    raw_send(fd, 0x01, long_one, 2000, true);
    raw_send(fd, 0x00, long_one, 2000, true);
    raw_send(fd, 0x80, long_one, 1000, true);
    CHECK_INT(raw_close_code(fd), PAL_WIRE_CLOSE_TOO_BIG);
    close(fd);
    for (size_t i = 0; i < sizeof noise; i++) noise[i] = (uint8_t)(i * 37 + 11);
    fd = joined(WATCH);
    raw_send(fd, 0x82, noise, sizeof noise, true);
    CHECK_INT(raw_close_code(fd), PAL_WIRE_CLOSE_PROTOCOL);
    close(fd);
    /* the library takes unmasked frames; what they say is still checked */
    fd = joined(WATCH);
    raw_send(fd, 0x82, noise, sizeof noise, false);
    CHECK_INT(raw_close_code(fd), PAL_WIRE_CLOSE_PROTOCOL);
    close(fd);
    /* reserved bits and opcodes, and bytes that are no frames at all */
    for (int kind = 0; kind < 4; kind++) {
        static const uint8_t first[] = {0xF2, 0x83, 0x8B, 0xC1};
        fd = joined(WATCH);
        raw_send(fd, first[kind], noise, 120, true);
        CHECK_INT(raw_close_code(fd), PAL_WIRE_CLOSE_PROTOCOL);
        close(fd);
    }
    fd = joined(WATCH);
    raw_put(fd, noise, sizeof noise);
    close(fd);
    CHECK(still_serves());
}

static void flood_closes_the_flooder_alone(void)
{
    static char body[32768];
    size_t n = 0;
    int good = joined(WATCH), fd = joined(JOIN);
    /* the kernel resets a connection whose input nobody reads, which may lose the code of the close: test_hub has it */
    while (raw_text(fd, "{\"type\":\"release_tool\"}")) continue;
    close(fd);
    CHECK_INT(get("/metrics", "", body, sizeof body - 1, &n), 200);
    body[n] = 0;
    CHECK(strstr(body, "palpate_inputs_rejected_total{reason=\"rate\"} 1\n"));
    raw_text(good, "{\"type\":\"ping\",\"stamp_ms\":3}");
    bool answered = false;
    for (int i = 0; i < 200 && !answered; i++) {
        raw_frame *f = raw_receive(good);
        answered = f->opcode == 1 && strstr((char *)f->bytes, "\"pong\"");
    }
    CHECK(answered);
    close(good);
}

enum { CROWD = 150 };
static int crowd[CROWD];

static int held[HELD];

static void half_open_connections_keep_nobody_out(void)
{
    for (int i = 0; i < CROWD; i++) {
        crowd[i] = raw_connect(port);
        if (i % 3 == 1) raw_send_text(crowd[i], "GET / HTTP/1.1\r\nHost: 127.");
        if (i % 3 == 2) raw_send_text(crowd[i], "\x16\x03\x01\x02\x00\x01garbage\r\n\r\n");
    }
    for (size_t i = 0; i < HELD; i++) raw_send_text(held[i] = raw_connect(port), held_by[i]);
    CHECK(still_serves());
    int client = joined(WATCH);
    CHECK_INT(raw_until(client, 2)->opcode, 2);
    close(client);
}

static void half_open_connections_are_closed_by_the_server(void)
{
    CHECK(raw_ended(crowd[0]));
    CHECK(raw_ended(crowd[1]));
    for (size_t i = 0; i < HELD; i++) {
        if (!raw_ended(held[i])) CHECK_FAIL("still open after \"%.20s\"", held_by[i]);
        close(held[i]);
    }
    for (int i = 0; i < CROWD; i++) close(crowd[i]);
}

static void address_and_port_are_refused_with_a_sentence(void)
{
    pal_diagnostic diag = {""};
    pal_server *second = NULL;
    pal_server_options options = {.port = port};
    CHECK_INT(pal_server_open(&options, &session, 1, &diag, &second), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "in use") && strstr(diag.text, "--port"));
    options = (pal_server_options){.listen = "0.0.0.0"};
    CHECK_INT(pal_server_open(&options, &session, 1, &diag, &second), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "--allow-remote"));
    options = (pal_server_options){.listen = "not an address", .allow_remote = true};
    CHECK_INT(pal_server_open(&options, &session, 1, &diag, &second), PAL_ERR_REFUSED);
    /* what is no address is told so, and where a port goes */
    static const char *const no_address[] = {"127.0.0.1:19011", "localhost:80", "[::1]", "not an address"};
    for (int i = 0; i < 4; i++) {
        options = (pal_server_options){.listen = no_address[i]};
        CHECK_INT(pal_server_open(&options, &session, 1, &diag, &second), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, "--listen") == diag.text && strstr(diag.text, no_address[i]));
        CHECK(strstr(diag.text, "--port") && !strstr(diag.text, "other machines"));
    }
    options = (pal_server_options){.viewer_folder = "/no/such/folder"};
    CHECK_INT(pal_server_open(&options, &session, 1, &diag, &second), PAL_ERR_IO);
    CHECK(second == NULL);
}

/* a name that is not known may be a stranger's page whose name was made to lead here */
static void other_machines_come_by_address_or_by_a_listed_name(void)
{
    char own[256] = "";
    REQUIRE(!gethostname(own, sizeof own - 1));
    const struct {
        const char *host;
        int status;
    } kind[] = {{"127.0.0.1", 200},
                {"localhost:8090", 200},
                {"192.168.1.5:8090", 200},
                {"[fe80::1]:8090", 200},
                {"[::1]", 200},
                {"organ.example", 200},
                {"ORGAN.example:443", 200},
                {"station", 200},
                {own, 200},
                {"evil.example", 403},
                {"evil.example:8090", 403},
                {"organ.example.evil.example", 403},
                {"organ.exampl", 403},
                {"organ.example,station", 403},
                {"[::1]evil:9401", 403},
                {"[evil.example]", 403},
                {"127.0.0.1.evil.example", 403},
                {"localhost:80x", 403},
                {"localhost:", 403},
                {"[::1", 403},
                {":80", 403}};
    for (size_t i = 0; i < sizeof kind / sizeof *kind; i++) {
        char request[512];
        snprintf(request, sizeof request, "GET / HTTP/1.1\r\nHost: %s\r\n\r\n", kind[i].host);
        const int status = raw_request(port, request, head, sizeof head, NULL, 0, NULL);
        check_count++;
        if (status != kind[i].status) CHECK_FAIL("%s: status %d, wanted %d", kind[i].host, status, kind[i].status);
    }
    char body[1024] = "";
    size_t n = 0;
    CHECK_INT(
        raw_request(port, "GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n", head, sizeof head, body, sizeof body - 1, &n),
        403);
    CHECK(strstr(body, "--hosts") != NULL);
    /* a page of such a name may not open a websocket either */
    int fd = raw_connect(port);
    raw_send_text(fd, "GET /ws HTTP/1.1\r\nHost: evil.example\r\nOrigin: http://evil.example\r\n"
                      "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
                      "Sec-WebSocket-Version: 13\r\n" PALPATE "\r\n");
    CHECK_INT(raw_head(fd, head, sizeof head), 403);
    close(fd);
}

/* every socket of the main port is held: it turns others away, and health and metrics answer on their own port, where
 * nothing else does, also for a name that no browser may come by */
static void health_answers_when_every_socket_is_held(void)
{
    static int held_here[1000];
    char request[128], body[64] = "";
    size_t n = 0;
    const int health = pal_server_health_port(server);
    REQUIRE(health > 0);
    CHECK_INT(get("/healthz", "", NULL, 0, NULL), 404);
    CHECK_INT(get("/metrics", "", NULL, 0, NULL), 404);
    int taken = 0;
    for (; taken < 1000; taken++) {
        held_here[taken] = raw_connect(port);
        raw_send_text(held_here[taken], "GET / HTTP/1.1\r\nHost: 127.");
        /* one that is turned away ends at once; those held do not for 5 s */
        struct timeval soon = {0, 20000};
        char byte;
        setsockopt(held_here[taken], SOL_SOCKET, SO_RCVTIMEO, &soon, sizeof soon);
        if (taken > 200 && recv(held_here[taken], &byte, 1, 0) <= 0 && errno != EAGAIN) break;
    }
    CHECK_LE(200, taken);
    CHECK_LE(taken, 999);
    snprintf(request, sizeof request, "GET /healthz HTTP/1.1\r\nHost: 10.1.2.3:%d\r\n\r\n", health);
    for (int i = 0; i < 3; i++) {
        CHECK_INT(raw_request(health, request, head, sizeof head, body, sizeof body - 1, &n), 200);
        CHECK(n == 3 && !memcmp(body, "ok\n", 3));
    }
    snprintf(request, sizeof request, "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n");
    CHECK_INT(raw_request(health, request, head, sizeof head, NULL, 0, NULL), 404);
    for (int i = 0; i <= taken && i < 1000; i++) close(held_here[i]);
}

static void goodbye_is_said_to_everybody(void)
{
    int fd = joined(WATCH);
    CHECK_INT(raw_until(fd, 2)->opcode, 2);
    pal_server_stop(server);
    CHECK_INT(raw_close_code(fd), PAL_WIRE_CLOSE_GOING_AWAY);
    close(fd);
}

static void put(const char *name, const char *text)
{
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "w");
    if (f) fputs(text, f), fclose(f);
}

static void put_large(void)
{
    char path[300];
    snprintf(path, sizeof path, "%s/large.bin", folder);
    FILE *f = fopen(path, "w");
    for (size_t i = 0; f && i < LARGE; i++) fputc((int)((i * 2654435761u >> 13) & 0xFF), f);
    if (f) fclose(f);
}

int main(void)
{
    static const char *const file[][2] = {
        {"index.html", "<p>hello\n"}, {"code.mjs", "export {}"}, {"module.wasm", "x"}, {".secret.html", "no"}};
    if (!mkdtemp(folder) || !small_scene_make(&organ, "small")) return 1;
    for (size_t i = 0; i < 4; i++) put(file[i][0], file[i][1]);
    put_large();
    begin((pal_server_options){0});
    RUN(half_open_connections_keep_nobody_out);
    RUN(upgrade_needs_the_subprotocol_the_path_and_the_own_origin);
    RUN(session_is_named_in_the_address);
    RUN(deflate_is_never_agreed_on);
    RUN(other_upgrades_leave_the_server_well);
    RUN(files_have_type_tag_and_policy);
    RUN(one_connection_serves_many_requests);
    RUN(large_file_arrives_whole_at_a_slow_reader);
    RUN(pages_tell_health_sessions_and_figures);
    RUN(steps_are_counted_by_their_time);
    RUN(a_client_sees_the_asset_and_frames_of_it);
    RUN(bad_messages_are_closed_with_a_code);
    RUN(flood_closes_the_flooder_alone);
    RUN(address_and_port_are_refused_with_a_sentence);
    RUN(half_open_connections_are_closed_by_the_server);
    RUN(goodbye_is_said_to_everybody);
    end();
    begin((pal_server_options){.allow_remote = true, .hosts = "organ.example,station"});
    RUN(other_machines_come_by_address_or_by_a_listed_name);
    end();
    begin((pal_server_options){.source = &source});
    RUN(sessions_are_opened_by_json_of_the_own_site);
    end();
    begin((pal_server_options){.max_clients = 100, .max_viewers = 1, .health = "0"});
    RUN(health_answers_when_every_socket_is_held);
    end();
    for (size_t i = 0; i < 5; i++) {
        char path[300];
        snprintf(path, sizeof path, "%s/%s", folder, i < 4 ? file[i][0] : "large.bin");
        unlink(path);
    }
    rmdir(folder);
    pal_prepared_free(&organ.mesh);
    return check_report();
}
