/* Triple buffer: a mailbox that holds the latest value. One thread writes, one reads, neither ever waits. The writer
 * fills its slot and publishes it; the reader takes the newest published slot, once. A value that is replaced before it
 * is taken is dropped by design. Slots are memory of the caller (borrowed). Thread: slot and publish by the writer,
 * take by the reader. */
#ifndef PAL_BASE_TRIPLE_BUFFER_H
#define PAL_BASE_TRIPLE_BUFFER_H
#include <stdatomic.h>
#include <stdint.h>

typedef struct pal_triple_buffer {
    void *slot[3];
    _Atomic uint32_t middle; /* index of the slot between the two, bit 2: unseen by the reader */
    uint32_t write, read;    /* index owned by the writer, by the reader */
} pal_triple_buffer;

void pal_triple_buffer_init(pal_triple_buffer *buffer, void *slot0, void *slot1, void *slot2); /* [load] */
void *pal_triple_buffer_slot(pal_triple_buffer *buffer);   /* [writer] slot to fill, kept until publish */
void pal_triple_buffer_publish(pal_triple_buffer *buffer); /* [writer] */
void *pal_triple_buffer_take(
    pal_triple_buffer *buffer); /* [reader] newest unseen slot, valid until the next take; NULL: nothing new */
#endif
