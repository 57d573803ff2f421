/* Each cell carries a turn number: it says whose turn it is to write or read the cell. */
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
    _Alignas(64) _Atomic size_t head; /* next place to write */
    _Alignas(64) size_t tail;         /* next place to read  */
    uint8_t *cells;
};

static cell *cell_at(pal_command_queue *ring, size_t place)
{
    return (cell *)(void *)(ring->cells + (place & ring->mask) * ring->stride);
}

pal_command_queue *pal_command_queue_create(size_t n_item, size_t item_byte)
{
    size_t n = 2;
    while (n < n_item) n *= 2;
    pal_command_queue *ring = aligned_alloc(64, (sizeof *ring + 63) & ~(size_t)63);
    if (!ring) return NULL;
    memset(ring, 0, sizeof *ring);
    ring->mask = n - 1;
    ring->item_byte = item_byte;
    ring->stride = (sizeof(cell) + item_byte + 15) & ~(size_t)15;
    ring->cells = calloc(n, ring->stride);
    if (!ring->cells) {
        free(ring);
        return NULL;
    }
    for (size_t i = 0; i < n; i++) atomic_init(&cell_at(ring, i)->turn, i);
    return ring;
}

void pal_command_queue_destroy(pal_command_queue *ring)
{
    if (!ring) return;
    free(ring->cells);
    free(ring);
}

pal_err pal_command_queue_put(pal_command_queue *ring, const void *item)
{
    size_t place = atomic_load_explicit(&ring->head, memory_order_relaxed);
    for (;;) {
        cell *c = cell_at(ring, place);
        intptr_t ahead = (intptr_t)(atomic_load_explicit(&c->turn, memory_order_acquire) - place);
        if (ahead < 0) return PAL_ERR_FULL;
        if (ahead > 0) {
            place = atomic_load_explicit(&ring->head, memory_order_relaxed);
        } else if (atomic_compare_exchange_weak_explicit(&ring->head, &place, place + 1, memory_order_relaxed,
                                                         memory_order_relaxed)) {
            memcpy(c->item, item, ring->item_byte);
            atomic_store_explicit(&c->turn, place + 1, memory_order_release);
            return PAL_ERR_OK;
        }
    }
}

bool pal_command_queue_get(pal_command_queue *ring, void *item)
{
    cell *c = cell_at(ring, ring->tail);
    if (atomic_load_explicit(&c->turn, memory_order_acquire) != ring->tail + 1) return false;
    memcpy(item, c->item, ring->item_byte);
    atomic_store_explicit(&c->turn, ring->tail + ring->mask + 1, memory_order_release);
    ring->tail++;
    return true;
}
