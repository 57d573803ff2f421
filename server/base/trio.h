/* Latest-wins mailbox of three slots: one writer thread, one reader thread, neither ever waits. The writer fills its
 * slot and publishes it; the reader takes the newest published slot, once. A value that is replaced before it is taken
 * is lost on purpose. Slots are the caller's memory (borrowed). Thread: write and publish by one thread, take by one.
 */
#ifndef PAL_BASE_TRIO_H
#define PAL_BASE_TRIO_H
#include <stdatomic.h>
#include <stdint.h>

typedef struct pal_trio {
    void *slot[3];
    _Atomic uint32_t middle; /* index of the slot between the two, bit 2: unseen by the reader */
    uint32_t write, read;    /* index owned by the writer, by the reader */
} pal_trio;

void pal_trio_init(pal_trio *trio, void *slot0, void *slot1, void *slot2); /* [load] */
void *pal_trio_slot(pal_trio *trio);   /* [writer] slot to fill, kept until publish */
void pal_trio_publish(pal_trio *trio); /* [writer] */
void *pal_trio_take(pal_trio *trio);   /* [reader] newest unseen slot, valid until the next take; NULL: nothing new */
#endif
