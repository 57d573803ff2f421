/* Adaptive surfaces: making one, and its changes of state (paper C, spatial adaptation).
 *
 * The state is one byte a face (absent, leaf, split) and one an edge (split faces beside it). Splitting a face may ask
 * for coarser neighbours first, and those again; all of that chain is marked, then counted, and only then placed, so
 * that a refusal leaves nothing behind.
 *
 * Departures: the paper places new vertices by the stencil on current positions (PAL_MIDPOINT_BUTTERFLY); that jumps
 * where the stencil reaches beyond a fold, so the default keeps the middle of the edge and its offset at rest. An edge
 * with both ends at rest gives the rest position to the bit; a fixed midpoint of an edge with a free end has the
 * displacement of the fixed end. */
#include "server/sim/surface/adaptive_surface.h"

#include "server/base/vec3.h"
#include "server/sim/surface/tuning.h"

#include <math.h>
#include <string.h>

/* a face of level l asks for two of level l - 1 at most, and level 0 for none */
enum { CHAIN = 1 << (PAL_LEVELS_MAX - 1), FRESH = 3 * CHAIN };

/* ---- making ---- */

static pal_err check_options(const pal_adaptive_options *o, pal_diagnostic *diag)
{
    if (!(o->mass_kg > 0) || !isfinite(o->mass_kg))
        return PAL_REFUSE(diag, "adaptive surface: a mass of %g kg", o->mass_kg);
    if (o->n_level >= 1 && (o->start_level < 0 || o->start_level >= o->n_level))
        return PAL_REFUSE(diag, "adaptive surface: start level %d, there are levels 0 to %d", o->start_level,
                          o->n_level - 1);
    return PAL_ERR_OK;
}

/* most entries that each list can have: the finest level's, as splitting only adds */
typedef struct room {
    size_t vertex, edge, face, all_edge, all_face, log;
} room;

static room room_of(const pal_levels *l)
{
    int last = l->n_level - 1;
    room r = {.vertex = (size_t)l->n_vertex[last]};
    r.edge = (size_t)pal_levels_n_edge(l, last), r.face = (size_t)pal_levels_n_face(l, last);
    r.all_edge = (size_t)l->first_edge[last + 1], r.all_face = (size_t)l->first_face[last + 1];
    r.log = r.face / 4 < LOG_MIN ? LOG_MIN : r.face / 4 > LOG_MAX ? LOG_MAX : r.face / 4;
    return r;
}

/* of state, lists and the body's arrays */
static size_t state_bytes(const room *r)
{
    return r->all_face + r->all_edge + r->face * 7 * sizeof(int32_t) + r->edge * (sizeof(int32_t) + sizeof(float)) +
           r->vertex * (2 * sizeof(int32_t) + 16 * sizeof(double) + 2) + r->log * sizeof(int32_t);
}

static void *copy_of(pal_arena *arena, const void *from, size_t n_byte)
{
    void *to = pal_arena_alloc(arena, n_byte);
    if (to && n_byte) memcpy(to, from, n_byte);
    return to;
}

/* the same levels with their arrays in the arena */
static bool move_levels(const pal_levels *l, pal_arena *arena, pal_levels *out)
{
    room r = room_of(l);
    size_t coarse = (size_t)l->n_vertex[0], rows = r.vertex - coarse, entries = (size_t)l->stencil_start[rows];
    *out = *l;
#define COPY(name, n) ((out->name = copy_of(arena, l->name, (n) * sizeof *l->name)) != NULL)
    return COPY(x, 3 * r.vertex) && COPY(edge, r.all_edge) && COPY(face, 3 * r.all_face) &&
           COPY(face_edge, 3 * r.all_face) && COPY(vertex_level, r.vertex) && COPY(edge_level, r.all_edge) &&
           COPY(face_level, r.all_face) && COPY(spoke, (size_t)l->first_spoke[l->n_level]) &&
           COPY(stencil_start, rows + 1) && COPY(stencil_vertex, entries) && COPY(stencil_weight, entries) &&
           COPY(corner, coarse);
#undef COPY
}

static bool get_state(pal_adaptive_surface *s, pal_arena *arena)
{
    room r = room_of(&s->levels);
    s->n_slot = (int)r.face;
    s->n_log_room = (int)r.log;
    s->face_state = PAL_NEW(arena, uint8_t, r.all_face);
    s->edge_split = PAL_NEW(arena, uint8_t, r.all_edge);
    s->leaf = PAL_NEW(arena, int32_t, r.face);
    s->spring = PAL_NEW(arena, int32_t, r.edge);
    s->spring_share = PAL_NEW(arena, float, r.edge);
    s->node = PAL_NEW(arena, int32_t, r.vertex);
    s->n_beside = PAL_NEW(arena, int32_t, r.vertex);
    s->slab = PAL_NEW(arena, uint8_t, r.vertex);
    s->slot = PAL_NEW(arena, int32_t, 3 * r.face);
    s->tri = PAL_NEW(arena, int32_t, 3 * r.face);
    s->log = PAL_NEW(arena, int32_t, r.log);
    s->chain = PAL_NEW(arena, int32_t, CHAIN);
    s->fresh = PAL_NEW(arena, int32_t, FRESH);
    return s->face_state && s->edge_split && s->leaf && s->spring && s->spring_share && s->node && s->n_beside &&
           s->slab && s->slot && s->tri && s->log && s->chain && s->fresh;
}

double pal_adaptive_mean_edge_m(const pal_levels *l, int level)
{
    double sum = 0;
    for (int32_t e = l->first_edge[level]; e < l->first_edge[level + 1]; e++)
        sum += pal_dist3(l->x + 3 * (size_t)l->edge[e].vertex[0], l->x + 3 * (size_t)l->edge[e].vertex[1]);
    return sum / pal_levels_n_edge(l, level);
}

/* slabs of equal width */
static void find_slabs(pal_adaptive_surface *s)
{
    const pal_levels *l = &s->levels;
    const int n = l->n_vertex[l->n_level - 1];
    double low[3], high[3];
    int axis = 0;
    pal_surface_box(&(pal_surface){.n_vertex = n, .x = l->x}, low, high);
    for (int c = 1; c < 3; c++)
        if (high[c] - low[c] > high[axis] - low[axis]) axis = c;
    const double length_m = high[axis] - low[axis], per_m = length_m > 0 ? (PAL_ADAPTIVE_SLABS - 1) / length_m : 0;
    for (int i = 0; i < n; i++) s->slab[i] = (uint8_t)(per_m * (l->x[3 * (size_t)i + (size_t)axis] - low[axis]));
}

static pal_err make_body(pal_adaptive_surface *s, pal_body *body, pal_arena *arena)
{
    const pal_levels *l = &s->levels;
    size_t n = (size_t)l->n_vertex[l->n_level - 1];
    PAL_TRY(pal_body_allocate(body, arena, (int)n));
    memcpy(body->x_rest, l->x, 3 * n * sizeof *body->x_rest);
    memcpy(body->x, l->x, 3 * n * sizeof *body->x);
    s->surface = (pal_surface){.n_vertex = (int)n, .x = s->levels.x, .tri = s->tri};
    pal_copy3(s->surface.origin_m, l->origin_m);
    body->model.adaptive = s;
    body->display.surface = &s->surface;
    body->active = s->node;
    body->edge_m = pal_adaptive_mean_edge_m(l, s->options.start_level);
    return PAL_ERR_OK;
}

static pal_err refuse_bytes(int n_level, const char *what, size_t n_byte, size_t budget, pal_diagnostic *diag)
{
    return pal_diagnostic_set(diag, PAL_ERR_BUDGET,
                              "adaptive surface: %d levels need %s%.4g MiB, the budget is %.4g MiB: ask for fewer "
                              "levels or a coarser surface",
                              n_level, what, (double)n_byte / (1 << 20), (double)budget / (1 << 20));
}

pal_err pal_adaptive_make(const pal_surface *surface, const pal_adaptive_options *options, pal_body *body,
                          pal_arena *arena, pal_diagnostic *diag, pal_adaptive_surface **out)
{
    PAL_TRY(check_options(options, diag));
    size_t budget = options->budget_byte ? options->budget_byte : BUDGET_BYTES;
    pal_levels levels = {0};
    PAL_TRY(pal_levels_make(surface, &(pal_levels_options){.n_level = options->n_level, .budget_byte = budget}, &levels,
                            diag));
    room r = room_of(&levels);
    size_t n_byte = levels.n_byte + state_bytes(&r), min = n_byte + COMPONENT_BYTES * r.vertex;
    if (min > budget) {
        pal_levels_free(&levels);
        return refuse_bytes(options->n_level, "at least ", min, budget, diag);
    }
    pal_adaptive_surface *s = PAL_NEW(arena, pal_adaptive_surface, 1);
    bool ok = s && move_levels(&levels, arena, &s->levels) && get_state(s, arena);
    pal_levels_free(&levels);
    if (!ok) return PAL_ERR_MEMORY;
    s->options = *options;
    s->options.budget_byte = budget;
    s->n_byte = n_byte;
    for (int k = 0; k < s->levels.n_level; k++) s->level_mass_kg[k] = options->mass_kg / s->levels.n_vertex[k];
    find_slabs(s);
    PAL_TRY(make_body(s, body, arena));
    pal_adaptive_set_level(s, body, options->start_level);
    pal_adaptive_update(s, body);
    s->n_log = 0;
    pal_adaptive_fill_dofs(s, body);
    *out = s;
    return PAL_ERR_OK;
}

pal_err pal_adaptive_check_bytes(const pal_adaptive_surface *adaptive, size_t n_byte, pal_diagnostic *diag)
{
    const pal_adaptive_options *o = &adaptive->options;
    if (n_byte <= o->budget_byte) return PAL_ERR_OK;
    return refuse_bytes(o->n_level, "with components, tools and display ", n_byte, o->budget_byte, diag);
}

/* ---- splitting ---- */

/* marks the leaf split, after the coarser neighbours that 2:1 asks for; n and m count faces and new midpoints */
static void mark_split(pal_adaptive_surface *s, int32_t f, int *n, int *m)
{
    const pal_levels *l = &s->levels;
    const int32_t *side = l->face_edge + 3 * (size_t)f, parent = pal_levels_face_parent(l, f);
    for (int k = 0; k < 3; k++) {
        int32_t whole = pal_levels_edge_parent(l, side[k]);
        if (whole < 0) continue;
        const int32_t *beside = l->edge[whole].face;
        int32_t other = beside[0] == parent ? beside[1] : beside[0];
        if (other >= 0 && s->face_state[other] == PAL_FACE_LEAF) mark_split(s, other, n, m);
    }
    s->face_state[f] = PAL_FACE_SPLIT;
    memset(s->face_state + pal_levels_face_child(l, f, 0), PAL_FACE_LEAF, 4);
    for (int k = 0; k < 3; k++)
        if (s->edge_split[side[k]]++ == 0) s->fresh[(*m)++] = side[k];
    s->chain[(*n)++] = f;
}

static void unmark_split(pal_adaptive_surface *s, int32_t f)
{
    const pal_levels *l = &s->levels;
    memset(s->face_state + pal_levels_face_child(l, f, 0), PAL_FACE_ABSENT, 4);
    s->face_state[f] = PAL_FACE_LEAF;
    for (int k = 0; k < 3; k++) s->edge_split[l->face_edge[3 * (size_t)f + (size_t)k]]--;
}

/* sum of the areas of the faces beside the edge, as a direction */
static bool edge_normal(const pal_levels *l, int32_t e, const double *x, double n[3])
{
    pal_set3(n, 0, 0, 0);
    for (int side = 0; side < 2; side++) {
        int32_t f = l->edge[e].face[side];
        if (f < 0) continue;
        const int32_t *c = l->face + 3 * (size_t)f;
        double a[3];
        pal_normal3(a, x + 3 * (size_t)c[0], x + 3 * (size_t)c[1], x + 3 * (size_t)c[2]);
        pal_add3(n, n, a);
    }
    return pal_unit3(n, n, 0);
}

/* r = a rotated by the smallest rotation from unit vector `from` to unit vector `to` */
static void min_turn(double r[3], const double from[3], const double to[3], const double a[3])
{
    double q[4] = {1 + pal_dot3(from, to)};
    pal_cross3(q + 1, from, to);
    double n = sqrt(q[0] * q[0] + pal_dot3(q + 1, q + 1));
    if (!(n > 1e-8)) { /* half a turn has no unique axis: the offset stays on its side */
        double along = 2 * pal_dot3(a, from);
        for (int c = 0; c < 3; c++) r[c] = a[c] - along * from[c];
        return;
    }
    for (int c = 0; c < 4; c++) q[c] /= n;
    pal_quat_rotate(r, q, a);
}

/* the offset of an edge's midpoint turned with the edge and the faces beside it, or with as much of them as has a
 * direction */
static void turn_offset(const pal_levels *l, int32_t e, const double *x, double offset[3])
{
    const int32_t *end = l->edge[e].vertex;
    double t0[3], n0[3], b0[3], t[3], n[3], b[3];
    pal_sub3(t0, l->x + 3 * (size_t)end[1], l->x + 3 * (size_t)end[0]);
    pal_sub3(t, x + 3 * (size_t)end[1], x + 3 * (size_t)end[0]);
    bool along = pal_unit3(t0, t0, 0) && pal_unit3(t, t, 0);
    bool across = edge_normal(l, e, l->x, n0) && edge_normal(l, e, x, n);
    if (along && across) {
        pal_cross3(b0, n0, t0), pal_cross3(b, n, t);
        if (pal_unit3(b0, b0, 1e-6) && pal_unit3(b, b, 1e-6)) {
            pal_cross3(n0, t0, b0), pal_cross3(n, t, b);
            double p = pal_dot3(offset, t0), q = pal_dot3(offset, b0), r = pal_dot3(offset, n0);
            for (int c = 0; c < 3; c++) offset[c] = p * t[c] + q * b[c] + r * n[c];
            return;
        }
    }
    if (along)
        min_turn(offset, t0, t, offset);
    else if (across)
        min_turn(offset, n0, n, offset);
}

/* position of v by its stencil; vertices of it that are no nodes take theirs recursively */
static void by_stencil(const pal_adaptive_surface *s, const double *x, int32_t v, double out[3])
{
    const pal_levels *l = &s->levels;
    const int32_t row = v - l->n_vertex[0];
    double sum[3] = {0, 0, 0}, p[3];
    for (int32_t k = l->stencil_start[row]; k < l->stencil_start[row + 1]; k++) {
        int32_t w = l->stencil_vertex[k];
        if (pal_adaptive_has(s, w))
            pal_copy3(p, x + 3 * (size_t)w);
        else
            by_stencil(s, x, w, p);
        pal_axpy3(sum, l->stencil_weight[k], p);
    }
    pal_copy3(out, sum);
}

void pal_adaptive_midpoint(const pal_adaptive_surface *s, const pal_body *body, int32_t edge, double x[3])
{
    const pal_levels *l = &s->levels;
    const int32_t v = pal_levels_edge_midpoint(l, edge), *end = l->edge[edge].vertex;
    const double *xa = body->x + 3 * (size_t)end[0], *xb = body->x + 3 * (size_t)end[1];
    const double *ra = body->x_rest + 3 * (size_t)end[0], *rb = body->x_rest + 3 * (size_t)end[1];
    double offset[3];
    for (int c = 0; c < 3; c++) offset[c] = body->x_rest[3 * (size_t)v + (size_t)c] - (0.5 * ra[c] + 0.5 * rb[c]);
    turn_offset(l, edge, body->x, offset);
    for (int c = 0; c < 3; c++) x[c] = 0.5 * xa[c] + 0.5 * xb[c] + offset[c];
}

/* the midpoint of the edge becomes a node; its mass follows with the lists */
static void place(const pal_adaptive_surface *s, pal_body *body, int32_t e)
{
    const pal_levels *l = &s->levels;
    const int32_t v = pal_levels_edge_midpoint(l, e), *end = l->edge[e].vertex;
    const double *xa = body->x + 3 * (size_t)end[0], *xb = body->x + 3 * (size_t)end[1];
    const double *ra = body->x_rest + 3 * (size_t)end[0], *rb = body->x_rest + 3 * (size_t)end[1];
    const double *va = body->v + 3 * (size_t)end[0], *vb = body->v + 3 * (size_t)end[1];
    double *x = body->x + 3 * (size_t)v, *rest = body->x_rest + 3 * (size_t)v;
    bool at_rest = body->support[v] == PAL_FIXED, supported[2] = {body->support[end[0]] > 0, body->support[end[1]] > 0};
    for (int c = 0; c < 3; c++) body->v[3 * (size_t)v + (size_t)c] = at_rest ? 0 : 0.5 * va[c] + 0.5 * vb[c];
    /* an edge at rest keeps every bit; a fixed midpoint takes the mean only when both ends are fixed, else the
     * displacement of the fixed end */
    if (at_rest && supported[0] != supported[1]) {
        for (int c = 0; c < 3; c++) x[c] = rest[c] + (supported[0] ? xa[c] - ra[c] : xb[c] - rb[c]);
        return;
    }
    if (at_rest) at_rest = !supported[0];
    if (!memcmp(xa, ra, 3 * sizeof *xa) && !memcmp(xb, rb, 3 * sizeof *xb)) at_rest = true;
    if (at_rest) {
        pal_copy3(x, rest);
        return;
    }
    if (s->options.place == PAL_MIDPOINT_BUTTERFLY) {
        by_stencil(s, body->x, v, x);
        return;
    }
    pal_adaptive_midpoint(s, body, e, x);
}

int pal_adaptive_split(pal_adaptive_surface *s, pal_body *body, int32_t face, int max_node)
{
    const pal_levels *l = &s->levels;
    if (s->face_state[face] != PAL_FACE_LEAF || l->face_level[face] + 1 >= l->n_level) return 0;
    int n = 0, m = 0;
    mark_split(s, face, &n, &m);
    if (max_node > 0 && s->n_live + m > max_node) {
        while (n > 0) unmark_split(s, s->chain[--n]);
        return 0;
    }
    s->n_live += m;
    s->stale = true;
    /* coarse ones first: corners and stencils of the finer may be among them */
    for (int level = 0, done = 0; done < m; level++)
        for (int k = 0; k < m; k++)
            if (l->edge_level[s->fresh[k]] == level) place(s, body, s->fresh[k]), done++;
    return n;
}

/* ---- joining ---- */

static void retire(pal_body *body, int32_t v)
{
    size_t at = 3 * (size_t)v;
    pal_copy3(body->x + at, body->x_rest + at);
    pal_set3(body->v + at, 0, 0, 0);
    pal_set3(body->f + at, 0, 0, 0);
    pal_set3(body->load + at, 0, 0, 0);
    body->mass_kg[v] = 0;
}

bool pal_adaptive_can_join(const pal_adaptive_surface *s, int32_t face)
{
    const pal_levels *l = &s->levels;
    if (s->face_state[face] != PAL_FACE_SPLIT) return false;
    const uint8_t *child = s->face_state + pal_levels_face_child(l, face, 0);
    for (int k = 0; k < 4; k++)
        if (child[k] != PAL_FACE_LEAF) return false;
    for (int k = 0; k < 3; k++) {
        const uint8_t *half = s->edge_split + pal_levels_edge_half(l, l->face_edge[3 * (size_t)face + (size_t)k], 0);
        if (half[0] || half[1]) return false;
    }
    return true;
}

bool pal_adaptive_join(pal_adaptive_surface *s, pal_body *body, int32_t face)
{
    const pal_levels *l = &s->levels;
    if (!pal_adaptive_can_join(s, face)) return false;
    int32_t child = pal_levels_face_child(l, face, 0), own = s->n_slot / pal_levels_n_face(l, l->face_level[child]);
    s->face_state[face] = PAL_FACE_LEAF;
    memset(s->face_state + child, PAL_FACE_ABSENT, 4);
    for (int k = 0; k < 3; k++) {
        int32_t e = l->face_edge[3 * (size_t)face + (size_t)k];
        if (--s->edge_split[e] > 0) continue;
        retire(body, pal_levels_edge_midpoint(l, e));
        s->n_live--;
    }
    /* the face writes its own first four slots, those of child 0, with the next lists */
    for (int k = 1; k < 4 && own >= 4; k++) pal_adaptive_clear_slots(s, pal_adaptive_triangle_slot(s, child + k), 4);
    s->stale = true;
    return true;
}

void pal_adaptive_set_level(pal_adaptive_surface *s, pal_body *body, int level)
{
    const pal_levels *l = &s->levels;
    /* a node before and after stays as it is */
    for (int32_t v = l->n_vertex[0]; v < l->n_vertex[l->n_level - 1]; v++)
        if (!pal_adaptive_has(s, v) || l->vertex_level[v] > level) retire(body, v);
    memset(s->face_state, PAL_FACE_SPLIT, (size_t)l->first_face[level]);
    memset(s->face_state + l->first_face[level], PAL_FACE_LEAF, (size_t)pal_levels_n_face(l, level));
    memset(s->face_state + l->first_face[level + 1], PAL_FACE_ABSENT,
           (size_t)(l->first_face[l->n_level] - l->first_face[level + 1]));
    for (int32_t e = 0; e < l->first_edge[l->n_level]; e++)
        s->edge_split[e] = l->edge_level[e] >= level ? 0 : l->edge[e].face[1] < 0 ? 1 : 2;
    int32_t own = s->n_slot / pal_levels_n_face(l, level);
    for (int32_t first = 0; first < s->n_slot && own > 4; first += own) pal_adaptive_clear_slots(s, first + 4, own - 4);
    s->n_live = l->n_vertex[level];
    s->spring_ramp = s->shape_ramp = 1;
    s->stale = true;
}
