/* Image coordinates from an OBJ file to the displayed surface: every corner has those of the file on its side of a
 * seam, copies of a vertex move with it, and the prepared mesh comes back from its file. */
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/volume/image_seams.h"
#include "tests/check.h"
#include "tests/fixtures/shapes.h"

enum { RING = 24, BAND = 12 };

/* a ball as an OBJ file whose image is wound around it: one seam from pole to pole, and RING places of each pole */
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
    for (int j = 0; j < BAND; j++)
        for (int i = 0; i < RING; i++) {
            const int p = j * (RING + 1) + i + 1, q = p + 1, u = q + RING, w = u + 1;
            if (j > 0) at += sprintf(at, "f %d/%d %d/%d %d/%d\n", p, p, q, q, w, w);
            if (j < BAND - 1) at += sprintf(at, "f %d/%d %d/%d %d/%d\n", p, p, w, w, u, u);
        }
    return text;
}

static void read_ball(pal_surface *surface, pal_image_map *map)
{
    char *text = write_ball();
    const pal_mesh_file_options mm = {.unit_m = 1e-3, .weld = PAL_MESH_WELD, .image = map};
    REQUIRE(
        !pal_mesh_file_parse("ball.obj", (const uint8_t *)text, strlen(text), &mm, surface, NULL, NULL, NULL, NULL));
    free(text);
}

/* largest distance of the image coordinates of a triangle's corners from those of the place where they lie */
static double worst(const pal_surface *s)
{
    double max = 0;
    for (int t = 0; t < s->n_tri; t++) {
        double middle = 0;
        for (int k = 0; k < 3; k++) middle += s->uv[2 * s->tri[3 * t + k]] / 3;
        for (int k = 0; k < 3; k++) {
            const int v = s->tri[3 * t + k];
            double x[3], u;
            for (int a = 0; a < 3; a++) x[a] = s->x[3 * v + a] + s->origin_m[a];
            const double polar = acos(fmax(-1, fmin(1, -x[2] / 0.04)));
            max = fmax(max, fabs(s->uv[2 * v + 1] - polar / SHAPE_PI));
            if (polar < 1e-3 || polar > SHAPE_PI - 1e-3) continue; /* a pole has any u */
            u = atan2(x[1], x[0]) / (2 * SHAPE_PI);
            u += round(middle - u); /* on the side of its triangle */
            max = fmax(max, fabs(s->uv[2 * v] - u));
        }
    }
    return max;
}

static void corners_have_the_places_of_the_file_on_both_sides_of_a_seam(void)
{
    pal_surface surface = {0};
    pal_image_map map = {0};
    pal_prepared p = {0};
    read_ball(&surface, &map);
    CHECK_INT(map.n_tri, 2 * RING * (BAND - 1));
    CHECK_INT(surface.n_vertex, RING * (BAND - 1) + 2);
    const pal_voxel_options voxel = {.resolution = 10, .border = true};
    REQUIRE(!pal_prepared_make(&surface, &voxel, &p, NULL, NULL));
    REQUIRE(!pal_image_seams_make(&map, &p, NULL));
    /* the seam is doubled, and each pole has a place for each of its triangles */
    CHECK_INT(p.surface.n_vertex, surface.n_vertex + BAND - 1 + 2 * (RING - 1));
    CHECK_INT(p.skin.n_vertex, p.surface.n_vertex);
    CHECK_INT(p.surface.n_tri, surface.n_tri);
    CHECK(worst(&p.surface) < 1e-6);
    /* a deformed mesh carries copies and originals to the same place, to the bit */
    double *x = malloc(sizeof *x * 3 * (size_t)p.tets.n_node);
    float *shown = malloc(sizeof *shown * 3 * (size_t)p.surface.n_vertex);
    void *frames = calloc(1, pal_skin_frames_bytes(&p.skin) + 64);
    REQUIRE(x && shown && frames);
    for (int i = 0; i < 3 * p.tets.n_node; i++) x[i] = p.tets.x[i] * 1.2 + 0.002 * sin(300 * p.tets.x[i / 3 * 3]);
    pal_skin_evaluate(&p.skin, x, frames, shown);
    int n_copy = 0;
    for (int v = surface.n_vertex; v < p.surface.n_vertex; v++)
        for (int o = 0; o < surface.n_vertex; o++) {
            if (memcmp(p.surface.x + 3 * v, p.surface.x + 3 * o, 3 * sizeof *x)) continue;
            CHECK(!memcmp(shown + 3 * v, shown + 3 * o, 3 * sizeof *shown));
            n_copy++;
        }
    CHECK_INT(n_copy, p.surface.n_vertex - surface.n_vertex);
    free(x), free(shown), free(frames);
    /* from the file with the same bits, and no index of a damaged one is believed */
    uint8_t *bytes;
    size_t n_byte;
    pal_prepared again = {0};
    REQUIRE(!pal_prepared_bytes(&p, &bytes, &n_byte) && !pal_prepared_parse("p", bytes, n_byte, &again, NULL));
    REQUIRE(again.surface.uv && again.surface.n_vertex == p.surface.n_vertex);
    CHECK(!memcmp(again.surface.uv, p.surface.uv, 2 * sizeof(float) * (size_t)p.surface.n_vertex));
    pal_prepared_free(&again);
    for (int k = 0; k < 2; k++) {
        const uint64_t count[2] = {(uint64_t)p.surface.n_vertex - 1, 1u << 30}; /* of coordinates, at the ninth count */
        memcpy(bytes + 32 + 64, &count[k], 8);
        const uint64_t sum = pal_prepared_checksum(bytes, n_byte);
        memcpy(bytes + 24, &sum, 8);
        CHECK_INT(pal_prepared_parse("p", bytes, n_byte, &again, NULL), PAL_ERR_REFUSED);
    }
    free(bytes);
    pal_prepared_free(&p);
    pal_surface_free(&surface);
    pal_image_map_free(&map);
}

static void a_surface_that_is_simulated_is_not_cut(void)
{
    pal_surface surface = {0};
    pal_image_map map = {0};
    pal_prepared p = {0};
    pal_diagnostic diag = {""};
    read_ball(&surface, &map);
    REQUIRE(!pal_prepared_surface(&surface, &p));
    CHECK_INT(pal_image_seams_make(&map, &p, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "it has seams, at 57 vertices"));
    CHECK(!p.surface.uv && p.surface.n_vertex == surface.n_vertex);
    /* without a seam it takes the image: places by x and y */
    for (int k = 0; k < 3 * map.n_tri; k++)
        for (int c = 0; c < 2; c++) map.uv[2 * k + c] = (float)(10 * map.x[3 * k + c] + 0.5);
    REQUIRE(!pal_image_seams_make(&map, &p, &diag));
    CHECK_INT(p.surface.n_vertex, surface.n_vertex);
    for (int v = 0; v < surface.n_vertex; v++)
        for (int c = 0; c < 2; c++) CHECK_NEAR(p.surface.uv[2 * v + c], 10 * p.surface.x[3 * v + c] + 0.5, 1e-5);
    pal_prepared_free(&p);
    pal_surface_free(&surface);
    pal_image_map_free(&map);
}

int main(void)
{
    RUN(corners_have_the_places_of_the_file_on_both_sides_of_a_seam);
    RUN(a_surface_that_is_simulated_is_not_cut);
    return check_report();
}
