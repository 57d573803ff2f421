#include "clients/link/lcm_seal.h"
#include "clients/link/tuning.h"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/params.h>
#include <stdio.h>
#include <string.h>

enum { MAC = 16, SIGNED = 16 }; /* bytes: of the signature; of source and time before it */
static const char magic[8] = {'P', 'A', 'L', 'S', 'E', 'A', 'L', '1'};

static void put64(uint8_t *out, uint64_t value)
{
    for (int i = 0; i < 8; i++) out[i] = (uint8_t)(value >> (56 - 8 * i));
}

static uint64_t get64(const uint8_t *bytes)
{
    uint64_t value = 0;
    for (int i = 0; i < 8; i++) value = value << 8 | bytes[i];
    return value;
}

/* of channel, message, and source and time as they stand in the seal */
static bool sign(const pal_key *key, const char *channel, const uint8_t *bytes, size_t n_byte, const uint8_t *seal,
                 uint8_t mac[MAC])
{
    static char digest[] = "SHA256";
    const OSSL_PARAM params[] = {OSSL_PARAM_construct_utf8_string("digest", digest, 0), OSSL_PARAM_construct_end()};
    uint8_t whole[EVP_MAX_MD_SIZE];
    size_t n = 0;
    EVP_MAC *hmac = EVP_MAC_fetch(NULL, "HMAC", NULL);
    EVP_MAC_CTX *c = hmac ? EVP_MAC_CTX_new(hmac) : NULL;
    const bool good = c && EVP_MAC_init(c, key->bytes, sizeof key->bytes, params) &&
                      EVP_MAC_update(c, (const uint8_t *)channel, strlen(channel) + 1) &&
                      EVP_MAC_update(c, bytes, n_byte) && EVP_MAC_update(c, seal, SIGNED) &&
                      EVP_MAC_final(c, whole, &n, sizeof whole) && n >= MAC;
    EVP_MAC_CTX_free(c);
    EVP_MAC_free(hmac);
    if (good) memcpy(mac, whole, MAC);
    return good;
}

bool pal_seal_put(uint8_t *out, uint64_t source, int64_t sent_us, const char *channel, const uint8_t *bytes,
                  size_t n_byte, const pal_key *key)
{
    put64(out, source);
    put64(out + 8, (uint64_t)sent_us);
    memset(out + SIGNED, 0, MAC);
    memcpy(out + SIGNED + MAC, magic, sizeof magic);
    return !key || sign(key, channel, bytes, n_byte, out, out + SIGNED);
}

size_t pal_seal_begin(const uint8_t *bytes, size_t n_byte)
{
    const bool sealed = n_byte >= PAL_SEAL_BYTES && !memcmp(bytes + n_byte - sizeof magic, magic, sizeof magic);
    return sealed ? n_byte - PAL_SEAL_BYTES : n_byte;
}

uint64_t pal_seal_source(const uint8_t *bytes, size_t n_byte)
{
    const size_t n = pal_seal_begin(bytes, n_byte);
    return n < n_byte ? get64(bytes + n) : 0;
}

static bool is_signed(const pal_keys *keys, const char *channel, const uint8_t *bytes, size_t n_byte)
{
    uint8_t mac[MAC];
    for (int k = 0; k < keys->n; k++)
        if (sign(&keys->key[k], channel, bytes, n_byte, bytes + n_byte, mac) &&
            !CRYPTO_memcmp(mac, bytes + n_byte + SIGNED, MAC))
            return true;
    return false;
}

const char *pal_seal_admit(pal_seal_senders *senders, const char *channel, const uint8_t *bytes, size_t *n_byte,
                           const pal_keys *keys, uint64_t now_ns, int64_t now_us, uint64_t *source)
{
    const size_t n = pal_seal_begin(bytes, *n_byte);
    const bool sealed = n < *n_byte;
    const uint64_t from = pal_seal_source(bytes, *n_byte);
    const int64_t sent_us = sealed ? (int64_t)get64(bytes + n + 8) : 0;
    int k = 0, silent = 0;
    if (strlen(channel) >= PAL_SEAL_CHANNEL_BYTES) return "a channel's name is too long";
    if (keys && !(sealed && is_signed(keys, channel, bytes, n))) return "a message is not signed with the key";
    if (keys && !(sent_us > now_us - PAL_SEAL_AGE_US && sent_us < now_us + PAL_SEAL_AGE_US))
        return "a message is more than 5 s old or early: do the clocks of the hosts agree?";
    while (k < PAL_SEAL_CHANNELS && strcmp(senders->at[k].channel, channel)) {
        if (senders->at[k].heard_ns < senders->at[silent].heard_ns) silent = k;
        k++;
    }
    if (k == PAL_SEAL_CHANNELS) {
        /* a signed message may be as early as it may be late */
        const uint64_t kept_ns = keys ? 2000ull * PAL_SEAL_AGE_US : PAL_SEAL_SILENCE_NS;
        if (senders->at[silent].heard_ns && now_ns - senders->at[silent].heard_ns < kept_ns)
            return "too many channels are in use";
        memset(&senders->at[k = silent], 0, sizeof senders->at[k]);
        snprintf(senders->at[k].channel, sizeof senders->at[k].channel, "%s", channel);
    }
    const bool is_new = senders->at[k].heard_ns == 0, same = from == senders->at[k].source,
               is_free = is_new || now_ns - senders->at[k].heard_ns >= PAL_SEAL_SILENCE_NS;
    if (!same && !is_free) return "another sender has the channel";
    /* without a key a record of the bus may be played again */
    if (sealed && !is_new && (keys || !is_free) && sent_us <= senders->at[k].sent_us) return "a message comes again";
    senders->at[k].source = from, senders->at[k].heard_ns = now_ns, senders->at[k].sent_us = sent_us;
    *n_byte = n, *source = from;
    return NULL;
}

bool pal_seal_follows(uint32_t seq, uint32_t last, uint64_t since_ns)
{
    const int32_t ahead = (int32_t)(seq - last);
    return ahead > 0 && ahead <= PAL_STATES_1_S * 1e-9 * (double)since_ns + PAL_STATES_AHEAD;
}
