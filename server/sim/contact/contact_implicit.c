/* Contact of one tool with an implicit solver (contact_implicit.h). */
#include "server/sim/contact/contact_implicit.h"

#include "server/base/vec3.h"
#include "server/sim/contact/contact_group.h"
#include "server/sim/contact/tuning.h"

#include <string.h>

int pal_contact_implicit_thin(pal_contact *contact, int n)
{
    enum { MAX = PAL_CONTACT_IMPLICIT_MAX };
    if (n <= MAX) return n;
    /* of those near and those in contact: the latter have three quarters of the room, or what the former leave */
    int count[2] = {0, 0}, room[2], stride[2], seen[2] = {0, 0}, m = 0;
    for (int i = 0; i < n; i++) count[contact[i].depth_m > 0]++;
    room[1] = count[0] < MAX / 4 ? MAX - count[0] : 3 * MAX / 4;
    room[0] = MAX - (count[1] < room[1] ? count[1] : room[1]);
    for (int k = 0; k < 2; k++) stride[k] = (count[k] + room[k] - 1) / room[k];
    for (int i = 0; i < n; i++) {
        int k = contact[i].depth_m > 0;
        if (seen[k]++ % stride[k] != 0) continue;
        contact[m] = contact[i];
        contact[m++].k_N_m *= stride[k];
    }
    return m;
}

/* adds s times the forces of n rows of the tool to the body's loads */
static void add_load(const pal_contact_implicit *solve, double s, const double *force_N, int first, int n)
{
    pal_contact_springs_load(solve->springs, s, force_N, solve->first + first, n, solve->body->load);
}

/* the rows of friction: elastic while they stick, a constant force while they slide */
static void add_across(pal_contact_implicit *solve)
{
    const pal_contact *contact = solve->contact;
    double along[3] = {0}, stiffness = 0, sum = 0, stretch[3];
    int n = solve->n_contact;
    for (int i = 0; i < n; i++) {
        pal_axpy3(along, solve->force_N[i], contact[i].away);
        stiffness += solve->springs->k_N_m[solve->first + i];
        sum += solve->force_N[i];
    }
    if (!pal_unit3(along, along, 0) || !(sum > 0)) return;
    for (int i = 0; i < n; i++) solve->share[i] = solve->force_N[i] / sum;
    pal_axpy3(solve->slip_m, -pal_dot3(solve->slip_m, along), along);
    pal_add3(stretch, solve->slip_m, solve->tool_move_m);
    pal_axpy3(stretch, -pal_dot3(stretch, along), along);
    double size = pal_norm3(stretch), limit_N = solve->friction * solve->normal_N;
    solve->slides = solve->slides && size > 0;
    pal_contact_group_across(along, solve->t);
    for (int k = 0; k < 2; k++) {
        if (pal_contact_springs_add_mean(solve->springs, contact, solve->share, n, solve->t[k],
                                         solve->slides ? 0 : stiffness) < 0)
            return;
        double part = pal_dot3(stretch, solve->t[k]);
        solve->force_N[n + k] = solve->slides ? limit_N * part / size : stiffness * part;
    }
    solve->across = solve->first + n;
    solve->friction_N_m = stiffness;
}

void pal_contact_implicit_begin(pal_contact_implicit *solve, pal_contact_springs *springs, pal_body *body,
                                pal_contact *contact, int n, double friction, const double move_m[3])
{
    solve->springs = springs, solve->body = body, solve->contact = contact, solve->friction = friction;
    solve->first = springs->n_row;
    solve->across = -1;
    solve->constant = solve->staged = false;
    solve->round = 0;
    pal_set3(solve->total_N, 0, 0, 0);
    solve->uncapped_N = 0;
    solve->allowed_N = INFINITY;
    solve->capped = false;
    pal_copy3(solve->slip_m, solve->next_slip_m);
    solve->slides = solve->next_slides;
    pal_copy3(solve->tool_move_m, move_m);
    bool touches = false;
    int m = 0;
    while (m < n && pal_contact_springs_add(springs, contact[m].point, contact[m].away, contact[m].k_N_m) >= 0) {
        solve->active[m] = contact[m].depth_m > 0, solve->released[m] = false;
        if (!solve->active[m]) springs->k_N_m[solve->first + m] = 0;
        solve->force_N[m] = solve->active[m] ? contact[m].k_N_m * contact[m].depth_m : 0;
        touches = touches || solve->active[m];
        m++;
    }
    solve->n_contact = m;
    if (!touches) {
        pal_set3(solve->next_slip_m, 0, 0, 0);
        solve->next_slides = false;
        solve->normal_N = 0;
    }
    if (m == 0) return;
    if (touches && friction > 0) add_across(solve);
    add_load(solve, 1, solve->force_N, 0, springs->n_row - solve->first);
}

/* came through the sphere after its release in this sub-step */
static bool is_back(const pal_contact_implicit *solve, int i)
{
    return solve->active[i] && solve->released[i];
}

/* k (d - m) of every contact, active or not; true: other contacts should have been active, by FORCE_SHARE of the
 * forces, and are now. After CHOOSE_ROUNDS solves only a contact that pulls as a whole is changed, by removing springs
 * that pull, so that this ends. In the last of several stages a pull may make up for the push of an earlier one, and
 * stays */
static bool choose(pal_contact_implicit *solve, double *force_N)
{
    const pal_contact *contact = solve->contact;
    pal_contact_springs *springs = solve->springs;
    int n = solve->n_contact;
    double wrong = 0, push = 0, pull = 0, *change = solve->share;
    for (int i = 0; i < n; i++) {
        force_N[i] = contact[i].k_N_m * (contact[i].depth_m - springs->motion_m[solve->first + i]);
        if (solve->active[i]) push += fmax(0, force_N[i]), pull += fmax(0, -force_N[i]);
        if (!is_back(solve, i) && solve->active[i] != (force_N[i] > 0)) wrong += fabs(force_N[i]);
    }
    const bool ends = solve->round++ >= CHOOSE_ROUNDS;
    if (!(ends ? !solve->staged && pull > push : wrong > FORCE_SHARE * push)) return false;
    for (int i = 0; i < n; i++) {
        const bool was = solve->active[i];
        solve->active[i] = ends ? was && force_N[i] > 0 : is_back(solve, i) || force_N[i] > 0;
        solve->released[i] |= was && !solve->active[i];
        double load = solve->active[i] ? contact[i].k_N_m * contact[i].depth_m : 0;
        change[i] = load - solve->force_N[i];
        solve->force_N[i] = load;
        springs->k_N_m[solve->first + i] = solve->active[i] ? contact[i].k_N_m : 0;
    }
    add_load(solve, 1, change, 0, n);
    return true;
}

/* the two rows of friction as the solver had them: their stretch now, and their forces */
static double across_now(const pal_contact_implicit *solve, double stretch_m[2], double force_N[2])
{
    for (int k = 0; k < 2; k++) {
        double begin = pal_dot3(solve->slip_m, solve->t[k]) + pal_dot3(solve->tool_move_m, solve->t[k]);
        stretch_m[k] = begin - solve->springs->motion_m[solve->across + k];
        force_N[k] = solve->slides ? solve->force_N[solve->n_contact + k] : solve->friction_N_m * stretch_m[k];
    }
    return hypot(stretch_m[0], stretch_m[1]);
}

/* friction after the solve, for a normal force; true: it slid although it was taken as sticking or the other way round,
 * and its two springs are changed. force_N: as the solver had it */
static bool settle_across(pal_contact_implicit *solve, double normal_N, double force_N[2])
{
    pal_contact_springs *springs = solve->springs;
    double stretch[2], change[2], stiffness = solve->friction_N_m, along = 0, had = 0;
    double free = solve->friction * normal_N / stiffness, *load = solve->force_N + solve->n_contact;
    double size = across_now(solve, stretch, force_N), within = size > free ? free / size : 1;
    for (int k = 0; k < 2; k++) along += stretch[k] * load[k], had += load[k] * load[k];
    /* while it slides its force drags tissue no farther than a spring stretched to the limit would */
    bool sticks = solve->slides && along < (1 - FORCE_SHARE) * free * sqrt(had);
    bool slips = !solve->slides && size > (1 + FORCE_SHARE) * free;
    pal_set3(solve->next_slip_m, 0, 0, 0);
    for (int k = 0; k < 2; k++) pal_axpy3(solve->next_slip_m, within * stretch[k], solve->t[k]);
    solve->next_slides = size > free && !sticks;
    solve->normal_N = normal_N;
    if (solve->round > CHOOSE_ROUNDS || !(sticks || slips)) return false;
    solve->slides = slips;
    for (int k = 0; k < 2; k++) {
        double to = slips ? within * force_N[k] : stiffness * (stretch[k] + springs->motion_m[solve->across + k]);
        change[k] = to - load[k];
        load[k] = to;
        springs->k_N_m[solve->across + k] = slips ? 0 : stiffness;
    }
    add_load(solve, 1, change, solve->n_contact, 2);
    return true;
}

/* the total on the tool, and the force of every contact that pushes, with friction shared out like the normal force */
static void sum_forces(pal_contact_implicit *solve, const double *force_N)
{
    pal_contact *contact = solve->contact;
    double across[3] = {0}, sum = 0;
    int n = solve->n_contact;
    for (int i = 0; i < n; i++) sum += fmax(0, force_N[i]);
    if (solve->across >= 0)
        for (int k = 0; k < 2; k++) pal_axpy3(across, force_N[n + k], solve->t[k]);
    pal_scale3(solve->total_N, -1, across);
    for (int i = 0; i < n; i++) {
        double push_N = fmax(0, force_N[i]);
        pal_axpy3(solve->total_N, -force_N[i], contact[i].away);
        contact[i].normal_N = push_N;
        pal_scale3(contact[i].force, push_N, contact[i].away);
        if (sum > 0) pal_axpy3(contact[i].force, push_N / sum, across);
    }
}

/* forces as the solver had them; true: springs were chosen again, the forces are a first guess of what comes next */
static bool find_forces(pal_contact_implicit *solve, double *force_N)
{
    double normal[3] = {0};
    int n = solve->n_contact;
    bool chosen = choose(solve, force_N);
    for (int i = 0; i < n; i++) {
        if (!solve->active[i]) force_N[i] = 0;
        pal_axpy3(normal, fmax(0, force_N[i]), solve->contact[i].away);
    }
    force_N[n] = force_N[n + 1] = 0;
    return chosen || (solve->across >= 0 && settle_across(solve, pal_norm3(normal), force_N + n));
}

/* true: caps leave less than the total; the loads are constant from now on, shortened to the caps */
static bool keep_caps(pal_contact_implicit *solve, const pal_tool *tool, double *force_N)
{
    const pal_body *body = solve->body;
    int n_row = solve->n_contact + (solve->across >= 0 ? 2 : 0);
    solve->uncapped_N = pal_norm3(solve->total_N);
    double largest = pal_contact_springs_max_force_N(solve->springs, force_N, solve->first, n_row),
           room = pal_tool_force_share(body, tool, solve->total_N, largest);
    solve->allowed_N = fmin(room * solve->uncapped_N, tool->force_cap_N * tool->ramp);
    if (room >= 1) {
        double node_N = largest > 0 && body->load_cap_N > 0 ? solve->uncapped_N * body->load_cap_N / largest : INFINITY;
        solve->allowed_N = fmin(tool->force_cap_N * tool->ramp, node_N);
    }
    solve->capped = room < 1;
    if (!solve->capped) return false;
    add_load(solve, -1, solve->force_N, 0, n_row);
    for (int i = 0; i < n_row; i++) {
        solve->force_N[i] = force_N[i] *= room;
        solve->springs->k_N_m[solve->first + i] = 0;
    }
    add_load(solve, 1, solve->force_N, 0, n_row);
    solve->constant = true;
    sum_forces(solve, force_N);
    return true;
}

bool pal_contact_implicit_cap(pal_contact_implicit *solve, pal_tool *tool)
{
    double force[PAL_CONTACT_IMPLICIT_MAX + 2], stretch[2];
    int n = solve->n_contact;
    solve->staged = true;
    if (n == 0 || solve->constant) return false;
    pal_sub3(tool->force_N, tool->force_N, solve->total_N);
    for (int i = 0; i < n; i++) {
        const pal_contact *c = &solve->contact[i];
        force[i] = solve->active[i] ? c->k_N_m * (c->depth_m - solve->springs->motion_m[solve->first + i]) : 0;
    }
    if (solve->across >= 0) (void)across_now(solve, stretch, force + n);
    sum_forces(solve, force);
    const bool finite = pal_finite3(solve->total_N);
    if (!finite) pal_set3(solve->total_N, 0, 0, 0);
    bool fixed = finite && keep_caps(solve, tool, force);
    pal_add3(tool->force_N, tool->force_N, solve->total_N);
    return fixed;
}

bool pal_contact_implicit_settle(pal_contact_implicit *solve, pal_tool *tool)
{
    double force[PAL_CONTACT_IMPLICIT_MAX + 2];
    bool chosen = false, fixed = false;
    if (solve->n_contact == 0) return false;
    pal_sub3(tool->force_N, tool->force_N, solve->total_N);
    if (solve->constant)
        memcpy(force, solve->force_N, sizeof force);
    else
        chosen = find_forces(solve, force);
    sum_forces(solve, force);
    if (!pal_finite3(solve->total_N)) {
        pal_set3(solve->total_N, 0, 0, 0);
        return false;
    }
    if (chosen) {
        solve->uncapped_N = pal_norm3(solve->total_N);
        pal_scale3(solve->total_N, pal_tool_force_share(solve->body, tool, solve->total_N, 0), solve->total_N);
    } else if (!solve->constant)
        fixed = keep_caps(solve, tool, force);
    pal_add3(tool->force_N, tool->force_N, solve->total_N);
    tool->touching = tool->touching || pal_dot3(solve->total_N, solve->total_N) > 0;
    return chosen || fixed;
}
