/* A small problem for studies: a beam that is held at one end and pulled down at the other. */
#ifndef PAL_TESTS_LAB_BEAM_PROBLEM_H
#define PAL_TESTS_LAB_BEAM_PROBLEM_H
#include "server/sim/problem.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* 0.32 x 0.04 x 0.04 m, away from the origin, the end at x = 1 held, the other pulled down by 16 mN */
static inline bool make_beam(pal_surface *out, pal_problem *p)
{
    static const int32_t tri[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                       {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    *out = (pal_surface){.n_vertex = 8, .n_tri = 12, .x = malloc(24 * sizeof(double)), .tri = malloc(sizeof tri)};
    if (!out->x || !out->tri) return false;
    for (int k = 0; k < 8; k++) {
        out->x[3 * k] = 1 + 0.32 * (k & 1);
        out->x[3 * k + 1] = 0.04 * (k >> 1 & 1);
        out->x[3 * k + 2] = 0.04 * (k >> 2);
    }
    memcpy(out->tri, tri, sizeof tri);
    pal_surface_recentre(out);
    memset(p, 0, sizeof *p);
    snprintf(p->name, sizeof p->name, "beam");
    p->unit_m = 1, p->n_material = p->n_support = p->n_case = 1;
    p->material[0] = (pal_problem_material){
        .id = "m", .region = {.all = true}, .young_Pa = 80000, .poisson = 0.3, .density_kg_m3 = 1000};
    p->support[0].region = (pal_box){.low_m = {0.9, -1, -1}, .high_m = {1.000001, 1, 1}};
    p->load_case[0].n_load = 1;
    p->load_case[0].load[0] = (pal_problem_load){.kind = PAL_LOAD_TRACTION,
                                                 .region = {.low_m = {1.319999, -1, -1}, .high_m = {2, 1, 1}},
                                                 .has_normal = true,
                                                 .normal = {1, 0, 0},
                                                 .has_total = true,
                                                 .total_N = {0, 0, -0.016}};
    snprintf(p->load_case[0].id, PAL_NAME, "tip");
    for (int c = 0; c < 3; c++) p->material[0].region.low_m[c] = -1e9, p->material[0].region.high_m[c] = 1e9;
    return true;
}
#endif
