/* Forces kept from one step to the next. */
#include "server/sim/core/force_cache.h"

#include <string.h>

static size_t size(const pal_force_cache *kept)
{
    return 3 * sizeof(double) * (size_t)kept->n_node;
}

pal_err pal_force_cache_make(int n_node, pal_arena *arena, pal_force_cache *out)
{
    *out = (pal_force_cache){.n_node = n_node};
    out->d = PAL_NEW(arena, double, 3 * (size_t)n_node);
    out->f = PAL_NEW(arena, double, 3 * (size_t)n_node);
    return out->d && out->f ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

bool pal_force_cache_matches(const pal_force_cache *kept, const double *d)
{
    return kept->valid && memcmp(kept->d, d, size(kept)) == 0;
}

double *pal_force_cache_begin(pal_force_cache *kept, const double *d)
{
    if (kept->n_node == 0) return NULL;
    kept->valid = false;
    memcpy(kept->d, d, size(kept));
    memset(kept->f, 0, size(kept));
    return kept->f;
}

double pal_force_cache_commit(pal_force_cache *kept, double energy_J)
{
    kept->valid = kept->n_node > 0;
    return kept->energy_J = energy_J;
}

void pal_force_cache_add(pal_force_cache *kept, double *f)
{
    kept->n_add++;
    for (int i = 0; i < 3 * kept->n_node; i++) f[i] += kept->f[i];
}
