/* Limits of the relay. Each constant states its unit, its reason, and the test that bounds it. Those of messages are
 * the server's (protocol/README.md, "Limits"). */
#ifndef PAL_RELAY_TUNING_H
#define PAL_RELAY_TUNING_H

/* ns: a viewer joins within that time; it acknowledges, and takes what waits for it (test_relay) */
#define PAL_RELAY_JOIN_NS  5000000000u
#define PAL_RELAY_STALL_NS 10000000000u
/* 1/s: acknowledgements, and control messages, of which so many may come at once (test_relay) */
#define PAL_RELAY_ACKS_1_S        600
#define PAL_RELAY_CONTROL_1_S     20
#define PAL_RELAY_CONTROL_AT_ONCE 40
/* viewers at once by default: what one event loop of libwebsockets serves well (test_relay) */
#define PAL_RELAY_VIEWERS 1000
/* connections that have not joined, in all and of one address; a further one takes the place of the oldest (test_relay)
 */
#define PAL_RELAY_UNJOINED            64
#define PAL_RELAY_UNJOINED_OF_ADDRESS 16
/* viewers of one address of another machine without a ticket made for them: at least so many, else one of so many parts
 * of all places, as on a server (test_relay) */
#define PAL_RELAY_ADDRESS_PLACES 32
#define PAL_RELAY_ADDRESSES      4
/* bytes of all assets of a session: what upstream names may not fill this machine (test_relay) */
#define PAL_RELAY_ASSETS_BYTES (1u << 30)
/* us between two looks for assets that are missing and for a silent upstream (test_relay_server) */
#define PAL_RELAY_LOOK_US 500000u
/* us between two requests to upstream for other fields, so that viewers who change their minds all the time make half
 * as many control messages as it takes of one client (test_relay_server) */
#define PAL_RELAY_ASK_US 100000u
/* ns without a message of upstream, which sends a status three times a second, after which it is called again
 * (test_relay_server) */
#define PAL_RELAY_SILENT_NS 5000000000u
/* ns that viewers get to take the reason when the relay ends (test_relay_server) */
#define PAL_RELAY_GOODBYE_NS 500000000u
#endif
