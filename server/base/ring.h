/* Bounded queue of equal-sized items: any number of writer threads, one reader thread, no locks, no heap after
 * creation (Vyukov's bounded queue). A full ring refuses, so a flood costs bounded memory. */
#ifndef PAL_BASE_RING_H
#define PAL_BASE_RING_H
#include "server/base/err.h"

#include <stdbool.h>

typedef struct pal_ring pal_ring;

pal_ring *pal_ring_create(size_t n_item, size_t item_byte); /* [load] n_item is rounded up to a power of two; NULL */
void pal_ring_destroy(pal_ring *ring);                      /* NULL is fine; nobody may use it any more */
pal_err pal_ring_put(pal_ring *ring, const void *item);     /* [any] copies; PAL_ERR_FULL */
bool pal_ring_get(pal_ring *ring, void *item);              /* [reader] copies; false: empty */
#endif
