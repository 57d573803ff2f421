/* What the component refine decides on: external force, speed and change of curvature at the active nodes of an
 * adaptive surface, and what a change of level conserves (paper C, criterion for refinement and simplification).
 * Thread: [sim], make [load]; no heap in [sim]. */
#ifndef PAL_SIM_SURFACE_REFINE_MEASURE_H
#define PAL_SIM_SURFACE_REFINE_MEASURE_H
#include "server/sim/core/effect.h"
#include "server/sim/surface/adaptive_surface.h"

/* thresholds at a node of level 0; 0: the criterion is off. A node asks for finer faces beyond a threshold, and is
 * quiet below half of the threshold on the next coarser level */
typedef struct pal_refine_limits {
    double force_N; /* external force; force_N m/m_0 at a node of mass m, so that nodes that share a load after a split
                     * stay on the same side of the threshold */
    double speed_m_s;     /* relative to the body's best-fit rigid motion; the same on all levels               */
    double curvature_1_m; /* change from rest of the mean over a node's springs of 2 n.d/d.d, n the normal of its
                           * triangles, d the vector along the spring: the mean normal curvature, 1/radius.
                           * curvature_1_m sqrt(m_0/m) at a node of mass m, in proportion to 1/edge: the angle between
                           * the normals of neighbouring nodes decides */
} pal_refine_limits;

/* a node with a number that is not finite is BETWEEN: it is neither refined nor coarsened */
typedef enum pal_refine_mark {
    PAL_REFINE_QUIET,    /* of every criterion */
    PAL_REFINE_BETWEEN,  /* neither            */
    PAL_REFINE_REQUESTED /* beyond a threshold */
} pal_refine_mark;

typedef struct pal_refine_measure {
    double *sum;            /* of a node: normals of triangles 3, d/d.d of springs 3, springs, free [n_vertex][8] */
    double *rest_curvature; /* 1/m, at the present nodes                                            [n_vertex]    */
    uint8_t *mark;          /* pal_refine_mark of the nodes of the last call                        [n_vertex]    */
    pal_rigid_fit frame;
    uint64_t revision; /* of the surface for which rest_curvature holds */
    bool known;
} pal_refine_measure;

/* MEMORY */
pal_err pal_refine_measure_make(pal_refine_measure *measure, const pal_adaptive_surface *adaptive, pal_arena *arena);
/* marks every active node; about 60 ns a node with all criteria on */
void pal_refine_mark_nodes(pal_refine_measure *measure, const pal_adaptive_surface *adaptive, const pal_body *body,
                           const pal_refine_limits *limits);
/* curvature at the nodes for positions x [n_vertex][3], 1/m; NaN where the triangles have no area. out is
 * [n_vertex], written at nodes only, and may be measure->rest_curvature */
void pal_refine_curvature(pal_refine_measure *measure, const pal_adaptive_surface *adaptive, const double *x,
                          double *out);

/* conserved quantities before or after a change of level */
typedef struct pal_refine_balance {
    double mass_kg;
    double momentum_kg_m_s[3],
        angular_momentum_kg_m2_s[3];     /* of the free nodes; angular momentum about the body frame's origin */
    double kinetic_J, spring_J, shape_J; /* springs and anchors with their ramps                              */
    double other_J;                      /* FORCE components other than edge_spring and shape_spring          */
} pal_refine_balance;
static inline double pal_refine_balance_total_J(const pal_refine_balance *s)
{
    return s->kinetic_J + s->spring_J + s->shape_J + s->other_J;
}
/* of the body's present state */
void pal_refine_balance_compute(pal_refine_balance *side, const pal_step *step);

/* all changes of one evaluation are one change of level */
typedef struct pal_refine_history {
    uint64_t n_switch;                     /* since reset                                   */
    uint64_t n_split, n_join;              /* faces, since reset                          */
    double time_s;                         /* of the last change, simulated since reset     */
    pal_refine_balance before, raw, after; /* raw: before corrections */
} pal_refine_history;
/* history of a component refine (pal_component.self); valid as long as it exists */
const pal_refine_history *pal_refine_report(const void *self);
#endif
