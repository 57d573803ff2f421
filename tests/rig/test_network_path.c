/* The network paths of the rig in virtual time. What happens by chance follows from the seed, so every number here is
 * the same on every machine; bounds of shares are four standard deviations of the binomial distribution. */
#include "tests/check.h"
#include "tests/rig/network_path.h"
#include "tests/rig/tuning.h"

#define MS 1000000u
#define S  1000000000u
enum { SEEDS = 8 };

static uint64_t timeout_ns(int n_lost) /* the sum of so many timeouts at a round trip below 200 ms */
{
    return (uint64_t)((1 << n_lost) - 1) * 200 * MS;
}

static void delays_are_uniform_around_half_the_round_trip(void)
{
    enum { N = 20000 };
    const network_profile *p = network_find_profile("150");
    REQUIRE(p);
    int tenth[10] = {0};
    double sum = 0, low = 1, high = 0;
    int n = 0;
    network_path path = network_path_make(p, 3);
    path.profile.reorder = 0;
    network_flow flow = network_flow_make(&path);
    for (uint64_t i = 0; i < N; i++) {
        const uint64_t now = i * S, arrival = network_send_datagram(&flow, now, 100);
        if (arrival == NETWORK_LOST) continue;
        const double delay = (double)(arrival - now) * 1e-9;
        low = fmin(low, delay), high = fmax(high, delay), sum += delay, n++;
        tenth[(int)fmin(9, (delay - 0.05) / 0.005)]++;
    }
    REQUIRE(n > 0);
    /* 75 +- 25 ms: standard deviation 25 / sqrt(3) ms */
    CHECK_LE(0.05, low);
    CHECK_LE(high, 0.1);
    CHECK_NEAR(sum / n, 0.075, 4 * 0.025 / sqrt(3.0 * n));
    for (int k = 0; k < 10; k++) CHECK_NEAR(tenth[k], 0.1 * n, 4 * sqrt(0.1 * 0.9 * n));
}

static void loss_has_its_share_and_no_memory(void)
{
    enum { N = 100000 };
    for (const network_profile *p = network_profiles; p->name; p++)
        for (uint64_t seed = 0; seed < SEEDS; seed++) {
            network_path path = network_path_make(p, seed);
            network_flow flow = network_flow_make(&path);
            path.profile.outage_s = 0;
            int n_lost = 0, n_pair = 0;
            bool before = false;
            for (uint64_t i = 0; i < N; i++) {
                const bool lost = network_send_datagram(&flow, i * MS, 100) == NETWORK_LOST;
                n_lost += lost, n_pair += lost && before;
                before = lost;
            }
            const double pair = p->loss * p->loss;
            CHECK_NEAR(n_lost, p->loss * N, 4 * sqrt(p->loss * (1 - p->loss) * N));
            /* pairs that share a packet are not independent: variance N p^2 (1 - p) (1 + 3 p) */
            CHECK_NEAR(n_pair, pair * N, 4 * sqrt(pair * (1 - p->loss) * (1 + 3 * p->loss) * N));
            CHECK_INT(path.count.lost, n_lost);
            CHECK_INT(path.count.packets, N);
            CHECK_INT(path.count.bytes, 100 * N);
        }
}

/* the numbers themselves: another random sequence is another rig */
static void a_seed_gives_these_losses(void)
{
    const struct {
        const char *profile;
        int lost[3]; /* of 1000 datagrams with seeds 0, 1, 2 */
    } expected[] = {{"80", {20, 24, 24}}, {"150", {53, 55, 49}}, {"200", {203, 194, 205}}};
    for (int k = 0; k < 3; k++)
        for (uint64_t seed = 0; seed < 3; seed++) {
            network_path path = network_path_make(network_find_profile(expected[k].profile), seed);
            network_flow flow = network_flow_make(&path);
            for (uint64_t i = 0; i < 1000; i++) network_send_datagram(&flow, i * MS, 100);
            CHECK_INT(path.count.lost, expected[k].lost[seed]);
        }
}

static void datagrams_keep_their_order_without_reordering(void)
{
    network_path path = network_path_make(network_find_profile("150"), 5);
    path.profile.reorder = 0;
    network_flow flow = network_flow_make(&path);
    uint64_t last = 0;
    int n_together = 0;
    for (uint64_t i = 0; i < 10000; i++) {
        const uint64_t arrival = network_send_datagram(&flow, 4 * MS * i, 100);
        if (arrival == NETWORK_LOST) continue;
        CHECK(arrival >= last);
        n_together += arrival == last;
        last = arrival;
    }
    CHECK(n_together > 0); /* jitter of +-25 ms is more than 4 ms: some caught up */
}

static void the_reordered_share_arrives_later_by_one_delay(void)
{
    enum { N = 50000 };
    const network_profile p = {.round_trip_s = 0.1, .reorder = 0.03};
    network_path path = network_path_make(&p, 2);
    network_flow flow = network_flow_make(&path);
    network_queue queue = {NULL};
    int n_longer = 0, n_overtaken = 0;
    for (uint64_t i = 0; i < N; i++) {
        const uint64_t now = 4 * MS * i, arrival = network_send_datagram(&flow, now, 100);
        CHECK(arrival == now + 50 * MS || arrival == now + 100 * MS);
        n_longer += arrival == now + 100 * MS;
        CHECK_INT(network_queue_add(&queue, arrival, 0, (const uint8_t *)&i, sizeof i), PAL_ERR_OK);
    }
    uint64_t last = 0;
    for (; queue.first; network_queue_remove_first(&queue)) {
        uint64_t number;
        memcpy(&number, queue.first->bytes, sizeof number);
        n_overtaken += number < last;
        last = number > last ? number : last;
    }
    CHECK_INT(path.count.reordered, n_longer);
    CHECK_NEAR(n_longer, 0.03 * N, 4 * sqrt(0.03 * 0.97 * N));
    /* all but those without a usual one among the 12 after them */
    CHECK_NEAR(n_overtaken, n_longer, 2);
}

static void a_stream_keeps_its_order_and_loses_nothing(void)
{
    for (const network_profile *p = network_profiles; p->name; p++)
        for (uint64_t seed = 0; seed < SEEDS; seed++) {
            network_path path = network_path_make(p, seed);
            network_flow flow = network_flow_make(&path);
            uint64_t last = 0, now = 0;
            for (int i = 0; i < 5000; i++) {
                now = now + 4 * MS > network_ready_ns(&flow) ? now + 4 * MS : network_ready_ns(&flow);
                const uint64_t arrival = network_send_segment(&flow, now, 100);
                CHECK(arrival != NETWORK_LOST && arrival >= last && arrival >= now);
                last = arrival;
            }
            CHECK_INT(path.count.retransmissions, path.count.lost + path.count.in_outage);
        }
}

static void a_lost_segment_stalls_the_stream_by_doubled_timeouts(void)
{
    enum { N = 20000 };
    const network_profile p = {.round_trip_s = 0.1, .loss = 0.2};
    network_path path = network_path_make(&p, 4);
    network_flow flow = network_flow_make(&path);
    int n[RIG_RETRIES + 1] = {0};
    uint64_t now = 0;
    for (int i = 0; i < N; i++) {
        const uint64_t before = path.count.lost, arrival = network_send_segment(&flow, now, 100);
        const int n_lost = (int)(path.count.lost - before);
        REQUIRE(n_lost <= RIG_RETRIES);
        CHECK_INT(arrival - now, 50 * MS + timeout_ns(n_lost));
        CHECK_INT(network_ready_ns(&flow) - now, timeout_ns(n_lost));
        n[n_lost]++;
        now = network_ready_ns(&flow) + S;
    }
    for (int k = 0; k < 4; k++) {
        const double share = 0.8 * pow(0.2, k);
        CHECK_NEAR(n[k], share * N, 4 * sqrt(share * (1 - share) * N));
    }
    /* a round trip above 200 ms is the timeout */
    path.profile.round_trip_s = 0.5;
    path.profile.loss = 1;
    network_send_segment(&flow, now, 100);
    /* 0.5 s doubled up to 64 s, then 120 s each: 8 and 8 transmissions */
    CHECK_INT(network_ready_ns(&flow) - now, 127500ull * MS + 8 * 120ull * S);
}

static void a_segment_is_given_up_after_the_time_of_linux(void)
{
    const network_profile p = {.loss = 1};
    network_path path = network_path_make(&p, 4);
    network_flow flow = network_flow_make(&path);
    CHECK(network_send_segment(&flow, 7, 100) == NETWORK_LOST);
    /* tcp_retries2 = 15: "a hypothetical timeout of 924.6 seconds" (ip-sysctl of the kernel's documentation) */
    CHECK_INT(network_ready_ns(&flow), 7 + 924600ull * MS);
    CHECK_INT(path.count.given_up, 1);
    CHECK_INT(path.count.retransmissions, RIG_RETRIES);
}

/* MSS / RTT sqrt(3/2 / p): Mathis, Semke, Mahdavi, Ott 1997. Ours has no congestion control, only timeouts. */
static void a_lossy_stream_is_about_as_fast_as_tcp(void)
{
    for (const network_profile *p = network_profiles; p->name; p++) {
        if (p->loss == 0) continue;
        enum { N = 20000 };
        network_path path = network_path_make(p, 1);
        network_flow flow = network_flow_make(&path);
        for (int i = 0; i < N; i++) network_send_segment(&flow, network_ready_ns(&flow), RIG_SEGMENT);
        const double rate = N * (double)RIG_SEGMENT / ((double)network_ready_ns(&flow) * 1e-9);
        const double mathis = RIG_SEGMENT / p->round_trip_s * sqrt(1.5 / p->loss);
        printf("  %s: %.1f kB/s, %.2f of Mathis' formula\n", p->name, rate * 1e-3, rate / mathis);
        CHECK_LE(mathis / 3, rate);
        CHECK_LE(rate, mathis * 3);
    }
}

static void a_line_transmits_one_packet_after_another(void)
{
    /* 1 Mbit/s: 125 bytes take 1 ms */
    const network_profile p = {.round_trip_s = 0.02, .bits_s = 1e6, .queue_s = 0.2};
    network_path path = network_path_make(&p, 1);
    network_flow one = network_flow_make(&path), other = network_flow_make(&path);
    /* 200 ms are in the queue once 201 were added: the first leaves at once */
    for (uint64_t i = 0; i < 300; i++) {
        const uint64_t arrival = network_send_datagram(i & 1 ? &other : &one, 0, 125);
        CHECK(arrival == (i <= 200 ? (i + 1) * MS + 10 * MS : NETWORK_LOST));
    }
    CHECK_INT(path.count.queue_dropped, 99);
    CHECK_INT(network_ready_ns(&one), MS);
    /* a stream that sends whenever it may: 125,000 bytes a second */
    uint64_t n_byte = 0;
    for (uint64_t now = S; now<11ull * S; now = network_ready_ns(&one)> now ? network_ready_ns(&one) : now)
        network_send_segment(&one, now, 500), n_byte += 500;
    CHECK_NEAR((double)n_byte, 10.2 * 125000, 500);
}

static void the_same_seed_gives_the_same_arrivals(void)
{
    const network_profile *p = network_find_profile("150");
    network_path path = network_path_make(p, 9), again = network_path_make(p, 9), another = network_path_make(p, 10);
    network_flow flow = network_flow_make(&path), flow_again = network_flow_make(&again);
    network_flow beside = network_flow_make(&again), flow_another = network_flow_make(&another);
    int n_other = 0, n_beside = 0;
    for (uint64_t i = 0; i < 1000; i++) {
        const uint64_t arrival = network_send_datagram(&flow, i * S, 100);
        /* whatever other flows send */
        if (i % 3) n_beside += network_send_datagram(&beside, i * S, 999) != arrival;
        CHECK(network_send_datagram(&flow_again, i * S, 100) == arrival);
        n_other += network_send_datagram(&flow_another, i * S, 100) != arrival;
    }
    CHECK_LE(900, n_other);
    CHECK_LE(600, n_beside);
}

static void nothing_arrives_in_an_outage(void)
{
    const network_profile *p = network_find_profile("outage");
    network_path path = network_path_make(p, 1);
    network_flow flow = network_flow_make(&path);
    for (uint64_t ms = 0; ms < 30000; ms++) {
        const bool outage = ms % 10000 >= 5000 && ms % 10000 < 7000;
        CHECK((network_send_datagram(&flow, ms * MS, 100) == NETWORK_LOST) == outage);
    }
    CHECK_INT(path.count.in_outage, 6000);
    network_profile once = *p;
    once.outage_every_s = 0;
    CHECK(network_in_outage(&once, 6ull * S) && !network_in_outage(&once, 16ull * S));
}

static void a_stream_goes_on_after_an_outage(void)
{
    network_path path = network_path_make(network_find_profile("outage"), 1);
    network_flow flow = network_flow_make(&path);
    /* transmissions at 5, 5.2, 5.6, 6.4 and 8 s */
    CHECK_INT(network_send_segment(&flow, 5ull * S, 100), 8ull * S);
    CHECK_INT(network_ready_ns(&flow), 8ull * S);
    /* at 16.9 and 17.1 s */
    CHECK_INT(network_send_segment(&flow, 16900ull * MS, 100), 17100ull * MS);
    CHECK_INT(path.count.in_outage, 5);
}

static void packets_wait_by_arrival_then_by_departure(void)
{
    network_queue queue = {NULL};
    CHECK(network_queue_next_ns(&queue) == NETWORK_LOST);
    const struct {
        uint64_t arrival;
        uint8_t byte;
    } added[] = {{5, 'b'}, {9, 'e'}, {5, 'c'}, {3, 'a'}, {9, 'f'}, {7, 'd'}, {10, 'g'}};
    for (size_t i = 0; i < sizeof added / sizeof *added; i++)
        CHECK_INT(network_queue_add(&queue, added[i].arrival, 0, &added[i].byte, 1), PAL_ERR_OK);
    CHECK_INT(queue.n_byte, 7);
    CHECK_INT(network_queue_next_ns(&queue), 3);
    char order[8] = "";
    for (int i = 0; queue.first; i++, network_queue_remove_first(&queue)) order[i] = (char)queue.first->bytes[0];
    CHECK_TEXT(order, "abcdefg");
    CHECK_INT(queue.n_byte, 0);
}

static void an_impossible_profile_is_refused(void)
{
    pal_diagnostic diag = {""};
    const network_profile early = {.round_trip_s = 0.02, .jitter_s = 0.03};
    CHECK_INT(network_check_profile(&early, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text,
               "a jitter of 30 ms is more than the round trip of 20 ms: a packet would arrive before it leaves");
    const network_profile dead = {.outage_s = 2, .outage_every_s = 2};
    CHECK_INT(network_check_profile(&dead, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "an outage of 2 s every 2 s leaves no time between them");
    for (const network_profile *p = network_profiles; p->name; p++) CHECK_INT(network_check_profile(p, NULL), 0);
    CHECK(!network_find_profile("moon"));
}

int main(void)
{
    RUN(delays_are_uniform_around_half_the_round_trip);
    RUN(loss_has_its_share_and_no_memory);
    RUN(a_seed_gives_these_losses);
    RUN(datagrams_keep_their_order_without_reordering);
    RUN(the_reordered_share_arrives_later_by_one_delay);
    RUN(a_stream_keeps_its_order_and_loses_nothing);
    RUN(a_lost_segment_stalls_the_stream_by_doubled_timeouts);
    RUN(a_segment_is_given_up_after_the_time_of_linux);
    RUN(a_lossy_stream_is_about_as_fast_as_tcp);
    RUN(a_line_transmits_one_packet_after_another);
    RUN(the_same_seed_gives_the_same_arrivals);
    RUN(nothing_arrives_in_an_outage);
    RUN(a_stream_goes_on_after_an_outage);
    RUN(packets_wait_by_arrival_then_by_departure);
    RUN(an_impossible_profile_is_refused);
    return check_report();
}
