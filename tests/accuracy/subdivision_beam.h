/* The reference beam as a subdivided solid: a crisp block, so that it stays a box of bricks at every level. */
#ifndef TESTS_ACCURACY_SOLID_BEAM_H
#define TESTS_ACCURACY_SOLID_BEAM_H
#include "tests/fixtures/subdivision_scene.h"

typedef struct solid_beam {
    solid_scene s;
    double length_m, width_m, edge_m; /* h: of the elements */
} solid_beam;

/* 4 n x n x n control cells, clamped at x = 0, implicit_euler in long steps */
static inline bool solid_beam_open(solid_beam *b, int n, int level, double poisson, const char *operator)
{
    const double size[3] = {0.2, 0.05, 0.05};
    b->length_m = size[0], b->width_m = size[1], b->edge_m = size[1] / n / (1 << level);
    solid_scene_take(&b->s, solid_scene_box((const int32_t[3]){4 * n, n, n}, size, true), level,
                     "implicit_euler", operator);
    pal_entry_put_number(&b->s.def->solver, "tolerance", 1e-6, NULL);
    pal_entry_put_number(&b->s.def->solver, "iterations", 500, NULL);
    b->s.def->material = (pal_material){.young_Pa = 1e5, .poisson = poisson, .density_kg_m3 = 1000, .damping_1_s = 4};
    solid_scene_hold(&b->s, 0, 1e-6);
    if (!solid_scene_open(&b->s)) return false;
    b->s.body->load_cap_N = INFINITY;
    return true;
}

/* a traction along z on the end face, each square's at its four corners */
static inline void solid_beam_load(solid_beam *b, double traction_Pa)
{
    const pal_body *body = b->s.body;
    for (int i = 0; i < body->n_node; i++) {
        const double *x = body->node_rest + 3 * i;
        if (fabs(x[0] - b->length_m) > 1e-6 * b->edge_m) continue;
        double share = traction_Pa * b->edge_m * b->edge_m;
        for (int c = 1; c < 3; c++)
            if (fabs(x[c]) < 1e-6 * b->edge_m || fabs(x[c] - b->width_m) < 1e-6 * b->edge_m) share *= 0.5;
        pal_world_load(b->s.world, 0, i, (double[3]){0, 0, share});
    }
}

/* until no point moves more than 1e-6 of the length in a step; steps taken, 0: it does not settle */
static inline int solid_beam_settle(solid_beam *b)
{
    const double dt_s = 0.5;
    for (int i = 1; i <= 300; i++) {
        if (pal_world_step(b->s.world, dt_s)) return 0;
        double max = 0;
        for (int k = 0; k < b->s.body->n_dof; k++) max = fmax(max, pal_norm3(b->s.body->v + 3 * k));
        if (max * dt_s < 1e-6 * b->length_m) return i;
    }
    return 0;
}

/* mean displacement along z of the nodes on the end face */
static inline double solid_beam_end(const solid_beam *b)
{
    const pal_body *body = b->s.body;
    double sum = 0;
    int n = 0;
    for (int i = 0; i < body->n_node; i++)
        if (fabs(body->node_rest[3 * i] - b->length_m) < 1e-6 * b->edge_m)
            sum += body->d[3 * i + 2] - body->node_rest[3 * i + 2], n++;
    return sum / n;
}
#endif
