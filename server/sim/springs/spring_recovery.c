/* Regions of inverted springs. */
#include "server/sim/springs/spring_recovery.h"

#include "server/base/clock.h"
#include "server/num/union_find.h"
#include "server/sim/springs/tuning.h"

#include <math.h>

/* a body's sets of springs by kind; NULL: none */
typedef struct sets {
    pal_spring_set *of[3];
} sets;

pal_err pal_spring_recovery_make(int n_node, pal_arena *arena, pal_spring_recovery **out)
{
    pal_spring_recovery *t = PAL_NEW(arena, pal_spring_recovery, 1);
    if (!t) return PAL_ERR_MEMORY;
    t->n_node = n_node;
    t->region = PAL_NEW(arena, int32_t, n_node);
    t->root = PAL_NEW(arena, int32_t, n_node);
    t->node_sum = PAL_NEW(arena, double, n_node);
    if (!t->region || !t->root || !t->node_sum) return PAL_ERR_MEMORY;
    for (int i = 0; i < n_node; i++) t->region[i] = -1;
    *out = t;
    return PAL_ERR_OK;
}

void pal_spring_recovery_reset(pal_spring_recovery *t)
{
    for (int i = 0; i < t->n_node && t->n_region > 0; i++) t->region[i] = -1;
    t->stale = t->stale || t->n_region > 0;
    t->n_region = 0;
}

void pal_spring_recovery_transfer(pal_spring_recovery *t, const pal_spring_recovery *from)
{
    memcpy(t->region, from->region, sizeof *t->region * (size_t)t->n_node);
    memcpy(t->of, from->of, sizeof t->of);
    t->n_region = from->n_region, t->damp_s = from->damp_s, t->first_J = from->first_J;
    t->k_J = from->k_J, t->seen_s = from->seen_s;
    t->stale = true;
}

static sets find_sets(const pal_step *step)
{
    sets r = {{NULL, NULL, NULL}};
    for (int i = 0; i < step->n_force; i++) {
        const pal_effect *effect = step->force[i].effect;
        pal_spring_set *set = effect->recovery.springs ? effect->recovery.springs(step->force[i].self) : NULL;
        if (set && set->all) r.of[set->spring.kind] = set;
    }
    return r;
}

static const int32_t *corners(const pal_spring_set *set, int i)
{
    return set->item + (size_t)set->n_corner * (size_t)i;
}

/* the region of a spring, -1: none; edges join its nodes, so at most one region has any of them */
static int region_of(const pal_spring_recovery *t, const pal_spring_set *set, int i)
{
    const int32_t *node = corners(set, i);
    for (int c = 0; c < set->n_corner; c++)
        if (t->region[node[c]] >= 0) return t->region[node[c]];
    return -1;
}

static double edge_N_m(const void *self, int i)
{
    const pal_spring_set *set = self;
    const int lane = set->simd_blocks.place[i];
    return set->spring.k_J * set->all[lane] * set->w[lane] * set->w[lane];
}

static double regions_energy(pal_spring_recovery *t, const pal_spring_set *edges, const pal_body *body, double *f)
{
    const pal_region_edges in_regions = {edges->n_off, edges->edge, edge_N_m, edges, body->x_rest};
    pal_regions_fit(t->of, t->n_region, &in_regions, body->d);
    return pal_regions_energy(t->of, t->n_region, &in_regions, body->d, body->dv, t->damp_s, f);
}

void pal_spring_recovery_force(pal_spring_recovery *t, const pal_spring_set *edges, pal_body *body)
{
    const uint64_t before = pal_clock_ns();
    (void)regions_energy(t, edges, body, body->f);
    body->safeguards.ns += pal_clock_ns() - before;
}

double pal_spring_recovery_energy(pal_spring_recovery *t, const pal_spring_set *edges, const pal_body *body)
{
    return regions_energy(t, edges, body, NULL);
}

/* ---- detection ---- */

static double volume_ratio(const pal_spring_set *set, int i, const double *d)
{
    const double *x[PAL_CORNERS];
    pal_spring_corners(set, d, i, x);
    return set->w[set->simd_blocks.place[i]] * pal_spring_measure(PAL_SPRING_VOLUME, x);
}

static double spring_J(const pal_spring_set *set, int i, const pal_body *body)
{
    const double *x[PAL_CORNERS];
    pal_constraint s;
    const int lane = set->simd_blocks.place[i];
    pal_spring_corners(set, body->d, i, x);
    pal_spring_constraint(set->spring.kind, x, set->w[lane], &s);
    return 0.5 * set->all[lane] * set->spring.k_J * s.c * s.c;
}

static bool loaded(const pal_body *body, int node)
{
    const double *load = body->load + 3 * (size_t)node;
    return load[0] != 0 || load[1] != 0 || load[2] != 0;
}

/* energies of the regions and of their springs; which are inverted and which are loaded */
static void weigh(pal_spring_recovery *t, const sets *r, const pal_body *body)
{
    const pal_spring_set *edges = r->of[PAL_SPRING_DISTANCE], *tets = r->of[PAL_SPRING_VOLUME];
    for (int p = 0; p < t->n_region; p++) {
        pal_inverted_region *region = &t->of[p];
        region->region_J = region->element_J = region->size_J = region->kinetic_J = 0;
        region->bad = region->pressed = false, region->n = 0;
    }
    (void)regions_energy(t, edges, body, NULL);
    for (int k = 0; k < edges->n_off; k++)
        t->of[edges->edge[k].region].size_J += edges->spring.k_J * edges->all[edges->simd_blocks.place[edges->off[k]]];
    for (int kind = 0; kind < 3; kind++)
        for (int k = 0; r->of[kind] && k < r->of[kind]->n_off; k++) {
            const int i = r->of[kind]->off[k];
            t->of[region_of(t, r->of[kind], i)].element_J += spring_J(r->of[kind], i, body);
        }
    for (int k = 0; k < tets->n_off; k++) {
        const double ratio = volume_ratio(tets, tets->off[k], body->d);
        t->of[region_of(t, tets, tets->off[k])].bad |= !(ratio > PAL_RECOVERED_LOW && ratio < PAL_RECOVERED_HIGH);
    }
    for (int i = 0; i < t->n_node; i++) {
        if (t->region[i] < 0) continue;
        pal_inverted_region *region = &t->of[t->region[i]];
        const double *v = body->dv + 3 * (size_t)i;
        region->n++;
        region->pressed |= loaded(body, i);
        region->kinetic_J += 0.5 * body->mass_kg[i] * pal_dot3(v, v);
    }
}

static double springs(const sets *r, const pal_body *body)
{
    double sum = 0;
    for (int kind = 0; kind < 3; kind++)
        if (r->of[kind]) sum += pal_spring_energy(r->of[kind], body, (pal_spring_kind)kind);
    return sum;
}

enum { NOT = -1, NEW = -2 };

/* connected components by edges of the nodes in regions; the root is the smallest node */
static void join(pal_spring_recovery *t, const pal_spring_set *edges)
{
    pal_union_find_init(t->root, t->n_node);
    for (int i = 0; i < edges->n_item; i++) {
        const int32_t *node = corners(edges, i);
        if (t->region[node[0]] != NOT && t->region[node[1]] != NOT) pal_union_find_join(t->root, node[0], node[1]);
    }
}

/* no new region while a load acts: regions are softer than springs, so that a load would draw them out, and a tool that
 * inverts tetrahedra must feel springs. True: new nodes stay in */
static bool drop_new_if_loaded(pal_spring_recovery *t, const pal_body *body)
{
    bool pressed = false;
    for (int i = 0; i < t->n_node && !pressed; i++) pressed = loaded(body, i);
    for (int i = 0; i < t->n_node && pressed; i++)
        if (t->region[i] == NEW) t->region[i] = NOT;
    return !pressed;
}

/* nodes of inverted tetrahedra enter, and those beside regions that do not recover; true: any */
static bool enter(pal_spring_recovery *t, const sets *r, const pal_body *body)
{
    const pal_spring_set *edges = r->of[PAL_SPRING_DISTANCE], *tets = r->of[PAL_SPRING_VOLUME];
    bool any = false, grows = false;
    for (int i = 0; i < tets->n_item; i++) {
        const double ratio = volume_ratio(tets, i, body->d);
        if (!(ratio < PAL_SPRING_INVERTED_LOW || ratio > PAL_INVERTED_HIGH)) continue;
        for (int c = 0; c < 4; c++) {
            int32_t *to = &t->region[corners(tets, i)[c]];
            any |= *to == NOT;
            if (*to == NOT) *to = NEW;
        }
    }
    for (int p = 0; p < t->n_region; p++) {
        t->of[p].bad = pal_region_grows(&t->of[p], t->of[p].pressed);
        grows |= t->of[p].bad;
    }
    for (int i = 0; i < edges->n_item && grows; i++)
        for (int c = 0; c < 2; c++) {
            const int32_t *node = corners(edges, i);
            if (t->region[node[c]] < 0 || !t->of[t->region[node[c]]].bad || t->region[node[1 - c]] != NOT) continue;
            t->region[node[1 - c]] = NEW;
            any = true;
        }
    return any && drop_new_if_loaded(t, body);
}

/* numbers the connected regions. A region that has not changed keeps its clocks and s */
static void number(pal_spring_recovery *t, const pal_spring_set *edges)
{
    pal_inverted_region old[PAL_SPRING_REGIONS_MAX];
    int home[PAL_SPRING_REGIONS_MAX]; /* the old region of all of its nodes; NOT: they are of several, or new */
    memcpy(old, t->of, sizeof *old * (size_t)t->n_region);
    join(t, edges);
    t->n_region = 0;
    for (int i = 0; i < t->n_node; i++) {
        const int was = t->region[i];
        if (was == NOT) continue;
        const int root = pal_union_find_root(t->root, i);
        if (root != i)
            t->region[i] = t->region[root];
        else {
            if (t->n_region < PAL_SPRING_REGIONS_MAX)
                home[t->n_region] = was,
                t->of[t->n_region++] =
                    (pal_inverted_region){.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .scale = 1, .loose_s = INFINITY};
            t->region[i] = t->n_region - 1;
        }
        pal_inverted_region *region = &t->of[t->region[i]];
        region->n++;
        if (home[t->region[i]] != was) home[t->region[i]] = NOT;
        region->grow_s = fmax(region->grow_s, was >= 0 ? old[was].grow_s : 0);
        region->loose_s = fmin(region->loose_s, was >= 0 ? old[was].loose_s : 0);
    }
    for (int p = 0; p < t->n_region; p++) {
        t->of[p].stays = home[p] >= 0 && old[home[p]].n == t->of[p].n;
        if (t->of[p].stays) t->of[p].scale = old[home[p]].scale;
    }
}

/* the time that edges alone give to an explicit step: the least sqrt(m / K) of free nodes, K their row sums */
static double edge_time_s(pal_spring_recovery *t, const pal_spring_set *edges, const pal_body *body)
{
    double min = INFINITY, *sum = t->node_sum;
    memset(sum, 0, sizeof *sum * (size_t)t->n_node);
    for (int i = 0; i < edges->n_item; i++)
        for (int c = 0; c < 2; c++) sum[corners(edges, i)[c]] += 2 * edge_N_m(edges, i);
    for (int i = 0; i < t->n_node; i++)
        if (!body->support[i] && sum[i] > 0 && body->mass_kg[i] < min * sum[i]) min = body->mass_kg[i] / sum[i];
    return isfinite(min) ? sqrt(min) : 0;
}

/* switches the springs at nodes of regions off, all others on */
static void switch_sets(const pal_spring_recovery *t, sets *r)
{
    for (int kind = 0; kind < 3; kind++) {
        pal_spring_set *set = r->of[kind];
        if (!set) continue;
        set->n_off = 0, set->fresh = false;
        for (int i = 0; i < set->n_item; i++) {
            const int lane = set->simd_blocks.place[i];
            const bool off = region_of(t, set, i) >= 0;
            set->q[lane] = off ? 0 : set->all[lane];
            if (off && kind == PAL_SPRING_DISTANCE)
                set->edge[set->n_off] =
                    (pal_region_edge){{corners(set, i)[0], corners(set, i)[1]}, region_of(t, set, i), i};
            if (off) set->off[set->n_off++] = i;
        }
    }
}

/* chooses G of each region, and s of changed ones such that there is no more energy than before_J */
static void begin(pal_spring_recovery *t, const sets *r, const pal_body *body, double before_J)
{
    int n_free = 0;
    for (int i = 0; i < t->n_node; i++) n_free += !body->support[i];
    pal_regions_fix(t->of, t->n_region, body, n_free > 0 ? n_free : 1);
    t->k_J = r->of[PAL_SPRING_DISTANCE]->spring.k_J;
    t->damp_s = PAL_SPRING_DAMP_SHARE * edge_time_s(t, r->of[PAL_SPRING_DISTANCE], body);
    weigh(t, r, body);
    double new_J = 0, left_J = before_J - springs(r, body), scale = 1;
    for (int p = 0; p < t->n_region; p++)
        *(t->of[p].stays ? &left_J : &new_J) += (t->of[p].stays ? -1 : 1) * t->of[p].region_J;
    if (new_J > left_J) scale = left_J > PAL_FILL_MIN * new_J ? left_J / new_J : PAL_FILL_MIN;
    for (int p = 0; p < t->n_region; p++) {
        if (t->of[p].stays) continue;
        t->of[p].scale = scale;
        t->of[p].region_J *= scale;
    }
}

/* supports may have moved or gone, and constants may have changed since regions began */
static void update_constants(pal_spring_recovery *t, const pal_spring_set *edges, const pal_body *body)
{
    pal_regions_fix(t->of, t->n_region, body, 0);
    if (edges->spring.k_J == t->k_J) return;
    t->first_J *= edges->spring.k_J / t->k_J;
    t->k_J = edges->spring.k_J;
    t->damp_s = PAL_SPRING_DAMP_SHARE * edge_time_s(t, edges, body);
}

/* the regions have changed; before_J: energy of springs and regions before */
static void change(pal_spring_recovery *t, sets *r, const pal_body *body, double before_J)
{
    number(t, r->of[PAL_SPRING_DISTANCE]);
    switch_sets(t, r);
    if (t->n_region > 0) begin(t, r, body, before_J);
}

/* the answer of `recover` */
static unsigned seen(const pal_spring_recovery *t, bool changed)
{
    return (t->n_region > 0 ? PAL_INVERTED : 0) | (changed ? PAL_INVERSION_CHANGED : 0);
}

static unsigned update(pal_spring_recovery *t, pal_step *step)
{
    pal_body *body = step->body;
    sets r = find_sets(step);
    if (!r.of[PAL_SPRING_DISTANCE] || !r.of[PAL_SPRING_VOLUME]) pal_spring_recovery_reset(t);
    for (int kind = 0; kind < 3; kind++) t->stale |= r.of[kind] && r.of[kind]->fresh;
    const bool stale = t->stale;
    if (stale) switch_sets(t, &r);
    t->stale = false;
    /* at rest, and for a state that is not finite, nothing is examined */
    if (!r.of[PAL_SPRING_DISTANCE] || !r.of[PAL_SPRING_VOLUME] || body->d == body->x_rest) return seen(t, stale);
    double ratio[2] = {1, 1};
    if (t->n_region == 0) pal_spring_volume_range(r.of[PAL_SPRING_VOLUME], body->node_order, body->d, ratio);
    if (t->n_region == 0 && !(ratio[0] < PAL_SPRING_INVERTED_LOW || ratio[1] > PAL_INVERTED_HIGH))
        return seen(t, stale);
    if (!pal_body_finite(body)) return seen(t, stale);
    const uint64_t began = pal_clock_ns();
    const bool first = t->n_region == 0;
    bool changed = false;
    double before_J = 0;
    if (!first) {
        update_constants(t, r.of[PAL_SPRING_DISTANCE], body);
        weigh(t, &r, body);
        const double kinetic_J = pal_body_kinetic_J(body);
        before_J = springs(&r, body) + pal_regions_sum_J(t->of, t->n_region);
        changed = pal_regions_leave(t->of, t->n_region, t->first_J - kinetic_J - before_J, PAL_REGION_LEAVE_SHARE,
                                    PAL_REST_SHARE * before_J, PAL_REST_SHARE * pal_regions_sum_J(t->of, t->n_region),
                                    fmax(0, step->time_s - t->seen_s));
        for (int i = 0; i < t->n_node && changed; i++)
            if (t->region[i] >= 0 && t->of[t->region[i]].n == 0) t->region[i] = -1;
    }
    t->seen_s = step->time_s;
    changed |= enter(t, &r, body);
    if (first && changed) before_J = springs(&r, body);
    if (changed) change(t, &r, body, before_J);
    if (first && changed)
        t->first_J = pal_body_kinetic_J(body) + springs(&r, body) + pal_regions_sum_J(t->of, t->n_region);
    body->safeguards.n_split += changed;
    body->safeguards.n_inversion += changed || t->n_region > 0;
    body->safeguards.ns += pal_clock_ns() - began;
    return seen(t, changed || stale);
}

unsigned pal_spring_recover(void *self, pal_step *step)
{
    for (int i = 0; i < step->n_force && step->body->recovery; i++)
        if (step->force[i].effect->recovery.springs)
            return step->force[i].self == self ? update(step->body->recovery, step) : 0;
    return 0;
}
