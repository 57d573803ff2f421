/* Checks bytes of an LCM message before the generated decoder sees them.
 *
 * The decoders that lcm-gen 1.3.1 writes trust lengths (a negative count reaches malloc and memcpy, strings may lack
 * their zero, failed decodes leak), so nothing from a bus may reach them unchecked. The walk goes over the type's own
 * description (lcm-gen --c-typeinfo), needs no code per type and allocates nothing. What it passes, the generated
 * decoder reads without running over, and allocates at most a small multiple of n_byte for.
 * Thread: any, after one call from one thread (the generated type descriptions fill themselves on first use). */
#ifndef PAL_LCMTYPES_LCM_WALK_H
#define PAL_LCMTYPES_LCM_WALK_H
#include <lcm/lcm_coretypes.h>
#include <stddef.h>

/*  code, sentence */
#define PAL_WALK_TABLE(X)                                                                                              \
    X(OK, "ok")                                                                                                        \
    X(TYPE, "message is of another type or version")                                                                   \
    X(SHORT, "message ends before its last field")                                                                     \
    X(LONG, "message is longer than its fields")                                                                       \
    X(NUMBER, "an array's count is negative or does not fit")                                                          \
    X(STRING, "a string is not ended or has a zero inside")                                                            \
    X(NAN, "a number is not finite")                                                                                   \
    X(SCHEMA, "the type is not one of this package")

typedef enum pal_walk {
#define X(code, text) PAL_WALK_##code,
    PAL_WALK_TABLE(X)
#undef X
        PAL_WALK_COUNT
} pal_walk;

const char *pal_walk_text(pal_walk result); /* never NULL */

/* type: palpate_<name>_t_get_type_info(); bytes: whole message with its fingerprint, untrusted, borrowed */
pal_walk pal_lcm_walk(const lcm_type_info_t *type, const void *bytes, size_t n_byte);
#endif
