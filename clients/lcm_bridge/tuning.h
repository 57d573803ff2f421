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
/* bytes a second of the triangles of a part that adapts: frames wait for theirs, so a table of 60,000 triangles that
 * changes all the time gets 5 frames a second on a bus of 100 Mbit/s, and one of 1,000 every frame (test_lcm_bridge) */
#define PAL_TRIANGLES_BYTES_S 4e6
/* of its time, the share that repeats take while triangles do not change: 1 / this (test_lcm_bridge) */
#define PAL_TRIANGLES_REPEAT 10
#endif
