/* Who has sent a message on the bus, and when: 40 bytes behind its LCM encoding, which decoders do not read. With a key
 * that all its hosts share, the bus takes only what was signed with it.
 *
 * Big-endian: u64 source, a random number of the sending program; i64 Unix time us, growing; the first 16 bytes of
 * HMAC-SHA256 over channel, a zero byte, the encoding, source and time, or zeros without a key; "PALSEAL1".
 *
 * Admission, per channel: the first source keeps the channel until it is silent for 0.5 s. Times grow, so that nothing
 * comes twice; without a key a record of the bus may be played again after that silence. With a key, a message is at
 * most 5 s old or early, so the clocks of the hosts may differ by less than that. Thread: any, one at a time. */
#ifndef PAL_LINK_LCM_SEAL_H
#define PAL_LINK_LCM_SEAL_H
#include "server/base/key_file.h"

#include <stddef.h>

enum { PAL_SEAL_BYTES = 40, PAL_SEAL_CHANNELS = 64, PAL_SEAL_CHANNEL_BYTES = 64 };

/* key NULL: unsigned. out [PAL_SEAL_BYTES]; false: the library of ciphers failed */
bool pal_seal_put(uint8_t *out, uint64_t source, int64_t sent_us, const char *channel, const uint8_t *bytes,
                  size_t n_byte, const pal_key *key);
/* bytes of the message without its seal: n_byte when it has none */
size_t pal_seal_begin(const uint8_t *bytes, size_t n_byte);

uint64_t pal_seal_source(const uint8_t *bytes, size_t n_byte); /* as the seal says, unchecked; 0: there is none */

/* the sources of channels; zeroed at first. When all are taken, a new channel replaces one whose sender is silent, and
 * from which nothing recorded can come again; else it is refused, so that made-up channels push out nobody */
typedef struct pal_seal_senders {
    struct {
        char channel[PAL_SEAL_CHANNEL_BYTES];
        uint64_t source, heard_ns;
        int64_t sent_us;
    } at[PAL_SEAL_CHANNELS];
} pal_seal_senders;

/* Admits an untrusted message: NULL, *n_byte without the seal, *source 0 when it has none; else why not, in words.
 * keys NULL: signatures are not checked. now_ns: a monotonic clock; now_us: Unix time */
const char *pal_seal_admit(pal_seal_senders *senders, const char *channel, const uint8_t *bytes, size_t *n_byte,
                           const pal_keys *keys, uint64_t now_ns, int64_t now_us, uint64_t *source);
/* Does state `seq` follow `last`, since_ns later? Numbers grow, by no more than so many states as come in that time and
 * PAL_STATES_AHEAD, so that nobody counts so far ahead that the sender's own states are old */
bool pal_seal_follows(uint32_t seq, uint32_t last, uint64_t since_ns);
#endif
