/* Errors of what is shown: the surface that hangs on a body's nodes by its skin, against the displacements that
 * elements have there. Nodes tell less: between them, where a tool presses a vertex, meshes differ by more than at
 * those that both have, and a skin, which turns with its nodes and is not stretched with them, hangs off its own
 * elements by as much again (a press on a ball: 5 times what the nodes told). Private to estimate_*.c. Heap memory.
 * Thread: one at a time. */
#ifndef PAL_ESTIMATE_DISPLAY_ERROR_H
#define PAL_ESTIMATE_DISPLAY_ERROR_H
#include "server/estimate/rest_solution.h"
#include "server/num/interpolation.h"

enum { PAL_DISPLAY_FINE, PAL_DISPLAY_COARSE, PAL_DISPLAY_COARSEST, PAL_DISPLAY_RESTS };

typedef struct pal_display_error {
    int n; /* shown vertices; 0: nothing hangs on nodes, which are compared themselves then */
    const pal_prepared *mesh;
    const pal_rest_solution *rest[PAL_DISPLAY_RESTS];
    pal_interpolation by[PAL_DISPLAY_RESTS]; /* vertices by the nodes of each rest; n_row 0: there is no such rest */
    void *frames;
    float *place;     /* of vertices, m [n][3] */
    double *u[2];     /* displacements of vertices, m [n][3] */
    double *node;     /* of nodes [most nodes of a rest][3] */
    float *unmoved_m; /* places of vertices at rest, as the skin rounds them [n][3] */
} pal_display_error;

/* rests: FINE has a world, others may have none; all are borrowed. Nodes of the skin are numbered as those of FINE.
 * MEMORY */
pal_err pal_display_error_make(const pal_rest_solution *fine, const pal_rest_solution *coarse,
                               const pal_rest_solution *coarsest, pal_display_error *out);
void pal_display_error_free(pal_display_error *shown); /* a zeroed one is fine */
/* the largest distance between two rests at shown vertices, by their elements, m */
double pal_display_error_change(pal_display_error *shown, int of, int to);
/* the largest distance between what is shown where nodes are at x [n_node][3] and where elements of FINE, gone on from
 * COARSE by `more` of the way between these, have it */
double pal_display_error_skin(pal_display_error *shown, const double *x, double more);
#endif
