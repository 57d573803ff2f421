/* Copies of shown vertices along the seams of images on an adaptive surface: where they are, which triangles use them,
 * their places in the image after refinement, and that no crack opens while the surface moves and refines. */
#include "server/sim/world/frame.h"
#include "tests/fixtures/adaptive_worlds.h"

enum { LEVELS = 3 };

/* a sphere with two images, laid on along x and -x: their border is a closed seam of the triangles' sides. Image 1 lies
 * also where image 0 does (u, v from y and z), so that only the number of the image differs */
static void open_ball(shell_scene *s, bool with_images)
{
    static const pal_image image[2];
    pal_surface surface = {0};
    if (pal_sphere_make(0.1, &surface)) abort();
    shell_scene_take(s, &surface);
    shell_scene_number(s, "levels", LEVELS);
    shell_scene_number(s, "k_shape_N_m", 0);
    pal_surface *ball = &s->mesh.surface;
    ball->image_at = malloc(9 * sizeof *ball->image_at * (size_t)ball->n_tri);
    REQUIRE(ball->image_at);
    for (int t = 0; t < ball->n_tri; t++) {
        double middle = 0;
        for (int k = 0; k < 3; k++) middle += ball->x[3 * ball->tri[3 * t + k]];
        for (int k = 0; k < 3; k++) {
            const double *x = ball->x + 3 * ball->tri[3 * t + k];
            float *at = ball->image_at + 9 * t + 3 * k;
            at[0] = (float)(5 * x[1]), at[1] = (float)(5 * x[2]), at[2] = middle > 0;
        }
    }
    s->scene->body[0].image = image;
    s->scene->body[0].n_image = with_images ? 2 : 0;
    REQUIRE(shell_scene_start(s));
}

/* sides of the coarse surface between triangles of different images */
static int seam_sides(const pal_levels *l, const pal_surface *ball)
{
    int n = 0;
    for (int32_t e = 0; e < l->first_edge[1]; e++)
        n += ball->image_at[9 * l->edge[e].face[0] + 2] != ball->image_at[9 * l->edge[e].face[1] + 2];
    return n;
}

static void without_images_nothing_is_copied(void)
{
    shell_scene s;
    open_ball(&s, false);
    pal_shown shown;
    pal_world_shown(s.world, 0, &shown);
    CHECK(!shown.look && !shown.uv && !shown.copy_start);
    CHECK_INT(shown.n_vertex, s.body->display.n_shown);
    CHECK_INT(shown.n_own, s.body->display.n_shown);
    CHECK(!memcmp(shown.tri, s.body->dofs.slot, 3 * sizeof *shown.tri * (size_t)shown.n_tri));
    shell_scene_close(&s);
}

/* a closed seam of n sides has 2^(levels - 1) n vertices on the finest level, each with one copy */
static void a_seam_is_copied_once_on_all_levels(void)
{
    shell_scene s;
    open_ball(&s, true);
    pal_shown shown;
    pal_world_shown(s.world, 0, &shown);
    const pal_levels *l = s.body->dofs.levels;
    const int n_side = seam_sides(l, &s.mesh.surface);
    printf("  %d sides of the seam, %d copies of %d vertices\n", n_side, shown.n_vertex - shown.n_own, shown.n_own);
    CHECK(n_side > 10);
    CHECK_INT(shown.n_own, s.body->display.n_shown);
    CHECK_INT(shown.n_vertex - shown.n_own, n_side << (LEVELS - 1));
    for (int i = shown.n_own; i < shown.n_vertex; i++) {
        const int32_t of = shown.copy_of[i - shown.n_own], *parent = shown.parent + 2 * (i - shown.n_coarse);
        CHECK(of < shown.n_own && parent[0] == of && parent[1] == of);
        CHECK(!memcmp(shown.rest_m + 3 * i, shown.rest_m + 3 * of, 3 * sizeof *shown.rest_m));
        CHECK(shown.look[i] != shown.look[of]);
        CHECK(!memcmp(shown.uv + 2 * i, shown.uv + 2 * of, 2 * sizeof *shown.uv));
    }
    shell_scene_close(&s);
}

/* place in the image of vertex v by its way through the levels: the mean of those of its parents, on coarse values */
static void expected_uv(const pal_levels *l, const pal_surface *ball, int32_t v, double uv[2])
{
    if (v < l->n_vertex[0]) {
        for (int c = 0; c < 2; c++) uv[c] = 5 * ball->x[3 * v + 1 + c];
        return;
    }
    double a[2], b[2];
    const int32_t *end = l->edge[pal_levels_vertex_parent(l, v)].vertex;
    expected_uv(l, ball, end[0], a);
    expected_uv(l, ball, end[1], b);
    for (int c = 0; c < 2; c++) uv[c] = (a[c] + b[c]) / 2;
}

/* of the drawn triangles: places, one image in each, closed over the vertices that copies stand for */
static int check_drawn(const shell_scene *s, const pal_shown *shown, const pal_frame_part *part)
{
    const pal_levels *l = s->body->dofs.levels;
    static int8_t side[4096][4096];
    int n_drawn = 0, n_open = 0;
    CHECK(shown->n_own < 4096);
    memset(side, 0, sizeof side);
    for (int slot = 0; slot < part->n_slot; slot++) {
        const int32_t *tri = part->slot + 3 * slot, *own = s->body->dofs.slot + 3 * slot;
        if (!(tri[0] | tri[1] | tri[2])) continue;
        const float *coarse = s->mesh.surface.image_at + 9 * (slot >> 2 * (LEVELS - 1));
        int32_t of[3];
        n_drawn++;
        for (int k = 0; k < 3; k++) {
            double uv[2];
            of[k] = tri[k] < shown->n_own ? tri[k] : shown->copy_of[tri[k] - shown->n_own];
            CHECK_INT(of[k], own[k]);
            CHECK_INT(shown->look[tri[k]], PAL_LOOK_IMAGE + (int)coarse[2]);
            expected_uv(l, &s->mesh.surface, of[k], uv);
            for (int c = 0; c < 2; c++) CHECK_NEAR(shown->uv[2 * tri[k] + c], uv[c], 1e-6);
            CHECK(!memcmp(part->position_m + 3 * tri[k], part->position_m + 3 * of[k], 3 * sizeof(float)));
            for (int c = 0; c < 3; c++)
                CHECK_NEAR(part->position_m[3 * tri[k] + c], s->body->x[3 * of[k] + c] + s->body->offset_m[c], 1e-6);
        }
        for (int k = 0; k < 3; k++) side[of[k]][of[(k + 1) % 3]]++, side[of[(k + 1) % 3]][of[k]]--;
    }
    for (int a = 0; a < shown->n_own; a++)
        for (int b = 0; b < shown->n_own; b++) n_open += side[a][b] != 0;
    CHECK_INT(n_open, 0);
    return n_drawn;
}

static void no_crack_opens_at_a_seam_while_the_surface_moves_and_refines(void)
{
    shell_scene s;
    open_ball(&s, true);
    pal_shown shown;
    pal_world_shown(s.world, 0, &shown);
    pal_frame *frame = pal_frame_create(s.world);
    REQUIRE(frame);
    CHECK_INT(frame->part[0].n_vertex, shown.n_vertex);
    pal_world_frame(s.world, frame);
    const int n_coarse = check_drawn(&s, &shown, &frame->part[0]);
    CHECK_INT(n_coarse, s.mesh.surface.n_tri);
    /* pressed on one side of the seam, where faces on it are split one after the other */
    pal_adaptive_surface *adaptive = s.body->model.adaptive;
    const pal_levels *l = s.body->dofs.levels;
    int n_drawn = n_coarse, n_split = 0;
    for (int32_t e = 0; e < l->first_edge[2] && n_split < 40; e++) {
        const int32_t f = l->edge[e].face[e % 2];
        if (fabs(s.body->x_rest[3 * l->edge[e].vertex[0]]) > 0.03) continue;
        n_split += pal_adaptive_split(adaptive, s.body, f, 0) > 0;
        (void)pal_adaptive_update(adaptive, s.body);
        for (int k = 0; k < s.body->n_active; k++) {
            double *v = s.body->v + 3 * s.body->active[k];
            v[0] += 0.01 * s.body->x_rest[3 * s.body->active[k] + 1], v[2] -= 0.005;
        }
        CHECK_INT(pal_world_step(s.world, 1e-3), 0);
        pal_world_frame(s.world, frame);
        n_drawn = check_drawn(&s, &shown, &frame->part[0]);
    }
    printf("  %d faces split, %d triangles drawn\n", n_split, n_drawn);
    CHECK(n_split >= 20 && n_drawn > n_coarse + 60);
    pal_frame_destroy(frame);
    shell_scene_close(&s);
}

int main(void)
{
    RUN(without_images_nothing_is_copied);
    RUN(a_seam_is_copied_once_on_all_levels);
    RUN(no_crack_opens_at_a_seam_while_the_surface_moves_and_refines);
    return check_report();
}
