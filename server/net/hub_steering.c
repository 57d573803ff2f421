/* Verbs that control a session. */
#include "server/net/hub_verb.h"

#include "server/net/hub_news.h"
#include "server/net/hub_peers.h"
#include "server/net/hub_plan.h"
#include "server/net/hub_undo.h"

bool pal_hub_run_steering(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    (void)command;
    return pal_hub_session_command(c, verb->name, &(pal_command){.kind = (pal_command_kind)verb->detail});
}

/* a body is frozen for everybody, so everybody may reset it */
bool pal_hub_run_reset(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    const pal_frame *f = c->room->stream->frame;
    bool whole = !command->target[0];
    int body = pal_hub_find_body(c, command->target, 0);
    if (body < 0) return false;
    if (!pal_hub_may(c, PAL_RIGHT_STEER) && (whole || !f || body >= f->n_part || !f->part[body].frozen))
        return pal_hub_refuse(c, "role", "reset: only for %s, but for a frozen body", pal_right_text[PAL_RIGHT_STEER]);
    if (!pal_hub_session_command(
            c, verb->name,
            &(pal_command){.kind = whole ? PAL_COMMAND_RESET : PAL_COMMAND_RESET_BODY, .body = whole ? 0 : body}))
        return false;
    pal_hub_note_order(c, command);
    return true;
}

bool pal_hub_run_material(pal_client *c, const pal_verb *verb, const pal_wire_command *command)
{
    int body = pal_hub_find_body(c, command->target, 0);
    if (body < 0) return false;
    pal_material before, m;
    pal_session_material(c->room->session, body, &before);
    m = before;
    m.young_Pa = pal_hub_arg(command, "young_Pa", m.young_Pa);
    m.poisson = pal_hub_arg(command, "poisson", m.poisson);
    m.density_kg_m3 = pal_hub_arg(command, "density_kg_m3", m.density_kg_m3);
    m.damping_1_s = pal_hub_arg(command, "damping_1_s", m.damping_1_s);
    pal_command order = {
        .kind = PAL_COMMAND_MATERIAL, .body = body, .material = m, .in_time = !pal_hub_is_instructor(c)};
    if (!pal_hub_session_command(c, verb->name, &order)) return false;
    pal_hub_await_answer(c, verb->name);
    order.material = before, order.in_time = false;
    pal_hub_undo_by_command(c, verb->name, &order);
    return true;
}
