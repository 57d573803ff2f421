/* Commands that produce another scene. They wait in a queue of their session; a pending command is parsed when its turn
 * comes, so that it applies to the result of its predecessors. While the session runs, a background thread prepares the
 * scene, world and stream that the command leads to, which is slow and allocates. It then stops that session and
 * transfers its state, while other sessions and the loop continue, and frees what was replaced. One job of a session at
 * a time.
 *
 * What a trainee asks for is costed: a step of the next world must fit into its time, or take no more of it than the
 * scene as opened, or as an instructor has left it. Each member's jobs may take half of the time of the thread. Thread:
 * [net] unless noted. */
#ifndef PAL_NET_HUB_JOBS_H
#define PAL_NET_HUB_JOBS_H
#include "server/net/hub_core.h"

typedef struct pal_job pal_job;

/* what a job makes, or what it replaces; each may be NULL; closed and freed in this order */
typedef struct pal_job_products {
    pal_stream *stream;
    pal_session *session;
    pal_sculpt_edit *edit;
    pal_configuration_switch *change;
    pal_resume *resume;
    pal_hub_body_edits *edits; /* of all bodies [PAL_BODY_MAX], on the heap */
} pal_job_products;

/* a kind of job: how it is parsed, prepared, transferred, committed and answered */
typedef struct pal_job_type {
    /* [net] parses the command against the current state; false: an error was sent */
    bool (*read)(pal_client *client, const pal_wire_command *command, pal_job *job);
    /* [job] builds the scene of the next session; it lives as long as the job's product */
    pal_err (*prepare)(pal_job *job, const pal_scene **scene);
    void (*transfer)(pal_job *job); /* [job] transfers the state of the running session to the next one */
    /* [net] the next session runs: stores the job's product, moves what it replaces to *retired */
    void (*commit)(pal_hub_body_edits *edits, pal_job *job, pal_job_products *retired);
    void (*answer)(pal_client *client, const pal_job *job); /* [net] */
    bool keeps_brushes;                                     /* brushes continue in the next session */
    bool switches;                                          /* a switch of configuration */
    bool seeks;                                             /* all bodies, in a recording: edits is of body 0 */
} pal_job_type;

/* One job and its result. The background thread borrows sculptor, session and was; nobody changes or closes them
 * meanwhile. A finished job without err has a running session in `made`, with the state transferred. */
struct pal_job {
    const pal_job_type *type;
    pal_session *session; /* the running session */
    pal_scene *scene;     /* its scene with current materials; owned */
    int body;
    double error_m;
    char verb[32];
    uint64_t asked_ns, made_ns;
    uint64_t work_ns; /* processor time of its making */
    double max_load;  /* of the next session as predicted, beyond which it is refused */
    int quality;      /* of pal_hub_switch_to; 0: a member's or none */
    /* edit */
    pal_sculptor *sculptor;
    pal_sculpt command;
    double *point_m; /* points of the command, or NULL; owned */
    /* configuration switch */
    pal_configuration configuration, before; /* before: of the running session */
    const pal_body_def *was;                 /* the body before its first switch */
    pal_body_def *base;                      /* a copy of it when this is the first switch, else NULL; owned */
    /* seek */
    const pal_session_recording *recording;
    uint64_t step;
    bool goes_live;
    double error_now_m, error_then_m; /* as displayed to clients; NaN: none */
    pal_transfer_report report;
    /* result; on err there is none, and diag gives the reason */
    pal_err err;
    pal_diagnostic diag;
    pal_job_products made;
    int n_brush_ended;
};

void pal_hub_take_edits(pal_hub_body_edits edits[PAL_BODY_MAX], pal_resume *resume); /* what it borrows is edits' now */
void pal_hub_free_edits(pal_hub_body_edits edits[PAL_BODY_MAX]);
/* appends a command; false: the queue is full, the member's time is used up, or out of memory: an error was sent */
bool pal_hub_jobs_enqueue(pal_client *client, const pal_job_type *type, const pal_wire_command *command);
/* the same for the server itself, one at a time and before what waits, in the name of any member, who gets no answer;
 * false: not now. to: the configuration of a switch; NULL: none */
bool pal_hub_jobs_enqueue_own(pal_hub_room *room, const pal_job_type *type, const pal_wire_command *command,
                              const pal_configuration *to, int quality);
/* what the session costs now is what trainees may have; called when it is opened, and after an instructor's job */
void pal_hub_accept_load(pal_hub_room *room);
bool pal_hub_jobs_busy(const pal_hub_room *room); /* a job is in progress or waits */
bool pal_hub_jobs_own(const pal_hub_room *room);  /* so is one of the server itself */
void pal_hub_jobs_update(pal_hub_room *room); /* commits and answers the finished job, and starts the next command */
/* waits for the job in progress, then commits and answers it; what waits is dropped, the thread ends */
void pal_hub_jobs_complete(pal_hub_room *room);
void pal_hub_jobs_end(pal_hub_room *room); /* waits for the job in progress and frees it; the thread ends */
#endif
