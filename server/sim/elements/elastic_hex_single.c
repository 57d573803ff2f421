/* Voxel hexahedra in single precision. */
#include "server/sim/elements/elastic_hex_single.h"

#include "server/sim/core/simd.h"

#include <string.h>

typedef float pal_single8 __attribute__((vector_size(32)));
typedef float pal_single8_memory __attribute__((vector_size(32), aligned(4), may_alias));
/* as many blocks at once as the processor has numbers side by side for; every operation is lane by lane, so that their
 * number does not change a bit */
#ifdef __AVX512F__
enum { BLOCKS = 2 };
typedef float single_wide __attribute__((vector_size(64)));
#else
enum { BLOCKS = 1 };
typedef pal_single8 single_wide;
#endif
#define HEX_VECTOR single_wide
#define HEX_REAL   float
#include "server/sim/elements/elastic_hex_modes.h"

/* blocks of pairs of corners c <= d to a whole symmetric matrix */
static void spread(double block[36][9], double to[24][24])
{
    for (int c = 0; c < 8; c++)
        for (int d = c; d < 8; d++)
            for (int i = 0; i < 9; i++)
                to[3 * c + i / 3][3 * d + i % 3] = to[3 * d + i % 3][3 * c + i / 3] = block[pal_hex_pair(c, d)][i];
}

/* blocks of a piece of work of a thread: some five microseconds */
enum { ROTATED = 128 };

static int count_pieces(const pal_elastic_hexes *cubes)
{
    return (cubes->n_block + ROTATED - 1) / ROTATED;
}

pal_err pal_hex_single_make(const pal_elastic_hexes *cubes, const pal_body *body, pal_arena *arena,
                            pal_elastic_hexes_single *out)
{
    const size_t n = PAL_LANES * (size_t)cubes->n_block;
    *out =
        (pal_elastic_hexes_single){.cubes = cubes, .n_slot = body->node_order->n_slot, .slot = body->node_order->slot};
    out->stiff = PAL_NEW(arena, float, 2 * n);
    out->acting = cubes->recovery ? PAL_NEW(arena, float, 2 * n) : out->stiff;
    if (cubes->law != PAL_LAW_LINEAR) {
        out->rotation = PAL_NEW(arena, float, 9 * n);
        if (!PAL_NEW_DOUBLES(arena, (size_t)count_pieces(cubes), &out->turned)) return PAL_ERR_MEMORY;
    }
    int n_cut = 0;
    for (int b = 0; cubes->cut && b < cubes->n_block; b++) n_cut = cubes->cut[b] >= n_cut ? cubes->cut[b] + 1 : n_cut;
    if (n_cut > 0 && !(out->weight = PAL_NEW(arena, float, 8 * PAL_LANES * (size_t)n_cut))) return PAL_ERR_MEMORY;
    for (int i = 0; i < 8 * PAL_LANES * n_cut; i++) out->weight[i] = (float)cubes->weight[i];
    out->whole = pal_arena_array(arena, 2, sizeof *out->whole);
    if (!out->whole || !out->stiff || !out->acting || !(out->rotation || cubes->law == PAL_LAW_LINEAR))
        return PAL_ERR_MEMORY;
    for (int part = 0; part < 2; part++) {
        double block[36][9];
        for (int i = 0; i < 36 * 9; i++) block[i / 9][i % 9] = cubes->reference[i / 9][part][i % 9];
        spread(block, out->whole[part]);
    }
    return PAL_ERR_OK;
}

static const double *coefficients(const pal_elastic_hexes *cubes, int part)
{
    return cubes->recovery ? cubes->whole[part] : part == 0 ? cubes->mu : cubes->lambda;
}

static void act_as_elements(pal_elastic_hexes_single *single)
{
    single->softened = false;
    if (single->acting != single->stiff)
        memcpy(single->acting, single->stiff, sizeof *single->stiff * 2 * PAL_LANES * (size_t)single->cubes->n_block);
}

void pal_hex_single_stiffen(pal_elastic_hexes_single *single)
{
    for (int part = 0; part < 2; part++) {
        const double *from = coefficients(single->cubes, part);
        for (int b = 0; b < single->cubes->n_block; b++)
            for (int l = 0; l < PAL_LANES; l++)
                single->stiff[(2 * b + part) * PAL_LANES + l] = (float)from[PAL_LANES * b + l];
    }
    act_as_elements(single);
}

/* the elements of regions as their edges are */
static void soften(pal_elastic_hexes_single *single)
{
    const pal_elastic_hexes *cubes = single->cubes;
    if (single->softened) act_as_elements(single);
    for (int e = 0; e < cubes->n_hex && pal_recovery_acts(cubes->recovery); e++) {
        const double scale = pal_recovery_scale(cubes->recovery, e);
        const int place = cubes->simd_blocks.place[e];
        float *at = single->acting + 2 * PAL_LANES * (place / PAL_LANES) + place % PAL_LANES;
        if (scale < 0) continue;
        const float mu = at[0], lambda = at[PAL_LANES], young = mu * (3 * lambda + 2 * mu) / (lambda + mu);
        at[0] = 0.5F * (float)scale * young, at[PAL_LANES] = 0;
        single->softened = true;
    }
}

static void rotate_piece(void *user, int worker, int index)
{
    const pal_elastic_hexes_single *single = user;
    const int n_block = single->cubes->n_block, first = index * ROTATED,
              end = first + ROTATED < n_block ? first + ROTATED : n_block;
    (void)worker;
    double lane[PAL_LANES] = {0}, sum = 0;
    for (int i = 9 * PAL_LANES * first; i < 9 * PAL_LANES * end; i += PAL_LANES)
        for (int l = 0; l < PAL_LANES; l++) {
            const float to = (float)single->cubes->rotation[i + l];
            const double change = (double)(to - single->rotation[i + l]);
            single->rotation[i + l] = to;
            lane[l] += change * change;
        }
    for (int l = 0; l < PAL_LANES; l++) sum += lane[l];
    single->turned[index] = sum;
}

double pal_hex_single_rotate(pal_elastic_hexes_single *single, pal_team *team)
{
    const int n_piece = count_pieces(single->cubes);
    double sum = 0;
    if (!single->rotation) return 0;
    soften(single);
    pal_team_run(team, n_piece, rotate_piece, single);
    for (int k = 0; k < n_piece; k++) sum += single->turned[k];
    /* a small turn by w changes R by skew(w) R, whose entries have the sum of squares 2 w.w */
    return sqrt(0.5 * sum / single->cubes->n_hex);
}

/* 8 numbers of each block */
PAL_INLINE single_wide load(const float *const at[BLOCKS])
{
#ifdef __AVX512F__
    return __builtin_shufflevector(*(const pal_single8_memory *)at[0], *(const pal_single8_memory *)at[1], 0, 1, 2, 3,
                                   4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
#else
    return *(const pal_single8_memory *)at[0];
#endif
}
PAL_INLINE void add(float *at, single_wide a, int block)
{
#ifdef __AVX512F__
    *(pal_single8_memory *)at += block == 0 ? __builtin_shufflevector(a, a, 0, 1, 2, 3, 4, 5, 6, 7)
                                            : __builtin_shufflevector(a, a, 8, 9, 10, 11, 12, 13, 14, 15);
#else
    (void)block;
    *(pal_single8_memory *)at += a;
#endif
}

/* u = r u, or r' u, for all modes but translation */
PAL_INLINE void turn(const single_wide r[9], bool transposed, single_wide u[3][8])
{
    const int row = transposed ? 1 : 3, column = transposed ? 3 : 1;
    for (int m = 1; m < 8; m++) {
        const single_wide a = u[0][m], b = u[1][m], c = u[2][m];
        for (int i = 0; i < 3; i++) u[i][m] = r[row * i] * a + r[row * i + column] * b + r[row * i + 2 * column] * c;
    }
}

typedef struct product {
    const pal_elastic_hexes_single *single;
    float k;
    const float *p;
    float *out;
} product;

/* the numbers of blocks at `from`, n [blocks][n][8], at index i */
PAL_INLINE single_wide load_own(const float *from, const int32_t block[BLOCKS], int n, int i)
{
    const float *at[BLOCKS];
    for (int k = 0; k < BLOCKS; k++) at[k] = from + (n * block[k] + i) * PAL_LANES;
    return load(at);
}

/* the weights of the points of the blocks, of which one at least has cut elements */
PAL_INLINE void load_weights(const pal_elastic_hexes_single *single, const int32_t block[BLOCKS], single_wide p[8])
{
    static const float even[PAL_LANES] = {0.125F, 0.125F, 0.125F, 0.125F, 0.125F, 0.125F, 0.125F, 0.125F};
    for (int q = 0; q < 8; q++) {
        const float *at[BLOCKS];
        for (int k = 0; k < BLOCKS; k++) {
            const int cut = single->cubes->cut[block[k]];
            at[k] = cut < 0 ? even : single->weight + (8 * cut + q) * PAL_LANES;
        }
        p[q] = load(at);
    }
}

/* u becomes k K u of the elements of the blocks */
PAL_INLINE void multiply_blocks(const product *to, const int32_t block[BLOCKS], bool turned, single_wide u[3][8])
{
    const pal_elastic_hexes_single *single = to->single;
    const float beta[2] = {(float)single->cubes->beta[0], (float)single->cubes->beta[1]},
                twist = (float)single->cubes->twist;
    const single_wide mu = to->k * load_own(single->acting, block, 2, 0),
                      lambda = to->k * load_own(single->acting, block, 2, 1);
    single_wide r[9];
    for (int i = 0; i < 3; i++) walsh(u[i]);
    for (int i = 0; i < 9 && turned; i++) r[i] = load_own(single->rotation, block, 9, i);
    if (turned) turn(r, true, u);
    bool cut = false;
    for (int k = 0; k < BLOCKS; k++) cut = cut || pal_hex_is_cut(single->cubes, block[k]);
    if (cut) {
        single_wide p[8];
        load_weights(single, block, p);
        hex_cut_stress(mu, lambda, beta[0] * mu + beta[1] * lambda, twist, p, u);
    } else {
        hex_stress(mu, lambda, beta[0] * mu + beta[1] * lambda, twist, u);
    }
    if (turned) turn(r, false, u);
    for (int i = 0; i < 3; i++) unwalsh(u[i]);
}

/* n of the blocks at block, the others are repetitions */
PAL_INLINE void multiply_slots(const product *to, const int32_t block[BLOCKS], int n, bool turned)
{
    const int32_t *base = to->single->cubes->simd_blocks.base;
    const size_t n_slot = (size_t)to->single->n_slot;
    single_wide u[3][8];
    for (size_t d = 0; d < 3; d++)
        for (int c = 0; c < 8; c++) {
            const float *at[BLOCKS];
            for (int k = 0; k < BLOCKS; k++) at[k] = to->p + d * n_slot + base[8 * block[k] + c];
            u[d][c] = load(at);
        }
    multiply_blocks(to, block, turned, u);
    for (int k = 0; k < n; k++)
        for (size_t d = 0; d < 3; d++)
            for (int c = 0; c < 8; c++) add(to->out + d * n_slot + base[8 * block[k] + c], u[d][c], k);
}

static void multiply_loose(const product *to, int32_t b)
{
    const int32_t *node = pal_block_nodes(&to->single->cubes->simd_blocks, b);
    const size_t n_slot = (size_t)to->single->n_slot;
    const int32_t block[2] = {b, b};
    single_wide u[3][8] = {{{0}}};
    for (size_t d = 0; d < 3; d++)
        for (int c = 0; c < 8; c++)
            for (int l = 0; l < PAL_LANES; l++) u[d][c][l] = to->p[d * n_slot + (size_t)node[PAL_LANES * c + l]];
    multiply_blocks(to, block, to->single->rotation != NULL, u);
    for (size_t d = 0; d < 3; d++)
        for (int c = 0; c < 8; c++)
            for (int l = 0; l < PAL_LANES; l++) to->out[d * n_slot + (size_t)node[PAL_LANES * c + l]] += u[d][c][l];
}

static void multiply_part(void *user, int part)
{
    const product *to = user;
    const pal_block_rounds *rounds = &to->single->cubes->rounds;
    const int n_strip = to->single->cubes->simd_blocks.n_strip, end = rounds->first[part + 1];
    for (int k = rounds->first[part], n; k < end; k += n) {
        int32_t block[BLOCKS];
        n = 0;
        while (n < BLOCKS && k + n < end && rounds->order[k + n] < n_strip) block[n] = rounds->order[k + n], n++;
        for (int i = n; i < BLOCKS && n > 0; i++) block[i] = block[0];
        if (n == 0)
            multiply_loose(to, rounds->order[k]), n = 1;
        else if (to->single->rotation)
            multiply_slots(to, block, n, true);
        else
            multiply_slots(to, block, n, false);
    }
}

static void add_ground(const product *to)
{
    const pal_elastic_hexes *cubes = to->single->cubes;
    const pal_ground *ground = cubes->ground;
    const size_t n_slot = (size_t)to->single->n_slot;
    for (int i = 0; ground && i < ground->n; i++) {
        const int32_t *node = cubes->hexes->node + 8 * (size_t)ground->item[i].element;
        for (int p = 0; p < 64; p++) {
            const int c = p / 8, d = p % 8, low = c <= d ? c : d, high = c <= d ? d : c;
            const float k = to->k * (float)ground->item[i].k_N_m[pal_hex_pair(low, high)];
            for (size_t j = 0; j < 3; j++)
                to->out[j * n_slot + (size_t)to->single->slot[node[c]]] +=
                    k * to->p[j * n_slot + (size_t)to->single->slot[node[d]]];
        }
    }
}

void pal_hex_single_multiply(const pal_elastic_hexes_single *single, pal_team *team, float k, const float *p,
                             float *out)
{
    product job = {.single = single, .k = k, .p = p, .out = out};
    pal_block_rounds_run(&single->cubes->rounds, team, multiply_part, &job);
    add_ground(&job);
}

/* to = R k R', one block of 3x3 */
static void turn_block(const double r[9], const double k[9], double to[9])
{
    double part[9];
    for (int i = 0; i < 9; i++)
        part[i] = r[i - i % 3] * k[i % 3] + r[i - i % 3 + 1] * k[3 + i % 3] + r[i - i % 3 + 2] * k[6 + i % 3];
    for (int i = 0; i < 9; i++)
        to[i] = part[i - i % 3] * r[3 * (i % 3)] + part[i - i % 3 + 1] * r[3 * (i % 3) + 1] +
                part[i - i % 3 + 2] * r[3 * (i % 3) + 2];
}

/* the rotation of a lane; false: none that single precision sees */
static bool read_rotation(const float *rotation, int lane, double r[9])
{
    for (int i = 0; i < 9; i++) r[i] = (double)rotation[(9 * (lane / PAL_LANES) + i) * PAL_LANES + lane % PAL_LANES];
    return r[0] + r[4] + r[8] < 3;
}

bool pal_hex_single_rests(const pal_elastic_hexes_single *single)
{
    bool turned = false;
    double r[9];
    for (int e = 0; e < single->cubes->n_hex && single->rotation && !turned; e++)
        turned = read_rotation(single->rotation, single->cubes->simd_blocks.place[e], r);
    return !turned;
}

void pal_hex_single_element(const pal_elastic_hexes_single *single, const float *rotation, int e, double k,
                            double to[24][24])
{
    const int place = single->cubes->simd_blocks.place[e], block = place / PAL_LANES;
    const float *stiff = single->stiff + 2 * PAL_LANES * block + place % PAL_LANES;
    const double mu = (double)stiff[0], lambda = (double)stiff[PAL_LANES];
    double r[9];
    const bool turned = rotation && read_rotation(rotation, place, r);
    if (turned || pal_hex_is_cut(single->cubes, block)) {
        double part[36][9];
        pal_hex_matrix(single->cubes, place, mu, lambda, part);
        for (int p = 0; p < 36; p++) {
            for (int i = 0; i < 9; i++) part[p][i] *= k;
            if (turned) turn_block(r, part[p], part[p]);
        }
        spread(part, to);
    } else {
        for (int i = 0; i < 24; i++)
            for (int j = 0; j < 24; j++) to[i][j] = (mu * single->whole[0][i][j] + lambda * single->whole[1][i][j]) * k;
    }
    pal_hex_ground_block(single->cubes, e, k, to);
}
