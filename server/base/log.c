/* The log writes one line with one call, so that lines of several threads never mix. */
#include "server/base/log.h"

#include <stdarg.h>
#include <stdio.h>

static pal_log_level max_level = PAL_LOG_INFO;

void pal_log_set_level(pal_log_level max)
{
    max_level = max;
}

void pal_log(pal_log_level level, const char *event, const char *format, ...)
{
    static const char *const names[] = {"error", "warn", "info", "debug"};
    char text[1024];
    va_list args;
    if (level > max_level) return;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    fprintf(stderr, "%s %s: %s\n", names[level], event, text);
}
