/* Each cell holds a turn number that decides whether it is to be written or read next. */
#include "server/base/command_queue.h"

#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct cell {
    _Atomic size_t turn;
    uint8_t item[];
} cell;

struct pal_command_queue {
    size_t mask, item_byte, stride;
    _Alignas(64) _Atomic size_t head; /* next position to write */
    _Alignas(64) size_t tail;         /* next position to read */
    uint8_t *cells;
};

static cell *cell_at(pal_command_queue *queue, size_t position)
{
    return (cell *)(void *)(queue->cells + (position & queue->mask) * queue->stride);
}

pal_command_queue *pal_command_queue_create(size_t n_item, size_t item_byte)
{
    size_t n = 2;
    while (n < n_item) n *= 2;
    pal_command_queue *queue = aligned_alloc(64, (sizeof *queue + 63) & ~(size_t)63);
    if (!queue) return NULL;
    memset(queue, 0, sizeof *queue);
    queue->mask = n - 1;
    queue->item_byte = item_byte;
    queue->stride = (sizeof(cell) + item_byte + 15) & ~(size_t)15;
    queue->cells = calloc(n, queue->stride);
    if (!queue->cells) {
        free(queue);
        return NULL;
    }
    for (size_t i = 0; i < n; i++) atomic_init(&cell_at(queue, i)->turn, i);
    return queue;
}

void pal_command_queue_destroy(pal_command_queue *queue)
{
    if (!queue) return;
    free(queue->cells);
    free(queue);
}

pal_err pal_command_queue_put(pal_command_queue *queue, const void *item)
{
    size_t position = atomic_load_explicit(&queue->head, memory_order_relaxed);
    for (;;) {
        cell *c = cell_at(queue, position);
        intptr_t ahead = (intptr_t)(atomic_load_explicit(&c->turn, memory_order_acquire) - position);
        if (ahead < 0) return PAL_ERR_FULL;
        if (ahead > 0) {
            position = atomic_load_explicit(&queue->head, memory_order_relaxed);
        } else if (atomic_compare_exchange_weak_explicit(&queue->head, &position, position + 1, memory_order_relaxed,
                                                         memory_order_relaxed)) {
            memcpy(c->item, item, queue->item_byte);
            atomic_store_explicit(&c->turn, position + 1, memory_order_release);
            return PAL_ERR_OK;
        }
    }
}

bool pal_command_queue_get(pal_command_queue *queue, void *item)
{
    cell *c = cell_at(queue, queue->tail);
    if (atomic_load_explicit(&c->turn, memory_order_acquire) != queue->tail + 1) return false;
    memcpy(item, c->item, queue->item_byte);
    atomic_store_explicit(&c->turn, queue->tail + queue->mask + 1, memory_order_release);
    queue->tail++;
    return true;
}
