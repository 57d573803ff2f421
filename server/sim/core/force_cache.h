/* Forces and energy that an elastic row found together, kept until the body moves: an implicit step looks at the energy
 * where it ended, the next one begins with the forces there, so that one pass over the elements serves both and being
 * on guard costs little more than the sums (`palpate bench guards`). Valid only at the very positions, bit by bit;
 * whoever changes what forces depend on besides positions (material, reset) calls forget. Nothing is kept where nothing
 * was made. Memory: the world's arena. Thread: make [load], else [sim]. */
#ifndef PAL_SIM_CORE_FORCE_CACHE_H
#define PAL_SIM_CORE_FORCE_CACHE_H
#include "server/base/arena.h"

#include <stdint.h>

typedef struct pal_force_cache {
    int n_node; /* 0: never keeps */
    bool valid;
    double energy_J;
    uint64_t n_add; /* passes over elements saved */
    double *d, *f;  /* positions, m, and forces there, N [n_node][3] */
} pal_force_cache;

pal_err pal_force_cache_make(int n_node, pal_arena *arena, pal_force_cache *out); /* MEMORY */
static inline void pal_force_cache_invalidate(pal_force_cache *kept)
{
    kept->valid = false;
}
bool pal_force_cache_matches(const pal_force_cache *kept, const double *d); /* are d the positions? */
/* forces at d are about to be added to the answer, which is 0; NULL: nothing is kept here */
double *pal_force_cache_begin(pal_force_cache *kept, const double *d);
/* they have been. Returns the energy */
double pal_force_cache_commit(pal_force_cache *kept, double energy_J);
void pal_force_cache_add(pal_force_cache *kept, double *f); /* f [n_node][3] += forces */
#endif
