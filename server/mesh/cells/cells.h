/* Solids cut into polyhedral cells, with radial-edge adjacency (paper A section 3.4.4; Weiler 1988) in index arrays.
 *
 * A cell is a ball bounded by faces; a face is a loop of three or more vertices that one cell (boundary) or two cells
 * have; an edge joins two vertices. Each appearance is a use of its own:
 *
 *   face use  a face as one cell sees it, counter-clockwise from outside that cell, in the order of the cell's loops
 *   edge use  an edge as one face use runs along it, in loop order
 *
 * From an edge use, next and prev walk round its face, mate is the same edge on the other side of the same face (-1 at
 * the boundary), radial the same edge in the neighbouring face inside the same cell. Mate and radial undo themselves
 * and run along the edge the other way. radial, mate, radial, mate ... visits the cells round an edge; radial of prev
 * (pal_cells_next_around) visits the faces of one cell round a vertex.
 *
 * Numbers: vertices and cells as given, faces and edges in the order of their first use. A pal_cells owns its arrays
 * (heap). x and the sharpnesses may be written; the rest is constant once made. Thread: [load] to make, [any] to read.
 */
#ifndef PAL_MESH_CELLS_CELLS_H
#define PAL_MESH_CELLS_CELLS_H
#include "server/mesh/geometry/surface.h"

enum { PAL_CELL_LOOP_MAX = 256 }; /* corners of a face */
#define PAL_SHARPNESS_MAX 1e6f    /* maximum sharpness: as many levels of subdivision */

/* sharpness of an edge by its two vertices in any order, or of a face by its loop's number */
typedef struct pal_cell_tag {
    int32_t a, b; /* edge: vertices; face: loop, and 1 where it is inside */
    float sharp;  /* 0..PAL_SHARPNESS_MAX             */
} pal_cell_tag;

/* Cells as lists of oriented loops: what a file, a shape or an edit provides. A face between two cells appears in both,
 * in opposite directions. Owns its arrays (heap). */
typedef struct pal_cell_loops {
    int32_t n_vertex, n_cell, n_edge_tag, n_face_tag;
    double *x;               /* position, m                                             [n_vertex][3]            */
    int32_t *cell;           /* loops of cell c: cell[c] .. cell[c+1]-1                 [n_cell+1]               */
    int32_t *loop;           /* corners of loop l: loop[l] .. loop[l+1]-1               [cell[n_cell]+1]         */
    int32_t *corner;         /* vertices, counter-clockwise seen from outside the cell  [loop[cell[n_cell]]]     */
    float *vertex_sharpness; /* may be NULL: all 0                                      [n_vertex]               */
    pal_cell_tag *edge_tag;  /* an edge given twice has the greater one                 [n_edge_tag]             */
    pal_cell_tag *face_tag;  /* either loop of a face between two cells will do         [n_face_tag]             */
    /* lines of a file, for messages; each may be NULL */
    int64_t *line;        /* of loops [cell[n_cell]] */
    int64_t *vertex_line; /* [n_vertex]              */
    int64_t *tag_line;    /* of edge_tag             */
    int32_t count_from;   /* what messages call vertex, cell and face 0: 1 in files that count from 1         */
    /* of loops that are added one by one (below): loops and corners so far, the first error */
    int32_t n_loop, n_corner;
    bool inside; /* the faces that come are (pal_cell_face.inside) */
    pal_err err;
} pal_cell_loops;

typedef struct pal_cell_edge {
    int32_t vertex[2]; /* as its first use runs                                                      */
    float sharp;       /* 0 smooth, below 1 semi-sharp, s >= 1 sharp for so many levels of subdivision */
    bool boundary;     /* of a boundary face                                                         */
    bool pinched;      /* of more than two boundary faces: cells touch in this edge only             */
} pal_cell_edge;

typedef struct pal_cell_face {
    int32_t use[2]; /* face uses, ascending; use[1] = -1: a boundary face. Its loop is that of use[0] */
    float sharp;
    bool inside; /* between two cells, or was when it was made, or made by an edit: where it shows, it is cut tissue */
} pal_cell_face;

typedef struct pal_face_use {
    int32_t cell, face, first_use;
    int32_t mate; /* the face's other use; -1: boundary                         */
    int32_t sign; /* 1: the face's first use, -1: its second (mirrored); 0: end */
} pal_face_use;

typedef struct pal_edge_use {
    int32_t edge, vertex; /* vertex it starts from                          */
    int32_t face_use;     /* whose loop it is part of                       */
    int32_t mate, radial; /* edge uses; mate is -1 at a boundary face       */
} pal_edge_use;

/* sparse rows: entries of row i are item[start[i]] .. item[start[i+1]-1], ascending unless said otherwise */
typedef struct pal_cell_rows {
    int32_t *start, *item;
} pal_cell_rows;

typedef struct pal_cells {
    int32_t n_vertex, n_edge, n_face, n_cell, n_face_use, n_edge_use;
    int32_t n_boundary_face, n_pinched_edge, n_pinched_vertex;
    int32_t n_boundary_fan;  /* closed fans of boundary faces around the vertices: one at each, more at a pinched one */
    double *x;               /* position, m                                       [n_vertex][3]     */
    float *vertex_sharpness; /* as edges' sharp                                   [n_vertex]        */
    bool *vertex_boundary;   /* of a boundary face                                [n_vertex]        */
    bool *vertex_pinched;    /* sheets of the boundary touch here: treated as a corner [n_vertex] */
    pal_cell_edge *edge;     /* [n_edge]                                                            */
    pal_cell_face *face;     /* [n_face]                                                            */
    int32_t *cell_use;       /* first face use of each cell                       [n_cell+1]        */
    pal_face_use *face_use;  /* entry n_face_use: first_use = n_edge_use, else -1 [n_face_use+1]    */
    pal_edge_use *edge_use;  /* [n_edge_use]                                                        */
    pal_cell_rows vertex_edge, vertex_face, vertex_cell, edge_face, edge_cell;
    pal_cell_rows cell_vertex; /* vertices in order of first use: entry k is corner k of all cells,
                                * vertex_cell and this have equally many entries                    */
    int32_t *corner_use;       /* an edge use of the cell that starts at the vertex, for each entry
                                * of cell_vertex                                                    */
} pal_cells;

/* Builds the complex; the loops are copied. REFUSED, in one sentence with the line when there is one, cell, face and
 * number: counts or starts that do not fit, a position that is NaN or beyond 1e9 m, a vertex out of range, repeated in
 * a loop or of no cell, a loop of less than 3 or more than PAL_CELL_LOOP_MAX corners, a face without area, a face of
 * three cells, of one cell twice, given the same way round by two cells, or with the corners of another face in another
 * order, cells that go round an edge or a vertex more than once, a cell that is not closed, has a face inside out, is
 * no ball or has no positive volume, a sharpness out of range or of an edge that is not there. MEMORY. */
pal_err pal_cells_make(const pal_cell_loops *loops, pal_cells *out, pal_diagnostic *diag);
/* frees the arrays and zeroes the struct; a zeroed struct is fine */
void pal_cells_free(pal_cells *cells);
/* deep copy; MEMORY */
pal_err pal_cells_copy(const pal_cells *from, pal_cells *to);

/* the complex as loops again, of all cells or of those with keep [n_cell] true and their vertices, with tags of
 * everything that is not smooth (a face has one for each of its loops, so that a loop may be removed), lines NULL. keep
 * NULL: loop l is face use l. kept [n_vertex] (may be NULL) receives the old number of each vertex that stays; MEMORY
 */
pal_err pal_cells_loops(const pal_cells *cells, const bool *keep, pal_cell_loops *out, int32_t *kept);
void pal_cell_loops_free(pal_cell_loops *loops);
/* Loops one by one, from a zeroed struct: a vertex, whose number is returned; the next cell; its next face with its
 * sharpness; the face's next corners; a face of four; the sharpness of an edge, unless it is 0. The arrays grow. The
 * first error is kept in err (MEMORY, BUDGET: too many), after which nothing is added. */
int32_t pal_cell_loops_vertex(pal_cell_loops *loops, const double x[3], float sharp);
void pal_cell_loops_cell(pal_cell_loops *loops);
void pal_cell_loops_face(pal_cell_loops *loops, float sharp);
void pal_cell_loops_corners(pal_cell_loops *loops, const int32_t *vertex, int n);
void pal_cell_loops_quad(pal_cell_loops *loops, float sharp, int32_t a, int32_t b, int32_t c, int32_t d);
void pal_cell_loops_edge(pal_cell_loops *loops, int32_t a, int32_t b, float sharp);
/* the faces of a hexahedron with corner c at bits 0, 1, 2 of three right-handed directions, as the next cell; loop 2 a
 * + s is its side s of direction a */
extern const int32_t pal_cell_hex_loop[6][4];
void pal_cell_loops_hex(pal_cell_loops *loops, const int32_t vertex[8]);
/* all cells of a complex, or those with keep [n_cell] true, and their edges; vertices are renumbered by map [n_vertex]
 * (NULL: unchanged) */
void pal_cell_loops_append(pal_cell_loops *loops, const pal_cells *cells, const bool *keep, const int32_t *map);
/* builds the complex from them unless there was an error, and frees them in any case */
pal_err pal_cell_loops_finish(pal_cell_loops *loops, pal_cells *out, pal_diagnostic *diag);
/* removes the vertices of no loop; kept as above. MEMORY */
pal_err pal_cell_loops_drop_unused(pal_cell_loops *loops, int32_t *kept);

/* the first face without area or cell without positive volume, relative to its size */
typedef struct pal_cells_fault {
    int32_t cell, face_use;         /* face_use: the face without area; -1: the cell is at fault */
    double measure, length_scale_m; /* area, m^2, and longest edge, or volume, m^3, and diagonal */
} pal_cells_fault;
/* false with the first fault at positions x [n_vertex][3] (NULL: its own); fault may be NULL */
bool pal_cells_shape_valid(const pal_cells *cells, const double *x, pal_cells_fault *fault);

/* Measures with positions x [n_vertex][3] (NULL: its own). A face that is not flat counts as the fan of triangles about
 * its corners' mean, so that cells fill the solid exactly. */
void pal_cells_face_centre(const pal_cells *cells, const double *x, int32_t face, double out[3]); /* corners' mean */
void pal_cells_cell_centre(const pal_cells *cells, const double *x, int32_t cell, double out[3]); /* vertices' mean */
void pal_cells_use_centre(const pal_cells *cells, const double *x, int32_t face_use, double out[3]); /* x not NULL */
/* vector area, m^2, out of the face's first cell */
void pal_cells_face_area(const pal_cells *cells, const double *x, int32_t face, double out[3]);
/* six times the volume of the cone from o over a loop of n corners, each `stride` numbers after the one before */
double pal_cells_cone(const double *x, const int32_t *corner, int stride, int n, const double o[3]);
double pal_cells_cell_volume(const pal_cells *cells, const double *x, int32_t cell); /* m^3 */
double pal_cells_volume(const pal_cells *cells, const double *x);

/* piece of each cell, label [n_cell]; number of pieces */
int32_t pal_cells_label(const pal_cells *cells, int32_t *label);

/* Pieces and holes. Sheets that touch in a pinched vertex or edge count as separate. */
typedef struct pal_cells_topology {
    int32_t n_piece;     /* cells joined by faces                                        */
    int32_t n_sheet;     /* closed surfaces that make up the boundary                    */
    int32_t n_cavity;    /* sheets - pieces: hollows inside                              */
    int32_t genus;       /* handles or through holes, summed over the sheets             */
    int64_t euler;       /* V - E + F - C of the complex as it is, pinched or not        */
    int64_t sheet_euler; /* V - E + F summed over the sheets: 2 (sheets - genus)        */
} pal_cells_topology;
pal_err pal_cells_find_topology(const pal_cells *cells, pal_cells_topology *out); /* MEMORY */

/* The boundary as triangles, outward, positions copied, origin 0; quads are cut by their shorter diagonal. vertex
 * [n_vertex] and face [n_tri] of the surface say which of the complex each is, the caller frees both (either may be
 * NULL). Closed; crowded where the complex is pinched. MEMORY */
pal_err pal_cells_boundary(const pal_cells *cells, pal_surface *out, int32_t **vertex, int32_t **face);
/* the same of the cells that are left without those that are away [n_cell]; n_tri 0: none is left */
pal_err pal_cells_boundary_of(const pal_cells *cells, const bool *away, pal_surface *out, int32_t **vertex,
                              int32_t **face);

/* ---- walks ---- */

static inline int32_t pal_cells_next(const pal_cells *c, int32_t use)
{
    const pal_face_use *f = &c->face_use[c->edge_use[use].face_use];
    return use + 1 == f[1].first_use ? f->first_use : use + 1;
}
static inline int32_t pal_cells_prev(const pal_cells *c, int32_t use)
{
    const pal_face_use *f = &c->face_use[c->edge_use[use].face_use];
    return (use == f->first_use ? f[1].first_use : use) - 1;
}
/* the vertex the edge use ends at */
static inline int32_t pal_cells_end_vertex(const pal_cells *c, int32_t use)
{
    const pal_cell_edge *e = &c->edge[c->edge_use[use].edge];
    return e->vertex[e->vertex[0] == c->edge_use[use].vertex];
}
static inline int32_t pal_cells_face_of(const pal_cells *c, int32_t use)
{
    return c->face_use[c->edge_use[use].face_use].face;
}
/* the next edge use of the same cell from the same vertex: all of them in a cycle, counter-clockwise seen from outside
 */
static inline int32_t pal_cells_next_around(const pal_cells *c, int32_t use)
{
    return c->edge_use[pal_cells_prev(c, use)].radial;
}
static inline bool pal_cells_face_boundary(const pal_cells *c, int32_t face)
{
    return c->face[face].use[1] < 0;
}
/* edge uses of a cell: first .. after - 1 */
static inline int32_t pal_cells_cell_loops(const pal_cells *c, int32_t cell, int32_t *after)
{
    *after = c->face_use[c->cell_use[cell + 1]].first_use;
    return c->face_use[c->cell_use[cell]].first_use;
}
/* corners of a face, and their edge uses from the first cell's side: first .. first + n - 1 */
static inline int32_t pal_cells_face_loop(const pal_cells *c, int32_t face, int32_t *first)
{
    const pal_face_use *f = &c->face_use[c->face[face].use[0]];
    *first = f->first_use;
    return f[1].first_use - f->first_use;
}
/* From an edge use of a boundary face to that of the boundary face next to it over the same edge, through all cells
 * between; it runs the other way. With next and prev it walks the boundary as a surface. */
static inline int32_t pal_cells_across_edge(const pal_cells *c, int32_t use)
{
    for (use = c->edge_use[use].radial; c->edge_use[use].mate >= 0; use = c->edge_use[c->edge_use[use].mate].radial) {
    }
    return use;
}
#endif
