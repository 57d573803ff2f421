/* Lattice points are the corners and centres of cubic cells. Two centres on either side of a face form a tetrahedron
 * with each of the face's four edges; all tetrahedra are congruent, so the triangles have no preferred direction. A
 * crossing stays 1e-4 of its edge away from both ends, which keeps vertices apart and does not change the topology. */
#include "server/mesh/geometry/contour.h"

#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/geometry/tuning.h"

static const double end_gap = 1e-4;

typedef struct lattice {
    double low[3], h;
    int64_t n[3];      /* cells                                                        */
    int64_t n_corner;  /* points from here on are centres                              */
    float *value;      /* corners [n2+1][n1+1][n0+1], then centres [n2][n1][n0]         */
    uint64_t *key;     /* hash of crossed edges: the two points, 0: free                */
    int32_t *crossing; /* vertex of each crossed edge                                  */
    size_t n_slot;
    double *x;
    int32_t *tri;
    size_t n_vertex, n_tri;
} lattice;

/* number of the low corner, or of the centre, of a cell */
static int64_t point_id(const lattice *l, const int64_t c[3], bool centre)
{
    return (centre ? l->n_corner : 0) + (c[2] * (l->n[1] + !centre) + c[1]) * (l->n[0] + !centre) + c[0];
}

static void position(const lattice *l, int64_t id, double p[3])
{
    bool centre = id >= l->n_corner;
    int64_t k = centre ? id - l->n_corner : id;
    for (int a = 0; a < 3; a++) {
        int64_t n = centre ? l->n[a] : l->n[a] + 1;
        p[a] = l->low[a] + l->h * ((double)(k % n) + (centre ? 0.5 : 0));
        k /= n;
    }
}

/* samples corners (shift 0) or centres (shift 1/2); border points are outside whatever the field */
static void sample(lattice *l, pal_contour_field *field, const void *self, bool centre)
{
    int64_t n[3], c[3];
    for (int a = 0; a < 3; a++) n[a] = l->n[a] + !centre;
    float *v = l->value + (centre ? l->n_corner : 0);
    double shift = centre ? 0.5 : 0, p[3];
    for (c[2] = 0; c[2] < n[2]; c[2]++)
        for (c[1] = 0; c[1] < n[1]; c[1]++)
            for (c[0] = 0; c[0] < n[0]; c[0]++) {
                bool border = false;
                for (int a = 0; a < 3; a++) {
                    p[a] = l->low[a] + l->h * ((double)c[a] + shift);
                    border |= c[a] == 0 || c[a] == n[a] - 1;
                }
                double f = field(self, p);
                *v++ = border && !(f < -1e-6) ? -1e-6f : (float)f;
            }
}

static size_t slot_of(const lattice *l, uint64_t key)
{
    size_t slot = (size_t)((key * 0x9E3779B97F4A7C15u) >> 20) & (l->n_slot - 1);
    while (l->key[slot] && l->key[slot] != key) slot = (slot + 1) & (l->n_slot - 1);
    return slot;
}

static bool rehash(lattice *l)
{
    lattice old = *l;
    l->n_slot = old.n_slot ? 2 * old.n_slot : 1 << 14;
    pal_err err = PAL_ERR_OK;
    PAL_ZEROED(&err, l->key, l->n_slot);
    PAL_ARRAY(&err, l->crossing, l->n_slot);
    if (err) {
        PAL_FREE(l->key, l->crossing);
        *l = old;
        return false;
    }
    for (size_t s = 0; s < old.n_slot; s++) {
        if (!old.key[s]) continue;
        size_t slot = slot_of(l, old.key[s]);
        l->key[slot] = old.key[s];
        l->crossing[slot] = old.crossing[s];
    }
    PAL_FREE(old.key, old.crossing);
    return true;
}

/* vertex on the crossed edge a-b, -1: no memory */
static int32_t edge_vertex(lattice *l, int64_t a, int64_t b)
{
    if (2 * l->n_vertex >= l->n_slot && !rehash(l)) return -1;
    int64_t low = a < b ? a : b, high = a < b ? b : a;
    uint64_t key = (uint64_t)low << 32 | (uint64_t)(high + 1);
    size_t slot = slot_of(l, key);
    if (l->key[slot]) return l->crossing[slot];
    if (!pal_heap_grow(&l->x, l->n_vertex, 3 * sizeof *l->x)) return -1;
    double p[3], q[3], fp = (double)l->value[low], fq = (double)l->value[high], t = fp / (fp - fq);
    t = t > end_gap ? t : end_gap;
    t = t < 1 - end_gap ? t : 1 - end_gap;
    position(l, low, p);
    position(l, high, q);
    for (int k = 0; k < 3; k++) l->x[3 * l->n_vertex + (size_t)k] = p[k] + t * (q[k] - p[k]);
    l->key[slot] = key;
    l->crossing[slot] = (int32_t)l->n_vertex;
    return (int32_t)l->n_vertex++;
}

static bool add_triangle(lattice *l, int32_t a, int32_t b, int32_t c)
{
    if (a < 0 || b < 0 || c < 0 || !pal_heap_grow(&l->tri, l->n_tri, 3 * sizeof *l->tri)) return false;
    int32_t *t = l->tri + 3 * l->n_tri++;
    t[0] = a, t[1] = b, t[2] = c;
    return true;
}

/* the surface in one tetrahedron of positive volume */
static bool march(lattice *l, const int64_t id[4], int mask)
{
    /* even orders of the corners: a lone corner first, or the two inner corners first */
    static const uint8_t lone[4][4] = {{0, 1, 2, 3}, {1, 0, 3, 2}, {2, 0, 1, 3}, {3, 0, 2, 1}};
    static const uint8_t pair[16][4] = {[3] = {0, 1, 2, 3}, [5] = {0, 2, 3, 1},  [9] = {0, 3, 1, 2},
                                        [6] = {1, 2, 0, 3}, [10] = {1, 3, 2, 0}, [12] = {2, 3, 0, 1}};
    int n_inside = __builtin_popcount((unsigned)mask);
    if (n_inside == 2) {
        const uint8_t *o = pair[mask];
        int32_t ac = edge_vertex(l, id[o[0]], id[o[2]]), ad = edge_vertex(l, id[o[0]], id[o[3]]),
                bd = edge_vertex(l, id[o[1]], id[o[3]]), bc = edge_vertex(l, id[o[1]], id[o[2]]);
        if (ac < 0 || ad < 0 || bd < 0 || bc < 0) return false;
        double one[3], other[3];
        pal_sub3(one, l->x + 3 * (size_t)ac, l->x + 3 * (size_t)bd);
        pal_sub3(other, l->x + 3 * (size_t)ad, l->x + 3 * (size_t)bc);
        if (pal_dot3(one, one) <= pal_dot3(other, other))
            return add_triangle(l, ac, ad, bd) && add_triangle(l, ac, bd, bc);
        return add_triangle(l, ad, bd, bc) && add_triangle(l, ad, bc, ac);
    }
    int single = n_inside == 1 ? mask : 15 - mask;
    const uint8_t *o = lone[__builtin_ctz((unsigned)single)];
    int32_t b = edge_vertex(l, id[o[0]], id[o[1]]), c = edge_vertex(l, id[o[0]], id[o[2]]),
            d = edge_vertex(l, id[o[0]], id[o[3]]);
    return n_inside == 1 ? add_triangle(l, b, c, d) : add_triangle(l, b, d, c);
}

/* the four tetrahedra of the face at the low end of cell c along axis d */
static bool march_face(lattice *l, const int64_t c[3], int d)
{
    /* the face's corners in order, then the centres on both sides */
    int64_t step[3] = {1, l->n[0] + 1, (l->n[0] + 1) * (l->n[1] + 1)}, before[3] = {c[0], c[1], c[2]};
    int64_t u = step[(d + 1) % 3], v = step[(d + 2) % 3], first = point_id(l, c, false);
    before[d]--;
    const int64_t id[6] = {first, first + u, first + u + v, first + v, point_id(l, before, true), point_id(l, c, true)};
    int inside[6], sum = 0;
    for (int k = 0; k < 6; k++) sum += inside[k] = l->value[id[k]] > 0;
    if (sum == 0 || sum == 6) return true;
    for (int k = 0; k < 4; k++) {
        int m = (k + 1) % 4, mask = inside[4] | inside[5] << 1 | inside[k] << 2 | inside[m] << 3;
        const int64_t tet[4] = {id[4], id[5], id[k], id[m]};
        if (mask != 0 && mask != 15 && !march(l, tet, mask)) return false;
    }
    return true;
}

static bool march_all(lattice *l)
{
    int64_t c[3];
    for (c[2] = 0; c[2] < l->n[2]; c[2]++)
        for (c[1] = 0; c[1] < l->n[1]; c[1]++)
            for (c[0] = 0; c[0] < l->n[0]; c[0]++)
                for (int d = 0; d < 3; d++)
                    if (c[d] > 0 && !march_face(l, c, d)) return false;
    return true;
}

pal_err pal_contour(pal_contour_field *field, const void *self, const pal_contour_box *box, pal_surface *out,
                    pal_diagnostic *diag)
{
    lattice l = {.h = box->spacing_m};
    double n_point = 2;
    for (int a = 0; a < 3; a++) {
        double n = ceil((box->high_m[a] - box->low_m[a]) / l.h) + 1;
        n_point *= n + 1;
        l.low[a] = box->low_m[a];
        if (!(n >= 2) || !(n_point <= CONTOUR_MAX_POINT))
            return pal_diagnostic_set(diag, PAL_ERR_BUDGET, "contour of %.3g lattice points, at most %.3g", n_point,
                                      CONTOUR_MAX_POINT);
        l.n[a] = (int64_t)n;
    }
    l.n_corner = (l.n[0] + 1) * (l.n[1] + 1) * (l.n[2] + 1);
    l.value = malloc((size_t)(l.n_corner + l.n[0] * l.n[1] * l.n[2]) * sizeof *l.value);
    bool good = l.value != NULL;
    if (good) {
        sample(&l, field, self, false);
        sample(&l, field, self, true);
        good = march_all(&l);
    }
    PAL_FREE(l.value, l.key, l.crossing);
    if (good && l.n_tri > 0) {
        *out = (pal_surface){.n_vertex = (int)l.n_vertex, .n_tri = (int)l.n_tri, .x = l.x, .tri = l.tri};
        pal_surface_recentre(out);
        return PAL_ERR_OK;
    }
    PAL_FREE(l.x, l.tri);
    return good ? PAL_REFUSE(diag, "contour of a field that is positive nowhere")
                : pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a contour of %.3g points", n_point);
}
