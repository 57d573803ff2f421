/* Writer: a byte ring buffer between one producer (the simulation thread) and one consumer (the writer thread).
 * Reader: plain functions on bytes in memory. */
#include "server/session/input_log.h"

#include "server/base/clock.h"
#include "server/base/hash.h"
#include "server/base/log.h"
#include "server/base/thread.h"
#include "server/session/tuning.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

enum { VERSION = 6, MAX_NUMBER = 9999 };
static const char magic[8] = {'p', 'a', 'l', 'i', 'n', 'l', 'o', 'g'};

struct pal_input_log {
    int file;
    pthread_t thread;
    uint8_t *ring;
    size_t n_ring;                /* a power of two                              */
    _Atomic uint64_t filled, out; /* bytes put in, bytes written; both only increase */
    _Atomic bool stop;
    _Atomic int error; /* errno of the first failure; 0: none */
    uint64_t n_dropped;
    bool unsaved; /* written since the last fdatasync */
    char path[PATH_MAX];
};

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "logs are written in the host's order");

typedef struct record_head {
    uint8_t kind, index;
    uint16_t zero;
    uint32_t crc;
    uint32_t n_byte, zero_too;
    uint64_t step;
} record_head;
_Static_assert(sizeof(pal_input_header) == PAL_INPUT_HEADER && sizeof(record_head) == PAL_INPUT_HEAD,
               "without padding");

/* payload of each kind, in order: a member */
static const struct field {
    pal_input_kind kind;
    size_t offset, n_byte;
} fields[] = {
#define FIELD(kind, member)                                                                                            \
    PAL_INPUT_##kind, offsetof(pal_input_record, member), sizeof(((pal_input_record *)0)->member)
    {FIELD(POSE, pose.position_m)},
    {FIELD(POSE, pose.quat)},
    {FIELD(POSE, pose.velocity_m_s)},
    {FIELD(POSE, pose.buttons)},
    {FIELD(POSE, pose.seq)},
    {FIELD(MATERIAL, material.young_Pa)},
    {FIELD(MATERIAL, material.poisson)},
    {FIELD(MATERIAL, material.density_kg_m3)},
    {FIELD(MATERIAL, material.damping_1_s)},
    {FIELD(MATERIAL, material.damping_ratio)},
    {FIELD(BRUSH, slot)},
    {FIELD(BRUSH, brush.kind)},
    {FIELD(BRUSH, brush.at_m)},
    {FIELD(BRUSH, brush.to_m)},
    {FIELD(BRUSH, brush.radius_m)},
    {FIELD(BRUSH, brush.softness)},
    {FIELD(BRUSH, brush.pressure_Pa)},
    {FIELD(BRUSH, brush.lift_m)},
    {FIELD(BRUSH, brush.stiffness_N_m)},
    {FIELD(COMPONENT, wanted)},
    {FIELD(COMPONENT, component)},
    {FIELD(SCULPT, sculpt.kind)},
    {FIELD(SCULPT, sculpt.cells)},
    {FIELD(SCULPT, sculpt.stroke)},
    {FIELD(SCULPT, sculpt.n_point)},
    {FIELD(SCULPT, sculpt.cut)},
    {FIELD(SCULPT, sculpt.cut_normal)},
    {FIELD(SCULPT, sculpt.cut_m)},
    {FIELD(SCULPT, materials)},
    {FIELD(PREPARE, configuration)},
    {FIELD(PREPARE, materials)},
    {FIELD(STATE, n_point)},
    {FIELD(RESTORE, n_point)},
    {FIELD(HASH, hash)},
    {FIELD(END, hash)},
    {FIELD(END, n_dropped)},
#undef FIELD
};
enum { N_FIELD = sizeof fields / sizeof *fields };
_Static_assert(sizeof(pal_brush_kind) == 4 && sizeof(int) == 4 && sizeof(pal_stroke) == 56,
               "members have the size of the log's numbers, and no padding");

/* without the points of an edit; -1: no such kind */
static int payload_of(pal_input_kind kind)
{
    size_t n_byte = 0;
    for (int i = 0; i < N_FIELD; i++) n_byte += fields[i].kind == kind ? fields[i].n_byte : 0;
    return kind < PAL_INPUT_POSE || kind >= PAL_INPUT_KINDS ? -1 : (int)n_byte;
}

/* what stands behind the payload: one or two lists of points */
typedef struct tail {
    const double *list[2];
    size_t n_byte; /* of each that is there */
    int n_list;
} tail;
static tail tail_of(const pal_input_record *r)
{
    const size_t point = 3 * sizeof(double);
    if (r->kind == PAL_INPUT_SCULPT) return (tail){{r->sculpt.point_m}, point * (size_t)r->sculpt.n_point, 1};
    if (r->kind == PAL_INPUT_STATE || r->kind == PAL_INPUT_RESTORE)
        return (tail){{r->x, r->v}, point * (size_t)r->n_point, 2};
    return (tail){.n_list = 0};
}
static size_t tail_bytes(const tail *t)
{
    return t->n_byte * (size_t)t->n_list;
}

pal_err pal_input_apply(pal_world *world, const pal_scene *scene, const pal_input_record *record, pal_diagnostic *diag)
{
    switch (record->kind) {
    case PAL_INPUT_POSE:
        return pal_world_pose(world, record->index, &record->pose);
    case PAL_INPUT_RELEASE:
        return pal_world_pose(world, record->index, NULL);
    case PAL_INPUT_RESET:
        pal_world_reset(world);
        return PAL_ERR_OK;
    case PAL_INPUT_RESET_BODY:
        return pal_world_reset_body(world, record->index);
    case PAL_INPUT_MATERIAL:
        return pal_world_material(world, record->index, &record->material, diag);
    case PAL_INPUT_BRUSH:
        return pal_world_brush(world, record->index, record->slot, &record->brush, diag);
    case PAL_INPUT_COMPONENT:
        return pal_world_switch_component(world, scene, record->index, record->component, record->wanted, diag);
    default:
        break;
    }
    return PAL_ERR_OK;
}

/* ---- fingerprint: FNV-1a over 64-bit words and bytes ---- */

static uint64_t mix_text(uint64_t h, const char *text)
{
    return pal_hash_bytes(h, text, strlen(text) + 1);
}
static uint64_t mix_item(uint64_t h, const pal_config_entry *item)
{
    h = mix_text(h, item->name);
    for (int k = 0; k < item->n_value; k++) {
        const pal_config_value *v = &item->value[k];
        int facts[3] = {(int)v->kind, v->flag, v->n_number};
        h = mix_text(h, v->key);
        h = pal_hash_bytes(h, facts, sizeof facts);
        h = mix_text(h, v->kind == PAL_VALUE_TEXT ? v->text : "");
        if (v->kind == PAL_VALUE_NUMBER) h = pal_hash_bytes(h, v->number, sizeof v->number[0]);
        if (v->kind == PAL_VALUE_NUMBERS) h = pal_hash_bytes(h, v->number, (size_t)v->n_number * sizeof v->number[0]);
    }
    return h;
}
static uint64_t mix_material(uint64_t h, const pal_material *m)
{
    double number[4] = {m->young_Pa, m->poisson, m->density_kg_m3, m->damping_1_s};
    h = pal_hash_bytes(h, number, sizeof number);
    return m->damping_1_s == PAL_DAMPING_DERIVED ? pal_hash_bytes(h, &m->damping_ratio, sizeof(double)) : h;
}
static uint64_t mix_mesh(uint64_t h, const pal_prepared *mesh)
{
    if (!mesh) return h;
    int count[4] = {mesh->tets.n_node, mesh->tets.n_tet, mesh->surface.n_vertex, mesh->surface.n_tri};
    h = pal_hash_bytes(h, count, sizeof count);
    h = pal_hash_bytes(h, mesh->tets.x, (size_t)mesh->tets.n_node * 3 * sizeof(double));
    h = pal_hash_bytes(h, mesh->tets.tet, (size_t)mesh->tets.n_tet * 4 * sizeof(int32_t));
    h = pal_hash_bytes(h, mesh->surface.x, (size_t)mesh->surface.n_vertex * 3 * sizeof(double));
    /* a mesh with tetrahedra is simulated by them alone, so its surface triangles do not count */
    if (mesh->tets.n_tet == 0)
        h = pal_hash_bytes(h, mesh->surface.tri, (size_t)mesh->surface.n_tri * 3 * sizeof(int32_t));
    return pal_hash_bytes(h, mesh->tets.origin_m, sizeof mesh->tets.origin_m);
}

/* control cells, their sharp features and paint */
static uint64_t mix_cells(uint64_t h, const pal_body_def *def)
{
    const pal_cells *c = def->cells;
    if (!c) return h;
    int count[4] = {c->n_vertex, c->n_cell, c->n_edge_use, def->n_stroke};
    h = pal_hash_bytes(h, count, sizeof count);
    h = pal_hash_bytes(h, c->x, (size_t)c->n_vertex * 3 * sizeof(double));
    h = pal_hash_bytes(h, c->vertex_sharpness, (size_t)c->n_vertex * sizeof(float));
    h = pal_hash_bytes(h, c->cell_use, ((size_t)c->n_cell + 1) * sizeof(int32_t));
    for (int32_t i = 0; i < c->n_face_use; i++) h = pal_hash_bytes(h, &c->face_use[i].first_use, sizeof(int32_t));
    for (int32_t i = 0; i < c->n_edge_use; i++) h = pal_hash_bytes(h, &c->edge_use[i].vertex, sizeof(int32_t));
    for (int32_t i = 0; i < c->n_edge; i++) h = pal_hash_bytes(h, &c->edge[i].sharp, sizeof(float));
    for (int32_t i = 0; i < c->n_face; i++) h = pal_hash_bytes(h, &c->face[i].sharp, sizeof(float));
    /* removed tissue has no contact */
    const double cut[4] = {def->cut_normal[0], def->cut_normal[1], def->cut_normal[2], def->cut_m};
    if (def->cut) h = pal_hash_bytes(h, cut, sizeof cut);
    return pal_hash_bytes(h, def->stroke, (size_t)def->n_stroke * sizeof *def->stroke);
}

uint64_t pal_scene_fingerprint(const pal_scene *scene)
{
    uint64_t h = PAL_HASH_START;
    h = pal_hash_bytes(h, &scene->step_s, sizeof scene->step_s);
    h = pal_hash_bytes(h, scene->up, sizeof scene->up);
    h = pal_hash_bytes(h, &scene->gravity_m_s2, sizeof scene->gravity_m_s2);
    h = pal_hash_bytes(h, &scene->max_substep, sizeof scene->max_substep);
    for (int b = 0; b < scene->n_body; b++) {
        const pal_body_def *def = &scene->body[b];
        h = mix_mesh(h, def->mesh);
        h = mix_cells(h, def);
        h = mix_material(h, &def->material);
        h = mix_item(mix_item(mix_item(h, &def->model), &def->solver), &def->output);
        for (int k = 0; k < def->n_support; k++) {
            const pal_support_def *s = &def->support[k];
            double number[8] = {s->rim ? 2 : s->lowest, s->lowest ? s->fraction : 0};
            if (!s->lowest && !s->rim)
                memcpy(number + 2, s->low_m, sizeof s->low_m), memcpy(number + 5, s->high_m, sizeof s->high_m);
            h = pal_hash_bytes(h, number, sizeof number);
        }
        for (int k = 0; k < def->n_effect; k++) h = mix_item(h, &def->effect[k]);
    }
    for (int t = 0; t < scene->n_tool; t++) {
        double number[2] = {scene->tool[t].radius_m, scene->tool[t].force_cap_N};
        h = pal_hash_bytes(h, number, sizeof number);
    }
    return h;
}

/* of head, payload and points with 0 for the CRC */
uint32_t pal_input_crc(const uint8_t *record, size_t n)
{
    static const uint8_t none[sizeof(uint32_t)];
    const size_t at = offsetof(record_head, crc), after = at + sizeof none;
    uLong crc = crc32_z(0, record, at);
    crc = crc32_z(crc, none, sizeof none);
    return (uint32_t)crc32_z(crc, record + after, n - after);
}

static bool write_all(int file, const uint8_t *bytes, size_t n)
{
    while (n > 0) {
        ssize_t done = write(file, bytes, n);
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) return false;
        bytes += done, n -= (size_t)done;
    }
    return true;
}

static void fail(pal_input_log *log)
{
    const int error = errno ? errno : EIO;
    atomic_store(&log->error, error);
    pal_log(PAL_LOG_ERROR, "record", "%s: the recording ends here: %s", log->path, strerror(error));
}

/* what is not on a disk (a pipe, a device) has nothing to save */
static void save(pal_input_log *log)
{
    if (!log->unsaved || pal_input_log_error(log)) return;
    if (fdatasync(log->file) && errno != EINVAL && errno != EROFS) fail(log);
    log->unsaved = false;
}

/* writes the content of the ring buffer, in at most two pieces */
static void drain(pal_input_log *log)
{
    uint64_t out = atomic_load_explicit(&log->out, memory_order_relaxed);
    uint64_t filled = atomic_load_explicit(&log->filled, memory_order_acquire);
    while (out < filled) {
        size_t begin = (size_t)out & (log->n_ring - 1), n = (size_t)(filled - out);
        if (n > log->n_ring - begin) n = log->n_ring - begin;
        if (!pal_input_log_error(log)) {
            log->unsaved = true;
            if (!write_all(log->file, log->ring + begin, n)) fail(log);
        }
        out += n;
        atomic_store_explicit(&log->out, out, memory_order_release);
    }
}

static void *writer(void *user)
{
    pal_input_log *log = user;
    uint64_t when = pal_clock_ns(), save_ns = when;
    while (!atomic_load(&log->stop)) {
        drain(log);
        if (when >= save_ns) {
            save(log);
            save_ns = when + PAL_LOG_SAVE_NS;
        }
        when += PAL_LOG_FLUSH_NS;
        pal_clock_sleep_until_ns(when);
    }
    drain(log);
    save(log);
    return NULL;
}

/* "run.log", "run.2.log", ... */
static void name_file(const char *path, int number, char *name, size_t cap)
{
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    const int n_stem = (int)(dot && dot > (slash ? slash + 1 : path) ? (size_t)(dot - path) : strlen(path));
    (void)snprintf(name, cap, "%s", path);
    if (number > 1) (void)snprintf(name, cap, "%.*s.%d%s", n_stem, path, number, path + n_stem);
}

bool pal_input_log_newest(const char *path, char *name, size_t cap)
{
    int k = 1;
    for (; k <= MAX_NUMBER; k++) {
        name_file(path, k, name, cap);
        if (access(name, F_OK)) break;
    }
    if (k > 1) name_file(path, k - 1, name, cap);
    return k > 1;
}

/* a new file of this name, or with the next number before its suffix; its descriptor, < 0: errno */
static int create(const char *path, char name[PATH_MAX])
{
    struct stat there;
    errno = ENAMETOOLONG;
    if (strlen(path) > PATH_MAX - 8) return -1;
    for (int k = 1; k <= MAX_NUMBER; k++) {
        name_file(path, k, name, PATH_MAX);
        const int file = open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
        if (file >= 0 || errno != EEXIST) return file;
        /* a device is no recording */
        if (k == 1 && !stat(name, &there) && S_ISCHR(there.st_mode)) return open(name, O_WRONLY | O_CLOEXEC);
    }
    return -1;
}

static bool write_header(pal_input_log *log, const pal_scene *scene)
{
    pal_input_header header = {.version = VERSION,
                               .hash_steps = PAL_INPUT_HASH_STEPS,
                               .step_s = scene->step_s,
                               .fingerprint = pal_scene_fingerprint(scene),
                               .n_body = (uint32_t)scene->n_body,
                               .n_tool = (uint32_t)scene->n_tool};
    memcpy(header.magic, magic, sizeof magic);
    return write_all(log->file, (const uint8_t *)&header, sizeof header);
}

pal_err pal_input_log_open(const char *path, const pal_scene *scene, size_t ring_byte, pal_diagnostic *diag,
                           pal_input_log **out)
{
    pal_input_log *log = calloc(1, sizeof *log);
    size_t n_ring = 1024;
    while (n_ring < (ring_byte ? ring_byte : PAL_LOG_RING_BYTES)) n_ring *= 2;
    if (log) log->ring = calloc(1, n_ring);
    if (!log || !log->ring) {
        free(log);
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for the input log");
    }
    log->n_ring = n_ring;
    log->file = create(path, log->path);
    bool good = log->file >= 0 && write_header(log, scene) && !(errno = pal_thread_start(&log->thread, writer, log));
    if (!good) {
        int reason = errno;
        if (log->file >= 0) close(log->file);
        free(log->ring);
        free(log);
        return pal_diagnostic_set(diag, PAL_ERR_IO, "%s: the input log cannot be written: %s", path, strerror(reason));
    }
    *out = log;
    return PAL_ERR_OK;
}

/* all but the points, which the CRC covers too */
static size_t encode(const pal_input_record *record, uint8_t bytes[PAL_INPUT_HEAD + PAL_INPUT_PAYLOAD])
{
    const tail t = tail_of(record);
    record_head head = {.kind = (uint8_t)record->kind,
                        .index = (uint8_t)record->index,
                        .n_byte = (uint32_t)((size_t)payload_of(record->kind) + tail_bytes(&t)),
                        .step = record->step};
    size_t at = sizeof head;
    memcpy(bytes, &head, sizeof head);
    for (const struct field *f = fields; f < fields + N_FIELD; f++) {
        if (f->kind != record->kind) continue;
        memcpy(bytes + at, (const uint8_t *)record + f->offset, f->n_byte);
        at += f->n_byte;
    }
    head.crc = pal_input_crc(bytes, at);
    for (int k = 0; k < t.n_list && t.n_byte > 0; k++)
        head.crc = (uint32_t)crc32_z(head.crc, (const uint8_t *)t.list[k], t.n_byte);
    memcpy(bytes, &head, sizeof head);
    return at;
}

/* at most two pieces */
static void put_bytes(pal_input_log *log, uint64_t at, const void *bytes, size_t n)
{
    const size_t begin = (size_t)at & (log->n_ring - 1), first = n < log->n_ring - begin ? n : log->n_ring - begin;
    if (n == 0) return;
    memcpy(log->ring + begin, bytes, first);
    memcpy(log->ring, (const uint8_t *)bytes + first, n - first);
}

void pal_input_log_put(pal_input_log *log, const pal_input_record *record)
{
    uint8_t bytes[PAL_INPUT_HEAD + PAL_INPUT_PAYLOAD];
    if (!log) return;
    const tail t = tail_of(record);
    const size_t n = encode(record, bytes), n_tail = tail_bytes(&t);
    uint64_t filled = atomic_load_explicit(&log->filled, memory_order_relaxed);
    uint64_t out = atomic_load_explicit(&log->out, memory_order_acquire);
    if (n + n_tail > log->n_ring - (size_t)(filled - out)) {
        log->n_dropped++;
        return;
    }
    put_bytes(log, filled, bytes, n);
    for (int k = 0; k < t.n_list; k++) put_bytes(log, filled + n + t.n_byte * (size_t)k, t.list[k], t.n_byte);
    atomic_store_explicit(&log->filled, filled + n + n_tail, memory_order_release);
}

uint64_t pal_input_log_dropped(const pal_input_log *log)
{
    return log ? log->n_dropped : 0;
}

const char *pal_input_log_path(const pal_input_log *log)
{
    return log->path;
}

int pal_input_log_error(const pal_input_log *log)
{
    return log ? atomic_load_explicit(&log->error, memory_order_relaxed) : 0;
}

void pal_input_log_flush(pal_input_log *log)
{
    if (atomic_exchange(&log->stop, true)) return;
    pthread_join(log->thread, NULL);
}

pal_err pal_input_log_close(pal_input_log *log, uint64_t step, uint64_t hash)
{
    uint8_t bytes[PAL_INPUT_HEAD + PAL_INPUT_PAYLOAD];
    if (!log) return PAL_ERR_OK;
    pal_input_log_flush(log);
    drain(log);
    pal_input_record end = {.kind = PAL_INPUT_END, .step = step, .hash = hash, .n_dropped = log->n_dropped};
    if (!pal_input_log_error(log)) {
        log->unsaved = true;
        if (!write_all(log->file, bytes, encode(&end, bytes))) fail(log);
        save(log);
    }
    if (close(log->file) && !pal_input_log_error(log)) fail(log);
    const bool good = !pal_input_log_error(log);
    free(log->ring);
    free(log);
    return good ? PAL_ERR_OK : PAL_ERR_IO;
}

pal_err pal_input_get_header(const char *name, const uint8_t *bytes, size_t n_byte, pal_input_header *out, size_t *at,
                             pal_diagnostic *diag)
{
    pal_input_header header;
    if (n_byte < sizeof magic || memcmp(bytes, magic, sizeof magic) != 0)
        return PAL_REFUSE(diag, "%s: byte 0: not an input log", name);
    if (n_byte < PAL_INPUT_HEADER) return PAL_REFUSE(diag, "%s: byte %zu: the log is cut in its header", name, n_byte);
    memcpy(&header, bytes, sizeof header);
    if (header.version != VERSION)
        return PAL_REFUSE(diag, "%s: byte 8: log version %u, this program reads %d", name, header.version, VERSION);
    if (header.hash_steps < 1 || header.hash_steps > PAL_INPUT_HASH_MAX)
        return PAL_REFUSE(diag, "%s: byte 12: %u steps between hashes are outside 1 .. %d", name, header.hash_steps,
                          PAL_INPUT_HASH_MAX);
    *out = header;
    *at = PAL_INPUT_HEADER;
    return PAL_ERR_OK;
}

/* the parts of an edit and of a configuration, of n_tail bytes behind the payload */
static pal_err check_change(const char *name, size_t at, const pal_input_record *r, size_t n_tail, pal_diagnostic *diag)
{
    const pal_configuration *c = &r->configuration;
    const char *const word[] = {c->model, c->element, c->law, c->solver};
    if (r->n_point < 0 || r->sculpt.n_point < 0)
        return PAL_REFUSE(diag, "%s: byte %zu: %d points", name, at, r->n_point < 0 ? r->n_point : r->sculpt.n_point);
    const tail t = tail_of(r);
    if (tail_bytes(&t) != n_tail)
        return PAL_REFUSE(diag, "%s: byte %zu: %zu bytes of points, wanted %zu", name, at, n_tail, tail_bytes(&t));
    if (r->kind == PAL_INPUT_SCULPT &&
        ((unsigned)r->sculpt.kind >= PAL_SCULPT_KINDS || (unsigned)r->sculpt.cells.kind >= PAL_CELLS_COMMAND_KINDS ||
         *(const uint8_t *)&r->sculpt.cut > 1))
        return PAL_REFUSE(diag, "%s: byte %zu: no edit of kind %u, %u", name, at, (unsigned)r->sculpt.kind,
                          (unsigned)r->sculpt.cells.kind);
    for (int k = 0; k < 4; k++)
        if (!memchr(word[k], 0, PAL_NAME))
            return PAL_REFUSE(diag, "%s: byte %zu: a configuration without names", name, at);
    return PAL_ERR_OK;
}

pal_err pal_input_get_record(const char *name, const uint8_t *bytes, size_t n_byte, size_t *at, pal_input_record *out,
                             pal_diagnostic *diag)
{
    if (n_byte - *at < PAL_INPUT_HEAD)
        return PAL_REFUSE(diag, "%s: byte %zu: the log is cut: it has no end record", name, *at);
    record_head head;
    memcpy(&head, bytes + *at, sizeof head);
    pal_input_record record = {.kind = (pal_input_kind)head.kind, .index = head.index, .step = head.step};
    const int payload = payload_of(record.kind);
    if (payload < 0 || head.n_byte < (uint32_t)payload ||
        (head.n_byte > (uint32_t)payload && record.kind != PAL_INPUT_SCULPT && record.kind != PAL_INPUT_STATE &&
         record.kind != PAL_INPUT_RESTORE))
        return PAL_REFUSE(diag, "%s: byte %zu: no record of kind %d has %u bytes", name, *at, head.kind, head.n_byte);
    if (n_byte - *at - PAL_INPUT_HEAD < head.n_byte)
        return PAL_REFUSE(diag, "%s: byte %zu: the log is cut in a record", name, *at);
    if (pal_input_crc(bytes + *at, PAL_INPUT_HEAD + (size_t)head.n_byte) != head.crc)
        return PAL_REFUSE(diag, "%s: byte %zu: a record is damaged: its CRC is another", name, *at);
    const uint8_t *from = bytes + *at + sizeof head;
    for (const struct field *f = fields; f < fields + N_FIELD; f++) {
        if (f->kind != record.kind) continue;
        memcpy((uint8_t *)&record + f->offset, from, f->n_byte);
        from += f->n_byte;
    }
    if (record.slot < 0 || record.slot >= PAL_TOOL_MAX || (unsigned)record.brush.kind >= PAL_BRUSH_COUNT)
        return PAL_REFUSE(diag, "%s: byte %zu: there is no brush of kind %u on tool %u", name, *at,
                          (unsigned)record.brush.kind, (unsigned)record.slot);
    if (record.wanted > 1 || record.component[PAL_NAME - 1] != 0)
        return PAL_REFUSE(diag, "%s: byte %zu: a component that is neither on nor off, or no name", name, *at);
    PAL_TRY(check_change(name, *at, &record, head.n_byte - (size_t)payload, diag));
    const tail t = tail_of(&record);
    if (record.kind == PAL_INPUT_SCULPT && t.n_byte) record.sculpt.point_m = (const double *)(const void *)from;
    if (t.n_list == 2) {
        record.x = (const double *)(const void *)from;
        record.v = (const double *)(const void *)(from + t.n_byte);
    }
    *at += PAL_INPUT_HEAD + head.n_byte;
    *out = record;
    return PAL_ERR_OK;
}
