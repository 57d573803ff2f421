/* Parts of a surface: components over edges that are matched by position, a common orientation, cavities.
 *
 * The sides of triangles, sorted by the positions of their ends, join them into patches of one orientation (edges of
 * exactly two triangles, union-find with a parity bit) and these into parts (any shared edge). A part that is a closed
 * chain keeps its orientation; others take that of the patches. All but the edges of two opposite sides are listed, and
 * what follows looks at the list alone. Copies of a triangle share its edges, so the walk over these finds whether
 * there can be any before they are looked for. */
#include "server/mesh/voxel/surface_part.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/num/union_find.h"

/* sides of an edge that are not two opposite ones */
typedef struct odd_edge {
    int32_t first, n;
} odd_edge;

typedef struct finder {
    const pal_scan_surface *scan;
    int32_t *place; /* of each vertex: the first vertex at its position [n_vertex] */
    int32_t *tri;   /* places of the corners, oriented as in the file   [n_tri][3] */
    int32_t *row;   /* sides by the smaller of their places (pal_surface_sides)    */
    pal_surface_side *side;
    odd_edge *odd; /* ascending             [n_odd]                                    */
    int64_t n_odd;
    size_t n_open;         /* edges of one triangle                                             */
    bool may_have_copies;  /* two triangles may have the same corners                           */
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

/* +1 or -1: the side runs from its smaller place to the larger or back */
static int side_sign(const finder *f, const pal_surface_side *side)
{
    return side->high == f->tri[side->corner] ? -1 : 1;
}

/* place of the corner that a side does not have */
static int32_t opposite_place(const finder *f, const pal_surface_side *side)
{
    const int32_t first = side->corner / 3 * 3, k = side->corner - first;
    return f->tri[first + (k == 0 ? 2 : k - 1)];
}

/* more sides of an edge than these are not compared */
enum { COMPARED = 8 };

static bool has_copies(const finder *f, const pal_surface_side *side, int n)
{
    bool any = n > COMPARED;
    for (int k = 1; k < n && !any; k++)
        for (int i = 0; i < k; i++) any |= opposite_place(f, &side[i]) == opposite_place(f, &side[k]);
    return any;
}

/* an edge of exactly two triangles relates their orientations */
static void join_patches(finder *f, const pal_surface_side *side, uint8_t differ)
{
    uint8_t reversed_a, reversed_b;
    int32_t a = find_patch(f, side[0].corner / 3, &reversed_a), b = find_patch(f, side[1].corner / 3, &reversed_b);
    if (a == b) {
        if ((reversed_a ^ reversed_b) != differ) f->inconsistent[a] = 1;
        return;
    }
    int32_t low = a < b ? a : b, high = a < b ? b : a;
    f->patch[high] = low;
    f->reversed_of[high] = reversed_a ^ reversed_b ^ differ;
    f->inconsistent[low] |= f->inconsistent[high];
}

/* joins patches and lists odd edges; a side between equal places is none; MEMORY */
static pal_err walk_edges(finder *f)
{
    for (int32_t low = 0; low < f->scan->n_vertex; low++)
        for (int32_t k = f->row[low], end = k; k < f->row[low + 1]; k = end) {
            const pal_surface_side *side = f->side + k;
            while (end < f->row[low + 1] && f->side[end].high == side->high) end++;
            const int n = end - k;
            const bool opposed = n == 2 && side_sign(f, &side[0]) != side_sign(f, &side[1]);
            if (side->high == low) continue;
            f->may_have_copies |= has_copies(f, side, n);
            if (n == 2) join_patches(f, side, !opposed);
            if (opposed) continue;
            if (!PAL_GROW(f->odd, f->n_odd)) return PAL_ERR_MEMORY;
            f->odd[f->n_odd++] = (odd_edge){k, n};
            f->n_open += n == 1;
        }
    return PAL_ERR_OK;
}

/* parts: patches, and what meets at edges of more than two triangles */
static void join_parts(finder *f)
{
    uint8_t reversed;
    for (int32_t t = 0; t < f->scan->n_tri; t++) f->joined[t] = find_patch(f, t, &reversed);
    for (int64_t i = 0; i < f->n_odd; i++) {
        const pal_surface_side *side = f->side + f->odd[i].first;
        for (int k = 1; k < f->odd[i].n; k++) pal_union_find_join(f->joined, side[k].corner / 3, side[0].corner / 3);
    }
}

/* the first vertex at the position of each; MEMORY */
static pal_err find_places(finder *f)
{
    const pal_scan_surface *scan = f->scan;
    size_t cap = 16;
    while (cap < 2 * (size_t)scan->n_vertex) cap *= 2;
    pal_err err = PAL_ERR_OK;
    int32_t *seen; /* vertex + 1, 0: free */
    PAL_ZEROED(&err, seen, cap);
    PAL_ARRAY(&err, f->place, scan->n_vertex);
    for (int32_t v = 0; v < scan->n_vertex && !err; v++) {
        size_t at = scan->hash[v] & (cap - 1);
        while (seen[at] && scan->hash[seen[at] - 1] != scan->hash[v]) at = (at + 1) & (cap - 1);
        if (!seen[at]) seen[at] = v + 1;
        f->place[v] = seen[at] - 1;
    }
    return PAL_FREED(err, seen);
}

static pal_err find_edges(finder *f)
{
    const size_t n = (size_t)f->scan->n_tri;
    pal_err err = find_places(f);
    PAL_ARRAY(&err, f->tri, 3 * n);
    PAL_ARRAY(&err, f->joined, n);
    PAL_ARRAY(&err, f->patch, n);
    PAL_ZEROED(&err, f->reversed_of, n);
    PAL_ZEROED(&err, f->inconsistent, n);
    if (err) return err;
    for (size_t c = 0; c < 3 * n; c++) f->tri[c] = f->place[f->scan->tri[c]];
    for (const int32_t *c = f->tri; c < f->tri + 3 * n; c += 3)
        f->may_have_copies |= c[0] == c[1] || c[1] == c[2] || c[2] == c[0];
    const pal_surface placed = {.n_vertex = f->scan->n_vertex, .n_tri = f->scan->n_tri, .tri = f->tri};
    err = pal_surface_sides(&placed, &f->row, &f->side);
    if (err) f->row = NULL, f->side = NULL;
    if (err) return err;
    pal_union_find_init(f->patch, f->scan->n_tri);
    PAL_TRY(walk_edges(f));
    join_parts(f);
    return PAL_ERR_OK;
}

/* what decides a part's kind and orientation. Its boundary is counted as given and as oriented by its patches */
typedef struct chain {
    bool bounded, bounded_repaired, odd, inconsistent;
    double centre[3], volume;
} chain;

static void count_edge(finder *f, chain *chains, const pal_surface_side *side, int n)
{
    chain *c = chains + f->scan->part[side->corner / 3];
    int given = 0, repaired = 0;
    for (int k = 0; k < n; k++) {
        uint8_t reversed = 0;
        const int sign = side_sign(f, &side[k]);
        if (n != 2) find_patch(f, side[k].corner / 3, &reversed);
        given += sign, repaired += reversed ? -sign : sign;
    }
    c->bounded |= given != 0;
    /* a patch that has a common orientation agrees with it at its edges of two */
    c->bounded_repaired |= repaired != 0 && n != 2;
    c->odd |= n & 1;
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

/* an open edge in the current orientation of its triangle */
static open_edge open_edge_of(const finder *f, const pal_surface_side *side)
{
    const int32_t t = side->corner / 3, *c = f->scan->tri + 3 * (size_t)t, opposite = opposite_place(f, side);
    int k = 0;
    while (f->place[c[k]] != opposite) k++;
    return (open_edge){t, c[(k + 1) % 3], c[(k + 2) % 3]};
}

/* adds the volumes between the fans that close the holes and the centre of each part to the volumes of the parts;
 * MEMORY */
static pal_err close_holes(finder *f, chain *chains)
{
    const pal_scan_surface *scan = f->scan;
    const size_t n_open = f->n_open;
    pal_err err = PAL_ERR_OK;
    if (n_open == 0) return PAL_ERR_OK;
    open_edge *open;
    int32_t *root;
    hole *holes; /* at their roots */
    PAL_ARRAY(&err, open, n_open);
    PAL_ARRAY(&err, root, scan->n_vertex);
    PAL_ZEROED(&err, holes, scan->n_vertex);
    if (!err) {
        open_edge *to = open;
        for (int64_t i = 0; i < f->n_odd; i++)
            if (f->odd[i].n == 1) *to++ = open_edge_of(f, f->side + f->odd[i].first);
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
    for (int64_t i = 0; i < f->n_odd; i++) count_edge(f, chains, f->side + f->odd[i].first, f->odd[i].n);
    for (int32_t t = 0; t < scan->n_tri; t++) {
        chain *c = &chains[scan->part[t]];
        c->inconsistent |= f->inconsistent[find_patch(f, t, &reversed)];
        const int32_t *a = pal_scan_corner(scan, (size_t)t, 0), *b = pal_scan_corner(scan, (size_t)t, 1),
                      *e = pal_scan_corner(scan, (size_t)t, 2);
        for (int d = 0; d < 3; d++) c->centre[d] += (double)a[d] + b[d] + e[d];
        parts->part[scan->part[t]].n_tri++;
    }
    for (int i = 0; i < parts->n; i++) {
        pal_part *p = &parts->part[i];
        chain *c = &chains[i];
        bool closed = !c->bounded || (!c->bounded_repaired && !c->inconsistent);
        p->kind = closed ? PAL_PART_CLOSED : c->odd ? PAL_PART_OPEN : PAL_PART_EVEN;
        p->coherent = !c->inconsistent;
        for (int d = 0; d < 3; d++) c->centre[d] /= 3.0 * p->n_tri;
    }
    for (int32_t t = 0; t < scan->n_tri; t++) {
        chain *c = &chains[scan->part[t]];
        find_patch(f, t, &reversed);
        if (reversed && c->bounded && !c->inconsistent) reverse_triangle(scan->tri + 3 * (size_t)t);
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

static void free_finder(finder *f)
{
    PAL_FREE(f->place, f->tri, f->row, f->side, f->odd, f->joined, f->patch, f->reversed_of, f->inconsistent);
    *f = (finder){.scan = f->scan};
}

pal_err pal_parts_find(pal_scan_surface *scan, pal_parts *out)
{
    finder f = {.scan = scan};
    pal_parts parts = {0};
    chain *chains = NULL;
    pal_err err = find_edges(&f);
    const int n_tri = scan->n_tri;
    if (!err && f.may_have_copies) err = pal_scan_drop_copies(scan);
    if (!err && scan->n_tri < n_tri) {
        free_finder(&f);
        err = find_edges(&f);
    }
    if (!err) {
        parts.n = pal_union_find_label(f.joined, scan->n_tri);
        scan->part = f.joined, f.joined = NULL;
        PAL_ZEROED(&err, parts.part, parts.n);
        PAL_ZEROED(&err, chains, parts.n);
        if (!err) err = orient(scan, &f, &parts, chains);
    }
    free_finder(&f);
    PAL_FREE(chains);
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
