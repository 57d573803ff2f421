/* Plots: what is drawn stands where arithmetic says, axes have the round numbers a reader expects, and nothing that a
 * name holds gets out of its text. */
#include "server/figure/plot.h"
#include "tests/check.h"

/* the frame of plot.c: 84 left of it, 46 above, 466 wide, 372 high */
static const double left = 84, top = 46, wide = 466, high = 372;

static char *draw(const pal_plot *plot)
{
    char path[] = "/tmp/palpate_plot_XXXXXX";
    int fd = mkstemp(path);
    if (fd < 0) return NULL;
    close(fd);
    pal_diagnostic diag = {""};
    pal_err err = pal_plot_write(plot, path, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    FILE *in = fopen(path, "rb");
    char *text = calloc(1, 1 << 16);
    if (in && text && fread(text, 1, (1 << 16) - 1, in) == 0) CHECK_FAIL("the file is empty");
    if (in) fclose(in);
    unlink(path);
    return text;
}

static int count(const char *text, const char *word)
{
    int n = 0;
    for (const char *at = text; (at = strstr(at, word)); at += strlen(word)) n++;
    return n;
}

/* is there a tick of this text? */
static bool has_tick(const char *text, const char *number)
{
    char want[64];
    snprintf(want, sizeof want, "\">%s</text>", number);
    return strstr(text, want) != NULL;
}

static void expect_ticks(const char *text, const char *list)
{
    char copy[256], *save = NULL;
    snprintf(copy, sizeof copy, "%s", list);
    for (char *word = strtok_r(copy, " ", &save); word; word = strtok_r(NULL, " ", &save))
        if (!has_tick(text, word)) CHECK_FAIL("no tick %s of %s", word, list);
    check_count++;
}

static bool has_circle(const char *text, double x, double y)
{
    char want[64];
    snprintf(want, sizeof want, "<circle cx=\"%.1f\" cy=\"%.1f\"", x, y);
    return strstr(text, want) != NULL;
}

static void linear_axes_have_round_ticks_and_marks_in_their_places(void)
{
    const double x[] = {0, 3, 7}, y[] = {-1, 0.5, 2};
    pal_plot plot = {.title = "t", .x_label = "time s", .y_label = "force N", .n_curve = 1};
    plot.curve[0] = (pal_curve){.name = "one", .n = 3, .x = x, .y = y};
    char *text = draw(&plot);
    REQUIRE(text);
    /* 7 / 6 rounds up to steps of 2, 3 / 6 to 0.5; axes end at whole steps */
    expect_ticks(text, "0 2 4 6 8");
    expect_ticks(text, "-1 -0.5 0.5 1 1.5");
    CHECK(!has_tick(text, "10") && !has_tick(text, "3") && !has_tick(text, "2.5"));
    for (int i = 0; i < 3; i++) CHECK(has_circle(text, left + wide * x[i] / 8, top + high - high * (y[i] + 1) / 3));
    CHECK_INT(count(text, "<circle"), 4); /* and one in the legend */
    CHECK(strstr(text, ">time s</text>") && strstr(text, ">force N</text>") && strstr(text, ">one</text>"));
    CHECK(!strncmp(text, "<svg ", 5) && !strcmp(text + strlen(text) - 7, "</svg>\n"));
    free(text);
}

static void logarithmic_axes_leave_out_what_has_no_logarithm(void)
{
    const double x[] = {1, 10, 100, 1000}, y[] = {1, 0, -1, NAN}, whole[] = {1, 0.1, 0.01, 0.001};
    pal_plot plot = {.title = "t", .x_label = "n", .y_label = "e", .log_x = true, .log_y = true, .n_curve = 2};
    plot.curve[0] = (pal_curve){.name = "whole", .n = 4, .x = x, .y = whole};
    plot.curve[1] = (pal_curve){.name = "holes", .n = 4, .x = x, .y = y, .dashed = true};
    char *text = draw(&plot);
    REQUIRE(text);
    expect_ticks(text, "1 10 100 1000 0.1 0.01 0.001");
    CHECK(!has_tick(text, "2") && !has_tick(text, "50")); /* more than two decades: whole ones only */
    double margin = 0.06 * 3 + 0.02, span = 3 + 2 * margin;
    for (int i = 0; i < 4; i++)
        CHECK(has_circle(text, left + wide * (margin + i) / span, top + high * (margin + i) / span));
    CHECK_INT(count(text, "<circle"), 5);
    CHECK_INT(count(text, "width=\"7\""), 2); /* squares: one point is left, and the legend */
    CHECK_INT(count(text, "stroke-dasharray"), 2);
    CHECK(strstr(text, "nan") == NULL && strstr(text, "inf") == NULL);
    free(text);
}

static void few_decades_have_ticks_between_and_many_are_thinned(void)
{
    const double x[] = {1, 30}, y[] = {1e-9, 1e9};
    pal_plot plot = {.title = "t", .x_label = "n", .y_label = "e", .log_x = true, .log_y = true, .n_curve = 1};
    plot.curve[0] = (pal_curve){.name = "c", .n = 2, .x = x, .y = y};
    char *text = draw(&plot);
    REQUIRE(text);
    expect_ticks(text, "1 2 5 10 20");
    expect_ticks(text, "1e-08 0.0001 10000 1e+08");
    CHECK_LE(count(text, "text-anchor=\"end\""), 12);
    CHECK(count(text, "text-anchor=\"end\"") >= 4);
    free(text);
    /* a single value still has an axis around it */
    const double same[] = {5, 5};
    plot = (pal_plot){.title = "t", .x_label = "n", .y_label = "e", .log_x = true, .n_curve = 1};
    plot.curve[0] = (pal_curve){.name = "c", .n = 2, .x = same, .y = same, .bare = true};
    text = draw(&plot);
    REQUIRE(text);
    CHECK(strstr(text, "nan") == NULL && strstr(text, "inf") == NULL);
    CHECK_INT(count(text, "<circle"), 0);
    expect_ticks(text, "4.6 4.8 5.2 5.4");
    free(text);
}

static void names_cannot_leave_their_text(void)
{
    const double x[] = {1}, y[] = {1};
    pal_plot plot = {.title = "a < b & c", .x_label = "</text><script>", .y_label = "&lt;", .n_curve = 1};
    plot.curve[0] = (pal_curve){.name = "<g>&", .n = 1, .x = x, .y = y};
    char *text = draw(&plot);
    REQUIRE(text);
    CHECK(strstr(text, "a &lt; b &amp; c</text>") != NULL);
    CHECK(strstr(text, ">&lt;/text>&lt;script></text>") != NULL);
    CHECK(strstr(text, ">&amp;lt;</text>") != NULL);
    CHECK(strstr(text, ">&lt;g>&amp;</text>") != NULL);
    CHECK(strstr(text, "<script") == NULL);
    free(text);
}

/* the boxes of all small texts, 6.2 pixels a character, 11 high */
static int small_texts(const char *text, double box[][4], int max)
{
    int n = 0;
    for (const char *at = text; n < max && (at = strstr(at, "<text x=")); at++) {
        double x, y;
        const char *end = strchr(at, '>'), *stop = end ? strchr(end, '<') : NULL;
        if (!stop || sscanf(at, "<text x=\"%lf\" y=\"%lf\"", &x, &y) != 2) continue;
        if (!strstr(at, "font-size=\"11\"") || strstr(at, "font-size=\"11\"") > end) continue;
        double long_px = 6.2 * (double)(stop - end - 1);
        if (strstr(at, "text-anchor=\"end\"") && strstr(at, "text-anchor=\"end\"") < end) x -= long_px;
        box[n][0] = x, box[n][1] = y - 9, box[n][2] = x + long_px, box[n++][3] = y + 2;
    }
    return n;
}

static void labels_keep_off_each_other_and_off_marks(void)
{
    enum { N = 40 };
    double x[N], y[N], box[N + 2][4];
    pal_plot_label l[N];
    for (int i = 0; i < N; i++) {
        /* four heaps of ten */
        x[i] = pow(10, i / 10 + 0.02 * (i % 10)), y[i] = pow(10, -i / 10 - 0.03 * (i * 7 % 10));
        l[i] = (pal_plot_label){x[i], y[i], "hex8_bbar 24"};
    }
    pal_plot plot = {.title = "t", .x_label = "ms", .y_label = "mm", .log_x = true, .log_y = true, .wide = 900};
    plot.n_curve = 1, plot.n_guide = 2, plot.n_label = N, plot.label = l;
    plot.curve[0] = (pal_curve){.name = "dots", .n = N, .x = x, .y = y, .dots = true};
    plot.guide[0] = (pal_plot_guide){.vertical = true, .at = 100, .text = "real time"};
    plot.guide[1] = (pal_plot_guide){.at = 1e-5, .text = "reference"};
    char *text = draw(&plot);
    REQUIRE(text);
    CHECK(strstr(text, "stroke-width=\"2\"") == NULL); /* dots have no line */
    int n = small_texts(text, box, N + 2);
    CHECK(n >= 20 + 2);
    for (int a = 0; a < n; a++) {
        CHECK(box[a][0] >= left && box[a][2] <= 900 - 210 && box[a][1] >= top && box[a][3] <= top + high);
        for (int b = 0; b < a; b++)
            CHECK(box[a][0] >= box[b][2] || box[b][0] >= box[a][2] || box[a][1] >= box[b][3] || box[b][1] >= box[a][3]);
        /* the guides' own texts come first */
        double low = log10(1e-5), span_y = 0 - low, margin = 0.06 * span_y + 0.02, span = span_y + 2 * margin;
        for (int i = 0; i < N && a > 1; i++) {
            double top_log = 0, py = top + high * (margin + top_log - log10(y[i])) / span;
            double from_x = 0.06 * 3.18 + 0.02, px = left + 606 * (from_x + log10(x[i])) / (3.18 + 2 * from_x);
            CHECK(px <= box[a][0] || px >= box[a][2] || py <= box[a][1] || py >= box[a][3]);
        }
    }
    /* the axis reaches a guide that no point reaches */
    CHECK(strstr(text, ">1e-05</text>") != NULL);
    free(text);
}

/* a label beside a line stays off it; a mark says what it is when pointed at, outlined ones are no filled ones */
static void labels_keep_off_lines_and_marks_have_tips(void)
{
    enum { N = 6 };
    double x[N], y[N], box[N + 1][4];
    static const char *const tip[N] = {"a < b", "1", "2", "3", "4", "5"};
    pal_plot_label l[N];
    for (int i = 0; i < N; i++) {
        x[i] = i, y[i] = -i;
        l[i] = (pal_plot_label){x[i], y[i], "16 voxels, to 1e-01"};
    }
    pal_plot plot = {.title = "t", .x_label = "ms", .y_label = "mm", .wide = 900, .n_curve = 2, .n_label = N};
    plot.label = l;
    plot.curve[0] = (pal_curve){.name = "front", .n = N, .x = x, .y = y, .bare = true, .ink = true};
    plot.curve[1] = (pal_curve){.name = "dots", .n = N, .x = x, .y = y, .dots = true, .hollow = true, .tip = tip};
    char *text = draw(&plot);
    REQUIRE(text);
    int n = small_texts(text, box, N + 1);
    /* the line goes from corner to corner of the axes, both of 0 to 5, where there is no room for the outer two */
    CHECK_INT(n, N - 2);
    for (int a = 0; a < n; a++)
        for (double t = 0; t <= 1; t += 1e-3) {
            double px = left + (900 - 210 - left) * t, py = top + high * t;
            CHECK(px <= box[a][0] || px >= box[a][2] || py <= box[a][1] || py >= box[a][3]);
        }
    CHECK(strstr(text, "<title>a &lt; b</title>") && strstr(text, "<title>5</title>"));
    CHECK(strstr(text, "fill=\"#fff\" stroke=\"#0072b2\"") != NULL);
    free(text);
}

static void nothing_to_draw_and_nowhere_to_write_are_refused(void)
{
    const double x[] = {0, -1, INFINITY}, y[] = {1, 1, 1};
    char path[] = "/tmp/palpate_no_plot_XXXXXX";
    pal_diagnostic diag = {""};
    int fd = mkstemp(path);
    REQUIRE(fd >= 0);
    close(fd);
    unlink(path);
    pal_plot plot = {.title = "t", .x_label = "x", .y_label = "y"};
    CHECK_INT(pal_plot_write(&plot, path, &diag), PAL_ERR_REFUSED);
    plot.n_curve = 1, plot.log_x = true;
    plot.curve[0] = (pal_curve){.name = "c", .n = 3, .x = x, .y = y};
    CHECK_INT(pal_plot_write(&plot, path, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, path) && strstr(diag.text, "no point to draw"));
    CHECK(access(path, F_OK) != 0);
    plot.log_x = false; /* two of three are drawable now */
    CHECK_INT(pal_plot_write(&plot, "/nowhere/at/all.svg", &diag), PAL_ERR_IO);
    CHECK(strstr(diag.text, "/nowhere/at/all.svg") != NULL);
}

int main(void)
{
    RUN(linear_axes_have_round_ticks_and_marks_in_their_places);
    RUN(logarithmic_axes_leave_out_what_has_no_logarithm);
    RUN(few_decades_have_ticks_between_and_many_are_thinned);
    RUN(names_cannot_leave_their_text);
    RUN(labels_keep_off_each_other_and_off_marks);
    RUN(labels_keep_off_lines_and_marks_have_tips);
    RUN(nothing_to_draw_and_nowhere_to_write_are_refused);
    return check_report();
}
