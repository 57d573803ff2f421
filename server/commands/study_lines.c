/* Results of a study in shards. */
#include "server/commands/study_lines.h"

#include "server/base/hash.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* cJSON prints 15 digits of a number that it has read, where these are near enough: numbers become text of 17 */
static bool make_exact(cJSON *tree)
{
    cJSON *child;
    bool good = true;
    cJSON_ArrayForEach(child, tree)
    {
        good = make_exact(child) && good;
        if (!cJSON_IsNumber(child)) continue;
        char text[32];
        snprintf(text, sizeof text, "%.17g", child->valuedouble);
        child->type = cJSON_Raw, child->valuestring = strdup(text);
        good = child->valuestring && good;
    }
    return good;
}

/* result -> a study of one point; heap */
static pal_err read_result(const pal_result_lines *lines, const char *folder, int index, pal_study_file **out,
                           pal_diagnostic *diag)
{
    char name[PAL_STUDY_PATH];
    snprintf(name, sizeof name, "%.1000s: result %d", folder, index);
    cJSON *tree = cJSON_Duplicate(pal_result_lines_find(lines, index), true);
    char *json = tree && make_exact(tree) ? cJSON_PrintUnformatted(tree) : NULL;
    cJSON_Delete(tree);
    if (!json) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory", name);
    pal_err err = pal_study_file_parse(name, json, strlen(json), out, diag);
    cJSON_free(json);
    if (!err && (*out)->study.n_point != 1) err = PAL_REFUSE(diag, "%s is damaged: it has not one point", name);
    return err;
}

/* the points that the lines hold, in the order of the sweep -> a study; NULL: none */
static pal_err read_results(const pal_result_lines *lines, const char *folder, pal_study_file **out,
                            pal_diagnostic *diag)
{
    for (int k = 0; k < PAL_STUDY_POINTS; k++) {
        pal_study_file *one = NULL;
        if (!pal_result_lines_find(lines, k)) continue;
        pal_err err = read_result(lines, folder, k, &one, diag);
        if (!err && (*out) && strcmp((*out)->study.machine, one->study.machine) != 0)
            err = PAL_REFUSE(diag, "result %d was measured on another processor, %.150s, whose times do not compare", k,
                             one->study.machine);
        if (!err && !(*out)) {
            *out = one;
            continue;
        }
        if (!err) (*out)->study.point[(*out)->study.n_point++] = one->study.point[0];
        free(one);
        PAL_TRY(err);
    }
    return PAL_ERR_OK;
}

pal_err pal_study_lines_open(const pal_shard_flags *flags, const pal_study_file *now, pal_result_lines **lines,
                             pal_study_file **out, pal_diagnostic *diag)
{
    const char *part[] = {now->shape, now->digest, now->loads, now->methods};
    uint64_t input = PAL_HASH_START;
    for (size_t k = 0; k < sizeof part / sizeof *part; k++) input = pal_hash_bytes(input, part[k], strlen(part[k]) + 1);
    const pal_result_list list = {"study", input, PAL_STUDY_POINTS};
    PAL_TRY(flags->merge ? pal_result_lines_merge(flags->merge, &list, lines, diag)
                         : pal_result_lines_open(flags->folder, &list, flags->index, flags->n, lines, diag));
    PAL_TRY(read_results(*lines, flags->merge ? flags->merge : flags->folder, out, diag));
    if (!flags->merge) return PAL_ERR_OK;
    if (!*out) return PAL_REFUSE(diag, "%s: the shards hold no results", flags->merge);
    return pal_result_lines_complete(*lines, (*out)->n_total, diag);
}

pal_err pal_study_lines_put(pal_result_lines *lines, int index, const pal_study_file *now, const pal_study *study,
                            int n_total, pal_diagnostic *diag)
{
    pal_study_file *one = malloc(sizeof *one);
    if (!one) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a result");
    *one = *now;
    one->study = *study;
    memcpy(one->study.name, now->study.name, sizeof one->study.name);
    one->study.point[0] = study->point[study->n_point - 1];
    one->study.point[0].measured.front = false;
    one->study.n_point = 1, one->n_total = n_total, one->whole = false;
    pal_err err = pal_result_lines_put(lines, index, pal_study_file_tree(one), diag);
    free(one);
    return err;
}
