/* Why bytes were refused: the one result type of this room, which may not see server/base.
 *
 * Every function of protocol/ that can fail returns int: 0 is success, else one of these codes; results are written
 * only on success. Input is untrusted everywhere: no code path asserts, and nothing is allocated that is larger than a
 * small stated multiple of the input. Thread: any; no function of this room has global state. */
#ifndef PAL_PROTOCOL_REFUSAL_H
#define PAL_PROTOCOL_REFUSAL_H

/*  code, name, sentence */
#define PAL_REFUSAL_TABLE(X)                                                                                           \
    X(NONE, "ok")                                                                                                      \
    X(SHORT, "message ends before its last field")                                                                     \
    X(LONG, "message is longer than its fields or than its limit")                                                     \
    X(MAGIC, "message does not begin with PAL1")                                                                       \
    X(KIND, "message kind is unknown or not expected here")                                                            \
    X(FLAGS, "a flag is set that this version does not know")                                                          \
    X(COUNT, "a count does not fit the rest of the message")                                                           \
    X(RANGE, "a number is outside its allowed range")                                                                  \
    X(NAN, "a number is not finite")                                                                                   \
    X(LZ4, "compressed block is damaged or does not expand to its stated length")                                      \
    X(CHECKSUM, "checksum does not match")                                                                             \
    X(ORDER, "vertex order or predictor table is not valid")                                                           \
    X(EPOCH, "frame belongs to another asset")                                                                         \
    X(SPACE, "destination is too small")                                                                               \
    X(MEMORY, "out of memory")                                                                                         \
    X(JSON, "control message is not valid JSON within the limits")                                                     \
    X(FIELD, "control message lacks a field or a field has the wrong type")

typedef enum pal_refusal {
#define X(code, text) PAL_REFUSAL_##code,
    PAL_REFUSAL_TABLE(X)
#undef X
        PAL_REFUSAL_END
} pal_refusal;

/* sentence of a code; never NULL */
const char *pal_refusal_text(int code);
#endif
