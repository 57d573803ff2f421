/* Live switches: a scene from pal_configuration_make, and the transfer of the running state to it. */
#include "server/session/configuration_switch.h"

#include "server/session/tuning.h"

#include <stdlib.h>

static pal_err prepare(const pal_scene *scene, const pal_body_def *base, int body, const pal_configuration *to,
                       pal_diagnostic *diag, pal_configuration_switch *s)
{
    pal_configuration now, next;
    if (body < 0 || body >= scene->n_body) return PAL_REFUSE(diag, "there is no body %d to be switched", body);
    s->body = body;
    s->from = *scene;
    if (base) {
        s->from.body[body] = *base;
        s->from.body[body].material = scene->body[body].material;
    }
    PAL_TRY(pal_configuration_check_live(&s->from, body, to, diag));
    PAL_TRY(pal_configuration_make(&s->from, body, to, diag, &s->set));
    s->set->scene.accuracy[0] = 0; /* the measured accuracy belongs to the old configuration */
    pal_configuration_of(scene, body, &now);
    pal_configuration_of(&s->set->scene, body, &next);
    if (pal_configuration_equal(&now, &next)) {
        char text[PAL_CONFIGURATION_TEXT];
        return PAL_REFUSE(diag, "body \"%s\" is as wanted already: %s", scene->body[body].name,
                          pal_configuration_text(&now, text));
    }
    return pal_transfer_make(scene, &s->set->scene, body, diag, &s->transfer);
}

pal_err pal_configuration_switch_prepare(const pal_scene *scene, const pal_body_def *base, int body,
                                         const pal_configuration *to, pal_diagnostic *diag,
                                         pal_configuration_switch **out)
{
    pal_configuration_switch *s = calloc(1, sizeof *s);
    pal_err err = s ? prepare(scene, base, body, to, diag, s) : PAL_ERR_MEMORY;
    if (err)
        pal_configuration_switch_free(s);
    else
        *out = s;
    return err;
}

bool pal_configuration_switch_snapshot(void *change, const pal_world *before)
{
    pal_configuration_switch *s = change;
    const double near_m = PAL_CONFIGURATION_SWITCH_MAX_DRIFT * pal_world_view_body(before, s->body)->length_scale_m;
    if (s->has_rehearsed && pal_transfer_drift_m(s->transfer, before) <= near_m) return false;
    return pal_transfer_snapshot(s->transfer, before);
}

void pal_configuration_switch_rehearse(void *change, pal_world *next)
{
    pal_configuration_switch *s = change;
    pal_transfer_rehearse(s->transfer, next);
    s->has_rehearsed = true;
}

static _Thread_local uint64_t n_transfer;

uint64_t pal_configuration_switch_transfer_count(void)
{
    return n_transfer;
}

void pal_configuration_switch_transfer(void *change, pal_world *next, const pal_world *before)
{
    pal_configuration_switch *s = change;
    n_transfer++;
    pal_transfer_apply(s->transfer, next, before, &s->report);
}

void pal_configuration_switch_free(pal_configuration_switch *change)
{
    if (!change) return;
    pal_transfer_free(change->transfer);
    pal_configured_scene_free(change->set);
    free(change);
}
