/* Orders of the bus: what is passed on, and that each one that is not is refused in words. The member is a stand-in. */
#include "clients/lcm_bridge/lcm_orders.h"
#include "clients/lcm_bridge/tuning.h"
#include "palpate_answer_t.h"
#include "palpate_order_t.h"
#include "tests/check.h"

pal_err __wrap_pal_link_send_control(pal_link *link, const pal_control *c);
pal_link_state __wrap_pal_link_current_state(const pal_link *link);

static pal_link_state state = PAL_LINK_JOINED;
static int n_sent, n_answer;
static pal_wire_command sent;
static pal_lcm_link *lcm;
static pal_lcm_orders orders;
static uint64_t now_ns = 1000000000;
static struct {
    int seq, done, n_arg;
    char verb[32], code[32], text[PAL_WIRE_TEXT_BYTES];
    double value;
} answer;

pal_err __wrap_pal_link_send_control(pal_link *link, const pal_control *c)
{
    (void)link;
    CHECK_INT(c->type, PAL_CONTROL_COMMAND);
    sent = c->command;
    n_sent++;
    return PAL_ERR_OK;
}

pal_link_state __wrap_pal_link_current_state(const pal_link *link)
{
    (void)link;
    return state;
}

static void on_answer(void *user, const char *channel, const void *bytes, size_t n_byte, uint64_t source)
{
    (void)user, (void)source;
    palpate_answer_t a;
    CHECK_TEXT(channel, "PALPATE1/main/ANSWER");
    REQUIRE(palpate_answer_t_decode(bytes, 0, (int)n_byte, &a) >= 0);
    answer.seq = a.seq, answer.done = a.done, answer.n_arg = a.n_arg, answer.value = a.n_arg ? a.value[0] : 0;
    snprintf(answer.verb, sizeof answer.verb, "%s", a.verb);
    snprintf(answer.code, sizeof answer.code, "%s", a.code);
    snprintf(answer.text, sizeof answer.text, "%s", a.text);
    palpate_answer_t_decode_cleanup(&a);
    n_answer++;
}

static void begin(void)
{
    now_ns += 60000000000u;
    orders = (pal_lcm_orders){.lcm = lcm, .session = "main", .tokens = PAL_ORDERS_BURST};
    state = PAL_LINK_JOINED;
    n_sent = n_answer = 0;
    memset(&answer, 0, sizeof answer);
}

static void take(const palpate_order_t *order, uint64_t source)
{
    uint8_t bytes[4096];
    const int n = palpate_order_t_encode(bytes, 0, sizeof bytes, order);
    REQUIRE(n > 0);
    pal_lcm_orders_take(&orders, bytes, (size_t)n, source, now_ns);
    pal_lcm_link_handle(lcm);
}

static char young[] = "young_Pa", liver[] = "liver", material[] = "material";
static palpate_order_t an_order(int32_t seq)
{
    static char *key[1] = {young};
    static double value[1] = {4500};
    return (palpate_order_t){.seq = seq,
                             .version = PAL_LCM_VERSION,
                             .verb = material,
                             .target = liver,
                             .n_arg = 1,
                             .key = key,
                             .value = value};
}

static void an_order_is_passed_on_once(void)
{
    begin();
    for (int32_t seq = -1; seq < 3; seq++) {
        const palpate_order_t order = an_order(seq);
        for (int repeat = 0; repeat < 3; repeat++) take(&order, 7);
        CHECK_INT(n_sent, seq + 2);
    }
    CHECK_TEXT(sent.verb, "material");
    CHECK_TEXT(sent.target, "liver");
    CHECK_INT(sent.n_arg, 1);
    CHECK_TEXT(sent.arg[0].key, "young_Pa");
    CHECK_NEAR(sent.arg[0].value, 4500, 0);
    CHECK_INT(n_answer, 0);
    CHECK_INT(orders.n_order, 4);
    CHECK_INT(orders.n_refused, 0);
}

/* one that begins again is another source, or has no seal and was silent */
static void a_sender_may_begin_again(void)
{
    begin();
    const palpate_order_t fifth = an_order(5), first = an_order(1);
    take(&fifth, 7);
    take(&first, 7);
    CHECK_INT(n_sent, 1);
    take(&first, 8);
    CHECK_INT(n_sent, 2);
    take(&fifth, 0);
    now_ns += PAL_ORDERS_AGAIN_NS - 1;
    take(&first, 0);
    CHECK_INT(n_sent, 3);
    now_ns += 1;
    take(&first, 0);
    CHECK_INT(n_sent, 4);
}

/* none waits, to be carried out later than its sender expects */
static void without_a_session_it_is_refused(void)
{
    static const pal_link_state away[] = {PAL_LINK_CONNECTING, PAL_LINK_OPEN, PAL_LINK_LOST, PAL_LINK_ENDED};
    begin();
    for (int i = 0; i < 4; i++) {
        const palpate_order_t order = an_order(i + 1);
        state = away[i];
        take(&order, 7);
        CHECK_INT(n_answer, i + 1);
        CHECK_INT(answer.seq, i + 1);
        CHECK_INT(answer.done, 0);
        CHECK_TEXT(answer.code, "server");
        CHECK_TEXT(answer.verb, "material");
        state = PAL_LINK_JOINED;
        take(&order, 7); /* a repeat does not go through after all */
        CHECK_INT(n_sent, 0);
    }
    CHECK_INT(orders.n_refused, 4);
}

static void what_does_not_fit_is_refused(void)
{
    static char *key[PAL_WIRE_ARG_MAX + 1], longest[200];
    static double value[PAL_WIRE_ARG_MAX + 1];
    begin();
    memset(longest, 'x', sizeof longest - 1);
    for (int i = 0; i <= PAL_WIRE_ARG_MAX; i++) key[i] = young;
    palpate_order_t bad[5];
    for (int i = 0; i < 5; i++) bad[i] = an_order(i + 1);
    bad[0].version = PAL_LCM_VERSION + 1;
    bad[1].verb = longest;
    bad[2].target = longest;
    bad[3].n_arg = PAL_WIRE_ARG_MAX + 1, bad[3].key = key, bad[3].value = value;
    bad[4].key = (char *[]){longest};
    for (int i = 0; i < 5; i++) {
        take(&bad[i], 7);
        CHECK_INT(n_answer, i + 1);
        CHECK_INT(answer.seq, i + 1);
        CHECK_TEXT(answer.code, "args");
    }
    CHECK_INT(n_sent, 0);
}

/* more would close the member's connection, and so end the stream of the bus */
static void a_flood_is_bounded(void)
{
    begin();
    for (int32_t seq = 1; seq <= 1000; seq++) {
        const palpate_order_t order = an_order(seq);
        take(&order, 7);
        now_ns += 1000000;
    }
    CHECK_LE(PAL_ORDERS_BURST, n_sent);
    CHECK_LE(n_sent, PAL_ORDERS_BURST + PAL_ORDERS_1_S);
    CHECK_INT(n_answer, 1000 - n_sent);
    CHECK_TEXT(answer.code, "busy");
    CHECK_INT(answer.seq, 1000);
}

static void what_the_session_says_goes_to_the_bus(void)
{
    static pal_control c;
    begin();
    /* about the ticket, before any order */
    c = (pal_control){.type = PAL_CONTROL_ERROR, .error = {"role", "your ticket is for a trainee"}};
    pal_lcm_orders_control(&orders, &c);
    pal_lcm_link_handle(lcm);
    CHECK_INT(n_answer, 0);
    const palpate_order_t order = an_order(3);
    take(&order, 7);
    c = (pal_control){.type = PAL_CONTROL_ERROR, .error = {"role", "material: only for instructors"}};
    pal_lcm_orders_control(&orders, &c);
    pal_lcm_link_handle(lcm);
    CHECK_INT(n_answer, 1);
    CHECK_INT(answer.done, 0);
    CHECK_INT(answer.seq, 3);
    CHECK_TEXT(answer.code, "role");
    CHECK_TEXT(answer.text, "material: only for instructors");
    CHECK_INT(orders.n_refused, 1);
    c = (pal_control){.type = PAL_CONTROL_ANSWER,
                      .answer = {.verb = "extrude", .text = "28 cells", .n_arg = 1, .arg = {{"cells", 28}}}};
    pal_lcm_orders_control(&orders, &c);
    pal_lcm_link_handle(lcm);
    CHECK_INT(n_answer, 2);
    CHECK_INT(answer.done, 1);
    CHECK_INT(answer.n_arg, 1);
    CHECK_NEAR(answer.value, 28, 0);
    CHECK_TEXT(answer.verb, "extrude");
    /* it joins again, and hears of its ticket again */
    c = (pal_control){.type = PAL_CONTROL_HELLO};
    pal_lcm_orders_control(&orders, &c);
    c = (pal_control){.type = PAL_CONTROL_ERROR, .error = {"role", "your ticket is for a trainee"}};
    pal_lcm_orders_control(&orders, &c);
    pal_lcm_link_handle(lcm);
    CHECK_INT(n_answer, 2);
}

int main(void)
{
    static const pal_lcm_events events = {NULL, on_answer, NULL};
    if (pal_lcm_link_open(NULL, &(pal_lcm_options){.url = "memq://"}, &events, NULL, NULL, &lcm)) return 1;
    pal_lcm_link_subscribe(lcm, ".*/ANSWER", palpate_answer_t_get_type_info());
    RUN(an_order_is_passed_on_once);
    RUN(a_sender_may_begin_again);
    RUN(without_a_session_it_is_refused);
    RUN(what_does_not_fit_is_refused);
    RUN(a_flood_is_bounded);
    RUN(what_the_session_says_goes_to_the_bus);
    pal_lcm_link_close(lcm);
    return check_report();
}
