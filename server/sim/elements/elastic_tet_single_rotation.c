/* One rotation for all elements of a folded body (elastic_tet.h, "Single rotation"). */
#include "server/base/vec3.h"
#include "server/num/polar.h"
#include "server/sim/core/best_rotation.h"
#include "server/sim/elements/elastic_tet_block.h"

#include <string.h>

/* updates over which motion is measured; largest number of single rotations without PAL_RETRY_UPDATES updates free of
 * inversion between them */
enum { STUCK_UPDATES = 64, TIMES = 2 };

/* do the supports determine the rotation? */
static bool has_frame(const pal_elastic_tets *t)
{
    int n = 0;
    for (int i = 0; i < t->n_node; i++) n += t->fixed[i] != 0;
    return n >= 3;
}

/* gives all elements the rotation of the supports when there are three, else of all nodes */
void pal_tet_fit_single_rotation(pal_elastic_tets *t, const double *d)
{
    double f[9], q[4] = {1, 0, 0, 0};
    pal_sum_pairs(t->n_node, has_frame(t) ? t->fixed : NULL, d, t->x_rest, f);
    pal_polar_rotation(f, q, PAL_POLAR_STEPS_MAX);
    for (int e = 0; e < t->options.n_tet; e++)
        for (int i = 0; i < 4; i++) *pal_lane(t->rotation, 4, t->place[e], i) = q[i];
}

double pal_tet_single_rotation_force(const pal_elastic_tets *t, const double *d, double *f)
{
    double sum = 0, torque[3] = {0};
    for (int e = 0; e < t->options.n_tet; e++)
        if (*pal_lane(t->volume_m3, 1, t->place[e], 0) > 0) sum += pal_tet_add_element(t, e, d, f, torque);
    /* a free body does not turn itself */
    if (f && !has_frame(t)) pal_tet_balance_torque(t, d, torque, f);
    return sum;
}

static bool has_moved(const pal_elastic_tets *t, const pal_body *body)
{
    double max = PAL_REST_SHARE * body->length_scale_m;
    for (int i = 0; i < t->n_node; i++)
        if (pal_dist3(t->x_before + 3 * i, body->d + 3 * i) > max) return true;
    return false;
}

static bool is_pressed(const pal_body *body)
{
    double max = PAL_REST_SHARE * body->load_cap_N;
    for (int i = 0; i < body->n_node; i++)
        if (pal_norm3(body->load + 3 * i) > max) return true;
    return false;
}

bool pal_elastic_tets_check_rest(pal_elastic_tets *t, const pal_body *body, bool has_inversion)
{
    t->n_whole = has_inversion ? 0 : t->n_whole + 1;
    if (t->n_whole >= PAL_RETRY_UPDATES) t->n_single_rotation = t->n_whole = 0;
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
    t->soft = after > 0 ? fmax(PAL_FILL_MIN, fmin(1, before / after)) : 1;
    return true;
}
