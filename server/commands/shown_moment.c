/* Vertices of no triangle, as an adaptive surface has, are left out. */
#include "server/commands/shown_moment.h"

#include "server/base/flags.h"
#include "server/base/heap.h"
#include "server/base/vec3.h"
#include "server/mesh/files/glb_file.h"
#include "server/mesh/files/vtk_file.h"
#include "server/net/transport/plain_text.h"

#include <math.h>
#include <stdio.h>

enum { LOOKS = PAL_LOOK_IMAGE + PAL_IMAGES_MAX };

/* a body's surface of its used vertices */
typedef struct shown_mesh {
    char name[PAL_NAME];
    int n_vertex, n_tri;
    float *x, *normal, *uv; /* uv NULL: no images */
    double *moved_m;        /* since rest [n_vertex][3] */
    int32_t *tri;           /* by their look            */
    int n_of[LOOKS];        /* triangles of each look   */
} shown_mesh;

static void free_mesh(shown_mesh *m)
{
    PAL_FREE(m->x, m->normal, m->uv, m->moved_m, m->tri);
    memset(m, 0, sizeof *m);
}

static bool is_drawn(const int32_t tri[3])
{
    return tri[0] != tri[1] && tri[1] != tri[2] && tri[2] != tri[0];
}

/* Tissue is drawn alike from outside and inside; images that the scene does not have are tissue. */
static int look_of(const pal_shown *shown, int32_t vertex, int n_image)
{
    const int look = shown->look ? shown->look[vertex] : PAL_LOOK_OUTSIDE;
    return look >= PAL_LOOK_IMAGE && look < PAL_LOOK_IMAGE + n_image && look < LOOKS ? look : PAL_LOOK_OUTSIDE;
}

/* Area-weighted; a copied vertex has the normal of the one that it copies, so that shading has no seam. Some unit
 * vector where there is no area. normal [n_vertex][3], zeroed. */
static void find_normals(const pal_shown *shown, const float *x, const int32_t *tri, int n_tri, double *normal)
{
    for (int t = 0; t < n_tri; t++) {
        const int32_t *corner = tri + 3 * (size_t)t;
        double p[3][3], u[3], v[3], n[3];
        if (!is_drawn(corner)) continue;
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 3; c++) p[k][c] = (double)x[3 * (size_t)corner[k] + (size_t)c];
        pal_sub3(u, p[1], p[0]);
        pal_sub3(v, p[2], p[0]);
        pal_cross3(n, u, v);
        for (int k = 0; k < 3; k++) {
            const int32_t i = corner[k], own = i < shown->n_own ? i : shown->copy_of[i - shown->n_own];
            pal_add3(normal + 3 * (size_t)own, normal + 3 * (size_t)own, n);
        }
    }
    for (int i = 0; i < shown->n_vertex; i++) {
        double *n = normal + 3 * (size_t)i;
        const double length = sqrt(pal_dot3(n, n));
        if (i < shown->n_own)
            for (int c = 0; c < 3; c++) n[c] = length > 0 ? n[c] / length : c == 2;
        else
            pal_copy3(n, normal + 3 * (size_t)shown->copy_of[i - shown->n_own]);
    }
}

static pal_err allocate(shown_mesh *m, const pal_shown *shown, int n_tri)
{
    pal_err err = PAL_ERR_OK;
    PAL_ARRAY(&err, m->x, 3 * (size_t)shown->n_vertex);
    PAL_ARRAY(&err, m->normal, 3 * (size_t)shown->n_vertex);
    PAL_ARRAY(&err, m->moved_m, 3 * (size_t)shown->n_vertex);
    PAL_ARRAY(&err, m->tri, 3 * (size_t)n_tri);
    if (shown->uv) PAL_ARRAY(&err, m->uv, 2 * (size_t)shown->n_vertex);
    return err;
}

/* numbers of the used vertices, -1: unused, and the triangles by their look */
static void number_vertices(shown_mesh *m, const pal_shown *shown, const int32_t *tri, int n_tri, int n_image,
                            int32_t *number)
{
    for (int i = 0; i < shown->n_vertex; i++) number[i] = -1;
    for (int t = 0; t < n_tri; t++)
        for (int k = 0; k < 3 && is_drawn(tri + 3 * (size_t)t); k++) number[tri[3 * (size_t)t + (size_t)k]] = 0;
    for (int i = 0; i < shown->n_vertex; i++)
        if (number[i] == 0) number[i] = m->n_vertex++;
    for (int look = 0; look < LOOKS; look++)
        for (int t = 0; t < n_tri; t++) {
            const int32_t *corner = tri + 3 * (size_t)t;
            if (!is_drawn(corner) || look_of(shown, corner[0], n_image) != look) continue;
            for (int k = 0; k < 3; k++) m->tri[3 * (size_t)m->n_tri + (size_t)k] = number[corner[k]];
            m->n_tri++, m->n_of[look]++;
        }
}

static pal_err take_mesh(const pal_shown *shown, const pal_frame_part *part, int n_image, shown_mesh *m)
{
    const int32_t *tri = part->n_slot > 0 ? part->slot : shown->tri;
    const int n_tri = part->n_slot > 0 ? part->n_slot : shown->n_tri;
    double *normal;
    int32_t *number;
    pal_err err = allocate(m, shown, n_tri);
    pal_plain_text(m->name, sizeof m->name, shown->name);
    PAL_ZEROED(&err, normal, 3 * (size_t)shown->n_vertex);
    PAL_ARRAY(&err, number, shown->n_vertex);
    if (err) return PAL_FREED(err, normal, number);
    number_vertices(m, shown, tri, n_tri, n_image, number);
    find_normals(shown, part->position_m, tri, n_tri, normal);
    for (int i = 0; i < shown->n_vertex; i++) {
        if (number[i] < 0) continue;
        const size_t from = 3 * (size_t)i, to = 3 * (size_t)number[i];
        for (size_t c = 0; c < 3; c++) {
            m->x[to + c] = part->position_m[from + c];
            m->normal[to + c] = (float)normal[from + c];
            m->moved_m[to + c] = (double)part->position_m[from + c] - (double)shown->rest_m[from + c];
        }
        /* ours are from the lower left, those of glTF from the upper left */
        for (size_t c = 0; c < 2 && m->uv; c++) {
            const float at = shown->uv[2 * (size_t)i + c];
            m->uv[2 * (size_t)number[i] + c] = c ? 1 - at : at;
        }
    }
    return PAL_FREED(PAL_ERR_OK, normal, number);
}

/* ---- glTF ---- */

/* colours of tissue, sRGB, by appearance; those of the page (clients/viewer/src/tissue_looks.js) */
static const struct {
    const char *appearance;
    uint32_t rgb;
} colours[] = {{"liver", 0x743a34},  {"gall_bladder", 0x74895f}, {"stomach", 0xb98d85},  {"intestine", 0xcba39a},
               {"kidney", 0x7d423a}, {"spleen", 0x62323f},       {"pancreas", 0xd3a178}, {"heart", 0x8c4540},
               {"lung", 0xd9a49c},   {"brain", 0xd8b2a4},        {"vessel", 0xab4c48},   {"bone", 0xe4d6b6},
               {"fat", 0xe2bd62},    {"muscle", 0x8a443d},       {"skin", 0xd9a58a},     {"plastic", 0x6f8797}};
enum { TISSUE_RGB = 0x985248 };

static void colour_of(const pal_body_def *def, uint8_t rgb[3])
{
    uint32_t value = TISSUE_RGB;
    for (size_t k = 0; k < sizeof colours / sizeof *colours; k++)
        if (!strcmp(def->appearance, colours[k].appearance)) value = colours[k].rgb;
    if (def->colour[0]) value = (uint32_t)strtoul(def->colour + 1, NULL, 16);
    for (int c = 0; c < 3; c++) rgb[c] = (uint8_t)(value >> (16 - 8 * c));
}

enum { PARTS = PAL_BODY_MAX * LOOKS };
typedef struct glb_lists {
    pal_glb_mesh mesh[PAL_BODY_MAX];
    pal_glb_part part[PARTS];
    pal_glb_material material[PARTS];
    char name[PARTS][PAL_NAME + 16]; /* of the materials */
    int n_part;                      /* and of materials */
} glb_lists;

/* each look of a body has a part and a material */
static void list_parts(glb_lists *g, const shown_mesh *m, const pal_body_def *def, pal_glb_mesh *out)
{
    int first = 0;
    *out = (pal_glb_mesh){.name = m->name,
                          .n_vertex = m->n_vertex,
                          .x = m->x,
                          .normal = m->normal,
                          .uv = m->uv,
                          .part = g->part + g->n_part};
    for (int look = 0; look < LOOKS; look++) {
        if (m->n_of[look] == 0) continue;
        pal_glb_material *material = &g->material[g->n_part];
        char *name = g->name[g->n_part];
        const int image = look - PAL_LOOK_IMAGE;
        snprintf(name, sizeof *g->name, image < 0 ? "%.*s" : "%.*s image %d", PAL_NAME - 1, m->name, image + 1);
        *material = (pal_glb_material){.name = name, .image = image < 0 ? NULL : &def->image[image]};
        colour_of(def, material->rgb);
        g->part[g->n_part] = (pal_glb_part){m->n_of[look], g->n_part, m->tri + 3 * (size_t)first};
        first += m->n_of[look];
        g->n_part++, out->n_part++;
    }
}

static pal_err write_glb(const char *path, const pal_scene *scene, const shown_mesh *mesh, int n, double now_s,
                         pal_diagnostic *diag)
{
    glb_lists *g = calloc(1, sizeof *g); /* too large for the stack */
    if (!g) return pal_diagnostic_set(diag, PAL_ERR_MEMORY, "%s: no memory", path);
    pal_glb_scene out = {.name = scene->name, .time_s = now_s, .n_mesh = n, .mesh = g->mesh, .material = g->material};
    pal_copy3(out.up, scene->up);
    for (int k = 0; k < n; k++) list_parts(g, &mesh[k], &scene->body[k], &g->mesh[k]);
    out.n_material = g->n_part;
    return PAL_FREED(pal_mesh_write_glb(path, &out, diag), g);
}

/* ---- VTP ---- */

static pal_err write_vtp(const char *path, const shown_mesh *mesh, int n, pal_diagnostic *diag)
{
    size_t n_vertex = 0, n_tri = 0;
    double *x, *moved, *body;
    int32_t *tri;
    pal_err err = PAL_ERR_OK;
    for (int k = 0; k < n; k++) n_vertex += (size_t)mesh[k].n_vertex, n_tri += (size_t)mesh[k].n_tri;
    PAL_ARRAY(&err, x, 3 * n_vertex);
    PAL_ARRAY(&err, moved, 3 * n_vertex);
    PAL_ARRAY(&err, body, n_tri);
    PAL_ARRAY(&err, tri, 3 * n_tri);
    if (err) pal_diagnostic_set(diag, err, "%s: no memory for %zu triangles", path, n_tri);
    n_vertex = n_tri = 0;
    for (int k = 0; k < n && !err; k++) {
        const shown_mesh *m = &mesh[k];
        for (size_t i = 0; i < 3 * (size_t)m->n_vertex; i++) x[3 * n_vertex + i] = (double)m->x[i];
        memcpy(moved + 3 * n_vertex, m->moved_m, 3 * sizeof *moved * (size_t)m->n_vertex);
        for (size_t t = 0; t < (size_t)m->n_tri; t++) body[n_tri + t] = k + 1;
        for (size_t i = 0; i < 3 * (size_t)m->n_tri; i++) tri[3 * n_tri + i] = m->tri[i] + (int32_t)n_vertex;
        n_vertex += (size_t)m->n_vertex, n_tri += (size_t)m->n_tri;
    }
    const pal_vtk_field point = {"displacement_m", 3, moved}, cell = {"body", 1, body};
    const pal_vtk_grid grid = {.n_node = (int)n_vertex,
                               .n_element = (int)n_tri,
                               .n_corner = 3,
                               .x = x,
                               .node = tri,
                               .n_point = 1,
                               .n_cell = 1,
                               .point = &point,
                               .cell = &cell};
    if (!err) err = pal_mesh_write_vtp(path, &grid, diag);
    return PAL_FREED(err, x, moved, body, tri);
}

/* ---- a moment ---- */

static pal_err take(pal_shown_moment *moment, const pal_scene *scene, const pal_world *world, double now_s,
                    pal_diagnostic *diag)
{
    shown_mesh mesh[PAL_BODY_MAX] = {0};
    pal_frame *frame = pal_frame_create(world);
    pal_err err = frame ? PAL_ERR_OK : PAL_ERR_MEMORY;
    if (frame) pal_world_frame(world, frame);
    const int n = frame ? frame->n_part : 0;
    for (int k = 0; k < n && !err; k++) {
        pal_shown shown;
        pal_world_shown(world, k, &shown);
        err = take_mesh(&shown, &frame->part[k], scene->body[k].n_image, &mesh[k]);
    }
    if (err) pal_diagnostic_set(diag, err, "no memory for the surfaces of a moment");
    if (!err && moment->glb) err = write_glb(moment->glb, scene, mesh, n, now_s, diag);
    if (!err && moment->vtp) err = write_vtp(moment->vtp, mesh, n, diag);
    for (int k = 0; k < n; k++) free_mesh(&mesh[k]);
    pal_frame_destroy(frame);
    moment->time_s = now_s;
    moment->written = !err;
    return err;
}

pal_err pal_shown_moment_step(pal_shown_moment *moment, const pal_scene *scene, const pal_world *world, double now_s,
                              pal_diagnostic *diag)
{
    const bool wanted = (moment->glb || moment->vtp) && !moment->written;
    /* a rounding of the time does not delay the moment by a step */
    return wanted && now_s >= moment->at_s - 1e-9 ? take(moment, scene, world, now_s, diag) : PAL_ERR_OK;
}

pal_err pal_shown_moment_end(pal_shown_moment *moment, const pal_scene *scene, const pal_world *world, double now_s,
                             pal_diagnostic *diag)
{
    if (moment->written || (!moment->glb && !moment->vtp)) return PAL_ERR_OK;
    if (isfinite(moment->at_s)) return PAL_REFUSE(diag, "--at: %g s: the recording ends at %g s", moment->at_s, now_s);
    return take(moment, scene, world, now_s, diag);
}
