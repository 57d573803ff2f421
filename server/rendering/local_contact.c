#include "server/rendering/local_contact.h"
#include "server/base/vec3.h"
#include "server/rendering/tuning.h"

/* the acting patch of a convex group at a place */
typedef struct acting {
    const pal_local_patch *patch;
    double depth_m, fall; /* fall: 1 within the patch's radius, 0 beyond 1.5 of it */
    double normal_N, slope_N_m, energy_J;
    double kt_N_m;
    bool clamped, saturated;
} acting;

static double patch_depth(const pal_local_patch *p, const double x[3])
{
    double away[3];
    pal_sub3(away, p->p_m, x);
    return pal_dot3(p->n, away);
}

static double smooth_fall(double low, double high, double at)
{
    if (!(high > low) || at <= low) return 1;
    const double t = (at - low) / (high - low);
    return t >= 1 ? 0 : 1 - t * t * (3 - 2 * t);
}

/* normal force and its integral at depth d: k1 d + k2 d^2, from the depth where the tangent leaves [0, k_max] on
 * straight, from f_max on constant */
static void patch_elastic(const pal_local_patch *p, double d, const pal_local_limits *limits, acting *a)
{
    const double k_max = limits->stiffness_max_N_m, f_max = limits->force_max_N, k1 = p->k1_N_m, k2 = p->k2_N_m2;
    const double k_end = k2 > 0 || k1 >= k_max ? k_max : 0;
    const double d1 = k1 >= k_max ? 0 : (k2 != 0 ? (k_end - k1) / (2 * k2) : INFINITY);
    const double f1 = d1 < INFINITY ? k1 * d1 + k2 * d1 * d1 : INFINITY;
    /* depth at which the force ends */
    double d_max = INFINITY;
    if (f_max <= f1)
        d_max = 2 * f_max / (k1 + sqrt(fmax(0, k1 * k1 + 4 * k2 * f_max)));
    else if (k_end > 0)
        d_max = d1 + (f_max - f1) / k_end;
    const double at = fmin(d, d_max), curved = fmin(at, d1), straight = at - curved;
    a->slope_N_m = straight > 0 ? k_end : k1 + 2 * k2 * curved;
    a->normal_N = k1 * curved + k2 * curved * curved + k_end * straight;
    a->energy_J = k1 * curved * curved / 2 + k2 * curved * curved * curved / 3;
    if (straight > 0) a->energy_J += f1 * straight + k_end * straight * straight / 2;
    if (d > at) a->energy_J += f_max * (d - at);
    a->clamped = straight > 0 && k_end > 0;
    a->saturated = d > at;
}

static int memory_find(const pal_local_contact_state *memory, uint32_t key)
{
    for (int i = 0; memory && i < memory->n_group; i++)
        if (memory->group[i].key == key) return i;
    return -1;
}

/* the memory of a group, or where that is new, of one that it replaces: friction goes on with its anchor */
static int memory_of(const pal_local_contact_state *memory, const pal_local_patch *p)
{
    int at = memory_find(memory, p->key);
    for (int i = 0; at < 0 && memory && i < memory->n_group; i++)
        if (memory->group[i].group == p->group) at = i;
    return at;
}

/* the acting patch of the group that patch `first` opens; false: no contact */
static bool group_at(const pal_local_model *model, int first, const double x[3], const pal_local_limits *limits,
                     const pal_local_contact_state *memory, acting *a)
{
    const uint32_t key = model->patch[first].key;
    for (int i = 0; i < first; i++)
        if (model->patch[i].key == key) return false; /* seen before */
    const int known = memory_find(memory, key);
    double min = INFINITY;
    *a = (acting){0};
    for (int i = first; i < model->n_patch; i++) {
        const pal_local_patch *p = &model->patch[i];
        if (p->key != key) continue;
        const double depth = patch_depth(p, x);
        if (!(depth > 0)) return false;
        const bool was = known >= 0 && memory->group[known].id == p->id;
        const double ranked = depth - (was ? HYSTERESIS_M : 0);
        if (ranked < min) min = ranked, a->patch = p, a->depth_m = depth;
    }
    patch_elastic(a->patch, a->depth_m, limits, a);
    double away[3];
    pal_sub3(away, a->patch->p_m, x);
    pal_axpy3(away, -a->depth_m, a->patch->n);
    const double r = a->patch->radius_m;
    a->fall = r > 0 ? smooth_fall(r, 1.5 * r, pal_norm3(away)) : 1;
    a->kt_N_m = fmin(a->patch->kt_N_m, limits->stiffness_max_N_m);
    return true;
}

/* tangential part of a vector */
static void tangential(const pal_local_patch *p, const double a[3], double r[3])
{
    pal_copy3(r, a);
    pal_axpy3(r, -pal_dot3(p->n, a), p->n);
}

/* e: tangential stretch from the anchor; zero for a contact that is new */
static void stretch_of(const pal_local_patch *p, const double x[3], const pal_local_contact_state *memory, double e[3])
{
    const int at = memory_of(memory, p);
    pal_set3(e, 0, 0, 0);
    if (at < 0) return;
    pal_sub3(e, x, memory->group[at].anchor_m);
    tangential(p, e, e);
}

/* elastic force of the grasp, at most force_max, and its energy f K^-1 f / 2; K is factored as L D L' */
static double grasp_at(const pal_local_grasp *g, const double x[3], const pal_local_limits *limits, double f[3],
                       bool *saturated)
{
    const double *K = g->K_N_m;
    double away[3];
    pal_sub3(away, x, g->at_m);
    f[0] = g->f_N[0] - K[0] * away[0] - K[1] * away[1] - K[2] * away[2];
    f[1] = g->f_N[1] - K[1] * away[0] - K[3] * away[1] - K[4] * away[2];
    f[2] = g->f_N[2] - K[2] * away[0] - K[4] * away[1] - K[5] * away[2];
    const double min = 1e-9 * (K[0] + K[3] + K[5]);
    *saturated = false;
    if (!(min > 0)) return 0;
    /* a pivot of rounding stands for an axis without stiffness, where f is zero as well */
    const double d0 = K[0] > min ? 1 / K[0] : 0, l1 = K[1] * d0, l2 = K[2] * d0;
    const double p1 = K[3] - l1 * K[1], d1 = p1 > min ? 1 / p1 : 0, m = (K[4] - l2 * K[1]) * d1;
    const double p2 = K[5] - l2 * K[2] - m * (K[4] - l2 * K[1]), d2 = p2 > min ? 1 / p2 : 0;
    const double y1 = f[1] - l1 * f[0], y2 = f[2] - l2 * f[0] - m * y1;
    double energy = (f[0] * f[0] * d0 + y1 * y1 * d1 + y2 * y2 * d2) / 2;
    const double size = pal_norm3(f);
    if (size > limits->force_max_N) {
        /* exact for equal stiffness in all directions; what others lack is work that the energy tank sees */
        const double share = limits->force_max_N / size;
        energy *= share * (2 - share);
        pal_scale3(f, share, f);
        *saturated = true;
    }
    return energy;
}

double pal_local_contact_energy(const pal_local_model *model, const double x_m[3], const pal_local_limits *limits,
                                const pal_local_contact_state *memory)
{
    double f[3], e[3];
    bool saturated;
    double energy = grasp_at(&model->grasp, x_m, limits, f, &saturated);
    acting a;
    for (int i = 0; i < model->n_patch; i++) {
        if (!group_at(model, i, x_m, limits, memory, &a)) continue;
        stretch_of(a.patch, x_m, memory, e);
        energy += a.fall * (a.energy_J + a.kt_N_m * pal_dot3(e, e) / 2);
    }
    return energy;
}

/* friction of one contact; its memory moves on */
static void friction(const acting *a, const double x[3], const double v[3], double dt, const pal_local_limits *limits,
                     const pal_local_contact_state *before, pal_local_contact_state *now, double f[3])
{
    const pal_local_patch *p = a->patch;
    const int known = memory_of(before, p), at = now->n_group++;
    double e[3], v_t[3];
    stretch_of(p, x, before, e);
    pal_sub3(v_t, v, p->v_m_s);
    tangential(p, v_t, v_t);
    bool slides = known >= 0 && before->group[known].slides && pal_norm3(v_t) > REST_SPEED_M_S;
    const double pulls = a->kt_N_m * pal_norm3(e);
    const double max = (slides ? p->mu_d : p->mu_s) * a->normal_N;
    if (pulls > max) {
        slides = true;
        pal_scale3(e, p->mu_d * a->normal_N / pulls, e);
    } else if (slides && pulls < p->mu_d * a->normal_N) {
        slides = false; /* turned back */
    }
    pal_scale3(f, -a->kt_N_m, e);
    if (!slides) {
        /* damping of a contact that sticks, within what friction holds */
        pal_axpy3(f, -fmin(limits->damping_max_Ns_m, limits->damping_floor_s * a->kt_N_m), v_t);
        const double size = pal_norm3(f);
        if (size > max) pal_scale3(f, max / size, f);
    }
    now->group[at].key = p->key, now->group[at].group = p->group, now->group[at].id = p->id;
    now->group[at].slides = slides;
    pal_sub3(now->group[at].anchor_m, x, e);
    pal_axpy3(now->group[at].anchor_m, dt, p->v_m_s);
    pal_scale3(now->group[at].arm_m, -p->radius_m, p->n);
}

void pal_local_contact_force(const pal_local_model *model, const double x_m[3], const double v_m_s[3], double dt_s,
                             const pal_local_limits *limits, pal_local_contact_state *memory,
                             pal_local_contact_result *out)
{
    static const pal_local_contact_state nothing;
    pal_local_contact_state now;
    now.n_group = 0;
    *out = (pal_local_contact_result){0};
    acting a;
    grasp_at(&model->grasp, x_m, limits, out->force_N, &out->saturated);
    pal_axpy3(out->force_N, -model->grasp.b_Ns_m, v_m_s);
    pal_cross3(out->torque_N_m, model->grasp.arm_m, out->force_N);
    for (int i = 0; i < model->n_patch; i++) {
        if (!group_at(model, i, x_m, limits, memory, &a)) continue;
        const pal_local_patch *p = a.patch;
        const double floor_b = limits->damping_floor_s * a.slope_N_m;
        const double b = fmin(fmax(p->b_Ns_m, floor_b), limits->damping_max_Ns_m);
        double f[3], arm[3], turn[3], approach[3];
        friction(&a, x_m, v_m_s, dt_s, limits, memory ? memory : &nothing, &now, f);
        if (!memory) pal_set3(f, 0, 0, 0);
        pal_sub3(approach, v_m_s, p->v_m_s);
        pal_axpy3(f, fmax(0, a.normal_N - b * pal_dot3(p->n, approach)), p->n);
        pal_scale3(f, a.fall, f);
        pal_add3(out->force_N, out->force_N, f);
        pal_scale3(arm, -p->radius_m, p->n);
        pal_cross3(turn, arm, f);
        pal_add3(out->torque_N_m, out->torque_N_m, turn);
        pal_copy3(out->proxy_m[out->n_contact], x_m);
        pal_axpy3(out->proxy_m[out->n_contact++], a.depth_m, p->n);
        out->depth_m = fmax(out->depth_m, a.depth_m);
        out->clamped = out->clamped || a.clamped;
        out->saturated = out->saturated || a.saturated;
    }
    if (!memory) return;
    memory->n_group = now.n_group;
    for (int i = 0; i < now.n_group; i++) memory->group[i] = now.group[i];
}

void pal_local_contact_turn(pal_local_contact_state *memory, const double turn_rad[3])
{
    for (int i = 0; i < memory->n_group; i++) {
        double move[3];
        pal_cross3(move, turn_rad, memory->group[i].arm_m);
        pal_sub3(memory->group[i].anchor_m, memory->group[i].anchor_m, move);
    }
}
