/* The mailbox is one atomic exchange of slot indices. */
#include "server/base/triple_buffer.h"

enum { UNSEEN = 4 };

void pal_triple_buffer_init(pal_triple_buffer *triple_buffer, void *slot0, void *slot1, void *slot2)
{
    triple_buffer->slot[0] = slot0;
    triple_buffer->slot[1] = slot1;
    triple_buffer->slot[2] = slot2;
    triple_buffer->write = 0;
    triple_buffer->read = 2;
    atomic_init(&triple_buffer->middle, 1);
}

void *pal_triple_buffer_slot(pal_triple_buffer *triple_buffer)
{
    return triple_buffer->slot[triple_buffer->write];
}

void pal_triple_buffer_publish(pal_triple_buffer *triple_buffer)
{
    triple_buffer->write =
        atomic_exchange_explicit(&triple_buffer->middle, triple_buffer->write | UNSEEN, memory_order_acq_rel) & 3;
}

void *pal_triple_buffer_take(pal_triple_buffer *triple_buffer)
{
    if (!(atomic_load_explicit(&triple_buffer->middle, memory_order_relaxed) & UNSEEN)) return (void *)0;
    triple_buffer->read =
        atomic_exchange_explicit(&triple_buffer->middle, triple_buffer->read, memory_order_acq_rel) & 3;
    return triple_buffer->slot[triple_buffer->read];
}
