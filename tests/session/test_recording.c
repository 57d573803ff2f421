/* Recordings that are opened for a debrief: the length of a step that a record announces has the limits of a scene. */
#include "server/session/recording.h"
#include "tests/check.h"
#include "tests/session/session_scene.h"

#include <unistd.h>

static pal_scene scene;
static pal_prepared mesh;
static char path[] = "/tmp/palpate_recording_XXXXXX";

static pal_err open_with(double step_s, pal_diagnostic *diag)
{
    pal_input_log *log;
    pal_recording *recording = NULL;
    pal_input_record record = {.kind = PAL_INPUT_PREPARE};
    unlink(path);
    if (pal_input_log_open(path, &scene, 1 << 20, diag, &log)) return PAL_ERR_INTERNAL;
    for (int b = 0; b < scene.n_body; b++) record.materials[b] = scene.body[b].material;
    record.configuration.step_s = step_s;
    pal_input_log_put(log, &record);
    record = (pal_input_record){.kind = PAL_INPUT_SWITCH, .step = 1};
    pal_input_log_put(log, &record);
    if (pal_input_log_close(log, 10, 1)) return PAL_ERR_INTERNAL;
    pal_err err = pal_recording_open(path, &scene, diag, &recording);
    if (!err) {
        const double rest = 9 * (step_s > 0 ? step_s : scene.step_s);
        CHECK_NEAR(pal_recording_length_s(recording), scene.step_s + rest, 1e-9 * rest);
    }
    pal_recording_close(recording);
    return err;
}

static void steps_have_the_limits_of_a_scene(void)
{
    static const double good[] = {0, PAL_STEP_MIN_S, 1.0 / 60, PAL_STEP_MAX_S},
                        bad[] = {0.99e-4, 0.101, -0.01, 1e300, INFINITY, NAN};
    for (size_t k = 0; k < sizeof good / sizeof *good; k++) {
        pal_diagnostic diag = {""};
        pal_err err = open_with(good[k], &diag);
        if (err) CHECK_FAIL("%g s: %s", good[k], diag.text);
    }
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        pal_diagnostic diag = {""};
        CHECK_INT(open_with(bad[k], &diag), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, "byte 40: a step of ") && strstr(diag.text, " s is outside 0.0001 .. 0.1"));
    }
}

int main(void)
{
    if (!small_scene(&scene, &mesh, 6)) return 1;
    close(mkstemp(path));
    RUN(steps_have_the_limits_of_a_scene);
    unlink(path);
    pal_prepared_free(&mesh);
    return check_report();
}
