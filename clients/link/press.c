/* Presses a tool into the highest point of the tissue and prints force against depth.
 *
 *     cc press.c $(pkg-config --cflags --libs palpate-client) -o press
 *     ./press http://127.0.0.1:8090/#TICKET        # the address that palpate serve prints */
#include "clients/link/tool_client.h"

#include <stdio.h>

static const double above_m = 0.01, step_m = 0.0005;
enum { STEPS = 60 }; /* from above_m over the tissue to 20 mm in it */

static void move(pal_tool_client *c)
{
    const int *step = c->user;
    const double height_m = c->radius_m + above_m - step_m * *step;
    double at_m[3];
    for (int k = 0; k < 3; k++) at_m[k] = c->top_m[k] + height_m * c->up[k];
    pal_tool_client_move(c, at_m, false);
}

static void moved(pal_tool_client *c, const pal_wire_tool *tool)
{
    int *step = c->user;
    double force_N = 0;
    for (int k = 0; k < 3; k++) force_N += (double)tool->force_N[k] * c->up[k];
    printf("%.1f mm %.4f N\n", 1e3 * (step_m * *step - above_m), force_N);
    if ((*step)++ == STEPS)
        pal_tool_client_stop(c);
    else
        move(c);
}

int main(int argc, char **argv)
{
    int step = 0;
    pal_tool_client client = {.ready = move, .moved = moved, .user = &step};
    pal_diagnostic diag;
    if (pal_tool_client_run(&client, argc > 1 ? argv[1] : "http://127.0.0.1:8090/", 60, &diag)) {
        fprintf(stderr, "press: %s\n", diag.text);
        return 1;
    }
    return 0;
}
