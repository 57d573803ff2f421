/* The prepared mesh: made, saved, loaded, refused when damaged. */
#include "server/mesh/files/file_bytes.h"
#include "server/mesh/volume/prepared.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/shapes.h"

static bool make_ball(pal_prepared *p, pal_prepare_report *report)
{
    pal_surface ball = shape_ball(0.1, 64, 32, 0.2);
    ball.origin_m[1] = 7.5;
    pal_voxel_options options = {.resolution = 12, .border = true, .fill = true};
    pal_diagnostic diag;
    pal_err err = pal_prepared_make(&ball, &options, p, report, &diag);
    pal_surface_free(&ball);
    if (err) CHECK_FAIL("%s", diag.text);
    return !err;
}

static void ball_becomes_a_sound_mesh(void)
{
    pal_prepared p;
    pal_prepare_report report;
    REQUIRE(make_ball(&p, &report));
    pal_diagnostic diag;
    CHECK_INT(pal_tets_check(&p.tets, &diag), PAL_ERR_OK);
    CHECK_INT(p.tets.n_tet, 5 * report.n_voxel);
    CHECK_NEAR(report.volume_m3, (double)report.n_voxel * pow(p.tets.edge_m, 3), 1e-12);
    CHECK_LE(fabs(report.volume_error), 0.05);
    CHECK_NEAR((1 + report.volume_error) * pal_surface_volume(&p.surface) / report.voxel.inside_volume_m3, 1, 1e-4);
    CHECK_TEXT(report.voxel.method, "scanline");
    CHECK_NEAR(p.tets.origin_m[1], 7.5, 0);
    CHECK_INT(p.skin.n_vertex, p.surface.n_vertex);
    CHECK_INT(p.hexes.n_hex, report.n_voxel);
    double filled = 0;
    for (int e = 0; e < p.hexes.n_hex; e++) filled += (double)p.hexes.fill[e];
    /* less what bulges out of the border layer */
    CHECK_NEAR(filled * pow(p.tets.edge_m, 3) / pal_surface_volume(&p.surface), 1, 2e-3);
    pal_prepared_free(&p);
}

static bool same(const void *a, const void *b, size_t n)
{
    return !memcmp(a, b, n);
}

static void saved_and_loaded_is_the_same_to_the_bit(void)
{
    pal_prepared p, q;
    pal_diagnostic diag;
    char path[64];
    REQUIRE(make_ball(&p, NULL));
    snprintf(path, sizeof path, "/tmp/palpate_test_prepared_%d", (int)getpid());
    REQUIRE(!pal_prepared_save(&p, path, &diag));
    REQUIRE(!pal_prepared_load(path, &q, &diag));
    unlink(path);
    uint8_t *a, *b;
    size_t n_a, n_b;
    REQUIRE(!pal_prepared_bytes(&p, &a, &n_a) && !pal_prepared_bytes(&q, &b, &n_b));
    CHECK(n_a == n_b && same(a, b, n_a));
    CHECK_INT(q.surface.n_tri, p.surface.n_tri);
    CHECK(same(q.surface.x, p.surface.x, (size_t)p.surface.n_vertex * 24));
    CHECK(same(q.tets.tet, p.tets.tet, (size_t)p.tets.n_tet * 16));
    CHECK(same(q.skin.coef, p.skin.coef, (size_t)p.skin.n_vertex * 80));
    CHECK_INT(q.hexes.n_hex, p.hexes.n_hex);
    CHECK(p.hexes.measured && q.hexes.measured);
    CHECK(same(q.hexes.node, p.hexes.node, (size_t)p.hexes.n_hex * 32));
    CHECK(same(q.hexes.fill, p.hexes.fill, (size_t)p.hexes.n_hex * 4));
    CHECK(same(q.hexes.weight, p.hexes.weight, (size_t)p.hexes.n_hex * 32));
    CHECK(same(q.surface.origin_m, p.surface.origin_m, 24) && same(q.tets.origin_m, p.tets.origin_m, 24));
    CHECK_NEAR(q.tets.edge_m, p.tets.edge_m, 0);
    free(a);
    free(b);
    pal_prepared_free(&p);
    pal_prepared_free(&q);
}

/* every change that the checksum would hide is made with a new checksum */
static void damaged_files_are_refused_with_their_place(void)
{
    pal_prepared p, q;
    pal_diagnostic diag;
    uint8_t *bytes;
    size_t n;
    REQUIRE(make_ball(&p, NULL));
    REQUIRE(!pal_prepared_bytes(&p, &bytes, &n));
    for (size_t cut = 0; cut < n; cut = cut * 2 + 1)
        CHECK_INT(pal_prepared_parse("cut", bytes, cut, &q, &diag), PAL_ERR_REFUSED);
    bytes[n / 2] ^= 1;
    CHECK_INT(pal_prepared_parse("flip", bytes, n, &q, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "flip: byte 24: the checksum"));
    bytes[n / 2] ^= 1;
    CHECK_INT(pal_prepared_parse("whole", bytes, n, &q, &diag), PAL_ERR_OK);
    pal_prepared_free(&q);

    uint64_t state = 5;
    int n_refused = 0, n_taken = 0;
    const int n_change = CHECK_REPEATS(3000, 400);
    for (int k = 0; k < n_change; k++) {
        size_t at = 8 + random_below(&state, (k & 1 ? 512 : n - 8));
        uint8_t old = bytes[at];
        bytes[at] = (uint8_t)(random_bits(&state) >> 33);
        uint64_t sum = pal_prepared_checksum(bytes, n), before;
        memcpy(&before, bytes + 24, 8);
        if (at < 24 || at >= 32) memcpy(bytes + 24, &sum, 8);
        if (pal_prepared_parse("change", bytes, n, &q, &diag)) {
            n_refused++;
        } else {
            n_taken++;
            pal_prepared_free(&q);
        }
        memcpy(bytes + 24, &before, 8);
        bytes[at] = old;
    }
    CHECK(n_refused > n_change / 6 && n_taken > n_change / 30);
    free(bytes);
    pal_prepared_free(&p);
}

/* sets bytes at a place and the checksum right, says what the reader makes of it, and sets them back */
static pal_err parse_with(uint8_t *bytes, size_t n, size_t at, const void *value, size_t n_value, pal_diagnostic *diag)
{
    uint8_t old[64], old_sum[8];
    pal_prepared q;
    memcpy(old, bytes + at, n_value);
    memcpy(old_sum, bytes + 24, 8);
    memcpy(bytes + at, value, n_value);
    uint64_t sum = pal_prepared_checksum(bytes, n);
    memcpy(bytes + 24, &sum, 8);
    pal_err err = pal_prepared_parse("file", bytes, n, &q, diag);
    if (!err) pal_prepared_free(&q);
    memcpy(bytes + at, old, n_value);
    memcpy(bytes + 24, old_sum, 8);
    return err;
}

static void fill_that_does_not_fit_is_refused(void)
{
    pal_prepared p;
    pal_diagnostic diag;
    uint8_t *bytes;
    size_t n;
    REQUIRE(make_ball(&p, NULL));
    REQUIRE(!pal_prepared_bytes(&p, &bytes, &n));
    CHECK_INT(bytes[8], 5);
    /* the entry of section 15 begins behind ten counts, four doubles and fourteen entries */
    uint64_t at, weights, few = (uint64_t)p.hexes.n_hex - 1, entry = 32 + 80 + 32 + 14 * 24;
    memcpy(&weights, bytes + entry + 2 * 24 + 16, 8);
    memcpy(&at, bytes + entry + 16, 8);
    CHECK_INT(parse_with(bytes, n, at, p.hexes.fill, 4, &diag), PAL_ERR_OK);
    CHECK_INT(parse_with(bytes, n, at, &(float){0.25F}, 4, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "weights do not sum to a voxel's fill"));
    CHECK_INT(parse_with(bytes, n, weights, &(float){0.126F}, 4, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "a weight of a voxel is not within 0..1/8"));
    CHECK_INT(parse_with(bytes, n, 32 + 9 * 8, &few, 8, &diag), PAL_ERR_REFUSED);
    CHECK_INT(parse_with(bytes, n, at, &(float){-0.25F}, 4, &diag), PAL_ERR_REFUSED);
    CHECK_INT(parse_with(bytes, n, at, &(float){1.001F}, 4, &diag), PAL_ERR_REFUSED);
    CHECK_INT(parse_with(bytes, n, at, &(float){NAN}, 4, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "a voxel's fill is not within 0..1"));
    free(bytes), free(p.hexes.weight);
    p.hexes.weight = NULL;
    REQUIRE(!pal_prepared_bytes(&p, &bytes, &n));
    memcpy(bytes + entry - 16 + 8, &few, 8); /* two counts fewer */
    CHECK_INT(parse_with(bytes, n, 32 + 7 * 8, &few, 8, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "fill of") && strstr(diag.text, "voxels, the mesh has"));
    free(bytes);
    pal_prepared_free(&p);

    /* without a measured fill the section is empty and the hexahedra are found again */
    REQUIRE(make_ball(&p, NULL));
    p.hexes.measured = false;
    REQUIRE(!pal_prepared_bytes(&p, &bytes, &n));
    pal_prepared q;
    REQUIRE(!pal_prepared_parse("whole", bytes, n, &q, &diag));
    CHECK_INT(q.hexes.n_hex, p.hexes.n_hex);
    CHECK(!q.hexes.measured && q.hexes.fill[0] == 1.0F);
    free(bytes);
    pal_prepared_free(&p);
    pal_prepared_free(&q);
}

/* written before there were weights: as now without them */
static void a_file_of_version_3_has_fill_and_no_weights(void)
{
    pal_prepared p, q;
    pal_diagnostic diag = {""};
    uint8_t *bytes;
    size_t n;
    REQUIRE(make_ball(&p, NULL));
    free(p.hexes.weight);
    p.hexes.weight = NULL;
    REQUIRE(!pal_prepared_bytes(&p, &bytes, &n));
    CHECK_INT(bytes[8], 3);
    REQUIRE(!pal_prepared_parse("three", bytes, n, &q, &diag));
    CHECK(q.hexes.measured && !q.hexes.weight);
    CHECK(same(q.hexes.fill, p.hexes.fill, (size_t)p.hexes.n_hex * 4));
    free(bytes);
    pal_prepared_free(&p);
    pal_prepared_free(&q);
}

/* written before there were hexahedra */
static void a_file_of_version_2_is_read_with_its_hexahedra(void)
{
    pal_prepared q;
    pal_diagnostic diag = {""};
    uint8_t *bytes;
    size_t n;
    REQUIRE(!pal_file_read("tests/data/fuzz/prepared/cube.mesh", 1 << 20, &bytes, &n, &diag));
    CHECK_INT(bytes[8], 2);
    REQUIRE(!pal_prepared_parse("cube", bytes, n, &q, &diag));
    CHECK(q.hexes.n_hex > 0);
    CHECK_INT(5 * q.hexes.n_hex, q.tets.n_tet);
    CHECK(!q.hexes.measured);
    for (int e = 0; e < q.hexes.n_hex; e++) CHECK(q.hexes.fill[e] == 1.0F);
    pal_prepared_free(&q);
    CHECK_INT(parse_with(bytes, n, 8, &(uint32_t){3}, 4, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "version 3 with 14 sections"));
    free(bytes);
}

static void a_file_that_is_not_there_is_an_io_error(void)
{
    pal_prepared q;
    pal_diagnostic diag;
    CHECK_INT(pal_prepared_load("/nonexistent/mesh", &q, &diag), PAL_ERR_IO);
    CHECK(strstr(diag.text, "/nonexistent/mesh"));
}

static void a_surface_alone_is_saved_and_loaded_to_the_bit(void)
{
    pal_surface ball = shape_ball(0.1, 16, 8, 0.2);
    pal_prepared p, q;
    pal_diagnostic diag = {""};
    uint8_t *a, *b;
    size_t n_a, n_b;
    ball.origin_m[2] = -3.25;
    REQUIRE(!pal_prepared_surface(&ball, &p));
    CHECK_INT(p.tets.n_node + p.tets.n_tet + p.hexes.n_hex + p.skin.n_vertex, 0);
    /* the mean edge of a ball of 16 x 8 fields */
    CHECK(p.tets.edge_m > 0.02 && p.tets.edge_m < 0.06);
    REQUIRE(!pal_prepared_bytes(&p, &a, &n_a));
    if (pal_prepared_parse("alone", a, n_a, &q, &diag)) CHECK_FAIL("%s", diag.text);
    REQUIRE(!diag.text[0] && !pal_prepared_bytes(&q, &b, &n_b));
    CHECK(n_a == n_b && same(a, b, n_a));
    CHECK_INT(q.surface.n_vertex, ball.n_vertex);
    CHECK(same(q.surface.x, ball.x, (size_t)ball.n_vertex * 24));
    CHECK(same(q.surface.tri, ball.tri, (size_t)ball.n_tri * 12));
    CHECK_NEAR(q.surface.origin_m[2], -3.25, 0);
    CHECK_NEAR(q.tets.origin_m[2], -3.25, 0);
    CHECK_NEAR(q.tets.edge_m, p.tets.edge_m, 0);
    CHECK_INT(q.tets.n_node + q.tets.n_tet + q.hexes.n_hex + q.skin.n_vertex + q.skin.n_frame, 0);
    pal_prepared_free(&q);
    free(b);
    /* a corner out of range is seen without tetrahedra too */
    int32_t bad = ball.n_vertex;
    for (size_t at = 0; at + 4 <= n_a; at += 4)
        if (same(a + at, ball.tri, 24)) {
            memcpy(a + at, &bad, 4);
            break;
        }
    uint64_t sum = pal_prepared_checksum(a, n_a);
    memcpy(a + 24, &sum, 8);
    CHECK_INT(pal_prepared_parse("alone", a, n_a, &q, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "a triangle's corner is out of range") != NULL);
    free(a);
    pal_prepared_free(&p);
    pal_surface_free(&ball);
}

int main(void)
{
    RUN(ball_becomes_a_sound_mesh);
    RUN(saved_and_loaded_is_the_same_to_the_bit);
    RUN(damaged_files_are_refused_with_their_place);
    RUN(fill_that_does_not_fit_is_refused);
    RUN(a_file_of_version_3_has_fill_and_no_weights);
    RUN(a_file_of_version_2_is_read_with_its_hexahedra);
    RUN(a_surface_alone_is_saved_and_loaded_to_the_bit);
    RUN(a_file_that_is_not_there_is_an_io_error);
    return check_report();
}
