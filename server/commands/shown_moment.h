/* One moment of a running world as it is shown, for other programs: FILE.glb has a mesh with normals and a material for
 * each body and image, FILE.vtp all bodies in one, with displacement_m at points and the number of the body, from 1, at
 * triangles. Positions are those of frames (sim/world/frame.h): scene frame, m, floats. Thread: [load]. */
#ifndef PAL_COMMANDS_SHOWN_MOMENT_H
#define PAL_COMMANDS_SHOWN_MOMENT_H
#include "server/sim/world/world.h"

typedef struct pal_shown_moment {
    const char *glb, *vtp; /* paths; NULL: not wanted                            */
    double at_s;           /* since the start of the recording; NaN: its end     */
    double time_s;         /* of the moment that was written                     */
    bool written;
} pal_shown_moment;

/* After each step, at now_s since the start: writes the files once at_s is reached. scene: of the world's names,
 * colours and images. Errors: IO, MEMORY, BUDGET, REFUSED. */
pal_err pal_shown_moment_step(pal_shown_moment *moment, const pal_scene *scene, const pal_world *world, double now_s,
                              pal_diagnostic *diag);
/* After the last step. Errors: as above; REFUSED: at_s was not reached. */
pal_err pal_shown_moment_end(pal_shown_moment *moment, const pal_scene *scene, const pal_world *world, double now_s,
                             pal_diagnostic *diag);
#endif
