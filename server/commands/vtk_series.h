/* A running world as a series of files for ParaView, at an interval of simulated time, with a list of all of them and
 * their times.
 *
 * Elements: FOLDER/NAME_BODY_MOMENT.vtu and FOLDER/series.pvd. NAME is the body's name in the characters a-z 0-9 _ -,
 * BODY its number in the scene from 1. Bodies without elements of volume are left out. Points: position, scene frame,
 * m. At points: displacement_m, velocity_m_s and the fields that the model gives: von_mises_Pa, energy_J_m3,
 * stiffness_J, strain, distortion, young_Pa, density_kg_m3, means over the elements around the point weighted by
 * volume.
 *
 * Surfaces: FOLDER/surfaces_MOMENT.vtp, each as in shown_moment.h, and FOLDER/surfaces.pvd. Thread: [load]. */
#ifndef PAL_COMMANDS_VTK_SERIES_H
#define PAL_COMMANDS_VTK_SERIES_H
#include "server/sim/world/world.h"

#include <stdio.h>

typedef struct pal_vtk_series {
    const char *folder;     /* borrowed; made at the first moment */
    const pal_scene *scene; /* surfaces are wanted, of this scene's bodies; NULL: elements */
    double period_s;        /* between two moments */
    double next_s;          /* time of the next one */
    int n_moment, n_file;
    FILE *to;   /* appends to the list; NULL: not begun */
    char *list; /* lines of the PVD */
    size_t n_byte;
} pal_vtk_series;

/* Writes a moment when its time has come. now_s: since the start of the recording, which a reset of the world does not
 * set back. Zero the struct and set folder, scene and period_s before the first one. Errors: IO, MEMORY, REFUSED: the
 * path of the folder is too long. */
pal_err pal_vtk_series_step(pal_vtk_series *series, const pal_world *world, double now_s, pal_diagnostic *diag);
/* Writes the PVD. Errors: REFUSED: no body had elements; IO. */
pal_err pal_vtk_series_end(pal_vtk_series *series, pal_diagnostic *diag);
void pal_vtk_series_free(pal_vtk_series *series);
#endif
