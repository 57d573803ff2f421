/* FRAME encoder and decoder (protocol/README.md, "FRAME").
 *
 * X, the reconstruction in q/16, is kept as four int32 per vertex (the fourth unused), so that one 16-byte load serves
 * a neighbour on all axes. Prediction needs |sum w X| < 2^31: |X| < 2^18 and sum |w| <= 8191 give it; the encoder
 * raises q until X fits, the decoder computes modulo 2^32 and refuses a frame in which any X left the range. Rice codes
 * are taken from the low end of a 64-bit word; the longest code, the escape, has 37 bits. */
#include "protocol/frame_codec.h"

#include "protocol/bytes.h"

#include <lz4.h>
#include <math.h>
#include <stdlib.h>

enum {
    GROUP = PAL_FRAME_GROUP,
    QUOTIENT_MAX = 12, /* zeros that announce an escape */
    ESCAPE_BITS = 24,
    ESCAPE_LENGTH = QUOTIENT_MAX + 1 + ESCAPE_BITS,
    K_SMALL = 7,    /* modes 0..6: k = mode, every vertex has codes                                          */
    MODE_MASK = 7,  /* modes 7..13: k = mode - 7, a mask says which vertices have codes                      */
    MODE_WIDE = 14, /* k in the next 4 bits, every vertex has codes                                          */
    MODE_ZERO = 15, /* all residuals of the group are zero                                                   */
    K_MAX = 15,
    TAIL = 8,                                        /* zero bytes behind the codes */
    SLACK = GROUP * (3 * ESCAPE_LENGTH + 1) / 8 + 16 /* a group may be read past the end before that is noticed */
};
#define Q_RATIO (1 + 1.0 / 16 + 1.0 / 64) /* q = 2 e / Q_RATIO */
#define Q_MAX_M 1e9f
#define X_ROOM  (PAL_FRAME_X_LIMIT - 32) /* wanted |u| 16/q is kept below this */

typedef int32_t int4 __attribute__((vector_size(16)));
typedef uint32_t uint4 __attribute__((vector_size(16)));
typedef float float4 __attribute__((vector_size(16)));
typedef double double4 __attribute__((vector_size(32)));

typedef struct predictor { /* of one vertex, 24 bytes */
    uint32_t neighbour[4];
    int16_t weight[4];
} predictor;

/* what encoder and decoder share */
typedef struct tables {
    uint32_t n;
    uint32_t *vertex_of;
    predictor *predict; /* [n]                */
    float4 *rest;       /* wire order         [n] */
    int4 *x;            /* reconstruction     [n] */
} tables;

struct pal_frame_encoder {
    tables t;
    float4 *u;          /* displacement m, wire order    [n]             */
    uint32_t *residual; /* folded, zero past the end    [groups * GROUP][3] */
    uint8_t *raw;
    void *lz4_state;
    double rest_max_m; /* largest |component| of the rest pose */
    float q_before;
    float affine_before[12];
    bool any_before;
};

struct pal_frame_decoder {
    tables t;
    uint8_t *raw;
    size_t raw_cap;
};

static size_t group_count(uint32_t n_vertex)
{
    return ((size_t)n_vertex + GROUP - 1) / GROUP;
}

static size_t parameter_bytes(uint32_t n_vertex)
{
    return (group_count(n_vertex) + 1) / 2;
}

static size_t raw_bound(uint32_t n_vertex)
{
    return parameter_bytes(n_vertex) + (((size_t)n_vertex * 3 * ESCAPE_LENGTH + 7) / 8 + 2 * group_count(n_vertex)) +
           TAIL;
}

size_t pal_frame_bound(uint32_t n_vertex)
{
    if (n_vertex > PAL_WIRE_VERTEX_MAX) return 0;
    return PAL_FRAME_HEAD_BYTES + PAL_FRAME_AFFINE_BYTES + (size_t)LZ4_compressBound((int)raw_bound(n_vertex));
}

static void *take(size_t n, size_t size)
{
    size_t n_byte = (n * size + 63) / 64 * 64;
    void *block = aligned_alloc(64, n_byte ? n_byte : 64);
    if (block) memset(block, 0, n_byte ? n_byte : 64);
    return block;
}

static bool tables_create(tables *t, const float *rest_m, const pal_frame_order *order)
{
    size_t n = order->n_vertex;
    t->n = order->n_vertex;
    t->vertex_of = take(n, sizeof *t->vertex_of);
    t->predict = take(n, sizeof *t->predict);
    t->rest = take(n, sizeof *t->rest);
    t->x = take(n, sizeof *t->x);
    if (!t->vertex_of || !t->predict || !t->rest || !t->x) return false;
    memcpy(t->vertex_of, order->vertex_of, n * sizeof *t->vertex_of);
    for (size_t i = 0; i < n; i++) {
        const float *rest = rest_m + 3 * (size_t)order->vertex_of[i];
        t->rest[i] = (float4){rest[0], rest[1], rest[2], 0};
        memcpy(t->predict[i].neighbour, order->neighbour + 4 * i, sizeof t->predict[i].neighbour);
        memcpy(t->predict[i].weight, order->weight + 4 * i, sizeof t->predict[i].weight);
    }
    return true;
}

static void tables_release(tables *t)
{
    free(t->vertex_of);
    free(t->predict);
    free(t->rest);
    free(t->x);
}

/* prediction of one vertex; modulo 2^32, so hostile frames overflow nothing */
static inline int4 predicted(const int4 *x, const predictor *p)
{
    uint4 sum = {2048, 2048, 2048, 2048};
    for (int j = 0; j < 4; j++) sum += (uint4)x[p->neighbour[j]] * (uint32_t)(int32_t)p->weight[j];
    return (int4)sum >> 12;
}

int pal_frame_encoder_create(const float *rest_m, const pal_frame_order *order, pal_frame_encoder **out)
{
    int refusal = pal_frame_order_check(order);
    for (size_t i = 0; !refusal && i < 3 * (size_t)order->n_vertex; i++)
        if (!isfinite(rest_m[i])) refusal = PAL_REFUSAL_NAN;
    if (refusal) return refusal;
    pal_frame_encoder *e = calloc(1, sizeof *e);
    if (!e) return PAL_REFUSAL_MEMORY;
    e->u = take(order->n_vertex, sizeof *e->u);
    e->residual = take(group_count(order->n_vertex) * 3 * GROUP + 4, sizeof *e->residual);
    e->raw = take(raw_bound(order->n_vertex) + 8, 1);
    e->lz4_state = take((size_t)LZ4_sizeofState(), 1);
    if (!tables_create(&e->t, rest_m, order) || !e->u || !e->residual || !e->raw || !e->lz4_state) {
        pal_frame_encoder_destroy(e);
        return PAL_REFUSAL_MEMORY;
    }
    for (size_t i = 0; i < 3 * (size_t)order->n_vertex; i++)
        e->rest_max_m = fmax(e->rest_max_m, fabs((double)rest_m[i]));
    *out = e;
    return 0;
}

void pal_frame_encoder_destroy(pal_frame_encoder *e)
{
    if (!e) return;
    tables_release(&e->t);
    free(e->u);
    free(e->residual);
    free(e->raw);
    free(e->lz4_state);
    free(e);
}

/* inverse of a 3x4 affine map; false when it has none worth using */
static bool invert(const float a[12], double inverse[12])
{
    const double m[3][3] = {{(double)a[0], (double)a[1], (double)a[2]},
                            {(double)a[4], (double)a[5], (double)a[6]},
                            {(double)a[8], (double)a[9], (double)a[10]}};
    double cofactor[3][3], det = 0;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
            cofactor[r][c] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
        }
    for (int c = 0; c < 3; c++) det += m[0][c] * cofactor[0][c];
    if (!(fabs(det) > 1e-6) || !(fabs(det) < 1e6)) return false;
    for (int r = 0; r < 3; r++) {
        inverse[4 * r + 3] = 0;
        for (int c = 0; c < 3; c++) {
            inverse[4 * r + c] = cofactor[c][r] / det;
            inverse[4 * r + 3] -= inverse[4 * r + c] * (double)a[4 * c + 3];
        }
        if (!isfinite(inverse[4 * r + 3])) return false;
    }
    return true;
}

/* displacements in wire order, 0 where hidden; returns the largest |component| as float bits, >= 0x7f800000 when one is
 * not finite */
static uint32_t displace(pal_frame_encoder *e, const float *position_m, const double *inverse, const uint8_t *hidden)
{
    const tables *t = &e->t;
    uint4 largest = {0};
    for (uint32_t i = 0; i < t->n; i++) {
        if (hidden && hidden[t->vertex_of[i]]) {
            e->u[i] = (float4){0};
            continue;
        }
        const float *p = position_m + 3 * (size_t)t->vertex_of[i];
        float4 x = {p[0], p[1], p[2], 0};
        if (inverse)
            for (int r = 0; r < 3; r++)
                x[r] = (float)(inverse[4 * r] * (double)p[0] + inverse[4 * r + 1] * (double)p[1] +
                               inverse[4 * r + 2] * (double)p[2] + inverse[4 * r + 3]);
        float4 u = x - t->rest[i];
        uint4 size = (uint4)u & 0x7fffffffu;
        uint4 more = (uint4)(size > largest);
        largest = (size & more) | (largest & ~more);
        e->u[i] = u;
    }
    uint32_t all = largest[0];
    for (int c = 1; c < 3; c++)
        if (largest[c] > all) all = largest[c];
    return all;
}

/* step for the wanted bound, rounded down to a float; raised until every X is in range and the float rounding of
 * positions as large as reach_m stays within its share of the bound, rounded up then */
static float choose_q(double error_m, double largest_u, double reach_m)
{
    double q = 2 * error_m / Q_RATIO, min = fmax(16 * largest_u / X_ROOM, reach_m * 0x1p-16);
    float down = (float)fmax(q, min);
    if (q >= min) return (double)down > q ? nextafterf(down, 0) : down;
    return (double)down < min ? nextafterf(down, INFINITY) : down;
}

/* X of a hidden vertex is its prediction; a chain of predictors that extrapolate is kept in range */
static inline int4 within_range(int4 x)
{
    for (int c = 0; c < 3; c++) x[c] = x[c] > X_ROOM ? X_ROOM : x[c] < -X_ROOM ? -X_ROOM : x[c];
    return x;
}

/* closed loop: residuals of all vertices, X updated; true when X of one that is not hidden changed */
static inline __attribute__((always_inline)) bool quantise_all(pal_frame_encoder *e, double q, const uint8_t *hidden)
{
    const tables *t = &e->t;
    float scale = (float)(16 / q);
    /* adding 1.5 2^23 rounds to an integer that sits in the low bits */
    const float4 magic = {12582912.0f, 12582912.0f, 12582912.0f, 12582912.0f};
    uint4 changed = {0};
    for (uint32_t i = 0; i < t->n; i++) {
        int4 wanted = (int4)(e->u[i] * scale + magic) - (int4)magic;
        int4 guess = predicted(t->x, &t->predict[i]);
        bool unseen = hidden && hidden[t->vertex_of[i]];
        if (unseen) wanted = within_range(guess);
        int4 r = (wanted - guess + 8) >> 4;
        int4 x = guess + r * 16;
        uint4 folded = (uint4)r << 1 ^ (uint4)(r >> 31);
        if (!unseen) changed |= (uint4)(x ^ t->x[i]);
        t->x[i] = x;
        /* the fourth number is overwritten by the next vertex */
        memcpy(e->residual + 3 * (size_t)i, &folded, sizeof folded);
    }
    memset(e->residual + 3 * (size_t)t->n, 0, 4 * sizeof *e->residual);
    return (changed[0] | changed[1] | changed[2]) != 0;
}

static bool quantise(pal_frame_encoder *e, double q, const uint8_t *hidden)
{
    return hidden ? quantise_all(e, q, hidden) : quantise_all(e, q, NULL);
}

/* bits of n_code codes with parameter k, whose values that are not zero are among v[0..3 GROUP) */
static uint32_t cost(const uint32_t *v, uint32_t k, uint32_t n_code)
{
    uint32_t bits = n_code * (k + 1), escape = ESCAPE_LENGTH - 1 - k;
    for (int i = 0; i < 3 * GROUP; i++) {
        uint32_t quotient = v[i] >> k;
        bits += quotient < QUOTIENT_MAX ? quotient : escape;
    }
    return bits;
}

/* the best parameter up to most is next to log2 of the mean, or far below it when few large values are better escaped
 */
static uint32_t choose_k(const uint32_t *v, uint32_t sum, uint32_t n_code, uint32_t max, uint32_t *bits)
{
    uint32_t k = 0, next;
    while (k < max && n_code << (k + 1) <= sum) k++;
    *bits = cost(v, k, n_code);
    if (k < max && (next = cost(v, k + 1, n_code)) < *bits) {
        *bits = next;
        return k + 1;
    }
    while (k > 0 && (next = cost(v, k - 1, n_code)) < *bits) *bits = next, k--;
    return k;
}

typedef struct choice { /* how a group is written */
    uint32_t mode, k, mask;
} choice;

static choice choose_mode(const uint32_t *v, uint32_t n)
{
    uint32_t mask = 0, sum = 0, dense_bits, masked_bits = UINT32_MAX, masked_k = 0;
    for (uint32_t i = 0; i < GROUP; i++) mask |= (uint32_t)((v[3 * i] | v[3 * i + 1] | v[3 * i + 2]) != 0) << i;
    for (int i = 0; i < 3 * GROUP; i++) sum += v[i];
    if (!mask) return (choice){MODE_ZERO, 0, 0};
    uint32_t k = choose_k(v, sum, 3 * n, K_MAX, &dense_bits), n_coded = (uint32_t)__builtin_popcount(mask);
    if (n_coded < n) masked_k = choose_k(v, sum, 3 * n_coded, K_SMALL - 1, &masked_bits);
    if (masked_bits < UINT32_MAX && masked_bits + n < dense_bits) return (choice){MODE_MASK + masked_k, masked_k, mask};
    return (choice){k < K_SMALL ? k : MODE_WIDE, k, (1u << n) - 1};
}

typedef struct bit_writer {
    uint8_t *at;
    uint64_t word; /* bits not yet written, low end first */
    unsigned n;    /* < 8 between codes */
} bit_writer;

static inline void flush(bit_writer *w)
{
    pal_put_u64(w->at, w->word);
    w->at += w->n >> 3;
    w->word >>= w->n & ~7u;
    w->n &= 7;
}

static inline void write_bits(bit_writer *w, uint64_t bits, unsigned n)
{
    w->word |= bits << w->n;
    w->n += n;
    flush(w);
}

/* what precedes the codes, then three codes for each vertex of the mask */
static void write_group(bit_writer *out, const uint32_t *v, uint32_t n, choice how)
{
    bit_writer w = *out;
    uint32_t k = how.k, low = (1u << k) - 1;
    if (how.mode == MODE_WIDE) write_bits(&w, k, 4);
    if (how.mode >= MODE_MASK && how.mode < MODE_WIDE) write_bits(&w, how.mask, n);
    for (uint32_t i = 0; i < n; i++) {
        if (!(how.mask >> i & 1)) continue;
        for (uint32_t c = 0; c < 3; c++) {
            uint32_t value = v[3 * i + c], quotient = value >> k;
            if (quotient < QUOTIENT_MAX)
                write_bits(&w, (uint64_t)1 << quotient | (uint64_t)(value & low) << (quotient + 1), quotient + 1 + k);
            else
                write_bits(&w, (uint64_t)1 << QUOTIENT_MAX | (uint64_t)value << (QUOTIENT_MAX + 1), ESCAPE_LENGTH);
        }
    }
    *out = w;
}

/* body of the frame from the residuals; returns its bytes */
static size_t write_body(const pal_frame_encoder *e)
{
    uint32_t n = e->t.n;
    size_t n_group = group_count(n), n_parameter = parameter_bytes(n);
    bit_writer w = {e->raw + n_parameter, 0, 0};
    memset(e->raw, 0, n_parameter);
    for (size_t g = 0; g < n_group; g++) {
        uint32_t n_here = g + 1 < n_group ? GROUP : n - (uint32_t)g * GROUP;
        const uint32_t *v = e->residual + g * 3 * GROUP;
        choice how = choose_mode(v, n_here);
        e->raw[g / 2] |= (uint8_t)(how.mode << 4 * (g % 2));
        if (how.mode != MODE_ZERO) write_group(&w, v, n_here, how);
    }
    if (w.n) {
        w.n = 8;
        flush(&w);
    }
    memset(w.at, 0, TAIL);
    return (size_t)(w.at + TAIL - e->raw);
}

static void write_head(uint8_t *dst, const pal_frame_head *head)
{
    pal_wire_put_head(dst, PAL_WIRE_FRAME, head->flags, head->part);
    pal_put_u32(dst + 8, head->epoch);
    pal_put_u32(dst + 12, head->seq);
    pal_put_u64(dst + 16, head->sim_time_us);
    pal_put_u32(dst + 24, head->cycle);
    pal_put_f32(dst + 28, head->q_m);
    pal_put_u32(dst + 32, head->n_vertex);
    pal_put_u32(dst + 36, head->n_raw);
    pal_put_u32(dst + 40, head->n_lz4);
    for (int i = 0; i < 12 && head->flags & PAL_FRAME_HAS_AFFINE; i++)
        pal_put_f32(dst + PAL_FRAME_HEAD_BYTES + 4 * i, head->affine[i]);
}

/* how much the map enlarges an error per axis */
static double enlargement(const float affine[12])
{
    double max = 0;
    for (int r = 0; r < 3; r++) {
        double row = 0;
        for (int c = 0; c < 3; c++) row += fabs((double)affine[4 * r + c]);
        if (row > max) max = row;
    }
    return max;
}

int pal_frame_put(pal_frame_encoder *e, const pal_frame_input *given, uint8_t *dst, size_t cap,
                  pal_frame_result *result)
{
    double inverse[12], enlarge = 1;
    pal_frame_head head = {.part = given->part, .epoch = given->epoch, .seq = given->seq, .cycle = given->cycle};
    if (cap < pal_frame_bound(e->t.n)) return PAL_REFUSAL_SPACE;
    if (!(given->error_m > 1e-12 && given->error_m < 1e6)) return PAL_REFUSAL_RANGE;
    if (given->affine) {
        if (!invert(given->affine, inverse)) return PAL_REFUSAL_RANGE;
        enlarge = enlargement(given->affine);
        head.flags = PAL_FRAME_HAS_AFFINE;
        memcpy(head.affine, given->affine, sizeof head.affine);
    }

    /* displacements, and a step that fits them; nothing is changed before all checks are done */
    uint32_t bits = displace(e, given->position_m, given->affine ? inverse : NULL, given->hidden);
    if (bits >= 0x7f800000u) return PAL_REFUSAL_NAN;
    float largest;
    memcpy(&largest, &bits, sizeof largest);
    double reach = e->rest_max_m + (double)largest;
    if (given->affine) {
        double shift = fabs((double)head.affine[3]) + fabs((double)head.affine[7]) + fabs((double)head.affine[11]);
        reach = 2 * reach + shift / enlarge;
    }
    head.q_m = choose_q(given->error_m / enlarge, (double)largest, reach);
    if (head.q_m > Q_MAX_M) return PAL_REFUSAL_RANGE;

    bool same = e->any_before && head.q_m == e->q_before && !memcmp(head.affine, e->affine_before, sizeof head.affine);
    result->changed = quantise(e, (double)head.q_m, given->hidden) || !same;
    e->any_before = true;
    e->q_before = head.q_m;
    memcpy(e->affine_before, head.affine, sizeof head.affine);

    size_t n_raw = write_body(e), at = PAL_FRAME_HEAD_BYTES + (head.flags ? PAL_FRAME_AFFINE_BYTES : 0);
    int n_lz4 = LZ4_compress_fast_extState(e->lz4_state, (const char *)e->raw, (char *)dst + at, (int)n_raw,
                                           (int)(cap - at), 1);
    head.sim_time_us = given->sim_time_us;
    head.n_vertex = e->t.n;
    head.n_raw = (uint32_t)n_raw;
    head.n_lz4 = (uint32_t)n_lz4;
    write_head(dst, &head);
    result->n_byte = at + (size_t)n_lz4;
    result->error_m = (double)head.q_m / 2 * Q_RATIO * enlarge;
    return 0;
}

int pal_frame_get_head(const uint8_t *bytes, size_t n_byte, pal_frame_head *out)
{
    pal_wire_head wire;
    int refusal = pal_wire_get_head_of(bytes, n_byte, PAL_WIRE_FRAME, PAL_FRAME_FLAGS, &wire);
    if (refusal) return refusal;
    size_t at = PAL_FRAME_HEAD_BYTES + (wire.flags ? PAL_FRAME_AFFINE_BYTES : 0);
    if (n_byte < at) return PAL_REFUSAL_SHORT;
    pal_frame_head head = {.part = wire.index,
                           .flags = wire.flags,
                           .epoch = pal_get_u32(bytes + 8),
                           .seq = pal_get_u32(bytes + 12),
                           .sim_time_us = pal_get_u64(bytes + 16),
                           .cycle = pal_get_u32(bytes + 24),
                           .q_m = pal_get_f32(bytes + 28),
                           .n_vertex = pal_get_u32(bytes + 32),
                           .n_raw = pal_get_u32(bytes + 36),
                           .n_lz4 = pal_get_u32(bytes + 40),
                           .affine = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    if (head.n_lz4 != n_byte - at) return head.n_lz4 > n_byte - at ? PAL_REFUSAL_SHORT : PAL_REFUSAL_LONG;
    if (head.part >= PAL_WIRE_PART_MAX || head.sim_time_us >> 53) return PAL_REFUSAL_RANGE;
    if (!isfinite(head.q_m)) return PAL_REFUSAL_NAN;
    if (!(head.q_m > 0)) return PAL_REFUSAL_RANGE;
    if (head.n_vertex == 0 || head.n_vertex > PAL_WIRE_VERTEX_MAX) return PAL_REFUSAL_COUNT;
    if (head.n_raw < parameter_bytes(head.n_vertex) + TAIL || head.n_raw > raw_bound(head.n_vertex))
        return PAL_REFUSAL_COUNT;
    for (int i = 0; i < 12 && wire.flags; i++) {
        head.affine[i] = pal_get_f32(bytes + PAL_FRAME_HEAD_BYTES + 4 * i);
        if (!isfinite(head.affine[i])) return PAL_REFUSAL_NAN;
    }
    *out = head;
    return 0;
}

int pal_frame_decoder_create(const pal_asset *asset, pal_frame_decoder **out)
{
    pal_frame_decoder *d = calloc(1, sizeof *d);
    if (!d) return PAL_REFUSAL_MEMORY;
    d->raw_cap = raw_bound(asset->order->n_vertex);
    d->raw = take(d->raw_cap + SLACK, 1);
    if (!tables_create(&d->t, asset->rest_m, asset->order) || !d->raw) {
        pal_frame_decoder_destroy(d);
        return PAL_REFUSAL_MEMORY;
    }
    *out = d;
    return 0;
}

void pal_frame_decoder_destroy(pal_frame_decoder *d)
{
    if (!d) return;
    tables_release(&d->t);
    free(d->raw);
    free(d);
}

static inline uint64_t bits_at(const uint8_t *codes, size_t bit)
{
    return pal_get_u64(codes + (bit >> 3)) >> (bit & 7);
}

/* three codes from bit position `bit`; returns the position behind, 0 for a code that is none */
static inline size_t read_vertex(const uint8_t *codes, size_t bit, uint32_t k, int32_t r[4])
{
    for (int c = 0; c < 3; c++) {
        uint64_t word = bits_at(codes, bit);
        uint32_t value, quotient = (uint32_t)__builtin_ctz((uint32_t)word | 1u << 31);
        if (quotient < QUOTIENT_MAX) {
            value = quotient << k | ((uint32_t)(word >> (quotient + 1)) & ((1u << k) - 1));
            bit += quotient + 1 + k;
        } else {
            if (quotient != QUOTIENT_MAX) return 0;
            value = (uint32_t)(word >> (QUOTIENT_MAX + 1)) & ((1u << ESCAPE_BITS) - 1);
            bit += ESCAPE_LENGTH;
        }
        r[c] = (int32_t)(value >> 1) ^ -(int32_t)(value & 1);
    }
    return bit;
}

/* residuals of one group, zeroed before, from bit position `bit`; returns the position behind, SIZE_MAX for a code that
 * is none. Reads at most SLACK bytes past the start. */
static inline size_t read_group(const uint8_t *codes, size_t bit, uint32_t mode, uint32_t n, int32_t (*r)[4])
{
    uint32_t k = mode, mask = (1u << n) - 1;
    if (mode == MODE_WIDE) {
        k = bits_at(codes, bit) & 15;
        bit += 4;
    } else if (mode >= MODE_MASK) {
        k = mode - MODE_MASK;
        mask &= (uint32_t)bits_at(codes, bit);
        bit += n;
    }
    for (; mask; mask &= mask - 1) {
        bit = read_vertex(codes, bit, k, r[__builtin_ctz(mask)]);
        if (bit == 0) return SIZE_MAX;
    }
    return bit;
}

static inline void store_position(float *out, float4 rest, int4 x, double step)
{
    double4 wide = __builtin_convertvector(rest, double4) + __builtin_convertvector(x, double4) * step;
    float4 p = __builtin_convertvector(wide, float4);
    memcpy(out, &p, 3 * sizeof *out);
}

/* body to X and positions; refuses codes that end early or late and X out of range */
static int read_body(pal_frame_decoder *d, size_t n_raw, double step, float *position_m)
{
    const tables *t = &d->t;
    size_t n_group = group_count(t->n), n_parameter = parameter_bytes(t->n), bit = 0;
    size_t n_bit = 8 * (n_raw - n_parameter - TAIL);
    const uint8_t *codes = d->raw + n_parameter;
    uint4 outside = {0};
    for (size_t g = 0; g < n_group; g++) {
        int32_t residual[GROUP][4] __attribute__((aligned(16)));
        uint32_t first = (uint32_t)g * GROUP, n_here = g + 1 < n_group ? GROUP : t->n - first;
        memset(residual, 0, sizeof residual);
        uint32_t mode = d->raw[g / 2] >> 4 * (g % 2) & 15;
        if (mode != MODE_ZERO) {
            bit = read_group(codes, bit, mode, n_here, residual);
            if (bit > n_bit) return PAL_REFUSAL_COUNT;
        }
        for (uint32_t i = 0; i < n_here; i++) {
            int4 r;
            memcpy(&r, residual[i], sizeof r);
            int4 x = (int4)((uint4)predicted(t->x, &t->predict[first + i]) + (uint4)r * 16u);
            outside |= (uint4)((uint4)x + (PAL_FRAME_X_LIMIT - 1) > (uint32_t)(2 * PAL_FRAME_X_LIMIT - 2));
            t->x[first + i] = x;
            if (position_m)
                store_position(position_m + 3 * (size_t)t->vertex_of[first + i], t->rest[first + i], x, step);
        }
    }
    if (outside[0] | outside[1] | outside[2]) return PAL_REFUSAL_RANGE;
    return (bit + 7) / 8 * 8 == n_bit ? PAL_REFUSAL_NONE : PAL_REFUSAL_COUNT;
}

/* the affine map takes the exact double position, so positions are computed anew from X */
static void store_affine(const tables *t, const float a[12], double step, float *position_m)
{
    for (uint32_t i = 0; i < t->n; i++) {
        double p[3];
        float *out = position_m + 3 * (size_t)t->vertex_of[i];
        for (int c = 0; c < 3; c++) p[c] = (double)t->rest[i][c] + (double)t->x[i][c] * step;
        for (int r = 0; r < 3; r++)
            out[r] = (float)((double)a[4 * r] * p[0] + (double)a[4 * r + 1] * p[1] + (double)a[4 * r + 2] * p[2] +
                             (double)a[4 * r + 3]);
    }
}

int pal_frame_get(pal_frame_decoder *d, const uint8_t *bytes, size_t n_byte, pal_frame_head *head, float *position_m)
{
    pal_frame_head h;
    int refusal = pal_frame_get_head(bytes, n_byte, &h);
    if (refusal) return refusal;
    if (h.n_vertex != d->t.n) return PAL_REFUSAL_COUNT;
    if (LZ4_decompress_safe((const char *)bytes + n_byte - h.n_lz4, (char *)d->raw, (int)h.n_lz4, (int)h.n_raw) !=
        (int)h.n_raw)
        return PAL_REFUSAL_LZ4;
    memset(d->raw + h.n_raw, 0, SLACK);
    double step = (double)h.q_m / 16;
    bool affine = h.flags & PAL_FRAME_HAS_AFFINE;
    refusal = read_body(d, h.n_raw, step, affine ? NULL : position_m);
    if (refusal) return refusal;
    if (affine && position_m) store_affine(&d->t, h.affine, step, position_m);
    *head = h;
    return 0;
}
