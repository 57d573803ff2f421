/* A model is a recipe: mesh and material in, body and rows out; it exists only at load. */
#ifndef PAL_SIM_CORE_MODEL_H
#define PAL_SIM_CORE_MODEL_H
#include "server/sim/core/effect.h"

typedef struct pal_model pal_model;
/* the rows a model asks for, in order, with a solver where the scene names none; items are filled with derived
 * constants that the scene did not give */
typedef struct pal_recipe {
    int n_row;
    pal_config_entry row[PAL_ENTRIES_MAX]; /* FORCE, SOLVE and extra rows by effect name */
} pal_recipe;

struct pal_model {
    const char *name; /* tet_springs | subdivision_fem | adaptive_springs | fem */
    /* allocates body arrays (pal_body_allocate), masses, rest; lists the rows. [load] */
    pal_err (*build)(pal_config_entry *item, pal_build *build, pal_recipe *out);
    /* the rows alone, of a body that was built: the same list. [sim] */
    pal_err (*list)(pal_config_entry *item, pal_build *build, pal_recipe *out);
};
#endif
