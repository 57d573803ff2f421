/* Growing arrays, polygon fans and located refusals of the surface readers. */
#include "server/mesh/files/mesh_build.h"

#include "server/base/heap.h"

/* three corners of this many triangles still count in an int32 */
static const size_t max_piece = 700000000;

/* room for one more piece of three numbers; pointer: address of the array's pointer */
static pal_err grow(pal_mesh_build *build, void *pointer, size_t n, size_t size)
{
    if (n >= max_piece)
        return pal_diagnostic_set(build->diag, PAL_ERR_BUDGET, "%s: more than %zu pieces", build->name, max_piece);
    if (pal_heap_grow(pointer, n, 3 * size)) return PAL_ERR_OK;
    return pal_diagnostic_set(build->diag, PAL_ERR_MEMORY, "%s: no memory for more than %zu pieces", build->name, n);
}

pal_err pal_mesh_vertex(pal_mesh_build *build, const double p[3])
{
    PAL_TRY(grow(build, &build->x, build->n_vertex, sizeof *build->x));
    memcpy(build->x + 3 * build->n_vertex++, p, 3 * sizeof *p);
    return PAL_ERR_OK;
}

pal_err pal_mesh_position(pal_mesh_build *build, pal_text_scan *scan, const char *what)
{
    double p[3];
    for (int a = 0; a < 3; a++)
        if (!pal_text_double(scan, &p[a]))
            return PAL_MESH_REFUSE(build, scan->line, "%s needs three numbers, found %s", what,
                                   pal_text_excerpt_at(scan).text);
    return pal_mesh_vertex(build, p);
}

pal_err pal_mesh_image_point(pal_mesh_build *build, const double uv[2])
{
    if (build->n_vt >= (size_t)max_piece)
        return pal_diagnostic_set(build->diag, PAL_ERR_BUDGET, "%s: more than %zu pieces", build->name, max_piece);
    if (!pal_heap_grow(&build->vt, build->n_vt, 2 * sizeof *uv))
        return pal_diagnostic_set(build->diag, PAL_ERR_MEMORY, "%s: no memory for more than %zu pieces", build->name,
                                  build->n_vt);
    memcpy(build->vt + 2 * build->n_vt++, uv, 2 * sizeof *uv);
    return PAL_ERR_OK;
}

static pal_err add_triangle(pal_mesh_build *build, int64_t a, int64_t b, int64_t c)
{
    if (build->takes_image) {
        PAL_TRY(grow(build, &build->tri_vt, build->n_tri, sizeof *build->tri_vt));
        PAL_TRY(grow(build, &build->tri_material, build->n_tri, sizeof *build->tri_material));
        build->tri_material[build->n_tri] = build->now_material;
        int32_t *vt = build->tri_vt + 3 * build->n_tri;
        vt[0] = build->fan_first_vt, vt[1] = build->fan_last_vt, vt[2] = build->corner_vt;
    }
    PAL_TRY(grow(build, &build->tri, build->n_tri, sizeof *build->tri));
    int32_t *tri = build->tri + 3 * build->n_tri++;
    tri[0] = (int32_t)a, tri[1] = (int32_t)b, tri[2] = (int32_t)c;
    build->fan_n_tri++;
    return PAL_ERR_OK;
}

void pal_mesh_fan_begin(pal_mesh_build *build, int64_t at)
{
    if (build->n_tri == 0) build->first_at = at;
    build->fan_n = 0;
    build->fan_n_tri = 0;
}

pal_err pal_mesh_fan_corner(pal_mesh_build *build, int64_t at, int64_t index)
{
    if (index < 0 || index > INT32_MAX - 1)
        return PAL_MESH_REFUSE(build, at, "a face uses vertex index %lld", (long long)index);
    if (index > build->max_index) {
        build->max_index = index;
        build->max_index_at = at;
    }
    if (build->fan_n < 3) build->fan_n++;
    if (build->fan_n == 1) build->fan_first = index, build->fan_first_vt = build->corner_vt;
    if (build->fan_n == 3) PAL_TRY(add_triangle(build, build->fan_first, build->fan_last, index));
    build->fan_last = index, build->fan_last_vt = build->corner_vt;
    return PAL_ERR_OK;
}

pal_err pal_mesh_fan_end(pal_mesh_build *build)
{
    if (build->fan_n == 0 || build->fan_n_tri > 0) return PAL_ERR_OK;
    return add_triangle(build, build->fan_first, build->fan_last, build->fan_last);
}
