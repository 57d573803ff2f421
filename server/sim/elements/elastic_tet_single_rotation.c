/* One rotation for all elements of a folded body (elastic_tet.h, "Single rotation"). */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/sim/elements/elastic_tet_block.h"

#include <string.h>

/* a body is stuck when it moves by less than still_S of its length scale within STUCK_UPDATES updates, one a Newton
 * iteration */
enum { STUCK_UPDATES = 64, MAX_TURNS = 200 };
/* largest number of single rotations without QUIET_UPDATES updates free of inversion between them */
enum { TIMES = 2, QUIET_UPDATES = 600 };
static const double still_S = 1e-3;
/* part of load_cap_N: a load above it may hold elements inverted for good */
static const double pressed_share = 0.01;
static const double min_soft = 1e-3;

/* nodes that determine the rotation: the supports when there are three, else all */
static bool leads(const pal_elastic_tets *t, bool by_held, int i)
{
    return !by_held || t->fixed[i];
}

static bool has_frame(const pal_elastic_tets *t)
{
    int n = 0;
    for (int i = 0; i < t->n_node; i++) n += t->fixed[i] != 0;
    return n >= 3;
}

/* gives all elements the rotation of the frame */
void pal_tet_fit_single_rotation(pal_elastic_tets *t, const double *d)
{
    const bool by_held = has_frame(t);
    double c[3] = {0}, o[3] = {0}, f[9] = {0}, q[4] = {1, 0, 0, 0}, a[3], b[3];
    int n = 0;
    for (int i = 0; i < t->n_node; i++) {
        if (!leads(t, by_held, i)) continue;
        pal_add3(c, c, d + 3 * i), pal_add3(o, o, t->x_rest + 3 * i);
        n++;
    }
    pal_scale3(c, 1.0 / n, c), pal_scale3(o, 1.0 / n, o);
    for (int i = 0; i < t->n_node; i++) {
        if (!leads(t, by_held, i)) continue;
        pal_sub3(a, d + 3 * i, c), pal_sub3(b, t->x_rest + 3 * i, o);
        for (int k = 0; k < 9; k++) f[k] += a[k / 3] * b[k % 3];
    }
    pal_polar_rotation(f, q, MAX_TURNS);
    for (int e = 0; e < t->options.n_tet; e++)
        for (int i = 0; i < 4; i++) pal_lane_set(t->turn, 4, t->place[e], i, q[i]);
}

double pal_tet_single_rotation_force(const pal_elastic_tets *t, const double *d, double *f)
{
    double sum = 0, torque[3] = {0};
    for (int e = 0; e < t->options.n_tet; e++)
        if (pal_lane_get(t->volume_m3, 1, t->place[e], 0) > 0) sum += pal_tet_add_element(t, e, d, f, torque);
    /* a free body does not turn itself */
    if (f && !has_frame(t)) pal_tet_balance_torque(t, d, torque, f);
    return sum;
}

static bool has_moved(const pal_elastic_tets *t, const pal_body *body)
{
    double max = still_S * body->length_scale_m;
    for (int i = 0; i < t->n_node; i++)
        if (pal_dist3(t->x_before + 3 * i, body->d + 3 * i) > max) return true;
    return false;
}

static bool is_pressed(const pal_body *body)
{
    double max = pressed_share * body->load_cap_N;
    for (int i = 0; i < body->n_node; i++)
        if (pal_norm3(body->load + 3 * i) > max) return true;
    return false;
}

bool pal_elastic_tets_check_rest(pal_elastic_tets *t, const pal_body *body, bool has_inversion)
{
    t->n_whole = has_inversion ? 0 : t->n_whole + 1;
    if (t->n_whole >= QUIET_UPDATES) t->n_single_rotation = t->n_whole = 0;
    if (!has_inversion || t->n_single_rotation >= TIMES) return false;
    if (t->single_rotation || t->n_still++ % STUCK_UPDATES != 0) return false;
    bool stuck = t->n_still > 1 && !has_moved(t, body) && !is_pressed(body);
    memcpy(t->x_before, body->d, 3 * sizeof(double) * (size_t)t->n_node);
    if (!stuck) return false;
    double before = pal_elastic_tets_energy(t, body->d, NULL);
    t->single_rotation = true, t->soft = 1;
    t->n_single_rotation++;
    pal_tet_fit_single_rotation(t, body->d);
    double after = pal_tet_single_rotation_force(t, body->d, NULL);
    t->soft = after > 0 ? fmax(min_soft, fmin(1, before / after)) : 1;
    return true;
}
