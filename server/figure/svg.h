/* What all drawings share: text that cannot leave its element, round numbers for ticks, whole files. Thread: [load]. */
#ifndef PAL_FIGURE_SVG_H
#define PAL_FIGURE_SVG_H
#include "server/base/err.h"

#include <stdio.h>

enum { PAL_SVG_TICKS = 12 };

/* An SVG in memory: begin opens it with its size in pixels on white, end writes PATH whole or not at all and frees the
 * memory. MEMORY, IO */
typedef struct pal_svg {
    FILE *to;
    char *text;
    size_t n_byte;
} pal_svg;
pal_err pal_svg_begin(pal_svg *svg, double wide, double high, pal_diagnostic *diag);
pal_err pal_svg_end(pal_svg *svg, const char *path, pal_diagnostic *diag);
/* ends it as text, which the caller frees; MEMORY */
pal_err pal_svg_end_text(pal_svg *svg, char **text, size_t *n_byte, pal_diagnostic *diag);

/* n bytes of text with the characters that end an element or an attribute escaped; also for pages */
void pal_svg_escape(FILE *to, const char *text, size_t n_byte);
/* a text element; anchor: start, middle or end; more: further attributes, each after a blank; at most `max`
 * characters, then an ellipsis (0: all). NULL text is empty; bytes that are no shown UTF-8 become question marks */
void pal_svg_text(FILE *to, double x, double y, const char *anchor, const char *more, const char *text, int max);

/* 1, 2 or 5 times a power of ten, so that span holds at most `max` of them */
double pal_svg_step(double span, int max);
/* the multiples of step from low to high, at most PAL_SVG_TICKS; returns how many */
int pal_svg_ticks(double low, double high, double step, double value[PAL_SVG_TICKS]);
/* the same for a logarithmic axis, low and high as log10: whole decades, 2 and 5 between them where there are few,
 * thinned where there are many */
int pal_svg_log_ticks(double low, double high, double value[PAL_SVG_TICKS]);
#endif
