/* Counts heap calls of the whole process, for tests that nothing touches the heap. The linker puts these in the place
 * of the library's: -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=aligned_alloc,--wrap=free. To be included by
 * the one source file of a test. Thread: any; `counting` is set while no other thread looks. */
#ifndef TESTS_HEAP_CALLS_H
#define TESTS_HEAP_CALLS_H
#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

static volatile _Atomic bool counting; /* compilers know that malloc looks at no variable of ours */
static _Atomic long n_heap_call;       /* while counting */

void *__real_malloc(size_t n_byte);
void *__real_calloc(size_t n, size_t n_byte);
void *__real_realloc(void *old, size_t n_byte);
void *__real_aligned_alloc(size_t align, size_t n_byte);
void __real_free(void *old);
void *__wrap_malloc(size_t n_byte);
void *__wrap_calloc(size_t n, size_t n_byte);
void *__wrap_realloc(void *old, size_t n_byte);
void *__wrap_aligned_alloc(size_t align, size_t n_byte);
void __wrap_free(void *old);

static inline void count_heap_call(void)
{
    if (counting) atomic_fetch_add_explicit(&n_heap_call, 1, memory_order_relaxed);
}
void *__wrap_malloc(size_t n_byte)
{
    count_heap_call();
    return __real_malloc(n_byte);
}
void *__wrap_calloc(size_t n, size_t n_byte)
{
    count_heap_call();
    return __real_calloc(n, n_byte);
}
void *__wrap_realloc(void *old, size_t n_byte)
{
    count_heap_call();
    return __real_realloc(old, n_byte);
}
void *__wrap_aligned_alloc(size_t align, size_t n_byte)
{
    count_heap_call();
    return __real_aligned_alloc(align, n_byte);
}
void __wrap_free(void *old)
{
    count_heap_call();
    __real_free(old);
}
#endif
