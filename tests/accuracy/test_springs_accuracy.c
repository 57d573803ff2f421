/* What paper B's springs with constants derived from E and nu (spring_law.h) give against analytic bars and the
 * CalculiX cantilever of ../shared/reference/beam. Static answers are the rest states of damped motion. */
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/boxes.h"

static bool without_area; /* tests run with and without the row face_area */

/* a box held by a box of space, weightless unless gravity, small loads so that the answer is linear */
static bool bench_open(box_bench *b, const int n[3], double edge_m, double young_Pa, double poisson, double rate_1_s,
                       int axis)
{
    if (!box_bench_make(b, n, edge_m, true, true)) return false;
    b->scene->gravity_m_s2 = 0.01;
    pal_body_def *def = &b->scene->body[0];
    def->material =
        (pal_material){.young_Pa = young_Pa, .poisson = poisson, .density_kg_m3 = 1000, .damping_1_s = rate_1_s};
    def->output.name[0] = 0;
    if (without_area) pal_entry_put_number(&def->model, "k_area_J", 0, NULL);
    def->support[0] = (pal_support_def){.low_m = {-1, -1, -1}, .high_m = {1, 1, 1}};
    def->support[0].high_m[axis] = 1e-9;
    for (int c = 0; c < 3; c++) b->scene->up[c] = c == axis;
    return box_bench_start(b);
}

/* mean displacement along z of the nodes of layer k */
static double layer_z(const box_bench *b, const int n[3], int k)
{
    double sum = 0;
    for (int j = 0; j <= n[1]; j++)
        for (int i = 0; i <= n[0]; i++) {
            int node = 3 * box_node(n, i, j, k) + 2;
            sum += b->body->x[node] - b->body->x_rest[node];
        }
    return sum / ((n[0] + 1) * (n[1] + 1));
}

/* bar under its own weight, n voxels wide: effective E and nu of its middle half against what was asked for */
static void bar(int wide, double poisson, double *young_ratio, double *poisson_found)
{
    const int n[3] = {wide, wide, 6 * wide};
    const double young = 5000, length = 0.12, h = length / n[2];
    box_bench b;
    *young_ratio = *poisson_found = NAN;
    if (!bench_open(&b, n, h, young, poisson, 30, 2)) return;
    for (int i = 0; i < 150; i++)
        if (pal_world_step(b.world, b.scene->step_s)) break;
    int k1 = n[2] / 4, k2 = 3 * n[2] / 4, k = n[2] / 2;
    double z1 = h * k1, z2 = h * k2, load = 1000 * b.scene->gravity_m_s2;
    double exact = -load / young * (length * (z2 - z1) - (z2 * z2 - z1 * z1) / 2);
    double found = layer_z(&b, n, k2) - layer_z(&b, n, k1);
    int left = 3 * box_node(n, 0, wide / 2, k), right = 3 * box_node(n, wide, wide / 2, k);
    double across = (b.body->x[right] - b.body->x[left]) / (h * wide) - 1;
    double along = (layer_z(&b, n, k + 1) - layer_z(&b, n, k - 1)) / (2 * h);
    *young_ratio = exact / found;
    *poisson_found = -across / along;
    box_bench_close(&b);
}

static void a_bar_under_its_weight_shows_its_young_modulus_at_any_resolution(void)
{
    for (int wide = 2; wide <= 4; wide++) {
        double young, poisson;
        bar(wide, 0.45, &young, &poisson);
        printf("  %d voxels wide, nu 0.45: E found / given %.3f, nu found %.3f\n", wide, young, poisson);
        CHECK_NEAR(young, 1, 0.02);
    }
}

static void a_bar_shows_its_poisson_ratio(void)
{
    const double asked[] = {0.3, 0.4, 0.45, 0.48};
    for (int i = 0; i < 4; i++) {
        double young, poisson;
        bar(3, asked[i], &young, &poisson);
        printf("  nu %.2f: E found / given %.3f, nu found %.3f\n", asked[i], young, poisson);
        CHECK_NEAR(poisson, asked[i], 0.05);
        CHECK_NEAR(young, 1, 0.02);
    }
}

/* RMS of the displacement error over the largest displacement of the reference, percent */
static double beam_error(box_bench *b, const int n[3], FILE *csv, double load_part)
{
    char line[256];
    double sum = 0, max = 0, h = b->body->edge_m;
    int count = 0;
    while (fgets(line, sizeof line, csv)) {
        double p[3], u[3];
        if (sscanf(line, "%lf,%lf,%lf,%lf,%lf,%lf", p, p + 1, p + 2, u, u + 1, u + 2) != 6) continue;
        /* samples lie between nodes along x: linear along that edge */
        double gx = p[0] / h, size = 0;
        int i = (int)fmin(floor(gx + 1e-9), n[0] - 1), j = (int)lround((p[1] + 0.025) / h),
            k = (int)lround((p[2] + 0.025) / h);
        const double *x0 = b->body->x + 3 * box_node(n, i, j, k), *x1 = b->body->x + 3 * box_node(n, i + 1, j, k);
        const double *r0 = b->body->x_rest + 3 * box_node(n, i, j, k);
        const double *r1 = b->body->x_rest + 3 * box_node(n, i + 1, j, k);
        for (int c = 0; c < 3; c++) {
            double found = ((1 - gx + i) * (x0[c] - r0[c]) + (gx - i) * (x1[c] - r1[c])) / load_part;
            sum += (found - u[c]) * (found - u[c]);
            size += u[c] * u[c];
        }
        max = fmax(max, sqrt(size));
        count++;
    }
    return 100 * sqrt(sum / count) / max;
}

static void a_cantilever_bends_like_the_reference(void)
{
    const char *path = check_shared("reference/beam/u_linear_nu045.csv");
    FILE *csv = path ? fopen(path, "r") : NULL;
    const int n[3] = {16, 4, 4};
    const double part = 0.1, h = 0.0125;
    box_bench b;
    REQUIRE(bench_open(&b, n, h, 1e5, 0.45, 24, 0));
    /* 100 Pa downwards on the end, by the share of each node */
    for (int j = 0; j <= n[1]; j++)
        for (int k = 0; k <= n[2]; k++) {
            double share = (j % n[1] ? 1 : 0.5) * (k % n[2] ? 1 : 0.5);
            REQUIRE(
                !pal_world_load(b.world, 0, box_node(n, n[0], j, k), (double[3]){0, 0, -100 * part * h * h * share}));
        }
    for (int i = 0; i < 90; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    int tip = 3 * box_node(n, n[0], 2, 2) + 2;
    double found = (b.body->x_rest[tip] - b.body->x[tip]) / part;
    /* Timoshenko: F L^3/(3 E I) + F L/(k G A), k = 5/6 */
    double exact = 0.25 * 0.008 / (3 * 1e5 * 0.05 * 0.05 * 0.05 * 0.05 / 12) + 0.25 * 0.2 / (5.0 / 6 * 34483 * 0.0025);
    printf("  tip %.3f mm, beam theory %.3f mm\n", 1e3 * found, 1e3 * exact);
    CHECK_NEAR(found / exact, 1, 0.25);
    if (csv) {
        double error = beam_error(&b, n, csv, part);
        printf("  RMS error against the reference %.2f %%\n", error);
        CHECK_LE(error, 10);
        fclose(csv);
    }
    box_bench_close(&b);
}

int main(void)
{
    for (int turn = 0; turn < 2; turn++) {
        without_area = turn == 1;
        printf("%s the row face_area\n", turn ? "without" : "with");
        RUN(a_bar_under_its_weight_shows_its_young_modulus_at_any_resolution);
        RUN(a_bar_shows_its_poisson_ratio);
        RUN(a_cantilever_bends_like_the_reference);
    }
    return check_report();
}
