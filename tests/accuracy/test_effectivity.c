/* Effectivity of the live error estimate: what it says over what is true. In displacement Richardson's estimate over
 * the largest distance from ../shared/reference (CalculiX, quadratic elements, refined) or from a mesh of our own that
 * is three times as fine; in energy that of Zienkiewicz and Zhu over the error of the work of the loads, which
 * for elements that fit together and the linear law is the square of the error in energy, and for B-bar, whose stress
 * is not that of its displacement, over the distance of its stress from that of a finer mesh. The estimate is the one
 * of a running session (server/estimate/estimation.h). Where elements lock the estimate is too small, and says so;
 * where many voxels are cut (the gear) it is within a factor of 2 as well, from meshes of other sizes
 * (server/estimate/estimate_hierarchy.h), and the display says that they are. With PALPATE_LONG=1 finer beams, a finer
 * cube and a finer gear too. */
#include "server/estimate/estimation.h"
#include "server/mesh/files/mesh_file.h"
#include "server/num/shape_functions.h"
#include "server/scene/problem_file.h"
#include "server/solve/load_case.h"
#include "server/solve/sample_points.h"
#include "tests/check.h"

typedef struct row {
    const char *name; /* of a reference, or of a load case when finer > 0 */
    const char *law, *element;
    int resolution;
    double work_J;   /* the reference's (work_f_dot_u of its file); 0: not compared                           */
    int finer;       /* the truth is a mesh of our own, so many times as fine: of stress, and of displacement
                      * where there is no reference; 0: none */
    bool locks, cut; /* cut: many voxels are */
} row;

/* one problem, one of its cases and one material */
typedef struct subject {
    const pal_problem *problem;
    const pal_problem_case *load_case;
    const pal_surface *surface;
    const row *row;
    double young, poisson;
} subject;

typedef struct solved {
    pal_prepared mesh;
    pal_scene *scene;
    pal_world *world;
    pal_body *body;
    pal_locate *locate;
    double *load;
    double work_J;
} solved;

static void solved_free(solved *s)
{
    pal_locate_destroy(s->locate);
    pal_world_destroy(s->world);
    free(s->scene);
    free(s->load);
    pal_prepared_free(&s->mesh);
}

/* the scene that `palpate solve` makes of a problem */
static bool make_scene(const subject *s, solved *to, const char *solver)
{
    const pal_problem *p = s->problem;
    to->scene = calloc(1, sizeof *to->scene);
    if (!to->scene) return false;
    pal_scene_default(to->scene);
    pal_body_def *body = &to->scene->body[0];
    to->scene->n_tool = 0;
    to->scene->n_body = 1;
    pal_body_default(body, "body", &to->mesh);
    body->n_effect = 0;
    body->output.name[0] = 0;
    body->material = (pal_material){.young_Pa = isnan(s->young) ? p->material[0].young_Pa : s->young,
                                    .poisson = isnan(s->poisson) ? p->material[0].poisson : s->poisson,
                                    .density_kg_m3 = p->material[0].density_kg_m3};
    for (int k = 1; k < p->n_material; k++) {
        pal_region *region = &body->region[body->n_region++];
        *region = (pal_region){.kind = PAL_REGION_BOX,
                               .young_Pa = p->material[k].young_Pa,
                               .poisson = p->material[k].poisson,
                               .density_kg_m3 = p->material[k].density_kg_m3};
        for (int c = 0; c < 3; c++) {
            region->low_m[c] = p->material[k].region.low_m[c] - to->mesh.tets.origin_m[c];
            region->high_m[c] = p->material[k].region.high_m[c] - to->mesh.tets.origin_m[c];
        }
    }
    body->n_support = p->n_support;
    pal_entry_init(&body->solver, "solver", solver);
    pal_entry_init(&body->model, "model", "fem");
    return !pal_entry_put_text(&body->model, "element", s->row->element, NULL) &&
           !pal_entry_put_text(&body->model, "law", s->row->law, NULL) &&
           !pal_case_supports(p, &to->mesh.tets, body->support, NULL);
}

/* mesh, world and nodal loads; at rest without loads */
static bool prepare(const subject *s, int resolution, const char *solver, solved *to)
{
    pal_case_voxel_options requested = {.resolution = resolution, .fill = true, .align = true};
    pal_diagnostic diag = {""};
    memset(to, 0, sizeof *to);
    bool good = !pal_case_voxels(s->problem, s->surface, &requested, &to->mesh, &diag) && make_scene(s, to, solver) &&
                !pal_world_create(to->scene, &diag, &to->world);
    if (!good) printf("  %s\n", diag.text);
    if (!good) return false;
    to->body = pal_world_body(to->world, 0);
    to->body->load_cap_N = INFINITY;
    to->load = calloc(3 * (size_t)to->body->n_node, sizeof *to->load);
    bool hex = to->body->n_corner == 8;
    return to->load && !pal_locate_create(&to->mesh.tets, hex ? &to->mesh.hexes : NULL, &to->locate) &&
           !pal_case_forces(s->problem, s->load_case, -1, to->body, to->locate, &to->mesh.surface, to->load, NULL,
                            NULL);
}

static bool solve(const subject *s, int resolution, solved *to)
{
    pal_solve_report report = {.converged = false};
    if (!prepare(s, resolution, "static_newton", to)) return false;
    for (int i = 0; i < to->body->n_node; i++) (void)pal_world_load(to->world, 0, i, to->load + 3 * i);
    for (int k = 0; k < 20 && !report.converged; k++) {
        if (pal_world_step(to->world, 0.01)) return false;
        pal_world_solve_report(to->world, 0, &report);
    }
    for (int i = 0; i < 3 * to->body->n_node; i++) to->work_J += to->load[i] * (to->body->x[i] - to->body->x_rest[i]);
    return report.converged;
}

/* displacement at x, frame of the problem */
static void displacement(const solved *s, const double x[3], double u[3])
{
    double at[3], local[4], shape[10];
    const int32_t *node;
    for (int c = 0; c < 3; c++) at[c] = x[c] - s->mesh.tets.origin_m[c], u[c] = 0;
    int e = pal_locate_point(s->locate, at, local, NULL), n = pal_case_shape_functions(s->body, e, local, shape, &node);
    for (int k = 0; k < n; k++)
        for (int c = 0; c < 3; c++) u[c] += shape[k] * (s->body->x[3 * node[k] + c] - s->body->x_rest[3 * node[k] + c]);
}

static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
}

static double max_off_samples(const solved *s, const pal_samples *samples)
{
    double max = 0, u[3];
    for (int i = 0; i < samples->n; i++) {
        displacement(s, samples->x + 3 * i, u);
        max = fmax(max, distance(u, samples->u + 3 * i));
    }
    return max;
}

static double max_off_finer(const solved *s, const solved *finer)
{
    double max = 0;
    for (int i = 0; i < s->body->n_node; i++) {
        double x[3], own[3], true_u[3];
        for (int c = 0; c < 3; c++) x[c] = s->body->x_rest[3 * i + c] + s->mesh.tets.origin_m[c];
        displacement(s, x, own);
        displacement(finer, x, true_u);
        max = fmax(max, distance(own, true_u));
    }
    return max;
}

/* ---- distance of stress, hexahedra ---- */

typedef struct stress_truth {
    const solved *coarse, *fine;
    double (*coarse_stress)[8][9]; /* at Gauss points */
    int n;                         /* points seen     */
    double error2, solution2;
} stress_truth;

static void keep_stress(void *user, const pal_stress_point *p)
{
    stress_truth *t = user;
    memcpy(t->coarse_stress[p->element][t->n++ % 8], p->stress, sizeof p->stress);
}

static double complementary(const double s[9], double mu, double lambda)
{
    double trace = s[0] + s[4] + s[8], square = 0;
    for (int i = 0; i < 9; i++) square += (s[i] - (i % 4 ? 0 : trace / 3)) * (s[i] - (i % 4 ? 0 : trace / 3));
    return square / (2 * mu) + trace * trace / (9 * lambda + 6 * mu);
}

/* within a cube the stress of a trilinear field is trilinear, so it follows from the Gauss points */
static void compare_stress(void *user, const pal_stress_point *p)
{
    stress_truth *t = user;
    double x[3], local[4], weight[8], off[9];
    for (int c = 0; c < 3; c++) {
        x[c] = t->fine->mesh.tets.origin_m[c] - t->coarse->mesh.tets.origin_m[c];
        for (int k = 0; k < 8; k++) x[c] += p->shape[k] * t->fine->body->x_rest[3 * p->node[k] + c];
    }
    int e = pal_locate_point(t->coarse->locate, x, local, NULL);
    for (int c = 0; c < 3; c++) local[c] *= sqrt(3);
    pal_hex_shape(local, weight, NULL);
    memcpy(off, p->stress, sizeof off);
    for (int k = 0; k < 8; k++)
        for (int i = 0; i < 9; i++) off[i] -= weight[k] * t->coarse_stress[e][k][i];
    t->error2 += p->volume_m3 * complementary(off, p->mu_Pa, p->lambda_Pa);
    t->solution2 += p->volume_m3 * complementary(p->stress, p->mu_Pa, p->lambda_Pa);
}

static const pal_component *stress_row(const solved *s)
{
    int i = 0;
    while (!pal_world_component(s->world, i)->effect->inspect.stress) i++;
    return pal_world_component(s->world, i);
}

/* per cent */
static double stress_off(const solved *coarse, const solved *fine)
{
    stress_truth t = {.coarse = coarse, .fine = fine};
    const pal_component *a = stress_row(coarse), *b = stress_row(fine);
    t.coarse_stress = calloc((size_t)coarse->body->n_element, sizeof *t.coarse_stress);
    if (!t.coarse_stress) return NAN;
    a->effect->inspect.stress(a->self, coarse->body, keep_stress, &t);
    b->effect->inspect.stress(b->self, fine->body, compare_stress, &t);
    free(t.coarse_stress);
    return 100 * sqrt(t.error2 / t.solution2);
}

/* ---- rows ---- */

/* of the body where it rests under the loads */
static bool estimate(const subject *s, const solved *rest, pal_estimate *out)
{
    solved at;
    pal_estimation *work = NULL;
    pal_diagnostic diag = {""};
    bool good =
        prepare(s, s->row->resolution, "implicit_euler", &at) && !pal_estimation_open(at.scene, 0, NULL, &diag, &work);
    if (good) {
        pal_estimate_state *state = pal_estimation_state(work);
        good = pal_estimate_copy(state, at.world, 0);
        memcpy(state->x, rest->body->x, 3 * sizeof *state->x * (size_t)state->n_dof);
        memcpy(state->load, at.load, 3 * sizeof *at.load * (size_t)at.body->n_node);
        good = good && pal_estimation_run(work, out);
    }
    if (diag.text[0]) printf("  %s\n", diag.text);
    pal_estimation_close(work);
    solved_free(&at);
    return good;
}

/* what it says and what is true */
static void print_row(const row *r, const pal_estimate *e, double summary_m, double true_m, double true_percent)
{
    printf("  | %s, %s, %s, %d | %.3f | %.3f | %.2f |", r->name, r->element, r->law, r->resolution, 1e3 * true_m,
           1e3 * summary_m, summary_m / true_m);
    if (true_percent > 0)
        printf(" %.1f | %.1f | %.2f |", true_percent, e->energy_error_percent, e->energy_error_percent / true_percent);
    else
        printf(" | %.1f | |", e->energy_error_percent);
    printf("%s\n", e->locking ? " locks |" : " |");
}

static void compare(const subject *s, const pal_samples *samples)
{
    const row *r = s->row;
    pal_estimate e;
    solved own = {.world = NULL}, finer = {.world = NULL};
    bool good = solve(s, r->resolution, &own) && estimate(s, &own, &e);
    if (good && r->finer > 0) good = solve(s, r->finer * r->resolution, &finer);
    CHECK(good);
    if (good) {
        double true_m = samples ? max_off_samples(&own, samples) : max_off_finer(&own, &finer), percent = 0;
        if (r->work_J > 0) percent = 100 * sqrt(fabs(1 - own.work_J / r->work_J));
        if (r->finer > 0) percent = stress_off(&own, &finer);
        /* references are neo-Hookean where bodies bend far: what another law makes of it is part of the error */
        double summary_m = e.discretisation_m + (strcmp(r->law, "corotational") ? 0 : e.model_m);
        print_row(r, &e, summary_m, true_m, percent);
        CHECK(e.locking == r->locks && (strstr(e.diag, "voxels are cut") != NULL) == r->cut);
        CHECK(r->locks || (summary_m >= true_m / 2 && summary_m <= 2 * true_m));
        CHECK(percent == 0 || r->locks ||
              (e.energy_error_percent >= 0.5 * percent && e.energy_error_percent <= 2 * percent));
        CHECK(isfinite(e.time_m) && isfinite(e.algebraic_m) && e.error_m >= e.discretisation_m);
    }
    solved_free(&own);
    solved_free(&finer);
}

static void check_row(const pal_problem *p, const pal_surface *surface, const row *r)
{
    const pal_problem_reference *reference =
        r->finer > 0 && r->work_J == 0 ? NULL : pal_problem_reference_find(p, r->name);
    const char *name = reference ? reference->load_case : r->name;
    subject s = {p, pal_problem_case_find(p, name), surface, r, NAN, NAN};
    pal_samples samples = {0};
    REQUIRE(s.load_case);
    if (reference) {
        s.young = reference->young_Pa, s.poisson = reference->poisson;
        REQUIRE(!pal_samples_read(reference->file, &samples, NULL));
    }
    compare(&s, reference ? &samples : NULL);
    pal_samples_free(&samples);
}

static void check_rows(const char *file, const row *r, int n)
{
    pal_surface surface = {0};
    pal_problem *problem = NULL;
    pal_diagnostic diag = {""};
    check_count++; /* an absent reference is no failure */
    if (!file) return;
    pal_mesh_file_options options = {.unit_m = 1, .weld = PAL_MESH_WELD};
    pal_surface_report report;
    pal_err err = pal_problem_read(file, &problem, &diag);
    if (!err) err = pal_mesh_file_read(problem->surface, &options, &surface, &report, NULL, NULL, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    for (int i = 0; i < n && !err; i++) check_row(problem, &surface, &r[i]);
    pal_surface_free(&surface);
    free(problem);
}
#define CHECK_ROWS(file, rows) check_rows(file, rows, (int)(sizeof rows / sizeof rows[0]))

static void beam_nu_030(void)
{
    static const row rows[] = {
        {"linear_nu030", "linear", "hex8_bbar", 16, 0.00330122, 3, false, false},
        {"linear_nu030", "linear", "hex8", 16, 0.00330122, 0, false, false},
        {"linear_nu030", "linear", "tet4", 16, 0.00330122, 0, false, false},
        {"linear_nu030", "linear", "tet10", 8, 0.00330122, 0, false, false},
        {"nh_nu030", "neo_hookean", "hex8_bbar", 16, 0, 0, false, false},
    };
    CHECK_ROWS(check_shared("reference/beam/problem.json"), rows);
}

static void beam_nu_045(void)
{
    static const row rows[] = {
        {"linear_nu045", "linear", "hex8_bbar", 16, 0.00324425, 3, false, false},
        {"linear_nu045", "linear", "hex8", 16, 0.00324425, 0, false, false},
        {"linear_nu045", "linear", "tet4", 16, 0.00324425, 0, false, false},
        {"nh_nu045", "neo_hookean", "hex8_bbar", 16, 0, 0, false, false},
        {"nh_nu045", "corotational", "hex8_bbar", 16, 0, 0, false, false},
    };
    CHECK_ROWS(check_shared("reference/beam/problem.json"), rows);
}

static void cube_nu_0499(void)
{
    static const row rows[] = {
        {"linear", "linear", "hex8_bbar", 8, 0.0437455, 0, false, false},
        {"linear", "linear", "hex8", 8, 0.0437455, 0, true, false},
        {"linear", "linear", "tet4", 8, 0.0437455, 0, true, false},
    };
    CHECK_ROWS(check_shared("reference/cube/problem.json"), rows);
}

static void gear(void)
{
    static const row rows[] = {
        {"twist_linear", "linear", "hex8_bbar", 15, 0, 0, false, true},
        {"twist_linear", "linear", "hex8_bbar", 20, 0, 0, false, true},
    };
    CHECK_ROWS(check_shared("reference/gear/problem.json"), rows);
}

/* needs no reference */
static void own_beam(void)
{
    static const row rows[] = {{"tip", "linear", "hex8_bbar", 16, 0, 3, false, false}};
    CHECK_ROWS("deploy/problems/beam.json", rows);
}

static void own_bar(void)
{
    static const row rows[] = {
        {"bend", "linear", "hex8_bbar", 16, 0, 3, false, false},
        {"twist_pull", "linear", "hex8_bbar", 16, 0, 3, false, false},
    };
    CHECK_ROWS("deploy/problems/bar.json", rows);
}

/* ---- PALPATE_LONG=1 ---- */

static void finer_beams(void)
{
    static const row rows[] = {
        {"linear_nu030", "linear", "hex8_bbar", 32, 0, 0, false, false},
        {"linear_nu045", "linear", "hex8_bbar", 32, 0, 0, false, false},
    };
    static const row own[] = {{"tip", "linear", "hex8_bbar", 32, 0, 3, false, false}};
    CHECK_ROWS(check_shared("reference/beam/problem.json"), rows);
    CHECK_ROWS("deploy/problems/beam.json", own);
}

static void a_finer_cube(void)
{
    static const row rows[] = {{"linear", "linear", "hex8_bbar", 16, 0.0437455, 0, false, false}};
    CHECK_ROWS(check_shared("reference/cube/problem.json"), rows);
}

static void a_finer_gear(void)
{
    static const row rows[] = {{"twist_linear", "linear", "hex8_bbar", 30, 0, 0, false, true}};
    CHECK_ROWS(check_shared("reference/gear/problem.json"), rows);
}

int main(void)
{
    bool all = getenv("PALPATE_LONG") != NULL;
    printf("  | case | true mm | estimate mm | ratio | true energy %% | zz %% | ratio | |\n");
    RUN(beam_nu_030);
    RUN(beam_nu_045);
    RUN(cube_nu_0499);
    RUN_LONG(gear);
    RUN(own_beam);
    RUN(own_bar);
    if (all) RUN(finer_beams);
    if (all) RUN(a_finer_cube);
    if (all) RUN(a_finer_gear);
    return check_report();
}
