/* Limits of the relay. Each constant states its unit, its reason, and the test that bounds it. Those of messages are
 * the server's (protocol/README.md, "Limits"). */
#ifndef PAL_RELAY_TUNING_H
#define PAL_RELAY_TUNING_H

/* ns: a viewer joins within that time, and acknowledges (test_relay) */
#define PAL_RELAY_JOIN_NS  5000000000u
#define PAL_RELAY_STALL_NS 10000000000u
/* 1/s: acknowledgements, and control messages, of which so many may come at once (test_relay) */
#define PAL_RELAY_ACKS_1_S        600
#define PAL_RELAY_CONTROL_1_S     20
#define PAL_RELAY_CONTROL_AT_ONCE 40
/* viewers at once by default: what one event loop of libwebsockets serves well (test_relay) */
#define PAL_RELAY_VIEWERS 1000
/* connections that have not joined; a further one takes the place of the oldest (test_relay) */
#define PAL_RELAY_UNJOINED 64
/* us between two tries to fetch the assets that are missing (test_relay_server) */
#define PAL_RELAY_FETCH_US 500000u
/* ns that viewers get to take the reason when the relay ends (test_relay_server) */
#define PAL_RELAY_GOODBYE_NS 500000000u
#endif
