/* A preflight (preflight.h) as text, JSON and log. Thread: [load]. */
#ifndef PAL_COMMANDS_PREFLIGHT_REPORT_H
#define PAL_COMMANDS_PREFLIGHT_REPORT_H
#include "server/solve/preflight.h"

#include <cjson/cJSON.h>

/* sentences on stdout; measured_ms: of a step here, at rest */
void pal_preflight_print(const pal_preflight *preflight, double measured_ms);
/* an object: bodies with limits, weak places, condition, predicted milliseconds; MB */
cJSON *pal_preflight_json(const pal_preflight *preflight);
/* one line in the log, a warning when something is weak, and one for each body whose element locks */
void pal_preflight_log(const pal_preflight *preflight, const char *scene);
#endif
