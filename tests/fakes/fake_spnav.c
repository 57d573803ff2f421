/* libspnav.so: the client library of spacenavd, whose events a test puts in. */
#include <string.h>

#define EXPORT __attribute__((visibility("default")))
EXPORT int spnav_open(void);
EXPORT int spnav_close(void);
EXPORT int spnav_poll_event(int *event);
EXPORT void fake_spnav_put(const int event[7]); /* type and six axes, or type, press and number */

static int waiting[16][7], n_waiting, is_open;

int spnav_open(void)
{
    return is_open++ ? -1 : 0;
}
int spnav_close(void)
{
    return is_open = 0;
}
void fake_spnav_put(const int event[7])
{
    if (n_waiting < 16) memcpy(waiting[n_waiting++], event, sizeof waiting[0]);
}
int spnav_poll_event(int *event)
{
    if (n_waiting == 0) return 0;
    memcpy(event, waiting[0], sizeof waiting[0]);
    memmove(waiting[0], waiting[1], sizeof waiting[0] * (size_t)--n_waiting);
    return event[0];
}
