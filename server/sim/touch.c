/* Contact points of the shown surface: sampling, collection, evaluation, and forces back to the nodes. */
#include "server/sim/touch.h"

#include "server/base/vec3.h"

#include <math.h>
#include <string.h>

/* largest correction for torque, as a share of the largest node force: where the nodes are nearly in line the rotation
 * field would have to be large, and a little torque is given up instead */
#define MOST_TURN_SHARE 1.0

static double longest_edge(const pal_surface *surface, int tri)
{
    const int32_t *corner = surface->tri + 3 * (size_t)tri;
    double longest = 0;
    for (int k = 0; k < 3; k++) {
        const double *a = surface->x + 3 * (size_t)corner[k], *b = surface->x + 3 * (size_t)corner[(k + 1) % 3];
        longest = fmax(longest, pal_dist3(a, b));
    }
    return longest;
}

static int cuts(const pal_surface *surface, int tri, double spacing_m)
{
    double n = ceil(longest_edge(surface, tri) / spacing_m);
    return n < 2 ? 1 : (int)fmin(n, 1000);
}

static int64_t count_samples(const pal_surface *surface, double spacing_m)
{
    int64_t n = 0;
    for (int t = 0; t < surface->n_tri; t++) {
        int64_t c = cuts(surface, t, spacing_m);
        if (c > 1) n += c * c;
    }
    return n;
}

static double tri_area(const pal_surface *surface, int tri)
{
    const int32_t *corner = surface->tri + 3 * (size_t)tri;
    double e[3], f[3];
    const double *a = surface->x + 3 * (size_t)corner[0];
    pal_sub3(e, surface->x + 3 * (size_t)corner[1], a);
    pal_sub3(f, surface->x + 3 * (size_t)corner[2], a);
    pal_cross3(e, e, f);
    return 0.5 * pal_norm3(e);
}

/* centroids of the n^2 equal triangles that a triangle cut into n parts an edge has */
static int sample(int32_t *corner_out, float *share_out, const int32_t *corner, int n)
{
    int k = 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n - i; j++)
            for (int half = 0; half < 2 && (half == 0 || j < n - i - 1); half++) {
                double third = half ? 2.0 / 3 : 1.0 / 3, u = (i + third) / n, w = (j + third) / n;
                memcpy(corner_out + 3 * (size_t)k, corner, 3 * sizeof *corner);
                float *share = share_out + 3 * (size_t)k++;
                share[0] = (float)(1 - u - w), share[1] = (float)u, share[2] = (float)w;
            }
    return k;
}

static pal_err allocate(const pal_body *body, pal_arena *arena, int n_sample, pal_touch *t)
{
    size_t n_vertex = (size_t)body->n_shown, n_node = (size_t)body->n_node;
    size_t n_frame = body->skin ? (size_t)body->skin->n_frame : 0;
    t->corner = PAL_NEW(arena, int32_t, 3 * (size_t)n_sample);
    t->share = PAL_NEW(arena, float, 3 * (size_t)n_sample);
    t->area_m2 = PAL_NEW(arena, double, t->n_point);
    t->live = PAL_NEW(arena, int32_t, n_vertex);
    t->frame = PAL_NEW(arena, int32_t, n_frame);
    t->live_mark = PAL_NEW(arena, uint32_t, n_vertex);
    t->frame_mark = PAL_NEW(arena, uint32_t, n_frame);
    t->x = PAL_NEW(arena, double, 3 * n_vertex);
    t->v = PAL_NEW(arena, double, 3 * n_vertex);
    t->node = PAL_NEW(arena, int32_t, n_node);
    t->row_node = PAL_NEW(arena, int32_t, n_node);
    t->node_mark = PAL_NEW(arena, uint32_t, n_node);
    t->row_mark = PAL_NEW(arena, uint32_t, n_node);
    t->force = PAL_NEW(arena, double, 3 * n_node);
    t->row = PAL_NEW(arena, double, n_node);
    bool all = t->corner && t->share && t->area_m2 && t->live && t->frame && t->live_mark && t->frame_mark && t->x &&
               t->v && t->node && t->row_node && t->node_mark && t->row_mark && t->force && t->row;
    return all ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_touch_make(const pal_body *body, double spacing_m, int most_sample, pal_arena *arena, pal_touch *out)
{
    const pal_surface *surface = body->surface;
    if (!surface || body->n_shown <= 0 || surface->n_vertex != body->n_shown || !(spacing_m > 0))
        return PAL_ERR_REFUSED;
    int64_t n_sample = count_samples(surface, spacing_m);
    while (n_sample > most_sample) {
        spacing_m *= 1.25;
        n_sample = count_samples(surface, spacing_m);
    }
    pal_touch t = {.n_vertex = body->n_shown, .n_point = body->n_shown + (int)n_sample};
    PAL_TRY(allocate(body, arena, (int)n_sample, &t));
    int k = 0;
    for (int i = 0; i < surface->n_tri; i++) {
        const int32_t *corner = surface->tri + 3 * (size_t)i;
        double area = tri_area(surface, i);
        int n = cuts(surface, i, spacing_m);
        if (n == 1) {
            for (int c = 0; c < 3; c++) t.area_m2[corner[c]] += area / 3;
            continue;
        }
        int made = sample(t.corner + 3 * (size_t)k, t.share + 3 * (size_t)k, corner, n);
        for (int j = 0; j < made; j++) t.area_m2[t.n_vertex + k + j] = area / made;
        k += made;
    }
    *out = t;
    return PAL_ERR_OK;
}

void pal_touch_begin(pal_touch *touch)
{
    touch->mark++;
    touch->n_live = touch->n_frame = 0;
}

static void make_live(pal_touch *touch, const pal_body *body, int vertex)
{
    if (touch->live_mark[vertex] == touch->mark) return;
    touch->live_mark[vertex] = touch->mark;
    touch->live[touch->n_live++] = vertex;
    if (!body->skin) return;
    const int32_t *near = body->skin->near + PAL_SKIN_NEAR * (size_t)vertex;
    for (int k = 0; k < PAL_SKIN_NEAR; k++)
        if (touch->frame_mark[near[k]] != touch->mark) {
            touch->frame_mark[near[k]] = touch->mark;
            touch->frame[touch->n_frame++] = near[k];
        }
}

/* squared distance from p to the segment a + t ab, t in [0, 1] */
static inline double distance2(const double p[3], const double a[3], const double ab[3], double per_ab2)
{
    double x = p[0] - a[0], y = p[1] - a[1], z = p[2] - a[2];
    double t = (x * ab[0] + y * ab[1] + z * ab[2]) * per_ab2;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    x -= t * ab[0], y -= t * ab[1], z -= t * ab[2];
    return x * x + y * y + z * z;
}

int pal_touch_collect(pal_touch *touch, const pal_body *body, const double a[3], const double b[3], double reach_m,
                      int32_t *list, double *nearest_m)
{
    double ab[3], nearest2 = reach_m * reach_m, reach2 = nearest2;
    pal_sub3(ab, b, a);
    double ab2 = pal_dot3(ab, ab), per_ab2 = ab2 > 0 ? 1 / ab2 : 0;
    float low[3], high[3];
    for (int c = 0; c < 3; c++) {
        low[c] = (float)(fmin(a[c], b[c]) - reach_m);
        high[c] = (float)(fmax(a[c], b[c]) + reach_m);
    }
    int n = 0;
    const float *s = body->shown;
    for (int i = 0; i < touch->n_vertex; i++, s += 3) {
        if (!((s[0] >= low[0]) & (s[0] <= high[0]) & (s[1] >= low[1]) & (s[1] <= high[1]) & (s[2] >= low[2]) &
              (s[2] <= high[2])))
            continue;
        double p[3] = {(double)s[0], (double)s[1], (double)s[2]}, d2 = distance2(p, a, ab, per_ab2);
        if (!(d2 <= reach2)) continue;
        nearest2 = fmin(nearest2, d2);
        make_live(touch, body, i);
        list[n++] = i;
    }
    for (int i = touch->n_vertex; i < touch->n_point; i++) {
        const int32_t *corner = touch->corner + 3 * (size_t)(i - touch->n_vertex);
        const float *share = touch->share + 3 * (size_t)(i - touch->n_vertex);
        double p[3] = {0};
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++)
                p[c] += (double)share[k] * (double)body->shown[3 * (size_t)corner[k] + (size_t)c];
        double d2 = distance2(p, a, ab, per_ab2);
        if (!(d2 <= reach2)) continue;
        nearest2 = fmin(nearest2, d2);
        for (int k = 0; k < 3; k++) make_live(touch, body, corner[k]);
        list[n++] = i;
    }
    *nearest_m = sqrt(nearest2);
    return n;
}

int pal_touch_nodes(const pal_body *body, int vertex, int32_t *node, double *weight)
{
    if (!body->skin) {
        node[0] = body->shown_node[vertex];
        weight[0] = 1;
        return 1;
    }
    const pal_skin *skin = body->skin;
    double sum = 0;
    int n = 0;
    for (size_t k = PAL_SKIN_NEAR * (size_t)vertex; k < PAL_SKIN_NEAR * ((size_t)vertex + 1); k++) {
        if (skin->coef[4 * k + 3] == 0) continue;
        node[n] = skin->frame[skin->near[k]];
        sum += weight[n++] = (double)skin->coef[4 * k + 3];
    }
    for (int k = 0; k < n; k++) weight[k] /= sum;
    return n;
}

void pal_touch_update(pal_touch *touch, const pal_body *body)
{
    if (body->skin) pal_skin_frames_of(body->skin, body->d, touch->frame, touch->n_frame, body->skin_axes);
    for (int i = 0; i < touch->n_live; i++) {
        int vertex = touch->live[i];
        double *x = touch->x + 3 * (size_t)vertex, *v = touch->v + 3 * (size_t)vertex;
        int32_t node[PAL_SKIN_NEAR];
        double weight[PAL_SKIN_NEAR];
        int n = pal_touch_nodes(body, vertex, node, weight);
        if (body->skin)
            pal_skin_vertex(body->skin, body->d, body->skin_axes, vertex, x);
        else
            pal_copy3(x, body->d + 3 * (size_t)node[0]);
        pal_set3(v, 0, 0, 0);
        for (int k = 0; k < n; k++) pal_axpy3(v, weight[k], body->dv + 3 * (size_t)node[k]);
    }
}

/* corners of a point and their shares; returns how many */
static int corners(const pal_touch *touch, int point, int32_t *vertex, double *share)
{
    if (point < touch->n_vertex) {
        vertex[0] = point;
        share[0] = 1;
        return 1;
    }
    size_t k = 3 * (size_t)(point - touch->n_vertex);
    for (size_t c = 0; c < 3; c++) {
        vertex[c] = touch->corner[k + c];
        share[c] = (double)touch->share[k + c];
    }
    share[0] = 1 - share[1] - share[2];
    return 3;
}

static void blend(const pal_touch *touch, int point, const double *from, double out[3])
{
    int32_t vertex[3];
    double share[3], sum[3] = {0};
    int n = corners(touch, point, vertex, share);
    for (int k = 0; k < n; k++) pal_axpy3(sum, share[k], from + 3 * (size_t)vertex[k]);
    pal_copy3(out, sum);
}

void pal_touch_point(const pal_touch *touch, int point, double x[3])
{
    blend(touch, point, touch->x, x);
}

void pal_touch_velocity(const pal_touch *touch, int point, double v[3])
{
    blend(touch, point, touch->v, v);
}

bool pal_touch_nearest(const pal_touch *touch, const pal_body *body, const double p[3], int *vertex, double normal[3])
{
    double best = INFINITY;
    *vertex = -1;
    for (int i = 0; i < touch->n_vertex; i++) {
        const float *s = body->shown + 3 * (size_t)i;
        double x = (double)s[0] - p[0], y = (double)s[1] - p[1], z = (double)s[2] - p[2];
        double d2 = x * x + y * y + z * z;
        if (d2 < best) best = d2, *vertex = i;
    }
    if (*vertex < 0) return false;
    double sum[3] = {0};
    for (size_t t = 0; t < 3 * (size_t)body->surface->n_tri; t += 3) {
        const int32_t *corner = body->surface->tri + t;
        if (corner[0] != *vertex && corner[1] != *vertex && corner[2] != *vertex) continue;
        double a[3][3];
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++) a[k][c] = (double)body->shown[3 * (size_t)corner[k] + (size_t)c];
        pal_sub3(a[1], a[1], a[0]);
        pal_sub3(a[2], a[2], a[0]);
        pal_cross3(a[1], a[1], a[2]);
        pal_add3(sum, sum, a[1]);
    }
    return pal_unit3(normal, sum, 0);
}

void pal_touch_row_begin(pal_touch *touch)
{
    touch->row_turn++;
    touch->n_row = 0;
}

void pal_touch_row_add(pal_touch *touch, const pal_body *body, int point, double stiffness_N_m)
{
    int32_t vertex[3], node[PAL_SKIN_NEAR];
    double share[3], weight[PAL_SKIN_NEAR];
    int n = corners(touch, point, vertex, share);
    for (int c = 0; c < n; c++) {
        int m = pal_touch_nodes(body, vertex[c], node, weight);
        for (int k = 0; k < m; k++) {
            int32_t i = node[k];
            if (touch->row_mark[i] != touch->row_turn) {
                touch->row_mark[i] = touch->row_turn;
                touch->row[i] = 0;
                touch->row_node[touch->n_row++] = i;
            }
            touch->row[i] += stiffness_N_m * share[c] * weight[k];
        }
    }
}

double pal_touch_row_scale(const pal_touch *touch, const pal_body *body, int point, double alpha_per_dt2)
{
    int32_t vertex[3], node[PAL_SKIN_NEAR];
    double share[3], weight[PAL_SKIN_NEAR], scale = 1;
    int n = corners(touch, point, vertex, share);
    for (int c = 0; c < n; c++) {
        int m = pal_touch_nodes(body, vertex[c], node, weight);
        for (int k = 0; k < m; k++) {
            int32_t i = node[k];
            if (body->held[i] || share[c] * weight[k] == 0) continue;
            double most = alpha_per_dt2 * body->mass_kg[i];
            if (touch->row[i] * scale > most) scale = most / touch->row[i];
        }
    }
    return scale;
}

void pal_touch_force_begin(pal_touch *touch)
{
    touch->turn++;
    touch->n_node = 0;
}

void pal_touch_push(pal_touch *touch, const pal_body *body, int point, const double force_N[3])
{
    int32_t vertex[3], node[PAL_SKIN_NEAR];
    double share[3], weight[PAL_SKIN_NEAR];
    int n = corners(touch, point, vertex, share);
    for (int c = 0; c < n; c++) {
        int m = pal_touch_nodes(body, vertex[c], node, weight);
        for (int k = 0; k < m; k++) {
            double *f = touch->force + 3 * (size_t)node[k];
            if (touch->node_mark[node[k]] != touch->turn) {
                touch->node_mark[node[k]] = touch->turn;
                pal_set3(f, 0, 0, 0);
                touch->node[touch->n_node++] = node[k];
            }
            pal_axpy3(f, share[c] * weight[k], force_N);
        }
    }
}

/* solves the symmetric 3x3 system by cofactors; false when it is nearly singular */
static bool solve33(const double m[9], const double b[3], double x[3])
{
    double c0[3], c1[3], c2[3];
    pal_cross3(c0, m + 3, m + 6);
    pal_cross3(c1, m + 6, m);
    pal_cross3(c2, m, m + 3);
    double det = pal_dot3(m, c0), trace = m[0] + m[4] + m[8];
    if (!(det > 1e-6 * trace * trace * trace)) return false;
    for (int k = 0; k < 3; k++) x[k] = (c0[k] * b[0] + c1[k] * b[1] + c2[k] * b[2]) / det;
    return true;
}

double pal_touch_balance(pal_touch *touch, const pal_body *body, const double torque_Nm[3])
{
    double centre[3] = {0}, lack[3], inertia[9] = {0}, turn[3], largest = 0, added = 0;
    if (touch->n_node == 0) return 1;
    pal_copy3(lack, torque_Nm);
    for (int i = 0; i < touch->n_node; i++)
        pal_axpy3(centre, 1.0 / touch->n_node, body->d + 3 * (size_t)touch->node[i]);
    for (int i = 0; i < touch->n_node; i++) {
        const double *x = body->d + 3 * (size_t)touch->node[i], *f = touch->force + 3 * (size_t)touch->node[i];
        double m[3], r[3];
        pal_cross3(m, x, f);
        pal_sub3(lack, lack, m);
        pal_sub3(r, x, centre);
        double r2 = pal_dot3(r, r);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) inertia[3 * a + b] += (a == b ? r2 : 0) - r[a] * r[b];
        largest = fmax(largest, pal_norm3(f));
    }
    /* the rotation field about the centre has no net force because the centre is the plain mean */
    if (solve33(inertia, lack, turn)) {
        for (int pass = 0; pass < 2; pass++)
            for (int i = 0; i < touch->n_node; i++) {
                double r[3], extra[3];
                pal_sub3(r, body->d + 3 * (size_t)touch->node[i], centre);
                pal_cross3(extra, turn, r);
                if (pass == 0)
                    added = fmax(added, pal_norm3(extra));
                else
                    pal_axpy3(touch->force + 3 * (size_t)touch->node[i],
                              fmin(1, MOST_TURN_SHARE * largest / fmax(added, 1e-300)), extra);
            }
    }
    largest = 0;
    for (int i = 0; i < touch->n_node; i++)
        largest = fmax(largest, pal_norm3(touch->force + 3 * (size_t)touch->node[i]));
    return body->load_cap_N > 0 && largest > body->load_cap_N ? body->load_cap_N / largest : 1;
}

void pal_touch_apply(const pal_touch *touch, pal_body *body, double scale)
{
    for (int i = 0; i < touch->n_node; i++) {
        int32_t node = touch->node[i];
        pal_axpy3(body->load + 3 * (size_t)node, scale, touch->force + 3 * (size_t)node);
    }
}

double pal_tool_room(const pal_tool *tool, const double force_N[3])
{
    /* |g + s f|^2 <= cap^2 */
    double cap = tool->force_cap_N * tool->ramp;
    double a = pal_dot3(force_N, force_N), b = pal_dot3(tool->force_N, force_N);
    double c = pal_dot3(tool->force_N, tool->force_N) - cap * cap;
    if (!(a > 0) || a + 2 * b + c <= 0) return 1;
    if (c >= 0) return 0;
    double s = (-b + sqrt(b * b - a * c)) / a;
    return s < 0 ? 0 : s > 1 ? 1 : s;
}
