/* Arena memory as a chain of blocks; a fixed arena is a chain of one. */
#include "server/base/arena.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct block {
    struct block *older;
    size_t size, used;
    uint8_t *bytes;
} block;

struct pal_arena {
    block *newest;
    size_t block_size, allocated;
    bool grows;
};

static block *block_create(size_t size)
{
    block *b = malloc(sizeof *b);
    if (!b) return NULL;
    b->bytes = aligned_alloc(64, size);
    if (!b->bytes) {
        free(b);
        return NULL;
    }
    b->older = NULL;
    b->size = size;
    b->used = 0;
    return b;
}

pal_arena *pal_arena_create(size_t n_byte, bool grows)
{
    size_t size = (n_byte + 63) & ~(size_t)63;
    if (size < n_byte) return NULL;
    if (size == 0) size = 64;
    pal_arena *arena = malloc(sizeof *arena);
    if (!arena) return NULL;
    *arena = (pal_arena){.newest = block_create(size), .block_size = size, .grows = grows};
    if (!arena->newest) {
        free(arena);
        return NULL;
    }
    if (!grows) memset(arena->newest->bytes, 0, size);
    return arena;
}

void pal_arena_destroy(pal_arena *arena)
{
    if (!arena) return;
    for (block *b = arena->newest, *older; b; b = older) {
        older = b->older;
        free(b->bytes);
        free(b);
    }
    free(arena);
}

void *pal_arena_alloc(pal_arena *arena, size_t n_byte)
{
    size_t size = (n_byte + 63) & ~(size_t)63;
    if (size < n_byte) return NULL;
    block *b = arena->newest;
    if (size > b->size - b->used) {
        if (!arena->grows) return NULL;
        b = block_create(size > arena->block_size ? size : arena->block_size);
        if (!b) return NULL;
        b->older = arena->newest;
        arena->newest = b;
    }
    void *bytes = b->bytes + b->used;
    b->used += size;
    arena->allocated += size;
    memset(bytes, 0, size);
    return bytes;
}

void *pal_arena_array(pal_arena *arena, size_t n_item, size_t n_byte)
{
    size_t total;
    if (__builtin_mul_overflow(n_item, n_byte, &total)) return NULL;
    return pal_arena_alloc(arena, total);
}

bool pal_arena_doubles(pal_arena *arena, size_t n, double **const list[], size_t n_list)
{
    for (size_t i = 0; i < n_list; i++)
        if (!(*list[i] = PAL_NEW(arena, double, n))) return false;
    return true;
}

size_t pal_arena_used(const pal_arena *arena)
{
    return arena->allocated;
}

void pal_arena_rewind(pal_arena *arena, size_t used)
{
    PAL_ASSERT(!arena->grows && used <= arena->allocated);
    arena->newest->used = used;
    arena->allocated = used;
}

void pal_arena_reset(pal_arena *arena)
{
    pal_arena_rewind(arena, 0);
}
