/* A model: a function of mesh and material that makes a body and lists its components. It acts at load only. */
#ifndef PAL_SIM_CORE_MODEL_H
#define PAL_SIM_CORE_MODEL_H
#include "server/sim/core/effect.h"

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
#endif
