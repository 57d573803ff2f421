/* Plots as SVG. One pass finds the range, then frame, ticks, guides, curves, legend and labels are written in that
 * order. A label goes to the first of some places around its point where it meets nothing that was drawn. */
#include "server/figure/plot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WIDE = 760, HIGH = 480, LEFT = 84, RIGHT = 210, TOP = 46, BOTTOM = 62, BOXES = 2048, LINE_PIECE = 4 };

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

static void draw_axes(FILE *to, const pal_plot *plot, const axis *x, const axis *y)
{
    for (int vertical = 0; vertical < 2; vertical++) {
        double value[PAL_SVG_TICKS];
        const axis *a = vertical ? y : x;
        int n = a->log ? pal_svg_log_ticks(a->low, a->high, value) : pal_svg_ticks(a->low, a->high, a->step, value);
        for (int i = 0; i < n; i++) {
            char text[32];
            double p = place(a, value[i]);
            snprintf(text, sizeof text, "%g", value[i]);
            if (vertical) {
                fprintf(to, "<path d=\"M%.1f %.1fH%.1f\" stroke=\"#ddd\"/>\n", x->from, p, x->to);
                pal_svg_text(to, x->from - 8, p + 4, "end", "", text, 0);
            } else {
                fprintf(to, "<path d=\"M%.1f %.1fV%.1f\" stroke=\"#ddd\"/>\n", p, y->from, y->to);
                pal_svg_text(to, p, y->from + 18, "middle", "", text, 0);
            }
        }
    }
    fprintf(to, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"none\" stroke=\"#333\"/>\n", x->from,
            y->to, x->to - x->from, y->from - y->to);
    pal_svg_text(to, (x->from + x->to) / 2, plot->high - 16, "middle", "", plot->x_label, 0);
    char more[64];
    snprintf(more, sizeof more, " transform=\"rotate(-90 22 %d)\"", (TOP + plot->high - BOTTOM) / 2);
    pal_svg_text(to, 22, (TOP + plot->high - BOTTOM) / 2.0, "middle", more, plot->y_label, 0);
    pal_svg_text(to, (x->from + x->to) / 2, 26, "middle", " font-size=\"16\" font-weight=\"600\"", plot->title, 0);
}

/* tip NULL: none */
static void mark(FILE *to, int kind, bool hollow, const char *ink, double x, double y, const char *tip)
{
    static const char *const tag[] = {"circle", "rect", "path", "path"};
    char look[64];
    kind %= 4;
    if (hollow)
        snprintf(look, sizeof look, "fill=\"#fff\" stroke=\"%s\" stroke-width=\"1.4\"", ink);
    else
        snprintf(look, sizeof look, "fill=\"%s\"", ink);
    fprintf(to, "<%s ", tag[kind]);
    if (kind == 0)
        fprintf(to, "cx=\"%.1f\" cy=\"%.1f\" r=\"4\" %s", x, y, look);
    else if (kind == 1)
        fprintf(to, "x=\"%.1f\" y=\"%.1f\" width=\"7\" height=\"7\" %s", x - 3.5, y - 3.5, look);
    else if (kind == 2)
        fprintf(to, "d=\"M%.1f %.1fl4.6 8h-9.2z\" %s", x, y - 5, look);
    else
        fprintf(to, "d=\"M%.1f %.1fl4.8 4.8l-4.8 4.8l-4.8 -4.8z\" %s", x, y - 4.8, look);
    if (!tip) {
        fputs("/>\n", to);
        return;
    }
    fputs("><title>", to);
    pal_svg_escape(to, tip, strlen(tip));
    fprintf(to, "</title></%s>\n", tag[kind]);
}

static void draw_curve(FILE *to, const pal_plot *plot, int k, const axis *x, const axis *y)
{
    const pal_curve *c = &plot->curve[k];
    const char *dash = c->dashed ? " stroke-dasharray=\"6 4\"" : "";
    int kind = 0; /* number of the curve's colour: dark ones do not count */
    for (int i = 0; i < k; i++) kind += !plot->curve[i].ink;
    const char *width = c->thin ? "0.8\" stroke-opacity=\"0.6" : "2", *ink = c->ink ? "#222" : colour[kind % N_COLOUR];
    if (!c->dots) fprintf(to, "<path fill=\"none\" stroke-width=\"%s\" stroke=\"%s\"%s d=\"", width, ink, dash);
    bool pen = false;
    for (int i = 0; i < c->n && !c->dots; i++) {
        bool on = drawable(plot, c, i);
        if (on) fprintf(to, "%c%.1f %.1f", pen ? 'L' : 'M', place(x, c->x[i]), place(y, c->y[i]));
        pen = on;
    }
    if (!c->dots) fputs("\"/>\n", to);
    for (int i = 0; i < c->n && !c->bare; i++)
        if (drawable(plot, c, i))
            mark(to, kind, c->hollow, ink, place(x, c->x[i]), place(y, c->y[i]), c->tip ? c->tip[i] : NULL);
    double at = TOP + 14 + 22.0 * k, from = plot->wide - RIGHT + 16;
    if (!c->dots)
        fprintf(to, "<path stroke-width=\"%s\" stroke=\"%s\"%s d=\"M%.1f %.1fh28\"/>\n", width, ink, dash, from, at);
    if (!c->bare) mark(to, kind, c->hollow, ink, from + 14, at, NULL);
    pal_svg_text(to, from + 36, at + 4, "start", "", c->name, 0);
}

typedef struct box {
    double low[2], high[2];
} box;
typedef struct boxes {
    int n;
    box box[BOXES];
} boxes;

static void take(boxes *all, box b)
{
    if (all->n < BOXES) all->box[all->n++] = b;
}

static bool is_free(const boxes *all, const axis *x, const axis *y, const box *b)
{
    if (b->low[0] < x->from + 2 || b->high[0] > x->to - 2 || b->low[1] < y->to + 2 || b->high[1] > y->from - 2)
        return false;
    for (int k = 0; k < all->n; k++) {
        const box *o = &all->box[k];
        if (b->low[0] < o->high[0] && o->low[0] < b->high[0] && b->low[1] < o->high[1] && o->low[1] < b->high[1])
            return false;
    }
    return true;
}

/* of a text of font-size 11 whose base line begins at x, y */
static box box_of(double x, double y, const char *text)
{
    double wide = 6.2 * (double)strlen(text);
    return (box){{x - 1, y - 10}, {x + wide + 1, y + 3}};
}

static const char small_text[] = " font-size=\"11\" fill=\"#444\"";

static void draw_guides(FILE *to, const pal_plot *plot, const axis *x, const axis *y, boxes *all)
{
    for (int k = 0; k < plot->n_guide; k++) {
        const pal_plot_guide *g = &plot->guide[k];
        const axis *a = g->vertical ? x : y;
        if (!isfinite(g->at) || (a->log && g->at <= 0)) continue;
        double at = place(a, g->at), wide = 6.2 * (double)strlen(g->text);
        static const char dash[] = "stroke=\"#666\" stroke-dasharray=\"5 4\"";
        if (g->vertical) {
            /* the text on that side of the line which has the room */
            double from = at + 6 + wide < x->to ? at + 6 : at - 6 - wide;
            fprintf(to, "<path d=\"M%.1f %.1fV%.1f\" %s/>\n", at, y->from, y->to, dash);
            pal_svg_text(to, from, y->to + 14, "start", small_text, g->text, 0);
            take(all, box_of(from, y->to + 14, g->text));
            take(all, (box){{at - 1, y->to}, {at + 1, y->from}});
        } else {
            fprintf(to, "<path d=\"M%.1f %.1fH%.1f\" %s/>\n", x->from, at, x->to, dash);
            double base = at - 5 - 10 > y->to ? at - 5 : at + 13;
            pal_svg_text(to, x->from + 6, base, "start", small_text, g->text, 0);
            take(all, box_of(x->from + 6, base, g->text));
            take(all, (box){{x->from, at - 1}, {x->to, at + 1}});
        }
    }
}

static void draw_label(FILE *to, const pal_plot_label *l, const axis *x, const axis *y, boxes *all)
{
    /* sides of the point and distances from it */
    static const double side[8][2] = {{1, 0},       {0.7, -0.7}, {0.7, 0.7}, {-1, 0},
                                      {-0.7, -0.7}, {-0.7, 0.7}, {0, -1},    {0, 1}};
    static const double away[] = {9, 18, 30, 46, 64, 86};
    double px = place(x, l->x), py = place(y, l->y), wide = 6.2 * (double)strlen(l->text);
    for (size_t ring = 0; ring < sizeof away / sizeof *away; ring++)
        for (int k = 0; k < 8; k++) {
            double ax = px + away[ring] * side[k][0], ay = py + away[ring] * side[k][1];
            double from = side[k][0] > 0 ? ax : side[k][0] < 0 ? ax - wide : ax - wide / 2;
            double base = ay + (side[k][1] > 0.9 ? 8 : side[k][1] < -0.9 ? 0 : 4);
            box b = box_of(from, base, l->text);
            if (!is_free(all, x, y, &b)) continue;
            take(all, b);
            if (ring > 0)
                fprintf(to, "<path stroke=\"#999\" stroke-width=\"0.7\" d=\"M%.1f %.1fL%.1f %.1f\"/>\n", px, py, ax,
                        ay);
            /* left of its point it ends there: the width is a guess */
            if (side[k][0] < 0)
                pal_svg_text(to, ax, base, "end", small_text, l->text, 0);
            else
                pal_svg_text(to, from, base, "start", small_text, l->text, 0);
            return;
        }
}

/* lines, as small boxes along them */
static void take_line(const pal_plot *plot, const pal_curve *c, const axis *x, const axis *y, boxes *all)
{
    for (int i = 1; i < c->n && !c->dots; i++) {
        if (!drawable(plot, c, i - 1) || !drawable(plot, c, i)) continue;
        double ax = place(x, c->x[i - 1]), ay = place(y, c->y[i - 1]);
        double bx = place(x, c->x[i]), by = place(y, c->y[i]);
        int n = (int)(fmax(fabs(bx - ax), fabs(by - ay)) / LINE_PIECE) + 1;
        for (int k = 0; k <= n; k++) {
            double px = ax + (bx - ax) * k / n, py = ay + (by - ay) * k / n;
            take(all, (box){{px - 2, py - 2}, {px + 2, py + 2}});
        }
    }
}

static void draw_labels(FILE *to, const pal_plot *plot, const axis *x, const axis *y, boxes *all)
{
    for (int k = 0; k < plot->n_curve; k++)
        for (int i = 0; i < plot->curve[k].n && !plot->curve[k].bare; i++) {
            const pal_curve *c = &plot->curve[k];
            if (!drawable(plot, c, i)) continue;
            double px = place(x, c->x[i]), py = place(y, c->y[i]);
            take(all, (box){{px - 5, py - 5}, {px + 5, py + 5}});
        }
    for (int k = 0; k < plot->n_curve && plot->n_label > 0; k++) take_line(plot, &plot->curve[k], x, y, all);
    for (int k = 0; k < plot->n_label; k++) {
        const pal_plot_label *l = &plot->label[k];
        bool there = isfinite(l->x) && isfinite(l->y) && (!x->log || l->x > 0) && (!y->log || l->y > 0);
        if (there) draw_label(to, l, x, y, all);
    }
}

static void reach(axis *a, double value)
{
    if (!isfinite(value) || (a->log && value <= 0)) return;
    a->low = fmin(a->low, scaled(a, value)), a->high = fmax(a->high, scaled(a, value));
}

static bool find_range(const pal_plot *plot, axis *x, axis *y)
{
    bool any = false;
    for (int k = 0; k < plot->n_curve; k++)
        for (int i = 0; i < plot->curve[k].n; i++) {
            const pal_curve *c = &plot->curve[k];
            if (!drawable(plot, c, i)) continue;
            reach(x, c->x[i]);
            reach(y, c->y[i]);
            any = true;
        }
    for (int k = 0; k < plot->n_guide; k++) reach(plot->guide[k].vertical ? x : y, plot->guide[k].at);
    return any;
}

static pal_err draw(const pal_plot *given, pal_svg *svg, pal_diagnostic *diag)
{
    pal_plot sized = *given;
    const pal_plot *plot = &sized;
    if (sized.wide <= 0) sized.wide = WIDE;
    if (sized.high <= 0) sized.high = HIGH;
    axis x = {.log = plot->log_x, .low = INFINITY, .high = -INFINITY, .from = LEFT, .to = plot->wide - RIGHT};
    axis y = {.log = plot->log_y, .low = INFINITY, .high = -INFINITY, .from = plot->high - BOTTOM, .to = TOP};
    if (!find_range(plot, &x, &y)) return PAL_REFUSE(diag, "there is no point to draw");
    settle(&x);
    settle(&y);
    boxes *taken = calloc(1, sizeof *taken);
    if (!taken) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a drawing");
    pal_err err = pal_svg_begin(svg, plot->wide, plot->high, diag);
    if (!err) {
        FILE *to = svg->to;
        draw_axes(to, plot, &x, &y);
        draw_guides(to, plot, &x, &y, taken);
        for (int k = 0; k < plot->n_curve; k++) draw_curve(to, plot, k, &x, &y);
        draw_labels(to, plot, &x, &y, taken);
    }
    free(taken);
    return err;
}

pal_err pal_plot_text(const pal_plot *plot, char **text, size_t *n_byte, pal_diagnostic *diag)
{
    pal_svg svg;
    PAL_TRY(draw(plot, &svg, diag));
    return pal_svg_end_text(&svg, text, n_byte, diag);
}

pal_err pal_plot_write(const pal_plot *plot, const char *path, pal_diagnostic *diag)
{
    pal_svg svg;
    pal_err err = draw(plot, &svg, diag);
    return err ? pal_diagnostic_prefix(diag, err, path) : pal_svg_end(&svg, path, diag);
}
