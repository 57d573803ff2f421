/* Component cell_elastic, operator polar: subdivision solids' elements in their own frames (paper A section 3.2-3.4),
 * node by node.
 */
#include "server/num/polar.h"
#include "tests/fixtures/cell_bodies.h"
#include "tests/stability/hard_case.h"

static void feels_nothing_at_rest(void)
{
    for (int i = 0; i < CELL_BODIES; i++) {
        cell_body b;
        cell_nth(&b, i);
        CHECK(pal_cell_elements_count(&b.solid->elements) > 0);
        /* against E times a face of edge 1 */
        CHECK_LE(cell_largest(cell_force(&b), 3 * b.body.n_node), 1e-12 * 1000);
        CHECK_LE(cell_energy(&b), 1e-24 * 1000);
        cell_free(&b);
    }
}

static void bodies_have_all_kinds(void)
{
    int n[PAL_CELL_KINDS] = {0};
    for (int i = 0; i < CELL_BODIES; i++) {
        cell_body b;
        cell_nth(&b, i);
        for (int k = 0; k < PAL_CELL_KINDS; k++) n[k] += b.solid->elements.n[k];
        cell_free(&b);
    }
    CHECK(n[PAL_CELL_CUBIC] >= 1);
    CHECK(n[PAL_CELL_HEX] >= 50);
    CHECK(n[PAL_CELL_PYRAMID] >= 8);
}

static void rigid_motion_costs_no_energy(void)
{
    for (int i = 0; i < CELL_BODIES; i++) {
        cell_body b;
        double stretch[9] = {1.01, 0, 0, 0, 1, 0, 0, 0, 1}, turn[9];
        const double angle[4] = {0, acos(-1) / 2, acos(-1), 2.5};
        cell_nth(&b, i);
        cell_map(&b, stretch, 0);
        double of = cell_energy(&b);
        CHECK(of > 0);
        for (int a = 0; a < 4; a++) {
            cell_rotation(angle[a], turn);
            cell_map(&b, turn, 100);
            CHECK_LE(cell_energy(&b), 1e-12 * of);
            CHECK_LE(cell_largest(cell_force(&b), 3 * b.body.n_node), 1e-8 * 1000);
        }
        cell_free(&b);
    }
}

static void ten_thousand_turns_leave_no_drift(void)
{
    cell_body b;
    double turn[9], first, max = 0, lowest = 1e300;
    const int n = CHECK_REPEATS(10000, 200);
    cell_nth(&b, 1);
    cell_map(&b, (double[9]){1.01, 0, 0, 0, 1, 0, 0, 0, 1}, 0);
    first = cell_energy(&b);
    double *bent = malloc(3 * sizeof(double) * (size_t)b.body.n_node);
    memcpy(bent, b.body.d, 3 * sizeof(double) * (size_t)b.body.n_node);
    for (int k = 1; k <= 4 * n; k++) {
        cell_rotation(acos(-1) / 2 * k, turn);
        for (int i = 0; i < b.body.n_node; i++)
            for (int c = 0; c < 3; c++) b.body.d[3 * i + c] = pal_dot3(turn + 3 * c, bent + 3 * i);
        double e = cell_energy(&b);
        max = fmax(max, e), lowest = fmin(lowest, e);
    }
    CHECK_NEAR(max / first, 1, 1e-9);
    CHECK_NEAR(lowest / first, 1, 1e-9);
    cell_rotation(0, turn);
    cell_map(&b, turn, 0);
    CHECK_LE(cell_energy(&b), 1e-12 * first);
    free(bent);
    cell_free(&b);
}

/* along random directions, by central differences */
static double worst_gradient(cell_body *b, int n_try)
{
    int n = 3 * b->body.n_node;
    double *p = malloc(sizeof *p * (size_t)n), *x = malloc(sizeof *x * (size_t)n), worst = 0;
    memcpy(x, b->body.d, sizeof *x * (size_t)n);
    for (int t = 0; t < n_try; t++) {
        const double h = 1e-5;
        for (int i = 0; i < n; i++) p[i] = 2 * pal_random_unit((uint64_t)t + 11, (uint64_t)i) - 1;
        const double *f = cell_force(b);
        double work = -cell_dot(f, p, n), of = sqrt(cell_dot(f, f, n) * cell_dot(p, p, n));
        double e[2];
        for (int s = 0; s < 2; s++) {
            for (int i = 0; i < n; i++) b->body.d[i] = x[i] + (s ? h : -h) * p[i];
            e[s] = cell_energy(b);
        }
        memcpy(b->body.d, x, sizeof *x * (size_t)n);
        worst = fmax(worst, fabs((e[1] - e[0]) / (2 * h) - work) / of);
    }
    free(p), free(x);
    return worst;
}

static void force_is_the_gradient_of_energy(void)
{
    /* 2 %, 10 % and 30 % of the shortest edge there: turns of Q in every element */
    const double part[3] = {0.02, 0.1, 0.3};
    for (int i = 0; i < CELL_BODIES; i++)
        for (int s = 0; s < 3; s++) {
            cell_body b;
            double turn[9];
            cell_nth(&b, i);
            double h = cbrt(pal_subdivision_solid_volume_m3(b.solid) / pal_cell_elements_count(&b.solid->elements));
            cell_rotation(1.2, turn);
            cell_map(&b, turn, 0.3);
            cell_shake(&b, part[s] * h, 21);
            CHECK_LE(worst_gradient(&b, 5), 1e-6);
            cell_free(&b);
        }
}

static void force_without_the_turning_of_the_frame_would_not_be(void)
{
    /* the same differences see what is left out: K d^ turned back only, of one hexahedron */
    cell_body b;
    cell_nth(&b, 0);
    cell_shake(&b, 0.3, 21);
    int n = 3 * b.body.n_node;
    double fixed[24] = {0}, u[24];
    cell_effect->tangent->linearise(b.row, &b.body);
    double turn[24 * 3] = {0};
    cell_effect->tangent->rotate(b.row, &b.body, turn);
    /* R K (R'x - X) = R K R'(x - R X) */
    double r[9];
    memcpy(r, turn, sizeof r);
    double scale = 1 / sqrt(r[0] * r[0] + r[3] * r[3] + r[6] * r[6]);
    for (int i = 0; i < 9; i++) r[i] *= scale;
    for (int i = 0; i < 8; i++)
        for (int c = 0; c < 3; c++) u[3 * i + c] = b.body.d[3 * i + c] - pal_dot3(r + 3 * c, b.body.node_rest + 3 * i);
    cell_effect->tangent->multiply(b.row, &b.body, -1, u, fixed);
    const double *f = cell_force(&b);
    double torque[2][3] = {{0}}, apart = 0;
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 2; k++) {
            double c[3];
            pal_cross3(c, b.body.d + 3 * i, (k ? fixed : f) + 3 * i);
            pal_axpy3(torque[k], 1, c);
        }
    for (int i = 0; i < n; i++) apart = fmax(apart, fabs(f[i] - fixed[i]));
    CHECK_LE(cell_largest(torque[0], 3), 1e-10 * cell_largest(f, n));
    CHECK(cell_largest(torque[1], 3) > 1e-3 * cell_largest(f, n));
    CHECK(apart > 1e-3 * cell_largest(f, n));
    cell_free(&b);
}

static void forces_have_no_sum_and_no_torque(void)
{
    for (int i = 0; i < CELL_BODIES; i++)
        for (int s = 0; s < 3; s++) {
            cell_body b;
            double turn[9], sum[3] = {0}, torque[3] = {0}, of = 0, arm = 0, c[3];
            const double part[3] = {0.01, 0.1, 0.3};
            cell_nth(&b, i);
            double h = cbrt(pal_subdivision_solid_volume_m3(b.solid) / pal_cell_elements_count(&b.solid->elements));
            cell_rotation(2.2, turn);
            cell_map(&b, turn, 0);
            cell_shake(&b, part[s] * h, 31);
            const double *f = cell_force(&b);
            for (int k = 0; k < b.body.n_node; k++) {
                const double *x = b.body.d + 3 * k;
                pal_axpy3(sum, 1, f + 3 * k);
                pal_cross3(c, x, f + 3 * k);
                pal_axpy3(torque, 1, c);
                of += pal_norm3(f + 3 * k), arm += pal_norm3(x) * pal_norm3(f + 3 * k);
            }
            CHECK(of > 0);
            CHECK_LE(pal_norm3(sum), 1e-10 * of);
            CHECK_LE(pal_norm3(torque), 1e-10 * arm);
            cell_free(&b);
        }
}

/* 1/2 eps' C eps of the symmetric part of a displacement gradient */
static double density_of(const double a[9], double young, double poisson)
{
    double mu = young / (2 * (1 + poisson)), lambda = young * poisson / ((1 + poisson) * (1 - 2 * poisson));
    double trace = a[0] + a[4] + a[8], square = 0;
    for (int i = 0; i < 9; i++) square += 0.25 * (a[i] + a[3 * (i % 3) + i / 3]) * (a[i] + a[3 * (i % 3) + i / 3]);
    return mu * square + 0.5 * lambda * trace * trace;
}

static void uniform_strain_has_the_energy_of_the_law(void)
{
    /* symmetric, so that the frame stays: any strain is exact but for moduli and K in float */
    const double strain[3][9] = {{0.01, 0, 0, 0, 0, 0, 0, 0, 0},
                                 {0, 0.01, 0, 0.01, 0, 0, 0, 0, 0},
                                 {0.1, 0.02, -0.03, 0.02, -0.05, 0.01, -0.03, 0.01, 0.04}};
    for (int i = 0; i < CELL_BODIES; i++)
        for (int s = 0; s < 3; s++) {
            cell_body b;
            double a[9];
            cell_nth(&b, i);
            for (int k = 0; k < 9; k++) a[k] = strain[s][k] + (k % 4 == 0);
            cell_map(&b, a, 0);
            double wanted = density_of(strain[s], 1000, 0.3) * pal_subdivision_solid_volume_m3(b.solid);
            CHECK_NEAR(cell_energy(&b) / wanted, 1, 1e-6);
            cell_free(&b);
        }
}

static void hexahedra_pass_the_patch_test(void)
{
    /* a block of skewed trilinear hexahedra under uniform strain: inner nodes bear nothing, faces sigma A */
    cell_body b;
    const double a[9] = {1.01, 0.003, 0, 0.003, 0.99, 0, 0, 0, 1};
    pal_cells cells = solid_block(2, 2, 2);
    for (int c = 0; c < 3; c++) cells.x[3 * 13 + c] += 0.2;
    cell_must(&b, cells, 0);
    CHECK_INT(b.solid->elements.n[PAL_CELL_HEX], 8);
    cell_map(&b, a, 0);
    const double *f = cell_force(&b);
    double mu = 1000 / 2.6, lambda = 300 / (1.3 * 0.4), face[3] = {0};
    CHECK_LE(cell_largest(f + 3 * 13, 3), 1e-6 * 10);
    for (int i = 0; i < b.body.n_node; i++)
        if (b.body.node_rest[3 * i] > 0.9) pal_axpy3(face, 1, f + 3 * i);
    /* area 4; the face's nodes pull back */
    CHECK_NEAR(face[0], -4 * (2 * mu * 0.01 + lambda * 0), 1e-4);
    CHECK_NEAR(face[1], -4 * (2 * mu * 0.003), 1e-4);
    CHECK_NEAR(face[2], 0, 1e-4);
    cell_free(&b);
}

static void cubic_elements_pass_the_patch_test_between_themselves(void)
{
    /* two cubic elements side by side in a 4 x 3 x 3 lattice: their forces under uniform stress are those of the
     * splines on one box, sigma times the integral of grad N; a spline that has none of its boundary inside bears 0 */
    cell_body b;
    double stretch[9] = {1.01, 0, 0, 0, 1, 0, 0, 0, 1}, sum = 0;
    cell_must(&b, solid_block(4, 3, 3), 0);
    CHECK_INT(b.solid->elements.n[PAL_CELL_CUBIC], 2);
    cell_only(&b, PAL_CELL_CUBIC);
    cell_map(&b, stretch, 0);
    const double *f = cell_force(&b);
    double mu = 1000 / 2.6, lambda = 300 / (1.3 * 0.4), sigma = (2 * mu + lambda) * 0.01;
    for (int i = 0; i < b.body.n_node; i++) {
        double x = b.body.node_rest[3 * i] + 2;
        /* integral over y, z is that of B_j B_k, 1/24, 11/24, 11/24, 1/24; along x: -(N(3) - N(1)) */
        const double value[5] = {1.0 / 6, 2.0 / 3, 0, -2.0 / 3, -1.0 / 6},
                     whole[4] = {1.0 / 24, 11.0 / 24, 11.0 / 24, 1.0 / 24};
        int at = (int)lround(x), j = (int)lround(b.body.node_rest[3 * i + 1] + 1.5),
            k = (int)lround(b.body.node_rest[3 * i + 2] + 1.5);
        double n = at == 2 ? 0 : value[at];
        CHECK_NEAR(f[3 * i], sigma * n * whole[j] * whole[k], 1e-5 * sigma);
        sum += fabs(f[3 * i]);
    }
    CHECK(sum > 0);
    cell_free(&b);
}

static void where_kinds_meet_uniform_strain_leaves_little(void)
{
    /* splines and trilinear functions do not match where their elements meet, so that inner nodes there bear forces
     * under uniform stress (half of sigma h^2); what reaches inner control points is 1.2 % of what outer ones bear */
    cell_body b;
    double inner = 0, external_force = 0;
    cell_must(&b, solid_block(3, 3, 3), 2);
    CHECK_INT(b.solid->elements.n[PAL_CELL_CUBIC], 1000);
    CHECK_INT(b.solid->elements.n[PAL_CELL_HEX], 728);
    cell_map(&b, (double[9]){1.01, 0, 0, 0, 1, 0, 0, 0, 1}, 0);
    double *g = calloc(3 * (size_t)b.body.n_dof, sizeof *g);
    pal_interpolation_apply_transpose(b.body.interpolation, cell_force(&b), g);
    for (int i = 0; i < b.body.n_dof; i++) {
        double *max = cell_largest(b.cells.x + 3 * i, 3) < 1 ? &inner : &external_force;
        *max = fmax(*max, pal_norm3(g + 3 * i));
    }
    CHECK(inner > 0);
    CHECK_LE(inner, 0.015 * external_force);
    free(g);
    cell_free(&b);
}

static void young_that_varies_inside_an_element_is_integrated_exactly(void)
{
    /* E = 1000 + 500 y, nu = 0 in the unit cube about the origin, by products with K, which are linear */
    for (int kind = 0; kind < 2; kind++) {
        cell_body b;
        cell_begin(&b, kind == 0 ? solid_block(1, 1, 1) : solid_block(3, 3, 3));
        b.def->material.poisson = 0;
        CHECK_INT(cell_make(&b, 0), PAL_ERR_OK);
        pal_cell_kind of = kind == 0 ? PAL_CELL_HEX : PAL_CELL_CUBIC;
        for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p++) {
            double at[3], x[3];
            pal_cell_gauss_point(p, at);
            double n[64];
            pal_cell_shape(pal_cell_kind_nodes(of), at, n, NULL);
            memset(x, 0, sizeof x);
            for (int m = 0; m < pal_cell_kind_nodes(of); m++)
                pal_axpy3(x, n[m], b.solid->node_rest + 3 * (size_t)pal_subdivision_solid_nodes(b.solid, of, 0)[m]);
            b.solid->samples[of].young_Pa[p] = (float)(1000 + 500 * x[1]);
        }
        b.solid->sampled++;
        cell_only(&b, of);
        int n = b.body.n_node;
        double *p = calloc(3 * (size_t)n, sizeof *p), *out = calloc(3 * (size_t)n, sizeof *out);
        for (int power = 1; power <= 2; power++) {
            /* (x y, 0, 0) has the strains y and x/2; with (x, 0, 0) besides 1 + y, which meets the odd part of E */
            for (int i = 0; i < n; i++) {
                const double *x = b.solid->node_rest + 3 * i;
                p[3 * i] = x[0] * x[1] + (power == 2 ? x[0] : 0);
            }
            memset(out, 0, 3 * sizeof *out * (size_t)n);
            cell_effect->tangent->linearise(b.row, &b.body);
            cell_effect->tangent->multiply(b.row, &b.body, 1, p, out);
            /* int (1000 + 500 y) ((y + c)^2 + x^2/2), c = 0 or 1 */
            double wanted = 1000 * (1.0 / 12 + 1.0 / 24) + (power == 2 ? 1000 + 500 * 2.0 / 12 : 0);
            /* of a hexahedron volume counts by its mean: int kappa t^2 less (int kappa t)^2 / int kappa, kappa = E / 3,
             * t the change of volume c + y */
            double mean = 500.0 / 36 + (power == 2 ? 1000.0 / 3 : 0);
            if (of == PAL_CELL_HEX)
                wanted -= (1000.0 / 12 + (power == 2 ? 1000 + 500 * 2.0 / 12 : 0)) / 3 - mean * mean / (1000.0 / 3);
            CHECK_NEAR(cell_dot(p, out, 3 * n) / wanted, 1, 2e-6);
        }
        free(p), free(out);
        cell_free(&b);
    }
}

static void painting_takes_effect(void)
{
    cell_body b;
    pal_stroke stroke = {.radius_m = 100, .softness = 0.5, .young_factor = 10, .density_factor = 1};
    cell_nth(&b, 1);
    cell_map(&b, (double[9]){1.01, 0, 0, 0, 1, 0, 0, 0, 1}, 0);
    double was = cell_energy(&b);
    b.def->stroke = &stroke, b.def->n_stroke = 1;
    pal_subdivision_solid_sample(b.solid, b.def);
    CHECK_NEAR(cell_energy(&b) / was, 10, 1e-5);
    const double *f = cell_force(&b);
    CHECK(cell_largest(f, 3 * b.body.n_node) > 0);
    CHECK_LE(worst_gradient(&b, 2), 1e-6);
    cell_free(&b);
}

static void size_does_not_matter(void)
{
    double energy[3], force[3];
    const double size[3] = {1, 1e-6, 1e6};
    for (int s = 0; s < 3; s++) {
        cell_body b;
        double turn[9];
        pal_cells cells = cell_lattice(0.1);
        for (int i = 0; i < 3 * cells.n_vertex; i++) cells.x[i] *= size[s];
        cell_must(&b, cells, 0);
        cell_rotation(1, turn);
        cell_map(&b, turn, 0);
        cell_shake(&b, 0.1 * size[s], 5);
        energy[s] = cell_energy(&b) / pow(size[s], 3);
        force[s] = cell_largest(cell_force(&b), 3 * b.body.n_node) / pow(size[s], 2);
        cell_free(&b);
    }
    for (int s = 1; s < 3; s++) {
        CHECK_NEAR(energy[s] / energy[0], 1, 1e-6);
        CHECK_NEAR(force[s] / force[0], 1, 1e-6);
    }
}

static void shear_is_resisted_up_to_179_degrees(void)
{
    /* a rhombus: edges keep their length, the angle between them goes from 90 to 179 degrees and to 1. The moment that
     * takes it back is -dE/dangle */
    for (int kind = 0; kind < 2; kind++) {
        cell_body b;
        cell_nth(&b, kind);
        if (kind) cell_only(&b, PAL_CELL_CUBIC);
        int n = 3 * b.body.n_node;
        double *rate = malloc(sizeof *rate * (size_t)n);
        for (int degree = 1; degree <= 179; degree += 2) {
            if (degree == 90) continue;
            double turn = (90 - degree) * acos(-1) / 360, c = cos(turn), s = sin(turn);
            cell_map(&b, (double[9]){c, s, 0, s, c, 0, 0, 0, 1}, 0);
            for (int i = 0; i < b.body.n_node; i++) {
                const double *x = b.body.node_rest + 3 * i;
                rate[3 * i] = -s * x[0] + c * x[1], rate[3 * i + 1] = c * x[0] - s * x[1], rate[3 * i + 2] = 0;
            }
            double moment = cell_dot(cell_force(&b), rate, n);
            HARD_CASE_ALL("cell_angles", "subdivision_fem", "operator polar, 1 to 179 degrees: moment keeps its sign",
                          turn > 0 ? moment < 0 : moment > 0, 1);
        }
        free(rate);
        cell_free(&b);
    }
}

static void collapsed_elements_give_finite_forces(void)
{
    const double map[6][9] = {{0},                            /* a point  */
                              {1, 0, 0, 0, 0, 0, 0, 0, 0},    /* a line   */
                              {1, 0, 0, 0, 1, 0, 0, 0, 0},    /* flat     */
                              {1, 0, 0, 0, 1, 0, 0, 0, -1},   /* mirrored */
                              {-1, 0, 0, 0, -1, 0, 0, 0, -1}, /* inverted */
                              {1, 0, 0, 0, 1, 0, 0, 0, -1e-9}};
    for (int i = 0; i < CELL_BODIES; i++) {
        cell_body b;
        cell_nth(&b, i);
        int n = 3 * b.body.n_node;
        for (int k = 0; k < 6; k++) {
            cell_map(&b, map[k], 0.1);
            double largest = cell_largest(cell_force(&b), n);
            CHECK_LE(largest, 1e5);
            CHECK(largest > 1);
            CHECK(isfinite(cell_energy(&b)));
            /* towards rest: the work of a move there is positive */
            double work = 0;
            for (int q = 0; q < n; q++) work += b.body.f[q] * (b.body.node_rest[q] + 0.1 - b.body.d[q]);
            if (k < 3) CHECK(work > 0);
        }
        cell_map(&b, (double[9]){1, 0, 0, 0, 1, 0, 0, 0, 1}, 0);
        CHECK_LE(cell_largest(cell_force(&b), n), 1e-8);
        b.body.d[4] = NAN;
        cell_force(&b);
        cell_effect->reset(b.row, &b.body);
        cell_map(&b, (double[9]){1, 0, 0, 0, 1, 0, 0, 0, 1}, 0);
        CHECK_LE(cell_largest(cell_force(&b), n), 1e-8);
        cell_free(&b);
    }
}

static void products_are_those_of_the_tangent_with_fixed_rotations(void)
{
    for (int i = 0; i < CELL_BODIES; i++) {
        cell_body b;
        double r[9];
        cell_nth(&b, i);
        int n = 3 * b.body.n_node;
        double *p = calloc((size_t)n, sizeof *p), *q = calloc((size_t)n, sizeof *q),
               *kp = calloc((size_t)n, sizeof *kp), *kq = calloc((size_t)n, sizeof *kq),
               *turn = calloc(3 * (size_t)n, sizeof *turn);
        cell_rotation(0.9, r);
        cell_map(&b, r, 0);
        cell_effect->tangent->linearise(b.row, &b.body);
        for (int k = 0; k < n; k++) {
            p[k] = 2 * pal_random_unit(1, (uint64_t)k) - 1;
            q[k] = 2 * pal_random_unit(2, (uint64_t)k) - 1;
        }
        cell_effect->tangent->multiply(b.row, &b.body, 2, p, kp);
        cell_effect->tangent->multiply(b.row, &b.body, 2, q, kq);
        CHECK_NEAR(cell_dot(p, kq, n) / cell_dot(q, kp, n), 1, 1e-10);
        CHECK(cell_dot(p, kp, n) > 0);
        /* where nothing is strained, holding the rotations changes nothing */
        const double h = 1e-6;
        for (int k = 0; k < n; k++) b.body.d[k] += h * p[k];
        const double *f = cell_force(&b);
        double apart = 0;
        for (int k = 0; k < n; k++) apart = fmax(apart, fabs(-2 * f[k] / h - kp[k]));
        CHECK_LE(apart, 1e-3 * cell_largest(kp, n));
        /* rotations at nodes: of the body, weighing the stiffness of all elements together */
        cell_effect->tangent->rotate(b.row, &b.body, turn);
        double sum[9] = {0}, all_N_m = 0;
        for (int e = 0; e < b.row->n_cell; e++) all_N_m += b.row->k_N_m[e];
        for (int k = 0; k < 3 * n; k++) sum[k % 9] += turn[k];
        for (int k = 0; k < 9; k++) CHECK_NEAR(sum[k] / all_N_m, r[k], 1e-5);
        free(p), free(q), free(kp), free(kq), free(turn);
        cell_free(&b);
    }
}

static void measures_are_those_of_the_strain(void)
{
    for (int i = 0; i < CELL_BODIES; i++) {
        cell_body b;
        cell_nth(&b, i);
        int n = b.body.n_node;
        double r[9], a[9], *sum = calloc((size_t)n, sizeof *sum), *volume = calloc((size_t)n, sizeof *volume), all = 0;
        cell_rotation(0.4, r);
        for (int k = 0; k < 9; k++) a[k] = r[k] * (k % 3 == 0 ? 1.02 : 1);
        cell_map(&b, a, 0);
        cell_force(&b);
        for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
            if (b.solid->elements.n[kind] == 0) continue;
            pal_cell_points points;
            pal_cells_elastic_points(b.row, b.body.d, kind, b.solid->elements.n[kind] - 1, &points);
            const double e[6] = {0.02, 0, 0, 0, 0, 0};
            for (int p = 0; p < PAL_CELL_GAUSS_POINTS; p += 7) {
                for (int k = 0; k < 6; k++) CHECK_NEAR(points.strain[p][k], e[k], 1e-9);
                CHECK_NEAR(points.det_f[p], 1.02, 1e-9);
                CHECK_NEAR(points.von_mises_Pa[p], 2 * 1000 / 2.6 * 0.02, 1e-5);
                CHECK_NEAR(points.energy_J_m3[p], density_of((double[9]){0.02}, 1000, 0.3), 1e-6);
            }
        }
        cell_effect->inspect.measure(b.row, &b.body, PAL_FIELD_VON_MISES_PA, sum, volume);
        for (int k = 0; k < n; k++) {
            CHECK_NEAR(sum[k] / volume[k], 2 * 1000 / 2.6 * 0.02, 1e-4);
            all += volume[k];
        }
        CHECK_NEAR(all / pal_subdivision_solid_volume_m3(b.solid), 1, 1e-12);
        memset(sum, 0, sizeof *sum * (size_t)n), all = 0;
        cell_effect->inspect.measure(b.row, &b.body, PAL_FIELD_ENERGY_J_M3, sum, volume);
        for (int k = 0; k < n; k++) all += sum[k];
        CHECK_NEAR(all / cell_energy(&b), 1, 1e-6);
        free(sum), free(volume);
        cell_free(&b);
    }
}

static void refuses_what_it_cannot_be(void)
{
    cell_body b;
    void *self = NULL;
    cell_begin(&b, solid_block(1, 1, 1));
    CHECK_INT(pal_entry_put_text(&b.item, "operator", "cosine", &b.diag), PAL_ERR_OK);
    CHECK_INT(cell_make(&b, 0), PAL_ERR_REFUSED);
    CHECK_TEXT(b.diag.text, "model.operator: \"cosine\", wanted \"polar\" or \"edges\"");
    pal_body none = {0};
    pal_build build = {.body = &none, .arena = b.arena, .diag = &b.diag};
    pal_config_entry item;
    pal_entry_init(&item, "effects[1]", "cell_elastic");
    CHECK_INT(cell_effect->make(&item, &build, &self), PAL_ERR_REFUSED);
    CHECK_TEXT(b.diag.text, "effects[1]: \"cell_elastic\" needs a body of model subdivision_fem");
    CHECK(self == NULL);
    cell_free(&b);
}

int main(void)
{
    RUN(bodies_have_all_kinds);
    RUN(feels_nothing_at_rest);
    RUN(rigid_motion_costs_no_energy);
    RUN(ten_thousand_turns_leave_no_drift);
    RUN(force_is_the_gradient_of_energy);
    RUN(force_without_the_turning_of_the_frame_would_not_be);
    RUN(forces_have_no_sum_and_no_torque);
    RUN(uniform_strain_has_the_energy_of_the_law);
    RUN(hexahedra_pass_the_patch_test);
    RUN(cubic_elements_pass_the_patch_test_between_themselves);
    RUN(where_kinds_meet_uniform_strain_leaves_little);
    RUN(young_that_varies_inside_an_element_is_integrated_exactly);
    RUN(painting_takes_effect);
    RUN(size_does_not_matter);
    RUN(shear_is_resisted_up_to_179_degrees);
    RUN(collapsed_elements_give_finite_forces);
    RUN(products_are_those_of_the_tangent_with_fixed_rotations);
    RUN(measures_are_those_of_the_strain);
    RUN(refuses_what_it_cannot_be);
    return check_report();
}
