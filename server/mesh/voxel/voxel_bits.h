/* Rows of voxels as bits, and what the files of this room share. Thread: [load]. */
#ifndef PAL_MESH_VOXEL_VOXEL_BITS_H
#define PAL_MESH_VOXEL_VOXEL_BITS_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

/* voxels as bits, x fastest; a row begins at a word and unused bits are 0 */
typedef struct pal_bits {
    int n[3];
    int n_word;     /* words per row                                  */
    uint64_t *word; /* row (y, z) begins at n_word (z n[1] + y)       */
} pal_bits;

pal_err pal_bits_create(const int n[3], pal_bits *out); /* zeroed; MEMORY */
void pal_bits_free(pal_bits *bits);
static inline uint64_t *pal_bits_row(const pal_bits *bits, int y, int z)
{
    return bits->word + (size_t)bits->n_word * ((size_t)z * (size_t)bits->n[1] + (size_t)y);
}
static inline size_t pal_bits_words(const pal_bits *bits) /* of all rows */
{
    return (size_t)bits->n_word * (size_t)bits->n[1] * (size_t)bits->n[2];
}
void pal_bits_set_run(void *row, int from, int to); /* bits from..to-1 of a row of words */
static inline bool pal_bits_get(const pal_bits *bits, int x, int y, int z)
{
    return pal_bits_row(bits, y, z)[x >> 6] >> (x & 63) & 1;
}
int64_t pal_bits_count(const pal_bits *bits);
/* face-connected components; with largest_only the smaller ones are cleared; MEMORY */
pal_err pal_bits_components(pal_bits *bits, bool largest_only, int *n_component);
/* clears the face-connected components in which no bit of seeds is set; MEMORY */
pal_err pal_bits_keep_joined(pal_bits *bits, const pal_bits *seeds);

/* corners of the five tetrahedra of a voxel, by the parity of its index; corner bits x = 1, y = 2, z = 4 */
extern const uint8_t pal_voxel_tets[2][5][4];

/* heap, in large pages where the kernel gives them: first touch is most of the cost of writing large arrays */
void *pal_voxels_array(size_t n_byte);
#endif
