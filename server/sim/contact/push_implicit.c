/* Contact that an implicit solver takes implicitly (contact_implicit.h): a sub-step is the whole step, and nothing
 * limits the stiffness but the solver's iterations. There is no damping term, as the step itself damps; patches are
 * published after the solve. */
#include "server/base/vec3.h"
#include "server/sim/contact/push.h"
#include "server/sim/contact/tuning.h"

pal_err pal_push_make_implicit(pal_push *push, pal_build *build)
{
    pal_body *body = build->body;
    push->springs = PAL_NEW(build->arena, pal_contact_springs, 1);
    if (!push->springs) return PAL_ERR_MEMORY;
    PAL_TRY(pal_contact_springs_make(&push->points, body, push->n_tool * (PAL_CONTACT_IMPLICIT_MAX + 2), build->arena,
                                     push->springs));
    for (int t = 0; t < push->n_tool; t++) {
        push->tool[t].implicit = PAL_NEW(build->arena, pal_tool_contact_implicit, 1);
        if (!push->tool[t].implicit) return PAL_ERR_MEMORY;
    }
    body->wants_compliance = true;
    size_t scratch = pal_haptic_stiffness_scratch(body) + (size_t)push->points.sample.max_point * 4 * sizeof(double) +
                     CONTACT_MAX + 256;
    if (build->scratch_byte < scratch) build->scratch_byte = scratch;
    return PAL_ERR_OK;
}

/* the target is as far out from the tool as caps ask for, and stays when the tool goes deeper */
static void hold_back(pal_tool_contact *t, double here[3])
{
    pal_tool_contact_implicit *implicit = t->implicit;
    double move[3];
    pal_sub3(move, here, implicit->last_m);
    pal_copy3(implicit->last_m, here);
    if (!(implicit->back_m > 0)) return;
    implicit->back_m = fmax(0, implicit->back_m - pal_dot3(move, t->proxy.normal));
    pal_axpy3(here, implicit->back_m, t->proxy.normal);
}

/* after the solve: back so far that contact itself gives 1 - FORCE_SHARE of what caps allow, because constant forces
 * alone, shared out again in each step, would let a tool at its cap wander */
static void find_back(const pal_push *push, pal_tool_contact *t, const pal_tool *tool)
{
    pal_tool_contact_implicit *implicit = t->implicit;
    const pal_contact_implicit *solve = &implicit->solve;
    double k = pal_haptic_stiffness_max(&t->stiffness, pal_push_punch_N_m(push, tool->radius_m));
    implicit->back_m = implicit->old_back_m;
    if (solve->capped || implicit->back_m > 0)
        implicit->back_m =
            fmax(0, implicit->back_m + BACK_GAIN * (solve->uncapped_N - (1 - FORCE_SHARE) * solve->allowed_N) / k);
}

/* springs of one tool, and the loads they begin with */
static void begin(pal_push *push, pal_tool_contact *t, const pal_tool *tool, pal_step *step)
{
    pal_tool_contact_implicit *implicit = t->implicit;
    double scale = tool->ramp * t->ramp * t->share * (1 - t->hold.share), move[3], stiffness = 0;
    pal_copy3(implicit->old_side, t->proxy.normal);
    implicit->old_back_m = implicit->back_m;
    implicit->published = false;
    if (step->sub == step->n_sub - 1) implicit->old_patches = t->patches;
    t->n_contact = scale > 0 ? pal_contact_implicit_thin(t->contact, t->n_contact) : 0;
    for (int i = 0; i < t->n_contact; i++) {
        t->contact[i].k_N_m *= scale;
        if (t->contact[i].depth_m > 0) stiffness += t->contact[i].k_N_m;
    }
    (void)pal_tool_contact_friction(t, stiffness, implicit->solve.next_slip_m);
    pal_push_surface_velocity(t, tool, move);
    pal_scale3(move, step->dt_s, move);
    pal_contact_implicit_begin(&implicit->solve, push->springs, step->body, t->contact, t->n_contact, push->friction,
                               move);
    t->n_contact = implicit->solve.n_contact;
}

static void act(pal_push *push, int n_tool, pal_step *step)
{
    push->n_step += step->sub == 0, push->n_stiffness = 0;
    pal_contact_springs_begin(push->springs);
    for (int t = 0; t < n_tool; t++) begin(push, &push->tool[t], &step->tools->tool[t], step);
}

static bool settle(pal_push *push, pal_step *step, const double *moved, bool last)
{
    pal_tools *tools = step->tools;
    int n_tool = tools->n_tool < push->n_tool ? tools->n_tool : push->n_tool;
    bool again = false;
    pal_contact_springs_motion(push->springs, moved);
    for (int i = 0; i < n_tool; i++) {
        pal_tool_contact *t = &push->tool[i];
        pal_tool *tool = &tools->tool[i];
        if (!t->active) continue;
        if (!last) {
            again |= pal_contact_implicit_cap(&t->implicit->solve, tool);
            continue;
        }
        again |= pal_contact_implicit_settle(&t->implicit->solve, tool);
        pal_add3(t->total, t->implicit->solve.total_N, t->hold.now_N);
        pal_push_follow_side(t, t->implicit->old_side, step->dt_s);
        find_back(push, t, tool);
    }
    /* each tool in turn is the first to have its patches' stiffness found */
    for (int k = 0; k < n_tool && last && step->sub == step->n_sub - 1; k++) {
        int i = (k + push->n_step) % n_tool;
        pal_tool_contact *t = &push->tool[i];
        pal_tool *tool = &tools->tool[i];
        if (t->implicit->published) {
            t->patches = t->implicit->old_patches;
            tool->n_patch = t->implicit->n_old_patch;
        }
        t->implicit->n_old_patch = tool->n_patch;
        if (t->active) pal_push_add_torque(t, tool);
        pal_push_publish(push, t, tool, step);
        t->implicit->published = true;
    }
    return again;
}

const pal_push_regime pal_push_implicit = {
    .pressure_Pa_m = pal_push_pressure_of_tissue, .hold_back = hold_back, .act = act, .settle = settle};
