/* The constraints of springs: gradients and second derivatives against central differences, what translation and
 * rotation leave alone, analytic values, shapes without a direction. */
#include "server/sim/springs/spring_constraint.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

static const pal_spring_kind kinds[] = {PAL_SPRING_DISTANCE, PAL_SPRING_AREA, PAL_SPRING_VOLUME};
static uint64_t seed = 3;

static double uniform(void) /* in [-1, 1) */
{
    return random_signed(&seed);
}

typedef struct spring {
    double rest[4][3], at[4][3], w;
    const double *x[PAL_CORNERS];
} spring;

/* corners of a unit tetrahedron moved by up to a fifth, then once more: well away from degenerate */
static void spring_make(spring *s, pal_spring_kind kind, double shake)
{
    static const double unit[4][3] = {{0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int c = 0; c < 4; c++) {
        s->x[c] = s->rest[c];
        for (int d = 0; d < 3; d++) {
            s->rest[c][d] = unit[c][d] + 0.2 * uniform();
            s->at[c][d] = s->rest[c][d] + shake * uniform();
        }
    }
    s->w = 1 / pal_spring_measure(kind, s->x);
    for (int c = 0; c < 4; c++) s->x[c] = s->at[c];
}

static void constraints_are_zero_at_their_rest_measure(void)
{
    for (int k = 0; k < 3; k++)
        for (int turn = 0; turn < 20; turn++) {
            spring s;
            pal_constraint shape;
            spring_make(&s, kinds[k], 0);
            pal_spring_constraint(kinds[k], s.x, s.w, &shape);
            CHECK_NEAR(shape.c, 0, 1e-15);
        }
}

/* a right-angled corner with legs 1, 2, 3: l = sqrt 5 and 2A = 2 of its face, 6V = 6 */
static void constraints_of_a_right_angled_corner_are_analytic(void)
{
    static const double p[4][3] = {{0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
    const double *x[4] = {p[0], p[1], p[2], p[3]}, *hypotenuse[4] = {p[1], p[2], p[1], p[1]};
    pal_constraint s;
    CHECK_INT(pal_spring_corner_count(PAL_SPRING_DISTANCE), 2);
    CHECK_INT(pal_spring_corner_count(PAL_SPRING_AREA), 3);
    CHECK_INT(pal_spring_corner_count(PAL_SPRING_VOLUME), 4);
    pal_spring_constraint(PAL_SPRING_DISTANCE, hypotenuse, 0.5, &s);
    CHECK_NEAR(s.c, sqrt(5) / 2 - 1, 1e-15);
    CHECK_NEAR(s.g[1][1], 0.5 * 2 / sqrt(5), 1e-15);
    pal_spring_constraint(PAL_SPRING_AREA, x, 0.25, &s);
    CHECK_NEAR(s.c, -0.5, 1e-15);
    CHECK_NEAR(s.g[2][1], 0.25, 1e-15);
    pal_spring_constraint(PAL_SPRING_VOLUME, x, 0.5, &s);
    CHECK_NEAR(s.c, 2, 1e-15);
    CHECK_NEAR(s.g[3][2], 1, 1e-15);
    const double *turned[4] = {p[1], p[0], p[2], p[3]};
    CHECK_NEAR(pal_spring_measure(PAL_SPRING_VOLUME, turned), -6, 1e-15);
}

static void gradient_is_the_difference_quotient(void)
{
    const double step = 1e-6;
    for (int k = 0; k < 3; k++)
        for (int turn = 0; turn < 50; turn++) {
            spring s;
            pal_constraint shape, up, down;
            spring_make(&s, kinds[k], 0.3);
            pal_spring_constraint(kinds[k], s.x, s.w, &shape);
            for (int i = 0; i < 3 * pal_spring_corner_count(kinds[k]); i++) {
                double *x = &s.at[i / 3][i % 3], was = *x;
                *x = was + step;
                pal_spring_constraint(kinds[k], s.x, s.w, &up);
                *x = was - step;
                pal_spring_constraint(kinds[k], s.x, s.w, &down);
                *x = was;
                CHECK_NEAR(shape.g[i / 3][i % 3], (up.c - down.c) / (2 * step), 1e-7 * (1 + fabs(s.w)));
            }
        }
}

static void hessian_is_the_difference_quotient_of_the_gradient(void)
{
    const double step = 1e-5;
    for (int k = 0; k < 3; k++)
        for (int turn = 0; turn < 50; turn++) {
            spring s;
            pal_constraint up, down;
            double h[4][4][9];
            int n = pal_spring_corner_count(kinds[k]);
            spring_make(&s, kinds[k], 0.3);
            double size = pal_spring_measure(kinds[k], s.x), reach = fabs(s.w) * (1 + 1 / (size * size));
            pal_spring_constraint_hessian(kinds[k], s.x, s.w, h);
            for (int j = 0; j < 3 * n; j++) {
                double *x = &s.at[j / 3][j % 3], was = *x;
                *x = was + step;
                pal_spring_constraint(kinds[k], s.x, s.w, &up);
                *x = was - step;
                pal_spring_constraint(kinds[k], s.x, s.w, &down);
                *x = was;
                for (int i = 0; i < 3 * n; i++)
                    CHECK_NEAR(h[i / 3][j / 3][3 * (i % 3) + j % 3],
                               (up.g[i / 3][i % 3] - down.g[i / 3][i % 3]) / (2 * step), 1e-7 * reach);
            }
        }
}

/* H_ab = H_ba', sum over b of H_ab = 0, and turning all corners by t about an axis turns the gradient with them:
 * sum over b of H_ab (t x x_b) = t x g_a */
static void hessian_is_symmetric_and_invariant_to_translation(void)
{
    for (int k = 0; k < 3; k++)
        for (int turn = 0; turn < 50; turn++) {
            spring s;
            pal_constraint shape;
            double h[4][4][9];
            const double t[3] = {uniform(), uniform(), uniform()};
            int n = pal_spring_corner_count(kinds[k]);
            spring_make(&s, kinds[k], 0.3);
            pal_spring_constraint(kinds[k], s.x, s.w, &shape);
            pal_spring_constraint_hessian(kinds[k], s.x, s.w, h);
            double reach = 0;
            for (int a = 0; a < n; a++)
                for (int i = 0; i < 9; i++) reach = fmax(reach, fabs(h[a][(a + 1) % n][i]));
            for (int a = 0; a < n; a++) {
                double sum[9] = {0}, turned[3] = {0}, wanted[3];
                pal_cross3(wanted, t, shape.g[a]);
                for (int b = 0; b < n; b++) {
                    double move[3], part[3];
                    pal_cross3(move, t, s.x[b]);
                    pal_mul33(part, h[a][b], move);
                    pal_add3(turned, turned, part);
                    for (int i = 0; i < 9; i++) {
                        sum[i] += h[a][b][i];
                        CHECK_NEAR(h[a][b][i], h[b][a][3 * (i % 3) + i / 3], 1e-14 * reach);
                    }
                }
                for (int i = 0; i < 9; i++) CHECK_NEAR(sum[i], 0, 1e-14 * reach);
                for (int d = 0; d < 3; d++) CHECK_NEAR(turned[d], wanted[d], 1e-13 * reach);
            }
        }
}

static void constraints_without_direction_have_neither_gradient_nor_hessian(void)
{
    static const double p[3] = {0.25, -1, 2};
    const double *x[4] = {p, p, p, p};
    for (int k = 0; k < 3; k++) {
        int n = pal_spring_corner_count(kinds[k]);
        pal_constraint s;
        double h[4][4][9];
        for (int i = 0; i < 4 * 4 * 9; i++) h[i / 36][i / 9 % 4][i % 9] = 77;
        pal_spring_constraint(kinds[k], x, 2, &s);
        pal_spring_constraint_hessian(kinds[k], x, 2, h);
        CHECK_NEAR(s.c, -1, 0);
        for (int a = 0; a < 4; a++)
            for (int b = 0; b < 4; b++)
                for (int i = 0; i < 9; i++) CHECK_NEAR(h[a][b][i], a < n && b < n ? 0 : 77, 0);
        for (int a = 0; a < n; a++)
            for (int d = 0; d < 3; d++) CHECK_NEAR(s.g[a][d], 0, 0);
    }
}

int main(void)
{
    RUN(constraints_are_zero_at_their_rest_measure);
    RUN(constraints_of_a_right_angled_corner_are_analytic);
    RUN(gradient_is_the_difference_quotient);
    RUN(hessian_is_the_difference_quotient_of_the_gradient);
    RUN(hessian_is_symmetric_and_invariant_to_translation);
    RUN(constraints_without_direction_have_neither_gradient_nor_hessian);
    return check_report();
}
