/* Load-case problems from untrusted bytes: what is taken keeps its numbers in their ranges. */
#include "server/scene/problem_file.h"

#include <stdint.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_problem *p = NULL;
    pal_diagnostic diag;
    if (pal_problem_parse("fuzz", (const char *)bytes, n_byte, "/nowhere", &p, &diag)) return 0;
    if (p->n_material < 1 || p->n_case < 1) abort();
    for (int k = 0; k < p->n_material; k++)
        if (!(p->material[k].young_Pa > 0 && p->material[k].poisson > -1 && p->material[k].poisson < 0.5)) abort();
    for (int k = 0; k < p->n_reference; k++)
        if (!pal_problem_case_find(p, p->reference[k].load_case)) abort();
    free(p);
    return 0;
}
