/* The table of verbs: a new command is one line here and one function. */
#include "server/net/hub_verb.h"

#include <stdio.h>

#define RIGHTS "steer, material, component, configure, sculpt, cut"
#define AT     "x_m y_m z_m"
#define FROM   AT " x2_m y2_m z2_m"

const pal_verb pal_verb_table[] = {
    {"pause", "", PAL_RIGHT_STEER, pal_hub_run_steering, PAL_COMMAND_PAUSE, "stop the simulation between two steps"},
    {"resume", "", PAL_RIGHT_STEER, pal_hub_run_steering, PAL_COMMAND_RESUME, "resume the simulation"},
    {"step", "", PAL_RIGHT_STEER, pal_hub_run_steering, PAL_COMMAND_STEP, "take one step while paused"},
    {"seek", "time_s", PAL_RIGHT_STEER, pal_hub_run_seek, 0, "go to a time of the recording that the session plays"},
    {"speed", "factor", PAL_RIGHT_STEER, pal_hub_run_speed, 0, "play the recording so much faster than real time"},
    {"branch", "", PAL_RIGHT_STEER, pal_hub_run_branch, 0, "go on live from here; seek leads back into the recording"},
    {"reset", "", PAL_RIGHT_EVERYBODY, pal_hub_run_reset, 0,
     "bring the body `target`, or the scene, back to rest: with the right steer, and everybody a frozen body"},
    {"material", "| young_Pa poisson density_kg_m3 damping_1_s", PAL_RIGHT_MATERIAL, pal_hub_run_material, 0,
     "change the material of the body `target`"},
    {"component", "part enabled", PAL_RIGHT_COMPONENT, pal_hub_run_component, 0,
     "disable or enable the component `target` of a part's plan"},
    {"estimate", "enabled", PAL_RIGHT_EVERYBODY, pal_hub_run_estimate, 0,
     "subscribe to the error estimate of the body `target`"},
    {"study_point", "index", PAL_RIGHT_CONFIGURE, pal_hub_run_switch, 0,
     "give the body the configuration of a point of its study"},
    {"configure", "| size step_ms tolerance", PAL_RIGHT_CONFIGURE, pal_hub_run_switch, 0,
     "change parameters of the body's configuration"},
    {"delete", AT, PAL_RIGHT_SCULPT, pal_hub_run_edit, PAL_CELLS_DELETE, "remove the control cell there"},
    {"divide", AT, PAL_RIGHT_SCULPT, pal_hub_run_edit, PAL_CELLS_DIVIDE, "divide the control cell there"},
    {"extrude", AT " distance_m | scale", PAL_RIGHT_SCULPT, pal_hub_run_edit, PAL_CELLS_EXTRUDE,
     "grow a cell out of the control face there"},
    {"merge", FROM, PAL_RIGHT_SCULPT, pal_hub_run_edit, PAL_CELLS_MERGE, "merge two control faces"},
    {"bridge", FROM, PAL_RIGHT_SCULPT, pal_hub_run_edit, PAL_CELLS_BRIDGE, "join two control faces by a cell"},
    {"sharpen", AT " sharpness entity", PAL_RIGHT_SCULPT, pal_hub_run_edit, PAL_CELLS_SHARPEN_VERTEX,
     "set the sharpness of a vertex (entity 0), edge (1) or face (2)"},
    {"paint", AT " radius_m | softness young_factor density_factor", PAL_RIGHT_SCULPT, pal_hub_run_edit, PAL_EDIT_PAINT,
     "multiply stiffness and density under a brush"},
    {"set_rest_shape", "", PAL_RIGHT_SCULPT, pal_hub_run_edit, PAL_EDIT_SET_REST,
     "make the present shape the rest shape"},
    {"cut", "nx ny nz offset_m", PAL_RIGHT_CUT, pal_hub_run_edit, PAL_EDIT_CUT, "hide what lies beyond a plane"},
    {"uncut", "", PAL_RIGHT_CUT, pal_hub_run_edit, PAL_EDIT_UNCUT, "show all of the body again"},
    {"undo", "", PAL_RIGHT_SCULPT, pal_hub_run_edit, PAL_EDIT_UNDO, "undo the last edit"},
    {"redo", "", PAL_RIGHT_SCULPT, pal_hub_run_edit, PAL_EDIT_REDO, "repeat the edit that was undone"},
    {"probe", AT, PAL_RIGHT_TRAINEE, pal_hub_run_probe, 0, "report the material there"},
    {"inflate", AT " radius_m pressure_Pa | softness", PAL_RIGHT_TOOL, pal_hub_run_brush, PAL_BRUSH_INFLATE,
     "apply a pressure under a brush"},
    {"curve", FROM " radius_m stiffness_N_m dx_m dy_m dz_m | softness", PAL_RIGHT_TOOL, pal_hub_run_brush,
     PAL_BRUSH_CURVE, "pull a handle between two points by a spring"},
    {"release", "", PAL_RIGHT_TOOL, pal_hub_run_brush, PAL_BRUSH_NONE, "end the brush of the own tool"},
    {"allow", "| member enabled", PAL_RIGHT_INSTRUCTOR, pal_hub_run_allow, 0,
     "let a trainee, or all, give the commands of the right `target`: " RIGHTS "; \"\": all of them"},
    {"hand_over", "tool | member", PAL_RIGHT_INSTRUCTOR, pal_hub_run_hand_over, 0,
     "give a tool to a member, whoever holds it; without member: to nobody"},
    {"lock_tool", "tool | enabled", PAL_RIGHT_INSTRUCTOR, pal_hub_run_lock, PAL_LOCK_TOOL,
     "only instructors may take the tool, or hand it over"},
    {"lock_session", "| enabled", PAL_RIGHT_INSTRUCTOR, pal_hub_run_lock, PAL_LOCK_SESSION,
     "only instructors may join"},
    {"mute", "member | enabled", PAL_RIGHT_INSTRUCTOR, pal_hub_run_mute, 0, "the member may only watch"},
    {"remove", "member", PAL_RIGHT_INSTRUCTOR, pal_hub_run_remove, PAL_REMOVE, "close the connection of a member"},
    {"ban", "member", PAL_RIGHT_INSTRUCTOR, pal_hub_run_remove, PAL_REMOVE_AND_BAN,
     "remove a member and refuse its ticket, or its address where the ticket is not its own"},
};
const int pal_verb_count = sizeof pal_verb_table / sizeof *pal_verb_table;

int pal_verb_describe(const pal_verb *verb, int n_verb, char *text, size_t cap)
{
    int n = 0;
    for (const pal_verb *v = verb; v < verb + n_verb; v++) {
        size_t used = (size_t)n < cap ? (size_t)n : cap;
        n += snprintf(cap ? text + used : NULL, cap - used, "%s\t%s\t%s\t%s\n", v->name, pal_right_text[v->right],
                      v->args, v->about);
    }
    return n;
}
