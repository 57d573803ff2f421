/* The moving arrays of one body. All memory is the world's arena; rows borrow pointers into it. Thread: [sim]. */
#ifndef PAL_SIM_BODY_H
#define PAL_SIM_BODY_H
#include "server/base/arena.h"
#include "server/mesh/skin.h"
#include "server/mesh/surface.h"
#include "server/mesh/tets.h"
#include "server/sim/strips.h"

typedef struct pal_body {
    const char *name;
    int n_dof;          /* points the solver moves: control points (A) or mass nodes             */
    int n_node;         /* points forces act on; equals n_dof when embed is NULL                 */
    double *x, *v;      /* dof position m (relative to origin_m), velocity m/s     [n_dof][3]    */
    double *d, *dv;     /* node position, velocity; alias x, v without embed       [n_node][3]   */
    double *load;       /* loads of CONTACT rows and of `outer`, N, constant in a sub-step [n_node][3] */
    double *outer;      /* lasting loads set by pal_world_load, N; NULL: none      [n_node][3]   */
    double *f;          /* node force N                                            [n_node][3]   */
    double *g;          /* f pulled back to dofs N; aliases f without embed        [n_dof][3]    */
    double *mass_kg;    /* lumped                                                  [n_dof]       */
    uint8_t *held;      /* 1: fixed in place                                       [n_dof]       */
    double *x_rest;     /* rest position m                                         [n_dof][3]    */
    bool frozen;        /* set by finite_guard or the solver: the body no longer moves           */
    double size_m;      /* box diagonal at rest, S of numerics.md part 3                         */
    double h_m;         /* typical element edge                                                  */
    double offset_m[3]; /* position in the scene frame = x + offset_m (scene frame: first body's mesh frame) */
    double dt_limit_s;  /* largest stable sub-step, from the SOLVE row; infinite when unconditional */
    double load_cap_N;  /* most load on one node, 10 E h^2 (numerics.md part 3); larger ones are shortened */
    uint64_t n_capped;  /* node loads shortened since reset                                        */
    uint64_t n_clamped; /* node moves shortened by the solver since reset                          */
    uint64_t n_heavy;   /* sub-steps since reset in which deformation asked for more than the budget of sub-steps */

    /* geometry at rest, borrowed from the scene's prepared mesh by the model; NULL when the model has none */
    const pal_tets *tets;
    pal_slots *slots;           /* memory order of the nodes for kernels; NULL: none made       */
    const pal_surface *surface; /* shown surface at rest                                       */
    const pal_skin *skin;       /* surface on nodes; NULL: shown vertices are the surface nodes */
    /* what is shown: all of these are set by the OUTPUT row's make; none: n_shown 0 */
    double *skin_axes;         /* current frames of skin, kept between calls  [n_frame][9]    */
    int n_shown;               /* shown vertices                                              */
    float *shown;              /* written by the OUTPUT row, m, body frame    [n_shown][3]    */
    const int32_t *shown_node; /* node of each shown vertex when skin is NULL [n_shown]       */
    uint64_t revision;         /* grows whenever the shown topology changes                   */
} pal_body;

/* arrays for n points without embed, zeroed, f = g, d = x, dv = v; MEMORY. [load] */
pal_err pal_body_allocate(pal_body *body, pal_arena *arena, int n_node);
/* sums over the body [sim] */
double pal_body_kinetic_J(const pal_body *body);
void pal_body_momentum(const pal_body *body, double momentum_kg_m_s[3]);
bool pal_body_finite(const pal_body *body);
#endif
