/* x: simulated seconds; y: energy above that at rest as a share of its largest value. */
#include "server/commands/robustness_picture.h"

#include "server/figure/svg.h"

#include <math.h>
#include <string.h>

enum { COLUMNS = 4, WIDE = 250, HIGH = 170, LEFT = 46, TOP = 40, HEAD = 44, PLOT_WIDE = 180, PLOT_HIGH = 92 };

static const char *colour_of(pal_verdict verdict)
{
    static const char *const colour[] = {"#009e73", "#d55e00", "#e69f00", "#999999", "#cc79a7"};
    return colour[verdict];
}

static void frame(FILE *to, double x, double y)
{
    fprintf(to, "<rect x=\"%g\" y=\"%g\" width=\"%d\" height=\"%d\" fill=\"none\" stroke=\"#999\"/>\n", x, y, PLOT_WIDE,
            PLOT_HIGH);
}

/* the range of the samples; false: nothing moved */
static bool range(const pal_robustness_result *r, double *seconds, double *low, double *high)
{
    *seconds = *low = *high = 0;
    for (int i = 0; i < r->n_sample; i++) {
        if (!isfinite(r->energy_J[i])) continue;
        *seconds = fmax(*seconds, r->time_s[i]);
        *low = fmin(*low, r->energy_J[i]), *high = fmax(*high, r->energy_J[i]);
    }
    /* a rounding error is no motion */
    if (*low > -1e-9 * *high) *low = 0;
    return *seconds > 0 && *high > 1e-20;
}

static void curve(FILE *to, const pal_robustness_result *r, double x, double y)
{
    double seconds, low, high;
    char text[40];
    frame(to, x, y);
    if (!range(r, &seconds, &low, &high)) {
        pal_svg_text(to, x + 0.5 * PLOT_WIDE, y + 0.5 * PLOT_HIGH, "middle", " font-size=\"11\" fill=\"#777\"",
                     r->verdict == PAL_VERDICT_SKIPPED ? "does not apply"
                     : r->frozen                       ? "stopped"
                                                       : "nothing moved",
                     0);
        return;
    }
    fprintf(to, "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"1.4\" points=\"", colour_of(r->verdict));
    for (int i = 0; i < r->n_sample; i++)
        if (isfinite(r->energy_J[i]))
            fprintf(to, "%.1f,%.1f ", x + PLOT_WIDE * r->time_s[i] / seconds,
                    y + PLOT_HIGH * (high - r->energy_J[i]) / (high - low));
    fprintf(to, "\"/>\n");
    snprintf(text, sizeof text, "%.2g", high);
    pal_svg_text(to, x - 4, y + 9, "end", " font-size=\"10\"", text, 0);
    snprintf(text, sizeof text, "%.2g", low);
    pal_svg_text(to, x - 4, y + PLOT_HIGH, "end", " font-size=\"10\"", text, 0);
    snprintf(text, sizeof text, "%.3g s", seconds);
    pal_svg_text(to, x + PLOT_WIDE, y + PLOT_HIGH + 13, "end", " font-size=\"10\"", text, 0);
}

pal_err pal_robustness_picture(const pal_robustness_report *report, const char *title, const char *path,
                               pal_diagnostic *diag)
{
    pal_svg svg;
    char text[80];
    int rows = (report->n + COLUMNS - 1) / COLUMNS;
    PAL_TRY(pal_svg_begin(&svg, COLUMNS * WIDE, HEAD + rows * HIGH, diag));
    pal_svg_text(svg.to, 16, 26, "start", " font-size=\"15\" font-weight=\"bold\"", title, 60);
    pal_svg_text(svg.to, COLUMNS * WIDE - 16, 26, "end", " font-size=\"12\"",
                 "energy above that at rest, J, over simulated time", 0);
    for (int k = 0; k < report->n; k++) {
        const pal_robustness_result *r = &report->result[k];
        double x = LEFT + k % COLUMNS * WIDE, y = HEAD + k / COLUMNS * HIGH + TOP - 14;
        snprintf(text, sizeof text, "%s: %s", r->name, pal_verdict_name(r->verdict));
        pal_svg_text(svg.to, x, y - 7, "start", " font-size=\"12\" font-weight=\"bold\"", text, 0);
        curve(svg.to, r, x, y);
    }
    return pal_svg_end(&svg, path, diag);
}
