/* Policy constants of the num room: unit, reason, and the test of tests/num that bounds each. Tolerances of rounding
 * stand beside the code that needs them. */
#ifndef PAL_NUM_TUNING_H
#define PAL_NUM_TUNING_H

/* least T/T0 of the acceptance, where differences of cost no longer count; draws of a value outside of the box before
 * it is drawn uniformly (test_anneal) */
#define ANNEAL_COLDEST  1e-18
#define ANNEAL_MAX_DRAW 100

/* of the diagonal: the first shift of a factor that is not positive definite, the factor by which it grows, where it is
 * given up; and the least fraction of a diagonal entry that a pivot keeps (test_cholesky) */
#define SHIFT_FIRST 1e-3
#define SHIFT_GROWS 4.0
#define SHIFT_MAX   1e3
#define PIVOT_MIN   1e-6
#endif
