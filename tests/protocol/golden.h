/* The contents of the golden packets, shared by the program that writes them and the test that reads them. Values are
 * chosen so that a swapped, shifted or narrowed field shows: all different, negative, beyond 32 bits, not exact in
 * binary. */
#ifndef TESTS_PROTOCOL_GOLDEN_H
#define TESTS_PROTOCOL_GOLDEN_H
#include "protocol/control.h"
#include "protocol/field_codec.h"
#include "protocol/topology_delta_codec.h"
#include "protocol/wire.h"
#include "tests/protocol/frame_shapes.h"

#include <stdio.h>

static const struct {
    const char *name;
    shape_motion motion;
    bool affine;
    double error_m;
} golden_motion[] = {
    {"rest", MOTION_REST, false, 5e-5},         {"bend", MOTION_BEND, false, 5e-5},
    {"storm", MOTION_STORM, false, 1e-6},       {"spike", MOTION_SPIKE, false, 5e-5}, /* escape codes */
    {"teleport", MOTION_TELEPORT, false, 5e-5},                                       /* q raised by the encoder */
    {"affine", MOTION_BEND, true, 5e-5},
};
enum { GOLDEN_FRAMES = sizeof golden_motion / sizeof *golden_motion };

static inline pal_wire_pose golden_pose(void)
{
    return (pal_wire_pose){.tool = 3,
                           .seq = 4000000001u,
                           .flags = PAL_WIRE_POSE_CONTACT | PAL_WIRE_POSE_POSE_ONLY | PAL_WIRE_POSE_AWAY,
                           .stamp_us = 1234567890123456,
                           .position_m = {0.1, -0.2, 0.3},
                           .quaternion = {0.5, -0.5, 0.5, 0.5},
                           .velocity_m_s = {0.01f, -0.02f, 0.03f},
                           .omega_rad_s = {1.5f, -2.25f, 3.125f},
                           .force_N = {-1, 2, -3.3f},
                           .torque_N_m = {0.001f, 0.002f, -0.004f},
                           .grip = 0.77f,
                           .buttons = PAL_WIRE_GRASP,
                           .model_seq = 99,
                           .model_age_us = 16667,
                           .model_stamp_us = 9007199254740991};
}

static inline pal_wire_ack golden_ack(void)
{
    return (pal_wire_ack){3000000007u, 1250};
}

static inline pal_wire_tools golden_tools(void)
{
    pal_wire_tools t = {.cycle = 4100000000u, .n_tool = 3, .sim_time_us = 86400000001};
    for (uint32_t i = 0; i < t.n_tool; i++) {
        float k = (float)(i + 1);
        t.tool[i] = (pal_wire_tool){.holder = (uint16_t)(i * 7),
                                    .flags = (uint16_t)(i * 9 % 32),
                                    .colour = 0x10FF80u + i,
                                    .radius_m = 0.005f * k,
                                    .position_m = {0.1f * k, -0.2f * k, 0.3f},
                                    .quaternion = {1, 0.1f, 0.2f * k, -0.3f},
                                    .force_N = {-1.5f * k, 2.25f, 1e-7f},
                                    .echo_seq = 17 + i,
                                    .hold_us = 1900 + i,
                                    .echo_stamp_us = 5000000000 + i};
    }
    return t;
}

static inline pal_wire_haptic golden_haptic(void)
{
    pal_wire_haptic h = {.tool = 2,
                         .seq = 77,
                         .flags = PAL_WIRE_HAPTIC_FREEZE | PAL_WIRE_HAPTIC_TOPOLOGY_CHANGED,
                         .stamp_us = 6000000000,
                         .echo_stamp_us = 7000000000,
                         .echo_seq = 123,
                         .hold_us = 456,
                         .frame_us = 16667,
                         .n_patch = 2,
                         .origin_m = {0.123456789012345, -1e-9, 2},
                         .f_ref_N = {0.5f, -0.25f, 3},
                         .torque_ref_Nm = {0.01f, -0.02f, 0.03f},
                         .has_grasp = 1,
                         .grasp_x0_m = {0.01f, 0.02f, 0.03f},
                         .grasp_f0_N = {1, 2, 3},
                         .grasp_k_N_m = {100, 1, 2, 110, 3, 120},
                         .grasp_b_N_s_m = 1.5f,
                         .grasp_arm_m = {0.004f, -0.005f, 0.006f}};
    for (uint32_t i = 0; i < h.n_patch; i++) {
        float k = (float)(i + 1);
        h.patch[i] = (pal_wire_contact_patch){.id = (uint16_t)(1000 + i),
                                              .group = (uint16_t)(65535 - i),
                                              .p_m = {0.001f * k, 0.002f, -0.003f},
                                              .n = {0, 0.6f, 0.8f},
                                              .v_m_s = {-0.01f, 0.02f * k, 0.03f},
                                              .k1_N_m = 300 * k,
                                              .k2_N_m2 = 5000,
                                              .b_N_s_m = 2.5f,
                                              .kt_N_m = 150,
                                              .mu_s = 0.4f,
                                              .mu_d = 0.3f,
                                              .radius_m = 0.02f};
    }
    return h;
}

enum { GOLDEN_FIELD_VERTICES = 301 };
/* head and values of the golden FIELD: a smooth range, its two ends, and the same number many times */
static inline pal_field_head golden_field(float value[GOLDEN_FIELD_VERTICES])
{
    for (int i = 0; i < GOLDEN_FIELD_VERTICES; i++)
        value[i] = i < 200 ? 0.0617f * (float)(i * (399 - i)) : i < 300 ? 17.25f : 2500.0f;
    return (pal_field_head){.part = 2,
                            .field = PAL_WIRE_FIELD_VON_MISES_PA,
                            .epoch = 4000000000u,
                            .sim_time_us = 123456789012,
                            .n_vertex = GOLDEN_FIELD_VERTICES};
}

static inline void golden_parts(pal_wire_part_info *part, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        snprintf(part[i].name, sizeof part[i].name, "liver \"%u\"", i);
        snprintf(part[i].asset, sizeof part[i].asset, "/asset/%032x", i + 11);
        part[i].epoch = 4000000000u + i;
        part[i].n_vertex = 25000 + i;
        part[i].n_triangle = 49996 + i;
        part[i].error_m = 5e-5;
        part[i].n_field = i ? 0 : 2;
        if (i) continue;
        snprintf(part[i].field[0], sizeof part[i].field[0], "displacement");
        snprintf(part[i].field[1], sizeof part[i].field[1], "von_mises");
    }
}

static inline void golden_hello(pal_wire_hello *h)
{
    *h = (pal_wire_hello){.version = PAL_PROTOCOL_VERSION,
                          .session = "main",
                          .title = "Liver",
                          .organ = "liver, abdominal CT \xC3\xA9\xE2\x82\xAC\xF0\x9F\xAB\x80 back\\slash",
                          .step_rate_hz = 500,
                          .frame_rate_hz = 60,
                          .credit = 3,
                          .box_min_m = {-0.1, -0.2, -0.3},
                          .box_max_m = {0.1, 0.2, 1.0 / 3},
                          .up = {0, 0.6, 0.8},
                          .n_part = 2,
                          .n_tool = 1,
                          .tool = {{"probe", 0.01}},
                          .plan = {.n_component = 3, .component = {"gravity", "edge_distance", "verlet"}},
                          .you_id = 7,
                          .you_role = PAL_WIRE_ROLE_TRAINEE,
                          .you_name = "Ada",
                          .you_tool = PAL_WIRE_TOOL_NONE};
    golden_parts(h->part, 2);
}

static inline void golden_accuracy(pal_wire_hello *h)
{
    snprintf(h->accuracy, sizeof h->accuracy, "2.1 %% RMS of finite elements \"hex8\" \xC2\xB1");
}

/* changed slots of the golden asset's table of 108 triangles: emptied, filled, turned; ends of the table */
enum { GOLDEN_DELTA_SLOTS = 8 };
static const uint32_t golden_slot[GOLDEN_DELTA_SLOTS] = {0, 1, 5, 6, 7, 50, 51, 107};
static const uint32_t golden_corner[GOLDEN_DELTA_SLOTS][3] = {{0, 0, 0},    {3, 2, 1},    {55, 54, 0},  {0, 0, 0},
                                                              {17, 40, 23}, {23, 40, 41}, {41, 17, 23}, {55, 1, 30}};

static inline pal_topology_delta_head golden_topology_delta(void)
{
    return (pal_topology_delta_head){
        .part = 2, .epoch = 5, .n_changed = GOLDEN_DELTA_SLOTS, .revision = 4503599627370497};
}

/* lines of control.jsonl behind one of each type: what servers and clients of before did not say */
enum { GOLDEN_CONTROL_LINES = PAL_CONTROL_COUNT + 11 };
static inline pal_control_type golden_line_type(int line)
{
    static const pal_control_type more[] = {PAL_CONTROL_HELLO,    PAL_CONTROL_HELLO,  PAL_CONTROL_STATUS,
                                            PAL_CONTROL_JOIN,     PAL_CONTROL_HELLO,  PAL_CONTROL_HELLO,
                                            PAL_CONTROL_TOPOLOGY, PAL_CONTROL_STATUS, PAL_CONTROL_STUDY,
                                            PAL_CONTROL_ESTIMATE, PAL_CONTROL_HELLO};
    return line < PAL_CONTROL_COUNT ? (pal_control_type)line : more[line - PAL_CONTROL_COUNT];
}

static inline void golden_study(pal_wire_study *s)
{
    *s = (pal_wire_study){"liver", 50 / 3.0, NAN, 2, {{.index = 0}}};
    s->point[0] = (pal_wire_study_point){3, "tet_springs", "tet_springs, 8 voxels", 1.0 / 3, 0.0021, false, NAN};
    s->point[1] = (pal_wire_study_point){250, "fem hex8_bbar", "fem \"hex8_bbar\", 16 voxels", 16.7, 4.5e-4, true, 6.5};
}

static inline void golden_estimate(pal_wire_estimate *e)
{
    *e = (pal_wire_estimate){.body = "liver",
                             .configuration = "fem hex8_bbar corotational, 16 voxels",
                             .study_point = 250,
                             .tick = 1234567890123,
                             .time_s = 1.5,
                             .age_s = 0.25,
                             .cost_ms = 16.25,
                             .estimate_ms = 81.5,
                             .max_displacement_m = 0.0125,
                             .error_m = 1e-3,
                             .discretisation_m = 7e-4,
                             .algebraic_m = 1e-9,
                             .time_m = 2e-4,
                             .model_m = 1e-4,
                             .force_percent = 3.25,
                             .energy_error_percent = 12.5,
                             .locking = true,
                             .diag = "nearly incompressible",
                             .n_neighbour = 2};
    e->neighbour[0] = (pal_wire_neighbour){"resolution", "fem, 24 voxels", 54.2, 3e-4, 24, 0, 0};
    e->neighbour[1] = (pal_wire_neighbour){"tolerance", "fem, 0.01", NAN, NAN, 0, 0, 0.01};
}

/* nothing is known yet: what is not a number is not on the wire */
static inline void golden_no_estimate(pal_wire_estimate *e)
{
    *e = (pal_wire_estimate){
        .body = "liver", .configuration = "tet_springs", .study_point = NAN, .cost_ms = NAN, .max_displacement_m = NAN};
    e->age_s = e->error_m = e->discretisation_m = e->algebraic_m = e->time_m = e->model_m = e->force_percent =
        e->energy_error_percent = NAN;
}

static inline void golden_control(pal_control_type type, pal_control *c)
{
    memset(c, 0, sizeof *c);
    c->type = type;
    switch (type) {
    case PAL_CONTROL_HELLO:
        golden_hello(&c->hello);
        break;
    case PAL_CONTROL_TOPOLOGY:
        c->topology.n_part = 1;
        golden_parts(c->topology.part, 1);
        break;
    case PAL_CONTROL_STATUS:
        c->status = (pal_wire_status){.tick = 9007199254740991,
                                      .sim_time_s = 12.345,
                                      .paused = true,
                                      .step_rate_hz = 499.9,
                                      .slowdown = 1.25,
                                      .substeps = 3,
                                      .step_ms = 0.41,
                                      .n_component = 3,
                                      .component_ms = {0.001, 1.0 / 3, 0.03},
                                      .n_component_name = 3,
                                      .component = {"gravity", "verlet", "field_output"},
                                      .n_member = 2,
                                      .bytes_s = 312000,
                                      .rtt_ms = 0.4,
                                      .n_skipped = 5,
                                      .n_late = 6,
                                      .n_refused = 7,
                                      .diag = "slower than real time"};
        break;
    case PAL_CONTROL_MEMBERS:
        c->members.n_member = 2;
        c->members.member[0] = (pal_wire_member){1, PAL_WIRE_ROLE_INSTRUCTOR, 0, 0xFF8000, "Ada", "", false};
        c->members.member[1] =
            (pal_wire_member){65535, PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_NONE, 0x0080FF, "Bo", "steer cut", true};
        c->members.n_locked = 1, c->members.locked_tool[0] = 3, c->members.locked = true;
        break;
    case PAL_CONTROL_ORDERS:
        c->orders = (pal_wire_orders){
            2, {{1, "Ada", "pause", "", "", 3.5}, {65535, "Bo", "material", "liver", "young_Pa 4500", 0.25}}};
        break;
    case PAL_CONTROL_ERROR:
        c->error = (pal_wire_error){"tool_taken", "tool 0 is held by Ada"};
        break;
    case PAL_CONTROL_MOVE:
        c->move = (pal_wire_move){"https://b.example:8090/", "liver-2", "AQ-_"};
        break;
    case PAL_CONTROL_JOIN:
        c->join = (pal_wire_join){"Grace", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY, false, false};
        break;
    case PAL_CONTROL_COMMAND:
        c->command = (pal_wire_command){"material", "liver", 2, {{"young_Pa", 8000}, {"poisson", 0.45}}};
        break;
    case PAL_CONTROL_ANSWER:
        c->answer = (pal_wire_answer){"extrude", "28 cells", 2, {{"cells", 28}, {"can_undo", 1}}};
        break;
    case PAL_CONTROL_STUDY:
        snprintf(c->study.body, sizeof c->study.body, "liver");
        c->study.reference_m = NAN;
        break;
    case PAL_CONTROL_ESTIMATE:
        golden_no_estimate(&c->estimate);
        break;
    case PAL_CONTROL_TAKE_TOOL:
        c->tool = 2;
        break;
    case PAL_CONTROL_SUBSCRIBE_FIELD:
        c->field_subscription = (pal_wire_field_subscription){1, "von_mises", false, false};
        break;
    case PAL_CONTROL_PING:
    case PAL_CONTROL_PONG:
        c->stamp_ms = 1234.5678901;
        break;
    default:
        break;
    }
}

/* what came with configurations, rescues and switches of rows */
static inline void golden_rows(uint32_t n, uint32_t *n_part, double *part, uint32_t *n_why,
                               char (*reason)[PAL_WIRE_REASON_BYTES])
{
    *n_part = *n_why = n;
    for (uint32_t i = 0; i < n; i++) {
        part[i] = (double)i - 1;
        snprintf(reason[i], PAL_WIRE_REASON_BYTES, "bodies[0].model \"fem\" %u", i);
    }
}

static inline void golden_status(pal_wire_status *s)
{
    s->n_component_part = 3;
    s->component_part[0] = -1;
    s->component_part[2] = 15;
    s->n_state = 2;
    s->state[0] = (pal_wire_part_state){0, true, false, "node 512 moves at 3,200 m/s", 17, 0.25};
    s->state[1] = (pal_wire_part_state){2, false, true, "", 0, 0};
    s->n_disabled = 1;
    s->disabled[0] = (pal_wire_disabled){"gravity", 1};
    s->n_unobserved = 123456789012;
    s->n_energy = 2;
    s->energy[0] = (pal_wire_energy){0, 12.3, 1.5e-5, 0.0032};
    s->energy[1] = (pal_wire_energy){15, 12.25, 0, 2.5};
}

static inline void golden_line(int line, pal_control *c)
{
    golden_control(golden_line_type(line), c);
    if (line == PAL_CONTROL_COUNT) golden_accuracy(&c->hello);
    if (line == PAL_CONTROL_COUNT + 1) c->hello.part[1].is_adaptive = true;
    if (line == PAL_CONTROL_COUNT + 2) {
        c->status.n_active = 2;
        c->status.active[0] = (pal_wire_active){0, 133, 385, 450, 1344};
        c->status.active[1] = (pal_wire_active){3, 188, 558, 746, 2232};
    }
    if (line == PAL_CONTROL_COUNT + 3) c->join.topology_deltas = true;
    if (line == PAL_CONTROL_COUNT + 4) {
        c->hello.part[0].is_sculptable = true;
        snprintf(c->hello.part[0].control_cells, PAL_WIRE_NAME_BYTES, "/asset/00112233445566778899aabbccddeeff");
    }
    if (line == PAL_CONTROL_COUNT + 5) {
        c->hello.estimates = true;
        golden_rows(3, &c->hello.plan.n_part, c->hello.plan.part, &c->hello.plan.n_reason, c->hello.plan.reason);
    }
    if (line == PAL_CONTROL_COUNT + 6) {
        c->topology.plan.n_component = 2;
        for (int i = 0; i < 2; i++)
            snprintf(c->topology.plan.component[i], PAL_WIRE_NAME_BYTES, i ? "verlet" : "edge_distance");
        golden_rows(2, &c->topology.plan.n_part, c->topology.plan.part, &c->topology.plan.n_reason,
                    c->topology.plan.reason);
    }
    if (line == PAL_CONTROL_COUNT + 7) golden_status(&c->status);
    if (line == PAL_CONTROL_COUNT + 8) golden_study(&c->study);
    if (line == PAL_CONTROL_COUNT + 9) golden_estimate(&c->estimate);
    if (line == PAL_CONTROL_COUNT + 10) {
        snprintf(c->hello.part[0].appearance, PAL_WIRE_LOOK_BYTES, "gall_bladder");
        snprintf(c->hello.part[0].colour, PAL_WIRE_LOOK_BYTES, "#5c6f3a");
    }
}
#endif
