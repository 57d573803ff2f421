/* Verbs of the message `command`: name, arguments, permission, and the function that executes it. A new command is one
 * line in verb_table.c and one function. Thread: [net]. */
#ifndef PAL_NET_HUB_VERB_H
#define PAL_NET_HUB_VERB_H
#include "server/mesh/cells/cell_edits.h"
#include "server/net/hub_rights.h"

/* called after permission and keys are checked; sends an answer or an error. false: an error */
typedef bool pal_verb_run(pal_client *client, const pal_verb *verb, const pal_wire_command *command);

struct pal_verb {
    const char *name;
    const char *args; /* argument keys; those behind the bar are optional: "x_m y_m z_m | scale" */
    pal_right right;
    pal_verb_run *run;
    int detail; /* distinguishes verbs that share a function */
    const char *about;
};

extern const pal_verb pal_verb_table[]; /* verb_table.c [pal_verb_count] */
extern const int pal_verb_count;
/* formats a table as text, one line per verb with tab-separated name, permission, arguments and description; returns
 * the number of bytes of the whole text, as snprintf does. Thread: any */
int pal_verb_describe(const pal_verb *verb, int n_verb, char *text, size_t cap);

/* functions of the table, in hub_steering.c, hub_instruct.c, hub_plan.c, hub_accuracy.c, hub_switch.c and hub_sculpt.c
 */
pal_verb_run pal_hub_run_allow, pal_hub_run_hand_over, pal_hub_run_lock, pal_hub_run_mute, pal_hub_run_remove;
enum { PAL_LOCK_TOOL, PAL_LOCK_SESSION, PAL_REMOVE, PAL_REMOVE_AND_BAN }; /* details of lock and remove */
pal_verb_run pal_hub_run_steering, pal_hub_run_reset, pal_hub_run_material, pal_hub_run_component, pal_hub_run_estimate,
    pal_hub_run_switch, pal_hub_run_edit, pal_hub_run_probe, pal_hub_run_brush, pal_hub_run_seek, pal_hub_run_speed,
    pal_hub_run_branch;
/* detail of a brush is a pal_brush_kind, of an edit a pal_cells_command_kind or one of these */
enum { PAL_EDIT_PAINT = 100, PAL_EDIT_SET_REST, PAL_EDIT_CUT, PAL_EDIT_UNCUT, PAL_EDIT_UNDO, PAL_EDIT_REDO };

/* finds the verb, checks permission and keys, and runs it; false: an error was sent */
bool pal_hub_execute(pal_client *client, const pal_wire_command *command);
/* value of an argument; otherwise: its default */
double pal_hub_arg(const pal_wire_command *command, const char *key, double otherwise);
/* body of that name; "": otherwise. -1: no such body, an error was sent */
int pal_hub_find_body(pal_client *client, const char *name, int otherwise);
/* starts an answer in hub->control, which pal_hub_send sends */
pal_wire_answer *pal_hub_answer_begin(pal_client *client, const char *verb);
void pal_hub_answer_arg(pal_wire_answer *answer, const char *key, double value);
/* forwards a command to the session; sends an error when the session refuses it. true: accepted */
bool pal_hub_session_command(pal_client *client, const char *verb, const pal_command *command);
#endif
