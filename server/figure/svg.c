/* Text, ticks and files of drawings. */
#include "server/figure/svg.h"

#include "server/base/utf8.h"
#include "server/mesh/files/file_bytes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

pal_err pal_svg_begin(pal_svg *svg, double wide, double high, pal_diagnostic *diag)
{
    *svg = (pal_svg){0};
    svg->to = open_memstream(&svg->text, &svg->n_byte);
    if (!svg->to) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a drawing");
    fprintf(svg->to,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" width=\"%.0f\" height=\"%.0f\" "
            "font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n"
            "<rect width=\"100%%\" height=\"100%%\" fill=\"#fff\"/>\n",
            wide, high, wide, high);
    return PAL_ERR_OK;
}

pal_err pal_svg_end_text(pal_svg *svg, char **text, size_t *n_byte, pal_diagnostic *diag)
{
    fputs("</svg>\n", svg->to);
    bool whole = !ferror(svg->to);
    whole = fclose(svg->to) == 0 && whole;
    if (whole)
        *text = svg->text, *n_byte = svg->n_byte;
    else
        free(svg->text);
    *svg = (pal_svg){0};
    return whole ? PAL_ERR_OK : pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a drawing");
}

pal_err pal_svg_end(pal_svg *svg, const char *path, pal_diagnostic *diag)
{
    char *text = NULL;
    size_t n_byte = 0;
    PAL_TRY(pal_diagnostic_prefix(diag, pal_svg_end_text(svg, &text, &n_byte, diag), path));
    pal_err err = pal_file_write(path, text, n_byte, diag);
    free(text);
    return err;
}

void pal_svg_escape(FILE *to, const char *text, size_t n_byte)
{
    for (; n_byte > 0; text++, n_byte--)
        if (*text == '<')
            fputs("&lt;", to);
        else if (*text == '&')
            fputs("&amp;", to);
        else if (*text == '"')
            fputs("&quot;", to);
        else
            fputc(*text, to);
}

void pal_svg_text(FILE *to, double x, double y, const char *anchor, const char *more, const char *text, int max)
{
    fprintf(to, "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\"%s>", x, y, anchor, more);
    size_t n_byte = text ? strlen(text) : 0, at = 0;
    for (int k = 0; at < n_byte; k++) {
        uint32_t code = 0;
        int n = pal_utf8_next(text + at, n_byte - at, &code);
        bool shown = n > 0 && pal_utf8_printable(code) && code != 0xfffe && code != 0xffff;
        if (max > 0 && k == max - 1 && at + (size_t)(n > 0 ? n : 1) < n_byte) {
            fputs("\u2026", to);
            break;
        }
        pal_svg_escape(to, shown ? text + at : "?", shown ? (size_t)n : 1);
        at += (size_t)(n > 0 ? n : 1);
    }
    fputs("</text>\n", to);
}

double pal_svg_step(double span, int max)
{
    double raw = span / max, power = pow(10, floor(log10(raw))), lead = raw / power;
    return power * (lead <= 1 ? 1 : lead <= 2 ? 2 : lead <= 5 ? 5 : 10);
}

int pal_svg_ticks(double low, double high, double step, double value[PAL_SVG_TICKS])
{
    int n = 0;
    double first = step * ceil(low / step - 1e-6);
    for (int i = 0; i < PAL_SVG_TICKS && first + i * step <= high + 1e-6 * step; i++) {
        double v = first + i * step;
        value[n++] = fabs(v) < 1e-9 * step ? 0 : v;
    }
    return n;
}

int pal_svg_log_ticks(double low, double high, double value[PAL_SVG_TICKS])
{
    static const double within[] = {1, 2, 5};
    int n = 0;
    int decades = (int)floor(high) - (int)ceil(low) + 1, every = decades > 6 ? (decades + 5) / 6 : 1;
    for (int d = (int)floor(low); d <= (int)ceil(high); d++)
        for (int k = 0; k < (decades <= 2 ? 3 : 1) && n < PAL_SVG_TICKS; k++) {
            double v = within[k] * pow(10, d);
            if (log10(v) < low - 1e-9 || log10(v) > high + 1e-9 || (decades > 6 && d % every != 0)) continue;
            value[n++] = v;
        }
    return n;
}
