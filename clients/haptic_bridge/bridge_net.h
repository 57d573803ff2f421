/* The network side of a bridge: sends poses and forces at 250 Hz and receives haptic models, by websocket or LCM. It
 * exchanges data with the servo only through triple buffers, a queue and flags. Thread: [net]. */
#ifndef PAL_HAPTIC_BRIDGE_BRIDGE_NET_H
#define PAL_HAPTIC_BRIDGE_BRIDGE_NET_H
#include "clients/haptic_bridge/hand_brush.h"
#include "clients/haptic_bridge/servo_thread.h"
#include "clients/link/link.h"

typedef struct pal_bridge_net pal_bridge_net;

typedef struct pal_bridge_net_options {
    const char *server;   /* ws://host:port/ws or lcm://group:port?ttl=0; borrowed */
    const char *channel;  /* LCM: prefix of channels, NULL: PALPATE1; borrowed */
    const char *lcm_key;  /* LCM: key file, NULL: PALPATE_LCM_KEY, or none; borrowed */
    const char *session;  /* LCM: session name in the channels; borrowed */
    const char *name;     /* of the member; borrowed                                 */
    int tool;             /* index; with a websocket also PAL_WIRE_TOOL_ANY */
    double up[3];         /* world direction of the device's up; 0 0 0: that of the scene, from hello */
    bool has_origin;      /* the workspace stays at the origin in servo */
    pal_hand_brush brush; /* what the grasp button does; with a websocket                        */
    bool inside;          /* the tool touches nothing until it grasps, so that it grasps within the volume; the same */
    pal_servo_options servo; /* limits and workspace, for HCONFIG                       */
} pal_bridge_net_options;

typedef struct pal_bridge_net_counts {
    bool joined; /* a server answered */
    int tool;
    uint64_t n_pose, n_model, n_refused, n_reconnect; /* reconnect: joined again after a loss */
    uint64_t n_model_lost;                            /* numbers between two models that did not come in order */
    uint64_t n_order, n_order_refused;                /* commands of the brush                */
    pal_jitter rtt;                                   /* own clock - echoed stamp - holding time of the server */
    char reason[128];
} pal_bridge_net_counts;

/* Borrows loop, servo and thread (NULL: no timing). With a websocket, the device's up becomes the scene's unless `up`
 * is given, and without an origin the centre of the workspace is placed where the tool first touches the organ from
 * there. REFUSED: URL; *out is then set too and must be closed. */
pal_err pal_bridge_net_open(pal_link_loop *loop, pal_servo *servo, pal_servo_thread *thread,
                            const pal_bridge_net_options *options, pal_diagnostic *diag, pal_bridge_net **out);
void pal_bridge_net_close(pal_bridge_net *net); /* after the loop is destroyed; NULL is fine */
pal_bridge_net_counts pal_bridge_net_count(const pal_bridge_net *net);
const pal_servo_view *pal_bridge_net_view(const pal_bridge_net *net); /* newest view */
#endif
