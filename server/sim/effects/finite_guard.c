/* Component finite_guard: freezes a body that diverges, so that the session survives it.
 *
 * A body diverges when a position or velocity is not finite, a node is farther than `reach` box diagonals from its
 * rest position, or the root mean square speed exceeds `speed_m_s`. The guard restores the last good positions
 * (copied every step) with zero velocity, and the body stays frozen until reset; body->reason names the point, the
 * element and the number.
 * Dofs are checked and restored (of an adaptive body the active ones), but the speed is that of the nodes. The set of
 * active points is not restored: a point that became active since is placed between the ends of its edge. */
#include "server/base/vec3.h"
#include "server/sim/core/effect.h"
#include "server/sim/core/sums.h"

typedef struct finite_guard {
    pal_body *body;
    double *x;      /* last good positions [n_dof][3] */
    uint32_t *kept; /* step index of the last copy of a point, of an adaptive body; else NULL [n_dof] */
    uint32_t stamp;
    double reach;
    double speed_m_s, asked_speed_m_s; /* in use; as the scene gave it, 0: from the material */
    double gravity_m_s2, mass_kg;
} finite_guard;

/* far above speeds of tissue: 20 times the shear wave and free-fall speeds */
static double auto_speed(const finite_guard *guard, const pal_material *material)
{
    double wave = sqrt(material->young_Pa / material->density_kg_m3);
    double fall = sqrt(guard->gravity_m_s2 * guard->body->length_scale_m);
    return 20 * (wave + fall) + 10 * guard->body->length_scale_m;
}

static void keep(finite_guard *guard, const pal_body *body)
{
    guard->stamp++;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        pal_copy3(guard->x + 3 * (size_t)i, body->x + 3 * (size_t)i);
        if (guard->kept) guard->kept[i] = guard->stamp;
    }
}

/* position of a point of an adaptive body in the last good state; interpolated if it was inactive */
static void last_place(const finite_guard *guard, const pal_levels *levels, int32_t i, double x[3])
{
    int32_t edge = levels ? pal_levels_vertex_parent(levels, i) : -1;
    double end[3];
    pal_copy3(x, guard->x + 3 * (size_t)i);
    if (edge < 0 || guard->kept[i] == guard->stamp) return;
    last_place(guard, levels, levels->edge[edge].vertex[0], x);
    last_place(guard, levels, levels->edge[edge].vertex[1], end);
    for (int c = 0; c < 3; c++) x[c] = 0.5 * (x[c] + end[c]);
}

static pal_err material(void *self, const pal_body *body, const pal_material *mat, pal_diagnostic *diag)
{
    finite_guard *guard = self;
    (void)body, (void)diag;
    if (guard->asked_speed_m_s == 0) guard->speed_m_s = auto_speed(guard, mat);
    return PAL_ERR_OK;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    pal_body *body = build->body;
    double reach = 10, speed = 0;
    PAL_TRY(pal_entry_read_number(item, "reach", 0.1, 1000, &reach, build->diag));
    PAL_TRY(pal_entry_read_number(item, "speed_m_s", 0, 1e9, &speed, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    finite_guard *guard = PAL_NEW(build->arena, finite_guard, 1);
    if (!guard) return PAL_ERR_MEMORY;
    *guard = (finite_guard){.body = body,
                            .x = PAL_NEW(build->arena, double, 3 * (size_t)body->n_dof),
                            .kept = body->active ? PAL_NEW(build->arena, uint32_t, body->n_dof) : NULL,
                            .reach = reach,
                            .gravity_m_s2 = fabs(build->scene->gravity_m_s2),
                            .asked_speed_m_s = speed,
                            .speed_m_s = speed};
    if (!guard->x || (body->active && !guard->kept)) return PAL_ERR_MEMORY;
    if (speed == 0) guard->speed_m_s = auto_speed(guard, &build->def->material);
    for (int i = 0; i < body->n_node; i++) guard->mass_kg += body->node_mass_kg[i];
    keep(guard, body);
    *self = guard;
    return PAL_ERR_OK;
}

/* true when every number is finite and within bounds; comparisons are written so that NaN fails them */
static bool sound(const finite_guard *guard, const pal_body *body)
{
    double energy = 0, limit = guard->reach * body->length_scale_m;
    const int n = body->active ? 0 : 3 * body->n_dof;
    int64_t far = 0;
    for (int k = 0; k < body->n_active && body->active; k++) {
        size_t i = (size_t)body->active[k];
        const double *x = body->x + 3 * i, *r = body->x_rest + 3 * i, *v = body->v + 3 * i;
        for (int c = 0; c < 3; c++) far += fabs(x[c] - r[c]) <= limit ? 0 : 1;
        energy += body->mass_kg[i] * pal_dot3(v, v);
    }
    for (int i = 0; i < n; i++) far += fabs(body->x[i] - body->x_rest[i]) <= limit ? 0 : 1;
    if (body->interpolation) {
        for (int i = 0; i < n; i++) energy += 0 * body->v[i];
        energy += pal_sum_mv2(body->n_node, body->node_mass_kg, body->dv);
    } else if (!body->active)
        energy += pal_sum_mv2(body->n_dof, body->mass_kg, body->v);
    return far == 0 && energy <= guard->mass_kg * guard->speed_m_s * guard->speed_m_s;
}

/* names a non-finite number, the farthest point, or the fastest point with the mean speed that is tested */
static void report_stop(const finite_guard *guard, pal_body *body)
{
    double far_m = 0, fast_m_s = 0, limit = guard->reach * body->length_scale_m;
    double twice_J =
        body->interpolation ? pal_sum_mv2(body->n_node, body->node_mass_kg, body->dv) : 2 * pal_body_kinetic_J(body);
    int far = -1, fast = -1;
    bool number = pal_body_finite(body);
    for (int k = 0; k < body->n_active && number; k++) {
        int i = pal_body_point(body, k);
        double way[3], longest, speed = pal_norm3(body->v + 3 * (size_t)i);
        pal_sub3(way, body->x + 3 * (size_t)i, body->x_rest + 3 * (size_t)i);
        longest = fmax(fabs(way[0]), fmax(fabs(way[1]), fabs(way[2])));
        if (longest > far_m) far_m = longest, far = i;
        if (speed > fast_m_s) fast_m_s = speed, fast = i;
    }
    if (!number)
        pal_body_stop_bad(body, "");
    else if (far_m > limit)
        pal_body_stop(body, far, "%.3g m from its rest place, %.3g m allowed", far_m, limit);
    else
        pal_body_stop(body, fast, "the body %.3g m/s RMS, %.3g m/s RMS allowed", sqrt(twice_J / guard->mass_kg),
                      guard->speed_m_s);
}

static pal_err run(void *self, pal_step *step)
{
    finite_guard *guard = self;
    pal_body *body = step->body;
    /* a body that the solver froze for a non-finite state is restored here too */
    if (sound(guard, body)) {
        if (!body->frozen) keep(guard, body);
        return PAL_ERR_OK;
    }
    report_stop(guard, body);
    for (int k = 0; k < body->n_active; k++) {
        int32_t i = pal_body_point(body, k);
        last_place(guard, body->dofs.levels, i, body->x + 3 * (size_t)i);
        pal_set3(body->v + 3 * (size_t)i, 0, 0, 0);
    }
    pal_body_update_nodes(body);
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    keep(self, body);
}

const pal_effect pal_effect_finite_guard = {PAL_EFFECT("finite_guard", GUARD), .material = material, .reset = reset};
