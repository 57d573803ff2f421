/* Ctrl-C of a long command: the first SIGINT or SIGTERM is a request to stop, the next one ends the process.
 * Thread: [any]. */
#ifndef PAL_CLI_INTERRUPT_H
#define PAL_CLI_INTERRUPT_H
#include <stdbool.h>

void pal_interrupt_watch(void);
bool pal_interrupt_requested(void);
#endif
