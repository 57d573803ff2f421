/* The components that the entries of one body ask for, in order, before they are made. Used by the files of sim/plan
 * only. Thread: [load], and [sim] between steps to switch a component. */
#ifndef PAL_SIM_PLAN_PLAN_REQUESTS_H
#define PAL_SIM_PLAN_PLAN_REQUESTS_H
#include "server/sim/core/effect_list.h"

/* request of one entry */
typedef struct pal_plan_request {
    const pal_effect *effect;
    pal_config_entry *item;
} pal_plan_request;
enum { PAL_PLAN_REQUEST_MAX = 2 * PAL_ENTRIES_MAX + 2 };

typedef struct pal_plan_requests {
    pal_build build;
    pal_component_list from_model;
    pal_config_entry own[PAL_ENTRIES_MAX + 3]; /* copies of the scene's entries, because reading marks them */
    pal_plan_request request[PAL_PLAN_REQUEST_MAX];
    int n_request;
} pal_plan_requests;

/* collects the ordered requests of a body from s->from_model, which the model's entry own[0] gave, and its other
 * entries */
pal_err pal_plan_requests_collect(pal_plan_requests *s);
/* makes the component of a request in memory of its own or, if `shared`, in the body's */
pal_err pal_plan_requests_make(pal_plan_requests *s, const pal_plan_request *request, bool shared,
                               pal_component *component);
/* writes the scene entry that asks for a request, at most n_byte characters; returns the full length */
size_t pal_plan_request_reason(const pal_plan_requests *s, const pal_plan_request *request, char *text, size_t n_byte);
/* bytes: a component's own memory begins with a block of this size and grows by such */
enum { PAL_COMPONENT_BLOCK = 4096 };
/* destroys a component and its own memory */
void pal_plan_destroy_component(pal_component *component);
#endif
