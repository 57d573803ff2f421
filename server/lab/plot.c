/* Plots as SVG. One pass finds the range, then frame, ticks, curves and legend are written in that order. */
#include "server/lab/plot.h"

#include "server/lab/svg.h"

#include <math.h>

enum { WIDE = 760, HIGH = 480, LEFT = 84, RIGHT = 210, TOP = 46, BOTTOM = 62 };

typedef struct axis {
    bool log;
    double low, high; /* of the values, or of their log10 */
    double step;      /* between ticks of a linear axis   */
    double from, to;  /* in pixels                        */
} axis;

static const char *const colour[] = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"};
enum { N_COLOUR = sizeof colour / sizeof colour[0] };

static bool drawable(const pal_plot *plot, const pal_curve *c, int i)
{
    if (!isfinite(c->x[i]) || !isfinite(c->y[i])) return false;
    return (!plot->log_x || c->x[i] > 0) && (!plot->log_y || c->y[i] > 0);
}

static double scaled(const axis *a, double value)
{
    return a->log ? log10(value) : value;
}

static double place(const axis *a, double value)
{
    return a->from + (a->to - a->from) * (scaled(a, value) - a->low) / (a->high - a->low);
}

/* widens the range to whole ticks */
static void settle(axis *a)
{
    if (a->log) {
        double margin = 0.06 * (a->high - a->low) + 0.02;
        a->low -= margin, a->high += margin;
        if (a->high - a->low < 0.5) a->low -= 0.25, a->high += 0.25;
        return;
    }
    if (!(a->high > a->low)) {
        double around = a->low != 0 ? 0.1 * fabs(a->low) : 1;
        a->low -= around, a->high += around;
    }
    double step = a->step = pal_svg_step(a->high - a->low, 6);
    a->low = step * floor(a->low / step + 1e-9), a->high = step * ceil(a->high / step - 1e-9);
}

static int ticks(const axis *a, double value[PAL_SVG_TICKS])
{
    return a->log ? pal_svg_log_ticks(a->low, a->high, value) : pal_svg_ticks(a->low, a->high, a->step, value);
}

static void label(FILE *to, double x, double y, const char *anchor, const char *more, const char *text)
{
    pal_svg_text(to, x, y, anchor, more, text, 0);
}

static void draw_axes(FILE *to, const pal_plot *plot, const axis *x, const axis *y)
{
    double value[PAL_SVG_TICKS];
    char text[32];
    int n = ticks(x, value);
    for (int i = 0; i < n; i++) {
        double p = place(x, value[i]);
        fprintf(to, "<path d=\"M%.1f %.1fV%.1f\" stroke=\"#ddd\"/>\n", p, y->from, y->to);
        snprintf(text, sizeof text, "%g", value[i]);
        label(to, p, y->from + 18, "middle", "", text);
    }
    n = ticks(y, value);
    for (int i = 0; i < n; i++) {
        double p = place(y, value[i]);
        fprintf(to, "<path d=\"M%.1f %.1fH%.1f\" stroke=\"#ddd\"/>\n", x->from, p, x->to);
        snprintf(text, sizeof text, "%g", value[i]);
        label(to, x->from - 8, p + 4, "end", "", text);
    }
    fprintf(to, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" stroke=\"#333\"/>\n", x->from,
            y->to, x->to - x->from, y->from - y->to);
    label(to, (x->from + x->to) / 2, HIGH - 16, "middle", "", plot->x_label);
    char more[64];
    snprintf(more, sizeof more, " transform=\"rotate(-90 22 %d)\"", (TOP + HIGH - BOTTOM) / 2);
    label(to, 22, (TOP + HIGH - BOTTOM) / 2.0, "middle", more, plot->y_label);
    label(to, (x->from + x->to) / 2, 26, "middle", " font-size=\"16\" font-weight=\"600\"", plot->title);
}

static void mark(FILE *to, int kind, double x, double y)
{
    const char *ink = colour[kind % N_COLOUR];
    switch (kind % 4) {
    case 0:
        fprintf(to, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4\" fill=\"%s\"/>\n", x, y, ink);
        break;
    case 1:
        fprintf(to, "<rect x=\"%.1f\" y=\"%.1f\" width=\"7\" height=\"7\" fill=\"%s\"/>\n", x - 3.5, y - 3.5, ink);
        break;
    case 2:
        fprintf(to, "<path d=\"M%.1f %.1fl4.6 8h-9.2z\" fill=\"%s\"/>\n", x, y - 5, ink);
        break;
    default:
        fprintf(to, "<path d=\"M%.1f %.1fl4.8 4.8l-4.8 4.8l-4.8 -4.8z\" fill=\"%s\"/>\n", x, y - 4.8, ink);
    }
}

static void draw_curve(FILE *to, const pal_plot *plot, int k, const axis *x, const axis *y)
{
    const pal_curve *c = &plot->curve[k];
    const char *dash = c->dashed ? " stroke-dasharray=\"6 4\"" : "";
    const char *width = c->thin ? "0.8\" stroke-opacity=\"0.6" : "2";
    fprintf(to, "<path fill=\"none\" stroke-width=\"%s\" stroke=\"%s\"%s d=\"", width, colour[k % N_COLOUR], dash);
    bool pen = false;
    for (int i = 0; i < c->n; i++) {
        bool on = drawable(plot, c, i);
        if (on) fprintf(to, "%c%.1f %.1f", pen ? 'L' : 'M', place(x, c->x[i]), place(y, c->y[i]));
        pen = on;
    }
    fputs("\"/>\n", to);
    for (int i = 0; i < c->n && !c->bare; i++)
        if (drawable(plot, c, i)) mark(to, k, place(x, c->x[i]), place(y, c->y[i]));
    double at = TOP + 14 + 22.0 * k, from = WIDE - RIGHT + 16;
    fprintf(to, "<path stroke-width=\"%s\" stroke=\"%s\"%s d=\"M%.1f %.1fh28\"/>\n", width, colour[k % N_COLOUR], dash,
            from, at);
    if (!c->bare) mark(to, k, from + 14, at);
    label(to, from + 36, at + 4, "start", "", c->name);
}

static bool find_range(const pal_plot *plot, axis *x, axis *y)
{
    bool any = false;
    for (int k = 0; k < plot->n_curve; k++)
        for (int i = 0; i < plot->curve[k].n; i++) {
            const pal_curve *c = &plot->curve[k];
            if (!drawable(plot, c, i)) continue;
            double sx = scaled(x, c->x[i]), sy = scaled(y, c->y[i]);
            x->low = any ? fmin(x->low, sx) : sx, x->high = any ? fmax(x->high, sx) : sx;
            y->low = any ? fmin(y->low, sy) : sy, y->high = any ? fmax(y->high, sy) : sy;
            any = true;
        }
    return any;
}

pal_err pal_plot_write(const pal_plot *plot, const char *path, pal_note *note)
{
    axis x = {.log = plot->log_x, .from = LEFT, .to = WIDE - RIGHT};
    axis y = {.log = plot->log_y, .from = HIGH - BOTTOM, .to = TOP};
    if (!find_range(plot, &x, &y)) return pal_note_set(note, PAL_ERR_REFUSED, "%s: there is no point to draw", path);
    settle(&x);
    settle(&y);
    pal_svg svg;
    PAL_TRY(pal_svg_begin(&svg, WIDE, HIGH, note));
    FILE *to = svg.to;
    draw_axes(to, plot, &x, &y);
    for (int k = 0; k < plot->n_curve; k++) draw_curve(to, plot, k, &x, &y);
    return pal_svg_end(&svg, path, note);
}
