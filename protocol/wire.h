/* The binary messages of palpate.v2 except FRAME's body: packed little-endian structs behind an 8-byte head.
 *
 * README.md is the specification (byte tables); this header is its C face. `put` functions return the bytes written,
 * or 0 when cap is too small (or a count is above its maximum); `get` functions return a pal_refusal code, check every
 * length and that every number is finite and in range, and write *out only on success. No function allocates. SI units.
 * Thread: any. */
#ifndef PAL_PROTOCOL_WIRE_H
#define PAL_PROTOCOL_WIRE_H
#include "protocol/refusal.h"

#include <stddef.h>
#include <stdint.h>

#define PAL_PROTOCOL_NAME    "palpate.v2" /* websocket subprotocol; the number changes with any incompatible change */
#define PAL_PROTOCOL_VERSION 2
#define PAL_WIRE_MAGIC       0x314C4150u /* the bytes P A L 1 */

#define PAL_WIRE_HEAD_BYTES            8
#define PAL_WIRE_TOOL_MAX              32         /* tools of a session */
#define PAL_WIRE_PART_MAX              16         /* mesh parts of a session */
#define PAL_WIRE_CONTACT_PATCH_MAX     8          /* contact patches of a haptic model */
#define PAL_WIRE_VERTEX_MAX            (1u << 22) /* shown vertices of a part, PAL_ORDER_VERTEX_MAX */
#define PAL_WIRE_POSE_BYTES            152
#define PAL_WIRE_ACK_BYTES             16
#define PAL_WIRE_TOOLS_BYTES(n_tool)   (24u + 68u * (n_tool))
#define PAL_WIRE_HAPTIC_BYTES(n_patch) (164u + 68u * (n_patch))
#define PAL_WIRE_TOOLS_MAX             PAL_WIRE_TOOLS_BYTES(PAL_WIRE_TOOL_MAX)
#define PAL_WIRE_HAPTIC_MAX            PAL_WIRE_HAPTIC_BYTES(PAL_WIRE_CONTACT_PATCH_MAX)

typedef enum pal_wire_kind {
    PAL_WIRE_FRAME = 1,          /* server to client: shown vertices of one part, frame_codec.h */
    PAL_WIRE_TOOLS = 2,          /* server to client: all tools; closes a cycle                 */
    PAL_WIRE_HAPTIC = 3,         /* server to client: contact model for one tool's holder       */
    PAL_WIRE_FIELD = 4,          /* server to client that asked: numbers for colours, field_codec.h */
    PAL_WIRE_TOPOLOGY_DELTA = 5, /* server to client that takes them: changed triangles, topology_delta_codec.h */
    PAL_WIRE_INTERIOR = 6,       /* server to client that asked: displacements and values inside, interior_codec.h */
    PAL_WIRE_POSE = 16,          /* client to server: pose of the tool it holds                 */
    PAL_WIRE_ACK = 17            /* client to server: cycle taken in, gives credit              */
} pal_wire_kind;

/* websocket close codes with the meaning they have here (protocol/README.md, "Closing") */
typedef enum pal_wire_close {
    PAL_WIRE_CLOSE_NORMAL = 1000,
    PAL_WIRE_CLOSE_GOING_AWAY = 1001, /* server ends, page leaves               */
    PAL_WIRE_CLOSE_PROTOCOL = 1002,   /* a message was refused; reason = why    */
    PAL_WIRE_CLOSE_POLICY = 1008,     /* not allowed: role, address             */
    PAL_WIRE_CLOSE_TOO_BIG = 1009,    /* message above its limit                */
    PAL_WIRE_CLOSE_INTERNAL = 1011,   /* a mistake of ours                      */
    PAL_WIRE_CLOSE_RATE = 4001,       /* more messages than the rate limit      */
    PAL_WIRE_CLOSE_STALLED = 4002,    /* no acknowledgement for 10 s            */
    PAL_WIRE_CLOSE_FULL = 4003,       /* session has no room for a further peer */
    PAL_WIRE_CLOSE_NO_SESSION = 4004, /* session does not exist or has ended    */
    PAL_WIRE_CLOSE_REMOVED = 4005,    /* an instructor has removed or banned the member */
    PAL_WIRE_CLOSE_ELSEWHERE = 4006   /* no room for who watches: relays have it */
} pal_wire_close;

/* first 8 bytes of every binary message */
typedef struct pal_wire_head {
    uint8_t kind;   /* pal_wire_kind              */
    uint8_t flags;  /* FRAME only, else 0         */
    uint16_t index; /* FRAME, FIELD, TOPOLOGY_DELTA: part; POSE, HAPTIC: tool; TOOLS: n_tool; ACK: 0 */
} pal_wire_head;
/* head of any message, e.g. to dispatch on kind: SHORT, MAGIC or KIND refused */
int pal_wire_get_head(const uint8_t *bytes, size_t n_byte, pal_wire_head *out);
/* private to this room: the head of a message of one kind with no other flags than these; writes a head and returns the
 * place behind it; SHORT or LONG where n_byte is not what is wanted */
int pal_wire_get_head_of(const uint8_t *bytes, size_t n_byte, uint8_t kind, uint8_t flags, pal_wire_head *out);
uint8_t *pal_wire_put_head(uint8_t *at, uint8_t kind, uint8_t flags, uint16_t index);
int pal_wire_check_size(size_t n_byte, size_t wanted);

/* pal_wire_pose.flags: those of tool_state_t (lcmtypes/) and AWAY */
enum {
    PAL_WIRE_POSE_CONTACT = 1,
    PAL_WIRE_POSE_CLUTCHED = 2,
    PAL_WIRE_POSE_FORCES_ON = 4,
    PAL_WIRE_POSE_SATURATED = 8,
    PAL_WIRE_POSE_STIFF_CLAMPED = 16,
    PAL_WIRE_POSE_STALE = 32,
    PAL_WIRE_POSE_ESTOP = 64,
    PAL_WIRE_POSE_POSE_ONLY = 128,
    PAL_WIRE_POSE_AWAY =
        256, /* the tool is lifted out of the scene: touches and grasps nothing until a pose without it */
    PAL_WIRE_POSE_FLAGS = 511
};
enum { PAL_WIRE_GRASP = 1 };

/* POSE, client to server. Carries all of tool_state_t (lcmtypes/), so that palpate-lcm can pass it on unchanged. */
typedef struct pal_wire_pose {
    uint16_t tool;
    uint32_t seq;          /* grows by one per pose of this client and tool                          */
    uint32_t flags;        /* PAL_WIRE_POSE_*                                                             */
    uint64_t stamp_us;     /* the client's own monotonic clock, echoed by TOOLS and HAPTIC           */
    double position_m[3];  /* of the tool's centre, |component| <= 1000                              */
    double quaternion[4];  /* w x y z, tool to scene axes, | |q|^2 - 1 | <= 1e-3                          */
    float velocity_m_s[3]; /* 0 when not measured                                                    */
    float omega_rad_s[3];
    float force_N[3]; /* really commanded to the device, scene axes, acting on the hand        */
    float torque_N_m[3];
    float grip;         /* opening, rad or m; 0 without a gripper                                 */
    uint32_t buttons;   /* PAL_WIRE_GRASP                                                           */
    uint32_t model_seq; /* newest haptic model that the sender's device renders, 0 none           */
    uint32_t model_age_us;
    uint64_t model_stamp_us; /* stamp_us of that model                                                 */
} pal_wire_pose;
size_t pal_wire_put_pose(uint8_t *dst, size_t cap, const pal_wire_pose *p);
int pal_wire_get_pose(const uint8_t *bytes, size_t n_byte, pal_wire_pose *out);

/* ACK, client to server, one per TOOLS message taken in (protocol/README.md, "Cycles and credit"). */
typedef struct pal_wire_ack {
    uint32_t cycle;     /* of the TOOLS message: all messages of this and earlier cycles were processed */
    uint32_t decode_us; /* time the client spent on decoding the cycle's frames, for statistics         */
} pal_wire_ack;
size_t pal_wire_put_ack(uint8_t *dst, size_t cap, const pal_wire_ack *a);
int pal_wire_get_ack(const uint8_t *bytes, size_t n_byte, pal_wire_ack *out);

/* pal_wire_tool.flags */
enum {
    PAL_WIRE_TOOL_HELD = 1,    /* some member holds it                         */
    PAL_WIRE_TOOL_CONTACT = 2, /* its force on the tissue is not zero          */
    PAL_WIRE_TOOL_GRASPS = 4,  /* it holds tissue */
    PAL_WIRE_TOOL_STALE = 8,   /* no pose for 0.25 s */
    PAL_WIRE_TOOL_AWAY = 16,   /* lifted out of the scene: do not draw         */
    PAL_WIRE_TOOL_FLAGS = 31
};
/* one tool of a TOOLS message; its place in the array is the tool's index */
typedef struct pal_wire_tool {
    uint16_t holder; /* member id (control message `members`), 0 nobody                            */
    uint16_t flags;  /* PAL_WIRE_TOOL_* */
    uint32_t colour; /* 0xRRGGBB of the holder                                                     */
    float radius_m;
    float position_m[3];    /* as used by the step that made this cycle                                   */
    float quaternion[4];    /* w x y z                                                                    */
    float force_N[3];       /* of the tissue on the tool                                                  */
    uint32_t echo_seq;      /* newest pose of the holder that the shown step has used; 0 none             */
    uint32_t hold_us;       /* from that pose's arrival at the server to this message                     */
    uint64_t echo_stamp_us; /* that pose's stamp_us: now - echo_stamp_us at the holder = pose to frame  */
} pal_wire_tool;
/* TOOLS, server to client: closes cycle `cycle`, whose FRAME messages (those parts that changed) came before it */
typedef struct pal_wire_tools {
    uint32_t cycle;
    uint32_t n_tool;
    uint64_t sim_time_us;
    pal_wire_tool tool[PAL_WIRE_TOOL_MAX];
} pal_wire_tools;
size_t pal_wire_put_tools(uint8_t *dst, size_t cap, const pal_wire_tools *t);
int pal_wire_get_tools(const uint8_t *bytes, size_t n_byte, pal_wire_tools *out);

/* one tangent contact patch, contact_patch_t (lcmtypes/) */
typedef struct pal_wire_contact_patch {
    uint16_t id, group;
    float p_m[3]; /* point of the zero-force surface, relative to the model's origin */
    float n[3];   /* unit normal, out of the tissue; |n|^2 is 1 +- 1e-3           */
    float v_m_s[3];
    float k1_N_m, k2_N_m2, b_N_s_m, kt_N_m, mu_s, mu_d, radius_m; /* >= 0, k2 of any sign */
} pal_wire_contact_patch;
enum {
    PAL_WIRE_HAPTIC_FREEZE = 1,
    PAL_WIRE_HAPTIC_FORCE_OFF = 2,
    PAL_WIRE_HAPTIC_TOPOLOGY_CHANGED = 4,
    PAL_WIRE_HAPTIC_FLAGS = 7
};
/* HAPTIC, server to the holder of the tool: haptic_model_t (lcmtypes/) */
typedef struct pal_wire_haptic {
    uint16_t tool;
    uint32_t seq;
    uint32_t flags;         /* PAL_WIRE_HAPTIC_*                                   */
    uint64_t stamp_us;      /* server's monotonic clock                       */
    uint64_t echo_stamp_us; /* stamp_us and seq of the newest pose used       */
    uint32_t echo_seq;
    uint32_t hold_us;  /* from that pose's arrival to this message       */
    uint32_t frame_us; /* usual distance of two models                   */
    uint32_t n_patch;
    double origin_m[3];
    float f_ref_N[3];       /* force of the simulation on the tool, for display and checks; never rendered */
    float torque_ref_Nm[3]; /* the same about its centre */
    uint32_t has_grasp;     /* 1: grasp_* hold a bilateral spring */
    float grasp_x0_m[3], grasp_f0_N[3];
    float grasp_k_N_m[6]; /* xx xy xz yy yz zz                              */
    float grasp_b_N_s_m;
    float grasp_arm_m[3]; /* from the tool's centre to where its force acts, turned with the tool */
    pal_wire_contact_patch patch[PAL_WIRE_CONTACT_PATCH_MAX];
} pal_wire_haptic;
size_t pal_wire_put_haptic(uint8_t *dst, size_t cap, const pal_wire_haptic *h);
int pal_wire_get_haptic(const uint8_t *bytes, size_t n_byte, pal_wire_haptic *out);
#endif
