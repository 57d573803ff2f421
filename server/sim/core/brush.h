/* Brushes: forces that a member exerts on a body while sculpting (paper A section 4.1, fig. 9), one for each tool slot,
 * set and ended between steps (inserted_components.h, world.h). All brushes of a body are one CONTACT component,
 * `brush`, with memory of its own.
 *
 * Force, pressure and lift begin, follow a change and end over PAL_BLEND_S (blend.h) each. A body has brushes
 * when its shown vertices are nodes and its topology is constant. Thread: [sim]; heap only in set and destroy. */
#ifndef PAL_SIM_CORE_BRUSH_H
#define PAL_SIM_CORE_BRUSH_H
#include "server/sim/core/effect.h"

typedef enum pal_brush_kind {
    PAL_BRUSH_NONE,    /* ends the slot's brush */
    PAL_BRUSH_INFLATE, /* pressure along the present normals of the shown triangles, on at most twice their area at
                          rest, times the weight of their middle at rest: that of a stroke (pal_stroke) of at_m,
                          radius_m, softness */
    PAL_BRUSH_CURVE, /* a handle from at_m to to_m (fig. 9a): springs pull the shown nodes within radius_m of it at rest
                        to where they were at its begin, plus lift 4 t (1 - t), t = 0 to 1 along it */
    PAL_BRUSH_COUNT
} pal_brush_kind;

typedef struct pal_brush {
    pal_brush_kind kind;
    double at_m[3], to_m[3];   /* on the surface at rest, body frame; INFLATE: at_m alone             */
    double radius_m, softness; /* of the weight 0..1, as of a stroke                                  */
    double pressure_Pa;        /* INFLATE; < 0 deflates                                               */
    double lift_m[3];          /* CURVE: displacement of the handle's middle                         */
    double stiffness_N_m;      /* CURVE: of the whole handle, spread over its nodes by their weight   */
} pal_brush;

/* checks that hold for any body; REFUSED names the number out of range [any] */
pal_err pal_brush_check(const pal_brush *brush, pal_diagnostic *diag);

/* the component; scenes have no such entry */
extern const pal_effect pal_effect_brush;
/* an empty one. REFUSED: the body has no brushes; MEMORY */
pal_err pal_brush_make(const pal_body *body, pal_arena *arena, pal_diagnostic *diag, void **self);
/* Sets the brush of a slot; one of the same kind at the same place takes over the new numbers, another one replaces it.
 * REFUSED: a number out of range, nothing of the body within reach, a handle stiffer than its nodes permit, a pressure
 * above 10 E; MEMORY. Nothing has changed then */
pal_err pal_brush_set(void *self, const pal_body *body, int slot, const pal_brush *brush, pal_diagnostic *diag);
/* Takes over the brushes of `before`, of a body with the same rest frame in this one's place, with their ramps: a
 * pressure acts on the triangles within its reach, a handle pulls each node as it pulled the old nodes near it. A brush
 * that this body refuses, or for which there is no memory, ends. Both are between steps */
void pal_brush_hand(void *self, const pal_body *body, const void *before, const pal_body *from);
void pal_brush_end(void *self, int slot); /* ramps down from now on; nothing when there is none */
bool pal_brush_gone(const void *self);    /* no brush acts any more */
size_t pal_brush_bytes(const void *self); /* memory of the slots    */
#endif
