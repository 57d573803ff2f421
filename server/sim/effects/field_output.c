/* Component field_output: a field shown in colour at the shown vertices. It exists while an observer asks for it
 * (pal_world_field) or where the scene has an entry for it; the simulation does not depend on it.
 *
 * Every FORCE component that can measure adds its value times volume, and the volume, to the nodes of its elements; a
 * node shows the quotient, and a skinned vertex the mean of its nodes with the skin's weights. The displacements of all
 * nodes at that moment stand beside the values. Displacement is the distance of a shown vertex from its rest position.
 * A number that is not finite is shown as 0, as are inactive vertices of an adaptive body.
 *
 * Keys: field ("displacement" | "von_mises" | "energy" | "stiffness" | "strain" | "distortion" | "young" |
 * "density" | "damping"), rate_hz (10: updates per simulated second). */
#include "server/base/vec3.h"
#include "server/sim/core/effect_list.h"

#include <string.h>

typedef struct field_output {
    pal_shown_field shown;
    pal_field kind;
    double period_s, next_s;
    double *volume_m3; /* sums at the nodes are in shown.node; NULL: displacement [n_node] */
    pal_body *body;
    uint64_t revision; /* topology revision at the last values */
} field_output;

static pal_err make(pal_config_entry *item, pal_build *build, void **self)
{
    pal_body *body = build->body;
    const char *name = "";
    double rate_hz = 10;
    PAL_TRY(pal_entry_read_text(item, "field", &name, build->diag));
    PAL_TRY(pal_entry_read_number(item, "rate_hz", 0.1, 1000, &rate_hz, build->diag));
    PAL_TRY(pal_entry_check_unused(item, build->diag));
    pal_field kind = pal_field_find(name);
    if (kind == PAL_FIELD_NONE)
        return PAL_REFUSE(build->diag,
                          "%s: there is no field \"%s\" (displacement, von_mises, energy, stiffness, strain, "
                          "distortion, young, density, "
                          "damping)",
                          item->path, name);
    if (body->display.n_shown == 0 || !body->display.surface)
        return PAL_REFUSE(build->diag, "%s: the body shows nothing that could be coloured", item->path);
    field_output *out = PAL_NEW(build->arena, field_output, 1);
    float *value = PAL_NEW(build->arena, float, body->display.n_shown);
    if (!out || !value) return PAL_ERR_MEMORY;
    *out =
        (field_output){.kind = kind, .shown.value = value, .period_s = 1 / rate_hz, .next_s = -INFINITY, .body = body};
    out->shown.moved = PAL_NEW(build->arena, float, 3 * body->n_node);
    const bool all = out->shown.moved && PAL_NEW_DOUBLES(build->arena, body->n_node, &out->shown.node) &&
                     (kind == PAL_FIELD_DISPLACEMENT_M || PAL_NEW_DOUBLES(build->arena, body->n_node, &out->volume_m3));
    if (!all) return PAL_ERR_MEMORY;
    body->display.field[kind] = &out->shown;
    *self = out;
    return PAL_ERR_OK;
}

static float finite_or_0(double value)
{
    float narrow = (float)value;
    return isfinite(narrow) ? narrow : 0;
}

static void displacement(const pal_body *body, double *nodal, float *value)
{
    for (int k = 0; k < pal_body_nodes(body); k++) {
        size_t i = (size_t)pal_body_point(body, k);
        nodal[i] = pal_dist3(body->d + 3 * i, body->node_rest + 3 * i);
    }
    const double *rest = body->display.surface->x;
    int n = body->active ? body->n_active : body->display.n_shown;
    for (int k = 0; k < n; k++) {
        int i = body->active ? body->active[k] : k;
        const float *x = body->display.shown + 3 * (size_t)i;
        value[i] = finite_or_0(pal_dist3((double[3]){(double)x[0], (double)x[1], (double)x[2]}, rest + 3 * (size_t)i));
    }
}

/* nodal means to shown vertices */
static void spread(const pal_body *body, const double *nodal, float *value)
{
    const pal_skin *skin = body->display.skin;
    for (int i = 0; i < body->display.n_shown && !skin; i++) value[i] = finite_or_0(nodal[body->display.shown_node[i]]);
    for (int i = 0; i < body->display.n_shown && skin; i++) {
        const int32_t *near = skin->near + PAL_SKIN_NEIGHBOURS * (size_t)i;
        const float *coef = skin->coef + 4 * PAL_SKIN_NEIGHBOURS * (size_t)i;
        double sum = 0;
        for (int k = 0; k < PAL_SKIN_NEIGHBOURS; k++) sum += (double)coef[4 * k + 3] * nodal[skin->frame[near[k]]];
        value[i] = finite_or_0(sum);
    }
}

static void measured(field_output *out, const pal_step *step)
{
    const pal_body *body = step->body;
    size_t n_byte = sizeof(double) * (size_t)body->n_node;
    double *sum = out->shown.node;
    memset(sum, 0, n_byte);
    memset(out->volume_m3, 0, n_byte);
    for (int i = 0; i < step->n_force; i++) {
        const pal_effect *effect = step->force[i].effect;
        if (effect->inspect.measure) effect->inspect.measure(step->force[i].self, body, out->kind, sum, out->volume_m3);
    }
    if (out->kind == PAL_FIELD_ENERGY_J_M3) {
        out->shown.kinetic_J = pal_body_kinetic_J(body);
        out->shown.elastic_J = 0;
        for (int i = 0; i < body->n_node; i++) out->shown.elastic_J += sum[i];
    }
    for (int i = 0; i < body->n_node; i++) sum[i] = out->volume_m3[i] > 0 ? sum[i] / out->volume_m3[i] : 0;
    spread(body, sum, out->shown.value);
}

static pal_err run(void *self, pal_step *step)
{
    field_output *out = self;
    /* update in the step nearest to the due time, so that a period of whole steps stays one */
    if (step->time_s + 0.5 * step->dt_s < out->next_s) return PAL_ERR_OK;
    if (out->revision != step->body->display.revision)
        memset(out->shown.value, 0, sizeof(float) * (size_t)step->body->display.n_shown);
    out->revision = step->body->display.revision;
    if (out->kind == PAL_FIELD_DISPLACEMENT_M)
        displacement(step->body, out->shown.node, out->shown.value);
    else
        measured(out, step);
    for (int i = 0; i < 3 * out->body->n_node; i++)
        out->shown.moved[i] = (float)(out->body->d[i] - out->body->node_rest[i]);
    out->shown.revision = ++out->body->display.field_revision;
    out->shown.time_s = step->time_s;
    out->next_s += out->period_s;
    if (!(out->next_s > step->time_s)) out->next_s = step->time_s + out->period_s;
    return PAL_ERR_OK;
}

static void reset(void *self, const pal_body *body)
{
    (void)body;
    ((field_output *)self)->next_s = -INFINITY;
}

/* no observer is left: clear the body's pointer to the field */
static void destroy(void *self)
{
    field_output *out = self;
    if (out->body->display.field[out->kind] == &out->shown) out->body->display.field[out->kind] = NULL;
}

const pal_effect pal_effect_field_output = {PAL_EFFECT("field_output", OUTPUT), .reset = reset, .destroy = destroy};
