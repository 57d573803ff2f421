/* Constants of springs: unit, reason, test that bounds each. */
#ifndef PAL_SIM_SPRINGS_TUNING_H
#define PAL_SIM_SPRINGS_TUNING_H

/* quality below which a tetrahedron has no volume spring: its gradients are so long that they would set the sub-step
 * (tests/sim/springs/test_springs.c) */
#define PAL_SPRING_SLIVER 0.01
#endif
