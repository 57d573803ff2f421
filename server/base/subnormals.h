/* Numbers below the smallest normal one count as zero between flush and restore: where inertia rules, answers decay
 * from point to point until they would be subnormal, which costs a hundred times a normal number. Thread: its own. */
#ifndef PAL_BASE_SUBNORMALS_H
#define PAL_BASE_SUBNORMALS_H
#ifdef __SSE2__
#include <xmmintrin.h>
#endif

/* how the calling thread treats them */
static inline unsigned pal_subnormals_mode(void)
{
#ifdef __SSE2__
    return _mm_getcsr();
#else
    return 0;
#endif
}
/* returns the mode before, which pal_subnormals_restore takes */
static inline unsigned pal_subnormals_flush(void)
{
#ifdef __SSE2__
    const unsigned mode = pal_subnormals_mode();
    _mm_setcsr(mode | 0x8040);
    return mode;
#else
    return 0;
#endif
}
static inline void pal_subnormals_restore(unsigned mode)
{
#ifdef __SSE2__
    _mm_setcsr(mode);
#else
    (void)mode;
#endif
}
#endif
