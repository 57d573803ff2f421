/* Sample files from untrusted bytes: what is taken is finite and all of it is there. */
#include "server/solve/sample_points.h"

#include <math.h>
#include <stdlib.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_samples s = {0};
    pal_diagnostic diag;
    if (pal_samples_parse("fuzz", bytes, n_byte, &s, &diag)) return 0;
    if (s.n < 1) abort();
    for (int k = 0; k < 3 * s.n; k++)
        if (!isfinite(s.x[k]) || !isfinite(s.u[k])) abort();
    pal_samples_free(&s);
    return 0;
}
