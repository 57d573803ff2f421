/* The hand-over is one atomic exchange of slot indices. */
#include "server/base/triple_buffer.h"

enum { UNSEEN = 4 };

void pal_triple_buffer_init(pal_triple_buffer *buffer, void *slot0, void *slot1, void *slot2)
{
    buffer->slot[0] = slot0;
    buffer->slot[1] = slot1;
    buffer->slot[2] = slot2;
    buffer->write = 0;
    buffer->read = 2;
    atomic_init(&buffer->middle, 1);
}

void *pal_triple_buffer_slot(pal_triple_buffer *buffer)
{
    return buffer->slot[buffer->write];
}

void pal_triple_buffer_publish(pal_triple_buffer *buffer)
{
    buffer->write = atomic_exchange_explicit(&buffer->middle, buffer->write | UNSEEN, memory_order_acq_rel) & 3;
}

void *pal_triple_buffer_take(pal_triple_buffer *buffer)
{
    if (!(atomic_load_explicit(&buffer->middle, memory_order_relaxed) & UNSEEN)) return (void *)0;
    buffer->read = atomic_exchange_explicit(&buffer->middle, buffer->read, memory_order_acq_rel) & 3;
    return buffer->slot[buffer->read];
}
