/* Surfaces: measures against analytic answers, cleaning counts, topology of known faults. */
#include "server/base/vec3.h"
#include "server/mesh/geometry/surface.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

/* unit cube, 12 triangles, outward */
static const double cube_x[24] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1};
static const int32_t cube_tri[36] = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                                     1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};

static pal_surface cube(void)
{
    pal_surface from = {.n_vertex = 8, .n_tri = 12, .x = (double *)cube_x, .tri = (int32_t *)cube_tri}, to = {0};
    pal_surface_copy(&from, &to);
    return to;
}

/* room for more pieces at the end of both arrays */
static void grow(pal_surface *s, int n_vertex, int n_tri)
{
    s->x = realloc(s->x, sizeof(double) * 3 * (size_t)n_vertex);
    s->tri = realloc(s->tri, sizeof(int32_t) * 3 * (size_t)n_tri);
}

static void add_tri(pal_surface *s, int a, int b, int c)
{
    int32_t *t = s->tri + 3 * (size_t)s->n_tri++;
    t[0] = a, t[1] = b, t[2] = c;
}

static void add_vertex(pal_surface *s, double x, double y, double z)
{
    double *p = s->x + 3 * (size_t)s->n_vertex++;
    p[0] = x, p[1] = y, p[2] = z;
}

static void cube_has_volume_one_and_area_six(void)
{
    pal_surface s = cube();
    double low[3], high[3], normal[24];
    pal_surface_box(&s, low, high);
    CHECK_NEAR(pal_surface_volume(&s), 1, 1e-15);
    CHECK_NEAR(pal_surface_area(&s), 6, 1e-15);
    CHECK_NEAR(low[0] + low[1] + low[2], 0, 0);
    CHECK_NEAR(high[0] + high[1] + high[2], 3, 0);
    pal_surface_normals(&s, normal);
    /* every corner normal points away from the middle and has unit length */
    for (int i = 0; i < 8; i++) {
        double out = 0, length = 0;
        for (int a = 0; a < 3; a++) {
            out += normal[3 * i + a] * (cube_x[3 * i + a] - 0.5);
            length += normal[3 * i + a] * normal[3 * i + a];
        }
        CHECK_NEAR(length, 1, 1e-14);
        CHECK(out > 0.7);
    }
    pal_surface_free(&s);
    CHECK(s.x == NULL && s.n_tri == 0);
}

static void cube_is_closed_manifold_and_oriented(void)
{
    pal_surface s = cube();
    pal_surface_topology topology;
    REQUIRE(pal_surface_check(&s, &topology) == PAL_ERR_OK);
    CHECK(topology.closed && topology.manifold && topology.oriented);
    /* a missing triangle opens three edges, a turned one makes three run the same way twice */
    s.n_tri = 11;
    REQUIRE(pal_surface_check(&s, &topology) == PAL_ERR_OK);
    CHECK_INT(topology.n_open_edge, 3);
    CHECK(!topology.closed && topology.manifold);
    s.n_tri = 12;
    int32_t swap = s.tri[0];
    s.tri[0] = s.tri[1], s.tri[1] = swap;
    REQUIRE(pal_surface_check(&s, &topology) == PAL_ERR_OK);
    CHECK_INT(topology.n_misoriented_edge, 3);
    CHECK(topology.closed && !topology.oriented);
    pal_surface_free(&s);
}

static void shared_edge_and_shared_vertex_are_not_manifold(void)
{
    /* two cubes side by side that share the edge 1-2, then only vertex 1 */
    for (int shared = 2; shared >= 1; shared--) {
        pal_surface s = cube();
        grow(&s, 16, 24);
        int32_t other[8];
        for (int i = 0; i < 8; i++) {
            bool join = i == 0 || (i == 3 && shared == 2);
            other[i] = join ? (i == 0 ? 1 : 2) : s.n_vertex;
            if (!join) add_vertex(&s, cube_x[3 * i] + 1, cube_x[3 * i + 1], cube_x[3 * i + 2] + 7);
        }
        for (int t = 0; t < 12; t++)
            add_tri(&s, other[cube_tri[3 * t]], other[cube_tri[3 * t + 1]], other[cube_tri[3 * t + 2]]);
        pal_surface_topology topology;
        REQUIRE(pal_surface_check(&s, &topology) == PAL_ERR_OK);
        CHECK_INT(topology.n_nonmanifold_edge, shared == 2);
        CHECK_INT(topology.n_nonmanifold_vertex, shared == 1);
        CHECK(topology.closed && !topology.manifold);
        int32_t label[24];
        int n;
        REQUIRE(pal_surface_components(&s, label, &n) == PAL_ERR_OK);
        CHECK_INT(n, shared == 2 ? 1 : 2);
        CHECK_INT(label[0], 0);
        CHECK_INT(label[23], n - 1);
        pal_surface_free(&s);
    }
}

static void fans_list_every_triangle_at_each_of_its_corners(void)
{
    pal_surface s = cube();
    int32_t *start, *item;
    REQUIRE(pal_surface_fans(&s, &start, &item) == PAL_ERR_OK);
    CHECK_INT(start[8], 36);
    for (int i = 0; i < 8; i++)
        for (int k = start[i]; k < start[i + 1]; k++) {
            const int32_t *c = s.tri + 3 * item[k];
            CHECK(c[0] == i || c[1] == i || c[2] == i);
            if (k > start[i]) CHECK(item[k] > item[k - 1]);
        }
    free(start);
    free(item);
    pal_surface_free(&s);
}

static void cleaning_counts_each_kind_of_fault(void)
{
    pal_surface s = cube();
    grow(&s, 20, 20);
    add_vertex(&s, 0.5, 0.5, 9);  /* 8: used by nothing     */
    add_vertex(&s, 1, 1, 1);      /* 9: equal to 6          */
    add_vertex(&s, NAN, 0, 0);    /* 10                     */
    add_vertex(&s, 0, 1e301, 0);  /* 11                     */
    add_vertex(&s, 0.5, -0.0, 0); /* 12: on the edge 0-1    */
    add_tri(&s, 0, 1, 10);
    add_tri(&s, 0, 11, 1);
    add_tri(&s, 3, 3, 4); /* repeated corner                */
    add_tri(&s, 6, 9, 4); /* repeated corner once welded    */
    add_tri(&s, 2, 1, 0); /* triangle 0 again, turned round */
    pal_surface_report report = {0};
    REQUIRE(pal_surface_clean(&s, 0, &report, NULL) == PAL_ERR_OK);
    CHECK_INT(report.n_nonfinite, 2);
    CHECK_INT(report.n_degenerate, 2);
    CHECK_INT(report.n_duplicate, 1);
    CHECK_INT(report.n_welded, 1);
    CHECK_INT(report.n_unused, 4);
    CHECK_INT(s.n_vertex, 8);
    CHECK_INT(s.n_tri, 12);
    CHECK_NEAR(pal_surface_volume(&s), 1, 1e-15);
    pal_surface_free(&s);
}

static void cleaning_recentres_and_keeps_far_positions(void)
{
    pal_surface s = cube();
    for (int i = 0; i < 24; i++) s.x[i] = s.x[i] * 1e-3 + 1e4;
    pal_surface_report report = {0};
    REQUIRE(pal_surface_clean(&s, 0, &report, NULL) == PAL_ERR_OK);
    for (int a = 0; a < 3; a++) CHECK_NEAR(s.origin_m[a], 1e4 + 5e-4, 1e-11);
    for (int i = 0; i < 24; i++) CHECK_NEAR(fabs(s.x[i]), 5e-4, 1e-11);
    CHECK_NEAR(pal_surface_volume(&s), 1e-9, 1e-16);
    pal_surface_free(&s);
}

static void welding_joins_triangle_soup_within_the_tolerance_only(void)
{
    for (int far = 0; far < 2; far++) {
        pal_surface c = cube(), s = {0};
        s.x = malloc(sizeof(double) * 108);
        s.tri = malloc(sizeof(int32_t) * 36);
        /* corners of a soup, each moved by its own 1e-7 */
        for (int k = 0; k < 36; k++) {
            const double *p = c.x + 3 * c.tri[k];
            double d = (far ? 1e-3 : 1e-7) * (k % 5);
            add_vertex(&s, p[0] + d, p[1] - d, p[2] + d);
            s.tri[k] = k;
        }
        s.n_tri = 12;
        pal_surface_report report = {0};
        pal_surface_topology topology;
        REQUIRE(pal_surface_clean(&s, 1e-6, &report, NULL) == PAL_ERR_OK);
        REQUIRE(pal_surface_check(&s, &topology) == PAL_ERR_OK);
        CHECK(topology.closed == !far);
        if (!far) CHECK_INT(s.n_vertex, 8);
        if (!far) CHECK_INT(report.n_welded, 28);
        pal_surface_free(&c);
        pal_surface_free(&s);
    }
}

/* copies of a vertex join wherever the cells of the search end, and vertices of ten times the tolerance never do */
static void welding_is_the_same_at_every_place_and_keeps_detail(void)
{
    enum { SIDE = 40 };
    const double eps = 1e-5, edge = 10 * eps;
    pal_surface s = {.x = malloc(sizeof(double) * 18 * SIDE * SIDE), .tri = malloc(sizeof(int32_t) * 6 * SIDE * SIDE)};
    uint64_t state = 3;
    REQUIRE(s.x && s.tri);
    /* a sheet whose edges are ten times the tolerance, each corner of each triangle moved by up to 0.28 of it along
     * each axis, so that two copies of a vertex are at most 0.97 of it apart */
    for (int j = 0; j + 1 < SIDE; j++)
        for (int i = 0; i + 1 < SIDE; i++)
            for (int k = 0; k < 6; k++) {
                static const int at[6][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}};
                double x[3] = {edge * (i + at[k][0]), edge * (j + at[k][1]), 0};
                for (int a = 0; a < 3; a++) x[a] += 0.28 * eps * random_signed(&state);
                s.tri[3 * s.n_tri + k % 3] = s.n_vertex;
                add_vertex(&s, x[0], x[1], x[2]);
                if (k % 3 == 2) s.n_tri++;
            }
    double low[3], high[3];
    pal_surface_box(&s, low, high);
    pal_surface_report report = {0};
    pal_surface_topology topology;
    REQUIRE(!pal_surface_clean(&s, eps / pal_dist3(low, high), &report, NULL));
    REQUIRE(!pal_surface_check(&s, &topology));
    CHECK_INT(s.n_tri, 2 * (SIDE - 1) * (SIDE - 1));
    CHECK_INT(s.n_vertex, SIDE * SIDE);
    CHECK_INT(topology.n_open_edge, 4 * (SIDE - 1));
    CHECK(topology.manifold && report.max_weld_m < 0.97 * eps && report.max_weld_m > 0.5 * eps);
    pal_surface_free(&s);
}

static void a_fin_vanishes_but_a_body_drawn_twice_stays(void)
{
    /* two triangles back to back between a corner edge of the cube and a point outside */
    pal_surface s = cube();
    grow(&s, 9, 24);
    add_vertex(&s, -1, -1, 0.5);
    add_tri(&s, 0, 4, 8);
    add_tri(&s, 4, 0, 8);
    pal_surface_report report = {0};
    pal_surface_topology topology;
    REQUIRE(pal_surface_clean(&s, 0, &report, NULL) == PAL_ERR_OK);
    REQUIRE(pal_surface_check(&s, &topology) == PAL_ERR_OK);
    CHECK_INT(s.n_tri, 12);
    CHECK_INT(s.n_vertex, 8);
    CHECK_INT(report.n_duplicate, 1);
    CHECK_INT(report.n_folded, 1);
    CHECK(topology.closed && topology.manifold);
    /* every triangle again, the other way round */
    grow(&s, 8, 24);
    for (int t = 0; t < 12; t++) add_tri(&s, s.tri[3 * t + 1], s.tri[3 * t], s.tri[3 * t + 2]);
    report = (pal_surface_report){0};
    REQUIRE(pal_surface_clean(&s, 0, &report, NULL) == PAL_ERR_OK);
    CHECK_INT(s.n_tri, 12);
    CHECK_INT(report.n_duplicate, 12);
    CHECK_INT(report.n_folded, 0);
    CHECK_NEAR(pal_surface_volume(&s), 1, 1e-15);
    pal_surface_free(&s);
}

static void flat_triangles_are_mended_without_a_slit(void)
{
    /* two more corners on the edge 0-1, joined to it by flat triangles, one upon the other */
    pal_surface s = cube();
    grow(&s, 10, 20);
    add_vertex(&s, 0.5, 0, 0);
    add_vertex(&s, 0.25, 0, 0);
    int found = 0;
    for (int t = 0; t < 12; t++)
        for (int k = 0; k < 3; k++) found += s.tri[3 * t + k] == 0 && s.tri[3 * t + (k + 1) % 3] == 1;
    REQUIRE(found == 1);
    for (int t = 0; t < 12; t++)
        for (int k = 0; k < 3; k++)
            if (s.tri[3 * t + k] == 0 && s.tri[3 * t + (k + 1) % 3] == 1) {
                /* 0-1-d becomes 0-9, 9-8, 8-1 with two flat triangles between that and the other side's edge 1-0 */
                int d = s.tri[3 * t + (k + 2) % 3];
                s.tri[3 * t] = 0, s.tri[3 * t + 1] = 9, s.tri[3 * t + 2] = d;
                add_tri(&s, 9, 8, d);
                add_tri(&s, 8, 1, d);
                add_tri(&s, 0, 1, 8);
                add_tri(&s, 0, 8, 9);
                t = k = 12;
            }
    pal_surface_report report = {0};
    pal_surface_topology topology;
    REQUIRE(pal_surface_check(&s, &topology) == PAL_ERR_OK);
    REQUIRE(topology.closed && topology.oriented && topology.manifold);
    REQUIRE(pal_surface_clean(&s, 0, &report, NULL) == PAL_ERR_OK);
    REQUIRE(pal_surface_check(&s, &topology) == PAL_ERR_OK);
    CHECK(topology.closed && topology.oriented && topology.manifold);
    CHECK_INT(report.n_repaired, 2);
    CHECK_INT(report.n_degenerate, 0);
    CHECK_INT(s.n_tri, 16);
    CHECK_NEAR(pal_surface_volume(&s), 1, 1e-14);
    CHECK_NEAR(pal_surface_area(&s), 6, 1e-14);
    pal_surface_free(&s);
}

/* a double pyramid with a corner in the middle of one edge at its tip and a flat triangle beside it */
static void flat_triangles_at_a_crowded_vertex_are_dropped(void)
{
    for (int m = 20; m <= 80; m += 60) {
        double *x = malloc(3 * sizeof *x * (size_t)(m + 3));
        int32_t *tri = malloc(3 * sizeof *tri * (size_t)(2 * m + 2)), n = 0;
        const double fixed[9] = {0, 0, 1, 0, 0, -1, 0.5, 0, 0.5};
        memcpy(x, fixed, sizeof fixed);
        for (int i = 0; i < m; i++) {
            double a = 6.283185307179586 * i / m, ring[3] = {cos(a), sin(a), 0};
            int32_t r = 3 + i, q = 3 + (i + 1) % m, up[2][3] = {{0, r, q}, {1, q, r}};
            memcpy(x + 3 * r, ring, sizeof ring);
            memcpy(tri + 3 * n, up, sizeof up);
            n += 2;
        }
        const int32_t around[3][3] = {{0, 2, 4}, {2, 3, 4}, {0, 3, 2}};
        memcpy(tri, around[0], sizeof around[0]);
        memcpy(tri + 3 * n, around[1], 2 * sizeof around[1]);
        pal_surface s = {.n_vertex = m + 3, .n_tri = n + 2, .x = x, .tri = tri};
        pal_surface_report report = {0};
        REQUIRE(!pal_surface_clean(&s, 0, &report, NULL));
        CHECK_INT(report.n_repaired, m == 20);
        CHECK_INT(report.n_degenerate, m == 80);
        pal_surface_free(&s);
    }
}

static void nothing_left_is_refused_with_counts(void)
{
    pal_surface s = cube();
    s.n_tri = 1;
    s.tri[1] = s.tri[0];
    pal_diagnostic diag = {{0}};
    CHECK_INT(pal_surface_clean(&s, 0, NULL, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "no triangle is left: 1 without area, 0 doubled, 0 not finite");
    pal_surface_free(&s);
}

int main(void)
{
    RUN(cube_has_volume_one_and_area_six);
    RUN(cube_is_closed_manifold_and_oriented);
    RUN(shared_edge_and_shared_vertex_are_not_manifold);
    RUN(fans_list_every_triangle_at_each_of_its_corners);
    RUN(cleaning_counts_each_kind_of_fault);
    RUN(cleaning_recentres_and_keeps_far_positions);
    RUN(welding_joins_triangle_soup_within_the_tolerance_only);
    RUN(welding_is_the_same_at_every_place_and_keeps_detail);
    RUN(a_fin_vanishes_but_a_body_drawn_twice_stays);
    RUN(flat_triangles_are_mended_without_a_slit);
    RUN(flat_triangles_at_a_crowded_vertex_are_dropped);
    RUN(nothing_left_is_refused_with_counts);
    return check_report();
}
