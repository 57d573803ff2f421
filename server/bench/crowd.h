/* A crowd of viewers in a process of its own, for `palpate bench viewers`: sockets and no more. Each viewer joins,
 * reads the heads of its messages, notes how old each frame is when it comes, and acknowledges. One in CROWD_CHECKED
 * checks every message in full, and all of those have to get the same bytes as the frame of a number, which are
 * decoded.
 *
 * Both processes share the record below; the crowd waits for its phase. Thread: that of the bench. */
#ifndef PAL_BENCH_CROWD_H
#define PAL_BENCH_CROWD_H
#include <stdatomic.h>
#include <stdint.h>
#include <sys/types.h>

/* ticks: of which it is known when they were published; ages in fifths of a millisecond, to ten seconds */
enum { CROWD_CHECKED = 50, CROWD_TICKS = 4096, CROWD_AGES = 50000, CROWD_GATES = 4 };
#define CROWD_AGE_NS 200000u

typedef enum bench_crowd_phase { CROWD_WAITS, CROWD_JOINS, CROWD_MEASURES, CROWD_LEAVES } bench_crowd_phase;

typedef struct bench_crowd {
    double step_s;                           /* of the scene */
    int n_viewer, n_gate, port[CROWD_GATES]; /* viewer i comes by gate i mod n_gate */
    _Atomic int phase, n_joined;
    _Atomic uint64_t published_ns[CROWD_TICKS]; /* of tick t at t mod CROWD_TICKS */
    uint64_t n_bad, n_lost;                     /* messages; connections that had joined */
    /* of the phase CROWD_MEASURES, whole when it ends */
    uint64_t n_cycle, n_frame, n_byte, n_checked, cpu_ns, n_age[CROWD_AGES];
} bench_crowd;

/* shared with processes to come; NULL: no memory */
bench_crowd *bench_crowd_create(void);
void bench_crowd_destroy(bench_crowd *crowd);
/* Starts the process; before any thread of this one, as malloc is used in both. The result is its id, -1: none. It ends
 * with CROWD_LEAVES. */
pid_t bench_crowd_start(bench_crowd *crowd);
/* share of the ages, 0 to 1, that are at most so many ms; NaN: there are none */
double bench_crowd_age_ms(const bench_crowd *crowd, double share);
#endif
