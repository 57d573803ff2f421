/* Brushes: forces that a hand has on a body while it sculpts (A 4.1, Fig. 9), held by a tool's slot each, set and ended
 * between steps (brush_components.h, world.h). All of a body's brushes are one CONTACT row, `brush`, with memory of its
 * own.
 *
 * Force, pressure and lift begin, follow a change and end over PAL_BLEND_BRUSH_S (blend.h) each. Bodies
 * whose shown vertices are nodes have brushes; those that adapt or have a skin do not. [sim], heap only in set and
 * destroy. */
#ifndef PAL_SIM_CORE_BRUSH_H
#define PAL_SIM_CORE_BRUSH_H
#include "server/sim/core/effect.h"

typedef enum pal_brush_kind {
    PAL_BRUSH_NONE,    /* ends the slot's brush */
    PAL_BRUSH_INFLATE, /* pressure along the normals of the shown triangles as they are now, on twice their area at rest
                          at most, times the weight at rest of their middle: that of a stroke (pal_stroke) of at_m,
                          radius_m, soft */
    PAL_BRUSH_CURVE,   /* a handle from at_m to to_m (Fig. 9a): springs pull the shown nodes within radius_m of it at
                          rest to where they were when it began, plus lift 4 t (1 - t), t = 0..1 along it */
    PAL_BRUSH_COUNT
} pal_brush_kind;

typedef struct pal_brush {
    pal_brush_kind kind;
    double at_m[3], to_m[3]; /* on the surface at rest, body frame; INFLATE: at_m alone             */
    double radius_m, soft;   /* of the weight 0..1, as of a stroke                                  */
    double pressure_Pa;      /* INFLATE; < 0 deflates                                               */
    double lift_m[3];        /* CURVE: way of the handle's middle                                   */
    double stiffness_N_m;    /* CURVE: of the whole handle, spread over its nodes by their weight   */
} pal_brush;

/* numbers of any body; REFUSED names the one out of range [any] */
pal_err pal_brush_check(const pal_brush *brush, pal_diagnostic *diag);

/* the row; it is no entry of scenes */
extern const pal_effect pal_effect_brush;
/* an empty one. REFUSED: the body has no brushes; MEMORY */
pal_err pal_brush_make(const pal_body *body, pal_arena *arena, pal_diagnostic *diag, void **self);
/* A slot's brush; one of the same kind at the same places goes on with its new numbers, another begins in its place.
 * REFUSED: a number, nothing of the body within reach, a handle stiffer than the body's nodes take, a pressure above
 * 10 E; MEMORY. Nothing has changed then */
pal_err pal_brush_set(void *self, const pal_body *body, int slot, const pal_brush *brush, pal_diagnostic *diag);
/* The brushes of `before`, of another body with the same rest frame that stands in this one's place, go on here, as far
 * as they have come in: a pressure on the triangles within its reach; a handle pulls each of its nodes by what it
 * pulled the old ones near it by. A brush that this body does not take, or without memory, is over. Both stand still */
void pal_brush_hand(void *self, const pal_body *body, const void *before, const pal_body *from);
void pal_brush_end(void *self, int slot); /* goes out from now on; nothing when there is none */
bool pal_brush_gone(const void *self);    /* no brush acts any more */
size_t pal_brush_bytes(const void *self); /* memory of the slots    */
#endif
