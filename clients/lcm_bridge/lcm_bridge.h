/* palpate.v2 on one side, LCM on the other: what palpate-lcm does.
 *
 * One member takes frames and status to LCM, and gives the orders of the bus by the role that its ticket allows; each
 * tool whose states come in on <prefix>/<session>/TOOL/<n> gets a trainee member of its own that takes tool n, passes
 * the newest state on as POSE (at most 245 a second, first of all those at which the grasp changes) and brings HAPTIC
 * back as HMODEL/<n>; after 5 s of silence it gives the tool back. Types: lcmtypes/. Out:
 *   - BODY/<part>, body_frame_t: the FRAME message byte for byte. Repeated after 1 s without change, so that a late
 *     listener sees a part at rest. Longer than a datagram: in fragments, of which none may be lost, so a listener's
 *     receive buffer must hold the frame.
 *   - STATUS, session_status_t: with every status message of the server, 1 Hz without a server.
 *   - TRIANGLES/<part>, triangles_t: the present triangles of a part that adapts, before the first frame of theirs: a
 *     frame waits for its asset, and while more triangles go out than the bus should carry. Repeated as frames are.
 *     Those of an edited part are in its asset, which STATUS names before the first frame of the new epoch.
 *   - HMODEL/<n>, haptic_model_t.
 *   - ANSWER, answer_t, about orders (lcm_orders.h).
 * In: TOOL/<n>, tool_state_t: length walk, admission (lcm_seal.h), then version, range and finite numbers, a seq that
 * grows by no more than the time allows.
 * Thread: [net]. */
#ifndef PAL_LCM_BRIDGE_LCM_BRIDGE_H
#define PAL_LCM_BRIDGE_LCM_BRIDGE_H
#include "clients/link/lcm_link.h"

typedef struct pal_lcm_bridge pal_lcm_bridge;

typedef struct pal_lcm_bridge_options {
    const char *server;  /* ws://host:port/ws; borrowed                      */
    const char *session; /* name in channels; NULL: the server's; borrowed   */
    pal_lcm_options lcm; /* the bus                                          */
} pal_lcm_bridge_options;

typedef struct pal_lcm_bridge_counts {
    uint64_t n_frame, n_frame_dropped, n_state, n_state_refused, n_model, n_status, n_triangles, n_order,
        n_order_refused, n_other, n_logged; /* logged: refusals */
    int n_tool;                             /* with a member now                          */
    bool refused;                           /* the server refused for good: the loop was stopped */
} pal_lcm_bridge_counts;

/* REFUSED: a URL. Borrows loop. */
pal_err pal_lcm_bridge_open(pal_link_loop *loop, const pal_lcm_bridge_options *options, pal_diagnostic *diag,
                            pal_lcm_bridge **out);
void pal_lcm_bridge_close(pal_lcm_bridge *bridge); /* after the loop is destroyed; NULL is fine */
pal_lcm_bridge_counts pal_lcm_bridge_count(const pal_lcm_bridge *bridge);
#endif
