/* Counts of subscribers to fields and estimates. */
#include "server/net/hub_subscriptions.h"

static void request(pal_session *session, bool wanted, bool *requested, pal_command command)
{
    if (wanted == *requested) return;
    command.wanted = wanted;
    if (pal_session_command(session, &command) == PAL_ERR_OK) *requested = wanted;
}

void pal_hub_update_subscriptions(pal_hub_room *room)
{
    for (int b = 0; b < room->stream->n_part; b++) {
        request(room->session, room->n_estimate[b] > 0, &room->estimate_requested[b],
                (pal_command){.kind = PAL_COMMAND_ESTIMATE, .body = b});
        for (int k = PAL_FIELD_NONE + 1; k < PAL_FIELD_COUNT; k++)
            request(room->session, room->n_subscriber[b][k] > 0, &room->reported[b][k],
                    (pal_command){.kind = PAL_COMMAND_FIELD, .body = b, .field = (pal_field)k});
    }
}

void pal_hub_set_field(pal_client *c, int part, pal_field field)
{
    pal_field before = (pal_field)c->view[part];
    if (field == before) return;
    if (before != PAL_FIELD_NONE) c->room->n_subscriber[part][before]--;
    if (field != PAL_FIELD_NONE) c->room->n_subscriber[part][field]++;
    c->view[part] = (uint8_t)field;
    c->sent_field[part] = 0;
}

void pal_hub_set_estimate(pal_client *c, int body, bool wanted)
{
    if (c->estimate[body] == wanted) return;
    c->room->n_estimate[body] += wanted ? 1 : -1;
    c->estimate[body] = wanted;
    if (!wanted) c->estimate_due[body] = false;
}

void pal_hub_unsubscribe_all(pal_client *c)
{
    for (int b = 0; b < c->room->stream->n_part; b++) {
        pal_hub_set_field(c, b, PAL_FIELD_NONE);
        pal_hub_set_estimate(c, b, false);
    }
    pal_hub_update_subscriptions(c->room);
}
