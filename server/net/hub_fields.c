/* Fields for colouring. A field without subscribers is neither computed nor encoded, nor are its values inside the
 * part. The newest values are sent at most 10 times a second and older ones are dropped, only while the client has
 * credit, after control and before the next cycle. */
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
    uint32_t set = 0;
    if (view->part >= (uint32_t)s->n_part)
        return pal_hub_refuse(c, "part", "there is no part %u, the scene has %d", view->part, s->n_part);
    int part = (int)view->part;
    if (!pal_wire_field_get_set(view->field, &set))
        return pal_hub_refuse(c, "field", "there is no field %s", view->field);
    for (int k = PAL_FIELD_NONE + 1; k < PAL_FIELD_COUNT; k++)
        if (set >> k & 1 && !pal_session_has_field(c->room->session, part, (pal_field)k))
            return pal_hub_refuse(c, "field", "%s gives no %s with this method", s->part[part].info.name,
                                  pal_field_title((pal_field)k));
    pal_hub_set_fields(c, part, set, view->interior && s->part[part].n_node > 0);
    pal_hub_set_energy(c, part, view->energy && pal_session_has_field(c->room->session, part, PAL_FIELD_ENERGY_J_M3));
    pal_hub_update_subscriptions(c->room);
    c->peer->ops->ready(c->peer); /* other clients may already subscribe to it */
    return true;
}

/* the older of two values that a client lacks, after those that it was sent last */
static const pal_stream_values *older(const pal_stream_values *a, const pal_stream_values *b, uint64_t sent)
{
    if (!b->packet || b->made <= sent) return a;
    return !a || b->made < a->made ? b : a;
}

/* the first values that this client lacks, and of which part; NULL: none */
static const pal_stream_values *lacking(const pal_client *c, int *part)
{
    const pal_stream *s = c->room->stream;
    for (*part = 0; *part < s->n_part; ++*part) {
        const pal_stream_part *of = &s->part[*part];
        const pal_stream_values *found = NULL;
        for (int k = PAL_FIELD_NONE + 1; k < PAL_FIELD_COUNT && c->view[*part]; k++) {
            if (!(c->view[*part] >> k & 1)) continue;
            found = older(found, &of->field[k], c->sent_values[*part]);
            if (c->interior[*part]) found = older(found, &of->interior[k], c->sent_values[*part]);
        }
        if (found) return found;
    }
    return NULL;
}

bool pal_hub_wants_field(const pal_client *c)
{
    int part;
    return c->id && c->out_begin == c->n_out && pal_credit_free(&c->credit) && lacking(c, &part);
}

pal_packet *pal_hub_next_field(pal_client *c)
{
    int part;
    if (!pal_hub_wants_field(c)) return NULL;
    const pal_stream_values *values = lacking(c, &part);
    c->sent_values[part] = values->made;
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
