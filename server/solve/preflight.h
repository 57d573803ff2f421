/* Checks a scene before it runs: the stable sub-step and the node that limits it, weak elements and nodes with
 * their positions, conditioning, memory, and the predicted cost of a step. A scene that cannot run is refused with
 * the reason of pal_world_create. Uses a world of its own, at rest. Takes some
 * hundred force evaluations. Thread: [load]. */
#ifndef PAL_SOLVE_PREFLIGHT_H
#define PAL_SOLVE_PREFLIGHT_H
#include "server/sim/world/world.h"

enum { PAL_PREFLIGHT_LINE = 220, PAL_PREFLIGHT_LINES = 9 };

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
    /* Of M^-1 K at rest: the square root of the largest eigenvalue by Lanczos iteration, and of the smallest
     * (implicit/lowest_frequency.h) with its relative error. condition is the ratio of the eigenvalues,
     * slowest_period_s the period of the smallest, return_s the time constant of its decay. NaN: all points are fixed,
     * or the smallest is not known, as where part of the body is not held */
    double omega_max_1_s, omega_min_1_s, omega_min_error, condition, slowest_period_s, return_s;
    char slow[PAL_PREFLIGHT_LINE]; /* the sentence of pal_preflight_slow; "": none */
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

/* Errors: REFUSED, BUDGET, MEMORY as pal_world_create. */
pal_err pal_preflight_run(const pal_scene *scene, pal_preflight *out, pal_diagnostic *diag);
/* The same prediction for a world at rest that nobody steps meanwhile: time of a step under load, ms; NaN: unknown. Its
 * forces are measured in a few evaluations; the world stays as it was. [load] */
double pal_step_cost_ms(const pal_scene *scene, pal_world *world);
/* Sentences about one body, one per line, worst first. Returns the number of lines. Without weak spots: the limit
 * and conditioning only. */
int pal_preflight_describe(const pal_preflight_body *body, char line[PAL_PREFLIGHT_LINES][PAL_PREFLIGHT_LINE]);
/* true: the time constant of the body's return is above PAL_SLOW_RETURN_S, and line says so in one sentence; else "" */
bool pal_preflight_slow(const pal_body *body, char line[PAL_PREFLIGHT_LINE]);
#endif
