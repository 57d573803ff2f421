/* Whatever a client says, in any order: the hub behind it, with a real session and peers inside the process.
 * Input: records of one byte what (1: text, else binary; 2: pull messages after it; 4: a turn of the loop after it),
 * two bytes length (little endian) and the message. The first record is preceded by a valid join when its byte has
 * bit 7. */
#include "server/net/server.h"
#include "tests/fixtures/manual_clock.h"
#include "tests/net/hub_scene.h"
#include "tests/net/mem_client.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

static pal_server *server;
static manual_clock clock_;

static bool begin(void)
{
    static small_scene organ;
    static pal_session *session;
    pal_session_options options = {.start_paused = true, .clock = &clock_.clock};
    pal_server_options net = {.transport = &pal_mem_transport};
    manual_clock_init(&clock_, 1);
    return small_scene_make(&organ, "small") && !pal_session_open(&organ.scene, &options, NULL, &session) &&
           !pal_server_open(&net, &session, 1, NULL, &server);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    static const char join[] = "{\"type\":\"join\",\"name\":\"f\",\"role\":\"trainee\",\"tool\":-1}";
    if (!server && !begin()) abort();
    pal_mem_peer *peer = pal_mem_connect(pal_server_transport(server), "");
    if (!peer) return 0;
    if (n_byte > 0 && bytes[0] & 0x80) pal_mem_send(peer, join, sizeof join - 1, true);
    for (size_t at = 0; at + 3 <= n_byte;) {
        uint8_t what = bytes[at];
        size_t n = (size_t)bytes[at + 1] | (size_t)bytes[at + 2] << 8;
        at += 3;
        if (n > n_byte - at) n = n_byte - at;
        pal_mem_send(peer, bytes + at, n, what & 1);
        at += n;
        if (what & 4) {
            manual_clock_advance(&clock_, 16666667);
            pal_server_advance(server);
        }
        for (int i = 0; i < 8 && what & 2; i++)
            if (!pal_mem_receive(peer)) break;
    }
    pal_mem_leave(peer);
    return 0;
}
