/* One-line log with levels. Lines go to stderr as "2026-01-31T23:59:59.123Z level event: text", in UTC. Of one event at
 * most PAL_LOG_LINES lines are written in 10 s, so that no client can fill a disk; how many were left out stands before
 * the next one. Not for use inside a step: it formats text. Thread: any for pal_log; set the level before threads
 * start. */
#ifndef PAL_BASE_LOG_H
#define PAL_BASE_LOG_H

enum { PAL_LOG_LINES = 200 };

typedef enum pal_log_level { PAL_LOG_ERROR, PAL_LOG_WARN, PAL_LOG_INFO, PAL_LOG_DEBUG } pal_log_level;

void pal_log_set_level(pal_log_level max); /* default PAL_LOG_INFO */
void pal_log(pal_log_level level, const char *event, const char *format, ...) __attribute__((format(printf, 3, 4)));
#endif
