/* Brushes: pressure without net force on closed surfaces, handles as springs, slow in and out, rows that come and go,
 * what is refused; on springs, elements and solids. */
#include "server/sim/core/effect_list.h"
#include "tests/fixtures/random.h"
#include "tests/fixtures/solids.h"
#include "tests/fixtures/tool_scene.h"
#include "tests/heap_calls.h"

/* ---- bodies ---- */

/* a slab of springs (0), of implicit elements (1), a block of control cells (2); 4 x 4 x 2 cm or 4 cm */
static bool open_body(tool_scene *s, pal_cells *cells, int which, bool fixed)
{
    if (which < 2) {
        if (!slab_scene(s, 4, 4, 2, 0.01, 2, 0.008, 15)) return false;
        s->scene->body[0].n_support = fixed;
        if (which == 1) pal_entry_init(&s->scene->body[0].model, "model", "fem");
        return tool_scene_open(s);
    }
    pal_surface surface = {0};
    memset(s, 0, sizeof *s);
    *cells = solid_bricks(2, 2, 2, 0.02, 0.02, 0.02);
    s->scene = calloc(1, sizeof *s->scene);
    if (!s->scene || pal_cells_boundary(cells, &surface, NULL, NULL) || pal_prepared_surface(&surface, &s->mesh))
        abort();
    pal_surface_free(&surface);
    pal_scene_default(s->scene);
    s->scene->n_body = 1;
    pal_tools_default(s->scene, 2);
    pal_body_default_cells(&s->scene->body[0], "clay", &s->mesh, cells);
    s->scene->body[0].n_effect = 0;
    s->scene->body[0].n_support = fixed;
    pal_entry_put_number(&s->scene->body[0].model, "levels", 1, NULL);
    s->skinned = true;
    return tool_scene_open(s);
}

static void close_body(tool_scene *s, pal_cells *cells, int which)
{
    tool_scene_close(s);
    if (which == 2) pal_cells_free(cells);
}

/* where the shown surface reaches farthest along z, at x = y = 0 or the middle of the slab */
static void top_of(const pal_body *body, double out[3])
{
    double low[3], high[3];
    pal_surface_box(body->display.surface, low, high);
    pal_set3(out, 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), high[2]);
}

static pal_brush everywhere(double pressure_Pa)
{
    return (pal_brush){.kind = PAL_BRUSH_INFLATE, .radius_m = 10, .softness = 0, .pressure_Pa = pressure_Pa};
}

static pal_brush handle(const pal_body *body, double lift_m)
{
    pal_brush b = {.kind = PAL_BRUSH_CURVE, .radius_m = 0.012, .softness = 0.5, .stiffness_N_m = 20};
    top_of(body, b.at_m);
    pal_copy3(b.to_m, b.at_m);
    b.at_m[0] -= 0.018, b.to_m[0] += 0.018;
    b.lift_m[2] = lift_m;
    return b;
}

static const pal_component *brush_row(const pal_world *world)
{
    for (int i = 0; i < pal_world_component_count(world); i++)
        if (!strcmp(pal_world_component(world, i)->effect->name, "brush")) return pal_world_component(world, i);
    return NULL;
}

/* the row's forces alone, its n-th step */
static void forces(tool_scene *s, int n_step)
{
    const pal_component *row = brush_row(s->world);
    for (int i = 0; i < n_step; i++) {
        pal_step step = {.body = s->body, .dt_s = 1.0 / 60, .n_sub = 1};
        memset(s->body->load, 0, 3 * sizeof(double) * (size_t)s->body->n_node);
        if (row->effect->run(row->self, &step)) abort();
    }
}

/* points at random, up to far_m off */
static void crumple(tool_scene *s, double far_m)
{
    uint64_t seed = 5;
    for (int i = 0; i < 3 * s->body->n_dof; i++) {
        s->body->x[i] = s->body->x_rest[i] + far_m * random_signed(&seed);
    }
    pal_world_invalidate_limits(s->world, 0);
}

/* ---- what must hold ---- */

static void an_even_pressure_on_a_closed_surface_has_no_net_force(void)
{
    for (int which = 0; which < 3; which++) {
        tool_scene s;
        pal_cells cells;
        REQUIRE(open_body(&s, &cells, which, false));
        crumple(&s, 0.002);
        const pal_brush b = everywhere(700);
        REQUIRE(!pal_world_brush(s.world, 0, 0, &b, NULL));
        forces(&s, 10);
        double force[3] = {0}, moment[3] = {0}, size = 0, work = 0, six = 0;
        for (int i = 0; i < s.body->n_node; i++) {
            const double *f = s.body->load + 3 * i, *d = s.body->d + 3 * i;
            double m[3];
            pal_cross3(m, d, f);
            pal_add3(force, force, f);
            pal_add3(moment, moment, m);
            size += pal_norm3(f), work += pal_dot3(d, f);
        }
        CHECK(size > 0.1);
        CHECK_NEAR(pal_norm3(force) / size, 0, 1e-12);
        CHECK_NEAR(pal_norm3(moment) / size, 0, 1e-12);
        /* sum x . f = 3 p V (divergence theorem) */
        for (int t = 0; t < s.body->display.surface->n_tri; t++) {
            const double *x[3];
            double n[3];
            for (int c = 0; c < 3; c++)
                x[c] = s.body->d + 3 * s.body->display.shown_node[s.body->display.surface->tri[3 * t + c]];
            pal_cross3(n, x[1], x[2]);
            six += pal_dot3(x[0], n);
        }
        CHECK_NEAR(work / (3 * 700 * six / 6), 1, 1e-12);
        close_body(&s, &cells, which);
    }
}

/* what is blown up pushes with its area up to twice that at rest, and with twice of it from there on */
static void pressure_does_not_grow_with_what_it_blows_up_for_ever(void)
{
    static const double times[] = {1, 1.3, 1.6, 10};
    for (int which = 0; which < 3; which++) {
        tool_scene s;
        pal_cells cells;
        REQUIRE(open_body(&s, &cells, which, false));
        const pal_brush b = everywhere(500);
        REQUIRE(!pal_world_brush(s.world, 0, 0, &b, NULL));
        double rest_N = 0;
        for (int k = 0; k < 4; k++) {
            double sum_N = 0;
            for (int i = 0; i < 3 * s.body->n_dof; i++) s.body->x[i] = times[k] * s.body->x_rest[i];
            pal_body_update_nodes(s.body);
            forces(&s, 10);
            for (int i = 0; i < s.body->n_node; i++) sum_N += pal_norm3(s.body->load + 3 * (size_t)i);
            if (k == 0) rest_N = sum_N;
            CHECK_NEAR(sum_N / rest_N, fmin(2, times[k] * times[k]), 1e-9);
        }
        close_body(&s, &cells, which);
    }
}

/* implicit or of control cells: a node bears 10 E h^2, and of that its mass over that of a whole corner */
static void a_small_node_bears_less_of_a_lasting_load_whatever_the_solver(void)
{
    for (int which = 0; which < 3; which++) {
        tool_scene s;
        pal_cells cells;
        REQUIRE(open_body(&s, &cells, which, true));
        const pal_material *m = &s.scene->body[0].material;
        const double h = s.body->edge_m, full_corner_kg = m->density_kg_m3 * h * h * h / 8;
        int thin = 0;
        for (int i = 0; i < s.body->n_node; i++)
            if (s.body->node_mass_kg[i] < s.body->node_mass_kg[thin]) thin = i;
        const double part = s.body->node_mass_kg[thin] / full_corner_kg;
        REQUIRE(!pal_world_load(s.world, 0, thin, (const double[3]){0, 0, 1e6}));
        REQUIRE(!pal_world_step(s.world, 1e-4));
        printf("  body %d: %.3g of a corner\n", which, part);
        CHECK_NEAR(s.body->load[3 * thin + 2], fmin(1, part) * 10 * m->young_Pa * h * h, 1e-9 * s.body->load_cap_N);
        CHECK(which == 1 || part < 0.9);
        close_body(&s, &cells, which);
    }
}

static void a_soft_brush_pushes_only_what_it_reaches_along_the_normals(void)
{
    tool_scene s;
    REQUIRE(open_body(&s, NULL, 0, true));
    pal_brush b = {.kind = PAL_BRUSH_INFLATE, .radius_m = 0.012, .softness = 1, .pressure_Pa = 1000};
    top_of(s.body, b.at_m);
    REQUIRE(!pal_world_brush(s.world, 0, 1, &b, NULL));
    forces(&s, 10);
    double sum[3], wanted = 0;
    sum_loads(s.body, sum);
    for (int t = 0; t < s.body->display.surface->n_tri; t++) {
        double middle[3] = {0, 0, 0}, p[3], q[3], n[3];
        const int32_t *tri = s.body->display.surface->tri + 3 * t;
        for (int c = 0; c < 3; c++) pal_axpy3(middle, 1.0 / 3, s.body->display.surface->x + 3 * tri[c]);
        pal_stroke stroke = {.radius_m = 0.012, .softness = 1};
        pal_copy3(stroke.at_m, b.at_m);
        pal_sub3(p, s.body->display.surface->x + 3 * tri[1], s.body->display.surface->x + 3 * tri[0]);
        pal_sub3(q, s.body->display.surface->x + 3 * tri[2], s.body->display.surface->x + 3 * tri[0]);
        pal_cross3(n, p, q);
        wanted += 1000 * pal_stroke_weight(&stroke, middle) * 0.5 * n[2];
    }
    CHECK(wanted > 0.01);
    CHECK_NEAR(sum[2] / wanted, 1, 1e-12);
    CHECK_NEAR(fabs(sum[0]) + fabs(sum[1]), 0, 1e-15);
    for (int i = 0; i < s.body->n_node; i++)
        if (pal_dist3(s.body->x_rest + 3 * i, b.at_m) > 0.012 + 0.0142) CHECK(s.body->load[3 * i + 2] == 0);
    tool_scene_close(&s);
}

/* f = -grad E by differences, and the handle's stiffness is what was asked for */
static void a_handle_is_a_spring_of_its_stiffness(void)
{
    for (int which = 0; which < 3; which += 2) {
        tool_scene s;
        pal_cells cells;
        REQUIRE(open_body(&s, &cells, which, true));
        const pal_brush b = handle(s.body, 0.005);
        REQUIRE(!pal_world_brush(s.world, 0, 0, &b, NULL));
        const pal_component *row = brush_row(s.world);
        REQUIRE(row != NULL);
        forces(&s, 10);
        /* 4 t (1 - t) of the lift at each node: at most all of it, and nothing sideways */
        double before[3], after[3], max = 0;
        sum_loads(s.body, before);
        CHECK(before[2] > 0.2 * 20 * 0.005 && before[2] < 20 * 0.005);
        CHECK_NEAR(fabs(before[0]) + fabs(before[1]), 0, 1e-16);
        crumple(&s, 0.001);
        forces(&s, 1);
        for (int i = 0; i < 3 * s.body->n_node; i++) {
            double *d = &s.body->d[i], was = *d, h = 1e-6, e[2], f = s.body->load[i];
            for (int k = 0; k < 2; k++) *d = was + (k ? h : -h), e[k] = row->effect->energy(row->self, s.body);
            *d = was;
            max = fmax(max, fabs(f));
            CHECK_NEAR(f, -(e[1] - e[0]) / (2 * h), 1e-8);
        }
        CHECK(max > 1e-4);
        /* all nodes moved alike */
        sum_loads(s.body, before);
        for (int i = 0; i < s.body->n_node; i++) s.body->d[3 * i + 1] += 0.001;
        forces(&s, 1);
        sum_loads(s.body, after);
        CHECK_NEAR((before[1] - after[1]) / 0.001, 20, 1e-9);
        /* tangent: the same stiffness, node by node and in the bound */
        size_t n = (size_t)s.body->n_node;
        double *p = calloc(3 * n, sizeof *p), *q = calloc(3 * n, sizeof *q), *bound = calloc(n, sizeof *bound), sum = 0;
        for (size_t i = 0; i < n; i++) p[3 * i + 1] = 1;
        row->effect->tangent->multiply(row->self, s.body, 1, p, q);
        row->effect->bounds.stiffness(row->self, s.body, bound);
        for (size_t i = 0; i < n; i++) {
            sum += q[3 * i + 1];
            CHECK_NEAR(bound[i], q[3 * i + 1], 1e-12);
        }
        CHECK_NEAR(sum, 20, 1e-9);
        free(p), free(q), free(bound);
        close_body(&s, &cells, which);
    }
}

/* ten steps of 1/60 s, in and out; a change of pressure as well */
static void forces_are_blended_over_a_sixth_of_a_second(void)
{
    tool_scene s;
    double sum[3];
    REQUIRE(open_body(&s, NULL, 0, true));
    pal_brush b = everywhere(100);
    top_of(s.body, b.at_m);
    b.radius_m = 0.01;
    REQUIRE(!pal_world_brush(s.world, 0, 0, &b, NULL));
    forces(&s, 10);
    sum_loads(s.body, sum);
    const double full = sum[2];
    CHECK(full > 0);
    b.pressure_Pa = -100;
    REQUIRE(!pal_world_brush(s.world, 0, 0, &b, NULL));
    for (int i = 1; i <= 12; i++) {
        forces(&s, 1);
        sum_loads(s.body, sum);
        CHECK_NEAR(sum[2] / full, i > 10 ? -1 : 1 - 0.2 * i, 1e-12);
    }
    REQUIRE(!pal_world_brush(s.world, 0, 0, NULL, NULL));
    for (int i = 1; i <= 10; i++) {
        pal_world_remove_idle(s.world);
        REQUIRE(brush_row(s.world) != NULL);
        forces(&s, 1);
        sum_loads(s.body, sum);
        CHECK_NEAR(sum[2] / full, -1 + 0.1 * i, 1e-12);
    }
    pal_world_remove_idle(s.world);
    CHECK(brush_row(s.world) == NULL);
    REQUIRE(!pal_world_brush(s.world, 0, 0, &b, NULL));
    for (int i = 1; i <= 12; i++) {
        forces(&s, 1);
        sum_loads(s.body, sum);
        CHECK_NEAR(sum[2] / full, i > 10 ? -1 : -0.1 * i, 1e-12);
    }
    tool_scene_close(&s);
}

static void rows_come_with_the_first_brush_and_go_with_the_last(void)
{
    for (int which = 0; which < 3; which++) {
        tool_scene s, quiet;
        pal_cells cells, other;
        REQUIRE(open_body(&s, &cells, which, true) && open_body(&quiet, &other, which, true));
        const int rows = pal_world_component_count(s.world);
        const size_t n_byte = pal_world_bytes(s.world);
        pal_brush b = everywhere(50), c = handle(s.body, 0.003);
        REQUIRE(!pal_world_brush(s.world, 0, 0, &b, NULL) && !pal_world_brush(s.world, 0, 1, &c, NULL));
        CHECK_INT(pal_world_component_count(s.world), rows + 1);
        CHECK(pal_world_bytes(s.world) > n_byte);
        const long heap = n_heap_call;
        for (int i = 0; i < 20; i++) CHECK_INT(pal_world_step(s.world, 1.0 / 60), 0);
        /* letting a tool go ends its brush */
        REQUIRE(!pal_world_pose(s.world, 1, NULL));
        for (int i = 0; i < 12; i++) CHECK_INT(pal_world_step(s.world, 1.0 / 60), 0);
        CHECK_INT(n_heap_call, heap);
        pal_world_remove_idle(s.world);
        CHECK_INT(pal_world_component_count(s.world), rows + 1);
        REQUIRE(!pal_world_brush(s.world, 0, 0, NULL, NULL));
        for (int i = 0; i < 10; i++) CHECK_INT(pal_world_step(s.world, 1.0 / 60), 0);
        pal_world_remove_idle(s.world);
        CHECK_INT(pal_world_component_count(s.world), rows);
        CHECK_INT(pal_world_bytes(s.world), n_byte);
        CHECK(pal_world_hash(s.world) != pal_world_hash(quiet.world));
        /* a reset ends all at once; then the world is as any other */
        REQUIRE(!pal_world_brush(s.world, 0, 0, &b, NULL));
        CHECK_INT(pal_world_step(s.world, 1.0 / 60), 0);
        pal_world_reset(s.world), pal_world_reset(quiet.world);
        pal_world_remove_idle(s.world);
        CHECK_INT(pal_world_component_count(s.world), rows);
        for (int i = 0; i < 10; i++)
            CHECK(!pal_world_step(s.world, 1.0 / 60) && !pal_world_step(quiet.world, 1.0 / 60));
        CHECK(pal_world_hash(s.world) == pal_world_hash(quiet.world));
        close_body(&s, &cells, which);
        close_body(&quiet, &other, which);
    }
}

static void run_tidy(tool_scene *s, int n)
{
    for (int i = 0; i < n; i++) {
        CHECK_INT(pal_world_step(s->world, 1.0 / 60), 0);
        pal_world_remove_idle(s->world);
    }
}

/* the middle of the handle rises by some of its lift on every model, the same at each solver's repetition */
static void a_curve_lifts_what_it_holds(void)
{
    for (int which = 0; which < 3; which++) {
        uint64_t hash[2];
        double rise = 0, blown = 0;
        for (int turn = 0; turn < 2; turn++) {
            tool_scene s;
            pal_cells cells;
            REQUIRE(open_body(&s, &cells, which, true));
            pal_brush b = handle(s.body, 0.006), all = everywhere(300);
            b.stiffness_N_m = 150;
            double top[3], low[3], high[3];
            top_of(s.body, top);
            REQUIRE(!pal_world_brush(s.world, 0, 0, &b, NULL));
            run_tidy(&s, 60);
            int near = 0;
            for (int i = 0; i < s.body->display.n_shown; i++) {
                const double *r = s.body->node_rest + 3 * s.body->display.shown_node[i];
                const double *best = s.body->node_rest + 3 * s.body->display.shown_node[near];
                if (pal_dist3(r, top) < pal_dist3(best, top)) near = i;
            }
            rise = s.body->d[3 * s.body->display.shown_node[near] + 2] -
                   s.body->node_rest[3 * s.body->display.shown_node[near] + 2];
            REQUIRE(!pal_world_brush(s.world, 0, 0, NULL, NULL) && !pal_world_brush(s.world, 0, 1, &all, NULL));
            run_tidy(&s, 60);
            pal_surface_box(s.body->display.surface, low, high);
            blown = 0;
            for (int i = 0; i < s.body->display.n_shown; i++)
                blown = fmax(blown, s.body->d[3 * s.body->display.shown_node[i] + 2] - high[2]);
            hash[turn] = pal_world_hash(s.world);
            CHECK(!s.body->frozen);
            close_body(&s, &cells, which);
        }
        CHECK(hash[0] == hash[1]);
        if (!(rise > 0.0005 && rise < 0.006)) CHECK_FAIL("model %d: rises by %g", which, rise);
        if (!(blown > 0.0001 && blown < 0.02)) CHECK_FAIL("model %d: blown up by %g", which, blown);
    }
}

static void expect(tool_scene *s, int body, int slot, pal_brush b, const char *sentence)
{
    pal_diagnostic diag = {""};
    CHECK_INT(pal_world_brush(s->world, body, slot, &b, &diag), PAL_ERR_REFUSED);
    if (!strstr(diag.text, sentence)) CHECK_FAIL("\"%s\" does not say \"%s\"", diag.text, sentence);
}

static void what_cannot_be_is_refused_and_changes_nothing(void)
{
    tool_scene s, ball;
    REQUIRE(open_body(&s, NULL, 0, true));
    const int rows = pal_world_component_count(s.world);
    const size_t n_byte = pal_world_bytes(s.world);
    pal_brush good = handle(s.body, 0.004), b;
    expect(&s, 1, 0, good, "body 1 does not exist");
    expect(&s, 0, PAL_TOOL_MAX, good, "tool ");
    expect(&s, 0, -1, good, "tool -1 does not exist");
    b = good, b.kind = (pal_brush_kind)9, expect(&s, 0, 0, b, "there is no kind 9");
    b = good, b.radius_m = 0, expect(&s, 0, 0, b, "radius_m 0, wanted");
    b = good, b.radius_m = NAN, expect(&s, 0, 0, b, "radius_m nan");
    b = good, b.at_m[1] = NAN, expect(&s, 0, 0, b, "is no number");
    b = good, b.lift_m[1] = INFINITY, expect(&s, 0, 0, b, "is no number");
    b = good, b.softness = 1.5, expect(&s, 0, 0, b, "softness 1.5, wanted 0 to 1");
    b = good, b.stiffness_N_m = 0, expect(&s, 0, 0, b, "stiffness_N_m 0, wanted");
    b = good, b.stiffness_N_m = 1e8, expect(&s, 0, 0, b, "takes up to");
    b = good, b.lift_m[0] = 5, expect(&s, 0, 0, b, "lift_m of 5 m");
    b = good, pal_copy3(b.to_m, b.at_m), expect(&s, 0, 0, b, "both ends");
    b = good, b.at_m[2] += 1, b.to_m[2] += 1, expect(&s, 0, 0, b, "within radius_m");
    b = everywhere(NAN), expect(&s, 0, 0, b, "pressure_Pa nan");
    b = everywhere(6e4), expect(&s, 0, 0, b, "pressure_Pa 60000, body \"body\" takes up to 5e+04");
    b = everywhere(-6e4), expect(&s, 0, 0, b, "pressure_Pa -60000");
    b = everywhere(1), b.at_m[0] = 50, expect(&s, 0, 0, b, "within radius_m 10 of it");
    CHECK_INT(pal_world_component_count(s.world), rows);
    CHECK_INT(pal_world_bytes(s.world), n_byte);
    /* one that is there stays as it is */
    REQUIRE(!pal_world_brush(s.world, 0, 0, &good, NULL));
    forces(&s, 10);
    double before[3], after[3];
    sum_loads(s.body, before);
    b = good, b.radius_m = -1, expect(&s, 0, 0, b, "radius_m -1");
    b = good, b.at_m[2] += 1, b.to_m[2] += 1, expect(&s, 0, 0, b, "within radius_m");
    forces(&s, 1);
    sum_loads(s.body, after);
    CHECK(before[2] == after[2] && before[2] > 0);
    tool_scene_close(&s);
    REQUIRE(ball_scene(&ball, 6, true, 1, 0.01, 15) && tool_scene_open(&ball));
    expect(&ball, 0, 0, everywhere(10), "body \"body\" has no brushes: it is shown by a skin");
    tool_scene_close(&ball);
}

/* the hardest that is let in: the body may be crushed or torn, and stays a body of numbers */
static void the_hardest_hands_leave_numbers(void)
{
    for (int which = 0; which < 3; which++)
        for (int kind = 0; kind < 2; kind++) {
            tool_scene s;
            pal_cells cells;
            pal_diagnostic diag = {""};
            REQUIRE(open_body(&s, &cells, which, true));
            pal_brush b = handle(s.body, kind ? 10 * s.body->length_scale_m : 0);
            if (kind)
                b.stiffness_N_m = 0.5 * s.body->load_cap_N / s.body->edge_m;
            else
                b = everywhere(0.99 * s.body->load_cap_N / (s.body->edge_m * s.body->edge_m));
            if (pal_world_brush(s.world, 0, 0, &b, &diag)) CHECK_FAIL("%s", diag.text);
            for (int i = 0; i < 15; i++) {
                pal_err err = pal_world_step(s.world, 1.0 / 60);
                CHECK(err == PAL_ERR_OK || err == PAL_ERR_FROZEN);
            }
            CHECK(pal_body_finite(s.body) || s.body->frozen);
            close_body(&s, &cells, which);
        }
}

int main(void)
{
    counting = true;
    RUN(an_even_pressure_on_a_closed_surface_has_no_net_force);
    RUN(pressure_does_not_grow_with_what_it_blows_up_for_ever);
    RUN(a_small_node_bears_less_of_a_lasting_load_whatever_the_solver);
    RUN(a_soft_brush_pushes_only_what_it_reaches_along_the_normals);
    RUN(a_handle_is_a_spring_of_its_stiffness);
    RUN(forces_are_blended_over_a_sixth_of_a_second);
    RUN(rows_come_with_the_first_brush_and_go_with_the_last);
    RUN(a_curve_lifts_what_it_holds);
    RUN(what_cannot_be_is_refused_and_changes_nothing);
    RUN(the_hardest_hands_leave_numbers);
    return check_report();
}
