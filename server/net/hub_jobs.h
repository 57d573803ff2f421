/* Commands that lead to another scene: a queue before the worker, and what has come out of it. A command waits as it
 * came and is read when its turn comes, so that it means what the ones before it left. Thread: [net]. */
#ifndef PAL_NET_HUB_JOBS_H
#define PAL_NET_HUB_JOBS_H
#include "server/net/job_worker.h"

enum { PAL_HUB_JOBS_PENDING = 16 };

typedef struct pal_hub_pending_job {
    pal_hub_room *room;
    int member;
    uint64_t asked_ns;
    const pal_job_type *type;
    pal_wire_command command;
} pal_hub_pending_job;

/* one body of a room that has been edited or switched */
typedef struct pal_hub_body_edits {
    pal_sculptor *sculptor;
    pal_sculpt_edit *edit;            /* whose cells the body has; NULL: those of the start          */
    pal_configuration_switch *change; /* whose mesh the body has; NULL: that of the start, or of edit */
    pal_body_def *base;               /* owned: as it was before it was switched; NULL: as it is now  */
} pal_hub_body_edits;

/* the brush that a tool's holder asked for last */
typedef struct pal_hub_tool_brush {
    int member, body;
    double asked_m[6]; /* places as they came */
    pal_brush brush;   /* kind NONE: none     */
} pal_hub_tool_brush;

struct pal_hub_jobs {
    pal_job_worker *worker;
    pal_hub_pending_job pending[PAL_HUB_JOBS_PENDING]; /* oldest first */
    int n_pending;
    pal_hub_pending_job current;               /* under way; no longer pending */
    pal_hub_body_edits (*edits)[PAL_BODY_MAX]; /* [n_room] */
    pal_hub_tool_brush (*brush)[PAL_TOOL_MAX]; /* [n_room] */
};

/* jobs are made with the first command that needs them; false: out of memory, an error was sent */
bool pal_hub_jobs_create(pal_hub *hub, pal_client *client, const char *verb);
/* puts a command behind the others; an error is sent when too many wait */
void pal_hub_jobs_enqueue(pal_hub *hub, pal_client *client, const pal_job_type *type, const pal_wire_command *command);
pal_hub_body_edits *pal_hub_edits(pal_hub *hub, const pal_hub_room *room, int body);
void pal_hub_jobs_update(pal_hub *hub); /* what the worker has done, and the next command */
void pal_hub_jobs_end(pal_hub *hub);    /* closes the sessions that the hub made */
#endif
