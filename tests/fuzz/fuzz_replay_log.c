/* Input logs from untrusted bytes: the check that comes before any world is made. */
#include "server/session/replay.h"

#include <stdint.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t n_byte)
{
    pal_replay_report report;
    pal_diagnostic diag;
    (void)pal_replay_parse("fuzz", bytes, n_byte, NULL, NULL, &report, &diag);
    return 0;
}
