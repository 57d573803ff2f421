/* Elements of subdivision solids that are inverted, and what they run on then (recovery/recovery.h): node by node,
 * without a world. */
#include "tests/fixtures/cell_bodies.h"

/* an update after so many s; true: elements have entered or left a region */
static bool look_after(cell_body *b, double passed_s)
{
    static double time_s;
    time_s += passed_s;
    pal_component force = {.effect = cell_effect, .self = b->row};
    pal_step step = {.body = &b->body, .force = &force, .n_force = 1, .time_s = time_s};
    return cell_effect->recovery.recover(b->row, &step) & PAL_INVERSION_CHANGED;
}
static bool look(cell_body *b)
{
    return look_after(b, 1.0 / 60);
}

/* crushed elements enter at once, those that are inverted at corners alone after a time */
static bool enter(cell_body *b)
{
    const bool crushed = look(b);
    return look_after(b, PAL_RECOVERY_WAIT_S) || crushed;
}

/* elements in regions, which do not act */
static int recovering(const cell_body *b)
{
    int n = 0;
    for (int e = 0; e < b->row->n_cell; e++) n += b->row->recovery->region[e] >= 0;
    CHECK_INT(b->row->n_off, n);
    return n;
}

static double edge_m(const cell_body *b)
{
    return cbrt(pal_subdivision_solid_volume_m3(b->solid) / pal_cell_elements_count(&b->solid->elements));
}

/* turned, and shaken so that elements are inverted */
static void recovery(cell_body *b, int i, uint64_t seed)
{
    double rotation[9];
    cell_nth(b, i);
    cell_rotation(1.2, rotation);
    cell_map(b, rotation, 0.3);
    cell_shake(b, (i == 0 ? 3 : 0.9) * edge_m(b), seed);
}

static void elements_without_inversion_stay_elements(void)
{
    for (int i = 0; i < CELL_BODIES; i++) {
        cell_body b;
        double rotation[9];
        cell_nth(&b, i);
        cell_rotation(2.2, rotation);
        rotation[0] *= 1.2, rotation[1] *= 1.2, rotation[2] *= 1.2;
        cell_map(&b, rotation, 0.3);
        cell_shake(&b, 0.05 * edge_m(&b), 4);
        CHECK(!look(&b) && !look(&b));
        CHECK_INT(b.row->recovery->n_region, 0);
        CHECK(b.body.safeguards.n_inversion == 0);
        /* the volume that is seen is that of the map, and so is that of the middle: 1.2 times, less the noise */
        const pal_recovery *r = b.row->recovery;
        r->model.ratios(r->model.self, &b.body, r->low, r->high, r->middle);
        for (int e = 0; e < b.row->n_cell; e++) {
            CHECK_LE(r->low[e], 1.2);
            CHECK(r->low[e] > 0.6);
            CHECK(r->middle[e] > 0.8 && r->middle[e] < 1.6);
        }
        cell_free(&b);
    }
}

static void a_region_begins_with_no_more_energy_than_its_elements(void)
{
    int n_region = 0;
    for (int i = 0; i < CELL_BODIES; i++)
        for (uint64_t seed = 1; seed <= 5; seed++) {
            cell_body b;
            recovery(&b, i, seed);
            const double before = cell_energy(&b);
            /* but for what the least s puts in, which is counted */
            if (look(&b)) CHECK_LE(cell_energy(&b), before * (1 + 1e-12) + b.row->recovery->debt_J);
            n_region += b.row->recovery->n_region;
            CHECK((b.row->recovery->n_region > 0) == (recovering(&b) > 0));
            /* what is there: the same again */
            CHECK(!look(&b));
            cell_free(&b);
        }
    CHECK(n_region >= 15);
}

/* along random directions, by central differences */
static double worst_gradient(cell_body *b, int n_try)
{
    const int n = 3 * b->body.n_node;
    double *p = malloc(sizeof *p * (size_t)n), *x = malloc(sizeof *x * (size_t)n), worst = 0;
    memcpy(x, b->body.d, sizeof *x * (size_t)n);
    for (int t = 0; t < n_try; t++) {
        const double h = 1e-5;
        double e[2];
        for (int i = 0; i < n; i++) p[i] = 2 * pal_random_unit((uint64_t)t + 11, (uint64_t)i) - 1;
        const double *f = cell_force(b), work = -cell_dot(f, p, n), of = sqrt(cell_dot(f, f, n) * cell_dot(p, p, n));
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

/* regions beside elements: the exact gradient, no net force, no net torque */
static void forces_of_regions_are_a_gradient_and_sum_to_zero(void)
{
    for (int i = 0; i < CELL_BODIES; i++) {
        cell_body b;
        double force, torque;
        recovery(&b, i, 3);
        CHECK(enter(&b));
        CHECK_LE(worst_gradient(&b, 4), 1e-6);
        cell_net(&b, &force, &torque);
        CHECK_LE(force, 1e-12);
        CHECK_LE(torque, 1e-12);
        cell_free(&b);
    }
}

/* the tangent with rotations held: symmetric, never below 0, nothing for a push of all */
static void the_tangent_of_regions_is_symmetric_and_semi_definite(void)
{
    for (int i = 0; i < CELL_BODIES; i++) {
        cell_body b;
        recovery(&b, i, 3);
        CHECK(enter(&b));
        const int n = 3 * b.body.n_node;
        double *p = calloc(4 * (size_t)n, sizeof *p), *q = p + n, *kp = q + n, *kq = kp + n;
        cell_effect->tangent->linearise(b.row, &b.body);
        for (int k = 0; k < n; k++)
            p[k] = pal_random_unit(7, (uint64_t)k) - 0.5, q[k] = pal_random_unit(8, (uint64_t)k) - 0.5;
        cell_effect->tangent->multiply(b.row, &b.body, 1, p, kp);
        cell_effect->tangent->multiply(b.row, &b.body, 1, q, kq);
        CHECK_NEAR(cell_dot(p, kq, n) / cell_dot(p, kp, n), cell_dot(q, kp, n) / cell_dot(p, kp, n), 1e-6);
        CHECK(cell_dot(p, kp, n) > 0 && cell_dot(q, kq, n) > 0);
        for (int k = 0; k < n; k++) p[k] = 1, kq[k] = 0;
        cell_effect->tangent->multiply(b.row, &b.body, 1, p, kq);
        CHECK_LE(cell_largest(kq, n), 1e-9 * cell_largest(kp, n));
        free(p);
        cell_free(&b);
    }
}

/* put back to where nothing is inverted, elements take over again, to the bit; a reset does the same at once */
static void elements_return_when_nothing_is_inverted(void)
{
    for (int i = 0; i < CELL_BODIES; i++)
        for (int reset = 0; reset < 2; reset++) {
            cell_body b, same;
            double rotation[9];
            recovery(&b, i, 3);
            CHECK(enter(&b));
            cell_rotation(1.2, rotation);
            cell_map(&b, rotation, 0.3);
            if (reset)
                cell_effect->reset(b.row, &b.body);
            else
                CHECK(look(&b));
            CHECK_INT(recovering(&b), 0);
            cell_nth(&same, i);
            cell_map(&same, rotation, 0.3);
            cell_shake(&b, 0.05, 6), cell_shake(&same, 0.05, 6);
            const double *f = cell_force(&b), *g = cell_force(&same);
            double max = 0;
            for (int k = 0; k < 3 * b.body.n_node; k++) max = fmax(max, fabs(f[k] - g[k]));
            /* the rotations' iterations began elsewhere */
            CHECK_LE(max, 1e-9 * cell_largest(g, 3 * b.body.n_node));
            cell_free(&b), cell_free(&same);
        }
}

/* down the slope of their energy, regions have no rest but the shape at rest, turned: mirrored, flat, on one point */
static void regions_have_no_other_rest(void)
{
    static const double map[][9] = {{-1, 0, 0, 0, 1, 0, 0, 0, 1}, {1, 0, 0, 0, 1, 0, 0, 0, 0}, {0}};
    for (int i = 0; i < CELL_BODIES; i++)
        for (int k = 0; k < 3; k++) {
            cell_body b;
            cell_nth(&b, i);
            const int n = b.body.n_node;
            cell_map(&b, map[k], 0);
            CHECK(look(&b));
            CHECK_INT(recovering(&b), b.row->n_cell);
            CHECK_INT(b.row->recovery->n_region, 1);
            /* at G X with the G of the region there is no force */
            const pal_recovery_region *region = &b.row->recovery->of[0];
            CHECK_NEAR(fabs(region->rotation[0] * (region->rotation[4] * region->rotation[8] -
                                                   region->rotation[5] * region->rotation[7]) -
                            region->rotation[1] * (region->rotation[3] * region->rotation[8] -
                                                   region->rotation[5] * region->rotation[6]) +
                            region->rotation[2] * (region->rotation[3] * region->rotation[7] -
                                                   region->rotation[4] * region->rotation[6])),
                       1, 1e-9);
            const double *f = cell_force(&b), first = cell_energy(&b);
            CHECK(k < 2 || first > 0);
            if (i != 1 && k == 0) CHECK(cell_largest(f, 3 * n) > 0);
            /* half way to it there is a quarter of the energy: one bowl, with its bottom there */
            for (int m = 0; m < n; m++)
                for (int c = 0; c < 3; c++)
                    b.body.d[3 * m + c] =
                        0.5 * (b.body.d[3 * m + c] + pal_dot3(region->rotation + 3 * c, b.body.node_rest + 3 * m));
            CHECK_NEAR(cell_energy(&b) / first, 0.25, 1e-9);
            cell_free(&b);
        }
}

/* half blocks of nothing but regions are not run: of numbers that are none there is nothing in the forces */
static void elements_in_regions_cost_nothing(void)
{
    for (int i = 0; i < CELL_BODIES; i++) {
        cell_body b;
        cell_nth(&b, i);
        const size_t n = 3 * (size_t)b.body.n_node;
        cell_map(&b, (double[9]){-1, 0, 0, 0, 1, 0, 0, 0, 0}, 0);
        CHECK(look(&b));
        CHECK_INT(recovering(&b), b.row->n_cell);
        double *f = malloc(sizeof *f * n), *p = calloc(2 * n, sizeof *p), *kp = p + n;
        for (size_t k = 0; k < n; k++) p[k] = pal_random_unit(7, k) - 0.5;
        memcpy(f, cell_force(&b), sizeof *f * n);
        const double energy_J = cell_energy(&b);
        cell_effect->tangent->linearise(b.row, &b.body);
        for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
            const pal_cell_group *g = &b.row->group[kind];
            const size_t n_lane = (size_t)g->n_block * PAL_LANES;
            for (size_t k = 0; k < n_lane * (size_t)g->n_node * 3; k++) g->rest[k] = NAN;
            for (size_t k = 0; k < n_lane * 9; k++) g->rotation[k] = NAN;
        }
        CHECK(!memcmp(f, cell_force(&b), sizeof *f * n));
        CHECK(cell_energy(&b) == energy_J);
        cell_effect->tangent->multiply(b.row, &b.body, 1, p, kp);
        CHECK(isfinite(cell_dot(kp, kp, (int)n)) && cell_dot(p, kp, (int)n) > 0);
        free(f), free(p);
        cell_free(&b);
    }
}

static void supports_give_the_rotation_of_a_large_region(void)
{
    cell_body b;
    double rotation[9];
    cell_nth(&b, 1);
    pal_body *body = &b.body;
    body->length_scale_m = 5;
    cell_rotation(2, rotation);
    for (int i = 0; i < body->n_dof; i++) {
        pal_copy3(body->x_rest + 3 * i, b.cells.x + 3 * i);
        for (int c = 0; c < 3; c++) body->x[3 * i + c] = pal_dot3(rotation + 3 * c, b.cells.x + 3 * i);
        body->support[i] = b.cells.x[3 * i] < 0.5;
    }
    cell_map(&b, (double[9]){0}, 0);
    CHECK(look(&b));
    CHECK_INT(b.row->recovery->n_region, 1);
    CHECK(b.row->recovery->of[0].fixed);
    for (int i = 0; i < 9; i++) CHECK_NEAR(b.row->recovery->of[0].rotation[i], rotation[i], 1e-9);
    cell_free(&b);
}

/* one element at the supports and one away from them: two regions, of which one takes the supports' rotation */
static void supports_give_the_rotation_of_a_region_that_reaches_them(void)
{
    cell_body b;
    double rotation[9];
    int end[2] = {0, 0}, n_fixed = 0;
    cell_nth(&b, 1);
    pal_body *body = &b.body;
    body->length_scale_m = 5;
    cell_rotation(2, rotation);
    for (int i = 0; i < body->n_dof; i++) {
        const double *x = b.cells.x + 3 * i;
        pal_copy3(body->x_rest + 3 * i, x);
        for (int c = 0; c < 3; c++) body->x[3 * i + c] = pal_dot3(rotation + 3 * c, x);
        body->support[i] = x[0] < -1;
    }
    for (int i = 0; i < body->n_node; i++)
        for (int k = 0; k < 2; k++) {
            const double *x = body->node_rest + 3 * i, *of = body->node_rest + 3 * end[k];
            if ((k ? 1 : -1) * (x[0] + x[1] + x[2] - of[0] - of[1] - of[2]) > 0) end[k] = i;
        }
    for (int k = 0; k < 2; k++)
        for (int c = 0; c < 3; c++) body->d[3 * end[k] + c] += k ? -2.5 : 2.5;
    CHECK(look(&b));
    CHECK_INT(b.row->recovery->n_region, 2);
    for (int p = 0; p < 2; p++) {
        const pal_recovery_region *region = &b.row->recovery->of[p];
        n_fixed += region->fixed;
        for (int i = 0; i < 9 && region->fixed; i++) CHECK_NEAR(region->rotation[i], rotation[i], 1e-9);
    }
    CHECK_INT(n_fixed, 1);
    cell_free(&b);
}

/* k of the edges gives phi = E V/2 |F - G|^2 for a uniform F: cells that are parallelepipeds, a stretch along an edge
 */
static void a_region_bears_a_pull_as_its_elements_do(void)
{
    cell_body b;
    cell_must(&b, solid_block(3, 3, 3), 0);
    cell_map(&b, (double[9]){-1, 0, 0, 0, 1, 0, 0, 0, 1}, 0);
    CHECK(look(&b));
    CHECK_INT(recovering(&b), 27);
    pal_recovery_region *region = &b.row->recovery->of[0];
    const double G[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, stretch = 0.25;
    memcpy(region->rotation, G, sizeof G);
    region->fixed = true, region->scale = 1;
    cell_map(&b, (double[9]){1 + stretch, 0, 0, 0, 1, 0, 0, 0, 1}, 0);
    const double volume_m3 = pal_subdivision_solid_volume_m3(b.solid);
    CHECK_NEAR(cell_energy(&b) / (0.5 * b.def->material.young_Pa * volume_m3 * stretch * stretch), 1, 1e-6);
    cell_free(&b);
}

/* forces of operator edges have no energy, so a body with a region is nothing but regions, and they end only when their
 * elements store next to nothing; those of operator polar end sooner, and take in what is inverted alone */
static void operator_edges_recovers_as_a_whole(void)
{
    int n_turn[2] = {0, 0};
    for (int edged = 0; edged < 2; edged++) {
        cell_body b;
        cell_begin(&b, solid_block(3, 3, 3));
        REQUIRE(!edged || !pal_entry_put_text(&b.item, "operator", "edges", &b.diag));
        REQUIRE(!cell_make(&b, 0));
        double *corner = b.body.d + 3 * (b.body.n_node - 1);
        for (int c = 0; c < 3; c++) corner[c] -= 2.5;
        CHECK(look(&b));
        CHECK_INT(recovering(&b), edged ? 27 : 1);
        /* 1/2 M strain^2 below 0.02 E, and below 3e-3 E where they enter together; M / E = 1.35 at nu = 0.3 */
        for (int percent = 16; percent > 0; percent--) {
            const double strain = 0.01 * percent;
            cell_map(&b, (double[9]){1 + strain, 0, 0, 0, 1, 0, 0, 0, 1}, 0);
            b.row->recovery->tank_J = 1e9;
            (void)look(&b);
            n_turn[edged] += recovering(&b) > 0;
        }
        CHECK_INT(recovering(&b), 0);
        cell_free(&b);
    }
    CHECK_INT(n_turn[0], 0);
    CHECK_INT(n_turn[1], 10);
}

int main(void)
{
    RUN(elements_without_inversion_stay_elements);
    RUN(a_region_begins_with_no_more_energy_than_its_elements);
    RUN(forces_of_regions_are_a_gradient_and_sum_to_zero);
    RUN(the_tangent_of_regions_is_symmetric_and_semi_definite);
    RUN(elements_return_when_nothing_is_inverted);
    RUN(regions_have_no_other_rest);
    RUN(elements_in_regions_cost_nothing);
    RUN(supports_give_the_rotation_of_a_large_region);
    RUN(supports_give_the_rotation_of_a_region_that_reaches_them);
    RUN(a_region_bears_a_pull_as_its_elements_do);
    RUN(operator_edges_recovers_as_a_whole);
    return check_report();
}
