/* Freezes a body that diverges, so that one bad body never takes the session with it (numerics.md part 3).
 *
 * Diverged means: a position or velocity is not finite, a node is farther than `reach` box diagonals from its rest
 * place, or the root mean square speed is beyond `speed_m_s`. The last good state (a copy of every step) comes back,
 * standing still, and the body stays as it is until reset: body->frozen is what says so (the world's step reports it).
 */
#include "server/sim/effect.h"

#include <math.h>
#include <string.h>

typedef struct finite_guard {
    pal_body *body;
    double *x, *v; /* last good state [n_dof][3] */
    double reach;
    double speed_m_s, asked_speed_m_s; /* in use; as the scene gave it, 0: from the material */
    double gravity_m_s2, mass_kg;
} finite_guard;

/* far above what tissue does: 20 times the shear wave and free-fall speeds */
static double auto_speed(const finite_guard *guard, const pal_material *material)
{
    double wave = sqrt(material->young_Pa / material->density_kg_m3);
    double fall = sqrt(guard->gravity_m_s2 * guard->body->size_m);
    return 20 * (wave + fall) + 10 * guard->body->size_m;
}

static void keep(finite_guard *guard, const pal_body *body)
{
    memcpy(guard->x, body->x, 3 * sizeof(double) * (size_t)body->n_dof);
    memcpy(guard->v, body->v, 3 * sizeof(double) * (size_t)body->n_dof);
}

static pal_err material(void *self, const pal_body *body, const pal_material *mat, pal_note *note)
{
    finite_guard *guard = self;
    (void)body, (void)note;
    if (guard->asked_speed_m_s == 0) guard->speed_m_s = auto_speed(guard, mat);
    return PAL_ERR_OK;
}

static pal_err make(pal_item *item, pal_build *build, void **self)
{
    pal_body *body = build->body;
    double reach = 10, speed = 0;
    PAL_TRY(pal_item_number(item, "reach", 0.1, 1000, &reach, build->note));
    PAL_TRY(pal_item_number(item, "speed_m_s", 0, 1e9, &speed, build->note));
    PAL_TRY(pal_item_done(item, build->note));
    finite_guard *guard = PAL_NEW(build->arena, finite_guard, 1);
    if (!guard) return PAL_ERR_MEMORY;
    guard->x = PAL_NEW(build->arena, double, 3 * (size_t)body->n_dof);
    guard->v = PAL_NEW(build->arena, double, 3 * (size_t)body->n_dof);
    if (!guard->x || !guard->v) return PAL_ERR_MEMORY;
    guard->body = body;
    guard->reach = reach;
    guard->gravity_m_s2 = fabs(build->scene->gravity_m_s2);
    guard->asked_speed_m_s = guard->speed_m_s = speed;
    if (speed == 0) guard->speed_m_s = auto_speed(guard, &build->def->material);
    for (int i = 0; i < body->n_dof; i++) guard->mass_kg += body->mass_kg[i];
    keep(guard, body);
    *self = guard;
    return PAL_ERR_OK;
}

/* true when every number is finite and within bounds; comparisons are written so that NaN fails them */
static bool sound(const finite_guard *guard, const pal_body *body)
{
    double energy = 0, limit = guard->reach * body->size_m;
    bool near = true;
    for (size_t i = 0; i < (size_t)body->n_dof; i++) {
        const double *x = body->x + 3 * i, *r = body->x_rest + 3 * i, *v = body->v + 3 * i;
        near &= fabs(x[0] - r[0]) <= limit && fabs(x[1] - r[1]) <= limit && fabs(x[2] - r[2]) <= limit;
        energy += body->mass_kg[i] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    }
    return near && energy <= guard->mass_kg * guard->speed_m_s * guard->speed_m_s;
}

static pal_err run(void *self, pal_step *step)
{
    finite_guard *guard = self;
    pal_body *body = step->body;
    /* a body that the solver froze for a state that is no number comes here frozen and gets its last good state too */
    if (sound(guard, body)) {
        if (!body->frozen) keep(guard, body);
        return PAL_ERR_OK;
    }
    memcpy(body->x, guard->x, 3 * sizeof(double) * (size_t)body->n_dof);
    memset(body->v, 0, 3 * sizeof(double) * (size_t)body->n_dof);
    body->frozen = true;
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    keep(self, body);
}

const pal_effect pal_effect_finite_guard = {
    .name = "finite_guard", .stage = PAL_STAGE_GUARD, .make = make, .run = run, .material = material, .reset = reset};
