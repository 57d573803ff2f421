/* The true limit of a sub-step, found without a solver: the largest w^2 = eigenvalue of M^-1 K about the present state
 * of body 0 of a plan, by power iteration on differences of the forces of its rows. */
#ifndef TESTS_SIM_LARGEST_W2_H
#define TESTS_SIM_LARGEST_W2_H
#include "server/sim/plan.h"
#include "server/sim/world.h"
#include "tests/check.h"

static inline double largest_w2(pal_plan *plan, uint64_t *seed)
{
    pal_body *body = &plan->body[0];
    const int n = 3 * body->n_dof;
    double *p = malloc(sizeof(double) * (size_t)n), *up = malloc(sizeof(double) * (size_t)n), w2 = 0;
    double *x = malloc(sizeof(double) * (size_t)n), eps = 1e-5 * body->h_m;
    pal_step step = {.body = body,
                     .force = plan->row + plan->first[PAL_STAGE_FORCE][0],
                     .n_force = plan->n_of[PAL_STAGE_FORCE][0],
                     .drag_apart = true};
    memcpy(x, body->x, sizeof(double) * (size_t)n);
    for (int i = 0; i < n; i++) p[i] = check_random(seed);
    for (int turn = 0; turn < 300; turn++) {
        double size = 0, along = 0;
        for (int i = 0; i < n; i++) size += p[i] * p[i];
        for (int i = 0; i < n; i++) p[i] /= sqrt(size);
        for (int i = 0; i < n; i++) body->x[i] = x[i] + eps * p[i];
        pal_gather(&step);
        memcpy(up, body->f, sizeof(double) * (size_t)n);
        for (int i = 0; i < n; i++) body->x[i] = x[i] - eps * p[i];
        pal_gather(&step);
        for (int i = 0; i < n; i++) {
            double q = (body->f[i] - up[i]) / (2 * eps) / body->mass_kg[i / 3];
            along += q * p[i];
            p[i] = q;
        }
        w2 = along;
    }
    memcpy(body->x, x, sizeof(double) * (size_t)n);
    free(p), free(up), free(x);
    return w2;
}
#endif
