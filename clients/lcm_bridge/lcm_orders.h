/* Orders on the bus: ORDER, order_t (lcmtypes/), become commands of one member, whose rights its ticket gives; what the
 * session says about them goes out as ANSWER. The member joins with the first order, as an instructor if its ticket
 * allows that. Thread: [net]. */
#ifndef PAL_LCM_BRIDGE_LCM_ORDERS_H
#define PAL_LCM_BRIDGE_LCM_ORDERS_H
#include "clients/link/lcm_link.h"

enum { PAL_ORDERS_PENDING = 8 };

typedef struct pal_lcm_orders {
    pal_link_loop *loop; /* borrowed, as the two that follow */
    pal_lcm_link *lcm;
    const char *server, *session;
    pal_link *link;                          /* NULL: no order yet */
    pal_control pending[PAL_ORDERS_PENDING]; /* until it has joined [n_pending] */
    int n_pending;
    uint64_t source; /* of the last order */
    int32_t seq;
    uint64_t n_order, n_refused;
} pal_lcm_orders;

/* an order_t that was admitted and passed the walk; repeats are dropped */
void pal_lcm_orders_take(pal_lcm_orders *orders, const void *bytes, size_t n_byte, uint64_t source);
#endif
