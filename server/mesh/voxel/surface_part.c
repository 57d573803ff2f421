/* Parts of a surface: components over edges that are matched by position, a common orientation, cavities.
 *
 * One hash table over edges joins triangles into parts (any shared edge) and into patches of one orientation (edges of
 * exactly two triangles, union-find with a parity bit). A part that is a closed chain keeps its orientation; others
 * take that of the patches. */
#include "server/mesh/voxel/surface_part.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/num/union_find.h"

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

static void add_edge(finder *f, int32_t tri, uint64_t key, int sign)
{
    size_t at = key & f->mask;
    while (f->table[at].key && f->table[at].key != key) at = (at + 1) & f->mask;
    edge_entry *e = &f->table[at];
    if (e->n < 2) e->key = key, e->tri[e->n] = tri, e->sign[e->n] = (int8_t)sign;
    if (e->n < 3) e->n++;
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
        int32_t low = a < b ? a : b, high = a < b ? b : a;
        f->patch[high] = low;
        f->reversed_of[high] = reversed_a ^ reversed_b ^ differ;
        f->inconsistent[low] |= f->inconsistent[high];
    }
}

static pal_err find_edges(finder *f)
{
    size_t n = (size_t)f->scan->n_tri, cap = 16;
    while (cap < 5 * n) cap *= 2;
    f->mask = cap - 1;
    pal_err err = PAL_ERR_OK;
    PAL_ZEROED(&err, f->table, cap);
    PAL_ARRAY(&err, f->joined, n);
    PAL_ARRAY(&err, f->patch, n);
    PAL_ZEROED(&err, f->reversed_of, n);
    PAL_ZEROED(&err, f->inconsistent, n);
    if (err) return err;
    pal_union_find_init(f->joined, f->scan->n_tri);
    pal_union_find_init(f->patch, f->scan->n_tri);
    for (int32_t t = 0; t < f->scan->n_tri; t++)
        for (int k = 0; k < 3; k++) {
            int sign;
            uint64_t key = pal_scan_edge(f->scan, t, k, &sign);
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
        uint64_t h = pal_scan_edge(scan, tri, k, &sign);
        c->sum += sign > 0 ? h : 0 - h;
        c->repaired += (sign > 0) != reversed_of ? h : 0 - h;
        c->odd ^= h;
    }
    for (int d = 0; d < 3; d++)
        for (int k = 0; k < 3; k++) c->centre[d] += pal_scan_corner(scan, (size_t)tri, k)[d];
}

static void reverse_triangle(int32_t *tri)
{
    int32_t swap = tri[1];
    tri[1] = tri[2];
    tri[2] = swap;
}

static double triple_product(const double a[3], const double b[3], const double c[3])
{
    double cross[3];
    pal_cross3(cross, b, c);
    return pal_dot3(a, cross);
}

/* an open edge, from a to b in its triangle's sense */
typedef struct open_edge {
    int32_t tri, a, b; /* vertices by number: holes of unwelded triangles do not join, and stay open */
} open_edge;

/* sum and number of the corners of a hole */
typedef struct hole {
    int32_t n;
    double sum[3];
} hole;

/* the open edges in the current orientation of their triangles */
static void list_open(const finder *f, open_edge *out)
{
    for (size_t i = 0; i <= f->mask; i++) {
        const edge_entry *e = &f->table[i];
        int32_t t = e->tri[0];
        const int32_t *c = f->scan->tri + 3 * (size_t)t;
        int k = 0, sign;
        if (e->n != 1) continue;
        while (k < 2 && pal_scan_edge(f->scan, t, k, &sign) != e->key) k++;
        *out++ = (open_edge){t, c[k], c[(k + 1) % 3]};
    }
}

/* adds the volumes between the fans that close the holes and the centre of each part to the volumes of the parts;
 * MEMORY */
static pal_err close_holes(const finder *f, chain *chains)
{
    const pal_scan_surface *scan = f->scan;
    size_t n_open = 0;
    pal_err err = PAL_ERR_OK;
    for (size_t i = 0; i <= f->mask; i++) n_open += f->table[i].n == 1;
    if (n_open == 0) return PAL_ERR_OK;
    open_edge *open;
    int32_t *root;
    hole *holes; /* at their roots */
    PAL_ARRAY(&err, open, n_open);
    PAL_ARRAY(&err, root, scan->n_vertex);
    PAL_ZEROED(&err, holes, scan->n_vertex);
    if (!err) {
        list_open(f, open);
        pal_union_find_init(root, scan->n_vertex);
    }
    for (size_t i = 0; i < n_open && !err; i++) pal_union_find_join(root, open[i].a, open[i].b);
    for (size_t i = 0; i < n_open && !err; i++) {
        hole *h = &holes[pal_union_find_root(root, open[i].a)];
        const int32_t *a = scan->point + 3 * (size_t)open[i].a, *b = scan->point + 3 * (size_t)open[i].b;
        h->n += 2;
        for (int d = 0; d < 3; d++) h->sum[d] += (double)a[d] + b[d];
    }
    for (size_t i = 0; i < n_open && !err; i++) {
        const hole *h = &holes[pal_union_find_root(root, open[i].a)];
        const int32_t *a = scan->point + 3 * (size_t)open[i].a, *b = scan->point + 3 * (size_t)open[i].b;
        chain *c = &chains[scan->part[open[i].tri]];
        double p[3][3];
        for (int d = 0; d < 3; d++) {
            p[0][d] = b[d] - c->centre[d];
            p[1][d] = a[d] - c->centre[d];
            p[2][d] = h->sum[d] / h->n - c->centre[d];
        }
        c->volume += triple_product(p[0], p[1], p[2]) / 6;
    }
    return PAL_FREED(err, open, root, holes);
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
        double p[3][3];
        for (int k = 0; k < 3; k++)
            for (int d = 0; d < 3; d++) p[k][d] = pal_scan_corner(scan, (size_t)t, k)[d] - c->centre[d];
        c->volume += triple_product(p[0], p[1], p[2]) / 6;
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
        PAL_ZEROED(&err, parts.part, parts.n);
        PAL_ZEROED(&err, chains, parts.n);
        if (!err) err = orient(scan, &f, &parts, chains);
    }
    PAL_FREE(f.table, f.joined, f.patch, f.reversed_of, f.inconsistent, chains);
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
    pal_err err = PAL_ERR_OK;
    pal_parts_work *w = calloc(1, sizeof *w);
    if (!w) return NULL;
    PAL_ZEROED(&err, w->winding, parts->n);
    PAL_ZEROED(&err, w->count, parts->n);
    PAL_ZEROED(&err, w->entered, parts->n);
    PAL_ZEROED(&err, w->open, parts->n);
    if (!err) return w;
    pal_parts_work_destroy(w);
    return NULL;
}

void pal_parts_work_destroy(pal_parts_work *work)
{
    if (!work) return;
    PAL_FREE(work->winding, work->count, work->entered, work->open, work);
}

/* is a voxel inside the part where a row has crossed it an odd number of times? */
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
        bool good = w->count[part] % 2 == 0 && (w->winding[part] == 0 || by_parity(&parts->part[part]));
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
    pal_err err = w ? PAL_ERR_OK : PAL_ERR_MEMORY;
    int64_t *votes;
    PAL_ZEROED(&err, votes, parts->n);
    for (int row = 0; row < rows->n_row && !err; row++) {
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
    for (int i = 0; !err && i < parts->n; i++) parts->part[i].cavity = votes[i] > 0;
    pal_parts_work_destroy(w);
    return PAL_FREED(err, votes);
}
