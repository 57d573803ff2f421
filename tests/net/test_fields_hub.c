/* Fields over the surface, sent to those who ask for them: by a real session and peers inside the process. */
#include "tests/net/hub_scene.h"
#include "tests/net/server_fixture.h"

static small_scene organ;

static void begin(bool paused)
{
    served_begin(&organ.scene, (pal_session_options){.start_paused = paused}, (pal_server_options){0});
}

static void turn(mem_client *a, mem_client *b)
{
    served_turn(FRAME_NS, a, b);
}

/* largest value that a client was shown last, and largest distance of its vertices from rest */
static double shown_max(const mem_client *c)
{
    double max = 0;
    for (uint32_t i = 0; i < c->asset->order->n_vertex; i++) max = fmax(max, pal_field_value(&c->field, c->level[i]));
    return max;
}

static double moved_max(const mem_client *c)
{
    double max = 0;
    for (uint32_t i = 0; i < c->asset->order->n_vertex; i++) {
        double d2 = 0;
        for (int k = 0; k < 3; k++) {
            double d = (double)c->position_m[3 * i + (uint32_t)k] - (double)c->asset->rest_m[3 * i + (uint32_t)k];
            d2 += d * d;
        }
        max = fmax(max, sqrt(d2));
    }
    return max;
}

static void a_field_goes_only_to_those_who_ask_and_ends_with_them(void)
{
    mem_client ada, bob;
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&bob, transport, "Bob", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    UNTIL(ada.n_tools > 2 && bob.n_tools > 2, &ada, &bob);
    const pal_wire_hello *hello = &ada.last[PAL_CONTROL_HELLO].hello;
    static const char *const offered[] = {"displacement", "energy",  "stiffness", "strain",
                                          "distortion",   "density", "damping"};
    CHECK_INT(hello->part[0].n_field, 7);
    for (int i = 0; i < 7; i++) CHECK_TEXT(hello->part[0].field[i], offered[i]);
    uint32_t n_row = hello->plan.n_component;
    mem_text(&ada, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\"}");
    UNTIL(ada.n_field > 0, &ada, &bob);
    CHECK(ada.field.field == PAL_WIRE_FIELD_DISPLACEMENT_M && ada.field.part == 0 && ada.field.epoch == 1);
    /* the plan says so while it lasts */
    UNTIL(bob.last[PAL_CONTROL_STATUS].status.n_component_name > 0, &ada, &bob);
    const pal_wire_status *status = &bob.last[PAL_CONTROL_STATUS].status;
    CHECK_INT(status->n_component_name, n_row + 1);
    CHECK_INT(status->n_component, n_row + 1);
    CHECK_TEXT(status->component[n_row], "field_output");
    /* about ten a second of this clock, and of the same motion as the frames */
    mem_text(&bob, "{\"type\":\"command\",\"verb\":\"reset\"}");
    for (int i = 0; i < 100; i++) turn(&ada, &bob);
    int before = ada.n_field;
    for (int i = 0; i < 120; i++) turn(&ada, &bob); /* 2 s */
    CHECK_INT(ada.n_field - before, 20);
    REQUIRE(ada.level && ada.position_m);
    CHECK_NEAR(shown_max(&ada), (double)ada.field.high, 1e-9);
    CHECK_LE(fabs(shown_max(&ada) - moved_max(&ada)), 0.3 * moved_max(&ada) + 2e-4);
    CHECK_INT(bob.n_field, 0);
    /* a second one who looks is served from what is there, the row stays until the last has gone */
    mem_text(&bob, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\"}");
    UNTIL(bob.n_field > 0, &ada, &bob);
    mem_text(&ada, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"none\"}");
    for (int i = 0; i < 20; i++) turn(&ada, &bob);
    int ended = ada.n_field, may_continue = bob.n_field;
    UNTIL(bob.n_field > may_continue + 3, &ada, &bob);
    CHECK_INT(ada.n_field, ended);
    mem_end(&bob); /* it goes without a word */
    UNTIL(ada.last[PAL_CONTROL_STATUS].status.n_component == n_row, &ada, NULL);
    CHECK_INT(ada.last[PAL_CONTROL_STATUS].status.n_component_name, 0);
    CHECK_INT(ada.n_bad, 0);
    mem_end(&ada);
    end();
}

static void a_field_comes_while_paused_and_is_not_sent_twice(void)
{
    mem_client ada;
    begin(true);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    UNTIL(ada.n_tools > 0, &ada, NULL);
    mem_text(&ada, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\"}");
    UNTIL(ada.n_field > 0, &ada, NULL);
    for (int i = 0; i < 60; i++) turn(&ada, NULL);
    CHECK_INT(ada.n_field, 1);
    CHECK_LE((double)ada.field.high, 1e-6);
    mem_end(&ada);
    end();
}

static void a_client_that_acknowledges_nothing_gets_no_more_fields(void)
{
    mem_client deaf, other;
    begin(false);
    mem_join(&deaf, transport, "deaf", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&other, transport, "other", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    UNTIL(deaf.n_tools > 2 && other.n_tools > 2, &other, &deaf);
    mem_text(&deaf, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\"}");
    mem_text(&other, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\"}");
    UNTIL(deaf.n_field > 1, &other, &deaf);
    deaf.mute = true;
    for (int i = 0; i < 60; i++) turn(&other, &deaf);
    int before = deaf.n_field, there = other.n_field;
    for (int i = 0; i < 120; i++) turn(&other, &deaf);
    CHECK_INT(deaf.n_field, before);
    CHECK(other.n_field > there + 5);
    mem_end(&deaf);
    mem_end(&other);
    end();
}

static void energies_go_into_the_status_of_those_who_ask(void)
{
    mem_client ada, bob;
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&bob, transport, "Bob", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY);
    UNTIL(ada.n_tools > 2 && bob.n_tools > 2, &ada, &bob);
    const pal_wire_status *of_ada = &ada.last[PAL_CONTROL_STATUS].status,
                          *of_bob = &bob.last[PAL_CONTROL_STATUS].status;
    mem_text(&ada, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"none\",\"energy\":true}");
    UNTIL(of_ada->n_energy == 1 && of_bob->n_component_name > 0, &ada, &bob);
    CHECK_TEXT(of_bob->component[of_bob->n_component_name - 1], "field_output");
    CHECK(of_ada->energy[0].part == 0 && of_ada->energy[0].elastic_J >= 0 && of_ada->energy[0].kinetic_J >= 0);
    CHECK(of_ada->energy[0].time_s <= of_ada->sim_time_s && of_ada->energy[0].time_s > of_ada->sim_time_s - 0.2);
    CHECK_INT(of_bob->n_energy, 0);
    CHECK_INT(ada.n_field, 0);
    mem_text(&ada, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"none\"}");
    UNTIL(of_ada->n_energy == 0 && of_bob->n_component_name == 0, &ada, &bob);
    mem_end(&ada);
    mem_end(&bob);
    end();
}

/* the asset names the tetrahedra, messages come to those who ask for them only, at most ten a second */
static void the_interior_goes_only_to_those_who_ask_for_it(void)
{
    mem_client ada, bob;
    pal_reply reply;
    pal_asset *asset = NULL;
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    mem_join(&bob, transport, "Bob", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    UNTIL(ada.n_tools > 2 && bob.n_tools > 2, &ada, &bob);
    pal_mem_get(ada.transport, ada.last[PAL_CONTROL_HELLO].hello.part[0].interior, &reply);
    REQUIRE(reply.body && !pal_asset_decode(reply.body->bytes, reply.body->n_byte, &asset));
    CHECK_INT(asset->n_triangle, 2 * (uint32_t)organ.mesh.tets.n_tet);
    CHECK_INT(asset->order->n_vertex, (uint32_t)organ.mesh.tets.n_node);
    for (uint32_t t = 0; t < asset->n_triangle / 2; t++) {
        const uint32_t *face = asset->triangle + 6 * (size_t)t;
        const int32_t *tet = organ.mesh.tets.tet + 4 * (size_t)t;
        CHECK(face[0] == (uint32_t)tet[0] && face[1] == (uint32_t)tet[1] && face[2] == (uint32_t)tet[2]);
        CHECK(face[3] == face[2] && face[4] == face[1] && face[5] == (uint32_t)tet[3]);
    }
    mem_text(&ada, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\",\"interior\":true}");
    mem_text(&bob, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\"}");
    UNTIL(ada.n_interior > 0 && bob.n_field > 3, &ada, &bob);
    CHECK_INT(ada.interior.n_node, asset->order->n_vertex);
    CHECK_INT(ada.interior.field, PAL_WIRE_FIELD_DISPLACEMENT_M);
    CHECK_INT(bob.n_interior, 0);
    mem_text(&bob, "{\"type\":\"command\",\"verb\":\"reset\"}");
    for (int i = 0; i < 60; i++) turn(&ada, &bob);
    const int before = ada.n_interior;
    for (int i = 0; i < 120; i++) turn(&ada, &bob); /* 2 s */
    CHECK(ada.n_interior - before <= 21);
    mem_text(&ada, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement\"}");
    for (int i = 0; i < 20; i++) turn(&ada, &bob);
    const int ended = ada.n_interior, field = ada.n_field;
    mem_text(&bob, "{\"type\":\"command\",\"verb\":\"reset\"}");
    UNTIL(ada.n_field > field, &ada, &bob);
    CHECK_INT(ada.n_interior, ended);
    CHECK_INT(ada.n_bad + bob.n_bad, 0);
    pal_asset_destroy(asset);
    pal_packet_drop(reply.body);
    mem_end(&ada);
    mem_end(&bob);
    end();
}

/* one connection may have several fields of a part, as a relay needs, each as often as alone */
static void several_fields_of_a_part_come_at_once(void)
{
    mem_client ada;
    begin(false);
    mem_join(&ada, transport, "Ada", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    UNTIL(ada.n_tools > 2, &ada, NULL);
    mem_text(&ada, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"displacement energy\",\"interior\":true}");
    UNTIL(ada.n_field > 5, &ada, NULL);
    mem_text(&ada, "{\"type\":\"command\",\"verb\":\"reset\"}");
    for (int i = 0; i < 60; i++) turn(&ada, NULL);
    const int displacement = ada.n_of_field[PAL_WIRE_FIELD_DISPLACEMENT_M],
              energy = ada.n_of_field[PAL_WIRE_FIELD_ENERGY_J_M3];
    for (int i = 0; i < 120; i++) turn(&ada, NULL); /* 2 s */
    CHECK_INT(ada.n_of_field[PAL_WIRE_FIELD_DISPLACEMENT_M] - displacement, 20);
    CHECK_INT(ada.n_of_field[PAL_WIRE_FIELD_ENERGY_J_M3] - energy, 20);
    CHECK(ada.n_of_interior[PAL_WIRE_FIELD_DISPLACEMENT_M] > 3 && ada.n_of_interior[PAL_WIRE_FIELD_ENERGY_J_M3] > 3);
    /* one of them goes on alone */
    mem_text(&ada, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"energy\"}");
    const int ended = ada.n_of_field[PAL_WIRE_FIELD_DISPLACEMENT_M], inside = ada.n_interior,
              energy_before = ada.n_of_field[PAL_WIRE_FIELD_ENERGY_J_M3];
    UNTIL(ada.n_of_field[PAL_WIRE_FIELD_ENERGY_J_M3] > energy_before + 5, &ada, NULL);
    CHECK_INT(ada.n_of_field[PAL_WIRE_FIELD_DISPLACEMENT_M], ended);
    CHECK_INT(ada.n_interior, inside);
    CHECK_INT(ada.n_bad, 0);
    mem_end(&ada);
    end();
}

static void what_cannot_be_shown_is_answered_with_a_sentence(void)
{
    static const struct {
        const char *text, *code, *named;
    } bad[] = {{"{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"von_mises\"}", "field", "von Mises stress"},
               {"{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"rainbow\"}", "field", "rainbow"},
               {"{\"type\":\"subscribe_field\",\"part\":7,\"field\":\"displacement\"}", "part", "7"}};
    mem_client a;
    begin(true);
    mem_join(&a, transport, "a", PAL_WIRE_ROLE_VIEWER, PAL_WIRE_TOOL_NONE);
    UNTIL(a.n_tools > 0, &a, NULL);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        mem_text(&a, bad[i].text);
        UNTIL(a.n_text[PAL_CONTROL_ERROR] == (int)i + 1, &a, NULL);
        CHECK_TEXT(a.last[PAL_CONTROL_ERROR].error.code, bad[i].code);
        CHECK(strstr(a.last[PAL_CONTROL_ERROR].error.text, bad[i].named) != NULL);
    }
    mem_text(&a, "{\"type\":\"subscribe_field\",\"part\":0,\"field\":\"none\"}");
    for (int i = 0; i < 30; i++) turn(&a, NULL);
    CHECK_INT(a.n_text[PAL_CONTROL_ERROR], 3);
    CHECK_INT(a.n_field, 0);
    CHECK_INT(pal_mem_code(a.peer), 0);
    mem_end(&a);
    end();
}

int main(void)
{
    if (!small_scene_make(&organ, "small")) return 1;
    RUN(a_field_goes_only_to_those_who_ask_and_ends_with_them);
    RUN(a_field_comes_while_paused_and_is_not_sent_twice);
    RUN(a_client_that_acknowledges_nothing_gets_no_more_fields);
    RUN(energies_go_into_the_status_of_those_who_ask);
    RUN(the_interior_goes_only_to_those_who_ask_for_it);
    RUN(several_fields_of_a_part_come_at_once);
    RUN(what_cannot_be_shown_is_answered_with_a_sentence);
    pal_prepared_free(&organ.mesh);
    return check_report();
}
