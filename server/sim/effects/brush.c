/* Component brush (brush.h): the action of sculpting tools on the shown nodes of a body.
 *
 * INFLATE: a triangle with corners x and weight w gives each corner p w / 6 (x1 - x0) x (x2 - x0). With w = 1 over a
 * closed surface that is p times the gradient of its volume: no net force, no net moment. A follower pressure has no
 * energy; its stiffness is not symmetric and is left out of the tangent.
 * CURVE: f_i = k_i (begin_i + 4 t_i (1 - t_i) lift - d_i), k_i = stiffness w_i / sum w; energy sum k_i/2 |..|^2. */
#include "server/sim/core/brush.h"

#include "server/base/vec3.h"
#include "server/sim/core/blend.h"
#include "server/sim/effects/pressure_bound.h"
#include "server/sim/effects/tuning.h"

/* an active brush; `now` is its present value, which ramps to `to` */
typedef struct slot {
    pal_brush brush;
    pal_arena *arena; /* of the arrays below; NULL: no brush in this slot */
    int n;
    int32_t *item;  /* triangles (INFLATE) or nodes (CURVE)      [n]    */
    double *weight; /* of triangles; share k_i / k of nodes [n] */
    double *begin;  /* CURVE: positions of the nodes at the start [n][3] */
    double *bow;    /* CURVE: 4 t (1 - t)                        [n]    */
    double now[3];  /* pressure_Pa, or lift_m */
    double left_s;  /* until `now` reaches its target */
    double share;   /* ramp of the load, 0 to 1 */
    bool ending;
} slot;

typedef struct brushes {
    slot slot[PAL_TOOL_MAX];
    double step_s; /* of the last step; 0: none yet */
} brushes;

static bool same3(const double a[3], const double b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

pal_err pal_brush_check(const pal_brush *b, pal_diagnostic *diag)
{
    if (b->kind != PAL_BRUSH_INFLATE && b->kind != PAL_BRUSH_CURVE)
        return PAL_REFUSE(diag, "brush: there is no kind %d", (int)b->kind);
    bool curve = b->kind == PAL_BRUSH_CURVE;
    if (!pal_finite3(b->at_m) || (curve && (!pal_finite3(b->to_m) || !pal_finite3(b->lift_m))))
        return PAL_REFUSE(diag, "brush: a place or lift_m is no number");
    const struct {
        const char *name, *wanted;
        double value, low, high;
    } range[] = {{"radius_m", "1e-9 to 1e9", b->radius_m, 1e-9, 1e9},
                 {"softness", "0 to 1", b->softness, 0, 1},
                 {"pressure_Pa", "-1e9 to 1e9", curve ? 0 : b->pressure_Pa, -1e9, 1e9},
                 {"stiffness_N_m", "1e-9 to 1e9", curve ? b->stiffness_N_m : 1, 1e-9, 1e9}};
    for (int i = 0; i < 4; i++)
        if (!(range[i].value >= range[i].low && range[i].value <= range[i].high))
            return PAL_REFUSE(diag, "brush: %s %g, wanted %s", range[i].name, range[i].value, range[i].wanted);
    if (curve && same3(b->at_m, b->to_m))
        return PAL_REFUSE(diag, "brush: both ends of the curve are at %g %g %g m", b->at_m[0], b->at_m[1], b->at_m[2]);
    return PAL_ERR_OK;
}

/* ---- reach ---- */

static double weight_at(const pal_brush *b, const double middle[3], const double x[3])
{
    pal_stroke stroke = {.radius_m = b->radius_m, .softness = b->softness};
    pal_copy3(stroke.at_m, middle);
    return pal_stroke_weight(&stroke, x);
}

/* the parameter t = 0..1 of the handle's point nearest to x */
static double along(const pal_brush *b, const double x[3], double at[3])
{
    double axis[3], off[3];
    pal_sub3(axis, b->to_m, b->at_m);
    pal_sub3(off, x, b->at_m);
    double t = fmin(1, fmax(0, pal_dot3(off, axis) / pal_dot3(axis, axis)));
    pal_copy3(at, b->at_m);
    pal_axpy3(at, t, axis);
    return t;
}

static int32_t corner_node(const pal_body *body, int t, int c)
{
    return body->display.shown_node[body->display.surface->tri[3 * (size_t)t + (size_t)c]];
}

static const double *corner_at(const pal_body *body, const double *x, int t, int c)
{
    return x + 3 * (size_t)corner_node(body, t, c);
}

/* weight of triangle or shown vertex i, and for a node of a handle its t and position */
static double reach(const pal_body *body, const pal_brush *b, int i, double *t)
{
    double at[3] = {0, 0, 0};
    if (b->kind == PAL_BRUSH_INFLATE) {
        for (int c = 0; c < 3; c++) pal_axpy3(at, 1.0 / 3, corner_at(body, body->node_rest, i, c));
        return weight_at(b, b->at_m, at);
    }
    const double *x = body->node_rest + 3 * (size_t)body->display.shown_node[i];
    *t = along(b, x, at);
    return weight_at(b, at, x);
}

/* allocates the arrays of a slot for the items in reach; the weights of a handle sum to 1 */
static pal_err take_items(const pal_body *body, const pal_brush *b, slot *s, pal_diagnostic *diag)
{
    const bool curve = b->kind == PAL_BRUSH_CURVE;
    const int n = curve ? body->display.n_shown : body->display.surface->n_tri;
    double t = 0, sum = 0, max = 0;
    for (int i = 0; i < n; i++) s->n += reach(body, b, i, &t) > 0;
    if (s->n == 0)
        return PAL_REFUSE(diag, "brush: nothing of body \"%s\" is within radius_m %g of it", body->name, b->radius_m);
    s->item = PAL_NEW(s->arena, int32_t, s->n);
    s->weight = PAL_NEW(s->arena, double, s->n);
    s->begin = PAL_NEW(s->arena, double, curve ? 3 * (size_t)s->n : 1);
    s->bow = PAL_NEW(s->arena, double, curve ? s->n : 1);
    if (!s->item || !s->weight || !s->begin || !s->bow) return PAL_ERR_MEMORY;
    for (int i = 0, k = 0; i < n; i++) {
        double w = reach(body, b, i, &t);
        if (!(w > 0)) continue;
        s->weight[k] = w, sum += w, max = fmax(max, w);
        s->item[k] = curve ? body->display.shown_node[i] : i;
        if (curve) pal_copy3(s->begin + 3 * (size_t)k, body->d + 3 * (size_t)s->item[k]), s->bow[k] = 4 * t * (1 - t);
        k++;
    }
    if (!curve) return PAL_ERR_OK;
    for (int k = 0; k < s->n; k++) s->weight[k] /= sum;
    double limit = body->load_cap_N / body->edge_m * sum / max;
    if (b->stiffness_N_m > limit)
        return PAL_REFUSE(diag, "brush: stiffness_N_m %g, body \"%s\" takes up to %.3g over %d nodes", b->stiffness_N_m,
                          body->name, limit, s->n);
    return PAL_ERR_OK;
}

/* the same with an arena of the slot's own, which it keeps on success only */
static pal_err fill(const pal_body *body, const pal_brush *b, slot *s, pal_diagnostic *diag)
{
    s->arena = pal_arena_create(4096, true);
    pal_err err = s->arena ? take_items(body, b, s, diag) : PAL_ERR_MEMORY;
    if (err) pal_arena_destroy(s->arena);
    return err;
}

/* ---- set and end ---- */

static void goal(const pal_brush *b, double out[3])
{
    pal_set3(out, b->pressure_Pa, 0, 0);
    if (b->kind == PAL_BRUSH_CURVE) pal_copy3(out, b->lift_m);
}

static bool acts(const slot *s)
{
    return s->arena && !(s->ending && s->share == 0);
}

/* the same brush but for its pressure or lift */
static bool may_continue(const slot *s, const pal_brush *b)
{
    const pal_brush *a = &s->brush;
    return s->arena && !s->ending && a->kind == b->kind && same3(a->at_m, b->at_m) && a->radius_m == b->radius_m &&
           a->softness == b->softness &&
           (b->kind == PAL_BRUSH_INFLATE || (same3(a->to_m, b->to_m) && a->stiffness_N_m == b->stiffness_N_m));
}

pal_err pal_brush_make(const pal_body *body, pal_arena *arena, pal_diagnostic *diag, void **self)
{
    if (body->active || body->display.skin || !body->display.surface || !body->display.shown_node ||
        body->display.n_shown == 0)
        return PAL_REFUSE(diag, "body \"%s\" has no brushes: %s", body->name,
                          body->active         ? "its surface adapts"
                          : body->display.skin ? "it is shown by a skin; take output \"surface_output\""
                                               : "it shows nothing");
    *self = PAL_NEW(arena, brushes, 1);
    return *self ? PAL_ERR_OK : PAL_ERR_MEMORY;
}

pal_err pal_brush_set(void *self, const pal_body *body, int slot_index, const pal_brush *b, pal_diagnostic *diag)
{
    slot *s = &((brushes *)self)->slot[slot_index], fresh = {.brush = *b};
    PAL_TRY(pal_brush_check(b, diag));
    if (b->kind == PAL_BRUSH_CURVE && !(pal_norm3(b->lift_m) <= 10 * body->length_scale_m))
        return PAL_REFUSE(diag, "brush: lift_m of %g m, body \"%s\" takes up to %g", pal_norm3(b->lift_m), body->name,
                          10 * body->length_scale_m);
    /* 10 E: beyond it node loads are capped, and there are too many sub-steps for real time */
    const double max_Pa = body->load_cap_N / (body->edge_m * body->edge_m);
    if (b->kind == PAL_BRUSH_INFLATE && !(fabs(b->pressure_Pa) <= max_Pa))
        return PAL_REFUSE(diag, "brush: pressure_Pa %g, body \"%s\" takes up to %.3g", b->pressure_Pa, body->name,
                          max_Pa);
    if (may_continue(s, b)) {
        s->brush = *b;
        s->left_s = PAL_BLEND_S;
        return PAL_ERR_OK;
    }
    pal_err err = fill(body, b, &fresh, diag);
    if (err == PAL_ERR_MEMORY) return pal_diagnostic_set(diag, err, "no memory for a brush on body \"%s\"", body->name);
    PAL_TRY(err);
    goal(b, fresh.now);
    pal_arena_destroy(s->arena);
    *s = fresh;
    return PAL_ERR_OK;
}

/* ---- transfer to another body ---- */

/* displacement of a handle's nodes since its start near a rest position: the distance-weighted mean */
static void displacement_back(const slot *s, const pal_body *from, const double x[3], double out[3])
{
    double sum = 0, near2 = 1e-6 * s->brush.radius_m * s->brush.radius_m;
    pal_set3(out, 0, 0, 0);
    for (int k = 0; k < s->n; k++) {
        const size_t i = 3 * (size_t)s->item[k];
        double back[3], far = pal_dist3(from->node_rest + i, x), weight = 1 / pow(far * far + near2, 2);
        pal_sub3(back, s->begin + 3 * (size_t)k, from->d + i);
        pal_axpy3(out, weight, back);
        sum += weight;
    }
    pal_scale3(out, 1 / sum, out);
}

void pal_brush_hand(void *self, const pal_body *body, const void *before, const pal_body *from)
{
    for (int i = 0; i < PAL_TOOL_MAX; i++) {
        const slot *was = &((const brushes *)before)->slot[i];
        slot *s = &((brushes *)self)->slot[i], fresh = {.brush = was->brush};
        double back[3];
        if (!acts(was) || fill(body, &was->brush, &fresh, NULL)) continue;
        for (int k = 0; k < fresh.n && was->brush.kind == PAL_BRUSH_CURVE; k++) {
            const size_t node = 3 * (size_t)fresh.item[k];
            displacement_back(was, from, body->node_rest + node, back);
            pal_add3(fresh.begin + 3 * (size_t)k, body->d + node, back);
        }
        pal_copy3(fresh.now, was->now);
        fresh.left_s = was->left_s, fresh.share = was->share, fresh.ending = was->ending;
        pal_arena_destroy(s->arena);
        *s = fresh;
    }
}

void pal_brush_end(void *self, int slot_index)
{
    ((brushes *)self)->slot[slot_index].ending = true;
}

bool pal_brush_gone(const void *self)
{
    int n = 0;
    for (int i = 0; i < PAL_TOOL_MAX; i++) n += acts(&((const brushes *)self)->slot[i]);
    return n == 0;
}

size_t pal_brush_bytes(const void *self)
{
    const brushes *all = self;
    size_t n_byte = 0;
    for (int i = 0; i < PAL_TOOL_MAX; i++)
        if (all->slot[i].arena) n_byte += pal_arena_used(all->slot[i].arena);
    return n_byte;
}

static void destroy(void *self)
{
    brushes *all = self;
    for (int i = 0; i < PAL_TOOL_MAX; i++) pal_arena_destroy(all->slot[i].arena);
}

/* ---- a step ---- */

/* ramps to the end of the step, once per step */
static void advance(slot *s, double step_s)
{
    double to[3], left[3];
    s->share = pal_blend_toward(s->share, s->ending ? 0 : 1, step_s, PAL_BLEND_S);
    goal(&s->brush, to);
    pal_sub3(left, s->now, to);
    pal_scale3(left, pal_blend_release(&s->left_s, step_s), left);
    pal_add3(s->now, to, left);
}

/* twice the area vector of a triangle at nodes x */
static void area2(const pal_body *body, const double *x, int t, double n[3])
{
    pal_normal3(n, corner_at(body, x, t, 0), corner_at(body, x, t, 1), corner_at(body, x, t, 2));
}

static void inflate(const slot *s, const pal_body *body, double *load)
{
    for (int k = 0; k < s->n; k++) {
        const int t = s->item[k];
        double n[3], rest[3], force = s->share * s->now[0] * s->weight[k] / 6;
        area2(body, body->d, t, n), area2(body, body->node_rest, t, rest);
        const double now2 = pal_dot3(n, n), max2 = MAX_AREA * MAX_AREA * pal_dot3(rest, rest);
        if (now2 > max2) force *= sqrt(max2 / now2);
        for (int c = 0; c < 3; c++) pal_axpy3(load + 3 * (size_t)corner_node(body, t, c), force, n);
    }
}

/* from a node of the handle to its target */
static void pull(const slot *s, const pal_body *body, int k, double out[3])
{
    pal_sub3(out, s->begin + 3 * (size_t)k, body->d + 3 * (size_t)s->item[k]);
    pal_axpy3(out, s->bow[k], s->now);
}

static double spring(const slot *s, int k)
{
    return s->share * s->brush.stiffness_N_m * s->weight[k];
}

static pal_err run(void *self, pal_step *step)
{
    brushes *all = self;
    pal_body *body = step->body;
    if (step->sub == 0) all->step_s = step->dt_s * step->n_sub;
    for (int i = 0; i < PAL_TOOL_MAX; i++) {
        slot *s = &all->slot[i];
        if (!acts(s)) continue;
        if (step->sub == 0) advance(s, all->step_s);
        if (s->brush.kind == PAL_BRUSH_INFLATE) inflate(s, body, body->load);
        for (int k = 0; k < s->n && s->brush.kind == PAL_BRUSH_CURVE; k++) {
            double off[3];
            pull(s, body, k, off);
            pal_axpy3(body->load + 3 * (size_t)s->item[k], spring(s, k), off);
        }
    }
    return PAL_ERR_OK;
}

/* of handles alone */
static double energy(void *self, const pal_body *body)
{
    const brushes *all = self;
    double sum = 0;
    for (int i = 0; i < PAL_TOOL_MAX; i++) {
        const slot *s = &all->slot[i];
        for (int k = 0; k < s->n && acts(s) && s->brush.kind == PAL_BRUSH_CURVE; k++) {
            double off[3];
            pull(s, body, k, off);
            sum += 0.5 * spring(s, k) * pal_dot3(off, off);
        }
    }
    return sum;
}

/* with the ramp at the end of the next step */
static void stiffness(void *self, const pal_body *body, double *bound_N_m)
{
    const brushes *all = self;
    for (int i = 0; i < PAL_TOOL_MAX; i++) {
        const slot *s = &all->slot[i];
        if (!acts(s)) continue;
        const double soon = all->step_s > 0 ? pal_blend_toward(s->share, 1, all->step_s, PAL_BLEND_S) : 1;
        for (int k = 0; k < s->n && s->brush.kind == PAL_BRUSH_CURVE; k++)
            bound_N_m[s->item[k]] += soon * s->brush.stiffness_N_m * s->weight[k];
        const double p = soon * fmax(fabs(s->now[0]), fabs(s->brush.pressure_Pa)) / 6;
        for (int k = 0; k < s->n && s->brush.kind == PAL_BRUSH_INFLATE; k++) {
            const int t = s->item[k];
            const int32_t node[3] = {corner_node(body, t, 0), corner_node(body, t, 1), corner_node(body, t, 2)};
            pal_pressure_bound(body->d, node, p * s->weight[k], bound_N_m);
        }
    }
}

static void multiply(void *self, const pal_body *body, double k, const double *p, double *out)
{
    const brushes *all = self;
    (void)body;
    for (int i = 0; i < PAL_TOOL_MAX; i++) {
        const slot *s = &all->slot[i];
        for (int n = 0; n < s->n && acts(s) && s->brush.kind == PAL_BRUSH_CURVE; n++)
            pal_axpy3(out + 3 * (size_t)s->item[n], k * spring(s, n), p + 3 * (size_t)s->item[n]);
    }
}

/* the body was reset: no brush acts on it */
static void reset(void *self, const pal_body *body)
{
    brushes *all = self;
    (void)body;
    for (int i = 0; i < PAL_TOOL_MAX; i++) all->slot[i].ending = true, all->slot[i].share = 0;
}

/* the load of an active brush changes with time */
static double settled_s(const void *self)
{
    (void)self;
    return INFINITY;
}

static const pal_tangent tangent = {.multiply = multiply};

const pal_effect pal_effect_brush = {.name = "brush",
                                     .stage = PAL_STAGE_CONTACT,
                                     .run = run,
                                     .energy = energy,
                                     .bounds.stiffness = stiffness,
                                     .reset = reset,
                                     .tangent = &tangent,
                                     .sleep.settled_s = settled_s,
                                     .destroy = destroy};
