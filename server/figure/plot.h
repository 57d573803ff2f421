/* Plots as SVG: curves over one pair of axes, linear or logarithmic, with readable labels, for results that people
 * would rather look at than read. Colours are told apart by colour-blind readers too (Okabe and Ito), and each curve
 * has its own mark. Thread: [load]. */
#ifndef PAL_FIGURE_PLOT_H
#define PAL_FIGURE_PLOT_H
#include "server/figure/svg.h"

#include <stdbool.h>

enum { PAL_PLOT_CURVES = 16, PAL_PLOT_GUIDES = 4, PAL_PLOT_LABELS = 64 };

typedef struct pal_curve {
    const char *name; /* in the legend; borrowed                             */
    int n;
    const double *x, *y;     /* borrowed; points that are not finite, or not positive on a log axis, are left out [n] */
    bool dashed, bare, thin; /* bare: no marks; thin: a fine pale line, for what stands behind the others */
    bool dots;               /* marks without a line */
    bool ink;                /* dark in place of the next colour, which it leaves to the others */
    bool hollow;             /* marks as outlines: what does not count like the others */
    const char *const *tip;  /* of each mark, shown while it is pointed at; borrowed; NULL: none [n] */
} pal_curve;

/* a line across the plot at one value, with its meaning beside it; the axis reaches it */
typedef struct pal_plot_guide {
    bool vertical; /* at x, else at y */
    double at;
    const char *text; /* borrowed */
} pal_plot_guide;

/* a word beside a point: where no mark, line, label or guide's text is, with a fine line to its point when it had to go
 * farther; left out when there is no room. Earlier labels get their place first */
typedef struct pal_plot_label {
    double x, y;
    const char *text; /* borrowed */
} pal_plot_label;

typedef struct pal_plot {
    const char *title, *x_label, *y_label; /* with units; borrowed */
    bool log_x, log_y;
    int wide, high; /* pixels; 0: 760 x 480 */
    int n_curve;
    pal_curve curve[PAL_PLOT_CURVES];
    int n_guide;
    pal_plot_guide guide[PAL_PLOT_GUIDES];
    int n_label; /* at most PAL_PLOT_LABELS */
    const pal_plot_label *label;
} pal_plot;

/* writes PATH whole or not at all; REFUSED: no curve has a point to draw; IO */
pal_err pal_plot_write(const pal_plot *plot, const char *path, pal_diagnostic *diag);
/* the drawing as text, which the caller frees; REFUSED, MEMORY */
pal_err pal_plot_text(const pal_plot *plot, char **text, size_t *n_byte, pal_diagnostic *diag);
#endif
