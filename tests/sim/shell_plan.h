/* Bodies of adaptive springs for tests of single rows: the scene's plan alone, without a world that steps it. Fill the
 * scene as for shells.h, then shell_plan_open. */
#ifndef TESTS_SIM_SHELL_PLAN_H
#define TESTS_SIM_SHELL_PLAN_H
#include "server/sim/effect_list.h"
#include "server/sim/plan.h"
#include "tests/sim/shells.h"

typedef struct shell_plan {
    shell_scene s; /* s.world stays NULL */
    pal_arena *arena;
    pal_plan plan;
    pal_body *body;
    pal_shell *shell;
    uint64_t seed;
} shell_plan;

static inline double shell_plan_uniform(shell_plan *p) /* in [-1, 1) */
{
    return check_random(&p->seed);
}

/* a sphere of 114 vertices, the stomach, a sheet */
static inline void shell_plan_sphere(shell_plan *p)
{
    pal_surface surface = {0};
    memset(p, 0, sizeof *p);
    if (pal_sphere_make(0.1, &surface)) abort();
    shell_scene_take(&p->s, &surface);
}
static inline void shell_plan_stomach(shell_plan *p)
{
    pal_stomach stomach = {0};
    memset(p, 0, sizeof *p);
    if (pal_stomach_make(&stomach)) abort();
    shell_scene_take(&p->s, &stomach.surface);
    pal_stomach_free(&stomach);
}
static inline void shell_plan_sheet(shell_plan *p, int n, int m, double width_m, double height_m)
{
    pal_surface surface = {0};
    memset(p, 0, sizeof *p);
    if (pal_sheet_make(n, m, width_m, height_m, &surface, NULL)) abort();
    shell_scene_take(&p->s, &surface);
}

/* nothing is shown, so that the OUTPUT row is nobody's business here */
static inline bool shell_plan_open(shell_plan *p)
{
    p->seed = 7;
    p->arena = pal_arena_create(1 << 20, true);
    p->s.scene->body[0].output.name[0] = 0;
    if (pal_plan_build(p->s.scene, p->arena, &p->s.note, &p->plan)) {
        printf("  %s\n", p->s.note.text);
        return false;
    }
    p->body = &p->plan.body[0];
    p->shell = p->body->shell;
    return true;
}
static inline void shell_plan_close(shell_plan *p)
{
    pal_plan_free(&p->plan);
    pal_arena_destroy(p->arena);
    shell_scene_close(&p->s);
}

/* the row of an effect; NULL: there is none */
static inline pal_row *shell_plan_row(shell_plan *p, const char *name)
{
    for (int i = 0; i < p->plan.n_row; i++)
        if (!strcmp(p->plan.row[i].effect->name, name)) return &p->plan.row[i];
    return NULL;
}
static inline pal_step shell_plan_step(shell_plan *p, double dt_s)
{
    return (pal_step){.body = p->body,
                      .force = p->plan.row + p->plan.first[PAL_STAGE_FORCE][0],
                      .n_force = p->plan.n_of[PAL_STAGE_FORCE][0],
                      .dt_s = dt_s,
                      .time_s = dt_s,
                      .n_sub = 1};
}
/* body->f = the forces of one row alone */
static inline void shell_plan_force(shell_plan *p, const pal_row *row)
{
    pal_step step = shell_plan_step(p, 0);
    memset(p->body->f, 0, 3 * sizeof(double) * (size_t)p->body->n_node);
    CHECK_INT(row->effect->run(row->self, &step), 0);
}
/* n sub-steps of dt_s by the SOLVE row */
static inline void shell_plan_run(shell_plan *p, int n, double dt_s)
{
    pal_row *solve = &p->plan.row[p->plan.first[PAL_STAGE_SOLVE][0]];
    for (int i = 0; i < n; i++) {
        pal_step step = shell_plan_step(p, dt_s);
        if (solve->effect->run(solve->self, &step)) abort();
    }
}
static inline double shell_plan_limit(shell_plan *p)
{
    pal_row *solve = &p->plan.row[p->plan.first[PAL_STAGE_SOLVE][0]];
    pal_step step = shell_plan_step(p, 1);
    return solve->effect->limit(solve->self, &step);
}
/* kinetic and of all rows */
static inline double shell_plan_energy(shell_plan *p)
{
    double sum = pal_body_kinetic_J(p->body);
    for (int i = 0; i < p->plan.n_row; i++)
        if (p->plan.row[i].effect->energy) sum += p->plan.row[i].effect->energy(p->plan.row[i].self, p->body);
    return sum;
}

/* splits n leaves here and there */
static inline void shell_plan_mix(shell_plan *p, int n)
{
    for (int i = 0; i < n; i++) {
        int at = (int)((shell_plan_uniform(p) + 1) / 2 * p->shell->n_leaf);
        pal_shell_split(p->shell, p->body, p->shell->leaf[at], 0);
        pal_shell_update(p->shell, p->body);
    }
}
/* nodes off their rest places by up to `part` of h_m, and moving */
static inline void shell_plan_shake(shell_plan *p, double part, double speed_m_s)
{
    pal_body *body = p->body;
    for (int k = 0; k < body->n_active; k++)
        for (int c = 0; c < 3; c++) {
            size_t i = 3 * (size_t)pal_body_point(body, k) + (size_t)c;
            body->x[i] = body->x_rest[i] + part * body->h_m * shell_plan_uniform(p);
            body->v[i] = speed_m_s * shell_plan_uniform(p);
        }
}
#endif
