/* Solver verlet: v += dt f/m, x += dt v (paper B 4.1's Verlet in its velocity form, numerics.md 1 B).
 *
 * Departures. Drag is implicit: v <- (v + dt f/m) / (1 + dt rate), the rate being the sum of the rows' drag hooks
 * and of the body's brake (stiffening_damper.h). The sub-step is `safety` (key, 0.5) of the stability limit that
 * Gershgorin's bound gives: with K and C the row sums of stiffness and explicit damping, dt = safety * 2 t where t is
 * the largest with t^2 K + t C <= m at every free node. The bound is taken again at the current state whenever a node
 * may have moved a fifth of an element since the last time. Held nodes keep the velocity they are led with. A node
 * moves at most 0.2 S in a sub-step (numerics.md part 3). Where the world cannot afford the sub-steps (step->heavy),
 * the same inequality is met by adding mass to the nodes that break it; as it comes and goes it would bring energy with
 * it, so these nodes lose up to a hundredth of their velocity in a sub-step. Where the bound is taken, rows look for
 * what is turned over, and in every step while something is. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"

#include <string.h>

typedef struct verlet {
    double *stiff, *damp; /* Gershgorin row sums, N/m and Ns/m [n_dof] */
    double safety;        /* of the stability limit             */
    double limit_s;
    double way_m;       /* no node has moved farther since the bound was taken */
    bool known;         /* limit_s holds                                       */
    bool has_inversion; /* rows are to be asked again in the coming step       */
} verlet;

static const double max_move_h = 0.2, max_move_S = 0.2;
/* of a velocity in a sub-step, times the share of the mass that was added */
static const double heavy_loss = 0.01;

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    double safety = 0.5;
    PAL_TRY(pal_entry_read_number(item, "safety", 0.01, 0.9, &safety, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    if (build->body->interpolation)
        return pal_diagnostic_set(build->diag, PAL_ERR_REFUSED,
                                  "%s: \"verlet\" moves nodes, those of this body are carried by control points; take "
                                  "\"central_cg\" or \"implicit_euler\"",
                                  item->path);
    verlet *row = PAL_NEW(build->arena, verlet, 1);
    if (!row) return PAL_ERR_MEMORY;
    row->stiff = PAL_NEW(build->arena, double, build->body->n_dof);
    row->damp = PAL_NEW(build->arena, double, build->body->n_dof);
    if (!row->stiff || !row->damp) return PAL_ERR_MEMORY;
    row->safety = safety;
    *self = row;
    return PAL_ERR_OK;
}

static void add_bounds(verlet *row, const pal_component *rows, int n, const pal_body *body)
{
    for (int i = 0; i < n; i++) {
        const pal_effect *effect = rows[i].effect;
        if (effect->stiffness) effect->stiffness(rows[i].self, body, row->stiff);
        if (effect->damping && !effect->drag) effect->damping(rows[i].self, body, row->damp);
    }
}

/* contact comes and goes between steps without any node moving */
static bool has_bounds(const pal_component *rows, int n)
{
    for (int i = 0; i < n; i++)
        if (rows[i].effect->stiffness || rows[i].effect->damping) return true;
    return false;
}

/* true: something runs on what untangles it */
static bool recover(pal_step *step)
{
    unsigned seen = 0;
    for (int i = 0; i < step->n_force; i++)
        if (step->force[i].effect->recover) seen |= step->force[i].effect->recover(step->force[i].self, step);
    return seen & PAL_INVERTED;
}

/* the smallest over free nodes of 2 safety t, t the positive root of t^2 K + t C = m */
static double limit(void *self, pal_step *step)
{
    verlet *row = self;
    const pal_body *body = step->body;
    bool contact = step->sub == 0 && has_bounds(step->contact, step->n_contact);
    bool has_inversion = step->sub == 0 && row->has_inversion;
    if (row->known && !contact && !has_inversion && row->way_m <= max_move_h * body->edge_m) return row->limit_s;
    row->has_inversion = recover(step);
    size_t n_byte = sizeof(double) * (size_t)body->n_dof;
    memset(row->stiff, 0, n_byte);
    memset(row->damp, 0, n_byte);
    add_bounds(row, step->force, step->n_force, body);
    add_bounds(row, step->contact, step->n_contact, body);
    double least = INFINITY, sum = 0;
    for (int i = 0; i < body->n_dof; i++) {
        double k = row->stiff[i], c = row->damp[i], m = body->mass_kg[i];
        sum += 0 * k + 0 * c;
        if (body->support[i] || k + c == 0) continue;
        double dt = row->safety * 4 * m / (c + sqrt(c * c + 4 * k * m));
        if (dt < least) least = dt;
    }
    row->limit_s = sum == 0 ? least : NAN;
    row->way_m = 0;
    row->known = true;
    return row->limit_s;
}

static double drag_rate(const pal_step *step)
{
    double rate = 0;
    for (int i = 0; i < step->n_force; i++)
        if (step->force[i].effect->drag) rate += step->force[i].effect->drag(step->force[i].self);
    return rate;
}

/* shortens moves longer than max_m; [sim] */
static void clamp_moves(pal_body *body, double dt_s, double max_m)
{
    for (int i = 0; i < body->n_dof; i++) {
        double *v = body->v + 3 * i, move = pal_norm3(v) * dt_s;
        if (move > max_m) {
            pal_scale3(v, max_m / move, v);
            body->safeguards.n_clamped++;
        }
    }
}

static pal_err run(void *self, pal_step *step)
{
    verlet *row = self;
    pal_body *body = step->body;
    double dt = step->dt_s, keep = 1 / (1 + dt * (drag_rate(step) + body->stiffening_damping_1_s)), most2 = 0,
           poison = 0;
    double root = dt / (2 * row->safety);
    step->drag_separate = true;
    PAL_TRY(pal_assemble_forces(step));

    /* velocities */
    for (int i = 0; i < body->n_dof; i++) {
        double *v = body->v + 3 * i, m = body->mass_kg[i];
        const double *g = body->g + 3 * i;
        double s = body->support[i] ? 0 : dt / m, k = !body->support[i] ? keep : body->support[i] == 2 ? 1 : 0;
        if (step->heavy && !body->support[i]) {
            double heavy = fmax(m, root * (root * row->stiff[i] + row->damp[i]));
            s = dt / heavy, k *= 1 - heavy_loss * (1 - m / heavy);
        }
        for (int c = 0; c < 3; c++) v[c] = k * (v[c] + s * g[c]);
        double v2 = pal_dot3(v, v);
        most2 = v2 > most2 ? v2 : most2;
        poison += 0 * v2;
    }
    double way = sqrt(most2) * dt, most = max_move_S * body->length_scale_m;
    if (way > most) {
        uint64_t before = pal_clock_ns();
        clamp_moves(body, dt, most);
        body->safeguards.ns += pal_clock_ns() - before;
    }
    /* a velocity that is no number makes the way one too, and so the next limit */
    row->way_m += (way < most ? way : most) + poison;

    /* positions */
    for (int i = 0; i < 3 * body->n_dof; i++) body->x[i] += dt * body->v[i];
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    (void)body;
    ((verlet *)self)->known = false;
}

static pal_err material(void *self, const pal_body *body, const pal_material *to, pal_diagnostic *diag)
{
    (void)to, (void)diag;
    reset(self, body);
    return PAL_ERR_OK;
}

const pal_effect pal_effect_verlet = {.name = "verlet",
                                      .stage = PAL_STAGE_SOLVE,
                                      .make = make,
                                      .run = run,
                                      .limit = limit,
                                      .material = material,
                                      .reset = reset};
