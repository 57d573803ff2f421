/* Commands that produce another scene: the queue before the job worker, and its results. A pending command is parsed
 * when its turn comes, so that it applies to the result of its predecessors. Thread: [net]. */
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

/* edits and switches of one body of a room */
typedef struct pal_hub_body_edits {
    pal_sculptor *sculptor;
    pal_sculpt_edit *edit;            /* edit that made the body's control cells; NULL: the original ones */
    pal_configuration_switch *change; /* switch that made the body's mesh; NULL: the original, or that of edit */
    pal_body_def *base;               /* owned: the body before its first switch; NULL: as it is now */
} pal_hub_body_edits;

/* the last brush requested by a tool's holder */
typedef struct pal_hub_tool_brush {
    int member, body;
    double asked_m[6]; /* positions as received */
    pal_brush brush;   /* kind NONE: none     */
} pal_hub_tool_brush;

struct pal_hub_jobs {
    pal_job_worker *worker;
    pal_hub_pending_job pending[PAL_HUB_JOBS_PENDING]; /* oldest first */
    int n_pending;
    pal_hub_pending_job current;               /* in progress, no longer pending */
    pal_hub_body_edits (*edits)[PAL_BODY_MAX]; /* [n_room] */
    pal_hub_tool_brush (*brush)[PAL_TOOL_MAX]; /* [n_room] */
};

/* creates hub->jobs at the first command that needs it; false: out of memory, an error was sent */
bool pal_hub_jobs_create(pal_hub *hub, pal_client *client, const char *verb);
/* appends a command; sends an error when the queue is full */
void pal_hub_jobs_enqueue(pal_hub *hub, pal_client *client, const pal_job_type *type, const pal_wire_command *command);
pal_hub_body_edits *pal_hub_edits(pal_hub *hub, const pal_hub_room *room, int body);
void pal_hub_jobs_update(pal_hub *hub); /* collects the finished job and starts the next command */
void pal_hub_jobs_end(pal_hub *hub);    /* closes the sessions created by the hub */
#endif
