/* Latest-wins mailbox of three slots: one writer thread, one reader thread, neither ever waits. The writer fills its
 * slot and publishes it; the reader takes the newest published slot, once. A value that is replaced before it is taken
 * is lost on purpose. Slots are the caller's memory (borrowed). Thread: write and publish by one thread, take by one.
 */
#ifndef PAL_BASE_TRIPLE_BUFFER_H
#define PAL_BASE_TRIPLE_BUFFER_H
#include <stdatomic.h>
#include <stdint.h>

typedef struct pal_triple_buffer {
    void *slot[3];
    _Atomic uint32_t middle; /* index of the slot between the two, bit 2: unseen by the reader */
    uint32_t write, read;    /* index owned by the writer, by the reader */
} pal_triple_buffer;

void pal_triple_buffer_init(pal_triple_buffer *triple_buffer, void *slot0, void *slot1, void *slot2); /* [load] */
void *pal_triple_buffer_slot(pal_triple_buffer *triple_buffer);   /* [writer] slot to fill, kept until publish */
void pal_triple_buffer_publish(pal_triple_buffer *triple_buffer); /* [writer] */
void *pal_triple_buffer_take(
    pal_triple_buffer *triple_buffer); /* [reader] newest unseen slot, valid until the next take; NULL: nothing new */
#endif
