/* What a transfer shows (transfer.h): how far points move, and the display offset that is blended out. */
#include "server/sim/transfer/transfer.h"

#include "server/base/vec3.h"
#include "server/sim/core/blend.h"
#include "server/sim/transfer/transfer_core.h"

#include <float.h>
#include <stdlib.h>

/* does a point lie within the element whose nodes have these weights? Quadratic shape functions are as low as -1/8 */
static bool is_inside(const pal_interpolation *A, int i)
{
    for (int32_t k = A->start[i]; k < A->start[i + 1]; k++)
        if (A->weight[k] < -0.13) return false;
    return true;
}

double pal_transfer_body_move(const pal_transfer *t, const pal_body *from, const pal_body *to)
{
    double max = 0;
    int n_common = from->n_node < to->n_node ? from->n_node : to->n_node;
    for (int i = 0; i < n_common && t->adaptive; i++)
        if (pal_dofs_has(&from->dofs, i) && pal_dofs_has(&to->dofs, i))
            max = fmax(max, pal_dist3(from->x + 3 * i, to->x + 3 * i));
    for (int i = 0; i < from->n_node && !t->adaptive; i++) {
        double move[3] = {0, 0, 0};
        if (!is_inside(&t->A_old, i)) continue;
        for (int32_t k = t->A_old.start[i]; k < t->A_old.start[i + 1]; k++) {
            const size_t j = 3 * (size_t)t->A_old.point[k];
            for (size_t c = 0; c < 3; c++) move[c] += t->A_old.weight[k] * (to->d[j + c] - to->node_rest[j + c]);
        }
        for (int c = 0; c < 3; c++) move[c] -= from->d[3 * i + c] - from->node_rest[3 * i + c];
        max = fmax(max, pal_norm3(move));
    }
    return max;
}

/* ---- what is shown ---- */

bool pal_transfer_same_shown(const pal_world *next, const pal_world *before, int body)
{
    const pal_shown *a = &before->part[body], *b = &next->part[body];
    double length_scale_m = next->plan.body[body].length_scale_m;
    if (a->n_vertex != b->n_vertex) return false;
    for (int i = 0; i < 3 * a->n_vertex; i++)
        if (!(fabs((double)a->rest_m[i] - (double)b->rest_m[i]) <= 8 * (double)FLT_EPSILON * length_scale_m))
            return false;
    return true;
}

/* where a vertex of surface `names` was shown: itself, or between the ends of its edge */
static void add_shown(const pal_body *from, const pal_levels *names, int32_t i, double weight, double out[3])
{
    if (i < from->display.n_shown && pal_dofs_has(&from->dofs, i)) {
        for (int c = 0; c < 3; c++) out[c] += weight * (double)from->display.shown[3 * (size_t)i + (size_t)c];
        return;
    }
    const int32_t *end = names->edge[pal_levels_vertex_parent(names, i)].vertex;
    for (int k = 0; k < 2; k++) add_shown(from, names, end[k], 0.5 * weight, out);
}

/* where the new body's shown vertex i was shown, for a body whose vertices are nodes: within the old elements at rest
 * as the old nodes carry it; t->node_x has the new nodes so */
static void old_position(const pal_transfer *t, const pal_body *from, const pal_body *to, bool same, int i,
                         double out[3])
{
    pal_set3(out, 0, 0, 0);
    if (t->adaptive && pal_dofs_has(&to->dofs, i))
        add_shown(from, to->dofs.levels, i, 1, out);
    else if (same || t->adaptive)
        for (int c = 0; c < 3; c++)
            out[c] = (double)(t->adaptive ? to : from)->display.shown[3 * (size_t)i + (size_t)c];
    else
        pal_copy3(out, t->node_x + 3 * (size_t)to->display.shown_node[i]);
}

/* offsets of other bodies that are being blended out */
static void transfer_other_offsets(const pal_transfer *t, pal_world *next, const pal_world *before)
{
    for (int b = 0; b < next->plan.n_body && b < before->plan.n_body; b++) {
        const pal_body *from = &before->plan.body[b];
        if (b == t->body || !from->display.offset_m || from->display.n_shown != next->plan.body[b].display.n_shown)
            continue;
        size_t n = 3 * (size_t)from->display.n_shown;
        float *offset_m = malloc(sizeof *offset_m * n);
        for (size_t i = 0; i < n && offset_m; i++)
            offset_m[i] = (float)(from->display.offset_part * (double)from->display.offset_m[i]);
        if (offset_m) (void)pal_world_blend_display(next, b, offset_m);
        free(offset_m);
    }
}

void pal_transfer_display(pal_transfer *t, pal_world *next, const pal_world *before, pal_transfer_report *out)
{
    const pal_body *from = &before->plan.body[t->body], *to = &next->plan.body[t->body];
    bool same = pal_transfer_same_shown(next, before, t->body) && !t->adaptive;
    out->max_move_m = out->frame_move_m = out->body_move_m;
    transfer_other_offsets(t, next, before);
    if (to->display.n_shown == 0 || from->display.n_shown == 0 || (!same && !t->adaptive && to->display.skin)) return;
    float *offset_m = malloc(3 * sizeof *offset_m * (size_t)to->display.n_shown);
    double max = 0;
    if (!same && !t->adaptive) pal_transfer_interpolate_nodes(t, from, to);
    for (int i = 0; i < to->display.n_shown && offset_m; i++) {
        double was[3];
        old_position(t, from, to, same, i, was);
        for (int c = 0; c < 3; c++) {
            was[c] -= (double)to->display.shown[3 * (size_t)i + (size_t)c];
            offset_m[3 * (size_t)i + (size_t)c] = (float)was[c];
        }
        max = fmax(max, pal_norm3(was));
    }
    bool offset_set = offset_m && pal_world_blend_display(next, t->body, offset_m) == PAL_ERR_OK;
    free(offset_m);
    /* other vertices are shown: what the body itself moves says more */
    if (same) out->max_move_m = max;
    if (offset_set) out->frame_move_m = max * fmin(1, next->step_s / PAL_BLEND_S);
}
