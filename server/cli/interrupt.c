#include "server/cli/interrupt.h"

#include <signal.h>
#include <stdatomic.h>
#include <stddef.h>

/* a handler runs on any thread: lock-free atomics are safe there, and between threads as well */
static atomic_bool requested;

static void on_signal(int number)
{
    (void)number;
    requested = true;
}

void pal_interrupt_watch(void)
{
    struct sigaction action = {.sa_handler = on_signal, .sa_flags = (int)SA_RESETHAND};
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

bool pal_interrupt_requested(void)
{
    return requested;
}
