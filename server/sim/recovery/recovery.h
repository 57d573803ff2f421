/* Recovery from element inversion of hexahedra, tetrahedra, springs and control cells.
 *
 * Elements have states of balance that are not the body's shape at rest: folded, mirrored, crumpled. Every element
 * keeps its own force while it can: with the nearest proper rotation it is the gradient of an energy that is finite for
 * every F. Others form a *region*, where the edges of the elements act instead, as vectors (Mueller et al. 2005,
 * Sorkine and Alexa 2007, with one rotation for a region),
 *
 *     E = sum of the elements in no region  +  sum over regions of s phi,
 *     phi = min_G 1/2 sum_ij k_ij |(x_i - x_j) - G (X_i - X_j)|^2.
 *
 * For a given rotation G, phi is convex with its only balance at X turned by G. At the best G its gradient is the one
 * with G fixed (envelope theorem), without net force or torque; its tangent s k_ij I is an upper bound. A region that
 * reaches the supports, or has more than half of the body's elements, takes their rotation as G.
 *
 * Inverted is an element with a ratio of volume below PAL_INVERTED_LOW or above _HIGH. It enters a region at once when
 * the ratio at its middle too is outside PAL_RECOVERED_LOW to _HIGH, since its energy has no derivative near a flat
 * middle; else after PAL_RECOVERY_WAIT_S (simulated, as all clocks) without a load on the body. A region that stays bad
 * without a load grows by its neighbours every PAL_RECOVERY_GROW_S, and after PAL_RECOVERY_WHOLE_S it is the whole
 * connected body; but under weight only while no region is soft (s < 1), since weight draws a soft one out. It becomes
 * elements again when all its ratios are within PAL_RECOVERED_LOW to _HIGH, it would store little
 * (PAL_RECOVERY_LEAVE_STRAIN; not asked for any longer after PAL_RECOVERY_WHOLE_S) and the tank can pay.
 *
 * Energy. A tank T >= 0, empty when the first region is formed, receives what the body dissipates (its energy
 * less the work of lasting loads; nothing while contact acts) and pays for every change at fixed x: of s, of the
 * elements in regions, of material or supports. A change that T cannot pay is made smaller: s begins at most so large
 * that the energy does not rise, and rises to 1 as T permits, within PAL_RECOVERY_STIFFEN_S at the fastest. Without
 * loads E + kinetic energy + T - debt never increases; debt is what the floor of s has put in (PAL_RECOVERY_SOFT_MIN),
 * and dissipation repays it before it fills T. Implicit solvers dissipate by themselves; under an explicit one a
 * component adds pal_recovery_damp, as a body without drag would turn what it stores into motion that never ends.
 *
 * State (regions, s, debt, clocks) goes over to another body of the same elements, as at a switch of supports
 * (pal_recovery_transfer). T begins anew there, and where loads change: nobody sees more energy than at the change.
 * Memory: an arena of the caller; no heap in a step. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_RECOVERY_RECOVERY_H
#define PAL_SIM_RECOVERY_RECOVERY_H
#include "server/num/block_matrix.h"
#include "server/sim/core/effect.h"
#include "server/sim/recovery/tuning.h"

/* What recovery asks of a model. e: element, 0 <= e < n_element */
typedef struct pal_recovery_model {
    void *self;
    int n_element;
    /* node pairs of the edges of e, of which there are at most PAL_RECOVERY_EDGES_MAX; their number. They connect its
     * nodes and are in the pattern of an assembled matrix. [load] */
    int (*edges)(const void *self, int e, int32_t out[][2]);
    /* what e adds to k of each of its edges, N/m */
    double (*stiffness_N_m)(const void *self, int e);
    /* least and largest ratio of volume to that at rest of the whole body: the one pass when nothing is inverted */
    void (*range)(void *self, const pal_body *body, double out[2]);
    /* the same of every element, and that at its middle: low, high, middle [n_element] */
    void (*ratios)(void *self, const pal_body *body, float *low, float *high, float *middle);
    /* from now on elements with on[e] != 0 act alone */
    void (*act)(void *self, const uint8_t *on);
    /* energy of the acting elements, J */
    double (*energy)(void *self, const pal_body *body);
    /* forces are no gradient of `energy` and may add to it: regions become elements when these store next to nothing */
    bool no_gradient;
    /* the group of e, below n_group: elements of a group enter a region together; n_group 0: there are none */
    int n_group;
    int (*group)(const void *self, int e);
} pal_recovery_model;

enum { PAL_RECOVERY_EDGES_MAX = 24, PAL_RECOVERY_REGIONS_MAX = 64 };

typedef struct pal_recovery_region {
    bool fixed;         /* G is the rotation of the supports                                     */
    double rotation[9]; /* G                                                                     */
    double sum[9];      /* sum_ij k (x_i - x_j)(X_i - X_j)', which G fits best                   */
    double spin_1_s[3]; /* that fits the motion best, for damping                                */
    double scale;       /* s                                                                     */
    double energy_J;    /* s phi at the last evaluation                                          */
    double size_J;      /* sum_ij k |X_i - X_j|^2, 3 E V                                         */
    double grow_s;      /* until it may grow again                                                   */
    double good_s;      /* since all of its ratios are good                                      */
    int n;              /* elements                                                              */
    bool bad;           /* an element is not fit to leave                                        */
    bool stays;         /* the last change left it as it was                                     */
} pal_recovery_region;

typedef struct pal_recovery {
    pal_recovery_model model;
    int n_node, n_edge, n_active;
    const double *rest; /* nodes at rest, m, borrowed                                 [n_node][3]    */
    int32_t *first;     /* edges of each element are edge_of[first[e]] ...            [n_element + 1] */
    int32_t *edge_of;   /*                                                            [first[n_element]] */
    int32_t *end;       /* nodes of the edges, the smaller first                      [n_edge][2]    */
    double *k_N_m;      /* of the edges of elements in regions                        [n_edge]       */
    int32_t *active;    /* edges in regions                                           [n_active]     */
    int32_t *edge_region;
    int32_t *region;            /* of each element, -1: none                                  [n_element]    */
    uint8_t *on;                /* element acts                                               [n_element]    */
    uint8_t *enters;            /* an element of the group enters a region                    [n_group]      */
    float *low, *high, *middle; /* ratios at the last examination                     [n_element]    */
    int32_t *root;              /* working memory                                             [n_node]       */
    pal_recovery_region of[PAL_RECOVERY_REGIONS_MAX]; /* further regions share the last one's rotation   */
    int n_region;
    bool at_rest;         /* linearised at rest: all elements act                                         */
    bool was_bad;         /* an element was inverted at the last examination                            */
    double bad_s;         /* time for which that has lasted                                             */
    double tank_J;        /* T                                                                          */
    double debt_J;        /* put in by the floor of s and not yet dissipated                            */
    double counted_J;     /* kinetic energy and energy of all components after the last update          */
    double *d_m, *load_N; /* of the nodes then                                        [n_node][3]    */
    bool touched;         /* some of these loads came from contact                                      */
    double seen_s;        /* world time of the last update                                              */
} pal_recovery;

/* Copies the model; rest [n_node][3] is borrowed. MEMORY. [load] */
pal_err pal_recovery_make(const pal_recovery_model *model, int n_node, const double *rest, pal_arena *arena,
                          pal_recovery **out);
/* no regions, empty tank, all elements act */
void pal_recovery_reset(pal_recovery *r);
/* constants of the elements have changed. NULL: nothing */
void pal_recovery_refresh(pal_recovery *r);
/* takes over the state of `from`, of the same elements; else nothing. Other supports may be turned against a region,
 * which then keeps its best fit until its elements change, so that its energy does not rise */
void pal_recovery_transfer(pal_recovery *r, const pal_recovery *from, bool same_supports);
/* At the begin of a sub-step: examines the elements and chooses regions, G and s. Returns PAL_INVERTED while an element
 * is inverted or in a region, and PAL_INVERSION_* (effect.h). Counts in body->safeguards. NULL: 0 */
unsigned pal_recovery_update(pal_recovery *r, pal_step *step);
/* a body has regions: the calls below do nothing else, and r may be NULL */
static inline bool pal_recovery_acts(const pal_recovery *r)
{
    return r && r->n_region > 0;
}

/* s of the region that element e is in; -1: it is in none */
static inline double pal_recovery_scale(const pal_recovery *r, int e)
{
    return r->region[e] < 0 ? -1 : r->of[r->region[e]].scale;
}
/* the forces of the regions at the body's state, timed in body->safeguards */
void pal_recovery_add_forces(pal_recovery *r, pal_body *body);
/* Under an explicit solver, which does not damp by itself: forces against the motion of the edges in regions beside the
 * rotation that fits best, so that momentum and angular momentum stay, and what they add to the bounds of damping */
void pal_recovery_damp(pal_recovery *r, pal_body *body);
void pal_recovery_damping_bound(const pal_recovery *r, const pal_body *body, double *bound_Ns_m);
/* at nodes d: energy, J; f += forces; NULL: none */
double pal_recovery_energy(pal_recovery *r, const double *d, double *f);
/* Before energy, forces and linearise: while the body's d are its nodes at rest, for which solvers ask between steps,
 * all elements act and there are no regions */
void pal_recovery_select(pal_recovery *r, const pal_body *body);
/* At the last linearise: out += k K p; to += k K; rotation [n_node][9] += k_ij G; bound_N_m [n_node] += Gershgorin row
 * sums */
void pal_recovery_multiply(const pal_recovery *r, double k, const double *p, double *out);
void pal_recovery_assemble(const pal_recovery *r, double k, pal_block_matrix *to);
void pal_recovery_rotate(const pal_recovery *r, double *rotation);
void pal_recovery_bound(const pal_recovery *r, double *bound_N_m);
/* k of an element of n edges with Lame constants times volume mu V, lambda V and mean square edge L^2, such that phi is
 * E V/2 |F - G|^2 of a regular element: it bears a pull as the element does, N/m */
static inline double pal_recovery_stiffness_N_m(double mu_J, double lambda_J, int n_edge, double square_m2)
{
    const double young_J = mu_J * (3 * lambda_J + 2 * mu_J) / (lambda_J + mu_J);
    return 3 * young_J / (n_edge * square_m2);
}
#endif
