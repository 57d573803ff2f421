/* Springs between tools and tissue (contact_spring.h). */
#include "server/sim/contact/contact_spring.h"

#include "server/base/vec3.h"

#include <string.h>

pal_err pal_contact_springs_make(pal_contact_points *points, const pal_body *body, int max_row, pal_arena *arena,
                                 pal_contact_springs *out)
{
    pal_contact_springs t = {.points = points, .body = body, .max_row = max_row};
    t.start = PAL_NEW(arena, int32_t, max_row + 1);
    const bool numbers = PAL_NEW_DOUBLES(arena, max_row, &t.k_N_m, &t.motion_m);
    t.part = PAL_NEW(arena, pal_contact_spring_part, max_row * PAL_CONTACT_POINT_SLOTS);
    *out = t;
    return t.start && numbers && t.part ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

void pal_contact_springs_begin(pal_contact_springs *springs)
{
    springs->n_row = springs->n_part = 0;
    springs->start[0] = 0;
    pal_contact_points_begin_slots(springs->points);
}

/* adds a point's parts to the row that is being made; false: no room */
static bool add_point(pal_contact_springs *springs, int point, double weight, const double direction[3], int first)
{
    pal_contact_slot of[PAL_CONTACT_POINT_SLOTS];
    int n = pal_contact_points_slots(springs->points, springs->body, point, of);
    for (int k = 0; k < n; k++) {
        int i = first;
        while (i < springs->n_part && springs->part[i].slot != of[k].slot) i++;
        if (i == springs->max_row * PAL_CONTACT_POINT_SLOTS) return false;
        pal_contact_spring_part *part = &springs->part[i];
        if (i == springs->n_part) springs->part[springs->n_part++] = (pal_contact_spring_part){.slot = of[k].slot};
        /* direction . (spin x arm) = (arm x direction) . spin */
        double moment[3];
        pal_contact_points_use_slot(springs->points, springs->body, of[k].slot);
        pal_cross3(moment, of[k].arm, direction);
        pal_axpy3(part->linear, weight * of[k].weight, direction);
        pal_axpy3(part->angular, weight, moment);
    }
    return true;
}

int pal_contact_springs_add(pal_contact_springs *springs, int point, const double direction[3], double k_N_m)
{
    return pal_contact_springs_add_mean(springs, &(pal_contact){.point = point}, &(double){1}, 1, direction, k_N_m);
}

int pal_contact_springs_add_mean(pal_contact_springs *springs, const pal_contact *contact, const double *weight, int n,
                                 const double direction[3], double k_N_m)
{
    int first = springs->n_part;
    bool all = springs->n_row < springs->max_row;
    for (int i = 0; i < n && all; i++) all = add_point(springs, contact[i].point, weight[i], direction, first);
    if (!all) springs->n_part = first;
    if (!all) return -1;
    springs->k_N_m[springs->n_row] = k_N_m;
    springs->start[springs->n_row + 1] = springs->n_part;
    return springs->n_row++;
}

static double row_motion(const pal_contact_springs *springs, int row)
{
    double sum = 0;
    for (int k = springs->start[row]; k < springs->start[row + 1]; k++) {
        const pal_contact_spring_part *part = &springs->part[k];
        const double *state = springs->points->state + 6 * (size_t)part->slot;
        sum += pal_dot3(part->linear, state) + pal_dot3(part->angular, state + 3);
    }
    return sum;
}

static void row_load(const pal_contact_springs *springs, int row, double force_N)
{
    for (int k = springs->start[row]; k < springs->start[row + 1]; k++) {
        const pal_contact_spring_part *part = &springs->part[k];
        double *state = springs->points->state + 6 * (size_t)part->slot;
        pal_axpy3(state, force_N, part->linear);
        pal_axpy3(state + 3, force_N, part->angular);
    }
}

static void clear_state(const pal_contact_springs *springs)
{
    for (int i = 0; i < springs->points->n_slot; i++)
        memset(springs->points->state + 6 * (size_t)springs->points->slot[i], 0, 6 * sizeof(double));
}

void pal_contact_springs_motion(pal_contact_springs *springs, const double *u)
{
    pal_contact_points_to_slots(springs->points, springs->body, u);
    for (int i = 0; i < springs->n_row; i++) springs->motion_m[i] = row_motion(springs, i);
}

void pal_contact_springs_multiply(pal_contact_springs *springs, double s, const double *u, double *out)
{
    if (springs->n_row == 0) return;
    pal_contact_springs_motion(springs, u);
    clear_state(springs);
    for (int i = 0; i < springs->n_row; i++)
        if (springs->k_N_m[i] != 0) row_load(springs, i, s * springs->k_N_m[i] * springs->motion_m[i]);
    pal_contact_points_from_slots(springs->points, springs->body, out);
}

void pal_contact_springs_load(pal_contact_springs *springs, double s, const double *force_N, int first, int n,
                              double *to)
{
    clear_state(springs);
    for (int i = 0; i < n; i++) row_load(springs, first + i, s * force_N[i]);
    pal_contact_points_from_slots(springs->points, springs->body, to);
}

double pal_contact_springs_max_force_N(pal_contact_springs *springs, const double *force_N, int first, int n)
{
    pal_contact_points *points = springs->points;
    for (int i = 0; i < points->n_node; i++) pal_set3(points->force + 3 * (size_t)points->node[i], 0, 0, 0);
    pal_contact_springs_load(springs, 1, force_N, first, n, points->force);
    return pal_contact_points_max_force_N(points);
}

/* out_i = p_i / k_i + J_i W sum p_j J_j' */
static bool apply_compliance(pal_contact_springs *springs, const pal_compliance *compliance, const int32_t *rows,
                             const double *p, int n, double *load, double *move, double *out)
{
    const pal_body *body = springs->body;
    memset(load, 0, 3 * sizeof(double) * (size_t)body->n_node);
    clear_state(springs);
    for (int i = 0; i < n; i++) row_load(springs, rows[i], p[i]);
    pal_contact_points_from_slots(springs->points, body, load);
    if (!compliance->solve(compliance->self, body, load, move)) return false;
    pal_contact_points_to_slots(springs->points, body, move);
    for (int i = 0; i < n; i++) out[i] = p[i] / springs->k_N_m[rows[i]] + row_motion(springs, rows[i]);
    return true;
}

double pal_contact_springs_stiffness(pal_contact_springs *springs, const pal_compliance *compliance,
                                     const int32_t *rows, const double *share, int n, int passes, double *answer,
                                     pal_arena *scratch)
{
    const pal_body *body = springs->body;
    if (!compliance || n <= 0) return 0;
    size_t used = pal_arena_used(scratch), n3 = 3 * (size_t)body->n_node;
    double *load, *move, *r, *p, *w, stiffness = 0, rz = 0;
    bool known = PAL_NEW_DOUBLES(scratch, n3, &load, &move) && PAL_NEW_DOUBLES(scratch, n, &r, &p, &w);
    if (answer) memset(answer, 0, n3 * sizeof *answer);
    for (int i = 0; i < n && known; i++) {
        r[i] = share[i];
        p[i] = springs->k_N_m[rows[i]] * r[i];
        rz += r[i] * p[i];
    }
    for (int pass = 0; pass < passes && known && rz > 0; pass++) {
        known = apply_compliance(springs, compliance, rows, p, n, load, move, w);
        double pw = 0, next = 0;
        for (int i = 0; i < n && known; i++) pw += p[i] * w[i];
        if (!known || !(pw > 0)) break;
        double alpha = rz / pw;
        stiffness += alpha * rz;
        for (size_t i = 0; i < n3 && answer; i++) answer[i] += alpha * move[i];
        for (int i = 0; i < n; i++) {
            r[i] -= alpha * w[i];
            next += r[i] * r[i] * springs->k_N_m[rows[i]];
        }
        for (int i = 0; i < n; i++) p[i] = springs->k_N_m[rows[i]] * r[i] + next / rz * p[i];
        rz = next;
    }
    pal_arena_rewind(scratch, used);
    return known && isfinite(stiffness) ? stiffness : 0;
}
