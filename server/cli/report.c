#include "server/cli/report.h"

#include <float.h>
#include <math.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <unistd.h>

int pal_report_code(pal_err err)
{
    return err == PAL_ERR_MEMORY || err == PAL_ERR_INTERNAL ? 3 : err != PAL_ERR_OK;
}

int pal_report_refusal(const pal_flag_common *common, pal_err err, const pal_diagnostic *diag)
{
    char text[sizeof diag->text];
    snprintf(text, sizeof text, "%s", diag && diag->text[0] ? diag->text : pal_err_text(err));
    for (char *c = text; *c; c++)
        if ((unsigned char)*c < 0x20 || *c == 0x7f) *c = ' ';
    pal_report_progress(NULL, 0, (void *)(uintptr_t)common);
    fprintf(stderr, "%s: %s\n", common->program, text);
    if (common->json)
        pal_report_json(
            common, PAL_JSON({"ok", JSON_BOOL(false)},
                             {"error", PAL_JSON({"code", JSON_TEXT(pal_err_name(err))}, {"text", JSON_TEXT(text)})}));
    return pal_report_code(err);
}

int pal_report_json(const pal_flag_common *common, cJSON *object)
{
    bool good = pal_json_write(stdout, object);
    if (!good) fprintf(stderr, "%s: the JSON object could not be written\n", common->program);
    return good ? 0 : 3;
}

int pal_report_end(const pal_flag_common *common, pal_err err, const pal_diagnostic *diag, cJSON *object)
{
    pal_report_progress(NULL, 0, (void *)(uintptr_t)common);
    if (!err && common->json) return pal_report_json(common, object);
    cJSON_Delete(object);
    return err ? pal_report_refusal(common, err, diag) : 0;
}

void pal_report_progress(const char *what, double fraction, void *user)
{
    static bool shown;
    const pal_flag_common *common = user;
    if (common->quiet || common->json || !isatty(STDERR_FILENO)) return;
    if (!what && !shown) return;
    fprintf(stderr, "\r\033[K%s", what ? what : "");
    if (what && fraction > 0) fprintf(stderr, " %.0f %%", 100 * fraction);
    fflush(stderr);
    shown = what != NULL;
}

cJSON *pal_json_finite(double value)
{
    return isfinite(value) ? cJSON_CreateNumber(value) : NULL;
}

cJSON *pal_json_or_null(double value)
{
    return isfinite(value) && value < DBL_MAX ? cJSON_CreateNumber(value) : cJSON_CreateNull();
}

cJSON *pal_json_texts(const char *text, size_t stride, int n)
{
    cJSON *list = cJSON_CreateArray();
    for (int k = 0; k < n; k++) cJSON_AddItemToArray(list, cJSON_CreateString(text + stride * (size_t)k));
    return list;
}

/* a handler may run on any thread: a lock-free atomic is safe in it and between threads */
static atomic_int stop_asked;

static void on_stop(int number)
{
    (void)number;
    stop_asked = 1;
}

void pal_stop_watch(void)
{
    struct sigaction action = {.sa_handler = on_stop, .sa_flags = (int)SA_RESETHAND};
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

bool pal_stop_asked(void)
{
    return stop_asked;
}

bool pal_report_continue(const char *what, double fraction, void *user)
{
    pal_report_progress(what, fraction, user);
    return !stop_asked;
}
