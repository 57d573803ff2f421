/* Sculpting (paper A section 4.1): a command makes another scene or changes nothing, the body goes on where it was,
 * undo brings back every bit; and thousands of commands one after the other leave a solid that can be simulated. */
#include "server/num/random.h"
#include "server/session/sculpt.h"
#include "server/sim/subdivision/subdivision_solid.h"
#include "tests/fixtures/body_sums.h"
#include "tests/fixtures/cell_check.h"
#include "tests/session/sculpt_body.h"

static clay_scene clay;
static pal_diagnostic diag;

static uint64_t mix(uint64_t h, const void *bytes, size_t n)
{
    const unsigned char *p = bytes;
    for (size_t i = 0; i < n; i++) h = (h ^ p[i]) * 0x100000001b3u;
    return h;
}

/* of everything that undo must bring back: cells, paint, state */
static uint64_t print_of(const pal_scene *scene, pal_world *world)
{
    const pal_body_def *def = &scene->body[0];
    const pal_body *body = pal_world_body(world, 0);
    uint64_t h = mix(0xcbf29ce484222325u, def->cells->x, 3 * sizeof(double) * (size_t)def->cells->n_vertex);
    h = mix(h, def->cells->edge_use, sizeof *def->cells->edge_use * (size_t)def->cells->n_edge_use);
    for (int32_t e = 0; e < def->cells->n_edge; e++) h = mix(h, &def->cells->edge[e].sharp, sizeof(float));
    h = mix(h, def->stroke, sizeof *def->stroke * (size_t)def->n_stroke);
    h = mix(h, body->x, 3 * sizeof(double) * (size_t)body->n_dof);
    return mix(h, body->v, 3 * sizeof(double) * (size_t)body->n_dof);
}

/* the scene that runs, its world, and who made it */
typedef struct studio {
    pal_sculptor *sculptor;
    pal_sculpt_edit *turn; /* NULL: the scene of the start */
    const pal_scene *scene;
    pal_world *world;
} studio;

static bool studio_open(studio *s)
{
    *s = (studio){.scene = &clay.scene};
    if (pal_sculptor_create(s->scene, 0, &diag, &s->sculptor) || pal_world_create(s->scene, &diag, &s->world))
        CHECK_FAIL("%s", diag.text);
    return s->world != NULL;
}

static void studio_close(studio *s)
{
    pal_world_destroy(s->world);
    pal_sculptor_destroy(s->sculptor);
    pal_sculpt_edit_free(s->turn);
}

/* as the hub does it */
static pal_err studio_do(studio *s, const pal_sculpt *command)
{
    pal_sculpt_edit *turn = NULL;
    pal_world *next = NULL;
    diag.text[0] = 0;
    pal_err err = pal_sculptor_prepare(s->sculptor, s->scene, command, &diag, &turn);
    if (!err) err = pal_world_create(pal_sculpt_edit_scene(turn), &diag, &next);
    if (err) {
        pal_sculpt_edit_free(turn);
        return err;
    }
    pal_sculpt_transfer(turn, next, s->world);
    pal_sculptor_commit(s->sculptor, turn);
    pal_world_destroy(s->world);
    pal_sculpt_edit_free(s->turn);
    s->turn = turn, s->world = next, s->scene = pal_sculpt_edit_scene(turn);
    return PAL_ERR_OK;
}

static pal_err edit(studio *s, pal_cells_command command)
{
    return studio_do(s, &(pal_sculpt){.kind = PAL_SCULPT_CELLS, .cells = command});
}

static pal_err turn_back(studio *s, pal_sculpt_kind kind)
{
    return studio_do(s, &(pal_sculpt){.kind = kind});
}

static void steps(studio *s, int n)
{
    for (int i = 0; i < n; i++) CHECK_INT(pal_world_step(s->world, s->scene->step_s), 0);
}

/* the boundary face whose centre is highest */
static int32_t top_face(const pal_cells *c)
{
    double best = -INFINITY, at[3];
    int32_t found = -1;
    for (int32_t f = 0; f < c->n_face; f++) {
        if (!pal_cells_face_boundary(c, f)) continue;
        pal_cells_face_centre(c, NULL, f, at);
        if (at[2] > best) best = at[2], found = f;
    }
    return found;
}

static void a_body_goes_on_where_it_was_with_a_cell_more(void)
{
    studio s;
    REQUIRE(studio_open(&s));
    pal_body *body = pal_world_body(s.world, 0);
    /* moved as a whole, so that what is new must move along */
    for (int i = 0; i < body->n_dof; i++) body->x[3 * i] += 0.01, body->v[3 * i + 1] = 0.5;
    int before = body->n_dof;
    double *x = malloc(3 * sizeof *x * (size_t)before);
    memcpy(x, body->x, 3 * sizeof *x * (size_t)before);
    int32_t face = top_face(pal_sculptor_cells(s.sculptor));
    CHECK_INT(edit(&s, (pal_cells_command){PAL_CELLS_EXTRUDE, .face = face, .distance_m = 0.03, .scale = 1}), 0);
    body = pal_world_body(s.world, 0);
    CHECK_INT(pal_sculptor_cells(s.sculptor)->n_cell, 9);
    CHECK_INT(body->n_dof, before + 4);
    CHECK(!memcmp(x, body->x, 3 * sizeof *x * (size_t)before));
    for (int i = before; i < before + 4; i++) {
        CHECK_NEAR(body->x[3 * i] - body->x_rest[3 * i], 0.01, 1e-9);
        CHECK_NEAR(body->v[3 * i + 1], 0.5, 1e-12);
        CHECK_NEAR(body->x_rest[3 * i + 2], 0.05 + 0.03, 1e-12);
    }
    free(x);
    studio_close(&s);
}

/* lasting loads stay where they were, whatever the numbers of nodes are now: by an edit and by its undo */
static void lasting_loads_stay_by_place(void)
{
    const double force[2][3] = {{0.1, 0, -0.2}, {0, 0.3, 0}};
    studio s;
    REQUIRE(studio_open(&s));
    const pal_body *body = pal_world_body(s.world, 0);
    int at[2] = {0, body->n_node - 1};
    double place[2][3];
    for (int k = 0; k < 2; k++) {
        for (int c = 0; c < 3; c++) place[k][c] = body->node_rest[3 * at[k] + c];
        REQUIRE(!pal_world_load(s.world, 0, at[k], force[k]));
    }
    int n_before = body->n_node;
    for (int turn = 0; turn < 2; turn++) {
        if (turn == 0)
            REQUIRE(!edit(&s, (pal_cells_command){PAL_CELLS_EXTRUDE, .face = top_face(pal_sculptor_cells(s.sculptor)),
                                                  .distance_m = 0.03, .scale = 1}));
        else
            REQUIRE(!turn_back(&s, PAL_SCULPT_UNDO));
        body = pal_world_body(s.world, 0);
        REQUIRE(body->external_force != NULL);
        if (turn == 0) CHECK(body->n_node > n_before);
        double sum[3] = {0};
        int n_loaded = 0;
        for (int i = 0; i < body->n_node; i++) {
            const double *f = body->external_force + 3 * i;
            for (int c = 0; c < 3; c++) sum[c] += f[c];
            if (f[0] == 0 && f[1] == 0 && f[2] == 0) continue;
            int k = f[1] != 0;
            double far = 0;
            for (int c = 0; c < 3; c++) far = fmax(far, fabs(body->node_rest[3 * i + c] - place[k][c]));
            CHECK_LE(far, 0.01); /* of 0.1 m */
            n_loaded++;
        }
        CHECK_INT(n_loaded, 2);
        for (int c = 0; c < 3; c++) CHECK_NEAR(sum[c], force[0][c] + force[1][c], 1e-15);
    }
    studio_close(&s);
}

static void a_material_set_while_an_edit_is_made_is_kept(void)
{
    studio s;
    pal_sculpt_edit *turn = NULL;
    pal_world *next = NULL, *stiff = NULL;
    const pal_stroke stroke = {{0.05, 0.05, 0.05}, 0.04, 0.5, 2, 3};
    REQUIRE(studio_open(&s));
    pal_scene *scene = malloc(sizeof *scene);
    REQUIRE(scene != NULL);
    CHECK_INT(pal_sculptor_prepare(s.sculptor, s.scene, &(pal_sculpt){.kind = PAL_SCULPT_PAINT, .stroke = stroke},
                                   &diag, &turn),
              0);
    CHECK_INT(pal_world_create(pal_sculpt_edit_scene(turn), &diag, &next), 0);
    /* now the slider moves */
    *scene = *pal_sculpt_edit_scene(turn);
    scene->body[0].material.young_Pa *= 8, scene->body[0].material.density_kg_m3 *= 2;
    CHECK_INT(pal_world_material(s.world, 0, &scene->body[0].material, &diag), 0);
    CHECK_INT(pal_world_create(scene, &diag, &stiff), 0);
    pal_sculpt_transfer(turn, next, s.world);
    pal_body *a = pal_world_body(next, 0), *b = pal_world_body(stiff, 0);
    for (int i = 0; i < a->n_dof; i++) a->v[3 * i] = b->v[3 * i] = a->x_rest[3 * i + 2];
    for (int k = 0; k < 5; k++) {
        CHECK_INT(pal_world_step(next, scene->step_s), 0);
        CHECK_INT(pal_world_step(stiff, scene->step_s), 0);
    }
    double off = 0, way = 0;
    for (int i = 0; i < 3 * a->n_dof; i++) {
        off = fmax(off, fabs(a->x[i] - b->x[i]));
        way = fmax(way, fabs(a->x[i] - a->x_rest[i]));
    }
    CHECK_LE(1e-6, way);
    CHECK_LE(off, 1e-6 * way);
    pal_world_destroy(next);
    pal_world_destroy(stiff);
    pal_sculpt_edit_free(turn);
    free(scene);
    studio_close(&s);
}

static void undo_and_redo_bring_back_every_bit(void)
{
    studio s;
    uint64_t print[5];
    REQUIRE(studio_open(&s));
    const pal_stroke stroke = {{0.05, 0.05, 0.05}, 0.04, 0.5, 20, 3};
    steps(&s, 2);
    print[0] = print_of(s.scene, s.world);
    int32_t face = top_face(pal_sculptor_cells(s.sculptor));
    CHECK_INT(edit(&s, (pal_cells_command){PAL_CELLS_EXTRUDE, .face = face, .distance_m = 0.02, .scale = 0.8}), 0);
    print[1] = print_of(s.scene, s.world);
    CHECK_INT(studio_do(&s, &(pal_sculpt){.kind = PAL_SCULPT_PAINT, .stroke = stroke}), 0);
    print[2] = print_of(s.scene, s.world);
    CHECK_INT(edit(&s, (pal_cells_command){PAL_CELLS_DELETE, .cell = 7}), 0);
    print[3] = print_of(s.scene, s.world);
    CHECK_INT(edit(&s, (pal_cells_command){PAL_CELLS_SHARPEN_EDGE, .edge = 0, .sharp = 2}), 0);
    print[4] = print_of(s.scene, s.world);
    for (int k = 1; k < 5; k++) CHECK(print[k] != print[k - 1]);
    for (int k = 3; k >= 0; k--) {
        CHECK_INT(turn_back(&s, PAL_SCULPT_UNDO), 0);
        CHECK(print_of(s.scene, s.world) == print[k]);
        CHECK_INT(pal_sculptor_undo_count(s.sculptor), k);
    }
    CHECK(cells_equal(pal_sculptor_cells(s.sculptor), &clay.cells));
    CHECK_INT(turn_back(&s, PAL_SCULPT_UNDO), PAL_ERR_REFUSED);
    CHECK_TEXT(diag.text, "there is nothing to undo");
    for (int k = 1; k < 5; k++) {
        CHECK_INT(turn_back(&s, PAL_SCULPT_REDO), 0);
        CHECK(print_of(s.scene, s.world) == print[k]);
    }
    CHECK_INT(turn_back(&s, PAL_SCULPT_REDO), PAL_ERR_REFUSED);
    /* another command makes another future */
    CHECK_INT(turn_back(&s, PAL_SCULPT_UNDO), 0);
    CHECK_INT(studio_do(&s, &(pal_sculpt){.kind = PAL_SCULPT_PAINT, .stroke = stroke}), 0);
    CHECK_INT(pal_sculptor_redo_count(s.sculptor), 0);
    studio_close(&s);
}

/* the shape under its load becomes the shape at rest: no force any more, and it stays there */
static void a_shape_that_is_kept_rests_where_it_is(void)
{
    studio s;
    REQUIRE(studio_open(&s));
    pal_body *body = pal_world_body(s.world, 0);
    for (int i = 0; i < body->n_dof; i++) body->x[3 * i] += 0.2 * (body->x[3 * i + 2] + 0.05);
    pal_world_invalidate_limits(s.world, 0);
    CHECK(pal_world_energy_J(s.world) > 1e-6);
    int n = body->n_dof;
    double *x = malloc(3 * sizeof *x * (size_t)n);
    memcpy(x, body->x, 3 * sizeof *x * (size_t)n);
    CHECK_INT(studio_do(&s, &(pal_sculpt){.kind = PAL_SCULPT_SET_REST, .point_m = x, .n_point = n - 1}),
              PAL_ERR_REFUSED);
    CHECK_INT(studio_do(&s, &(pal_sculpt){.kind = PAL_SCULPT_SET_REST, .point_m = x, .n_point = n}), 0);
    body = pal_world_body(s.world, 0);
    CHECK(!memcmp(body->x_rest, x, 3 * sizeof *x * (size_t)n));
    CHECK_LE(pal_world_energy_J(s.world), 1e-16);
    steps(&s, 20);
    double max = 0;
    for (int i = 0; i < 3 * n; i++) max = fmax(max, fabs(pal_world_body(s.world, 0)->x[i] - x[i]));
    CHECK_LE(max, 1e-12);
    /* and what is folded cannot be kept */
    for (int i = 0; i < n; i++) x[3 * i + 2] = -x[3 * i + 2];
    CHECK_INT(studio_do(&s, &(pal_sculpt){.kind = PAL_SCULPT_SET_REST, .point_m = x, .n_point = n}), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "control cell 0"));
    free(x);
    studio_close(&s);
}

static void paint_makes_heavier_and_stiffer_where_it_is(void)
{
    studio s;
    REQUIRE(studio_open(&s));
    double kg = solid_mass_kg(pal_world_body(s.world, 0)->model.solid);
    double litre = pal_subdivision_solid_volume_m3(pal_world_body(s.world, 0)->model.solid);
    CHECK_NEAR(kg, 1000 * litre, 1e-9 * kg);
    /* a hard brush over all of it */
    pal_stroke all = {{0, 0, 0}, 1, 0, 2, 5};
    CHECK_INT(studio_do(&s, &(pal_sculpt){.kind = PAL_SCULPT_PAINT, .stroke = all}), 0);
    CHECK_NEAR(solid_mass_kg(pal_world_body(s.world, 0)->model.solid), 5 * kg, 1e-6 * kg);
    CHECK_NEAR(pal_world_body(s.world, 0)->model.solid->samples[PAL_CELL_HEX].young_Pa[17], 10000, 1e-2);
    static const struct {
        pal_stroke stroke;
        const char *expected;
    } bad[] = {{{{0, 0, 0}, 0, 0, 1, 1}, "radius_m: 0"},     {{{0, 0, 0}, NAN, 0, 1, 1}, "radius_m: nan"},
               {{{0, 0, 0}, 1, 2, 1, 1}, "softness: 2"},     {{{0, NAN, 0}, 1, 0, 1, 1}, "at_m[1]"},
               {{{0, 0, 0}, 1, 0, 0, 1}, "young_factor: 0"}, {{{0, 0, 0}, 1, 0, 1, INFINITY}, "density_factor: inf"}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        CHECK_INT(studio_do(&s, &(pal_sculpt){.kind = PAL_SCULPT_PAINT, .stroke = bad[i].stroke}), PAL_ERR_REFUSED);
        if (!strstr(diag.text, bad[i].expected)) CHECK_FAIL("\"%s\" does not name %s", diag.text, bad[i].expected);
    }
    CHECK_INT(pal_sculptor_undo_count(s.sculptor), 1);
    studio_close(&s);
}

/* ---- thousands of commands ---- */

static uint64_t draw;
static double chance(void)
{
    return pal_random_unit(42, draw++);
}
static int32_t any_of(int32_t n)
{
    int32_t i = (int32_t)(chance() * n);
    return i < n ? i : n - 1;
}

static pal_sculpt any_command(const pal_sculptor *sculptor)
{
    const pal_cells *c = pal_sculptor_cells(sculptor);
    double what = chance();
    pal_sculpt to = {.kind = PAL_SCULPT_CELLS};
    to.cells = (pal_cells_command){.cell = any_of(c->n_cell),
                                   .face = any_of(c->n_face),
                                   .other_face = any_of(c->n_face),
                                   .edge = any_of(c->n_edge),
                                   .vertex = any_of(c->n_vertex),
                                   .distance_m = 0.01 + 0.04 * chance(),
                                   .scale = 0.6 + 0.6 * chance(),
                                   .sharp = (float)(3 * chance())};
    bool large = c->n_cell > 14;
    to.cells.kind = what < (large ? 0.6 : 0.15) ? PAL_CELLS_DELETE
                    : what < 0.7                ? PAL_CELLS_EXTRUDE
                    : what < 0.76               ? PAL_CELLS_MERGE
                    : what < 0.82               ? PAL_CELLS_BRIDGE
                    : what < 0.84 && !large     ? PAL_CELLS_DIVIDE
                    : what < 0.88               ? PAL_CELLS_SHARPEN_EDGE
                    : what < 0.92               ? PAL_CELLS_SHARPEN_VERTEX
                                                : PAL_CELLS_COMMAND_KINDS;
    if (to.cells.kind != PAL_CELLS_COMMAND_KINDS) return to;
    to.kind = what < 0.96 ? PAL_SCULPT_PAINT : what < 0.985 ? PAL_SCULPT_UNDO : PAL_SCULPT_REDO;
    to.stroke = (pal_stroke){{0.1 * chance() - 0.05, 0.1 * chance() - 0.05, 0.1 * chance() - 0.05},
                             0.01 + 0.05 * chance(),
                             chance(),
                             exp(2 * chance() - 1),
                             exp(2 * chance() - 1)};
    return to;
}

/* what must hold after every command that was taken */
static void check_solid(const studio *s)
{
    const pal_subdivision_solid *solid = pal_world_body(s->world, 0)->model.solid;
    const pal_body *body = pal_world_body(s->world, 0);
    if (cells_check(pal_sculptor_cells(s->sculptor), NULL, &diag)) CHECK_FAIL("%s", diag.text);
    double kg = solid_mass_kg(solid), sum = 0;
    CHECK(pal_subdivision_solid_volume_m3(solid) > 0);
    for (int i = 0; i < body->n_node; i++) sum += body->node_mass_kg[i];
    CHECK_NEAR(sum, kg, 1e-9 * kg);
    CHECK(pal_body_finite(body));
}

static void five_thousand_commands_leave_a_solid_and_undo_the_start(void)
{
    studio s;
    const int wanted = CHECK_REPEATS(5000, 250);
    int n_done = 0, n_refused = 0, n_round = 0;
    REQUIRE(studio_open(&s));
    while (n_done < wanted && !check_bad) {
        /* elements of a level take eight times as long as the control cells themselves, which have the rounds between
         */
        studio_close(&s);
        pal_entry_init(&clay.scene.body[0].model, "model", "subdivision_fem");
        CHECK(!pal_entry_put_number(&clay.scene.body[0].model, "levels", n_round % 8 == 0, &diag));
        REQUIRE(studio_open(&s));
        steps(&s, 1 + n_round++ % 3);
        /* as many as can be undone, then all of them back */
        uint64_t start = print_of(s.scene, s.world);
        int base = pal_sculptor_undo_count(s.sculptor);
        for (int k = 0; k < 60 && !check_bad; k++) {
            pal_sculpt command = any_command(s.sculptor);
            if (command.kind == PAL_SCULPT_UNDO && pal_sculptor_undo_count(s.sculptor) <= base) continue;
            uint64_t before = print_of(s.scene, s.world);
            if (studio_do(&s, &command)) {
                n_refused++;
                CHECK(diag.text[0]);
                CHECK(print_of(s.scene, s.world) == before);
                continue;
            }
            n_done++;
            check_solid(&s);
        }
        for (int guard = 0; pal_sculptor_undo_count(s.sculptor) > base && guard < 70; guard++, n_done++) {
            CHECK_INT(turn_back(&s, PAL_SCULPT_UNDO), 0);
            check_solid(&s);
        }
        CHECK(print_of(s.scene, s.world) == start);
    }
    printf("  %d commands taken, those undone with them, %d refused\n", n_done, n_refused);
    CHECK_LE(n_refused, 3 * n_done);
    studio_close(&s);
}

int main(void)
{
    clay_make(&clay, 2, 0.1);
    RUN(a_body_goes_on_where_it_was_with_a_cell_more);
    RUN(lasting_loads_stay_by_place);
    RUN(a_material_set_while_an_edit_is_made_is_kept);
    RUN(undo_and_redo_bring_back_every_bit);
    RUN(a_shape_that_is_kept_rests_where_it_is);
    RUN(paint_makes_heavier_and_stiffer_where_it_is);
    RUN(five_thousand_commands_leave_a_solid_and_undo_the_start);
    clay_free(&clay);
    return check_report();
}
