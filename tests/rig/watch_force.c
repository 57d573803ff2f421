/* Hears the tool states that a bridge publishes on LCM and prints a line for each: age of the newest model in s, norm
 * of the force on the hand in N, how much of it no damping explains in N (norm less the part against the motion),
 * number of that model. Ends on a signal. usage: watch_force BUS CHANNEL */
#include "clients/link/lcm_link.h"
#include "clients/link/lcm_seal.h"
#include "palpate_tool_state_t.h"
#include "server/base/vec3.h"

#include <lcm/lcm.h>
#include <math.h>
#include <stdio.h>

static void watch_state(const lcm_recv_buf_t *buffer, const char *channel, void *user)
{
    (void)channel, (void)user;
    palpate_tool_state_t s;
    if (pal_lcm_walk(palpate_tool_state_t_get_type_info(), buffer->data,
                     pal_seal_begin(buffer->data, buffer->data_size)))
        return;
    if (palpate_tool_state_t_decode(buffer->data, 0, (int)buffer->data_size, &s) < 0) return;
    const double force[3] = {s.force[0], s.force[1], s.force[2]}, speed[3] = {s.vel[0], s.vel[1], s.vel[2]};
    const double norm = pal_norm3(force),
                 against = pal_norm3(speed) > 0 ? -pal_dot3(force, speed) / pal_norm3(speed) : 0;
    printf("%.6f %.6f %.6f %d\n", (double)(uint32_t)s.model_age_us * 1e-6, norm, norm - fmax(against, 0),
           (int)s.model_seq);
    palpate_tool_state_t_decode_cleanup(&s);
}

int main(int argc, char **argv)
{
    lcm_t *lcm = argc == 3 ? lcm_create(argv[1]) : NULL;
    if (!lcm || !lcm_subscribe(lcm, argv[2], watch_state, NULL)) {
        fprintf(stderr, "usage: watch_force BUS CHANNEL (and the bus must be there)\n");
        return 2;
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    while (lcm_handle(lcm) == 0) {
    }
    lcm_destroy(lcm);
    return 1;
}
