/* The coarse correction by rigid parts: a projection that is exact for rigid motions of all of a body, symmetric and
 * positive. The body is a bar of points, each coupled to its neighbours and to the ground. */
#include "server/base/vec3.h"
#include "server/num/random.h"
#include "server/num/rigid_clusters.h"
#include "tests/check.h"

enum { NX = 9, NY = 3, NZ = 2, N = NX * NY * NZ };

static double x[3 * N];
static uint8_t fixed[N];
static pal_arena *arena;
static pal_block_matrix a;

/* springs k (u_j - u_i) . e e between the corners of each box, on a weak ground */
static void make(double ground)
{
    static int32_t node[8 * N];
    int n_item = 0;
    for (int i = 0; i < N; i++) {
        const int at[3] = {i % NX, i / NX % NY, i / NX / NY};
        for (int c = 0; c < 3; c++) x[3 * i + c] = at[c];
        if (at[0] == NX - 1 || at[1] == NY - 1 || at[2] == NZ - 1) continue;
        for (int k = 0; k < 8; k++)
            node[8 * n_item + k] = (int32_t)(i + (k & 1) + (k >> 1 & 1) * NX + (k >> 2 & 1) * NX * NY);
        n_item++;
    }
    const pal_cliques cliques = {.n_item = n_item, .n_corner = 8, .node = node};
    REQUIRE(!pal_block_matrix_make(N, &cliques, 1, arena, &a));
    for (int j = 0; j < N; j++)
        for (int32_t k = a.start[j]; k < a.start[j + 1]; k++) {
            double e[3];
            const int i = a.row[k];
            if (i == j) continue;
            pal_sub3(e, x + 3 * i, x + 3 * j);
            pal_scale3(e, 1 / pal_norm3(e), e);
            for (int r = 0; r < 3; r++)
                for (int c = 0; c < 3; c++) {
                    a.value[9 * k + 3 * r + c] -= e[r] * e[c];
                    a.value[9 * a.start[i] + 3 * r + c] += e[r] * e[c];
                    a.value[9 * a.start[j] + 3 * r + c] += e[r] * e[c];
                }
        }
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 3; c++) a.value[9 * a.start[i] + 4 * c] += ground;
}

static double dot(const double *u, const double *v)
{
    double sum = 0;
    for (int i = 0; i < 3 * N; i++) sum += u[i] * v[i];
    return sum;
}

/* u = P z for all: the correction of A u is u, for each part moved on its own and for the body as one */
static void what_is_rigid_comes_back(void)
{
    pal_rigid_clusters p;
    make(1e-3);
    REQUIRE(!pal_rigid_clusters_make(&a, x, fixed, 3, arena, &p));
    CHECK_INT(p.n_cluster, 3);
    for (int k = 0; k < 12; k++) {
        double u[3 * N] = {0}, r[3 * N] = {0}, back[3 * N] = {0};
        for (int i = 0; i < N; i++) {
            double spin[3] = {0};
            spin[k % 3] = 1;
            if (k >= 6 && p.cluster[i] != 1) continue;
            if (k % 6 < 3)
                u[3 * i + k % 3] = 1;
            else
                pal_cross3(u + 3 * i, spin, x + 3 * i);
        }
        pal_block_matrix_multiply(&a, 1, u, r);
        pal_rigid_clusters_add(&p, r, back);
        for (int i = 0; i < 3 * N; i++) CHECK_NEAR(back[i], u[i], 1e-4);
    }
    pal_rigid_clusters_destroy(&p);
}

static void it_is_symmetric_positive_and_keeps_fixed_points(void)
{
    pal_rigid_clusters p;
    make(1e-3);
    for (int i = 0; i < N; i++) fixed[i] = i % NX == 0;
    REQUIRE(!pal_rigid_clusters_make(&a, x, fixed, 3, arena, &p));
    double v[2][3 * N], c[2][3 * N] = {{0}};
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 3 * N; i++) v[k][i] = pal_random_unit(5, (uint64_t)(3 * N * k + i)) - 0.5;
    for (int k = 0; k < 2; k++) pal_rigid_clusters_add(&p, v[k], c[k]);
    CHECK_NEAR(dot(v[0], c[1]), dot(v[1], c[0]), 1e-9 * fabs(dot(v[0], c[0])));
    CHECK(dot(v[0], c[0]) > 0 && dot(v[1], c[1]) > 0);
    for (int i = 0; i < N; i++)
        if (fixed[i]) CHECK_NEAR(pal_norm3(c[0] + 3 * i), 0, 0);
    pal_rigid_clusters_destroy(&p);
    memset(fixed, 0, sizeof fixed);
}

/* parts of a single point have no rotation, a body without ground no stiffness against its own motion */
static void a_singular_body_has_a_correction(void)
{
    pal_rigid_clusters p;
    for (int single = 0; single < 2; single++) {
        make(single ? 1 : 0);
        REQUIRE(!pal_rigid_clusters_make(&a, x, fixed, single ? 0.5 : 3, arena, &p));
        CHECK_INT(p.n_cluster, single ? N : 3);
        double r[3 * N], out[3 * N] = {0};
        for (int i = 0; i < 3 * N; i++) r[i] = pal_random_unit(9, (uint64_t)i) - 0.5;
        pal_rigid_clusters_add(&p, r, out);
        CHECK(dot(r, out) > 0 && isfinite(dot(out, out)));
        pal_rigid_clusters_destroy(&p);
    }
}

static void boxes_beyond_number_are_refused(void)
{
    pal_rigid_clusters p;
    make(1);
    CHECK_INT(pal_rigid_clusters_make(&a, x, fixed, 1e-6, arena, &p), PAL_ERR_BUDGET);
    pal_rigid_clusters_destroy(&p);
}

int main(void)
{
    arena = pal_arena_create(1 << 20, true);
    if (!arena) return 1;
    RUN(what_is_rigid_comes_back);
    RUN(it_is_symmetric_positive_and_keeps_fixed_points);
    RUN(a_singular_body_has_a_correction);
    RUN(boxes_beyond_number_are_refused);
    pal_arena_destroy(arena);
    return check_report();
}
