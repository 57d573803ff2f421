/* Arena memory: many allocations, one free. It has two uses: the memory of a world, which grows at load and is freed
 * whole, and the scratch memory of a step, a fixed block that is emptied after every sub-step, so that a step makes no
 * heap call. Pages of a growing arena that nobody writes to take no memory: room for the worst case, as for contact of
 * all of a surface, costs what is used of it. Thread: an arena belongs to one thread at a time. */
#ifndef PAL_BASE_ARENA_H
#define PAL_BASE_ARENA_H
#include "server/base/err.h"

#include <stdbool.h>

typedef struct pal_arena pal_arena;

/* Creates a growing arena (grows = true: it takes further blocks of at least n_byte from the heap) or a fixed arena
 * (one block of n_byte, touched here, so that a step causes no page fault). NULL: out of memory. [load] */
pal_arena *pal_arena_create(size_t n_byte, bool grows);
void pal_arena_destroy(pal_arena *arena); /* NULL is fine */

/* n_byte zeroed bytes at a multiple of 64, valid until reset or destroy; NULL: full or out of memory. n_byte 0 gives a
 * valid pointer that must not be read. */
void *pal_arena_alloc(pal_arena *arena, size_t n_byte);
/* zeroed array of n_item items of n_byte; NULL also when the product overflows */
void *pal_arena_array(pal_arena *arena, size_t n_item, size_t n_byte);
#define PAL_NEW(arena, type, n) ((type *)pal_arena_array((arena), (size_t)(n), sizeof(type)))
/* *list[i] = zeroed array of n doubles, for each of the list; false: full or out of memory */
bool pal_arena_doubles(pal_arena *arena, size_t n, double **const list[], size_t n_list);
#define PAL_NEW_DOUBLES(arena, n, ...)                                                                                 \
    pal_arena_doubles((arena), (size_t)(n), (double **const[]){__VA_ARGS__},                                           \
                      sizeof((double **const[]){__VA_ARGS__}) / sizeof(double **))

/* bytes allocated since the last reset, with padding; of a fixed arena also the mark to rewind to */
size_t pal_arena_used(const pal_arena *arena);
void pal_arena_reset(pal_arena *arena);               /* fixed arenas only: empty again */
void pal_arena_rewind(pal_arena *arena, size_t used); /* fixed arenas only: back to an earlier pal_arena_used */
#endif
