/* The background thread of the hub. While the session runs, it prepares the scene, world and stream that a command
 * leads to, which is slow and allocates. It then stops that session and transfers its state, while other sessions and
 * the loop continue, and frees what was replaced. One job at a time: collect a job before the next submit. Thread:
 * [net] unless noted. */
#ifndef PAL_NET_JOB_WORKER_H
#define PAL_NET_JOB_WORKER_H
#include "server/net/hub_core.h"
#include "server/session/configuration_switch.h"
#include "server/session/sculpt.h"

typedef struct pal_job_worker pal_job_worker;
typedef struct pal_job pal_job;
struct pal_hub_body_edits;

/* replaced objects; each may be NULL */
typedef struct pal_retired {
    pal_stream *stream;
    pal_session *session;
    pal_sculpt_edit *edit;
    pal_configuration_switch *change;
} pal_retired;

/* a kind of job: how it is parsed, prepared, transferred, committed and answered */
typedef struct pal_job_type {
    /* [net] parses the command against the current state; false: an error was sent */
    bool (*read)(pal_hub *hub, pal_client *client, const pal_wire_command *command, pal_job *job);
    /* [job] builds the scene of the next session; it lives as long as the job's product */
    pal_err (*prepare)(pal_job *job, const pal_scene **scene);
    void (*transfer)(pal_job *job); /* [job] transfers the state of the running session to the next one */
    /* [net] the next session runs: stores the job's product, moves what it replaces to *retired */
    void (*commit)(struct pal_hub_body_edits *edits, pal_job *job, pal_retired *retired);
    void (*answer)(pal_hub *hub, pal_client *client, const pal_job *job); /* [net] */
    bool keeps_brushes;                                                   /* brushes continue in the next session */
} pal_job_type;

/* One job and its result. Borrows sculptor, session and was until collected; nobody changes or closes them meanwhile.
 * A collected job without err has a running session in `next`, with the state transferred. */
struct pal_job {
    const pal_job_type *type;
    pal_session *session; /* the running session */
    pal_scene *scene;     /* its scene with current materials; owned */
    int body;
    double error_m;
    char verb[32];
    uint64_t asked_ns, made_ns;
    /* edit */
    pal_sculptor *sculptor;
    pal_sculpt command;
    double *point_m; /* points of the command, or NULL; owned */
    pal_sculpt_edit *edit;
    /* configuration switch */
    pal_configuration configuration;
    const pal_body_def *was;          /* the body before its first switch */
    pal_body_def *base;               /* a copy of it when this is the first switch, else NULL; owned */
    double error_now_m, error_then_m; /* as displayed to clients; NaN: none */
    pal_configuration_switch *change;
    pal_transfer_report report;
    /* result; on err there is none, and diag gives the reason */
    pal_err err;
    pal_diagnostic diag;
    pal_session *next;
    pal_stream *stream;
    int n_brush_ended;
};

/* wake is called on the worker thread when a job is done. MEMORY. [load] */
pal_err pal_job_worker_open(void (*wake)(void *user), void *user, pal_job_worker **out);
/* waits for the job in progress and frees it; NULL is fine */
void pal_job_worker_close(pal_job_worker *worker);
bool pal_job_worker_busy(pal_job_worker *worker); /* true: has an uncollected job */
/* takes the job with its owned parts; only when not busy */
void pal_job_worker_submit(pal_job_worker *worker, const pal_job *job);
/* returns the finished job once; false: none yet. The caller owns its parts again */
bool pal_job_worker_collect(pal_job_worker *worker, pal_job *out);
/* closes and frees on the worker thread, in the order of the struct; before the next submit */
void pal_job_worker_retire(pal_job_worker *worker, const pal_retired *retired);
/* frees what a job owns, including its result */
void pal_job_free(pal_job *job);
#endif
