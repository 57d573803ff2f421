/* Verbs of the message `command`: name, arguments, permission, and the function that executes it. A new command is one
 * line in verb_table.c and one function. Thread: [net]. */
#ifndef PAL_NET_HUB_VERB_H
#define PAL_NET_HUB_VERB_H
#include "server/net/hub_core.h"

/* X(right, who, in plain words) */
#define PAL_RIGHT_TABLE(X)                                                                                             \
    X(EVERYBODY, "everybody")                                                                                          \
    X(TRAINEE, "trainees and instructors")                                                                             \
    X(TOOL, "instructors and holders of a tool")                                                                       \
    X(INSTRUCTOR, "instructors")

typedef enum pal_right {
#define X(name, who) PAL_RIGHT_##name,
    PAL_RIGHT_TABLE(X)
#undef X
        PAL_RIGHT_COUNT
} pal_right;

struct pal_verb {
    const char *name;
    const char *args; /* argument keys; those behind the bar are optional: "x_m y_m z_m | scale" */
    pal_right right;
    /* called after permission and keys are checked; sends an answer or an error */
    void (*run)(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
    int detail; /* distinguishes verbs that share a function */
    const char *about;
};

/* finds the verb, checks permission and keys, and runs it; sends an error on failure */
void pal_hub_execute(pal_hub *hub, pal_client *client, const pal_wire_command *command);
/* value of an argument; otherwise: its default */
double pal_hub_arg(const pal_wire_command *command, const char *key, double otherwise);
bool pal_hub_has_arg(const pal_wire_command *command, const char *key);
/* body of that name; "": otherwise. -1: no such body, an error was sent */
int pal_hub_find_body(pal_hub *hub, pal_client *client, const char *name, int otherwise);
/* starts an answer in hub->control, which pal_hub_send sends */
pal_wire_answer *pal_hub_answer_begin(pal_hub *hub, const char *verb);
void pal_hub_answer_arg(pal_wire_answer *answer, const char *key, double value);
/* forwards a command to the session; sends an error when the session refuses it. true: accepted */
bool pal_hub_session_command(pal_hub *hub, pal_client *client, const char *verb, const pal_command *command);
#endif
