/* `palpate bench protocol`: the cost of a frame, on a closed surface of 29,402 vertices in a box of 0.18 m at 60 frames
 * a second. Motions: `all` (a moving dent, a bend, a wave), `noise` (all and 0.02 mm of white noise), `sim` (a damped
 * surface of springs hit by a ball), `local` (about 5 % of the vertices), `rest`. Medians over the frames, thread time
 * of one core; the largest error of every frame is checked against the bound. */
#include "protocol/frame_codec.h"
#include "server/base/arena.h"
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/bench/bench.h"
#include "server/num/median.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FINENESS = 70, FRAMES = 60, MOTIONS = 5, BOUNDS = 6 };
static const char *const motion_name[MOTIONS] = {"all", "noise", "sim", "local", "rest"};
static const double bound_m[BOUNDS] = {1e-5, 2.5e-5, 5e-5, 1e-4, 2.5e-4, 5e-4};

typedef struct surface_model { /* surface, its springs, and the state of the `sim` motion */
    uint32_t n_vertex, n_triangle;
    float *rest_m;
    uint32_t *triangle;
    uint32_t *table; /* lattice point -> vertex + 1 */
    double *x, *v, *f;
} surface_model;

typedef struct bench {
    pal_arena *arena;
    surface_model s;
    pal_asset asset;
    pal_frame_encoder *encoder;
    pal_frame_decoder *decoder;
    float *given, *shown;
    uint8_t *bytes;
    size_t cap;
    double order_s, asset_s, asset_bytes;
    double byte_count[MOTIONS][BOUNDS], encode_s[MOTIONS][BOUNDS], decode_s[MOTIONS][BOUNDS], error_m[MOTIONS][BOUNDS];
} bench;

static double thread_s(void)
{
    return 1e-9 * (double)pal_clock_thread_ns();
}

/* vertex at a point of the cube's lattice, pushed out to a bumpy sphere */
static uint32_t lattice_vertex(surface_model *s, const int *p)
{
    uint32_t *slot = &s->table[(p[0] * (FINENESS + 1) + p[1]) * (FINENESS + 1) + p[2]];
    if (*slot == 0) {
        double d[3], r = 0;
        for (int c = 0; c < 3; c++) d[c] = tan((2.0 * p[c] / FINENESS - 1) * 0.7853981633974483), r += d[c] * d[c];
        for (int c = 0; c < 3; c++) d[c] /= sqrt(r);
        r = 0.075 * (1 + 0.12 * sin(7 * d[0] + 1) * cos(5 * d[1]) + 0.08 * sin(11 * d[2] + 3 * d[0]));
        for (int c = 0; c < 3; c++) s->rest_m[3 * s->n_vertex + (uint32_t)c] = (float)(r * d[c]);
        *slot = ++s->n_vertex;
    }
    return *slot - 1;
}

static void fill_surface(surface_model *s)
{
    for (int face = 0; face < 6; face++)
        for (int cell = 0; cell < FINENESS * FINENESS; cell++) {
            uint32_t corner[4];
            for (int k = 0; k < 4; k++) {
                int p[3], axis = face % 3, u = cell / FINENESS + (k == 1 || k == 2), v = cell % FINENESS + (k >= 2);
                p[axis] = face < 3 ? FINENESS : 0;
                p[(axis + 1) % 3] = face < 3 ? u : v;
                p[(axis + 2) % 3] = face < 3 ? v : u;
                corner[k] = lattice_vertex(s, p);
            }
            const uint32_t two[6] = {corner[0], corner[1], corner[2], corner[0], corner[2], corner[3]};
            memcpy(s->triangle + 3 * (size_t)s->n_triangle, two, sizeof two);
            s->n_triangle += 2;
        }
    for (size_t i = 0; i < 3 * (size_t)s->n_vertex; i++) s->x[i] = (double)s->rest_m[i];
}

/* one frame of the spring surface: edges of the triangles, a weak pull to rest, damping, a ball that goes in and out */
static void step_springs(surface_model *s, int frame)
{
    const double dt = 1.0 / 600, edge_k = 4000, home_k = 60, damping = 3;
    for (int sub = 0; sub < 10; sub++) {
        double t = (frame + sub / 10.0) / 60,
               ball[3] = {0.094 - 0.02 * sin(3 * t), 0.02 * sin(2 * t), 0.02 * cos(2 * t)};
        for (size_t i = 0; i < 3 * (size_t)s->n_vertex; i++)
            s->f[i] = home_k * ((double)s->rest_m[i] - s->x[i]) - damping * s->v[i];
        for (size_t e = 0; e < 3 * (size_t)s->n_triangle; e++) {
            size_t a = s->triangle[e], b = s->triangle[e % 3 == 2 ? e - 2 : e + 1];
            for (size_t c = 0; c < 3; c++) {
                double u = s->x[3 * b + c] - s->x[3 * a + c] - (double)(s->rest_m[3 * b + c] - s->rest_m[3 * a + c]);
                s->f[3 * a + c] += edge_k * u;
                s->f[3 * b + c] -= edge_k * u;
            }
        }
        for (size_t i = 0; i < s->n_vertex; i++) {
            double d[3];
            pal_sub3(d, s->x + 3 * i, ball);
            const double r = pal_norm3(d);
            for (size_t c = 0; c < 3; c++) {
                double push = r < 0.025 && r > 0 ? 20000 * (0.025 - r) * d[c] / r : 0;
                s->v[3 * i + c] += dt * (s->f[3 * i + c] + push);
                s->x[3 * i + c] += dt * s->v[3 * i + c];
            }
        }
    }
}

static void deform(bench *b, int motion, int frame)
{
    surface_model *s = &b->s;
    double t = frame / 60.0, centre[3] = {0.07 * cos(2 * t), 0.07 * sin(2 * t), 0.03 * sin(3 * t)};
    uint64_t random = 77 + (uint64_t)frame * 1000003;
    if (motion == 2) step_springs(s, frame);
    for (size_t i = 0; i < s->n_vertex; i++) {
        double x[3], d2 = 0, width = motion == 3 ? 0.012 : 0.03;
        for (size_t c = 0; c < 3; c++) x[c] = motion == 2 ? s->x[3 * i + c] : (double)s->rest_m[3 * i + c];
        for (int c = 0; c < 3; c++) d2 += (x[c] - centre[c]) * (x[c] - centre[c]);
        double dent = motion == 2 || motion == 4 ? 0 : 0.008 * exp(-d2 / (width * width));
        if (motion == 3 && dent < 1e-5) dent = 0;
        for (int c = 0; c < 3; c++) x[c] -= dent * centre[c] / 0.075;
        if (motion < 2) {
            double angle = 0.1745 * sin(t) * x[2] / 0.075, a = x[0] * cos(angle) - x[1] * sin(angle);
            x[1] = x[0] * sin(angle) + x[1] * cos(angle);
            x[0] = a;
            x[2] += 3e-4 * sin(40 * x[0] + 9 * t) * cos(35 * x[1]);
        }
        for (size_t c = 0; c < 3; c++) {
            random = random * 6364136223846793005u + 1442695040888963407u;
            if (motion == 1) x[c] += 2e-5 * (double)(int32_t)(random >> 32) / 2147483648.0;
            b->given[3 * i + c] = (float)x[c];
        }
    }
}

static int measure_motion(bench *b, int motion)
{
    double encode[BOUNDS][FRAMES], decode[BOUNDS][FRAMES];
    for (int k = 0; k < FRAMES; k++) {
        deform(b, motion, k);
        for (int e = 0; e < BOUNDS; e++) {
            const pal_frame_input given = {.seq = (uint32_t)k, .error_m = bound_m[e], .position_m = b->given};
            pal_frame_result result;
            pal_frame_head head;
            double begin = thread_s();
            int refusal = pal_frame_put(b->encoder, &given, b->bytes, b->cap, &result);
            double middle = thread_s();
            if (!refusal) refusal = pal_frame_get(b->decoder, b->bytes, result.n_byte, &head, b->shown);
            encode[e][k] = middle - begin;
            decode[e][k] = thread_s() - middle;
            if (refusal) return refusal;
            b->byte_count[motion][e] += (double)result.n_byte / FRAMES;
            for (size_t i = 0; i < 3 * (size_t)b->s.n_vertex; i++)
                b->error_m[motion][e] = fmax(b->error_m[motion][e], fabs((double)b->given[i] - (double)b->shown[i]));
        }
    }
    for (int e = 0; e < BOUNDS; e++) {
        b->encode_s[motion][e] = pal_median(encode[e], FRAMES);
        b->decode_s[motion][e] = pal_median(decode[e], FRAMES);
        if (b->error_m[motion][e] > bound_m[e]) return PAL_REFUSAL_RANGE;
    }
    return 0;
}

static int prepare(bench *b)
{
    surface_model *s = &b->s;
    const size_t n = 6 * (size_t)FINENESS * FINENESS + 2, line = FINENESS + 1;
    b->cap = pal_frame_bound((uint32_t)n);
    b->arena = pal_arena_create(1 << 20, true);
    if (!b->arena || !(s->rest_m = PAL_NEW(b->arena, float, 3 * n)) ||
        !(s->triangle = PAL_NEW(b->arena, uint32_t, 6 * n)) ||
        !(s->table = PAL_NEW(b->arena, uint32_t, line * line * line)) ||
        !(b->given = PAL_NEW(b->arena, float, 3 * n)) || !(b->shown = PAL_NEW(b->arena, float, 3 * n)) ||
        !(b->bytes = PAL_NEW(b->arena, uint8_t, b->cap)) || !PAL_NEW_DOUBLES(b->arena, 3 * n, &s->x, &s->v, &s->f))
        return PAL_REFUSAL_MEMORY;
    fill_surface(s);

    double begin = thread_s();
    int refusal = pal_frame_order_create(s->rest_m, s->n_vertex, s->triangle, s->n_triangle, &b->asset.order);
    double middle = thread_s();
    uint8_t *bytes = NULL;
    size_t n_byte = 0;
    if (!refusal)
        refusal = pal_asset_encode(s->rest_m, NULL, NULL, b->asset.order, s->triangle, s->n_triangle, &bytes, &n_byte);
    free(bytes);
    b->order_s = middle - begin;
    b->asset_s = thread_s() - middle;
    b->asset_bytes = (double)n_byte;
    b->asset.rest_m = s->rest_m;
    b->asset.triangle = s->triangle;
    b->asset.n_triangle = s->n_triangle;
    if (!refusal) refusal = pal_frame_encoder_create(s->rest_m, b->asset.order, &b->encoder);
    if (!refusal) refusal = pal_frame_decoder_create(&b->asset, &b->decoder);
    return refusal;
}

static void report(pal_table *r, const bench *b)
{
    double n = b->s.n_vertex;
    TABLE_ROW(r, VALUE("vertices", n), VALUE("triangles", b->s.n_triangle), VALUE("order_s", b->order_s),
              VALUE("asset_s", b->asset_s), VALUE("asset_bytes", b->asset_bytes));
    pal_table_note(r, "%.0f vertices, %u triangles; order %.0f ms, asset %.0f ms, %.0f kB (%.1f bytes a vertex)", n,
                   b->s.n_triangle, 1e3 * b->order_s, 1e3 * b->asset_s, b->asset_bytes / 1e3, b->asset_bytes / n);
    pal_table_list(r, "motions");
    for (int m = 0; m < MOTIONS; m++)
        for (int e = 0; e < BOUNDS; e++)
            TABLE_ROW(r, TEXT("motion", "motion", -8, motion_name[m]), NUMBER("bound_m", "bound m", 10, 6, bound_m[e]),
                      NUMBER("bytes", "bytes", 8, 0, b->byte_count[m][e]),
                      NUMBER(NULL, "bytes/vertex", 12, 3, b->byte_count[m][e] / n),
                      NUMBER("encode_ms", "encode ms", 10, 3, 1e3 * b->encode_s[m][e]),
                      NUMBER("decode_ms", "decode ms", 10, 3, 1e3 * b->decode_s[m][e]),
                      NUMBER("max_error_m", "max error m", 12, 7, b->error_m[m][e]));
}

pal_err bench_protocol(pal_table *r, pal_diagnostic *diag)
{
    static bench b;
    int refusal = prepare(&b);
    for (int m = 0; m < MOTIONS && !refusal; m++) refusal = measure_motion(&b, m);
    if (!refusal) report(r, &b);
    pal_frame_encoder_destroy(b.encoder);
    pal_frame_decoder_destroy(b.decoder);
    pal_frame_order_destroy(b.asset.order);
    pal_arena_destroy(b.arena);
    return refusal ? pal_diagnostic_set(diag, PAL_ERR_INTERNAL, "%s", pal_refusal_text(refusal)) : PAL_ERR_OK;
}
