/* The components that the entries of one body ask for, in order, before they are made. Used by the files of this room
 * only. Thread: that of the plan. */
#ifndef PAL_SIM_PLAN_PLAN_REQUESTS_H
#define PAL_SIM_PLAN_PLAN_REQUESTS_H
#include "server/sim/core/model.h"

/* what one body's entries ask for, in order, before rows are made */
typedef struct pal_plan_request {
    const pal_effect *effect;
    pal_config_entry *item;
} pal_plan_request;
enum { PAL_PLAN_REQUEST_MAX = 2 * PAL_ENTRIES_MAX + 2 };

typedef struct pal_plan_requests {
    pal_build build;
    pal_recipe recipe;
    pal_config_entry own[PAL_ENTRIES_MAX + 3]; /* copies of the scene's items: reading marks them */
    pal_plan_request request[PAL_PLAN_REQUEST_MAX];
    int n_request;
} pal_plan_requests;

/* the ordered requests of a body from s->recipe, which own[0], the model's entry, gave, and its other entries */
pal_err pal_plan_requests_collect(pal_plan_requests *s);
/* makes the row of a request: memory of its own, or with `shared` of the body's */
pal_err pal_plan_requests_make(pal_plan_requests *s, const pal_plan_request *request, bool shared, pal_component *row);
/* what in the scene calls for a request: at most n_byte characters; returns the length it wanted */
size_t pal_plan_request_reason(const pal_plan_requests *s, const pal_plan_request *request, char *text, size_t n_byte);
/* destroys a made row and its own memory */
void pal_plan_destroy_component(pal_component *row);
#endif
