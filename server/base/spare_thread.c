#include "server/base/spare_thread.h"

#include "server/base/clock.h"
#include "server/base/thread.h"

static _Thread_local uint64_t waited_ns;

void pal_spare_thread_init(pal_spare_thread *spare)
{
    *spare = (pal_spare_thread){.made = false};
    pthread_mutex_init(&spare->lock, NULL);
    pthread_cond_init(&spare->changed, NULL);
}

static void *live(void *self)
{
    pal_spare_thread *spare = self;
    pthread_mutex_lock(&spare->lock);
    for (;;) {
        while (!spare->quit && !spare->busy) pthread_cond_wait(&spare->changed, &spare->lock);
        if (spare->quit) break;
        pthread_mutex_unlock(&spare->lock);
        spare->job(spare->user);
        pthread_mutex_lock(&spare->lock);
        spare->busy = false;
        pthread_cond_broadcast(&spare->changed);
    }
    pthread_mutex_unlock(&spare->lock);
    return NULL;
}

pal_err pal_spare_thread_run(pal_spare_thread *spare, void (*job)(void *user), void *user)
{
    pal_spare_thread_wait(spare);
    pthread_mutex_lock(&spare->lock);
    spare->job = job, spare->user = user;
    if (!spare->made) spare->made = pal_thread_start(&spare->thread, live, spare) == 0;
    spare->busy = spare->made;
    pthread_cond_broadcast(&spare->changed);
    pthread_mutex_unlock(&spare->lock);
    return spare->made ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

void pal_spare_thread_wait(pal_spare_thread *spare)
{
    pthread_mutex_lock(&spare->lock);
    if (spare->busy) {
        const uint64_t before = pal_clock_thread_of_ns(spare->thread);
        while (spare->busy) pthread_cond_wait(&spare->changed, &spare->lock);
        waited_ns += pal_clock_thread_of_ns(spare->thread) - before;
    }
    pthread_mutex_unlock(&spare->lock);
}

uint64_t pal_spare_thread_waited_ns(void)
{
    return waited_ns;
}

void pal_spare_thread_destroy(pal_spare_thread *spare)
{
    if (spare->made) {
        pal_spare_thread_wait(spare);
        pthread_mutex_lock(&spare->lock);
        spare->quit = true;
        pthread_cond_broadcast(&spare->changed);
        pthread_mutex_unlock(&spare->lock);
        pthread_join(spare->thread, NULL);
    }
    pthread_cond_destroy(&spare->changed);
    pthread_mutex_destroy(&spare->lock);
}
