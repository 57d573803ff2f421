/* Builds the radial-edge complex from loops (paper A section 3.4.4; Weiler 1988): faces and edges are found by hashing,
 * each in the order of its first use; then mates, radials, incidence lists, boundary. Linear time.
 *
 * A cell is a ball when its surface is connected, closed, oriented and V - E + F = 2. Cells fill the neighbourhood of a
 * vertex when its edges, faces and cells satisfy V - E + F = 2 (inside) or 1 (boundary) as points, arcs and patches of
 * a small sphere about it; vertices where sheets of the boundary touch are only marked. */
#include "server/base/heap.h"
#include "server/mesh/cells/cells.h"

#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"
#include "server/num/random.h"

#include <stdarg.h>
#include <stdio.h>

typedef struct builder {
    const pal_cell_loops *in;
    pal_cells *c;
    int32_t *table; /* hash table of faces, then of edges: index + 1, 0 free [mask + 1] */
    int32_t *stamp; /* per vertex: scratch                                             */
    int32_t *last;  /* per edge, per edge use and per loop: scratch                    */
    size_t mask;
    pal_diagnostic *diag;
} builder;

/* number n as messages show it */
static int file_number(const builder *b, int32_t n)
{
    return n + b->in->count_from;
}

/* "line N", or "cells" when there are no lines */
typedef struct where {
    char text[32];
} where;

static where line_of(const int64_t *line, int32_t i)
{
    where at = {"cells"};
    if (line) snprintf(at.text, sizeof at.text, "line %lld", (long long)line[i]);
    return at;
}

/* about a loop (cell -1), or a whole cell (loop -1) */
static pal_err __attribute__((format(printf, 4, 5)))
refuse(const builder *b, int32_t cell, int32_t loop, const char *format, ...)
{
    char sentence[320], face[32] = "";
    const pal_cell_loops *in = b->in;
    va_list list;
    va_start(list, format);
    vsnprintf(sentence, sizeof sentence, format, list);
    va_end(list);
    if (cell < 0) cell = 0;
    while (loop >= in->cell[cell + 1]) cell++;
    if (loop >= 0) snprintf(face, sizeof face, ", face %d:", file_number(b, loop - in->cell[cell]));
    return PAL_REFUSE(b->diag, "%s: cell %d%s %s", line_of(in->line, loop >= 0 ? loop : in->cell[cell]).text,
                      file_number(b, cell), face, sentence);
}

static pal_err check_counts(const builder *b)
{
    const pal_cell_loops *in = b->in;
    pal_diagnostic *diag = b->diag;
    if (in->n_vertex < 1 || in->n_cell < 1 || in->n_vertex > CELL_MAX_ITEM || in->n_cell > CELL_MAX_ITEM)
        return PAL_REFUSE(diag, "cells: %d vertices and %d cells, each must be 1 to %d", in->n_vertex, in->n_cell,
                          CELL_MAX_ITEM);
    for (int32_t c = 0; c < in->n_cell; c++)
        if (in->cell[0] != 0 || in->cell[c + 1] <= in->cell[c] || in->cell[c + 1] > CELL_MAX_ITEM)
            return PAL_REFUSE(diag, "cells: cell %d has no faces", file_number(b, c));
    for (int32_t l = 0; l < in->cell[in->n_cell]; l++) {
        int64_t n = (int64_t)in->loop[l + 1] - in->loop[l];
        if (in->loop[0] != 0 || n < 3 || n > PAL_CELL_LOOP_MAX || in->loop[l + 1] > CELL_MAX_ITEM)
            return refuse(b, -1, l, "%lld corners, must be 3 to %d", (long long)n, PAL_CELL_LOOP_MAX);
    }
    return PAL_ERR_OK;
}

/* corners in range and once in a loop, every vertex used, positions finite */
static pal_err check_corners(const builder *b)
{
    const pal_cell_loops *in = b->in;
    for (int32_t v = 0; v < in->n_vertex; v++) {
        const double *x = in->x + 3 * (size_t)v;
        if (!(fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2]))) <= MAX_COORDINATE_M && pal_finite3(x)))
            return PAL_REFUSE(b->diag, "%s: vertex %d is at %g %g %g m, must be within %g m of the origin",
                              line_of(in->vertex_line, v).text, file_number(b, v), x[0], x[1], x[2], MAX_COORDINATE_M);
        b->stamp[v] = -1;
    }
    for (int32_t l = 0; l < in->cell[in->n_cell]; l++)
        for (int32_t k = in->loop[l]; k < in->loop[l + 1]; k++) {
            int32_t v = in->corner[k];
            if (v < 0 || v >= in->n_vertex)
                return refuse(b, -1, l, "vertex %lld, there are %d", (long long)v + in->count_from, in->n_vertex);
            if (b->stamp[v] == l) return refuse(b, -1, l, "has vertex %d twice", file_number(b, v));
            b->stamp[v] = l;
        }
    for (int32_t v = 0; v < in->n_vertex; v++)
        if (b->stamp[v] < 0)
            return PAL_REFUSE(b->diag, "%s: vertex %d belongs to no cell", line_of(in->vertex_line, v).text,
                              file_number(b, v));
    return PAL_ERR_OK;
}

static bool sharpness_valid(float s)
{
    return s >= 0 && s <= PAL_SHARPNESS_MAX;
}

static pal_err get_memory(builder *b)
{
    pal_cells *c = b->c;
    pal_err err = PAL_ERR_OK;
    for (b->mask = 16; b->mask < 2 * (size_t)c->n_edge_use; b->mask *= 2) {
    }
    PAL_ARRAY(&err, b->table, b->mask);
    b->mask--;
    PAL_ARRAY(&err, b->last, c->n_edge_use);
    PAL_ARRAY(&err, c->x, 3 * (size_t)c->n_vertex);
    PAL_ZEROED(&err, c->vertex_sharpness, c->n_vertex);
    PAL_ZEROED(&err, c->vertex_boundary, c->n_vertex);
    PAL_ZEROED(&err, c->vertex_pinched, c->n_vertex);
    PAL_ARRAY(&err, c->edge, c->n_edge_use);
    PAL_ARRAY(&err, c->face, c->n_face_use);
    PAL_ARRAY(&err, c->cell_use, c->n_cell + 1);
    PAL_ARRAY(&err, c->face_use, c->n_face_use + 1);
    PAL_ARRAY(&err, c->edge_use, c->n_edge_use);
    return err;
}

static void copy_loops(builder *b)
{
    const pal_cell_loops *in = b->in;
    pal_cells *c = b->c;
    memcpy(c->x, in->x, (size_t)c->n_vertex * 3 * sizeof *c->x);
    memcpy(c->cell_use, in->cell, ((size_t)c->n_cell + 1) * sizeof *c->cell_use);
    for (int32_t i = 0; i < c->n_cell; i++)
        for (int32_t l = in->cell[i]; l < in->cell[i + 1]; l++) {
            c->face_use[l] = (pal_face_use){.cell = i, .face = -1, .first_use = in->loop[l], .mate = -1};
            for (int32_t k = in->loop[l]; k < in->loop[l + 1]; k++)
                c->edge_use[k] =
                    (pal_edge_use){.edge = -1, .vertex = in->corner[k], .face_use = l, .mate = -1, .radial = -1};
        }
    c->face_use[c->n_face_use] = (pal_face_use){.cell = -1, .face = -1, .first_use = c->n_edge_use, .mate = -1};
}

typedef enum loop_relation { OTHER, OPPOSITE, EQUAL, SHUFFLED } loop_relation;

/* relation of two loops of the same complex */
static loop_relation compare_loops(const pal_cell_loops *in, int32_t a, int32_t b)
{
    const int32_t *p = in->corner + in->loop[a], *q = in->corner + in->loop[b];
    int n = in->loop[a + 1] - in->loop[a], at = 0;
    if (n != in->loop[b + 1] - in->loop[b]) return OTHER;
    while (at < n && p[at] != q[0]) at++;
    if (at == n) return OTHER;
    bool equal = true, opposite = true;
    for (int k = 0; k < n; k++) {
        equal &= p[(at + k) % n] == q[k];
        opposite &= p[(at + n - k) % n] == q[k];
    }
    if (opposite || equal) return opposite ? OPPOSITE : EQUAL;
    for (int k = 0; k < n; k++) {
        int j = 0;
        while (j < n && p[j] != q[k]) j++;
        if (j == n) return OTHER;
    }
    return SHUFFLED;
}

/* loop l has the corners of face f */
static pal_err join_face(builder *b, int32_t l, int32_t f, loop_relation like)
{
    pal_cell_face *face = &b->c->face[f];
    pal_face_use *use = b->c->face_use;
    int32_t cell = use[face->use[0]].cell, vertex = b->in->corner[b->in->loop[l]];
    if (like == SHUFFLED)
        return refuse(b, -1, l, "has the corners of a face of cell %d in another order", file_number(b, cell));
    if (cell == use[l].cell || (face->use[1] >= 0 && use[face->use[1]].cell == use[l].cell))
        return refuse(b, -1, l, "is a face of the same cell already, from vertex %d on", file_number(b, vertex));
    if (face->use[1] >= 0)
        return refuse(b, -1, l, "is a face of cells %d and %d already, a face has two cells at most",
                      file_number(b, cell), file_number(b, use[face->use[1]].cell));
    if (like == EQUAL)
        return refuse(b, -1, l, "runs the same way round in cell %d: one of the two is inside out",
                      file_number(b, cell));
    face->use[1] = l;
    use[l].face = f, use[l].sign = -1, use[l].mate = face->use[0];
    use[face->use[0]].mate = l;
    return PAL_ERR_OK;
}

static pal_err find_faces(builder *b)
{
    pal_cells *c = b->c;
    const pal_cell_loops *in = b->in;
    memset(b->table, 0, (b->mask + 1) * sizeof *b->table);
    for (int32_t l = 0; l < c->n_face_use; l++) {
        uint64_t key = 0;
        for (int32_t k = in->loop[l]; k < in->loop[l + 1]; k++) key += pal_random_bits(0, (uint64_t)in->corner[k]);
        size_t at = pal_random_bits(key, 0) & b->mask;
        loop_relation like = OTHER;
        for (; b->table[at]; at = (at + 1) & b->mask) {
            like = compare_loops(in, c->face[b->table[at] - 1].use[0], l);
            if (like != OTHER) break;
        }
        if (like != OTHER) {
            PAL_TRY(join_face(b, l, b->table[at] - 1, like));
            continue;
        }
        c->face[c->n_face] = (pal_cell_face){.use = {l, -1}};
        c->face_use[l].face = c->n_face, c->face_use[l].sign = 1;
        b->table[at] = ++c->n_face;
    }
    return PAL_ERR_OK;
}

/* table slot of the edge between two vertices: taken by it, or free */
static size_t edge_place(const builder *b, int32_t v, int32_t w)
{
    const pal_cell_edge *edge = b->c->edge;
    uint32_t low = (uint32_t)(v < w ? v : w), high = (uint32_t)(v < w ? w : v);
    size_t at = pal_random_bits(0, (uint64_t)high << 32 | low) & b->mask;
    for (; b->table[at]; at = (at + 1) & b->mask) {
        const pal_cell_edge *e = &edge[b->table[at] - 1];
        if ((e->vertex[0] == v && e->vertex[1] == w) || (e->vertex[0] == w && e->vertex[1] == v)) break;
    }
    return at;
}

static void find_edges(builder *b)
{
    pal_cells *c = b->c;
    memset(b->table, 0, (b->mask + 1) * sizeof *b->table);
    for (int32_t u = 0; u < c->n_edge_use; u++) {
        int32_t v = c->edge_use[u].vertex, w = c->edge_use[pal_cells_next(c, u)].vertex;
        size_t at = edge_place(b, v, w);
        if (!b->table[at]) {
            c->edge[c->n_edge] = (pal_cell_edge){.vertex = {v, w}};
            b->table[at] = ++c->n_edge;
        }
        c->edge_use[u].edge = b->table[at] - 1;
    }
}

/* the other side of each face runs backwards */
static void join_mates(pal_cells *c)
{
    for (int32_t f = 0; f < c->n_face; f++) {
        if (c->face[f].use[1] < 0) continue;
        int32_t a, n = pal_cells_face_loop(c, f, &a), z = c->face_use[c->face[f].use[1]].first_use, at = 0;
        int32_t far = c->edge_use[a + 1].vertex;
        while (c->edge_use[z + at].vertex != far) at++;
        for (int32_t k = 0; k < n; k++) {
            int32_t other = z + (at + n - k) % n;
            c->edge_use[a + k].mate = other, c->edge_use[other].mate = a + k;
        }
    }
}

/* the two uses of every edge in a cell */
static pal_err join_radials(builder *b, int32_t cell)
{
    pal_cells *c = b->c;
    int32_t first = c->face_use[c->cell_use[cell]].first_use, end = c->face_use[c->cell_use[cell + 1]].first_use;
    for (int32_t u = first; u < end; u++) {
        pal_edge_use *use = &c->edge_use[u];
        int32_t other = b->last[use->edge];
        if (other < first) { /* the first in this cell */
            b->last[use->edge] = u;
            continue;
        }
        pal_edge_use *o = &c->edge_use[other];
        int32_t v = file_number(b, use->vertex), w = file_number(b, pal_cells_end_vertex(c, u));
        if (o->radial >= 0)
            return refuse(b, -1, use->face_use, "the cell's third face at the edge of vertices %d and %d", v, w);
        if (o->vertex == use->vertex)
            return refuse(b, -1, use->face_use,
                          "runs from vertex %d to %d as face %d of the cell does: one of the two is inside out", v, w,
                          file_number(b, o->face_use - c->cell_use[cell]));
        o->radial = u, use->radial = other;
    }
    for (int32_t u = first; u < end; u++)
        if (c->edge_use[u].radial < 0)
            return refuse(b, -1, c->edge_use[u].face_use,
                          "no other face of the cell at the edge of vertices %d and %d: it is not closed",
                          file_number(b, c->edge_use[u].vertex), file_number(b, pal_cells_end_vertex(c, u)));
    return PAL_ERR_OK;
}

/* number of faces reached from the first face of a cell over its edges */
static int32_t count_reached(const builder *b, int32_t cell)
{
    const pal_cells *c = b->c;
    int32_t *stack = b->last, n_stack = 0, first = c->cell_use[cell], n_reached = 0;
    int32_t *seen = b->table;
    memset(seen, 0, (size_t)(c->cell_use[cell + 1] - first) * sizeof *seen);
    stack[n_stack++] = first, seen[0] = 1;
    while (n_stack > 0) {
        int32_t f = stack[--n_stack];
        n_reached++;
        for (int32_t u = c->face_use[f].first_use; u < c->face_use[f + 1].first_use; u++) {
            int32_t g = c->edge_use[c->edge_use[u].radial].face_use;
            if (seen[g - first]) continue;
            seen[g - first] = 1, stack[n_stack++] = g;
        }
    }
    return n_reached;
}

/* corners of all cells: counts them, or lists them when there is room */
static int32_t list_corners(builder *b)
{
    pal_cells *c = b->c;
    int32_t n = 0;
    memset(b->stamp, -1, (size_t)c->n_vertex * sizeof *b->stamp);
    for (int32_t i = 0; i < c->n_cell; i++) {
        if (c->cell_vertex.start) c->cell_vertex.start[i] = n;
        int32_t end;
        for (int32_t u = pal_cells_cell_loops(c, i, &end); u < end; u++) {
            int32_t v = c->edge_use[u].vertex;
            if (b->stamp[v] == i) continue;
            b->stamp[v] = i;
            if (c->cell_vertex.start) c->cell_vertex.item[n] = v, c->corner_use[n] = u;
            n++;
        }
    }
    if (c->cell_vertex.start) c->cell_vertex.start[c->n_cell] = n;
    return n;
}

static pal_err find_corners(builder *b)
{
    pal_cells *c = b->c;
    pal_err err = PAL_ERR_OK;
    int32_t n = list_corners(b);
    PAL_ARRAY(&err, c->cell_vertex.start, c->n_cell + 1);
    PAL_ARRAY(&err, c->cell_vertex.item, n);
    PAL_ARRAY(&err, c->corner_use, n);
    if (!err) list_corners(b);
    return err;
}

static pal_err find_cells(builder *b)
{
    pal_cells *c = b->c;
    memset(b->last, -1, (size_t)c->n_edge_use * sizeof *b->last);
    for (int32_t i = 0; i < c->n_cell; i++) PAL_TRY(join_radials(b, i));
    PAL_TRY(find_corners(b));
    for (int32_t i = 0; i < c->n_cell; i++) {
        int32_t n_face = c->cell_use[i + 1] - c->cell_use[i];
        int32_t n_edge = (c->face_use[c->cell_use[i + 1]].first_use - c->face_use[c->cell_use[i]].first_use) / 2;
        int32_t n_vertex = c->cell_vertex.start[i + 1] - c->cell_vertex.start[i];
        if (count_reached(b, i) != n_face) return refuse(b, i, -1, "is in pieces: its faces do not hang together");
        if (n_vertex - n_edge + n_face != 2)
            return refuse(b, i, -1, "is no ball: %d vertices - %d edges + %d faces make %d, not 2", n_vertex, n_edge,
                          n_face, n_vertex - n_edge + n_face);
    }
    return PAL_ERR_OK;
}

/* lists in row r the items of the pairs with row[k] = r, in their order */
static pal_err make_rows(int32_t n_row, int32_t n, const int32_t *row, const int32_t *item, pal_cell_rows *to)
{
    pal_err err = PAL_ERR_OK;
    PAL_ZEROED(&err, to->start, n_row + 2);
    PAL_ARRAY(&err, to->item, n);
    if (err) return err;
    for (int32_t k = 0; k < n; k++) to->start[row[k] + 2]++;
    for (int32_t i = 1; i <= n_row; i++) to->start[i + 1] += to->start[i];
    for (int32_t k = 0; k < n; k++) to->item[to->start[row[k] + 1]++] = item[k];
    return PAL_ERR_OK;
}

/* from pairs: vertices of edges, vertices and edges of faces, edges and vertices of cells; an edge has two uses or
 * more, so row and item [n_edge_use] hold the pairs of each */
static pal_err fill_incidence(pal_cells *c, int32_t *row, int32_t *item)
{
    for (int32_t k = 0; k < 2 * c->n_edge; k++) row[k] = c->edge[k / 2].vertex[k % 2], item[k] = k / 2;
    PAL_TRY(make_rows(c->n_vertex, 2 * c->n_edge, row, item, &c->vertex_edge));
    for (int edges = 0; edges < 2; edges++) {
        int32_t n = 0;
        for (int32_t f = 0; f < c->n_face; f++) {
            int32_t first, m = pal_cells_face_loop(c, f, &first);
            for (int32_t u = first; u < first + m; u++)
                row[n] = edges ? c->edge_use[u].edge : c->edge_use[u].vertex, item[n++] = f;
        }
        PAL_TRY(make_rows(edges ? c->n_edge : c->n_vertex, n, row, item, edges ? &c->edge_face : &c->vertex_face));
    }
    int32_t n = 0;
    for (int32_t u = 0; u < c->n_edge_use; u++)
        if (u < c->edge_use[u].radial)
            row[n] = c->edge_use[u].edge, item[n++] = c->face_use[c->edge_use[u].face_use].cell;
    PAL_TRY(make_rows(c->n_edge, n, row, item, &c->edge_cell));
    for (int32_t i = 0, k = 0; i < c->n_cell; i++)
        for (; k < c->cell_vertex.start[i + 1]; k++) item[k] = i;
    return make_rows(c->n_vertex, c->cell_vertex.start[c->n_cell], c->cell_vertex.item, item, &c->vertex_cell);
}

static pal_err find_incidence(pal_cells *c)
{
    pal_err err = PAL_ERR_OK;
    int32_t *row, *item;
    PAL_ARRAY(&err, row, c->n_edge_use);
    PAL_ARRAY(&err, item, c->n_edge_use);
    if (!err) err = fill_incidence(c, row, item);
    return PAL_FREED(err, row, item);
}

static void find_boundary(pal_cells *c)
{
    for (int32_t f = 0; f < c->n_face; f++) {
        if (!pal_cells_face_boundary(c, f)) continue;
        int32_t first, n = pal_cells_face_loop(c, f, &first);
        c->n_boundary_face++;
        for (int32_t u = first; u < first + n; u++) {
            c->vertex_boundary[c->edge_use[u].vertex] = true;
            c->edge[c->edge_use[u].edge].boundary = true;
        }
    }
    for (int32_t e = 0; e < c->n_edge; e++) {
        int32_t n = 0;
        for (int32_t k = c->edge_face.start[e]; k < c->edge_face.start[e + 1]; k++)
            n += pal_cells_face_boundary(c, c->edge_face.item[k]);
        if (n <= 2) continue;
        c->edge[e].pinched = true, c->n_pinched_edge++;
        c->vertex_pinched[c->edge[e].vertex[0]] = c->vertex_pinched[c->edge[e].vertex[1]] = true;
    }
}

/* marks vertices with more than one ring of boundary faces */
static void find_pinched(builder *b)
{
    pal_cells *c = b->c;
    int32_t *seen = b->last;
    memset(b->stamp, 0, (size_t)c->n_vertex * sizeof *b->stamp);
    memset(seen, 0, (size_t)c->n_edge_use * sizeof *seen);
    for (int32_t u = 0; u < c->n_edge_use; u++) {
        if (c->edge_use[u].mate >= 0 || seen[u]) continue;
        int32_t v = c->edge_use[u].vertex, at = u;
        do {
            seen[at] = 1;
            at = pal_cells_across_edge(c, pal_cells_prev(c, at));
        } while (at != u);
        if (b->stamp[v]++) c->vertex_pinched[v] = true;
        c->n_boundary_fan++;
    }
    for (int32_t v = 0; v < c->n_vertex; v++) c->n_pinched_vertex += c->vertex_pinched[v];
}

/* cells on the walks round an edge: the cycle of an inner edge, all fans of a boundary edge */
static int32_t count_around(const pal_cells *c, int32_t e, int32_t first)
{
    int32_t n = 0, u = first;
    if (!c->edge[e].boundary) {
        do {
            n++;
            u = c->edge_use[c->edge_use[u].radial].mate;
        } while (u != first);
        return n;
    }
    /* a fan ends where it has no mate; the walks from both its ends count it twice */
    for (int32_t k = c->edge_face.start[e]; k < c->edge_face.start[e + 1]; k++) {
        if (!pal_cells_face_boundary(c, c->edge_face.item[k])) continue;
        pal_cells_face_loop(c, c->edge_face.item[k], &u);
        while (c->edge_use[u].edge != e) u++;
        for (; u >= 0; u = c->edge_use[c->edge_use[u].radial].mate) n++;
    }
    return n / 2;
}

static pal_err check_neighbourhoods(builder *b)
{
    pal_cells *c = b->c;
    for (int32_t u = c->n_edge_use - 1; u >= 0; u--) b->last[c->edge_use[u].edge] = u;
    for (int32_t e = 0; e < c->n_edge; e++) {
        int32_t n = c->edge_cell.start[e + 1] - c->edge_cell.start[e], first = b->last[e];
        if (count_around(c, e, first) != n)
            return refuse(b, -1, c->edge_use[first].face_use,
                          "cells go more than once round the edge of vertices %d and %d",
                          file_number(b, c->edge[e].vertex[0]), file_number(b, c->edge[e].vertex[1]));
    }
    for (int32_t v = 0; v < c->n_vertex; v++) {
        if (c->vertex_pinched[v]) continue;
        int32_t n_edge = c->vertex_edge.start[v + 1] - c->vertex_edge.start[v];
        int32_t n_face = c->vertex_face.start[v + 1] - c->vertex_face.start[v];
        int32_t first = c->vertex_cell.start[v], n_cell = c->vertex_cell.start[v + 1] - first;
        if (n_edge - n_face + n_cell != (c->vertex_boundary[v] ? 1 : 2))
            return refuse(b, c->vertex_cell.item[first], -1,
                          "and others go round vertex %d more than once: %d edges - %d faces + %d cells there",
                          file_number(b, v), n_edge, n_face, n_cell);
    }
    return PAL_ERR_OK;
}

static pal_err set_sharpness(builder *b)
{
    const pal_cell_loops *in = b->in;
    pal_cells *c = b->c;
    for (int32_t v = 0; in->vertex_sharpness && v < c->n_vertex; v++) {
        c->vertex_sharpness[v] = in->vertex_sharpness[v];
        if (!sharpness_valid(in->vertex_sharpness[v]))
            return PAL_REFUSE(b->diag, "%s: vertex %d has sharpness %g, must be 0 to %g",
                              line_of(in->vertex_line, v).text, file_number(b, v), (double)in->vertex_sharpness[v],
                              (double)PAL_SHARPNESS_MAX);
    }
    memset(b->table, 0, (b->mask + 1) * sizeof *b->table);
    for (int32_t e = 0; in->n_edge_tag > 0 && e < c->n_edge; e++)
        b->table[edge_place(b, c->edge[e].vertex[0], c->edge[e].vertex[1])] = e + 1;
    for (int32_t k = 0; k < in->n_edge_tag; k++) {
        const pal_cell_tag *tag = &in->edge_tag[k];
        int32_t e = b->table[edge_place(b, tag->a, tag->b)] - 1;
        if (e < 0 || !sharpness_valid(tag->sharp))
            return PAL_REFUSE(b->diag, "%s: sharpness %g of an edge of vertices %lld and %lld: %s",
                              line_of(in->tag_line, k).text, (double)tag->sharp, (long long)tag->a + in->count_from,
                              (long long)tag->b + in->count_from, e < 0 ? "no cell has it" : "must be 0 to 1000000");
        c->edge[e].sharp = fmaxf(c->edge[e].sharp, tag->sharp);
    }
    for (int32_t k = 0; k < in->n_face_tag; k++) {
        const pal_cell_tag *tag = &in->face_tag[k];
        if (tag->a < 0 || tag->a >= c->n_face_use)
            return PAL_REFUSE(b->diag, "cells: sharpness of loop %lld, there are %d", (long long)tag->a, c->n_face_use);
        if (!sharpness_valid(tag->sharp))
            return refuse(b, -1, tag->a, "has sharpness %g, must be 0 to %g", (double)tag->sharp,
                          (double)PAL_SHARPNESS_MAX);
        pal_cell_face *face = &c->face[c->face_use[tag->a].face];
        face->sharp = fmaxf(face->sharp, tag->sharp);
        face->inside |= tag->b != 0;
    }
    for (int32_t f = 0; f < c->n_face; f++) c->face[f].inside |= c->face[f].use[1] >= 0;
    return PAL_ERR_OK;
}

static pal_err build(builder *b)
{
    PAL_TRY(check_counts(b));
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, b->stamp, b->in->n_vertex);
    if (err) return err;
    PAL_TRY(check_corners(b));
    pal_cells *c = b->c;
    c->n_vertex = b->in->n_vertex, c->n_cell = b->in->n_cell;
    c->n_face_use = b->in->cell[c->n_cell];
    c->n_edge_use = b->in->loop[c->n_face_use];
    PAL_TRY(get_memory(b));
    copy_loops(b);
    PAL_TRY(find_faces(b));
    find_edges(b);
    pal_cell_edge *edge = realloc(c->edge, (size_t)c->n_edge * sizeof *edge);
    if (edge) c->edge = edge;
    pal_cell_face *face = realloc(c->face, (size_t)c->n_face * sizeof *face);
    if (face) c->face = face;
    join_mates(c);
    PAL_TRY(find_cells(b));
    PAL_TRY(find_incidence(c));
    find_boundary(c);
    find_pinched(b);
    PAL_TRY(check_neighbourhoods(b));
    return set_sharpness(b);
}

/* faces must have area and cells volume; messages use the numbers of the loops */
static pal_err check_shape(const builder *b)
{
    pal_cells_fault fault;
    if (pal_cells_shape_valid(b->c, NULL, &fault)) return PAL_ERR_OK;
    if (fault.face_use >= 0)
        return refuse(b, -1, fault.face_use, "has no area (%.3g m^2, longest edge %.3g m)", fault.measure,
                      fault.length_scale_m);
    return refuse(
        b, fault.cell, -1,
        "has no positive volume (%.3g m^3, %.3g m across): its faces must run counter-clockwise seen from outside",
        fault.measure, fault.length_scale_m);
}

pal_err pal_cells_make(const pal_cell_loops *loops, pal_cells *out, pal_diagnostic *diag)
{
    pal_cells cells = {0};
    builder b = {.in = loops, .c = &cells, .diag = diag};
    pal_err err = build(&b);
    if (!err) err = check_shape(&b);
    PAL_FREE(b.table, b.stamp, b.last);
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "cells: no memory for %d cells", loops->n_cell);
    if (err)
        pal_cells_free(&cells);
    else
        *out = cells;
    return err;
}
