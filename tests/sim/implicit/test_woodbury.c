/* Springs of contact in a preconditioner (woodbury.h): with an exact factor and exact columns it is the inverse of the
 * matrix; with those of another shape of the body it stays symmetric and positive, and conjugate gradients take no more
 * iterations with its own than without. */
#include "server/base/vec3.h"
#include "server/sim/implicit/tuning.h"
#include "server/sim/implicit/woodbury.h"
#include "tests/fixtures/fem_beam.h"
#include "tests/fixtures/random.h"

/* nodes that a spring holds at the beam's end, and springs that hold them */
enum { HELD = 8, SPRINGS = 2 };

/* a CONTACT component with springs between tools and the mean of nodes */
typedef struct held_nodes {
    int n;
    pal_mean_spring spring[SPRINGS];
    int32_t node[HELD];
    double weight[HELD];
} held_nodes;

static int mean_springs(const void *self, pal_mean_spring *out, int max)
{
    const held_nodes *h = self;
    for (int k = 0; k < h->n && k < max; k++) out[k] = h->spring[k];
    return h->n < max ? h->n : max;
}

static void multiply_springs(void *self, const pal_body *body, double k, const double *p, double *out)
{
    const held_nodes *h = self;
    (void)body;
    for (int s = 0; s < h->n; s++) {
        double mean[3] = {0};
        for (int i = 0; i < HELD; i++) pal_axpy3(mean, h->weight[i], p + 3 * h->node[i]);
        for (int i = 0; i < HELD; i++) pal_axpy3(out + 3 * h->node[i], k * h->spring[s].k_N_m * h->weight[i], mean);
    }
}

static const pal_tangent tangent = {.multiply = multiply_springs, .mean_springs = mean_springs};
static const pal_effect effect = {.name = "held", .stage = PAL_STAGE_CONTACT, .tangent = &tangent};

/* a system of a beam's elements and springs, its preconditioner in double precision, and room for vectors */
typedef struct held_beam {
    fem_beam b;
    held_nodes held;
    pal_component contact;
    pal_arena *arena;
    pal_system system;
    pal_node_rotations rotations;
    pal_preconditioner m;
    pal_woodbury woodbury;
    pal_conjugate_gradient cg;
    double *x, *r, *s, *z, *q;
    bool corrects;
} held_beam;

static void multiply(void *user, const double *p, double *out)
{
    pal_system_multiply(&((held_beam *)user)->system, p, out);
}

static void precondition(void *user, const double *r, double *z)
{
    held_beam *h = user;
    if (h->corrects)
        pal_woodbury_solve(&h->woodbury, &h->m, PAL_CYCLE_V, r, z);
    else
        pal_preconditioner_solve(&h->m, PAL_CYCLE_V, r, z);
}

/* the middle of the beam's end, held with the weights of a grasp; the spring is some 20 times as stiff as the beam */
static void hold(held_beam *h, int n_spring)
{
    const pal_body *body = h->b.body;
    int n = 0;
    for (int i = 0; i < body->n_node && n < HELD; i++)
        if (body->x_rest[3 * i] > h->b.length_m - 1e-6) h->held.node[n++] = i;
    REQUIRE(n == HELD);
    for (int i = 0; i < HELD; i++) h->held.weight[i] = (1 + i % 3) / 15.0;
    h->held.n = n_spring;
    for (int k = 0; k < n_spring; k++)
        h->held.spring[k] = (pal_mean_spring){
            .k_N_m = 2e4, .n_node = HELD, .node = h->held.node, .weight = h->held.weight, .revision = (uint64_t)k + 1};
}

static void make(held_beam *h, int n_spring)
{
    pal_diagnostic diag;
    memset(h, 0, sizeof *h);
    beam_reference(&h->b, 4);
    beam_element(&h->b, "hex8_bbar", "corotational");
    REQUIRE(!beam_open(&h->b, &diag));
    const pal_component *elastic = NULL;
    for (int i = 0; i < pal_world_component_count(h->b.world); i++)
        if (!strcmp(pal_world_component(h->b.world, i)->effect->name, "hex_elastic"))
            elastic = pal_world_component(h->b.world, i);
    h->arena = pal_arena_create(1 << 20, true);
    REQUIRE(h->arena && elastic);
    hold(h, n_spring);
    h->contact = (pal_component){.effect = &effect, .self = &h->held};
    const pal_build build = {.scene = h->b.scene,
                             .def = h->b.def,
                             .body = h->b.body,
                             .arena = h->arena,
                             .diag = &diag,
                             .made = elastic,
                             .n_made = 1};
    const pal_preconditioner_options options = {.kind = PAL_PRECONDITION_FACTOR};
    const size_t n = 3 * (size_t)h->b.body->n_dof;
    REQUIRE(!pal_system_make(&build, &h->system));
    REQUIRE(!pal_node_rotations_make(&h->system, NULL, h->arena, &h->rotations));
    REQUIRE(!pal_preconditioner_make(&options, &h->system, &h->rotations, h->arena, &diag, &h->m));
    REQUIRE(!pal_woodbury_make(&h->system, &h->contact, 1, h->arena, &h->woodbury));
    REQUIRE(PAL_NEW_DOUBLES(h->arena, n, &h->x, &h->r, &h->s, &h->z, &h->q, &h->cg.r, &h->cg.z, &h->cg.p, &h->cg.q));
    h->cg.n = (int)n, h->cg.multiply = multiply, h->cg.precondition = precondition, h->cg.user = h;
    h->system.contact = &h->contact, h->system.n_contact = 1, h->system.has_contact = true;
    h->system.mass = 1, h->system.stiff = 1.0 / 3600;
    pal_system_linearise(&h->system);
    REQUIRE(!pal_preconditioner_update(&h->m));
}

static void destroy(held_beam *h)
{
    pal_preconditioner_destroy(&h->m);
    pal_arena_destroy(h->arena);
    beam_free(&h->b);
}

/* bends the beam by 60 degrees in all, and linearises there */
static void bend(held_beam *h)
{
    const double bend_1_m = 1.0 / h->b.length_m;
    for (int i = 0; i < h->b.body->n_node; i++) {
        const double *at = h->b.body->x_rest + 3 * i, a = bend_1_m * at[0], radius = 1 / bend_1_m - at[2];
        pal_set3(h->b.body->x + 3 * i, radius * sin(a), at[1], 1 / bend_1_m - radius * cos(a));
    }
    pal_system_linearise(&h->system);
    pal_node_rotations_update(&h->rotations, &h->system);
    (void)pal_preconditioner_follow(&h->m), pal_preconditioner_rotate(&h->m);
}

static void randomise(const held_beam *h, uint64_t *seed, double *to)
{
    for (int i = 0; i < h->cg.n; i++) to[i] = random_signed(seed);
    pal_system_clear_supported(h->b.body, to);
}

/* iterations to 1e-6 from 0 towards a motion that the springs resist */
static int iterations(held_beam *h, bool corrects)
{
    uint64_t seed = 3;
    randomise(h, &seed, h->x);
    multiply(h, h->x, h->cg.r);
    const double size = sqrt(pal_dot_product(h->cg.n, h->cg.r, h->cg.r));
    memset(h->x, 0, sizeof *h->x * (size_t)h->cg.n);
    h->corrects = corrects;
    const int n = pal_conjugate_gradient_run(&h->cg, h->x, 1e-6 * size, 1, 200);
    CHECK_LE(h->cg.residual, 1e-6 * size);
    return n;
}

/* one application undoes the matrix, and a first guess of a pull by the spring alone is the answer. Columns are in
 * single precision, and what they are subtracted from is up to 20 times as large as the difference */
static void is_the_inverse_of_matrix_and_springs(void)
{
    held_beam h;
    uint64_t seed = 1;
    make(&h, 1);
    pal_woodbury_update(&h.woodbury, &h.m, h.z);
    randomise(&h, &seed, h.x);
    multiply(&h, h.x, h.r);
    pal_woodbury_solve(&h.woodbury, &h.m, PAL_CYCLE_V, h.r, h.z);
    double error = 0, guess = 0, largest = 0;
    for (int i = 0; i < h.cg.n; i++) error = fmax(error, fabs(h.z[i] - h.x[i]));
    memset(h.r, 0, sizeof *h.r * (size_t)h.cg.n), memset(h.x, 0, sizeof *h.x * (size_t)h.cg.n);
    for (int i = 0; i < HELD; i++) h.r[3 * h.held.node[i] + 2] = h.held.weight[i];
    pal_woodbury_guess(&h.woodbury, h.r, h.x);
    multiply(&h, h.x, h.q);
    for (int i = 0; i < h.cg.n; i++) guess = fmax(guess, fabs(h.q[i] - h.r[i])), largest = fmax(largest, fabs(h.r[i]));
    printf("  |P A x - x| %.1e of 1, |A g - w| %.1e of 1\n", error, guess / largest);
    CHECK_LE(error, 2e-5);
    CHECK_LE(guess, 2e-5 * largest);
    const int without = iterations(&h, false), with = iterations(&h, true);
    printf("  iterations to 1e-6: %d without, %d with\n", without, with);
    CHECK_LE(with, 2);
    CHECK_LE(with + 2, without);
    destroy(&h);
}

/* columns of the straight beam, the matrix of the bent one; two springs that hold the same nodes */
static void stays_symmetric_and_positive(void)
{
    held_beam h;
    uint64_t seed = 2;
    make(&h, SPRINGS);
    pal_woodbury_update(&h.woodbury, &h.m, h.z);
    bend(&h);
    pal_woodbury_update(&h.woodbury, &h.m, h.z);
    for (int trial = 0; trial < 5; trial++) {
        randomise(&h, &seed, h.r), randomise(&h, &seed, h.s);
        pal_woodbury_solve(&h.woodbury, &h.m, PAL_CYCLE_V, h.r, h.z);
        pal_woodbury_solve(&h.woodbury, &h.m, PAL_CYCLE_V, h.s, h.q);
        const double rz = pal_dot_product(h.cg.n, h.r, h.z), sq = pal_dot_product(h.cg.n, h.s, h.q);
        const double rq = pal_dot_product(h.cg.n, h.r, h.q), sz = pal_dot_product(h.cg.n, h.s, h.z);
        CHECK(rz > 0 && sq > 0);
        /* rounding in double precision */
        CHECK_NEAR(rq, sz, 1e-9 * sqrt(rz * sq));
    }
    const int without = iterations(&h, false), stale = iterations(&h, true);
    for (int column = 0; column < 3 * SPRINGS; column++) {
        pal_woodbury_step(&h.woodbury, 1.01 * PAL_WOODBURY_RENEWAL_S);
        pal_woodbury_update(&h.woodbury, &h.m, h.z);
    }
    const int renewed = iterations(&h, true);
    printf("  bent, iterations to 1e-6: %d without, %d with old columns, %d with new ones\n", without, stale, renewed);
    CHECK_LE(stale, without + 1);
    CHECK_LE(renewed + 2, without);
    destroy(&h);
}

int main(void)
{
    RUN(is_the_inverse_of_matrix_and_springs);
    RUN(stays_symmetric_and_positive);
    return check_report();
}
