/* The scene that palpate calibrate writes, read again as serve reads it, comes to rest where the search said: file,
 * mesh, supports, weights and constants are those that were fitted. */
#include "server/calibrate/calibrate_cases.h"
#include "server/calibrate/settle.h"
#include "server/commands/commands.h"
#include "server/scene/scene_file.h"
#include "tests/check.h"

static const char problem[] = "deploy/problems/bar.json";
enum { RESOLUTION = 8, SPLIT = 1, EVALUATIONS = 12 };

static char folder[] = "/tmp/palpate_calibrate_XXXXXX", scene_path[80], mesh_path[80];

/* the command with these flags, NULL-terminated */
static int run_command(const char *grid, const char *weights, const char *area)
{
    char *argv[] = {(char *)"calibrate",
                    (char *)problem,
                    (char *)"--case",
                    (char *)"bend",
                    (char *)"--resolution",
                    (char *)"8",
                    (char *)"--split",
                    (char *)"1",
                    (char *)"--weights",
                    (char *)weights,
                    (char *)"--area-springs",
                    (char *)area,
                    (char *)"--evaluations",
                    (char *)"12",
                    (char *)"--quiet",
                    (char *)"-o",
                    scene_path,
                    (char *)"--grid",
                    (char *)grid};
    int argc = (int)(sizeof argv / sizeof argv[0]) - (grid ? 0 : 2);
    return command_calibrate(argc, argv);
}

/* the same search by hand, and how far the written scene's rest is from its rest, per cent */
static double difference(const int grid[3], bool equal, bool without_area, pal_settle_report *report)
{
    pal_calibrate_options o;
    static pal_calibrate_cases set;
    pal_calibration *c = NULL;
    pal_calibration_info info;
    pal_calibration_workspace *workspace = NULL;
    pal_calibration_value v;
    pal_fit_result r;
    pal_loaded_scene *scene = NULL;
    pal_settle_options how;
    pal_diagnostic diag = {""};
    double out = NAN;
    pal_calibrate_default(&o);
    o.voxel.resolution = RESOLUTION, o.split = SPLIT, o.equal = equal, o.without_area = without_area;
    for (int a = 0; a < 3; a++) o.grid[a] = grid[a];
    const pal_calibrate_input input = {.problem = problem, .fit = "bend"};
    const pal_fit_options fit = {.max_evaluation = EVALUATIONS};
    pal_err err = pal_calibrate_cases_read(&input, &set, &diag);
    if (!err) err = pal_calibration_create(set.problem, &set.surface, set.list, set.n, &o, &c, &diag);
    if (!err) pal_calibration_info_of(c, &info);
    double *theta = err ? NULL : malloc(sizeof *theta * (size_t)info.n_parameter);
    double *u = err ? NULL : malloc(3 * sizeof *u * (size_t)info.n_node);
    for (int i = 0; !err && i < info.n_parameter; i++) theta[i] = info.start[i];
    if (!err) err = pal_calibration_workspace_create(c, &workspace);
    if (!err) err = pal_fit_adjoint(c, &fit, theta, &r, &diag);
    if (!err) err = pal_calibration_evaluate(c, workspace, theta, PAL_CALIBRATION_FIT, &v, NULL, &diag);
    if (!err && !pal_calibration_displacement(c, workspace, 0, u)) err = PAL_ERR_NUMERIC;
    if (!err) err = pal_scene_load(scene_path, &scene, &diag);
    if (!err) {
        const pal_settle_load load = {.force_N = info.force_N[0], .u = u};
        pal_settle_default(&how);
        err = pal_settle_damping(&scene->scene, &load, 1, &how, report, &diag);
        out = report->load[0].difference_percent;
        CHECK(scene->scene.body[0].material.damping_1_s == report->damping_1_s);
        CHECK(strstr(scene->scene.accuracy, "RMS of finite elements (bend)") != NULL);
    }
    CHECK_TEXT(diag.text, "");
    CHECK_INT(err, PAL_ERR_OK);
    pal_scene_free(scene);
    pal_calibration_workspace_destroy(workspace);
    pal_calibration_destroy(c);
    pal_calibrate_cases_free(&set);
    free(theta);
    free(u);
    return out;
}

static void constants_of_the_whole_body_run_as_they_were_fitted(void)
{
    pal_settle_report report = {0};
    REQUIRE(run_command(NULL, "volume", "on") == 0);
    CHECK_LE(difference((const int[3]){0}, false, false, &report), 0.1);
    CHECK(report.steady);
}

static void constants_on_a_grid_run_as_they_were_fitted(void)
{
    pal_settle_report report = {0};
    REQUIRE(run_command("5x2x2", "volume", "off") == 0);
    CHECK_LE(difference((const int[3]){5, 2, 2}, false, true, &report), 0.1);
    CHECK(report.steady);
}

static void equal_springs_run_as_they_were_fitted(void)
{
    pal_settle_report report = {0};
    REQUIRE(run_command("3x2x1", "equal", "on") == 0);
    CHECK_LE(difference((const int[3]){3, 2, 1}, true, false, &report), 0.1);
    CHECK(report.steady);
}

int main(void)
{
    if (!mkdtemp(folder)) return 1;
    snprintf(scene_path, sizeof scene_path, "%s/s.json", folder);
    snprintf(mesh_path, sizeof mesh_path, "%s/s.palmesh", folder);
    RUN(constants_of_the_whole_body_run_as_they_were_fitted);
    RUN(constants_on_a_grid_run_as_they_were_fitted);
    RUN(equal_springs_run_as_they_were_fitted);
    unlink(scene_path);
    unlink(mesh_path);
    rmdir(folder);
    return check_report();
}
