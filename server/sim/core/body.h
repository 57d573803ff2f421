/* The moving arrays of one body. All memory is the world's arena; rows borrow pointers into it. Thread: [sim]. */
#ifndef PAL_SIM_CORE_BODY_H
#define PAL_SIM_CORE_BODY_H
#include "server/base/arena.h"
#include "server/mesh/geometry/surface.h"
#include "server/mesh/geometry/tets.h"
#include "server/mesh/volume/hexes.h"
#include "server/mesh/volume/skin.h"
#include "server/num/interpolation.h"
#include "server/sim/core/dofs.h"
#include "server/sim/core/safeguards.h"
#include "server/sim/core/simd_blocks.h"
#include "server/sim/core/tuning.h"

/* The body's static answer to a load at its present shape, as far as the solver's factor knows it (haptics.md 2.3).
 * Published by an implicit solver that holds a static factor; rows stay apart, the body carries the door. */
struct pal_body;
typedef struct pal_compliance {
    void *self;
    /* displacement [n_node][3] that the forces [n_node][3] (N, 0 at most nodes) would cause once all is at rest again;
     * false: not known (no supports, no factor). No heap; see sim/compliance.h for its cost. [sim] */
    bool (*solve)(void *self, const struct pal_body *body, const double *force_N, double *move_m);
} pal_compliance;

/* what can be shown in colour, computed only while somebody looks (row field_output) */
typedef enum pal_field {
    PAL_FIELD_NONE,
    PAL_FIELD_DISPLACEMENT_M,
    PAL_FIELD_VON_MISES_PA,
    PAL_FIELD_ENERGY_J_M3,
    PAL_FIELD_STIFFNESS_J, /* constant k_d of the edges around, paper B fig. 13 f */
    PAL_FIELD_STRAIN,      /* largest principal stretch less 1 (paper A fig. 13)  */
    PAL_FIELD_DISTORTION,  /* volume now over volume at rest, less 1              */
    PAL_FIELD_COUNT
} pal_field;
const char *pal_field_name(pal_field field);  /* "displacement", "von_mises", "energy", "stiffness", "strain",
                                                 "distortion", "none"; never NULL [any] */
pal_field pal_field_find(const char *name);   /* NONE: there is no field of that name [any] */
const char *pal_field_title(pal_field field); /* for sentences: "von Mises stress" [any] */

/* a field as it is shown: written by its row, there while the row is */
typedef struct pal_shown_field {
    float *value;      /* SI, at shown vertices                   [n_shown] */
    uint64_t revision; /* another number for every set of values, never twice */
    double time_s;     /* simulated, when they were taken                     */
} pal_shown_field;

typedef struct pal_body {
    const char *name;
    int n_dof;              /* points the solver moves: control points (A) or mass nodes             */
    int n_node;             /* points forces act on; equals n_dof when embed is NULL                 */
    double *x, *v;          /* dof position m (relative to origin_m), velocity m/s     [n_dof][3]    */
    double *d, *dv;         /* node position, velocity; alias x, v without embed       [n_node][3]   */
    double *load;           /* loads of CONTACT rows and of `outer`, N, constant in a sub-step [n_node][3] */
    double *external_force; /* lasting loads set by pal_world_load, N; NULL: none      [n_node][3]   */
    double *f;              /* node force N                                            [n_node][3]   */
    double *g;              /* f pulled back to dofs N; aliases f without embed        [n_dof][3]    */
    double *mass_kg;        /* lumped                                                  [n_dof]       */
    /* nodes as weighted sums of the points the solver moves, d = embed x (A eq. 1); NULL: they are the same. With it,
     * load, outer, f, d, dv are of nodes and x, v, g, mass_kg, held, x_rest of points */
    const pal_interpolation *interpolation;
    /* masses between points (num/mass_operator.h), which mass_kg sums up row by row; set by the model, NULL: mass_kg is
     * all */
    struct pal_mass_operator *mass_operator;
    double *node_mass_kg; /* lumped at nodes; aliases mass_kg without embed      [n_node]      */
    /* m/s that a shown node gets from an impulse of 1 Ns on it alone, 1/kg, which bounds explicit contact; NULL without
     * embed, where it is 1 / mass [n_node] */
    double *node_inverse_mass_1_kg;
    double *node_rest; /* rest position of nodes; aliases x_rest without embed [n_node][3]  */
    uint8_t *fixed;    /* 1: fixed in place; 2: led, its v comes from a row       [n_dof]       */
    double *x_rest;    /* rest position m                                         [n_dof][3]    */
    /* points in use: those of `active`, or all n_node when it is NULL. A body that adapts (adaptive_surface.h) has
     * arrays for its finest level; points out of use stand at x_rest with v, f, load and mass 0, so that a loop over
     * all is right and one over the active ones is fast: for (k < n_active) i = pal_body_point(body, k) */
    const int32_t *active; /* [n_active] */
    int n_active;
    struct pal_active_nodes *pack; /* working arrays of rows and solver (active_nodes.h); NULL: none made */
    pal_dofs dofs;                 /* what else differs from model to model */
    /* state of the model, for its own room and components; everybody else reads dofs. NULL: another model */
    struct {
        struct pal_adaptive_surface *adaptive;
        struct pal_subdivision_solid *solid; /* heap, freed by dofs.destroy */
    } model;
    bool frozen;               /* set by finite_guard or the solver (pal_body_stop): it no longer moves  */
    bool asleep;               /* set by row sleep: at rest, so none of its rows is run until something comes near */
    bool stale;                /* x has changed since its OUTPUT rows were run                                     */
    uint64_t n_output;         /* times its OUTPUT rows were run since load: `shown` changed no more often        */
    double length_scale_m;     /* box diagonal at rest, S of numerics.md part 3                         */
    double edge_m;             /* typical element edge                                                  */
    double offset_m[3];        /* position in the scene frame = x + offset_m (scene frame: first body's mesh frame) */
    double dt_limit_s;         /* largest stable sub-step, from the SOLVE row; infinite when unconditional */
    double load_cap_N;         /* most load on one node, 10 E h^2 (numerics.md part 3); larger ones are shortened */
    double spring_young_Pa;    /* E that springs stand for whose edges have constants of their own; 0: the material's */
    pal_safeguards safeguards; /* since reset: what kept it within its bounds, and what that took         */
    char reason[PAL_REASON_TEXT]; /* one sentence while frozen, else empty                                   */
    /* extra drag, and for how long yet, after a change that puts work in (stiffening_damper.h); 0: none */
    double stiffening_damping_1_s, stiffening_damping_s;
    /* what a corner of a full voxel, or of a solid's mean cell, weighs (pal_body_node_load_cap_N); 0: of another body
     */
    double full_corner_kg;

    bool implicit; /* the solver takes stiffness implicitly: contact need not be soft enough for explicit steps */
    bool wants_compliance; /* a CONTACT row asks for it: set in its make; the SOLVE row is made after all others */
    const pal_compliance *compliance; /* NULL: none */
    /* the elements of model fem, for evaluation through shape functions; NULL: none. Corners as in
     * num/shape_functions.h, tet10 with its middle nodes [n_element][n_corner] */
    const int32_t *element;
    int n_element, n_corner;
    const float *fill; /* share of material in each element, or tetrahedron where element is NULL; NULL: 1 */

    /* geometry at rest, borrowed from the scene's prepared mesh by the model; NULL when the model has none */
    const pal_tets *tets;       /* its nodes are the body's first ones */
    const pal_hexes *hexes;     /* the same nodes as cubes; NULL: none */
    pal_node_order *node_order; /* memory order of the nodes for kernels; NULL: none made       */
    /* what springs run on where they are turned over (spring_recovery.h); NULL: they never untangle */
    struct pal_spring_recovery *recovery;
    const pal_surface *surface; /* shown surface at rest                                       */
    const pal_skin *skin;       /* surface on nodes; NULL: shown vertices are the surface nodes */
    /* what is shown: all of these are set by the OUTPUT row's make; none: n_shown 0 */
    double *skin_axes; /* current frames of skin, kept between calls  [n_frame][9]    */
    int n_shown;       /* shown vertices                                              */
    float *shown;      /* written by the OUTPUT row, m, body frame    [n_shown][3]    */
    /* while a switch is let in (blend_component.h): how far the surface that was shown before lies from where the
     * OUTPUT rows put it. display_offset_part of it is added to what they write and to every point that tools touch, so
     * that what is felt is what is seen; NULL: no switch is let in */
    const float *display_offset_m;                 /* m, body frame [n_shown][3] */
    double display_offset_part;                    /* 1 when it takes over, falls to 0 */
    const int32_t *shown_face;                     /* of solids: control face of each shown triangle, -1: an inner one
                                                    * of a cut; NULL: another body              [surface->n_tri] */
    const int32_t *shown_node;                     /* node of each shown vertex when skin is NULL [n_shown]       */
    uint64_t revision;                             /* grows whenever the shown topology changes                   */
    const pal_shown_field *field[PAL_FIELD_COUNT]; /* NULL: nobody looks                               */
    uint64_t field_revision;                       /* sets of values taken so far, of all fields       */
} pal_body;

static inline int pal_body_point(const pal_body *body, int k)
{
    return body->active ? body->active[k] : k;
}

/* nodes in use, as points: for (k < pal_body_nodes(body)) i = pal_body_point(body, k) */
static inline int pal_body_nodes(const pal_body *body)
{
    return body->interpolation ? body->n_node : body->n_active;
}
/* load_cap_N of a body of this material: by what its edges are, where their constants are given */
static inline double pal_body_load_cap_N(const pal_body *body, double young_Pa)
{
    return PAL_LOAD_CAP_FACTOR * (body->spring_young_Pa > 0 ? body->spring_young_Pa : young_Pa) * body->edge_m *
           body->edge_m;
}
/* most of a lasting load that a node bears (less of it beyond 2 S from its rest place, world_load.c): load_cap_N, and
 * of that the part that the node is of the corner of a full voxel, or of a solid's mean cell, as a sliver is as much
 * softer */
static inline double pal_body_node_load_cap_N(const pal_body *body, int node)
{
    double part = body->full_corner_kg > 0 ? body->node_mass_kg[node] / body->full_corner_kg : 1;
    return part < 1 ? part * body->load_cap_N : body->load_cap_N;
}
/* how easily a node moves, 1/kg; 0: it is held */
static inline double pal_body_inverse_mass_1_kg(const pal_body *body, int node)
{
    if (body->node_inverse_mass_1_kg) return body->node_inverse_mass_1_kg[node];
    return body->fixed[node] ? 0 : 1 / body->mass_kg[node];
}

/* arrays for n points without embed, all active, zeroed, f = g, d = x, dv = v; MEMORY. [load] */
pal_err pal_body_allocate(pal_body *body, pal_arena *arena, int n_node);
/* the same for n_dof points that carry rows->n_row nodes: d, dv, g, node masses and rest of their own; embed = rows,
 * which is borrowed. active stays NULL, n_active n_dof; MEMORY. [load] */
pal_err pal_body_allocate_embedded(pal_body *body, pal_arena *arena, const pal_interpolation *rows);
/* d = embed x and dv = embed v, after x and v were set; nothing without embed. [sim] */
void pal_body_update_nodes(pal_body *body);
/* after the OUTPUT rows: what is shown as it lags (display_offset_m); nothing without it. [sim] */
void pal_body_add_display_offset(pal_body *body);
/* sums over the body [sim] */
double pal_body_kinetic_J(const pal_body *body);
void pal_body_momentum(const pal_body *body, double momentum_kg_m_s[3]);
bool pal_body_finite(const pal_body *body);
/* The body is frozen and body->why says so in one sentence; one that is frozen keeps its first reason. point: of the
 * points the solver moves; -1: none to name. The sentence names the smallest element around it and its place at rest
 * (scene frame, mm). No heap */
void pal_body_stop(pal_body *body, int point, const char *format, ...) __attribute__((format(printf, 3, 4)));
/* the same for a body with a position, velocity or force that is no number: names the first one; `otherwise` says what
 * is wrong when there is none */
void pal_body_stop_bad(pal_body *body, const char *otherwise);
#endif
