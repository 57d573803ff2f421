/* The text messages of palpate.v2: one JSON object each, `type` says which (protocol/README.md, "Control").
 *
 * pal_control_get reads untrusted text: size, nesting,
 * number of values, UTF-8 and every field are checked; unknown keys are ignored (so that the protocol can grow),
 * unknown types are refused. Strings are UTF-8, zero terminated, without control characters; pal_control_put
 * refuses what pal_control_get would refuse. Both directions exist in C for the clients. Thread: any. */
#ifndef PAL_PROTOCOL_CONTROL_H
#define PAL_PROTOCOL_CONTROL_H
#include "protocol/refusal.h"
#include "protocol/wire.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define PAL_CONTROL_IN_MAX     4096  /* bytes of a text message from a client */
#define PAL_CONTROL_OUT_MAX    65536 /* bytes of a text message from the server */
#define PAL_WIRE_NAME_BYTES    64
#define PAL_WIRE_TEXT_BYTES    256
#define PAL_WIRE_COMPONENT_MAX 64
#define PAL_WIRE_MEMBER_MAX    64
#define PAL_WIRE_MEMBER_NAME   32
#define PAL_WIRE_ORDER_MAX     16
#define PAL_WIRE_ARG_MAX       16
#define PAL_WIRE_IMAGE_MAX     8 /* images on a part */
#define PAL_WIRE_FIELDS_MAX    8 /* fields that a part may offer */
#define PAL_WIRE_FIELD_BYTES   24
#define PAL_WIRE_FIELDS_BYTES  96 /* of the names of all fields, with a space between two of them */
#define PAL_WIRE_LOOK_BYTES    16
#define PAL_WIRE_REASON_BYTES  128
#define PAL_WIRE_LABEL_BYTES   120
#define PAL_WIRE_METHOD_BYTES  32
#define PAL_WIRE_TICKET_BYTES  84
#define PAL_WIRE_MARK_MAX      64  /* marks of a recording */
#define PAL_WIRE_POINT_MAX     128 /* points of a study that are sent; a point's own index may be larger */
#define PAL_WIRE_NEIGHBOUR_MAX 8
#define PAL_WIRE_TOOL_ANY      (-1)
#define PAL_WIRE_TOOL_NONE     (-2)

/* X(NAME, "type in JSON", from server) */
#define PAL_CONTROL_TABLE(X)                                                                                           \
    X(HELLO, "hello", true)                /* first message of the server after join                          */       \
    X(TOPOLOGY, "topology", true)          /* parts changed: new epochs and assets                            */       \
    X(STATUS, "status", true)              /* 2-4 Hz                                                          */       \
    X(MEMBERS, "members", true)            /* after changes, at most 4 Hz: members, their tools and rights          */ \
    X(ORDERS, "orders", true)              /* after commands, at most 4 Hz: who gave which                        */   \
    X(ERROR, "error", true)                /* a request was refused, the connection stays                     */       \
    X(PONG, "pong", true)                  /* answer to ping                                                  */       \
    X(ANSWER, "answer", true)              /* result of a command: done, or the requested numbers             */       \
    X(STUDY, "study", true)                /* cost and error of other configurations; to subscribers of `estimate` */  \
    X(ESTIMATE, "estimate", true)          /* 2-4 Hz: cost and error of a body now; to the same                    */  \
    X(MOVE, "move", true)                  /* the session goes on at another address                          */       \
    X(JOIN, "join", false)                 /* first message of a client                                       */       \
    X(COMMAND, "command", false)           /* pause, resume, step, reset, material ...                        */       \
    X(TAKE_TOOL, "take_tool", false)       /* take a tool                                                     */       \
    X(RELEASE_TOOL, "release_tool", false) /* release the own tool                                            */       \
    X(PING, "ping", false)                 /* round trip                                                      */       \
    X(SUBSCRIBE_FIELD, "subscribe_field", false) /* subscribe to fields of a part, in place of the last ones */

typedef enum pal_control_type {
#define X(name, text, from_server) PAL_CONTROL_##name,
    PAL_CONTROL_TABLE(X)
#undef X
        PAL_CONTROL_COUNT
} pal_control_type;

typedef enum pal_wire_role {
    PAL_WIRE_ROLE_VIEWER,
    PAL_WIRE_ROLE_TRAINEE,
    PAL_WIRE_ROLE_INSTRUCTOR,
    PAL_WIRE_ROLE_COUNT
} pal_wire_role;
/* "viewer", "trainee", "instructor"; never NULL */
const char *pal_wire_role_name(pal_wire_role role);

typedef struct pal_wire_part_info {
    char name[PAL_WIRE_NAME_BYTES];
    uint32_t epoch;
    uint32_t n_vertex, n_triangle;
    char asset[PAL_WIRE_NAME_BYTES]; /* path on the same server: "/asset/<hash>"   */
    uint32_t n_image;                /* images on its surface (PNG, JPEG), whose asset has looks; 0: not on the wire */
    char image[PAL_WIRE_IMAGE_MAX][PAL_WIRE_NAME_BYTES]; /* paths as `asset` */
    double error_m;                                      /* bound per axis of its frames in normal use */
    uint32_t n_field; /* fields for `subscribe_field`; 0 also from servers without fields */
    char field[PAL_WIRE_FIELDS_MAX][PAL_WIRE_FIELD_BYTES]; /* "displacement", "von_mises" ...           */
    char interior[PAL_WIRE_NAME_BYTES]; /* path of the asset of its interior, as `asset`; "": it has none */
    bool is_sculptable; /* its control cells and material can be changed by commands; false is not on the wire */
    char control_cells[PAL_WIRE_NAME_BYTES]; /* of a sculptable part: path as `asset`; "" is not on the wire */
    bool is_adaptive; /* its triangles change; clients that accept TOPOLOGY_DELTA get the changes, and n_triangle
                         counts slots */
    char appearance[PAL_WIRE_LOOK_BYTES]; /* "liver", "plastic" ...; "": unknown, and not on the wire  */
    char colour[PAL_WIRE_LOOK_BYTES];     /* "#rrggbb" in place of the appearance's own; "": its own   */
} pal_wire_part_info;                     /* its index in the array is the part index   */
/* The components of a plan in order, of hello and topology: name, part whose body the component works on (-1: the whole
 * scene), reason (the key of the scene that calls for it), and whether it can be disabled (1: it cannot). n_part,
 * n_reason and n_required are n_component, or 0: unknown, and then not on the wire */
typedef struct pal_wire_plan {
    uint32_t n_component, n_part, n_reason, n_required;
    char component[PAL_WIRE_COMPONENT_MAX][PAL_WIRE_NAME_BYTES];
    double part[PAL_WIRE_COMPONENT_MAX];
    char reason[PAL_WIRE_COMPONENT_MAX][PAL_WIRE_REASON_BYTES];
    double required[PAL_WIRE_COMPONENT_MAX];
} pal_wire_plan;
typedef struct pal_wire_topology {
    uint32_t n_part;
    pal_wire_part_info part[PAL_WIRE_PART_MAX];
    pal_wire_plan plan; /* n_component 0: unchanged */
} pal_wire_topology;

typedef struct pal_wire_tool_info {
    char name[PAL_WIRE_NAME_BYTES]; /* e.g. "probe" */
    double radius_m;
    double force_cap_N;                   /* largest force that it exerts and feels; 0: unknown, and not on the wire */
    char instrument[PAL_WIRE_NAME_BYTES]; /* drawn for it: "grasper" ...; "": a ball, and not on the wire */
    uint32_t n_trocar;                    /* 3, or 0: none, and not on the wire */
    double trocar_m[3];                   /* the point that its shaft passes */
} pal_wire_tool_info;
/* what happened in a recording that the session plays */
typedef struct pal_wire_mark {
    double time_s;
    char text[32];
} pal_wire_mark;
typedef struct pal_wire_hello {
    uint32_t version; /* PAL_PROTOCOL_VERSION                                        */
    char session[PAL_WIRE_NAME_BYTES];
    char title[PAL_WIRE_TEXT_BYTES];    /* for people                                                  */
    char organ[PAL_WIRE_TEXT_BYTES];    /* which organ this is and where from: "liver, abdominal CT"   */
    char accuracy[PAL_WIRE_TEXT_BYTES]; /* error against a reference: "2.1 % RMS of finite elements"; "": unknown, and
                                           not on the wire */
    double step_rate_hz, frame_rate_hz;
    uint32_t credit;                   /* unacknowledged cycles the server allows now                 */
    double box_min_m[3], box_max_m[3]; /* of the whole scene at rest                            */
    double up[3];                      /* unit, away from the ground                            */
    char anatomical_axes[4];           /* where x, y and z point in the patient: "RAS"; "": not known, and not on the
                                          wire */
    uint32_t n_part, n_tool;
    pal_wire_part_info part[PAL_WIRE_PART_MAX];
    pal_wire_tool_info tool[PAL_WIRE_TOOL_MAX];
    pal_wire_plan plan;
    bool estimates;   /* `estimate` is available; false is not on the wire */
    bool relay;       /* a relay: who is there watches, and every command is refused; false is not on the wire */
    uint32_t started; /* Unix time at which the server began, s: another one after a reconnection is another run. 0:
                         unknown, and not on the wire */
    uint32_t n_mark;  /* 0: not on the wire */
    pal_wire_mark mark[PAL_WIRE_MARK_MAX];
    uint16_t you_id; /* member id, > 0                                              */
    pal_wire_role you_role;
    char you_name[PAL_WIRE_MEMBER_NAME];
    int you_tool; /* granted tool, or PAL_WIRE_TOOL_NONE                                */
} pal_wire_hello;

/* active nodes and springs of an adaptive part */
typedef struct pal_wire_active {
    uint32_t part;
    uint32_t n_node, n_spring;               /* now                                      */
    uint32_t n_finest_node, n_finest_spring; /* if every region had its finest level */
} pal_wire_active;

/* a tool whose device commands forces or has a gripper, as the server sees it */
typedef struct pal_wire_device {
    uint32_t tool;
    double force_error_N; /* rms over the last second of its force less the server's at the same pose; 0: no forces */
    double opening;       /* of its gripper, rad or m; 0 without */
} pal_wire_device;

/* a part that is frozen, asleep or was safeguarded; false, empty and 0 are not on the wire */
typedef struct pal_wire_part_state {
    uint32_t part;
    bool frozen;                        /* stopped after divergence; `reset` of its body restores it */
    bool asleep;                        /* at rest: its components do not run                                     */
    char reason[PAL_WIRE_REASON_BYTES]; /* why it is frozen, one sentence                                  */
    uint64_t n_safeguard;               /* steps in which a safeguard acted, total         */
    double safeguard_ms;                /* time of those safeguards, total                                           */
} pal_wire_part_state;
/* energy of a part, sent while the client asks for it (`energy` of subscribe_field) */
typedef struct pal_wire_energy {
    uint32_t part;
    double time_s;               /* simulated time at which both were taken */
    double kinetic_J, elastic_J; /* elastic: integral of the strain energy density */
} pal_wire_energy;
/* a disabled component that can be enabled */
typedef struct pal_wire_disabled {
    char component[PAL_WIRE_NAME_BYTES];
    uint32_t part;
} pal_wire_disabled;

/* the recording of a session */
typedef struct pal_wire_playback {
    bool plays;    /* it plays, or is paused; else the session went on live from time_s */
    double time_s; /* where */
    double length_s;
    double speed; /* wanted: 1 is real time */
    bool ended;   /* at its end; false is not on the wire */
} pal_wire_playback;

typedef struct pal_wire_status {
    uint64_t tick; /* steps done                                                     */
    double sim_time_s;
    bool paused, frozen; /* frozen: a body diverged, `reset` brings it back                */
    double step_rate_hz; /* measured, wall clock                                           */
    double slowdown;     /* wall time / simulated time while running; 1 = real time        */
    uint32_t substeps;
    double step_ms; /* mean time of one step                                          */
    uint32_t n_component;
    double component_ms[PAL_WIRE_COMPONENT_MAX]; /* mean time of each component in one step           */
    uint32_t n_component_name;                   /* 0: the components are those of hello                          */
    char component[PAL_WIRE_COMPONENT_MAX][PAL_WIRE_NAME_BYTES]; /* the current plan         */
    uint32_t n_member;                                           /* who may hold tools or give orders */
    uint32_t n_viewer;                                           /* who only watch; 0: not on the wire */
    double bytes_s;                 /* sent by the server to this member, bytes per second            */
    double rtt_ms;                  /* of this member as the server sees it; 0 unknown                */
    uint32_t n_skipped;             /* cycles not sent to this member because it had no credit, total */
    uint64_t n_late;                /* steps that began late                                          */
    uint64_t n_refused;             /* poses and commands refused by the session                      */
    char diag[PAL_WIRE_TEXT_BYTES]; /* one sentence for people, or ""                           */
    uint32_t n_active;              /* parts that adapt; 0: not on the wire                     */
    pal_wire_active active[PAL_WIRE_PART_MAX];
    uint32_t n_component_part; /* with n_component_name                                           */
    double component_part[PAL_WIRE_COMPONENT_MAX];
    uint32_t n_state; /* parts that are frozen, asleep or were safeguarded           */
    pal_wire_part_state state[PAL_WIRE_PART_MAX];
    uint32_t n_disabled;
    pal_wire_disabled disabled[PAL_WIRE_COMPONENT_MAX];
    uint64_t n_unobserved; /* steps without observers     */
    uint32_t n_device;     /* 0: not on the wire          */
    pal_wire_device device[PAL_WIRE_TOOL_MAX];
    uint32_t n_energy; /* 0: not on the wire          */
    pal_wire_energy energy[PAL_WIRE_PART_MAX];
    uint32_t n_playback; /* 0: the session has no recording, and not on the wire */
    pal_wire_playback playback[1];
} pal_wire_status;

typedef struct pal_wire_member {
    uint16_t id;
    pal_wire_role role;
    int tool;        /* PAL_WIRE_TOOL_NONE when it holds none */
    uint32_t colour; /* 0xRRGGBB                         */
    char name[PAL_WIRE_MEMBER_NAME];
    char
        rights[PAL_WIRE_NAME_BYTES]; /* of a trainee, from instructors: "steer sculpt"; "": none, and not on the wire */
    bool muted;                      /* may do nothing but watch; false is not on the wire */
} pal_wire_member;
typedef struct pal_wire_members {
    uint32_t n_member;
    pal_wire_member member[PAL_WIRE_MEMBER_MAX];
    uint32_t n_locked;                     /* 0: not on the wire */
    double locked_tool[PAL_WIRE_TOOL_MAX]; /* tools that only instructors may take */
    bool locked;                           /* nobody but instructors may join; false is not on the wire */
} pal_wire_members;

/* a command that was carried out, and who gave it */
typedef struct pal_wire_order {
    uint16_t id; /* of the member */
    char name[PAL_WIRE_MEMBER_NAME];
    char verb[32];
    char target[PAL_WIRE_NAME_BYTES];
    char text[PAL_WIRE_LABEL_BYTES]; /* its numbers: "young_Pa 4500" */
    double age_s;                    /* since then */
} pal_wire_order;
typedef struct pal_wire_orders {
    uint32_t n_order;
    pal_wire_order order[PAL_WIRE_ORDER_MAX]; /* oldest first; the newest of them, if there were more */
} pal_wire_orders;

typedef struct pal_wire_error {
    char code[PAL_WIRE_NAME_BYTES]; /* one word: "role", "tool_taken", "budget", "verb" ... */
    char text[PAL_WIRE_TEXT_BYTES]; /* one sentence for people                              */
} pal_wire_error;

/* where the session goes on: the client goes there when its connection ends (protocol/README.md, "Moving") */
typedef struct pal_wire_move {
    char address[PAL_WIRE_TEXT_BYTES]; /* "https://host:port/", as a browser opens it */
    char session[PAL_WIRE_NAME_BYTES];
    char ticket[PAL_WIRE_TICKET_BYTES]; /* in place of the client's own, which has expired or will; "": its own, and not
                                           on the wire */
} pal_wire_move;

typedef struct pal_wire_join {
    char name[PAL_WIRE_MEMBER_NAME];
    pal_wire_role role;
    int tool;             /* wanted: index, PAL_WIRE_TOOL_ANY or PAL_WIRE_TOOL_NONE   */
    bool topology_deltas; /* accepts TOPOLOGY_DELTA; else adaptive parts keep the triangles of their asset; false is not
                             on the wire */
    bool moves;           /* goes where a `move` sends it; false is not on the wire */
} pal_wire_join;

typedef struct pal_wire_arg {
    char key[32];
    double value;
} pal_wire_arg;
typedef struct pal_wire_command {     /* a command to the session */
    char verb[32];                    /* pause resume step reset material ...                     */
    char target[PAL_WIRE_NAME_BYTES]; /* a body or a component, or ""                 */
    uint32_t n_arg;
    pal_wire_arg arg[PAL_WIRE_ARG_MAX]; /* numbers by name, SI, e.g. young_Pa                       */
} pal_wire_command;

/* to the sender of a command: its result in a sentence, and numbers (protocol/README.md, "Sculpting") */
typedef struct pal_wire_answer {
    char verb[32];
    char text[PAL_WIRE_TEXT_BYTES];
    uint32_t n_arg;
    pal_wire_arg arg[PAL_WIRE_ARG_MAX];
} pal_wire_answer;

/* one configuration of a study, its cost and error (protocol/README.md, "Accuracy") */
typedef struct pal_wire_study_point {
    uint32_t index;                     /* in the study: argument of the command `study_point`        */
    char method[PAL_WIRE_METHOD_BYTES]; /* points of one method form a curve                 */
    char label[PAL_WIRE_LABEL_BYTES];   /* for people                                           */
    double cost_ms, error_m;            /* of a step, as the study measured it; largest error    */
    bool pareto_optimal;                /* no other point is both cheaper and more accurate              */
    double force_percent; /* RMS error of the force of a press over 50 ms of round trip; NaN: not measured */
} pal_wire_study_point;
typedef struct pal_wire_study {
    char body[PAL_WIRE_NAME_BYTES];
    double step_ms;     /* step of the scene as opened: reference of all costs of study and estimate */
    double reference_m; /* error of the reference of the study; smaller differences are not significant; NaN: unknown */
    uint32_t n_point;   /* 0: no study, estimates alone */
    pal_wire_study_point point[PAL_WIRE_POINT_MAX];
} pal_wire_study;

/* prediction for the configuration with one parameter changed; NaN: unknown, and not on the wire */
typedef struct pal_wire_neighbour {
    char parameter[PAL_WIRE_METHOD_BYTES]; /* "resolution", "step", "tolerance", "method"                      */
    char label[PAL_WIRE_LABEL_BYTES];
    double cost_ms, error_m;
    uint32_t size; /* arguments of the command `configure`; 0: unchanged, and not on the wire */
    double step_ms, tolerance;
} pal_wire_neighbour;
/* estimate of a body; NaN: unknown, and not on the wire */
typedef struct pal_wire_estimate {
    char body[PAL_WIRE_NAME_BYTES];
    char configuration[PAL_WIRE_LABEL_BYTES]; /* the current one, for people                           */
    double study_point;                       /* its index in the study; NaN: none      */
    uint64_t tick;                            /* of the estimated state; 0: none yet */
    double time_s;
    double age_s;              /* simulated time awake since that state                     */
    double cost_ms;            /* of a live step, median of the last second                              */
    double estimate_ms;        /* processor time that the estimate took                                  */
    double max_displacement_m; /* largest displacement then                                              */
    double error_m;            /* largest error of a displacement, of these parts together:              */
    double discretisation_m, algebraic_m, time_m, model_m;
    double force_percent;           /* error of the force of tools; NaN: none presses          */
    double energy_error_percent;    /* error over solution, in energy                          */
    bool locking;                   /* the estimate is known to be too small                   */
    char diag[PAL_WIRE_TEXT_BYTES]; /* what is not known and why, or ""                        */
    uint32_t n_neighbour;
    pal_wire_neighbour neighbour[PAL_WIRE_NEIGHBOUR_MAX];
} pal_wire_estimate;

typedef struct pal_wire_field_subscription {
    uint32_t part;
    char field[PAL_WIRE_FIELDS_BYTES]; /* as in the part's list, several with a space between, or "none" */
    bool interior;                     /* INTERIOR messages too; where the part has none, there are none */
    bool energy; /* energies of the part in `status`; where its model knows none, there are none */
} pal_wire_field_subscription;

typedef struct pal_control {
    pal_control_type type;
    union {
        pal_wire_hello hello;
        pal_wire_topology topology;
        pal_wire_status status;
        pal_wire_members members;
        pal_wire_orders orders;
        pal_wire_error error; /* error             */
        pal_wire_move move;
        pal_wire_join join;
        pal_wire_command command; /* command               */
        int tool;                 /* take: index or PAL_WIRE_TOOL_ANY; leave: unused */
        double stamp_ms;          /* ping, pong: the pinger's own clock         */
        pal_wire_field_subscription field_subscription;
        pal_wire_answer answer;
        pal_wire_study study;
        pal_wire_estimate estimate;
    };
} pal_control;

/* JSON type of a control message, NULL when unknown */
const char *pal_control_name(pal_control_type type);

/* One message as compact JSON, zero terminated, *n_byte without the zero. SPACE: does not fit cap or the
 * limit of its direction; RANGE: a count above its maximum; NAN: a number is not finite. */
int pal_control_put(char *dst, size_t cap, const pal_control *c, size_t *n_byte);

/* Reads one text message. from_server: which direction is expected here; a type of the other direction is refused with
 * KIND. LONG above the limit of that direction. *out is about 30 KiB and is overwritten only on success. */
int pal_control_get(const char *text, size_t n_byte, bool from_server, pal_control *out);
#endif
