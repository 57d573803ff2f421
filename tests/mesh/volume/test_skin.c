/* Skinning: rest, rigid motion, vertices on nodes, weights, flattened and inverted neighbourhoods. */
#include "server/base/vec3.h"
#include "server/mesh/volume/skin.h"
#include "server/mesh/voxel/voxels.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/shapes.h"
#include "tests/stability/hard_case.h"

typedef struct bound {
    pal_surface surface;
    pal_tets tets;
    pal_skin skin;
    double *x;    /* node positions to deform */
    void *frames; /* filled at rest           */
    float *out;
} bound;

static bool bind_surface(pal_surface surface, int resolution, bound *b)
{
    pal_diagnostic diag;
    pal_voxels v;
    pal_voxel_options options = {.resolution = resolution, .border = true};
    b->surface = surface;
    if (pal_voxels_fill(&surface, &options, &v, NULL, &diag) || pal_voxels_split(&v, &b->tets)) return false;
    pal_voxels_free(&v);
    if (pal_skin_bind(&b->tets, surface.x, surface.n_vertex, &b->skin)) return false;
    size_t n = 3 * (size_t)b->tets.n_node;
    b->x = malloc(n * sizeof *b->x);
    b->frames = calloc((size_t)b->skin.n_frame, 64);
    b->out = malloc(3 * (size_t)surface.n_vertex * sizeof *b->out);
    if (!b->x || !b->frames || !b->out) return false;
    memcpy(b->x, b->tets.x, n * sizeof *b->x);
    pal_skin_frames(&b->skin, b->x, NULL, b->frames);
    return true;
}

static void unbind(bound *b)
{
    pal_surface_free(&b->surface);
    pal_tets_free(&b->tets);
    pal_skin_free(&b->skin);
    free(b->x);
    free(b->frames);
    free(b->out);
}

static void show(bound *b)
{
    pal_skin_frames(&b->skin, b->x, NULL, b->frames);
    pal_skin_evaluate(&b->skin, b->frames, NULL, b->out);
}

/* largest distance between the shown vertices and want [n][3] */
static double largest_error(const bound *b, const double *want)
{
    double max = 0;
    for (int v = 0; v < b->surface.n_vertex; v++) {
        double d[3];
        for (int k = 0; k < 3; k++) d[k] = (double)b->out[3 * v + k] - want[3 * v + k];
        max = fmax(max, pal_norm3(d));
    }
    return max;
}

static void rest_gives_the_rest_surface(void)
{
    bound b;
    REQUIRE(bind_surface(shape_ball(0.1, 80, 40, 0.2), 14, &b));
    show(&b);
    CHECK_LE(largest_error(&b, b.surface.x), 1e-6 * 0.35);
    unbind(&b);
    REQUIRE(bind_surface(shape_torus(50, 20, 60, 30), 20, &b));
    show(&b);
    CHECK_LE(largest_error(&b, b.surface.x), 1e-6 * 200);
    unbind(&b);
}

static void threads_do_not_change_a_bit(void)
{
    bound b;
    REQUIRE(bind_surface(shape_ball(0.1, 80, 40, 0.2), 14, &b));
    uint64_t state = 3;
    for (int i = 0; i < 3 * b.tets.n_node; i++) b.x[i] += 0.003 * random_signed(&state);
    const size_t n_byte = 3 * sizeof *b.out * (size_t)b.surface.n_vertex;
    float *one = malloc(n_byte);
    REQUIRE(one);
    show(&b);
    memcpy(one, b.out, n_byte);
    for (int threads = 2; threads <= 3; threads++) {
        pal_team *team;
        REQUIRE(!pal_team_create(threads, &team));
        memset(b.frames, 0, pal_skin_frames_bytes(&b.skin));
        pal_skin_frames(&b.skin, b.x, team, b.frames);
        pal_skin_evaluate(&b.skin, b.frames, team, b.out);
        CHECK(memcmp(one, b.out, n_byte) == 0);
        pal_team_destroy(team);
    }
    free(one);
    unbind(&b);
}

static void weights_follow_the_inverse_square_and_sum_to_one(void)
{
    bound b;
    REQUIRE(bind_surface(shape_ball(0.1, 40, 20, 0.2), 10, &b));
    for (int v = 0; v < b.skin.n_vertex; v++) {
        double sum = 0, inverse[5], total = 0;
        for (int k = 0; k < 5; k++) {
            const double *node = b.tets.x + 3 * b.skin.frame[b.skin.near[5 * v + k]];
            double d = pal_dist3(node, b.surface.x + 3 * v);
            sum += (double)b.skin.coef[4 * (5 * v + k) + 3];
            total += inverse[k] = 1 / (d * d);
        }
        CHECK_NEAR(sum, 1, 1e-6);
        for (int k = 0; k < 5; k++) CHECK_NEAR((double)b.skin.coef[4 * (5 * v + k) + 3], inverse[k] / total, 1e-6);
    }
    unbind(&b);
}

static void rigid_motion_of_the_nodes_moves_the_surface_rigidly(void)
{
    bound b;
    uint64_t state = 2;
    REQUIRE(bind_surface(shape_ball(0.1, 60, 30, 0.3), 12, &b));
    double *want = malloc(3 * (size_t)b.surface.n_vertex * sizeof *want);
    REQUIRE(want);
    for (int k = 0; k < 50; k++) {
        double q[4], n = 0, move[3];
        for (int i = 0; i < 4; i++) q[i] = random_signed(&state), n += q[i] * q[i];
        for (int i = 0; i < 4; i++) q[i] /= sqrt(n);
        for (int i = 0; i < 3; i++) move[i] = 0.2 * random_signed(&state);
        for (int i = 0; i < b.tets.n_node; i++) {
            pal_quat_rotate(b.x + 3 * i, q, b.tets.x + 3 * i);
            pal_add3(b.x + 3 * i, b.x + 3 * i, move);
        }
        for (int v = 0; v < b.surface.n_vertex; v++) {
            pal_quat_rotate(want + 3 * v, q, b.surface.x + 3 * v);
            pal_add3(want + 3 * v, want + 3 * v, move);
        }
        show(&b);
        CHECK_LE(largest_error(&b, want), 1e-6 * 0.5);
    }
    free(want);
    unbind(&b);
}

static void a_vertex_on_a_node_gets_it_exactly(void)
{
    bound b;
    uint64_t state = 3;
    REQUIRE(bind_surface(shape_ball(0.1, 20, 10, 0), 8, &b));
    /* the nodes of the frames themselves are shown */
    int n = b.skin.n_frame;
    double *x = malloc(3 * (size_t)n * sizeof *x);
    float *out = malloc(3 * (size_t)n * sizeof *out);
    REQUIRE(x && out);
    int32_t *node = malloc((size_t)n * sizeof *node);
    REQUIRE(node);
    for (int f = 0; f < n; f++) {
        node[f] = b.skin.frame[f];
        pal_copy3(x + 3 * f, b.tets.x + 3 * node[f]);
    }
    pal_skin on;
    REQUIRE(!pal_skin_bind(&b.tets, x, n, &on));
    void *frames = calloc((size_t)on.n_frame, 64);
    REQUIRE(frames);
    for (int k = 0; k < 5; k++) {
        for (int i = 0; i < 3 * b.tets.n_node; i++) b.x[i] = 0.2 * random_signed(&state);
        pal_skin_frames(&on, b.x, NULL, frames);
        pal_skin_evaluate(&on, frames, NULL, out);
        for (int f = 0; f < n; f++)
            for (int c = 0; c < 3; c++) CHECK(out[3 * f + c] == (float)b.x[3 * node[f] + c]);
    }
    free(x);
    free(out);
    free(node);
    free(frames);
    pal_skin_free(&on);
    unbind(&b);
}

static void one_vertex_is_the_same_as_all(void)
{
    bound b;
    uint64_t state = 4;
    REQUIRE(bind_surface(shape_ball(0.1, 40, 20, 0.2), 10, &b));
    for (int i = 0; i < 3 * b.tets.n_node; i++) b.x[i] += 0.003 * random_signed(&state);
    show(&b);
    for (int v = 0; v < b.surface.n_vertex; v += 7) {
        double one[3];
        pal_skin_vertex(&b.skin, b.x, b.frames, v, one);
        for (int k = 0; k < 3; k++) CHECK_NEAR(one[k], (double)b.out[3 * v + k], 1e-7);
    }
    unbind(&b);
}

/* all shown vertices finite and within reach of their nodes: at most the offsets' length away */
static void check_bounded(const bound *b)
{
    double max = 0;
    bool finite = true;
    for (int v = 0; v < b->surface.n_vertex; v++) {
        double min = 1e300;
        for (int k = 0; k < 5; k++) {
            double p[3] = {(double)b->out[3 * v], (double)b->out[3 * v + 1], (double)b->out[3 * v + 2]};
            finite &= pal_finite3(p);
            min = fmin(min, pal_dist3(p, b->x + 3 * b->skin.frame[b->skin.near[5 * v + k]]));
        }
        max = fmax(max, min);
    }
    CHECK(finite);
    CHECK_LE(max, 2 * b->tets.edge_m);
}

static void flat_inverted_and_collapsed_bodies_stay_finite_and_near(void)
{
    bound b;
    REQUIRE(bind_surface(shape_ball(0.1, 60, 30, 0.2), 12, &b));
    show(&b);
    for (int kind = 0; kind < 4; kind++) {
        double factor[4] = {0, 1e-9, -1, 1e-300};
        for (int i = 0; i < b.tets.n_node; i++) {
            double *x = b.x + 3 * i;
            pal_copy3(x, b.tets.x + 3 * i);
            x[2] *= factor[kind];
            if (kind == 3) x[0] *= 1e-300, x[1] *= 1e-300;
        }
        show(&b);
        check_bounded(&b);
    }
    /* back at rest the rest comes back */
    memcpy(b.x, b.tets.x, 3 * (size_t)b.tets.n_node * sizeof *b.x);
    show(&b);
    CHECK_LE(largest_error(&b, b.surface.x), 1e-6 * 0.35);
    unbind(&b);
}

/* largest motion of a shown vertex over the largest motion of a node since the last call */
static double jump(bound *b, float *before, double *x_before)
{
    double moved = 0, max = 0;
    memcpy(before, b->out, 3 * (size_t)b->surface.n_vertex * sizeof *before);
    for (int i = 0; i < b->tets.n_node; i++) moved = fmax(moved, pal_dist3(b->x + 3 * i, x_before + 3 * i));
    show(b);
    for (int v = 0; v < b->surface.n_vertex; v++) {
        double d[3];
        for (int k = 0; k < 3; k++) d[k] = (double)b->out[3 * v + k] - (double)before[3 * v + k];
        max = fmax(max, pal_norm3(d));
    }
    memcpy(x_before, b->x, 3 * (size_t)b->tets.n_node * sizeof *x_before);
    return max / moved;
}

static void pressed_through_itself_or_crumpled_the_surface_does_not_jump(void)
{
    bound b;
    uint64_t state = 6;
    REQUIRE(bind_surface(shape_ball(0.1, 60, 30, 0.2), 12, &b));
    show(&b);
    float *before = malloc(3 * (size_t)b.surface.n_vertex * sizeof *before);
    double *x_before = malloc(3 * (size_t)b.tets.n_node * sizeof *x_before), pressed = 0, crumpled = 0;
    REQUIRE(before && x_before);
    memcpy(x_before, b.x, 3 * (size_t)b.tets.n_node * sizeof *x_before);
    for (int step = 1; step <= 200; step++) {
        for (int i = 0; i < b.tets.n_node; i++) b.x[3 * i + 2] = b.tets.x[3 * i + 2] * (1 - 0.01 * step);
        pressed = fmax(pressed, jump(&b, before, x_before));
    }
    /* every node goes its own way, a fiftieth of a voxel a step, up to a voxel from its place */
    memcpy(b.x, b.tets.x, 3 * (size_t)b.tets.n_node * sizeof *x_before);
    jump(&b, before, x_before);
    double *way = malloc(3 * (size_t)b.tets.n_node * sizeof *way);
    REQUIRE(way);
    for (int i = 0; i < 3 * b.tets.n_node; i++) way[i] = 0.02 * b.tets.edge_m * random_signed(&state);
    for (int step = 0; step < 50; step++) {
        for (int i = 0; i < 3 * b.tets.n_node; i++) b.x[i] += way[i];
        crumpled = fmax(crumpled, jump(&b, before, x_before));
        check_bounded(&b);
    }
    printf("  largest jump over the nodes' motion: pressed %.2f, crumpled %.2f\n", pressed, crumpled);
    HARD_CASE("skin", "tet_springs fem", "pressed through itself or crumpled: jump over the nodes' way",
              fmax(pressed, crumpled), 3, "");
    CHECK_LE(pressed, 3);
    free(before);
    free(x_before);
    free(way);
    unbind(&b);
}

static void second_edge_gives_the_same_axes_as_the_first(void)
{
    /* first edges that count as collapsed: their rest length is a thousand times what they have */
    bound b;
    REQUIRE(bind_surface(shape_ball(0.1, 60, 30, 0.2), 12, &b));
    int n_second = 0;
    for (int f = 0; f < b.skin.n_frame; f++)
        if (b.skin.frame_edge[2 * f + 1] >= 0) b.skin.frame_rest[3 * f + 1] *= 1000, n_second++;
    CHECK_INT(n_second, b.skin.n_frame);
    show(&b);
    CHECK_LE(largest_error(&b, b.surface.x), 0.02 * b.tets.edge_m);
    unbind(&b);
}

static void voxels_that_touch_along_an_edge_carry_no_frame_there(void)
{
    /* two cubes that share one edge: its middle nodes have no normal */
    pal_surface a = shape_cube(1), other = shape_cube(1);
    shape_move(&other, 1, 1, 0);
    bound b;
    pal_voxels v;
    pal_diagnostic diag;
    pal_voxel_options options = {.resolution = 4};
    b.surface = shape_join(a, other);
    REQUIRE(!pal_voxels_fill(&b.surface, &options, &v, NULL, &diag));
    REQUIRE(!pal_voxels_split(&v, &b.tets));
    pal_voxels_free(&v);
    REQUIRE(!pal_skin_bind(&b.tets, b.surface.x, b.surface.n_vertex, &b.skin));
    b.x = b.tets.x;
    b.frames = calloc((size_t)b.skin.n_frame, 64);
    b.out = malloc(3 * (size_t)b.surface.n_vertex * sizeof *b.out);
    REQUIRE(b.frames && b.out);
    show(&b);
    CHECK_LE(largest_error(&b, b.surface.x), 1e-6 * 3);
    for (int f = 0; f < b.skin.n_frame; f++) {
        const double *x = b.tets.x + 3 * b.skin.frame[f];
        CHECK(!(fabs(x[0] - 0.5) < 0.1 && fabs(x[1] - 0.5) < 0.1 && fabs(x[2]) < 0.4));
    }
    b.x = NULL;
    unbind(&b);
}

static void a_mesh_without_a_surface_is_refused(void)
{
    pal_tets none = {0};
    pal_skin skin;
    double x[3] = {0};
    CHECK_INT(pal_skin_bind(&none, x, 1, &skin), PAL_ERR_REFUSED);
}

int main(void)
{
    RUN(rest_gives_the_rest_surface);
    RUN(threads_do_not_change_a_bit);
    RUN(weights_follow_the_inverse_square_and_sum_to_one);
    RUN(rigid_motion_of_the_nodes_moves_the_surface_rigidly);
    RUN(a_vertex_on_a_node_gets_it_exactly);
    RUN(one_vertex_is_the_same_as_all);
    RUN(flat_inverted_and_collapsed_bodies_stay_finite_and_near);
    RUN(pressed_through_itself_or_crumpled_the_surface_does_not_jump);
    RUN(second_edge_gives_the_same_axes_as_the_first);
    RUN(voxels_that_touch_along_an_edge_carry_no_frame_there);
    RUN(a_mesh_without_a_surface_is_refused);
    return check_report();
}
