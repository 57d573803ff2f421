/* `palpate-calibrate-mpi`: calibration by annealing whose evaluations run on many processes (MPI ranks), for studies of
 * many organs, load cases and seeds. Rank 0 anneals; every rank makes the same calibration from the same files and
 * evaluates what rank 0 sends, points in turn. The cost depends on theta alone and the annealing on the seed alone, so
 * the result is the same to the bit for any number of ranks and after an interruption: evaluations in the journal are
 * read instead of computed. */
#include "server/base/clock.h"
#include "server/base/team.h"
#include "server/calibrate/calibrate_cases.h"
#include "server/calibrate/calibrate_journal.h"
#include "server/cli/flags.h"
#include "server/num/anneal.h"
#include "server/scene/scene_file.h"

#include <errno.h>
#include <float.h>
#include <limits.h>
#include <math.h>
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_PROBLEM = 256, MAX_SEED = 64, TAG_COUNT = 1, TAG_THETA, TAG_COST, COUNT_END = -1 };

static const char about[] =
    "Calibrates springs as `palpate calibrate --method annealing` does, with evaluations distributed over MPI ranks, "
    "for\n"
    "many problems and seeds one after another. Every evaluation is written to the journal; a run that is started "
    "again\n"
    "with the same journal reads them from there and ends with the same result. A problem that is refused is reported\n"
    "and the next one started. -o DIR: DIR/NAME.json with the constants of each (NAME_S.json with several seeds S).\n";

/* the state of one process */
typedef struct job {
    pal_flag_common common;
    const char *problem[MAX_PROBLEM];
    int n_problem;
    pal_calibrate_input input;
    pal_calibrate_options options;
    const char *journal_path, *folder, *grid_text, *seed_text;
    int seed[MAX_SEED], n_seed;
    int n_worker, evaluations;
    double budget_s, target_percent;
    int rank, n_rank, n_batch; /* n_batch: points of a batch, of the largest team on every rank */
    pal_journal *journal;      /* rank 0 */
    pal_team *team;
    /* the current problem */
    pal_calibrate_cases *set;
    pal_calibration *c;
    pal_calibration_info info;
    pal_calibration_workspace *workspace[PAL_TEAM_MAX];
    uint64_t fingerprint; /* of the cost function */
    /* the current batch */
    double *theta, *cost; /* [batch][n_parameter], [batch] */
    bool no_memory;       /* in one of them */
    int *missing;         /* points of the batch that are not in the journal [batch] */
    int64_t n_computed, n_taken;
    pal_diagnostic diag;
} job;

/* ---- messages ---- */

/* waits for a message without keeping a core busy that another rank may need */
static void wait_for(int from, int tag, MPI_Status *status)
{
    int there = 0;
    for (long us = 1;; us = us < 200 ? 2 * us : 200) {
        MPI_Iprobe(from, tag, MPI_COMM_WORLD, &there, status);
        if (there) return;
        nanosleep(&(struct timespec){.tv_nsec = 1000 * us}, NULL);
    }
}

/* the same result on every rank: the error of the lowest rank that has one, with its diagnostic */
static pal_err agree(job *j, pal_err err)
{
    int mine = err ? j->rank : j->n_rank, first, code = (int)err;
    MPI_Allreduce(&mine, &first, 1, MPI_INT, MPI_MIN, MPI_COMM_WORLD);
    if (first == j->n_rank) return PAL_ERR_OK;
    MPI_Bcast(&code, 1, MPI_INT, first, MPI_COMM_WORLD);
    MPI_Bcast(j->diag.text, sizeof j->diag.text, MPI_CHAR, first, MPI_COMM_WORLD);
    return (pal_err)code;
}

/* ---- evaluations ---- */

static void evaluate_one(void *user, int worker, int index)
{
    job *j = user;
    pal_calibration_value v;
    const double *theta = j->theta + (size_t)index * (size_t)j->info.n_parameter;
    pal_err err = pal_calibration_evaluate(j->c, j->workspace[worker], theta, PAL_CALIBRATION_FIT, &v, NULL, NULL);
    j->cost[index] = err == PAL_ERR_MEMORY ? NAN : err ? DBL_MAX : v.error_percent;
}

/* every rank but 0: evaluates what rank 0 sends, until COUNT_END */
static void serve(job *j)
{
    for (;;) {
        MPI_Status status;
        int n;
        wait_for(0, TAG_COUNT, &status);
        MPI_Recv(&n, 1, MPI_INT, 0, TAG_COUNT, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        if (n == COUNT_END) return;
        MPI_Recv(j->theta, n * j->info.n_parameter, MPI_DOUBLE, 0, TAG_THETA, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        pal_team_run(j->team, n, evaluate_one, j);
        MPI_Send(j->cost, n, MPI_DOUBLE, 0, TAG_COST, MPI_COMM_WORLD);
    }
}

static void end_ranks(const job *j)
{
    const int n = COUNT_END;
    for (int r = 1; r < j->n_rank; r++) MPI_Send(&n, 1, MPI_INT, r, TAG_COUNT, MPI_COMM_WORLD);
}

/* the share of a rank in m points: the points rank, rank + n_rank ... */
static int share_of(const job *j, int rank, int m)
{
    return rank < m ? (m - rank - 1) / j->n_rank + 1 : 0;
}

/* copies a rank's points of the batch to the front of j->theta */
static int pick(job *j, int rank, const double *theta, int m)
{
    size_t n = (size_t)j->info.n_parameter;
    int mine = share_of(j, rank, m);
    for (int k = 0; k < mine; k++)
        memcpy(j->theta + (size_t)k * n, theta + (size_t)j->missing[rank + k * j->n_rank] * n, n * sizeof *theta);
    return mine;
}

/* a rank's errors, from j->cost, into the batch and the journal */
static pal_err gather(job *j, int rank, const double *theta, int m, double *cost)
{
    pal_err err = PAL_ERR_OK;
    int mine = share_of(j, rank, m);
    for (int k = 0; k < mine; k++) {
        int at = j->missing[rank + k * j->n_rank];
        cost[at] = j->cost[k];
        j->n_computed++;
        if (isnan(cost[at]))
            j->no_memory = true;
        else if (!err && j->journal)
            err = pal_journal_put(j->journal, theta + (size_t)at * (size_t)j->info.n_parameter, cost[at], &j->diag);
    }
    return err;
}

/* a batch of the walk: from the journal, else round robin over the ranks; on rank 0 */
static pal_err evaluate(void *user, const double *theta, int n, double *cost)
{
    job *j = user;
    size_t n_parameter = (size_t)j->info.n_parameter;
    int m = 0, waiting = 0;
    for (int i = 0; i < n; i++) {
        if (j->journal && pal_journal_find(j->journal, theta + (size_t)i * n_parameter, &cost[i]))
            j->n_taken++;
        else
            j->missing[m++] = i;
    }
    for (int r = 1; r < j->n_rank; r++) {
        int share = pick(j, r, theta, m);
        if (share == 0) continue;
        MPI_Send(&share, 1, MPI_INT, r, TAG_COUNT, MPI_COMM_WORLD);
        MPI_Send(j->theta, share * j->info.n_parameter, MPI_DOUBLE, r, TAG_THETA, MPI_COMM_WORLD);
        waiting++;
    }
    int mine = pick(j, 0, theta, m);
    pal_team_run(j->team, mine, evaluate_one, j);
    pal_err err = gather(j, 0, theta, m, cost);
    for (; waiting > 0; waiting--) {
        MPI_Status status;
        wait_for(MPI_ANY_SOURCE, TAG_COST, &status);
        int from = status.MPI_SOURCE;
        MPI_Recv(j->cost, share_of(j, from, m), MPI_DOUBLE, from, TAG_COST, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        pal_err next = gather(j, from, theta, m, cost);
        if (!err) err = next;
    }
    if (!err && j->no_memory) err = pal_diagnostic_set(&j->diag, PAL_ERR_MEMORY, "no memory to evaluate constants");
    return err;
}

/* ---- a problem ---- */

/* stands for everything that an evaluation depends on, and its answer at the start */
static uint64_t fingerprint(const job *j, double start_percent)
{
    const pal_tets *t = &j->info.mesh->tets;
    size_t n = 3 * sizeof(double) * (size_t)t->n_node, n_theta = sizeof(double) * (size_t)j->info.n_parameter;
    uint64_t sum = pal_journal_hash(0, PAL_VERSION, sizeof PAL_VERSION);
    const int facts[8] = {j->info.n_parameter, j->info.n_kind,          j->info.n_node,         j->info.n_tet,
                          j->options.equal,    j->options.without_area, j->options.grid[0] > 0, j->info.n_spring};
    sum = pal_journal_hash(sum, facts, sizeof facts);
    sum = pal_journal_hash(sum, t->x, n);
    sum = pal_journal_hash(sum, t->tet, 4 * sizeof *t->tet * (size_t)t->n_tet);
    sum = pal_journal_hash(sum, j->info.start, n_theta);
    sum = pal_journal_hash(sum, j->info.low, n_theta);
    for (int k = 0; k < j->set->n; k++) {
        const pal_calibrate_case *one = &j->set->list[k];
        const int what[3] = {one->fit, one->linear, j->info.n_point[k]};
        if (!one->fit) continue;
        sum = pal_journal_hash(sum, what, sizeof what);
        sum = pal_journal_hash(sum, pal_calibration_forces(j->c, k), n);
        sum = pal_journal_hash(sum, &j->info.max_m[k], sizeof(double));
        if (one->samples) sum = pal_journal_hash(sum, one->samples->x, 3 * sizeof(double) * (size_t)one->samples->n);
        if (one->samples) sum = pal_journal_hash(sum, one->samples->u, 3 * sizeof(double) * (size_t)one->samples->n);
    }
    return pal_journal_hash(sum, &start_percent, sizeof start_percent);
}

static pal_err make(job *j, const char *problem)
{
    pal_diagnostic reason = {""};
    pal_calibration_value v;
    pal_calibrate_options o = j->options;
    j->input.problem = problem;
    PAL_TRY(pal_calibrate_cases_read(&j->input, j->set, &j->diag));
    pal_err err = PAL_ERR_OK;
    if (o.voxel.resolution == 0) err = pal_calibrate_cases_resolution(j->set, &o.voxel, &o.voxel.resolution, &reason);
    if (!err)
        err = pal_calibration_create(j->set->problem, &j->set->surface, j->set->list, j->set->n, &o, &j->c, &reason);
    if (err) return pal_diagnostic_set(&j->diag, err, "%s: %s", problem, reason.text);
    pal_calibration_info_of(j->c, &j->info);
    PAL_TRY(pal_calibrate_cases_check(j->set, j->info.mesh, &j->diag));
    size_t batch = (size_t)j->n_batch;
    j->theta = malloc(batch * (size_t)j->info.n_parameter * sizeof *j->theta);
    j->cost = malloc(batch * sizeof *j->cost);
    j->missing = malloc(batch * sizeof *j->missing);
    bool room = j->theta && j->cost && j->missing;
    for (int w = 0; w < pal_team_size(j->team) && room; w++)
        room = !pal_calibration_workspace_create(j->c, &j->workspace[w]);
    if (!room) return pal_diagnostic_set(&j->diag, PAL_ERR_MEMORY, "%s: no memory for its evaluations", problem);
    PAL_TRY(pal_calibration_evaluate(j->c, j->workspace[0], j->info.start, PAL_CALIBRATION_FIT, &v, NULL, &j->diag));
    j->fingerprint = fingerprint(j, v.error_percent);
    return PAL_ERR_OK;
}

static void unmake(job *j)
{
    for (int w = 0; w < PAL_TEAM_MAX; w++) {
        pal_calibration_workspace_destroy(j->workspace[w]);
        j->workspace[w] = NULL;
    }
    pal_calibration_destroy(j->c);
    j->c = NULL;
    pal_calibrate_cases_free(j->set);
    *j->set = (pal_calibrate_cases){0};
    free(j->theta);
    free(j->cost);
    free(j->missing);
    j->theta = j->cost = NULL;
    j->missing = NULL;
}

/* is the calibration the same on every rank? */
static pal_err same_everywhere(job *j, const char *problem)
{
    uint64_t root = j->fingerprint;
    MPI_Bcast(&root, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
    if (root == j->fingerprint) return PAL_ERR_OK;
    return pal_diagnostic_set(
        &j->diag, PAL_ERR_REFUSED,
        "%s: rank %d makes another calibration of it than rank 0: the files or the machines differ", problem, j->rank);
}

/* ---- results ---- */

static void add_percent(cJSON *to, const char *key, double percent)
{
    if (percent < DBL_MAX)
        cJSON_AddNumberToObject(to, key, percent);
    else
        cJSON_AddNullToObject(to, key);
}

/* independent of ranks and time */
static cJSON *as_json(const job *j, int seed, const double *theta, const pal_fit_result *r)
{
    static const char *const name[PAL_SPRING_KINDS] = {"k_distance_J", "k_area_J", "k_volume_J"};
    cJSON *o = cJSON_CreateObject();
    cJSON_AddBoolToObject(o, "ok", true);
    cJSON_AddStringToObject(o, "problem", j->set->problem->name);
    cJSON_AddNumberToObject(o, "seed", seed);
    cJSON *cases = cJSON_AddArrayToObject(o, "cases");
    for (int k = 0; k < j->set->n; k++) {
        cJSON *one = cJSON_CreateObject();
        cJSON_AddStringToObject(one, "id", j->set->id[k]);
        cJSON_AddBoolToObject(one, "fitted", j->set->list[k].fit);
        add_percent(one, "percent", r->value.case_percent[k]);
        cJSON_AddItemToArray(cases, one);
    }
    add_percent(o, "start_percent", r->start_percent);
    add_percent(o, "error_percent", r->value.error_percent);
    cJSON_AddNumberToObject(o, "evaluations", (double)r->n_evaluation);
    cJSON_AddNumberToObject(o, "rejected", (double)r->n_rejected);
    cJSON_AddStringToObject(o, "ended", r->ended);
    cJSON_AddNumberToObject(o, "nodes", j->info.n_node);
    cJSON_AddNumberToObject(o, "used", j->info.n_used);
    cJSON *constants = cJSON_AddObjectToObject(o, "constants");
    for (int k = 0; k < j->info.n_kind; k++) {
        cJSON *list = cJSON_AddArrayToObject(constants, name[j->info.kind[k]]);
        for (int i = 0; i < j->info.n_used; i++)
            cJSON_AddItemToArray(list, cJSON_CreateNumber(exp(theta[k * j->info.n_used + i])));
    }
    /* logarithms, exact to the bit */
    cJSON *exact = cJSON_AddArrayToObject(o, "ln_constants");
    for (int i = 0; i < j->info.n_parameter; i++) {
        char text[40];
        snprintf(text, sizeof text, "%a", theta[i]);
        cJSON_AddItemToArray(exact, cJSON_CreateString(text));
    }
    return o;
}

/* writes DIR/NAME.json whole or not at all */
static pal_err write_result(job *j, const char *problem, int seed, const cJSON *result)
{
    char path[1200], temporary[1220], tail[32] = "";
    const char *name = strrchr(problem, '/') ? strrchr(problem, '/') + 1 : problem, *dot = strrchr(name, '.');
    if (!j->folder) return PAL_ERR_OK;
    if (j->n_seed > 1) snprintf(tail, sizeof tail, "_%d", seed);
    int n = snprintf(path, sizeof path, "%.900s/%.*s%s.json", j->folder, dot ? (int)(dot - name) : 200, name, tail);
    if (n < 0 || (size_t)n >= sizeof path)
        return pal_diagnostic_set(&j->diag, PAL_ERR_REFUSED, "%.200s: too long", problem);
    snprintf(temporary, sizeof temporary, "%s.part", path);
    char *text = result ? cJSON_Print(result) : NULL;
    if (!text) return pal_diagnostic_set(&j->diag, PAL_ERR_MEMORY, "%.200s: no memory for the result", path);
    FILE *file = fopen(temporary, "we");
    bool good = file && fprintf(file, "%s\n", text) > 0;
    if (file) good = fclose(file) == 0 && good;
    if (good) good = rename(temporary, path) == 0;
    cJSON_free(text);
    if (good) return PAL_ERR_OK;
    int reason = errno;
    remove(temporary);
    return pal_diagnostic_set(&j->diag, PAL_ERR_IO, "%.300s: cannot be written: %s", path, strerror(reason));
}

static void print(const job *j, const char *problem, int seed, const pal_fit_result *r)
{
    if (j->common.json || j->common.quiet) return;
    printf("%s, seed %d: error %.4g %% (start %.4g %%), %lld evaluations, %s\n", problem, seed, r->value.error_percent,
           r->start_percent, (long long)r->n_evaluation, r->ended);
    fflush(stdout);
}

static bool show(void *user, const pal_fit_step *step)
{
    job *j = user;
    char text[128];
    snprintf(text, sizeof text, "annealing on %d ranks: best error %.4g %%, %lld evaluations", j->n_rank,
             step->best_percent < DBL_MAX ? step->best_percent : NAN, (long long)step->evaluation + 1);
    pal_report_progress(text, 0, &j->common);
    return true;
}

/* ---- one annealing run, on rank 0 ---- */

static pal_err fit(job *j, const char *problem, int seed, cJSON *results)
{
    pal_fit_result r;
    pal_diagnostic reason = {""};
    pal_fit_options o = {.budget_s = j->budget_s,
                         .max_evaluation = j->evaluations,
                         .seed = (uint64_t)seed,
                         .target_percent = j->target_percent,
                         .evaluate = evaluate,
                         .n_batch = j->n_batch,
                         .step = show,
                         .user = j};
    double *theta = malloc(sizeof *theta * (size_t)j->info.n_parameter);
    if (!theta) return pal_diagnostic_set(&j->diag, PAL_ERR_MEMORY, "%s: no memory", problem);
    memcpy(theta, j->info.start, sizeof *theta * (size_t)j->info.n_parameter);
    j->diag.text[0] = 0;
    pal_err err = pal_fit_anneal(j->c, &o, theta, &r, &reason);
    pal_report_progress(NULL, 0, &j->common);
    if (err) {
        if (!j->diag.text[0]) pal_diagnostic_set(&j->diag, err, "%s: %s", problem, reason.text);
    } else {
        cJSON *one = as_json(j, seed, theta, &r);
        err = write_result(j, problem, seed, one);
        print(j, problem, seed, &r);
        cJSON_AddItemToArray(results, one);
    }
    free(theta);
    return err;
}

/* one problem on all ranks; results: rank 0's */
static pal_err run_one(job *j, const char *problem, cJSON *results)
{
    pal_err err = agree(j, make(j, problem));
    if (!err) err = agree(j, same_everywhere(j, problem));
    if (!err)
        err = agree(j, j->journal ? pal_journal_begin(j->journal, j->fingerprint, j->info.n_parameter, &j->diag)
                                  : PAL_ERR_OK);
    if (!err && j->rank > 0) serve(j);
    if (!err && j->rank == 0) {
        for (int s = 0; s < j->n_seed && !err; s++) err = fit(j, problem, j->seed[s], results);
        end_ranks(j);
    }
    err = agree(j, err);
    unmake(j);
    return err;
}

static void add_refusal(cJSON *results, const char *problem, pal_err err, const pal_diagnostic *diag)
{
    cJSON *one = cJSON_CreateObject();
    cJSON_AddBoolToObject(one, "ok", false);
    cJSON_AddStringToObject(one, "problem", problem);
    cJSON *error = cJSON_AddObjectToObject(one, "error");
    cJSON_AddStringToObject(error, "code", pal_err_name(err));
    cJSON_AddStringToObject(error, "text", diag->text);
    cJSON_AddItemToArray(results, one);
}

/* depends on ranks and time */
static cJSON *add_run(const job *j, cJSON *object, double seconds)
{
    cJSON *run = cJSON_AddObjectToObject(object, "run");
    cJSON_AddNumberToObject(run, "ranks", j->n_rank);
    cJSON_AddNumberToObject(run, "workers", pal_team_size(j->team));
    cJSON_AddNumberToObject(run, "computed", (double)j->n_computed);
    cJSON_AddNumberToObject(run, "from_journal", (double)j->n_taken);
    cJSON_AddNumberToObject(run, "seconds", seconds);
    return object;
}

static pal_err prepare(job *j)
{
    if (pal_team_create(j->n_worker, &j->team))
        return pal_diagnostic_set(&j->diag, PAL_ERR_MEMORY, "no memory for workers");
    j->set = calloc(1, sizeof *j->set);
    if (!j->set) return pal_diagnostic_set(&j->diag, PAL_ERR_MEMORY, "no memory");
    if (j->rank > 0) return PAL_ERR_OK;
    if (j->folder) PAL_TRY(pal_scene_make_folder(j->folder, &j->diag));
    return j->journal_path ? pal_journal_open(j->journal_path, &j->journal, &j->diag) : PAL_ERR_OK;
}

static int run(job *j)
{
    double begin = pal_clock_s();
    int code = 0;
    cJSON *object = cJSON_CreateObject();
    cJSON_AddBoolToObject(object, "ok", true);
    cJSON *results = cJSON_AddArrayToObject(object, "results");
    pal_err err = agree(j, prepare(j));
    int mine = err ? 1 : pal_team_size(j->team), max_team;
    MPI_Allreduce(&mine, &max_team, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    j->n_batch = j->n_rank * max_team < PAL_ANNEAL_MAX_BATCH ? j->n_rank * max_team : PAL_ANNEAL_MAX_BATCH;
    for (int p = 0; p < j->n_problem && !err; p++) {
        pal_err one = run_one(j, j->problem[p], results);
        if (!one || j->rank > 0) continue;
        code = pal_report_code(one) > code ? pal_report_code(one) : code;
        if (j->n_problem == 1) {
            err = one;
            break;
        }
        add_refusal(results, j->problem[p], one, &j->diag);
        fprintf(stderr, "palpate-calibrate-mpi: %s\n", j->diag.text);
    }
    if (j->rank == 0) {
        if (err) code = pal_report_refusal(&j->common, err, &j->diag);
        if (!err && code) cJSON_ReplaceItemInObject(object, "ok", cJSON_CreateFalse());
        add_run(j, object, pal_clock_s() - begin);
        if (!err && !j->common.json && !j->common.quiet)
            printf("%d ranks of %d workers: %lld evaluations computed, %lld from the journal, %.1f s\n", j->n_rank,
                   pal_team_size(j->team), (long long)j->n_computed, (long long)j->n_taken, pal_clock_s() - begin);
        if (!err && j->common.json) {
            int bad = pal_report_json(&j->common, object);
            object = NULL;
            code = bad ? bad : code;
        }
    }
    cJSON_Delete(object);
    pal_journal_close(j->journal);
    pal_team_destroy(j->team);
    free(j->set);
    return code;
}

/* ---- flags ---- */

/* "1,2,3"; NULL: fine */
static const char *read_seeds(job *j)
{
    const char *at = j->seed_text ? j->seed_text : "0";
    for (; j->n_seed < MAX_SEED; at++) {
        char *end;
        errno = 0;
        long n = strtol(at, &end, 10);
        if (*at < '0' || *at > '9' || errno || n > INT_MAX) break;
        j->seed[j->n_seed++] = (int)n;
        at = end;
        if (!*at) return NULL;
        if (*at != ',') break;
    }
    return "--seed: is not a list of up to 64 whole numbers, as 1,2,3";
}

static const char *read_grid(job *j)
{
    int n = 0, *g = j->options.grid;
    if (!j->grid_text) return NULL;
    if (sscanf(j->grid_text, "%4dx%4dx%4d%n", &g[0], &g[1], &g[2], &n) == 3 && !j->grid_text[n] && g[0] > 0 &&
        g[1] > 0 && g[2] > 0)
        return NULL;
    return "--grid: is not NXxNYxNZ, three numbers of nodes from 1 to 1024, as 5x3x5";
}

static int parse(job *j, int argc, char **argv)
{
    const pal_flag flag[] = {
        {"--case", "ID[,ID...]", PAL_FLAG_TEXT, &j->input.fit, 0, 0, "load cases or references to fit"},
        {"--verify", "ID[,ID...]", PAL_FLAG_TEXT, &j->input.verify, 0, 0, "others, whose error is only reported"},
        {"--kinematics", "WORD", PAL_FLAG_TEXT, &j->input.kinematics, 0, 0,
         "finite or linear (a reference's, or finite)"},
        {"--grid", "NXxNYxNZ", PAL_FLAG_TEXT, &j->grid_text, 0, 0,
         "constants at the nodes of a grid (one of each kind for the whole body)"},
        {"--seed", "S[,S...]", PAL_FLAG_TEXT, &j->seed_text, 0, 0,
         "one run for each; the same seed gives the same result (0)"},
        {"--evaluations", "N", PAL_FLAG_COUNT, &j->evaluations, 1, 1e9, "limit of evaluations of a run (4000)"},
        {"--budget", "SECONDS", PAL_FLAG_NUMBER, &j->budget_s, 0.01, 1e7, "time limit of a run (no limit)"},
        {"--enough", "PERCENT", PAL_FLAG_NUMBER, &j->target_percent, 1e-9, 1e9, "end a run at this error"},
        {"--resolution", "N", PAL_FLAG_COUNT, &j->options.voxel.resolution, 2, 200,
         "voxels along the longest axis (the least even number that gives more than 700 nodes)"},
        {"--split", "K", PAL_FLAG_COUNT, &j->options.split, 1, 8,
         "the finite elements of the truth are K x K x K to a voxel (2)"},
        {"--workers", "N", PAL_FLAG_COUNT, &j->n_worker, 1, PAL_TEAM_MAX, "threads of a rank (1)"},
        {"--journal", "FILE", PAL_FLAG_TEXT, &j->journal_path, 0, 0, "file of evaluations, read and appended"},
        {"-o", "DIR", PAL_FLAG_TEXT, &j->folder, 0, 0, "write DIR/NAME.json for each problem"},
    };
    const pal_flag_table table = {.usage = "calibrate-mpi PROBLEM.json... --case ID --journal FILE",
                                  .about = about,
                                  .example =
                                      "mpirun --oversubscribe -n 2 palpate-calibrate-mpi deploy/problems/gear.json "
                                      "--case twist --resolution 8 --evaluations 40 --journal gear.txt -o fits\n",
                                  .flag = flag,
                                  .n_flag = sizeof flag / sizeof flag[0],
                                  .min_operand = 1,
                                  .max_operand = MAX_PROBLEM};
    pal_calibrate_default(&j->options);
    j->options.voxel.resolution = 0;
    j->n_worker = 1;
    int code = pal_flags_parse(&table, argc, argv, &j->common, j->problem, &j->n_problem);
    if (code >= 0) return code;
    const char *wrong = j->input.fit ? read_seeds(j) : "--case ID is missing";
    if (!wrong) wrong = read_grid(j);
    if (!wrong) return -1;
    return pal_flags_wrong(&j->common, "%s", wrong);
}

int main(int argc, char **argv)
{
    static job j;
    static char name[] = "calibrate-mpi";
    int level, code = -1;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &level);
    MPI_Comm_rank(MPI_COMM_WORLD, &j.rank);
    MPI_Comm_size(MPI_COMM_WORLD, &j.n_rank);
    argv[0] = name;
    /* rank 0 reports wrong flags for all */
    if (j.rank == 0) code = parse(&j, argc, argv);
    MPI_Bcast(&code, 1, MPI_INT, 0, MPI_COMM_WORLD);
    if (code < 0) {
        if (j.rank > 0) parse(&j, argc, argv);
        code = run(&j);
    }
    MPI_Finalize();
    return code;
}
