/* A thread that runs one job at a time beside its owner, such as a factor that takes longer than a step. It is created
 * by the first job, sleeps between jobs and blocks all signals. What the job wrote is visible after a wait. Thread: one
 * owner at a time. */
#ifndef PAL_BASE_SPARE_THREAD_H
#define PAL_BASE_SPARE_THREAD_H
#include "server/base/err.h"

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct pal_spare_thread {
    bool made, busy, quit; /* made: the owner's; busy and quit: under the lock */
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    void (*job)(void *user);
    void *user;
} pal_spare_thread;

void pal_spare_thread_init(pal_spare_thread *spare);    /* [load] */
void pal_spare_thread_destroy(pal_spare_thread *spare); /* waits for the job; [load] */
/* starts a job, after the one before has ended. MEMORY: no thread could be created, the job does not run */
pal_err pal_spare_thread_run(pal_spare_thread *spare, void (*job)(void *user), void *user);
void pal_spare_thread_wait(pal_spare_thread *spare); /* until it has no job */
/* processor time of spare threads while the calling thread waited for them, ns, in all */
uint64_t pal_spare_thread_waited_ns(void);
#endif
