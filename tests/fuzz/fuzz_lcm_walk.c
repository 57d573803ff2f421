/* Bytes from a bus: the length walk over each type of the package, and what it passes through the generated decoder and
 * our conversion. The first byte chooses the type; the fingerprint is put in, so that the fields are reached. */
#include "clients/link/lcm_convert.h"
#include "clients/link/lcm_seal.h"
#include "lcmtypes/lcm_walk.h"
#include "palpate_answer_t.h"
#include "palpate_body_frame_t.h"
#include "palpate_haptic_config_t.h"
#include "palpate_haptic_event_t.h"
#include "palpate_haptic_status_t.h"
#include "palpate_order_t.h"
#include "palpate_session_status_t.h"
#include "palpate_triangles_t.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    const lcm_type_info_t *const type[] = {
        palpate_tool_state_t_get_type_info(),     palpate_haptic_model_t_get_type_info(),
        palpate_haptic_event_t_get_type_info(),   palpate_haptic_status_t_get_type_info(),
        palpate_haptic_config_t_get_type_info(),  palpate_body_frame_t_get_type_info(),
        palpate_session_status_t_get_type_info(), palpate_order_t_get_type_info(),
        palpate_answer_t_get_type_info(),         palpate_triangles_t_get_type_info()};
    static pal_seal_senders senders;
    static const pal_keys keys = {.n = 1};
    size_t n_sealed = n_byte;
    uint64_t source;
    if (!pal_seal_admit(&senders, "a", bytes, &n_sealed, n_byte & 1 ? &keys : NULL, 1, 1, &source) && n_sealed > n_byte)
        abort();
    if (n_byte < 9 || n_byte > 1 << 20) return 0;
    const unsigned which = bytes[0] % (sizeof type / sizeof type[0]);
    const size_t n = n_byte - 1;
    uint8_t *copy = malloc(n);
    if (!copy) return 0;
    memcpy(copy, bytes + 1, n);
    const uint64_t hash = (uint64_t)type[which]->get_hash();
    for (int i = 0; i < 8; i++) copy[i] = (uint8_t)(hash >> (56 - 8 * i));
    if (!pal_lcm_walk(type[which], copy, n)) {
        _Alignas(16) uint8_t message[1024];
        pal_wire_pose pose;
        static pal_wire_haptic haptic;
        if (type[which]->decode(copy, 0, (int)n, message) != (int)n) abort();
        type[which]->decode_cleanup(message);
        if (which == 0) (void)pal_lcm_to_pose(copy, n, &pose);
        if (which == 1) (void)pal_lcm_to_haptic(copy, n, &haptic);
    }
    free(copy);
    return 0;
}
