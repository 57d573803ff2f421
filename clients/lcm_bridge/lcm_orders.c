#include "clients/lcm_bridge/lcm_orders.h"

#include "palpate_answer_t.h"
#include "palpate_order_t.h"
#include "server/base/clock.h"
#include "server/base/log.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void publish(pal_lcm_orders *o, const pal_wire_answer *answer, const pal_wire_error *error)
{
    char *key[PAL_WIRE_ARG_MAX];
    double value[PAL_WIRE_ARG_MAX];
    static char none[] = "";
    palpate_answer_t a = {.utime = (int64_t)(pal_clock_ns() / 1000),
                          .seq = o->seq,
                          .version = PAL_LCM_VERSION,
                          .done = answer != NULL,
                          .verb = answer ? (char *)(uintptr_t)answer->verb : none,
                          .code = error ? (char *)(uintptr_t)error->code : none,
                          .text = answer ? (char *)(uintptr_t)answer->text : (char *)(uintptr_t)error->text,
                          .n_arg = answer ? (int8_t)answer->n_arg : 0,
                          .key = key,
                          .value = value};
    for (int i = 0; i < a.n_arg; i++) {
        key[i] = (char *)(uintptr_t)answer->arg[i].key;
        value[i] = answer->arg[i].value;
    }
    (void)pal_lcm_link_publish(o->lcm, o->session, "ANSWER", -1, palpate_answer_t_get_type_info(), &a);
}

static void control(void *user, const pal_control *c)
{
    pal_lcm_orders *o = user;
    if (c->type == PAL_CONTROL_ANSWER) publish(o, &c->answer, NULL);
    if (c->type == PAL_CONTROL_ERROR) publish(o, NULL, &c->error);
}

static void send_pending(pal_lcm_orders *o)
{
    for (int i = 0; i < o->n_pending; i++)
        if (pal_link_send_control(o->link, &o->pending[i])) o->n_refused++;
    o->n_pending = 0;
}

static void state(void *user, pal_link_state now, int code, const char *reason)
{
    pal_lcm_orders *o = user;
    if (now == PAL_LINK_JOINED) send_pending(o);
    if (now == PAL_LINK_ENDED) pal_log(PAL_LOG_WARN, "lcm_order", "%d %s", code, reason);
}

/* what it is shown is of no use here, but has to be acknowledged */
static void message(void *user, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte)
{
    const pal_lcm_orders *o = user;
    if (head->kind == PAL_WIRE_TOOLS) pal_link_acknowledge(o->link, bytes, n_byte);
}

static pal_err join(pal_lcm_orders *o)
{
    static const pal_link_events events = {state, control, message, NULL};
    const pal_link_options options = {.url = o->server,
                                      .name = "lcm orders",
                                      .role = PAL_WIRE_ROLE_INSTRUCTOR,
                                      .tool = PAL_WIRE_TOOL_NONE,
                                      .events = &events,
                                      .user = o};
    return o->link ? PAL_ERR_OK : pal_link_open(o->loop, &options, NULL, &o->link);
}

/* false: a word is too long, or a number is not finite */
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

void pal_lcm_orders_take(pal_lcm_orders *o, const void *bytes, size_t n_byte, uint64_t source)
{
    palpate_order_t order;
    pal_control c = {.type = PAL_CONTROL_COMMAND};
    if (palpate_order_t_decode(bytes, 0, (int)n_byte, &order) < 0) return;
    const bool again = o->n_order > 0 && source == o->source && order.seq - o->seq <= 0,
               good = command_of(&order, &c.command);
    if (!again && good && o->n_pending < PAL_ORDERS_PENDING && !join(o)) {
        o->n_order++;
        o->source = source, o->seq = order.seq;
        o->pending[o->n_pending++] = c;
        if (pal_link_current_state(o->link) == PAL_LINK_JOINED) send_pending(o);
    } else if (!again) {
        o->n_refused++;
    }
    palpate_order_t_decode_cleanup(&order);
}
