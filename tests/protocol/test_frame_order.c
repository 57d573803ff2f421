/* Vertex order and predictor: valid for any surface, exact where it should be, refused where it is not. */
#include "protocol/frame_order.h"
#include "tests/check.h"
#include "tests/protocol/frame_shapes.h"

/* what a decoder trusts, and that each vertex is in a level behind those of its neighbours */
static pal_frame_order *checked(pal_frame_order *o, uint32_t n)
{
    CHECK_INT(pal_frame_order_check(o), 0);
    CHECK_INT(o->n_vertex, n);
    CHECK_INT(o->level_begin[0], 0);
    CHECK_INT(o->level_begin[o->n_level], n);
    uint32_t late = 0;
    for (uint32_t level = 1; level < o->n_level; level++)
        for (uint32_t i = o->level_begin[level]; i < o->level_begin[level + 1]; i++)
            for (int j = 0; j < 4; j++) late += o->neighbour[4 * i + (uint32_t)j] >= o->level_begin[level];
    CHECK_INT(late, 0);
    return o;
}

static pal_frame_order *made(const float *rest, uint32_t n, const uint32_t *triangle, uint32_t n_triangle)
{
    pal_frame_order *o = NULL;
    CHECK_INT(pal_frame_order_create(rest, n, triangle, n_triangle, &o), 0);
    return o ? checked(o, n) : NULL;
}

static void closed_surface_has_about_21_levels_and_a_small_base(void)
{
    shape s = shape_create(70);
    pal_frame_order *o = made(s.rest_m, s.n_vertex, s.triangle, s.n_triangle);
    REQUIRE(o);
    printf("  %u vertices, %u levels, base of %u\n", o->n_vertex, o->n_level, o->level_begin[1]);
    CHECK_LE(o->n_level, 40);
    CHECK_LE(o->level_begin[1], 25);
    uint32_t none = 0;
    for (uint32_t i = 0; i < o->n_vertex; i++) none += o->weight[4 * i] == 0;
    CHECK_INT(none, 1); /* only the very first vertex has no prediction */
    pal_frame_order_destroy(o);
    shape_release(&s);
}

static void predicts_a_shear_within_a_tenth_of_a_step(void)
{
    enum { SIDE = 21, N = SIDE * SIDE };
    static float rest[3 * N];
    static uint32_t triangle[6 * (SIDE - 1) * (SIDE - 1)];
    uint32_t n = 0;
    for (uint32_t i = 0; i < N; i++) {
        rest[3 * i] = 0.01f * (float)(i % SIDE);
        rest[3 * i + 1] = 0.01f * (float)(i / SIDE);
    }
    for (uint32_t y = 0; y + 1 < SIDE; y++)
        for (uint32_t x = 0; x + 1 < SIDE; x++) {
            uint32_t a = y * SIDE + x;
            const uint32_t two[6] = {a, a + 1, a + SIDE, a + 1, a + SIDE + 1, a + SIDE};
            memcpy(triangle + n, two, sizeof two);
            n += 6;
        }
    pal_frame_order *o = made(rest, N, triangle, n / 3);
    REQUIRE(o);
    /* a shear of 0.1: the regularised prediction of inner vertices misses far less than the nearest vertex would */
    double sum = 0, sum_near = 0;
    for (uint32_t i = o->level_begin[1]; i < N; i++) {
        double u = 0.1 * (double)rest[3 * o->vertex_of[i]], p = 0, nearest = INFINITY;
        for (uint32_t j = 0; j < 4; j++) {
            double near = 0.1 * (double)rest[3 * o->vertex_of[o->neighbour[4 * i + j]]];
            p += o->weight[4 * i + j] / 4096.0 * near;
            if (o->weight[4 * i + j] && fabs(u - near) < nearest) nearest = fabs(u - near);
        }
        sum += fabs(u - p);
        sum_near += 0.1 * 0.01;
    }
    printf("  mean miss %.3g of the step between vertices\n", sum / sum_near);
    CHECK_LE(sum, 0.1 * sum_near);
    pal_frame_order_destroy(o);
}

static void works_for_tiny_loose_and_degenerate_surfaces(void)
{
    const float point[15] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    const uint32_t one[3] = {0, 1, 2}, same[6] = {0, 0, 0, 1, 1, 2}, twice[6] = {0, 1, 2, 2, 1, 0};
    pal_frame_order_destroy(made(point, 1, NULL, 0));
    pal_frame_order_destroy(made(point, 2, NULL, 0));
    pal_frame_order_destroy(made(point, 3, one, 1));
    pal_frame_order_destroy(made(point, 5, one, 1));
    pal_frame_order_destroy(made(point, 5, same, 2));
    pal_frame_order_destroy(made(point, 4, twice, 2));

    /* all vertices at one place */
    static float zero[3 * 200];
    static uint32_t strip[3 * 198];
    for (uint32_t t = 0; t < 198; t++) strip[3 * t] = t, strip[3 * t + 1] = t + 1, strip[3 * t + 2] = t + 2;
    pal_frame_order_destroy(made(zero, 200, strip, 198));
}

static void works_for_many_components_and_hubs(void)
{
    enum { N = 30000 };
    float *rest = malloc(3 * N * sizeof *rest);
    uint32_t *triangle = malloc(3 * N * sizeof *triangle);
    uint64_t random = 5;
    for (int i = 0; i < 3 * N; i++) rest[i] = (float)shape_random(&random);
    /* 10,000 loose triangles */
    for (uint32_t i = 0; i < N; i++) triangle[i] = i;
    pal_frame_order_destroy(made(rest, N, triangle, N / 3));
    /* one fan round a hub, whose edges are all non-manifold with a second hub */
    for (uint32_t t = 0; t + 3 < N; t++)
        triangle[3 * t] = t & 1, triangle[3 * t + 1] = t + 2, triangle[3 * t + 2] = t + 3;
    pal_frame_order_destroy(made(rest, N, triangle, N - 3));
    /* noise: any three vertices */
    for (uint32_t e = 0; e < 3 * N; e++) triangle[e] = (uint32_t)((shape_random(&random) + 1) * 0.499 * N);
    pal_frame_order_destroy(made(rest, N, triangle, N));
    free(rest);
    free(triangle);
}

static void refuses_what_is_no_surface(void)
{
    const float bad[9] = {0, 0, 0, NAN, 0, 0, 0, 1, 0}, good[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const uint32_t outside[3] = {0, 1, 3}, one[3] = {0, 1, 2};
    pal_frame_order *o = NULL;
    CHECK_INT(pal_frame_order_create(bad, 3, one, 1, &o), PAL_REFUSAL_NAN);
    CHECK_INT(pal_frame_order_create(good, 3, outside, 1, &o), PAL_REFUSAL_RANGE);
    CHECK_INT(pal_frame_order_create(good, 0, NULL, 0, &o), PAL_REFUSAL_COUNT);
    CHECK_INT(pal_frame_order_create(good, PAL_ORDER_VERTEX_MAX + 1, one, 1, &o), PAL_REFUSAL_COUNT);
    CHECK(o == NULL);
}

static void midpoints_follow_the_coarse_order_as_the_mean_of_their_parents(void)
{
    shape s = shape_create(4);
    shape_family f = shape_family_create(4, 4);
    const uint32_t n = f.fine.n_vertex;
    pal_frame_order *coarse = made(s.rest_m, s.n_vertex, s.triangle, s.n_triangle), *o = NULL;
    REQUIRE(coarse && s.n_vertex == f.n_coarse);
    REQUIRE(pal_frame_order_hierarchy(f.fine.rest_m, n, f.n_coarse, f.parent, s.triangle, s.n_triangle, &o) == 0);
    checked(o, n);
    CHECK_INT(o->n_level, coarse->n_level + 3);
    CHECK(memcmp(o->vertex_of, coarse->vertex_of, f.n_coarse * sizeof *o->vertex_of) == 0);
    CHECK(memcmp(o->neighbour, coarse->neighbour, 4 * (size_t)f.n_coarse * sizeof *o->neighbour) == 0);
    uint32_t wrong = 0;
    for (uint32_t i = f.n_coarse; i < n; i++) {
        const uint32_t *p = f.parent + 2 * (size_t)(i - f.n_coarse);
        const int16_t *w = o->weight + 4 * (size_t)i;
        wrong += o->vertex_of[i] != i || w[0] != 2048 || w[1] != 2048 || w[2] || w[3];
        for (uint32_t k = 0; k < 2; k++) wrong += o->vertex_of[o->neighbour[4 * i + k]] != p[k];
    }
    CHECK_INT(wrong, 0);
    pal_frame_order_destroy(o);
    /* nothing but coarse vertices is the ordinary order */
    REQUIRE(pal_frame_order_hierarchy(s.rest_m, s.n_vertex, s.n_vertex, NULL, s.triangle, s.n_triangle, &o) == 0);
    checked(o, s.n_vertex);
    CHECK_INT(o->n_level, coarse->n_level);
    pal_frame_order_destroy(o);
    pal_frame_order_destroy(coarse);
    /* what is no family */
    o = NULL;
    f.parent[1] = f.n_coarse;
    CHECK_INT(pal_frame_order_hierarchy(f.fine.rest_m, n, f.n_coarse, f.parent, s.triangle, s.n_triangle, &o),
              PAL_REFUSAL_RANGE);
    CHECK_INT(pal_frame_order_hierarchy(f.fine.rest_m, n, n + 1, f.parent, s.triangle, s.n_triangle, &o),
              PAL_REFUSAL_COUNT);
    CHECK_INT(pal_frame_order_hierarchy(f.fine.rest_m, n, 0, f.parent, s.triangle, s.n_triangle, &o),
              PAL_REFUSAL_COUNT);
    f.parent[1] = 0;
    f.fine.rest_m[3 * (size_t)n - 1] = NAN;
    CHECK_INT(pal_frame_order_hierarchy(f.fine.rest_m, n, f.n_coarse, f.parent, s.triangle, s.n_triangle, &o),
              PAL_REFUSAL_NAN);
    CHECK(o == NULL);
    free(f.parent);
    shape_release(&f.fine);
    shape_release(&s);
}

static void check_finds_every_broken_table(void)
{
    shape s = shape_create(4);
    pal_frame_order *o = made(s.rest_m, s.n_vertex, s.triangle, s.n_triangle);
    REQUIRE(o);
    uint32_t last = o->n_vertex - 1, kept = o->vertex_of[last];
    o->vertex_of[last] = o->vertex_of[0];
    CHECK_INT(pal_frame_order_check(o), PAL_REFUSAL_ORDER);
    o->vertex_of[last] = o->n_vertex;
    CHECK_INT(pal_frame_order_check(o), PAL_REFUSAL_ORDER);
    o->vertex_of[last] = kept;
    kept = o->neighbour[4 * last];
    o->neighbour[4 * last] = last;
    CHECK_INT(pal_frame_order_check(o), PAL_REFUSAL_ORDER);
    o->neighbour[4 * last] = kept;
    o->weight[4 * last]++;
    CHECK_INT(pal_frame_order_check(o), PAL_REFUSAL_ORDER);
    o->weight[4 * last]--;
    CHECK_INT(pal_frame_order_check(o), PAL_REFUSAL_NONE);
    const int16_t extreme[4] = {8000, -3904, 0, 0};
    memcpy(o->weight + 4 * last, extreme, sizeof extreme);
    memset(o->neighbour + 4 * last, 0, 4 * sizeof *o->neighbour);
    CHECK_INT(pal_frame_order_check(o), PAL_REFUSAL_ORDER);
    pal_frame_order_destroy(o);
    shape_release(&s);
}

static void real_organs_get_a_valid_order(void)
{
    static const char *const name[] = {"data/liver_vhf_4k.obj", "data/stomach_188.obj"};
    for (int k = 0; k < 2; k++) {
        const char *path = check_shared(name[k]);
        FILE *file = path ? fopen(path, "r") : NULL;
        if (!file) continue;
        size_t n_vertex = 0, n_triangle = 0, cap = 200000;
        float *rest = malloc(3 * cap * sizeof *rest);
        uint32_t *triangle = malloc(3 * cap * sizeof *triangle);
        char line[256];
        while (fgets(line, sizeof line, file)) {
            float *p = rest + 3 * n_vertex;
            uint32_t *t = triangle + 3 * n_triangle;
            if (line[0] == 'v' && line[1] == ' ' && n_vertex < cap)
                n_vertex += sscanf(line + 2, "%f %f %f", p, p + 1, p + 2) == 3;
            if (line[0] == 'f' && n_triangle < cap &&
                (sscanf(line + 2, "%u %u %u", t, t + 1, t + 2) == 3 ||
                 sscanf(line + 2, "%u/%*[^ ] %u/%*[^ ] %u", t, t + 1, t + 2) == 3)) {
                for (int c = 0; c < 3; c++) t[c]--;
                n_triangle++;
            }
        }
        fclose(file);
        pal_frame_order_destroy(made(rest, (uint32_t)n_vertex, triangle, (uint32_t)n_triangle));
        printf("  %s: %zu vertices, %zu triangles\n", name[k], n_vertex, n_triangle);
        free(rest);
        free(triangle);
    }
}

int main(void)
{
    RUN(closed_surface_has_about_21_levels_and_a_small_base);
    RUN(predicts_a_shear_within_a_tenth_of_a_step);
    RUN(works_for_tiny_loose_and_degenerate_surfaces);
    RUN(works_for_many_components_and_hubs);
    RUN(refuses_what_is_no_surface);
    RUN(midpoints_follow_the_coarse_order_as_the_mean_of_their_parents);
    RUN(check_finds_every_broken_table);
    RUN(real_organs_get_a_valid_order);
    return check_report();
}
