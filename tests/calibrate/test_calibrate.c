/* Calibration: slopes against differences, what a grid's weights are, constants found again that were known, what is
 * refused, and annealing that walks the same way on any number of cores. */
#include "server/calibrate/calibration.h"
#include "server/study/study_job.h"

#include "server/base/vec3.h"
#include "server/num/random.h"
#include "tests/check.h"
#include "tests/stability/hard_case.h"

#include <float.h>

enum { MAX_PARAMETERS = 256 };
static pal_diagnostic diag;

/* ---- a bar of 4 x 1 x 1 dm, its end at x = 3 held; and the same with a foot ---- */

static const double side_m = 0.1;

/* a prism of an n-gon in x, z, counter-clockwise seen from -y, cut into the given triangles, from y = 0 to side_m */
static bool make_prism(const double (*corner)[2], int n, const int (*tri)[3], pal_surface *out)
{
    int n_tri = 0;
    *out = (pal_surface){.n_vertex = 2 * n, .n_tri = 2 * (n - 2) + 2 * n};
    out->x = malloc(3 * sizeof(double) * (size_t)out->n_vertex);
    out->tri = malloc(3 * sizeof *out->tri * (size_t)out->n_tri);
    if (!out->x || !out->tri) return false;
    for (int i = 0; i < 2 * n; i++)
        pal_set3(out->x + 3 * i, 3 + corner[i % n][0], i < n ? 0 : side_m, corner[i % n][1]);
    for (int t = 0; t < n - 2; t++)
        for (int side = 0; side < 2; side++, n_tri++)
            for (int c = 0; c < 3; c++) out->tri[3 * n_tri + c] = tri[t][side ? 2 - c : c] + (side ? n : 0);
    for (int i = 0; i < n; i++, n_tri += 2) {
        int next = (i + 1) % n;
        const int32_t two[6] = {next, i, n + i, next, n + i, n + next};
        memcpy(out->tri + 3 * n_tri, two, sizeof two);
    }
    pal_surface_recentre(out);
    return true;
}

static bool make_bar(pal_surface *out)
{
    static const double corner[4][2] = {{0, 0}, {0.4, 0}, {0.4, 0.1}, {0, 0.1}};
    static const int tri[2][3] = {{0, 1, 2}, {0, 2, 3}};
    return make_prism(corner, 4, tri, out);
}

/* the bar with a leg of 3 dm at its free end */
static bool make_angle(pal_surface *out)
{
    static const double corner[6][2] = {{0, 0}, {0.4, 0}, {0.4, 0.4}, {0.3, 0.4}, {0.3, 0.1}, {0, 0.1}};
    static const int tri[4][3] = {{0, 4, 5}, {0, 1, 4}, {1, 2, 4}, {2, 3, 4}};
    return make_prism(corner, 6, tri, out);
}

static pal_box box_of(double x0, double x1)
{
    return (pal_box){.low_m = {x0, -1, -1}, .high_m = {x1, 1, 1}};
}

/* three loads on the free end: it is pulled, bent, and bent the other way */
static pal_problem bar_problem(void)
{
    static const double traction_Pa[3][3] = {{1500, 0, 0}, {0, 30, -80}, {-300, -60, 0}};
    pal_problem p = {.unit_m = 1, .n_material = 1, .n_support = 1, .n_case = 3};
    p.material[0] = (pal_problem_material){
        .id = "m", .region = {.all = true}, .young_Pa = 20000, .poisson = 0.4, .density_kg_m3 = 1000};
    p.support[0].region = box_of(2.9, 3.000001);
    for (int k = 0; k < 3; k++) {
        snprintf(p.load_case[k].id, PAL_NAME, "%s", (const char *const[]){"pull", "bend", "side"}[k]);
        p.load_case[k].n_load = 1;
        p.load_case[k].load[0] = (pal_problem_load){.kind = PAL_LOAD_TRACTION,
                                                    .region = box_of(3.399999, 3.5),
                                                    .has_normal = true,
                                                    .normal = {1, 0, 0},
                                                    .has_traction = true};
        pal_copy3(p.load_case[k].load[0].traction_Pa, traction_Pa[k]);
    }
    return p;
}

/* a calibration of the bar with what it borrows */
typedef struct bench {
    pal_problem problem;
    pal_surface surface;
    pal_calibrate_case cases[PAL_CALIBRATE_CASES];
    int n_case;
    pal_calibrate_options options;
    pal_calibration *c;
    pal_calibration_info info;
    pal_calibration_workspace *workspace;
    double theta[MAX_PARAMETERS];
} bench;

/* the first n_case loads, all fitted */
static void bench_begin(bench *b, int resolution, int n_case)
{
    memset(b, 0, sizeof *b);
    b->problem = bar_problem();
    b->n_case = n_case;
    for (int k = 0; k < n_case; k++)
        b->cases[k] = (pal_calibrate_case){.load_case = &b->problem.load_case[k], .fit = true};
    pal_calibrate_default(&b->options);
    b->options.voxel.resolution = resolution;
    b->options.split = 1;
}

static pal_err bench_create(bench *b)
{
    diag.text[0] = 0;
    if (!b->surface.x && !make_bar(&b->surface)) return PAL_ERR_MEMORY;
    return pal_calibration_create(&b->problem, &b->surface, b->cases, b->n_case, &b->options, &b->c, &diag);
}

static bool bench_make(bench *b)
{
    pal_err err = bench_create(b);
    if (err) printf("  %s\n", diag.text);
    if (err || pal_calibration_workspace_create(b->c, &b->workspace)) return false;
    pal_calibration_info_of(b->c, &b->info);
    if (b->info.n_parameter > MAX_PARAMETERS) return false;
    memcpy(b->theta, b->info.start, sizeof(double) * (size_t)b->info.n_parameter);
    return true;
}

static void bench_close(bench *b)
{
    pal_calibration_workspace_destroy(b->workspace);
    pal_calibration_destroy(b->c);
    pal_surface_free(&b->surface);
}

static pal_calibration_value value_at(bench *b, const double *theta, unsigned ask, double *slope)
{
    pal_calibration_value v;
    CHECK_INT(pal_calibration_evaluate(b->c, b->workspace, theta, ask, &v, slope, &diag), 0);
    return v;
}

/* displacements of case `index` of springs with constants `theta`, as samples at the nodes; the caller frees */
static bool samples_of(bench *b, const double *theta, int index, pal_samples *out)
{
    int n = b->info.n_node;
    pal_calibration_value v = value_at(b, theta, PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY, NULL);
    *out = (pal_samples){n, malloc(3 * sizeof(double) * (size_t)n), malloc(3 * sizeof(double) * (size_t)n)};
    if (!out->x || !out->u || !(v.case_percent[index] < DBL_MAX)) return false;
    for (int i = 0; i < n; i++) pal_add3(out->x + 3 * i, b->info.mesh->tets.x + 3 * i, b->info.mesh->tets.origin_m);
    return pal_calibration_displacement(b->c, b->workspace, index, out->u);
}

static double uniform(uint64_t key, uint64_t counter) /* in (-1, 1) */
{
    return 2 * pal_random_unit(key, counter) - 1;
}

/* ---- values and slopes ---- */

static void check_slope(bench *b)
{
    double slope[MAX_PARAMETERS], other[MAX_PARAMETERS], max = 0, worst = 0;
    int n = b->info.n_parameter, step_by = n > 24 ? n / 11 : 1;
    for (int i = 0; i < n; i++) b->theta[i] += 0.3 * uniform(3, (uint64_t)i);
    pal_calibration_value v = value_at(b, b->theta, PAL_CALIBRATION_FIT, slope);
    CHECK(v.objective < DBL_MAX);
    for (int i = 0; i < n; i++) max = fmax(max, fabs(slope[i]));
    for (int i = 0; i < n; i += step_by) {
        const double step = 2e-4, was = b->theta[i];
        b->theta[i] = was + step;
        double up = value_at(b, b->theta, PAL_CALIBRATION_FIT, NULL).objective;
        b->theta[i] = was - step;
        double down = value_at(b, b->theta, PAL_CALIBRATION_FIT, NULL).objective;
        b->theta[i] = was;
        worst = fmax(worst, fabs((up - down) / (2 * step) - slope[i]));
    }
    CHECK(max > 0.01);
    CHECK_LE(worst, 1e-5 * max);
    /* the same bits again, with a slope or without */
    CHECK_NEAR(value_at(b, b->theta, PAL_CALIBRATION_FIT, other).objective, v.objective, 0);
    CHECK_NEAR(value_at(b, b->theta, PAL_CALIBRATION_FIT, NULL).objective, v.objective, 0);
    CHECK(!memcmp(slope, other, sizeof(double) * (size_t)n));
}

static void the_slope_of_the_objective_is_that_of_differences(void)
{
    for (int turn = 0; turn < 8; turn++) {
        bool grid = turn & 1, linear = turn & 2, sampled = turn & 4;
        bench b, from;
        pal_samples s[2] = {{0}};
        bench_begin(&b, 4, 2);
        if (sampled) {
            bench_begin(&from, 4, 2);
            REQUIRE(bench_make(&from));
            for (int i = 0; i < from.info.n_parameter; i++) from.theta[i] += 0.5 - 0.3 * i;
            for (int k = 0; k < 2; k++) {
                REQUIRE(samples_of(&from, from.theta, k, &s[k]));
                /* inside tetrahedra, a few of them */
                s[k].n = 9;
                for (int i = 0; i < 27; i++) s[k].x[i] += 0.02 * side_m * uniform(6, (uint64_t)i);
            }
            bench_close(&from);
        }
        for (int k = 0; k < 2; k++) {
            b.cases[k].linear = linear;
            b.cases[k].samples = sampled ? &s[k] : NULL;
        }
        if (grid) memcpy(b.options.grid, (const int[3]){3, 2, 2}, sizeof b.options.grid);
        b.options.smooth = 0.7, b.options.pull = 0.4;
        REQUIRE(bench_make(&b));
        CHECK_INT(b.info.n_parameter, grid ? 36 : 3);
        check_slope(&b);
        for (int k = 0; k < 2; k++) pal_samples_free(&s[k]);
        bench_close(&b);
    }
}

/* the three sums of the header, by hand */
static void errors_are_averaged_and_regularisers_added_as_stated(void)
{
    bench b;
    bench_begin(&b, 4, 3);
    b.cases[2].fit = false;
    memcpy(b.options.grid, (const int[3]){3, 1, 1}, sizeof b.options.grid);
    b.options.smooth = 0.7, b.options.pull = 0.4;
    REQUIRE(bench_make(&b));
    REQUIRE(b.info.n_parameter == 9 && b.info.n_kind == 3);
    for (int i = 0; i < 9; i++) b.theta[i] += 0.2 * uniform(8, (uint64_t)i);
    pal_calibration_value v = value_at(&b, b.theta, PAL_CALIBRATION_FIT, NULL);
    CHECK_NEAR(v.error_percent, 0.5 * (v.case_percent[0] + v.case_percent[1]), 1e-12 * v.error_percent);
    CHECK(isnan(v.case_percent[2]));
    double smooth = 0, pull = 0;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++) {
            double d = i < 2 ? b.theta[3 * k + i] - b.theta[3 * k + i + 1] : 0;
            double ratio = b.theta[3 * k + i] - b.theta[i], start = b.info.start[3 * k + i] - b.info.start[i];
            smooth += d * d / 6;
            pull += (ratio - start) * (ratio - start) / 6;
        }
    CHECK_NEAR(v.smooth, smooth, 1e-12);
    CHECK_NEAR(v.pull, pull, 1e-12);
    double square = 0.5 * (pow(v.case_percent[0], 2) + pow(v.case_percent[1], 2));
    CHECK_NEAR(v.objective, log(square) + 0.7 * smooth + 0.4 * pull, 1e-5);
    /* e_L from the displacements themselves */
    double *u = malloc(6 * sizeof(double) * (size_t)b.info.n_node), *truth = u + 3 * b.info.n_node, sum = 0;
    REQUIRE(u && pal_calibration_displacement(b.c, b.workspace, 1, u) && pal_calibration_truth(b.c, 1, truth));
    for (int i = 0; i < 3 * b.info.n_node; i++) sum += (u[i] - truth[i]) * (u[i] - truth[i]);
    CHECK_NEAR(v.case_percent[1], 100 * sqrt(sum / b.info.n_node) / b.info.max_m[1], 1e-10 * v.case_percent[1]);
    free(u);
    /* the other case alone: no word about those that are fitted */
    pal_calibration_value w = value_at(&b, b.theta, PAL_CALIBRATION_VERIFY, NULL);
    CHECK(isnan(w.case_percent[0]) && isnan(w.case_percent[1]) && w.case_percent[2] > 0);
    CHECK_NEAR(w.error_percent, DBL_MAX, 0);
    pal_calibration_value all = value_at(&b, b.theta, PAL_CALIBRATION_FIT | PAL_CALIBRATION_VERIFY, NULL);
    CHECK_NEAR(all.case_percent[2], w.case_percent[2], 0);
    CHECK_NEAR(all.error_percent, v.error_percent, 0);
    bench_close(&b);
}

/* ---- grids ---- */

static void a_spring_takes_the_mean_of_its_corners_and_those_the_grid(void)
{
    bench b;
    bench_begin(&b, 8, 1);
    memcpy(b.options.grid, (const int[3]){5, 2, 2}, sizeof b.options.grid);
    b.cases[0].linear = true;
    REQUIRE(bench_make(&b));
    const pal_tets *t = &b.info.mesh->tets;
    const pal_grid_weights *w = b.info.weights;
    double *k_J = malloc(sizeof(double) * (size_t)t->n_node);
    REQUIRE(k_J && b.info.n_used == 20 && w->n_point == t->n_node);
    /* exp theta = a plane over the grid: a plane over the nodes */
    for (int k = 0; k < b.info.n_kind; k++)
        for (int i = 0; i < 20; i++) {
            const int at[3] = {(int)w->used[i] % 5, (int)w->used[i] / 5 % 2, (int)w->used[i] / 10};
            b.theta[20 * k + i] = log(0.01 * (k + 1) * (1 + 0.5 * at[0] + 0.25 * at[1] + 2 * at[2]));
        }
    for (int k = 0; k < b.info.n_kind; k++) {
        double worst = 0, low[3];
        pal_copy3(low, b.info.grid->low);
        pal_calibration_constants(b.c, b.theta, k, k_J);
        for (int i = 0; i < t->n_node; i++) {
            const double *x = t->x + 3 * i;
            double want = 1 + 5 * (x[0] - low[0]) + 2.5 * (x[1] - low[1]) + 20 * (x[2] - low[2]);
            worst = fmax(worst, fabs(k_J[i] / (0.01 * (k + 1) * want) - 1));
        }
        CHECK_LE(worst, 1e-12);
    }
    for (int i = 0; i < w->n_point; i++) {
        double sum = 0;
        for (int e = w->start[i]; e < w->start[i + 1]; e++) sum += w->weight[e];
        if (!(fabs(sum - 1) < 1e-12)) CHECK_FAIL("weights of node %d sum to %.15g", i, sum);
    }
    value_at(&b, b.theta, PAL_CALIBRATION_FIT, NULL);
    for (int k = 0; k < b.info.n_kind; k++) {
        const pal_springs *s = &b.c->lattice.kind[b.info.kind[k]];
        pal_calibration_constants(b.c, b.theta, k, k_J);
        double worst = 0;
        for (int i = 0; i < s->n_item; i++) {
            double mean = 0;
            for (int c = 0; c < s->n_corner; c++) mean += k_J[s->item[s->n_corner * i + c]] / s->n_corner;
            worst = fmax(worst, fabs(b.workspace->k[b.info.kind[k]][i] / mean - 1));
        }
        CHECK(s->n_item > 100);
        CHECK_LE(worst, 1e-12);
    }
    free(k_J);
    bench_close(&b);
}

static void grid_nodes_that_touch_nothing_are_no_parameters(void)
{
    bench b;
    bench_begin(&b, 8, 1);
    memcpy(b.options.grid, (const int[3]){5, 1, 5}, sizeof b.options.grid);
    b.cases[0].linear = true;
    REQUIRE(make_angle(&b.surface));
    REQUIRE(bench_make(&b));
    /* by hand: a node of the grid counts when a voxel's corner lies within a cell of it */
    const pal_tets *t = &b.info.mesh->tets;
    const pal_grid *g = b.info.grid;
    bool touched[25] = {false};
    int n_used = 0, n_edge = 0;
    for (int k = 0; k < 25; k++) {
        for (int i = 0; i < t->n_node; i++) {
            double x = 4 * (t->x[3 * i] - g->low[0]) / (g->high[0] - g->low[0]) - k % 5;
            double z = 4 * (t->x[3 * i + 2] - g->low[2]) / (g->high[2] - g->low[2]) - k / 5;
            touched[k] |= fabs(x) < 1 - 1e-9 && fabs(z) < 1 - 1e-9;
        }
        if (touched[k]) CHECK_INT(b.info.weights->used[n_used++], k);
        n_edge += (k % 5 > 0 && touched[k] && touched[k - 1]) + (k >= 5 && touched[k] && touched[k - 5]);
    }
    CHECK_INT(b.info.n_used, n_used);
    CHECK_INT(b.info.n_parameter, 3 * n_used);
    CHECK_INT(b.c->n_edge, n_edge);
    CHECK(n_used >= 16 && n_used < 20);
    bench_close(&b);
}

/* ---- against itself ---- */

static void constants_that_were_known_are_found_again(void)
{
    static const double moved[3] = {0.5, -0.4, 0.7};
    for (int turn = 0; turn < 2; turn++) {
        bench truth, b;
        pal_samples s[3] = {{0}};
        pal_fit_options o = {0};
        pal_fit_result r;
        bench_begin(&truth, 4, 3);
        truth.options.without_area = turn;
        REQUIRE(bench_make(&truth));
        for (int i = 0; i < truth.info.n_parameter; i++) truth.theta[i] += moved[i];
        for (int k = 0; k < 3; k++) REQUIRE(samples_of(&truth, truth.theta, k, &s[k]));
        bench_begin(&b, 4, 3);
        b.options.without_area = turn;
        b.options.smooth = b.options.pull = 0;
        for (int k = 0; k < 3; k++) b.cases[k].samples = &s[k];
        REQUIRE(bench_make(&b));
        CHECK_INT(b.info.n_parameter, turn ? 2 : 3);
        CHECK_INT(pal_fit_adjoint(b.c, &o, b.theta, &r, &diag), 0);
        CHECK(r.start_percent > 1);
        CHECK_LE(r.value.error_percent, 0.01);
        for (int i = 0; i < b.info.n_parameter; i++) CHECK_NEAR(b.theta[i], truth.theta[i], 0.01);
        printf("  %.3g %% -> %.3g %% in %lld evaluations, %s\n", r.start_percent, r.value.error_percent,
               (long long)r.n_evaluation, r.ended);
        for (int k = 0; k < 3; k++) pal_samples_free(&s[k]);
        bench_close(&b);
        bench_close(&truth);
    }
}

/* loads that ask for a twentieth of the volume stiffness get a tenth of it where that is the floor, else what they ask
 * for */
static void volume_stiffness_has_a_floor_where_one_is_asked_for(void)
{
    bench truth;
    pal_samples s[3] = {{0}};
    bench_begin(&truth, 4, 3);
    truth.options.without_area = true;
    REQUIRE(bench_make(&truth));
    CHECK_INT(truth.info.kind[1], PAL_SPRING_VOLUME);
    truth.theta[1] += log(0.05);
    for (int k = 0; k < 3; k++) REQUIRE(samples_of(&truth, truth.theta, k, &s[k]));
    for (int floor = 0; floor < 2; floor++) {
        bench b;
        pal_fit_options o = {0};
        pal_fit_result r;
        bench_begin(&b, 4, 3);
        b.options.without_area = true;
        b.options.smooth = b.options.pull = 0;
        b.options.min_volume_ratio = floor ? 0.1 : 0;
        for (int k = 0; k < 3; k++) b.cases[k].samples = &s[k];
        REQUIRE(bench_make(&b));
        CHECK_INT(pal_fit_adjoint(b.c, &o, b.theta, &r, &diag), 0);
        printf("  %s floor: edges %.3g, volumes %.3g of the start\n", floor ? "with a" : "without a",
               exp(b.theta[0] - b.info.start[0]), exp(b.theta[1] - b.info.start[1]));
        CHECK_NEAR(exp(b.theta[1] - b.info.start[1]), floor ? 0.1 : 0.05, floor ? 1e-6 : 1e-3);
        bench_close(&b);
    }
    for (int k = 0; k < 3; k++) pal_samples_free(&s[k]);
    bench_close(&truth);
}

/* a study's fit asks for that floor by itself, on loads of the same kind */
static void a_study_fits_springs_that_keep_a_tenth_of_their_volume_stiffness(void)
{
    bench truth;
    pal_samples s[3] = {{0}};
    const pal_study_options options = {.quick = true};
    pal_configuration configuration = {.size = 4};
    bench_begin(&truth, 4, 3);
    truth.options.without_area = true;
    REQUIRE(bench_make(&truth));
    truth.theta[1] += log(0.05);
    for (int k = 0; k < 3; k++) REQUIRE(samples_of(&truth, truth.theta, k, &s[k]));
    pal_prepared mesh = {.surface = truth.surface};
    pal_scene *scene = calloc(1, sizeof *scene);
    pal_study_job *job = calloc(1, sizeof *job);
    REQUIRE(scene && job);
    scene->body[0].mesh = &mesh;
    *job = (pal_study_job){.scene = scene, .problem = &truth.problem, .options = &options, .n_load = 4, .diag = &diag};
    job->n_probe = s[0].n, job->probe = s[0].x;
    for (int i = 0; i < s[0].n; i++)
        for (int c = 0; c < 3; c++) job->probe[3 * i + c] -= mesh.surface.origin_m[c];
    /* the last one is not fitted to */
    for (int k = 0; k < 4; k++) job->load[k] = &truth.problem.load_case[k % 3], job->static_u[k] = s[k % 3].u;
    CHECK_INT(pal_study_fit(job, &configuration, &diag), 0);
    const double start[2] = {exp(truth.info.start[0]), exp(truth.info.start[1])};
    printf("  edges %.3g, volumes %.3g of the material's\n", configuration.k_distance_J / start[0],
           configuration.k_volume_J / start[1]);
    CHECK_NEAR(configuration.k_volume_J / start[1], 0.1, 1e-6);
    CHECK_NEAR(configuration.k_distance_J / start[0], 1, 0.5);
    for (int k = 0; k < 3; k++) pal_samples_free(&s[k]);
    bench_close(&truth);
    free(scene), free(job);
}

/* ---- annealing ---- */

/* the walk as its caller sees it */
typedef struct trail {
    uint64_t sum;
    int64_t n, n_better, stop_at;
    double best;
} trail;

static bool follow(void *user, const pal_fit_step *step)
{
    trail *t = user;
    uint64_t bits[4];
    memcpy(bits, &step->error_percent, 8);
    memcpy(bits + 1, step->theta, 24);
    for (int i = 0; i < 4; i++) t->sum = pal_random_bits(t->sum, bits[i]);
    CHECK_INT(step->evaluation, t->n);
    t->n++;
    t->n_better += step->improved;
    CHECK(t->n == 1 || step->best_percent <= t->best);
    t->best = step->best_percent;
    return t->n != t->stop_at;
}

static void annealing_walks_the_same_way_for_any_team(void)
{
    bench b;
    trail t[4] = {{0}};
    double theta[4][3];
    pal_fit_result r[4];
    bench_begin(&b, 4, 1);
    b.cases[0].linear = true;
    REQUIRE(bench_make(&b));
    for (int k = 0; k < 4; k++) {
        pal_fit_options o = {
            .seed = k < 3 ? 5 : 6, .n_worker = k % 3 + 1, .max_evaluation = 400, .step = follow, .user = &t[k]};
        memcpy(theta[k], b.info.start, sizeof theta[k]);
        CHECK_INT(pal_fit_anneal(b.c, &o, theta[k], &r[k], &diag), 0);
        CHECK_TEXT(r[k].ended, "evaluations");
        CHECK_INT(r[k].n_evaluation, 400);
        CHECK_INT(t[k].n, 400);
        CHECK(r[k].n_spent >= 400);
        CHECK(t[k].n_better > 1);
        CHECK_NEAR(r[k].value.error_percent, t[k].best, 0);
        CHECK_LE(r[k].value.error_percent, 0.9 * r[k].start_percent);
    }
    CHECK_INT(r[0].n_spent, 400); /* one worker evaluates nothing in vain */
    for (int k = 1; k < 3; k++) {
        CHECK(!memcmp(theta[0], theta[k], sizeof theta[0]));
        CHECK(t[0].sum == t[k].sum);
        CHECK_INT(r[0].n_rejected, r[k].n_rejected);
    }
    CHECK(t[0].sum != t[3].sum);
    /* as good as the gradient's answer, nearly */
    pal_fit_options o = {0};
    pal_fit_result a;
    CHECK_INT(pal_fit_adjoint(b.c, &o, b.theta, &a, &diag), 0);
    CHECK_LE(r[0].value.error_percent, 1.2 * a.value.error_percent);
    printf("  %.4f %% at the start, %.4f %% by annealing, %.4f %% by adjoint\n", a.start_percent,
           r[0].value.error_percent, a.value.error_percent);
    bench_close(&b);
}

static void annealing_ends_as_it_is_told(void)
{
    bench b;
    bench_begin(&b, 4, 1);
    b.cases[0].linear = true;
    REQUIRE(bench_make(&b));
    double start = value_at(&b, b.theta, PAL_CALIBRATION_FIT, NULL).error_percent;
    for (int turn = 0; turn < 4; turn++) {
        static const char *const ended[4] = {"enough", "stopped", "evaluations", "budget"};
        trail t = {.stop_at = turn == 1 ? 7 : 0};
        pal_fit_options o = {.n_worker = 1 + turn % 2, .max_evaluation = 2000, .seed = 3, .step = follow, .user = &t};
        pal_fit_result r;
        double theta[3];
        if (turn == 0) o.target_percent = 0.9 * start;
        if (turn == 2) o.max_evaluation = 1;
        if (turn == 3) o.budget_s = 1e-9;
        memcpy(theta, b.info.start, sizeof theta);
        CHECK_INT(pal_fit_anneal(b.c, &o, theta, &r, &diag), 0);
        CHECK_TEXT(r.ended, ended[turn]);
        CHECK_NEAR(r.start_percent, start, 0);
        HARD_CASE("calibration", "tet_springs", "error over that of the start, however it ends",
                  r.value.error_percent / start, 1, "");
        CHECK_INT(r.n_evaluation, t.n);
        if (turn == 0) CHECK(r.n_evaluation > 1 && r.value.error_percent <= 0.9 * start);
        if (turn == 1) CHECK_INT(r.n_evaluation, 7);
        if (turn >= 2) CHECK_INT(r.n_evaluation, 1); /* the first batch is the start alone */
        if (turn >= 2) CHECK(!memcmp(theta, b.info.start, sizeof theta));
    }
    bench_close(&b);
}

/* *user everywhere */
static pal_err flat(void *user, const double *theta, int n, double *cost)
{
    (void)theta;
    for (int i = 0; i < n; i++) cost[i] = *(double *)user;
    return n > 6 ? PAL_ERR_INTERNAL : PAL_ERR_OK;
}

/* an evaluation that fails at the *user-th batch */
static pal_err broken(void *user, const double *theta, int n, double *cost)
{
    (void)theta;
    for (int i = 0; i < n; i++) cost[i] = 3;
    return --*(int *)user > 0 ? PAL_ERR_OK : PAL_ERR_IO;
}

static void points_may_be_evaluated_elsewhere(void)
{
    bench b;
    pal_fit_result r;
    double cost = 1, theta[3];
    int left = 4;
    bench_begin(&b, 4, 1);
    REQUIRE(bench_make(&b));
    memcpy(theta, b.info.start, sizeof theta);
    pal_fit_options o = {.evaluate = flat, .n_batch = 6, .user = &cost};
    CHECK_INT(pal_fit_anneal(b.c, &o, theta, &r, &diag), 0);
    CHECK_TEXT(r.ended, "stalled"); /* start, 100 samples, 1500 without a better one */
    CHECK_INT(r.n_evaluation, 1601);
    CHECK(!memcmp(theta, b.info.start, sizeof theta));
    CHECK_NEAR(r.start_percent, 1, 0);
    CHECK_NEAR(r.value.error_percent, value_at(&b, theta, PAL_CALIBRATION_FIT, NULL).error_percent, 0);
    cost = DBL_MAX;
    CHECK_INT(pal_fit_anneal(b.c, &o, theta, &r, &diag), PAL_ERR_NUMERIC);
    CHECK(strstr(diag.text, "none of 1500 sets of constants comes to a stable rest"));
    CHECK_INT(r.n_rejected, r.n_evaluation);
    o.evaluate = broken, o.user = &left;
    CHECK_INT(pal_fit_anneal(b.c, &o, theta, &r, &diag), PAL_ERR_IO);
    bench_close(&b);
}

static void constants_without_a_rest_are_passed_over(void)
{
    bench b;
    pal_fit_result r;
    pal_fit_options o = {.n_worker = 2, .max_evaluation = 160, .seed = 1};
    double slope[3] = {1, 1, 1};
    bench_begin(&b, 4, 2);
    REQUIRE(bench_make(&b));
    for (int i = 0; i < 3; i++) b.theta[i] = b.info.low[i];
    pal_calibration_value v = value_at(&b, b.theta, PAL_CALIBRATION_FIT, slope);
    CHECK_NEAR(v.error_percent, DBL_MAX, 0);
    for (int i = 0; i < 2; i++) CHECK_NEAR(v.case_percent[i], DBL_MAX, 0);
    CHECK_NEAR(v.objective, DBL_MAX, 0);
    for (int i = 0; i < 3; i++) CHECK_NEAR(slope[i], 0, 0);
    CHECK(!pal_calibration_displacement(b.c, b.workspace, 0, NULL));
    /* there is no slope to follow from here, but samples to take */
    CHECK_INT(pal_fit_adjoint(b.c, &o, b.theta, &r, &diag), PAL_ERR_NUMERIC);
    CHECK(strstr(diag.text, "the start has no stable rest"));
    for (int i = 0; i < 3; i++) b.theta[i] = b.info.low[i];
    CHECK_INT(pal_fit_anneal(b.c, &o, b.theta, &r, &diag), 0);
    CHECK_NEAR(r.start_percent, DBL_MAX, 0);
    CHECK(r.n_rejected > 10 && r.n_rejected < 150);
    HARD_CASE("calibration", "tet_springs",
              "from a start without rest, candidates without rest on the way: error found", r.value.error_percent, 50,
              "%");
    HARD_CASE("calibration", "tet_springs", "evaluations", r.n_evaluation, o.max_evaluation, "");
    /* what is no constant at all */
    b.theta[1] = NAN;
    CHECK_INT(pal_calibration_evaluate(b.c, b.workspace, b.theta, PAL_CALIBRATION_FIT, &v, slope, &diag),
              PAL_ERR_NUMERIC);
    CHECK(strstr(diag.text, "parameter 1 is nan"));
    CHECK_NEAR(v.error_percent, DBL_MAX, 0);
    bench_close(&b);
}

/* ---- refusals ---- */

static bool stop(const char *what, double fraction, void *user)
{
    (void)what, (void)fraction, (void)user;
    return false;
}

static void problems_that_cannot_be_calibrated_are_refused_in_a_sentence(void)
{
    static const struct {
        const char *sentence;
        pal_err err;
    } want[] = {
        {"no load case to fit", PAL_ERR_REFUSED},
        {"9 load cases: at most 8 are taken", PAL_ERR_REFUSED},
        {"load case \"pull\": has no load, so there is nothing to fit", PAL_ERR_REFUSED},
        {"load case \"pull\": has no load, so there is nothing to fit", PAL_ERR_REFUSED},
        {"supports: none, so nothing holds the body", PAL_ERR_REFUSED},
        {"load_cases[0].loads[0]: 100 % of it stands on nodes that a support holds", PAL_ERR_REFUSED},
        {"supports[0]: no node of the body lies in", PAL_ERR_REFUSED},
        {"body \"body\": all of its", PAL_ERR_REFUSED},
        {"grid: 1025 nodes along axis 1, wanted 1 to 1024", PAL_ERR_REFUSED},
        {"grid: 0 nodes along axis 2, wanted 1 to 1024", PAL_ERR_REFUSED},
        {"grid: 1024 x 1024 x 1024 nodes are more than 65536 parameters", PAL_ERR_REFUSED},
        {"its truth (zero) moves nothing", PAL_ERR_REFUSED},
        {"stopped", PAL_ERR_STATE},
    };
    double x[3] = {3.2, 0.05, 0.05}, u[3] = {0};
    pal_samples zero = {1, x, u};
    for (size_t k = 0; k < sizeof want / sizeof want[0]; k++) {
        bench b;
        bench_begin(&b, 4, 1);
        pal_problem_load *l = &b.problem.load_case[0].load[0];
        if (k == 0) b.cases[0].fit = false;
        if (k == 1) b.n_case = 9;
        if (k == 2) b.problem.load_case[0].n_load = 0;
        if (k == 3) pal_set3(l->traction_Pa, 0, 0, 0);
        if (k == 4) b.problem.n_support = 0;
        if (k == 5) l->region = box_of(2.9, 3.0001), l->normal[0] = -1;
        if (k == 6) b.problem.support[0].region = box_of(5, 6);
        if (k == 7) b.problem.support[0].region = box_of(2, 6);
        if (k == 8) memcpy(b.options.grid, (const int[3]){3, 1025, 3}, sizeof b.options.grid);
        if (k == 9) memcpy(b.options.grid, (const int[3]){3, 3, 0}, sizeof b.options.grid);
        if (k == 10) memcpy(b.options.grid, (const int[3]){1024, 1024, 1024}, sizeof b.options.grid);
        if (k == 11) b.cases[0].samples = &zero, b.cases[0].truth_name = "zero";
        if (k == 12) b.options.progress = stop;
        CHECK_INT(bench_create(&b), want[k].err);
        CHECK(b.c == NULL);
        if (!strstr(diag.text, want[k].sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, want[k].sentence);
        bench_close(&b);
    }
}

int main(void)
{
    RUN(the_slope_of_the_objective_is_that_of_differences);
    RUN(errors_are_averaged_and_regularisers_added_as_stated);
    RUN(a_spring_takes_the_mean_of_its_corners_and_those_the_grid);
    RUN(grid_nodes_that_touch_nothing_are_no_parameters);
    RUN(constants_that_were_known_are_found_again);
    RUN(volume_stiffness_has_a_floor_where_one_is_asked_for);
    RUN(a_study_fits_springs_that_keep_a_tenth_of_their_volume_stiffness);
    RUN(annealing_walks_the_same_way_for_any_team);
    RUN(annealing_ends_as_it_is_told);
    RUN(points_may_be_evaluated_elsewhere);
    RUN(constants_without_a_rest_are_passed_over);
    RUN(problems_that_cannot_be_calibrated_are_refused_in_a_sentence);
    return check_report();
}
