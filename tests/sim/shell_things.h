/* Adaptive surfaces as tests make, stir and shake them. */
#ifndef TESTS_SIM_SHELL_THINGS_H
#define TESTS_SIM_SHELL_THINGS_H
#include "server/mesh/stomach.h"
#include "server/num/random.h"
#include "server/sim/shell.h"
#include "tests/check.h"

typedef struct thing {
    pal_arena *arena;
    pal_body body;
    pal_shell *shell;
} thing;

static const char *const shape_name[] = {"sphere", "stomach", "sheet"};
enum { SPHERE, STOMACH, SHEET };

/* made once, a copy each time */
static inline pal_surface surface_of(int shape)
{
    static pal_surface made[3];
    pal_surface s = {0};
    if (!made[shape].x) {
        pal_stomach stomach = {0};
        pal_err err = shape == SPHERE    ? pal_sphere_make(0.05, &made[shape])
                      : shape == STOMACH ? pal_stomach_make(&stomach)
                                         : pal_sheet_make(7, 5, 0.12, 0.08, &made[shape], NULL);
        if (shape == STOMACH) made[shape] = stomach.surface;
        if (err) CHECK_FAIL("no %s", shape_name[shape]);
    }
    if (pal_surface_copy(&made[shape], &s)) CHECK_FAIL("no copy");
    return s;
}

static inline thing make(int shape, pal_shell_options options)
{
    thing t = {.arena = pal_arena_create(1 << 20, true)};
    pal_surface s = surface_of(shape);
    pal_note note = {.text = "no note"};
    if (!(options.mass_kg > 0)) options.mass_kg = 0.3;
    if (pal_shell_make(&s, &options, &t.body, t.arena, &note, &t.shell)) CHECK_FAIL("%s", note.text);
    pal_surface_free(&s);
    return t;
}

static inline void give_back(thing *t)
{
    pal_arena_destroy(t->arena);
}

static inline double total_mass(const pal_body *body)
{
    long double sum = 0;
    for (int i = 0; i < body->n_node; i++) sum += (long double)body->mass_kg[i];
    return (double)sum;
}

/* ---- random walks through the states ---- */

typedef struct dice {
    uint64_t seed, n;
} dice;

static inline int32_t roll(dice *d, int32_t n)
{
    return (int32_t)(pal_random_bits(d->seed, d->n++) % (uint64_t)n);
}

/* n tries to split a random leaf or to join a random family; lists are those of the last update, so many are refused */
static inline int stir(thing *t, dice *d, int n, int most_node)
{
    pal_shell *s = t->shell;
    int done = 0;
    while (n-- > 0) {
        int32_t leaf = s->leaf[roll(d, s->n_leaf)], parent = pal_levels_face_parent(&s->levels, leaf);
        if (roll(d, 2))
            done += pal_shell_split(s, &t->body, leaf, most_node) > 0;
        else if (parent >= 0)
            done += pal_shell_join(s, &t->body, parent);
    }
    return done;
}

static inline void shake(thing *t, uint64_t seed)
{
    for (int k = 0; k < t->body.n_active; k++)
        for (int c = 0; c < 3; c++) {
            int at = 3 * t->body.active[k] + c;
            t->body.x[at] = t->body.x_rest[at] + 0.002 * (pal_random_unit(seed, (uint64_t)at) - 0.5);
            t->body.v[at] = pal_random_unit(seed + 1, (uint64_t)at) - 0.5;
        }
}
#endif
