/* Contact forces as bodies are solved with them, in every sub-step of every tool_case by tools: never beyond a cap, and
 * what the tools feel is their opposite. A tap stands before the first row of contact and before the solver. */
#include "server/base/vec3.h"
#include "tests/fixtures/model_scenes.h"

typedef enum tool_case { INSIDE, PRESSED, JUMPING, DRAGGED, PINCHED, TOOL_CASES } tool_case;
static const char *const tool_case_name[TOOL_CASES] = {"inside", "pressed", "jumping", "dragged", "pinched"};

typedef struct body_case {
    model_kind kind;
    const char *solver;
} body_case;
static const body_case cases[] = {{FEM, "implicit_euler"}, {FEM, "sdirk2"},       {SOLID, "implicit_euler"},
                                  {SOLID, "sdirk2"},       {SPRINGS, ""},         {SHELL, ""},
                                  {SOLID, "central_cg"},   {FEM, "static_newton"}};
enum { CASES = sizeof cases / sizeof cases[0], STEPS = 60 };
static const double cap_N = 0.5;

/* ---- the tap ---- */

static struct {
    const pal_effect *contact, *solver;
    pal_effect contact_tapped, solver_tapped;
    pal_tangent tangent;
    double solved_N[3], node_share; /* by all contacts on the body, in the last solve */
    double first_N[3];              /* in the first of two stages                     */
    bool staged;
    /* of all sub-steps: the largest sum or force on a tool, the same over the caps of tools that act, the largest
     * difference between sum and what tools feel */
    double max_N, max_off_N, max_share;
    double max_node_share; /* the largest force on a node over its cap */
    bool by_row_sums;      /* the solver takes contact by its row sums, and what nodes receive by them is not capped */
    int n_settle, max_settle, n_substep;
} tap;

/* forces on the body's nodes, loads less what springs took back (NULL: nothing): their sum, the largest over its cap */
static double take_forces(const pal_body *body, const double *spring)
{
    double largest = 0;
    pal_set3(tap.solved_N, 0, 0, 0);
    for (int i = 0; i < body->n_node; i++) {
        double force[3];
        pal_copy3(force, body->load + 3 * i);
        if (spring) pal_sub3(force, force, spring + 3 * i);
        pal_add3(tap.solved_N, tap.solved_N, force);
        largest = fmax(largest, pal_norm3(force));
    }
    return largest / body->load_cap_N;
}

/* what the loads and springs that the body was solved with gave on it, when it moved by `moved` */
static bool settle_tapped(void *self, pal_step *step, const double *moved, bool last)
{
    const pal_body *body = step->body;
    size_t n3 = 3 * (size_t)body->n_node;
    double *spring = calloc(n3, sizeof *spring);
    if (!spring) abort();
    for (int i = 0; i < step->n_contact; i++) {
        const pal_component *row = &step->contact[i];
        if (row->effect->tangent && body->implicit) row->effect->tangent->multiply(row->self, body, 1, moved, spring);
    }
    for (int i = 0; i < body->n_node && body->load_stiffness; i++)
        pal_scale3(spring + 3 * i, body->load_stiffness[i], moved + 3 * i);
    tap.node_share = take_forces(body, spring);
    free(spring);
    tap.n_settle++;
    if (!last) tap.staged = true, pal_copy3(tap.first_N, tap.solved_N);
    return tap.contact->tangent->settle(self, step, moved, last);
}

static pal_err solve_tapped(void *self, pal_step *step)
{
    const pal_tools *tools = step->tools;
    double off[3], cap = 0;
    tap.node_share = take_forces(step->body, NULL);
    tap.n_settle = 0, tap.staged = false;
    pal_err err = tap.solver->run(self, step);
    /* two stages of sdirk2 give momentum as their mean, the first 1/sqrt 2 of it */
    pal_copy3(off, tap.solved_N);
    for (int c = 0; c < 3 && tap.staged; c++) off[c] += M_SQRT1_2 * (tap.first_N[c] - tap.solved_N[c]);
    tap.by_row_sums = step->body->load_stiffness != NULL;
    bool capped = false;
    for (int t = 0; t < tools->n_tool; t++) {
        double force = pal_norm3(tools->tool[t].force_N), limit_N = tools->tool[t].ramp * tools->tool[t].force_cap_N;
        pal_add3(off, off, tools->tool[t].force_N);
        tap.max_N = fmax(tap.max_N, force);
        if (force > 0) tap.max_share = fmax(tap.max_share, force / limit_N), cap += limit_N;
        capped |= force >= (1 - 1e-9) * limit_N;
    }
    double size = pal_norm3(tap.solved_N);
    tap.max_N = fmax(tap.max_N, size);
    tap.max_node_share = fmax(tap.max_node_share, tap.node_share);
    if (!capped || !tap.by_row_sums) tap.max_off_N = fmax(tap.max_off_N, pal_norm3(off));
    if (size > 1e-12 * cap_N) tap.max_share = fmax(tap.max_share, size / cap);
    tap.max_settle = tap.n_settle > tap.max_settle ? tap.n_settle : tap.max_settle;
    tap.n_substep++;
    return err;
}

static bool tap_rows(pal_world *world)
{
    memset(&tap, 0, sizeof tap);
    for (int i = 0; i < pal_world_component_count(world); i++) {
        pal_component *row = (pal_component *)(uintptr_t)pal_world_component(world, i);
        if (row->effect->stage == PAL_STAGE_CONTACT && !tap.contact && row->effect->tangent) {
            tap.contact = row->effect;
            tap.tangent = *tap.contact->tangent, tap.contact_tapped = *tap.contact;
            tap.tangent.settle = settle_tapped, tap.contact_tapped.tangent = &tap.tangent;
            row->effect = &tap.contact_tapped;
        }
        if (row->effect->stage == PAL_STAGE_SOLVE) {
            tap.solver = row->effect, tap.solver_tapped = *tap.solver;
            tap.solver_tapped.run = solve_tapped;
            row->effect = &tap.solver_tapped;
        }
    }
    return tap.contact && tap.solver;
}

/* ---- cases ---- */

static bool open_case(model_scene *m, const body_case *c, double max_N, double friction, bool fixed)
{
    model_scene_make(m, c->kind);
    pal_config_entry *push = model_scene_effect(m, "tool_push");
    model_scene_effect(m, "tool_grasp");
    if (c->solver[0]) pal_entry_init(&m->def->solver, "bodies[0].solver", c->solver);
    pal_entry_put_number(push, "friction", friction, NULL);
    if (!fixed) m->def->n_support = 0;
    for (int t = 0; t < 2; t++) m->scene->tool[t].force_cap_N = max_N;
    return true;
}

static void middle(const pal_body *body, double centre[3], double half[3])
{
    for (int c = 0; c < 3; c++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < pal_body_nodes(body); i++) {
            double x = body->node_rest[3 * pal_body_point(body, i) + c];
            low = fmin(low, x), high = fmax(high, x);
        }
        centre[c] = 0.5 * (low + high), half[c] = 0.5 * (high - low);
    }
}

/* a number in -1 .. 1 of the step and the axis */
static double wander(int step, int axis)
{
    return sin(12.9898 * step + 78.233 * axis);
}

static void place_tool(const pal_body *body, tool_case what, int step, int tool, pal_pose *pose)
{
    double centre[3], half[3], radius = 0.008, *at = pose->position_m;
    middle(body, centre, half);
    *pose = (pal_pose){.quat = {1, 0, 0, 0}};
    pal_copy3(at, centre);
    if (what == INSIDE) at[0] += step < 12 || step >= 40 ? half[0] + 2 * radius : step < 26 ? 0 : -0.7 * half[0];
    if (what == PRESSED) at[2] += half[2] + 2 * radius - 0.004 * fmin(step, 25);
    if (what == JUMPING)
        for (int c = 0; c < 3; c++) at[c] += 1.3 * half[c] * wander(step / 3, c);
    if (what == DRAGGED) {
        at[2] += half[2] + 0.5 * radius;
        pose->buttons = step > 11 && step < 50;
        for (int c = 0; c < 3 && step > 11; c++)
            at[c] += step % 7 ? 0.006 * (step - 11) : 3 * half[c] * wander(step, c);
    }
    if (what == PINCHED) at[1] += (tool ? 1 : -1) * (half[1] + 2 * radius - 0.003 * fmin(step, 20));
}

static bool move_tools(model_scene *m, tool_case what, int step)
{
    for (int t = 0; t < (what == PINCHED ? 2 : 1); t++) {
        pal_pose pose;
        place_tool(m->body, what, step, t, &pose);
        if (pal_world_pose(m->world, t, &pose)) return false;
    }
    return !pal_world_step(m->world, m->scene->step_s);
}

static void tools_feel_what_the_body_was_solved_with(void)
{
    for (int i = 0; i < CASES; i++)
        for (tool_case what = 0; what < TOOL_CASES; what++)
            for (int rough = 0; rough < 2; rough++) {
                model_scene m;
                REQUIRE(open_case(&m, &cases[i], cap_N, 0.5 * rough, true) && model_scene_open(&m) &&
                        tap_rows(m.world));
                for (int k = 0; k < STEPS; k++) REQUIRE(move_tools(&m, what, k));
                printf("  %s %s, %s, friction %g: up to %.6g N, %.6g of the caps, off by %.2g N, settled %d times\n",
                       model_kind_name[cases[i].kind], cases[i].solver, tool_case_name[what], 0.5 * rough, tap.max_N,
                       tap.max_share, tap.max_off_N, tap.max_settle);
                CHECK(tap.max_N > 0.02 * cap_N);
                CHECK(tap.n_substep >= STEPS);
                /* row sums: at most 1.09 */
                CHECK_LE(tap.max_share, tap.by_row_sums ? 1.2 : 1 + 1e-9);
                CHECK_LE(tap.max_off_N, 1e-9 * cap_N);
                model_scene_close(&m);
            }
}

/* a tool whose own cap is out of reach */
static void no_node_bears_more_than_its_cap(void)
{
    for (int i = 0; i < CASES; i++)
        for (tool_case what = PRESSED; what < PINCHED; what++) {
            model_scene m;
            REQUIRE(open_case(&m, &cases[i], 1e6, 0.3, true) && model_scene_open(&m) && tap_rows(m.world));
            for (int k = 0; k < STEPS; k++) REQUIRE(move_tools(&m, what, k));
            printf("  %s %s, %s: up to %.6g N, on a node %.12g of its cap, off by %.2g of the sum, settled %d times\n",
                   model_kind_name[cases[i].kind], cases[i].solver, tool_case_name[what], tap.max_N, tap.max_node_share,
                   tap.max_off_N / tap.max_N, tap.max_settle);
            CHECK(tap.max_N > cap_N);
            /* rounding of sums that cancel: at most 1.2e-9, depending on the processor; row sums: at most 1.3 */
            CHECK_LE(tap.max_node_share, tap.by_row_sums ? 1.5 : 1 + 1e-8);
            CHECK_LE(tap.max_off_N, 1e-8 * tap.max_N);
            model_scene_close(&m);
        }
}

/* two tools press a body against each other without friction: neither is drawn in */
static void contact_does_not_pull_as_a_whole(void)
{
    model_scene m;
    double max_N = 0, pull_N = 0;
    REQUIRE(open_case(&m, &cases[0], 15, 0, true) && model_scene_open(&m));
    for (int k = 0; k < STEPS; k++) {
        REQUIRE(move_tools(&m, PINCHED, k));
        for (int t = 0; t < 2; t++) {
            double out_N = (t ? 1 : -1) * pal_world_tools(m.world)->tool[t].force_N[1];
            max_N = fmax(max_N, out_N), pull_N = fmax(pull_N, -out_N);
        }
    }
    printf("  up to %.4g N out, %.4g N in\n", max_N, pull_N);
    /* the tools do press: 7 to 11 N, as the crushed tissue between them bears more or less, of a cap of 15 */
    CHECK(max_N > 15.0 / 3);
    CHECK_LE(pull_N, 0);
    model_scene_close(&m);
}

/* The top of a column is pressed aside, slowly against its oscillation: contact holds, and its force is that of the
 * bent column, 3 E I / L^3 for each metre, within that of its motion. Points that a solve releases come through the
 * tool in the next one; released again by the one after it they would bear nothing, and eight times as much in turn */
static void what_comes_back_stays(void)
{
    enum { BEGIN = 70, HELD = 120, LAST = 180 };
    const double depth_m = 0.012, radius_m = 0.008, young_Pa = 8e4, k_N_m = young_Pa * pow(0.04, 4) / 4 / pow(0.32, 3);
    for (int i = 0; i < 2; i++) {
        model_scene m;
        double max_N = 0, min_N = INFINITY;
        REQUIRE(open_case(&m, &cases[i], 1, 0, true));
        pal_prepared_free(&m.mesh);
        REQUIRE(!box_make(2, 2, 16, 0.02, &m.mesh) && !pal_hexes_find(&m.mesh.tets, &m.mesh.hexes, &m.diag));
        m.def->material = (pal_material){.young_Pa = young_Pa, .poisson = 0.3, .density_kg_m3 = 1000, .damping_1_s = 8};
        REQUIRE(model_scene_open(&m));
        for (int k = 0; k < LAST; k++) {
            pal_pose pose = {.quat = {1, 0, 0, 0}};
            double centre[3], half[3];
            middle(m.body, centre, half);
            pal_copy3(pose.position_m, centre);
            pose.position_m[0] += half[0] + radius_m + 0.001 - depth_m * fmin(1, (double)k / HELD);
            pose.position_m[2] += half[2] - 0.01;
            REQUIRE(!pal_world_pose(m.world, 0, &pose) && !pal_world_step(m.world, 1.0 / 60));
            const double force_N = pal_norm3(pal_world_tools(m.world)->tool[0].force_N);
            if (k >= BEGIN) max_N = fmax(max_N, force_N);
            if (k >= BEGIN && k < HELD) min_N = fmin(min_N, force_N);
        }
        min_N /= k_N_m * depth_m, max_N /= k_N_m * depth_m;
        printf("  %s: %.2f to %.2f of the force at rest\n", cases[i].solver, min_N, max_N);
        CHECK(min_N > 0.5 && max_N < 3);
        model_scene_close(&m);
    }
}

/* ---- momentum ---- */

static void find_momentum(const pal_body *body, double sum[3])
{
    pal_set3(sum, 0, 0, 0);
    for (int i = 0; i < body->n_dof; i++) pal_axpy3(sum, body->mass_kg[i], body->v + 3 * i);
}

/* a body that nothing holds or brakes takes up no more momentum in a step than the cap gives in it, in both stages of
 * sdirk2 together as in the one of backward Euler */
static void a_step_gives_no_more_momentum_than_the_cap(void)
{
    for (int i = 0; i < 2; i++)
        for (tool_case what = INSIDE; what < PINCHED; what++) {
            model_scene m;
            double before[3], after[3], max_N = 0, max_off_N = 0;
            REQUIRE(open_case(&m, &cases[i], cap_N, 0, false));
            m.def->material.damping_1_s = 0;
            pal_entry_put_number(&m.def->solver, "tolerance", 1e-12, NULL);
            pal_entry_put_number(&m.def->solver, "iterations", 2000, NULL);
            REQUIRE(model_scene_open(&m));
            for (int k = 0; k < STEPS; k++) {
                find_momentum(m.body, before);
                REQUIRE(move_tools(&m, what, k));
                find_momentum(m.body, after);
                pal_sub3(after, after, before);
                pal_scale3(after, 1 / m.scene->step_s, after);
                max_N = fmax(max_N, pal_norm3(after));
                pal_add3(after, after, pal_world_tools(m.world)->tool[0].force_N);
                max_off_N = fmax(max_off_N, pal_norm3(after));
            }
            printf("  %s, %s: up to %.9g N, off by %.2g N\n", cases[i].solver, tool_case_name[what], max_N, max_off_N);
            CHECK(max_N > 0.02 * cap_N);
            CHECK_LE(max_N, cap_N * (1 + 1e-6));
            CHECK_LE(max_off_N, 1e-6 * cap_N);
            model_scene_close(&m);
        }
}

int main(void)
{
    RUN(tools_feel_what_the_body_was_solved_with);
    RUN(no_node_bears_more_than_its_cap);
    RUN(contact_does_not_pull_as_a_whole);
    RUN(what_comes_back_stays);
    RUN(a_step_gives_no_more_momentum_than_the_cap);
    return check_report();
}
