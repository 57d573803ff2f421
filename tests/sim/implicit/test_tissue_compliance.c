/* The static compliance of surfaces by an explicit solver, against conjugate gradients that are written here and run
 * until nothing changes. Products with the stiffness are differences of forces. */
#include "server/base/vec3.h"
#include "server/sim/implicit/tissue_compliance.h"
#include "tests/fixtures/model_scenes.h"

typedef struct problem {
    model_scene m;
    pal_tissue_compliance *tissue;
    pal_step step; /* the last one that was made */
    size_t n;      /* numbers of a field on nodes */
    double *f, *u; /* load, answer, N and m [n_node][3] */
    double *r, *p, *q;
} problem;

/* a closed surface of n_level levels on a support, at the finest; refines: while a tool nears its top. A load in
 * proportion to mass within 12 mm of there */
static bool make(problem *t, int n_level, bool refines)
{
    pal_pose pose = {.quat = {1, 0, 0, 0}, .position_m = {0.004, 0.003, 0.053}};
    memset(t, 0, sizeof *t);
    model_scene_make(&t->m, SHELL);
    pal_entry_put_number(&t->m.def->model, "levels", n_level, NULL);
    pal_entry_put_number(&t->m.def->model, "start_level", n_level - 1, NULL);
    pal_entry_put_bool(&t->m.def->model, "refine", refines, NULL);
    t->m.scene->tool[0].radius_m = 0.012;
    model_scene_effect(&t->m, "tool_push");
    if (!model_scene_open(&t->m)) return false;
    const pal_body *body = t->m.body;
    for (int i = 0; i < 60; i++, pose.position_m[2] -= 1e-5)
        if (pal_world_pose(t->m.world, 0, &pose) || !model_scene_steps(&t->m, 1)) return false;
    t->tissue = body->compliance->self, t->step = t->tissue->step;
    t->n = 3 * (size_t)body->n_node;
    t->f = calloc(5 * t->n, sizeof *t->f);
    if (!t->f) abort();
    t->u = t->f + t->n, t->r = t->u + t->n, t->p = t->r + t->n, t->q = t->p + t->n;
    for (int k = 0; k < body->n_active; k++) {
        const int i = pal_body_point(body, k);
        const double *x = body->x_rest + 3 * i;
        if (x[2] > 0 && hypot(x[0] - 0.004, x[1] - 0.003) < 0.012) t->f[3 * i + 2] = -body->mass_kg[i];
    }
    return true;
}

static void destroy(problem *t)
{
    free(t->f);
    model_scene_close(&t->m);
}

static double dot(const problem *t, const double *a, const double *b)
{
    double sum = 0;
    for (size_t i = 0; i < t->n; i++) sum += a[i] * b[i];
    return sum;
}

/* q = K p */
static void multiply(problem *t)
{
    pal_body *body = t->m.body;
    double longest = 0;
    for (size_t i = 0; i < t->n; i++) longest = fmax(longest, fabs(t->p[i]));
    const double part = 1e-5 * body->edge_m / longest;
    for (int side = -1; side <= 1; side += 2) {
        for (size_t i = 0; i < t->n; i++) body->x[i] += side * part * t->p[i];
        CHECK_INT(pal_world_assemble_forces(t->m.world, 0), 0);
        for (size_t i = 0; i < t->n; i++) body->x[i] -= side * part * t->p[i];
        for (size_t i = 0; i < t->n; i++)
            t->q[i] =
                body->support[i / 3] ? 0 : (side < 0 ? body->g[i] : t->q[i] - body->g[i]) / (side < 0 ? 1 : 2 * part);
    }
}

/* f' K^-1 f */
static double reference(problem *t)
{
    double r2 = dot(t, t->f, t->f), f2 = r2;
    memset(t->u, 0, t->n * sizeof *t->u);
    memcpy(t->r, t->f, t->n * sizeof *t->r), memcpy(t->p, t->f, t->n * sizeof *t->p);
    for (int k = 0; k < 3000 && r2 > 1e-8 * f2; k++) {
        multiply(t);
        const double along = r2 / dot(t, t->p, t->q), before = r2;
        for (size_t i = 0; i < t->n; i++) t->u[i] += along * t->p[i], t->r[i] -= along * t->q[i];
        r2 = dot(t, t->r, t->r);
        for (size_t i = 0; i < t->n; i++) t->p[i] = t->r[i] + r2 / before * t->p[i];
    }
    CHECK_LE(r2, 1e-8 * f2);
    return dot(t, t->f, t->u);
}

/* steps of 1/60 s until the answer is known, which is in u */
static int ask(problem *t)
{
    const pal_compliance *c = t->m.body->compliance;
    int n = 0;
    c->reset(c->self);
    t->step.dt_s = 1.0 / 60, t->step.n_sub = 1, t->step.time_s = 0;
    for (bool known = false; !known && n < 200; n++) {
        t->step.time_s += t->step.dt_s;
        c->begin(c->self, &t->step);
        known = c->solve(c->self, t->m.body, t->f, t->u);
    }
    return n;
}

/* four products a step find it within two steps at any number of nodes; by the row sums of its
 * springs 4, 8, 17 and 38 steps */
static void a_surface_with_all_nodes_is_known_at_once(void)
{
    for (int n_level = 1; n_level <= 4; n_level++) {
        problem t;
        REQUIRE(make(&t, n_level, false));
        CHECK_INT(t.m.body->n_active, t.m.body->n_dof);
        const double truth = reference(&t);
        const int n = ask(&t);
        const double found = dot(&t, t.f, t.u);
        printf("  %d nodes: %d steps, %.2g of the compliance off\n", t.m.body->n_active, n, found / truth - 1);
        CHECK_LE(n, 2);
        CHECK_NEAR(found, truth, 0.005 * truth);
        destroy(&t);
    }
}

/* after nodes have gone the stiffness at rest is of other nodes, and does not precondition */
static void a_surface_that_has_lost_nodes_is_found_too(void)
{
    problem t;
    REQUIRE(make(&t, 3, true));
    CHECK(t.m.body->n_active < t.m.body->n_dof);
    const double truth = reference(&t);
    const int n = ask(&t);
    const double found = dot(&t, t.f, t.u);
    printf("  %d of %d nodes: %d steps, %.2g of the compliance off\n", t.m.body->n_active, t.m.body->n_dof, n,
           found / truth - 1);
    CHECK_LE(n, 100);
    CHECK_NEAR(found, truth, 0.02 * truth);
    destroy(&t);
}

int main(void)
{
    RUN(a_surface_with_all_nodes_is_known_at_once);
    RUN(a_surface_that_has_lost_nodes_is_found_too);
    return check_report();
}
