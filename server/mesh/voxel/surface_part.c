/* Parts of a surface: components over edges that are matched by position, a common orientation, cavities.
 *
 * One hash table over edges joins triangles into parts (any shared edge) and into patches of one orientation (edges of
 * exactly two triangles, union-find with a parity bit). A part that is a closed chain keeps its orientation; others
 * take that of the patches. */
#include "server/mesh/voxel/surface_part.h"

#include "server/base/vec3.h"
#include "server/num/union_find.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct edge_entry {
    uint64_t key; /* 0: free */
    int32_t tri[2];
    int8_t sign[2];
    uint8_t n; /* 3: three or more */
} edge_entry;

typedef struct finder {
    const pal_scan_surface *scan;
    size_t mask;
    edge_entry *table;
    int32_t *joined;       /* union-find of parts   [n_tri]                                     */
    int32_t *patch;        /* union-find of patches [n_tri]                                     */
    uint8_t *reversed_of;  /* orientation against the patch parent; finally against the root */
    uint8_t *inconsistent; /* at a patch root: the patch has no common orientation (Moebius)    */
} finder;

/* root of a patch and the orientation of the triangle against it; compresses the path */
static int32_t find_patch(finder *f, int32_t i, uint8_t *reversed)
{
    int32_t root = i;
    uint8_t total = 0;
    for (; f->patch[root] != root; root = f->patch[root]) total ^= f->reversed_of[root];
    *reversed = total;
    while (f->patch[i] != root && i != root) {
        int32_t next = f->patch[i];
        uint8_t own = f->reversed_of[i];
        f->patch[i] = root;
        f->reversed_of[i] = total;
        total ^= own;
        i = next;
    }
    return root;
}

static const int32_t *corner(const pal_scan_surface *scan, int32_t tri, int k)
{
    return scan->point + 3 * (size_t)scan->tri[3 * (size_t)tri + (size_t)(k == 3 ? 0 : k)];
}

static void add_edge(finder *f, int32_t tri, uint64_t key, int sign)
{
    size_t at = key & f->mask;
    while (f->table[at].key && f->table[at].key != key) at = (at + 1) & f->mask;
    edge_entry *e = &f->table[at];
    if (e->n < 2) {
        e->key = key;
        e->tri[e->n] = tri;
        e->sign[e->n] = (int8_t)sign;
    }
    if (e->n < 3) e->n++;
    if (e->n == 1) return;
    pal_union_find_join(f->joined, tri, e->tri[0]);
}

/* edges of exactly two triangles relate the orientations of these */
static void join_patches(finder *f)
{
    for (size_t i = 0; i <= f->mask; i++) {
        const edge_entry *e = &f->table[i];
        if (e->n != 2) continue;
        uint8_t reversed_a, reversed_b, differ = e->sign[0] == e->sign[1];
        int32_t a = find_patch(f, e->tri[0], &reversed_a), b = find_patch(f, e->tri[1], &reversed_b);
        if (a == b) {
            if ((reversed_a ^ reversed_b) != differ) f->inconsistent[a] = 1;
            continue;
        }
        if (b < a) {
            int32_t swap = a;
            a = b, b = swap;
        }
        f->patch[b] = a;
        f->reversed_of[b] = reversed_a ^ reversed_b ^ differ;
        f->inconsistent[a] |= f->inconsistent[b];
    }
}

static void finder_free(finder *f)
{
    free(f->table);
    free(f->joined);
    free(f->patch);
    free(f->reversed_of);
    free(f->inconsistent);
}

static pal_err find_edges(finder *f)
{
    size_t n = (size_t)f->scan->n_tri, room = n ? n : 1, cap = 16;
    while (cap < 5 * n) cap *= 2;
    f->mask = cap - 1;
    f->table = calloc(cap, sizeof *f->table);
    f->joined = malloc(room * sizeof *f->joined);
    f->patch = malloc(room * sizeof *f->patch);
    f->reversed_of = calloc(room, 1);
    f->inconsistent = calloc(room, 1);
    if (!f->table || !f->joined || !f->patch || !f->reversed_of || !f->inconsistent) return PAL_ERR_MEMORY;
    for (int32_t t = 0; t < f->scan->n_tri; t++) f->joined[t] = f->patch[t] = t;
    for (int32_t t = 0; t < f->scan->n_tri; t++)
        for (int k = 0; k < 3; k++) {
            int sign;
            uint64_t key = pal_scan_edge(corner(f->scan, t, k), corner(f->scan, t, k + 1), &sign);
            if (key) add_edge(f, t, key, sign);
        }
    join_patches(f);
    return PAL_ERR_OK;
}

/* boundary of each part as sums of edge hashes, as given and as oriented by its patches */
typedef struct chain {
    uint64_t sum, repaired, odd;
    double centre[3], volume;
    bool inconsistent;
} chain;

static void add_edges(const pal_scan_surface *scan, int32_t tri, bool reversed_of, chain *c)
{
    for (int k = 0; k < 3; k++) {
        int sign;
        uint64_t h = pal_scan_edge(corner(scan, tri, k), corner(scan, tri, k + 1), &sign);
        c->sum += sign > 0 ? h : 0 - h;
        c->repaired += (sign > 0) != reversed_of ? h : 0 - h;
        c->odd ^= h;
    }
    for (int d = 0; d < 3; d++)
        for (int k = 0; k < 3; k++) c->centre[d] += corner(scan, tri, k)[d];
}

static void reverse_triangle(int32_t *tri)
{
    int32_t swap = tri[1];
    tri[1] = tri[2];
    tri[2] = swap;
}

/* a . (b x c) */
static double triple_product(const double a[3], const double b[3], const double c[3])
{
    double cross[3];
    pal_cross3(cross, b, c);
    return pal_dot3(a, cross);
}

/* six times the volume of the triangle and the part's centre */
static double fan_volume(const pal_scan_surface *scan, int32_t tri, const double o[3])
{
    double p[3][3];
    for (int k = 0; k < 3; k++)
        for (int d = 0; d < 3; d++) p[k][d] = corner(scan, tri, k)[d] - o[d];
    return triple_product(p[0], p[1], p[2]);
}

/* an open edge, from a to b in its triangle's sense */
typedef struct open_edge {
    int32_t tri, a, b; /* vertices by number: holes of unwelded triangles do not join, and stay open */
} open_edge;

/* corners that belong to the same hole: union-find, and the sum of its corners at the root */
typedef struct hole_corner {
    int32_t up, n;
    double sum[3];
} hole_corner;

static int32_t find_hole(hole_corner *corner_of, int32_t i)
{
    while (corner_of[i].up != i) i = corner_of[i].up = corner_of[corner_of[i].up].up;
    return i;
}

/* the open edge of a table entry in the current orientation of its triangle */
static open_edge open_edge_of(const pal_scan_surface *scan, const edge_entry *e)
{
    const int32_t *c = scan->tri + 3 * (size_t)e->tri[0];
    int k = 0, sign;
    while (k < 2 && pal_scan_edge(corner(scan, e->tri[0], k), corner(scan, e->tri[0], k + 1), &sign) != e->key) k++;
    return (open_edge){e->tri[0], c[k], c[(k + 1) % 3]};
}

/* adds the volumes between the fans that close the holes and the centre of each part to the volumes of the parts;
 * MEMORY */
static pal_err close_holes(const finder *f, chain *chains)
{
    const pal_scan_surface *scan = f->scan;
    size_t n_vertex = 0, n_open = 0;
    for (size_t i = 0; i < 3 * (size_t)scan->n_tri; i++)
        if ((size_t)scan->tri[i] >= n_vertex) n_vertex = (size_t)scan->tri[i] + 1;
    for (size_t i = 0; i <= f->mask; i++) n_open += f->table[i].n == 1;
    if (n_open == 0) return PAL_ERR_OK;
    hole_corner *hole = calloc(n_vertex, sizeof *hole);
    if (!hole) return PAL_ERR_MEMORY;
    for (size_t v = 0; v < n_vertex; v++) hole[v].up = (int32_t)v;
    for (size_t i = 0; i <= f->mask; i++) {
        if (f->table[i].n != 1) continue;
        open_edge e = open_edge_of(scan, &f->table[i]);
        hole[find_hole(hole, e.a)].up = find_hole(hole, e.b);
    }
    for (size_t i = 0; i <= f->mask; i++) {
        if (f->table[i].n != 1) continue;
        open_edge e = open_edge_of(scan, &f->table[i]);
        hole_corner *root = &hole[find_hole(hole, e.a)];
        root->n += 2;
        for (int d = 0; d < 3; d++)
            root->sum[d] += (double)scan->point[3 * (size_t)e.a + (size_t)d] + scan->point[3 * (size_t)e.b + (size_t)d];
    }
    for (size_t i = 0; i <= f->mask; i++) {
        if (f->table[i].n != 1) continue;
        open_edge e = open_edge_of(scan, &f->table[i]);
        const hole_corner *root = &hole[find_hole(hole, e.a)];
        chain *c = &chains[scan->part[e.tri]];
        double p[3][3];
        for (int d = 0; d < 3; d++) {
            p[0][d] = scan->point[3 * (size_t)e.b + (size_t)d] - c->centre[d];
            p[1][d] = scan->point[3 * (size_t)e.a + (size_t)d] - c->centre[d];
            p[2][d] = root->sum[d] / root->n - c->centre[d];
        }
        c->volume += triple_product(p[0], p[1], p[2]) / 6;
    }
    free(hole);
    return PAL_ERR_OK;
}

/* determines the kind of each part and orients its triangles consistently, then outward; MEMORY */
static pal_err orient(pal_scan_surface *scan, finder *f, pal_parts *parts, chain *chains)
{
    uint8_t reversed;
    for (int32_t t = 0; t < scan->n_tri; t++) {
        chain *c = &chains[scan->part[t]];
        c->inconsistent |= f->inconsistent[find_patch(f, t, &reversed)];
        add_edges(scan, t, reversed, c);
        parts->part[scan->part[t]].n_tri++;
    }
    for (int i = 0; i < parts->n; i++) {
        pal_part *p = &parts->part[i];
        bool closed = chains[i].sum == 0 || (chains[i].repaired == 0 && !chains[i].inconsistent);
        p->kind = closed ? PAL_PART_CLOSED : chains[i].odd == 0 ? PAL_PART_EVEN : PAL_PART_OPEN;
        p->coherent = !chains[i].inconsistent;
        for (int d = 0; d < 3; d++) chains[i].centre[d] /= 3.0 * p->n_tri;
    }
    for (int32_t t = 0; t < scan->n_tri; t++) {
        chain *c = &chains[scan->part[t]];
        find_patch(f, t, &reversed);
        if (reversed && c->sum != 0 && !c->inconsistent) reverse_triangle(scan->tri + 3 * (size_t)t);
        c->volume += fan_volume(scan, t, c->centre) / 6;
    }
    PAL_TRY(close_holes(f, chains));
    for (int32_t t = 0; t < scan->n_tri; t++)
        if (chains[scan->part[t]].volume < 0) reverse_triangle(scan->tri + 3 * (size_t)t);
    for (int i = 0; i < parts->n; i++) {
        parts->part[i].inward = chains[i].volume < 0;
        parts->part[i].volume = fabs(chains[i].volume);
    }
    return PAL_ERR_OK;
}

pal_err pal_parts_find(pal_scan_surface *scan, pal_parts *out)
{
    finder f = {.scan = scan};
    pal_parts parts = {0};
    chain *chains = NULL;
    pal_err err = find_edges(&f);
    if (!err) {
        parts.n = pal_union_find_label(f.joined, scan->n_tri);
        scan->part = f.joined, f.joined = NULL;
        size_t room = parts.n ? (size_t)parts.n : 1;
        parts.part = calloc(room, sizeof *parts.part);
        chains = calloc(room, sizeof *chains);
        err = parts.part && chains ? orient(scan, &f, &parts, chains) : PAL_ERR_MEMORY;
    }
    finder_free(&f);
    free(chains);
    if (err)
        pal_parts_free(&parts);
    else
        *out = parts;
    return err;
}

void pal_parts_free(pal_parts *parts)
{
    free(parts->part);
    memset(parts, 0, sizeof *parts);
}

/* state of each part along a row; only the parts that the row meets are changed, and left zero afterwards */
struct pal_parts_work {
    int32_t *winding, *count; /* so far along the row, first their totals [n] */
    int32_t *entered;         /* depth at which the row entered           [n] */
    int32_t *open;            /* parts the row is inside of now, a stack  [n] */
    int n_open;
};

pal_parts_work *pal_parts_work_create(const pal_parts *parts)
{
    size_t n = parts->n ? (size_t)parts->n : 1;
    pal_parts_work *w = calloc(1, sizeof *w);
    if (!w) return NULL;
    w->winding = calloc(n, sizeof *w->winding);
    w->count = calloc(n, sizeof *w->count);
    w->entered = calloc(n, sizeof *w->entered);
    w->open = calloc(n, sizeof *w->open);
    if (w->winding && w->count && w->entered && w->open) return w;
    pal_parts_work_destroy(w);
    return NULL;
}

void pal_parts_work_destroy(pal_parts_work *work)
{
    if (!work) return;
    free(work->winding);
    free(work->count);
    free(work->entered);
    free(work->open);
    free(work);
}

/* are the row's crossings with a part consistent? */
static bool is_consistent(const pal_part *part, int32_t winding, int32_t count)
{
    if (count & 1) return false;
    return winding == 0 || part->kind == PAL_PART_EVEN || (part->kind == PAL_PART_OPEN && !part->coherent);
}

static bool by_parity(const pal_part *part)
{
    return part->kind == PAL_PART_EVEN || (part->kind == PAL_PART_OPEN && !part->coherent);
}

enum { INCONSISTENT = INT32_MIN };

/* totals of every part in the row; inconsistent parts get INCONSISTENT as their count and are skipped */
static bool begin_row(const pal_parts *parts, pal_parts_work *w, const pal_crossing *item, int64_t n)
{
    bool clean = true;
    for (int64_t i = 0; i < n; i++) {
        w->winding[item[i].part] += item[i].sign;
        w->count[item[i].part]++;
    }
    for (int64_t i = 0; i < n; i++) {
        int32_t part = item[i].part;
        if (w->count[part] <= 0) continue;
        bool good = is_consistent(&parts->part[part], w->winding[part], w->count[part]);
        w->count[part] = good ? 0 : INCONSISTENT;
        w->winding[part] = 0;
        clean &= good;
    }
    w->n_open = 0;
    return clean;
}

static void end_row(pal_parts_work *w, const pal_crossing *item, int64_t n)
{
    for (int64_t i = 0; i < n; i++) w->winding[item[i].part] = w->count[item[i].part] = 0;
}

/* processes one crossing and updates the stack of parts that the row is inside of */
static void cross(const pal_parts *parts, pal_parts_work *w, const pal_crossing *c)
{
    int32_t part = c->part;
    if (w->count[part] == INCONSISTENT) return;
    bool parity = by_parity(&parts->part[part]);
    bool was = parity ? w->count[part] & 1 : w->winding[part] != 0;
    w->count[part]++;
    w->winding[part] += c->sign;
    bool is = parity ? w->count[part] & 1 : w->winding[part] != 0;
    if (is && !was) {
        w->entered[part] = c->depth;
        w->open[w->n_open++] = part;
    }
    if (was && !is) {
        int k = 0;
        while (w->open[k] != part) k++;
        memmove(w->open + k, w->open + k + 1, (size_t)(w->n_open - k - 1) * sizeof *w->open);
        w->n_open--;
    }
}

/* the smallest surrounding part decides */
static bool is_inside(const pal_parts *parts, const pal_parts_work *w)
{
    if (w->n_open == 0) return false;
    const pal_part *min = &parts->part[w->open[0]];
    for (int k = 1; k < w->n_open; k++)
        if (parts->part[w->open[k]].volume < min->volume) min = &parts->part[w->open[k]];
    return !min->cavity;
}

bool pal_parts_row(const pal_parts *parts, pal_parts_work *work, const pal_crossing *item, int64_t n,
                   void (*run)(void *self, int from, int to), void *self)
{
    bool clean = begin_row(parts, work, item, n);
    int from = -1;
    for (int64_t i = 0; i < n; i++) {
        cross(parts, work, &item[i]);
        if (i + 1 < n && item[i + 1].place == item[i].place) continue;
        bool inside = is_inside(parts, work);
        if (inside && from < 0) from = item[i].place;
        if (!inside && from >= 0) {
            run(self, from, item[i].place);
            from = -1;
        }
    }
    end_row(work, item, n);
    return clean;
}

enum { COINCIDENT = PAL_SCAN_ONE / 16 };

/* does the row cross the part once more within a sixteenth of a voxel? */
static bool crosses_again(const pal_crossing *c, const pal_crossing *end, int32_t part)
{
    for (const pal_crossing *k = c + 1; k < end && k->depth < c->depth + COINCIDENT; k++)
        if (k->part == part) return true;
    return false;
}

/* The largest part other than its own that surrounds a crossing by more than a sixteenth of a voxel along the row on
 * both sides; -1: none. end: of the row */
static int32_t outermost(const pal_parts *parts, const pal_parts_work *w, const pal_crossing *c,
                         const pal_crossing *end)
{
    int32_t best = -1;
    for (int k = 0; k < w->n_open; k++) {
        int32_t part = w->open[k];
        if (part == c->part || w->entered[part] > c->depth - COINCIDENT || crosses_again(c, end, part)) continue;
        if (best < 0 || parts->part[part].volume > parts->part[best].volume) best = part;
    }
    return best;
}

pal_err pal_parts_nest(pal_parts *parts, const pal_crossings *rows)
{
    pal_parts_work *w = pal_parts_work_create(parts);
    int64_t *votes = calloc(parts->n ? (size_t)parts->n : 1, sizeof *votes);
    if (w && votes)
        for (int row = 0; row < rows->n_row; row++) {
            const pal_crossing *item = rows->item + rows->start[row];
            int64_t n = rows->start[row + 1] - rows->start[row];
            begin_row(parts, w, item, n);
            for (int64_t i = 0; i < n; i++) {
                if (w->count[item[i].part] == INCONSISTENT) continue;
                int32_t around = outermost(parts, w, &item[i], item + n);
                bool opposed = around >= 0 && parts->part[around].inward != parts->part[item[i].part].inward;
                votes[item[i].part] += opposed ? 1 : -1;
                cross(parts, w, &item[i]);
            }
            end_row(w, item, n);
        }
    bool ok = w && votes;
    for (int i = 0; ok && i < parts->n; i++) parts->part[i].cavity = votes[i] > 0;
    pal_parts_work_destroy(w);
    free(votes);
    return ok ? PAL_ERR_OK : PAL_ERR_MEMORY;
}
