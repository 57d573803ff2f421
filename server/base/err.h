/* The error table: one code for each thing that the caller may do about it.
 *
 * Every fallible function returns pal_err, 0 is success, and writes its results only on success. A function with more
 * to report than its code takes a pal_diagnostic, which may be NULL: one sentence that names the file, the entry and
 * the number. Thread: any. */
#ifndef PAL_BASE_ERR_H
#define PAL_BASE_ERR_H
#include <stddef.h>

/*  code, what the caller may conclude */
#define PAL_ERR_TABLE(X)                                                                                               \
    X(OK, "ok")                                                                                                        \
    X(REFUSED, "input refused, nothing changed")                                                                       \
    X(MEMORY, "out of memory, nothing changed")                                                                        \
    X(IO, "file or socket failed, nothing changed")                                                                    \
    X(FULL, "queue full, try again later")                                                                             \
    X(STATE, "not possible in this state, nothing changed")                                                            \
    X(BUDGET, "asks for more than the stated budget, nothing changed")                                                 \
    X(NUMERIC, "no usable number came out, nothing changed")                                                           \
    X(FROZEN, "a body diverged and was frozen")                                                                        \
    X(INTERNAL, "an error of this program")

typedef enum pal_err {
#define X(code, text) PAL_ERR_##code,
    PAL_ERR_TABLE(X)
#undef X
        PAL_ERR_COUNT
} pal_err;

/* name ("REFUSED") and sentence of a code; never NULL */
const char *pal_err_name(pal_err err);
const char *pal_err_text(pal_err err);

/* one sentence, without a line end */
typedef struct pal_diagnostic {
    char text[512];
} pal_diagnostic;

/* writes the sentence (cut at the buffer's end) unless diag is NULL, and returns err */
pal_err pal_diagnostic_set(pal_diagnostic *diag, pal_err err, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* puts "name: " before the sentence of an error that diag holds, or before that of its code; returns err, which may be
 * 0 */
pal_err pal_diagnostic_prefix(pal_diagnostic *diag, pal_err err, const char *name);

/* the sentence of a refusal: return PAL_REFUSE(diag, "...", ...); */
#define PAL_REFUSE(diag, ...) pal_diagnostic_set(diag, PAL_ERR_REFUSED, __VA_ARGS__)

#define PAL_TRY(call)                                                                                                  \
    do {                                                                                                               \
        pal_err pal_try_err = (call);                                                                                  \
        if (pal_try_err) return pal_try_err;                                                                           \
    } while (0)

/* checks the program itself, never bytes, files or flags; off in Release */
#ifdef NDEBUG
#define PAL_ASSERT(condition) ((void)0)
#else
#define PAL_ASSERT(condition) ((condition) ? (void)0 : pal_assert_failed(#condition, __FILE__, __LINE__))
#endif
_Noreturn void pal_assert_failed(const char *condition, const char *file, int line);
#endif
