/* Blocks of voxels in rounds: every block is in one part, and no two parts of a round touch the same slot, also not
 * with lanes without an element, where kernels add zeros. Boxes, ellipsoids and every second voxel at random. */
#include "server/sim/core/simd_blocks.h"
#include "server/sim/core/tuning.h"
#include "tests/check.h"
#include "tests/fixtures/random.h"

#include <stdlib.h>
#include <string.h>

typedef struct voxels {
    int n_cell, n_node;
    int32_t *node; /* corners, x = 1, y = 2, z = 4 [n_cell][8] */
    double *x;     /* in edges [n_node][3] */
    pal_arena *arena;
    pal_node_order *order;
    pal_simd_blocks blocks;
    pal_block_rounds rounds;
} voxels;

typedef bool keep_cell(const int n[3], const int at[3], uint64_t *seed);

static bool keep_all(const int n[3], const int at[3], uint64_t *seed)
{
    (void)n, (void)at, (void)seed;
    return true;
}
static bool keep_ellipsoid(const int n[3], const int at[3], uint64_t *seed)
{
    double r2 = 0;
    (void)seed;
    for (int c = 0; c < 3; c++) r2 += pow((2.0 * at[c] + 1) / n[c] - 1, 2);
    return r2 <= 1;
}
static bool keep_half(const int n[3], const int at[3], uint64_t *seed)
{
    (void)n, (void)at;
    return random_unit(seed) < 0.5;
}

static void make(voxels *v, const int n[3], keep_cell *keep)
{
    const int m[3] = {n[0] + 1, n[1] + 1, n[2] + 1}, n_max = m[0] * m[1] * m[2];
    uint64_t seed = 11; /* draws of keep */
    memset(v, 0, sizeof *v);
    int32_t *name = malloc(sizeof *name * (size_t)n_max);
    v->node = malloc(sizeof *v->node * 8 * (size_t)n_max), v->x = malloc(sizeof *v->x * 3 * (size_t)n_max);
    v->arena = pal_arena_create(1 << 16, true);
    REQUIRE(name && v->node && v->x && v->arena);
    for (int i = 0; i < n_max; i++) name[i] = -1;
    for (int cell = 0; cell < n[0] * n[1] * n[2]; cell++) {
        const int at[3] = {cell % n[0], cell / n[0] % n[1], cell / n[0] / n[1]};
        if (!keep(n, at, &seed)) continue;
        for (int c = 0; c < 8; c++) {
            const int p[3] = {at[0] + (c & 1), at[1] + (c >> 1 & 1), at[2] + (c >> 2)};
            int32_t *to = &name[(p[2] * m[1] + p[1]) * m[0] + p[0]];
            if (*to < 0) {
                for (int i = 0; i < 3; i++) v->x[3 * v->n_node + i] = p[i];
                *to = v->n_node++;
            }
            v->node[8 * v->n_cell + c] = *to;
        }
        v->n_cell++;
    }
    free(name);
    REQUIRE(!pal_node_order_make(v->x, v->n_node, 1, v->arena, &v->order));
    REQUIRE(!pal_simd_blocks_make_ordered(v->order, v->node, v->n_cell, 8, v->arena, &v->blocks));
    REQUIRE(!pal_block_rounds_make(&v->blocks, v->order, v->x, 1, v->node, v->n_cell, v->arena, &v->rounds));
}

static void drop(voxels *v)
{
    free(v->node), free(v->x);
    pal_arena_destroy(v->arena);
}

/* slots that a kernel reads and writes for lane l of corner c of a block */
static int slot_of(const voxels *v, int block, int c, int l)
{
    if (block < v->blocks.n_strip) return v->blocks.base[8 * block + c] + l;
    return v->blocks.node[(8 * (block - v->blocks.n_strip) + c) * PAL_LANES + l];
}

static void check_rounds(const voxels *v)
{
    const int n_block = v->blocks.n_lane / PAL_LANES;
    uint8_t *seen = calloc((size_t)n_block + 1, 1);
    int32_t *part_of = malloc(sizeof *part_of * (size_t)v->order->n_slot);
    int n_shared = 0, n_outside = 0;
    REQUIRE(seen && part_of);
    for (int round = 0; round < v->rounds.n_round; round++) {
        for (int i = 0; i < v->order->n_slot; i++) part_of[i] = -1;
        for (int part = v->rounds.part[round]; part < v->rounds.part[round + 1]; part++)
            for (int k = v->rounds.first[part]; k < v->rounds.first[part + 1]; k++) {
                const int b = v->rounds.order[k];
                seen[b]++;
                for (int lane = 0; lane < 8 * PAL_LANES; lane++) {
                    const int slot = slot_of(v, b, lane / PAL_LANES, lane % PAL_LANES);
                    if (slot < 0 || slot >= v->order->n_slot) {
                        n_outside++;
                        continue;
                    }
                    n_shared += part_of[slot] >= 0 && part_of[slot] != part;
                    part_of[slot] = part;
                }
            }
    }
    CHECK_INT(n_shared, 0);
    CHECK_INT(n_outside, 0);
    int n_once = 0;
    for (int b = 0; b < n_block; b++) n_once += seen[b] == 1;
    CHECK_INT(n_once, n_block);
    free(seen), free(part_of);
}

static void parts_of_a_round_share_no_slot(void)
{
    static keep_cell *const keep[] = {keep_all, keep_ellipsoid, keep_half};
    uint64_t seed = 7;
    int n_block = 0, n_side = 0;
    for (int k = 0; k < 600; k++) {
        voxels v;
        int size[3];
        for (int c = 0; c < 3; c++) size[c] = 1 + (int)random_below(&seed, k % 10 == 0 ? 40 : 12);
        make(&v, size, keep[k % 3]);
        n_block += v.blocks.n_lane / PAL_LANES, n_side += v.rounds.first[v.rounds.part[2]];
        check_rounds(&v);
        drop(&v);
    }
    printf("  %d of %d blocks in layers side by side\n", n_side, n_block);
}

/* blocks that are left to a round of their own are few in a body worth several threads */
static void few_blocks_are_outside_of_layers(void)
{
    static const int size[3] = {33, 25, 21};
    static keep_cell *const keep[] = {keep_all, keep_ellipsoid, keep_half};
    for (int k = 0; k < 3; k++) {
        voxels v;
        make(&v, size, keep[k]);
        const int n_block = v.blocks.n_lane / PAL_LANES, n_side = v.rounds.first[v.rounds.part[2]];
        printf("  %d of %d blocks in %d layers\n", n_side, n_block, v.rounds.part[2]);
        CHECK_INT(v.rounds.part[2], 21);
        CHECK_LE(0.9 * n_block, n_side);
        drop(&v);
    }
}

/* ---- parts of a divided order ---- */

/* adds at every slot of a block terms of which no two sums in different order are equal */
static void add_terms(const voxels *v, const pal_node_order *order, int block)
{
    for (int c = 0; c < 8; c++)
        for (int l = 0; l < PAL_LANES; l++) {
            const int slot = slot_of(v, block, c, l);
            for (int d = 0; d < 3; d++) {
                const size_t at = (size_t)d * (size_t)order->n_slot + (size_t)slot;
                order->f[at] += (order->x[at] + d) / (1.0 + 7 * block + c);
            }
        }
}

/* false: the body is not worth dividing */
static bool check_parts(voxels *v, int n_part, double *force)
{
    const int n_block = v->blocks.n_lane / PAL_LANES, n = v->n_node;
    pal_part_blocks parts;
    CHECK(!pal_node_order_divide(v->order, n_part, v->arena));
    CHECK(!pal_part_blocks_make(&v->blocks, v->order, v->arena, &parts));
    memset(force, 0, sizeof *force * 6 * (size_t)n);
    pal_node_order_load(v->order, v->x);
    for (int b = 0; b < n_block; b++) add_terms(v, v->order, b);
    pal_node_order_add(v->order, force);
    /* twice, so that what a part leaves in its arrays would show */
    for (int turn = 0; turn < 2 && parts.first; turn++) {
        memset(force + 3 * n, 0, sizeof *force * 3 * (size_t)n);
        for (int p = 0; p < v->order->n_part; p++) {
            pal_part_load(&parts, v->order, p, v->x);
            for (int i = parts.first[p]; i < parts.first[p + 1]; i++) add_terms(v, &v->order->part[p], parts.block[i]);
            pal_part_add(&parts, v->order, p, force + 3 * n);
        }
        CHECK(memcmp(force, force + 3 * n, sizeof *force * 3 * (size_t)n) == 0);
    }
    for (int p = 0; p < v->order->n_part && parts.first; p++)
        CHECK_LE(parts.first[p + 1] - parts.first[p], PAL_PART_MAX * n_block);
    return parts.first != NULL;
}

/* whatever the number of parts, a node gets the sum of all blocks in their order, bit by bit */
static void parts_sum_as_one_thread_does(void)
{
    static keep_cell *const keep[] = {keep_all, keep_ellipsoid, keep_half};
    uint64_t seed = 5;
    int n_divided = 0;
    for (int k = 0; k < 120; k++) {
        voxels v;
        int size[3];
        for (int c = 0; c < 3; c++) size[c] = 1 + (int)random_below(&seed, k % 6 == 0 ? 24 : 12);
        make(&v, size, keep[k % 3]);
        double *force = malloc(sizeof *force * 6 * (size_t)v.n_node + 1);
        REQUIRE(force != NULL);
        n_divided += v.n_cell > 0 && check_parts(&v, 2 + k % 4, force);
        free(force);
        drop(&v);
    }
    CHECK_LE(30, n_divided);
}

/* what two threads repeat of a body worth them: 2 of 25 layers and less */
static void two_parts_repeat_few_blocks(void)
{
    static const int size[3] = {33, 25, 21};
    static keep_cell *const keep[] = {keep_all, keep_ellipsoid, keep_half};
    for (int k = 0; k < 3; k++) {
        voxels v;
        pal_part_blocks parts;
        make(&v, size, keep[k]);
        const int n_block = v.blocks.n_lane / PAL_LANES;
        REQUIRE(!pal_node_order_divide(v.order, 2, v.arena));
        REQUIRE(!pal_part_blocks_make(&v.blocks, v.order, v.arena, &parts));
        REQUIRE(parts.first != NULL);
        printf("  %d and %d of %d blocks\n", parts.first[1], parts.first[2] - parts.first[1], n_block);
        CHECK_LE(parts.first[2], 1.25 * n_block);
        drop(&v);
    }
}

int main(void)
{
    RUN(parts_sum_as_one_thread_does);
    RUN(two_parts_repeat_few_blocks);
    RUN(parts_of_a_round_share_no_slot);
    RUN(few_blocks_are_outside_of_layers);
    return check_report();
}
