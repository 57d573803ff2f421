/* Members of a component of springs of one kind that the kernels `kernel` and `bound_kernel` of its file determine
 * (spring_set.h); self begins with a pal_spring_set. Kernels are inlined, so the members are made for each kind. Each
 * begins by selecting the springs that act at the body's positions (pal_recovery_select). */
#ifndef PAL_SIM_EFFECTS_SPRING_EFFECT_H
#define PAL_SIM_EFFECTS_SPRING_EFFECT_H
#include "server/sim/core/effect_list.h"
#include "server/sim/springs/spring_lattice.h"

static inline void spring_select(const void *self, const pal_body *body)
{
    pal_recovery_select(((const pal_spring_set *)self)->recovery, body);
}

/* lifecycle.destroy of every kind */
static inline void spring_destroy(void *self)
{
    pal_spring_lattice_leave(self);
}

#define PAL_SPRING_MEMBERS(KIND, N_CORNER)                                                                             \
    static pal_err spring_run(void *self, pal_step *step)                                                              \
    {                                                                                                                  \
        const pal_spring_set *set = self;                                                                              \
        pal_body *body = step->body;                                                                                   \
        spring_select(self, body);                                                                                     \
        pal_node_order_load(body->node_order, body->d);                                                                \
        pal_spring_run(set, body->node_order, kernel, N_CORNER);                                                       \
        pal_node_order_add(body->node_order, body->f);                                                                 \
        if (set->spring.c_Js > 0) pal_spring_damp(set, body, KIND);                                                    \
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
