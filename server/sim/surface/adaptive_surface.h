/* An adaptive surface of mass points: the active part of its levels, its springs and masses, its drawn triangles (paper
 * C, spatial adaptation and adjustment of physical properties).
 *
 * Every face of mesh/geometry/levels.h is absent, a leaf or split; the leaves tile the surface. Splitting a leaf makes
 * its four children leaves, joining undoes it. Two leaves with a common edge differ by at most one level (2:1).
 * Everything else follows from that state alone, so that a state that returns does so bit by bit:
 *
 *   nodes     vertices of level 0 and the midpoints of edges beside a split face. All others are at x_rest with v, f,
 *             load and mass 0
 *   springs   edges of leaves that are not split themselves. Where a face is split and its neighbour is not, the
 *             halves of their edge replace it (hanging nodes; paper C fig. 3)
 *   masses    by nodes: M_l = M / N_l at a node of level l; at mixed nodes the mean over the levels of its springs
 *             (paper C eq. 6, 7). By faces: a leaf of level l has M / F_l, divided among its triangles and their
 *             corners. A change of level then moves mass only where it happens, nodes with many springs are heavier
 *             (so they ask for no shorter steps), those on an open edge lighter. Both are scaled so that the sum is M
 *             to rounding (erratum C5)
 *   triangles a leaf is drawn as one triangle, or 2, 3, 4 where 1, 2, 3 of its edges have a hanging node (paper C,
 *             types 1 to 4)
 *
 * Laws for the stiffness of springs, relative to the constant k_0 of level 0:
 *   membrane  each face at a spring adds k_0/2; the side of a face one level coarser adds k_0 (its halves replace a
 *             spring of twice the length), a hole adds nothing. Any piecewise linear stretch then has the same energy
 *             on every mixture of levels: refinement changes neither stiffness nor wave speed (erratum C4)
 *   paper     2^l m_l/m_0 for a spring of level l (paper C eq. 8), about 2^-l: a membrane softens by 2 a level
 *
 * Functions that change the state take the body, whose x and v of new nodes they set; pal_adaptive_update follows the
 * last of them, before anything else reads the body. Thread: make [load], the others [sim]; no heap in [sim]. */
#ifndef PAL_SIM_SURFACE_ADAPTIVE_SURFACE_H
#define PAL_SIM_SURFACE_ADAPTIVE_SURFACE_H
#include "server/base/arena.h"
#include "server/mesh/geometry/levels.h"
#include "server/sim/core/body.h"

typedef enum pal_adaptive_law { PAL_ADAPTIVE_MEMBRANE, PAL_ADAPTIVE_PAPER } pal_adaptive_law;
/* position of a new midpoint. LINEAR: the middle of its edge now, off it as at rest (rotated with the faces beside the
 * edge), which keeps the strain of the coarse face; BUTTERFLY: the stencil on current positions (paper C) */
typedef enum pal_midpoint_placement { PAL_MIDPOINT_LINEAR, PAL_MIDPOINT_BUTTERFLY } pal_midpoint_placement;
typedef enum pal_adaptive_mass { PAL_MASS_BY_NODES, PAL_MASS_BY_FACES } pal_adaptive_mass;
typedef enum pal_face_state { PAL_FACE_ABSENT, PAL_FACE_LEAF, PAL_FACE_SPLIT } pal_face_state;

/* slabs across the longest axis of the box at rest, by which the nodes are in order */
enum { PAL_ADAPTIVE_SLABS = 256 };

typedef struct pal_adaptive_options {
    int n_level;        /* 1..PAL_LEVELS_MAX */
    int start_level;    /* 0..n_level-1: all leaves have it at load and after reset */
    double mass_kg;     /* M > 0, of the whole surface */
    size_t budget_byte; /* of all memory of the body, its components and its display; 0: 512 MiB */
    pal_adaptive_law law;
    pal_midpoint_placement place;
    pal_adaptive_mass mass;
} pal_adaptive_options;

typedef struct pal_adaptive_surface {
    pal_levels levels; /* arrays in the arena: never pal_levels_free */
    pal_adaptive_options options;

    uint8_t *face_state; /* pal_face_state                                         [n faces] */
    uint8_t *edge_split; /* split faces beside the edge, 0..2; > 0: its midpoint is a node [n edges] */
    uint64_t revision;   /* grows with every update that changes something, and display.revision with it */
    double level_mass_kg[PAL_LEVELS_MAX];

    /* lists of the present state, in an order that depends on the state alone */
    int n_leaf, n_spring, n_node; /* n_node = body->n_active */
    int finest;                   /* level of the finest leaf                                */
    int32_t *leaf;                /* faces                                    [n_leaf]       */
    int32_t *spring;              /* edges                                    [n_spring]     */
    float *spring_share;          /* stiffness of each over k_0, by the law   [n_spring]     */
    int32_t *node;                /* vertices along the longest axis; body->active [n_node] */
    int n_leaf_of[PAL_LEVELS_MAX];
    double mass_scale; /* of the C5 rescaling, near 1 */
    /* common factors on the stiffness of springs and anchors, in force, energy and bounds alike. They keep the energy
     * continuous at a change of level and return to 1 (effects/refine.c) */
    double spring_ramp, shape_ramp;

    /* drawn triangles in fixed slots, so that a change of level changes few of them. Face f of level l owns the
     * 4^(L-1-l) slots from pal_adaptive_triangle_slot(s, f) on; empty ones are 0 0 0 */
    int n_slot;          /* finest faces */
    int32_t *slot;       /* [n_slot][3] */
    int n_tri;           /* the triangles without the empty slots, for display.surface */
    int32_t *tri;        /* [n_tri][3] */
    pal_surface surface; /* n_vertex finest vertices, x at rest, tri; display.surface */
    /* slots changed so far, the oldest overwritten: entry i of n_log is log[i % n_log_room] */
    uint64_t n_log;
    int n_log_room;
    int32_t *log;

    /* private to adaptive*.c */
    size_t n_byte;                       /* of surface and body                                               */
    int n_live;                          /* nodes of the present state, known before the lists are made again  */
    bool stale;                          /* the state has changed since the last update                        */
    int32_t *n_beside;                   /* springs of each node                              [n finest]       */
    int32_t *chain, *fresh;              /* faces and edges of one call of split                               */
    uint8_t *slab;                       /* of each vertex, along the longest axis of the box at rest [n finest] */
    double rest_centre_m[3], rest_kg_m2; /* weighted by the present masses; trace of the second moments about it */
} pal_adaptive_surface;

/* Levels of the surface, state, lists and the body: arrays for all finest vertices, x_rest, x, masses, active list,
 * surface, model.adaptive, dofs. Memory from the arena. REFUSED as pal_levels_make, BUDGET with both numbers, MEMORY.
 * [load] */
pal_err pal_adaptive_make(const pal_surface *surface, const pal_adaptive_options *options, pal_body *body,
                          pal_arena *arena, pal_diagnostic *diag, pal_adaptive_surface **out);
double pal_adaptive_mean_edge_m(const pal_levels *levels, int level); /* at rest */
/* pal_dofs.check_memory */
pal_err pal_adaptive_check_bytes(const pal_adaptive_surface *adaptive, size_t n_byte, pal_diagnostic *diag);

/* Splits a leaf, after coarser neighbours where 2:1 requires it. Returns the number of faces split: 0 when it is no
 * leaf or of the finest level, or when there would be more than max_node nodes (0: no limit). A new node takes its
 * position by the placement and the mean velocity of the ends of its edge; if both are at rest, it is at rest to the
 * bit. A fixed midpoint of an edge with a free end has v 0 and the displacement of the fixed end, none without one.
 * Masses follow with the update */
int pal_adaptive_split(pal_adaptive_surface *adaptive, pal_body *body, int32_t face, int max_node);
/* can the face be joined: is it split, are its children leaves, and is no half of its edges split? */
bool pal_adaptive_can_join(const pal_adaptive_surface *adaptive, int32_t face);
/* joins a face; nodes without a face return to rest (x_rest, v 0). false: it cannot be joined */
bool pal_adaptive_join(pal_adaptive_surface *adaptive, pal_body *body, int32_t face);
/* gives all leaves one level, as at load with start_level: nodes that come or go are at rest */
void pal_adaptive_set_level(pal_adaptive_surface *adaptive, pal_body *body, int level);
/* Updates lists, masses, triangles, dofs and revision: about 50 ns for each active node after a split or join, nothing
 * otherwise. true: the state differs from that of the last update */
bool pal_adaptive_update(pal_adaptive_surface *adaptive, pal_body *body);

/* position of the midpoint of an edge below the finest level by linear placement; all corners of the faces beside it
 * are nodes */
void pal_adaptive_midpoint(const pal_adaptive_surface *adaptive, const pal_body *body, int32_t edge, double x[3]);

static inline bool pal_adaptive_has(const pal_adaptive_surface *s, int32_t vertex)
{
    int32_t parent = pal_levels_vertex_parent(&s->levels, vertex);
    return parent < 0 || s->edge_split[parent] > 0;
}
static inline int32_t pal_adaptive_triangle_slot(const pal_adaptive_surface *s, int32_t face)
{
    int level = s->levels.face_level[face];
    return (face - s->levels.first_face[level]) << 2 * (s->levels.n_level - 1 - level);
}
/* body->dofs from the present lists; for adaptive*.c */
void pal_adaptive_fill_dofs(pal_adaptive_surface *adaptive, pal_body *body);
/* empties n slots from first on and logs them; for adaptive*.c */
void pal_adaptive_clear_slots(pal_adaptive_surface *adaptive, int32_t first, int32_t n);
/* drawn triangles of a leaf; returns their number, 1 to 4 */
int pal_adaptive_triangles(const pal_adaptive_surface *adaptive, int32_t leaf, int32_t tri[4][3]);

/* Best-fit rigid motion of the body from rest, weighted by mass: position x ~ R (x_rest - rest_centre) + centre,
 * velocity v ~ V + Omega x (x - centre). Fixed and free nodes count alike. R starts from the last one (unit quaternion
 * in and out, w x y z; 1 0 0 0 at first), so that it is steady for a flat, thin or collapsed body: in a point it stays,
 * with Omega 0. About 6 ns a node; needs the lists of the last update */
typedef struct pal_rigid_fit {
    double quat[4], R[9];
    double rest_centre_m[3], centre_m[3];
    double V_m_s[3], Omega_1_s[3];
} pal_rigid_fit;
void pal_adaptive_fit_rigid(const pal_adaptive_surface *adaptive, const pal_body *body, pal_rigid_fit *frame);
/* the same, to the bit, for packed dofs (active_nodes.h), by the threads of the body's team */
void pal_adaptive_fit_rigid_active(const pal_adaptive_surface *adaptive, const pal_body *body, pal_rigid_fit *frame);
#endif
