/* Fields for colouring. A client subscribes to at most one field per part; a field without subscribers is neither
 * computed nor encoded, nor are its values inside the part. The newest values are sent at most 10 times a second and
 * older ones are dropped, only while the client has credit, after control and before the next cycle. */
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
                   (int)PAL_WIRE_FIELD_DENSITY_KG_M3 == (int)PAL_FIELD_DENSITY_KG_M3 &&
                   (int)PAL_WIRE_FIELD_DAMPING_1_S == (int)PAL_FIELD_DAMPING_1_S &&
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
    pal_hub_set_field(c, part, (pal_field)field, view->interior && s->part[part].n_node > 0);
    pal_hub_set_energy(c, part, view->energy && pal_session_has_field(c->room->session, part, PAL_FIELD_ENERGY_J_M3));
    pal_hub_update_subscriptions(c->room);
    c->peer->ops->ready(c->peer); /* other clients may already subscribe to it */
    return true;
}

/* the first values that this client lacks: of which part, and are they those inside? NULL: none */
static const pal_stream_values *lacking(const pal_client *c, int *part, bool *inside)
{
    const pal_stream *s = c->room->stream;
    for (*part = 0; *part < s->n_part; ++*part) {
        const int k = c->view[*part];
        const pal_stream_values *field = &s->part[*part].field[k], *interior = &s->part[*part].interior[k];
        if (k == PAL_FIELD_NONE) continue;
        *inside = c->interior[*part] && interior->packet && interior->made != c->sent_interior[*part];
        if (field->packet && field->made != c->sent_field[*part]) return *inside = false, field;
        if (*inside) return interior;
    }
    return NULL;
}

bool pal_hub_wants_field(const pal_client *c)
{
    int part;
    bool inside;
    return c->id && c->out_begin == c->n_out && pal_credit_free(&c->credit) && lacking(c, &part, &inside);
}

pal_packet *pal_hub_next_field(pal_client *c)
{
    int part;
    bool inside;
    if (!pal_hub_wants_field(c)) return NULL;
    const pal_stream_values *values = lacking(c, &part, &inside);
    *(inside ? &c->sent_interior[part] : &c->sent_field[part]) = values->made;
    c->hub->count.n_field++;
    return pal_packet_hold(values->packet);
}

uint64_t pal_hub_make_fields(pal_hub_room *room, uint64_t now)
{
    uint64_t due = 0;
    if (!pal_stream_fields(room->stream, now, &room->subscribers, &due)) return due;
    for (pal_client *c = NULL; (c = pal_hub_next_member(room, c));)
        if (pal_hub_wants_field(c)) c->peer->ops->ready(c->peer);
    return due;
}
