/* Forces and energy that an elastic component computed in one pass. An implicit step evaluates the energy where it ends
 * and the next step begins with the forces there, so that one pass over the elements serves both (`palpate bench
 * guards`). Valid at the very same positions, bit by bit; whoever changes material or rotations invalidates it. A cache
 * that was not made never holds anything. Memory: the component's arena. Thread: make [load], else [sim]. */
#ifndef PAL_SIM_CORE_FORCE_CACHE_H
#define PAL_SIM_CORE_FORCE_CACHE_H
#include "server/base/arena.h"

#include <stdint.h>

typedef struct pal_force_cache {
    int n_node; /* 0: never valid */
    bool valid;
    double energy_J;
    uint64_t n_add; /* passes over elements saved */
    double *d, *f;  /* positions, m, and forces there, N [n_node][3] */
} pal_force_cache;

pal_err pal_force_cache_make(int n_node, pal_arena *arena, pal_force_cache *out); /* MEMORY */
static inline void pal_force_cache_invalidate(pal_force_cache *cache)
{
    cache->valid = false;
}
bool pal_force_cache_matches(const pal_force_cache *cache, const double *d); /* are d the positions? */
/* Begins an entry for d: returns the zeroed forces to add to [n_node][3]; NULL: there is no cache */
double *pal_force_cache_begin(pal_force_cache *cache, const double *d);
/* Completes it. Returns the energy */
double pal_force_cache_commit(pal_force_cache *cache, double energy_J);
void pal_force_cache_add(pal_force_cache *cache, double *f); /* f [n_node][3] += forces */
#endif
