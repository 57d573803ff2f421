/* Contact points of the shown surface: collection, evaluation, and forces back to the nodes. */
#include "server/sim/contact/contact_points.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"

#include <string.h>

pal_err pal_contact_points_make(const pal_body *body, double spacing_m, int max_sample, pal_arena *arena,
                                pal_contact_points *t)
{
    *t = (pal_contact_points){0};
    PAL_TRY(pal_contact_samples_make(body, spacing_m, max_sample, arena, &t->sample));
    size_t n_vertex = (size_t)body->display.n_shown, n_node = (size_t)body->n_node;
    size_t n_frame = body->display.skin ? (size_t)body->display.skin->n_frame : 0,
           n_slot = body->display.skin ? n_frame : n_node;
    t->live = PAL_NEW(arena, int32_t, n_vertex);
    t->frame = PAL_NEW(arena, int32_t, n_frame);
    t->live_mark = PAL_NEW(arena, uint32_t, n_vertex);
    t->frame_mark = PAL_NEW(arena, uint32_t, n_frame);
    t->seen = PAL_NEW(arena, uint32_t, n_vertex);
    t->sides = PAL_NEW(arena, uint8_t, n_vertex);

    t->slot = PAL_NEW(arena, int32_t, n_slot);
    t->node = PAL_NEW(arena, int32_t, n_node);
    t->slot_mark = PAL_NEW(arena, uint32_t, n_slot);
    t->node_mark = PAL_NEW(arena, uint32_t, n_node);
    t->tool_mark = PAL_NEW(arena, uint32_t, n_slot);
    t->spin = PAL_NEW(arena, pal_frame_spin, n_frame);
    t->spin_mark = PAL_NEW(arena, uint32_t, n_frame);
    t->face = PAL_NEW(arena, pal_frame_face, body->display.skin ? body->display.skin->fan_start[n_frame] : 0);
    t->state = PAL_NEW(arena, double, 6 * n_slot);
    t->force = PAL_NEW(arena, double, 3 * n_node);
    bool all = PAL_NEW_DOUBLES(arena, 3 * n_vertex, &t->x, &t->v) && t->live && t->frame && t->live_mark &&
               t->frame_mark && t->seen && t->sides && t->slot && t->node && t->slot_mark && t->node_mark &&
               t->tool_mark && t->spin && t->spin_mark && t->face && t->state && t->force;
    return all ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

void pal_contact_points_begin(pal_contact_points *points)
{
    points->mark++;
    points->n_live = points->n_frame = 0;
    points->sample.mark++, points->sample.n_point = points->sample.n_fixed;
}

static void make_live(pal_contact_points *points, const pal_body *body, int vertex)
{
    if (points->live_mark[vertex] == points->mark) return;
    points->live_mark[vertex] = points->mark;
    points->live[points->n_live++] = vertex;
    if (!body->display.skin) return;
    const int32_t *near = body->display.skin->near + PAL_SKIN_NEIGHBOURS * (size_t)vertex;
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

/* on which sides of a box a point is, a bit each: a triangle whose corners share one, and all of its samples, are
 * outside the box */
static uint8_t sides_of(const float p[3], const float low[3], const float high[3])
{
    unsigned sides = 0;
    for (unsigned c = 0; c < 3; c++)
        sides |= (unsigned)(p[c] < low[c]) << (2 * c) | (unsigned)(p[c] > high[c]) << (2 * c + 1);
    return (uint8_t)sides;
}

static bool is_outside(const pal_contact_points *points, int sample)
{
    const int32_t *corner = points->sample.corner + 3 * (size_t)sample;
    return points->sides[corner[0]] & points->sides[corner[1]] & points->sides[corner[2]];
}

/* the first run of fixed samples, from this one on, whose triangle may meet the box: *point is its first point, or the
 * first passing one; returns the run behind it */
static int next_run(const pal_contact_points *points, int run, int *point)
{
    while (run < points->sample.n_run && is_outside(points, points->sample.run[run])) run++;
    *point = points->sample.n_vertex + points->sample.run[run];
    return run < points->sample.n_run ? run + 1 : run;
}

int pal_contact_points_collect(pal_contact_points *points, const pal_body *body, const double a[3], const double b[3],
                               double reach_m, int32_t *list)
{
    double ab[3], reach2 = reach_m * reach_m;
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
        const float *s = body->display.shown + 3 * (size_t)i;
        if ((points->sides[i] = sides_of(s, low, high))) continue;
        if (!(distance2((double[3]){(double)s[0], (double)s[1], (double)s[2]}, a, ab, per_ab2) <= reach2)) continue;
        make_live(points, body, i);
        list[n++] = i;
    }
    pal_contact_samples_add_stretched(&points->sample, body, list, n);
    for (int i = points->sample.n_vertex, run = 0; i < points->sample.n_point; i++) {
        if (run < points->sample.n_run && i == points->sample.n_vertex + points->sample.run[run])
            run = next_run(points, run, &i);
        if (i == points->sample.n_point) break;
        if (is_outside(points, i - points->sample.n_vertex)) continue;
        const int32_t *corner = points->sample.corner + 3 * (size_t)(i - points->sample.n_vertex);
        const float *share = points->sample.share + 3 * (size_t)(i - points->sample.n_vertex);
        double p[3] = {0};
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++)
                p[c] += (double)share[k] * (double)body->display.shown[3 * (size_t)corner[k] + (size_t)c];
        if (!(distance2(p, a, ab, per_ab2) <= reach2)) continue;
        for (int k = 0; k < 3; k++) make_live(points, body, corner[k]);
        list[n++] = i;
    }
    return n;
}

int pal_contact_points_nodes(const pal_body *body, int vertex, int32_t *node, double *weight)
{
    if (!body->display.skin) {
        node[0] = body->display.shown_node[vertex];
        weight[0] = 1;
        return 1;
    }
    const pal_skin *skin = body->display.skin;
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

void pal_contact_points_update(pal_contact_points *points, const pal_body *body, double dt_s)
{
    const pal_display *display = &body->display;
    uint32_t before = points->sub_step++;
    if (display->skin) pal_skin_frames_of(display->skin, body->d, points->frame, points->n_frame, display->skin_axes);
    for (int i = 0; i < points->n_live; i++) {
        int vertex = points->live[i];
        double *x = points->x + 3 * (size_t)vertex, *v = points->v + 3 * (size_t)vertex, was[3];
        int32_t node[PAL_SKIN_NEIGHBOURS];
        double weight[PAL_SKIN_NEIGHBOURS];
        pal_copy3(was, x);
        if (display->skin)
            pal_skin_vertex(display->skin, body->d, display->skin_axes, vertex, x);
        else
            pal_copy3(x, body->d + 3 * (size_t)display->shown_node[vertex]);
        /* what is shown is touched, also while a change of method is blended in */
        for (size_t c = 0; c < 3 && display->offset_m; c++)
            x[c] += display->offset_part * (double)display->offset_m[3 * (size_t)vertex + c];
        bool followed = points->seen[vertex] == before && before > 0 && !body->active;
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

void pal_contact_points_at(const pal_contact_points *points, int point, const double *from, double out[3])
{
    int32_t vertex[3];
    double share[3];
    int n = pal_contact_samples_corners(&points->sample, point, vertex, share);
    pal_set3(out, 0, 0, 0);
    for (int k = 0; k < n; k++) pal_axpy3(out, share[k], from + 3 * (size_t)vertex[k]);
}

/* a point of display.shown, vertex or sample */
static void shown_point(const pal_contact_points *points, const pal_body *body, int point, double p[3])
{
    int32_t vertex[3];
    double share[3];
    int n = pal_contact_samples_corners(&points->sample, point, vertex, share);
    pal_set3(p, 0, 0, 0);
    for (int k = 0; k < n; k++)
        for (int c = 0; c < 3; c++) p[c] += share[k] * (double)body->display.shown[3 * (size_t)vertex[k] + (size_t)c];
}

static void add_normal(const float *shown, const int32_t *corner, double sum[3])
{
    double a[3][3], n[3];
    for (int k = 0; k < 9; k++) a[k / 3][k % 3] = (double)shown[3 * (size_t)corner[k / 3] + (size_t)k % 3];
    pal_normal3(n, a[0], a[1], a[2]);
    pal_add3(sum, sum, n);
}

bool pal_contact_points_nearest(const pal_contact_points *points, const pal_body *body, const double p[3], double at[3],
                                double normal[3])
{
    double best = INFINITY, off[3], sum[3] = {0};
    int nearest = -1;
    int n_vertex = body->active ? body->n_active : points->sample.n_vertex;
    for (int k = 0; k < n_vertex + points->sample.n_fixed - points->sample.n_vertex; k++) {
        int i = k >= n_vertex ? k - n_vertex + points->sample.n_vertex : body->active ? body->active[k] : k;
        shown_point(points, body, i, at);
        pal_sub3(off, at, p);
        double d2 = pal_dot3(off, off);
        if (d2 < best) best = d2, nearest = i;
    }
    if (nearest < 0) return false;
    shown_point(points, body, nearest, at);
    if (nearest >= points->sample.n_vertex)
        add_normal(body->display.shown, points->sample.corner + 3 * (size_t)(nearest - points->sample.n_vertex), sum);
    else
        for (int k = points->sample.fan_start[nearest]; k < points->sample.fan_end[nearest]; k++)
            add_normal(body->display.shown, body->display.surface->tri + 3 * (size_t)points->sample.fan[k], sum);
    return pal_unit3(normal, sum, 0);
}

/* ---- slots ---- */

int pal_contact_points_slot_node(const pal_body *body, int slot)
{
    return body->display.skin ? body->display.skin->frame[slot] : slot;
}

int pal_contact_points_slots(const pal_contact_points *points, const pal_body *body, int point, pal_contact_slot *out)
{
    int32_t vertex[3];
    double share[3];
    int n = pal_contact_samples_corners(&points->sample, point, vertex, share), m = 0;
    for (int c = 0; c < n; c++) {
        if (!body->display.skin) {
            out[m++] = (pal_contact_slot){.slot = body->display.shown_node[vertex[c]], .weight = share[c]};
            continue;
        }
        const float *coef = body->display.skin->coef + 4 * PAL_SKIN_NEIGHBOURS * (size_t)vertex[c];
        const int32_t *near = body->display.skin->near + PAL_SKIN_NEIGHBOURS * (size_t)vertex[c];
        double sum = 0;
        for (int k = 0; k < PAL_SKIN_NEIGHBOURS; k++) sum += (double)coef[4 * k + 3];
        for (int k = 0; k < PAL_SKIN_NEIGHBOURS; k++, m++) {
            const float *axes = (const float *)(const void *)body->display.skin_axes + 16 * (size_t)near[k],
                        *w = coef + 4 * k;
            out[m] = (pal_contact_slot){.slot = near[k], .weight = (double)w[3] / sum * share[c]};
            for (int d = 0; d < 3; d++)
                out[m].arm[d] = share[c] * ((double)w[0] * (double)axes[d] + (double)w[1] * (double)axes[4 + d] +
                                            (double)w[2] * (double)axes[8 + d]);
        }
    }
    return m;
}

void pal_contact_points_begin_slots(pal_contact_points *points)
{
    points->stamp++;
    points->n_slot = points->n_node = 0;
}

static void use_node(pal_contact_points *points, int node)
{
    if (points->node_mark[node] == points->stamp) return;
    points->node_mark[node] = points->stamp;
    pal_set3(points->force + 3 * (size_t)node, 0, 0, 0);
    points->node[points->n_node++] = node;
}

void pal_contact_points_use_slot(pal_contact_points *points, const pal_body *body, int slot)
{
    if (points->slot_mark[slot] == points->stamp) return;
    points->slot_mark[slot] = points->stamp;
    points->slot[points->n_slot++] = slot;
    memset(points->state + 6 * (size_t)slot, 0, 6 * sizeof *points->state);
    use_node(points, pal_contact_points_slot_node(body, slot));
    if (!body->display.skin) return;
    pal_frame_spin *spin = &points->spin[slot];
    if (points->spin_mark[slot] != points->sub_step)
        pal_frame_spin_find(body, slot, points->face + body->display.skin->fan_start[slot], spin);
    points->spin_mark[slot] = points->sub_step;
    if (!spin->turns) return;
    use_node(points, spin->end);
    for (int i = 0; i < spin->n_face; i++) {
        use_node(points, spin->face[i].a);
        use_node(points, spin->face[i].b);
    }
}

void pal_contact_points_to_slots(pal_contact_points *points, const pal_body *body, const double *u)
{
    for (int i = 0; i < points->n_slot; i++) {
        int slot = points->slot[i];
        double *state = points->state + 6 * (size_t)slot;
        pal_copy3(state, u + 3 * (size_t)pal_contact_points_slot_node(body, slot));
        if (body->display.skin) pal_frame_spin_of(&points->spin[slot], u, state + 3);
    }
}

void pal_contact_points_from_slots(const pal_contact_points *points, const pal_body *body, double *out)
{
    for (int i = 0; i < points->n_slot; i++) {
        int slot = points->slot[i];
        double *to = out + 3 * (size_t)pal_contact_points_slot_node(body, slot), own[3];
        pal_copy3(own, points->state + 6 * (size_t)slot);
        if (body->display.skin)
            pal_frame_spin_add_torque(&points->spin[slot], points->state + 6 * (size_t)slot + 3, own, out);
        pal_add3(to, to, own);
    }
}

/* ---- forces ---- */

void pal_contact_points_add_force(pal_contact_points *points, const pal_body *body, int point, const double force_N[3])
{
    pal_contact_slot part[PAL_CONTACT_POINT_SLOTS];
    int n = pal_contact_points_slots(points, body, point, part);
    for (int k = 0; k < n; k++) {
        double *state = points->state + 6 * (size_t)part[k].slot, moment[3];
        pal_contact_points_use_slot(points, body, part[k].slot);
        pal_axpy3(state, part[k].weight, force_N);
        pal_cross3(moment, part[k].arm, force_N);
        pal_add3(state + 3, state + 3, moment);
    }
}

double pal_contact_points_max_force_N(const pal_contact_points *points)
{
    double max = 0;
    for (int i = 0; i < points->n_node; i++) max = fmax(max, pal_norm3(points->force + 3 * (size_t)points->node[i]));
    return max;
}

double pal_contact_points_assemble(pal_contact_points *points, const pal_body *body)
{
    pal_contact_points_from_slots(points, body, points->force);
    return pal_contact_points_max_force_N(points);
}

double pal_tool_force_share(const pal_body *body, const pal_tool *tool, const double force_N[3], double max_node_N)
{
    /* |g + s f|^2 <= cap^2, g the force so far */
    double cap = tool->force_cap_N * tool->ramp, share = 1;
    double a = pal_dot3(force_N, force_N), b = pal_dot3(tool->force_N, force_N);
    double c = pal_dot3(tool->force_N, tool->force_N) - cap * cap;
    if (a > 0 && a + 2 * b + c > 0) share = c >= 0 ? 0 : fmin(fmax((-b + sqrt(b * b - a * c)) / a, 0), 1);
    return body->load_cap_N > 0 && max_node_N > body->load_cap_N ? fmin(share, body->load_cap_N / max_node_N) : share;
}

/* motion of a point along `away` when the slots move as in `state` */
static double point_motion(const pal_contact_points *points, const pal_body *body, const pal_contact *contact)
{
    pal_contact_slot part[PAL_CONTACT_POINT_SLOTS];
    int n = pal_contact_points_slots(points, body, contact->point, part);
    double sum = 0, rotation[3];
    for (int k = 0; k < n; k++) {
        const double *state = points->state + 6 * (size_t)part[k].slot;
        pal_cross3(rotation, state + 3, part[k].arm);
        sum += part[k].weight * pal_dot3(contact->away, state);
        sum += pal_dot3(contact->away, rotation);
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
        int32_t node = body->display.shown_node[vertex[c]];
        if (bound_N_m) bound_N_m[node] += k_N_m * share[c];
        rate += k_N_m * share[c] * pal_body_inverse_mass_1_kg(body, node);
    }
    return rate;
}

/* state of a slot: sums of the stiffness that moves with it, and of the one that turns with it */
void pal_contact_points_add_bound(pal_contact_points *points, const pal_body *body, const pal_contact *contact,
                                  double k_N_m)
{
    pal_contact_slot part[PAL_CONTACT_POINT_SLOTS];
    double lever[PAL_CONTACT_POINT_SLOTS], moment[3], sum = 0;
    const int n = pal_contact_points_slots(points, body, contact->point, part);
    for (int k = 0; k < n; k++) {
        pal_contact_points_use_slot(points, body, part[k].slot);
        pal_cross3(moment, part[k].arm, contact->away);
        lever[k] = body->display.skin && points->spin[part[k].slot].turns ? pal_norm3(moment) : 0;
        sum += fabs(part[k].weight) + (lever[k] > 0 ? lever[k] * points->spin[part[k].slot].all : 0);
    }
    for (int k = 0; k < n; k++) {
        double *state = points->state + 6 * (size_t)part[k].slot;
        state[0] += k_N_m * sum * fabs(part[k].weight), state[1] += k_N_m * sum * lever[k];
    }
}

void pal_contact_points_assemble_bound(const pal_contact_points *points, const pal_body *body, double *bound_N_m)
{
    for (int i = 0; i < points->n_slot; i++) {
        const int slot = points->slot[i];
        const double *state = points->state + 6 * (size_t)slot;
        bound_N_m[pal_contact_points_slot_node(body, slot)] += state[0];
        if (body->display.skin) pal_frame_spin_add_bound(&points->spin[slot], state[1], bound_N_m);
    }
}

double pal_contact_points_max_eigenvalue(pal_contact_points *points, const pal_body *body, const double *diagonal,
                                         const pal_contact *contact, int n)
{
    /* a patch of very many points is judged by a part of them, each standing for several */
    int stride = (n + EIGENVALUE_POINTS - 1) / EIGENVALUE_POINTS, m = 0;
    double motion[EIGENVALUE_POINTS], rate = 0;
    for (int i = 0; i < n; i += stride) motion[m++] = 1;
    for (int pass = 0; pass < EIGENVALUE_PASSES && m > 0; pass++) {
        double with = 0, before = 0, f[3];
        /* forces of the present motion, then accelerations */
        pal_contact_points_begin_slots(points);
        for (int i = 0; i < m; i++) {
            const pal_contact *c = &contact[i * stride];
            pal_scale3(f, stride * c->k_N_m * motion[i], c->away);
            pal_contact_points_add_force(points, body, c->point, f);
        }
        pal_contact_points_from_slots(points, body, points->force);
        for (int i = 0; i < points->n_node; i++) {
            const int node = points->node[i];
            double *at = points->force + 3 * (size_t)node;
            pal_scale3(at, body->support[node] || !(diagonal[node] > 0) ? 0 : 1 / diagonal[node], at);
        }
        pal_contact_points_to_slots(points, body, points->force);
        /* the points' motion then: a Rayleigh quotient in the norm of k */
        for (int i = 0; i < m; i++) {
            const pal_contact *c = &contact[i * stride];
            double next = point_motion(points, body, c);
            with += c->k_N_m * next * next;
            before += c->k_N_m * motion[i] * motion[i];
            motion[i] = next;
        }
        rate = before > 0 ? sqrt(with / before) : 0;
        for (int i = 0; i < m; i++) motion[i] *= rate > 0 ? 1 / rate : 0;
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
        pal_material_painted(def, body->display.surface->x + 3 * (size_t)i, &at);
        if (at.young_Pa != def->material.young_Pa) (*out)[i] = (float)at.young_Pa;
    }
    return PAL_ERR_OK;
}

bool pal_contact_points_overlap(pal_contact_points *points, const pal_body *body, const pal_contact *a, int n_a,
                                const pal_contact *b, int n_b)
{
    pal_contact_slot part[PAL_CONTACT_POINT_SLOTS];
    points->stamp++;
    for (int i = 0; i < n_a + n_b; i++) {
        int n = pal_contact_points_slots(points, body, (i < n_a ? a + i : b + i - n_a)->point, part);
        for (int k = 0; k < n; k++)
            if (i < n_a)
                points->tool_mark[part[k].slot] = points->stamp;
            else if (points->tool_mark[part[k].slot] == points->stamp)
                return true;
    }
    return false;
}
