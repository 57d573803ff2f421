/* Making a row of springs: constraints -> weights -> strips -> lanes. */
#include "server/sim/spring_row.h"

#include <stdlib.h>
#include <string.h>

static void corners_at(const double *x, const int32_t *node, int n, const double *to[PAL_CORNERS])
{
    for (int c = 0; c < PAL_CORNERS; c++) to[c] = x + 3 * node[c < n ? c : 0];
}

static pal_err fill(pal_spring_row *row, const pal_build *build, double *weight)
{
    const pal_body *body = build->body;
    pal_arena *arena = build->arena;
    PAL_TRY(pal_strips_make(body->slots, row->item, row->n_item, row->n_corner, arena, &row->strips));
    PAL_TRY(pal_spring_weights(&row->spring, body, row->item, row->n_item, row->n_corner, weight));
    pal_spring_on_grid(&row->spring, &build->def->spring_grid, body, row->item, row->n_item, row->n_corner, weight);
    row->w = PAL_NEW(arena, double, row->strips.n_lane);
    row->q = PAL_NEW(arena, double, row->strips.n_lane);
    if (!row->w || !row->q) return PAL_ERR_MEMORY;
    for (int i = 0; i < row->n_item; i++) {
        const double *x[PAL_CORNERS];
        corners_at(body->x_rest, row->item + row->n_corner * i, row->n_corner, x);
        row->w[row->strips.place[i]] = 1 / pal_spring_measure(row->spring.kind, x);
        row->q[row->strips.place[i]] = weight[i];
    }
    return PAL_ERR_OK;
}

pal_err pal_spring_row_check(const pal_item *entry, const pal_build *build)
{
    if (build->body->tets && build->body->tets->n_tet > 0) return PAL_ERR_OK;
    return pal_note_set(build->note, PAL_ERR_REFUSED, "%s: \"%s\" needs a body of tetrahedra", entry->path,
                        entry->name);
}

pal_err pal_spring_row_make(pal_spring_kind kind, pal_item *entry, pal_build *build, int32_t *item, int n_item,
                            double least, pal_spring_row *out)
{
    const pal_body *body = build->body;
    const int n_corner = pal_spring_corner_count(kind);
    PAL_TRY(pal_spring_read(kind, entry, build, &out->spring));
    out->n_corner = n_corner;
    for (int i = 0; i < n_item; i++) {
        const double *x[PAL_CORNERS];
        corners_at(body->x_rest, item + n_corner * i, n_corner, x);
        if (!(fabs(pal_spring_measure(kind, x)) > least)) continue;
        memmove(item + n_corner * out->n_item++, item + n_corner * i, sizeof *item * (size_t)n_corner);
    }
    size_t n = (size_t)out->n_item * (size_t)n_corner;
    out->item = PAL_NEW(build->arena, int32_t, n);
    double *weight = malloc(sizeof *weight * ((size_t)out->n_item + 1));
    if (!out->item || !weight) {
        free(weight);
        return PAL_ERR_MEMORY;
    }
    memcpy(out->item, item, n * sizeof *item);
    pal_err err = fill(out, build, weight);
    free(weight);
    return err;
}

pal_err pal_spring_row_material(void *self, const pal_body *body, const pal_material *material, pal_note *note)
{
    (void)note;
    pal_spring_material(&((pal_spring_row *)self)->spring, body, material);
    return PAL_ERR_OK;
}
