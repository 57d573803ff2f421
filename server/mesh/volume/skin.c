/* Skinning of a displayed surface to a tetrahedral mesh (paper B section 4.2, errata B6-B8 and B15 in skin.h).
 *
 * Departures: face normals are summed with their areas, so that a collapsed face has no weight and no root is needed
 * per face; nodes whose normals nearly cancel at rest (two voxels that touch along an edge) carry no frame. Offsets are
 * stored times their weight, so a vertex is the sum of 5 x 4 scaled columns of 4 floats. */
#include "server/mesh/volume/skin.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/kd_tree.h"
#include "server/mesh/geometry/tuning.h"

/* distance to a node, in voxel edges, at which a vertex lies on it */
#define ON_NODE 1e-7

/* frames and vertices of a piece of work of a thread: some ten microseconds */
enum { SKIN_FRAMES = 128, SKIN_VERTICES = 1024 };

typedef float column __attribute__((vector_size(16), aligned(4)));

void pal_skin_free(pal_skin *skin)
{
    PAL_FREE(skin->frame, skin->frame_edge, skin->frame_rotation, skin->frame_rest, skin->fan_start, skin->fan,
             skin->near, skin->coef);
    memset(skin, 0, sizeof *skin);
}

/* sum of area-weighted normals of a fan and the sum of their squares */
static double fan_normal(const double *x, int node, const int32_t *fan, int n, double normal[3])
{
    const double *o = x + 3 * (size_t)node;
    double sum[3] = {0}, c[3], squares = 0;
    for (int i = 0; i < n; i++) {
        pal_normal3(c, o, x + 3 * (size_t)fan[2 * i], x + 3 * (size_t)fan[2 * i + 1]);
        pal_add3(sum, sum, c);
        squares += pal_dot3(c, c);
    }
    pal_copy3(normal, sum);
    return squares;
}

/* part of the edge from a to b normal to X */
static void tangential(const double a[3], const double b[3], const double X[3], double out[3])
{
    pal_sub3(out, b, a);
    pal_axpy3(out, -pal_dot3(out, X), X);
}

/* a over its length, or over SKIN_COLLAPSED times its rest length when that is more; returns the fraction of the
 * latter, at most 1. An axis without a rest length is 0. */
static double unit_or_less(double a[3], double rest)
{
    double length = pal_norm3(a), min = SKIN_COLLAPSED * rest;
    if (!(min > 0)) {
        pal_set3(a, 0, 0, 0);
        return 0;
    }
    pal_scale3(a, 1 / (length > min ? length : min), a);
    return length > min ? 1 : length / min;
}

/* boundary faces around every node, as sparse rows of their other two corners; MEMORY */
static pal_err node_fans(const pal_tets *tets, int32_t **start_out, int32_t **fan_out)
{
    const pal_surface boundary = {.n_vertex = tets->n_node, .n_tri = tets->n_face, .tri = tets->face};
    int32_t *start, *face, *fan;
    pal_err err = pal_surface_fans(&boundary, &start, &face);
    if (err) return err;
    PAL_ARRAY(&err, fan, 6 * (size_t)tets->n_face);
    for (int32_t i = 0; i < tets->n_node && !err; i++)
        for (int32_t k = start[i]; k < start[i + 1]; k++) {
            const int32_t *c = tets->face + 3 * (size_t)face[k];
            int at = c[0] == i ? 0 : c[1] == i ? 1 : 2;
            fan[2 * k] = c[(at + 1) % 3], fan[2 * k + 1] = c[(at + 2) % 3];
        }
    free(face);
    *start_out = start, *fan_out = fan;
    return err;
}

/* nodes that can carry a frame: on the surface, with a defined normal; all surface nodes if there are none */
static int find_candidates(const pal_tets *tets, const int32_t *start, const int32_t *fan, int32_t *candidate)
{
    int n = 0;
    for (int pass = 0; pass < 2 && n == 0; pass++)
        for (int i = 0; i < tets->n_node; i++) {
            double normal[3];
            int n_fan = start[i + 1] - start[i];
            if (n_fan == 0) continue;
            double squares = fan_normal(tets->x, i, fan + 2 * (size_t)start[i], n_fan, normal);
            if (pass == 1 || pal_dot3(normal, normal) > SKIN_MIN_NORMAL * SKIN_MIN_NORMAL * squares) candidate[n++] = i;
        }
    return n;
}

/* the five nearest candidates of every vertex into near, as nodes, and their weights into coef[..][3] */
static pal_err find_near(const pal_tets *tets, const int32_t *candidate, int n_candidate, const double *x,
                         pal_skin *skin)
{
    double *place = malloc((size_t)n_candidate * 3 * sizeof *place);
    if (!place) return PAL_ERR_MEMORY;
    for (int i = 0; i < n_candidate; i++) pal_copy3(place + 3 * (size_t)i, tets->x + 3 * (size_t)candidate[i]);
    pal_kd_tree *tree = NULL;
    pal_err err = pal_kd_tree_create(place, n_candidate, &tree);
    free(place);
    if (err) return err;
    double on_node2 = ON_NODE * ON_NODE * tets->edge_m * tets->edge_m;
    for (size_t v = 0; v < (size_t)skin->n_vertex; v++) {
        int32_t *index = skin->near + PAL_SKIN_NEIGHBOURS * v;
        double distance2[PAL_SKIN_NEIGHBOURS], weight[PAL_SKIN_NEIGHBOURS] = {0}, sum = 0;
        int n = pal_kd_tree_nearest(tree, x + 3 * v, PAL_SKIN_NEIGHBOURS, index, distance2);
        /* a vertex on a node has that node five times, once with all the weight */
        if (distance2[0] <= on_node2) n = 1;
        for (int k = n; k < PAL_SKIN_NEIGHBOURS; k++) index[k] = index[0];
        for (int k = 0; k < n; k++) sum += weight[k] = n == 1 ? 1 : distance2[0] / distance2[k];
        for (int k = 0; k < PAL_SKIN_NEIGHBOURS; k++) {
            skin->coef[4 * (PAL_SKIN_NEIGHBOURS * v + (size_t)k) + 3] = (float)(weight[k] / sum);
            index[k] = candidate[index[k]];
        }
    }
    pal_kd_tree_destroy(tree);
    return PAL_ERR_OK;
}

/* the two edges of a frame, the angle between them (B15) and the rest lengths */
static void choose_edges(const double *x, int node, const int32_t *fan, int n_fan, int32_t edge[2], float angle[2],
                         float rest[3])
{
    double normal[3], best = 0, second = 0, first_tangent[3] = {0}, second_tangent[3] = {0}, z[3];
    fan_normal(x, node, fan, n_fan, normal);
    edge[0] = fan[0], edge[1] = -1;
    angle[0] = 1, angle[1] = 0;
    rest[0] = (float)pal_norm3(normal);
    rest[1] = rest[2] = 0;
    if (!pal_unit3(normal, normal, 0)) return;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < 2 * n_fan; i++) {
            double t[3];
            tangential(x + 3 * (size_t)node, x + 3 * (size_t)fan[i], normal, t);
            double part = pal_norm3(t);
            if (pass == 0 && part > best * (1 + 1e-9)) {
                best = part, edge[0] = fan[i];
                pal_scale3(first_tangent, 1 / part, t);
            }
            /* the fallback must not be parallel to the first edge, which may have rotated onto X */
            if (pass == 1 && part > second * (1 + 1e-9) && fabs(pal_dot3(t, first_tangent)) < 0.9 * part) {
                second = part, edge[1] = fan[i];
                pal_scale3(second_tangent, 1 / part, t);
            }
        }
    rest[1] = (float)best;
    if (edge[1] < 0) return;
    pal_cross3(z, normal, second_tangent);
    angle[0] = (float)pal_dot3(first_tangent, second_tangent);
    angle[1] = (float)pal_dot3(first_tangent, z);
    rest[2] = (float)second;
}

/* numbers the nodes in use as frames, ascending, and gives each its fan and edges; place [n_node] is scratch */
static pal_err make_frames(const pal_tets *tets, const int32_t *start, const int32_t *fan, int32_t *place,
                           pal_skin *skin)
{
    size_t n_near = PAL_SKIN_NEIGHBOURS * (size_t)skin->n_vertex, n_fan = 0;
    int n_frame = 0;
    memset(place, 0, (size_t)tets->n_node * sizeof *place);
    for (size_t i = 0; i < n_near; i++) place[skin->near[i]] = 1;
    for (int i = 0; i < tets->n_node; i++) {
        if (place[i]) n_fan += (size_t)(start[i + 1] - start[i]);
        place[i] = place[i] ? n_frame++ : -1;
    }
    for (size_t i = 0; i < n_near; i++) skin->near[i] = place[skin->near[i]];

    pal_err err = PAL_ERR_OK;
    skin->n_frame = n_frame;
    PAL_ARRAY(&err, skin->frame, n_frame);
    PAL_ARRAY(&err, skin->frame_edge, 2 * n_frame);
    PAL_ARRAY(&err, skin->frame_rotation, 2 * n_frame);
    PAL_ARRAY(&err, skin->frame_rest, 3 * n_frame);
    PAL_ARRAY(&err, skin->fan_start, n_frame + 1);
    PAL_ARRAY(&err, skin->fan, 2 * n_fan);
    if (err) return err;
    skin->fan_start[0] = 0;
    for (int i = 0; i < tets->n_node; i++) {
        if (place[i] < 0) continue;
        size_t f = (size_t)place[i];
        int n = start[i + 1] - start[i];
        skin->frame[f] = i;
        memcpy(skin->fan + 2 * (size_t)skin->fan_start[f], fan + 2 * (size_t)start[i], 2 * (size_t)n * sizeof *fan);
        skin->fan_start[f + 1] = skin->fan_start[f] + n;
        choose_edges(tets->x, i, fan + 2 * (size_t)start[i], n, skin->frame_edge + 2 * f, skin->frame_rotation + 2 * f,
                     skin->frame_rest + 3 * f);
    }
    return PAL_ERR_OK;
}

/* offsets in the frames' axes at rest, times the weight */
static pal_err store_offsets(const pal_tets *tets, const double *x, pal_skin *skin)
{
    float *frames = calloc(skin->n_frame ? (size_t)skin->n_frame : 1, 64);
    if (!frames) return PAL_ERR_MEMORY;
    pal_skin_frames(skin, tets->x, NULL, frames);
    for (size_t v = 0; v < (size_t)skin->n_vertex; v++)
        for (size_t k = 0; k < PAL_SKIN_NEIGHBOURS; k++) {
            int32_t f = skin->near[PAL_SKIN_NEIGHBOURS * v + k];
            float *coef = skin->coef + 4 * (PAL_SKIN_NEIGHBOURS * v + k);
            double from_node[3];
            pal_sub3(from_node, x + 3 * v, tets->x + 3 * (size_t)skin->frame[f]);
            for (int axis = 0; axis < 3; axis++) {
                const float *a = frames + 16 * (size_t)f + 4 * axis;
                double along = (double)a[0] * from_node[0] + (double)a[1] * from_node[1] + (double)a[2] * from_node[2];
                coef[axis] = (float)((double)coef[3] * along);
            }
        }
    free(frames);
    return PAL_ERR_OK;
}

pal_err pal_skin_bind(const pal_tets *tets, const double *x, int n_vertex, pal_skin *out)
{
    if (tets->n_face == 0 || tets->n_node == 0) return PAL_ERR_REFUSED;
    pal_skin skin = {.n_vertex = n_vertex, .n_node = tets->n_node};
    pal_err err = PAL_ERR_OK;
    int32_t *start = NULL, *fan = NULL, *candidate;
    PAL_ARRAY(&err, candidate, tets->n_node);
    PAL_ARRAY(&err, skin.near, PAL_SKIN_NEIGHBOURS * (size_t)n_vertex);
    PAL_ZEROED(&err, skin.coef, 4 * PAL_SKIN_NEIGHBOURS * (size_t)n_vertex);
    if (!err) err = node_fans(tets, &start, &fan);
    if (!err) err = find_near(tets, candidate, find_candidates(tets, start, fan, candidate), x, &skin);
    if (!err) err = make_frames(tets, start, fan, candidate, &skin);
    if (!err) err = store_offsets(tets, x, &skin);
    PAL_FREE(start, fan, candidate);
    if (err)
        pal_skin_free(&skin);
    else
        *out = skin;
    return err;
}

/* Y from the first edge; as far as that has collapsed, from the second turned by its angle at rest */
static void frame_edge(const pal_skin *skin, size_t f, const double *x, const double X[3], double Y[3])
{
    const double *o = x + 3 * (size_t)skin->frame[f];
    const int32_t *edge = skin->frame_edge + 2 * f;
    tangential(o, x + 3 * (size_t)edge[0], X, Y);
    double share = unit_or_less(Y, (double)skin->frame_rest[3 * f + 1]);
    if (share == 1 || edge[1] < 0) return;
    double t[3], z[3], c = (double)skin->frame_rotation[2 * f], s = (double)skin->frame_rotation[2 * f + 1];
    tangential(o, x + 3 * (size_t)edge[1], X, t);
    unit_or_less(t, (double)skin->frame_rest[3 * f + 2]);
    pal_cross3(z, X, t);
    for (int k = 0; k < 3; k++) Y[k] += (1 - share) * (c * t[k] + s * z[k]);
}

static void update_frame(const pal_skin *skin, size_t f, const double *x, float *frames)
{
    double X[3], Y[3], Z[3];
    const double *o = x + 3 * (size_t)skin->frame[f];
    float *to = frames + 16 * f;
    int32_t a = skin->fan_start[f], n = skin->fan_start[f + 1] - a;
    for (int k = 0; k < 3; k++) to[12 + k] = (float)o[k];
    fan_normal(x, skin->frame[f], skin->fan + 2 * (size_t)a, n, X);
    unit_or_less(X, (double)skin->frame_rest[3 * f]);
    frame_edge(skin, f, x, X, Y);
    pal_cross3(Z, X, Y);
    double sum = X[0] + X[1] + X[2] + Y[0] + Y[1] + Y[2];
    if (!(fabs(sum) < 1e30)) return;
    for (int k = 0; k < 3; k++) to[k] = (float)X[k], to[4 + k] = (float)Y[k], to[8 + k] = (float)Z[k];
}

typedef struct pass {
    const pal_skin *skin;
    const double *x;
    float *frames;           /* written by update_frames */
    const float *shown_from; /* frames that evaluate_vertices reads */
    float *out;
} pass;

static void update_frames(void *user, int worker, int index)
{
    const pass *p = user;
    const int first = index * SKIN_FRAMES, end = first + SKIN_FRAMES;
    (void)worker;
    for (int f = first; f < end && f < p->skin->n_frame; f++) update_frame(p->skin, (size_t)f, p->x, p->frames);
}

void pal_skin_frames(const pal_skin *skin, const double *x, pal_team *team, void *frames)
{
    pass p = {.skin = skin, .x = x, .frames = frames};
    pal_team_run(team, (skin->n_frame + SKIN_FRAMES - 1) / SKIN_FRAMES, update_frames, &p);
}

void pal_skin_frames_of(const pal_skin *skin, const double *x, const int32_t *list, int n, void *frames)
{
    for (int i = 0; i < n; i++) update_frame(skin, (size_t)list[i], x, frames);
}

static void evaluate_vertices(void *user, int worker, int index)
{
    const pass *p = user;
    const size_t first = (size_t)index * SKIN_VERTICES, n = (size_t)p->skin->n_vertex;
    const size_t end = first + SKIN_VERTICES < n ? first + SKIN_VERTICES : n;
    (void)worker;
    for (size_t v = first; v < end; v++) {
        const int32_t *near = p->skin->near + PAL_SKIN_NEIGHBOURS * v;
        const float *c = p->skin->coef + 4 * PAL_SKIN_NEIGHBOURS * v;
        column X = {0}, Y = {0}, Z = {0}, P = {0};
        for (int k = 0; k < PAL_SKIN_NEIGHBOURS; k++, c += 4) {
            const column *axes = (const column *)(p->shown_from + 16 * (size_t)near[k]);
            X += axes[0] * c[0];
            Y += axes[1] * c[1];
            Z += axes[2] * c[2];
            P += axes[3] * c[3];
        }
        P += X + Y + Z;
        p->out[3 * v] = P[0], p->out[3 * v + 1] = P[1], p->out[3 * v + 2] = P[2];
    }
}

void pal_skin_evaluate(const pal_skin *skin, const void *frames, pal_team *team, float *out)
{
    pass p = {.skin = skin, .shown_from = frames, .out = out};
    pal_team_run(team, (skin->n_vertex + SKIN_VERTICES - 1) / SKIN_VERTICES, evaluate_vertices, &p);
}

void pal_skin_vertex(const pal_skin *skin, const double *x, const void *frames, int vertex, double out[3])
{
    double sum[3] = {0};
    for (size_t k = 0; k < PAL_SKIN_NEIGHBOURS; k++) {
        size_t i = PAL_SKIN_NEIGHBOURS * (size_t)vertex + k, f = (size_t)skin->near[i];
        const float *axes = (const float *)frames + 16 * f, *c = skin->coef + 4 * i;
        pal_axpy3(sum, (double)c[3], x + 3 * (size_t)skin->frame[f]);
        for (int axis = 0; axis < 3; axis++)
            for (int d = 0; d < 3; d++) sum[d] += (double)c[axis] * (double)axes[4 * axis + d];
    }
    pal_copy3(out, sum);
}
