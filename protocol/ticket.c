/* Layout, little endian: version u8 = 1, key id u8, role u8, tool i8 (-1 any, -2 none), uses u16, session u64, user
 * u32, expires u32, nonce u64; then the HMAC-SHA256 of these 30 bytes. */
#include "protocol/ticket.h"

#include "protocol/bytes.h"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <string.h>

enum { VERSION = 1, MAC_BYTES = 32, ALL_BYTES = PAL_TICKET_BYTES + MAC_BYTES, BASE64 = 84 };
_Static_assert((ALL_BYTES + 2) / 3 * 4 == BASE64, "one padding character, which is left out");

uint64_t pal_ticket_session(const char *name)
{
    uint8_t digest[EVP_MAX_MD_SIZE];
    if (!name[0] || !EVP_Digest(name, strlen(name), digest, NULL, EVP_sha256(), NULL)) return 0;
    const uint64_t hash = pal_get_u64(digest);
    return hash ? hash : 1;
}

static bool sign(const uint8_t bytes[PAL_TICKET_BYTES], const pal_ticket_key *key, uint8_t mac[MAC_BYTES])
{
    unsigned n = 0;
    return HMAC(EVP_sha256(), key->bytes, sizeof key->bytes, bytes, PAL_TICKET_BYTES, mac, &n) && n == MAC_BYTES;
}

static bool in_range(const pal_ticket *t)
{
    return (unsigned)t->role < PAL_WIRE_ROLE_COUNT && t->tool >= PAL_WIRE_TOOL_NONE && t->tool < PAL_WIRE_TOOL_MAX;
}

bool pal_ticket_put(const pal_ticket *t, const pal_ticket_key *key, char text[PAL_TICKET_TEXT])
{
    uint8_t all[ALL_BYTES] = {VERSION, key->id, (uint8_t)t->role, (uint8_t)t->tool};
    unsigned char base64[BASE64 + 1];
    if (!in_range(t)) return false;
    pal_put_u16(all + 4, t->uses);
    pal_put_u64(all + 6, t->session);
    pal_put_u32(all + 14, t->user);
    pal_put_u32(all + 18, t->expires_s);
    pal_put_u64(all + 22, t->nonce);
    if (!sign(all, key, all + PAL_TICKET_BYTES)) return false;
    EVP_EncodeBlock(base64, all, ALL_BYTES);
    for (int i = 0; i < PAL_TICKET_TEXT - 1; i++)
        text[i] = (char)(base64[i] == '+' ? '-' : base64[i] == '/' ? '_' : base64[i]);
    text[PAL_TICKET_TEXT - 1] = 0;
    return true;
}

bool pal_ticket_get(const char *text, const pal_ticket_key *key, int n_key, pal_ticket *t)
{
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
    uint8_t base64[BASE64], all[BASE64 / 4 * 3], mac[MAC_BYTES];
    if (strspn(text, letters) != PAL_TICKET_TEXT - 1 || text[PAL_TICKET_TEXT - 1]) return false;
    for (int i = 0; i < PAL_TICKET_TEXT - 1; i++)
        base64[i] = (uint8_t)(text[i] == '-' ? '+' : text[i] == '_' ? '/' : text[i]);
    base64[BASE64 - 1] = '=';
    if (EVP_DecodeBlock(all, base64, BASE64) != (int)sizeof all || all[0] != VERSION) return false;
    while (n_key > 0 && key->id != all[1]) key++, n_key--;
    if (n_key <= 0 || !sign(all, key, mac) || CRYPTO_memcmp(mac, all + PAL_TICKET_BYTES, MAC_BYTES)) return false;
    *t = (pal_ticket){.key_id = all[1],
                      .role = (pal_wire_role)all[2],
                      .tool = (int8_t)all[3],
                      .uses = pal_get_u16(all + 4),
                      .session = pal_get_u64(all + 6),
                      .user = pal_get_u32(all + 14),
                      .expires_s = pal_get_u32(all + 18),
                      .nonce = pal_get_u64(all + 22)};
    return in_range(t);
}
