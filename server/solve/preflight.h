/* Checks a scene before it runs: the stable sub-step and the node that limits it, weak elements and nodes with
 * their positions, conditioning, memory, and the predicted cost of a step. A scene that cannot run is refused with
 * the reason of pal_world_create. Uses a world of its own, at rest. Takes some hundred force evaluations, most of
 * them for the slowest motion. Thread: [load]. */
#ifndef PAL_SOLVE_PREFLIGHT_H
#define PAL_SOLVE_PREFLIGHT_H
#include "server/sim/world/world.h"

/* the worst of a kind, and their number; positions in the scene frame */
typedef struct pal_weak_spot {
    int n;          /* 0: none                            */
    int worst;      /* index of the element, the edge's node, or the node */
    double value;   /* of the worst                       */
    double at_m[3]; /* its centre at rest */
} pal_weak_spot;

typedef struct pal_preflight_body {
    const char *name; /* borrowed from the scene */
    int n_point, n_node, n_element, n_fixed;
    double limit_s; /* largest stable sub-step at rest; INFINITY: none */
    int n_sub;      /* sub-steps of a step of the scene at rest */
    /* the node with the largest row sum of stiffness over its mass; -1: the components do not provide it */
    int limit_node;
    double limit_at_m[3], limit_edge_m, limit_mass_kg; /* its position, shortest edge and mass */
    pal_weak_spot
        /* tetrahedra or triangles of shape quality below 0.1 (1: regular); value: quality; 0: no volume or area */
        flat;
    int n_sliver; /* tetrahedra among these whose volume the component tet_volume omits; 0 without such a component */
    pal_weak_spot edge;  /* edges shorter than 1e-6 S; value: m */
    pal_weak_spot thin;  /* elements filled by less than 5 %; value: share */
    pal_weak_spot light; /* points lighter than 1/1000 of the mean; value: kg */
    /* Of M^-1 K at rest: the largest eigenvalue by Lanczos iteration; an upper bound of the smallest by the
     * Rayleigh quotient of the body under its own weight. condition is their ratio, slowest_period_s the period of
     * the smallest. NaN: no node is fixed, or all are. */
    double omega_max_1_s, omega_min_1_s, condition, slowest_period_s;
    /* element that locks at the body's largest Poisson's ratio, and one that does not (both literals); NULL: none
     * locks */
    const char *locks, *instead;
    double poisson;
    /* of a step under load: its forces as measured here, the rest from counts; NaN: a static solver */
    double predicted_ms;
} pal_preflight_body;

typedef struct pal_preflight {
    int n_body;
    pal_preflight_body body[PAL_BODY_MAX];
    double predicted_ms; /* of all bodies; NaN if one is unknown */
    size_t n_byte;       /* size of the world */
} pal_preflight;

/* max_cg: conjugate gradient iterations for the slowest motion, along each axis. With few of them omega_min_1_s is
 * too large and condition is a lower bound. Errors: REFUSED, BUDGET, MEMORY as pal_world_create. */
enum { PAL_PREFLIGHT_FULL = 250, PAL_PREFLIGHT_QUICK = 40 };
pal_err pal_preflight_run(const pal_scene *scene, int max_cg, pal_preflight *out, pal_diagnostic *diag);
/* Sentences about one body, one per line, worst first. Returns the number of lines. Without weak spots: the limit
 * and conditioning only. */
enum { PAL_PREFLIGHT_LINE = 200, PAL_PREFLIGHT_LINES = 8 };
int pal_preflight_describe(const pal_preflight_body *body, char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE]);
#endif
