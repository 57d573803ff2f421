/* What hub_jobs.c, hub_sculpt.c and hub_switch.c share: orders that lead to another scene, one after the other to the
 * workshop, and what has come out of it by now. An order waits as it came and is read when its turn comes, so that it
 * means what its forerunners left. Private to these. Thread: [net]. */
#ifndef PAL_NET_HUB_JOBS_H
#define PAL_NET_HUB_JOBS_H
#include "server/net/hub_core.h"
#include "server/net/job_worker.h"

enum { PAL_HUB_JOBS_PENDING = 16 };

typedef struct pal_hub_pending_job {
    pal_hub_room *room;
    int member;
    uint64_t asked_ns;
    pal_job_kind kind;
    pal_wire_command order;
} pal_hub_pending_job;

/* one body of a room that has been sculpted or switched */
typedef struct pal_hub_body_edits {
    pal_sculptor *sculptor;
    pal_sculpt_edit *turn; /* whose cells the body has; NULL: those of the start                              */
    pal_configuration_switch *change; /* whose mesh the body has; NULL: that of the start, or of turn */
    pal_body_def *base; /* heap: as it was before it was switched; NULL: as it is now                       */
} pal_hub_body_edits;

/* the brush that a tool's holder asked for last */
typedef struct pal_hub_tool_brush {
    int member, body;
    double asked_m[6]; /* places as they came */
    pal_brush brush;   /* kind NONE: none     */
} pal_hub_tool_brush;

struct pal_hub_jobs {
    pal_job_worker *job_worker;
    pal_hub_pending_job list[PAL_HUB_JOBS_PENDING]; /* oldest first; that under way is no longer in it */
    int n;
    pal_hub_pending_job now;                   /* under way */
    int body;                                  /* of now    */
    int n_brush_over;                          /* brushes that ended when it took over */
    pal_hub_body_edits (*place)[PAL_BODY_MAX]; /* [n_room] */
    pal_hub_tool_brush (*hand)[PAL_TOOL_MAX];  /* [n_room] */
};

/* hub_jobs.c */
bool pal_hub_jobs_create(pal_hub *hub); /* they come with the first order; false: out of memory */
/* puts an order behind the others; complains when too many wait */
void pal_hub_jobs_enqueue(pal_hub *hub, pal_client *client, pal_job_kind kind, const pal_wire_command *order);
/* may the client change scenes? else complains */
bool pal_hub_jobs_check_rights(pal_hub *hub, pal_client *client, const char *verb, const char *does);
const pal_wire_arg *pal_hub_arg(const pal_wire_command *order, const char *key); /* NULL: there is none */
/* is every number of `args` there ("a b | c": those behind the bar may be left out), and no other? else complains */
bool pal_hub_check_args(pal_hub *hub, pal_client *client, const char *args, const pal_wire_command *order);
pal_client *pal_hub_requester(pal_hub *hub, const pal_hub_pending_job *waiting); /* NULL: has gone */
pal_wire_answer *pal_hub_answer_begin(pal_hub *hub, const char *verb);           /* in hub->control */
void pal_hub_answer_arg(pal_wire_answer *answer, const char *key, double value);
/* hub_sculpt.c and hub_switch.c: what an order whose turn has come means, with its body; false: complained. The answer
 * when it is done */
bool pal_hub_sculpt_read(pal_hub *hub, pal_client *client, const pal_wire_command *order, pal_job *to, int *body);
void pal_hub_sculpt_answer(pal_hub *hub, pal_client *client, const pal_job *work);
bool pal_hub_switch_read(pal_hub *hub, pal_client *client, const pal_wire_command *order, pal_job *to, int *body);
void pal_hub_switch_answer(pal_hub *hub, pal_client *client, const pal_job *work);
#endif
