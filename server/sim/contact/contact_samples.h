/* Which points of a body's shown surface a tool can touch: all shown vertices and samples inside triangles longer than
 * `spacing_m`, so that a sphere never slips through a coarse mesh. Fixed samples are in triangles that are long at
 * rest, passing samples in triangles near a tool that are stretched in this step. On an adaptive surface only active
 * vertices are points, and fixed samples, fans and areas are made again when display.revision changes. Memory: the
 * component's arena. Thread: [sim], pal_contact_samples_make [load]. */
#ifndef PAL_SIM_CONTACT_CONTACT_SAMPLES_H
#define PAL_SIM_CONTACT_CONTACT_SAMPLES_H
#include "server/sim/core/body.h"

typedef struct pal_contact_samples {
    int n_vertex, n_fixed;  /* points [0, n_vertex) are the shown vertices, up to n_fixed fixed samples, */
    int n_point, max_point; /* up to n_point passing samples of this step; room for max_point            */
    double spacing_m;
    int32_t *corner;                    /* shown vertices of each sample          [max_point - n_vertex][3] */
    float *share;                       /* their shares, sum 1                    [max_point - n_vertex][3] */
    double *area_m2;                    /* rest area that each point stands for   [max_point]               */
    int32_t *fan_start, *fan_end, *fan; /* triangles around shown vertices: fan[start..end-1] [n_vertex] */
    uint32_t *tri_mark, mark;           /* sampled in this step                               [n_tri]    */
    /* adaptive surfaces: first fixed sample of each triangle that has some, and one past the last; else NULL */
    int n_run;
    int32_t *run;      /* minus n_vertex [n_run + 1]                   */
    uint64_t revision; /* of the triangles that all this belongs to    */
} pal_contact_samples;

/* at most max_sample samples: spacing grows to keep to it. body must show something; MEMORY, REFUSED */
pal_err pal_contact_samples_make(const pal_body *body, double spacing_m, int max_sample, pal_arena *arena,
                                 pal_contact_samples *out);
/* takes the triangles as the body draws them now, before a step; false: they have not changed */
bool pal_contact_samples_update_topology(pal_contact_samples *t, const pal_body *body);
/* passing samples for triangles at the vertices list [n] that were short at rest and are long now */
void pal_contact_samples_add_stretched(pal_contact_samples *t, const pal_body *body, const int32_t *list, int n);
/* shown vertices [3] of a point and their shares [3]; returns how many: 1 or 3 */
int pal_contact_samples_corners(const pal_contact_samples *t, int point, int32_t *vertex, double *share);
#endif
