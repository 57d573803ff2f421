/* surface_output and skin_output: what a body shows. */
#include "tests/fixtures/tool_scene.h"

static double worst_shown(const pal_body *body, const double *rest, const double turn[9], const double shift[3])
{
    double worst = 0;
    for (int i = 0; i < body->display.n_shown; i++) {
        double p[3];
        pal_mul33(p, turn, rest + 3 * (size_t)i);
        pal_add3(p, p, shift);
        for (int c = 0; c < 3; c++)
            worst = fmax(worst, fabs(p[c] - (double)body->display.shown[3 * (size_t)i + (size_t)c]));
    }
    return worst;
}

static const double still[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, none[3] = {0, 0, 0};

/* turned and shifted as a whole, then shown by one step too short to move anything else */
static void turn_and_show(tool_scene *s, const double turn[9], const double shift[3])
{
    for (int i = 0; i < s->body->n_dof; i++) {
        pal_mul33(s->body->x + 3 * (size_t)i, turn, s->body->x_rest + 3 * (size_t)i);
        pal_add3(s->body->x + 3 * (size_t)i, s->body->x + 3 * (size_t)i, shift);
    }
    CHECK_INT(pal_world_step(s->world, 1e-9), 0);
}

static void skin_is_the_surface_at_rest_and_turns_with_the_body(void)
{
    const double c = cos(0.7), n = sin(0.7), turn[9] = {c, -n, 0, n, c, 0, 0, 0, 1}, shift[3] = {0.02, -0.01, 0.03};
    tool_scene s;
    REQUIRE(ball_scene(&s, 10, false, 1, 0.01, 15) && tool_scene_open(&s));
    CHECK_INT(s.body->display.n_shown, s.mesh.surface.n_vertex);
    CHECK_LE(worst_shown(s.body, s.mesh.surface.x, still, none), 1e-7);
    turn_and_show(&s, turn, shift);
    CHECK_LE(worst_shown(s.body, s.mesh.surface.x, turn, shift), 1e-6);
    pal_world_reset(s.world);
    CHECK_LE(worst_shown(s.body, s.mesh.surface.x, still, none), 1e-7);
    tool_scene_close(&s);
}

static void surface_is_the_boundary_nodes_themselves(void)
{
    const double c = cos(1.3), n = sin(1.3), turn[9] = {1, 0, 0, 0, c, -n, 0, n, c}, shift[3] = {0.02, -0.01, 0.03};
    tool_scene s;
    REQUIRE(slab_scene(&s, 4, 3, 2, 0.01, 1, 0.01, 15));
    s.scene->body[0].n_support = 0;
    REQUIRE(tool_scene_open(&s));
    CHECK_INT(s.body->display.n_shown, 5 * 4 * 3 - 3 * 2 * 1);
    CHECK(s.body->display.skin == NULL && s.body->display.surface != NULL);
    CHECK_INT(s.body->display.surface->n_vertex, s.body->display.n_shown);
    CHECK_NEAR(pal_surface_volume(s.body->display.surface), 24e-6, 1e-12);
    turn_and_show(&s, turn, shift);
    CHECK_LE(worst_shown(s.body, s.body->display.surface->x, turn, shift), 1e-8);
    tool_scene_close(&s);
}

static void frame_shows_what_the_body_shows(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 1, 0.01, 15) && tool_scene_open(&s));
    pal_frame *frame = pal_frame_create(s.world);
    REQUIRE(frame != NULL);
    for (int i = 0; i < 20; i++) {
        move_tool(&s, 0, 0, 0.01, 0.06 - 0.0006 * i, false);
        REQUIRE(step_world(&s, 1));
    }
    pal_world_frame(s.world, frame);
    REQUIRE(frame->part[0].n_vertex == s.body->display.n_shown);
    CHECK(memcmp(frame->part[0].position_m, s.body->display.shown,
                 3 * sizeof(float) * (size_t)s.body->display.n_shown) == 0);
    CHECK(frame->tool[0].touching && frame->tool[0].n_patch > 0);
    CHECK_NEAR(frame->tool[0].force_N[2], tool_of(&s, 0)->mean_force_N[2], 0);
    pal_frame_destroy(frame);
    tool_scene_close(&s);
}

static void refuses_a_body_without_a_skin(void)
{
    tool_scene s;
    pal_diagnostic diag = {""};
    REQUIRE(slab_scene(&s, 2, 2, 2, 0.01, 1, 0.01, 15));
    pal_entry_init(&s.scene->body[0].output, "output", "skin_output");
    CHECK_INT(pal_world_create(s.scene, &diag, &s.world), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "skin") != NULL);
    tool_scene_close(&s);
}

int main(void)
{
    RUN(skin_is_the_surface_at_rest_and_turns_with_the_body);
    RUN(surface_is_the_boundary_nodes_themselves);
    RUN(frame_shows_what_the_body_shows);
    RUN(refuses_a_body_without_a_skin);
    return check_report();
}
