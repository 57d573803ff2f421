/* Stiffness of contact, and its patches for a haptic bridge (contact_patch.h). */
#include "server/base/vec3.h"
#include "server/sim/contact/push.h"
#include "server/sim/contact/tuning.h"

double pal_push_pressure_of_radius(const pal_push *push, const pal_body *body, int point, double radius_m)
{
    (void)body, (void)point;
    return push->asked_Pa_m > 0 ? push->asked_Pa_m : push->regime->pressure * push->material.young_Pa / radius_m;
}

static double young_at(const pal_push *push, int point)
{
    const pal_contact_samples *sample = &push->points.sample;
    if (!push->point_Pa) return push->material.young_Pa;
    if (point >= sample->n_vertex) point = sample->corner[3 * (size_t)(point - sample->n_vertex)];
    return push->point_Pa[point] > 0 ? (double)push->point_Pa[point] : push->material.young_Pa;
}

/* TISSUE_RATIO 2 E b / (1 - nu^2) over the area of a contact of half-width a, b at least half an element */
double pal_push_pressure_of_tissue(const pal_push *push, const pal_body *body, int point, double radius_m)
{
    if (push->asked_Pa_m > 0) return push->asked_Pa_m;
    double a = 0.5 * radius_m, b = fmax(a, 0.5 * body->edge_m);
    return TISSUE_RATIO * 2 * young_at(push, point) * b /
           ((1 - push->material.poisson * push->material.poisson) * M_PI * a * a);
}

double pal_push_punch_N_m(const pal_push *push, double radius_m)
{
    return 2 * push->material.young_Pa * radius_m / (1 - push->material.poisson * push->material.poisson);
}

double pal_push_near_m(const pal_push *push, double radius_m)
{
    return push->asked_near_m > 0 ? push->asked_near_m : fmax(radius_m, NEAR_M);
}

void pal_push_follow_side(pal_tool_contact *t, const double side_before[3], double dt_s)
{
    double side[3];
    if (!pal_unit3(side, t->total, 0)) return;
    pal_axpy3(side, 1 / expm1(dt_s / FOLLOW_S), side_before);
    pal_unit3(t->proxy.normal, side, 1e-9);
}

/* ---- patches ---- */

/* stiffness of a group without contact: of what the sphere would lie on, were it NEAREST_RADII nearer */
static void find_near(pal_push *push, pal_tool_contact *t, const double here[3], pal_step *step, const double *x,
                      pal_contact_group *group)
{
    int32_t point[STIFFNESS_POINTS];
    double weight[STIFFNESS_POINTS], k = 0, nearest = INFINITY, sum = 0, radius = t->limits.radius_m;
    int n = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < t->n_list && n < STIFFNESS_POINTS; i++) {
            double out[3], area = push->points.sample.area_m2[t->list[i]];
            pal_sub3(out, t->proxy.x, x + 3 * i);
            double along = pal_dot3(out, group->normal), distance = pal_norm3(out);
            if (along < 0.5 * distance || area <= 0) continue;
            if (pass == 0) nearest = fmin(nearest, distance);
            if (pass == 0 || distance > nearest + NEAREST_RADII * radius) continue;
            point[n] = t->list[i];
            k += area * push->regime->pressure_Pa_m(push, step->body, point[n], radius);
            sum += weight[n++] = area;
        }
    for (int i = 0; i < n; i++) weight[i] /= sum;
    pal_haptic_stiffness_near(&t->stiffness, group, here, &push->points, step->body, step->body->compliance, point,
                              weight, n, k, step->scratch);
}

/* stiffness of an explicit contact: the springs that press, as stiff as their forces are, or each second, third ... */
static void find_pressed(pal_push *push, pal_tool_contact *t, const double here[3], pal_step *step,
                         pal_contact_group *group)
{
    size_t used = pal_arena_used(step->scratch);
    pal_contact *contact = PAL_NEW(step->scratch, pal_contact, PAL_CONTACT_IMPLICIT_MAX);
    int n_press = 0, n = 0, seen = 0;
    for (int i = 0; i < t->n_contact; i++) n_press += t->contact[i].normal_N > 0;
    const int stride = 1 + n_press / (PAL_CONTACT_IMPLICIT_MAX + 1);
    pal_contact_springs_begin(push->springs);
    for (int i = 0; i < t->n_contact && contact; i++) {
        if (!(t->contact[i].normal_N > 0) || seen++ % stride != 0) continue;
        contact[n] = t->contact[i];
        contact[n].normal_N *= stride;
        contact[n].k_N_m = contact[n].normal_N / contact[n].depth_m;
        if (pal_contact_springs_add(push->springs, contact[n].point, contact[n].away, contact[n].k_N_m) < 0) break;
        n++;
    }
    pal_haptic_stiffness_contact(&t->stiffness, group, here, step->body->compliance, push->springs, 0, contact, n,
                                 t->limits.radius_m, step->scratch);
    pal_arena_rewind(step->scratch, used);
}

/* k1 of a group from the solver's compliance, found again when it has changed, within the step's budget */
static void find_stiffness(pal_push *push, pal_tool_contact *t, const pal_tool *tool, pal_step *step, const double *x,
                           pal_contact_group *group)
{
    const pal_tool_contact_implicit *implicit = t->implicit;
    double here[3], radius = tool->radius_m;
    pal_sub3(here, tool->here_m, step->body->offset_m);
    t->stiffness.time_s = step->time_s, t->stiffness.follow_s = tool->haptic ? FOLLOW_S : NO_HAPTICS_FOLLOW_S;
    const bool due = pal_haptic_stiffness_find(&t->stiffness, group, here, SHALLOW_RADII * radius);
    if (push->n_stiffness >= STIFFNESS_BUDGET || (group->force_N > 0 && implicit && implicit->solve.constant)) return;
    /* caps alone ask for that of a contact then */
    if (!tool->haptic && (!due || !implicit || !(implicit->solve.capped || implicit->back_m > 0))) return;
    if (!due) {
        double k = implicit ? implicit->solve.friction_N_m : 0;
        for (int i = 0; i < t->n_contact && !implicit; i++)
            if (t->contact[i].normal_N > 0) k += t->contact[i].normal_N / t->contact[i].depth_m;
        push->n_stiffness +=
            push->friction > 0 &&
            pal_haptic_stiffness_across(&t->stiffness, group, &push->points, step->body, step->body->compliance,
                                        t->contact, t->n_contact, k, step->scratch);
        return;
    }
    push->n_stiffness++;
    if (group->force_N > 0 && implicit)
        pal_haptic_stiffness_contact(&t->stiffness, group, here, step->body->compliance, push->springs,
                                     implicit->solve.first, t->contact, t->n_contact, radius, step->scratch);
    else if (group->force_N > 0)
        find_pressed(push, t, here, step, group);
    else
        find_near(push, t, here, step, x, group);
}

void pal_push_add_torque(pal_tool_contact *t, pal_tool *tool)
{
    double torque[3];
    pal_sub3(tool->torque_Nm, tool->torque_Nm, t->torque_Nm);
    pal_set3(t->torque_Nm, 0, 0, 0);
    for (int i = 0; i < t->n_contact; i++) {
        const pal_contact *c = &t->contact[i];
        if (!(c->normal_N > 0)) continue;
        pal_cross3(torque, c->force, c->away);
        pal_axpy3(t->torque_Nm, tool->radius_m - c->depth_m, torque);
    }
    pal_add3(tool->torque_Nm, tool->torque_Nm, t->torque_Nm);
}

void pal_push_surface_velocity(const pal_tool_contact *t, const pal_tool *tool, double velocity_m_s[3])
{
    pal_cross3(velocity_m_s, t->proxy.normal, tool->omega_rad_s);
    pal_scale3(velocity_m_s, tool->radius_m, velocity_m_s);
    pal_add3(velocity_m_s, velocity_m_s, t->proxy.v);
}

void pal_push_publish(pal_push *push, pal_tool_contact *t, pal_tool *tool, pal_step *step)
{
    if (!t->active) return;
    pal_contact_group group[PAL_CONTACT_PATCH_MAX] = {0};
    int n = 0;
    size_t used = pal_arena_used(step->scratch);
    double *x = PAL_NEW(step->scratch, double, 3 * (size_t)t->n_list), radius = tool->radius_m;
    uint8_t *grouped = PAL_NEW(step->scratch, uint8_t, t->n_contact);
    if (x && grouped) {
        while (n < PAL_CONTACT_PATCH_MAX && pal_contact_group_next(t->contact, t->n_contact, grouped, &group[n])) n++;
        /* while a transferred force is released there is one patch */
        if (t->hold.share > 0 && pal_unit3(group[0].normal, t->total, 0)) {
            group[0].force_N = pal_norm3(t->total), group[0].gap_m = 0;
            n = 1;
        }
        for (int i = 0; i < t->n_list; i++) pal_contact_points_at(&push->points, t->list[i], push->points.x, x + 3 * i);
        while (n < PAL_CONTACT_PATCH_MAX && pal_contact_group_near(t->proxy.x, radius, pal_push_near_m(push, radius), x,
                                                                   t->n_list, group, n, &group[n]))
            n++;
        for (int b = 0; b < n && step->body->compliance && t->hold.share == 0; b++)
            find_stiffness(push, t, tool, step, x, &group[b]);
    }
    pal_arena_rewind(step->scratch, used);
    double k = pal_haptic_stiffness_clamp(pal_push_punch_N_m(push, radius));
    pal_contact_patch_options options = {.step_s = step->dt_s * step->n_sub,
                                         .radius_m = radius,
                                         .k_start_N_m = k,
                                         .b_s = step->body->damping_1_s * 4.0 / 3 * M_PI *
                                                push->material.density_kg_m3 * radius * radius * radius / k,
                                         .sideways = 2 * (1 - push->material.poisson) / (2 - push->material.poisson),
                                         .friction = push->friction};
    pal_contact_patches_update(&t->patches, &options, group, n, tool);
}
