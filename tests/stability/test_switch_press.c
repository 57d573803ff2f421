/* A live switch (server/sim/transfer/transfer.h) while a tool presses: what is seen does not jump, and what is felt
 * goes from the force of before to that of after without a swing. Every pair of configurations. --table prints what
 * every pair does. */
#include "tests/stability/hard_case.h"
#include "tests/stability/switch_press.h"

typedef struct seen {
    double frame_m, min_N, max_N, is_N;
} seen;

/* steps after the switch: the farthest that a vertex goes in a frame, the forces felt, the last of them at rest again
 */
static void watch(pal_world *next, double step_s, double from_m, seen *out)
{
    const pal_body *to = pal_world_body(next, 0);
    const pal_tool *tool = &pal_world_tools(next)->tool[0];
    const size_t n_byte = 3 * sizeof(float) * (size_t)to->display.n_shown;
    float *last = malloc(n_byte);
    if (!last) abort();
    *out = (seen){.frame_m = from_m, .min_N = INFINITY};
    for (int k = 0; k < AFTER; k++) {
        memcpy(last, to->display.shown, n_byte);
        step(next, step_s, 1);
        out->frame_m = fmax(out->frame_m, check_farthest(last, to->display.shown, to->display.n_shown));
        double now_N = pal_norm3(tool->mean_force_N);
        out->min_N = fmin(out->min_N, now_N), out->max_N = fmax(out->max_N, now_N);
        if (table) printf(k < 16 ? " %.2f" : "", now_N);
    }
    step(next, step_s, LATER);
    out->is_N = pal_norm3(tool->mean_force_N);
    free(last);
}

/* bound_m: the errors of both, as both stand beside the right one */
static void check_pair(int i, int j, pal_world *before, double bound_m)
{
    pal_transfer_report r;
    pal_world *next = open_world(&set[j]->scene);
    const pal_body *from = pal_world_body(before, 0), *to = pal_world_body(next, 0);
    const double was_N = pal_norm3(pal_world_tools(before)->tool[0].mean_force_N);
    pal_transfer *x = carry(i, j, before, next, &r);
    seen s;
    /* the frame of the switch shows what was shown */
    double first_m = check_farthest(from->display.shown, to->display.shown, to->display.n_shown);
    CHECK_LE(first_m, 1e-7);
    CHECK(to->display.offset_m != NULL && r.frame_move_m > 0);
    CHECK_NEAR(r.frame_move_m, r.max_move_m * set[j]->scene.step_s * 6, 1e-12);
    if (table) printf("  %d -> %d: N", i, j);
    watch(next, set[j]->scene.step_s, first_m, &s);
    if (table)
        printf("; lag %.3f mm, of a frame at most %.3f, bound %.3f; force %.3f, then %.3f to %.3f, %.3f\n",
               1e3 * r.max_move_m, 1e3 * s.frame_m, 1e3 * bound_m, was_N, s.min_N, s.max_N, s.is_N);
    HARD_CASE("switch", list[j].model,
              "under a press: farthest move of the surface in a frame, over the errors of both", s.frame_m / bound_m, 1,
              "");
    HARD_CASE("switch", list[j].model, "under a press: force beyond those at rest before and after",
              100 * fmax(s.max_N / fmax(was_N, s.is_N) - 1, 1 - s.min_N / fmin(was_N, s.is_N)), 20, "%");
    CHECK(to->display.offset_m == NULL && pal_body_finite(to) && !to->frozen);
    pal_world_destroy(next);
    pal_transfer_free(x);
}

/* finite: what is seen is one surface, and it comes to rest where the new method has it rest */
static void every_pair_under_a_press(void)
{
    pal_world *w[N + 1];
    make(0);
    for (int i = 0; i <= N; i++) {
        w[i] = open_world(&set[i]->scene);
        press(w[i], 0);
    }
    const pal_body *best = pal_world_body(w[N], 0);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            const pal_body *a = pal_world_body(w[i], 0), *b = pal_world_body(w[j], 0);
            if (i == j || CHECK_REPEATS(false, (i + j) % 3 != 1)) continue;
            REQUIRE(a->display.n_shown == best->display.n_shown && b->display.n_shown == best->display.n_shown);
            check_pair(i, j, w[i],
                       check_farthest(a->display.shown, best->display.shown, best->display.n_shown) +
                           check_farthest(b->display.shown, best->display.shown, best->display.n_shown));
        }
    for (int i = 0; i <= N; i++) pal_world_destroy(w[i]);
    unmake();
}

int main(int argc, char **argv)
{
    table = argc > 1 && !strcmp(argv[1], "--table");
    RUN(every_pair_under_a_press);
    return check_report();
}
