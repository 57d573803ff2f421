/* The hub with a real session and peers inside the process: what clients are told, what they may do, and what hostile
 * and slow ones cost the others. Time is the test's own. */
#include "server/net/stream.h"
#include "tests/net/hub_scene.h"
#include "tests/net/server_fixture.h"

static small_scene organ;
static uint64_t apart_ns; /* what a turn adds to the time */

static void begin(bool paused, int max_clients)
{
    apart_ns = FRAME_NS;
    served_begin(&organ.scene, (pal_session_options){.start_paused = paused},
                 (pal_server_options){.max_clients = max_clients});
}

static void turn(mem_client *a, mem_client *b)
{
    served_turn(apart_ns, a, b);
}

static void frames_decode_to_the_sessions_positions(void)
{
    pal_stream *s = NULL;
    pal_asset *asset = NULL;
    pal_frame_decoder *decoder = NULL;
    pal_frame_head head;
    bool used[PAL_STREAM_TIER_COUNT] = {true, true, true};
    pal_stream_tool tool[PAL_TOOL_MAX] = {{0}};
    served_session(&organ.scene, (pal_session_options){0});
    REQUIRE(pal_stream_open(session, 0, NULL, &s) == PAL_ERR_OK);
    CHECK(s->error_m > 0 && s->error_m <= 5e-5);
    REQUIRE(pal_asset_decode(s->part[0].asset->bytes, s->part[0].asset->n_byte, &asset) == 0);
    REQUIRE(pal_frame_decoder_create(asset, &decoder) == 0);
    CHECK_INT(s->part[0].info.n_vertex, asset->order->n_vertex);
    int n = (int)asset->order->n_vertex;
    float *x = malloc((size_t)n * 3 * sizeof *x);
    double worst[PAL_STREAM_TIER_COUNT] = {0};
    for (int i = 0; i < 40; i++) {
        manual_clock_steps(&served_clock, 1, FRAME_NS, 1);
        REQUIRE(pal_stream_update(s, served_clock.now_ns, used, tool));
        for (int t = 0; t < PAL_STREAM_TIER_COUNT; t++) {
            const pal_packet *p = s->part[0].frame[t];
            REQUIRE(p && pal_frame_get(decoder, p->bytes, p->n_byte, &head, x) == 0);
            CHECK_INT(head.cycle, s->part[0].frame_cycle[t]);
            for (int k = 0; k < 3 * n; k++)
                worst[t] = fmax(worst[t], fabs((double)x[k] - (double)s->frame->part[0].position_m[k]));
        }
    }
    for (int t = 0; t < PAL_STREAM_TIER_COUNT; t++) CHECK_LE(worst[t], pal_stream_tier_error_m(s, t));
    free(x);
    pal_frame_decoder_destroy(decoder);
    pal_asset_destroy(asset);
    pal_stream_close(s);
    pal_session_close(session);
}

static void newcomer_gets_hello_members_frame_and_tools_in_this_order(void)
{
    mem_client ada;
    begin(true, 0);
    CHECK(pal_session_is_alive(session));
    turn(NULL, NULL);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    CHECK_INT(mem_pull(&ada, 1), 1);
    CHECK_INT(ada.n_text[PAL_CONTROL_HELLO], 1);
    const pal_wire_hello *hello = &ada.last[PAL_CONTROL_HELLO].hello;
    CHECK_TEXT(hello->session, "small");
    CHECK_TEXT(hello->you_name, "Ada");
    CHECK_TEXT(hello->title, "Small \"organ\"");
    CHECK_TEXT(hello->anatomical_axes, "LPS");
    CHECK_TEXT(hello->accuracy, "2 % of \"truth\"");
    CHECK(hello->you_id > 0 && hello->you_tool == 0 && hello->n_tool == 2 && hello->n_part == 1 &&
          hello->plan.n_component > 0);
    CHECK(hello->box_max_m[0] > hello->box_min_m[0] && hello->tool[0].radius_m > 0 && hello->credit >= 2);
    CHECK_NEAR(hello->tool[0].force_cap_N, organ.scene.tool[0].force_cap_N, 0);
    CHECK_TEXT(hello->tool[0].instrument, "grasper");
    CHECK(hello->tool[0].n_trocar == 3 && hello->tool[0].trocar_m[1] == 0.25);
    CHECK(!hello->tool[1].instrument[0] && hello->tool[1].n_trocar == 0);
    pal_server_advance(server);
    CHECK_INT(mem_pull(&ada, 1), 1);
    CHECK_INT(ada.n_text[PAL_CONTROL_MEMBERS], 1);
    CHECK_TEXT(ada.last[PAL_CONTROL_MEMBERS].members.member[0].name, "Ada");
    UNTIL(ada.n_tools > 0, &ada, NULL);
    CHECK(ada.n_frame >= 1 && ada.n_bad == 0);
    CHECK_INT(ada.frame.epoch, 1);
    UNTIL(ada.n_text[PAL_CONTROL_STATUS] > 0, &ada, NULL);
    CHECK(ada.last[PAL_CONTROL_STATUS].status.paused);
    CHECK_INT(ada.last[PAL_CONTROL_STATUS].status.n_component, hello->plan.n_component);
    mem_end(&ada);
    end();
}

static void late_joiner_sees_the_paused_tissue_as_everybody_does(void)
{
    mem_client ada, bob;
    begin(false, 0);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    UNTIL(ada.n_tools > 5, &ada, NULL);
    mem_text(&ada, "{\"type\":\"command\",\"verb\":\"pause\"}");
    UNTIL(ada.last[PAL_CONTROL_STATUS].status.paused, &ada, NULL);
    uint32_t frames = (uint32_t)ada.n_frame;
    for (int i = 0; i < 30; i++) turn(&ada, NULL);
    CHECK_INT(ada.n_frame, frames); /* nothing moves, nothing is sent */
    mem_join(&bob, transport, "Bob", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_pull(&bob, 1000);
    CHECK_INT(bob.n_frame, 1); /* from what the hub holds, without another step */
    CHECK_INT(bob.n_tools, 1);
    REQUIRE(bob.position_m && ada.position_m);
    CHECK(memcmp(bob.position_m, ada.position_m, bob.asset->order->n_vertex * 3 * sizeof(float)) == 0);
    CHECK_INT(bob.n_bad + ada.n_bad, 0);
    mem_end(&bob);
    mem_end(&ada);
    end();
}

/* largest distance of what two clients show, m */
static double apart_m(const float *a, const float *b, uint32_t n)
{
    double max = 0;
    for (uint32_t i = 0; i < 3 * n; i++) max = fmax(max, fabs((double)a[i] - (double)b[i]));
    return max;
}

/* tissue that sags while nobody looks: who comes then sees it as it is, and never as the last one saw it */
static void newcomer_sees_the_shape_of_now(void)
{
    mem_client ada, bob;
    apart_ns = FRAME_NS;
    served_begin(&organ.scene, (pal_session_options){.only_observed = true}, (pal_server_options){0});
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    UNTIL(ada.n_frame > 0, &ada, NULL);
    const uint32_t n = ada.asset->order->n_vertex;
    float *then = malloc(3 * n * sizeof *then), *first = malloc(3 * n * sizeof *first);
    memcpy(then, ada.position_m, 3 * n * sizeof *then);
    mem_end(&ada);
    for (int i = 0; i < 30; i++) turn(NULL, NULL);
    mem_join(&bob, transport, "Bob", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_pull(&bob, 1000);
    CHECK_INT(bob.n_frame, 0); /* nothing rather than the shape of then */
    UNTIL(bob.n_frame > 0, &bob, NULL);
    memcpy(first, bob.position_m, 3 * n * sizeof *first);
    turn(&bob, NULL), turn(&bob, NULL);
    const double since = apart_m(first, then, n), after = apart_m(bob.position_m, first, n);
    CHECK(since > 1e-4);
    CHECK_LE(after, since / 5);
    free(then), free(first);
    mem_end(&bob);
    end();
}

static void stalled_client_costs_little_and_is_current_within_two_frames(void)
{
    mem_client fast, slow;
    begin(false, 0);
    mem_join(&fast, transport, "fast", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&slow, transport, "slow", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    UNTIL(fast.n_tools > 3 && slow.n_tools > 3, &fast, &slow);
    turn(&fast, &slow);
    size_t fixed = pal_packet_total(), max = 0;
    int got = fast.n_tools;
    /* 5 s: the slow one reads nothing at all */
    apart_ns = 2 * FRAME_NS;
    for (int i = 0; i < 150; i++) {
        turn(&fast, NULL);
        if (pal_packet_total() > max) max = pal_packet_total();
    }
    CHECK_INT(fast.n_tools - got, 150);           /* a cycle each turn */
    CHECK_LE((double)max, (double)fixed + 65536); /* a cycle of this organ is 1 to 3 kB */
    /* it wakes: the newest cycle is among the first two */
    int before = slow.n_tools;
    for (int i = 0; slow.n_tools < before + 2 && i < 50; i++) mem_pull(&slow, 1);
    CHECK_INT(slow.tools.cycle, fast.tools.cycle);
    REQUIRE(slow.position_m && fast.position_m);
    CHECK(memcmp(slow.position_m, fast.position_m, slow.asset->order->n_vertex * 3 * sizeof(float)) == 0);
    CHECK_INT(pal_mem_code(slow.peer), 0);
    mem_end(&slow);
    mem_end(&fast);
    end();
}

static void without_acknowledgement_frames_stop_and_control_goes_on(void)
{
    mem_client deaf, other;
    begin(false, 0);
    mem_join(&deaf, transport, "deaf", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&other, transport, "other", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    deaf.mute = true;
    UNTIL(other.n_tools > 60, &other, &deaf);
    CHECK_INT(deaf.n_tools, 3); /* the credit at the start */
    mem_text(&deaf, "{\"type\":\"ping\",\"stamp_ms\":12.5}");
    mem_pull(&deaf, 1000);
    CHECK_NEAR(deaf.last[PAL_CONTROL_PONG].stamp_ms, 12.5, 0);
    CHECK(deaf.n_text[PAL_CONTROL_STATUS] > 1);
    apart_ns = 6 * FRAME_NS;
    for (int i = 0; i < 120 && !pal_mem_code(deaf.peer); i++) turn(&other, &deaf);
    CHECK_INT(pal_mem_code(deaf.peer), PAL_WIRE_CLOSE_STALLED);
    CHECK_INT(pal_mem_code(other.peer), 0);
    for (int i = 0; i < 3; i++) turn(&other, NULL);
    CHECK_INT(other.last[PAL_CONTROL_MEMBERS].members.n_member, 1);
    mem_end(&deaf);
    mem_end(&other);
    end();
}

/* an observer and one who sees every third cycle, until that one gets coarser frames. The step of the finer ones, m */
static double until_coarser(mem_client *all, mem_client *c, pal_wire_role role)
{
    begin(false, 0);
    mem_join(all, transport, "all", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(c, transport, "c", role, role == PAL_WIRE_ROLE_VIEWER ? PAL_WIRE_TOOL_NONE : PAL_WIRE_TOOL_ANY);
    UNTIL(c->n_frame > 5, all, c);
    double fine = (double)c->frame.q_m;
    apart_ns = 6 * FRAME_NS;
    for (int i = 0; i < 1500 && (double)c->frame.q_m < 1.5 * fine; i++) turn(all, i % 3 ? NULL : c);
    CHECK_NEAR((double)c->frame.q_m / fine, 2, 1e-5);
    return fine;
}

static void slow_client_gets_coarser_frames_and_finer_ones_when_it_keeps_up(void)
{
    mem_client c, all;
    double fine = until_coarser(&all, &c, PAL_WIRE_ROLE_VIEWER);
    for (int i = 0; i < 20000 && (double)c.frame.q_m > 1.5 * fine; i++) turn(&all, &c);
    CHECK_NEAR((double)c.frame.q_m / fine, 1, 1e-5);
    CHECK_INT(c.n_bad, 0);
    mem_end(&c);
    mem_end(&all);
    end();
}

/* encoded once for all, but for the numbers of each */
static void a_status_has_the_numbers_of_its_client(void)
{
    mem_client fast, slow;
    begin(false, 0);
    mem_join(&fast, transport, "fast", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&slow, transport, "slow", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    for (int i = 0; i < 200; i++) turn(&fast, i % 10 == 9 ? &slow : NULL);
    slow.n_text[PAL_CONTROL_STATUS] = 0;
    for (int i = 0; i < 30; i++) turn(&fast, &slow);
    const pal_wire_status *of_fast = &fast.last[PAL_CONTROL_STATUS].status,
                          *of_slow = &slow.last[PAL_CONTROL_STATUS].status;
    REQUIRE(slow.n_text[PAL_CONTROL_STATUS] > 0);
    CHECK_INT(of_fast->tick, of_slow->tick);
    CHECK_INT(of_fast->n_viewer, 2);
    CHECK_INT(of_slow->n_viewer, 2);
    CHECK_INT(of_fast->n_skipped, 0);
    CHECK_LE(100, of_slow->n_skipped); /* of 200 cycles it took one in ten */
    CHECK(of_fast->bytes_s > 0 && of_slow->bytes_s > 0);
    CHECK_INT(fast.n_bad + slow.n_bad, 0);
    mem_end(&fast), mem_end(&slow);
    end();
}

/* whatever tier a frame is of and however long its tissue has been at rest; mem_client counts those that do not grow */
static void numbers_grow_through_every_change_of_tier(void)
{
    mem_client c, all;
    double fine = until_coarser(&all, &c, PAL_WIRE_ROLE_TRAINEE);
    mem_text(&c, "{\"type\":\"command\",\"verb\":\"pause\"}");
    UNTIL(c.last[PAL_CONTROL_STATUS].status.paused, &all, &c);
    int before = c.n_frame;
    for (int i = 0; i < 20000 && (double)c.frame.q_m > 1.5 * fine; i++) turn(&all, &c);
    CHECK_NEAR((double)c.frame.q_m / fine, 1, 1e-5); /* at rest too it gets the finer one */
    CHECK_LE(c.n_frame - before, 4);                 /* one a change: perhaps a tier down, then two up */
    turn(&all, &c);
    REQUIRE(c.position_m && all.position_m);
    CHECK(memcmp(c.position_m, all.position_m, c.asset->order->n_vertex * 3 * sizeof(float)) == 0);
    CHECK_INT(c.n_bad, 0);
    CHECK_INT(all.n_bad, 0);
    mem_end(&c);
    mem_end(&all);
    end();
}

/* until the clients have heard what has changed: a quarter of a second at most */
static void hear(mem_client *a, mem_client *b)
{
    served_turn(250000000u, a, b);
    served_turn(1, a, b);
}

static void a_tool_has_one_holder(void)
{
    mem_client a, b, c;
    begin(true, 0);
    mem_join(&a, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, 1);
    mem_join(&b, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, 1);
    mem_pull(&a, 1000), mem_pull(&b, 1000);
    CHECK_INT(a.last[PAL_CONTROL_HELLO].hello.you_tool, 1);
    CHECK_INT(b.last[PAL_CONTROL_HELLO].hello.you_tool, PAL_WIRE_TOOL_NONE);
    CHECK_TEXT(b.last[PAL_CONTROL_ERROR].error.code, "tool_taken");
    CHECK(strcmp(b.last[PAL_CONTROL_HELLO].hello.you_name, "Ada") != 0); /* names are unique */
    mem_text(&b, "{\"type\":\"take_tool\",\"tool\":0}");
    mem_join(&c, transport, "Eve", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_ANY);
    mem_pull(&c, 1000);
    CHECK_INT(c.last[PAL_CONTROL_HELLO].hello.you_tool, PAL_WIRE_TOOL_NONE);
    CHECK_TEXT(c.last[PAL_CONTROL_ERROR].error.code, "tool_taken");
    mem_text(&c, "{\"type\":\"take_tool\",\"tool\":7}");
    mem_pull(&c, 1000);
    CHECK_TEXT(c.last[PAL_CONTROL_ERROR].error.code, "tool");
    /* one who goes leaves the tool to others */
    mem_end(&a);
    mem_text(&c, "{\"type\":\"take_tool\",\"tool\":1}");
    hear(&b, &c);
    CHECK_INT(c.last[PAL_CONTROL_MEMBERS].members.n_member, 2);
    CHECK_INT(c.last[PAL_CONTROL_MEMBERS].members.member[1].tool >= 0, 1);
    mem_text(&c, "{\"type\":\"release_tool\"}");
    mem_text(&b, "{\"type\":\"take_tool\",\"tool\":1}");
    hear(&b, &c);
    bool fixed = false;
    for (int i = 0; i < 2; i++) {
        const pal_wire_member *m = &b.last[PAL_CONTROL_MEMBERS].members.member[i];
        fixed |= m->id == b.last[PAL_CONTROL_HELLO].hello.you_id && m->tool == 1;
    }
    CHECK(fixed);
    mem_end(&b);
    mem_end(&c);
    end();
}

static int tool_of(const mem_client *c)
{
    const pal_control *members = &c->last[PAL_CONTROL_MEMBERS];
    for (uint32_t i = 0; i < members->members.n_member; i++)
        if (members->members.member[i].id == c->last[PAL_CONTROL_HELLO].hello.you_id)
            return members->members.member[i].tool;
    return -2;
}

/* Ada presses at 2, moves on to 3, and lets go at 4, all before the next step; Bob's poses are apart from hers */
static void a_press_between_two_steps_has_a_step_of_its_own(void)
{
    mem_client a, b;
    begin(false, 0);
    mem_join(&a, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, 0);
    mem_join(&b, transport, "Bob", PAL_WIRE_ROLE_TRAINEE, 1);
    UNTIL(a.n_tools && b.n_tools, &a, &b);
    for (uint32_t seq = 1; seq <= 5; seq++) {
        const double at[3] = {0.01 * seq, 0, 0.3};
        mem_pose_with(&a, 0, seq, at, seq == 2 || seq == 3 ? PAL_WIRE_GRASP : 0);
        mem_pose(&b, 1, 10 + seq, at);
    }
    static const uint32_t wanted[] = {2, 4, 5};
    for (int k = 0; k < 3; k++) {
        served_turn(served_step_ns, &a, &b);
        CHECK_INT(a.tools.tool[0].echo_seq, wanted[k]);
        CHECK_NEAR((double)a.tools.tool[0].position_m[0], 0.01 * wanted[k], 1e-7);
        CHECK_INT(a.tools.tool[1].echo_seq, 15);
    }
    mem_end(&a), mem_end(&b);
    end();
}

/* half a second: Ada moves her tool, Bob's device lies still */
static void lie_still(mem_client *a, mem_client *b, mem_client *c, int k)
{
    const double moving[3] = {0.01 + 0.005 * (k % 2), 0, 0.3}, still[3] = {0.02 + 0.0002 * (k % 2), 0, 0.3};
    mem_pose(a, 0, (uint32_t)k + 1, moving);
    if (b) mem_pose(b, 1, (uint32_t)k + 1, still);
    served_turn(500000000u, a, b);
    mem_pull(c, 1000);
}

static void an_unmoved_tool_goes_to_who_waits_for_one(void)
{
    mem_client a, b, c;
    begin(true, 0);
    mem_join(&a, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, 0);
    mem_join(&b, transport, "Bob", PAL_WIRE_ROLE_TRAINEE, 1);
    mem_join(&c, transport, "Cat", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    for (int k = 0; k < 116; k++) lie_still(&a, &b, &c, k);
    CHECK_TEXT(c.last[PAL_CONTROL_ERROR].error.code, "tool_taken");
    CHECK_INT(tool_of(&b), 1);
    CHECK_INT(b.n_text[PAL_CONTROL_ERROR], 0);
    for (int k = 116; k < 126; k++) lie_still(&a, &b, &c, k);
    CHECK_INT(tool_of(&a), 0);
    CHECK_INT(tool_of(&b), PAL_WIRE_TOOL_NONE);
    CHECK_INT(tool_of(&c), 1);
    CHECK_TEXT(b.last[PAL_CONTROL_ERROR].error.code, "tool_idle");
    CHECK(strstr(b.last[PAL_CONTROL_ERROR].error.text, "held by Cat") != NULL);
    /* nobody waits: it is kept, however still it lies */
    for (int k = 126; k < 270; k++) lie_still(&a, NULL, &c, k), mem_pull(&b, 1000);
    CHECK_INT(tool_of(&c), 1);
    mem_end(&a), mem_end(&b), mem_end(&c);
    end();
}

static void pose_of_the_holder_moves_the_tool_and_is_echoed(void)
{
    mem_client a, b;
    const double at[3] = {0.01, -0.02, 0.3}, elsewhere[3] = {0.5, 0.5, 0.5};
    begin(false, 0);
    mem_join(&a, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, 0);
    mem_join(&b, transport, "Bob", PAL_WIRE_ROLE_TRAINEE, 1);
    UNTIL(a.n_tools && b.n_tools, &a, &b);
    CHECK(a.tools.tool[0].flags & PAL_WIRE_TOOL_AWAY);
    mem_pose(&a, 0, 7, at);
    mem_pose(&b, 0, 9, elsewhere); /* not his */
    UNTIL(b.tools.tool[0].echo_seq == 7, &a, &b);
    CHECK_INT(b.tools.tool[0].echo_stamp_us, 1007);
    CHECK_INT(b.tools.tool[0].holder, a.last[PAL_CONTROL_HELLO].hello.you_id);
    for (int i = 0; i < 3; i++) CHECK_NEAR((double)b.tools.tool[0].position_m[i], at[i], 1e-7);
    CHECK(b.tools.tool[0].colour != b.tools.tool[1].colour);
    /* its contact model goes to the holder alone */
    UNTIL(a.n_haptic > 0 && a.haptic.echo_seq == 7, &a, &b);
    CHECK_INT(b.n_haptic, 0);
    CHECK_INT(a.haptic.tool, 0);
    /* the next holder has nothing to be echoed */
    mem_end(&a);
    mem_text(&b, "{\"type\":\"take_tool\",\"tool\":0}");
    turn(&b, NULL);
    UNTIL(b.tools.tool[0].holder == b.last[PAL_CONTROL_HELLO].hello.you_id, &b, NULL);
    CHECK_INT(b.tools.tool[0].echo_seq, 0);
    mem_end(&b);
    end();
}

/* 5 N where the server has none, then none: the mean of the squares follows within seconds */
static void force_of_a_device_is_compared_with_the_servers(void)
{
    mem_client a;
    uint8_t bytes[PAL_WIRE_POSE_BYTES];
    pal_wire_pose pose = {.flags = PAL_WIRE_POSE_FORCES_ON,
                          .position_m = {0, 0, 0.3},
                          .quaternion = {1, 0, 0, 0},
                          .force_N = {3, 0, 4},
                          .grip = 0.25f};
    begin(true, 0);
    mem_join(&a, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, 0);
    UNTIL(a.n_text[PAL_CONTROL_STATUS] > 0, &a, NULL);
    const pal_wire_status *status = &a.last[PAL_CONTROL_STATUS].status;
    CHECK_INT(status->n_device, 0);
    for (int part = 0; part < 3; part++) {
        for (int i = 0; i < 180; i++) {
            pose.seq++;
            REQUIRE(pal_wire_put_pose(bytes, sizeof bytes, &pose) == sizeof bytes);
            pal_mem_send(a.peer, bytes, sizeof bytes, false);
            turn(&a, NULL);
        }
        const pal_wire_device *device = &status->device[0];
        printf("  %u devices, force off by %.3g N rms, opening %.3g\n", status->n_device, device->force_error_N,
               device->opening);
        CHECK_INT(status->n_device, part < 2);
        if (part < 2) CHECK_NEAR(device->opening, 0.25, 1e-6);
        /* after 2.5 to 3 s, as status comes twice a second: 1 - exp(-2.5) of the mean */
        if (part == 0) CHECK(device->force_error_N > 5 * sqrt(1 - exp(-2.4)) && device->force_error_N <= 5);
        if (part == 1) CHECK(device->force_error_N > 0 && device->force_error_N < 5 * sqrt(exp(-2.4)));
        if (part == 0) pose.force_N[0] = pose.force_N[2] = 0;
        if (part == 1) pose.flags = 0, pose.grip = 0;
    }
    mem_end(&a);
    end();
}

static void viewer_moves_no_tool_and_gives_no_command(void)
{
    mem_client v, t;
    const double at[3] = {0, 0, 0.1};
    begin(false, 0);
    mem_join(&v, transport, "Vera", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_ANY);
    mem_join(&t, transport, "Tim", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    UNTIL(v.n_tools && t.n_tools, &v, &t);
    CHECK_INT(v.last[PAL_CONTROL_HELLO].hello.you_tool, PAL_WIRE_TOOL_NONE);
    for (uint32_t i = 1; i < 20; i++) {
        mem_pose(&v, 0, i, at);
        turn(&v, &t);
    }
    CHECK_TEXT(v.last[PAL_CONTROL_ERROR].error.code, "role");
    CHECK_INT(v.n_text[PAL_CONTROL_ERROR], 1); /* said once a second, not every time */
    CHECK(t.tools.tool[0].flags & PAL_WIRE_TOOL_AWAY);
    mem_text(&v, "{\"type\":\"take_tool\",\"tool\":0}");
    mem_text(&v, "{\"type\":\"command\",\"verb\":\"pause\"}");
    for (int i = 0; i < 40; i++) turn(&v, &t);
    CHECK_INT(v.n_text[PAL_CONTROL_ERROR], 3);
    CHECK(!v.last[PAL_CONTROL_STATUS].status.paused);
    CHECK_INT(pal_mem_code(v.peer), 0);
    mem_end(&v);
    mem_end(&t);
    end();
}

static void commands_are_checked_and_carried_out(void)
{
    mem_client a;
    begin(true, 0);
    mem_join(&a, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    static const char *const refused[][2] = {
        {"{\"type\":\"command\",\"verb\":\"explode\"}", "verb"},
        {"{\"type\":\"command\",\"verb\":\"material\",\"target\":\"brain\",\"args\":{\"young_Pa\":1}}", "target"},
        {"{\"type\":\"command\",\"verb\":\"material\",\"target\":\"organ\",\"args\":{\"taste\":1}}", "args"},
        {"{\"type\":\"join\",\"name\":\"again\",\"role\":\"viewer\",\"tool\":-1}", "joined"}};
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++) {
        mem_text(&a, refused[i][0]);
        mem_pull(&a, 1000);
        CHECK_INT(a.n_text[PAL_CONTROL_ERROR], (int)i + 1);
        CHECK_TEXT(a.last[PAL_CONTROL_ERROR].error.code, refused[i][1]);
    }
    UNTIL(a.n_text[PAL_CONTROL_STATUS] > 0, &a, NULL);
    uint64_t tick = a.last[PAL_CONTROL_STATUS].status.tick;
    mem_text(&a, "{\"type\":\"command\",\"verb\":\"step\"}");
    UNTIL(a.last[PAL_CONTROL_STATUS].status.tick == tick + 1, &a, NULL);
    mem_text(&a, "{\"type\":\"command\",\"verb\":\"reset\"}");
    UNTIL(a.last[PAL_CONTROL_STATUS].status.tick == 0, &a, NULL);
    /* a material that the world refuses is reported in the status, and the session lives */
    mem_text(&a, "{\"type\":\"command\",\"verb\":\"material\",\"target\":\"organ\",\"args\":{\"young_Pa\":1e14}}");
    UNTIL(a.last[PAL_CONTROL_STATUS].status.diag[0], &a, NULL);
    UNTIL(a.n_text[PAL_CONTROL_ERROR] == 5, &a, NULL);
    CHECK(strstr(a.last[PAL_CONTROL_ERROR].error.text, "material: ") == a.last[PAL_CONTROL_ERROR].error.text);
    mem_text(&a, "{\"type\":\"command\",\"verb\":\"resume\"}");
    UNTIL(!a.last[PAL_CONTROL_STATUS].status.paused && a.last[PAL_CONTROL_STATUS].status.tick > 0, &a, NULL);
    CHECK_INT(pal_mem_code(a.peer), 0);
    mem_end(&a);
    end();
}

static void hostile_messages_close_with_a_reason_and_nobody_else_notices(void)
{
    mem_client good, bad;
    uint8_t pose[PAL_WIRE_POSE_BYTES], ack[PAL_WIRE_ACK_BYTES], long_one[5000] = {0};
    pal_wire_pose p = {.quaternion = {1, 0, 0, 0}};
    pal_wire_put_ack(ack, sizeof ack, &(pal_wire_ack){.cycle = 99999999});
    begin(false, 0);
    mem_join(&good, transport, "good", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    for (int kind = 0; kind < 11; kind++) {
        int code = PAL_WIRE_CLOSE_PROTOCOL;
        pal_wire_put_pose(pose, sizeof pose, &p);
        mem_join(&bad, transport, "bad", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
        UNTIL(bad.n_tools > 0, &good, &bad);
        switch (kind) {
        case 0:
            mem_text(&bad, "{not json");
            break;
        case 1:
            mem_text(&bad, "{\"type\":\"hello\"}");
            break; /* the server's own */
        case 2:
            mem_text(&bad, "{\"type\":\"take_tool\",\"tool\":\"x\"}");
            break;
        case 3:
            pal_mem_send(bad.peer, "\xFF\xFE\x00", 3, true);
            break;
        case 4:
            pal_mem_send(bad.peer, "garbage!garbage!", 16, false);
            break;
        case 5:
            pal_mem_send(bad.peer, pose, sizeof pose - 1, false);
            break;
        case 6:
            memcpy(pose + 24, "\0\0\0\0\0\0\xF8\x7F", 8), pal_mem_send(bad.peer, pose, sizeof pose, false);
            break;
        case 7:
            pal_mem_send(bad.peer, ack, sizeof ack, false);
            break;
        case 8:
            pal_mem_send(bad.peer, "", 0, false);
            break;
        case 9:
            pal_mem_send(bad.peer, long_one, sizeof long_one, false), code = PAL_WIRE_CLOSE_TOO_BIG;
            break;
        default:
            for (int i = 0; i < 400; i++) mem_text(&bad, "{\"type\":\"release_tool\"}");
            code = PAL_WIRE_CLOSE_RATE;
        }
        if (pal_mem_code(bad.peer) != code)
            CHECK_FAIL("hostile message %d: closed with %d, wanted %d", kind, pal_mem_code(bad.peer), code);
        CHECK(strlen(pal_mem_reason(bad.peer)) > 10);
        int before = good.n_tools;
        UNTIL(good.n_tools > before + 1, &good, &bad);
        mem_end(&bad);
    }
    hear(&good, NULL);
    CHECK_INT(good.last[PAL_CONTROL_MEMBERS].members.n_member, 1);
    CHECK_INT(good.n_bad, 0);
    CHECK_INT(pal_mem_code(good.peer), 0);
    mem_end(&good);
    end();
}

static void strangers_are_turned_away(void)
{
    mem_client a, b;
    begin(true, 2);
    pal_mem_peer *lost = pal_mem_connect(transport, "no-such-session"), *silent = pal_mem_connect(transport, "small");
    CHECK_INT(pal_mem_code(lost), PAL_WIRE_CLOSE_NO_SESSION);
    const double at[3] = {0, 0, 0};
    mem_client early = {.transport = transport, .peer = pal_mem_connect(transport, "")};
    mem_pose(&early, 0, 1, at);
    CHECK_INT(pal_mem_code(early.peer), PAL_WIRE_CLOSE_POLICY); /* join comes first */
    mem_end(&early);
    mem_join(&a, transport, "a", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    mem_join(&b, transport, "b", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    mem_client third;
    mem_join(&third, transport, "c", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE);
    CHECK_INT(pal_mem_code(third.peer), PAL_WIRE_CLOSE_FULL);
    for (int i = 0; i < 330 && !pal_mem_code(silent); i++) turn(&a, &b); /* 5.5 s */
    CHECK_INT(pal_mem_code(silent), PAL_WIRE_CLOSE_POLICY);
    CHECK_INT(pal_mem_code(a.peer) + pal_mem_code(b.peer), 0);
    pal_mem_leave(lost);
    pal_mem_leave(silent);
    mem_end(&third);
    mem_end(&a);
    mem_end(&b);
    end();
}

static void answers_that_nobody_reads_close_the_peer(void)
{
    mem_client a;
    begin(true, 0);
    mem_join(&a, transport, "a", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    size_t fixed = pal_packet_total();
    int n = 0;
    while (!pal_mem_code(a.peer) && n < 100) mem_text(&a, "{\"type\":\"ping\",\"stamp_ms\":1}"), n++;
    CHECK_INT(pal_mem_code(a.peer), PAL_WIRE_CLOSE_POLICY);
    CHECK(n > 16 && n < 64);
    CHECK_LE((double)pal_packet_total(), (double)fixed); /* what waited is gone */
    mem_end(&a);
    end();
}

int main(void)
{
    if (!small_scene_make(&organ, "small")) return 1;
    RUN(frames_decode_to_the_sessions_positions);
    RUN(newcomer_gets_hello_members_frame_and_tools_in_this_order);
    RUN(late_joiner_sees_the_paused_tissue_as_everybody_does);
    RUN(newcomer_sees_the_shape_of_now);
    RUN(stalled_client_costs_little_and_is_current_within_two_frames);
    RUN(without_acknowledgement_frames_stop_and_control_goes_on);
    RUN(slow_client_gets_coarser_frames_and_finer_ones_when_it_keeps_up);
    RUN(a_status_has_the_numbers_of_its_client);
    RUN(numbers_grow_through_every_change_of_tier);
    RUN(a_tool_has_one_holder);
    RUN(an_unmoved_tool_goes_to_who_waits_for_one);
    RUN(a_press_between_two_steps_has_a_step_of_its_own);
    RUN(pose_of_the_holder_moves_the_tool_and_is_echoed);
    RUN(force_of_a_device_is_compared_with_the_servers);
    RUN(viewer_moves_no_tool_and_gives_no_command);
    RUN(commands_are_checked_and_carried_out);
    RUN(hostile_messages_close_with_a_reason_and_nobody_else_notices);
    RUN(strangers_are_turned_away);
    RUN(answers_that_nobody_reads_close_the_peer);
    pal_prepared_free(&organ.mesh);
    return check_report();
}
