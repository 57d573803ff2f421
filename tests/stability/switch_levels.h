/* The beam's surface as one that adapts, pulled by a grip while its number of levels is switched, for test_switch. */
#ifndef TESTS_STABILITY_SWITCH_LEVELS_H
#define TESTS_STABILITY_SWITCH_LEVELS_H
#include "tests/fixtures/random.h"
#include "tests/stability/switch_beam.h"

enum { LEVELS_MAX_SWITCH = 24 };

/* configurations 0, 1 and 2: 1, 2 and 3 levels */
static void begin_surface(beam *b, bool fixed, double young_Pa, double damping_1_s, pal_prepared *surface)
{
    begin(b, false, fixed, damping_1_s);
    REQUIRE(!pal_prepared_surface(&b->mesh.surface, surface));
    b->scene->body[0].n_support = 1;
    b->scene->body[0].mesh = surface;
    b->scene->body[0].material.young_Pa = young_Pa;
    pal_entry_init(&b->scene->body[0].model, "model", "adaptive_springs");
    pal_entry_put_number(&b->scene->body[0].model, "thickness_m", 0.01, NULL);
    for (int i = 1; i <= 3; i++) add_configuration(b, &(pal_configuration){.model = "adaptive_springs", .size = i});
}

/* farthest that a vertex in use is from x [n][3], NAN: it was not in use; x is then where they are */
static double farthest_vertex(pal_world *w, double *x, int n)
{
    const pal_body *body = pal_world_view_body(w, 0);
    double max = 0;
    for (int k = 0; k < body->n_active; k++) {
        int i = body->active[k];
        if (i < n && !isnan(x[3 * i])) max = fmax(max, pal_dist3(x + 3 * i, body->x + 3 * i));
    }
    for (int i = 0; i < 3 * n; i++) x[i] = NAN;
    for (int k = 0; k < body->n_active; k++) pal_copy3(x + 3 * body->active[k], body->x + 3 * body->active[k]);
    return max;
}

/* a tool closes at `from` and goes up by up_m in `lift` steps, and on by `creep` of that in each step; wait[k] steps in
 * configuration[k], the last one `wait[n]`; turned: all of it a quarter about the x axis */
typedef struct pull_plan {
    bool turned;
    double from_m[3], up_m, creep;
    int lift, n, configuration[LEVELS_MAX_SWITCH + 1], wait[LEVELS_MAX_SWITCH + 1];
} pull_plan;

/* what was worst in rows of switches: energy; way of a vertex in a step, of what is shown; force in the step after a
 * switch; force in the end, N */
typedef struct pulled {
    double energy, frame_m, shown_m, force, end_N;
} pulled;

static inline double grasp_N(pal_world *w)
{
    return pal_norm3(pal_world_tools(w)->tool[0].mean_force_N);
}

static void turn_quarter(double x[3])
{
    pal_set3(x, x[0], -x[2], x[1]);
}

static void turn_body(pal_world *w)
{
    pal_body *body = pal_world_body(w, 0);
    for (int k = 0; k < body->n_active; k++) turn_quarter(body->x + 3 * body->active[k]);
    pal_world_invalidate_limits(w, 0);
    step(w, 1.0 / 60, 1); /* and is shown there */
}

static void pull_step(pal_world *w, const pull_plan *p, int k)
{
    double part = k < p->lift ? (double)k / p->lift : fmin(1.2, 1 + p->creep * (k - p->lift));
    pal_pose pose = at(p->from_m[0], p->from_m[1], p->from_m[2] + p->up_m * part, 1);
    if (p->turned) turn_quarter(pose.position_m);
    pal_world_pose(w, 0, &pose);
    step(w, 1.0 / 60, 1);
}

static pal_world *change_levels(const beam *b, int from, int to, pal_world *w, pulled *out)
{
    pal_world *next = open_world(&b->set[to]->scene);
    pal_transfer *change = NULL;
    pal_diagnostic diag = {""};
    pal_transfer_report r;
    if (pal_transfer_make(&b->set[from]->scene, &b->set[to]->scene, 0, &diag, &change)) CHECK_FAIL("%s", diag.text);
    pal_transfer_apply(change, next, w, &r);
    out->energy = fmax(out->energy, fabs(r.energy_after_J / r.energy_before_J - 1));
    out->shown_m = fmax(out->shown_m, r.frame_move_m);
    pal_transfer_free(change);
    pal_world_destroy(w);
    return next;
}

static void pull_and_switch(const beam *b, const pull_plan *p, pulled *out)
{
    pal_world *w = open_world(&b->set[p->configuration[0]]->scene), *finest = open_world(&b->set[2]->scene);
    int n = pal_world_view_body(finest, 0)->n_node, k = 0;
    double *x = calloc(3 * (size_t)n, sizeof *x);
    REQUIRE(x != NULL);
    pal_world_destroy(finest);
    if (p->turned) turn_body(w);
    for (int s = 0; s <= p->n; s++) {
        double was_N = grasp_N(w);
        if (s > 0) w = change_levels(b, p->configuration[s - 1], p->configuration[s], w, out);
        (void)farthest_vertex(w, x, n);
        for (int i = 0; i < p->wait[s]; i++, k++) {
            pull_step(w, p, k);
            double frame_m = farthest_vertex(w, x, n);
            if (k > p->lift) out->frame_m = fmax(out->frame_m, frame_m);
            if (s > 0 && i == 0) out->force = fmax(out->force, fabs(grasp_N(w) / was_N - 1));
        }
        CHECK(pal_world_tools(w)->tool[0].holding && !pal_world_view_body(w, 0)->frozen);
    }
    out->end_N = grasp_N(w);
    free(x);
    pal_world_destroy(w);
}

/* what a body pulls with in the end that was in the last configuration from the start, N */
static double pull_alone_N(const beam *b, const pull_plan *p)
{
    pal_world *w = open_world(&b->set[p->configuration[p->n]]->scene);
    int n = 0;
    for (int s = 0; s <= p->n; s++) n += p->wait[s];
    for (int k = 0; k < n; k++) pull_step(w, p, k);
    double end_N = grasp_N(w);
    pal_world_destroy(w);
    return end_N;
}

/* configurations as the text numbers them, every fourth step another one */
static void plan_of(const char *text, double up_m, int rest, pull_plan *out)
{
    *out = (pull_plan){.from_m = {0.19, 0.025, WIDTH}, .up_m = up_m, .lift = 20};
    for (int s = 0; text[s]; s++) out->configuration[s] = text[s] - '0', out->wait[s] = 4, out->n = s;
    out->wait[0] = 21;
    out->wait[out->n] = rest;
}

/* nineteen switches at random after 2 to 13 steps each, a second after the last one */
static void plan_at_random(uint64_t seed, double up_m, pull_plan *out)
{
    *out = (pull_plan){.from_m = {0.19, 0.025, WIDTH}, .up_m = up_m, .lift = 30, .creep = 0.002, .n = 19};
    out->configuration[0] = 1, out->wait[0] = 90;
    for (int s = 1; s <= out->n; s++) {
        out->configuration[s] = (out->configuration[s - 1] + 1 + (int)(2 * random_unit(&seed))) % 3;
        out->wait[s] = s == out->n ? 60 : 2 + (int)(12 * random_unit(&seed));
    }
}

/* --sweep N: N seeds at three stiffnesses, below the force cap and at it; asserts nothing */
static inline void sweep_levels(int n_seed)
{
    const double young_Pa[3] = {1e4, 1e5, 4e5}, up_m[2] = {0.001, 0.006};
    for (int i = 0; i < 6; i++) {
        pulled worst = {0};
        double off = 0;
        beam b;
        pal_prepared surface;
        begin_surface(&b, false, young_Pa[i % 3], 20, &surface);
        for (int seed = 1; seed <= n_seed; seed++) {
            pull_plan plan;
            plan_at_random((uint64_t)seed, up_m[i / 3], &plan);
            pull_and_switch(&b, &plan, &worst);
            off = fmax(off, fabs(worst.end_N / pull_alone_N(&b, &plan) - 1));
        }
        printf(
            "  %.0f kPa, %.0f mm: force at the end off by %.1f %%, after a switch by %.1f %%, energy by %.3f %%, %.2f "
            "mm in a step\n",
            1e-3 * young_Pa[i % 3], 1e3 * up_m[i / 3], 100 * off, 100 * worst.force, 100 * worst.energy,
            1e3 * worst.frame_m);
        pal_prepared_free(&surface);
        end(&b);
    }
}

#endif
