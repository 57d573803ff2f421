/* Plots as SVG. One pass finds the range, then frame, ticks, curves and legend are written in that order. */
#include "server/lab/plot.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WIDE = 760, HIGH = 480, LEFT = 84, RIGHT = 210, TOP = 46, BOTTOM = 62, TICK_MOST = 12 };

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

/* round steps for linear axes: 1, 2 or 5 times a power of ten, at most 7 of them */
static double round_step(double span)
{
    double raw = span / 6, power = pow(10, floor(log10(raw))), lead = raw / power;
    return power * (lead <= 1 ? 1 : lead <= 2 ? 2 : lead <= 5 ? 5 : 10);
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
    double step = a->step = round_step(a->high - a->low);
    a->low = step * floor(a->low / step + 1e-9), a->high = step * ceil(a->high / step - 1e-9);
}

/* tick values, at most TICK_MOST; returns how many */
static int ticks(const axis *a, double value[TICK_MOST])
{
    int n = 0;
    if (!a->log) {
        double step = a->step;
        for (int i = 0; i < TICK_MOST && a->low + i * step <= a->high + 1e-6 * step; i++) {
            double v = a->low + i * step;
            value[n++] = fabs(v) < 1e-9 * step ? 0 : v;
        }
        return n;
    }
    /* whole decades, and 2 and 5 between them where there are few, thinned where there are many */
    static const double within[] = {1, 2, 5};
    int decades = (int)floor(a->high) - (int)ceil(a->low) + 1, every = decades > 6 ? (decades + 5) / 6 : 1;
    for (int d = (int)floor(a->low); d <= (int)ceil(a->high); d++)
        for (int k = 0; k < (decades <= 2 ? 3 : 1) && n < TICK_MOST; k++) {
            double v = within[k] * pow(10, d);
            if (log10(v) < a->low || log10(v) > a->high || (decades > 6 && d % every != 0)) continue;
            value[n++] = v;
        }
    return n;
}

static void put_text(FILE *to, const char *text)
{
    for (; *text; text++) switch (*text) {
        case '<':
            fputs("&lt;", to);
            break;
        case '&':
            fputs("&amp;", to);
            break;
        default:
            fputc(*text, to);
        }
}

static void label(FILE *to, double x, double y, const char *anchor, const char *more, const char *text)
{
    fprintf(to, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\"%s>", x, y, anchor, more);
    put_text(to, text);
    fputs("</text>\n", to);
}

static void draw_axes(FILE *to, const pal_plot *plot, const axis *x, const axis *y)
{
    double value[TICK_MOST];
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
    fprintf(to, "<path fill=\"none\" stroke-width=\"2\" stroke=\"%s\"%s d=\"", colour[k % N_COLOUR], dash);
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
    fprintf(to, "<path stroke-width=\"2\" stroke=\"%s\"%s d=\"M%.1f %.1fh28\"/>\n", colour[k % N_COLOUR], dash, from,
            at);
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
    char *text = NULL;
    size_t n_byte = 0;
    FILE *to = open_memstream(&text, &n_byte);
    if (!to) return PAL_ERR_MEMORY;
    fprintf(to,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" width=\"%d\" height=\"%d\" "
            "font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n"
            "<rect width=\"100%%\" height=\"100%%\" fill=\"#fff\"/>\n",
            WIDE, HIGH, WIDE, HIGH);
    draw_axes(to, plot, &x, &y);
    for (int k = 0; k < plot->n_curve; k++) draw_curve(to, plot, k, &x, &y);
    fputs("</svg>\n", to);
    bool whole = fclose(to) == 0;
    FILE *file = whole ? fopen(path, "wb") : NULL;
    whole = file && fwrite(text, 1, n_byte, file) == n_byte;
    if (file && fclose(file) != 0) whole = false;
    free(text);
    if (whole) return PAL_ERR_OK;
    int code = errno;
    if (file) remove(path);
    return pal_note_set(note, PAL_ERR_IO, "%s: %s", path, strerror(code));
}
