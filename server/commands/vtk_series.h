/* Bodies of a running world as a series of files for ParaView: FOLDER/NAME_BODY_MOMENT.vtu with the deformed elements
 * at an interval of simulated time, and FOLDER/series.pvd, which names all of them with their times. NAME is the body's
 * name in the characters a-z 0-9 _ -, BODY its number in the scene from 1. Bodies without elements of volume are left
 * out.
 *
 * Points: position, scene frame, m. At points: displacement_m, velocity_m_s and the fields that the model gives:
 * von_mises_Pa, energy_J_m3, stiffness_J, strain, distortion, young_Pa, density_kg_m3, means over the elements around
 * the point weighted by volume. Thread: [load]. */
#ifndef PAL_COMMANDS_VTU_SERIES_H
#define PAL_COMMANDS_VTU_SERIES_H
#include "server/sim/world/world.h"

#include <stdio.h>

typedef struct pal_vtu_series {
    const char *folder; /* borrowed; made at the first moment */
    double period_s;    /* between two moments */
    double next_s;      /* time of the next one */
    int n_moment, n_file;
    FILE *to;   /* appends to the list; NULL: not begun */
    char *list; /* lines of series.pvd */
    size_t n_byte;
} pal_vtu_series;

/* Writes a moment when its time has come. now_s: since the start of the recording, which a reset of the world does not
 * set back. Zero the struct and set folder and period_s before the first one. Errors: IO, MEMORY. */
pal_err pal_vtu_series_step(pal_vtu_series *series, const pal_world *world, double now_s, pal_diagnostic *diag);
/* Writes series.pvd. Errors: REFUSED: no body had elements; IO. */
pal_err pal_vtu_series_end(pal_vtu_series *series, pal_diagnostic *diag);
void pal_vtu_series_free(pal_vtu_series *series);
#endif
