/* Fields for colouring. A client subscribes to at most one field per part; a field without subscribers is neither
 * computed nor encoded. The newest values are sent at most 10 times a second and older ones are dropped, only while
 * the client has credit, after control and before the next cycle. */
#include "server/net/hub_fields.h"

#include "protocol/field_codec.h"
#include "server/net/hub_peers.h"

/* names and numbers on the wire are those of the simulation */
_Static_assert((int)PAL_WIRE_FIELD_DISPLACEMENT_M == (int)PAL_FIELD_DISPLACEMENT_M &&
                   (int)PAL_WIRE_FIELD_VON_MISES_PA == (int)PAL_FIELD_VON_MISES_PA &&
                   (int)PAL_WIRE_FIELD_ENERGY_J_M3 == (int)PAL_FIELD_ENERGY_J_M3 &&
                   (int)PAL_WIRE_FIELD_STIFFNESS_J == (int)PAL_FIELD_STIFFNESS_J &&
                   (int)PAL_WIRE_FIELD_STRAIN == (int)PAL_FIELD_STRAIN &&
                   (int)PAL_WIRE_FIELD_DISTORTION == (int)PAL_FIELD_DISTORTION &&
                   (int)PAL_WIRE_FIELD_YOUNG_PA == (int)PAL_FIELD_YOUNG_PA &&
                   (int)PAL_WIRE_FIELD_COUNT == (int)PAL_FIELD_COUNT,
               "fields are numbered alike");

bool pal_hub_subscribe_field(pal_client *c, const pal_wire_field_subscription *view)
{
    const pal_stream *s = c->room->stream;
    pal_wire_field field = pal_wire_field_find(view->field);
    if (view->part >= (uint32_t)s->n_part)
        return pal_hub_refuse(c, "part", "there is no part %u, the scene has %d", view->part, s->n_part);
    int part = (int)view->part;
    if (field == PAL_WIRE_FIELD_COUNT) return pal_hub_refuse(c, "field", "there is no field %s", view->field);
    if (field != PAL_WIRE_FIELD_NONE && !pal_session_has_field(c->room->session, part, (pal_field)field))
        return pal_hub_refuse(c, "field", "%s gives no %s with this method", s->part[part].info.name,
                              pal_field_title((pal_field)field));
    pal_hub_set_field(c, part, (pal_field)field);
    pal_hub_update_subscriptions(c->room);
    c->peer->ops->ready(c->peer); /* other clients may already subscribe to it */
    return true;
}

/* the first part with values that this client lacks; -1: none */
static int lacking(const pal_client *c)
{
    const pal_stream *s = c->room->stream;
    for (int p = 0; p < s->n_part; p++)
        if (c->view[p] && s->part[p].field[c->view[p]] && s->part[p].field_made[c->view[p]] != c->sent_field[p])
            return p;
    return -1;
}

bool pal_hub_wants_field(const pal_client *c)
{
    return c->id && c->out_begin == c->n_out && pal_credit_free(&c->credit) && lacking(c) >= 0;
}

pal_packet *pal_hub_next_field(pal_client *c)
{
    if (!pal_hub_wants_field(c)) return NULL;
    int p = lacking(c);
    const pal_stream_part *part = &c->room->stream->part[p];
    c->sent_field[p] = part->field_made[c->view[p]];
    c->hub->count.n_field++;
    return pal_packet_hold(part->field[c->view[p]]);
}

uint64_t pal_hub_make_fields(pal_hub_room *room, uint64_t now)
{
    uint64_t due = 0;
    if (!pal_stream_fields(room->stream, now, room->n_subscriber, &due)) return due;
    for (pal_client *c = NULL; (c = pal_hub_next_member(room, c));)
        if (pal_hub_wants_field(c)) c->peer->ops->ready(c->peer);
    return due;
}
