/* Voxels as hexahedra: found in the split, filled by their share inside the surface, dropped where that is small. */
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/volume/hexes.h"
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

/* octants of a ball: each is the fill of a voxel of half the edge, and they sum to the voxel's */
static void octants_are_the_fill_of_voxels_of_half_the_edge(void)
{
    pal_surface ball = shape_sphere(0.1);
    pal_voxel_options options = {.resolution = 9, .border = true};
    body b;
    REQUIRE(make_body(&ball, &options, &b));
    REQUIRE(!pal_hexes_fill(&b.hexes, &b.tets, &ball, NULL));
    REQUIRE(b.hexes.octant);
    /* the same lattice at half the edge, as one mesh of voxels */
    pal_voxels fine = {.edge_m = b.voxels.edge_m / 2};
    size_t n_cell = 1;
    for (int k = 0; k < 3; k++) {
        fine.n[k] = 2 * b.voxels.n[k], fine.low_m[k] = b.voxels.low_m[k], fine.origin_m[k] = b.voxels.origin_m[k];
        n_cell *= (size_t)fine.n[k];
    }
    fine.kind = malloc(n_cell);
    REQUIRE(fine.kind);
    memset(fine.kind, 2, n_cell);
    fine.n_inside = (int64_t)n_cell;
    pal_tets tets;
    pal_hexes half;
    REQUIRE(!pal_voxels_split(&fine, &tets) && !pal_hexes_find(&tets, &half, NULL));
    REQUIRE(!pal_hexes_fill(&half, &tets, &ball, NULL));
    float *at = calloc(n_cell, sizeof *at);
    REQUIRE(at);
    for (int pass = 0; pass < 2; pass++) {
        const pal_hexes *hexes = pass ? &b.hexes : &half;
        const pal_tets *nodes = pass ? &b.tets : &tets;
        double worst = 0;
        for (size_t e = 0; e < (size_t)hexes->n_hex; e++) {
            size_t place[3];
            for (size_t k = 0; k < 3; k++)
                place[k] = (size_t)((nodes->x[3 * (size_t)hexes->node[8 * e] + k] - fine.low_m[k]) / fine.edge_m + 0.5);
            for (size_t q = 0; q < (pass ? 8 : 1); q++) {
                size_t cell = (place[2] + (q >> 2)) * (size_t)fine.n[1];
                cell = (cell + place[1] + (q >> 1 & 1)) * (size_t)fine.n[0] + place[0] + (q & 1);
                if (pass == 0)
                    at[cell] = hexes->fill[e];
                else
                    worst = fmax(worst, fabs((double)(hexes->octant[8 * e + q] - at[cell] / 8)));
            }
            CHECK(pal_octant_sum(hexes->octant + 8 * e) == hexes->fill[e]);
        }
        /* corners are rounded to 1/65536 of the voxel, of which there are two kinds */
        CHECK_LE(worst, 2e-5);
    }
    free(at);
    pal_hexes_free(&half), pal_tets_free(&tets), pal_voxels_free(&fine);
    free_body(&b);
    pal_surface_free(&ball);
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
static void min_fill_drops_border_voxels_only(void)
{
    uint64_t state = 3;
    pal_surface s = shape_join(shape_ball(0.1, 64, 32, 0.2), shape_octahedron(0.01));
    shape_rotate(&s, &state);
    body all, some;
    pal_voxel_options options = {.resolution = 20, .border = true};
    REQUIRE(make_body(&s, &options, &all));
    REQUIRE(!pal_hexes_fill(&all.hexes, &all.tets, &s, NULL));
    options.min_fill = 0.3;
    REQUIRE(make_body(&s, &options, &some));
    REQUIRE(!pal_hexes_fill(&some.hexes, &some.tets, &s, NULL));
    CHECK_INT(some.voxels.n_inside, all.voxels.n_inside);
    CHECK_INT(some.voxels.n_border + some.report.n_dropped, all.voxels.n_border);
    CHECK_INT(pal_tets_check(&some.tets, NULL), PAL_ERR_OK);
    int n_small = 0, n_full_all = 0, n_full_some = 0;
    for (int e = 0; e < all.hexes.n_hex; e++) n_full_all += all.hexes.fill[e] >= 0.3F;
    for (int e = 0; e < some.hexes.n_hex; e++) {
        n_full_some += some.hexes.fill[e] >= 0.3F;
        n_small += some.hexes.fill[e] < 0.3F;
    }
    CHECK_INT(n_full_some, n_full_all);
    CHECK_LE(n_small, (double)some.voxels.n_inside / 50);
    free_body(&all);
    free_body(&some);
    pal_surface_free(&s);
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
    RUN(octants_are_the_fill_of_voxels_of_half_the_edge);
    RUN(a_box_fills_its_voxels_exactly);
    RUN(total_fill_is_the_volume_of_a_box_at_an_angle_and_of_a_ball);
    RUN(overlapping_hollow_and_open_bodies_are_filled_too);
    RUN(a_surface_that_is_not_the_meshs_is_refused);
    RUN(min_fill_leaves_the_voxels_of_the_reference_boxes);
    RUN(min_fill_drops_border_voxels_only);
    RUN(voxels_joined_by_an_edge_are_counted);
    RUN(rows_of_a_grid_within_the_surface_end_with_the_grid);
    RUN(a_surface_that_reaches_beyond_the_mesh_fills_it_alike);
    return check_report();
}
