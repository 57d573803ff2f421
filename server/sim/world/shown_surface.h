/* The shown surface of a body, for renderers, encoders and picking. Thread: [any]. */
#ifndef PAL_SIM_WORLD_SHOWN_SURFACE_H
#define PAL_SIM_WORLD_SHOWN_SURFACE_H
#include <stdbool.h>
#include <stdint.h>

/* pointers borrow from the world and its scene and are valid while revision is the same */
typedef struct pal_shown {
    const char *name;
    int n_vertex, n_tri;
    const float *rest_m; /* scene frame             [n_vertex][3] */
    const int32_t *tri;  /* counter-clockwise, as at load; of an adaptive body the slot table, 0 0 0 in empty slots
                            (pal_frame_part.slot brings its changes) [n_tri][3] */
    const float *uv;     /* image coordinates of the vertices (pal_surface.uv); NULL: none [n_vertex][2] */
    uint64_t revision;
    const int32_t
        *face; /* control face of each triangle, -1: none (body.shown_face); NULL: no subdivision solid [n_tri] */
    bool is_adaptive; /* triangles change at run time */
    /* Refinement hierarchy of vertices beyond those of `tri`: vertex i >= n_coarse is the midpoint of the smaller
     * vertices parent[2 (i - n_coarse)], parent[.. + 1]; NULL: no hierarchy */
    int n_coarse;
    const int32_t *parent;
    int n_coarse_tri;
    const int32_t *coarse_tri; /* triangles of the vertices below n_coarse [n_coarse_tri][3] */
    /* the interior: tetrahedra of nodes, which fields have values for; n_tet 0: the body has none */
    int n_node, n_tet;
    const double *node_rest_m; /* scene frame less offset_m                            [n_node][3] */
    double offset_m[3];
    const int32_t *tet; /* positive volume at rest                                      [n_tet][4] */
} pal_shown;
#endif
