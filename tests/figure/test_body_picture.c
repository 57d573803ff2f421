/* Pictures of bodies: what is seen is drawn and nothing else, near things last, colours stand for their values, files
 * are well-formed and of a size that a page can hold. */
#include "server/figure/body_picture.h"
#include "tests/check.h"

#include <ctype.h>

/* the cube 0..1, outward */
static const double cube_x[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0},
                                    {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
static const int32_t cube_tri[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                        {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};

/* the file as text, or NULL after saying why; free() */
static char *draw(const pal_body_picture *picture, int n)
{
    char path[] = "/tmp/palpate_picture_XXXXXX";
    int fd = mkstemp(path);
    if (fd < 0) return NULL;
    close(fd);
    pal_diagnostic diag = {""};
    pal_err err = pal_body_picture_write(picture, n, path, &diag);
    if (err) CHECK_FAIL("%s", diag.text);
    size_t max = 4 << 20;
    FILE *in = err ? NULL : fopen(path, "rb");
    char *text = in ? calloc(1, max) : NULL;
    if (text && fread(text, 1, max - 1, in) == 0) CHECK_FAIL("the file is empty");
    if (in) fclose(in);
    unlink(path);
    return text;
}

/* well-formed as far as drawings need it: tags nest, attributes are quoted, & and < only as they may */
static bool is_well_formed(const char *at)
{
    char stack[16][32];
    int depth = 0, roots = 0;
    while (*at) {
        if (*at == '&') {
            if (strncmp(at, "&lt;", 4) && strncmp(at, "&amp;", 5)) return false;
        } else if (*at == '<') {
            bool end = at[1] == '/', alone = false;
            char name[32] = "";
            at += 1 + end;
            for (int k = 0; isalnum((unsigned char)*at) && k < 31; k++) name[k] = *at++;
            if (!name[0]) return false;
            for (; *at && *at != '>'; at++) {
                if (*at == '"') {
                    if (at[-1] != '=') return false;
                    for (at++; *at && *at != '"'; at++)
                        if (*at == '<') return false;
                }
                if (!*at || *at == '<') return false;
                alone = *at == '/';
            }
            if (!*at) return false;
            if (end && (depth == 0 || strcmp(stack[--depth], name))) return false;
            if (!end && depth == 0 && roots++) return false;
            if (!end && !alone && depth == 16) return false;
            if (!end && !alone) strcpy(stack[depth++], name);
        }
        at++;
    }
    return depth == 0 && roots == 1;
}

typedef struct triangle {
    unsigned fill;
    double x[3], y[3]; /* px, of the panel's drawing */
} triangle;

/* the filled triangles of the surfaces in the order they are drawn in */
static int read_triangles(const char *text, triangle *out, int max)
{
    int n = 0;
    for (const char *at = text; (at = strstr(at, "<path fill=\"#")) != NULL;) {
        unsigned fill = (unsigned)strtoul(at + 13, NULL, 16);
        const char *end = strchr(at + 20, '>');
        for (at = strstr(at, " d=\""); at && at < end; at++) {
            int p[6];
            if (*at != 'M' || sscanf(at, "M%d %dl%d %d %d %dz", p, p + 1, p + 2, p + 3, p + 4, p + 5) != 6) continue;
            if (n < max)
                out[n] = (triangle){fill,
                                    {p[0] / 10.0, (p[0] + p[2]) / 10.0, (p[0] + p[2] + p[4]) / 10.0},
                                    {p[1] / 10.0, (p[1] + p[3]) / 10.0, (p[1] + p[3] + p[5]) / 10.0}};
            n++;
        }
        at = end;
    }
    return n;
}

static double area(const triangle *t)
{
    return fabs((t->x[1] - t->x[0]) * (t->y[2] - t->y[0]) - (t->x[2] - t->x[0]) * (t->y[1] - t->y[0])) / 2;
}

static int count(const char *text, const char *word)
{
    int n = 0;
    for (const char *at = text; (at = strstr(at, word)) != NULL; at += strlen(word)) n++;
    return n;
}

static pal_body_picture picture_of_cube(void)
{
    return (pal_body_picture){
        .title = "cube", .n_vertex = 8, .n_tri = 12, .x = cube_x[0], .tri = cube_tri[0], .view = {1, 1, 1}};
}

static void a_cube_shows_three_faces_from_a_corner_and_one_from_the_front(void)
{
    triangle t[16];
    pal_body_picture p = picture_of_cube();
    char *text = draw(&p, 1);
    REQUIRE(text);
    CHECK(is_well_formed(text));
    CHECK_INT(read_triangles(text, t, 16), 6);
    /* all three faces are foreshortened alike: cos = 1 / sqrt 3 of 1 m^2, seen in a hexagon sqrt 2 wide and 2 sqrt(2/3)
     * high, of which the height of 332 px is the tighter */
    double px_m = 332 / (2 * sqrt(2.0 / 3)), sum = 0;
    for (int i = 0; i < 6; i++) sum += area(&t[i]);
    CHECK_NEAR(sum, sqrt(3.0) * px_m * px_m, 0.003 * sum);
    for (int i = 0; i < 6; i++) CHECK_NEAR(area(&t[i]), sum / 6, 0.005 * sum);
    free(text);
    /* straight from the front, and a surface inside out is seen from outside all the same */
    int32_t inward[12][3];
    for (int i = 0; i < 12; i++)
        inward[i][0] = cube_tri[i][1], inward[i][1] = cube_tri[i][0], inward[i][2] = cube_tri[i][2];
    double value[8];
    for (int v = 0; v < 8; v++) value[v] = cube_x[v][0];
    p.view[1] = p.view[2] = 0, p.value = value, p.high = 1;
    for (int turn = 0; turn < 2; turn++) {
        if (turn) p.tri = inward[0];
        text = draw(&p, 1);
        REQUIRE(text);
        CHECK_INT(read_triangles(text, t, 16), 2);
        CHECK_NEAR(area(&t[0]) + area(&t[1]), 332.0 * 332, 100);
        CHECK_INT(t[0].fill, 0xfde725); /* x = 1, not the inner side of x = 0 */
        free(text);
    }
    /* an open box is seen from inside too */
    p = picture_of_cube();
    p.n_tri = 10; /* without x = 1 */
    text = draw(&p, 1);
    REQUIRE(text);
    CHECK_INT(read_triangles(text, t, 16), 10);
    free(text);
}

/* what looks straight at the eye has the colour of its value itself; the stops are those of the viewer */
static void colours_are_those_of_the_viewer(void)
{
    static const unsigned stop[9] = {0x472e7c, 0x3c4f8a, 0x2f6b8d, 0x25868d, 0x25a086,
                                     0x3db974, 0x73ce55, 0xb7dd2f, 0xfde725};
    uint8_t c[3];
    for (int i = 0; i < 9; i++) {
        pal_body_picture_colour(i / 8.0, c);
        CHECK_INT((unsigned)c[0] << 16 | (unsigned)c[1] << 8 | c[2], stop[i]);
    }
    FILE *maps = fopen("clients/viewer/src/colour_maps.js", "rb");
    REQUIRE(maps);
    char *source = calloc(1, 1 << 16), hex[16];
    REQUIRE(source && fread(source, 1, (1 << 16) - 1, maps) > 0);
    fclose(maps);
    const char *at = strstr(source, "SEQUENTIAL = ");
    for (int i = 0; i < 9 && at; i++) {
        snprintf(hex, sizeof hex, "\"#%06x\"", stop[i]);
        at = strstr(at, hex);
    }
    CHECK(at != NULL);
    free(source);
    /* values 3, 30, 300 over 3..300: the ends, and on a logarithmic map 30 is in the middle (class 32 of 0..63) */
    static const double values[3] = {3, 30, 300};
    triangle t[16];
    for (int logarithmic = 0; logarithmic < 2; logarithmic++)
        for (int i = 0; i < 3; i++) {
            double value[8], place = logarithmic ? i / 2.0 : (values[i] - 3) / 297;
            for (int v = 0; v < 8; v++) value[v] = values[i];
            pal_body_picture p = picture_of_cube();
            p.view[0] = p.view[1] = 0, p.value = value, p.low = 3, p.high = 300, p.log = logarithmic;
            char *text = draw(&p, 1);
            REQUIRE(text);
            CHECK_INT(read_triangles(text, t, 16), 2);
            pal_body_picture_colour((double)lround(63 * place) / 63, c);
            CHECK_INT(t[0].fill, (unsigned)c[0] << 16 | (unsigned)c[1] << 8 | c[2]);
            CHECK_INT(t[1].fill, t[0].fill);
            free(text);
        }
}

static void what_has_no_value_is_grey(void)
{
    triangle t[16];
    double value[8] = {1, 1, 1, 1, 1, NAN, 1, 1};
    pal_body_picture p = picture_of_cube();
    p.view[0] = p.view[1] = 0, p.value = value, p.low = 0, p.high = 1; /* from above: 4 5 7 and 4 7 6 */
    char *text = draw(&p, 1);
    REQUIRE(text);
    REQUIRE(read_triangles(text, t, 16) == 2);
    CHECK_INT((t[0].fill == 0xa3a3a3) + (t[1].fill == 0xa3a3a3), 1);
    CHECK_INT((t[0].fill == 0xfde725) + (t[1].fill == 0xfde725), 1);
    CHECK_INT(count(text, ">no value</text>"), 1);
    free(text);
    for (int v = 0; v < 8; v++) value[v] = v % 2 ? -1 : 0; /* nothing has a logarithm: no colour bar either */
    p.log = true, p.low = p.high = 0;
    text = draw(&p, 1);
    REQUIRE(text);
    REQUIRE(read_triangles(text, t, 16) == 2);
    CHECK_INT(t[0].fill, 0xa3a3a3);
    CHECK_INT(count(text, "url(#map)"), 0);
    CHECK(strstr(text, "nan") == NULL && strstr(text, "inf") == NULL);
    free(text);
}

/* two plates over one another: the one nearer to the eye is drawn later, from whichever side */
static void near_is_drawn_over_far(void)
{
    static const double x[6][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0.1}, {1, 0, 0.1}, {0, 1, 0.1}};
    static const int32_t tri[2][3] = {{0, 1, 2}, {3, 4, 5}};
    static const double value[6] = {0, 0, 0, 1, 1, 1};
    triangle t[4];
    for (int below = 0; below < 2; below++) {
        pal_body_picture p = {.n_vertex = 6, .n_tri = 2, .x = x[0], .tri = tri[0], .value = value, .high = 1};
        p.view[2] = below ? -1 : 1;
        char *text = draw(&p, 1);
        REQUIRE(text);
        REQUIRE(read_triangles(text, t, 4) == 2);
        CHECK_INT(t[1].fill, below ? 0x472e7c : 0xfde725);
        CHECK_INT(t[0].fill, below ? 0xfde725 : 0x472e7c);
        free(text);
    }
}

/* a slope of values over a triangle is drawn in steps of few classes, and its parts cover it once */
static void a_slope_of_values_is_divided(void)
{
    static triangle t[200];
    double value[8];
    for (int v = 0; v < 8; v++) value[v] = cube_x[v][0];
    pal_body_picture p = picture_of_cube();
    p.view[0] = p.view[1] = 0, p.value = value, p.high = 1;
    char *text = draw(&p, 1);
    REQUIRE(text);
    int n = read_triangles(text, t, 200);
    CHECK_INT(n, 2 * 8 * 8);
    double sum = 0;
    for (int i = 0; i < n; i++) sum += area(&t[i]);
    CHECK_NEAR(sum, 332.0 * 332, 100);
    for (int i = 0; i < n; i++) { /* from left to right the map is run through: x = 0 is at 34 px, x = 1 at 366 px */
        double at = ((t[i].x[0] + t[i].x[1] + t[i].x[2]) / 3 - 34) / 332;
        uint8_t c[3];
        pal_body_picture_colour((double)lround(63 * at) / 63, c);
        for (int k = 0; k < 3; k++) CHECK_NEAR(t[i].fill >> (16 - 8 * k) & 255, c[k], 9);
    }
    free(text);
}

static void held_vertices_and_loads_are_marked(void)
{
    static const uint8_t fixed[8] = {1, 1, 1, 1, 0, 0, 0, 0};
    static const double at[3][3] = {{0.5, 0, 1}, {1, 0.5, 0.5}, {0, 0, 1}},
                        force[3][3] = {{0, 0, -2}, {1, 0, 0}, {0, -2, 0}};
    pal_body_picture p = picture_of_cube();
    p.view[0] = 0, p.view[1] = -1, p.view[2] = 0;
    p.fixed = fixed, p.n_load = 3, p.load_at = at[0], p.load_N = force[0], p.rest = p.x;
    char *text = draw(&p, 1);
    REQUIRE(text);
    CHECK(is_well_formed(text));
    /* the two held corners at the back are hidden: their dots come before the face that covers them */
    CHECK_INT(count(text, "class=\"held\""), 4);
    const char *face = strstr(text, "<path fill=\"#");
    REQUIRE(face);
    CHECK_INT(count(text, "class=\"held\"") - count(face, "class=\"held\""), 2);
    CHECK(strstr(text, ">held</text>") && strstr(text, ">up to 2 N</text>") && strstr(text, ">at rest</text>"));
    /* two arrows, each with a halo, the first twice as long as the second; the third force points at the eye */
    const char *loads = strstr(text, "stroke=\"#0b7a2a\"");
    REQUIRE(loads);
    double length[2] = {0, 0};
    for (int i = 0; i < 2; i++) {
        int a[2], b[2];
        loads = strstr(loads, "<path d=\"M");
        REQUIRE(loads && sscanf(loads, "<path d=\"M%d %d", a, a + 1) == 2);
        loads = strstr(loads + 1, "<path d=\"M");
        REQUIRE(loads && sscanf(loads, "<path d=\"M%d %d", b, b + 1) == 2);
        length[i] = hypot(b[0] - a[0], b[1] - a[1]);
        loads++;
    }
    CHECK_NEAR(length[0] / length[1], 2, 0.01);
    CHECK_INT(count(text, "r=\"52\""), 1);
    free(text);
}

static void pictures_side_by_side_share_frame_and_range(void)
{
    double far[8][3], one[8], two[8];
    for (int v = 0; v < 8; v++) {
        for (int k = 0; k < 3; k++) far[v][k] = cube_x[v][k] + (k == 0);
        one[v] = 1, two[v] = 4;
    }
    pal_body_picture p[2] = {picture_of_cube(), picture_of_cube()};
    for (int i = 0; i < 2; i++) p[i].view[0] = p[i].view[1] = 0, p[i].value_title = "E", p[i].unit = "kPa";
    p[0].value = one, p[1].value = two, p[1].x = far[0], p[1].title = "<b> & \x01";
    triangle t[8];
    char *text = draw(p, 2);
    REQUIRE(text);
    CHECK(is_well_formed(text));
    CHECK(strstr(text, ">&lt;b> &amp; ?</text>") != NULL);
    CHECK_INT(count(text, ">E, kPa</text>"), 2);
    REQUIRE(read_triangles(text, t, 8) == 4);
    /* the two cubes stand side by side within 372 px: each is 186 wide, the second 186 further right */
    double left[2] = {1e9, 1e9};
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++) left[i / 2] = fmin(left[i / 2], t[i].x[k]);
    CHECK_NEAR(left[1] - left[0], 186, 0.2);
    CHECK_NEAR(area(&t[0]) + area(&t[1]), 186.0 * 186, 50);
    /* 1 and 4 in one range from 0 to 4 */
    uint8_t c[3];
    pal_body_picture_colour(lround(63 * 0.25) / 63.0, c);
    CHECK_INT(t[0].fill, (unsigned)c[0] << 16 | (unsigned)c[1] << 8 | c[2]);
    CHECK_INT(t[2].fill, 0xfde725);
    free(text);
}

/* a wavy sheet of 180,000 triangles in three pictures: coarser, but all of it, in less than 1.5 MB */
static void large_surfaces_are_drawn_coarser(void)
{
    enum { N = CHECK_REPEATS(300, 150) };
    double *x = malloc(3 * sizeof *x * (N + 1) * (N + 1)), *value = malloc(sizeof *value * (N + 1) * (N + 1));
    int32_t *tri = malloc(6 * sizeof *tri * N * N);
    triangle *t = malloc(20000 * sizeof *t);
    REQUIRE(x && value && tri && t);
    for (int i = 0, v = 0; i <= N; i++)
        for (int j = 0; j <= N; j++, v++) {
            x[3 * v] = i, x[3 * v + 1] = j, x[3 * v + 2] = 3 * sin(0.2 * i) * sin(0.15 * j);
            value[v] = sin(0.02 * i + 0.03 * j);
            if (i == N || j == N) continue;
            int32_t corner[6] = {v, v + N + 1, v + 1, v + 1, v + N + 1, v + N + 2};
            memcpy(tri + 6 * (i * N + j), corner, sizeof corner);
        }
    pal_body_picture p = {.n_vertex = (N + 1) * (N + 1), .n_tri = 2 * N * N, .x = x, .tri = tri, .value = value};
    p.view[2] = 1;
    pal_body_picture three[3] = {p, p, p};
    char *text = draw(three, 3);
    REQUIRE(text);
    CHECK_LE((double)strlen(text), 1.5e6);
    int n = read_triangles(text, t, 20000);
    CHECK(n > 6000 && n <= 16000);
    double sum = 0;
    for (int i = 0; i < n && i < 20000; i++) sum += area(&t[i]);
    CHECK_NEAR(sum / 3, 332.0 * 332, 0.05 * 332 * 332); /* half a cell is off on each rim */
    free(text);
    free(x);
    free(value);
    free(tri);
    free(t);
}

static void nothing_to_draw_and_bad_input_are_refused(void)
{
    char path[] = "/tmp/palpate_no_picture_XXXXXX";
    int fd = mkstemp(path);
    REQUIRE(fd >= 0);
    close(fd);
    unlink(path);
    pal_diagnostic diag = {""};
    pal_body_picture p = picture_of_cube();
    CHECK_INT(pal_body_picture_write(&p, 0, path, &diag), PAL_ERR_REFUSED);
    p.n_tri = 0;
    CHECK_INT(pal_body_picture_write(&p, 1, path, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "picture 1 has nothing to draw") && strstr(diag.text, path));
    p = picture_of_cube();
    p.n_vertex = 7;
    CHECK_INT(pal_body_picture_write(&p, 1, path, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "triangle 2: no vertex 7 among 7") != NULL);
    double x[8][3];
    memcpy(x, cube_x, sizeof x);
    x[5][1] = NAN;
    p = picture_of_cube();
    p.x = x[0];
    CHECK_INT(pal_body_picture_write(&p, 1, path, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "vertex 5 is at ") != NULL);
    p = picture_of_cube();
    p.n_load = 1, p.load_at = cube_x[0], p.load_N = x[5];
    CHECK_INT(pal_body_picture_write(&p, 1, path, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "load 0") != NULL);
    CHECK(access(path, F_OK) != 0);
    p = picture_of_cube();
    CHECK_INT(pal_body_picture_write(&p, 1, "/nowhere/at/all.svg", &diag), PAL_ERR_IO);
    /* a body without extent, and ones of 1e-9 and 1e9 m, are no reason to fail */
    for (int k = 0; k < 3; k++) {
        for (int v = 0; v < 8; v++)
            for (int c = 0; c < 3; c++) x[v][c] = k == 0 ? 1 : cube_x[v][c] * (k == 1 ? 1e-9 : 1e9);
        p.x = x[0];
        char *text = draw(&p, 1);
        REQUIRE(text);
        CHECK(is_well_formed(text) && strstr(text, "nan") == NULL && strstr(text, "inf") == NULL);
        triangle t[16];
        CHECK_INT(read_triangles(text, t, 16), k == 0 ? 0 : 6);
        free(text);
    }
}

int main(void)
{
    RUN(a_cube_shows_three_faces_from_a_corner_and_one_from_the_front);
    RUN(colours_are_those_of_the_viewer);
    RUN(what_has_no_value_is_grey);
    RUN(near_is_drawn_over_far);
    RUN(a_slope_of_values_is_divided);
    RUN(held_vertices_and_loads_are_marked);
    RUN(pictures_side_by_side_share_frame_and_range);
    RUN_LONG(large_surfaces_are_drawn_coarser);
    RUN(nothing_to_draw_and_bad_input_are_refused);
    return check_report();
}
