/* Arena memory as a chain of blocks; a fixed arena is a chain of one. */
#include "server/base/arena.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { ALIGN = 64 };

typedef struct block {
    struct block *older;
    size_t size, used;
    void *heap;     /* what the heap gave           */
    uint8_t *bytes; /* the first multiple of ALIGN in it */
} block;

struct pal_arena {
    block *newest;
    size_t block_size, allocated;
    bool grows;
};

/* zero bytes: calloc knows which pages the system gives zeroed and leaves them untouched */
static block *block_create(size_t size)
{
    block *b = malloc(sizeof *b);
    if (!b) return NULL;
    b->heap = size + ALIGN > size ? calloc(1, size + ALIGN) : NULL;
    if (!b->heap) {
        free(b);
        return NULL;
    }
    b->bytes = (uint8_t *)b->heap + (ALIGN - (uintptr_t)b->heap % ALIGN) % ALIGN;
    b->older = NULL;
    b->size = size;
    b->used = 0;
    return b;
}

/* writes to every page */
static void touch(block *b)
{
    enum { PAGE = 4096 };
    for (size_t i = 0; i < b->size; i += PAGE) *(volatile uint8_t *)(b->bytes + i) = 0;
}

pal_arena *pal_arena_create(size_t n_byte, bool grows)
{
    size_t size = (n_byte + ALIGN - 1) & ~(size_t)(ALIGN - 1);
    if (size < n_byte) return NULL;
    if (size == 0) size = ALIGN;
    pal_arena *arena = malloc(sizeof *arena);
    if (!arena) return NULL;
    *arena = (pal_arena){.newest = block_create(size), .block_size = size, .grows = grows};
    if (!arena->newest) {
        free(arena);
        return NULL;
    }
    if (!grows) touch(arena->newest);
    return arena;
}

void pal_arena_destroy(pal_arena *arena)
{
    if (!arena) return;
    for (block *b = arena->newest, *older; b; b = older) {
        older = b->older;
        free(b->heap);
        free(b);
    }
    free(arena);
}

void *pal_arena_alloc(pal_arena *arena, size_t n_byte)
{
    size_t size = (n_byte + ALIGN - 1) & ~(size_t)(ALIGN - 1);
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
    /* a growing arena gives its bytes out once, and they are zero */
    if (!arena->grows) memset(bytes, 0, size);
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
