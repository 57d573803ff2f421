/* Local subdivision of control cells (paper A section 4.1, Fig. 7d): a cell becomes one cell for each of its corners.
 *
 * A cell whose neighbour has been divided has faces and edges that are cut already. Their vertices are recognised by
 * position, exactly in the middle: a face centre is the mean of the opposite corners of the quads round it, the
 * vertices between lie at midpoints; a hanging vertex is the midpoint of the only two vertices that its cell joins it
 * to. Such a cell is divided as if it had not been cut, with the existing vertices, so that dividing all cells one
 * after the other gives the same complex as a level of subdivision. A cell that is cut twice is divided as it is. */
#include "server/base/vec3.h"
#include "server/mesh/cells/cell_edit_work.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NEAR_MIDDLE 1e-9 /* of the distance to the corners */

enum role { CORNER, HANGING, CENTRE };

/* The cell to be divided, as it was before its neighbours were. Of all vertices, edges and faces, by old number: */
typedef struct division {
    const pal_cells *c;
    int32_t cell, n_vertex;
    int32_t *edge;   /* new vertex in the middle of an edge that is cut; -1: not cut             [n_edge] */
    int32_t *face;   /* the same of a face                                                         [n_face]   */
    int32_t *role;   /* of the cell's vertices                                                     [n_vertex] */
    int32_t *order;  /* the cell's vertices, latest first                                          [n_vertex] */
    int32_t middle;  /* new vertex                                                                            */
    int32_t n_side;  /* its faces as they were                                                                */
    int32_t *start;  /* corners of side s: start[s] .. start[s+1]-1, as seen from outside                     */
    int32_t *corner; /* and the vertex in the middle of the edge from each to the next, new or old            */
    int32_t *mid;
    int32_t *centre; /* vertex in the middle of each side, new or old */
    float *sharp;    /* of the face at each corner                    */
} division;

static void division_free(division *s)
{
    free(s->edge);
    free(s->face);
    free(s->role);
    free(s->order);
    free(s->start);
    free(s->corner);
    free(s->mid);
    free(s->centre);
    free(s->sharp);
}

static pal_err division_reserve(const pal_cells *c, int32_t cell, division *s)
{
    size_t n_use = (size_t)(c->face_use[c->cell_use[cell + 1]].first_use - c->face_use[c->cell_use[cell]].first_use);
    *s = (division){.c = c, .cell = cell, .n_vertex = c->cell_vertex.start[cell + 1] - c->cell_vertex.start[cell]};
    s->edge = malloc((size_t)c->n_edge * sizeof *s->edge);
    s->face = malloc((size_t)c->n_face * sizeof *s->face);
    s->role = calloc((size_t)c->n_vertex, sizeof *s->role);
    s->order = malloc((size_t)s->n_vertex * sizeof *s->order);
    s->start = malloc((n_use + 1) * sizeof *s->start);
    s->corner = malloc(n_use * sizeof *s->corner);
    s->mid = malloc(n_use * sizeof *s->mid);
    s->centre = malloc(n_use * sizeof *s->centre);
    s->sharp = malloc(n_use * sizeof *s->sharp);
    return s->edge && s->face && s->role && s->order && s->start && s->corner && s->mid && s->centre && s->sharp
               ? PAL_ERR_OK
               : PAL_ERR_MEMORY;
}

/* ---- existing cuts ---- */

static const double *at(const pal_cells *c, int32_t vertex)
{
    return c->x + 3 * (size_t)vertex;
}

static bool is_midpoint(const pal_cells *c, int32_t v, int32_t a, int32_t b)
{
    double d[3];
    pal_add3(d, at(c, a), at(c, b));
    pal_scale3(d, 0.5, d);
    return pal_dist3(d, at(c, v)) <= NEAR_MIDDLE * pal_dist3(at(c, a), at(c, b));
}

static int32_t opposite_corner(const pal_cells *c, int32_t use)
{
    return pal_cells_end_vertex(c, pal_cells_next(c, use));
}

/* do quads of the cell, none with another centre, surround the vertex where use starts, with it in their middle? */
static bool is_centre(const division *s, int32_t use)
{
    const pal_cells *c = s->c;
    double mean[3] = {0}, size = 0;
    int32_t u = use, n = 0;
    do {
        const pal_face_use *f = &c->face_use[c->edge_use[u].face_use];
        int32_t turned = pal_cells_next_around(c, u);
        if (f[1].first_use - f->first_use != 4 || s->face[f->face] >= 0) return false;
        const pal_face_use *g = &c->face_use[c->edge_use[turned].face_use];
        if (g[1].first_use - g->first_use != 4) return false;
        /* opposite_corner is the corner beyond; the vertex between this quad and the next is where the next use starts
         */
        if (!is_midpoint(c, pal_cells_end_vertex(c, turned), opposite_corner(c, u), opposite_corner(c, turned)))
            return false;
        pal_add3(mean, mean, at(c, opposite_corner(c, u)));
        n++, u = turned;
    } while (u != use);
    pal_scale3(mean, 1.0 / n, mean);
    const double *x = at(c, c->edge_use[use].vertex);
    size = pal_dist3(x, at(c, opposite_corner(c, use)));
    return n >= 3 && pal_dist3(mean, x) <= NEAR_MIDDLE * size;
}

/* the edge use of the cell that starts at one of its vertices */
static int32_t corner_use(const division *s, int32_t vertex)
{
    int32_t k = s->c->cell_vertex.start[s->cell];
    while (s->c->cell_vertex.item[k] != vertex) k++;
    return s->c->corner_use[k];
}

/* assigns the faces round a vertex to it as their centre, or revokes that (-1) */
static void claim_faces(division *s, int32_t use, int32_t centre)
{
    int32_t u = use;
    s->role[s->c->edge_use[use].vertex] = centre < 0 ? CORNER : CENTRE;
    do {
        s->face[pal_cells_face_of(s->c, u)] = centre;
        u = pal_cells_next_around(s->c, u);
    } while (u != use);
}

/* joined, except to centres, to two vertices only that do not hang themselves, and in their middle? */
static bool is_hanging(const division *s, int32_t use)
{
    const pal_cells *c = s->c;
    int32_t u = use, end[2], n = 0;
    do {
        int32_t far = pal_cells_end_vertex(c, u);
        if (s->role[far] != CENTRE) {
            if (n == 2 || s->role[far] == HANGING) return false;
            end[n++] = far;
        }
        u = pal_cells_next_around(c, u);
    } while (u != use);
    return n == 2 && is_midpoint(c, c->edge_use[use].vertex, end[0], end[1]);
}

/* marks hanging vertices; false with the role revoked where the neighbour of a centre does not hang */
static bool remove_conflicting_roles(division *s)
{
    const pal_cells *c = s->c;
    for (int32_t i = 0; i < s->n_vertex; i++)
        if (s->role[s->order[i]] == HANGING) s->role[s->order[i]] = CORNER;
    for (int32_t i = 0; i < s->n_vertex; i++)
        if (s->role[s->order[i]] == CORNER && is_hanging(s, corner_use(s, s->order[i]))) s->role[s->order[i]] = HANGING;
    for (int32_t i = 0; i < s->n_vertex; i++) {
        if (s->role[s->order[i]] != CENTRE) continue;
        int32_t use = corner_use(s, s->order[i]), u = use;
        do {
            if (s->role[pal_cells_end_vertex(c, u)] != HANGING) {
                claim_faces(s, use, -1);
                return false;
            }
            u = pal_cells_next_around(c, u);
        } while (u != use);
    }
    return true;
}

static int descending(const void *a, const void *b)
{
    int32_t i = *(const int32_t *)a, j = *(const int32_t *)b;
    return i > j ? -1 : i < j;
}

/* roles of the vertices, later ones first: of two cuts, the finer one */
static void find_roles(division *s)
{
    const pal_cells *c = s->c;
    memset(s->edge, -1, (size_t)c->n_edge * sizeof *s->edge);
    memset(s->face, -1, (size_t)c->n_face * sizeof *s->face);
    memcpy(s->order, c->cell_vertex.item + c->cell_vertex.start[s->cell], (size_t)s->n_vertex * sizeof *s->order);
    qsort(s->order, (size_t)s->n_vertex, sizeof *s->order, descending);
    for (int32_t i = 0; i < s->n_vertex; i++) {
        int32_t use = corner_use(s, s->order[i]);
        if (is_centre(s, use)) claim_faces(s, use, s->order[i]);
    }
    while (!remove_conflicting_roles(s)) {
    }
}

/* ---- sides, and the numbers and rows of new vertices ---- */

/* a vertex of the open side, in order; hanging ones go between */
static void add_side_vertex(division *s, int32_t vertex, float sharp)
{
    int32_t *end = &s->start[s->n_side + 1];
    if (s->role[vertex] == HANGING) {
        /* before the first corner: kept until the side is closed, in the slot of a missing midpoint */
        if (*end == s->start[s->n_side])
            s->centre[s->n_side] = vertex;
        else
            s->mid[*end - 1] = vertex;
        return;
    }
    s->corner[*end] = vertex, s->mid[*end] = -1, s->sharp[*end] = sharp;
    (*end)++;
}

static void end_side(division *s, int32_t centre)
{
    if (s->centre[s->n_side] >= 0) s->mid[s->start[s->n_side + 1] - 1] = s->centre[s->n_side];
    s->centre[s->n_side] = centre;
    s->n_side++;
    s->start[s->n_side + 1] = s->start[s->n_side];
    s->centre[s->n_side] = -1;
}

/* sides of the cell: whole faces, then those round centres; face is -1 for the latter */
static void list_sides(division *s)
{
    const pal_cells *c = s->c;
    s->start[0] = s->start[1] = 0, s->centre[0] = -1;
    for (int32_t f = c->cell_use[s->cell]; f < c->cell_use[s->cell + 1]; f++) {
        int32_t face = c->face_use[f].face;
        if (s->face[face] >= 0) continue;
        for (int32_t u = c->face_use[f].first_use; u < c->face_use[f + 1].first_use; u++)
            add_side_vertex(s, c->edge_use[u].vertex, c->face[face].sharp);
        end_side(s, -2 - face);
    }
    for (int32_t i = 0; i < s->n_vertex; i++) {
        if (s->role[s->order[i]] != CENTRE) continue;
        int32_t use = corner_use(s, s->order[i]), u = use;
        do {
            add_side_vertex(s, opposite_corner(c, u), c->face[pal_cells_face_of(c, u)].sharp);
            u = pal_cells_next_around(c, u);
            add_side_vertex(s, pal_cells_end_vertex(c, u), 0);
        } while (u != use);
        end_side(s, s->order[i]);
    }
    for (int32_t f = c->cell_use[s->cell]; f < c->cell_use[s->cell + 1]; f++) s->face[c->face_use[f].face] = -1;
}

/* the edge of the cell between two of its vertices */
static int32_t edge_between(const division *s, int32_t a, int32_t b)
{
    int32_t u = corner_use(s, a);
    while (pal_cells_end_vertex(s->c, u) != b) u = pal_cells_next_around(s->c, u);
    return s->c->edge_use[u].edge;
}

/* new vertices after the old: edges, faces, the middle, each with its row, the mean of its corners */
static void add_midpoints(pal_edit_work *w, division *s)
{
    const pal_cells *c = s->c;
    int32_t n = c->n_vertex, n_corner = 0;
    for (int32_t i = 0; i < s->start[s->n_side]; i++) {
        if (s->mid[i] >= 0) continue;
        int32_t side = 0, next;
        while (s->start[side + 1] <= i) side++;
        next = s->corner[i + 1 < s->start[side + 1] ? i + 1 : s->start[side]];
        int32_t e = edge_between(s, s->corner[i], next);
        if (s->edge[e] < 0) {
            s->edge[e] = n++;
            pal_interpolation_builder_add(&w->rows, s->corner[i], 0.5);
            pal_interpolation_builder_add(&w->rows, next, 0.5);
            pal_interpolation_builder_end_row(&w->rows);
        }
        s->mid[i] = s->edge[e];
    }
    for (int32_t side = 0; side < s->n_side; side++) {
        int32_t first = s->start[side], after = s->start[side + 1];
        if (s->centre[side] >= 0) continue;
        s->face[-2 - s->centre[side]] = n;
        s->centre[side] = n++;
        for (int32_t i = first; i < after; i++)
            pal_interpolation_builder_add(&w->rows, s->corner[i], 1.0 / (after - first));
        pal_interpolation_builder_end_row(&w->rows);
    }
    s->middle = n;
    for (int32_t i = 0; i < s->n_vertex; i++) n_corner += s->role[s->order[i]] == CORNER;
    for (int32_t i = 0; i < s->n_vertex; i++)
        if (s->role[s->order[i]] == CORNER) pal_interpolation_builder_add(&w->rows, s->order[i], 1.0 / n_corner);
    pal_interpolation_builder_end_row(&w->rows);
}

/* ---- the new cells ---- */

static void add_quad(pal_edit_work *w, const int32_t vertex[4], float sharp)
{
    for (int k = 0; k < 4; k++) pal_edit_corner(w, vertex[k]);
    pal_edit_end_loop(w, sharp);
}

/* the quad of a side at its corner i; reversed: as the neighbour sees it */
static void add_outer_vertices(pal_edit_work *w, const division *s, int32_t side, int32_t i, bool reversed)
{
    int32_t before = s->mid[i > s->start[side] ? i - 1 : s->start[side + 1] - 1], after = s->mid[i];
    const int32_t quad[4] = {s->corner[i], reversed ? before : after, s->centre[side], reversed ? after : before};
    add_quad(w, quad, s->sharp[i]);
}

/* middle of the side that runs to a corner over the edge of vertex mid */
static int32_t centre_across(const division *s, int32_t corner, int32_t mid)
{
    for (int32_t side = 0; side < s->n_side; side++)
        for (int32_t i = s->start[side]; i < s->start[side + 1]; i++)
            if (s->mid[i] == mid && s->corner[i] != corner) return s->centre[side];
    return -1;
}

/* the part at a corner: outer quads lie in the sides, inner ones cross the edges from it */
static void add_part(pal_edit_work *w, const division *s, int32_t corner)
{
    for (int32_t side = 0; side < s->n_side; side++)
        for (int32_t i = s->start[side]; i < s->start[side + 1]; i++) {
            if (s->corner[i] != corner) continue;
            const int32_t inner[4] = {s->mid[i], centre_across(s, corner, s->mid[i]), s->middle, s->centre[side]};
            add_outer_vertices(w, s, side, i, false);
            add_quad(w, inner, 0);
        }
    pal_edit_end_cell(w, s->cell);
}

/* a cell that is not divided, with the parts of its faces and edges that are cut */
static void add_neighbour(pal_edit_work *w, const division *s, int32_t cell)
{
    const pal_cells *c = w->from;
    for (int32_t f = c->cell_use[cell]; f < c->cell_use[cell + 1]; f++) {
        int32_t centre = s->face[c->face_use[f].face], side = 0;
        if (centre >= 0) {
            while (s->centre[side] != centre) side++;
            for (int32_t i = s->start[side]; i < s->start[side + 1]; i++) add_outer_vertices(w, s, side, i, true);
            continue;
        }
        for (int32_t u = c->face_use[f].first_use; u < c->face_use[f + 1].first_use; u++) {
            pal_edit_corner(w, c->edge_use[u].vertex);
            if (s->edge[c->edge_use[u].edge] >= 0) pal_edit_corner(w, s->edge[c->edge_use[u].edge]);
        }
        pal_edit_end_loop(w, c->face[c->face_use[f].face].sharp);
    }
    pal_edit_end_cell(w, cell);
}

static void add_divided(pal_edit_work *w, const division *s)
{
    const pal_cells *c = w->from;
    const int32_t *vertex = c->cell_vertex.item + c->cell_vertex.start[s->cell];
    int32_t first = 0;
    while (s->role[vertex[first]] != CORNER) first++;
    for (int32_t i = 0; i < c->n_cell; i++) {
        if (i == s->cell)
            add_part(w, s, vertex[first]);
        else
            add_neighbour(w, s, i);
    }
    for (int32_t i = first + 1; i < s->n_vertex; i++)
        if (s->role[vertex[i]] == CORNER) add_part(w, s, vertex[i]);
    for (int32_t e = 0; e < c->n_edge; e++) {
        const int32_t *end = c->edge[e].vertex, mid = s->edge[e];
        pal_edit_tag(w, end[0], mid < 0 ? end[1] : mid, c->edge[e].sharp);
        if (mid >= 0) pal_edit_tag(w, mid, end[1], c->edge[e].sharp);
    }
    memcpy(w->to.vertex_sharpness, c->vertex_sharpness, (size_t)c->n_vertex * sizeof *c->vertex_sharpness);
}

static int32_t count_corners(const division *s)
{
    int32_t n = 0;
    for (int32_t i = 0; i < s->n_vertex; i++) n += s->role[s->order[i]] == CORNER;
    return n;
}

/* space for the result: a quad in each side and one inside for every use, and the extra vertices of the neighbours'
 * loops */
static pal_err reserve_division(pal_edit_work *w, const division *s, pal_diagnostic *diag)
{
    const pal_cells *c = w->from;
    int64_t n_use = s->start[s->n_side], n_more = 0, n_new = 1;
    for (int32_t side = 0; side < s->n_side; side++) n_new += s->centre[side] < 0;
    int32_t first = c->face_use[c->cell_use[s->cell]].first_use;
    int32_t end = c->face_use[c->cell_use[s->cell + 1]].first_use;
    for (int32_t u = first; u < end; u++) {
        int32_t e = c->edge_use[u].edge;
        n_more += c->edge_cell.start[e + 1] - c->edge_cell.start[e];
    }
    int32_t whole = 0;
    for (int32_t i = 0; i < s->start[s->n_side]; i++) whole += s->mid[i] < 0;
    return pal_edit_reserve(w, c->n_vertex + whole / 2 + n_new, (int64_t)c->n_cell + count_corners(s) - 1,
                            c->n_face_use + 3 * n_use, c->n_edge_use + n_more + 12 * n_use, diag);
}

static pal_err divide_one(const pal_cells *from, int32_t cell, pal_cells_edit *out, pal_diagnostic *diag)
{
    pal_edit_work w = pal_edit_begin(from, "divide cell %d", cell);
    division s = {0};
    PAL_TRY(pal_edit_check_number(&w, "cell", cell, from->n_cell, diag));
    int32_t n = from->cell_vertex.start[cell + 1] - from->cell_vertex.start[cell];
    if (n > PAL_DIVIDE_CORNERS_MAX)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: it has %d corners, %d is the most", w.what, n,
                                  PAL_DIVIDE_CORNERS_MAX);
    pal_err err = division_reserve(from, cell, &s);
    if (!err) {
        find_roles(&s);
        list_sides(&s);
        err = reserve_division(&w, &s, diag);
    }
    if (!err) {
        for (int32_t v = 0; v < from->n_vertex; v++) {
            pal_interpolation_builder_add(&w.rows, v, 1);
            pal_interpolation_builder_end_row(&w.rows);
        }
        add_midpoints(&w, &s);
        add_divided(&w, &s);
    }
    division_free(&s);
    return pal_edit_finish(&w, err, out, diag);
}

/* ---- many cells ---- */

/* edit becomes the division `edit` followed by `next`; takes next. Both are freed on failure */
static pal_err join_edits(pal_cells_edit *edit, pal_cells_edit *next)
{
    pal_interpolation rows = {0};
    pal_err err = pal_interpolation_product(&next->rows, &edit->rows, INT32_MAX, &rows);
    if (!err) {
        for (int32_t i = 0; i < next->cells.n_cell; i++) next->cell_from[i] = edit->cell_from[next->cell_from[i]];
        pal_interpolation_free(&next->rows);
        next->rows = rows;
    } else
        pal_cells_edit_free(next);
    pal_cells_edit_free(edit);
    *edit = *next;
    return err;
}

/* listed [n_cell] is all false */
static pal_err check_list(const pal_cells *from, int32_t n, const int32_t *cell, bool *listed, pal_diagnostic *diag)
{
    pal_edit_work w = pal_edit_begin(from, "divide");
    int32_t max = from->n_cell < PAL_DIVIDE_CELLS_MAX ? from->n_cell : PAL_DIVIDE_CELLS_MAX;
    if (n < 1 || n > max) return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "divide: %d cells, must be 1 to %d", n, max);
    for (int32_t i = 0; i < n; i++) {
        PAL_TRY(pal_edit_check_number(&w, "cell", cell[i], from->n_cell, diag));
        if (listed[cell[i]])
            return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "divide: cell %d is given twice", cell[i]);
        listed[cell[i]] = true;
    }
    return PAL_ERR_OK;
}

pal_err pal_cells_divide(const pal_cells *from, int32_t n, const int32_t *cell, pal_cells_edit *out,
                         pal_diagnostic *diag)
{
    pal_cells_edit edit = {0}, next = {0};
    memset(out, 0, sizeof *out);
    bool *listed = calloc((size_t)from->n_cell + 1, sizeof *listed);
    pal_err err = listed ? check_list(from, n, cell, listed, diag) : PAL_ERR_MEMORY;
    free(listed);
    if (!err) err = divide_one(from, cell[0], &edit, diag);
    /* the cells that are still to be divided keep their numbers */
    for (int32_t i = 1; i < n && !err; i++) {
        err = divide_one(&edit.cells, cell[i], &next, diag);
        if (err)
            pal_cells_edit_free(&edit);
        else
            err = join_edits(&edit, &next);
    }
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "divide: no memory");
    if (err) return err;
    pal_interpolation_apply(&edit.rows, from->x, edit.cells.x);
    *out = edit;
    return PAL_ERR_OK;
}

pal_err pal_cells_divide_near(const pal_cells *from, int32_t cell, int32_t rings, pal_cells_edit *out,
                              pal_diagnostic *diag)
{
    const pal_cells *c = from;
    pal_edit_work w = pal_edit_begin(from, "divide cell %d", cell);
    memset(out, 0, sizeof *out);
    PAL_TRY(pal_edit_check_number(&w, "cell", cell, from->n_cell, diag));
    if (rings < 0 || rings > PAL_DIVIDE_RINGS_MAX)
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: %d rings, must be 0 to %d", w.what, rings,
                                  PAL_DIVIDE_RINGS_MAX);
    int32_t *list = malloc((size_t)c->n_cell * sizeof *list), n = 1, first = 0;
    bool *listed = calloc((size_t)c->n_cell, sizeof *listed);
    pal_err err = list && listed ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (!err) list[0] = cell, listed[cell] = true;
    for (int32_t r = 0; r < rings && !err; r++)
        for (int32_t after = n; first < after; first++)
            for (int32_t k = c->cell_vertex.start[list[first]]; k < c->cell_vertex.start[list[first] + 1]; k++) {
                int32_t v = c->cell_vertex.item[k];
                for (int32_t i = c->vertex_cell.start[v]; i < c->vertex_cell.start[v + 1]; i++) {
                    int32_t near = c->vertex_cell.item[i];
                    if (!listed[near]) listed[near] = true, list[n++] = near;
                }
            }
    err = err ? pal_diagnostic_set(diag, err, "%s: no memory", w.what) : pal_cells_divide(from, n, list, out, diag);
    free(list);
    free(listed);
    return err;
}
