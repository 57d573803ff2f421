/* The one table of effects, solvers and models. Adding one is its file in effects/, solvers/ or models/, which defines
 * `const pal_effect pal_effect_NAME` (or `pal_model_NAME`), its line in CMakeLists.txt and its line here. Tests of
 * the table (names, absent effects) cover a new entry; its own test checks its force. The effects brush and blend are
 * not listed, since no scene names them: the world adds them. Thread: any (constants). */
#ifndef PAL_SIM_CORE_EFFECT_LIST_H
#define PAL_SIM_CORE_EFFECT_LIST_H
#include "server/sim/core/effect.h"

/* A model: a function of mesh and material that makes a body and lists its components. It acts at load only. */
typedef struct pal_model pal_model;
/* the components of a model, in order, with a solver where the scene names none; their keys include constants that the
 * scene does not give */
typedef struct pal_component_list {
    int n_row;
    pal_config_entry row[PAL_ENTRIES_MAX]; /* FORCE, SOLVE and others by effect name */
} pal_component_list;

struct pal_model {
    const char *name; /* tet_springs | subdivision_fem | adaptive_springs | fem */
    /* fills the body: arrays (pal_body_allocate), masses, rest, dofs; lists the components. [load] */
    pal_err (*build)(pal_config_entry *item, pal_build *build, pal_component_list *out);
    /* the same list, for a body that was built. [sim] */
    pal_err (*list)(pal_config_entry *item, pal_build *build, pal_component_list *out);
};

#define PAL_EFFECT_LIST(X)                                                                                             \
    X(gravity)                                                                                                         \
    X(viscous)                                                                                                         \
    X(edge_distance)                                                                                                   \
    X(face_area)                                                                                                       \
    X(tet_volume)                                                                                                      \
    X(tet_elastic)                                                                                                     \
    X(hex_elastic)                                                                                                     \
    X(cell_elastic)                                                                                                    \
    X(moving_support)                                                                                                  \
    X(penalty)                                                                                                         \
    X(edge_spring)                                                                                                     \
    X(shape_spring)                                                                                                    \
    X(inflate)                                                                                                         \
    X(verlet)                                                                                                          \
    X(rk4)                                                                                                             \
    X(central_cg)                                                                                                      \
    X(implicit_euler)                                                                                                  \
    X(sdirk2)                                                                                                          \
    X(static_newton)                                                                                                   \
    X(tool_push)                                                                                                       \
    X(tool_grasp)                                                                                                      \
    X(refine)                                                                                                          \
    X(finite_guard)                                                                                                    \
    X(sleep)                                                                                                           \
    X(surface_output)                                                                                                  \
    X(skin_output)                                                                                                     \
    X(field_output)

#define PAL_MODEL_LIST(X) X(tet_springs) X(fem) X(adaptive_springs) X(subdivision_fem)

#define X(name) extern const pal_effect pal_effect_##name;
PAL_EFFECT_LIST(X)
#undef X
#define X(name) extern const pal_model pal_model_##name;
PAL_MODEL_LIST(X)
#undef X

#define X(name) +1
enum { PAL_EFFECT_COUNT = 0 PAL_EFFECT_LIST(X), PAL_MODEL_COUNT = 0 PAL_MODEL_LIST(X) };
#undef X

/* tables in the order above, and look-up by name; NULL: no such name */
extern const pal_effect *const pal_effects[PAL_EFFECT_COUNT];
extern const pal_model *const pal_models[PAL_MODEL_COUNT];
const pal_effect *pal_effect_find(const char *name);
const pal_model *pal_model_find(const char *name);
#endif
