/* Finds, checks and executes verbs. */
#include "server/net/hub_verb.h"

#include "server/net/hub_news.h"
#include "server/net/hub_peers.h"
#include "server/net/transport/plain_text.h"

#include <stdio.h>
#include <string.h>

static const pal_wire_arg *find_arg(const pal_wire_command *command, const char *key)
{
    for (uint32_t i = 0; i < command->n_arg; i++)
        if (!strcmp(command->arg[i].key, key)) return &command->arg[i];
    return NULL;
}

double pal_hub_arg(const pal_wire_command *command, const char *key, double otherwise)
{
    const pal_wire_arg *arg = find_arg(command, key);
    return arg ? arg->value : otherwise;
}

/* are all required arguments present, and no unknown ones? */
static bool check_args(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    bool required = true;
    uint32_t n_known = 0;
    for (const char *at = verb->args; *at;) {
        char key[32];
        size_t n = strcspn(at, " ");
        snprintf(key, sizeof key, "%.*s", (int)n, at);
        at += n + (at[n] == ' ');
        if (!strcmp(key, "|")) {
            required = false;
            continue;
        }
        bool there = find_arg(command, key) != NULL;
        n_known += there;
        if (there || !required) continue;
        return pal_hub_refuse(c, "args", "%s: %s is missing", verb->name, key);
    }
    return n_known == command->n_arg ||
           pal_hub_refuse(c, "args", "%s takes %s", verb->name, verb->args[0] ? verb->args : "no numbers");
}

static bool check_right(pal_client *c, const pal_verb *verb)
{
    if (c->member->muted) return pal_hub_refuse(c, "muted", "%s: an instructor lets you watch only", verb->name);
    return pal_hub_may(c, verb->right) ||
           pal_hub_refuse(c, "role", "%s: only for %s", verb->name, pal_right_text[verb->right]);
}

bool pal_hub_execute(pal_client *c, const pal_wire_command *command)
{
    const pal_verb *verb = c->hub->verb, *end = verb + c->hub->n_verb;
    while (verb < end && strcmp(verb->name, command->verb)) verb++;
    if (verb == end) return pal_hub_refuse(c, "verb", "there is no command %s", command->verb);
    const bool input = verb->right == PAL_RIGHT_TOOL ||
                       (verb->right > PAL_RIGHT_STEER && verb->right <= PAL_RIGHT_CUT) ||
                       verb->run == pal_hub_run_reset;
    if (input && pal_hub_playing(c->room, NULL))
        return pal_hub_refuse(c, "recording", "%s: the session plays a recording; branch goes on live from here",
                              verb->name);
    if (!check_right(c, verb) || !check_args(c, verb, command) || !verb->run(c, verb, command)) return false;
    if (verb->right >= PAL_RIGHT_STEER) pal_hub_note_order(c, command);
    return true;
}

int pal_hub_find_body(pal_client *c, const char *name, int otherwise)
{
    int body = name[0] ? pal_scene_find_body(pal_session_scene(c->room->session), name) : otherwise;
    if (body < 0) pal_hub_refuse(c, "target", "there is no body %s", name);
    return body;
}

void pal_hub_answer_arg(pal_wire_answer *answer, const char *key, double value)
{
    pal_wire_arg *to = &answer->arg[answer->n_arg++];
    snprintf(to->key, sizeof to->key, "%s", key);
    to->value = value;
}

pal_wire_answer *pal_hub_answer_begin(pal_client *c, const char *verb)
{
    pal_wire_answer *answer = &pal_hub_message(c->hub, PAL_CONTROL_ANSWER)->answer;
    pal_plain_text(answer->verb, sizeof answer->verb, verb);
    return answer;
}

bool pal_hub_session_command(pal_client *c, const char *verb, const pal_command *command)
{
    pal_err err = pal_session_command(c->room->session, command);
    return !err || pal_hub_refuse(c, err == PAL_ERR_FULL ? "busy" : "refused", "%s: %s", verb, pal_err_text(err));
}
