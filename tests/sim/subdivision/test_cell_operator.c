/* Component cell_elastic, operator edges: relative displacements from edge lengths and angles (paper A section 3.2.2)
 * and their errata. */
#include "tests/fixtures/cell_bodies.h"
#include "tests/stability/hard_case.h"

static void edges_body(cell_body *b, pal_cells cells, int n_level)
{
    cell_begin(b, cells);
    CHECK_INT(pal_entry_put_text(&b->item, "operator", "edges", &b->diag), PAL_ERR_OK);
    if (cell_make(b, n_level)) CHECK_FAIL("%s", b->diag.text);
    CHECK_INT(b->row->op, PAL_CELL_EDGES);
}
static void edges_nth(cell_body *b, int i)
{
    pal_cells c = i == 0 ? solid_block(1, 1, 1) : i == 1 ? cell_lattice(0.1) : cell_pyramids();
    if (i == 0) solid_jitter(&c, 0.15, 7);
    edges_body(b, c, i < 2 ? 0 : 1);
}
enum { EDGES_BODIES = 3 };

/* The paper's sentence as printed: at every node the changes of length of its edges, whole, and a' - a, b' - b of all
 * corners. Lengths along the edges, as a length has no direction of its own (A8); signs of the angles as corrected (A7)
 * so that the factor is seen alone. Nodes are corners of a box at bits 0, 1, 2 */
static void printed_operator(const double *x, const double *rest, const int32_t *node, double d[8][3])
{
    memset(d, 0, 24 * sizeof(double));
    for (int at = 0; at < 8; at++)
        for (int a = 0; a < 3; a++) {
            double s[3], s0[3];
            pal_sub3(s, x + 3 * node[at ^ 1 << a], x + 3 * node[at]);
            pal_sub3(s0, rest + 3 * node[at ^ 1 << a], rest + 3 * node[at]);
            pal_axpy3(d[at], -(pal_norm3(s) - pal_norm3(s0)) / pal_norm3(s), s);
            for (int b = a + 1; b < 3; b++) {
                double t[3], t0[3], n[3], ns[3], nt[3];
                pal_sub3(t, x + 3 * node[at ^ 1 << b], x + 3 * node[at]);
                pal_sub3(t0, rest + 3 * node[at ^ 1 << b], rest + 3 * node[at]);
                double delta = acos(pal_dot3(s, t) / (pal_norm3(s) * pal_norm3(t))) -
                               acos(pal_dot3(s0, t0) / (pal_norm3(s0) * pal_norm3(t0)));
                pal_cross3(n, s, t);
                pal_scale3(n, 1 / pal_norm3(n), n);
                pal_cross3(ns, n, s), pal_cross3(nt, n, t);
                for (int i = 0; i < 3; i++) {
                    d[at ^ 1 << a][i] += s[i] - (cos(delta / 2) * s[i] + sin(delta / 2) * ns[i]);
                    d[at ^ 1 << b][i] += t[i] - (cos(delta / 2) * t[i] - sin(delta / 2) * nt[i]);
                }
            }
        }
}

/* largest of the relative displacements of all pairs of nodes along an axis over what they are */
static double ratio(double (*d)[3], double (*wanted)[3], int n, double *apart)
{
    double up = 0, down = 0;
    *apart = 0;
    for (int a = 0; a < n; a++)
        for (int b = 0; b < n; b++)
            for (int i = 0; i < 3; i++) {
                double is = d[a][i] - d[b][i], was = wanted[a][i] - wanted[b][i];
                up += is * was, down += was * was;
            }
    for (int a = 0; a < n; a++)
        for (int i = 0; i < 3; i++) {
            double off = (d[a][i] - d[0][i]) / (up / down) - (wanted[a][i] - wanted[0][i]);
            *apart = fmax(*apart, fabs(off));
        }
    return up / down;
}

static void a_hexahedron_moves_as_its_edges_say_and_twice_that_as_printed(void)
{
    const double stretch[9] = {1.01, 0, 0, 0, 1, 0, 0, 0, 1}, shear[9] = {1, 0.004, 0, 0.004, 1, 0, 0, 0, 1};
    for (int s = 0; s < 2; s++) {
        cell_body b;
        const double *map = s ? shear : stretch;
        double d[8][3], printed[8][3], wanted[8][3], apart;
        edges_body(&b, solid_bricks(1, 1, 1, 1, s ? 1 : 2, s ? 1 : 3), 0);
        const int32_t *node = pal_subdivision_solid_nodes(b.solid, PAL_CELL_HEX, 0);
        cell_map(&b, map, 0);
        for (int m = 0; m < 8; m++) pal_sub3(wanted[m], b.body.d + 3 * node[m], b.body.node_rest + 3 * node[m]);
        pal_cells_elastic_displaced(b.row, b.body.d, PAL_CELL_HEX, 0, d[0]);
        CHECK_NEAR(ratio(d, wanted, 8, &apart), 1.0, 1e-4);
        CHECK_LE(apart, 1e-4 * 0.01);
        printed_operator(b.body.d, b.body.node_rest, node, printed);
        CHECK_NEAR(ratio(printed, wanted, 8, &apart), 2.0, 1e-4);
        cell_free(&b);
    }
}

static void sums_along_lines_move_the_lattice_as_it_is_moved(void)
{
    const double map[3][9] = {{1.01, 0, 0, 0, 1, 0, 0, 0, 1},
                              {1, 0.004, 0, 0.004, 1, 0, 0, 0, 1},
                              {1.002, 0.003, 0, 0.003, 0.997, -0.002, 0, -0.002, 1}};
    for (int s = 0; s < 3; s++) {
        cell_body b;
        double d[64][3], wanted[64][3], apart, turn[9];
        edges_body(&b, solid_block(3, 3, 3), 0);
        CHECK_INT(b.solid->elements.n[PAL_CELL_CUBIC], 1);
        const int32_t *node = pal_subdivision_solid_nodes(b.solid, PAL_CELL_CUBIC, 0);
        cell_map(&b, map[s], 0);
        for (int m = 0; m < 64; m++) pal_sub3(wanted[m], b.body.d + 3 * node[m], b.body.node_rest + 3 * node[m]);
        pal_cells_elastic_displaced(b.row, b.body.d, PAL_CELL_CUBIC, 0, d[0]);
        CHECK_NEAR(ratio(d, wanted, 64, &apart), 1.0, 2e-3);
        CHECK_LE(apart, 5e-3 * 0.03);
        /* the same in the element's axes wherever it is turned */
        double was[64][3];
        memcpy(was, d, sizeof was);
        cell_rotation(2.1, turn);
        for (int i = 0; i < b.body.n_node; i++) {
            double x[3] = {b.body.d[3 * i], b.body.d[3 * i + 1], b.body.d[3 * i + 2]};
            for (int c = 0; c < 3; c++) b.body.d[3 * i + c] = pal_dot3(turn + 3 * c, x) + 7;
        }
        pal_cells_elastic_displaced(b.row, b.body.d, PAL_CELL_CUBIC, 0, d[0]);
        for (int m = 0; m < 64; m++)
            for (int i = 0; i < 3; i++) CHECK_NEAR(d[m][i], was[m][i], 1e-12);
        cell_free(&b);
    }
}

static void an_apex_goes_up_two_thirds_of_what_it_is_drawn(void)
{
    /* by 1 %: corners there have no angles, so that what slanted edges say is not all of it */
    cell_body b;
    edges_nth(&b, 2);
    CHECK(b.solid->elements.n[PAL_CELL_PYRAMID] > 0);
    const int32_t *node = pal_subdivision_solid_nodes(b.solid, PAL_CELL_PYRAMID, 0);
    double up[3] = {0, 0, 0}, d[5][3], base[3] = {0, 0, 0};
    for (int m = 0; m < 4; m++) pal_axpy3(up, -0.25, b.body.d + 3 * node[m]);
    pal_axpy3(up, 1, b.body.d + 3 * node[4]);
    pal_axpy3(b.body.d + 3 * node[4], 0.01, up);
    pal_cells_elastic_displaced(b.row, b.body.d, PAL_CELL_PYRAMID, 0, d[0]);
    for (int m = 0; m < 4; m++) pal_axpy3(base, 0.25, d[m]);
    double lift[3];
    pal_sub3(lift, d[4], base);
    double part = pal_dot3(lift, up) / (0.01 * pal_dot3(up, up));
    CHECK_NEAR(part, 0.67, 0.03);
    cell_free(&b);
}

static void feels_nothing_at_rest_or_when_moved_as_a_whole(void)
{
    for (int i = 0; i < EDGES_BODIES; i++) {
        cell_body b;
        double turn[9];
        const double pi = acos(-1), angle[5] = {0, pi / 2, pi, 2.5, 200 * pi};
        edges_nth(&b, i);
        CHECK_LE(cell_largest(cell_force(&b), 3 * b.body.n_node), 1e-12 * 1000);
        cell_map(&b, (double[9]){1.01, 0, 0, 0, 1, 0, 0, 0, 1}, 0);
        double of = cell_energy(&b);
        CHECK(of > 0);
        for (int a = 0; a < 5; a++) {
            cell_rotation(angle[a], turn);
            cell_map(&b, turn, 10);
            CHECK_LE(cell_energy(&b), 1e-6 * of);
        }
        cell_free(&b);
    }
}

static void forces_have_no_sum_and_turn_with_the_body(void)
{
    for (int i = 0; i < EDGES_BODIES; i++) {
        cell_body b;
        double turn[9], sum[3] = {0};
        edges_nth(&b, i);
        int n = 3 * b.body.n_node;
        double *was = malloc(sizeof *was * (size_t)n), *x = malloc(sizeof *x * (size_t)n);
        cell_shake(&b, 0.1, 4);
        memcpy(x, b.body.d, sizeof *x * (size_t)n);
        memcpy(was, cell_force(&b), sizeof *was * (size_t)n);
        for (int k = 0; k < b.body.n_node; k++) pal_axpy3(sum, 1, was + 3 * k);
        CHECK(cell_largest(was, n) > 1);
        CHECK_LE(pal_norm3(sum), 1e-10 * cell_largest(was, n));
        cell_rotation(1.9, turn);
        for (int k = 0; k < n; k++) b.body.d[k] = pal_dot3(turn + 3 * (k % 3), x + k / 3 * 3) - 3;
        const double *f = cell_force(&b);
        double apart = 0;
        for (int k = 0; k < n; k++) apart = fmax(apart, fabs(f[k] - pal_dot3(turn + 3 * (k % 3), was + k / 3 * 3)));
        CHECK_LE(apart, 1e-9 * cell_largest(was, n));
        free(was), free(x);
        cell_free(&b);
    }
}

static void small_strains_give_the_forces_of_operator_polar(void)
{
    const double map[2][9] = {{1.001, 0, 0, 0, 1, 0, 0, 0, 1}, {1, 0.0005, 0, 0.0005, 1, 0, 0, 0, 1}};
    for (int i = 0; i < 2; i++)
        for (int s = 0; s < 2; s++) {
            cell_body b;
            edges_body(&b, i ? solid_block(3, 3, 3) : solid_block(1, 1, 1), 0);
            int n = 3 * b.body.n_node;
            double *edges = malloc(sizeof *edges * (size_t)n), apart = 0;
            cell_map(&b, map[s], 0);
            memcpy(edges, cell_force(&b), sizeof *edges * (size_t)n);
            b.row->op = PAL_CELL_POLAR;
            const double *polar = cell_force(&b);
            for (int k = 0; k < n; k++) apart = fmax(apart, fabs(edges[k] - polar[k]));
            CHECK(cell_largest(polar, n) > 0.01);
            CHECK_LE(apart, 2e-3 * cell_largest(polar, n));
            free(edges);
            cell_free(&b);
        }
}

static void shear_is_resisted_up_to_179_degrees(void)
{
    for (int kind = 0; kind < 2; kind++) {
        cell_body b;
        edges_body(&b, kind ? solid_block(3, 3, 3) : solid_block(1, 1, 1), 0);
        if (kind) cell_only(&b, PAL_CELL_CUBIC);
        int n = 3 * b.body.n_node;
        double *rate = malloc(sizeof *rate * (size_t)n);
        for (int degree = 1; degree <= 179; degree += 2) {
            double turn = (90 - degree) * acos(-1) / 360, c = cos(turn), s = sin(turn);
            cell_map(&b, (double[9]){c, s, 0, s, c, 0, 0, 0, 1}, 0);
            for (int i = 0; i < b.body.n_node; i++) {
                const double *x = b.body.node_rest + 3 * i;
                rate[3 * i] = -s * x[0] + c * x[1], rate[3 * i + 1] = c * x[0] - s * x[1], rate[3 * i + 2] = 0;
            }
            double moment = cell_dot(cell_force(&b), rate, n);
            CHECK(turn > 0 ? moment < 0 : moment > 0);
            HARD_CASE_ALL("cell_angles", "subdivision_fem", "operator edges, 1 to 179 degrees: moment keeps its sign",
                          turn > 0 ? moment < 0 : moment > 0, 1);
        }
        free(rate);
        cell_free(&b);
    }
}

static void closed_and_straight_angles_have_the_axis_of_rest(void)
{
    /* one corner's edges laid upon each other: the force on the end is towards where it was, not nothing */
    for (int s = 0; s < 2; s++) {
        cell_body b;
        edges_body(&b, solid_block(1, 1, 1), 0);
        int x = 0, y = 0, o = 0;
        for (int i = 0; i < 8; i++) {
            const double *at = b.body.node_rest + 3 * i;
            if (at[2] > 0) continue;
            if (at[0] < 0 && at[1] < 0) o = i;
            if (at[0] > 0 && at[1] < 0) x = i;
            if (at[0] < 0 && at[1] > 0) y = i;
        }
        for (int c = 0; c < 3; c++) {
            double edge = b.body.node_rest[3 * x + c] - b.body.node_rest[3 * o + c];
            b.body.d[3 * y + c] = b.body.node_rest[3 * o + c] + (s ? -edge : edge);
        }
        const double *f = cell_force(&b);
        double back = 0;
        for (int c = 0; c < 3; c++) back += f[3 * y + c] * (b.body.node_rest[3 * y + c] - b.body.d[3 * y + c]);
        CHECK_LE(cell_largest(f, 24), 1e4);
        HARD_CASE_ALL("cell_angles", "subdivision_fem", "edges laid on one another or opposite: pushed back", back > 10,
                      1);
        cell_free(&b);
    }
}

static void collapsed_elements_give_finite_forces(void)
{
    const double map[6][9] = {{0},
                              {1, 0, 0, 0, 0, 0, 0, 0, 0},
                              {1, 0, 0, 0, 1, 0, 0, 0, 0},
                              {1, 0, 0, 0, 1, 0, 0, 0, -1},
                              {-1, 0, 0, 0, -1, 0, 0, 0, -1},
                              {1, 0, 0, 0, 1, 0, 0, 0, -1e-9}};
    for (int i = 0; i < EDGES_BODIES; i++) {
        cell_body b;
        edges_nth(&b, i);
        int n = 3 * b.body.n_node;
        for (int k = 0; k < 6; k++) {
            cell_map(&b, map[k], 0.1);
            CHECK_LE(cell_largest(cell_force(&b), n), 1e5);
            CHECK(isfinite(cell_energy(&b)));
        }
        cell_map(&b, (double[9]){1, 0, 0, 0, 1, 0, 0, 0, 1}, 0);
        CHECK_LE(cell_largest(cell_force(&b), n), 1e-8);
        cell_free(&b);
    }
}

int main(void)
{
    RUN(a_hexahedron_moves_as_its_edges_say_and_twice_that_as_printed);
    RUN(sums_along_lines_move_the_lattice_as_it_is_moved);
    RUN(an_apex_goes_up_two_thirds_of_what_it_is_drawn);
    RUN(feels_nothing_at_rest_or_when_moved_as_a_whole);
    RUN(forces_have_no_sum_and_turn_with_the_body);
    RUN(small_strains_give_the_forces_of_operator_polar);
    RUN(shear_is_resisted_up_to_179_degrees);
    RUN(closed_and_straight_angles_have_the_axis_of_rest);
    RUN(collapsed_elements_give_finite_forces);
    return check_report();
}
