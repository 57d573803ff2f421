/* A bent body of springs that is made a thousand times as stiff at once, and soft again: the work that the change puts
 * in is taken away and does not throw it about. Small changes are not damped, to the bit. */
#include "server/base/vec3.h"
#include "server/sim/recovery/stiffening_damper.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/boxes.h"

static const double step_s = 1.0 / 120;
static const int n[3] = {8, 3, 3};
static pal_diagnostic diag;

/* a bar fixed below in z, pulled sideways at an upper corner for a quarter of a second */
static bool bent_make(box_bench *b, double force_N)
{
    if (!box_bench_make(b, n, 0.01, true, false)) return false;
    pal_entry_init(&b->scene->body[0].effect[b->scene->body[0].n_effect++], "effects[0]", "finite_guard");
    b->scene->step_s = step_s;
    b->scene->body[0].material =
        (pal_material){.young_Pa = 5e3, .poisson = 0.45, .density_kg_m3 = 1000, .damping_1_s = 4};
    if (!box_bench_start(b)) return false;
    if (pal_world_load(b->world, 0, box_node(n, n[0], n[1], n[2]), (const double[3]){force_N, 0, force_N}))
        return false;
    for (int i = 0; i < 30; i++)
        if (pal_world_step(b->world, step_s)) return false;
    return true;
}

static bool run(box_bench *b, int n_step)
{
    for (int i = 0; i < n_step; i++)
        if (pal_world_step(b->world, step_s) || b->body->frozen) return false;
    return true;
}

static pal_err stiffen(box_bench *b, double times)
{
    pal_material to = b->scene->body[0].material;
    to.young_Pa *= times;
    return pal_world_material(b->world, 0, &to, &diag);
}

static double off_S(const box_bench *b)
{
    double sum = 0;
    for (int i = 0; i < 3 * b->body->n_dof; i++) sum += pow(b->body->x[i] - b->body->x_rest[i], 2);
    return sqrt(sum / b->body->n_dof) / b->body->length_scale_m;
}

static int turned_over(const box_bench *b)
{
    int count = 0;
    for (int t = 0; t < b->body->tets->n_tet; t++) {
        const int32_t *c = b->body->tets->tet + 4 * (size_t)t;
        double e[3][3], g[3];
        for (int k = 0; k < 3; k++) pal_sub3(e[k], b->body->x + 3 * c[k + 1], b->body->x + 3 * c[0]);
        pal_cross3(g, e[1], e[2]);
        count += !(pal_dot3(e[0], g) > 0);
    }
    return count;
}

static void the_work_of_a_thousandfold_change_is_taken_away(void)
{
    box_bench b;
    REQUIRE(bent_make(&b, 0.15));
    const double bent_S = off_S(&b);
    REQUIRE(!stiffen(&b, 1000));
    const double put_in_J = pal_world_energy_J(b.world), rate_1_s = b.body->stiffening_damping_1_s;
    CHECK(rate_1_s > 100 && b.body->stiffening_damping_s > 0);
    double high_J = put_in_J;
    for (int i = 0; i < 12; i++) {
        REQUIRE(run(&b, 1));
        high_J = fmax(high_J, pal_world_energy_J(b.world));
    }
    const double left_J = pal_world_energy_J(b.world);
    printf("  bent by %.2g %% S, %.3g J put in, %.2g of it left after 0.1 s, drag %.0f/s\n", 100 * bent_S, put_in_J,
           left_J / put_in_J, rate_1_s);
    CHECK(bent_S > 0.005);
    CHECK_LE(high_J, 1.01 * put_in_J);
    /* drag of 4/s alone leaves two thirds */
    CHECK_LE(left_J, 0.05 * put_in_J);
    REQUIRE(run(&b, 18));
    CHECK(b.body->stiffening_damping_1_s == 0);
    REQUIRE(!stiffen(&b, 1));
    memset(b.body->external_force, 0, 3 * sizeof(double) * (size_t)b.body->n_node);
    double max_S = 0;
    for (int i = 0; i < 600; i++) {
        REQUIRE(run(&b, 1));
        max_S = fmax(max_S, off_S(&b));
    }
    printf("  soft again: %.2g %% S away at most, %.2g left\n", 100 * max_S, 100 * off_S(&b));
    CHECK_LE(max_S, 2 * bent_S);
    CHECK_LE(off_S(&b), 1e-3);
    CHECK_INT(turned_over(&b), 0);
    box_bench_close(&b);
}

/* at rest there is no work to take away, and where little is put in the motion is what it was */
static void little_work_is_left_alone(void)
{
    box_bench b;
    REQUIRE(bent_make(&b, 0));
    REQUIRE(!stiffen(&b, 1000));
    CHECK(b.body->stiffening_damping_1_s == 0 && b.body->stiffening_damping_s == 0);
    box_bench_close(&b);
    REQUIRE(bent_make(&b, 0.15));
    REQUIRE(!stiffen(&b, 9));
    CHECK(pal_world_energy_J(b.world) > 0.01);
    CHECK(b.body->stiffening_damping_1_s == 0 && b.body->stiffening_damping_s == 0);
    box_bench_close(&b);
}

static void a_reset_ends_the_damper(void)
{
    box_bench b;
    REQUIRE(bent_make(&b, 0.15));
    REQUIRE(!stiffen(&b, 1000));
    CHECK(b.body->stiffening_damping_1_s > 0);
    pal_world_reset(b.world);
    CHECK(b.body->stiffening_damping_1_s == 0 && b.body->stiffening_damping_s == 0);
    box_bench_close(&b);
}

/* w = sqrt(2 U / sum m u^2), c = 2 w for 8 / w, from numbers */
static void it_is_critical_for_the_motion_of_the_work(void)
{
    double x[6] = {0, 0, 0, 1.5, 0, 0}, rest[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {7, 4};
    uint8_t fixed[2] = {1, 0};
    pal_body body = {.n_dof = 2, .n_active = 2, .n_node = 2, .x = x, .x_rest = rest, .mass_kg = mass, .support = fixed};
    body.length_scale_m = 1;
    pal_stiffening_damper_begin(&body, 0, 1.9); /* 2 * 1.9 J over 4 kg: below (1 S/s)^2 */
    CHECK_NEAR(body.stiffening_damping_1_s, 0, 0);
    pal_stiffening_damper_begin(&body, 5.1, 50); /* less than tenfold */
    CHECK_NEAR(body.stiffening_damping_1_s, 0, 0);
    pal_stiffening_damper_begin(&body, 50, 0); /* softer */
    CHECK_NEAR(body.stiffening_damping_1_s, 0, 0);
    pal_stiffening_damper_begin(&body, 1, 50); /* w^2 = 100 / (4 * 0.25) */
    CHECK_NEAR(body.stiffening_damping_1_s, 20, 1e-12);
    CHECK_NEAR(body.stiffening_damping_s, 0.8, 1e-12);
    pal_stiffening_damper_begin(&body, 1, 12.5); /* weaker: drag and end stay, whichever is more */
    CHECK_NEAR(body.stiffening_damping_1_s, 20, 1e-12);
    CHECK_NEAR(body.stiffening_damping_s, 1.6, 1e-12);
    pal_stiffening_damper_advance(&body, 1);
    CHECK_NEAR(body.stiffening_damping_1_s, 20, 1e-12);
    pal_stiffening_damper_advance(&body, 0.7);
    CHECK_NEAR(body.stiffening_damping_1_s, 0, 0);
}

/* what grows bit by bit is damped by what is stored now, for 0.1 s; one that was begun is neither cut nor weakened */
static void growing_energy_is_damped_as_it_grows(void)
{
    double x[6] = {0, 0, 0, 1.5, 0, 0}, rest[6] = {0, 0, 0, 1, 0, 0}, mass[2] = {7, 4};
    uint8_t fixed[2] = {1, 0};
    pal_body body = {.n_dof = 2, .n_active = 2, .n_node = 2, .x = x, .x_rest = rest, .mass_kg = mass, .support = fixed};
    body.length_scale_m = 1;
    pal_stiffening_damper_hold(&body, 50); /* w^2 = 100 / (4 * 0.25) */
    CHECK_NEAR(body.stiffening_damping_1_s, 20, 1e-12);
    CHECK_NEAR(body.stiffening_damping_s, 0.1, 1e-12);
    pal_stiffening_damper_advance(&body, 0.05);
    pal_stiffening_damper_hold(&body, 0.5);
    CHECK_NEAR(body.stiffening_damping_1_s, 2, 1e-12);
    CHECK_NEAR(body.stiffening_damping_s, 0.1, 1e-12);
    pal_stiffening_damper_advance(&body, 0.11);
    CHECK_NEAR(body.stiffening_damping_1_s, 0, 0);
    pal_stiffening_damper_begin(&body, 1, 50);
    pal_stiffening_damper_hold(&body, 0.5);
    CHECK_NEAR(body.stiffening_damping_1_s, 20, 1e-12);
    CHECK_NEAR(body.stiffening_damping_s, 0.8, 1e-12);
    pal_stiffening_damper_hold(&body, 200);
    CHECK_NEAR(body.stiffening_damping_1_s, 40, 1e-12);
    CHECK_NEAR(body.stiffening_damping_s, 0.8, 1e-12);
}

int main(void)
{
    RUN(the_work_of_a_thousandfold_change_is_taken_away);
    RUN(little_work_is_left_alone);
    RUN(a_reset_ends_the_damper);
    RUN(it_is_critical_for_the_motion_of_the_work);
    RUN(growing_energy_is_damped_as_it_grows);
    return check_report();
}
