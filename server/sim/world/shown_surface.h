/* The shown surface of a body, for renderers, encoders and picking. Thread: [any]. */
#ifndef PAL_SIM_WORLD_SHOWN_SURFACE_H
#define PAL_SIM_WORLD_SHOWN_SURFACE_H
#include <stdbool.h>
#include <stdint.h>

/* what is drawn: the outside or the inside of tissue, or an image of the body, which is PAL_LOOK_IMAGE + its number */
typedef enum pal_look { PAL_LOOK_OUTSIDE, PAL_LOOK_INSIDE, PAL_LOOK_IMAGE } pal_look;

/* pointers borrow from the world and its scene and are valid while revision is the same */
typedef struct pal_shown {
    const char *name;
    int n_vertex, n_tri;
    const float *rest_m; /* scene frame             [n_vertex][3] */
    const int32_t *tri;  /* counter-clockwise, as at load; of an adaptive body the slot table, 0 0 0 in empty slots
                            (pal_frame_part.slot brings its changes) [n_tri][3] */
    /* what each vertex looks like, and its place in its image; NULL: all are the outside of tissue */
    const uint8_t *look; /* pal_look                [n_vertex]    */
    const float *uv;     /* 0 0 where no image is   [n_vertex][2] */
    /* Where neighbouring triangles look differently, or lie in different places of an image (a seam), they have
     * vertices of their own: the vertices from n_own on are copies, each of copy_of[i - n_own]. They are always at its
     * place. Triangle t draws vertex copy_pair[2 k] as copy_pair[2 k + 1], copy_start[t] <= k < copy_start[t + 1]; t
     * counts the triangles at load, of which each has 4^slot_level slots */
    int n_own;
    const int32_t *copy_of;    /* [n_vertex - n_own] */
    const int32_t *copy_start; /* NULL: no copies    */
    const int32_t *copy_pair;
    int slot_level;
    uint64_t revision;
    const int32_t
        *face; /* control face of each triangle, -1: none (body.shown_face); NULL: no subdivision solid [n_tri] */
    bool is_adaptive; /* triangles change at run time */
    /* Vertices that follow from others: vertex i >= n_coarse is the midpoint of the smaller vertices parent[2 (i -
     * n_coarse)], parent[.. + 1], which are the same for a copy; NULL: none does */
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
