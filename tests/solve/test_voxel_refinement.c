/* Voxels split into smaller ones: the body, its fill and its volume stay, the lattice is finer. */
#include "server/mesh/geometry/procedural.h"
#include "server/solve/voxel_refinement.h"
#include "tests/check.h"

static double filled(const pal_prepared *p)
{
    double sum = 0, cube = p->tets.edge_m * p->tets.edge_m * p->tets.edge_m;
    for (int e = 0; e < p->hexes.n_hex; e++) sum += cube * (double)p->hexes.fill[e];
    return sum;
}

static bool make_organ(pal_prepared *out)
{
    pal_surface organ;
    pal_diagnostic diag = {""};
    if (pal_organ_make(2000, &organ)) return false;
    const pal_voxel_options voxel = {.resolution = 9, .border = true, .min_fill = 0.25};
    pal_err err = pal_prepared_make(&organ, &voxel, out, NULL, &diag);
    pal_surface_free(&organ);
    return !err;
}

static void the_body_stays_and_its_voxels_shrink(void)
{
    for (int split = 1; split <= 3; split++) {
        pal_prepared p;
        pal_diagnostic diag = {""};
        REQUIRE(make_organ(&p));
        int n_hex = p.hexes.n_hex, cubes = split * split * split;
        double h = p.tets.edge_m, volume = filled(&p), low[2] = {INFINITY, INFINITY}, min = 1, share = 1;
        float *weight = malloc(8 * sizeof *weight * (size_t)n_hex);
        double *corner = malloc(3 * sizeof *corner * (size_t)n_hex);
        REQUIRE(weight && corner && p.hexes.weight);
        memcpy(weight, p.hexes.weight, 8 * sizeof *weight * (size_t)n_hex);
        for (int e = 0; e < n_hex; e++) memcpy(corner + 3 * e, p.tets.x + 3 * p.hexes.node[8 * e], 24);
        for (int i = 0; i < p.tets.n_node; i++) low[0] = fmin(low[0], p.tets.x[3 * i]);
        CHECK_INT(pal_refine_voxels(&p, split, &diag), 0);
        /* none where nothing is inside, which only the weights of cut voxels know */
        CHECK(p.hexes.n_hex <= n_hex * cubes && p.hexes.n_hex > 0.8 * n_hex * cubes);
        CHECK_INT(p.tets.n_tet, 5 * p.hexes.n_hex);
        CHECK_NEAR(p.tets.edge_m, h / split, 1e-15);
        CHECK_NEAR(filled(&p) / volume, 1, 1e-6);
        CHECK(p.hexes.measured);
        CHECK_INT(p.skin.n_vertex, 0);
        for (int i = 0; i < p.tets.n_node; i++) low[1] = fmin(low[1], p.tets.x[3 * i]);
        CHECK_NEAR(low[0], low[1], 1e-12);
        /* each octant has the weight of the coarse octant that its middle lies in */
        for (int e = 0; e < p.hexes.n_hex; e++) {
            int at = -1, worse = 0;
            const double *x = p.tets.x + 3 * p.hexes.node[8 * e];
            for (int k = 0; k < n_hex && at < 0; k++) {
                bool in = true;
                for (int c = 0; c < 3; c++) {
                    double off = (x[c] - corner[3 * k + c]) / h;
                    in = in && off > -1e-9 && off < 1 - 1e-9;
                }
                if (in) at = k;
            }
            for (int q = 0; q < 8 && at >= 0; q++) {
                int in = 0;
                for (int c = 0; c < 3; c++)
                    in |= (x[c] - corner[3 * at + c] + (q >> c & 1 ? 0.75 : 0.25) * h / split > h / 2) << c;
                worse += p.hexes.weight[8 * e + q] != weight[8 * at + in];
            }
            if (at < 0 || worse || p.hexes.fill[e] != pal_weight_sum(p.hexes.weight + 8 * e)) share = 0;
            min = fmin(min, (double)p.hexes.fill[e]);
        }
        CHECK_NEAR(share, 1, 0);
        CHECK(min < 0.5); /* there are cut voxels */
        free(weight);
        free(corner);
        pal_prepared_free(&p);
    }
}

static void too_many_and_none_are_refused(void)
{
    pal_prepared p, none = {0};
    pal_diagnostic diag = {""};
    REQUIRE(make_organ(&p));
    int n_hex = p.hexes.n_hex;
    CHECK_INT(pal_refine_voxels(&p, 200, &diag), PAL_ERR_BUDGET);
    CHECK_INT(p.hexes.n_hex, n_hex);
    CHECK(p.skin.n_vertex > 0);
    CHECK_INT(pal_refine_voxels(&none, 2, &diag), PAL_ERR_REFUSED);
    pal_prepared_free(&p);
}

int main(void)
{
    RUN(the_body_stays_and_its_voxels_shrink);
    RUN(too_many_and_none_are_refused);
    return check_report();
}
