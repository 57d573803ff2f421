/* The winding number of the box tree against analytic answers. */
#include "server/mesh/geometry/box_tree.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/shapes.h"

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
    double p[3] = {3, 0, 0};
    CHECK(isfinite(pal_box_tree_winding(tree, p)));
    pal_box_tree_destroy(tree);
    s.n_tri = 0;
    REQUIRE(!pal_box_tree_create(&s, &tree));
    CHECK_NEAR(pal_box_tree_winding(tree, p), 0, 0);
    pal_box_tree_destroy(tree);
    pal_surface_free(&s);
}

int main(void)
{
    RUN(winding_number_is_one_inside_and_nought_outside);
    RUN(triangles_without_numbers_are_left_out);
    return check_report();
}
