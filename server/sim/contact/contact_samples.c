/* Fixed and passing samples of triangles, fans and areas (contact_samples.h). */
#include "server/sim/contact/contact_samples.h"

#include "server/base/vec3.h"
#include "server/sim/contact/tuning.h"

#include <string.h>

static int cuts_of(double longest_m, double spacing_m)
{
    double n = ceil(longest_m / spacing_m);
    return n < 2 ? 1 : (int)fmin(n, 1000);
}

static int cuts(const pal_surface *surface, int tri, double spacing_m)
{
    const int32_t *corner = surface->tri + 3 * (size_t)tri;
    double longest = 0;
    for (int k = 0; k < 3; k++)
        longest =
            fmax(longest, pal_dist3(surface->x + 3 * (size_t)corner[k], surface->x + 3 * (size_t)corner[(k + 1) % 3]));
    return cuts_of(longest, spacing_m);
}

/* the largest number of samples that a mixture of levels can have: of every face those of its own or of its children,
 * whichever are more. A face beside a finer one is drawn in up to 3 triangles as long as itself */
static int64_t max_samples_of(const pal_levels *levels, double spacing_m, int32_t face)
{
    enum { PIECES = 3 };
    double longest = 0;
    for (int k = 0; k < 3; k++) {
        const int32_t *end = levels->edge[levels->face_edge[3 * (size_t)face + (size_t)k]].vertex;
        longest = fmax(longest, pal_dist3(levels->x + 3 * (size_t)end[0], levels->x + 3 * (size_t)end[1]));
    }
    int64_t n = cuts_of(longest, spacing_m), below = 0;
    n = n > 1 ? PIECES * n * n : 0;
    /* children are about half as long: below this there are no more of them */
    if (pal_levels_face_child(levels, face, 0) < 0 || n == 0) return n;
    for (int k = 0; k < 4; k++) below += max_samples_of(levels, spacing_m, pal_levels_face_child(levels, face, k));
    return n > below ? n : below;
}

static int64_t count_samples(const pal_body *body, double spacing_m)
{
    const pal_levels *levels = body->dofs.levels;
    int64_t n = 0;
    for (int32_t f = 0; levels && f < levels->first_face[1]; f++) n += max_samples_of(levels, spacing_m, f);
    for (int t = 0; t < body->display.surface->n_tri && !levels; t++) {
        int64_t c = cuts(body->display.surface, t, spacing_m);
        if (c > 1) n += c * c;
    }
    return n;
}

static double tri_area(const pal_surface *surface, int tri)
{
    const int32_t *corner = surface->tri + 3 * (size_t)tri;
    double n[3];
    pal_normal3(n, surface->x + 3 * (size_t)corner[0], surface->x + 3 * (size_t)corner[1],
                surface->x + 3 * (size_t)corner[2]);
    return 0.5 * pal_norm3(n);
}

/* centroids of the n^2 equal triangles that a triangle cut into n parts an edge has */
static int sample(int32_t *corner_out, float *share_out, const int32_t *corner, int n)
{
    int k = 0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n - i; j++)
            for (int half = 0; half < 2 && (half == 0 || j < n - i - 1); half++) {
                double third = half ? 2.0 / 3 : 1.0 / 3, u = (i + third) / n, w = (j + third) / n;
                memcpy(corner_out + 3 * (size_t)k, corner, 3 * sizeof *corner);
                float *share = share_out + 3 * (size_t)k++;
                share[0] = (float)(1 - u - w), share[1] = (float)u, share[2] = (float)w;
            }
    return k;
}

static pal_err allocate(const pal_body *body, pal_arena *arena, int n_sample, pal_contact_samples *t)
{
    size_t n_vertex = (size_t)body->display.n_shown, room = (size_t)n_sample + PASSING_MAX;
    size_t n_tri = (size_t)(body->active ? body->dofs.n_slot : body->display.surface->n_tri);
    t->corner = PAL_NEW(arena, int32_t, 3 * room);
    t->share = PAL_NEW(arena, float, 3 * room);
    t->area_m2 = PAL_NEW(arena, double, n_vertex + room);
    t->fan_start = PAL_NEW(arena, int32_t, n_vertex);
    t->fan_end = PAL_NEW(arena, int32_t, n_vertex);
    if (body->active) t->run = PAL_NEW(arena, int32_t, n_tri + 1);
    t->fan = PAL_NEW(arena, int32_t, 3 * n_tri);
    t->tri_mark = PAL_NEW(arena, uint32_t, n_tri);
    return t->corner && t->share && t->area_m2 && t->fan_start && t->fan_end && (t->run || !body->active) && t->fan &&
                   t->tri_mark
               ? PAL_ERR_OK
               : PAL_ERR_MEMORY;
}

/* fixed samples, as far as there is room, and the rest area of samples and vertices; returns how many samples */
static int make_samples(const pal_surface *surface, pal_contact_samples *t)
{
    int k = 0, room = t->max_point - PASSING_MAX - t->n_vertex;
    t->n_run = 0;
    for (int i = 0; i < surface->n_tri; i++) {
        const int32_t *corner = surface->tri + 3 * (size_t)i;
        double area = tri_area(surface, i);
        int n = cuts(surface, i, t->spacing_m);
        if (n == 1 || n * n > room - k) {
            for (int c = 0; c < 3; c++) t->area_m2[corner[c]] += area / 3;
            continue;
        }
        if (t->run) t->run[t->n_run++] = k;
        int made = sample(t->corner + 3 * (size_t)k, t->share + 3 * (size_t)k, corner, n);
        for (int j = 0; j < made; j++) t->area_m2[t->n_vertex + k + j] = area / made;
        k += made;
    }
    if (t->run) t->run[t->n_run] = k;
    return k;
}

/* fans, areas and fixed samples of the triangles that are drawn now; those of inactive vertices are not read */
static void find_triangles(const pal_body *body, pal_contact_samples *t)
{
    const pal_surface *surface = body->display.surface;
    size_t n_corner = 3 * (size_t)surface->n_tri;
    int32_t at = 0, n_vertex = body->active ? body->n_active : t->n_vertex;
    for (int k = 0; k < n_vertex; k++) t->area_m2[pal_body_point(body, k)] = t->fan_end[pal_body_point(body, k)] = 0;
    for (size_t i = 0; i < n_corner; i++) t->fan_end[surface->tri[i]]++;
    for (int k = 0; k < n_vertex; k++) {
        int32_t vertex = pal_body_point(body, k), n = t->fan_end[vertex];
        t->fan_start[vertex] = t->fan_end[vertex] = at;
        at += n;
    }
    for (size_t i = 0; i < n_corner; i++) t->fan[t->fan_end[surface->tri[i]]++] = (int32_t)(i / 3);
    t->n_fixed = t->n_point = t->n_vertex + make_samples(surface, t);
    t->revision = body->display.revision;
}

pal_err pal_contact_samples_make(const pal_body *body, double spacing_m, int max_sample, pal_arena *arena,
                                 pal_contact_samples *out)
{
    const pal_surface *surface = body->display.surface;
    if (!surface || body->display.n_shown <= 0 || surface->n_vertex != body->display.n_shown || !(spacing_m > 0))
        return PAL_ERR_REFUSED;
    int64_t n_sample;
    while ((n_sample = count_samples(body, spacing_m)) > max_sample) spacing_m *= 1.25;
    pal_contact_samples t = {.n_vertex = body->display.n_shown, .spacing_m = spacing_m};
    t.max_point = body->display.n_shown + (int)n_sample + PASSING_MAX;
    PAL_TRY(allocate(body, arena, (int)n_sample, &t));
    find_triangles(body, &t);
    *out = t;
    return PAL_ERR_OK;
}

bool pal_contact_samples_update_topology(pal_contact_samples *t, const pal_body *body)
{
    if (!body->active || t->revision == body->display.revision) return false;
    find_triangles(body, t);
    return true;
}

int pal_contact_samples_corners(const pal_contact_samples *t, int point, int32_t *vertex, double *share)
{
    if (point < t->n_vertex) {
        vertex[0] = point;
        share[0] = 1;
        return 1;
    }
    size_t k = 3 * (size_t)(point - t->n_vertex);
    for (size_t c = 0; c < 3; c++) {
        vertex[c] = t->corner[k + c];
        share[c] = (double)t->share[k + c];
    }
    share[0] = 1 - share[1] - share[2];
    return 3;
}

void pal_contact_samples_add_stretched(pal_contact_samples *t, const pal_body *body, const int32_t *list, int n)
{
    double spacing2 = t->spacing_m * t->spacing_m;
    for (int i = 0; i < n; i++)
        for (int k = t->fan_start[list[i]]; k < t->fan_end[list[i]]; k++) {
            int32_t tri = t->fan[k];
            const int32_t *corner = body->display.surface->tri + 3 * (size_t)tri;
            if (t->tri_mark[tri] == t->mark) continue;
            t->tri_mark[tri] = t->mark;
            double longest2 = 0;
            for (int c = 0; c < 3; c++) {
                const float *p = body->display.shown + 3 * (size_t)corner[c],
                            *q = body->display.shown + 3 * (size_t)corner[(c + 1) % 3];
                double x = (double)(p[0] - q[0]), y = (double)(p[1] - q[1]), z = (double)(p[2] - q[2]);
                double length2 = x * x + y * y + z * z;
                if (length2 > longest2) longest2 = length2;
            }
            if (!(longest2 > spacing2) || cuts(body->display.surface, tri, t->spacing_m) > 1) continue;
            /* as far as there is room */
            int cut = (int)fmin(ceil(sqrt(longest2 / spacing2)), sqrt(t->max_point - t->n_point));
            if (cut < 1) return;
            size_t at = (size_t)(t->n_point - t->n_vertex);
            int made = sample(t->corner + 3 * at, t->share + 3 * at, corner, cut);
            double area = tri_area(body->display.surface, tri) / made;
            for (int j = 0; j < made; j++) t->area_m2[t->n_point++] = area;
        }
}
