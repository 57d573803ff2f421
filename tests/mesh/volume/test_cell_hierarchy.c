/* Levels of coarse cells: sizes on a box, linear fields, parts that a slit separates, loose cells, supports; and that
 * the matrix of a coarse cell has the energy of the interpolated field. */
#include "server/mesh/volume/cell_hierarchy.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

#include <stdlib.h>
#include <string.h>

typedef struct body {
    int n_cell, n_node;
    int32_t *node, *place;
    uint8_t *fixed;
    double *x; /* in edges [n_node][3] */
    pal_arena *arena;
    pal_grid_hierarchy grid;
} body;

/* cells of a box where keep says so; cells on both sides of x = cut share no node there up to z = deep */
static void make(body *b, const int n[3], bool (*keep)(const int at[3]), int cut, int deep)
{
    const int m[3] = {n[0] + 1, n[1] + 1, n[2] + 1}, max = 2 * m[0] * m[1] * m[2];
    memset(b, 0, sizeof *b);
    int32_t *name = malloc(sizeof *name * (size_t)max);
    b->node = malloc(sizeof *b->node * 8 * (size_t)max), b->place = malloc(sizeof *b->place * 3 * (size_t)max);
    b->fixed = calloc((size_t)max, 1), b->x = malloc(sizeof *b->x * 3 * (size_t)max);
    b->arena = pal_arena_create(1 << 16, true);
    if (!name || !b->node || !b->place || !b->fixed || !b->x || !b->arena) abort();
    for (int i = 0; i < max; i++) name[i] = -1;
    for (int v = 0; v < n[0] * n[1] * n[2]; v++) {
        const int at[3] = {v % n[0], v / n[0] % n[1], v / n[0] / n[1]};
        if (keep && !keep(at)) continue;
        for (int c = 0; c < 8; c++) {
            const int p[3] = {at[0] + (c & 1), at[1] + (c >> 1 & 1), at[2] + (c >> 2)};
            const bool other = p[0] == cut && at[0] >= cut && p[2] <= deep;
            int32_t *to = &name[2 * ((p[2] * m[1] + p[1]) * m[0] + p[0]) + other];
            if (*to < 0) {
                for (int i = 0; i < 3; i++) b->x[3 * b->n_node + i] = p[i];
                *to = b->n_node++;
            }
            b->node[8 * b->n_cell + c] = *to;
        }
        for (int i = 0; i < 3; i++) b->place[3 * b->n_cell + i] = at[i];
        b->n_cell++;
    }
    free(name);
}

static pal_err build(body *b, int n_coarsest)
{
    const pal_lattice_cells cells = {b->n_cell, b->n_node, b->node, b->place, b->fixed};
    return pal_cell_hierarchy_make(&cells, n_coarsest, b->arena, &b->grid);
}

static void drop(body *b)
{
    free(b->node), free(b->place), free(b->fixed), free(b->x);
    pal_arena_destroy(b->arena);
}

static void a_box_has_the_lattices_of_half_as_many(void)
{
    body b;
    make(&b, (int[3]){8, 5, 4}, NULL, -1, -1);
    REQUIRE(!build(&b, 20));
    REQUIRE(b.grid.n_level == 2);
    CHECK_INT(b.grid.level[0].n_cell, 4 * 3 * 2);
    CHECK_INT(b.grid.level[0].n_node, 5 * 4 * 3);
    CHECK_INT(b.grid.level[1].n_cell, 2 * 2 * 1);
    CHECK_INT(b.grid.level[1].n_node, 3 * 3 * 2);
    drop(&b);
    make(&b, (int[3]){2, 2, 2}, NULL, -1, -1);
    REQUIRE(!build(&b, 27));
    CHECK_INT(b.grid.n_level, 0);
    drop(&b);
}

static bool hollow(const int at[3])
{
    return at[0] < 2 || at[0] > 6 || at[1] < 2 || at[1] > 5 || (at[2] > 0 && (at[0] + at[1]) % 3);
}

/* places of coarse nodes, in finer edges, from the places of cells */
static double *coarse_places(const pal_grid_level *level, const int32_t *finer_place)
{
    double *x = malloc(sizeof *x * 3 * (size_t)level->n_node);
    for (int g = 0; g < level->n_cell && x; g++)
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 3; i++)
                x[3 * level->node[8 * g + c] + i] =
                    2 * (finer_place[3 * level->child[level->first[g]] + i] / 2 + (c >> i & 1));
    return x;
}

/* every node is the mean of the places that it is interpolated from */
static void linear_fields_come_through(void)
{
    body b;
    make(&b, (int[3]){9, 8, 5}, hollow, 4, 3);
    REQUIRE(!build(&b, 60));
    REQUIRE(b.grid.n_level >= 1);
    const pal_grid_level *level = &b.grid.level[0];
    double *x = coarse_places(level, b.place), worst = 0;
    REQUIRE(x != NULL);
    for (int i = 0; i < b.n_node; i++) {
        double mean[3] = {0};
        const int n = level->start[i + 1] - level->start[i];
        CHECK(n == 1 || n == 2 || n == 4 || n == 8);
        for (int k = level->start[i]; k < level->start[i + 1]; k++)
            for (int c = 0; c < 3; c++) mean[c] += x[3 * level->from[k] + c] / n;
        for (int c = 0; c < 3; c++) worst = fmax(worst, fabs(mean[c] - b.x[3 * i + c]));
    }
    CHECK_LE(worst, 1e-12);
    free(x);
    drop(&b);
}

/* a box slit down its middle, within the blocks of every level: the halves share nothing but what hangs together */
static void a_slit_stays_open_on_every_level(void)
{
    body whole, slit, parted;
    make(&whole, (int[3]){8, 4, 4}, NULL, -1, -1);
    make(&slit, (int[3]){8, 4, 4}, NULL, 3, 3);
    make(&parted, (int[3]){8, 4, 4}, NULL, 3, 4);
    REQUIRE(!build(&whole, 10) && !build(&slit, 10) && !build(&parted, 10));
    /* 3 | 5 cells along x: blocks 0, 1 of the left part, 1, 2, 3 of the right one */
    CHECK_INT(whole.grid.level[0].n_node, 5 * 3 * 3);
    CHECK_INT(parted.grid.level[0].n_node, (3 + 4) * 3 * 3);
    CHECK_INT(parted.grid.level[0].n_cell, (2 + 3) * 2 * 2);
    /* open up to z = 3: the lower blocks at x = 1 are two, which part at their lowest 2 x 3 corners and meet again at
     * the upper ones, where the block above hangs together */
    CHECK_INT(slit.grid.level[0].n_node, 5 * 3 * 3 + 2 * 3);
    CHECK_INT(slit.grid.level[0].n_cell, 4 * 2 * 2 + 2);
    for (int k = 0; k < parted.grid.n_level; k++) { /* no cell of one part has a node of the other */
        const pal_grid_level *level = &parted.grid.level[k];
        int32_t *part = malloc(sizeof *part * (size_t)level->n_cell), n_part = 0;
        REQUIRE(part != NULL);
        for (int g = 0; g < level->n_cell; g++) part[g] = g;
        for (bool grown = true; grown;) {
            grown = false;
            for (int g = 0; g < level->n_cell; g++)
                for (int h = 0; h < g; h++)
                    for (int c = 0; c < 64 && part[g] != part[h]; c++)
                        if (level->node[8 * g + c / 8] == level->node[8 * h + c % 8])
                            part[g] = part[h] = part[g] < part[h] ? part[g] : part[h], grown = true;
        }
        for (int g = 0; g < level->n_cell; g++) n_part += part[g] == g;
        CHECK_INT(n_part, 2);
        free(part);
    }
    drop(&whole), drop(&slit), drop(&parted);
}

/* cells that share no node, as after many cuts, all in one block: a level of them would be no coarser */
static void loose_cells_make_no_levels(void)
{
    enum { N = 20000 };
    static int32_t node[8 * N], place[3 * N];
    static uint8_t fixed[8 * N];
    for (int i = 0; i < 8 * N; i++) node[i] = i;
    pal_arena *arena = pal_arena_create(1 << 16, true);
    pal_grid_hierarchy grid;
    const pal_lattice_cells cells = {N, 8 * N, node, place, fixed};
    REQUIRE(arena && !pal_cell_hierarchy_make(&cells, 100, arena, &grid));
    CHECK_INT(grid.n_level, 0);
    CHECK(pal_arena_used(arena) == 0);
    /* every cell hangs together with the next one by a node: one group, which is one coarse cell */
    for (int i = 1; i < N; i++) node[8 * i] = node[8 * i - 1];
    REQUIRE(!pal_cell_hierarchy_make(&cells, 100, arena, &grid));
    CHECK_INT(grid.n_level, 1);
    CHECK_INT(grid.level[0].n_cell, 1);
    CHECK_INT(grid.level[0].n_node, 8);
    pal_arena_destroy(arena);
}

/* the finer nodes of a node are those that are interpolated from it */
static void finer_nodes_are_listed(void)
{
    body b;
    make(&b, (int[3]){9, 8, 5}, hollow, 4, 3);
    REQUIRE(!build(&b, 60));
    const pal_grid_level *level = &b.grid.level[0];
    CHECK_INT(level->begin[level->n_node], level->start[b.n_node]);
    for (int i = 0; i < level->n_node; i++)
        for (int32_t k = level->begin[i]; k < level->begin[i + 1]; k++) {
            const int32_t finer = level->finer[k];
            int n = 0;
            for (int32_t m = level->start[finer]; m < level->start[finer + 1]; m++) n += level->from[m] == i;
            CHECK_INT(n, 1);
            if (k > level->begin[i]) CHECK(level->finer[k - 1] < finer);
        }
    drop(&b);
}

static void held_nodes_have_no_part(void)
{
    body b;
    make(&b, (int[3]){4, 4, 4}, NULL, -1, -1);
    for (int i = 0; i < b.n_node; i++) b.fixed[i] = b.x[3 * i] <= 2;
    REQUIRE(!build(&b, 10));
    const pal_grid_level *level = &b.grid.level[0];
    int n_fixed = 0;
    for (int i = 0; i < b.n_node; i++) CHECK(b.fixed[i] == (level->start[i] == level->start[i + 1]));
    for (int i = 0; i < level->n_node; i++) n_fixed += level->fixed[i];
    CHECK_INT(n_fixed, 9); /* the plane x = 0; nodes at x = 3 are between those at 2 and 4 */
    drop(&b);
}

/* u' K u of the finer cell with u interpolated, from a matrix that is not of elasticity */
static void a_coarse_cell_has_the_energy_of_its_parts(void)
{
    uint64_t seed = 3;
    static double k[24][24], to[24][24];
    for (int octant = 0; octant < 8; octant++) {
        const unsigned fixed = octant == 5 ? 0x12 : 0;
        double u[24], fine[24], energy = 0, coarse = 0;
        memset(to, 0, sizeof to);
        for (int i = 0; i < 24; i++) u[i] = random_signed(&seed);
        for (int i = 0; i < 24; i++)
            for (int j = 0; j <= i; j++) k[i][j] = k[j][i] = random_signed(&seed);
        for (int c = 0; c < 8; c++)
            for (int i = 0; i < 3; i++) {
                fine[3 * c + i] = 0;
                for (int d = 0; d < 8 && !(fixed >> c & 1); d++) {
                    double w = 1;
                    for (int axis = 0; axis < 3; axis++) {
                        const double at = 0.5 * ((octant >> axis & 1) + (c >> axis & 1));
                        w *= d >> axis & 1 ? at : 1 - at;
                    }
                    fine[3 * c + i] += w * u[3 * d + i];
                }
            }
        pal_multigrid_coarsen_cell(k, octant, fixed, to);
        for (int i = 0; i < 24; i++)
            for (int j = 0; j < 24; j++) energy += fine[i] * k[i][j] * fine[j], coarse += u[i] * to[i][j] * u[j];
        CHECK_NEAR(coarse, energy, 1e-12);
    }
}

int main(void)
{
    RUN(a_box_has_the_lattices_of_half_as_many);
    RUN(linear_fields_come_through);
    RUN(a_slit_stays_open_on_every_level);
    RUN(loose_cells_make_no_levels);
    RUN(finer_nodes_are_listed);
    RUN(held_nodes_have_no_part);
    RUN(a_coarse_cell_has_the_energy_of_its_parts);
    return check_report();
}
