/* One thread beside the loop that makes what a command of sculpting, or one for another setting, leads to: scene, world
 * and stream, slow and with memory, while the session runs on, and rehearses the carry; that stops the session then and
 * carries its state over, while other sessions and the loop go on; and that frees what has been replaced. One piece of
 * work at a time: the next one is given when the last has been taken. Thread: [net] unless said otherwise. */
#ifndef PAL_NET_JOB_WORKER_H
#define PAL_NET_JOB_WORKER_H
#include "server/net/stream.h"
#include "server/session/configuration_switch.h"
#include "server/session/sculpt.h"

typedef struct pal_job_worker pal_job_worker;

typedef enum pal_job_kind { PAL_JOB_SCULPT, PAL_JOB_SWITCH } pal_job_kind;

/* what is to be made, and what has been. Borrowed until it is taken: sculptor, session and was, which nobody changes or
 * closes meanwhile. When it is taken without err the session stands, and its state is in next: pal_session_transfer_end
 */
typedef struct pal_job {
    pal_job_kind kind;
    pal_session *session; /* that runs now */
    pal_scene *scene;     /* its scene with live materials; heap, goes with the work */
    /* SCULPT */
    const pal_sculptor *sculptor;
    pal_sculpt command;
    double *point_m; /* what the command points to, heap, or NULL */
    /* SWITCH */
    int body;
    pal_configuration setting;
    const pal_body_def *was; /* the body before its first switch               */
    pal_body_def *base;      /* the same where this is its first: heap, or NULL */
    double error_m;
    double now_m, then_m; /* SWITCH: errors shown of the setting that it has and of that wanted; NaN: none */
    uint64_t asked_ns, made_ns;
    /* made; when err is not 0 nothing is, and note says why */
    pal_err err;
    pal_diagnostic diag;
    pal_sculpt_edit *turn;            /* SCULPT */
    pal_configuration_switch *change; /* SWITCH */
    pal_session *next;
    pal_stream *stream;
    pal_configuration_switch_report report; /* SWITCH */
} pal_job;

/* what has been replaced; each may be NULL */
typedef struct pal_retired {
    pal_stream *stream;
    pal_session *session;
    pal_sculpt_edit *turn;
    pal_configuration_switch *change;
} pal_retired;

/* wake is called on the thread when work is done. MEMORY. [load] */
pal_err pal_job_worker_open(void (*wake)(void *user), void *user, pal_job_worker **out);
/* waits for the work under way and frees it; NULL is fine */
void pal_job_worker_close(pal_job_worker *job_worker);
bool pal_job_worker_busy(const pal_job_worker *job_worker); /* has work that was not taken */
/* takes the work over, heap parts included; only when it is not busy */
void pal_job_worker_submit(pal_job_worker *job_worker, const pal_job *work);
/* what is done, once; false: nothing yet. Heap parts are the caller's again */
bool pal_job_worker_collect(pal_job_worker *job_worker, pal_job *out);
/* closes and frees on the thread, in the order of the struct; before the next give */
void pal_job_worker_retire(pal_job_worker *job_worker, const pal_retired *retired);
/* frees what a work holds: scene, points, and what was made */
void pal_job_free(pal_job *work);
#endif
