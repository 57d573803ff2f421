/* Output of a command: refusals, progress and the one JSON object. Thread: [load]. */
#ifndef PAL_CLI_REPORT_H
#define PAL_CLI_REPORT_H
#include "server/base/flags.h"
#include "server/base/json_members.h"

#include <stdbool.h>

/* exit code of an error: 0 ok, 3 for INTERNAL and MEMORY, else 1 */
int pal_report_code(pal_err err);
/* one line on stderr, "palpate COMMAND: sentence" (line breaks in the sentence become blanks), with --json also
 * {"ok": false, "error": {"code": "REFUSED", "text": "..."}} on stdout; the result is the exit code */
int pal_report_refusal(const pal_flag_common *common, pal_err err, const pal_diagnostic *diag);
/* prints the object on stdout (one line) and takes it; the result is 0, or 3 when it could not be made or written */
int pal_report_json(const pal_flag_common *common, cJSON *object);
/* the end of a command, which clears the progress line: the refusal of err; or with --json the object, which is taken,
 * and NULL without; the exit code */
int pal_report_end(const pal_flag_common *common, pal_err err, const pal_diagnostic *diag, cJSON *object);
/* a number that is not finite is left out, or (DBL_MAX as well) becomes null */
cJSON *pal_json_finite(double value);
cJSON *pal_json_or_null(double value);
/* n texts that are stored stride bytes apart */
cJSON *pal_json_texts(const char *text, size_t stride, int n);

/* progress on one line of stderr that is rewritten, "fill 42 %"; only on a terminal, without --quiet and --json. user
 * is the pal_flag_common, so that it fits callbacks; what NULL clears the line */
void pal_report_progress(const char *what, double fraction, void *user);
/* the same for callbacks that may end the work: false once a stop is asked for */
bool pal_report_continue(const char *what, double fraction, void *user);

/* SIGINT and SIGTERM ask for a stop; the second one ends the process */
void pal_stop_watch(void);
bool pal_stop_asked(void);
#endif
