/* The prepared mesh: made, saved, loaded, refused when damaged. */
#include "server/mesh/mesh_file.h"
#include "server/mesh/prepared.h"
#include "tests/check.h"
#include "tests/mesh/shapes.h"

static bool make_ball(pal_prepared *p, pal_prepare_report *report)
{
    pal_surface ball = shape_ball(0.1, 64, 32, 0.2);
    ball.origin_m[1] = 7.5;
    pal_voxel_options options = {.resolution = 12, .border = true};
    pal_note note;
    pal_err err = pal_prepared_make(&ball, &options, p, report, &note);
    pal_surface_free(&ball);
    if (err) CHECK_FAIL("%s", note.text);
    return !err;
}

static void ball_becomes_a_sound_mesh(void)
{
    pal_prepared p;
    pal_prepare_report report;
    REQUIRE(make_ball(&p, &report));
    pal_note note;
    CHECK_INT(pal_tets_check(&p.tets, &note), PAL_ERR_OK);
    CHECK_INT(p.tets.n_tet, 5 * report.n_voxel);
    CHECK_NEAR(report.volume_m3, (double)report.n_voxel * pow(p.tets.h_m, 3), 1e-12);
    CHECK_LE(fabs(report.volume_error), 0.05);
    CHECK_NEAR((1 + report.volume_error) * pal_surface_volume(&p.surface) / report.voxel.inside_volume_m3, 1, 1e-4);
    CHECK_TEXT(report.voxel.method, "scanline");
    CHECK_NEAR(p.tets.origin_m[1], 7.5, 0);
    CHECK_INT(p.skin.n_vertex, p.surface.n_vertex);
    pal_prepared_free(&p);
}

static bool same(const void *a, const void *b, size_t n)
{
    return !memcmp(a, b, n);
}

static void saved_and_loaded_is_the_same_to_the_bit(void)
{
    pal_prepared p, q;
    pal_note note;
    char path[64];
    REQUIRE(make_ball(&p, NULL));
    snprintf(path, sizeof path, "/tmp/palpate_test_prepared_%d", (int)getpid());
    REQUIRE(!pal_prepared_save(&p, path, &note));
    REQUIRE(!pal_prepared_load(path, &q, &note));
    unlink(path);
    uint8_t *a, *b;
    size_t n_a, n_b;
    REQUIRE(!pal_prepared_bytes(&p, &a, &n_a) && !pal_prepared_bytes(&q, &b, &n_b));
    CHECK(n_a == n_b && same(a, b, n_a));
    CHECK_INT(q.surface.n_tri, p.surface.n_tri);
    CHECK(same(q.surface.x, p.surface.x, (size_t)p.surface.n_vertex * 24));
    CHECK(same(q.tets.tet, p.tets.tet, (size_t)p.tets.n_tet * 16));
    CHECK(same(q.skin.coef, p.skin.coef, (size_t)p.skin.n_vertex * 80));
    CHECK(same(q.surface.origin_m, p.surface.origin_m, 24) && same(q.tets.origin_m, p.tets.origin_m, 24));
    CHECK_NEAR(q.tets.h_m, p.tets.h_m, 0);
    free(a);
    free(b);
    pal_prepared_free(&p);
    pal_prepared_free(&q);
}

/* every change that the checksum would hide is made with a new checksum */
static void damaged_files_are_refused_with_their_place(void)
{
    pal_prepared p, q;
    pal_note note;
    uint8_t *bytes;
    size_t n;
    REQUIRE(make_ball(&p, NULL));
    REQUIRE(!pal_prepared_bytes(&p, &bytes, &n));
    for (size_t cut = 0; cut < n; cut = cut * 2 + 1)
        CHECK_INT(pal_prepared_parse("cut", bytes, cut, &q, &note), PAL_ERR_REFUSED);
    bytes[n / 2] ^= 1;
    CHECK_INT(pal_prepared_parse("flip", bytes, n, &q, &note), PAL_ERR_REFUSED);
    CHECK(strstr(note.text, "flip: byte 24: the checksum"));
    bytes[n / 2] ^= 1;
    CHECK_INT(pal_prepared_parse("whole", bytes, n, &q, &note), PAL_ERR_OK);
    pal_prepared_free(&q);

    uint64_t state = 5;
    int n_refused = 0, n_taken = 0;
    for (int k = 0; k < 3000; k++) {
        size_t at = 8 + shape_random(&state) % (k & 1 ? 512 : n - 8);
        uint8_t old = bytes[at];
        bytes[at] = (uint8_t)shape_random(&state);
        uint64_t sum = pal_prepared_checksum(bytes, n), before;
        memcpy(&before, bytes + 24, 8);
        if (at < 24 || at >= 32) memcpy(bytes + 24, &sum, 8);
        if (pal_prepared_parse("change", bytes, n, &q, &note)) {
            n_refused++;
        } else {
            n_taken++;
            pal_prepared_free(&q);
        }
        memcpy(bytes + 24, &before, 8);
        bytes[at] = old;
    }
    CHECK(n_refused > 500 && n_taken > 100);
    free(bytes);
    pal_prepared_free(&p);
}

static void a_file_that_is_not_there_is_an_io_error(void)
{
    pal_prepared q;
    pal_note note;
    CHECK_INT(pal_prepared_load("/nonexistent/mesh", &q, &note), PAL_ERR_IO);
    CHECK(strstr(note.text, "/nonexistent/mesh"));
}

int main(void)
{
    RUN(ball_becomes_a_sound_mesh);
    RUN(saved_and_loaded_is_the_same_to_the_bit);
    RUN(damaged_files_are_refused_with_their_place);
    RUN(a_file_that_is_not_there_is_an_io_error);
    return check_report();
}
