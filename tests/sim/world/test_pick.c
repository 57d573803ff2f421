/* Picking: the nearest point of two triangles of a unit square, moved and at rest. */
#include "server/sim/world/pick.h"
#include "tests/check.h"

static const float rest[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
static const int32_t tri[9] = {0, 1, 2, 0, 2, 3, 0, 0, 0};

static pal_shown square(void)
{
    return (pal_shown){.name = "square", .n_vertex = 4, .n_tri = 3, .rest_m = rest, .tri = tri};
}

static void inside_a_triangle_the_foot_of_the_perpendicular_is_found(void)
{
    pal_shown shown = square();
    pal_pick pick;
    REQUIRE(pal_pick_nearest(&shown, NULL, (double[3]){0.75, 0.25, 0.5}, &pick));
    CHECK_INT(pick.triangle, 0);
    CHECK_INT(pick.face, -1);
    CHECK_NEAR(pick.distance_m, 0.5, 1e-12);
    CHECK_NEAR(pick.rest_m[0], 0.75, 1e-12);
    CHECK_NEAR(pick.rest_m[1], 0.25, 1e-12);
    CHECK_NEAR(pick.weight[0] + pick.weight[1] + pick.weight[2], 1, 1e-12);
}

static void outside_the_nearest_edge_or_corner_is_found(void)
{
    pal_shown shown = square();
    pal_pick pick;
    REQUIRE(pal_pick_nearest(&shown, NULL, (double[3]){0.5, -3, 4}, &pick));
    CHECK_NEAR(pick.distance_m, 5, 1e-12);
    CHECK_NEAR(pick.rest_m[0], 0.5, 1e-12);
    CHECK_NEAR(pick.rest_m[1], 0, 1e-12);
    REQUIRE(pal_pick_nearest(&shown, NULL, (double[3]){-2, 3, 0}, &pick));
    CHECK_INT(pick.triangle, 1);
    CHECK_NEAR(pick.distance_m, sqrt(8), 1e-12);
    CHECK_NEAR(pick.weight[2], 1, 1e-12);
}

static void the_surface_is_searched_where_it_is_shown_and_answered_at_rest(void)
{
    pal_shown shown = square();
    float moved[12];
    pal_pick pick;
    for (int i = 0; i < 12; i++) moved[i] = rest[i] + (i % 3 == 2 ? 10 : 0);
    REQUIRE(pal_pick_nearest(&shown, moved, (double[3]){0.25, 0.5, 10.5}, &pick));
    CHECK_NEAR(pick.distance_m, 0.5, 1e-12);
    CHECK_NEAR(pick.rest_m[0], 0.25, 1e-12);
    CHECK_NEAR(pick.rest_m[2], 0, 1e-12);
}

static void triangles_without_a_control_face_and_empty_slots_do_not_count(void)
{
    static const int32_t face[3] = {-1, 7, 3}, none[3] = {-1, -1, -1};
    pal_shown shown = square();
    pal_pick pick;
    shown.face = face;
    REQUIRE(pal_pick_nearest(&shown, NULL, (double[3]){1, 0, 0}, &pick));
    CHECK_INT(pick.triangle, 1);
    CHECK_INT(pick.face, 7);
    CHECK_NEAR(pick.distance_m, sqrt(0.5), 1e-12);
    shown.face = none;
    CHECK(!pal_pick_nearest(&shown, NULL, (double[3]){1, 0, 0}, &pick));
}

int main(void)
{
    RUN(inside_a_triangle_the_foot_of_the_perpendicular_is_found);
    RUN(outside_the_nearest_edge_or_corner_is_found);
    RUN(the_surface_is_searched_where_it_is_shown_and_answered_at_rest);
    RUN(triangles_without_a_control_face_and_empty_slots_do_not_count);
    return check_report();
}
