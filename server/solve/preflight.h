/* What can be said of a scene before it runs: the stable sub-step and which node sets it, elements and nodes that are
 * weak and where they are, conditioning, memory, and what a step will cost, predicted from counts. A scene that cannot
 * run is refused with the reason that pal_world_create gives. Works on a world of its own, at rest; costs some hundred
 * evaluations of the forces, most of them for the slowest motion. Thread: [load]. */
#ifndef PAL_SOLVE_PREFLIGHT_H
#define PAL_SOLVE_PREFLIGHT_H
#include "server/sim/world/world.h"

/* the worst of a kind, and how many there are; places in the scene frame */
typedef struct pal_weak_spot {
    int n;          /* 0: none                            */
    int worst;      /* index of element, edge's node or node */
    double value;   /* of the worst                       */
    double at_m[3]; /* its middle at rest                 */
} pal_weak_spot;

typedef struct pal_preflight_body {
    const char *name; /* of the scene */
    int n_point, n_node, n_element, n_fixed;
    double limit_s; /* largest stable sub-step at rest, INFINITY: none */
    int n_sub;      /* sub-steps of a step of the scene at rest        */
    /* the node with the largest row sum of stiffness over its mass; -1: the rows do not tell */
    int limit_node;
    double limit_at_m[3], limit_edge_m, limit_mass_kg; /* its place, shortest edge and mass */
    pal_weak_spot
        flat;     /* tetrahedra or triangles of shape below 0.1 (1: regular), value: shape; 0: no volume or area */
    int n_sliver; /* of these the tetrahedra whose volume a row tet_volume leaves out; 0 without such a row     */
    pal_weak_spot edge;  /* edges shorter than 1e-6 S, value: m                                                       */
    pal_weak_spot thin;  /* elements filled by less than 5 %, value: share                                            */
    pal_weak_spot light; /* points lighter than 1/1000 of the mean, value: kg                                         */
    /* of M^-1 K at rest: largest eigenvalue by Lanczos' iteration, smallest from above by the Rayleigh quotient of the
     * body under its own weight; condition is their ratio, slowest_period_s the period of the latter. NaN: nothing
     * holds it, or everything does */
    double omega_max_1_s, omega_min_1_s, condition, slowest_period_s;
    /* element that locks at the body's largest Poisson's ratio, and one that does not (both literals); NULL: none does
     */
    const char *locks, *instead;
    double poisson;
    double predicted_ms; /* of a step under load, on the machine of README's tables; NaN: not known for its rows */
} pal_preflight_body;

typedef struct pal_preflight {
    int n_body;
    pal_preflight_body body[PAL_BODY_MAX];
    double predicted_ms; /* of all, NaN when one is not known */
    size_t n_byte;       /* of the world                       */
} pal_preflight;

/* max_cg: iterations of the conjugate gradients for the slowest motion, along each axis. With few of them omega_min_1_s
 * is too large and the condition a lower bound. REFUSED, BUDGET, MEMORY as pal_world_create */
enum { PAL_PREFLIGHT_FULL = 250, PAL_PREFLIGHT_QUICK = 40 };
pal_err pal_preflight_run(const pal_scene *scene, int max_cg, pal_preflight *out, pal_diagnostic *diag);
/* sentences for people about one body, one a line, worst first; returns how many lines (at most `most`). Nothing weak:
 * limit and conditioning alone */
enum { PAL_PREFLIGHT_LINE = 200, PAL_PREFLIGHT_LINES = 8 };
int pal_preflight_describe(const pal_preflight_body *body, char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE]);
#endif
