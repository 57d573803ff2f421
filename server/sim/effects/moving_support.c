/* Nodes led along a path: a support that moves, once or there and back (breathing).
 *
 * A node at X at rest is at  c + R(s angle) (X - c) + s shift  at time t, c being the centroid of the row's nodes at
 * rest and R the turn about `turn_axis`. s goes smoothly from 0 to 1 in rise_s, (1 - cos(pi t / rise)) / 2, at least
 * within one step of the scene, and stays; with period_s it is multiplied by (1 - cos(2 pi t / period)) / 2. In each
 * sub-step the nodes get the velocity that brings them to their place at its end; solvers keep it (PAL_PRESCRIBED).
 * The path depends on time alone, so a restart or another sub-step gives the same places.
 *
 * Keys: low_m and high_m (a box, body frame) or lowest (0.05: share of the body's height along `up`), shift_m (0 0 0),
 * turn_axis (0 0 1), turn_deg (0), rise_s (0), period_s (0: goes and stays). */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"

typedef struct moving_support {
    int n_node;
    int32_t *node;     /* [n_node] */
    double centre[3];  /* m        */
    double shift_m[3]; /* at s = 1 */
    double axis[3], angle;
    double rise_s, period_s;
} moving_support;

static pal_err read_keys(moving_support *row, pal_config_entry *item, pal_diagnostic *diag, double low[3],
                         double high[3], double *lowest)
{
    double degrees = 0;
    bool box = pal_entry_has(item, "low_m") || pal_entry_has(item, "high_m");
    if (box && pal_entry_has(item, "lowest"))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: either low_m and high_m or lowest", item->path);
    if (box && !(pal_entry_has(item, "low_m") && pal_entry_has(item, "high_m")))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: low_m and high_m belong together", item->path);
    if (box) *lowest = NAN;
    PAL_TRY(pal_entry_read_numbers(item, "low_m", 3, low, diag));
    PAL_TRY(pal_entry_read_numbers(item, "high_m", 3, high, diag));
    PAL_TRY(pal_entry_read_number(item, "lowest", 0, 1, lowest, diag));
    PAL_TRY(pal_entry_read_numbers(item, "shift_m", 3, row->shift_m, diag));
    PAL_TRY(pal_entry_read_numbers(item, "turn_axis", 3, row->axis, diag));
    PAL_TRY(pal_entry_read_number(item, "turn_deg", -1e6, 1e6, &degrees, diag));
    PAL_TRY(pal_entry_read_number(item, "rise_s", 0, 1e6, &row->rise_s, diag));
    PAL_TRY(pal_entry_read_number(item, "period_s", 0, 1e6, &row->period_s, diag));
    PAL_TRY(pal_entry_check_unused(item, diag));
    row->angle = degrees * M_PI / 180;
    if (!pal_unit3(row->axis, row->axis, 0))
        return pal_diagnostic_set(diag, PAL_ERR_REFUSED, "%s: turn_axis has no direction", item->path);
    return PAL_ERR_OK;
}

static bool inside(const double x[3], const double low[3], const double high[3])
{
    for (int c = 0; c < 3; c++)
        if (!(x[c] >= low[c] && x[c] <= high[c])) return false;
    return true;
}

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    pal_body *body = build->body;
    double low[3] = {0}, high[3] = {0}, lowest = 0.05, least = INFINITY, most = -INFINITY;
    const double *up = build->scene->up;
    moving_support *row = PAL_NEW(build->arena, moving_support, 1);
    if (!row) return PAL_ERR_MEMORY;
    row->axis[2] = 1;
    PAL_TRY(read_keys(row, item, build->diag, low, high, &lowest));
    row->rise_s = fmax(row->rise_s, build->scene->step_s);
    row->node = PAL_NEW(build->arena, int32_t, body->n_dof);
    if (!row->node) return PAL_ERR_MEMORY;
    for (int i = 0; i < body->n_dof; i++) {
        double z = pal_dot3(body->x_rest + 3 * (size_t)i, up);
        least = fmin(least, z), most = fmax(most, z);
    }
    /* a hair above, so that rounding does not part nodes of one height */
    double top = least + (lowest + 1e-9) * (most - least);
    for (int i = 0; i < body->n_dof; i++) {
        const double *x = body->x_rest + 3 * (size_t)i;
        if (isnan(lowest) ? !inside(x, low, high) : pal_dot3(x, up) > top) continue;
        body->support[i] = PAL_PRESCRIBED;
        pal_add3(row->centre, row->centre, x);
        row->node[row->n_node++] = i;
    }
    if (row->n_node == 0)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED, "%s: moving_support holds none of the body's %d nodes",
                                  item->path, body->n_dof);
    pal_scale3(row->centre, 1.0 / row->n_node, row->centre);
    *self = row;
    return PAL_ERR_OK;
}

/* s at a time */
static double progress(const moving_support *row, double time_s)
{
    double t = time_s / row->rise_s, s = t >= 1 ? 1 : 0.5 * (1 - cos(M_PI * t));
    return row->period_s > 0 ? s * 0.5 * (1 - cos(2 * M_PI * time_s / row->period_s)) : s;
}

static pal_err run(void *self, pal_step *step)
{
    const moving_support *row = self;
    pal_body *body = step->body;
    double s = progress(row, step->time_s), half = 0.5 * s * row->angle;
    double quat[4] = {cos(half), sin(half) * row->axis[0], sin(half) * row->axis[1], sin(half) * row->axis[2]};
    for (int i = 0; i < row->n_node; i++) {
        size_t k = 3 * (size_t)row->node[i];
        double way[3], *v = body->v + k;
        pal_sub3(way, body->x_rest + k, row->centre);
        pal_quat_rotate(way, quat, way);
        pal_add3(way, way, row->centre);
        pal_axpy3(way, s, row->shift_m);
        pal_sub3(way, way, body->x + k);
        /* what is rounding only is no motion */
        bool there = pal_norm3(way) <= 1e-14 * body->length_scale_m;
        pal_scale3(v, there ? 0 : 1 / step->dt_s, way);
    }
    return PAL_ERR_OK;
}

static double settled_s(const void *self)
{
    const moving_support *row = self;
    return row->period_s > 0 ? INFINITY : row->rise_s;
}

const pal_effect pal_effect_moving_support = {
    .name = "moving_support", .stage = PAL_STAGE_CONTACT, .make = make, .run = run, .settled_s = settled_s};
