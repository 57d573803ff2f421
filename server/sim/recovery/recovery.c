/* Regions of inverted elements: choice, energy, tank. */
#include "server/sim/recovery/recovery.h"

#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/num/union_find.h"
#include "server/sim/core/best_rotation.h"
#include "server/sim/core/rigid_motion.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NONE = -1, NEW_REGION = -2 };

/* ---- load ---- */

/* numbers the different ones among the edges of all elements */
static pal_err find_edges(pal_recovery *r, pal_arena *arena)
{
    const pal_recovery_model *m = &r->model;
    int32_t pair[PAL_RECOVERY_EDGES_MAX][2], n_slot = 0;
    for (int e = 0; e < m->n_element; e++) r->first[e] = n_slot, n_slot += m->edges(m->self, e, pair);
    r->first[m->n_element] = n_slot;
    r->edge_of = PAL_NEW(arena, int32_t, n_slot);
    /* edges are listed by their smaller node: begin of its list, next of an edge, larger node */
    int32_t *head = malloc(sizeof *head * (size_t)(r->n_node + 1)), *next = malloc(sizeof *next * (size_t)(n_slot + 1)),
            *far = malloc(sizeof *far * (size_t)(n_slot + 1));
    if (!r->edge_of || !head || !next || !far) {
        free(head), free(next), free(far);
        return PAL_ERR_MEMORY;
    }
    for (int i = 0; i < r->n_node; i++) head[i] = NONE;
    r->n_edge = 0;
    for (int e = 0; e < m->n_element; e++)
        for (int k = m->edges(m->self, e, pair) - 1; k >= 0; k--) {
            const int32_t a = pair[k][0] < pair[k][1] ? pair[k][0] : pair[k][1], b = pair[k][0] + pair[k][1] - a;
            int32_t at = head[a];
            while (at != NONE && far[at] != b) at = next[at];
            if (at == NONE) at = r->n_edge++, far[at] = b, next[at] = head[a], head[a] = at;
            r->edge_of[r->first[e] + k] = at;
        }
    r->end = PAL_NEW(arena, int32_t, 2 * (size_t)r->n_edge);
    for (int i = 0; i < r->n_node && r->end; i++)
        for (int32_t at = head[i]; at != NONE; at = next[at]) r->end[2 * at] = i, r->end[2 * at + 1] = far[at];
    free(head), free(next), free(far);
    return r->end ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_recovery_make(const pal_recovery_model *model, int n_node, const double *rest, pal_arena *arena,
                          pal_recovery **out)
{
    pal_recovery *r = PAL_NEW(arena, pal_recovery, 1);
    if (!r) return PAL_ERR_MEMORY;
    r->model = *model, r->n_node = n_node, r->rest = rest;
    const size_t n = (size_t)model->n_element;
    r->first = PAL_NEW(arena, int32_t, n + 1);
    if (!r->first) return PAL_ERR_MEMORY;
    PAL_TRY(find_edges(r, arena));
    r->k_N_m = PAL_NEW(arena, double, r->n_edge);
    r->active = PAL_NEW(arena, int32_t, r->n_edge);
    r->edge_region = PAL_NEW(arena, int32_t, r->n_edge);
    r->region = PAL_NEW(arena, int32_t, n);
    r->on = PAL_NEW(arena, uint8_t, n);
    r->enters = PAL_NEW(arena, uint8_t, model->n_group + 1);
    r->low = PAL_NEW(arena, float, n);
    r->high = PAL_NEW(arena, float, n);
    r->middle = PAL_NEW(arena, float, n);
    r->root = PAL_NEW(arena, int32_t, n_node);
    if (!PAL_NEW_DOUBLES(arena, 3 * (size_t)n_node, &r->d_m, &r->load_N)) return PAL_ERR_MEMORY;
    if (!r->k_N_m || !r->active || !r->edge_region || !r->region || !r->on || !r->enters || !r->low || !r->high ||
        !r->middle || !r->root)
        return PAL_ERR_MEMORY;
    for (size_t e = 0; e < n; e++) r->region[e] = NONE, r->on[e] = 1;
    *out = r;
    return PAL_ERR_OK;
}

static const int32_t *ends(const pal_recovery *r, int edge)
{
    return r->end + 2 * (size_t)edge;
}

/* the regions are known: which elements act, and the constants of the edges of the others */
static void apply_regions(pal_recovery *r)
{
    const pal_recovery_model *m = &r->model;
    memset(r->k_N_m, 0, sizeof *r->k_N_m * (size_t)r->n_edge);
    for (int e = 0; e < m->n_element; e++) {
        r->on[e] = r->region[e] < 0;
        const double k_N_m = r->on[e] ? 0 : m->stiffness_N_m(m->self, e);
        for (int s = r->first[e]; s < r->first[e + 1] && !r->on[e]; s++) {
            const int i = r->edge_of[s];
            r->k_N_m[i] += k_N_m;
            r->edge_region[i] = r->region[e];
        }
    }
    r->n_active = 0;
    for (int i = 0; i < r->n_edge; i++)
        if (r->k_N_m[i] > 0) r->active[r->n_active++] = i;
    r->at_rest = false;
    m->act(m->self, r->on);
}

void pal_recovery_reset(pal_recovery *r)
{
    const bool any = r->n_region > 0;
    for (int e = 0; e < r->model.n_element && any; e++) r->region[e] = NONE;
    r->n_region = 0;
    r->was_bad = false;
    r->bad_s = r->tank_J = r->debt_J = 0;
    if (any) apply_regions(r);
}

void pal_recovery_refresh(pal_recovery *r)
{
    if (pal_recovery_acts(r)) apply_regions(r);
}

void pal_recovery_transfer(pal_recovery *r, const pal_recovery *from, bool same_supports)
{
    if (r->model.n_element != from->model.n_element || r->n_edge != from->n_edge || r->n_node != from->n_node) return;
    memcpy(r->region, from->region, sizeof *r->region * (size_t)r->model.n_element);
    memcpy(r->of, from->of, sizeof r->of);
    for (int p = 0; p < from->n_region; p++) r->of[p].fixed &= same_supports;
    const bool any = r->n_region > 0 || from->n_region > 0;
    r->n_region = from->n_region, r->was_bad = from->was_bad, r->bad_s = from->bad_s, r->tank_J = 0;
    r->debt_J = from->debt_J, r->counted_J = from->counted_J, r->seen_s = from->seen_s, r->touched = true;
    memcpy(r->d_m, from->d_m, 3 * sizeof *r->d_m * (size_t)r->n_node);
    memcpy(r->load_N, from->load_N, 3 * sizeof *r->load_N * (size_t)r->n_node);
    if (any) apply_regions(r);
}

/* ---- the energy of regions ---- */

static void edge_vector(const double *x, const int32_t end[2], double out[3])
{
    pal_sub3(out, x + 3 * (size_t)end[1], x + 3 * (size_t)end[0]);
}

/* best-fit G of the regions without a fixed one */
static void fit(pal_recovery *r, const double *d)
{
    bool any = false;
    for (int p = 0; p < r->n_region; p++) memset(r->of[p].sum, 0, sizeof r->of[p].sum), any |= !r->of[p].fixed;
    for (int n = 0; n < r->n_active && any; n++) {
        const int i = r->active[n];
        pal_recovery_region *region = &r->of[r->edge_region[i]];
        double x[3], y[3];
        if (region->fixed) continue;
        edge_vector(d, ends(r, i), x), edge_vector(r->rest, ends(r, i), y);
        pal_add_outer(region->sum, r->k_N_m[i], x, y);
    }
    for (int p = 0; p < r->n_region; p++)
        if (!r->of[p].fixed) pal_best_rotation(r->of[p].sum, r->of[p].rotation);
}

double pal_recovery_energy(pal_recovery *r, const double *d, double *f)
{
    double sum = 0;
    if (!pal_recovery_acts(r) || r->at_rest) return 0;
    fit(r, d);
    for (int p = 0; p < r->n_region; p++) r->of[p].energy_J = r->of[p].size_J = 0;
    for (int n = 0; n < r->n_active; n++) {
        const int i = r->active[n];
        const int32_t *end = ends(r, i);
        pal_recovery_region *region = &r->of[r->edge_region[i]];
        const double k = region->scale * r->k_N_m[i];
        double x[3], y[3], u[3];
        edge_vector(d, end, x), edge_vector(r->rest, end, y);
        pal_mul33(u, region->rotation, y);
        pal_sub3(u, x, u);
        region->energy_J += 0.5 * k * pal_dot3(u, u), region->size_J += r->k_N_m[i] * pal_dot3(y, y);
        if (!f) continue;
        pal_axpy3(f + 3 * (size_t)end[0], k, u);
        pal_axpy3(f + 3 * (size_t)end[1], -k, u);
    }
    for (int p = 0; p < r->n_region; p++) sum += r->of[p].energy_J;
    return sum;
}

void pal_recovery_select(pal_recovery *r, const pal_body *body)
{
    const bool at_rest = body->d == body->node_rest;
    if (!pal_recovery_acts(r) || at_rest == r->at_rest) return;
    r->at_rest = at_rest;
    for (int e = 0; e < r->model.n_element; e++) r->on[e] = at_rest || r->region[e] < 0;
    r->model.act(r->model.self, r->on);
}

static int n_acting(const pal_recovery *r)
{
    return pal_recovery_acts(r) && !r->at_rest ? r->n_active : 0;
}

void pal_recovery_add_forces(pal_recovery *r, pal_body *body)
{
    if (n_acting(r) == 0) return;
    const uint64_t before = pal_clock_ns();
    (void)pal_recovery_energy(r, body->d, body->f);
    body->safeguards.ns += pal_clock_ns() - before;
}

static double scaled(const pal_recovery *r, int edge)
{
    return r->of[r->edge_region[edge]].scale * r->k_N_m[edge];
}

void pal_recovery_multiply(const pal_recovery *r, double k, const double *p, double *out)
{
    for (int n = 0; n < n_acting(r); n++) {
        const int i = r->active[n];
        double x[3];
        edge_vector(p, ends(r, i), x);
        pal_axpy3(out + 3 * (size_t)ends(r, i)[0], -k * scaled(r, i), x);
        pal_axpy3(out + 3 * (size_t)ends(r, i)[1], k * scaled(r, i), x);
    }
}

void pal_recovery_assemble(const pal_recovery *r, double k, pal_block_matrix *to)
{
    for (int n = 0; n < n_acting(r); n++) {
        const int i = r->active[n];
        const int32_t *end = ends(r, i);
        double *block[3] = {to->value + 9 * (size_t)to->start[end[0]], to->value + 9 * (size_t)to->start[end[1]],
                            to->value + 9 * (size_t)pal_block_matrix_find(to, end[1], end[0])};
        for (int b = 0; b < 3; b++)
            for (int c = 0; c < 9; c += 4) block[b][c] += (b < 2 ? k : -k) * scaled(r, i);
    }
}

void pal_recovery_rotate(const pal_recovery *r, double *rotation)
{
    for (int n = 0; n < n_acting(r); n++) {
        const int i = r->active[n];
        for (int b = 0; b < 2; b++)
            for (int c = 0; c < 9; c++)
                rotation[9 * (size_t)ends(r, i)[b] + (size_t)c] += r->k_N_m[i] * r->of[r->edge_region[i]].rotation[c];
    }
}

void pal_recovery_bound(const pal_recovery *r, double *bound_N_m)
{
    for (int n = 0; n < n_acting(r); n++)
        for (int b = 0; b < 2; b++) bound_N_m[ends(r, r->active[n])[b]] += 2 * scaled(r, r->active[n]);
}

/* ---- damping ---- */

/* c of an edge, Ns/m: PAL_RECOVERY_DAMPING of what is critical for its ends alone on it */
static double edge_damping(const pal_recovery *r, const pal_body *body, int edge)
{
    const int32_t *end = ends(r, edge);
    double inverse_1_kg = 0;
    for (int b = 0; b < 2; b++)
        if (body->interpolation || !body->support[end[b]]) inverse_1_kg += 1 / body->node_mass_kg[end[b]];
    return inverse_1_kg > 0 ? 2 * PAL_RECOVERY_DAMPING * sqrt(scaled(r, edge) / inverse_1_kg) : 0;
}

/* w = A^-1 sum c x x v, A = sum c (x.x I - x x') */
static void find_spins(pal_recovery *r, const pal_body *body)
{
    for (int p = 0; p < r->n_region; p++)
        memset(r->of[p].sum, 0, sizeof r->of[p].sum), pal_set3(r->of[p].spin_1_s, 0, 0, 0);
    for (int n = 0; n < r->n_active; n++) {
        const int i = r->active[n];
        pal_recovery_region *region = &r->of[r->edge_region[i]];
        const double c = edge_damping(r, body, i);
        double x[3], rate[3], moment[3];
        edge_vector(body->d, ends(r, i), x), edge_vector(body->dv, ends(r, i), rate);
        pal_add_outer(region->sum, -c, x, x);
        for (int a = 0; a < 3; a++) region->sum[4 * a] += c * pal_dot3(x, x);
        pal_cross3(moment, x, rate);
        pal_axpy3(region->spin_1_s, c, moment);
    }
    for (int p = 0; p < r->n_region; p++) {
        double moment[3];
        pal_copy3(moment, r->of[p].spin_1_s);
        pal_rigid_spin(r->of[p].sum, moment, 0, r->of[p].spin_1_s);
    }
}

void pal_recovery_damp(pal_recovery *r, pal_body *body)
{
    if (n_acting(r) == 0) return;
    const uint64_t before = pal_clock_ns();
    find_spins(r, body);
    for (int n = 0; n < r->n_active; n++) {
        const int i = r->active[n];
        const double c = edge_damping(r, body, i);
        double x[3], rate[3], rotation[3];
        edge_vector(body->d, ends(r, i), x), edge_vector(body->dv, ends(r, i), rate);
        pal_cross3(rotation, r->of[r->edge_region[i]].spin_1_s, x);
        pal_sub3(rate, rate, rotation);
        pal_axpy3(body->f + 3 * (size_t)ends(r, i)[0], c, rate);
        pal_axpy3(body->f + 3 * (size_t)ends(r, i)[1], -c, rate);
    }
    body->safeguards.ns += pal_clock_ns() - before;
}

void pal_recovery_damping_bound(const pal_recovery *r, const pal_body *body, double *bound_Ns_m)
{
    for (int n = 0; n < n_acting(r); n++)
        for (int b = 0; b < 2; b++) bound_Ns_m[ends(r, r->active[n])[b]] += 2 * edge_damping(r, body, r->active[n]);
}

/* ---- choice of regions ---- */

static bool is_bad(const pal_recovery *r, int e)
{
    return !((double)r->low[e] >= PAL_INVERTED_LOW && (double)r->high[e] <= PAL_INVERTED_HIGH);
}
/* is its middle? Then its energy has no derivative there, while one with a bad corner alone is pulled back by it */
static bool is_crushed(const pal_recovery *r, int e)
{
    return is_bad(r, e) && !((double)r->middle[e] >= PAL_RECOVERED_LOW && (double)r->middle[e] <= PAL_RECOVERED_HIGH);
}
static bool is_good(const pal_recovery *r, int e)
{
    return (double)r->low[e] >= PAL_RECOVERED_LOW && (double)r->high[e] <= PAL_RECOVERED_HIGH;
}

static bool is_pressed(const pal_body *body)
{
    bool any = false;
    for (int i = 0; i < body->n_node && !any; i++)
        any = pal_norm3(body->load + 3 * (size_t)i) > PAL_REST_SHARE * body->load_cap_N;
    return any;
}

/* weight draws a soft region out, by 1 / s, and that keeps it bad: it may grow again when it is stiff */
static bool is_drawn_out(const pal_recovery *r, const pal_step *step)
{
    bool soft = false, weighs = false;
    for (int p = 0; p < r->n_region; p++) soft |= r->of[p].scale < 1;
    for (int i = 0; i < step->n_force; i++) weighs |= step->force[i].effect->energy && !step->force[i].effect->internal;
    return soft && weighs;
}

/* which regions are bad */
static void examine(pal_recovery *r, double passed_s)
{
    for (int p = 0; p < r->n_region; p++) r->of[p].bad = false, r->of[p].n = 0;
    for (int e = 0; e < r->model.n_element; e++) {
        if (r->region[e] < 0) continue;
        pal_recovery_region *region = &r->of[r->region[e]];
        region->n++;
        region->bad |= !is_good(r, e);
    }
    for (int p = 0; p < r->n_region; p++) {
        r->of[p].grow_s -= passed_s;
        r->of[p].good_s = r->of[p].bad ? 0 : r->of[p].good_s + passed_s;
    }
}

/* joins the nodes of all elements, or of those in regions */
static void join(pal_recovery *r, bool all)
{
    pal_union_find_init(r->root, r->n_node);
    for (int e = 0; e < r->model.n_element; e++)
        for (int s = r->first[e]; s < r->first[e + 1] && (all || r->region[e] != NONE); s++)
            pal_union_find_join(r->root, ends(r, r->edge_of[s])[0], ends(r, r->edge_of[s])[1]);
}

static int node_of(const pal_recovery *r, int e)
{
    return ends(r, r->edge_of[r->first[e]])[0];
}

/* the root of a node's set once it is known; a marked root is -1 - root */
static int follow(const pal_recovery *r, int i)
{
    while (r->root[i] >= 0 && r->root[i] != i) i = r->root[i];
    return i;
}

/* the neighbours of the regions that grow enter, or all that is connected with them; true: any */
static bool grow(pal_recovery *r, const bool *grows)
{
    bool any = false;
    if (r->bad_s >= PAL_RECOVERY_WHOLE_S)
        join(r, true);
    else
        pal_union_find_init(r->root, r->n_node);
    for (int e = 0; e < r->model.n_element; e++)
        for (int s = r->first[e]; s < r->first[e + 1] && r->region[e] >= 0 && grows[r->region[e]]; s++)
            for (int b = 0; b < 2; b++) {
                const int i = follow(r, ends(r, r->edge_of[s])[b]);
                if (r->root[i] >= 0) r->root[i] = -1 - i;
            }
    for (int e = 0; e < r->model.n_element; e++) {
        bool beside = false;
        for (int s = r->first[e]; s < r->first[e + 1] && r->region[e] == NONE && !beside; s++)
            for (int b = 0; b < 2; b++) beside |= r->root[follow(r, ends(r, r->edge_of[s])[b])] < 0;
        if (beside) r->region[e] = NEW_REGION;
        any |= beside;
    }
    return any;
}

static void enter_groups(pal_recovery *r)
{
    const pal_recovery_model *m = &r->model;
    memset(r->enters, 0, (size_t)m->n_group);
    for (int e = 0; e < m->n_element && m->n_group > 0; e++)
        if (r->region[e] == NEW_REGION) r->enters[m->group(m->self, e)] = 1;
    for (int e = 0; e < m->n_element && m->n_group > 0; e++)
        if (r->region[e] == NONE && r->enters[m->group(m->self, e)]) r->region[e] = NEW_REGION;
}

/* Crushed elements enter, and when no load acts also the others that have been inverted for PAL_RECOVERY_WAIT_S, and
 * the neighbours of regions that do not recover; true: any */
static bool enter(pal_recovery *r, bool pressed)
{
    const bool lasts = !pressed && r->bad_s + 1e-9 >= PAL_RECOVERY_WAIT_S;
    bool grows[PAL_RECOVERY_REGIONS_MAX], asked = false, any = false;
    for (int p = 0; p < r->n_region; p++) {
        grows[p] = lasts && r->of[p].bad && r->of[p].grow_s <= 0;
        if (grows[p]) r->of[p].grow_s = PAL_RECOVERY_GROW_S;
        asked |= grows[p];
    }
    any = asked && grow(r, grows);
    for (int e = 0; e < r->model.n_element; e++)
        if (r->region[e] == NONE && (is_crushed(r, e) || (lasts && is_bad(r, e))))
            r->region[e] = NEW_REGION, any = true;
    if (any) enter_groups(r);
    return any;
}

/* numbers the connected regions. One that has not changed keeps its clocks and s */
static void number(pal_recovery *r)
{
    pal_recovery_region old[PAL_RECOVERY_REGIONS_MAX];
    int home[PAL_RECOVERY_REGIONS_MAX]; /* the old region of all of its elements; NOT: they are of several, or new */
    memcpy(old, r->of, sizeof *old * (size_t)r->n_region);
    join(r, false);
    for (int i = 0; i < r->n_node; i++) r->root[i] = pal_union_find_root(r->root, i);
    r->n_region = 0;
    for (int e = 0; e < r->model.n_element; e++) {
        const int was = r->region[e];
        if (was == NONE) continue;
        /* a root that has a number is -1 - number */
        const int i = node_of(r, e), at = r->root[i] >= 0 ? r->root[i] : i;
        if (r->root[at] >= 0) {
            if (r->n_region < PAL_RECOVERY_REGIONS_MAX)
                home[r->n_region] = was,
                r->of[r->n_region++] = (pal_recovery_region){.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .scale = 1};
            r->root[at] = -r->n_region;
        }
        const int now = r->region[e] = -1 - r->root[at];
        pal_recovery_region *region = &r->of[now];
        region->n++;
        if (home[now] != was) home[now] = NONE;
        region->grow_s = fmax(region->grow_s, was >= 0 ? old[was].grow_s : 0);
    }
    for (int p = 0; p < r->n_region; p++) {
        r->of[p].stays = home[p] >= 0 && old[home[p]].n == r->of[p].n;
        if (r->of[p].stays) r->of[p] = old[home[p]], r->of[p].stays = true;
    }
}

static bool is_held(const pal_body *body, int node)
{
    const pal_interpolation *rows = body->interpolation;
    bool all = true;
    if (!rows) return body->support[node];
    for (int32_t k = rows->start[node]; k < rows->start[node + 1]; k++) all &= body->support[rows->point[k]] != 0;
    return all;
}

/* which changed regions take the rotation of the supports */
static void fix(pal_recovery *r, const pal_body *body, bool changed)
{
    double rotation[9];
    const bool known = pal_support_rotation(body, rotation);
    for (int p = 0; p < r->n_region && changed; p++)
        if (!r->of[p].stays) r->of[p].fixed = 2 * r->of[p].n > r->model.n_element;
    for (int n = 0; n < r->n_active && changed; n++) {
        pal_recovery_region *region = &r->of[r->edge_region[r->active[n]]];
        for (int b = 0; b < 2; b++) region->fixed |= !region->stays && is_held(body, ends(r, r->active[n])[b]);
    }
    for (int p = 0; p < r->n_region; p++) {
        r->of[p].fixed &= known;
        if (r->of[p].fixed) memcpy(r->of[p].rotation, rotation, sizeof rotation);
    }
}

/* ---- the account of energy ---- */

static double total_J(const pal_step *step)
{
    double sum = pal_body_kinetic_J(step->body);
    for (int i = 0; i < step->n_force; i++)
        if (step->force[i].effect->energy) sum += step->force[i].effect->energy(step->force[i].self, step->body);
    return sum;
}

/* what the loads of the last update have put in since, J; NAN: contact did, whose forces change within a sub-step.
 * Where loads have changed the account begins anew, so that release is followed by no more energy than there was */
static double work_J(pal_recovery *r, const pal_body *body)
{
    double sum = 0;
    bool same = true;
    for (int i = 0; i < 3 * r->n_node; i++) {
        sum += r->load_N[i] * (body->d[i] - r->d_m[i]);
        same &= fabs(body->load[i] - r->load_N[i]) <= 1e-9 * body->load_cap_N;
    }
    if (!same) r->tank_J = 0;
    return same && !r->touched ? sum : NAN;
}

static void save_loads(pal_recovery *r, const pal_body *body)
{
    const double *lasting = body->external_force;
    r->touched = false;
    for (int i = 0; i < 3 * r->n_node; i++) {
        r->load_N[i] = body->load[i], r->d_m[i] = body->d[i];
        r->touched |= body->load[i] != 0 && !(lasting && lasting[i] != 0);
    }
}

static bool is_driven(const pal_body *body)
{
    for (int i = 0; i < body->n_dof; i++)
        if (body->support[i] && pal_dot3(body->v + 3 * i, body->v + 3 * i) > 0) return true;
    return false;
}

/* the floor of s has put in what the tank cannot pay */
static void withdraw(pal_recovery *r, double cost_J)
{
    r->tank_J -= cost_J;
    if (r->tank_J < 0) r->debt_J -= r->tank_J, r->tank_J = 0;
}
static void deposit(pal_recovery *r, double gain_J)
{
    const double repaid = fmin(gain_J, r->debt_J);
    r->debt_J -= repaid;
    r->tank_J += gain_J - repaid;
}

/* gain: what has left the body since the last update. Less the work of loads it has dissipated that, which fills the
 * tank. What a change from outside has put in (material, supports) the tank pays, and where it cannot, s is lowered */
static void update_tank(pal_recovery *r, const pal_body *body, double gain)
{
    gain += work_J(r, body);
    if (isnan(gain)) return;
    if (gain >= 0) deposit(r, gain);
    if (gain >= 0 || is_driven(body)) return;
    double left = -gain - r->tank_J, regions = 0;
    r->tank_J = fmax(0, r->tank_J + gain);
    if (!(left > 0)) return;
    for (int p = 0; p < r->n_region; p++) regions += r->of[p].energy_J;
    const double by = regions > left ? fmax(PAL_RECOVERY_SOFT_MIN, 1 - left / regions) : PAL_RECOVERY_SOFT_MIN;
    for (int p = 0; p < r->n_region; p++) {
        const double scale = fmin(r->of[p].scale, fmax(PAL_RECOVERY_SOFT_MIN, by * r->of[p].scale));
        r->of[p].energy_J *= scale / r->of[p].scale;
        r->of[p].scale = scale;
    }
}

/* s rises to 1 as the tank permits */
static void stiffen(pal_recovery *r, double passed_s)
{
    for (int p = 0; p < r->n_region; p++) {
        pal_recovery_region *region = &r->of[p];
        if (region->scale >= 1) continue;
        const double phi = region->energy_J / region->scale;
        double by = fmin(1 - region->scale, passed_s / PAL_RECOVERY_STIFFEN_S);
        if (by * phi > r->tank_J) by = r->tank_J / phi;
        region->scale += by, region->energy_J += by * phi;
        withdraw(r, by * phi);
    }
}

/* The regions that become elements again: no element is bad, they store little, and the tank pays for what that is
 * above what the region stores. True: any */
static bool leave(pal_recovery *r, const pal_body *body, double elements_J)
{
    bool any = false;
    for (int p = 0; p < r->n_region; p++) {
        pal_recovery_region *region = &r->of[p];
        if (region->bad) continue;
        for (int e = 0; e < r->model.n_element; e++) r->on[e] = r->region[e] < 0 || r->region[e] == p;
        r->model.act(r->model.self, r->on);
        const double all_J = r->model.energy(r->model.self, body), rise = all_J - elements_J - region->energy_J;
        const double stored_J = rise + region->energy_J,
                     share = r->model.no_gradient ? PAL_REST_SHARE
                                                  : PAL_RECOVERY_LEAVE_STRAIN * PAL_RECOVERY_LEAVE_STRAIN / 6;
        const bool settled = isinf(r->tank_J) || region->good_s >= PAL_RECOVERY_WHOLE_S;
        if (rise > r->tank_J || (!settled && stored_J > share * region->size_J)) continue;
        for (int e = 0; e < r->model.n_element; e++)
            if (r->region[e] == p) r->region[e] = NONE;
        elements_J = all_J;
        any = true;
    }
    return any;
}

/* the elements in regions have changed: chooses G, and s of changed regions such that there is no more energy than
 * before_J and the tank have */
static void begin(pal_recovery *r, const pal_body *body, double before_J)
{
    number(r);
    apply_regions(r);
    fix(r, body, true);
    double new_J = 0, left_J = before_J - r->model.energy(r->model.self, body);
    (void)pal_recovery_energy(r, body->d, NULL);
    for (int p = 0; p < r->n_region; p++)
        if (r->of[p].stays)
            left_J -= r->of[p].energy_J;
        else
            new_J += r->of[p].energy_J;
    const double wanted = new_J > left_J ? left_J / new_J : 1, scale = fmax(PAL_RECOVERY_SOFT_MIN, wanted);
    for (int p = 0; p < r->n_region; p++)
        if (!r->of[p].stays) r->of[p].scale = scale, r->of[p].energy_J *= scale;
    const double gain = left_J - scale * new_J;
    if (gain >= 0)
        deposit(r, gain);
    else
        withdraw(r, -gain);
}

static double regions_J(const pal_recovery *r)
{
    double sum = 0;
    for (int p = 0; p < r->n_region; p++) sum += r->of[p].energy_J;
    return sum;
}

/* regions and s at the present state, where elements are inverted or in regions; true: elements have entered or left */
static bool update(pal_recovery *r, pal_step *step, double passed_s)
{
    pal_body *body = step->body;
    const bool acted = r->n_region > 0;
    bool good = false, changed = false;
    double before_J = NAN;
    examine(r, passed_s);
    for (int p = 0; p < r->n_region; p++) good |= !r->of[p].bad;
    if (acted) {
        fix(r, body, false);
        r->counted_J -= total_J(step); /* now what is lost since then */
        if (step->finds_balance)
            r->tank_J = INFINITY;
        else
            update_tank(r, body, r->counted_J);
        stiffen(r, step->finds_balance ? INFINITY : passed_s);
    }
    if (good) {
        before_J = r->model.energy(r->model.self, body);
        changed = leave(r, body, before_J);
        if (!changed) apply_regions(r);
    }
    const bool entered = enter(r, is_pressed(body) || is_drawn_out(r, step));
    if (entered && !good) before_J = r->model.energy(r->model.self, body);
    changed |= entered;
    if (changed) begin(r, body, before_J + regions_J(r));
    if (r->n_region == 0) r->tank_J = r->debt_J = 0;
    if (r->n_region == 0) return changed;
    r->counted_J = total_J(step);
    save_loads(r, body);
    return changed;
}

unsigned pal_recovery_update(pal_recovery *r, pal_step *step)
{
    pal_body *body = step->body;
    double range[2] = {1, 1};
    if (!r || body->d == body->node_rest) return 0;
    pal_recovery_select(r, body);
    if (r->n_region == 0) {
        r->model.range(r->model.self, body, range);
        if (range[0] >= PAL_INVERTED_LOW && range[1] <= PAL_INVERTED_HIGH) {
            r->was_bad = false;
            return 0;
        }
    }
    if (!pal_body_finite(body)) return 0;
    const uint64_t began = pal_clock_ns();
    const double passed_s = r->was_bad || r->n_region > 0 ? fmax(0, step->time_s - r->seen_s) : 0;
    r->seen_s = step->time_s;
    r->model.ratios(r->model.self, body, r->low, r->high, r->middle);
    bool bad = false;
    for (int e = 0; e < r->model.n_element; e++) bad |= r->region[e] < 0 ? is_bad(r, e) : !is_good(r, e);
    if (!bad && r->n_region == 0) {
        r->was_bad = false;
        return 0;
    }
    r->bad_s = bad && r->was_bad ? r->bad_s + passed_s : 0;
    r->was_bad = bad;
    const bool acted = r->n_region > 0, changed = update(r, step, passed_s);
    body->safeguards.n_change += acted != (r->n_region > 0);
    body->safeguards.n_inversion++;
    body->safeguards.ns += pal_clock_ns() - began;
    const bool at_rest = acted && pal_body_kinetic_J(body) < PAL_REST_SHARE * regions_J(r);
    return PAL_INVERTED | (changed ? PAL_INVERSION_CHANGED : 0) | (at_rest ? PAL_INVERSION_AT_REST : 0);
}
