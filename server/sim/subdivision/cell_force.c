/* Elements of subdivision solids in their own frames: forces, energy, and products with the tangent Q K Q'. */
#include "server/sim/subdivision/cell_simd.h"

#include "server/base/team.h"

#include <math.h>
#include <string.h>

enum { FORCE = 1, ENERGY = 2, LINEARISE = 4, SWELL = 8 };

/* b.u, b the element's swell */
PAL_INLINE pal_wide swelling(const double *swell, int n_node, pal_wide (*u)[PAL_CELL_MAX_NODES])
{
    pal_wide sum = {0};
    for (int m = 0; m < n_node; m++)
        for (int i = 0; i < 3; i++) sum += pal_wide_load(swell + (3 * m + i) * PAL_LANES) * u[i][m];
    return sum;
}
/* u += p b */
PAL_INLINE void add_swelling(const double *swell, int n_node, pal_wide p, pal_wide (*u)[PAL_CELL_MAX_NODES])
{
    for (int m = 0; m < n_node; m++)
        for (int i = 0; i < 3; i++) u[i][m] += p * pal_wide_load(swell + (3 * m + i) * PAL_LANES);
}
PAL_INLINE const double *swell_at(const pal_cell_group *group, int n_node, int block, int lane)
{
    return group->swell + (size_t)block * (size_t)n_node * 3 * PAL_LANES + lane;
}
/* sums over the control cells, and their mean strains */
PAL_INLINE void take_swelling(const pal_cells_elastic *c, const int32_t *home, int n_live, pal_wide s)
{
    for (int l = 0; l < n_live; l++) c->volume.sum[home[l]] += s[l];
}
PAL_INLINE pal_wide give_swelling(const pal_cells_elastic *c, const int32_t *home)
{
    pal_wide p;
    for (int l = 0; l < PAL_WIDE; l++) p[l] = c->volume.push[home[l]];
    return p;
}
static void find_push(const pal_cells_elastic *c)
{
    for (int i = 0; i < c->volume.n; i++) c->volume.push[i] = c->volume.share[i] * c->volume.sum[i];
}

/* ---- threads: what a half of a block leaves for the caller ---- */

PAL_INLINE double *shared_force(const pal_cells_elastic *c, int kind, int n_node, int block, int lane)
{
    return c->shares.force[kind] + (size_t)block * (size_t)n_node * 3 * PAL_LANES + lane;
}
/* forces u on the nodes of a half: to out, or to where the caller finds them */
PAL_INLINE void give_forces(const pal_cells_elastic *c, int kind, int n_node, int block, int lane, int n_live,
                            pal_wide (*u)[PAL_CELL_MAX_NODES], double *out)
{
    const int32_t *node = c->group[kind].node + (size_t)block * (size_t)n_node * PAL_LANES + lane;
    if (!c->shares.body) {
        cell_scatter(node, n_node, n_live, u, out);
        return;
    }
    double *to = shared_force(c, kind, n_node, block, lane);
    for (int m = 0; m < n_node; m++)
        for (int i = 0; i < 3; i++) pal_wide_store(to + (3 * m + i) * PAL_LANES, u[i][m]);
}
PAL_INLINE void give_swell(const pal_cells_elastic *c, int kind, int block, int lane, int n_live, pal_wide s)
{
    if (c->shares.body)
        pal_wide_store(c->shares.swell[kind] + block * PAL_LANES + lane, s);
    else
        take_swelling(c, c->group[kind].home + block * PAL_LANES + lane, n_live, s);
}
/* what the halves have left, in their order: changes of volume (out NULL), or forces */
PAL_INLINE void collect_blocks(const pal_cells_elastic *c, int kind, int n_node, double *out)
{
    const pal_cell_group *group = &c->group[kind];
    for (int b = 0; b < group->n_block; b++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            const int n_live = cell_live(group, b, l);
            const int32_t *node = group->node + (size_t)b * (size_t)n_node * PAL_LANES + l;
            if (n_live == 0 || cell_recovering(c, group, b, l, n_live)) continue;
            if (!out) {
                const pal_wide s = pal_wide_load(c->shares.swell[kind] + b * PAL_LANES + l);
                take_swelling(c, group->home + b * PAL_LANES + l, n_live, s);
                continue;
            }
            const double *from = shared_force(c, kind, n_node, b, l);
            for (int m = 0; m < n_node; m++)
                for (int k = 0; k < n_live; k++)
                    for (int i = 0; i < 3; i++)
                        out[3 * (size_t)node[m * PAL_LANES + k] + (size_t)i] += from[(3 * m + i) * PAL_LANES + k];
        }
}
static void collect(const pal_cells_elastic *c, double *out)
{
    collect_blocks(c, PAL_CELL_CUBIC, 64, out);
    collect_blocks(c, PAL_CELL_HEX, 8, out);
    collect_blocks(c, PAL_CELL_PYRAMID, 5, out);
}

/* a pass over all elements by several threads; blocks of each kind in a piece of work: some ten microseconds */
typedef struct shared_pass {
    pal_cells_elastic *c;
    const double *d; /* positions, or the motion p */
    int what;        /* 0: a product with the tangent */
    bool swells;     /* of the product               */
    double k;
} shared_pass;
static const int piece_blocks[PAL_CELL_KINDS] = {[PAL_CELL_CUBIC] = 1, [PAL_CELL_HEX] = 8, [PAL_CELL_PYRAMID] = 8};
static void run_piece(void *user, int worker, int index);

static void share(shared_pass *pass)
{
    int n = 0;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++)
        n += (pass->c->group[kind].n_block + piece_blocks[kind] - 1) / piece_blocks[kind];
    pal_team_run(pass->c->shares.body->team, n, run_piece, pass);
}

/* g (world axes, forces with Q fixed) += the part from the change of Q */
PAL_INLINE void add_rotation(const pal_cell_group *group, int block, int lane, int n_node, const pal_wide r[9],
                             const pal_wide s[9], pal_wide (*y)[PAL_CELL_MAX_NODES], pal_wide (*g)[PAL_CELL_MAX_NODES])
{
    const pal_wide zero = {0};
    pal_wide world[3] = {zero, zero, zero}, t[3], frame[9], w[9];
    for (int m = 0; m < n_node; m++) {
        world[0] += g[1][m] * y[2][m] - g[2][m] * y[1][m];
        world[1] += g[2][m] * y[0][m] - g[0][m] * y[2][m];
        world[2] += g[0][m] * y[1][m] - g[1][m] * y[0][m];
    }
    for (int i = 0; i < 3; i++) t[i] = r[i] * world[0] + r[3 + i] * world[1] + r[6 + i] * world[2];
    pal_wide_load_n(group->frame + (size_t)block * 9 * PAL_LANES + lane, 9, frame);
    cell_rotation_stress(r, s, t, frame, w);
    for (int m = 0; m < n_node; m++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) g[i][m] += w[3 * i + j] * group->middle[m][j];
}

/* u = d^ of the operator from nodes y, which are overwritten for PAL_CELL_EDGES */
PAL_INLINE void displace(const pal_cells_elastic *c, const pal_cell_group *group, int n_node, int block, int lane,
                         const pal_wide r[9], pal_wide (*y)[PAL_CELL_MAX_NODES], pal_wide (*u)[PAL_CELL_MAX_NODES])
{
    const double *rest = group->rest + (size_t)block * (size_t)n_node * 3 * PAL_LANES + lane;
    if (c->op == PAL_CELL_EDGES) {
        pal_cell_edges_displaced(rest, n_node, r, y, u);
        return;
    }
    cell_rotate(r, true, n_node, y, u);
    cell_minus_rest(rest, n_node, u);
}

/* one half of a block */
PAL_INLINE double half_block(pal_cells_elastic *c, pal_cell_group *group, int n_node, int what, int block, int lane,
                             const double *d, double *f)
{
    const int n_live = cell_live(group, block, lane);
    const int32_t *node = group->node + (size_t)block * (size_t)n_node * PAL_LANES + lane;
    pal_wide y[3][PAL_CELL_MAX_NODES], u[3][PAL_CELL_MAX_NODES], r[9], s[9], energy = {0};
    if (n_live == 0 || (!(what & LINEARISE) && cell_recovering(c, group, block, lane, n_live))) return 0;
    cell_gather(node, n_node, d, y);
    cell_rotation(group, block, lane, y, n_node, r, s);
    if (what & LINEARISE) pal_wide_store_n(group->rotation + (size_t)block * 9 * PAL_LANES + lane, 9, r);
    if (!(what & (FORCE | ENERGY | SWELL))) return 0;
    displace(c, group, n_node, block, lane, r, y, u);
    const bool apart = c->volume.n > 0;
    const int32_t *home = group->home + block * PAL_LANES + lane;
    const double *swell = swell_at(group, n_node, block, lane);
    if (what & SWELL) {
        give_swell(c, (int)(group - c->group), block, lane, n_live, swelling(swell, n_node, u));
        return 0;
    }
    pal_wide push = apart ? give_swelling(c, home) : energy;
    if (apart && what & ENERGY) energy = 0.5 * push * swelling(swell, n_node, u);
    cell_stiffness(&c->line, group, block, lane, n_node, u, what & ENERGY ? &energy : NULL);
    if (apart) add_swelling(swell, n_node, push, u);
    if (c->n_off > 0) {
        const pal_wide here = pal_wide_load(group->here + block * PAL_LANES + lane);
        energy *= here;
        for (int m = 0; m < n_node; m++) u[0][m] *= here, u[1][m] *= here, u[2][m] *= here;
    }
    double sum = what & ENERGY ? cell_sum(energy, n_live) : 0;
    if (!(what & FORCE)) return sum;
    pal_wide minus[9];
    for (int i = 0; i < 9; i++) minus[i] = -r[i];
    cell_rotate(minus, false, n_node, u, u);
    if (c->op == PAL_CELL_POLAR) add_rotation(group, block, lane, n_node, r, s, y, u);
    give_forces(c, (int)(group - c->group), n_node, block, lane, n_live, u, f);
    return sum;
}

PAL_INLINE double all_blocks(pal_cells_elastic *c, pal_cell_kind kind, int n_node, int what, const double *d, double *f)
{
    pal_cell_group *group = &c->group[kind];
    double sum = 0;
    for (int b = 0; b < group->n_block; b++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) sum += half_block(c, group, n_node, what, b, l, d, f);
    return sum;
}

/* energy of a kind, of the halves in their order */
static double sum_shares(const pal_cells_elastic *c, int kind)
{
    double sum = 0;
    for (int b = 0; b < c->group[kind].n_block; b++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) sum += c->shares.energy[kind][2 * b + l / PAL_WIDE];
    return sum;
}

static double share_kinds(pal_cells_elastic *c, int what, const double *d, double *f)
{
    share(&(shared_pass){.c = c, .d = d, .what = what});
    if (what & (FORCE | SWELL)) collect(c, what & SWELL ? NULL : f);
    return sum_shares(c, PAL_CELL_CUBIC) + sum_shares(c, PAL_CELL_HEX) + sum_shares(c, PAL_CELL_PYRAMID);
}

PAL_INLINE double all_kinds(pal_cells_elastic *c, int what, const double *d, double *f)
{
    if (c->shares.body) return share_kinds(c, what, d, f);
    double sum = all_blocks(c, PAL_CELL_CUBIC, 64, what, d, f);
    sum += all_blocks(c, PAL_CELL_HEX, 8, what, d, f);
    return sum + all_blocks(c, PAL_CELL_PYRAMID, 5, what, d, f);
}

/* change of volume of each control cell */
static void swell_all(pal_cells_elastic *c, const double *d)
{
    if (c->volume.n == 0) return;
    memset(c->volume.sum, 0, sizeof(double) * (size_t)c->volume.n);
    all_kinds(c, SWELL, d, NULL);
    find_push(c);
}

void pal_cells_elastic_force(pal_cells_elastic *c, const double *d, double *f)
{
    swell_all(c, d);
    all_kinds(c, FORCE, d, f);
}

double pal_cells_elastic_energy(pal_cells_elastic *c, const double *d, double *f)
{
    swell_all(c, d);
    return f && c->op == PAL_CELL_POLAR ? all_kinds(c, FORCE | ENERGY, d, f) : all_kinds(c, ENERGY, d, NULL);
}

void pal_cells_elastic_linearise(pal_cells_elastic *c, const double *d)
{
    all_kinds(c, LINEARISE, d, NULL);
}

/* a motion p at the last linearisation: changes of volume of the control cells, or products with the tangent */
PAL_INLINE void move_half(const pal_cells_elastic *c, pal_cell_kind kind, int n_node, int b, int l, bool swells,
                          double k, const double *p, double *out)
{
    const pal_cell_group *group = &c->group[kind];
    const pal_wide zero = {0};
    const int n_live = cell_live(group, b, l);
    const double *swell = swell_at(group, n_node, b, l);
    pal_wide u[3][PAL_CELL_MAX_NODES], r[9];
    if (n_live == 0 || cell_recovering(c, group, b, l, n_live)) return;
    cell_gather(group->node + (size_t)b * (size_t)n_node * PAL_LANES + l, n_node, p, u);
    pal_wide_load_n(group->rotation + (size_t)b * 9 * PAL_LANES + l, 9, r);
    cell_rotate(r, true, n_node, u, u);
    if (swells) {
        give_swell(c, (int)kind, b, l, n_live, swelling(swell, n_node, u));
        return;
    }
    cell_stiffness(&c->line, group, b, l, n_node, u, NULL);
    if (c->volume.n > 0) add_swelling(swell, n_node, give_swelling(c, group->home + b * PAL_LANES + l), u);
    const pal_wide by = c->n_off > 0 ? k * pal_wide_load(group->here + b * PAL_LANES + l) : k + zero;
    for (int i = 0; i < 9; i++) r[i] *= by;
    cell_rotate(r, false, n_node, u, u);
    give_forces(c, (int)kind, n_node, b, l, n_live, u, out);
}
PAL_INLINE void move_blocks(const pal_cells_elastic *c, pal_cell_kind kind, int n_node, bool swells, double k,
                            const double *p, double *out)
{
    for (int b = 0; b < c->group[kind].n_block; b++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) move_half(c, kind, n_node, b, l, swells, k, p, out);
}
PAL_INLINE void move_kinds(const pal_cells_elastic *c, bool swells, double k, const double *p, double *out)
{
    if (c->shares.body) {
        share(&(shared_pass){.c = (pal_cells_elastic *)c, .d = p, .swells = swells, .k = k});
        collect(c, swells ? NULL : out);
        return;
    }
    move_blocks(c, PAL_CELL_CUBIC, 64, swells, k, p, out);
    move_blocks(c, PAL_CELL_HEX, 8, swells, k, p, out);
    move_blocks(c, PAL_CELL_PYRAMID, 5, swells, k, p, out);
}

PAL_INLINE void piece_of(const shared_pass *pass, pal_cell_kind kind, int n_node, int first, int end)
{
    pal_cells_elastic *c = pass->c;
    for (int b = first; b < end; b++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE) {
            if (pass->what == 0)
                move_half(c, kind, n_node, b, l, pass->swells, pass->k, pass->d, NULL);
            else
                c->shares.energy[kind][2 * b + l / PAL_WIDE] =
                    half_block(c, &c->group[kind], n_node, pass->what, b, l, pass->d, NULL);
        }
}
static void run_piece(void *user, int worker, int index)
{
    const shared_pass *pass = user;
    (void)worker;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        const int n_block = pass->c->group[kind].n_block, per = piece_blocks[kind], n = (n_block + per - 1) / per;
        if (index >= n) {
            index -= n;
            continue;
        }
        const int first = index * per, end = first + per < n_block ? first + per : n_block;
        if (kind == PAL_CELL_CUBIC) piece_of(pass, PAL_CELL_CUBIC, 64, first, end);
        if (kind == PAL_CELL_HEX) piece_of(pass, PAL_CELL_HEX, 8, first, end);
        if (kind == PAL_CELL_PYRAMID) piece_of(pass, PAL_CELL_PYRAMID, 5, first, end);
        return;
    }
}

pal_err pal_cells_elastic_share(pal_cells_elastic *c, const pal_body *body, pal_arena *arena)
{
    pal_cell_shares *shares = &c->shares;
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        const size_t n = (size_t)c->group[kind].n_block, n_node = (size_t)c->group[kind].n_node;
        shares->force[kind] = PAL_NEW(arena, double, n *n_node * 3 * PAL_LANES);
        shares->swell[kind] = PAL_NEW(arena, double, n *PAL_LANES);
        shares->energy[kind] = PAL_NEW(arena, double, 2 * n);
        if (!shares->force[kind] || !shares->swell[kind] || !shares->energy[kind]) return PAL_ERR_MEMORY;
    }
    shares->body = body;
    return PAL_ERR_OK;
}

void pal_cells_elastic_multiply(const pal_cells_elastic *c, double k, const double *p, double *out)
{
    if (c->volume.n > 0) {
        memset(c->volume.sum, 0, sizeof(double) * (size_t)c->volume.n);
        move_kinds(c, true, k, p, NULL);
        find_push(c);
    }
    move_kinds(c, false, k, p, out);
}

void pal_cells_elastic_displaced(pal_cells_elastic *c, const double *d, pal_cell_kind kind, int element, double *out)
{
    pal_cell_group *group = &c->group[kind];
    const int n_node = group->n_node, block = element / PAL_LANES, lane = element % PAL_LANES / PAL_WIDE * PAL_WIDE;
    pal_wide y[3][PAL_CELL_MAX_NODES], u[3][PAL_CELL_MAX_NODES], r[9], s[9];
    cell_gather(group->node + (size_t)block * (size_t)n_node * PAL_LANES + lane, n_node, d, y);
    cell_rotation(group, block, lane, y, n_node, r, s);
    displace(c, group, n_node, block, lane, r, y, u);
    for (int m = 0; m < n_node; m++)
        for (int i = 0; i < 3; i++) out[3 * m + i] = u[i][m][element % PAL_WIDE];
}

void pal_cells_elastic_rotate(const pal_cells_elastic *c, double *rotation)
{
    for (pal_cell_kind kind = 0; kind < PAL_CELL_KINDS; kind++) {
        const pal_cell_group *group = &c->group[kind];
        double n[PAL_CELL_MAX_NODES], middle[3] = {0.5, 0.5, 0.5}, r[9];
        pal_cell_shape(group->n_node, middle, n, NULL);
        for (int e = 0; e < group->n; e++) {
            const int b = e / PAL_LANES, l = e % PAL_LANES;
            const int32_t *node = group->node + (size_t)b * (size_t)group->n_node * PAL_LANES + l;
            for (int i = 0; i < 9; i++) r[i] = group->rotation[((size_t)b * 9 + i) * PAL_LANES + l];
            for (int m = 0; m < group->n_node; m++) {
                const double share = group->here[e] * n[m] * c->k_N_m[c->first[kind] + e];
                for (int i = 0; i < 9; i++) rotation[9 * (size_t)node[m * PAL_LANES] + i] += share * r[i];
            }
        }
    }
}
