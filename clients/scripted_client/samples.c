#include "clients/scripted_client/samples.h"

#include "server/base/heap.h"

enum { SAMPLES_MAX = 1 << 20 };

void pal_samples_add(pal_samples *s, double value)
{
    s->n++;
    s->sum += value;
    if (s->n == 1 || value > s->max) s->max = value;
    if (s->n_kept == SAMPLES_MAX || !PAL_GROW(s->value, s->n_kept)) return;
    s->value[s->n_kept++] = (float)value;
}

void pal_samples_merge(pal_samples *into, const pal_samples *from)
{
    for (size_t i = 0; i < from->n_kept; i++) pal_samples_add(into, from->value[i]);
}

static int samples_compare(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

double pal_samples_at(pal_samples *s, double fraction)
{
    if (s->n_kept == 0) return 0;
    qsort(s->value, s->n_kept, sizeof *s->value, samples_compare);
    size_t i = (size_t)(fraction * (double)s->n_kept);
    return s->value[i < s->n_kept ? i : s->n_kept - 1];
}

double pal_samples_mean(const pal_samples *s)
{
    return s->n ? s->sum / (double)s->n : 0;
}

void pal_samples_free(pal_samples *s)
{
    free(s->value);
    *s = (pal_samples){0};
}
