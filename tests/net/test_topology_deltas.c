/* A body that adapts, from a real session to clients inside the process: who is told of its triangles, when, and that
 * what they have is the world's. */
#include "server/net/stream.h"
#include "server/net/transport/credit.h"
#include "tests/net/adaptive_scene.h"
#include "tests/net/server_fixture.h"

static adaptive_scene low_gravity, storm, weightless;
static void begin(const adaptive_scene *which)
{
    served_begin(&which->scene, (pal_session_options){.start_paused = true}, (pal_server_options){0});
}

/* a frame time on: a client that keeps up has read all that there is */
static void turn(mem_client *a, mem_client *b)
{
    served_turn(FRAME_NS, a, b);
}

/* of the session itself: no client may give so many commands a second */
static void ask_for_step(void)
{
    CHECK_INT(pal_session_command(session, &(pal_command){.kind = PAL_COMMAND_STEP}), PAL_ERR_OK);
}

/* one step of the paused session, seen by the client; the cycle before it may be the first */
static void step(mem_client *c)
{
    uint64_t before = c->tools.sim_time_us;
    ask_for_step();
    turn(c, NULL);
    CHECK(c->tools.sim_time_us > before);
}

static void join(mem_client *c, const char *name, bool patches)
{
    mem_join_as(c, transport, name, PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE, patches);
    mem_pull(c, 1000);
}

/* vertices that the client draws */
static int shown_vertices(const mem_client *c)
{
    uint8_t *used = calloc(c->asset->order->n_vertex, 1);
    int n = 0;
    for (size_t e = 0; e < 3 * (size_t)c->asset->n_triangle; e++) {
        const uint32_t *t = c->tri + e - e % 3;
        if ((t[0] | t[1] | t[2]) && !used[c->tri[e]]++) n++;
    }
    free(used);
    return n;
}

static bool same_table(const mem_client *a, const mem_client *b)
{
    return a->tri && b->tri && !memcmp(a->tri, b->tri, (size_t)a->asset->n_triangle * 3 * sizeof *a->tri);
}

/* largest distance of the vertices that they both draw, per axis */
static double apart(const mem_client *a, const mem_client *b)
{
    double max = 0;
    for (size_t e = 0; e < 3 * (size_t)a->asset->n_triangle; e++)
        for (size_t c = 0; c < 3; c++) {
            size_t i = 3 * (size_t)a->tri[e] + c;
            max = fmax(max, fabs((double)a->position_m[i] - (double)b->position_m[i]));
        }
    return max;
}

static void hello_tells_which_parts_adapt_and_the_asset_holds_the_finest_level(void)
{
    mem_client c;
    begin(&low_gravity);
    join(&c, "Ada", true);
    const pal_wire_part_info *part = &c.last[PAL_CONTROL_HELLO].hello.part[0];
    CHECK(part->is_adaptive);
    CHECK_INT(part->n_vertex, ADAPTIVE_VERTICES);
    CHECK_INT(part->n_triangle, ADAPTIVE_PLACES);
    REQUIRE(c.asset);
    CHECK_INT(c.asset->order->n_vertex, ADAPTIVE_VERTICES);
    CHECK_INT(c.asset->n_triangle, ADAPTIVE_PLACES);
    CHECK_INT(shown_vertices(&c), ADAPTIVE_NODES); /* level 0 at load */
    turn(&c, NULL);
    CHECK_INT(c.n_patch, 0); /* nothing has changed yet */
    const pal_wire_status *s = &c.last[PAL_CONTROL_STATUS].status;
    UNTIL(c.n_text[PAL_CONTROL_STATUS] > 0, &c, NULL);
    CHECK_INT(s->n_active, 1);
    CHECK(s->active[0].part == 0 && s->active[0].n_node == ADAPTIVE_NODES && s->active[0].n_spring == 336);
    CHECK(s->active[0].n_finest_node == ADAPTIVE_VERTICES && s->active[0].n_finest_spring == ADAPTIVE_SPRINGS);
    CHECK_INT(c.n_bad, 0);
    mem_end(&c);
    end();
}

/* the stream alone: its own copy and that of clients that take a cycle now and then are the frame's */
static void tables_are_the_worlds_after_many_changes(void)
{
    enum { CLIENTS = 4 };
    static uint32_t mine[CLIENTS][ADAPTIVE_PLACES][3];
    static uint8_t work[PAL_TOPOLOGY_DELTA_WORK_BYTES(ADAPTIVE_PLACES)];
    uint32_t has[CLIENTS] = {0};
    pal_stream *s = NULL;
    bool used[PAL_STREAM_TIER_COUNT] = {true, true, false};
    pal_stream_tool tool[PAL_TOOL_MAX] = {{0}};
    served_session(&storm.scene, (pal_session_options){0});
    REQUIRE(pal_stream_open(session, 0, NULL, &s) == PAL_ERR_OK);
    pal_stream_part *part = &s->part[0];
    pal_asset *asset = NULL;
    pal_frame_decoder *decoder = NULL;
    REQUIRE(part->slots && !pal_asset_decode(part->asset->bytes, part->asset->n_byte, &asset));
    REQUIRE(!pal_frame_decoder_create(asset, &decoder));
    float *x = malloc(sizeof(float) * 3 * ADAPTIVE_VERTICES);
    for (int k = 0; k < CLIENTS; k++) memcpy(mine[k], asset->triangle, sizeof mine[k]);
    int n_changed = 0;
    for (int n_cycle = 1; n_cycle <= CHECK_REPEATS(120, 40); n_cycle++) {
        uint32_t change = part->slots->change;
        manual_clock_steps(&served_clock, 1, served_step_ns, 1);
        REQUIRE(pal_stream_update(s, served_clock.now_ns, used, tool));
        n_changed += change != part->slots->change;
        const pal_frame_part *from = &s->frame->part[0];
        CHECK_INT(from->n_slot, ADAPTIVE_PLACES);
        CHECK(memcmp(part->slots->tri, from->slot, sizeof mine[0]) == 0);
        CHECK_INT(part->slots->change == 0 ? 0 : part->frame_change[0], part->slots->change);
        for (int k = 0; k < CLIENTS; k++) {
            pal_topology_delta_head head;
            if (n_cycle % (3 * k + 1)) continue;
            pal_packet *p = pal_triangle_slots_delta(part->slots, has[k]);
            CHECK_INT(p != NULL, has[k] != part->slots->change);
            if (p)
                CHECK_INT(pal_topology_delta_get(p->bytes, p->n_byte, ADAPTIVE_PLACES, ADAPTIVE_VERTICES, work, &head,
                                                 mine[k][0]),
                          0);
            pal_packet_drop(p);
            has[k] = part->slots->change;
            CHECK(memcmp(mine[k], from->slot, sizeof mine[k]) == 0);
        }
        /* what is shown is where the world has it */
        for (int t = 0; t < 2; t++) {
            pal_frame_head head;
            double worst = 0;
            int n_shown = 0;
            REQUIRE(!pal_frame_get(decoder, part->frame[t]->bytes, part->frame[t]->n_byte, &head, x));
            for (int v = 0; v < ADAPTIVE_VERTICES; v++) {
                n_shown += !part->slots->hidden[v];
                for (int c = 0; c < 3 && !part->slots->hidden[v]; c++)
                    worst = fmax(worst, fabs((double)x[3 * v + c] - (double)from->position_m[3 * v + c]));
            }
            CHECK_INT(n_shown, from->n_active);
            CHECK_LE(worst, pal_stream_tier_error_m(s, t));
        }
    }
    printf("  %d frames brought other triangles\n", n_changed);
    CHECK(n_changed > 4);
    free(x);
    pal_frame_decoder_destroy(decoder);
    pal_asset_destroy(asset);
    pal_stream_close(s);
    pal_session_close(session);
}

static void who_skips_cycles_gets_one_patch_with_all_of_it(void)
{
    mem_client fast, slow;
    begin(&storm);
    join(&fast, "fast", true);
    join(&slow, "slow", true);
    turn(&fast, NULL);
    mem_pull(&slow, 1000);
    for (int i = 0; i < 12; i++) step(&fast); /* the slow one reads nothing meanwhile */
    REQUIRE(fast.n_patch > 3);
    int before = slow.n_patch;
    mem_pull(&slow, 1000);
    printf("  %d patches to the fast one, %d to the slow one\n", fast.n_patch, slow.n_patch - before);
    CHECK_LE(slow.n_patch - before, 2); /* one that waited to be read, and one for the rest */
    CHECK(same_table(&fast, &slow));
    CHECK_INT(shown_vertices(&slow), shown_vertices(&fast));
    CHECK_LE(apart(&fast, &slow), 0);
    /* the same for one that reads and acknowledges nothing: its credit ends, and one patch brings it back */
    slow.mute = true;
    before = slow.n_patch;
    for (int i = 0; i < 16; i++) {
        step(&fast);
        mem_pull(&slow, 1000);
    }
    CHECK_LE(slow.n_patch - before, PAL_CREDIT_MIN + 2);
    slow.mute = false;
    uint8_t ack[PAL_WIRE_ACK_BYTES];
    pal_wire_put_ack(ack, sizeof ack, &(pal_wire_ack){.cycle = slow.tools.cycle});
    pal_mem_send(slow.peer, ack, sizeof ack, false);
    before = slow.n_patch;
    for (int i = 0; i < 3; i++) mem_pull(&slow, 1000);
    CHECK_INT(slow.n_patch - before, 1);
    CHECK(same_table(&fast, &slow));
    CHECK_INT(fast.n_bad + slow.n_bad, 0);
    mem_end(&fast);
    mem_end(&slow);
    end();
}

static void who_comes_late_gets_all_of_it_before_the_first_frame(void)
{
    mem_client early, late, old;
    begin(&storm);
    join(&early, "early", true);
    join(&old, "old", false);
    turn(&early, NULL);
    for (int i = 0; i < 10; i++) {
        step(&early);
        mem_pull(&old, 1000);
    }
    REQUIRE(early.n_patch > 2);
    join(&late, "late", true);
    CHECK_INT(late.n_patch, 1);
    CHECK_INT(late.n_frame, 1);
    CHECK(same_table(&early, &late));
    CHECK_LE(apart(&early, &late), 0);
    /* who does not take patches has none, and the triangles of load at the right place */
    CHECK_INT(old.n_patch, 0);
    CHECK(old.n_frame > 5);
    CHECK_INT(shown_vertices(&old), ADAPTIVE_NODES);
    CHECK_LE(apart(&old, &early), 0);
    CHECK_INT(early.n_bad + late.n_bad + old.n_bad, 0);
    /* a reset brings back the table of load, for all alike */
    mem_text(&early, "{\"type\":\"command\",\"verb\":\"reset\"}");
    turn(&early, NULL);
    CHECK_INT(early.tools.sim_time_us, 0);
    mem_pull(&late, 1000);
    REQUIRE(early.asset);
    CHECK(memcmp(early.tri, early.asset->triangle, (size_t)early.asset->n_triangle * 12) == 0);
    CHECK(same_table(&early, &late));
    CHECK_INT(early.n_bad + late.n_bad, 0);
    mem_end(&early);
    mem_end(&late);
    mem_end(&old);
    end();
}

static void a_change_of_accuracy_loses_no_triangle(void)
{
    mem_client fast, coarse;
    begin(&storm);
    join(&fast, "fast", true);
    join(&coarse, "coarse", true);
    turn(&fast, NULL);
    mem_pull(&coarse, 1000);
    /* two clean seconds, then it takes one cycle in four, until it is given larger steps, then all of them again */
    float q = fast.frame.q_m, max = 0;
    for (int i = 0; i < 600; i++) {
        if (i % 8 == 0)
            step(&fast);
        else {
            ask_for_step();
            turn(&fast, NULL);
        }
        if (i % 7 == 6) {
            mem_pull(&coarse, 1000);
            max = fmaxf(max, coarse.frame.q_m);
        }
        if (max > 1.5f * q) break;
    }
    CHECK(max > 1.5f * q);
    for (int i = 0; i < 4; i++) {
        step(&fast);
        mem_pull(&coarse, 1000);
        CHECK(same_table(&fast, &coarse));
        CHECK_LE(apart(&fast, &coarse), 0.5 * ((double)q + (double)coarse.frame.q_m) * 1.1);
    }
    CHECK_INT(fast.n_bad + coarse.n_bad, 0);
    mem_end(&fast);
    mem_end(&coarse);
    end();
}

static void triangles_that_change_while_nothing_moves_come_with_a_frame(void)
{
    mem_client c, late;
    begin(&weightless);
    join(&c, "Ada", true);
    turn(&c, NULL);
    REQUIRE(c.asset);
    CHECK_INT(shown_vertices(&c), ADAPTIVE_VERTICES);
    for (int i = 0; i < 120 && shown_vertices(&c) > ADAPTIVE_NODES; i++) {
        int n_frame = c.n_frame, n_patch = c.n_patch;
        step(&c);
        CHECK_INT(c.n_frame - n_frame, c.n_patch - n_patch);
    }
    CHECK_INT(shown_vertices(&c), ADAPTIVE_NODES);
    CHECK(c.n_patch >= ADAPTIVE_LEVELS - 1);
    for (size_t i = 0; i < 3 * (size_t)ADAPTIVE_VERTICES; i++)
        CHECK_NEAR((double)c.position_m[i], (double)c.asset->rest_m[i], 1e-7);
    join(&late, "late", true);
    CHECK(late.n_patch == 1 && late.n_frame == 1 && same_table(&c, &late));
    CHECK_INT(c.n_bad + late.n_bad, 0);
    mem_end(&c);
    mem_end(&late);
    end();
}

static void at_rest_nothing_is_sent(void)
{
    mem_client c;
    begin(&low_gravity);
    join(&c, "Ada", true);
    turn(&c, NULL);
    mem_text(&c, "{\"type\":\"command\",\"verb\":\"resume\"}");
    int quiet = 0, n_frame = 0, n_patch = 0;
    for (int i = 0; i < 4000 && quiet < 60; i++) {
        turn(&c, NULL);
        quiet = c.n_frame == n_frame && c.n_patch == n_patch ? quiet + 1 : 0;
        n_frame = c.n_frame, n_patch = c.n_patch;
    }
    printf("  at rest after %.1f s with %d vertices shown, %d patches\n", (double)c.tools.sim_time_us * 1e-6,
           shown_vertices(&c), c.n_patch);
    CHECK_INT(quiet, 60);
    CHECK(c.n_patch > 0);
    CHECK_INT(c.n_bad, 0);
    mem_end(&c);
    end();
}

/* two images side by side on the storm's sphere: their seam is decoded at one place, and costs nothing in a frame */
static void copies_along_a_seam_are_decoded_at_their_place(void)
{
    static uint8_t png[] = {0x89, 'P', 'N', 'G'}, jpeg[] = {0xFF, 0xD8, 0xFF};
    static const pal_image image[2] = {{.bytes = png, .n_byte = sizeof png}, {.bytes = jpeg, .n_byte = sizeof jpeg}};
    pal_surface *ball = &storm.mesh.surface;
    pal_body_def *def = &storm.scene.body[0];
    const bool used[PAL_STREAM_TIER_COUNT] = {true, false, false};
    const pal_stream_tool tool[PAL_TOOL_MAX] = {{0}};
    uint64_t n_byte[2];
    int n_compared = 0;
    ball->image_at = calloc(9 * (size_t)ball->n_tri, sizeof *ball->image_at);
    REQUIRE(ball->image_at);
    for (int t = 0; t < ball->n_tri; t++) {
        double middle = 0;
        for (int k = 0; k < 3; k++) middle += ball->x[3 * ball->tri[3 * t + k]];
        for (int k = 0; k < 3; k++) ball->image_at[9 * t + 3 * k + 2] = middle > 0;
    }
    for (int with = 0; with < 2; with++) {
        pal_stream *s = NULL;
        pal_asset *asset = NULL;
        pal_frame_decoder *decoder = NULL;
        def->image = image, def->n_image = with ? 2 : 0;
        served_session(&storm.scene, (pal_session_options){0});
        REQUIRE(pal_stream_open(session, 0, NULL, &s) == PAL_ERR_OK);
        pal_stream_part *part = &s->part[0];
        REQUIRE(!pal_asset_decode(part->asset->bytes, part->asset->n_byte, &asset));
        REQUIRE(!pal_frame_decoder_create(asset, &decoder));
        CHECK_INT(part->info.n_image, def->n_image);
        CHECK_INT(asset->look != NULL, with);
        const pal_shown *shown = &pal_session_view_outline(session)->part[0];
        CHECK_INT(shown->n_own, ADAPTIVE_VERTICES);
        CHECK_INT(asset->order->n_vertex, shown->n_vertex);
        CHECK_INT(shown->n_vertex > ADAPTIVE_VERTICES, with);
        float *x = malloc(3 * sizeof *x * (size_t)shown->n_vertex);
        REQUIRE(x);
        for (int cycle = 0; cycle < CHECK_REPEATS(120, 40); cycle++) {
            pal_frame_head head;
            manual_clock_steps(&served_clock, 1, served_step_ns, 1);
            REQUIRE(pal_stream_update(s, served_clock.now_ns, used, tool));
            REQUIRE(!pal_frame_get(decoder, part->frame[0]->bytes, part->frame[0]->n_byte, &head, x));
            for (int v = shown->n_own; v < shown->n_vertex; v++) {
                const int32_t of = shown->copy_of[v - shown->n_own];
                CHECK_INT(part->slots->hidden[v], part->slots->hidden[of]);
                CHECK(!memcmp(x + 3 * v, x + 3 * of, 3 * sizeof *x));
                n_compared += !part->slots->hidden[v];
            }
        }
        n_byte[with] = s->count.n_frame_byte;
        free(x);
        pal_frame_decoder_destroy(decoder);
        pal_asset_destroy(asset);
        pal_stream_close(s);
        pal_session_close(session);
    }
    printf("  %d positions compared; %llu bytes of frames, %llu with the seam\n", n_compared,
           (unsigned long long)n_byte[0], (unsigned long long)n_byte[1]);
    CHECK(n_compared > 1000);
    /* a bit for each three coordinates of a group of copies, none for their values */
    CHECK_LE((double)n_byte[1], 1.01 * (double)n_byte[0]);
    def->n_image = 0;
}

int main(void)
{
    if (!adaptive_scene_make(&low_gravity, ADAPTIVE_LOW_GRAVITY) || !adaptive_scene_make(&storm, ADAPTIVE_STORM) ||
        !adaptive_scene_make(&weightless, ADAPTIVE_WEIGHTLESS))
        return 1;
    RUN(hello_tells_which_parts_adapt_and_the_asset_holds_the_finest_level);
    RUN(tables_are_the_worlds_after_many_changes);
    RUN(copies_along_a_seam_are_decoded_at_their_place);
    RUN_SERIAL(who_skips_cycles_gets_one_patch_with_all_of_it);
    RUN(who_comes_late_gets_all_of_it_before_the_first_frame);
    RUN_LONG(a_change_of_accuracy_loses_no_triangle);
    RUN(triangles_that_change_while_nothing_moves_come_with_a_frame);
    RUN_SERIAL(at_rest_nothing_is_sent);
    adaptive_scene_free(&low_gravity);
    adaptive_scene_free(&storm);
    adaptive_scene_free(&weightless);
    return check_report();
}
