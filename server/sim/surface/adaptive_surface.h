/* An adaptive surface of mass points: which part of its levels is active, its springs and masses, what is drawn
 * (C, spatial adaptation and adjustment of physical properties).
 *
 * Every face of mesh/levels.h is absent, a leaf or split; the leaves tile the surface. Splitting a leaf makes its four
 * children leaves; joining undoes it. Two leaves with a common edge differ by one level at most (2:1). From that state
 * everything else follows, and only from it, so that a state that comes back brings back every bit:
 *
 *   nodes     vertices of level 0 and the midpoints of edges beside a split face. All others stand at x_rest with v, f,
 *             load and mass 0
 *   springs   edges of leaves that are not split themselves. Where a face is split and its neighbour is not, the halves
 *             of their edge take its place (hanging nodes; C, fig. 3)
 *   masses    by nodes: M_l = M / N_l at a node of level l; on mixed nodes the mean of the levels of its springs (C eq.
 *             6, 7). By faces: a leaf of level l has M / F_l and gives each of its triangles its part, and that each of
 *             its corners a third: then a switch moves mass only where it happens, nodes with many springs are heavier
 *             (so they ask for no shorter steps), those on an open edge lighter. Both are scaled so that the sum is M
 *             to rounding (erratum C5)
 *   triangles a leaf is drawn as one triangle, or 2, 3, 4 where 1, 2, 3 of its edges have a hanging node (C, types 1-4)
 *
 * Laws for the stiffness of springs, relative to the constant k_0 of level 0:
 *   membrane  each face that a spring borders gives k_0/2; the side of a face one level coarser gives k_0 (its halves
 *             stand for a spring of twice the length), a hole gives nothing. Then any piecewise linear stretch has the
 *             same energy on every mixture of levels: refinement changes neither stiffness nor wave speed (C4)
 *   paper     2^l m_l/m_0 for a spring of level l (C eq. 8), about 2^-l: a membrane softens by 2 a level
 *
 * Functions that change the state take the body, whose x, v of new nodes they set; call pal_adaptive_update after the
 * last of them and before anything else looks. Thread: make [load], the others [sim]; no heap in [sim]. */
#ifndef PAL_SIM_SURFACE_ADAPTIVE_SURFACE_H
#define PAL_SIM_SURFACE_ADAPTIVE_SURFACE_H
#include "server/base/arena.h"
#include "server/mesh/geometry/levels.h"
#include "server/sim/core/body.h"

typedef enum pal_adaptive_law { PAL_ADAPTIVE_MEMBRANE, PAL_ADAPTIVE_PAPER } pal_adaptive_law;
/* where a midpoint begins: on the middle of its edge as that stands now, off it as at rest (turned with the faces
 * beside the edge), which keeps the strain of the coarse face; or by the butterfly stencil on current positions (C) */
typedef enum pal_midpoint_placement { PAL_MIDPOINT_LINEAR, PAL_MIDPOINT_BUTTERFLY } pal_midpoint_placement;
typedef enum pal_adaptive_mass { PAL_MASS_BY_NODES, PAL_MASS_BY_FACES } pal_adaptive_mass;
typedef enum pal_face_state { PAL_FACE_ABSENT, PAL_FACE_LEAF, PAL_FACE_SPLIT } pal_face_state;

typedef struct pal_adaptive_options {
    int n_level;        /* 1..PAL_LEVELS_MAX */
    int start_level;    /* 0..n_level-1: all leaves have it at load and after reset */
    double mass_kg;     /* M > 0, of the whole surface */
    size_t budget_byte; /* of all that the body takes while it runs, rows and what is shown of it with it; 0: 512 MiB */
    pal_adaptive_law law;
    pal_midpoint_placement place;
    pal_adaptive_mass mass;
} pal_adaptive_options;

typedef struct pal_adaptive_surface {
    pal_levels levels; /* arrays in the arena: never pal_levels_free */
    pal_adaptive_options options;

    uint8_t *face_state; /* pal_face_state                                         [n faces] */
    uint8_t *edge_split; /* split faces beside the edge, 0..2; > 0: its midpoint is a node [n edges] */
    uint64_t revision;   /* grows with every update that changed something; body->revision follows */
    double level_mass_kg[PAL_LEVELS_MAX];

    /* lists of the present state, in an order that depends on the state alone */
    int n_leaf, n_spring, n_node; /* n_node = body->n_active */
    int finest;                   /* level of the finest leaf                                */
    int32_t *leaf;                /* faces                                    [n_leaf]       */
    int32_t *spring;              /* edges                                    [n_spring]     */
    float *spring_share;          /* stiffness of each over k_0, by the law   [n_spring]     */
    int32_t *node;                /* vertices, those of level 0 first; body->active [n_node] */
    int n_leaf_of[PAL_LEVELS_MAX];
    double mass_scale; /* of the C5 rescaling, near 1 */
    /* common factors on the stiffness of springs and anchors, 1 but for a moment after a switch of level: they keep the
     * energy continuous and ease back (effects/refine.c); rows take them in force, energy and bounds alike */
    double spring_ramp, shape_ramp;

    /* what is drawn: a table of triangles in fixed places, so that a change touches only what changed. Face f of level
     * l owns the 4^(L-1-l) places from pal_adaptive_triangle_slot(shell, f); empty ones are 0 0 0 */
    int n_slot;          /* finest faces */
    int32_t *slot;       /* [n_slot][3] */
    int n_tri;           /* the same without the empty ones, for body->surface */
    int32_t *tri;        /* [n_tri][3] */
    pal_surface surface; /* n_vertex finest vertices, x at rest, tri; body->surface */
    /* places changed so far, oldest overwritten: entry i of all is log[i % n_log_room] */
    uint64_t n_log;
    int n_log_room;
    int32_t *log;

    /* kept by shell*.c between calls */
    size_t n_byte;                       /* of shell and body                                                 */
    int n_live;                          /* nodes of the present state, known before the lists are made again  */
    bool stale;                          /* the state was touched since the last update                        */
    int32_t *n_beside;                   /* springs of each node                              [n finest]       */
    int32_t *chain, *fresh;              /* faces and edges of one call of split                               */
    double rest_centre_m[3], rest_kg_m2; /* weighted by the present masses; trace of the second moments about it */
} pal_adaptive_surface;

/* Levels of the surface, state, lists and the body: arrays for all finest vertices, x_rest, x, masses, active list,
 * surface; body->shell. Memory from the arena. REFUSED as pal_levels_make, BUDGET with both numbers, MEMORY. [load] */
pal_err pal_adaptive_make(const pal_surface *surface, const pal_adaptive_options *options, pal_body *body,
                          pal_arena *arena, pal_diagnostic *diag, pal_adaptive_surface **out);
/* most memory that a node of the finest level takes in shell and body, for messages and plan */
size_t pal_adaptive_node_bytes(const pal_adaptive_surface *adaptive);
/* does a body that takes n_byte with its rows and all keep to the budget? BUDGET with both numbers. [load] */
pal_err pal_adaptive_check_bytes(const pal_adaptive_surface *adaptive, size_t n_byte, pal_diagnostic *diag);

/* Splits a leaf; coarser neighbours first where 2:1 asks for it. Returns how many faces were split: 0 when it is no
 * leaf or of the finest level, or when there would be more than max_node nodes (0: no limit). New nodes get place, and
 * velocity as the mean of the ends of their edge; an edge whose ends stand at rest gives the midpoint's rest position
 * to the bit. A midpoint that is held (1) while an end of its edge is not has v 0 and stands as far from rest as the
 * end that is held, at rest when none is. Mass comes with the update */
int pal_adaptive_split(pal_adaptive_surface *adaptive, pal_body *body, int32_t face, int max_node);
/* may the face be joined? it is split, its children are leaves, and no half of its edges is split */
bool pal_adaptive_can_join(const pal_adaptive_surface *adaptive, int32_t face);
/* joins it; nodes that no face needs any more go back to rest (x_rest, v 0). false: it may not */
bool pal_adaptive_join(pal_adaptive_surface *adaptive, pal_body *body, int32_t face);
/* all leaves become of that level, from rest: x = x_rest of what is new or gone, as at load with start_level */
void pal_adaptive_set_level(pal_adaptive_surface *adaptive, pal_body *body, int level);
/* lists, masses, triangles, revision; the cost follows the active part, about 50 ns a node when something was split or
 * joined and nothing otherwise. true: the state is another than at the last update */
bool pal_adaptive_update(pal_adaptive_surface *adaptive, pal_body *body);

/* where linear placement puts the midpoint of an edge below the finest level, as its ends and the faces beside it stand
 * now: all of their corners are nodes */
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
/* body->dofs as the lists are now; for adaptive*.c */
void pal_adaptive_fill_dofs(pal_adaptive_surface *adaptive, pal_body *body);
/* empties n places from first on and logs them: for shell*.c */
void pal_adaptive_clear_slots(pal_adaptive_surface *adaptive, int32_t first, int32_t n);
/* triangles of a leaf as they are drawn now, 1..4; returns how many */
int pal_adaptive_triangles(const pal_adaptive_surface *adaptive, int32_t leaf, int32_t tri[4][3]);

/* The body's best-fit rigid motion from rest, weighted by mass: place x ~ R (x_rest - rest_centre) + centre, velocity
 * v ~ V + Omega x (x - centre). Held and free nodes count alike. R turns on from the last one given (unit quaternion in
 * and out, w x y z; 1 0 0 0 at first), so it is steady where the body is flat, thin or collapsed: in a point it keeps
 * the last R and has no Omega. About 6 ns a node; wants the lists of the last update */
typedef struct pal_rigid_fit {
    double quat[4], R[9];
    double rest_centre_m[3], centre_m[3];
    double V_m_s[3], Omega_1_s[3];
} pal_rigid_fit;
void pal_adaptive_fit_rigid(const pal_adaptive_surface *adaptive, const pal_body *body, pal_rigid_fit *frame);
/* the same of packed points (active_nodes.h) */
void pal_adaptive_fit_rigid_active(const pal_adaptive_surface *adaptive, const struct pal_active_nodes *pack,
                                   pal_rigid_fit *frame);
#endif
