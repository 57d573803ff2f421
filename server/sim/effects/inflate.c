/* Component inflate: the content of a closed hollow body exerts pressure on its walls. f_i = p dV/dx_i, where V is
 * the volume within the drawn triangles (watertight for every mixture of levels) and dV/dx_i is a third of the area
 * normals of the triangles at i. Net force and net moment are zero for every shape.
 *
 * With s = V/V_rest, both of the triangles drawn now, so that a switch of level does not change s:
 *   kind "pressure"  p = pressure_Pa
 *   kind "gas"       p = pressure_Pa + absolute_Pa (1/s - 1), isothermal: p_absolute V = const; the second part at most
 *                    PAL_LOAD_CAP_FACTOR absolute_Pa (squeezed flat or everted): finite, and reinflating
 *   kind "fluid"     p = pressure_Pa + bulk_Pa (1 - s), the second part within +-PAL_LOAD_CAP_FACTOR bulk_Pa
 * The energy is -V_0 times the integral of p over s from 1, where V_0 is the rest volume of the finest level; forces
 * are its gradient, so a coarse level, of slightly smaller volume, gets a slightly larger pressure. pressure_Pa > 0
 * inflates, < 0 deflates; it ramps up over the first ramp_s of simulated time, again after a reset.
 *
 * Disconnected parts share one volume. A surface whose faces point inwards is reversed.
 * Keys: kind ("pressure"), pressure_Pa (0), absolute_Pa (101325, gas), bulk_Pa (20000, fluid), ramp_s (0.5). */
#include "server/base/vec3.h"
#include "server/sim/core/blend.h"
#include "server/sim/core/effect_list.h"
#include "server/sim/effects/pressure_bound.h"
#include "server/sim/surface/adaptive_surface.h"

#include <float.h>
#include <string.h>

typedef enum filling { PRESSURE, GAS, FLUID } filling;

typedef struct inflate {
    filling kind;
    double pressure_Pa, stiff_Pa, ramp_s; /* stiff_Pa: absolute_Pa or bulk_Pa             */
    double share;                         /* ramp of pressure_Pa at the last run */
    double fine_m3;                       /* V_0, signed                                  */
    double rest_m3;                       /* V_rest of the triangles at `revision`        */
    uint64_t revision;
    double *gradient; /* dV/dx_i, m^2, of the active nodes [n_node][3] */
} inflate;

static pal_err read_keys(inflate *state, pal_config_entry *item, pal_diagnostic *diag)
{
    static const char *const names[] = {"pressure", "gas", "fluid"};
    int kind = PRESSURE;
    PAL_TRY(pal_entry_read_choice(item, "kind", names, 3, &kind, diag));
    state->kind = (filling)kind;
    state->ramp_s = 0.5;
    state->stiff_Pa = state->kind == GAS ? 101325 : state->kind == FLUID ? 20000 : 0;
    PAL_TRY(pal_entry_read_number(item, "pressure_Pa", -1e12, 1e12, &state->pressure_Pa, diag));
    PAL_TRY(pal_entry_read_number(item, "ramp_s", 0, 1e6, &state->ramp_s, diag));
    if (state->kind == GAS) PAL_TRY(pal_entry_read_number(item, "absolute_Pa", 0, 1e12, &state->stiff_Pa, diag));
    if (state->kind == FLUID) PAL_TRY(pal_entry_read_number(item, "bulk_Pa", 0, 1e12, &state->stiff_Pa, diag));
    return pal_entry_check_unused(item, diag);
}

static pal_err check_surface(inflate *state, const pal_config_entry *item, const pal_build *build)
{
    const pal_adaptive_surface *adaptive = build->body->model.adaptive;
    if (!adaptive)
        return PAL_REFUSE(build->diag, "%s: \"%s\" needs a body of model adaptive_springs", item->path, item->name);
    const pal_levels *levels = &adaptive->levels;
    int n_open = 0, last = levels->n_level - 1;
    for (int32_t e = 0; e < pal_levels_n_edge(levels, 0); e++) n_open += levels->edge[e].face[1] < 0;
    if (n_open > 0)
        return PAL_REFUSE(build->diag, "%s: \"%s\" needs a closed surface, this one has %d open edges", item->path,
                          item->name, n_open);
    state->fine_m3 = pal_surface_volume(&(pal_surface){.n_tri = pal_levels_n_face(levels, last),
                                                       .x = levels->x,
                                                       .tri = levels->face + 3 * (size_t)levels->first_face[last]});
    double size = build->body->length_scale_m,
           min_m3 = DBL_EPSILON * pal_levels_n_face(levels, last) * size * size * size;
    if (!(fabs(state->fine_m3) > min_m3))
        return PAL_REFUSE(build->diag, "%s: the surface encloses %g m3, which cannot be told from nothing", item->path,
                          fabs(state->fine_m3));
    return PAL_ERR_OK;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    inflate keys = {.revision = UINT64_MAX};
    PAL_TRY(check_surface(&keys, item, build));
    PAL_TRY(read_keys(&keys, item, build->diag));
    inflate *state = PAL_NEW(build->arena, inflate, 1);
    if (!state) return PAL_ERR_MEMORY;
    *state = keys;
    state->gradient = PAL_NEW(build->arena, double, 3 * (size_t)build->body->n_node);
    if (!state->gradient) return PAL_ERR_MEMORY;
    *self = state;
    return PAL_ERR_OK;
}

/* V_rest of the drawn triangles; if they enclose almost nothing, that of the finest level */
static void update_rest_volume(inflate *state, const pal_adaptive_surface *adaptive)
{
    if (state->revision == adaptive->revision) return;
    state->revision = adaptive->revision;
    state->rest_m3 = pal_surface_volume(&adaptive->surface);
    if (!(state->rest_m3 / state->fine_m3 > 0.01)) state->rest_m3 = state->fine_m3;
}

/* Sets state->gradient of the active nodes at the present positions; returns V. On a closed surface the area normals
 * give the exact gradient, and V is a third of the sum of x . dV/dx */
static double measure_volume(inflate *state, const pal_body *body)
{
    const pal_adaptive_surface *adaptive = body->model.adaptive;
    const double *from = body->d + 3 * (size_t)pal_body_point(body, 0);
    double sum = 0;
    for (int k = 0; k < body->n_active; k++)
        memset(state->gradient + 3 * (size_t)pal_body_point(body, k), 0, 3 * sizeof(double));
    for (int t = 0; t < adaptive->n_tri; t++) {
        const int32_t *tri = adaptive->tri + 3 * (size_t)t;
        double n[3];
        pal_normal3(n, body->d + 3 * (size_t)tri[0], body->d + 3 * (size_t)tri[1], body->d + 3 * (size_t)tri[2]);
        for (int c = 0; c < 3; c++) pal_axpy3(state->gradient + 3 * (size_t)tri[c], 1.0 / 6, n);
    }
    for (int k = 0; k < body->n_active; k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        double arm[3];
        pal_sub3(arm, body->d + i, from);
        sum += pal_dot3(arm, state->gradient + i);
    }
    return sum / 3;
}

/* over stiff_Pa: the stiff part of the pressure, its slope -d/ds and its integral over s from 1 */
typedef struct answer {
    double value, slope, sum;
} answer;

static answer answer_to(const inflate *state, double s)
{
    const double low = state->kind == GAS ? 1 / (1.0 + PAL_LOAD_CAP_FACTOR) : 1 - PAL_LOAD_CAP_FACTOR;
    const double at = fmin(fmax(s, low), state->kind == GAS ? INFINITY : 1 + PAL_LOAD_CAP_FACTOR);
    answer a = {0};
    if (state->kind == GAS) a = (answer){1 / at - 1, s > low ? 1 / (s * s) : 0, log(at) - (at - 1)};
    if (state->kind == FLUID) a = (answer){1 - at, s == at ? 1 : 0, -0.5 * (1 - at) * (1 - at)};
    a.sum += a.value * (s - at);
    return a;
}

/* sets s and the gradient at the present positions; returns p V_0/V_rest, the factor of the gradient in the force */
static double push(inflate *state, const pal_body *body, double *s)
{
    update_rest_volume(state, body->model.adaptive);
    *s = measure_volume(state, body) / state->rest_m3;
    double p = state->share * state->pressure_Pa + state->stiff_Pa * answer_to(state, *s).value;
    return p * fabs(state->fine_m3) / state->rest_m3;
}

static pal_err run(void *self, pal_step *step)
{
    inflate *state = self;
    pal_body *body = step->body;
    double s;
    state->share = pal_blend_toward(0, 1, step->time_s, state->ramp_s);
    double p = push(state, body, &s);
    for (int k = 0; k < body->n_active; k++) {
        size_t i = 3 * (size_t)pal_body_point(body, k);
        pal_axpy3(body->f + i, p, state->gradient + i);
    }
    return PAL_ERR_OK;
}

static double energy(void *self, const pal_body *body)
{
    inflate *state = self;
    double s;
    push(state, body, &s);
    double sum = state->share * state->pressure_Pa * (s - 1) + state->stiff_Pa * answer_to(state, s).sum;
    return -fabs(state->fine_m3) * sum;
}

/* Two parts. The change of p adds stiffness along g = dV/dx only: k g g', whose largest w^2, k times the sum of
 * g.g/m over the free nodes, is applied at every node; and the stiffness at constant p (pressure_bound.h) */
static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    inflate *state = self;
    const pal_adaptive_surface *adaptive = body->model.adaptive;
    double s, sum = 0;
    (void)push(state, body, &s);
    const answer now = answer_to(state, s);
    double w = fabs(state->fine_m3 / state->rest_m3), k = state->stiff_Pa * now.slope * w / fabs(state->rest_m3);
    /* all of pressure_Pa, whatever the ramp: a limit is reused while nodes hardly move */
    double p = w * (fabs(state->pressure_Pa) + state->stiff_Pa * fabs(now.value));
    for (int n = 0; n < body->n_active; n++) {
        int i = pal_body_point(body, n);
        const double *g = state->gradient + 3 * (size_t)i;
        if (!body->support[i]) sum += pal_dot3(g, g) / body->mass_kg[i];
    }
    for (int n = 0; n < body->n_active; n++) {
        int i = pal_body_point(body, n);
        bound_N_m[i] += k * sum * body->mass_kg[i];
    }
    for (int t = 0; t < adaptive->n_tri && p != 0; t++)
        pal_pressure_bound(body->d, adaptive->tri + 3 * (size_t)t, p / 6, bound_N_m);
}

static double settled_s(const void *self)
{
    return ((const inflate *)self)->ramp_s;
}

static void reset(void *self, const pal_body *body)
{
    (void)body;
    ((inflate *)self)->share = 0;
}

const pal_effect pal_effect_inflate = {PAL_EFFECT("inflate", FORCE), .energy = energy, .bounds.stiffness = stiffness,
                                       .reset = reset, .sleep.settled_s = settled_s};
