/* Hosts, origins, and how many requests an address may make. That the server asks them is in test_ws. */
#include "server/net/transport/host_name.h"
#include "server/net/transport/request_rate.h"
#include "server/net/transport/tuning.h"
#include "tests/check.h"

static void loopback_is_this_machine(void)
{
    static const char *const here[] = {"127.0.0.1", "127.9.9.9", "::1", "::ffff:127.0.0.1", ""};
    static const char *const elsewhere[] = {"128.0.0.1",       "10.0.0.1",       "::2",
                                            "::ffff:10.0.0.1", "localhost.evil", "127.0.0.1.evil"};
    for (size_t i = 0; i < sizeof here / sizeof *here; i++) CHECK(pal_address_is_loopback(here[i]));
    for (size_t i = 0; i < sizeof elsewhere / sizeof *elsewhere; i++) CHECK(!pal_address_is_loopback(elsewhere[i]));
}

static void a_page_is_of_the_very_host(void)
{
    CHECK(pal_origin_allowed("https://organ.example", "organ.example"));
    CHECK(pal_origin_allowed("http://organ.example:8090", "ORGAN.example:8090"));
    CHECK(!pal_origin_allowed("https://organ.example:8090", "organ.example"));
    CHECK(!pal_origin_allowed("https://organ.example.evil", "organ.example"));
    CHECK(!pal_origin_allowed("file://organ.example", "organ.example"));
    CHECK(!pal_origin_allowed("null", "null"));
    CHECK(pal_host_allowed("localhost:8090", false, ""));
    CHECK(!pal_host_allowed("organ.example", false, "organ.example"));
    CHECK(pal_host_allowed("organ.example", true, "other,organ.example"));
    CHECK(!pal_host_allowed("organ.example\r\nX: y", true, "organ.example"));
}

/* 30 stations behind one address load the page of 60 files at once: all get it, within the time that one waits. A flood
 * gets what the rate gives */
static void a_class_gets_the_page_and_a_flood_its_share(void)
{
    static pal_request_rate rate;
    uint64_t longest = 0;
    const uint64_t begin = 5000000000u;
    for (int i = 0; i < 30 * 60; i++) {
        const uint64_t wait = pal_request_rate_take(&rate, "192.0.2.1", begin);
        REQUIRE(wait != UINT64_MAX);
        longest = wait > longest ? wait : longest;
    }
    CHECK_LE((double)longest, (double)PAL_REQUEST_WAIT_NS);
    CHECK_INT(pal_request_rate_take(&rate, "192.0.2.2", begin), 0); /* another address does not notice */
    int served = 0;
    for (uint64_t t = 0; t < 10000; t++) /* 1,000 a second for ten seconds */
        served += pal_request_rate_take(&rate, "192.0.2.3", begin + t * 1000000u) != UINT64_MAX;
    CHECK_LE(served, PAL_REQUESTS_AT_ONCE + 14 * PAL_REQUESTS_1_S + 1);
    CHECK_LE(PAL_REQUESTS_AT_ONCE + 13 * PAL_REQUESTS_1_S, served);
    /* more addresses than are remembered: the one that has waited least is forgotten */
    char address[46];
    for (int i = 0; i < 2 * PAL_REQUEST_ADDRESSES; i++) {
        snprintf(address, sizeof address, "198.51.%d.%d", i / 200, i % 200);
        CHECK_INT(pal_request_rate_take(&rate, address, begin + 11000000000u), 0);
    }
}

int main(void)
{
    RUN(loopback_is_this_machine);
    RUN(a_page_is_of_the_very_host);
    RUN(a_class_gets_the_page_and_a_flood_its_share);
    return check_report();
}
