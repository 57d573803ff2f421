/* Skinning: binds a displayed surface to the surface nodes of a tetrahedral mesh (paper B section 4.2 with errata
 * B6-B8, B15; server/mesh/README.md gives frames, weights and collapse). A vertex that lies on a node belongs to it
 * alone. Frames depend on the current positions only.
 *
 * Binding is [load]; evaluation is [sim], without heap use. One pal_skin may serve several threads; each needs its own
 * frames buffer. */
#ifndef PAL_MESH_VOLUME_SKIN_H
#define PAL_MESH_VOLUME_SKIN_H
#include "server/base/team.h"
#include "server/mesh/geometry/surface.h"
#include "server/mesh/geometry/tets.h"

enum { PAL_SKIN_NEIGHBOURS = 5 };

typedef struct pal_skin {
    int n_vertex;          /* shown vertices                                                               */
    int n_frame;           /* surface nodes that some vertex uses                                          */
    int n_node;            /* nodes of the mesh, for checks                                                */
    int32_t *frame;        /* node of each frame, ascending                          [n_frame]             */
    int32_t *frame_edge;   /* other ends of its two candidate edges (second may be -1) [n_frame][2]        */
    float *frame_rotation; /* cos, sin of the angle about X from second to first edge at rest [n_frame][2] */
    float *frame_rest;     /* rest lengths: sum of the fan's cross products, m^2; tangential parts of the two edges, m
                                                                                     [n_frame][3]          */
    int32_t *fan_start;    /* boundary faces around each frame's node, as sparse rows [n_frame+1]          */
    int32_t *fan;          /* the two other corners of each face, in outward order    [fan_start[n_frame]][2] */
    int32_t *near;         /* frames of each vertex                                   [n_vertex][5]        */
    float *coef;           /* weight w (sum 1 over a row) and offset o in the frame's axes, m, as
                              w oX, w oY, w oZ, w                                     [n_vertex][5][4]     */
} pal_skin;

/* binds vertices x [n_vertex][3] (same frame as tets->x) to the mesh; heap arrays, pal_skin_free; MEMORY, REFUSED when
 * the mesh has no surface */
pal_err pal_skin_bind(const pal_tets *tets, const double *x, int n_vertex, pal_skin *out);
void pal_skin_free(pal_skin *skin);

/* The frames buffer: 64 bytes a frame, 16 floats X Y Z P each padded to 4 (an array of 9 doubles a frame is large
 * enough). Memory of the caller, zeroed before the first use, best at a multiple of 64; its layout is private to this
 * room. */
static inline size_t pal_skin_frames_bytes(const pal_skin *skin)
{
    return (size_t)skin->n_frame * 64;
}
/* axes and origins from node positions x [n_node][3]; a frame whose nodes are not finite keeps the axes that the buffer
 * holds. team: NULL, or threads that share the work; the same bits with any number. [sim] */
void pal_skin_frames(const pal_skin *skin, const double *x, pal_team *team, void *frames);
/* the same for the n frames of list only [sim] */
void pal_skin_frames_of(const pal_skin *skin, const double *x, const int32_t *list, int n, void *frames);
/* all shown vertices from all frames: out [n_vertex][3] float metres; team as above. [sim] */
void pal_skin_evaluate(const pal_skin *skin, const void *frames, pal_team *team, float *out);
/* one shown vertex. [sim] */
void pal_skin_vertex(const pal_skin *skin, const double *x, const void *frames, int vertex, double out[3]);
#endif
