/* Kept studies from untrusted bytes: what is taken has its numbers in their ranges and can be listed and kept again. */
#include "server/study/study_store.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    static pal_measured_configuration list[PAL_STUDY_POINTS];
    int order[PAL_STUDY_POINTS];
    pal_study_file *f = NULL;
    pal_diagnostic diag;
    if (pal_study_file_parse("fuzz", (const char *)bytes, n_byte, &f, &diag)) return 0;
    const pal_study *s = &f->study;
    if (s->n_point < 0 || s->n_point > PAL_STUDY_POINTS || f->index < 0 || f->index >= PAL_BODY_MAX) abort();
    pal_study_order(s, order);
    for (int k = 0; k < s->n_point; k++) {
        const pal_study_point *p = &s->point[k];
        if (p->measured.ms < 0 || isinf(p->measured.ms) || p->measured.error_m < 0 || isinf(p->measured.error_m))
            abort();
        if (!p->measured.configuration.model[0] || p->measured.configuration.size < -1) abort();
        if (order[k] < 0 || order[k] >= s->n_point) abort();
    }
    int n = pal_study_configurations(s, list);
    for (int k = 1; k < n; k++)
        if (!(list[k].ms >= list[k - 1].ms)) abort();
    free(f);
    return 0;
}
