/* Voxels as hexahedra: found in the split, filled by their share inside the surface, dropped where that is small. */
#include "server/base/vec3.h"
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/volume/hexes.h"
#include "server/mesh/voxel/voxel_fraction.h"
#include "server/mesh/voxel/voxel_scanline.h"
#include "tests/check.h"
#include "tests/fixtures/shapes.h"

/* a surface as voxels, tetrahedra and hexahedra; the surface stays the caller's */
typedef struct body {
    pal_voxels voxels;
    pal_tets tets;
    pal_hexes hexes;
    pal_voxel_report report;
} body;

static bool make_body(const pal_surface *surface, const pal_voxel_options *options, body *out)
{
    pal_diagnostic diag = {.text = "memory"};
    memset(out, 0, sizeof *out);
    if (pal_voxels_fill(surface, options, &out->voxels, &out->report, &diag) ||
        pal_voxels_split(&out->voxels, &out->tets) || pal_hexes_find(&out->tets, &out->hexes, &diag)) {
        CHECK_FAIL("%s", diag.text);
        return false;
    }
    return true;
}

static void free_body(body *b)
{
    pal_voxels_free(&b->voxels);
    pal_tets_free(&b->tets);
    pal_hexes_free(&b->hexes);
}

static double fill_volume(const body *b)
{
    double sum = 0;
    for (int e = 0; e < b->hexes.n_hex; e++) sum += (double)b->hexes.fill[e];
    return sum * pow(b->tets.edge_m, 3);
}

static void every_voxel_is_found_with_its_corners_in_order(void)
{
    pal_surface ball = shape_sphere(0.1);
    pal_voxel_options options = {.resolution = 14, .border = true};
    body b;
    REQUIRE(make_body(&ball, &options, &b));
    CHECK_INT(b.hexes.n_hex, b.voxels.n_inside + b.voxels.n_border);
    CHECK(!b.hexes.measured);
    double worst = 0, h = b.tets.edge_m;
    for (int e = 0; e < b.hexes.n_hex; e++) {
        const int32_t *node = b.hexes.node + 8 * e;
        for (int c = 0; c < 8; c++)
            for (int k = 0; k < 3; k++)
                worst = fmax(worst, fabs(b.tets.x[3 * node[c] + k] - b.tets.x[3 * node[0] + k] - h * (c >> k & 1)));
        CHECK(b.hexes.fill[e] == 1);
    }
    CHECK_LE(worst, 1e-12 * h * 100);
    free_body(&b);
    pal_surface_free(&ball);
}

static void order_within_a_voxel_does_not_matter_but_the_cube_does(void)
{
    pal_surface cube = shape_cube(1);
    pal_voxel_options options = {.resolution = 3};
    pal_hexes again;
    pal_diagnostic diag;
    body b;
    REQUIRE(make_body(&cube, &options, &b));
    int32_t *tet = b.tets.tet, swap[4];
    memcpy(swap, tet + 4, sizeof swap);
    memcpy(tet + 4, tet + 16, sizeof swap);
    memcpy(tet + 16, swap, sizeof swap);
    REQUIRE(!pal_hexes_find(&b.tets, &again, &diag));
    CHECK(!memcmp(again.node, b.hexes.node, (size_t)b.hexes.n_hex * 32));
    pal_hexes_free(&again);
    /* a node moved, a tetrahedron that belongs to the next voxel, one too few */
    b.tets.x[3 * tet[0]] += 0.01;
    CHECK_INT(pal_hexes_find(&b.tets, &again, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "tetrahedra 0 to 4"));
    b.tets.x[3 * tet[0]] -= 0.01;
    memcpy(swap, tet + 40, sizeof swap);
    memcpy(tet + 40, tet + 60, sizeof swap);
    memcpy(tet + 60, swap, sizeof swap);
    CHECK_INT(pal_hexes_find(&b.tets, &again, &diag), PAL_ERR_REFUSED);
    b.tets.n_tet--;
    CHECK_INT(pal_hexes_find(&b.tets, &again, &diag), PAL_ERR_REFUSED);
    free_body(&b);
    pal_surface_free(&cube);
}

static double monomial(int m, const double x[3])
{
    return (m & 1 ? x[0] : 1) * (m & 2 ? x[1] : 1) * (m & 4 ? x[2] : 1);
}

/* integrals of 1, x, y, xy, z, xz, yz, xyz over a closed surface: of tetrahedra from the origin, by a rule of degree 3
 */
static void integrate(const pal_surface *s, double sum[8])
{
    memset(sum, 0, 8 * sizeof *sum);
    for (int t = 0; t < s->n_tri; t++) {
        const double *x[3];
        for (int k = 0; k < 3; k++) x[k] = s->x + 3 * s->tri[3 * t + k];
        double normal[3];
        pal_cross3(normal, x[1], x[2]);
        const double volume = pal_dot3(x[0], normal) / 6;
        for (int i = 0; i < 5; i++) {
            double at[3] = {0, 0, 0};
            for (int k = 0; k < 3; k++) pal_axpy3(at, i == 4 ? 0.25 : i == k ? 0.5 : 1.0 / 6, x[k]);
            for (int m = 0; m < 8; m++) sum[m] += volume * (i == 4 ? -0.8 : 0.45) * monomial(m, at);
        }
    }
}

typedef struct summer {
    const pal_voxels *grid;
    double sum[8];
} summer;

static void add_layer(void *self, int z, const double *weight)
{
    summer *s = self;
    const pal_voxels *g = s->grid;
    const double h = g->edge_m, far = 0.5 / sqrt(3);
    for (int i = 0; i < g->n[0] * g->n[1]; i++)
        for (int q = 0; q < 8; q++) {
            double x[3] = {i % g->n[0], i / g->n[0], z};
            for (int c = 0; c < 3; c++) x[c] = g->low_m[c] + h * (x[c] + 0.5 + (q >> c & 1 ? far : -far));
            for (int m = 0; m < 8; m++) s->sum[m] += h * h * h * weight[8 * i + q] * monomial(m, x);
        }
}

/* Gauss points with their weights integrate trilinear functions over the inside of every voxel, so over the body: to
 * rounding (corners at 1/65536 of a voxel), or as samples do where the surface is open */
static void weights_integrate_trilinear_functions_over_the_inside(void)
{
    uint64_t state = 5;
    for (int turn = 0; turn < 4; turn++) {
        pal_surface s = turn ? shape_ball(0.1, 64, 32, 0.2)
                             : shape_box((double[3]){-0.1, -0.04, -0.03}, (double[3]){0.1, 0.05, 0.04});
        shape_rotate(&s, &state);
        for (int i = 0; i < s.n_vertex; i++) pal_axpy3(s.x + 3 * i, 1, (double[3]){0.03, 0.05, 0.07});
        pal_voxels grid = {.n = {13, 13, 13}, .edge_m = 0.021, .low_m = {-0.11, -0.09, -0.07}};
        summer made = {.grid = &grid};
        double exact[8];
        pal_diagnostic diag = {""};
        integrate(&s, exact);
        if (turn == 2) shape_invert(&s);
        if (turn == 3) s.n_tri--; /* open, so that samples are counted */
        if (pal_voxels_fraction(&s, &grid, true, add_layer, &made, &diag)) CHECK_FAIL("%s", diag.text);
        for (int m = 0; m < 8; m++) CHECK_NEAR(made.sum[m] / exact[m], 1, turn == 3 ? 5e-3 : 2e-5);
        pal_surface_free(&s);
    }
}

/* A corner voxel of a box holds the product of what its intervals hold: along an axis of which f is inside the weights
 * are (f -+ sqrt 3 f (f - 1)) / 2. Where one is negative or above 1/8 the nearest are taken that are not: what is
 * within the limits is off by one number, what is at a limit by no less */
static void a_corner_voxel_has_the_nearest_weights_within_the_limits(void)
{
    static const double part[4] = {0.5, 0.45, 0.2, 0.8};
    for (int k = 0; k < 4; k++) {
        const double f = part[k], side = 7 + f;
        pal_surface box = shape_box((double[3]){0, 0, 0}, (double[3]){side, side, side});
        pal_voxels grid = {.n = {10, 10, 10}, .edge_m = 1, .low_m = {-1, -1, -1}};
        pal_tets tets;
        pal_hexes hexes;
        pal_diagnostic diag = {""};
        const double wide[2] = {(f - sqrt(3) * f * (f - 1)) / 2, (f + sqrt(3) * f * (f - 1)) / 2};
        double raw[8], shift = NAN;
        int corner = -1, n_within = 0;
        grid.kind = malloc(1000);
        REQUIRE(grid.kind);
        memset(grid.kind, 2, 1000);
        grid.n_inside = 1000;
        REQUIRE(!pal_voxels_split(&grid, &tets) && !pal_hexes_find(&tets, &hexes, &diag));
        REQUIRE(!pal_hexes_fill(&hexes, &tets, &box, &diag));
        for (int e = 0; e < hexes.n_hex; e++) {
            const double *x = tets.x + 3 * hexes.node[8 * e];
            if (x[0] > 6.5 && x[1] > 6.5 && x[2] > 6.5 && x[0] + x[1] + x[2] < 21.5) corner = e;
        }
        REQUIRE(corner >= 0);
        const float *weight = hexes.weight + 8 * corner;
        for (int q = 0; q < 8; q++) {
            raw[q] = wide[q & 1] * wide[q >> 1 & 1] * wide[q >> 2];
            CHECK(weight[q] >= 0 && weight[q] <= 0.125F);
            if (!(weight[q] > 0 && weight[q] < 0.125F)) continue;
            if (n_within++ == 0) shift = (double)weight[q] - raw[q];
            CHECK_NEAR((double)weight[q] - raw[q], shift, 2e-5);
        }
        for (int q = 0; q < 8; q++) {
            if (weight[q] <= 0) CHECK_LE(raw[q] + shift, 2e-5);
            if (weight[q] >= 0.125F) CHECK_LE(0.125 - raw[q] - shift, 2e-5);
        }
        CHECK(n_within > 0);
        if (k < 2) CHECK_NEAR(shift, 0, 2e-5);
        CHECK_NEAR((double)hexes.fill[corner], f * f * f, 1e-4);
        pal_hexes_free(&hexes), pal_tets_free(&tets), pal_voxels_free(&grid);
        pal_surface_free(&box);
    }
}

/* voxels that a surface only touches hold exactly nothing, those within it exactly everything, the rest what a plane
 * cuts off */
static void a_box_fills_its_voxels_exactly(void)
{
    double low[3] = {0, 0, 0}, high[3] = {0.4, 0.1875, 0.1333};
    pal_surface box = shape_box(low, high);
    pal_voxel_options options = {.resolution = 32, .border = true};
    body b;
    REQUIRE(make_body(&box, &options, &b));
    REQUIRE(!pal_hexes_fill(&b.hexes, &b.tets, &box, NULL));
    CHECK(b.hexes.measured);
    double h = b.tets.edge_m, worst = 0;
    int n_whole = 0, n_none = 0;
    for (int e = 0; e < b.hexes.n_hex; e++) {
        const double *x = b.tets.x + 3 * b.hexes.node[8 * e];
        double share = 1;
        for (int k = 0; k < 3; k++) {
            double part = (fmin(x[k] + h, high[k]) - fmax(x[k], low[k])) / h;
            share *= part < 1e-9 ? 0 : part > 1 - 1e-9 ? 1 : part;
        }
        n_whole += b.hexes.fill[e] == 1.0F && share == 1.0;
        n_none += b.hexes.fill[e] == 0.0F && share == 0.0;
        if (share == 1.0) CHECK(b.hexes.fill[e] == 1.0F);
        if (share == 0.0) CHECK(b.hexes.fill[e] == 0.0F);
        worst = fmax(worst, fabs((double)b.hexes.fill[e] - share));
    }
    CHECK_INT(n_whole, 32 * 15 * 10);
    CHECK(n_none > 1000);
    CHECK_LE(worst, 1.0 / 65536);
    free_body(&b);
    pal_surface_free(&box);
}

static void total_fill_is_the_volume_of_a_box_at_an_angle_and_of_a_ball(void)
{
    uint64_t state = 11;
    for (int turn = 0; turn < 6; turn++) {
        double low[3] = {-0.1, -0.04, -0.03}, high[3] = {0.1, 0.04, 0.03};
        pal_surface s = turn < 5 ? shape_box(low, high) : shape_ball(0.1, 96, 48, 0);
        double exact = turn < 5 ? 0.2 * 0.08 * 0.06 : pal_surface_volume(&s);
        if (turn < 5) shape_rotate(&s, &state);
        if (turn & 1) shape_invert(&s);
        s.origin_m[2] = 3;
        pal_voxel_options options = {.resolution = 20, .border = true};
        body b;
        REQUIRE(make_body(&s, &options, &b));
        REQUIRE(!pal_hexes_fill(&b.hexes, &b.tets, &s, NULL));
        /* corners outside the border layer are missing from the sum */
        CHECK_NEAR(fill_volume(&b) / exact, 1, turn < 5 ? 0.002 : 0.002);
        if (turn == 5) CHECK_NEAR(fill_volume(&b) / (4 * SHAPE_PI / 3 * 1e-3), 1, 0.01);
        for (int e = 0; e < b.hexes.n_hex; e++) CHECK(b.hexes.fill[e] >= 0 && b.hexes.fill[e] <= 1);
        free_body(&b);
        pal_surface_free(&s);
    }
}

static void overlapping_hollow_and_open_bodies_are_filled_too(void)
{
    double low[3] = {0, 0, 0}, high[3] = {0.6, 0.4, 0.4}, low2[3] = {0.35, 0.1, 0.1}, high2[3] = {1, 0.3, 0.3};
    pal_surface two = shape_join(shape_box(low, high), shape_box(low2, high2));
    pal_voxel_options options = {.resolution = 20, .border = true};
    body b;
    REQUIRE(make_body(&two, &options, &b));
    REQUIRE(!pal_hexes_fill(&b.hexes, &b.tets, &two, NULL));
    CHECK_NEAR(fill_volume(&b), 0.6 * 0.16 + 0.4 * 0.04, 1e-5);
    free_body(&b);
    pal_surface_free(&two);

    pal_surface hollow = shape_cube(0.9);
    shape_invert(&hollow);
    hollow = shape_join(shape_cube(2), hollow);
    REQUIRE(make_body(&hollow, &options, &b));
    REQUIRE(!pal_hexes_fill(&b.hexes, &b.tets, &hollow, NULL));
    CHECK_NEAR(fill_volume(&b), 8 - 0.729, 1e-3);
    free_body(&b);
    pal_surface_free(&hollow);

    pal_surface open = shape_sphere(0.1);
    double whole = pal_surface_volume(&open);
    open.n_tri -= 6;
    REQUIRE(make_body(&open, &options, &b));
    CHECK(b.report.open);
    REQUIRE(!pal_hexes_fill(&b.hexes, &b.tets, &open, NULL));
    CHECK_NEAR(fill_volume(&b) / whole, 1, 0.01);
    free_body(&b);
    pal_surface_free(&open);
}

static void a_surface_that_is_not_the_meshs_is_refused(void)
{
    pal_surface cube = shape_cube(1), sheet = shape_room(3, 1);
    double corner[9] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
    memcpy(sheet.x, corner, sizeof corner);
    for (int k = 0; k < 3; k++) sheet.tri[k] = k;
    pal_voxel_options options = {.resolution = 3};
    pal_diagnostic diag;
    body b;
    REQUIRE(make_body(&cube, &options, &b));
    CHECK_INT(pal_hexes_fill(&b.hexes, &b.tets, &sheet, &diag), PAL_ERR_REFUSED);
    CHECK(!b.hexes.measured);
    sheet.x[0] = -1e4;
    CHECK_INT(pal_hexes_fill(&b.hexes, &b.tets, &sheet, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "beyond the mesh"));
    free_body(&b);
    pal_surface_free(&cube);
    pal_surface_free(&sheet);
}

/* nodes and voxels of the bodies that reference solutions exist for, and the fill of those that remain */
static void min_fill_leaves_the_voxels_of_the_reference_boxes(void)
{
    static const struct {
        const char *path;
        int resolution, n_voxel, n_node;
    } wanted[] = {
        {"reference/beam/surface.obj", 16, 256, 425},
        {"reference/beam/surface.obj", 32, 2048, 2673},
        {"reference/cube/surface.obj", 8, 512, 729},
        {"reference/cube/surface.obj", 16, 4096, 4913},
    };
    for (int k = 0; k < 4; k++) {
        const char *path = check_shared(wanted[k].path);
        if (!path) continue;
        pal_surface s;
        pal_diagnostic diag;
        pal_mesh_file_options in = {.unit_m = 1, .weld = PAL_MESH_WELD};
        REQUIRE(!pal_mesh_file_read(path, &in, &s, NULL, NULL, NULL, &diag));
        pal_voxel_options options = {.resolution = wanted[k].resolution, .border = true, .min_fill = 0.02};
        body b;
        REQUIRE(make_body(&s, &options, &b));
        CHECK_INT(b.hexes.n_hex, wanted[k].n_voxel);
        CHECK_INT(b.tets.n_node, wanted[k].n_node);
        CHECK_INT(b.voxels.n_border, 0);
        CHECK(b.report.n_dropped > 0);
        REQUIRE(!pal_hexes_fill(&b.hexes, &b.tets, &s, NULL));
        for (int e = 0; e < b.hexes.n_hex; e++) CHECK(b.hexes.fill[e] == 1.0F);
        free_body(&b);
        pal_surface_free(&s);
    }
}

/* what is dropped is what is nearly empty; a centre inside keeps its voxel however little it holds */
typedef struct counter {
    const pal_voxels *grid;
    double min;
    int64_t n;
} counter;

static void count_layer(void *self, int z, const double *fraction)
{
    counter *c = self;
    (void)z;
    for (int i = 0; i < c->grid->n[0] * c->grid->n[1]; i++) c->n += fraction[i] >= c->min;
}

/* every voxel is kept of which that much is inside and that faces join to the inside, also through others */
static void min_fill_keeps_every_voxel_that_is_filled_so_far(void)
{
    uint64_t state = 3;
    pal_surface s = shape_join(shape_ball(0.1, 64, 32, 0.2), shape_octahedron(0.01));
    shape_rotate(&s, &state);
    static const double min[2] = {0.3, 0.02};
    for (int k = 0; k < 2; k++) {
        pal_voxel_options options = {.resolution = 20, .border = true, .min_fill = min[k]};
        body some;
        REQUIRE(make_body(&s, &options, &some));
        REQUIRE(!pal_hexes_fill(&some.hexes, &some.tets, &s, NULL));
        CHECK_INT(pal_tets_check(&some.tets, NULL), PAL_ERR_OK);
        counter c = {.grid = &some.voxels, .min = min[k]};
        REQUIRE(!pal_voxels_fraction(&s, &some.voxels, false, count_layer, &c, NULL));
        int n_small = 0;
        for (int e = 0; e < some.hexes.n_hex; e++) n_small += (double)some.hexes.fill[e] < min[k];
        CHECK_INT(some.hexes.n_hex - n_small, c.n);
        CHECK_LE(n_small, (double)some.voxels.n_inside / 50); /* centres inside, in the octahedron's tips */
        free_body(&some);
    }
    pal_surface_free(&s);
    /* a cube of 0.6, 1, 1, 1, 1 and 0.4 voxels along each axis */
    static const double along[6] = {0.6, 1, 1, 1, 1, 0.4}, smallest[5] = {0.5, 0.3, 0.15, 0.1, 0.05};
    pal_surface cube = shape_box((double[3]){0, 0, 0}, (double[3]){5, 5, 5});
    for (int k = 0; k < 5; k++) {
        pal_voxel_options options = {
            .resolution = 5, .border = true, .min_fill = smallest[k], .ahead = {0.4, 0.4, 0.4}};
        pal_voxels voxels;
        int wanted = 125;
        for (int i = 0; i < 216; i++) {
            const int at[3] = {i % 6, i / 6 % 6, i / 36};
            const bool is_border = at[0] == 5 || at[1] == 5 || at[2] == 5;
            wanted += is_border && along[at[0]] * along[at[1]] * along[at[2]] >= smallest[k];
        }
        REQUIRE(!pal_voxels_fill(&cube, &options, &voxels, NULL, NULL));
        CHECK_INT(voxels.n_inside + voxels.n_border, wanted);
        pal_voxels_free(&voxels);
    }
    pal_surface_free(&cube);
}

/* of two boxes a fifth of a voxel apart the larger stays alone, with its own border */
static void the_largest_component_stays_alone(void)
{
    static const double min[4] = {0, 0.02, 0.1, 0.25};
    for (int k = 0; k < 4; k++) {
        pal_surface both = shape_join(shape_box((double[3]){0, 0, 0}, (double[3]){10.4, 8.45, 8.45}),
                                      shape_box((double[3]){10.6, 0, 0}, (double[3]){20, 8.45, 8.45}));
        pal_voxel_options options = {.resolution = 20, .border = true, .min_fill = min[k], .largest_only = true};
        pal_voxels all, v;
        REQUIRE(!pal_voxels_fill(&both, &options, &v, NULL, NULL));
        int64_t n_beyond = 0;
        for (int64_t i = 0; i < (int64_t)v.n[0] * v.n[1] * v.n[2]; i++)
            n_beyond += v.kind[i] && v.low_m[0] + v.edge_m * (double)(i % v.n[0]) > 11.5;
        CHECK_INT(n_beyond, 0);
        options.largest_only = false;
        REQUIRE(!pal_voxels_fill(&both, &options, &all, NULL, NULL));
        CHECK_INT(all.n_inside, 19 * 8 * 8);
        CHECK_INT(v.n_inside, 10 * 8 * 8);
        pal_voxels_free(&v), pal_voxels_free(&all);
        pal_surface_free(&both);
    }
}

/* two cubes that touch along an edge only */
static void voxels_joined_by_an_edge_are_counted(void)
{
    for (int axis = 0; axis < 3; axis++) {
        double low[3] = {0, 0, 0}, high[3] = {1, 1, 1}, low2[3] = {1, 1, 1}, high2[3] = {2, 2, 2};
        low2[axis] = 0, high2[axis] = 1;
        pal_surface s = shape_join(shape_box(low, high), shape_box(low2, high2));
        pal_voxel_options options = {.resolution = 8, .border = true, .min_fill = 0.1};
        body b;
        REQUIRE(make_body(&s, &options, &b));
        CHECK_INT(b.hexes.n_hex, 128);
        CHECK_INT(b.report.n_component, 2);
        CHECK_INT(pal_tets_check(&b.tets, NULL), PAL_ERR_OK);
        free_body(&b);
        pal_surface_free(&s);
    }
}

/* crossings stay within the row, on either side of a grid that the surface reaches beyond */
static void rows_of_a_grid_within_the_surface_end_with_the_grid(void)
{
    pal_surface ball = shape_sphere(0.1);
    const double h = 0.01, low[3] = {-0.02, -0.02, -0.02};
    const int n[3] = {4, 4, 4};
    pal_scan_surface scan;
    REQUIRE(!pal_scan_snap(&ball, low, h, &scan));
    for (int axis = 0; axis < 3; axis++) {
        pal_crossings rows;
        REQUIRE(!pal_scan_axis(&scan, n, axis, &rows));
        CHECK_INT(rows.start[16], 32);
        for (int k = 0; k < 32; k++) CHECK_INT(rows.item[k].place, k % 2 ? 4 : 0);
        pal_crossings_free(&rows);
    }
    pal_scan_surface_free(&scan);
    pal_surface_free(&ball);
}

/* the fill of what largest_only left, by the whole surface, is that by its own part: nothing is written beyond it */
static void a_surface_that_reaches_beyond_the_mesh_fills_it_alike(void)
{
    for (int side = -1; side <= 1; side += 2) {
        pal_surface ball = shape_sphere(0.1), far = shape_sphere(0.03);
        shape_move(&far, side * 1.0, 0, 0);
        pal_surface both = shape_join(shape_sphere(0.1), far);
        pal_voxel_options options = {.resolution = 140, .border = true, .largest_only = true};
        body b;
        REQUIRE(make_body(&both, &options, &b));
        size_t n_byte = (size_t)b.hexes.n_hex * sizeof *b.hexes.fill;
        float *own = malloc(n_byte);
        REQUIRE(own && !pal_hexes_fill(&b.hexes, &b.tets, &ball, NULL));
        memcpy(own, b.hexes.fill, n_byte);
        REQUIRE(!pal_hexes_fill(&b.hexes, &b.tets, &both, NULL));
        double worst = 0;
        for (int e = 0; e < b.hexes.n_hex; e++) worst = fmax(worst, fabs((double)(own[e] - b.hexes.fill[e])));
        CHECK_LE(worst, 1e-6);
        CHECK_NEAR(fill_volume(&b), fabs(pal_surface_volume(&ball)), 1e-4 * pal_surface_volume(&ball));
        free(own);
        free_body(&b);
        pal_surface_free(&ball);
        pal_surface_free(&both);
    }
}

int main(void)
{
    RUN(every_voxel_is_found_with_its_corners_in_order);
    RUN(order_within_a_voxel_does_not_matter_but_the_cube_does);
    RUN(weights_integrate_trilinear_functions_over_the_inside);
    RUN(a_corner_voxel_has_the_nearest_weights_within_the_limits);
    RUN(a_box_fills_its_voxels_exactly);
    RUN(total_fill_is_the_volume_of_a_box_at_an_angle_and_of_a_ball);
    RUN(overlapping_hollow_and_open_bodies_are_filled_too);
    RUN(a_surface_that_is_not_the_meshs_is_refused);
    RUN(min_fill_leaves_the_voxels_of_the_reference_boxes);
    RUN(min_fill_keeps_every_voxel_that_is_filled_so_far);
    RUN(the_largest_component_stays_alone);
    RUN(voxels_joined_by_an_edge_are_counted);
    RUN(rows_of_a_grid_within_the_surface_end_with_the_grid);
    RUN(a_surface_that_reaches_beyond_the_mesh_fills_it_alike);
    return check_report();
}
