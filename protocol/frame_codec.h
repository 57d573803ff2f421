/* FRAME: the shown vertices of one part, coded alone against the rest pose (protocol/README.md, "FRAME").
 *
 * Displacements are predicted in a coarse-to-fine order from the vertices already reconstructed, the rest is quantised
 * with step q (closed loop, so that errors do not add up), written as Rice codes in groups of 16 vertices and packed in
 * one LZ4 block. Every frame stands alone: it may be dropped, and any frame serves a client that joins.
 * Stated bound: |decoded - given| <= error_m per axis, for every vertex of every frame whose sent q was not raised
 * (pal_frame_result.error_m says the bound that holds). Hidden vertices have no residual: they cost next to nothing and
 * stand where their neighbours predict them. */
#ifndef PAL_PROTOCOL_FRAME_CODEC_H
#define PAL_PROTOCOL_FRAME_CODEC_H
#include "protocol/asset.h"
#include "protocol/frame_order.h"
#include "protocol/wire.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define PAL_FRAME_HEAD_BYTES   44 /* with the 8 bytes of pal_wire_head                                  */
#define PAL_FRAME_AFFINE_BYTES 48 /* 3x4 f32 behind the head when PAL_FRAME_HAS_AFFINE is set           */
#define PAL_FRAME_GROUP        16
#define PAL_FRAME_X_LIMIT      (1 << 18) /* |X| is below this, X the reconstruction in q/16             */
enum { PAL_FRAME_HAS_AFFINE = 1, PAL_FRAME_FLAGS = 1 };

typedef struct pal_frame_head {
    uint16_t part;
    uint8_t flags;
    uint32_t epoch; /* topology generation: names the asset the frame belongs to              */
    uint32_t seq;   /* of this part, grows from frame to frame by one or more */
    uint64_t sim_time_us;
    uint32_t cycle; /* messages of one simulation output share it; TOOLS closes it            */
    float q_m;      /* quantisation step m, > 0                                               */
    uint32_t n_vertex;
    uint32_t n_raw;   /* bytes of the body                                                      */
    uint32_t n_lz4;   /* bytes of the LZ4 block, the rest of the message                        */
    float affine[12]; /* row-major 3x4, shown = A (rest + u); identity without the flag         */
} pal_frame_head;

/* bytes that any frame of n_vertex vertices fits in, for the buffer handed to pal_frame_put */
size_t pal_frame_bound(uint32_t n_vertex);

/* what the caller says of a frame */
typedef struct pal_frame_input {
    uint16_t part;
    uint32_t epoch, seq, cycle;
    uint64_t sim_time_us;
    double error_m;          /* wanted largest error per axis, > 0                                         */
    const float *position_m; /* shown vertices in the asset's vertex order, borrowed  [n_vertex][3]        */
    const float *affine;     /* NULL, or an invertible 3x4 that takes most of a large motion, borrowed [12] */
    const uint8_t *hidden;   /* NULL, or not 0: in no triangle now, its position is never read, borrowed [n_vertex] */
} pal_frame_input;
typedef struct pal_frame_result {
    size_t n_byte;  /* of the message in dst                                                               */
    double error_m; /* bound that holds; larger than asked when the range forced a larger q                */
    bool changed;   /* the client would see a difference to the last frame this encoder put (true at first):
                       a part at rest need not be sent, and then its seq should not grow. Where other vertices are
                       hidden than in the last frame sent, the caller sends it in any case                 */
} pal_frame_result;

typedef struct pal_frame_encoder pal_frame_encoder;
/* [load] copies rest pose and order; one encoder per part and accuracy, used by one thread at a time */
int pal_frame_encoder_create(const float *rest_m, const pal_frame_order *order, pal_frame_encoder **out);
void pal_frame_encoder_destroy(pal_frame_encoder *e); /* NULL allowed */
/* [any] one whole FRAME message into dst; allocates nothing. NAN: a position of a vertex that is not hidden is not
 * finite; SPACE: cap is less than pal_frame_bound(n_vertex); RANGE: error_m, affine or a displacement beyond any use.
 * On failure the encoder is as before the call. */
int pal_frame_put(pal_frame_encoder *e, const pal_frame_input *given, uint8_t *dst, size_t cap,
                  pal_frame_result *result);

/* [any] head of a FRAME message, lengths checked against n_byte */
int pal_frame_get_head(const uint8_t *bytes, size_t n_byte, pal_frame_head *out);

typedef struct pal_frame_decoder pal_frame_decoder;
/* [load] copies rest pose and order out of a checked asset; used by one thread at a time */
int pal_frame_decoder_create(const pal_asset *asset, pal_frame_decoder **out);
void pal_frame_decoder_destroy(pal_frame_decoder *d); /* NULL allowed */
/* [any] decodes an untrusted FRAME message into position_m [n_vertex][3] in the asset's vertex order (may be NULL: only
 * checks); allocates nothing. The caller compares head.epoch and head.part before; COUNT: n_vertex is not the
 * asset's. On failure position_m may be partly written, *head is not. */
int pal_frame_get(pal_frame_decoder *d, const uint8_t *bytes, size_t n_byte, pal_frame_head *head, float *position_m);
#endif
