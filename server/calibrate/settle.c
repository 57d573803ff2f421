/* Runs a calibrated body until it is at rest. */
#include "server/calibrate/settle.h"

#include "server/base/vec3.h"
#include "server/calibrate/tuning.h"

#include <math.h>
#include <stdlib.h>

const double pal_settle_rates_1_s[PAL_SETTLE_STEPS] = {0.5, 1, 2, 4, 8, 16};
enum { USUAL = 3 };

void pal_settle_default(pal_settle_options *options)
{
    *options = (pal_settle_options){.max_simulated_s = 60, .max_work = 1.5e9};
}

/* A of settle.h */
static double mean_gain(const pal_body *body, const double *force_N)
{
    double force = 0, mass = 0;
    for (int i = 0; i < body->n_dof; i++) {
        force += pal_norm3(force_N + 3 * i);
        if (!body->support[i]) mass += body->mass_kg[i];
    }
    return force / mass;
}

/* Is the body at rest now? damping: rate of the component viscous, which the solver applies separately from f. */
static bool is_at_rest(const pal_body *body, double damping_1_s, double gain_m_s2)
{
    double v_max = 0, v_sum = 0, a_max = 0, a_sum = 0, u_max = 0;
    int n = 0;
    for (int i = 0; i < body->n_dof; i++) {
        if (body->support[i]) continue;
        const double *v = body->v + 3 * i, *f = body->f + 3 * i;
        double a[3], speed = pal_norm3(v);
        for (int c = 0; c < 3; c++) a[c] = f[c] / body->mass_kg[i] - damping_1_s * v[c];
        double size = pal_norm3(a);
        v_max = fmax(v_max, speed), v_sum += speed;
        a_max = fmax(a_max, size), a_sum += size;
        u_max = fmax(u_max, pal_dist3(body->x + 3 * i, body->x_rest + 3 * i));
        n++;
    }
    double speed = sqrt(u_max * gain_m_s2);
    return u_max > 0 && v_max <= PAL_SETTLE_MAX_V * speed && v_sum <= PAL_SETTLE_MEAN_V * speed * n &&
           a_max <= PAL_SETTLE_MAX_A * gain_m_s2 && a_sum <= PAL_SETTLE_MEAN_A * gain_m_s2 * n;
}

static void compare(const pal_body *body, const double *u, pal_settle_run *out)
{
    double sum = 0, max = 0;
    out->max_m = 0;
    out->difference_percent = NAN;
    for (int i = 0; i < body->n_dof; i++) {
        double d[3];
        pal_sub3(d, body->x + 3 * i, body->x_rest + 3 * i);
        out->max_m = fmax(out->max_m, pal_norm3(d));
        if (!u) continue;
        pal_sub3(d, d, u + 3 * i);
        sum += pal_dot3(d, d);
        max = fmax(max, pal_norm3(u + 3 * i));
    }
    if (u && max > 0) out->difference_percent = 100 * sqrt(sum / body->n_dof) / max;
}

/* present damping of the component viscous */
static double damping_of(const pal_world *world)
{
    double rate = 0;
    for (int k = 0; k < pal_world_component_count(world); k++) {
        const pal_component *component = pal_world_component(world, k);
        if (component->effect->drag) rate += component->effect->drag(component->self);
    }
    return rate;
}

pal_err pal_settle(pal_world *world, double step_s, const pal_settle_load *load, const pal_settle_options *options,
                   double *work, pal_settle_run *out, pal_diagnostic *diag)
{
    pal_body *body = pal_world_body(world, 0);
    double damping = damping_of(world), gain = mean_gain(body, load->force_N), since = 0, time = 0;
    *out = (pal_settle_run){.difference_percent = NAN};
    pal_world_reset(world);
    body->load_cap_N = INFINITY;
    for (int i = 0; i < body->n_node; i++)
        if (pal_dot3(load->force_N + 3 * i, load->force_N + 3 * i) > 0) {
            pal_err err = pal_world_load(world, 0, i, load->force_N + 3 * i);
            if (err) return pal_diagnostic_set(diag, err, "no memory for the loads of a live run");
        }
    while (!out->steady && time<options->max_simulated_s && * work> 0) {
        const double share = time / options->max_simulated_s;
        if (options->progress && !options->progress("live body comes to rest", share, options->user))
            return pal_diagnostic_set(diag, PAL_ERR_STATE, "stopped while the live body was coming to rest");
        if (pal_world_step(world, step_s) || body->frozen) break;
        time += step_s;
        *work -= (double)pal_world_substeps(world) * body->tets->n_tet;
        since = is_at_rest(body, damping, gain) ? since + step_s : 0;
        out->steady = since >= PAL_SETTLE_HOLD_S;
    }
    out->seconds = time;
    compare(body, load->u, out);
    return PAL_ERR_OK;
}

typedef struct climb {
    pal_world *world;
    const pal_scene *scene;
    const pal_settle_load *load;
    int n_load, first;
    pal_settle_options options;
    double work;
    pal_settle_report *out;
    pal_diagnostic *diag;
} climb;

/* Runs all loads at one rate, which ends once their mean cannot be the least. seconds: their mean, NaN: not steady.
 * *better: settles sooner than all before */
static pal_err try_rate(climb *c, double rate_1_s, bool first, double *seconds, bool *better)
{
    pal_settle_report *out = c->out;
    pal_settle_run run[PAL_SETTLE_LOADS] = {0};
    pal_settle_options options = c->options;
    pal_material material = c->scene->body[0].material;
    double max = c->n_load * (out->steady ? out->seconds : c->options.max_simulated_s), left = max;
    bool steady = true;
    material.damping_1_s = rate_1_s;
    PAL_TRY(pal_world_material(c->world, 0, &material, c->diag));
    for (int k = 0; k < c->n_load && steady; k++) {
        options.max_simulated_s = fmin(c->options.max_simulated_s, left);
        PAL_TRY(pal_settle(c->world, c->scene->step_s, &c->load[k], &options, &c->work, &run[k], c->diag));
        left -= run[k].seconds;
        steady = run[k].steady;
    }
    double mean = *seconds = steady ? (max - left) / c->n_load : NAN;
    *better = steady && (!out->steady || mean < out->seconds);
    /* a body that never rests reports its first run */
    for (int i = 0; i < c->n_load && (*better || (!out->steady && first)); i++) out->load[i] = run[i];
    if (!*better) return PAL_ERR_OK;
    out->steady = true;
    out->seconds = mean;
    out->damping_1_s = material.damping_1_s;
    return PAL_ERR_OK;
}

static pal_err try_rung(climb *c, int rung, bool *better)
{
    return try_rate(c, pal_settle_rates_1_s[rung], rung == c->first, &c->out->rate_seconds[rung], better);
}

/* the rate nearest to 2/T, by the geometric mean of the loads */
static int first_rung(const climb *c)
{
    const pal_body *body = pal_world_body(c->world, 0);
    double sum = 0;
    int best = USUAL;
    for (int k = 0; k < c->n_load; k++) {
        double max = c->load[k].u ? pal_max_norm3(c->load[k].u, body->n_node) : 0;
        double gain = mean_gain(body, c->load[k].force_N);
        if (!(max > 0 && gain > 0)) return USUAL;
        sum += log(2 * sqrt(gain / max)) / c->n_load;
    }
    for (int k = 0; k < PAL_SETTLE_STEPS; k++)
        if (fabs(log(pal_settle_rates_1_s[k]) - sum) < fabs(log(pal_settle_rates_1_s[best]) - sum)) best = k;
    return best;
}

static pal_err run_climb(climb *c)
{
    bool better, up = false;
    double seconds;
    if (c->options.damping_1_s > 0) {
        c->out->damping_1_s = c->options.damping_1_s;
        return try_rate(c, c->options.damping_1_s, true, &seconds, &better);
    }
    c->first = first_rung(c);
    PAL_TRY(try_rung(c, c->first, &better));
    for (int k = c->first + 1; k < PAL_SETTLE_STEPS && c->work > 0; k++) {
        PAL_TRY(try_rung(c, k, &better));
        if (!better && c->out->steady) break;
        up |= better;
    }
    /* a body that oscillates faster than the rates cover settles soonest at the largest one */
    up |= c->first == PAL_SETTLE_STEPS - 1 && c->out->steady;
    for (int k = c->first - 1; k >= 0 && !up && c->work > 0; k--) {
        PAL_TRY(try_rung(c, k, &better));
        if (!better && c->out->steady) break;
    }
    return PAL_ERR_OK;
}

pal_err pal_settle_world(const pal_scene *scene, double damping_1_s, pal_world **out, pal_diagnostic *diag)
{
    if (scene->n_body != 1) return PAL_REFUSE(diag, "a scene of %d bodies, wanted one", scene->n_body);
    pal_scene *own = malloc(sizeof *own);
    if (!own) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "no memory for a live body");
    *own = *scene;
    own->body[0].output.name[0] = 0;
    own->body[0].n_effect = 0;
    /* with a rate the component viscous exists */
    own->body[0].material.damping_1_s = damping_1_s;
    own->n_tool = 0;
    pal_err err = pal_world_create(own, diag, out);
    free(own);
    return err;
}

pal_err pal_settle_damping(const pal_scene *scene, const pal_settle_load *load, int n_load,
                           const pal_settle_options *options, pal_settle_report *out, pal_diagnostic *diag)
{
    if (n_load < 1 || n_load > PAL_SETTLE_LOADS)
        return PAL_REFUSE(diag, "%d loads, wanted 1 to %d", n_load, PAL_SETTLE_LOADS);
    *out = (pal_settle_report){.damping_1_s = scene->body[0].material.damping_1_s, .seconds = NAN};
    for (int k = 0; k < PAL_SETTLE_STEPS; k++) out->rate_seconds[k] = NAN;
    for (int k = 0; k < PAL_SETTLE_LOADS; k++) out->load[k].difference_percent = NAN;
    climb c = {.scene = scene,
               .load = load,
               .n_load = n_load,
               .options = *options,
               .work = options->max_work,
               .out = out,
               .diag = diag};
    PAL_TRY(pal_settle_world(scene, pal_settle_rates_1_s[USUAL], &c.world, diag));
    pal_err err = run_climb(&c);
    pal_world_destroy(c.world);
    return err;
}
