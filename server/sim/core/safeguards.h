/* Safeguards of a body: what kept its state within bounds, counted since the last reset. Time is measured only when a
 * safeguard acts, so that a body without one pays nothing. Ordinary work of a method (sub-steps, line searches of a
 * Newton iteration, contact solved again) is not counted. Thread: [sim]. */
#ifndef PAL_SIM_CORE_SAFEGUARDS_H
#define PAL_SIM_CORE_SAFEGUARDS_H
#include <stdint.h>

enum { PAL_REASON_TEXT = 128 };

typedef struct pal_safeguards {
    uint64_t n_capped;      /* node loads shortened to load_cap_N                                              */
    uint64_t n_clamped;     /* node displacements shortened by the solver                                      */
    uint64_t n_mass_scaled; /* sub-steps with added mass, since the budget of sub-steps was used up            */
    uint64_t n_inversion;   /* updates that found inverted elements, which then ran on their recovery          */
    uint64_t n_change;      /* changes between elements and recovery; not in the sum, since n_inversion counts */
    uint64_t n_search;      /* implicit steps repeated with line search, because the energy had risen          */
    uint64_t n_tool_reset;  /* tools that stayed too deep, moved to the nearest place outside                  */
    uint64_t n_stopped;     /* the body was frozen: at most 1, since it then waits for its reset               */
    uint64_t ns;            /* time that all of them took                                                      */
} pal_safeguards;

/* how many in all; n_change is left out, since n_inversion covers it [any] */
static inline uint64_t pal_safeguards_sum(const pal_safeguards *s)
{
    return s->n_capped + s->n_clamped + s->n_mass_scaled + s->n_inversion + s->n_search + s->n_tool_reset +
           s->n_stopped;
}
#endif
