/* Constants of network policy: limits, rates, intervals. Each states its unit, its reason, and the test that bounds
 * it. */
#ifndef PAL_NET_TUNING_H
#define PAL_NET_TUNING_H

/* fraction of the diagonal of the scene's box: maximum distance of a picked point from the surface. Wide enough for a
 * pointer that sees an older frame (test_sculpt_hub) */
#define PAL_PICK_REACH 0.1
/* default softness of a brush: the load falls off over half of the radius (test_sculpt_hub) */
#define PAL_BRUSH_SOFTNESS 0.5
#endif
