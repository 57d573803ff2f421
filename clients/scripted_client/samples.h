/* Samples for percentiles. Keeps the first 1,048,576; maximum and mean count all. Thread: one. */
#ifndef PAL_SCRIPTED_CLIENT_SAMPLES_H
#define PAL_SCRIPTED_CLIENT_SAMPLES_H
#include <stddef.h>
#include <stdint.h>

typedef struct pal_samples {
    float *value;
    size_t n_kept;
    uint64_t n;
    double sum, max;
} pal_samples;

void pal_samples_add(pal_samples *s, double value);
void pal_samples_merge(pal_samples *into, const pal_samples *from);
double pal_samples_at(pal_samples *s, double fraction); /* sorts; 0 when empty */
double pal_samples_mean(const pal_samples *s);
void pal_samples_free(pal_samples *s);
#endif
