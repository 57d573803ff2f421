/* Modified butterfly stencils: weights, hand values, polynomials on regular grids, boundaries, smoothness. */
#include "server/mesh/geometry/butterfly.h"
#include "server/mesh/geometry/levels.h"
#include "server/mesh/geometry/procedural.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/shapes.h"

/* levels of a surface, which is freed */
static pal_levels levels_of(pal_surface s, int n_level)
{
    pal_levels l = {0};
    pal_diagnostic diag = {.text = "no note"};
    pal_levels_options options = {.n_level = n_level};
    if (pal_levels_make(&s, &options, &l, &diag)) CHECK_FAIL("%s", diag.text);
    pal_surface_free(&s);
    return l;
}

/* row of the midpoint of the edge between two vertices of level 0 */
static int32_t midpoint_between(const pal_levels *l, int32_t a, int32_t b)
{
    int32_t e = pal_levels_spoke(l, 0, a), first = e;
    while (pal_wing_other_end(l->edge, e, a) != b) {
        e = pal_wing_next_around(l->edge, e, a);
        if (e == first) return -1;
    }
    return pal_levels_edge_midpoint(l, e);
}

/* weight of vertex v in the stencil of midpoint m; 0 when it is not there */
static double weight_of(const pal_levels *l, int32_t m, int32_t v)
{
    int32_t row = m - l->n_vertex[0];
    for (int32_t k = l->stencil_start[row]; k < l->stencil_start[row + 1]; k++)
        if (l->stencil_vertex[k] == v) return l->stencil_weight[k];
    return 0;
}

static int entries_of(const pal_levels *l, int32_t m)
{
    int32_t row = m - l->n_vertex[0];
    return l->stencil_start[row + 1] - l->stencil_start[row];
}

/* largest |sum of weights - 1| over all stencils; rows ascending, of coarser levels, at most bound long */
static double worst_sum(const pal_levels *l)
{
    double worst = 0;
    for (int32_t v = l->n_vertex[0]; v < l->n_vertex[l->n_level - 1]; v++) {
        int32_t row = v - l->n_vertex[0], level = l->vertex_level[v];
        double sum = 0;
        for (int32_t k = l->stencil_start[row]; k < l->stencil_start[row + 1]; k++) {
            sum += l->stencil_weight[k];
            if (l->stencil_vertex[k] < 0 || l->stencil_vertex[k] >= l->n_vertex[level - 1]) return 1e9;
            if (k > l->stencil_start[row] && l->stencil_vertex[k] <= l->stencil_vertex[k - 1]) return 1e9;
        }
        worst = fmax(worst, fabs(sum - 1));
    }
    return worst;
}

static pal_surface sheet(int n, int m, double width, double height)
{
    pal_surface s = {0};
    if (pal_sheet_make(n, m, width, height, &s, NULL)) CHECK_FAIL("no sheet");
    return s;
}

/* a wheel: hub 0, rim 1..n, closed (n faces) or a half wheel of n faces and n + 1 rim vertices; then a second ring of
 * vertices around it, so that nothing but the hub decides */
static pal_surface wheel(int n, bool half, double lift)
{
    int around = half ? n + 1 : n;
    pal_surface s = shape_room(1 + 2 * around, 3 * n);
    int32_t *to = s.tri;
    for (int r = 0; r < 2; r++)
        for (int i = 0; i < around; i++) {
            double a = (half ? 1 : 2) * SHAPE_PI * i / n, *x = s.x + 3 * (1 + r * around + i);
            x[0] = (r + 1) * cos(a), x[1] = (r + 1) * sin(a), x[2] = lift * (r + 1);
        }
    memset(s.x, 0, 3 * sizeof *s.x);
    for (int i = 0; i < n; i++) {
        int32_t p = 1 + i, q = 1 + (i + 1) % around, u = p + around, w = q + around;
        int32_t three[9] = {0, p, q, p, u, w, p, w, q};
        memcpy(to, three, sizeof three);
        to += 9;
    }
    return s;
}

static void ring_weights_sum_to_a_quarter_for_every_valence(void)
{
    for (int K = 3; K <= 12; K++) {
        double sum = 0;
        for (int i = 0; i < K; i++) sum += pal_butterfly_ring(K, i);
        CHECK_NEAR(sum, 0.25, 1e-15);
        for (int i = 1; i < K; i++) CHECK_NEAR(pal_butterfly_ring(K, i), pal_butterfly_ring(K, K - i), 1e-15);
    }
    /* by hand: eq. 5 for K = 5 and 8; the two printed cases */
    double c = (sqrt(5.0) - 1) / 4, d = -(sqrt(5.0) + 1) / 4;
    CHECK_NEAR(pal_butterfly_ring(5, 0), 0.35, 1e-15);
    CHECK_NEAR(pal_butterfly_ring(5, 1), (0.25 + c + d / 2) / 5, 1e-15);
    CHECK_NEAR(pal_butterfly_ring(5, 2), (0.25 + d + c / 2) / 5, 1e-15);
    CHECK_NEAR(pal_butterfly_ring(8, 0), 1.75 / 8, 1e-15);
    CHECK_NEAR(pal_butterfly_ring(8, 4), -0.25 / 8, 1e-15);
    CHECK_NEAR(pal_butterfly_ring(3, 0), 5.0 / 12, 1e-15);
    CHECK_NEAR(pal_butterfly_ring(3, 2), -1.0 / 12, 1e-15);
    CHECK_NEAR(pal_butterfly_ring(4, 0), 3.0 / 8, 1e-15);
    CHECK_NEAR(pal_butterfly_ring(4, 1), 0, 1e-15);
    CHECK_NEAR(pal_butterfly_ring(4, 2), -1.0 / 8, 1e-15);
    /* K = 6 of the same formula: the ring of eq. 3's vertex, 1/4 + 1/8 each to its neighbours, nothing opposite */
    CHECK_NEAR(pal_butterfly_ring(6, 0), 0.25 + 1.0 / 24, 1e-15);
}

/* on K equal angles around the vertex, the first harmonic must come out halved: where the midpoint is */
static void ring_and_boundary_rules_find_the_midpoint_of_a_flat_wheel(void)
{
    for (int K = 5; K <= 12; K++) {
        double x = 0, y = 0;
        for (int i = 0; i < K; i++) {
            x += pal_butterfly_ring(K, i) * cos(2 * SHAPE_PI * i / K);
            y += pal_butterfly_ring(K, i) * sin(2 * SHAPE_PI * i / K);
        }
        CHECK_NEAR(x, 0.5, 1e-14);
        CHECK_NEAR(y, 0, 1e-14);
    }
    for (int k = 2; k <= 12; k++)
        for (int i = 1; i < k; i++) {
            double x = 0, y = 0, sum = pal_butterfly_boundary(k, i, -1);
            for (int j = 0; j <= k; j++) {
                double w = pal_butterfly_boundary(k, i, j);
                CHECK_NEAR(w, pal_butterfly_boundary(k, k - i, k - j), 1e-14);
                sum += w, x += w * cos(SHAPE_PI * j / k), y += w * sin(SHAPE_PI * j / k);
            }
            CHECK_NEAR(sum, 1, 1e-14);
            CHECK_NEAR(x, 0.5 * cos(SHAPE_PI * i / k), 1e-14);
            CHECK_NEAR(y, 0.5 * sin(SHAPE_PI * i / k), 1e-14);
        }
}

static void stencils_have_the_printed_weights(void)
{
    /* regular: vertex (3,3) and (4,3) of a 8 x 8 sheet, whose cells are cut from lower left to upper right */
    pal_levels l = levels_of(sheet(8, 8, 7, 7), 2);
    int32_t a = 3 * 8 + 3, m = midpoint_between(&l, a, a + 1);
    REQUIRE(m >= 0);
    CHECK_INT(entries_of(&l, m), 8);
    CHECK_NEAR(weight_of(&l, m, a), 0.5, 0);
    CHECK_NEAR(weight_of(&l, m, a + 1), 0.5, 0);
    CHECK_NEAR(weight_of(&l, m, a + 9), 0.125, 0);
    CHECK_NEAR(weight_of(&l, m, a - 8), 0.125, 0);
    int32_t wing[4] = {a + 8, a + 10, a - 9, a - 7};
    for (int k = 0; k < 4; k++) CHECK_NEAR(weight_of(&l, m, wing[k]), -0.0625, 0);
    /* boundary: bottom row, not next to a corner; C3: +9/16 on both ends */
    m = midpoint_between(&l, 3, 4);
    CHECK_INT(entries_of(&l, m), 4);
    CHECK_NEAR(weight_of(&l, m, 2), -0.0625, 0);
    CHECK_NEAR(weight_of(&l, m, 3), 0.5625, 0);
    CHECK_NEAR(weight_of(&l, m, 4), 0.5625, 0);
    CHECK_NEAR(weight_of(&l, m, 5), -0.0625, 0);
    /* the side's last edge: its fourth point is 2 c - p */
    m = midpoint_between(&l, 0, 1);
    CHECK_INT(entries_of(&l, m), 3);
    CHECK_NEAR(weight_of(&l, m, 0), 0.4375, 0);
    CHECK_NEAR(weight_of(&l, m, 1), 0.625, 0);
    CHECK_NEAR(weight_of(&l, m, 2), -0.0625, 0);
    /* the diagonal 3-12: right face 3 4 12, left 3 12 11; below edge 3-4 lies nothing: p* = 3 + 4 - 12 */
    m = midpoint_between(&l, 3, 12);
    CHECK_NEAR(weight_of(&l, m, 3), 0.5 - 0.0625, 0);
    CHECK_NEAR(weight_of(&l, m, 12), 0.5 + 0.0625, 0);
    CHECK_NEAR(weight_of(&l, m, 4), 0.125 - 0.0625, 0);
    CHECK_NEAR(weight_of(&l, m, 11), 0.125, 0);
    CHECK_NEAR(weight_of(&l, m, 13), -0.0625, 0);
    CHECK_NEAR(weight_of(&l, m, 20), -0.0625, 0);
    CHECK_NEAR(weight_of(&l, m, 2), -0.0625, 0);
    CHECK_INT(entries_of(&l, m), 7);
    CHECK_LE(worst_sum(&l), 1e-15);
    pal_levels_free(&l);
}

/* largest difference between the stencil of edge e's midpoint and the wanted weights, one for each vertex [n] */
static double stencil_error(const pal_levels *l, int32_t e, const double *want, int32_t n)
{
    double worst = 0;
    for (int32_t v = 0; v < n; v++)
        worst = fmax(worst, fabs(weight_of(l, pal_levels_edge_midpoint(l, e), v) - want[v]));
    return worst;
}

/* adds share times the rule of inner vertex v of K faces for its edge e */
static void want_ring(const pal_levels *l, int32_t e, int32_t v, int K, double share, double *want)
{
    want[v] += 0.75 * share;
    for (int i = 0; i < K; i++, e = pal_wing_next_around(l->edge, e, v))
        want[pal_wing_other_end(l->edge, e, v)] += share * pal_butterfly_ring(K, i);
}

static void irregular_vertices_take_their_own_ring(void)
{
    for (int K = 3; K <= 12; K++) {
        if (K == 6) continue;
        pal_levels l = levels_of(wheel(K, false, 0.3), 3);
        double want[256];
        CHECK_LE(worst_sum(&l), 1e-14);
        /* both ends irregular: the rim's vertices have five faces each */
        int32_t e = pal_levels_spoke(&l, 0, 0), rim = pal_wing_other_end(l.edge, e, 0);
        memset(want, 0, sizeof want);
        want_ring(&l, e, 0, K, 0.5, want);
        want_ring(&l, e, rim, 5, 0.5, want);
        CHECK_LE(stencil_error(&l, e, want, l.n_vertex[0]), 1e-15);
        /* a level on, the hub's neighbours are regular */
        e = pal_levels_spoke(&l, 1, 0);
        for (int k = 0; k < K; k++, e = pal_wing_next_around(l.edge, e, 0)) {
            memset(want, 0, sizeof want);
            want_ring(&l, e, 0, K, 1, want);
            CHECK_LE(stencil_error(&l, e, want, l.n_vertex[1]), 1e-15);
            CHECK_INT(entries_of(&l, pal_levels_edge_midpoint(&l, e)), K == 4 ? 3 : K + 1);
        }
        pal_levels_free(&l);
    }
}

static void irregular_boundary_vertices_take_the_crease_weights(void)
{
    for (int k = 2; k <= 8; k++) {
        if (k == 3) continue;
        pal_levels l = levels_of(wheel(k, true, 0.1), 3);
        CHECK_INT(l.corner[0], 0);
        int32_t e = pal_levels_spoke(&l, 1, 0), around[16];
        for (int j = 0; j <= k; j++, e = pal_wing_next_around(l.edge, e, 0)) around[j] = e;
        CHECK_INT(e, around[0]);
        for (int i = 1; i < k; i++) {
            double want[512] = {0};
            want[0] = pal_butterfly_boundary(k, i, -1);
            for (int j = 0; j <= k; j++)
                want[pal_wing_other_end(l.edge, around[j], 0)] = pal_butterfly_boundary(k, i, j);
            REQUIRE(l.n_vertex[1] <= 512);
            CHECK_LE(stencil_error(&l, around[i], want, l.n_vertex[1]), 1e-15);
            /* two faces: plainly the middle */
            if (k == 2) CHECK_INT(entries_of(&l, pal_levels_edge_midpoint(&l, around[i])), 2);
        }
        CHECK_LE(worst_sum(&l), 1e-14);
        pal_levels_free(&l);
    }
}

static double cubic(double x, double y)
{
    return 0.3 + 0.5 * x - 0.7 * y + 0.2 * x * x - 0.4 * x * y + 0.6 * y * y + 0.11 * x * x * x - 0.23 * x * x * y +
           0.31 * x * y * y + 0.17 * y * y * y;
}

static void cubics_are_reproduced_on_a_regular_grid(void)
{
    pal_surface s = sheet(12, 12, 1.1, 1.1);
    for (int v = 0; v < s.n_vertex; v++) s.x[3 * v + 2] = cubic(s.x[3 * v], s.x[3 * v + 1]);
    pal_levels l = levels_of(s, 4);
    double worst = 0, edge = 0;
    int n = 0;
    for (int32_t v = l.n_vertex[0]; v < l.n_vertex[3]; v++) {
        const double *x = l.x + 3 * v;
        double error = fabs(x[2] - cubic(x[0], x[1])), size = fmax(fabs(x[0]), fabs(x[1]));
        /* boundary rules reach three cells inwards over all levels */
        if (size < 0.25)
            worst = fmax(worst, error), n++;
        else
            edge = fmax(edge, error);
    }
    printf("  cubic: error %.2g inside (%d vertices), %.2g near the boundary\n", worst, n, edge);
    CHECK(n > 500);
    CHECK_LE(worst, 1e-14);
    /* reflections are exact for linear functions only: h^2/8 times the second derivative, and its corner's */
    CHECK_LE(edge, 5e-3);
    /* quartics are not: the test would notice */
    pal_levels_free(&l);
    s = sheet(12, 12, 1.1, 1.1);
    for (int v = 0; v < s.n_vertex; v++) s.x[3 * v + 2] = pow(s.x[3 * v], 4);
    l = levels_of(s, 2);
    for (int32_t v = l.n_vertex[0]; v < l.n_vertex[1]; v++)
        if (fabs(l.x[3 * v]) < 0.2) worst = fmax(worst, fabs(l.x[3 * v + 2] - pow(l.x[3 * v], 4)));
    CHECK(worst > 1e-6);
    pal_levels_free(&l);
}

static void sheets_stay_sheets_at_sides_and_corners(void)
{
    for (int n = 2; n <= 5; n++) {
        pal_levels l = levels_of(sheet(n, n + 1, 0.3, 0.5), 5);
        double worst = 0;
        for (int32_t v = l.n_vertex[0]; v < l.n_vertex[4]; v++) {
            const int32_t *end = l.edge[pal_levels_vertex_parent(&l, v)].vertex;
            for (int k = 0; k < 3; k++)
                worst = fmax(worst, fabs(l.x[3 * v + k] - 0.5 * (l.x[3 * end[0] + k] + l.x[3 * end[1] + k])));
        }
        CHECK_LE(worst, 1e-15);
        int n_corner = 0;
        for (int v = 0; v < l.n_vertex[0]; v++) n_corner += l.corner[v];
        CHECK_INT(n_corner, 4);
        pal_levels_free(&l);
    }
}

/* an L: five corners like a sheet's and one that is hollow, whose inner edges stay straight */
static void concave_corners_keep_their_position(void)
{
    pal_surface s = sheet(7, 7, 6, 6);
    int n = 0;
    for (int t = 0; t < s.n_tri; t++) {
        double x = 0, y = 0;
        for (int k = 0; k < 3; k++) x += s.x[3 * s.tri[3 * t + k]] / 3, y += s.x[3 * s.tri[3 * t + k] + 1] / 3;
        if (x > 0 && y > 0) continue;
        memmove(s.tri + 3 * n++, s.tri + 3 * t, 3 * sizeof *s.tri);
    }
    s.n_tri = n;
    pal_surface_report report = {0};
    CHECK(!pal_surface_clean(&s, 0, &report, NULL));
    pal_levels l = levels_of(s, 4);
    double worst = 0;
    int n_corner = 0;
    for (int v = 0; v < l.n_vertex[0]; v++) n_corner += l.corner[v];
    CHECK_INT(n_corner, 6);
    for (int32_t v = l.n_vertex[0]; v < l.n_vertex[3]; v++) {
        const int32_t *end = l.edge[pal_levels_vertex_parent(&l, v)].vertex;
        for (int k = 0; k < 3; k++)
            worst = fmax(worst, fabs(l.x[3 * v + k] - 0.5 * (l.x[3 * end[0] + k] + l.x[3 * end[1] + k])));
    }
    CHECK_LE(worst, 1e-14);
    pal_levels_free(&l);
}

static void boundaries_depend_on_boundaries_only(void)
{
    /* a ball cut open below its top; two parts with the same boundary stay without a crack */
    pal_surface s = shape_ball(1, 12, 8, 0.1);
    shape_cut(&s, 0.5);
    pal_surface_report report = {0};
    CHECK(!pal_surface_clean(&s, 0, &report, NULL));
    pal_levels l = levels_of(s, 4);
    int n_rim = 0, n_coarse = 0;
    CHECK(!l.closed);
    for (int32_t v = l.n_vertex[0]; v < l.n_vertex[3]; v++) {
        if (!pal_levels_on_boundary(&l, v)) continue;
        int32_t row = v - l.n_vertex[0];
        n_rim++;
        CHECK_LE(l.stencil_start[row + 1] - l.stencil_start[row], 4);
        for (int32_t k = l.stencil_start[row]; k < l.stencil_start[row + 1]; k++)
            CHECK(pal_levels_on_boundary(&l, l.stencil_vertex[k]));
    }
    for (int32_t v = 0; v < l.n_vertex[0]; v++) n_coarse += pal_levels_on_boundary(&l, v);
    CHECK_INT(n_rim, n_coarse * 7);
    CHECK(n_coarse >= 12);
    CHECK_LE(worst_sum(&l), 1e-14);
    pal_levels_free(&l);
}

static void a_mirrored_surface_has_mirrored_midpoints(void)
{
    pal_stomach a, b;
    REQUIRE(!pal_stomach_make(&a) && !pal_stomach_make(&b));
    for (int v = 0; v < b.surface.n_vertex; v++) b.surface.x[3 * v] *= -1;
    shape_invert(&b.surface);
    pal_levels l = levels_of(a.surface, 2), m = levels_of(b.surface, 2);
    double worst = 0;
    CHECK_INT(l.n_vertex[1], m.n_vertex[1]);
    for (int32_t v = 0; v < l.n_vertex[1]; v++) {
        worst = fmax(worst, fabs(l.x[3 * v] + m.x[3 * v]));
        for (int k = 1; k < 3; k++) worst = fmax(worst, fabs(l.x[3 * v + k] - m.x[3 * v + k]));
    }
    CHECK_LE(worst, 1e-16 * 4);
    pal_levels_free(&l);
    pal_levels_free(&m);
}

/* largest angle between two faces of one level around a vertex */
static double normal_spread(const pal_levels *l, int level, int32_t v)
{
    double n[64][3], spread = 0;
    int count = 0;
    int32_t e = pal_levels_spoke(l, level, v), first = e;
    do {
        int32_t f = pal_wing_face(l->edge, e, v);
        e = pal_wing_next_around(l->edge, e, v);
        if (f < 0) continue;
        const double *p[3];
        double a[3], b[3];
        for (int k = 0; k < 3; k++) p[k] = l->x + 3 * l->face[3 * f + k];
        for (int k = 0; k < 3; k++) a[k] = p[1][k] - p[0][k], b[k] = p[2][k] - p[0][k];
        n[count][0] = a[1] * b[2] - a[2] * b[1], n[count][1] = a[2] * b[0] - a[0] * b[2];
        n[count][2] = a[0] * b[1] - a[1] * b[0];
        double size = sqrt(n[count][0] * n[count][0] + n[count][1] * n[count][1] + n[count][2] * n[count][2]);
        for (int k = 0; k < 3; k++) n[count][k] /= size;
        count++;
    } while (e != first && count < 64);
    for (int i = 0; i < count; i++)
        for (int j = 0; j < i; j++) {
            double d = 0;
            for (int k = 0; k < 3; k++) d += (n[i][k] - n[j][k]) * (n[i][k] - n[j][k]);
            spread = fmax(spread, 2 * asin(sqrt(d) / 2));
        }
    return spread;
}

static void normals_converge_at_every_kind_of_vertex(void)
{
    uint64_t seed = 7;
    for (int half = 0; half < 2; half++)
        for (int K = half ? 2 : 3; K <= 9; K++) {
            pal_surface s = wheel(K, half, 0);
            for (int v = 0; v < s.n_vertex; v++) s.x[3 * v + 2] = 0.2 * random_signed(&seed);
            pal_levels l = levels_of(s, 7);
            double early = normal_spread(&l, 2, 0), late = normal_spread(&l, 6, 0);
            printf("  %s of %d faces: normals within %.3f, four levels on %.4f rad\n", half ? "boundary" : "inner", K,
                   early, late);
            CHECK_LE(late, 0.35 * early);
            CHECK_LE(late, 0.1);
            pal_levels_free(&l);
        }
}

int main(void)
{
    RUN(ring_weights_sum_to_a_quarter_for_every_valence);
    RUN(ring_and_boundary_rules_find_the_midpoint_of_a_flat_wheel);
    RUN(stencils_have_the_printed_weights);
    RUN(irregular_vertices_take_their_own_ring);
    RUN(irregular_boundary_vertices_take_the_crease_weights);
    RUN(cubics_are_reproduced_on_a_regular_grid);
    RUN(sheets_stay_sheets_at_sides_and_corners);
    RUN(concave_corners_keep_their_position);
    RUN(boundaries_depend_on_boundaries_only);
    RUN(a_mirrored_surface_has_mirrored_midpoints);
    RUN(normals_converge_at_every_kind_of_vertex);
    return check_report();
}
