/* A verb of the message `command`: its name, its numbers, who may give it, and the function that executes it. A new
 * command is one line in verb_table.c and one function. Thread: [net]. */
#ifndef PAL_NET_HUB_VERB_H
#define PAL_NET_HUB_VERB_H
#include "server/net/hub_core.h"

/* X(right, who, in words) */
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
    const char *args; /* keys of its numbers; those behind the bar may be left out: "x_m y_m z_m | scale" */
    pal_right right;
    /* called with rights and keys checked; answers or sends an error itself */
    void (*run)(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
    int detail; /* what tells verbs of one function apart */
    const char *about;
};

/* finds the verb, checks rights and keys, and runs it; what cannot be is answered with an error */
void pal_hub_execute(pal_hub *hub, pal_client *client, const pal_wire_command *command);
/* value of a number, or the one given when it was left out */
double pal_hub_arg(const pal_wire_command *command, const char *key, double otherwise);
bool pal_hub_has_arg(const pal_wire_command *command, const char *key);
/* body of that name; "": the one given. -1: there is none, an error was sent */
int pal_hub_find_body(pal_hub *hub, pal_client *client, const char *name, int otherwise);
/* the answer to a command, in hub->control, sent with pal_hub_send */
pal_wire_answer *pal_hub_answer_begin(pal_hub *hub, const char *verb);
void pal_hub_answer_arg(pal_wire_answer *answer, const char *key, double value);
/* passes a command on to the session; an error is sent when that refuses it. true: taken */
bool pal_hub_session_command(pal_hub *hub, pal_client *client, const char *verb, const pal_command *command);
#endif
