/* Edits and switches of a replay: they make another scene and another world, as jobs of a server do, from the records
 * that those left. Private to server/session. Thread: [load]. */
#ifndef PAL_SESSION_REPLAY_CHANGES_H
#define PAL_SESSION_REPLAY_CHANGES_H
#include "server/session/configuration_switch.h"
#include "server/session/input_log.h"
#include "server/session/session.h"

enum { PAL_REPLAY_DISABLED = 64 };

typedef struct pal_replayed {
    const pal_scene *scene; /* of the world */
    pal_world *world;
    struct {
        pal_sculptor *sculptor;
        pal_sculpt_edit *edit;            /* made the scene; NULL: none */
        pal_configuration_switch *change; /* made the scene; NULL: none */
        pal_body_def *base;               /* before the first switch; NULL: as it is */
    } body[PAL_BODY_MAX];
    /* a switch that was prepared and has not taken effect */
    pal_configuration_switch *next;
    pal_world *next_world;
    pal_body_def *next_base;
    int next_body;
    int n_disabled; /* components, by the names of body and component */
    struct {
        char body[PAL_NAME], component[PAL_NAME];
    } disabled[PAL_REPLAY_DISABLED];
} pal_replayed;

/* the world of a scene, which is borrowed; errors of pal_world_create */
pal_err pal_replayed_begin(pal_replayed *replayed, const pal_scene *scene, pal_diagnostic *diag);
void pal_replayed_end(pal_replayed *replayed);
/* SCULPT, PREPARE, REHEARSE, SWITCH. REFUSED: what the record says cannot be */
pal_err pal_replayed_change(pal_replayed *replayed, const pal_input_record *record, pal_diagnostic *diag);
/* RESTORE, STATE: a body takes positions and velocities; REFUSED: it has another number of points */
pal_err pal_replayed_restore(pal_replayed *replayed, const pal_input_record *record, pal_diagnostic *diag);
/* notes the state of a component that a COMPONENT record has set, for worlds that replace this one */
void pal_replayed_component(pal_replayed *replayed, const pal_input_record *record);
#endif
