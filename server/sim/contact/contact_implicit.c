/* Contact of one tool with an implicit solver: ties, settled forces, caps, felt stiffness. */
#include "server/sim/contact/contact_implicit.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"

#include <string.h>

pal_err pal_contact_implicit_make(pal_arena *arena, pal_contact_implicit *out)
{
    memset(out, 0, sizeof *out);
    out->force_N = PAL_NEW(arena, double, PAL_CONTACT_IMPLICIT_MAX + 2);
    out->share = PAL_NEW(arena, double, PAL_CONTACT_IMPLICIT_MAX);
    out->active = PAL_NEW(arena, uint8_t, PAL_CONTACT_IMPLICIT_MAX);
    return out->force_N && out->share && out->active ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

void pal_contact_implicit_reset(pal_contact_implicit *press)
{
    *press =
        (pal_contact_implicit){.force_N = press->force_N, .share = press->share, .active = press->active, .across = -1};
}

int pal_contact_implicit_thin(pal_contact *contact, int n)
{
    int count[2] = {0, 0}, m = 0;
    for (int i = 0; i < n; i++) count[contact[i].depth_m > 0]++;
    if (n <= PAL_CONTACT_IMPLICIT_MAX) return n;
    /* those that points have room for three quarters, those that may come to points have the rest */
    int room[2], stride[2], seen[2] = {0, 0};
    room[1] = count[0] < PAL_CONTACT_IMPLICIT_MAX / 4 ? PAL_CONTACT_IMPLICIT_MAX - count[0]
                                                      : 3 * PAL_CONTACT_IMPLICIT_MAX / 4;
    room[0] = PAL_CONTACT_IMPLICIT_MAX - (count[1] < room[1] ? count[1] : room[1]);
    for (int k = 0; k < 2; k++) stride[k] = (count[k] + room[k] - 1) / room[k];
    for (int i = 0; i < n; i++) {
        int k = contact[i].depth_m > 0;
        if (seen[k]++ % stride[k] != 0) continue;
        contact[m] = contact[i];
        contact[m++].k_N_m *= stride[k];
    }
    return m;
}

/* two unit directions across n */
static void basis(const double n[3], double t[2][3])
{
    int least = fabs(n[0]) < fabs(n[1]) ? 0 : 1;
    if (fabs(n[2]) < fabs(n[least])) least = 2;
    double e[3] = {least == 0, least == 1, least == 2};
    pal_cross3(t[0], n, e);
    pal_unit3(t[0], t[0], 0);
    pal_cross3(t[1], n, t[0]);
}

/* the rows of friction: elastic while they stick, a constant force while they slide */
static void add_across(pal_contact_implicit *press, pal_contact_springs *springs, pal_contact_points *points,
                       const pal_body *body, const pal_contact *contact, double friction)
{
    double along[3] = {0}, stiffness = 0, sum = 0, stretch[3];
    int n = press->n_contact;
    for (int i = 0; i < n; i++) {
        pal_axpy3(along, press->force_N[i], contact[i].away);
        stiffness += contact[i].k_N_m;
        sum += press->force_N[i];
    }
    if (!pal_unit3(along, along, 0) || !(sum > 0)) return;
    for (int i = 0; i < n; i++) press->share[i] = press->force_N[i] / sum;
    pal_axpy3(press->slip_m, -pal_dot3(press->slip_m, along), along);
    pal_add3(stretch, press->slip_m, press->tool_move_m);
    pal_axpy3(stretch, -pal_dot3(stretch, along), along);
    double size = pal_norm3(stretch), most = friction * press->normal_N;
    press->slides = press->slides && size > 0;
    basis(along, press->t);
    for (int k = 0; k < 2; k++) {
        int row = pal_contact_springs_add_mean(springs, points, body, contact, press->share, n, press->t[k],
                                               press->slides ? 0 : stiffness);
        if (row < 0) return;
        double part = pal_dot3(stretch, press->t[k]);
        press->force_N[n + k] = press->slides ? most * part / size : stiffness * part;
    }
    press->across = press->first + n;
    press->friction_N_m = stiffness;
}

void pal_contact_implicit_begin(pal_contact_implicit *press, pal_contact_springs *springs, pal_contact_points *points,
                                pal_body *body, const pal_contact *contact, int n, double friction,
                                const double move_m[3])
{
    press->first = springs->n_row;
    press->across = -1;
    press->constant = press->settled = press->staged = false;
    press->round = 0;
    pal_set3(press->total_N, 0, 0, 0);
    press->uncapped_N = 0;
    press->allowed_N = INFINITY;
    press->capped = false;
    pal_copy3(press->slip_m, press->next_slip_m);
    press->slides = press->next_slides;
    pal_copy3(press->tool_move_m, move_m);
    bool touches = false;
    int m = 0;
    while (m < n &&
           pal_contact_springs_add(springs, points, body, contact[m].point, contact[m].away, contact[m].k_N_m) >= 0) {
        press->active[m] = contact[m].depth_m > 0;
        if (!press->active[m]) springs->k_N_m[press->first + m] = 0;
        press->force_N[m] = press->active[m] ? contact[m].k_N_m * contact[m].depth_m : 0;
        touches = touches || press->active[m];
        m++;
    }
    press->n_contact = m;
    if (!touches) {
        pal_set3(press->next_slip_m, 0, 0, 0);
        press->next_slides = false;
        press->normal_N = 0;
    }
    if (m == 0) return;
    if (touches && friction > 0) add_across(press, springs, points, body, contact, friction);
    pal_contact_springs_load(springs, 1, press->force_N, press->first, springs->n_row - press->first, body->load);
}

/* k (d - m) of every contact, whether it acts or not; true: what acts is not what should have, by a noticeable part of
 * the forces, and is what should have now. After CHOOSE_ROUNDS solves only a contact that pulls as a whole is changed:
 * ties that pull are let go and none is taken up, so that there is an end. In the last of several stages a pull may
 * make up for the push of an earlier one, and stays */
static bool choose(pal_contact_implicit *press, pal_contact_springs *springs, pal_body *body,
                   const pal_contact *contact, double *force_N)
{
    int n = press->n_contact;
    double wrong = 0, push = 0, pull = 0, *change = press->share;
    for (int i = 0; i < n; i++) {
        force_N[i] = contact[i].k_N_m * (contact[i].depth_m - springs->motion_m[press->first + i]);
        if (press->active[i] == (force_N[i] > 0))
            push += press->active[i] ? force_N[i] : 0;
        else
            wrong += fabs(force_N[i]);
        if (press->active[i]) pull += fmax(0, -force_N[i]);
    }
    const bool ends = press->round++ >= CHOOSE_ROUNDS;
    if (!(ends ? !press->staged && pull > push : wrong > WRONG_SHARE * push)) return false;
    for (int i = 0; i < n; i++) {
        press->active[i] = force_N[i] > 0 && (!ends || press->active[i]);
        double load = press->active[i] ? contact[i].k_N_m * contact[i].depth_m : 0;
        change[i] = load - press->force_N[i];
        press->force_N[i] = load;
        springs->k_N_m[press->first + i] = press->active[i] ? contact[i].k_N_m : 0;
    }
    pal_contact_springs_load(springs, 1, change, press->first, n, body->load);
    return true;
}

/* the two rows of friction as the solver had them: how far they are stretched now, and their forces */
static double across_now(const pal_contact_implicit *press, const pal_contact_springs *springs, double stretch_m[2],
                         double force_N[2])
{
    for (int k = 0; k < 2; k++) {
        double begin = pal_dot3(press->slip_m, press->t[k]) + pal_dot3(press->tool_move_m, press->t[k]);
        stretch_m[k] = begin - springs->motion_m[press->across + k];
        force_N[k] = press->slides ? press->force_N[press->n_contact + k] : press->friction_N_m * stretch_m[k];
    }
    return hypot(stretch_m[0], stretch_m[1]);
}

/* friction after the solve, for a normal force; true: it slid although it was taken as sticking or the other way round,
 * and its two ties are changed. force_N: as the solver had it */
static bool settle_across(pal_contact_implicit *press, pal_contact_springs *springs, pal_body *body, double normal_N,
                          double friction, double force_N[2])
{
    double stretch[2], change[2], stiffness = press->friction_N_m, along = 0, had = 0;
    double free = friction * normal_N / stiffness, *load = press->force_N + press->n_contact;
    double size = across_now(press, springs, stretch, force_N), within = size > free ? free / size : 1;
    for (int k = 0; k < 2; k++) along += stretch[k] * load[k], had += load[k] * load[k];
    /* while it slides its force drags tissue no farther than a spring stretched to the limit would */
    bool sticks = press->slides && along < (1 - FRICTION_SLACK) * free * sqrt(had);
    bool slips = !press->slides && size > (1 + FRICTION_SLACK) * free;
    pal_set3(press->next_slip_m, 0, 0, 0);
    for (int k = 0; k < 2; k++) pal_axpy3(press->next_slip_m, within * stretch[k], press->t[k]);
    press->next_slides = size > free && !sticks;
    press->normal_N = normal_N;
    if (press->round > CHOOSE_ROUNDS || !(sticks || slips)) return false;
    press->slides = slips;
    for (int k = 0; k < 2; k++) {
        double to = slips ? within * force_N[k] : stiffness * (stretch[k] + springs->motion_m[press->across + k]);
        change[k] = to - load[k];
        load[k] = to;
        springs->k_N_m[press->across + k] = slips ? 0 : stiffness;
    }
    pal_contact_springs_load(springs, 1, change, press->across, 2, body->load);
    return true;
}

/* other constant loads instead of the present ones; the ties give no stiffness any more */
static void hold_constant(pal_contact_implicit *press, pal_contact_springs *springs, pal_body *body,
                          const double *force_N, int n)
{
    pal_contact_springs_load(springs, -1, press->force_N, press->first, n, body->load);
    memcpy(press->force_N, force_N, sizeof(double) * (size_t)n);
    pal_contact_springs_load(springs, 1, press->force_N, press->first, n, body->load);
    for (int i = 0; i < n; i++) springs->k_N_m[press->first + i] = 0;
    press->constant = true;
}

/* the total on the tool, and the force of every contact that pushes: friction is shared out to those by their parts in
 * the normal force */
static void sum_forces(const pal_contact_implicit *press, pal_contact *contact, const double *force_N, double total[3])
{
    double across[3] = {0}, sum = 0;
    int n = press->n_contact;
    for (int i = 0; i < n; i++) sum += fmax(0, force_N[i]);
    if (press->across >= 0)
        for (int k = 0; k < 2; k++) pal_axpy3(across, force_N[n + k], press->t[k]);
    pal_scale3(total, -1, across);
    for (int i = 0; i < n; i++) {
        double push_N = fmax(0, force_N[i]);
        pal_axpy3(total, -force_N[i], contact[i].away);
        pal_scale3(contact[i].force, push_N, contact[i].away);
        if (sum > 0) pal_axpy3(contact[i].force, push_N / sum, across);
    }
}

/* forces as the solver had them; true: ties were chosen anew, the forces are a first guess of what comes next */
static bool find_forces(pal_contact_implicit *press, pal_contact_springs *springs, pal_body *body,
                        const pal_contact *contact, double friction, double *force_N)
{
    double normal[3] = {0};
    int n = press->n_contact;
    bool chosen = choose(press, springs, body, contact, force_N);
    for (int i = 0; i < n; i++) {
        if (!press->active[i]) force_N[i] = 0;
        pal_axpy3(normal, fmax(0, force_N[i]), contact[i].away);
    }
    force_N[n] = force_N[n + 1] = 0;
    if (press->across >= 0 && !chosen)
        chosen = settle_across(press, springs, body, pal_norm3(normal), friction, force_N + n);
    return chosen;
}

/* total and what caps leave of it; true: less than all, so that the forces are held from now on, shortened to the caps
 */
static bool keep_caps(pal_contact_implicit *press, pal_contact_springs *springs, pal_body *body, const pal_tool *tool,
                      pal_contact *contact, double *force_N)
{
    int n_row = press->n_contact + (press->across >= 0 ? 2 : 0);
    press->uncapped_N = pal_norm3(press->total_N);
    double largest = pal_contact_springs_max_force_N(springs, force_N, press->first, n_row),
           room = pal_tool_force_share(tool, press->total_N);
    if (body->load_cap_N > 0 && largest > body->load_cap_N) room = fmin(room, body->load_cap_N / largest);
    press->allowed_N = fmin(room * press->uncapped_N, tool->force_cap_N * tool->ramp);
    if (room >= 1) {
        double node_N = largest > 0 && body->load_cap_N > 0 ? press->uncapped_N * body->load_cap_N / largest : INFINITY;
        press->allowed_N = fmin(tool->force_cap_N * tool->ramp, node_N);
    }
    press->capped = room < 1;
    if (!press->capped) return false;
    for (int i = 0; i < n_row; i++) force_N[i] *= room;
    hold_constant(press, springs, body, force_N, n_row);
    sum_forces(press, contact, force_N, press->total_N);
    return true;
}

/* the press's part of the tool's force, before it is found anew and after */
static void take_back(const pal_contact_implicit *press, pal_tool *tool)
{
    if (press->settled) pal_sub3(tool->force_N, tool->force_N, press->total_N);
}

static void give(pal_contact_implicit *press, pal_tool *tool)
{
    pal_add3(tool->force_N, tool->force_N, press->total_N);
    press->settled = true;
}

bool pal_press_within(pal_contact_implicit *press, pal_contact_springs *springs, pal_body *body, pal_tool *tool,
                      pal_contact *contact)
{
    double force[PAL_CONTACT_IMPLICIT_MAX + 2], stretch[2];
    int n = press->n_contact;
    press->staged = true;
    if (n == 0 || press->constant) return false;
    take_back(press, tool);
    for (int i = 0; i < n; i++) {
        double depth = contact[i].depth_m - springs->motion_m[press->first + i];
        force[i] = press->active[i] ? contact[i].k_N_m * depth : 0;
    }
    if (press->across >= 0) (void)across_now(press, springs, stretch, force + n);
    sum_forces(press, contact, force, press->total_N);
    const bool finite = pal_finite3(press->total_N);
    if (!finite) pal_set3(press->total_N, 0, 0, 0);
    bool fixed = finite && keep_caps(press, springs, body, tool, contact, force);
    give(press, tool);
    return fixed;
}

bool pal_contact_implicit_settle(pal_contact_implicit *press, pal_contact_springs *springs, pal_body *body,
                                 pal_tool *tool, pal_contact *contact, double friction)
{
    double force[PAL_CONTACT_IMPLICIT_MAX + 2];
    bool chosen = false, fixed = false;
    if (press->n_contact == 0) return false;
    take_back(press, tool);
    if (press->constant)
        memcpy(force, press->force_N, sizeof force);
    else
        chosen = find_forces(press, springs, body, contact, friction, force);
    sum_forces(press, contact, force, press->total_N);
    if (!pal_finite3(press->total_N)) {
        pal_set3(press->total_N, 0, 0, 0);
        press->settled = true;
        return false;
    }
    if (chosen) {
        press->uncapped_N = pal_norm3(press->total_N);
        pal_scale3(press->total_N, pal_tool_force_share(tool, press->total_N), press->total_N);
    } else if (!press->constant)
        fixed = keep_caps(press, springs, body, tool, contact, force);
    give(press, tool);
    tool->touching = tool->touching || pal_dot3(press->total_N, press->total_N) > 0;
    return chosen || fixed;
}
