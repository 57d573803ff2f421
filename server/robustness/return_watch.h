/* Watches the distance of a scene from its rest shape after a release, and says how it returns.
 *
 * The error falls at last as exp(-t / tau), tau of the body (pal_body_return_s). Once the second half of the watched
 * time is such an exponential, the time of return is extrapolated and the watch ends, where that saves time. The rates
 * of its two quarters have to agree, and the mean has to be 1 / tau, or the error has to have fallen by the factor e in
 * the window. Otherwise the watch lasts as long as a body with that tau and
 * lowest frequency may need. Thread: [load]. */
#ifndef PAL_ROBUSTNESS_RETURN_WATCH_H
#define PAL_ROBUSTNESS_RETURN_WATCH_H
#include <stdbool.h>

enum { PAL_WATCH_SAMPLES = 128 };

typedef enum pal_return_state {
    PAL_RETURN_OPEN,
    PAL_RETURN_BACK,     /* within PAL_RETURN_S for PAL_REST_HOLD_S, nothing inverted */
    PAL_RETURN_SLOW,     /* on its way, return_s is extrapolated, nothing inverted    */
    PAL_RETURN_INVERTED, /* at rest, or the time is over, with inverted elements      */
    PAL_RETURN_ASLEEP,   /* asleep off the rest shape                                 */
    PAL_RETURN_STUCK,    /* stands still off the rest shape                           */
    PAL_RETURN_MOVES     /* the time is over and it is neither back nor on its way    */
} pal_return_state;

/* one look at the scene after a step */
typedef struct pal_return_look {
    double time_s;         /* since the release                                       */
    double left_S;         /* RMS distance from rest, of the farthest body, over its S */
    double speed_S_s;      /* RMS speed of the fastest body over its S                */
    bool inverted, asleep; /* an element of any body is inverted; all bodies sleep    */
} pal_return_look;

typedef struct pal_return_watch {
    double tau_s;    /* largest time constant of the bodies; 0: not known */
    double limit_s;  /* time allowed                                      */
    double return_s; /* measured or extrapolated; INFINITY: not yet       */
    double last_s, still_s, check_s;
    int n, stride, since;
    double time_s[PAL_WATCH_SAMPLES], left_S[PAL_WATCH_SAMPLES];
} pal_return_watch;

/* s: 7 / w1 + 3 tau ln(start / PAL_RETURN_S) / 2, at least min_s; w1_1_s 0: not known, min_s */
double pal_return_limit_s(double w1_1_s, double tau_s, double start_S, double min_s);
void pal_return_watch_begin(pal_return_watch *watch, double tau_s, double limit_s);
pal_return_state pal_return_watch_look(pal_return_watch *watch, const pal_return_look *look);
#endif
