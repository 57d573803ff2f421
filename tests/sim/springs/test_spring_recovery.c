/* Recovery of springs from inversion (spring_lattice.h): tetrahedra take their parts of springs into regions and give
 * them back, forces are the gradient of the energy, without net force or torque, and a body that is never inverted or
 * has no recovery does not notice. Clocks, tank and growth: tests/sim/recovery. */
#include "server/sim/springs/spring_lattice.h"

#include "server/base/vec3.h"
#include "server/sim/transfer/transfer_world.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/boxes.h"
#include "tests/fixtures/random.h"

static uint64_t seed;
static pal_diagnostic diag;

static bool open_box(box_bench *b, const int n[3], bool fixed, bool recover, double drag_1_s, bool area)
{
    seed = 3;
    if (!box_bench_make(b, n, 0.01, fixed, false)) return false;
    b->scene->body[0].material.damping_1_s = drag_1_s;
    if (!area) pal_entry_put_number(&b->scene->body[0].model, "k_area_J", 0, NULL);
    if (!recover) pal_entry_put_bool(&b->scene->body[0].model, "recover", false, NULL);
    return box_bench_start(b);
}

static bool bench_open(box_bench *b, bool fixed, bool recover, double drag_1_s)
{
    return open_box(b, (const int[3]){4, 3, 3}, fixed, recover, drag_1_s, false);
}

/* part of the body, x > from, mirrored and stirred */
static void fold(box_bench *b, double from_m)
{
    for (int i = 0; i < b->body->n_dof; i++) {
        double *x = b->body->x + 3 * i;
        if (b->body->support[i] || b->body->x_rest[3 * i] < from_m) continue;
        x[0] = 2 * from_m - x[0];
        for (int c = 0; c < 3; c++) x[c] += 0.002 * (random_unit(&seed) - 0.5);
    }
    pal_world_invalidate_limits(b->world, 0);
}

static pal_recovery *recovery_of(const box_bench *b)
{
    return b->body->model.springs->recovery;
}

static const pal_spring_set *set_of(const box_bench *b, pal_spring_kind kind)
{
    return b->body->model.springs->of[kind];
}

static int in_regions(const box_bench *b)
{
    const pal_recovery *r = recovery_of(b);
    int n = 0;
    for (int e = 0; e < r->model.n_element; e++) n += r->region[e] >= 0;
    return n;
}

/* do all springs act, to the bit? */
static bool is_whole(const box_bench *b)
{
    bool whole = true;
    for (int kind = 0; kind < 3; kind++) {
        const pal_spring_set *set = set_of(b, (pal_spring_kind)kind);
        whole &= !set || !memcmp(set->q, set->all, sizeof *set->q * (size_t)set->simd_blocks.n_lane);
    }
    return whole;
}

static double off_rest(const box_bench *b)
{
    double sum = 0;
    for (int i = 0; i < b->body->n_dof; i++) sum += pow(pal_dist3(b->body->x + 3 * i, b->body->x_rest + 3 * i), 2);
    return sqrt(sum / b->body->n_dof) / b->body->length_scale_m;
}

/* Springs outside, parts of springs at the border and the region together. The box is turned as a whole, so that no
 * edge is along an axis. Central differences of step e err by e^2 of the third derivative and by rounding / e */
static void forces_are_the_gradient_of_the_energy(void)
{
    for (int area = 0; area < 2; area++) {
        box_bench b;
        REQUIRE(open_box(&b, (const int[3]){4, 3, 3}, false, true, 0, area));
        fold(&b, 0.02);
        const pal_recovery *r = recovery_of(&b);
        const pal_spring_set *edges = set_of(&b, PAL_SPRING_DISTANCE);
        REQUIRE(r->n_region >= 1);
        CHECK(r->of[0].scale > 0 && r->of[0].scale <= 1 && in_regions(&b) < r->model.n_element);
        int n_part = 0;
        for (int i = 0; i < edges->n_item; i++) {
            const int lane = edges->simd_blocks.place[i];
            n_part += edges->q[lane] > 0 && edges->q[lane] < edges->all[lane];
        }
        CHECK(n_part > 0);
        REQUIRE(!pal_world_assemble_forces(b.world, 0));
        double worst = 0, max = 0;
        double *f = malloc(3 * sizeof *f * (size_t)b.body->n_dof);
        memcpy(f, b.body->f, 3 * sizeof *f * (size_t)b.body->n_dof);
        for (int i = 0; i < 3 * b.body->n_dof; i++) max = fmax(max, fabs(f[i]));
        for (int i = 0; i < 3 * b.body->n_dof; i++) {
            const double x = b.body->x[i], way = 1e-7;
            b.body->x[i] = x + way;
            double up = pal_world_energy_J(b.world);
            b.body->x[i] = x - way;
            double down = pal_world_energy_J(b.world);
            b.body->x[i] = x;
            worst = fmax(worst, fabs((up - down) / (2 * way) + f[i]));
        }
        printf("  off by %.2g of the largest force, scale %.3g, %d edges in part\n", worst / max, r->of[0].scale,
               n_part);
        CHECK_LE(worst, 1e-6 * max);
        free(f);
        box_bench_close(&b);
    }
}

/* with damping, whatever the velocities: the sums of forces and moments, and the power that damping takes */
static void regions_have_no_net_force_or_torque_and_only_take_energy(void)
{
    box_bench b;
    REQUIRE(bench_open(&b, false, true, 0));
    fold(&b, 0.02);
    REQUIRE(recovery_of(&b)->n_region > 0);
    double force[3] = {0, 0, 0}, moment[3] = {0, 0, 0}, size = 0, arm = 0, power = 0;
    REQUIRE(!pal_world_assemble_forces(b.world, 0));
    for (int i = 0; i < 3 * b.body->n_dof; i++) b.body->v[i] = random_signed(&seed);
    for (int i = 0; i < b.body->n_dof; i++) power -= pal_dot3(b.body->f + 3 * i, b.body->v + 3 * i);
    REQUIRE(!pal_world_assemble_forces(b.world, 0));
    for (int i = 0; i < b.body->n_dof; i++) {
        const double *f = b.body->f + 3 * i, *x = b.body->x + 3 * i;
        double about[3];
        pal_cross3(about, x, f);
        pal_add3(force, force, f), pal_add3(moment, moment, about);
        size += pal_norm3(f), arm += pal_norm3(x) * pal_norm3(f);
        power += pal_dot3(f, b.body->v + 3 * i);
    }
    printf("  net force %.2g, moment %.2g of their sums, damping %.3g W\n", pal_norm3(force) / size,
           pal_norm3(moment) / arm, power);
    CHECK_LE(pal_norm3(force), 1e-13 * size);
    CHECK_LE(pal_norm3(moment), 1e-13 * arm);
    CHECK(power < 0);
    /* a body that turns as a whole is not damped */
    memset(b.body->v, 0, 3 * sizeof(double) * (size_t)b.body->n_dof);
    REQUIRE(!pal_world_assemble_forces(b.world, 0));
    double *f = malloc(3 * sizeof *f * (size_t)b.body->n_dof), worst = 0;
    memcpy(f, b.body->f, 3 * sizeof *f * (size_t)b.body->n_dof);
    for (int i = 0; i < b.body->n_dof; i++)
        pal_cross3(b.body->v + 3 * i, (const double[3]){3, -1, 2}, b.body->x + 3 * i);
    REQUIRE(!pal_world_assemble_forces(b.world, 0));
    for (int i = 0; i < b.body->n_dof; i++) worst = fmax(worst, pal_dist3(f + 3 * i, b.body->f + 3 * i));
    CHECK_LE(worst, 1e-12 * size);
    free(f);
    box_bench_close(&b);
}

/* what the edges of elements in regions have lost in k q = k_ij l0^2 is what regions have, and regions ask for no
 * shorter step than the springs; of a part of the body and of all of it */
static void regions_have_the_constants_of_their_edges(void)
{
    for (int whole = 0; whole < 2; whole++) {
        box_bench b, other;
        REQUIRE(bench_open(&b, false, true, 0));
        fold(&b, whole ? -1 : 0.02);
        pal_recovery *r = recovery_of(&b);
        const pal_spring_set *edges = set_of(&b, PAL_SPRING_DISTANCE);
        REQUIRE(r->n_region > 0 && (in_regions(&b) == r->model.n_element) == whole);
        double lost = 0, has = 0;
        for (int i = 0; i < edges->n_item; i++) {
            const int lane = edges->simd_blocks.place[i];
            lost += edges->spring.k_J * (edges->all[lane] - edges->q[lane]);
        }
        for (int n = 0; n < r->n_active; n++) {
            const int32_t *end = r->end + 2 * (size_t)r->active[n];
            const double length_m = pal_dist3(b.body->x_rest + 3 * end[0], b.body->x_rest + 3 * end[1]);
            has += r->k_N_m[r->active[n]] * length_m * length_m;
        }
        CHECK_NEAR(has / lost, 1, 1e-12);
        REQUIRE(bench_open(&other, false, false, 0));
        fold(&other, whole ? -1 : 0.02);
        const double limit[2] = {pal_world_limit_s(b.world), pal_world_limit_s(other.world)};
        printf("  %d of %d tetrahedra in regions: sub-step %.3g, of springs %.3g s\n", in_regions(&b),
               r->model.n_element, limit[0], limit[1]);
        CHECK_LE(limit[1], limit[0] * (1 + 1e-9));
        box_bench_close(&b), box_bench_close(&other);
    }
}

static void spin(const pal_body *body, double out[3])
{
    pal_set3(out, 0, 0, 0);
    for (int i = 0; i < body->n_dof; i++) {
        double about[3];
        pal_cross3(about, body->x + 3 * i, body->v + 3 * i);
        pal_axpy3(out, body->mass_kg[i], about);
    }
}

/* free, turning: from folded until it is springs again. Without drag, so that the tank has only what regions give */
static void recovery_conserves_momentum_and_angular_momentum(void)
{
    box_bench b;
    REQUIRE(bench_open(&b, false, true, 0));
    fold(&b, 0.02);
    for (int i = 0; i < b.body->n_dof; i++)
        pal_set3(b.body->v + 3 * i, 0.05 - b.body->x[3 * i + 1], b.body->x[3 * i], 0.02);
    double p[2][3], l[2][3], max_J = 0;
    const double first_J = pal_world_energy_J(b.world);
    body_momentum(b.body, p[0]), spin(b.body, l[0]);
    int steps = 0, n_region = 0;
    for (; steps < 240; steps++) {
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        n_region += recovery_of(&b)->n_region > 0;
        max_J = fmax(max_J, pal_world_energy_J(b.world));
    }
    body_momentum(b.body, p[1]), spin(b.body, l[1]);
    printf("  regions in %d steps of %d, momentum off by %.2g, angular by %.2g, energy %.3g of the first at most\n",
           n_region, steps, pal_dist3(p[1], p[0]) / pal_norm3(p[0]), pal_dist3(l[1], l[0]) / pal_norm3(l[0]),
           max_J / first_J);
    CHECK(n_region > 0 && b.body->safeguards.n_change > 0);
    CHECK_LE(pal_dist3(p[1], p[0]), 1e-12 * pal_norm3(p[0]));
    CHECK_LE(pal_dist3(l[1], l[0]), 1e-10 * pal_norm3(l[0]));
    CHECK_LE(max_J, 1.01 * first_J);
    box_bench_close(&b);
}

/* every constant is what it was, to the bit, also where the material was edited meanwhile */
static void springs_are_unchanged_after_recovery(void)
{
    box_bench b;
    REQUIRE(bench_open(&b, true, true, 8));
    fold(&b, 0.015);
    CHECK(in_regions(&b) > 0 && !is_whole(&b));
    const double k_N_m = recovery_of(&b)->k_N_m[recovery_of(&b)->active[0]];
    pal_material to = b.scene->body[0].material;
    to.young_Pa *= 1.5;
    REQUIRE(!pal_world_material(b.world, 0, &to, &diag));
    CHECK_NEAR(recovery_of(&b)->k_N_m[recovery_of(&b)->active[0]], 1.5 * k_N_m, 1e-12 * k_N_m);
    CHECK(in_regions(&b) > 0 && !is_whole(&b));
    for (int i = 0; i < 300; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    CHECK(in_regions(&b) == 0 && is_whole(&b));
    CHECK_LE(off_rest(&b), 1e-3);
    /* and a reset while it is folded leaves nothing of it */
    fold(&b, 0.015);
    CHECK(in_regions(&b) > 0);
    REQUIRE(!pal_world_reset_body(b.world, 0));
    CHECK(in_regions(&b) == 0 && is_whole(&b) && b.body->safeguards.n_inversion == 0);
    box_bench_close(&b);
}

/* what is not asked for is not there */
static void bodies_without_recovery_have_no_memory_for_it(void)
{
    box_bench b;
    REQUIRE(bench_open(&b, true, false, 8));
    fold(&b, 0.015);
    CHECK(!b.body->model.springs);
    for (int i = 0; i < pal_world_component_count(b.world); i++) {
        const pal_component *row = pal_world_component(b.world, i);
        if (strcmp(row->effect->name, "edge_distance") != 0 && strcmp(row->effect->name, "tet_volume") != 0) continue;
        const pal_spring_set *set = row->self;
        CHECK(!set->lattice && !set->all && !set->around && !set->of_tet);
    }
    for (int i = 0; i < 10; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    CHECK(b.body->safeguards.n_inversion == 0 && b.body->safeguards.n_change == 0);
    box_bench_close(&b);
    REQUIRE(box_bench_make(&b, (const int[3]){2, 2, 2}, 0.01, true, false));
    pal_entry_init(&b.scene->body[0].solver, "solver", "static_newton");
    pal_entry_put_bool(&b.scene->body[0].model, "recover", true, NULL);
    CHECK_INT(pal_world_create(b.scene, &diag, &b.world), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "recover: goes with solver verlet or rk4 only") != NULL);
    box_bench_close(&b);
}

/* Soft as it is the cube hangs where its springs hold it, and stays there; folded upward it comes down to the same
 * place */
static void bodies_under_gravity_recover(void)
{
    double low[2] = {0, 0};
    for (int folded = 0; folded < 2; folded++) {
        pal_prepared box;
        pal_world *world = NULL;
        REQUIRE(!box_make(3, 3, 8, 0.01, &box));
        pal_scene *scene = box_scene(&box, true, true);
        scene->body[0].material.young_Pa = folded ? 3000 : 300, scene->body[0].material.damping_1_s = 8;
        REQUIRE(!pal_entry_put_number(&scene->body[0].effect[0], "acceleration_m_s2", -9.81, &diag));
        scene->body[0].support[0].low_m[2] = 0.075, scene->body[0].support[0].high_m[2] = 1;
        REQUIRE(!pal_world_create(scene, &diag, &world));
        pal_body *body = pal_world_body(world, 0);
        double far[3] = {0, 0, 0}, *hung = calloc(3 * (size_t)body->n_dof, sizeof *hung), worst = 0;
        for (int i = 0; i < 1200; i++) {
            if (folded && i == 600) {
                memcpy(hung, body->x, 3 * sizeof *hung * (size_t)body->n_dof);
                for (int k = 0; k < body->n_dof; k++)
                    if (!body->support[k]) body->x[3 * k + 2] = 0.16 - body->x[3 * k + 2];
                pal_world_invalidate_limits(world, 0);
                CHECK(body->model.springs->recovery->n_region > 0);
            }
            REQUIRE(!pal_world_step(world, 1.0 / 60));
            for (int k = 0; k < body->n_dof && (i == 599 || i == 1199); k++)
                far[i > 599] = fmax(far[i > 599], pal_dist3(body->x + 3 * k, body->x_rest + 3 * k));
        }
        for (int k = 0; k < body->n_dof && folded; k++) worst = fmax(worst, pal_dist3(body->x + 3 * k, hung + 3 * k));
        printf("  hangs %.3g, then %.3g m low%s, off by %.2g S\n", far[0], far[1], folded ? " after a fold" : "",
               worst / body->length_scale_m);
        CHECK(far[0] > (folded ? 0 : 0.02) && !body->frozen && body->model.springs->recovery->n_region == 0);
        CHECK_NEAR(far[1] / far[0], 1, 0.05);
        CHECK_LE(worst, 1e-3 * body->length_scale_m);
        low[folded] = far[0];
        free(hung), pal_world_destroy(world), free(scene), box_free(&box);
    }
    CHECK_LE(low[1], low[0]);
}

/* a support that is put through its element: what hangs on it stays inverted, and its region takes in its neighbours
 * every half second, whatever the length of a step */
static bool open_bent(box_bench *b)
{
    if (!open_box(b, (const int[3]){8, 2, 2}, true, true, 8, false)) return false;
    double *x = b->body->x + 3 * box_node((const int[3]){8, 2, 2}, 0, 0, 0);
    for (int c = 0; c < 3; c++) x[c] += 0.012;
    pal_world_invalidate_limits(b->world, 0);
    return true;
}

/* the same body in another world: elements, energy and the way back are those of the first; the tank begins anew */
static void a_transferred_world_continues_recovery(void)
{
    for (int stays = 0; stays < 2; stays++) {
        box_bench b;
        REQUIRE(stays ? open_bent(&b) : bench_open(&b, true, true, 8));
        if (!stays) fold(&b, 0.015);
        for (int i = 0; i < (stays ? 20 : 1); i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        const int n = in_regions(&b);
        REQUIRE(n > 0);
        box_bench next = b;
        REQUIRE(!pal_world_create(b.scene, &diag, &next.world));
        pal_world_transfer(next.world, b.world, -1, NULL, NULL);
        next.body = pal_world_body(next.world, 0);
        CHECK_INT(in_regions(&next), n);
        CHECK_NEAR(pal_world_energy_J(next.world) / pal_world_energy_J(b.world), 1, 1e-12);
        int n_step[2] = {0, 0};
        for (int i = 0; i < 300; i++) {
            REQUIRE(!pal_world_step(b.world, 1.0 / 60) && !pal_world_step(next.world, 1.0 / 60));
            n_step[0] += in_regions(&b) > 0, n_step[1] += in_regions(&next) > 0;
        }
        printf("  steps with regions after it: %d, %d of 300\n", n_step[0], n_step[1]);
        CHECK(stays ? n_step[1] == 300 : n_step[1] > 0 && n_step[1] < 300);
        if (!stays) CHECK_LE(off_rest(&next), 1e-3);
        pal_world_destroy(next.world);
        box_bench_close(&b);
    }
}

static void regions_grow_by_seconds_not_by_steps(void)
{
    static const int per_s[] = {60, 240, 20};
    int n[3][4];
    for (int k = 0; k < 3; k++) {
        box_bench b;
        REQUIRE(open_bent(&b));
        for (int i = 0, seen = 0; seen < 4; i++) {
            /* in the middle of each half second */
            if (4 * i == (2 * seen + 1) * per_s[k]) n[k][seen++] = in_regions(&b);
            REQUIRE(!pal_world_step(b.world, 1.0 / per_s[k]));
        }
        CHECK_INT(recovery_of(&b)->n_region, 1);
        printf("  %d steps a second: %d, %d, %d, %d tetrahedra\n", per_s[k], n[k][0], n[k][1], n[k][2], n[k][3]);
        for (int i = 0; i < 4; i++) CHECK_INT(n[k][i], n[0][i]);
        for (int i = 1; i < 4; i++) CHECK(n[k][i] > n[k][i - 1]);
        box_bench_close(&b);
    }
}

/* rows that are switched off while there are regions leave none behind, and come back as they were */
static void removed_components_leave_no_regions(void)
{
    static const char *const row[] = {"edge_distance", "tet_volume", "face_area"};
    for (int k = 0; k < 3; k++) {
        box_bench b;
        REQUIRE(open_box(&b, (const int[3]){4, 3, 3}, true, true, 8, true));
        fold(&b, 0.015);
        const int n = in_regions(&b);
        REQUIRE(n > 0);
        REQUIRE(!pal_world_switch_component(b.world, b.scene, 0, row[k], false, &diag));
        /* without areas there is recovery still */
        CHECK_INT(in_regions(&b), k == 2 ? n : 0);
        if (k < 2) CHECK(is_whole(&b));
        REQUIRE(!pal_world_switch_component(b.world, b.scene, 0, row[k], true, &diag));
        CHECK(in_regions(&b) == n && !is_whole(&b));
        for (int i = 0; i < 300; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        CHECK(in_regions(&b) == 0 && is_whole(&b));
        CHECK_LE(off_rest(&b), 1e-3);
        box_bench_close(&b);
    }
}

/* solver rk4 asks its rows as verlet does */
static void a_folded_body_returns_without_gaining_energy(void)
{
    static const char *const solver[] = {"verlet", "rk4"};
    for (int k = 0; k < 2; k++) {
        box_bench b;
        REQUIRE(box_bench_make(&b, (const int[3]){4, 3, 3}, 0.01, true, false));
        b.scene->body[0].material.damping_1_s = 8;
        pal_entry_init(&b.scene->body[0].solver, "solver", solver[k]);
        REQUIRE(box_bench_start(&b));
        seed = 3;
        fold(&b, 0.015);
        REQUIRE(in_regions(&b) > 0);
        const double first_J = pal_world_energy_J(b.world);
        double max_J = 0;
        for (int i = 0; i < 300; i++) {
            REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            max_J = fmax(max_J, pal_world_energy_J(b.world));
        }
        printf("  %s: energy %.3g of the first at most, %.2g of its size off rest\n", solver[k], max_J / first_J,
               off_rest(&b));
        CHECK_INT(in_regions(&b), 0);
        CHECK_LE(max_J, 1.01 * first_J);
        CHECK_LE(off_rest(&b), 1e-3);
        box_bench_close(&b);
    }
}

/* shaken at strains of 0.2, never inverted: the same bits, and what it costs in memory */
static void a_body_without_inversion_moves_to_the_same_bits(void)
{
    uint64_t hash[2];
    size_t n_byte[2];
    int n_tet = 0, n_node = 0;
    for (int recover = 0; recover < 2; recover++) {
        box_bench b;
        REQUIRE(bench_open(&b, true, recover, 1));
        for (int i = 0; i < b.body->n_dof; i++) b.body->x[3 * i + 2] *= 1.2;
        pal_world_invalidate_limits(b.world, 0);
        for (int i = 0; i < 60; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        hash[recover] = pal_world_hash(b.world);
        CHECK(b.body->safeguards.n_inversion == 0 && b.body->safeguards.n_change == 0);
        n_byte[recover] = pal_world_bytes(b.world);
        n_tet = b.body->tets->n_tet, n_node = b.body->n_node;
        box_bench_close(&b);
    }
    CHECK(hash[0] == hash[1]);
    printf("  %zu bytes more for %d tetrahedra of %d nodes\n", n_byte[1] - n_byte[0], n_tet, n_node);
    /* of a tetrahedron: its springs here, its edges, region and ratios there; of its at most 2 edges and of one volume
     * two numbers here, and of an edge 28 bytes there; of a node positions, loads and a root */
    CHECK_LE(n_byte[1] - n_byte[0], (4 * 11 + 4 * 6 + 21 + 2 * 16 + 2 * 28 + 16) * (size_t)n_tet + 52 * (size_t)n_node +
                                        sizeof(pal_recovery) + 4096);
}

int main(void)
{
    RUN(forces_are_the_gradient_of_the_energy);
    RUN(regions_have_no_net_force_or_torque_and_only_take_energy);
    RUN(regions_have_the_constants_of_their_edges);
    RUN(recovery_conserves_momentum_and_angular_momentum);
    RUN(springs_are_unchanged_after_recovery);
    RUN(bodies_without_recovery_have_no_memory_for_it);
    RUN(bodies_under_gravity_recover);
    RUN(a_transferred_world_continues_recovery);
    RUN(regions_grow_by_seconds_not_by_steps);
    RUN(removed_components_leave_no_regions);
    RUN(a_folded_body_returns_without_gaining_energy);
    RUN(a_body_without_inversion_moves_to_the_same_bits);
    return check_report();
}
