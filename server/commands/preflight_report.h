/* A preflight (solve/preflight.h) as text, as JSON and in the log. Thread: [load]. */
#ifndef PAL_COMMANDS_PREFLIGHT_REPORT_H
#define PAL_COMMANDS_PREFLIGHT_REPORT_H
#include "server/solve/preflight.h"

#include <cjson/cJSON.h>

/* sentences on stdout; measured_ms: time of a step at rest on this machine */
void pal_preflight_print(const pal_preflight *preflight, double measured_ms);
/* an object: bodies with limits, weak elements and nodes, condition number, predicted milliseconds; bytes */
cJSON *pal_preflight_json(const pal_preflight *preflight);
/* one line, a warning when an element or a node is weak, and one warning for each body that returns slowly or whose
 * element locks */
void pal_preflight_log(const pal_preflight *preflight, const char *scene);
#endif
