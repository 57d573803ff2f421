#include "clients/relay/relay_values.h"

static bool has(uint32_t fields, int k)
{
    return fields >> k & 1;
}

void pal_relay_values_change(pal_relay_values *of, const pal_relay_view *before, const pal_relay_view *now)
{
    for (int k = 0; k < PAL_WIRE_FIELD_COUNT; k++) of->n_field[k] += has(now->fields, k) - has(before->fields, k);
    of->n_interior += now->interior - before->interior;
    of->n_energy += now->energy - before->energy;
}

pal_relay_view pal_relay_values_wanted(const pal_relay_values *of)
{
    pal_relay_view wanted = {.interior = of->n_interior > 0, .energy = of->n_energy > 0};
    for (int k = 0; k < PAL_WIRE_FIELD_COUNT; k++) wanted.fields |= (uint32_t)(of->n_field[k] > 0) << k;
    return wanted;
}

void pal_relay_values_ask(pal_relay_values *of, pal_relay_view asked)
{
    of->asked = asked;
    for (int k = 0; k < PAL_WIRE_FIELD_COUNT; k++) {
        if (!has(asked.fields, k)) pal_packet_replace(&of->field[k].packet, NULL);
        if (!has(asked.fields, k) || !asked.interior) pal_packet_replace(&of->interior[k].packet, NULL);
    }
}

void pal_relay_values_take(pal_relay_values *of, bool interior, pal_wire_field field, pal_relay_value value)
{
    pal_relay_value *place = interior ? &of->interior[field] : &of->field[field];
    if (!has(of->asked.fields, (int)field) || (interior && !of->asked.interior)) {
        pal_packet_drop(value.packet);
        return;
    }
    pal_packet_drop(place->packet);
    *place = value;
}

static void show(pal_relay_value *value, uint32_t epoch, uint64_t *number)
{
    if (value->packet && value->epoch == epoch) value->number = ++*number;
}

void pal_relay_values_show_epoch(pal_relay_values *of, uint32_t epoch, uint64_t *number)
{
    for (int k = 0; k < PAL_WIRE_FIELD_COUNT; k++) {
        show(&of->field[k], epoch, number);
        show(&of->interior[k], epoch, number);
    }
}

static const pal_relay_value *older(const pal_relay_value *a, const pal_relay_value *b, uint32_t epoch, uint64_t sent)
{
    if (!b->packet || b->epoch != epoch || b->number <= sent) return a;
    return !a || b->number < a->number ? b : a;
}

const pal_relay_value *pal_relay_values_lacking(const pal_relay_values *of, const pal_relay_view *view, uint32_t epoch,
                                                uint64_t sent)
{
    const pal_relay_value *found = NULL;
    for (int k = 0; k < PAL_WIRE_FIELD_COUNT && view->fields; k++) {
        if (!has(view->fields, k)) continue;
        found = older(found, &of->field[k], epoch, sent);
        if (view->interior) found = older(found, &of->interior[k], epoch, sent);
    }
    return found;
}
