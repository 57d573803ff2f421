/* Rendered stiffness (haptic_stiffness.h). */
#include "server/sim/contact/haptic_stiffness.h"

#include "server/base/vec3.h"
#include "server/sim/contact/contact_implicit.h"
#include "server/sim/contact/tuning.h"

/* ---- least squares ---- */

void pal_stiffness_fit_start(pal_stiffness_fit *fit, double k_start_N_m)
{
    *fit = (pal_stiffness_fit){.last_m = {INFINITY}, .k_N_m = k_start_N_m, .k_start_N_m = k_start_N_m};
}

void pal_stiffness_fit_add(pal_stiffness_fit *fit, const double x_m[3], const double f_N[3], double radius_m)
{
    const double length_m = SHALLOW_RADII * radius_m, prior_m = 0.1 * length_m;
    /* the first sample has all the weight, as the one before it is infinitely far */
    const double old = exp(-pal_dist3(x_m, fit->last_m) / length_m), new = 1 - old;
    pal_copy3(fit->last_m, x_m);
    for (int c = 0; c < 3; c++) {
        fit->x[c] = old * fit->x[c] + new *x_m[c];
        fit->f[c] = old * fit->f[c] + new *f_N[c];
    }
    fit->xx = old * fit->xx + new *pal_dot3(x_m, x_m);
    fit->xf = old * fit->xf + new *pal_dot3(x_m, f_N);
    double variance = fit->xx - pal_dot3(fit->x, fit->x), with = fit->xf - pal_dot3(fit->x, fit->f);
    fit->k_N_m = (with + fit->k_start_N_m * prior_m * prior_m) / (variance + prior_m * prior_m);
}

double pal_haptic_stiffness_clamp(double k_N_m)
{
    return fmin(fmax(k_N_m, STIFFNESS_N_M.low), STIFFNESS_N_M.high);
}

/* ---- kept answers ---- */

static int find_entry(const pal_haptic_stiffness *known, const pal_contact_group *group)
{
    int best = -1;
    double cosine = PAL_SAME_COSINE;
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX; i++) {
        const pal_haptic_stiffness_entry *e = &known->entry[i];
        if (!e->used || e->contact != (group->force_N > 0)) continue;
        double c = pal_dot3(e->normal, group->normal);
        if (c > cosine) cosine = c, best = i;
    }
    return best;
}

bool pal_haptic_stiffness_find(const pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                               double min_m)
{
    int i = find_entry(known, group);
    const pal_haptic_stiffness_entry *e = &known->entry[i < 0 ? 0 : i];
    double change[3];
    group->k_N_m = i < 0 ? 0 : e->k_N_m;
    group->sideways = i < 0 ? 0 : e->sideways;
    if (i < 0) return true;
    pal_scale3(change, group->force_N, group->normal);
    pal_axpy3(change, -e->force_N, e->normal);
    if (known->time_s - e->time_s < known->follow_s * (1 - 1e-9)) return false;
    return pal_dist3(e->at_m, at_m) > min_m || pal_norm3(change) > FORCE_SHARE * e->force_N ||
           fabs(group->gap_m - e->gap_m) > min_m;
}

double pal_haptic_stiffness_max(const pal_haptic_stiffness *known, double k_N_m)
{
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX; i++)
        if (known->entry[i].used && known->entry[i].contact) k_N_m = fmax(k_N_m, known->entry[i].k_N_m);
    return k_N_m;
}

static void keep(pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3], double k_N_m)
{
    int i = find_entry(known, group);
    for (int j = 0; j < PAL_CONTACT_PATCH_MAX && i < 0; j++)
        if (!known->entry[j].used) i = j;
    if (i < 0) i = known->next++ % PAL_CONTACT_PATCH_MAX;
    group->k_N_m = k_N_m;
    pal_haptic_stiffness_entry *e = &known->entry[i];
    /* another contact that takes its place knows nothing across */
    const bool same =
        e->used && e->contact == (group->force_N > 0) && pal_dot3(e->normal, group->normal) > PAL_SAME_COSINE;
    *e = (pal_haptic_stiffness_entry){.used = true,
                                      .sideways = same ? e->sideways : 0,
                                      .time_s = known->time_s,
                                      .contact = group->force_N > 0,
                                      .force_N = group->force_N,
                                      .gap_m = group->gap_m,
                                      .k_N_m = k_N_m};
    pal_copy3(e->normal, group->normal);
    pal_copy3(e->at_m, at_m);
}

/* ---- contact ---- */

/* loss of normal force for each metre against the normal, as tissue moves with `answer` and the contact turns */
static double turned_N_m(const pal_contact_points *points, const pal_body *body, const pal_contact *contact,
                         double radius_m, const double normal[3], const double *answer)
{
    pal_contact_slot part[PAL_CONTACT_POINT_SLOTS];
    double r[3];
    int n = pal_contact_points_slots(points, body, contact->point, part);
    pal_copy3(r, normal);
    for (int k = 0; k < n; k++)
        pal_axpy3(r, part[k].weight, answer + 3 * (size_t)pal_contact_points_slot_node(body, part[k].slot));
    pal_axpy3(r, -pal_dot3(r, contact->away), contact->away);
    return contact->normal_N * pal_dot3(r, normal) / (radius_m - contact->depth_m);
}

void pal_haptic_stiffness_contact(pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                                  const pal_compliance *compliance, pal_contact_springs *springs, int first,
                                  const pal_contact *contact, int n, double radius_m, pal_arena *scratch)
{
    const pal_body *body = springs->body;
    size_t used = pal_arena_used(scratch);
    double *answer = PAL_NEW(scratch, double, 3 * (size_t)body->n_node), lost = 0;
    int32_t row[PAL_CONTACT_IMPLICIT_MAX];
    double share[PAL_CONTACT_IMPLICIT_MAX], inward[3];
    int m = 0;
    pal_scale3(inward, -1, group->normal);
    for (int i = 0; i < n; i++) {
        if (!pal_contact_group_has(inward, contact[i].away)) continue;
        if (contact[i].normal_N == 0 || springs->k_N_m[first + i] <= 0) continue;
        share[m] = pal_dot3(contact[i].away, inward);
        row[m++] = first + i;
    }
    double k = pal_contact_springs_stiffness(springs, compliance, row, share, m, STIFFNESS_PASSES, answer, scratch);
    for (int i = 0; i < m && answer && k > 0; i++)
        lost += turned_N_m(springs->points, body, &contact[row[i] - first], radius_m, group->normal, answer);
    pal_arena_rewind(scratch, used);
    if (k > 0) keep(known, group, at_m, fmax(STIFFNESS_N_M.low, k - lost));
}

/* ---- a weighted mean of nodes ---- */

/* how the mean moves for each newton along `direction` that is shared out by weight; node NULL: all nodes in order.
 * answer [n_node][3]: how all move */
static bool solve_mean(const pal_body *body, const pal_compliance *compliance, const int32_t *node,
                       const double *weight, int n, const double direction[3], double mean_m_N[3], double *answer,
                       pal_arena *scratch)
{
    size_t used = pal_arena_used(scratch), n3 = 3 * (size_t)body->n_node;
    double *load = PAL_NEW(scratch, double, n3);
    bool known = load && answer && compliance;
    for (int i = 0; i < n && known; i++) pal_axpy3(load + 3 * (size_t)(node ? node[i] : i), weight[i], direction);
    known = known && compliance->solve(compliance->self, body, load, answer);
    pal_set3(mean_m_N, 0, 0, 0);
    for (int i = 0; i < n && known; i++) pal_axpy3(mean_m_N, weight[i], answer + 3 * (size_t)(node ? node[i] : i));
    pal_arena_rewind(scratch, used);
    return known;
}

/* to [n_node] += weight shared out over the nodes that bear a point */
static void add_point(const pal_contact_points *points, const pal_body *body, int point, double weight, double *to)
{
    pal_contact_slot part[PAL_CONTACT_POINT_SLOTS];
    int m = pal_contact_points_slots(points, body, point, part);
    for (int k = 0; k < m; k++) to[pal_contact_points_slot_node(body, part[k].slot)] += weight * part[k].weight;
}

bool pal_haptic_stiffness_across(pal_haptic_stiffness *known, const pal_contact_group *group,
                                 const pal_contact_points *points, const pal_body *body,
                                 const pal_compliance *compliance, const pal_contact *contact, int n, double k_N_m,
                                 pal_arena *scratch)
{
    const int at = find_entry(known, group);
    pal_haptic_stiffness_entry *e = &known->entry[at < 0 ? 0 : at];
    if (at < 0 || !e->contact || e->n_across >= 2) return false;
    size_t used = pal_arena_used(scratch);
    double *sum = PAL_NEW(scratch, double, body->n_node), *answer = PAL_NEW(scratch, double, 3 * (size_t)body->n_node);
    double across[2][3], mean[3], inward[3], force = 0;
    pal_scale3(inward, -1, group->normal);
    for (int pass = 0; pass < 2 && sum; pass++)
        for (int i = 0; i < n; i++) {
            if (contact[i].normal_N <= 0 || !pal_contact_group_has(inward, contact[i].away)) continue;
            if (pass == 0) force += contact[i].normal_N;
            if (pass == 1) add_point(points, body, contact[i].point, contact[i].normal_N / force, sum);
        }
    pal_contact_group_across(e->normal, across);
    if (force > 0 && k_N_m > 0 &&
        solve_mean(body, compliance, NULL, sum, body->n_node, across[e->n_across], mean, answer, scratch))
        e->give_m_N[e->n_across] = 1 / k_N_m + fmax(0, pal_dot3(mean, across[e->n_across])), e->n_across++;
    pal_arena_rewind(scratch, used);
    if (e->n_across == 2 && e->k_N_m > 0) e->sideways = 2 / (e->give_m_N[0] + e->give_m_N[1]) / e->k_N_m;
    return true;
}

void pal_haptic_stiffness_near(pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                               const pal_contact_points *points, const pal_body *body, const pal_compliance *compliance,
                               const int32_t *point, const double *weight, int n, double k_N_m, pal_arena *scratch)
{
    size_t used = pal_arena_used(scratch);
    double *sum = PAL_NEW(scratch, double, body->n_node), *answer = PAL_NEW(scratch, double, 3 * (size_t)body->n_node);
    double inward[3], mean[3], give = 0;
    bool found = sum && k_N_m > 0;
    for (int i = 0; i < n && sum; i++) add_point(points, body, point[i], weight[i], sum);
    /* as contact presses: the solver starts from the answer to a load that is alike */
    pal_scale3(inward, -1, group->normal);
    found = found && solve_mean(body, compliance, NULL, sum, body->n_node, inward, mean, answer, scratch);
    if (found) give = 1 / k_N_m + pal_dot3(mean, inward);
    pal_arena_rewind(scratch, used);
    if (found) keep(known, group, at_m, give > 0 && isfinite(give) ? 1 / give : 0);
}

/* ---- grasp ---- */

void pal_grasp_compliance_update(pal_grasp_compliance *w, const pal_body *body, const pal_compliance *compliance,
                                 const int32_t *node, const double *weight, int n, const double at_m[3], double min_m,
                                 double follow_s, double step_s, pal_arena *scratch)
{
    double unit[3] = {0}, mean[3];
    int axis = w->next;
    w->since_s += step_s;
    if (!compliance) return;
    if (w->n_known == 3 && (w->since_s < follow_s / 3 || (axis == 0 && pal_dist3(w->at_m, at_m) < min_m))) return;
    unit[axis] = 1;
    size_t used = pal_arena_used(scratch);
    double *answer = PAL_NEW(scratch, double, 3 * (size_t)body->n_node);
    bool known = solve_mean(body, compliance, node, weight, n, unit, mean, answer, scratch);
    pal_arena_rewind(scratch, used);
    if (!known) return;
    pal_copy3(w->column_m_N[axis], mean);
    if (axis == 0) pal_copy3(w->at_m, at_m);
    if (w->n_known == axis) w->n_known++;
    w->next = (axis + 1) % 3;
    w->since_s = 0;
}

bool pal_grasp_compliance_series(const pal_grasp_compliance *w, double k_N_m, double K[6])
{
    const double(*give)[3] = w->column_m_N;
    const int n = w->n_known;
    double c[9], inverse[9];
    if (n == 0 || !(k_N_m > 0)) return false;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            c[3 * i + j] = i < n && j < n ? 0.5 * (give[i][j] + give[j][i]) : 0;
            if (i == j) c[3 * i + j] = (i < n ? c[3 * i + j] : give[0][0]) + 1 / k_N_m;
        }
    const double det = pal_inverse33(inverse, c);
    /* the leading minors are positive: so is the matrix */
    if (!(det > 0) || !(c[0] > 0) || !(inverse[8] > 0)) return false;
    for (int i = 0, k = 0; i < 3; i++)
        for (int j = i; j < 3; j++) K[k++] = inverse[3 * i + j];
    return isfinite(det);
}

double pal_grasp_compliance_along(const pal_grasp_compliance *w, double k_N_m, double k_guess_N_m,
                                  const double direction[3])
{
    double give_m_N = 0;
    if (w->n_known < 3) return k_guess_N_m;
    for (int c = 0; c < 3; c++)
        give_m_N += direction[c] * pal_dot3(w->column_m_N[c], direction) / pal_dot3(direction, direction);
    return k_N_m / (1 + k_N_m * fmax(0, give_m_N));
}

size_t pal_haptic_stiffness_scratch(const pal_body *body)
{
    return 10 * sizeof(double) * (size_t)body->n_node + 3 * sizeof(double) * PAL_CONTACT_IMPLICIT_MAX + 1024;
}
