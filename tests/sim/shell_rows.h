/* One FORCE row on an adaptive surface without world or solver: body, shell and row made by hand, so that a row is
 * tested alone on any mixture of levels. */
#ifndef TESTS_SIM_SHELL_ROWS_H
#define TESTS_SIM_SHELL_ROWS_H
#include "server/base/vec3.h"
#include "server/mesh/stomach.h"
#include "server/num/polar.h"
#include "server/sim/effect_list.h"
#include "server/sim/shell.h"
#include "tests/check.h"

typedef struct shell_row {
    pal_surface surface;
    pal_arena *arena;
    pal_scene *scene;
    pal_body body;
    pal_shell *shell;
    pal_item item;
    const pal_effect *effect;
    void *self;
    pal_note note;
    uint64_t seed;
} shell_row;

static inline double shell_row_uniform(shell_row *r) /* in [-1, 1) */
{
    return check_random(&r->seed);
}

/* pal_stomach_make takes a while: made once in a process, then copied */
static inline bool shell_row_stomach(pal_surface *out)
{
    static pal_stomach stomach;
    if (!stomach.surface.x && pal_stomach_make(&stomach)) return false;
    return !pal_surface_copy(&stomach.surface, out);
}

/* takes the surface's arrays; false: refused, note says why. Then keys into r->item, then shell_row_make */
static inline bool shell_row_open(shell_row *r, pal_surface *surface, int n_level, int start_level, const char *effect)
{
    memset(r, 0, sizeof *r);
    r->seed = 7;
    r->surface = *surface;
    memset(surface, 0, sizeof *surface);
    r->arena = pal_arena_create(1 << 20, true);
    r->scene = calloc(1, sizeof *r->scene);
    if (!r->arena || !r->scene) abort();
    pal_scene_default(r->scene);
    pal_body_default(&r->scene->body[0], "shell", NULL);
    pal_item_init(&r->scene->body[0].model, "model", "adaptive_springs");
    pal_item_init(&r->item, "effects[0]", effect);
    r->effect = pal_effect_find(effect);
    pal_shell_options options = {.n_level = n_level, .start_level = start_level, .mass_kg = 0.1};
    if (pal_shell_make(&r->surface, &options, &r->body, r->arena, &r->note, &r->shell)) {
        printf("  %s\n", r->note.text);
        return false;
    }
    double low[3], high[3];
    pal_surface_box(&r->surface, low, high);
    r->body.size_m = pal_dist3(low, high);
    return true;
}
static inline pal_err shell_row_make(shell_row *r)
{
    pal_build build = {
        .scene = r->scene, .def = &r->scene->body[0], .body = &r->body, .arena = r->arena, .note = &r->note};
    pal_item item = r->item;
    return r->effect->make(&item, &build, &r->self);
}
static inline void shell_row_number(shell_row *r, const char *key, double number)
{
    if (pal_item_put_number(&r->item, key, number, NULL)) abort();
}
static inline void shell_row_text(shell_row *r, const char *key, const char *text)
{
    if (pal_item_put_text(&r->item, key, text, NULL)) abort();
}
static inline void shell_row_close(shell_row *r)
{
    pal_arena_destroy(r->arena);
    pal_surface_free(&r->surface);
    free(r->scene);
    memset(r, 0, sizeof *r);
}

/* body->f of this row alone, at a time */
static inline void shell_row_run(shell_row *r, double time_s)
{
    pal_step step = {.body = &r->body, .time_s = time_s};
    memset(r->body.f, 0, 3 * sizeof(double) * (size_t)r->body.n_node);
    CHECK_INT(r->effect->run(r->self, &step), 0);
}
static inline double shell_row_energy(shell_row *r)
{
    return r->effect->energy(r->self, &r->body);
}

/* splits n leaves somewhere */
static inline void shell_row_mix(shell_row *r, int n)
{
    for (int i = 0; i < n; i++) {
        int at = (int)(0.5 * (shell_row_uniform(r) + 1) * r->shell->n_leaf);
        pal_shell_split(r->shell, &r->body, r->shell->leaf[at], 0);
        pal_shell_update(r->shell, &r->body);
    }
}
/* active nodes off their rest places, velocities */
static inline void shell_row_shake(shell_row *r, double amount_m, double speed_m_s)
{
    for (int k = 0; k < 3 * r->body.n_active; k++) {
        int i = 3 * r->body.active[k / 3] + k % 3;
        r->body.x[i] = r->body.x_rest[i] + amount_m * shell_row_uniform(r);
        r->body.v[i] = speed_m_s * shell_row_uniform(r);
    }
}
/* turned about an axis, moved, with the velocities of a rigid motion */
static inline void shell_row_turn(shell_row *r, double degrees, const double shift_m[3], const double V[3],
                                  const double Omega[3])
{
    double axis[3], quat[4], half = degrees * M_PI / 360;
    for (int c = 0; c < 3; c++) axis[c] = shell_row_uniform(r);
    pal_unit3(axis, axis, 0);
    quat[0] = cos(half);
    pal_scale3(quat + 1, sin(half), axis);
    for (int k = 0; k < r->body.n_active; k++) {
        size_t i = 3 * (size_t)r->body.active[k];
        pal_quat_rotate(r->body.x + i, quat, r->body.x_rest + i);
        pal_add3(r->body.x + i, r->body.x + i, shift_m);
        pal_cross3(r->body.v + i, Omega, r->body.x + i);
        pal_add3(r->body.v + i, r->body.v + i, V);
    }
}
static inline double shell_row_largest(const shell_row *r) /* force, N */
{
    double most = 0;
    for (int i = 0; i < r->body.n_node; i++) most = fmax(most, pal_norm3(r->body.f + 3 * (size_t)i));
    return most;
}
static inline bool shell_row_finite(const shell_row *r)
{
    for (int i = 0; i < 3 * r->body.n_node; i++)
        if (!isfinite(r->body.f[i])) return false;
    return true;
}

/* net force and torque over the sums of their parts: both at most `least` */
static inline void shell_row_check_balance(const shell_row *r, double least)
{
    double force[3] = {0}, torque[3] = {0}, sum = 0, arms = 0;
    for (int i = 0; i < r->body.n_node; i++) {
        const double *f = r->body.f + 3 * (size_t)i;
        double t[3];
        pal_cross3(t, r->body.x + 3 * (size_t)i, f);
        pal_add3(force, force, f);
        pal_add3(torque, torque, t);
        sum += pal_norm3(f), arms += pal_norm3(t);
    }
    CHECK(sum > 0);
    CHECK_LE(pal_norm3(force), least * sum);
    CHECK_LE(pal_norm3(torque), least * arms);
}

/* largest of |f + dE/dx| over the active nodes, central differences; over the largest force */
static inline double shell_row_gradient_error(shell_row *r, double time_s, double step_m)
{
    double worst = 0;
    shell_row_run(r, time_s);
    double most = shell_row_largest(r);
    for (int k = 0; k < 3 * r->body.n_active; k++) {
        int i = 3 * r->body.active[k / 3] + k % 3;
        double x = r->body.x[i];
        r->body.x[i] = x + step_m;
        double up = shell_row_energy(r);
        r->body.x[i] = x - step_m;
        double down = shell_row_energy(r);
        r->body.x[i] = x;
        worst = fmax(worst, fabs(r->body.f[i] + (up - down) / (2 * step_m)));
    }
    return worst / most;
}

/* the largest w^2 of this row about the present state, by power iteration on force differences */
static inline double shell_row_stiffest(shell_row *r, double time_s, double step_m, int n_turn)
{
    int n = 3 * r->body.n_active;
    double *x = malloc(sizeof(double) * (size_t)n), *p = malloc(sizeof(double) * (size_t)n),
           *up = malloc(sizeof(double) * (size_t)n), w2 = 0;
    if (!x || !p || !up) abort();
    for (int k = 0; k < n; k++) {
        x[k] = r->body.x[3 * r->body.active[k / 3] + k % 3];
        p[k] = shell_row_uniform(r);
    }
    for (int turn = 0; turn < n_turn; turn++) {
        double size = 0, along = 0;
        for (int k = 0; k < n; k++) size += p[k] * p[k];
        for (int k = 0; k < n; k++) p[k] /= sqrt(size);
        for (int side = 1; side >= -1; side -= 2) {
            for (int k = 0; k < n; k++) r->body.x[3 * r->body.active[k / 3] + k % 3] = x[k] + side * step_m * p[k];
            shell_row_run(r, time_s);
            for (int k = 0; k < n && side > 0; k++) up[k] = r->body.f[3 * r->body.active[k / 3] + k % 3];
        }
        for (int k = 0; k < n; k++) {
            int i = 3 * r->body.active[k / 3] + k % 3;
            double q = (r->body.f[i] - up[k]) / (2 * step_m) / r->body.mass_kg[i / 3];
            along += q * p[k];
            p[k] = q;
        }
        w2 = along;
    }
    for (int k = 0; k < n; k++) r->body.x[3 * r->body.active[k / 3] + k % 3] = x[k];
    free(x), free(p), free(up);
    return w2;
}
/* the largest K_i/m_i that the row's hook bounds it by */
static inline double shell_row_bound(shell_row *r)
{
    double *sum = calloc((size_t)r->body.n_dof, sizeof *sum), most = 0;
    if (!sum) abort();
    r->effect->stiffness(r->self, &r->body, sum);
    for (int k = 0; k < r->body.n_active; k++) {
        int i = r->body.active[k];
        most = fmax(most, sum[i] / r->body.mass_kg[i]);
    }
    free(sum);
    return most;
}
#endif
