/* The simplest client: one tool in one session, for programs that need no event loop of their own. It joins, fetches
 * the rest shape of the first part and calls `ready`; whoever has moved the tool is called when a step has used the
 * pose, which is sent again until then: a pose lasts for a quarter of a second. After a reconnection `ready` is called
 * again. Thread: that of pal_tool_client_run, which calls back. */
#ifndef PAL_LINK_TOOL_CLIENT_H
#define PAL_LINK_TOOL_CLIENT_H
#include "clients/link/asset_store.h"

typedef struct pal_tool_client pal_tool_client;
struct pal_tool_client {
    /* set by the caller */
    void (*ready)(pal_tool_client *c);
    /* tool: as the step that used the newest pose has it, with the force of the tissue on it; borrowed for the call */
    void (*moved)(pal_tool_client *c, const pal_wire_tool *tool);
    void *user;
    /* of the session, from `ready` on */
    double up[3], radius_m;       /* unit, away from the ground; of the tool */
    double top_m[3];              /* the vertex of the rest shape that is furthest along up */
    const pal_stored_asset *rest; /* of the first part; borrowed until the end */
    /* private */
    pal_link_loop *loop;
    pal_link *link;
    pal_asset_store *store;
    pal_wire_pose pose; /* the newest; seq 0: none */
    uint32_t n_moved;   /* seq of the newest that was answered */
    pal_diagnostic *diag;
    pal_err err;
};

/* Joins the session at url (pal_link_options) as a trainee with any tool, until pal_tool_client_stop. REFUSED: the URL,
 * the server, the tool or the shape; STATE: seconds (0: without limit) are over; MEMORY. diag has the sentence. */
pal_err pal_tool_client_run(pal_tool_client *c, const char *url, double seconds, pal_diagnostic *diag);
/* from `ready` or `moved`: where the tool's centre shall be and whether it grasps; STATE: not joined; REFUSED: a number
 * is not finite */
pal_err pal_tool_client_move(pal_tool_client *c, const double position_m[3], bool grasps);
void pal_tool_client_stop(pal_tool_client *c);
#endif
