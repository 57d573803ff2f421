/* The table of refusals as names and sentences. */
#include "protocol/refusal.h"

const char *pal_refusal_name(int code)
{
    static const char *const name[] = {
#define X(code, text) #code,
        PAL_REFUSAL_TABLE(X)
#undef X
    };
    return code >= 0 && code < PAL_REFUSAL_END ? name[code] : "UNKNOWN";
}

const char *pal_refusal_text(int code)
{
    static const char *const sentence[] = {
#define X(code, text) text,
        PAL_REFUSAL_TABLE(X)
#undef X
    };
    return code >= 0 && code < PAL_REFUSAL_END ? sentence[code] : "unknown refusal";
}
