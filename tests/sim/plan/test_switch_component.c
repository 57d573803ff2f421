/* Rows switched off and on in the running world: memory and order of the plan come back, a world goes on as one that
 * never had the row, what the solver and the shown surface need is refused, and energy changes by the row's own. */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/plan/plan.h"
#include "server/sim/transfer/transfer_world.h"
#include "tests/fixtures/model_scenes.h"
#include "tests/heap_calls.h"

static pal_diagnostic diag;

static pal_err turn(model_scene *m, const char *row, bool on)
{
    diag.text[0] = 0;
    return pal_world_switch_component(m->world, m->scene, 0, row, on, &diag);
}

/* the plan in one line */
static void plan_text(const model_scene *m, char text[1024])
{
    size_t n = 0;
    pal_component_info row;
    for (int i = 0; i < pal_world_component_count(m->world); i++) {
        pal_world_component_info(m->world, i, &row);
        n += (size_t)snprintf(text + n, 1024 - n, "%s %s %zu %s|", row.stage, row.name, row.n_byte, row.reason);
    }
}

static void every_row_comes_back_with_its_place_and_bytes(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        model_scene m;
        char before[1024], after[1024];
        int n_off = 0;
        model_scene_make(&m, (model_kind)k);
        model_scene_defaults(&m);
        REQUIRE(model_scene_open(&m));
        plan_text(&m, before);
        size_t n_byte = pal_world_bytes(m.world);
        for (int r = 0; r < pal_world_component_count(m.world); r++) {
            pal_component_info row;
            pal_world_component_info(m.world, r, &row);
            if (turn(&m, row.name, false)) {
                CHECK(diag.text[0]);
                continue;
            }
            n_off++;
            CHECK(model_scene_row(&m, row.name) < 0);
            CHECK(pal_world_bytes(m.world) + row.n_byte <= n_byte);
            CHECK_INT(turn(&m, row.name, false), PAL_ERR_OK);
            CHECK(model_scene_touch(&m, 0, 3));
            CHECK_INT(turn(&m, row.name, true), PAL_ERR_OK);
            CHECK_INT(turn(&m, row.name, true), PAL_ERR_OK);
            plan_text(&m, after);
            CHECK_TEXT(after, before);
            CHECK_INT(pal_world_bytes(m.world), n_byte);
        }
        printf("  %s: %d of %d rows off and on\n", model_kind_name[k], n_off, pal_world_component_count(m.world));
        CHECK(n_off >= 5);
        model_scene_close(&m);
    }
}

/* off and on before the first step: as if nothing had been */
static void a_row_that_came_and_went_leaves_no_trace(void)
{
    static const char *const rows[] = {"gravity", "tool_push", "tool_grasp", "finite_guard", "viscous"};
    for (int k = 0; k < MODEL_KINDS; k++) {
        uint64_t hash[2];
        for (int turned = 0; turned < 2; turned++) {
            model_scene m;
            model_scene_make(&m, (model_kind)k);
            model_scene_defaults(&m);
            REQUIRE(model_scene_open(&m));
            for (int r = 0; r < 5 && turned; r++) {
                CHECK_INT(turn(&m, rows[r], false), 0);
                CHECK_INT(turn(&m, rows[r], true), 0);
            }
            CHECK(model_scene_touch(&m, 0, 25));
            hash[turned] = pal_world_hash(m.world);
            model_scene_close(&m);
        }
        CHECK(hash[0] == hash[1]);
    }
}

/* the state of one world in another that was made without the row */
static void goes_on_as_a_world_that_never_had_the_row(void)
{
    static const char *const rows[] = {"gravity", "tool_push", "tool_grasp", "finite_guard", "viscous"};
    for (int k = 0; k < MODEL_KINDS; k++) {
        double max = 0;
        /* a body that adapts begins at rest in another world */
        for (int r = 0; r < 5 && k != SHELL; r++) {
            model_scene m, never;
            model_scene_make(&m, (model_kind)k), model_scene_make(&never, (model_kind)k);
            model_scene_defaults(&m), model_scene_defaults(&never);
            int at = 0;
            while (at < 4 && strcmp(never.def->effect[at].name, rows[r]) != 0) at++;
            if (at < 4)
                never.def->effect[at] = never.def->effect[--never.def->n_effect];
            else
                never.def->material.damping_1_s = 0;
            REQUIRE(model_scene_open(&m) && model_scene_open(&never));
            CHECK(model_scene_steps(&m, 20));
            CHECK_INT(turn(&m, rows[r], false), 0);
            CHECK(model_scene_row(&never, rows[r]) < 0);
            /* the material's rate is no number of any other row */
            never.scene->body[0].material.damping_1_s = 8;
            pal_world_transfer(never.world, m.world, -1, NULL, NULL);
            pal_world_invalidate_limits(m.world, 0);
            CHECK(pal_world_hash(m.world) == pal_world_hash(never.world));
            CHECK(model_scene_steps(&m, 20) && model_scene_steps(&never, 20));
            for (int i = 0; i < 3 * m.body->n_dof; i++) max = fmax(max, fabs(m.body->x[i] - never.body->x[i]));
            model_scene_close(&m), model_scene_close(&never);
        }
        printf("  %s: apart by %.3g m\n", model_kind_name[k], max);
        /* rows and iterations that go on are warm, those of a new world are not */
        CHECK_LE(max, k == SPRINGS ? 0 : 1e-12);
    }
}

static double row_energy(const model_scene *m, const char *name)
{
    const pal_component *row = pal_world_component(m->world, model_scene_row(m, name));
    return row->effect->energy ? row->effect->energy(row->self, m->body) : 0;
}

/* positions and speeds stay; the sum loses what the row had, and afterwards only drag takes from it */
static void energy_changes_by_the_rows_own_and_then_only_falls(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        model_scene m;
        model_scene_make(&m, (model_kind)k);
        model_scene_defaults(&m);
        REQUIRE(model_scene_open(&m));
        CHECK(model_scene_steps(&m, 30));
        uint64_t hash = pal_world_hash(m.world);
        double before = pal_world_energy_J(m.world), own = row_energy(&m, "gravity");
        CHECK_INT(turn(&m, "gravity", false), 0);
        CHECK(pal_world_hash(m.world) == hash);
        double after = pal_world_energy_J(m.world), max = after;
        CHECK_NEAR(after, before - own, 1e-12 * (fabs(before) + fabs(own)));
        for (int i = 0; i < 120; i++) {
            REQUIRE(model_scene_steps(&m, 1));
            max = fmax(max, pal_world_energy_J(m.world));
        }
        printf("  %s: %.3g J, gravity off %.3g J, most %.3g J, end %.3g J\n", model_kind_name[k], before, after, max,
               pal_world_energy_J(m.world));
        CHECK_LE(max, after * 1.02 + 1e-12);
        CHECK_LE(pal_world_energy_J(m.world), 0.05 * after);
        model_scene_close(&m);
    }
}

static void follows_the_material_of_now(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        const pal_material to = {.young_Pa = 2e4, .poisson = 0.3, .density_kg_m3 = 1200, .damping_1_s = 3};
        model_scene m, other;
        model_scene_make(&m, (model_kind)k), model_scene_make(&other, (model_kind)k);
        model_scene_defaults(&m), model_scene_defaults(&other);
        REQUIRE(model_scene_open(&m) && model_scene_open(&other));
        CHECK_INT(turn(&m, "viscous", false), 0);
        CHECK_INT(turn(&m, "finite_guard", false), 0);
        CHECK_INT(pal_world_material(m.world, 0, &to, &diag), 0);
        CHECK_INT(turn(&m, "viscous", true), 0);
        CHECK_INT(turn(&m, "finite_guard", true), 0);
        CHECK_INT(pal_world_material(other.world, 0, &to, &diag), 0);
        const pal_component *row = pal_world_component(m.world, model_scene_row(&m, "viscous"));
        CHECK_NEAR(row->effect->drag(row->self), 3, 0);
        CHECK(model_scene_touch(&m, 0, 20) && model_scene_touch(&other, 0, 20));
        /* edits of a solid under way aside, the worlds are the same now */
        CHECK(pal_world_hash(m.world) == pal_world_hash(other.world));
        model_scene_close(&m), model_scene_close(&other);
    }
}

static void refuses_what_a_body_cannot_be_without(void)
{
    static const struct {
        model_kind kind;
        const char *row, *expected;
    } no[] = {{SPRINGS, "verlet", "moves it"},
              {FEM, "implicit_euler", "moves it"},
              {SPRINGS, "surface_output", "shown"},
              {FEM, "hex_elastic", "last row"},
              {SOLID, "cell_elastic", "last row"},
              {SHELL, "inflate", "nothing in the scene"},
              {SHELL, "edge_spring", "last row"},
              {FEM, "", "nothing in the scene"},
              {SPRINGS, "hex_elastic", "nothing in the scene"}};
    for (size_t i = 0; i < sizeof no / sizeof no[0]; i++) {
        model_scene m;
        model_scene_make(&m, no[i].kind);
        model_scene_defaults(&m);
        REQUIRE(model_scene_open(&m));
        uint64_t hash = pal_world_hash(m.world);
        size_t n_byte = pal_world_bytes(m.world);
        CHECK_INT(turn(&m, no[i].row, false), PAL_ERR_REFUSED);
        if (!strstr(diag.text, no[i].expected)) CHECK_FAIL("%s", diag.text);
        CHECK_INT(pal_world_switch_component(m.world, m.scene, 1, "gravity", false, &diag), PAL_ERR_REFUSED);
        CHECK_INT(pal_world_switch_component(m.world, m.scene, -1, "gravity", false, &diag), PAL_ERR_REFUSED);
        CHECK(pal_world_hash(m.world) == hash && pal_world_bytes(m.world) == n_byte);
        model_scene_close(&m);
    }
}

/* springs may go one by one until one is left */
static void the_last_spring_stays(void)
{
    model_scene m;
    model_scene_make(&m, SPRINGS);
    model_scene_defaults(&m);
    REQUIRE(model_scene_open(&m));
    CHECK_INT(turn(&m, "face_area", false), 0);
    CHECK_INT(turn(&m, "tet_volume", false), 0);
    CHECK_INT(turn(&m, "edge_distance", false), PAL_ERR_REFUSED);
    CHECK(model_scene_touch(&m, 0, 10));
    CHECK_INT(turn(&m, "tet_volume", true), 0);
    CHECK_INT(turn(&m, "edge_distance", false), 0);
    CHECK(model_scene_steps(&m, 10));
    model_scene_close(&m);
}

/* a row that fitted the step with the material of load, but not with that of now */
static void too_stiff_a_row_does_not_come_back(void)
{
    const pal_material harder = {.young_Pa = 1.5e4, .poisson = 0.4, .density_kg_m3 = 1000, .damping_1_s = 8};
    model_scene m;
    model_scene_make(&m, SPRINGS);
    pal_entry_put_number(model_scene_effect(&m, "penalty"), "k_N_m", 5e4, NULL);
    m.def->n_support = 0;
    m.scene->step_s = 0.1;
    REQUIRE(model_scene_open(&m));
    const int n_sub = (int)ceil(m.scene->step_s / pal_world_limit_s(m.world));
    pal_world_destroy(m.world);
    m.scene->max_substep = n_sub;
    REQUIRE(model_scene_open(&m));
    CHECK_INT(turn(&m, "penalty", false), 0);
    CHECK_INT(pal_world_material(m.world, 0, &harder, &diag), 0);
    uint64_t hash = pal_world_hash(m.world);
    size_t n_byte = pal_world_bytes(m.world);
    CHECK_INT(turn(&m, "penalty", true), PAL_ERR_BUDGET);
    CHECK(strstr(diag.text, "sub-steps") != NULL);
    CHECK(model_scene_row(&m, "penalty") < 0);
    CHECK(pal_world_hash(m.world) == hash && pal_world_bytes(m.world) == n_byte);
    CHECK(model_scene_steps(&m, 5));
    model_scene_close(&m);
}

static void no_heap_in_a_step_afterwards(void)
{
    for (int k = 0; k < MODEL_KINDS; k++) {
        model_scene m;
        model_scene_make(&m, (model_kind)k);
        model_scene_defaults(&m);
        REQUIRE(model_scene_open(&m));
        CHECK_INT(turn(&m, "gravity", false), 0);
        CHECK_INT(turn(&m, "tool_grasp", false), 0);
        CHECK_INT(turn(&m, "gravity", true), 0);
        n_heap_call = 0;
        counting = true;
        bool good = model_scene_touch(&m, 0, 20);
        counting = false;
        CHECK(good);
        CHECK_INT(n_heap_call, 0);
        model_scene_close(&m);
    }
}

int main(void)
{
    RUN(every_row_comes_back_with_its_place_and_bytes);
    RUN(a_row_that_came_and_went_leaves_no_trace);
    RUN(goes_on_as_a_world_that_never_had_the_row);
    RUN(energy_changes_by_the_rows_own_and_then_only_falls);
    RUN(follows_the_material_of_now);
    RUN(refuses_what_a_body_cannot_be_without);
    RUN(the_last_spring_stays);
    RUN(too_stiff_a_row_does_not_come_back);
    RUN(no_heap_in_a_step_afterwards);
    return check_report();
}
