/* A factor of the stiff parts of a body. */
#include "server/sim/implicit/stiff_nodes.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/sim/implicit/tuning.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- which nodes ---- */

/* mu of the material of a lane, in any unit; 0: a lane without element */
static float stiffness(const pal_elastic_hexes_single *single, int lane)
{
    const pal_elastic_hexes *cubes = single->cubes;
    if (cubes->hex[lane] < 0 || !(cubes->share[lane] > 0)) return 0;
    return single->stiff[2 * (lane - lane % PAL_LANES) + lane % PAL_LANES] / (float)cubes->share[lane];
}

/* above which an element is stiff */
static float threshold(const pal_elastic_hexes_single *single)
{
    float low = INFINITY;
    for (int l = 0; l < PAL_LANES * single->cubes->n_block; l++) {
        const float mu = stiffness(single, l);
        if (mu > 0 && mu < low) low = mu;
    }
    return PAL_STIFF_CONTRAST * low;
}

/* 1 at the corners of stiff elements, but for held ones; returns their number, 0 if they are too many */
static int mark(const pal_body *body, const pal_elastic_hexes_single *single, uint8_t *stiff)
{
    const pal_elastic_hexes *cubes = single->cubes;
    const float above = threshold(single);
    int n = 0;
    memset(stiff, 0, (size_t)body->n_node);
    for (int l = 0; l < PAL_LANES * cubes->n_block; l++) {
        if (!(stiffness(single, l) > above)) continue;
        const int32_t *node = body->hexes->node + 8 * cubes->hex[l];
        for (int c = 0; c < 8; c++) {
            n += !stiff[node[c]] && !body->support[node[c]];
            stiff[node[c]] = !body->support[node[c]];
        }
    }
    return n <= PAL_MULTIGRID_NODES ? n : 0;
}

static bool is_same(const pal_stiff_nodes *s, const uint8_t *stiff, int n)
{
    bool same = s->n == n;
    for (int k = 0; k < n && same; k++) same = stiff[s->node[k]];
    return same;
}

static bool has_changed(const pal_stiff_nodes *s, const uint8_t *changed)
{
    bool has = false;
    for (int k = 0; k < s->n && !has; k++) has = changed[s->node[k]];
    return has;
}

/* ---- pattern ---- */

static int stiff_corners(const pal_stiff_nodes *s, const int32_t *node, int32_t *to)
{
    int n = 0;
    for (int c = 0; c < 8; c++)
        if (s->place[node[c]] >= 0) to[n++] = s->place[node[c]];
    return n;
}

static pal_err make_pattern(pal_stiff_nodes *s, const pal_body *body)
{
    const pal_hexes *hexes = body->hexes;
    int32_t *node;
    int n = 0;
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, node, 8 * (size_t)hexes->n_hex);
    if (err) return err;
    for (int e = 0; e < hexes->n_hex; e++) {
        int32_t *to = node + 8 * n;
        const int n_corner = stiff_corners(s, hexes->node + 8 * e, to);
        if (n_corner < 2) continue;
        for (int c = n_corner; c < 8; c++) to[c] = to[0];
        n++;
    }
    const pal_cliques list = {.n_item = n, .n_corner = 8, .node = node};
    err = pal_block_matrix_make(s->n, &list, 1, s->arena, &s->blocks);
    free(node);
    return err;
}

static pal_err make(pal_stiff_nodes *s, const pal_body *body, const uint8_t *stiff, int n)
{
    s->arena = pal_arena_create(1 << 16, true);
    if (!s->arena) return PAL_ERR_MEMORY;
    s->n = n;
    s->node = PAL_NEW(s->arena, int32_t, n), s->place = PAL_NEW(s->arena, int32_t, body->n_node);
    if (!s->node || !s->place || !PAL_NEW_DOUBLES(s->arena, 3 * (size_t)n, &s->v)) return PAL_ERR_MEMORY;
    for (int i = 0, k = 0; i < body->n_node; i++) {
        s->place[i] = stiff[i] ? k : -1;
        if (stiff[i]) s->node[k++] = i;
    }
    PAL_TRY(make_pattern(s, body));
    return pal_cholesky_create(&s->blocks, NULL, &s->factor);
}

/* ---- values ---- */

static void add_block(pal_stiff_nodes *s, int i, int j, double k[24][24], int c, int d)
{
    if (i < j) return;
    double *to = s->blocks.value + 9 * (size_t)pal_block_matrix_find(&s->blocks, i, j);
    for (int r = 0; r < 3; r++)
        for (int m = 0; m < 3; m++) to[3 * r + m] += k[3 * c + r][3 * d + m];
}

static void fill(pal_stiff_nodes *s, const pal_body *body, const pal_elastic_hexes_single *single,
                 const float *rotation, const float *weight, double stiff)
{
    pal_block_matrix_zero(&s->blocks);
    for (int e = 0; e < body->hexes->n_hex; e++) {
        const int32_t *node = body->hexes->node + 8 * e;
        int32_t to[8];
        double k[24][24];
        if (stiff_corners(s, node, to) == 0) continue;
        pal_hex_single_element(single, rotation, e, stiff, k);
        for (int c = 0; c < 8; c++)
            for (int d = 0; d < 8; d++)
                if (s->place[node[c]] >= 0 && s->place[node[d]] >= 0)
                    add_block(s, s->place[node[c]], s->place[node[d]], k, c, d);
    }
    for (int k = 0; k < s->n; k++) {
        double *to = s->blocks.value + 9 * (size_t)s->blocks.start[k];
        const double mass = (double)weight[body->node_order->slot[s->node[k]]];
        for (int i = 0; i < 9; i += 4) to[i] += mass;
    }
}

pal_err pal_stiff_nodes_update(pal_stiff_nodes *s, const pal_body *body, const pal_elastic_hexes_single *single,
                               const float *rotation, const float *weight, double stiff, const uint8_t *changed)
{
    uint8_t *marked;
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, marked, (size_t)body->n_node);
    if (err) return err;
    const int n = mark(body, single, marked);
    const bool same = is_same(s, marked, n);
    if (!same) {
        pal_stiff_nodes_destroy(s);
        if (n > 0) err = make(s, body, marked, n);
    }
    free(marked);
    if (!err && n > 0 && (!same || has_changed(s, changed))) {
        fill(s, body, single, rotation, weight, stiff);
        err = pal_cholesky_factor(s->factor, &s->blocks, true);
    }
    if (err) pal_stiff_nodes_destroy(s);
    return err;
}

void pal_stiff_nodes_destroy(pal_stiff_nodes *s)
{
    pal_cholesky_destroy(s->factor);
    pal_arena_destroy(s->arena);
    *s = (pal_stiff_nodes){.n = 0};
}

/* ---- solves ---- */

/* to = W' v, or W v */
static void turn(const pal_warp *warp, int i, const double v[3], bool back, double to[3])
{
    const float *w = warp->w + 9 * i;
    memcpy(to, v, 3 * sizeof *to);
    for (int c = 0; c < 3 && warp->rotated; c++) {
        const float *a = back ? w + c : w + 3 * c;
        const int step = back ? 3 : 1;
        to[c] = (double)a[0] * v[0] + (double)a[step] * v[1] + (double)a[2 * step] * v[2];
    }
}

void pal_stiff_nodes_correct(pal_stiff_nodes *s, const pal_body *body, const pal_warp *warp, int n_slot, const float *b,
                             const float *q, float *x)
{
    for (int k = 0; k < s->n; k++) {
        double r[3];
        for (int c = 0; c < 3; c++) {
            const size_t at = (size_t)body->node_order->slot[s->node[k]] + (size_t)c * (size_t)n_slot;
            r[c] = (double)(b[at] - q[at]);
        }
        turn(warp, s->node[k], r, true, s->v + 3 * k);
    }
    if (pal_cholesky_solve(s->factor, s->v, s->v)) return;
    for (int k = 0; k < s->n; k++) {
        double v[3];
        turn(warp, s->node[k], s->v + 3 * k, false, v);
        for (int c = 0; c < 3; c++)
            x[(size_t)body->node_order->slot[s->node[k]] + (size_t)c * (size_t)n_slot] += (float)v[c];
    }
}
