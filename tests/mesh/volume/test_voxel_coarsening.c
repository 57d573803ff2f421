/* Voxels merged by eights: the same volume, planes that the fine ones have, fill as the mean. */
#include "server/mesh/volume/voxel_coarsening.h"
#include "tests/check.h"

/* voxels of a box, edge 0.5 */
static bool make(const int n[3], pal_tets *tets, pal_hexes *hexes)
{
    pal_voxels v = {.edge_m = 0.5, .low_m = {-1, 2, 0.25}, .origin_m = {7, 8, 9}};
    int n_cell = n[0] * n[1] * n[2];
    memcpy(v.n, n, sizeof v.n);
    v.kind = calloc((size_t)n_cell, 1);
    if (!v.kind) return false;
    memset(v.kind, 2, (size_t)n_cell);
    v.n_inside = n_cell;
    bool good = !pal_voxels_split(&v, tets) && !pal_hexes_find(tets, hexes, NULL);
    pal_voxels_free(&v);
    return good;
}

static double volume(const pal_tets *tets, const pal_hexes *hexes)
{
    double sum = 0;
    for (int e = 0; e < hexes->n_hex; e++) sum += (double)hexes->fill[e];
    return sum * tets->edge_m * tets->edge_m * tets->edge_m;
}

static void a_box_of_even_sides_is_a_box_of_half_as_many(void)
{
    pal_tets tets = {0};
    pal_hexes hexes = {0};
    pal_prepared out = {0};
    REQUIRE(make((int[3]){6, 4, 2}, &tets, &hexes));
    REQUIRE(!pal_voxels_coarsen(&tets, &hexes, (int[3]){0, 0, 0}, 0.25, &out, NULL));
    CHECK_INT(out.hexes.n_hex, 6);
    CHECK_INT(out.tets.n_tet, 30);
    CHECK_NEAR(out.tets.edge_m, 1, 1e-15);
    for (int c = 0; c < 3; c++) CHECK_NEAR(out.tets.origin_m[c], tets.origin_m[c], 0);
    for (int e = 0; e < 6; e++) CHECK_NEAR((double)out.hexes.fill[e], 1, 1e-7);
    CHECK(!pal_tets_check(&out.tets, NULL));
    pal_prepared_free(&out);
    pal_tets_free(&tets);
    pal_hexes_free(&hexes);
}

static void planes_lie_where_requested(void)
{
    for (int shift = 0; shift < 2; shift++) {
        pal_tets tets = {0};
        pal_hexes hexes = {0};
        pal_prepared out = {0};
        double low = INFINITY;
        REQUIRE(make((int[3]){5, 4, 4}, &tets, &hexes));
        REQUIRE(!pal_voxels_coarsen(&tets, &hexes, (int[3]){shift, 0, 0}, 0, &out, NULL));
        for (int i = 0; i < out.tets.n_node; i++) low = fmin(low, out.tets.x[3 * i]);
        CHECK_NEAR(low, shift ? -1.5 : -1, 1e-12);
        CHECK_INT(out.hexes.n_hex, 12);
        /* the layer that reaches beyond the box is half full */
        for (int e = 0; e < 12; e++) {
            bool beyond = fabs(out.tets.x[3 * out.hexes.node[8 * e]] - (shift ? -1.5 : 1)) < 1e-9;
            CHECK_NEAR((double)out.hexes.fill[e], beyond ? 0.5 : 1, 1e-7);
        }
        CHECK_NEAR(volume(&out.tets, &out.hexes), volume(&tets, &hexes), 1e-6);
        pal_prepared_free(&out);
        pal_tets_free(&tets);
        pal_hexes_free(&hexes);
    }
}

/* Eight voxels of a quarter space, x below 0.55 and y below 0.5 of the large voxel: the large one's weights are those
 * of its own moments, a product of (f -+ sqrt 3 f (f - 1)) / 2 along x and y and 1/2 along z */
static void a_large_voxel_has_the_weights_of_its_own_moments(void)
{
    static const double share[3] = {0.55, 0.5, 1};
    pal_tets tets = {0};
    pal_hexes hexes = {0};
    pal_prepared out = {0};
    REQUIRE(make((int[3]){2, 2, 2}, &tets, &hexes));
    hexes.weight = calloc(64, sizeof *hexes.weight);
    REQUIRE(hexes.weight);
    for (int e = 0; e < 8; e++) {
        const double *x = tets.x + 3 * hexes.node[8 * e], low[3] = {-1, 2, 0.25};
        for (int q = 0; q < 8; q++) {
            double weight = 1;
            for (int c = 0; c < 3; c++) {
                const double f = fmin(fmax(2 * share[c] - (x[c] - low[c] > 0.25), 0), 1);
                weight *= (f + (q >> c & 1 ? sqrt(3) : -sqrt(3)) * f * (f - 1)) / 2;
            }
            hexes.weight[8 * e + q] = (float)weight; /* as integrated, however small */
        }
        hexes.fill[e] = pal_weight_sum(hexes.weight + 8 * e);
    }
    REQUIRE(!pal_voxels_coarsen(&tets, &hexes, (int[3]){0, 0, 0}, 0, &out, NULL));
    CHECK_INT(out.hexes.n_hex, 1);
    for (int q = 0; q < 8; q++) {
        double weight = 1;
        for (int c = 0; c < 3; c++)
            weight *= (share[c] + (q >> c & 1 ? sqrt(3) : -sqrt(3)) * share[c] * (share[c] - 1)) / 2;
        CHECK_NEAR((double)out.hexes.weight[q], weight, 1e-5);
    }
    pal_prepared_free(&out);
    pal_tets_free(&tets);
    pal_hexes_free(&hexes);
}

static void volume_is_kept_or_little_of_it_dropped(void)
{
    pal_tets tets = {0};
    pal_hexes hexes = {0};
    /* a thin last layer */
    REQUIRE(make((int[3]){17, 8, 8}, &tets, &hexes));
    for (int e = 0; e < hexes.n_hex; e++)
        if (tets.x[3 * hexes.node[8 * e]] > 6.9) hexes.fill[e] = 0.2f;
    double whole = volume(&tets, &hexes);
    int n[2];
    for (int drop = 0; drop < 2; drop++) {
        pal_prepared out = {0};
        REQUIRE(!pal_voxels_coarsen(&tets, &hexes, (int[3]){0, 0, 0}, drop ? 0.25 : 0, &out, NULL));
        double left = volume(&out.tets, &out.hexes) / whole;
        CHECK(drop ? left < 1 - 1e-4 && left >= 1 - 0.025 : fabs(left - 1) < 1e-6);
        n[drop] = out.hexes.n_hex;
        pal_prepared_free(&out);
    }
    CHECK_INT(n[0], 144);
    CHECK_INT(n[1], 128);
    /* more than 2.5 % of the volume: nothing is dropped */
    for (int e = 0; e < hexes.n_hex; e++) hexes.fill[e] = 0.2f;
    pal_prepared out = {0};
    REQUIRE(!pal_voxels_coarsen(&tets, &hexes, (int[3]){0, 0, 0}, 0.25, &out, NULL));
    CHECK_INT(out.hexes.n_hex, n[0]);
    pal_prepared_free(&out);
    pal_tets_free(&tets);
    pal_hexes_free(&hexes);
}

static void without_voxels_it_is_refused(void)
{
    pal_tets tets = {0};
    pal_hexes hexes = {0};
    pal_prepared out = {0};
    pal_diagnostic diag = {""};
    CHECK_INT(pal_voxels_coarsen(&tets, &hexes, (int[3]){0, 0, 0}, 0, &out, &diag), PAL_ERR_REFUSED);
    CHECK(strstr(diag.text, "voxels"));
}

int main(void)
{
    RUN(a_box_of_even_sides_is_a_box_of_half_as_many);
    RUN(planes_lie_where_requested);
    RUN(a_large_voxel_has_the_weights_of_its_own_moments);
    RUN(volume_is_kept_or_little_of_it_dropped);
    RUN(without_voxels_it_is_refused);
    return check_report();
}
