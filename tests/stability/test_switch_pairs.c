/* The state of a running body goes over to another method, element, law, solver or resolution
 * (server/sim/transfer/transfer.h): every pair of configurations on a beam that bends, moves and is pressed by a tool.
 * --table prints what every pair does. */
#include "tests/stability/hard_case.h"
#include "tests/stability/switch_beam.h"

static const pal_configuration solid[] = {
    {.model = "subdivision_fem", .size = 1},
    {.model = "subdivision_fem", .size = 2, .solver = "implicit_euler"},
    {.model = "fem", .element = "hex8_bbar", .size = 8},
    {.model = "fem", .element = "tet4", .size = 12},
};

static void make_all(beam *b, const pal_configuration *list, int n, bool cells)
{
    const pal_configuration fine = {.model = "fem", .element = "hex8_bbar", .size = cells ? 12 : 16};
    begin(b, cells, true, 2);
    b->scene->tool[0].force_cap_N = 3;
    for (int i = 0; i < n; i++) add_configuration(b, &list[i]);
    add_configuration(b, &fine);
    for (int i = 0; i < n; i++) b->rest_m[i] = find_rest(&b->set[i]->scene);
    b->right_m = find_rest(&b->set[n]->scene);
    pal_configured_scene_free(b->set[--b->n]);
}

static void print_row(const beam *b, int i, int j, const pal_transfer_report *r, const double tip[2])
{
    char from[PAL_CONFIGURATION_TEXT], to[PAL_CONFIGURATION_TEXT];
    pal_configuration s;
    pal_configuration_of(&b->set[i]->scene, 0, &s), pal_configuration_text(&s, from);
    pal_configuration_of(&b->set[j]->scene, 0, &s), pal_configuration_text(&s, to);
    printf("  %-40.40s -> %-40.40s energy %+6.1f %% by interpolation, %+6.3f %%; %2d rounds, scale %.4f; tip %.1f -> "
           "%.1f mm; of both methods' errors %.2f\n",
           from, to, 100 * (r->interpolated_J / r->energy_before_J - 1),
           100 * (r->energy_after_J / r->energy_before_J - 1), r->n_smooth, r->scale, 1e3 * tip[0], 1e3 * tip[1],
           fabs(tip[1] - tip[0]) / fabs(tip[0]) * fabs(b->right_m) /
               (fabs(b->rest_m[i] - b->right_m) + fabs(b->rest_m[j] - b->right_m)));
}

/* one pair from the state that `before` is in */
static void check_pair(const beam *b, int i, int j, pal_world *before)
{
    pal_transfer *x = NULL;
    pal_transfer_report r;
    pal_diagnostic diag = {""};
    double u[3], v[3], to_u[3], to_v[3], step_s = b->set[j]->scene.step_s;
    if (pal_transfer_make(&b->set[i]->scene, &b->set[j]->scene, 0, &diag, &x)) CHECK_FAIL("%s", diag.text);
    pal_world *next = open_world(&b->set[j]->scene);
    uint64_t hash = pal_world_hash(before);
    tip_of(before, u, v);
    pal_transfer_apply(x, next, before, &r);
    tip_of(next, to_u, to_v);
    if (table) print_row(b, i, j, &r, (double[2]){u[2], to_u[2]});
    CHECK(pal_world_hash(before) == hash);
    const char *const model = b->set[j]->scene.body[0].model.name;
    HARD_CASE("switch", model, "to it from every other configuration: energy jumps by",
              100 * fabs(r.energy_after_J / r.energy_before_J - 1), 2, "%");
    /* the shown bound: both methods' errors, as parts of what they bend by, and a hair for the shapes that differ */
    double bound = fabs(b->rest_m[i] - b->right_m) + fabs(b->rest_m[j] - b->right_m);
    HARD_CASE("switch", model, "tip jumps by, over the bound of both methods' errors",
              fabs(to_u[2] - u[2]) / ((bound / fabs(b->right_m) + 0.01) * fabs(u[2])), 1, "");
    HARD_CASE("switch", model, "farthest move of the surface, over the same bound",
              r.max_move_m / ((bound / fabs(b->right_m) + 0.01) * pal_norm3(u)), 1, "");
    if (table)
        printf("      most %.2f of %.2f mm\n", 1e3 * r.max_move_m,
               1e3 * (bound / fabs(b->right_m) + 0.01) * pal_norm3(u));
    CHECK_NEAR(to_v[2] / v[2], 1, 0.1);
    /* it goes on: finite, nothing frozen, no faster than that energy allows */
    step(next, step_s, 8);
    CHECK(pal_body_finite(pal_world_body(next, 0)) && !pal_world_body(next, 0)->frozen);
    CHECK_LE(fabs(tip_z(next)), 0.1);
    pal_world_destroy(next);
    pal_transfer_free(x);
}

static void check_pairs(const pal_configuration *list, int n, bool cells)
{
    beam b;
    make_all(&b, list, n, cells);
    if (table)
        for (int i = 0; i < n; i++) printf("  rests at %.2f of %.2f mm\n", 1e3 * b.rest_m[i], 1e3 * b.right_m);
    for (int i = 0; i < n; i++) {
        pal_world *w = open_world(&b.set[i]->scene);
        CHECK(disturb(w, b.set[i]->scene.step_s));
        for (int j = 0; j < n; j++)
            if (i != j && CHECK_REPEATS(true, (i + j) % 3 == 1)) check_pair(&b, i, j, w);
        pal_world_destroy(w);
    }
    end(&b);
}

static void every_pair_of_a_full_body(void)
{
    check_pairs(full, sizeof full / sizeof *full, false);
}

static void every_pair_of_a_solid(void)
{
    check_pairs(solid, sizeof solid / sizeof *solid, true);
}

int main(int argc, char **argv)
{
    table = argc > 1 && !strcmp(argv[1], "--table");
    RUN(every_pair_of_a_full_body);
    RUN(every_pair_of_a_solid);
    return check_report();
}
