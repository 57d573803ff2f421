/* The proxy's move: push out of points that came too close, then collide and slide. */
#include "server/sim/contact/proxy.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"

/* shifts the centre until the point is `core` away: straight from it, or along the normal from its far side */
static void push_from(pal_proxy *proxy, const double p[3], double core)
{
    double w[3];
    pal_sub3(w, proxy->x, p);
    double distance = pal_norm3(w), along = pal_dot3(w, proxy->normal);
    if (distance > 1e-9 * core && along >= 0) {
        pal_axpy3(proxy->x, (core - distance) / distance, w);
        return;
    }
    if (pal_dot3(proxy->normal, proxy->normal) == 0) return;
    double root = along * along - distance * distance + core * core;
    pal_axpy3(proxy->x, -along + sqrt(fmax(root, 0)), proxy->normal);
}

/* tissue that came too close moves the proxy by at most max_m: one stray point must not throw it off the organ */
static void push_out(pal_proxy *proxy, const double *p, int n, const double *core, double max_m)
{
    double start[3], move[3];
    pal_copy3(start, proxy->x);
    bool moved = true;
    for (int pass = 0; pass < PROXY_PUSHES && moved; pass++) {
        moved = false;
        for (int i = 0; i < n; i++) {
            double w[3];
            pal_sub3(w, proxy->x, p + 3 * i);
            if (pal_dot3(w, w) >= core[i] * core[i] * (1 - 1e-9)) continue;
            push_from(proxy, p + 3 * i, core[i]);
            moved = true;
        }
    }
    pal_sub3(move, proxy->x, start);
    double length = pal_norm3(move);
    if (length <= max_m) return;
    pal_copy3(proxy->x, start);
    pal_axpy3(proxy->x, max_m / length, move);
}

/* the first point that blocks the move, and the free share of it */
static int first_hit(const double x[3], const double move[3], const double *p, int n, const double *core, double *free)
{
    double a = pal_dot3(move, move), first = 1;
    int hit = -1;
    for (int i = 0; i < n; i++) {
        double wx = x[0] - p[3 * i], wy = x[1] - p[3 * i + 1], wz = x[2] - p[3 * i + 2];
        double b = wx * move[0] + wy * move[1] + wz * move[2];
        if (b >= 0) continue;
        double c = wx * wx + wy * wy + wz * wz - core[i] * core[i];
        double root = b * b - a * c;
        /* a grazing approach of a point that is just touched does not block */
        if (root <= 0 || (c <= 0 && b * b < 1e-12 * a * (c + core[i] * core[i]))) continue;
        double s = c <= 0 ? 0 : (-b - sqrt(root)) / a;
        if (s < first) first = s, hit = i;
    }
    *free = first;
    return hit;
}

/* takes from `move` what runs against any of the planes met so far; false when nothing is left */
static bool clip(double move[3], double normal[][3], int n)
{
    const double *last = normal[n - 1];
    double into = pal_dot3(move, last);
    if (into < 0) pal_axpy3(move, -into, last);
    for (int k = 0; k + 1 < n; k++) {
        if (pal_dot3(move, normal[k]) >= -1e-9 * pal_norm3(move)) continue;
        /* along the crease of the two, unless a third plane blocks that too */
        double crease[3];
        pal_cross3(crease, normal[k], last);
        if (!pal_unit3(crease, crease, 1e-6)) return false;
        pal_scale3(move, pal_dot3(move, crease), crease);
        for (int j = 0; j + 1 < n; j++)
            if (j != k && pal_dot3(move, normal[j]) < -1e-9 * pal_norm3(move)) return false;
        break;
    }
    return true;
}

/* shortens the move so that the centre stays within slack of the segment, where the points around are known */
static bool keep_inside(const double x[3], double move[3], const pal_proxy_limits *limits)
{
    double ab[3], end[3], w[3];
    pal_sub3(ab, limits->b, limits->a);
    pal_add3(end, x, move);
    pal_sub3(w, end, limits->a);
    double ab2 = pal_dot3(ab, ab), t = ab2 > 0 ? pal_dot3(w, ab) / ab2 : 0;
    pal_axpy3(w, -fmin(1, fmax(0, t)), ab);
    double off = pal_norm3(w);
    if (off <= limits->slack_m) return true;
    double length = pal_norm3(move), less = off - limits->slack_m;
    if (less >= length) return false;
    pal_scale3(move, 1 - less / length, move);
    return true;
}

void pal_proxy_move(pal_proxy *proxy, const double target[3], const double *p, int n, const pal_proxy_limits *limits,
                    double dt_s, double *core)
{
    double start[3], move[3], normal[PROXY_SLIDES][3];
    pal_copy3(start, proxy->x);
    for (int i = 0; i < n; i++) {
        double depth = fmax(0, limits->radius_m - pal_dist3(p + 3 * i, proxy->x));
        core[i] = limits->radius_m - fmin(limits->max_depth_m, depth + limits->max_rise_m);
    }
    push_out(proxy, p, n, core, limits->max_rise_m);

    pal_sub3(move, target, proxy->x);
    double wanted2 = pal_dot3(move, move), min2 = 1e-18 * limits->radius_m * limits->radius_m;
    /* once blocked it slides no farther than the tool itself moved, or than tissue may be moved */
    double slide_m = fmax(limits->max_rise_m, limits->tool_move_length_m);
    for (int pass = 0; pass < PROXY_SLIDES && pal_dot3(move, move) > min2; pass++) {
        double part;
        if (pass > 0 && !keep_inside(proxy->x, move, limits)) break;
        int hit = first_hit(proxy->x, move, p, n, core, &part);
        pal_axpy3(proxy->x, part, move);
        if (hit < 0) break;
        pal_scale3(move, 1 - part, move);
        pal_sub3(normal[pass], proxy->x, p + 3 * hit);
        if (!pal_unit3(normal[pass], normal[pass], 0) || !clip(move, normal, pass + 1)) break;
        double left_m = pal_norm3(move);
        if (left_m > slide_m) pal_scale3(move, slide_m / left_m, move);
    }
    /* exactly there when nothing was in the way */
    double left[3];
    pal_sub3(left, target, proxy->x);
    if (pal_dot3(left, left) <= 1e-20 * wanted2) pal_copy3(proxy->x, target);
    pal_sub3(proxy->v, proxy->x, start);
    pal_scale3(proxy->v, 1 / dt_s, proxy->v);
}
