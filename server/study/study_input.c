/* Converts a word of the command line to the body and loads of a study. */
#include "server/study/study_input.h"

#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/json_reader.h"
#include "server/scene/problem_file.h"
#include "server/scene/scene_arg.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A JSON file whose root has a "format" is a problem. Read errors are reported later, by the scene reader. */
static bool is_problem(const char *word)
{
    uint8_t *bytes;
    size_t n_byte, n = strlen(word);
    cJSON *root = NULL;
    if (n <= 5 || strcmp(word + n - 5, ".json") != 0 || pal_file_read(word, PAL_JSON_MAX_BYTES, &bytes, &n_byte, NULL))
        return false;
    pal_json json = {.file = word};
    bool found = !pal_json_parse(&json, (const char *)bytes, n_byte, &root) &&
                 cJSON_GetObjectItemCaseSensitive(root, "format") != NULL;
    cJSON_Delete(root);
    free(bytes);
    return found;
}

static pal_err open_problem(const pal_study_request *q, pal_study_input *out, const char **samples,
                            pal_diagnostic *diag)
{
    pal_surface_report report = {0};
    if (q->body) return PAL_REFUSE(diag, "%s: --body: a problem has one body", q->word);
    PAL_TRY(pal_problem_read(q->word, &out->problem, diag));
    pal_problem *p = out->problem;
    const pal_problem_reference *named = q->load_case ? pal_problem_reference_find(p, q->load_case) : NULL;
    out->load_case = named          ? pal_problem_case_find(p, named->load_case)
                     : q->load_case ? pal_problem_case_find(p, q->load_case)
                                    : &p->load_case[0];
    if (!out->load_case) return pal_problem_refuse_case(p, "--case", q->load_case, diag);
    if (named && !*samples) *samples = named->file;
    pal_mesh_file_options file = {.unit_m = p->unit_m, .weld = PAL_MESH_WELD};
    PAL_TRY(pal_mesh_file_read(p->surface, &file, &out->surface, &report, NULL, NULL, diag));
    PAL_TRY(pal_diagnostic_prefix(diag, pal_study_problem_scene(p, &out->surface, diag, &out->made), q->word));
    out->scene = &out->made->scene;
    return PAL_ERR_OK;
}

static pal_err open_scene(const pal_study_request *q, pal_study_input *out, pal_diagnostic *diag)
{
    if (q->load_case && !q->keeps_case)
        return PAL_REFUSE(diag, "%s: --case: a scene has no load cases, a problem has", q->word);
    PAL_TRY(pal_scene_arg(q->word, q->options, &out->loaded, NULL, NULL, diag));
    const pal_scene *scene = out->scene = &out->loaded->scene;
    for (out->body = 0; q->body && out->body < scene->n_body; out->body++)
        if (!strcmp(scene->body[out->body].name, q->body)) return PAL_ERR_OK;
    if (!q->body) return PAL_ERR_OK;
    return PAL_REFUSE(diag, "%s: --body: there is no \"%.40s\", the first is \"%s\"", q->word, q->body,
                      scene->body[0].name);
}

pal_err pal_study_input_open(const pal_study_request *q, pal_study_input *out, pal_diagnostic *diag)
{
    const char *samples = q->samples;
    *out = (pal_study_input){0};
    PAL_TRY(is_problem(q->word) ? open_problem(q, out, &samples, diag) : open_scene(q, out, diag));
    if (!samples) return PAL_ERR_OK;
    PAL_TRY(pal_samples_read(samples, &out->samples, diag));
    out->has_samples = true;
    return PAL_ERR_OK;
}

void pal_study_input_close(pal_study_input *input)
{
    pal_configured_scene_free(input->made);
    pal_scene_free(input->loaded);
    free(input->problem);
    pal_surface_free(&input->surface);
    pal_samples_free(&input->samples);
    *input = (pal_study_input){0};
}

void pal_study_loads_read(const char *loads, double *seconds, bool *quick, char load_case[PAL_NAME])
{
    static const char named[] = "load case ";
    const char *comma = strchr(loads, ',');
    double value = comma ? strtod(comma + 1, NULL) : 0;
    *seconds = value >= 0.01 && value <= 60 ? value : 0;
    *quick = strstr(loads, ", quick") != NULL;
    load_case[0] = 0;
    if (comma && !strncmp(loads, named, sizeof named - 1))
        snprintf(load_case, PAL_NAME, "%.*s", (int)(comma - loads) - (int)(sizeof named - 1), loads + sizeof named - 1);
}

void pal_study_input_describe(const pal_study_input *in, const pal_study_request *q, pal_study_file *file)
{
    const pal_scene *scene = in->scene;
    /* everything that the reference depends on besides the body itself */
    uint64_t sum = pal_study_digest_numbers(pal_study_digest_numbers(PAL_HASH_START, &scene->step_s, 1), scene->up, 3);
    pal_configuration now;
    pal_configuration_of(scene, in->body, &now);
    sum = pal_study_digest_numbers(pal_hash_bytes(sum, now.law, strlen(now.law)), &scene->gravity_m_s2, 1);
    char loads[80] = "three presses and a pull";
    if (in->problem) snprintf(loads, sizeof loads, "load case %s", in->load_case->id);
    for (int k = 0; in->problem && k < in->load_case->n_load; k++)
        sum = pal_study_digest_load(sum, &in->load_case->load[k]);
    if (in->has_samples) sum = pal_study_digest_numbers(sum, in->samples.x, 3 * (size_t)in->samples.n);
    if (in->has_samples) sum = pal_study_digest_numbers(sum, in->samples.u, 3 * (size_t)in->samples.n);
    snprintf(file->study.name, sizeof file->study.name, "%s", scene->name);
    snprintf(file->body, sizeof file->body, "%s", scene->body[in->body].name);
    file->index = in->body;
    pal_study_shape(&scene->body[in->body], file->shape);
    snprintf(file->loads, sizeof file->loads, "%s, %g s%s%s", loads, q->seconds,
             in->has_samples ? ", given samples" : "", q->quick ? ", quick" : "");
    snprintf(file->digest, sizeof file->digest, "%016" PRIx64, sum);
}
