/* Local subdivision of control cells (paper A section 4.1, Fig. 7d): a cell becomes one cell for each of its corners.
 *
 * A cell whose neighbour has been divided has faces and edges that are cut already. Their vertices are recognised by
 * position, exactly in the middle: a face centre is the mean of the opposite corners of the quads round it, the
 * vertices between lie at midpoints; a hanging vertex is the midpoint of the only two vertices that its cell joins it
 * to. Such a cell is divided as if it had not been cut, with the existing vertices, so that dividing all cells one
 * after the other gives the same complex as a level of subdivision. A cell that is cut twice is divided as it is. */
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/cells/cell_edit_work.h"
#include "server/mesh/geometry/tuning.h"
#include "server/num/sort.h"

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
    int32_t *at;     /* the face at each corner; -1: none             */
} division;

static pal_err division_reserve(const pal_cells *c, int32_t cell, division *s)
{
    pal_err err = PAL_ERR_OK;
    int32_t after, n_use = pal_cells_cell_loops(c, cell, &after);
    n_use = after - n_use;
    *s = (division){.c = c, .cell = cell, .n_vertex = c->cell_vertex.start[cell + 1] - c->cell_vertex.start[cell]};
    PAL_ARRAY(&err, s->edge, c->n_edge);
    PAL_ARRAY(&err, s->face, c->n_face);
    PAL_ZEROED(&err, s->role, c->n_vertex);
    PAL_ARRAY(&err, s->order, s->n_vertex);
    PAL_ARRAY(&err, s->start, n_use + 1);
    PAL_ARRAY(&err, s->corner, n_use);
    PAL_ARRAY(&err, s->mid, n_use);
    PAL_ARRAY(&err, s->centre, n_use);
    PAL_ARRAY(&err, s->at, n_use);
    return err;
}

static const double *at(const pal_cells *c, int32_t vertex)
{
    return c->x + 3 * (size_t)vertex;
}

static bool is_midpoint(const pal_cells *c, int32_t v, int32_t a, int32_t b)
{
    double d[3];
    pal_add3(d, at(c, a), at(c, b));
    pal_scale3(d, 0.5, d);
    return pal_dist3(d, at(c, v)) <= CELL_NEAR_MIDDLE * pal_dist3(at(c, a), at(c, b));
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
    return n >= 3 && pal_dist3(mean, x) <= CELL_NEAR_MIDDLE * size;
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
    return pal_compare_int32(b, a);
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

/* a vertex of the open side, in order; hanging ones go between */
static void add_side_vertex(division *s, int32_t vertex, int32_t face)
{
    int32_t *end = &s->start[s->n_side + 1];
    if (s->role[vertex] == HANGING) {
        /* before the first corner: kept until the side is closed, in the slot of a missing midpoint */
        *(*end == s->start[s->n_side] ? &s->centre[s->n_side] : &s->mid[*end - 1]) = vertex;
        return;
    }
    s->corner[*end] = vertex, s->mid[*end] = -1, s->at[*end] = face;
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
            add_side_vertex(s, c->edge_use[u].vertex, face);
        end_side(s, -2 - face);
    }
    for (int32_t i = 0; i < s->n_vertex; i++) {
        if (s->role[s->order[i]] != CENTRE) continue;
        int32_t use = corner_use(s, s->order[i]), u = use;
        do {
            add_side_vertex(s, opposite_corner(c, u), pal_cells_face_of(c, u));
            u = pal_cells_next_around(c, u);
            add_side_vertex(s, pal_cells_end_vertex(c, u), -1);
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
    int32_t n = s->c->n_vertex, n_corner = 0;
    for (int32_t side = 0; side < s->n_side; side++)
        for (int32_t i = s->start[side]; i < s->start[side + 1]; i++) {
            int32_t end[2] = {s->corner[i], s->corner[i + 1 < s->start[side + 1] ? i + 1 : s->start[side]]};
            if (s->mid[i] >= 0) continue;
            int32_t e = edge_between(s, end[0], end[1]);
            if (s->edge[e] < 0) {
                s->edge[e] = n++;
                pal_interpolation_builder_mean(&w->rows, end, 2);
            }
            s->mid[i] = s->edge[e];
        }
    for (int32_t side = 0; side < s->n_side; side++) {
        if (s->centre[side] >= 0) continue;
        s->face[-2 - s->centre[side]] = n;
        s->centre[side] = n++;
        pal_interpolation_builder_mean(&w->rows, s->corner + s->start[side], s->start[side + 1] - s->start[side]);
    }
    s->middle = n;
    /* the order is not needed again */
    for (int32_t i = 0; i < s->n_vertex; i++)
        if (s->role[s->order[i]] == CORNER) s->order[n_corner++] = s->order[i];
    pal_interpolation_builder_mean(&w->rows, s->order, n_corner);
}

/* the quad of a side at its corner i; reversed: as the neighbour sees it */
static void add_outer_vertices(pal_edit_work *w, const division *s, int32_t side, int32_t i, bool reversed)
{
    int32_t before = s->mid[i > s->start[side] ? i - 1 : s->start[side + 1] - 1], after = s->mid[i];
    const pal_cell_face *face = s->at[i] < 0 ? NULL : &s->c->face[s->at[i]];
    w->to.inside = face && face->inside;
    pal_cell_loops_quad(&w->to, face ? face->sharp : 0, s->corner[i], reversed ? before : after, s->centre[side],
                        reversed ? after : before);
    w->to.inside = false;
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
    pal_cell_loops_cell(&w->to);
    for (int32_t side = 0; side < s->n_side; side++)
        for (int32_t i = s->start[side]; i < s->start[side + 1]; i++) {
            if (s->corner[i] != corner) continue;
            add_outer_vertices(w, s, side, i, false);
            pal_cell_loops_quad(&w->to, 0, s->mid[i], centre_across(s, corner, s->mid[i]), s->middle, s->centre[side]);
        }
}

/* a cell that is not divided, with the parts of its faces and edges that are cut */
static void add_neighbour(pal_edit_work *w, const division *s, int32_t cell)
{
    const pal_cells *c = w->from;
    pal_cell_loops_cell(&w->to);
    for (int32_t f = c->cell_use[cell]; f < c->cell_use[cell + 1]; f++) {
        int32_t centre = s->face[c->face_use[f].face], side = 0;
        if (centre >= 0) {
            while (s->centre[side] != centre) side++;
            for (int32_t i = s->start[side]; i < s->start[side + 1]; i++) add_outer_vertices(w, s, side, i, true);
            continue;
        }
        w->to.inside = c->face[c->face_use[f].face].inside;
        pal_cell_loops_face(&w->to, c->face[c->face_use[f].face].sharp);
        w->to.inside = false;
        for (int32_t u = c->face_use[f].first_use; u < c->face_use[f + 1].first_use; u++) {
            const int32_t vertex[2] = {c->edge_use[u].vertex, s->edge[c->edge_use[u].edge]};
            pal_cell_loops_corners(&w->to, vertex, 1 + (vertex[1] >= 0));
        }
    }
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
    for (int32_t i = first + 1; i < s->n_vertex; i++) {
        if (s->role[vertex[i]] != CORNER) continue;
        w->cell_from[w->to.n_cell] = s->cell;
        add_part(w, s, vertex[i]);
    }
    for (int32_t e = 0; e < c->n_edge; e++) {
        const int32_t *end = c->edge[e].vertex, mid = s->edge[e];
        pal_cell_loops_edge(&w->to, end[0], mid < 0 ? end[1] : mid, c->edge[e].sharp);
        if (mid >= 0) pal_cell_loops_edge(&w->to, mid, end[1], c->edge[e].sharp);
    }
}

static pal_err divide(pal_edit_work *w, int32_t cell, division *s)
{
    const pal_cells *c = w->from;
    PAL_TRY(pal_edit_check_number(w, "cell", cell, c->n_cell));
    int32_t n = c->cell_vertex.start[cell + 1] - c->cell_vertex.start[cell];
    if (n > PAL_DIVIDE_CORNERS_MAX)
        return pal_edit_refuse(w, "it has %d corners, %d is the most", n, PAL_DIVIDE_CORNERS_MAX);
    PAL_TRY(division_reserve(c, cell, s));
    find_roles(s);
    list_sides(s);
    /* at most a vertex in the middle of each edge and side and of the cell, and a cell for each corner */
    PAL_TRY(pal_edit_reserve(w, c->n_vertex + s->start[s->n_side] + s->n_side + 1, c->n_cell + n));
    pal_edit_keep_vertices(w);
    add_midpoints(w, s);
    add_divided(w, s);
    return PAL_ERR_OK;
}

static pal_err divide_one(const pal_cells *from, int32_t cell, pal_cells_edit *out, pal_diagnostic *diag)
{
    pal_edit_work w = pal_edit_begin(from, diag, "divide cell %d", cell);
    division s = {0};
    pal_err err = divide(&w, cell, &s);
    PAL_FREE(s.edge, s.face, s.role, s.order, s.start, s.corner, s.mid, s.centre, s.at);
    return pal_edit_finish(&w, err, out);
}

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
static pal_err check_list(const pal_edit_work *w, int32_t n, const int32_t *cell, bool *listed)
{
    int32_t n_cell = w->from->n_cell, max = n_cell < PAL_DIVIDE_CELLS_MAX ? n_cell : PAL_DIVIDE_CELLS_MAX;
    if (n < 1 || n > max) return pal_edit_refuse(w, "%d cells, must be 1 to %d", n, max);
    for (int32_t i = 0; i < n; i++) {
        PAL_TRY(pal_edit_check_number(w, "cell", cell[i], n_cell));
        if (listed[cell[i]]) return pal_edit_refuse(w, "cell %d is given twice", cell[i]);
        listed[cell[i]] = true;
    }
    return PAL_ERR_OK;
}

pal_err pal_cells_divide(const pal_cells *from, int32_t n, const int32_t *cell, pal_cells_edit *out,
                         pal_diagnostic *diag)
{
    pal_edit_work w = pal_edit_begin(from, diag, "divide");
    pal_cells_edit next = {0};
    pal_err err = PAL_ERR_OK;
    bool *listed;
    memset(out, 0, sizeof *out);
    PAL_ZEROED(&err, listed, from->n_cell);
    if (!err) err = check_list(&w, n, cell, listed);
    free(listed);
    if (!err) err = divide_one(from, cell[0], out, diag);
    /* the cells that are still to be divided keep their numbers */
    for (int32_t i = 1; i < n && !err; i++) {
        err = divide_one(&out->cells, cell[i], &next, diag);
        if (!err) err = join_edits(out, &next);
    }
    if (err == PAL_ERR_MEMORY) pal_diagnostic_set(diag, err, "divide: no memory");
    if (err)
        pal_cells_edit_free(out);
    else
        pal_interpolation_apply(&out->rows, from->x, out->cells.x);
    return err;
}

/* the cells at most `rings` steps over vertices from the first of the list [n_cell]; returns how many */
static int32_t list_near(const pal_cells *c, int32_t rings, int32_t *list, bool *listed)
{
    int32_t n = 1, first = 0;
    listed[list[0]] = true;
    for (int32_t r = 0; r < rings; r++)
        for (int32_t after = n; first < after; first++)
            for (int32_t k = c->cell_vertex.start[list[first]]; k < c->cell_vertex.start[list[first] + 1]; k++) {
                int32_t v = c->cell_vertex.item[k];
                for (int32_t i = c->vertex_cell.start[v]; i < c->vertex_cell.start[v + 1]; i++) {
                    int32_t near = c->vertex_cell.item[i];
                    if (!listed[near]) listed[near] = true, list[n++] = near;
                }
            }
    return n;
}

pal_err pal_edit_divide_near(pal_edit_work *w, int32_t cell, int32_t rings, pal_cells_edit *out)
{
    const pal_cells *c = w->from;
    pal_err err = PAL_ERR_OK;
    int32_t *list;
    bool *listed;
    PAL_TRY(pal_edit_check_number(w, "cell", cell, c->n_cell));
    if (rings < 0 || rings > PAL_DIVIDE_RINGS_MAX)
        return pal_edit_refuse(w, "%d rings, must be 0 to %d", rings, PAL_DIVIDE_RINGS_MAX);
    PAL_ARRAY(&err, list, c->n_cell);
    PAL_ZEROED(&err, listed, c->n_cell);
    if (!err) {
        list[0] = cell;
        err = pal_cells_divide(c, list_near(c, rings, list, listed), list, out, w->diag);
    }
    return PAL_FREED(err, list, listed);
}
