/* Component sleep: a body at rest costs almost nothing until something comes near.
 *
 * A body falls asleep when for `rest_time_s` of simulated time no point was faster than speed_1_s S, the triangles
 * were unchanged, no tool was near, no component's force changed with time and refinement had nothing left to do; and
 * the residual forces would then move the body by less than rest_1_s2 S in s^2, as a mass-weighted mean (S: the body's
 * box diagonal). Speed alone is not enough: a body that creeps against a large drag is slow but not at rest.
 *
 * A motion that decays with the time constant tau is speed * tau away from rest, and a force moves a body of the lowest
 * frequency w1 by at most force / (mass w1^2). So that what sleep freezes is at most PAL_SLEEP_ERROR_S, both limits are
 * lowered for a slow body: the speed to PAL_SLEEP_ERROR_S S / tau with tau = pal_body_return_s, the residual to
 * PAL_SLEEP_ERROR_S w1^2 S.
 *
 * Velocities are then 0, positions stay the same to the bit, and none of the body's components runs. CONTACT components
 * forget their tool state, as after a reset.
 *
 * The body wakes in the step in which a tool, swept along its path and before contact, comes within reach of the
 * CONTACT components (their hook reach_m), and at a change from the world: a load, a material, a brush, a switched
 * component, a reset. Two kinds of tool keep a body awake: one that is near while the shown surface is farther away
 * than one triangle edge, so that a distance to vertices suffices, and one that grasps or presses the body, wherever it
 * is: tissue follows no farther than the tool's force cap pulls, and must return when it is released.
 *
 * Keys: rest_time_s (0.5), speed_1_s (1e-4), rest_1_s2 (1e-4). */
#include "server/base/vec3.h"
#include "server/sim/core/effect.h"
#include "server/sim/effects/tuning.h"

typedef struct sleeper {
    double rest_time_s, speed_1_s, rest_1_s2;
    double at_rest_s;  /* time without motion */
    uint64_t revision; /* topology revision during that time */
    bool boxed;        /* box and edge_m are up to date */
    double low[3], high[3], edge_m;
} sleeper;

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    sleeper *row = PAL_NEW(build->arena, sleeper, 1);
    if (!row) return PAL_ERR_MEMORY;
    *row = (sleeper){.rest_time_s = 0.5, .speed_1_s = 1e-4, .rest_1_s2 = 1e-4};
    PAL_TRY(pal_entry_read_number(item, "rest_time_s", 0, 1e9, &row->rest_time_s, build->diag));
    PAL_TRY(pal_entry_read_number(item, "speed_1_s", 0, 1e3, &row->speed_1_s, build->diag));
    PAL_TRY(pal_entry_read_number(item, "rest_1_s2", 0, 1e6, &row->rest_1_s2, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    *self = row;
    return PAL_ERR_OK;
}

/* true: no point moves; a non-finite speed is not slow */
static bool slow(const sleeper *row, const pal_body *body)
{
    const double return_s = pal_body_return_s(body);
    const double speed_1_s = return_s > 0 ? fmin(row->speed_1_s, PAL_SLEEP_ERROR_S / return_s) : row->speed_1_s;
    double max = speed_1_s * body->length_scale_m, max2 = max * max;
    bool all = true;
    for (int k = 0; k < body->n_active; k++) {
        const double *v = body->v + 3 * (size_t)pal_body_point(body, k);
        all &= pal_dot3(v, v) <= max2;
    }
    return all;
}

static const float *shown_vertex(const pal_body *body, int k)
{
    return body->display.shown + 3 * (size_t)(body->active ? body->active[k] : k);
}

/* computes the box of the shown surface and its longest edge */
static void measure(sleeper *row, const pal_body *body)
{
    const int32_t *tri = body->display.surface->tri;
    int n_tri = body->display.surface->n_tri;
    int n_shown = body->active ? body->n_active : body->display.n_shown;
    double edge2 = 0;
    pal_box3_empty(row->low, row->high);
    for (int k = 0; k < n_shown; k++) {
        const float *s = shown_vertex(body, k);
        pal_box3_add(row->low, row->high, (double[3]){(double)s[0], (double)s[1], (double)s[2]});
    }
    for (int i = 0; i < 3 * n_tri; i++) {
        const float *a = body->display.shown + 3 * (size_t)tri[i],
                    *b = body->display.shown + 3 * (size_t)tri[i - i % 3 + (i + 1) % 3];
        double x = (double)a[0] - (double)b[0], y = (double)a[1] - (double)b[1], z = (double)a[2] - (double)b[2];
        edge2 = fmax(edge2, x * x + y * y + z * z);
    }
    row->edge_m = sqrt(edge2);
    row->boxed = true;
}

/* true: the path a..b comes within reach of the box; conservative: each axis separately */
static bool passes_box(const sleeper *row, const double a[3], const double b[3], double reach)
{
    bool all = true;
    for (int c = 0; c < 3; c++)
        all = all && fmin(a[c], b[c]) <= row->high[c] + reach && fmax(a[c], b[c]) >= row->low[c] - reach;
    return all;
}

/* true: the path comes within reach of a vertex */
static bool passes_vertex(const pal_body *body, const double a[3], const double b[3], double reach)
{
    int n_shown = body->active ? body->n_active : body->display.n_shown;
    double path[3], reach2 = reach * reach;
    pal_sub3(path, b, a);
    double path2 = pal_dot3(path, path);
    for (int k = 0; k < n_shown; k++) {
        const float *s = shown_vertex(body, k);
        double from[3] = {(double)s[0] - a[0], (double)s[1] - a[1], (double)s[2] - a[2]};
        double t = path2 > 0 ? fmin(fmax(pal_dot3(from, path) / path2, 0), 1) : 0;
        pal_axpy3(from, -t, path);
        if (pal_dot3(from, from) <= reach2) return true;
    }
    return false;
}

/* true: a tool comes within reach of a CONTACT component in this step */
static bool tool_near(sleeper *row, const pal_step *step)
{
    const pal_body *body = step->body;
    for (int t = 0; t < step->tools->n_tool; t++) {
        const pal_tool *tool = &step->tools->tool[t];
        double reach = 0, a[3], b[3];
        if (!tool->present && tool->ramp <= 0) continue;
        for (int i = 0; i < step->n_contact; i++) {
            const pal_component *of = &step->contact[i];
            if (of->effect->sleep.reach_m) reach = fmax(reach, of->effect->sleep.reach_m(of->self, tool));
        }
        if (reach == 0) continue;
        if (isinf(reach)) return true; /* the tool grasps or presses the body */
        if (!row->boxed) measure(row, body);
        /* no point of a triangle is farther from its nearest corner */
        reach += row->edge_m * 0.57735026918962573;
        pal_sub3(a, tool->last.position_m, body->offset_m);
        pal_sub3(b, tool->requested.position_m, body->offset_m);
        if (passes_box(row, a, b, reach) && passes_vertex(body, a, b, reach)) return true;
    }
    return false;
}

/* sum of the residual forces against the limit for rest */
static bool balanced(const sleeper *row, pal_step *step)
{
    const pal_body *body = step->body;
    double force = 0, mass = 0;
    step->drag_separate = false;
    if (pal_assemble_forces(step)) return false;
    for (int k = 0; k < body->n_active; k++) {
        int i = pal_body_point(body, k);
        mass += body->mass_kg[i];
        if (!body->support[i]) force += pal_norm3(body->g + 3 * (size_t)i);
    }
    const double slow_1_s2 = PAL_SLEEP_ERROR_S * body->lowest_1_s * body->lowest_1_s;
    const double rest_1_s2 = body->lowest_1_s > 0 ? fmin(row->rest_1_s2, slow_1_s2) : row->rest_1_s2;
    return force <= rest_1_s2 * body->length_scale_m * mass;
}

static void fall_asleep(pal_step *step)
{
    pal_body *body = step->body;
    for (int k = 0; k < body->n_active; k++) pal_set3(body->v + 3 * (size_t)pal_body_point(body, k), 0, 0, 0);
    pal_body_update_nodes(body);
    for (int i = 0; i < step->n_contact; i++) {
        const pal_component *row = &step->contact[i];
        if (row->effect->reset) row->effect->reset(row->self, body);
    }
    body->asleep = true;
}

static pal_err run(void *self, pal_step *step)
{
    sleeper *row = self;
    pal_body *body = step->body;
    bool same = row->revision == body->display.revision;
    row->revision = body->display.revision;
    row->boxed = false;
    bool at_rest = same && !body->frozen && slow(row, body) &&
                   !pal_components_change(step->force, step->n_force, step->time_s) &&
                   !pal_components_change(step->contact, step->n_contact, step->time_s) &&
                   !pal_components_change(step->adapt, step->n_adapt, step->time_s) && !tool_near(row, step);
    row->at_rest_s = at_rest ? row->at_rest_s + step->dt_s : 0;
    /* slightly less, so that rounding in a sum of steps does not add one */
    if (row->at_rest_s < row->rest_time_s * (1 - 1e-9)) return PAL_ERR_OK;
    row->at_rest_s = 0;
    if (at_rest && balanced(row, step)) fall_asleep(step);
    row->boxed = false;
    return PAL_ERR_OK;
}

static bool wakes(void *self, pal_step *step)
{
    return tool_near(self, step);
}

static void reset(void *self, const pal_body *body)
{
    sleeper *row = self;
    (void)body;
    row->at_rest_s = 0;
    row->boxed = false;
}

const pal_effect pal_effect_sleep = {
    .name = "sleep", .stage = PAL_STAGE_GUARD, .make = make, .run = run, .reset = reset, .sleep.wakes = wakes};
