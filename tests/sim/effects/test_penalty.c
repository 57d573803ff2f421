/* Row penalty: its force is the gradient of its energy, it bears what supports bear, and gives way by f / k. */
#include "server/sim/core/effect_list.h"
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/subdivision_scene.h"

static const int32_t bricks[3] = {2, 2, 3};
static const double length_scale_m[3] = {0.05, 0.05, 0.1};

/* a column with its foot in the row, k 0: the row's own; weight on */
static bool begin(solid_scene *s, const char *solver, double k_N_m, bool gravity)
{
    solid_scene_take(s, solid_scene_box(bricks, length_scale_m, true), 1, solver, "polar");
    pal_config_entry *row = &s->def->effect[s->def->n_effect++];
    pal_entry_init(row, "effects[0]", "penalty");
    if (k_N_m > 0 && pal_entry_put_number(row, "k_N_m", k_N_m, NULL)) abort();
    if (gravity) pal_entry_init(&s->def->effect[s->def->n_effect++], "effects[1]", "gravity");
    return solid_scene_open(s);
}

static const pal_component *row_of(const solid_scene *s, const char *name)
{
    for (int i = 0; i < pal_world_component_count(s->world); i++) {
        const pal_component *row = pal_world_component(s->world, i);
        if (!strcmp(row->effect->name, name)) return row;
    }
    return NULL;
}

static void force_is_the_gradient_of_the_energy_and_the_tangent_its_slope(void)
{
    solid_scene s;
    REQUIRE(begin(&s, "central_cg", 40, false));
    const pal_component *row = row_of(&s, "penalty");
    REQUIRE(row);
    pal_body *body = s.body;
    size_t n3 = 3 * (size_t)body->n_node;
    double *p = calloc(n3, sizeof *p), *kp = calloc(n3, sizeof *kp), sum = 0, slope = 0;
    for (size_t i = 0; i < n3; i++) p[i] = sin(0.7 * (double)i), body->d[i] += 0.01 * cos(1.3 * (double)i);
    memset(body->f, 0, n3 * sizeof *body->f);
    pal_step step = {.body = body};
    CHECK_INT(row->effect->run(row->self, &step), 0);
    row->effect->tangent->multiply(row->self, body, 1, p, kp);
    for (size_t i = 0; i < n3; i++) sum -= body->f[i] * p[i], slope += kp[i] * p[i];
    const double h = 1e-4, at = row->effect->energy(row->self, body);
    for (size_t i = 0; i < n3; i++) body->d[i] += h * p[i];
    double high = row->effect->energy(row->self, body);
    for (size_t i = 0; i < n3; i++) body->d[i] -= 2 * h * p[i];
    double low = row->effect->energy(row->self, body);
    CHECK(sum != 0 && slope > 0);
    CHECK_NEAR((high - low) / (2 * h), sum, 1e-9 * fabs(sum));
    CHECK_NEAR((high - 2 * at + low) / (h * h), slope, 1e-5 * slope);
    free(p), free(kp);
    solid_scene_close(&s);
}

/* moved as one, the row pulls back with k times the way; at rest with nothing */
static void the_row_is_as_stiff_as_it_says(void)
{
    solid_scene s;
    REQUIRE(begin(&s, "central_cg", 40, false));
    const pal_component *row = row_of(&s, "penalty");
    pal_body *body = s.body;
    pal_step step = {.body = body};
    for (int turn = 0; turn < 2; turn++) {
        double sum[3] = {0, 0, 0};
        memset(body->f, 0, 3 * sizeof(double) * (size_t)body->n_node);
        CHECK_INT(row->effect->run(row->self, &step), 0);
        for (int i = 0; i < body->n_node; i++) pal_add3(sum, sum, body->f + 3 * (size_t)i);
        CHECK_NEAR(sum[0], turn ? -40 * 0.01 : 0, 1e-12);
        CHECK_NEAR(sum[2], turn ? -40 * -0.002 : 0, 1e-12);
        for (int i = 0; i < body->n_node && !turn; i++) body->d[3 * i] += 0.01, body->d[3 * i + 2] -= 0.002;
    }
    solid_scene_close(&s);
}

/* the column stands on it: the row bears the weight, and the foot is weight / k lower */
static void it_bears_the_weight_under_both_solvers(void)
{
    static const char *const solver[2] = {"central_cg", "implicit_euler"};
    for (int k = 0; k < 2; k++) {
        solid_scene s;
        REQUIRE(begin(&s, solver[k], 2000, true));
        for (int i = 0; i < 240; i++) CHECK_INT(pal_world_step(s.world, s.scene->step_s), 0);
        const pal_component *row = row_of(&s, "penalty");
        double weight = 9.81 * solid_mass_kg(s.body->model.solid), borne[3] = {0, 0, 0}, lower = 0;
        memset(s.body->f, 0, 3 * sizeof(double) * (size_t)s.body->n_node);
        pal_step step = {.body = s.body};
        pal_body_update_nodes(s.body);
        CHECK_INT(row->effect->run(row->self, &step), 0);
        for (int i = 0; i < s.body->n_node; i++) pal_add3(borne, borne, s.body->f + 3 * (size_t)i);
        int n = 0;
        for (int i = 0; i < s.body->n_node; i++)
            if (s.body->node_rest[3 * i + 2] < 1e-9) lower += s.body->node_rest[3 * i + 2] - s.body->d[3 * i + 2], n++;
        printf("  %s: bears %.6f of %.6f N, its foot %.4f mm lower, f / k %.4f\n", solver[k], borne[2], weight,
               1e3 * lower / n, 1e3 * weight / 2000);
        CHECK_NEAR(borne[2], weight, 2e-3 * weight);
        CHECK_NEAR(lower / n, weight / 2000, 0.05 * weight / 2000);
        solid_scene_close(&s);
    }
}

static void a_stiffer_row_asks_an_explicit_solver_for_shorter_steps(void)
{
    solid_scene soft, stiff;
    REQUIRE(begin(&soft, "central_cg", 1e-3, false));
    REQUIRE(begin(&stiff, "central_cg", 0, false));
    printf("  limit %.3g ms, without stiffness %.3g ms\n", 1e3 * pal_world_limit_s(stiff.world),
           1e3 * pal_world_limit_s(soft.world));
    CHECK_LE(pal_world_limit_s(stiff.world), 0.5 * pal_world_limit_s(soft.world));
    /* pulled off and let go, it comes back and does not diverge */
    for (int i = 0; i < stiff.body->n_dof; i++) stiff.body->x[3 * i] += 0.005;
    pal_world_invalidate_limits(stiff.world, 0);
    double start = pal_world_energy_J(stiff.world);
    for (int i = 0; i < 60; i++) CHECK_INT(pal_world_step(stiff.world, stiff.scene->step_s), 0);
    CHECK_LE(pal_world_energy_J(stiff.world), start);
    solid_scene_close(&soft);
    solid_scene_close(&stiff);
}

static void what_holds_nothing_is_refused(void)
{
    solid_scene s;
    const double low[3] = {1, 1, 1}, high[3] = {2, 2, 2};
    solid_scene_take(&s, solid_scene_box(bricks, length_scale_m, true), 1, "central_cg", "polar");
    pal_config_entry *row = &s.def->effect[s.def->n_effect++];
    pal_entry_init(row, "effects[0]", "penalty");
    if (pal_entry_put_numbers(row, "low_m", low, 3, NULL)) abort();
    CHECK_INT(pal_world_create(s.scene, &s.diag, &s.world), PAL_ERR_REFUSED);
    CHECK(strstr(s.diag.text, "effects[0]: low_m and high_m belong together"));
    if (pal_entry_put_numbers(row, "high_m", high, 3, NULL)) abort();
    CHECK_INT(pal_world_create(s.scene, &s.diag, &s.world), PAL_ERR_REFUSED);
    CHECK(strstr(s.diag.text, "effects[0]: penalty holds none of the body's"));
    pal_entry_init(row, "effects[0]", "penalty");
    if (pal_entry_put_number(row, "k_N_m", -1, NULL)) abort();
    CHECK_INT(pal_world_create(s.scene, &s.diag, &s.world), PAL_ERR_REFUSED);
    CHECK(strstr(s.diag.text, "k_N_m"));
    s.world = NULL;
    solid_scene_close(&s);
}

int main(void)
{
    RUN(force_is_the_gradient_of_the_energy_and_the_tangent_its_slope);
    RUN(the_row_is_as_stiff_as_it_says);
    RUN(it_bears_the_weight_under_both_solvers);
    RUN(a_stiffer_row_asks_an_explicit_solver_for_shorter_steps);
    RUN(what_holds_nothing_is_refused);
    return check_report();
}
