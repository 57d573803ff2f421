/* Threads that leave signals to the program: a started thread blocks every signal. Thread: any. */
#ifndef PAL_BASE_THREAD_H
#define PAL_BASE_THREAD_H
#include <pthread.h>
#include <signal.h>

/* 0, or the error number of pthread_create */
static inline int pal_thread_start(pthread_t *thread, void *(*run)(void *user), void *user)
{
    sigset_t all, old;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &old);
    int error = pthread_create(thread, NULL, run, user);
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    return error;
}
#endif
