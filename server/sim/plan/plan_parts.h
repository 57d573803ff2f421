/* What the files of the plan share: what the entries of a body ask for. Private to plan*.c. */
#ifndef PAL_SIM_PLAN_PARTS_H
#define PAL_SIM_PLAN_PARTS_H
#include "server/sim/core/model.h"
#include "server/sim/plan/plan.h"

/* what one body's entries ask for, in order, before rows are made */
typedef struct pal_wish {
    const pal_effect *effect;
    pal_item *item;
} pal_wish;
enum { PAL_WISH_MAX = 2 * PAL_ROW_ITEMS + 2 };

typedef struct pal_wishes {
    pal_build build;
    pal_recipe recipe;
    pal_item own[PAL_ROW_ITEMS + 3]; /* copies of the scene's items: reading marks them */
    pal_wish wish[PAL_WISH_MAX];
    int n_wish;
} pal_wishes;

/* the ordered wishes of a body from s->recipe, which own[0], the model's entry, gave, and its other entries */
pal_err pal_wishes_collect(pal_wishes *s);
/* makes the row of a wish: memory of its own, or with `shared` of the body's */
pal_err pal_wishes_make(pal_wishes *s, const pal_wish *wish, bool shared, pal_row *row);
/* what in the scene calls for a wish: at most n_byte characters; returns the length it wanted */
size_t pal_wish_why(const pal_wishes *s, const pal_wish *wish, char *text, size_t n_byte);
/* destroys a made row and its own memory */
void pal_plan_unmake(pal_row *row);
#endif
