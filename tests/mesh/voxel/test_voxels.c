/* Voxels: what is inside whatever the surface's faults, exact ties, refusals. */
#include "server/mesh/geometry/tets.h"
#include "server/mesh/voxel/voxels.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/shapes.h"
#include "tests/mesh/voxel/flood.h"
#include "tests/stability/hard_case.h"

static pal_diagnostic diag;
static pal_voxel_report report;

static pal_err fill(const pal_surface *s, int resolution, const char *method, pal_voxels *out)
{
    static const char *const name[] = {"scanline", "vote", "winding"};
    pal_voxel_options options = {.resolution = resolution, .border = true};
    for (int k = 0; k < 3; k++)
        if (method && !strcmp(method, name[k])) options.method = PAL_VOXELS_SCANLINE + (pal_voxel_method)k;
    return pal_voxels_fill(s, &options, out, &report, &diag);
}

/* fills, checks the inside volume and method ("" for any), frees both */
static void expect_volume(pal_surface s, int resolution, double volume, double tolerance, const char *method)
{
    pal_voxels v;
    pal_err err = fill(&s, resolution, NULL, &v);
    pal_surface_free(&s);
    if (err) {
        CHECK_FAIL("refused: %s", diag.text);
        return;
    }
    CHECK_NEAR(report.inside_volume_m3 / volume, 1, tolerance);
    if (tolerance <= 0.05)
        HARD_CASE("broken_surface", "tet_springs fem", "open, doubled, crossing, turned: volume off its twin's",
                  100 * fabs(report.inside_volume_m3 / volume - 1), 5, "%");
    if (*method) CHECK_TEXT(report.method, method);
    pal_voxels_free(&v);
}

static double sphere_volume(double r)
{
    return 4 * SHAPE_PI / 3 * r * r * r;
}

static double torus_volume(double ring, double tube)
{
    return 2 * SHAPE_PI * SHAPE_PI * ring * tube * tube;
}

static void closed_shapes_have_their_volume(void)
{
    expect_volume(shape_sphere(0.1), 40, sphere_volume(0.1), 0.02, "scanline");
    expect_volume(shape_torus(0.1, 0.04, 64, 32), 50, torus_volume(0.1, 0.04), 0.02, "scanline");
    expect_volume(shape_cube(0.3), 20, 0.027, 1e-12, "scanline");
    expect_volume(shape_octahedron(1), 64, 4.0 / 3, 0.05, "scanline");
}

static void inside_out_shapes_have_their_volume(void)
{
    pal_surface s = shape_sphere(0.1);
    shape_invert(&s);
    expect_volume(s, 40, sphere_volume(0.1), 0.02, "scanline");
}

static void unwelded_triangles_have_their_volume(void)
{
    pal_surface s = shape_sphere(0.1);
    shape_unweld(&s);
    expect_volume(s, 40, sphere_volume(0.1), 0.02, "scanline");
}

static void doubled_surfaces_do_not_cancel(void)
{
    /* exact copies, one turned inside out, one moved by a twentieth of a voxel, three in all */
    expect_volume(shape_join(shape_sphere(0.1), shape_sphere(0.1)), 40, sphere_volume(0.1), 0.02, "scanline");
    pal_surface turned = shape_sphere(0.1), moved = shape_sphere(0.1);
    shape_invert(&turned);
    expect_volume(shape_join(shape_sphere(0.1), turned), 40, sphere_volume(0.1), 0.02, "scanline");
    shape_move(&moved, 0.0003, 0, 0.0002);
    expect_volume(shape_join(shape_join(shape_sphere(0.1), moved), shape_sphere(0.1)), 40, sphere_volume(0.1), 0.03,
                  "");
}

static void reversed_copy_beside_its_twin_is_no_cavity(void)
{
    /* a hundredth of a voxel within */
    pal_surface turned = shape_sphere(0.1 - 0.00005);
    shape_invert(&turned);
    expect_volume(shape_join(shape_sphere(0.1), turned), 40, sphere_volume(0.1), 0.02, "scanline");
}

static void doubled_fin_leaves_a_closed_body_closed(void)
{
    /* a fin outside that shares an edge with the cube, there in both senses: every edge stays even */
    pal_surface s = shape_cube(0.2), fin = shape_room(3, 2);
    const double corner[9] = {0.1, 0.1, -0.1, 0.1, 0.1, 0.1, 0.17, 0.19, 0.03};
    const int32_t both[6] = {0, 1, 2, 1, 0, 2};
    memcpy(fin.x, corner, sizeof corner);
    memcpy(fin.tri, both, sizeof both);
    expect_volume(shape_join(s, fin), 40, 0.008, 0.05, "scanline");
    CHECK(!report.open);
}

static void overlapping_shapes_are_joined(void)
{
    /* two balls of radius r, centres r apart: the lens of each is 5/12 pi r^3 in all */
    double r = 0.1, joined = 2 * sphere_volume(r) - 5.0 / 12 * SHAPE_PI * r * r * r;
    for (int turned = 0; turned < 2; turned++) {
        pal_surface other = shape_sphere(r);
        shape_move(&other, r, 0.0007, 0.0003);
        if (turned) shape_invert(&other);
        expect_volume(shape_join(shape_sphere(r), other), 60, joined, 0.02, "scanline");
    }
}

static void inward_parts_within_stay_empty(void)
{
    for (int turned = 0; turned < 2; turned++) {
        pal_surface cavity = shape_sphere(0.06);
        shape_invert(&cavity);
        pal_surface s = shape_join(shape_sphere(0.1), cavity);
        if (turned) shape_invert(&s);
        pal_voxels v;
        REQUIRE(!fill(&s, 30, "winding", &v));
        HARD_CASE("cavities", "tet_springs fem", "volume of a shell off by",
                  100 * fabs(report.inside_volume_m3 / (sphere_volume(0.1) - sphere_volume(0.06)) - 1), 2, "%");
        pal_voxels_free(&v);
        expect_volume(s, 50, sphere_volume(0.1) - sphere_volume(0.06), 0.02, "scanline");
    }
    /* an island in the cavity, the outer shell doubled */
    pal_surface cavity = shape_sphere(0.07);
    shape_invert(&cavity);
    pal_surface shells = shape_join(shape_join(shape_sphere(0.1), shape_sphere(0.1)), cavity);
    expect_volume(shape_join(shells, shape_sphere(0.04)), 60,
                  sphere_volume(0.1) - sphere_volume(0.07) + sphere_volume(0.04), 0.02, "scanline");
}

static void outward_parts_within_stay_full(void)
{
    expect_volume(shape_join(shape_sphere(0.1), shape_sphere(0.06)), 50, sphere_volume(0.1), 0.02, "scanline");
}

static void reversed_triangles_are_corrected(void)
{
    uint64_t state = 3;
    pal_surface s = shape_sphere(0.1);
    for (int t = 0; t < s.n_tri; t++)
        if (random_below(&state, 2)) {
            int32_t swap = s.tri[3 * t];
            s.tri[3 * t] = s.tri[3 * t + 1];
            s.tri[3 * t + 1] = swap;
        }
    expect_volume(s, 40, sphere_volume(0.1), 0.02, "scanline");
}

static void open_shapes_are_closed_by_vote_or_winding_number(void)
{
    /* one triangle missing, a tenth missing, half missing: a bowl is full to its rim */
    pal_surface s = shape_sphere(0.1);
    s.n_tri--;
    expect_volume(s, 40, sphere_volume(0.1), 0.02, "vote");
    s = shape_sphere(0.1);
    shape_cut(&s, 0.085);
    expect_volume(s, 40, sphere_volume(0.1), 0.05, "");
    s = shape_sphere(0.1);
    shape_cut(&s, 0);
    expect_volume(s, 40, sphere_volume(0.1) / 2, 0.1, "");
    /* a turned bowl, so that no axis sees it whole */
    uint64_t state = 8;
    s = shape_sphere(0.1);
    shape_cut(&s, 0.05);
    shape_rotate(&s, &state);
    expect_volume(s, 40, sphere_volume(0.1) * 0.844, 0.1, "");
}

static void surface_volume_has_its_holes_closed_flat(void)
{
    pal_voxels v;
    pal_surface s = shape_sphere(0.1);
    double whole = pal_surface_volume(&s);
    REQUIRE(!fill(&s, 40, NULL, &v));
    CHECK(!report.open);
    CHECK_NEAR(report.surface_volume_m3 / whole, 1, 1e-4);
    pal_voxels_free(&v);
    /* half a ball turned inside out, and a tube without its ends, which has two rims in one part */
    shape_cut(&s, 0);
    shape_invert(&s);
    double low[3] = {-0.05, -0.05, -0.2}, high[3] = {0.05, 0.05, 0.2};
    pal_surface tube = shape_box(low, high);
    memmove(tube.tri, tube.tri + 12, 24 * sizeof *tube.tri);
    tube.n_tri = 8;
    for (int shape = 0; shape < 2; shape++) {
        REQUIRE(!fill(shape ? &tube : &s, 40, NULL, &v));
        CHECK(report.open);
        CHECK_NEAR(report.surface_volume_m3 / (shape ? 0.004 : whole / 2), 1, 1e-4);
        pal_voxels_free(&v);
    }
    pal_surface_free(&tube);
    pal_surface_free(&s);
}

static void open_tube_is_a_volume(void)
{
    /* a long box without its two ends */
    double low[3] = {-0.05, -0.05, -0.2}, high[3] = {0.05, 0.05, 0.2};
    pal_surface s = shape_box(low, high);
    memmove(s.tri, s.tri + 12, 24 * sizeof *s.tri);
    s.n_tri = 8;
    expect_volume(s, 60, 0.004, 0.15, "winding");
}

static void inner_wall_does_not_empty_its_row(void)
{
    /* a box with a sheet across its middle that shares the box's edges */
    double low[3] = {-0.1, -0.1, -0.1}, middle[3] = {0, 0.1, 0.1}, high[3] = {0.1, 0.1, 0.1}, low2[3] = {0, -0.1, -0.1};
    pal_surface s = shape_box(low, middle), other = shape_box(low2, high);
    other.n_tri = 0;
    for (int t = 0; t < 12; t++) {
        const double *a = other.x + 3 * other.tri[3 * t], *b = other.x + 3 * other.tri[3 * t + 1],
                     *c = other.x + 3 * other.tri[3 * t + 2];
        if (a[0] == 0 && b[0] == 0 && c[0] == 0) continue;
        memmove(other.tri + 3 * other.n_tri++, other.tri + 3 * t, 3 * sizeof *other.tri);
    }
    expect_volume(shape_join(s, other), 20, 0.008, 1e-12, "vote");
}

static void every_component_is_found(void)
{
    pal_surface s = shape_sphere(0.03);
    for (int k = 1; k < 4; k++) {
        pal_surface other = shape_sphere(0.03);
        shape_move(&other, 0.1 * k, 0.001 * k, 0);
        s = shape_join(s, other);
    }
    pal_voxels v;
    REQUIRE(!fill(&s, 60, NULL, &v));
    HARD_CASE_ALL("cavities", "tet_springs fem", "pieces found", report.n_component, 4);
    int64_t all = v.n_inside;
    pal_voxels_free(&v);
    REQUIRE(!flood_voxels(&s, 60, &v, &diag));
    CHECK_INT(v.n_inside, all);
    pal_voxels_free(&v);
    pal_voxel_options options = {.resolution = 60, .border = true, .largest_only = true};
    REQUIRE(!pal_voxels_fill(&s, &options, &v, &report, &diag));
    CHECK_NEAR((double)v.n_inside / (double)all, 0.25, 0.01);
    pal_voxels_free(&v);
    pal_surface_free(&s);
}

static void components_are_counted_with_their_border(void)
{
    /* two boxes of 4 voxels: 3 apart their borders leave a gap, 2 apart they touch */
    for (int gap = 2; gap <= 3; gap++) {
        double low[3] = {0, 0, 0}, high[3] = {4, 4, 4}, low2[3] = {4 + gap, 0, 0}, high2[3] = {8 + gap, 4, 4};
        pal_surface s = shape_join(shape_box(low, high), shape_box(low2, high2));
        pal_voxels v;
        REQUIRE(!fill(&s, 8 + gap, NULL, &v));
        CHECK_INT(v.n_inside, 128);
        CHECK_INT(report.n_component, gap == 3 ? 2 : 1);
        pal_tets t;
        int n_part = 0;
        REQUIRE(!pal_voxels_split(&v, &t));
        int32_t *label = calloc((size_t)t.n_tet, sizeof *label);
        REQUIRE(label && !pal_tets_components(&t, label, &n_part));
        free(label);
        CHECK_INT(report.n_component, n_part);
        pal_tets_free(&t);
        pal_voxels_free(&v);
        pal_voxel_options options = {.resolution = 8 + gap, .border = true, .largest_only = true};
        REQUIRE(!pal_voxels_fill(&s, &options, &v, &report, &diag));
        CHECK_INT(v.n_inside, 64);
        CHECK_INT(report.n_component, 1);
        pal_voxels_free(&v);
        pal_surface_free(&s);
    }
}

/* voxels where two fills differ */
static int64_t count_different(const pal_voxels *a, const pal_voxels *b)
{
    int64_t n = 0;
    for (size_t i = 0; i < (size_t)a->n[0] * (size_t)a->n[1] * (size_t)a->n[2]; i++) n += a->kind[i] != b->kind[i];
    return n;
}

static void all_methods_agree_on_closed_shapes(void)
{
    static const char *const METHOD[] = {"scanline", "vote", "winding"};
    for (int shape = 0; shape < 3; shape++) {
        pal_surface s = shape == 0   ? shape_ball(0.1, 40, 20, 0.2)
                        : shape == 1 ? shape_torus(0.1, 0.04, 50, 24)
                                     : shape_octahedron(0.1);
        uint64_t state = 11;
        shape_rotate(&s, &state);
        pal_voxels first, v;
        REQUIRE(!fill(&s, 25, NULL, &first));
        for (int m = 0; m < 4; m++) {
            REQUIRE(!(m < 3 ? fill(&s, 25, METHOD[m], &v) : flood_voxels(&s, 25, &v, &diag)));
            if (m < 3) CHECK_TEXT(report.method, m == 0 ? "scanline" : m == 1 ? "vote" : "winding");
            CHECK_INT(count_different(&first, &v), 0);
            pal_voxels_free(&v);
        }
        pal_voxels_free(&first);
        pal_surface_free(&s);
    }
}

static void flood_reports_a_leak(void)
{
    pal_surface s = shape_cube(0.1);
    s.n_tri--;
    pal_voxels v;
    CHECK_INT(flood_voxels(&s, 10, &v, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "leaks"));
    pal_surface_free(&s);
}

static void border_is_the_layer_beside_the_inside(void)
{
    pal_surface s = shape_ball(0.1, 40, 20, 0.3);
    pal_voxels v;
    REQUIRE(!fill(&s, 70, NULL, &v));
    int64_t bad = 0, n_kind[3] = {0};
    for (int z = 0; z < v.n[2]; z++)
        for (int y = 0; y < v.n[1]; y++)
            for (int x = 0; x < v.n[0]; x++) {
                const uint8_t *k = v.kind + ((size_t)z * (size_t)v.n[1] + (size_t)y) * (size_t)v.n[0] + x;
                size_t sy = (size_t)v.n[0], sz = sy * (size_t)v.n[1];
                bool beside = (x > 0 && k[-1] == 2) || (x + 1 < v.n[0] && k[1] == 2) || (y > 0 && *(k - sy) == 2) ||
                              (y + 1 < v.n[1] && k[sy] == 2) || (z > 0 && *(k - sz) == 2) ||
                              (z + 1 < v.n[2] && k[sz] == 2);
                n_kind[*k]++;
                if (*k != 2) bad += beside != (*k == 1);
            }
    CHECK_INT(bad, 0);
    CHECK_INT(n_kind[1], v.n_border);
    CHECK_INT(n_kind[2], v.n_inside);
    CHECK_INT(v.n[0] > v.n[1] ? v.n[0] : v.n[1], 72);
    pal_voxels_free(&v);
    pal_surface_free(&s);
}

/* how far beyond a convex shape's planes a point lies, in metres: negative inside */
static double outside_of(const pal_surface *s, const double p[3])
{
    double max = -1e300;
    for (int t = 0; t < s->n_tri; t++) {
        const double *a = s->x + 3 * s->tri[3 * t], *b = s->x + 3 * s->tri[3 * t + 1],
                     *c = s->x + 3 * s->tri[3 * t + 2];
        double u[3], w[3], n[3], d[3];
        for (int k = 0; k < 3; k++) u[k] = b[k] - a[k], w[k] = c[k] - a[k], d[k] = p[k] - a[k];
        for (int k = 0; k < 3; k++) n[k] = u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3];
        double side = (n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) / sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        if (side > max) max = side;
    }
    return max;
}

static void thousand_rotations_give_the_convex_shapes_own_voxels(void)
{
    uint64_t state = 1;
    int64_t wrong = 0, disagree = 0;
    for (int k = 0; k < 1000; k++) {
        pal_surface s = k & 1 ? shape_cube(0.1) : shape_octahedron(0.1);
        shape_rotate(&s, &state);
        pal_voxels v;
        if (fill(&s, 12, k % 10 == 0 ? "vote" : NULL, &v)) {
            CHECK_FAIL("rotation %d: %s", k, diag.text);
            pal_surface_free(&s);
            continue;
        }
        disagree += report.n_disagree;
        const uint8_t *kind = v.kind;
        for (int z = 0; z < v.n[2]; z++)
            for (int y = 0; y < v.n[1]; y++)
                for (int x = 0; x < v.n[0]; x++, kind++) {
                    double p[3] = {v.low_m[0] + v.edge_m * (x + 0.5), v.low_m[1] + v.edge_m * (y + 0.5),
                                   v.low_m[2] + v.edge_m * (z + 0.5)};
                    double out = outside_of(&s, p) / v.edge_m;
                    if (fabs(out) < 1e-4) continue;
                    wrong += (out < 0) != (*kind == 2);
                }
        pal_voxels_free(&v);
        pal_surface_free(&s);
    }
    HARD_CASE("ray_ties", "tet_springs fem", "1,000 turns: voxels on the wrong side", (double)wrong, 0, "");
    CHECK_INT(disagree, 0);
}

/* inside voxels of a surface, which is freed, in the grid of n unit voxels from the origin; specks in two far corners
 * hold the grid. No two axes may disagree. */
static int64_t count_in_grid(pal_surface s, int n, const char *method)
{
    double low[3] = {0, 0, 0}, high[3] = {n, n, n};
    pal_surface specks = shape_box(low, high);
    for (int t = 0; t < 12; t++) specks.tri[3 * t + 2] = specks.tri[3 * t + 1] = specks.tri[3 * t];
    pal_surface both = shape_join(s, specks);
    pal_voxels v;
    int64_t n_inside = -1;
    if (fill(&both, n, method, &v)) {
        CHECK_FAIL("%s", diag.text);
    } else {
        CHECK_INT(report.n_disagree, 0);
        n_inside = v.n_inside;
        pal_voxels_free(&v);
    }
    pal_surface_free(&both);
    return n_inside;
}

static void centres_on_vertices_edges_and_faces_belong_to_one_side_on_every_axis(void)
{
    /* 2 m octahedron in voxels of odd count: rows of centres run through corners and along edges */
    for (int n = 3; n <= 41; n += 2) {
        pal_surface s = shape_octahedron(1);
        static const char *const METHOD[] = {"scanline", "vote"};
        int64_t first = -1;
        for (int m = 0; m < 2; m++) {
            pal_voxels v;
            REQUIRE(!fill(&s, n, METHOD[m], &v));
            CHECK_INT(report.n_disagree, 0);
            if (first < 0) first = v.n_inside;
            CHECK_INT(v.n_inside, first);
            CHECK_INT(report.n_component, 1);
            pal_voxels_free(&v);
        }
        pal_surface_free(&s);
    }
    /* cubes that tile space share no voxel and leave none: eight cubes whose faces all lie on planes of centres */
    for (int m = 0; m < 2; m++) {
        int64_t sum = 0;
        for (int k = 0; k < 8; k++) {
            double a[3], b[3];
            for (int d = 0; d < 3; d++) {
                a[d] = k >> d & 1 ? 5.5 : 0;
                b[d] = k >> d & 1 ? 11 : 5.5;
            }
            sum += count_in_grid(shape_box(a, b), 11, m ? "vote" : "scanline");
        }
        CHECK_INT(sum, 11 * 11 * 11);
    }
}

static void centres_on_slanted_faces_belong_to_one_side_on_every_axis(void)
{
    /* octahedron of radius r voxels round a centre: all centres with |i| + |j| + |k| = r lie on it, and those that the
     * shift (e, e^2, e^3) takes inside have i < 0 */
    for (int r = 1; r <= 9; r++) {
        int64_t expected = 0;
        for (int i = -r; i <= r; i++)
            for (int j = -r; j <= r; j++)
                for (int k = -r; k <= r; k++) {
                    int sum = abs(i) + abs(j) + abs(k);
                    expected += sum < r || (sum == r && i < 0);
                }
        for (int m = 0; m < 2; m++) {
            pal_surface s = shape_octahedron(r);
            shape_move(&s, r + 0.5, r + 0.5, r + 0.5);
            CHECK_INT(count_in_grid(s, 2 * r + 1, m ? "vote" : "scanline"), expected);
        }
    }
}

static void refused(pal_surface s, int resolution, const char *words)
{
    pal_voxels v;
    pal_err err = fill(&s, resolution, NULL, &v);
    CHECK_INT(err, PAL_ERR_REFUSED);
    HARD_CASE_ALL("broken_surface", "tet_springs fem", "without a volume, NaN: refused with numbers",
                  err && strstr(diag.text, words), 1);
    if (!err) {
        CHECK_FAIL("%lld voxels inside by %s, wanted %s", (long long)v.n_inside, report.method, words);
        pal_voxels_free(&v);
    } else if (!strstr(diag.text, words))
        CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, words);
    pal_surface_free(&s);
}

/* band of quads with a half twist (Moebius) or none */
static pal_surface band(double radius, double width, double twist)
{
    enum { N = 60 };
    pal_surface s = shape_room(2 * (N + 1), 2 * N);
    for (int i = 0; i <= N; i++) {
        double a = 2 * SHAPE_PI * i / N, b = twist * a / 2;
        for (int k = 0; k < 2; k++) {
            double w = (k - 0.5) * width, r = radius + w * sin(b), *x = s.x + 3 * (2 * i + k);
            x[0] = r * cos(a), x[1] = r * sin(a), x[2] = w * cos(b);
        }
        if (i == N) continue;
        int32_t p = 2 * i, two[6] = {p, p + 2, p + 3, p, p + 3, p + 1};
        memcpy(s.tri + 6 * i, two, sizeof two);
    }
    return s;
}

static pal_surface sheet(double bend)
{
    enum { N = 20 };
    pal_surface s = shape_room((N + 1) * (N + 1), 2 * N * N);
    int32_t *to = s.tri;
    for (int i = 0; i <= N; i++)
        for (int j = 0; j <= N; j++) {
            double u = 2.0 * i / N - 1, w = 2.0 * j / N - 1, *x = s.x + 3 * (i * (N + 1) + j);
            x[0] = u, x[1] = w, x[2] = bend * (u * u + w * w);
            if (i == N || j == N) continue;
            int32_t p = i * (N + 1) + j, two[6] = {p, p + N + 1, p + N + 2, p, p + N + 2, p + 1};
            memcpy(to, two, sizeof two);
            to += 6;
        }
    return s;
}

static void surfaces_without_a_volume_are_refused_with_numbers(void)
{
    uint64_t state = 4;
    refused(sheet(0), 20, "reason 3");
    refused(sheet(0.2), 20, "reason 3");
    for (int k = 0; k < 5; k++) {
        pal_surface s = sheet(k * 0.05);
        shape_rotate(&s, &state);
        refused(s, 30, "reason 3");
    }
    refused(band(0.1, 0.03, 1), 40, "reason 3");
    refused(band(0.1, 0.03, 0), 40, "reason 3");
    pal_surface one = shape_cube(1);
    one.n_tri = 1;
    refused(one, 10, "reason 3");
    pal_surface point = shape_cube(0);
    refused(point, 10, "reason 1");
    pal_surface nan = shape_cube(1);
    for (int k = 0; k < 24; k++) nan.x[k] = NAN;
    refused(nan, 10, "reason 1");
    double low[3] = {0, 0, 0}, high[3] = {1, 1, 0.001};
    pal_surface plate = shape_box(low, high);
    refused(plate, 10, "reason 2");
    pal_surface none = shape_cube(1);
    none.n_tri = 0;
    refused(none, 10, "reason 1");
}

static void options_out_of_range_are_refused(void)
{
    pal_surface s = shape_cube(1);
    pal_voxels v;
    CHECK_INT(fill(&s, 0, NULL, &v), PAL_ERR_REFUSED);
    CHECK_INT(fill(&s, 1025, NULL, &v), PAL_ERR_REFUSED);
    pal_voxel_options options = {.resolution = 50, .max_voxel = 1000};
    CHECK_INT(pal_voxels_fill(&s, &options, &v, &report, &diag), PAL_ERR_BUDGET);
    CHECK(strstr(diag.text, "125000"));
    CHECK_INT(fill(&s, 1, NULL, &v), PAL_ERR_OK);
    CHECK_INT(v.n_inside, 1);
    CHECK_INT(v.n_border, 6);
    pal_voxels_free(&v);
    pal_surface_free(&s);
}

static void noise_is_refused_within_a_budget(void)
{
    enum { N = 20000 };
    uint64_t state = 9;
    pal_surface s = shape_room(3 * N, N);
    for (int i = 0; i < 9 * N; i++) s.x[i] = random_signed(&state);
    for (int i = 0; i < 3 * N; i++) s.tri[i] = i;
    pal_voxels v;
    pal_err err = fill(&s, 100, NULL, &v);
    CHECK(err == PAL_ERR_BUDGET || err == PAL_ERR_REFUSED);
    if (!err) pal_voxels_free(&v);
    /* few triangles of noise are judged like any open surface, whatever comes out */
    s.n_tri = 300;
    if (!fill(&s, 20, NULL, &v)) {
        CHECK_LE((double)v.n_inside, 20 * 20 * 20);
        pal_voxels_free(&v);
    }
    pal_surface_free(&s);
}

static void large_and_sliver_triangles_are_scanned_like_small_ones(void)
{
    /* a rotated box whose sides are cut into fans of slivers has the same voxels as with two triangles a side */
    uint64_t state = 12;
    for (int k = 0; k < 20; k++) {
        double low[3] = {-0.5, -0.3, -0.2}, high[3] = {0.5, 0.3, 0.2};
        enum { N = 50 };
        pal_surface plain = shape_box(low, high), fan = shape_room(8 + N, 12 + 2 * N);
        memcpy(fan.x, plain.x, 24 * sizeof *fan.x);
        memcpy(fan.tri, plain.tri, 36 * sizeof *fan.tri);
        /* triangles 0 and 1 share the diagonal from corner 0 to 3: points along it, closer and closer */
        int32_t *to = fan.tri, edge[2][2] = {{2, 0}, {1, 0}};
        for (int i = 0; i < N; i++)
            for (int d = 0; d < 3; d++) {
                double t = (double)(i + 1) * (i + 1) / ((N + 1) * (N + 1));
                fan.x[3 * (8 + i) + d] = fan.x[d] + t * (fan.x[9 + d] - fan.x[d]);
            }
        for (int side = 0; side < 2; side++)
            for (int i = 0; i <= N; i++, to += 3) {
                int32_t a = i == 0 ? 0 : 7 + i, b = i == N ? 3 : 8 + i;
                to[0] = a, to[1] = side == 0 ? edge[0][0] : b, to[2] = side == 0 ? b : edge[1][0];
            }
        memcpy(to, plain.tri + 6, 30 * sizeof *to);
        fan.n_tri = 2 * (N + 1) + 10;
        uint64_t same = state;
        shape_rotate(&plain, &state);
        shape_rotate(&fan, &same);
        pal_voxels a, b;
        REQUIRE(!fill(&plain, 100, NULL, &a));
        CHECK_TEXT(report.method, "scanline");
        REQUIRE(!fill(&fan, 100, NULL, &b));
        CHECK_TEXT(report.method, "scanline");
        CHECK_LE((double)count_different(&a, &b), 3);
        pal_voxels_free(&a);
        pal_voxels_free(&b);
        pal_surface_free(&plain);
        pal_surface_free(&fan);
    }
}

int main(void)
{
    RUN(closed_shapes_have_their_volume);
    RUN(inside_out_shapes_have_their_volume);
    RUN(unwelded_triangles_have_their_volume);
    RUN(doubled_surfaces_do_not_cancel);
    RUN(reversed_copy_beside_its_twin_is_no_cavity);
    RUN(doubled_fin_leaves_a_closed_body_closed);
    RUN(overlapping_shapes_are_joined);
    RUN(inward_parts_within_stay_empty);
    RUN(outward_parts_within_stay_full);
    RUN(reversed_triangles_are_corrected);
    RUN(open_shapes_are_closed_by_vote_or_winding_number);
    RUN(surface_volume_has_its_holes_closed_flat);
    RUN(open_tube_is_a_volume);
    RUN(inner_wall_does_not_empty_its_row);
    RUN(every_component_is_found);
    RUN(components_are_counted_with_their_border);
    RUN(all_methods_agree_on_closed_shapes);
    RUN(flood_reports_a_leak);
    RUN(border_is_the_layer_beside_the_inside);
    RUN(thousand_rotations_give_the_convex_shapes_own_voxels);
    RUN(centres_on_vertices_edges_and_faces_belong_to_one_side_on_every_axis);
    RUN(centres_on_slanted_faces_belong_to_one_side_on_every_axis);
    RUN(surfaces_without_a_volume_are_refused_with_numbers);
    RUN(options_out_of_range_are_refused);
    RUN(noise_is_refused_within_a_budget);
    RUN(large_and_sliver_triangles_are_scanned_like_small_ones);
    return check_report();
}
