/* Untangling of springs: patches push by the gradient of their energy, take no momentum, let go what is whole, leave
 * alone what a tool presses, and are not there for a body that is never turned over. */
#include "server/sim/spring_tangle.h"

#include "server/base/vec3.h"
#include "server/sim/world.h"
#include "tests/check.h"
#include "tests/sim/boxes.h"

typedef struct bench {
    pal_prepared box;
    pal_scene *scene;
    pal_world *world;
    pal_body *body;
} bench;

static uint64_t seed;
static pal_note note;

static bool bench_open(bench *b, bool held, bool untangle, double drag_1_s)
{
    seed = 3;
    if (box_make(4, 3, 3, 0.01, &b->box)) return false;
    b->scene = box_scene(&b->box, held, false);
    b->scene->body[0].n_effect = 0;
    b->scene->body[0].material.damping_1_s = drag_1_s;
    pal_item_put_number(&b->scene->body[0].model, "k_area_J", 0, NULL);
    if (!untangle) pal_item_put_bool(&b->scene->body[0].model, "untangle", false, NULL);
    if (pal_world_create(b->scene, &note, &b->world)) return false;
    b->body = pal_world_body(b->world, 0);
    return true;
}

static void bench_close(bench *b)
{
    pal_world_destroy(b->world);
    free(b->scene);
    box_free(&b->box);
}

/* part of the body, x > from, mirrored and stirred */
static void fold(bench *b, double from_m)
{
    for (int i = 0; i < b->body->n_dof; i++) {
        double *x = b->body->x + 3 * i;
        if (b->body->held[i] || b->body->x_rest[3 * i] < from_m) continue;
        x[0] = 2 * from_m - x[0];
        for (int c = 0; c < 3; c++) x[c] += 0.002 * (check_random01(&seed) - 0.5);
    }
    pal_world_moved(b->world, 0);
}

static const pal_spring_row *edges_of(const bench *b)
{
    for (int i = 0; i < pal_world_rows(b->world); i++) {
        const pal_row *row = pal_world_effect(b->world, i);
        pal_spring_row *springs = row->effect->springs ? row->effect->springs(row->self) : NULL;
        if (springs && springs->spring.kind == PAL_SPRING_DISTANCE) return springs;
    }
    return NULL;
}

/* forces of patches at the nodes as they are */
static void forces(bench *b)
{
    memset(b->body->f, 0, 3 * sizeof(double) * (size_t)b->body->n_node);
    pal_spring_tangle_force(b->body->tangle, edges_of(b), b->body);
}

static void patches_push_by_the_gradient_of_their_energy(void)
{
    bench b;
    REQUIRE(bench_open(&b, false, true, 0));
    fold(&b, 0.02);
    pal_spring_tangle *t = b.body->tangle;
    CHECK_INT(t->n_patch, 1);
    CHECK(t->of[0].n >= 32 && t->scale > 0 && t->scale <= 1);
    forces(&b);
    double worst = 0, most = 0;
    for (int i = 0; i < 3 * b.body->n_dof; i++) most = fmax(most, fabs(b.body->f[i]));
    for (int k = 0; k < 12; k++) {
        int i = (int)(check_random01(&seed) * 3 * b.body->n_dof);
        const double x = b.body->x[i], way = 1e-7;
        b.body->x[i] = x + way;
        double up = pal_spring_tangle_energy(t, edges_of(&b), b.body);
        b.body->x[i] = x - way;
        double down = pal_spring_tangle_energy(t, edges_of(&b), b.body);
        b.body->x[i] = x;
        worst = fmax(worst, fabs((up - down) / (2 * way) + b.body->f[i]));
    }
    printf("  off by %.2g of the largest force, scale %.3g\n", worst / most, t->scale);
    CHECK_LE(worst, 1e-6 * most);
    bench_close(&b);
}

/* with damping, whatever the velocities: the sums of forces and moments, and the power that damping takes */
static void patches_have_no_net_force_or_torque_and_only_take_energy(void)
{
    bench b;
    REQUIRE(bench_open(&b, false, true, 0));
    fold(&b, 0.02);
    REQUIRE(b.body->tangle->n_patch > 0 && b.body->tangle->damp_s > 0);
    double force[3] = {0, 0, 0}, moment[3] = {0, 0, 0}, size = 0, arm = 0, power = 0;
    forces(&b);
    for (int i = 0; i < b.body->n_dof; i++)
        for (int c = 0; c < 3; c++) b.body->v[3 * i + c] = check_random01(&seed) - 0.5;
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
    bench_close(&b);
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
static void untangling_keeps_momentum_and_angular_momentum(void)
{
    bench b;
    REQUIRE(bench_open(&b, false, true, 0));
    fold(&b, 0.02);
    for (int i = 0; i < b.body->n_dof; i++)
        pal_set3(b.body->v + 3 * i, 0.05 - b.body->x[3 * i + 1], b.body->x[3 * i], 0.02);
    double p[2][3], l[2][3], energy[2];
    energy[0] = pal_world_energy_J(b.world);
    pal_body_momentum(b.body, p[0]), spin(b.body, l[0]);
    int steps = 0;
    for (; steps < 240 && (b.body->tangle->n_patch > 0 || steps < 60); steps++)
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    pal_body_momentum(b.body, p[1]), spin(b.body, l[1]);
    energy[1] = pal_world_energy_J(b.world);
    printf("  %d steps, momentum off by %.2g, angular by %.2g, energy %.3g of the first, %llu changes\n", steps,
           pal_dist3(p[1], p[0]) / pal_norm3(p[0]), pal_dist3(l[1], l[0]) / pal_norm3(l[0]), energy[1] / energy[0],
           (unsigned long long)b.body->rescue.n_split);
    CHECK(b.body->tangle->n_patch == 0 && b.body->rescue.n_split > 1);
    CHECK_LE(pal_dist3(p[1], p[0]), 1e-12 * pal_norm3(p[0]));
    CHECK_LE(pal_dist3(l[1], l[0]), 1e-10 * pal_norm3(l[0]));
    CHECK_LE(energy[1], 1.01 * energy[0]);
    bench_close(&b);
}

/* every constant is what it was, to the bit, also where the material was edited meanwhile */
static void springs_are_what_they_were_once_it_is_back(void)
{
    bench b;
    REQUIRE(bench_open(&b, true, true, 8));
    const pal_spring_row *edges = edges_of(&b);
    const size_t n_byte = sizeof(double) * (size_t)edges->strips.n_lane;
    fold(&b, 0.015);
    CHECK(edges->n_off > 0 && memcmp(edges->q, edges->all, n_byte) != 0);
    pal_material to = b.scene->body[0].material;
    to.young_Pa *= 1.5;
    REQUIRE(!pal_world_material(b.world, 0, &to, &note));
    CHECK(edges->n_off > 0 && b.body->tangle->n_patch > 0);
    for (int i = 0; i < 240; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    CHECK_INT(b.body->tangle->n_patch, 0);
    CHECK(edges->n_off == 0 && !memcmp(edges->q, edges->all, n_byte));
    double sum = 0;
    for (int i = 0; i < b.body->n_dof; i++) sum += pow(pal_dist3(b.body->x + 3 * i, b.body->x_rest + 3 * i), 2);
    CHECK_LE(sqrt(sum / b.body->n_dof), 1e-3 * b.body->size_m);
    /* and a reset while it is folded leaves nothing of it */
    fold(&b, 0.015);
    CHECK(edges->n_off > 0);
    REQUIRE(!pal_world_reset_body(b.world, 0));
    CHECK(edges->n_off == 0 && !memcmp(edges->q, edges->all, n_byte) && b.body->rescue.n_tangled == 0);
    bench_close(&b);
}

/* what is not asked for is not there */
static void what_may_not_untangle_has_nothing_for_it(void)
{
    bench b;
    REQUIRE(bench_open(&b, true, false, 8));
    fold(&b, 0.015);
    CHECK(!b.body->tangle && !edges_of(&b)->all && !edges_of(&b)->off && edges_of(&b)->n_off == 0);
    for (int i = 0; i < 10; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    CHECK(b.body->rescue.n_tangled == 0 && b.body->rescue.n_split == 0);
    bench_close(&b);
}

/* the same body in another world: patches, energy and the way back are those of the first */
/* patches would be drawn out by a weight: soft as it is the cube hangs where its springs hold it, and stays there */
static void what_hangs_by_its_weight_is_left_to_its_springs(void)
{
    pal_prepared box;
    pal_world *world = NULL;
    REQUIRE(!box_make(3, 3, 8, 0.01, &box));
    pal_scene *scene = box_scene(&box, true, true);
    scene->body[0].material.young_Pa = 300;
    REQUIRE(!pal_item_put_number(&scene->body[0].effect[0], "acceleration_m_s2", -9.81, &note));
    scene->body[0].support[0].low_m[2] = 0.075, scene->body[0].support[0].high_m[2] = 1;
    REQUIRE(!pal_world_create(scene, &note, &world));
    pal_body *body = pal_world_body(world, 0);
    CHECK(body->tangle == NULL);
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
    REQUIRE(!pal_item_put_bool(&scene->body[0].model, "untangle", true, &note));
    CHECK_INT(pal_world_create(scene, &note, &world), PAL_ERR_REFUSED);
    CHECK(strstr(note.text, "untangle: goes with solver verlet and without gravity only") != NULL);
    free(scene);
    box_free(&box);
}

static void a_world_that_follows_goes_on_untangling(void)
{
    bench b;
    REQUIRE(bench_open(&b, true, true, 8));
    fold(&b, 0.015);
    for (int i = 0; i < 3; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    REQUIRE(b.body->tangle->n_patch > 0);
    pal_world *next;
    REQUIRE(!pal_world_create(b.scene, &note, &next));
    pal_world_follow(next, b.world, -1, NULL, NULL);
    const pal_body *body = pal_world_body(next, 0);
    CHECK_INT(body->tangle->n_patch, b.body->tangle->n_patch);
    CHECK_NEAR(pal_world_energy_J(next) / pal_world_energy_J(b.world), 1, 1e-12);
    CHECK_NEAR(body->tangle->first_J, b.body->tangle->first_J, 0);
    pal_world_destroy(next);
    bench_close(&b);
}

/* a load on a node leaves it and what hangs on it to the springs, as long as it is there */
static void what_is_pressed_is_left_alone_until_it_is_let_go(void)
{
    bench b;
    REQUIRE(bench_open(&b, true, true, 8));
    const int node = b.body->n_dof - 1;
    REQUIRE(!pal_world_load(b.world, 0, node, (const double[3]){0, 0, 1e-4}));
    REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    fold(&b, 0.035);
    CHECK(b.body->tangle->n_patch == 0 && b.body->rescue.n_tangled == 0);
    REQUIRE(!pal_world_load(b.world, 0, node, (const double[3]){0, 0, 0}));
    for (int i = 0; i < 2; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    CHECK(b.body->rescue.n_tangled > 0);
    bench_close(&b);
}

/* shaken at strains of 0.2, never turned over: the same bits, and what it costs in memory */
static void what_is_never_turned_over_moves_to_the_same_bits(void)
{
    uint64_t hash[2];
    size_t n_byte[2];
    int n_spring = 0;
    for (int untangle = 0; untangle < 2; untangle++) {
        bench b;
        REQUIRE(bench_open(&b, true, untangle, 1));
        for (int i = 0; i < b.body->n_dof; i++) b.body->x[3 * i + 2] *= 1.2;
        pal_world_moved(b.world, 0);
        for (int i = 0; i < 60; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        hash[untangle] = pal_world_hash(b.world);
        CHECK(b.body->rescue.n_tangled == 0 && b.body->rescue.n_split == 0);
        n_byte[untangle] = pal_world_bytes(b.world);
        n_spring = edges_of(&b)->n_item + b.body->tets->n_tet;
        bench_close(&b);
    }
    CHECK(hash[0] == hash[1]);
    printf("  %zu bytes more for %d springs\n", n_byte[1] - n_byte[0], n_spring);
    CHECK_LE(n_byte[1] - n_byte[0], 24 * (size_t)n_spring + sizeof(pal_spring_tangle) + 4096);
}

int main(void)
{
    RUN(patches_push_by_the_gradient_of_their_energy);
    RUN(patches_have_no_net_force_or_torque_and_only_take_energy);
    RUN(untangling_keeps_momentum_and_angular_momentum);
    RUN(springs_are_what_they_were_once_it_is_back);
    RUN(what_may_not_untangle_has_nothing_for_it);
    RUN(what_hangs_by_its_weight_is_left_to_its_springs);
    RUN(a_world_that_follows_goes_on_untangling);
    RUN(what_is_pressed_is_left_alone_until_it_is_let_go);
    RUN(what_is_never_turned_over_moves_to_the_same_bits);
    return check_report();
}
