/* Presses a tool into the highest point of the tissue and prints force against depth.
 *
 *     cc press.c $(pkg-config --cflags --libs palpate-client) -o press
 *     ./press http://127.0.0.1:8090/#TICKET        # the address that palpate serve prints */
#include "clients/link/asset_store.h"
#include "server/base/clock.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double above_m = 0.01, step_m = 0.0005;
enum { STEPS = 60 }; /* from above_m over the tissue to 20 mm in it */

typedef struct client {
    pal_link_loop *loop;
    pal_link *link;
    pal_asset_store *store;
    double up[3], top_m[3], radius_m;
    int step;
    uint32_t seq; /* of the last pose; 0: none yet */
} client;

static void move(client *c)
{
    const double height_m = c->radius_m + above_m - step_m * c->step;
    pal_wire_pose pose = {.tool = (uint16_t)pal_link_tool(c->link), .seq = ++c->seq, .flags = PAL_WIRE_POSE_POSE_ONLY};
    pose.stamp_us = pal_clock_ns() / 1000;
    pose.quaternion[0] = 1; /* unknown */
    for (int k = 0; k < 3; k++) pose.position_m[k] = c->top_m[k] + height_m * c->up[k];
    pal_link_send_pose(c->link, &pose);
}

static void on_asset(void *user, const pal_stored_asset *stored)
{
    client *c = user;
    if (stored->ready && pal_asset_extreme_vertex(stored->asset, c->up, c->top_m)) move(c);
}

static void on_control(void *user, const pal_control *message)
{
    client *c = user;
    if (message->type != PAL_CONTROL_HELLO || message->hello.you_tool < 0) return;
    memcpy(c->up, message->hello.up, sizeof c->up);
    c->radius_m = message->hello.tool[message->hello.you_tool].radius_m;
    pal_asset_store_request(c->store, message->hello.part[0].asset);
}

static void on_message(void *user, const pal_wire_head *head, const uint8_t *bytes, size_t n_byte)
{
    client *c = user;
    const int own = pal_link_tool(c->link);
    pal_wire_tools tools;
    if (head->kind != PAL_WIRE_TOOLS || pal_wire_get_tools(bytes, n_byte, &tools)) return;
    pal_link_acknowledge(c->link, bytes, n_byte);
    if (!c->seq || own < 0 || tools.tool[own].echo_seq < c->seq) return; /* no step has used the pose yet */
    const float *f = tools.tool[own].force_N;
    const double force_N = (double)f[0] * c->up[0] + (double)f[1] * c->up[1] + (double)f[2] * c->up[2];
    printf("%.1f mm %.4f N\n", 1e3 * (step_m * c->step - above_m), force_N);
    if (c->step++ == STEPS)
        pal_link_stop(c->loop);
    else
        move(c);
}

int main(int argc, char **argv)
{
    static const pal_link_events events = {.control = on_control, .message = on_message};
    client c = {0};
    pal_diagnostic diag = {"out of memory"};
    const char *url = argc > 1 ? argv[1] : "http://127.0.0.1:8090/";
    const pal_link_options options = {url,       "press", PAL_WIRE_ROLE_TRAINEE, PAL_WIRE_TOOL_ANY, .events = &events,
                                      .user = &c};
    if (pal_link_loop_create(&c.loop) || !(c.store = pal_asset_store_create(c.loop, url, on_asset, &c)) ||
        pal_link_open(c.loop, &options, &diag, &c.link)) {
        fprintf(stderr, "press: %s\n", diag.text);
        return EXIT_FAILURE;
    }
    pal_link_run_for(c.loop, 60);
    pal_link_loop_destroy(c.loop);
    pal_asset_store_destroy(c.store);
    return c.step > STEPS ? EXIT_SUCCESS : EXIT_FAILURE;
}
