/* Fields in colour: rows that come and go in a running world, their values, their rate; nothing where nobody looks. */
#include "server/sim/core/effect_list.h"
#include "server/sim/elements/elastic_law.h"
#include "tests/fixtures/solids.h"
#include "tests/fixtures/tool_scene.h"
#include "tests/heap_calls.h"

/* ---- a row that can measure: the first FORCE row of a body is given a `measure` of the test's own ---- */

static double (*fake_value)(const double x[3]);
static pal_effect fake;

static void fake_measure(void *self, const pal_body *body, pal_field field, double *sum, double *volume_m3)
{
    (void)self;
    const pal_tets *tets = body->tets;
    double factor = field == PAL_FIELD_ENERGY_J_M3 ? 1 : 10;
    for (int t = 0; t < tets->n_tet; t++)
        for (int k = 0; k < 4; k++) {
            int node = tets->tet[4 * t + k];
            sum[node] += 1e-6 * factor * fake_value(body->x_rest + 3 * (size_t)node);
            volume_m3[node] += 1e-6;
        }
}

static void make_measurable(pal_world *world, double (*value)(const double x[3]))
{
    for (int i = 0; i < pal_world_component_count(world); i++) {
        pal_component *row = (pal_component *)(uintptr_t)pal_world_component(world, i);
        if (row->effect->stage != PAL_STAGE_FORCE) continue;
        fake = *row->effect;
        fake.inspect.measure = fake_measure;
        fake.inspect.fields |= 1u << PAL_FIELD_VON_MISES_PA | 1u << PAL_FIELD_ENERGY_J_M3;
        row->effect = &fake;
        fake_value = value;
        return;
    }
}

static double seven(const double x[3])
{
    (void)x;
    return 7;
}

static double slope(const double x[3])
{
    return 3 + 20 * x[0] - 10 * x[2];
}

static int rows_named(const pal_world *world, const char *name)
{
    int n = 0;
    for (int i = 0; i < pal_world_component_count(world); i++) {
        pal_component_info row;
        pal_world_component_info(world, i, &row);
        n += !strcmp(row.name, name);
    }
    return n;
}

/* ---- what must hold ---- */

static void press(tool_scene *s, int tick)
{
    move_tool(s, 0, 0.02, 0.02, 0.06 - 0.0006 * tick, false);
}

static void nobody_looks_nothing_is_there_and_looking_changes_no_bit(void)
{
    tool_scene a, b;
    REQUIRE(slab_scene(&a, 4, 4, 3, 0.01, 1, 0.008, 15) && tool_scene_open(&a));
    REQUIRE(slab_scene(&b, 4, 4, 3, 0.01, 1, 0.008, 15) && tool_scene_open(&b));
    make_measurable(b.world, seven);
    pal_diagnostic diag = {""};
    int rows = pal_world_component_count(a.world);
    size_t n_byte = pal_world_bytes(a.world);
    CHECK_INT(rows_named(a.world, "field_output"), 0);
    CHECK_INT(pal_world_component_count(b.world), rows);
    CHECK_INT(pal_world_bytes(b.world), n_byte);
    for (int i = 0; i < 60; i++) {
        if (i == 5) {
            for (int k = 1; k < PAL_FIELD_COUNT; k++)
                CHECK_INT(pal_world_field(b.world, 0, (pal_field)k, true, &diag),
                          pal_world_has_field(b.world, 0, (pal_field)k) ? 0 : PAL_ERR_REFUSED);
            CHECK_INT(pal_world_component_count(b.world), rows + 8);
            CHECK_INT(rows_named(b.world, "field_output"), 8);
            CHECK(pal_world_bytes(b.world) > n_byte);
            CHECK(b.body->display.field[PAL_FIELD_VON_MISES_PA] &&
                  b.body->display.field[PAL_FIELD_VON_MISES_PA]->revision > 0);
        }
        /* out in another order than in, twice */
        if (i == 20) CHECK_INT(pal_world_field(b.world, 0, PAL_FIELD_VON_MISES_PA, false, &diag), 0);
        if (i == 25) CHECK_INT(pal_world_field(b.world, 0, PAL_FIELD_DISPLACEMENT_M, false, &diag), 0);
        if (i == 25) CHECK_INT(pal_world_field(b.world, 0, PAL_FIELD_DISPLACEMENT_M, false, &diag), 0);
        if (i == 25) CHECK_INT(pal_world_component_count(b.world), rows + 6);
        if (i == 30) CHECK_INT(pal_world_field(b.world, 0, PAL_FIELD_STIFFNESS_J, false, &diag), 0);
        if (i == 40) {
            CHECK_INT(pal_world_field(b.world, 0, PAL_FIELD_ENERGY_J_M3, false, &diag), 0);
            CHECK_INT(pal_world_field(b.world, 0, PAL_FIELD_DISTORTION, false, &diag), 0);
            CHECK_INT(pal_world_field(b.world, 0, PAL_FIELD_STRAIN, false, &diag), 0);
            CHECK_INT(pal_world_field(b.world, 0, PAL_FIELD_DENSITY_KG_M3, false, &diag), 0);
            CHECK_INT(pal_world_field(b.world, 0, PAL_FIELD_DAMPING_1_S, false, &diag), 0);
        }
        press(&a, i), press(&b, i);
        CHECK(step_world(&a, 1) && step_world(&b, 1));
        CHECK(pal_world_hash(a.world) == pal_world_hash(b.world));
    }
    CHECK_INT(pal_world_component_count(b.world), rows);
    CHECK_INT(pal_world_bytes(b.world), n_byte);
    for (int k = 0; k < PAL_FIELD_COUNT; k++) CHECK(b.body->display.field[k] == NULL);
    for (int i = 0; i < rows; i++) CHECK(pal_world_component(b.world, i)->effect->stage < PAL_STAGE_COUNT);
    /* a world that is destroyed while somebody looks loses nothing (leak check of the sanitizers) */
    CHECK_INT(pal_world_field(a.world, 0, PAL_FIELD_DISPLACEMENT_M, true, &diag), 0);
    tool_scene_close(&a);
    tool_scene_close(&b);
}

static void displacement_is_the_distance_from_rest(void)
{
    tool_scene s;
    const double c = cos(0.4), n = sin(0.4), turn[9] = {c, -n, 0, n, c, 0, 0, 0, 1};
    REQUIRE(ball_scene(&s, 8, false, 1, 0.01, 15) && tool_scene_open(&s));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, true, NULL));
    const pal_shown_field *field = s.body->display.field[PAL_FIELD_DISPLACEMENT_M];
    for (int i = 0; i < s.body->display.n_shown; i++) CHECK_LE((double)field->value[i], 1e-7);
    for (int i = 0; i < s.body->n_dof; i++) pal_mul33(s.body->x + 3 * (size_t)i, turn, s.body->x_rest + 3 * (size_t)i);
    for (int k = 0; k < 8; k++) CHECK_INT(pal_world_step(s.world, 1.0 / 60), 0);
    /* turned by 0.4 rad about z, a point moves by 2 sin(0.2) times its distance from the axis */
    double worst = 0;
    for (int i = 0; i < s.body->display.n_shown; i++) {
        const double *x = s.mesh.surface.x + 3 * (size_t)i;
        worst = fmax(worst, fabs((double)field->value[i] - 2 * sin(0.2) * hypot(x[0], x[1])));
    }
    CHECK_LE(worst, 2e-5);
    tool_scene_close(&s);
}

static void measured_values_are_nodal_means_spread_by_the_skin(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, false, 1, 0.01, 15) && tool_scene_open(&s));
    make_measurable(s.world, seven);
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_VON_MISES_PA, true, NULL));
    for (int i = 0; i < s.body->display.n_shown; i++) {
        CHECK_NEAR((double)s.body->display.field[PAL_FIELD_ENERGY_J_M3]->value[i], 7, 1e-5);
        CHECK_NEAR((double)s.body->display.field[PAL_FIELD_VON_MISES_PA]->value[i], 70, 1e-4);
    }
    /* a slope in space is followed to within the reach of a vertex's five nodes */
    fake_value = slope;
    pal_world_reset(s.world);
    double worst = 0;
    for (int i = 0; i < s.body->display.n_shown; i++)
        worst = fmax(worst, fabs((double)s.body->display.field[PAL_FIELD_ENERGY_J_M3]->value[i] -
                                 slope(s.mesh.surface.x + 3 * (size_t)i)));
    CHECK(worst > 1e-6);
    CHECK_LE(worst, 2 * s.body->edge_m * 30);
    tool_scene_close(&s);

    /* shown nodes have their own value exactly */
    REQUIRE(slab_scene(&s, 4, 3, 2, 0.01, 1, 0.01, 15) && tool_scene_open(&s));
    make_measurable(s.world, slope);
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
    for (int i = 0; i < s.body->display.n_shown; i++)
        CHECK_NEAR((double)s.body->display.field[PAL_FIELD_ENERGY_J_M3]->value[i],
                   slope(s.body->x_rest + 3 * (size_t)s.body->display.shown_node[i]), 1e-6);
    tool_scene_close(&s);
}

static double not_a_number(const double x[3])
{
    return x[0] > 0.025 ? NAN : x[0] > 0.015 ? 1e300 : 2;
}

static void a_value_that_is_no_number_shows_as_zero(void)
{
    tool_scene s;
    REQUIRE(slab_scene(&s, 4, 3, 2, 0.01, 1, 0.01, 15) && tool_scene_open(&s));
    make_measurable(s.world, not_a_number);
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
    for (int i = 0; i < s.body->display.n_shown; i++) {
        bool good = s.body->x_rest[3 * (size_t)s.body->display.shown_node[i]] < 0.015;
        CHECK_NEAR((double)s.body->display.field[PAL_FIELD_ENERGY_J_M3]->value[i], good ? 2 : 0, 1e-6);
    }
    tool_scene_close(&s);
}

static void values_are_taken_ten_times_a_second_without_heap_and_at_once_after_reset(void)
{
    tool_scene s;
    REQUIRE(slab_scene(&s, 4, 4, 3, 0.01, 1, 0.008, 15) && tool_scene_open(&s));
    make_measurable(s.world, seven);
    pal_frame *frame = pal_frame_create(s.world);
    REQUIRE(frame && !pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, true, NULL) && !pal_frame_fit(frame, s.world));
    const pal_shown_field *field = s.body->display.field[PAL_FIELD_ENERGY_J_M3];
    uint64_t seen = field->revision;
    int n_new = 0;
    long heap = n_heap_call;
    for (int i = 0; i < 120; i++) {
        press(&s, i / 2);
        if (pal_world_step(s.world, 1.0 / 60)) break;
        n_new += field->revision != seen;
        seen = field->revision;
        (void)pal_frame_fit(frame, s.world);
        pal_world_frame(s.world, frame);
    }
    CHECK_INT(n_heap_call, heap);
    CHECK_INT(n_new, 20);
    CHECK_NEAR(field->time_s, 2, 1e-9);
    const float *moved = s.body->display.field[PAL_FIELD_DISPLACEMENT_M]->value;
    double max = 0;
    for (int i = 0; i < s.body->display.n_shown; i++) max = fmax(max, (double)moved[i]);
    CHECK(max > 1e-3);
    pal_world_reset(s.world);
    CHECK(field->revision != seen);
    for (int i = 0; i < s.body->display.n_shown; i++) CHECK_LE((double)moved[i], 1e-8);
    pal_frame_destroy(frame);
    tool_scene_close(&s);
}

static void frames_have_room_for_a_field_while_its_row_is_there(void)
{
    tool_scene s;
    REQUIRE(ball_scene(&s, 8, true, 1, 0.01, 15) && tool_scene_open(&s));
    pal_frame *frame = pal_frame_create(s.world), *other = pal_frame_create(s.world);
    REQUIRE(frame && other);
    pal_frame_field *in = &frame->part[0].field[PAL_FIELD_DISPLACEMENT_M];
    long heap = n_heap_call;
    CHECK_INT(pal_frame_fit(frame, s.world), 0);
    CHECK_INT(n_heap_call, heap);
    CHECK(in->value == NULL);
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, true, NULL));
    pal_world_frame(s.world, frame); /* no room yet: nothing is written */
    CHECK(in->value == NULL);
    CHECK_INT(frame->n_row, pal_world_component_count(s.world));
    CHECK_TEXT(frame->component_name[frame->n_row - 1], "field_output");
    CHECK_INT(pal_frame_fit(frame, s.world), 0);
    for (int i = 0; i < 40; i++) {
        move_tool(&s, 0, 0, 0.01, 0.06 - 0.0004 * i, false);
        REQUIRE(step_world(&s, 1));
        pal_world_frame(s.world, frame);
    }
    const pal_shown_field *field = s.body->display.field[PAL_FIELD_DISPLACEMENT_M];
    REQUIRE(in->value);
    CHECK_INT(in->revision, field->revision);
    CHECK_NEAR(in->time_s, field->time_s, 0);
    CHECK(memcmp(in->value, field->value, sizeof(float) * (size_t)s.body->display.n_shown) == 0);
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, false, NULL));
    CHECK_INT(pal_frame_fit(frame, s.world), 0);
    CHECK(in->value == NULL && in->revision == 0);
    pal_world_frame(s.world, frame);
    CHECK_INT(frame->n_row, pal_world_component_count(s.world));
    /* another row of the same field does not pass for the one before */
    uint64_t last = field ? s.body->display.field_revision : 0;
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, true, NULL));
    CHECK(s.body->display.field[PAL_FIELD_DISPLACEMENT_M]->revision > last);
    pal_frame_destroy(frame);
    pal_frame_destroy(other);
    tool_scene_close(&s);
}

static void refuses_what_the_model_does_not_give_with_a_sentence(void)
{
    tool_scene s;
    pal_diagnostic diag = {""};
    REQUIRE(slab_scene(&s, 2, 2, 2, 0.01, 1, 0.01, 15) && tool_scene_open(&s));
    size_t n_byte = pal_world_bytes(s.world);
    CHECK(pal_world_has_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M));
    CHECK(!pal_world_has_field(s.world, 0, PAL_FIELD_VON_MISES_PA));
    CHECK(!pal_world_has_field(s.world, 1, PAL_FIELD_DISPLACEMENT_M));
    CHECK(pal_world_has_field(s.world, 0, PAL_FIELD_STIFFNESS_J));
    CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_VON_MISES_PA, true, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "\"body\"") && strstr(diag.text, "von Mises stress"));
    CHECK_INT(pal_world_field(s.world, 3, PAL_FIELD_DISPLACEMENT_M, true, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "3") != NULL);
    CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_NONE, true, &diag), PAL_ERR_REFUSED);
    CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_COUNT, true, &diag), PAL_ERR_REFUSED);
    CHECK_INT(pal_world_bytes(s.world), n_byte);
    tool_scene_close(&s);
}

/* what slices are made of: a displacement that is linear in space is that at every node, and its strain everywhere */
static void nodes_inside_have_the_linear_displacement_and_its_strain(void)
{
    static const double f[9] = {1.05, 0.1, 0, 0, 0.97, 0, 0, 0, 1.02};
    tool_scene s;
    REQUIRE(slab_scene(&s, 4, 3, 2, 0.01, 1, 0.01, 15) && tool_scene_open(&s));
    pal_shown shown;
    pal_world_shown(s.world, 0, &shown);
    CHECK_INT(shown.n_tet, s.mesh.tets.n_tet);
    CHECK_INT(shown.n_node, s.body->n_node);
    for (int i = 0; i < s.body->n_dof; i++) pal_mul33(s.body->x + 3 * (size_t)i, f, s.body->x_rest + 3 * (size_t)i);
    pal_frame *frame = pal_frame_create(s.world);
    REQUIRE(frame && !pal_world_field(s.world, 0, PAL_FIELD_STRAIN, true, NULL));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, true, NULL) && !pal_frame_fit(frame, s.world));
    pal_world_frame(s.world, frame);
    const float *strain = frame->part[0].field[PAL_FIELD_STRAIN].node,
                *moved = frame->part[0].field[PAL_FIELD_DISPLACEMENT_M].node;
    REQUIRE(strain && moved);
    const double wanted = pal_largest_strain(f);
    for (int i = 0; i < shown.n_node; i++) {
        double to[3];
        pal_mul33(to, f, shown.node_rest_m + 3 * (size_t)i);
        pal_sub3(to, to, shown.node_rest_m + 3 * (size_t)i);
        for (int c = 0; c < 3; c++) CHECK_NEAR((double)strain[4 * i + c], to[c], 1e-8);
        CHECK_NEAR((double)strain[4 * i + 3], wanted, 1e-6);
        CHECK_NEAR((double)moved[4 * i + 3], pal_norm3(to), 1e-8);
    }
    pal_frame_destroy(frame);
    tool_scene_close(&s);
}

/* a frame that is filled after the last values were taken, while the body moves on, has the displacements of their
 * moment */
static void nodes_inside_have_displacements_and_values_of_one_moment(void)
{
    tool_scene s;
    REQUIRE(slab_scene(&s, 4, 4, 3, 0.01, 1, 0.008, 15) && tool_scene_open(&s));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, true, NULL));
    pal_frame *frame = pal_frame_create(s.world);
    REQUIRE(frame && !pal_frame_fit(frame, s.world));
    uint64_t revision = 0;
    int n_since = 0, n_late = 0;
    double moved_on = 0;
    for (int i = 0; i < 120; i++) {
        const pal_frame_field *in = &frame->part[0].field[PAL_FIELD_DISPLACEMENT_M];
        const float *node = in->node;
        press(&s, i < 40 ? i : 40);
        REQUIRE(step_world(&s, 1));
        const pal_shown_field *now = s.body->display.field[PAL_FIELD_DISPLACEMENT_M];
        if (now->revision != revision) revision = now->revision, n_since = 0;
        if (++n_since != 3) continue;
        n_late++;
        pal_world_frame(s.world, frame);
        CHECK_NEAR(in->time_s, now->time_s, 0);
        /* the value of this field is the length of the displacement, to the rounding of floats of some mm */
        for (int k = 0; k < s.body->n_node; k++, node += 4) {
            const double length = pal_norm3((double[3]){(double)node[0], (double)node[1], (double)node[2]});
            CHECK_NEAR((double)node[3], length, 1e-8);
            const double present = pal_dist3(s.body->d + 3 * (size_t)k, s.body->node_rest + 3 * (size_t)k);
            moved_on = fmax(moved_on, fabs(present - length));
        }
    }
    CHECK(n_late >= 2);
    CHECK(moved_on > 1e-5); /* else nothing was tried */
    pal_frame_destroy(frame);
    tool_scene_close(&s);
}

/* an entry of the scene asks for a field */
static bool slab_with(tool_scene *s, const char *field, double rate_hz)
{
    if (!slab_scene(s, 2, 2, 2, 0.01, 1, 0.01, 15)) return false;
    pal_body_def *def = &s->scene->body[0];
    pal_config_entry *item = &def->effect[def->n_effect++];
    pal_entry_init(item, "effects[9]", "field_output");
    if (field) pal_entry_put_text(item, "field", field, NULL);
    if (rate_hz > 0) pal_entry_put_number(item, "rate_hz", rate_hz, NULL);
    return true;
}

static void an_entry_of_the_scene_keeps_its_row(void)
{
    static const struct {
        const char *field;
        double rate_hz;
        const char *named;
    } bad[] = {{"stress", 0, "\"stress\""},
               {NULL, 0, "field"},
               {"displacement", 1e9, "rate_hz"},
               {"von_mises", 0, "von Mises"}};
    tool_scene s;
    REQUIRE(slab_with(&s, "displacement", 30) && tool_scene_open(&s));
    int rows = pal_world_component_count(s.world);
    size_t n_byte = pal_world_bytes(s.world);
    CHECK_INT(rows_named(s.world, "field_output"), 1);
    /* behind the row that says what is shown */
    pal_component_info last;
    pal_world_component_info(s.world, rows - 1, &last);
    CHECK_TEXT(last.name, "field_output");
    CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, true, NULL), 0);
    CHECK_INT(pal_world_bytes(s.world), n_byte);
    CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, false, NULL), 0);
    CHECK_INT(pal_world_component_count(s.world), rows);
    const pal_shown_field *field = s.body->display.field[PAL_FIELD_DISPLACEMENT_M];
    REQUIRE(field);
    uint64_t before = field->revision;
    REQUIRE(step_world(&s, 60));
    CHECK_INT(field->revision - before, 30);
    tool_scene_close(&s);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        pal_diagnostic diag = {""};
        REQUIRE(slab_with(&s, bad[i].field, bad[i].rate_hz));
        CHECK_INT(pal_world_create(s.scene, &diag, &s.world), PAL_ERR_REFUSED);
        if (!strstr(diag.text, bad[i].named)) CHECK_FAIL("entry %zu: %s", i, diag.text);
        tool_scene_close(&s);
    }
}

/* rows of two bodies: one put in between leaves every other in its place and with its body */
static void rows_of_other_bodies_stay_theirs(void)
{
    tool_scene s;
    pal_prepared second;
    REQUIRE(slab_scene(&s, 2, 2, 2, 0.01, 1, 0.01, 15) && !box_make(3, 2, 2, 0.01, &second));
    s.scene->n_body = 2;
    s.scene->body[1] = s.scene->body[0];
    s.scene->body[1].mesh = &second;
    snprintf(s.scene->body[1].name, sizeof s.scene->body[1].name, "other");
    REQUIRE(tool_scene_open(&s));
    int rows = pal_world_component_count(s.world);
    pal_component_info before[32], now;
    for (int i = 0; i < rows; i++) pal_world_component_info(s.world, i, &before[i]);
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, true, NULL));
    REQUIRE(!pal_world_field(s.world, 1, PAL_FIELD_DISPLACEMENT_M, true, NULL));
    REQUIRE(step_world(&s, 5));
    for (int i = 0, k = 0; i < rows + 2; i++) {
        pal_world_component_info(s.world, i, &now);
        if (!strcmp(now.name, "field_output")) continue;
        CHECK_TEXT(now.name, before[k].name);
        CHECK_TEXT(now.body, before[k].body);
        k++;
    }
    pal_world_component_info(s.world, rows + 1, &now);
    CHECK_TEXT(now.name, "field_output");
    CHECK_TEXT(now.body, "other");
    pal_world_component_info(s.world, rows - 1, &now);
    CHECK_TEXT(now.name, "field_output");
    CHECK_TEXT(now.body, "body");
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISPLACEMENT_M, false, NULL));
    REQUIRE(step_world(&s, 5));
    CHECK(pal_world_body(s.world, 1)->display.field[PAL_FIELD_DISPLACEMENT_M] != NULL);
    REQUIRE(!pal_world_field(s.world, 1, PAL_FIELD_DISPLACEMENT_M, false, NULL));
    CHECK_INT(pal_world_component_count(s.world), rows);
    for (int i = 0; i < rows; i++) {
        pal_world_component_info(s.world, i, &now);
        CHECK_TEXT(now.name, before[i].name);
    }
    box_free(&second);
    tool_scene_close(&s);
}

/* a free block of one model and law, stretched along x by `strain`, narrowed by Poisson's ratio, turned about z */
static bool stretched(tool_scene *s, const char *element, const char *law, double strain, double angle)
{
    const double c = cos(angle), n = sin(angle), turn[9] = {c, -n, 0, n, c, 0, 0, 0, 1};
    pal_diagnostic diag = {""};
    if (!slab_scene(s, 4, 3, 2, 0.01, 1, 0.01, 15) || pal_hexes_find(&s->mesh.tets, &s->mesh.hexes, &diag))
        return false;
    pal_body_def *def = &s->scene->body[0];
    def->n_support = 0;
    def->n_effect = 0;
    pal_entry_init(&def->model, "model", "fem");
    pal_entry_put_text(&def->model, "element", element, NULL);
    pal_entry_put_text(&def->model, "law", law, NULL);
    if (!tool_scene_open(s)) return false;
    double across = 1 - def->material.poisson * strain;
    for (int i = 0; i < s->body->n_dof; i++) {
        const double *rest = s->body->x_rest + 3 * (size_t)i;
        const double x[3] = {rest[0] * (1 + strain), rest[1] * across, rest[2] * across};
        pal_mul33(s->body->x + 3 * (size_t)i, turn, x);
    }
    pal_world_invalidate_limits(s->world, 0);
    /* a step too short to move anything: rows that keep rotations take those of this shape */
    return !pal_world_step(s->world, 1e-9);
}

static void close_fem(tool_scene *s)
{
    pal_hexes_free(&s->mesh.hexes);
    tool_scene_close(s);
}

static double worst_error(const pal_body *body, pal_field field, double wanted)
{
    double worst = 0;
    for (int i = 0; i < body->display.n_shown; i++)
        worst = fmax(worst, fabs((double)body->display.field[field]->value[i] / wanted - 1));
    return worst;
}

/* uniaxial tension: sigma = E e, so von Mises stress is E e and energy density E e^2 / 2, everywhere */
static void stress_and_energy_of_a_stretched_block_are_those_of_uniaxial_tension(void)
{
    static const char *const element[] = {"tet4", "tet10", "hex8", "hex8_bbar"}, *const law[] = {"linear",
                                                                                                 "corotational",
                                                                                                 "neo_hookean"};
    for (int e = 0; e < 4; e++)
        for (int l = 0; l < 3; l++) {
            /* neo-Hookean is the linear law for small strain only; the linear law knows no rotation */
            double strain = l == 2 ? 1e-4 : 0.02, angle = l == 0 ? 0 : 0.7, bound = l == 2 ? 2e-3 : 1e-5;
            tool_scene s;
            REQUIRE(stretched(&s, element[e], law[l], strain, angle));
            double young = s.scene->body[0].material.young_Pa;
            REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_VON_MISES_PA, true, NULL));
            REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
            double stress = worst_error(s.body, PAL_FIELD_VON_MISES_PA, young * strain);
            double energy = worst_error(s.body, PAL_FIELD_ENERGY_J_M3, 0.5 * young * strain * strain);
            if (stress > bound || energy > 3 * bound) printf("  %s %s\n", element[e], law[l]);
            CHECK_LE(stress, bound);
            CHECK_LE(energy, 3 * bound);
            close_fem(&s);
        }
}

/* its largest strain is that of x, its volume (1 + e) (1 - nu e)^2 of what it was, whatever law and turn */
static void strain_and_distortion_of_a_stretched_block_are_exact(void)
{
    static const char *const element[] = {"tet4", "tet10", "hex8", "hex8_bbar"}, *const law[] = {"linear",
                                                                                                 "corotational",
                                                                                                 "neo_hookean"};
    for (int k = 0; k < 12; k++) {
        const double strain = 0.03, angle = k % 3 == 0 ? 0 : 0.7;
        tool_scene s;
        REQUIRE(stretched(&s, element[k / 3], law[k % 3], strain, angle));
        double across = 1 - s.scene->body[0].material.poisson * strain;
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_STRAIN, true, NULL));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISTORTION, true, NULL));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_YOUNG_PA, true, NULL));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DENSITY_KG_M3, true, NULL));
        CHECK_LE(worst_error(s.body, PAL_FIELD_YOUNG_PA, s.scene->body[0].material.young_Pa), 1e-6);
        CHECK_LE(worst_error(s.body, PAL_FIELD_DENSITY_KG_M3, s.scene->body[0].material.density_kg_m3), 1e-6);
        CHECK_LE(worst_error(s.body, PAL_FIELD_STRAIN, strain), 2e-6);
        CHECK_LE(worst_error(s.body, PAL_FIELD_DISTORTION, (1 + strain) * across * across - 1), 2e-5);
        close_fem(&s);
    }
}

/* the tetrahedra of a block of springs moved by F, turned */
static void strain_and_distortion_of_springs_are_those_of_their_tetrahedra(void)
{
    const double stretch[3] = {1.05, 0.97, 1.01}, c = cos(0.9), n = sin(0.9), turn[9] = {c, -n, 0, n, c, 0, 0, 0, 1};
    tool_scene s;
    REQUIRE(slab_scene(&s, 4, 3, 2, 0.01, 1, 0.01, 15) && tool_scene_open(&s));
    for (int i = 0; i < s.body->n_dof; i++) {
        double at[3];
        for (int a = 0; a < 3; a++) at[a] = s.body->x_rest[3 * i + a] * stretch[a];
        pal_mul33(s.body->x + 3 * (size_t)i, turn, at);
    }
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_STRAIN, true, NULL));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISTORTION, true, NULL));
    CHECK_LE(worst_error(s.body, PAL_FIELD_STRAIN, 0.05), 1e-6);
    CHECK_LE(worst_error(s.body, PAL_FIELD_DISTORTION, stretch[0] * stretch[1] * stretch[2] - 1), 1e-6);
    tool_scene_close(&s);
}

/* tetrahedra for sections: each upright, together the volume inside the shown surface at rest */
static void fills_the_solid(const pal_world *world)
{
    pal_shown shown;
    pal_world_shown(world, 0, &shown);
    REQUIRE(shown.n_tet > 0);
    double sum = 0, min_m3 = 1, inside = 0;
    for (int t = 0; t < shown.n_tet; t++) {
        const int32_t *node = shown.tet + 4 * (size_t)t;
        double edge[3][3], normal[3];
        for (int k = 0; k < 3; k++)
            pal_sub3(edge[k], shown.node_rest_m + 3 * (size_t)node[k + 1], shown.node_rest_m + 3 * (size_t)node[0]);
        pal_cross3(normal, edge[0], edge[1]);
        const double volume = pal_dot3(normal, edge[2]) / 6;
        sum += volume, min_m3 = fmin(min_m3, volume);
    }
    for (int t = 0; t < shown.n_tri; t++) {
        double x[3][3], normal[3];
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++) x[k][c] = (double)shown.rest_m[3 * shown.tri[3 * t + k] + c];
        pal_cross3(normal, x[0], x[1]);
        inside += pal_dot3(normal, x[2]) / 6;
    }
    CHECK(min_m3 > 0);
    CHECK_NEAR(sum / inside, 1, 0.02);
}

/* a block of control cells whose points are moved by F, which its nodes follow to the digit: one stretch out and one
 * in, then pressed from all sides; turned */
static void strain_and_distortion_of_a_solid_are_exact(void)
{
    const double stretch[2][3] = {{1.05, 0.97, 1.01}, {0.98, 0.98, 0.98}}, wanted[2] = {0.05, -0.02};
    for (int k = 0; k < 2; k++) {
        const double c = cos(0.9), n = sin(0.9), turn[9] = {c, -n, 0, n, c, 0, 0, 0, 1};
        pal_cells cells = solid_bricks(2, 2, 2, 0.05, 0.05, 0.05);
        pal_surface surface = {0};
        tool_scene s = {.scene = calloc(1, sizeof *s.scene)};
        REQUIRE(s.scene && !pal_cells_boundary(&cells, &surface, NULL, NULL));
        REQUIRE(!pal_prepared_surface(&surface, &s.mesh));
        pal_surface_free(&surface);
        pal_scene_default(s.scene);
        s.scene->n_body = 1;
        pal_body_default_cells(&s.scene->body[0], "clay", &s.mesh, &cells);
        pal_entry_put_number(&s.scene->body[0].model, "levels", 1, NULL);
        REQUIRE(tool_scene_open(&s));
        for (int i = 0; i < s.body->n_dof; i++) {
            double at[3];
            for (int a = 0; a < 3; a++) at[a] = s.body->x_rest[3 * i + a] * stretch[k][a];
            pal_mul33(s.body->x + 3 * (size_t)i, turn, at);
        }
        pal_world_invalidate_limits(s.world, 0);
        CHECK(!pal_world_has_field(s.world, 0, PAL_FIELD_STIFFNESS_J));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_STRAIN, true, NULL));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DISTORTION, true, NULL));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_YOUNG_PA, true, NULL));
        CHECK_LE(worst_error(s.body, PAL_FIELD_YOUNG_PA, s.scene->body[0].material.young_Pa), 1e-6);
        CHECK_LE(worst_error(s.body, PAL_FIELD_STRAIN, wanted[k]), 1e-6);
        if (k == 0) fills_the_solid(s.world);
        CHECK_LE(worst_error(s.body, PAL_FIELD_DISTORTION, stretch[k][0] * stretch[k][1] * stretch[k][2] - 1), 1e-6);
        tool_scene_close(&s);
        pal_cells_free(&cells);
    }
}

/* a slab of 4 x 3 x 2 cells, 10 mm each, of 1000 kg/m3, and of 2500 where x is above the plane between the second and
 * the third layer of cells: nodes on that plane have a mean of both */
static bool half_heavy_slab(tool_scene *s, const char *element, double damping_1_s)
{
    static pal_region heavy = {.kind = PAL_REGION_BOX, .young_Pa = NAN, .poisson = NAN, .density_kg_m3 = 2500};
    pal_diagnostic diag = {""};
    if (!slab_scene(s, 4, 3, 2, 0.01, 1, 0.01, 15) || pal_hexes_find(&s->mesh.tets, &s->mesh.hexes, &diag))
        return false;
    pal_body_def *def = &s->scene->body[0];
    for (int c = 0; c < 3; c++) heavy.low_m[c] = c == 0 ? 0.02 : -1, heavy.high_m[c] = 1;
    def->region[def->n_region++] = heavy;
    def->material.density_kg_m3 = 1000;
    def->material.damping_1_s = damping_1_s;
    if (element) {
        pal_entry_init(&def->model, "model", "fem");
        pal_entry_put_text(&def->model, "element", element, NULL);
    }
    return tool_scene_open(s);
}

static void density_is_that_of_the_regions(void)
{
    static const char *const element[] = {NULL, "tet4", "tet10", "hex8", "hex8_bbar"};
    for (int e = 0; e < 5; e++) {
        tool_scene s;
        int n_light = 0, n_heavy = 0, n_between = 0;
        REQUIRE(half_heavy_slab(&s, element[e], 0));
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DENSITY_KG_M3, true, NULL));
        for (int i = 0; i < s.body->display.n_shown; i++) {
            const double x = s.mesh.surface.x[3 * (size_t)i],
                         at = (double)s.body->display.field[PAL_FIELD_DENSITY_KG_M3]->value[i];
            n_light += x<0.019, n_heavy += x> 0.021, n_between += fabs(x - 0.02) < 1e-9;
            if (x < 0.019) CHECK_NEAR(at, 1000, 1e-3);
            if (x > 0.021) CHECK_NEAR(at, 2500, 1e-3);
            if (fabs(x - 0.02) < 1e-9) CHECK(at > 1000.1 && at < 2499.9);
        }
        CHECK(n_light > 0 && n_heavy > 0 && n_between > 0);
        /* another material scales all of it */
        pal_material to = s.scene->body[0].material;
        to.density_kg_m3 = 1500;
        CHECK_INT(pal_world_material(s.world, 0, &to, NULL), 0);
        CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_DENSITY_KG_M3, false, NULL), 0);
        CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_DENSITY_KG_M3, true, NULL), 0);
        double sum_kg = 0, min = INFINITY;
        for (int i = 0; i < s.body->n_dof; i++) sum_kg += s.body->mass_kg[i];
        for (int i = 0; i < s.body->display.n_shown; i++)
            min = fmin(min, (double)s.body->display.field[PAL_FIELD_DENSITY_KG_M3]->value[i]);
        CHECK_NEAR(sum_kg, 1.5 * (1000 + 2500) / 2 * 24e-6, 1e-9);
        CHECK_NEAR(min, 1500, 1e-3);
        close_fem(&s);
    }
}

/* the rate of the component viscous; a body without it has no such field */
static void damping_is_the_rate_that_acts(void)
{
    tool_scene s;
    pal_diagnostic diag = {""};
    REQUIRE(half_heavy_slab(&s, "tet4", 7.5));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DAMPING_1_S, true, NULL));
    CHECK_LE(worst_error(s.body, PAL_FIELD_DAMPING_1_S, 7.5), 1e-6);
    close_fem(&s);
    REQUIRE(half_heavy_slab(&s, "tet4", 0));
    CHECK(!pal_world_has_field(s.world, 0, PAL_FIELD_DAMPING_1_S));
    CHECK_INT(pal_world_field(s.world, 0, PAL_FIELD_DAMPING_1_S, true, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "damping"));
    close_fem(&s);
    /* derived from the lowest frequency */
    REQUIRE(half_heavy_slab(&s, "tet4", PAL_DAMPING_DERIVED));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DAMPING_1_S, true, NULL));
    CHECK_LE(worst_error(s.body, PAL_FIELD_DAMPING_1_S, s.body->damping_1_s), 1e-6);
    close_fem(&s);
}

/* A stroke over one corner of a block of control cells, read back from the fields: the factor to the digit where its
 * weight is 1 around a node's elements, nothing where it is 0, and between both elsewhere */
static void painted_material_is_read_back(void)
{
    pal_cells cells = solid_bricks(16, 2, 2, 0.02, 0.02, 0.02);
    pal_surface surface = {0};
    tool_scene s = {.scene = calloc(1, sizeof *s.scene)};
    const pal_stroke stroke = {.radius_m = 0.24, .softness = 0.8, .young_factor = 4, .density_factor = 2};
    REQUIRE(s.scene && !pal_cells_boundary(&cells, &surface, NULL, NULL));
    REQUIRE(!pal_prepared_surface(&surface, &s.mesh));
    pal_surface_free(&surface);
    pal_scene_default(s.scene);
    s.scene->n_body = 1;
    pal_body_def *def = &s.scene->body[0];
    pal_body_default_cells(def, "clay", &s.mesh, &cells);
    pal_entry_put_number(&def->model, "levels", 1, NULL);
    pal_stroke at_end = stroke;
    memcpy(at_end.at_m, cells.x, sizeof at_end.at_m);
    def->stroke = &at_end, def->n_stroke = 1;
    REQUIRE(tool_scene_open(&s));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_YOUNG_PA, true, NULL));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_DENSITY_KG_M3, true, NULL));
    /* of a node's shape function: the diagonal of two elements of half a cell each way */
    const double core = 0.2 * stroke.radius_m, band = stroke.radius_m - core, reach = 0.02 * sqrt(3);
    int n_full = 0, n_none = 0, n_between = 0;
    for (int i = 0; i < s.body->n_node; i++) {
        const double r = pal_dist3(s.body->node_rest + 3 * (size_t)i, at_end.at_m),
                     young = s.body->display.field[PAL_FIELD_YOUNG_PA]->node[i] / def->material.young_Pa,
                     density = s.body->display.field[PAL_FIELD_DENSITY_KG_M3]->node[i] / def->material.density_kg_m3;
        CHECK(young > 1 - 1e-6 && young < 4 + 1e-6 && density > 1 - 1e-6 && density < 2 + 1e-6);
        if (r + reach < core || r - reach > stroke.radius_m) {
            const bool full = r < core;
            CHECK_NEAR(young, full ? 4 : 1, 1e-6);
            CHECK_NEAR(density, full ? 2 : 1, 1e-6);
            n_full += full, n_none += !full;
        } else {
            /* the stroke's weight changes by at most 1.5 over the soft band */
            const double w = pal_stroke_weight(&at_end, s.body->node_rest + 3 * (size_t)i), off = 1.5 * reach / band;
            CHECK(fabs(log(young) / log(4) - w) <= off && fabs(log(density) / log(2) - w) <= off);
            n_between++;
        }
    }
    CHECK(n_full > 0 && n_none > 0 && n_between > 0);
    tool_scene_close(&s);
    pal_cells_free(&cells);
}

/* The energies of a body, with its field energy: of a block in uniaxial tension that moves as a whole, E e^2 V / 2 and
 * m v^2 / 2 */
static void energies_are_those_of_a_stretched_block_that_moves(void)
{
    static const char *const element[] = {"tet4", "tet10", "hex8", "hex8_bbar"};
    const double strain = 0.02, speed = 0.5;
    for (int e = 0; e < 4; e++) {
        tool_scene s;
        double mass_kg = 0;
        REQUIRE(stretched(&s, element[e], "linear", strain, 0));
        for (int i = 0; i < s.body->n_dof; i++) {
            s.body->v[3 * i] = 0.6 * speed, s.body->v[3 * i + 1] = 0.8 * speed, s.body->v[3 * i + 2] = 0;
            mass_kg += s.body->mass_kg[i];
        }
        REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
        const pal_shown_field *shown = s.body->display.field[PAL_FIELD_ENERGY_J_M3];
        const pal_material *of = &s.scene->body[0].material;
        const double volume_m3 = mass_kg / of->density_kg_m3;
        CHECK_NEAR(volume_m3, 24e-6, 1e-12);
        CHECK_NEAR(shown->elastic_J / (0.5 * of->young_Pa * strain * strain * volume_m3), 1, 1e-5);
        CHECK_NEAR(shown->kinetic_J / (0.5 * mass_kg * speed * speed), 1, 1e-12);
        pal_frame *frame = pal_frame_create(s.world);
        REQUIRE(frame && !pal_frame_fit(frame, s.world));
        pal_world_frame(s.world, frame);
        CHECK_NEAR(frame->part[0].elastic_J, shown->elastic_J, 0);
        CHECK_NEAR(frame->part[0].kinetic_J, shown->kinetic_J, 0);
        pal_frame_destroy(frame);
        close_fem(&s);
    }
}

/* of springs: what the world's components give as energy, at rest 0 */
static void energies_of_springs_are_those_of_their_components(void)
{
    tool_scene s;
    REQUIRE(slab_scene(&s, 4, 3, 2, 0.01, 1, 0.01, 15));
    s.scene->gravity_m_s2 = 0;
    REQUIRE(tool_scene_open(&s));
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
    CHECK_LE(s.body->display.field[PAL_FIELD_ENERGY_J_M3]->elastic_J, 1e-12);
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, false, NULL));
    for (int i = 0; i < s.body->n_dof; i++) {
        const double *rest = s.body->x_rest + 3 * (size_t)i;
        for (int c = 0; c < 3; c++) s.body->x[3 * i + c] = rest[c] * (c == 0 ? 1.05 : 0.98);
        s.body->v[3 * i + 2] = 0.3;
    }
    REQUIRE(!pal_world_field(s.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
    const pal_shown_field *shown = s.body->display.field[PAL_FIELD_ENERGY_J_M3];
    CHECK(shown->elastic_J > 1e-6 && shown->kinetic_J > 1e-6);
    CHECK_NEAR((shown->elastic_J + shown->kinetic_J) / pal_world_energy_J(s.world), 1, 1e-9);
    tool_scene_close(&s);
}

/* rest, collapsed, flat, turned over, sheared */
static void the_largest_strain_is_that_of_the_largest_stretch(void)
{
    const double rest[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, zero[9] = {0}, flat[9] = {1.5, 0, 0, 0, 0, 0, 0, 0, 1},
                 over[9] = {-1, 0, 0, 0, 2, 0, 0, 0, 1}, shear[9] = {1, 1, 0, 0, 1, 0, 0, 0, 1};
    CHECK_NEAR(pal_largest_strain(rest), 0, 0);
    CHECK_NEAR(pal_largest_strain(zero), -1, 1e-15);
    CHECK_NEAR(pal_largest_strain(flat), 0.5, 1e-8);
    CHECK_NEAR(pal_largest_strain(over), 1, 1e-8);
    /* simple shear by 1: the golden ratio */
    CHECK_NEAR(pal_largest_strain(shear), 0.5 * (sqrt(5) - 1), 1e-12);
}

static void looking_at_a_live_body_of_elements_changes_no_bit(void)
{
    static const char *const element[] = {"tet4", "hex8_bbar"}, *const law[] = {"corotational", "neo_hookean"};
    for (int e = 0; e < 4; e++) {
        tool_scene s, quiet;
        REQUIRE(stretched(&s, element[e / 2], law[e % 2], 0.05, 0) &&
                stretched(&quiet, element[e / 2], law[e % 2], 0.05, 0));
        int rows = pal_world_component_count(s.world);
        size_t n_byte = pal_world_bytes(s.world);
        CHECK(!pal_world_has_field(s.world, 0, PAL_FIELD_STIFFNESS_J));
        for (int k = 1; k < PAL_FIELD_STIFFNESS_J; k++) REQUIRE(!pal_world_field(s.world, 0, (pal_field)k, true, NULL));
        for (int i = 0; i < 30; i++) {
            CHECK_INT(pal_world_step(s.world, 1.0 / 60), 0);
            CHECK_INT(pal_world_step(quiet.world, 1.0 / 60), 0);
        }
        CHECK(pal_world_hash(s.world) == pal_world_hash(quiet.world));
        for (int i = 0; i < s.body->display.n_shown; i++)
            for (int k = 1; k < PAL_FIELD_STIFFNESS_J; k++) CHECK(s.body->display.field[k]->value[i] >= 0);
        for (int k = 1; k < PAL_FIELD_STIFFNESS_J; k++)
            REQUIRE(!pal_world_field(s.world, 0, (pal_field)k, false, NULL));
        CHECK_INT(pal_world_component_count(s.world), rows);
        CHECK_INT(pal_world_bytes(s.world), n_byte);
        REQUIRE(step_world(&s, 5) && step_world(&quiet, 5));
        CHECK(pal_world_hash(s.world) == pal_world_hash(quiet.world));
        close_fem(&s);
        close_fem(&quiet);
    }
}

int main(void)
{
    counting = true;
    RUN(nobody_looks_nothing_is_there_and_looking_changes_no_bit);
    RUN(displacement_is_the_distance_from_rest);
    RUN(measured_values_are_nodal_means_spread_by_the_skin);
    RUN(a_value_that_is_no_number_shows_as_zero);
    RUN(values_are_taken_ten_times_a_second_without_heap_and_at_once_after_reset);
    RUN(frames_have_room_for_a_field_while_its_row_is_there);
    RUN(nodes_inside_have_the_linear_displacement_and_its_strain);
    RUN(nodes_inside_have_displacements_and_values_of_one_moment);
    RUN(refuses_what_the_model_does_not_give_with_a_sentence);
    RUN(an_entry_of_the_scene_keeps_its_row);
    RUN(rows_of_other_bodies_stay_theirs);
    RUN(stress_and_energy_of_a_stretched_block_are_those_of_uniaxial_tension);
    RUN(strain_and_distortion_of_a_stretched_block_are_exact);
    RUN(strain_and_distortion_of_springs_are_those_of_their_tetrahedra);
    RUN(strain_and_distortion_of_a_solid_are_exact);
    RUN(density_is_that_of_the_regions);
    RUN(damping_is_the_rate_that_acts);
    RUN(energies_are_those_of_a_stretched_block_that_moves);
    RUN(energies_of_springs_are_those_of_their_components);
    RUN(painted_material_is_read_back);
    RUN(the_largest_strain_is_that_of_the_largest_stretch);
    RUN(looking_at_a_live_body_of_elements_changes_no_bit);
    return check_report();
}
