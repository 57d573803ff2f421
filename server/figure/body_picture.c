/* Pictures of bodies: ranges and frames that pictures share, then the panels, each from back to front: surface and held
 * dots, outline at rest, arrows, legend, axes, colour bar. */
#include "server/figure/body_picture.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/figure/picture_faces.h"
#include "server/figure/svg.h"
#include "server/num/sort.h"

enum { WIDE = 400, TALLEST = 360, LOWEST = 150, PAD = 14, TITLE = 34, LEGEND = 22, FOOT = 66, MARGIN = 14 };
enum { PIECES_A_FILE = 16000, ARROWS_MAX = 60, CORNERS_MAX = 50000000 };
static const double arrow_share = 0.17; /* longest arrow over the diagonal of what is drawn */

static const uint8_t plain[3] = {0xd8, 0xcc, 0xc4};
static const char *const held_ink = "#1f5fd6", *const load_ink = "#0b7a2a";
static const char *const outline_ink = "#30343a", *const crease_ink = "#6a7078", *const rest_ink = "#8a94a3";

typedef struct panel {
    const pal_body_picture *p;
    pal_picture_mesh mesh;
    pal_picture_piece *piece;
    pal_picture_line *ghost;
    int n_piece, n_ghost;
    double middle[3];  /* of the body, m                       */
    bool ranged, grey; /* a value to colour; one that has no colour */
    double from, to;   /* range of colours: values, or their log10 */
    double left;       /* of the drawing on the page, px           */
} panel;

typedef struct sheet {
    int n;
    panel panel[PAL_BODY_PICTURES];
    pal_picture_axes axes;
    double low[2], high[2]; /* what is drawn, along right and up, m */
    double span_m;          /* diagonal of the bodies alone         */
    double px_m, top, tall; /* scale; upper edge and height of the drawings, px */
    double load_max_N;      /* of all */
    bool titled, legend;
} sheet;

/* ---- colours ---- */

/* the stops of clients/viewer/src/colour_maps.js: viridis (Smith and van der Walt 2015) without its darkest eighth */
static const uint8_t stop[9][3] = {{0x47, 0x2e, 0x7c}, {0x3c, 0x4f, 0x8a}, {0x2f, 0x6b, 0x8d},
                                   {0x25, 0x86, 0x8d}, {0x25, 0xa0, 0x86}, {0x3d, 0xb9, 0x74},
                                   {0x73, 0xce, 0x55}, {0xb7, 0xdd, 0x2f}, {0xfd, 0xe7, 0x25}};
static const uint8_t grey[3] = {0xa3, 0xa3, 0xa3};

void pal_body_picture_colour(double t, uint8_t rgb[3])
{
    memcpy(rgb, grey, 3);
    if (isnan(t)) return;
    double s = 8 * fmin(1, fmax(0, t));
    int k = s < 7 ? (int)s : 7;
    for (int c = 0; c < 3; c++) rgb[c] = (uint8_t)lround(stop[k][c] + (s - k) * (stop[k + 1][c] - stop[k][c]));
}

static double scaled(const pal_body_picture *p, double value)
{
    if (p->log) return value > 0 ? log10(value) : NAN;
    return value;
}

static bool same_text(const char *a, const char *b)
{
    return strcmp(a ? a : "", b ? b : "") == 0;
}

/* range of the values themselves; false: there is none */
static bool value_range(panel *g)
{
    const pal_body_picture *p = g->p;
    g->from = INFINITY, g->to = -INFINITY;
    for (int i = 0; i < 3 * p->n_tri && p->value; i++) {
        double v = scaled(p, p->value[p->tri[i]]);
        if (isfinite(v)) g->from = fmin(g->from, v), g->to = fmax(g->to, v);
        g->grey |= !isfinite(v);
    }
    return g->from <= g->to;
}

/* the range that is shown: as given, or round numbers around the values of all pictures of this quantity */
static void settle_range(panel *g)
{
    const pal_body_picture *p = g->p;
    double low = scaled(p, p->low), high = scaled(p, p->high);
    if (p->low < p->high && isfinite(low) && isfinite(high) && low < high) {
        g->from = low, g->to = high;
        return;
    }
    if (p->log) {
        if (g->to - g->from < 0.3) g->from -= 0.15, g->to += 0.15;
        return;
    }
    if (g->from > 0 && g->from <= 0.55 * g->to) g->from = 0;
    if (!(g->to - g->from > 1e-9 * fmax(fabs(g->from), fabs(g->to)))) {
        double around = g->to != 0 ? 0.1 * fabs(g->to) : 1;
        g->from -= around, g->to += around;
    }
    double step = pal_svg_step(g->to - g->from, 10);
    g->from = step * floor(g->from / step + 1e-6), g->to = step * ceil(g->to / step - 1e-6);
}

static void find_ranges(sheet *page)
{
    double from[PAL_BODY_PICTURES], to[PAL_BODY_PICTURES];
    for (int i = 0; i < page->n; i++) {
        panel *g = &page->panel[i];
        g->ranged = value_range(g);
        from[i] = g->from, to[i] = g->to;
    }
    for (int i = 0; i < page->n; i++) {
        panel *g = &page->panel[i];
        for (int j = 0; j < page->n; j++) {
            const pal_body_picture *a = g->p, *b = page->panel[j].p;
            bool same = a->value && b->value && a->log == b->log && same_text(a->value_title, b->value_title) &&
                        same_text(a->unit, b->unit);
            if (same) g->from = fmin(g->from, from[j]), g->to = fmax(g->to, to[j]);
        }
        if (g->ranged) settle_range(g);
    }
}

/* ---- what is drawn ---- */

static pal_err check_picture(const pal_body_picture *p, int index, const char *path, pal_diagnostic *diag)
{
    if (p->n_tri <= 0 || p->n_vertex <= 0 || !p->x || !p->tri)
        return PAL_REFUSE(diag, "%s: picture %d has nothing to draw", path, index + 1);
    if (p->n_tri > CORNERS_MAX || p->n_vertex > CORNERS_MAX)
        return PAL_REFUSE(diag, "%s: picture %d has %d triangles of %d vertices, at most %d go", path, index + 1,
                          p->n_tri, p->n_vertex, CORNERS_MAX);
    for (int i = 0; i < 3 * p->n_tri; i++)
        if (p->tri[i] < 0 || p->tri[i] >= p->n_vertex)
            return PAL_REFUSE(diag, "%s: picture %d, triangle %d: no vertex %d among %d", path, index + 1, i / 3,
                              p->tri[i], p->n_vertex);
    for (int i = 0; i < p->n_vertex; i++)
        for (int k = 0; k < 3; k++) {
            double x = p->x[3 * i + k], rest = p->rest ? p->rest[3 * i + k] : 0;
            if (!(fabs(x) < 1e12 && fabs(rest) < 1e12))
                return PAL_REFUSE(diag, "%s: picture %d, vertex %d is at %g m", path, index + 1, i,
                                  fabs(x) < 1e12 ? rest : x);
        }
    for (int i = 0; i < 3 * p->n_load; i++)
        if (!(fabs(p->load_at[i]) < 1e12) || !isfinite(p->load_N[i]))
            return PAL_REFUSE(diag, "%s: picture %d, load %d is not finite", path, index + 1, i / 3);
    return PAL_ERR_OK;
}

static pal_err copy_mesh(panel *g)
{
    const pal_body_picture *p = g->p;
    pal_picture_mesh *m = &g->mesh;
    pal_err err = PAL_ERR_OK;
    size_t n = 3 * (size_t)p->n_vertex, n_tri = 3 * (size_t)p->n_tri;
    *m = (pal_picture_mesh){.surface = {.n_vertex = p->n_vertex, .n_tri = p->n_tri}};
    PAL_ARRAY(&err, m->surface.x, n);
    PAL_ARRAY(&err, m->value, p->n_vertex);
    PAL_ARRAY(&err, m->surface.tri, n_tri);
    if (p->rest) PAL_ARRAY(&err, m->rest, n);
    if (err) return err;
    memcpy(m->surface.x, p->x, n * sizeof *p->x);
    memcpy(m->surface.tri, p->tri, n_tri * sizeof *p->tri);
    if (p->rest) memcpy(m->rest, p->rest, n * sizeof *m->rest);
    for (int i = 0; i < p->n_vertex; i++) {
        double t = g->ranged ? (scaled(p, p->value[i]) - g->from) / (g->to - g->from) : NAN;
        m->value[i] = isfinite(t) ? fmin(2, fmax(-1, t)) : NAN;
    }
    return PAL_ERR_OK;
}

static void take_in(sheet *page, const double x[3])
{
    double at[3];
    pal_picture_project(&page->axes, x, at);
    for (int k = 0; k < 2; k++) {
        page->low[k] = fmin(page->low[k], at[k]);
        page->high[k] = fmax(page->high[k], at[k]);
    }
}

/* loads are thinned evenly */
static int load_step(const pal_body_picture *p)
{
    return p->n_load > ARROWS_MAX ? (p->n_load + ARROWS_MAX - 1) / ARROWS_MAX : 1;
}

/* the ends of an arrow, m: a force towards the middle of the body ends at its place, another begins there */
static void arrow_ends(const sheet *page, const panel *g, int load, double from[3], double to[3])
{
    const double *at = g->p->load_at + 3 * load, *force = g->p->load_N + 3 * load;
    double inward[3], along[3];
    pal_scale3(along, arrow_share / page->load_max_N, force);
    pal_sub3(inward, g->middle, at);
    bool pushes = pal_dot3(inward, along) > 0.3 * pal_norm3(inward) * pal_norm3(along);
    pal_copy3(from, at);
    pal_copy3(to, at);
    pal_axpy3(pushes ? from : to, pushes ? -page->span_m : page->span_m, along);
}

/* one frame and scale that hold the bodies and arrows of all pictures */
static void settle_frame(sheet *page)
{
    page->low[0] = page->low[1] = INFINITY, page->high[0] = page->high[1] = -INFINITY;
    for (int k = 0; k < page->n; k++) {
        panel *g = &page->panel[k];
        const pal_body_picture *p = g->p;
        for (int i = 0; i < 3 * p->n_tri; i++) {
            const int32_t v = p->tri[i];
            take_in(page, p->x + 3 * v);
            if (p->rest) take_in(page, p->rest + 3 * v);
            pal_axpy3(g->middle, 1.0 / (3 * p->n_tri), p->x + 3 * v);
        }
        for (int l = 0; l < p->n_load; l += load_step(p))
            page->load_max_N = fmax(page->load_max_N, pal_norm3(p->load_N + 3 * l));
    }
    page->span_m = hypot(page->high[0] - page->low[0], page->high[1] - page->low[1]);
    for (int k = 0; k < page->n; k++) {
        const panel *g = &page->panel[k];
        for (int l = 0; l < g->p->n_load && page->load_max_N > 0; l += load_step(g->p)) {
            double from[3], to[3];
            arrow_ends(page, g, l, from, to);
            take_in(page, from);
            take_in(page, to);
        }
    }
    double wide = fmax(page->high[0] - page->low[0], 1e-12), tall = fmax(page->high[1] - page->low[1], 1e-12);
    page->px_m = fmin((WIDE - 2 * PAD) / wide, (TALLEST - 2 * PAD) / tall);
    page->tall = fmax(LOWEST, tall * page->px_m + 2 * PAD);
}

/* ---- drawing ---- */

/* tenths of a pixel within the drawing */
static void place(const sheet *page, const double at[2], int out[2])
{
    double x = WIDE / 2.0 + page->px_m * (at[0] - (page->low[0] + page->high[0]) / 2);
    double y = page->tall / 2 - page->px_m * (at[1] - (page->low[1] + page->high[1]) / 2);
    out[0] = (int)lround(10 * x), out[1] = (int)lround(10 * y);
}

/* lines of one ink or triangles of one colour that follow each other are one path */
typedef struct path_pen {
    FILE *to;
    int ink; /* class and shade of triangles, or one of these; OFF: no path is open */
} path_pen;
enum { OFF = -1, OUTLINE = 1 << 20, CREASE };

static void pen_up(path_pen *pen)
{
    if (pen->ink != OFF) fputs("\"/>\n", pen->to);
    pen->ink = OFF;
}

static void pen_down(path_pen *pen, int ink)
{
    if (pen->ink == ink) return;
    pen_up(pen);
    pen->ink = ink;
    if (ink >= OUTLINE) {
        fprintf(pen->to, "<path class=\"%s\" d=\"", ink == OUTLINE ? "outline" : "crease");
        return;
    }
    int class = ink / PAL_PICTURE_SHADES + PAL_PICTURE_GREY, shade = ink % PAL_PICTURE_SHADES;
    uint8_t rgb[3];
    pal_body_picture_colour(class == PAL_PICTURE_GREY ? NAN : (double)class / (PAL_PICTURE_CLASSES - 1), rgb);
    if (class == PAL_PICTURE_CLASSES) memcpy(rgb, plain, 3);
    double lit = 0.62 + 0.38 * shade / (PAL_PICTURE_SHADES - 1);
    unsigned colour = 0;
    for (int c = 0; c < 3; c++) colour = colour << 8 | (unsigned)lround(lit * rgb[c]);
    fprintf(pen->to, "<path fill=\"#%06x\" stroke=\"#%06x\" d=\"", colour, colour);
}

static void draw_piece(const sheet *page, const panel *g, path_pen *pen, const pal_picture_piece *piece)
{
    int at[3][2];
    for (int k = 0; k < 3; k++) place(page, piece->at[k], at[k]);
    int class = g->p->value ? piece->colour : PAL_PICTURE_CLASSES;
    pen_down(pen, (class - PAL_PICTURE_GREY) * PAL_PICTURE_SHADES + piece->shade);
    fprintf(pen->to, "M%d %dl%d %d %d %dz", at[0][0], at[0][1], at[1][0] - at[0][0], at[1][1] - at[0][1],
            at[2][0] - at[1][0], at[2][1] - at[1][1]);
    for (int k = 0; k < 3; k++) {
        if (!((piece->outline | piece->crease) >> k & 1)) continue;
        const int *a = at[k], *b = at[(k + 1) % 3];
        pen_down(pen, piece->outline >> k & 1 ? OUTLINE : CREASE);
        fprintf(pen->to, "M%d %dL%d %d", a[0], a[1], b[0], b[1]);
    }
}

typedef struct dot {
    double depth;
    int at[2];
} dot;

static int by_depth(const void *a, const void *b)
{
    const dot *p = a, *q = b;
    return PAL_COMPARE(p->depth, q->depth);
}

/* the held vertices, a little towards the eye, so that their own triangles do not hide them; NULL: no memory */
static dot *make_dots(const sheet *page, const panel *g, int *n)
{
    const pal_body_picture *p = g->p;
    dot *d = malloc(sizeof *d * (size_t)p->n_vertex);
    for (int i = 0; i < p->n_vertex && p->fixed && d; i++) {
        if (!p->fixed[i]) continue;
        double at[3];
        pal_picture_project(&page->axes, p->x + 3 * i, at);
        d[*n].depth = at[2] + 0.04 * page->span_m;
        place(page, at, d[(*n)++].at);
    }
    if (d) qsort(d, (size_t)*n, sizeof *d, by_depth);
    return d;
}

static void draw_ghost(const sheet *page, const panel *g, const char *more, FILE *to)
{
    if (g->n_ghost == 0) return;
    fprintf(to, "<path class=\"rest\"%s d=\"", more);
    for (int i = 0; i < g->n_ghost; i++) {
        int a[2], b[2];
        place(page, g->ghost[i].from, a);
        place(page, g->ghost[i].to, b);
        fprintf(to, "M%d %dL%d %d", a[0], a[1], b[0], b[1]);
    }
    fputs("\"/>\n", to);
}

/* the shape at rest stands behind, and shines through a little */
static pal_err draw_body(const sheet *page, const panel *g, FILE *to)
{
    int n_dot = 0, done = 0;
    dot *d = make_dots(page, g, &n_dot);
    if (!d) return PAL_ERR_MEMORY;
    path_pen pen = {to, OFF};
    draw_ghost(page, g, "", to);
    for (int i = 0; i <= g->n_piece; i++) {
        for (; done < n_dot && (i == g->n_piece || d[done].depth < g->piece[i].depth); done++) {
            pen_up(&pen);
            fprintf(to, "<circle class=\"held\" cx=\"%d\" cy=\"%d\" r=\"%d\"/>\n", d[done].at[0], d[done].at[1],
                    n_dot > 300 ? 18 : 26);
        }
        if (i < g->n_piece) draw_piece(page, g, &pen, &g->piece[i]);
    }
    pen_up(&pen);
    free(d);
    draw_ghost(page, g, " opacity=\"0.35\"", to);
    return PAL_ERR_OK;
}

/* the shaft stops within the head, which ends at the tip */
static void draw_arrow(FILE *to, const int a[2], const int b[2])
{
    double dx = b[0] - a[0], dy = b[1] - a[1], long_ = hypot(dx, dy), ex = dx / long_, ey = dy / long_;
    double head = fmin(90, 0.6 * long_), half = 0.42 * head, x = b[0] - head * ex, y = b[1] - head * ey;
    fprintf(to, "<path d=\"M%d %dL%.0f %.0f\"/>", a[0], a[1], x + 0.3 * head * ex, y + 0.3 * head * ey);
    fprintf(to, "<path d=\"M%d %dL%.0f %.0fL%.0f %.0fz\"/>\n", b[0], b[1], x - half * ey, y + half * ex, x + half * ey,
            y - half * ex);
}

/* forces along the line of sight are a dot in a ring (towards the eye) or a cross in one, as physicists draw them */
static void draw_head_on(FILE *to, const int at[2], bool nearer)
{
    fprintf(to, "<circle cx=\"%d\" cy=\"%d\" r=\"52\" fill=\"#fff\"/>", at[0], at[1]);
    if (nearer)
        fprintf(to, "<circle cx=\"%d\" cy=\"%d\" r=\"14\" fill=\"%s\"/>\n", at[0], at[1], load_ink);
    else
        fprintf(to, "<path d=\"M%d %dl64 64m0 -64l-64 64\"/>\n", at[0] - 32, at[1] - 32);
}

static void draw_loads(const sheet *page, const panel *g, FILE *to)
{
    if (g->p->n_load <= 0 || page->load_max_N <= 0) return;
    for (int halo = 1; halo >= 0; halo--) {
        fprintf(to, "<g stroke=\"%s\" stroke-width=\"%d\" fill=\"%s\">\n", halo ? "#fff" : load_ink, halo ? 44 : 18,
                halo ? "#fff" : load_ink);
        for (int i = 0; i < g->p->n_load; i += load_step(g->p)) {
            double from[3], to3[3], p[3], q[3];
            int a[2], b[2];
            arrow_ends(page, g, i, from, to3);
            pal_picture_project(&page->axes, from, p);
            pal_picture_project(&page->axes, to3, q);
            place(page, p, a);
            place(page, q, b);
            if (hypot(b[0] - a[0], b[1] - a[1]) >= 40)
                draw_arrow(to, a, b);
            else if (!halo && pal_norm3(g->p->load_N + 3 * i) > 0.05 * page->load_max_N)
                draw_head_on(to, a, q[2] > p[2]);
        }
        fputs("</g>\n", to);
    }
}

/* ---- around the drawing ---- */

static void draw_styles(FILE *to)
{
    fprintf(to,
            "<style>.outline,.crease,.rest{fill:none}.outline{stroke:%s;stroke-width:12}"
            ".crease{stroke:%s;stroke-width:7}.rest{stroke:%s;stroke-width:11}.held{fill:%s;stroke:#fff}</style>\n",
            outline_ink, crease_ink, rest_ink, held_ink);
    fputs("<linearGradient id=\"map\">", to);
    for (int i = 0; i < 9; i++)
        fprintf(to, "<stop offset=\"%g\" stop-color=\"#%02x%02x%02x\"/>", i / 8.0, stop[i][0], stop[i][1], stop[i][2]);
    fputs("</linearGradient>\n", to);
}

static void draw_axes(const sheet *page, double x, double y, FILE *to)
{
    fputs("<g stroke=\"#555\" stroke-width=\"1.3\" font-size=\"11\">\n", to);
    for (int k = 0; k < 3; k++) {
        double dx = 20 * page->axes.right[k], dy = -20 * page->axes.up[k], size = hypot(dx, dy);
        char name[2] = {(char)('x' + k), 0};
        if (size < 3) continue;
        fprintf(to, "<path d=\"M%.1f %.1fl%.1f %.1f\"/>\n", x, y, dx, dy);
        pal_svg_text(to, x + dx * (size + 9) / size, y + dy * (size + 9) / size + 3.5, "middle",
                     " stroke=\"none\" fill=\"#444\"", name, 0);
    }
    fputs("</g>\n", to);
}

static void draw_bar(const panel *g, double x, double y, double wide, FILE *to)
{
    const pal_body_picture *p = g->p;
    fprintf(to, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"11\" rx=\"2\" fill=\"url(#map)\"/>\n", x, y, wide);
    double value[PAL_SVG_TICKS], last = -INFINITY;
    int n = p->log ? pal_svg_log_ticks(g->from, g->to, value)
                   : pal_svg_ticks(g->from, g->to, pal_svg_step(g->to - g->from, 5), value);
    for (int i = 0; i < n; i++) {
        double at = x + wide * (scaled(p, value[i]) - g->from) / (g->to - g->from);
        char text[32];
        int length = snprintf(text, sizeof text, "%g", value[i]);
        fprintf(to, "<path d=\"M%.1f %.1fv4\" stroke=\"#555\"/>\n", at, y + 11);
        if (at - 3.4 * length < last + 6) continue;
        pal_svg_text(to, at, y + 26, "middle", " font-size=\"11\"", text, 0);
        last = at + 3.4 * length;
    }
    char title[160];
    bool unit = p->unit && p->unit[0], named = p->value_title && p->value_title[0];
    snprintf(title, sizeof title, "%s%s%s", named ? p->value_title : "", named && unit ? ", " : "",
             unit ? p->unit : "");
    if (named || unit) pal_svg_text(to, x, y - 6, "start", " font-size=\"12\"", title, 44);
}

static void draw_legend(const sheet *page, const panel *g, double y, FILE *to)
{
    const pal_body_picture *p = g->p;
    const char *small = " font-size=\"11\" fill=\"#555\"";
    bool fixed = false;
    double x = g->left + PAD, max = 0;
    for (int i = 0; p->fixed && i < p->n_vertex && !fixed; i++) fixed = p->fixed[i];
    for (int i = 0; i < p->n_load; i += load_step(p)) max = fmax(max, pal_norm3(p->load_N + 3 * i));
    if (fixed) {
        fprintf(to, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\" fill=\"%s\"/>\n", x + 3, y - 4, held_ink);
        pal_svg_text(to, x + 11, y, "start", small, "held", 0);
        x += 50;
    }
    if (max > 0 && page->load_max_N > 0) {
        char text[48];
        int length = snprintf(text, sizeof text, "up to %.3g N", max);
        fprintf(to, "<path d=\"M%.1f %.1fh12v-3.5l7 4.2l-7 4.2v-3.5h-12z\" fill=\"%s\"/>\n", x, y - 4.7, load_ink);
        pal_svg_text(to, x + 24, y, "start", small, text, 0);
        x += 40 + 6.2 * length;
    }
    if (p->rest) {
        fprintf(to, "<path d=\"M%.1f %.1fh18\" stroke=\"%s\" stroke-width=\"1.4\"/>\n", x, y - 4, rest_ink);
        pal_svg_text(to, x + 24, y, "start", small, "at rest", 0);
        x += 74;
    }
    if (g->grey && p->value) {
        fprintf(to, "<rect x=\"%.1f\" y=\"%.1f\" width=\"9\" height=\"9\" fill=\"#%02x%02x%02x\"/>\n", x, y - 8,
                grey[0], grey[1], grey[2]);
        pal_svg_text(to, x + 14, y, "start", small, "no value", 0);
    }
}

static pal_err draw_panel(const sheet *page, const panel *g, FILE *to)
{
    double y = page->top;
    if (page->titled)
        pal_svg_text(to, g->left + WIDE / 2.0, MARGIN + 14, "middle", " font-size=\"15\" font-weight=\"600\"",
                     g->p->title, 50);
    if (page->legend) draw_legend(page, g, y - 8, to);
    fprintf(to,
            "<g transform=\"translate(%.0f %.0f) scale(0.1)\" stroke-width=\"10\" stroke-linejoin=\"round\" "
            "stroke-linecap=\"round\">\n",
            g->left, y);
    PAL_TRY(draw_body(page, g, to));
    draw_loads(page, g, to);
    fputs("</g>\n", to);
    y += page->tall;
    draw_axes(page, g->left + 42, y + FOOT / 2.0, to);
    if (g->ranged) draw_bar(g, g->left + 100, y + 24, WIDE - 130, to);
    return PAL_ERR_OK;
}

static pal_err prepare(sheet *page)
{
    for (int i = 0; i < page->n; i++) {
        panel *g = &page->panel[i];
        const pal_body_picture *p = g->p;
        page->titled |= p->title && p->title[0];
        page->legend |= p->fixed || p->n_load > 0 || p->rest;
        PAL_TRY(copy_mesh(g));
        PAL_TRY(pal_picture_mesh_prepare(&g->mesh, &page->axes, PIECES_A_FILE / page->n));
        PAL_TRY(pal_picture_pieces(&g->mesh, &page->axes, PIECES_A_FILE / page->n, &g->piece, &g->n_piece, &g->ghost,
                                   &g->n_ghost));
        page->legend |= g->grey && p->value;
    }
    for (int i = 0; i < page->n; i++) page->panel[i].left = MARGIN + i * (WIDE + MARGIN);
    page->top = MARGIN + (page->titled ? TITLE : 0) + (page->legend ? LEGEND : 0);
    return PAL_ERR_OK;
}

static pal_err draw(sheet *page, const char *path, pal_diagnostic *diag)
{
    find_ranges(page);
    settle_frame(page);
    pal_err err = prepare(page);
    if (err) return pal_diagnostic_set(diag, err, "%s: no memory for a picture", path);
    pal_svg svg;
    PAL_TRY(pal_svg_begin(&svg, MARGIN + page->n * (WIDE + MARGIN), page->top + page->tall + FOOT + MARGIN, diag));
    draw_styles(svg.to);
    for (int i = 0; i < page->n && !err; i++) err = draw_panel(page, &page->panel[i], svg.to);
    if (err) {
        fclose(svg.to);
        free(svg.text);
        return pal_diagnostic_set(diag, err, "%s: no memory for a picture", path);
    }
    return pal_svg_end(&svg, path, diag);
}

pal_err pal_body_picture_write(const pal_body_picture *picture, int n_picture, const char *path, pal_diagnostic *diag)
{
    if (n_picture < 1 || n_picture > PAL_BODY_PICTURES)
        return PAL_REFUSE(diag, "%s: %d pictures, 1 to %d go side by side", path, n_picture, PAL_BODY_PICTURES);
    sheet *page = calloc(1, sizeof *page);
    if (!page) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory for a picture", path);
    page->n = n_picture;
    pal_picture_axes_set(&page->axes, picture[0].view);
    pal_err err = PAL_ERR_OK;
    for (int i = 0; i < n_picture && !err; i++) {
        page->panel[i].p = &picture[i];
        err = check_picture(&picture[i], i, path, diag);
    }
    if (!err) err = draw(page, path, diag);
    for (int i = 0; i < n_picture; i++) {
        pal_picture_mesh_free(&page->panel[i].mesh);
        PAL_FREE(page->panel[i].piece, page->panel[i].ghost);
    }
    free(page);
    return err;
}
