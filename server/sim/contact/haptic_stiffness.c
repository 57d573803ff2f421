/* Haptic stiffness from the compliance of the body. */
#include "server/sim/contact/haptic_stiffness.h"

#include "server/base/vec3.h"

/* passes of conjugate gradients for the stiffness of a contact, and steps from one answer to the next */
enum { PASSES = 2, EVERY = 3 };
/* share by which the force changes until the answer is found again */
#define FORCE_CHANGE 0.02

static int find_entry(const pal_haptic_stiffness *haptic_stiffness, const pal_contact_group *contact_group)
{
    int best = -1;
    double cosine = 0.70710678118654752;
    for (int i = 0; i < PAL_CONTACT_PATCH_MAX; i++) {
        const pal_haptic_stiffness_entry *e = &haptic_stiffness->entry[i];
        if (!e->used || e->contact != (contact_group->force_N > 0)) continue;
        double c = pal_dot3(e->normal, contact_group->normal);
        if (c > cosine) cosine = c, best = i;
    }
    return best;
}

bool pal_haptic_stiffness_find(const pal_haptic_stiffness *haptic_stiffness, pal_contact_group *contact_group,
                               const double at_m[3], double min_m)
{
    int i = find_entry(haptic_stiffness, contact_group);
    contact_group->k_N_m = 0;
    if (i < 0) return true;
    const pal_haptic_stiffness_entry *e = &haptic_stiffness->entry[i];
    contact_group->k_N_m = e->k_N_m;
    if (haptic_stiffness->step - e->step < EVERY) return false;
    return pal_dist3(e->at_m, at_m) > min_m || fabs(contact_group->force_N - e->force_N) > FORCE_CHANGE * e->force_N ||
           fabs(contact_group->gap_m - e->gap_m) > min_m || pal_dot3(e->normal, contact_group->normal) < 0.995;
}

static void keep(pal_haptic_stiffness *haptic_stiffness, pal_contact_group *contact_group, const double at_m[3],
                 double k_N_m)
{
    int i = find_entry(haptic_stiffness, contact_group);
    for (int j = 0; j < PAL_CONTACT_PATCH_MAX && i < 0; j++)
        if (!haptic_stiffness->entry[j].used) i = j;
    if (i < 0) i = haptic_stiffness->turn++ % PAL_CONTACT_PATCH_MAX;
    contact_group->k_N_m = k_N_m;
    pal_haptic_stiffness_entry *e = &haptic_stiffness->entry[i];
    *e = (pal_haptic_stiffness_entry){.used = true,
                                      .step = haptic_stiffness->step,
                                      .contact = contact_group->force_N > 0,
                                      .force_N = contact_group->force_N,
                                      .gap_m = contact_group->gap_m,
                                      .k_N_m = k_N_m};
    pal_copy3(e->normal, contact_group->normal);
    pal_copy3(e->at_m, at_m);
}

/* what the normal force loses for each metre because contacts turn: tissue moves with `answer` for each metre that the
 * tool goes against the normal */
static double turned_N_m(const pal_contact_points *touch, const pal_body *body, const pal_contact *contact,
                         double radius_m, const double normal[3], const double *answer)
{
    int32_t slot[PAL_CONTACT_POINT_SLOTS];
    double weight[PAL_CONTACT_POINT_SLOTS], arm[PAL_CONTACT_POINT_SLOTS][3], r[3];
    int n = pal_contact_points_slots(touch, body, contact->point, slot, weight, arm);
    pal_copy3(r, normal);
    for (int k = 0; k < n; k++)
        pal_axpy3(r, weight[k], answer + 3 * (size_t)pal_contact_points_slot_node(body, slot[k]));
    pal_axpy3(r, -pal_dot3(r, contact->away), contact->away);
    return pal_norm3(contact->force) * pal_dot3(r, normal) / (radius_m - contact->depth_m);
}

void pal_haptic_stiffness_contact(pal_haptic_stiffness *haptic_stiffness, pal_contact_group *contact_group,
                                  const double at_m[3], pal_contact_implicit *press,
                                  pal_contact_springs *contact_springs, const pal_contact_points *touch,
                                  const pal_body *body, const pal_contact *contact, double radius_m, pal_arena *scratch)
{
    size_t used = pal_arena_used(scratch);
    double *answer = PAL_NEW(scratch, double, 3 * (size_t)body->n_node), lost = 0;
    int32_t row[PAL_CONTACT_IMPLICIT_MAX];
    int n = 0;
    for (int i = 0; i < press->n_contact; i++) {
        double into = -pal_dot3(contact[i].away, contact_group->normal);
        if (into < PAL_CONTACT_GROUP_COSINE || pal_dot3(contact[i].force, contact[i].force) == 0) continue;
        if (contact_springs->k_N_m[press->first + i] <= 0) continue;
        press->share[n] = into;
        row[n++] = press->first + i;
    }
    double k = pal_contact_springs_stiffness(contact_springs, body, row, press->share, n, PASSES, answer, scratch);
    for (int i = 0; i < n && answer && k > 0; i++)
        lost += turned_N_m(touch, body, &contact[row[i] - press->first], radius_m, contact_group->normal, answer);
    pal_arena_rewind(scratch, used);
    keep(haptic_stiffness, contact_group, at_m, fmax(0.25 * k, k - lost));
}

void pal_haptic_stiffness_near(pal_haptic_stiffness *haptic_stiffness, pal_contact_group *contact_group,
                               const double at_m[3], const pal_contact_points *touch, const pal_body *body,
                               const int32_t *point, const double *weight, int n, double k_N_m, pal_arena *scratch)
{
    size_t used = pal_arena_used(scratch), n3 = 3 * (size_t)body->n_node;
    double *load = PAL_NEW(scratch, double, n3), *move = PAL_NEW(scratch, double, n3), give = 1 / k_N_m;
    int32_t slot[PAL_CONTACT_POINT_SLOTS];
    double share[PAL_CONTACT_POINT_SLOTS], arm[PAL_CONTACT_POINT_SLOTS][3];
    bool known = load && move && body->compliance && k_N_m > 0;
    for (int i = 0; i < n && known; i++) {
        int m = pal_contact_points_slots(touch, body, point[i], slot, share, arm);
        for (int k = 0; k < m; k++)
            pal_axpy3(load + 3 * (size_t)pal_contact_points_slot_node(body, slot[k]), -weight[i] * share[k],
                      contact_group->normal);
    }
    known = known && body->compliance->solve(body->compliance->self, body, load, move);
    for (size_t i = 0; i < n3 && known; i++) give += load[i] * move[i];
    pal_arena_rewind(scratch, used);
    keep(haptic_stiffness, contact_group, at_m, known && give > 0 && isfinite(give) ? 1 / give : 0);
}

size_t pal_haptic_stiffness_scratch(const pal_body *body)
{
    return 9 * sizeof(double) * (size_t)body->n_node + 3 * sizeof(double) * PAL_CONTACT_IMPLICIT_MAX + 1024;
}

/* ---- grasps ---- */

void pal_grasp_compliance_find(pal_grasp_compliance *compliance, const pal_body *body, const int32_t *node,
                               const double *weight, int n, const double at_m[3], pal_arena *scratch)
{
    pal_grasp_compliance *to = compliance;
    if (!body->compliance || (to->n == 3 && to->next == 0 && pal_dist3(to->at_m, at_m) < PAL_FIT_MOVE_M)) return;
    size_t used = pal_arena_used(scratch), n3 = 3 * (size_t)body->n_node;
    double *load = PAL_NEW(scratch, double, n3), *move = PAL_NEW(scratch, double, n3);
    int axis = to->next;
    bool known = load && move;
    for (int i = 0; i < n && known; i++) load[3 * (size_t)node[i] + (size_t)axis] += weight[i];
    known = known && body->compliance->solve(body->compliance->self, body, load, move);
    if (known) {
        pal_set3(to->column[axis], 0, 0, 0);
        for (int i = 0; i < n; i++) pal_axpy3(to->column[axis], weight[i], move + 3 * (size_t)node[i]);
        if (axis == 0) pal_copy3(to->at_m, at_m);
        if (to->n == axis) to->n++;
        to->next = (axis + 1) % 3;
    }
    pal_arena_rewind(scratch, used);
}

bool pal_grasp_compliance_series(const pal_grasp_compliance *compliance, double k_N_m, double K[6])
{
    double c[3][3], minor[3][3];
    if (compliance->n == 0 || !(k_N_m > 0)) return false;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            c[i][j] = i < compliance->n && j < compliance->n
                          ? 0.5 * (compliance->column[i][j] + compliance->column[j][i])
                          : 0;
            if (i == j) c[i][j] = (i < compliance->n ? c[i][i] : compliance->column[0][0]) + 1 / k_N_m;
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

double pal_grasp_compliance_along(const pal_grasp_compliance *compliance, double k_N_m, double k_guess_N_m,
                                  const double direction[3])
{
    double give_m_N = 0;
    if (compliance->n < 3) return k_guess_N_m;
    for (int c = 0; c < 3; c++)
        give_m_N += direction[c] * pal_dot3(compliance->column[c], direction) / pal_dot3(direction, direction);
    return k_N_m / (1 + k_N_m * fmax(0, give_m_N));
}
