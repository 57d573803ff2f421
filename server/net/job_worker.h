/* One thread beside the loop that prepares the scene, world and stream that a command leads to, slowly and with memory,
 * while the session runs on; that then stops the session and transfers its state, while other sessions and the loop go
 * on; and that frees what has been replaced. One job at a time: the next is submitted when the last was collected.
 * Thread: [net] unless said otherwise. */
#ifndef PAL_NET_JOB_WORKER_H
#define PAL_NET_JOB_WORKER_H
#include "server/net/hub_core.h"
#include "server/session/configuration_switch.h"
#include "server/session/sculpt.h"

typedef struct pal_job_worker pal_job_worker;
typedef struct pal_job pal_job;
struct pal_hub_body_edits;

/* what has been replaced; each may be NULL */
typedef struct pal_retired {
    pal_stream *stream;
    pal_session *session;
    pal_sculpt_edit *edit;
    pal_configuration_switch *change;
} pal_retired;

/* a kind of job: how it is read, prepared, transferred, committed and answered */
typedef struct pal_job_type {
    /* [net] what the command means at this moment; false: an error was sent */
    bool (*read)(pal_hub *hub, pal_client *client, const pal_wire_command *command, pal_job *job);
    /* [job] makes the scene that the next session runs, which lives as long as the job's product */
    pal_err (*prepare)(pal_job *job, const pal_scene **scene);
    void (*transfer)(pal_job *job); /* [job] the running session's state into the next one */
    /* [net] the next session runs: keeps the job's product, hands over what it replaces */
    void (*commit)(struct pal_hub_body_edits *edits, pal_job *job, pal_retired *retired);
    void (*answer)(pal_hub *hub, pal_client *client, const pal_job *job); /* [net] */
    bool keeps_brushes;                                                   /* they act on in the next session */
} pal_job_type;

/* What is to be made, and what has been. Borrowed until it is collected: sculptor, session and was, which nobody
 * changes or closes meanwhile. When it is collected without err the session stands, and its state is in next */
struct pal_job {
    const pal_job_type *type;
    pal_session *session; /* that runs now */
    pal_scene *scene;     /* its scene with live materials; owned */
    int body;
    double error_m;
    char verb[32];
    uint64_t asked_ns, made_ns;
    /* an edit */
    pal_sculptor *sculptor;
    pal_sculpt command;
    double *point_m; /* what the command points to, or NULL; owned */
    pal_sculpt_edit *edit;
    /* a switch of configuration */
    pal_configuration configuration;
    const pal_body_def *was;          /* the body before its first switch               */
    pal_body_def *base;               /* the same where this is its first, else NULL; owned */
    double error_now_m, error_then_m; /* as clients see them; NaN: none is shown */
    pal_configuration_switch *change;
    pal_configuration_switch_report report;
    /* the result; when err is not 0 there is none, and diag says why */
    pal_err err;
    pal_diagnostic diag;
    pal_session *next;
    pal_stream *stream;
    int n_brush_ended;
};

/* wake is called on the thread when a job is done. MEMORY. [load] */
pal_err pal_job_worker_open(void (*wake)(void *user), void *user, pal_job_worker **out);
/* waits for the job under way and frees it; NULL is fine */
void pal_job_worker_close(pal_job_worker *worker);
bool pal_job_worker_busy(pal_job_worker *worker); /* has a job that was not collected */
/* takes the job over, owned parts included; only when it is not busy */
void pal_job_worker_submit(pal_job_worker *worker, const pal_job *job);
/* the finished job, once; false: none yet. Owned parts are the caller's again */
bool pal_job_worker_collect(pal_job_worker *worker, pal_job *out);
/* closes and frees on the thread, in the order of the struct; before the next submit */
void pal_job_worker_retire(pal_job_worker *worker, const pal_retired *retired);
/* frees what a job owns, the result included */
void pal_job_free(pal_job *job);
#endif
