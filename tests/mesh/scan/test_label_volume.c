/* Label volumes: every form of NIfTI-1 and INRIMAGE gives the same ball, hostile files give one sentence, and the
 * surface of a label is closed, smooth and has the label's volume. */
#include "server/mesh/scan/label_volume.h"
#include "tests/check.h"

#include <unistd.h>
#include <zlib.h>

#define PI 3.14159265358979323846
enum { NX = 44, NY = 40, NZ = 24, N_VOXEL = NX * NY * NZ };
/* voxels of 1 x 1.25 x 2 mm; a ball of radius 18 mm round voxel (22, 19.5, 11.7), label 3, with a cavity of label 9 */
static const double size_mm[3] = {1, 1.25, 2}, middle[3] = {22, 19.5, 11.7}, radius_mm = 18;

static int label_of(int x, int y, int z)
{
    const int at[3] = {x, y, z};
    double d2 = 0;
    for (int a = 0; a < 3; a++) d2 += pow((at[a] - middle[a]) * size_mm[a], 2);
    return d2 < 9 ? 9 : d2 < radius_mm * radius_mm ? 3 : x < 4 && y < 3 ? 3 : 0;
}

typedef struct bytes {
    uint8_t *at;
    size_t n;
} bytes;

/* a number of type code (NIfTI's) in either byte order */
static void put(uint8_t *to, int code, double value, bool big)
{
    uint8_t raw[8] = {0};
    size_t n = 0;
#define PUT(CODE, TYPE)                                                                                                \
    if (code == CODE) {                                                                                                \
        TYPE v = (TYPE)value;                                                                                          \
        memcpy(raw, &v, n = sizeof v);                                                                                 \
    }
    PUT(2, uint8_t)
    PUT(4, int16_t)
    PUT(8, int32_t)
    PUT(16, float)
    PUT(64, double)
    PUT(256, int8_t)
    PUT(512, uint16_t)
    PUT(768, uint32_t)
    PUT(1024, int64_t)
    PUT(1280, uint64_t)
    for (size_t k = 0; k < n; k++) to[k] = raw[big ? n - 1 - k : k];
}

static size_t code_size(int code)
{
    return code == 2 || code == 256 ? 1 : code == 4 || code == 512 ? 2 : code == 8 || code == 768 || code == 16 ? 4 : 8;
}

/* the ball as a NIfTI file without axes; the caller frees */
static bytes make_nifti(int code, bool big, double slope, double shift)
{
    size_t size = code_size(code);
    bytes b = {calloc(1, 352 + N_VOXEL * size), 352 + N_VOXEL * size};
    if (!b.at) exit(1);
    put(b.at, 8, 348, big);
    static const int dim[8] = {3, NX, NY, NZ, 1, 1, 1, 1};
    for (int k = 0; k < 8; k++) put(b.at + 40 + 2 * k, 4, dim[k], big);
    put(b.at + 70, 4, code, big);
    put(b.at + 72, 4, (double)(8 * size), big);
    for (int a = 0; a < 3; a++) put(b.at + 80 + 4 * a, 16, size_mm[a], big);
    put(b.at + 108, 16, 352, big);
    put(b.at + 112, 16, slope, big);
    put(b.at + 116, 16, shift, big);
    b.at[123] = 2;
    memcpy(b.at + 344, "n+1", 4);
    for (int i = 0; i < N_VOXEL; i++) {
        double value = label_of(i % NX, i / NX % NY, i / NX / NY);
        put(b.at + 352 + size * (size_t)i, code, slope != 0 ? (value - shift) / slope : value, big);
    }
    return b;
}

static bytes make_inr(const char *type, int code, bool big)
{
    size_t size = code_size(code);
    bytes b = {calloc(1, 256 + N_VOXEL * size), 256 + N_VOXEL * size};
    if (!b.at) exit(1);
    memset(b.at, '\n', 256);
    int n = snprintf((char *)b.at, 256,
                     "#INRIMAGE-4#{\nXDIM=%d\nYDIM=%d\nZDIM=%d\nVDIM=1\nTYPE=%s\nPIXSIZE=%zu bits\nSCALE=2**0\nCPU=%s\n"
                     "VX=%g\nVY=%g\nVZ=%g",
                     NX, NY, NZ, type, 8 * size, big ? "sun" : "decm", size_mm[0], size_mm[1], size_mm[2]);
    b.at[n] = '\n';
    memcpy(b.at + 252, "##}\n", 4);
    for (int i = 0; i < N_VOXEL; i++)
        put(b.at + 256 + size * (size_t)i, code, label_of(i % NX, i / NX % NY, i / NX / NY), big);
    return b;
}

static bytes pack(const bytes *from)
{
    z_stream z;
    memset(&z, 0, sizeof z);
    deflateInit2(&z, 6, Z_DEFLATED, 31, 8, Z_DEFAULT_STRATEGY);
    bytes b = {malloc(deflateBound(&z, from->n)), 0};
    if (!b.at) exit(1);
    z.next_in = from->at;
    z.avail_in = (uInt)from->n;
    z.next_out = b.at;
    z.avail_out = (uInt)deflateBound(&z, from->n);
    deflate(&z, Z_FINISH);
    b.n = z.total_out;
    deflateEnd(&z);
    return b;
}

/* parses a heap copy of exactly n bytes */
static pal_err parse(const char *name, const uint8_t *from, size_t n, pal_label_volume *v, pal_diagnostic *diag)
{
    uint8_t *copy = malloc(n ? n : 1);
    if (!copy) return PAL_ERR_MEMORY;
    if (n) memcpy(copy, from, n);
    pal_err err = pal_label_volume_parse(name, copy, n, v, diag);
    free(copy);
    return err;
}

static void check_ball(const bytes *b, const char *format)
{
    pal_label_volume v = {0};
    pal_diagnostic diag = {{0}};
    pal_err err = parse("ball", b->at, b->n, &v, &diag);
    check_count++;
    if (err) {
        CHECK_FAIL("%s", diag.text);
        return;
    }
    CHECK_TEXT(v.format, format);
    CHECK(v.n[0] == NX && v.n[1] == NY && v.n[2] == NZ);
    int n_wrong = 0;
    for (int i = 0; i < N_VOXEL; i++) n_wrong += v.label[i] != label_of(i % NX, i / NX % NY, i / NX / NY);
    CHECK_INT(n_wrong, 0);
    for (int a = 0; a < 3; a++) CHECK_NEAR(v.to_m[5 * a], 1e-3 * size_mm[a], 1e-9);
    pal_label_volume_free(&v);
}

static void reads_every_nifti_type_in_both_orders_plain_and_packed(void)
{
    static const int code[] = {2, 4, 8, 16, 64, 256, 512, 768, 1024, 1280};
    for (size_t k = 0; k < sizeof code / sizeof *code; k++)
        for (int big = 0; big < 2; big++) {
            bytes b = make_nifti(code[k], big, 0, 0), packed = pack(&b);
            check_ball(&b, "nifti");
            check_ball(&packed, "nifti");
            free(b.at);
            free(packed.at);
        }
    /* scaled values are rounded: stored (label - 1) / 0.5 */
    bytes b = make_nifti(16, false, 0.5, 1);
    check_ball(&b, "nifti");
    free(b.at);
}

static void reads_inrimage_types_in_both_orders_plain_and_packed(void)
{
    static const struct {
        const char *type;
        int code;
    } known[] = {{"unsigned fixed", 2}, {"signed fixed", 256}, {"unsigned fixed", 512},
                 {"signed fixed", 4},   {"signed fixed", 8},   {"float", 16},
                 {"float", 64}};
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        for (int big = 0; big < 2; big++) {
            bytes b = make_inr(known[k].type, known[k].code, big), packed = pack(&b);
            check_ball(&b, "inr");
            check_ball(&packed, "inr");
            free(b.at);
            free(packed.at);
        }
}

static void lists_labels_by_size(void)
{
    bytes b = make_nifti(4, false, 0, 0);
    pal_label_volume v = {0};
    REQUIRE(parse("b.nii", b.at, b.n, &v, NULL) == PAL_ERR_OK);
    pal_label_count list[4];
    REQUIRE(pal_label_volume_list(&v, list, 4) == 2);
    CHECK_INT(list[0].label, 3);
    CHECK_INT(list[1].label, 9);
    /* ball and column, cavity */
    CHECK_NEAR((list[0].volume_m3 + list[1].volume_m3) / (4 * PI / 3 * pow(radius_mm * 1e-3, 3) + 12 * NZ * 2.5e-9), 1,
               0.01);
    CHECK_NEAR((double)list[0].n_voxel * 2.5e-9, list[0].volume_m3, 1e-15);
    CHECK_INT(pal_label_volume_list(&v, list, 1), 1);
    pal_surface s = {0};
    pal_diagnostic diag = {{0}};
    CHECK_INT(pal_label_volume_surface(&v, 4, NULL, &s, &diag), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "label 4 is not in the scan, the largest there are 3 (25.1 ml), 9 (0.105 ml)");
    CHECK_INT(pal_label_volume_surface(&v, 0, NULL, &s, NULL), PAL_ERR_REFUSED);
    pal_label_volume_free(&v);
    free(b.at);
}

/* largest angle between the surface's vertex normals and the ball's, degrees */
static double worst_normal(const pal_surface *s, const double at_m[3])
{
    double *normal = malloc(sizeof *normal * 3 * (size_t)s->n_vertex), worst = 0;
    if (!normal) exit(1);
    pal_surface_normals(s, normal);
    for (int i = 0; i < s->n_vertex; i++) {
        double d[3], dd = 0, dn = 0;
        for (int a = 0; a < 3; a++) {
            d[a] = s->x[3 * i + a] + s->origin_m[a] - at_m[a];
            dd += d[a] * d[a];
            dn += d[a] * normal[3 * i + a];
        }
        worst = fmax(worst, acos(fmin(dn / sqrt(dd), 1)) * 180 / PI);
    }
    free(normal);
    return worst;
}

static void check_surface(const pal_label_volume *v, const double at_m[3], int target)
{
    pal_label_surface_options o = {.blur_m = -1, .smooth_rounds = -1, .target_tri = target};
    pal_surface s = {0};
    pal_surface_topology t;
    REQUIRE(pal_label_volume_surface(v, 3, &o, &s, NULL) == PAL_ERR_OK);
    REQUIRE(pal_surface_check(&s, &t) == PAL_ERR_OK);
    CHECK(t.closed && t.manifold && t.oriented);
    /* one component of genus 0: the stray column is dropped and the cavity filled */
    CHECK_INT(s.n_vertex - s.n_tri / 2, 2);
    if (target) CHECK_INT(s.n_tri, target);
    CHECK_NEAR(pal_surface_volume(&s) / (4 * PI / 3 * pow(radius_mm * 1e-3, 3)), 1, 0.01);
    double low[3], high[3];
    pal_surface_box(&s, low, high);
    for (int a = 0; a < 3; a++) {
        CHECK_NEAR(high[a] - low[a], 2e-3 * radius_mm, 1.2e-3);
        CHECK_NEAR(s.origin_m[a], at_m[a], 5e-4);
    }
    /* no staircase: a flight of 2 mm steps would be off by 15 degrees and more */
    CHECK_LE(worst_normal(&s, at_m), 10);
    pal_surface_free(&s);
}

static void ball_of_coarse_slices_is_smooth_closed_and_has_its_volume(void)
{
    bytes b = make_inr("unsigned fixed", 2, false);
    pal_label_volume v = {0};
    REQUIRE(parse("b.inr", b.at, b.n, &v, NULL) == PAL_ERR_OK);
    const double at_m[3] = {1e-3 * middle[0] * size_mm[0], 1e-3 * middle[1] * size_mm[1],
                            1e-3 * middle[2] * size_mm[2]};
    check_surface(&v, at_m, 0);
    check_surface(&v, at_m, 2000);
    /* without the smoothing the steps are there */
    pal_label_surface_options raw = {.blur_m = 1e-3, .smooth_rounds = 0};
    pal_surface s = {0};
    REQUIRE(pal_label_volume_surface(&v, 3, &raw, &s, NULL) == PAL_ERR_OK);
    CHECK(worst_normal(&s, at_m) > 15);
    pal_surface_free(&s);
    /* all parts: the column comes along, and the cavity stays */
    pal_label_surface_options all = {.blur_m = 0.5e-3, .smooth_rounds = 0, .all_components = true};
    REQUIRE(pal_label_volume_surface(&v, 3, &all, &s, NULL) == PAL_ERR_OK);
    int32_t *label = malloc(sizeof *label * (size_t)s.n_tri);
    int n = 0;
    REQUIRE(label && pal_surface_components(&s, label, &n) == PAL_ERR_OK);
    CHECK_INT(n, 3);
    free(label);
    pal_surface_free(&s);
    pal_label_volume_free(&v);
    free(b.at);
}

static void axes_turn_mirror_and_shift_the_body(void)
{
    /* sform: x to -y, y to z, z to x, mirrored, shifted, in metres; then a qform of a half turn about z with qfac -1 */
    bytes b = make_nifti(2, true, 0, 0);
    b.at[123] = 1;
    put(b.at + 254, 4, 1, true);
    static const double row[12] = {0, 0, 2e-3, 0.5, -1e-3, 0, 0, -0.2, 0, 1.25e-3, 0, 0};
    for (int k = 0; k < 12; k++) put(b.at + 280 + 4 * k, 16, row[k], true);
    pal_label_volume v = {0};
    REQUIRE(parse("s.nii", b.at, b.n, &v, NULL) == PAL_ERR_OK);
    const double at_m[3] = {0.5 + 2e-3 * middle[2], -0.2 - 1e-3 * middle[0], 1.25e-3 * middle[1]};
    check_surface(&v, at_m, 1500);
    CHECK_TEXT(v.axes, "RAS");
    pal_label_volume_free(&v);
    free(b.at);

    b = make_nifti(4, false, 0, 0);
    put(b.at + 252, 4, 1, false);
    put(b.at + 76, 16, -1, false);
    static const double quat[6] = {0, 0, 1, 100, 50, -20};
    for (int k = 0; k < 6; k++) put(b.at + 256 + 4 * k, 16, quat[k], false);
    REQUIRE(parse("q.nii", b.at, b.n, &v, NULL) == PAL_ERR_OK);
    const double turned[3] = {0.1 - 1e-3 * middle[0], 0.05 - 1.25e-3 * middle[1], -0.02 - 2e-3 * middle[2]};
    check_surface(&v, turned, 1500);
    CHECK_TEXT(v.axes, "RAS");
    pal_label_volume_free(&v);
    free(b.at);
}

static void a_file_without_directions_has_no_axes(void)
{
    bytes b[2] = {make_nifti(2, false, 0, 0), make_inr("unsigned fixed", 2, false)};
    for (int k = 0; k < 2; k++) {
        pal_label_volume v = {0};
        REQUIRE(parse(k ? "a.inr" : "a.nii", b[k].at, b[k].n, &v, NULL) == PAL_ERR_OK);
        CHECK_TEXT(v.axes, "");
        pal_label_volume_free(&v);
        free(b[k].at);
    }
}

static int n_hostile;

static void check_refused(const uint8_t *from, size_t n, const char *wanted)
{
    pal_label_volume v = {0};
    pal_diagnostic diag = {{0}};
    n_hostile++;
    check_count++;
    if (!parse("bad.scan", from, n, &v, &diag)) CHECK_FAIL("kind %d was accepted", n_hostile);
    bool placed = strncmp(diag.text, "bad.scan: byte ", 15) == 0 || strncmp(diag.text, "bad.scan: line ", 15) == 0;
    if (!placed || !strstr(diag.text, wanted)) CHECK_FAIL("kind %d: \"%s\"", n_hostile, diag.text);
    CHECK(v.label == NULL);
}

/* the file with one field changed, plain and packed */
static void check_field(const bytes *good, size_t at, int code, double value, const char *wanted)
{
    bytes b = {malloc(good->n), good->n};
    if (!b.at) exit(1);
    memcpy(b.at, good->at, good->n);
    put(b.at + at, code, value, false);
    bytes packed = pack(&b);
    check_refused(b.at, b.n, wanted);
    check_refused(packed.at, packed.n, wanted);
    free(packed.at);
    free(b.at);
}

static void hostile_nifti_is_refused_with_its_byte(void)
{
    bytes b = make_nifti(2, false, 0, 0), packed = pack(&b);
    n_hostile = 0;
    check_refused(b.at, 0, "empty");
    check_refused(b.at, 3, "neither");
    check_refused(b.at, 200, "byte 200: the file ends inside the 348 byte head");
    check_refused(b.at, b.n - 1, "the file ends, but 44 x 40 x 24 voxels need");
    check_refused(packed.at, packed.n / 2, "the unpacked file ends");
    check_field(&b, 40, 4, 2, "byte 40: 2 axes");
    check_field(&b, 42, 4, 0, "byte 42: axis 1 has 0 voxels");
    check_field(&b, 44, 4, -5, "byte 44: axis 2 has -5 voxels");
    check_field(&b, 42, 4, 32767, "the ");
    check_field(&b, 70, 4, 128, "byte 70: voxel type 128 is not read");
    check_field(&b, 80, 16, 0, "byte 76: the voxel axes");
    check_field(&b, 80, 16, (double)NAN, "byte 76: the voxel axes");
    check_field(&b, 108, 16, -1, "byte 108: voxels begin");
    check_field(&b, 108, 16, (double)NAN, "byte 108: voxels begin");
    check_field(&b, 108, 16, 9e8, "the ");
    check_field(&b, 112, 16, (double)INFINITY, "byte 112: the scale");
    check_field(&b, 344, 2, 'x', "byte 344: not a NIfTI-1 file");
    /* all three axes at their most: 3.5e13 voxels */
    for (int a = 0; a < 3; a++) put(b.at + 42 + 2 * a, 4, 32767, false);
    check_refused(b.at, b.n, "32767 x 32767 x 32767 voxels, at most");
    packed.at[packed.n / 2] ^= 0x55;
    packed.at[packed.n / 2 + 1] ^= 0xAA;
    pal_label_volume v = {0};
    pal_diagnostic diag = {{0}};
    /* damage may inflate to other voxels (the checksum is behind them); it must not do more */
    parse("bad.scan", packed.at, packed.n, &v, &diag);
    pal_label_volume_free(&v);
    CHECK(n_hostile >= 13);
    free(b.at);
    free(packed.at);
}

static void hostile_inrimage_is_refused_with_its_line(void)
{
    static const struct {
        const char *from, *to, *wanted;
    } change[] = {{"XDIM=44", "XDIM=-4", "line 2: XDIM is -4"},
                  {"XDIM=44", "XDIM=0 ", "line 2: XDIM is 0"},
                  {"XDIM=44", "XDIM=xx", "line 2: the value of XDIM is 'xx'"},
                  {"XDIM=44", "ADIM=44", "line 1: XDIM is 0"},
                  {"YDIM=40", "YDIM=99", "the file ends"},
                  {"YDIM=40", "YDIM   ", "line 3: expected KEY=value"},
                  {"ZDIM=24\nVDIM=1", "ZDIM=24\nVDIM=3", "line 5: VDIM is 3"},
                  {"ZDIM=24\nVDIM=1", "ZDIM=1e7\nVDIM=", "line 5: the value of VDIM is nothing"},
                  {"TYPE=unsigned fixed", "TYPE=unsigned magic", "the value of TYPE is 'magic'"},
                  {"PIXSIZE=8", "PIXSIZE=9", "line 7: TYPE and PIXSIZE do not name a voxel type"},
                  {"CPU=decm", "CPU=z80a", "line 9: the value of CPU is 'z80a'"},
                  {"VY=1.25", "VY=0.00", "line 11: a voxel of 1 x 0 x 2 mm"},
                  {"VY=1.25", "VY=nan ", "line 11: a voxel of 1 x nan x 2 mm"},
                  {"##}", "###", "no end of the header"}};
    bytes b = make_inr("unsigned fixed", 2, false);
    n_hostile = 0;
    check_refused(b.at, 0, "empty");
    check_refused(b.at, 100, "no end of the header");
    check_refused(b.at, 256, "byte 256: the file ends");
    check_refused(b.at, b.n - 1, "the file ends");
    for (size_t k = 0; k < sizeof change / sizeof *change; k++) {
        uint8_t *copy = malloc(b.n);
        if (!copy) exit(1);
        memcpy(copy, b.at, b.n);
        uint8_t *place = memmem(copy, 256, change[k].from, strlen(change[k].from));
        REQUIRE(place != NULL);
        memcpy(place, change[k].to, strlen(change[k].to));
        check_refused(copy, b.n, change[k].wanted);
        free(copy);
    }
    CHECK(n_hostile >= 13);
    free(b.at);
}

static void a_gzip_bomb_costs_no_more_than_its_header_asks_for(void)
{
    /* 40 MB of zeros behind a header that asks for 42 kB: what is too much is never unpacked */
    bytes b = make_nifti(2, false, 0, 0), large = {calloc(1, 40 << 20), 40 << 20};
    if (!large.at) exit(1);
    memcpy(large.at, b.at, b.n);
    bytes packed = pack(&large);
    CHECK(packed.n < 100000);
    check_ball(&packed, "nifti");
    /* a header that asks for all of it and more: unpacked once, then refused */
    for (int a = 0; a < 3; a++) put(large.at + 42 + 2 * a, 4, 800, false);
    free(packed.at);
    packed = pack(&large);
    check_refused(packed.at, packed.n, "byte 41943040: the unpacked file ends, but 800 x 800 x 800 voxels");
    free(packed.at);
    free(large.at);
    free(b.at);
}

static void packed_members_may_follow_one_another(void)
{
    bytes b = make_nifti(2, false, 0, 0), half[2] = {{b.at, b.n / 3}, {b.at + b.n / 3, b.n - b.n / 3}};
    bytes first = pack(&half[0]), second = pack(&half[1]), both = {malloc(first.n + second.n), first.n + second.n};
    if (!both.at) exit(1);
    memcpy(both.at, first.at, first.n);
    memcpy(both.at + first.n, second.at, second.n);
    check_ball(&both, "nifti");
    free(both.at);
    free(first.at);
    free(second.at);
    free(b.at);
}

static void slopes_of_a_few_degrees_leave_no_terraces(void)
{
    /* a block in 2.5 mm slices whose top rises by 1 in 20: terraces 50 mm wide, which no small blur takes out */
    enum { N = 140, M = 60, L = 16 };
    static int32_t label[L * M * N];
    pal_label_volume v = {.n = {N, M, L}, .to_m = {1e-3, 0, 0, 0, 0, 1e-3, 0, 0, 0, 0, 2.5e-3, 0}, .label = label};
    for (int i = 0; i < L * M * N; i++) {
        int x = i % N, y = i / N % M;
        double z = 2.5 * (i / N / M);
        label[i] = x > 3 && x < N - 4 && y > 3 && y < M - 4 && z > 5 && z < 25 + (x - N / 2) / 20.0;
    }
    pal_label_surface_options o = {.blur_m = -1, .smooth_rounds = -1};
    double worst[2] = {0, 0};
    for (int k = 0; k < 2; k++, o.smooth_rounds = 0) {
        pal_surface s = {0};
        REQUIRE(pal_label_volume_surface(&v, 1, &o, &s, NULL) == PAL_ERR_OK);
        double *normal = malloc(sizeof *normal * 3 * (size_t)s.n_vertex), slope = 1 / sqrt(401.0);
        REQUIRE(normal != NULL);
        pal_surface_normals(&s, normal);
        for (int i = 0; i < s.n_vertex; i++) {
            const double *x = s.x + 3 * i, *n = normal + 3 * i;
            if (fabs(x[0]) > 0.045 || fabs(x[1]) > 0.015 || x[2] < 0) continue;
            double cosine = slope * (20 * n[2] - n[0]);
            worst[k] = fmax(worst[k], acos(fmin(cosine, 1)) * 180 / PI);
        }
        free(normal);
        pal_surface_free(&s);
    }
    printf("  worst normal on the slope: %.1f degrees off, %.1f without smoothing\n", worst[0], worst[1]);
    CHECK_LE(worst[0], 11);
    CHECK(worst[1] > 18);
}

static void damage_is_found_wherever_it_is_in_a_packed_file(void)
{
    /* larger than the piece that the header is read from; the checksum is the last thing in the file */
    bytes b = make_nifti(64, false, 0, 0), packed = pack(&b);
    CHECK(b.n > 300000);
    packed.at[packed.n - 6] ^= 1;
    check_refused(packed.at, packed.n, "the compressed data are damaged");
    packed.at[packed.n - 6] ^= 1;
    check_ball(&packed, "nifti");
    free(packed.at);
    free(b.at);
}

static void plates_rods_and_specks_keep_their_volume(void)
{
    /* boxes of voxels: size of each, and the surface must be one closed piece */
    static const int box[][3] = {{40, 40, 1}, {40, 2, 40}, {4, 4, 100}, {2, 60, 30}, {10, 10, 10}, {1, 1, 1}};
    for (size_t k = 0; k < sizeof box / sizeof *box; k++) {
        const int *n = box[k], m[3] = {n[0] + 4, n[1] + 4, n[2] + 4};
        pal_label_volume v = {.n = {m[0], m[1], m[2]}, .to_m = {7e-4, 0, 0, 0, 0, 7e-4, 0, 0, 0, 0, 1.5e-3, 0}};
        v.label = calloc((size_t)m[0] * (size_t)m[1] * (size_t)m[2], sizeof *v.label);
        REQUIRE(v.label != NULL);
        for (int z = 0; z < n[2]; z++)
            for (int y = 0; y < n[1]; y++)
                for (int x = 0; x < n[0]; x++) v.label[((z + 2) * m[1] + y + 2) * m[0] + x + 2] = 1;
        pal_surface s = {0};
        pal_surface_topology t;
        REQUIRE(pal_label_volume_surface(&v, 1, NULL, &s, NULL) == PAL_ERR_OK);
        REQUIRE(pal_surface_check(&s, &t) == PAL_ERR_OK);
        CHECK(t.closed && t.manifold && t.oriented);
        CHECK_INT(s.n_vertex - s.n_tri / 2, 2);
        CHECK_NEAR(pal_surface_volume(&s) / (n[0] * n[1] * n[2] * 7e-4 * 7e-4 * 1.5e-3), 1, 0.02);
        pal_surface_free(&s);
        pal_label_volume_free(&v);
    }
}

static void voxels_like_needles_are_refused_before_they_cost_memory(void)
{
    enum { N = 1000 };
    int32_t label[N];
    for (int i = 0; i < N; i++) label[i] = 1;
    /* 1 x 1 x 1000 voxels of 1 um x 1 um x 1 m */
    pal_label_volume v = {.n = {1, 1, N}, .to_m = {1e-6, 0, 0, 0, 0, 1e-6, 0, 0, 0, 0, 1, 0}, .label = label};
    pal_surface s = {0};
    pal_diagnostic diag = {{0}};
    CHECK_INT(pal_label_volume_surface(&v, 1, NULL, &s, &diag), PAL_ERR_BUDGET);
    CHECK(s.x == NULL && diag.text[0] != 0);
}

static void files_are_distinguished_by_name_or_content(void)
{
    bytes b = make_inr("unsigned fixed", 2, false), packed = pack(&b);
    char path[] = "/tmp/pal_label_XXXXXX";
    int fd = mkstemp(path);
    REQUIRE(fd >= 0);
    CHECK(!pal_label_volume_is(path));
    CHECK(write(fd, packed.at, packed.n) == (ssize_t)packed.n);
    close(fd);
    CHECK(pal_label_volume_is(path));
    pal_label_volume v = {0};
    CHECK_INT(pal_label_volume_read(path, &v, NULL), PAL_ERR_OK);
    pal_label_volume_free(&v);
    unlink(path);
    CHECK(pal_label_volume_is("no/such/scan.NII.gz"));
    CHECK(!pal_label_volume_is("no/such/scan.obj"));
    CHECK_INT(pal_label_volume_read("no/such/scan.nii", &v, NULL), PAL_ERR_IO);
    free(b.at);
    free(packed.at);
}

int main(void)
{
    RUN(reads_every_nifti_type_in_both_orders_plain_and_packed);
    RUN(reads_inrimage_types_in_both_orders_plain_and_packed);
    RUN(lists_labels_by_size);
    RUN(ball_of_coarse_slices_is_smooth_closed_and_has_its_volume);
    RUN(axes_turn_mirror_and_shift_the_body);
    RUN(a_file_without_directions_has_no_axes);
    RUN(hostile_nifti_is_refused_with_its_byte);
    RUN(hostile_inrimage_is_refused_with_its_line);
    RUN(a_gzip_bomb_costs_no_more_than_its_header_asks_for);
    RUN(slopes_of_a_few_degrees_leave_no_terraces);
    RUN(packed_members_may_follow_one_another);
    RUN(damage_is_found_wherever_it_is_in_a_packed_file);
    RUN(plates_rods_and_specks_keep_their_volume);
    RUN(voxels_like_needles_are_refused_before_they_cost_memory);
    RUN(files_are_distinguished_by_name_or_content);
    return check_report();
}
