/* The component tool_push of one body: its state, that of each tool, and the regime of contact, which the solver
 * determines at load (effects/tool_push.c):
 *     explicit       contact forces at every sub-step                                push_explicit.c
 *     held load      the solver holds loads over a sub-step (rk4, adaptive bodies)   push_explicit.c
 *     interpolated   nodes are interpolated from dofs (central_cg)                   push_explicit.c
 *     implicit       the solver takes contact springs implicitly                     push_implicit.c
 * Memory: the component's arena, but for what a transfer leaves (tool_contact.h). Thread: [sim]. */
#ifndef PAL_SIM_CONTACT_PUSH_H
#define PAL_SIM_CONTACT_PUSH_H
#include "server/sim/contact/tool_contact.h"

typedef struct pal_push pal_push;

typedef struct pal_push_regime {
    /* stiffness per area at a contact point */
    double (*pressure_Pa_m)(const pal_push *push, const pal_body *body, int point, double radius_m);
    /* moves the proxy's target here_m (body frame) out of the tissue; NULL: the target is the tool */
    void (*hold_back)(pal_tool_contact *t, double here_m[3]);
    /* forces of all tools in this sub-step, their contacts found */
    void (*act)(pal_push *push, int n_tool, pal_step *step);
    /* pal_tangent.settle; NULL: the forces are those of act */
    bool (*settle)(pal_push *push, pal_step *step, const double *moved, bool last);

    /* explicit regimes: largest contact stiffness over mass times dt^2, damping time over dt, a bound of the
     * eigenvalues of M^-1 K of contact, 1/s^2; after other triangles were drawn the force does not rise */
    double stiffness_limit, damping_steps;
    double pressure; /* pal_push_pressure_of_radius: stiffness per area in E over radius */
    double (*eigenvalue_1_s2)(pal_contact_points *points, const pal_body *body, const double *mass_kg,
                              const pal_contact *contact, int n);
    bool limits_rise;
} pal_push_regime;

extern const pal_push_regime pal_push_explicit, pal_push_held_load, pal_push_interpolated, pal_push_implicit;

struct pal_push {
    const pal_push_regime *regime;
    pal_contact_points points;
    int n_tool, body_index;
    pal_tool_contact tool[PAL_TOOL_MAX];
    double asked_Pa_m, friction, clamp_S, asked_near_m, slip_S, slip_s; /* keys */
    pal_material material;        /* the body's, Poisson's ratio at most PAL_POISSON_CLAMP                */
    float *point_Pa;              /* pal_contact_points_young                                             */
    pal_contact_springs *springs; /* implicit only                                                        */
    double *row_sum_N_m;          /* explicit only, 0 between uses [body n_node]                          */
    int n_stiffness, n_step;      /* stiffnesses found in this step; steps, to give each tool its turn    */
};

/* the regime's multiple of E / radius, or what the scene says */
double pal_push_pressure_of_radius(const pal_push *push, const pal_body *body, int point, double radius_m);
/* a multiple of the tissue's own stiffness under a contact half a radius wide, or what the scene says */
double pal_push_pressure_of_tissue(const pal_push *push, const pal_body *body, int point, double radius_m);
/* stiffness of a flat punch of this radius, 2 E a / (1 - nu^2), N/m */
double pal_push_punch_N_m(const pal_push *push, double radius_m);
/* m from a tool's surface within which patches are published */
double pal_push_near_m(const pal_push *push, double radius_m);
/* velocity of the tool's surface where it touches, at -radius normal, as it moves and turns */
void pal_push_surface_velocity(const pal_tool_contact *t, const pal_tool *tool, double velocity_m_s[3]);
/* the side that the tool is on follows its force with a time constant, from where it was */
void pal_push_follow_side(pal_tool_contact *t, const double side_before[3], double dt_s);

/* interpolated: the stiffness that the points near a tool will want, as pal_effect.bounds.wanted */
void pal_push_want(pal_push *push, const pal_body *body, double *bound_N_m);
/* explicit: memory beside */
pal_err pal_push_make_explicit(pal_push *push, pal_build *build);
/* implicit: memory beside */
pal_err pal_push_make_implicit(pal_push *push, pal_build *build);

/* torque of the contacts' forces, in the last sub-step: they act on the tool's surface, at (radius - depth) away; a
 * force toward the centre has none, friction has */
void pal_push_add_torque(pal_tool_contact *t, pal_tool *tool);
/* the patches of a tool for a haptic bridge, in the last sub-step */
void pal_push_publish(pal_push *push, pal_tool_contact *t, pal_tool *tool, pal_step *step);
#endif
