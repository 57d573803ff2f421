/* Components and bodies as clients see them: what they are told of the plan, who switches components, who resets a
 * frozen body. */
#include "server/estimate/estimator.h"
#include "tests/net/hub_scene.h"
#include "tests/net/server_fixture.h"

static small_scene organ;
static void hurt(void *user, pal_world *next, const pal_world *before)
{
    (void)user, (void)before;
    pal_world_body(next, 0)->x[31] = NAN;
}

/* a session that goes on from another one in a state that no guard lets pass */
static void begin_hurt(void)
{
    pal_session *first = session;
    pal_diagnostic diag = {""};
    if (pal_session_open_after(first, &organ.scene, &diag, &session)) CHECK_FAIL("no session: %s", diag.text);
    pal_session_transfer_begin(session, first, NULL, hurt, NULL);
    if (pal_session_transfer_end(session, first, &diag)) CHECK_FAIL("does not follow: %s", diag.text);
    pal_session_close(first);
    manual_clock_settle(&served_clock, 1);
}

static void begin(bool hurts)
{
    served_session(&organ.scene, (pal_session_options){0});
    if (hurts) begin_hurt();
    served_open((pal_server_options){0});
}

/* half a second, so that every turn is a tick of the hub */
static void turn(mem_client *a, mem_client *b)
{
    served_turn(500000000ull, a, b);
}

static int find(uint32_t n, char (*row)[PAL_WIRE_NAME_BYTES], const char *name)
{
    for (uint32_t r = 0; r < n; r++)
        if (!strcmp(row[r], name)) return (int)r;
    return -1;
}

#define COMPONENT(name, on)                                                                                            \
    "{\"type\":\"command\",\"verb\":\"component\",\"target\":\"" name "\",\"args\":{\"part\":0,\"enabled\":" #on "}}"

static void components_name_their_part_and_reason(void)
{
    mem_client ada;
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    UNTIL(ada.n_text[PAL_CONTROL_STATUS] > 2, &ada, NULL);
    const pal_wire_hello *h = &ada.last[PAL_CONTROL_HELLO].hello;
    CHECK(h->plan.n_component > 3 && h->plan.n_part == h->plan.n_component && h->plan.n_reason == h->plan.n_component);
    for (uint32_t r = 0; r < h->plan.n_component; r++) CHECK(h->plan.part[r] == 0 && h->plan.reason[r][0]);
    /* what moves and shows the body stays, an elastic component may go while there is another */
    static const char *const stays[] = {"verlet", "skin_output"}, *const goes[] = {"tet_volume", "edge_distance",
                                                                                   "gravity"};
    CHECK_INT(h->plan.n_required, h->plan.n_component);
    for (int i = 0; i < 2; i++) {
        int r = find(h->plan.n_component, (char(*)[PAL_WIRE_NAME_BYTES])h->plan.component, stays[i]);
        CHECK(r >= 0 && h->plan.required[r] == 1);
    }
    for (int i = 0; i < 3; i++) {
        int r = find(h->plan.n_component, (char(*)[PAL_WIRE_NAME_BYTES])h->plan.component, goes[i]);
        CHECK(r >= 0 && h->plan.required[r] == 0);
    }
    const pal_wire_status *s = &ada.last[PAL_CONTROL_STATUS].status;
    CHECK(s->n_component_name == 0 && s->n_disabled == 0 && s->n_state == 0);
    CHECK_INT(s->n_component, h->plan.n_component);
    mem_end(&ada);
    end();
}

static void an_instructor_switches_a_component_and_all_are_told(void)
{
    static mem_client ada, bo;
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    mem_join(&bo, transport, "Bo", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    UNTIL(ada.n_text[PAL_CONTROL_STATUS] > 2 && bo.n_text[PAL_CONTROL_STATUS] > 0, &ada, &bo);
    pal_wire_hello *h = &ada.last[PAL_CONTROL_HELLO].hello;
    const pal_wire_status *a = &ada.last[PAL_CONTROL_STATUS].status, *b = &bo.last[PAL_CONTROL_STATUS].status;
    REQUIRE(find(h->plan.n_component, h->plan.component, "tet_volume") >= 0);

    mem_text(&ada, COMPONENT("tet_volume", 0));
    UNTIL(a->n_disabled == 1 && b->n_disabled == 1, &ada, &bo);
    CHECK_TEXT(a->disabled[0].component, "tet_volume");
    CHECK_INT(a->disabled[0].part, 0);
    CHECK_INT(a->n_component, h->plan.n_component - 1);
    CHECK_INT(a->n_component_name, h->plan.n_component - 1);
    CHECK_INT(a->n_component_part, a->n_component_name);
    CHECK(find(a->n_component_name, (char(*)[PAL_WIRE_NAME_BYTES])a->component, "tet_volume") < 0);

    mem_text(&ada, COMPONENT("tet_volume", 1));
    UNTIL(a->n_disabled == 0 && b->n_disabled == 0, &ada, &bo);
    CHECK_INT(a->n_component, h->plan.n_component);
    CHECK_INT(a->n_component_name, 0); /* the plan of hello again */

    /* what the world refuses changes nothing and is said in the status, and to who asked as an error */
    uint64_t n_refused = a->n_refused;
    int n_error = ada.n_text[PAL_CONTROL_ERROR], n_other = bo.n_text[PAL_CONTROL_ERROR];
    mem_text(&ada, COMPONENT("no_such_component", 0));
    UNTIL(a->n_refused == n_refused + 1 && a->diag[0], &ada, &bo);
    CHECK(strstr(a->diag, "no_such_component"));
    UNTIL(ada.n_text[PAL_CONTROL_ERROR] == n_error + 1, &ada, &bo);
    CHECK_TEXT(ada.last[PAL_CONTROL_ERROR].error.code, "refused");
    CHECK(strstr(ada.last[PAL_CONTROL_ERROR].error.text, "no_such_component"));
    mem_text(&ada, COMPONENT("skin_output", 0));
    UNTIL(ada.n_text[PAL_CONTROL_ERROR] == n_error + 2, &ada, &bo);
    CHECK(strstr(ada.last[PAL_CONTROL_ERROR].error.text, "cannot be switched off"));
    CHECK_INT(bo.n_text[PAL_CONTROL_ERROR], n_other);
    CHECK_INT(a->n_component, h->plan.n_component);
    mem_end(&ada), mem_end(&bo);
    end();
}

static void others_do_not_and_bad_orders_are_refused(void)
{
    static const char *const bad[] = {
        COMPONENT("tet_volume", 0), "{\"type\":\"command\",\"verb\":\"component\",\"target\":\"tet_volume\"}",
        "{\"type\":\"command\",\"verb\":\"component\",\"target\":\"a\",\"args\":{\"part\":1,\"enabled\":0}}",
        "{\"type\":\"command\",\"verb\":\"reset\",\"target\":\"liver\"}"};
    static const char *const summary[] = {"component: only for instructors, and trainees with the right component",
                                          "component: part is missing", "component: part 1, wanted 0 to 0",
                                          "there is no body liver"};
    static mem_client ada, bo;
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, PAL_WIRE_TOOL_NONE);
    mem_join(&bo, transport, "Bo", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    turn(&ada, &bo);
    for (int i = 0; i < 4; i++) {
        mem_client *who = i == 0 ? &bo : &ada;
        int before = who->n_text[PAL_CONTROL_ERROR];
        mem_text(who, bad[i]);
        UNTIL(who->n_text[PAL_CONTROL_ERROR] > before, &ada, &bo);
        CHECK_TEXT(who->last[PAL_CONTROL_ERROR].error.text, summary[i]);
    }
    CHECK_INT(ada.last[PAL_CONTROL_STATUS].status.n_disabled, 0);
    mem_end(&ada), mem_end(&bo);
    end();
}

static void everybody_resets_what_was_stopped_and_a_viewer_nothing_else(void)
{
    static mem_client cy;
    begin(true);
    mem_join(&cy, transport, "Cy", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    const pal_wire_status *s = &cy.last[PAL_CONTROL_STATUS].status;
    UNTIL(s->frozen && s->n_state == 1, &cy, NULL);
    CHECK(s->state[0].frozen && s->state[0].n_safeguard == 1);
    CHECK(strstr(s->state[0].reason, "is not finite"));
    mem_text(&cy, "{\"type\":\"command\",\"verb\":\"reset\",\"target\":\"organ\"}");
    UNTIL(!s->frozen && s->n_state == 0, &cy, NULL);
    CHECK_INT(cy.n_text[PAL_CONTROL_ERROR], 0);
    mem_text(&cy, "{\"type\":\"command\",\"verb\":\"reset\",\"target\":\"organ\"}");
    UNTIL(cy.n_text[PAL_CONTROL_ERROR] == 1, &cy, NULL);
    CHECK_TEXT(cy.last[PAL_CONTROL_ERROR].error.text,
               "reset: only for instructors, and trainees with the right steer, but for a frozen body");
    mem_end(&cy);
    end();
}

/* a counter of /metrics */
static double counter(const char *name)
{
    pal_reply reply = {0};
    pal_mem_get(transport, "/metrics", &reply);
    if (!reply.body) return NAN;
    char line[128];
    snprintf(line, sizeof line, "\n%s ", name);
    const char *text = (const char *)reply.body->bytes, *at = strstr(text, line);
    double value = at ? atof(at + strlen(line)) : NAN;
    pal_packet_drop(reply.body);
    return value;
}

/* at rest, with a client: no component runs, nothing is encoded and nothing estimated; a touch wakes it */
static void a_body_asleep_is_neither_stepped_nor_encoded(void)
{
    static mem_client ada;
    pal_config_entry gravity = organ.scene.body[0].effect[0];
    pal_entry_init(&organ.scene.body[0].effect[0], "effects[0]", "sleep");
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_TRAINEE, 0);
    const pal_wire_status *s = &ada.last[PAL_CONTROL_STATUS].status;
    UNTIL(s->n_state == 1 && s->state[0].asleep && ada.n_frame > 0, &ada, NULL);
    UNTIL(s->n_component > 3, &ada, NULL);
    double component_ms[PAL_WIRE_COMPONENT_MAX];
    memcpy(component_ms, s->component_ms, sizeof component_ms);
    double n_encode = counter("palpate_encodes_total");
    uint64_t tick = s->tick, made = pal_estimator_count();
    int n_frame = ada.n_frame, n_tools = ada.n_tools;
    UNTIL(s->tick > tick + 80 && ada.n_tools > n_tools + 60, &ada, NULL);
    /* means of the last steps, each of which weighs a fifth: what took nothing for 60 steps is a millionth by now */
    for (uint32_t r = 0; r < s->n_component; r++) CHECK_LE(s->component_ms[r], 1e-3 * component_ms[r]);
    CHECK(s->state[0].asleep);
    CHECK_INT((int)counter("palpate_encodes_total"), (int)n_encode);
    CHECK_INT(ada.n_frame, n_frame);
    CHECK(pal_estimator_threads() == 0 && pal_estimator_count() == made);
    /* a tool comes through its middle */
    const pal_surface *surface = &organ.mesh.surface;
    double at[3] = {surface->x[0], surface->x[1], surface->x[2]};
    for (uint32_t seq = 1; ada.n_frame == n_frame && seq < 4000; seq++) {
        mem_pose(&ada, 0, seq, at);
        turn(&ada, NULL);
    }
    CHECK(ada.n_frame > n_frame && counter("palpate_encodes_total") > n_encode);
    mem_end(&ada);
    end();
    organ.scene.body[0].effect[0] = gravity;
}

/* while paused a tool is shown in frames that no step has made */
static void the_histogram_counts_steps(void)
{
    static mem_client ada;
    const char *name = "palpate_sim_step_seconds_by_session_count{session=\"0\"}";
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_INSTRUCTOR, 0);
    UNTIL(ada.n_tools > 30, &ada, NULL);
    mem_text(&ada, "{\"type\":\"command\",\"verb\":\"pause\"}");
    UNTIL(ada.last[PAL_CONTROL_STATUS].status.paused, &ada, NULL);
    const double n_step = counter(name);
    const int n_tools = ada.n_tools;
    CHECK(n_step > 0);
    for (uint32_t seq = 1; seq <= 40; seq++) {
        mem_pose(&ada, 0, seq, (const double[3]){1e-4 * seq, 0, 0.2});
        turn(&ada, NULL);
    }
    CHECK(ada.n_tools > n_tools + 5);
    CHECK_NEAR(counter(name), n_step, 0);
    mem_end(&ada);
    end();
}

int main(void)
{
    if (!small_scene_make(&organ, "small")) return 1;
    organ.scene.body[0].material.young_Pa = 5e4; /* it bears its weight: nothing inverts, no safeguard acts */
    RUN(components_name_their_part_and_reason);
    RUN(an_instructor_switches_a_component_and_all_are_told);
    RUN(others_do_not_and_bad_orders_are_refused);
    RUN(a_body_asleep_is_neither_stepped_nor_encoded);
    RUN(the_histogram_counts_steps);
    RUN(everybody_resets_what_was_stopped_and_a_viewer_nothing_else);
    pal_prepared_free(&organ.mesh);
    return check_report();
}
