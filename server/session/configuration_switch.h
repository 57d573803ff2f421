/* A live switch of method, resolution, step or tolerance of one body: another world is made beside the running one
 * (pal_configuration_switch_prepare, slow), and takes over between two steps with pal_session_transfer and
 * pal_configuration_switch_transfer, without a jump: displacement and velocity by
 * interpolation in the old body's elements, energy within 2 % of what it was as far as displacements and velocities
 * PAL_TRANSFER_MAX_SCALE and _RATE times as long or short can make it so (the report tells), the mismatch of forces,
 * and of what is shown, let go over 10 steps (server/sim/transfer/transfer.h). What tools hold or press they go on
 * holding and pressing, friction too, lasting loads stay, and brushes where the new body has some. Thread: one at a
 * time. */
#ifndef PAL_SESSION_CONFIGURATION_SWITCH_H
#define PAL_SESSION_CONFIGURATION_SWITCH_H
#include "server/sim/core/configuration.h"
#include "server/sim/transfer/transfer.h"
#include "server/sim/world/world.h"

typedef struct pal_configuration_switch pal_configuration_switch;
/* what the carry saw, for people and tests */
typedef struct pal_configuration_switch_report {
    double energy_before_J, energy_after_J; /* of the whole world: kinetic and elastic */
    double max_move_m, body_move_m; /* of a shown vertex and of a point of the body (server/sim/transfer/transfer.h) */
    double frame_move_m;            /* of a shown vertex from one frame to the next, as it is let in */
    double scale;                   /* of displacements, for the sake of the energy; 1: none, PAL_TRANSFER_MAX_SCALE or
                                     * 1 over it: at its bound, the energy is off by more */
} pal_configuration_switch_report;

/* The scene with `to`, its mesh and all that the carry needs (where every new node lies in the old body). It is made
 * from `scene`, whose world runs, with the body as `base` has it: as it was before its first switch, with the cells and
 * voxels that it came with, so that every setting can be come back to; NULL: as scene has it. Materials and step are
 * those of scene. Borrows scene's and base's meshes, copies both. REFUSED as of pal_configuration_check_live, which
 * comes first, and pal_configuration_make and, besides, what it is already; BUDGET, MEMORY. [any] */
pal_err pal_configuration_switch_prepare(const pal_scene *scene, const pal_body_def *base, int body,
                                         const pal_configuration *to, pal_diagnostic *diag,
                                         pal_configuration_switch **out);
const pal_scene *
pal_configuration_switch_scene(const pal_configuration_switch *change); /* lives as long as the switch */
/* pal_session_snapshot_fn and pal_session_rehearse_fn with user a pal_configuration_switch: worth it again while the
 * body has gone on by more than PAL_CONFIGURATION_SWITCH_MAX_DRIFT of its size since it was looked at */
#define PAL_CONFIGURATION_SWITCH_MAX_DRIFT 0.005
bool pal_configuration_switch_snapshot(void *change, const pal_world *before);
void pal_configuration_switch_rehearse(void *change, pal_world *next);
/* pal_session_transfer_fn with user a pal_configuration_switch */
void pal_configuration_switch_transfer(void *change, pal_world *next, const pal_world *before);
uint64_t pal_configuration_switch_transfer_count(void); /* carries that the calling thread has made, for tests [any] */
void pal_configuration_switch_get_report(const pal_configuration_switch *change,
                                         pal_configuration_switch_report *out); /* after the carry */
void pal_configuration_switch_free(
    pal_configuration_switch *change); /* NULL is fine; not while a world is made from its scene */
#endif
