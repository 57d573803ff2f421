/* Limits of the websocket transport. Each constant states its unit, its reason, and the test that bounds it. */
#ifndef PAL_NET_TRANSPORT_TUNING_H
#define PAL_NET_TRANSPORT_TUNING_H

/* us; a socket that is no websocket ends so long after its last request: longer than libwebsockets keeps an idle
 * connection; three times that while a file is read (test_ws) */
#define PAL_SOCKET_DEADLINE_US 10000000
/* HTTP requests of an address: 1/s, five pages; at once, ten pages; ns that one waits at most, so that 30 stations
 * behind one address load the page together (test_host_name) */
#define PAL_REQUESTS_1_S     300
#define PAL_REQUESTS_AT_ONCE 600
#define PAL_REQUEST_WAIT_NS  4000000000u
/* sockets that are kept for the health listener when the main one is full (test_ws) */
#define PAL_HEALTH_SOCKETS 16
/* credit (test_packet): s for which cycles go on beyond a round trip, the time after which TCP sends a lost segment
 * again; s of a window; s above the smallest round trip at which cycles queue, a step and the scheduling of a busy
 * client; growth in a window in which nothing queues */
#define PAL_CREDIT_STALL_S  0.25
#define PAL_CREDIT_WINDOW_S 0.5
#define PAL_CREDIT_QUEUE_S  0.03
#define PAL_CREDIT_GROWTH   1.25
/* bytes of the body of a POST: an order of one name (test_ws) */
#define PAL_POST_MAX 1024
#endif
