/* What was done so that a body goes on where it would have left its bounds, and why one was stopped. Counts and price
 * are those since the last reset of the body; the price is measured only when something happens, so that a body that
 * needs no rescue pays nothing. Ordinary work of a method (sub-steps, the search of a Newton iteration of several,
 * contact that is settled again) is no rescue. Thread: [sim]. */
#ifndef PAL_SIM_CORE_SAFEGUARDS_H
#define PAL_SIM_CORE_SAFEGUARDS_H
#include <stdint.h>

enum { PAL_REASON_TEXT = 128 };

typedef struct pal_safeguards {
    uint64_t n_capped;      /* node loads shortened to load_cap_N                                                   */
    uint64_t n_clamped;     /* node moves shortened by the solver                                                   */
    uint64_t n_mass_scaled; /* sub-steps in which deformation asked for more than the budget of sub-steps           */
    uint64_t n_inversion;   /* times that elements were found turned over: voxels ran on their split, those of solids
                             on the edges of their cells                                                          */
    uint64_t n_split;       /* changes between elements and that; not in the sum: n_inversion says it                 */
    uint64_t n_search;      /* implicit steps taken again, shorter, because the energy had risen                    */
    uint64_t n_tool_reset;  /* tools that stayed too far within, set anew at the nearest place outside              */
    uint64_t n_stopped;     /* the body was stopped and put back: at most 1, a stopped body waits for its reset     */
    uint64_t ns;            /* time all of them took: forces on the split, searches, loads and moves shortened      */
} pal_safeguards;

/* how many in all; n_split is left out, since n_inversion covers it [any] */
static inline uint64_t pal_safeguards_sum(const pal_safeguards *s)
{
    return s->n_capped + s->n_clamped + s->n_mass_scaled + s->n_inversion + s->n_search + s->n_tool_reset +
           s->n_stopped;
}
#endif
