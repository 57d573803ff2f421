/* Byte format of the input log, its writer and its reader, and what a record does. Private to server/session; replay.h
 * is the public interface.
 *
 * Little-endian. Header, 40 bytes: "palinlog", u32 version 6, u32 hash interval in steps, f64 step_s, u64 scene
 * fingerprint, u32 bodies, u32 tools. Records follow: u8 kind, u8 index (tool or body), u16 0, u32 CRC-32 of the
 * record (zlib's, with 0 in this place), u32 payload bytes, u32 0, u64 steps taken since open, payload. A record takes
 * effect before the next step. The last record is END; a file without it was cut, and is good up to its last whole
 * record.
 *
 *   POSE      tool   88  f64 position[3], quat[4], velocity[3], u32 buttons, u32 seq
 *   RELEASE   tool    0
 *   RESET     0       0
 *   RESET_BODY body   0
 *   MATERIAL  body   40  f64 young_Pa, poisson, density_kg_m3, damping_1_s, damping_ratio
 *   BRUSH     body  112  u32 tool, u32 kind, f64 at_m[3], to_m[3], radius_m, softness, pressure_Pa, lift_m[3],
 *                        stiffness_N_m
 *   COMPONENT body   52  u32 on, name[48], zero-padded
 *   SCULPT    body  473  an edit takes effect: pal_sculpt without its pointer, materials; f64 point_m[n_point][3]
 *   PREPARE   body  562  a switch was prepared: pal_configuration, materials
 *   REHEARSE  body    0  the prepared switch was rehearsed from this state (configuration_switch.h)
 *   SWITCH    body    0  and takes effect
 *   STATE     body    4  u32 points; f64 x[points][3], v[points][3]: now and then, for who goes on after a crash
 *   RESTORE   body    4  the same, which the world takes: how a session begins that goes on after a crash
 *   HASH      0       8  u64 world hash, at least every `hash interval` steps
 *   END       0      16  u64 world hash, u64 dropped records (0: the log is complete)
 *
 * The put functions copy into a ring buffer; they never wait, allocate or touch the file. A separate thread writes the
 * file, and sees to it once a second that it is on the disk (fdatasync). A record that does not fit is dropped and
 * counted, and END reports it. A file that is there is never written over: "run.log" becomes "run.2.log". */
#ifndef PAL_SESSION_INPUT_LOG_H
#define PAL_SESSION_INPUT_LOG_H
#include "server/session/sculpt.h"
#include "server/sim/core/configuration.h"
#include "server/sim/world/world.h"

enum {
    PAL_INPUT_HEADER = 40,
    PAL_INPUT_HEAD = 24,
    PAL_INPUT_PAYLOAD = 640, /* without the points of an edit */
    PAL_INPUT_HASH_STEPS = 60,
    PAL_INPUT_HASH_MAX = 3600
};

typedef enum pal_input_kind {
    PAL_INPUT_POSE = 1,
    PAL_INPUT_RELEASE,
    PAL_INPUT_RESET,
    PAL_INPUT_MATERIAL,
    PAL_INPUT_HASH,
    PAL_INPUT_END,
    PAL_INPUT_BRUSH,
    PAL_INPUT_RESET_BODY,
    PAL_INPUT_COMPONENT,
    PAL_INPUT_SCULPT,
    PAL_INPUT_PREPARE,
    PAL_INPUT_REHEARSE,
    PAL_INPUT_SWITCH,
    PAL_INPUT_STATE,
    PAL_INPUT_RESTORE,
    PAL_INPUT_KINDS
} pal_input_kind;

typedef struct pal_input_record {
    pal_input_kind kind;
    int index;     /* tool or body */
    uint64_t step; /* steps taken since open */
    pal_pose pose;
    pal_material material;
    uint64_t hash, n_dropped;
    int slot; /* BRUSH: tool */
    pal_brush brush;
    uint32_t wanted; /* COMPONENT: 0 or 1 */
    char component[PAL_NAME];
    pal_sculpt sculpt; /* SCULPT; point_m: the writer's; of a record that was read: in the log's bytes, not aligned */
    pal_configuration configuration;      /* PREPARE */
    pal_material materials[PAL_BODY_MAX]; /* SCULPT, PREPARE: of the scene with which it was prepared */
    int n_point;                          /* STATE, RESTORE */
    const double *x, *v;                  /* [n_point][3]; of a record that was read: in the log's bytes, not aligned */
} pal_input_record;

/* Applies any record that keeps the world to it (not HASH, END, SCULPT, PREPARE, REHEARSE, SWITCH), a world of the
 * scene, as session and replay do. Errors as of the world's function. [sim] */
pal_err pal_input_apply(pal_world *world, const pal_scene *scene, const pal_input_record *record, pal_diagnostic *diag);

/* hash of everything in a scene that decides the simulation: steps, meshes, materials, entries; texts are excluded */
uint64_t pal_scene_fingerprint(const pal_scene *scene);

typedef struct pal_input_log pal_input_log;
/* the newest of the files that a path names by numbers; false: there is none */
bool pal_input_log_newest(const char *path, char *name, size_t cap);
/* creates a new file and starts the writer thread; ring_byte 0: 4 MiB. IO, MEMORY. [load] */
pal_err pal_input_log_open(const char *path, const pal_scene *scene, size_t ring_byte, pal_diagnostic *diag,
                           pal_input_log **out);
void pal_input_log_put(pal_input_log *log, const pal_input_record *record); /* [sim] NULL log is fine */
uint64_t pal_input_log_dropped(const pal_input_log *log);                   /* [sim] */
const char *pal_input_log_path(const pal_input_log *log);                   /* of the file */
/* errno of the first write that failed, after which nothing is written; 0: none. NULL: 0. [any] */
int pal_input_log_error(const pal_input_log *log);
/* everything put so far is in the file and on the disk, and the ring buffer is empty; the writer thread has ended, so
 * that what is put from now on waits for the close. [load] */
void pal_input_log_flush(pal_input_log *log);
/* writes END with the last hash of the world, flushes and closes the file; IO: any write failed. [load] */
pal_err pal_input_log_close(pal_input_log *log, uint64_t step, uint64_t hash);

typedef struct pal_input_header {
    char magic[8];
    uint32_t version, hash_steps;
    double step_s;
    uint64_t fingerprint;
    uint32_t n_body, n_tool;
} pal_input_header;
/* the CRC of a whole record of n bytes, whatever stands in its place */
uint32_t pal_input_crc(const uint8_t *record, size_t n);
/* bounds-checked; advance *at; REFUSED gives the byte offset */
pal_err pal_input_get_header(const char *name, const uint8_t *bytes, size_t n_byte, pal_input_header *out, size_t *at,
                             pal_diagnostic *diag);
pal_err pal_input_get_record(const char *name, const uint8_t *bytes, size_t n_byte, size_t *at, pal_input_record *out,
                             pal_diagnostic *diag);
#endif
