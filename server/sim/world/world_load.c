/* Lasting loads on nodes, and the caps of node loads. */
#include "server/base/clock.h"
#include "server/base/vec3.h"
#include "server/sim/world/tuning.h"
#include "server/sim/world/world.h"
#include "server/sim/world/world_core.h"

#include <string.h>

double *pal_world_external_force(pal_world *w, int body)
{
    pal_body *b = &w->plan.body[body];
    if (!b->external_force) b->external_force = PAL_NEW(w->arena, double, 3 * (size_t)b->n_node);
    return b->external_force;
}

pal_err pal_world_load(pal_world *world, int body, int node, const double force_N[3])
{
    if (body < 0 || body >= world->plan.n_body || !pal_finite3(force_N)) return PAL_ERR_REFUSED;
    pal_body *b = &world->plan.body[body];
    if (node < 0 || node >= b->n_node || (b->active && !pal_dofs_has(&b->dofs, node))) return PAL_ERR_REFUSED;
    if (!pal_world_external_force(world, body)) return PAL_ERR_MEMORY;
    pal_copy3(b->external_force + 3 * node, force_N);
    b->asleep = false;
    return PAL_ERR_OK;
}

/* inactive nodes have no load (adaptive_surface.h) and keep theirs in external_force until they are active again. What
 * does not change is not written, so that it stays in the caches of the threads that share the step */
void pal_body_begin_loads(pal_body *body)
{
    static const double none[3] = {0};
    const double *lasting = body->external_force;
    const size_t n_byte = 3 * sizeof(double) * (size_t)body->n_node;
    for (int k = 0; k < body->n_active && body->active; k++) {
        const size_t i = 3 * (size_t)body->active[k];
        const double *from = lasting ? lasting + i : none;
        if (memcmp(body->load + i, from, sizeof none)) pal_copy3(body->load + i, from);
    }
    if (!body->active && lasting) memcpy(body->load, lasting, n_byte);
    if (!body->active && !lasting) memset(body->load, 0, n_byte);
    if (body->load_stiffness) memset(body->load_stiffness, 0, n_byte / 3);
}

/* A part of a supported body that many loads pull out, each within its cap, stretches by their sum and overshoots to
 * twice that. So the cap of lasting loads decreases beyond 2 S off the rest position, down to
 * PAL_LOAD_FAR_SHARE at 4 S. An
 * unsupported body or one with prescribed nodes may be anywhere */
static bool stays(const pal_body *body)
{
    bool fixed = false, prescribed = false;
    for (int i = 0; i < body->n_dof; i++)
        fixed |= body->support[i] == PAL_FIXED, prescribed |= body->support[i] == PAL_PRESCRIBED;
    return fixed && !prescribed;
}

/* nodes of a body without active ones that are looked at together: most have no load */
enum { TOGETHER = 8 };

static bool are_free(const double *load)
{
    int any = 0;
    for (int i = 0; i < 3 * TOGETHER; i++) any |= load[i] != 0;
    return !any;
}

void pal_body_cap_loads(pal_body *body, bool lasting)
{
    int staying = -1; /* not computed yet */
    const int n = pal_body_nodes(body);
    for (int k = 0; k < n; k++) {
        while (!body->active && k + TOGETHER <= n && are_free(body->load + 3 * (size_t)k)) k += TOGETHER;
        if (k == n) break;
        int i = pal_body_point(body, k);
        double *load = body->load + 3 * i, load2 = pal_dot3(load, load);
        if (load2 == 0) continue;
        double cap = lasting ? pal_body_node_load_cap_N(body, i) : body->load_cap_N;
        if (lasting && load2 > PAL_LOAD_FAR_SHARE * PAL_LOAD_FAR_SHARE * cap * cap) {
            double far_S = pal_dist3(body->d + 3 * i, body->node_rest + 3 * i) / body->length_scale_m;
            if (far_S > 2 && staying < 0) staying = stays(body);
            if (far_S > 2 && staying > 0) cap *= fmax(PAL_LOAD_FAR_SHARE, 0.5 * (4 - far_S));
        }
        if (load2 <= cap * cap) continue;
        uint64_t before = pal_clock_ns();
        pal_scale3(load, cap / sqrt(load2), load);
        body->safeguards.n_capped++;
        body->safeguards.ns += pal_clock_ns() - before;
    }
}
