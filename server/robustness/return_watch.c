#include "server/robustness/return_watch.h"

#include "server/robustness/tuning.h"

#include <math.h>

double pal_return_limit_s(double w1_1_s, double tau_s, double start_S, double min_s)
{
    if (!(w1_1_s > 0)) return min_s;
    return fmax(min_s, 7 / w1_1_s + 1.5 * tau_s * log(fmax(start_S / PAL_RETURN_S, 1)));
}

void pal_return_watch_begin(pal_return_watch *watch, double tau_s, double limit_s)
{
    *watch = (pal_return_watch){
        .tau_s = tau_s, .limit_s = limit_s, .return_s = INFINITY, .stride = 1, .check_s = PAL_TREND_FIRST_S};
}

/* every stride-th look; where the arrays are full, every second one of them is kept */
static void record(pal_return_watch *w, const pal_return_look *look)
{
    if (++w->since < w->stride) return;
    w->since = 0;
    if (w->n == PAL_WATCH_SAMPLES) {
        for (int i = 0; i < PAL_WATCH_SAMPLES / 2; i++)
            w->time_s[i] = w->time_s[2 * i + 1], w->left_S[i] = w->left_S[2 * i + 1];
        w->n /= 2, w->stride *= 2;
    }
    w->time_s[w->n] = look->time_s, w->left_S[w->n++] = look->left_S;
}

/* rate of decay of the samples in [from_s, to_s] by least squares, 1/s; NaN: too few, or one is not finite */
static double rate(const pal_return_watch *w, double from_s, double to_s)
{
    double n = 0, t = 0, y = 0, tt = 0, ty = 0;
    for (int i = 0; i < w->n; i++) {
        if (w->time_s[i] < from_s || w->time_s[i] > to_s) continue;
        const double at = w->time_s[i] - from_s, log_left = log(w->left_S[i]);
        n++, t += at, y += log_left, tt += at * at, ty += at * log_left;
    }
    return n < 4 ? (double)NAN : -(n * ty - t * y) / (n * tt - t * t);
}

/* the second half of the watched time is an exponential: when it is back; INFINITY: it is none */
static double extrapolate_s(const pal_return_watch *w, const pal_return_look *look)
{
    const double t = look->time_s, all = rate(w, 0.5 * t, t), early = rate(w, 0.5 * t, 0.75 * t),
                 late = rate(w, 0.75 * t, t), fall = 0.5 * t * all;
    const bool even = fabs(early - late) <= PAL_TREND_UNEVEN * late,
               known = w->tau_s > 0 && fabs(all * w->tau_s - 1) <= PAL_TREND_TAU_SHARE && fall >= PAL_TREND_FALL;
    if (!even || !(known || fall >= 1)) return INFINITY;
    return t + log(look->left_S / PAL_RETURN_S) / late;
}

pal_return_state pal_return_watch_look(pal_return_watch *w, const pal_return_look *look)
{
    const double t = look->time_s, step_s = t - w->last_s;
    const bool near = look->left_S <= PAL_RETURN_S;
    w->last_s = t;
    record(w, look);
    if (!near) w->return_s = INFINITY;
    if (near && isinf(w->return_s)) w->return_s = t;
    if (t - w->return_s >= PAL_REST_HOLD_S && !look->inverted) return PAL_RETURN_BACK;
    if (look->asleep) return look->inverted ? PAL_RETURN_INVERTED : near ? PAL_RETURN_BACK : PAL_RETURN_ASLEEP;
    /* what no longer moves will not return either; a slow body creeps by that much in its time constant */
    const double still_S_s = fmin(PAL_REST_SPEED_S_S, 0.1 * PAL_RETURN_S / fmax(w->tau_s, 1e-9));
    w->still_s = look->speed_S_s <= still_S_s ? w->still_s + step_s : 0;
    if (w->still_s > 2 * PAL_REST_HOLD_S) return look->inverted ? PAL_RETURN_INVERTED : PAL_RETURN_STUCK;
    const bool over = t >= w->limit_s;
    if (!near && !look->inverted && (over || t >= w->check_s)) {
        w->check_s = t * PAL_TREND_EACH;
        const double back_s = extrapolate_s(w, look);
        if (isfinite(back_s) && (over || back_s > fmax(PAL_RETURN_TIME_S, PAL_TREND_SAVES * t))) {
            w->return_s = back_s;
            return PAL_RETURN_SLOW;
        }
    }
    if (!over) return PAL_RETURN_OPEN;
    return look->inverted ? PAL_RETURN_INVERTED : near ? PAL_RETURN_BACK : PAL_RETURN_MOVES;
}
