/* Hard cases (catalogue.txt) for the explicit springs: whatever happens to a body or is asked of it, its state
 * stays finite, its energy does not rise, and it comes back where the springs determine the way. */
#include "server/base/vec3.h"
#include "server/sim/core/best_rotation.h"
#include "server/sim/world/world.h"
#include "tests/check.h"
#include "tests/fixtures/boxes.h"
#include "tests/fixtures/random.h"
#include "tests/stability/hard_case.h"

static pal_diagnostic diag;
static bool without_area; /* tests run with and without the row face_area */
static uint64_t seed;

static double uniform(void) /* in [0, 1) */
{
    return random_unit(&seed);
}

static bool bench_make(box_bench *b, bool fixed)
{
    seed = 11;
    if (!box_bench_make(b, (const int[3]){4, 3, 3}, 0.01, fixed, false)) return false;
    if (without_area) pal_entry_put_number(&b->scene->body[0].model, "k_area_J", 0, NULL);
    return true;
}

static int count_inverted(const pal_body *body)
{
    int n = 0;
    for (int t = 0; t < body->tets->n_tet; t++) {
        const int32_t *c = body->tets->tet + 4 * t;
        double e[3][3], g[3];
        for (int k = 0; k < 3; k++) pal_sub3(e[k], body->x + 3 * c[k + 1], body->x + 3 * c[0]);
        pal_cross3(g, e[1], e[2]);
        n += !(pal_dot3(e[0], g) > 0);
    }
    return n;
}

static double rms_from_rest(const pal_body *body)
{
    double sum = 0;
    for (int i = 0; i < 3 * body->n_dof; i++) sum += pow(body->x[i] - body->x_rest[i], 2);
    return sqrt(sum / body->n_dof);
}

/* the same after the best rigid motion */
static double rms_of_shape(const pal_body *body)
{
    double from[3] = {0, 0, 0}, to[3] = {0, 0, 0}, s[9] = {0}, turn[9], sum = 0;
    for (int i = 0; i < body->n_dof; i++) {
        pal_axpy3(from, 1.0 / body->n_dof, body->x_rest + 3 * i);
        pal_axpy3(to, 1.0 / body->n_dof, body->x + 3 * i);
    }
    for (int turned = 0; turned < 2; turned++) {
        for (int i = 0; i < body->n_dof; i++) {
            double x[3], y[3], at[3];
            pal_sub3(x, body->x + 3 * i, to), pal_sub3(y, body->x_rest + 3 * i, from);
            if (turned == 0) {
                pal_add_outer(s, 1, x, y);
                continue;
            }
            pal_mul33(at, turn, y);
            sum += pow(pal_dist3(at, x), 2);
        }
        pal_best_rotation(s, turn);
    }
    return sqrt(sum / body->n_dof);
}

static double extent(const pal_body *body)
{
    double max = 0;
    for (int i = 0; i < body->n_dof; i++)
        for (int j = 0; j < i; j++) max = fmax(max, pal_dist3(body->x + 3 * i, body->x + 3 * j));
    return max;
}

/* runs and checks after every step that state is finite and energy no more than at the start */
static void run_bounded(box_bench *b, double seconds)
{
    double start = pal_world_energy_J(b->world), max = 0;
    for (int i = 0; i < (int)(seconds * 60); i++) {
        REQUIRE(!pal_world_step(b->world, 1.0 / 60));
        REQUIRE(pal_body_finite(b->body));
        max = fmax(max, pal_world_energy_J(b->world));
    }
    if (!(max <= 1.01 * start)) printf("  energy rose from %.4g to %.4g J\n", start, max);
    CHECK_LE(max, 1.01 * start);
}

static void an_inverted_corner_turns_back(void)
{
    box_bench b;
    REQUIRE(bench_make(&b, true));
    REQUIRE(box_bench_start(&b));
    /* the top corner goes through its tetrahedron */
    double *x = b.body->x + 3 * box_node((const int[]){4, 3, 3}, 4, 3, 3);
    pal_add3(x, x, (const double[3]){-0.012, -0.012, -0.012});
    pal_world_invalidate_limits(b.world, 0);
    CHECK(count_inverted(b.body) > 0);
    run_bounded(&b, 2);
    CHECK_INT(count_inverted(b.body), 0);
    HARD_CASE("inverted", "tet_springs", "off rest after 2 s", 100 * rms_from_rest(b.body) / b.body->length_scale_m,
              0.1, "% S");
    box_bench_close(&b);
}

static void trial_case(box_bench *b, int kind)
{
    double *x = b->body->x;
    for (int i = 0; i < b->body->n_dof; i++, x += 3) {
        if (b->body->support[i]) continue;
        switch (kind) {
        case 0:
            x[2] = 0;
            break;
        case 1:
            x[0] = x[1] = x[2] = 0.01;
            break;
        case 2:
            x[0] = 0.04 - x[0];
            break;
        case 3:
            for (int c = 0; c < 3; c++) x[c] = uniform() * (c == 0 ? 0.04 : 0.03);
            break;
        default:
            pal_scale3(x, 100, x);
        }
    }
    pal_world_invalidate_limits(b->world, 0);
}

static void flattened_collapsed_mirrored_shuffled_and_blown_up_bodies_come_back(void)
{
    static const char *const names[] = {"plane", "point", "mirror", "shuffle", "blown_up"};
    for (int fixed = 0; fixed < 2; fixed++)
        for (int kind = 0; kind < 5; kind++) {
            if (kind == 4 && !fixed && CHECK_REPEATS(false, true)) {
                printf("  left out under sanitizers: free, x 100, and that the held one is back after 5 s\n");
                continue;
            }
            box_bench b;
            REQUIRE(bench_make(&b, fixed));
            REQUIRE(box_bench_start(&b));
            trial_case(&b, kind);
            double before = extent(b.body);
            const bool goes_back = (fixed && kind <= 1) || CHECK_REPEATS(true, false);
            run_bounded(&b, goes_back ? 5 : CHECK_REPEATS(5, 1));
            printf("  %s%s: %d of %d inverted, RMS %.2g of S, %d sub-steps, %llu heavy, %llu clamped\n",
                   fixed ? "held, " : "free, ", names[kind], count_inverted(b.body), b.body->tets->n_tet,
                   rms_from_rest(b.body) / b.body->length_scale_m, pal_world_substeps(b.world),
                   (unsigned long long)b.body->safeguards.n_mass_scaled,
                   (unsigned long long)b.body->safeguards.n_clamped);
            HARD_CASE(names[kind], "tet_springs", "extent over that at the start",
                      extent(b.body) / fmax(before, b.body->length_scale_m), 1.5, "");
            CHECK(b.body->safeguards.n_inversion > 0 || kind == 0);
            if (goes_back) CHECK_INT(count_inverted(b.body), 0);
            if (goes_back && fixed)
                HARD_CASE(names[kind], "tet_springs", "held: off rest after 5 s",
                          100 * rms_from_rest(b.body) / b.body->length_scale_m, 0.1, "% S");
            if (goes_back && !fixed)
                HARD_CASE(names[kind], "tet_springs", "free: distances off those at rest after 5 s",
                          100 * rms_of_shape(b.body) / b.body->length_scale_m, 0.1, "% S");
            box_bench_close(&b);
        }
}

static void blown_up_without_area_springs_the_guard_freezes_the_last_good_state(void)
{
    box_bench b;
    REQUIRE(bench_make(&b, true));
    pal_body_def *def = &b.scene->body[0];
    if (!without_area) pal_entry_put_number(&def->model, "k_area_J", 0, NULL);
    pal_entry_init(&def->effect[def->n_effect++], "effects[0]", "finite_guard");
    REQUIRE(box_bench_start(&b));
    REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    trial_case(&b, 4);
    CHECK_INT(pal_world_step(b.world, 1.0 / 60), PAL_ERR_FROZEN);
    CHECK(b.body->frozen);
    for (int i = 0; i < 60; i++) REQUIRE(!pal_world_step(b.world, 1.0 / 60));
    HARD_CASE("blown_up", "tet_springs", "without springs of areas: frozen in its last good state, off rest",
              100 * rms_from_rest(b.body) / b.body->length_scale_m, 0.1, "% S");
    pal_world_reset(b.world);
    CHECK(!b.body->frozen);
    CHECK_INT(pal_world_step(b.world, 1.0 / 60), PAL_ERR_OK);
    box_bench_close(&b);
}

static void a_meganewton_on_a_vertex_is_shortened_and_forgotten(void)
{
    box_bench b;
    REQUIRE(bench_make(&b, true));
    b.scene->body[0].material.damping_1_s = 10;
    REQUIRE(box_bench_start(&b));
    int node = box_node((const int[]){4, 3, 3}, 2, 1, 3);
    for (int axis = CHECK_REPEATS(0, 2); axis < 3; axis++) {
        pal_world_reset(b.world);
        double force[3] = {0, 0, 0};
        force[axis] = axis == 2 ? -1e6 : 1e6;
        REQUIRE(!pal_world_load(b.world, 0, node, force));
        for (int i = 0; i < 60; i++) {
            REQUIRE(!pal_world_step(b.world, 1.0 / 60));
            REQUIRE(pal_body_finite(b.body));
        }
        CHECK(b.body->safeguards.n_capped > 0);
        CHECK_LE(extent(b.body), 10 * b.body->length_scale_m);
        REQUIRE(!pal_world_load(b.world, 0, node, (const double[3]){0, 0, 0}));
        run_bounded(&b, 2);
        HARD_CASE("meganewton", "tet_springs", "turned over 2 s after", count_inverted(b.body), 0, "");
        run_bounded(&b, 3);
        HARD_CASE("meganewton", "tet_springs", "off rest 5 s after",
                  100 * rms_from_rest(b.body) / b.body->length_scale_m, 0.1, "% S");
    }
    box_bench_close(&b);
}

static void a_step_ten_times_too_long_is_split_and_beyond_the_budget_refused(void)
{
    box_bench b, c;
    REQUIRE(bench_make(&b, true));
    REQUIRE(box_bench_start(&b));
    REQUIRE(bench_make(&c, true));
    REQUIRE(box_bench_start(&c));
    b.body->v[3 * 40] = c.body->v[3 * 40] = 0.2;
    REQUIRE(!pal_world_step(b.world, 10.0 / 60));
    for (int i = 0; i < 10; i++) REQUIRE(!pal_world_step(c.world, 1.0 / 60));
    CHECK_LE(pal_world_energy_J(b.world), 1.01 * 0.5 * b.body->mass_kg[40] * 0.04);
    double apart = 0, max = 0;
    for (int i = 0; i < 3 * b.body->n_dof; i++) {
        apart = fmax(apart, fabs(b.body->x[i] - c.body->x[i]));
        max = fmax(max, fabs(c.body->x[i] - c.body->x_rest[i]));
    }
    CHECK_LE(apart, 0.2 * max);
    uint64_t hash = pal_world_hash(b.world);
    CHECK_INT(pal_world_step(b.world, 1000), PAL_ERR_BUDGET);
    CHECK_INT(pal_world_step(b.world, NAN), PAL_ERR_REFUSED);
    CHECK_INT(pal_world_step(b.world, -1), PAL_ERR_REFUSED);
    CHECK(hash == pal_world_hash(b.world));
    box_bench_close(&b);
    box_bench_close(&c);
}

static void a_material_beyond_the_budget_is_refused_and_changes_nothing(void)
{
    box_bench b;
    REQUIRE(bench_make(&b, true));
    REQUIRE(box_bench_start(&b));
    pal_material soft = b.scene->body[0].material, hard = soft;
    double limit = pal_world_limit_s(b.world);
    hard.young_Pa = 1e12;
    CHECK_INT(pal_world_material(b.world, 0, &hard, &diag), PAL_ERR_BUDGET);
    CHECK(strstr(diag.text, "max_substep allows 2000"));
    CHECK_NEAR(pal_world_limit_s(b.world), limit, 0);
    hard.young_Pa = NAN;
    CHECK_INT(pal_world_material(b.world, 0, &hard, &diag), PAL_ERR_REFUSED);
    hard.young_Pa = 4 * soft.young_Pa;
    CHECK_INT(pal_world_material(b.world, 0, &hard, &diag), 0);
    CHECK_NEAR(pal_world_limit_s(b.world) / limit, 0.5, 1e-9);
    b.scene->body[0].material.young_Pa = 1e12;
    pal_world *none = NULL;
    CHECK_INT(pal_world_create(b.scene, &diag, &none), PAL_ERR_BUDGET);
    CHECK(!none);
    box_bench_close(&b);
}

/* a box in its own units of length h, stress E and mass: the scaled answer after a number of scaled steps */
static bool scaled(double h, double young, double x[3])
{
    box_bench b;
    seed = 5;
    if (box_make(3, 2, 2, h, &b.box)) return false;
    b.scene = box_scene(&b.box, true, false);
    b.scene->body[0].n_effect = 0;
    /* wave time h / c is 2.2 ms for all */
    b.scene->body[0].material =
        (pal_material){.young_Pa = young, .poisson = 0.45, .density_kg_m3 = young * 5e-6 / (h * h), .damping_1_s = 4};
    for (int i = 0; i < 3; i++) x[i] = NAN;
    if (!box_bench_start(&b)) return false;
    for (int i = 0; i < 3 * b.body->n_dof; i++)
        if (!b.body->support[i / 3]) b.body->x[i] += 0.2 * h * (uniform() - 0.5);
    pal_world_invalidate_limits(b.world, 0);
    bool ok = true;
    for (int i = 0; i < 20; i++) ok = ok && !pal_world_step(b.world, 1.0 / 60);
    int node = 3 * (b.body->n_dof - 1);
    for (int i = 0; i < 3; i++) x[i] = (b.body->x[node + i] - b.body->x_rest[node + i]) / h;
    box_bench_close(&b);
    return ok;
}

static void any_scale_of_length_and_stiffness_gives_the_same_scaled_answer(void)
{
    static const double length[] = {1e-6, 1e-3, 1, 1e6}, young[] = {1e-3, 1, 1e6, 1e12};
    double expect[3], x[3];
    REQUIRE(scaled(0.01, 5000, expect));
    CHECK(fabs(expect[0]) > 1e-6);
    const int every = CHECK_REPEATS(1, 3);
    for (int l = 0; l < 4; l += every)
        for (int e = 0; e < 4; e += every) {
            CHECK(scaled(length[l], young[e], x));
            for (int c = 0; c < 3; c++)
                HARD_CASE("scales", "tet_springs", "scaled answers differ by", fabs(x[c] - expect[c]), 1e-4, "h");
        }
}

static void huge_drag_creeps_and_no_drag_keeps_moving(void)
{
    box_bench b;
    REQUIRE(bench_make(&b, true));
    b.scene->body[0].material.damping_1_s = 1e8;
    REQUIRE(box_bench_start(&b));
    for (int i = 0; i < b.body->n_dof; i++) b.body->x[3 * i + 2] *= 0.9;
    pal_world_invalidate_limits(b.world, 0);
    double before = pal_world_energy_J(b.world);
    for (int i = 0; i < 30; i++) {
        REQUIRE(!pal_world_step(b.world, 1.0 / 60));
        double now = pal_world_energy_J(b.world);
        HARD_CASE("drag", "tet_springs", "energy over that of the step before", now / before, 1, "");
        before = now;
    }
    box_bench_close(&b);
}

static void constraint_damping_far_beyond_critical_stays_stable(void)
{
    box_bench b;
    REQUIRE(bench_make(&b, true));
    pal_entry_put_number(&b.scene->body[0].model, "c_distance_Js", 1e-5, NULL);
    pal_entry_put_number(&b.scene->body[0].model, "c_area_Js", 1e-5, NULL);
    pal_entry_put_number(&b.scene->body[0].model, "c_volume_Js", 1e-5, NULL);
    REQUIRE(box_bench_start(&b));
    for (int i = 0; i < 3 * b.body->n_dof; i++)
        if (!b.body->support[i / 3]) b.body->x[i] += 0.005 * (uniform() - 0.5);
    pal_world_invalidate_limits(b.world, 0);
    run_bounded(&b, CHECK_REPEATS(2, 1));
    box_bench_close(&b);
}

static void held_and_single_element_bodies_step(void)
{
    pal_prepared one;
    REQUIRE(!box_one_tet(0.01, &one));
    for (int fixed = 0; fixed < 2; fixed++) {
        pal_scene *scene = box_scene(&one, fixed, true);
        scene->body[0].support[0].fraction = 1;
        scene->body[0].n_effect = 1;
        pal_world *world;
        REQUIRE(!pal_world_create(scene, &diag, &world));
        for (int i = 0; i < 20; i++) CHECK_INT(pal_world_step(world, scene->step_s), 0);
        const pal_body *body = pal_world_body(world, 0);
        CHECK(pal_body_finite(body));
        /* held: still there; free: fallen g/c^2 (c t - 1 + exp(-c t)) after t = 1/3 s at the drag rate c = 4/s */
        double fall = fixed ? 0 : 9.81 / 16 * (4.0 / 3 - 1 + exp(-4.0 / 3));
        CHECK_NEAR(body->x_rest[2] - body->x[2], fall, 0.02 * fall + 1e-12);
        if (fixed)
            HARD_CASE("all_held", "tet_springs", "moves by", pal_dist3(body->x, body->x_rest) / body->length_scale_m,
                      1e-12, "S");
        else
            HARD_CASE("one_element", "tet_springs", "off its free fall",
                      100 * fabs((body->x_rest[2] - body->x[2]) / fall - 1), 2, "%");
        pal_world_destroy(world);
        free(scene);
    }
    box_free(&one);
}

static void a_body_that_is_no_number_freezes_and_the_other_goes_on(void)
{
    box_bench b;
    REQUIRE(bench_make(&b, true));
    b.scene->n_body = 2;
    b.scene->body[1] = b.scene->body[0];
    snprintf(b.scene->body[1].name, PAL_NAME, "other");
    REQUIRE(box_bench_start(&b));
    pal_body *other = pal_world_body(b.world, 1);
    b.body->x[3 * 40] = NAN;
    pal_world_invalidate_limits(b.world, 0);
    other->v[3 * 40] = 0.1;
    CHECK(b.body->frozen);
    for (int i = 0; i < 5; i++) CHECK_INT(pal_world_step(b.world, 1.0 / 60), 0);
    CHECK(!other->frozen);
    CHECK(pal_body_finite(other));
    CHECK(other->x[3 * 40] != other->x_rest[3 * 40]);
    pal_world_reset(b.world);
    CHECK(!b.body->frozen);
    CHECK_INT(pal_world_step(b.world, 1.0 / 60), 0);
    CHECK(pal_body_finite(b.body));
    /* diverging within a step is told by its code */
    b.body->x[3 * 40 + 1] = INFINITY;
    b.body->v[3 * 40] = NAN;
    pal_err err = PAL_ERR_OK;
    for (int i = 0; i < 60 && !err; i++) err = pal_world_step(b.world, 1.0 / 60);
    CHECK_INT(err, PAL_ERR_FROZEN);
    CHECK(b.body->frozen);
    for (int i = 0; i < 3 * b.body->display.n_shown; i++) REQUIRE(isfinite(b.body->display.shown[i]));
    box_bench_close(&b);
}

int main(void)
{
    RUN(a_body_that_is_no_number_freezes_and_the_other_goes_on);
    for (int turn = 0; turn < 2; turn++) {
        without_area = turn == 1;
        printf("%s the row face_area\n", turn ? "without" : "with");
        RUN(an_inverted_corner_turns_back);
        RUN(flattened_collapsed_mirrored_shuffled_and_blown_up_bodies_come_back);
        RUN(blown_up_without_area_springs_the_guard_freezes_the_last_good_state);
        RUN(a_meganewton_on_a_vertex_is_shortened_and_forgotten);
        RUN(a_step_ten_times_too_long_is_split_and_beyond_the_budget_refused);
        RUN(a_material_beyond_the_budget_is_refused_and_changes_nothing);
        RUN(any_scale_of_length_and_stiffness_gives_the_same_scaled_answer);
        RUN(huge_drag_creeps_and_no_drag_keeps_moving);
        RUN(constraint_damping_far_beyond_critical_stays_stable);
        RUN(held_and_single_element_bodies_step);
    }
    return check_report();
}
