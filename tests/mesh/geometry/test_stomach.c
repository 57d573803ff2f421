/* Procedural hollow bodies: counts, shape, quality, rings, refusals. */
#include "server/mesh/geometry/levels.h"
#include "server/mesh/geometry/procedural.h"
#include "tests/check.h"
#include "tests/fixtures/shapes.h"

/* made once; not to be freed */
static const pal_stomach *stomach(void)
{
    static pal_stomach made;
    if (!made.surface.x && pal_stomach_make(&made)) abort();
    return &made;
}

/* least angle in degrees; fewest and most triangles of a vertex */
static double min_angle(const pal_surface *s, int *fewest, int *max)
{
    int *count = calloc((size_t)s->n_vertex, sizeof *count);
    double min = 180;
    if (!count) abort();
    for (int c = 0; c < 3 * s->n_tri; c++) {
        const int32_t *t = s->tri + 3 * (c / 3);
        const double *p = s->x + 3 * t[c % 3], *q = s->x + 3 * t[(c + 1) % 3], *r = s->x + 3 * t[(c + 2) % 3];
        double uv = 0, uu = 0, vv = 0;
        for (int k = 0; k < 3; k++)
            uv += (q[k] - p[k]) * (r[k] - p[k]), uu += (q[k] - p[k]) * (q[k] - p[k]),
                vv += (r[k] - p[k]) * (r[k] - p[k]);
        min = fmin(min, acos(uv / sqrt(uu * vv)) * 180 / SHAPE_PI);
        count[t[c % 3]]++;
    }
    *fewest = 1 << 30, *max = 0;
    for (int v = 0; v < s->n_vertex; v++) {
        *fewest = count[v] < *fewest ? count[v] : *fewest;
        *max = count[v] > *max ? count[v] : *max;
    }
    free(count);
    return min;
}

static bool sound(const pal_surface *s)
{
    pal_surface_topology t;
    return !pal_surface_check(s, &t) && t.closed && t.manifold && t.oriented && pal_surface_volume(s) > 0;
}

static void stomach_has_the_papers_counts_and_good_triangles(void)
{
    pal_stomach s = *stomach();
    int fewest, max, components;
    CHECK_INT(s.surface.n_vertex, PAL_STOMACH_VERTEX);
    CHECK_INT(s.surface.n_tri, 372);
    CHECK(sound(&s.surface));
    int32_t label[372];
    CHECK(!pal_surface_components(&s.surface, label, &components));
    CHECK_INT(components, 1);
    double min = min_angle(&s.surface, &fewest, &max), low[3], high[3];
    printf("  least angle %.1f degrees, %d to %d triangles a vertex, %.3f l\n", min, fewest, max,
           pal_surface_volume(&s.surface) * 1e3);
    CHECK(min > 25);
    CHECK(fewest >= 4 && max <= 8);
    pal_surface_box(&s.surface, low, high);
    CHECK_NEAR(high[0] - low[0], 0.21, 0.01);
    CHECK_NEAR(high[1] - low[1], 0.24, 0.01);
    CHECK_NEAR(high[2] - low[2], 0.10, 0.01);
    CHECK_NEAR(pal_surface_volume(&s.surface), 1.4e-3, 0.1e-3);
}

static bool has_edge(const pal_surface *s, int32_t a, int32_t b)
{
    for (int c = 0; c < 3 * s->n_tri; c++)
        if (s->tri[c] == a && s->tri[c % 3 == 2 ? c - 2 : c + 1] == b) return true;
    return false;
}

static void rings_close_around_their_caps(void)
{
    pal_stomach s = *stomach();
    for (int end = 0; end < 2; end++) {
        const int32_t *ring = end ? s.duodenum : s.oesophagus, cap = end ? s.duodenum_cap : s.oesophagus_cap;
        double middle[3] = {0}, radius = 0;
        for (int k = 0; k < PAL_STOMACH_RING; k++) {
            int32_t a = ring[k], b = ring[(k + 1) % PAL_STOMACH_RING];
            CHECK(has_edge(&s.surface, a, b) && has_edge(&s.surface, b, a) && has_edge(&s.surface, cap, a));
            for (int i = 0; i < 3; i++) middle[i] += s.surface.x[3 * a + i] / PAL_STOMACH_RING;
        }
        for (int k = 0; k < PAL_STOMACH_RING; k++) {
            double d2 = 0;
            for (int i = 0; i < 3; i++) d2 += pow(s.surface.x[3 * ring[k] + i] - middle[i], 2);
            if (k == 0) radius = sqrt(d2);
            CHECK_NEAR(sqrt(d2), radius, 1e-12);
        }
        for (int i = 0; i < 3; i++) CHECK_NEAR(s.surface.x[3 * cap + i], middle[i], 1e-12);
        CHECK_NEAR(radius, 0.0155, 1e-12);
        /* the oesophagus comes from above, the duodenum leaves to the right and below it */
        CHECK(end ? middle[0] < -0.09 && middle[1] < 0 : middle[1] > 0.15);
    }
}

/* the lesser curvature is the short way: hollow towards the right side, under the cardia; the greater one bulges left
 */
static void curvatures_are_hollow_and_full(void)
{
    pal_stomach s = *stomach();
    double left = -1, right = 1, top = -1;
    for (int v = 0; v < s.surface.n_vertex; v++) {
        const double *x = s.surface.x + 3 * v;
        if (fabs(x[1] - 0.01) < 0.015) left = fmax(left, x[0]), right = fmin(right, x[0]);
        if (x[0] > 0.05) top = fmax(top, x[1]);
    }
    /* at half height the duodenum's end is far to the right, with nothing between it and the lesser curvature */
    CHECK(left > 0.08);
    CHECK(right < -0.08);
    for (int v = 0; v < s.surface.n_vertex; v++) {
        const double *x = s.surface.x + 3 * v;
        CHECK(!(x[1] > 0 && x[1] < 0.05 && x[0] > -0.07 && x[0] < -0.005));
    }
    /* the fundus rises above the cardia */
    CHECK(top > 0.12);
}

static void refined_stomach_stays_sound(void)
{
    pal_stomach s = *stomach();
    pal_levels l;
    pal_levels_options options = {.n_level = 4};
    REQUIRE(!pal_levels_make(&s.surface, &options, &l, NULL));
    double volume = pal_surface_volume(&s.surface);
    for (int i = 1; i < 4; i++) {
        pal_surface fine;
        int fewest, max;
        REQUIRE(!pal_levels_surface(&l, i, &fine));
        double min = min_angle(&fine, &fewest, &max);
        printf("  level %d: least angle %.1f degrees, %.3f l\n", i, min, pal_surface_volume(&fine) * 1e3);
        CHECK(min > 15);
        CHECK(fewest >= 4 && max <= 8);
        CHECK(sound(&fine));
        CHECK_NEAR(pal_surface_volume(&fine) / volume, 1.07, 0.06);
        pal_surface_free(&fine);
    }
    pal_levels_free(&l);
}

static void sphere_has_114_vertices_all_at_its_radius(void)
{
    pal_surface s;
    REQUIRE(!pal_sphere_make(0.05, &s));
    int fewest, max;
    CHECK_INT(s.n_vertex, PAL_SPHERE_VERTEX);
    CHECK_INT(s.n_tri, 224);
    CHECK(sound(&s));
    double min = min_angle(&s, &fewest, &max), worst = 0, middle = 0;
    printf("  least angle %.1f degrees, %d to %d triangles a vertex\n", min, fewest, max);
    CHECK(min > 40);
    CHECK(fewest >= 4 && max <= 8);
    for (int v = 0; v < s.n_vertex; v++) {
        const double *x = s.x + 3 * v;
        worst = fmax(worst, fabs(sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - 0.05));
        middle = fmax(middle, x[2]);
    }
    CHECK_LE(worst, 1e-16);
    CHECK_NEAR(pal_surface_area(&s), 4 * SHAPE_PI * 0.0025, 0.04 * 4 * SHAPE_PI * 0.0025);
    pal_surface_free(&s);
    double bad[4] = {0, -1, NAN, INFINITY};
    for (int k = 0; k < 4; k++) CHECK_INT(pal_sphere_make(bad[k], &s), PAL_ERR_REFUSED);
}

static void the_same_every_time(void)
{
    pal_stomach again;
    const pal_stomach *s = stomach();
    REQUIRE(!pal_stomach_make(&again));
    CHECK(!memcmp(again.surface.x, s->surface.x, 3 * PAL_STOMACH_VERTEX * sizeof(double)));
    CHECK(!memcmp(again.surface.tri, s->surface.tri, 3 * 372 * sizeof(int32_t)));
    pal_surface_free(&again.surface);
    CHECK(again.surface.x == NULL);
}

static void sheet_is_flat_and_faces_up(void)
{
    pal_surface s;
    REQUIRE(!pal_sheet_make(9, 5, 0.4, 0.2, &s, NULL));
    CHECK_INT(s.n_vertex, 45);
    CHECK_INT(s.n_tri, 64);
    double low[3], high[3], normal[3 * 45];
    pal_surface_box(&s, low, high);
    CHECK_NEAR(low[0], -0.2, 1e-15);
    CHECK_NEAR(high[1], 0.1, 1e-15);
    CHECK_NEAR(pal_surface_area(&s), 0.08, 1e-15);
    pal_surface_normals(&s, normal);
    for (int v = 0; v < 45; v++) CHECK_NEAR(normal[3 * v + 2], 1, 1e-15);
    pal_surface_topology t;
    CHECK(!pal_surface_check(&s, &t));
    CHECK(t.manifold && t.oriented && !t.closed);
    CHECK_INT(t.n_open_edge, 2 * (8 + 4));
    pal_surface_free(&s);
    static const struct {
        int n, m;
        double width, height;
        const char *word;
    } bad[] = {{1, 5, 1, 1, "1 x 5"},     {5, 0, 1, 1, "5 x 0"},      {-4, 5, 1, 1, "-4 x 5"},
               {20001, 2, 1, 1, "20001"}, {9999, 9999, 1, 1, "9999"}, {3, 3, 0, 1, "size of 0 x"},
               {3, 3, 1, NAN, "nan"},     {3, 3, INFINITY, 1, "inf"}, {3, 3, 1, -2, "x -2 m"}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        pal_diagnostic diag = {.text = ""};
        CHECK_INT(pal_sheet_make(bad[k].n, bad[k].m, bad[k].width, bad[k].height, &s, &diag), PAL_ERR_REFUSED);
        CHECK(strstr(diag.text, bad[k].word) != NULL);
    }
}

int main(void)
{
    RUN(stomach_has_the_papers_counts_and_good_triangles);
    RUN(rings_close_around_their_caps);
    RUN(curvatures_are_hollow_and_full);
    RUN(refined_stomach_stays_sound);
    RUN(sphere_has_114_vertices_all_at_its_radius);
    RUN(the_same_every_time);
    RUN(sheet_is_flat_and_faces_up);
    return check_report();
}
