/* Friction through a live switch (server/sim/transfer/transfer.h): what holds a tool sideways goes on holding it.
 * --table prints what every pair does. */
#include "tests/stability/switch_press.h"

/* a tool that dragged the top sideways by friction goes on holding it where it was: across as much as along */
static void friction_holds_through_every_switch(void)
{
    pal_transfer_report r;
    make(0.8);
    for (int i = 0; i < N; i++) {
        pal_world *w = open_world(&set[i]->scene);
        press(w, 0.003);
        const double was_N = pal_world_tools(w)->tool[0].mean_force_N[0];
        CHECK(was_N < -0.05); /* tissue pulls the tool back */
        for (int j = 0; j < N; j++) {
            if (i == j || CHECK_REPEATS(false, (i + j) % 3 != 1)) continue;
            pal_world *next = open_world(&set[j]->scene);
            const double *force_N = pal_world_tools(next)->tool[0].mean_force_N;
            pal_transfer *x = carry(i, j, w, next, &r);
            double min_N = INFINITY, max_N = -INFINITY;
            for (int k = 0; k < AFTER; k++) {
                step(next, set[j]->scene.step_s, 1);
                min_N = fmin(min_N, force_N[0]), max_N = fmax(max_N, force_N[0]);
            }
            step(next, set[j]->scene.step_s, LATER);
            if (table)
                printf("  %d -> %d: across %.3f N, then %.3f to %.3f, at rest %.3f\n", i, j, was_N, min_N, max_N,
                       force_N[0]);
            CHECK_LE(max_N, 0.8 * fmax(was_N, force_N[0]));
            CHECK_LE(1.2 * fmin(was_N, force_N[0]), min_N);
            pal_world_destroy(next);
            pal_transfer_free(x);
        }
        pal_world_destroy(w);
    }
    unmake();
}

int main(int argc, char **argv)
{
    table = argc > 1 && !strcmp(argv[1], "--table");
    RUN(friction_holds_through_every_switch);
    return check_report();
}
