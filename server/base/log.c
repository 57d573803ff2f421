/* The log writes one line with one call, so that lines of several threads never mix. */
#include "server/base/log.h"

#include <pthread.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

enum { N_EVENT = 64, WINDOW_S = 10 };

static pal_log_level max_level = PAL_LOG_INFO;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
/* what was logged of each event in the present window; guarded by lock */
static struct {
    char event[24];
    time_t began_s;
    int n;
} seen[N_EVENT];

void pal_log_set_level(pal_log_level max)
{
    max_level = max;
}

/* May another line of this event be written? *n_left: lines that were left out in the window before */
static bool admit(const char *event, time_t now_s, int *n_left)
{
    int k = 0;
    *n_left = 0;
    pthread_mutex_lock(&lock);
    while (k < N_EVENT - 1 && seen[k].event[0] && strncmp(seen[k].event, event, sizeof seen[k].event - 1)) k++;
    if (!seen[k].event[0]) snprintf(seen[k].event, sizeof seen[k].event, "%s", event);
    if (now_s < seen[k].began_s || now_s - seen[k].began_s >= WINDOW_S) {
        if (seen[k].n > PAL_LOG_LINES) *n_left = seen[k].n - PAL_LOG_LINES;
        seen[k].began_s = now_s, seen[k].n = 0;
    }
    const bool may = seen[k].n++ < PAL_LOG_LINES;
    pthread_mutex_unlock(&lock);
    return may;
}

void pal_log(pal_log_level level, const char *event, const char *format, ...)
{
    static const char *const names[] = {"error", "warn", "info", "debug"};
    char text[1024], when[32];
    struct timespec now;
    struct tm utc;
    int n_left;
    va_list args;
    if (level > max_level) return;
    clock_gettime(CLOCK_REALTIME, &now);
    if (!admit(event, now.tv_sec, &n_left)) return;
    gmtime_r(&now.tv_sec, &utc);
    strftime(when, sizeof when, "%Y-%m-%dT%H:%M:%S", &utc);
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (n_left)
        fprintf(stderr, "%s.%03dZ %s %s: %d lines like this were left out\n", when, (int)(now.tv_nsec / 1000000),
                names[level], event, n_left);
    fprintf(stderr, "%s.%03dZ %s %s: %s\n", when, (int)(now.tv_nsec / 1000000), names[level], event, text);
}
