/* The members of a component of springs of one kind that the kernels `kernel` and `bound_kernel` of its file determine
 * (spring_set.h); self is a pal_spring_set. Kernels are inlined, so the members are made for each kind. */
#ifndef PAL_SIM_EFFECTS_SPRING_EFFECT_H
#define PAL_SIM_EFFECTS_SPRING_EFFECT_H
#include "server/sim/core/effect_list.h"
#include "server/sim/springs/spring_recovery.h"

#define PAL_SPRING_EFFECT(NAME, KIND, N_CORNER)                                                                        \
    static pal_spring_set *springs(void *self)                                                                         \
    {                                                                                                                  \
        return self;                                                                                                   \
    }                                                                                                                  \
    static pal_err run(void *self, pal_step *step)                                                                     \
    {                                                                                                                  \
        const pal_spring_set *set = self;                                                                              \
        pal_body *body = step->body;                                                                                   \
        pal_node_order_load(body->node_order, body->d);                                                                \
        pal_spring_run(set, body->node_order, kernel, N_CORNER);                                                       \
        pal_node_order_add(body->node_order, body->f);                                                                 \
        if (set->spring.c_Js > 0) pal_spring_damp(set, body, KIND);                                                    \
        return PAL_ERR_OK;                                                                                             \
    }                                                                                                                  \
    static double energy(void *self, const pal_body *body)                                                             \
    {                                                                                                                  \
        return pal_spring_energy(self, body, KIND);                                                                    \
    }                                                                                                                  \
    static void stiffness(void *self, const pal_body *body, double *bound_N_m)                                         \
    {                                                                                                                  \
        const double k_J = ((const pal_spring_set *)self)->spring.k_J;                                                 \
        pal_spring_bound(self, body->node_order, body->d, bound_kernel, N_CORNER, k_J, true, bound_N_m);               \
    }                                                                                                                  \
    static void damping(void *self, const pal_body *body, double *bound_Ns_m)                                          \
    {                                                                                                                  \
        const double c_Js = ((const pal_spring_set *)self)->spring.c_Js;                                               \
        if (c_Js > 0)                                                                                                  \
            pal_spring_bound(self, body->node_order, body->d, bound_kernel, N_CORNER, c_Js, false, bound_Ns_m);        \
    }                                                                                                                  \
    const pal_effect pal_effect_##NAME = {PAL_EFFECT(#NAME, FORCE),                                                    \
                                          .internal = true,                                                            \
                                          .energy = energy,                                                            \
                                          .bounds = {.stiffness = stiffness, .damping = damping},                      \
                                          .recovery = {.springs = springs, .recover = pal_spring_recover},             \
                                          .material = pal_spring_set_material};
#endif
