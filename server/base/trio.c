/* The mailbox is one atomic exchange of slot indices. */
#include "server/base/trio.h"

enum { UNSEEN = 4 };

void pal_trio_init(pal_trio *trio, void *slot0, void *slot1, void *slot2)
{
    trio->slot[0] = slot0;
    trio->slot[1] = slot1;
    trio->slot[2] = slot2;
    trio->write = 0;
    trio->read = 2;
    atomic_init(&trio->middle, 1);
}

void *pal_trio_slot(pal_trio *trio)
{
    return trio->slot[trio->write];
}

void pal_trio_publish(pal_trio *trio)
{
    trio->write = atomic_exchange_explicit(&trio->middle, trio->write | UNSEEN, memory_order_acq_rel) & 3;
}

void *pal_trio_take(pal_trio *trio)
{
    if (!(atomic_load_explicit(&trio->middle, memory_order_relaxed) & UNSEEN)) return (void *)0;
    trio->read = atomic_exchange_explicit(&trio->middle, trio->read, memory_order_acq_rel) & 3;
    return trio->slot[trio->read];
}
