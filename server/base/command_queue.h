/* Bounded queue of items of equal size: any number of writer threads, one reader thread, no locks, no heap after
 * creation (Vyukov's bounded queue). A full queue refuses, so a flood of commands costs bounded memory. */
#ifndef PAL_BASE_COMMAND_QUEUE_H
#define PAL_BASE_COMMAND_QUEUE_H
#include "server/base/err.h"

#include <stdbool.h>

typedef struct pal_command_queue pal_command_queue;

pal_command_queue *pal_command_queue_create(size_t n_item,
                                            size_t item_byte); /* [load] n_item is rounded up to a power of two; NULL */
void pal_command_queue_destroy(pal_command_queue *queue);      /* NULL is fine; nobody may use it any more */
pal_err pal_command_queue_put(pal_command_queue *queue, const void *item); /* [any] copies; PAL_ERR_FULL */
bool pal_command_queue_get(pal_command_queue *queue, void *item);          /* [reader] copies; false: empty */
#endif
