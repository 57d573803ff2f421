/* Constants of adaptive surfaces: unit, reason, test that bounds each. */
#ifndef PAL_SIM_SURFACE_TUNING_H
#define PAL_SIM_SURFACE_TUNING_H
#include <stddef.h>

/* bytes for a body with its components and display where the scene gives none (test_adaptive_surface) */
#define BUDGET_BYTES ((size_t)512 << 20)
/* sizes. A finest vertex takes more than COMPONENT_BYTES in components (edge_spring, rk4) and display, whatever the
 * body; entries of the log of changed slots */
enum { COMPONENT_BYTES = 400, LOG_MIN = 1024, LOG_MAX = 65536 };
#endif
