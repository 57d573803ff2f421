/* Sculpting by the device (paper A section 4.1): while the grasp button is held, the motion of the tip becomes
 * commands of the protocol (protocol/README.md, "Sculpting"). x: the tip; p: where the button went down; n: outwards
 * there, the direction of the contact's force.
 *
 *   inflate   pressure `strength` times (x - p).n / radius: out inflates, in deflates; ends with the button
 *   curve     the first stroke, from p to where the button goes up, draws a handle on the surface; the second one pulls
 *             its middle by x - p with a spring of `strength`; ends with the button
 *   paint     multiplies stiffness by `strength` at p and each half radius of motion on, while the tip touches
 *   extrude   when the button goes up, a cell of the height (x - p).n grows out of the face at p
 *
 * A stroke begins while the tip touches. One command is under way at a time: dabs wait in a queue, a force that was not
 * sent yet is replaced by the newer one. Thread: one. */
#ifndef PAL_HAPTIC_BRIDGE_HAND_BRUSH_H
#define PAL_HAPTIC_BRIDGE_HAND_BRUSH_H
#include "protocol/control.h"
#include "server/base/err.h"

typedef enum pal_hand_brush_kind {
    PAL_HAND_GRASP, /* the button grasps: no brush */
    PAL_HAND_INFLATE,
    PAL_HAND_CURVE,
    PAL_HAND_PAINT,
    PAL_HAND_EXTRUDE
} pal_hand_brush_kind;

enum { PAL_HAND_QUEUE = 16 }; /* as many edits as the server lets wait */

typedef struct pal_hand_brush {
    pal_hand_brush_kind kind;
    double radius_m, strength;                       /* Pa, N/m or a factor, see above */
    bool held, drawn;                                /* a stroke goes on; CURVE: the handle is drawn and not used yet */
    bool acts, under_way;                            /* a force of this brush acts; a command is not answered yet     */
    double at_m[3], outward[3], end_m[3], last_m[3]; /* p, n, CURVE: end of the handle; x of the last command */
    double pulled_from_m[3];                         /* CURVE: p of the second stroke */
    int n_queued, n_dropped;                         /* dropped: dabs for which the queue had no room */
    pal_wire_command queue[PAL_HAND_QUEUE];
} pal_hand_brush;

/* "KIND[,radius=MM][,strength=NUMBER]"; defaults: 20 mm; 2,000 Pa, 200 N/m, factor 2. REFUSED names the word */
pal_err pal_hand_brush_parse(const char *text, pal_hand_brush *out, pal_diagnostic *diag);
/* the tip is at x_m; force_N on the hand while it touches, else NULL */
void pal_hand_brush_move(pal_hand_brush *brush, bool button, const double x_m[3], const double *force_N);
/* the next command to send, which is under way from now on; false: none */
bool pal_hand_brush_take(pal_hand_brush *brush, pal_wire_command *out);
void pal_hand_brush_answered(pal_hand_brush *brush); /* done or refused */
void pal_hand_brush_reset(pal_hand_brush *brush);    /* the connection was lost: nothing acts, nothing waits */
#endif
