/* Component gravity: f = -m g up, energy m g (up . x). Key: acceleration_m_s2 (the scene's gravity_m_s2). */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"

typedef struct gravity {
    double g[3]; /* m/s^2 */
} gravity;

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    double size = build->scene->gravity_m_s2;
    PAL_TRY(pal_entry_read_number(item, "acceleration_m_s2", -1e4, 1e4, &size, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    gravity *state = PAL_NEW(build->arena, gravity, 1);
    if (!state) return PAL_ERR_MEMORY;
    pal_scale3(state->g, -size, build->scene->up);
    *self = state;
    return PAL_ERR_OK;
}

static pal_err run(void *self, pal_step *step)
{
    const gravity *state = self;
    const double *m = step->body->node_mass_kg, gx = state->g[0], gy = state->g[1], gz = state->g[2];
    double *f = step->body->f;
    const int32_t *active = step->body->active;
    const int n = pal_body_nodes(step->body);
    for (int k = 0; k < n; k++) {
        int i = active ? active[k] : k;
        f[3 * i] += m[i] * gx;
        f[3 * i + 1] += m[i] * gy;
        f[3 * i + 2] += m[i] * gz;
    }
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    const gravity *state = self;
    const double *m = body->node_mass_kg;
    const int n = body->active ? 0 : body->n_node;
    double sum = 0, lane[8] = {0};
    int i = 0;
    for (int k = 0; k < pal_body_nodes(body) && body->active; k++)
        sum += m[body->active[k]] * pal_dot3(state->g, body->d + 3 * body->active[k]);
    /* SIMD: implicit solvers call it twice per step */
    for (; i + 8 <= n; i += 8)
        for (int l = 0; l < 8; l++) lane[l] += m[i + l] * pal_dot3(state->g, body->d + 3 * (i + l));
    for (; i < n; i++) sum += m[i] * pal_dot3(state->g, body->d + 3 * i);
    for (int l = 0; l < 8; l++) sum += lane[l];
    return -sum;
}

const pal_effect pal_effect_gravity = {PAL_EFFECT("gravity", FORCE), .energy = energy};
