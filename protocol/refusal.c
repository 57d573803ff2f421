#include "protocol/refusal.h"

const char *pal_refusal_text(int code)
{
    static const char *const sentence[] = {
#define X(code, text) text,
        PAL_REFUSAL_TABLE(X)
#undef X
    };
    return code >= 0 && code < PAL_REFUSAL_END ? sentence[code] : "unknown refusal";
}
