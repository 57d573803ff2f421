/* Sculpting over the wire: commands of clients to a real session that runs, the topology that comes of them,
 * frames that fit it, answers, refusals, and who goes in the middle. */
#include "tests/net/command_room.h"
#include "tests/session/sculpt_body.h"

#include <cjson/cJSON.h>

static clay_scene clay;

/* places of a block of 0.1 m, on its top and beside it */
#define TOP  "\"x_m\":0.02,\"y_m\":0.02,\"z_m\":0.05"
#define SIDE "\"x_m\":0.05,\"y_m\":0.02,\"z_m\":0.02"
#define FAR  "\"x_m\":0.5,\"y_m\":0,\"z_m\":0"

static void begin(void)
{
    order_begin(&clay.scene, NULL, 0);
}

/* farthest vertex from its place at rest, m */
static double moved(const mem_client *c)
{
    double max = 0;
    for (size_t i = 0; i < 3 * (size_t)c->asset->order->n_vertex; i++)
        max = fmax(max, fabs((double)c->position_m[i] - (double)c->asset->rest_m[i]));
    return max;
}

static void a_cell_grows_and_the_frames_are_of_the_new_epoch(void)
{
    mem_client c;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    const pal_wire_part_info before = *part(&c);
    CHECK(before.is_sculptable);
    CHECK_INT(before.epoch, 1);
    CHECK(order(&c, "extrude", TOP ",\"distance_m\":0.03"));
    CHECK_TEXT(c.last[PAL_CONTROL_ANSWER].answer.verb, "extrude");
    CHECK_NEAR(reported(&c, "cells"), 9, 0);
    CHECK_NEAR(reported(&c, "can_undo"), 1, 0);
    CHECK_INT(c.n_text[PAL_CONTROL_TOPOLOGY], 1);
    CHECK_INT(part(&c)->epoch, 2);
    /* a brick of the control mesh, subdivided once, adds 4 sides of 4 faces: 16 quads at the sides, 4 on top for 4, and
     * the 8 vertices around its foot are drawn twice, as it is inner tissue */
    CHECK_INT(part(&c)->n_vertex, before.n_vertex + 16 + 8);
    CHECK_INT(part(&c)->n_triangle, before.n_triangle + 32);
    uint64_t time_us = c.tools.sim_time_us;
    until_frame(&c);
    CHECK_LE(moved(&c), 1e-4);                               /* at rest, as the block was */
    UNTIL(c.tools.sim_time_us >= time_us + 50000, &c, NULL); /* time goes on where it was */
    /* the topology of before, and its very asset */
    CHECK(order(&c, "undo", ""));
    CHECK_INT(part(&c)->epoch, 3);
    CHECK_INT(part(&c)->n_vertex, before.n_vertex);
    CHECK_INT(part(&c)->n_triangle, before.n_triangle);
    CHECK_TEXT(part(&c)->asset, before.asset);
    until_frame(&c);
    CHECK(order(&c, "redo", ""));
    CHECK_INT(part(&c)->n_vertex, before.n_vertex + 16 + 8);
    CHECK_NEAR(reported(&c, "can_redo"), 0, 0);
    until_frame(&c);
    mem_end(&c);
    end();
}

static void assets_that_have_been_replaced_can_still_be_fetched(void)
{
    mem_client c;
    pal_reply reply;
    char first[PAL_WIRE_NAME_BYTES];
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    snprintf(first, sizeof first, "%s", part(&c)->asset);
    CHECK(order(&c, "divide", TOP));
    CHECK(strcmp(first, part(&c)->asset) != 0);
    pal_mem_get(transport, first, &reply);
    CHECK_INT(reply.status, 200);
    pal_packet_drop(reply.body);
    /* not for ever */
    for (int i = 0; i < 12; i++) {
        char args[128];
        snprintf(args, sizeof args, "\"nx\":0,\"ny\":0,\"nz\":1,\"offset_m\":%g", -0.03 + 0.005 * i);
        CHECK(order(&c, "cut", args));
    }
    pal_mem_get(transport, first, &reply);
    CHECK_INT(reply.status, 404);
    pal_packet_drop(reply.body);
    mem_end(&c);
    end();
}

/* the file that says what a click picks: its faces are those that commands name, its triangles those of the asset */
static void the_control_cells_say_what_is_picked(void)
{
    mem_client c;
    pal_reply reply;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    pal_mem_get(transport, part(&c)->control_cells, &reply);
    REQUIRE(reply.status == 200);
    cJSON *root = cJSON_ParseWithLength((const char *)reply.body->bytes, reply.body->n_byte);
    pal_packet_drop(reply.body);
    CHECK_INT(cJSON_GetArraySize(cJSON_GetObjectItem(root, "vertices_m")), 3 * clay.cells.n_vertex);
    const cJSON *faces = cJSON_GetObjectItem(root, "faces"), *runs = cJSON_GetObjectItem(root, "triangles"), *face;
    CHECK_INT(cJSON_GetArraySize(faces), clay.cells.n_boundary_face);
    double n_tri = 0;
    for (const cJSON *run = runs->child; run; run = run->next->next) n_tri += run->next->valuedouble;
    CHECK_NEAR(n_tri, part(&c)->n_triangle, 0);
    CHECK(order(&c, "probe", TOP));
    cJSON_ArrayForEach(face, faces)
    {
        const cJSON *edges = cJSON_GetObjectItem(face, "edges"), *edge;
        if (cJSON_GetObjectItem(face, "face")->valuedouble != reported(&c, "face")) continue;
        CHECK_NEAR(cJSON_GetObjectItem(face, "cell")->valuedouble, reported(&c, "cell"), 0);
        bool found = false;
        cJSON_ArrayForEach(edge, edges) found = found || edge->valuedouble == reported(&c, "edge");
        CHECK(found);
        n_tri = -1;
    }
    CHECK_NEAR(n_tri, -1, 0); /* the face of the probe is in the list */
    const double picked = reported(&c, "cell");
    CHECK(order(&c, "delete", TOP));
    CHECK_NEAR(reported(&c, "cell"), picked, 0);
    cJSON_Delete(root);
    mem_end(&c);
    end();
}

static void paint_is_what_a_probe_finds(void)
{
    mem_client c;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    CHECK(order(&c, "probe", TOP));
    double young = reported(&c, "young_Pa"), density = reported(&c, "density_kg_m3");
    CHECK_NEAR(young, clay.scene.body[0].material.young_Pa, 1e-9 * young);
    CHECK(order(&c, "paint", TOP ",\"radius_m\":0.03,\"young_factor\":4,\"density_factor\":2"));
    CHECK_INT(part(&c)->epoch, 2);
    CHECK(order(&c, "probe", TOP));
    CHECK_NEAR(reported(&c, "young_Pa"), 4 * young, 1e-6 * young);
    CHECK_NEAR(reported(&c, "density_kg_m3"), 2 * density, 1e-6 * density);
    /* beyond the brush it is as it was */
    CHECK(order(&c, "probe", "\"x_m\":-0.05,\"y_m\":-0.04,\"z_m\":-0.04"));
    CHECK_NEAR(reported(&c, "young_Pa"), young, 1e-9 * young);
    CHECK_INT(part(&c)->epoch, 2); /* who asks changes nothing */
    CHECK(order(&c, "undo", ""));
    CHECK(order(&c, "probe", TOP));
    CHECK_NEAR(reported(&c, "young_Pa"), young, 1e-9 * young);
    until_frame(&c);
    mem_end(&c);
    end();
}

/* asked for and refused by the world: neither what a probe finds nor what the next edit is made of */
static void a_material_that_was_refused_does_not_stick(void)
{
    mem_client c;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    CHECK(order(&c, "probe", TOP));
    double young = reported(&c, "young_Pa");
    mem_text(&c, "{\"type\":\"command\",\"verb\":\"material\",\"args\":{\"young_Pa\":1e12}}");
    until_answers(&c, NULL, n_answer(&c) + 1);
    CHECK(order(&c, "extrude", TOP ",\"distance_m\":0.02"));
    CHECK(order(&c, "probe", TOP));
    CHECK_NEAR(reported(&c, "young_Pa"), young, 1e-9 * young);
    mem_end(&c);
    end();
}

static void a_cut_shows_the_inside_and_goes_again(void)
{
    mem_client c;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    const pal_wire_part_info before = *part(&c);
    CHECK(order(&c, "cut", "\"nx\":0,\"ny\":0,\"nz\":2,\"offset_m\":0.001"));
    /* the half below: a plane of 4 by 4 faces where the block is cut, and 4 sides of 4 by 2, a bottom of 4 by 4 */
    CHECK_INT(part(&c)->n_triangle, 2 * (16 + 4 * 8 + 16));
    until_frame(&c);
    double max = -1;
    for (uint32_t i = 0; i < c.asset->order->n_vertex; i++) max = fmax(max, (double)c.asset->rest_m[3 * i + 2]);
    CHECK_NEAR(max, 0, 0.005);
    CHECK_NEAR(reported(&c, "can_undo"), 0, 0);
    CHECK(order(&c, "uncut", ""));
    CHECK_TEXT(part(&c)->asset, before.asset);
    CHECK(order(&c, "set_rest_shape", ""));
    CHECK_NEAR(reported(&c, "can_undo"), 1, 0);
    until_frame(&c);
    CHECK_LE(moved(&c), 1e-4);
    mem_end(&c);
    end();
}

static void what_cannot_be_done_is_refused_with_a_sentence_and_changes_nothing(void)
{
    static const struct {
        const char *verb, *args, *code, *word;
    } bad[] = {{"delete", FAR, "refused", "nothing of clay is at 0.5 0 0 m"},
               {"paint", TOP ",\"radius_m\":0", "refused", "radius"},
               {"paint", TOP, "args", "paint: radius_m is missing"},
               {"extrude", TOP ",\"distance_m\":0.01,\"colour\":3", "args", "extrude takes x_m y_m z_m distance_m"},
               {"extrude", TOP ",\"distance_m\":-0.04", "refused", "extrude "},
               {"extrude", TOP ",\"distance_m\":0.01,\"scale\":-1", "refused", "extrude "},
               {"merge", TOP ",\"x2_m\":0.5,\"y2_m\":0,\"z2_m\":0", "refused", "nothing of clay"},
               {"merge", TOP ",\"x2_m\":-0.05,\"y2_m\":0.02,\"z2_m\":0.02", "refused", "merge "},
               {"bridge", TOP ",\"x2_m\":0.02,\"y2_m\":0.02,\"z2_m\":0.05", "refused", "bridge "},
               {"sharpen", TOP ",\"sharpness\":1,\"entity\":7", "args", "entity is 7"},
               {"sharpen", TOP ",\"sharpness\":-1,\"entity\":0", "refused", "sharpness is -1"},
               {"cut", "\"nx\":0,\"ny\":0,\"nz\":0,\"offset_m\":0", "refused", "direction"},
               {"cut", "\"nx\":0,\"ny\":0,\"nz\":1,\"offset_m\":-1", "refused", "the cut leaves nothing"},
               {"undo", "", "refused", "nothing to undo"},
               {"redo", "", "refused", "nothing to redo"},
               {"undo", "\"n\":2", "args", "undo takes no numbers"},
               {"probe", FAR, "refused", "nothing of clay"}};
    mem_client c;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        bool done = order(&c, bad[i].verb, bad[i].args);
        bool as_summary = !done && strstr(trouble(&c), bad[i].word);
        CHECK(as_summary);
        if (done || !as_summary) printf("  %s %s: \"%s\"\n", bad[i].verb, bad[i].args, done ? "done" : trouble(&c));
        CHECK_TEXT(c.last[PAL_CONTROL_ERROR].error.code, bad[i].code);
    }
    mem_text(&c, "{\"type\":\"command\",\"verb\":\"undo\",\"target\":\"liver\"}");
    until_answers(&c, NULL, n_answer(&c) + 1);
    CHECK_TEXT(c.last[PAL_CONTROL_ERROR].error.code, "target");
    CHECK_INT(c.n_text[PAL_CONTROL_TOPOLOGY], 0);
    CHECK_INT(pal_mem_code(c.peer), 0);
    CHECK(order(&c, "extrude", TOP ",\"distance_m\":0.02"));
    CHECK_INT(part(&c)->epoch, 2);
    mem_end(&c);
    end();
}

/* the highest of what is shown */
static double height(const mem_client *c)
{
    double max = -1;
    for (uint32_t i = 0; i < c->asset->order->n_vertex; i++) max = fmax(max, (double)c->position_m[3 * i + 2]);
    return max;
}

/* frames until the height is beyond a number, or below it */
static bool until_height(mem_client *c, bool above, double wanted)
{
    for (int i = 0; i < 20000 && above != (height(c) > wanted); i++) turn(c, NULL);
    return above == (height(c) > wanted);
}

static void hands_blow_up_and_pull_until_they_let_go(void)
{
    mem_client c;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_TRAINEE, 0);
    for (int i = 0; i < 400; i++) turn(&c, NULL);
    const double rest = height(&c);
    CHECK(order(&c, "inflate", TOP ",\"radius_m\":0.04,\"pressure_Pa\":600"));
    CHECK(until_height(&c, true, rest + 0.002));
    CHECK_INT(part(&c)->epoch, 1); /* no edit */
    CHECK(order(&c, "inflate", TOP ",\"radius_m\":0.04,\"pressure_Pa\":-600"));
    CHECK(until_height(&c, false, rest + 0.0005));
    CHECK(order(&c, "release", ""));
    CHECK(order(&c, "curve",
                "\"x_m\":-0.04,\"y_m\":0,\"z_m\":0.05,\"x2_m\":0.04,\"y2_m\":0,\"z2_m\":0.05,\"radius_m\":0.02,"
                "\"stiffness_N_m\":100,\"dx_m\":0,\"dy_m\":0,\"dz_m\":0.02"));
    CHECK(until_height(&c, true, rest + 0.003));
    /* who lets the tool go lets go */
    mem_text(&c, "{\"type\":\"release_tool\"}");
    CHECK(until_height(&c, false, rest + 0.001));
    CHECK(!order(&c, "inflate", TOP ",\"radius_m\":0.04,\"pressure_Pa\":600"));
    CHECK_TEXT(c.last[PAL_CONTROL_ERROR].error.code, "role");
    CHECK_INT(c.n_bad, 0);
    mem_end(&c);

    join(&c, "Bob", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    CHECK(!order(&c, "release", ""));
    CHECK_TEXT(c.last[PAL_CONTROL_ERROR].error.code, "tool");
    mem_text(&c, "{\"type\":\"take_tool\",\"tool\":1}");
    for (int i = 0; i < 20; i++) turn(&c, NULL);
    CHECK(!order(&c, "inflate", TOP ",\"radius_m\":0,\"pressure_Pa\":600"));
    CHECK_TEXT(trouble(&c), "inflate: brush: radius_m 0, wanted 1e-9 to 1e9");
    CHECK(!order(&c, "inflate", FAR ",\"radius_m\":0.1,\"pressure_Pa\":600"));
    CHECK(strstr(trouble(&c), "inflate: nothing of ") != NULL);
    CHECK(!order(&c, "curve", TOP));
    CHECK_TEXT(c.last[PAL_CONTROL_ERROR].error.code, "args");
    CHECK(order(&c, "release", ""));
    mem_end(&c);
    end();
}

static void who_has_no_right_sculpts_nothing(void)
{
    mem_client looks, bare, teaches;
    begin();
    join(&looks, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    join(&bare, "Bob", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    join(&teaches, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    mem_text(&teaches, "{\"type\":\"command\",\"verb\":\"allow\",\"target\":\"sculpt\",\"args\":{\"enabled\":0}}");
    CHECK(!order(&looks, "divide", TOP));
    CHECK_TEXT(looks.last[PAL_CONTROL_ERROR].error.code, "role");
    CHECK(!order(&bare, "divide", TOP));
    CHECK_TEXT(bare.last[PAL_CONTROL_ERROR].error.code, "role");
    CHECK(order(&bare, "probe", TOP)); /* that only asks */
    CHECK(order(&teaches, "divide", TOP));
    mem_text(&teaches, "{\"type\":\"command\",\"verb\":\"allow\",\"target\":\"sculpt\",\"args\":{\"enabled\":1}}");
    CHECK(order(&bare, "undo", ""));
    mem_end(&looks);
    mem_end(&bare);
    mem_end(&teaches);
    end();
}

static void four_of_a_member_wait_and_the_next_one_is_refused(void)
{
    enum { ASKED = 8 };
    mem_client c;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    int before = n_answer(&c);
    for (int i = 0; i < ASKED; i++) send(&c, i % 2 ? "undo" : "extrude", i % 2 ? "" : TOP ",\"distance_m\":0.02");
    until_answers(&c, NULL, before + ASKED);
    CHECK_INT(c.n_text[PAL_CONTROL_ERROR], 3); /* one is under way, four wait */
    CHECK_TEXT(c.last[PAL_CONTROL_ERROR].error.code, "busy");
    CHECK_INT(c.n_text[PAL_CONTROL_ANSWER], 5);
    CHECK_INT(part(&c)->epoch, 6); /* in order: each undo had something to undo */
    CHECK_NEAR(reported(&c, "cells"), 9, 0);
    CHECK(order(&c, "undo", "")); /* and there is room again */
    mem_end(&c);
    end();
}

static void everybody_is_told_and_who_comes_late_begins_at_the_new_asset(void)
{
    mem_client a, b, late;
    begin();
    join(&a, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    join(&b, "Ben", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    send(&a, "delete", TOP);
    until_answers(&a, &b, n_answer(&a) + 1);
    until_frame(&a);
    until_frame(&b);
    CHECK_INT(a.n_text[PAL_CONTROL_TOPOLOGY], 1);
    CHECK_INT(b.n_text[PAL_CONTROL_TOPOLOGY], 1);
    CHECK_INT(b.n_text[PAL_CONTROL_ANSWER], 0); /* the answer is who asked's */
    CHECK_TEXT(part(&b)->asset, part(&a)->asset);
    join(&late, "Eve", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    CHECK_INT(part(&late)->epoch, 2);
    CHECK_TEXT(part(&late)->asset, part(&a)->asset);
    mem_end(&a);
    mem_end(&b);
    mem_end(&late);
    end();
}

static void the_tool_stays_held_and_its_poses_go_on(void)
{
    mem_client c;
    uint32_t seq = 0;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_TRAINEE, 0);
    for (int round = 0; round < 3; round++) {
        /* close above the top, to and fro */
        const double at[3] = {0, 0, 0.12 + 0.01 * round};
        mem_pose(&c, 0, ++seq, at);
        if (round == 1) CHECK(order(&c, "extrude", SIDE ",\"distance_m\":0.02"));
        UNTIL(c.tools.tool[0].echo_seq == seq, &c, NULL);
        CHECK(c.tools.tool[0].flags & PAL_WIRE_TOOL_HELD);
        CHECK(!(c.tools.tool[0].flags & PAL_WIRE_TOOL_AWAY));
        CHECK_NEAR((double)c.tools.tool[0].position_m[2], at[2], 1e-6);
        CHECK_INT(c.tools.tool[0].holder, c.last[PAL_CONTROL_HELLO].hello.you_id);
    }
    CHECK_INT(part(&c)->epoch, 2);
    int n_haptic = c.n_haptic;
    UNTIL(c.n_haptic > n_haptic, &c, NULL); /* models of contact still come */
    CHECK_INT(c.n_bad, 0);
    mem_end(&c);
    end();
}

static void a_field_that_is_looked_at_goes_on_with_the_new_vertices(void)
{
    mem_client c;
    begin();
    join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    mem_text(&c, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\"}");
    UNTIL(c.n_field > 0, &c, NULL);
    CHECK_INT(c.field.epoch, 1);
    CHECK(order(&c, "extrude", TOP ",\"distance_m\":0.02"));
    UNTIL(c.field.epoch == 2, &c, NULL);
    CHECK_INT(c.field.n_vertex, part(&c)->n_vertex);
    CHECK_INT(c.n_bad, 0);
    mem_end(&c);
    end();
}

static void who_asks_and_goes_leaves_the_others_a_session_that_works(void)
{
    mem_client goes, stays;
    begin();
    join(&goes, "Ada", PAL_WIRE_ROLE_TRAINEE, 0);
    join(&stays, "Ben", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    send(&goes, "extrude", TOP ",\"distance_m\":0.02"); /* under way */
    send(&goes, "divide", SIDE);                        /* waits     */
    mem_end(&goes);
    CHECK(order(&stays, "probe", TOP));
    /* what was under way is done for all, what waited went with who wanted it */
    WAIT_UNTIL(stays.epoch == 2, &stays, NULL);
    CHECK(order(&stays, "undo", ""));
    CHECK_INT(part(&stays)->epoch, 3);
    until_frame(&stays);
    CHECK_INT(stays.tools.tool[0].holder, 0); /* the tool is free */
    mem_end(&stays);
    end();
}

static void a_server_that_ends_in_the_middle_ends(void)
{
    for (int k = 0; k < 4; k++) {
        mem_client c;
        begin();
        join(&c, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
        if (k & 1) CHECK(order(&c, "divide", TOP)); /* with a session of the hub's own */
        send(&c, "extrude", TOP ",\"distance_m\":0.02");
        send(&c, "undo", "");
        if (k & 2) served_serve(&c, NULL); /* later: while it is made, or when it is done */
        CHECK(pal_mem_code(c.peer) == 0);
        pal_mem_leave(c.peer);
        c.peer = NULL;
        mem_end(&c);
        end();
    }
}

int main(void)
{
    clay_make(&clay, 2, 0.1);
    RUN(a_cell_grows_and_the_frames_are_of_the_new_epoch);
    RUN_SERIAL(assets_that_have_been_replaced_can_still_be_fetched);
    RUN(the_control_cells_say_what_is_picked);
    RUN(paint_is_what_a_probe_finds);
    RUN(a_material_that_was_refused_does_not_stick);
    RUN(a_cut_shows_the_inside_and_goes_again);
    RUN(what_cannot_be_done_is_refused_with_a_sentence_and_changes_nothing);
    RUN(hands_blow_up_and_pull_until_they_let_go);
    RUN(who_has_no_right_sculpts_nothing);
    RUN_SERIAL(four_of_a_member_wait_and_the_next_one_is_refused);
    RUN(everybody_is_told_and_who_comes_late_begins_at_the_new_asset);
    RUN(the_tool_stays_held_and_its_poses_go_on);
    RUN(a_field_that_is_looked_at_goes_on_with_the_new_vertices);
    RUN(who_asks_and_goes_leaves_the_others_a_session_that_works);
    RUN(a_server_that_ends_in_the_middle_ends);
    clay_free(&clay);
    return check_report();
}
