/* A bent body of springs that is made a thousand times as stiff at once, and soft again: the work that the first edit
 * puts in does not throw it about after the second one, since its motion keeps its amplitude, not its speed. */
#include "server/base/vec3.h"
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

static void stiff_and_soft_again_is_not_thrown_about(void)
{
    box_bench b;
    REQUIRE(bent_make(&b, 0.15));
    const double bent_S = off_S(&b);
    REQUIRE(!stiffen(&b, 1000));
    const double put_in_J = pal_world_energy_J(b.world);
    double high_J = put_in_J, stiff_S = 0, soft_S = 0;
    for (int i = 0; i < 30; i++) {
        REQUIRE(run(&b, 1));
        high_J = fmax(high_J, pal_world_energy_J(b.world));
        stiff_S = fmax(stiff_S, off_S(&b));
    }
    const double left_J = pal_body_kinetic_J(b.body);
    REQUIRE(!stiffen(&b, 1));
    memset(b.body->external_force, 0, 3 * sizeof(double) * (size_t)b.body->n_node);
    for (int i = 0; i < 600; i++) {
        REQUIRE(run(&b, 1));
        soft_S = fmax(soft_S, off_S(&b));
    }
    printf("  bent by %.2g %% S, %.3g J put in, %.2g of it motion after 0.25 s; away by %.2g %% S at most while stiff, "
           "%.2g soft again, %.2g left\n",
           100 * bent_S, put_in_J, left_J / put_in_J, 100 * stiff_S, 100 * soft_S, 100 * off_S(&b));
    CHECK(bent_S > 0.005);
    CHECK_LE(high_J, 1.01 * put_in_J);
    CHECK_LE(stiff_S, 1.05 * bent_S);
    CHECK_LE(soft_S, 2 * bent_S);
    CHECK_LE(off_S(&b), 1e-3);
    CHECK_INT(turned_over(&b), 0);
    box_bench_close(&b);
}

/* of a body at rest in its motion nothing is left to scale, and a stiffer one keeps its speed */
static void only_a_softer_material_scales_the_motion(void)
{
    box_bench b;
    REQUIRE(bent_make(&b, 0.15));
    const int i = 3 * box_node(n, n[0], n[1], n[2]);
    double v = b.body->v[i];
    CHECK(fabs(v) > 1e-6);
    REQUIRE(!stiffen(&b, 9));
    CHECK(b.body->v[i] == v);
    REQUIRE(!stiffen(&b, 9));
    CHECK(b.body->v[i] == v);
    REQUIRE(!stiffen(&b, 1));
    CHECK_NEAR(b.body->v[i], v / 3, 1e-12 * fabs(v));
    /* a free body keeps its momentum */
    memset(b.body->support, 0, (size_t)b.body->n_dof);
    v = b.body->v[i];
    REQUIRE(!stiffen(&b, 0.1));
    CHECK(b.body->v[i] == v);
    box_bench_close(&b);
}

int main(void)
{
    RUN(stiff_and_soft_again_is_not_thrown_about);
    RUN(only_a_softer_material_scales_the_motion);
    return check_report();
}
