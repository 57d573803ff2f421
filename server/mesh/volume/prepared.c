/* The prepared mesh: made from a surface, saved, loaded.
 *
 * File, little-endian: head; eight u64 counts and four doubles (origin, h); an entry for each section; the sections,
 * each at a multiple of 64. The checksum is of all that follows the head. The counts alone fix every section's size, so
 * a file is either whole or refused, and no more is taken from the heap than the file has bytes. Of the hexahedra only
 * measured fill and weights are kept: their corners follow from the tetrahedra. A mesh without skin frames binds no
 * vertex to any, so that a surface alone has counts of 0 but its own. Version 2 has no fill; version 4 adds image
 * coordinates, version 5 the weights of cut voxels. Each has a count and a section more than the one before, and a mesh
 * is written in the first that holds it. */
#include "server/mesh/volume/prepared.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/mesh/files/file_bytes.h"

#include <stdlib.h>
#include <string.h>

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "the prepared file is copied from memory: a big-endian machine needs a swap here"
#endif

enum { VERSION_MIN = 2, VERSION = 3, VERSION_IMAGE = 4, VERSION_MAX = 5, N_COUNT = 10, N_SECTION = 17 };
static const char MAGIC[8] = "PALPREP1";

typedef struct head {
    char magic[8];
    uint32_t version, n_section;
    uint64_t n_byte, checksum;
} head;

typedef struct entry {
    uint32_t number, item_byte;
    uint64_t n, at;
} entry;

enum { HEAD = sizeof(head), ENTRY = sizeof(entry) };
_Static_assert(HEAD == 32 && ENTRY == 24, "the file has no padding");

/* what differs between versions */
typedef struct layout {
    int n_count, n_section;
    size_t table; /* where the section table begins, after the counts and four doubles */
} layout;

static layout layout_of(uint32_t version)
{
    const int fewer = version >= VERSION_MIN && version <= VERSION_MAX ? VERSION_MAX - (int)version : 0;
    return (layout){N_COUNT - fewer, N_SECTION - fewer, (size_t)HEAD + 8 * (size_t)(N_COUNT - fewer) + 32};
}

/* one array of a prepared mesh: where it is kept, its item size and how many items the counts call for */
typedef struct section {
    void *pointer; /* address of the array's pointer, read and written by copying */
    size_t n_byte; /* of an item */
    uint64_t n;
} section;

static void list_sections(pal_prepared *p, const uint64_t count[N_COUNT], section out[N_SECTION])
{
    uint64_t n_vertex = count[0], n_tri = count[1], n_node = count[2], n_tet = count[3], n_face = count[4],
             n_frame = count[5], n_fan = count[6], n_fill = count[7], n_image_at = count[8], n_weight = count[9],
             n_near = n_frame ? PAL_SKIN_NEIGHBOURS * n_vertex : 0;
    const section all[N_SECTION] = {{&p->surface.x, 8, 3 * n_vertex},
                                    {&p->surface.tri, 4, 3 * n_tri},
                                    {&p->tets.x, 8, 3 * n_node},
                                    {&p->tets.tet, 4, 4 * n_tet},
                                    {&p->tets.face, 4, 3 * n_face},
                                    {&p->tets.on_surface, 1, n_node},
                                    {&p->skin.frame, 4, n_frame},
                                    {&p->skin.frame_edge, 4, 2 * n_frame},
                                    {&p->skin.frame_rotation, 4, 2 * n_frame},
                                    {&p->skin.frame_rest, 4, 3 * n_frame},
                                    {&p->skin.fan_start, 4, n_frame + 1},
                                    {&p->skin.fan, 4, 2 * n_fan},
                                    {&p->skin.near, 4, n_near},
                                    {&p->skin.coef, 4, 4 * n_near},
                                    {&p->hexes.fill, 4, n_fill},
                                    {&p->surface.image_at, 4, 9 * n_image_at},
                                    {&p->hexes.weight, 4, 8 * n_weight}};
    memcpy(out, all, sizeof all);
}

static void get_counts(const pal_prepared *p, uint64_t count[N_COUNT])
{
    const int32_t *fan_start = p->skin.fan_start;
    const int n_fan = fan_start ? fan_start[p->skin.n_frame] : 0, n_fill = p->hexes.measured ? p->hexes.n_hex : 0;
    const int n[N_COUNT] = {p->surface.n_vertex,
                            p->surface.n_tri,
                            p->tets.n_node,
                            p->tets.n_tet,
                            p->tets.n_face,
                            p->skin.n_frame,
                            n_fan,
                            n_fill,
                            p->surface.image_at ? p->surface.n_tri : 0,
                            p->hexes.weight ? n_fill : 0};
    for (int k = 0; k < N_COUNT; k++) count[k] = (uint64_t)n[k];
}

static void put_counts(pal_prepared *p, const uint64_t count[N_COUNT])
{
    p->surface.n_vertex = (int)count[0];
    p->skin.n_vertex = count[5] ? (int)count[0] : 0;
    p->surface.n_tri = (int)count[1];
    p->tets.n_node = p->skin.n_node = (int)count[2];
    p->tets.n_tet = (int)count[3];
    p->tets.n_face = (int)count[4];
    p->skin.n_frame = (int)count[5];
}

void pal_prepared_free(pal_prepared *prepared)
{
    pal_surface_free(&prepared->surface);
    pal_tets_free(&prepared->tets);
    pal_skin_free(&prepared->skin);
    pal_hexes_free(&prepared->hexes);
}

double pal_prepared_missing(const pal_prepared *mesh)
{
    double sum = 0, cube = mesh->tets.edge_m * mesh->tets.edge_m * mesh->tets.edge_m;
    for (int e = 0; e < mesh->hexes.n_hex; e++) sum += cube * (double)mesh->hexes.fill[e];
    return 1 - sum / fabs(pal_surface_volume(&mesh->surface));
}

pal_err pal_prepared_make(const pal_surface *surface, const pal_voxel_options *options, pal_prepared *out,
                          pal_prepare_report *report, pal_diagnostic *diag)
{
    pal_prepared p = {0};
    pal_prepare_report result = {0};
    pal_voxels voxels = {0};
    PAL_TRY(pal_voxels_fill(surface, options, &voxels, &result.voxel, diag));
    result.n_voxel = voxels.n_inside + voxels.n_border;
    double began = pal_clock_s();
    pal_err err = pal_voxels_split(&voxels, &p.tets);
    pal_voxels_free(&voxels);
    if (err)
        return pal_diagnostic_set(diag, err, "cannot split %lld voxels into tetrahedra", (long long)result.n_voxel);
    double split = pal_clock_s();
    result.split_s = split - began;
    err = pal_hexes_find(&p.tets, &p.hexes, diag);
    if (!err && (options->fill || options->min_fill > 0)) err = pal_hexes_fill(&p.hexes, &p.tets, surface, diag);
    if (err) {
        pal_prepared_free(&p);
        return err;
    }
    result.hexes_s = pal_clock_s() - split;
    split += result.hexes_s;
    err = pal_skin_bind(&p.tets, surface->x, surface->n_vertex, &p.skin);
    result.skin_s = pal_clock_s() - split;
    if (!err) err = pal_surface_copy(surface, &p.surface);
    if (err) {
        pal_prepared_free(&p);
        return pal_diagnostic_set(diag, err, "cannot bind %d vertices to the mesh", surface->n_vertex);
    }
    result.volume_m3 = pal_tets_volume(&p.tets);
    if (result.voxel.surface_volume_m3 > 0)
        result.volume_error = result.voxel.inside_volume_m3 / result.voxel.surface_volume_m3 - 1;
    *out = p;
    if (report) *report = result;
    return PAL_ERR_OK;
}

pal_err pal_prepared_surface(const pal_surface *surface, pal_prepared *out)
{
    pal_prepared p = {0};
    double sum = 0;
    PAL_TRY(pal_surface_copy(surface, &p.surface));
    for (int t = 0; t < surface->n_tri; t++)
        for (int k = 0; k < 3; k++)
            sum += pal_dist3(surface->x + 3 * (size_t)surface->tri[3 * t + k],
                             surface->x + 3 * (size_t)surface->tri[3 * t + (k + 1) % 3]);
    p.tets.edge_m = sum > 0 ? sum / (3.0 * surface->n_tri) : 1;
    pal_copy3(p.tets.origin_m, surface->origin_m);
    *out = p;
    return PAL_ERR_OK;
}

uint64_t pal_prepared_checksum(const uint8_t *bytes, size_t n_byte)
{
    if (n_byte < HEAD) return 0;
    uint64_t lane[4] = {1, 2, 3, 4}, word;
    size_t at = HEAD;
    for (; at + 32 <= n_byte; at += 32)
        for (int k = 0; k < 4; k++) {
            memcpy(&word, bytes + at + 8 * k, 8);
            lane[k] = (lane[k] ^ word) * 0x9E3779B97F4A7C15u;
            lane[k] ^= lane[k] >> 29;
        }
    for (; at < n_byte; at++) lane[0] = (lane[0] ^ bytes[at]) * 0x9E3779B97F4A7C15u;
    uint64_t sum = n_byte;
    for (int k = 0; k < 4; k++) {
        sum = (sum ^ lane[k]) * 0xD6E8FEB86659FD93u;
        sum ^= sum >> 32;
    }
    return sum;
}

static size_t round_up(size_t n)
{
    return (n + 63) / 64 * 64;
}

pal_err pal_prepared_bytes(const pal_prepared *prepared, uint8_t **bytes_out, size_t *n_byte_out)
{
    pal_prepared p = *prepared;
    const uint32_t version = p.hexes.weight && p.hexes.measured ? VERSION_MAX
                             : p.surface.image_at               ? VERSION_IMAGE
                                                                : VERSION;
    layout l = layout_of(version);
    uint64_t count[N_COUNT];
    section s[N_SECTION];
    get_counts(&p, count);
    list_sections(&p, count, s);
    size_t n_byte = round_up(l.table + ENTRY * (size_t)l.n_section);
    for (int k = 0; k < l.n_section; k++) n_byte += round_up(s[k].n * s[k].n_byte);
    uint8_t *bytes = calloc(n_byte, 1);
    if (!bytes) return PAL_ERR_MEMORY;

    head h = {.version = version, .n_section = (uint32_t)l.n_section, .n_byte = n_byte};
    memcpy(h.magic, MAGIC, sizeof h.magic);
    memcpy(bytes + HEAD, count, 8 * (size_t)l.n_count);
    memcpy(bytes + l.table - 32, p.tets.origin_m, 24);
    memcpy(bytes + l.table - 8, &p.tets.edge_m, 8);
    size_t at = round_up(l.table + ENTRY * (size_t)l.n_section);
    for (int k = 0; k < l.n_section; k++) {
        entry e = {(uint32_t)k + 1, (uint32_t)s[k].n_byte, s[k].n, at};
        memcpy(bytes + l.table + (size_t)ENTRY * (size_t)k, &e, ENTRY);
        void *array;
        memcpy(&array, s[k].pointer, sizeof array);
        /* fans of no frame are one 0, which a mesh without skin need not hold */
        if (s[k].n && array) memcpy(bytes + at, array, s[k].n * s[k].n_byte);
        at += round_up(s[k].n * s[k].n_byte);
    }
    h.checksum = pal_prepared_checksum(bytes, n_byte);
    memcpy(bytes, &h, HEAD);
    *bytes_out = bytes;
    *n_byte_out = n_byte;
    return PAL_ERR_OK;
}

pal_err pal_prepared_save(const pal_prepared *prepared, const char *path, pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    if (pal_prepared_bytes(prepared, &bytes, &n_byte))
        return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: out of memory while writing", path);
    pal_err err = pal_file_write(path, bytes, n_byte, diag);
    free(bytes);
    return err;
}

pal_err pal_prepared_load(const char *path, pal_prepared *out, pal_diagnostic *diag)
{
    uint8_t *bytes;
    size_t n_byte;
    PAL_TRY(pal_file_read(path, (size_t)8 << 30, &bytes, &n_byte, diag));
    pal_err err = pal_prepared_parse(path, bytes, n_byte, out, diag);
    free(bytes);
    return err;
}

static bool all_within(const int32_t *item, uint64_t n, int32_t low, uint64_t end)
{
    int32_t min = 0, max = -1;
    for (uint64_t i = 0; i < n; i++) {
        min = item[i] < min ? item[i] : min;
        max = item[i] > max ? item[i] : max;
    }
    return min >= low && (int64_t)max < (int64_t)end;
}

static bool all_finite(const double *item, uint64_t n)
{
    bool finite = true;
    for (uint64_t i = 0; i < n; i++) finite &= fabs(item[i]) < 1e300;
    return finite;
}

static bool all_finite_float(const float *item, uint64_t n)
{
    bool finite = true;
    for (uint64_t i = 0; i < n; i++) finite &= fabsf(item[i]) < 1e30f;
    return finite;
}

/* the first fault of a mesh, or NULL; every index is checked before it is used */
static const char *find_fault(const pal_prepared *p, const uint64_t count[N_COUNT])
{
    const pal_surface *surface = &p->surface;
    const pal_tets *tets = &p->tets;
    const pal_skin *skin = &p->skin;
    uint64_t n_node = count[2], n_frame = count[5];
    if (!all_finite(surface->x, 3 * count[0]) || !all_finite(tets->x, 3 * n_node)) return "a position is not finite";
    if (!all_finite(tets->origin_m, 3)) return "the origin is not finite";
    if (!(tets->edge_m > 0) || !isfinite(tets->edge_m)) return "the voxel edge is not positive";
    if (!all_within(surface->tri, 3 * count[1], 0, count[0])) return "a triangle's corner is out of range";
    if (!all_within(tets->tet, 4 * count[3], 0, n_node)) return "a tetrahedron's corner is out of range";
    if (!all_within(tets->face, 3 * count[4], 0, n_node)) return "a boundary face's corner is out of range";
    if (!all_within(skin->frame, n_frame, 0, n_node)) return "a skin frame's node is out of range";
    if (!all_within(skin->frame_edge, 2 * n_frame, -1, n_node)) return "a skin frame's edge is out of range";
    bool rows = skin->fan_start[0] == 0 && (uint64_t)(int64_t)skin->fan_start[n_frame] == count[6];
    for (uint64_t f = 0; f < n_frame; f++) {
        if (skin->frame_edge[2 * f] < 0) return "a skin frame has no edge";
        rows &= skin->fan_start[f + 1] >= skin->fan_start[f];
    }
    if (!rows) return "the skin's fans are not ascending rows";
    if (!all_within(skin->fan, 2 * count[6], 0, n_node)) return "a skin fan's corner is out of range";
    uint64_t n_near = n_frame ? PAL_SKIN_NEIGHBOURS * count[0] : 0;
    if (!all_within(skin->near, n_near, 0, n_frame)) return "a vertex's skin frame is out of range";
    if (!all_finite_float(skin->coef, 4 * n_near) || !all_finite_float(skin->frame_rotation, 2 * n_frame) ||
        !all_finite_float(skin->frame_rest, 3 * n_frame))
        return "a skin weight is not finite";
    for (uint64_t i = 0; i < n_node; i++)
        if (tets->on_surface[i] > 1) return "a surface tag is neither 0 nor 1";
    for (uint64_t i = 0; i < count[7]; i++)
        if (!(p->hexes.fill[i] >= 0 && p->hexes.fill[i] <= 1)) return "a voxel's fill is not within 0..1";
    if (count[9] && count[9] != count[7]) return "not every voxel has weights";
    for (uint64_t i = 0; i < 8 * count[9]; i++)
        if (!(p->hexes.weight[i] >= 0 && p->hexes.weight[i] <= 0.125F))
            return "a weight of a voxel is not within 0..1/8";
    for (uint64_t i = 0; i < count[9]; i++)
        if (pal_weight_sum(p->hexes.weight + 8 * i) != p->hexes.fill[i]) return "weights do not sum to a voxel's fill";
    if (count[8] && count[8] != count[1]) return "not every triangle has image coordinates";
    if (!all_finite_float(surface->image_at, 9 * count[8])) return "an image coordinate is not finite";
    return NULL;
}

static pal_err read_head(const char *name, const uint8_t *bytes, size_t n_byte, layout *l, uint64_t count[N_COUNT],
                         pal_diagnostic *diag)
{
    head h = {0};
    if (n_byte >= HEAD) memcpy(&h, bytes, HEAD);
    if (memcmp(h.magic, MAGIC, sizeof h.magic)) return PAL_REFUSE(diag, "%s: byte 0: not a prepared mesh", name);
    *l = layout_of(h.version);
    if (h.version < VERSION_MIN || h.version > VERSION_MAX || h.n_section != (uint32_t)l->n_section)
        return PAL_REFUSE(diag, "%s: byte 8: version %u with %u sections, this program reads %d with %d to %d with %d",
                          name, h.version, h.n_section, VERSION_MIN, N_SECTION + VERSION_MIN - VERSION_MAX, VERSION_MAX,
                          N_SECTION);
    if (h.n_byte != n_byte || n_byte < l->table + ENTRY * (size_t)l->n_section)
        return PAL_REFUSE(diag, "%s: byte 16: %llu bytes announced, %zu are there", name, (unsigned long long)h.n_byte,
                          n_byte);
    if (h.checksum != pal_prepared_checksum(bytes, n_byte))
        return PAL_REFUSE(diag, "%s: byte 24: the checksum does not fit the content", name);
    memset(count, 0, N_COUNT * sizeof *count);
    memcpy(count, bytes + HEAD, (size_t)l->n_count * sizeof *count);
    for (int k = 0; k < l->n_count; k++)
        if (count[k] > INT32_MAX / 8)
            return PAL_REFUSE(diag, "%s: byte %d: count %llu is too large", name, HEAD + 8 * k,
                              (unsigned long long)count[k]);
    return PAL_ERR_OK;
}

/* copies the sections to the heap after checking that each lies in the file with the size the counts call for */
static pal_err read_sections(const char *name, const uint8_t *bytes, size_t n_byte, const layout *l,
                             section s[N_SECTION], pal_diagnostic *diag)
{
    uint64_t end = l->table + ENTRY * (size_t)l->n_section;
    for (int k = 0; k < l->n_section; k++) {
        size_t place = l->table + (size_t)ENTRY * (size_t)k;
        uint64_t size = s[k].n * s[k].n_byte;
        entry e;
        memcpy(&e, bytes + place, ENTRY);
        if (e.number != (uint32_t)k + 1 || e.item_byte != s[k].n_byte || e.n != s[k].n || e.at < end || e.at % 64 ||
            e.at > n_byte || size > n_byte - e.at)
            return PAL_REFUSE(diag, "%s: byte %zu: section %d does not fit the counts or the file", name, place, k + 1);
        end = e.at + size;
        void *array = malloc(size ? size : 1);
        memcpy(s[k].pointer, &array, sizeof array);
        if (!array) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: out of memory for section %d", name, k + 1);
        if (size) memcpy(array, bytes + e.at, size);
    }
    return PAL_ERR_OK;
}

/* the hexahedra of the checked tetrahedra; with the fill the file has, which must be theirs */
static pal_err read_hexes(const char *name, uint64_t n_fill, pal_prepared *p, pal_diagnostic *diag)
{
    float *fill = p->hexes.fill, *weight = p->hexes.weight;
    p->hexes.fill = p->hexes.weight = NULL;
    pal_err err = pal_hexes_find(&p->tets, &p->hexes, NULL);
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "%s: out of memory for the voxels", name);
    if (err == PAL_ERR_REFUSED && n_fill == 0) err = PAL_ERR_OK;
    if (err == PAL_ERR_REFUSED || (!err && n_fill > 0 && n_fill != (uint64_t)p->hexes.n_hex))
        err = PAL_REFUSE(diag, "%s: fill of %llu voxels, the mesh has %d", name, (unsigned long long)n_fill,
                         p->hexes.n_hex);
    if (err || n_fill == 0) {
        free(fill), free(weight);
        return err;
    }
    free(p->hexes.fill);
    p->hexes.fill = fill, p->hexes.weight = weight;
    p->hexes.measured = true;
    return PAL_ERR_OK;
}

pal_err pal_prepared_parse(const char *name, const uint8_t *bytes, size_t n_byte, pal_prepared *out,
                           pal_diagnostic *diag)
{
    pal_prepared p = {0};
    uint64_t count[N_COUNT];
    section s[N_SECTION];
    layout l = layout_of(VERSION);
    PAL_TRY(read_head(name, bytes, n_byte, &l, count, diag));
    list_sections(&p, count, s);
    pal_err err = read_sections(name, bytes, n_byte, &l, s, diag);
    if (!err) {
        const uint8_t *place = bytes + l.table - 32;
        put_counts(&p, count);
        if (!count[8]) {
            free(p.surface.image_at);
            p.surface.image_at = NULL;
        }
        if (!count[9]) {
            free(p.hexes.weight);
            p.hexes.weight = NULL;
        }
        memcpy(p.tets.origin_m, place, 24);
        memcpy(p.surface.origin_m, p.tets.origin_m, 24);
        memcpy(&p.tets.edge_m, place + 24, 8);
        const char *fault = find_fault(&p, count);
        if (fault) err = PAL_REFUSE(diag, "%s: %s", name, fault);
    }
    if (!err && (err = pal_tets_check(&p.tets, NULL)) == PAL_ERR_REFUSED) {
        pal_diagnostic inner;
        pal_tets_check(&p.tets, &inner);
        pal_diagnostic_set(diag, err, "%s: %.400s", name, inner.text);
    }
    if (!err) err = read_hexes(name, count[7], &p, diag);
    if (err)
        pal_prepared_free(&p);
    else
        *out = p;
    return err;
}
