/* Solids that are cut away (pal_body_def.cut): motion is the same to the bit, the cut has its plane, its colours and
 * its inner nodes. */
#include "server/base/vec3.h"
#include "server/mesh/cells/cell_edits.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/subdivision/subdivision_solid.h"
#include "server/sim/world/frame.h"
#include "server/sim/world/world.h"
#include "tests/fixtures/solids.h"

/* a block of four control cells an edge, 0.1 m, about zero */
typedef struct clay {
    pal_cells cells;
    pal_prepared mesh;
    pal_scene *scene;
    pal_body_def *def;
    pal_world *world;
    pal_body *body;
} clay;

static void clay_make(clay *c)
{
    pal_surface surface = {0};
    memset(c, 0, sizeof *c);
    c->cells = solid_bricks(4, 4, 4, 0.025, 0.025, 0.025);
    c->scene = calloc(1, sizeof *c->scene);
    if (!c->scene || pal_cells_boundary(&c->cells, &surface, NULL, NULL) || pal_prepared_surface(&surface, &c->mesh))
        abort();
    pal_surface_free(&surface);
    pal_scene_default(c->scene);
    c->scene->n_body = 1;
    c->def = &c->scene->body[0];
    pal_body_default_cells(c->def, "clay", &c->mesh, &c->cells);
    if (pal_entry_put_number(&c->def->model, "levels", 1, NULL)) abort();
}

static void cut_at(clay *c, double x, double y, double z, double offset_m)
{
    c->def->cut = true;
    pal_set3(c->def->cut_normal, x, y, z);
    c->def->cut_m = offset_m;
}

static bool clay_start(clay *c)
{
    pal_diagnostic diag = {""};
    if (pal_world_create(c->scene, &diag, &c->world)) CHECK_FAIL("%s", diag.text);
    if (c->world) c->body = pal_world_body(c->world, 0);
    return c->world != NULL;
}

static void clay_close(clay *c)
{
    pal_world_destroy(c->world);
    pal_cells_free(&c->cells);
    pal_prepared_free(&c->mesh);
    free(c->scene);
}

/* gravity and a load on an inner control point, whole and cut twice over */
static void a_cut_changes_no_bit_of_what_moves(void)
{
    uint64_t hash[3];
    int n_shown[3];
    for (int k = 0; k < 3; k++) {
        clay c;
        clay_make(&c);
        if (k) cut_at(&c, k == 1, 0, k == 2, k == 1 ? 0 : -0.01);
        REQUIRE(clay_start(&c));
        CHECK(!pal_world_load(c.world, 0, c.body->n_node / 2, (const double[3]){0.2, 0.1, -0.3}));
        for (int i = 0; i < 12; i++) CHECK_INT(pal_world_step(c.world, 1.0 / 60), 0);
        double moved = 0;
        for (int i = 0; i < 3 * c.body->n_dof; i++) moved = fmax(moved, fabs(c.body->x[i] - c.body->x_rest[i]));
        CHECK(moved > 1e-4);
        hash[k] = pal_world_hash(c.world);
        n_shown[k] = c.body->display.n_shown;
        clay_close(&c);
    }
    CHECK(hash[1] == hash[0]);
    CHECK(hash[2] == hash[0]);
    CHECK(n_shown[1] != n_shown[0]);
}

/* what the cut shows follows its nodes, those inside the solid as well */
static void inner_nodes_are_shown_where_they_are(void)
{
    clay c;
    int n_inner = 0;
    clay_make(&c);
    cut_at(&c, 1, 0, 0, 0);
    REQUIRE(clay_start(&c));
    for (int i = 0; i < 6; i++) CHECK_INT(pal_world_step(c.world, 1.0 / 60), 0);
    for (int i = 0; i < c.body->display.n_shown; i++) {
        const double *d = c.body->d + 3 * c.body->display.shown_node[i],
                     *rest = c.body->node_rest + 3 * c.body->display.shown_node[i];
        for (int a = 0; a < 3; a++) CHECK(c.body->display.shown[3 * i + a] == (float)d[a]);
        n_inner += fabs(rest[0]) < 1e-9 && fabs(rest[1]) < 0.03 && fabs(rest[2]) < 0.03;
    }
    /* 9 x 9 nodes on the cut: those at least two elements (0.025 m) from the block's sides */
    CHECK(n_inner >= 25);
    clay_close(&c);
}

/* bent about y, e_xx = kappa z: energy density grows from the middle outward, and the cut shows it (paper A, Fig. 13)
 */
static void fields_colour_the_cut(void)
{
    const double kappa = 0.5;
    clay c;
    clay_make(&c);
    cut_at(&c, 1, 0, 0, 0);
    REQUIRE(clay_start(&c));
    for (int i = 0; i < c.body->n_dof; i++) {
        const double *r = c.body->x_rest + 3 * i;
        double *x = c.body->x + 3 * i;
        x[0] = r[0] * (1 + kappa * r[2]);
    }
    pal_world_invalidate_limits(c.world, 0);
    REQUIRE(!pal_world_field(c.world, 0, PAL_FIELD_ENERGY_J_M3, true, NULL));
    const float *value = c.body->display.field[PAL_FIELD_ENERGY_J_M3]->value;
    double low = 0, high = 0;
    int n_low = 0, n_high = 0;
    for (int i = 0; i < c.body->display.n_shown; i++) {
        const double *rest = c.body->node_rest + 3 * c.body->display.shown_node[i];
        if (fabs(rest[0]) > 1e-9 || fabs(rest[1]) > 0.02) continue;
        if (fabs(rest[2]) < 1e-3) low += (double)value[i], n_low++;
        if (rest[2] > 0.02 && rest[2] < 0.03) high += (double)value[i], n_high++;
    }
    REQUIRE(n_low > 0 && n_high > 0);
    CHECK(high / n_high > 4 * low / n_low);
    CHECK(low >= 0);
    clay_close(&c);
}

/* triangles of each look, all corners of a triangle having the same, and copies at the places of what they copy */
static void count_looks(const clay *c, pal_shown *shown, int n[2])
{
    pal_world_shown(c->world, 0, shown);
    n[0] = n[1] = 0;
    for (int t = 0; t < shown->n_tri; t++) {
        const int32_t *tri = shown->tri + 3 * t;
        const int look = shown->look ? shown->look[tri[0]] : 0;
        for (int k = 1; k < 3 && shown->look; k++) CHECK_INT(shown->look[tri[k]], look);
        n[look]++;
    }
    for (int i = shown->n_own; i < shown->n_vertex; i++) {
        const int32_t of = shown->copy_of[i - shown->n_own];
        CHECK(!memcmp(shown->rest_m + 3 * i, shown->rest_m + 3 * of, 3 * sizeof(float)));
    }
}

/* 4 x 4 x 4 cells, one level: a control face is 4 quads, 8 triangles, and a ring around n faces side by side is drawn
 * twice. A cell in the middle of the top leaves 5 inner faces, whose mouth has 8 vertices */
static void what_a_cut_or_an_edit_opens_is_inside(void)
{
    clay c;
    pal_shown shown;
    int n[2];
    clay_make(&c);
    REQUIRE(clay_start(&c));
    count_looks(&c, &shown, n);
    CHECK(!shown.look && !shown.copy_start);
    CHECK_INT(n[0], 96 * 8);
    clay_close(&c);

    clay_make(&c);
    cut_at(&c, 1, 0, 0, 0);
    REQUIRE(clay_start(&c));
    count_looks(&c, &shown, n);
    CHECK_INT(n[0], (16 + 4 * 8) * 8);
    CHECK_INT(n[1], 16 * 8);
    CHECK_INT(shown.n_vertex - shown.n_own, 4 * 8);
    clay_close(&c);

    clay_make(&c);
    const pal_cells_command remove = {.kind = PAL_CELLS_DELETE, .cell = 3 * 16 + 1 * 4 + 1};
    pal_cells_edit edit;
    pal_surface surface = {0};
    REQUIRE(!pal_cells_apply(&c.cells, &remove, &edit, NULL));
    pal_cells_free(&c.cells);
    c.cells = edit.cells;
    memset(&edit.cells, 0, sizeof edit.cells);
    pal_cells_edit_free(&edit);
    pal_prepared_free(&c.mesh);
    REQUIRE(!pal_cells_boundary(&c.cells, &surface, NULL, NULL) && !pal_prepared_surface(&surface, &c.mesh));
    pal_surface_free(&surface);
    REQUIRE(clay_start(&c));
    count_looks(&c, &shown, n);
    CHECK_INT(n[0], 95 * 8);
    CHECK_INT(n[1], 5 * 8);
    CHECK_INT(shown.n_vertex - shown.n_own, 8);
    pal_frame *frame = pal_frame_create(c.world);
    REQUIRE(frame);
    CHECK(!pal_world_load(c.world, 0, c.body->n_node / 2, (const double[3]){0.2, 0.1, -0.3}));
    for (int i = 0; i < 6; i++) CHECK_INT(pal_world_step(c.world, 1.0 / 60), 0);
    pal_world_frame(c.world, frame);
    const float *x = frame->part[0].position_m;
    double moved = 0;
    for (int i = shown.n_own; i < shown.n_vertex; i++) {
        const int32_t of = shown.copy_of[i - shown.n_own];
        CHECK(!memcmp(x + 3 * i, x + 3 * of, 3 * sizeof *x));
        moved = fmax(moved, fabsf(x[3 * i + 2] - shown.rest_m[3 * i + 2]));
    }
    CHECK(moved > 1e-6);
    pal_frame_destroy(frame);
    clay_close(&c);
}

int main(void)
{
    RUN(what_a_cut_or_an_edit_opens_is_inside);
    RUN(a_cut_changes_no_bit_of_what_moves);
    RUN(inner_nodes_are_shown_where_they_are);
    RUN(fields_colour_the_cut);
    return check_report();
}
