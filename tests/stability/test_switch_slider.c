/* The slider moved at random while a tool pulls: twenty live switches (server/sim/transfer/transfer.h) of an organ and
 * of a beam, some rehearsed, some before the one before has been let in, the hand going on meanwhile. No frame tears:
 * no shown vertex goes farther in a frame than the errors of both configurations allow, no edge that is shown is drawn
 * out, the grip holds and pulls without a jump, and at last pulls as if only the last configuration had ever been
 * there. --table prints every switch, --sweep MM SEEDS the worst of an organ pulled by MM mm with each of so many
 * seeds, and asserts nothing. */
#include "server/mesh/geometry/procedural.h"
#include "server/num/random.h"
#include "tests/stability/hard_case.h"
#include "tests/stability/switch_beam.h"

enum { SWITCHES = 20, SETTINGS = 4 };

static bool sweep;

static const pal_configuration list[SETTINGS] = {
    {.model = "tet_springs", .size = 9, .k_area_J = -1},
    {.model = "fem", .element = "hex8_bbar", .size = 7},
    {.model = "fem", .element = "tet4", .size = 8, .step_s = 1.0 / 120},
    {.model = "fem", .element = "hex8_bbar", .size = 10},
};

/* what is pulled, where and by how much, and how far each configuration rests from the right one when it is */
typedef struct pulled {
    pal_scene *scene;
    pal_configured_scene *set[SETTINGS + 1]; /* the last is the right one */
    double from_m[3], by_m[3], error_m[SETTINGS];
    bool at_once; /* the tool comes with its button down, so that it holds what it did not press before */
} pulled;

static void pull_to(const pulled *p, pal_world *w, double part)
{
    pal_pose pose = at(p->from_m[0], p->from_m[1], p->from_m[2], part > 0);
    pal_axpy3(pose.position_m, part, p->by_m);
    pal_world_pose(w, 0, &pose);
}

/* the grip closes, leads tissue away within half a second and holds it for another */
static void pull(const pulled *p, pal_world *w, double step_s)
{
    for (double t = 0; t < 1; t += step_s) {
        pull_to(p, w, !p->at_once && t < 1.5 / 60 ? 0 : fmax(1e-6, fmin(1, 2 * t)));
        step(w, step_s, 1);
    }
}

/* largest length of a shown edge over that at rest */
static double longest_edge(const pal_world *w)
{
    const pal_body *b = pal_world_view_body(w, 0);
    pal_shown shown;
    double max = 0;
    pal_world_shown(w, 0, &shown);
    for (int t = 0; t < shown.n_tri; t++)
        for (int c = 0; c < 3; c++) {
            size_t i = 3 * (size_t)shown.tri[3 * t + c], j = 3 * (size_t)shown.tri[3 * t + (c + 1) % 3];
            double now = 0, rest = 0;
            for (size_t k = 0; k < 3; k++) {
                now += pow((double)b->display.shown[i + k] - (double)b->display.shown[j + k], 2);
                rest += pow((double)shown.rest_m[i + k] - (double)shown.rest_m[j + k], 2);
            }
            max = fmax(max, sqrt(now / rest));
        }
    return max;
}

/* where configurations rest under the pull, and the longest edge of any */
static double find_errors(pulled *p)
{
    pal_world *right = open_world(&p->set[SETTINGS]->scene);
    double longest = 0;
    pull(p, right, 1.0 / 60);
    for (int i = 0; i < SETTINGS; i++) {
        pal_world *w = open_world(&p->set[i]->scene);
        const pal_body *a = pal_world_view_body(w, 0), *b = pal_world_view_body(right, 0);
        pull(p, w, p->set[i]->scene.step_s);
        if (a->display.n_shown != b->display.n_shown) abort();
        p->error_m[i] = check_farthest(a->display.shown, b->display.shown, b->display.n_shown);
        longest = fmax(longest, longest_edge(w));
        if (table) printf("  configuration %d: off by %.2f mm\n", i, 1e3 * p->error_m[i]);
        pal_world_destroy(w);
    }
    pal_world_destroy(right);
    return longest;
}

/* of all switches of a seed */
typedef struct worst {
    double frame_m, energy, force;
    int n_energy; /* switches that are off by more than 2 % */
} worst;

typedef struct seen {
    double frame, edge, min_N, max_N, first_J; /* first_J: kinetic energy after a step */
} seen;

/* n steps, in units of bound_m for what goes in a frame */
static void watch(const pulled *p, pal_world *w, double step_s, int n, double bound_m, float *last, double *part,
                  seen *out)
{
    const pal_body *b = pal_world_view_body(w, 0);
    const double *force_N = pal_world_tools(w)->tool[0].mean_force_N;
    for (int k = 0; k < n; k++) {
        *part = fmin(1.2, *part + 0.002);
        pull_to(p, w, *part);
        step(w, step_s, 1);
        if (k == 0) out->first_J = pal_body_kinetic_J(b);
        out->frame = fmax(out->frame, check_farthest(last, b->display.shown, b->display.n_shown) / bound_m);
        out->edge = fmax(out->edge, longest_edge(w));
        out->min_N = fmin(out->min_N, pal_norm3(force_N)), out->max_N = fmax(out->max_N, pal_norm3(force_N));
        memcpy(last, b->display.shown, 3 * sizeof *last * (size_t)b->display.n_shown);
        CHECK(pal_world_tools(w)->tool[0].holding && !b->frozen);
    }
}

static pal_world *change(const pulled *p, int from, int to, bool has_rehearsed, pal_world *w, pal_transfer_report *out)
{
    pal_transfer *x = NULL;
    pal_diagnostic diag = {""};
    if (pal_transfer_make(&p->set[from]->scene, &p->set[to]->scene, 0, &diag, &x)) CHECK_FAIL("%s", diag.text);
    pal_world *next = open_world(&p->set[to]->scene);
    if (has_rehearsed) {
        CHECK(pal_transfer_snapshot(x, w));
        pal_transfer_rehearse(x, next);
    }
    pal_transfer_apply(x, next, w, out);
    if (!sweep) CHECK_NEAR(out->energy_after_J / out->energy_before_J, 1, 0.02);
    pal_transfer_free(x);
    pal_world_destroy(w);
    return next;
}

/* what a world pulls with that stood in a configuration from the start, or (as a dent that a tool pressed before it
 * closed is another one in each) went there at once, with the hand where it is after all switches */
static double pull_of(const pulled *p, int configuration, double part)
{
    const int first = p->at_once ? configuration : 0;
    const double step_s = p->set[configuration]->scene.step_s;
    pal_transfer_report r;
    pal_world *w = open_world(&p->set[first]->scene);
    pull(p, w, p->set[first]->scene.step_s);
    if (configuration != first) w = change(p, first, configuration, false, w, &r);
    for (double t = 0, at = 1; t < 2; t += step_s) {
        at = fmin(part, at + 0.4 * step_s);
        pull_to(p, w, at);
        step(w, step_s, 1);
    }
    double force_N = pal_norm3(pal_world_tools(w)->tool[0].mean_force_N);
    pal_world_destroy(w);
    return force_N;
}

/* what one switch showed, against what the configurations and the way pulled allow */
static void judge(const pulled *p, int to, const seen *s, double bound_m, double longest, double energy_J)
{
    HARD_CASE("switch", list[to].model,
              "slider under a pull: farthest move of the surface in a frame, over the "
              "errors of both",
              s->frame, 1, "");
    /* light nodes at the rim of cut elements are not thrown */
    HARD_CASE("switch", list[to].model, "slider under a pull: farthest move in a frame, of the way pulled",
              100 * s->frame * bound_m / pal_norm3(p->by_m), 10, "%");
    HARD_CASE("switch", list[to].model, "slider under a pull: longest edge over the longest without a switch",
              s->edge / longest, 1.25, "");
    /* what was not let go yet is not lost at the next switch: nothing springs back */
    CHECK_LE(s->first_J, 0.09 * energy_J);
}

/* no switch has taken anything from the pull for good: a second later, in which the body's own damping lets go what is
 * left, force over that of a world without the other switches, less 1 */
static double force_left(const pulled *p, int configuration, double part, pal_world *w)
{
    const double step_s = p->set[configuration]->scene.step_s;
    step(w, step_s, (int)(1 / step_s));
    const double now_N = pal_norm3(pal_world_tools(w)->tool[0].mean_force_N), right_N = pull_of(p, configuration, part);
    if (table) printf("  at last %.3f N, without the other switches %.3f N\n", now_N, right_N);
    return now_N / right_N - 1;
}

static worst slide(pulled *p, uint64_t seed)
{
    const double longest = sweep && !table ? 1 : find_errors(p);
    int at_configuration = 0;
    double part = 1;
    worst all = {0};
    pal_world *w = open_world(&p->set[0]->scene);
    pull(p, w, p->set[0]->scene.step_s);
    const size_t n_byte = 3 * sizeof(float) * (size_t)pal_world_view_body(w, 0)->display.n_shown;
    float *last = malloc(n_byte);
    if (!last) abort();
    memcpy(last, pal_world_view_body(w, 0)->display.shown, n_byte);
    for (uint64_t k = 0; k < SWITCHES; k++) {
        int to = (at_configuration + 1 + (int)(pal_random_unit(seed, 3 * k) * (SETTINGS - 1))) % SETTINGS;
        int n = 2 + (int)(12 * pal_random_unit(seed, 3 * k + 1));
        pal_transfer_report r;
        double before_N = pal_norm3(pal_world_tools(w)->tool[0].mean_force_N);
        seen s = {.min_N = before_N, .max_N = before_N};
        double bound_m = sweep ? 1 : p->error_m[at_configuration] + p->error_m[to];
        w = change(p, at_configuration, to, pal_random_unit(seed, 3 * k + 2) < 0.5, w, &r);
        CHECK_LE(
            check_farthest(last, pal_world_view_body(w, 0)->display.shown, pal_world_view_body(w, 0)->display.n_shown),
            1e-6);
        watch(p, w, p->set[to]->scene.step_s, n, bound_m, last, &part, &s);
        double energy = r.energy_after_J / r.energy_before_J - 1;
        if (table)
            printf("  %d -> %d, %2d steps: %.3f of %.2f mm in a frame, edges %.2f (%.2f), force %.2f, %.2f to %.2f N, "
                   "energy %+.2f %%, kinetic %.4f of all\n",
                   at_configuration, to, n, s.frame, 1e3 * bound_m, s.edge, longest, before_N, s.min_N, s.max_N,
                   100 * energy, s.first_J / r.energy_before_J);
        if (!sweep) judge(p, to, &s, bound_m, longest, r.energy_before_J);
        all.frame_m = fmax(all.frame_m, s.frame * bound_m);
        all.energy = fmax(all.energy, fabs(energy)), all.n_energy += fabs(energy) > 0.02;
        at_configuration = to;
    }
    all.force = force_left(p, at_configuration, part, w);
    if (!sweep)
        HARD_CASE("switch", list[at_configuration].model,
                  "slider under a pull: off the force without the other switches", 100 * fabs(all.force), 5, "%");
    free(last);
    pal_world_destroy(w);
    return all;
}

typedef struct how {
    int along; /* gripped at the vertex farthest along this axis, held at the other end */
    bool at_once;
    double by_m;
    uint64_t seed;
} how;

static void make_pulled(const pal_surface *surface, const how *h, pal_prepared *mesh, pulled *out)
{
    const pal_configuration right = {.model = "fem", .element = "hex8_bbar", .size = 12};
    const pal_voxel_options options = {.resolution = 9, .border = true};
    pal_diagnostic diag = {""};
    pal_prepare_report report;
    *out = (pulled){.by_m = {0, 0, h->by_m}, .at_once = h->at_once};
    if (pal_prepared_make(surface, &options, mesh, &report, &diag)) abort();
    pal_scene *scene = out->scene = malloc(sizeof *scene);
    if (!scene) abort();
    pal_scene_default(scene);
    scene->up[0] = h->along == 0, scene->up[1] = 0, scene->up[2] = h->along == 2;
    pal_body_def *def = &scene->body[0];
    pal_body_default(def, "thing", mesh);
    scene->n_body = 1;
    scene->step_s = 1.0 / 60;
    def->material = (pal_material){.young_Pa = 8e3, .poisson = 0.4, .density_kg_m3 = 1050, .damping_1_s = 8};
    def->support[0].fraction = 0.15;
    add_effects(def, false);
    pal_tools_default(scene, 1);
    scene->tool[0].radius_m = 0.015;
    int top = 0;
    for (int i = 0; i < surface->n_vertex; i++)
        if (surface->x[3 * i + h->along] > surface->x[3 * top + h->along]) top = i;
    pal_copy3(out->from_m, surface->x + 3 * (size_t)top);
    for (int i = 0; i <= SETTINGS; i++)
        if (pal_configuration_make(scene, 0, i < SETTINGS ? &list[i] : &right, &diag, &out->set[i]))
            CHECK_FAIL("%s", diag.text);
}

static void free_pulled(pulled *p, pal_prepared *mesh)
{
    for (int i = 0; i <= SETTINGS; i++) pal_configured_scene_free(p->set[i]);
    pal_prepared_free(mesh);
    free(p->scene);
}

static worst pull_and_slide(const pal_surface *surface, const how *h)
{
    pal_prepared mesh;
    pulled p;
    make_pulled(surface, h, &mesh, &p);
    worst all = slide(&p, h->seed);
    free_pulled(&p, &mesh);
    return all;
}

static void an_organ_under_a_pull_does_not_tear(void)
{
    pal_surface organ;
    REQUIRE(!pal_organ_make(1500, &organ));
    (void)pull_and_slide(&organ, &(how){.along = 2, .by_m = 0.03, .seed = 7});
    pal_surface_free(&organ);
}

static void a_beam_under_a_pull_does_not_tear(void)
{
    const int32_t count[3] = {16, 4, 4};
    const double size[3] = {LENGTH, WIDTH, WIDTH};
    pal_cells cells;
    pal_surface surface = {0};
    REQUIRE(!pal_cells_block(count, size, &cells, NULL));
    REQUIRE(!pal_cells_boundary(&cells, &surface, NULL, NULL));
    for (int k = 0; k < 2; k++) (void)pull_and_slide(&surface, &(how){.at_once = k == 1, .by_m = 0.02, .seed = 11});
    pal_surface_free(&surface);
    pal_cells_free(&cells);
}

/* cubes that a pull crushes do not enter and leave regions for ever */
static void crushed_cubes_come_to_rest(void)
{
    enum { COARSE = 1 };
    pal_surface organ;
    pal_prepared mesh;
    pulled p;
    REQUIRE(!pal_organ_make(1500, &organ));
    make_pulled(&organ, &(how){.along = 2, .by_m = 0.04}, &mesh, &p);
    pal_world *w = open_world(&p.set[COARSE]->scene);
    pull(&p, w, 1.0 / 60);
    const pal_safeguards *r = &pal_world_view_body(w, 0)->safeguards;
    const uint64_t before = r->n_change;
    CHECK(r->n_inversion > 0);
    step(w, 1.0 / 60, 120);
    if (table) printf("  %d changes in a second, %d in the next two\n", (int)before, (int)(r->n_change - before));
    CHECK_LE((double)(r->n_change - before), 2);
    pal_world_destroy(w);
    free_pulled(&p, &mesh);
    pal_surface_free(&organ);
}

static int sweep_seeds(double by_m, int n_seed)
{
    pal_surface organ;
    worst max = {0};
    if (pal_organ_make(1500, &organ)) return 1;
    for (uint64_t seed = 1; seed <= (uint64_t)n_seed; seed++) {
        worst one = pull_and_slide(&organ, &(how){.along = 2, .by_m = by_m, .seed = seed});
        printf("seed %d: %.2f mm in a frame (%.1f %% of the way), energy off by %.2f %%, at last by %+.1f %% of the "
               "force\n",
               (int)seed, 1e3 * one.frame_m, 100 * one.frame_m / by_m, 100 * one.energy, 100 * one.force);
        max.frame_m = fmax(max.frame_m, one.frame_m), max.energy = fmax(max.energy, one.energy);
        max.force = fmax(max.force, fabs(one.force)), max.n_energy += one.n_energy;
    }
    printf("worst of %d: %.2f mm (%.1f %%), %.2f %%, %d switches beyond 2 %%, %.1f %%\n", n_seed, 1e3 * max.frame_m,
           100 * max.frame_m / by_m, 100 * max.energy, max.n_energy, 100 * max.force);
    pal_surface_free(&organ);
    return 0;
}

int main(int argc, char **argv)
{
    table = argc > 1 && !strcmp(argv[1], "--table");
    table = table || argc > 4;
    sweep = argc > 3 && !strcmp(argv[1], "--sweep");
    if (sweep) return sweep_seeds(1e-3 * atof(argv[2]), atoi(argv[3]));
    RUN(an_organ_under_a_pull_does_not_tear);
    RUN(a_beam_under_a_pull_does_not_tear);
    RUN(crushed_cubes_come_to_rest);
    return check_report();
}
