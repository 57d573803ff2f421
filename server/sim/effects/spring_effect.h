/* Members of a component of springs of one kind that the kernels `kernel` and `bound_kernel` of its file determine
 * (spring_set.h); self begins with a pal_spring_set. Kernels are inlined, so the members are made for each kind. Each
 * begins by selecting the springs that act at the body's positions (pal_recovery_select). */
#ifndef PAL_SIM_EFFECTS_SPRING_EFFECT_H
#define PAL_SIM_EFFECTS_SPRING_EFFECT_H
#include "server/sim/core/effect_list.h"
#include "server/sim/springs/spring_lattice.h"
#include "server/sim/springs/spring_single.h"

static inline void spring_select(const void *self, const pal_body *body)
{
    pal_recovery_select(((const pal_spring_set *)self)->recovery, body);
}

/* lifecycle.destroy of every kind */
static inline void spring_destroy(void *self)
{
    pal_spring_lattice_leave(self);
}

typedef struct spring_pass {
    const pal_spring_set *set;
    pal_body *body;
    double min[PAL_TEAM_MAX]; /* that the kernel reports, of each part */
} spring_pass;

/* spring_forces: body->f += the forces of all springs, by the threads of the team in parts where there are any; returns
 * the minimum that the kernel reports, at most 1 */
#define PAL_SPRING_FORCES(N_CORNER)                                                                                    \
    static void spring_part(void *user, int worker, int part)                                                          \
    {                                                                                                                  \
        spring_pass *pass = user;                                                                                      \
        const pal_part_blocks parts = pass->set->part_blocks;                                                          \
        const pal_node_order *order = pass->body->node_order;                                                          \
        const int first = parts.first[part], n = parts.first[part + 1] - first;                                        \
        (void)worker;                                                                                                  \
        pal_part_load(&parts, order, part, pass->body->d);                                                             \
        const int32_t *block = parts.block + first;                                                                    \
        pass->min[part] = order->single ? pal_spring_single_run(pass->set, &order->part[part], block, n)               \
                                        : pal_spring_run(pass->set, &order->part[part], block, n, kernel, N_CORNER);   \
        pal_part_add(&parts, order, part, pass->body->f);                                                              \
    }                                                                                                                  \
    static double spring_forces(const pal_spring_set *set, pal_body *body)                                             \
    {                                                                                                                  \
        pal_node_order *order = body->node_order;                                                                      \
        double min = 1;                                                                                                \
        if (set->part_blocks.first && !order->undivided) {                                                             \
            spring_pass pass = {.set = set, .body = body};                                                             \
            pal_team_run(body->team, order->n_part, spring_part, &pass);                                               \
            for (int p = 0; p < order->n_part; p++) min = pass.min[p] < min ? pass.min[p] : min;                       \
        } else {                                                                                                       \
            if (!order->loaded) pal_node_order_load(order, body->d);                                                   \
            const int n = set->simd_blocks.n_lane / PAL_LANES;                                                         \
            min = order->single ? pal_spring_single_run(set, order, NULL, n)                                           \
                                : pal_spring_run(set, order, NULL, n, kernel, N_CORNER);                               \
            if (!order->shares) pal_node_order_add(order, body->f);                                                    \
        }                                                                                                              \
        order->loaded = order->shares;                                                                                 \
        return min;                                                                                                    \
    }

#define PAL_SPRING_MEMBERS(KIND, N_CORNER)                                                                             \
    PAL_SPRING_FORCES(N_CORNER)                                                                                        \
    static pal_err spring_run(void *self, pal_step *step)                                                              \
    {                                                                                                                  \
        const pal_spring_set *set = self;                                                                              \
        spring_select(self, step->body);                                                                               \
        (void)spring_forces(set, step->body);                                                                          \
        if (set->spring.c_Js > 0) pal_spring_damp(set, step->body, KIND);                                              \
        return PAL_ERR_OK;                                                                                             \
    }                                                                                                                  \
    static double spring_energy(void *self, const pal_body *body)                                                      \
    {                                                                                                                  \
        spring_select(self, body);                                                                                     \
        return pal_spring_energy(self, body, KIND);                                                                    \
    }                                                                                                                  \
    static void spring_stiffness(void *self, const pal_body *body, double *bound_N_m)                                  \
    {                                                                                                                  \
        const double k_J = ((const pal_spring_set *)self)->spring.k_J;                                                 \
        spring_select(self, body);                                                                                     \
        pal_spring_bound(self, body->node_order, body->d, bound_kernel, N_CORNER, k_J, true, bound_N_m);               \
    }                                                                                                                  \
    static void spring_damping(void *self, const pal_body *body, double *bound_Ns_m)                                   \
    {                                                                                                                  \
        const double c_Js = ((const pal_spring_set *)self)->spring.c_Js;                                               \
        spring_select(self, body);                                                                                     \
        if (c_Js > 0)                                                                                                  \
            pal_spring_bound(self, body->node_order, body->d, bound_kernel, N_CORNER, c_Js, false, bound_Ns_m);        \
    }
#endif
