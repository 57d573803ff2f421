/* Verbs for sculpting: edits, probes, brushes. Thread: [net]. */
#ifndef PAL_NET_HUB_SCULPT_H
#define PAL_NET_HUB_SCULPT_H
#include "server/mesh/cells/cell_edits.h"
#include "server/net/hub_verb.h"

/* pal_verb.detail of an edit: a pal_cells_command_kind, or one of these */
enum { PAL_EDIT_PAINT = 100, PAL_EDIT_SET_REST, PAL_EDIT_CUT, PAL_EDIT_UNCUT, PAL_EDIT_UNDO, PAL_EDIT_REDO };

void pal_hub_run_edit(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
void pal_hub_run_probe(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
/* detail: pal_brush_kind */
void pal_hub_run_brush(pal_hub *hub, pal_client *client, const pal_verb *verb, const pal_wire_command *command);
#endif
