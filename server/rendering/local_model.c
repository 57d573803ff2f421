#include "server/rendering/local_model.h"
#include "server/base/vec3.h"
#include "server/rendering/tuning.h"

#include <string.h>

static double between(double a, double b, double share)
{
    return a + share * (b - a);
}

static void between3(double r[3], const double a[3], const double b[3], double share)
{
    for (int k = 0; k < 3; k++) r[k] = between(a[k], b[k], share);
}

static void patch_mix(const pal_local_patch *a, const pal_local_patch *b, double share, double age_s,
                      pal_local_patch *out)
{
    /* planes count by their stiffness, so that k (p - x) is interpolated and not its factors, whose product has a hump
     */
    const double k = between(a->k1_N_m, b->k1_N_m, share);
    *out = *b;
    between3(out->p_m, a->p_m, b->p_m, k > 0 ? share * b->k1_N_m / k : share);
    between3(out->v_m_s, a->v_m_s, b->v_m_s, share);
    between3(out->n, a->n, b->n, share);
    /* opposite normals have no direction between: the nearer one */
    if (!pal_unit3(out->n, out->n, 1e-3)) pal_copy3(out->n, share < 0.5 ? a->n : b->n);
    pal_axpy3(out->p_m, fmin(fmax(age_s, 0), EXTRAPOLATE_MAX_S), out->v_m_s);
    out->k1_N_m = k;
    out->k2_N_m2 = between(a->k2_N_m2, b->k2_N_m2, share);
    out->b_Ns_m = between(a->b_Ns_m, b->b_Ns_m, share);
    out->kt_N_m = between(a->kt_N_m, b->kt_N_m, share);
    out->mu_s = between(a->mu_s, b->mu_s, share);
    out->mu_d = between(a->mu_d, b->mu_d, share);
    out->radius_m = between(a->radius_m, b->radius_m, share);
}

/* r = K a */
static void multiply(const double K[6], const double a[3], double r[3])
{
    const double x = K[0] * a[0] + K[1] * a[1] + K[2] * a[2], y = K[1] * a[0] + K[3] * a[1] + K[4] * a[2],
                 z = K[2] * a[0] + K[4] * a[1] + K[5] * a[2];
    pal_set3(r, x, y, z);
}

/* refers the spring to another point; the force field is the same */
static void grasp_move(pal_local_grasp *g, const double at_m[3])
{
    double step[3], less[3];
    pal_sub3(step, at_m, g->at_m);
    multiply(g->K_N_m, step, less);
    pal_sub3(g->f_N, g->f_N, less);
    pal_copy3(g->at_m, at_m);
}

void pal_local_blend_mix(const pal_local_blend *blend, double lambda, double age_s, pal_local_model *out)
{
    const pal_local_grasp *a = &blend->from.grasp, *b = &blend->to.grasp;
    out->n_patch = blend->to.n_patch;
    for (int i = 0; i < out->n_patch; i++)
        patch_mix(&blend->from.patch[i], &blend->to.patch[i], lambda, age_s, &out->patch[i]);
    /* both refer to the same point */
    pal_copy3(out->grasp.at_m, b->at_m);
    between3(out->grasp.f_N, a->f_N, b->f_N, lambda);
    for (int k = 0; k < 6; k++) out->grasp.K_N_m[k] = between(a->K_N_m[k], b->K_N_m[k], lambda);
    out->grasp.b_Ns_m = between(a->b_Ns_m, b->b_Ns_m, lambda);
    between3(out->grasp.arm_m, a->arm_m, b->arm_m, lambda);
}

static void patch_of_wire(const pal_wire_haptic *model, const pal_wire_contact_patch *from, pal_local_patch *to)
{
    *to = (pal_local_patch){.id = from->id,
                            .group = from->group,
                            .k1_N_m = (double)from->k1_N_m,
                            .k2_N_m2 = (double)from->k2_N_m2,
                            .b_Ns_m = (double)from->b_N_s_m,
                            .kt_N_m = (double)from->kt_N_m,
                            .mu_s = (double)from->mu_s,
                            .mu_d = (double)from->mu_d,
                            .radius_m = (double)from->radius_m};
    for (int k = 0; k < 3; k++) {
        to->p_m[k] = model->origin_m[k] + (double)from->p_m[k];
        to->n[k] = (double)from->n[k];
        to->v_m_s[k] = (double)from->v_m_s[k];
    }
}

/* eigenvalues w and unit eigenvectors (rows of v) of a symmetric matrix by Jacobi's rotations */
static void eigen3(const double K[6], double w[3], double v[3][3])
{
    double a[3][3] = {{K[0], K[1], K[2]}, {K[1], K[3], K[4]}, {K[2], K[4], K[5]}};
    for (int i = 0; i < 9; i++) v[i / 3][i % 3] = i % 4 == 0;
    /* cubic convergence: 6 sweeps reach rounding */
    for (int turn = 0; turn < 18; turn++) {
        const int p = turn % 3, q = (p + 1) % 3;
        if (a[p][q] == 0) continue;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double t = copysign(1, theta) / (fabs(theta) + sqrt(theta * theta + 1));
        const double c = 1 / sqrt(t * t + 1), s = t * c;
        for (int k = 0; k < 3; k++) {
            const double x = a[k][p], y = a[k][q];
            a[k][p] = c * x - s * y, a[k][q] = s * x + c * y;
        }
        for (int k = 0; k < 3; k++) {
            const double x = a[p][k], y = a[q][k], vx = v[p][k], vy = v[q][k];
            a[p][k] = c * x - s * y, a[q][k] = s * x + c * y;
            v[p][k] = c * vx - s * vy, v[q][k] = s * vx + c * vy;
        }
    }
    for (int k = 0; k < 3; k++) w[k] = a[k][k];
}

static void grasp_of_wire(const pal_wire_haptic *model, const pal_local_limits *limits, pal_local_grasp *to)
{
    double K[6], w[3], v[3][3], f[3], max = 0;
    *to = (pal_local_grasp){0};
    for (int k = 0; k < 3; k++) to->at_m[k] = model->origin_m[k] + (double)model->grasp_x0_m[k];
    if (!model->has_grasp) return;
    for (int k = 0; k < 3; k++) f[k] = (double)model->grasp_f0_N[k], to->arm_m[k] = (double)model->grasp_arm_m[k];
    for (int k = 0; k < 6; k++) K[k] = (double)model->grasp_k_N_m[k];
    eigen3(K, w, v);
    for (int i = 0; i < 3; i++) {
        const double k = fmin(w[i], limits->stiffness_max_N_m);
        if (!(k >= GRASP_STIFFNESS_MIN_N_M)) continue;
        const double *e = v[i], along = pal_dot3(f, e);
        pal_axpy3(to->f_N, along, e);
        for (int r = 0, at = 0; r < 3; r++)
            for (int c = r; c < 3; c++) to->K_N_m[at++] += k * e[r] * e[c];
        max = fmax(max, k);
    }
    const double b = fmax((double)model->grasp_b_N_s_m, limits->damping_floor_s * max);
    to->b_Ns_m = fmin(b, limits->damping_max_Ns_m);
}

/* the patch of the model in use with this id and group that is not going out; -1: none */
static int patch_find(const pal_local_model *in, const bool *lives, uint16_t id, uint16_t group)
{
    for (int i = 0; i < in->n_patch; i++)
        if (lives[i] && in->patch[i].id == id && in->patch[i].group == group) return i;
    return -1;
}

/* whether the convex group of a patch has the same patches in both models */
static bool group_same(const pal_wire_haptic *model, uint16_t group, const pal_local_model *in, const bool *lives)
{
    int n_new = 0, n_old = 0;
    for (uint32_t i = 0; i < model->n_patch; i++) {
        if (model->patch[i].group != group) continue;
        if (patch_find(in, lives, model->patch[i].id, group) < 0) return false;
        n_new++;
    }
    for (int i = 0; i < in->n_patch; i++) n_old += lives[i] && in->patch[i].group == group;
    return n_new == n_old;
}

static void patch_without_force(pal_local_patch *p)
{
    p->k1_N_m = p->k2_N_m2 = p->b_Ns_m = p->kt_N_m = 0;
}

static bool patch_is_going(const pal_local_patch *p)
{
    return p->k1_N_m == 0 && p->k2_N_m2 == 0;
}

static bool model_finite(const pal_wire_haptic *m)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += fabs(m->origin_m[k]) +
               (double)(fabsf(m->grasp_x0_m[k]) + fabsf(m->grasp_f0_N[k]) + fabsf(m->grasp_arm_m[k]));
    for (int k = 0; k < 6; k++) sum += (double)fabsf(m->grasp_k_N_m[k]);
    sum += (double)fabsf(m->grasp_b_N_s_m);
    for (uint32_t i = 0; i < m->n_patch; i++) {
        const pal_wire_contact_patch *p = &m->patch[i];
        for (int k = 0; k < 3; k++) sum += (double)(fabsf(p->p_m[k]) + fabsf(p->n[k]) + fabsf(p->v_m_s[k]));
        sum += (double)(fabsf(p->k1_N_m) + fabsf(p->k2_N_m2) + fabsf(p->b_N_s_m) + fabsf(p->kt_N_m));
        sum += (double)(fabsf(p->mu_s) + fabsf(p->mu_d) + fabsf(p->radius_m));
    }
    return isfinite(sum);
}

bool pal_local_blend_start(pal_local_blend *blend, double lambda, double age_s, const pal_wire_haptic *model,
                           const pal_local_limits *limits)
{
    if (model->n_patch > PAL_WIRE_CONTACT_PATCH_MAX || !model_finite(model)) return false;
    pal_local_model in;
    bool lives[PAL_LOCAL_PATCH_MAX], taken[PAL_LOCAL_PATCH_MAX] = {false};
    pal_local_blend_mix(blend, lambda, age_s, &in);
    for (int i = 0; i < in.n_patch; i++)
        lives[i] = !patch_is_going(&blend->to.patch[i]) && !(model->flags & PAL_WIRE_HAPTIC_TOPOLOGY_CHANGED);
    pal_local_model *from = &blend->from, *to = &blend->to;
    /* patches of the new model, with the one in use that each continues */
    int n = 0;
    for (uint32_t i = 0; i < model->n_patch; i++) {
        patch_of_wire(model, &model->patch[i], &to->patch[n]);
        const uint16_t group = to->patch[n].group;
        const int old = group_same(model, group, &in, lives) ? patch_find(&in, lives, to->patch[n].id, group) : -1;
        if (old >= 0) {
            taken[old] = true;
            from->patch[n] = in.patch[old];
            to->patch[n].key = in.patch[old].key;
        } else {
            uint32_t key = 0;
            for (int j = 0; j < n && !key; j++)
                if (to->patch[j].group == group) key = to->patch[j].key;
            to->patch[n].key = key ? key : ++blend->next_key;
            from->patch[n] = to->patch[n];
            patch_without_force(&from->patch[n]);
        }
        n++;
    }
    /* the others go out; of those that went out already only what a hand notices */
    for (int i = 0; i < in.n_patch && n < PAL_LOCAL_PATCH_MAX; i++) {
        if (taken[i] || (!lives[i] && in.patch[i].k1_N_m < PATCH_STIFFNESS_MIN_N_M)) continue;
        from->patch[n] = to->patch[n] = in.patch[i];
        patch_without_force(&to->patch[n++]);
    }
    from->n_patch = to->n_patch = n;
    from->grasp = in.grasp;
    grasp_of_wire(model, limits, &to->grasp);
    grasp_move(&from->grasp, to->grasp.at_m);
    return true;
}
