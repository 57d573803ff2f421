/* Haply's service over the fake plant: a websocket on a free port of this machine that gives one message of state for
 * each message of force, and one of all its devices at first. Its frames are the test's, as of the other fakes. */
#ifndef TESTS_FAKES_FAKE_HAPLY_H
#define TESTS_FAKES_FAKE_HAPLY_H
#include "tests/fakes/fake_plant.h"

/* starts it, once; its port, 0: none */
int fake_haply_start(void);
void fake_haply_stop(void);
void fake_haply_send(const char *text); /* in place of the next state; NULL: states again */
#endif
