/* The unknowns of a body, as its model describes them to everybody else. The arrays of the body (body.h) hold
 * positions, masses, the interpolation from dofs to nodes and the mobility of a node; this interface holds what differs
 * from model to model: the active set of a body that adapts, the elements that couple its nodes, and the operations
 * that only the model can do. A model fills it in `build`; what a model leaves zero does not apply to it. Thread:
 * [sim]. */
#ifndef PAL_SIM_CORE_DOFS_H
#define PAL_SIM_CORE_DOFS_H
#include "server/base/err.h"
#include "server/mesh/geometry/levels.h"
#include "server/num/block_matrix.h"

struct pal_body;
struct pal_material;

enum { PAL_DOFS_CLIQUES = 3 };

typedef struct pal_dofs {
    /* hierarchy of triangles whose vertices are the nodes; NULL: the active set never changes and the rest of this
     * block is zero */
    const pal_levels *levels;
    const uint8_t *edge_split; /* above 0: the midpoint of the edge is an active node      [n edges] */
    const uint8_t *face_state; /* the state from which everything else follows             [n faces] */
    int finest;                /* finest level with a leaf                                           */
    int n_spring;              /* active springs                                                     */
    double *ramp[2]; /* factors on the stiffness of springs and anchors, 1 but for a moment after a change of level */
    /* drawn triangles in fixed slots: slot [n_slot][3], empty ones 0 0 0. Slots changed so far, the oldest overwritten:
     * entry i of n_log is log[i % n_log_room] */
    int n_slot;
    const int32_t *slot;
    uint64_t n_log;
    int n_log_room;
    const int32_t *log;

    /* nodes that elements couple, one entry for each kind of element; n_clique 0: only components know */
    int n_clique;
    pal_cliques clique[PAL_DOFS_CLIQUES];
    const uint64_t
        *material_revision; /* grows with every change of the material within elements; NULL: never changes */
    size_t n_byte;          /* heap memory of the model beside the arena */
    double spacing_m;       /* mean distance between dofs, where it is not edge_m; 0: it is */

    /* masses again, after the supports are known; NULL: they do not depend on them. [load] */
    void (*update_mass)(struct pal_body *body);
    /* another material of the body, before components receive it; NULL: components alone need it */
    void (*set_material)(struct pal_body *body, const struct pal_material *material);
    /* all masses times a factor, after components have received a material; NULL: mass_kg alone */
    void (*scale_mass)(struct pal_body *body, double factor);
    /* does a body that takes n_byte in all keep its budget? BUDGET with both numbers. [load] */
    pal_err (*check_memory)(const struct pal_body *body, size_t n_byte, pal_diagnostic *diag);
    /* places and velocities [to->n_dof][3] of `to` from those of a body with the same coarse triangles; refine: takes
     * over which faces are split first. x, v may be those of `to` */
    void (*transfer)(struct pal_body *to, const struct pal_body *from, bool refine, double *x, double *v);
    void (*destroy)(struct pal_body *body); /* heap memory of the model; NULL: none. [load] */
} pal_dofs;

static inline uint64_t pal_dofs_material_revision(const pal_dofs *dofs)
{
    return dofs->material_revision ? *dofs->material_revision : 0;
}
static inline int pal_dofs_element_count(const pal_dofs *dofs)
{
    int n = 0;
    for (int k = 0; k < dofs->n_clique; k++) n += dofs->clique[k].n_item;
    return n;
}
/* is the vertex one of the surface's levels, and a node now? */
static inline bool pal_dofs_has(const pal_dofs *dofs, int32_t vertex)
{
    const pal_levels *l = dofs->levels;
    if (vertex >= l->n_vertex[l->n_level - 1]) return false;
    int32_t parent = pal_levels_vertex_parent(l, vertex);
    return parent < 0 || dofs->edge_split[parent] > 0;
}
#endif
