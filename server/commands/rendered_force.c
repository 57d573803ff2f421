#include "server/commands/rendered_force.h"

#include "server/base/vec3.h"
#include "server/rendering/energy_gate.h"
#include "server/rendering/local_contact.h"
#include "server/rendering/tuning.h"

/* limits of the stiffest devices, which no soft tissue reaches */
static const pal_local_limits limits = {5000, 30, DAMPING_FLOOR_S, INFINITY};

typedef struct use {
    double lambda, age_s; /* share of the newest model, extrapolation of its surfaces */
} use;

typedef struct rendering {
    pal_local_blend blend;
    pal_local_contact_state memory;
    pal_energy_gate gate;
    use in_use, wanted;
    double blend_s, x_m[3], force_N[3];
    bool placed;
} rendering;

static void to_float(float to[3], const double from[3])
{
    for (int c = 0; c < 3; c++) to[c] = (float)from[c];
}

/* the message that carries a tool's model, relative to its pose (server/net/stream.c) */
static void message(const pal_tool *tool, pal_wire_haptic *out)
{
    double offset[3];
    *out = (pal_wire_haptic){.n_patch = (uint32_t)tool->n_patch};
    pal_copy3(out->origin_m, tool->last.position_m);
    for (int k = 0; k < tool->n_patch; k++) {
        const pal_contact_patch *from = &tool->patch[k];
        pal_wire_contact_patch *to = &out->patch[k];
        *to = (pal_wire_contact_patch){.id = (uint16_t)from->id,
                                       .group = (uint16_t)from->group,
                                       .k1_N_m = (float)from->k1_N_m,
                                       .k2_N_m2 = (float)from->k2_N_m2,
                                       .b_N_s_m = (float)from->b_Ns_m,
                                       .radius_m = (float)from->radius_m};
        pal_sub3(offset, from->point_m, out->origin_m);
        to_float(to->p_m, offset), to_float(to->n, from->normal), to_float(to->v_m_s, from->velocity_m_s);
    }
}

static void arrive(void *state, const pal_tool *tool, double period_s)
{
    rendering *s = state;
    pal_wire_haptic model;
    message(tool, &model);
    if (!pal_local_blend_start(&s->blend, s->in_use.lambda, s->in_use.age_s, &model, &limits)) return;
    s->in_use = (use){0, 0};
    s->blend_s = fmin(fmax(period_s, BLEND_MIN_S), BLEND_MAX_S);
}

static double stored(const rendering *s, use of)
{
    pal_local_model mix;
    pal_local_blend_mix(&s->blend, of.lambda, of.age_s, &mix);
    return pal_local_contact_energy(&mix, s->x_m, &limits, &s->memory);
}

static use between(const rendering *s, double share)
{
    return (use){s->in_use.lambda + share * (s->wanted.lambda - s->in_use.lambda),
                 s->in_use.age_s + share * (s->wanted.age_s - s->in_use.age_s)};
}

static double stored_after(const void *user, double share)
{
    return stored(user, between(user, share));
}

static void tick(void *state, double dt_s, const double x_m[3], const double v_m_s[3], double force_N[3])
{
    rendering *s = state;
    pal_local_model mix;
    pal_local_contact_result contact;
    double step[3];
    if (!s->placed) {
        s->gate = (pal_energy_gate){.max_J = TANK_MAX_J, .tank_J = TANK_START_J};
        s->placed = true;
        pal_copy3(s->x_m, x_m);
    }
    pal_sub3(step, x_m, s->x_m);
    pal_copy3(s->x_m, x_m);
    pal_energy_gate_work(&s->gate, -pal_dot3(s->force_N, step), stored(s, s->in_use));
    s->wanted = (use){s->blend_s > 0 ? fmin(1, s->in_use.lambda + dt_s / s->blend_s) : 0,
                      fmin(s->in_use.age_s + dt_s, EXTRAPOLATE_MAX_S)};
    s->in_use = between(s, pal_energy_gate_pay(&s->gate, dt_s, stored_after, s));
    pal_local_blend_mix(&s->blend, s->in_use.lambda, s->in_use.age_s, &mix);
    pal_local_contact_force(&mix, x_m, v_m_s, dt_s, &limits, &s->memory, &contact);
    pal_energy_gate_settle(&s->gate, stored(s, s->in_use));
    pal_copy3(s->force_N, contact.force_N);
    pal_copy3(force_N, contact.force_N);
}

const pal_study_renderer pal_rendered_force = {sizeof(rendering), arrive, tick};
