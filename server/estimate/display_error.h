/* Errors at the vertices of the displayed surface: its skin against the displacement field of the elements. Nodes alone
 * underestimate the error: meshes differ more between common nodes, for example where a tool presses, and the skin
 * rotates with its nodes but does not stretch with them (a press on a ball: 5 times the error at the nodes).
 * Private to this room. Allocates heap memory. Thread: one at a time. */
#ifndef PAL_ESTIMATE_DISPLAY_ERROR_H
#define PAL_ESTIMATE_DISPLAY_ERROR_H
#include "server/estimate/rest_solution.h"

enum { PAL_DISPLAY_FINE, PAL_DISPLAY_COARSE, PAL_DISPLAY_COARSEST, PAL_DISPLAY_RESTS };

typedef struct pal_display_error {
    int n; /* displayed vertices; 0: no skin, so nodes are compared instead */
    const pal_prepared *mesh;
    const pal_rest_solution *rest[PAL_DISPLAY_RESTS];
    /* interpolation from the nodes of each rest solution to the vertices; n_row 0: no such solution */
    pal_interpolation by[PAL_DISPLAY_RESTS];
    void *frames;
    float *skin_m;    /* positions of the vertices, m [n][3] */
    double *u[2];     /* displacements of vertices, m [n][3] */
    float *unmoved_m; /* vertex positions at rest, as the skin rounds them, m [n][3] */
} pal_display_error;

/* Borrows the rest solutions. `fine` must have a world; the others may have none. The skin uses the node numbers of
 * `fine`. Error: MEMORY. */
pal_err pal_display_error_make(const pal_rest_solution *fine, const pal_rest_solution *coarse,
                               const pal_rest_solution *coarsest, pal_display_error *out);
void pal_display_error_free(pal_display_error *shown); /* accepts a zeroed struct */
/* Largest distance between two rest solutions at the displayed vertices, by element interpolation, m. */
double pal_display_error_change(pal_display_error *shown, int of, int to);
/* Largest distance, m, between the skin with nodes at x [n_node][3] and the element interpolation of FINE,
 * extrapolated from COARSE by the fraction `more` of the change between the two. */
double pal_display_error_skin(pal_display_error *shown, const double *x, double more);
#endif
