/* Orders on the bus: ORDER, order_t (lcmtypes/), become commands of the member that watches, whose rights its ticket
 * gives; what the session says about them, and why one was not passed on, goes out as ANSWER. An order that cannot be
 * passed on at once is refused: none is carried out later than its sender expects. Thread: [net]. */
#ifndef PAL_LCM_BRIDGE_LCM_ORDERS_H
#define PAL_LCM_BRIDGE_LCM_ORDERS_H
#include "clients/link/lcm_link.h"

typedef struct pal_lcm_orders {
    pal_lcm_link *lcm; /* borrowed, as the two that follow */
    const char *session;
    pal_link *link;
    bool is_given; /* an order was passed on since the member joined: what the session says is about it */
    uint64_t source, last_ns;
    int32_t seq; /* of the last order, as source and last_ns */
    double tokens;
    uint64_t n_order, n_refused; /* passed on; refused here or by the session */
} pal_lcm_orders;

/* an order_t that was admitted and passed the walk; repeats are dropped */
void pal_lcm_orders_take(pal_lcm_orders *orders, const void *bytes, size_t n_byte, uint64_t source, uint64_t now_ns);
/* every control message of the member */
void pal_lcm_orders_control(pal_lcm_orders *orders, const pal_control *control);
#endif
