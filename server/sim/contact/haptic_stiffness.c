/* Rendered stiffness from the solver's static compliance (haptic_stiffness.h). */
#include "server/sim/contact/haptic_stiffness.h"

#include "server/base/vec3.h"
#include "server/sim/contact/contact_implicit.h"
#include "server/sim/contact/tuning.h"

#include <math.h>

/* ---- answers that are kept ---- */

static int find_entry(const pal_haptic_stiffness *known, const pal_contact_group *group)
{
    int best = -1;
    double cosine = SAME_COSINE;
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
    group->k_N_m = 0;
    if (i < 0) return true;
    const pal_haptic_stiffness_entry *e = &known->entry[i];
    group->k_N_m = e->k_N_m;
    if (known->step - e->step < STIFFNESS_STEPS) return false;
    return pal_dist3(e->at_m, at_m) > min_m || fabs(group->force_N - e->force_N) > STIFFNESS_FORCE * e->force_N ||
           fabs(group->gap_m - e->gap_m) > min_m || pal_dot3(e->normal, group->normal) < STIFFNESS_COSINE;
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
    if (i < 0) i = known->turn++ % PAL_CONTACT_PATCH_MAX;
    group->k_N_m = k_N_m;
    pal_haptic_stiffness_entry *e = &known->entry[i];
    *e = (pal_haptic_stiffness_entry){.used = true,
                                      .step = known->step,
                                      .contact = group->force_N > 0,
                                      .force_N = group->force_N,
                                      .gap_m = group->gap_m,
                                      .k_N_m = k_N_m};
    pal_copy3(e->normal, group->normal);
    pal_copy3(e->at_m, at_m);
}

/* ---- contact ---- */

/* what the normal force loses for each metre because contacts turn: tissue moves with `answer` for each metre that the
 * tool goes against the normal */
static double turned_N_m(const pal_contact_points *points, const pal_body *body, const pal_contact *contact,
                         double radius_m, const double normal[3], const double *answer)
{
    int32_t slot[PAL_CONTACT_POINT_SLOTS];
    double weight[PAL_CONTACT_POINT_SLOTS], arm[PAL_CONTACT_POINT_SLOTS][3], r[3];
    int n = pal_contact_points_slots(points, body, contact->point, slot, weight, arm);
    pal_copy3(r, normal);
    for (int k = 0; k < n; k++)
        pal_axpy3(r, weight[k], answer + 3 * (size_t)pal_contact_points_slot_node(body, slot[k]));
    pal_axpy3(r, -pal_dot3(r, contact->away), contact->away);
    return pal_norm3(contact->force) * pal_dot3(r, normal) / (radius_m - contact->depth_m);
}

void pal_haptic_stiffness_contact(pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                                  pal_contact_springs *springs, int first, const pal_contact_points *points,
                                  const pal_body *body, const pal_contact *contact, int n, double radius_m,
                                  pal_arena *scratch)
{
    size_t used = pal_arena_used(scratch);
    double *answer = PAL_NEW(scratch, double, 3 * (size_t)body->n_node), lost = 0;
    int32_t row[PAL_CONTACT_IMPLICIT_MAX];
    double share[PAL_CONTACT_IMPLICIT_MAX], inward[3];
    int m = 0;
    pal_scale3(inward, -1, group->normal);
    for (int i = 0; i < n; i++) {
        if (!pal_contact_group_has(inward, contact[i].away)) continue;
        if (pal_dot3(contact[i].force, contact[i].force) == 0 || springs->k_N_m[first + i] <= 0) continue;
        share[m] = pal_dot3(contact[i].away, inward);
        row[m++] = first + i;
    }
    double k = pal_contact_springs_stiffness(springs, body, row, share, m, STIFFNESS_PASSES, answer, scratch);
    for (int i = 0; i < m && answer && k > 0; i++)
        lost += turned_N_m(points, body, &contact[row[i] - first], radius_m, group->normal, answer);
    pal_arena_rewind(scratch, used);
    keep(known, group, at_m, fmax(MIN_TURNED * k, k - lost));
}

/* ---- a weighted mean of nodes ---- */

/* how the mean moves for each newton along `direction` that is shared out by weight; node NULL: all nodes in order */
static bool solve_mean(const pal_body *body, const int32_t *node, const double *weight, int n,
                       const double direction[3], double mean_m_N[3], pal_arena *scratch)
{
    size_t used = pal_arena_used(scratch), n3 = 3 * (size_t)body->n_node;
    double *load = PAL_NEW(scratch, double, n3), *move = PAL_NEW(scratch, double, n3);
    bool known = load && move && body->compliance;
    for (int i = 0; i < n && known; i++) pal_axpy3(load + 3 * (size_t)(node ? node[i] : i), weight[i], direction);
    known = known && body->compliance->solve(body->compliance->self, body, load, move);
    pal_set3(mean_m_N, 0, 0, 0);
    for (int i = 0; i < n && known; i++) pal_axpy3(mean_m_N, weight[i], move + 3 * (size_t)(node ? node[i] : i));
    pal_arena_rewind(scratch, used);
    return known;
}

void pal_haptic_stiffness_near(pal_haptic_stiffness *known, pal_contact_group *group, const double at_m[3],
                               const pal_contact_points *points, const pal_body *body, const int32_t *point,
                               const double *weight, int n, double k_N_m, pal_arena *scratch)
{
    size_t used = pal_arena_used(scratch);
    double *sum = PAL_NEW(scratch, double, body->n_node), inward[3], mean[3], give = 0;
    int32_t slot[PAL_CONTACT_POINT_SLOTS];
    double share[PAL_CONTACT_POINT_SLOTS], arm[PAL_CONTACT_POINT_SLOTS][3];
    for (int i = 0; i < n && sum; i++) {
        int m = pal_contact_points_slots(points, body, point[i], slot, share, arm);
        for (int k = 0; k < m; k++) sum[pal_contact_points_slot_node(body, slot[k])] += weight[i] * share[k];
    }
    /* as contact presses: the solver starts from the answer to a load that is alike */
    pal_scale3(inward, -1, group->normal);
    if (sum && k_N_m > 0 && solve_mean(body, NULL, sum, body->n_node, inward, mean, scratch))
        give = 1 / k_N_m + pal_dot3(mean, inward);
    pal_arena_rewind(scratch, used);
    keep(known, group, at_m, give > 0 && isfinite(give) ? 1 / give : 0);
}

/* ---- grasp ---- */

void pal_grasp_compliance_update(pal_grasp_compliance *w, const pal_body *body, const int32_t *node,
                                 const double *weight, int n, const double at_m[3], pal_arena *scratch)
{
    double unit[3] = {0}, mean[3];
    int axis = w->next;
    if (!body->compliance || (w->n_known == 3 && axis == 0 && pal_dist3(w->at_m, at_m) < MIN_MOVE_M)) return;
    unit[axis] = 1;
    if (!solve_mean(body, node, weight, n, unit, mean, scratch)) return;
    pal_copy3(w->column_m_N[axis], mean);
    if (axis == 0) pal_copy3(w->at_m, at_m);
    if (w->n_known == axis) w->n_known++;
    w->next = (axis + 1) % 3;
}

bool pal_grasp_compliance_series(const pal_grasp_compliance *w, double k_N_m, double K[6])
{
    const double(*give)[3] = w->column_m_N;
    const int n = w->n_known;
    double c[3][3], minor[3][3];
    if (n == 0 || !(k_N_m > 0)) return false;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            c[i][j] = i < n && j < n ? 0.5 * (give[i][j] + give[j][i]) : 0;
            if (i == j) c[i][j] = (i < n ? c[i][i] : give[0][0]) + 1 / k_N_m;
        }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int a = (i + 1) % 3, b = (i + 2) % 3, p = (j + 1) % 3, q = (j + 2) % 3;
            minor[i][j] = c[a][p] * c[b][q] - c[a][q] * c[b][p];
        }
    double det = pal_dot3(c[0], minor[0]);
    if (!(det > 0) || !(c[0][0] > 0) || !(minor[2][2] > 0)) return false;
    const int place[6][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}};
    for (int i = 0; i < 6; i++) K[i] = minor[place[i][0]][place[i][1]] / det;
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
    return 9 * sizeof(double) * (size_t)body->n_node + 3 * sizeof(double) * PAL_CONTACT_IMPLICIT_MAX + 1024;
}
