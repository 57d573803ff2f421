#include "server/base/err.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

static const struct {
    const char *name, *text;
} table[] = {
#define X(code, text) {#code, text},
    PAL_ERR_TABLE(X)
#undef X
};

const char *pal_err_name(pal_err err)
{
    return (unsigned)err < PAL_ERR_COUNT ? table[err].name : "UNKNOWN";
}

const char *pal_err_text(pal_err err)
{
    return (unsigned)err < PAL_ERR_COUNT ? table[err].text : "unknown error code";
}

pal_err pal_diagnostic_set(pal_diagnostic *diag, pal_err err, const char *format, ...)
{
    if (diag) {
        va_list args;
        va_start(args, format);
        vsnprintf(diag->text, sizeof diag->text, format, args);
        va_end(args);
    }
    return err;
}

pal_err pal_diagnostic_prefix(pal_diagnostic *diag, pal_err err, const char *name)
{
    if (!err || !diag) return err;
    const pal_diagnostic own = *diag;
    return pal_diagnostic_set(diag, err, "%s: %s", name, own.text[0] ? own.text : pal_err_text(err));
}

void pal_assert_failed(const char *condition, const char *file, int line)
{
    fprintf(stderr, "%s:%d: assertion failed: %s\n", file, line, condition);
    abort();
}
