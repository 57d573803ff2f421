/* The network side of a bridge: poses and forces out at 250 Hz, haptic models in, by websocket or LCM. It sees the
 * servo only through its triple buffers, ring and flags. Thread: [net]. */
#ifndef PAL_HAPTIC_BRIDGE_BRIDGE_NET_H
#define PAL_HAPTIC_BRIDGE_BRIDGE_NET_H
#include "clients/haptic_bridge/servo_thread.h"
#include "clients/link/link.h"

typedef struct pal_bridge_net pal_bridge_net;

typedef struct pal_bridge_net_options {
    const char *server;      /* ws://host:port/ws or lcm://group:port?ttl=0; borrowed */
    const char *session;     /* LCM: name in the channels; borrowed                     */
    const char *name;        /* of the member; borrowed                                 */
    int tool;                /* index; websocket: or PAL_WIRE_TOOL_ANY                  */
    double up[3];            /* from which side the organ is touched                    */
    bool has_origin;         /* the workspace stays where the servo was told            */
    pal_servo_options servo; /* limits and workspace, for HCONFIG                       */
} pal_bridge_net_options;

typedef struct pal_bridge_net_counts {
    bool joined; /* a server was met                                        */
    int tool;
    uint64_t n_pose, n_model, n_event, n_refused;
    pal_jitter rtt; /* own clock now - echoed stamp - time held by the server  */
    double seconds_joined;
    char last_event[96], reason[128];
} pal_bridge_net_counts;

/* borrows loop, servo and thread (may be NULL: no timing). With a websocket and no origin the workspace's centre is put
 * where the tool first touches the organ from `up`. REFUSED: URL; *out is set also then, to be closed */
pal_err pal_bridge_net_open(pal_link_loop *loop, pal_servo *servo, pal_servo_thread *thread,
                            const pal_bridge_net_options *options, pal_diagnostic *diag, pal_bridge_net **out);
void pal_bridge_net_close(pal_bridge_net *net); /* after the loop is destroyed; NULL is fine */
pal_bridge_net_counts pal_bridge_net_count(pal_bridge_net *net);
const pal_servo_view *pal_bridge_net_view(const pal_bridge_net *net); /* newest view */
#endif
