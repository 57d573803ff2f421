/* The problems of deploy/problems: every one can be read, its surface is closed, looks outward and holds the volume
 * that its geometry has on paper, and its loads meet as much of the surface as the file says. */
#include "server/base/vec3.h"
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/files/mesh_file.h"
#include "server/scene/problem_file.h"
#include "tests/check.h"

#include <cjson/cJSON.h>
#include <dirent.h>

static const char *const folder = "deploy/problems";

typedef struct open_problem {
    pal_problem *problem;
    pal_surface surface;
    cJSON *json;
} open_problem;

static void close_problem(open_problem *p)
{
    free(p->problem);
    pal_surface_free(&p->surface);
    cJSON_Delete(p->json);
}

static bool open_it(const char *name, open_problem *out)
{
    char path[512];
    uint8_t *bytes = NULL;
    size_t n_byte;
    pal_diagnostic diag = {""};
    pal_surface_report report;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    *out = (open_problem){0};
    pal_err err = pal_problem_read(path, &out->problem, &diag);
    pal_mesh_file_options options = {.unit_m = err ? 1 : out->problem->unit_m, .weld = PAL_MESH_WELD};
    if (!err) err = pal_mesh_file_read(out->problem->surface, &options, &out->surface, &report, NULL, NULL, &diag);
    if (!err) err = pal_file_read(path, 1 << 20, &bytes, &n_byte, &diag);
    if (!err) out->json = cJSON_ParseWithLength((const char *)bytes, n_byte);
    free(bytes);
    if (err || !out->json) CHECK_FAIL("%s: %s", name, diag.text);
    return !err && out->json;
}

/* the part of a convex polygon on the side of `at` where sign * x[axis] is larger; room for one corner more */
static int clip(double (*p)[3], int n, int axis, double at, double sign)
{
    double q[16][3];
    int kept = 0;
    for (int i = 0; i < n; i++) {
        const double *a = p[i], *b = p[(i + 1) % n];
        double da = sign * (a[axis] - at), db = sign * (b[axis] - at);
        if (da >= 0) pal_copy3(q[kept++], a);
        if ((da < 0) == (db < 0)) continue;
        for (int k = 0; k < 3; k++) q[kept][k] = a[k] + da / (da - db) * (b[k] - a[k]);
        kept++;
    }
    memcpy(p, q, sizeof q[0] * (size_t)kept);
    return kept;
}

/* of the surface that a load's region and normal select */
static double area_of(const pal_surface *s, const pal_problem_load *load)
{
    double sum = 0;
    for (int t = 0; t < s->n_tri; t++) {
        double p[16][3], a[3], b[3], normal[3], unit[3];
        for (int k = 0; k < 3; k++) pal_add3(p[k], s->x + 3 * s->tri[3 * t + k], s->origin_m);
        pal_sub3(a, p[1], p[0]);
        pal_sub3(b, p[2], p[0]);
        pal_cross3(normal, a, b);
        if (!pal_unit3(unit, normal, 0)) continue;
        if (load->has_normal && pal_dot3(unit, load->normal) < 0.9) continue;
        int n = 3;
        for (int k = 0; k < 3 && !load->region.all; k++) {
            n = clip(p, n, k, load->region.low_m[k], 1);
            n = clip(p, n, k, load->region.high_m[k], -1);
        }
        for (int k = 1; k + 1 < n; k++) {
            pal_sub3(a, p[k], p[0]);
            pal_sub3(b, p[k + 1], p[0]);
            pal_cross3(normal, a, b);
            sum += pal_norm3(normal) / 2;
        }
    }
    return sum;
}

static void check_areas(const char *name, const open_problem *p, int *n_area)
{
    const cJSON *cases = cJSON_GetObjectItem(p->json, "load_cases");
    for (int c = 0; c < p->problem->n_case; c++)
        for (int l = 0; l < p->problem->load_case[c].n_load; l++) {
            const pal_problem_load *load = &p->problem->load_case[c].load[l];
            const cJSON *loads = cJSON_GetObjectItem(cJSON_GetArrayItem(cases, c), "loads");
            const cJSON *stated = cJSON_GetObjectItem(cJSON_GetArrayItem(loads, l), "area");
            if (load->kind != PAL_LOAD_TRACTION) continue;
            double area = area_of(&p->surface, load);
            if (!(area > 0)) CHECK_FAIL("%s, %s, load %d meets no surface", name, p->problem->load_case[c].id, l);
            if (!stated) continue;
            CHECK_NEAR(area / stated->valuedouble, 1, 1e-5);
            for (int k = 0; k < 3 && load->has_traction && load->has_total; k++)
                CHECK_NEAR(load->total_N[k], load->traction_Pa[k] * stated->valuedouble, 1e-9);
            (*n_area)++;
        }
}

static void all_problems_can_be_read_and_loads_meet_the_area_stated(void)
{
    int n = 0, n_area = 0;
    DIR *list = opendir(folder);
    REQUIRE(list);
    for (struct dirent *entry; (entry = readdir(list)) != NULL;) {
        size_t length = strlen(entry->d_name);
        if (length < 5 || strcmp(entry->d_name + length - 5, ".json")) continue;
        open_problem p;
        if (open_it(entry->d_name, &p)) {
            pal_surface_topology topology;
            CHECK_INT(pal_surface_check(&p.surface, &topology), PAL_ERR_OK);
            CHECK(topology.closed && topology.manifold && topology.oriented);
            CHECK(pal_surface_volume(&p.surface) > 0);
            CHECK(p.problem->n_support > 0);
            const cJSON *geometry = cJSON_GetObjectItem(p.json, "geometry"), *volume;
            if ((volume = cJSON_GetObjectItem(geometry, "volume")) != NULL)
                CHECK_NEAR(pal_surface_volume(&p.surface) / volume->valuedouble, 1, 1e-6);
            check_areas(entry->d_name, &p, &n_area);
            n++;
        }
        close_problem(&p);
    }
    closedir(list);
    CHECK(n >= 4);
    CHECK(n_area >= 8);
}

/* twice the area of the polygon whose corners stand at these angles and radii, repeated `times` around the circle */
static double polygon(const double (*corner)[2], int n, int times)
{
    double sum = 0, turn = 2 * M_PI / times;
    for (int i = 0; i < n * times; i++) {
        const double *a = corner[i % n], *b = corner[(i + 1) % n];
        double from = turn * (double)(i / n) + a[0] * M_PI / 180, to = turn * (double)((i + 1) / n) + b[0] * M_PI / 180;
        sum += a[1] * b[1] * sin(to - from);
    }
    return sum;
}

static void gear_has_the_volume_of_its_profile(void)
{
    static const double tooth[5][2] = {{-10.5, 0.8}, {-6, 1}, {6, 1}, {10.5, 0.8}, {18, 0.8}}, hole[1][2] = {{0, 0.35}};
    open_problem p;
    REQUIRE(open_it("gear.json", &p));
    double profile = (polygon(tooth, 5, 10) - polygon(hole, 1, 40)) / 2;
    CHECK_NEAR(profile, 2.119334411, 1e-9);
    CHECK_NEAR(pal_surface_volume(&p.surface) / (0.4 * profile), 1, 1e-6);
    /* its faces, rim and hole: the lengths of the edges times the thickness */
    double rim = 0, low[3], high[3];
    for (int i = 0; i < 5; i++) {
        const double *a = tooth[i], *b = tooth[(i + 1) % 5];
        double angle = (b[0] - a[0] + (i == 4 ? 36 : 0)) * M_PI / 180;
        rim += 10 * sqrt(a[1] * a[1] + b[1] * b[1] - 2 * a[1] * b[1] * cos(angle));
    }
    rim += 40 * 2 * 0.35 * sin(M_PI / 40);
    CHECK_NEAR(pal_surface_area(&p.surface), 2 * profile + 0.4 * rim, 1e-5);
    /* it stands on the two lowest of its teeth, and the load `push` is on the two highest */
    pal_surface_box(&p.surface, low, high);
    CHECK_NEAR(high[1] - low[1], 0.4, 1e-9);
    CHECK_NEAR(high[2] - low[2], 2 * sin(78 * M_PI / 180), 1e-6);
    CHECK_NEAR(high[0] - low[0], 2 * cos(6 * M_PI / 180), 1e-6);
    close_problem(&p);
}

static void cube_and_bar_have_two_regions_that_meet_in_the_middle(void)
{
    static const struct {
        const char *name;
        int axis;
        double volume, border, ratio;
    } box[] = {{"cube.json", 2, 0.001, 0.05, 20}, {"bar.json", 0, 0.004, 0.2, 10}};
    for (int i = 0; i < 2; i++) {
        open_problem p;
        REQUIRE(open_it(box[i].name, &p));
        const pal_problem_material *m = p.problem->material;
        CHECK_NEAR(pal_surface_volume(&p.surface), box[i].volume, 1e-9);
        REQUIRE(p.problem->n_material == 2);
        double soft = fmin(m[0].young_Pa, m[1].young_Pa), stiff = fmax(m[0].young_Pa, m[1].young_Pa);
        CHECK_NEAR(stiff / soft, box[i].ratio, 1e-12);
        bool first = m[0].region.low_m[box[i].axis] < m[1].region.low_m[box[i].axis];
        CHECK_NEAR(m[first ? 0 : 1].region.high_m[box[i].axis], box[i].border, 1e-12);
        CHECK_NEAR(m[first ? 1 : 0].region.low_m[box[i].axis], box[i].border, 1e-12);
        /* nothing of the body is without material */
        double low[3], high[3];
        pal_surface_box(&p.surface, low, high);
        for (int k = 0; k < 3; k++) {
            low[k] += p.surface.origin_m[k], high[k] += p.surface.origin_m[k];
            CHECK_LE(fmin(m[0].region.low_m[k], m[1].region.low_m[k]), low[k]);
            CHECK_LE(high[k], fmax(m[0].region.high_m[k], m[1].region.high_m[k]));
        }
        close_problem(&p);
    }
}

int main(void)
{
    RUN(all_problems_can_be_read_and_loads_meet_the_area_stated);
    RUN(gear_has_the_volume_of_its_profile);
    RUN(cube_and_bar_have_two_regions_that_meet_in_the_middle);
    return check_report();
}
