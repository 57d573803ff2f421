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
    pal_world *world;       /* NULL: nothing has needed it since the last change (changes_alone) */
    bool changes_alone;     /* states are not carried over: a RESTORE or STATE sets them */
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

/* the world of a scene, which is borrowed; with changes_alone it is made later. Errors of pal_world_create */
pal_err pal_replayed_begin(pal_replayed *replayed, const pal_scene *scene, bool changes_alone, pal_diagnostic *diag);
/* from now on a world is there, and changes carry its state over. Errors of pal_world_create */
pal_err pal_replayed_need_world(pal_replayed *replayed, pal_diagnostic *diag);
void pal_replayed_end(pal_replayed *replayed);
/* RESTORE, STATE: a body takes positions and velocities; REFUSED: it has another number of points */
pal_err pal_replayed_restore(pal_replayed *replayed, const pal_input_record *record, pal_diagnostic *diag);
/* any record but HASH and END, as the session took it */
pal_err pal_replayed_apply(pal_replayed *replayed, const pal_input_record *record, pal_diagnostic *diag);
#endif
