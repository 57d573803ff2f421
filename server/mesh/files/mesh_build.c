/* Growing arrays, polygon fans and located refusals of the surface readers. */
#include "server/mesh/files/mesh_build.h"

#include "server/mesh/files/file_bytes.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

/* three corners of this many triangles still count in an int32 */
static const size_t max_piece = 700000000;

pal_err pal_mesh_refuse(pal_mesh_build *build, int64_t at, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    pal_err err = pal_file_refuse(build->diag, build->name, build->binary ? "byte" : "line", at, format, list);
    va_end(list);
    return err;
}

/* array with room for n + more pieces of size bytes, at least half as many again when it moves */
static pal_err grow(pal_mesh_build *build, void **array, size_t *cap, size_t n, size_t more, size_t size)
{
    if (more <= *cap - n) return PAL_ERR_OK;
    if (more > max_piece || n + more > max_piece)
        return pal_diagnostic_set(build->diag, PAL_ERR_BUDGET, "%s: more than %zu pieces", build->name, max_piece);
    size_t wanted = n + more > *cap + *cap / 2 ? n + more : *cap + *cap / 2;
    if (wanted < 64) wanted = 64;
    void *moved = realloc(*array, wanted * size);
    if (!moved)
        return pal_diagnostic_set(build->diag, PAL_ERR_MEMORY, "%s: no memory for %zu pieces", build->name, wanted);
    *array = moved;
    *cap = wanted;
    return PAL_ERR_OK;
}

pal_err pal_mesh_reserve(pal_mesh_build *build, size_t n_vertex, size_t n_tri)
{
    void *x = build->x, *tri = build->tri;
    pal_err err = grow(build, &x, &build->cap_vertex, build->n_vertex, n_vertex, 3 * sizeof(double));
    build->x = x;
    if (err) return err;
    err = grow(build, &tri, &build->cap_tri, build->n_tri, n_tri, 3 * sizeof(int32_t));
    build->tri = tri;
    return err;
}

pal_err pal_mesh_vertex(pal_mesh_build *build, const double p[3])
{
    if (build->n_vertex == build->cap_vertex) PAL_TRY(pal_mesh_reserve(build, 1, 0));
    memcpy(build->x + 3 * build->n_vertex++, p, 3 * sizeof *p);
    return PAL_ERR_OK;
}

static pal_err add_triangle(pal_mesh_build *build, int64_t a, int64_t b, int64_t c)
{
    if (build->n_tri == build->cap_tri) PAL_TRY(pal_mesh_reserve(build, 0, 1));
    int32_t *tri = build->tri + 3 * build->n_tri++;
    tri[0] = (int32_t)a;
    tri[1] = (int32_t)b;
    tri[2] = (int32_t)c;
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
        return pal_mesh_refuse(build, at, "a face uses vertex index %lld", (long long)index);
    if (index > build->max_index) {
        build->max_index = index;
        build->max_index_at = at;
    }
    if (build->fan_n < 3) build->fan_n++;
    if (build->fan_n == 1) build->fan_first = index;
    if (build->fan_n == 3) PAL_TRY(add_triangle(build, build->fan_first, build->fan_last, index));
    build->fan_last = index;
    return PAL_ERR_OK;
}

pal_err pal_mesh_fan_end(pal_mesh_build *build)
{
    if (build->fan_n == 0 || build->fan_n_tri > 0) return PAL_ERR_OK;
    return add_triangle(build, build->fan_first, build->fan_last, build->fan_last);
}
