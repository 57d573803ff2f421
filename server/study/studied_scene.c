/* Picks a configuration from the study stored beside a scene. */
#include "server/study/studied_scene.h"

#include "server/base/machine.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

const char *pal_accuracy_target_text(const pal_accuracy_target *target, char out[80])
{
    bool within = target->max_error_m > 0, budget = target->budget_ms > 0;
    int n = within ? snprintf(out, 80, "within %g mm", 1e3 * target->max_error_m) : 0;
    if (budget) snprintf(out + n, 80 - (size_t)n, "%sin at most %g ms", n ? " " : "", target->budget_ms);
    if (!within && !budget) out[0] = 0;
    return out;
}

const char *pal_study_error_text(const pal_study_file *file, double error_m, char out[PAL_STUDY_ERROR_TEXT])
{
    const pal_study *s = &file->study;
    char own[64] = "";
    if (s->reference_m > 0) snprintf(own, sizeof own, ", +- %.2g mm of the reference,", 1e3 * s->reference_m);
    snprintf(out, PAL_STUDY_ERROR_TEXT, "%.3g mm off%s under %s, that move it by up to %.3g mm", 1e3 * error_m, own,
             file->loads, 1e3 * s->max_m);
    return out;
}

void pal_study_accuracy_text(const pal_study *study, double error_m, char *out, size_t n_byte)
{
    char reference[sizeof study->reference];
    int n = snprintf(out, n_byte, "within %.3g mm, %.2g %% of the largest displacement", 1e3 * error_m,
                     1e2 * error_m / study->max_m);
    static const char of[] = ", of ";
    size_t left = n > 0 && (size_t)n + sizeof of < n_byte ? n_byte - (size_t)n - sizeof of : 0;
    snprintf(reference, sizeof reference, "%s", study->reference);
    for (char *comma; strlen(reference) > left && (comma = strrchr(reference, ',')); *comma = 0) continue;
    if (reference[0] && strlen(reference) <= left) snprintf(out + n, n_byte - (size_t)n, "%s%s", of, reference);
}

int pal_study_pick_target(const pal_study *study, const char *methods, const pal_accuracy_target *target)
{
    return pal_study_pick(study, methods, target->max_error_m > 0 ? target->max_error_m : NAN,
                          target->budget_ms > 0 ? target->budget_ms : NAN);
}

/* Is a closer to the target than b? By error within the budget, otherwise by time. */
static bool is_nearer(const pal_study_point *a, const pal_study_point *b, const pal_accuracy_target *target)
{
    if (target->max_error_m > 0 && target->budget_ms > 0) {
        bool a_in = a->measured.ms <= target->budget_ms, b_in = b->measured.ms <= target->budget_ms;
        if (a_in != b_in) return a_in;
        return a_in ? a->measured.error_m < b->measured.error_m : a->measured.ms < b->measured.ms;
    }
    return target->max_error_m > 0 ? a->measured.error_m < b->measured.error_m : a->measured.ms < b->measured.ms;
}

void pal_study_describe_miss(const pal_study *study, const char *methods, const pal_accuracy_target *target, char *out,
                             size_t n_byte)
{
    char asked[80], text[PAL_CONFIGURATION_TEXT], own[48] = "";
    const pal_study_point *best = NULL;
    int n = 0;
    for (int k = 0; k < study->n_point; k++) {
        const pal_study_point *p = &study->point[k];
        if (!pal_study_measured(p) || !pal_study_method_in(methods, p->measured.configuration.model)) continue;
        n++;
        if (!best || is_nearer(p, best, target)) best = p;
    }
    if (!pal_study_trusted(study)) {
        snprintf(out, n_byte,
                 "none of the configurations is named, since the reference itself is only within %.3g mm where %.3g mm "
                 "move: "
                 "hold more of the body (palpate prepare --hold 20, with --up as it lies), study it without --quick",
                 1e3 * study->reference_m, 1e3 * study->max_m);
        return;
    }
    pal_accuracy_target_text(target, asked);
    if (target->max_error_m > 0 && study->reference_m > 0)
        snprintf(own, sizeof own, " and %.2g of the reference's own", 1e3 * study->reference_m);
    if (!best)
        snprintf(out, n_byte, "none of the configurations was measured, so none is %s", asked);
    else
        snprintf(out, n_byte, "none of the %d configurations is %s: the nearest is %s, %.3g mm%s in %.3g ms", n, asked,
                 pal_configuration_text(&best->measured.configuration, text), 1e3 * best->measured.error_m, own,
                 best->measured.ms);
}

/* Reads and checks a study. *out NULL and OK: there is none. The diagnostic is about the study. */
static pal_err find(const char *path, const pal_scene *scene, pal_study_file **out, pal_diagnostic *diag)
{
    char shape[PAL_STUDY_SHAPE];
    *out = NULL;
    if (access(path, F_OK)) return PAL_ERR_OK;
    PAL_TRY(pal_study_file_read(path, out, diag));
    pal_study_mark_front(&(*out)->study);
    int body = (*out)->index;
    if (body < scene->n_body && !strcmp(pal_study_shape(&scene->body[body], shape), (*out)->shape)) return PAL_ERR_OK;
    free(*out);
    *out = NULL;
    return PAL_REFUSE(diag, "%s: is of another body than this scene's, or of other material", path);
}

static pal_err pick(const char *word, const char *path, const pal_scene *scene, const pal_accuracy_target *target,
                    pal_studied_scene *out, pal_diagnostic *diag)
{
    char asked[80], text[PAL_CONFIGURATION_TEXT], none[360], off[PAL_STUDY_ERROR_TEXT];
    const pal_study *study = &out->file->study;
    pal_accuracy_target_text(target, asked);
    out->picked = pal_study_pick_target(study, "", target);
    if (out->picked < 0) {
        pal_study_describe_miss(study, "", target, none, sizeof none);
        return PAL_REFUSE(diag, "%s: %s; more of them: palpate study %s --again", path, none, word);
    }
    const pal_measured_configuration *p = &study->point[out->picked].measured;
    pal_configuration configuration = p->configuration;
    if (configuration.step_s == 0) configuration.step_s = study->step_s;
    pal_err err = pal_configuration_make(scene, out->file->index, &configuration, diag, &out->set);
    pal_diagnostic_prefix(diag, err, pal_configuration_text(&p->configuration, text));
    if (err) return pal_diagnostic_prefix(diag, err, path);
    out->scene = &out->set->scene;
    snprintf(out->summary, sizeof out->summary, "%s: %s, %s in %.3g ms, picked of the %d configurations of %.160s (%s)",
             scene->body[out->file->index].name, pal_configuration_text(&p->configuration, text),
             pal_study_error_text(out->file, p->error_m, off), p->ms, out->n_configuration, path, asked);
    return PAL_ERR_OK;
}

pal_err pal_studied_scene_open(const char *word, const pal_scene *scene, pal_studied_scene *out, pal_diagnostic *diag)
{
    char stem[PAL_STUDY_PATH], path[PAL_STUDY_PATH + 8], machine[PAL_MACHINE_TEXT], asked[80];
    const pal_accuracy_target target = {scene->max_error_m, scene->budget_ms};
    bool wanted = target.max_error_m > 0 || target.budget_ms > 0;
    pal_diagnostic reason = {""};
    *out = (pal_studied_scene){.scene = scene, .picked = -1};
    PAL_TRY(pal_study_stem(word, NULL, stem, diag));
    snprintf(path, sizeof path, "%s.json", stem);
    pal_err err = find(path, scene, &out->file, &reason);
    if (!out->file && wanted)
        return pal_diagnostic_set(diag, err ? err : PAL_ERR_REFUSED,
                                  "%s: asks for a configuration %s, %s%s: run palpate study %s%s", word,
                                  pal_accuracy_target_text(&target, asked), err ? "and " : "but there is no ",
                                  err ? reason.text : path, word, err ? " --again" : "");
    if (!out->file) {
        if (err) snprintf(out->warn, sizeof out->warn, "%.300s: not looked at", reason.text);
        return PAL_ERR_OK;
    }
    out->body = out->file->index;
    out->configuration = malloc(PAL_STUDY_POINTS * sizeof *out->configuration);
    if (!out->configuration) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory", path);
    out->n_configuration = pal_study_configurations(&out->file->study, out->configuration);
    if (strcmp(pal_machine_name(machine), out->file->study.machine) != 0)
        snprintf(out->warn, sizeof out->warn, "%.150s: its milliseconds are of %.100s, this is %.100s", path,
                 out->file->study.machine, machine);
    else if (!out->file->whole)
        snprintf(out->warn, sizeof out->warn, "%.150s: was broken off after %d of %d configurations", path,
                 out->file->study.n_point, out->file->n_total);
    return wanted ? pick(word, path, scene, &target, out, diag) : PAL_ERR_OK;
}

void pal_studied_scene_close(pal_studied_scene *studied)
{
    pal_configured_scene_free(studied->set);
    free(studied->file);
    free(studied->configuration);
    *studied = (pal_studied_scene){0};
}
