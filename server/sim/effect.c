/* Running a body's FORCE rows. */
#include "server/sim/effect.h"

#include "server/base/clock.h"

#include <string.h>

pal_err pal_gather(pal_step *step)
{
    pal_body *body = step->body;
    memcpy(body->f, body->load, 3 * sizeof(double) * (size_t)body->n_node);
    uint64_t before = pal_clock_ns();
    for (int i = 0; i < step->n_force; i++) {
        pal_row *row = &step->force[i];
        if (step->drag_apart && row->effect->drag) continue;
        PAL_TRY(row->effect->run(row->self, step));
        uint64_t now = pal_clock_ns();
        row->spent_ns += now - before;
        before = now;
    }
    return PAL_ERR_OK;
}
