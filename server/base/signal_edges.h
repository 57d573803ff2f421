/* The newest value of a signal, such as a button and where it was pressed, and the values at its last edges, for a
 * reader who comes less often than values do. It takes the edges that it has not taken, the oldest first, then the
 * newest value: what begins at an edge begins where the edge was. Of more than PAL_EDGES since its last look the last
 * ones remain. This is the count alone; the values are the caller's [PAL_EDGE_SLOTS], and who copies both may read the
 * copy. Zero is empty. Thread: one at a time. */
#ifndef PAL_BASE_SIGNAL_EDGES_H
#define PAL_BASE_SIGNAL_EDGES_H
#include <stdbool.h>
#include <stdint.h>

enum {
    PAL_EDGES = 4, /* a tool that lets go, leaves, comes back and grasps between two looks needs three (test_poses) */
    PAL_EDGE_NEWEST = PAL_EDGES, /* slot of the newest value; those before it are a ring buffer of edges */
    PAL_EDGE_SLOTS
};

typedef struct pal_signal_edges {
    uint64_t n_value, n_edge;
    uint64_t number[PAL_EDGE_SLOTS]; /* of the value in each slot, from 1; 0: none */
} pal_signal_edges;

/* counts a value, which the caller puts into PAL_EDGE_NEWEST, and into the returned slot too if it is an edge; else -1
 * is returned */
static inline int pal_signal_edges_put(pal_signal_edges *edges, bool is_edge)
{
    edges->number[PAL_EDGE_NEWEST] = ++edges->n_value;
    if (!is_edge) return -1;
    const int slot = (int)(edges->n_edge++ % PAL_EDGES);
    edges->number[slot] = edges->n_value;
    return slot;
}

/* slot of the value to take after the one of number `taken`, 0: of the first; -1: there is none */
static inline int pal_signal_edges_next(const pal_signal_edges *edges, uint64_t taken)
{
    for (uint64_t k = 0; k < PAL_EDGES; k++) {
        const int slot = (int)((edges->n_edge + k) % PAL_EDGES); /* from the oldest */
        if (edges->number[slot] > taken) return slot;
    }
    return edges->number[PAL_EDGE_NEWEST] > taken ? PAL_EDGE_NEWEST : -1;
}
#endif
