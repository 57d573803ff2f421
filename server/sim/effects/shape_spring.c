/* Component shape_spring: a spring pulls every node to its position in the rest shape (paper C, eq. 10, the
 * shape-preserving springs). f_i = -(m_i/m_0) [k' (x_i - R (X_i - C) - c) + c' (v_i - V - Omega x (x_i - c))], where
 * X_i is the rest position, m_0 the mass of a node of level 0, and k' and c' the constants of such a node. In
 * proportion to mass they act on every level alike: a translation has w^2 = k'/m_0.
 *
 * frame "world": the rest positions themselves, R = 1, V = Omega = 0; the reaction acts on the ground.
 * frame "body": the best-fitting rigid frame (adaptive_surface.h), so that the body may move freely. The fit has the
 * same mass weights, so R, C, c minimise the energy sum k'_i/2 |x_i - R (X_i - C) - c|^2, the force is its exact
 * gradient (envelope theorem), and neither force nor damping has a resultant or a moment.
 *
 * Departures: errata C7 (the paper divides the damping by the spring's length, which is 0 at rest, and its anchors
 * block rigid motion) and C6 (its constant does not depend on the level: refinement stiffens 4 times per level).
 *
 * Keys: k_N_m (0.3 k_0, k_0 the model's spring constant), c_Ns_m (0.6 sqrt(k' m_0): damping ratio 0.3), frame (the
 * model's). Constants that are not given follow a live material edit. */
#include "server/base/team.h"
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/surface/active_nodes.h"
#include "server/sim/surface/adaptive_surface.h"

#include <string.h>

typedef struct shape_spring {
    double k_N_m, c_Ns_m; /* of a node of level 0; c_Ns_m < 0: from k_N_m and its mass */
    double per_young;     /* k_N_m over the material's E; 0: given                      */
    bool world;
    pal_rigid_fit frame; /* of the last run */
} shape_spring;

/* x -> R x + shift is the target position of a node, v -> V + Omega x x the target velocity; constants per mass */
typedef struct hold {
    double R[9], shift[3], V[3], Omega[3], k, c;
} hold;

/* k' of the model's keys, and its ratio to E */
static pal_err derive(shape_spring *anchors, pal_build *build)
{
    pal_config_entry model = build->def->model;
    double thickness_m = 0.003, k_0 = -1, young_Pa = build->def->material.young_Pa;
    PAL_TRY(pal_entry_read_number(&model, "thickness_m", 1e-9, 1e9, &thickness_m, build->diag));
    PAL_TRY(pal_entry_read_number(&model, "k_spring_N_m", 0, 1e60, &k_0, build->diag));
    anchors->per_young = k_0 < 0 ? 0.3 * sqrt(0.75) * thickness_m : 0;
    anchors->k_N_m = k_0 < 0 ? anchors->per_young * young_Pa : 0.3 * k_0;
    return PAL_ERR_OK;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    static const char *const frames[] = {"body", "world"};
    int world = 0;
    for (int i = 0; i < build->body->n_dof; i++) world |= build->body->support[i] != PAL_FREE;
    if (!build->body->model.adaptive)
        return PAL_REFUSE(build->diag, "%s: \"%s\" needs a body of model adaptive_springs", item->path, item->name);
    shape_spring *anchors = PAL_NEW(build->arena, shape_spring, 1);
    if (!anchors) return PAL_ERR_MEMORY;
    anchors->c_Ns_m = -1;
    if (!pal_entry_has(item, "k_N_m")) PAL_TRY(derive(anchors, build));
    PAL_TRY(pal_entry_read_number(item, "k_N_m", 0, 1e60, &anchors->k_N_m, build->diag));
    PAL_TRY(pal_entry_read_number(item, "c_Ns_m", 0, 1e60, &anchors->c_Ns_m, build->diag));
    PAL_TRY(pal_entry_read_choice(item, "frame", frames, 2, &world, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    anchors->world = world;
    anchors->frame.quat[0] = 1;
    PAL_TRY(pal_active_nodes_make(build));
    *self = anchors;
    return PAL_ERR_OK;
}

/* constants over mass */
static double stiff_1_s2(const shape_spring *anchors, const pal_adaptive_surface *adaptive)
{
    return anchors->k_N_m * adaptive->shape_ramp / adaptive->level_mass_kg[0];
}

static double damp_1_s(const shape_spring *anchors, const pal_adaptive_surface *adaptive)
{
    double m = adaptive->level_mass_kg[0];
    return anchors->c_Ns_m < 0 ? 0.6 * sqrt(anchors->k_N_m / m) : anchors->c_Ns_m / m;
}

/* frame: start from the last fit, and the new one; packed: of body->active_nodes */
static hold find_hold(const shape_spring *anchors, const pal_body *body, pal_rigid_fit *frame, bool packed)
{
    hold h = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1},
              .k = stiff_1_s2(anchors, body->model.adaptive),
              .c = damp_1_s(anchors, body->model.adaptive)};
    if (anchors->world) return h;
    double at[3];
    if (packed)
        pal_adaptive_fit_rigid_active(body->model.adaptive, body, frame);
    else
        pal_adaptive_fit_rigid(body->model.adaptive, body, frame);
    memcpy(h.R, frame->R, sizeof h.R);
    pal_mul33(at, h.R, frame->rest_centre_m);
    pal_sub3(h.shift, frame->centre_m, at);
    pal_copy3(h.Omega, frame->Omega_1_s);
    pal_cross3(at, h.Omega, frame->centre_m);
    pal_sub3(h.V, frame->V_m_s, at);
    return h;
}

static inline void strain(const hold *h, const double x[3], const double rest[3], double out[3])
{
    double at[3];
    pal_mul33(at, h->R, rest);
    pal_add3(at, at, h->shift);
    pal_sub3(out, x, at);
}

typedef struct force_pass {
    const pal_body *body;
    const hold *h;
    int n_part;
} force_pass;

static void hold_in_world(void *user, int worker, int part)
{
    const force_pass *p = user;
    const pal_active_nodes *pack = p->body->active_nodes;
    const int end = pal_active_first(p->body, p->n_part, part + 1);
    const double k_1_s2 = p->h->k, c_1_s = p->h->c;
    (void)worker;
    for (int k = pal_active_first(p->body, p->n_part, part); k < end; k++) {
        pal_quad rest = pack->rest[k], x = pal_v8_low(pack->xv[k]), v = pal_v8_high(pack->xv[k]);
        const double m = rest[3];
        rest[3] = 0;
        pack->f[k] -= m * k_1_s2 * (x - rest) + m * c_1_s * v;
    }
}

static void hold_in_frame(void *user, int worker, int part)
{
    const force_pass *p = user;
    const pal_active_nodes *pack = p->body->active_nodes;
    const int end = pal_active_first(p->body, p->n_part, part + 1);
    const hold h = *p->h;
    (void)worker;
    for (int k = pal_active_first(p->body, p->n_part, part); k < end; k++) {
        const double *x = (const double *)&pack->xv[k], *v = x + 4, *rest = (const double *)&pack->rest[k];
        double *f = (double *)&pack->f[k], u[3], rotation[3];
        strain(&h, x, rest, u);
        pal_cross3(rotation, h.Omega, x);
        for (int c = 0; c < 3; c++) f[c] -= rest[3] * (h.k * u[c] + h.c * (v[c] - h.V[c] - rotation[c]));
    }
}

static pal_err compute_forces(void *self, pal_step *step)
{
    shape_spring *anchors = self;
    const pal_body *body = step->body;
    const hold h = find_hold(anchors, body, &anchors->frame, true);
    force_pass p = {.body = body, .h = &h, .n_part = pal_active_parts(body)};
    pal_team_run(body->team, p.n_part, anchors->world ? hold_in_world : hold_in_frame, &p);
    return PAL_ERR_OK;
}

static pal_err run(void *self, pal_step *step)
{
    return pal_active_nodes_run(self, step, compute_forces);
}

static double energy(void *self, const pal_body *body)
{
    const shape_spring *anchors = self;
    pal_rigid_fit frame = anchors->frame;
    const hold h = find_hold(anchors, body, &frame, false);
    double sum = 0, u[3];
    for (int k = 0; k < body->n_active; k++) {
        size_t i = (size_t)pal_body_point(body, k);
        strain(&h, body->d + 3 * i, body->x_rest + 3 * i, u);
        sum += body->mass_kg[i] * pal_dot3(u, u);
    }
    return 0.5 * h.k * sum;
}

/* the frame only removes motion from what is stretched or damped, so the anchors alone bound both */
static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    double k = stiff_1_s2(self, body->model.adaptive);
    for (int n = 0; n < body->n_active; n++)
        bound_N_m[pal_body_point(body, n)] += k * body->mass_kg[pal_body_point(body, n)];
}

static void damping(void *self, const pal_body *body, double *bound_Ns_m)
{
    double c = damp_1_s(self, body->model.adaptive);
    for (int n = 0; n < body->n_active; n++)
        bound_Ns_m[pal_body_point(body, n)] += c * body->mass_kg[pal_body_point(body, n)];
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    shape_spring *anchors = self;
    (void)body, (void)diag;
    if (anchors->per_young > 0) anchors->k_N_m = anchors->per_young * to->young_Pa;
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    (void)body;
    ((shape_spring *)self)->frame = (pal_rigid_fit){.quat = {1}};
}

const pal_effect pal_effect_shape_spring = {PAL_EFFECT("shape_spring", FORCE),
                                            .compute_forces = compute_forces,
                                            .energy = energy,
                                            .bounds = {.stiffness = stiffness, .damping = damping},
                                            .material = material,
                                            .reset = reset};
