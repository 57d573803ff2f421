/* Whatever is posted to /sessions: a hub with a real session, and a folder whose one scene cannot be opened. Input: one
 * byte (1: with a ticket that is none; 2: a turn of the loop after it), and the body. */
#include "server/base/log.h"
#include "server/net/server.h"
#include "server/net/transport/tuning.h"
#include "tests/fixtures/manual_clock.h"
#include "tests/net/hub_scene.h"
#include "tests/net/mem_client.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

static pal_server *server;
static manual_clock clock_;

static int list(void *user, char (*name)[PAL_NAME], int max)
{
    (void)user;
    snprintf(name[0], PAL_NAME, "a.json");
    return max > 0;
}

static pal_err refuse(void *user, const char *scene, const char *name, pal_diagnostic *diag, pal_opened_session *out)
{
    (void)user, (void)name, (void)out;
    return PAL_REFUSE(diag, "%s: not JSON", scene);
}

static void keep_nothing(void *user, void *keep)
{
    (void)user, (void)keep;
}

static bool begin(void)
{
    static const pal_session_source source = {NULL, list, refuse, keep_nothing};
    static small_scene organ;
    static pal_session *session;
    pal_session_options options = {.start_paused = true, .clock = &clock_.clock};
    pal_server_options net = {.transport = &pal_mem_transport, .source = &source, .open = true};
    manual_clock_init(&clock_, 1);
    pal_log_set_level(PAL_LOG_ERROR);
    return small_scene_make(&organ, "small") && !pal_session_open(&organ.scene, &options, NULL, &session) &&
           !pal_server_open(&net, &session, 1, NULL, &server);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    char body[PAL_POST_MAX];
    pal_reply reply;
    if (!server && !begin()) abort();
    if (n_byte < 1 || n_byte > sizeof body) return 0;
    memcpy(body, bytes + 1, n_byte - 1);
    body[n_byte - 1] = 0;
    pal_transport *transport = pal_server_transport(server);
    pal_mem_post(transport, "/sessions", bytes[0] & 1 ? "AAAA" : "", body, &reply);
    if (reply.status < 200 || reply.status > 503 || !reply.body) abort();
    pal_packet_drop(reply.body);
    if (bytes[0] & 2) {
        manual_clock_advance(&clock_, 16666667);
        pal_server_advance(server);
    }
    pal_mem_post(transport, "/sessions", "", NULL, &reply);
    if (reply.status != 200) abort();
    pal_packet_drop(reply.body);
    return 0;
}
