/* Heap arrays: many allocations with one check, arrays that grow, many frees. For work at load; a step makes no heap
 * call. Thread: any. */
#ifndef PAL_BASE_HEAP_H
#define PAL_BASE_HEAP_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* n items of size bytes, n may be 0. NULL where *err is set already, or sets it to MEMORY */
static inline void *pal_heap_array(pal_err *err, size_t n, size_t size, bool zero)
{
    void *array = *err || n > PTRDIFF_MAX / size ? NULL : zero ? calloc(n + !n, size) : malloc(n ? n * size : 1);
    if (!array && !*err) *err = PAL_ERR_MEMORY;
    return array;
}
/* p becomes an array of n items, or NULL; *err tells of all arrays so far */
#define PAL_ARRAY(err, p, n)  ((p) = pal_heap_array((err), (size_t)(n), sizeof *(p), false))
#define PAL_ZEROED(err, p, n) ((p) = pal_heap_array((err), (size_t)(n), sizeof *(p), true))

/* Room for item n of an array whose items are added one by one: its length doubles at powers of two, so that no
 * capacity is kept beside it. pointer: where the array's address is kept. false: no memory, the array stays */
static inline bool pal_heap_grow(void *pointer, size_t n, size_t size)
{
    void *array;
    if (n & (n - 1)) return true;
    memcpy(&array, pointer, sizeof array);
    array = n > PTRDIFF_MAX / 2 / size ? NULL : realloc(array, (n ? 2 * n : 1) * size);
    if (array) memcpy(pointer, &array, sizeof array);
    return array != NULL;
}
#define PAL_GROW(p, n) pal_heap_grow(&(p), (size_t)(n), sizeof *(p))

/* frees every array of a list, of which each may be NULL */
static inline void pal_heap_free(void *const *list, size_t n)
{
    for (size_t k = 0; k < n; k++) free(list[k]);
}
/* the same, and the error back, for a function that gives up */
static inline pal_err pal_heap_freed(pal_err err, void *const *list, size_t n)
{
    pal_heap_free(list, n);
    return err;
}
#define PAL_LIST(...)       (void *[]){__VA_ARGS__}, sizeof((void *[]){__VA_ARGS__}) / sizeof(void *)
#define PAL_FREED(err, ...) pal_heap_freed((err), PAL_LIST(__VA_ARGS__))
#define PAL_FREE(...)       pal_heap_free(PAL_LIST(__VA_ARGS__))
#endif
