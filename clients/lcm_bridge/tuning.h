/* Policy of palpate-lcm. Each constant states its unit, its reason, and the test that bounds it. Thread: any. */
#ifndef PAL_LCM_BRIDGE_TUNING_H
#define PAL_LCM_BRIDGE_TUNING_H

/* orders a second, and at once, that are passed on: half of the text messages that the server takes of a member before
 * it closes the connection, which the stream of the bus needs (test_lcm_orders) */
#define PAL_ORDERS_1_S   10.0
#define PAL_ORDERS_BURST 8.0
/* ns after which a sender without seal may number its orders from the start again: more than its three repeats take
 * (test_lcm_orders) */
#define PAL_ORDERS_AGAIN_NS 1000000000u
#endif
