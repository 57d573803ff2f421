/* The box tree against analytic answers and against looking at every triangle. */
#include "server/mesh/geometry/box_tree.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/shapes.h"

static void rays_from_the_centre_meet_the_sphere_at_its_radius(void)
{
    pal_surface s = shape_ball(1, 96, 48, 0);
    pal_box_tree *tree;
    REQUIRE(!pal_box_tree_create(&s, &tree));
    uint64_t state = 1;
    for (int k = 0; k < 500; k++) {
        double a[3] = {0, 0, 0}, d[3], n = 0;
        for (int i = 0; i < 3; i++) d[i] = random_signed(&state), n += d[i] * d[i];
        for (int i = 0; i < 3; i++) d[i] /= sqrt(n);
        int tri = -1;
        CHECK_NEAR(pal_box_tree_ray(tree, a, d, 2, &tri), 1, 0.003);
        CHECK(tri >= 0 && tri < s.n_tri);
        CHECK(pal_box_tree_ray(tree, a, d, 0.9, NULL) < 0);
        double b[3] = {1.5 * d[0], 1.5 * d[1], 1.5 * d[2]}, c[3] = {0.5 * d[0], 0.5 * d[1], 0.5 * d[2]};
        CHECK(pal_box_tree_segment(tree, a, b, &tri));
        CHECK(!pal_box_tree_segment(tree, a, c, NULL));
    }
    pal_box_tree_destroy(tree);
    pal_surface_free(&s);
}

static void rays_through_edges_and_corners_meet_the_cube(void)
{
    pal_surface s = shape_cube(2);
    pal_box_tree *tree;
    REQUIRE(!pal_box_tree_create(&s, &tree));
    /* along axes (through face diagonals), through edges' middles and corners */
    for (int x = -1; x <= 1; x++)
        for (int y = -1; y <= 1; y++)
            for (int z = -1; z <= 1; z++) {
                double n = sqrt(x * x + y * y + z * z), a[3] = {0, 0, 0}, d[3] = {x / n, y / n, z / n};
                if (n == 0) continue;
                CHECK_NEAR(pal_box_tree_ray(tree, a, d, 5, NULL), n, 1e-12);
                double b[3] = {3.0 * x, 3.0 * y, 3.0 * z};
                CHECK(pal_box_tree_segment(tree, a, b, NULL));
            }
    pal_box_tree_destroy(tree);
    pal_surface_free(&s);
}

static void nearest_points_of_a_cube_are_exact(void)
{
    pal_surface s = shape_cube(2);
    pal_box_tree *tree;
    REQUIRE(!pal_box_tree_create(&s, &tree));
    uint64_t state = 2;
    for (int k = 0; k < 2000; k++) {
        double p[3], q[3], want = 0, inside = 3;
        for (int i = 0; i < 3; i++) {
            p[i] = 3 * random_signed(&state);
            double out = fmax(0, fabs(p[i]) - 1);
            want += out * out;
            inside = fmin(inside, 1 - fabs(p[i]));
        }
        want = inside > 0 ? inside : sqrt(want);
        int tri = -1;
        CHECK_NEAR(pal_box_tree_nearest(tree, p, q, &tri), want, 1e-12);
        double d = 0;
        for (int i = 0; i < 3; i++) d += (p[i] - q[i]) * (p[i] - q[i]);
        CHECK_NEAR(sqrt(d), want, 1e-12);
        CHECK(tri >= 0);
    }
    pal_box_tree_destroy(tree);
    pal_surface_free(&s);
}

static void winding_number_is_one_inside_and_nought_outside(void)
{
    pal_surface s = shape_ball(1, 64, 32, 0.2);
    pal_box_tree *tree;
    REQUIRE(!pal_box_tree_create(&s, &tree));
    uint64_t state = 3;
    for (int k = 0; k < 500; k++) {
        double p[3], n = 0;
        for (int i = 0; i < 3; i++) p[i] = 1.6 * random_signed(&state), n += p[i] * p[i];
        n = sqrt(n);
        if (n > 0.79 && n < 1.21) continue;
        CHECK_NEAR(pal_box_tree_winding(tree, p), n < 1 ? 1 : 0, 0.03);
    }
    pal_box_tree_destroy(tree);

    /* half a sphere seen from its centre is a half; two shells count two; turned about, minus one */
    pal_surface half = shape_ball(1, 64, 32, 0);
    shape_cut(&half, 0);
    double o[3] = {0, 0, 0};
    REQUIRE(!pal_box_tree_create(&half, &tree));
    CHECK_NEAR(pal_box_tree_winding(tree, o), 0.5, 0.01);
    pal_box_tree_destroy(tree);
    pal_surface two = shape_join(shape_sphere(1), shape_sphere(0.5));
    REQUIRE(!pal_box_tree_create(&two, &tree));
    CHECK_NEAR(pal_box_tree_winding(tree, o), 2, 0.05);
    pal_box_tree_destroy(tree);
    shape_invert(&s);
    REQUIRE(!pal_box_tree_create(&s, &tree));
    CHECK_NEAR(pal_box_tree_winding(tree, o), -1, 0.02);
    pal_box_tree_destroy(tree);
    pal_surface_free(&s);
    pal_surface_free(&half);
    pal_surface_free(&two);
}

static void triangles_without_numbers_are_left_out(void)
{
    pal_surface s = shape_cube(2);
    s.x[0] = NAN;
    pal_box_tree *tree;
    REQUIRE(!pal_box_tree_create(&s, &tree));
    double p[3] = {3, 0, 0}, q[3];
    CHECK_NEAR(pal_box_tree_nearest(tree, p, q, NULL), 2, 1e-12);
    pal_box_tree_destroy(tree);
    s.n_tri = 0;
    REQUIRE(!pal_box_tree_create(&s, &tree));
    CHECK(isinf(pal_box_tree_nearest(tree, p, q, NULL)));
    CHECK(!pal_box_tree_segment(tree, p, q, NULL));
    CHECK_NEAR(pal_box_tree_winding(tree, p), 0, 0);
    pal_box_tree_destroy(tree);
    pal_surface_free(&s);
}

int main(void)
{
    RUN(rays_from_the_centre_meet_the_sphere_at_its_radius);
    RUN(rays_through_edges_and_corners_meet_the_cube);
    RUN(nearest_points_of_a_cube_are_exact);
    RUN(winding_number_is_one_inside_and_nought_outside);
    RUN(triangles_without_numbers_are_left_out);
    return check_report();
}
