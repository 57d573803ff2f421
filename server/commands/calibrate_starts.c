/* Numbers of a stored search are hexadecimal floating point (journal.h), so that a merge has every bit of them. */
#include "server/commands/calibrate_starts.h"

#include "server/base/hash.h"
#include "server/base/heap.h"
#include "server/calibrate/journal.h"
#include "server/scene/json_reader.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>

/* one search, which owns its arrays */
typedef struct found {
    double *theta;      /* [n_parameter] */
    double (*trail)[2]; /* [n_trail] */
    int n_trail;
    pal_fit_result result; /* value: error_percent alone; ended: NULL */
    char ended[16];
} found;

static void free_found(found *f)
{
    PAL_FREE(f->theta, f->trail);
    memset(f, 0, sizeof *f);
}

/* ---- a result of a shard ---- */

static cJSON *numbers_json(const double *number, size_t n)
{
    char *text = pal_journal_text(number, n);
    cJSON *o = text ? JSON_TEXT(text) : NULL;
    free(text);
    return o;
}

static cJSON *found_json(const found *f, const pal_calibrate_run *run, uint64_t seed)
{
    const pal_fit_result *r = &f->result;
    return PAL_JSON({"seed", JSON_NUMBER(seed)}, {"error_percent", pal_json_exact(r->value.error_percent)},
                    {"start_percent", pal_json_exact(r->start_percent)}, {"evaluations", JSON_NUMBER(r->n_evaluation)},
                    {"rejected", JSON_NUMBER(r->n_rejected)}, {"spent", JSON_NUMBER(r->n_spent)},
                    {"ended", JSON_TEXT(f->ended)}, {"seconds", pal_json_exact(r->seconds)},
                    {"ln_constants", numbers_json(f->theta, (size_t)run->info.n_parameter)},
                    {"steps", JSON_NUMBER(f->n_trail)},
                    {"trail", numbers_json(f->n_trail ? f->trail[0] : NULL, 2 * (size_t)f->n_trail)});
}

static int64_t whole_of(const cJSON *o, const char *key)
{
    const double value = pal_result_number(o, key);
    return value >= 0 && value < 9e15 ? (int64_t)value : 0;
}

static bool read_numbers(const cJSON *o, const char *key, double *out, size_t n)
{
    const char *text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(o, key));
    return text && pal_journal_numbers(text, out, n);
}

/* the inverse of found_json; false: damaged, or no memory */
static bool found_read(const cJSON *o, const pal_calibrate_run *run, found *out)
{
    const char *word = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(o, "ended"));
    const int64_t steps = whole_of(o, "steps");
    pal_err err = steps < INT_MAX ? PAL_ERR_OK : PAL_ERR_REFUSED;
    *out = (found){.n_trail = (int)steps};
    PAL_ARRAY(&err, out->theta, run->info.n_parameter);
    PAL_ARRAY(&err, out->trail, steps);
    out->result = (pal_fit_result){.value.error_percent = pal_result_number(o, "error_percent"),
                                   .start_percent = pal_result_number(o, "start_percent"),
                                   .n_evaluation = whole_of(o, "evaluations"),
                                   .n_rejected = whole_of(o, "rejected"),
                                   .n_spent = whole_of(o, "spent"),
                                   .seconds = pal_result_number(o, "seconds")};
    if (word) snprintf(out->ended, sizeof out->ended, "%s", word);
    const bool good = !err && word && !isnan(out->result.value.error_percent) &&
                      read_numbers(o, "ln_constants", out->theta, (size_t)run->info.n_parameter) &&
                      read_numbers(o, "trail", steps ? out->trail[0] : NULL, 2 * (size_t)steps);
    if (!good) free_found(out);
    return good;
}

/* hash of the files and of every option that a search depends on */
static uint64_t input_of(const pal_calibrate_starts *starts, const pal_calibrate_run *run)
{
    const pal_calibrate_options *o = &run->options;
    const pal_fit_options *f = &run->fit;
    const char *word[] = {run->input.fit, run->input.verify, run->input.truth, run->input.kinematics};
    char text[400];
    uint64_t hash = pal_result_input_tree(PAL_HASH_START, run->input.problem);
    if (run->from) hash = pal_result_input_file(hash, run->from);
    if (run->input.truth) hash = pal_result_input_file(hash, run->input.truth);
    for (size_t k = 0; k < sizeof word / sizeof *word; k++)
        hash = pal_hash_bytes(hash, word[k] ? word[k] : "", strlen(word[k] ? word[k] : "") + 1);
    int n =
        snprintf(text, sizeof text, "%d %lld %lld %a %a %d %d %d %d %d %d %d %a %a %a", starts->n, (long long)f->seed,
                 (long long)f->max_evaluation, f->budget_s, f->target_percent, o->voxel.resolution, o->split, o->equal,
                 o->without_area, o->grid[0], o->grid[1], o->grid[2], o->decades, o->smooth, o->pull);
    return pal_hash_bytes(hash, text, (size_t)n);
}

static pal_err open_lines(const pal_calibrate_starts *starts, const pal_calibrate_run *run, pal_result_lines **out,
                          pal_diagnostic *diag)
{
    const pal_shard_flags *flags = &starts->shard;
    const pal_result_list list = {"calibrate", input_of(starts, run), starts->n};
    *out = NULL;
    if (flags->shard) return pal_result_lines_open(flags->folder, &list, flags->index, flags->n, out, diag);
    if (!flags->merge) return PAL_ERR_OK;
    PAL_TRY(pal_result_lines_merge(flags->merge, &list, out, diag));
    return pal_result_lines_complete(*out, starts->n, diag);
}

/* ---- searches ---- */

/* A search without any equilibrium has a result as well, with the error DBL_MAX: another seed may find one. */
static pal_err anneal(pal_calibrate_run *run, uint64_t seed, found *out, pal_diagnostic *diag)
{
    pal_fit_options options = run->fit;
    const size_t n = (size_t)run->info.n_parameter;
    pal_err err = PAL_ERR_OK;
    *out = (found){0};
    PAL_ARRAY(&err, out->theta, n);
    if (err) return pal_diagnostic_set(diag, err, "no memory for the constants");
    memcpy(out->theta, run->info.start, n * sizeof *out->theta);
    options.seed = seed;
    run->trail = NULL, run->n_trail = 0;
    err = pal_fit_anneal(run->calibration, &options, out->theta, &out->result, diag);
    out->trail = run->trail, out->n_trail = run->n_trail;
    run->trail = NULL, run->n_trail = 0;
    snprintf(out->ended, sizeof out->ended, "%s", out->result.ended);
    out->result.ended = NULL;
    if (err != PAL_ERR_NUMERIC) return err;
    out->result.value.error_percent = DBL_MAX;
    return PAL_ERR_OK;
}

/* search k: stored, or carried out and then stored by its shard */
static pal_err take(pal_calibrate_starts *starts, pal_calibrate_run *run, pal_result_lines *lines, int k, found *out,
                    pal_diagnostic *diag)
{
    const cJSON *stored = lines ? pal_result_lines_find(lines, k) : NULL;
    const uint64_t seed = run->fit.seed + (uint64_t)k;
    if (stored) {
        starts->n_before++;
        return found_read(stored, run, out) ? PAL_ERR_OK : PAL_REFUSE(diag, "result %d of the shards is damaged", k);
    }
    PAL_TRY(anneal(run, seed, out, diag));
    if (!starts->shard.shard) return PAL_ERR_OK;
    if (pal_stop_asked()) return pal_diagnostic_set(diag, PAL_ERR_STATE, "stopped: search %d is not kept", k);
    starts->n_new++;
    return pal_result_lines_put(lines, k, found_json(out, run, seed), diag);
}

/* the best of the searches that are this process's; best->theta NULL: it has none */
static pal_err search(pal_calibrate_starts *starts, pal_calibrate_run *run, pal_result_lines *lines, found *best,
                      pal_diagnostic *diag)
{
    for (int k = 0; k < starts->n; k++) {
        found one = {0};
        if (lines && !pal_result_lines_own(lines, k)) continue;
        const pal_err err = take(starts, run, lines, k, &one, diag);
        if (!err && (!best->theta || one.result.value.error_percent < best->result.value.error_percent)) {
            free_found(best);
            *best = one, starts->chosen = k;
        } else {
            free_found(&one);
        }
        PAL_TRY(err);
        if (pal_stop_asked()) break;
    }
    return PAL_ERR_OK;
}

pal_err pal_calibrate_starts_run(pal_calibrate_starts *starts, pal_calibrate_run *run, pal_diagnostic *diag)
{
    pal_result_lines *lines;
    found best = {0};
    pal_err err = open_lines(starts, run, &lines, diag);
    if (!err) err = search(starts, run, lines, &best, diag);
    if (!err && best.theta && !starts->shard.shard && !(best.result.value.error_percent < DBL_MAX))
        err = pal_diagnostic_set(diag, PAL_ERR_NUMERIC,
                                 "none of %lld sets of constants comes to a stable rest under the loads",
                                 (long long)best.result.n_evaluation);
    if (!err && best.theta) {
        memcpy(run->theta, best.theta, sizeof *run->theta * (size_t)run->info.n_parameter);
        run->result = best.result;
        memcpy(starts->ended, best.ended, sizeof starts->ended);
        run->result.ended = starts->ended;
        run->trail = best.trail, run->n_trail = best.n_trail;
        best.trail = NULL;
    }
    free_found(&best);
    pal_result_lines_close(lines);
    return err;
}
