/* Subdivision solids that hardly change their volume: what whole control cells keep of it (cell_volume.c), node by
 * node, without a world. */
#include "tests/fixtures/cell_bodies.h"

/* bodies of all kinds of elements, several to a control cell but for the first */
static void make(cell_body *b, int i, double poisson)
{
    static const int level[] = {0, 1, 1, 2};
    cell_begin(b, i == 0   ? solid_block(1, 1, 1)
                  : i == 1 ? cell_lattice(0.1)
                  : i == 2 ? cell_pyramids()
                           : solid_block(2, 1, 1));
    b->def->material.poisson = poisson;
    if (cell_make(b, level[i])) CHECK_FAIL("%s", b->diag.text);
}
enum { BODIES = 4 };

static void it_is_there_above_nu_0_3(void)
{
    static const double poisson[] = {0.2, 0.3, 0.31, 0.4999};
    for (int q = 0; q < 4; q++) {
        cell_body b;
        make(&b, 3, poisson[q]);
        CHECK_INT(b.row->volume.n, q < 2 ? 0 : 2);
        pal_cliques couple;
        CHECK(cell_effect->tangent->couple(b.row, &couple) == (q >= 2));
        cell_free(&b);
    }
}

/* of any map of the whole body: mu e:e V + lambda/2 (tr e)^2 V, e small */
static void uniform_strains_cost_what_they_should(void)
{
    static const double strain[3][9] = {{1e-4, 0, 0, 0, 1e-4, 0, 0, 0, 1e-4},
                                        {1e-4, 0, 0, 0, -1e-4, 0, 0, 0, 0},
                                        {1e-4, 5e-5, 0, 5e-5, 2e-4, 1e-4, 0, 1e-4, -5e-5}};
    const double nu = 0.49, mu = 1000 / (2 * (1 + nu)), lambda = 1000 * nu / ((1 + nu) * (1 - 2 * nu));
    for (int i = 0; i < BODIES; i++)
        for (int k = 0; k < 3; k++) {
            cell_body b;
            double a[9], square = 0, trace = strain[k][0] + strain[k][4] + strain[k][8];
            make(&b, i, nu);
            for (int c = 0; c < 9; c++) a[c] = strain[k][c] + (c % 4 == 0), square += strain[k][c] * strain[k][c];
            cell_map(&b, a, 0);
            const double wanted =
                (mu * square + 0.5 * lambda * trace * trace) * pal_subdivision_solid_volume_m3(b.solid);
            CHECK_NEAR(cell_energy(&b) / wanted, 1, 2e-3);
            cell_free(&b);
        }
}

static void forces_are_the_gradient_and_sum_up_to_nothing(void)
{
    for (int i = 0; i < BODIES; i++) {
        cell_body b;
        double turn[9], force, torque, worst = 0, e[2];
        make(&b, i, 0.499);
        const int n = 3 * b.body.n_node;
        double *x = calloc(2 * (size_t)n, sizeof *x), *p = x + n;
        cell_rotation(1.2, turn);
        cell_map(&b, turn, 0.3);
        cell_shake(&b, 0.1 * cbrt(pal_subdivision_solid_volume_m3(b.solid) / b.row->n_cell), 21);
        memcpy(x, b.body.d, sizeof *x * (size_t)n);
        for (int k = 0; k < 4; k++) {
            for (int m = 0; m < n; m++) p[m] = 2 * pal_random_unit(11 + (uint64_t)k, (uint64_t)m) - 1;
            memcpy(b.body.d, x, sizeof *x * (size_t)n);
            const double *f = cell_force(&b), work = -cell_dot(f, p, n),
                         of = sqrt(cell_dot(f, f, n) * cell_dot(p, p, n));
            for (int s = 0; s < 2; s++) {
                for (int m = 0; m < n; m++) b.body.d[m] = x[m] + (s ? 1e-5 : -1e-5) * p[m];
                e[s] = cell_energy(&b);
            }
            worst = fmax(worst, fabs((e[1] - e[0]) / 2e-5 - work) / of);
        }
        CHECK_LE(worst, 1e-6);
        memcpy(b.body.d, x, sizeof *x * (size_t)n);
        cell_net(&b, &force, &torque);
        CHECK_LE(force, 1e-12);
        /* stored K is rounded to float, turning with the body to the bit */
        CHECK_LE(torque, 1e-10);
        free(x);
        cell_free(&b);
    }
}

/* near rest the tangent is what forces change by, and symmetric */
static void the_tangent_is_that_of_the_forces(void)
{
    for (int i = 0; i < BODIES; i++) {
        cell_body b;
        make(&b, i, 0.49);
        const int n = 3 * b.body.n_node;
        double *p = calloc(4 * (size_t)n, sizeof *p), *q = p + n, *kp = q + n, *kq = kp + n, max = 0;
        cell_effect->tangent->linearise(b.row, &b.body);
        for (int k = 0; k < n; k++)
            p[k] = pal_random_unit(7, (uint64_t)k) - 0.5, q[k] = pal_random_unit(8, (uint64_t)k) - 0.5;
        cell_effect->tangent->multiply(b.row, &b.body, 1, p, kp);
        cell_effect->tangent->multiply(b.row, &b.body, 1, q, kq);
        CHECK_NEAR(cell_dot(p, kq, n) / cell_dot(p, kp, n), cell_dot(q, kp, n) / cell_dot(p, kp, n), 1e-6);
        for (int k = 0; k < n; k++) b.body.d[k] = b.body.node_rest[k] + 1e-6 * p[k];
        const double *f = cell_force(&b);
        for (int k = 0; k < n; k++) max = fmax(max, fabs(-1e6 * f[k] - kp[k]));
        CHECK_LE(max, 1e-4 * cell_largest(kp, n));
        free(p);
        cell_free(&b);
    }
}

/* one element of eight grows by what another one shrinks: no more to pay at 0.4999 than at 0.31 but for mu, as each
 * element has lambda = mu to itself at most */
static void elements_of_a_control_cell_share_its_volume(void)
{
    double energy[2];
    for (int q = 0; q < 2; q++) {
        cell_body b;
        cell_begin(&b, solid_block(1, 1, 1));
        b.def->material.poisson = q ? 0.4999 : 0.31;
        CHECK(!cell_make(&b, 1));
        CHECK_INT(b.solid->elements.n[PAL_CELL_HEX], 8);
        CHECK_INT(b.row->volume.n, 1);
        /* the node in the middle moves: what is before it shrinks, what is behind it grows, one against the other */
        int middle = 0;
        double mean[3] = {0, 0, 0}, near = INFINITY;
        for (int m = 0; m < b.body.n_node; m++) pal_axpy3(mean, 1.0 / b.body.n_node, b.body.d + 3 * m);
        for (int m = 0; m < b.body.n_node; m++)
            if (pal_dist3(mean, b.body.d + 3 * m) < near) near = pal_dist3(mean, b.body.d + 3 * m), middle = m;
        b.body.d[3 * middle] += 1e-4;
        energy[q] = cell_energy(&b) * 2 * (1 + b.def->material.poisson); /* over mu */
        cell_free(&b);
    }
    CHECK(energy[0] > 0);
    CHECK_NEAR(energy[1] / energy[0], 1, 1e-3);
}

static void regions_take_whole_control_cells(void)
{
    cell_body b;
    make(&b, 3, 0.49);
    /* one corner node through its element: all 64 of that control cell, none of the other but what touches */
    int far = 0;
    for (int m = 0; m < b.body.n_node; m++)
        if (b.body.d[3 * m] + b.body.d[3 * m + 1] > b.body.d[3 * far] + b.body.d[3 * far + 1]) far = m;
    b.body.d[3 * far] -= 2;
    CHECK(cell_effect->recovery.recover(b.row, &(pal_step){.body = &b.body}) & PAL_INVERSION_CHANGED);
    int of[2] = {0, 0}, all[2] = {0, 0};
    for (int e = 0; e < b.row->n_cell; e++) {
        int kind = e >= b.row->first[PAL_CELL_HEX] ? PAL_CELL_HEX : PAL_CELL_CUBIC;
        int home = b.row->group[kind].home[e - b.row->first[kind]];
        all[home]++, of[home] += b.row->recovery->region[e] >= 0;
    }
    CHECK_INT(all[0] + all[1], 128);
    for (int h = 0; h < 2; h++) CHECK(of[h] == 0 || of[h] == all[h]);
    CHECK(of[0] + of[1] > 0);
    cell_free(&b);
}

int main(void)
{
    RUN(it_is_there_above_nu_0_3);
    RUN(uniform_strains_cost_what_they_should);
    RUN(forces_are_the_gradient_and_sum_up_to_nothing);
    RUN(the_tangent_is_that_of_the_forces);
    RUN(elements_of_a_control_cell_share_its_volume);
    RUN(regions_take_whole_control_cells);
    return check_report();
}
