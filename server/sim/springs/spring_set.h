/* A set of springs of one kind: constraints between 2, 3 or 4 nodes, each with an inverse rest measure w and a weight
 * q, energy E = q k/2 C^2 (spring_law.h). spring_constraint.h has the constraint for one spring; an effect gives it as
 * a kernel for PAL_WIDE springs, which the loops below inline. Thread: [load] to make, then [sim]. */
#ifndef PAL_SIM_SPRINGS_SPRING_SET_H
#define PAL_SIM_SPRINGS_SPRING_SET_H
#include "server/sim/core/simd_wide.h"
#include "server/sim/springs/spring_law.h"

/* PAL_WIDE springs with constants k q: p [n_corner][3] points to the coordinates of the corners, a lane each; f
 * [n_corner - 1][3] receives the forces on corners 1, 2, 3 (corner 0 gets minus their sum); the kernel may lower `min`
 * to the minimum of a quantity of its own */
typedef void (*pal_spring_kernel)(const double *p[][3], pal_wide w, pal_wide kq, pal_wide f[][3], pal_wide *min);

/* Gershgorin row sums of PAL_WIDE springs at each corner: k q |g_a| sum |g_b|, and with `bend` those of the second
 * derivative of C where it stiffens */
typedef void (*pal_bound_kernel)(const double *p[][3], pal_wide w, pal_wide kq, bool bend, pal_wide bound[]);

typedef struct pal_spring_set {
    pal_spring spring;
    int n_item, n_corner;
    int32_t *item; /* nodes                                          [n_item][n_corner] */
    pal_simd_blocks simd_blocks;
    pal_part_blocks part_blocks; /* for several threads */
    double *w, *q;               /* by lane; 0: no spring                          [n_lane]           */
    float *single_w, *single_q;  /* the same for positions in units of an edge, w of edges squared [n_lane] */
    /* with regions of other materials, q = part[0] + part[1]/E + part[2]/factor + part[3]/(E factor) of the body's E
     * and factor; whole is q without regions; NULL: no regions [n_lane] */
    double *part[4], *whole;
    /* recovery from inversion (spring_lattice.h), which lowers q where elements do not act: the springs of each
     * tetrahedron, -1: none; q of all of them, and how many there are around a spring. NULL: no recovery
     * [n_tet][pal_spring_sides], [n_lane], [n_lane] */
    struct pal_spring_lattice *lattice;
    struct pal_recovery *recovery;
    int32_t *of_tet;
    double *all, *around;
    bool changed; /* q is not what bounds of stiffness were found for */
} pal_spring_set;

/* REFUSED: the body is not made of tetrahedra */
pal_err pal_spring_set_check(const pal_config_entry *entry, const pal_build *build);
/* Reads the keys (pal_spring_read) and keeps the springs of item [n_item][corners of the kind] with a measure above
 * `min`, w = 1 / measure; item is reordered */
pal_err pal_spring_set_make(pal_spring_kind kind, pal_config_entry *entry, pal_build *build, int32_t *item, int n_item,
                            double min, pal_spring_set *out);
/* smallest and largest of 1 and the ratios of volume to volume at rest, whichever springs act; d [n_node][3] */
void pal_spring_volume_range(const pal_spring_set *set, pal_node_order *node_order, const double *d, double out[2]);
/* Young's modulus, Pa, for which a set of edges stands: that of a material whose derived constants have the same sum of
 * stiffness over all edges, sum k q/l0^2 = 6 f_d E V/h^2 */
double pal_spring_young_Pa(const pal_spring_set *set, const pal_body *body, double poisson);
/* a live edit: k_J, and with regions q too */
pal_err pal_spring_set_material(void *self, const pal_body *body, const pal_material *material, pal_diagnostic *diag);

/* q has changed */
void pal_spring_set_changed(pal_spring_set *set);

PAL_INLINE void pal_spring_corners(const pal_spring_set *set, const double *x, int i, const double *to[PAL_CORNERS])
{
    pal_spring_points(x, set->item + set->n_corner * i, set->n_corner, to);
}

PAL_INLINE double pal_spring_energy(const pal_spring_set *set, const pal_body *body, pal_spring_kind kind)
{
    double sum = 0;
    for (int i = 0; i < set->n_item; i++) {
        const double *x[PAL_CORNERS];
        pal_constraint s;
        int lane = set->simd_blocks.place[i];
        pal_spring_corners(set, body->d, i, x);
        pal_spring_constraint(kind, x, set->w[lane], &s);
        sum += 0.5 * set->q[lane] * set->spring.k_J * s.c * s.c;
    }
    return sum;
}

/* energy_J [n_node] += the energy of each spring, in equal parts at its corners */
PAL_INLINE void pal_spring_measure_energy(const pal_spring_set *set, const pal_body *body, pal_spring_kind kind,
                                          double *energy_J)
{
    for (int i = 0; i < set->n_item; i++) {
        const double *x[PAL_CORNERS];
        pal_constraint s;
        int lane = set->simd_blocks.place[i];
        pal_spring_corners(set, body->d, i, x);
        pal_spring_constraint(kind, x, set->w[lane], &s);
        for (int c = 0; c < set->n_corner; c++)
            energy_J[set->item[set->n_corner * i + c]] +=
                0.5 * set->q[lane] * set->spring.k_J * s.c * s.c / set->n_corner;
    }
}

/* f -= c q (sum of g.v) g */
PAL_INLINE void pal_spring_damp(const pal_spring_set *set, const pal_body *body, pal_spring_kind kind)
{
    const int n_corner = pal_spring_corner_count(kind);
    for (int i = 0; i < set->n_item; i++) {
        const double *x[PAL_CORNERS];
        pal_constraint s;
        int lane = set->simd_blocks.place[i];
        const int32_t *node = set->item + n_corner * i;
        pal_spring_corners(set, body->d, i, x);
        pal_spring_constraint(kind, x, set->w[lane], &s);
        double rate = 0;
        for (int c = 0; c < n_corner; c++) rate += pal_dot3(s.g[c], body->dv + 3 * node[c]);
        for (int c = 0; c < n_corner; c++)
            pal_axpy3(body->f + 3 * node[c], -set->spring.c_Js * set->q[lane] * rate, s.g[c]);
    }
}

/* the forces f on corners 1, 2, 3 of PAL_WIDE springs to the slots `node` [n_corner][8], minus their sum on corner 0 */
PAL_INLINE void pal_spring_add_loose(const pal_node_order *order, const int32_t *node, int n_corner, pal_wide f[][3])
{
    for (int c = 1; c < n_corner; c++)
        for (int l = 0; l < PAL_WIDE; l++)
            for (int d = 0; d < 3; d++) {
                order->f[d * order->n_slot + node[c * PAL_LANES + l]] += f[c - 1][d][l];
                order->f[d * order->n_slot + node[l]] -= f[c - 1][d][l];
            }
}

/* forces of the PAL_WIDE springs of a strip from `lane` on */
PAL_INLINE void pal_spring_run_strip(const pal_spring_set *set, const pal_node_order *order, pal_spring_kernel kernel,
                                     int n_corner, int lane, pal_wide *min)
{
    const double *const x = order->x, *const y = x + order->n_slot, *const z = y + order->n_slot;
    double *const fx = order->f, *const fy = fx + order->n_slot, *const fz = fy + order->n_slot;
    const pal_wide w = pal_wide_load(set->w + lane);
    const double *p[PAL_CORNERS][3];
    pal_wide f[PAL_CORNERS - 1][3];
    int32_t base[PAL_CORNERS];
    if (lane % PAL_LANES != 0 && !pal_wide_any(w != 0)) return; /* the end of a block may be empty */
    for (int c = 0; c < n_corner; c++) {
        base[c] = set->simd_blocks.base[n_corner * (lane / PAL_LANES) + c] + lane % PAL_LANES;
        p[c][0] = x + base[c], p[c][1] = y + base[c], p[c][2] = z + base[c];
    }
    kernel(p, w, set->spring.k_J * pal_wide_load(set->q + lane), f, min);
    pal_wide sum[3] = {f[0][0], f[0][1], f[0][2]};
    for (int c = 2; c < n_corner; c++)
        for (int d = 0; d < 3; d++) sum[d] += f[c - 1][d];
    pal_wide_add(fx + base[0], -sum[0]), pal_wide_add(fy + base[0], -sum[1]), pal_wide_add(fz + base[0], -sum[2]);
    for (int c = 1; c < n_corner; c++) {
        pal_wide_add(fx + base[c], f[c - 1][0]);
        pal_wide_add(fy + base[c], f[c - 1][1]);
        pal_wide_add(fz + base[c], f[c - 1][2]);
    }
}

/* the same of a loose block */
PAL_INLINE void pal_spring_run_loose(const pal_spring_set *set, const pal_node_order *order, pal_spring_kernel kernel,
                                     int n_corner, int lane, pal_wide *min)
{
    const int32_t *node = pal_block_nodes(&set->simd_blocks, lane / PAL_LANES) + lane % PAL_LANES;
    double at[PAL_CORNERS][3][PAL_WIDE];
    const double *p[PAL_CORNERS][3];
    pal_wide f[PAL_CORNERS - 1][3];
    for (int c = 0; c < n_corner; c++)
        for (int d = 0; d < 3; d++) {
            for (int l = 0; l < PAL_WIDE; l++) at[c][d][l] = order->x[d * order->n_slot + node[c * PAL_LANES + l]];
            p[c][d] = at[c][d];
        }
    kernel(p, pal_wide_load(set->w + lane), set->spring.k_J * pal_wide_load(set->q + lane), f, min);
    pal_spring_add_loose(order, node, n_corner, f);
}

/* Forces of all springs, strips first, or of n blocks in ascending order (block NULL: all). Returns the minimum that
 * the kernel reports, at most 1 */
PAL_INLINE double pal_spring_run(const pal_spring_set *set, const pal_node_order *node_order, const int32_t *block,
                                 int n, pal_spring_kernel kernel, int n_corner)
{
    const pal_spring_set springs = *set; /* copies, which the stores below cannot change */
    const pal_node_order order = *node_order;
    const int n_strip = springs.simd_blocks.n_strip;
    pal_wide min = pal_wide_of(1);
    int i = 0;
    for (; i < n && (block ? block[i] : i) < n_strip; i++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE)
            pal_spring_run_strip(&springs, &order, kernel, n_corner, PAL_LANES * (block ? block[i] : i) + l, &min);
    for (; i < n; i++)
        for (int l = 0; l < PAL_LANES; l += PAL_WIDE)
            pal_spring_run_loose(&springs, &order, kernel, n_corner, PAL_LANES * (block ? block[i] : i) + l, &min);
    for (int l = 1; l < PAL_WIDE; l++) min[0] = min[l] < min[0] ? min[l] : min[0];
    return min[0];
}

/* pointers p [n_corner][3] of a block moved to the lanes from `lane` on */
PAL_INLINE void pal_spring_shift(const double *p[][3], int n_corner, int lane)
{
    for (int c = 0; c < n_corner; c++)
        for (int d = 0; d < 3; d++) p[c][d] += lane;
}

/* bound [n_node] += the row sums at positions x [n_node][3] */
PAL_INLINE void pal_spring_bound(const pal_spring_set *set, pal_node_order *node_order, const double *at,
                                 pal_bound_kernel kernel, int n_corner, double k, bool bend, double *bound)
{
    const pal_simd_blocks *blocks = &set->simd_blocks;
    pal_wide sums[PAL_CORNERS];
    pal_node_order_load(node_order, at);
    for (int lane = 0; lane < blocks->n_lane; lane += PAL_WIDE) {
        const int b = lane / PAL_LANES, first = lane % PAL_LANES;
        double loose[PAL_CORNERS][3][PAL_LANES];
        const double *p[PAL_CORNERS][3];
        const bool is_loose = pal_block_points(blocks, node_order, b, n_corner, loose, p);
        const int32_t *node = pal_block_nodes(blocks, b) + first;
        pal_spring_shift(p, n_corner, first);
        kernel(p, pal_wide_load(set->w + lane), k * pal_wide_load(set->q + lane), bend, sums);
        for (int c = 0; c < n_corner; c++) {
            if (!is_loose) pal_wide_add(node_order->f + blocks->base[n_corner * b + c] + first, sums[c]);
            for (int l = 0; l < PAL_WIDE && is_loose; l++) node_order->f[node[c * PAL_LANES + l]] += sums[c][l];
        }
    }
    for (int i = 0; i < node_order->n_node; i++) bound[i] += node_order->f[node_order->slot[i]];
    memset(node_order->f, 0, sizeof(double) * (size_t)node_order->n_slot);
}
#endif
