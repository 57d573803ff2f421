/* Cross-fades. A change that would strike tissue is spread over a time: the difference between before and after is
 * released at a constant rate, so that the largest change in any interval dt is dt / duration of it. Time is simulated
 * time, never a number of steps: a scene behaves alike at every step length. One shape serves all fades, because for a
 * given duration the linear one has the smallest rate. tests/sim/core/test_blend.c checks the shape,
 * tests/sim/contact/test_step_length.c that contact does not depend on the step. [any] */
#ifndef PAL_SIM_CORE_BLEND_H
#define PAL_SIM_CORE_BLEND_H

/* s. Forces of a tool whose client appears or leaves, contact that begins elsewhere, a grasp on other nodes, another
 * body or other supports, a brush. Ten frames at 60 Hz: no shown vertex moves by more than a tenth of the difference in
 * a frame (tests/net/test_switch_bound.c) */
#define PAL_BLEND_S (1.0 / 6)
/* s. The grasp of a tool on another body, until that body's own force is felt. Slow enough that a slider of methods
 * moves no shown vertex by more than a tenth of the displacement in a frame (tests/stability/test_switch_slider.c; 0.4
 * does) */
#define PAL_BLEND_GRASP_S 0.5

/* the share (any number between 0 and 1) after dt_s towards the goal at the rate 1 / duration_s; 0: at once. What is
 * left by rounding counts as nothing */
static inline double pal_blend_toward(double share, double goal, double dt_s, double duration_s)
{
    double step = duration_s > 0 ? dt_s / duration_s : 1, left = goal - share;
    if (left > step + 1e-9) return share + step;
    return left < -step - 1e-9 ? share - step : goal;
}

/* advances a fade with *left_s remaining by dt_s; returns what is then left of a difference, over what was before (0 at
 * its end) */
static inline double pal_blend_release(double *left_s, double dt_s)
{
    double left = *left_s - dt_s, before = *left_s;
    *left_s = left > 1e-9 * before ? left : 0;
    return before > 0 ? *left_s / before : 0;
}
#endif
