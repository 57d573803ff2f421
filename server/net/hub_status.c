/* Most of a status is the same for all clients of a room, and to write its numbers takes longer than to send them. So
 * it is encoded at most once a tick, with zeros where the numbers of a client stand. Who has asked for energies, mostly
 * nobody, gets a message of its own. */
#include "server/net/hub_status.h"

#include "server/net/hub_peers.h"
#include "server/net/hub_plan.h"
#include "server/net/hub_steering.h"
#include "server/net/transport/plain_text.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* the keys of a client's own numbers, as the encoder writes them while they are 0 */
static const char own_zeros[] = "\"bytes_s\":0,\"rtt_ms\":0,\"skipped_cycles\":0";

/* what all clients see alike */
static void fill(pal_hub_room *room, pal_wire_status *w)
{
    const pal_stream *s = room->stream;
    const pal_frame *f = s->frame;
    pal_diagnostic diag = {""};
    w->n_member = (uint32_t)room->members.n_member;
    w->n_viewer = (uint32_t)room->n_viewer;
    pal_session_last_diagnostic(room->session, &diag);
    pal_plain_text(w->diag, sizeof w->diag, diag.text);
    w->step_rate_hz = s->step_rate_hz;
    w->step_ms = s->step_ms;
    w->slowdown = 1;
    if (!f) return;
    w->tick = f->tick;
    w->sim_time_s = f->time_s;
    w->paused = f->paused;
    if (isfinite(f->slowdown) && f->slowdown > 0) w->slowdown = f->slowdown;
    w->substeps = f->n_substep > 0 ? (uint32_t)f->n_substep : 0;
    w->n_component = (uint32_t)f->n_row;
    for (int r = 0; r < f->n_row; r++) w->component_ms[r] = s->component_ms[r];
    pal_hub_status_plan(room, f, w);
    for (int p = 0; p < s->n_part; p++)
        if (s->part[p].slots)
            w->active[w->n_active++] =
                (pal_wire_active){(uint32_t)p, (uint32_t)f->part[p].n_active, (uint32_t)f->part[p].n_spring,
                                  (uint32_t)f->part[p].n_finest, (uint32_t)f->part[p].n_finest_spring};
    pal_hub_playback_status(room, w);
    w->n_device = (uint32_t)pal_stream_devices(s, room->tool, w->device);
    w->n_late = f->n_late;
    w->n_refused = f->n_refused;
}

static void fill_energies(const pal_client *c, pal_wire_status *w)
{
    const pal_frame *f = c->room->stream->frame;
    for (int p = 0; f && p < c->room->stream->n_part; p++) {
        const pal_frame_part *part = &f->part[p];
        const pal_frame_field *taken = &part->field[PAL_FIELD_ENERGY_J_M3];
        if (c->energy[p] && taken->revision > 0)
            w->energy[w->n_energy++] = (pal_wire_energy){(uint32_t)p, taken->time_s, part->kinetic_J, part->elastic_J};
    }
}

/* a copy of the status of all with the numbers of this client */
static pal_packet *put_own(const pal_packet *common, double bytes_s, double rtt_ms, uint32_t n_skipped)
{
    const char *text = (const char *)common->bytes;
    char own[128];
    const char *at = memmem(text, common->n_byte, own_zeros, sizeof own_zeros - 1);
    if (!at) return NULL;
    const size_t n_before = (size_t)(at - text), n_after = common->n_byte - n_before - (sizeof own_zeros - 1);
    const size_t n = (size_t)snprintf(own, sizeof own, "\"bytes_s\":%.9g,\"rtt_ms\":%.9g,\"skipped_cycles\":%u",
                                      bytes_s, rtt_ms, n_skipped);
    pal_packet *packet = pal_packet_create(NULL, n_before + n + n_after, true);
    if (!packet) return NULL;
    memcpy(packet->bytes, text, n_before);
    memcpy(packet->bytes + n_before, own, n);
    memcpy(packet->bytes + n_before + n, at + sizeof own_zeros - 1, n_after);
    return packet;
}

pal_packet *pal_hub_next_status(pal_client *c)
{
    pal_hub_room *room = c->room;
    pal_packet *common = room->status, *packet = NULL;
    bool energies = false;
    /* a replaced session has no frame yet, and its simulated time continues with the first */
    if (!room->stream->frame && room->stream->cycle) return NULL;
    for (int p = 0; p < room->stream->n_part; p++) energies |= c->energy[p];
    if (energies || !common) {
        pal_wire_status *w = &pal_hub_message(c->hub, PAL_CONTROL_STATUS)->status;
        fill(room, w);
        if (energies) fill_energies(c, w);
        common = pal_hub_encode(c->hub);
        if (!common) return NULL;
    }
    const uint64_t now = pal_loop_now_ns(c->hub->loop);
    const double past_s = 1e-9 * (double)(now - c->status_ns);
    const double bytes_s = c->status_ns && past_s > 0 ? (double)(c->n_byte - c->status_byte) / past_s : 0;
    c->status_ns = now;
    c->status_byte = c->n_byte;
    packet = put_own(common, bytes_s, c->credit.rtt_s * 1e3, (uint32_t)c->n_skipped);
    if (energies)
        pal_packet_drop(common);
    else
        room->status = common;
    return packet;
}
