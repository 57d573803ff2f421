/* Forces cache from one step to the next. */
#include "server/sim/core/force_cache.h"

#include <string.h>

static size_t size(const pal_force_cache *cache)
{
    return 3 * sizeof(double) * (size_t)cache->n_node;
}

pal_err pal_force_cache_make(int n_node, pal_arena *arena, pal_force_cache *out)
{
    *out = (pal_force_cache){.n_node = n_node};
    return PAL_NEW_DOUBLES(arena, 3 * (size_t)n_node, &out->d, &out->f) ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

bool pal_force_cache_matches(const pal_force_cache *cache, const double *d)
{
    return cache->valid && memcmp(cache->d, d, size(cache)) == 0;
}

double *pal_force_cache_begin(pal_force_cache *cache, const double *d)
{
    if (cache->n_node == 0) return NULL;
    cache->valid = false;
    memcpy(cache->d, d, size(cache));
    memset(cache->f, 0, size(cache));
    return cache->f;
}

double pal_force_cache_commit(pal_force_cache *cache, double energy_J)
{
    cache->valid = cache->n_node > 0;
    return cache->energy_J = energy_J;
}

void pal_force_cache_add(pal_force_cache *cache, double *f)
{
    cache->n_add++;
    for (int i = 0; i < 3 * cache->n_node; i++) f[i] += cache->f[i];
}
