/* A team of threads that works through independent pieces of work in parallel. What piece i computes must depend on i
 * alone, never on the worker or on the order: then the result is the same for any number of cores. Workers treat
 * subnormal numbers as the caller does (subnormals.h). Thread: one caller at a time. */
#ifndef PAL_BASE_TEAM_H
#define PAL_BASE_TEAM_H
#include "server/base/err.h"

#include <stdint.h>

enum { PAL_TEAM_MAX = 256 };

typedef struct pal_team pal_team;

/* n_worker <= 0: one per core that this process may use; 1: no thread is created and the caller works. At most
 * PAL_TEAM_MAX, and no more than the system grants: pal_team_size returns the number. Workers sleep between runs and
 * block all signals. MEMORY: no memory, or no thread could be created. [load] */
pal_err pal_team_create(int n_worker, pal_team **out);
void pal_team_destroy(pal_team *team);   /* joins; NULL is fine */
int pal_team_size(const pal_team *team); /* workers, the caller among them */
/* Calls piece(user, worker, i) once for every i in [0, n), 0 <= worker < size, and returns when all are done; the
 * caller is worker 0. A worker runs one piece at a time, so its own data need no lock. What the pieces wrote is visible
 * on return. A piece must not run the same team. n <= 0: nothing; team NULL: the caller does all */
void pal_team_run(pal_team *team, int n, void (*piece)(void *user, int worker, int index), void *user);
/* Processor time of the threads of a team over their number, ns, of which own_ns is the caller's; NULL: own_ns. Between
 * two readings around a time for which the team is held: as long as that time on a machine without other work, because
 * all of them work or watch, and shorter by what others took from them */
uint64_t pal_team_mean_ns(const pal_team *team, uint64_t own_ns);
/* While a team is held, workers without work watch for the next run instead of sleeping, so that pieces of ten
 * microseconds pay, and where there is a worker for each piece, piece i is worker i's unless it does not come. They
 * yield to other threads of the same core, but take what is left of it: hold a team for a step at most. NULL: nothing
 */
void pal_team_hold(pal_team *team);
void pal_team_release(pal_team *team);
#endif
