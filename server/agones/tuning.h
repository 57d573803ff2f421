/* Constants of the Agones client. Each states its unit, its reason, and the test that bounds it. Thread: any. */
#ifndef PAL_AGONES_TUNING_H
#define PAL_AGONES_TUNING_H

/* ms that the sidecar may take for an answer: it is on this machine (test_agones) */
#define PAL_SIDECAR_ANSWER_MS 2000
/* bytes of an answer: a GameServer with its labels and annotations, of which Kubernetes allows 256 KiB (test_agones) */
#define PAL_SIDECAR_BYTES (512 * 1024)
/* s between two pings that Agones expects where a GameServer does not say, as Agones' own default */
#define PAL_AGONES_PERIOD_S 5
/* s without a client after which an allocated server gives itself back: twice the time in which a member may return
 * with its ticket (test_agones) */
#define PAL_AGONES_EMPTY_S 120
#endif
