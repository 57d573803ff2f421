/* Fields in colour: rows that come and go in a running world, their values, their rate; nothing where nobody looks. */
#include "server/sim/core/effect_list.h"
#include "server/sim/elements/elastic_law.h"
#include "tests/fixtures/solids.h"
#include "tests/fixtures/stretched_block.h"
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
    RUN(looking_at_a_live_body_of_elements_changes_no_bit);
    return check_report();
}
