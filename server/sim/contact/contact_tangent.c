/* Ties between tools and tissue: rows of contact for implicit solvers. */
#include "server/sim/contact/contact_tangent.h"

#include "server/base/vec3.h"

#include <string.h>

/* slots of one body that tools touch at a time, and boundary faces around them */
enum { MOST_FRAME = 1024, MOST_FACE = 8 * MOST_FRAME };

pal_err pal_ties_make(const pal_body *body, int most_row, pal_arena *arena, pal_ties *out)
{
    int n_slot = body->skin ? body->skin->n_frame : body->n_node;
    pal_ties t = {.most_row = most_row, .most_part = most_row * PAL_TOUCH_BEARERS};
    t.most_frame = n_slot < MOST_FRAME ? n_slot : MOST_FRAME;
    t.most_face = body->skin ? body->skin->fan_start[n_slot] : 0;
    if (t.most_face > MOST_FACE) t.most_face = MOST_FACE;
    t.start = PAL_NEW(arena, int32_t, most_row + 1);
    t.k_N_m = PAL_NEW(arena, double, most_row);
    t.motion_m = PAL_NEW(arena, double, most_row);
    t.part = PAL_NEW(arena, pal_tie_part, t.most_part);
    t.frame = PAL_NEW(arena, pal_tie_frame, t.most_frame);
    t.face = PAL_NEW(arena, pal_tie_face, t.most_face);
    t.state = PAL_NEW(arena, double, 6 * (size_t)t.most_frame);
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

void pal_ties_begin(pal_ties *ties)
{
    ties->n_row = ties->n_part = ties->n_frame = ties->n_face = ties->n_node = 0;
    ties->start[0] = 0;
    ties->turn++;
}

static void use_node(pal_ties *ties, int node)
{
    if (ties->node_mark[node] == ties->turn) return;
    ties->node_mark[node] = ties->turn;
    ties->node[ties->n_node++] = node;
}

/* spin = part/|N| ([X]x - rise X Z') N' + part/reach X (Z . e') (sim/turn.h; X x X X' and Z . X are 0) */
static void make_turn(pal_ties *ties, pal_touch *touch, const pal_body *body, pal_tie_frame *f)
{
    const pal_skin *skin = body->skin;
    const pal_turn *t = pal_touch_turning(touch, body, f->slot);
    int first = skin->fan_start[f->slot], n = skin->fan_start[f->slot + 1] - first;
    if (!t->turns || ties->n_face + n > ties->most_face) return;
    const double *X = t->X, *Z = t->Z, *o = body->d + 3 * (size_t)f->node;
    double s = t->part * t->per_normal;
    const double cross[9] = {0, -X[2], X[1], X[2], 0, -X[0], -X[1], X[0], 0};
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) f->tilt[3 * r + c] = s * (cross[3 * r + c] - t->rise * X[r] * Z[c]);
    pal_scale3(f->twist, t->part * t->per_reach, X);
    pal_copy3(f->Z, Z);
    f->end = t->end;
    use_node(ties, t->end);
    f->first_face = ties->n_face;
    f->n_face = n;
    for (int i = first; i < first + n; i++) {
        pal_tie_face *face = &ties->face[ties->n_face++];
        face->a = skin->fan[2 * i], face->b = skin->fan[2 * i + 1];
        pal_sub3(face->to_a, body->d + 3 * (size_t)face->a, o);
        pal_sub3(face->to_b, body->d + 3 * (size_t)face->b, o);
        use_node(ties, face->a);
        use_node(ties, face->b);
    }
}

/* index of a slot among those in use; -1: no room */
static int use_slot(pal_ties *ties, pal_touch *touch, const pal_body *body, int slot)
{
    if (ties->local_mark[slot] == ties->turn) return ties->local[slot];
    if (ties->n_frame == ties->most_frame) return -1;
    pal_tie_frame *f = &ties->frame[ties->n_frame];
    *f = (pal_tie_frame){.slot = slot, .node = pal_touch_slot_node(body, slot), .end = -1};
    use_node(ties, f->node);
    if (body->skin) make_turn(ties, touch, body, f);
    ties->local_mark[slot] = ties->turn;
    return ties->local[slot] = ties->n_frame++;
}

/* adds a point's parts to the row that is being made; false: no room */
static bool add_point(pal_ties *ties, pal_touch *touch, const pal_body *body, int point, double weight,
                      const double direction[3], int first)
{
    int32_t slot[PAL_TOUCH_BEARERS];
    double share[PAL_TOUCH_BEARERS], arm[PAL_TOUCH_BEARERS][3];
    int n = pal_touch_bearers(touch, body, point, slot, share, arm);
    for (int k = 0; k < n; k++) {
        int local = use_slot(ties, touch, body, slot[k]), i = first;
        if (local < 0) return false;
        while (i < ties->n_part && ties->part[i].slot != local) i++;
        if (i == ties->most_part) return false;
        pal_tie_part *part = &ties->part[i];
        if (i == ties->n_part) {
            *part = (pal_tie_part){.slot = local};
            ties->n_part++;
        }
        /* direction . (spin x arm) = (arm x direction) . spin */
        double turn[3];
        pal_cross3(turn, arm[k], direction);
        pal_axpy3(part->linear, weight * share[k], direction);
        pal_axpy3(part->angular, weight, turn);
    }
    return true;
}

static int end_row(pal_ties *ties, int first, bool all, double k_N_m)
{
    if (!all) {
        ties->n_part = first;
        return -1;
    }
    ties->k_N_m[ties->n_row] = k_N_m;
    ties->start[ties->n_row + 1] = ties->n_part;
    return ties->n_row++;
}

int pal_ties_add(pal_ties *ties, pal_touch *touch, const pal_body *body, int point, const double direction[3],
                 double k_N_m)
{
    int first = ties->n_part;
    if (ties->n_row == ties->most_row) return -1;
    return end_row(ties, first, add_point(ties, touch, body, point, 1, direction, first), k_N_m);
}

int pal_ties_add_mean(pal_ties *ties, pal_touch *touch, const pal_body *body, const pal_contact *contact,
                      const double *weight, int n, const double direction[3], double k_N_m)
{
    int first = ties->n_part;
    bool all = ties->n_row < ties->most_row;
    for (int i = 0; i < n && all; i++)
        all = add_point(ties, touch, body, contact[i].point, weight[i], direction, first);
    return end_row(ties, first, all, k_N_m);
}

/* velocity and spin of every frame in use when the nodes move with u */
static void to_frames(const pal_ties *ties, const double *u)
{
    for (int i = 0; i < ties->n_frame; i++) {
        const pal_tie_frame *f = &ties->frame[i];
        const double *v = u + 3 * (size_t)f->node;
        double *state = ties->state + 6 * (size_t)i, normal[3] = {0}, va[3], vb[3], e[3];
        pal_copy3(state, v);
        pal_set3(state + 3, 0, 0, 0);
        if (f->end < 0) continue;
        for (int k = f->first_face; k < f->first_face + f->n_face; k++) {
            const pal_tie_face *face = &ties->face[k];
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
static void from_frames(const pal_ties *ties, double *out)
{
    for (int i = 0; i < ties->n_frame; i++) {
        const pal_tie_frame *f = &ties->frame[i];
        const double *state = ties->state + 6 * (size_t)i;
        double own[3], h[3], g[3];
        pal_copy3(own, state);
        if (f->end >= 0) {
            double twist = pal_dot3(f->twist, state + 3);
            pal_axpy3(out + 3 * (size_t)f->end, twist, f->Z);
            pal_axpy3(own, -twist, f->Z);
            pal_tmul33(h, f->tilt, state + 3);
            for (int k = f->first_face; k < f->first_face + f->n_face; k++) {
                const pal_tie_face *face = &ties->face[k];
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

static double row_motion(const pal_ties *ties, int row)
{
    double sum = 0;
    for (int k = ties->start[row]; k < ties->start[row + 1]; k++) {
        const pal_tie_part *part = &ties->part[k];
        const double *state = ties->state + 6 * (size_t)part->slot;
        sum += pal_dot3(part->linear, state) + pal_dot3(part->angular, state + 3);
    }
    return sum;
}

static void row_load(const pal_ties *ties, int row, double force_N)
{
    for (int k = ties->start[row]; k < ties->start[row + 1]; k++) {
        const pal_tie_part *part = &ties->part[k];
        double *state = ties->state + 6 * (size_t)part->slot;
        pal_axpy3(state, force_N, part->linear);
        pal_axpy3(state + 3, force_N, part->angular);
    }
}

static void clear_state(const pal_ties *ties)
{
    memset(ties->state, 0, 6 * sizeof(double) * (size_t)ties->n_frame);
}

void pal_ties_motion(pal_ties *ties, const double *u)
{
    to_frames(ties, u);
    for (int i = 0; i < ties->n_row; i++) ties->motion_m[i] = row_motion(ties, i);
}

void pal_ties_multiply(pal_ties *ties, double s, const double *u, double *out)
{
    if (ties->n_row == 0) return;
    pal_ties_motion(ties, u);
    clear_state(ties);
    for (int i = 0; i < ties->n_row; i++)
        if (ties->k_N_m[i] != 0) row_load(ties, i, s * ties->k_N_m[i] * ties->motion_m[i]);
    from_frames(ties, out);
}

void pal_ties_load(pal_ties *ties, double s, const double *force_N, int first, int n, double *to)
{
    clear_state(ties);
    for (int i = 0; i < n; i++) row_load(ties, first + i, s * force_N[i]);
    from_frames(ties, to);
}

double pal_ties_largest(pal_ties *ties, const double *force_N, int first, int n)
{
    double largest2 = 0;
    for (int i = 0; i < ties->n_node; i++) pal_set3(ties->force + 3 * (size_t)ties->node[i], 0, 0, 0);
    pal_ties_load(ties, 1, force_N, first, n, ties->force);
    for (int i = 0; i < ties->n_node; i++) {
        const double *f = ties->force + 3 * (size_t)ties->node[i];
        largest2 = fmax(largest2, pal_dot3(f, f));
    }
    return sqrt(largest2);
}

/* out_i = p_i / k_i + J_i W sum p_j J_j' */
static bool yield(pal_ties *ties, const pal_body *body, const int32_t *rows, const double *p, int n, double *load,
                  double *move, double *out)
{
    memset(load, 0, 3 * sizeof(double) * (size_t)body->n_node);
    clear_state(ties);
    for (int i = 0; i < n; i++) row_load(ties, rows[i], p[i]);
    from_frames(ties, load);
    if (!body->compliance->solve(body->compliance->self, body, load, move)) return false;
    to_frames(ties, move);
    for (int i = 0; i < n; i++) out[i] = p[i] / ties->k_N_m[rows[i]] + row_motion(ties, rows[i]);
    return true;
}

double pal_ties_stiffness(pal_ties *ties, const pal_body *body, const int32_t *rows, const double *share, int n,
                          int passes, double *answer, pal_arena *scratch)
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
        p[i] = ties->k_N_m[rows[i]] * r[i];
        rz += r[i] * p[i];
    }
    for (int pass = 0; pass < passes && known && rz > 0; pass++) {
        known = yield(ties, body, rows, p, n, load, move, w);
        double pw = 0, next = 0;
        for (int i = 0; i < n && known; i++) pw += p[i] * w[i];
        if (!known || !(pw > 0)) break;
        double alpha = rz / pw;
        stiffness += alpha * rz;
        for (size_t i = 0; i < n3 && answer; i++) answer[i] += alpha * move[i];
        for (int i = 0; i < n; i++) {
            r[i] -= alpha * w[i];
            next += r[i] * r[i] * ties->k_N_m[rows[i]];
        }
        for (int i = 0; i < n; i++) p[i] = ties->k_N_m[rows[i]] * r[i] + next / rz * p[i];
        rz = next;
    }
    pal_arena_return(scratch, used);
    return known && isfinite(stiffness) ? stiffness : 0;
}
