/* Lists that follow from the state of an adaptive surface: leaves, springs, nodes, masses, triangles (C, adjustment of
 * physical properties, eq. 6-8; figs. 3 and 4).
 *
 * One walk from the faces of level 0 down through split ones, so the cost follows the active part. Faces of a level are
 * met in ascending order; a midpoint is listed by the first split face beside its edge, a spring by the first leaf.
 * Nodes are then brought into the order of slabs across the longest axis, so that neighbours are near in memory and
 * threads can share them (active_nodes.h).
 *
 * Departures: masses are rescaled so that their sum is M (erratum C5); the law for springs is a choice (C4). */
#include "server/sim/surface/adaptive_surface.h"

#include "server/base/vec3.h"

#include <math.h>
#include <string.h>

typedef struct walk {
    pal_adaptive_surface *s;
    double level_share[PAL_LEVELS_MAX]; /* paper's law */
    bool changed;
} walk;

static void write_slot(pal_adaptive_surface *s, int32_t slot, const int32_t tri[3])
{
    int32_t *at = s->slot + 3 * (size_t)slot;
    if (at[0] == tri[0] && at[1] == tri[1] && at[2] == tri[2]) return;
    memcpy(at, tri, 3 * sizeof *at);
    s->log[s->n_log++ % (uint64_t)s->n_log_room] = slot;
}

void pal_adaptive_clear_slots(pal_adaptive_surface *s, int32_t first, int32_t n)
{
    static const int32_t none[3];
    for (int32_t k = 0; k < n; k++) write_slot(s, first + k, none);
}

int pal_adaptive_triangles(const pal_adaptive_surface *s, int32_t leaf, int32_t tri[4][3])
{
    const pal_levels *l = &s->levels;
    const int32_t *c = l->face + 3 * (size_t)leaf, *side = l->face_edge + 3 * (size_t)leaf;
    int32_t mid[3];
    int n = 0, a = 0;
    for (int k = 0; k < 3; k++) {
        mid[k] = s->edge_split[side[k]] ? pal_levels_edge_midpoint(l, side[k]) : -1;
        n += mid[k] >= 0;
    }
#define TRI(i, p, q, r) (tri[i][0] = (p), tri[i][1] = (q), tri[i][2] = (r))
    switch (n) {
    case 0:
        TRI(0, c[0], c[1], c[2]);
        break;
    case 1: /* across from the hanging node on side a */
        while (mid[a] < 0) a++;
        TRI(0, c[a], mid[a], c[(a + 2) % 3]);
        TRI(1, mid[a], c[(a + 1) % 3], c[(a + 2) % 3]);
        break;
    case 2: { /* on sides a and b meeting in a corner, which is cut off; the rest by its shorter diagonal at rest */
        while (mid[(a + 2) % 3] >= 0) a++;
        int b = (a + 1) % 3, far = (a + 2) % 3;
        const double *x = l->x;
        TRI(0, mid[a], c[b], mid[b]);
        if (pal_dist3(x + 3 * (size_t)mid[a], x + 3 * (size_t)c[far]) <=
            pal_dist3(x + 3 * (size_t)c[a], x + 3 * (size_t)mid[b])) {
            TRI(1, c[a], mid[a], c[far]);
            TRI(2, mid[a], mid[b], c[far]);
        } else {
            TRI(1, c[a], mid[a], mid[b]);
            TRI(2, c[a], mid[b], c[far]);
        }
        break;
    }
    default:
        for (int k = 0; k < 3; k++) TRI(k, c[k], mid[k], mid[(k + 2) % 3]);
        TRI(3, mid[0], mid[1], mid[2]);
        break;
    }
#undef TRI
    return n + 1;
}

static void add_springs(walk *w, int32_t f, int level)
{
    pal_adaptive_surface *s = w->s;
    const pal_levels *l = &s->levels;
    for (int k = 0; k < 3; k++) {
        int32_t e = l->face_edge[3 * (size_t)f + (size_t)k];
        if (s->edge_split[e]) continue;
        const int32_t *beside = l->edge[e].face;
        int32_t other = beside[beside[0] == f];
        int state = other < 0 ? -1 : s->face_state[other];
        if (state == PAL_FACE_LEAF && other < f) continue;
        /* halves: this leaf's 1, and 1 of a like neighbour, 2 of a coarser one, none of a hole */
        int halves = 1 + (state == PAL_FACE_LEAF ? 1 : state == PAL_FACE_ABSENT ? 2 : 0);
        s->spring[s->n_spring] = e;
        s->spring_share[s->n_spring++] =
            (float)(s->options.law == PAL_ADAPTIVE_MEMBRANE ? 0.5 * halves : w->level_share[level]);
    }
}

static void add_triangles(pal_adaptive_surface *s, int32_t f, int level)
{
    /* a leaf has as many slots as it can have triangles, so all of them fit into the list */
    int32_t(*tri)[3] = (int32_t(*)[3])(s->tri + 3 * (size_t)s->n_tri);
    int n = pal_adaptive_triangles(s, f, tri), up = 2 * (s->levels.n_level - 1 - level);
    int32_t first = (f - s->levels.first_face[level]) << up;
    s->n_tri += n;
    for (int k = 0; k < n; k++) write_slot(s, first + k, tri[k]);
    if (up) pal_adaptive_clear_slots(s, first + n, 4 - n);
}

static void visit(walk *w, int32_t f, int level)
{
    pal_adaptive_surface *s = w->s;
    const pal_levels *l = &s->levels;
    if (s->face_state[f] == PAL_FACE_LEAF) {
        w->changed = w->changed || s->leaf[s->n_leaf] != f;
        s->leaf[s->n_leaf++] = f;
        s->n_leaf_of[level]++;
        if (level > s->finest) s->finest = level;
        add_springs(w, f, level);
        add_triangles(s, f, level);
        return;
    }
    for (int k = 0; k < 3; k++) {
        int32_t e = l->face_edge[3 * (size_t)f + (size_t)k];
        const int32_t *beside = l->edge[e].face;
        int32_t other = beside[beside[0] == f];
        if (other >= 0 && other < f && s->face_state[other] == PAL_FACE_SPLIT) continue;
        s->node[s->n_node++] = l->n_vertex[level] + (e - l->first_edge[level]);
    }
    int32_t child = l->first_face[level + 1] + 4 * (f - l->first_face[level]);
    for (int k = 0; k < 4; k++) visit(w, child + k, level + 1);
}

/* sum with the rounding carried along (Kahan, Neumaier) */
static double sum_mass(const pal_adaptive_surface *s, const double *mass_kg)
{
    double sum = 0, rest = 0;
    for (int k = 0; k < s->n_node; k++) {
        double m = mass_kg[s->node[k]], t = sum + m;
        rest += sum - t + m;
        sum = t;
    }
    return sum + rest;
}

/* a triangle with all corners of its leaf is the whole of it, one with two of them half, any other a quarter */
static void mass_of_faces(const pal_adaptive_surface *s, double *mass_kg)
{
    const pal_levels *l = &s->levels;
    for (int k = 0; k < s->n_leaf; k++) {
        int level = l->face_level[s->leaf[k]];
        double third = s->options.mass_kg / pal_levels_n_face(l, level) / 3;
        int32_t tri[4][3];
        for (int n = pal_adaptive_triangles(s, s->leaf[k], tri) - 1; n >= 0; n--) {
            int n_corner = 0;
            for (int c = 0; c < 3; c++) n_corner += l->vertex_level[tri[n][c]] <= level;
            double m = third * (n_corner == 3 ? 1 : n_corner == 2 ? 0.5 : 0.25);
            for (int c = 0; c < 3; c++) mass_kg[tri[n][c]] += m;
        }
    }
}

/* paper C eq. 7 */
static void mass_of_nodes(const pal_adaptive_surface *s, double *mass_kg)
{
    const pal_levels *l = &s->levels;
    for (int k = 0; k < s->n_node; k++) s->n_beside[s->node[k]] = 0;
    for (int k = 0; k < s->n_spring; k++) {
        int32_t e = s->spring[k];
        double m = s->level_mass_kg[l->edge_level[e]];
        for (int end = 0; end < 2; end++) {
            int32_t v = l->edge[e].vertex[end];
            mass_kg[v] += m, s->n_beside[v]++;
        }
    }
    for (int k = 0; k < s->n_node; k++) mass_kg[s->node[k]] /= s->n_beside[s->node[k]];
}

/* and erratum C5 */
static void share_mass(pal_adaptive_surface *s, double *mass_kg)
{
    for (int k = 0; k < s->n_node; k++) mass_kg[s->node[k]] = 0;
    if (s->options.mass == PAL_MASS_BY_FACES)
        mass_of_faces(s, mass_kg);
    else
        mass_of_nodes(s, mass_kg);
    s->mass_scale = s->options.mass_kg / sum_mass(s, mass_kg);
    for (int k = 0; k < s->n_node; k++) mass_kg[s->node[k]] *= s->mass_scale;
}

/* origin of the rigid fit */
static void find_rest_centre(pal_adaptive_surface *s, const pal_body *body)
{
    double c[3] = {0, 0, 0}, square = 0;
    for (int k = 0; k < s->n_node; k++) pal_axpy3(c, body->mass_kg[s->node[k]], body->x_rest + 3 * (size_t)s->node[k]);
    pal_scale3(c, 1 / s->options.mass_kg, c);
    for (int k = 0; k < s->n_node; k++) {
        double d[3];
        pal_sub3(d, body->x_rest + 3 * (size_t)s->node[k], c);
        square += body->mass_kg[s->node[k]] * pal_dot3(d, d);
    }
    pal_copy3(s->rest_centre_m, c);
    s->rest_kg_m2 = square;
}

/* brings the nodes into the order of their slabs; within a slab they stay as the walk has met them */
static void sort_nodes(pal_adaptive_surface *s)
{
    int first[PAL_ADAPTIVE_SLABS + 1] = {0};
    int32_t *met = s->n_beside;
    memcpy(met, s->node, sizeof *met * (size_t)s->n_node);
    for (int k = 0; k < s->n_node; k++) first[s->slab[met[k]] + 1]++;
    for (int b = 0; b < PAL_ADAPTIVE_SLABS; b++) first[b + 1] += first[b];
    for (int k = 0; k < s->n_node; k++) s->node[first[s->slab[met[k]]]++] = met[k];
}

bool pal_adaptive_update(pal_adaptive_surface *s, pal_body *body)
{
    if (!s->stale) return false;
    const pal_levels *l = &s->levels;
    walk w = {.s = s};
    int n_leaf = s->n_leaf;
    for (int k = 0; k < l->n_level; k++)
        w.level_share[k] = ldexp(s->level_mass_kg[k] / s->level_mass_kg[0], k); /* paper C, eq. 8 */
    memset(s->n_leaf_of, 0, sizeof s->n_leaf_of);
    s->n_leaf = s->n_spring = s->n_tri = s->finest = 0;
    s->n_node = l->n_vertex[0];
    for (int32_t v = 0; v < l->n_vertex[0]; v++) s->node[v] = v;
    for (int32_t f = 0; f < l->first_face[1]; f++) visit(&w, f, 0);
    sort_nodes(s);
    s->stale = false;
    PAL_ASSERT(s->n_node == s->n_live);
    body->n_active = s->n_node;
    s->surface.n_tri = s->n_tri;
    share_mass(s, body->mass_kg);
    find_rest_centre(s, body);
    pal_adaptive_fill_dofs(s, body);
    if (!w.changed && n_leaf == s->n_leaf) return false;
    s->revision++;
    body->display.revision++;
    return true;
}
