/* Who may speak on the bus: signatures, repeats, old messages, and the first source of a channel. */
#include "clients/link/lcm_seal.h"
#include "clients/link/tuning.h"
#include "tests/check.h"

#define CHANNEL "PALPATE1/main/TOOL/0"

static pal_keys keys = {.n = 1};
static pal_seal_senders senders;
static uint64_t now_ns = 1000000000;
static int64_t now_us = 1800000000000000;
static const char *why; /* the last one was refused */

static void pass_us(int64_t us)
{
    now_ns += 1000u * (uint64_t)us;
    now_us += us;
}

/* a message of 100 bytes with its seal */
typedef struct sealed {
    uint8_t bytes[100 + PAL_SEAL_BYTES];
} sealed;
static sealed seal(uint64_t source, int64_t sent_us, const pal_key *key)
{
    sealed s;
    for (int i = 0; i < 100; i++) s.bytes[i] = (uint8_t)i;
    CHECK(pal_seal_put(s.bytes + 100, source, sent_us, CHANNEL, s.bytes, 100, key));
    return s;
}

static bool admit(const sealed *s, const char *channel, const pal_keys *with)
{
    size_t n = sizeof s->bytes;
    uint64_t source = 0;
    why = pal_seal_admit(&senders, channel, s->bytes, &n, with, now_ns, now_us, &source);
    if (!why) CHECK(n == 100 && source != 0);
    return !why;
}

static void begin(void)
{
    memset(&senders, 0, sizeof senders);
    pass_us(60000000);
}

/* as another implementation signs it (hmac of Python) */
static void it_is_signed_as_specified(void)
{
    static const uint8_t expected[16] = {0xb6, 0xde, 0x6f, 0xb6, 0x82, 0xb9, 0xe4, 0xdc,
                                         0x61, 0xd6, 0x96, 0x0f, 0x0b, 0xa6, 0x98, 0xd3};
    const sealed s = seal(0x0123456789abcdefull, 1800000000000001, &keys.key[0]);
    CHECK(!memcmp(s.bytes + 116, expected, 16));
    static const uint8_t head[16] = {0x01, 0x23, 0x45, 0x67, 0x89, 0xab, 0xcd, 0xef,
                                     0x00, 0x06, 0x65, 0x17, 0x28, 0x98, 0x80, 0x01};
    CHECK(!memcmp(s.bytes + 100, head, 16));
    CHECK(!memcmp(s.bytes + 132, "PALSEAL1", 8));
}

static void only_what_was_signed_comes_in(void)
{
    begin();
    const sealed good = seal(7, now_us, &keys.key[0]);
    for (size_t i = 0; i < sizeof good.bytes; i++) {
        sealed bad = good;
        bad.bytes[i] ^= 1;
        if (admit(&bad, CHANNEL, &keys)) CHECK_FAIL("a message with another byte %zu was admitted", i);
    }
    CHECK(!admit(&good, "PALPATE1/main/TOOL/1", &keys)); /* signed for another channel */
    pal_keys other = keys;
    other.key[0].bytes[31] ^= 1;
    CHECK(!admit(&good, CHANNEL, &other));
    const sealed without = seal(7, now_us, NULL);
    CHECK(!admit(&without, CHANNEL, &keys));
    CHECK(admit(&good, CHANNEL, &keys));
    /* while keys are replaced, either one signs */
    other.n = 2, other.key[1] = keys.key[0];
    pass_us(1);
    const sealed old = seal(7, now_us, &keys.key[0]);
    CHECK(admit(&old, CHANNEL, &other));
}

static void nothing_comes_twice_or_late(void)
{
    begin();
    const sealed first = seal(7, now_us, &keys.key[0]);
    CHECK(admit(&first, CHANNEL, &keys));
    CHECK(!admit(&first, CHANNEL, &keys));
    pass_us(4000);
    const sealed second = seal(7, now_us, &keys.key[0]);
    CHECK(admit(&second, CHANNEL, &keys));
    CHECK(!admit(&first, CHANNEL, &keys));
    /* a recorded message does not come back when its sender has left, however long that is */
    pass_us(PAL_SEAL_SILENCE_NS / 1000 + 1);
    CHECK(!admit(&second, CHANNEL, &keys));
    CHECK_TEXT(why, "a message comes again");
    pass_us(PAL_SEAL_AGE_US);
    CHECK(!admit(&second, CHANNEL, &keys));
    CHECK(strstr(why, "5 s old"));
    const sealed early = seal(7, now_us + PAL_SEAL_AGE_US, &keys.key[0]),
                 nearly = seal(7, now_us + PAL_SEAL_AGE_US - 1, &keys.key[0]);
    CHECK(!admit(&early, CHANNEL, &keys));
    CHECK(admit(&nearly, CHANNEL, &keys));
}

/* with and without a key */
static void the_first_source_keeps_its_channel(void)
{
    for (int keyed = 0; keyed < 2; keyed++) {
        const pal_keys *with = keyed ? &keys : NULL;
        const pal_key *key = keyed ? &keys.key[0] : NULL;
        begin();
        for (int k = 0; k < 1000; k++) {
            const sealed mine = seal(7, now_us, key), theirs = seal(8, now_us + 1, key);
            CHECK(admit(&mine, CHANNEL, with));
            CHECK(!admit(&theirs, CHANNEL, with));
            CHECK_TEXT(why, "another sender has the channel");
            pass_us(4000);
        }
        /* it is silent: the other one has it, and keeps it */
        pass_us(PAL_SEAL_SILENCE_NS / 1000 - 4000 - 1);
        const sealed soon = seal(8, now_us, key);
        CHECK(!admit(&soon, CHANNEL, with));
        pass_us(1);
        const sealed theirs = seal(8, now_us, key), mine = seal(7, now_us + 1, key);
        CHECK(admit(&theirs, CHANNEL, with));
        CHECK(!admit(&mine, CHANNEL, with));
    }
}

static void a_record_is_played_again_without_a_key(void)
{
    begin();
    const sealed first = seal(7, now_us, NULL), second = seal(7, now_us + 4000, NULL);
    for (int k = 0; k < 3; k++) {
        CHECK(admit(&first, CHANNEL, NULL));
        CHECK(!admit(&first, CHANNEL, NULL));
        pass_us(4000);
        CHECK(admit(&second, CHANNEL, NULL));
        CHECK(!admit(&first, CHANNEL, NULL));
        pass_us(PAL_SEAL_SILENCE_NS / 1000);
    }
}

/* senders that do not seal, on a bus without a key, are one source */
static void a_bus_without_key_takes_what_has_no_seal(void)
{
    uint8_t bytes[100] = {0};
    size_t n = sizeof bytes;
    uint64_t source = 1;
    begin();
    CHECK(!pal_seal_admit(&senders, CHANNEL, bytes, &n, NULL, now_ns, now_us, &source));
    CHECK(n == 100 && source == 0);
    CHECK(!pal_seal_admit(&senders, CHANNEL, bytes, &n, NULL, now_ns, now_us, &source));
    CHECK(pal_seal_admit(&senders, CHANNEL, bytes, &n, &keys, now_ns, now_us, &source) != NULL);
    n = 0;
    CHECK(!pal_seal_admit(&senders, CHANNEL "1", bytes, &n, NULL, now_ns, now_us, &source));
}

/* names of channels are the sender's: many of them replace those whose senders are silent, and nothing else */
static void many_channels_cost_no_memory(void)
{
    char channel[64];
    begin();
    const sealed mine = seal(7, now_us, NULL);
    CHECK(admit(&mine, CHANNEL, NULL));
    for (int k = 0; k < 1000; k++) {
        pass_us(10000);
        snprintf(channel, sizeof channel, "PALPATE1/x/TOOL/%d", k);
        const sealed other = seal(9, now_us, NULL), again = seal(7, now_us, NULL);
        CHECK(admit(&other, channel, NULL));
        CHECK(admit(&again, CHANNEL, NULL)); /* it speaks, so it is not forgotten */
    }
    char longest[100];
    memset(longest, 'x', sizeof longest - 1);
    longest[sizeof longest - 1] = 0;
    CHECK(!admit(&mine, longest, NULL));
}

/* made-up channels between two messages of a sender do not take its channel away */
static void a_flood_of_channels_takes_none(void)
{
    char channel[64];
    begin();
    const sealed mine = seal(7, now_us, NULL);
    CHECK(admit(&mine, CHANNEL, NULL));
    pass_us(1);
    for (int k = 0; k < 1000; k++) {
        snprintf(channel, sizeof channel, "PALPATE1/main/TOOL/%d", k + 1);
        const sealed other = seal(9, now_us, NULL);
        (void)admit(&other, channel, NULL);
    }
    const sealed theirs = seal(9, now_us, NULL), again = seal(7, now_us + 1, NULL);
    CHECK(!admit(&theirs, CHANNEL, NULL));
    CHECK(admit(&again, CHANNEL, NULL));
    snprintf(channel, sizeof channel, "PALPATE1/x/TOOL/0");
    CHECK(!admit(&theirs, channel, NULL));
    CHECK_TEXT(why, "too many channels are in use");
}

/* with a key, a channel is remembered for as long as a message that was sent early could come again */
static void signed_messages_of_replaced_channels_do_not_come_again(void)
{
    char channel[64];
    begin();
    sealed early;
    for (int k = PAL_SEAL_CHANNELS - 1; k >= 0; k--) {
        pass_us(-1); /* so that the one of `early` is silent longest */
        snprintf(channel, sizeof channel, "PALPATE1/main/TOOL/%d", k);
        early = seal(7, now_us + PAL_SEAL_AGE_US - 1, &keys.key[0]);
        CHECK(
            pal_seal_put(early.bytes + 100, 7, now_us + PAL_SEAL_AGE_US - 1, channel, early.bytes, 100, &keys.key[0]));
        CHECK(admit(&early, channel, &keys));
    }
    char another[64] = "PALPATE1/main/TOOL/64";
    for (int step = 0; step < 20; step++) {
        pass_us(PAL_SEAL_AGE_US / 10);
        sealed other = seal(7, now_us, NULL);
        CHECK(pal_seal_put(other.bytes + 100, 7, now_us, another, other.bytes, 100, &keys.key[0]));
        (void)admit(&other, another, &keys);
        if (admit(&early, channel, &keys))
            CHECK_FAIL("it came again after %d ms", (step + 1) * PAL_SEAL_AGE_US / 10000);
    }
}

static void numbers_grow_with_the_time(void)
{
    CHECK(pal_seal_follows(8, 7, 4000000));
    CHECK(!pal_seal_follows(7, 7, 4000000));
    CHECK(!pal_seal_follows(6, 7, 1000000000));
    CHECK(pal_seal_follows(7 + PAL_STATES_AHEAD, 7, 0));
    CHECK(!pal_seal_follows(8 + PAL_STATES_AHEAD, 7, 0));
    CHECK(pal_seal_follows(7 + PAL_STATES_AHEAD + 250, 7, 1000000000));
    CHECK(!pal_seal_follows(8 + PAL_STATES_AHEAD + 250, 7, 1000000000));
    CHECK(!pal_seal_follows(7 + 0x7fffffffu, 7, 1000000000));
    CHECK(pal_seal_follows(2, 0xfffffffeu, 100000000)); /* they wrap */
}

int main(void)
{
    keys.key[0].id = 1;
    for (int i = 0; i < PAL_KEY_BYTES; i++) keys.key[0].bytes[i] = (uint8_t)i;
    RUN(it_is_signed_as_specified);
    RUN(only_what_was_signed_comes_in);
    RUN(nothing_comes_twice_or_late);
    RUN(the_first_source_keeps_its_channel);
    RUN(a_record_is_played_again_without_a_key);
    RUN(a_bus_without_key_takes_what_has_no_seal);
    RUN(numbers_grow_with_the_time);
    RUN(many_channels_cost_no_memory);
    RUN(a_flood_of_channels_takes_none);
    RUN(signed_messages_of_replaced_channels_do_not_come_again);
    return check_report();
}
