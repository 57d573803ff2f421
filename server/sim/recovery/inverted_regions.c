/* Energy, forces and end of regions of inverted elements. */
#include "server/sim/recovery/inverted_regions.h"

#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/sim/core/best_rotation.h"
#include "server/sim/core/rigid_motion.h"

#include <math.h>
#include <string.h>

static void edge_vector(const double *x, const pal_region_edge *e, double out[3])
{
    pal_sub3(out, x + 3 * (size_t)e->end[1], x + 3 * (size_t)e->end[0]);
}

void pal_regions_fit(pal_inverted_region *of, int n, const pal_region_edges *edges, const double *d)
{
    for (int p = 0; p < n; p++) memset(of[p].sum, 0, sizeof of[p].sum);
    for (int i = 0; i < edges->n; i++) {
        const pal_region_edge *e = &edges->edge[i];
        double x[3], y[3];
        if (of[e->region].fixed) continue;
        edge_vector(d, e, x), edge_vector(edges->rest, e, y);
        pal_add_outer(of[e->region].sum, edges->stiffness(edges->self, e->owner), x, y);
    }
    for (int p = 0; p < n; p++)
        if (!of[p].fixed) pal_best_rotation(of[p].sum, of[p].rotation);
}

/* w = A^-1 sum k x x v, A = sum k (x.x I - x x') */
static void find_spins(pal_inverted_region *of, int n, const pal_region_edges *edges, const double *d, const double *v)
{
    for (int p = 0; p < n; p++) {
        memset(of[p].sum, 0, sizeof of[p].sum);
        pal_set3(of[p].spin_1_s, 0, 0, 0);
    }
    for (int i = 0; i < edges->n; i++) {
        const pal_region_edge *e = &edges->edge[i];
        pal_inverted_region *region = &of[e->region];
        const double k = edges->stiffness(edges->self, e->owner);
        double x[3], rate[3], moment[3];
        edge_vector(d, e, x), edge_vector(v, e, rate);
        pal_add_outer(region->sum, -k, x, x);
        for (int a = 0; a < 3; a++) region->sum[4 * a] += k * pal_dot3(x, x);
        pal_cross3(moment, x, rate);
        pal_axpy3(region->spin_1_s, k, moment);
    }
    for (int p = 0; p < n; p++) {
        double moment[3];
        pal_copy3(moment, of[p].spin_1_s);
        pal_rigid_spin(of[p].sum, moment, 0, of[p].spin_1_s);
    }
}

double pal_regions_energy(pal_inverted_region *of, int n, const pal_region_edges *edges, const double *d,
                          const double *v, double damp_s, double *f)
{
    double sum = 0;
    if (f && damp_s > 0) find_spins(of, n, edges, d, v);
    for (int i = 0; i < edges->n; i++) {
        const pal_region_edge *e = &edges->edge[i];
        pal_inverted_region *region = &of[e->region];
        const double k = edges->stiffness(edges->self, e->owner), force = region->scale * k;
        double x[3], y[3], u[3];
        edge_vector(d, e, x), edge_vector(edges->rest, e, y);
        pal_mul33(u, region->rotation, y);
        pal_sub3(u, x, u);
        const double energy = region->scale * (0.5 * k * pal_dot3(u, u));
        region->region_J += energy, sum += energy;
        if (!f) continue;
        if (damp_s > 0) {
            double rate[3], rotation[3];
            edge_vector(v, e, rate);
            pal_cross3(rotation, region->spin_1_s, x);
            pal_sub3(rate, rate, rotation);
            pal_axpy3(u, damp_s, rate);
        }
        pal_axpy3(f + 3 * (size_t)e->end[0], force, u);
        pal_axpy3(f + 3 * (size_t)e->end[1], -force, u);
    }
    return sum;
}

void pal_regions_fix(pal_inverted_region *of, int n, const pal_body *body, int n_all)
{
    double rotation[9];
    const bool has_rotation = pal_support_rotation(body, rotation);
    for (int p = 0; p < n; p++) {
        of[p].fixed = has_rotation && (n_all > 0 ? 2 * of[p].n > n_all : of[p].fixed);
        if (of[p].fixed) memcpy(of[p].rotation, rotation, sizeof rotation);
    }
}

double pal_regions_sum_J(const pal_inverted_region *of, int n)
{
    double sum = 0;
    for (int p = 0; p < n; p++) sum += of[p].region_J;
    return sum;
}

bool pal_regions_leave(pal_inverted_region *of, int n, double spare_J, double max_share, double little_J, double rest_J,
                       double passed_s)
{
    bool any = false;
    for (int p = 0; p < n; p++) {
        pal_inverted_region *region = &of[p];
        const double rise = region->element_J - region->region_J;
        region->grow_s += passed_s;
        region->loose_s = region->bad || !(region->kinetic_J < rest_J) ? 0 : region->loose_s + passed_s;
        const bool fits = rise <= spare_J && region->element_J <= max_share * region->size_J;
        if (region->bad || (!fits && (region->loose_s + 1e-9 < PAL_REGION_LEAVE_S || rise > little_J))) continue;
        spare_J -= rise;
        region->n = 0;
        any = true;
    }
    return any;
}

bool pal_region_grows(pal_inverted_region *region, bool blocked)
{
    /* times are sums of steps, with their rounding */
    const bool due = region->grow_s + 1e-9 >= PAL_REGION_GROW_S;
    if (due) region->grow_s = fmax(0, fmin(region->grow_s - PAL_REGION_GROW_S, PAL_REGION_GROW_S));
    return due && region->n > 0 && region->bad && !blocked;
}
