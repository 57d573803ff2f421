/* Which fields each control message has, in the order in which they are written. */
#include "protocol/control_table.h"

#define AT(type, member)  offsetof(type, member)
#define LEN(type, member) sizeof(((type *)0)->member)
#define END                                                                                                            \
    {                                                                                                                  \
        0                                                                                                              \
    }

static const pal_control_field part_fields[] = {
    {"name", TEXT, true, AT(pal_wire_part_info, name), PAL_WIRE_NAME_BYTES, 0, 0, NULL},
    {"epoch", U32, true, AT(pal_wire_part_info, epoch), 0, 0, 0, NULL},
    {"n_vertex", U32, true, AT(pal_wire_part_info, n_vertex), 0, 0, 0, NULL},
    {"n_triangle", U32, true, AT(pal_wire_part_info, n_triangle), 0, 0, 0, NULL},
    {"asset", TEXT, true, AT(pal_wire_part_info, asset), PAL_WIRE_NAME_BYTES, 0, 0, NULL},
    {"error_m", F64, true, AT(pal_wire_part_info, error_m), 0, 0, 0, NULL},
    {"fields", TEXTS, false, AT(pal_wire_part_info, field), PAL_WIRE_FIELD_BYTES, AT(pal_wire_part_info, n_field),
     PAL_WIRE_FIELDS_MAX, NULL},
    {"adaptive", BOOL, false, AT(pal_wire_part_info, is_adaptive), 0, 0, 0, NULL},
    {"sculptable", BOOL, false, AT(pal_wire_part_info, is_sculptable), 0, 0, 0, NULL},
    END};
static const pal_control_field tool_fields[] = {
    {"name", TEXT, true, AT(pal_wire_tool_info, name), PAL_WIRE_NAME_BYTES, 0, 0, NULL},
    {"radius_m", F64, true, AT(pal_wire_tool_info, radius_m), 0, 0, 0, NULL},
    END};
static const pal_control_field you_fields[] = {
    {"id", U16, true, AT(pal_wire_hello, you_id), 0, 0, 0, NULL},
    {"role", ROLE, true, AT(pal_wire_hello, you_role), 0, 0, 0, NULL},
    {"name", TEXT, true, AT(pal_wire_hello, you_name), PAL_WIRE_MEMBER_NAME, 0, 0, NULL},
    {"tool", TOOL, false, AT(pal_wire_hello, you_tool), 0, 0, 0, NULL},
    END};
static const pal_control_field hello_fields[] = {
    {"version", U32, true, AT(pal_wire_hello, version), 0, 0, 0, NULL},
    {"session", TEXT, true, AT(pal_wire_hello, session), PAL_WIRE_NAME_BYTES, 0, 0, NULL},
    {"title", TEXT, true, AT(pal_wire_hello, title), PAL_WIRE_TEXT_BYTES, 0, 0, NULL},
    {"organ", TEXT, true, AT(pal_wire_hello, organ), PAL_WIRE_TEXT_BYTES, 0, 0, NULL},
    {"accuracy", TEXT_OR_EMPTY, false, AT(pal_wire_hello, accuracy), PAL_WIRE_TEXT_BYTES, 0, 0, NULL},
    {"step_rate_hz", F64, true, AT(pal_wire_hello, step_rate_hz), 0, 0, 0, NULL},
    {"frame_rate_hz", F64, true, AT(pal_wire_hello, frame_rate_hz), 0, 0, 0, NULL},
    {"credit", U32, true, AT(pal_wire_hello, credit), 0, 0, 0, NULL},
    {"box_min_m", NUMBERS, true, AT(pal_wire_hello, box_min_m), 0, FIXED, 3, NULL},
    {"box_max_m", NUMBERS, true, AT(pal_wire_hello, box_max_m), 0, FIXED, 3, NULL},
    {"up", NUMBERS, true, AT(pal_wire_hello, up), 0, FIXED, 3, NULL},
    {"parts", OBJECTS, true, AT(pal_wire_hello, part), sizeof(pal_wire_part_info), AT(pal_wire_hello, n_part),
     PAL_WIRE_PART_MAX, part_fields},
    {"tools", OBJECTS, true, AT(pal_wire_hello, tool), sizeof(pal_wire_tool_info), AT(pal_wire_hello, n_tool),
     PAL_WIRE_TOOL_MAX, tool_fields},
    {"components", TEXTS, true, AT(pal_wire_hello, component), PAL_WIRE_NAME_BYTES, AT(pal_wire_hello, n_component),
     PAL_WIRE_COMPONENT_MAX, NULL},
    {"component_parts", NUMBERS, false, AT(pal_wire_hello, component_part), 0, AT(pal_wire_hello, n_component_part),
     PAL_WIRE_COMPONENT_MAX, NULL},
    {"component_reasons", TEXTS_OR_EMPTY, false, AT(pal_wire_hello, component_reason), PAL_WIRE_REASON_BYTES,
     AT(pal_wire_hello, n_component_reason), PAL_WIRE_COMPONENT_MAX, NULL},
    {"component_required", NUMBERS, false, AT(pal_wire_hello, component_required), 0,
     AT(pal_wire_hello, n_component_required), PAL_WIRE_COMPONENT_MAX, NULL},
    {"estimates", BOOL, false, AT(pal_wire_hello, estimates), 0, 0, 0, NULL},
    {"you", OBJECT, true, 0, 0, 0, 0, you_fields},
    END};
static const pal_control_field topology_fields[] = {
    {"parts", OBJECTS, true, AT(pal_wire_topology, part), sizeof(pal_wire_part_info), AT(pal_wire_topology, n_part),
     PAL_WIRE_PART_MAX, part_fields},
    {"components", TEXTS_OR_EMPTY, false, AT(pal_wire_topology, component), PAL_WIRE_NAME_BYTES,
     AT(pal_wire_topology, n_component), PAL_WIRE_COMPONENT_MAX, NULL},
    {"component_parts", NUMBERS, false, AT(pal_wire_topology, component_part), 0,
     AT(pal_wire_topology, n_component_part), PAL_WIRE_COMPONENT_MAX, NULL},
    {"component_reasons", TEXTS_OR_EMPTY, false, AT(pal_wire_topology, component_reason), PAL_WIRE_REASON_BYTES,
     AT(pal_wire_topology, n_component_reason), PAL_WIRE_COMPONENT_MAX, NULL},
    {"component_required", NUMBERS, false, AT(pal_wire_topology, component_required), 0,
     AT(pal_wire_topology, n_component_required), PAL_WIRE_COMPONENT_MAX, NULL},
    END};
static const pal_control_field active_fields[] = {
    {"part", U32, true, AT(pal_wire_active, part), 0, 0, 0, NULL},
    {"nodes", U32, true, AT(pal_wire_active, n_node), 0, 0, 0, NULL},
    {"springs", U32, true, AT(pal_wire_active, n_spring), 0, 0, 0, NULL},
    {"finest_nodes", U32, true, AT(pal_wire_active, n_finest_node), 0, 0, 0, NULL},
    {"finest_springs", U32, true, AT(pal_wire_active, n_finest_spring), 0, 0, 0, NULL},
    END};
static const pal_control_field state_fields[] = {
    {"part", U32, true, AT(pal_wire_part_state, part), 0, 0, 0, NULL},
    {"frozen", BOOL, false, AT(pal_wire_part_state, frozen), 0, 0, 0, NULL},
    {"asleep", BOOL, false, AT(pal_wire_part_state, asleep), 0, 0, 0, NULL},
    {"reason", TEXT_OR_EMPTY, false, AT(pal_wire_part_state, reason), PAL_WIRE_REASON_BYTES, 0, 0, NULL},
    {"safeguards", U64, false, AT(pal_wire_part_state, n_safeguard), 0, 0, 0, NULL},
    {"safeguard_ms", F64, false, AT(pal_wire_part_state, safeguard_ms), 0, 0, 0, NULL},
    END};
static const pal_control_field off_fields[] = {
    {"component", TEXT, true, AT(pal_wire_disabled, component), PAL_WIRE_NAME_BYTES, 0, 0, NULL},
    {"part", U32, true, AT(pal_wire_disabled, part), 0, 0, 0, NULL},
    END};
static const pal_control_field status_fields[] = {
    {"tick", U64, true, AT(pal_wire_status, tick), 0, 0, 0, NULL},
    {"sim_time_s", F64, true, AT(pal_wire_status, sim_time_s), 0, 0, 0, NULL},
    {"paused", BOOL, true, AT(pal_wire_status, paused), 0, 0, 0, NULL},
    {"frozen", BOOL, true, AT(pal_wire_status, frozen), 0, 0, 0, NULL},
    {"step_rate_hz", F64, true, AT(pal_wire_status, step_rate_hz), 0, 0, 0, NULL},
    {"slowdown", F64, true, AT(pal_wire_status, slowdown), 0, 0, 0, NULL},
    {"substeps", U32, true, AT(pal_wire_status, substeps), 0, 0, 0, NULL},
    {"step_ms", F64, true, AT(pal_wire_status, step_ms), 0, 0, 0, NULL},
    {"component_ms", NUMBERS, true, AT(pal_wire_status, component_ms), 0, AT(pal_wire_status, n_component),
     PAL_WIRE_COMPONENT_MAX, NULL},
    {"components", TEXTS, false, AT(pal_wire_status, component), PAL_WIRE_NAME_BYTES,
     AT(pal_wire_status, n_component_name), PAL_WIRE_COMPONENT_MAX, NULL},
    {"members", U32, true, AT(pal_wire_status, n_member), 0, 0, 0, NULL},
    {"bytes_s", F64, true, AT(pal_wire_status, bytes_s), 0, 0, 0, NULL},
    {"rtt_ms", F64, true, AT(pal_wire_status, rtt_ms), 0, 0, 0, NULL},
    {"skipped_cycles", U32, true, AT(pal_wire_status, n_skipped), 0, 0, 0, NULL},
    {"late_steps", U64, true, AT(pal_wire_status, n_late), 0, 0, 0, NULL},
    {"refused_inputs", U64, true, AT(pal_wire_status, n_refused), 0, 0, 0, NULL},
    {"diagnostic", TEXT, false, AT(pal_wire_status, diag), PAL_WIRE_TEXT_BYTES, 0, 0, NULL},
    {"active", OBJECTS, false, AT(pal_wire_status, active), sizeof(pal_wire_active), AT(pal_wire_status, n_active),
     PAL_WIRE_PART_MAX, active_fields},
    {"component_parts", NUMBERS, false, AT(pal_wire_status, component_part), 0, AT(pal_wire_status, n_component_part),
     PAL_WIRE_COMPONENT_MAX, NULL},
    {"parts", OBJECTS, false, AT(pal_wire_status, state), sizeof(pal_wire_part_state), AT(pal_wire_status, n_state),
     PAL_WIRE_PART_MAX, state_fields},
    {"disabled", OBJECTS, false, AT(pal_wire_status, disabled), sizeof(pal_wire_disabled),
     AT(pal_wire_status, n_disabled), PAL_WIRE_COMPONENT_MAX, off_fields},
    {"unobserved_steps", U64, false, AT(pal_wire_status, n_unobserved), 0, 0, 0, NULL},
    END};
static const pal_control_field member_fields[] = {
    {"id", U16, true, AT(pal_wire_member, id), 0, 0, 0, NULL},
    {"role", ROLE, true, AT(pal_wire_member, role), 0, 0, 0, NULL},
    {"name", TEXT, true, AT(pal_wire_member, name), PAL_WIRE_MEMBER_NAME, 0, 0, NULL},
    {"tool", TOOL, false, AT(pal_wire_member, tool), 0, 0, 0, NULL},
    {"colour", U32, true, AT(pal_wire_member, colour), 0, 0, 0, NULL},
    END};
static const pal_control_field members_fields[] = {{"members", OBJECTS, true, AT(pal_wire_members, member),
                                                    sizeof(pal_wire_member), AT(pal_wire_members, n_member),
                                                    PAL_WIRE_MEMBER_MAX, member_fields},
                                                   END};
static const pal_control_field error_fields[] = {
    {"code", TEXT, true, AT(pal_wire_error, code), PAL_WIRE_NAME_BYTES, 0, 0, NULL},
    {"text", TEXT, true, AT(pal_wire_error, text), PAL_WIRE_TEXT_BYTES, 0, 0, NULL},
    END};
static const pal_control_field join_fields[] = {
    {"name", TEXT, true, AT(pal_wire_join, name), PAL_WIRE_MEMBER_NAME, 0, 0, NULL},
    {"role", ROLE, true, AT(pal_wire_join, role), 0, 0, 0, NULL},
    {"tool", TOOL, false, AT(pal_wire_join, tool), 0, 0, 0, NULL},
    {"topology_deltas", BOOL, false, AT(pal_wire_join, topology_deltas), 0, 0, 0, NULL},
    END};
static const pal_control_field command_fields[] = {
    {"verb", TEXT, true, AT(pal_wire_command, verb), LEN(pal_wire_command, verb), 0, 0, NULL},
    {"target", TEXT, false, AT(pal_wire_command, target), PAL_WIRE_NAME_BYTES, 0, 0, NULL},
    {"args", ARGS, false, AT(pal_wire_command, arg), 0, AT(pal_wire_command, n_arg), PAL_WIRE_ARG_MAX, NULL},
    END};
static const pal_control_field take_fields[] = {{"tool", TOOL, true, 0, 0, 0, 0, NULL}, END};
static const pal_control_field leave_fields[] = {END};
static const pal_control_field view_fields[] = {
    {"part", U32, true, AT(pal_wire_field_subscription, part), 0, 0, 0, NULL},
    {"field", TEXT, true, AT(pal_wire_field_subscription, field), PAL_WIRE_FIELD_BYTES, 0, 0, NULL},
    END};
static const pal_control_field answer_fields[] = {
    {"verb", TEXT, true, AT(pal_wire_answer, verb), LEN(pal_wire_answer, verb), 0, 0, NULL},
    {"text", TEXT, true, AT(pal_wire_answer, text), PAL_WIRE_TEXT_BYTES, 0, 0, NULL},
    {"args", ARGS, false, AT(pal_wire_answer, arg), 0, AT(pal_wire_answer, n_arg), PAL_WIRE_ARG_MAX, NULL},
    END};
static const pal_control_field point_fields[] = {
    {"index", U32, true, AT(pal_wire_study_point, index), 0, 0, 0, NULL},
    {"method", TEXT, true, AT(pal_wire_study_point, method), PAL_WIRE_METHOD_BYTES, 0, 0, NULL},
    {"label", TEXT, true, AT(pal_wire_study_point, label), PAL_WIRE_LABEL_BYTES, 0, 0, NULL},
    {"cost_ms", F64, true, AT(pal_wire_study_point, cost_ms), 0, 0, 0, NULL},
    {"error_m", F64, true, AT(pal_wire_study_point, error_m), 0, 0, 0, NULL},
    {"pareto_optimal", BOOL, false, AT(pal_wire_study_point, pareto_optimal), 0, 0, 0, NULL},
    END};
static const pal_control_field study_fields[] = {
    {"body", TEXT, true, AT(pal_wire_study, body), PAL_WIRE_NAME_BYTES, 0, 0, NULL},
    {"step_ms", F64, true, AT(pal_wire_study, step_ms), 0, 0, 0, NULL},
    {"reference_m", NUMBER_OR_NAN, false, AT(pal_wire_study, reference_m), 0, 0, 0, NULL},
    {"points", OBJECTS, false, AT(pal_wire_study, point), sizeof(pal_wire_study_point), AT(pal_wire_study, n_point),
     PAL_WIRE_POINT_MAX, point_fields},
    END};
static const pal_control_field neighbour_fields[] = {
    {"parameter", TEXT, true, AT(pal_wire_neighbour, parameter), PAL_WIRE_METHOD_BYTES, 0, 0, NULL},
    {"label", TEXT, true, AT(pal_wire_neighbour, label), PAL_WIRE_LABEL_BYTES, 0, 0, NULL},
    {"cost_ms", NUMBER_OR_NAN, false, AT(pal_wire_neighbour, cost_ms), 0, 0, 0, NULL},
    {"error_m", NUMBER_OR_NAN, false, AT(pal_wire_neighbour, error_m), 0, 0, 0, NULL},
    {"size", U32, false, AT(pal_wire_neighbour, size), 0, 0, 0, NULL},
    {"step_ms", F64, false, AT(pal_wire_neighbour, step_ms), 0, 0, 0, NULL},
    {"tolerance", F64, false, AT(pal_wire_neighbour, tolerance), 0, 0, 0, NULL},
    END};
static const pal_control_field estimate_fields[] = {
    {"body", TEXT, true, AT(pal_wire_estimate, body), PAL_WIRE_NAME_BYTES, 0, 0, NULL},
    {"configuration", TEXT, true, AT(pal_wire_estimate, configuration), PAL_WIRE_LABEL_BYTES, 0, 0, NULL},
    {"study_point", NUMBER_OR_NAN, false, AT(pal_wire_estimate, study_point), 0, 0, 0, NULL},
    {"tick", U64, true, AT(pal_wire_estimate, tick), 0, 0, 0, NULL},
    {"time_s", F64, true, AT(pal_wire_estimate, time_s), 0, 0, 0, NULL},
    {"age_s", NUMBER_OR_NAN, false, AT(pal_wire_estimate, age_s), 0, 0, 0, NULL},
    {"cost_ms", NUMBER_OR_NAN, false, AT(pal_wire_estimate, cost_ms), 0, 0, 0, NULL},
    {"estimate_ms", F64, true, AT(pal_wire_estimate, estimate_ms), 0, 0, 0, NULL},
    {"max_displacement_m", NUMBER_OR_NAN, false, AT(pal_wire_estimate, max_displacement_m), 0, 0, 0, NULL},
    {"error_m", NUMBER_OR_NAN, false, AT(pal_wire_estimate, error_m), 0, 0, 0, NULL},
    {"discretisation_m", NUMBER_OR_NAN, false, AT(pal_wire_estimate, discretisation_m), 0, 0, 0, NULL},
    {"algebraic_m", NUMBER_OR_NAN, false, AT(pal_wire_estimate, algebraic_m), 0, 0, 0, NULL},
    {"time_m", NUMBER_OR_NAN, false, AT(pal_wire_estimate, time_m), 0, 0, 0, NULL},
    {"model_m", NUMBER_OR_NAN, false, AT(pal_wire_estimate, model_m), 0, 0, 0, NULL},
    {"energy_error_percent", NUMBER_OR_NAN, false, AT(pal_wire_estimate, energy_error_percent), 0, 0, 0, NULL},
    {"locking", BOOL, false, AT(pal_wire_estimate, locking), 0, 0, 0, NULL},
    {"diagnostic", TEXT_OR_EMPTY, false, AT(pal_wire_estimate, diag), PAL_WIRE_TEXT_BYTES, 0, 0, NULL},
    {"neighbours", OBJECTS, false, AT(pal_wire_estimate, neighbour), sizeof(pal_wire_neighbour),
     AT(pal_wire_estimate, n_neighbour), PAL_WIRE_NEIGHBOUR_MAX, neighbour_fields},
    END};
static const pal_control_field stamp_fields[] = {{"stamp_ms", F64, true, 0, 0, 0, 0, NULL}, END};

const pal_control_message pal_control_message_table[PAL_CONTROL_COUNT] = {
#define FIELDS_HELLO               hello_fields
#define FIELDS_TOPOLOGY            topology_fields
#define FIELDS_STATUS              status_fields
#define FIELDS_MEMBERS             members_fields
#define FIELDS_ERROR               error_fields
#define FIELDS_PONG                stamp_fields
#define FIELDS_JOIN                join_fields
#define FIELDS_COMMAND             command_fields
#define FIELDS_TAKE_TOOL           take_fields
#define FIELDS_RELEASE_TOOL        leave_fields
#define FIELDS_PING                stamp_fields
#define FIELDS_SUBSCRIBE_FIELD     view_fields
#define FIELDS_ANSWER              answer_fields
#define FIELDS_STUDY               study_fields
#define FIELDS_ESTIMATE            estimate_fields
#define X(name, text, from_server) {text, from_server, FIELDS_##name},
    PAL_CONTROL_TABLE(X)
#undef X
};
