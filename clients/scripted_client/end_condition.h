/* Conditions that a scripted client must meet before it may end: "NAME=NUMBER,...", all of them. Tests wait for a
 * condition instead of a time. SI units except moved_mm. Thread: [load]. */
#ifndef PAL_SCRIPTED_CLIENT_END_CONDITION_H
#define PAL_SCRIPTED_CLIENT_END_CONDITION_H
#include "clients/scripted_client/scripted_client.h"

/* NAME, amount seen by the client */
#define PAL_END_CONDITION_TABLE(X)                                                                                     \
    X(cycles, (double)r->n_cycle)                                                                                      \
    X(frames, (double)r->n_frame)                                                                                      \
    X(answered, (double)r->latency_ms.n) /* poses echoed in frames */                                                  \
    X(fields, (double)r->n_field)                                                                                      \
    X(patches, (double)r->n_patch)                                                                                     \
    X(triangles, (double)r->n_triangle)                                                                                \
    X(field_high, r->field_high)                                                                                       \
    X(orders, (double)r->n_order)                                                                                      \
    X(topologies, (double)r->n_topology)                                                                               \
    X(cycles_of_it, (double)r->n_cycle_since_topology) /* since the last topology or join */                           \
    X(members, (double)r->n_member)                    /* in the session */                                            \
    X(joins, (double)r->joins)                                                                                         \
    X(stalls, (double)r->stall_done)                                                                                   \
    X(moved_mm, r->moved_m * 1e3)                                                                                      \
    X(force_N, r->force_N)
enum {
#define X(name, seen) PAL_END_CONDITION_##name,
    PAL_END_CONDITION_TABLE(X)
#undef X
        PAL_END_CONDITION_COUNT
};

typedef struct pal_end_condition {
    bool any;
    double min[PAL_END_CONDITION_COUNT]; /* 0: no condition */
} pal_end_condition;

/* REFUSED: names the word */
pal_err pal_end_condition_parse(pal_end_condition *until, const char *text, pal_diagnostic *diag);
/* true: all conditions are met; false otherwise, and when there are none */
bool pal_end_condition_met(const pal_end_condition *until, const pal_scripted_client_result *r);
#endif
