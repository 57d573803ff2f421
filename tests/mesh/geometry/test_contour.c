/* Contour, smoothing and decimation against spheres and tori, and the procedural organ. */
#include "server/base/vec3.h"
#include "server/mesh/geometry/contour.h"
#include "server/mesh/geometry/decimate.h"
#include "server/mesh/geometry/procedural.h"
#include "server/mesh/geometry/smooth.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

#define PI 3.14159265358979323846

/* ball of radius 50 mm round (0.1, 0, -0.2) */
static const double ball_middle[3] = {0.1, 0, -0.2};
static const double ball_radius = 0.05;

static double ball(const void *self, const double p[3])
{
    (void)self;
    double d2 = 0;
    for (int a = 0; a < 3; a++) d2 += (p[a] - ball_middle[a]) * (p[a] - ball_middle[a]);
    return ball_radius - sqrt(d2);
}

/* torus round z: 40 mm and 15 mm */
static double torus(const void *self, const double p[3])
{
    (void)self;
    double ring = sqrt(p[0] * p[0] + p[1] * p[1]) - 0.04;
    return 0.015 - sqrt(ring * ring + p[2] * p[2]);
}

/* deterministic noise: every lattice point its own sign */
static double noise(const void *self, const double p[3])
{
    double v = sin(12.9898 * p[0] + 78.233 * p[1] + 37.719 * p[2] + *(const double *)self) * 43758.5453;
    return v - floor(v) - 0.5;
}

static double zero(const void *self, const double p[3])
{
    (void)self;
    (void)p;
    return 0;
}

static const pal_contour_box ball_box = {{0.04, -0.06, -0.26}, {0.16, 0.06, -0.14}, 0.004};
static const pal_contour_box torus_box = {{-0.06, -0.06, -0.02}, {0.06, 0.06, 0.02}, 0.003};

/* closed, manifold, oriented, with the Euler characteristic V - E + F and E = 3 F / 2 */
static void check_closed(const pal_surface *s, int euler)
{
    pal_surface_topology t;
    REQUIRE(pal_surface_check(s, &t) == PAL_ERR_OK);
    CHECK_INT(t.n_open_edge, 0);
    CHECK_INT(t.n_nonmanifold_edge, 0);
    CHECK_INT(t.n_nonmanifold_vertex, 0);
    CHECK_INT(t.n_misoriented_edge, 0);
    CHECK_INT(s->n_vertex - s->n_tri / 2, euler);
}

/* largest angle (degrees) between a triangle's normal and the direction from the ball's middle */
static double worst_angle(const pal_surface *s)
{
    double worst = 0;
    for (int t = 0; t < s->n_tri; t++) {
        const double *p[3];
        double u[3], v[3], n[3], m[3], nn = 0, mm = 0, nm = 0;
        for (int k = 0; k < 3; k++) p[k] = s->x + 3 * s->tri[3 * t + k];
        for (int a = 0; a < 3; a++) {
            u[a] = p[1][a] - p[0][a];
            v[a] = p[2][a] - p[0][a];
            m[a] = (p[0][a] + p[1][a] + p[2][a]) / 3 + s->origin_m[a] - ball_middle[a];
        }
        for (int a = 0; a < 3; a++) n[a] = u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3];
        for (int a = 0; a < 3; a++) nn += n[a] * n[a], mm += m[a] * m[a], nm += n[a] * m[a];
        worst = fmax(worst, acos(fmin(nm / sqrt(nn * mm), 1)) * 180 / PI);
    }
    return worst;
}

static void sphere_is_closed_with_the_analytic_volume_and_normals(void)
{
    pal_surface s;
    REQUIRE(pal_contour(ball, NULL, &ball_box, &s, NULL) == PAL_ERR_OK);
    check_closed(&s, 2);
    double wanted = 4 * PI / 3 * pow(ball_radius, 3);
    CHECK_NEAR(pal_surface_volume(&s) / wanted, 1, 4e-3);
    CHECK_NEAR(pal_surface_area(&s) / (4 * PI * ball_radius * ball_radius), 1, 4e-3);
    for (int a = 0; a < 3; a++) CHECK_NEAR(s.origin_m[a], ball_middle[a], 1e-4);
    for (int i = 0; i < s.n_vertex; i++) {
        double p[3];
        for (int a = 0; a < 3; a++) p[a] = s.x[3 * i + a] + s.origin_m[a];
        if (!(fabs(ball(NULL, p)) < 1.2e-4)) CHECK_NEAR(ball(NULL, p), 0, 1.2e-4);
    }
    /* triangles are as flat against the sphere as chords of their size must be */
    CHECK_LE(worst_angle(&s), 5);
    pal_surface_free(&s);
}

static void torus_keeps_its_hole(void)
{
    pal_surface s;
    REQUIRE(pal_contour(torus, NULL, &torus_box, &s, NULL) == PAL_ERR_OK);
    check_closed(&s, 0);
    CHECK_NEAR(pal_surface_volume(&s) / (2 * PI * PI * 0.04 * 0.015 * 0.015), 1, 0.02);
    REQUIRE(pal_surface_decimate(&s, 600) == PAL_ERR_OK);
    CHECK_INT(s.n_tri, 600);
    check_closed(&s, 0);
    CHECK_NEAR(pal_surface_volume(&s) / (2 * PI * PI * 0.04 * 0.015 * 0.015), 1, 0.02);
    pal_surface_free(&s);
}

static void any_sign_pattern_gives_a_closed_manifold(void)
{
    static const pal_contour_box box = {{0, 0, 0}, {1, 1, 1}, 0.1};
    for (double seed = 0; seed < 20; seed++) {
        pal_surface s;
        REQUIRE(pal_contour(noise, &seed, &box, &s, NULL) == PAL_ERR_OK);
        pal_surface_topology t;
        REQUIRE(pal_surface_check(&s, &t) == PAL_ERR_OK);
        CHECK(t.closed && t.manifold && t.oriented);
        /* and decimation keeps it one, whatever its genus */
        int euler = s.n_vertex - s.n_tri / 2;
        REQUIRE(pal_surface_decimate(&s, s.n_tri / 2) == PAL_ERR_OK);
        check_closed(&s, euler);
        pal_surface_free(&s);
    }
}

static void empty_and_oversized_contours_are_refused(void)
{
    pal_surface s;
    pal_diagnostic diag;
    CHECK_INT(pal_contour(zero, NULL, &ball_box, &s, &diag), PAL_ERR_REFUSED);
    pal_contour_box box = ball_box;
    box.spacing_m = 1e-6;
    CHECK_INT(pal_contour(ball, NULL, &box, &s, &diag), PAL_ERR_BUDGET);
    box.spacing_m = 0;
    CHECK_INT(pal_contour(ball, NULL, &box, &s, &diag), PAL_ERR_BUDGET);
    box.spacing_m = (double)NAN;
    CHECK_INT(pal_contour(ball, NULL, &box, &s, &diag), PAL_ERR_BUDGET);
}

static void smoothing_removes_roughness_and_keeps_volume(void)
{
    pal_surface s;
    REQUIRE(pal_contour(ball, NULL, &ball_box, &s, NULL) == PAL_ERR_OK);
    double volume = pal_surface_volume(&s);
    uint64_t seed = 1;
    for (int i = 0; i < 3 * s.n_vertex; i++) s.x[i] += 2e-4 * random_signed(&seed);
    double rough = worst_angle(&s);
    REQUIRE(pal_surface_smooth(&s, 10, NULL) == PAL_ERR_OK);
    CHECK_LE(worst_angle(&s), rough / 3);
    CHECK_NEAR(pal_surface_volume(&s) / volume, 1, 1e-3);
    /* vertices of open edges stay where they are */
    double *before = malloc(sizeof *before * 3 * (size_t)s.n_vertex);
    REQUIRE(before != NULL);
    memcpy(before, s.x, sizeof *before * 3 * (size_t)s.n_vertex);
    s.n_tri--;
    const int32_t *c = s.tri + 3 * (size_t)s.n_tri;
    REQUIRE(pal_surface_smooth(&s, 3, NULL) == PAL_ERR_OK);
    for (int k = 0; k < 3; k++) CHECK(memcmp(s.x + 3 * c[k], before + 3 * c[k], 24) == 0);
    free(before);
    pal_surface_free(&s);
}

static void relaxing_never_leaves_its_reach(void)
{
    pal_surface s, start;
    REQUIRE(pal_contour(ball, NULL, &ball_box, &s, NULL) == PAL_ERR_OK);
    REQUIRE(pal_surface_copy(&s, &start) == PAL_ERR_OK);
    double *reach = malloc(sizeof *reach * (size_t)s.n_vertex);
    REQUIRE(reach != NULL);
    for (int i = 0; i < s.n_vertex; i++) reach[i] = 2e-4;
    /* without the reach this many rounds would shrink the ball by far more */
    REQUIRE(pal_surface_smooth(&s, 500, reach) == PAL_ERR_OK);
    double worst = 0, farthest = 0;
    for (int i = 0; i < s.n_vertex; i++) {
        double p[3], q[3], moved2 = 0;
        for (int a = 0; a < 3; a++) {
            p[a] = s.x[3 * i + a] + s.origin_m[a];
            q[a] = start.x[3 * i + a] + start.origin_m[a];
            moved2 += (p[a] - q[a]) * (p[a] - q[a]);
        }
        worst = fmax(worst, fabs(ball(NULL, p) - ball(NULL, q)));
        farthest = fmax(farthest, sqrt(moved2));
    }
    CHECK_LE(worst, 2.4e-4);
    CHECK(worst > 1.9e-4);
    /* the reach along the normal and twice that across it */
    CHECK_LE(farthest, sqrt(5) * 2e-4 * (1 + 1e-9));
    free(reach);
    pal_surface_free(&s);
    pal_surface_free(&start);
}

static void decimation_keeps_a_sphere_round_closed_and_well_shaped(void)
{
    pal_surface s;
    pal_contour_box box = ball_box;
    box.spacing_m = 0.002;
    REQUIRE(pal_contour(ball, NULL, &box, &s, NULL) == PAL_ERR_OK);
    CHECK(s.n_tri > 50000);
    REQUIRE(pal_surface_decimate(&s, 4000) == PAL_ERR_OK);
    CHECK_INT(s.n_tri, 4000);
    check_closed(&s, 2);
    CHECK_NEAR(pal_surface_volume(&s) / (4 * PI / 3 * pow(ball_radius, 3)), 1, 3e-3);
    double worst = 0;
    for (int i = 0; i < s.n_vertex; i++) {
        double p[3];
        for (int a = 0; a < 3; a++) p[a] = s.x[3 * i + a] + s.origin_m[a];
        worst = fmax(worst, fabs(ball(NULL, p)));
    }
    CHECK_LE(worst, 2e-4);
    CHECK_LE(worst_angle(&s), 6);
    /* down to the end it stays a closed surface */
    REQUIRE(pal_surface_decimate(&s, 4) == PAL_ERR_OK);
    CHECK_LE(s.n_tri, 40);
    check_closed(&s, 2);
    pal_surface_free(&s);
}

static void decimation_leaves_open_and_crowded_edges_alone(void)
{
    pal_surface s;
    REQUIRE(pal_contour(ball, NULL, &ball_box, &s, NULL) == PAL_ERR_OK);
    /* a hole of one triangle and a fin on another */
    s.n_tri--;
    s.tri = realloc(s.tri, sizeof *s.tri * 3 * (size_t)(s.n_tri + 1));
    REQUIRE(s.tri != NULL);
    int32_t fin[3] = {s.tri[0], s.tri[1], s.tri[3 * (s.n_tri / 2)]};
    memcpy(s.tri + 3 * (size_t)s.n_tri++, fin, sizeof fin);
    pal_surface_topology before, after;
    REQUIRE(pal_surface_check(&s, &before) == PAL_ERR_OK);
    REQUIRE(pal_surface_decimate(&s, s.n_tri / 4) == PAL_ERR_OK);
    REQUIRE(pal_surface_check(&s, &after) == PAL_ERR_OK);
    CHECK_INT(after.n_open_edge, before.n_open_edge);
    CHECK_INT(after.n_nonmanifold_edge, before.n_nonmanifold_edge);
    pal_surface_free(&s);
}

/* 0.159 m with the weight of edges' midpoints, 0.202 m without */
static void decimation_spreads_the_vertices_of_a_flat_sheet(void)
{
    pal_surface s;
    double longest = 0;
    REQUIRE(!pal_sheet_make(41, 41, 1, 1, &s, NULL));
    REQUIRE(!pal_surface_decimate(&s, 800));
    for (int c = 0; c < 3 * s.n_tri; c++)
        longest = fmax(longest, pal_dist3(s.x + 3 * s.tri[c], s.x + 3 * s.tri[c % 3 == 2 ? c - 2 : c + 1]));
    CHECK_LE(longest, 0.18);
    pal_surface_free(&s);
}

static void procedural_organ_is_a_closed_smooth_body_of_organ_size(void)
{
    static const int wanted[] = {1, 4000, 50000};
    for (int k = 0; k < 3; k++) {
        pal_surface s;
        REQUIRE(pal_organ_make(wanted[k], &s) == PAL_ERR_OK);
        int n = wanted[k] < 500 ? 500 : wanted[k];
        CHECK_INT(s.n_tri, n);
        check_closed(&s, 2);
        double low[3], high[3], volume = pal_surface_volume(&s);
        pal_surface_box(&s, low, high);
        CHECK(high[0] - low[0] > 0.18 && high[0] - low[0] < 0.24);
        /* livers have 1 to 2 litres */
        CHECK(volume > 0.9e-3 && volume < 2e-3);
        pal_surface_free(&s);
    }
}

int main(void)
{
    RUN(sphere_is_closed_with_the_analytic_volume_and_normals);
    RUN(torus_keeps_its_hole);
    RUN(any_sign_pattern_gives_a_closed_manifold);
    RUN(empty_and_oversized_contours_are_refused);
    RUN(smoothing_removes_roughness_and_keeps_volume);
    RUN(relaxing_never_leaves_its_reach);
    RUN(decimation_keeps_a_sphere_round_closed_and_well_shaped);
    RUN(decimation_leaves_open_and_crowded_edges_alone);
    RUN(decimation_spreads_the_vertices_of_a_flat_sheet);
    RUN(procedural_organ_is_a_closed_smooth_body_of_organ_size);
    return check_report();
}
