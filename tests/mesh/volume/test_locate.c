/* Points and surfaces located in the elements of a mesh. */
#include "server/mesh/files/mesh_file.h"
#include "server/mesh/volume/locate.h"
#include "server/num/shape_functions.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/shapes.h"

typedef struct body {
    pal_surface surface;
    pal_tets tets;
    pal_hexes hexes;
    pal_locate *in_hexes, *in_tets;
} body;

/* takes the surface; cut voxels kept when they hold at least min_fill, 0: a whole layer of border */
static bool make_body(pal_surface surface, int resolution, double min_fill, body *out)
{
    pal_diagnostic diag = {.text = "memory"};
    pal_voxels voxels;
    pal_voxel_report report;
    pal_voxel_options options = {.resolution = resolution, .border = true, .min_fill = min_fill};
    memset(out, 0, sizeof *out);
    out->surface = surface;
    pal_err err = pal_voxels_fill(&surface, &options, &voxels, &report, &diag);
    if (!err) {
        err = pal_voxels_split(&voxels, &out->tets);
        pal_voxels_free(&voxels);
    }
    if (!err) err = pal_hexes_find(&out->tets, &out->hexes, &diag);
    if (!err) err = pal_locate_create(&out->tets, &out->hexes, &out->in_hexes);
    if (!err) err = pal_locate_create(&out->tets, NULL, &out->in_tets);
    if (err) CHECK_FAIL("%s", diag.text);
    return !err;
}

static void free_body(body *b)
{
    pal_locate_destroy(b->in_hexes);
    pal_locate_destroy(b->in_tets);
    pal_hexes_free(&b->hexes);
    pal_tets_free(&b->tets);
    pal_surface_free(&b->surface);
}

/* corner nodes and shape functions of a located point; returns their number */
static int weigh(const body *b, bool hex, int element, const double local[4], const int32_t **node, double n[8])
{
    *node = hex ? b->hexes.node + 8 * element : b->tets.tet + 4 * element;
    if (hex)
        pal_hex_shape(local, n, NULL);
    else
        memcpy(n, local, 4 * sizeof *n);
    return hex ? 8 : 4;
}

/* distance between a point and the place its coordinates stand for */
static double mistake(const body *b, bool hex, int element, const double local[4], const double x[3])
{
    const int32_t *node;
    double n[8], at[3] = {0}, sum = 0;
    int n_corner = weigh(b, hex, element, local, &node, n);
    for (int c = 0; c < n_corner; c++)
        for (int k = 0; k < 3; k++) at[k] += n[c] * b->tets.x[3 * node[c] + k];
    for (int k = 0; k < 3; k++) sum += (at[k] - x[k]) * (at[k] - x[k]);
    return sqrt(sum);
}

static bool within(bool hex, const double local[4], double by)
{
    bool in = true;
    for (int k = 0; k < 3 && hex; k++) in &= fabs(local[k]) <= 1 + by;
    for (int k = 0; k < 4 && !hex; k++) in &= local[k] >= -by;
    return in;
}

static void points_inside_are_found_with_coordinates_that_give_them_back(void)
{
    uint64_t state = 7;
    body b;
    REQUIRE(make_body(shape_ball(0.1, 48, 24, 0.2), 12, 0, &b));
    for (int hex = 0; hex < 2; hex++) {
        double worst = 0;
        int n_in = 0;
        for (int i = 0; i < 3000; i++) {
            double x[3], local[4], outside;
            int t = (int)(random_below(&state, (uint64_t)b.tets.n_tet));
            double w[4], sum = 0;
            for (int c = 0; c < 4; c++) w[c] = 1 + random_signed(&state), sum += w[c];
            for (int k = 0; k < 3; k++) {
                x[k] = 0;
                for (int c = 0; c < 4; c++) x[k] += w[c] / sum * b.tets.x[3 * b.tets.tet[4 * t + c] + k];
            }
            int e = pal_locate_point(hex ? b.in_hexes : b.in_tets, x, local, &outside);
            n_in += outside == 0 && within(hex, local, 1e-9) && e == (hex ? t / 5 : t);
            worst = fmax(worst, mistake(&b, hex, e, local, x));
        }
        CHECK_INT(n_in, 3000);
        CHECK_LE(worst, 1e-12 * 0.1);
    }
    free_body(&b);
}

/* every node, and the middles of all its neighbours' faces, is inside although rounding may put it outside */
static void points_on_faces_are_inside(void)
{
    body b;
    double low[3] = {0.1, -0.3, 0.7}, high[3] = {0.3, -0.25, 0.75};
    REQUIRE(make_body(shape_box(low, high), 15, 0.01, &b));
    for (int hex = 0; hex < 2; hex++) {
        double worst = 0, local[4], outside;
        int n_in = 0;
        for (int i = 0; i < b.tets.n_node; i++) {
            int e = pal_locate_point(hex ? b.in_hexes : b.in_tets, b.tets.x + 3 * i, local, &outside);
            n_in += outside == 0 && within(hex, local, 1e-8);
            worst = fmax(worst, mistake(&b, hex, e, local, b.tets.x + 3 * i));
        }
        CHECK_INT(n_in, b.tets.n_node);
        for (int f = 0; f < b.tets.n_face; f++) {
            double x[3] = {0};
            for (int c = 0; c < 3; c++)
                for (int k = 0; k < 3; k++) x[k] += b.tets.x[3 * b.tets.face[3 * f + c] + k] / 3;
            pal_locate_point(hex ? b.in_hexes : b.in_tets, x, local, &outside);
            CHECK(outside == 0);
        }
        CHECK_LE(worst, 1e-12);
    }
    free_body(&b);
}

/* brute force is the judge of the nearest voxel; a linear field is extended as it is */
static void points_outside_go_to_the_nearest_element(void)
{
    uint64_t state = 9;
    body b;
    REQUIRE(make_body(shape_torus(0.1, 0.03, 32, 16), 20, 0, &b));
    double h = b.tets.edge_m;
    int n_out = 0;
    for (int i = 0; i < 600; i++) {
        double x[3], local[4], outside, outside_tet, best = INFINITY, far = i % 50 == 0 ? 20 : 0.2;
        /* products of three coordinates cancel */
        double rounding = 1e-14 * h * pow(2 * far / h, 3);
        for (int k = 0; k < 3; k++) x[k] = far * random_signed(&state);
        for (int e = 0; e < b.hexes.n_hex; e++) {
            double sum = 0;
            for (int k = 0; k < 3; k++) {
                double at = b.tets.x[3 * b.hexes.node[8 * e] + k], off = fmax(0, fmax(at - x[k], x[k] - at - h));
                sum += off * off;
            }
            best = fmin(best, sqrt(sum));
        }
        int e = pal_locate_point(b.in_hexes, x, local, &outside);
        CHECK_NEAR(outside, best, 1e-9 * h);
        CHECK_LE(mistake(&b, true, e, local, x), rounding);
        e = pal_locate_point(b.in_tets, x, local, &outside_tet);
        CHECK_NEAR(outside_tet, best, 1e-9 * h + 1e-12 * best);
        CHECK_LE(mistake(&b, false, e, local, x), rounding);
        n_out += best > 0;
    }
    CHECK(n_out > 300);
    free_body(&b);
}

static double total(const pal_quadrature_point *piece, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++) sum += piece[i].area_m2;
    return sum;
}

/* nodal forces of traction 1 along x */
static double *spread(const body *b, bool hex, const pal_quadrature_point *piece, int n_piece)
{
    double *f = calloc((size_t)b->tets.n_node, sizeof *f);
    if (!f) abort();
    for (int i = 0; i < n_piece; i++) {
        const int32_t *node;
        double n[8];
        int n_corner = weigh(b, hex, piece[i].element, piece[i].local, &node, n);
        for (int c = 0; c < n_corner; c++) f[node[c]] += n[c] * piece[i].area_m2;
    }
    return f;
}

/* what a uniform traction puts on the nodes of a face of whole voxels: a quarter of each square, or a third of each
 * boundary triangle */
static void uniform_traction_gives_the_exact_nodal_forces(void)
{
    double low[3] = {0, 0, 0}, high[3] = {0.2, 0.05, 0.05}, from[3] = {0.199999, -1, -1}, to[3] = {0.3, 1, 1};
    double normal[3] = {3, 0, 0};
    body b;
    REQUIRE(make_body(shape_box(low, high), 16, 0.01, &b));
    CHECK_INT(b.tets.n_node, 425);
    for (int hex = 0; hex < 2; hex++) {
        pal_quadrature_point *piece;
        int n;
        REQUIRE(!pal_locate_surface(hex ? b.in_hexes : b.in_tets, &b.surface, from, to, normal, &piece, &n));
        CHECK_NEAR(total(piece, n) / 0.0025, 1, 1e-12);
        double *f = spread(&b, hex, piece, n), *wanted = calloc((size_t)b.tets.n_node, sizeof *wanted), worst = 0;
        double square = 0.0125 * 0.0125;
        for (int i = 0; i < n; i++) CHECK(piece[i].normal[0] == 1 && within(hex, piece[i].local, 1e-9));
        for (int e = 0; e < b.hexes.n_hex && hex; e++)
            for (int c = 1; c < 8; c += 2) {
                int32_t node = b.hexes.node[8 * e + c];
                if (b.tets.x[3 * node] > 0.1999) wanted[node] += square / 4;
            }
        for (int t = 0; t < b.tets.n_face && !hex; t++) {
            const int32_t *c = b.tets.face + 3 * t;
            if (b.tets.x[3 * c[0]] + b.tets.x[3 * c[1]] + b.tets.x[3 * c[2]] < 0.5999) continue;
            for (int k = 0; k < 3; k++) wanted[c[k]] += square / 6;
        }
        for (int i = 0; i < b.tets.n_node; i++) worst = fmax(worst, fabs(f[i] - wanted[i]));
        CHECK_LE(worst, 1e-12 * 0.0025);
        free(f);
        free(wanted);
        free(piece);
    }
    free_body(&b);
}

/* a slanted face within one voxel and across several: the integral of the shape functions against fine midpoint sums,
 * of positions against the triangle's own */
static void slanted_faces_are_cut_by_the_elements(void)
{
    uint64_t state = 21;
    double low[3] = {-0.1, -0.04, -0.03}, high[3] = {0.1, 0.04, 0.03}, all[3] = {9, 9, 9}, none[3] = {-9, -9, -9};
    pal_surface s = shape_box(low, high);
    shape_rotate(&s, &state);
    body b;
    REQUIRE(make_body(s, 9, 0.05, &b));
    for (int hex = 0; hex < 2; hex++) {
        pal_quadrature_point *piece;
        int n;
        pal_surface one = b.surface;
        one.n_tri = 1;
        const double *x[3];
        for (int c = 0; c < 3; c++) x[c] = b.surface.x + 3 * b.surface.tri[c];
        const pal_locate *locate = hex ? b.in_hexes : b.in_tets;
        REQUIRE(!pal_locate_surface(locate, &one, none, all, NULL, &piece, &n));
        double area = total(piece, n), *f = spread(&b, hex, piece, n);
        CHECK_NEAR(area / 0.008, 1, 1e-12);
        double first[3] = {0}, worst = 0;
        for (int i = 0; i < b.tets.n_node; i++)
            for (int k = 0; k < 3; k++) first[k] += f[i] * b.tets.x[3 * i + k];
        for (int k = 0; k < 3; k++) CHECK_NEAR(first[k] / area, (x[0][k] + x[1][k] + x[2][k]) / 3, 1e-12);
        /* midpoints of m^2 small triangles */
        enum { M = 700 };
        double *g = calloc((size_t)b.tets.n_node, sizeof *g);
        for (int i = 0; i < M; i++)
            for (int j = 0; j < 2 * (M - i) - 1; j++) {
                double u = (i + (j & 1 ? 2.0 : 1.0) / 3) / M, v = (j / 2 + (j & 1 ? 2.0 : 1.0) / 3) / M, p[3], local[4];
                for (int k = 0; k < 3; k++) p[k] = x[0][k] + u * (x[1][k] - x[0][k]) + v * (x[2][k] - x[0][k]);
                const int32_t *node;
                double w[8];
                int e = pal_locate_point(locate, p, local, NULL), n_corner = weigh(&b, hex, e, local, &node, w);
                for (int c = 0; c < n_corner; c++) g[node[c]] += w[c] * area / ((double)M * M);
            }
        double max = 0;
        for (int i = 0; i < b.tets.n_node; i++) {
            /* off the mesh the piece's element is that of its middle, the point's its own */
            worst = fmax(worst, fabs(f[i] - g[i]));
            max = fmax(max, f[i]);
        }
        CHECK_LE(worst / max, 0.06);
        free(f);
        free(g);
        free(piece);
    }
    free_body(&b);
}

/* inside a body the cut is exact for any direction: a triangle drawn through the middle of a block */
static void a_triangle_within_is_integrated_exactly(void)
{
    double low[3] = {0, 0, 0}, high[3] = {1, 1, 1}, all[3] = {9, 9, 9}, none[3] = {-9, -9, -9};
    pal_surface s = shape_room(3, 1);
    double corner[9] = {0.13, 0.21, 0.17, 0.91, 0.33, 0.42, 0.35, 0.87, 0.93};
    memcpy(s.x, corner, sizeof corner);
    for (int k = 0; k < 3; k++) s.tri[k] = k;
    body b;
    REQUIRE(make_body(shape_box(low, high), 4, 0.01, &b));
    for (int hex = 0; hex < 2; hex++) {
        pal_quadrature_point *piece;
        int n;
        const pal_locate *locate = hex ? b.in_hexes : b.in_tets;
        REQUIRE(!pal_locate_surface(locate, &s, none, all, NULL, &piece, &n));
        double area = total(piece, n), *f = spread(&b, hex, piece, n), worst = 0, max = 0;
        for (int i = 0; i < n; i++) CHECK(within(hex, piece[i].local, 1e-9));
        enum { M = 900 };
        double *g = calloc((size_t)b.tets.n_node, sizeof *g);
        for (int i = 0; i < M; i++)
            for (int j = 0; j < 2 * (M - i) - 1; j++) {
                double u = (i + (j & 1 ? 2.0 : 1.0) / 3) / M, v = (j / 2 + (j & 1 ? 2.0 : 1.0) / 3) / M, p[3], local[4];
                for (int k = 0; k < 3; k++)
                    p[k] = corner[k] + u * (corner[3 + k] - corner[k]) + v * (corner[6 + k] - corner[k]);
                const int32_t *node;
                double w[8];
                int e = pal_locate_point(locate, p, local, NULL), n_corner = weigh(&b, hex, e, local, &node, w);
                for (int c = 0; c < n_corner; c++) g[node[c]] += w[c] * area / ((double)M * M);
            }
        for (int i = 0; i < b.tets.n_node; i++) worst = fmax(worst, fabs(f[i] - g[i])), max = fmax(max, f[i]);
        /* the sums are only good to about 1 / M^2 */
        CHECK_LE(worst / max, 5e-6);
        double u[3], v[3], cross[3];
        for (int k = 0; k < 3; k++) u[k] = corner[3 + k] - corner[k], v[k] = corner[6 + k] - corner[k];
        for (int k = 0; k < 3; k++) cross[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
        CHECK_NEAR(area / (sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]) / 2), 1, 1e-12);
        free(f);
        free(g);
        free(piece);
    }
    pal_surface_free(&s);
    free_body(&b);
}

static void the_box_and_the_normal_choose_what_is_loaded(void)
{
    double low[3] = {0, 0, 0}, high[3] = {1, 1, 1};
    body b;
    pal_quadrature_point *piece = NULL;
    int n = -1;
    REQUIRE(make_body(shape_box(low, high), 5, 0.01, &b));
    b.surface.origin_m[2] = b.tets.origin_m[2] = 4;
    double from[3] = {0.2, -1, 0.5}, to[3] = {0.7, 2, 2}, up[3] = {0, 0, 1}, tilted[3] = {0, sin(0.43), cos(0.43)};
    REQUIRE(!pal_locate_surface(b.in_hexes, &b.surface, from, to, up, &piece, &n));
    CHECK_NEAR(total(piece, n), 0.5, 1e-13);
    free(piece);
    REQUIRE(!pal_locate_surface(b.in_hexes, &b.surface, from, to, tilted, &piece, &n));
    CHECK_NEAR(total(piece, n), 0.5, 1e-13);
    free(piece);
    tilted[1] = sin(0.45), tilted[2] = cos(0.45);
    REQUIRE(!pal_locate_surface(b.in_hexes, &b.surface, from, to, tilted, &piece, &n));
    CHECK_INT(n, 0);
    CHECK(piece == NULL);
    REQUIRE(!pal_locate_surface(b.in_tets, &b.surface, from, to, NULL, &piece, &n));
    CHECK_NEAR(total(piece, n), 0.5 + 2 * 0.5 * 0.5, 1e-13);
    free(piece);
    /* a region whose side is the body's own face holds that face */
    double touch[3] = {0.2, -1, 1};
    REQUIRE(!pal_locate_surface(b.in_tets, &b.surface, touch, to, up, &piece, &n));
    CHECK_NEAR(total(piece, n), 0.5, 1e-13);
    free(piece);
    from[0] = 1.5, to[0] = 2;
    REQUIRE(!pal_locate_surface(b.in_hexes, &b.surface, from, to, NULL, &piece, &n));
    CHECK_INT(n, 0);
    free_body(&b);
}

/* the gear's surface has six decimals, hence 1.6e-6 less than the 0.048175005 of its teeth */
static void loaded_areas_of_the_reference_problems(void)
{
    static const struct {
        const char *path;
        double low[3], high[3], normal[3], area, tolerance;
        int resolution;
    } wanted[] = {
        {"reference/beam/surface.obj", {0.199999, -0.03, -0.03}, {0.21, 0.03, 0.03}, {1, 0, 0}, 0.0025, 1e-12, 16},
        {"reference/cube/surface.obj", {-0.025, -0.025, 0.099999}, {0.025, 0.025, 0.11}, {0, 0, 1}, 0.0025, 1e-12, 16},
        {"reference/gear/surface.obj",
         {0.8, -0.25, -0.3},
         {1.1, -0.199999, 0.3},
         {0, -1, 0},
         0.048174929476,
         1e-12,
         24},
        {"reference/gear/surface.obj",
         {-1.1, -0.25, -0.3},
         {-0.8, -0.199999, 0.3},
         {0, -1, 0},
         0.048174929476,
         1e-12,
         33},
    };
    for (int k = 0; k < 4; k++) {
        const char *path = check_shared(wanted[k].path);
        if (!path) continue;
        pal_diagnostic diag;
        pal_surface s;
        pal_mesh_file_options in = {.unit_m = 1, .weld = PAL_MESH_WELD};
        REQUIRE(!pal_mesh_file_read(path, &in, &s, NULL, NULL, NULL, &diag));
        body b;
        REQUIRE(make_body(s, wanted[k].resolution, 0.02, &b));
        double low[3], high[3];
        for (int d = 0; d < 3; d++) low[d] = wanted[k].low[d] - b.tets.origin_m[d];
        for (int d = 0; d < 3; d++) high[d] = wanted[k].high[d] - b.tets.origin_m[d];
        for (int hex = 0; hex < 2; hex++) {
            pal_quadrature_point *piece;
            int n;
            REQUIRE(
                !pal_locate_surface(hex ? b.in_hexes : b.in_tets, &b.surface, low, high, wanted[k].normal, &piece, &n));
            CHECK_NEAR(total(piece, n) / wanted[k].area, 1, wanted[k].tolerance);
            free(piece);
        }
        free_body(&b);
    }
}

int main(void)
{
    RUN(points_inside_are_found_with_coordinates_that_give_them_back);
    RUN(points_on_faces_are_inside);
    RUN(points_outside_go_to_the_nearest_element);
    RUN(uniform_traction_gives_the_exact_nodal_forces);
    RUN(slanted_faces_are_cut_by_the_elements);
    RUN(a_triangle_within_is_integrated_exactly);
    RUN(the_box_and_the_normal_choose_what_is_loaded);
    RUN(loaded_areas_of_the_reference_problems);
    return check_report();
}
