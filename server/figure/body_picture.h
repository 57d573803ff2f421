/* Pictures of a body as SVG: a triangle surface seen from one side, without perspective, its values in the viewer's
 * colours with a colour bar, what holds it as blue dots, its loads as green arrows, the outline of its shape at rest.
 * Several pictures stand side by side in one file (paper B Fig 7, 13): all are seen from the same side and share scale
 * and frame, those of the same quantity share their range of colours, so that they can be compared.
 *
 * Hidden parts go by painter's order (picture_faces.h). A file stays below 1.5 MB: surfaces with more to see than
 * 16,000 triangles in all are drawn coarser. Thread: [load]. */
#ifndef PAL_FIGURE_BODY_PICTURE_H
#define PAL_FIGURE_BODY_PICTURE_H
#include "server/base/err.h"

#include <stdbool.h>
#include <stdint.h>

enum { PAL_BODY_PICTURES = 6 };

/* everything is borrowed */
typedef struct pal_body_picture {
    const char *title; /* above it; NULL: none */
    int n_vertex, n_tri;
    const double *x;         /* where the vertices are, m                            [n_vertex][3] */
    const double *rest;      /* where they were at rest, drawn as an outline; NULL: not [n_vertex][3] */
    const int32_t *tri;      /* counter-clockwise seen from outside                  [n_tri][3]    */
    const double *value;     /* NULL: the body is plain; NaN (and on a log map what is not positive): grey [n_vertex] */
    const char *value_title; /* beside the colour bar, with the unit after a comma; NULL: none */
    const char *unit;        /* of the values as they are given; NULL or empty: none */
    bool log;                /* logarithmic colour map                               */
    double low, high;        /* values of the first and the last colour; low >= high: from the values */
    double view[3];          /* from the body towards the eye; zero: from the front, right and above. Read of the
                              * first picture of a file; z is up on the paper */
    const uint8_t *fixed;    /* vertices that are held get a dot; NULL: none         [n_vertex]    */
    int n_load;              /* arrows; of more than 60 every so many are drawn      */
    const double *load_at;   /* m                                                    [n_load][3]   */
    const double *load_N;    /* the longest in a file has a fixed length             [n_load][3]   */
} pal_body_picture;

/* writes PATH whole or not at all; REFUSED names picture, entry and number: nothing to draw, too many pictures, a
 * triangle of a vertex that is not there, a place that is not finite; MEMORY, IO */
pal_err pal_body_picture_write(const pal_body_picture *picture, int n_picture, const char *path, pal_diagnostic *diag);

/* the colour of t in 0..1 (clamped) in the viewer's map, red first; NaN: the grey of no value */
void pal_body_picture_colour(double t, uint8_t rgb[3]);
#endif
