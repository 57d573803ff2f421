/* Images from an OBJ file to the displayed surface: every corner has the place of the file on its side of a seam and in
 * the image of its material, on a decimated surface too, and the prepared mesh comes back from its file. */
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/geometry/decimate.h"
#include "server/mesh/volume/prepared.h"
#include "tests/check.h"
#include "tests/fixtures/shapes.h"

enum { RING = 24, BAND = 12 };

/* a ball as an OBJ file whose image is wound around it: one seam from pole to pole, and RING places of each pole. Its
 * upper half is of another material */
static char *write_ball(void)
{
    char *text = malloc(1 << 20), *at = text;
    if (!text) abort();
    for (int j = 0; j <= BAND; j++)
        for (int i = 0; i <= RING; i++) {
            const double a = 2 * SHAPE_PI * (i % RING) / RING, b = SHAPE_PI * j / BAND;
            at += sprintf(at, "v %.9f %.9f %.9f\nvt %.9f %.9f\n", 50 * sin(b) * cos(a), 50 * sin(b) * sin(a),
                          -40 * cos(b), (double)i / RING, (double)j / BAND);
        }
    for (int j = 0; j < BAND; j++) {
        if (j == BAND / 2) at += sprintf(at, "usemtl upper half \n");
        for (int i = 0; i < RING; i++) {
            const int p = j * (RING + 1) + i + 1, q = p + 1, u = q + RING, w = u + 1;
            if (j > 0) at += sprintf(at, "f %d/%d %d/%d %d/%d\n", p, p, q, q, w, w);
            if (j < BAND - 1) at += sprintf(at, "f %d/%d %d/%d %d/%d\n", p, p, w, w, u, u);
        }
    }
    return text;
}

static void read_text(const char *text, pal_surface *surface, pal_image_map *map)
{
    const pal_mesh_file_options mm = {.unit_m = 1e-3, .weld = PAL_MESH_WELD, .image = map};
    REQUIRE(
        !pal_mesh_file_parse("ball.obj", (const uint8_t *)text, strlen(text), &mm, surface, NULL, NULL, NULL, NULL));
}

static void read_ball(pal_surface *surface, pal_image_map *map)
{
    char *text = write_ball();
    read_text(text, surface, map);
    free(text);
}

/* largest distance of the image coordinates of corners from those of the places where they lie */
static double worst(const pal_surface *s)
{
    double max = 0;
    for (int t = 0; t < s->n_tri; t++) {
        const float *at = s->image_at + 9 * t;
        double middle = 0;
        for (int k = 0; k < 3; k++) middle += at[3 * k] / 3;
        for (int k = 0; k < 3; k++) {
            double x[3], u;
            for (int a = 0; a < 3; a++) x[a] = s->x[3 * s->tri[3 * t + k] + a] + s->origin_m[a];
            const double polar = acos(fmax(-1, fmin(1, -x[2] / 0.04)));
            max = fmax(max, fabs(at[3 * k + 1] - polar / SHAPE_PI));
            if (polar < 1e-3 || polar > SHAPE_PI - 1e-3) continue; /* a pole has any u */
            u = atan2(x[1], x[0]) / (2 * SHAPE_PI);
            u += round(middle - u); /* on the side of its triangle */
            max = fmax(max, fabs(at[3 * k] - u));
        }
    }
    return max;
}

/* triangles of each image; all corners of a triangle have the same */
static void count(const pal_surface *s, int n[2])
{
    n[0] = n[1] = 0;
    for (int t = 0; t < s->n_tri; t++) {
        const float *at = s->image_at + 9 * t;
        CHECK(at[2] == at[5] && at[2] == at[8]);
        if (at[2] >= 0) n[(int)at[2]]++;
    }
}

static void corners_have_the_places_of_the_file_on_both_sides_of_a_seam(void)
{
    pal_surface surface = {0};
    pal_image_map map = {0};
    pal_prepared p = {0};
    int n[2];
    read_ball(&surface, &map);
    CHECK_INT(map.n_tri, 2 * RING * (BAND - 1));
    CHECK_INT(surface.n_vertex, RING * (BAND - 1) + 2);
    CHECK_INT(map.n_material, 2);
    CHECK_TEXT(map.material[0], "");
    CHECK_TEXT(map.material[1], "upper half");
    REQUIRE(!pal_prepared_surface(&surface, &p));
    REQUIRE(!pal_image_map_take(&map, (const int[]){1, 0}, &p.surface));
    CHECK_INT(p.surface.n_vertex, surface.n_vertex);
    CHECK(worst(&p.surface) < 1e-6);
    count(&p.surface, n);
    CHECK_INT(n[0], map.n_tri / 2);
    CHECK_INT(n[1], map.n_tri / 2);
    /* a material without image: its triangles have none */
    REQUIRE(!pal_image_map_take(&map, (const int[]){0, -1}, &p.surface));
    count(&p.surface, n);
    CHECK_INT(n[0], map.n_tri / 2);
    /* from the file with the same bits, and no count of a damaged one is believed */
    uint8_t *bytes;
    size_t n_byte;
    pal_prepared again = {0};
    REQUIRE(!pal_prepared_bytes(&p, &bytes, &n_byte) && !pal_prepared_parse("p", bytes, n_byte, &again, NULL));
    REQUIRE(again.surface.image_at && again.surface.n_tri == p.surface.n_tri);
    CHECK(!memcmp(again.surface.image_at, p.surface.image_at, 9 * sizeof(float) * (size_t)p.surface.n_tri));
    pal_prepared_free(&again);
    for (int k = 0; k < 2; k++) {
        const uint64_t wrong[2] = {(uint64_t)p.surface.n_tri - 1, 1u << 30}; /* of triangles, at the ninth count */
        memcpy(bytes + 32 + 64, &wrong[k], 8);
        const uint64_t sum = pal_prepared_checksum(bytes, n_byte);
        memcpy(bytes + 24, &sum, 8);
        CHECK_INT(pal_prepared_parse("p", bytes, n_byte, &again, NULL), PAL_ERR_REFUSED);
    }
    free(bytes);
    pal_prepared_free(&p);
    pal_surface_free(&surface);
    pal_image_map_free(&map);
}

/* decimation does not know of the seam (y = 0, x > 0): a triangle that lies across it has places of both sides, any
 * other one of one */
static void a_decimated_surface_has_one_image_in_each_triangle(void)
{
    pal_surface surface = {0};
    pal_image_map map = {0};
    read_ball(&surface, &map);
    REQUIRE(!pal_surface_decimate(&surface, surface.n_tri / 2));
    REQUIRE(!pal_image_map_take(&map, (const int[]){0, 1}, &surface));
    int n[2], n_wide = 0;
    count(&surface, n);
    CHECK_INT(n[0] + n[1], surface.n_tri);
    CHECK_LE(abs(n[0] - n[1]), surface.n_tri / 5);
    for (int t = 0; t < surface.n_tri; t++) {
        const float *at = surface.image_at + 9 * t;
        double low = HUGE_VAL, high = -HUGE_VAL;
        for (int k = 0; k < 3; k++) {
            const double y = surface.x[3 * surface.tri[3 * t + k] + 1];
            low = fmin(low, y), high = fmax(high, y);
        }
        for (int k = 0; k < 3; k++)
            n_wide += fabsf(at[3 * k] - at[3 * ((k + 1) % 3)]) > 0.5f && !(low < -1e-6 && high > 1e-6);
    }
    CHECK_INT(n_wide, 0);
    pal_surface_free(&surface);
    pal_image_map_free(&map);
}

static void corners_at_a_vertex_that_hardly_differ_have_one_place(void)
{
    static const char square[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nvt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0 1\n"
                                 "vt 0.6 0\nvt 1 0\nvt 0.9 1\nusemtl a\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 2/5 5/6 3/7\n";
    static const char plain[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nf 1 2 3\nf 1/1 3/1 4/1\n";
    pal_surface s = {0};
    pal_image_map map = {0};
    read_text(square, &s, &map);
    REQUIRE(!pal_image_map_take(&map, (const int[]){0}, &s));
    /* 0.1 is near for a triangle of 1.0 in the image, 0.4 is not */
    CHECK(s.image_at[18] == 0.5f && s.image_at[24] == 0.9f);
    pal_surface_free(&s);
    pal_image_map_free(&map);
    /* a triangle without vt has no image */
    read_text(plain, &s, &map);
    REQUIRE(!pal_image_map_take(&map, (const int[]){0}, &s));
    CHECK(s.image_at[2] == -1 && s.image_at[11] == 0);
    pal_surface_free(&s);
    pal_image_map_free(&map);
}

static void more_materials_than_can_be_told_apart_are_refused(void)
{
    char *text = malloc(1 << 16), *at = text;
    pal_surface s = {0};
    pal_image_map map = {0};
    pal_diagnostic diag = {""};
    REQUIRE(text);
    at += sprintf(at, "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\n");
    for (int k = 0; k <= PAL_MATERIAL_MAX; k++) at += sprintf(at, "usemtl m%d\nf 1/1 2/1 3/1\n", k);
    const pal_mesh_file_options options = {.image = &map};
    CHECK_INT(pal_mesh_file_parse("a.obj", (const uint8_t *)text, strlen(text), &options, &s, NULL, NULL, NULL, &diag),
              PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "a.obj: line 517: more than 256 materials");
    free(text);
}

int main(void)
{
    RUN(corners_have_the_places_of_the_file_on_both_sides_of_a_seam);
    RUN(a_decimated_surface_has_one_image_in_each_triangle);
    RUN(corners_at_a_vertex_that_hardly_differ_have_one_place);
    RUN(more_materials_than_can_be_told_apart_are_refused);
    return check_report();
}
