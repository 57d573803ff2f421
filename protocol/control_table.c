/* Which fields each control message has, in the order in which they are written. */
#include "protocol/control_table.h"

/* offset, size, count, max and sub of one value, of a fixed array and of a counted list */
#define ONE(of, member)   offsetof(pal_wire_##of, member), sizeof(((pal_wire_##of *)0)->member), 0, 0, NULL
#define ARRAY(of, member) offsetof(pal_wire_##of, member), ITEM(of, member), FIXED, LENGTH(of, member)
#define LIST(of, member, count)                                                                                        \
    offsetof(pal_wire_##of, member), ITEM(of, member), offsetof(pal_wire_##of, count), LENGTH(of, member)
#define ITEM(of, member)   sizeof(((pal_wire_##of *)0)->member[0])
#define LENGTH(of, member) (sizeof(((pal_wire_##of *)0)->member) / ITEM(of, member))

static const pal_control_field part_fields[] = {
    {"name", TEXT, true, ONE(part_info, name)},
    {"epoch", U32, true, ONE(part_info, epoch)},
    {"n_vertex", U32, true, ONE(part_info, n_vertex)},
    {"n_triangle", U32, true, ONE(part_info, n_triangle)},
    {"asset", TEXT, true, ONE(part_info, asset)},
    {"images", TEXTS_OR_EMPTY, false, LIST(part_info, image, n_image), NULL},
    {"error_m", F64, true, ONE(part_info, error_m)},
    {"fields", TEXTS, false, LIST(part_info, field, n_field), NULL},
    {"interior", TEXT_OR_EMPTY, false, ONE(part_info, interior)},
    {"adaptive", BOOL, false, ONE(part_info, is_adaptive)},
    {"sculptable", BOOL, false, ONE(part_info, is_sculptable)},
    {"appearance", TEXT_OR_EMPTY, false, ONE(part_info, appearance)},
    {"colour", TEXT_OR_EMPTY, false, ONE(part_info, colour)},
    {"control_cells", TEXT_OR_EMPTY, false, ONE(part_info, control_cells)},
    {0}};
static const pal_control_field tool_fields[] = {{"name", TEXT, true, ONE(tool_info, name)},
                                                {"radius_m", F64, true, ONE(tool_info, radius_m)},
                                                {"force_cap_N", F64, false, ONE(tool_info, force_cap_N)},
                                                {"instrument", TEXT_OR_EMPTY, false, ONE(tool_info, instrument)},
                                                {"trocar_m", NUMBERS, false, LIST(tool_info, trocar_m, n_trocar), NULL},
                                                {0}};
static const pal_control_field mark_fields[] = {
    {"time_s", F64, true, ONE(mark, time_s)}, {"text", TEXT, true, ONE(mark, text)}, {0}};
static const pal_control_field you_fields[] = {{"id", U16, true, ONE(hello, you_id)},
                                               {"role", ROLE, true, ONE(hello, you_role)},
                                               {"name", TEXT, true, ONE(hello, you_name)},
                                               {"tool", TOOL, false, ONE(hello, you_tool)},
                                               {0}};
static const pal_control_field HELLO_fields[] = {
    {"version", U32, true, ONE(hello, version)},
    {"session", TEXT, true, ONE(hello, session)},
    {"title", TEXT, true, ONE(hello, title)},
    {"organ", TEXT, true, ONE(hello, organ)},
    {"accuracy", TEXT_OR_EMPTY, false, ONE(hello, accuracy)},
    {"step_rate_hz", F64, true, ONE(hello, step_rate_hz)},
    {"frame_rate_hz", F64, true, ONE(hello, frame_rate_hz)},
    {"credit", U32, true, ONE(hello, credit)},
    {"box_min_m", NUMBERS, true, ARRAY(hello, box_min_m), NULL},
    {"box_max_m", NUMBERS, true, ARRAY(hello, box_max_m), NULL},
    {"up", NUMBERS, true, ARRAY(hello, up), NULL},
    {"anatomical_axes", TEXT_OR_EMPTY, false, ONE(hello, anatomical_axes)},
    {"parts", OBJECTS, true, LIST(hello, part, n_part), part_fields},
    {"tools", OBJECTS, true, LIST(hello, tool, n_tool), tool_fields},
    {"components", TEXTS, true, LIST(hello, plan.component, plan.n_component), NULL},
    {"component_parts", NUMBERS, false, LIST(hello, plan.part, plan.n_part), NULL},
    {"component_reasons", TEXTS_OR_EMPTY, false, LIST(hello, plan.reason, plan.n_reason), NULL},
    {"component_required", NUMBERS, false, LIST(hello, plan.required, plan.n_required), NULL},
    {"estimates", BOOL, false, ONE(hello, estimates)},
    {"relay", BOOL, false, ONE(hello, relay)},
    {"started", U32, false, ONE(hello, started)},
    {"marks", OBJECTS, false, LIST(hello, mark, n_mark), mark_fields},
    {"you", OBJECT, true, 0, 0, 0, 0, you_fields},
    {0}};
static const pal_control_field TOPOLOGY_fields[] = {
    {"parts", OBJECTS, true, LIST(topology, part, n_part), part_fields},
    {"components", TEXTS_OR_EMPTY, false, LIST(topology, plan.component, plan.n_component), NULL},
    {"component_parts", NUMBERS, false, LIST(topology, plan.part, plan.n_part), NULL},
    {"component_reasons", TEXTS_OR_EMPTY, false, LIST(topology, plan.reason, plan.n_reason), NULL},
    {"component_required", NUMBERS, false, LIST(topology, plan.required, plan.n_required), NULL},
    {0}};
static const pal_control_field active_fields[] = {{"part", U32, true, ONE(active, part)},
                                                  {"nodes", U32, true, ONE(active, n_node)},
                                                  {"springs", U32, true, ONE(active, n_spring)},
                                                  {"finest_nodes", U32, true, ONE(active, n_finest_node)},
                                                  {"finest_springs", U32, true, ONE(active, n_finest_spring)},
                                                  {0}};
static const pal_control_field state_fields[] = {{"part", U32, true, ONE(part_state, part)},
                                                 {"frozen", BOOL, false, ONE(part_state, frozen)},
                                                 {"asleep", BOOL, false, ONE(part_state, asleep)},
                                                 {"reason", TEXT_OR_EMPTY, false, ONE(part_state, reason)},
                                                 {"safeguards", U64, false, ONE(part_state, n_safeguard)},
                                                 {"safeguard_ms", F64, false, ONE(part_state, safeguard_ms)},
                                                 {0}};
static const pal_control_field energy_fields[] = {{"part", U32, true, ONE(energy, part)},
                                                  {"time_s", F64, true, ONE(energy, time_s)},
                                                  {"kinetic_J", F64, true, ONE(energy, kinetic_J)},
                                                  {"elastic_J", F64, true, ONE(energy, elastic_J)},
                                                  {0}};
static const pal_control_field device_fields[] = {{"tool", U32, true, ONE(device, tool)},
                                                  {"force_error_N", F64, false, ONE(device, force_error_N)},
                                                  {"opening", F64, false, ONE(device, opening)},
                                                  {0}};
static const pal_control_field playback_fields[] = {
    {"plays", BOOL, true, ONE(playback, plays)},      {"time_s", F64, true, ONE(playback, time_s)},
    {"length_s", F64, true, ONE(playback, length_s)}, {"speed", F64, true, ONE(playback, speed)},
    {"ended", BOOL, false, ONE(playback, ended)},     {0}};
static const pal_control_field off_fields[] = {
    {"component", TEXT, true, ONE(disabled, component)}, {"part", U32, true, ONE(disabled, part)}, {0}};
static const pal_control_field STATUS_fields[] = {
    {"tick", U64, true, ONE(status, tick)},
    {"sim_time_s", F64, true, ONE(status, sim_time_s)},
    {"paused", BOOL, true, ONE(status, paused)},
    {"frozen", BOOL, true, ONE(status, frozen)},
    {"step_rate_hz", F64, true, ONE(status, step_rate_hz)},
    {"slowdown", F64, true, ONE(status, slowdown)},
    {"substeps", U32, true, ONE(status, substeps)},
    {"step_ms", F64, true, ONE(status, step_ms)},
    {"component_ms", NUMBERS, true, LIST(status, component_ms, n_component), NULL},
    {"components", TEXTS, false, LIST(status, component, n_component_name), NULL},
    {"members", U32, true, ONE(status, n_member)},
    {"viewers", U32, false, ONE(status, n_viewer)},
    {"bytes_s", F64, true, ONE(status, bytes_s)},
    {"rtt_ms", F64, true, ONE(status, rtt_ms)},
    {"skipped_cycles", U32, true, ONE(status, n_skipped)},
    {"late_steps", U64, true, ONE(status, n_late)},
    {"refused_inputs", U64, true, ONE(status, n_refused)},
    {"diagnostic", TEXT, false, ONE(status, diag)},
    {"active", OBJECTS, false, LIST(status, active, n_active), active_fields},
    {"component_parts", NUMBERS, false, LIST(status, component_part, n_component_part), NULL},
    {"parts", OBJECTS, false, LIST(status, state, n_state), state_fields},
    {"disabled", OBJECTS, false, LIST(status, disabled, n_disabled), off_fields},
    {"unobserved_steps", U64, false, ONE(status, n_unobserved)},
    {"devices", OBJECTS, false, LIST(status, device, n_device), device_fields},
    {"energies", OBJECTS, false, LIST(status, energy, n_energy), energy_fields},
    {"playback", OBJECTS, false, LIST(status, playback, n_playback), playback_fields},
    {0}};
static const pal_control_field member_fields[] = {
    {"id", U16, true, ONE(member, id)},         {"role", ROLE, true, ONE(member, role)},
    {"name", TEXT, true, ONE(member, name)},    {"tool", TOOL, false, ONE(member, tool)},
    {"colour", U32, true, ONE(member, colour)}, {"rights", TEXT_OR_EMPTY, false, ONE(member, rights)},
    {"muted", BOOL, false, ONE(member, muted)}, {0}};
static const pal_control_field MEMBERS_fields[] = {
    {"members", OBJECTS, true, LIST(members, member, n_member), member_fields},
    {"locked_tools", NUMBERS, false, LIST(members, locked_tool, n_locked), NULL},
    {"locked", BOOL, false, ONE(members, locked)},
    {0}};
static const pal_control_field order_fields[] = {{"id", U16, true, ONE(order, id)},
                                                 {"name", TEXT, true, ONE(order, name)},
                                                 {"verb", TEXT, true, ONE(order, verb)},
                                                 {"target", TEXT_OR_EMPTY, false, ONE(order, target)},
                                                 {"text", TEXT_OR_EMPTY, false, ONE(order, text)},
                                                 {"age_s", F64, true, ONE(order, age_s)},
                                                 {0}};
static const pal_control_field ORDERS_fields[] = {{"orders", OBJECTS, true, LIST(orders, order, n_order), order_fields},
                                                  {0}};
static const pal_control_field ERROR_fields[] = {
    {"code", TEXT, true, ONE(error, code)}, {"text", TEXT, true, ONE(error, text)}, {0}};
static const pal_control_field MOVE_fields[] = {{"address", TEXT, true, ONE(move, address)},
                                                {"session", TEXT, true, ONE(move, session)},
                                                {"ticket", TEXT_OR_EMPTY, false, ONE(move, ticket)},
                                                {0}};
static const pal_control_field JOIN_fields[] = {
    {"name", TEXT, true, ONE(join, name)},    {"role", ROLE, true, ONE(join, role)},
    {"tool", TOOL, false, ONE(join, tool)},   {"topology_deltas", BOOL, false, ONE(join, topology_deltas)},
    {"moves", BOOL, false, ONE(join, moves)}, {0}};
static const pal_control_field COMMAND_fields[] = {{"verb", TEXT, true, ONE(command, verb)},
                                                   {"target", TEXT, false, ONE(command, target)},
                                                   {"args", ARGS, false, LIST(command, arg, n_arg), NULL},
                                                   {0}};
static const pal_control_field TAKE_TOOL_fields[] = {{"tool", TOOL, true, 0, 0, 0, 0, NULL}, {0}};
static const pal_control_field RELEASE_TOOL_fields[] = {{0}};
static const pal_control_field SUBSCRIBE_FIELD_fields[] = {{"part", U32, true, ONE(field_subscription, part)},
                                                           {"field", TEXT, true, ONE(field_subscription, field)},
                                                           {"interior", BOOL, false, ONE(field_subscription, interior)},
                                                           {"energy", BOOL, false, ONE(field_subscription, energy)},
                                                           {0}};
static const pal_control_field ANSWER_fields[] = {{"verb", TEXT, true, ONE(answer, verb)},
                                                  {"text", TEXT, true, ONE(answer, text)},
                                                  {"args", ARGS, false, LIST(answer, arg, n_arg), NULL},
                                                  {0}};
static const pal_control_field point_fields[] = {
    {"index", U32, true, ONE(study_point, index)},
    {"method", TEXT, true, ONE(study_point, method)},
    {"label", TEXT, true, ONE(study_point, label)},
    {"cost_ms", F64, true, ONE(study_point, cost_ms)},
    {"error_m", F64, true, ONE(study_point, error_m)},
    {"force_percent", NUMBER_OR_NAN, false, ONE(study_point, force_percent)},
    {"pareto_optimal", BOOL, false, ONE(study_point, pareto_optimal)},
    {0}};
static const pal_control_field STUDY_fields[] = {{"body", TEXT, true, ONE(study, body)},
                                                 {"step_ms", F64, true, ONE(study, step_ms)},
                                                 {"reference_m", NUMBER_OR_NAN, false, ONE(study, reference_m)},
                                                 {"points", OBJECTS, false, LIST(study, point, n_point), point_fields},
                                                 {0}};
static const pal_control_field neighbour_fields[] = {{"parameter", TEXT, true, ONE(neighbour, parameter)},
                                                     {"label", TEXT, true, ONE(neighbour, label)},
                                                     {"cost_ms", NUMBER_OR_NAN, false, ONE(neighbour, cost_ms)},
                                                     {"error_m", NUMBER_OR_NAN, false, ONE(neighbour, error_m)},
                                                     {"size", U32, false, ONE(neighbour, size)},
                                                     {"step_ms", F64, false, ONE(neighbour, step_ms)},
                                                     {"tolerance", F64, false, ONE(neighbour, tolerance)},
                                                     {0}};
static const pal_control_field ESTIMATE_fields[] = {
    {"body", TEXT, true, ONE(estimate, body)},
    {"configuration", TEXT, true, ONE(estimate, configuration)},
    {"study_point", NUMBER_OR_NAN, false, ONE(estimate, study_point)},
    {"tick", U64, true, ONE(estimate, tick)},
    {"time_s", F64, true, ONE(estimate, time_s)},
    {"age_s", NUMBER_OR_NAN, false, ONE(estimate, age_s)},
    {"cost_ms", NUMBER_OR_NAN, false, ONE(estimate, cost_ms)},
    {"estimate_ms", F64, true, ONE(estimate, estimate_ms)},
    {"max_displacement_m", NUMBER_OR_NAN, false, ONE(estimate, max_displacement_m)},
    {"error_m", NUMBER_OR_NAN, false, ONE(estimate, error_m)},
    {"discretisation_m", NUMBER_OR_NAN, false, ONE(estimate, discretisation_m)},
    {"algebraic_m", NUMBER_OR_NAN, false, ONE(estimate, algebraic_m)},
    {"time_m", NUMBER_OR_NAN, false, ONE(estimate, time_m)},
    {"model_m", NUMBER_OR_NAN, false, ONE(estimate, model_m)},
    {"force_percent", NUMBER_OR_NAN, false, ONE(estimate, force_percent)},
    {"energy_error_percent", NUMBER_OR_NAN, false, ONE(estimate, energy_error_percent)},
    {"locking", BOOL, false, ONE(estimate, locking)},
    {"diagnostic", TEXT_OR_EMPTY, false, ONE(estimate, diag)},
    {"neighbours", OBJECTS, false, LIST(estimate, neighbour, n_neighbour), neighbour_fields},
    {0}};
static const pal_control_field PONG_fields[] = {{"stamp_ms", F64, true, 0, 0, 0, 0, NULL}, {0}};
static const pal_control_field PING_fields[] = {{"stamp_ms", F64, true, 0, 0, 0, 0, NULL}, {0}};

const pal_control_message pal_control_message_table[PAL_CONTROL_COUNT] = {
#define X(name, text, from_server) {text, from_server, name##_fields},
    PAL_CONTROL_TABLE(X)
#undef X
};
