/* Row ease (ease.h): a load that falls from all in the first step to a tenth in the last of PAL_EASE_STEPS. */
#include "server/sim/ease.h"

#include "server/base/vec3.h"

typedef struct ease {
    int n_done;      /* steps begun; PAL_EASE_STEPS: the last one */
    double *force_N; /* [n_node][3] */
    bool gone;
} ease;

static pal_err run(void *self, pal_step *step)
{
    ease *row = self;
    pal_body *body = step->body;
    if (step->sub == 0) row->n_done++;
    row->gone = row->n_done >= PAL_EASE_STEPS && step->sub == step->n_sub - 1;
    double share = (double)(PAL_EASE_STEPS + 1 - row->n_done) / PAL_EASE_STEPS;
    for (int k = 0; k < pal_body_nodes(body) && share > 0; k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        pal_axpy3(body->load + i, share, row->force_N + i);
    }
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    ease *row = self;
    (void)body;
    row->n_done = PAL_EASE_STEPS + 1;
    row->gone = true;
}

/* while it is there its load falls */
static double settled_s(const void *self)
{
    (void)self;
    return INFINITY;
}

const pal_effect pal_effect_ease = {
    .name = "ease", .stage = PAL_STAGE_CONTACT, .run = run, .reset = reset, .settled_s = settled_s};

/* ---- rows that come and go ---- */

static pal_err put_row(pal_plan *plan, int b, pal_arena *arena, const double *force_N, void **self)
{
    size_t n = 3 * (size_t)plan->body[b].n_node;
    ease *row = PAL_NEW(arena, ease, 1);
    if (!row || !(row->force_N = PAL_NEW(arena, double, n))) return PAL_ERR_MEMORY;
    for (size_t i = 0; i < n; i++) row->force_N[i] = isfinite(force_N[i]) ? force_N[i] : 0;
    *self = row;
    return pal_plan_insert(plan, b,
                           &(pal_row){.effect = &pal_effect_ease, .self = row, .n_byte = pal_arena_used(arena)});
}

static void take_out(pal_ease_rows *rows, pal_plan *plan, int b)
{
    pal_plan_remove(plan, rows->self[b]);
    pal_arena_destroy(rows->arena[b]);
    rows->arena[b] = NULL;
    rows->self[b] = NULL;
}

pal_err pal_ease_rows_set(pal_ease_rows *rows, pal_plan *plan, int body, const double *force_N)
{
    void *self = NULL;
    pal_arena *arena = pal_arena_create(4096, true);
    pal_err err = arena ? put_row(plan, body, arena, force_N, &self) : PAL_ERR_MEMORY;
    if (err) {
        pal_arena_destroy(arena);
        return err;
    }
    if (rows->self[body]) take_out(rows, plan, body);
    rows->arena[body] = arena;
    rows->self[body] = self;
    return PAL_ERR_OK;
}

void pal_ease_rows_tidy(pal_ease_rows *rows, pal_plan *plan)
{
    for (int b = 0; b < PAL_BODY_MAX; b++)
        if (rows->self[b] && ((const ease *)rows->self[b])->gone) take_out(rows, plan, b);
}

void pal_ease_rows_free(pal_ease_rows *rows)
{
    for (int b = 0; b < PAL_BODY_MAX; b++) pal_arena_destroy(rows->arena[b]);
}

size_t pal_ease_rows_bytes(const pal_ease_rows *rows)
{
    size_t n_byte = 0;
    for (int b = 0; b < PAL_BODY_MAX; b++)
        if (rows->self[b]) n_byte += pal_arena_used(rows->arena[b]);
    return n_byte;
}
