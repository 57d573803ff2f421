/* Constants of policy on the wire: limits, rates, pauses. Each has its unit, its reason, and the test that bounds it.
 */
#ifndef PAL_NET_NET_TUNING_H
#define PAL_NET_NET_TUNING_H

/* part of the scene box's diagonal: a place farther from the surface than this names nothing. Wide enough for a pointer
 * that sees an older frame (test_sculpt_hub) */
#define PAL_PICK_REACH 0.1
/* softness of a brush that names none: half of the radius falls off (test_sculpt_hub) */
#define PAL_BRUSH_SOFTNESS 0.5
#endif
