/* Packets, credit, rate limit, plain text and the viewer's files: the parts of the network room without a network. */
#include "server/net/transport/credit.h"
#include "server/net/transport/packet.h"
#include "server/net/transport/plain_text.h"
#include "server/net/transport/site.h"
#include "server/net/transport/tuning.h"
#include "tests/check.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/stat.h>

#define MS 1000000ull

static void packet_lives_as_long_as_its_last_user(void)
{
    size_t before = pal_packet_total();
    pal_packet *p = pal_packet_create("abc", 3, true), *place = NULL;
    REQUIRE(p);
    CHECK_INT(pal_packet_total(), before + 3);
    pal_packet_replace(&place, pal_packet_hold(p));
    pal_packet_drop(p);
    CHECK(place == p && memcmp(place->bytes, "abc", 3) == 0);
    memset(p->bytes - PAL_PACKET_HEADROOM, 0xFF, PAL_PACKET_HEADROOM);
    CHECK(p->n_byte == 3 && p->text && p->n_user == 1);
    pal_packet_replace(&place, NULL);
    CHECK_INT(pal_packet_total(), before);
    CHECK(pal_packet_create(NULL, SIZE_MAX - 8, false) == NULL);
}

static void credit_follows_the_smallest_round_trip(void)
{
    pal_credit c;
    uint64_t now = 1000 * MS;
    pal_credit_begin(&c, 60);
    /* 100 ms: 1 + ceil(60 x 0.1) = 7 */
    pal_credit_sent(&c, 1, now);
    CHECK(pal_credit_acknowledge(&c, 1, now + 100 * MS));
    CHECK_INT(c.max, 7);
    /* one of 1 ms: never more than covers it and a segment that is sent again */
    pal_credit_sent(&c, 2, now);
    CHECK(pal_credit_acknowledge(&c, 2, now + 1 * MS));
    CHECK_LE(c.max, 1 + ceil(60 * (0.001 + PAL_CREDIT_STALL_S)));
    /* a network that became slow is believed after two windows */
    for (uint32_t i = 3; i < 80; i++, now += 400 * MS) {
        pal_credit_sent(&c, i, now);
        CHECK(pal_credit_acknowledge(&c, i, now + 390 * MS));
    }
    CHECK_LE(1 + 60 * 0.39, c.max);
    CHECK_LE(c.max, 1 + ceil(60 * (0.39 + PAL_CREDIT_STALL_S)));
}

/* A line of a round trip, that takes so many cycles a second (0: any), and stands still now and then, as TCP does when
 * a segment is lost: cycles acknowledged a second, and the mean time from sending to acknowledgement, in the last 20 s
 * of 40 */
static void run_line(double rate_hz, uint64_t rtt_ns, double per_s, uint64_t stall_every_ns, uint64_t stall_ns,
                     double *cycles_s, double *age_s)
{
    static uint64_t sent_ns[1 << 14], ready_ns[1 << 14];
    pal_credit c;
    uint64_t line = 0;
    uint32_t n_sent = 0, n_acknowledged = 0;
    int n = 0;
    double age = 0;
    pal_credit_begin(&c, rate_hz);
    for (uint64_t now = 1 * MS; now < 40000 * MS; now += MS / 4) {
        for (; n_acknowledged < n_sent && ready_ns[n_acknowledged + 1] <= now;) {
            const uint32_t k = ++n_acknowledged;
            CHECK(pal_credit_acknowledge(&c, k, now));
            if (now > 20000 * MS) n++, age += 1e-9 * (double)(now - sent_ns[k]);
        }
        if (now % (uint64_t)(1e9 / rate_hz) >= MS / 4 || !pal_credit_free(&c) || n_sent + 2 > 1 << 14) continue;
        const uint32_t k = ++n_sent;
        sent_ns[k] = now;
        line = (line > now ? line : now) + (per_s > 0 ? (uint64_t)(1e9 / per_s) : 0);
        if (stall_every_ns && line % stall_every_ns < stall_ns) line += stall_ns - line % stall_every_ns;
        ready_ns[k] = line + rtt_ns;
        pal_credit_sent(&c, k, now);
    }
    *cycles_s = n / 20.0;
    *age_s = age / n;
}

/* the stream fills a long line, goes on while it stands still, and does not queue in a slow one */
static void credit_is_the_product_of_bandwidth_and_delay(void)
{
    double cycles_s, age_s;
    run_line(120, 200 * MS, 0, 0, 0, &cycles_s, &age_s);
    CHECK_LE(112, cycles_s); /* of 120: one goes alone every ten seconds. 60 with at most 12 in flight */
    CHECK_NEAR(age_s, 0.2, 0.002);
    run_line(120, 200 * MS, 0, 1000 * MS, 200 * MS, &cycles_s, &age_s);
    CHECK_LE(108, cycles_s);
    /* 46 a second at 40 ms: what a Mbit/s carries of the liver. It is filled, and what waits in it is as much as one
     * round trip and two cycles take */
    run_line(120, 40 * MS, 46, 0, 0, &cycles_s, &age_s);
    CHECK_LE(43, cycles_s);
    CHECK_LE(age_s, 0.04 + 0.04 + 2 / 46.0);
    run_line(120, 150 * MS, 20, 0, 0, &cycles_s, &age_s);
    CHECK_LE(18, cycles_s);
    CHECK_LE(age_s, 0.15 + 0.15 + 2 / 20.0);
}

static void credit_runs_out_and_comes_back(void)
{
    pal_credit c;
    pal_credit_begin(&c, 60);
    int n = 0;
    for (uint32_t cycle = 10; pal_credit_free(&c); cycle += 5, n++) pal_credit_sent(&c, cycle, 0);
    CHECK_INT(n, 3);
    CHECK(pal_credit_acknowledge(&c, 15, 5 * MS)); /* takes 10 with it */
    CHECK_INT(c.n_flight, 1);
    CHECK(pal_credit_acknowledge(&c, 15, 5 * MS)); /* again: harmless */
    CHECK(pal_credit_acknowledge(&c, 10, 5 * MS));
    CHECK(!pal_credit_acknowledge(&c, 17, 5 * MS)); /* never sent */
    CHECK(!pal_credit_acknowledge(&c, 25, 5 * MS)); /* to come   */
    CHECK_INT(c.n_flight, 1);
}

/* a client on loopback that takes 16 ms for a cycle while 120 a second are made: what waits at the client is no round
 * trip, so K stays near 1 + 120 x 0.017 (a K taken from every acknowledgement runs away) */
static void credit_does_not_grow_from_its_own_queue(void)
{
    pal_credit c;
    uint64_t ready[PAL_CREDIT_MAX] = {0}, busy = 0; /* when the client acknowledges what is in flight */
    uint32_t sent[PAL_CREDIT_MAX] = {0}, cycle = 0;
    int n = 0, max = 0, n_acknowledged = 0;
    pal_credit_begin(&c, 120);
    for (uint64_t now = 1 * MS; now < 60000 * MS; now += MS) {
        for (; n > 0 && ready[0] <= now; n--, n_acknowledged++) {
            CHECK(pal_credit_acknowledge(&c, sent[0], now));
            memmove(ready, ready + 1, sizeof ready - sizeof *ready);
            memmove(sent, sent + 1, sizeof sent - sizeof *sent);
        }
        if (c.max > max) max = c.max;
        if (now % (8 * MS) || !pal_credit_free(&c)) continue;
        pal_credit_sent(&c, ++cycle, now);
        /* the first cycle waits for the asset: 400 ms */
        busy = (now + 1 * MS > busy ? now + 1 * MS : busy) + (cycle == 1 ? 400 : 16) * MS;
        sent[n] = cycle;
        ready[n++] = busy;
        REQUIRE(n < PAL_CREDIT_MAX || now < 3000 * MS);
    }
    CHECK_LE(20, max); /* after the asset, for a second */
    CHECK_LE(c.max, 5);
    CHECK(n_acknowledged > 3600); /* of the 3750 that it could take in a minute */
}

static void acknowledging_nothing_is_a_stall(void)
{
    pal_credit c;
    pal_credit_begin(&c, 60);
    CHECK(!pal_credit_stalled(&c, 60000 * MS, 10000 * MS)); /* nothing sent, nothing owed */
    pal_credit_sent(&c, 1, 60000 * MS);
    CHECK(!pal_credit_stalled(&c, 69999 * MS, 10000 * MS));
    CHECK(pal_credit_stalled(&c, 70001 * MS, 10000 * MS));
    CHECK(pal_credit_acknowledge(&c, 1, 70001 * MS));
    CHECK(!pal_credit_stalled(&c, 90000 * MS, 10000 * MS));
}

static void bucket_lets_the_rate_through_and_no_more(void)
{
    pal_bucket b;
    pal_bucket_begin(&b, 600, 300, 0);
    int n = 0;
    for (int i = 0; i < 1000; i++) n += pal_bucket_take(&b, 0);
    CHECK_INT(n, 300);
    n = 0;
    for (int i = 1; i <= 10000; i++) n += pal_bucket_take(&b, (uint64_t)i * MS); /* 1000 a second for 10 s */
    CHECK_NEAR(n, 6000, 2);
}

static void text_becomes_valid_without_control_characters(void)
{
    char out[32];
    pal_plain_text(out, sizeof out, "a\nb\x7f\xC2\x85z");
    CHECK_TEXT(out, "a b  z");
    pal_plain_text(out, sizeof out, "\xFFx\xC0\xAF\xED\xA0\x80\xF5y");
    CHECK_TEXT(out, "?x??????y");
    pal_plain_text(out, 6, "ab\xC3\xA4\xC3\xB6");
    CHECK_TEXT(out, "ab\xC3\xA4"); /* cut at a character */
}

static void put(const char *folder, const char *name, const char *text)
{
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *f = fopen(path, "w");
    if (f) fputs(text, f), fclose(f);
}

static void files_come_only_from_inside_the_folder(void)
{
    char folder[] = "/tmp/palpate_site_XXXXXX", path[300],
         *bad[] = {"/secret.html", "/../out.html",   "/link.html", "/.hidden.html",   "/sub/../index.html",
                   "//index.html", "/%2e%2e/x.html", "index.html", "/a b.html",       "/noise",
                   "/noise.exe",   "/sub",           "/sub/",      "/up/passwd.html", ""};
    pal_site *site = NULL;
    pal_reply file;
    REQUIRE(mkdtemp(folder));
    CHECK_INT(pal_site_open(folder, NULL, &site), PAL_ERR_IO); /* no index.html */
    put(folder, "index.html", "<p>one");
    put(folder, ".hidden.html", "no");
    put(folder, "noise.exe", "no");
    snprintf(path, sizeof path, "%s/sub", folder);
    mkdir(path, 0700);
    put(path, "code.mjs", "export {}");
    snprintf(path, sizeof path, "%s/link.html", folder);
    CHECK_INT(symlink("/etc/passwd", path), 0);
    snprintf(path, sizeof path, "%s/up", folder);
    CHECK_INT(symlink("/etc", path), 0);
    REQUIRE(pal_site_open(folder, NULL, &site) == PAL_ERR_OK);
    REQUIRE(pal_site_get(site, "/", &file));
    CHECK_TEXT(file.type, "text/html; charset=utf-8");
    pal_packet_drop(file.body);
    REQUIRE(pal_site_get(site, "/sub/code.mjs", &file));
    CHECK_TEXT(file.type, "text/javascript; charset=utf-8");
    CHECK(file.body->n_byte == 9 && strlen(file.etag) == 34);
    pal_packet_drop(file.body);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        if (pal_site_get(site, bad[i], &file)) CHECK_FAIL("%s was served", bad[i]);
    snprintf(path, sizeof path, "rm -r %s", folder);
    pal_site_close(site);
    CHECK_INT(system(path), 0);
}

static void changed_file_has_another_tag(void)
{
    char folder[] = "/tmp/palpate_site_XXXXXX", path[300], tag[64];
    pal_site *site = NULL;
    pal_reply file;
    REQUIRE(mkdtemp(folder));
    put(folder, "index.html", "<p>one");
    REQUIRE(pal_site_open(folder, NULL, &site) == PAL_ERR_OK);
    REQUIRE(pal_site_get(site, "/index.html", &file));
    snprintf(tag, sizeof tag, "%s", file.etag);
    pal_packet *fixed = file.body;
    REQUIRE(pal_site_get(site, "/", &file));
    CHECK_TEXT(file.etag, tag);
    CHECK(file.body == fixed); /* not read again */
    pal_packet_drop(file.body);
    put(folder, "index.html", "<p>three");
    REQUIRE(pal_site_get(site, "/", &file));
    CHECK(strcmp(file.etag, tag) != 0);
    CHECK(file.body->n_byte == 8 && fixed->n_byte == 6); /* a reply that is under way keeps its bytes */
    pal_packet_drop(fixed);
    pal_packet_drop(file.body);
    snprintf(path, sizeof path, "%s/index.html", folder);
    unlink(path);
    CHECK(!pal_site_get(site, "/", &file));
    pal_site_close(site);
    rmdir(folder);
}

int main(void)
{
    RUN(packet_lives_as_long_as_its_last_user);
    RUN(credit_follows_the_smallest_round_trip);
    RUN(credit_is_the_product_of_bandwidth_and_delay);
    RUN(credit_runs_out_and_comes_back);
    RUN(credit_does_not_grow_from_its_own_queue);
    RUN(acknowledging_nothing_is_a_stall);
    RUN(bucket_lets_the_rate_through_and_no_more);
    RUN(text_becomes_valid_without_control_characters);
    RUN(files_come_only_from_inside_the_folder);
    RUN(changed_file_has_another_tag);
    return check_report();
}
