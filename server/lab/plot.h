/* Plots as SVG: curves over one pair of axes, linear or logarithmic, with readable labels, for results that people
 * would rather look at than read. Colours are told apart by colour-blind readers too (Okabe and Ito), and each curve
 * has its own mark. Thread: [load]. */
#ifndef PAL_LAB_PLOT_H
#define PAL_LAB_PLOT_H
#include "server/base/err.h"

#include <stdbool.h>

enum { PAL_PLOT_CURVES = 12 };

typedef struct pal_curve {
    const char *name; /* in the legend; borrowed                             */
    int n;
    const double *x, *y;     /* borrowed; points that are not finite, or not positive on a log axis, are left out [n] */
    bool dashed, bare, thin; /* bare: no marks; thin: a fine pale line, for what stands behind the others */
} pal_curve;

typedef struct pal_plot {
    const char *title, *x_label, *y_label; /* with units; borrowed */
    bool log_x, log_y;
    int n_curve;
    pal_curve curve[PAL_PLOT_CURVES];
} pal_plot;

/* writes PATH whole or not at all; REFUSED: no curve has a point to draw; IO */
pal_err pal_plot_write(const pal_plot *plot, const char *path, pal_note *note);
#endif
