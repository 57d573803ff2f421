/* Component moving_support: nodes with a prescribed motion, single or periodic (breathing).
 *
 * A node at X at rest is at  c + R(s angle) (X - c) + s shift  at time t, where c is the centroid of the nodes at
 * rest and R the rotation about `turn_axis`. s rises smoothly from 0 to 1 within rise_s, (1 - cos(pi t / rise)) / 2,
 * but no faster than in one step of the scene, and stays 1; with period_s it is multiplied by (1 - cos(2 pi t /
 * period)) / 2. In each sub-step the nodes get the velocity that brings them to their position at its end
 * (PAL_PRESCRIBED), which depends on time only.
 *
 * Keys: those of pal_support_read (definition.h), shift_m (0 0 0), turn_axis (0 0 1), turn_deg (0), rise_s (0),
 * period_s (0: s stays 1). */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"

typedef struct moving_support {
    int n_node;
    int32_t *node;     /* [n_node] */
    double centre[3];  /* m        */
    double shift_m[3]; /* at s = 1 */
    double axis[3], angle;
    double rise_s, period_s;
} moving_support;

static pal_err read_keys(moving_support *m, pal_config_entry *entry, pal_diagnostic *diag)
{
    double degrees = 0;
    PAL_TRY(pal_entry_read_numbers(entry, "shift_m", 3, m->shift_m, diag));
    PAL_TRY(pal_entry_read_numbers(entry, "turn_axis", 3, m->axis, diag));
    PAL_TRY(pal_entry_read_number(entry, "turn_deg", -1e6, 1e6, &degrees, diag));
    PAL_TRY(pal_entry_read_number(entry, "rise_s", 0, 1e6, &m->rise_s, diag));
    PAL_TRY(pal_entry_read_number(entry, "period_s", 0, 1e6, &m->period_s, diag));
    PAL_TRY(pal_entry_check_unused(entry, diag));
    m->angle = degrees * M_PI / 180;
    if (!pal_unit3(m->axis, m->axis, 0)) return PAL_REFUSE(diag, "%s: turn_axis has no direction", entry->path);
    return PAL_ERR_OK;
}

static pal_err make(pal_config_entry *entry, pal_build *build, void **self)
{
    pal_body *body = build->body;
    pal_support_def support;
    uint8_t *held;
    moving_support *m = PAL_NEW(build->arena, moving_support, 1);
    if (!m) return PAL_ERR_MEMORY;
    m->axis[2] = 1;
    PAL_TRY(pal_support_read(entry, &support, build->diag));
    if (!(held = PAL_NEW(build->arena, uint8_t, body->n_dof))) return PAL_ERR_MEMORY;
    pal_support_mark_fixed(&support, build->scene->up, body->x_rest, body->n_dof, held);
    PAL_TRY(read_keys(m, entry, build->diag));
    m->rise_s = fmax(m->rise_s, build->scene->step_s);
    m->node = PAL_NEW(build->arena, int32_t, body->n_dof);
    if (!m->node) return PAL_ERR_MEMORY;
    for (int i = 0; i < body->n_dof; i++) {
        const double *x = body->x_rest + 3 * (size_t)i;
        if (!held[i]) continue;
        body->support[i] = PAL_PRESCRIBED;
        pal_add3(m->centre, m->centre, x);
        m->node[m->n_node++] = i;
    }
    if (m->n_node == 0)
        return PAL_REFUSE(build->diag, "%s: moving_support holds none of the body's %d nodes", entry->path,
                          body->n_dof);
    pal_scale3(m->centre, 1.0 / m->n_node, m->centre);
    *self = m;
    return PAL_ERR_OK;
}

static pal_err run(void *self, pal_step *step)
{
    const moving_support *m = self;
    pal_body *body = step->body;
    double t = step->time_s / m->rise_s, s = t >= 1 ? 1 : 0.5 * (1 - cos(M_PI * t));
    if (m->period_s > 0) s *= 0.5 * (1 - cos(2 * M_PI * step->time_s / m->period_s));
    double half = 0.5 * s * m->angle;
    double quat[4] = {cos(half), sin(half) * m->axis[0], sin(half) * m->axis[1], sin(half) * m->axis[2]};
    for (int i = 0; i < m->n_node; i++) {
        size_t k = 3 * (size_t)m->node[i];
        double move[3], *v = body->v + k;
        pal_sub3(move, body->x_rest + k, m->centre);
        pal_quat_rotate(move, quat, move);
        pal_add3(move, move, m->centre);
        pal_axpy3(move, s, m->shift_m);
        pal_sub3(move, move, body->x + k);
        /* ignore displacements within rounding */
        bool arrived = pal_norm3(move) <= 1e-14 * body->length_scale_m;
        pal_scale3(v, arrived ? 0 : 1 / step->dt_s, move);
    }
    return PAL_ERR_OK;
}

static double settled_s(const void *self)
{
    const moving_support *m = self;
    return m->period_s > 0 ? INFINITY : m->rise_s;
}

const pal_effect pal_effect_moving_support = {PAL_EFFECT("moving_support", CONTACT), .sleep.settled_s = settled_s};
