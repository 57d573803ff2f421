/* Recovery of springs from inversion: regions push by the gradient of their energy, take no momentum, let go what is
 * whole, leave alone what a tool presses, and are not there for a body that is never inverted. */
#include "server/sim/springs/spring_recovery.h"

#include "server/base/vec3.h"
#include "server/sim/transfer/transfer_world.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/boxes.h"
#include "tests/fixtures/random.h"

static uint64_t seed;
static pal_diagnostic diag;

static bool open_box(box_bench *b, const int n[3], bool fixed, bool recover, double drag_1_s)
{
    seed = 3;
    if (!box_bench_make(b, n, 0.01, fixed, false)) return false;
    b->scene->body[0].material.damping_1_s = drag_1_s;
    pal_entry_put_number(&b->scene->body[0].model, "k_area_J", 0, NULL);
    if (!recover) pal_entry_put_bool(&b->scene->body[0].model, "recover", false, NULL);
    return box_bench_start(b);
}

static bool bench_open(box_bench *b, bool fixed, bool recover, double drag_1_s)
{
    return open_box(b, (const int[3]){4, 3, 3}, fixed, recover, drag_1_s);
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

static const pal_spring_set *edges_of(const box_bench *b)
{
    for (int i = 0; i < pal_world_component_count(b->world); i++) {
        const pal_component *row = pal_world_component(b->world, i);
        pal_spring_set *springs = row->effect->recovery.springs ? row->effect->recovery.springs(row->self) : NULL;
        if (springs && springs->spring.kind == PAL_SPRING_DISTANCE) return springs;
    }
    return NULL;
}

/* forces of regions at the nodes as they are */
static void forces(box_bench *b)
{
    memset(b->body->f, 0, 3 * sizeof(double) * (size_t)b->body->n_node);
    pal_spring_recovery_force(b->body->recovery, edges_of(b), b->body);
}

static void forces_of_regions_are_the_gradient_of_their_energy(void)
{
    box_bench b;
    REQUIRE(bench_open(&b, false, true, 0));
    fold(&b, 0.02);
    pal_spring_recovery *t = b.body->recovery;
    CHECK_INT(t->n_region, 1);
    CHECK(t->of[0].n >= 32 && t->of[0].scale > 0 && t->of[0].scale <= 1);
    forces(&b);
    double worst = 0, max = 0;
    for (int i = 0; i < 3 * b.body->n_dof; i++) max = fmax(max, fabs(b.body->f[i]));
    for (int k = 0; k < 12; k++) {
        int i = (int)(random_unit(&seed) * 3 * b.body->n_dof);
        const double x = b.body->x[i], way = 1e-7;
        b.body->x[i] = x + way;
        double up = pal_spring_recovery_energy(t, edges_of(&b), b.body);
        b.body->x[i] = x - way;
        double down = pal_spring_recovery_energy(t, edges_of(&b), b.body);
        b.body->x[i] = x;
        worst = fmax(worst, fabs((up - down) / (2 * way) + b.body->f[i]));
    }
    printf("  off by %.2g of the largest force, scale %.3g\n", worst / max, t->of[0].scale);
    CHECK_LE(worst, 1e-6 * max);
    box_bench_close(&b);
}

/* with damping, whatever the velocities: the sums of forces and moments, and the power that damping takes */
static void regions_have_no_net_force_or_torque_and_only_take_energy(void)
{
    box_bench b;
    REQUIRE(bench_open(&b, false, true, 0));
    fold(&b, 0.02);
    REQUIRE(b.body->recovery->n_region > 0 && b.body->recovery->damp_s > 0);
    double force[3] = {0, 0, 0}, moment[3] = {0, 0, 0}, size = 0, arm = 0, power = 0;
    forces(&b);
    for (int i = 0; i < b.body->n_dof; i++)
        for (int c = 0; c < 3; c++) b.body->v[3 * i + c] = random_unit(&seed) - 0.5;
    for (int i = 0; i < b.body->n_dof; i++) power -= pal_dot3(b.body->f + 3 * i, b.body->v + 3 * i);
    forces(&b);
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
    box_bench_close(&b);
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

/* free, without drag, turning: from folded until it is springs again */
static void recovery_conserves_momentum_and_angular_momentum(void)
{
    box_bench b;
    REQUIRE(bench_open(&b, false, true, 0));
    fold(&b, 0.02);
    for (int i = 0; i < b.body->n_dof; i++)
        pal_set3(b.body->v + 3 * i, 0.05 - b.body->x[3 * i + 1], b.body->x[3 * i], 0.02);
    double p[2][3], l[2][3], energy[2];
    energy[0] = pal_world_energy_J(b.world);
    body_momentum(b.body, p[0]), spin(b.body, l[0]);
    int steps = 0;
    for (; steps < 240 && (b.body->recovery->n_region > 0 || steps < 60); steps++)
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    body_momentum(b.body, p[1]), spin(b.body, l[1]);
    energy[1] = pal_world_energy_J(b.world);
    printf("  %d steps, momentum off by %.2g, angular by %.2g, energy %.3g of the first, %llu changes\n", steps,
           pal_dist3(p[1], p[0]) / pal_norm3(p[0]), pal_dist3(l[1], l[0]) / pal_norm3(l[0]), energy[1] / energy[0],
           (unsigned long long)b.body->safeguards.n_split);
    CHECK(b.body->recovery->n_region == 0 && b.body->safeguards.n_split > 1);
    CHECK_LE(pal_dist3(p[1], p[0]), 1e-12 * pal_norm3(p[0]));
    CHECK_LE(pal_dist3(l[1], l[0]), 1e-10 * pal_norm3(l[0]));
    CHECK_LE(energy[1], 1.01 * energy[0]);
    box_bench_close(&b);
}

/* every constant is what it was, to the bit, also where the material was edited meanwhile */
static void springs_are_unchanged_after_recovery(void)
{
    box_bench b;
    REQUIRE(bench_open(&b, true, true, 8));
    const pal_spring_set *edges = edges_of(&b);
    const size_t n_byte = sizeof(double) * (size_t)edges->simd_blocks.n_lane;
    fold(&b, 0.015);
    CHECK(edges->n_off > 0 && memcmp(edges->q, edges->all, n_byte) != 0);
    pal_material to = b.scene->body[0].material;
    to.young_Pa *= 1.5;
    REQUIRE(!pal_world_material(b.world, 0, &to, &diag));
    CHECK(edges->n_off > 0 && b.body->recovery->n_region > 0);
    for (int i = 0; i < 240; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    CHECK_INT(b.body->recovery->n_region, 0);
    CHECK(edges->n_off == 0 && !memcmp(edges->q, edges->all, n_byte));
    double sum = 0;
    for (int i = 0; i < b.body->n_dof; i++) sum += pow(pal_dist3(b.body->x + 3 * i, b.body->x_rest + 3 * i), 2);
    CHECK_LE(sqrt(sum / b.body->n_dof), 1e-3 * b.body->length_scale_m);
    /* and a reset while it is folded leaves nothing of it */
    fold(&b, 0.015);
    CHECK(edges->n_off > 0);
    REQUIRE(!pal_world_reset_body(b.world, 0));
    CHECK(edges->n_off == 0 && !memcmp(edges->q, edges->all, n_byte) && b.body->safeguards.n_inversion == 0);
    box_bench_close(&b);
}

/* what is not asked for is not there */
static void bodies_without_recovery_have_no_memory_for_it(void)
{
    box_bench b;
    REQUIRE(bench_open(&b, true, false, 8));
    fold(&b, 0.015);
    CHECK(!b.body->recovery && !edges_of(&b)->all && !edges_of(&b)->off && edges_of(&b)->n_off == 0);
    for (int i = 0; i < 10; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    CHECK(b.body->safeguards.n_inversion == 0 && b.body->safeguards.n_split == 0);
    box_bench_close(&b);
}

/* regions would be drawn out by a weight: soft as it is the cube hangs where its springs hold it, and stays there */
static void bodies_under_gravity_form_no_regions(void)
{
    pal_prepared box;
    pal_world *world = NULL;
    REQUIRE(!box_make(3, 3, 8, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, true);
    scene->body[0].material.young_Pa = 300;
    REQUIRE(!pal_entry_put_number(&scene->body[0].effect[0], "acceleration_m_s2", -9.81, &diag));
    scene->body[0].support[0].low_m[2] = 0.075, scene->body[0].support[0].high_m[2] = 1;
    REQUIRE(!pal_world_create(scene, &diag, &world));
    pal_body *body = pal_world_body(world, 0);
    CHECK(body->recovery == NULL);
    double far[2] = {0, 0};
    for (int i = 0; i < 400; i++) {
        REQUIRE(!pal_world_step(world, 1.0 / 60));
        if (i == 199 || i == 399)
            for (int k = 0; k < body->n_dof; k++)
                far[i > 199] = fmax(far[i > 199], pal_dist3(body->x + 3 * k, body->x_rest + 3 * k));
    }
    printf("  hangs %.3g, then %.3g m low\n", far[0], far[1]);
    CHECK(far[0] > 0.02 && !body->frozen);
    CHECK_NEAR(far[1] / far[0], 1, 0.05);
    pal_world_destroy(world);
    REQUIRE(!pal_entry_put_bool(&scene->body[0].model, "recover", true, &diag));
    CHECK_INT(pal_world_create(scene, &diag, &world), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "recover: goes with solver verlet or rk4 and without gravity only") != NULL);
    free(scene);
    box_free(&box);
}

/* a support that is put through its element: what hangs on it stays inverted, and its region takes in a ring of
 * nodes every half second, whatever the length of a step */
static bool open_bent(box_bench *b)
{
    if (!open_box(b, (const int[3]){8, 2, 2}, true, true, 8)) return false;
    double *x = b->body->x + 3 * box_node((const int[3]){8, 2, 2}, 0, 0, 0);
    for (int c = 0; c < 3; c++) x[c] += 0.012;
    pal_world_invalidate_limits(b->world, 0);
    return true;
}

/* the same body in another world: regions, energy and the way back are those of the first, to the bit */
static void a_transferred_world_continues_recovery(void)
{
    for (int stays = 0; stays < 2; stays++) {
        box_bench b;
        REQUIRE(stays ? open_bent(&b) : bench_open(&b, true, true, 8));
        if (!stays) fold(&b, 0.015);
        for (int i = 0; i < (stays ? 20 : 1); i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        REQUIRE(b.body->recovery->n_region > 0);
        pal_world *next;
        REQUIRE(!pal_world_create(b.scene, &diag, &next));
        pal_world_transfer(next, b.world, -1, NULL, NULL);
        const pal_body *body = pal_world_body(next, 0);
        CHECK_INT(body->recovery->n_region, b.body->recovery->n_region);
        CHECK_NEAR(pal_world_energy_J(next) / pal_world_energy_J(b.world), 1, 1e-12);
        CHECK_NEAR(body->recovery->first_J, b.body->recovery->first_J, 0);
        int n_inversion = 0, n_same = 0;
        for (int i = 0; i < 60; i++) {
            REQUIRE(!pal_world_step(b.world, 1.0 / 60) && !pal_world_step(next, 1.0 / 60));
            n_inversion += b.body->recovery->n_region > 0;
            n_same += pal_world_hash(next) == pal_world_hash(b.world);
        }
        printf("  %d steps with regions after it, the same bits after %d of 60, %d nodes of %d\n", n_inversion, n_same,
               stays ? body->recovery->of[0].n : 0, stays ? b.body->recovery->of[0].n : 0);
        CHECK(stays ? n_inversion == 60 : n_inversion > 0 && n_inversion < 60);
        CHECK_INT(n_same, 60);
        pal_world_destroy(next);
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
            if (4 * i == (2 * seen + 1) * per_s[k]) n[k][seen++] = b.body->recovery->of[0].n;
            REQUIRE(!pal_world_step(b.world, 1.0 / per_s[k]));
        }
        CHECK_INT(b.body->recovery->n_region, 1);
        printf("  %d steps a second: %d, %d, %d, %d nodes\n", per_s[k], n[k][0], n[k][1], n[k][2], n[k][3]);
        for (int i = 0; i < 4; i++) CHECK_INT(n[k][i], n[0][i]);
        for (int i = 1; i < 4; i++) CHECK(n[k][i] > n[k][i - 1]);
        box_bench_close(&b);
    }
}

/* what happens at the other end leaves a region its times: it grows when it would have grown */
static void a_region_keeps_its_clocks_while_another_changes(void)
{
    const int n[3] = {8, 2, 2};
    box_bench b;
    REQUIRE(open_bent(&b));
    for (int i = 0; i < 12; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    const pal_spring_recovery *t = b.body->recovery;
    REQUIRE(t->n_region == 1);
    const int n_node = t->of[0].n;
    const uint64_t n_split = b.body->safeguards.n_split;
    for (int turn = 0; turn < 5; turn++) {
        double *x = b.body->x + 3 * box_node(n, 8, 2 * (turn % 2), 2);
        x[0] -= 0.015, x[2] -= 0.015;
        pal_world_invalidate_limits(b.world, 0);
        CHECK_INT(t->n_region, 2);
        CHECK_NEAR(t->of[0].grow_s, (12 + 3 * turn) / 60.0, 1e-9);
        CHECK_INT(t->of[0].n, n_node);
        CHECK_LE(t->of[1].loose_s, 0);
        for (int i = 0; i < 3; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    }
    CHECK(b.body->safeguards.n_split > n_split);
    for (int i = 0; i < 6; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    CHECK(t->of[0].n > n_node);
    box_bench_close(&b);
}

/* A support turns one end over and then draws it out, which springs would not be calm about: its region is let go when
 * it has stood still for 2 s, also where the other end is inverted again and again and never stands still */
static void a_region_is_released_while_another_stays(void)
{
    const int n[3] = {8, 2, 2}, first = box_node(n, 0, 0, 0), other = box_node(n, 8, 2, 2);
    for (int turns = 0; turns < 2; turns++) {
        box_bench b;
        seed = 3;
        REQUIRE(box_bench_make(&b, n, 0.01, true, false));
        b.scene->body[0].material.poisson = 0.26, b.scene->body[0].material.damping_1_s = 20;
        pal_entry_put_number(&b.scene->body[0].model, "k_area_J", 0, NULL);
        REQUIRE(box_bench_start(&b));
        const pal_spring_recovery *t = b.body->recovery;
        for (int c = 0; c < 3; c++) b.body->x[3 * first + c] += 0.05;
        pal_world_invalidate_limits(b.world, 0);
        REQUIRE(t->n_region == 1 && t->region[first] == 0);
        pal_copy3(b.body->x + 3 * first, (const double[3]){-0.022, 0, 0});
        int n_in = 0, n_other = 0;
        for (int i = 0; i < 360; i++) {
            if (turns && i % 6 == 0) {
                pal_copy3(b.body->x + 3 * other, b.body->x_rest + 3 * other);
                b.body->x[3 * other] -= 0.016, b.body->x[3 * other + 2] -= 0.016;
            }
            pal_world_invalidate_limits(b.world, 0);
            REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            n_in += t->region[first] >= 0;
            n_other += t->region[other] >= 0;
        }
        printf("  let go after %d steps of 360, the other end in a region after %d\n", n_in, n_other);
        CHECK(n_in >= 118 && n_in < 150 && (n_other > 60) == turns);
        box_bench_close(&b);
    }
}

/* rows that are switched off while there are regions leave none behind, and come back as they were */
static void removed_components_leave_no_regions(void)
{
    static const char *const row[] = {"edge_distance", "tet_volume"};
    for (int k = 0; k < 2; k++) {
        box_bench b;
        REQUIRE(bench_open(&b, true, true, 8));
        fold(&b, 0.015);
        REQUIRE(b.body->recovery->n_region > 0);
        REQUIRE(!pal_world_switch_component(b.world, b.scene, 0, row[k], false, &diag));
        CHECK_INT(b.body->recovery->n_region, 0);
        for (int i = 0; i < pal_world_component_count(b.world); i++) {
            const pal_component *r = pal_world_component(b.world, i);
            const pal_spring_set *springs = r->effect->recovery.springs ? r->effect->recovery.springs(r->self) : NULL;
            if (springs) CHECK_INT(springs->n_off, 0);
        }
        REQUIRE(!pal_world_switch_component(b.world, b.scene, 0, row[k], true, &diag));
        CHECK(b.body->recovery->n_region > 0 && edges_of(&b)->n_off > 0);
        box_bench_close(&b);
    }
}

/* solver rk4 asks its rows as verlet does */
static void rk4_recovers_too(void)
{
    box_bench b;
    REQUIRE(box_bench_make(&b, (const int[3]){4, 3, 3}, 0.01, true, false));
    b.scene->body[0].material.damping_1_s = 8;
    pal_entry_init(&b.scene->body[0].solver, "solver", "rk4");
    REQUIRE(box_bench_start(&b));
    seed = 3;
    fold(&b, 0.015);
    REQUIRE(b.body->recovery && b.body->recovery->n_region > 0);
    const double first_J = pal_world_energy_J(b.world);
    double max_J = 0;
    for (int i = 0; i < 240; i++) {
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        max_J = fmax(max_J, pal_world_energy_J(b.world));
    }
    double sum = 0;
    for (int i = 0; i < b.body->n_dof; i++) sum += pow(pal_dist3(b.body->x + 3 * i, b.body->x_rest + 3 * i), 2);
    printf("  rk4: energy %.3g of the first at most, %.2g of its size off rest\n", max_J / first_J,
           sqrt(sum / b.body->n_dof) / b.body->length_scale_m);
    CHECK_INT(b.body->recovery->n_region, 0);
    CHECK_LE(max_J, 1.01 * first_J);
    CHECK_LE(sqrt(sum / b.body->n_dof), 1e-3 * b.body->length_scale_m);
    box_bench_close(&b);
}

/* a load on a node leaves it and what hangs on it to the springs, as long as it is there */
static void loaded_springs_form_no_region_until_released(void)
{
    box_bench b;
    REQUIRE(bench_open(&b, true, true, 8));
    const int node = b.body->n_dof - 1;
    REQUIRE(!pal_world_load(b.world, 0, node, (const double[3]){0, 0, 1e-4}));
    REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    fold(&b, 0.035);
    CHECK(b.body->recovery->n_region == 0 && b.body->safeguards.n_inversion == 0);
    REQUIRE(!pal_world_load(b.world, 0, node, (const double[3]){0, 0, 0}));
    for (int i = 0; i < 2; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    CHECK(b.body->safeguards.n_inversion > 0);
    box_bench_close(&b);
}

/* shaken at strains of 0.2, never inverted: the same bits, and what it costs in memory */
static void a_body_without_inversion_moves_to_the_same_bits(void)
{
    uint64_t hash[2];
    size_t n_byte[2];
    int n_spring = 0, n_edge = 0;
    for (int recover = 0; recover < 2; recover++) {
        box_bench b;
        REQUIRE(bench_open(&b, true, recover, 1));
        for (int i = 0; i < b.body->n_dof; i++) b.body->x[3 * i + 2] *= 1.2;
        pal_world_invalidate_limits(b.world, 0);
        for (int i = 0; i < 60; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        hash[recover] = pal_world_hash(b.world);
        CHECK(b.body->safeguards.n_inversion == 0 && b.body->safeguards.n_split == 0);
        n_byte[recover] = pal_world_bytes(b.world);
        n_edge = edges_of(&b)->n_item, n_spring = n_edge + b.body->tets->n_tet;
        box_bench_close(&b);
    }
    CHECK(hash[0] == hash[1]);
    printf("  %zu bytes more for %d springs\n", n_byte[1] - n_byte[0], n_spring);
    CHECK_LE(n_byte[1] - n_byte[0],
             24 * (size_t)n_spring + sizeof(pal_region_edge) * (size_t)n_edge + sizeof(pal_spring_recovery) + 4096);
}

int main(void)
{
    RUN(forces_of_regions_are_the_gradient_of_their_energy);
    RUN(regions_have_no_net_force_or_torque_and_only_take_energy);
    RUN(recovery_conserves_momentum_and_angular_momentum);
    RUN(springs_are_unchanged_after_recovery);
    RUN(bodies_without_recovery_have_no_memory_for_it);
    RUN(bodies_under_gravity_form_no_regions);
    RUN(a_transferred_world_continues_recovery);
    RUN(regions_grow_by_seconds_not_by_steps);
    RUN(a_region_keeps_its_clocks_while_another_changes);
    RUN(a_region_is_released_while_another_stays);
    RUN(removed_components_leave_no_regions);
    RUN(rk4_recovers_too);
    RUN(loaded_springs_form_no_region_until_released);
    RUN(a_body_without_inversion_moves_to_the_same_bits);
    return check_report();
}
