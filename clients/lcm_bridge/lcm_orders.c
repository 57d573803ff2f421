#include "clients/lcm_bridge/lcm_orders.h"
#include "clients/lcm_bridge/tuning.h"

#include "palpate_answer_t.h"
#include "palpate_order_t.h"
#include "server/base/clock.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static char *text_of(const char *text)
{
    return (char *)(uintptr_t)text;
}

static void publish(pal_lcm_orders *o, palpate_answer_t *answer)
{
    static char none[] = "";
    answer->utime = (int64_t)(pal_clock_ns() / 1000);
    answer->seq = o->seq;
    answer->version = PAL_LCM_VERSION;
    if (!answer->verb) answer->verb = none;
    if (!answer->code) answer->code = none;
    (void)pal_lcm_link_publish(o->lcm, o->session, "ANSWER", -1, palpate_answer_t_get_type_info(), answer);
}

static void refuse(pal_lcm_orders *o, const char *verb, const char *code, const char *text)
{
    o->n_refused++;
    publish(o, &(palpate_answer_t){.verb = text_of(verb), .code = text_of(code), .text = text_of(text)});
}

static void publish_answer(pal_lcm_orders *o, const pal_wire_answer *from)
{
    char *key[PAL_WIRE_ARG_MAX];
    double value[PAL_WIRE_ARG_MAX];
    for (uint32_t i = 0; i < from->n_arg; i++) key[i] = text_of(from->arg[i].key), value[i] = from->arg[i].value;
    publish(o, &(palpate_answer_t){.done = true,
                                   .verb = text_of(from->verb),
                                   .text = text_of(from->text),
                                   .n_arg = (int8_t)from->n_arg,
                                   .key = key,
                                   .value = value});
}

void pal_lcm_orders_control(pal_lcm_orders *o, const pal_control *c)
{
    if (c->type == PAL_CONTROL_HELLO) o->is_given = false;
    if (!o->is_given) return;
    if (c->type == PAL_CONTROL_ANSWER) publish_answer(o, &c->answer);
    if (c->type == PAL_CONTROL_ERROR) refuse(o, NULL, c->error.code, c->error.text);
}

/* false: a word is too long, or there are too many numbers */
static bool command_of(const palpate_order_t *from, pal_wire_command *to)
{
    *to = (pal_wire_command){.n_arg = 0};
    bool good = from->version == PAL_LCM_VERSION && from->n_arg >= 0 && from->n_arg <= PAL_WIRE_ARG_MAX &&
                snprintf(to->verb, sizeof to->verb, "%s", from->verb) < (int)sizeof to->verb &&
                snprintf(to->target, sizeof to->target, "%s", from->target) < (int)sizeof to->target;
    for (int i = 0; good && i < from->n_arg; i++) {
        pal_wire_arg *arg = &to->arg[to->n_arg++];
        good =
            isfinite(from->value[i]) && snprintf(arg->key, sizeof arg->key, "%s", from->key[i]) < (int)sizeof arg->key;
        arg->value = from->value[i];
    }
    return good;
}

static void pass_on(pal_lcm_orders *o, const palpate_order_t *order)
{
    pal_control c = {.type = PAL_CONTROL_COMMAND};
    if (!command_of(order, &c.command)) {
        refuse(o, order->verb, "args", "the order is of another version, or has too long words or too many numbers");
    } else if (o->tokens < 1) {
        refuse(o, order->verb, "busy", "more than 10 orders a second");
    } else if (pal_link_current_state(o->link) != PAL_LINK_JOINED) {
        refuse(o, order->verb, "server", "the session cannot be reached now");
    } else if (pal_link_send_control(o->link, &c)) {
        refuse(o, order->verb, "args", "the order does not fit in a message");
    } else {
        o->tokens -= 1;
        o->is_given = true;
        o->n_order++;
    }
}

void pal_lcm_orders_take(pal_lcm_orders *o, const void *bytes, size_t n_byte, uint64_t source, uint64_t now_ns)
{
    palpate_order_t order;
    if (palpate_order_t_decode(bytes, 0, (int)n_byte, &order) < 0) return;
    const uint64_t since_ns = now_ns - o->last_ns;
    const bool restarted = !o->last_ns || source != o->source || (!source && since_ns >= PAL_ORDERS_AGAIN_NS);
    if (restarted || order.seq - o->seq > 0) {
        o->source = source, o->seq = order.seq, o->last_ns = now_ns;
        o->tokens = fmin(PAL_ORDERS_BURST, o->tokens + PAL_ORDERS_1_S * 1e-9 * (double)since_ns);
        pass_on(o, &order);
    }
    palpate_order_t_decode_cleanup(&order);
}
