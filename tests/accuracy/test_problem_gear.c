/* deploy/problems/gear.json is the gear of ../shared/reference/gear, drawn with triangles of its own: solved alike,
 * both surfaces move alike where the reference has its samples, and as far from the reference. */
#include "server/mesh/files/mesh_file.h"
#include "server/scene/problem_file.h"
#include "server/solve/solve.h"
#include "tests/check.h"

enum { RESOLUTION = 20 };

/* displacements [n][3] of the samples, NULL after saying why */
static double *solve(const char *path, const char *load_case, const pal_samples *samples, pal_solve_result *result)
{
    pal_problem *problem = NULL;
    pal_surface surface = {0};
    pal_surface_report report;
    pal_mesh_file_options file = {.unit_m = 1, .weld = PAL_MESH_WELD};
    pal_solve_options options = {.element = "hex8_bbar",
                                 .law = "linear",
                                 .voxel.resolution = RESOLUTION,
                                 .voxel.fill = true,
                                 .voxel.align = true,
                                 .young_Pa = NAN,
                                 .poisson = NAN};
    pal_solution *solution = NULL;
    pal_diagnostic diag = {""};
    double *u = malloc(3 * sizeof *u * (size_t)(samples->n > 0 ? samples->n : 1));
    pal_err err = u ? pal_problem_read(path, &problem, &diag) : PAL_ERR_MEMORY;
    if (!err) err = pal_mesh_file_read(problem->surface, &file, &surface, &report, NULL, NULL, &diag);
    if (!err)
        err =
            pal_solve(problem, pal_problem_case_find(problem, load_case), &surface, &options, &solution, result, &diag);
    for (int i = 0; i < samples->n && !err; i++) pal_solution_at(solution, samples->x + 3 * i, u + 3 * i);
    pal_solution_free(solution);
    pal_surface_free(&surface);
    free(problem);
    if (!err) return u;
    CHECK_FAIL("%s: %s", path, diag.text);
    free(u);
    return NULL;
}

static void own_gear_moves_as_the_gear_of_the_reference(void)
{
    const char *theirs = check_shared("reference/gear/problem.json");
    const char *csv = check_shared("reference/gear/u_twist_linear.csv");
    check_count++; /* an absent reference is no failure */
    if (!theirs || !csv) return;
    pal_samples samples = {0}, of_theirs;
    pal_diagnostic diag = {""};
    pal_solve_result result, their_result;
    REQUIRE(!pal_samples_read(csv, &samples, &diag));
    double *own = solve("deploy/problems/gear.json", "twist", &samples, &result);
    double *their = solve(theirs, "twist", &samples, &their_result);
    REQUIRE(own && their);
    double rms, max, own_rms, own_max;
    of_theirs = (pal_samples){samples.n, samples.x, their};
    pal_samples_error(&of_theirs, own, &rms, &max);
    pal_samples_error(&samples, own, &own_rms, &own_max);
    printf("  own surface against theirs: RMS %.4f %%, largest %.4f %%; against the reference: RMS %.3f %%\n", rms, max,
           own_rms);
    CHECK_LE(rms, 1);
    CHECK_LE(max, 1);
    CHECK_LE(own_rms, 2);
    CHECK_NEAR(result.volume_m3 / their_result.volume_m3, 1, 1e-3);
    for (int l = 0; l < 2; l++) CHECK_NEAR(result.area_m2[l], 0.048175005, 1e-6);
    free(own);
    free(their);
    pal_samples_free(&samples);
}

/* the load that is not fitted pushes the upper rim by 10 to 25 % of the gear's width, without the twist's direction */
static void push_moves_the_gear_across_the_twist(void)
{
    static double point[6] = {0.3, 0, 0.95, -0.3, 0, 0.95};
    pal_samples samples = {.n = 2, .x = point};
    pal_solve_result result;
    double *u = solve("deploy/problems/gear.json", "push", &samples, &result);
    REQUIRE(u);
    double share = result.max_m / (2 * cos(6 * M_PI / 180));
    CHECK(share > 0.1 && share < 0.25);
    for (int i = 0; i < 2; i++) {
        CHECK(u[3 * i] > 0.1);
        CHECK_LE(fabs(u[3 * i + 1]), 0.02 * u[3 * i]); /* symmetric about y = 0 but for the shifted voxels */
    }
    CHECK_NEAR(result.load_N[0], 222.4111, 1e-6);
    CHECK_NEAR(result.reaction_N[0], -222.4111, 1e-3);
    free(u);
}

int main(void)
{
    RUN(own_gear_moves_as_the_gear_of_the_reference);
    RUN(push_moves_the_gear_across_the_twist);
    return check_report();
}
