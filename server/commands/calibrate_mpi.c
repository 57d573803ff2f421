/* `palpate-calibrate-mpi`: calibration by annealing whose evaluations run on many processes (MPI ranks), for studies of
 * many organs, load cases and seeds. Rank 0 anneals; every rank makes the same calibration from the same files and
 * evaluates its share of each batch. The cost depends on theta alone and the annealing on the seed alone, so
 * the result is the same to the bit for any number of ranks and after an interruption: evaluations in the journal are
 * read instead of computed. */
#include "server/base/clock.h"
#include "server/base/hash.h"
#include "server/base/heap.h"
#include "server/base/team.h"
#include "server/calibrate/calibrate_cases.h"
#include "server/calibrate/journal.h"
#include "server/cli/report.h"
#include "server/mesh/files/file_bytes.h"
#include "server/num/anneal.h"
#include "server/scene/scene_file.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <mpi.h>
#include <stdio.h>
#include <time.h>

enum { MAX_PROBLEM = 256, MAX_SEED = 64, END = -1 };

static const char about[] =
    "Calibrates springs as `palpate calibrate --method annealing` does, with evaluations distributed over MPI\n"
    "ranks, for many problems and seeds one after another. Every evaluation is written to the journal; a run that\n"
    "is started again with the same journal reads them from there and ends with the same result. A problem that\n"
    "is refused is reported and the next one started. -o DIR: DIR/NAME.json with the constants of each\n"
    "(NAME_S.json with several seeds S).\n";

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
    double *theta, *cost; /* [batch][n_parameter], [batch], with room for equal shares of the ranks */
    int *missing;         /* points of the batch that are not in the journal [batch] */
    int64_t n_computed, n_taken;
    pal_diagnostic diag;
} job;

/* waits for a message without keeping a core busy that another rank may need */
static void wait_for(MPI_Request *request)
{
    int there = 0;
    MPI_Test(request, &there, MPI_STATUS_IGNORE);
    for (long us = 1; !there; us = us < 200 ? 2 * us : 200) {
        nanosleep(&(struct timespec){.tv_nsec = 1000 * us}, NULL);
        MPI_Test(request, &there, MPI_STATUS_IGNORE);
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

/* ---- journal: theta = error in per cent, or `none`: no stable equilibrium ---- */

static bool find_evaluation(const job *j, const double *theta, double *cost)
{
    char *key = j->journal ? pal_journal_text(theta, (size_t)j->info.n_parameter) : NULL;
    const char *value = key ? pal_journal_find(j->journal, key) : NULL;
    bool none = value && !strcmp(value, "none");
    free(key);
    if (none) *cost = DBL_MAX;
    return none || (value && pal_journal_numbers(value, cost, 1));
}

static pal_err store_evaluation(job *j, const double *theta, double cost)
{
    if (!j->journal) return PAL_ERR_OK;
    char *key = pal_journal_text(theta, (size_t)j->info.n_parameter);
    char *value = cost < DBL_MAX ? pal_journal_text(&cost, 1) : strdup("none");
    pal_err err = key && value ? pal_journal_put(j->journal, key, value, &j->diag)
                               : pal_diagnostic_set(&j->diag, PAL_ERR_MEMORY, "no memory for a line of the journal");
    free(key), free(value);
    return err;
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

/* Evaluates rank 0's m points, which stand at the front of its j->theta, in equal shares on all ranks; their errors
 * come into its j->cost. m is read on rank 0 only. False: it was END, no batch follows */
static bool evaluate_shares(job *j, int m)
{
    MPI_Request request;
    MPI_Ibcast(&m, 1, MPI_INT, 0, MPI_COMM_WORLD, &request);
    wait_for(&request);
    if (m == END) return false;
    int share = (m + j->n_rank - 1) / j->n_rank, left = m - j->rank * share, n = share * j->info.n_parameter;
    MPI_Scatter(j->theta, n, MPI_DOUBLE, j->rank ? j->theta : MPI_IN_PLACE, n, MPI_DOUBLE, 0, MPI_COMM_WORLD);
    pal_team_run(j->team, left < 0 ? 0 : left < share ? left : share, evaluate_one, j);
    MPI_Igather(j->rank ? j->cost : MPI_IN_PLACE, share, MPI_DOUBLE, j->cost, share, MPI_DOUBLE, 0, MPI_COMM_WORLD,
                &request);
    wait_for(&request);
    return true;
}

/* a batch of the walk, on rank 0: from the journal, else evaluated and written there */
static pal_err evaluate(void *user, const double *theta, int n, double *cost)
{
    job *j = user;
    size_t n_parameter = (size_t)j->info.n_parameter;
    int m = 0;
    bool no_memory = false;
    pal_err err = PAL_ERR_OK;
    for (int i = 0; i < n; i++) {
        const double *point = theta + (size_t)i * n_parameter;
        if (find_evaluation(j, point, &cost[i])) {
            j->n_taken++;
            continue;
        }
        memcpy(j->theta + (size_t)m * n_parameter, point, n_parameter * sizeof *point);
        j->missing[m++] = i;
    }
    if (m > 0) evaluate_shares(j, m);
    j->n_computed += m;
    for (int k = 0; k < m; k++) {
        int at = j->missing[k];
        cost[at] = j->cost[k];
        no_memory |= isnan(cost[at]);
        if (!err && !isnan(cost[at])) err = store_evaluation(j, theta + (size_t)at * n_parameter, cost[at]);
    }
    return no_memory && !err ? pal_diagnostic_set(&j->diag, PAL_ERR_MEMORY, "no memory to evaluate constants") : err;
}

/* ---- a problem ---- */

/* a hash of everything that an evaluation depends on, and of its result at the start */
static uint64_t fingerprint(const job *j, double start_percent)
{
    const pal_tets *t = &j->info.mesh->tets;
    size_t n = 3 * sizeof(double) * (size_t)t->n_node, n_theta = sizeof(double) * (size_t)j->info.n_parameter;
    uint64_t sum = pal_hash_bytes(PAL_HASH_START, PAL_VERSION, sizeof PAL_VERSION);
    const int facts[8] = {j->info.n_parameter, j->info.n_kind,          j->info.n_node,         j->info.n_tet,
                          j->options.equal,    j->options.without_area, j->options.grid[0] > 0, j->info.n_spring};
    sum = pal_hash_bytes(sum, facts, sizeof facts);
    sum = pal_hash_bytes(sum, t->x, n);
    sum = pal_hash_bytes(sum, t->tet, 4 * sizeof *t->tet * (size_t)t->n_tet);
    sum = pal_hash_bytes(sum, j->info.start, n_theta);
    sum = pal_hash_bytes(sum, j->info.low, n_theta);
    for (int k = 0; k < j->set->n; k++) {
        const pal_calibrate_case *one = &j->set->list[k];
        const int what[3] = {one->fit, one->linear, j->info.n_point[k]};
        if (!one->fit) continue;
        sum = pal_hash_bytes(sum, what, sizeof what);
        sum = pal_hash_bytes(sum, j->info.force_N[k], n);
        sum = pal_hash_bytes(sum, &j->info.max_m[k], sizeof(double));
        if (one->samples) sum = pal_hash_bytes(sum, one->samples->x, 3 * sizeof(double) * (size_t)one->samples->n);
        if (one->samples) sum = pal_hash_bytes(sum, one->samples->u, 3 * sizeof(double) * (size_t)one->samples->n);
    }
    return pal_hash_bytes(sum, &start_percent, sizeof start_percent);
}

static pal_err make(job *j, const char *problem)
{
    pal_calibration_value v;
    j->input.problem = problem;
    PAL_TRY(pal_calibrate_cases_read(&j->input, j->set, &j->diag));
    PAL_TRY(pal_calibrate_cases_make(j->set, &j->options, &j->c, &j->info, &j->diag));
    size_t batch = (size_t)(j->n_batch + j->n_rank);
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, j->theta, batch * (size_t)j->info.n_parameter);
    PAL_ARRAY(&err, j->cost, batch);
    PAL_ARRAY(&err, j->missing, batch);
    for (int w = 0; w < pal_team_size(j->team) && !err; w++)
        err = pal_calibration_workspace_create(j->c, &j->workspace[w]);
    if (err) return pal_diagnostic_set(&j->diag, PAL_ERR_MEMORY, "%s: no memory for its evaluations", problem);
    PAL_TRY(pal_calibration_evaluate(j->c, j->workspace[0], j->info.start, PAL_CALIBRATION_FIT, &v, NULL, &j->diag));
    j->fingerprint = fingerprint(j, v.error_percent);
    return PAL_ERR_OK;
}

static void unmake(job *j)
{
    for (int w = 0; w < PAL_TEAM_MAX; w++) pal_calibration_workspace_destroy(j->workspace[w]);
    memset(j->workspace, 0, sizeof j->workspace);
    pal_calibration_destroy(j->c);
    pal_calibrate_cases_free(j->set);
    PAL_FREE(j->theta, j->cost, j->missing);
    j->c = NULL, j->theta = j->cost = NULL, j->missing = NULL;
}

/* is the calibration the same on every rank? */
static pal_err same_everywhere(job *j, const char *problem)
{
    uint64_t root = j->fingerprint;
    MPI_Bcast(&root, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
    if (root == j->fingerprint) return PAL_ERR_OK;
    return PAL_REFUSE(&j->diag,
                      "%s: rank %d makes another calibration of it than rank 0: the files or the machines differ",
                      problem, j->rank);
}

/* ---- results ---- */

/* independent of ranks and time */
static cJSON *as_json(const job *j, int seed, const double *theta, const pal_fit_result *r)
{
    static const char *const name[PAL_SPRING_KINDS] = {"k_distance_J", "k_area_J", "k_volume_J"};
    cJSON *cases = cJSON_CreateArray(), *constants = cJSON_CreateObject(), *exact = cJSON_CreateArray();
    for (int k = 0; k < j->set->n; k++)
        cJSON_AddItemToArray(cases,
                             PAL_JSON({"id", JSON_TEXT(j->set->id[k])}, {"fitted", JSON_BOOL(j->set->list[k].fit)},
                                      {"percent", pal_json_or_null(r->value.case_percent[k])}));
    for (int k = 0; k < j->info.n_kind; k++) {
        cJSON *list = cJSON_AddArrayToObject(constants, name[j->info.kind[k]]);
        for (int i = 0; i < j->info.n_used; i++)
            cJSON_AddItemToArray(list, JSON_NUMBER(exp(theta[k * j->info.n_used + i])));
    }
    /* logarithms, exact to the bit */
    for (int i = 0; i < j->info.n_parameter; i++) {
        char text[40];
        snprintf(text, sizeof text, "%a", theta[i]);
        cJSON_AddItemToArray(exact, JSON_TEXT(text));
    }
    return PAL_JSON({"ok", JSON_BOOL(true)}, {"problem", JSON_TEXT(j->set->problem->name)}, {"seed", JSON_NUMBER(seed)},
                    {"cases", cases}, {"start_percent", pal_json_or_null(r->start_percent)},
                    {"error_percent", pal_json_or_null(r->value.error_percent)},
                    {"evaluations", JSON_NUMBER(r->n_evaluation)}, {"rejected", JSON_NUMBER(r->n_rejected)},
                    {"ended", JSON_TEXT(r->ended)}, {"nodes", JSON_NUMBER(j->info.n_node)},
                    {"used", JSON_NUMBER(j->info.n_used)}, {"constants", constants}, {"ln_constants", exact});
}

/* writes DIR/NAME.json whole or not at all */
static pal_err write_result(job *j, const char *problem, int seed, const cJSON *result)
{
    char path[1200], tail[32] = "";
    const char *name = strrchr(problem, '/') ? strrchr(problem, '/') + 1 : problem, *dot = strrchr(name, '.');
    if (!j->folder) return PAL_ERR_OK;
    if (j->n_seed > 1) snprintf(tail, sizeof tail, "_%d", seed);
    int n = snprintf(path, sizeof path, "%.900s/%.*s%s.json", j->folder, dot ? (int)(dot - name) : 200, name, tail);
    if (n < 0 || (size_t)n >= sizeof path) return PAL_REFUSE(&j->diag, "%.200s: too long", problem);
    char *text = result ? cJSON_Print(result) : NULL;
    if (!text) return pal_diagnostic_set(&j->diag, PAL_ERR_MEMORY, "%.200s: no memory for the result", path);
    pal_err err = pal_file_write(path, text, strlen(text), &j->diag);
    cJSON_free(text);
    return err;
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

/* one annealing run, on rank 0 */
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
        if (!j->common.json && !j->common.quiet)
            printf("%s, seed %d: error %.4g %% (start %.4g %%), %lld evaluations, %s\n", problem, seed,
                   r.value.error_percent, r.start_percent, (long long)r.n_evaluation, r.ended);
        fflush(stdout);
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
    if (!err) err = agree(j, j->journal ? pal_journal_begin(j->journal, j->fingerprint, &j->diag) : PAL_ERR_OK);
    bool serves = !err && j->rank > 0;
    while (serves && evaluate_shares(j, 0)) continue;
    if (!err && j->rank == 0) {
        for (int s = 0; s < j->n_seed && !err; s++) err = fit(j, problem, j->seed[s], results);
        evaluate_shares(j, END);
    }
    err = agree(j, err);
    unmake(j);
    return err;
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
    cJSON *results = cJSON_CreateArray();
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
        cJSON *error = PAL_JSON({"code", JSON_TEXT(pal_err_name(one))}, {"text", JSON_TEXT(j->diag.text)});
        cJSON_AddItemToArray(
            results, PAL_JSON({"ok", JSON_BOOL(false)}, {"problem", JSON_TEXT(j->problem[p])}, {"error", error}));
        fprintf(stderr, "palpate-calibrate-mpi: %s\n", j->diag.text);
    }
    double seconds = pal_clock_s() - begin;
    int n_worker = j->team ? pal_team_size(j->team) : 0;
    /* how the work was done: depends on ranks and time */
    cJSON *how = PAL_JSON({"ranks", JSON_NUMBER(j->n_rank)}, {"workers", JSON_NUMBER(n_worker)},
                          {"computed", JSON_NUMBER(j->n_computed)}, {"from_journal", JSON_NUMBER(j->n_taken)},
                          {"seconds", JSON_NUMBER(seconds)});
    cJSON *object = PAL_JSON({"ok", JSON_BOOL(code == 0)}, {"results", results}, {"run", how});
    if (j->rank == 0 && err) code = pal_report_refusal(&j->common, err, &j->diag);
    if (j->rank == 0 && !err && !j->common.json && !j->common.quiet)
        printf("%d ranks of %d workers: %lld evaluations computed, %lld from the journal, %.1f s\n", j->n_rank,
               n_worker, (long long)j->n_computed, (long long)j->n_taken, seconds);
    if (j->rank == 0 && !err && j->common.json) {
        int bad = pal_report_json(&j->common, object);
        object = NULL;
        code = bad ? bad : code;
    }
    cJSON_Delete(object);
    pal_journal_close(j->journal);
    pal_team_destroy(j->team);
    free(j->set);
    return code;
}

/* "1,2,3"; NULL: fine */
static const char *read_seeds(job *j)
{
    char word[16];
    const char *rest = j->seed_text ? j->seed_text : "0";
    const pal_flag seed = {.kind = PAL_FLAG_COUNT, .high = INT_MAX};
    while (pal_flag_next_word(&rest, word, sizeof word))
        if (j->n_seed == MAX_SEED || !word[0] || word[strspn(word, "0123456789")] ||
            pal_flag_read(&seed, word, "", &j->seed[j->n_seed++], NULL))
            return "--seed: is not a list of up to 64 whole numbers, as 1,2,3";
    return NULL;
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
                                  PAL_FLAGS(flag),
                                  .operands = {1, MAX_PROBLEM}};
    pal_calibrate_default(&j->options);
    j->options.voxel.resolution = 0;
    j->n_worker = 1;
    int code = pal_flags_parse(&table, argc, argv, &j->common, j->problem, &j->n_problem);
    if (code >= 0) return code;
    const char *wrong = j->input.fit ? read_seeds(j) : "--case ID is missing";
    if (!wrong && j->grid_text) wrong = pal_calibrate_grid(j->grid_text, j->options.grid);
    return wrong ? pal_flags_wrong(&j->common, "%s", wrong) : -1;
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
