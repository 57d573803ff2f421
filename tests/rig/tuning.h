/* Constants of the rig: unit, reason, test. */
#ifndef TESTS_RIG_TUNING_H
#define TESTS_RIG_TUNING_H

/* s; the shortest retransmission timeout of Linux (TCP_RTO_MIN). test_network_path: a lost segment is late by it */
#define RIG_TIMEOUT_MIN_S 0.2
/* s; the longest (TCP_RTO_MAX). test_network_path: given up after the sum of all */
#define RIG_TIMEOUT_MAX_S 120.0
/* retransmissions before a connection is given up (net.ipv4.tcp_retries2). test_network_path */
#define RIG_RETRIES 15
/* random numbers of one packet: jitter, reordering, a loss for each transmission; rounded up to a power of two */
#define RIG_DRAWS 32
/* bytes; what Ethernet carries of a TCP stream with time stamps. test_rig_commands.sh: no packet is larger */
#define RIG_SEGMENT 1448
/* bytes of a stream on their way; 10 MB/s at a round trip of 200 ms, far above what the profiles ask for */
#define RIG_WINDOW (1 << 20)
/* bytes; receive buffer of the rig's TCP sockets: what waits stays with the sender, as on a real network */
#define RIG_RECEIVE_BUFFER 4096
/* s; what a line of limited bandwidth queues unless --queue-ms is given: twice the longest one-way delay of a profile
 */
#define RIG_QUEUE_S 0.2

#endif
