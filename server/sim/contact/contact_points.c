/* Contact points of the shown surface: collection, evaluation, and forces back to the nodes. */
#include "server/sim/contact/contact_points.h"

#include "server/base/vec3.h"

#include <math.h>
#include <string.h>

void pal_contact_points_begin(pal_contact_points *touch)
{
    touch->mark++;
    touch->n_live = touch->n_frame = 0;
    touch->n_point = touch->n_fixed;
}

static void make_live(pal_contact_points *touch, const pal_body *body, int vertex)
{
    if (touch->live_mark[vertex] == touch->mark) return;
    touch->live_mark[vertex] = touch->mark;
    touch->live[touch->n_live++] = vertex;
    if (!body->skin) return;
    const int32_t *near = body->skin->near + PAL_SKIN_NEIGHBOURS * (size_t)vertex;
    for (int k = 0; k < PAL_SKIN_NEIGHBOURS; k++)
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

/* the first run of fixed samples, from this one on, whose triangle meets the box: *point is its first point, or the
 * first passing one; returns the run behind it */
static int next_run(const pal_contact_points *touch, const pal_body *body, const float low[3], const float high[3],
                    int run, int *point)
{
    for (; run < touch->n_run; run++) {
        const int32_t *corner = touch->corner + 3 * (size_t)touch->run[run];
        const float *p = body->shown + 3 * (size_t)corner[0], *q = body->shown + 3 * (size_t)corner[1],
                    *r = body->shown + 3 * (size_t)corner[2];
        bool meets = true;
        for (int c = 0; c < 3; c++)
            meets &= fminf(p[c], fminf(q[c], r[c])) <= high[c] && fmaxf(p[c], fmaxf(q[c], r[c])) >= low[c];
        if (meets) break;
    }
    *point = touch->n_vertex + touch->run[run];
    return run < touch->n_run ? run + 1 : run;
}

int pal_contact_points_collect(pal_contact_points *touch, const pal_body *body, const double a[3], const double b[3],
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
    int n_vertex = body->active ? body->n_active : touch->n_vertex;
    for (int k = 0; k < n_vertex; k++) {
        int i = body->active ? body->active[k] : k;
        const float *s = body->shown + 3 * (size_t)i;
        if (!((s[0] >= low[0]) & (s[0] <= high[0]) & (s[1] >= low[1]) & (s[1] <= high[1]) & (s[2] >= low[2]) &
              (s[2] <= high[2])))
            continue;
        double p[3] = {(double)s[0], (double)s[1], (double)s[2]}, d2 = distance2(p, a, ab, per_ab2);
        if (!(d2 <= reach2)) continue;
        nearest2 = fmin(nearest2, d2);
        make_live(touch, body, i);
        list[n++] = i;
    }
    pal_contact_points_sample_stretched(touch, body, list, n);
    for (int i = touch->n_vertex, run = 0; i < touch->n_point; i++) {
        if (run < touch->n_run && i == touch->n_vertex + touch->run[run])
            run = next_run(touch, body, low, high, run, &i);
        if (i == touch->n_point) break;
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

void pal_contact_points_reset(pal_contact_points *touch)
{
    touch->sub_step += 2;
}

/* what is shown, and so what is touched, while a switch is let in */
static void add_lag(const pal_body *body, int vertex, double x[3])
{
    for (size_t c = 0; c < 3 && body->display_offset_m; c++)
        x[c] += body->display_offset_part * (double)body->display_offset_m[3 * (size_t)vertex + c];
}

void pal_contact_points_update(pal_contact_points *touch, const pal_body *body, double dt_s)
{
    uint32_t before = touch->sub_step++;
    for (int i = 0; i < touch->n_live && body->active; i++) {
        size_t at = 3 * (size_t)touch->live[i];
        pal_copy3(touch->x + at, body->d + at);
        pal_copy3(touch->v + at, body->dv + at);
        add_lag(body, touch->live[i], touch->x + at);
    }
    if (body->active) return;
    if (body->skin) pal_skin_frames_of(body->skin, body->d, touch->frame, touch->n_frame, body->skin_axes);
    for (int i = 0; i < touch->n_live; i++) {
        int vertex = touch->live[i];
        double *x = touch->x + 3 * (size_t)vertex, *v = touch->v + 3 * (size_t)vertex, was[3];
        int32_t node[PAL_SKIN_NEIGHBOURS];
        double weight[PAL_SKIN_NEIGHBOURS];
        pal_copy3(was, x);
        if (body->skin)
            pal_skin_vertex(body->skin, body->d, body->skin_axes, vertex, x);
        else
            pal_copy3(x, body->d + 3 * (size_t)body->shown_node[vertex]);
        add_lag(body, vertex, x);
        bool followed = touch->seen[vertex] == before && before > 0;
        touch->seen[vertex] = touch->sub_step;
        if (followed) {
            for (int c = 0; c < 3; c++) v[c] = (x[c] - was[c]) / touch->dt_s;
            continue;
        }
        pal_set3(v, 0, 0, 0);
        int n = pal_contact_points_nodes(body, vertex, node, weight);
        for (int k = 0; k < n; k++) pal_axpy3(v, weight[k], body->dv + 3 * (size_t)node[k]);
    }
    touch->dt_s = dt_s;
}

/* corners of a point and their shares; returns how many */
static int corners(const pal_contact_points *touch, int point, int32_t *vertex, double *share)
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

static void blend(const pal_contact_points *touch, int point, const double *from, double out[3])
{
    int32_t vertex[3];
    double share[3], sum[3] = {0};
    int n = corners(touch, point, vertex, share);
    for (int k = 0; k < n; k++) pal_axpy3(sum, share[k], from + 3 * (size_t)vertex[k]);
    pal_copy3(out, sum);
}

void pal_contact_points_position(const pal_contact_points *touch, int point, double x[3])
{
    blend(touch, point, touch->x, x);
}

void pal_contact_points_velocity(const pal_contact_points *touch, int point, double v[3])
{
    blend(touch, point, touch->v, v);
}

/* a point of body->shown, vertex or sample */
static void shown_point(const pal_contact_points *touch, const pal_body *body, int point, double p[3])
{
    int32_t vertex[3];
    double share[3];
    int n = corners(touch, point, vertex, share);
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

bool pal_contact_points_nearest(const pal_contact_points *touch, const pal_body *body, const double p[3],
                                double place[3], double normal[3])
{
    double best = INFINITY, at[3], sum[3] = {0};
    int nearest = -1;
    int n_vertex = body->active ? body->n_active : touch->n_vertex;
    for (int k = 0; k < n_vertex + touch->n_fixed - touch->n_vertex; k++) {
        int i = k >= n_vertex ? k - n_vertex + touch->n_vertex : body->active ? body->active[k] : k;
        shown_point(touch, body, i, at);
        pal_sub3(at, at, p);
        double d2 = pal_dot3(at, at);
        if (d2 < best) best = d2, nearest = i;
    }
    if (nearest < 0) return false;
    shown_point(touch, body, nearest, place);
    if (nearest >= touch->n_vertex)
        add_normal(body->shown, touch->corner + 3 * (size_t)(nearest - touch->n_vertex), sum);
    else
        for (int k = touch->fan_start[nearest]; k < touch->fan_end[nearest]; k++)
            add_normal(body->shown, body->surface->tri + 3 * (size_t)touch->fan[k], sum);
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

int pal_contact_points_slots(const pal_contact_points *touch, const pal_body *body, int point, int32_t *slot,
                             double *weight, double (*arm)[3])
{
    int32_t vertex[3];
    double share[3];
    int n = corners(touch, point, vertex, share), m = 0;
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

void pal_contact_points_force_begin(pal_contact_points *touch)
{
    touch->turn++;
    touch->n_slot = touch->n_node = 0;
}

void pal_contact_points_add_force(pal_contact_points *touch, const pal_body *body, int point, const double force_N[3])
{
    int32_t vertex[3], slot[PAL_SKIN_NEIGHBOURS];
    double share[3], weight[PAL_SKIN_NEIGHBOURS];
    int n = corners(touch, point, vertex, share);
    for (int c = 0; c < n; c++) {
        int m = node_order(body, vertex[c], slot, weight);
        for (int k = 0; k < m; k++) {
            double *f = touch->slot_force + 3 * (size_t)slot[k], *t = touch->slot_torque + 3 * (size_t)slot[k];
            if (touch->slot_mark[slot[k]] != touch->turn) {
                touch->slot_mark[slot[k]] = touch->turn;
                pal_set3(f, 0, 0, 0);
                pal_set3(t, 0, 0, 0);
                touch->slot[touch->n_slot++] = slot[k];
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

static void add_force(pal_contact_points *touch, int node, double scale, const double force_N[3])
{
    double *f = touch->force + 3 * (size_t)node;
    if (touch->node_mark[node] != touch->turn) {
        touch->node_mark[node] = touch->turn;
        pal_set3(f, 0, 0, 0);
        touch->node[touch->n_node++] = node;
    }
    pal_axpy3(f, scale, force_N);
}

const pal_frame_spin *pal_contact_points_frame_spin(pal_contact_points *touch, const pal_body *body, int slot)
{
    pal_frame_spin *t = &touch->turning[slot];
    if (touch->spin_mark[slot] == touch->sub_step) return t;
    touch->spin_mark[slot] = touch->sub_step;
    pal_frame_spin_find(body, slot, t);
    return t;
}

/* The torque on a frame as forces on the nodes around it: the transpose of its spin. With
 *     spin = X x X' + (Y'.Z) X,  X' = (1 - X X^T) N' / |N|,  Y'.Z = (Z.e' - (e.X) Z.X') / |e_t|
 * the torque's work is (t x X).X' + (t.X) Y'.Z. */
static void turn_frame(pal_contact_points *touch, const pal_body *body, int slot, const double torque[3])
{
    const pal_frame_spin *t = pal_contact_points_frame_spin(touch, body, slot);
    if (!t->turns) return;
    const pal_skin *skin = body->skin;
    int node = skin->frame[slot];
    const double *o = body->d + 3 * (size_t)node;
    double twist = t->part * pal_dot3(torque, t->X), h[3], f[3], sum[3];
    /* the edge's own part of the twist about X */
    pal_scale3(sum, -twist * t->per_reach, t->Z);
    add_force(touch, t->end, twist * t->per_reach, t->Z);
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
        add_force(touch, skin->fan[2 * i], 1, f);
        pal_sub3(sum, sum, f);
        pal_cross3(f, h, a);
        add_force(touch, skin->fan[2 * i + 1], 1, f);
        pal_sub3(sum, sum, f);
    }
    add_force(touch, node, 1, sum);
}

/* spin of a frame when its nodes move with v = force / mass, held nodes not at all */
static void spin_frame(pal_contact_points *touch, const pal_body *body, int slot, const double *v, double spin[3])
{
    const pal_frame_spin *t = pal_contact_points_frame_spin(touch, body, slot);
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

static void to_nodes(pal_contact_points *touch, const pal_body *body)
{
    for (int i = 0; i < touch->n_slot; i++) {
        int slot = touch->slot[i];
        add_force(touch, slot_node(body, slot), 1, touch->slot_force + 3 * (size_t)slot);
        if (body->skin) turn_frame(touch, body, slot, touch->slot_torque + 3 * (size_t)slot);
    }
}

double pal_contact_points_assemble(pal_contact_points *touch, const pal_body *body)
{
    double largest2 = 0;
    to_nodes(touch, body);
    for (int i = 0; i < touch->n_node; i++) {
        const double *f = touch->force + 3 * (size_t)touch->node[i];
        largest2 = fmax(largest2, pal_dot3(f, f));
    }
    double cap = body->load_cap_N;
    return cap > 0 && largest2 > cap * cap ? cap / sqrt(largest2) : 1;
}

/* motion of a point along `away` when the nodes move with v and the frames with the spins in slot_torque */
static double point_motion(const pal_contact_points *touch, const pal_body *body, const pal_contact *contact,
                           const double *v)
{
    int32_t vertex[3], slot[PAL_SKIN_NEIGHBOURS];
    double share[3], weight[PAL_SKIN_NEIGHBOURS], sum = 0;
    int n = corners(touch, contact->point, vertex, share);
    for (int c = 0; c < n; c++) {
        int m = node_order(body, vertex[c], slot, weight);
        for (int k = 0; k < m; k++) {
            double arm[3], turned[3];
            sum += share[c] * weight[k] * pal_dot3(contact->away, v + 3 * (size_t)slot_node(body, slot[k]));
            if (!body->skin) continue;
            lever(body, vertex[c], k, arm);
            pal_cross3(turned, touch->slot_torque + 3 * (size_t)slot[k], arm);
            sum += share[c] * pal_dot3(contact->away, turned);
        }
    }
    return sum;
}

double pal_contact_points_bound(const pal_contact_points *touch, const pal_body *body, int point, double k_N_m,
                                double *bound_N_m)
{
    int32_t vertex[3];
    double share[3], rate = 0;
    int n = corners(touch, point, vertex, share);
    for (int c = 0; c < n; c++) {
        int32_t node = body->shown_node[vertex[c]];
        if (bound_N_m) bound_N_m[node] += k_N_m * share[c];
        rate += k_N_m * share[c] * pal_body_inverse_mass_1_kg(body, node);
    }
    return rate;
}

/* the same where points carry the nodes: the sum of the eigenvalues is no less than the largest, and what a point
 * between nodes moves is no more than their mean */
static double sum_of_rates(const pal_contact_points *touch, const pal_body *body, const pal_contact *contact, int n)
{
    double rate = 0;
    for (int i = 0; i < n; i++) rate += pal_contact_points_bound(touch, body, contact[i].point, contact[i].k_N_m, NULL);
    return rate;
}

double pal_contact_points_max_eigenvalue(pal_contact_points *touch, const pal_body *body, const pal_contact *contact,
                                         int n)
{
    if (body->interpolation) return sum_of_rates(touch, body, contact, n);
    enum { PASSES = 2, MOST = 256 };
    /* a patch of very many points is judged by a part of them, each standing for several */
    int stride = (n + MOST - 1) / MOST, m = 0;
    double motion[MOST], rate = 0, k_step = stride;
    for (int i = 0; i < n; i += stride) motion[m++] = 1;
    for (int pass = 0; pass < PASSES && m > 0; pass++) {
        double with = 0, before = 0, f[3];
        /* forces of the present motion, then accelerations */
        pal_contact_points_force_begin(touch);
        for (int i = 0; i < m; i++) {
            const pal_contact *c = &contact[i * stride];
            pal_scale3(f, k_step * c->k_N_m * motion[i], c->away);
            pal_contact_points_add_force(touch, body, c->point, f);
        }
        to_nodes(touch, body);
        for (int i = 0; i < touch->n_node; i++) {
            int node = touch->node[i];
            pal_scale3(touch->force + 3 * (size_t)node, body->fixed[node] ? 0 : 1 / body->mass_kg[node],
                       touch->force + 3 * (size_t)node);
        }
        for (int i = 0; i < touch->n_slot && body->skin; i++) {
            int slot = touch->slot[i];
            spin_frame(touch, body, slot, touch->force, touch->slot_torque + 3 * (size_t)slot);
        }
        /* what the points do then: a Rayleigh quotient in the norm of k */
        for (int i = 0; i < m; i++) {
            const pal_contact *c = &contact[i * stride];
            double next = point_motion(touch, body, c, touch->force);
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

pal_err pal_contact_points_young(const pal_contact_points *touch, const pal_body *body, const pal_body_def *def,
                                 pal_arena *arena, float **out)
{
    *out = NULL;
    if (def->n_region == 0 && def->n_stroke == 0) return PAL_ERR_OK;
    *out = PAL_NEW(arena, float, touch->n_vertex);
    if (!*out) return PAL_ERR_MEMORY;
    for (int i = 0; i < touch->n_vertex; i++) {
        pal_material at;
        pal_material_painted(def, body->surface->x + 3 * (size_t)i, &at);
        if (at.young_Pa != def->material.young_Pa) (*out)[i] = (float)at.young_Pa;
    }
    return PAL_ERR_OK;
}

bool pal_contact_points_overlap(pal_contact_points *touch, const pal_body *body, const pal_contact *a, int n_a,
                                const pal_contact *b, int n_b)
{
    int32_t vertex[3], slot[PAL_SKIN_NEIGHBOURS];
    double share[3], weight[PAL_SKIN_NEIGHBOURS];
    touch->turn++;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < (pass ? n_b : n_a); i++) {
            int n = corners(touch, (pass ? b : a)[i].point, vertex, share);
            for (int c = 0; c < n; c++) {
                int m = node_order(body, vertex[c], slot, weight);
                for (int k = 0; k < m; k++)
                    if (pass == 0)
                        touch->tool_mark[slot[k]] = touch->turn;
                    else if (touch->tool_mark[slot[k]] == touch->turn)
                        return true;
            }
        }
    return false;
}

void pal_contact_points_apply(const pal_contact_points *touch, pal_body *body, double scale)
{
    for (int i = 0; i < touch->n_node; i++) {
        int32_t node = touch->node[i];
        pal_axpy3(body->load + 3 * (size_t)node, scale, touch->force + 3 * (size_t)node);
    }
}

double pal_tool_force_share(const pal_tool *tool, const double force_N[3])
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
