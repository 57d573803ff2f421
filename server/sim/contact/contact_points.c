/* Contact points of the shown surface: collection, evaluation, and forces back to the nodes. */
#include "server/sim/contact/contact_points.h"

#include "server/base/vec3.h"

#include <math.h>
#include <string.h>

static pal_err allocate(const pal_body *body, pal_arena *arena, pal_contact_points *t)
{
    size_t n_vertex = (size_t)body->n_shown, n_node = (size_t)body->n_node;
    size_t n_frame = body->skin ? (size_t)body->skin->n_frame : 0, n_slot = body->skin ? n_frame : n_node;
    t->live = PAL_NEW(arena, int32_t, n_vertex);
    t->frame = PAL_NEW(arena, int32_t, n_frame);
    t->live_mark = PAL_NEW(arena, uint32_t, n_vertex);
    t->frame_mark = PAL_NEW(arena, uint32_t, n_frame);
    t->seen = PAL_NEW(arena, uint32_t, n_vertex);
    t->x = PAL_NEW(arena, double, 3 * n_vertex);
    t->v = PAL_NEW(arena, double, 3 * n_vertex);
    t->slot = PAL_NEW(arena, int32_t, n_slot);
    t->node = PAL_NEW(arena, int32_t, n_node);
    t->slot_mark = PAL_NEW(arena, uint32_t, n_slot);
    t->node_mark = PAL_NEW(arena, uint32_t, n_node);
    t->tool_mark = PAL_NEW(arena, uint32_t, n_slot);
    t->turning = PAL_NEW(arena, pal_frame_spin, n_frame);
    t->spin_mark = PAL_NEW(arena, uint32_t, n_frame);
    t->slot_force = PAL_NEW(arena, double, 3 * n_slot);
    t->slot_torque = PAL_NEW(arena, double, 3 * n_slot);
    t->force = PAL_NEW(arena, double, 3 * n_node);
    bool all = t->live && t->frame && t->live_mark && t->frame_mark && t->seen && t->x && t->v && t->slot && t->node &&
               t->slot_mark && t->node_mark && t->tool_mark && t->turning && t->spin_mark && t->slot_force &&
               t->slot_torque && t->force;
    return all ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_contact_points_make(const pal_body *body, double spacing_m, int max_sample, pal_arena *arena,
                                pal_contact_points *out)
{
    pal_contact_points t = {0};
    PAL_TRY(pal_contact_samples_make(body, spacing_m, max_sample, arena, &t.sample));
    PAL_TRY(allocate(body, arena, &t));
    *out = t;
    return PAL_ERR_OK;
}

void pal_contact_points_begin(pal_contact_points *points)
{
    points->mark++;
    points->n_live = points->n_frame = 0;
    pal_contact_samples_begin(&points->sample);
}

static void make_live(pal_contact_points *points, const pal_body *body, int vertex)
{
    if (points->live_mark[vertex] == points->mark) return;
    points->live_mark[vertex] = points->mark;
    points->live[points->n_live++] = vertex;
    if (!body->skin) return;
    const int32_t *near = body->skin->near + PAL_SKIN_NEIGHBOURS * (size_t)vertex;
    for (int k = 0; k < PAL_SKIN_NEIGHBOURS; k++)
        if (points->frame_mark[near[k]] != points->mark) {
            points->frame_mark[near[k]] = points->mark;
            points->frame[points->n_frame++] = near[k];
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

/* the first run of fixed samples, from this one on, whose triangle meets the box: *point is its first point, or the
 * first passing one; returns the run behind it */
static int next_run(const pal_contact_points *points, const pal_body *body, const float low[3], const float high[3],
                    int run, int *point)
{
    for (; run < points->sample.n_run; run++) {
        const int32_t *corner = points->sample.corner + 3 * (size_t)points->sample.run[run];
        const float *p = body->shown + 3 * (size_t)corner[0], *q = body->shown + 3 * (size_t)corner[1],
                    *r = body->shown + 3 * (size_t)corner[2];
        bool meets = true;
        for (int c = 0; c < 3; c++)
            meets &= fminf(p[c], fminf(q[c], r[c])) <= high[c] && fmaxf(p[c], fmaxf(q[c], r[c])) >= low[c];
        if (meets) break;
    }
    *point = points->sample.n_vertex + points->sample.run[run];
    return run < points->sample.n_run ? run + 1 : run;
}

int pal_contact_points_collect(pal_contact_points *points, const pal_body *body, const double a[3], const double b[3],
                               double reach_m, int32_t *list, double *nearest_m)
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
    int n_vertex = body->active ? body->n_active : points->sample.n_vertex;
    for (int k = 0; k < n_vertex; k++) {
        int i = body->active ? body->active[k] : k;
        const float *s = body->shown + 3 * (size_t)i;
        if (!((s[0] >= low[0]) & (s[0] <= high[0]) & (s[1] >= low[1]) & (s[1] <= high[1]) & (s[2] >= low[2]) &
              (s[2] <= high[2])))
            continue;
        double p[3] = {(double)s[0], (double)s[1], (double)s[2]}, d2 = distance2(p, a, ab, per_ab2);
        if (!(d2 <= reach2)) continue;
        nearest2 = fmin(nearest2, d2);
        make_live(points, body, i);
        list[n++] = i;
    }
    pal_contact_samples_add_stretched(&points->sample, body, list, n);
    for (int i = points->sample.n_vertex, run = 0; i < points->sample.n_point; i++) {
        if (run < points->sample.n_run && i == points->sample.n_vertex + points->sample.run[run])
            run = next_run(points, body, low, high, run, &i);
        if (i == points->sample.n_point) break;
        const int32_t *corner = points->sample.corner + 3 * (size_t)(i - points->sample.n_vertex);
        const float *share = points->sample.share + 3 * (size_t)(i - points->sample.n_vertex);
        double p[3] = {0};
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++)
                p[c] += (double)share[k] * (double)body->shown[3 * (size_t)corner[k] + (size_t)c];
        double d2 = distance2(p, a, ab, per_ab2);
        if (!(d2 <= reach2)) continue;
        nearest2 = fmin(nearest2, d2);
        for (int k = 0; k < 3; k++) make_live(points, body, corner[k]);
        list[n++] = i;
    }
    *nearest_m = sqrt(nearest2);
    return n;
}

int pal_contact_points_nodes(const pal_body *body, int vertex, int32_t *node, double *weight)
{
    if (!body->skin) {
        node[0] = body->shown_node[vertex];
        weight[0] = 1;
        return 1;
    }
    const pal_skin *skin = body->skin;
    double sum = 0;
    int n = 0;
    for (size_t k = PAL_SKIN_NEIGHBOURS * (size_t)vertex; k < PAL_SKIN_NEIGHBOURS * ((size_t)vertex + 1); k++) {
        if (skin->coef[4 * k + 3] == 0) continue;
        node[n] = skin->frame[skin->near[k]];
        sum += weight[n++] = (double)skin->coef[4 * k + 3];
    }
    for (int k = 0; k < n; k++) weight[k] /= sum;
    return n;
}

void pal_contact_points_reset(pal_contact_points *points)
{
    points->sub_step += 2;
}

/* what is shown, and so what is touched, while a switch is let in */
static void add_lag(const pal_body *body, int vertex, double x[3])
{
    for (size_t c = 0; c < 3 && body->display_offset_m; c++)
        x[c] += body->display_offset_part * (double)body->display_offset_m[3 * (size_t)vertex + c];
}

void pal_contact_points_update(pal_contact_points *points, const pal_body *body, double dt_s)
{
    uint32_t before = points->sub_step++;
    for (int i = 0; i < points->n_live && body->active; i++) {
        size_t at = 3 * (size_t)points->live[i];
        pal_copy3(points->x + at, body->d + at);
        pal_copy3(points->v + at, body->dv + at);
        add_lag(body, points->live[i], points->x + at);
    }
    if (body->active) return;
    if (body->skin) pal_skin_frames_of(body->skin, body->d, points->frame, points->n_frame, body->skin_axes);
    for (int i = 0; i < points->n_live; i++) {
        int vertex = points->live[i];
        double *x = points->x + 3 * (size_t)vertex, *v = points->v + 3 * (size_t)vertex, was[3];
        int32_t node[PAL_SKIN_NEIGHBOURS];
        double weight[PAL_SKIN_NEIGHBOURS];
        pal_copy3(was, x);
        if (body->skin)
            pal_skin_vertex(body->skin, body->d, body->skin_axes, vertex, x);
        else
            pal_copy3(x, body->d + 3 * (size_t)body->shown_node[vertex]);
        add_lag(body, vertex, x);
        bool followed = points->seen[vertex] == before && before > 0;
        points->seen[vertex] = points->sub_step;
        if (followed) {
            for (int c = 0; c < 3; c++) v[c] = (x[c] - was[c]) / points->dt_s;
            continue;
        }
        pal_set3(v, 0, 0, 0);
        int n = pal_contact_points_nodes(body, vertex, node, weight);
        for (int k = 0; k < n; k++) pal_axpy3(v, weight[k], body->dv + 3 * (size_t)node[k]);
    }
    points->dt_s = dt_s;
}

static void blend(const pal_contact_points *points, int point, const double *from, double out[3])
{
    int32_t vertex[3];
    double share[3], sum[3] = {0};
    int n = pal_contact_samples_corners(&points->sample, point, vertex, share);
    for (int k = 0; k < n; k++) pal_axpy3(sum, share[k], from + 3 * (size_t)vertex[k]);
    pal_copy3(out, sum);
}

void pal_contact_points_position(const pal_contact_points *points, int point, double x[3])
{
    blend(points, point, points->x, x);
}

void pal_contact_points_velocity(const pal_contact_points *points, int point, double v[3])
{
    blend(points, point, points->v, v);
}

/* a point of body->shown, vertex or sample */
static void shown_point(const pal_contact_points *points, const pal_body *body, int point, double p[3])
{
    int32_t vertex[3];
    double share[3];
    int n = pal_contact_samples_corners(&points->sample, point, vertex, share);
    pal_set3(p, 0, 0, 0);
    for (int k = 0; k < n; k++)
        for (int c = 0; c < 3; c++) p[c] += share[k] * (double)body->shown[3 * (size_t)vertex[k] + (size_t)c];
}

static void add_normal(const float *shown, const int32_t *corner, double sum[3])
{
    double a[3][3];
    for (int k = 0; k < 3; k++)
        for (int c = 0; c < 3; c++) a[k][c] = (double)shown[3 * (size_t)corner[k] + (size_t)c];
    pal_sub3(a[1], a[1], a[0]);
    pal_sub3(a[2], a[2], a[0]);
    pal_cross3(a[1], a[1], a[2]);
    pal_add3(sum, sum, a[1]);
}

bool pal_contact_points_nearest(const pal_contact_points *points, const pal_body *body, const double p[3],
                                double place[3], double normal[3])
{
    double best = INFINITY, at[3], sum[3] = {0};
    int nearest = -1;
    int n_vertex = body->active ? body->n_active : points->sample.n_vertex;
    for (int k = 0; k < n_vertex + points->sample.n_fixed - points->sample.n_vertex; k++) {
        int i = k >= n_vertex ? k - n_vertex + points->sample.n_vertex : body->active ? body->active[k] : k;
        shown_point(points, body, i, at);
        pal_sub3(at, at, p);
        double d2 = pal_dot3(at, at);
        if (d2 < best) best = d2, nearest = i;
    }
    if (nearest < 0) return false;
    shown_point(points, body, nearest, place);
    if (nearest >= points->sample.n_vertex)
        add_normal(body->shown, points->sample.corner + 3 * (size_t)(nearest - points->sample.n_vertex), sum);
    else
        for (int k = points->sample.fan_start[nearest]; k < points->sample.fan_end[nearest]; k++)
            add_normal(body->shown, body->surface->tri + 3 * (size_t)points->sample.fan[k], sum);
    return pal_unit3(normal, sum, 0);
}

/* slots that bear a shown vertex and their weights, sum 1; returns how many */
static int node_order(const pal_body *body, int vertex, int32_t *slot, double *weight)
{
    if (!body->skin) return pal_contact_points_nodes(body, vertex, slot, weight);
    const float *coef = body->skin->coef + 4 * PAL_SKIN_NEIGHBOURS * (size_t)vertex;
    double sum = 0;
    for (int k = 0; k < PAL_SKIN_NEIGHBOURS; k++) sum += weight[k] = (double)coef[4 * k + 3];
    for (int k = 0; k < PAL_SKIN_NEIGHBOURS; k++) {
        slot[k] = body->skin->near[PAL_SKIN_NEIGHBOURS * (size_t)vertex + (size_t)k];
        weight[k] /= sum;
    }
    return PAL_SKIN_NEIGHBOURS;
}

static int slot_node(const pal_body *body, int slot)
{
    return body->skin ? body->skin->frame[slot] : slot;
}

/* R_i w_i o_i, the lever of a skinned vertex in frame k of its five */
static void lever(const pal_body *body, int vertex, int k, double arm[3])
{
    size_t i = PAL_SKIN_NEIGHBOURS * (size_t)vertex + (size_t)k;
    const float *axes = (const float *)(const void *)body->skin_axes + 16 * (size_t)body->skin->near[i];
    const float *coef = body->skin->coef + 4 * i;
    for (int c = 0; c < 3; c++)
        arm[c] = (double)coef[0] * (double)axes[c] + (double)coef[1] * (double)axes[4 + c] +
                 (double)coef[2] * (double)axes[8 + c];
}

int pal_contact_points_slots(const pal_contact_points *points, const pal_body *body, int point, int32_t *slot,
                             double *weight, double (*arm)[3])
{
    int32_t vertex[3];
    double share[3];
    int n = pal_contact_samples_corners(&points->sample, point, vertex, share), m = 0;
    for (int c = 0; c < n; c++) {
        int n_slot = node_order(body, vertex[c], slot + m, weight + m);
        for (int k = 0; k < n_slot; k++, m++) {
            weight[m] *= share[c];
            pal_set3(arm[m], 0, 0, 0);
            if (!body->skin) continue;
            lever(body, vertex[c], k, arm[m]);
            pal_scale3(arm[m], share[c], arm[m]);
        }
    }
    return m;
}

int pal_contact_points_slot_node(const pal_body *body, int slot)
{
    return slot_node(body, slot);
}

void pal_contact_points_force_begin(pal_contact_points *points)
{
    points->turn++;
    points->n_slot = points->n_node = 0;
}

void pal_contact_points_add_force(pal_contact_points *points, const pal_body *body, int point, const double force_N[3])
{
    int32_t vertex[3], slot[PAL_SKIN_NEIGHBOURS];
    double share[3], weight[PAL_SKIN_NEIGHBOURS];
    int n = pal_contact_samples_corners(&points->sample, point, vertex, share);
    for (int c = 0; c < n; c++) {
        int m = node_order(body, vertex[c], slot, weight);
        for (int k = 0; k < m; k++) {
            double *f = points->slot_force + 3 * (size_t)slot[k], *t = points->slot_torque + 3 * (size_t)slot[k];
            if (points->slot_mark[slot[k]] != points->turn) {
                points->slot_mark[slot[k]] = points->turn;
                pal_set3(f, 0, 0, 0);
                pal_set3(t, 0, 0, 0);
                points->slot[points->n_slot++] = slot[k];
            }
            pal_axpy3(f, share[c] * weight[k], force_N);
            if (!body->skin) continue;
            double arm[3], moment[3];
            lever(body, vertex[c], k, arm);
            pal_cross3(moment, arm, force_N);
            pal_axpy3(t, share[c], moment);
        }
    }
}

static void add_force(pal_contact_points *points, int node, double scale, const double force_N[3])
{
    double *f = points->force + 3 * (size_t)node;
    if (points->node_mark[node] != points->turn) {
        points->node_mark[node] = points->turn;
        pal_set3(f, 0, 0, 0);
        points->node[points->n_node++] = node;
    }
    pal_axpy3(f, scale, force_N);
}

const pal_frame_spin *pal_contact_points_frame_spin(pal_contact_points *points, const pal_body *body, int slot)
{
    pal_frame_spin *t = &points->turning[slot];
    if (points->spin_mark[slot] == points->sub_step) return t;
    points->spin_mark[slot] = points->sub_step;
    pal_frame_spin_find(body, slot, t);
    return t;
}

/* The torque on a frame as forces on the nodes around it: the transpose of its spin. With
 *     spin = X x X' + (Y'.Z) X,  X' = (1 - X X^T) N' / |N|,  Y'.Z = (Z.e' - (e.X) Z.X') / |e_t|
 * the torque's work is (t x X).X' + (t.X) Y'.Z. */
static void turn_frame(pal_contact_points *points, const pal_body *body, int slot, const double torque[3])
{
    const pal_frame_spin *t = pal_contact_points_frame_spin(points, body, slot);
    if (!t->turns) return;
    const pal_skin *skin = body->skin;
    int node = skin->frame[slot];
    const double *o = body->d + 3 * (size_t)node;
    double twist = t->part * pal_dot3(torque, t->X), h[3], f[3], sum[3];
    /* the edge's own part of the twist about X */
    pal_scale3(sum, -twist * t->per_reach, t->Z);
    add_force(points, t->end, twist * t->per_reach, t->Z);
    /* the rest tilts the normal */
    pal_cross3(h, torque, t->X);
    pal_scale3(h, t->part, h);
    pal_axpy3(h, -twist * t->rise, t->Z);
    pal_axpy3(h, -pal_dot3(h, t->X), t->X);
    pal_scale3(h, t->per_normal, h);
    for (size_t i = (size_t)skin->fan_start[slot]; i < (size_t)skin->fan_start[slot + 1]; i++) {
        double a[3], b[3];
        pal_sub3(a, body->d + 3 * (size_t)skin->fan[2 * i], o);
        pal_sub3(b, body->d + 3 * (size_t)skin->fan[2 * i + 1], o);
        pal_cross3(f, b, h);
        add_force(points, skin->fan[2 * i], 1, f);
        pal_sub3(sum, sum, f);
        pal_cross3(f, h, a);
        add_force(points, skin->fan[2 * i + 1], 1, f);
        pal_sub3(sum, sum, f);
    }
    add_force(points, node, 1, sum);
}

/* spin of a frame when its nodes move with v = force / mass, held nodes not at all */
static void spin_frame(pal_contact_points *points, const pal_body *body, int slot, const double *v, double spin[3])
{
    const pal_frame_spin *t = pal_contact_points_frame_spin(points, body, slot);
    pal_set3(spin, 0, 0, 0);
    if (!t->turns) return;
    const pal_skin *skin = body->skin;
    size_t node = (size_t)skin->frame[slot];
    const double *o = body->d + 3 * node, *ov = v + 3 * node;
    double N[3] = {0}, e[3];
    for (size_t i = (size_t)skin->fan_start[slot]; i < (size_t)skin->fan_start[slot + 1]; i++) {
        double a[3], b[3], av[3], bv[3];
        pal_sub3(a, body->d + 3 * (size_t)skin->fan[2 * i], o);
        pal_sub3(b, body->d + 3 * (size_t)skin->fan[2 * i + 1], o);
        pal_sub3(av, v + 3 * (size_t)skin->fan[2 * i], ov);
        pal_sub3(bv, v + 3 * (size_t)skin->fan[2 * i + 1], ov);
        pal_cross3(av, av, b);
        pal_cross3(bv, a, bv);
        pal_add3(N, N, av);
        pal_add3(N, N, bv);
    }
    pal_axpy3(N, -pal_dot3(N, t->X), t->X);
    pal_scale3(N, t->per_normal, N);
    pal_sub3(e, v + 3 * (size_t)t->end, ov);
    pal_cross3(spin, t->X, N);
    pal_axpy3(spin, pal_dot3(t->Z, e) * t->per_reach - t->rise * pal_dot3(t->Z, N), t->X);
    pal_scale3(spin, t->part, spin);
}

static void to_nodes(pal_contact_points *points, const pal_body *body)
{
    for (int i = 0; i < points->n_slot; i++) {
        int slot = points->slot[i];
        add_force(points, slot_node(body, slot), 1, points->slot_force + 3 * (size_t)slot);
        if (body->skin) turn_frame(points, body, slot, points->slot_torque + 3 * (size_t)slot);
    }
}

double pal_contact_points_assemble(pal_contact_points *points, const pal_body *body)
{
    double max2 = 0;
    to_nodes(points, body);
    for (int i = 0; i < points->n_node; i++) {
        const double *f = points->force + 3 * (size_t)points->node[i];
        max2 = fmax(max2, pal_dot3(f, f));
    }
    return sqrt(max2);
}

/* motion of a point along `away` when the nodes move with v and the frames with the spins in slot_torque */
static double point_motion(const pal_contact_points *points, const pal_body *body, const pal_contact *contact,
                           const double *v)
{
    int32_t vertex[3], slot[PAL_SKIN_NEIGHBOURS];
    double share[3], weight[PAL_SKIN_NEIGHBOURS], sum = 0;
    int n = pal_contact_samples_corners(&points->sample, contact->point, vertex, share);
    for (int c = 0; c < n; c++) {
        int m = node_order(body, vertex[c], slot, weight);
        for (int k = 0; k < m; k++) {
            double arm[3], turned[3];
            sum += share[c] * weight[k] * pal_dot3(contact->away, v + 3 * (size_t)slot_node(body, slot[k]));
            if (!body->skin) continue;
            lever(body, vertex[c], k, arm);
            pal_cross3(turned, points->slot_torque + 3 * (size_t)slot[k], arm);
            sum += share[c] * pal_dot3(contact->away, turned);
        }
    }
    return sum;
}

double pal_contact_points_bound(const pal_contact_points *points, const pal_body *body, int point, double k_N_m,
                                double *bound_N_m)
{
    int32_t vertex[3];
    double share[3], rate = 0;
    int n = pal_contact_samples_corners(&points->sample, point, vertex, share);
    for (int c = 0; c < n; c++) {
        int32_t node = body->shown_node[vertex[c]];
        if (bound_N_m) bound_N_m[node] += k_N_m * share[c];
        rate += k_N_m * share[c] * pal_body_inverse_mass_1_kg(body, node);
    }
    return rate;
}

double pal_contact_points_max_eigenvalue(pal_contact_points *points, const pal_body *body, const pal_contact *contact,
                                         int n)
{
    enum { PASSES = 2, MOST = 256 };
    /* a patch of very many points is judged by a part of them, each standing for several */
    int stride = (n + MOST - 1) / MOST, m = 0;
    double motion[MOST], rate = 0, k_step = stride;
    for (int i = 0; i < n; i += stride) motion[m++] = 1;
    for (int pass = 0; pass < PASSES && m > 0; pass++) {
        double with = 0, before = 0, f[3];
        /* forces of the present motion, then accelerations */
        pal_contact_points_force_begin(points);
        for (int i = 0; i < m; i++) {
            const pal_contact *c = &contact[i * stride];
            pal_scale3(f, k_step * c->k_N_m * motion[i], c->away);
            pal_contact_points_add_force(points, body, c->point, f);
        }
        to_nodes(points, body);
        for (int i = 0; i < points->n_node; i++) {
            int node = points->node[i];
            pal_scale3(points->force + 3 * (size_t)node, body->support[node] ? 0 : 1 / body->mass_kg[node],
                       points->force + 3 * (size_t)node);
        }
        for (int i = 0; i < points->n_slot && body->skin; i++) {
            int slot = points->slot[i];
            spin_frame(points, body, slot, points->force, points->slot_torque + 3 * (size_t)slot);
        }
        /* what the points do then: a Rayleigh quotient in the norm of k */
        for (int i = 0; i < m; i++) {
            const pal_contact *c = &contact[i * stride];
            double next = point_motion(points, body, c, points->force);
            with += c->k_N_m * next * next;
            before += c->k_N_m * motion[i] * motion[i];
            motion[i] = next;
        }
        rate = before > 0 ? sqrt(with / before) : 0;
        double scale = rate > 0 ? 1 / rate : 0;
        for (int i = 0; i < m; i++) motion[i] *= scale;
    }
    return rate;
}

pal_err pal_contact_points_young(const pal_contact_points *points, const pal_body *body, const pal_body_def *def,
                                 pal_arena *arena, float **out)
{
    *out = NULL;
    if (def->n_region == 0 && def->n_stroke == 0) return PAL_ERR_OK;
    *out = PAL_NEW(arena, float, points->sample.n_vertex);
    if (!*out) return PAL_ERR_MEMORY;
    for (int i = 0; i < points->sample.n_vertex; i++) {
        pal_material at;
        pal_material_painted(def, body->surface->x + 3 * (size_t)i, &at);
        if (at.young_Pa != def->material.young_Pa) (*out)[i] = (float)at.young_Pa;
    }
    return PAL_ERR_OK;
}

bool pal_contact_points_overlap(pal_contact_points *points, const pal_body *body, const pal_contact *a, int n_a,
                                const pal_contact *b, int n_b)
{
    int32_t vertex[3], slot[PAL_SKIN_NEIGHBOURS];
    double share[3], weight[PAL_SKIN_NEIGHBOURS];
    points->turn++;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < (pass ? n_b : n_a); i++) {
            int n = pal_contact_samples_corners(&points->sample, (pass ? b : a)[i].point, vertex, share);
            for (int c = 0; c < n; c++) {
                int m = node_order(body, vertex[c], slot, weight);
                for (int k = 0; k < m; k++)
                    if (pass == 0)
                        points->tool_mark[slot[k]] = points->turn;
                    else if (points->tool_mark[slot[k]] == points->turn)
                        return true;
            }
        }
    return false;
}

void pal_contact_points_apply(const pal_contact_points *points, pal_body *body, double scale)
{
    for (int i = 0; i < points->n_node; i++) {
        int32_t node = points->node[i];
        pal_axpy3(body->load + 3 * (size_t)node, scale, points->force + 3 * (size_t)node);
    }
}
