/* Sessions that are opened and ended while others run: who may, what is refused, who is told, and that nothing is left
 * of a thousand of them. */
#include "server/net/admission/ticket_keys.h"
#include "tests/net/command_room.h"
#include "tests/session/sculpt_body.h"

#include <dirent.h>
#include <malloc.h>
#include <sched.h>
#include <unistd.h>

static clay_scene clay;
static char keys_path[] = "/tmp/palpate_sessions_XXXXXX";
static _Atomic int n_kept;  /* scenes that the source keeps */
static _Atomic bool mended; /* the bad one is good */

/* ---- a source of two scenes, one of which is bad ---- */

typedef struct kept {
    pal_scene scene;
} kept;

static int list(void *user, char (*name)[PAL_NAME], int max)
{
    (void)user;
    if (max < 2) return 0;
    snprintf(name[0], PAL_NAME, "bad.json");
    snprintf(name[1], PAL_NAME, "clay.json");
    return 2;
}

static pal_err open_scene(void *user, const char *scene, const char *name, pal_diagnostic *diag,
                          pal_opened_session *out)
{
    (void)user;
    if (!strcmp(scene, "bad.json") && !mended) return PAL_REFUSE(diag, "bad.json: line 1: not JSON");
    kept *k = malloc(sizeof *k);
    if (!k) return PAL_ERR_MEMORY;
    k->scene = clay.scene;
    snprintf(k->scene.name, sizeof k->scene.name, "%s", name);
    pal_err err = pal_session_open(&k->scene, &(pal_session_options){.only_observed = true}, diag, &out->session);
    if (err) return free(k), err;
    out->keep = k;
    n_kept++;
    return PAL_ERR_OK;
}

static void close_scene(void *user, void *keep)
{
    (void)user;
    free(keep);
    n_kept--;
}

static const pal_session_source source = {NULL, list, open_scene, close_scene};

/* ---- requests ---- */

static char reply_text[1 << 16];

static int ask(const char *ticket, const char *body)
{
    pal_reply reply;
    pal_mem_post(transport, "/sessions", ticket, body, &reply);
    const size_t n = reply.body && reply.body->n_byte < sizeof reply_text ? reply.body->n_byte : 0;
    if (n) memcpy(reply_text, reply.body->bytes, n);
    reply_text[n] = 0;
    pal_packet_drop(reply.body);
    return reply.status;
}

static bool listed(const char *ticket, const char *part)
{
    CHECK_INT(ask(ticket, NULL), 200);
    return strstr(reply_text, part) != NULL;
}

/* a thread of the hub opens and closes at its own pace */
static void until_listed(const char *part, bool there)
{
    for (long k = 0; k < 100000000 && listed("", part) != there; k++) {
        pal_server_advance(server);
        sched_yield();
    }
    CHECK(listed("", part) == there);
}

static void begin(bool open)
{
    served_guarded = !open;
    served_begin(&clay.scene, (pal_session_options){0},
                 (pal_server_options){.source = &source, .key_file = open ? NULL : keys_path});
}

static void instructors_open_and_end(void)
{
    begin(true);
    CHECK(listed("", "\"scenes\":[\"bad.json\",\"clay.json\"]"));
    CHECK_INT(ask("", "{\"open\":\"clay.json\"}"), 202);
    CHECK_TEXT(reply_text, "{\"session\":\"clay-2\"}\n"); /* the first one has the name */
    CHECK(listed("", "{\"name\":\"clay-2\",\"title\":\"clay.json\",\"state\":\"opening\"}"));
    CHECK_INT(ask("", "{\"open\":\"clay.json\"}"), 202);
    CHECK_TEXT(reply_text, "{\"session\":\"clay-3\"}\n");
    until_listed("opening", false);
    CHECK_INT(n_kept, 2);
    mem_client a, b;
    mem_join(&a, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, 0); /* in the first session */
    memset(&b, 0, sizeof b);
    b.transport = transport;
    b.peer = pal_mem_connect(transport, "clay-3");
    mem_enter(&b, "Ben", PAL_WIRE_ROLE_TRAINEE, 0, false);
    mem_pull(&b, 1000);
    CHECK_TEXT(b.last[PAL_CONTROL_HELLO].hello.session, "clay-3");
    CHECK(listed("", "\"people\":[{\"name\":\"Ben\",\"role\":\"trainee\"}]"));
    CHECK_INT(ask("", "{\"end\":\"clay-3\"}"), 200);
    CHECK_INT(pal_mem_code(b.peer), PAL_WIRE_CLOSE_NO_SESSION);
    CHECK_TEXT(pal_mem_reason(b.peer), "the session was ended by an instructor");
    CHECK_INT(pal_mem_code(a.peer), 0);
    CHECK(!listed("", "clay-3") && listed("", "clay-2"));
    CHECK_INT(ask("", "{\"end\":\"clay-3\"}"), 404);
    /* the one that the server was started with too; those that are left go on */
    CHECK(!pal_server_has_ended(server, 0));
    CHECK_INT(ask("", "{\"end\":\"clay\"}"), 200);
    CHECK(pal_server_has_ended(server, 0) && !pal_server_has_ended(server, 1));
    CHECK_INT(pal_mem_code(a.peer), PAL_WIRE_CLOSE_NO_SESSION);
    CHECK(!session);
    CHECK_INT(ask("", "{\"open\":\"clay.json\"}"), 202);
    CHECK_TEXT(reply_text, "{\"session\":\"clay\"}\n");
    until_listed("opening", false);
    mem_end(&a), mem_end(&b);
    end();
    CHECK_INT(n_kept, 0);
}

static void a_bad_scene_stops_no_other(void)
{
    mem_client a;
    begin(true);
    join(&a, "Ada", PAL_WIRE_ROLE_TRAINEE, 0);
    CHECK_INT(ask("", "{\"open\":\"bad.json\"}"), 202);
    CHECK_INT(ask("", "{\"open\":\"clay.json\"}"), 202);
    until_listed("opening", false);
    CHECK(listed(
        "", "{\"name\":\"bad\",\"title\":\"bad.json\",\"state\":\"failed\",\"text\":\"bad.json: line 1: not JSON\"}"));
    CHECK(listed("", "\"name\":\"clay-2\""));
    const int n_frame = a.n_tools;
    for (int k = 0; k < 30; k++) served_turn(FRAME_NS, &a, NULL);
    CHECK(a.n_tools > n_frame + 20);
    /* the failure is listed for a while */
    served_turn(61000000000u, &a, NULL);
    CHECK(!listed("", "failed"));
    /* or until it is opened after all: no two sessions of the list have one name */
    CHECK_INT(ask("", "{\"open\":\"bad.json\"}"), 202);
    until_listed("opening", false);
    CHECK(listed("", "failed"));
    mended = true;
    CHECK_INT(ask("", "{\"open\":\"bad.json\"}"), 202);
    CHECK_TEXT(reply_text, "{\"session\":\"bad\"}\n");
    until_listed("opening", false);
    CHECK(listed("", "\"name\":\"bad\",\"title\":\"Clay\"") && !listed("", "failed"));
    mended = false;
    mem_end(&a);
    end();
    CHECK_INT(n_kept, 0);
}

/* those of the start are listed as long as the server runs, also where nothing can be opened */
static void a_scene_that_failed_at_the_start_is_listed(void)
{
    static const pal_failed_scene failed[] = {{"clay.json", {.text = "clay.json: no mesh"}},
                                              {"b.c.obj", {.text = "b"}}};
    char ticket[PAL_TICKET_TEXT];
    served_guarded = true;
    served_begin(&clay.scene, (pal_session_options){0},
                 (pal_server_options){.failed = failed, .n_failed = 2, .key_file = keys_path});
    pal_server_start_ticket(server, PAL_WIRE_ROLE_INSTRUCTOR, ticket);
    served_turn(61000000000u, NULL, NULL);
    /* "clay" is the session that runs */
    CHECK(listed("", "{\"name\":\"clay-2\",\"title\":\"clay.json\",\"state\":\"failed\"}"));
    CHECK(listed("", "{\"name\":\"b\",\"title\":\"b.c.obj\",\"state\":\"failed\"}"));
    CHECK(listed(ticket, "\"text\":\"clay.json: no mesh\"") && !listed(ticket, "scenes"));
    CHECK_INT(ask(ticket, "{\"open\":\"clay.json\"}"), 405);
    end();
}

static void others_may_not(void)
{
    char ticket[PAL_WIRE_ROLE_COUNT][PAL_TICKET_TEXT];
    mem_client a;
    begin(false);
    for (int r = 0; r < PAL_WIRE_ROLE_COUNT; r++) pal_server_start_ticket(server, (pal_wire_role)r, ticket[r]);
    CHECK_INT(ask("", "{\"open\":\"clay.json\"}"), 401);
    CHECK_INT(ask("AAAA", "{\"open\":\"clay.json\"}"), 401);
    CHECK(strstr(reply_text, "this ticket is not one of this server"));
    CHECK_INT(ask(ticket[PAL_WIRE_ROLE_VIEWER], "{\"end\":\"clay\"}"), 403);
    CHECK_INT(ask(ticket[PAL_WIRE_ROLE_TRAINEE], "{\"open\":\"clay.json\"}"), 403);
    CHECK(strstr(reply_text, "only instructors open and end sessions"));
    /* who is there, which scenes there are, and why one failed, is not for everybody */
    mem_join(&a, transport, "Ada", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    CHECK_INT(ask(ticket[PAL_WIRE_ROLE_INSTRUCTOR], "{\"open\":\"bad.json\"}"), 202);
    until_listed("opening", false);
    CHECK(!listed("", "Ada") && !listed("", "scenes") && !listed("", "not JSON"));
    CHECK(listed(ticket[PAL_WIRE_ROLE_VIEWER], "Ada") && !listed(ticket[PAL_WIRE_ROLE_VIEWER], "scenes"));
    CHECK(listed(ticket[PAL_WIRE_ROLE_INSTRUCTOR], "scenes") && listed(ticket[PAL_WIRE_ROLE_INSTRUCTOR], "not JSON"));
    mem_end(&a);
    end();
}

static void a_ticket_of_one_session_ends_that_one(void)
{
    begin(false);
    pal_ticket_keys keys;
    pal_diagnostic diag = {""};
    char text[PAL_TICKET_TEXT];
    REQUIRE(!pal_ticket_keys_read(keys_path, &keys, &diag));
    pal_ticket ticket = {
        .role = PAL_WIRE_ROLE_INSTRUCTOR, .tool = PAL_WIRE_TOOL_ANY, .session = pal_ticket_session("clay"), .nonce = 5};
    CHECK(pal_ticket_put(&ticket, &keys.key[keys.n - 1], text));
    CHECK_INT(ask(text, "{\"open\":\"clay.json\"}"), 401);
    CHECK(strstr(reply_text, "this ticket is for another session"));
    CHECK_INT(ask(text, "{\"end\":\"clay\"}"), 200);
    end();
}

static void bad_requests_are_answered(void)
{
    static const char *const bad[] = {"",
                                      "{",
                                      "[]",
                                      "{}",
                                      "\"open\"",
                                      "{\"open\":1}",
                                      "{\"open\":\"\"}",
                                      "{\"close\":\"clay\"}",
                                      "{\"open\":\"clay.json\",\"end\":\"clay\"}",
                                      "{\"open\":{\"open\":\"clay.json\"}}"};
    begin(true);
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) CHECK_INT(ask("", bad[k]), 422);
    CHECK_INT(ask("", "{\"open\":\"clay.json\",\"name\":\"a b\"}"), 422);
    CHECK_INT(ask("", "{\"open\":\"clay.json\",\"name\":\"../x\"}"), 422);
    CHECK_INT(ask("", "{\"open\":\"clay.json\",\"name\":\"clay\"}"), 409);
    CHECK_INT(ask("", "{\"open\":\"../clay.json\"}"), 404);
    CHECK_INT(ask("", "{\"open\":\"clay\"}"), 404);
    char text[200] = "{\"open\":\"";
    memset(text + 9, 'a', 100);
    strcpy(text + 109, "\"}");
    CHECK_INT(ask("", text), 422);
    /* every byte of a good request replaced */
    const char *good = "{\"open\":\"clay.json\"}";
    for (size_t i = 0; i < strlen(good); i++)
        for (int byte = 1; byte < 256; byte += 7) {
            char changed[32];
            strcpy(changed, good);
            changed[i] = (char)byte;
            const int status = ask("", changed);
            CHECK(status == 422 || status == 404 || status == 202 || status == 429);
        }
    pal_reply reply;
    pal_mem_post(transport, "/", "", good, &reply);
    CHECK_INT(reply.status, 404);
    pal_packet_drop(reply.body);
    until_listed("opening", false);
    end();
    CHECK_INT(n_kept, 0);
    served_begin(&clay.scene, (pal_session_options){0}, (pal_server_options){0});
    CHECK_INT(ask("", good), 405); /* the server has no scenes */
    end();
}

/* /metrics has a histogram of every session, and ends as it does with one */
static void check_metrics(int n_session)
{
    pal_reply reply;
    int n = 0;
    pal_mem_get(transport, "/metrics", &reply);
    static char text[1 << 18];
    REQUIRE(reply.status == 200 && reply.body->n_byte < sizeof text);
    memcpy(text, reply.body->bytes, reply.body->n_byte);
    text[reply.body->n_byte] = 0;
    pal_packet_drop(reply.body);
    for (const char *at = text; (at = strstr(at, "_by_session_count{")); at++) n++;
    CHECK_INT(n, n_session);
    CHECK(strstr(text, "palpate_handshakes_total{result=\"refused\"} 0\n"));
}

static void there_is_a_limit(void)
{
    begin(true);
    int n = 1;
    for (; n < PAL_SESSIONS_MAX; n++) {
        CHECK_INT(ask("", "{\"open\":\"clay.json\"}"), 202);
        until_listed("opening", false);
    }
    CHECK_INT(ask("", "{\"open\":\"clay.json\"}"), 409);
    CHECK_TEXT(reply_text, "{\"error\":\"there are 64 sessions, and no room for more: end one\"}\n");
    check_metrics(PAL_SESSIONS_MAX);
    CHECK_INT(ask("", "{\"end\":\"clay-7\"}"), 200);
    CHECK_INT(ask("", "{\"open\":\"clay.json\"}"), 202);
    CHECK_TEXT(reply_text, "{\"session\":\"clay-7\"}\n");
    end(); /* while it is being opened */
    CHECK_INT(n_kept, 0);
}

static int count(const char *folder)
{
    int n = 0;
    DIR *dir = opendir(folder);
    while (dir && readdir(dir)) n++;
    if (dir) closedir(dir);
    return n;
}

static void nothing_is_left_of_a_thousand(void)
{
    int threads = 0, files = 0;
    size_t bytes = 0;
    begin(true);
    for (int k = 0; k < 1000; k++) {
        if (k == 300) { /* buffers that grow have grown by then */
            threads = count("/proc/self/task"), files = count("/proc/self/fd");
            bytes = mallinfo2().uordblks;
        }
        CHECK_INT(ask("", "{\"open\":\"clay.json\"}"), 202);
        until_listed("\"name\":\"clay-2\",\"title\":\"Clay\"", true);
        CHECK_INT(ask("", "{\"end\":\"clay-2\"}"), 200);
        while (n_kept) sched_yield();
    }
    CHECK_INT(count("/proc/self/task"), threads);
    CHECK_INT(count("/proc/self/fd"), files);
    CHECK_LE(mallinfo2().uordblks, bytes + 50000);
    end();
}

int main(void)
{
    int id;
    pal_diagnostic diag = {""};
    const int fd = mkstemp(keys_path);
    if (fd < 0 || close(fd) || unlink(keys_path) || pal_key_file_add(keys_path, &id, &diag)) return 1;
    clay_make(&clay, 1, 0.1);
    snprintf(clay.scene.title, sizeof clay.scene.title, "Clay");
    RUN(instructors_open_and_end);
    RUN(a_bad_scene_stops_no_other);
    RUN(a_scene_that_failed_at_the_start_is_listed);
    RUN(others_may_not);
    RUN(a_ticket_of_one_session_ends_that_one);
    RUN(bad_requests_are_answered);
    RUN(there_is_a_limit);
    RUN(nothing_is_left_of_a_thousand);
    clay_free(&clay);
    unlink(keys_path);
    return check_report();
}
