/* Is the code of one effect in this program? A weak reference takes nothing out of a library. ABSENT: its name. */
#include "server/sim/core/effect.h"

#define JOIN(a, b) a##b
#define EFFECT(x)  JOIN(pal_effect_, x)
#define TEXT_OF(x) #x
#define TEXT(x)    TEXT_OF(x)

const char *absent_effect(bool *linked);

extern const pal_effect EFFECT(ABSENT) __attribute__((weak));

const char *absent_effect(bool *linked)
{
    const pal_effect *volatile effect = &EFFECT(ABSENT);
    *linked = effect != NULL;
    return TEXT(ABSENT);
}
