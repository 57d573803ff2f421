/* A session served inside the process, and clients that give it orders and wait for answers: for the tests of switches.
 */
#ifndef TESTS_NET_COMMAND_ROOM_H
#define TESTS_NET_COMMAND_ROOM_H
#include "protocol/asset.h"
#include "tests/net/server_fixture.h"

/* of body 0 */
static inline void order_begin(const pal_scene *scene, const pal_measured_configuration *point, int n_point)
{
    static pal_session_study study;
    study = (pal_session_study){.configuration = point, .n = n_point, .reference_m = NAN};
    served_begin(scene, (pal_session_options){0}, (pal_server_options){.study = point ? &study : NULL});
}

/* the loop goes on by a little; others read too, or their queues would fill. Not while a job is under way */
static inline void turn(mem_client *a, mem_client *b)
{
    served_turn(FRAME_NS / 4, a, b);
}

static inline int n_answer(const mem_client *c)
{
    return c->n_text[PAL_CONTROL_ANSWER] + c->n_text[PAL_CONTROL_ERROR];
}

static inline void until_answers(mem_client *c, mem_client *other, int n)
{
    WAIT_UNTIL(n_answer(c) >= n, c, other);
    CHECK_INT(n_answer(c), n);
}

static inline void send(mem_client *c, const char *verb, const char *args)
{
    char text[512];
    snprintf(text, sizeof text, "{\"type\":\"command\",\"verb\":\"%s\",\"target\":\"\",\"args\":{%s}}", verb, args);
    mem_text(c, text);
}

/* was it done? */
static inline bool order(mem_client *c, const char *verb, const char *args)
{
    int n_done = c->n_text[PAL_CONTROL_ANSWER];
    send(c, verb, args);
    until_answers(c, NULL, n_answer(c) + 1);
    return c->n_text[PAL_CONTROL_ANSWER] > n_done;
}

static inline double reported(const mem_client *c, const char *key)
{
    const pal_wire_answer *a = &c->last[PAL_CONTROL_ANSWER].answer;
    for (uint32_t i = 0; i < a->n_arg; i++)
        if (!strcmp(a->arg[i].key, key)) return a->arg[i].value;
    return NAN;
}

static inline const char *trouble(const mem_client *c)
{
    return c->last[PAL_CONTROL_ERROR].error.text;
}

/* waits for a frame of the epoch that the client has */
static inline void until_frame(mem_client *c)
{
    WAIT_UNTIL(c->frame.epoch == c->epoch && c->n_tools > 0, c, NULL);
    CHECK_INT(c->n_bad, 0);
}

static inline void join(mem_client *c, const char *name, pal_wire_role role, int tool)
{
    mem_join(c, transport, name, role, tool);
    mem_pull(c, 1000);
    REQUIRE(c->asset);
    until_frame(c);
}

static inline const pal_wire_part_info *part(const mem_client *c)
{
    return c->n_text[PAL_CONTROL_TOPOLOGY] ? &c->last[PAL_CONTROL_TOPOLOGY].topology.part[0]
                                           : &c->last[PAL_CONTROL_HELLO].hello.part[0];
}

static inline void order_point(pal_measured_configuration *to, const char *model, const char *element, int size)
{
    pal_configuration *s = &to->configuration;
    snprintf(s->model, sizeof s->model, "%s", model);
    snprintf(s->element, sizeof s->element, "%s", element);
    s->size = size;
    to->ms = 1, to->error_m = 0.001, to->front = true;
}
#endif
