/* A frame: what one step shows of all bodies (a FRAME of protocol/frame_codec.h is one body of it), copied for another
 * thread as float metres in the scene frame. Allocated once (pal_frame_create) for the world's sizes; filling it makes
 * no heap call. pal_frame_fit allocates and frees the arrays of fields, so pointers to them are valid until then. */
#ifndef PAL_SIM_WORLD_FRAME_H
#define PAL_SIM_WORLD_FRAME_H
#include "server/sim/core/body.h"
#include "server/sim/core/definition.h"
#include "server/sim/core/tools.h"

typedef struct pal_world pal_world;

enum { PAL_FRAME_COMPONENT_MAX = 64 };

/* a field in colour; value NULL: not shown */
typedef struct pal_frame_field {
    float *value;      /* SI [n_vertex]                                      */
    float *node;       /* displacement x y z, m, and value of each node then; NULL: no interior [n_node][4] */
    uint64_t revision; /* unique to every set of values, never reused */
    double time_s;     /* simulated time of the values */
} pal_frame_field;

typedef struct pal_frame_part {
    int n_vertex, n_node; /* n_node 0: no interior (shown_surface.h) */
    float *position_m;    /* [n_vertex][3] */
    uint64_t revision;    /* of the topology these positions belong to */
    bool frozen;
    char reason[PAL_REASON_TEXT]; /* one sentence while frozen, else empty */
    pal_safeguards safeguards;    /* since the body's reset: interventions that kept it within its bounds */
    bool asleep;                  /* at rest: its components do not run until something comes near (component sleep) */
    uint64_t n_output;            /* OUTPUT runs of the body so far; unchanged: nothing here was recomputed */
    pal_frame_field field[PAL_FIELD_COUNT]; /* by pal_field */
    double kinetic_J, elastic_J;            /* with the field energy, at its time_s */
    /* Adaptive bodies (adaptive_surface.h): the table of drawn triangles at this revision, 0 0 0 in empty slots.
     * Vertices of no triangle are hidden and their positions are undefined. n_slot 0: the triangles never change */
    int n_slot;
    int32_t *slot;                 /* [n_slot][3]                                      */
    uint64_t slot_log;             /* changes applied so far, of pal_adaptive_surface.n_log */
    int n_active, n_spring;        /* present nodes and springs */
    int n_finest, n_finest_spring; /* the same if the whole body were at its finest level */
    /* Bodies whose nodes are interpolated from control points (body.interpolation): the control points in the body
     * frame, for sculpting */
    int n_point;     /* 0: no control points */
    double *point_m; /* [n_point][3]    */
} pal_frame_part;

typedef struct pal_frame_tool {
    bool present, touching, holding;
    pal_pose pose;         /* latest pose used, with its seq and stamp */
    uint64_t pose_ns;      /* of the session's clock, when that pose arrived */
    double force_N[3];     /* on the tool, mean over the step                */
    double end_force_N[3]; /* at its end, where the tool is at its pose  */
    double torque_Nm[3];   /* about its centre, at the step's end           */
    double radius_m;
    int n_patch;
    pal_contact_patch patch[PAL_CONTACT_PATCH_MAX];
    bool has_grasp;
    double grasp_x0_m[3], grasp_f0_N[3], grasp_k_N_m[6], grasp_b_Ns_m, grasp_arm_m[3];
} pal_frame_tool;

typedef struct pal_frame {
    uint64_t tick;    /* steps since create or reset; equal ticks may differ in tools or status */
    double time_s;    /* simulated                                                              */
    uint64_t end_ns;  /* of the session's clock, at the end of the step */
    uint64_t step_ns; /* processor time of the step (pal_world_step_ns) */
    int n_substep;
    bool watched; /* positions are of this tick; false: there are no observers, and positions may be older */
    /* filled by the session */
    bool paused, plays; /* plays: a recording, whose tools these are */
    double slowdown;    /* real over simulated time, 1: real time (mean over the last second) */
    double load;        /* processor time of the steps over simulated time, likewise; 0: not known yet */
    uint64_t n_late;    /* steps that started late */
    uint64_t n_refused; /* poses and commands refused                                              */
    int n_part;
    pal_frame_part part[PAL_BODY_MAX];
    int n_tool;
    pal_frame_tool tool[PAL_TOOL_MAX];
    int n_row;
    uint32_t component_ns[PAL_FRAME_COMPONENT_MAX]; /* of the last step, in the plan's order           */
    const char
        *component_name[PAL_FRAME_COMPONENT_MAX]; /* constant strings; more than at load while fields are shown */
    int component_body[PAL_FRAME_COMPONENT_MAX];  /* body of each component */
} pal_frame;

pal_frame *pal_frame_create(const pal_world *world); /* [load] NULL: out of memory */
/* Allocates or frees the arrays of fields to match the world's bodies; calls the heap only if that has changed.
 * MEMORY: the field is omitted. Call between steps, on the thread that fills the frame */
pal_err pal_frame_fit(pal_frame *frame, const pal_world *world);
void pal_frame_destroy(pal_frame *frame);
#endif
