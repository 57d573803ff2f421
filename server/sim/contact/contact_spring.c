/* Springs between tools and tissue (contact_spring.h). */
#include "server/sim/contact/contact_spring.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"

#include <string.h>

pal_err pal_contact_springs_make(const pal_body *body, int max_row, pal_arena *arena, pal_contact_springs *out)
{
    int n_slot = body->skin ? body->skin->n_frame : body->n_node;
    pal_contact_springs t = {.max_row = max_row, .max_part = max_row * PAL_CONTACT_POINT_SLOTS};
    t.max_frame = n_slot < SPRING_FRAMES ? n_slot : SPRING_FRAMES;
    t.max_face = body->skin ? body->skin->fan_start[n_slot] : 0;
    if (t.max_face > SPRING_FACES) t.max_face = SPRING_FACES;
    t.start = PAL_NEW(arena, int32_t, max_row + 1);
    t.k_N_m = PAL_NEW(arena, double, max_row);
    t.motion_m = PAL_NEW(arena, double, max_row);
    t.part = PAL_NEW(arena, pal_contact_spring_part, t.max_part);
    t.frame = PAL_NEW(arena, pal_contact_spring_frame, t.max_frame);
    t.face = PAL_NEW(arena, pal_contact_spring_face, t.max_face);
    t.state = PAL_NEW(arena, double, 6 * (size_t)t.max_frame);
    t.local = PAL_NEW(arena, int32_t, n_slot);
    t.local_mark = PAL_NEW(arena, uint32_t, n_slot);
    t.node_mark = PAL_NEW(arena, uint32_t, body->n_node);
    t.node = PAL_NEW(arena, int32_t, body->n_node);
    t.force = PAL_NEW(arena, double, 3 * (size_t)body->n_node);
    if (!t.start || !t.k_N_m || !t.motion_m || !t.part || !t.frame || !t.face || !t.state || !t.local ||
        !t.local_mark || !t.node_mark || !t.node || !t.force)
        return PAL_ERR_MEMORY;
    *out = t;
    return PAL_ERR_OK;
}

void pal_contact_springs_begin(pal_contact_springs *springs)
{
    springs->n_row = springs->n_part = springs->n_frame = springs->n_face = springs->n_node = 0;
    springs->start[0] = 0;
    springs->turn++;
}

static void use_node(pal_contact_springs *springs, int node)
{
    if (springs->node_mark[node] == springs->turn) return;
    springs->node_mark[node] = springs->turn;
    springs->node[springs->n_node++] = node;
}

/* spin = part/|N| ([X]x - rise X Z') N' + part/reach X (Z . e') (frame_spin.h; X x X X' and Z . X are 0) */
static void make_turn(pal_contact_springs *springs, pal_contact_points *points, const pal_body *body,
                      pal_contact_spring_frame *f)
{
    const pal_skin *skin = body->skin;
    const pal_frame_spin *t = pal_contact_points_frame_spin(points, body, f->slot);
    int first = skin->fan_start[f->slot], n = skin->fan_start[f->slot + 1] - first;
    if (!t->turns || springs->n_face + n > springs->max_face) return;
    const double *X = t->X, *Z = t->Z, *o = body->d + 3 * (size_t)f->node;
    double s = t->part * t->per_normal;
    const double cross[9] = {0, -X[2], X[1], X[2], 0, -X[0], -X[1], X[0], 0};
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) f->tilt[3 * r + c] = s * (cross[3 * r + c] - t->rise * X[r] * Z[c]);
    pal_scale3(f->twist, t->part * t->per_reach, X);
    pal_copy3(f->Z, Z);
    f->end = t->end;
    use_node(springs, t->end);
    f->first_face = springs->n_face;
    f->n_face = n;
    for (int i = first; i < first + n; i++) {
        pal_contact_spring_face *face = &springs->face[springs->n_face++];
        face->a = skin->fan[2 * i], face->b = skin->fan[2 * i + 1];
        pal_sub3(face->to_a, body->d + 3 * (size_t)face->a, o);
        pal_sub3(face->to_b, body->d + 3 * (size_t)face->b, o);
        use_node(springs, face->a);
        use_node(springs, face->b);
    }
}

/* index of a slot among those in use; -1: no room */
static int use_slot(pal_contact_springs *springs, pal_contact_points *points, const pal_body *body, int slot)
{
    if (springs->local_mark[slot] == springs->turn) return springs->local[slot];
    if (springs->n_frame == springs->max_frame) return -1;
    pal_contact_spring_frame *f = &springs->frame[springs->n_frame];
    *f = (pal_contact_spring_frame){.slot = slot, .node = pal_contact_points_slot_node(body, slot), .end = -1};
    use_node(springs, f->node);
    if (body->skin) make_turn(springs, points, body, f);
    springs->local_mark[slot] = springs->turn;
    return springs->local[slot] = springs->n_frame++;
}

/* adds a point's parts to the row that is being made; false: no room */
static bool add_point(pal_contact_springs *springs, pal_contact_points *points, const pal_body *body, int point,
                      double weight, const double direction[3], int first)
{
    int32_t slot[PAL_CONTACT_POINT_SLOTS];
    double share[PAL_CONTACT_POINT_SLOTS], arm[PAL_CONTACT_POINT_SLOTS][3];
    int n = pal_contact_points_slots(points, body, point, slot, share, arm);
    for (int k = 0; k < n; k++) {
        int local = use_slot(springs, points, body, slot[k]), i = first;
        if (local < 0) return false;
        while (i < springs->n_part && springs->part[i].slot != local) i++;
        if (i == springs->max_part) return false;
        pal_contact_spring_part *part = &springs->part[i];
        if (i == springs->n_part) {
            *part = (pal_contact_spring_part){.slot = local};
            springs->n_part++;
        }
        /* direction . (spin x arm) = (arm x direction) . spin */
        double turn[3];
        pal_cross3(turn, arm[k], direction);
        pal_axpy3(part->linear, weight * share[k], direction);
        pal_axpy3(part->angular, weight, turn);
    }
    return true;
}

static int end_row(pal_contact_springs *springs, int first, bool all, double k_N_m)
{
    if (!all) {
        springs->n_part = first;
        return -1;
    }
    springs->k_N_m[springs->n_row] = k_N_m;
    springs->start[springs->n_row + 1] = springs->n_part;
    return springs->n_row++;
}

int pal_contact_springs_add(pal_contact_springs *springs, pal_contact_points *points, const pal_body *body, int point,
                            const double direction[3], double k_N_m)
{
    int first = springs->n_part;
    if (springs->n_row == springs->max_row) return -1;
    return end_row(springs, first, add_point(springs, points, body, point, 1, direction, first), k_N_m);
}

int pal_contact_springs_add_mean(pal_contact_springs *springs, pal_contact_points *points, const pal_body *body,
                                 const pal_contact *contact, const double *weight, int n, const double direction[3],
                                 double k_N_m)
{
    int first = springs->n_part;
    bool all = springs->n_row < springs->max_row;
    for (int i = 0; i < n && all; i++)
        all = add_point(springs, points, body, contact[i].point, weight[i], direction, first);
    return end_row(springs, first, all, k_N_m);
}

/* velocity and spin of every frame in use when the nodes move with u */
static void to_frames(const pal_contact_springs *springs, const double *u)
{
    for (int i = 0; i < springs->n_frame; i++) {
        const pal_contact_spring_frame *f = &springs->frame[i];
        const double *v = u + 3 * (size_t)f->node;
        double *state = springs->state + 6 * (size_t)i, normal[3] = {0}, va[3], vb[3], e[3];
        pal_copy3(state, v);
        pal_set3(state + 3, 0, 0, 0);
        if (f->end < 0) continue;
        for (int k = f->first_face; k < f->first_face + f->n_face; k++) {
            const pal_contact_spring_face *face = &springs->face[k];
            pal_sub3(va, u + 3 * (size_t)face->a, v);
            pal_sub3(vb, u + 3 * (size_t)face->b, v);
            pal_cross3(va, va, face->to_b);
            pal_cross3(vb, face->to_a, vb);
            pal_add3(normal, normal, va);
            pal_add3(normal, normal, vb);
        }
        pal_mul33(state + 3, f->tilt, normal);
        pal_sub3(e, u + 3 * (size_t)f->end, v);
        pal_axpy3(state + 3, pal_dot3(f->Z, e), f->twist);
    }
}

/* the transpose: forces and torques in state to nodes */
static void from_frames(const pal_contact_springs *springs, double *out)
{
    for (int i = 0; i < springs->n_frame; i++) {
        const pal_contact_spring_frame *f = &springs->frame[i];
        const double *state = springs->state + 6 * (size_t)i;
        double own[3], h[3], g[3];
        pal_copy3(own, state);
        if (f->end >= 0) {
            double twist = pal_dot3(f->twist, state + 3);
            pal_axpy3(out + 3 * (size_t)f->end, twist, f->Z);
            pal_axpy3(own, -twist, f->Z);
            pal_tmul33(h, f->tilt, state + 3);
            for (int k = f->first_face; k < f->first_face + f->n_face; k++) {
                const pal_contact_spring_face *face = &springs->face[k];
                pal_cross3(g, face->to_b, h);
                pal_add3(out + 3 * (size_t)face->a, out + 3 * (size_t)face->a, g);
                pal_sub3(own, own, g);
                pal_cross3(g, h, face->to_a);
                pal_add3(out + 3 * (size_t)face->b, out + 3 * (size_t)face->b, g);
                pal_sub3(own, own, g);
            }
        }
        pal_add3(out + 3 * (size_t)f->node, out + 3 * (size_t)f->node, own);
    }
}

static double row_motion(const pal_contact_springs *springs, int row)
{
    double sum = 0;
    for (int k = springs->start[row]; k < springs->start[row + 1]; k++) {
        const pal_contact_spring_part *part = &springs->part[k];
        const double *state = springs->state + 6 * (size_t)part->slot;
        sum += pal_dot3(part->linear, state) + pal_dot3(part->angular, state + 3);
    }
    return sum;
}

static void row_load(const pal_contact_springs *springs, int row, double force_N)
{
    for (int k = springs->start[row]; k < springs->start[row + 1]; k++) {
        const pal_contact_spring_part *part = &springs->part[k];
        double *state = springs->state + 6 * (size_t)part->slot;
        pal_axpy3(state, force_N, part->linear);
        pal_axpy3(state + 3, force_N, part->angular);
    }
}

static void clear_state(const pal_contact_springs *springs)
{
    memset(springs->state, 0, 6 * sizeof(double) * (size_t)springs->n_frame);
}

void pal_contact_springs_motion(pal_contact_springs *springs, const double *u)
{
    to_frames(springs, u);
    for (int i = 0; i < springs->n_row; i++) springs->motion_m[i] = row_motion(springs, i);
}

void pal_contact_springs_multiply(pal_contact_springs *springs, double s, const double *u, double *out)
{
    if (springs->n_row == 0) return;
    pal_contact_springs_motion(springs, u);
    clear_state(springs);
    for (int i = 0; i < springs->n_row; i++)
        if (springs->k_N_m[i] != 0) row_load(springs, i, s * springs->k_N_m[i] * springs->motion_m[i]);
    from_frames(springs, out);
}

void pal_contact_springs_load(pal_contact_springs *springs, double s, const double *force_N, int first, int n,
                              double *to)
{
    clear_state(springs);
    for (int i = 0; i < n; i++) row_load(springs, first + i, s * force_N[i]);
    from_frames(springs, to);
}

double pal_contact_springs_max_force_N(pal_contact_springs *springs, const double *force_N, int first, int n)
{
    double max2 = 0;
    for (int i = 0; i < springs->n_node; i++) pal_set3(springs->force + 3 * (size_t)springs->node[i], 0, 0, 0);
    pal_contact_springs_load(springs, 1, force_N, first, n, springs->force);
    for (int i = 0; i < springs->n_node; i++) {
        const double *f = springs->force + 3 * (size_t)springs->node[i];
        max2 = fmax(max2, pal_dot3(f, f));
    }
    return sqrt(max2);
}

/* out_i = p_i / k_i + J_i W sum p_j J_j' */
static bool apply_compliance(pal_contact_springs *springs, const pal_body *body, const int32_t *rows, const double *p,
                             int n, double *load, double *move, double *out)
{
    memset(load, 0, 3 * sizeof(double) * (size_t)body->n_node);
    clear_state(springs);
    for (int i = 0; i < n; i++) row_load(springs, rows[i], p[i]);
    from_frames(springs, load);
    if (!body->compliance->solve(body->compliance->self, body, load, move)) return false;
    to_frames(springs, move);
    for (int i = 0; i < n; i++) out[i] = p[i] / springs->k_N_m[rows[i]] + row_motion(springs, rows[i]);
    return true;
}

double pal_contact_springs_stiffness(pal_contact_springs *springs, const pal_body *body, const int32_t *rows,
                                     const double *share, int n, int passes, double *answer, pal_arena *scratch)
{
    if (!body->compliance || n <= 0) return 0;
    size_t used = pal_arena_used(scratch), n3 = 3 * (size_t)body->n_node;
    double *load = PAL_NEW(scratch, double, n3), *move = PAL_NEW(scratch, double, n3);
    double *r = PAL_NEW(scratch, double, n), *p = PAL_NEW(scratch, double, n), *w = PAL_NEW(scratch, double, n);
    double stiffness = 0, rz = 0;
    bool known = load && move && r && p && w;
    if (answer) memset(answer, 0, n3 * sizeof *answer);
    for (int i = 0; i < n && known; i++) {
        r[i] = share[i];
        p[i] = springs->k_N_m[rows[i]] * r[i];
        rz += r[i] * p[i];
    }
    for (int pass = 0; pass < passes && known && rz > 0; pass++) {
        known = apply_compliance(springs, body, rows, p, n, load, move, w);
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
