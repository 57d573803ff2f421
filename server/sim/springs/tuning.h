/* Constants of springs: unit, reason, test that bounds each. */
#ifndef PAL_SIM_SPRINGS_TUNING_H
#define PAL_SIM_SPRINGS_TUNING_H

/* quality below which a tetrahedron has no volume spring: its gradients are so long that they would set the sub-step
 * (tests/sim/springs/test_springs.c) */
#define PAL_SPRING_SLIVER 0.01
/* springs compress further than elements before they fold: ratio of a volume to that at rest
 * (tests/sim/springs/test_spring_recovery.c) */
#define PAL_SPRING_INVERTED_LOW 0.01
/* of the time step that edges permit: time constant of damping in regions (tests/sim/springs/test_spring_recovery.c) */
#define PAL_SPRING_DAMP_SHARE 0.25
#endif
